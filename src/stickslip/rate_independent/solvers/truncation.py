"""Compiled truncation: the Hessian without the nodes at rest, and its Galerkin products on coarser
levels.

A row is *empty* where the node rests (the inverse of its diagonal block is 0 by convention),
*whole* where it equals the row of the full operator. Only rows at the boundary between motion and
rest need the triple product.
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.machine_code.functions import njit
from stickslip.rate_independent.solvers.smoothing import (
    COMPILED,
    BlockRows,
    block_norm,
    may_move,
    solve_shifted,
)


@njit(**COMPILED)
def invert_blocks(block: Array, inverse: Array) -> None:
    """Invert the diagonal block of a row; that of an empty row has the inverse 0."""
    m = len(block)
    if block[0, 0] == 0.0:
        inverse[:] = 0.0
    elif m == 1:
        inverse[0, 0] = 1.0 / block[0, 0]
    else:
        L = np.empty((m, m))
        for c in range(m):
            unit = np.zeros(m)
            unit[c] = 1.0
            solve_shifted(block, 0.0, unit, L, inverse[c])


@njit(**COMPILED)
def add_curvature(block: Array, weight: float, d: Array, i: int) -> None:
    """Add the Hessian (I − e eᵀ) weight/|d|, e = d/|d|, of weight |d|₂ at dᵢ."""
    length = block_norm(d, i)
    for c in range(d.shape[1]):
        block[c, c] += weight / length
        for e in range(d.shape[1]):
            block[c, e] -= weight / length * (d[i, c] / length) * (d[i, e] / length)


@njit(**COMPILED)
def truncate(
    A: BlockRows, upper: Array, d: Array, H: BlockRows, inverse: Array, whole: Array, dirty: Array
) -> None:
    """Write the Hessian of J at d into H, with empty rows and columns where d = 0.

    `inverse` tells on entry which rows were empty before; `dirty` tells on entry which rows to
    write in any case and on return which were written.

    Parameters
    ----------
    A : BlockRows
    upper : array, shape (nodes,)
        Upper bounds of the force, or radii.
    d : array, shape (nodes, m)
    H : BlockRows
        With the pattern of A; its values are written.
    inverse : array, shape (nodes, m, m)
        Written: inverses of the diagonal blocks, 0 in empty rows.
    whole : array of bool, shape (nodes,)
        Written: which rows are those of A.
    dirty : array of bool, shape (nodes,)
    """
    start, column, value = A
    m = d.shape[1]
    for i in range(len(d)):
        moving = may_move(d, i)
        if moving != (inverse[i, 0, 0] != 0.0) or (m > 1 and moving):
            for k in range(start[i], start[i + 1]):
                dirty[column[k]] = 1
    for i in range(len(d)):
        if dirty[i] == 0:
            continue
        moving = may_move(d, i)
        whole[i] = moving and m == 1
        inverse[i] = 0.0
        for k in range(start[i], start[i + 1]):
            j = column[k]
            kept = moving and may_move(d, j)
            for c in range(m):
                for e in range(m):
                    H.value[k, c, e] = value[k, c, e] if kept else 0.0
            if not kept:
                whole[i] = 0
            if kept and j == i:
                if m > 1:
                    add_curvature(H.value[k], upper[i], d, i)
                invert_blocks(H.value[k], inverse[i])


@njit(**COMPILED)
def galerkin(
    H: BlockRows,
    P: BlockRows,
    R: BlockRows,
    whole: Array,
    dirty: Array,
    A: BlockRows,
    coarse: BlockRows,
    inverse: Array,
    coarse_whole: Array,
) -> Array:
    """Rows of the coarse operator PᵀHP (R = Pᵀ) to which dirty rows of H contribute; returns which
    these are.

    A is the coarse operator without truncation: rows made of whole rows only are copied from it.

    Parameters
    ----------
    H : BlockRows
        The fine operator.
    P, R : BlockRows
        Prolongation and its transpose; one number for all components of a node.
    whole, dirty : array of bool, shape (fine nodes,)
        Which rows of H are not truncated, and which have changed.
    A : BlockRows
    coarse : BlockRows
        With the pattern of A; its values are written.
    inverse : array, shape (nodes, m, m)
        Written: inverses of its diagonal blocks.
    coarse_whole : array of bool, shape (nodes,)
        Written: which rows are made of whole rows only.
    """
    n = len(inverse)
    m = H.value.shape[1]
    marked = np.zeros(n, np.uint8)
    for i in range(len(dirty)):
        if dirty[i] != 0:
            for k in range(P.start[i], P.start[i + 1]):
                marked[P.column[k]] = 1
    place = np.empty(n, np.int32)
    for row in range(n):
        if marked[row] == 0:
            continue
        coarse_whole[row] = 1
        for s in range(R.start[row], R.start[row + 1]):
            coarse_whole[row] &= whole[R.column[s]]
        here = 0
        for k in range(coarse.start[row], coarse.start[row + 1]):
            place[coarse.column[k]] = k
            if coarse.column[k] == row:
                here = k
            for c in range(m):
                for e in range(m):
                    coarse.value[k, c, e] = A.value[k, c, e] if coarse_whole[row] else 0.0
        if not coarse_whole[row]:
            for s in range(R.start[row], R.start[row + 1]):
                add_products(H, R.column[s], R.value[s], P, place, coarse)
        invert_blocks(coarse.value[here], inverse[row])
    return marked


@njit(**COMPILED)
def add_products(
    H: BlockRows, i: int, weight: float, P: BlockRows, place: Array, coarse: BlockRows
) -> None:
    """Add weight times row i of H P to a coarse row whose columns stand at `place`.

    Parameters
    ----------
    H : BlockRows
    i : int
    weight : float
    P : BlockRows
    place : array of int, shape (coarse nodes,)
        Entry of the row for each column.
    coarse : BlockRows
        Its values are written.
    """
    m = H.value.shape[1]
    for k in range(H.start[i], H.start[i + 1]):
        j = H.column[k]
        if m == 1:
            entry = weight * H.value[k, 0, 0]
            if entry != 0.0:
                for q in range(P.start[j], P.start[j + 1]):
                    coarse.value[place[P.column[q]], 0, 0] += entry * P.value[q]
        else:
            for q in range(P.start[j], P.start[j + 1]):
                p = place[P.column[q]]
                for c in range(m):
                    for e in range(m):
                        coarse.value[p, c, e] += weight * P.value[q] * H.value[k, c, e]


@njit(**COMPILED)
def gather(M: BlockRows, inverse: Array, x: Array, y: Array) -> None:
    """Add M x to y in the rows that are not empty; M acts alike on every component."""
    for i in range(len(y)):
        if inverse[i, 0, 0] != 0.0:
            for c in range(y.shape[1]):
                entry = 0.0
                for k in range(M.start[i], M.start[i + 1]):
                    entry += M.value[k] * x[M.column[k], c]
                y[i, c] += entry
