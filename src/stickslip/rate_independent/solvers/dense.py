"""Steps with a small dense A: ξ = proj_K(ℓ − A z) in the metric of A⁻¹, then z moves by A⁻¹(ℓ − A z
− ξ)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array, plain_array
from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.rate_independent.sets.stable_sets import Boxes, ConvexSets, Discs

if TYPE_CHECKING:
    from stickslip.rate_independent.solvers.active_set import BoxSpace, Face

_BLOCK = 400_000  # number of entries of an array of a block of steps


class BoxSteps:
    """Weighted ℓ1: boxes K(s), by an active set; signs and factor of the moving components are kept
    from step to step.

    Parameters
    ----------
    A : array, shape (n, n)
    """

    def __init__(self, A: Array) -> None:
        from stickslip.rate_independent.solvers.active_set import make_box_space, make_face

        self.face: Face = make_face(A)
        self.space: BoxSpace = make_box_space(len(A))
        self.block: int = max(1, min(4096, _BLOCK // len(A)))

    def advance(self, z: Array, loads: Array, sets: Boxes) -> tuple[Array, Array]:
        """States after each load (as far as the solver came), and the changes of sign each took."""
        from stickslip.rate_independent.solvers.active_set import advance_boxes

        states = np.empty(loads.shape)
        effort = np.zeros(len(loads), np.int64)
        loads, lower, upper = (plain_array(table) for table in (loads, sets.lower, sets.upper))
        z = np.array(z, float)
        done = advance_boxes(self.face, z, loads, lower, upper, states, effort, self.space)
        return states[:done], effort[:done]


class ProjectionSteps:
    """Any other potential, by the projection of forces onto K(s) in the metric of A⁻¹, which is
    computed once.

    Parameters
    ----------
    A : array, shape (n, n)
    """

    def __init__(self, A: Array) -> None:
        from scipy.linalg import cho_factor, cho_solve

        self.A = A
        self.block = 64
        self.factor: tuple[Array, bool] = cho_factor(A)
        inverse = cho_solve(self.factor, np.eye(len(A)))
        self.metric: Array = (inverse + inverse.T) / 2.0

    def advance(self, z: Array, loads: Array, sets: ConvexSets | Discs) -> tuple[Array, Array]:
        """States after each load, and 1 for each step that moved."""
        states = np.empty_like(loads)
        effort = np.zeros(len(loads), np.int64)
        size = float(sets.size()[0])
        for k, load in enumerate(loads):
            elastic = self.A @ z
            row = sets.row(k)
            force = load - elastic
            noise = FEW_ROUNDINGS * (np.abs(load).max() + np.abs(elastic).max() + size)
            if not row.holds(force, noise):
                held = row.nearest(force, self.metric)
                effort[k] = 1
                z = z + self._increment(force - held, held, row, noise)
            states[k] = z
        return states, effort

    def _increment(self, pull: Array, held: Array, row: ConvexSets | Discs, noise: float) -> Array:
        """The d with A d = pull, in which components that may rest do so, and are not moved by
        rounding.

        It is computed directly, not as a difference of states, since its direction must be accurate
        for the test of the force.
        """
        from scipy.linalg import cho_solve, solve

        free = row.sliding(held)
        while free.any():
            d = np.zeros_like(pull)
            own = np.ix_(free, free)
            for _ in range(2):  # the second iteration removes rounding errors
                rest = pull - self.A @ d
                d[free] += (
                    cho_solve(self.factor, rest)
                    if free.all()
                    else solve(self.A[own], rest[free], assume_a="pos")
                )
            still = row.still(d * np.diag(self.A), noise) & free
            if not still.any():
                return d
            free &= ~still
        return np.zeros_like(pull)
