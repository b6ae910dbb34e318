"""Derivatives of measures of cycles, beside differences of cycles that are closed again."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.motion.audit.observers import LASTED, STUCK
from stickslip.motion.between.formulas import read_formula
from stickslip.orbits.cycles.over_period import extrema
from stickslip.sweeps.request.one_period import RULES

CATALOGUE: dict[str, tuple[str, tuple[str, ...]]] = {
    "belt_block": ("V", ("stick_fraction", "stick_fraction:belt contact", "rms:d_x")),
    "belt_stribeck": (
        "V",
        (
            "period",
            "energy_per_cycle",
            "energy_per_cycle:belt contact",
            "mean:friction_belt_contact",
            "low:x",
            "amplitude:d_x",
            "mean:energy",
            "rms:x",
            "crest:d_x*x",
            "harmonic:x",
            "stick_fraction",
        ),
    ),
    "forced_oscillator": (
        "omega",
        (
            "energy_per_cycle",
            "high:x*d_x",
            "mean:dd_x*x",
            "period",
            "rms:x",
            "crest:x",  # its least and its largest value have one modulus, and one derivative
            "harmonic:x",
            "phase:x",
            "relative_phase:x",
            "stick_fraction",
        ),
    ),
    "plate_compactor": ("m", ("energy_per_cycle", "energy_per_distance", "harmonic:x")),
    "woodpecker": (
        "e_1",
        (
            "energy_per_cycle",
            "high:d_y",
            "low:d_y**3",
            "high:d_phi_M*d_y",
            "rms:d_y",
            "crest:d_phi_M",
            "harmonic:y",  # which falls
            "stick_fraction",
        ),
    ),
    "prandtl_tomlinson": ("k", ("energy_per_distance", "mean:k*(X - x)", "high:k*(X - x)")),
    "two_leg_crawler": (
        "k",
        ("energy_per_cycle", "speed", "high:energy", "harmonic:x_1", "stick_fraction"),
    ),
    "jenkins_oscillator": (
        "P",
        (
            "energy_per_cycle",
            "energy_per_cycle:damper",
            "relative_phase:x",
            "stick_fraction:damper",
        ),
    ),
    "planar_jenkins": (
        "omega",
        ("energy_per_cycle", "energy_per_cycle:damper", "harmonic:x", "relative_phase:x"),
    ),
}


def measured(cycle: ss.Cycle, measure: str) -> float:
    """A measure of a cycle, from the cycle's own attributes."""
    name, _, of = measure.partition(":")
    if name in ("low", "high", "amplitude"):
        low, high = extrema(cycle.trajectory, {of: read_formula(cycle.system, of, "of")})[of]
        return {"low": low, "high": high, "amplitude": 0.5 * (high - low)}[name]
    if name == "energy_per_cycle":
        return cycle.contacts[of].dissipated if of else cycle.dissipated
    if name == "mean":
        return cycle.mean(of)
    if name == "cost_of_transport":
        return cycle.cost_of_transport(of)
    if name == "stick_fraction":
        sums = cycle.trajectory.audit.sums
        total = float(sums.total[STUCK]) if not of else cycle.contacts[of].stick_time
        return total / float(sums.total[LASTED])
    if name in ("rms", "crest", "harmonic", "phase", "relative_phase"):
        return RULES[name](cycle.trajectory, of)
    return getattr(cycle, name)


def compare(
    system: ss.System, p: str, of: tuple[str, ...], near: bool = True, rtol: float = 1e-8
) -> None:
    cycle = ss.find_cycle(system)
    found = cycle.sensitivity([p], of=of)
    value = system.values[p]
    h = 1e-4 * value

    def at(x: float) -> np.ndarray:
        moved = ss.find_cycle(system, start=cycle if near else None, parameters={p: x})
        return np.array([measured(moved, name) for name in of])

    rough, fine = ((at(value + d) - at(value - d)) / (2.0 * d) for d in (h, 0.5 * h))
    expected = (4.0 * fine - rough) / 3.0
    got = [float(found[name].sel(parameter=p)) for name in of]
    assert got == pytest.approx(expected.tolist(), rel=rtol, abs=1e-9)


@pytest.mark.parametrize("name", CATALOGUE)
def test_differences(name: str) -> None:
    """In stick and slip, with impacts, belts, drifts, and without mass."""
    p, of = CATALOGUE[name]
    compare(getattr(ss.catalogue, name)(), p, of, near=name != "planar_jenkins")


def clock() -> ss.System:
    """An escapement: a kick as often as the pendulum passes, which supplies what friction takes."""
    return ss.System(
        name="clock",
        parameters={"p": ss.Parameter(0.4), "c": ss.Parameter(0.1), "F": ss.Parameter(0.02)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        viscous="c/2*d_x**2",
        contacts={"rub": ss.Contact("d_x", "F")},
        jumps={"kick": ss.Jump("x - 0.1", {"d_x": "d_x + p"}, "rising")},
        outputs={"lost": "-friction_rub*slip_speed_rub"},
        initial={"x": -1.0},
    )


@pytest.mark.parametrize("p", ["p", "F"])
def test_jumps_that_supply(p: str) -> None:
    """What a jump supplies is dissipated in the period, and changes with it."""
    of = "energy_per_cycle", "period", "high:d_x", "mean:x**2", "high:energy", "mean:lost"
    compare(clock(), p, of)


def test_sliding_without_end() -> None:
    """The plate compactor's cost of transport is μ, whatever its weight is."""
    cycle = ss.find_cycle(ss.catalogue.plate_compactor())
    found = cycle.sensitivity(["mu", "m", "Omega"], of=["cost_of_transport:m*g"])
    assert found["cost_of_transport:m*g"].values == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)


def test_fast_modes_are_resolved() -> None:
    """The fastest mode of the cantilever turns a thousand times in a period."""
    compare(ss.catalogue.cantilever(), "omega", ("energy_per_cycle",), rtol=1e-9)


def test_bad_input() -> None:
    cycle = ss.find_cycle(ss.catalogue.belt_stribeck())
    for measure, reason in {
        "heigth:x": "Did you mean 'low'|unknown measure",
        "high:y": "unknown quantity",
        "speed": "does not drift",
        "speed:y": "not a component of the state",
        "energy_per_cycle:shoe": "unknown contact",
        "mean:abs(d_x)": "it has a kink that the motion does not have",
        "cost_of_transport:x": "x",
        "stick_fraction:shoe": "unknown contact",
        "phase:x": "no drive",
        "harmonic:V": "no first harmonic",
        "rms:x - x": "zero throughout",
    }.items():
        with pytest.raises(ss.DeclarationError, match=reason):
            cycle.sensitivity(["V"], of=[measure])
    with pytest.raises(ss.DeclarationError, match="does not depend on the initial state"):
        cycle.sensitivity(["x"])
