"""Curves in two parameters on which cycles begin to stick."""

from __future__ import annotations

import numpy as np
import pytest

from oracles import den_hartog
from orbits.examples import SLIDER
from stickslip import catalogue
from stickslip.errors import DeclarationError
from stickslip.model.system import System
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.branches.onset_curve import stick_onset_curve
from stickslip.orbits.continuation.branch import Branch, SpecialPoint
from stickslip.orbits.cycles.find_cycle import find_cycle

OSCILLATOR = catalogue.forced_oscillator()


def onset(system: System, branch: Branch) -> SpecialPoint:
    (point,) = branch.of_kind("stick onset")
    assert branch.system == system
    return point


@pytest.fixture(scope="module")
def stops() -> SpecialPoint:
    """Where the forced oscillator begins to stop."""
    cycle = find_cycle(OSCILLATOR, parameters={"F_c": 0.7, "omega": 0.8})
    return onset(OSCILLATOR, continue_cycle(cycle, "F_c", (0.7, 0.9)))


def slider_onset(nu: float, V: tuple[float, float]) -> SpecialPoint:
    """Where the cycles from the Hopf point begin to stick."""
    point = continue_equilibrium(SLIDER, "V", V, parameters={"nu": nu}).of_kind("Hopf")[0]
    return onset(SLIDER, continue_cycle(find_cycle(SLIDER, point), "V", (point.value, V[1])))


def test_reversing(stops: SpecialPoint) -> None:
    """Den Hartog's limit of non-stop motion."""
    curve = stick_onset_curve(
        OSCILLATOR, stops, "F_c", "omega", ranges={"F_c": (0.1, 0.824), "omega": (0.75, 0.95)}
    )
    first, last = curve.ended.split("; ")
    found = {first.removeprefix("first point: "), last.removeprefix("last point: ")}
    assert found == {"omega = 0.75, the end of the range", "F_c = 0.824, the end of the range"}
    assert curve.points["certified"].values.all()
    assert not curve.points["sticks"].values.any()
    omega, F_c = curve.points["omega"].values, curve.points["F_c"].values
    assert len(omega) > 5
    assert F_c == pytest.approx([den_hartog.beta_lim(r) for r in omega], rel=1e-9)
    assert curve.points["period"].values == pytest.approx(2 * np.pi / omega, rel=1e-13)


def test_touching() -> None:
    """Unstable cycles of the spring slider, next to their fold: the curve meets onsets that were
    found on branches."""
    start = slider_onset(0.05, (0.2, 0.25))
    curve = stick_onset_curve(
        SLIDER, start, "V", "nu", ranges={"V": (0.1, 0.3), "nu": (0.044, 0.055)}
    )
    assert (
        curve.ended
        == "first point: nu = 0.044, the end of the range; last point: nu = 0.055, the end of the "
        "range"
    )
    assert curve.points["certified"].values.all()
    assert not curve.points["stable"].values.any()
    for i, nu in ((0, 0.044), (-1, 0.055)):
        assert float(curve.points["V"][i]) == pytest.approx(
            slider_onset(nu, (0.2, 0.25)).value, rel=1e-8
        )
    # Half-way, a motion that starts on the cycle touches the speed of rest: it sticks on one side
    # and not on the other.
    i = len(curve.points["V"]) // 2
    values = {name: float(curve.points[name][i]) for name in ("V", "nu")}
    start_there = {name: float(curve.points[name][i]) for name in ("U", "alpha")}
    period = float(curve.points["period"][i])
    sticking = []
    for d in (-1e-6, 1e-6):
        cycle = find_cycle(SLIDER, start_there, parameters={**values, "V": values["V"] + d})
        assert cycle.period == pytest.approx(period, rel=1e-3)
        sticking.append(cycle.sticks)
    assert sticking == [False, True]


def test_bad_arguments(stops: SpecialPoint) -> None:
    ranges = {"F_c": (0.1, 0.99), "omega": (0.75, 0.95)}
    hopf = continue_equilibrium(SLIDER, "V", (0.2, 0.25)).of_kind("Hopf")[0]
    with pytest.raises(DeclarationError, match="a special point of kind 'Hopf'"):
        stick_onset_curve(SLIDER, hopf, "V", "nu", ranges={"V": (0.1, 0.3), "nu": (0.04, 0.06)})
    with pytest.raises(DeclarationError, match="the same"):
        stick_onset_curve(OSCILLATOR, stops, "F_c", "F_c", ranges=ranges)
    with pytest.raises(DeclarationError, match=r"ranges.omega: the range is missing"):
        stick_onset_curve(OSCILLATOR, stops, "F_c", "omega", ranges={"F_c": (0.1, 0.99)})
    with pytest.raises(DeclarationError, match=r"ranges.F_c: the point lies at F_c = 0.81"):
        stick_onset_curve(OSCILLATOR, stops, "F_c", "omega", ranges={**ranges, "F_c": (0.1, 0.3)})
    with pytest.raises(DeclarationError, match="weight"):
        stick_onset_curve(
            OSCILLATOR, stops, "F_c", "weight", ranges={**ranges, "weight": (0.1, 0.3)}
        )
