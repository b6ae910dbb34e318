"""Cycles whose halves mirror each other are fixed points of half of their return map."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from adversarial.kinds import branches
from stickslip.orbits.branches import chart as branch_chart
from stickslip.orbits.branches.chart import Chart, extent_of, first_chart
from stickslip.orbits.fields.mode_field import Pieces

SYMMETRIC = [
    (ss.catalogue.forced_oscillator(), "F_c", {}),
    (ss.catalogue.forced_oscillator(), "omega", {"omega": 0.8, "F_c": 0.3}),
    (ss.catalogue.jenkins_oscillator(), "omega", {}),
]


@pytest.fixture
def everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """The half map is used also if no multiplier is near 1."""
    monkeypatch.setattr(branch_chart, "_NEAR_ONE", np.inf)


def chart_of(cycle: ss.Cycle, parameter: str) -> tuple[Chart, np.ndarray]:
    """The chart of a branch that starts at a cycle."""
    value = cycle.parameters[parameter]
    pieces = Pieces(cycle.closed.orbit.problem.compiled.equations, parameter)
    extent = extent_of(cycle.closed, parameter, (0.9 * value, 1.1 * value))
    return first_chart(cycle.closed, pieces, extent, halves=True)


@pytest.mark.usefixtures("everywhere")
@pytest.mark.parametrize(("system", "parameter", "values"), SYMMETRIC)
def test_the_return_map_is_its_square(
    system: ss.System, parameter: str, values: dict[str, float]
) -> None:
    cycle = ss.find_cycle(system, parameters=values)
    chart, x = chart_of(cycle, parameter)
    assert chart.half is not None
    residual, _ = chart(x)
    assert np.max(np.abs(residual)) < 1e-9
    squares = np.sort(np.abs(chart.half.multipliers(chart.shooting, chart.orbit(x)) ** 2))
    known = np.sort(np.abs(chart.closed(x).spectrum.others))
    assert squares[len(squares) - len(known) :] == pytest.approx(known, abs=1e-7)


@pytest.mark.usefixtures("everywhere")
@pytest.mark.parametrize(("system", "parameter", "values"), SYMMETRIC)
def test_its_derivatives_are_those_of_differences(
    system: ss.System, parameter: str, values: dict[str, float]
) -> None:
    chart, x = chart_of(ss.find_cycle(system, parameters=values), parameter)
    J = chart(x)[1]
    for i, unit in enumerate(chart.scale(x)):
        step = np.zeros(len(x))
        step[i] = 1e-6 * unit
        difference = (chart(x + step)[0] - chart(x - step)[0]) / (2e-6 * unit)
        assert difference * unit == pytest.approx(J[:, i] * unit, abs=1e-5)


@pytest.mark.usefixtures("everywhere")
def test_none_without_the_symmetry() -> None:
    """A cycle without it, and equations that lose it where a parameter changes."""
    belt = ss.catalogue.belt_stribeck()
    assert chart_of(ss.find_cycle(belt), "V")[0].half is None
    given = ss.catalogue.forced_oscillator().configure({"force": "P*cos(omega*t) + F_c - 0.5"})
    assert chart_of(ss.find_cycle(given, parameters={"F_c": 0.6}), "F_c")[0].half is None


@pytest.mark.parametrize("seed", [29, 50])
def test_branch_points_are_solved(seed: int) -> None:
    """On branches of symmetric cycles, and where a branch becomes symmetric, which is a fold."""
    found = branches.branch_of(branches.draw("damper on a hardening spring", seed))
    assert isinstance(found, ss.Branch)
    assert found.certificate.ok, found.certificate.describe()
    points = found.of_kind("branch point")
    assert len(points) == 2
    assert max(point.residuals[0].value for point in points) < 1e-12
    if found.ended.startswith("first point: the branch is closed"):
        folds = [point.value for point in found.of_kind("fold")]
        assert sorted(p.value for p in points) == pytest.approx(sorted(folds), rel=1e-8)
