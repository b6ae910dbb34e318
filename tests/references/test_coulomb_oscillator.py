"""Forced Coulomb oscillator with stops: m ẍ + k x + μ Sign(ẋ) ∋ F cos ωt, switches by closed form.

m = k = F = 1, μ = 0.5, ω = 0.5, x(0) = ẋ(0) = 0: slip stops and starts at the six printed times.
"""

import numpy as np
import pytest

from oracles import coulomb_oscillator
from stickslip import catalogue, simulate
from systems import distance, switches

pytestmark = pytest.mark.usefixtures("flow")

PRINTED = [
    2.318558961454817,
    2.941257811266674,
    7.229012432035236,
    7.642859644307301,
    12.770734250106242,
    13.804354019542556,
]


def test_switch_times() -> None:
    values = {"F_c": 0.5, "omega": 0.5}
    motion = simulate(
        catalogue.forced_oscillator(),
        (0.0, 14.0),
        initial={"x": 0.0, "d_x": 0.0},
        parameters=values,
    )
    assert motion.certificate.ok, motion.certificate.verdict
    assert distance(switches(motion)["time"], PRINTED) < 1e-12
    assert switches(motion)["to"].tolist() == ["stick", "slip-", "stick", "slip+", "stick", "slip-"]
    t = np.linspace(0.0, 14.0, 281)
    x, v = coulomb_oscillator.state(t, coulomb_oscillator.phases(14.0))
    assert distance(motion.at(t)["x"], x) < 1e-12
    assert distance(motion.at(t)["d_x"], v) < 1e-12


@pytest.mark.parametrize("seed", range(12))
def test_other_parameters(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, k, P = rng.uniform(0.5, 2, 3)
    F_c = rng.uniform(0.02, 0.9) * P
    omega = rng.uniform(0.15, 2.5)
    x, v = rng.normal(size=2)
    exact = coulomb_oscillator.phases(60.0, m, k, F_c, P, omega, x, v)
    start = {"x": x, "d_x": v}
    values = {"m": m, "k": k, "F_c": F_c, "P": P, "omega": omega}
    motion = simulate(catalogue.forced_oscillator(), (0.0, 60.0), initial=start, parameters=values)
    assert motion.certificate.ok, motion.certificate.verdict
    assert distance(switches(motion)["time"], [float(phase.start) for phase in exact[1:]]) < 1e-10
    t = np.linspace(0.0, 60.0, 101)
    assert distance(motion.at(t)["x"], coulomb_oscillator.state(t, exact)[0]) < 1e-10
