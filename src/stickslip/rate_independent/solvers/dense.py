"""Steps with a small dense A: ξ = proj_K(ℓ − A z) in the metric of A⁻¹, then z moves by A⁻¹(ℓ − A z − ξ)."""

from __future__ import annotations

import numpy as np

from stickslip.rate_independent.dissipation import Dissipation
from stickslip.rate_independent.stable_sets import Boxes, ConvexSets

Array = np.ndarray
ROUNDING = 1e-14  # of a force, relative to the largest of its parts
BLOCK = 400_000  # numbers in one array of a block of steps


class BoxSteps:
    """Weighted ℓ1: boxes K(s), by an active set; signs and factor of the moving components are kept from step to step.

    Parameters
    ----------
    A : array, shape (n, n)
    """

    def __init__(self, A: Array) -> None:
        n = len(A)
        self.A, self.factor, self.order = np.array(A, order="C"), np.zeros((n, n)), np.zeros(n, np.int64)
        self.signs, self.count = np.zeros(n, np.int64), np.zeros(2, np.int64)
        self.block = max(1, min(4096, BLOCK // n))

    def advance(self, z: Array, loads: Array, sets: Boxes) -> tuple[Array, Array]:
        """States after each load (as far as the solver came), and the changes of sign each took."""
        from stickslip.rate_independent.solvers.active_set import advance

        states, effort = np.empty_like(loads), np.zeros(len(loads), np.int64)
        # Arrays of one kind (contiguous, writeable): the loop is compiled once.
        loads, lower, upper = (np.require(table, requirements=["C", "W"]) for table in (loads, sets.lower, sets.upper))
        face = self.factor, self.order, self.signs, self.count
        done = advance(self.A, *face, z.copy(), loads, lower, upper, states, effort)
        return states[:done], effort[:done]


class ProjectionSteps:
    """Any potential whose K(s) is not a product, by its own projection in the metric of A⁻¹, which is made once.

    Parameters
    ----------
    A : array, shape (n, n)
    dissipation : Dissipation
    """

    def __init__(self, A: Array, dissipation: Dissipation) -> None:
        from scipy.linalg import cho_factor, cho_solve

        self.A, self.dissipation, self.block = A, dissipation, 64
        inverse = cho_solve(cho_factor(A), np.eye(len(A)))
        self.metric = (inverse + inverse.T) / 2.0

    def advance(self, z: Array, loads: Array, sets: ConvexSets) -> tuple[Array, Array]:
        """States after each load, and 1 for each step that moved."""
        states, effort, size = np.empty_like(loads), np.zeros(len(loads), np.int64), float(sets.size()[0])
        for k, (load, s) in enumerate(zip(loads, np.broadcast_to(sets.phases, len(loads)).tolist(), strict=True)):
            elastic = self.A @ z
            force, noise = load - elastic, ROUNDING * (np.abs(load).max() + np.abs(elastic).max() + size)
            if self.dissipation.distance(force, s) > noise:
                z = z + self.metric @ (force - self.dissipation.project(force, s, self.metric))
                effort[k] = 1
            states[k] = z
        return states, effort
