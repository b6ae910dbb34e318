"""Branches of the belt with falling friction: from every start the same clean curve, and curves in
two parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from orbits.examples import stribeck_belt
from stickslip.errors import DeclarationError
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.branches.equilibrium_curves import fold_curve, hopf_curve
from stickslip.orbits.branches.onset_curve import stick_onset_curve
from stickslip.orbits.continuation.branch import Branch
from stickslip.orbits.cycles.find_cycle import find_cycle

SPAN = (0.02, 4.0)
NUMBERS = {"F_s": 1.0, "F_k": 0.5, "v_s": 0.5, "m": 1.0, "k": 1.0, "c": 0.05}


@cache
def branch(
    V: float, parameter: str = "V", span: tuple[float, float] = SPAN, **others: float
) -> Branch:
    values = {**NUMBERS, **others}
    start = {"x": 0.95 * values["F_s"] / values["k"], "d_x": V}
    return continue_cycle(
        find_cycle(stribeck_belt(), start, parameters={**others, "V": V}), parameter, span
    )


def clean(branch: Branch, span: tuple[float, float]) -> None:
    """Every point certified and within the range, none twice, neighbours next to each other."""
    points = branch.points
    values = branch.points[branch.parameter].values
    assert branch.certificate.ok, branch.certificate.describe()
    assert points["certified"].values.all()
    assert span[0] <= values.min()
    assert values.max() <= span[1]
    assert points["step"].values[1:].min() > 0.0
    assert points["step"].values[1:].max() <= 0.3
    places = np.column_stack([values, points["period"].values, points["max_x"].values])
    assert len(np.unique(places.round(11), axis=0)) == len(places)
    multipliers = points["multiplier_real"].values
    trivial = np.argmin(np.abs(multipliers - 1.0), axis=1)
    rows = np.arange(len(trivial))
    assert multipliers[rows, trivial] == pytest.approx(1.0, abs=1e-9)
    assert np.array_equal(
        points["stable"].values == 1, np.abs(multipliers[rows, 1 - trivial]) < 1.0 - 1e-9
    )


@pytest.mark.parametrize("V", [0.3, 0.5, 1.0, 3.0])
def test_one_clean_curve(V: float) -> None:
    """From low speeds through the stick onset, where the branch turns, to the Hopf point, from
    every start the same."""
    found = branch(V)
    clean(found, SPAN)
    assert [point.kind for point in found.special] == ["stick onset", "fold", "Hopf"]
    onset, fold, hopf = found.special
    assert hopf.value == pytest.approx(0.5 * math.log(20.0), rel=1e-11)
    assert onset.value == fold.value == pytest.approx(branch(0.3).special[0].value, rel=1e-10)
    points = found.points
    assert points["V"].values[0] == 0.02
    assert found.ended.startswith(
        "first point: V = 0.02, the end of the range; last point: Hopf at V = 1.49786613678"
    )
    assert points["V"].values.max() == pytest.approx(onset.value, rel=1e-8)
    sticks = points["sticks"].values == 1
    away = np.abs(points["V"].values - onset.value) > 1e-6
    assert np.array_equal(sticks[away], points["stable"].values[away] == 1)


@pytest.mark.parametrize("V", [0.02, 0.3, 1.0, 2.9])
def test_against_an_independent_integration(V: float) -> None:
    """One slip from where the belt lets go to where it catches the mass again, and the stick in
    between, by SciPy."""
    stable = find_cycle(stribeck_belt(), {"x": 0.95, "d_x": V}, parameters={"V": V})
    slip, caught, lowest = one_slip(V)
    stick = (1.0 - 0.05 * V - caught) / V
    assert stable.period == pytest.approx(slip + stick, rel=1e-9)
    assert (stable.slip_time, stable.stick_time) == pytest.approx((slip, stick), rel=1e-7)
    assert stable.extrema["x"][0] == pytest.approx(lowest, abs=1e-9)


def one_slip(V: float) -> tuple[float, float, float]:
    """Duration of a slip, where it ends, and the least position in it."""

    def rates(t: float, y: np.ndarray) -> list[float]:
        friction = 0.5 + 0.5 * math.exp(-max(V - y[1], 0.0) / 0.5)
        return [y[1], friction - y[0] - 0.05 * y[1]]

    # The mass leaves the belt along a parabola: from rest on it with the rate -V of the force.
    first = 1e-4
    start = [1.0 - 0.05 * V + V * first, V - V * first**2 / 2]

    def caught(t: float, y: np.ndarray) -> float:
        return y[1] - V

    def lowest(t: float, y: np.ndarray) -> float:
        return y[1]

    caught.terminal = True  # type: ignore[attr-defined]
    caught.direction = 1.0  # type: ignore[attr-defined]
    lowest.direction = 1.0  # type: ignore[attr-defined]
    found = solve_ivp(
        rates,
        (first, 50.0),
        start,
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
        events=(caught, lowest),
    )
    return found.t_events[0][0], found.y_events[0][0][0], found.y_events[1][0][0]


NEIGHBOURS: list[tuple[str, tuple[float, float], dict[str, float]]] = [
    ("V", SPAN, {"F_k": 0.8, "k": 2.5, "m": 0.4}),
    ("F_k", (0.1, 0.95), {"c": 0.1}),
    ("c", (0.001, 0.6), {"v_s": 1.2}),
]


@pytest.mark.parametrize(("parameter", "span", "others"), NEIGHBOURS)
def test_neighbours_of_these_numbers(
    parameter: str, span: tuple[float, float], others: dict[str, float]
) -> None:
    found = branch(0.4, parameter, span, **others)
    clean(found, span)
    assert "no cycle was found" not in found.ended
    for end in found.ended.removeprefix("first point: ").split("; last point: "):
        assert "the end of the range" in end or "Hopf" in end


def test_ends_exactly_at_the_ends_of_a_range() -> None:
    found = branch(0.5, "V", (0.31, 0.77))
    assert found.points["V"].values[[0, -1]].tolist() == [0.31, 0.77]
    assert not found.special


def test_hopf_points_in_two_parameters() -> None:
    ranges = {"V": SPAN, "v_s": (0.05, 2.0)}
    (point,) = continue_equilibrium(stribeck_belt(), "V", SPAN).of_kind("Hopf")
    curve = hopf_curve(stribeck_belt(), point, "V", "v_s", ranges=ranges)
    V, v_s = (curve.points[name].values for name in ("V", "v_s"))
    assert curve.certificate.ok, curve.certificate.describe()
    assert pytest.approx(V, rel=1e-10) == v_s * np.log(0.5 / (0.05 * v_s))
    assert sorted(v_s[[0, -1]].tolist()) == [0.05, 2.0]
    assert curve.points["frequency"].values == pytest.approx(1.0, rel=1e-10)


def test_stick_onsets_in_two_parameters() -> None:
    """The curve ends at the ends of the ranges; branches across it meet it, beyond it nothing is
    computed."""
    ranges = {"V": SPAN, "v_s": (0.4, 0.6)}
    onset = branch(1.0).of_kind("stick onset")[0]
    curve = stick_onset_curve(stribeck_belt(), onset, "V", "v_s", ranges=ranges)
    assert curve.certificate.ok, curve.certificate.describe()
    assert sorted(curve.points["v_s"].values[[0, -1]].tolist()) == [0.4, 0.6]
    for i in (0, -1):
        v_s, V = float(curve.points["v_s"][i]), float(curve.points["V"][i])
        across = branch(V - 0.05, "V", (V - 0.1, V + 0.1), v_s=v_s)
        assert across.of_kind("stick onset")[0].value == pytest.approx(V, rel=1e-7)


@pytest.mark.parametrize("shift", [-1e-9, -3e-10, 3e-10, 1e-9])
def test_the_curve_starts_from_either_side_of_the_onset(shift: float) -> None:
    """A point that rounding has put where the contact sticks for a moment."""
    onset = branch(1.0).of_kind("stick onset")[0]
    shifted = onset.parameters | {"V": onset.parameters["V"] + shift}
    point = replace(onset, parameters=shifted)
    ranges = {"V": SPAN, "v_s": (0.49, 0.51)}
    curve = stick_onset_curve(stribeck_belt(), point, "V", "v_s", ranges=ranges)
    assert curve.certificate.ok, curve.certificate.describe()


def test_a_fold_that_is_not_smooth_points_to_the_onset() -> None:
    ranges = {"V": SPAN, "v_s": (0.05, 2.0)}
    with pytest.raises(DeclarationError, match="stick_onset_curve"):
        fold_curve(stribeck_belt(), branch(1.0).of_kind("fold")[0], "V", "v_s", ranges=ranges)


def pictures() -> list[Callable[[], Branch]]:
    ranges = {"V": (1.0, 2.0), "v_s": (0.4, 0.6)}

    def hopf() -> Branch:
        start = continue_equilibrium(stribeck_belt(), "V", SPAN).of_kind("Hopf")[0]
        return hopf_curve(stribeck_belt(), start, "V", "v_s", ranges=ranges)

    def onset() -> Branch:
        start = branch(1.0).of_kind("stick onset")[0]
        return stick_onset_curve(
            stribeck_belt(), start, "V", "v_s", ranges={"V": (2.9, 3.2), "v_s": (0.45, 0.55)}
        )

    return [hopf, onset]


@pytest.mark.parametrize("made", pictures(), ids=["Hopf", "stick onset"])
def test_pictures_of_curves(made: Callable[[], Branch]) -> None:
    """In the plane of the two parameters, from end to end."""
    curve = made()
    (axes,) = curve.plot().axes
    drawn = np.concatenate([np.asarray(line.get_xydata()) for line in axes.get_lines()])
    expected = np.column_stack([curve.points["V"].values, curve.points["v_s"].values])
    assert np.unique(drawn, axis=0) == pytest.approx(np.unique(expected, axis=0))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$V$", r"$v_{s}$")
