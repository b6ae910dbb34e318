"""The mass between stops of SciML/DiffEqBase.jl, issue 634 (open since January 2021): a callback
misses a crossing. Here is our answer, and that of event handling by hand in closed form.

In each mode the motion is a sine, a cosine and the response to the pressure, so that a program that
knows the modes can look for the next event on a fine grid and polish it: what follows shares
nothing with stickslip. ``python benchmarks/wrong/between_stops.py``
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import brentq
from table import table, timed, versions

import stickslip as ss

END = 0.004
SYSTEM = ss.catalogue.limit_stops()


class Flight:
    """The sliding motion from a state, in closed form."""

    def __init__(self, t: float, x: float, v: float, direction: int) -> None:
        p = SYSTEM.values
        self.begins, self.omega = t, p["omega"]
        self.natural = np.sqrt(p["k"] / p["M"])
        self.mean = (p["area"] * p["P_0"] - p["F_0"] - direction * p["F_c"]) / p["k"]
        self.swing = p["area"] * p["P_1"] / (p["k"] - p["M"] * self.omega**2)
        self.cosine = x - self.mean - self.swing * np.sin(self.omega * t)
        self.sine = (v - self.swing * self.omega * np.cos(self.omega * t)) / self.natural

    def position(self, t: Any) -> Any:
        """x(t)."""
        c = self.natural * (t - self.begins)
        own = self.cosine * np.cos(c) + self.sine * np.sin(c)
        return own + self.mean + self.swing * np.sin(self.omega * t)

    def speed(self, t: Any) -> Any:
        """Its rate."""
        c = self.natural * (t - self.begins)
        own = self.natural * (self.sine * np.cos(c) - self.cosine * np.sin(c))
        return own + self.swing * self.omega * np.cos(self.omega * t)


def push(t: Any, x: float) -> Any:
    """Force on the spool without friction."""
    p = SYSTEM.values
    pressure = p["P_0"] + p["P_1"] * np.sin(p["omega"] * t)
    return p["area"] * pressure - p["F_0"] - p["k"] * x


def first_fall(function: Callable[[Any], Any], begins: float) -> float:
    """The first time at which a function falls through zero, infinite if there is none."""
    grid = begins + np.linspace(1e-9, END - begins, 400_001)
    values = function(grid)
    index = np.flatnonzero((values[:-1] >= 0) & (values[1:] < 0))
    if not len(index):
        return np.inf
    found: Any = brentq(function, grid[index[0]], grid[index[0] + 1], xtol=1e-17)
    return float(found)


def by_hand() -> list[float]:
    """Times of the impacts, mode by mode."""
    p = SYSTEM.values
    friction = p["F_c"]
    t, x, v = 0.0, 0.0, 0.0
    direction = 0  # at rest
    strikes: list[float] = []
    while t < END:
        if direction == 0:
            onsets = []
            if x < p["right"]:
                onsets.append((first_fall(lambda t, x=x: friction - push(t, x), t), 1))
            if x > p["left"]:
                onsets.append((first_fall(lambda t, x=x: friction + push(t, x), t), -1))
            t, direction = min(onsets)
            continue
        flight = Flight(t, x, v, direction)
        wall = p["right"] if direction > 0 else p["left"]
        stops = first_fall(lambda t, f=flight, s=direction: s * f.speed(t), t)
        hits = first_fall(lambda t, f=flight, s=direction, w=wall: s * (w - f.position(t)), t)
        t = min(stops, hits)
        if hits < stops:
            strikes.append(t)
            x, v = wall, -p["e"] * float(flight.speed(t))
            direction = -direction
        elif t < END:
            x, v = float(flight.position(t)), 0.0
            force = float(push(t, x))
            direction = 0 if abs(force) < friction else int(np.sign(force))
    return strikes


def report() -> str:
    """The table."""
    motion, seconds = timed(lambda: ss.simulate(SYSTEM, (0.0, END)))
    assert motion.certificate.ok
    times = motion.impacts["time"].to_numpy()
    names = [name.replace("_", " ") for name in motion.impacts["contact"]]
    hand = by_hand()
    assert len(hand) >= len(times)
    rows = [
        [i + 1, name, f"{ours:.15f}", f"{other:.15f}", f"{abs(ours - other):.0e}"]
        for i, (name, ours, other) in enumerate(zip(names, times, hand, strict=False))
    ]
    head = ["impact", "stop", "time, stickslip [s]", "time, closed forms by hand [s]", "difference"]
    return table(head, rows) + f"\n\nThe motion takes {seconds:.2g} s. {versions('scipy')}\n"


if __name__ == "__main__":
    print(report())
