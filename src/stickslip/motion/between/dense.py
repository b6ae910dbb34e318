"""The motion between its knots: values at any time.

A trajectory stores the state at the start of every step, no polynomial: the Taylor series is made
again from that state, so values between knots are as accurate as at the knots, and a stored file
gives the same numbers.
"""

from __future__ import annotations

import numpy as np

from stickslip.machine_code import njit
from stickslip.motion.engine.modes import copy, resolve
from stickslip.motion.engine.roots import horner
from stickslip.motion.steps.arrays import (
    ALLOCATING,
    DIMENSION,
    JETS,
    POWERS,
    Constants,
    Rows,
    Space,
)
from stickslip.motion.steps.stiff import follow

Array = np.ndarray


@njit(**ALLOCATING)
def sample(
    jets: JETS,
    powers: POWERS,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    tol: float,
    atol: float,
    seen: Array,
    knot_time: Array,
    knot_state: Array,
    knot_mode: Array,
    knot_region: Array,
    index: Array,
    times: Array,
    out: Array,
) -> None:
    """Order-0 values of all rows, then energy, dissipated and supplied power, at given times.

    Parameters
    ----------
    seen : array
        Sizes of the rows that bound the steps; see :class:`stickslip.motion.steps.arrays.Lane`.
    index : array of int, shape (times,)
        Knot whose step each time belongs to.
    out : array, shape (times, rows + 3)
    """
    sizes = rows.sizes
    W = space.W
    A = space.A
    B = space.B
    mag = space.mag
    n = rows.sizes[DIMENSION]
    V = np.zeros((len(W), 2))
    y = np.zeros(n)
    z = np.zeros(n)
    power = np.zeros(3)
    mode, reg = np.zeros(knot_mode.shape[1], np.int64), np.zeros(knot_region.shape[1], np.int64)
    last = -1
    base = 0.0
    h = 0.0
    order = N
    known = False
    final = len(knot_time) - 1
    for i in range(len(times)):
        knot = index[i]
        if knot != last or times[i] < base:
            last = knot
            base = knot_time[knot]
            copy(knot_mode[knot], mode)
            copy(knot_region[knot], reg)
            copy(knot_state[knot], y)
            resolve(sizes, k, space, mode)
            known = False
        # the coefficients have to suit what is left of the step
        left = knot_time[min(knot + 1, final)] - base
        if times[i] > base and not known:  # at the knot itself no series is needed
            order, h, _ = follow(
                jets, rows, k, space, N, float(base), y, mode, reg, left, 0.0, tol, atol, seen
            )
            known = True
        while known and times[i] - base > h:
            for r in range(n):
                y[r] = horner(W[r], order, h / W[n, 1])
            base = base + h
            left = left - h
            order, h, _ = follow(
                jets, rows, k, space, N, base, y, mode, reg, left, h, tol, atol, seen
            )
            h = max(h, 1e-12 * left)
        for r in range(n):
            z[r] = horner(W[r], order, (times[i] - base) / W[n, 1]) if known else y[r]
        jets(times[i], z, mode, reg, k.K, space.Rq, space.Rz, 1, V, A, B, mag)
        powers(V, reg, k.K, power)
        for r in range(len(W)):
            out[i, r] = V[r, 0]
        for r in range(3):
            out[i, len(W) + r] = power[r]
