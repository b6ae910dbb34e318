"""Impacts during a motion: approaching contacts, responses to unit impulses, the end of bouncing.

The law that impulses obey is in :mod:`stickslip.motion.admissible.impacts_law`.
"""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.motion.admissible.impacts_law import (
    BEFORE,
    MODE_BEFORE,
    NEAR,
    RESTITUTION,
    largest_jump,
    put_friction,
    put_part,
    takes_part,
)
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.modes.surfaces import stop, touching
from stickslip.motion.steps.arrays import (
    DIMENSION,
    HOLDS_BACK,
    HOLDS_FORWARD,
    LAST,
    MATRIX,
    NOW,
    NOWHERE,
    OK,
    ON_INERTIAL,
    PART,
    PRESSING,
    RUBBING,
    SPAN,
    WIDEST,
    Flow,
    Instant,
    Lane,
    Machine,
    Rows,
)
from stickslip.motion.steps.contacts import inertial_friction, loosen_friction, set_mode
from stickslip.motion.steps.sets import rate_terms
from stickslip.motion.steps.starting import coefficients
from stickslip.numerics.levels import NO_SPEED, ROUNDING
from stickslip.translator import compiled

# fraction of the length of the motion below which the rest of a bounce is negligible
_TOGETHER = 1e-13
# square of the fraction of its duration that defines the size of the gaps of a motion
_AT_FIRST = 1e-9
_ALMOST = 1e-2  # relative distance from the paradox at which a motion ends


@compiled()
def approaching(
    machine: Machine, flow: Flow, here: Instant, last: float, fired: int, slack: float
) -> int:
    """Number of closed contacts that approach; the closed contacts, and all velocities, are left in
    the work space.

    Parameters
    ----------
    last : float
        Length of the last step.
    fired : int
        The contact that has just closed, which is so by definition; or negative.
    slack : float
        Times the tolerance of a gap below which it is closed.
    """
    rows = flow.rows
    space = flow.space
    work = space.impact
    loosen_friction(rows, here.mode)
    coefficients(machine, flow, here, 1, space.V)
    found = 0
    for c in range(rows.sizes[ON_INERTIAL]):
        work[BEFORE, c] = space.V[rows.u[c], 0]
        space.tried[NEAR, c] = 0
    for c in rows.openings:
        near = abs(space.V[rows.gaps[c], 0]) <= slack * touching(flow, c, last)
        if near or c == fired:
            space.tried[NEAR, c] = 1
            found += 1 if work[BEFORE, c] < -NO_SPEED * space.mag[c] else 0
    return found


@compiled()
def size_gaps(machine: Machine, flow: Flow, here: Instant, span: float) -> None:
    """Set the sizes of the gaps of a motion at its start: the opening that its forces would produce
    in a fraction of its time span, since a gap that starts at zero has no size."""
    rows = flow.rows
    space = flow.space
    coefficients(machine, flow, here, 1, space.V)
    for c in rows.openings:
        size = _AT_FIRST * span * span * rate_terms(rows, space.mag, c)
        space.impact[WIDEST, c] = max(space.impact[WIDEST, c], size)


@compiled()
def first_approaching(
    machine: Machine, flow: Flow, here: Instant, last: float, going: bool, opened: int
) -> int:
    """The first contact that is closed and approaches; −1 if there is none.

    Parameters
    ----------
    last : float
        Length of the last step.
    going : bool
        Whether the motion is under way, in the mode of the instant: what has been closed does not
        approach but for rounding errors.
    opened : int
        Another contact that has been closed: it has just opened; or negative.
    """
    if approaching(machine, flow, here, last, NOWHERE, 1.0) == 0:
        return NOWHERE
    space = flow.space
    for c in flow.rows.openings:
        slow = -NO_SPEED * space.mag[c]
        near = space.tried[NEAR, c] == 1
        kept = going and (here.mode[c] == 0 or c == opened)
        if near and space.impact[BEFORE, c] < slow and not kept:
            return int(c)
    return NOWHERE


@compiled()
def open_all(rows: Rows, mode: Array) -> None:
    """Open all contacts that can open."""
    for c in rows.openings:
        mode[c] = 1
    loosen_friction(rows, mode)


@compiled()
def put_responses(machine: Machine, flow: Flow, at: Instant) -> bool:
    """Responses of the rates, M⁻¹Jᵀ, and of the velocities of all contacts, J M⁻¹ Jᵀ, to unit
    impulses of the participating contacts; False if the inertia is not definite.

    Parameters
    ----------
    flow : Flow
        Its work space receives them.
    at : Instant
        Its mode is used up.
    """
    rows = flow.rows
    space = flow.space
    for c in range(rows.sizes[ON_INERTIAL]):
        at.mode[c] = 1
    if not resolve(rows, flow.k, space, at.mode):
        return False
    for c in inertial_friction(rows):
        if space.impact[BEFORE, c] < 0.0:
            set_mode(rows, at.mode, c, -1)
    if coefficients(machine, flow, at, 1, space.V) != OK:
        return False
    for p in range(len(rows.parts)):
        if rows.parts[p, MATRIX] == 0:
            put_part(rows, space, flow.k.J, p, False)
    put_friction(rows, space)
    return True


@compiled()
def stop_what_is_held(machine: Machine, flow: Flow, lane: Lane) -> None:
    """After an impact: put contacts that its impulses hold exactly onto the surface.

    What is left of those velocities are rounding errors of the jump, large beside their own terms:
    they would make a slip, or a flight, of their own.
    """
    rows = flow.rows
    space = flow.space
    largest = largest_jump(rows, space.impact)
    here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
    if not resolve(rows, flow.k, space, lane.mode):
        return
    if coefficients(machine, flow, here, 1, space.W) != OK:
        return
    for c in range(rows.sizes[ON_INERTIAL]):
        held = lane.mode[c] == 0 and takes_part(rows, space.tried, c)
        if held and abs(space.W[rows.u[c], 0]) <= ROUNDING * largest:
            stop(flow, space.W, lane.y, lane.mode, c)


@compiled()
def settles(machine: Machine, flow: Flow, lane: Lane) -> bool:
    """Whether a rebounding contact would come to rest, after infinitely many impacts, in a time
    that cannot be resolved: 2 γ⁺/(|g̈| (1 − e)). Such contacts lose their restitution."""
    rows = flow.rows
    space = flow.space
    work = space.impact
    here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
    unit = space.W[rows.sizes[DIMENSION], 1]
    found = False
    if not resolve(rows, flow.k, space, lane.mode):
        return False
    if coefficients(machine, flow, here, flow.order, space.W) != OK:
        return False
    for c in rows.openings:
        e = work[RESTITUTION, c]
        if space.tried[NEAR, c] == 1 and lane.mode[c] == 1 and e > 0.0:
            speed = space.W[rows.u[c], 0]
            falling = -2.0 * space.W[rows.gaps[c], 2] / (unit * unit)
            if falling > 0.0 and 2.0 * speed <= _TOGETHER * lane.clock[SPAN] * falling * (1.0 - e):
                work[RESTITUTION, c] = 0.0
                found = True
    return found


@compiled()
def is_paradox(machine: Machine, flow: Flow, lane: Lane) -> bool:
    """Whether friction changes a normal force so much that there may be no acceleration that obeys
    Coulomb's law (Painlevé): G_NN ≤ Σ μ |G_NT| of a contact that is closed."""
    rows = flow.rows
    space = flow.space
    here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
    for c in range(len(lane.mode)):
        space.tried[MODE_BEFORE, c] = lane.mode[c]
    approaching(machine, flow, here, lane.clock[LAST], NOWHERE, 1.0)
    known = put_responses(machine, flow, here)
    for c in range(len(lane.mode)):
        lane.mode[c] = space.tried[MODE_BEFORE, c]
    found = False
    for n in rows.openings:
        if known and space.tried[NEAR, n] == 1:
            left = space.delassus[n, n] * (1.0 - _ALMOST)
            for link in range(len(rows.links)):
                c = rows.links[link, RUBBING]
                rubbing = space.tried[NEAR, rows.links[link, PRESSING]] == 1
                if rubbing and rows.homes[c, PART] == rows.homes[n, PART]:
                    mu = max(space.impact[HOLDS_FORWARD, link], space.impact[HOLDS_BACK, link])
                    left -= mu * abs(space.delassus[n, c])
            found = found or left <= 0.0
    return bool(found)
