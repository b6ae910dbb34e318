"""Derivatives through infinitely many impacts in a finite time."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import stickslip as ss

BALL = ss.System(
    "ball that slides",
    parameters={name: ss.Parameter(1.0) for name in ("mu", "e", "g")},
    coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
    kinetic="(d_x**2 + d_y**2)/2",
    potential="g*y",
    contacts={"floor": ss.Unilateral("y", "d_x", "mu", restitution="e")},
)


@pytest.mark.parametrize("seed", range(8))
def test_a_ball_that_comes_to_rest_while_it_slides(seed: int) -> None:
    """With y'' = N − g and x'' = −μN, x = v t − μ (y − h + g t²/2): after the impacts, too,
    whatever their restitution is, and whenever the motion is looked at."""
    rng = np.random.default_rng(seed)
    mu, e, g = rng.uniform(0.1, 0.6), rng.uniform(0.1, 0.8), rng.uniform(1.0, 20.0)
    h = rng.uniform(0.2, 2.0)
    end = float(np.sqrt(2 * h / g)) * (1 + e) / (1 - e)  # of the impacts
    t = end * np.array([*np.sort(rng.uniform(0.0, 1.0, 3 * (seed % 2))), 1.1, 1.3])
    v = 2.0 * mu * g * t[-1]
    motion = ss.simulate(
        BALL,
        (0.0, t[-1]),
        parameters={"mu": mu, "e": e, "g": g},
        initial={"d_x": v, "y": h},
    )
    assert motion.certificate.ok
    found = motion.sensitivity(["mu", "e", "g", "y", "d_x"], t)
    assert not found.attrs["missing"]
    for i in (-2, -1):
        s = t[i]
        of_x = [h - g * s**2 / 2, 0.0, -mu * s**2 / 2, mu, s]
        of_v = [-g * s, 0.0, -mu * s, 0.0, 1.0]
        size = np.maximum(np.abs(of_x), 1e-3 * max(1.0, s))
        assert_allclose(found["x"].values[:, i] / size, of_x / size, atol=1e-9)
        assert_allclose(found["d_x"].values[:, i], of_v, rtol=1e-9, atol=1e-9 * v)
        assert_allclose(found["y"].values[:, i], 0.0, atol=1e-9)


@pytest.mark.parametrize("looks", [1, 4, 7])
def test_a_ball_that_comes_to_rest_on_a_plate_that_moves(looks: int) -> None:
    """The bounces are small beside the speed of the plate; differences know no limit."""
    motion = ss.simulate(ss.catalogue.bouncing_ball())
    t = np.linspace(0.0, 5.0, looks + 1)[1:]
    found = motion.sensitivity(["g", "e", "A", "omega", "y"], t, second_opinion=True)
    assert not found.attrs["missing"]
    exact, differences = found["d_y"].values[:, -1], found["d_y_by_differences"].values[:, -1]
    assert np.max(np.abs(exact)) > 0.1
    assert_allclose(exact, differences, atol=1e-6 * np.max(np.abs(exact)))
