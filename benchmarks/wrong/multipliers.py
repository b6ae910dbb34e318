"""Multipliers of a cycle that sticks, by AUTO-07p on the same system with the maximum as it stands.

On a branch of cycles of an autonomous system one multiplier is exactly 1. Collocation on a fixed
number of intervals sees the corner of stick and slip somewhere inside an interval. The whole
comparison, with periods and times, is benchmarks/orbits.py. ``python
benchmarks/wrong/multipliers.py`` needs AUTO-07p and gfortran.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from table import table, timed, versions

import stickslip as ss
from auto_07p import Auto, absent

SLIDER = ss.catalogue.spring_slider(mu="2/sqrt(alpha)", nu=0.05)


def ours() -> ss.Branch:
    """The branch by stickslip."""
    steady = ss.continue_equilibrium(SLIDER, "V", (0.02, 0.5))
    return ss.continue_cycle(ss.find_cycle(SLIDER, steady.of_kind("Hopf")[0]), "V", (0.02, 0.5))


def report() -> str:
    """The table."""
    rows: list[list[object]] = []
    if absent():
        rows.append([absent(), "", "", ""])
    else:
        auto = Auto()
        auto.equilibria()
        for intervals in (50, 100, 400, 1600):
            seconds, points = auto.cycles(intervals, [])
            cycles = [point for point in points if point.period and point.multipliers]
            worst = max(min(abs(z - 1) for z in point.multipliers) for point in cycles)
            rows.append(
                [f"AUTO-07p, {intervals} intervals", len(cycles), f"{worst:.1e}", f"{seconds:.2g}"]
            )
    branch, seconds = timed(ours)
    points = branch.points
    multipliers = points["multiplier_real"].values + 1j * points["multiplier_imag"].values
    worst = float(np.max(np.min(np.abs(multipliers - 1), axis=1)))
    rows.append(["**stickslip**", points.sizes["point"], f"{worst:.1e}", f"{seconds:.2g}"])
    head = ["tool", "cycles", "distance of the multiplier that is 1 from 1, worst", "seconds"]
    return table(head, rows) + f"\n\n{versions()}\n"


if __name__ == "__main__":
    print(report())
