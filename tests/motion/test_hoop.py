"""A bead on a rough hoop that turns about its vertical diameter."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import stickslip as ss

G = 9.81
R = 0.7


def hoop(W: float, f: float = 0.0, **initial: float) -> ss.System:
    """Per unit of mass; the angle is from the lowest point."""
    return ss.System(
        name="hoop",
        parameters={"W": ss.Parameter(W), "f": ss.Parameter(f)},
        coordinates={"theta": ss.Inertial()},
        kinetic=f"{R}**2/2*(d_theta**2 + W**2*sin(theta)**2)",
        potential=f"-{G}*{R}*cos(theta)",
        contacts={"hoop": ss.Contact(f"{R}*d_theta", "f")},
        initial=initial,
        span=(0.0, 5.0),
    )


def pull(theta: float, W: float) -> float:
    """Force along the hoop on a bead at rest."""
    return R * W**2 * np.sin(theta) * np.cos(theta) - G * np.sin(theta)


def jacobi(theta: float, rate: float, W: float) -> float:
    """What is kept without friction: ½R²θ̇² − ½R²W² sin² θ − gR cos θ."""
    return float(R**2 / 2 * (rate**2 - W**2 * np.sin(theta) ** 2) - G * R * np.cos(theta))


@pytest.mark.parametrize("W", [4.0, 6.0, 12.0])
def test_equilibria(W: float) -> None:
    """cos θ = g/(W² R), once that is less than 1; swings about it have the frequency W sin θ."""
    theta = float(np.arccos(G / (W**2 * R)))
    found = ss.simulate(hoop(W, theta=theta))
    assert found.certificate.ok
    assert_allclose(found.at(np.linspace(0.0, 5.0, 51))["theta"], theta, atol=1e-12)
    small = 1e-5
    period = 2 * np.pi / (W * np.sin(theta))
    swing = ss.simulate(hoop(W, theta=theta + small), (0.0, period))
    assert swing.final["theta"] - theta == pytest.approx(small, rel=1e-6)
    half = swing.at([period / 2])["theta"][0]
    assert half - theta == pytest.approx(-small, rel=1e-4)


@pytest.mark.parametrize(("W", "theta"), [(3.0, 0.6), (6.0, 0.4), (6.0, 1.4), (9.0, 2.5)])
def test_it_sticks_below_the_threshold(W: float, theta: float) -> None:
    """It rests where the pull along the hoop is at most f, and only there."""
    force = pull(theta, W)
    rest = ss.simulate(hoop(W, abs(force) * (1 + 1e-9), theta=theta))
    assert rest.certificate.ok and rest.final["theta"] == theta
    leaves = ss.simulate(hoop(W, abs(force) * (1 - 1e-3), theta=theta), (0.0, 0.5))
    assert leaves.certificate.ok
    assert np.sign(leaves.final["theta"] - theta) == np.sign(force)


@pytest.mark.parametrize(("W", "f", "rate"), [(2.0, 1.0, 6.0), (6.0, 2.0, -4.0), (9.0, 4.0, 8.0)])
def test_energy(W: float, f: float, rate: float) -> None:
    """Where it first comes to rest, Jacobi's integral is less by the work of friction, f R |Δθ|."""
    found = ss.simulate(hoop(W, f, theta=0.3, d_theta=rate), (0.0, 20.0))
    assert found.certificate.ok
    at = found.at([float(found.events["time"].iloc[0])])
    stop = float(at["theta"][0])
    assert at["d_theta"][0] == pytest.approx(0.0, abs=1e-12)
    lost = jacobi(0.3, rate, W) - jacobi(stop, 0.0, W)
    assert lost == pytest.approx(f * R * abs(stop - 0.3), rel=1e-10)
    # At the end it rests where friction holds it.
    assert abs(pull(found.final["theta"], W)) <= f * (1 + 1e-9)
