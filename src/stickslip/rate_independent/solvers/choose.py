"""The choice of the solver."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.rate_independent.solvers.dense import BoxSteps, ProjectionSteps

if TYPE_CHECKING:
    from stickslip.rate_independent.evolution.evolution import Evolution

_SMALL = 800  # number of rows up to which a sparse matrix is treated as dense
_SMALL_GROUPS = 100  # … with friction in groups
_BLOCK = 20_000  # number of entries of an array of a block of multigrid steps
_DENSE = 4000  # largest number of rows of a matrix that is treated as dense


class StepSolver(Protocol):
    """Minimising-movement steps of one problem, many at a time."""

    block: int  # steps that are made in one call, at most

    def advance(self, z: Array, loads: Array, sets: Any) -> tuple[Array, Array]:
        """States after each load (k, n), k at most the number of loads, and the effort of each step
        (k,)."""
        ...


def choose_solver(problem: Evolution, name: str | None, tolerance: float) -> StepSolver:
    """The solver of a given name, or a suitable one for the problem.

    Parameters
    ----------
    name : {None, "dense", "multigrid"}
        None: multigrid where K is a product of intervals or balls and A is sparse, with more than
        800 or 100 rows; otherwise dense.
    tolerance : float
        KKT residual relative to the largest weight.

    Raises
    ------
    DeclarationError
        If that solver cannot treat the problem.
    """
    from scipy import sparse

    A, psi = problem.A, problem.dissipation
    together = problem.sets(np.array(problem.span[:1])).together
    if name is None:
        many = problem.n > (_SMALL if together == 1 else _SMALL_GROUPS)
        name = "multigrid" if together and sparse.issparse(A) and many else "dense"
    if name == "multigrid" and together:
        return MultigridSteps(sparse.csr_array(A), together, tolerance)
    if name != "dense":
        able = "dense or multigrid" if together else "dense"
        raise DeclarationError(
            "solver", f"{name!r} does not support {type(psi).__name__}", f"Use {able}"
        )
    if problem.n > _DENSE:
        raise DeclarationError(
            "A",
            f"{problem.n} rows are too many for the dense solver",
            "Use a sparse A with WeightedL1 or GroupNorm",
        )
    dense = A.toarray() if sparse.issparse(A) else A
    return BoxSteps(dense) if together == 1 else ProjectionSteps(dense)


class MultigridSteps:
    """Large sparse A with boxes or balls K; a step starts from the increment of the previous one.

    Parameters
    ----------
    A : sparse array, shape (n, n)
    together : int
        Size of the groups of components with a common threshold.
    tolerance : float
        KKT residual relative to the largest weight.
    """

    def __init__(self, A: Any, together: int, tolerance: float) -> None:
        from stickslip.rate_independent.solvers.multigrid import Multigrid

        self.A = A
        self.tolerance = tolerance
        self.block: int = max(1, min(64, _BLOCK // A.shape[0]))
        self.solver: Multigrid = Multigrid(A, groups=together)
        self.previous: Array | None = None

    def advance(self, z: Array, loads: Array, sets: Any) -> tuple[Array, Array]:
        """The state after each load, and the cycles each took."""
        states = np.empty_like(loads)
        effort = np.zeros(len(loads), np.int64)
        for k, load in enumerate(loads):
            step = self.solver.step(
                load - self.A @ z,
                **sets.weights(k),
                start=self.previous,
                tolerance=self.tolerance,
            )
            self.previous = step.delta
            z = states[k] = z + step.delta
            effort[k] = step.cycles
        return states, effort
