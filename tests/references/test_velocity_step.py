"""Velocity steps on rate-and-state friction.

J. H. Dieterich, *J. Geophys. Res.* 84 (1979), 2161; A. Ruina, *J. Geophys. Res.* 88 (1983), 10359;
C. Marone, *Annu. Rev. Earth Planet. Sci.* 26 (1998), 643: friction rises by a ln(V_2/V_1) at once,
falls by b ln(V_2/V_1) over the slip D_c, and what is left is (a − b) ln(V_2/V_1).
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss

STEADY = {"mu": 0.6, "phi": 0.0}


@pytest.mark.parametrize("law", ["ageing", "slip"])
def test_against_the_equations_as_printed(law: str) -> None:
    """In v and θ, by DOP853 from the step on."""
    evolution = {"ageing": "1 - Omega", "slip": "-Omega*log(Omega)"}[law]
    system = ss.catalogue.velocity_step(evolution=evolution)
    p = system.values
    motion = ss.simulate(system, (0.0, 40.0), rtol=1e-12)
    assert motion.certificate.ok

    def rates(_: float, y: np.ndarray) -> list[float]:
        mu, theta = y
        v = p["v_0"] * math.exp(
            (mu - p["mu_0"] - p["b"] * math.log(p["v_0"] * theta / p["D_c"])) / p["a"]
        )
        omega = v * theta / p["D_c"]
        return [
            p["k"] * (p["V_2"] - v),
            1.0 - omega if law == "ageing" else -omega * math.log(omega),
        ]

    times = np.linspace(p["t_step"], 40.0, 30)
    start = [p["mu_0"], p["D_c"] / p["v_0"]]
    found = solve_ivp(rates, (times[0], 40.0), start, "DOP853", times, rtol=1e-12, atol=1e-14)
    values = motion.at(times)
    assert np.max(np.abs(values["mu"] - found.y[0])) < 1e-10
    theta = p["D_c"] / p["v_0"] * np.exp(values["phi"])
    assert np.max(np.abs(theta / found.y[1] - 1.0)) < 1e-9


def test_a_stiff_apparatus_shows_a_and_b() -> None:
    """As k → ∞ the sample slides at the speed of the load point: closed forms of both effects."""
    system = ss.catalogue.velocity_step(k=50.0)
    p = system.values
    motion = ss.simulate(system, (0.0, 60.0))
    step = math.log(p["V_2"] / p["V_1"])
    high = float(np.max(motion.at(np.linspace(20.0, 20.1, 2001))["mu"]))
    assert high - p["mu_0"] == pytest.approx(p["a"] * step, rel=2e-2)
    late = motion.at(60.0)["mu"]
    assert late == pytest.approx(system.evaluate("steady_after"), abs=1e-9)
    assert late - p["mu_0"] == pytest.approx((p["a"] - p["b"]) * step, rel=1e-6)
    # θ = D_c/V_2 + (D_c/V_1 − D_c/V_2) exp(−V_2 t/D_c) in between.
    t = 1.0
    theta = p["D_c"] * (
        1.0 / p["V_2"] + (1.0 / p["V_1"] - 1.0 / p["V_2"]) * math.exp(-p["V_2"] * t / p["D_c"])
    )
    expected = p["mu_0"] + p["a"] * step + p["b"] * math.log(p["v_0"] * theta / p["D_c"])
    assert motion.at(p["t_step"] + t)["mu"] == pytest.approx(expected, abs=2e-5)
