"""Cycles on which a contact sticks throughout: the given position of rest is kept, and branches go
on through them.

While the damper of the Jenkins element sticks at z, the oscillator is linear: it swings about k_d
z/(k + k_d) with the amplitude F/|k + k_d − mω² + icω|, and the damper is held as long as k_d |x −
z| ≤ F_c.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from orbits.examples import jenkins
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.continuation.branch import Branch
from stickslip.orbits.cycles.find_cycle import find_cycle

RANGE = (1.0, 1.5)


def amplitude(omega: float, F: float = 0.3) -> float:
    return F / math.hypot(1.5 - omega**2, 0.02 * omega)


def onset(low: float, high: float, z: float = 0.0) -> float:
    """Where the force of the damper at z comes to its threshold: the amplitude about z/3 reaches z
    + 2 or 2 − z."""
    root: Any = brentq(
        lambda omega: amplitude(omega) + 2.0 / 3.0 * abs(z) - 2.0, low, high, xtol=1e-15
    )
    return root


@cache
def branch(omega: float, z: float | None = None) -> Branch:
    start = None if z is None else {"z": z}
    return continue_cycle(find_cycle(jenkins(), start, parameters={"omega": omega}), "omega", RANGE)


def clean(found: Branch) -> None:
    assert found.certificate.ok, found.certificate.describe()
    assert found.points["certified"].values.all()
    assert found.points["stable"].values.all()
    assert found.points["omega"].values[[0, -1]].tolist() == list(RANGE)
    assert (
        found.ended
        == "first point: omega = 1, the end of the range; last point: omega = 1.5, the end of the "
        "range"
    )


@pytest.mark.parametrize("z", [0.0, 0.2, -1.1])
def test_the_given_position_of_rest(z: float) -> None:
    cycle = find_cycle(jenkins(), {"z": z, "x": z / 3.0}, parameters={"omega": 0.7})
    assert cycle.certificate.ok, cycle.certificate.describe()
    assert cycle.state["z"] == pytest.approx(z, abs=1e-15)
    assert (cycle.slip_time, cycle.stick_time) == (0.0, pytest.approx(cycle.period))
    low, high = cycle.extrema["x"]
    assert (low, high) == pytest.approx((z / 3 - amplitude(0.7), z / 3 + amplitude(0.7)), rel=1e-11)
    # The position is forgotten by nothing; the rest decays as the linear oscillator does.
    assert cycle.trivial == 1
    assert cycle.stable
    expected = np.exp((-0.01 + 1j * math.sqrt(1.5 - 1e-4)) * cycle.period)
    above = cycle.nontrivial[np.argmax(np.imag(cycle.nontrivial))]
    assert above == pytest.approx(complex(expected.real, abs(expected.imag)), rel=1e-10)
    assert np.prod(cycle.nontrivial) == pytest.approx(math.exp(-0.02 * cycle.period), rel=1e-10)


@pytest.mark.parametrize("omega", [0.7, 0.72, 0.74, 0.8, 0.9, 1.1, 1.2, 1.3])
def test_one_period_of_the_drive(omega: float) -> None:
    """A transient with complex multipliers comes closest after several periods; the period is one
    all the same."""
    cycle = find_cycle(jenkins(), parameters={"omega": omega})
    assert cycle.certificate.ok, cycle.certificate.describe()
    assert cycle.period == pytest.approx(2 * math.pi / omega, rel=1e-14)


@pytest.mark.parametrize("omega", [1.05, 1.2])
def test_a_frequency_response_as_a_whole(omega: float) -> None:
    """From full stick through the onset of slip to stick-slip, and back; one name at both ends."""
    found = branch(omega)
    clean(found)
    assert [(point.kind, point.value) for point in found.special] == [
        ("slip onset", pytest.approx(onset(1.0, 1.2), rel=1e-9)),
        ("slip onset", pytest.approx(onset(1.25, 1.5), rel=1e-9)),
    ]
    values = found.points["omega"].values
    points = found.points
    linear = (values < onset(1.0, 1.2)) | (values > onset(1.25, 1.5))
    assert points["max_x"].values[linear] == pytest.approx(
        [amplitude(v) for v in values[linear]], rel=1e-8
    )
    assert np.abs(points["max_z"].values[linear]) == pytest.approx(0.0, abs=1e-8)
    slipping = points["slip_time"].values > 0.0
    assert slipping[(values > 1.17) & (values < 1.28)].all()
    assert points["max_x"].values[slipping].max() < amplitude(1.2)


def test_carried_along_the_edge() -> None:
    """From another position of rest the damper begins to slip one way: it is carried along until it
    slips both ways."""
    found = branch(1.05, 0.2)
    clean(found)
    first, both, last = found.special
    assert {point.kind for point in found.special} == {"slip onset"}
    assert "one direction" in first.note
    assert first.value == pytest.approx(onset(1.0, 1.2, 0.2), rel=1e-9)
    assert (both.value, last.value) == pytest.approx((onset(1.0, 1.2), onset(1.25, 1.5)), rel=1e-8)
    points = found.points
    values, z = points["omega"].values, points["min_z"].values
    edge = (values > first.value) & (values < both.value)
    assert np.count_nonzero(edge) > 3
    # On the edge k_d (z − x) = F_c at the lowest x = z/3 − amplitude.
    expected = [1.5 * (2.0 - amplitude(v)) for v in values[edge]]
    assert z[edge] == pytest.approx(expected, abs=1e-7)
    assert z[values < first.value - 1e-9] == pytest.approx(0.2, abs=1e-12)


def test_left_behind_by_a_falling_load() -> None:
    """Over the load: carried while it rises, one way, then both ways."""
    cycle = find_cycle(jenkins(), {"z": 0.2, "x": 0.2 / 3}, parameters={"omega": 1.2, "F": 0.02})
    found = continue_cycle(cycle, "F", (0.01, 0.2))
    assert found.certificate.ok, found.certificate.describe()
    unit = math.hypot(1.5 - 1.44, 0.02 * 1.2)
    assert [point.kind for point in found.special] == ["slip onset", "slip onset"]
    assert [point.value for point in found.special] == pytest.approx(
        [(2 - 0.4 / 3) * unit, 2 * unit], rel=1e-7
    )
    assert found.points["F"].values[[0, -1]].tolist() == [0.01, 0.2]
