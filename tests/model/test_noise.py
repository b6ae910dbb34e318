"""Noise as samples."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss


def test_noise_is_normal_and_its_seed_decides() -> None:
    first = ss.noise((1.0, 101.0), 0.01, 0.2, seed=3)
    assert first == ss.noise((1.0, 101.0), 0.01, 0.2, seed=3)
    assert first != ss.noise((1.0, 101.0), 0.01, 0.2, seed=4)
    assert first.covers(1.0, 101.0) and len(first.times) == 10_001
    assert abs(np.mean(first.values)) < 5 * 0.2 / 100
    assert np.std(first.values) == pytest.approx(0.2, rel=0.05)
    neighbours = np.corrcoef(first.values[:-1], first.values[1:])[0, 1]
    assert abs(neighbours) < 0.05


def test_a_motion_under_noise_is_certified_and_repeated_exactly() -> None:
    system = ss.System(
        "shaken",
        drives={"w": ss.noise((0.0, 20.0), 0.05, 1.0, seed=0)},
        coordinates={"x": ss.Inertial("m", force="w")},
        kinetic="d_x**2/2",
        contacts={"ground": ss.Contact("d_x", 0.5)},
        span=(0, 20),
    )
    motion = ss.simulate(system)
    assert motion.certificate.ok and motion.n_switches > 5
    again = ss.simulate(system)
    assert again.final == motion.final


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"span": (1.0, 1.0)}, "span"),
        ({"period": 0.0}, "period"),
        ({"period": 1e-9}, "period.*samples"),
        ({"deviation": -1.0}, "deviation"),
        ({"seed": -1}, "seed"),
        ({"kind": "white"}, "unknown kind 'white'"),
    ],
)
def test_bad_input(given: dict[str, Any], reason: str) -> None:
    with pytest.raises(ss.DeclarationError, match=reason):
        ss.noise(**({"span": (0.0, 100.0), "period": 0.1, "seed": 0} | given))
