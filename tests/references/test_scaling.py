"""The scaled slider at lowest order as a limit of the spring slider.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017): with V = ν v̂, U = μ̃(α) + ν²β, α = 1 + νγ, μ̃(α) = μ(νγ) + √ν B the slider
(3.3) is (3.5), and (3.6) at lowest order in √ν.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from oracles import scaled_slider
from stickslip import System, catalogue, simulate
from systems import distance, parameters

pytestmark = pytest.mark.usefixtures("flow")

V_HAT = 1.0
B = 1.0  # = b μ₀ with μ₀ = 1, μ(s) = e^{−s}, so that 1 + μ(0)μ'(0) = 0


@cache
def slider() -> System:
    """(3.3) with μ̃(α) = e^{1 − α} + shift."""
    base = catalogue.spring_slider(mu="exp(1 - alpha)")
    functions = {"mu(alpha)": "exp(1 - alpha) + shift"}
    declared = {**base.parameters, **parameters(shift=0.0)}
    return replace(base, parameters=declared, functions=functions, facts={})


def cycle(nu: float) -> tuple[float, float, float]:
    """γ at the start and at the end of slip and the duration of stick, of the cycle of (3.3)."""
    shift = math.sqrt(nu) * B
    values = {"nu": nu, "V": nu * V_HAT, "shift": shift}
    motion = simulate(
        slider(), (0.0, 100.0), initial={"U": 1.0 + shift, "alpha": 1.0}, parameters=values
    )
    # Velocities (U − μ̃)/ν are known to rounding over ν; the slips of smaller ν have less energy
    # than that.
    assert motion.certificate.ok or nu < 1e-5, motion.certificate.verdict
    starts, stops = (motion.events.loc[motion.events["to"] == to] for to in ("slip-", "stick"))
    time = starts["time"].iloc[-1]
    before = stops[stops["time"] < time].iloc[-1]
    return (starts["alpha"].iloc[-1] - 1) / nu, (before["alpha"] - 1) / nu, time - before["time"]


def test_same_motion_in_scaled_variables() -> None:
    nu = 1e-2
    shift = math.sqrt(nu) * B
    t = np.linspace(0.0, 60.0, 601)
    values = {"nu": nu, "V": nu * V_HAT, "shift": shift}
    original = simulate(
        slider(),
        (0.0, 60.0),
        initial={"U": 1.0 + shift, "alpha": 1.0},
        parameters=values,
        rtol=1e-12,
    ).at(t)
    scaled = simulate(
        catalogue.scaled_slider(),
        (0.0, 60.0),
        initial={"beta": 0.0, "gamma": 0.0},
        parameters={"nu": nu, "b": B},
    ).at(t)
    assert distance(original["alpha"], 1 + nu * scaled["gamma"]) < 1e-11
    mu = np.exp(1 - original["alpha"]) + shift
    assert distance(original["U"], mu + nu**2 * scaled["beta"]) < 1e-10


def test_converges_like_the_root_of_nu() -> None:
    errors = []
    for nu in (1e-4, 1e-5, 1e-6, 1e-7):
        exact = scaled_slider.cycle(nu, B, digits=15)
        errors.append(
            [
                abs(a - float(e))
                for a, e in zip(cycle(nu), (exact[0], exact[1], exact[3]), strict=True)
            ]
        )
    orders = np.log10(np.divide(errors[:-1], errors[1:]))
    assert np.all(np.diff(errors, axis=0) < 0)
    assert orders[-1] == pytest.approx(0.5, abs=0.03)
    assert np.all(np.array(errors[-1]) < [1e-3, 3e-2, 3e-2])
