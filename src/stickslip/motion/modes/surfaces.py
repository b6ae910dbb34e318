"""The constraints of a mode: sticking contacts have the velocity of their surface, closed contacts
no gap.

States are put back onto them here; what is away from them by more than rounding errors, and more
than a step makes of it, slips or is open.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.algebra.vectors import clear
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    AIM_SPEED,
    BENDS,
    CAUSE,
    COORDINATES,
    FIRST_ROW,
    INERTIAL,
    LEAD,
    MEMBERS,
    NOW,
    NOWHERE,
    OK,
    ON_INERTIAL,
    PART,
    RECENT,
    SEAT,
    SPAN,
    Flow,
    Instant,
    Lane,
    Machine,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import (
    direction_entry,
    directions_of,
    has_opened,
    opens,
    own_directions,
    own_inverse,
    presses,
    set_mode,
)
from stickslip.motion.steps.sets import (
    force_terms,
    gap_size,
    is_at_rest,
    may_share,
    rate_terms,
    whole_rate,
    whole_speed,
)
from stickslip.motion.steps.starting import coefficients
from stickslip.numerics.levels import FIRED, INSTANT, ON_SURFACE, ROUNDING
from stickslip.translator import compiled

_NOTHING = 1e-250  # velocity or position regarded as zero in any units
_MOST_STOPS = 24  # projections after which rounding errors underflow
_WIDE = 4.0  # factor on rounding errors: a velocity that is zero for slip is zero for stick as well
_LOOSELY = 1e-3  # fraction of the tolerance, if that is loose
_TOUCHING = 1e-12  # relative to the size of a gap and its change in a step: smaller gaps are zero


@compiled(brief=True)
def release_or_hold(
    flow: Flow, at: Instant, last: float, near: float, span: float, sure: bool
) -> bool:
    """Put sticking inertial contacts exactly on the surface speed; one that is not there (it cannot
    jump) slips.

    Parameters
    ----------
    flow : Flow
        With the values of the rows, and the inverses of the mode.
    at : Instant
        Its state is put back, and its mode changed.
    last, near : float
        Length of recent steps, and of the longest step for which slip was denied here: what was
        zero to that is zero to stick, or else neither would go on.
    span : float
        Time that the motion may last.
    sure : bool
        Whether what is closed has no velocity but for rounding errors, however large they are
        beside its terms.

    Returns
    -------
    bool
        False if contacts were released, one of each component, so that the mode has changed.
    """
    rows = flow.rows
    space = flow.space
    W = space.W
    mag = space.mag
    mode = at.mode
    asked = space.asked
    mq = rows.sizes[ON_INERTIAL]
    released = False
    clear(asked)
    for c in range(mq):
        if mode[c] != 0:
            continue
        gap = W[rows.u[c], 0]
        gapped = opens(rows, c)
        # All directions together have come to rest.
        block = own_directions(rows, c)
        rate = 0.0
        for i in block:
            rate += held_back(rows, space, i)
        slow = (ON_SURFACE * last + _WIDE * ROUNDING * near) * rate
        if len(block) > 1:
            size = whole_speed(rows, mag, rows.lead[c])
            slow += _WIDE * (ROUNDING * size + INSTANT * abs(at.t) * rate)
        else:
            slow += ROUNDING * mag[c]
            if gapped:
                slow += _WIDE * ROUNDING * mag[c]
                # Towards the end of a slip steps are as short as a rounding error of the time.
                slow += _WIDE * INSTANT * abs(at.t) * rate if rows.beside[c] == 1 else 0.0
        fast = abs(gap) > slow and not (sure and gapped)
        # Axes may make one direction of a plane much larger than another.
        fast = fast and not is_at_rest(rows, W, c, _WIDE)
        if fast or is_apart(flow, c, last, span):
            # Contacts of other components hold the same whether this one does or not.
            if asked[rows.homes[c, PART]] == 0:
                set_mode(rows, mode, c, 1 if gap > 0.0 else -1)
            asked[rows.homes[c, PART]] = 1
            released = True
    if released:
        return False
    for c in range(mq):
        if mode[c] == 0:
            stop(flow, W, at.y, mode, c)
    for c in rows.openings:
        if mode[c] == 0:
            # A closed contact stays on the surface itself, too.
            part = rows.homes[c, PART]
            first = rows.parts[part, FIRST_ROW]
            distance = W[rows.gaps[c], 0]
            for i in range(rows.parts[part, COORDINATES]):
                q = rows.members[rows.parts[part, MEMBERS] + i]
                at.y[q] -= space.Rq[first + i, rows.homes[c, SEAT] - first] * distance
                if rows.beside[c] == 1 and abs(at.y[q]) <= _NOTHING:
                    at.y[q] = 0.0
    return True


@compiled(brief=True)
def are_numbers(flow: Flow, mode: Array) -> bool:
    """Whether the sizes of velocities, rates and forces of sticking contacts are finite: otherwise
    there is no criterion for zero velocity. On the wrong side of a kink a formula may be undefined,
    or overflow."""
    rows = flow.rows
    mag = flow.space.mag
    for c in range(rows.sizes[ON_INERTIAL]):
        known = mag[c] + rate_terms(rows, mag, c) + force_terms(rows, mag, c)
        if mode[c] == 0 and not math.isfinite(known):
            return False
    return True


@compiled(brief=True)
def stop(flow: Flow, table: Array, y: Array, mode: Array, c: int) -> None:
    """Remove the remaining velocity of a sticking contact, relative to its surface, from the rates.

    Parameters
    ----------
    flow : Flow
        With the inverses of the mode.
    table : array
        Values of the rows.
    y : array
        State; its rates are changed.
    mode : array of int, shape (contacts,)
    c : int
        The contact.
    """
    rows = flow.rows
    R = flow.space.Rq
    u = table[rows.u[c], 0]
    if is_on_surface(flow, table, c):
        return
    part = rows.homes[c, PART]
    block = own_directions(rows, c)
    first = rows.parts[part, FIRST_ROW]
    for i in range(rows.parts[part, COORDINATES]):
        if is_moved_by_friction(flow, table, mode, c, i):
            continue
        q = rows.sizes[INERTIAL] + rows.members[rows.parts[part, MEMBERS] + i]
        y[q] -= R[first + i, rows.homes[c, SEAT] - first] * u
        if rows.beside[c] == 1:
            # A remainder within rounding errors, in any direction, is zero. The others may move
            # coordinates of another part only.
            size = 0.0
            left = 0.0
            for d in block:
                left += abs(table[rows.u[d], 0])
                if rows.homes[d, PART] == part:
                    size += abs(R[first + i, rows.homes[d, SEAT] - first])
            # A single direction has the same tolerance as two.
            size *= left if len(block) > 1 else 4.0 * left
            if abs(y[q]) <= max(ROUNDING * size, _NOTHING):
                y[q] = 0.0


@compiled()
def is_on_surface(flow: Flow, table: Array, c: int) -> bool:
    """Whether a sticking contact has the velocity of its surface: exactly; or, with friction in a
    plane, up to rounding errors. A correction would gain nothing there, and its impulse would move
    contacts beside it that begin to slip from rest.

    Parameters
    ----------
    table : array
        Values of the rows, with their sizes in the work space.
    """
    rows = flow.rows
    near = ROUNDING * flow.space.mag[c] if rows.beside[c] == 1 else 0.0
    return bool(abs(table[rows.u[c], 0]) <= near)


@compiled()
def all_on_surface(flow: Flow, mode: Array) -> bool:
    """Whether all that sticks has the velocity of its surface."""
    for c in range(flow.rows.sizes[ON_INERTIAL]):
        if mode[c] == 0 and not is_on_surface(flow, flow.space.W, c):
            return False
    return True


@compiled(brief=True)
def is_moved_by_friction(flow: Flow, table: Array, mode: Array, c: int, i: int) -> bool:
    """Whether a slip in a plane, under the normal force of a contact, moves a coordinate of their
    component.

    What puts the contact back onto its surface is no impulse, and moves nothing else: a slip that
    begins is at rest, exactly. Where friction changes the normal force, they move the same, and
    only a slip that begins has nothing taken from it.

    Parameters
    ----------
    table : array
        Values of the rows.
    mode : array of int, shape (contacts,)
    c, i : int
        The contact, and the place of the coordinate in the component.
    """
    rows, J = flow.rows, flow.k.J
    for plane in rows.planes:
        first = plane[LEAD]
        if mode[first] == 0 or not presses(rows, c, first):
            continue
        if plane[BENDS] == 0 or table[plane[AIM_SPEED], 0] == 0.0:
            for d in directions_of(rows, first):
                if direction_entry(rows, J, table, d, i) != 0.0:
                    return True
    return False


@compiled()
def held_back(rows: Rows, space: Space, c: int) -> float:
    """The acceleration that a sticking contact holds back, or could."""
    force = force_terms(rows, space.mag, c)
    return rate_terms(rows, space.mag, c) + force / abs(own_inverse(rows, space, c))


@compiled()
def is_apart(flow: Flow, c: int, last: float, span: float) -> bool:
    """Whether a contact that can open is not closed, up to the change of its gap in a step and to
    rounding errors, or as it is if it has just closed; a gap due to rounding errors of forces opens
    no faster than these allow."""
    rows = flow.rows
    space = flow.space
    if not is_wide(flow, c, last):
        return False
    drift = abs(space.W[rows.u[c], 0])
    drifts = drift <= ROUNDING * held_back(rows, space, c) * span
    return not (drifts and abs(space.W[rows.gaps[c], 0]) <= drift * span)


@compiled()
def is_wide(flow: Flow, c: int, last: float) -> bool:
    """Whether the gap of a contact exceeds its change in a step, and rounding errors."""
    if not opens(flow.rows, c):
        return False
    closed = max(touching(flow, c, last), FIRED * gap_size(flow.rows, flow.space, c))
    return bool(abs(flow.space.W[flow.rows.gaps[c], 0]) > closed)


@compiled()
def touching(flow: Flow, c: int, last: float) -> float:
    """The distance below which a contact is closed: a fraction of the size of its gap, and of the
    effect of velocities and forces in a step."""
    mag = flow.space.mag
    moved = last * (mag[c] + last * rate_terms(flow.rows, mag, c))
    return float(max(_TOUCHING, _LOOSELY * flow.tol) * (gap_size(flow.rows, flow.space, c) + moved))


@compiled()
def begin_at_rest(machine: Machine, flow: Flow, lane: Lane) -> None:
    """After an event, set the velocities of contacts in a plane that have just left stick, or may
    leave it now, to those of their surfaces: a slip begins exactly from rest, and not from rounding
    errors. The same holds for a slip that began so shortly before that its speed is a rounding
    error, and for a contact that opens, with those that open together with it: if all forces vanish
    at that instant, there is no other measure of rounding errors.

    Stopping one contact moves the others by rounding errors of its correction, which decrease from
    iteration to iteration until they vanish.
    """
    rows = flow.rows
    c = lane.counters[CAUSE] - len(rows.kinks)
    if lane.counters[CAUSE] < 0:
        return
    before = flow.space.touched
    opened = just_opened(rows, lane)
    asked = opened >= 0
    apart = lane.mode[opened] if asked else 0
    if asked:
        set_mode(rows, lane.mode, opened, 0)
    here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
    asks, told = True, False
    for p in rows.massive_planes:
        first = rows.planes[p, LEAD]
        before[first] = lane.mode[first]
        left = leaves_with(rows, lane, first, c)
        if asks and not left and lane.mode[first] != 0:
            asks = False
            told = resolve(rows, flow.k, flow.space, lane.mode)
            told = told and coefficients(machine, flow, here, 1, flow.space.V) == OK
        if told and not left and lane.mode[first] != 0:
            left = hardly_slips(flow, here, first)
        asked = asked or left or lane.mode[first] == 0
        if left:
            set_mode(rows, lane.mode, first, 0)
    if not asked:
        return
    recent, span = lane.clock[RECENT], lane.clock[SPAN]
    known = resolve(rows, flow.k, flow.space, lane.mode)
    for _ in range(_MOST_STOPS):
        known = known and coefficients(machine, flow, here, 1, flow.space.W) == OK
        known = known and are_numbers(flow, lane.mode)
        if not known or all_on_surface(flow, lane.mode):
            break
        known = release_or_hold(flow, here, recent, 0.0, span, opened >= 0)
    for p in rows.massive_planes:
        first = rows.planes[p, LEAD]
        if before[first] != 0:
            set_mode(rows, lane.mode, first, before[first])
    if opened >= 0:
        set_mode(rows, lane.mode, opened, apart)


@compiled()
def hardly_slips(flow: Flow, at: Instant, c: int) -> bool:
    """Whether the speed of a contact in a plane cannot be distinguished from zero at an instant
    that is known up to rounding; its direction would change within less than that.

    Parameters
    ----------
    flow : Flow
        With the values of the rows.
    c : int
        Its first direction.
    """
    rows, mag = flow.rows, flow.space.mag
    speed = 0.0
    for i in directions_of(rows, c):
        speed += abs(flow.space.V[rows.u[i], 0])
    late = INSTANT * abs(at.t) * whole_rate(rows, mag, c)
    return bool(speed <= ROUNDING * whole_speed(rows, mag, c) + late)


@compiled()
def just_opened(rows: Rows, lane: Lane) -> int:
    """The contact whose opening is the last event; −1 if the last event is another one."""
    c = lane.counters[CAUSE] - len(rows.kinks)
    if c < 0 or not has_opened(rows, lane.mode, c) or lane.settled[c] != 0:
        return NOWHERE
    return int(c)


@compiled()
def leaves_with(rows: Rows, lane: Lane, first: int, c: int) -> bool:
    """Whether a contact in a plane has just left stick, where the switch of contact c has fired:
    with those that it shared its force with, or with the normal force that has pressed it.

    Parameters
    ----------
    first, c : int
        The first component of the one, and the other.
    """
    if first == c:
        return True
    together = c >= 0 and (may_share(rows, first, c) or presses(rows, c, first))
    return bool(together and lane.settled[first] == 0 and lane.mode[first] != 0)
