"""Derivatives of motions beside complex steps of closed forms, across slip, stick and impacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import pytest

import stickslip as ss
from oracles import complex_step
from stickslip.orbits.sensitivities.motion import sensitivities


def two_frictions() -> ss.System:
    """A block on a belt, whose friction is less in slip than in stick."""
    return ss.System(
        name="belt",
        parameters={
            name: ss.Parameter(value)
            for name, value in {
                "m": 1.2, "k": 0.9, "c": 0.15, "V": 0.2, "F_s": 1.0, "F_k": 0.6
            }.items()
        },
        coordinates={"x": ss.Inertial()},
        kinetic="m/2*d_x**2",
        potential="k/2*x**2",
        viscous="c/2*d_x**2",
        contacts={"belt": ss.Contact("d_x", "F_s", "V", kinetic="F_k")},
    )  # fmt: skip


TOLERANCE = 1e-11


class Case(NamedTuple):
    """A system, its closed forms, what differs from the defaults, and until when."""

    system: Callable[[], ss.System]
    forms: Callable[[], complex_step.ClosedForms]
    given: Mapping[str, float]
    start: Mapping[str, float]
    end: float
    least: int  # switches


CASES = {
    "forced oscillator with two stops": Case(
        ss.catalogue.forced_oscillator,
        complex_step.forced_coulomb_oscillator,
        {},
        {"x": 0.0, "d_x": 0.1},
        60.0,
        14,
    ),
    "forced oscillator without stops": Case(
        ss.catalogue.forced_oscillator,
        complex_step.forced_coulomb_oscillator,
        {"F_c": 0.3, "omega": 0.8},
        {"x": 0.1, "d_x": 0.2},
        40.0,
        9,
    ),
    "belt with static above kinetic friction": Case(
        two_frictions,
        complex_step.belt_with_two_frictions,
        {},
        {"x": 0.0, "d_x": 0.0},
        40.0,
        7,
    ),
    "belt with Stribeck's curve": Case(
        ss.catalogue.belt_stribeck,
        complex_step.belt_with_stribecks_curve,
        {},
        {"x": 0.5, "d_x": 0.0},
        16.0,
        4,
    ),
    "ball on a shaken plate": Case(
        ss.catalogue.bouncing_ball,
        complex_step.ball_on_a_shaken_plate,
        {"A": 0.02},
        {"y": 0.3, "d_y": 0.1},
        1.6,
        4,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_complex_step(name: str) -> None:
    """∂state/∂p at many times and ∂t/∂p of every switch, for all parameters and initial values, in
    units of the largest of each."""
    case = CASES[name]
    system = case.system()
    values = {**system.values, **case.given, **case.start}
    names = [n for n in values if n != "m" or name != "ball on a shaken plate"]
    times = np.linspace(0.0, case.end, 58)[1:]
    slopes, switches, late = complex_step.by_complex_step(case.forms(), values, names, times)
    assert len(switches) >= case.least

    motion = ss.simulate(
        system, (0.0, case.end), initial=dict(case.start), parameters=dict(case.given)
    )
    found = sensitivities(motion, names, times)
    assert found.missing == ()
    assert found.switch_times == pytest.approx(switches, abs=1e-9)
    for j, parameter in enumerate(names):
        size = max(float(np.max(np.abs(slopes[..., j]))), 1.0)
        assert found.slopes[..., j] == pytest.approx(slopes[..., j], abs=TOLERANCE * size), (
            parameter
        )
        size = max(float(np.max(np.abs(late[:, j]))), 1.0)
        assert found.switches[:, j] == pytest.approx(late[:, j], abs=TOLERANCE * size), parameter


def test_complex_step_of_a_ball_that_is_dropped() -> None:
    """The oracle itself: t = √(2h/g) and its derivatives."""
    values = {"g": 9.81, "e": 0.8, "A": 0.0, "omega": 1.0, "y": 1.0, "d_y": 0.0}
    forms = complex_step.ball_on_a_shaken_plate()
    found = complex_step.by_complex_step(forms, values, ["g", "y", "e"], np.array([0.5, 0.6]))
    t = math.sqrt(2.0 / 9.81)
    assert found[1] == pytest.approx([t], abs=1e-14)
    assert found[2][0] == pytest.approx([-t / (2 * 9.81), t / 2, 0.0], abs=1e-14)
