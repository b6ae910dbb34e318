"""What a change costs: two versions in one run, in turn: ``python benchmarks/versions.py OTHER
[GROUP]``, where OTHER is a commit or a checkout. ``make bench-guard`` runs it.

The loops of ``benchmarks/motion.py`` (spring slider (3.3) with its smooth law, scaled slider (3.6),
rocking toy (4.2)), motions of these and of some systems of the catalogue by ``simulate``, and the
certificates of the whole catalogue, each by both in turn, in processor time; the minima of the
rounds are in ``benchmarks/results/versions.md``. With `averages`: steps of evolutions in which
friction is that of an ellipse on average, in ``benchmarks/results/averages.md``. With `maps`:
parameter maps, settled, measured and stored, in ``benchmarks/results/maps.md``. Both run in this
Python, each with its own compiled code.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
RESULTS = HERE / "benchmarks" / "results"
ROUNDS = {"versions": 15, "averages": 5, "maps": 5}
MEAN = 2.125  # of the squares of the half axes 2 and 1/2
HALF = 1.875  # of their difference
ELLIPSES = {
    "turning": ("2*pi*s", MEAN, HALF),
    "swinging": ("1.2*sin(2*pi*s)", MEAN, HALF),
    "breathing": ("2*pi*s", "1 + cos(2*pi*s)/2", "sin(4*pi*s)/3"),
}  # angle of the long axis, times two; mean and half difference of the squares
TITLES = {
    "versions": "Changes of speed between versions",
    "averages": "Changes of speed: a step with averaged friction",
    "maps": "Changes of speed: parameter maps",
}
MAPS: dict[str, tuple[str, dict[str, str], list[str]]] = {
    "rocking_toy": (
        "toy (4.2), 60 × 60 points",
        {"P": "0.8:1.5:60", "delta": "0.01:0.2:60"},
        ["speed"],
    ),
    "scaled_slider": (
        "slider (3.6), 30 × 30 points",
        {"b": "0.3:1.2:30", "nu": "log:1e-3:1e-2:30"},
        ["period"],
    ),
    "spring_slider": (
        "slider (3.3), 16 × 16 points",
        {"V": "0.05:0.3:16", "nu": "0.01:0.05:16"},
        ["period"],
    ),
}
STEPS = {"200": 200, "adaptive": None}
# Impacts, planes, faces, structures, many contacts: what the loops of the paper's systems lack.
MOVED = (
    "belt_block",
    "block_chain",
    "puck",
    "coin",
    "isolated_floor",
    "woodpecker",
    "plate_compactor",
    "bladed_disk",
    "rate_and_state_slider",
)
LEAST = 0.02  # seconds that a measurement takes at least


def certificates() -> float:
    """Seconds for the certificates of the catalogue."""
    import stickslip as ss

    total = 0.0
    for name in ss.catalogue.names():
        system = getattr(ss.catalogue, name)()
        motion = ss.simulate(system, max_events=2000)
        began = time.process_time()
        assert motion.certificate is not None
        total += time.process_time() - began
    return total


def moved(name: str) -> float:
    """Seconds of a motion of the catalogue, without its certificate."""
    import stickslip as ss

    system = getattr(ss.catalogue, name)()
    ss.simulate(system)
    began = time.process_time()
    count = 0
    while count == 0 or time.process_time() < began + LEAST:
        ss.simulate(system)
        count += 1
    return (time.process_time() - began) / count


def averaged_step(kind: str, steps: int | None) -> float:
    """Seconds of one step, everything from the declaration on included."""
    import stickslip as ss

    angle, mean, half = ELLIPSES[kind]
    c, s = f"({half})*cos({angle})", f"({half})*sin({angle})"
    psi = ss.Ellipsoid([[f"{mean} + {c}", s], [s, f"{mean} - {c}"]])
    began = time.process_time()
    load = ["2*sin(2*pi*t)", "2*sin(4*pi*t)"]
    problem = ss.Evolution(
        [[1.0, 0.3], [0.3, 0.5]], load, psi, [0.0, 0.0], epsilon=0.1, span=(0, 1)
    ).averaged()
    found = ss.evolve(problem, steps=steps)
    spent = time.process_time() - began
    assert found.outcome.ok
    assert float(found.dataset["residual"].max()) <= 1e-11
    return spent / (found.dataset.sizes["step"] - 1)


def mapped(name: str, axes: dict[str, str], measures: list[str]) -> float:
    """Seconds of a map."""
    import stickslip as ss

    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        ss.sweep(
            getattr(ss.catalogue, name)(), axes, measures, Path(folder) / "map.zarr", workers=1
        )
        return time.process_time() - began


def jobs_of(group: str) -> dict[str, tuple[str, Callable[[], float]]]:
    """What is measured: titles, and functions that return seconds."""
    if group == "averages":
        return {
            f"{kind} {name}": (f"{kind} ellipse, {name} steps", partial(averaged_step, kind, steps))
            for kind in ELLIPSES
            for name, steps in STEPS.items()
        }
    if group == "maps":
        return {
            name: (title, partial(mapped, name, axes, measures))
            for name, (title, axes, measures) in MAPS.items()
        }
    from motion import batch, one_call

    def timed(run: Callable[[], object]) -> float:
        began = time.process_time()
        run()
        return time.process_time() - began

    titles = dict(zip("ABC", ("(3.3)", "(3.6)", "(4.2)"), strict=True))
    jobs = {
        f"loop {key}": (f"{title}, loop", partial(timed, batch(key)))
        for key, title in titles.items()
    }
    jobs |= {
        f"simulate {key}": (f"{title}, simulate", partial(timed, one_call(key)))
        for key, title in titles.items()
    }
    jobs |= {name: (f"{name}, simulate", partial(moved, name)) for name in MOVED}
    return jobs | {"certificates": ("certificates of the catalogue", certificates)}


def serve(group: str) -> None:
    """Measure what is asked for, line by line."""
    import warnings

    warnings.simplefilter("ignore")
    jobs = jobs_of(group)
    for _, run in jobs.values():
        run()
    print("ready", flush=True)
    for line in sys.stdin:
        print(jobs[line.strip()][1](), flush=True)


def start(tree: Path, cache: str, group: str) -> subprocess.Popen[str]:
    """A process that measures one checkout."""
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(tree / "src"), str(tree / "benchmarks")]),
        "STICKSLIP_CACHE": cache,
        "NUMBA_CACHE_DIR": cache,
    }
    process = subprocess.Popen(
        [sys.executable, "-P", __file__, "--serve", group],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "ready"
    return process


def ask(process: subprocess.Popen[str], name: str) -> float:
    """One measurement."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(name + "\n")
    process.stdin.flush()
    return float(process.stdout.readline())


@contextmanager
def checkout(other: str) -> Iterator[Path]:
    """A checkout, or a temporary one of a commit."""
    if Path(other, "src").is_dir():
        yield Path(other).resolve()
        return
    with tempfile.TemporaryDirectory() as folder:
        git = ["git", "-C", str(HERE), "worktree"]
        subprocess.run([*git, "add", "--quiet", "--detach", folder, other], check=True)
        try:
            yield Path(folder)
        finally:
            subprocess.run([*git, "remove", "--force", folder], check=True)


def main(other: str, group: str = "versions") -> None:
    """Print and write the table."""
    from motion import machine

    names = {name: title for name, (title, _) in jobs_of(group).items()}
    with (
        tempfile.TemporaryDirectory() as a,
        tempfile.TemporaryDirectory() as b,
        checkout(other) as before,
    ):
        now = HERE
        trees = {"before": start(before, a, group), "now": start(now, b, group)}
        best = {name: {tree: float("inf") for tree in trees} for name in names}
        for _ in range(ROUNDS[group]):
            for name in names:
                for tree, process in trees.items():
                    best[name][tree] = min(best[name][tree], ask(process, name))
    lines = [
        f"# {TITLES[group]}",
        "",
        machine(),
        "",
        "| | before, s | now, s | ratio |",
        "|---|---|---|---|",
    ]
    lines += [
        f"| {names[name]} | {found['before']:.3g} | {found['now']:.3g} | "
        f"{found['now'] / found['before']:.2f} |"
        for name, found in best.items()
    ]
    (RESULTS / f"{group}.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    serve(sys.argv[2]) if sys.argv[1] == "--serve" else main(*sys.argv[1:])
