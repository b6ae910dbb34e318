"""Chains of Burridge and Knopoff with up to 10,000 blocks: ``python benchmarks/chains.py``.

For each number of blocks a new process, with an engine that is compiled and a cache that knows no
system: seconds for the declaration, for equations and machine code, and until the first Trajectory
is there; then the time that an event takes by Taylor steps, from random states (up to 12 blocks
there would be closed forms, which cost more than they spare where modes do not come back). And the
sizes of earthquakes: with friction that weakens with velocity (Carlson and Langer, Phys. Rev. A 40
(1989) 6470), slowly driven, blocks slip alone and in groups, and the sum of their slips is the size
of an event. To ``benchmarks/results/chains.md`` and ``chains.png``, with the machine named.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import stickslip as ss

RESULTS = Path(__file__).parent / "results"
BLOCKS = (10, 30, 100, 300, 1000, 3000, 10_000)
ROUNDS = 3
FEW, MANY = 20, 220  # events; the difference is timed
LENGTH, WEAKENING, DROP, SPEED = 10.0, 2.5, 0.01, 0.01
"""Of earthquakes: √(k_c/k), α, σ and the speed of the belt."""
QUAKE_BLOCKS = 100
SECONDS = 150.0  # of computing earthquakes
PIECE = 5000  # events between looks at the clock


def measured(n: int) -> list[float]:
    """Of a chain in this process: seconds for the declaration, machine code, and until the first
    motion is there; seconds of an event; MiB."""
    ss.simulate(ss.catalogue.block_chain(N=40), (0.0, 1.0))  # the engine
    from stickslip.equations.native.systems import compile_system

    begun = time.perf_counter()
    chain = ss.catalogue.block_chain(N=n)
    declared = time.perf_counter() - begun
    compile_system(chain)
    compiled = time.perf_counter() - begun - declared
    ss.simulate(chain, (0.0, 1.0))
    first = time.perf_counter() - begun
    places = np.random.default_rng(n).uniform(-0.3, 0.3, n)
    initial = {f"x_{i}": float(x) for i, x in enumerate(places, 1)}

    def taken(events: int) -> tuple[float, int]:
        begun = time.perf_counter()
        trajectory = ss.simulate(
            chain, (0.0, 1e6), initial=initial, max_events=events, flow="taylor"
        )
        return time.perf_counter() - begun, len(trajectory.events)

    (short, some), (long, all_of_them) = (
        min(taken(events) for _ in range(2)) for events in (FEW, MANY)
    )
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return [declared, compiled, first, (long - short) / (all_of_them - some), memory]


def starts() -> list[str]:
    """The table: best of some new processes."""
    lines = [
        "| blocks | declaration, s | equations and machine code, s | until the first motion, s | "
        "per event, ms | per event and block, µs | memory, MiB |",
        "|---|---|---|---|---|---|---|",
    ]
    for n in BLOCKS:
        found = []
        for _ in range(ROUNDS):
            with tempfile.TemporaryDirectory() as folder:
                environment = os.environ | {"STICKSLIP_CACHE": folder}
                done = subprocess.run(
                    [sys.executable, __file__, "--blocks", str(n)],
                    env=environment,
                    capture_output=True,
                    text=True,
                    check=True,
                )
            found.append([float(x) for x in done.stdout.split()])
        declared, compiled, first, event, memory = np.min(found, axis=0)
        lines.append(
            f"| {n} | {declared:.3f} | {compiled:.3f} | {first:.3f} | {1e3 * event:.3g} | "
            f"{1e6 * event / n:.2f} | {memory:.0f} |"
        )
        print(lines[-1], flush=True)
    return lines


def weakening_chain(n: int) -> ss.System:
    """Blocks whose friction falls with their speed."""
    chain = ss.catalogue.block_chain(N=n)
    parameters = {name: p for name, p in chain.parameters.items() if name != "F_k"}
    parameters["k_c"] = replace(parameters["k_c"], default=LENGTH**2)
    parameters["V"] = replace(parameters["V"], default=SPEED)
    parameters["alpha"] = ss.Parameter(WEAKENING)
    parameters["sigma"] = ss.Parameter(DROP)
    law = "F_s*(1 - sigma)/(1 + 2*alpha*speed/(1 - sigma))"
    contacts = {name: replace(c, kinetic=law) for name, c in chain.contacts.items()}
    return replace(chain, parameters=parameters, contacts=contacts, initial={}, conditions={})


def earthquakes(system: ss.System, seconds: float) -> tuple[ss.EventCatalogue, int]:
    """The events of a long motion, and its switches.

    The motion is followed in pieces, each from a state in which all blocks stick.
    """
    n = len(system.coordinates)
    names = system.declaration.state
    places = np.random.default_rng(0).uniform(0.88, 0.92, n)
    state = dict(zip(names, [*places, *[SPEED] * n], strict=True))
    pieces = list[ss.EventCatalogue]()
    now = 0.0
    switches = 0
    begun = time.perf_counter()
    while time.perf_counter() - begun < seconds:
        piece = ss.simulate(system, (now, now + 1e6), initial=state, max_events=PIECE, rtol=1e-6)
        pieces.append(piece.event_catalogue(energy=False))
        knots = piece.knots
        quiet = np.flatnonzero(~np.any(knots.slip != 0, axis=1))[-1]
        assert quiet > 0, "an event is longer than a piece"
        switches += int(np.count_nonzero(knots.cause[: quiet + 1] >= 0))
        now = float(knots.time[quiet])
        state = dict(zip(names, map(float, knots.state[quiet]), strict=True))
    return ss.EventCatalogue.joined(pieces), switches


def exponent(sizes: np.ndarray, low: float, high: float) -> tuple[float, float]:
    """Maximum-likelihood exponent b of a density ∝ M^(−1−b) between two sizes, and its standard
    error (Hill's estimate, truncated above)."""
    x = np.log(sizes[(sizes >= low) & (sizes < high)] / low)
    top = np.log(high / low)
    grid = np.linspace(0.01, 4.0, 4000)
    mean = 1 / grid - top / np.expm1(grid * top)
    b = float(np.interp(-np.mean(x), -mean, grid))
    variance = 1 / b**2 - top**2 * np.exp(b * top) / np.expm1(b * top) ** 2
    return b, float(1 / np.sqrt(len(x) * variance))


def quakes() -> list[str]:
    """Sizes of events, as a picture and in words."""
    catalogue, switches = earthquakes(weakening_chain(QUAKE_BLOCKS), SECONDS)
    catalogue.plot().savefig(RESULTS / "chains.png", dpi=150)
    end = float(catalogue["start"].values[-1])
    # the first third is on its way to what goes on
    sizes, blocks = (catalogue[name].values[len(catalogue) // 3 :] for name in ("size", "contacts"))
    low, high, end_of_small = 5e-4, 5e-2, 1.0
    b, error = exponent(sizes, low, high)
    steeper, its_error = exponent(sizes, high, end_of_small)
    great = sizes >= 10.0
    counts = [
        np.count_nonzero((sizes >= 10.0**k) & (sizes < 10.0 ** (k + 1))) for k in range(-5, 3)
    ]
    table = " | ".join(map(str, counts))
    return [
        f"## Sizes of events, {QUAKE_BLOCKS} blocks, √(k_c/k) = {LENGTH:g}, α = {WEAKENING:g}, "
        f"σ = {DROP:g}, V = {SPEED:g}",
        "",
        f"{switches} switches up to t = {end:.0f}; {len(sizes)} events after the first third.",
        "",
        "| size from | " + " | ".join(f"1e{k}" for k in range(-5, 3)) + " |",
        "|---" * 9 + "|",
        f"| events | {table} |",
        "",
        f"Between {low:g} and {high:g} the numbers of events are proportional to size^(−b) with "
        f"b = {b:.2f} ± {error:.2f} ({np.log10(high / low):.0f} decades); from there to "
        f"{end_of_small:g} they decrease faster, b = {steeper:.2f} ± {its_error:.2f}. Smaller "
        "events involve a single block and have a characteristic size. Above a gap there are "
        f"{np.count_nonzero(great)} large events of "
        f"{np.median(blocks[great]) if np.any(great) else 0:.0f} blocks (median), which make up "
        f"{100 * sizes[great].sum() / sizes.sum():.1f} % of all slip. Carlson and Langer observed "
        "the same: a power law of small events, with b near 1, and an excess of large events.",
        "",
        "![sizes of events](chains.png)",
        "",
    ]


def main() -> None:
    """Run everything, print it and keep it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--blocks", type=int, help="measure one chain, in this process")
    n = parser.parse_args().blocks
    if n is not None:
        print(*measured(n))
        return
    from motion import machine  # here, so that a new process does not import all rivals

    lines = ["# Chains", "", machine(), "", *starts(), "", *quakes()]
    print("\n".join(lines))
    (RESULTS / "chains.md").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
