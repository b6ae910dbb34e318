"""Compiled sweeps over block rows: exact minimisation node by node, linear smoothing, forces, line
search.

They minimise J(d) = ½ dᵀA d − rᵀd + R(d). A matrix is `BlockRows(start, column, value)` with m × m
blocks, a vector has shape (nodes, m). The dissipation R of node i is max(lowerᵢ d, upperᵢ d) for
m = 1 and upperᵢ |d|₂ for m > 1. The scalar case has separate code where this is faster.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array3, Int32Vector, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.numerics.levels import LAST_DIGITS, SUM_ROUNDING
from stickslip.translator import compiled

# relative to the radius: a node with a larger force moves. Without the margin a node that barely
# moves would have a curvature radius/|d| larger than all other entries.
_HELD = 1.0 + 1e-12


class BlockRows(NamedTuple):
    """A sparse matrix in compressed block rows (BSR format), with `value` of shape (entries, m,
    m)."""

    start: Int32Vector
    column: Int32Vector
    value: Array3


class NodeRows(NamedTuple):
    """A sparse matrix that acts on every component of a node in the same way (CSR format), with
    `value` of shape (entries,)."""

    start: Int32Vector
    column: Int32Vector
    value: Vector


class BlockSpace(NamedTuple):
    """Work space for the equations of one node."""

    g: Vector
    y: Vector
    L: Matrix


def make_block_space(m: int) -> BlockSpace:
    """Work space for blocks of size m."""
    return BlockSpace(np.empty(m), np.empty(m), np.empty((m, m)))


@compiled()
def may_move(d: Matrix, i: int) -> bool:
    """Return whether the increment of node i is not zero."""
    moving = False
    for c in range(d.shape[1]):
        moving = moving or d[i, c] != 0.0
    return moving


@compiled()
def block_norm(v: Matrix, i: int) -> float:
    """The norm |vᵢ|₂."""
    total = 0.0
    for c in range(v.shape[1]):
        total += v[i, c] * v[i, c]
    return math.sqrt(total)


@compiled()
def solve_shifted(B: Matrix, shift: float, g: Vector, L: Matrix, x: Vector) -> None:
    """Solve (B + shift I) x = g for a small positive definite B by Cholesky; L is work space.

    Parameters
    ----------
    B : array, shape (m, m)
    g : array, shape (m,)
    L : array, shape (m, m)
    x : array, shape (m,)
        Written.
    """
    m = len(g)
    for c in range(m):
        x[c] = g[c]
        for e in range(c + 1):
            entry = B[c, e] + (shift if e == c else 0.0)
            for k in range(e):
                entry -= L[c, k] * L[e, k]
            L[c, e] = math.sqrt(entry) if e == c else entry / L[e, e]
            if e < c:
                x[c] -= L[c, e] * x[e]
        x[c] /= L[c, c]
    for c in range(m - 1, -1, -1):
        for e in range(c + 1, m):
            x[c] -= L[e, c] * x[e]
        x[c] /= L[c, c]


@compiled()
def minimise_block(B: Matrix, g: Vector, radius: float, L: Matrix, x: Vector, y: Vector) -> None:
    """Minimise ½ xᵀBx − gᵀx + radius |x|₂ into x; L (m, m) and y (m,) are work space.

    The minimum is 0 if |g| ≤ radius, otherwise x(λ) = (B + λI)⁻¹g with λ|x(λ)| = radius. Since
    1/|x(λ)| is concave and at most (tr B + λ)/|g|, Newton's method for 1/|x(λ)| = λ/radius
    decreases monotonically from λ = radius tr B/(|g| − radius), at which this bound equals
    λ/radius. One step suffices if B is a multiple of I.

    Parameters
    ----------
    B : array, shape (m, m)
        Symmetric positive definite.
    g : array, shape (m,)
    L : array, shape (m, m)
    x : array, shape (m,)
        Written.
    y : array, shape (m,)
    """
    m = len(g)
    size = 0.0
    trace = 0.0
    for c in range(m):
        size += g[c] * g[c]
        trace += B[c, c]
    size = math.sqrt(size)
    if size <= radius * _HELD:
        for c in range(m):
            x[c] = 0.0
        return
    shift = radius * trace / (size - radius)
    for _ in range(50):
        solve_shifted(B, shift, g, L, x)
        solve_shifted(B, shift, x, L, y)
        square = 0.0
        product = 0.0
        for c in range(m):
            square += x[c] * x[c]
            product += x[c] * y[c]
        # With 1/|x| = 1/√square, its derivative product/√square³ and everything multiplied by
        # radius √square:
        following = shift + (radius - shift * math.sqrt(square)) / (
            math.sqrt(square) - radius * product / square
        )
        if not following < shift * (1.0 - LAST_DIGITS):
            return
        shift = max(following, 0.0)


@entry_point()
def relax(
    A: BlockRows, r: Matrix, lower: Vector, upper: Vector, d: Matrix, space: BlockSpace
) -> None:
    """One sweep of nonlinear Gauss–Seidel: one node after the other is set to its exact minimiser.

    Parameters
    ----------
    r : array, shape (nodes, m)
        Force at d = 0.
    lower, upper : array, shape (nodes,)
        Bounds of the force; if m > 1, `upper` is the radius.
    d : array, shape (nodes, m)
        Written.
    """
    start = A.start
    column = A.column
    value = A.value
    m = d.shape[1]
    g = space.g
    for i in range(len(d)):
        here = start[i]
        if m == 1:
            force = r[i, 0]
            for k in range(start[i], start[i + 1]):
                if column[k] == i:
                    here = k
                else:
                    force -= value[k, 0, 0] * d[column[k], 0]
            beyond = max(force - upper[i], 0.0) + min(force - lower[i], 0.0)
            d[i, 0] = beyond / value[here, 0, 0] if beyond != 0.0 else 0.0
        else:
            for c in range(m):
                g[c] = r[i, c]
            for k in range(start[i], start[i + 1]):
                j = column[k]
                if j == i:
                    here = k
                else:
                    for c in range(m):
                        for e in range(m):
                            g[c] -= value[k, c, e] * d[j, e]
            minimise_block(value[here], g, upper[i], space.L, d[i], space.y)


@entry_point()
def forces(
    A: BlockRows,
    r: Matrix,
    lower: Vector,
    upper: Vector,
    d: Matrix,
    b: Matrix,
    distances: Vector,
) -> None:
    """Compute the distance of ξ = r − A d from the subdifferential of the dissipation at d, and the
    force b: −∇J at nodes with d ≠ 0, and 0 at the others.

    Parameters
    ----------
    r : array, shape (nodes, m)
        Force at d = 0.
    lower, upper : array, shape (nodes,)
        Bounds of the force; if m > 1, `upper` is the radius.
    d : array, shape (nodes, m)
    b : array, shape (nodes, m)
        Written.
    distances : array, shape (2,)
        Written: the largest distance, including nodes at rest, and the largest distance in excess
        of the rounding errors of ξ.
    """
    start = A.start
    column = A.column
    value = A.value
    m = d.shape[1]
    worst = 0.0
    beyond = 0.0
    for i in range(len(d)):
        if m == 1:
            force = r[i, 0]
            terms = abs(r[i, 0])
            for k in range(start[i], start[i + 1]):
                term = value[k, 0, 0] * d[column[k], 0]
                force -= term
                terms += abs(term)
            excess = max(force - upper[i], lower[i] - force)
            b[i, 0] = 0.0
            if d[i, 0] != 0.0:
                b[i, 0] = force - (upper[i] if d[i, 0] > 0.0 else lower[i])
                excess = abs(b[i, 0])
        else:
            terms = 0.0
            for c in range(m):
                force = r[i, c]
                terms += abs(force)
                for k in range(start[i], start[i + 1]):
                    for e in range(m):
                        term = value[k, c, e] * d[column[k], e]
                        force -= term
                        terms += abs(term)
                b[i, c] = force
            length = block_norm(d, i)
            excess = block_norm(b, i) - upper[i]
            for c in range(m):
                b[i, c] = b[i, c] - upper[i] * d[i, c] / length if length > 0.0 else 0.0
            if length > 0.0:
                excess = block_norm(b, i)
        if not excess <= worst:
            worst = excess
            if math.isnan(excess):
                break
        beyond = max(beyond, excess - SUM_ROUNDING * terms)
    distances[0] = worst
    distances[1] = beyond


@entry_point()
def gauss_seidel_sweep(
    H: BlockRows, inverse: Array3, b: Matrix, x: Matrix, backward: bool, space: BlockSpace
) -> None:
    """One sweep of block Gauss–Seidel for H x = b over the rows that are not empty.

    Parameters
    ----------
    inverse : array, shape (nodes, m, m)
        Inverses of the diagonal blocks of H; 0 in empty rows.
    b : array, shape (nodes, m)
    x : array, shape (nodes, m)
        Written.
    backward : bool
        Whether rows are processed from the last to the first.
    """
    start = H.start
    column = H.column
    value = H.value
    n = len(x)
    m = x.shape[1]
    g = space.g
    for number in range(n):
        i = n - 1 - number if backward else number
        if inverse[i, 0, 0] == 0.0:
            continue
        if m == 1:
            defect = b[i, 0]
            for k in range(start[i], start[i + 1]):
                defect -= value[k, 0, 0] * x[column[k], 0]
            x[i, 0] += inverse[i, 0, 0] * defect
        else:
            for c in range(m):
                g[c] = b[i, c]
                for k in range(start[i], start[i + 1]):
                    for e in range(m):
                        g[c] -= value[k, c, e] * x[column[k], e]
            for c in range(m):
                for e in range(m):
                    x[i, c] += inverse[i, c, e] * g[e]


@entry_point()
def defect(H: BlockRows, inverse: Array3, b: Matrix, x: Matrix, out: Matrix) -> float:
    """Write out = b − H x, zero in empty rows; return xᵀH x.

    Parameters
    ----------
    inverse : array, shape (nodes, m, m)
        0 in empty rows.
    b, x : array, shape (nodes, m)
    out : array, shape (nodes, m)
        Written.
    """
    start = H.start
    column = H.column
    value = H.value
    m = x.shape[1]
    total = 0.0
    for i in range(len(x)):
        if inverse[i, 0, 0] == 0.0:
            for c in range(m):
                out[i, c] = 0.0
        elif m == 1:
            entry = 0.0
            for k in range(start[i], start[i + 1]):
                entry += value[k, 0, 0] * x[column[k], 0]
            out[i, 0] = b[i, 0] - entry
            total += x[i, 0] * entry
        else:
            for c in range(m):
                entry = 0.0
                for k in range(start[i], start[i + 1]):
                    for e in range(m):
                        entry += value[k, c, e] * x[column[k], e]
                out[i, c] = b[i, c] - entry
                total += x[i, c] * entry
    return total


@entry_point()
def project(d: Matrix, p: Matrix) -> int:
    """Change the correction p such that nodes which it would move through the kink at d = 0 stop
    there; return their number."""
    stopped = 0
    for i in range(len(d)):
        ahead = 0.0
        for c in range(d.shape[1]):
            ahead += d[i, c] * (d[i, c] + p[i, c])
        if ahead <= 0.0 and may_move(d, i):
            stopped += 1
            for c in range(d.shape[1]):
                p[i, c] = -d[i, c]
    return stopped


@entry_point()
def slope_along(lower: Vector, upper: Vector, d: Matrix, p: Matrix, t: float) -> float:
    """Left derivative with respect to t of the dissipation of d + t p.

    Parameters
    ----------
    lower, upper : array, shape (nodes,)
        Bounds of the force; if m > 1, `upper` is the radius.
    d, p : array, shape (nodes, m)
    """
    m = d.shape[1]
    total = 0.0
    for i in range(len(d)):
        if m == 1:
            there = d[i, 0] + t * p[i, 0]
            below = there < 0.0 or (there == 0.0 and p[i, 0] > 0.0)
            total += (lower[i] if below else upper[i]) * p[i, 0]
        else:
            square = 0.0
            product = 0.0
            speed = 0.0
            for c in range(m):
                there = d[i, c] + t * p[i, c]
                square += there * there
                product += there * p[i, c]
                speed += p[i, c] * p[i, c]
            total += upper[i] * (product / math.sqrt(square) if square > 0.0 else -math.sqrt(speed))
    return total
