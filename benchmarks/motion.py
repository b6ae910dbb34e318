"""Speed and error of the motion, all tools in one run: ``python benchmarks/motion.py``.

Three motions with 30-digit reference values, each by every tool in turn, medians of interleaved
rounds. stickslip stands in the table twice: one ``simulate`` with everything a user gets, and the
compiled loop itself, measured over a batch of equal motions (so that the call from Python, about
the same for every tool, does not hide it). The rivals' times are those of prepared integrators,
told beforehand which boundary ends which mode.

The second table is the cold start: whole processes that import, integrate one motion and stop. The
third one is about impacts (``benchmarks/impacts.py``); ``python benchmarks/motion.py impacts``
measures it alone and leaves the others as they are, as ``planes`` does with the fourth, about
friction in a plane (``benchmarks/planes.py``).

The tables go to ``benchmarks/results/motion.md`` with the machine named.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np

import impacts
import planes
import stickslip as ss
from reference_values import PROBLEMS
from rivals import ABSENT, RIVALS, time_interleaved

# motions in one call, so many that making the closed forms does not count
BATCH = {"A": 2000, "B": 30000, "C": 10000}
IMPACTS = "## Impacts"
PLANES = "## Friction in a plane"
RESULTS = Path(__file__).parent / "results" / "motion.md"
SLIDER = {"mu": "0.5 + exp(-(alpha - 1)/0.4)", "V": 0.18, "nu": 0.02}
SYSTEMS: dict[str, tuple[ss.System, dict[str, float]]] = {
    "A": (ss.catalogue.spring_slider(**SLIDER), {"U": 0.5, "alpha": 1.0}),
    "B": (
        ss.catalogue.scaled_slider_limit(nu=1e-3, b=0.5, mu_0=1.0, v_hat=1.0),
        {"beta": 0.0, "gamma": 0.4},
    ),
    "C": (ss.catalogue.rocking_toy(), {"psi": -1.67, "x_R": 0.5, "x_L": 0.0}),
}
# The loosest of a scan from which on the error stays below 1e-10, as for the rivals.
RTOL = {"A": 5e-6, "B": 1e-6, "C": 1e-6}
COLD = {
    "stickslip": "import stickslip as ss; ss.simulate(ss.catalogue.rocking_toy(), (0.0, 63.0))",
    "SciPy": (
        "import numpy as np; from scipy.integrate import solve_ivp\n"
        "def f(t, y): return [y[1], -0.04*y[1] - y[0] + 0.15*np.sign(y[1])]\n"
        "def turn(t, y): return y[1]\n"
        "turn.terminal = True\n"
        "t, y = 0.0, [-1.67, 1e-9]\n"
        "while t < 63.0:\n"
        "    s = solve_ivp(f, (t, 63.0), y, method='DOP853', rtol=1e-10, atol=1e-10, events=turn)\n"
        "    t, y = s.t[-1], [s.y[0, -1], -1e-9*np.sign(s.y[0, -1])]\n"
    ),
}


def one_call(key: str) -> Callable[[], tuple[np.ndarray, int]]:
    """``simulate`` with its result, ready to be timed."""
    system, initial = SYSTEMS[key]
    problem = PROBLEMS[key]

    def run() -> tuple[np.ndarray, int]:
        trajectory = ss.simulate(system, (0.0, problem.span), initial=initial, rtol=RTOL[key])
        switches = trajectory.n_switches if system.contacts else trajectory.n_kinks
        return np.array([trajectory.final[name] for name in problem.variables]), switches

    return run


def batch(key: str) -> Callable[[], tuple[np.ndarray, int]]:
    """The compiled loop over a batch of equal motions on one core."""
    from stickslip.motion.problem import pose
    from stickslip.motion.simulate_many import follow_all as advance

    system, initial = SYSTEMS[key]
    reference = PROBLEMS[key]
    problem = pose(system, rtol=RTOL[key])
    states = np.tile(problem.initial_state(initial), (BATCH[key], 1))
    table = np.tile(list(problem.parameters.values()), (BATCH[key], 1))
    order = [system.declaration.state.index(name) for name in reference.variables]

    def run() -> tuple[np.ndarray, int]:
        now, *_ = advance(problem, table, states, (0.0, reference.span), 10**6, 1)
        switches = now.counters[0, 1] if system.contacts else now.counters[0, 3]
        return now.y[0, order], int(switches)

    return run


def motions() -> list[str]:
    """Table of the three motions."""
    lines = [
        "| motion | tool | µs per cycle | times stickslip (loop) | error | switches |",
        "|---|---|---|---|---|---|",
    ]
    for key, problem in PROBLEMS.items():
        runs = {"stickslip, loop": batch(key), "stickslip, simulate": one_call(key)}
        runs |= {name: rivals[key].prepare() for name, rivals in RIVALS.items() if key in rivals}
        results = {name: run() for name, run in runs.items()}
        seconds = time_interleaved(runs)
        cycles = {
            name: problem.cycles * (BATCH[key] if name.endswith("loop") else 1) for name in runs
        }
        own = seconds["stickslip, loop"] / cycles["stickslip, loop"]
        for name, spent in seconds.items():
            state, switches = results[name]
            lines.append(
                f"| {problem.title} | {name} | {spent / cycles[name] * 1e6:.2f} | "
                f"{spent / cycles[name] / own:.1f} |"
                f" {problem.error(state):.1e} | {switches} |"
            )
    return lines


def cold_start(rounds: int = 5) -> list[str]:
    """Table of whole processes, in turn; the kernels of stickslip are cached by a first run."""
    spent: dict[str, list[float]] = {name: [] for name in COLD}
    for turn in range(rounds + 1):
        for name, code in COLD.items():
            began = time.perf_counter()
            subprocess.run([sys.executable, "-W", "ignore", "-c", code], check=True)
            if turn > 0:
                spent[name].append(time.perf_counter() - began)
    with tempfile.TemporaryDirectory() as empty:
        began = time.perf_counter()
        caches = {**os.environ, "NUMBA_CACHE_DIR": empty, "STICKSLIP_CACHE": empty}
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", COLD["stickslip"]], check=True, env=caches
        )
        first = time.perf_counter() - began
    base = median(spent["SciPy"])
    lines = [
        "| process: import and one motion of the toy | seconds | times SciPy |",
        "|---|---|---|",
    ]
    lines += [
        f"| {name} | {median(times):.2f} | {median(times) / base:.2f} |"
        for name, times in spent.items()
    ]
    return [*lines, f"| stickslip, nothing compiled yet | {first:.1f} | {first / base:.1f} |"]


def machine() -> str:
    """The machine in words."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        model = next(
            (
                line.split(":")[1].strip()
                for line in cpuinfo.read_text().splitlines()
                if line.startswith("model name")
            ),
            model,
        )
    software = f"Python {platform.python_version()}, stickslip {ss.__version__}"
    return f"{model}, {os.cpu_count()} cores, {platform.system()}, {software}"


def main() -> None:
    """Run everything, or one of the later parts alone; print it and keep it."""
    RESULTS.parent.mkdir(exist_ok=True)
    alone = sys.argv[1] if len(sys.argv) > 1 else ""
    kept = RESULTS.read_text() if alone else ""
    first, _, rest = kept.partition(IMPACTS)
    second, _, third = rest.partition(PLANES)
    absent = [f"{name} was not measured: {reason}" for name, reason in ABSENT.items()]
    parts = [
        first.strip()
        if alone
        else "\n".join(
            [
                "# Motion: time and error",
                "",
                machine(),
                "",
                *motions(),
                "",
                *cold_start(),
                "",
                *absent,
            ]
        )
    ]
    for name, heading, before, table in (
        ("impacts", IMPACTS, second, impacts.table),
        ("planes", PLANES, third, planes.table),
    ):
        if alone in ("", name):
            body = "\n".join([machine(), "", *table(time_interleaved)])
        else:
            body = before.strip()
        parts.append(f"{heading}\n\n{body}")
    text = "\n\n".join(parts) + "\n"
    RESULTS.write_text(text)
    print(text)


if __name__ == "__main__":
    main()
