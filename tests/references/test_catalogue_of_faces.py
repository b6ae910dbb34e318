"""The coin, the curling stone and the segment of a snake of the catalogue, against what is known of
them, and an integration of a smoothed law."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip import Trajectory


def certified(name: str) -> Trajectory:
    motion = ss.simulate(ss.catalogue.get(name))
    assert motion.outcome.ok, motion.message
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


def test_a_coin_ends_in_the_ratio_of_farkas() -> None:
    motion = certified("coin")
    assert motion.events[["from", "to"]].values.tolist() == [["slip", "stick"]]
    seen = motion.at(float(motion.events["time"].to_numpy()[0]) - 1e-9)
    ratio = seen["d_x"] / (motion.system.values["a"] * seen["d_phi"])
    assert ratio == pytest.approx(0.653, abs=1e-3)


def test_a_curling_stone_goes_straight_and_comes_to_rest() -> None:
    motion = certified("curling_stone")
    assert motion.final["y"] == 0.0
    assert motion.final["d_x"] == motion.final["d_phi"] == 0.0
    assert motion.final["x"] == pytest.approx(24.4, abs=0.1)


def test_a_segment_of_a_snake_moves_forward_as_with_smoothed_friction() -> None:
    motion = certified("snake_segment")
    p = motion.system.values
    held, omega = p["m"] * p["g"], 2.0 * np.pi * p["f"]

    def rates(t: float, y: np.ndarray) -> list[float]:
        phi, (u, v, w) = y[2], y[3:]
        c, s = np.cos(phi), np.sin(phi)
        along, across = c * u + s * v, c * v - s * u
        mu = p["mu_f"] if along > 0.0 else p["mu_b"]
        turn = p["mu_t"] * p["L"] / 4.0
        size = np.sqrt((mu * along) ** 2 + (p["mu_t"] * across) ** 2 + (turn * w) ** 2 + 1e-14)
        f = held * np.array([mu**2 * along, p["mu_t"] ** 2 * across, turn**2 * w]) / size
        spring = p["k"] * (y[1] - p["B"] * np.sin(omega * t))
        twist = p["c"] * (phi - p["A"] * np.cos(omega * t))
        return [
            *(u, v, w),
            -(c * f[0] - s * f[1]) / p["m"],
            -(s * f[0] + c * f[1] + spring) / p["m"],
            -(f[2] + twist) / (p["m"] * p["L"] ** 2 / 12.0),
        ]

    start = [0.0, 0.0, p["A"], 0.0, 0.0, 0.0]
    smoothed = solve_ivp(rates, (0.0, 2.0), start, method="LSODA", rtol=1e-9, atol=1e-11)
    found = motion.at(2.0)
    assert found["x"] > 0.05
    for name, value in zip(("x", "y", "phi"), smoothed.y[:3, -1], strict=True):
        assert found[name] == pytest.approx(value, abs=1e-4)
