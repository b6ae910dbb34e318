"""Friction in a plane: the systems of the catalogue against closed forms, quadrature, and a solver
for smooth equations between the ends of a slip."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import stickslip as ss
from stickslip.arrays import Array


def certified(motion: ss.Trajectory) -> ss.Trajectory:
    assert motion.outcome.ok
    assert motion.certificate.ok, motion.certificate
    return motion


# -- the puck --------------------------------------------------------------------------------------


def thrown(angle: float, ratio: float, speed: float = 1.3) -> tuple[ss.System, dict[str, float]]:
    """A puck thrown at an angle to the force, which is a part of the friction."""
    system = ss.catalogue.puck(F=ratio * 0.2 * 0.2 * 9.81)
    return system, {"d_x": speed * np.cos(angle), "d_y": speed * np.sin(angle)}


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, 2.0, 3.0, 3.14])
@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.6, 0.9, 0.99])
def test_a_puck_stops_after_the_time_of_the_closed_form(angle: float, ratio: float) -> None:
    """d(k|v| + F v_x)/dt = −(k² − F²)/m."""
    system, initial = thrown(angle, ratio)
    k, F = system.evaluate("k"), system.values["F"]
    time = 0.2 * (k * 1.3 + F * initial["d_x"]) / (k**2 - F**2)
    motion = certified(ss.simulate(system, (0, 2 * time), initial=initial))
    (stop,) = motion.events["time"]
    assert stop == pytest.approx(time, rel=1e-11)


@pytest.mark.parametrize(("angle", "ratio"), [(0.5, 0.3), (1.6, 0.7), (2.8, 0.9)])
def test_a_puck_stops_where_quadrature_says(angle: float, ratio: float) -> None:
    """With the angle φ between velocity and force, v sin φ grows as tan(φ/2)^(k/F), and dt is −m v
    dφ/(F sin φ)."""
    system, initial = thrown(angle, ratio)
    m, k, F = 0.2, system.evaluate("k"), system.values["F"]

    def speed(phi: float) -> float:
        grown = (np.tan(phi / 2) / np.tan(angle / 2)) ** (k / F)
        return 1.3 * np.sin(angle) / np.sin(phi) * grown

    def way(along: Callable[[float], float]) -> float:
        return quad(
            lambda phi: along(phi) * speed(phi) ** 2 * m / (F * np.sin(phi)),
            0.0,
            angle,
            epsabs=0.0,
            epsrel=1e-12,
            limit=500,
        )[0]

    motion = certified(ss.simulate(system, (0, 20), initial=initial))
    assert motion.final["x"] == pytest.approx(way(np.cos), rel=1e-9, abs=1e-11)
    assert motion.final["y"] == pytest.approx(way(np.sin), rel=1e-9)


# -- the turntable ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("k", "Omega_0", "R"), [(4.0, 1.0, 0.1), (3.0, 2.0, 0.1), (9.0, 0.5, 0.2)])
def test_the_disc_carries_a_block_to_the_angle_of_the_closed_form(
    k: float, Omega_0: float, R: float
) -> None:
    system = ss.catalogue.turntable(k=k, Omega_0=Omega_0, R=R)
    initial = {"x": R, "d_y": Omega_0 * R}
    motion = certified(ss.simulate(system, (0, 3 / Omega_0), initial=initial))
    first = motion.events.iloc[0]
    assert first[["from", "to"]].tolist() == ["stick", "slip"]
    assert Omega_0 * first["time"] == pytest.approx(system.evaluate("slip_angle"), rel=1e-11)
    assert np.hypot(first["x"], first["y"]) == pytest.approx(R, rel=1e-12)


@pytest.mark.parametrize("above", [1 - 1e-6, 1 + 1e-6])
def test_without_a_spring_a_block_is_thrown_off_where_friction_is_too_weak(above: float) -> None:
    speed = above * np.sqrt(0.3 * 9.81 / 0.1)
    system = ss.catalogue.turntable(k=0, Omega_0=speed)
    motion = certified(ss.simulate(system, (0, 2), initial={"x": 0.1, "d_y": 0.1 * speed}))
    carried = np.hypot(motion.final["x"], motion.final["y"])
    assert (carried == pytest.approx(0.1, rel=1e-10)) == (above < 1)


def sliding(y: Array, k: float) -> Array:
    """The equations of the block while it slips, written out."""
    x, z, v, w = y
    u = np.array([v + z, w - x])
    pull = -0.2 * 0.1 * 9.81 * u / np.linalg.norm(u)
    return np.array([v, w, (pull[0] - k * (x - 0.1)) / 0.1, (pull[1] - k * z) / 0.1])


def test_a_slip_is_that_of_a_solver_for_smooth_equations() -> None:
    motion = certified(ss.simulate(ss.catalogue.turntable(), (0, 3)))
    begin, end = motion.events["time"][:2]
    times = np.linspace(begin + 0.05, end - 0.05, 20)
    seen = motion.at(times)
    states = np.array([seen[name] for name in ("x", "y", "d_x", "d_y")])
    found = solve_ivp(
        lambda _, y: sliding(y, 4.0),
        (times[0], times[-1]),
        states[:, 0],
        "DOP853",
        t_eval=times,
        rtol=1e-12,
        atol=1e-14,
    )
    assert np.max(np.abs(found.y - states)) < 1e-10


# -- the conveyor ----------------------------------------------------------------------------------


def test_a_parcel_slips_where_both_belts_bear_the_same() -> None:
    motion = certified(ss.simulate(ss.catalogue.conveyor()))
    leaves, arrives = (row for _, row in motion.events.iterrows())
    assert leaves[["contact", "to"]].tolist() == ["first belt", "slip"]
    assert leaves[["x"]].tolist() == pytest.approx([0.0], abs=1e-14)
    assert arrives[["contact", "to"]].tolist() == ["second belt", "stick"]
    assert (motion.final["d_x"], motion.final["d_y"]) == pytest.approx((0.0, 0.8), abs=1e-12)


def test_the_corner_is_that_of_a_solver_for_smooth_equations() -> None:
    motion = certified(ss.simulate(ss.catalogue.conveyor()))
    begin, end = motion.events["time"]
    times = np.linspace(begin + 0.05, end - 0.02, 20)
    seen = motion.at(times)
    states = np.array([seen[name] for name in ("x", "y", "d_x", "d_y")])

    def right(_: float, y: Array) -> Array:
        share = 0.5 * (1 + np.tanh(20 * y[0]))
        velocity = y[2:]
        rubbed = np.zeros(2)
        for belt, part in (((1.0, 0.0), 1 - share), ((0.0, 0.8), share)):
            u = velocity - np.array(belt)
            rubbed -= 0.4 * 9.81 * part * u / np.linalg.norm(u)
        return np.concatenate([velocity, rubbed])

    found = solve_ivp(
        right,
        (times[0], times[-1]),
        states[:, 0],
        "DOP853",
        t_eval=times,
        rtol=1e-12,
        atol=1e-14,
    )
    assert np.max(np.abs(found.y - states)) < 1e-10


# -- without mass ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("V", "F_c", "k"), [(0.1, 1.0, 10.0), (0.3, 0.7, 2.0)])
def test_a_body_dragged_by_a_spring_follows_the_tractrix(V: float, F_c: float, k: float) -> None:
    a = F_c / k
    system = ss.catalogue.tractrix(V=V, F_c=F_c, k=k)
    motion = certified(ss.simulate(system, (0, 5 * a / V), initial={"y": a}))
    tau = np.linspace(0, 5, 40)
    seen = motion.at(tau * a / V)
    assert seen["x"] == pytest.approx(a * (tau - np.tanh(tau)), rel=1e-9, abs=1e-11)
    assert seen["y"] == pytest.approx(a / np.cosh(tau), rel=1e-9)


@pytest.mark.parametrize(("P", "omega"), [(0.8, 1.2), (1.5, 0.7), (0.9, 1.35)])
def test_under_a_force_that_goes_around_a_circle_mass_and_slider_do_so_too(
    P: float, omega: float
) -> None:
    system = ss.catalogue.planar_jenkins(P=P, Q=P, omega=omega, c=0.3)
    motion = certified(ss.simulate(system, (0, 200)))
    last = motion.at(np.linspace(190, 200, 50))
    circle, slider = system.evaluate("circle"), system.evaluate("circle_of_slider")
    assert np.hypot(last["x"], last["y"]) == pytest.approx(circle, rel=1e-9)
    assert np.hypot(last["z_x"], last["z_y"]) == pytest.approx(slider, rel=1e-9)


# -- the floor -------------------------------------------------------------------------------------

EAST = ss.catalogue.isolated_floor().drives["a_x"]


def turned(angle: float) -> ss.System:
    """The floor under one component, in a direction."""
    c, s = math.cos(angle), math.sin(angle)
    return ss.catalogue.isolated_floor(a_x=f"{c!r}*({EAST})", a_y=f"{s!r}*({EAST})")


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5])
def test_a_floor_shaken_along_a_line_moves_as_one_with_a_contact_along_it(angle: float) -> None:
    line = ss.System(
        name="floor",
        functions={"envelope": "(t/3)**2*exp(2 - 2*t/3)"},
        drives={"a": EAST},
        coordinates={"x": ss.Inertial(force="-1000*a")},
        kinetic="500*d_x**2",
        potential="1000*9.81/3*x**2",
        contacts={"bearings": ss.Contact("d_x", 0.05 * 1000 * 9.81)},
    )
    expected = certified(ss.simulate(line, (0, 12)))
    motion = certified(ss.simulate(turned(angle), (0, 12)))
    times = np.linspace(0, 12, 200)
    seen = motion.at(times)
    along = np.cos(angle) * seen["x"] + np.sin(angle) * seen["y"]
    across = np.cos(angle) * seen["y"] - np.sin(angle) * seen["x"]
    assert np.max(np.abs(along - expected.at(times)["x"])) < 1e-10
    assert np.max(np.abs(across)) < 1e-10


def test_the_plane_has_no_direction_of_its_own() -> None:
    """Both components, turned by an angle, turn the motion by it."""
    plain = ss.catalogue.isolated_floor()
    a, b = plain.drives["a_x"], plain.drives["a_y"]
    c, s = math.cos(0.9), math.sin(0.9)
    other = ss.catalogue.isolated_floor(
        a_x=f"{c!r}*({a}) - {s!r}*({b})", a_y=f"{s!r}*({a}) + {c!r}*({b})"
    )
    times = np.linspace(0, 15, 100)
    seen = certified(ss.simulate(plain)).at(times)
    again = certified(ss.simulate(other)).at(times)
    assert np.max(np.abs(c * seen["x"] - s * seen["y"] - again["x"])) < 1e-9
    assert np.max(np.abs(s * seen["x"] + c * seen["y"] - again["y"])) < 1e-9


def test_records_of_both_components() -> None:
    """A record that is straight between its times moves the floor as the formula does that is."""
    times = np.linspace(0, 15, 751)
    x = 2.0 * np.sin(3 * times) * np.exp(-times / 6)
    y = 1.5 * np.cos(2 * times) * np.exp(-times / 6)
    floor = ss.catalogue.isolated_floor(a_x=ss.Samples(times, x), a_y=ss.Samples(times, y))
    motion = certified(ss.simulate(floor, (0, 12)))
    times = np.linspace(0, 12, 300)
    smooth = ss.catalogue.isolated_floor(a_x="2*sin(3*t)*exp(-t/6)", a_y="1.5*cos(2*t)*exp(-t/6)")
    seen, expected = motion.at(times), ss.simulate(smooth, (0, 12)).at(times)
    assert np.max(np.abs(seen["x"] - expected["x"])) < 1e-3 * np.ptp(expected["x"])
    assert np.max(np.abs(seen["y"] - expected["y"])) < 1e-3 * np.ptp(expected["y"])
