"""Bodies that begin at rest and are driven at one place: elsewhere what their modes do cancels, to
rounding errors at first, and what is far away has hardly begun to move."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from bodies import chain, typed

SEEDS = range(6)


def random_chain(rng: np.random.Generator, n: int) -> tuple[Any, Any, Any]:
    """Mass, stiffness and damping of unequal masses between springs, held at both ends."""
    k = rng.uniform(0.5, 3.0, n + 1)
    stiffness = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    return np.diag(rng.uniform(0.5, 2.0, n)), stiffness, 0.01 * stiffness


def lugre(rate: str) -> dict[str, Any]:
    law = ss.laws.lugre(rate, F_c=1, F_s=1.5, v_s=0.1, sigma_0=100, sigma_1=1)
    return {"contacts": {"c": law}}


def dahl(rate: str) -> dict[str, Any]:
    return {"contacts": {"c": ss.laws.dahl(rate, F_c=0.5, k=20.0)}}


def certified(system: ss.System) -> ss.Trajectory:
    motion = ss.simulate(system)
    assert motion.outcome.ok, motion.message
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


@pytest.mark.parametrize("law", [lugre, dahl])
@pytest.mark.parametrize("seed", SEEDS)
def test_laws_in_which_the_modulus_of_a_rate_stands(seed: int, law: Any) -> None:
    """A structure, whose unknowns are sums of modes, moves as formulas do."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    rub, tip = map(int, rng.choice(n, 2, replace=False))
    matrices = random_chain(rng, n)
    force = f"{rng.uniform(0.5, 3.0):.3f}*cos({rng.uniform(0.5, 3.0):.3f}*t)"
    body = {"structures": {"u": ss.Structure(*matrices)}, "forces": {f"u[{tip}]": force}}
    moved = certified(ss.System("s", **body, **law(f"d_u[{rub}]"), span=(0.0, 12.0)))
    other = certified(typed(*matrices, {tip: force}, **law(f"d_q{rub}"), span=(0.0, 12.0)))
    times = np.linspace(0.0, 12.0, 25)
    found, right = moved.at(times)[f"u[{rub}]"], other.at(times)[f"q{rub}"]
    np.testing.assert_allclose(found, right, rtol=0, atol=1e-8)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_drag_and_a_stop_at_what_friction_holds(seed: int) -> None:
    """Where an unknown stays is nothing but rounding errors of its modes, and so is the side of a
    kink on which it is."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    rub, tip = map(int, rng.choice(n, 2, replace=False))
    load = f"-0.3*abs(d_u[{rub}])*d_u[{rub}] + 0.1*max(u[{rub}], 0)"
    system = ss.System(
        "s",
        structures={"u": ss.Structure(*random_chain(rng, n))},
        forces={f"u[{tip}]": "0.5*cos(2.7*t)", f"u[{rub}]": load},
        contacts={"c": ss.Contact(f"d_u[{rub}]", 0.2 if seed % 2 else 5.0)},
        span=(0.0, 12.0),
    )
    certified(system)


@pytest.mark.parametrize("n", [30, 45])
@pytest.mark.parametrize("rub", [0, -1])
def test_the_far_end_of_a_long_chain(n: int, rub: int) -> None:
    """It begins like a high power of time, and is measured against what it becomes."""
    mass, stiffness = chain(n)
    contacts = {"c": ss.Contact(f"d_q{rub % n}", 0.5, kinetic=0.3)}
    force = {n - 1: "5*cos(0.4*t)"}
    certified(typed(mass, stiffness, 0.01 * stiffness, force, contacts=contacts, span=(0.0, 100.0)))


@pytest.mark.parametrize("small", [1e-10, 1e-20, 1e-30])
def test_units_that_are_far_apart(small: float) -> None:
    """What is small beside another coordinate, and knows nothing of it, moves as it does alone."""

    def system(others: dict[str, str]) -> ss.System:
        return ss.System(
            "s",
            coordinates={x: ss.Inertial() for x in ("x", *others)},
            kinetic=" + ".join(f"d_{x}**2/2" for x in ("x", *others)),
            potential=" + ".join(["x**2/2", *others.values()]),
            viscous="0.01*d_x**2/2",
            contacts={
                "c": ss.Contact(
                    "d_x", 0.1 * small, 0.3 * small, kinetic=f"{0.05 * small}*(1 + exp(-speed))"
                )
            },
            initial={"x": small, **dict.fromkeys(others, 100.0)},
            span=(0.0, 30.0),
        )

    alone, beside = certified(system({})), certified(system({"y": "y**2/2 + 1e-5*y**4"}))
    assert beside.final["x"] == pytest.approx(alone.final["x"], abs=1e-9 * small)
    assert beside.n_switches == alone.n_switches


def ellipse(axes: tuple[float, float], forces: tuple[str, str]) -> ss.Trajectory:
    """A puck on a table whose limit curve is an ellipse, for 1 s from rest."""
    first, second = forces
    system = ss.System(
        "ellipse",
        coordinates={"x": ss.Inertial(force=first), "y": ss.Inertial(force=second)},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts={"table": ss.Contact(("d_x", "d_y"), 1.0, axes=axes)},
        span=(0, 1),
    )
    return ss.simulate(system)


@pytest.mark.parametrize("narrow", [0.3, 0.1, 0.01, 1e-4])
def test_slips_begin_along_the_long_axis_of_an_ellipse(narrow: float) -> None:
    """The slip starts at t = 1/2 with x'' = t - 1/2, whichever axis is the long one."""
    upright = ellipse((narrow, 1.0), ("0", "0.5 + t"))
    lying = ellipse((1.0, narrow), ("0.5 + t", "0"))
    assert upright.certificate.ok
    assert lying.certificate.ok
    for along, across, motion in (("y", "x", upright), ("x", "y", lying)):
        assert motion.final[along] == pytest.approx(1 / 48, rel=1e-12)
        assert motion.final[f"d_{along}"] == pytest.approx(1 / 8, rel=1e-12)
        assert motion.final[across] == motion.final[f"d_{across}"] == 0.0


@pytest.mark.parametrize("seed", range(12))
def test_slips_of_an_ellipse_do_not_depend_on_the_order_of_its_axes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    narrow = float(10.0 ** rng.uniform(-2.0, 0.0))
    across, turning = rng.uniform(-0.5, 0.5, 2) * narrow
    small, large = f"{across} + {turning}*t", f"{rng.uniform(0.3, 0.8)} + t"
    upright = ellipse((narrow, 1.0), (small, large))
    lying = ellipse((1.0, narrow), (large, small))
    assert upright.certificate.ok
    assert lying.certificate.ok
    for one, other in (("x", "y"), ("d_x", "d_y")):
        assert upright.final[one] == pytest.approx(lying.final[other], rel=1e-9, abs=1e-12)
        assert upright.final[other] == pytest.approx(lying.final[one], rel=1e-9, abs=1e-12)


def puck(forces: tuple[str, str]) -> ss.Trajectory:
    return ellipse((1.0, 1.0), forces)


@pytest.mark.parametrize(
    ("forces", "load"),
    [
        (("1", "t**2"), lambda t: (1.0, t**2)),
        (("1 - t**2/2", "t"), lambda t: (1.0 - t**2 / 2, t)),
        (
            ("(1 + t**4)*cos(t)", "(1 + t**4)*sin(t)"),
            lambda t: ((1 + t**4) * np.cos(t), (1 + t**4) * np.sin(t)),
        ),
    ],
)
def test_a_load_leaves_the_limit_curve_like_the_fourth_power_of_time(
    forces: tuple[str, str], load: Callable[[float], tuple[float, float]]
) -> None:
    """It begins on the curve and moves along it: |F| - 1 grows like t**4. Regularised friction,
    extrapolated to none, is the reference."""
    motion = puck(forces)
    assert motion.certificate.ok

    def acceleration(t: float, y: np.ndarray, small: float) -> np.ndarray:
        u = y[2:]
        return np.array(load(t)) - u / np.hypot(small, np.hypot(*u))

    found = np.array([motion.final[x] for x in ("x", "y", "d_x", "d_y")])
    np.testing.assert_allclose(found, extrapolated(acceleration, np.zeros(4)), atol=2e-7)


def extrapolated(
    acceleration: Callable[[float, np.ndarray, float], np.ndarray], start: np.ndarray
) -> np.ndarray:
    """The state after 1 s with regularised friction, extrapolated to none."""

    def end(small: float) -> np.ndarray:
        def rate(t: float, y: np.ndarray) -> np.ndarray:
            return np.append(y[len(y) // 2 :], acceleration(t, y, small))

        with np.errstate(over="ignore"):
            found = solve_ivp(rate, (0.0, 1.0), start, "Radau", rtol=1e-9, atol=1e-14)
        return found.y[:, -1]

    # Its error is a power of its parameter: Aitken's extrapolation needs no exponent.
    ends = np.array([end(small) for small in (1e-6, 1e-7, 1e-8)])
    before, last = np.diff(ends, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        beyond = last**2 / (last - before)
    return ends[-1] - np.where(np.isfinite(beyond), beyond, 0.0)


def rod(forces: tuple[str, str, str], angle: float) -> ss.Trajectory:
    """A rod on two points, for 1 s from rest, under two forces at its centre and a moment."""
    points = {
        name: (f"d_x - d_phi*({side})*sin(phi)", f"d_y + d_phi*({side})*cos(phi)")
        for name, side in (("left", -1), ("right", 1))
    }
    system = ss.System(
        "rod",
        coordinates={
            x: ss.Inertial(force=f) for x, f in zip(("x", "y", "phi"), forces, strict=True)
        },
        kinetic="(d_x**2 + d_y**2 + 0.4*d_phi**2)/2",
        contacts={name: ss.Contact(point, 0.5) for name, point in points.items()},
        initial={"phi": angle},
        span=(0, 1),
    )
    return ss.simulate(system)


@pytest.mark.parametrize("angle", [0.0, 0.1, 0.3, 1.0, 2.0])
@pytest.mark.parametrize("across", ["t", "t**2", "(t + t**2)/2"])
def test_a_rod_pushed_at_its_centre_moves_like_a_puck_in_as_few_steps(
    across: str, angle: float
) -> None:
    """Its rate of rotation is nothing but rounding errors, which decay within 1e-9 s."""
    single, motion = puck(("1", across)), rod(("1", across, "0"), angle)
    assert motion.certificate.ok
    assert len(motion.knots.time) < 250
    for x in ("x", "y", "d_x", "d_y"):
        assert motion.final[x] == pytest.approx(single.final[x], rel=1e-9)
    assert motion.final["phi"] == pytest.approx(angle, abs=1e-15)


@pytest.mark.parametrize("angle", [0.1, 0.3, 2.0])
@pytest.mark.parametrize("moment", ["t**3", "0.01*t**2"])
def test_a_load_on_a_rod_leaves_what_two_points_hold_like_the_fourth_power_of_time(
    moment: str, angle: float
) -> None:
    motion = rod(("1", "t**2", moment), angle)
    assert motion.certificate.ok
    assert len(motion.knots.time) < 2000
    factor = {"t**3": lambda t: t**3, "0.01*t**2": lambda t: 0.01 * t**2}[moment]

    def acceleration(t: float, y: np.ndarray, small: float) -> np.ndarray:
        _, _, phi, v_x, v_y, w = y.tolist()
        F_x, F_y, M = 1.0, t**2, factor(t)
        for side in (-1.0, 1.0):
            arm_x, arm_y = side * math.cos(phi), side * math.sin(phi)
            u_x, u_y = v_x - w * arm_y, v_y + w * arm_x
            pull = 0.5 / math.hypot(small, u_x, u_y)
            F_x -= pull * u_x
            F_y -= pull * u_y
            M -= pull * (arm_x * u_y - arm_y * u_x)
        return np.array([F_x, F_y, M / 0.4])

    expected = extrapolated(acceleration, np.array([0.0, 0.0, angle, 0.0, 0.0, 0.0]))
    found = [motion.final[x] for x in ("x", "y", "phi", "d_x", "d_y", "d_phi")]
    np.testing.assert_allclose(found, expected, atol=2e-7)


def test_a_load_that_leaves_the_limit_curve_too_slowly_has_an_honest_outcome() -> None:
    motion = puck(("(1 + t**6)*cos(t)", "(1 + t**6)*sin(t)"))
    assert motion.outcome is ss.Outcome.NO_MODE
    assert "fourth power" in motion.message
