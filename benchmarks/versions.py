"""What a change costs: two checkouts in one run, in turn: ``python benchmarks/versions.py OTHER_CHECKOUT``.

The loops of ``benchmarks/motion.py`` (spring slider (3.3) with its smooth law, scaled slider (3.6), rocking toy (4.2)),
a motion of each by ``simulate``, and the certificates of the whole catalogue, each by both in turn; the minima of the
rounds stand in ``benchmarks/results/versions.md``. Both run in this Python, each with its own compiled code.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

RESULTS = Path(__file__).parent / "results" / "versions.md"
ROUNDS = 15


def certificates() -> float:
    """Seconds for the certificates of the catalogue."""
    import stickslip as ss

    total = 0.0
    for name in ss.catalogue.names():
        system = getattr(ss.catalogue, name)()
        motion = ss.simulate(system, max_events=2000)
        began = time.perf_counter()
        assert motion.certificate is not None
        total += time.perf_counter() - began
    return total


def serve() -> None:
    """Measure what is asked for, line by line."""
    import warnings

    warnings.simplefilter("ignore")
    from motion import batch, one_call

    jobs = {f"loop {key}": batch(key) for key in "ABC"} | {f"simulate {key}": one_call(key) for key in "ABC"}
    for run in jobs.values():
        run()
    certificates()
    print("ready", flush=True)
    for line in sys.stdin:
        name = line.strip()
        began = time.perf_counter()
        spent = certificates() if name == "certificates" else None
        if spent is None:
            jobs[name]()
            spent = time.perf_counter() - began
        print(spent, flush=True)


def start(tree: Path, cache: str) -> subprocess.Popen[str]:
    """A process that measures one checkout."""
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(tree / "src"), str(Path(__file__).parent)]),
        "STICKSLIP_CACHE": cache,
        "NUMBA_CACHE_DIR": cache,
    }
    process = subprocess.Popen(
        [sys.executable, __file__, "--serve"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
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


def main(other: str) -> None:
    """Print and write the table."""
    from motion import machine

    names = {f"loop {key}": f"{title}, loop" for key, title in zip("ABC", ("(3.3)", "(3.6)", "(4.2)"), strict=True)}
    names |= {f"simulate {k}": f"{t}, simulate" for k, t in zip("ABC", ("(3.3)", "(3.6)", "(4.2)"), strict=True)}
    names |= {"certificates": "certificates of the catalogue"}
    with tempfile.TemporaryDirectory() as a, tempfile.TemporaryDirectory() as b:
        trees = {"before": start(Path(other).resolve(), a), "now": start(Path(__file__).resolve().parents[1], b)}
        best = {name: {tree: float("inf") for tree in trees} for name in names}
        for _ in range(ROUNDS):
            for name in names:
                for tree, process in trees.items():
                    best[name][tree] = min(best[name][tree], ask(process, name))
    lines = ["# What a change costs", "", machine(), "", "| | before, s | now, s | ratio |", "|---|---|---|---|"]
    lines += [
        f"| {names[name]} | {found['before']:.4f} | {found['now']:.4f} | {found['now'] / found['before']:.2f} |"
        for name, found in best.items()
    ]
    RESULTS.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    serve() if "--serve" in sys.argv else main(sys.argv[1])
