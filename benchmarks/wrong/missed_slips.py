"""Slips that an event handler steps over.

A block sticks. Its spring is pulled by a short pulse, so that it slips once, and by a force that
comes just above the threshold and falls again (it grazes). In stick nothing moves, so that an
adaptive solver takes steps as long as it may, and looks at its events at their ends
(scipy/scipy#9228). ``python benchmarks/wrong/missed_slips.py``
"""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from table import table, timed, versions

import stickslip as ss

END, THRESHOLD = 100.0, 0.5
FORCES = {
    "a pulse of width 1": ("0.8*exp(-(t - 50.3)**2)", lambda t: 0.8 * np.exp(-((t - 50.3) ** 2))),
    "a wave that exceeds it by 1e-5": (
        "0.50001*sin(t)",
        lambda t: 0.50001 * np.sin(t),
    ),
}


def events_seen(force: Any, method: str, rtol: float, max_step: float) -> tuple[int, float]:
    """Onsets of slip that `solve_ivp` notices while the block sticks, and seconds."""
    began = perf_counter()

    def gives(t: float, y: np.ndarray) -> float:
        return float(force(t)) - THRESHOLD

    gives.direction = 1.0  # type: ignore[attr-defined]
    found = solve_ivp(
        lambda t, y: [0.0, 0.0],
        (0.0, END),
        [0.0, 0.0],
        method=method,
        rtol=rtol,
        atol=1e-12,
        events=gives,
        max_step=max_step,
    )
    assert found.success
    return len(found.t_events[0]), perf_counter() - began


def exact(text: str) -> tuple[int, float]:
    """Onsets of slip of the block, and seconds, by stickslip."""
    block = ss.System(
        "block",
        coordinates={"x": ss.Inertial(force=text)},
        kinetic="d_x**2/2",
        potential="50*x**2",
        contacts={"ground": ss.Contact("d_x", THRESHOLD)},
    )
    motion, seconds = timed(lambda: ss.simulate(block, (0.0, END)))
    assert motion.certificate.ok
    events = motion.events
    onsets = (events["from"] == "stick").to_numpy() & (events["to"] == "slip+").to_numpy()
    return int(onsets.sum()), seconds


def report() -> str:
    """The table."""
    rows: list[list[object]] = []
    for name, (text, force) in FORCES.items():
        truth, seconds = exact(text)
        t = np.linspace(0.0, END, 10_000_001)
        above = force(t) > THRESHOLD
        crossings = int((~above[:-1] & above[1:]).sum())
        for rtol, max_step in ((1e-6, np.inf), (1e-12, np.inf), (1e-6, 1.0), (1e-6, 0.01)):
            seen, spent = events_seen(force, "DOP853", rtol, max_step)
            step = "" if np.isinf(max_step) else f", max_step {max_step:g}"
            rows.append([name, f"DOP853, rtol {rtol:g}{step}", seen, crossings, f"{spent:.2g}"])
        rows.append([name, "**stickslip** (slips, certified)", truth, crossings, f"{seconds:.2g}"])
    head = ["force", "solver", "onsets found", "times the force exceeds the threshold", "seconds"]
    return table(head, rows) + f"\n\n{versions('scipy')}\n"


if __name__ == "__main__":
    print(report())
