"""The largest eigenvalues of a symmetric operator, by Lanczos' iteration with blocks.

References
----------
.. [1] R. G. Grimes, J. G. Lewis and H. D. Simon, A shifted block Lanczos algorithm for solving
   sparse symmetric generalized eigenproblems, SIAM J. Matrix Anal. Appl. 15 (1994).
.. [2] K. Wu and H. Simon, Thick-restart Lanczos method for large symmetric eigenvalue problems,
   SIAM J. Matrix Anal. Appl. 22 (2000).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError

_ACCURATE = 1e-11  # relative error of a vector; that of an eigenvalue is its square
_ROOM = 4  # number of vectors relative to the requested ones, before the best are kept
_MOST = 20  # number of vectors relative to the requested ones, before the iteration fails
_BLOCK = 8  # vectors per block: a solution for several costs little more than for one
_CLEAR = 1e-4  # squared norm of the remainder of a new vector, relative to 1


def vectors_of_largest(
    solve: Callable[[Array], Array],
    mass: Any,
    count: int,
    nearer: Callable[[Array], Callable[[Array], Array] | None] | None = None,
) -> Array:
    """Vectors of the largest eigenvalues of A⁻¹ M, shape (n, count), of unit mass.

    Parameters
    ----------
    solve : callable
        Multiplies columns by A⁻¹, which is symmetric and positive definite.
    mass : sparse array, shape (n, n)
    nearer : callable, optional
        Asked, with estimates of the largest eigenvalues, for a solution with another A that has the
        same vectors and tells them apart better; None: there is none.

    Raises
    ------
    ConvergenceError
        If the vectors do not converge.

    Notes
    -----
    All vectors stay orthogonal to rounding; in the end there are about three times as many as are
    wanted. Where these do not suffice, as on long and thin structures, whose frequencies are close,
    the best combinations are kept, and it goes on from there [2]_. It begins with the same numbers
    each time.
    """
    n = mass.shape[0]
    width = min(_BLOCK, n)
    room, table = np.empty((_ROOM * count + 2 * width, n)).T, np.zeros((0, 0))
    size, made = 0, 0
    found = np.random.default_rng(0).standard_normal((n, width))
    while True:
        old = size
        new = _orthonormal(found, room[:, :old], mass)
        size, made = size + new.shape[1], made + new.shape[1]
        room[:, old:size] = new
        basis = room[:, :size]
        found = solve(mass @ new)
        # All products with the basis, not only those that the recurrence needs: a recurrence of
        # three terms loses orthogonality as vectors converge.
        across = basis.T @ (mass @ found)
        table = np.block([[table, across[:old]], [across[:old].T, across[old:]]])
        found -= basis @ across
        if size >= count:
            values, ritz = np.linalg.eigh((table + table.T) / 2.0)
            values, ritz = values[::-1], ritz[:, ::-1]
            last = ritz[old:, :count]  # the images of all other vectors are in the basis
            missing = np.einsum("ij,ij->j", last, (found.T @ (mass @ found)) @ last)
            if size == n or np.all(np.sqrt(np.maximum(missing, 0.0)) <= _ACCURATE * values[:count]):
                return basis @ ritz[:, :count]
            if made >= _MOST * (count + width):
                raise ConvergenceError(
                    "modes",
                    f"{made} Lanczos vectors are not enough for {count} modes",
                    "Request fewer modes",
                )
            better = None
            if nearer and 2 * size >= 3 * count:
                better, nearer = nearer(values[:count]), None
            if better:
                # Ritz vectors of the old operator start the new one: both have the same
                # eigenvectors.
                solve, size, table = better, 0, np.zeros((0, 0))
                found = basis @ ritz[:, :width]
                continue
            if size + width > room.shape[1]:
                # Thick restart: the wanted Ritz vectors and half of the others, so that convergence
                # continues where it was.
                size = count + (size - count) // 2
                room[:, :size] = basis @ ritz[:, :size]
                table = np.diag(values[:size])
        found = found[:, : n - size]


def _orthonormal(found: Array, basis: Array, mass: Any) -> Array:
    """As many vectors of unit mass, orthogonal to the basis: combinations of the given ones,
    completed by arbitrary ones if these are linearly dependent."""
    root = np.sqrt(mass.diagonal())[:, None]  # in these units no mass matrix is far from unity
    for _ in range(5):
        # QR first: vectors of very different lengths would make the Gram matrix singular.
        found = np.linalg.qr(root * found)[0] / root
        found = found - basis @ (basis.T @ (mass @ found))
        parts, ways = np.linalg.eigh(found.T @ (mass @ found))
        found = found @ (ways / np.sqrt(np.maximum(parts, np.finfo(float).tiny)))
        if parts[0] > _CLEAR:  # otherwise part of the remainder is rounding
            break
    return found
