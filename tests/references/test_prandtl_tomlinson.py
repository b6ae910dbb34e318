"""Tip pulled over a lattice.

L. Prandtl, ZAMM 8 (1928) 85-106; V. L. Popov, J. A. T. Gray, ZAMM 92 (2012) 683-708: multistable
for η = 4π²V₀/(ka²) > 1; the tip jumps at the spring force (2πV₀/a)√(1 − η⁻²), after the largest
one, 2πV₀/a.
"""

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from oracles import prandtl_tomlinson
from stickslip import Trajectory, catalogue, simulate
from systems import distance

pytestmark = pytest.mark.usefixtures("flow")

LATTICE = {"k": 3.0, "V_0": 0.05, "a": 0.5}
ETA = prandtl_tomlinson.eta(**LATTICE)


def pulled(V: float, length: float = 1.2, **values: float) -> Trajectory:
    trajectory = simulate(
        catalogue.prandtl_tomlinson(),
        (0.0, length / V),
        initial={"x": 0.0},
        parameters=LATTICE | {"V": V} | values,
    )
    assert trajectory.outcome.ok
    assert trajectory.certificate.ok, trajectory.certificate.verdict
    return trajectory


def test_jumps_at_the_force_of_the_jump() -> None:
    assert ETA > 1
    # The minimum that carries the tip ends at cos(2πx/a) = −1/η. A viscous tip lags behind by
    # V^(2/3).
    edge = LATTICE["a"] / (2 * math.pi) * math.acos(-1 / ETA)
    errors = []
    for V in (0.1, 0.03, 0.01):
        motion = pulled(V)
        time: Any = brentq(
            lambda t, motion=motion: motion.at(t)["x"] - edge, 0.25 / V, 0.5 / V, xtol=1e-13
        )
        errors.append(LATTICE["k"] * (V * time - edge) - prandtl_tomlinson.force_at_jump(**LATTICE))
    assert 0 < errors[2] < 2e-3
    orders = np.log(np.divide(errors[:-1], errors[1:])) / np.log(
        np.divide([0.1, 0.03], [0.03, 0.01])
    )
    assert orders == pytest.approx(2 / 3, abs=0.02)


def test_largest_force_comes_before() -> None:
    largest = 2 * math.pi * LATTICE["V_0"] / LATTICE["a"]
    assert prandtl_tomlinson.force_at_jump(**LATTICE) < 0.95 * largest
    excess = []
    for V in (0.1, 0.01):
        motion = pulled(V)
        t = np.linspace(*motion.t_span, 20_001)
        excess.append(LATTICE["k"] * float(np.max(V * t - motion.at(t)["x"])) - largest)
    assert 0 < excess[1] < 1.1e-4  # the viscous force νV
    assert excess[0] / excess[1] == pytest.approx(10, rel=0.05)


def test_follows_the_minima() -> None:
    V = 0.01
    motion = pulled(V)
    X = np.linspace(0.0, 1.2, 400)
    x = prandtl_tomlinson.quasistatic(X, **LATTICE)
    tip = motion.at(X / V)["x"]
    # The viscous tip makes the same two jumps, each a little late.
    assert np.count_nonzero(np.diff(x) > 0.1) == np.count_nonzero(np.diff(tip) > 0.1) == 2
    assert np.quantile(np.abs(tip - x), 0.97) < 2e-3
    assert np.median(np.abs(tip - x)) < 2e-4


def test_stiff_spring_leads_without_jumps() -> None:
    k = 4 * math.pi**2 * LATTICE["V_0"] / LATTICE["a"] ** 2 / 0.9
    motion = pulled(0.01, k=k)
    X = np.linspace(0.0, 1.2, 200)
    x = prandtl_tomlinson.quasistatic(X, k, LATTICE["V_0"], LATTICE["a"])
    assert distance(motion.at(X / 0.01)["x"], x) < 2e-3
    assert len(motion.warnings) == 1
