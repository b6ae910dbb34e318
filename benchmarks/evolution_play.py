"""Speed of the play: one compiled pass over samples, against a loop with the same memory traffic.

:func:`play_table` is a part of ``benchmarks/evolution.py``. The triad z[k] = min(max(y[k], L[k]),
U[k]) has no recurrence, so that it runs as fast as the memory delivers. It is timed twice: with y =
z, which moves as many bytes as the play (L and U read, z fetched and written), and with a y of its
own, which moves a third more.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rivals import time_interleaved
from stickslip.arrays import Array, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.rate_independent.play.clamp import clamp_samples, prandtl_ishlinskii
from stickslip.rate_independent.play.operator import play

SIZES = (10**7, 10**8)


@entry_point()
def triad(y: Vector, L: Vector, U: Vector, z: Vector) -> None:
    """The play without its recurrence."""
    for k in range(len(L)):
        v = y[k]
        low = L[k]
        high = U[k]
        v = low if v < low else v
        z[k] = high if v > high else v


def loads(n: int) -> dict[str, Array]:
    """Loads to sample: many loops, the same with noise, and the single way up and down of [M]
    section 2.2."""
    t = np.linspace(0.0, 5.0, n)
    many = 5.0 * np.sin(20.0 * np.pi * t)
    noise = np.random.default_rng(0).normal(size=n)
    return {
        "50 loops": many,
        "50 loops, noisy": many + noise,
        "5t − t², period 0.1": 5.0 * t - t**2,
    }


def thresholds(n: int) -> Array:
    """1 + cos(2πt/ε)/2 at the same samples, ε = 0.1."""
    return 1.0 + 0.5 * np.cos(20.0 * np.pi * np.linspace(0.0, 5.0, n))


def once(run: Callable[[], Any]) -> Callable[[], tuple[Array, int]]:
    """What `time_interleaved` takes."""

    def timed() -> tuple[Array, int]:
        run()
        return np.empty(0), 0

    return timed


def play_table(sizes: tuple[int, ...] = SIZES) -> list[str]:
    """Nanoseconds per sample of the play and of the two triads, in turn, and their ratios."""
    lines = [
        "| load | samples | play, ns per sample | triad, same traffic | ratio | triad of four "
        "arrays | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for n in sizes:
        rho = thresholds(n)
        z = np.zeros(n)
        y = np.zeros(n)
        for name, load in loads(n).items():
            L = load - rho
            U = load + rho
            runs = {
                "play": once(lambda L=L, U=U, z=z: clamp_samples(L, U, 0.0, z)),
                "same": once(lambda L=L, U=U, z=z: triad(z, L, U, z)),
                "four": once(lambda L=L, U=U, z=z, y=y: triad(y, L, U, z)),
            }
            spent = {key: 1e9 * seconds / n for key, seconds in time_interleaved(runs).items()}
            own = spent["play"]
            same = spent["same"]
            four = spent["four"]
            lines.append(
                f"| {name} | {n:.0e} | {own:.2f} | {same:.2f} | {own / same:.2f} | {four:.2f} | "
                f"{own / four:.2f} |"
            )
    return lines


def whole_play_table() -> list[str]:
    """Seconds for the whole call: signals, nodes, positions and modes."""
    n = 10**6
    t = np.linspace(0.0, 5.0, n)
    sampled = loads(n)["50 loops, noisy"]
    radii = np.linspace(0.0, 3.0, 100)
    weights = np.full(100, 0.01)
    formula = ("5*t - t**2", "1 + cos(2*pi*s)/2", (0.0, 5.0))
    cases: dict[str, Callable[[], Any]] = {
        "play, formulas, 50 periods": lambda: play(*formula, initial=0.0, epsilon=1e-1),
        "play, formulas, 50,000 periods": lambda: play(*formula, initial=0.0, epsilon=1e-4),
        "play, 1e6 samples": lambda: play((t, sampled), 1.0, (0.0, 5.0), initial=float(sampled[0])),
        "Prandtl–Ishlinskii, 100 plays, 1e6 samples": lambda: prandtl_ishlinskii(
            sampled, radii, weights
        ),
    }
    spent = time_interleaved({name: once(run) for name, run in cases.items()}, rounds=5)
    return [
        "| call | seconds |",
        "|---|---|",
        *(f"| {name} | {seconds:.3g} |" for name, seconds in spent.items()),
    ]


if __name__ == "__main__":
    print("\n".join([*play_table(), "", *whole_play_table()]))
