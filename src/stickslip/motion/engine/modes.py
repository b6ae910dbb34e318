"""Which mode the motion takes, and its Taylor coefficients.

One rule decides every mode, at the start, at an event and at a corner where several contacts stand
on their boundary: **a mode is right if all its guards are nonnegative for a short while**, that is,
if the first Taylor coefficient of each guard that is not zero is positive. The guards of a stick
are λ + s⁺ and s⁻ − λ, of a slip σu, of a region its signed kink function. This is the
complementarity problem of the force law in the ordered field of germs (of Taylor series), so a
principal pivoting method (Murty: flip the violated switch of least index) finds its solution. Its
leading order is the convex minimisation of the accelerations, velocities or rates.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.equations.codegen.series import invert
from stickslip.machine_code import njit
from stickslip.motion.engine.guards import scan, stays
from stickslip.motion.steps.arrays import (
    ASTRAY,
    CAUSE,
    DIMENSION,
    FIRED,
    IMPLICIT,
    INERTIAL,
    INLINED,
    JETS,
    LAST,
    NAN,
    NOW,
    OFF_SURFACE,
    OK,
    ON_INERTIAL,
    ON_RATE_INDEPENDENT,
    ON_VISCOUS,
    OPTIONS,
    OVERFLOW,
    RATE_INDEPENDENT,
    RECENT,
    RESIDUAL,
    ROUNDING,
    SERIES,
    SINGULAR,
    UNIT,
    VISCOUS,
    ZERO,
    Constants,
    Lane,
    Rows,
    Space,
)
from stickslip.motion.steps.step_size import (
    COARSER,
    LEAST,
    MOST_UNITS,
    better,
    fill_powers,
    shortened,
    step_size,
    suits,
)
from stickslip.motion.steps.stiff import RESTING, collocate, lingers

Array = np.ndarray

MOST_CANDIDATES = 60000
SLACKEST = 1e6  # rounding errors that count as zero where less lets no mode go on


@njit(**OPTIONS)
def resolvent(
    A: Array,
    n: int,
    J: Array,
    first: int,
    m: int,
    column: int,
    mode: Array,
    scratch: Array,
    R: Array,
) -> bool:
    """Inverse of [[A, −Jᵀ], [stick: J, 0; slip: 0, 1]] for contacts first … first+m−1 and
    coordinates column … ."""
    for i in range(n + m):
        for j in range(n + m):
            scratch[i, j] = 0.0
    for i in range(n):
        for j in range(n):
            scratch[i, j] = A[i, j]
        for c in range(m):
            scratch[i, n + c] = -J[first + c, column + i]
    for c in range(m):
        if mode[first + c] == 0:
            for i in range(n):
                scratch[n + c, i] = J[first + c, column + i]
        else:
            scratch[n + c, n + c] = 1.0
    return invert(scratch, n + m, R)


@njit(**INLINED)
def resolve(sizes: Array, k: Constants, space: Space, mode: Array) -> bool:
    """Bring the inverses of the linear problems up to date with the mode; False if one is
    singular."""
    nq = sizes[INERTIAL]
    nz = sizes[VISCOUS]
    mq = sizes[ON_INERTIAL]
    mz = sizes[ON_VISCOUS]
    known = space.known
    same = True
    for c in range(mq + mz):
        same = same and known[c] == mode[c]
    if same and known[mq + mz] == 0:
        return True
    for c in range(mq + mz):
        known[c] = mode[c]
    known[mq + mz] = 1
    if nq > 0 and not resolvent(k.M, nq, k.J, ZERO, mq, ZERO, mode, space.scratch, space.Rq):
        return False
    if nz > 0 and not resolvent(k.C, nz, k.J, mq, mz, nq, mode, space.scratch, space.Rz):
        return False
    known[mq + mz] = 0
    return True


@njit(**INLINED)
def project_rates(
    residual: RESIDUAL,
    sizes: Array,
    k: Constants,
    space: Space,
    t: float,
    y: Array,
    mode: Array,
    reg: Array,
) -> int:
    """Put sliding rate-independent coordinates back on λ + σ s = 0 (one Newton step: they are there
    up to rounding)."""
    nr = sizes[RATE_INDEPENDENT]
    first = sizes[ON_INERTIAL] + sizes[ON_VISCOUS]
    offset = 2 * sizes[INERTIAL] + sizes[VISCOUS]
    G = space.G
    sliding = False
    for i in range(nr):
        sliding = sliding or mode[first + i] != 0
    if not sliding:
        return OK
    residual(t, y, mode, reg, k.K, G, space.A)
    for i in range(nr):
        if mode[first + i] != 0 and not abs(G[i]) <= 1e-9 * G[nr + i]:
            return OFF_SURFACE
    if not invert(space.A, nr, space.B):
        return SINGULAR
    for i in range(nr):
        for j in range(nr):
            y[offset + i] -= space.B[i, j] * G[j]
    return OK


@njit(**INLINED)
def release_or_hold(rows: Rows, space: Space, y: Array, mode: Array, last: float) -> bool:
    """Put sticking inertial contacts exactly on the surface speed; one that is not there (it cannot
    jump) slips.

    Returns
    -------
    bool
        False if a contact was released, so that the mode has changed.
    """
    W = space.W
    mag = space.mag
    Rq = space.Rq
    nc = len(rows.u)
    nq = rows.sizes[INERTIAL]
    mq = rows.sizes[ON_INERTIAL]
    for c in range(mq):
        if mode[c] != 0:
            continue
        # The acceleration that this contact holds back, or could: its force over its effective
        # mass.
        gap = W[rows.u[c], 0]
        held = mag[2 * nc + c] / abs(Rq[nq + c, nq + c])
        if abs(gap) > 1e-9 * last * (mag[nc + c] + held) + ROUNDING * mag[c]:
            mode[c] = 1 if gap > 0.0 else -1
            return False
    for c in range(mq):
        gap = W[rows.u[c], 0]
        if mode[c] == 0 and gap != 0.0:
            for i in range(nq):
                y[nq + i] -= Rq[i, nq + c] * gap
    return True


@njit(**INLINED)
def evaluate_mode(
    jets: JETS,
    residual: RESIDUAL,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    t: float,
    y: Array,
    mode: Array,
    reg: Array,
    last: float,
    hold: bool,
) -> int:
    """Taylor coefficients of the motion in a mode; y is put back onto the constraints of the
    mode."""
    W, sizes = space.W, rows.sizes
    n = sizes[DIMENSION]
    nr = sizes[RATE_INDEPENDENT]
    mq = sizes[ON_INERTIAL]
    while True:
        if not resolve(sizes, k, space, mode):
            return SINGULAR
        sticking = False
        for c in range(mq):
            sticking = sticking or mode[c] == 0
        if not sticking or not hold:
            break
        if (
            jets(t, y, mode, reg, k.K, space.Rq, space.Rz, 1, W, space.A, space.B, space.mag)
            == SINGULAR
        ):
            return SINGULAR
        if release_or_hold(rows, space, y, mode, last):
            break
    if nr > 0:
        status = project_rates(residual, sizes, k, space, t, y, mode, reg)
        if status != OK:
            return status
    if (
        jets(t, y, mode, reg, k.K, space.Rq, space.Rz, N, W, space.A, space.B, space.mag)
        == SINGULAR
    ):
        return SINGULAR
    for r in range(n):
        if not (math.isfinite(W[r, 0]) and math.isfinite(W[rows.program.rates[r], 0])):
            return NAN
        if not (math.isfinite(W[r, 1]) and math.isfinite(W[r, min(N, 2)])):
            return OVERFLOW
        if not math.isfinite(W[r, N]):
            # what overflows at high orders only is a blow-up: no step is small enough
            W[r, N] = np.inf
    for c in range(len(rows.u)):
        r = rows.u[c]
        if not math.isfinite(W[r, 0]):
            return NAN
        if not math.isfinite(W[r, N - 1]):
            W[r, N - 1] = np.inf
    return OK


@njit(**INLINED)
def keeps(
    rows: Rows,
    W: Array,
    mag: Array,
    promise: Array,
    y: Array,
    seen: Array,
    h: float,
    tol: float,
    atol: float,
) -> bool:
    """Whether rates, times the length of the step that ends here, are those that the step's series
    promises."""
    for i in range(len(y)):
        size = LEAST + abs(y[i]) + abs(promise[i]) + atol * seen[i]
        rounding = ROUNDING * mag[rows.noise[i]] * h if rows.noise[i] >= 0 else 0.0
        if abs(W[rows.program.rates[i], 0] * h - promise[i]) > tol * size + rounding:
            return False
    return True


@njit(**OPTIONS)
def flip(guard: int, mode: Array, reg: Array, nk: int, drops: Array) -> int:
    """Give the switch of a violated guard its other state; returns the switch.

    What leaves stick has its threshold to break, as long as it is not known which of several
    contacts do: ±2 where the sliding force is another one.
    """
    if guard < nk:
        reg[guard] = 1 - reg[guard]
        return guard
    c = (guard - nk) // 2
    if mode[c] == 0:
        side = 1 if (guard - nk) % 2 == 0 else -1
        mode[c] = 2 * side if drops[c] == 1 else side
    else:
        mode[c] = 0
    return nk + c


@njit(**OPTIONS)
def let_slide(mode: Array) -> bool:
    """Let the contacts that break their thresholds slide; whether there are any."""
    found = False
    for c in range(len(mode)):
        if abs(mode[c]) == 2:
            mode[c] //= 2
            found = True
    return found


@njit(**OPTIONS)
def hold_or_slide(
    rows: Rows, space: Space, mode: Array, N: int, last: float, fired: int, slack: float
) -> bool:
    """Give each contact that does not stick the threshold while others carry it (±2), else its
    sliding force (±1).

    Returns
    -------
    bool
        Whether that changes the forces.
    """
    changed = False
    for c in range(len(mode)):
        if rows.drops[c] == 1 and mode[c] != 0:
            force = 2 if stays(rows, space, mode, c, N, last, fired, slack) else 1
            if abs(mode[c]) != force:
                mode[c] = force if mode[c] > 0 else -force
                changed = True
    return changed


@njit(**OPTIONS)
def loosen(
    J: Array,
    first: int,
    m: int,
    column: int,
    n: int,
    mode: Array,
    keep: int,
    space: Space,
    nk: int,
    drops: Array,
) -> bool:
    """Let sticking contacts whose directions depend on those of the others be carried at their
    threshold (u stays 0).

    With more sticking contacts than directions their forces are not unique. Any admissible choice
    gives the same motion; a contact carried at its threshold is a vertex of that choice, and
    pivoting walks from vertex to vertex.
    """
    rank = 0
    changed = False
    basis = space.scratch
    touched = space.touched
    for turn in range(m + 1):
        # The contact that has just begun to stick comes first: it is the one that must not be let
        # go again.
        c = keep if turn == 0 else first + turn - 1
        if (turn == 0) != (c == keep) or c < first or c >= first + m or mode[c] != 0:
            continue
        size = 0.0
        for i in range(n):
            basis[rank, i] = J[c, column + i]
            size += basis[rank, i] ** 2
        for _ in range(2):
            for r in range(rank):
                dot = 0.0
                for i in range(n):
                    dot += basis[rank, i] * basis[r, i]
                for i in range(n):
                    basis[rank, i] -= dot * basis[r, i]
        left = 0.0
        for i in range(n):
            left += basis[rank, i] ** 2
        if left <= 1e-20 * size:
            mode[c] = 1 + drops[c]
            touched[nk + c] = 1
            changed = True
            continue
        for i in range(n):
            basis[rank, i] /= math.sqrt(left)
        rank += 1
    return changed


@njit(**INLINED)
def settle(
    jets: JETS,
    residual: RESIDUAL,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    tol: float,
    atol: float,
    lane: Lane,
    room: float,
    hold: bool,
    promised: float,
) -> tuple[int, float, float, int]:
    """Find the mode the motion takes now; the work space then holds its Taylor coefficients, or a
    polynomial instead.

    Parameters
    ----------
    promised : float
        Length of the step that ended here, if it has not been checked whether it keeps its promise;
        otherwise 0.

    Returns
    -------
    status, step, series, count
        OK, the step size, that of the series, and the number of guards that may fire; or NAN; or
        SINGULAR if no mode is possible; or ASTRAY if the step that ended here does not solve the
        equations.
    """
    sizes = rows.sizes
    touched = space.touched
    mode = lane.mode
    reg = lane.reg
    y = lane.y
    nk = len(rows.kinks)
    nc = len(rows.u)
    nq = sizes[INERTIAL]
    nz = sizes[VISCOUS]
    mq = sizes[ON_INERTIAL]
    mz = sizes[ON_VISCOUS]
    mr = sizes[ON_RATE_INDEPENDENT]
    t = lane.clock[NOW]
    last = lane.clock[LAST]
    recent = lane.clock[RECENT]
    fired = lane.counters[CAUSE]
    copy(y, space.y0)
    for i in range(nk + nc):
        touched[i] = 0
    # First pivoting; if that leaves the admissible modes (a singular or impossible one), every
    # state of the switches concerned.
    pivots = 0
    candidate = 0
    total = 0
    flipped = fired
    slack = 1.0
    units = 0
    h = 0.0
    kept = 0  # times that the forces of a state of the switches were put right
    space.W[len(y), 1] = lane.clock[UNIT]
    while True:
        if pivots > 0:
            copy(space.y0, y)
        pivots += 1
        if total > 0 and kept == 0:
            if candidate == total:
                # Where forces are not unique, contacts that pivoting never questioned may have to
                # change, too.
                asked = 0
                for i in range(nc):
                    asked += 1 - touched[nk + i]
                    touched[nk + i] = 1
                total = candidates(touched, nk)
                if total > MOST_CANDIDATES:
                    break
                if asked == 0:
                    # A contact may be so close to two modes that rounding denies it both.
                    slack *= 1e2
                    if slack > SLACKEST:
                        break
                candidate = 0
            choose(candidate, touched, mode, reg, rows.drops)
            candidate += 1
        status = evaluate_mode(
            jets, residual, rows, k, space, N, t, y, mode, reg, recent, hold or pivots > 1
        )
        first = promised > 0.0 and pivots == 1 and status != SINGULAR
        if first and not keeps(
            rows, space.W, space.mag, space.promise[0], y, lane.seen, promised, 1e4 * tol, atol
        ):
            return ASTRAY, 0.0, 0.0, 0
        # A formula may end where its region ends.
        lost = status in (NAN, OVERFLOW) and total == 0 and pivots <= nk + 1
        if lost and set_regions(rows, space.W, space.mag, reg):
            continue
        if status == NAN:
            return NAN, 0.0, 0.0, 0
        if status == OK:
            h = step_size(
                space.W, rows.watched, rows.noise, space.mag, lane.seen,
                len(y), N, lane.clock[SERIES], tol, atol,
            )  # fmt: skip
            # between two times that can be told apart, as they are recorded
            h = (t + min(room, h)) - t
        if status == OVERFLOW or (status == OK and not suits(h, room, space.W[len(y), 1])):
            # Coefficients in other units of time: all others are powers of two times these, so that
            # nothing is rounded.
            if units == MOST_UNITS:
                return NAN, 0.0, 0.0, 0
            space.W[len(y), 1] = (
                better(h, space.W[len(y), 1]) if status == OK else COARSER * space.W[len(y), 1]
            )
            units = units + 1
            pivots = pivots - 1
            if total > 0:
                candidate -= 1
            continue
        if status == OK:
            fill_powers(space.powers, h / space.W[len(y), 1])
            guard, count = scan(rows, space, mode, reg, N, last, fired, slack)
            other = guard < 0 and hold_or_slide(rows, space, mode, N, last, fired, slack)
            kept = kept + 1 if other and total > 0 and kept <= 2 * nc else 0
            if guard < 0 and not other:
                short = shortened(rows, k, space, mode, reg, N, h, tol, atol, lane.seen)
                series = short
                unit = space.W[len(y), 1]
                stiff = (
                    pivots == 1
                    and not short < h
                    and lingers(
                        space.W, len(y), N, h, room, tol, atol, lane.seen, lane.clock, fired
                    )
                )
                if stiff:
                    short, lane.clock[IMPLICIT] = collocate(
                        jets, rows, k, space, N, t, y, mode, reg,
                        h, lane.clock[IMPLICIT], tol, atol, lane.seen,
                    )  # fmt: skip
                if short != h:
                    h = (t + short) - t
                    fill_powers(space.powers, h / space.W[len(y), 1])
                    guard, count = scan(rows, space, mode, reg, N, last, fired, slack)
                if stiff and (guard >= 0 or not short > 0.0):
                    # A guard that vanishes is known better from its series.
                    lane.clock[IMPLICIT] = -RESTING
                    space.W[len(y), 1] = unit
                    pivots = 0
                    continue
                if guard < 0:
                    lane.clock[UNIT] = unit
                    for i in range(len(rows.watched)):
                        lane.seen[i] = max(lane.seen[i], abs(space.W[rows.watched[i], 0]))
                    return OK, h, series, count
            if guard >= 0 and total == 0:
                flipped = flip(guard, mode, reg, nk, rows.drops)
                touched[flipped] = 1
        elif status == SINGULAR and total == 0:
            free = loosen(k.J, ZERO, mq, ZERO, nq, mode, flipped - nk, space, nk, rows.drops)
            free = loosen(k.J, mq, mz, nq, nz, mode, flipped - nk, space, nk, rows.drops) or free
            if free and pivots <= 3 * (nk + nc) + 8:
                continue
        if total == 0 and (status != OK or pivots > 3 * (nk + nc) + 8):
            if fired >= 0:
                touched[fired] = 1
            for i in range(mr):
                if mode[mq + mz + i] != 0:
                    touched[nk + mq + mz + i] = 1
            total = candidates(touched, nk)
            if total > MOST_CANDIDATES:
                break
    copy(space.y0, y)
    return SINGULAR, 0.0, 0.0, 0


@njit(**OPTIONS)
def set_regions(rows: Rows, W: Array, mag: Array, reg: Array) -> bool:
    """Put kinks onto the sides where their guards clearly are; whether one was not."""
    changed = False
    for j in range(len(reg)):
        value = W[rows.kinks[j], 0]
        unsure = FIRED * mag[3 * len(rows.u) + j]
        if (value < -unsure and reg[j] == 1) or (value > unsure and reg[j] == 0):
            reg[j] = 1 - reg[j]
            changed = True
    return changed


@njit(**OPTIONS)
def candidates(touched: Array, nk: int) -> int:
    """Number of states of the switches concerned (one more than is tried, if there are too
    many)."""
    total = 1
    for i in range(len(touched)):
        if touched[i] == 1 and total <= MOST_CANDIDATES:
            total *= 2 if i < nk else 3
    return total


@njit(**OPTIONS)
def choose(candidate: int, touched: Array, mode: Array, reg: Array, drops: Array) -> None:
    """Put the switches concerned into the states that a number stands for; what does not stick is
    at its threshold."""
    nk = len(reg)
    for i in range(len(touched)):
        if touched[i] == 1:
            if i < nk:
                reg[i] = candidate % 2
                candidate //= 2
            else:
                mode[i - nk] = (candidate % 3 - 1) * (1 + drops[i - nk])
                candidate //= 3


@njit(**OPTIONS)
def copy(source: Array, target: Array) -> None:
    """Copy a vector (a slice assignment would compile shape checks that can never fail)."""
    for i in range(len(source)):
        target[i] = source[i]
