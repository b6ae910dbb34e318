"""The cycle of the scaled slider at lowest order, in arithmetic of 40 digits.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), (3.6) with ν = 1e-2, b = 1, μ₀ = v̂ = 1.
"""

import math

import numpy as np
import pytest

from oracles import scaled_slider
from stickslip import Trajectory, catalogue, simulate
from systems import distance

pytestmark = pytest.mark.usefixtures("flow")

GAMMA_SLIP = 0.0054267655331678199637
GAMMA_STICK = 6.366083565301879946
SLIP = 0.38862420022020717876
STICK = 7.0673964441874579179
MULTIPLIER = 0.028162086887829495


def follow(gamma: float, until: float, **values: float) -> Trajectory:
    motion = simulate(
        catalogue.scaled_slider_limit(),
        (0.0, until),
        initial={"beta": 0.0, "gamma": gamma},
        parameters=values,
    )
    assert motion.outcome.ok
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


def test_cycle() -> None:
    motion = follow(GAMMA_SLIP, 10 * (SLIP + STICK) + 1.0, nu=0.01, b=1.0)
    events = motion.events
    assert events["to"].tolist()[:4] == ["below", "above", "below", "above"]
    stops, starts = (events[events["to"] == to] for to in ("below", "above"))
    assert distance(starts["gamma"], GAMMA_SLIP) < 1e-13
    assert distance(stops["gamma"], GAMMA_STICK) < 1e-11
    times = np.array([0.0, *events["time"]])
    assert distance(np.diff(times)[::2], SLIP) < 1e-11
    assert distance(np.diff(times)[1::2], STICK) < 1e-11


def test_any_start_settles_on_it() -> None:
    for gamma in (0.0, 0.9, 3.0):
        events = follow(gamma, 100.0, nu=0.01, b=1.0).events
        assert events.loc[events["to"] == "above", "gamma"].iloc[-1] == pytest.approx(
            GAMMA_SLIP, rel=1e-11
        )
        assert events.loc[events["to"] == "below", "gamma"].iloc[-1] == pytest.approx(
            GAMMA_STICK, rel=1e-11
        )


def test_multiplier() -> None:
    def image(gamma: float) -> float:
        events = follow(gamma, SLIP + STICK + 0.1, nu=0.01, b=1.0).events
        return float(events.loc[events["to"] == "above", "gamma"].iloc[0])

    h = 1e-3 * GAMMA_SLIP
    far, near = (image(GAMMA_SLIP + n * h) - image(GAMMA_SLIP - n * h) for n in (2, 1))
    assert (8 * near - far) / (12 * h) == pytest.approx(MULTIPLIER, rel=1e-8)
    # Liouville: the divergence is b/√ν − 1 in slip and −1 in stick.
    assert math.exp(9 * SLIP - STICK) == pytest.approx(MULTIPLIER, rel=1e-14)


@pytest.mark.parametrize(
    ("nu", "b", "mu_0", "v_hat"),
    [(1e-2, 0.7, 1.5, 2.0), (1e-3, 0.5, 1.0, 1.0), (1e-4, 1.3, 0.8, 0.3)],
)
def test_other_parameters(nu: float, b: float, mu_0: float, v_hat: float) -> None:
    cycle = scaled_slider.cycle(nu, b, mu_0, v_hat, digits=20)
    values = {"nu": nu, "b": b, "mu_0": mu_0, "v_hat": v_hat}
    motion = follow(float(cycle.gamma_slip), 50.0, **values)
    stops, starts = (motion.events[motion.events["to"] == to] for to in ("below", "above"))
    assert distance(starts["gamma"] / float(cycle.gamma_slip), 1.0) < 1e-9
    assert distance(stops["gamma"] / float(cycle.gamma_stick), 1.0) < 1e-11
    period = float(cycle.slip_duration + cycle.stick_duration)
    assert distance(np.diff(np.asarray(starts["time"])), period) < 1e-10


def test_lowest_order_fixed_point() -> None:
    fixed = float(scaled_slider.lowest_order_fixed_point(1))
    gaps = []
    for nu in (1e-4, 1e-6):
        events = follow(0.4, 60.0, nu=nu, b=1.0).events
        gaps.append(abs(float(events.loc[events["to"] == "above", "gamma"].iloc[-1]) - fixed))
    assert gaps[0] / gaps[1] == pytest.approx(10, rel=0.1)  # O(√ν)
