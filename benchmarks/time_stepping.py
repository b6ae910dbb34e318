"""Random systems with contacts and impacts beside time stepping of order one.

``python benchmarks/time_stepping.py`` follows 300 of them, three masses on springs over one or two
rough planes that shake, by Moreau's and Jean's scheme (tests/oracles/moreau_jean.py), which locates
no event, with 20,000, 80,000 and 320,000 steps, and writes how far it is from the exact motion into
``results/time_stepping.md``; ten of them by Siconos, too, where the system's Python has it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

import stickslip as ss
from impacts import run_siconos

HERE = Path(__file__).parent
sys.path[0] = str(HERE.parent / "tests")  # whose "motion" is not the script beside this one

from motion.test_impacts import (  # noqa: E402  # pyright: ignore[reportMissingImports]
    random_system,
)
from oracles import moreau_jean  # noqa: E402

STEPS = (20_000, 80_000, 320_000)
SICONOS_STEPS = (3_000, 30_000)
SICONOS_SEEDS = 10


def end_of(found: ss.Trajectory) -> tuple[Any, float]:
    """Where a motion ends, and its largest coordinate."""
    names = ("a", "b", "c")
    exact = np.array([found.final[x] for x in names])
    return exact, float(max(np.max(np.abs(found[x].values)) for x in names))


def distances(seed: int) -> tuple[bool, list[float]]:
    """Whether the motion of a random system is certified, and how far the scheme is from its end
    with each number of steps, in units of its largest coordinate."""
    system, (M, C, K, push), contacts, start = random_system(seed)
    found = ss.simulate(system)
    exact, size = end_of(found)
    ends = [moreau_jean.final_state(M, C, K, push, contacts, start, 3.0, n)[0] for n in STEPS]
    ok = found.outcome.ok and found.certificate.ok
    return ok, [float(np.max(np.abs(q - exact))) / size for q in ends]


def by_siconos(seed: int) -> list[float]:
    """How far Siconos is from the end of a random system, in the same units, with each step."""
    system, (M, C, K, push), contacts, start = random_system(seed)
    exact, size = end_of(ss.simulate(system))
    given: dict[str, Any] = {"M": M, "C": C, "K": K, "push": push, **contacts._asdict()}
    given = {name: np.asarray(value).tolist() for name, value in given.items()}
    given |= {"start": np.concatenate(start).tolist(), "span": 3.0}
    runs = run_siconos(given, [3.0 / n for n in SICONOS_STEPS], 1)
    return [float(np.max(np.abs(end[:3] - exact))) / size for _, end, _ in runs]


def siconos_table() -> list[str]:
    """Ten systems by Siconos; why there are none if it is absent."""
    try:
        found = [by_siconos(seed) for seed in range(SICONOS_SEEDS)]
    except OSError as error:
        return [f"Siconos was not measured: {error}.", ""]
    return [
        f"Siconos (Moreau-Jean, θ = ½) on the first {SICONOS_SEEDS}:",
        "",
        "| seed | " + " | ".join(f"{n:,} steps" for n in SICONOS_STEPS) + " |",
        "|---" * (1 + len(SICONOS_STEPS)) + "|",
        *(
            f"| {seed} | " + " | ".join(f"{d:.1e}" for d in row) + " |"
            for seed, row in enumerate(found)
        ),
        "",
    ]


def main(count: int) -> None:
    """Follow so many systems, and write the table."""
    found = [distances(seed) for seed in range(count)]
    certified = [seed for seed, (ok, _) in enumerate(found) if ok]
    table = np.array([found[seed][1] for seed in certified])
    rows = []
    for n, column in zip(STEPS, table.T, strict=True):
        middle, most = np.quantile(column, (0.5, 0.95))
        rows.append(f"| {n:,} | {middle:.1e} | {most:.1e} | {np.max(column):.1e} |")
    others = [str(seed) for seed in range(count) if seed not in set(certified)]
    closer = int(np.sum(table[:, -1] < table[:, 0]))
    text = [
        "# Time stepping",
        "",
        f"{count} random systems with contacts and impacts (`python benchmarks/time_stepping.py`): "
        f"{len(certified)} motions are certified"
        + (f"; seeds {', '.join(others)} end early or are not certified." if others else "."),
        "Difference between the Moreau-Jean scheme, of first order, and the exact motion at the "
        f"end, in units of the largest coordinate; in {closer} systems it is smaller with the most "
        "steps than with the fewest.",
        "",
        "| steps | median | 95 % | largest |",
        "|---|---|---|---|",
        *rows,
        "",
        *siconos_table(),
    ]
    print("\n".join(text))
    (HERE / "results" / "time_stepping.md").write_text("\n".join(text), encoding="utf-8")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
