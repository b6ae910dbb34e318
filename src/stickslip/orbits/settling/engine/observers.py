"""What a stretch of motion amounts to, accumulated step by step in compiled code.

The steps are followed again by Taylor series from their first states, as everywhere between knots
(:mod:`stickslip.motion.between.dense`), so that extrema lie where they lie, not at the nearest
knot.
"""

from __future__ import annotations

import numpy as np

from stickslip.machine_code import njit
from stickslip.motion.between.nodes import NODES as GAUSS_NODES
from stickslip.motion.between.nodes import WEIGHTS as GAUSS_WEIGHTS
from stickslip.motion.engine.guards import resting
from stickslip.motion.engine.modes import copy, resolve
from stickslip.motion.engine.roots import horner
from stickslip.motion.steps.arrays import DIMENSION, JETS, OPTIONS, Constants, Record, Rows, Space
from stickslip.motion.steps.stiff import follow
from stickslip.orbits.settling.engine.tables import Sums

Array = np.ndarray

NODES = 6  # at which the slope of a polynomial is looked at for a change of sign


@njit(**OPTIONS)
def clear(sums: Sums) -> None:
    """Nothing has been observed yet."""
    for r in range(len(sums.low)):
        sums.low[r] = np.inf
        sums.high[r] = -np.inf
    for c in range(len(sums.stick)):
        sums.stick[c] = sums.work[c] = sums.peak[c] = sums.impulse[c] = 0.0
    sums.total[0] = sums.total[1] = 0.0
    sums.switches[0] = 0


@njit(**OPTIONS)
def turn(c: Array, d: int, a: float, b: float) -> float:
    """Where the slope of a polynomial of degree d vanishes between a and b, at which it has
    different signs."""
    rising = slope(c, d, b) > 0.0
    for _ in range(60):
        x = 0.5 * (a + b)
        if not a < x < b:
            break
        if (slope(c, d, x) > 0.0) == rising:
            b = x
        else:
            a = x
    return b


@njit(**OPTIONS)
def slope(c: Array, d: int, x: float) -> float:
    """Derivative of Σ c[k] xᵏ, k ≤ d."""
    s = 0.0
    for k in range(d, 0, -1):
        s = s * x + k * c[k]
    return s


@njit(**OPTIONS)
def widen(c: Array, d: int, h: float, low: float, high: float) -> tuple[float, float]:
    """Bounds that also hold a polynomial on [0, h]."""
    value = horner(c, d, h)
    low, high = min(low, c[0], value), max(high, c[0], value)
    if d < 1:
        return low, high
    before = c[1]
    left = 0.0
    for i in range(1, NODES + 1):
        right = h * i / NODES
        after = slope(c, d, right)
        if before * after < 0.0:
            value = horner(c, d, turn(c, d, left, right))
            low, high = min(low, value), max(high, value)
        before, left = after, right
    return low, high


@njit(**OPTIONS)
def observe(
    jets: JETS,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    tol: float,
    atol: float,
    seen: Array,
    knots: Record,
    first: int,
    last: int,
    closely: bool,
    sums: Sums,
) -> None:
    """Add the steps between two knots.

    Parameters
    ----------
    seen : array
        Sizes of the rows that bound the steps; see :class:`stickslip.motion.steps.arrays.Lane`.
    knots : Record
        The step `i` lasts from knot `i` to the next.
    first, last : int
        First and last knot.
    closely : bool
        Whether extrema, work and forces are wanted, for which the steps have to be followed again.
    """
    sizes = rows.sizes
    W = space.W
    n = rows.sizes[DIMENSION]
    nc = len(rows.u)
    # free between steps
    y = space.y0
    mode = space.touched[:nc]
    reg = space.touched[nc:]
    for i in range(first, last):
        length = knots.time[i + 1] - knots.time[i]
        stuck = True
        for c in range(nc):
            now = knots.mode[i, c]
            then = knots.mode[i + 1, c]
            stuck = stuck and resting(now)
            sums.stick[c] += length if resting(now) else 0.0
            sums.switches[0] += 1 if then != now and not (resting(then) and resting(now)) else 0
        sums.total[0] += length
        sums.total[1] += length if stuck and nc > 0 else 0.0
        if not closely or not length > 0.0:
            continue
        copy(knots.mode[i], mode)
        copy(knots.region[i], reg)
        resolve(sizes, k, space, mode)
        copy(knots.state[i], y)
        base = knots.time[i]
        left = length
        before = 0.0
        while left > 0.0:
            order, h, _ = follow(
                jets, rows, k, space, N, base, y, mode, reg, left, before, tol, atol, seen
            )
            h = min(left, max(h, 1e-12 * left))
            add_step(rows, W, order, h, W[n, 1], sums)
            for r in range(n):
                y[r] = horner(W[r], order, h / W[n, 1])
            base = base + h
            left = left - h
            before = h


@njit(**OPTIONS)
def add_step(rows: Rows, W: Array, order: int, h: float, unit: float, sums: Sums) -> None:
    """Add one Taylor step: extrema of the state, and force, impulse and work of the contacts.

    Parameters
    ----------
    h, unit : float
        Length of the step, and the time in powers of which the coefficients are.
    """
    for r in range(len(sums.low)):
        sums.low[r], sums.high[r] = widen(W[r], order, h / unit, sums.low[r], sums.high[r])
    for c in range(len(rows.u)):
        force, speed = W[rows.force[c]], W[rows.u[c]]
        low, high = widen(force, order - 1, h / unit, 0.0, 0.0)
        sums.peak[c] = max(sums.peak[c], high, -low)
        for g in range(len(GAUSS_NODES)):
            tau = h / unit * GAUSS_NODES[g]
            held = horner(force, order - 1, tau)
            sums.impulse[c] += h * GAUSS_WEIGHTS[g] * held
            sums.work[c] -= h * GAUSS_WEIGHTS[g] * held * horner(speed, order - 1, tau)
