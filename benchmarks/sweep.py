"""Speed of parameter maps, all tools in one run: ``python benchmarks/sweep.py [--small]``.

*Cycles*: the scaled slider (3.6) at 1e5 points (b, ν), about 20 cycles each. stickslip stands in
the table twice: one ``simulate_many`` with everything in it, and the compiled loop alone, whose
modes are known. The rival is SciPy in a pool of processes, told which boundary ends which mode, on
a sample of the points; its rate is that of the sample. So is diffrax, all motions of its sample at
once (``diffrax_slider.py``).

*Map*: walking speed of the toy (4.2) over 300 × 300 values of (P, δ), every motion followed until
it has settled to 1e-8, measured and certified; and the same map stored by ``sweep``, whose overhead
is the time beyond that.

All times are medians of rounds in which the tools take turns. The tables go to
``benchmarks/results/sweep.md``.

*GPU*: ``python benchmarks/sweep.py gpu [--small]`` computes 1e5 points of (4.2) and of (3.6) on the
GPU and on all cores, and compares both; its table goes to ``benchmarks/results/gpu.md``.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import resource
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import stickslip as ss
from motion import machine
from reference_values import PROBLEMS
from rivals import RIVALS
from stickslip.arrays import Array
from stickslip.motion.ensemble import Lanes
from stickslip.motion.outcome import Outcome
from stickslip.motion.simulate_many import (
    BATCH_SLOTS,
    initial_states,
    lanes_of_block,
    parameter_table,
    pose_all,
)
from stickslip.motion.steps.arrays import FULL
from stickslip.orbits.settling.engine import measuring, settling
from stickslip.orbits.settling.motions import Settings
from stickslip.sweeps.sweep import sweep
from stickslip.sweeps.work.chunk import measure_chunk

RESULTS = Path(__file__).parent / "results"
CORES = os.cpu_count() or 1
SLIDER = ss.catalogue.scaled_slider_limit()
TOY = ss.catalogue.rocking_toy()
SPAN = 77.0  # 20 cycles on average
RTOL = 1e-6  # the error stays below 1e-10, as for the rivals (benchmarks/motion.py)
PUSH = {"psi": 0.0, "d_psi": 1.8, "x_R": 0.0}
SAMPLE = 16
VMAP = 1024  # points that diffrax follows at once
VMAP_TOLERANCE = 3e-14  # the loosest with which its error is below 1e-10
WARM_UP = 0.8  # of a cycle, until every motion has seen both its modes


def in_turn(runs: dict[str, Callable[[], float]], rounds: int) -> dict[str, float]:
    """Median of what runs return, taken in turn; each is called once before."""
    for run in runs.values():
        run()
    found: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            found[name].append(run())
    return {name: median(values) for name, values in found.items()}


def points(count: int) -> dict[str, Array]:
    """Points (b, ν) of the slider."""
    rng = np.random.default_rng(0)
    return {"b": rng.uniform(0.3, 1.2, count), "nu": 10.0 ** rng.uniform(-3.0, -2.0, count)}


def many(given: dict[str, Array], workers: int) -> float:
    """Cycles per second and core of one call."""
    began = time.perf_counter()
    found = ss.simulate_many(SLIDER, (0.0, SPAN), parameters=given, rtol=RTOL, workers=workers)
    return 0.5 * float(found["kinks"].sum()) / (time.perf_counter() - began) / workers


def loop_alone(given: dict[str, Array]) -> float:
    """Cycles per second of the compiled loop on one core, once the closed forms are made."""
    count = len(given["b"])
    table = parameter_table(SLIDER, given, count)
    states = initial_states(SLIDER, {}, count)
    problem = pose_all(SLIDER, given, RTOL, 1e-12)
    cycles = 0.0
    spent = 0.0
    block = lanes_of_block(problem, BATCH_SLOTS)
    for first in range(0, count, block):
        part = table[first : first + block]
        lanes = Lanes.start(
            problem,
            problem.constants_of(part),
            np.arange(len(part)),
            states[first : first + block],
            (0.0, SPAN),
            problem.empty_forms(len(part), BATCH_SLOTS),
        )
        lanes.advance(SPAN * WARM_UP / 20.0, 10**6)
        lanes.codes[:] = FULL
        before = lanes.now.counters[:, 3].sum()
        began = time.perf_counter()
        lanes.advance(SPAN, 10**6)
        spent += time.perf_counter() - began
        cycles += 0.5 * float(lanes.now.counters[:, 3].sum() - before)
    return cycles / spent


def scipy_point(values: tuple[float, float]) -> float:
    """Cycles of one point by SciPy."""
    b, nu = values
    rival = RIVALS["SciPy"]["B"]
    problem = PROBLEMS["B"]
    problem = replace(problem, parameters={**problem.parameters, "b": b, "nu": nu}, span=SPAN)
    return 0.5 * replace(rival, problem=problem).prepare()()[1]


def scipy_pool(pool: ProcessPoolExecutor, given: dict[str, Array]) -> float:
    """Cycles per second and core of SciPy in a pool of processes, on a sample."""
    began = time.perf_counter()
    cycles = sum(pool.map(scipy_point, zip(given["b"][:SAMPLE], given["nu"][:SAMPLE], strict=True)))
    return cycles / (time.perf_counter() - began) / CORES


def diffrax_vmap(given: dict[str, Array]) -> tuple[Callable[[], float], float]:
    """What measures diffrax, in cycles per second of one core; and its error on the reference
    problem."""
    from diffrax_slider import follower

    problem = PROBLEMS["B"]
    b = given["b"][:VMAP]
    nu = given["nu"][:VMAP]
    values = (np.array([problem.parameters[name]]) for name in ("b", "nu"))
    error = problem.error(follower(problem.span, VMAP_TOLERANCE)(*values)[0][0])
    follow = follower(SPAN, VMAP_TOLERANCE)

    def run() -> float:
        began = time.perf_counter()
        _, switches = follow(b, nu)
        return 0.5 * float(switches.sum()) / (time.perf_counter() - began)

    return run, error


def cycles_table(count: int, rounds: int) -> list[str]:
    """Table of cycles per second and core."""
    given = points(count)
    note = "diffrax is not installed here, so its vmap was not measured."
    # Not forked: a fork of a process with threads may hang.
    with ProcessPoolExecutor(CORES, get_context("spawn")) as pool:
        runs = {
            "stickslip, loop": lambda: loop_alone(given),
            "stickslip, simulate_many, one thread": lambda: many(given, 1),
            f"stickslip, simulate_many, {CORES} threads": lambda: many(given, CORES),
            f"SciPy, {CORES} processes, {SAMPLE} points": lambda: scipy_pool(pool, given),
        }
        if importlib.util.find_spec("diffrax"):
            runs[f"diffrax, vmap, one core, {VMAP:,} points"], error = diffrax_vmap(given)
            note = (
                f"diffrax: events and restarts, tolerance {VMAP_TOLERANCE:g}, "
                f"error {error:.1e} on problem B."
            )
        rates = in_turn(runs, rounds)
    slowest = min(rates.values())
    lines = [
        f"| (3.6), {count:,} points, 20 cycles each | cycles per second and core | times SciPy |",
        "|---|---|---|",
    ]
    lines += [f"| {name} | {rate:,.0f} | {rate / slowest:,.0f} |" for name, rate in rates.items()]
    return [*lines, "", note]


def grid(side: int) -> dict[str, Array]:
    """Points (P, δ) of the toy."""
    P, delta = np.meshgrid(np.linspace(0.8, 1.6, side), np.linspace(0.01, 0.2, side), indexing="ij")
    return {"P": P.ravel(), "delta": delta.ravel()}


def kernels(given: dict[str, Array], found: dict[str, Array]) -> tuple[float, float]:
    """Wall time of the map by `measure_chunk` on all cores, and the share of it spent in compiled
    loops."""
    inside = [0.0]
    loops = {measuring: "measure_all", settling: "settle_all"}
    plain = {module: getattr(module, name) for module, name in loops.items()}

    def timed(module: Any, *arguments: Any) -> None:
        began = time.perf_counter()
        plain[module](*arguments)
        inside[0] += time.perf_counter() - began

    def part(first: int) -> dict[str, Array]:
        piece = slice(first, first + 2048)
        here = {name: values[piece] for name, values in given.items()}
        start = {name: np.full(len(here["P"]), value) for name, value in PUSH.items()}
        return measure_chunk(TOY, start, here, ("speed",), Settings())

    for module, name in loops.items():
        setattr(module, name, partial(timed, module))
    began = time.perf_counter()
    with ThreadPoolExecutor(CORES) as pool:
        parts = list(pool.map(part, range(0, len(given["P"]), 2048)))
    wall = time.perf_counter() - began
    for module, name in loops.items():
        setattr(module, name, plain[module])
    found.update({name: np.concatenate([p[name] for p in parts]) for name in parts[0]})
    return wall, inside[0] / (wall * CORES)


def stored(side: int) -> float:
    """Wall time of the map computed and stored by `sweep`."""
    axes = {"P": f"0.8:1.6:{side}", "delta": f"0.01:0.2:{side}"}
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        sweep(TOY, axes, ["speed"], Path(folder) / "map.zarr", initial=PUSH)
        return time.perf_counter() - began


def map_table(side: int, rounds: int) -> list[str]:
    """Table of the map."""
    given = grid(side)
    found = {}
    shares = []

    def computed() -> float:
        wall, share = kernels(given, found)
        shares.append(share)
        return wall

    times = in_turn({"computed": computed, "stored": lambda: stored(side)}, rounds)
    count = side * side
    outcome = found["outcome"]
    certificate = found["certificate"]
    kinds = ", ".join(
        f"{int(np.sum(outcome == o.code)):,} {o.label}"
        for o in Outcome
        if np.any(outcome == o.code)
    )
    bad = int(np.sum(~(certificate <= 1e-8)))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    rate = count / times["computed"]
    return [
        f"| (4.2), speed over (P, δ), {side} × {side} | |",
        "|---|---|",
        f"| wall time, {CORES} cores | {times['computed']:.1f} s |",
        f"| points per second | {rate:,.0f} |",
        f"| share of it in compiled loops | {100.0 * median(shares):.0f} % |",
        f"| stored by `sweep` | {times['stored']:.1f} s |",
        "| overhead of storage and scheduling | "
        f"{100.0 * (times['stored'] / times['computed'] - 1.0):.1f} % |",
        f"| outcomes | {kinds} |",
        f"| certificates above 1e-8 | {bad:,} |",
        f"| largest certificate | {np.nanmax(certificate):.1e} |",
        f"| peak memory of the process | {peak:,.0f} MiB |",
    ]


def device_table(side: int) -> list[str]:
    """Table of a GPU beside the cores of this machine, on the same maps.

    Raises
    ------
    DeclarationError
        If there is no GPU.
    """
    from stickslip.sweeps.work.device import check_device, find_device

    check_device()
    places = f"{CORES} cores", find_device().name
    lines = [
        f"| {side * side:,} points | {places[0]}, points per second | {places[1]}, points per "
        "second | first map there, s | other outcomes | largest relative difference | "
        "differences above 1e-12 |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, (measures, sweep_on) in device_maps(side).items():
        first, _ = timed(partial(sweep_on, device="gpu"))  # which waits for the compilation
        slow, here = timed(partial(sweep_on, device="cpu"))
        fast, there = timed(partial(sweep_on, device="gpu"))
        same = np.asarray(here["outcome"] == there["outcome"])
        apart = np.concatenate([relative(here[m], there[m])[same] for m in measures])
        lines.append(
            f"| {name} | {side * side / slow:,.0f} | {side * side / fast:,.0f} | {first:.1f} | "
            f"{np.sum(~same):,} | {np.max(apart):.1e} | {np.sum(apart > 1e-12):,} |"
        )
    return lines


def relative(here: Any, there: Any) -> Array:
    """Relative differences; 0 where both are the same or nothing."""
    a, b = np.asarray(here), np.asarray(there)
    return np.nan_to_num(np.abs(b - a) / np.where(a == 0.0, 1.0, np.abs(a)))


def device_maps(side: int) -> dict[str, tuple[list[str], Callable[..., Any]]]:
    """Maps that a device, or the cores, compute, with their measures."""
    plane = {
        "P": np.linspace(0.8, 1.6, side).tolist(),
        "delta": np.linspace(0.01, 0.2, side).tolist(),
    }
    other = {
        "b": np.linspace(0.3, 1.2, side).tolist(),
        "nu": np.geomspace(1e-3, 1e-2, side).tolist(),
    }
    toy, slider = ["period", "speed"], ["period", "amplitude"]
    return {
        "(4.2), over (P, δ)": (toy, partial(ss.sweep, TOY, plane, toy, initial=PUSH)),
        "(3.6), over (b, ν)": (slider, partial(ss.sweep, SLIDER, other, slider)),
    }


def timed(run: Callable[[], Any]) -> tuple[float, Any]:
    """Wall time of a call, and its result."""
    began = time.perf_counter()
    found = run()
    return time.perf_counter() - began, found


def main() -> None:
    """Run everything, print it and keep it."""
    parser = argparse.ArgumentParser(description="Speed of parameter maps.")
    parser.add_argument(
        "part", nargs="?", choices=["gpu"], help="what a GPU does, and nothing else"
    )
    parser.add_argument("--small", action="store_true", help="a tenth of everything, nothing kept")
    given = parser.parse_args()
    if given.part == "gpu":
        parts = ["# Maps on a GPU", machine(), "\n".join(device_table(30 if given.small else 317))]
    else:
        # first, so that its memory is not that of the rivals
        toy = map_table(40 if given.small else 300, 1 if given.small else 2)
        cycles = cycles_table(10_000 if given.small else 100_000, 3)
        title = "# Parameter maps: cycles and points per second"
        parts = [title, machine(), *map("\n".join, (cycles, toy))]
    text = "\n\n".join(parts) + "\n"
    if not given.small:
        RESULTS.mkdir(exist_ok=True)
        (RESULTS / f"{given.part or 'sweep'}.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
