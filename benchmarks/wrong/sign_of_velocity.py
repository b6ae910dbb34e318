"""The oscillator with dry friction given to SciPy's `solve_ivp` as ``sign(v)``.

    ẍ + x + 0.5 Sign(ẋ) ∋ cos 0.5 t,   x(0) = ẋ(0) = 0

It sticks twice in a period. The truth is its closed form, mode by mode
(tests/references/test_coulomb_oscillator.py), which stickslip meets to rounding; modes and events
by hand are the second opinion. ``python
benchmarks/wrong/sign_of_velocity.py``
"""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from table import table, timed, versions

import stickslip as ss

END = 100.0
MU, OMEGA = 0.5, 0.5
TOLERANCES = (1e-3, 1e-6)
SECONDS = 10.0


def exact() -> tuple[np.ndarray, float, int]:
    """State at the end, seconds, number of switches, by stickslip."""
    system = ss.System(
        "oscillator",
        coordinates={"x": ss.Inertial(force=f"cos({OMEGA}*t)")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"ground": ss.Contact("d_x", MU)},
    )
    motion, seconds = timed(lambda: ss.simulate(system, (0.0, END)))
    assert motion.certificate.ok
    return np.array([motion.final["x"], motion.final["d_x"]]), seconds, motion.n_switches


class TooLong(Exception):
    """It was stopped."""


def by_sign(method: str, rtol: float) -> tuple[Any, float, int]:
    """What solve_ivp says, seconds, and calls of the right-hand side."""
    began = perf_counter()
    calls = 0

    def field(t: float, y: np.ndarray) -> list[float]:
        nonlocal calls
        calls += 1
        if perf_counter() - began > SECONDS:
            raise TooLong
        return [y[1], np.cos(OMEGA * t) - y[0] - MU * np.sign(y[1])]

    try:
        found = solve_ivp(field, (0.0, END), [0.0, 0.0], method=method, rtol=rtol, atol=rtol * 1e-3)
    except TooLong:
        found = None
    return found, perf_counter() - began, calls


def by_modes(rtol: float) -> tuple[np.ndarray, float, int]:
    """`solve_ivp` at its best: one mode at a time, an event ends it, and the next mode is chosen by
    hand; steps that are short enough not to miss an event."""
    began = perf_counter()
    t, y, switches = 0.0, np.zeros(2), 0
    mode = 0
    while t < END:
        force = np.cos(OMEGA * t) - y[0]
        if mode == 0 and abs(force) >= MU - 1e-12:
            mode = 1 if force > 0 else -1
        events: list[Any] = []
        if mode:

            def field(t: float, y: np.ndarray, s: int = mode) -> list[float]:
                return [y[1], np.cos(OMEGA * t) - y[0] - MU * s]

            def stops(t: float, y: np.ndarray, s: int = mode) -> float:
                return s * y[1]

            stops.terminal, stops.direction = True, -1.0  # type: ignore[attr-defined]
            events = [stops]
        else:

            def field(t: float, y: np.ndarray, s: int = 0) -> list[float]:
                return [0.0, 0.0]

            def gives(t: float, y: np.ndarray) -> float:
                return abs(np.cos(OMEGA * t) - y[0]) - MU

            gives.terminal, gives.direction = True, 1.0  # type: ignore[attr-defined]
            events = [gives]
        found = solve_ivp(
            field, (t, END), y, method="DOP853", rtol=rtol, atol=rtol, events=events, max_step=0.2
        )
        t, y = float(found.t[-1]), found.y[:, -1].copy()
        if found.status == 1:
            switches += 1
            if mode:
                y[1] = 0.0
                force = np.cos(OMEGA * t) - y[0]
                mode = 0 if abs(force) < MU else (1 if force > 0 else -1)
            else:
                force = np.cos(OMEGA * t) - y[0]
                mode = 1 if force > 0 else -1
    return y, perf_counter() - began, switches


def report() -> str:
    """The table."""
    truth, seconds, switches = exact()
    rows: list[list[object]] = []
    for method in ("RK45", "DOP853", "Radau", "BDF", "LSODA"):
        for rtol in TOLERANCES:
            found, spent, calls = by_sign(method, rtol)
            if found is None:
                said, error = f"given up after {SECONDS:g} s", ""
            else:
                said = "success" if found.success else "failed"
                error = f"{np.max(np.abs(found.y[:, -1] - truth)):.1e}"
                size_seen = float(np.max(np.abs(found.y[0])))
                if size_seen > 10.0:
                    error += f" (largest x {size_seen:.4g})"
            rows.append([f"sign(v), {method}, rtol {rtol:g}", said, error, calls, f"{spent:.3g}"])
    y, spent, count = by_modes(1e-12)
    rows.append(
        [
            "modes and events by hand, DOP853, rtol 1e-12, max_step 0.2",
            f"{count} switches",
            f"{np.max(np.abs(y - truth)):.1e}",
            "",
            f"{spent:.3g}",
        ]
    )
    rows.append(
        [
            "**stickslip**",
            f"{switches} switches, certified",
            "(the reference)",
            "",
            f"{seconds:.3g}",
        ]
    )
    head = ["solver", "what it says", "error at t = 100", "calls", "seconds"]
    return table(head, rows) + f"\n\n{versions('scipy')}\n"


if __name__ == "__main__":
    print(report())
