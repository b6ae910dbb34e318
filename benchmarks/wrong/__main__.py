"""All tables of the page "Where other tools go wrong": ``python benchmarks/wrong``, two minutes,
into benchmarks/results/wrong.md. Each script can be run alone."""

from __future__ import annotations

import platform
from pathlib import Path

import basin_share
import between_stops
import creep
import gradients
import missed_slips
import multipliers
import sign_of_velocity

RESULTS = Path(__file__).parents[1] / "results" / "wrong.md"
SCRIPTS = (
    sign_of_velocity,
    creep,
    missed_slips,
    between_stops,
    multipliers,
    basin_share,
    gradients,
)


def main() -> None:
    """Run all, one after the other."""
    parts = ["# Where other tools go wrong\n", f"{platform.machine()}, {platform.system()}\n"]
    for script in SCRIPTS:
        print(script.__name__, flush=True)
        parts += [f"## {script.__name__}\n", script.report()]
    RESULTS.write_text("\n".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()
