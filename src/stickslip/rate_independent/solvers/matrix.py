"""Checks that a matrix, dense or sparse, is symmetric and positive definite."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.numerics.levels import COMPUTED_ZERO, SYMMETRIC

# number of rows up to which a sparse matrix is factorised to test whether it is positive definite
_DECIDED = 20_000


def checked_matrix(given: Any) -> Any:
    """A as a float array or in compressed rows.

    Raises
    ------
    DeclarationError
        If it is not square, finite, symmetric and positive definite.
    """
    from scipy import sparse

    try:
        A: Any = (
            sparse.csr_array(given, dtype=float)
            if sparse.issparse(given)
            else np.array(given, dtype=float)
        )
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(
            "A", "not a matrix of numbers", "Give an (n, n) array or sparse array"
        ) from None
    if A.ndim == 0:
        A = A.reshape(1, 1)
    if A.ndim != 2 or A.shape[0] != A.shape[1] or A.shape[0] == 0:
        raise DeclarationError("A", f"its shape is {A.shape}", "Give a square matrix")
    _check_symmetric(A)
    _check_definite(A)
    return A


def _check_symmetric(A: Any) -> None:
    from scipy import sparse

    entries = A.data if sparse.issparse(A) else A
    if not np.all(np.isfinite(entries)):
        raise DeclarationError("A", "an entry is not finite", "Give finite numbers")
    gap = abs(A - A.T)
    if gap.max() > SYMMETRIC * abs(entries).max(initial=0.0):
        if sparse.issparse(gap):
            gap = sparse.coo_array(gap)
            k = int(np.argmax(gap.data))
            i, j = int(gap.coords[0][k]), int(gap.coords[1][k])
        else:
            i, j = map(int, np.unravel_index(np.argmax(gap), gap.shape))
        i, j = min(i, j), max(i, j)
        raise DeclarationError(
            f"A[{i}, {j}]",
            f"{A[i, j]:.9g}, but A[{j}, {i}] = {A[j, i]:.9g}",
            "Give a symmetric matrix",
        )


def _check_definite(A: Any) -> None:
    """Reject a matrix that is not positive definite.

    Small matrices, sparse ones up to 2e4 rows, and diagonally dominant ones are decided. A larger
    sparse one is refused only if some direction of a Krylov space (or the constant vector) has no
    positive energy.
    """
    from scipy import sparse

    diagonal = A.diagonal()
    i = int(np.argmin(diagonal))
    if diagonal[i] <= 0.0:
        raise _indefinite(f"A[{i}, {i}] = {diagonal[i]:.6g}")
    if sparse.issparse(A):
        _check_definite_sparse(A, diagonal)
        return
    try:
        pivots = np.square(np.diag(np.linalg.cholesky(A)))
    except np.linalg.LinAlgError:
        pivots = np.zeros(1)
    # A pivot within the rounding errors of the factorisation is not known to be positive.
    if pivots.min() <= 4.0 * np.finfo(float).eps * len(A) * diagonal.max():
        raise _indefinite(f"its smallest eigenvalue is {np.linalg.eigvalsh(A)[0]:.6g}")


def _check_definite_sparse(A: Any, diagonal: Array) -> None:
    from scipy.sparse.linalg import splu

    n = len(diagonal)
    noise = 4.0 * np.finfo(float).eps * diagonal.max()
    if np.min(2.0 * diagonal - abs(A).sum(axis=1)) > noise:
        return  # diagonally dominant
    ones = np.ones(n)
    if ones @ (A @ ones) <= noise * n:
        raise _indefinite("a translation of all components has zero energy")
    if n <= _DECIDED:
        options = {"SymmetricMode": True}
        try:
            factors = splu(
                A.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
            )
            # L D Lᵀ: D has as many negative entries as there are negative eigenvalues
            pivot = float(factors.U.diagonal().min())
        except RuntimeError:
            pivot = 0.0
        if pivot <= noise:
            raise _indefinite(f"a pivot of its factorisation is {pivot:.6g}")
        return
    if (lowest := _lowest_ritz_value(A)) <= 0.0:
        raise _indefinite(f"a direction has energy {lowest:.6g}")


def _lowest_ritz_value(A: Any, steps: int = 30) -> float:
    """Smallest Ritz value of a short Lanczos process: an upper bound of the smallest eigenvalue."""
    from scipy.linalg import eigh_tridiagonal

    v = np.random.default_rng(0).standard_normal(A.shape[0])
    v /= np.linalg.norm(v)
    previous = np.zeros_like(v)
    beta = 0.0
    diagonal, below = [], []
    # Three terms suffice: A is tridiagonal in the basis of the Krylov space.
    for _ in range(steps):
        w = A @ v - beta * previous
        diagonal.append(float(w @ v))
        w -= diagonal[-1] * v
        beta = float(np.linalg.norm(w))
        below.append(beta)
        if beta <= COMPUTED_ZERO * abs(diagonal[0]):
            break
        previous = v
        v = w / beta
    return float(eigh_tridiagonal(diagonal, below[:-1], eigvals_only=True)[0])


def _indefinite(evidence: str) -> DeclarationError:
    return DeclarationError(
        "A",
        f"not positive definite: {evidence}",
        "Fix a component, or add springs that restrain every direction",
    )
