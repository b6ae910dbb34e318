"""Copies of vectors, orthonormal bases, and a few equations."""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.numerics.levels import LEAST_PIVOT
from stickslip.translator import compiled


@compiled(brief=True)
def is_new(n: int, basis: Array, rank: int, least: float) -> bool:
    """Whether the vector after an orthonormal basis is linearly independent of it; if so, it is
    appended.

    Parameters
    ----------
    n : int
        Number of components.
    rank : int
        Number of vectors.
    least : float
        Square of the part of it that has to be new.
    """
    size = 0.0
    for j in range(n):
        size += basis[rank, j] ** 2
    # Twice: one pass of Gram–Schmidt leaves rounding errors relative to the removed part.
    for _ in range(2):
        for r in range(rank):
            dot = 0.0
            for j in range(n):
                dot += basis[rank, j] * basis[r, j]
            for j in range(n):
                basis[rank, j] -= dot * basis[r, j]
    left = 0.0
    for j in range(n):
        left += basis[rank, j] ** 2
    if left <= least * size:
        return False
    for j in range(n):
        basis[rank, j] /= math.sqrt(left)
    return True


@compiled()
def solve_equations(system: Array, n: int) -> bool:
    """Solve n equations, whose right-hand side is the column after them and becomes the solution;
    False if a pivot vanishes relative to its row."""
    for k in range(n):
        best = k
        most = -1.0
        # Pivots relative to their rows: equations of different units have no common scale.
        for i in range(k, n):
            size = 0.0
            for j in range(n):
                size = max(size, abs(system[i, j]))
            part = abs(system[i, k]) / size if size > 0.0 else 0.0
            if part > most:
                best, most = i, part
        if not most > LEAST_PIVOT:
            return False
        if best != k:
            for j in range(n + 1):
                system[k, j], system[best, j] = system[best, j], system[k, j]
        for i in range(k + 1, n):
            factor = system[i, k] / system[k, k]
            for j in range(k, n + 1):
                system[i, j] -= factor * system[k, j]
    for k in range(n - 1, -1, -1):
        total = system[k, n]
        for j in range(k + 1, n):
            total -= system[k, j] * system[j, n]
        system[k, n] = total / system[k, k]
    return True


@compiled(brief=True)
def direction_and_turn(
    x: float, y: float, rounded: float
) -> tuple[float, float, float, float, float, float]:
    """The direction n = u/√(|u|² + rounded²) of a vector u, its derivative by u, times that root,
    and the root.

    Parameters
    ----------
    x, y : float
        The vector.

    Returns
    -------
    derivative : three floats
        Its entries xx, yy and xy, which do not cancel where u is large.
    """
    root = math.sqrt(x * x + y * y + rounded * rounded)
    x, y = x / root, y / root
    least = (rounded / root) ** 2
    return x, y, least + y * y, least + x * x, -x * y, root


@compiled()
def clear(numbers: Array) -> None:
    """Set whole numbers to 0."""
    for i in range(len(numbers)):
        numbers[i] = 0


@compiled()
def copy(source: Array, target: Array) -> None:
    """Copy a vector (a slice assignment would compile shape checks that can never fail)."""
    for i in range(len(source)):
        target[i] = source[i]
