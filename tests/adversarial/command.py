"""The long run: plan, judge with a few processes, keep every row, report."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import signal
import sys
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from .registry import SHARES, kind, kinds
from .report import counts, summary
from .verdict import AGREED, NO_REFERENCE, WRONG, Verdict

CHUNK = 10  # cases that a worker gets at once
Task = tuple[str, str, list[int]]


def plan(count: int, seed: int, only: str, done: set[tuple[str, str, int]]) -> Iterator[Task]:
    """Chunks of cases: all families in turn, so that two workers seldom compile the same formulas
    at once."""
    tasks = []
    for name in kinds():
        families = list(kind(name).FAMILIES)
        total = max(1, round(count * SHARES[name]))
        for i, family in enumerate(families):
            if only not in (family, name, ""):
                continue
            share = (
                total if only == family else total // len(families) + (i < total % len(families))
            )
            seeds = [s for s in range(seed, seed + share) if (name, family, s) not in done]
            tasks += [
                (j, (name, family, seeds[j : j + CHUNK])) for j in range(0, len(seeds), CHUNK)
            ]
    return iter([task for _, task in sorted(tasks, key=lambda item: item[0])])


def work(task: Task) -> list[dict[str, Any]]:
    """Judge a chunk: one row for each case."""
    name, family, seeds = task
    return [one(name, family, seed) for seed in seeds]


def one(name: str, family: str, seed: int) -> dict[str, Any]:
    """Judge a case."""
    module = kind(name)
    started = time.perf_counter()
    case = module.draw(family, seed)
    try:
        verdict = module.judge(case)
    except Exception as error:  # a mistake of the adversary is counted, too
        verdict = Verdict(NO_REFERENCE, f"judge raises {type(error).__name__}: {error}")
    row = {
        "kind": name,
        "family": family,
        "seed": seed,
        "verdict": verdict.kind,
        "note": verdict.note,
    }
    row |= {"numbers": verdict.numbers, "seconds": round(time.perf_counter() - started, 3)}
    return row if verdict.kind == AGREED else row | {"reproduction": module.reproduction(case)}


def sources() -> dict[str, str]:
    """Names for the code that is judged, and for that which judges."""
    here = Path(__file__).parent
    return {"library": name_of(here.parents[1] / "src"), "adversary": name_of(here)}


def name_of(folder: Path) -> str:
    """A name for all code in a folder."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def read(path: Path, expected: dict[str, str]) -> list[dict[str, Any]]:
    """Rows of an earlier run of the same library.

    Where the adversary has been put right since, what had agreed stands, and the rest is judged
    again.
    """
    lines = path.read_text().splitlines() if path.exists() else []
    header = json.loads(lines[0]) if lines else {}
    if lines and header.get("library") != expected["library"]:
        raise SystemExit(f"{path}: the library has changed since; remove it, or give another --out")
    rows = []
    for line in lines[1:]:
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            continue  # a line that was being written when the run was killed
    if header != expected:
        rows = [row for row in rows if row["verdict"] == AGREED]
        path.parent.mkdir(parents=True, exist_ok=True)
        written = path.with_suffix(".new")
        written.write_text("".join(json.dumps(line) + "\n" for line in (expected, *rows)))
        written.replace(path)
    return rows


def start_worker() -> None:
    """Leave Ctrl-C to the main process; warnings of wild numbers are no findings."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")


def run(
    tasks: Iterator[Task], workers: int, path: Path, total: int, rows: list[dict[str, Any]]
) -> None:
    """Judge all tasks, appending rows to the file as they come."""
    started = time.perf_counter()
    before = len(rows)
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, context, start_worker) as pool, path.open("a") as file:
        waiting: set[Future[list[dict[str, Any]]]] = set()
        try:
            while True:
                while len(waiting) < 2 * workers and (task := next(tasks, None)) is not None:
                    waiting.add(pool.submit(work, task))
                if not waiting:
                    break
                finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in finished:
                    new = future.result()
                    rows += new
                    file.writelines(json.dumps(row, default=float) + "\n" for row in new)
                    file.flush()
                show(rows, total, (time.perf_counter() - started) / max(len(rows) - before, 1))
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def show(rows: list[dict[str, Any]], total: int, seconds: float) -> None:
    """Progress, on a terminal only."""
    if sys.stderr.isatty():
        found = counts(rows)
        left = (total - len(rows)) * seconds / 60
        told = ", ".join(f"{found[k]} {k}" for k in found if k != "compared")
        print(
            f"\r\033[K{len(rows)}/{total}: {told}; {left:.0f} min left",
            end="",
            file=sys.stderr,
            flush=True,
        )


def main() -> int:
    """Parse the command line, run, and report. Exit code 1 if anything is certified and wrong."""
    assert __package__ is not None
    parser = argparse.ArgumentParser(
        prog="python -m tests.adversarial", description=sys.modules[__package__].__doc__
    )
    parser.add_argument(
        "--count", type=int, default=20_000, help="motions; of the other kinds a tenth each"
    )
    parser.add_argument(
        "--only", default="", metavar="FAMILY", help="one family (all --count cases), or one kind"
    )
    parser.add_argument("--seed", type=int, default=0, help="first seed of every family")
    parser.add_argument("--workers", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("out/adversarial.jsonl"),
        help="rows; a run goes on from it",
    )
    parser.add_argument(
        "--table", type=Path, help="write the report there, such as benchmarks/results/truth.md"
    )
    options = parser.parse_args()
    known = [name for k in kinds() for name in (k, *kind(k).FAMILIES)]
    if options.only and options.only not in known:
        parser.error(f"--only {options.only!r} is no kind and no family; known: {', '.join(known)}")
    if options.count < 1 or options.workers < 1:
        parser.error("--count and --workers are positive numbers")
    rows = read(options.out, sources())
    done = {(row["kind"], row["family"], row["seed"]) for row in rows}
    tasks = list(plan(options.count, options.seed, options.only, done))
    try:
        run(
            iter(tasks),
            options.workers,
            options.out,
            len(rows) + sum(len(t[2]) for t in tasks),
            rows,
        )
    except KeyboardInterrupt:
        print(f"\ninterrupted; the same command goes on from {options.out}", file=sys.stderr)
    if not rows:
        return 130
    order = {name: i for i, name in enumerate(known)}
    rows.sort(
        key=lambda row: (order.get(row["kind"], -1), order.get(row["family"], -1), row["seed"])
    )
    text = summary(rows)
    if options.table:
        options.table.write_text(heading(options) + text)
    print(text)
    return 1 if counts(rows)[WRONG] else 0


def heading(options: argparse.Namespace) -> str:
    """What the table is."""
    command = f"python -m tests.adversarial --count {options.count} --seed {options.seed}"
    return (
        "# Comparison with reference programs\n\n"
        "Random cases, compared with reference programs that share no code with the library: "
        f"`{command}`.\n\n"
    )
