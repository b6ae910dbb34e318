"""Eigenvalues and eigenvectors of small real matrices, in given work space.

The matrix is balanced by powers of two, brought to Hessenberg's form by reflections and to real
Schur form by Francis's double steps (Golub & Van Loan 2013, section 7.5); rotations of its 2 × 2
blocks make that triangular, and eigenvectors follow by substitution. The bits of the result depend
on the matrix alone, not on a library's choice of kernels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, ComplexMatrix, ComplexVector, Matrix, Vector
from stickslip.equations.codegen.series import invert
from stickslip.numerics.levels import EPSILON
from stickslip.translator import compiled

_MOST_STEPS = 60  # largest number of Francis steps for one or two eigenvalues
_STALLED = 10  # steps after which other shifts are tried
_SMALL_CHANGE = 1e-3  # largest relative change of an eigenvector that is applied
# smallest relative decrease of the norms of row and column for which balancing is applied
_WORTH = 0.95


class Eigenproblem(NamedTuple):
    """Work space for the eigenvalue problem of matrices of up to n rows.

    Attributes
    ----------
    H : array, shape (n + 1, n)
        The matrix; destroyed.
    Q : array, shape (n, n)
    scale, v : arrays, shape (n,)
    T, Z : arrays of complex, shape (n, n)
    x : array of complex, shape (n,)
    values : array of complex, shape (n,)
        Receives the eigenvalues, of conjugate pairs that with positive imaginary part first.
    vectors : array of complex, shape (n, n)
        Receives in its columns eigenvectors of length 1, whose largest component is positive.
    """

    H: Matrix
    Q: Matrix
    scale: Vector
    v: Vector
    T: ComplexMatrix
    Z: ComplexMatrix
    x: ComplexVector
    values: ComplexVector
    vectors: ComplexMatrix


def make_eigenproblem(n: int) -> Eigenproblem:
    """Work space for matrices of up to n rows."""
    z = np.zeros
    c = np.complex128
    return Eigenproblem(
        H=z((n + 1, n)),
        Q=z((n, n)),
        scale=z(n),
        v=z(n),
        T=z((n, n), c),
        Z=z((n, n), c),
        x=z(n, c),
        values=z(n, c),
        vectors=z((n, n), c),
    )


@compiled()
def modulus(z: complex) -> float:
    """|z|, by operations that all processors round alike."""
    return math.sqrt(z.real * z.real + z.imag * z.imag)


@compiled()
def decompose(p: Eigenproblem, n: int) -> bool:
    """Eigenvalues and eigenvectors of the matrix in the first n rows and columns of `p.H`; False if
    the iteration does not end."""
    if n == 0:
        return True
    balance_norms(p.H, n, p.scale)
    to_hessenberg(p.H, p.Q, n, p.v)
    if not to_schur(p.H, p.Q, n, p.v):
        return False
    to_triangle(p, n)
    largest = 0.0
    for i in range(n):
        for j in range(i, n):
            largest = max(largest, modulus(p.T[i, j]))
    for k in range(n):
        find_vector(p, n, k, EPSILON * largest)
    return True


@compiled()
def balance_norms(A: Array, n: int, scale: Array) -> None:
    """Make rows and columns of A of about the same size: A becomes D⁻¹ A D, with D of powers of two
    (Parlett & Reinsch 1969)."""
    for i in range(n):
        scale[i] = 1.0
    done = False
    while not done:
        done = True
        for i in range(n):
            column = 0.0
            row = 0.0
            for j in range(n):
                if j != i:
                    column += abs(A[j, i])
                    row += abs(A[i, j])
            if column == 0.0 or row == 0.0:
                continue
            factor = 1.0
            before = column + row
            while column < 0.5 * row:
                factor *= 2.0
                column *= 2.0
                row *= 0.5
            while column >= 2.0 * row:
                factor *= 0.5
                column *= 0.5
                row *= 2.0
            if column + row < _WORTH * before:
                done = False
                scale[i] *= factor
                for j in range(n):
                    A[i, j] /= factor
                for j in range(n):
                    A[j, i] *= factor


@compiled()
def reflector(v: Array, count: int) -> float:
    """Turn a vector x into v such that I − τ v vᵀ takes x to a multiple of the first unit vector;
    returns τ, 0 if x is one."""
    size = 0.0
    rest = 0.0
    for i in range(count):
        size = max(size, abs(v[i]))
        rest += abs(v[i]) if i > 0 else 0.0
    if rest == 0.0:
        return 0.0
    total = 0.0
    for i in range(count):
        v[i] /= size
        total += v[i] * v[i]
    v[0] += math.sqrt(total) if v[0] >= 0.0 else -math.sqrt(total)
    total = 0.0
    for i in range(count):
        total += v[i] * v[i]
    return 2.0 / total


@compiled()
def reflect(H: Array, Q: Array, v: Array, tau: float, at: tuple[int, int, int, int, int]) -> None:
    """Replace H by P H P and Q by Q P with P = I − τ v vᵀ on some components.

    Parameters
    ----------
    at : (int, int, int, int, int)
        Size of the matrices; first component, and how many; the first column of H that is not zero
        there, and the end of its rows that are not.
    """
    n, first, count, left, below = at
    if tau == 0.0:
        return
    for j in range(left, n):
        total = 0.0
        for i in range(count):
            total += v[i] * H[first + i, j]
        for i in range(count):
            H[first + i, j] -= tau * total * v[i]
    for i in range(below):
        total = 0.0
        for j in range(count):
            total += H[i, first + j] * v[j]
        for j in range(count):
            H[i, first + j] -= tau * total * v[j]
    for i in range(n):
        total = 0.0
        for j in range(count):
            total += Q[i, first + j] * v[j]
        for j in range(count):
            Q[i, first + j] -= tau * total * v[j]


@compiled()
def to_hessenberg(H: Array, Q: Array, n: int, v: Array) -> None:
    """Clear H below its first subdiagonal; Q receives the product of the reflections."""
    for i in range(n):
        for j in range(n):
            Q[i, j] = 1.0 if i == j else 0.0
    for k in range(n - 2):
        for i in range(k + 1, n):
            v[i - k - 1] = H[i, k]
        tau = reflector(v, n - k - 1)
        reflect(H, Q, v, tau, (n, k + 1, n - k - 1, k, n))
        for i in range(k + 2, n):
            H[i, k] = 0.0


@compiled()
def to_schur(H: Array, Q: Array, n: int, v: Array) -> bool:
    """Have Hessenberg's form with blocks of one or two rows on its diagonal; False if that takes
    too long."""
    size = 0.0
    for i in range(n):
        for j in range(n):
            size += abs(H[i, j])
    high = n - 1
    steps = 0
    while high > 0:
        low = high
        while low > 0:
            # An entry within rounding errors of its neighbours may be set to zero. If these are
            # rounding errors themselves, the eigenvalue is a multiple one, and an entry within
            # rounding errors of the matrix may be set to zero, too.
            near = abs(H[low - 1, low - 1]) + abs(H[low, low])
            if near == 0.0 or steps > _STALLED:
                near = size * max(steps - _STALLED, 1)
            if abs(H[low, low - 1]) <= EPSILON * near:
                H[low, low - 1] = 0.0
                break
            low -= 1
        if low >= high - 1:
            high = low - 1
            steps = 0
            continue
        steps += 1
        if steps > _MOST_STEPS:
            return False
        francis_step(H, Q, n, v, low, high, steps % _STALLED == 0)
    return True


@compiled()
def francis_step(H: Array, Q: Array, n: int, v: Array, low: int, high: int, stalled: bool) -> None:
    """Two steps of the QR iteration at once, with the eigenvalues of the last 2 × 2 block as
    shifts.

    Parameters
    ----------
    n : int
        Size of the matrices.
    v : array
        Work space.
    low, high : int
        First and last row of the block that is worked on.
    stalled : bool
        Take other shifts: these have led nowhere.
    """
    a = H[high - 1, high - 1]
    d = H[high, high]
    total = a + d
    product = a * d - H[high - 1, high] * H[high, high - 1]
    if stalled:
        size = abs(H[high, high - 1]) + abs(H[high - 1, high - 2])
        total = 1.5 * size
        product = size * size
    # first column of (H − σ₁)(H − σ₂)
    e = H[low, low]
    f = H[low + 1, low]
    v[0] = (e * e + H[low, low + 1] * f - total * e) + product
    v[1] = f * (e + H[low + 1, low + 1] - total)
    v[2] = f * H[low + 2, low + 1]
    for k in range(low, high):
        count = min(3, high - k + 1)
        if k > low:
            for i in range(count):
                v[i] = H[k + i, k - 1]
        tau = reflector(v, count)
        reflect(H, Q, v, tau, (n, k, count, max(k - 1, low), min(k + 4, high + 1)))
        if k > low:
            for i in range(1, count):
                H[k + i, k - 1] = 0.0


@compiled()
def to_triangle(p: Eigenproblem, n: int) -> None:
    """Take the real Schur form H to the triangular T, and Q to Z, by a rotation for each block of
    two rows."""
    T = p.T
    Z = p.Z
    for i in range(n):
        for j in range(n):
            T[i, j] = complex(p.H[i, j] if j + 1 >= i else 0.0, 0.0)
            Z[i, j] = complex(p.Q[i, j], 0.0)
        p.values[i] = complex(p.H[i, i], 0.0)
    for k in range(n - 1):
        c = p.H[k + 1, k]
        if c == 0.0:
            continue
        b = p.H[k, k + 1]
        d = p.H[k + 1, k + 1]
        half = 0.5 * (p.H[k, k] - d)
        bend = half * half + b * c
        if bend >= 0.0:
            z = complex(half + (math.sqrt(bend) if half >= 0.0 else -math.sqrt(bend)), 0.0)
            p.values[k] = d + z
            p.values[k + 1] = d - b * c / z if z != 0.0j else p.values[k]
        else:
            z = complex(half, math.sqrt(-bend))
            p.values[k] = d + z
            p.values[k + 1] = p.values[k].conjugate()
        # (z, c) is an eigenvector of the block
        size = math.sqrt(z.real * z.real + z.imag * z.imag + c * c)
        z = z / size
        s = c / size
        for j in range(k, n):
            x = T[k, j]
            y = T[k + 1, j]
            T[k, j] = z.conjugate() * x + s * y
            T[k + 1, j] = z * y - s * x
        for i in range(n):
            if i <= k + 1:
                x = T[i, k]
                y = T[i, k + 1]
                T[i, k] = x * z + y * s
                T[i, k + 1] = y * z.conjugate() - x * s
            x = Z[i, k]
            y = Z[i, k + 1]
            Z[i, k] = x * z + y * s
            Z[i, k + 1] = y * z.conjugate() - x * s


@compiled()
def find_vector(p: Eigenproblem, n: int, k: int, least: float) -> None:
    """The eigenvector of the k-th eigenvalue; differences of eigenvalues below `least` are
    rounding."""
    x = p.x
    x[k] = complex(1.0, 0.0)
    for i in range(k - 1, -1, -1):
        total = complex(0.0, 0.0)
        for j in range(i + 1, k + 1):
            total += p.T[i, j] * x[j]
        apart = p.values[i] - p.values[k]
        if modulus(apart) < least:
            apart = complex(least, 0.0)
        x[i] = -total / apart if total != 0.0j else total
    # back to the given matrix, then to length 1 with a positive largest component
    largest = complex(0.0, 0.0)
    for i in range(n):
        total = complex(0.0, 0.0)
        for j in range(k + 1):
            total += p.Z[i, j] * x[j]
        p.vectors[i, k] = p.scale[i] * total
        if modulus(p.vectors[i, k]) > modulus(largest):
            largest = p.vectors[i, k]
    size = 0.0
    for i in range(n):
        z = p.vectors[i, k] / largest
        if p.values[k].imag == 0.0:
            z = complex(z.real, 0.0)
        p.vectors[i, k] = z
        size += z.real * z.real + z.imag * z.imag
    for i in range(n):
        p.vectors[i, k] /= math.sqrt(size)


@compiled()
def invert_basis(p: Eigenproblem, count: int) -> bool:
    """Invert a real basis, real and imaginary parts of the vectors of a pair; False if it is none.

    Parameters
    ----------
    p : Eigenproblem
        With eigenvalues and eigenvectors; receives the inverse in `Q`.
    count : int
        How many there are.
    """
    for j in range(count):
        for i in range(count):
            z = p.vectors[i, j]
            p.H[i, j] = p.vectors[i, j - 1].imag if p.values[j].imag < 0.0 else z.real
    return bool(invert(p.H, count, p.Q))


@compiled()
def refine_vectors(p: Eigenproblem, F: Array, members: Array, count: int) -> None:
    """Correct eigenvalues and eigenvectors by their residuals, expanded in the eigenvectors.

    Where some modes are much faster than others, rounding errors of the iteration are those of the
    fastest, and slow modes have parts of fast ones that residuals, row by row, tell.

    Parameters
    ----------
    p : Eigenproblem
        With the inverse of the basis.
    F : array
        Has the matrix,
    members : array of int
        in these rows and columns.
    count : int
        How many there are.
    """
    X, V = p.Q, p.vectors
    for j in range(count):
        lam = p.values[j]
        if lam.imag < 0.0:
            continue
        for i in range(count):
            off = -lam * V[i, j]
            for m in range(count):
                off += F[members[i], members[m]] * V[m, j]
            p.T[0, i] = off
            p.Z[i, j] = V[i, j]
        p.T[1, j] = lam
        for k in range(count):
            value = p.values[k]
            re = complex(0.0, 0.0)
            im = complex(0.0, 0.0)
            first = k - 1 if value.imag < 0.0 else k
            for i in range(count):
                re += X[first, i] * p.T[0, i]
                if value.imag != 0.0:
                    im += X[first + 1, i] * p.T[0, i]
            part = re
            if value.imag != 0.0:
                part = 0.5 * re + (0.5j if value.imag < 0.0 else -0.5j) * im
            if k == j:
                p.T[1, j] = lam + part
                continue
            away = value - lam
            # Nearly equal eigenvalues are not separated.
            if part != 0.0j and modulus(part) <= _SMALL_CHANGE * modulus(away):
                part = part / away
                for i in range(count):
                    p.Z[i, j] = p.Z[i, j] - part * V[i, k]
    for j in range(count):
        lam = p.values[j]
        if lam.imag < 0.0:
            continue
        new = p.T[1, j]
        p.values[j] = complex(
            new.real if lam.real != 0.0 else 0.0, new.imag if lam.imag != 0.0 else 0.0
        )
        for i in range(count):
            z = p.Z[i, j]
            V[i, j] = z if lam.imag != 0.0 else complex(z.real, 0.0)
            if lam.imag != 0.0:
                V[i, j + 1] = z.conjugate()
        if lam.imag != 0.0:
            p.values[j + 1] = p.values[j].conjugate()
