"""Many steps with a dense A and boxes K(s), in one compiled loop.

A step minimises the strictly convex function ½dᵀAd − rᵀd + Σ max(lower d, upper d). Its state is a
sign for every component: +1 or −1 moves, with the force on the upper or lower bound; 0 rests. On
the face of fixed signs the minimiser is a linear solve. The walk goes towards it until a component
comes to rest; at the minimiser of a face it releases the resting components whose forces are out of
bounds. Every move of positive length lowers the function, and released components that turn the
wrong way are dropped until one is left, which cannot: so no face comes back.

The Cholesky factor of A on the moving components is kept from step to step. A change of one sign
changes it by a row (in |S|² operations, stably); a step in which no sign changes factorises
nothing.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.machine_code import njit

_ROUNDING = 16 * 2.2e-16  # of a sum of forces, relative to its largest terms
FRESH = 200  # changes, besides ten per component, after which the factor is made anew


@njit(cache=True)
def enter(A: Array, L: Array, order: Array, m: int, k: int) -> None:
    """Let component k move: a new last row of the factor."""
    square = A[k, k]
    for i in range(m):
        entry = A[k, order[i]]
        for j in range(i):
            entry -= L[m, j] * L[i, j]
        L[m, i] = entry / L[i, i]
        square -= L[m, i] * L[m, i]
    L[m, m] = math.sqrt(max(square, 2.2e-16 * A[k, k]))
    order[m] = k


@njit(cache=True)
def leave_face(L: Array, order: Array, m: int, k: int) -> None:
    """Let component k rest: a row of the factor goes, and rotations make it triangular again."""
    p = 0
    while order[p] != k:
        p += 1
    for i in range(p, m - 1):
        order[i] = order[i + 1]
        for j in range(i + 2):
            L[i, j] = L[i + 1, j]
    for i in range(p, m - 1):
        length = math.hypot(L[i, i], L[i, i + 1])
        c = L[i, i] / length
        s = L[i, i + 1] / length
        for j in range(i, m - 1):
            x = L[j, i]
            y = L[j, i + 1]
            L[j, i] = c * x + s * y
            L[j, i + 1] = c * y - s * x


@njit(cache=True)
def target(
    L: Array,
    order: Array,
    m: int,
    sign: Array,
    r: Array,
    lower: Array,
    upper: Array,
    b: int,
    x: Array,
) -> None:
    """The minimiser x on the face of the given signs, 0 on resting components."""
    for i in range(m):
        k = order[i]
        entry = r[k] - (upper[b, k] if sign[k] > 0 else lower[b, k])
        for j in range(i):
            entry -= L[i, j] * x[order[j]]
        x[k] = entry / L[i, i]
    for i in range(m - 1, -1, -1):
        x[order[i]] /= L[i, i]
        for j in range(i):
            x[order[j]] -= L[i, j] * x[order[i]]


@njit(cache=True)
def solve_face(
    A: Array, L: Array, order: Array, sign: Array, count: Array,
    r: Array, lower: Array, upper: Array, b: int, noise: float, d: Array, x: Array,
) -> int:  # fmt: skip
    """One step in the box of row b: the increment d, and the factor and the signs that belong to
    it.

    `count` holds the number of moving components and the changes since the factor was made. Forces
    within `noise` of a bound are on it. Returns the number of changes, or −1 if there were too
    many.
    """
    n = len(r)
    m = count[0]
    changes = 0
    for i in range(n):
        d[i] = x[i] = 0.0
    while changes <= 1000 + 50 * n:
        before = changes
        if count[1] > FRESH + 10 * n:
            for i in range(m):
                enter(A, L, order, i, order[i])
            count[1] = 0
        target(L, order, m, sign, r, lower, upper, b, x)
        share = 1.0
        for i in range(n):
            if sign[i] * x[i] < 0.0:
                share = min(share, d[i] / (d[i] - x[i]))
        for i in range(n):
            if share < 1.0 and sign[i] * x[i] < 0.0 and d[i] / (d[i] - x[i]) <= share:
                leave_face(L, order, m, i)
                d[i] = x[i] = 0.0
                sign[i] = 0
                m = m - 1
                changes = changes + 1
            else:
                d[i] = x[i] if share == 1.0 else d[i] + share * (x[i] - d[i])
        if share == 1.0:
            for i in range(n):
                if sign[i] == 0:
                    force = r[i]
                    for j in range(m):
                        force -= A[i, order[j]] * x[order[j]]
                    if force > upper[b, i] + noise:
                        sign[i] = 2
                    elif force < lower[b, i] - noise:
                        sign[i] = -2
            for i in range(n):
                if abs(sign[i]) == 2:
                    sign[i] //= 2
                    enter(A, L, order, m, i)
                    m, changes = m + 1, changes + 1
        count[0] = m
        count[1] += changes - before
        if changes == before:
            for i in range(n):
                if abs(d[i]) * A[i, i] <= noise:
                    d[i] = 0.0
            return changes
    return -1


@njit(cache=True)
def advance_boxes(
    A: Array, L: Array, order: Array, sign: Array, count: Array,
    z: Array, loads: Array, lower: Array, upper: Array, states: Array, effort: Array,
) -> int:  # fmt: skip
    """Steps from z through the loads, one row each; returns how many were done.

    Bounds have one row per step, or one row for all. z moves along.
    """
    n = len(z)
    r = np.empty(n)
    d = np.empty(n)
    x = np.empty(n)
    for k in range(len(loads)):
        b = k if len(lower) > 1 else 0
        size = 0.0
        for i in range(n):
            r[i] = loads[k, i]
            terms = abs(loads[k, i]) + max(upper[b, i], -lower[b, i])
            for j in range(n):
                r[i] -= A[i, j] * z[j]
                terms += abs(A[i, j] * z[j])
            size = max(size, terms)
        effort[k] = solve_face(A, L, order, sign, count, r, lower, upper, b, _ROUNDING * size, d, x)
        if effort[k] < 0:
            return k
        for i in range(n):
            z[i] += d[i]
            states[k, i] = z[i]
    return len(loads)
