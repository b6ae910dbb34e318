"""Branches of the spring slider beside AUTO-07p, in one run: ``python benchmarks/orbits.py``.

(3.3) with μ̃ = 2/√α and ν = 0.05, V from 0.02 to 0.5: the equilibria with their Hopf point, and the
cycles from there through the stick onset and the fold down to V = 0.02. AUTO discretises a cycle by
collocation, so its table has one line per number of mesh intervals. Errors are those of the period
and of the multiplier that is not 1 against 30-digit values; the last column needs none: along the
whole branch one multiplier is exactly 1.

Seconds are the median of calls in one process: of following a branch, certificates of all points
included, and of the same with the table of all that is said of its points, which is made when it is
first asked for. A first call, after the import, loads machine code and reads formulas; it is
measured with the table, in a process of its own. The branch of gaits of the rocking toy (4.2) over
P has no rival.

AUTO prints 11 digits of V and of the period, 6 of a multiplier; its period is corrected to the V it
was asked for.
"""

from __future__ import annotations

import platform
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import stickslip as ss
from auto_07p import Auto, Row, absent
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.cycles.find_cycle import find_cycle

RESULTS = Path(__file__).parent / "results" / "orbits.md"
SLIDER = ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)
TOY = ss.catalogue.rocking_toy(P=1.2)
SPAN = (0.02, 0.5)
HOPF = 0.224849301296112
MESHES = (50, 100, 400, 1600, 6400)
# V: period and multiplier of the cycle that sticks, by oracles/spring_slider.py of the tests.
STICKING = {
    0.15: (3.3196883202385111208732909032, 0.154680464189181579204556023096),
    0.02: (21.8170197631315246929990914424, 2.1908101879406323723384970771e-8),
}


FIRST = """
import time
import stickslip as ss
from orbits import {name}
began = time.perf_counter()
{name}().points
print(time.perf_counter() - began)
"""


def equilibria() -> Any:
    """The branch of equilibria."""
    return ss.continue_equilibrium(SLIDER, "V", SPAN)


def cycles() -> Any:
    """The branch of cycles, from its Hopf point."""
    return continue_cycle(find_cycle(SLIDER, equilibria().of_kind("Hopf")[0]), "V", SPAN)


def gaits() -> Any:
    """The branch of gaits of the toy, from one of them."""
    return continue_cycle(find_cycle(TOY), "P", (0.8, 1.5))


def first_call(name: str) -> float:
    """Seconds that a function takes in a new process."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST.format(name=name)],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout)


def timed_branch(run: Callable[[], ss.Branch]) -> tuple[str, ss.Branch]:
    """Seconds of following a branch, and of the same with its table, as cells; and the branch."""
    seconds, branch = timed(run)
    whole, _ = timed(lambda: run().points)
    return f"{seconds:.4f} | {whole:.4f}", branch


def timed(run: Callable[[], Any], rounds: int = 5) -> tuple[float, Any]:
    """Median of the seconds, and the result."""
    spent = []
    result = None
    for _ in range(rounds):
        began = time.perf_counter()
        result = run()
        spent.append(time.perf_counter() - began)
    return median(spent), result


def own() -> list[str]:
    """stickslip's lines."""
    seconds, branch = timed_branch(equilibria)
    hopf = branch.of_kind("Hopf")[0]
    lines = [
        equilibrium_line("stickslip", seconds, len(branch.points.point), hopf.value, "equilibria")
    ]
    seconds, found = timed_branch(lambda: continue_cycle(find_cycle(SLIDER, hopf), "V", SPAN))
    errors = []
    for V, (period, multiplier) in STICKING.items():
        cycle = find_cycle(SLIDER, parameters={"V": V})
        errors.append(
            (abs(cycle.period / period - 1), abs(float(cycle.nontrivial[0].real) - multiplier))
        )
    multipliers = (
        found.points["multiplier_real"].values + 1j * found.points["multiplier_imag"].values
    )
    points = len(found.points.point)
    lines.append(cycle_line("stickslip", seconds, points, errors, multipliers, "cycles"))
    toy = find_cycle(TOY)
    seconds, found = timed_branch(lambda: continue_cycle(toy, "P", (0.8, 1.5)))
    first = f"{first_call('gaits'):.3f}"
    points = len(found.points.point)
    return [*lines, f"| gaits of (4.2) | stickslip | {seconds} | {first} | {points} | | | | |"]


def rival(auto: Auto) -> list[str]:
    """AUTO's lines."""
    seconds, (_, rows) = timed(auto.equilibria)
    hopf = min((row.V for row in rows if row.kind == 3), key=lambda V: abs(V - HOPF))
    lines = [equilibrium_line("AUTO-07p", f"{seconds:.4f} |", len(rows), hopf)]
    for intervals in MESHES:
        stops = list(STICKING)
        seconds, (_, rows) = timed(lambda n=intervals, at=stops: auto.cycles(n, at), rounds=3)
        errors = [error(rows, V) for V in stops]
        multipliers = np.array(
            [row.multipliers for row in rows if row.period and len(row.multipliers) == 2]
        )
        lines.append(
            cycle_line(
                f"AUTO-07p, {intervals} intervals",
                f"{seconds:.4f} |",
                len(rows),
                errors,
                multipliers,
            )
        )
    return lines


def error(rows: list[Row], V: float) -> tuple[float, float]:
    """Errors at the point that AUTO put at V."""
    period, multiplier = STICKING[V]
    row = min((row for row in rows if row.period > 1.35), key=lambda row: abs(row.V - V))
    h = 1e-6
    slope = (
        find_cycle(SLIDER, parameters={"V": V + h}).period
        - find_cycle(SLIDER, parameters={"V": V - h}).period
    ) / (2 * h)
    found = min(row.multipliers, key=lambda m: abs(m - multiplier))
    return abs((row.period - slope * (row.V - V)) / period - 1), abs(found - multiplier)


def equilibrium_line(tool: str, seconds: str, points: int, hopf: float, own: str = "") -> str:
    """A line of the table; `seconds` are two cells."""
    first = f"{first_call(own):.3f}" if own else ""
    error = f"{abs(hopf - HOPF):.1e}"
    return f"| equilibria | {tool} | {seconds} | {first} | {points} | {error} | | | |"


def cycle_line(
    tool: str,
    seconds: str,
    points: int,
    errors: list[tuple[float, float]],
    multipliers: Any,
    own: str = "",
) -> str:
    """A line of the table.

    Parameters
    ----------
    tool : str
    seconds : str
        Two cells.
    points : int
    errors : list of (float, float)
        Of period and multiplier.
    multipliers : array, shape (points, 2)
    own : str
        The function to measure a first call of.
    """
    off = np.nan_to_num(np.abs(multipliers - 1.0), nan=np.inf).min(axis=1).max()
    shown = " | ".join(f"{max(column):.1e}" for column in zip(*errors, strict=True))
    first = f"{first_call(own):.3f}" if own else ""
    return f"| cycles | {tool} | {seconds} | {first} | {points} | | {shown} | {off:.1e} |"


def main() -> None:
    lines = [
        "# Branches: time and error",
        "",
        f"{platform.processor() or platform.machine()}, {platform.system()}, "
        f"Python {platform.python_version()}, stickslip {ss.__version__}",
        "",
        "| branch | tool | seconds | with the table | seconds of a first call | points "
        "| error of the Hopf point | error of the period (relative) "
        "| error of the multiplier | distance of the other multiplier from 1, worst |",
        "|---|---|---|---|---|---|---|---|---|---|",
        *own(),
    ]
    missing = absent()
    lines += ["", f"AUTO-07p is left out: {missing}."] if missing else rival(Auto())
    text = "\n".join(lines) + "\n"
    print(text)
    RESULTS.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
