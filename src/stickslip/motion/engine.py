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

import numpy as np
from numba import boolean, float64, int64, njit, types, void

from stickslip.equations.series import invert
from stickslip.motion.roots import NONE, first_crossing, horner

Array = np.ndarray
vector, matrix, indices = float64[::1], float64[:, ::1], int64[::1]
SETUP = types.FunctionType(void(vector, vector, matrix, matrix, matrix))
JETS = types.FunctionType(
    int64(float64, vector, indices, indices, vector, matrix, matrix, int64, matrix, matrix, matrix, vector))
RESIDUAL = types.FunctionType(void(float64, vector, indices, indices, vector, vector, matrix))
POWERS = types.FunctionType(void(matrix, indices, vector, vector))

# Codes of motion.outcome.Outcome, and FULL: the record is full, call again.
FINISHED, NO_RATE, ON_JUMP, ZENO, TINY, LIMIT, NEGATIVE, UNDEFINED, FULL = 0, 2, 3, 4, 5, 6, 7, 8, 100
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


@njit(**_options)
def germ(W: Array, row: int, sign: float, shift_row: int, shift_sign: float, N: int, h: float, size0: float, size1: float,
         floor0: float, c: Array) -> tuple[int, int]:
    """Sign of a guard for small times, and the order that decides it.

    The guard is sign·W[row] + shift_sign·W[shift_row]; its coefficients, scaled to the step h, are left in c.
    """
    x, largest = 1.0, 0.0
    for k in range(N):
        v = sign * W[row, k]
        if shift_row >= 0:
            v += shift_sign * W[shift_row, k]
        v *= x
        c[k] = v
        if k > 0:
            largest = max(largest, abs(v))
        x *= h
    if c[0] > floor0:
        return 1, 0
    if c[0] < -floor0:
        return -1, 0
    floor = ROUNDING * (size0 + h * size1 + largest)
    for k in range(1, N):
        if c[k] > floor:
            return 1, k
        if c[k] < -floor:
            return -1, k
    return 0, N


@njit(**_options)
def step_size(W: Array, rows: Array, n: int, N: int, last: float, tol: float, atol: float) -> float:
    """Step for which the last two Taylor terms of the state and of all guards are below tol times their size."""
    worst, before = 0.0, 0.0
    for r in range(n):
        size = abs(W[r, 0]) + abs(W[r, 1]) * last + atol
        worst = max(worst, abs(W[r, N]) / size)
        before = max(before, abs(W[r, N - 1]) / size)
    h = np.inf
    if worst > 0.0:
        h = (tol / worst) ** (1.0 / N)
    if before > 0.0:
        h = min(h, (tol / before) ** (1.0 / (N - 1)))
    worst, before = 0.0, 0.0
    for i in range(len(rows)):
        r = rows[i]
        size = abs(W[r, 0]) + abs(W[r, 1]) * last + atol
        worst = max(worst, abs(W[r, N - 1]) / size)
        before = max(before, abs(W[r, N - 2]) / size)
    if worst > 0.0:
        h = min(h, (tol / worst) ** (1.0 / (N - 1)))
    if before > 0.0:
        h = min(h, (tol / before) ** (1.0 / (N - 2)))
    return h


@njit(**_options)
def project_rates(t: float, y: Array, mode: Array, reg: Array, K: Array, first: int, nr: int, offset: int, residual: RESIDUAL,
                  A: Array, B: Array, G: Array, W: Array, mag: Array, nc: int) -> int:
    """Put sliding rate-independent coordinates back on λ + σ s = 0 (one Newton step: they are there up to rounding)."""
    residual(t, y, mode, reg, K, G, A)
    sliding = False
    for i in range(nr):
        if mode[first + i] != 0:
            sliding = True
            if not abs(G[i]) <= 1e-9 * (1e-3 + mag[2 * nc + first + i]):
                return OFF_SURFACE
    if not sliding:
        return OK
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
        gap = W[u_rows[c], 0]
        if mode[c] == 0 and abs(gap) > 1e-9 * last * mag[nc + c] + ROUNDING * mag[c]:
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
    if nq > 0 and not resolvent(M, nq, J, 0, mq, 0, mode, scratch, R[0]):
        return False
    if nz > 0 and not resolvent(C, nz, J, mq, mz, nq, mode, scratch, R[1]):
        return False
    known[mq + mz] = 0
    return True


@njit(**_options)
def evaluate_mode(jets: JETS, residual: RESIDUAL, sizes: Array, u_rows: Array, t: float, y: Array, mode: Array, reg: Array,
                  K: Array, M: Array, C: Array, J: Array, N: int, W: Array, R: tuple, A: Array, B: Array, G: Array, scratch: Array,
                  mag: Array, last: float, known: Array) -> int:
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
        if (sticking or nr > 0) and jets(t, y, mode, reg, K, Rq, Rz, 1, W, A, B, mag) == SINGULAR:
            return SINGULAR
        if not sticking or release_or_hold(y, mode, nq, mq, J, Rq, W, u_rows, mag, last):
            break
    if nr > 0:
        status = project_rates(t, y, mode, reg, K, mq + mz, nr, 2 * nq + nz, residual, A, B, G, W, mag, nc)
        if status != OK:
            return status
    if jets(t, y, mode, reg, K, Rq, Rz, N, W, A, B, mag) == SINGULAR:
        return SINGULAR
    for r in range(n):
        if not np.isfinite(W[r, N]) or not np.isfinite(W[r, 0]):
            return NAN
    for c in range(nc):
        if not np.isfinite(W[u_rows[c], N - 1]):
            return NAN
    return OK


@njit(**_options)
def violated(W: Array, mode: Array, reg: Array, sizes: Array, u_rows: Array, force: Array, plus: Array, minus: Array, kinks: Array,
             mag: Array, N: int, h: float, fired: int, c: Array) -> int:
    """Least switch whose guard becomes negative at once (kinks first), or −1; contacts that would slip back get +1000."""
    nk = len(kinks)
    nc = len(u_rows)
    for j in range(nk):
        size = mag[3 * nc + j]
        floor = (FIRED if fired == j else ROUNDING) * size
        s, _ = germ(W, kinks[j], 1.0 if reg[j] == 1 else -1.0, -1, 0.0, N, h, size, 0.0, floor, c)
        if s < 0:
            return j
    for i in range(nc):
        if mode[i] == 0:
            size = mag[2 * nc + i] + abs(W[plus[i], 0]) + abs(W[minus[i], 0])
            floor = (FIRED if fired == nk + i else ROUNDING) * size
            s, _ = germ(W, force[i], 1.0, plus[i], 1.0, N, h, size, 0.0, floor, c)
            if s < 0:
                return nk + i
            s, _ = germ(W, force[i], -1.0, minus[i], 1.0, N, h, size, 0.0, floor, c)
            if s < 0:
                return nk + i + 1000
        else:
            size, size1 = mag[i], mag[nc + i]
            s, _ = germ(W, u_rows[i], float(mode[i]), -1, 0.0, N, h, size, size1, ROUNDING * size, c)
            if s < 0:
                return nk + i
    return -1


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
def settle(jets: JETS, residual: RESIDUAL, sizes: Array, u_rows: Array, force: Array, plus: Array, minus: Array, kinks: Array,
           watched: Array, t: float, y: Array, mode: Array, reg: Array, K: Array, M: Array, C: Array, J: Array, N: int, W: Array,
           R: tuple, A: Array, B: Array, G: Array, scratch: Array, mag: Array, last: float, room: float, tol: float, atol: float,
           fired: int, c: Array, touched: Array, y0: Array, known: Array) -> tuple[int, float]:
    """Find the mode the motion takes now; W then holds its Taylor coefficients.

    Returns
    -------
    status, step
        OK and the step size, or NAN, or SINGULAR if no mode is possible.
    """
    nk, nc, mq, mz, mr = len(kinks), len(u_rows), sizes[5], sizes[6], sizes[7]
    for i in range(len(y)):
        y0[i] = y[i]
    for i in range(nk + nc):
        touched[i] = 0
    status, h = OK, room
    for _ in range(3 * (nk + nc) + 8):
        for i in range(len(y)):
            y[i] = y0[i]
        status = evaluate_mode(jets, residual, sizes, u_rows, t, y, mode, reg, K, M, C, J, N, W, R, A, B, G, scratch, mag,
                               last, known)
        if status != OK:
            break
        h = min(room, step_size(W, watched, len(y), N, last, tol, atol))
        switch = violated(W, mode, reg, sizes, u_rows, force, plus, minus, kinks, mag, N, h, fired, c)
        if switch < 0:
            return OK, h
        touched[flip(switch, mode, reg, nk)] = 1
    if status == NAN:
        return NAN, 0.0
    # Pivoting left the admissible modes (a singular or impossible one): try all states of the switches concerned.
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
        return SINGULAR, 0.0
    for candidate in range(total):
        code = candidate
        for i in range(nk + nc):
            if touched[i] == 1:
                if i < nk:
                    reg[i] = code % 2
                    code //= 2
                else:
                    mode[i - nk] = code % 3 - 1
                    code //= 3
        for i in range(len(y)):
            y[i] = y0[i]
        if evaluate_mode(jets, residual, sizes, u_rows, t, y, mode, reg, K, M, C, J, N, W, R, A, B, G, scratch, mag, last, known) != OK:
            continue
        h = min(room, step_size(W, watched, len(y), N, last, tol, atol))
        if violated(W, mode, reg, sizes, u_rows, force, plus, minus, kinks, mag, N, h, fired, c) < 0:
            return OK, h
    for i in range(len(y)):
        y[i] = y0[i]
    return SINGULAR, 0.0


@njit(**_options)
def deflated_crossing(W: Array, row: int, sign: float, shift_row: int, shift_sign: float, N: int, h: float, size0: float,
                      size1: float, floor0: float, limit: float, c: Array, stack: Array) -> float:
    """First crossing of a guard within the step, not counting its zero at the start."""
    s, order = germ(W, row, sign, shift_row, shift_sign, N, h, size0, size1, floor0, c)
    if s <= 0:
        return NONE
    if order > 0:
        for k in range(N - order):
            c[k] = c[k + order]
    return first_crossing(c, N - 1 - order, limit, ROUNDING * (size0 + h * size1), stack)


@njit(**_options)
def first_event(W: Array, mode: Array, reg: Array, u_rows: Array, force: Array, plus: Array, minus: Array, kinks: Array, mag: Array,
                N: int, h: float, fired: int, c: Array, stack: Array) -> tuple[float, int]:
    """Earliest event of the step: (fraction of the step, switch); switch ≥ 2000 means a negative threshold."""
    nk, nc = len(kinks), len(u_rows)
    limit, which = 1.0, -1
    for j in range(nk):
        size = mag[3 * nc + j]
        floor = (FIRED if fired == j else ROUNDING) * size
        x = deflated_crossing(W, kinks[j], 1.0 if reg[j] == 1 else -1.0, -1, 0.0, N, h, size, 0.0, floor, limit, c, stack)
        if x <= limit:
            limit, which = x, j
    for i in range(nc):
        if mode[i] == 0:
            size = mag[2 * nc + i] + abs(W[plus[i], 0]) + abs(W[minus[i], 0])
            floor = (FIRED if fired == nk + i else ROUNDING) * size
            x = deflated_crossing(W, force[i], 1.0, plus[i], 1.0, N, h, size, 0.0, floor, limit, c, stack)
            if x <= limit:
                limit, which = x, nk + i
            x = deflated_crossing(W, force[i], -1.0, minus[i], 1.0, N, h, size, 0.0, floor, limit, c, stack)
            if x <= limit:
                limit, which = x, nk + i + 1000
        else:
            x = deflated_crossing(W, u_rows[i], float(mode[i]), -1, 0.0, N, h, mag[i], mag[nc + i], ROUNDING * mag[i], limit, c,
                                  stack)
            if x <= limit:
                limit, which = x, nk + i
        for side in range(2):
            row = plus[i] if side == 0 else minus[i]
            if side == 1 and row == plus[i]:
                continue
            size = abs(W[row, 0]) + abs(W[row, 1]) * h
            if W[row, 0] < -1e-12 * (size + mag[2 * nc + i]):
                return 0.0, 2000 + i
            x = deflated_crossing(W, row, 1.0, -1, 0.0, N, h, size, 0.0, ROUNDING * size, limit, c, stack)
            if x <= limit:
                limit, which = x, 2000 + i
    return limit, which


@njit(**_options)
def integrate(jets: JETS, residual: RESIDUAL, sizes: Array, u_rows: Array, force: Array, plus: Array, minus: Array, kinks: Array,
              watched: Array, rows: int, magnitudes: int, K: Array, M: Array, C: Array, J: Array, N: int, tol: float, atol: float,
              end: float, max_events: int, clock: Array, y: Array, mode: Array, settled: Array, reg: Array, counters: Array, record: bool,
              times: Array, states: Array, modes: Array, regions: Array, causes: Array) -> tuple[int, int]:
    """Follow the motion until `end`, or until the record is full.

    Parameters
    ----------
    clock : array [t, last step, time of an event ZENO_EVENTS events ago, span]
    settled : array of int
        Mode of each contact before the last event (9: none yet).
    counters : array of int [events, switches of contacts, fired switch or −1, kinks crossed, steps]
    times, states, modes, regions, causes : arrays
        Record of the steps: start time, state, mode, region, and the switch that caused it (−1: none).

    Returns
    -------
    code, count
        Outcome code (or FULL), and the number of recorded steps.
    """
    n, nq, nz, nr, mq, mz = sizes[0], sizes[1], sizes[2], sizes[3], sizes[5], sizes[6]
    nk, nc = len(kinks), len(u_rows)
    W = np.zeros((rows, N + 1))
    mag = np.zeros(magnitudes)
    R = (np.zeros((nq + mq, nq + mq)), np.zeros((nz + mz, nz + mz)))
    A, B, G = np.zeros((nr, nr)), np.zeros((nr, nr)), np.zeros(nr)
    big = max(nq + mq, nz + mz)
    scratch = np.zeros((big, big))
    c, stack, touched, y0 = np.zeros(N + 1), np.zeros((64, 33)), np.zeros(nk + nc, np.int64), np.zeros(n)
    known = np.ones(mq + mz + 1, np.int64)
    count = 0
    while True:
        if record and count == len(times):
            return FULL, count
        t, fired = clock[0], counters[2]
        status, h = settle(jets, residual, sizes, u_rows, force, plus, minus, kinks, watched, t, y, mode, reg, K, M, C, J, N, W, R, A,
                           B, G, scratch, mag, clock[1], max(end - t, 0.0), tol, atol, fired, c, touched, y0, known)
        if record:
            times[count] = t
            causes[count] = fired
            for i in range(n):
                states[count, i] = y[i]
            for i in range(nc):
                modes[count, i] = mode[i]
            for j in range(nk):
                regions[count, j] = reg[j]
            count += 1
        for i in range(nc):
            if settled[i] != mode[i]:
                counters[1] += 1 if settled[i] < 2 else 0
                settled[i] = mode[i]
        if status == NAN:
            return UNDEFINED, count
        if status != OK:
            return (ON_JUMP if nr == 0 else NO_RATE), count
        if t >= end:
            return FINISHED, count
        if h < 1e-15 * max(abs(t), 1e-3) and h < end - t:
            return TINY, count
        x, which = first_event(W, mode, reg, u_rows, force, plus, minus, kinks, mag, N, h, fired, c, stack)
        if which >= 2000 and x == 0.0:
            return NEGATIVE, count
        for i in range(n):
            y[i] = horner(W[i], N, x * h)
        counters[4] += 1
        clock[1] = h
        clock[0] = end if which < 0 and h >= end - t else t + x * h
        counters[2] = -1
        if which < 0:
            continue
        if which >= 2000:
            return NEGATIVE, count
        fired = flip(which, mode, reg, nk)
        counters[2] = fired
        counters[0] += 1
        counters[3] += 1 if fired < nk else 0
        if counters[0] % ZENO_EVENTS == 0:
            if clock[0] - clock[2] < 1e-10 * clock[3]:
                return ZENO, count
            clock[2] = clock[0]
        if counters[0] >= max_events:
            return LIMIT, count


@njit(cache=True)
def run_setup(setup: SETUP, p: Array, K: Array, M: Array, C: Array, J: Array) -> None:
    """Call a compiled setup function."""
    setup(p, K, M, C, J)
