"""The maps of the examples, with few points, against what is known."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.motion.outcome import Outcome

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str) -> dict[str, Any]:
    return runpy.run_path(str(EXAMPLES / name))


def test_walking_speed() -> None:
    data = example("walking-speed-map.py")["walking"](6, 3)
    P, delta = data["P"].values, data["delta"].values
    assert np.all(data["certificate"].values < 1e-8)
    # [M] 4.3: below P = ρ + cψ* = 0.5 nothing walks; a strongly damped toy comes to rest.
    np.testing.assert_allclose(data["speed"].values[P < 0.5], 0.0, atol=1e-8)
    np.testing.assert_allclose(data["speed"].values[:, delta > 0.15][P < 1.5], 0.0, atol=1e-8)
    # In simple walking v = 2X/T with X = P − ρ − cψ* and T near 2π: 0.1675 at P = 1, δ = 0.04.
    easy = data["speed"].values[(P > 0.85) & (P < 1.2)][:, 0]
    np.testing.assert_allclose(easy, (P[(P > 0.85) & (P < 1.2)] - 0.5) / np.pi, rtol=0.1)


def test_stick_fraction() -> None:
    names = example("stick-fraction-map.py")
    data = names["sticking"](7, 5)
    V = data["V"].values[:, None]
    nu = data["nu"].values
    unstable = names["trace"](V, nu) > 0.0
    steady = data["outcome"].values == Outcome.STEADY.code
    assert np.any(unstable)
    assert np.any(steady)
    assert not np.any(unstable & steady)
    np.testing.assert_array_equal(data["stick_fraction"].values[steady], 0.0)
    assert np.all(data["stick_fraction"].values[unstable] > 0.0)


def test_effective_friction() -> None:
    names = example("compactor-friction-map.py")
    data = names["friction"](6, 3)
    F = data["F"].values[:, None]
    Omega = data["Omega"].values
    slides_on = names["stopping_force"](Omega) > 1.05 * F
    friction = data["friction"].values
    np.testing.assert_allclose(friction[slides_on & (F > 0.0)], 0.6, rtol=0.01)
    stops = names["stopping_force"](Omega) < 0.95 * F
    assert np.all(friction[stops] < 0.6)
    # Never below the smallest threshold of a period.
    smallest = np.broadcast_to(0.6 * (1.0 - F / 981.0), friction.shape)
    assert np.all(friction >= smallest * (1.0 - 1e-9))
