"""Impacts: where a gap closes with a velocity, velocities jump and positions do not.

Newton's law with Coulomb's friction, in impulses, for all contacts that are closed or closing
(γ: normal and tangential velocities before and after):

    0 ≤ Λ_N ⟂ γ_N⁺ + e_N γ_N⁻ ≥ 0,   Λ_T ∈ −μ Λ_N Sign(γ_T⁺ + e_T γ_T⁻),   M (q̇⁺ − q̇⁻) = JᵀΛ

(Ch. Glocker, *Set-Valued Force Laws*, 2001, chapter 10). In a mode of the contacts this is the
linear problem of accelerations with other right-hand sides: a contact that takes part asks for
J Δq̇ = −(1 + e) γ⁻, one that slips has Λ_T = ∓μ Λ_N. So its inverse is the one that ``jets`` makes.
All modes of the contacts concerned are tried; of those that satisfy the law the one that loses most
energy is taken. Contacts with a given threshold have bounded forces and take no impulse.
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.machine_code.functions import njit
from stickslip.motion.engine.guards import loosen_friction, opens
from stickslip.motion.engine.modes import TOUCHING
from stickslip.motion.steps.arrays import (
    CONTACTS,
    COORDINATES,
    DIMENSION,
    FIRST_ROW,
    INERTIAL,
    INLINED,
    MEMBERS,
    MOVING,
    NOW,
    NOWHERE,
    OK,
    ON_INERTIAL,
    OPTIONS,
    SPAN,
    Flow,
    Instant,
    Lane,
    Machine,
    Rows,
    coefficients,
    direction_entry,
    gap_size,
)

# What :func:`collide` says: nothing collides; velocities have jumped; no impulse obeys the law; or
# only such that create energy.
NO_IMPACT, JUMPED, NO_IMPULSE, CREATES = range(4)
# Rows of Space.impact: velocities of contacts before and after, impulses, and the restitution that
# counts; then, by coordinate, the change of the rates and the best one so far.
BEFORE, AFTER, IMPULSE, RESTITUTION, CHANGE, BEST = range(6)
# Rows of Space.tried: which contacts take part, the mode before, and the best mode so far.
_NEAR, _KEPT, _CHOSEN = range(3)
_MOST_MODES = 65536
_CREATED = 1e-9  # part of the energy of an impact that may be a rounding error
_SLOW = 1e-12  # part of their terms below which velocities are zero
_TOGETHER = 1e-13  # of the time that a motion may last: what of bouncing is left then is none


@njit(**INLINED)
def collide(machine: Machine, flow: Flow, lane: Lane, last: float) -> int:
    """Let velocities jump where a gap is closed and would become negative.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    lane : Lane
        Its rates jump, and its mode becomes a guess of the next one.
    last : float
        Length of the last step.

    Returns
    -------
    int
        From NO_IMPACT to CREATES.
    """
    rows = flow.rows
    space = flow.space
    work = space.impact
    tried = space.tried
    here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
    if approaching(machine, flow, here, last) == 0:
        return NO_IMPACT
    mq = rows.sizes[ON_INERTIAL]
    nq = rows.sizes[INERTIAL]
    for c in range(mq):
        tried[_KEPT, c] = lane.mode[c]
        work[RESTITUTION, c] = space.V[rows.restitution[c], 0] if rows.restitution[c] >= 0 else 0.0
    for _ in range(mq + 1):
        found = best_impulse(machine, flow, here)
        for c in range(mq):
            lane.mode[c] = tried[_KEPT, c]
        if found != JUMPED:
            return found
        for q in range(nq):
            lane.y[nq + q] += work[BEST, q]
        guess_mode(rows, tried, work, lane.mode)
        if not settles(machine, flow, lane):
            return JUMPED
        # What is left of the bounces cannot be told from none: once more, without restitution.
        for q in range(nq):
            lane.y[nq + q] -= work[BEST, q]
    return JUMPED


@njit(**INLINED)
def approaching(machine: Machine, flow: Flow, here: Instant, last: float) -> int:
    """How many contacts are closed and approach; which are closed, and all their velocities, are
    left in the work space."""
    rows = flow.rows
    space = flow.space
    work = space.impact
    loosen_friction(rows, here.mode)
    coefficients(machine, flow, here, 1, space.V)
    found = 0
    for c in range(rows.sizes[ON_INERTIAL]):
        work[BEFORE, c] = space.V[rows.u[c], 0]
        space.tried[_NEAR, c] = 0
        if opens(rows, c):
            gap = space.V[rows.gaps[c], 0]
            size = gap_size(rows, space, c) + last * space.mag[c]
            closed = abs(gap) <= TOUCHING * size
            space.tried[_NEAR, c] = 1 if closed else 0
            if closed and work[BEFORE, c] < -_SLOW * space.mag[c]:
                found += 1
    return found


@njit(**INLINED)
def first_approaching(machine: Machine, flow: Flow, here: Instant, last: float) -> int:
    """The first contact that is closed and approaches; −1 if there is none."""
    if approaching(machine, flow, here, last) == 0:
        return NOWHERE
    space = flow.space
    for c in range(flow.rows.sizes[ON_INERTIAL]):
        slow = -_SLOW * space.mag[c]
        if opens(flow.rows, c) and space.tried[_NEAR, c] == 1 and space.impact[BEFORE, c] < slow:
            return c
    return NOWHERE


@njit(**OPTIONS)
def open_all(rows: Rows, mode: Array) -> None:
    """Let everything be open that can."""
    for c in range(rows.sizes[ON_INERTIAL]):
        if opens(rows, c):
            mode[c] = 1
    loosen_friction(rows, mode)


@njit(**INLINED)
def best_impulse(machine: Machine, flow: Flow, at: Instant) -> int:
    """The impulses that obey the law and lose most energy; the change of the rates is left in the
    work space."""
    rows = flow.rows
    work = flow.space.impact
    tried = flow.space.tried
    total = modes_of(rows, tried)
    least = np.inf
    largest = 0.0
    for number in range(total if total <= _MOST_MODES else 0):
        right, gained, size = try_impulses(machine, flow, at, number)
        largest = max(largest, size)
        if right and gained < least:
            least = gained
            for q in range(rows.sizes[INERTIAL]):
                work[BEST, q] = work[CHANGE, q]
            for c in range(rows.sizes[ON_INERTIAL]):
                tried[_CHOSEN, c] = at.mode[c]
    if not least < np.inf:
        return NO_IMPULSE
    return JUMPED if least <= _CREATED * largest else CREATES


@njit(**INLINED)
def try_impulses(
    machine: Machine, flow: Flow, at: Instant, number: int
) -> tuple[bool, float, float]:
    """Impulses in the mode that a number stands for: whether they obey the law, the energy that
    they gain, and the size of its terms."""
    rows = flow.rows
    space = flow.space
    choose_impulse_mode(number, rows, space.tried, at.mode)
    if coefficients(machine, flow, at, 1, space.V) != OK:
        return False, 0.0, 0.0
    make_impulses(flow, at.mode)
    gained, size, right = judge_impulses(rows, space.V, space.impact, space.tried, at.mode)
    return right, gained, size


@njit(**OPTIONS)
def modes_of(rows: Rows, tried: Array) -> int:
    """Number of modes of an impact: what is closed takes part or not, its friction sticks or
    slips."""
    total = 1
    for c in range(rows.sizes[ON_INERTIAL]):
        if total <= _MOST_MODES:
            if opens(rows, c) and tried[_NEAR, c] == 1:
                total *= 2
            elif rows.parents[c] >= 0 and tried[_NEAR, rows.parents[c]] == 1:
                total *= 3
    return total


@njit(**OPTIONS)
def choose_impulse_mode(number: int, rows: Rows, tried: Array, mode: Array) -> None:
    """Put the contacts into the mode that a number stands for; whatever takes no part slips."""
    for c in range(rows.sizes[ON_INERTIAL]):
        mode[c] = 1
        if opens(rows, c) and tried[_NEAR, c] == 1:
            mode[c] = number % 2
            number //= 2
        elif rows.parents[c] >= 0 and tried[_NEAR, rows.parents[c]] == 1:
            mode[c] = number % 3 - 1
            number //= 3
    loosen_friction(rows, mode)


@njit(**OPTIONS)
def make_impulses(flow: Flow, mode: Array) -> None:
    """Impulses, the change of the rates, and the velocities after it, in a mode of which the
    inverses are in the work space."""
    rows = flow.rows
    space = flow.space
    work = space.impact
    for q in range(rows.sizes[INERTIAL]):
        work[CHANGE, q] = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        work[IMPULSE, c] = 0.0
        work[AFTER, c] = work[BEFORE, c]
    for p in range(len(rows.parts)):
        if rows.parts[p, MOVING] == 0:
            continue
        n = rows.parts[p, COORDINATES]
        m = rows.parts[p, CONTACTS]
        first = rows.parts[p, FIRST_ROW]
        members = rows.members[rows.parts[p, MEMBERS] :]
        for i in range(n + m):
            total = 0.0
            for j in range(m):
                c = members[n + j]
                if mode[c] == 0:
                    asked = -(1.0 + work[RESTITUTION, c]) * work[BEFORE, c]
                    total += space.Rq[first + i, n + j] * asked
            if i < n:
                work[CHANGE, members[i]] = total
            else:
                work[IMPULSE, members[i]] = total
        for j in range(m):
            c = members[n + j]
            for i in range(n):
                weight = direction_entry(rows, flow.k.J, space.V, c, i)
                work[AFTER, c] += weight * work[CHANGE, members[i]]


@njit(**OPTIONS)
def judge_impulses(
    rows: Rows, table: Array, work: Array, tried: Array, mode: Array
) -> tuple[float, float, bool]:
    """Energy gained, the size of its terms, and whether impulses obey the law.

    Parameters
    ----------
    rows : Rows
    table : array
        Values of the rows.
    work, tried : arrays
        As of :class:`stickslip.motion.steps.arrays.Space`.
    mode : array of int
        Of the impact.
    """
    gained = 0.0
    size = 0.0
    largest = 0.0
    fastest = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        largest = max(largest, abs(work[IMPULSE, c]))
        fastest = max(fastest, abs(work[BEFORE, c]), abs(work[AFTER, c]))
        gained += 0.5 * work[IMPULSE, c] * (work[BEFORE, c] + work[AFTER, c])
        size += 0.5 * abs(work[IMPULSE, c]) * (abs(work[BEFORE, c]) + abs(work[AFTER, c]))
    strong = 1e-10 * largest
    fast = 1e-10 * fastest
    right = True
    for c in range(rows.sizes[ON_INERTIAL]):
        moved = work[AFTER, c] + work[RESTITUTION, c] * work[BEFORE, c]
        if opens(rows, c) and tried[_NEAR, c] == 1:
            right = right and (work[IMPULSE, c] >= -strong if mode[c] == 0 else moved >= -fast)
        elif rows.parents[c] >= 0 and tried[_NEAR, rows.parents[c]] == 1:
            normal = rows.parents[c]
            if mode[normal] != 0:
                continue
            if mode[c] == 0:
                held = table[rows.friction[c], 0] * work[IMPULSE, normal]
                right = right and abs(work[IMPULSE, c]) <= held + strong
            else:
                right = right and mode[c] * moved >= -fast
    return gained, size, right


@njit(**OPTIONS)
def guess_mode(rows: Rows, tried: Array, work: Array, mode: Array) -> None:
    """After an impact: what has rebounded is open, the rest is closed and sticks if it is at
    rest."""
    fastest = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        fastest = max(fastest, abs(work[BEFORE, c]))
    for c in range(rows.sizes[ON_INERTIAL]):
        if opens(rows, c) and tried[_NEAR, c] == 1:
            after = work[AFTER, c]
            if tried[_CHOSEN, c] == 0:
                after = -work[RESTITUTION, c] * work[BEFORE, c]
            mode[c] = 1 if after > 1e-10 * fastest else 0
    for c in range(rows.sizes[ON_INERTIAL]):
        if rows.parents[c] >= 0 and tried[_NEAR, rows.parents[c]] == 1:
            mode[c] = tried[_CHOSEN, c]
    loosen_friction(rows, mode)


@njit(**INLINED)
def settles(machine: Machine, flow: Flow, lane: Lane) -> bool:
    """Whether a contact that has rebounded would come to rest, after infinitely many impacts, in a
    time that cannot be resolved: 2 γ⁺/(|g̈| (1 − e)). Such contacts lose their restitution."""
    rows = flow.rows
    space = flow.space
    work = space.impact
    here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
    unit = space.W[rows.sizes[DIMENSION], 1]
    found = False
    if coefficients(machine, flow, here, flow.order, space.W) != OK:
        return False
    for c in range(rows.sizes[ON_INERTIAL]):
        e = work[RESTITUTION, c]
        if opens(rows, c) and space.tried[_NEAR, c] == 1 and lane.mode[c] == 1 and e > 0.0:
            speed = space.W[rows.u[c], 0]
            falling = -2.0 * space.W[rows.gaps[c], 2] / (unit * unit)
            if falling > 0.0 and 2.0 * speed <= _TOGETHER * lane.clock[SPAN] * falling * (1.0 - e):
                work[RESTITUTION, c] = 0.0
                found = True
    return found


@njit(**INLINED)
def distance_of_jump(
    machine: Machine, flow: Flow, before: Instant, after: Array, last: float, only: int
) -> float:
    """How far a jump of the rates is from the nearest one that obeys the law of impacts.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    before : Instant
        Before the jump; its mode is used up.
    after : array
        State after it.
    last : float
        Length of the step that ends there.
    only : int
        A contact beside which none takes part that is open; negative: all do that touch.

    Returns
    -------
    float
        Largest difference of a rate; infinite if no impulses obey the law.
    """
    rows = flow.rows
    space = flow.space
    work = space.impact
    nq = rows.sizes[INERTIAL]
    least = 0.0
    for q in range(nq):
        least = max(least, abs(after[nq + q] - before.y[nq + q]))
    near = approaching(machine, flow, before, last)
    for c in range(rows.sizes[ON_INERTIAL]):
        if only >= 0 and c != only and before.mode[c] != 0:
            space.tried[_NEAR, c] = 0
        if c == only:
            space.tried[_NEAR, c] = 1
            near += 1
        work[RESTITUTION, c] = space.V[rows.restitution[c], 0] if rows.restitution[c] >= 0 else 0.0
    if near == 0:
        return float(least)
    total = modes_of(rows, space.tried)
    least = np.inf
    for number in range(total if total <= _MOST_MODES else 0):
        right, gained, size = try_impulses(machine, flow, before, number)
        if right and gained <= _CREATED * size:
            off = 0.0
            for q in range(nq):
                jump = after[nq + q] - before.y[nq + q]
                off = max(off, abs(jump - work[CHANGE, q]))
            least = min(least, off)
    return float(least)
