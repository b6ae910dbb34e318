"""Cost of sensitivities: ``python benchmarks/sensitivities.py``.

Derivatives with respect to k parameters, at 201 times, beside the motion itself, interleaved; the
goal is (1 + k/2) motions beside the one that is differentiated. A motion here is one ``simulate``
with its states at these times, as somebody has who compares with data; differences would take 2k of
them, and are wrong where a switch passes a time. The table goes to
``benchmarks/results/sensitivities.md``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import stickslip as ss
from stickslip.orbits.sensitivities.motion import sensitivities

RESULTS = Path(__file__).parent / "results" / "sensitivities.md"
ROUNDS = 80
CASES = {
    "belt_stribeck": 40.0,
    "forced_oscillator": 60.0,
    "spring_slider": 20.0,
    "plate_compactor": 1.0,
    "woodpecker": 0.5,
}


def timed(call: Callable[[], object]) -> float:
    """Seconds of one call."""
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def row(name: str, end: float) -> str:
    """One system: the fastest of interleaved rounds, to which the machine has added least."""
    system = getattr(ss.catalogue, name)()
    span = (0.0, end)
    times = np.linspace(*span, 201)
    every = list(system.parameters)
    motion = ss.simulate(system, span)
    calls: dict[int, Callable[[], object]] = {
        0: lambda: ss.simulate(system, span).at(times),
    }
    for k in (1, 2, 4):
        names = every[:k]
        calls[k] = lambda names=names: sensitivities(motion, names, times, touching=False)
    calls[-1] = lambda: sensitivities(motion, every[:4], times)
    for call in calls.values():
        call()
    found: dict[int, list[float]] = {k: [] for k in calls}
    for _ in range(ROUNDS):
        for k, call in calls.items():
            found[k].append(timed(call))
    base = min(found[0])
    ratios = " | ".join(f"{min(found[k]) / base:.2f}" for k in (1, 2, 4, -1))
    return f"| `{name}` | {motion.n_switches} | {1e3 * base:.2f} | {ratios} |"


def main() -> None:
    """Measure, print and write the table."""
    text = [
        "# Sensitivities",
        "",
        "Time of derivatives with respect to k parameters at 201 times, in units of the time "
        "of one motion with its values at these times (`python benchmarks/sensitivities.py`); in "
        "the last column including the search for boundaries that are touched but not crossed. The "
        "time of the motion is not included. The goal is 1 + k/2: 1.5, 2 and 3. Times are the "
        f"minimum of {ROUNDS} interleaved rounds.",
        "",
        "| system | switches | motion, ms | k = 1 | k = 2 | k = 4 | k = 4, touching |",
        "|---|---|---|---|---|---|---|",
        *(row(name, end) for name, end in CASES.items()),
        "",
    ]
    print("\n".join(text))
    RESULTS.write_text("\n".join(text), encoding="utf-8")


if __name__ == "__main__":
    main()
