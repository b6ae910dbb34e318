"""The event loop: Taylor steps, isolated events, and the choice of the next mode.

One rule decides every mode, at the start, at an event and at a corner where several contacts stand on their
boundary: **a mode is right if all its guards are nonnegative for a short while**, that is, if the first Taylor
coefficient of each guard that is not zero is positive. The guards of a stick are λ + s⁺ and s⁻ − λ, of a slip σu, of
a region its signed kink function. This is the complementarity problem of the force law in the ordered field of germs
(of Taylor series), so a principal pivoting method (Murty: flip the violated switch of least index) finds its solution.
Its leading order is the convex minimisation of the accelerations, velocities or rates.

All functions are scalar loops over preallocated arrays.
"""

from __future__ import annotations

import warnings

import numpy as np
from numba import float64, int64, njit, types, void

from stickslip.equations.series import invert
from stickslip.motion import affine
from stickslip.motion.roots import NONE, first_crossing, horner

# The engine takes a model's machine code as arguments; numba calls that experimental whenever it compiles such a call.
warnings.filterwarnings("ignore", message="First-class function type feature is experimental")

Array = np.ndarray
vector, matrix, indices = float64[::1], float64[:, ::1], int64[::1]
SETUP = types.FunctionType(void(vector, vector, matrix, matrix, matrix, vector))
JETS = types.FunctionType(
    int64(float64, vector, indices, indices, vector, matrix, matrix, int64, matrix, matrix, matrix, vector))
RESIDUAL = types.FunctionType(void(float64, vector, indices, indices, vector, vector, matrix))
POWERS = types.FunctionType(void(matrix, indices, vector, vector))

# Codes of motion.outcome.Outcome, and two that ask to be called again: with a new record, or with the closed form of a mode.
FINISHED, NO_RATE, ON_JUMP, ZENO, TINY, LIMIT, NEGATIVE, UNDEFINED, FULL, NEED = 0, 2, 3, 4, 5, 6, 7, 8, 100, 101
OK, SINGULAR, NAN, OFF_SURFACE = 0, 1, 2, 3

ROUNDING = 64 * 2.220446049250313e-16
FIRED = 1e-10  # a switch that has just fired is on its boundary by definition
ZENO_EVENTS = 200

_options = {"cache": True, "error_model": "numpy", "nogil": True}


@njit(**_options)
def resolvent(A: Array, n: int, J: Array, first: int, m: int, column: int, mode: Array, scratch: Array, R: Array) -> bool:
    """Inverse of [[A, −Jᵀ], [stick: J, 0; slip: 0, 1]] for contacts first … first+m−1 and coordinates column … ."""
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


@njit(cache=True, error_model="numpy", nogil=True, fastmath={"reassoc", "contract", "nsz"})
def reach(W: Array, row: int, shift_row: int, sign: float, N: int, powers: Array) -> float:
    """Bound Σ|cₖ|hᵏ, k ≥ 1, of how far sign·W[row] + W[shift_row] moves within the step."""
    total = 0.0
    if shift_row < 0:
        for k in range(1, N):
            total += abs(W[row, k]) * powers[k]
    else:
        for k in range(1, N):
            total += abs(sign * W[row, k] + W[shift_row, k]) * powers[k]
    return total


@njit(**_options)
def germ(W: Array, row: int, sign: float, shift_row: int, N: int, powers: Array, near: float, size0: float, size1: float,
         precision: float, c: Array) -> tuple[int, int]:
    """Sign of a guard for small times, and the order that decides it.

    The guard is sign·W[row] + W[shift_row]; its coefficients, scaled to the step, are left in c. A zero is known no
    better than the time at which it was found: relative to what the guard does in the steps on both sides.
    """
    largest = 0.0
    for k in range(N):
        v = sign * W[row, k]
        if shift_row >= 0:
            v += W[shift_row, k]
        c[k] = v * powers[k]
        if k > 0:
            largest = max(largest, abs(c[k]))
    floor = precision * (size0 + near * size1 + largest)
    if c[0] > floor:
        return 1, 0
    if c[0] < -floor:
        return -1, 0
    floor = ROUNDING * (size0 + powers[1] * size1 + largest)
    for k in range(1, N):
        # What has just begun to slip has the acceleration 0 by definition.
        at_least = floor if k > 1 else max(floor, precision * powers[1] * size1)
        if c[k] > at_least:
            return 1, k
        if c[k] < -at_least:
            return -1, k
    return 0, N


@njit(**_options)
def step_size(W: Array, rows: Array, n: int, N: int, last: float, tol: float, atol: float) -> float:
    """Step for which the last two Taylor terms of the state and of all guards are below tol times their size."""
    top, middle, low = 0.0, 0.0, 0.0
    for r in range(n):
        size = 1.0 / (abs(W[r, 0]) + abs(W[r, 1]) * last + atol)
        top = max(top, abs(W[r, N]) * size)
        middle = max(middle, abs(W[r, N - 1]) * size)
    for i in range(len(rows)):
        r = rows[i]
        size = 1.0 / (abs(W[r, 0]) + abs(W[r, 1]) * last + atol)
        middle = max(middle, abs(W[r, N - 1]) * size)
        low = max(low, abs(W[r, N - 2]) * size)
    h = np.inf
    if top > 0.0:
        h = (tol / top) ** (1.0 / N)
    if middle > 0.0:
        h = min(h, (tol / middle) ** (1.0 / (N - 1)))
    if low > 0.0:
        h = min(h, (tol / low) ** (1.0 / (N - 2)))
    return h


@njit(**_options)
def project_rates(t: float, y: Array, mode: Array, reg: Array, K: Array, first: int, nr: int, offset: int, residual: RESIDUAL,
                  A: Array, B: Array, G: Array) -> int:
    """Put sliding rate-independent coordinates back on λ + σ s = 0 (one Newton step: they are there up to rounding)."""
    sliding = False
    for i in range(nr):
        sliding = sliding or mode[first + i] != 0
    if not sliding:
        return OK
    residual(t, y, mode, reg, K, G, A)
    for i in range(nr):
        if mode[first + i] != 0 and not abs(G[i]) <= 1e-9 * G[nr + i]:
            return OFF_SURFACE
    if not invert(A, nr, B):
        return SINGULAR
    for i in range(nr):
        for j in range(nr):
            y[offset + i] -= B[i, j] * G[j]
    return OK


@njit(**_options)
def release_or_hold(y: Array, mode: Array, nq: int, mq: int, J: Array, Rq: Array, W: Array, u_rows: Array, mag: Array, last: float
                    ) -> bool:
    """Put sticking inertial contacts exactly on the surface speed; one that is not there (it cannot jump) slips.

    Returns
    -------
    bool
        False if a contact was released, so that the mode has changed.
    """
    nc = len(u_rows)
    for c in range(mq):
        if mode[c] != 0:
            continue
        # The acceleration that this contact holds back: its force over its effective mass.
        gap, held = W[u_rows[c], 0], mag[2 * nc + c] / abs(Rq[nq + c, nq + c])
        if abs(gap) > 1e-9 * last * (mag[nc + c] + held) + ROUNDING * mag[c]:
            mode[c] = 1 if gap > 0.0 else -1
            return False
    for c in range(mq):
        gap = W[u_rows[c], 0]
        if mode[c] == 0 and gap != 0.0:
            for i in range(nq):
                y[nq + i] -= Rq[i, nq + c] * gap
    return True


@njit(**_options)
def resolve(sizes: Array, mode: Array, known: Array, M: Array, C: Array, J: Array, scratch: Array, R: tuple) -> bool:
    """Bring the inverses of the linear problems up to date with the mode; False if one is singular."""
    nq, nz, mq, mz = sizes[1], sizes[2], sizes[5], sizes[6]
    same = True
    for c in range(mq + mz):
        same = same and known[c] == mode[c]
    if same and known[mq + mz] == 0:
        return True
    for c in range(mq + mz):
        known[c] = mode[c]
    known[mq + mz] = 1
    if nq > 0 and not resolvent(M, nq, J, np.int64(0), mq, np.int64(0), mode, scratch, R[0]):
        return False
    if nz > 0 and not resolvent(C, nz, J, mq, mz, nq, mode, scratch, R[1]):
        return False
    known[mq + mz] = 0
    return True


@njit(**_options)
def evaluate_mode(jets: JETS, residual: RESIDUAL, sizes: Array, u_rows: Array, t: float, y: Array, mode: Array, reg: Array,
                  K: Array, M: Array, C: Array, J: Array, N: int, W: Array, R: tuple, A: Array, B: Array, G: Array, scratch: Array,
                  mag: Array, last: float, known: Array, hold: bool) -> int:
    """Taylor coefficients of the motion in a mode; y is put back onto the constraints of the mode."""
    n, nq, nz, nr, mq, mz, mr = sizes[0], sizes[1], sizes[2], sizes[3], sizes[5], sizes[6], sizes[7]
    nc = mq + mz + mr
    Rq, Rz = R
    while True:
        if not resolve(sizes, mode, known, M, C, J, scratch, R):
            return SINGULAR
        sticking = False
        for c in range(mq):
            sticking = sticking or mode[c] == 0
        if not sticking or not hold:
            break
        if jets(t, y, mode, reg, K, Rq, Rz, 1, W, A, B, mag) == SINGULAR:
            return SINGULAR
        if release_or_hold(y, mode, nq, mq, J, Rq, W, u_rows, mag, last):
            break
    if nr > 0:
        status = project_rates(t, y, mode, reg, K, mq + mz, nr, 2 * nq + nz, residual, A, B, G)
        if status != OK:
            return status
    if jets(t, y, mode, reg, K, Rq, Rz, N, W, A, B, mag) == SINGULAR:
        return SINGULAR
    for r in range(n):
        if not np.isfinite(W[r, N]) or not np.isfinite(W[r, 0]) or not np.isfinite(W[r, 1]):
            return NAN
    for c in range(nc):
        if not np.isfinite(W[u_rows[c], N - 1]):
            return NAN
    return OK


@njit(**_options)
def consider(W: Array, row: int, sign: float, shift_row: int, N: int, powers: Array, near: float, size0: float, size1: float,
             precision: float, switch: int, pending: Array, labels: Array, count: int, c: Array) -> int:
    """Judge one guard: −1 if it becomes negative at once; else the number of guards that may fire within the step."""
    start = sign * W[row, 0] + (W[shift_row, 0] if shift_row >= 0 else 0.0)
    if start > precision * (size0 + near * size1) and start > reach(W, row, shift_row, sign, N, powers):
        return count
    s, order = germ(W, row, sign, shift_row, N, powers, near, size0, size1, precision, c)
    if s < 0:
        return -1
    if s > 0:
        # A zero at the start is divided out: what remains starts positive.
        d = N - 1 - order
        for k in range(d + 1):
            pending[count, k] = c[k + order]
        pending[count, N] = ROUNDING * (size0 + powers[1] * size1)
        labels[count, 0], labels[count, 1] = switch, d
        count += 1
    return count


@njit(**_options)
def scan(W: Array, mode: Array, reg: Array, u_rows: Array, force: Array, plus: Array, minus: Array, kinks: Array, doubtful: Array,
         mag: Array, N: int, powers: Array, last: float, fired: int, c: Array, pending: Array, labels: Array) -> tuple[int, int]:
    """Look at all guards of a mode: (least switch that is violated at once, or −1; number of guards that may fire).

    Switches are kinks first, then contacts (+1000: towards slip−), then 2000 + i for a threshold that may become negative.
    """
    nk, nc, count, near = len(kinks), len(u_rows), 0, last + powers[1]
    for j in range(nk):
        precision = FIRED if fired == j else ROUNDING
        count = consider(W, kinks[j], 1.0 if reg[j] == 1 else -1.0, np.int64(-1), N, powers, near, mag[3 * nc + j], abs(W[kinks[j], 1]),
                         precision, j, pending, labels, count, c)
        if count < 0:
            return j, 0
    for i in range(nc):
        precision = FIRED if fired == nk + i else ROUNDING
        if mode[i] == 0:
            size = mag[2 * nc + i] + abs(W[plus[i], 0]) + abs(W[minus[i], 0])
            size += near * (abs(W[force[i], 1]) + abs(W[plus[i], 1]) + abs(W[minus[i], 1]))
            count = consider(W, force[i], 1.0, plus[i], N, powers, near, size, 0.0, precision, nk + i, pending, labels, count, c)
            if count < 0:
                return nk + i, 0
            count = consider(W, force[i], -1.0, minus[i], N, powers, near, size, 0.0, precision, nk + i + 1000, pending, labels,
                             count, c)
            if count < 0:
                return nk + i + 1000, 0
        else:
            count = consider(W, u_rows[i], float(mode[i]), np.int64(-1), N, powers, near, mag[i], mag[nc + i] + abs(W[u_rows[i], 1]),
                             precision, nk + i, pending, labels, count, c)
            if count < 0:
                return nk + i, 0
    for i in range(len(doubtful)):
        row = doubtful[i]
        size = abs(W[row, 0]) + abs(W[row, 1]) * powers[1]
        before = count
        count = consider(W, row, 1.0, np.int64(-1), N, powers, 0.0, size, 0.0, 1e-12, 2000 + i, pending, labels, count, c)
        if count < 0:
            labels[before, 0], labels[before, 1] = 2000 + i, -1
            count = before + 1
    return -1, count


@njit(**_options)
def first_event(pending: Array, labels: Array, count: int, N: int, stack: Array) -> tuple[float, int]:
    """Earliest event of the step among the guards that may fire: (fraction of the step, switch or −1)."""
    limit, which = 1.0, -1
    for i in range(count):
        d = labels[i, 1]
        if d < 0:
            return 0.0, labels[i, 0]
        x = first_crossing(pending[i], d, limit, pending[i, N], stack)
        if x <= limit:
            limit, which = x, labels[i, 0]
    return limit, which


@njit(**_options)
def flip(switch: int, mode: Array, reg: Array, nk: int) -> int:
    """Give a violated switch its other state; returns the switch."""
    if switch >= 1000:
        mode[switch - 1000 - nk] = -1
        return switch - 1000
    if switch < nk:
        reg[switch] = 1 - reg[switch]
    elif mode[switch - nk] == 0:
        mode[switch - nk] = 1
    else:
        mode[switch - nk] = 0
    return switch


@njit(**_options)
def fill_powers(powers: Array, h: float) -> None:
    """Powers of the step."""
    x = 1.0
    for k in range(len(powers)):
        powers[k] = x
        x *= h


@njit(**_options)
def loosen(J: Array, first: int, m: int, column: int, n: int, mode: Array, keep: int, basis: Array, touched: Array, nk: int) -> bool:
    """Let sticking contacts whose directions depend on those of the others be carried at their threshold (u stays 0).

    With more sticking contacts than directions their forces are not unique. Any admissible choice gives the same motion; a
    contact carried at its threshold is a vertex of that choice, and pivoting walks from vertex to vertex.
    """
    rank, changed = 0, False
    for turn in range(m + 1):
        # The contact that has just begun to stick comes first: it is the one that must not be let go again.
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
            mode[c] = 1
            touched[nk + c] = 1
            changed = True
            continue
        for i in range(n):
            basis[rank, i] /= np.sqrt(left)
        rank += 1
    return changed


@njit(**_options)
def settle(jets: JETS, residual: RESIDUAL, sizes: Array, u_rows: Array, force: Array, plus: Array, minus: Array, kinks: Array,
           watched: Array, doubtful: Array, t: float, y: Array, mode: Array, reg: Array, K: Array, M: Array, C: Array, J: Array,
           N: int, W: Array, R: tuple, A: Array, B: Array, G: Array, scratch: Array, mag: Array, last: float, recent: float, room: float, tol: float,
           atol: float, fired: int, c: Array, touched: Array, y0: Array, known: Array, hold: bool, powers: Array, pending: Array,
           labels: Array) -> tuple[int, float, int]:
    """Find the mode the motion takes now; W then holds its Taylor coefficients.

    Returns
    -------
    status, step, count
        OK, the step size and the number of guards that may fire; or NAN; or SINGULAR if no mode is possible.
    """
    nk, nc, mq, mz, mr = len(kinks), len(u_rows), sizes[5], sizes[6], sizes[7]
    for i in range(len(y)):
        y0[i] = y[i]
    for i in range(nk + nc):
        touched[i] = 0
    # First pivoting; if that leaves the admissible modes (a singular or impossible one), every state of the switches concerned.
    pivots, candidate, total, flipped = 0, 0, 0, fired
    while True:
        if pivots > 0:
            for i in range(len(y)):
                y[i] = y0[i]
        pivots += 1
        if total > 0:
            if candidate == total:
                break
            code = candidate
            candidate += 1
            for i in range(nk + nc):
                if touched[i] == 1:
                    if i < nk:
                        reg[i] = code % 2
                        code //= 2
                    else:
                        mode[i - nk] = code % 3 - 1
                        code //= 3
        status = evaluate_mode(jets, residual, sizes, u_rows, t, y, mode, reg, K, M, C, J, N, W, R, A, B, G, scratch, mag, recent,
                               known, hold or pivots > 1)
        if status == NAN:
            return NAN, 0.0, 0
        if status == OK:
            h = min(room, step_size(W, watched, len(y), N, last, tol, atol))
            fill_powers(powers, h)
            switch, count = scan(W, mode, reg, u_rows, force, plus, minus, kinks, doubtful, mag, N, powers, last, fired, c, pending, labels)
            if switch < 0:
                return OK, h, count
            if total == 0:
                flipped = flip(switch, mode, reg, nk)
                touched[flipped] = 1
        elif status == SINGULAR and total == 0:
            free = loosen(J, np.int64(0), mq, np.int64(0), sizes[1], mode, flipped - nk, scratch, touched, nk)
            free = loosen(J, mq, mz, sizes[1], sizes[2], mode, flipped - nk, scratch, touched, nk) or free
            if free and pivots <= 3 * (nk + nc) + 8:
                continue
        if total == 0 and (status != OK or pivots > 3 * (nk + nc) + 8):
            if fired >= 0:
                touched[fired] = 1
            for i in range(mr):
                if mode[mq + mz + i] != 0:
                    touched[nk + mq + mz + i] = 1
            total = 1
            for i in range(nk + nc):
                if touched[i] == 1:
                    total *= 2 if i < nk else 3
            if total > 60000:
                break
    for i in range(len(y)):
        y[i] = y0[i]
    return SINGULAR, 0.0, 0


@njit(**_options)
def copy(source: Array, target: Array) -> None:
    """Copy a vector (a slice assignment would compile shape checks that can never fail)."""
    for i in range(len(source)):
        target[i] = source[i]


@njit(**_options)
def fly_on(T: tuple, g: int, capacity: int, work: tuple, n: int, nc: int, nk: int, omega: Array, end: float, max_events: int, clock: Array, y: Array, mode: Array,
           settled: Array, reg: Array, counters: Array, record: bool, count: int, times: Array, states: Array, modes: Array,
           regions: Array, causes: Array) -> tuple[int, int]:
    """Closed-form flights from event to event, as long as the modes are affine.

    Returns
    -------
    code, count
        Outcome code, FULL, NEED if the closed form of the present mode is to be made, or −1 where Taylor steps take over.
    """
    v, s, de, orders, e, r, p, up, down, c, a, b, taylor, stack, mode0, reg0 = work
    while True:
        if record and count == len(times):
            return FULL, count
        t, fired = clock[0], counters[2]
        copy(mode, mode0)
        copy(reg, reg0)
        affine.drive_vector(t, omega, e)
        slot, ready = -1, False
        for _ in range(2 * (nk + nc) + 4):
            key = affine.mode_key(mode, reg)
            slot = -1
            for i in range(g * capacity, g * capacity + T[18][g]):
                if T[1][i] == key:
                    slot = i
                    break
            if slot < 0:
                if T[18][g] < capacity:
                    return NEED, count
                break
            if T[0][slot] != affine.AFFINE or not affine.admissible(T, slot, y, e, nc, clock[4]):
                break
            guard = affine.germs(T, slot, y, e, omega, fired, clock[1], v, s, de, orders)
            if guard < 0:
                ready = True
                break
            if T[13][slot, guard] >= 2000:
                break
            flip(T[13][slot, guard], mode, reg, nk)
        if not ready:
            copy(mode0, mode)
            copy(reg0, reg)
            return -1, count
        for i in range(nc):
            if settled[i] != mode[i]:
                counters[1] += 1 if settled[i] < 2 else 0
                settled[i] = mode[i]
        if record:
            times[count], causes[count] = t, fired
            copy(y, states[count])
            copy(mode, modes[count])
            copy(reg, regions[count])
            count += 1
        if t >= end:
            return FINISHED, count
        tau, guard = affine.fly(T, slot, y, t, end - t, omega, e, orders, r, p, up, down, c, a, b, taylor, stack)
        affine.arrive(T, slot, y, tau, omega, r, p, up, down)
        counters[4] += 1
        clock[1], clock[4] = tau, max(tau, 0.5 * clock[4])
        clock[0] = t + tau if guard >= 0 else end
        counters[2] = -1
        if guard < 0:
            continue
        if T[13][slot, guard] >= 2000:
            return -1, count
        code = fire(T[13][slot, guard], mode, reg, nk, clock, counters, max_events)
        if code >= 0:
            return code, count


@njit(**_options)
def fire(switch: int, mode: Array, reg: Array, nk: int, clock: Array, counters: Array, max_events: int) -> int:
    """Count an event and give its switch the other state; an outcome code if the motion ends here, else −1."""
    fired = flip(switch, mode, reg, nk)
    counters[2] = fired
    counters[0] += 1
    counters[3] += 1 if fired < nk else 0
    if counters[0] % ZENO_EVENTS == 0:
        if clock[0] - clock[2] < 1e-10 * clock[3]:
            return ZENO
        clock[2] = clock[0]
    return LIMIT if counters[0] >= max_events else -1


def workspace(sizes: Array, doubtful: int, waves: int, rows: int, magnitudes: int, N: int) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Work space of :func:`integrate`: for the Taylor steps, and for the closed forms."""
    n, nq, nz, nr, _, mq, mz, mr, nk = map(int, sizes)
    nc, z, orders = mq + mz + mr, np.zeros, affine.GERM_ORDERS + 1
    big, guards, ne = max(nq + mq, nz + mz), nk + 2 * nc + doubtful + 1, 2 + 2 * waves
    stack = z((64, 36))
    space = (z((rows, N + 1)), z(magnitudes), z((nq + mq, nq + mq)), z((nz + mz, nz + mz)), z((nr, nr)), z((nr, nr)), z(2 * nr),
             z((big, big)), z(N + 1), stack, z(nk + nc, np.int64), z(n), z(N + 1), z((guards, N + 1)), z((guards, 2), np.int64),
             np.ones(mq + mz + 1, np.int64))
    c = np.complex128
    work = (z((orders, n)), z((orders, n)), z((orders, ne)), z(guards, np.int64), z(ne), z(n, c), z((n, 3), c), z((n, waves), c),
            z((n, waves), c), z(3), z(n, c), z(waves, c), z(33), stack, z(nc, np.int64), z(nk, np.int64))
    return space, work


@njit(**_options)
def integrate(jets: JETS, residual: RESIDUAL, sizes: Array, u_rows: Array, force: Array, plus: Array, minus: Array, kinks: Array,
              watched: Array, doubtful: Array, space: tuple, work: tuple, K_all: Array, M_all: Array, C_all: Array, J_all: Array,
              omega_all: Array, T: tuple, capacity: int, N: int, tol: float, atol: float, end: float, max_events: int, group: Array,
              codes: Array, clocks: Array, states_now: Array, modes_now: Array, settled_now: Array, regions_now: Array,
              counters_all: Array, record: bool, times: Array, states: Array, modes: Array, regions: Array, causes: Array) -> int:
    """Follow motions, lane by lane, until `end`, until the record is full, or until a closed form has to be made.

    Parameters
    ----------
    space, work : tuples of arrays
        Work space, see :func:`workspace`.
    K_all, M_all, C_all, J_all, omega_all : arrays
        Constants by group of lanes with the same parameters.
    T, capacity
        Tables of closed forms, and the number of slots of each group (0: Taylor steps only).
    group : array of int, shape (lanes,)
    codes : array of int, shape (lanes,)
        FULL or NEED where a lane is to go on; receives the outcome code.
    clocks : array, shape (lanes, 5)
        t, last step, time of an event ZENO_EVENTS events ago, span, and the length of recent steps (events that coincide
        make steps of length zero, which say nothing of the rounding errors made before).
    states_now, modes_now, settled_now, regions_now : arrays, shape (lanes, ·)
        Where each lane is; `settled` is the mode before the last event (9: none yet).
    counters_all : array of int, shape (lanes, 5)
        Events, switches of contacts, fired switch or −1, kinks crossed, steps.
    record : bool
        Whether to record the steps (of a single lane).
    times, states, modes, regions, causes : arrays
        Record of the steps: start time, state, mode, region, and the switch that caused it (−1: none).

    Returns
    -------
    int
        Number of recorded steps.
    """
    n, nr, mq, mz = sizes[0], sizes[3], sizes[5], sizes[6]
    nk, nc = len(kinks), len(u_rows)
    W, mag, Rq, Rz, A, B, G, scratch, c, stack, touched, y0, powers, pending, labels, known = space
    R, count = (Rq, Rz), np.int64(0)
    for lane in range(len(codes)):
        if codes[lane] < FULL:
            continue
        g = group[lane]
        K, M, C, J, omega = K_all[g], M_all[g], C_all[g], J_all[g], omega_all[g]
        clock, y, mode, settled = clocks[lane], states_now[lane], modes_now[lane], settled_now[lane]
        reg, counters = regions_now[lane], counters_all[lane]
        known[mq + mz] = 1
        code = np.int64(-1)
        while code < 0:
            if capacity > 0:
                code, count = fly_on(T, g, capacity, work, n, nc, nk, omega, end, max_events, clock, y, mode, settled, reg, counters,
                                     record, count, times, states, modes, regions, causes)
                if code >= 0:
                    break
            if record and count == len(times):
                code = FULL
                break
            t, fired = clock[0], counters[2]
            hold = fired >= 0 or counters[4] % 64 == 0
            status, h, may_fire = settle(
                jets, residual, sizes, u_rows, force, plus, minus, kinks, watched, doubtful, t, y, mode, reg, K, M, C, J, N, W, R, A, B,
                G, scratch, mag, clock[1], clock[4], max(end - t, 0.0), tol, atol, fired, c, touched, y0, known, hold, powers, pending, labels)
            if record:
                times[count], causes[count] = t, fired
                copy(y, states[count])
                copy(mode, modes[count])
                copy(reg, regions[count])
                count += 1
            for i in range(nc):
                if settled[i] != mode[i]:
                    counters[1] += 1 if settled[i] < 2 else 0
                    settled[i] = mode[i]
            if status == NAN:
                code = UNDEFINED
                if record and fired < 0 and count > 1:
                    # The last step has left the domain of a formula: its end is no state of the motion.
                    count -= 1
                    clock[0] = times[count - 1]
                    copy(states[count - 1], y)
            elif status != OK:
                code = ON_JUMP if nr == 0 else NO_RATE
            elif t >= end:
                code = FINISHED
            elif h < 1e-15 * max(abs(t), 1e-3) and h < end - t:
                # The rate of a sliding rate-independent coordinate runs away where its branch of equilibria ends.
                code = TINY
                for i in range(nr):
                    if mode[mq + mz + i] != 0:
                        code = NO_RATE
            if code >= 0:
                break
            x, which = first_event(pending, labels, may_fire, N, stack)
            if which < 2000 or x > 0.0:
                for i in range(n):
                    y[i] = horner(W[i], N, x * h)
                counters[4] += 1
                clock[1], clock[4] = h, max(h, 0.5 * clock[4])
                clock[0] = end if which < 0 and h >= end - t else t + x * h
                counters[2] = -1
            if which >= 2000:
                code = NEGATIVE
            elif which >= 0:
                code = fire(which, mode, reg, nk, clock, counters, max_events)
        codes[lane] = code
    return count


@njit(cache=True)
def run_setup(setup: SETUP, p: Array, K: Array, M: Array, C: Array, J: Array, omega: Array) -> None:
    """Call a compiled setup function."""
    setup(p, K, M, C, J, omega)


@njit(**_options)
def probe(jets: JETS, sizes: Array, u_rows: Array, force: Array, plus: Array, minus: Array, kinks: Array, rows: int, magnitudes: int,
          K: Array, M: Array, C: Array, J: Array, mode: Array, reg: Array, times: Array, states: Array, out: Array, hold: Array) -> bool:
    """Rates of the state, then u, λ, s⁺, s⁻ and guards of a mode at some times and states; False if not all finite.

    `hold` receives the columns that put the velocities of sticking inertial contacts back onto their surface.
    """
    n, nq, nz, nr, mq, mz = sizes[0], sizes[1], sizes[2], sizes[3], sizes[5], sizes[6]
    nc, nk = len(u_rows), len(kinks)
    W, mag = np.zeros((rows, 2)), np.zeros(magnitudes)
    R = (np.zeros((nq + mq, nq + mq)), np.zeros((nz + mz, nz + mz)))
    big = max(nq + mq, nz + mz)
    scratch, known = np.zeros((big, big)), np.ones(mq + mz + 1, np.int64)
    A, B = np.zeros((nr, nr)), np.zeros((nr, nr))
    if not resolve(sizes, mode, known, M, C, J, scratch, R):
        return False
    for c in range(mq):
        for i in range(nq):
            hold[c, i] = R[0][i, nq + c] if mode[c] == 0 else 0.0
    for p in range(len(times)):
        if jets(times[p], states[p], mode, reg, K, R[0], R[1], 1, W, A, B, mag) != OK:
            return False
        for i in range(n):
            out[p, i] = W[i, 1]
        for c in range(nc):
            out[p, n + c] = settle_zero(W[u_rows[c], 0], mag[c])
            out[p, n + nc + c] = W[force[c], 0]
            out[p, n + 2 * nc + c] = W[plus[c], 0]
            out[p, n + 3 * nc + c] = W[minus[c], 0]
        for j in range(nk):
            out[p, n + 4 * nc + j] = W[kinks[j], 0]
        for i in range(nq + nz + nr):
            out[p, nq + i] = settle_zero(out[p, nq + i], mag[3 * nc + nk + i])
        for i in range(n + 4 * nc + nk):
            if not np.isfinite(out[p, i]):
                return False
    return True


@njit(**_options)
def settle_zero(value: float, size: float) -> float:
    """The value, or 0 if it is only the rounding error of terms of a size."""
    return 0.0 if abs(value) <= 1e-15 * size else value
