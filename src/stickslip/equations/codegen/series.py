"""What ``jets`` returns, and the inverse of a matrix."""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.translator import compiled, fma

# What ``jets`` returns: a linear problem has no solution, or a mass matrix is not definite.
SINGULAR = 1
INDEFINITE = 6
LEAST_PIVOT = 1e-13  # of a matrix of size 1: what is smaller is zero


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
    A : array
    n : int
    R : array
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
    for c in range(n):
        pivot = c
        for i in range(c + 1, n):
            if abs(A[i, c]) > abs(A[pivot, c]):
                pivot = i
        if not abs(A[pivot, c]) > LEAST_PIVOT:
            return False
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
    for i in range(n):
        for j in range(n):
            R[i, j] *= A[n, i]
    return True
