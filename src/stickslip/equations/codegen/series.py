"""Codes returned by ``jets``, and the inverse of a matrix."""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.numerics.levels import LEAST_PIVOT
from stickslip.translator import compiled, fma

# Results of ``jets``: a linear problem has no solution, or a mass matrix is not definite.
SINGULAR = 1
INDEFINITE = 6
_TO_DO, _DONE, _SHARED = 0.0, -1.0, 1.0  # State of a column of :func:`shared_inverse`.


@compiled(brief=True)
def balance(A: Array, n: int, row: int, by_rows: bool) -> float:
    """A power of two near the reciprocal of the largest entry of a row (or column); 0 if there is
    none."""
    largest = 0.0
    for j in range(n):
        largest = max(largest, abs(A[row, j] if by_rows else A[j, row]))
    return math.ldexp(1.0, -math.frexp(largest)[1]) if 0.0 < largest < np.inf else 0.0


@compiled(inline=True)
def less(a: float, factor: float, b: float, fused: bool) -> float:
    """a − factor·b, rounded once or twice."""
    return fma(-factor, b, a) if fused else a - factor * b


@compiled(brief=True)
def invert(A: Array, n: int, R: Array) -> bool:
    """Inverse R of the leading n×n block of A (destroyed, with the row below); False if it is
    singular."""
    return eliminated(A, n, R, False)


@compiled(inline=True)
def eliminated(A: Array, n: int, R: Array, fused: bool) -> bool:
    """Inverse R of the leading n×n block of A (destroyed, with the row below) by Gauss-Jordan
    elimination.

    Parameters
    ----------
    fused : bool
        Whether products are not rounded before they are subtracted. The machine code of systems
        always had it so, the engine never.

    Returns
    -------
    bool
        False if it is singular.

    Notes
    -----
    Rows and columns are brought to size 1 first, by powers of two, which round nothing: a pivot is
    small beside its own row, not beside a mass in other units.
    """
    if not balanced(A, n, R):
        return False
    for c in range(n):
        if not cleared(A, n, R, c, fused):
            return False
    for i in range(n):
        for j in range(n):
            R[i, j] *= A[n, i]
    return True


@compiled(inline=True)
def balanced(A: Array, n: int, R: Array) -> bool:
    """Bring the rows and columns of A to size 1, with the factors in R and in row n; False if one
    is empty."""
    for i in range(n):
        factor = balance(A, n, i, True)
        if factor == 0.0:
            return False
        for j in range(n):
            A[i, j] *= factor
            R[i, j] = factor if i == j else 0.0
    for j in range(n):
        factor = balance(A, n, j, False)
        if factor == 0.0:
            return False
        A[n, j] = factor
        for i in range(n):
            A[i, j] *= factor
    return True


@compiled(inline=True)
def cleared(A: Array, n: int, R: Array, c: int, fused: bool) -> bool:
    """Eliminate column c by the largest entry in it from row c on; False if that is none."""
    pivot = c
    for i in range(c + 1, n):
        if abs(A[i, c]) > abs(A[pivot, c]):
            pivot = i
    if not abs(A[pivot, c]) > LEAST_PIVOT:
        return False
    clear_by(A, n, R, pivot, c, fused)
    return True


@compiled(inline=True)
def clear_by(A: Array, n: int, R: Array, pivot: int, c: int, fused: bool) -> None:
    """Eliminate column c by its entry in the row `pivot`, which becomes row c."""
    for j in range(n):
        A[c, j], A[pivot, j] = A[pivot, j], A[c, j]
        R[c, j], R[pivot, j] = R[pivot, j], R[c, j]
    inverse = 1.0 / A[c, c]
    for j in range(n):
        A[c, j] *= inverse
        R[c, j] *= inverse
    for i in range(n):
        if i != c and A[i, c] != 0.0:
            factor = A[i, c]
            for j in range(n):
                A[i, j] = less(A[i, j], factor, A[c, j], fused)
                R[i, j] = less(R[i, j], factor, R[c, j], fused)


@compiled(inline=True)
def shared_inverse(A: Array, n: int, R: Array, fused: bool) -> bool:
    """Inverse R of a linear problem [[M, −Jᵀ], [J, 0]] in which directions that stick may depend on
    each other. Motions are then unique, but forces are not: R gives those of least Σ λ²/s².

    Parameters
    ----------
    A : array, shape (n + 3, ·)
        Destroyed. An entry −s² on the diagonal says that a row is that of a direction that may
        share its force with others, and does not belong to the matrix.
    fused : bool
        As in :func:`eliminated`.

    Returns
    -------
    bool
        False if it is singular for another reason.

    Notes
    -----
    The largest entry that is left is the next pivot, wherever it is: which directions are those
    that others depend on is decided by size, so that two that differ by little are not both among
    them. Where no pivot is left, E = δ eeᵀ is added for such a direction, which makes a matrix that
    has an inverse, and changes no solution of consistent equations. The column of that inverse is a
    multiple of z, the forces that cancel: A z = −E z. So R is known but for multiples of the z,
    which a projection removes, on both sides.
    """
    for i in range(n):
        A[n + 1, i] = -min(A[i, i], 0.0)
        A[n + 2, i] = _TO_DO
        A[i, i] = max(A[i, i], 0.0)
    if not balanced(A, n, R):
        return False
    shared = 0
    for _ in range(n):
        largest = LEAST_PIVOT
        row, column = -1, -1
        for j in range(n):
            for i in range(n if A[n + 2, j] == _TO_DO else 0):
                if A[n + 2, i] == _TO_DO and abs(A[i, j]) > largest:
                    largest = abs(A[i, j])
                    row, column = i, j
        mark = _DONE
        if column < 0:
            for j in range(n):
                if column < 0 and A[n + 2, j] == _TO_DO and A[n + 1, j] > 0.0:
                    column = j
            if column < 0:
                return False
            size = 0.0
            for i in range(n):
                size = max(size, abs(R[i, column]) if A[n + 2, i] == _TO_DO else 0.0)
            if not size > 0.0:
                return False
            largest = LEAST_PIVOT
            for i in range(n):
                A[i, column] += R[i, column] / size
                if A[n + 2, i] == _TO_DO and abs(A[i, column]) > largest:
                    largest = abs(A[i, column])
                    row = i
            if row < 0:
                return False
            mark = _SHARED
            shared += 1
        clear_by(A, n, R, row, column, fused)
        A[n + 2, column] = mark
    for i in range(n):
        for j in range(n):
            R[i, j] *= A[n, i]
    if shared > 0:
        share_forces(A, n, R)
    return True


@compiled(brief=True)
def share_forces(A: Array, n: int, R: Array) -> None:
    """Take forces that cancel out of an inverse; see :func:`shared_inverse`, whose marks A has."""
    found = 0
    for c in range(n):
        if A[n + 2, c] != _SHARED:
            continue
        for i in range(n):
            A[found, i] = R[i, c] if A[n + 1, i] > 0.0 else 0.0
        # Gram–Schmidt in the norm Σ λ²/s²; the second pass removes the rounding errors of the
        # first.
        for _ in range(2):
            for k in range(found):
                dot = 0.0
                for i in range(n):
                    dot += A[k, i] * over(A[found, i], A[n + 1, i])
                for i in range(n):
                    A[found, i] -= dot * A[k, i]
            length = 0.0
            for i in range(n):
                length += A[found, i] * over(A[found, i], A[n + 1, i])
            for i in range(n):
                A[found, i] /= math.sqrt(length)
        found += 1
    for k in range(found):
        for j in range(n):
            dot = 0.0
            for i in range(n):
                dot += over(A[k, i], A[n + 1, i]) * R[i, j]
            for i in range(n):
                R[i, j] -= dot * A[k, i]
        for i in range(n):
            dot = 0.0
            for j in range(n):
                dot += R[i, j] * over(A[k, j], A[n + 1, j])
            for j in range(n):
                R[i, j] -= dot * A[k, j]


@compiled(inline=True)
def over(force: float, square: float) -> float:
    """A force by the square of its size; 0 where that is none."""
    return force / square if square > 0.0 else 0.0
