"""Ropes on drums: lumps without mass, each with the friction of the tensions beside it."""

from __future__ import annotations

import time
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.arrays import Array

NUMBERS = {"a": 0.25, "k": 200.0, "c": 0.05, "V": 1e-3, "T": 1.0}


@cache
def rope(n: int) -> ss.System:
    """A rope of n lumps with viscosity, pulled slowly against a constant force."""
    tensions = ["T", *(f"k*(x{i + 1} - x{i})" for i in range(1, n)), f"k*(V*t - x{n})"]
    springs = [f"k/2*(x{i + 1} - x{i})**2" for i in range(1, n)]
    return ss.System(
        "rope",
        parameters={name: ss.Parameter(value) for name, value in NUMBERS.items()},
        coordinates={f"x{i}": ss.Viscous() for i in range(1, n + 1)},
        potential=" + ".join(["T*x1", *springs, f"k/2*(V*t - x{n})**2"]),
        viscous=" + ".join(f"c/2*d_x{i}**2" for i in range(1, n + 1)),
        contacts={
            f"lump {i}": ss.Contact(f"d_x{i}", f"a*max(0, {tensions[i - 1]} + {tensions[i]})")
            for i in range(1, n + 1)
        },
        span=(0.0, 10.0),
    )


def by_ode(n: int, p: dict[str, float]) -> Array:
    """The same by SciPy: c ẋ is what of the force is beyond the threshold."""

    def rates(t: float, x: Array) -> Array:
        T = np.concatenate([[p["T"]], p["k"] * np.diff(x), [p["k"] * (p["V"] * t - x[-1])]])
        F, s = np.diff(T), p["a"] * np.maximum(0.0, T[:-1] + T[1:])
        return np.sign(F) * np.maximum(np.abs(F) - s, 0.0) / p["c"]

    options = {"method": "Radau", "rtol": 1e-8, "atol": 1e-12, "max_step": 0.05}
    with np.errstate(divide="ignore"):  # in its control of steps, where nothing moves
        return solve_ivp(rates, (0.0, 10.0), np.zeros(n), **options).y[:, -1]


def drawn(seed: int) -> dict[str, float]:
    """Numbers of a rope of three lumps."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(1.0, 2.0 * np.pi) / 6.0
    p = {"a": rng.uniform(0.1, 0.8) * np.sin(angle), "k": 10.0 ** rng.uniform(1.0, 2.5)}
    p |= {"c": 10.0 ** rng.uniform(-2.0, 0.0), "V": 10.0 ** rng.uniform(-3.0, -2.0)}
    return p | {"T": rng.uniform(0.3, 2.0)}


@pytest.mark.parametrize("seed", range(20))
def test_a_lump_that_starts_beside_one_that_comes_to_rest(seed: int) -> None:
    """The neighbour's force is at its threshold but for rounding errors when a slip begins; events
    do not accumulate there."""
    p = drawn(seed)
    motion = ss.simulate(rope(3), parameters=p)
    assert motion.outcome.ok and motion.certificate.ok, motion.message
    expected = by_ode(3, p)
    found = [motion.final[f"x{i}"] for i in (1, 2, 3)]
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.max(np.abs(expected)))


@pytest.mark.parametrize("n", [4, 6, 8])
def test_long_ropes_cost_what_their_events_do(n: int) -> None:
    """What relaxes within a millisecond does not shorten flights of ten seconds."""
    rng = np.random.default_rng(n)
    for _ in range(3):
        p = {"a": 0.5 * np.sin(rng.uniform(0.5, 2.0) / n), "k": rng.uniform(100.0, 400.0)}
        p |= {"c": 0.05, "V": 10.0 ** rng.uniform(-3.0, -2.5), "T": 1.0}
        ss.simulate(rope(n), (0.0, 1e-9), parameters=p)  # compiled
        began = time.process_time()
        motion = ss.simulate(rope(n), parameters=p)
        assert time.process_time() - began < 0.5
        assert motion.outcome.ok
        assert motion.certificate.ok, motion.certificate.verdict
        expected = by_ode(n, p)
        found = [motion.final[f"x{i}"] for i in range(1, n + 1)]
        np.testing.assert_allclose(found, expected, atol=1e-6 * np.max(np.abs(expected)))


def test_work_is_that_of_the_way() -> None:
    """What has relaxed moves by nothing, and its forces do no work: rates that would be forgotten
    within a millisecond do not count for seconds."""
    worst = 0.0
    for seed in range(150):
        motion = ss.simulate(rope(3), parameters=drawn(seed))
        assert motion.certificate.ok, (seed, motion.certificate.verdict)
        worst = max(worst, motion.certificate.residuals[0].value)
    assert worst < 1e-11


@cache
def heavy(n: int) -> ss.System:
    """The same of n lumps with mass."""
    light = rope(n)
    return ss.System(
        "heavy rope",
        parameters={**light.parameters, "m": ss.Parameter(0.01)},
        coordinates={f"x{i}": ss.Inertial() for i in range(1, n + 1)},
        kinetic=" + ".join(f"m/2*d_x{i}**2" for i in range(1, n + 1)),
        potential=light.potential,
        viscous=light.viscous,
        contacts=light.contacts,
        span=(0.0, 1.0),
    )


@pytest.mark.parametrize("n", [4, 6, 8])
def test_slack_ropes(n: int) -> None:
    """Nothing is tense at first: what moves the lumps in the middle grows with high powers of time,
    and is lost in sums of exponentials. It is lost in nothing that is certified."""
    rng = np.random.default_rng(n)
    for _ in range(8):
        p = {"a": 0.5 * np.sin(rng.uniform(0.5, 2.0) / n), "k": rng.uniform(100.0, 400.0)}
        p |= {"c": rng.uniform(0.2, 1.0), "V": 10.0 ** rng.uniform(-3.5, -2.5), "T": 1.0}
        p["m"] = 10.0 ** rng.uniform(-3.0, -1.0)
        motion = ss.simulate(
            heavy(n), (0.0, 10.0 ** rng.uniform(-4.0, 0.0)), parameters=p, max_events=2000
        )
        assert motion.outcome.ok, (p, motion.message)
        assert motion.certificate.ok, (p, motion.certificate.verdict)
