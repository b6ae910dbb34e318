"""All tables of the page "Where other tools go wrong": ``python benchmarks/wrong``, two minutes,
into benchmarks/results/wrong.md. ``python benchmarks/wrong creep collision`` renews these alone.
Each script can be run by itself."""

from __future__ import annotations

import platform
import re
import sys
from pathlib import Path

import basin_share
import between_stops
import collision
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
    collision,
)


def kept() -> dict[str, str]:
    """The tables that the file has already."""
    if not RESULTS.is_file():
        return {}
    _, *parts = re.split(r"^## (\w+)\n\n", RESULTS.read_text(encoding="utf-8"), flags=re.M)
    return dict(zip(parts[::2], parts[1::2], strict=True))


def main() -> None:
    """Run all, or those that are named, one after the other."""
    names = {script.__name__ for script in SCRIPTS}
    chosen = set(sys.argv[1:]) or names
    if chosen - names:
        sys.exit(f"unknown: {', '.join(chosen - names)}; choose from {', '.join(sorted(names))}")
    tables = kept()
    for script in SCRIPTS:
        if script.__name__ in chosen:
            print(script.__name__, flush=True)
            tables[script.__name__] = script.report()
    parts = ["# Where other tools go wrong\n", f"{platform.machine()}, {platform.system()}\n"]
    for script in SCRIPTS:
        if script.__name__ in tables:
            parts += [f"## {script.__name__}\n", tables[script.__name__].rstrip("\n") + "\n"]
    RESULTS.write_text("\n".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()
