"""Friction in a plane against smoothed friction: 300 random systems, three smoothing lengths.

The independent integrator is Radau's on −k Au/√(|Au|² + ε²), which knows of no modes; its error is
of the order of ε, and Richardson's table of ε, ε/2, ε/4 takes two orders of it away where no switch
comes close to a time of comparison. ``python benchmarks/planar_friction.py`` writes
``benchmarks/results/planar_friction.md``.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from adversarial.families.planes import FAMILIES, Slide  # noqa: E402
from adversarial.kinds import planes  # noqa: E402
from adversarial.verdict import OutOfTime, at_most  # noqa: E402
from oracles import planar  # noqa: E402

LENGTHS = (4e-3, 2e-3, 1e-3)
TIMES = np.array([1.0, 2.0, 3.0])
PATIENCE = 60.0  # seconds for a system
# What holds more than it does in slip has no limit of smooth friction; in other units, neither the
# lengths nor the times would be small.
FAMILIES_OF_ONE_FORCE = [name for name in FAMILIES if name not in ("scales", "close pass")]


def smooth(case: Slide) -> bool:
    """Whether friction is that of a convex potential."""
    return all(touch.law == "same" for touch in case.shape.touches)


def one(case: Slide) -> list[float] | None:
    """Errors of the three lengths, of their limit, and of the reference, against the library."""
    found = planes.simulated(case)
    if isinstance(found, str) or not found.certificate.ok:
        return None
    own, whole = (
        np.array([np.asarray(sampled[n]) for n in case.names]).T
        for sampled in (found.at(TIMES), found.at(np.linspace(*case.span, 200)))
    )
    start = [case.start.get(n, 0.0) for n in case.names]
    values = [planar.smoothed(case.bodies(), start, TIMES, e) for e in LENGTHS]
    exact = planes.follow(case, TIMES).states
    size = planes.sizes(case, whole)  # where all stick at these times, creeping is no large error
    return [
        float(np.max(np.abs(v - own) / size)) for v in (*values, planar.extrapolated(values), exact)
    ]


def main() -> None:
    """Compare, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seconds", type=float, default=3600.0, help="at most this long")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "benchmarks" / "results" / "planar_friction.md"
    )
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    rows: dict[str, list[list[float]]] = {name: [] for name in FAMILIES_OF_ONE_FORCE}
    left_out = 0
    started = time.monotonic()
    seed = 0
    while sum(map(len, rows.values())) < options.count and seed < options.count:
        for family, own in rows.items():
            case = planes.draw(family, seed)
            late = time.monotonic() - started > options.seconds
            if late or sum(map(len, rows.values())) >= options.count or not smooth(case):
                continue
            try:
                with at_most(PATIENCE):
                    found = one(case)
            except (planes.NoAnswer, OutOfTime, AssertionError):
                found = None
            if found is None:
                left_out += 1
            else:
                own.append(found)
        seed += 1
    options.out.write_text(table(rows, left_out), encoding="utf-8")


def table(rows: dict[str, list[list[float]]], left_out: int) -> str:
    """Medians and the largest of each family."""
    whole = np.array([row for own in rows.values() for row in own])
    lines = [
        "# Friction in a plane compared with smoothed friction",
        "",
        f"{len(whole)} random systems at t = 1, 2, 3 (`python benchmarks/planar_friction.py`): "
        "largest difference from the library's certified motion, relative to the size of a "
        "quantity over the complete motion. Radau integrates "
        "−k Au/√(|Au|² + ε²) at three ε; their extrapolation is the limit. *Exact* is the "
        "collocation of `tests/adversarial/references/sliding.py`. "
        f"{left_out} {'system was' if left_out == 1 else 'systems were'} omitted: not certified, "
        f"without a reference, or not finished within {PATIENCE:g} s.",
        "",
        "| family | systems | ε = 4e-3 | 2e-3 | 1e-3 | limit: median | worst | exact: worst |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name, own in [*rows.items(), ("**all**", whole.tolist())]:
        if not own:
            continue
        each = np.array(own)
        middle = np.median(each, axis=0)
        numbers = [*middle[:4], each[:, 3].max(), each[:, 4].max()]
        cells = " | ".join(f"{x:.1e}" for x in numbers)
        lines.append(f"| {name} | {len(own)} | {cells} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
