"""Factors of sparse symmetric matrices, block by block in full matrices.

A front is a block of unknowns with those after it that it touches; what its elimination leaves of
these is added to the front of the first of them [1]. Fronts are full, so that LAPACK does the work.

References
----------
.. [1] I. S. Duff and J. K. Reid, The multifrontal solution of indefinite sparse symmetric linear
   equations, ACM Trans. Math. Software 9 (1983).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from stickslip.arrays import Array


@dataclass(frozen=True)
class Front:
    """A block that is eliminated.

    Attributes
    ----------
    first, last : int
        Its unknowns, in the order of elimination, without the last.
    border : array of int
        Unknowns after it that it touches.
    parts : list of int
        Fronts whose borders begin in it.
    """

    first: int
    last: int
    border: Array
    parts: list[int]

    def places(self, unknowns: Array) -> Array:
        """Rows of unknowns in the full matrix."""
        behind = self.last - self.first + np.searchsorted(self.border, unknowns)
        return np.where(unknowns < self.last, unknowns - self.first, behind)


@dataclass(frozen=True)
class Eliminated:
    """Result of an elimination.

    Attributes
    ----------
    negative : int
        Negative eigenvalues.
    least : float
        The smallest pivot.
    order : array of int
        Unknowns in the order of elimination.
    factors : list of (Front, array, array)
        Of a positive definite matrix, those of blocks and borders; empty where nobody solves.
    """

    negative: int
    least: float
    order: Array
    factors: list[tuple[Front, Array, Array]]

    def solve(self, b: Array) -> Array:
        """Solutions for right-hand sides, shape (n,) or (n, k)."""
        from scipy.linalg import get_blas_funcs

        # All from one library: the idle threads of another one would take the time of its own.
        names = "trsm", "gemm"
        dtrsm, dgemm = cast("tuple[Any, ...]", get_blas_funcs(names, dtype=np.float64))
        if not self.factors:
            return np.full_like(b, np.nan)
        x = b[self.order].reshape(len(b), -1)
        for front, own, border in self.factors:
            part = slice(front.first, front.last)
            x[part] = dtrsm(1.0, own, x[part].T, side=1, lower=1, trans_a=1).T
            if len(front.border):
                x[front.border] -= dgemm(1.0, x[part].T, border, trans_b=1).T
        for front, own, border in reversed(self.factors):
            part = slice(front.first, front.last)
            y = x[part].T
            if len(front.border):
                y = dgemm(-1.0, x[front.border].T, border, beta=1.0, c=y)
            x[part] = dtrsm(1.0, own, y, side=1, lower=1).T
        found = np.empty_like(x)
        found[self.order] = x
        return found.reshape(b.shape)


def factored_in_fronts(matrix: Any, blocks: Array, solving: bool) -> Eliminated:
    """The elimination of a matrix.

    Parameters
    ----------
    matrix : sparse array, shape (n, n)
        In compressed columns, symmetric.
    blocks : array of int, shape (n,)
        The block of each unknown.
    solving : bool
        Whether factors are kept.
    """
    from scipy.linalg import get_blas_funcs, get_lapack_funcs
    from scipy.sparse import csc_array, tril

    dsyrk, dtrsm = cast("tuple[Any, ...]", get_blas_funcs(("syrk", "trsm"), dtype=np.float64))
    (dpotrf,) = cast("tuple[Any, ...]", get_lapack_funcs(("potrf",), dtype=np.float64))
    order = np.argsort(blocks, kind="stable")
    lower = csc_array(tril(matrix[order][:, order]))
    lower.sort_indices()
    fronts = _fronts(lower, np.bincount(blocks))
    factors: list[tuple[Front, Array, Array]] = []
    waiting: dict[int, Array] = {}
    negative, least = 0, np.inf
    for number in _children_first(fronts):
        front = fronts[number]
        k = front.last - front.first
        full = _assembled(lower, front, fronts, waiting)
        # Cholesky is tried first: it fails only if the block is not positive definite, and is much
        # faster than LDLᵀ.
        own, failed = dpotrf(full[:k, :k], lower=1, clean=1)
        if not failed:
            least = min(least, float(np.min(np.diag(own))) ** 2)
            border = dtrsm(1.0, own, full[k:, :k], side=1, lower=1, trans_a=1)
            if len(front.border):
                waiting[number] = dsyrk(-1.0, border, beta=1.0, c=full[k:, k:], lower=1)
            if solving:
                factors.append((front, own, border))
            continue
        solving, factors = False, []
        pivots, rest = _indefinite(full, k)
        # By Sylvester's law of inertia this counts the negative eigenvalues of the matrix.
        negative += int(np.count_nonzero(pivots < 0.0))
        least = min(least, float(np.min(np.abs(pivots))))
        if least == 0.0:
            break
        if len(front.border):
            waiting[number] = rest
    return Eliminated(negative, least, order, factors)


def _indefinite(full: Array, k: int) -> tuple[Array, Array]:
    """Pivots of the first k unknowns of a front, and the Schur complement for the others."""
    from scipy.linalg import ldl, solve_banded, solve_triangular

    lower, blocks, order = ldl(full[:k, :k], lower=True)
    pivots = np.linalg.eigvalsh(blocks) if np.any(np.diag(blocks, 1)) else np.diag(blocks)
    if np.any(pivots == 0.0):
        return pivots, full[k:, k:]
    border = solve_triangular(lower[order], full[k:, order].T, lower=True, unit_diagonal=True)
    if border.shape[1] == 0:
        return pivots, full[k:, k:]
    beside = np.append(np.diag(blocks, 1), 0.0)  # the blocks are of one or two unknowns
    middle = np.array([np.roll(beside, 1), np.diag(blocks), beside])
    by = solve_banded((1, 1), middle, border)
    return pivots, np.asfortranarray(full[k:, k:] - border.T @ by)


def _fronts(lower: Any, sizes: Array) -> list[Front]:
    """The fronts of blocks of these sizes."""
    ends = np.cumsum(sizes)
    owner = np.repeat(np.arange(len(sizes)), sizes)
    fronts: list[Front] = []
    parts: list[list[int]] = [[] for _ in sizes]
    for number, last in enumerate(ends.tolist()):
        first = last - int(sizes[number])
        below = lower.indices[lower.indptr[first] : lower.indptr[last]]
        touched = [below, *(fronts[part].border for part in parts[number])]
        border = np.unique(np.concatenate([some[some >= last] for some in touched]))
        # The front is needed first where the earliest unknown of its border is eliminated.
        if len(border):
            parts[owner[border[0]]].append(number)
        fronts.append(Front(first, last, border, parts[number]))
    return fronts


def _children_first(fronts: list[Front]) -> list[int]:
    """An order in which few fronts wait for others."""
    order: list[int] = []
    stack = [number for number, front in enumerate(fronts) if not len(front.border)]
    while stack:
        number = stack.pop()
        order.append(number)
        stack.extend(fronts[number].parts)
    return order[::-1]


def _assembled(lower: Any, front: Front, fronts: list[Front], waiting: dict[int, Array]) -> Array:
    """The lower half of the full matrix of a front."""
    k = front.last - front.first
    size = k + len(front.border)
    full = np.zeros((size, size))  # its rows are columns of the result
    begin, end = lower.indptr[front.first], lower.indptr[front.last]
    columns = np.repeat(np.arange(k), np.diff(lower.indptr[front.first : front.last + 1]))
    full[columns, front.places(lower.indices[begin:end])] = lower.data[begin:end]
    for part in front.parts:
        places = front.places(fronts[part].border)
        rest = waiting.pop(part).T
        # Adding slices is many times faster than indexing, if the unknowns form few runs.
        runs = np.flatnonzero(np.diff(places, prepend=-2) != 1)
        if 8 * len(runs) > len(places):
            full[places[:, None], places] += rest
            continue
        ends = np.append(runs[1:], len(places))
        pieces = [slice(a, b) for a, b in zip(runs, ends, strict=True)]
        into = [slice(places[piece.start], places[piece.stop - 1] + 1) for piece in pieces]
        for i, piece in enumerate(pieces):
            for j in range(i, len(pieces)):
                full[into[i], into[j]] += rest[piece, pieces[j]]
    return full.T
