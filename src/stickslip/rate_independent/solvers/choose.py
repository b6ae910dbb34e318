"""Which solver makes the steps of which problem."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from stickslip.errors import DeclarationError
from stickslip.rate_independent.dissipation import GroupNorm, WeightedL1
from stickslip.rate_independent.solvers.dense import BoxSteps, ProjectionSteps

if TYPE_CHECKING:
    from stickslip.rate_independent.evolution.evolution import Evolution

Array = np.ndarray
SMALL = 800  # rows up to which a sparse matrix is treated as a dense one
SMALL_GROUPS = 100  # … with friction in groups
BLOCK = 20_000  # numbers in one array of a block of multigrid steps
DENSE = 4000  # rows up to which one may be


class Steps(Protocol):
    """Minimising-movement steps of one problem, many at a time."""

    block: int  # steps that are made in one call, at most

    def advance(self, z: Array, loads: Array, sets: Any) -> tuple[Array, Array]:
        """States after each load (k, n), k at most the number of loads, and the effort of each step
        (k,)."""
        ...


def choose_solver(problem: Evolution, name: str | None, tolerance: float) -> Steps:
    """The solver of that name, or the one that suits the problem.

    Parameters
    ----------
    problem : Evolution
    name : {None, "dense", "multigrid"}
        None: multigrid for WeightedL1 and GroupNorm with a sparse A of more than 800 and 100 rows;
        otherwise dense.
    tolerance : float
        KKT residual relative to the largest weight.

    Raises
    ------
    DeclarationError
        If that solver cannot treat the problem.
    """
    from scipy import sparse

    A, psi = problem.A, problem.dissipation
    boxes, groups = isinstance(psi, WeightedL1), isinstance(psi, GroupNorm)
    if name is None:
        many = problem.n > (SMALL if boxes else SMALL_GROUPS)
        name = "multigrid" if (boxes or groups) and sparse.issparse(A) and many else "dense"
    if name == "multigrid" and isinstance(psi, WeightedL1 | GroupNorm):
        return MultigridSteps(sparse.csr_array(A), psi, tolerance)
    if name != "dense":
        able = "dense or multigrid" if boxes or groups else "dense"
        raise DeclarationError(
            "solver", f"{name!r} cannot treat {type(psi).__name__}", f"Use {able}"
        )
    if problem.n > DENSE:
        raise DeclarationError(
            "A",
            f"{problem.n} rows are too many for the dense solver",
            "Use a sparse A with WeightedL1 or GroupNorm",
        )
    dense = A.toarray() if sparse.issparse(A) else A
    return BoxSteps(dense) if boxes else ProjectionSteps(dense)


class MultigridSteps:
    """Large sparse A with WeightedL1 or GroupNorm; a step starts from the increment of the one
    before."""

    def __init__(self, A: Any, dissipation: WeightedL1 | GroupNorm, tolerance: float) -> None:
        from stickslip.rate_independent.solvers.multigrid import Multigrid

        self.A = A
        self.tolerance = tolerance
        self.block = max(1, min(64, BLOCK // A.shape[0]))
        self.groups = dissipation.size if isinstance(dissipation, GroupNorm) else 1
        self.solver = Multigrid(A, groups=self.groups)
        self.previous: Array | None = None

    def advance(self, z: Array, loads: Array, sets: Any) -> tuple[Array, Array]:
        """The state after each load, and the cycles each took."""
        states = np.empty_like(loads)
        effort = np.zeros(len(loads), np.int64)
        for k, load in enumerate(loads):
            row = k if len(sets.size()) > 1 else 0
            K = (
                {"radii": sets.radii[row]}
                if self.groups > 1
                else {"lower": sets.lower[row], "upper": sets.upper[row]}
            )
            step = self.solver.step(
                load - self.A @ z, **K, start=self.previous, tolerance=self.tolerance
            )
            self.previous = step.delta
            z = states[k] = z + step.delta
            effort[k] = step.cycles
        return states, effort
