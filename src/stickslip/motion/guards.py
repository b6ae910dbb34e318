"""Guards along a Taylor step: which are violated at once, and which of the others fires first."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from stickslip.motion.kernel import DOUBTFUL, FIRED, INLINED, NOWHERE, OPTIONS, ROUNDING, ZERO, Rows, Space
from stickslip.motion.roots import first_crossing

Array = np.ndarray


@njit(**OPTIONS, fastmath={"reassoc", "contract", "nsz"})
def fall(W: Array, row: int, shift_row: int, sign: float, N: int, powers: Array) -> float:
    """Bound Σ max(−cₖ, 0) hᵏ of how far sign·W[row] + W[shift], which starts positive, falls within the step."""
    total = 0.0
    if shift_row < 0:
        for k in range(N):
            total -= min(sign * W[row, k], 0.0) * powers[k]
    else:
        for k in range(N):
            total -= min(sign * W[row, k] + W[shift_row, k], 0.0) * powers[k]
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
    slack: float,
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
    floor = slack * ROUNDING * (size0 + powers[1] * size1 + largest)
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
    # One root is enough where it meets the other conditions, too; edge = tol/h^(N−1).
    h, edge = np.inf, 0.0
    if low > 0.0:
        h = (tol / low) ** (1.0 / (N - 2))
        edge = low / h
    if middle > edge:
        h, edge = (tol / middle) ** (1.0 / (N - 1)), middle
    if top * h > edge:
        h = (tol / top) ** (1.0 / N)
    return h


@njit(**OPTIONS)
def finite_order(W: Array, n: int, N: int) -> int:
    """Order up to which the state's coefficients are finite: close to a blow-up the high ones overflow."""
    for k in range(N, 2, -1):
        finite = True
        for r in range(n):
            finite = finite and math.isfinite(W[r, k])
        if finite:
            return k
    return 2


@njit(**OPTIONS)
def fill_powers(powers: Array, h: float) -> None:
    """Powers of the step; in fours, since each multiplication waits for the one before."""
    a, b, c, d, fourth, n = 1.0, h, h * h, h * h * h, (h * h) * (h * h), len(powers) // 4 * 4
    for k in range(0, n, 4):
        powers[k], powers[k + 1], powers[k + 2], powers[k + 3] = a, b, c, d
        a, b, c, d = a * fourth, b * fourth, c * fourth, d * fourth
    for k in range(n, len(powers)):
        powers[k] = a
        a *= h


@njit(**INLINED)
def scan(
    rows: Rows, space: Space, mode: Array, reg: Array, N: int, last: float, fired: int, slack: float
) -> tuple[int, int]:
    """Look at all guards of a mode: (least switch that is violated at once, or −1; number of guards that may fire).

    Switches are kinks first, then contacts (+1000: towards slip−), then 2000 + i for a threshold that turns negative.
    What is below `slack` rounding errors counts as zero.
    """
    W, mag, force, plus, minus, u = space.W, space.mag, rows.force, rows.plus, rows.minus, rows.u
    powers, pending, labels = space.powers, space.pending, space.labels
    nk, nc, count, near = len(rows.kinks), len(rows.u), ZERO, last + powers[1]
    for g in range(nk + 2 * nc + len(rows.doubtful)):
        # The guard is sign·W[row] + W[shift]; size0 and size1 are the scales of its value and of its rate.
        i, shift, size1, around = (g - nk) // 2, NOWHERE, 0.0, near
        if g < nk:
            switch, row, sign = g, rows.kinks[g], 1.0 if reg[g] == 1 else -1.0
            size0, size1 = mag[3 * nc + g], abs(W[row, 1])
        elif g >= nk + 2 * nc:
            switch, row, sign, around = 2000 + g - nk - 2 * nc, rows.doubtful[g - nk - 2 * nc], 1.0, 0.0
            size0 = abs(W[row, 0]) + abs(W[row, 1]) * powers[1]
        elif mode[i] == 0:
            switch, row, sign, shift = nk + i, force[i], 1.0, plus[i]
            if (g - nk) % 2 == 1:
                switch, sign, shift = nk + i + 1000, -1.0, minus[i]
            size0 = mag[2 * nc + i] + abs(W[plus[i], 0]) + abs(W[minus[i], 0])
            size0 += near * (abs(W[row, 1]) + abs(W[plus[i], 1]) + abs(W[minus[i], 1]))
        else:
            if (g - nk) % 2 == 1:
                continue
            switch, row, sign = nk + i, u[i], float(mode[i])
            size0, size1 = mag[i], mag[nc + i] + abs(W[row, 1])
        precision = max(FIRED if switch % 1000 == fired else 0.0, slack * ROUNDING)
        if switch >= 2000:
            precision = DOUBTFUL
        start = sign * W[row, 0] + (W[shift, 0] if shift >= 0 else 0.0)
        if start > precision * (size0 + around * size1) and start > fall(W, row, shift, sign, N, powers):
            continue
        c = pending[count]
        s, order = germ(W, row, sign, shift, N, powers, around, size0, size1, precision, slack, c)
        if s == 0:
            continue
        labels[count, 0], labels[count, 1] = switch, N - 1 - order
        if s < 0:
            if switch < 2000:
                return switch, 0
            labels[count, 1] = -1
        for k in range(N - order):  # a zero at the start is divided out: what remains starts positive
            c[k] = c[k + order]
        c[N] = ROUNDING * (size0 + powers[1] * size1)
        count += 1
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
