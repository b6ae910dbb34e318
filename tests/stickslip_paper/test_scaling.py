"""Poincaré maps of the scaling limit: against closed forms in long arithmetic, reference 9, and
each other.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), section 3.3.
"""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp, mpf

from oracles import scaled_slider
from stickslip import catalogue
from stickslip.errors import DeclarationError
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip_paper.sections.scaling import (
    EQUATIONS,
    exact,
    lowest_order,
    scaling_study,
    stick_time,
)


@pytest.mark.parametrize("q", [1e-3, 0.1, 0.5, 0.9, 0.999, 1 - 2.0**-30])
def test_stick_time_is_the_inverse(q: float) -> None:
    with mp.workdps(40):
        root = mp.findroot(
            lambda T: mpf(q) * T + mp.expm1(-T), 2 * (1 - mpf(q)) if q > 0.9 else 1 / mpf(q)
        )
    assert stick_time(q) == pytest.approx(float(root), rel=1e-15 / min(1 - q, 1.0) + 1e-15)


@pytest.mark.parametrize("b", [0.05, 0.5, 1.0, 1.5])
def test_fixed_point_of_lowest_order(b: float) -> None:
    found = lowest_order(b, mu_0=1.3, v_hat=0.7).fixed_point()
    assert found.gamma == pytest.approx(
        float(scaled_slider.lowest_order_fixed_point(b, 1.3, 0.7)), rel=1e-11
    )
    assert found.stick.end == pytest.approx(found.gamma, rel=1e-11)


def test_published_fixed_point() -> None:
    assert lowest_order(1.0).fixed_point().gamma == pytest.approx(0.00590569826359391, rel=1e-13)


def test_fixed_point_falls_with_b() -> None:
    """From μ₀v̂ at b = 0 to 0 at b = 2."""
    found = [lowest_order(b).fixed_point().gamma for b in np.linspace(0.01, 1.99, 23)]
    assert np.all(np.diff(found) <= 0.0)
    assert found[0] == pytest.approx(1.0, abs=0.03)
    assert found[-1] == 0.0


def test_return_map_is_convex_and_increasing() -> None:
    psi = lowest_order(0.6)
    values = np.array([psi(g) for g in np.linspace(0.0, 0.99, 200)])
    assert np.all(np.diff(values) > 0.0)
    assert np.all(np.diff(values, 2) > 0.0)


@pytest.mark.parametrize(
    ("nu", "b", "mu_0", "v_hat"), [(1e-2, 1.0, 1.0, 1.0), (1e-3, 0.5, 1.5, 2.0)]
)
def test_exact_maps_of_the_linear_system(nu: float, b: float, mu_0: float, v_hat: float) -> None:
    maps = exact("(3.6)", nu, b, mu_0, v_hat)
    for gamma in (0.0, 0.3 * maps.centre, 0.8 * maps.centre):
        slip = maps.slip(gamma)
        duration, end = scaled_slider.slip(gamma, nu, b, mu_0, v_hat)
        assert (slip.duration, slip.end) == pytest.approx((float(duration), float(end)), rel=1e-11)
        stick = maps.stick(slip.end)
        duration, end = scaled_slider.stick(slip.end, nu, b, mu_0, v_hat)
        assert (stick.duration, stick.end) == pytest.approx(
            (float(duration), float(end)), rel=1e-10
        )


def test_reference_cycle() -> None:
    found = exact("(3.6)", 1e-2, 1.0).fixed_point()
    assert found.gamma == pytest.approx(0.0054267655331678199637, rel=1e-11)
    assert found.slip.end == pytest.approx(6.366083565301879946, rel=1e-12)
    assert found.slip.duration == pytest.approx(0.38862420022020717876, rel=1e-12)
    assert found.stick.duration == pytest.approx(7.0673964441874579179, rel=1e-12)


def test_fixed_point_is_the_cycle() -> None:
    values = {"nu": 0.01, "b": 0.8}
    found = exact("(3.5)", **values).fixed_point()
    cycle = find_cycle(
        catalogue.scaled_slider(), {"beta": 0.0, "gamma": found.gamma}, parameters=values
    )
    assert found.period == pytest.approx(cycle.period, rel=1e-10)
    assert found.slip.end == pytest.approx(cycle.extrema["gamma"][1], rel=0.2)


def test_scaled_and_original_variables_are_the_same_map() -> None:
    scaled, original = (exact(name, 1e-3, 0.7, 1.2, 0.8) for name in ("(3.5)", "(3.3)"))
    for gamma in (0.0, 0.3, 0.7):
        one, other = scaled.slip(gamma), original.slip(gamma)
        assert (one.end, one.duration) == pytest.approx((other.end, other.duration), rel=1e-8)
        one, other = scaled.stick(one.end), original.stick(one.end)
        assert (one.end, one.duration) == pytest.approx((other.end, other.duration), rel=1e-8)


def test_rates_of_convergence() -> None:
    study = scaling_study([1e-4, 1e-5, 1e-6], b=0.8)
    assert study["equation"].values.tolist() == list(EQUATIONS)
    assert study["order_slip_duration"].values == pytest.approx(0.5, abs=0.02)
    assert study["order_stick_duration"].values == pytest.approx(0.0, abs=0.02)
    assert study["order_gamma_error"].values == pytest.approx(0.5, abs=0.03)
    assert study["order_slip_map_error"].values == pytest.approx(0.5, abs=0.03)
    # Φ⁻ of the full system does not see √ν; that of (3.6) does, through its constant 1 − b√ν.
    assert study["order_stick_map_error"].values == pytest.approx([0.5, 1.0, 1.0], abs=0.02)
    slip = study["slip_duration"].sel(equation="(3.3)").values / np.sqrt(study["nu"].values)
    assert slip[-1] == pytest.approx(np.pi / np.sqrt(1 - 0.8**2 / 4), rel=2e-2)


def test_bad_arguments() -> None:
    with pytest.raises(DeclarationError, match=r"b: 2 is not in \(0, 2\)"):
        lowest_order(2.0)
    with pytest.raises(DeclarationError, match="unstable focus"):
        exact("(3.6)", 0.3, 0.5)
    with pytest.raises(DeclarationError, match="equation"):
        exact("(3.7)", 0.01, 0.5)
    with pytest.raises(DeclarationError, match="two different values"):
        scaling_study([1e-3])
    with pytest.raises(DeclarationError, match="or above"):
        lowest_order(1.0).stick(0.5)
