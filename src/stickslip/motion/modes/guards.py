"""Guards along a Taylor step: those violated immediately, and the first of the others to fire."""

from __future__ import annotations

from typing import NamedTuple

from stickslip.arrays import Array
from stickslip.motion.admissible.leaving import find_leaving
from stickslip.motion.admissible.overload import LEAVES
from stickslip.motion.admissible.sharing import ON_ITS_OWN, any_share, find_shared, is_first
from stickslip.motion.algebra.roots import divide_out, first_crossing
from stickslip.motion.steps.arrays import (
    ADMISSIBLE,
    ADMISSIBLE_SIZE,
    DIMENSION,
    MASSIVE,
    NOWHERE,
    ON_INERTIAL,
    REQUIRED,
    SLIPPING,
    SLIPS,
    TOWARDS,
    Flow,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import is_loose, opens
from stickslip.motion.steps.sets import (
    force_terms,
    gap_size,
    kink_terms,
    may_share,
    plane_of,
    rate_terms,
    whole_rate,
    whole_speed,
)
from stickslip.motion.steps.starting import is_prescribed
from stickslip.motion.steps.step_size import impulse
from stickslip.numerics.levels import EPSILON, FIRED, INSTANT, ROUNDING
from stickslip.translator import RELAXED, compiled

# largest length of a slip in a plane, in the shortest steps that times resolve
_LONGEST_END = 1024.0
_LATE = 2.0 * EPSILON  # relative error of the time of an event
_DOUBTFUL = 1e-12  # fraction of a threshold: this close to zero it may have become negative
_PRIME = 576460752303423433  # 2⁵⁹ − 55: five times as much still fits into an integer
# Columns of Space.labels: the number of a guard that may fire, and the degree of its polynomial;
# negative if it is violated at the start.
NUMBER, _DEGREE = range(2)


class GuardRow(NamedTuple):
    """A row that must be nonnegative in a mode: sign·W[row] + W[shift].

    Attributes
    ----------
    row, shift : int
        Rows of the table of coefficients; no second one if `shift` is negative.
    size, rate : float
        Scales of the rounding errors of its value, and of its rate.
    near : float
        Time, in units of that of the coefficients, within which a zero of it is known.
    precision : float
        What counts as zero, in parts of these scales.
    is_gap : bool
        Whether it is a gap: then its rate is a velocity, known to its own rounding errors however
        small a bounce is beside those of the gap; so is that of a slip that has just ended.
    late, turning : float
        By how much the time of a zero, and that at which its derivatives vanish, too, is a rounded
        number, in parts of the step.
    """

    row: int
    shift: int
    sign: float
    size: float
    rate: float
    near: float
    precision: float
    is_gap: bool
    late: float
    turning: float


@compiled(relaxed=RELAXED)
def fall(W: Array, row: int, shift: int, sign: float, N: int, powers: Array) -> float:
    """Bound Σ max(−cₖ, 0) hᵏ of the decrease of sign·W[row] + W[shift], which starts positive,
    within the step.

    Parameters
    ----------
    W : array
        Taylor coefficients.
    row, shift : int
        Rows; no second one if `shift` is negative.
    N : int
        Number of coefficients.
    powers : array
        Of the step h, in the unit of time of the coefficients.
    """
    total = 0.0
    if shift < 0:
        for k in range(N):
            total -= min(sign * W[row, k], 0.0) * powers[k]
    else:
        for k in range(N):
            total -= min(sign * W[row, k] + W[shift, k], 0.0) * powers[k]
    return total


@compiled()
def leading_term(
    W: Array, guard: GuardRow, N: int, powers: Array, slack: float, c: Array
) -> tuple[int, int]:
    """Sign of a guard for small times, and the order of its leading Taylor term.

    Its coefficients, scaled to the step, are left in c. A zero is known no better than the time at
    which it was found: relative to what the guard does in the steps on both sides.

    Parameters
    ----------
    W : array
        Taylor coefficients.
    N : int
        Number of coefficients.
    powers : array
        Of the step, in the unit of time of the coefficients.
    slack : float
        Rounding errors that count as zero.
    c : array
        Receives the coefficients.

    Returns
    -------
    sign, order : int
        1 or −1, and the order; 0 and N if the guard vanishes.
    """
    largest = 0.0
    for k in range(N):
        v = guard.sign * W[guard.row, k]
        if guard.shift >= 0:
            v += W[guard.shift, k]
        c[k] = v * powers[k]
        if k > 0:
            largest = max(largest, abs(c[k]))
    floor = guard.precision * (guard.size + guard.near * guard.rate + largest)
    floor += guard.late * abs(c[1])
    if c[0] > floor:
        return 1, 0
    if c[0] < -floor:
        return -1, 0
    floor = slack * ROUNDING * (guard.size + powers[1] * guard.rate + largest)
    slipping = max(floor, guard.precision * powers[1] * guard.rate)
    if guard.is_gap:
        slipping = slack * ROUNDING * powers[1] * guard.rate
    for k in range(1, N):
        # A contact that has just begun to slip has zero acceleration by definition.
        at_least = floor if k > 1 else slipping
        if k < N - 1:
            at_least += guard.turning * (k + 1) * abs(c[k + 1])
        if c[k] > at_least:
            return 1, k
        if c[k] < -at_least:
            return -1, k
    return 0, N


@compiled()
def resting(mode: int) -> bool:
    """Whether a contact does not slip: it sticks, or others carry it while it is at its
    threshold."""
    return mode == 0 or abs(mode) == 2


@compiled()
def stands(rows: Rows, mode: Array) -> bool:
    """Whether every contact rests that is not open, and there is one."""
    found = False
    for c in rows.openings:
        found = found or mode[c] == 0
    for c in rows.frictional:
        if not is_loose(rows, mode, c):
            if not resting(mode[c]):
                return False
            found = True
    return found


@compiled()
def extended_word(word: int, mode: Array, region: Array) -> int:
    """Append the mode of each contact and the region of each kink to a word, which is a number.

    Words that differ have different numbers but for chance (polynomials over a prime field).
    """
    for c in range(len(mode)):
        word = (5 * word + mode[c] + 2) % _PRIME
    for j in range(len(region)):
        word = (5 * word + region[j]) % _PRIME
    return word


@compiled()
def stays(
    rows: Rows, space: Space, mode: Array, c: int, N: int, last: float, fired: int, slack: float
) -> bool:
    """Whether the relative velocity of a contact that does not stick vanishes for a while.

    Parameters
    ----------
    space : Space
        With the coefficients, and the powers of the step.
    mode : array of int, shape (contacts,)
    c, N : int
        The contact, and the order of the series.
    last : float
        Length of the last step.
    fired : int
        The switch that has just fired, or −1.
    slack : float
        Rounding errors that count as zero.
    """
    W = space.W
    mag = space.mag
    nk = len(rows.kinks)
    unit = space.W[rows.sizes[DIMENSION], 1]
    row = rows.u[c]
    near = last / unit + space.powers[1]
    precision = max(FIRED if nk + c == fired else 0.0, slack * ROUNDING)
    size = mag[c]
    rate = rate_terms(rows, mag, c) * unit + abs(W[row, 1])
    if abs(W[row, 0]) > precision * (size + near * rate):
        return False
    spare = space.pending[len(space.pending) - 1]
    guard = GuardRow(row, NOWHERE, 1.0, size, rate, near, precision, False, 0.0, 0.0)
    s, _ = leading_term(W, guard, N, space.powers, slack, spare)
    return s == 0


# -- numbers of guards and switches ----------------------------------------------------------------
# Guards: kinks, then two for each contact (towards slip+, or back to stick; towards slip−), then
# what must not become negative. Switches: kinks, then contacts.


@compiled()
def contact_of(guard: int, nk: int) -> int:
    """The contact of a guard that is not that of a kink."""
    return (guard - nk) // 2


@compiled()
def guard_at(rows: Rows, c: int) -> int:
    """The number of the first guard of a contact."""
    return len(rows.kinks) + 2 * c


@compiled()
def is_second(guard: int, nk: int) -> bool:
    """Whether a guard is the second one of a contact: towards slip−."""
    return (guard - nk) % 2 == 1


@compiled()
def requirement_of(guard: int, nk: int, nc: int) -> int:
    """Number of a guard among the rows that must not become negative; negative if it is not one of
    them."""
    return guard - nk - 2 * nc


@compiled()
def switch_of(guard: int, nk: int, nc: int) -> int:
    """The switch to which a guard belongs; −1 for rows that are required to be nonnegative."""
    if guard < nk:
        return guard
    return nk + contact_of(guard, nk) if requirement_of(guard, nk, nc) < 0 else -1


@compiled()
def may_collide(rows: Rows, cause: int) -> bool:
    """Whether a switch is that of a contact that can open: it has closed, or opened."""
    c = cause - len(rows.kinks)
    return bool(c >= 0 and opens(rows, c))


@compiled()
def is_active(rows: Rows, mode: Array, nk: int, g: int) -> bool:
    """Whether a guard restricts the motion in a mode."""
    if g < nk:
        return True
    d = requirement_of(g, nk, len(mode))
    if d >= 0:
        c = rows.required[d, SLIPPING]
        return c < 0 or mode[c] * rows.required[d, TOWARDS] > 0
    c = contact_of(g, nk)
    return bool(mode[c] == 0) if is_second(g, nk) else not is_loose(rows, mode, c)


@compiled()
def guard_in_plane(
    rows: Rows, space: Space, mode: Array, c: int, near: float
) -> tuple[int, float, float]:
    """The guard of a contact in a plane.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    c : int
        Its first component.
    near : float
        As in :class:`GuardRow`.

    Returns
    -------
    row, size, rate
        As in :class:`GuardRow`.
    """
    W = space.W
    mag = space.mag
    unit = W[rows.sizes[DIMENSION], 1]
    plane = plane_of(rows, c)
    if mode[c] == 0:
        row = plane[ADMISSIBLE]
        return row, mag[plane[ADMISSIBLE_SIZE]] + near * abs(W[row, 1]), 0.0
    # A slip is over when its speed is zero up to rounding errors, or its time cannot be
    # distinguished from that of its end.
    row = plane[SLIPS]
    rate = whole_rate(rows, mag, c) * unit + abs(W[row, 1])
    late = INSTANT * abs(W[rows.sizes[DIMENSION], 0]) / unit
    if space.powers[1] <= 0.5 * late:
        late = _LONGEST_END * space.powers[1]
    size = whole_speed(rows, mag, c) + late / ROUNDING * abs(W[row, 1])
    return row, size, rate


@compiled()
def guard_of(
    rows: Rows, space: Space, mode: Array, reg: Array, g: int, near: float, precision: float
) -> GuardRow:
    """A guard of a mode by its number; zeros are known within the time `near`, in units of that of
    the coefficients.

    Parameters
    ----------
    space : Space
        With the coefficients, and the powers of the step.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    g : int
        The number.
    near, precision : float
        As in :class:`GuardRow`.
    """
    W = space.W
    mag = space.mag
    powers = space.powers
    unit = W[rows.sizes[DIMENSION], 1]
    nk = len(rows.kinks)
    nc = len(rows.u)
    i = contact_of(g, nk)
    shift = NOWHERE
    sign = 1.0
    rate = 0.0
    around = near
    exact = precision
    is_gap = False
    if g < nk:
        row = rows.kinks[g]
        sign = 1.0 if reg[g] == 1 else -1.0
        size = kink_terms(rows, mag, g)
        rate = abs(W[row, 1])
        if rows.timed[g] == 1:
            around += abs(W[rows.sizes[DIMENSION], 0]) / unit  # rounding of the time
        if rows.vanishing[g] >= 0 and powers[1] > 0.0:
            rate += impulse(rows, mag, rows.vanishing[g], unit * powers[1]) / powers[1]
    elif requirement_of(g, nk, nc) >= 0:
        d = requirement_of(g, nk, nc)
        row, i = rows.required[d, REQUIRED], rows.required[d, SLIPPING]
        around = 0.0
        exact = _DOUBTFUL
        size = abs(W[row, 0]) + abs(W[row, 1]) * powers[1]
        if i >= 0:
            size += max(W[rows.plus[i], 0], W[rows.minus[i], 0])
    elif rows.plane[i] >= 0:
        row, size, rate = guard_in_plane(rows, space, mode, i, near)
        # the rate of change of a speed is known, however small it is
        is_gap = mode[i] != 0 and plane_of(rows, i)[MASSIVE] == 1
    elif opens(rows, i):
        is_gap = mode[i] != 0
        if is_gap:
            row = rows.gaps[i]
            size = gap_size(rows, space, i)
            rate = (mag[i] + near * unit * rate_terms(rows, mag, i)) * unit + abs(W[row, 1])
        else:
            row = rows.force[i]
            size = force_terms(rows, mag, i) + near * abs(W[row, 1])
    elif mode[i] == 0 and not is_prescribed(rows, i):
        row = rows.force[i]
        shift = rows.minus[i] if is_second(g, nk) else rows.plus[i]
        sign = -1.0 if is_second(g, nk) else 1.0
        terms = abs(W[row, 1]) + abs(W[rows.plus[i], 1]) + abs(W[rows.minus[i], 1])
        size = force_terms(rows, mag, i) + near * terms
    else:
        row = rows.u[i]
        sign = 1.0 if mode[i] > 0 or (mode[i] == 0 and is_second(g, nk)) else -1.0
        size = mag[i]
        rate = rate_terms(rows, mag, i) * unit + abs(W[row, 1])
    return GuardRow(row, shift, sign, size, rate, around, exact, is_gap, 0.0, 0.0)  # pyright: ignore[reportArgumentType]


@compiled()
def just_fired(guard: GuardRow, late: float, turning: float, exact: bool) -> GuardRow:
    """The same guard at an event.

    Parameters
    ----------
    late, turning : float
        As of a guard.
    exact : bool
        Whether its rate is known to its own rounding errors.
    """
    return GuardRow(
        guard.row,
        guard.shift,
        guard.sign,
        guard.size,
        guard.rate,
        guard.near,
        guard.precision,
        guard.is_gap or exact,
        late,
        turning,
    )


@compiled()
def has_stopped(rows: Rows, settled: Array, fired: int) -> int:
    """The contact with mass, along a line, whose slip has just ended; or −1.

    It is its velocity that is zero by definition there; its force and its acceleration are known
    as well as any other.

    Parameters
    ----------
    settled : array of int, shape (contacts,)
        Mode before the last event.
    fired : int
        The switch that has just fired, or −1.
    """
    c = fired - len(rows.kinks)
    if c < 0 or c >= rows.sizes[ON_INERTIAL] or rows.states[c] < 3:
        return NOWHERE
    return c if abs(settled[c]) == 1 else NOWHERE


@compiled()
def note_violated(space: Space, g: int, violated: int, count: int) -> tuple[int, int]:
    """Add a guard to the violated ones, as :func:`scan` returns them; the first one discards the
    guards that may fire."""
    if violated < 0:
        violated = g
        count = 0
    space.labels[count, NUMBER] = g
    return violated, count + 1


@compiled()
def note_together(
    flow: Flow,
    mode: Array,
    g: int,
    near: float,
    late: float,
    lack: float,
    violated: int,
    count: int,
) -> tuple[int, int]:
    """Evaluate the guard of contacts that share their forces; returns what :func:`scan` returns.

    Parameters
    ----------
    g, near, late, lack
        As in :func:`guard_together`.
    violated, count : int
        Results of :func:`scan` for the guards before it.
    """
    space = flow.space
    N = flow.order
    held, s, order = guard_together(flow, mode, g, near, late, lack, space.pending[count])
    if held:
        return violated, count
    if s < 0:
        return note_violated(space, g, violated, count)
    if violated >= 0:
        return violated, count
    space.labels[count, NUMBER] = g
    space.labels[count, _DEGREE] = N - 1 - order
    divide_out(space.pending[count], order, N)
    space.pending[count, N] = 0.0
    return violated, count + 1


@compiled()
def scan(
    flow: Flow, mode: Array, reg: Array, settled: Array, last: float, fired: int, slack: float
) -> tuple[int, int]:
    """Look at all guards of a mode: (least guard that is violated at once, or −1; number of guards
    that may fire, or of those that are violated).

    What is below `slack` rounding errors counts as zero.

    Parameters
    ----------
    flow : Flow
        Its work space has the coefficients and the powers of the step; it receives what may fire,
        or what is violated.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    settled : array of int, shape (contacts,)
        Mode before the last event.
    last : float
        Length of the last step.
    fired : int
        The switch that has just fired, or −1.
    """
    rows = flow.rows
    space = flow.space
    W = space.W
    N = flow.order
    powers = space.powers
    labels = space.labels
    nk = len(rows.kinks)
    nc = len(rows.u)
    count = 0
    violated = NOWHERE
    leapt = space.previous_regions[nk]
    near = last / W[rows.sizes[DIMENSION], 1] + powers[1]
    late = slack * _LATE * abs(W[rows.sizes[DIMENSION], 0]) / W[rows.sizes[DIMENSION], 1]
    late = late / powers[1] if powers[1] > 0.0 else 0.0
    stopped = has_stopped(rows, settled, fired)
    sharing = any_share(rows)
    if sharing:
        find_shared(flow, mode, W)
    for g in rows.guards:
        if not is_active(rows, mode, nk, g):
            continue
        just = switch_of(g, nk, nc) == fired or g == leapt
        if sharing and is_held_with_others(space, nk, nc, g):
            if represents_group(rows, mode, nk, g):
                own = fired >= nk and may_share(rows, fired - nk, contact_of(g, nk))
                lack = max(FIRED if own else 0.0, slack * ROUNDING)
                violated, count = note_together(flow, mode, g, near, late, lack, violated, count)
            continue
        own = stopped >= 0 and nk <= g and contact_of(g, nk) == stopped
        just = just and not (own and mode[stopped] == 0)
        precision = max(FIRED if just else 0.0, slack * ROUNDING)
        guard = guard_of(rows, space, mode, reg, g, near, precision)
        if just or slack > 1.0:
            # A ramp begins at a kink; the force of a contact rotates there, unless no mode remains.
            guard = just_fired(guard, late, late if g < nk or slack > 1.0 else 0.0, own)
        start = guard.sign * W[guard.row, 0] + (W[guard.shift, 0] if guard.shift >= 0 else 0.0)
        if start > guard.precision * (guard.size + guard.near * guard.rate) and start > fall(
            W, guard.row, guard.shift, guard.sign, N, powers
        ):
            continue
        c = space.pending[count]
        s, order = leading_term(W, guard, N, powers, slack, c)
        requirement = requirement_of(g, nk, nc) >= 0
        if s == 0:
            # A slip between given motions whose velocity vanishes counts as stick: that alone could
            # hold or release the contact.
            i = contact_of(g, nk)
            if requirement or g < nk or mode[i] == 0 or not is_prescribed(rows, i):
                continue
            s = -1
        if s < 0 and not requirement:
            violated, count = note_violated(space, g, violated, count)
            continue
        if violated >= 0:
            continue
        labels[count, NUMBER] = g
        labels[count, _DEGREE] = N - 1 - order if s > 0 else -1
        divide_out(c, order, N)  # the remaining polynomial starts positive
        # the remaining polynomial of a gap is as exact as its velocity
        size = 0.0 if guard.is_gap and order > 0 else guard.size
        c[N] = ROUNDING * (size + powers[1] * guard.rate)
        count += 1
    return violated, count


@compiled()
def is_held_with_others(space: Space, nk: int, nc: int, g: int) -> bool:
    """Whether a guard is that of a contact that shares its force with others.

    Parameters
    ----------
    space : Space
        Says which do.
    nk, nc, g : int
        Number of kinks, of contacts, and of the guard.
    """
    if g < nk or requirement_of(g, nk, nc) >= 0:
        return False
    return bool(space.leaving[contact_of(g, nk)] != ON_ITS_OWN)


@compiled()
def represents_group(rows: Rows, mode: Array, nk: int, g: int) -> bool:
    """Whether a guard represents all contacts that share their forces."""
    return not is_second(g, nk) and is_first(rows, mode, contact_of(g, nk))


@compiled()
def guard_together(
    flow: Flow, mode: Array, g: int, near: float, late: float, lack: float, c: Array
) -> tuple[bool, int, int]:
    """The guard of contacts that share their forces: whether they hold throughout the step; else
    its sign for small times, and the order that decides it.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    g : int
        Number of the guard.
    near, late : float
        As in :class:`GuardRow`.
    lack : float
        Part of the forces that counts as zero.
    c : array
        Receives the coefficients, scaled to the step.
    """
    space = flow.space
    leaves, size = find_leaving(flow, mode, contact_of(g, len(flow.rows.kinks)), lack)
    if not leaves:
        return True, 1, 0
    rate = abs(space.aside[LEAVES, 1])
    guard = GuardRow(LEAVES, NOWHERE, 1.0, size, rate, near, lack, False, late, 0.0)
    s, order = leading_term(space.aside, guard, flow.order, space.powers, lack / ROUNDING, c)
    return s == 0, s, order


@compiled()
def first_event(space: Space, count: int, N: int) -> tuple[float, int]:
    """Earliest event of the step among the guards that may fire: (fraction of the step, guard or
    −1)."""
    limit = 1.0
    which = -1
    for i in range(count):
        d = space.labels[i, _DEGREE]
        if d < 0:
            return 0.0, space.labels[i, NUMBER]
        x = first_crossing(space.pending[i], d, limit, space.pending[i, N], space.stack)
        if x <= limit:
            limit = x
            which = space.labels[i, NUMBER]
    return limit, which
