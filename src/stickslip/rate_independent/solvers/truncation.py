"""Compiled truncation: the Hessian without the nodes at rest, and its Galerkin products on coarser
levels.

A row is *empty* where the node rests (the inverse of its diagonal block is 0 by convention),
*whole* where it equals the row of the full operator. Only rows at the boundary between motion and
rest need the triple product.
"""

from __future__ import annotations

from typing import NamedTuple

from stickslip.arrays import Array3, BoolVector, IntVector, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.rate_independent.solvers.smoothing import (
    BlockRows,
    BlockSpace,
    NodeRows,
    block_norm,
    may_move,
    solve_shifted,
)
from stickslip.translator import compiled


class Truncation(NamedTuple):
    """The operator of a level without the nodes at rest.

    Attributes
    ----------
    H : BlockRows
        With empty rows and columns where a node rests.
    inverse : array (nodes, m, m)
        Inverses of the diagonal blocks of H, 0 in empty rows.
    whole : array (nodes,) of bool
        Which rows of H are those of the full operator.
    dirty : array (nodes,) of bool
        Which rows have changed.
    """

    H: BlockRows
    inverse: Array3
    whole: BoolVector
    dirty: BoolVector


@compiled()
def invert_block(block: Matrix, inverse: Matrix, space: BlockSpace) -> None:
    """Invert the diagonal block of a row; that of an empty row has the inverse 0."""
    m = len(block)
    if block[0, 0] == 0.0:
        clear_block(inverse)
    elif m == 1:
        inverse[0, 0] = 1.0 / block[0, 0]
    else:
        unit = space.g
        for c in range(m):
            for e in range(m):
                unit[e] = 1.0 if e == c else 0.0
            solve_shifted(block, 0.0, unit, space.L, inverse[c])


@compiled()
def clear_block(block: Matrix) -> None:
    """Make a block 0."""
    for c in range(len(block)):
        for e in range(len(block)):
            block[c, e] = 0.0


@compiled()
def add_curvature(block: Matrix, weight: float, d: Matrix, i: int) -> None:
    """Add the Hessian (I − e eᵀ) weight/|d|, e = d/|d|, of weight |d|₂ at dᵢ."""
    length = block_norm(d, i)
    for c in range(d.shape[1]):
        block[c, c] += weight / length
        for e in range(d.shape[1]):
            block[c, e] -= weight / length * (d[i, c] / length) * (d[i, e] / length)


@entry_point()
def truncate(
    A: BlockRows, upper: Vector, d: Matrix, truncated: Truncation, space: BlockSpace
) -> None:
    """Write the Hessian of J at d, with empty rows and columns where d = 0.

    Parameters
    ----------
    upper : array, shape (nodes,)
        Upper bounds of the force, or radii.
    d : array, shape (nodes, m)
    truncated : Truncation
        H has the pattern of A. On entry, `inverse` marks the rows that were empty before, and
        `dirty` the rows to write in any case; on return, `dirty` marks the written rows.
    """
    start = A.start
    column = A.column
    inverse = truncated.inverse
    dirty = truncated.dirty
    m = d.shape[1]
    for i in range(len(d)):
        moving = may_move(d, i)
        if moving != (inverse[i, 0, 0] != 0.0) or (m > 1 and moving):
            for k in range(start[i], start[i + 1]):
                dirty[column[k]] = True
    for i in range(len(d)):
        if dirty[i]:
            clear_block(inverse[i])
            truncate_row(A, upper, d, i, truncated, space)


@compiled()
def truncate_row(
    A: BlockRows, upper: Vector, d: Matrix, i: int, truncated: Truncation, space: BlockSpace
) -> None:
    """Write row i of the Hessian; see :func:`truncate`.

    Parameters
    ----------
    upper : array, shape (nodes,)
    d : array, shape (nodes, m)
    truncated : Truncation
        Its inverse in this row is 0.
    """
    value = truncated.H.value
    m = d.shape[1]
    moving = may_move(d, i)
    whole = moving and m == 1
    for k in range(A.start[i], A.start[i + 1]):
        j = A.column[k]
        kept = moving and may_move(d, j)
        for c in range(m):
            for e in range(m):
                value[k, c, e] = A.value[k, c, e] if kept else 0.0
        whole = whole and kept
        if kept and j == i:
            if m > 1:
                add_curvature(value[k], upper[i], d, i)
            invert_block(value[k], truncated.inverse[i], space)
    truncated.whole[i] = whole


@entry_point()
def galerkin(
    fine: Truncation,
    P: NodeRows,
    R: NodeRows,
    A: BlockRows,
    coarse: Truncation,
    place: IntVector,
    space: BlockSpace,
) -> None:
    """Rows of the coarse operator PᵀHP (R = Pᵀ) to which dirty rows of H contribute.

    Parameters
    ----------
    P, R : NodeRows
        Prolongation and its transpose.
    A : BlockRows
        The coarse operator without truncation: rows computed from complete rows only are copied
        from it.
    coarse : Truncation
        Written, with the pattern of A. Rows computed from complete rows only are marked complete;
        on return, `dirty` marks the rows that were computed.
    place : array of int, shape (coarse nodes,)
        Work space.
    """
    H = coarse.H
    m = H.value.shape[1]
    mark(fine.dirty, P, coarse.dirty)
    for row in range(len(coarse.inverse)):
        if not coarse.dirty[row]:
            continue
        whole = True
        for s in range(R.start[row], R.start[row + 1]):
            whole = whole and fine.whole[R.column[s]]
        coarse.whole[row] = whole
        here = 0
        for k in range(H.start[row], H.start[row + 1]):
            place[H.column[k]] = k
            if H.column[k] == row:
                here = k
            for c in range(m):
                for e in range(m):
                    H.value[k, c, e] = A.value[k, c, e] if whole else 0.0
        if not whole:
            for s in range(R.start[row], R.start[row + 1]):
                add_products(fine.H, R.column[s], R.value[s], P, place, H)
        invert_block(H.value[here], coarse.inverse[row], space)


@compiled()
def mark(dirty: BoolVector, P: NodeRows, coarse: BoolVector) -> None:
    """Mark the coarse nodes from which dirty ones are interpolated."""
    for row in range(len(coarse)):
        coarse[row] = False
    for i in range(len(dirty)):
        if dirty[i]:
            for k in range(P.start[i], P.start[i + 1]):
                coarse[P.column[k]] = True


@compiled()
def add_products(
    H: BlockRows, i: int, weight: float, P: NodeRows, place: IntVector, coarse: BlockRows
) -> None:
    """Add weight times row i of H P to a coarse row whose columns are at `place`.

    Parameters
    ----------
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


@entry_point()
def gather(M: NodeRows, inverse: Array3, x: Matrix, y: Matrix) -> None:
    """Add M x to y in the rows that are not empty."""
    for i in range(len(y)):
        if inverse[i, 0, 0] != 0.0:
            for c in range(y.shape[1]):
                entry = 0.0
                for k in range(M.start[i], M.start[i + 1]):
                    entry += M.value[k] * x[M.column[k], c]
                y[i, c] += entry
