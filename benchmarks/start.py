"""How soon a new declaration moves, and how fast: ``python benchmarks/start.py``.

The machine code of a system comes from LLVM alone, written from the tape; before, numba compiled
Python source printed from the same tape, as it does for a GPU now. Both roads in turn in one run:
seconds from a declaration that no cache knows to its first Trajectory (the engine is compiled
already), in this process and as a whole new one; nanoseconds for a Taylor series; seconds of a
motion. Minima of the rounds go to ``benchmarks/results/start.md`` with the machine named.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

import stickslip as ss
from stickslip.equations.codegen.compiled import source_module
from stickslip.equations.codegen.generate import generate
from stickslip.equations.derive import derive
from stickslip.equations.native import systems
from stickslip.motion.problem import Problem, pose
from stickslip.motion.simulate_many import follow_all

RESULTS = Path(__file__).parent / "results" / "start.md"
ROUNDS = 3
SERIES = 4000  # in one call
SPAN = (0.0, 20.0)
NEW: dict[str, Callable[[float], ss.System]] = {
    "spring slider, another law": lambda x: ss.catalogue.spring_slider(
        mu=f"0.5 + exp(-(alpha - 1)/{x})"
    ),
    "rocking toy, another friction": lambda x: ss.catalogue.rocking_toy(
        H_R=f"H_star/2*(1 + clip(psi/psi_star, -1, 1)) + {x}*psi**4"
    ),
    "chain of 5 blocks": lambda x: ss.catalogue.block_chain(N=5, belt=f"V + {x}*sin(t)"),
    "chain of 10 blocks": lambda x: ss.catalogue.block_chain(N=10, belt=f"V + {x}*sin(t)"),
    "chain of 40 blocks": lambda x: ss.catalogue.block_chain(N=40, belt=f"V + {x}*sin(t)"),
}
"""By a number that no cache knows."""
LARGE = "chain of 40 blocks"
"""Takes numba minutes: now alone."""
KNOWN: dict[str, tuple[ss.System, float]] = {
    "spring slider": (ss.catalogue.spring_slider(), 5000.0),
    "scaled slider": (ss.catalogue.scaled_slider(), 5000.0),
    "Prandtl-Tomlinson tip": (ss.catalogue.prandtl_tomlinson(), 100.0),
    "rocking toy": (ss.catalogue.rocking_toy(), 1000.0),
    "rocking toy with masses": (ss.catalogue.rocking_toy_inertial(), 1200.0),
    "play between oscillating walls": (ss.catalogue.oscillating_play(), 1000.0),
    "plate compactor": (ss.catalogue.plate_compactor(), 100.0),
    "chain of 5 blocks": (ss.catalogue.block_chain(N=5), 500.0),
}


def by_numba(system: ss.System) -> systems.CompiledSystem:
    """A system as it was compiled before."""
    equations = derive(system.declaration)
    generated = generate(equations)
    code = source_module(generated)
    functions = code.setup, code.jets, code.residual, code.powers
    return systems.CompiledSystem(equations, generated, *functions)


ROADS: dict[str, Callable[[ss.System], systems.CompiledSystem]] = {
    "before": by_numba,
    "now": systems.compile_system,
}


def first_motion(declared: Callable[[float], ss.System], road: str) -> float:
    """Seconds from a declaration to its first Trajectory."""
    number = round(float(np.random.default_rng().uniform(0.3, 0.4)), 12)
    begun = time.perf_counter()
    system = declared(number)
    systems.compile_system = ROADS[road]
    ss.simulate(system, SPAN)
    return time.perf_counter() - begun


def whole_process(name: str, road: str) -> float:
    """Seconds of a process that imports, declares, moves and stops."""
    script = f"import start; start.first_motion(start.NEW[{name!r}], {road!r})"
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, "STICKSLIP_CACHE": folder}
        begun = time.perf_counter()
        subprocess.run(
            [sys.executable, "-c", script], cwd=Path(__file__).parent, env=env, check=True
        )
        return time.perf_counter() - begun


@njit
def many_series(
    jets: Any, t: float, y: Any, mode: Any, region: Any, K: Any, space: Any, N: int, count: int
) -> None:
    """The same series again and again."""
    for _ in range(count):
        jets(t, y, mode, region, K, space.Rq, space.Rz, N, space.W, space.A, space.B, space.mag)


def posed(system: ss.System, road: str) -> Problem:
    """A problem with the machine code of a road, for Taylor steps."""
    problem = pose(system, exact=False)
    problem.__dict__["compiled"] = ROADS[road](system)
    return problem


def series(problem: Problem) -> float:
    """Seconds of a Taylor series."""
    space = problem.space()
    y = problem.initial_state({}) + 0.01
    for inverse in (space.Rq, space.Rz):
        inverse[:] = np.eye(*inverse.shape)
    mode, region = (np.zeros(len(rows), np.int64) for rows in (problem.rows.u, problem.rows.kinks))
    given = 0.3, y, mode, region, problem.constants.K, space, problem.order
    many_series(problem.compiled.jets, *given, 1)
    begun = time.perf_counter()
    many_series(problem.compiled.jets, *given, SERIES)
    return (time.perf_counter() - begun) / SERIES


def motion(problem: Problem, end: float) -> float:
    """Seconds of a motion by Taylor steps."""
    table = np.array([list(problem.parameters.values())])
    y = problem.initial_state({})[None]
    begun = time.perf_counter()
    follow_all(problem, table, y, (0.0, end), 10**7, 1)
    return time.perf_counter() - begun


def in_turn(rounds: int, measure: Callable[[str], float]) -> tuple[float, float]:
    """Least seconds of both roads."""
    found = [[measure(road) for road in ROADS] for _ in range(rounds)]
    before, now = np.min(found, axis=0)
    return float(before), float(now)


def starts() -> list[str]:
    """From a declaration to its first Trajectory."""
    ss.simulate(ss.catalogue.rocking_toy(), SPAN)  # the engine
    ss.simulate(ss.catalogue.spring_slider(), SPAN)
    lines = [
        "| a new declaration → its first Trajectory | before, s | now, s | ratio | whole process "
        "before, s | now, s |",
        "|---|---|---|---|---|---|",
    ]
    for name, declared in NEW.items():
        if name == LARGE:
            now = min(first_motion(declared, "now") for _ in range(ROUNDS))
            process = min(whole_process(name, "now") for _ in range(ROUNDS))
            lines.append(f"| {name} | minutes | {now:.3f} | | minutes | {process:.2f} |")
            continue
        before, now = in_turn(ROUNDS, lambda road, f=declared: first_motion(f, road))
        whole = in_turn(ROUNDS, lambda road, name=name: whole_process(name, road))
        lines.append(
            f"| {name} | {before:.2f} | {now:.3f} | {now / before:.3f} | {whole[0]:.2f} | "
            f"{whole[1]:.2f} |"
        )
        print(lines[-1], flush=True)
    return lines


def speeds() -> list[str]:
    """Series and motions."""
    lines = [
        "| Taylor steps | series before, ns | now, ns | ratio | motion before, ms | now, ms | "
        "ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, (system, end) in KNOWN.items():
        problems = {road: posed(system, road) for road in ROADS}
        a, b = in_turn(20, lambda road, p=problems: series(p[road]))
        c, d = in_turn(25, lambda road, p=problems, end=end: motion(p[road], end))
        lines.append(
            f"| {name}, t = {end:g} | {1e9 * a:.0f} | {1e9 * b:.0f} | {b / a:.2f} | {1e3 * c:.2f} "
            f"| {1e3 * d:.2f} | {d / c:.2f} |"
        )
        print(lines[-1], flush=True)
    return lines


def main() -> None:
    """Run everything, print it and keep it."""
    from motion import machine  # here, so that a new process does not import all rivals

    lines = ["# How soon a new declaration moves", "", machine(), "", *starts(), "", *speeds(), ""]
    print("\n".join(lines))
    RESULTS.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
