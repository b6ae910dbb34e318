"""Zeros of smooth equations from many starts simultaneously."""

from __future__ import annotations

import numpy as np

from stickslip.arrays import AnyArray as Array
from stickslip.numerics.levels import NEARLY_SOLVED, RANK, TINIEST
from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.steady import ResidualFunction

# a zero is accepted if Newton's step there is shorter than this, in units of the unknowns
_PRECISION = 1e-9
_ITERATIONS = 60
_POLISH = 4
_HELD = 1e-8  # relative to the largest entry, added to the diagonal: holds irrelevant components
# damping of Levenberg's method for which steps equal Newton's up to rounding errors
_LEAST_DAMPING = 1e-14
_FOUND = 1e-24  # sum of squares of scaled equations at which the improvement of starts ends
_APART = 1e-6  # smallest distance of different zeros, in units of the state


def fill_box(count: int, low: Array, high: Array) -> Array:
    """Points that fill a box evenly: the additive sequence of Roberts (the golden ratio in more
    dimensions).

    Returns
    -------
    array, shape (components, count)
    """
    n = len(low)
    g = 2.0
    for _ in range(60):
        g = (1.0 + g) ** (1.0 / (n + 1))
    steps = g ** -np.arange(1.0, n + 1)
    part = (0.5 + np.outer(steps, np.arange(1, count + 1))) % 1.0
    return low[:, None] + (high - low)[:, None] * part


def wide_sample(count: int, origin: Array) -> Array:
    """Points around a state at all distances up to about 50 times its size (1 if it is smaller)."""
    ones = np.ones(len(origin))
    size = np.maximum(np.abs(origin), 1.0)
    return origin[:, None] + size[:, None] * np.sinh(5.0 * fill_box(count, -ones, ones)) / np.sinh(
        1.0
    )


@np.errstate(all="ignore")
def zeros(residual: ResidualFunction, starts: Array, origin: Array) -> list[tuple[Array, int]]:
    """Zeros found by the Levenberg-Marquardt method, without duplicates, with the rank of the
    Jacobian there.

    Parameters
    ----------
    starts : array, shape (n, starts)
    origin : array, shape (n,)
        Gives the units: the size of each component there, or 1.
    """
    units = np.maximum(np.abs(origin), 1.0)
    F, J = residual(starts)
    defined = np.all(np.isfinite(F), axis=0) & np.all(np.isfinite(J), axis=(0, 1))
    if not np.any(defined):
        return []
    y = _descend(residual, starts[:, defined], units)
    step, rank = _newton_step(residual, y, units)
    for _ in range(_POLISH):
        y = y - units[:, None] * step
        step, rank = _newton_step(residual, y, units)
    return _distinct(residual, y, step, rank, units)


def _descend(residual: ResidualFunction, y: Array, units: Array) -> Array:
    """Levenberg-Marquardt steps on |F|², each component of F in units of its slopes at the
    start."""
    F, J = residual(y)
    # Weights are fixed at the start, so that |F|² decreases monotonically.
    weight = ratio(1.0, np.max(np.abs(J) * units[None, :, None], axis=1))
    damping = np.full(y.shape[1], 1e-2)
    F = weight * F
    J = weight[:, None] * J * units[None, :, None]
    for _ in range(_ITERATIONS):
        A, right = np.einsum("jik,jlk->kil", J, J), np.einsum("jik,jk->ki", J, F)
        # A little of the identity, so that components that do not count stay where they are.
        diagonal = (
            np.einsum("kii->ki", A) + _HELD * np.max(np.abs(A), axis=(1, 2))[:, None] + TINIEST
        )
        A = A + (damping[:, None] * diagonal)[:, :, None] * np.eye(len(y))
        trial = y - units[:, None] * np.linalg.solve(A, right[:, :, None])[:, :, 0].T
        G, K = residual(trial)
        G = weight * G
        K = weight[:, None] * K * units[None, :, None]
        better = np.sum(G**2, axis=0) < np.sum(F**2, axis=0)
        better &= np.all(np.isfinite(K), axis=(0, 1))
        y = np.where(better, trial, y)
        F = np.where(better, G, F)
        J = np.where(better, K, J)
        # Towards Newton's method after success, towards gradient descent after a failure.
        damping = np.clip(np.where(better, 0.2 * damping, 4.0 * damping), _LEAST_DAMPING, 1e10)
        if np.all((np.sum(F**2, axis=0) <= _FOUND) | (damping > 1e6)):
            break
    return y


def _newton_step(residual: ResidualFunction, y: Array, units: Array) -> tuple[Array, Array]:
    """Newton's steps in units (n, starts), the shortest where the Jacobian is singular, and its
    ranks (starts,)."""
    F, J = residual(y)
    J = np.moveaxis(J * units[:, None], -1, 0)
    J = np.where(np.all(np.isfinite(J), axis=(1, 2))[:, None, None], J, 0.0)
    size = np.max(np.abs(J), axis=2)
    # Rows are scaled to 1, so that ranks do not depend on the units of the equations.
    u, s, v = np.linalg.svd(ratio(J, size[:, :, None]), full_matrices=False)
    kept = s > RANK * np.maximum(s[:, :1], TINIEST)
    reciprocal = np.where(kept, 1.0 / np.where(kept, s, 1.0), 0.0)
    inverse = ratio(np.einsum("kji,kj,klj->kil", v, reciprocal, u), size[:, None, :])
    return np.einsum("kij,jk->ik", inverse, F), np.sum(kept, axis=1)


def _distinct(
    residual: ResidualFunction, y: Array, step: Array, rank: Array, units: Array
) -> list[tuple[Array, int]]:
    found: list[tuple[Array, int]] = []
    F, J = residual(y)
    for k in range(y.shape[1]):
        if not np.linalg.norm(step[:, k]) <= _PRECISION * (1.0 + np.linalg.norm(y[:, k] / units)):
            continue
        if rank[k] < len(y):
            # A least-squares step of length zero may also occur at a minimum that is not a zero.
            terms = np.abs(J[:, :, k]) @ np.maximum(np.abs(y[:, k]), units)
            if not np.all(np.abs(F[:, k]) <= NEARLY_SOLVED * terms):
                continue
        else:
            # Elimination keeps exact zeros that the singular values of the steps before have
            # smeared.
            y[:, k] -= np.linalg.solve(J[:, :, k], F[:, k])
        apart = (
            np.linalg.norm((y[:, k] - z) / units) / (1.0 + np.linalg.norm(z / units))
            for z, _ in found
        )
        if all(d > _APART for d in apart):
            found.append((y[:, k], int(rank[k])))
    return found
