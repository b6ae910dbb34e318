"""The large sparse step by active sets, beside the multigrid step: ``python
benchmarks/evolution_active_sets.py``.

A primal-dual active-set method (semismooth Newton) fixes which nodes move and in which direction,
solves the linear system of the moving nodes with conjugate gradients, and repeats until the signs
are final. The preconditioner is one cycle of pyamg's smoothed aggregation for the whole matrix,
restricted to the moving nodes, so that no hierarchy is built in a step. Both methods start from the
increment of the previous step.
"""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numpy as np
import pyamg
import scipy.sparse.linalg as linalg

from evolution import GRIDS, TOLERANCE, Membrane, timed
from stickslip.arrays import Array
from stickslip.rate_independent.solvers.multigrid import Multigrid

_MOST = 60  # linear solves after which the signs are taken to cycle


class Found(NamedTuple):
    """Increment, and number of linear solves and of their iterations."""

    delta: Array
    solves: int
    iterations: int


def by_active_sets(A: Any, cycle: Any, r: Array, lower: Array, upper: Array, start: Array) -> Found:
    """One minimising-movement step."""
    d = start.copy()
    diagonal = A.diagonal()
    signs = None
    iterations = 0
    for solves in range(_MOST):
        force = r - A @ d
        up = d * diagonal + force > upper
        down = d * diagonal + force < lower
        found = up.astype(int) - down.astype(int)
        if signs is not None and np.array_equal(found, signs):
            return Found(d, solves, iterations)
        signs = found
        moving = np.flatnonzero(signs)
        part = A[moving][:, moving]
        whole = np.zeros(len(r))

        def restricted(v: Array, whole: Array = whole, moving: Array = moving) -> Array:
            whole[moving] = v
            return cycle.matvec(whole)[moving]

        def count(_: Array) -> None:
            nonlocal iterations
            iterations += 1

        x, _ = linalg.cg(
            part,
            (r - np.where(signs > 0, upper, lower))[moving],
            x0=d[moving],
            rtol=0.0,
            atol=0.1 * TOLERANCE * upper.max(),
            M=linalg.LinearOperator(part.shape, restricted),
            callback=count,
        )
        d = np.zeros(len(r))
        d[moving] = x
    return Found(d, _MOST, iterations)


def main(steps: int = 4) -> None:
    """Print a row for each step."""
    print("| unknowns | steps a period | multigrid, s | active sets, s | solves (CG) | ratio |")
    print("|---|---|---|---|---|---|")
    for N in [GRIDS[int(float(x))] for x in sys.argv[1:] or ["1e4", "1e5"]]:
        problem = Membrane.scalar(N)
        own = Multigrid(problem.A, groups=1)
        hierarchy = pyamg.smoothed_aggregation_solver(problem.A)
        cycle = hierarchy.aspreconditioner(cycle="V")
        for per_period in (50, 5):
            previous = np.zeros(N * N)
            for r, K, proceed in problem.steps(per_period, steps):
                seconds, step = timed(
                    lambda: own.step(r, **K, start=previous, tolerance=TOLERANCE)  # noqa: B023
                )
                rival, other = timed(
                    lambda: by_active_sets(problem.A, cycle, r, **K, start=previous)  # noqa: B023
                )
                final = "" if other.solves < _MOST else ", not final"
                print(
                    f"| {N * N} | {per_period} | {seconds:.2f} | {rival:.2f} | "
                    f"{other.solves} ({other.iterations}){final} | {rival / seconds:.0f} |",
                    flush=True,
                )
                proceed(step.delta)
                previous = step.delta


if __name__ == "__main__":
    main()
