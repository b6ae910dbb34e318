"""A block on three legs: friction below its centre of mass moves the weight from leg to leg.
Against closed forms, and integrations with known contact states, or with smoothed friction.

Tilts are small: what presses the legs of a block that does not tip is told by moments alone.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip import DeclarationError, Inertial, Outcome, Parameter, System, Trajectory, Unilateral

Array = np.ndarray
G = 9.81
TILTS, TURN = 0.1, 0.15  # moments of inertia; the mass is 1
PLANE = ("x", "y", "th")
REGULAR = [(float(np.cos(a)), float(np.sin(a))) for a in (0.0, 2.0 * np.pi / 3, 4.0 * np.pi / 3)]
UNEVEN = [(0.8, 0.1), (-0.5, 0.7), (-0.4, -0.6)]
AHEAD = [(0.5, 0.4), (0.5, -0.4), (-0.6, 0.0)]  # two legs in front


def block(
    legs: Sequence[tuple[float, float]],
    height: float | Sequence[float],
    mu: float | Sequence[float] = 0.3,
    forces: Mapping[str, str] | None = None,
    end: float = 1.0,
    **parameters: float,
) -> System:
    """A block with its centre of mass above its legs; it turns by any angle th, and tilts by small
    ones, a and b. Forces are those at the centre of mass."""
    heights, rubs = np.broadcast_to(height, len(legs)), np.broadcast_to(mu, len(legs))
    contacts = {}
    for i, (x, y) in enumerate(legs):
        X, Y = f"({x!r}*cos(th) - {y!r}*sin(th))", f"({x!r}*sin(th) + {y!r}*cos(th))"
        h = float(heights[i])
        along = f"d_x - d_th*{Y} - {h!r}*d_b", f"d_y + d_th*{X} + {h!r}*d_a"
        contacts[f"leg{i}"] = Unilateral(f"z + {Y}*a - {X}*b", along, float(rubs[i]))
    given = forces or {}
    return System(
        "block",
        parameters={name: Parameter(value) for name, value in parameters.items()},
        coordinates={q: Inertial(force=given.get(q, "0")) for q in (*PLANE, "z", "a", "b")},
        kinetic=f"(d_x**2 + d_y**2 + d_z**2 + {TILTS}*(d_a**2 + d_b**2) + {TURN}*d_th**2)/2",
        potential=f"{G}*z",
        contacts=contacts,
        span=(0.0, end),
    )


def certified(system: System, start: Mapping[str, float] | None = None) -> Trajectory:
    motion = ss.simulate(system, initial=start or {})
    assert motion.outcome.ok, motion.message
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


def thrown(velocity: Sequence[float]) -> dict[str, float]:
    return {f"d_{q}": v for q, v in zip(PLANE, velocity, strict=True)}


def where(motion: Trajectory, time: float) -> Array:
    return np.array([float(motion.at(np.array([time]))[q][0]) for q in PLANE])


def normals(motion: Trajectory, time: float, count: int = 3) -> Array:
    seen = motion.at(np.array([time]))
    return np.array([float(seen[f"normal_leg{i}"][0]) for i in range(count)])


class Legs:
    """The same block by hand, as long as no leg leaves the floor: its motion in the plane."""

    def __init__(self, legs: Any, height: float, mu: Any, push: Any = (0.0, 0.0, 0.0)) -> None:
        self.legs = np.array(legs) @ [1.0, 1.0j]
        self.height, self.mu = height, np.broadcast_to(mu, len(self.legs))
        self.push = np.array(push)

    def rates(self, width: float) -> Any:
        """Equations of motion; speeds below the width have less friction."""

        def rate(_: float, s: Array) -> Array:
            arm = np.exp(1j * s[2]) * self.legs
            u = s[3] + 1j * s[4] + 1j * s[5] * arm
            parts = -self.mu * u / np.sqrt(np.abs(u) ** 2 + width**2)
            lever = arm + self.height * parts
            balance = np.stack([np.ones(3), np.real(lever), np.imag(lever)])
            force = np.linalg.solve(balance, [G, 0.0, 0.0]) * parts
            total = np.sum(force) + self.push[0] + 1j * self.push[1]
            turn = self.push[2] + np.sum(np.imag(np.conj(arm) * force))
            return np.array([*s[3:], total.real, total.imag, turn / TURN])

        return rate

    def slide(self, velocity: Sequence[float], end: float) -> Array:
        """The place after a slip that does not end before."""
        start = np.array([0.0, 0.0, 0.0, *velocity])
        found = solve_ivp(self.rates(0.0), (0.0, end), start, "DOP853", rtol=1e-13, atol=1e-14)
        return found.y[:3, -1]

    def smoothed(self, velocity: Sequence[float], end: float) -> Array:
        """The place by smoothed friction of two widths, extrapolated."""
        start = np.array([0.0, 0.0, 0.0, *velocity])
        wide, narrow = (
            solve_ivp(self.rates(w), (0.0, end), start, "Radau", rtol=1e-10, atol=1e-13).y[:3, -1]
            for w in (2e-8, 1e-8)
        )
        return 2.0 * narrow - wide


# -- sliding ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.0, 0.4, 1.5])
def test_a_block_that_is_pushed_along_its_axis_slides_straight(height: float) -> None:
    """The leg in front bears more, and those on both sides the same: nothing turns it."""
    mu, push = 0.3, 4.0
    motion = certified(block(REGULAR, height, mu, {"x": f"{push}"}))
    expected = [0.5 * (push - mu * G), 0.0, 0.0]
    np.testing.assert_allclose(where(motion, 1.0), expected, rtol=0, atol=1e-12)
    ahead = (G + 2.0 * mu * G * height) / 3.0
    behind = (G - mu * G * height) / 3.0
    np.testing.assert_allclose(normals(motion, 0.7), [ahead, behind, behind], rtol=1e-12)


@pytest.mark.parametrize("mu", [0.3, (0.2, 0.35, 0.5)])
@pytest.mark.parametrize("velocity", [(2.0, 0.0, 1.0), (-1.0, 2.0, -4.0), (0.5, -2.0, 3.0)])
def test_a_block_that_is_thrown_slides_and_turns(mu: Any, velocity: tuple[float, ...]) -> None:
    motion = certified(block(UNEVEN, 0.6, mu, end=0.2), thrown(velocity))
    expected = Legs(UNEVEN, 0.6, mu).slide(velocity, 0.2)
    np.testing.assert_allclose(where(motion, 0.2), expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("velocity", "push"),
    [
        ((0.6, 0.3, 2.0), (0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (3.2, 1.5, 0.5)),
        ((0.0, 0.0, 0.0), (-1.0, 2.5, 0.9)),
        ((0.5, -0.5, -1.0), (1.0, 0.0, 0.2)),
    ],
)
def test_it_begins_and_comes_to_rest(velocity: tuple[float, ...], push: tuple[float, ...]) -> None:
    """From rest it slides, turns, or turns about a leg that holds."""
    mu, height = (0.25, 0.35, 0.4), 0.5
    forces = {q: f"{f}" for q, f in zip(PLANE, push, strict=True)}
    motion = certified(block(UNEVEN, height, mu, forces), thrown(velocity))
    expected = Legs(UNEVEN, height, mu, push).smoothed(velocity, 1.0)
    np.testing.assert_allclose(where(motion, 1.0), expected, rtol=0, atol=3e-7)


def test_what_it_loses_is_what_it_had() -> None:
    motion = certified(block(UNEVEN, 0.6, 0.3, end=3.0), {"d_x": 1.0, "d_y": 0.4, "d_th": 2.0})
    assert motion.outcome is Outcome.AT_REST
    final = motion.final
    assert all(final[f"d_{q}"] == 0.0 for q in PLANE)
    had = (1.0 + 0.16 + TURN * 4.0) / 2.0
    lost = float(motion.at(np.array([3.0]))["dissipated_energy"][0])
    assert lost == pytest.approx(had, rel=1e-9)


def test_a_skate_for_each_end() -> None:
    """A bicycle that is held upright, on two skates: friction is small along them."""
    ends, height, mu, axes = (0.6, -0.5), 0.5, (0.4, 0.3), (0.2, 1.0)
    contacts = {}
    for i, (place, rub) in enumerate(zip(ends, mu, strict=True)):
        v, w = f"d_x - {place}*sin(th)*d_th", f"d_y + {place}*cos(th)*d_th"
        along = f"cos(th)*({v}) + sin(th)*({w}) - {height}*d_b"
        across = f"cos(th)*({w}) - sin(th)*({v})"
        contacts[f"skate{i}"] = Unilateral(f"z - {place}*b", (along, across), rub, axes=axes)
    system = System(
        "bicycle",
        coordinates={q: Inertial() for q in (*PLANE, "z", "b")},
        kinetic=f"(d_x**2 + d_y**2 + d_z**2 + {TILTS}*d_b**2 + {TURN}*d_th**2)/2",
        potential=f"{G}*z",
        contacts=contacts,
        span=(0.0, 0.4),
    )
    places, rubs = np.array(ends), np.array(mu)

    def rate(_: float, s: Array) -> Array:
        frame = np.exp(1j * s[2])
        u = np.conj(frame) * (s[3] + 1j * s[4]) + 1j * s[5] * places
        scaled = axes[0] * u.real + 1j * axes[1] * u.imag
        n = scaled / np.abs(scaled)
        parts = -rubs * (axes[0] * n.real + 1j * axes[1] * n.imag)
        balance = np.stack([np.ones(2), places + height * parts.real])
        force = np.linalg.solve(balance, [G, 0.0]) * parts
        total = frame * np.sum(force)
        return np.array([*s[3:], total.real, total.imag, np.sum(places * force.imag) / TURN])

    motion = certified(system, {"d_x": 2.0, "d_y": 0.5, "d_th": -1.5})
    start = np.array([0.0, 0.0, 0.0, 2.0, 0.5, -1.5])
    found = solve_ivp(rate, (0.0, 0.4), start, "DOP853", rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(where(motion, 0.4), found.y[:3, -1], rtol=0, atol=1e-11)


# -- tipping ---------------------------------------------------------------------------------------


def test_it_tips_over_the_legs_in_front() -> None:
    """Once the line of the push leaves the triangle. The edge holds: it turns about that."""
    height, front = 0.6, 0.5
    system = block(AHEAD, height, 2.0, {"x": "4*t"}, 2.6)
    motion = certified(system)
    tips = G * front / height / 4.0
    assert float(motion.events["time"].iloc[0]) == pytest.approx(tips, rel=1e-12)
    late = 2.6 - tips
    angle = 4.0 * height * late**3 / 6.0 / (TILTS + height**2 + front**2)
    assert motion.final["b"] == pytest.approx(angle, rel=1e-11)
    assert motion.final["z"] == pytest.approx(front * angle, rel=1e-11)


@pytest.mark.parametrize("mu", [0.6, 0.65, 0.8, 0.86, 0.89, 1.2])
def test_it_slides_on_its_front_legs_or_jams(mu: float) -> None:
    """What presses these is G/(1 + (d² − μdh)/I): beyond μ = (I + d²)/dh no force obeys the law."""
    height, front = 0.8, 0.5
    motion = ss.simulate(block(AHEAD, height, mu, end=0.004), initial={"d_x": 2.0})
    if mu * front * height > TILTS + front**2:
        assert motion.outcome is Outcome.NO_ACCELERATION
        assert not motion.certificate.ok
        return
    assert motion.outcome.ok
    assert motion.certificate.ok, motion.certificate.verdict
    if mu * height < front:
        assert motion.final["b"] == pytest.approx(0.0, abs=1e-15)
        return
    pressed = G / (1.0 + (front**2 - mu * front * height) / TILTS)
    found = normals(motion, 0.002)
    np.testing.assert_allclose(found, [0.5 * pressed, 0.5 * pressed, 0.0], rtol=1e-9)
    angle = 0.5 * 0.004**2 * pressed * (mu * height - front) / TILTS
    assert motion.final["b"] == pytest.approx(angle, rel=1e-9)


def test_a_leg_that_has_been_lifted_comes_down_again() -> None:
    motion = certified(block(AHEAD, 0.6, 0.9, {"x": "9*sin(3*t)"}, 2.0))
    assert len(motion.impacts) > 0
    assert np.min(motion.impacts["energy"].to_numpy()) >= -1e-12


# -- what else -------------------------------------------------------------------------------------


def test_two_blocks_that_begin_at_once_move_as_each_alone() -> None:
    one = block(UNEVEN, 0.3, (0.3, 0.4, 0.5), {"x": "4.5", "y": "1"}, 0.5)
    other = block(REGULAR, 0.4, (0.2, 0.3, 0.4), {"y": "5"}, 0.5)

    def second(formula: object) -> str:
        return re.sub(r"\b(d_)?(x|y|z|a|b|th)\b", r"\g<0>2", str(formula))

    contacts = dict(one.contacts)
    for name, leg in other.contacts.items():
        assert isinstance(leg, Unilateral)
        along, across = map(second, leg.direction)
        contacts[f"{name}2"] = Unilateral(second(leg.gap), (along, across), leg.mu)
    both = replace(
        one,
        coordinates={
            **one.coordinates,
            **{second(q): c for q, c in other.coordinates.items()},
        },
        kinetic=f"{one.kinetic} + {second(other.kinetic)}",
        potential=f"{G}*(z + z2)",
        contacts=contacts,
    )
    found = certified(both).final
    for system, name in ((one, str), (other, second)):
        for q, value in certified(system).final.items():
            assert found[name(q)] == pytest.approx(value, rel=1e-9, abs=1e-12)


def test_derivatives() -> None:
    """Through begins and ends of slips about legs that hold."""
    forces = {"x": "3 + F*sin(2*t)", "y": "1", "th": "cos(3*t)/2"}
    motion = ss.simulate(block(UNEVEN, 0.3, 0.4, forces, 2.0, F=4.0))
    assert len(motion.events) >= 3
    found = motion.sensitivity(["F"], [0.5, 2.0], second_opinion=True)
    for name in PLANE:
        exact, differences = found[name].values, found[f"{name}_by_differences"].values
        np.testing.assert_allclose(exact, differences, rtol=0, atol=1e-6)


def test_a_rest_that_other_normal_forces_might_hold_is_not_certified() -> None:
    """Legs of different lengths press themselves where they push against each other."""
    push = {"x": "4.0"}
    certified(block(REGULAR, 0.3, 0.3, push))
    motion = ss.simulate(block(REGULAR, (0.3, 0.2, 0.4), 0.3, push))
    assert motion.outcome.ok
    assert not motion.certificate.ok
    # What moves has forces of its own.
    certified(block(REGULAR, (0.3, 0.2, 0.4), 0.3, end=0.1), {"d_x": 1.0, "d_th": 0.3})


def test_four_legs_are_refused() -> None:
    legs = [(0.5, 0.4), (0.5, -0.4), (-0.6, 0.4), (-0.6, -0.4)]
    with pytest.raises(
        DeclarationError, match="the normal forces of the body are statically indeterminate"
    ):
        ss.simulate(block(legs, 0.3))
    # … unless its friction does not change how.
    flat = block(legs, 0.0)
    flat = replace(flat, contacts={n: fixed(c) for n, c in flat.contacts.items()})
    assert ss.simulate(flat).outcome.ok


def fixed(leg: Any) -> Unilateral:
    """The leg where a turn does not change the gap."""
    gap = leg.gap.replace("cos(th)", "1").replace("sin(th)", "0")
    return Unilateral(gap, tuple(d.removesuffix(" - 0.0*d_b").removesuffix(" + 0.0*d_a")
                                 for d in leg.direction), leg.mu)  # fmt: skip
