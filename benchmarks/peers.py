"""Every number beside its rival or its goal, in one run: ``python benchmarks/peers.py``.

Motions and rivals take turns; minima of the rounds, in processor time of one thread, so that a busy
machine changes little. The table goes to ``benchmarks/results/peers.md``, below it what a person
wrote there: where the time goes, and what the floor is.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import impacts
import orbits
import planes
import stickslip as ss
import sweep
from evolution_play import loads
from motion import BATCH, PROBLEMS, batch, machine, one_call
from rivals import ABSENT, RIVALS

RESULTS = Path(__file__).parent / "results" / "peers.md"
NOTES = "## Where the time goes"
ROUNDS = 9
SIDE = 300  # of the map
HEADER = ["| work | stickslip | other program | ratio | goal |", "|---|---|---|---|---|"]


def seconds(run: Callable[[], Any], shortest: float = 0.02) -> float:
    """Processor time of a call, repeated until it can be measured."""
    began = time.process_time()
    count = 0
    while count == 0 or time.process_time() - began < shortest:
        run()
        count += 1
    return (time.process_time() - began) / count


def least(runs: Mapping[str, Callable[[], Any]], rounds: int = ROUNDS) -> dict[str, float]:
    """The minima of several runs in turn, each of which is called once before."""
    for run in runs.values():
        run()
    found = dict.fromkeys(runs, float("inf"))
    for _ in range(rounds):
        for name, run in runs.items():
            found[name] = min(found[name], seconds(run))
    return found


def scaled(value: float) -> str:
    """A time with its unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-9:.3g} ns"


def line(title: str, own: float, rival: float | None, goal: str) -> str:
    """A row of the table."""
    other = ["", ""] if rival is None else [scaled(rival), f"{own / rival:.2f}"]
    return f"| {title} | {scaled(own)} | {' | '.join(other)} | {goal} |"


def motions() -> list[str]:
    """The loops of the paper's systems, of impacts and of planes, with heyoka where it is
    installed."""
    lines = []
    heyoka = RIVALS.get("heyoka", {})
    for key, factor in zip("ABC", ("1/1.5", "1/10", "1/5"), strict=True):
        problem = PROBLEMS[key]
        runs = {"loop": batch(key), "simulate": one_call(key)}
        if key in heyoka:
            runs["heyoka"] = heyoka[key].prepare()
        found = least(runs)
        loop = found["loop"] / BATCH[key]
        rival = found["heyoka"] / problem.cycles if "heyoka" in found else None
        lines += [
            line(f"{problem.title}, loop, per cycle", loop / problem.cycles, rival, factor),
            line(
                f"{problem.title}, overhead of `simulate`",
                found["simulate"] - loop,
                None,
                "30 µs",
            ),
        ]
    for motion in (impacts.woodpecker(), impacts.spool()):
        runs = {"loop": impacts.batch(motion)}
        if heyoka:
            runs["heyoka"] = impacts.prepare_heyoka(
                motion, **impacts.OPTIONS[motion.title]["heyoka"]
            )
        found = least(runs, 5)
        rival = found["heyoka"] / motion.cycles if heyoka else None
        loop = found["loop"] / impacts.BATCH / motion.cycles
        lines.append(line(f"{motion.title}, loop, per cycle", loop, rival, "1/3"))
    for motion, goal in zip(planes.MOTIONS, ("0.3 ms", "0.8 ms"), strict=True):
        loop = least({"loop": planes.by_loop(motion)}, 3)["loop"] / planes.BATCH
        lines.append(line(f"{motion.title}, loop, per motion", loop, None, goal))
    return lines


def many() -> list[str]:
    """Maps, basins, ensembles, return maps: processor time of all threads."""
    axes = {"P": f"0.8:1.6:{SIDE}", "delta": f"0.01:0.2:{SIDE}"}

    def mapped() -> None:
        with tempfile.TemporaryDirectory() as folder:
            ss.sweep(sweep.TOY, axes, ["speed"], Path(folder) / "map.zarr", initial=sweep.PUSH)

    def basin() -> None:
        ss.basin(ss.catalogue.forced_oscillator(), {"x": "-3:3:201", "d_x": "-3:3:101"})

    lines = [
        line(f"map of (4.2), {SIDE} × {SIDE} points", seconds(mapped), None, "10 s"),
        line("basin of the forced oscillator, 201 × 101", seconds(basin), None, "20 s"),
        line("return map of the woodpecker, 100,000 states", seconds(returned), None, "10 s"),
    ]
    rate = max(sweep.loop_alone(sweep.points(20_000)) for _ in range(3))
    return [*lines, line("ensemble of (3.6), loop, per cycle", 1.0 / rate, None, "250 ns")]


def returned() -> None:
    """The return map of the woodpecker."""
    impacts.return_map(1)


def curves() -> list[str]:
    """Branches, and the play."""
    branch = orbits.equilibria().of_kind("Hopf")[0]
    runs = {
        "equilibria of (3.3)": orbits.equilibria,
        "cycles of (3.3)": lambda: ss.continue_cycle(
            ss.find_cycle(orbits.SLIDER, branch), "V", orbits.SPAN
        ),
    }
    found = least(runs, 3)
    formula = ("5*t - t**2", "1 + cos(2*pi*s)/2", (0.0, 5.0))
    sampled = loads(10**6)["50 loops, noisy"]
    times = [5e-6 * i for i in range(10**6)]
    plays = {
        "play, formulas, 50,000 periods": lambda: ss.play(*formula, initial=0.0, epsilon=1e-4),
        "play, 1e6 samples": lambda: ss.play(
            (times, sampled), 1.0, (0.0, times[-1]), initial=float(sampled[0])
        ),
    }
    played = least(plays, 3)
    return [
        *(
            line(name, spent, None, goal)
            for (name, spent), goal in zip(found.items(), ("1.5 AUTO", "AUTO at 2e-5"), strict=True)
        ),
        *(
            line(name, spent, None, goal)
            for (name, spent), goal in zip(played.items(), ("0.1 s", "0.05 s"), strict=True)
        ),
    ]


def commit() -> str:
    """The commit of the checkout, in words; empty outside of one."""
    found = subprocess.run(
        ["git", "rev-parse", "--short=8", "HEAD"],
        cwd=RESULTS.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    return f", commit {found.stdout.strip()}" if found.returncode == 0 else ""


def main() -> None:
    """Measure, print, and keep what was written below the table."""
    where = f"{machine()}{commit()}"
    lines = ["# Speed compared with other programs and with the goals", "", where, "", *HEADER]
    lines += [*motions(), *many(), *curves()]
    lines += ["", *(f"{name} is absent: {reason}." for name, reason in ABSENT.items())]
    kept = RESULTS.read_text(encoding="utf-8") if RESULTS.exists() else ""
    notes = kept[kept.index(NOTES) :] if NOTES in kept else f"{NOTES}\n"
    text = "\n".join(lines).rstrip() + f"\n\n{notes}"
    RESULTS.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
