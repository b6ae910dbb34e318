"""Levels of an algebraic multigrid hierarchy whose operators are restricted to the moving nodes.

Interpolations are computed once, from the complete operator. When the set of moving nodes changes,
the operators of all levels are updated by Galerkin products (truncation).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array, plain_array
from stickslip.errors import need
from stickslip.rate_independent.solvers.smoothing import (
    BlockRows,
    BlockSpace,
    NodeRows,
    defect,
    gauss_seidel_sweep,
    make_block_space,
)
from stickslip.rate_independent.solvers.truncation import Truncation, galerkin, gather, truncate

_DENSE = 300  # number of unknowns up to which the last level is solved by a dense factorisation
# added to the unit diagonal of the last level: truncation can make coarse operators singular
_RIDGE = 1e-12


@dataclass(eq=False)
class Level:
    """One level: the operator A and its truncation H.

    Attributes
    ----------
    truncated : Truncation
        H has the pattern of A.
    x, b, rest : array (nodes, m)
        Solution, right-hand side and residual b − H x of a V-cycle.
    place : array (nodes,) of int
        Work space.
    """

    A: BlockRows
    truncated: Truncation = field(init=False)
    x: Array = field(init=False)
    b: Array = field(init=False)
    rest: Array = field(init=False)
    place: Array = field(init=False)
    space: BlockSpace = field(init=False)

    def __post_init__(self) -> None:
        n = len(self.A.start) - 1
        m = self.A.value.shape[1]
        H = self.A._replace(value=np.zeros_like(self.A.value))
        inverse = np.zeros((n, m, m))
        self.truncated = Truncation(H, inverse, np.zeros(n, bool), np.zeros(n, bool))
        self.x = np.zeros((n, m))
        self.b = np.zeros((n, m))
        self.rest = np.zeros((n, m))
        self.place = np.zeros(n, np.int64)
        self.space = make_block_space(m)

    @property
    def H(self) -> BlockRows:
        """A with the rows and columns of the nodes at rest set to zero."""
        return self.truncated.H

    @property
    def inverse(self) -> Array:
        """Inverses of the diagonal blocks of H, zero in empty rows."""
        return self.truncated.inverse

    def sweep(self, backward: bool) -> None:
        """One sweep of block Gauss–Seidel for H x = b."""
        gauss_seidel_sweep(self.H, self.inverse, self.b, self.x, backward, self.space)


class Transfer(NamedTuple):
    """Interpolation P from a level to the next finer one, the same for every component, and its
    transpose R."""

    P: NodeRows
    R: NodeRows


@dataclass(frozen=True, eq=False)
class Factor:
    """Cholesky factor of H on the last level, scaled to a unit diagonal: LLᵀ = S H S. Empty rows of
    H are replaced by rows of the identity.

    Attributes
    ----------
    scale : array (unknowns,)
        Diagonal of S.
    """

    L: Array
    scale: Array

    @classmethod
    def of(cls, level: Level) -> Factor:
        """Factorise H, with a ridge on the diagonal that makes it positive definite in spite of
        rounding errors."""
        from scipy.linalg import cholesky
        from scipy.sparse import bsr_array

        H = bsr_array(
            (level.H.value, level.H.column, level.H.start), shape=(level.x.size,) * 2
        ).toarray()
        diagonal = np.diagonal(H)
        scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        # With a unit diagonal the ridge is the same relative perturbation for every unknown.
        H *= np.outer(scale, scale)
        ridge = _RIDGE
        while True:
            np.fill_diagonal(H, 1.0 + ridge)
            try:
                return cls(cholesky(H, lower=True, check_finite=False), scale)
            except np.linalg.LinAlgError:
                ridge *= 1e3

    def solve(self, b: Array) -> Array:
        """H⁻¹ b, in the shape of b."""
        from scipy.linalg import cho_solve

        scaled = cho_solve((self.L, True), self.scale * b.ravel(), check_finite=False)
        return (self.scale * scaled).reshape(b.shape)


class Hierarchy:
    """Levels from the finest to the coarsest, and V-cycles over them.

    Parameters
    ----------
    A : BlockRows
        The operator on the finest level.
    nodal : scipy.sparse.csr_array (nodes, nodes)
        A scalar operator with one entry per block of A, from which the coarse levels are computed
        by classical Ruge–Stüben coarsening.

    Attributes
    ----------
    transfers : list of Transfer
        transfers[k] between levels[k] and levels[k + 1].
    factor : Factor or None
        Of the last level; None if this level is too large for a dense factorisation.
    """

    def __init__(self, A: BlockRows, nodal: Any) -> None:
        need("pyamg", "evolutions")
        from pyamg import ruge_stuben_solver

        made: list[Any] = ruge_stuben_solver(nodal, max_coarse=_DENSE // A.value.shape[1]).levels
        self.levels: list[Level] = [Level(A)]
        self.transfers: list[Transfer] = []
        pattern = abs(nodal)
        for fine, _ in pairwise(made):
            # The pattern contains entries that cancel in R A P, because they do not cancel if A is
            # truncated.
            pattern = (abs(fine.R) @ pattern @ abs(fine.P)).tocsr()
            pattern.sort_indices()
            self.transfers.append(Transfer(rows(fine.P), rows(fine.R)))
            fine.A = fine.P = fine.R = None  # saves memory
            self.levels.append(Level(coarse_operator(self.levels[-1], self.transfers[-1], pattern)))
        self.factor: Factor | None = None
        self.top: int = -1  # level of the last truncation

    def truncate(self, top: int, upper: Array, d: Array) -> None:
        """Set the operator of level `top` to the Hessian at d, and those of coarser levels to its
        Galerkin products."""
        fine = self.levels[top]
        # After a truncation from another level no row can be reused.
        fine.truncated.dirty[:] = top != self.top
        self.top = top
        truncate(fine.A, upper, d, fine.truncated, fine.space)
        for (P, R), coarse in zip(self.transfers[top:], self.levels[top + 1 :], strict=True):
            galerkin(fine.truncated, P, R, coarse.A, coarse.truncated, coarse.place, coarse.space)
            fine = coarse
        if fine.truncated.dirty.any() and fine.x.size <= _DENSE:
            self.factor = Factor.of(fine)

    def cycle(self, top: int, b: Array) -> Array:
        """One V-cycle for H x = b, with `top` as the finest level. The result is a linear function
        of b with a symmetric positive definite matrix."""
        levels, transfers = self.levels[top:], self.transfers[top:]
        levels[0].b = b
        for (_, R), level, coarse in zip(transfers, levels, levels[1:], strict=False):
            level.x[:] = 0.0
            level.sweep(backward=False)
            defect(level.H, level.inverse, level.b, level.x, level.rest)
            coarse.b = np.zeros_like(coarse.x)
            gather(R, coarse.inverse, level.rest, coarse.b)
        self.solve_last(levels[-1])
        for (P, _), level, coarse in zip(
            transfers[::-1], levels[-2::-1], levels[:0:-1], strict=True
        ):
            gather(P, level.inverse, coarse.x, level.x)
            level.sweep(backward=True)
        return levels[0].x

    def solve_last(self, last: Level) -> None:
        """Solve on the last level, or apply a symmetric sweep if it has no dense factorisation."""
        if self.factor is not None:
            last.x[:] = self.factor.solve(last.b)
        else:
            last.x[:] = 0.0
            last.sweep(backward=False)
            last.sweep(backward=True)


def rows(matrix: Any) -> NodeRows:
    """A scipy matrix in CSR format, with the types that compiled functions require."""
    return NodeRows(
        plain_array(matrix.indptr, np.int32),
        plain_array(matrix.indices, np.int32),
        plain_array(matrix.data),
    )


def blocks(matrix: Any, m: int) -> BlockRows:
    """The same for a matrix in BSR format with m × m blocks (if m = 1, also in CSR format)."""
    return BlockRows(
        plain_array(matrix.indptr, np.int32),
        plain_array(matrix.indices, np.int32),
        plain_array(matrix.data).reshape(-1, m, m),
    )


def coarse_operator(fine: Level, transfer: Transfer, nodal: Any) -> BlockRows:
    """PᵀAP on the pattern of the nodal operator."""
    n = nodal.shape[0]
    m = fine.A.value.shape[1]
    pattern = rows(nodal)
    coarse = BlockRows(pattern.start, pattern.column, np.zeros((nodal.nnz, m, m)))
    # All fine rows are dirty, so all coarse rows are computed. None is marked whole, so none is
    # copied from `coarse`, which is still zero.
    every = fine.truncated._replace(H=fine.A, dirty=np.ones(len(fine.x), bool))
    made = Truncation(coarse, np.empty((n, m, m)), np.zeros(n, bool), np.zeros(n, bool))
    galerkin(every, *transfer, coarse, made, np.zeros(n, np.int64), fine.space)
    return coarse
