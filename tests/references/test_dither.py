"""Dry friction smoothed by dither.

J. J. Thomsen, *Using fast vibrations to quench friction-induced oscillations*, J. Sound Vib. 228
(1999) 1079-1102: the mean of sgn(v_r + A cos τ) over a period is (2/π) arcsin(v_r/A) for |v_r| ≤ A.
"""

import math
from functools import cache

import numpy as np
import pytest

from oracles import dither
from stickslip import Contact, Inertial, System, simulate
from systems import parameters

pytestmark = pytest.mark.usefixtures("flow")


@cache
def block() -> System:
    """A block that slides freely on a surface with the velocity −A cos ωt."""
    return System(
        name="dither",
        parameters=parameters(m=1.0, A=1.0, omega=1.0, mu=1.0),
        coordinates={"x": Inertial()},
        kinetic="m/2*d_x**2",
        contacts={"surface": Contact("d_x", "mu", surface_speed="-A*cos(omega*t)")},
    )


@pytest.mark.parametrize("v_r", [-1.5, -0.9, -0.3, 0.0, 0.5, 0.8, 2.0])
def test_mean_friction(v_r: float) -> None:
    # The heavier the block, the less its velocity changes within the period. The mean friction is m
    # Δv / T.
    errors = []
    for m in (1e4, 1e6):
        motion = simulate(block(), (0.0, 2 * math.pi), initial={"d_x": v_r}, parameters={"m": m})
        assert motion.certificate.ok, motion.certificate.verdict
        mean = m * (motion.final["d_x"] - v_r) / (2 * math.pi)
        errors.append(abs(mean + dither.mean_sign(v_r, 1.0)))
    assert errors[1] < 1e-5
    if 0 < abs(v_r) < 1:
        assert errors[0] / errors[1] == pytest.approx(100, rel=0.05)


@pytest.mark.parametrize("v_0", [0.9, 0.2])
def test_effective_viscosity(v_0: float) -> None:
    # Averaged, v' = −(2μ/(πm)) arcsin(v/A): the time from v to v/2 is an integral, and no threshold
    # is left.
    m = 1000.0
    phi = np.linspace(math.asin(v_0 / 2), math.asin(v_0), 20_001)
    time = math.pi * m / 2 * np.trapezoid(np.cos(phi) / phi, phi)
    motion = simulate(block(), (0.0, float(time)), initial={"d_x": v_0}, parameters={"m": m})
    assert motion.outcome.ok
    assert motion.n_switches > 100
    assert motion.final["d_x"] == pytest.approx(v_0 / 2, abs=2e-3)
