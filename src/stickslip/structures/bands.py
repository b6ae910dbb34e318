"""Factors of sparse symmetric matrices whose entries lie in a narrow band.

A structure that is long and thin has its unknowns in line, by the order of Cuthill and McKee [1]:
LAPACK eliminates the band at once, where nested dissection would make many small fronts.

References
----------
.. [1] E. Cuthill and J. McKee, Reducing the bandwidth of sparse symmetric matrices, Proc. 24th Nat.
   Conf. ACM (1969).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from stickslip.arrays import Array
from stickslip.structures.fronts import Eliminated, factored_in_fronts

_WIDEST = 96  # largest half bandwidth of a matrix that is eliminated as a band
_TOGETHER = 32  # smallest number of unknowns in a block of a matrix with pivots of both signs


def order_in_band(matrix: Any) -> tuple[Array, int] | None:
    """An order of unknowns, and the bandwidth in it; None if it is large.

    Parameters
    ----------
    matrix : sparse array, shape (n, n)
        In compressed columns, symmetric.
    """
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    if np.max(np.diff(matrix.indptr), initial=0) > 2 * _WIDEST + 1:
        return None
    order = np.asarray(reverse_cuthill_mckee(matrix.T, symmetric_mode=True), dtype=np.int64)
    rank = _ranks(order)
    columns = np.repeat(rank, np.diff(matrix.indptr))
    width = int(np.max(np.abs(rank[matrix.indices] - columns), initial=0))
    return (order, width) if width <= _WIDEST else None


@dataclass(frozen=True)
class Banded:
    """Factors of a positive definite matrix.

    Attributes
    ----------
    negative : int
        Negative eigenvalues: none.
    least : float
        The smallest pivot.
    order : array of int
        Unknowns in the order of elimination.
    lower : array, shape (width + 1, n)
        Its factor, by diagonals.
    """

    negative: int
    least: float
    order: Array
    lower: Array

    def solve(self, b: Array) -> Array:
        """Solutions for right-hand sides, shape (n,) or (n, k)."""
        from scipy.linalg.lapack import get_lapack_funcs

        (dpbtrs,) = cast("tuple[Any, ...]", get_lapack_funcs(("pbtrs",), dtype=np.float64))
        found = np.empty_like(b)
        found[self.order] = dpbtrs(self.lower, b[self.order], lower=1)[0]
        return found


def factored_in_band(matrix: Any, order: Array, width: int) -> Banded | Eliminated:
    """The elimination of a matrix; without factors, if it is not positive definite.

    Parameters
    ----------
    matrix : sparse array, shape (n, n)
        In compressed columns, symmetric.
    order : array of int, shape (n,)
    width : int
        As in :func:`order_in_band`.
    """
    from scipy.linalg.lapack import get_lapack_funcs

    (dpbtrf,) = cast("tuple[Any, ...]", get_lapack_funcs(("pbtrf",), dtype=np.float64))
    n = len(order)
    rank = _ranks(order)
    rows, columns = rank[matrix.indices], np.repeat(rank, np.diff(matrix.indptr))
    below = rows >= columns
    band = np.zeros((width + 1, n), order="F")
    band[(rows - columns)[below], columns[below]] = matrix.data[below]
    lower, failed = dpbtrf(band, lower=1, overwrite_ab=1)
    if not failed:
        return Banded(0, float(np.min(lower[0])) ** 2, order, lower)
    # Pivots of both signs are found in full blocks, each of which touches the next one alone.
    return factored_in_fronts(matrix, rank // max(width, _TOGETHER), solving=False)


def _ranks(order: Array) -> Array:
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank
