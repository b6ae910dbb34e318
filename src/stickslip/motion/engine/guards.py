"""Guards along a Taylor step: which are violated at once, and which of the others fires first."""

from __future__ import annotations

import numpy as np

from stickslip.machine_code import njit
from stickslip.motion.engine.roots import first_crossing
from stickslip.motion.steps.arrays import (
    DIMENSION,
    DOUBTFUL,
    FIRED,
    INLINED,
    NOWHERE,
    OPTIONS,
    ROUNDING,
    ZERO,
    Rows,
    Space,
)
from stickslip.motion.steps.step_size import impulse

Array = np.ndarray


@njit(**OPTIONS, fastmath={"reassoc", "contract", "nsz"})
def fall(W: Array, row: int, shift_row: int, sign: float, N: int, powers: Array) -> float:
    """Bound Σ max(−cₖ, 0) hᵏ of how far sign·W[row] + W[shift], which starts positive, falls within
    the step."""
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

    The guard is sign·W[row] + W[shift_row]; its coefficients, scaled to the step, are left in c. A
    zero is known no better than the time at which it was found: relative to what the guard does in
    the steps on both sides.
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


@njit(**OPTIONS)
def resting(mode: int) -> bool:
    """Whether a contact does not slip: it sticks, or others carry it while it is at its
    threshold."""
    return mode == 0 or abs(mode) == 2


@njit(**OPTIONS)
def stays(
    rows: Rows, space: Space, mode: Array, c: int, N: int, last: float, fired: int, slack: float
) -> bool:
    """Whether the relative velocity of a contact that does not stick vanishes for a while."""
    W = space.W
    mag = space.mag
    nk = len(rows.kinks)
    nc = len(rows.u)
    unit = space.W[rows.sizes[DIMENSION], 1]
    row = rows.u[c]
    near = last / unit + space.powers[1]
    precision = max(FIRED if nk + c == fired else 0.0, slack * ROUNDING)
    size0 = mag[c]
    size1 = mag[nc + c] * unit + abs(W[row, 1])
    if abs(W[row, 0]) > precision * (size0 + near * size1):
        return False
    spare = space.pending[len(space.pending) - 1]
    s, _ = germ(W, row, 1.0, NOWHERE, N, space.powers, near, size0, size1, precision, slack, spare)
    return s == 0


@njit(**OPTIONS)
def switch_of(guard: int, nk: int, nc: int) -> int:
    """The switch that a guard belongs to: kinks, then contacts; −1 for what must not become
    negative."""
    if guard < nk:
        return guard
    return nk + (guard - nk) // 2 if guard < nk + 2 * nc else -1


@njit(**INLINED)
def scan(
    rows: Rows, space: Space, mode: Array, reg: Array, N: int, last: float, fired: int, slack: float
) -> tuple[int, int]:
    """Look at all guards of a mode: (least guard that is violated at once, or −1; number of guards
    that may fire).

    Guards are numbered: kinks, then two for each contact (towards slip+, or back to stick; towards
    slip−), then what must not become negative. What is below `slack` rounding errors counts as
    zero.
    """
    W = space.W
    mag = space.mag
    force = rows.force
    plus = rows.plus
    minus = rows.minus
    u = rows.u
    powers = space.powers
    pending = space.pending
    labels = space.labels
    unit = W[rows.sizes[DIMENSION], 1]
    nk = len(rows.kinks)
    nc = len(rows.u)
    count = ZERO
    near = last / unit + powers[1]
    for g in range(nk + 2 * nc + len(rows.doubtful)):
        # The guard is sign·W[row] + W[shift]; size0 and size1 are the scales of its value and of
        # its rate.
        i = (g - nk) // 2
        shift = NOWHERE
        size1 = 0.0
        around = near
        sign = 1.0
        if g < nk:
            row = rows.kinks[g]
            sign = 1.0 if reg[g] == 1 else -1.0
            size0 = mag[3 * nc + g]
            size1 = abs(W[row, 1])
            if rows.vanishing[g] >= 0 and powers[1] > 0.0:
                size1 += impulse(rows, mag, rows.vanishing[g], unit * powers[1]) / powers[1]
        elif g >= nk + 2 * nc:
            row, i, side = rows.doubtful[g - nk - 2 * nc]
            if i >= 0 and mode[i] * side <= 0:
                continue
            around = 0.0
            size0 = abs(W[row, 0]) + abs(W[row, 1]) * powers[1]
            if i >= 0:
                size0 += max(W[plus[i], 0], W[minus[i], 0])
        elif mode[i] == 0:
            row, shift = force[i], plus[i]
            if (g - nk) % 2 == 1:
                sign = -1.0
                shift = minus[i]
            size0 = mag[2 * nc + i] + near * (
                abs(W[row, 1]) + abs(W[plus[i], 1]) + abs(W[minus[i], 1])
            )
        else:
            if (g - nk) % 2 == 1:
                continue
            row = u[i]
            sign = 1.0 if mode[i] > 0 else -1.0
            size0 = mag[i]
            size1 = mag[nc + i] * unit + abs(W[row, 1])
        precision = max(FIRED if switch_of(g, nk, nc) == fired else 0.0, slack * ROUNDING)
        if g >= nk + 2 * nc:
            precision = DOUBTFUL
        start = sign * W[row, 0] + (W[shift, 0] if shift >= 0 else 0.0)
        if start > precision * (size0 + around * size1) and start > fall(
            W, row, shift, sign, N, powers
        ):
            continue
        c = pending[count]
        s, order = germ(W, row, sign, shift, N, powers, around, size0, size1, precision, slack, c)
        if s == 0:
            continue
        labels[count, 0] = g
        labels[count, 1] = N - 1 - order
        if s < 0:
            if g < nk + 2 * nc:
                return g, 0
            labels[count, 1] = -1
        # a zero at the start is divided out: what remains starts positive
        for k in range(N - order):
            c[k] = c[k + order]
        c[N] = ROUNDING * (size0 + powers[1] * size1)
        count += 1
    return -1, count


@njit(**INLINED)
def first_event(space: Space, count: int, N: int) -> tuple[float, int]:
    """Earliest event of the step among the guards that may fire: (fraction of the step, guard or
    −1)."""
    limit = 1.0
    which = -1
    for i in range(count):
        d = space.labels[i, 1]
        if d < 0:
            return 0.0, space.labels[i, 0]
        x = first_crossing(space.pending[i], d, limit, space.pending[i, N], space.stack)
        if x <= limit:
            limit = x
            which = space.labels[i, 0]
    return limit, which
