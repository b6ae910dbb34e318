"""Branches of systems with a table: what is measured is continuous with its slope at the knots."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss

SPEEDS = [0.0, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 2.0]
VALUES = [0.46, 0.38, 0.34, 0.31, 0.30, 0.295, 0.30, 0.32]


def brake(kind: Any) -> ss.System:
    return ss.System(
        "brake",
        parameters={
            "V": ss.Parameter(0.3),
            "N": ss.Parameter(20.0),
            "c": ss.Parameter(0.6),
        },
        tables={"mu": ss.Table(SPEEDS, VALUES, kind=kind)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="200*x**2",
        viscous="c/2*d_x**2",
        contacts={"disc": ss.Contact("d_x", "N*mu(0)", "V", kinetic="N*mu(speed)")},
        span=(0.0, 10.0),
    )


@pytest.mark.parametrize("kind", ["pchip", "cubic"])
def test_hopf_curves_pass_knots(kind: Any) -> None:
    """N = −c/μ'(V) on both sides of every knot, though the slope of the curve jumps there."""
    system = brake(kind)
    (hopf,) = ss.continue_equilibrium(system, "V", (0.12, 0.9)).of_kind("Hopf")
    ranges = {"V": (0.12, 0.9), "N": (1.0, 60.0)}
    curve = ss.hopf_curve(system, hopf, "V", "N", ranges=ranges)
    assert curve.certificate.ok
    speeds, forces = curve.points["V"].values, curve.points["N"].values
    assert np.all(np.diff(speeds) > 0.0) and forces[-1] == 60.0
    slopes = np.array([system.evaluate(f"d_mu({V!r})") for V in speeds.tolist()])
    np.testing.assert_allclose(forces, -0.6 / slopes, rtol=1e-10)
    assert [p.value for p in curve.of_kind("knot")] == pytest.approx(
        [v for v in SPEEDS if speeds[0] < v < speeds[-1]]
    )
    assert not curve.of_kind("boundary equilibrium")
    assert np.all(np.abs(curve.points["d_x"].values) < 1e-13)


def test_hopf_curves_end_at_kinks() -> None:
    """Across a knot of straight lines the slope jumps: the equilibrium is no Hopf point there."""
    system = brake("linear")
    steady = ss.continue_equilibrium(system, "V", (0.12, 0.9))
    assert not steady.of_kind("knot") and steady.of_kind("boundary equilibrium")


def test_rates_are_zero_along_a_curve() -> None:
    """A rate is known to rounding of what counts in it: both ends of the range are reached."""
    belt = ss.catalogue.belt_stribeck()
    (hopf,) = ss.continue_equilibrium(belt, "V", (0.1, 2.0)).of_kind("Hopf")
    ranges = {"V": (0.1, 2.0), "c": (0.01, 0.6)}
    curve = ss.hopf_curve(belt, hopf, "V", "c", ranges=ranges)
    assert curve.certificate.ok
    assert sorted(curve.points["c"].values[[0, -1]]) == pytest.approx([0.01, 0.6])


def test_knots_are_named_and_not_drawn() -> None:
    system = brake("pchip")
    cycles = ss.continue_cycle(ss.find_cycle(system), "V", (0.25, 0.45))
    knots = cycles.of_kind("knot")
    assert knots and {point.note for point in knots} == {"speed at a knot of mu is touched"}
    assert not cycles.of_kind("grazing") and "knot at" not in str(cycles.summary())
    figure = cycles.plot()
    legends = [text.get_text() for each in figure.legends for text in each.get_texts()]
    legends += [
        text.get_text()
        for ax in figure.axes
        if (own := ax.get_legend()) is not None
        for text in own.get_texts()
    ]
    assert "stable cycle with stick" in legends and "knot" not in legends
