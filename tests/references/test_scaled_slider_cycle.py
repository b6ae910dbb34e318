"""The cycle of the scaled slider, found as a cycle: period, multiplier and switches against 40
digits.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), (3.6) with ν = 1e-2, b = 1, μ₀ = v̂ = 1, and the fixed point γ_b of the
lowest-order maps of section 3.3.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from oracles import scaled_slider
from stickslip import catalogue
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle

GAMMA_SLIP = 0.0054267655331678199637
GAMMA_STICK = 6.366083565301879946
SLIP = 0.38862420022020717876
STICK = 7.0673964441874579179
MULTIPLIER = 0.028162086887829495
GAMMA_B = 0.00590569826359391


def cycle(**values: float) -> Cycle:
    found = find_cycle(catalogue.scaled_slider_limit(), parameters=values)
    assert found.trajectory.certificate.ok, found.trajectory.certificate.verdict
    return found


def phases(found: Cycle) -> tuple[float, float]:
    """Durations of slip (β ≥ 0) and stick."""
    assert len(found.phases) == 2
    slip, stick = sorted(found.phases, key=lambda phase: phase.duration)
    assert (slip.region, stick.region) == ((1,), (0,))
    return slip.duration, stick.duration


def switches(found: Cycle) -> tuple[float, float]:
    """γ at the start and at the end of slip."""
    events = found.trajectory.events
    above, below = (
        float(events.loc[events["to"] == to, "gamma"].iloc[0]) for to in ("above", "below")
    )
    return above, below


def test_reference() -> None:
    found = cycle(nu=0.01, b=1.0)
    assert found.period == pytest.approx(SLIP + STICK, rel=1e-12)
    assert found.nontrivial == pytest.approx([MULTIPLIER], rel=1e-11)
    assert found.multipliers[0] == pytest.approx(1.0, abs=1e-11)
    assert found.stable
    assert phases(found) == pytest.approx((SLIP, STICK), rel=1e-11)
    assert switches(found) == pytest.approx((GAMMA_SLIP, GAMMA_STICK), rel=1e-11)
    # γ turns where γ' = β⁺ − γ = 0, in slip: after its start and after its end γ is beyond.
    assert found.extrema["gamma"][0] <= GAMMA_SLIP
    assert found.extrema["gamma"][1] >= GAMMA_STICK


@pytest.mark.parametrize(
    ("nu", "b", "mu_0", "v_hat"),
    [(1e-2, 0.7, 1.5, 2.0), (1e-3, 0.5, 1.0, 1.0), (1e-4, 1.3, 0.8, 0.3)],
)
def test_other_parameters(nu: float, b: float, mu_0: float, v_hat: float) -> None:
    known = scaled_slider.cycle(nu, b, mu_0, v_hat, digits=20)
    found = cycle(nu=nu, b=b, mu_0=mu_0, v_hat=v_hat)
    assert found.period == pytest.approx(
        float(known.slip_duration + known.stick_duration), rel=1e-10
    )
    assert found.nontrivial == pytest.approx([float(known.multiplier)], rel=1e-9)
    assert switches(found) == pytest.approx(
        (float(known.gamma_slip), float(known.gamma_stick)), rel=1e-9
    )


def test_every_cycle_of_a_branch() -> None:
    """Period and multiplier along b, from a cycle that almost vanishes to a large one."""
    branch = continue_cycle(cycle(nu=0.01, b=1.0), "b", (0.3, 1.6))
    assert branch.points["certified"].values.all()
    assert not branch.special
    for i in range(0, len(branch.points["b"]), 5):
        known = scaled_slider.cycle(0.01, float(branch.points["b"][i]), digits=20)
        period = float(known.slip_duration + known.stick_duration)
        assert branch.points["period"].values[i] == pytest.approx(period, rel=1e-10)
        assert branch.points["multiplier_real"].values[i, 1] == pytest.approx(
            float(known.multiplier), rel=1e-9
        )


def test_fixed_point_of_the_lowest_order_maps() -> None:
    """γ at the start of slip is γ_b + c√ν + …: from √ν = h and h/2 and h/4 follows γ_b up to
    O(h³)."""
    gammas = [switches(cycle(nu=(4e-3 / 2**i) ** 2, b=1.0))[0] for i in range(3)]
    first = 2 * np.array(gammas[1:]) - np.array(gammas[:-1])
    second = (4 * first[1] - first[0]) / 3
    assert second == pytest.approx(GAMMA_B, rel=1e-6)
    assert float(scaled_slider.lowest_order_fixed_point(1)) == pytest.approx(GAMMA_B, rel=1e-14)
    assert abs(second - GAMMA_B) < 0.1 * abs(first[1] - GAMMA_B) < 0.1 * math.sqrt(4e-3) * GAMMA_B
