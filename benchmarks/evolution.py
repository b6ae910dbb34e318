"""Rate-independent evolution against its rivals, all in one run: ``python
benchmarks/evolution.py``.

1. The play operator against a clamp triad over the same arrays (``evolution_play.py``).
2. One minimising-movement step of a membrane, −Δ_h + 1 on a square grid, with a threshold that
   travels over it as a wave, as a multiple of one smoothed-aggregation CG solve with the same
   matrix to the relative residual 1e-8: steps and solves in turn, the same right-hand sides r,
   medians. The hierarchies are made before, on both sides. pyamg's classical hierarchy, the one
   that the step uses, is a second, harder measure.
3. The same with vector friction: two such membranes coupled by friction only, and plane elasticity.
4. The same steps by general solvers of quadratic programs, `evolution_qp.py`.

The tables go to ``benchmarks/results/evolution.md`` with the machine named.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pyamg
import scipy.sparse as sp

from evolution_play import play_table, whole_play_table
from evolution_qp import WAYS, Way
from motion import machine
from stickslip.arrays import Array
from stickslip.rate_independent.solvers.multigrid import Multigrid

RESULTS = Path(__file__).parent / "results" / "evolution.md"
GRIDS = {10**4: 100, 10**5: 316, 10**6: 1000}
RESOLUTIONS = (50, 5)  # steps in one period of the wave
ROUNDS = 10
TOLERANCE = 1e-8


@dataclass
class Membrane:
    """−Δ_h + 1 on N² points of the unit square, load and threshold smooth functions of place and
    time.

    Attributes
    ----------
    A : sparse array
    x, y : array (nodes,)
        Coordinates.
    components : int
        1, or 2 for vector friction.
    near_kernel : array or None
        What pyamg is told of the matrix: rigid motions.
    """

    A: Any
    x: Array
    y: Array
    components: int = 1
    near_kernel: Array | None = None

    @classmethod
    def scalar(cls, N: int) -> Membrane:
        laplace = pyamg.gallery.poisson((N, N), format="csr") * float((N + 1) ** 2)
        line = np.arange(1, N + 1) / (N + 1)
        x, y = (part.ravel() for part in np.meshgrid(line, line, indexing="ij"))
        return cls(sp.csr_array(laplace + sp.eye_array(N * N)), x, y)

    @classmethod
    def pair(cls, N: int) -> Membrane:
        one = cls.scalar(N)
        return cls(sp.csr_array(sp.kron(one.A, np.eye(2))), one.x, one.y, 2)

    @classmethod
    def elastic(cls, N: int) -> Membrane:
        stiffness, rigid = pyamg.gallery.linear_elasticity((N, N), format="csr", E=1.0, nu=0.3)
        A = sp.csr_array(stiffness * float((N + 1) ** 2) + sp.eye_array(2 * N * N))
        one = cls.scalar(N)
        return cls(A, one.y, one.x, 2, rigid)

    def threshold(self, t: float) -> Array:
        """A wave of unit speed and wave length."""
        return 1.0 + 0.8 * np.cos(2 * np.pi * (self.x - t))

    def load(self, t: float) -> Array:
        """One that moves part of the membrane and turns around after two periods of the wave; a
        vector also rotates."""
        size = (
            2.0
            * np.sin(np.pi * t / 2)
            * (1 + 0.5 * np.sin(2 * np.pi * self.y) * np.cos(np.pi * self.x))
        )
        angle = 2 * np.pi * t / 3 + self.x
        return (
            size
            if self.components == 1
            else (size * np.stack([np.cos(angle), np.sin(angle)])).T.ravel()
        )

    def steps(
        self, per_period: int, count: int
    ) -> Iterator[tuple[Array, dict[str, Any], Callable[[Array], None]]]:
        """Steps of an evolution: r, the stable set, and a function that takes the increment and
        goes on."""
        t = 0.3
        force, weight = self.load(t), self.threshold(t)
        length = np.sqrt(np.square(force.reshape(-1, self.components)).sum(axis=1))
        force = force * np.repeat(np.minimum(1.0, weight / length), self.components)
        for _ in range(count):
            r = force + self.load(t + 1.0 / per_period) - self.load(t)
            t += 1.0 / per_period
            weight = self.threshold(t)
            K = {"radii": weight} if self.components == 2 else {"lower": -weight, "upper": weight}
            increments: list[Array] = []
            yield r, K, increments.append
            force = r - self.A @ increments[0]


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds and result."""
    began = time.perf_counter()
    result = call()
    return time.perf_counter() - began, result


def against_linear_solves(title: str, problem: Membrane) -> list[str]:
    """Rows of the table: step, solve, ratio."""
    solver = Multigrid(problem.A, groups=problem.components)
    matrix = problem.A if problem.components == 1 else problem.A.tobsr((2, 2))
    linear = {"aggregation": pyamg.smoothed_aggregation_solver(matrix, B=problem.near_kernel)}
    if problem.components == 1:
        linear["classical"] = pyamg.ruge_stuben_solver(matrix)
    lines = []
    for per_period in RESOLUTIONS:
        spent: dict[str, list[float]] = {name: [] for name in ("step", *linear)}
        cycles = []
        moving = []
        residuals = []
        iterations = []
        for number, (r, K, go_on) in enumerate(problem.steps(per_period, ROUNDS + 1)):
            seconds, step = timed(lambda: solver.step(r, **K, tolerance=TOLERANCE))  # noqa: B023
            go_on(step.delta)
            for name, ml in linear.items():
                history: list[float] = []
                solve, _ = timed(lambda: ml.solve(r, tol=1e-8, accel="cg", residuals=history))  # noqa: B023
                if number:
                    spent[name].append(solve)
                    iterations += [len(history) - 1] if name == "aggregation" else []
            if number:  # the first of each warms up
                spent["step"].append(seconds)
                cycles.append(step.cycles)
                residuals.append(step.residual)
                moving.append(step.delta.reshape(-1, problem.components).any(axis=1).mean())
        seconds = {name: median(times) for name, times in spent.items()}
        harder = f"{seconds['step'] / seconds['classical']:.2f}" if "classical" in seconds else ""
        lines.append(
            f"| {title} | {problem.A.shape[0]} | {per_period} | {min(moving):.0%} to "
            f"{max(moving):.0%} |"
            f" {median(cycles):.0f} (at most {max(cycles)}) | {max(residuals):.0e} | "
            f"{seconds['step']:.3f} |"
            f" {seconds['aggregation']:.3f} ({median(iterations):.0f}) |"
            f" **{seconds['step'] / seconds['aggregation']:.2f}** | {harder} |"
        )
        print(lines[-1], flush=True)
    return lines


def steps_table() -> list[str]:
    """Scalar and vector friction."""
    lines = [
        "| problem | unknowns | steps per period | moving | cycles per step | residual, worst | "
        "seconds per step | seconds per CG solve (iterations) | "
        "step / CG solve | step / CG solve, classical hierarchy "
        "|",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for N in GRIDS.values():
        lines += against_linear_solves("membrane", Membrane.scalar(N))
    lines += against_linear_solves("vector friction, two membranes", Membrane.pair(316))
    lines += against_linear_solves("vector friction, plane elasticity", Membrane.elastic(316))
    return lines


def programs_table(rounds: int = 4) -> list[str]:
    """The same steps by solvers of quadratic programs, at 10⁴ unknowns; of each, its fastest way to
    the residual."""
    problem = Membrane.scalar(GRIDS[10**4])
    solver = Multigrid(problem.A)
    own: list[tuple[float, float]] = []
    theirs: dict[str, dict[Way, list[tuple[float, float]]]] = {
        name: {way: [] for way in ways} for name, ways in WAYS.items()
    }
    for number, (r, K, go_on) in enumerate(problem.steps(RESOLUTIONS[0], rounds + 1)):
        seconds, step = timed(lambda: solver.step(r, **K, tolerance=TOLERANCE))  # noqa: B023
        go_on(step.delta)
        if number:  # the first warms up
            own.append((seconds, step.residual))
            for ways in theirs.values():
                for way, found in ways.items():
                    found.append(way.solve(problem.A, r, K["upper"]))
    lines = [
        "| solver | setting | seconds per step | times stickslip | KKT residual, worst |",
        "|---|---|---|---|---|",
    ]
    unit = seconds_and_residual(own)[0]
    for name, ways in {"stickslip": {"": own}, **theirs}.items():
        measured = {str(way): seconds_and_residual(found) for way, found in ways.items()}
        # The fastest within the tolerance; if there is none, the one of least residual.
        way, (seconds, error) = min(
            measured.items(), key=lambda m: (max(m[1][1], TOLERANCE), m[1][0])
        )
        lines.append(f"| {name} | {way} | {seconds:.3f} | {seconds / unit:.1f} | {error:.0e} |")
    return lines


def seconds_and_residual(found: list[tuple[float, float]]) -> tuple[float, float]:
    """Median of the first, worst of the second."""
    return median(seconds for seconds, _ in found), max(error for _, error in found)


def memory() -> str:
    """Largest memory of a process that makes a million unknowns, their hierarchy and three
    steps."""
    code = "import evolution; evolution.only_steps()"
    found = subprocess.run(
        [sys.executable, "-c", code],
        check=True,
        capture_output=True,
        text=True,
        cwd=RESULTS.parents[1],
    )
    gigabytes = float(found.stdout)
    return f"Peak memory of the process with 10⁶ unknowns: {gigabytes:.2f} GB."


def only_steps() -> None:
    """What `memory` measures; prints gigabytes."""
    problem = Membrane.scalar(GRIDS[10**6])
    solver = Multigrid(problem.A)
    for r, K, go_on in problem.steps(RESOLUTIONS[0], 3):
        go_on(solver.step(r, **K).delta)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6)


def main() -> None:
    """Run everything, print it and keep it."""
    largest = memory()  # first: what this process holds would count as its child's
    parts = [
        ["# Rate-independent evolution: time, cycles, memory"],
        [machine()],
        ["## The play operator", "", *play_table(), "", *whole_play_table()],
        ["## One step against one linear solve", "", *steps_table(), "", largest],
        ["## One step against solvers of quadratic programs, 10⁴ unknowns", "", *programs_table()],
    ]
    text = "\n\n".join("\n".join(part) for part in parts) + "\n"
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(text)
    print(text)


if __name__ == "__main__":
    main()
