"""Long-run behaviour of structures with dampers: ``python benchmarks/structures.py``.

A chain of 20 masses with one Jenkins element, by coordinates and by its matrices: a response
around its first resonance. The catalogue's cantilever in 20 coordinates: a backbone of 30
amplitudes. A chain of 100 masses with ten Jenkins elements: cycles from frequency to frequency,
each from the state of the one before, and in small steps from the cycle before, as a response has
them. Seconds of a processor, the least of some rounds, without what declaring and compiling takes;
prints the rows of the tables in ``benchmarks/results/structures.md``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import stickslip as ss

Array = Any
MANY = 20
PARAMETERS = {
    "omega": ss.Parameter(0.05),
    "F": ss.Parameter(0.05),
    "F_c": ss.Parameter(0.02),
}


def matrices(n: int) -> tuple[Array, Array]:
    """Mass and stiffness of a chain of unequal masses that is held at one end."""
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[-1, -1] = 1.0
    return np.diag(1.0 + 0.1 * np.arange(n)), stiffness


def by_matrices(n: int, dampers: int = 1) -> ss.System:
    """The chain as a structure, with dampers between its masses and the ground."""
    mass, stiffness = matrices(n)
    rubs = np.linspace(0, n, dampers + 2).astype(int)[1:-1].tolist()
    body = ss.Structure(mass, stiffness, 0.02 * stiffness, names={"tip": n - 1})
    return ss.System(
        "chain",
        parameters=PARAMETERS,
        structures={"u": body},
        forces={"u[tip]": "F*cos(omega*t)"},
        contacts={
            f"damper_{i}": ss.laws.jenkins(f"d_u[{at}]", F_c="F_c", k=0.5)
            for i, at in enumerate(rubs, 1)
        },
        span=(0.0, 1000.0),
    )


def by_coordinates(n: int) -> ss.System:
    """The same with one damper, as formulas."""
    mass, stiffness = matrices(n)
    q = [f"q{i}" for i in range(n)]

    def form(matrix: Array, rate: str) -> str:
        terms = np.argwhere(matrix).tolist()
        return " + ".join(
            f"({float(matrix[i, j])!r})/2*{rate}{q[i]}*{rate}{q[j]}" for i, j in terms
        )

    return ss.System(
        "chain",
        parameters=PARAMETERS,
        coordinates={x: ss.Inertial(force="F*cos(omega*t)" if x == q[-1] else 0.0) for x in q},
        kinetic=form(mass, "d_"),
        potential=form(stiffness, ""),
        viscous=form(0.02 * stiffness, "d_"),
        contacts={"damper_1": ss.laws.jenkins(f"d_q{n // 2}", F_c="F_c", k=0.5)},
        span=(0.0, 1000.0),
    )


def least(compute: Callable[[], Any], rounds: int) -> tuple[float, Any]:
    """Seconds of a processor that a computation takes at least, and its result."""
    times: list[float] = []
    found: Any = None
    for _ in range(rounds):
        begun = time.process_time()
        found = compute()
        times.append(time.process_time() - begun)
    return min(times), found


def response(system: ss.System, of: str, first: float, rounds: int) -> str:
    """A response around the first resonance."""
    span = (0.9 * first, 1.1 * first)
    ss.find_cycle(system, parameters={"omega": first})  # compiled
    seconds, found = least(
        lambda: ss.frequency_response(system, "omega", span, of=of, points=9), rounds
    )
    points = found.dataset.sizes["point"]
    good = "certified" if found.certificate.ok else "not certified"
    return f"{seconds:.1f} s, {points} points, {1e3 * seconds / points:.0f} ms each, {good}"


def backbone(rounds: int) -> str:
    """Thirty amplitudes, from where the damper sticks to where it hardly matters."""
    whole = ss.catalogue.cantilever(16)
    body: Any = whole.structures["u"]
    system = replace(whole, structures={"u": body.reduced(["rub", "tip"], MANY - 2)})
    given: Any = {"of": "u[tip]", "parameters": {"F": 0.0}}
    ss.backbone(system, (1e-4, 2e-4), points=2, **given)
    seconds, found = least(lambda: ss.backbone(system, (1e-4, 0.1), points=30, **given), rounds)
    slips = int(found["slips"].sum())
    good = "certified" if found.certificate.ok else "not certified"
    return f"{seconds:.1f} s, {len(found.amplitude)} amplitudes, of which {slips} slip, {good}"


def cycles(system: ss.System, first: float, points: int) -> str:
    """Cycles from frequency to frequency, each from the state of the one before."""
    state: dict[str, float] | None = None
    times: list[float] = []
    good = True
    for omega in np.linspace(0.98, 1.02, points).tolist():
        begun = time.process_time()
        found = ss.find_cycle(system, state, parameters={"omega": omega * first})
        good = found.certificate.ok and good
        times.append(time.process_time() - begun)
        knots = found.trajectory.knots
        state = dict(zip(system.declaration.state, map(float, knots.state[0]), strict=True))
        slips = sum(share.slip_time > 0.0 for share in found.contacts.values())
        print(f"  omega {omega:.3f}: {times[-1]:.1f} s, {len(knots.time)} knots, {slips} slip")
    said = "certified" if good else "not certified"
    return f"{min(times[1:]):.1f} to {max(times[1:]):.1f} s per point after the first, {said}"


def followed(system: ss.System, first: float, points: int) -> str:
    """Cycles each of which is followed from the one before, with their certificates."""
    found = ss.find_cycle(system, parameters={"omega": 0.98 * first})
    times: list[float] = []
    good = True
    for k in range(1, points + 1):
        begun = time.process_time()
        found = ss.find_cycle(system, found, parameters={"omega": (0.98 + 3e-4 * k) * first})
        good = found.certificate.ok and good
        times.append(time.process_time() - begun)
    said = "certified" if good else "not certified"
    return f"{min(times):.2f} to {max(times):.2f} s per point, {said}"


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", default="chain,backbone,large")
    given = parser.parse_args()
    body: Any = by_matrices(MANY).structures["u"]
    first = float(body.frequencies[0])
    if "chain" in given.only:
        print(f"formulas: {response(by_coordinates(MANY), 'q19', first, given.rounds)}")
        print(f"matrices: {response(by_matrices(MANY), 'u[tip]', first, given.rounds)}")
    if "backbone" in given.only:
        print(f"backbone: {backbone(given.rounds)}")
    if "large" in given.only:
        large = by_matrices(100, 10)
        body = large.structures["u"]
        print(f"large: {cycles(large, float(body.frequencies[0]), 4)}")
        print(f"large, followed: {followed(large, float(body.frequencies[0]), 4)}")


if __name__ == "__main__":
    main()
