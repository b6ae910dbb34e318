"""The largest eigenvalues of a symmetric operator, by Lanczos' iteration with blocks.

References
----------
.. [1] R. G. Grimes, J. G. Lewis and H. D. Simon, A shifted block Lanczos algorithm for solving
   sparse symmetric generalized eigenproblems, SIAM J. Matrix Anal. Appl. 15 (1994).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError

_ACCURATE = 1e-11  # of an eigenvalue: what may be missing of a vector; of itself it is the square
_BLOCK = 8  # vectors at a time, since a solution for several costs hardly more than for one
_CLEAR = 1e-4  # of unity: squares of what is left of vectors that are new


def vectors_of_largest(solve: Callable[[Array], Array], mass: Any, count: int) -> Array:
    """Vectors of the largest eigenvalues of A⁻¹ M, shape (n, count), of unit mass.

    Parameters
    ----------
    solve : callable
        Multiplies columns by A⁻¹, which is symmetric and positive definite.
    mass : sparse array, shape (n, n)
    count : int

    Raises
    ------
    ConvergenceError
        If the vectors do not converge.

    Notes
    -----
    All vectors are kept and stay orthogonal to rounding; there are about three times as many as are
    wanted in the end. They begin with the same numbers each time.
    """
    n = mass.shape[0]
    width = min(_BLOCK, n)
    most = min(n, 20 * (count + width))
    room, table = np.empty((4 * count, n)).T, np.zeros((0, 0))
    size = 0
    found = np.random.default_rng(0).standard_normal((n, width))
    while True:
        old = size
        new = _orthonormal(found, room[:, :old], mass)
        size += new.shape[1]
        if size > room.shape[1]:
            room = np.vstack([room.T, np.empty((size, n))]).T
        room[:, old:size] = new
        basis = room[:, :size]
        found = solve(mass @ new)
        across = basis.T @ (mass @ found)
        table = np.block([[table, across[:old]], [across[:old].T, across[old:]]])
        found -= basis @ across
        if size >= count:
            values, ritz = np.linalg.eigh((table + table.T) / 2.0)
            values, ritz = values[::-1][:count], ritz[:, ::-1][:, :count]
            missing = found @ ritz[old:]  # of all others what they become is in the basis
            sizes = np.sqrt(np.einsum("ij,ij->j", missing, mass @ missing))
            if size == n or np.all(sizes <= _ACCURATE * values):
                return basis @ ritz
        if size >= most:
            raise ConvergenceError(
                "modes", f"{size} vectors do not hold {count} modes", "Ask for fewer modes"
            )
        found = found[:, : n - size]


def _orthonormal(found: Array, basis: Array, mass: Any) -> Array:
    """As many vectors of unit mass, orthogonal to those of the basis: combinations of what was
    found, and any others where these depend on each other."""
    root = np.sqrt(mass.diagonal())[:, None]  # in these units no mass matrix is far from unity
    for _ in range(5):
        found = np.linalg.qr(root * found)[0] / root
        found = found - basis @ (basis.T @ (mass @ found))
        parts, ways = np.linalg.eigh(found.T @ (mass @ found))
        found = found @ (ways / np.sqrt(np.maximum(parts, np.finfo(float).tiny)))
        if parts[0] > _CLEAR:  # else part of what is left is rounding
            break
    return found
