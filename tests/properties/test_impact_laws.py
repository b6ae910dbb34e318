"""Properties of motions with impacts: units, places and times do not matter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import stickslip as ss

G = 9.81
# Exponents of mass, length and time.
PARAMETERS = {
    "m": (1, 0, 0),
    "k": (1, 0, -2),
    "g": (0, 1, -2),
    "mu": (0, 0, 0),
    "e": (0, 0, 0),
    "F": (1, 1, -2),
    "omega": (0, 0, -1),
    "V": (0, 1, -1),
    "wall": (0, 1, 0),
    "ground": (0, 1, 0),
    "begin": (0, 0, 1),
}
STATE = {"x": (0, 1, 0), "y": (0, 1, 0), "d_x": (0, 1, -1), "d_y": (0, 1, -1)}
# x is the stretch of a spring at a wall that moves with the frame; the last is a shift of it.
SYSTEM = ss.System(
    name="bouncing on a belt in a corner",
    parameters={name: ss.Parameter(1.0) for name in PARAMETERS} | {"left": ss.Parameter(0.0)},
    coordinates={
        "x": ss.Inertial(force="F*cos(omega*(t - begin)) - k*(x - left)"),
        "y": ss.Inertial(),
    },
    kinetic="m/2*(d_x**2 + d_y**2)",
    potential="m*g*y",
    contacts={
        "floor": ss.Unilateral("y - ground", "d_x", "mu", surface_speed="V", restitution="e"),
        "wall": ss.Unilateral("wall - x", restitution="e"),
    },
    initial={"x": 0.0, "y": 2.0},
)


def numbers(seed: int) -> tuple[dict[str, float], dict[str, float]]:
    """Parameters and a start."""
    rng = np.random.default_rng(seed)
    values = {"m": rng.uniform(0.5, 2), "k": rng.uniform(0.5, 4), "g": G}
    values |= {"mu": rng.uniform(0, 0.8), "e": rng.uniform(0, 0.7), "F": rng.uniform(0, 6)}
    values |= {"omega": rng.uniform(1, 6), "V": rng.uniform(-1, 1), "wall": rng.uniform(0.2, 0.8)}
    values |= {"ground": 0.0, "begin": 0.0, "left": 0.0}
    start = {"x": 0.0, "y": rng.uniform(0.1, 0.6), "d_x": rng.uniform(-2, 2), "d_y": 0.0}
    return values, start


def follow(
    values: Mapping[str, float], start: Mapping[str, float], span: tuple[float, float]
) -> tuple[Any, np.ndarray]:
    """The motion, and its states at eleven times."""
    found = ss.simulate(SYSTEM, span, initial=start, parameters=values)
    assert found.outcome.ok and found.certificate.ok, (found.outcome, found.certificate)
    at = found.at(np.linspace(*span, 11))
    return found, np.array([at[name] for name in STATE])


def scaled(
    given: Mapping[str, float], exponents: Mapping[str, tuple[int, int, int]], units: np.ndarray
) -> dict[str, float]:
    """Numbers in other units."""
    return {
        name: value * float(np.prod(units ** np.array(exponents.get(name, (0, 1, 0)))))
        for name, value in given.items()
    }


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    powers=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
)
@example(seed=202, powers=(0.5, 0.0, 0.0))
def test_units_do_not_matter(seed: int, powers: tuple[float, float, float]) -> None:
    """Other units of mass, length and time: the same numbers, as often closed and open."""
    values, start = numbers(seed)
    units = 10.0 ** np.array(powers)
    one, states = follow(values, start, (0.0, 3.0))
    other, others = follow(
        scaled(values, PARAMETERS, units), scaled(start, STATE, units), (0.0, 3.0 * units[2])
    )
    # Where bounces come to an end, the last two are a matter of rounding.
    ends = int(np.count_nonzero(one.events["from"] == "open"))
    assert len(one.impacts) == pytest.approx(len(other.impacts), abs=2 * max(ends, 1))
    rows = np.array([float(np.prod(units ** np.array(e))) for e in STATE.values()])
    assert_allclose(others / rows[:, None], states, atol=2e-8)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), x=st.floats(-50.0, 50.0), y=st.floats(-50.0, 50.0))
def test_places_do_not_matter(seed: int, x: float, y: float) -> None:
    """The same motion elsewhere."""
    values, start = numbers(seed)
    _, states = follow(values, start, (0.0, 3.0))
    moved = values | {"wall": values["wall"] + x, "left": x, "ground": y}
    _, others = follow(moved, start | {"x": x, "y": start["y"] + y}, (0.0, 3.0))
    shift = np.array([x, y, 0.0, 0.0])[:, None]
    assert_allclose(others - shift, states, atol=1e-7)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), begin=st.floats(-100.0, 100.0))
def test_times_do_not_matter(seed: int, begin: float) -> None:
    """The same motion at another time."""
    values, start = numbers(seed)
    _, states = follow(values, start, (0.0, 3.0))
    _, others = follow(values | {"begin": begin}, start, (begin, begin + 3.0))
    assert_allclose(others, states, atol=1e-7)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_energy_is_lost_in_impacts_and_friction(seed: int) -> None:
    """On a floor at rest, without a drive, the energy never grows, and what is lost was counted."""
    values, start = numbers(seed)
    values |= {"V": 0.0, "F": 0.0}
    found, states = follow(values, start, (0.0, 3.0))
    x, y, u, v = states
    energy = values["m"] * ((u**2 + v**2) / 2 + G * y) + values["k"] / 2 * x**2
    # the force of the spring is given as a force, so it is supplied, not stored
    assert np.all(np.diff(energy) <= 1e-9 * energy[0])
    lost = float(found.dataset["dissipated_energy"].values[-1])
    assert lost == pytest.approx(energy[0] - energy[-1], rel=1e-8, abs=1e-9)
    assert np.all(found.impacts["energy"] >= -1e-12)
