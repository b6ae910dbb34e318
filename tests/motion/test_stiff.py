"""Stiff motion: what decays does not bound the steps, and nothing is missed in the long ones."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from scipy.integrate import quad_vec, solve_ivp

from stickslip import (
    Contact,
    Inertial,
    Outcome,
    Parameter,
    System,
    Trajectory,
    Viscous,
    catalogue,
    simulate,
    simulate_many,
)
from stickslip.motion.steps.radau import POWERS, SLOPES, STAGE_NODES, TERMS


def given(**defaults: float) -> dict[str, Parameter]:
    return {name: Parameter(default=value) for name, value in defaults.items()}


def certified(motion: Trajectory) -> Trajectory:
    assert motion.outcome is Outcome.FINISHED, motion.message
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


def test_tables_of_radau_stages() -> None:
    # Order 12 of the table is 24: twelve stages. The rule differentiates powers, and its terms give
    # them back.
    c = STAGE_NODES[-1]
    D = SLOPES[-1]
    terms = TERMS[-1]
    for k in range(1, 13):
        assert D @ c[1:] ** k == pytest.approx(k * c[1:] ** (k - 1), abs=1e-11)
        powers = POWERS @ (terms @ c**k)
        assert powers == pytest.approx(np.eye(13)[k], abs=1e-7)
    # Radau quadrature: exact up to the degree 22, with the last row of the inverse as weights.
    weights = np.linalg.inv(D)[-1]
    for k in (1, 11, 22):
        assert weights @ c[1:] ** k == pytest.approx(1.0 / (k + 1), rel=1e-13)


TIP = {"nu": 1e-4, "V": 1e-4}


def test_slow_pull_of_a_tip_over_a_lattice() -> None:
    motion = certified(simulate(catalogue.prandtl_tomlinson(), (0.0, 3e4), parameters=TIP))
    # Radau IIA with 8, 10, 12, 14 and 20 stages in a program of its own agree in all digits.
    assert motion.final["x"] == pytest.approx(2.56147440943948, rel=1e-12)
    assert len(motion.knots.time) < 20_000  # 2.5e8 with series alone
    many = simulate_many(
        catalogue.prandtl_tomlinson(), (0.0, 3e4), parameters={"nu": [1e-4, 1e-4], "V": 1e-4}
    ).dataset
    assert np.all(many["final_x"].values == motion.final["x"])
    # Between the knots the forces balance.
    t = np.linspace(1e3, 7e3, 50)
    x = motion.at(t)["x"]
    force = 2 * np.pi * 0.05 / 0.5 * np.sin(2 * np.pi * x / 0.5) + x - 1e-4 * t
    assert np.max(np.abs(force)) < 1e-6


# A viscosity of 1/L under a smooth load; the quadratic drive keeps closed forms out.
RELAXING = System(
    "relaxing",
    parameters=given(L=1e4),
    coordinates={"x": Viscous()},
    viscous="d_x**2/(2*L)",
    potential="x**2/2 - t**2*exp(-t/3)*x",
)


@pytest.mark.parametrize("L", [1e2, 1e4, 1e6, 1e8])
def test_linear_relaxation_against_its_closed_form(L: float) -> None:
    motion = certified(simulate(RELAXING, (0.0, 12.0), initial={"x": 0.5}, parameters={"L": L}))
    # ẋ = L (t² exp(−t/3) − x): x = (a t² + b t + c) exp(−t/3) + (x₀ − c) exp(−L t) with a (L − 1/3)
    # = L, …
    p = L - 1.0 / 3.0
    a = L / p
    b = -2.0 * a / p
    c = -b / p
    t = np.linspace(0.5, 12.0, 60)
    x = (a * t**2 + b * t + c) * np.exp(-t / 3.0)
    assert motion.at(t)["x"] == pytest.approx(x, rel=1e-10, abs=1e-11)
    assert len(motion.knots.time) < 6_000


COUPLED = System(
    "coupled",
    parameters=given(L=1e6),
    coordinates={"x": Viscous(), "y": Viscous()},
    viscous="d_x**2/(2*L) + d_y**2/2",
    potential="(x - y)**2/2 + y**2/2 - t**2*exp(-t/3)*y",
)


@pytest.mark.parametrize("L", [1e4, 1e8])
def test_stiff_and_slow_coordinate_together(L: float) -> None:
    motion = certified(
        simulate(COUPLED, (0.0, 12.0), initial={"x": 0.3, "y": -0.2}, parameters={"L": L})
    )

    def rates(t: float, z: np.ndarray) -> list[float]:
        x, y = z
        return [-L * (x - y), x - 2 * y + t**2 * math.exp(-t / 3)]

    exact = solve_ivp(
        rates,
        (0, 12),
        [0.3, -0.2],
        "Radau",
        rtol=1e-11,
        atol=1e-12,
        jac=np.array([[-L, L], [1.0, -2.0]]),
    )
    assert motion.final["x"] == pytest.approx(exact.y[0, -1], rel=1e-8)
    assert motion.final["y"] == pytest.approx(exact.y[1, -1], rel=1e-8)
    assert len(motion.knots.time) < 20_000


# What sticks and slips has the stiff coordinate: x = ±(F − s) in slip, up to 1/L.
RUBBED = System(
    "rubbed",
    parameters=given(L=1e4),
    coordinates={"x": Viscous()},
    viscous="d_x**2/(2*L)",
    potential="x**2/2 + x**4/4 - 2*sin(t)*x",
    contacts={"ground": Contact("d_x", "0.3")},
)


@pytest.mark.parametrize("L", [1e2, 1e4, 1e6])
def test_stick_and_slip_in_the_stiff_coordinate(L: float) -> None:
    motion = certified(simulate(RUBBED, (0.0, 20.0), parameters={"L": L}))
    # Without viscosity, x + x³ = 2 sin t ∓ 0.3 in slip, which begins where 2 sin t = ±0.3 + what
    # was held, and ends at the extrema of the load: three switches in every half period.
    assert motion.n_switches == 13
    at = motion.events.time.to_numpy()
    assert at[0] == pytest.approx(math.asin(0.15), abs=1e-9)
    assert at[1::2][:6] == pytest.approx(math.pi / 2 + np.arange(6) * math.pi, abs=30.0 / L)
    for t in (1.0, 4.0, 7.0):
        sign = 1.0 if motion.at(t)["mode_ground"] > 0 else -1.0
        x = motion.at(t)["x"]
        assert x + x**3 == pytest.approx(2 * math.sin(t) - 0.3 * sign, abs=30.0 / L)
    many = simulate_many(RUBBED, (0.0, 20.0), parameters={"L": [L, L]}).dataset
    assert np.all(many["final_x"].values == motion.final["x"])


DAMPED = System(
    "damped",
    parameters=given(c=1e4),
    coordinates={"x": Inertial()},
    kinetic="d_x**2/2",
    viscous="c*d_x**2/2",
    potential="x**2/2 + x**4/4 - c*sin(t)*x",
)


@pytest.mark.parametrize("c", [1e3, 1e5])
def test_heavily_damped_mass_against_another_integrator(c: float) -> None:
    motion = certified(
        simulate(DAMPED, (0.0, 5.0), initial={"x": 0.1, "d_x": 2.0}, parameters={"c": c})
    )

    def rates(t: float, z: np.ndarray) -> list[float]:
        return [z[1], c * math.sin(t) - z[0] - z[0] ** 3 - c * z[1]]

    exact = solve_ivp(rates, (0, 5), [0.1, 2.0], "Radau", rtol=1e-12, atol=1e-13)
    assert motion.final["x"] == pytest.approx(exact.y[0, -1], rel=1e-8)
    assert motion.final["d_x"] == pytest.approx(exact.y[1, -1], rel=1e-7)
    assert len(motion.knots.time) < 20_000


# A pulse on a slow coordinate in the middle of what is one long step of the stiff one beside it.
PULSED = System(
    "pulsed",
    parameters=given(L=1e4, w=1e-2, A=1.0),
    coordinates={"x": Viscous(), "y": Viscous()},
    viscous="d_x**2/(2*L) + d_y**2/2",
    potential="x**2/2 - sin(t/100)**2*x - A*exp(-((t - 50)/w)**2)*y",
)


@pytest.mark.parametrize("m", [1e-6, 1e-7, 1e-8, 1e-10])
def test_tip_of_a_tiny_mass_moves_as_one_without(m: float) -> None:
    """Its certificate follows the same long steps: by series, which rounding errors of where a
    piece begins make short, there would be 1.3e6 for m = 1e-7 and ten times as many for 1e-8."""
    parts = {"kinetic": "m*d_x**2/2", "potential": "(x - t/2)**2/2 - 2*cos(6.283*x)"}
    number = {"parameters": given(m=m), "viscous": "d_x**2/2"}
    heavy = System(name="tip", coordinates={"x": Inertial()}, **parts, **number)
    light = System(
        name="tip", coordinates={"x": Viscous()}, potential=parts["potential"], viscous="d_x**2/2"
    )
    moved = simulate(heavy, (0.0, 30.0))
    begun = time.process_time()
    certified(moved)
    assert time.process_time() - begun < 4.0
    assert moved.final["x"] == pytest.approx(simulate(light, (0.0, 30.0)).final["x"], abs=50 * m)


@pytest.mark.parametrize("w", [1e-1, 1e-3, 1e-5, 1e-7])
def test_pulse_in_the_middle_of_a_long_step_is_not_missed(w: float) -> None:
    free = certified(simulate(PULSED, (0.0, 100.0), parameters={"A": 0.0}))
    assert np.max(np.diff(free.knots.time)) > 10.0
    motion = simulate(PULSED, (0.0, 100.0), parameters={"w": w, "A": 1.0 / w})
    # The slow coordinate keeps the impulse of the pulse, √π, as exact as times are known in widths.
    assert motion.final["y"] == pytest.approx(math.sqrt(math.pi), rel=max(1e-10, 1e-13 / w))
    assert motion.final["x"] == pytest.approx(free.final["x"], rel=1e-12)
    assert len(motion.knots.time) < 20_000
    assert motion.certificate.ok or w < 1e-4, motion.certificate.verdict


def test_dip_of_a_threshold_is_not_missed() -> None:
    # The threshold falls to nothing for a moment, while the stiff coordinate beside it is followed
    # by long steps.
    system = System(
        "latch",
        parameters=given(L=1e4, w=1e-3),
        coordinates={"x": Viscous(), "y": Viscous()},
        viscous="d_x**2/(2*L) + d_y**2/2",
        potential="(x - t**2*exp(-t/100))**2/2 + (y - 0.5)**2/2",
        contacts={"latch": Contact("d_y", "1 - exp(-((t - 50)/w)**2)")},
    )
    motion = certified(simulate(system, (0.0, 100.0)))
    assert motion.n_switches == 2
    assert motion.final["y"] > 0.0


@pytest.mark.parametrize("turning", [0.1, 1.0])
@pytest.mark.parametrize("excess", [1e-4, 1e-5, 1e-6, 1e-7, 1e-8])
def test_slip_under_a_force_that_turns_just_above_its_threshold(
    excess: float, turning: float
) -> None:
    """The direction of a slip with speed r follows that of the force within the time r: to second
    order in the excess ε it lags behind by r ω, and r = ε t − ε² ω² t³/6."""
    block = System(
        "block under a turning force",
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="-(1 + e)*(x*cos(w*t) + y*sin(w*t))",
        parameters=given(e=excess, w=turning),
        contacts={"table": Contact(("d_x", "d_y"), 1)},
    )
    motion = certified(simulate(block, (0.0, 2.0)))
    assert len(motion.knots.time) < 5000

    def way(t: float) -> np.ndarray:
        speed = excess * t - excess**2 * turning**2 * t**3 / 6
        lag = turning * t - excess * t * turning
        return speed * np.array([np.cos(lag), np.sin(lag)])

    expected, _ = quad_vec(way, 0.0, 2.0, epsrel=1e-13)
    found = np.array([motion.final["x"], motion.final["y"]])
    # Third orders of the excess, and rounding errors of the threshold beside it
    assert found == pytest.approx(expected, rel=0, abs=excess * (20 * excess**2 + 1e-15 / excess))
