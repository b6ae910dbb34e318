"""Motions in steps with inputs from outside."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from signals import control_c

CUBIC: Any = "cubic"
MASS: dict[str, Any] = {
    "coordinates": {"x": ss.Inertial("m")},
    "kinetic": "d_x**2/2",
    "viscous": "0.05*d_x**2",
    "initial": {"x": 2.0},
}


def floor() -> ss.System:
    """A block that is thrown, lands, slides and rests on a floor that presses it by a force."""
    return ss.System(
        "floor",
        parameters={"F": 0.3},
        coordinates={"x": ss.Inertial("m"), "y": ss.Inertial("m")},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="9.81*y - F*x",
        contacts={"floor": ss.Unilateral("y", "d_x", mu=0.05, restitution=0.5)},
        initial={"y": 0.3, "d_x": 1.0},
    )


SYSTEMS = {
    "dry": ss.System(
        "dry",
        parameters={"F": 0.3, "k": 1.0},
        potential="k*x**2/2 - F*x",
        contacts={"ground": ss.Contact("d_x", 0.5)},
        **MASS,
    ),
    "a threshold": ss.System(
        "a threshold",
        parameters={"F": 0.3},
        potential="x**2/2",
        contacts={"ground": ss.Contact("d_x", "abs(F)", kinetic="0.7*abs(F)")},
        **MASS,
    ),
    "lands and rests": floor(),
    "in a plane": ss.System(
        "in a plane",
        parameters={"F": 0.3},
        coordinates={"x": ss.Inertial("m"), "y": ss.Inertial("m")},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="(x**2 + 2*y**2)/2 - F*(x + 0.5*y)",
        contacts={"table": ss.Contact(("d_x", "d_y"), 0.4)},
        initial={"x": 1.0, "y": -1.0},
    ),
    "rate-independent": ss.System(
        "rate-independent",
        parameters={"F": 0.3},
        coordinates={"x": ss.RateIndependent("m")},
        potential="x**2/2 - F*x",
        contacts={"ground": ss.Contact("d_x", 0.5)},
    ),
    "a law": ss.System(
        "a law",
        parameters={"F": 0.3},
        potential="x**2/2 - F*x",
        contacts={"ground": ss.laws.lugre("d_x", F_c=0.3, F_s=0.4, v_s=0.1, sigma_0=50, sigma_1=1)},
        **MASS,
    ),
    "a kink": ss.System(
        "a kink",
        parameters={"F": 0.3},
        potential="x**2/2 + 20*max(x - 1, 0)**2 - F*x",
        contacts={"ground": ss.Contact("d_x", 0.2)},
        **MASS,
    ),
    "a structure": ss.System(
        "a structure",
        parameters={"F": 0.3},
        structures={
            "u": ss.Structure(
                np.eye(3), 4.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1), 0.05 * np.eye(3)
            )
        },
        forces={"u[2]": "F"},
        contacts={"rub": ss.Contact("d_u[0]", 0.1)},
    ),
}


def recorded(system: ss.System, times: np.ndarray, values: np.ndarray, kind: str) -> ss.System:
    """The system with the input as a record."""
    parameters = {name: p for name, p in system.parameters.items() if name != "F"}
    drive = ss.Samples(times, values, kind=kind)  # type: ignore[arg-type]
    return replace(system, parameters=parameters, drives={"F": drive})


@pytest.mark.parametrize(
    ("name", "interpolation"),
    [
        (name, interpolation)
        for name in SYSTEMS
        for interpolation in ("hold", "linear")
        # without mass and viscosity, a force that jumps has no motion of finite rate
        if (name, interpolation) != ("rate-independent", "hold")
    ],
)
def test_steps_are_the_motion_under_the_recorded_input(name: str, interpolation: str) -> None:
    """Inputs that jump, or run in straight lines, from step to step: as samples of the same kind
    in one motion, at the ends of all steps."""
    system = SYSTEMS[name]
    times = np.linspace(0.0, 8.0, 41)
    values = 1.5 * np.sin(1.3 * times + 0.2)
    values[20:24] = values[20]  # steps without anything new
    stepper = ss.Stepper(
        system,
        inputs=["F"],
        interpolation=interpolation,  # type: ignore[arg-type]
        parameters={"F": values[0]},
    )
    shift = 0 if interpolation == "hold" else 1
    taken = [stepper.advance(t, {"F": values[i + shift]}) for i, t in enumerate(times[1:].tolist())]
    motion = ss.simulate(recorded(system, times, values, interpolation), (0.0, 8.0))
    assert motion.certificate.ok, motion.certificate.verdict
    whole = motion.at(times[1:])
    for quantity in taken[0]:
        found = [state[quantity] for state in taken]
        size = max(1.0, float(np.max(np.abs(whole[quantity]))))
        np.testing.assert_allclose(found, whole[quantity], atol=1e-9 * size, err_msg=quantity)
    assert stepper.motion.certificate.ok


def test_a_saved_state_is_where_it_goes_on() -> None:
    stepper = ss.Stepper(SYSTEMS["dry"], inputs=["F"])
    stepper.advance(0.7, {"F": 1.2})
    saved = stepper.save()
    first = [stepper.advance(t, {"F": 2.0}) for t in (1.0, 5.0)]
    stepper.restore(saved)
    assert stepper.time == 0.7 and stepper.inputs == {"F": 1.2}
    assert [stepper.advance(t, {"F": 2.0}) for t in (1.0, 5.0)] == first
    other = ss.Stepper(SYSTEMS["dry"], inputs=["F"])
    other.restore(saved)
    assert [other.advance(t, {"F": 2.0}) for t in (1.0, 5.0)] == first


def test_switches_within_a_step_are_exact() -> None:
    """A mass on dry ground under a constant force: it stops, and does so for good."""
    block = ss.System(
        "block",
        parameters={"F": 0.0},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="-F*x",
        contacts={"ground": ss.Contact("d_x", 1.0)},
        initial={"d_x": 1.0},
    )
    stepper = ss.Stepper(block, inputs=["F"])
    assert stepper.advance(10.0, {"F": 0.5}) == {"x": 1.0, "d_x": 0.0}
    assert stepper.motion.events["time"].tolist() == pytest.approx([2.0], rel=1e-15)


def test_a_drive_is_an_input_with_its_declared_value() -> None:
    system = ss.System(
        "driven",
        drives={"w": "2 + t"},
        coordinates={"x": ss.Viscous()},
        viscous="d_x**2/2",
        potential="-w*x",
        span=(1.0, 9.0),
    )
    stepper = ss.Stepper(system, inputs=["w"])
    assert stepper.time == 1.0
    assert stepper.inputs == {"w": 3.0}
    assert stepper.advance(2.0)["x"] == pytest.approx(3.0, rel=1e-14)
    assert stepper.advance(3.0, {"w": -1.0})["x"] == pytest.approx(2.0, rel=1e-14)


def test_a_long_step_has_as_many_knots_as_it_needs() -> None:
    belt = ss.catalogue.belt_block()
    stepper = ss.Stepper(belt)
    state = stepper.advance(2000.0)
    motion = ss.simulate(belt, (0.0, 2000.0))
    assert len(stepper.motion.knots.clock) > 500
    assert state["x"] == pytest.approx(motion.final["x"], abs=1e-9)
    assert stepper.motion.n_switches == motion.n_switches


def test_a_motion_that_ends_is_named_and_kept() -> None:
    system = ss.System(
        "blows up",
        parameters={"F": 0.0},
        coordinates={"x": ss.Viscous()},
        viscous="d_x**2/2",
        potential="-x**3/3 - F*x",
        initial={"x": 1.0},
    )
    stepper = ss.Stepper(system, inputs=["F"])
    stepper.advance(0.5)
    with pytest.raises(ss.ConvergenceError, match=r"the motion ends at t = 1: The motion diverges"):
        stepper.advance(2.0)
    assert stepper.time == pytest.approx(1.0, abs=1e-6) and stepper.state["x"] > 100.0


@pytest.mark.parametrize(
    ("made", "reason"),
    [
        (lambda s: ss.Stepper(s, inputs=["G"]), "is not a parameter or a drive"),
        (lambda s: ss.Stepper(s, interpolation=CUBIC), "interpolation"),
        (lambda s: ss.Stepper(s, initial={"z": 1.0}), "z"),
        (lambda s: ss.Stepper(s, time=math.inf), "time"),
        (lambda s: ss.Stepper(s, inputs=["F"]).advance(0.0), "To go back, restore"),
        (lambda s: ss.Stepper(s, inputs=["F"]).advance(math.nan), "time: expected a number"),
        (lambda s: ss.Stepper(s, inputs=["F"]).advance(1.0, {"k": 2.0}), "not an input"),
        (lambda s: ss.Stepper(s, inputs=["F"]).advance(1.0, {"F": math.nan}), "inputs.F"),
        (lambda s: ss.Stepper(s).motion, "no step has been taken"),
        (lambda s: ss.Stepper(s).restore(ss.Stepper(floor()).save()), "another system"),
    ],
)
def test_bad_input(made: Any, reason: str) -> None:
    with pytest.raises(ss.DeclarationError, match=reason):
        made(SYSTEMS["dry"])


def test_control_c_ends_a_long_step_where_it_is() -> None:
    stepper = ss.Stepper(ss.catalogue.belt_block(), max_events=10**9)
    with control_c(0.5), pytest.raises(KeyboardInterrupt):
        stepper.advance(1e9)
    assert 0.0 < stepper.time < 1e9
    assert stepper.advance(stepper.time + 1.0).keys() == {"x", "d_x"}
