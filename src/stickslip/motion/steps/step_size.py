"""The size of a Taylor step.

Two conditions: the last terms of the series are small, and nothing is hidden in the terms that were
left out. The first sees what the series shows; the second bounds what it cannot show
(:mod:`stickslip.motion.discs`), loosely: a pulse that underflows where the step begins has a
bound that is larger by hundreds of orders of magnitude.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.layout import ORDERS
from stickslip.equations.codegen.program import OPERATION, RESULT
from stickslip.motion.discs.spreading import reach, spread, spread_state
from stickslip.motion.discs.tables import (
    BALL,
    CHAIN,
    DIRECTION_ROW,
    LOG,
    OFF,
    ROTATION,
    TANH,
    DiscTape,
)
from stickslip.motion.steps.arrays import (
    ADMISSIBLE,
    AIM_SPEED,
    DIMENSION,
    INERTIAL,
    LEAD,
    Flow,
    Instant,
    Machine,
    Rows,
    tape_of,
)
from stickslip.motion.steps.contacts import directions_of
from stickslip.motion.steps.directions import (
    discard_directions,
    follow_directions,
    spread_given,
)
from stickslip.motion.steps.sets import crosses_pieces, slides_in_plane, slip_speed, whole_speed
from stickslip.motion.steps.starting import coefficients
from stickslip.numerics.levels import EPSILON, INSTANT, ROUNDING
from stickslip.translator import compiled

LEAST_SIZE = 1e-250  # smaller sizes are regarded as zero
# fraction of the largest displacement, or velocity, below which others are zero, too: a component
# far from all that moves begins like a high power of time
FAINT = 1e-30
_MOST_FAINT = 8  # largest number of steps that are tried for those
_SHORT = 2.0**-30  # shortest step, in units of time of the coefficients
_LONG = 2.0**10  # longest one
COARSER = 2.0**-16  # factor on a unit of time in which coefficients overflow
MOST_UNITS = 60  # largest number of units that are tried
_MOST_CUTS = 1100  # number of halvings from the largest number to zero
_DENSE = 6  # lowest order of a last term from which the decay of the terms of a row is estimated
# fractions of the time to the end of a slip: smallest excess of a step beyond it, and length of a
# step if that is too long
_BEYOND, _WELL_BEFORE = 2.0**-10, 0.75
_MOST_TURNS = 20  # largest number of Newton iterations
# radii of the discs in steps: growth is bounded better by a wide disc, a nearby singularity, as in
# a slip in a plane that is braked, by a narrow one
_WIDE, _NARROW = 2.0, 1.4
# by order: fraction of a disc that a polynomial may leave out (Cauchy's estimate)
_LEFT_BY_WIDE = _WIDE ** -np.arange(ORDERS[-1] + 1.0)
_LEFT_BY_NARROW = _NARROW ** -np.arange(ORDERS[-1] + 1.0)
_LOOSE = 1e-3  # relative size of hidden terms of a row that is accepted


@compiled()
def step_size(flow: Flow, mode: Array, N: int, seen: Array, last: float) -> float:
    """Step for which the last two Taylor terms of rows are below tol times their size, or lost in
    rounding.

    The size of a row is what it is, what it becomes within a step, and a part `atol` of the largest
    that it has been: nothing is measured against a number that the motion does not have. The first
    n rows are the state, known to order N; the others to order N − 1.
    """
    W = flow.space.W
    mag = flow.space.mag
    rows = flow.rows.watched
    noise = flow.rows.noise
    made = flow.rows.made
    n = flow.rows.sizes[DIMENSION]
    tol = flow.tol
    unit = W[n, 1]
    top = 0.0
    middle = 0.0
    low = 0.0
    h = np.inf
    nq = flow.rows.sizes[INERTIAL]
    far = FAINT * largest_within(W, 0, nq, 1, last / unit)
    slow = FAINT * largest_within(W, nq, nq, 1, last / unit)
    begins = False
    for i in range(len(rows)):
        r = rows[i]
        if is_zero_margin(flow.rows, mode, r):
            continue
        if W[r, N - 1] == 0.0 and W[r, N if i < n else N - 2] == 0.0:
            # For forces and other rows that are not states, at a beginning only: when directions
            # rotate, small terms of later steps measure the accuracy of these rows.
            lost = lost_terms(flow, i) if i < n or not seen[i] > 0.0 else 0.0
            h = min(h, sparse_step(W[r], N if i < n else N - 1, tol, lost))
        value, slope = abs(W[r, 0]), abs(W[r, 1])
        if not seen[i] > 0.0:
            # When a motion is recomputed, the direction of a slip counts, not its smaller
            # component.
            other = companion(flow.rows, r)
            value, slope = max(value, abs(W[other, 0])), max(slope, abs(W[other, 1]))
        if value == 0.0 and not seen[i] > 0.0:
            # A slip may begin with no acceleration.
            slope += abs(W[r, 2]) * (last / unit)
        size = LEAST_SIZE + value + slope * (last / unit) + flow.atol * max(value, seen[i])
        if i < 2 * nq:
            size += far if i < nq else slow
        if noise[i] >= 0:
            # A rate with cancellation is known only up to rounding errors.
            size += EPSILON / tol * mag[noise[i]] * (last if i < n else 1.0)
        if made[i] >= 0:
            # A component that is zero under friction in a plane has the rounding errors of the
            # displacement, or gap, that the forces would cause in a step if they did not cancel.
            step = last if last > 0.0 else unit
            size += EPSILON / tol * (mag[made[i]] * step * step)
        if size > 2.0 * LEAST_SIZE:
            size = 1.0 / size
            middle = max(middle, abs(W[r, N - 1]) * size)
            if i < n:
                top = max(top, abs(W[r, N]) * size)
            else:
                low = max(low, abs(W[r, N - 2]) * size)
        elif i < 2 * nq:
            begins = True
        else:
            h = min(h, first_step(W[r], N if i < n else N - 1, tol, lost_terms(flow, i)))
    if begins:
        h = min(h, step_from_rest(flow, N, seen))
    # One root is enough where it meets the other conditions, too; edge = tol/h^(N−1).
    edge = tol / h ** (N - 1) if h < np.inf else 0.0
    if low > 0.0 and not low <= edge * h:
        h = (tol / low) ** (1.0 / (N - 2))
        edge = low / h
    if middle > edge:
        h = (tol / middle) ** (1.0 / (N - 1))
        edge = middle
    if top * h > edge:
        h = (tol / top) ** (1.0 / N)
    return h * unit


@compiled()
def is_zero_margin(rows: Rows, mode: Array, r: int) -> bool:
    """Whether a row is the room that forces in a plane have, while there is slip: zero, but for
    rounding errors.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    r : int
        The row.
    """
    silent = False
    for plane in rows.planes:
        silent = silent or (r == plane[ADMISSIBLE] and mode[plane[LEAD]] != 0)
    return silent


@compiled()
def companion(rows: Rows, row: int) -> int:
    """The relative velocity in the next direction of a plane, or a face; any other row itself."""
    for plane in rows.planes:
        block = directions_of(rows, plane[LEAD])
        for i in range(len(block)):
            if row == rows.u[block[i]]:
                return int(rows.u[block[(i + 1) % len(block)]])
    return row


@compiled()
def sparse_step(c: Array, N: int, tol: float, lost: float) -> float:
    """Step of a row whose last terms vanish, because of a symmetry or as those of a polynomial.

    The last term that there is tells, beside the first, how fast they fall. A polynomial of a low
    degree leaves out nothing. First terms that are lost in rounding tell nothing.
    """
    j = 0
    k = N
    while k >= _DENSE and c[k] == 0.0:
        k -= 1
    if k < _DENSE or k > N - 2:
        return np.inf
    while j < k and abs(c[j]) <= lost:
        j += 1
    return float(abs(c[j] / c[k]) ** (1.0 / (k - j)) * tol ** (1.0 / N)) if j < k else np.inf


@compiled()
def lost_terms(flow: Flow, i: int) -> float:
    """Size of the coefficients of the i-th row that bounds steps which are lost in rounding."""
    rows, mag = flow.rows, flow.space.mag
    n = rows.sizes[DIMENSION]
    unit = flow.space.W[n, 1]
    place, contacts = rows.noise[i], len(rows.u)
    size = 0.0
    if i < n:
        size = impulse(rows, mag, i, unit)
    elif place >= 0:
        size = mag[place]
        if place < contacts:
            # A relative velocity that is zero by definition has the rounding error of its rate.
            size += unit * mag[contacts + place]
    return float(ROUNDING * size)


@compiled()
def first_step(c: Array, N: int, tol: float, lost: float) -> float:
    """Step of a quantity that has been zero so far: its last terms are small relative to the first
    one that is not lost in rounding."""
    j = 0
    h = np.inf
    while j < N - 2 and abs(c[j]) <= lost:
        j += 1
    for k in range(N - 1, N + 1):
        if c[k] != 0.0 and abs(c[j]) > lost and k > j:
            h = min(h, abs(c[j] / c[k] * tol) ** (1.0 / (k - j)))
    return h


@compiled()
def largest_within(W: Array, first: int, count: int, N: int, x: float) -> float:
    """The largest that polynomials may become.

    Parameters
    ----------
    W : array
        Their coefficients.
    first, count : int
        The first of them, and their number.
    N : int
        Their order.
    x : float
        Time, in the unit of that of the coefficients.
    """
    largest = 0.0
    for r in range(first, first + count):
        value = 0.0
        for k in range(N, -1, -1):
            value = value * x + abs(W[r, k])
        largest = max(largest, value)
    return largest


@compiled()
def step_from_rest(flow: Flow, N: int, seen: Array) -> float:
    """Step of positions and velocities that have been zero so far: the last terms are small
    relative to the first terms of each, or to a tiny fraction of the largest.

    Parameters
    ----------
    flow : Flow
        With coefficients of the state.
    N : int
        Their order.
    seen : array
        Largest modulus so far of each row that bounds the steps.
    """
    W = flow.space.W
    nq = flow.rows.sizes[INERTIAL]
    tol = flow.tol
    h = 0.0
    for r in range(2 * nq):
        if not seen[r] > 0.0 and W[r, 0] == 0.0:
            h = max(h, first_step(W[r], N, tol, lost_terms(flow, r)))
    for _ in range(_MOST_FAINT):
        if not h < np.inf:
            break
        fits = h
        for kind in range(2):
            floor = tol * FAINT * largest_within(W, kind * nq, nq, N, h)
            for r in range(kind * nq, (kind + 1) * nq):
                if seen[r] > 0.0 or W[r, 0] != 0.0:
                    continue
                own = first_step(W[r], N, tol, lost_terms(flow, r))
                if own < fits:
                    for k in range(N - 1, N + 1):
                        if W[r, k] != 0.0:
                            fits = min(fits, max(own, (floor / abs(W[r, k])) ** (1.0 / k)))
        if fits == h:
            break
        h = fits
    return h


@compiled()
def impulse(rows: Rows, mag: Array, r: int, h: float) -> float:
    """Change of a part of the state within a time by the terms of its rate, if none cancelled."""
    sizes = rows.program.rate_sizes
    nq = rows.sizes[INERTIAL]
    return float(h * mag[sizes[r]] if sizes[r] >= 0 else h * h * mag[sizes[r + nq]])


@compiled()
def suits(h: float, room: float, unit: float) -> bool:
    """Whether coefficients in powers of a unit of time neither overflow nor vanish, if a step has
    this length.

    Where there is no room for a step, at the end of a motion, all do.
    """
    return not room > 0.0 or (h >= _SHORT * unit and (h <= _LONG * unit or unit >= room))


@compiled()
def better(h: float, unit: float) -> float:
    """A unit of time that suits a step better: a power of two near it."""
    if not h > 0.0:
        return unit * _SHORT
    return math.ldexp(1.0, math.frexp(h)[1])


@compiled()
def expand(
    machine: Machine, flow: Flow, start: Instant, room: float, last: float, seen: Array
) -> tuple[int, float]:
    """Taylor coefficients of a known motion in a mode, in units of time that suit it.

    Parameters
    ----------
    room, last : float
        Longest step that is wanted, and length of the piece before (0: it is the first).
    seen : array
        Largest modulus so far of each row that bounds the steps.

    Returns
    -------
    order, step
        Order up to which they are finite, and the step for which they are good.
    """
    W = flow.space.W
    N = flow.order
    n = flow.rows.sizes[DIMENSION]
    order = N
    h = 0.0
    for _ in range(MOST_UNITS):
        coefficients(machine, flow, start, N, W)
        order = finite_order(W, n, N)
        h = step_size(flow, start.mode, order, seen, last)
        if order == N and suits(min(h, room), room, W[n, 1]):
            break
        W[n, 1] = better(min(h, room), W[n, 1]) if order == N else COARSER * W[n, 1]
    return order, h


@compiled()
def finite_order(W: Array, n: int, N: int) -> int:
    """Order up to which the state's coefficients are finite: close to a blow-up the high ones
    overflow."""
    for k in range(N, 2, -1):
        finite = True
        for r in range(n):
            finite = finite and math.isfinite(W[r, k])
        if finite:
            return k
    return 2


@compiled()
def fill_powers(powers: Array, h: float) -> None:
    """Powers of the step; in fours, since each multiplication waits for the one before."""
    a = 1.0
    b = h
    c = h * h
    d = h * h * h
    fourth = (h * h) * (h * h)
    n = len(powers) // 4 * 4
    for k in range(0, n, 4):
        powers[k] = a
        powers[k + 1] = b
        powers[k + 2] = c
        powers[k + 3] = d
        a = a * fourth
        b = b * fourth
        c = c * fourth
        d = d * fourth
    for k in range(n, len(powers)):
        powers[k] = a
        a *= h


@compiled()
def shortened_step(flow: Flow, mode: Array, reg: Array, h: float, seen: Array) -> float:
    """Reduce the step until no feature is missed in it.

    Parameters
    ----------
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    h : float
        The step, for which the series in the work space are good.
    seen : array
        Largest modulus so far of each row that bounds the steps.
    """
    if flow.rows.program.leading[0] == 0:
        return h
    rows, space = flow.rows, flow.space
    ends = False
    pieces, massive = crosses_pieces(rows, mode), slides_in_plane(rows, mode)
    for turn in range(_MOST_CUTS):
        # R of a face has a singularity at the end of each piece, the speed of a mass complex zeros
        # near its path. For the latter one attempt is enough: if it fails, shorter steps are
        # assessed faster by the wide disc alone.
        narrow = pieces or (massive and turn == 0)
        excess = unseen(flow, mode, reg, h, seen, narrow)
        if excess > 1.0 and turn == 0:
            near = up_to_rest(flow, mode, h)
            ends = near != h
            h = near
        if excess > 1.0 and ends:
            x = h / space.W[rows.sizes[DIMENSION], 1]
            if follow_directions(rows, mode, space.W, flow.order, x, flow.tol, space.discs):
                excess = unseen(flow, mode, reg, h, seen, narrow)
                discard_directions(rows, space.discs)
        if excess <= 1.0:
            break
        h *= 0.7 if excess < 10.0 else 0.5
    return h


@compiled()
def up_to_rest(flow: Flow, mode: Array, h: float) -> float:
    """The step, or a shorter one that ends where it is clear that the first slip in a plane has
    ended, or well before.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    h : float
        The step, for which the series in the work space are good.
    """
    rows = flow.rows
    W = flow.space.W
    mag = flow.space.mag
    n = rows.sizes[DIMENSION]
    unit = W[n, 1]
    first, clear = np.inf, np.inf
    for p in range(len(rows.planes)):
        c = rows.planes[p, LEAD]
        if not slip_speed(rows, mode, W, p) > 0.0:
            continue
        end, slope = slip_end(W[rows.planes[p, AIM_SPEED]], flow.order, h / unit)
        if end < np.inf:
            vague = ROUNDING * whole_speed(rows, mag, c) / slope
            late = 2.0 * (vague * unit + INSTANT * abs(W[n, 0]))
            first = min(first, end * unit)
            clear = min(clear, end * unit + max(late, _BEYOND * end * unit))
    if not first < np.inf:
        return h
    return clear if clear <= h else min(h, _WELL_BEFORE * first)


@compiled()
def slip_end(speed: Array, N: int, h: float) -> tuple[float, float]:
    """Time at which a speed vanishes within a step, according to its series, and its rate of
    decrease there; infinite if it does not vanish.

    Parameters
    ----------
    speed : array
        Its coefficients.
    N : int
        Their number.
    h : float
        The step, in the unit of time of the coefficients.
    """
    x = 0.0
    slope = 0.0
    for _ in range(_MOST_TURNS):
        value = 0.0
        slope = 0.0
        for k in range(N - 1, -1, -1):
            slope = slope * x + value
            value = value * x + speed[k]
        if not (slope < 0.0 and x < h):
            return np.inf, 0.0
        if value <= EPSILON * speed[0]:
            break
        x -= value / slope
    return x, -slope


@compiled()
def unseen(flow: Flow, mode: Array, reg: Array, h: float, seen: Array, narrow: bool) -> float:
    """Bound of features that the series may miss within a step, relative to the tolerance: the step
    is accepted if this is at most 1.

    Parameters
    ----------
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    h : float
        Length of the step.
    seen : array
        Largest modulus so far of each row that bounds the steps.
    narrow : bool
        Whether a narrow disc may show what a wide one does not, which meets a singularity.
    """
    N = flow.order
    excess = unseen_within(flow, mode, reg, h, seen, _WIDE, _LEFT_BY_WIDE[N])
    if excess <= 1.0 or not narrow:
        return excess
    return min(excess, unseen_within(flow, mode, reg, h, seen, _NARROW, _LEFT_BY_NARROW[N]))


@compiled()
def unseen_within(
    flow: Flow, mode: Array, reg: Array, h: float, seen: Array, around: float, part: float
) -> float:
    """The same, by Cauchy's estimate on a disc of some radius.

    Parameters
    ----------
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    h : float
        Length of the step.
    seen : array
        Largest modulus so far of each row that bounds the steps.
    around : float
        The radius, in steps.
    part : float
        Fraction of the disc that a polynomial may leave out.
    """
    p = flow.rows.program
    W = flow.space.W
    discs = flow.space.discs
    powers = flow.space.reaches
    N = flow.order
    tape = tape_of(flow, N)
    n = flow.rows.sizes[DIMENSION]
    fill_powers(powers, around * h / W[n, 1])
    discs[n, BALL] = around * h
    discs[n, OFF] = 0.0
    spread_state(W, N, powers, p.seen, discs)
    spread_given(flow, mode, N)
    first = 0
    last = p.leading[0]
    while True:
        spread(tape, mode, reg, first, last)
        if first > 0:
            break
        # Usually the instructions that may hide something hide nothing, and the others are not
        # examined.
        if not may_hide(tape, part):
            return 0.0
        spread_state(W, N, powers, flow.rows.watched[:n], discs)
        first = last
        last = len(p.code)
    fill_powers(powers, h / W[n, 1])
    return hidden(flow, mode, h, part, seen)


@compiled()
def may_hide(tape: DiscTape, part: float) -> bool:
    """Whether an instruction may hide more than a fraction of its value: a fast test that usually
    suffices."""
    p = tape.program
    W = tape.W
    discs = tape.discs
    for i in range(p.leading[0]):
        if p.hiding[i] == 1:
            op, row = p.code[i, OPERATION], p.code[i, RESULT]
            bounded = op in (LOG, ROTATION, DIRECTION_ROW) or CHAIN <= op <= TANH
            size = abs(W[row, 0]) + (1.0 if bounded else 0.0)
            if not (part * discs[row, BALL] <= _LOOSE * size and discs[row, OFF] == 0.0):
                return True
    return False


@compiled()
def hidden(flow: Flow, mode: Array, h: float, part: float, seen: Array) -> float:
    """The largest hidden part of the state and of the guards, relative to its tolerance; velocities
    of sticking contacts are zero, and not guards.

    Parameters
    ----------
    flow : Flow
        With the series and the discs.
    mode : array of int, shape (contacts,)
    h : float
        The step.
    part : float
        Part of a disc that a polynomial may leave out.
    seen : array
        Largest modulus so far of each row that bounds the steps.
    """
    rows = flow.rows
    p = rows.program
    W = flow.space.W
    mag = flow.space.mag
    discs = flow.space.discs
    powers = flow.space.reaches
    N = flow.order
    n = rows.sizes[DIMENSION]
    tol = flow.tol
    atol = flow.atol
    worst = 0.0
    nq = rows.sizes[INERTIAL]
    x = h / W[n, 1]
    far = FAINT * largest_within(W, 0, nq, N, x)
    slow = FAINT * largest_within(W, nq, nq, N, x)
    for r in range(n):
        own = LEAST_SIZE + abs(W[r, 0]) + reach(W[r], N, powers)
        if r < 2 * nq:
            own += far if r < nq else slow
        size = own + atol * seen[r]
        if rows.noise[r] >= 0:
            size += EPSILON / tol * mag[rows.noise[r]] * h
        worst = share(worst, discs[p.rates[r]], h, part, tol, size)
        if discs[p.rates[r], OFF] > 0.0 and abs(W[r, 0]) < atol * seen[r]:
            # A motion does not continue where its own rate has no derivative, such as √x at 0,
            # however small the remaining step.
            worst = share(worst, discs[p.rates[r]], h, part, tol, own)
    for i in range(n, len(rows.watched)):
        r = rows.watched[i]
        if 0 <= rows.noise[i] < len(mode) and mode[rows.noise[i]] == 0:
            continue
        size = LEAST_SIZE + abs(W[r, 0]) + reach(W[r], N - 1, powers) + atol * seen[i]
        if rows.noise[i] >= 0:
            size += mag[rows.noise[i]]
        worst = share(worst, discs[r], 1.0, part, tol, size)
    return worst


@compiled()
def share(worst: float, disc: Array, h: float, part: float, tol: float, size: float) -> float:
    """The larger of a number and of the hidden part of a row relative to its tolerance.

    Parameters
    ----------
    worst : float
        The number.
    disc : array, shape (4,)
        Of the row, or of its rate.
    h : float
        Time for which a rate counts; 1 where `disc` is that of the row itself.
    part : float
        Part of a disc that a polynomial may leave out.
    tol, size : float
        Local tolerance, and size of the row.
    """
    found = (
        h * (part / _LOOSE * disc[BALL] + disc[OFF] / tol) / size
        if disc[BALL] > 0.0 or disc[OFF] > 0.0
        else 0.0
    )
    return max(worst, found) if found == found else np.inf
