"""Guards along a Taylor step: which are violated at once, and which of the others fires first."""

from __future__ import annotations

import numpy as np
from numba import njit

from stickslip.motion.kernel import FIRED, INLINED, NOWHERE, OPTIONS, ROUNDING, ZERO, Rows, Space
from stickslip.motion.roots import first_crossing

Array = np.ndarray


@njit(**OPTIONS, fastmath={"reassoc", "contract", "nsz"})
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


@njit(**OPTIONS)
def germ(
    W: Array,
    row: int,
    sign: float,
    shift_row: int,
    N: int,
    powers: Array,
    near: float,
    size0: float,
    size1: float,
    precision: float,
    c: Array,
) -> tuple[int, int]:
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


@njit(**INLINED)
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


@njit(**OPTIONS)
def fill_powers(powers: Array, h: float) -> None:
    """Powers of the step."""
    x = 1.0
    for k in range(len(powers)):
        powers[k] = x
        x *= h


@njit(**OPTIONS)
def consider(
    W: Array,
    powers: Array,
    c: Array,
    pending: Array,
    labels: Array,
    row: int,
    sign: float,
    shift_row: int,
    N: int,
    near: float,
    size0: float,
    size1: float,
    precision: float,
    switch: int,
    count: int,
) -> int:
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


@njit(**INLINED)
def scan(rows: Rows, space: Space, mode: Array, reg: Array, N: int, last: float, fired: int) -> tuple[int, int]:
    """Look at all guards of a mode: (least switch that is violated at once, or −1; number of guards that may fire).

    Switches are kinks first, then contacts (+1000: towards slip−), then 2000 + i for a threshold that turns negative.
    """
    W, mag, force, plus, minus = space.W, space.mag, rows.force, rows.plus, rows.minus
    powers, c, pending, labels = space.powers, space.germ, space.pending, space.labels
    nk, nc, count, near = len(rows.kinks), len(rows.u), ZERO, last + powers[1]
    for j in range(nk):
        row, precision = rows.kinks[j], FIRED if fired == j else ROUNDING
        sign = 1.0 if reg[j] == 1 else -1.0
        count = consider(
            W,
            powers,
            c,
            pending,
            labels,
            row,
            sign,
            NOWHERE,
            N,
            near,
            mag[3 * nc + j],
            abs(W[row, 1]),
            precision,
            j,
            count,
        )
        if count < 0:
            return j, 0
    for i in range(nc):
        precision = FIRED if fired == nk + i else ROUNDING
        if mode[i] == 0:
            size = mag[2 * nc + i] + abs(W[plus[i], 0]) + abs(W[minus[i], 0])
            size += near * (abs(W[force[i], 1]) + abs(W[plus[i], 1]) + abs(W[minus[i], 1]))
            count = consider(
                W, powers, c, pending, labels, force[i], 1.0, plus[i], N, near, size, 0.0, precision, nk + i, count
            )
            if count < 0:
                return nk + i, 0
            count = consider(
                W,
                powers,
                c,
                pending,
                labels,
                force[i],
                -1.0,
                minus[i],
                N,
                near,
                size,
                0.0,
                precision,
                nk + i + 1000,
                count,
            )
            if count < 0:
                return nk + i + 1000, 0
        else:
            row = rows.u[i]
            size1 = mag[nc + i] + abs(W[row, 1])
            count = consider(
                W,
                powers,
                c,
                pending,
                labels,
                row,
                float(mode[i]),
                NOWHERE,
                N,
                near,
                mag[i],
                size1,
                precision,
                nk + i,
                count,
            )
            if count < 0:
                return nk + i, 0
    for i in range(len(rows.doubtful)):
        row, before = rows.doubtful[i], count
        size = abs(W[row, 0]) + abs(W[row, 1]) * powers[1]
        count = consider(W, powers, c, pending, labels, row, 1.0, NOWHERE, N, 0.0, size, 0.0, 1e-12, 2000 + i, count)
        if count < 0:
            space.labels[before, 0], space.labels[before, 1] = 2000 + i, -1
            count = before + 1
    return -1, count


@njit(**INLINED)
def first_event(space: Space, count: int, N: int) -> tuple[float, int]:
    """Earliest event of the step among the guards that may fire: (fraction of the step, switch or −1)."""
    limit, which = 1.0, -1
    for i in range(count):
        d = space.labels[i, 1]
        if d < 0:
            return 0.0, space.labels[i, 0]
        x = first_crossing(space.pending[i], d, limit, space.pending[i, N], space.stack)
        if x <= limit:
            limit, which = x, space.labels[i, 0]
    return limit, which
