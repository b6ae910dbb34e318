"""Functions called by the machine code of systems: sums over orders, sums over rows, the inverse of
a matrix. It is compiled with the engine.

Every product that is added is rounded once, together with the sum.
"""

from __future__ import annotations

from stickslip.arrays import IntVector, Matrix, Vector
from stickslip.equations.codegen.series import eliminated, shared_inverse
from stickslip.machine_code.functions import Kernel
from stickslip.numerics.levels import LEAST_PIVOT
from stickslip.translator import fma


@Kernel
def cauchy(a: Vector, b: Vector, k: int, low: int, high: int) -> float:
    """Σ a[j] b[k − j] for low ≤ j < high."""
    s = 0.0
    for j in range(low, high):
        s = fma(a[j], b[k - j], s)
    return s


@Kernel
def chained(a: Vector, b: Vector, k: int, low: int, high: int) -> float:
    """Σ j a[j] b[k − j] for low ≤ j < high."""
    s = 0.0
    for j in range(low, high):
        s = fma(j * a[j], b[k - j], s)
    return s


@Kernel
def powered(a: Vector, y: Vector, k: int, low: int, high: int, p: float) -> float:
    """Σ (j p − (k − j)) a[j] y[k − j] for low ≤ j < high."""
    s = 0.0
    for j in range(low, high):
        s = fma(fma(float(j), p, float(j - k)) * a[j], y[k - j], s)
    return s


@Kernel
def applied(R: Vector, W: Matrix, n: int) -> float:
    """Σ R[j] W[j, 0] for j < n: one row of a solution."""
    s = 0.0
    for j in range(n):
        s = fma(R[j], W[j, 0], s)
    return s


@Kernel
def reached(R: Vector, mag: Vector, n: int) -> float:
    """Σ |R[j]| mag[j] for j < n."""
    s = 0.0
    for j in range(n):
        s = fma(abs(R[j]), mag[j], s)
    return s


@Kernel
def summed_moduli(factors: Vector, rows: IntVector, W: Matrix, n: int) -> float:
    """Σ factors[j] |W[rows[j], 0]| for j < n."""
    # Four sums: additions do not wait for each other.
    a = b = c = d = 0.0
    j = 0
    while j + 3 < n:
        a = fma(factors[j], abs(W[rows[j], 0]), a)
        b = fma(factors[j + 1], abs(W[rows[j + 1], 0]), b)
        c = fma(factors[j + 2], abs(W[rows[j + 2], 0]), c)
        d = fma(factors[j + 3], abs(W[rows[j + 3], 0]), d)
        j += 4
    while j < n:
        a = fma(factors[j], abs(W[rows[j], 0]), a)
        j += 1
    return (a + b) + (c + d)


@Kernel
def inverted(A: Matrix, n: int, R: Matrix) -> int:
    """Inverse R of the leading n×n block of A (destroyed, with the row below); 0 if it is
    singular, else 1."""
    return int(eliminated(A, n, R, True))


@Kernel
def shared(A: Matrix, n: int, R: Matrix) -> int:
    """The same where directions that stick may depend on each other."""
    return int(shared_inverse(A, n, R, True))


@Kernel
def is_definite(A: Matrix, n: int, R: Matrix) -> int:
    """1 if the leading n×n block of a symmetric A is positive definite: the pivots of elimination,
    in R, are positive and no rounding errors. Else 0."""
    for i in range(n):
        for j in range(n):
            R[i, j] = A[i, j]
    for c in range(n):
        if not R[c, c] > LEAST_PIVOT * abs(A[c, c]):
            return 0
        for i in range(c + 1, n):
            factor = R[i, c] / R[c, c]
            for j in range(c, n):
                R[i, j] = fma(-factor, R[c, j], R[i, j])
    return 1
