"""Friction in a plane that changes the normal force which presses it: a bead in a bowl, against an
integration of its two equations, and a mass in a shaken dish."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip import Inertial, Parameter, System, Trajectory, Unilateral

K, G = 0.8, 9.81  # curvature of the bowl, and gravity
START = {"x": 1.0, "y": 0.0, "z": 0.4}


def bowl(restitution: float = 0.0, force: float = 0.0) -> System:
    """A bead of unit mass in the bowl z = k/2 (x² + y²), with orthonormal tangents."""
    return System(
        "bowl",
        parameters={"k": Parameter(K), "mu": Parameter(0.3), "g": Parameter(G)},
        functions={
            "steep": "sqrt(1 + k**2*x**2)",
            "area": "sqrt(1 + k**2*(x**2 + y**2))",
        },
        coordinates={"x": Inertial(), "y": Inertial(force=force), "z": Inertial()},
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2",
        potential="g*z",
        contacts={
            "bowl": Unilateral(
                "(z - k/2*(x**2 + y**2))/area",
                (
                    "(d_x + k*x*d_z)/steep",
                    "(steep**2*d_y - k**2*x*y*d_x + k*y*d_z)/(steep*area)",
                ),
                mu="mu",
                restitution=restitution,
            )
        },
        initial=START,
        span=(0.0, 3.0),
    )


def certified(motion: Trajectory) -> Trajectory:
    assert motion.outcome.ok, motion.message
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


def thrown(x: float, y: float) -> dict[str, float]:
    """Velocities along the bowl at the start."""
    return {"d_x": x, "d_y": y, "d_z": K * START["x"] * x}


def slide(mu: float, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and places of a bead that slides, until it is slow: from N n − μN v/|v| − g e_z in the
    constraint z̈ = ∇f·a + k v²."""

    def rates(_: float, s: np.ndarray) -> list[float]:
        slope = K * s[:2]
        wide = np.sqrt(1.0 + slope @ slope)
        normal = np.array([-slope[0], -slope[1], 1.0]) / wide
        v = np.array([s[2], s[3], slope @ s[2:]])
        ahead = v / np.linalg.norm(v)
        force = (K * (s[2] ** 2 + s[3] ** 2) + G) / wide / (1.0 - mu * (normal @ ahead))
        a = force * (normal - mu * ahead)
        return [s[2], s[3], a[0], a[1]]

    def slow(_: float, s: np.ndarray) -> float:
        return float(np.hypot(s[2], s[3])) - 1e-4

    slow.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
    start = [START["x"], START["y"], x, y]
    found = solve_ivp(
        rates, (0.0, 3.0), start, "DOP853", events=slow, rtol=1e-13, atol=1e-14, dense_output=True
    )
    times = np.linspace(0.0, found.t[-1], 60)
    return times, found.sol(times)[:2]


@pytest.mark.parametrize("start", [(0.0, 1.0), (0.3, 2.0), (-0.5, 0.7)])
def test_a_bead_slides_as_its_equations_say(start: tuple[float, float]) -> None:
    times, places = slide(0.3, *start)
    motion = certified(ss.simulate(bowl(), initial=thrown(*start)))
    seen = motion.at(times)
    np.testing.assert_allclose(np.array([seen["x"], seen["y"]]), places, rtol=0, atol=1e-11)
    assert 0.0 < motion.knots.time[-2] - times[-1] < 1e-3  # it stops a little later


@pytest.mark.parametrize("mu", [0.3, 0.7])
def test_a_bead_that_is_let_go_slides_down_the_meridian(mu: float) -> None:
    """It rests below the angle of friction, atan μ, and not above it."""
    motion = certified(ss.simulate(bowl(), parameters={"mu": mu}))
    assert abs(motion.final["y"]) < 1e-12
    assert K * abs(motion.final["x"]) < mu
    held = certified(ss.simulate(bowl(), parameters={"mu": 0.81}))
    assert held.final["x"] == 1.0


def test_a_side_force_turns_the_beginning() -> None:
    """At rest on the slope, pushed to the side: the first acceleration and the direction of slip
    are one, in a bowl that answers with a larger normal force."""
    motion = certified(ss.simulate(bowl(force=4.0), (0.0, 0.2)))
    time = 1e-5
    seen = motion.at(np.array([time]))
    x, y, z = (float(seen[f"d_{q}"][0]) / time for q in "xyz")
    slope = np.array([K, 0.0])
    normal = np.array([-K, 0.0, 1.0]) / np.sqrt(1.0 + K**2)
    a = np.array([x, y, z])
    ahead = a / np.linalg.norm(a)
    pull = np.array([0.0, 4.0, -G])
    force = float((a - pull) @ normal)
    np.testing.assert_allclose(a, pull + force * (normal - 0.3 * ahead), rtol=0, atol=1e-3)
    assert abs(z - slope @ a[:2]) < 1e-3


@pytest.mark.parametrize("mu", [0.3, 0.8])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_bead_that_falls_into_the_bowl(mu: float, restitution: float) -> None:
    above = {"x": 0.6, "y": -0.3, "z": 1.0, "d_x": 0.4, "d_y": 0.5}
    motion = ss.simulate(bowl(restitution), initial=above, parameters={"mu": mu})
    certified(motion)
    assert len(motion.impacts) > 0
    assert np.min(motion.impacts["energy"].to_numpy()) >= -1e-12


@pytest.mark.parametrize("end", [1.0, 1.6])
def test_derivatives(end: float) -> None:
    """Before it stops, and after."""
    motion = ss.simulate(bowl(), (0.0, end), initial=thrown(0.3, 2.0))
    found = motion.sensitivity(["mu", "g", "d_y"], [end], second_opinion=True)
    for name in ("x", "y", "d_x"):
        exact = found[name].values
        differences = found[f"{name}_by_differences"].values
        np.testing.assert_allclose(exact, differences, rtol=0, atol=1e-6)


def test_a_dish_is_flat_for_small_shakes() -> None:
    """The mass in the dish moves as the floor on bearings does, up to the size of its motion."""
    dish = ss.catalogue.pendulum_bearing()
    times = np.linspace(0.0, 15.0, 300)
    away = []
    for size in (1e-2, 1e-3):
        small = {"S": size, "mu": 0.05 * size}
        drives = {"a_x": dish.drives["a_x"], "a_y": dish.drives["a_y"]}
        floor = ss.catalogue.isolated_floor(R=1.0, **drives)
        one = certified(ss.simulate(dish, parameters=small)).at(times)
        other = certified(ss.simulate(floor, parameters=small)).at(times)
        away.append(float(np.max(np.abs(one["x"] - other["x"])) / np.max(np.abs(other["x"]))))
    assert away[1] < 1e-5
    assert away[1] < 0.02 * away[0]  # as the square of its size


@pytest.mark.parametrize("start", [(0.0, 0.0), (0.3, 2.0)])
def test_a_bowl_that_is_declared_twice(start: tuple[float, float]) -> None:
    """Both share what presses the bead, and slip at once."""
    one = bowl(force=4.0)
    contact = one.contacts["bowl"]
    assert isinstance(contact, Unilateral)
    two = replace(one, contacts={"one": contact, "two": contact})
    expected, found = (
        certified(ss.simulate(system, initial=thrown(*start))).final for system in (one, two)
    )
    for name in expected:
        assert found[name] == pytest.approx(expected[name], rel=1e-9, abs=1e-12)
