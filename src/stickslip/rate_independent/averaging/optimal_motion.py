"""Motions of minimum cost: the distribution of a displacement over phases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.rate_independent.sets.potential import Dissipation, OptimalMotion

_MOST_NUMBERS = 20_000_000  # largest number of entries of the table of an optimal motion
VANISHING_THRESHOLD = 1e-12  # thresholds that count as 0, relative to the largest


def measure_with_sum(
    source: Dissipation, V: Array, phases: Array, motions: Array, xi: Array, violation: float
) -> OptimalMotion:
    """A measure with the sum V, its cost, and the lower bound of the minimum from a force ξ.

    Parameters
    ----------
    V : array, shape (n,)
    phases : array, shape (k,)
    motions : array, shape (k, n)
        Of the measure; their sum is V up to rounding.
    xi : array, shape (n,)
        A force.
    violation : float
        Upper bound of its excess over K(s).
    """
    moving = np.abs(motions).max(axis=1) > FEW_ROUNDINGS * np.abs(V).max(initial=0.0)
    together, sums = gathered(phases[moving], motions[moving])
    if len(sums):
        # Rounding of the program that found them.
        sums[int(np.linalg.norm(sums, axis=1).argmax())] += V - sums.sum(axis=0)
    cost = sum(source.support(v, s) for s, v in zip(together, sums, strict=True))
    total = float(np.linalg.norm(sums, axis=1).sum())
    return OptimalMotion(together, sums, float(cost), float(xi @ V) - max(violation, 0.0) * total)


def gathered(phases: Array, motions: Array) -> tuple[Array, Array]:
    """The same measure with increasing, distinct phases."""
    together, place = np.unique(phases, return_inverse=True)
    sums = np.zeros((len(together), motions.shape[1]))
    np.add.at(sums, place, motions)
    return together, sums


def scheduled(source: Dissipation, V: Array, when: Array, bound: float) -> OptimalMotion:
    """Each component moves at a different phase."""
    moving = V != 0
    phases, place = np.unique(when[moving], return_inverse=True)
    if len(phases) * len(V) > _MOST_NUMBERS:
        raise DeclarationError(
            "optimal_motion",
            f"a table of {len(phases)} phases and {len(V)} components is too large",
            "Use the phases of the components: average.phases, or upper_phases and lower_phases",
        )
    motions = np.zeros((len(phases), len(V)))
    motions[place, np.flatnonzero(moving)] = V[moving]
    cost = sum(source.support(v, s) for s, v in zip(phases, motions, strict=True))
    return OptimalMotion(phases, motions, float(cost), bound)


def vanishing(thresholds: Array) -> NDArray[np.bool_]:
    """Thresholds that are treated as 0."""
    return thresholds <= VANISHING_THRESHOLD * float(thresholds.max())


def axes(chosen: NDArray[np.bool_]) -> Array:
    """Unit vectors of the chosen components as columns."""
    (index,) = np.nonzero(chosen)
    basis = np.zeros((len(chosen), len(index)))
    basis[index, np.arange(len(index))] = 1.0
    return basis
