"""Friction in a plane against closed forms, and against an integration in the time τ of
dt = |u| dτ, in which the end of a slip is smooth."""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, hypot, log, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import quad

from oracles import planar
from stickslip import Contact, Inertial, Outcome, System, Trajectory, catalogue, simulate
from systems import parameters

# Section by section: a puck under a constant force, thrown pucks, belts, turntables, steady slips.


def puck(name: str = "puck", **words: object) -> System:
    """A unit mass on a table, with forces f and g, kinetic friction and axes to be given."""
    contact = Contact(("d_x", "d_y"), "s", **{"kinetic": "k", **words})
    return System(
        name,
        parameters=parameters(s=1.0, k=1.0, f=0.0, g=0.0, c=0.0, a=1.0, b=1.0, v=0.3, w=0.0),
        coordinates={"x": Inertial(force="f"), "y": Inertial(force="g")},
        kinetic="(d_x**2 + d_y**2)/2",
        viscous="c/2*(d_x**2 + d_y**2)",
        contacts={"table": contact},
    )


def certified(
    system: System, end: float, start: dict[str, float], values: dict[str, float] | None = None,
    begin: float = 0.0,
) -> Trajectory:  # fmt: skip
    motion = simulate(system, (begin, end), initial=start, parameters=values or {})
    assert motion.outcome.ok, motion.message
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


def thrown(speed: float, angle: float) -> dict[str, float]:
    return {"d_x": speed * cos(angle), "d_y": speed * sin(angle)}


def changes(motion: Trajectory) -> list[float]:
    """Times at which the contact begins or ends to slip."""
    knots = motion.knots
    return [float(t) for t in knots.time[1:][np.diff(knots.mode[:, 0]) != 0]]


def stop(motion: Trajectory) -> np.ndarray:
    """Time and place of the only end of a slip."""
    (time,) = changes(motion)
    return np.array([time, motion.final["x"], motion.final["y"]])


# -- under a constant force ------------------------------------------------------------------------


def test_the_printed_puck() -> None:
    motion = certified(puck(), 3.0, {"d_x": 1.0, "d_y": 0.5}, {"f": 0.3})
    assert motion.outcome is Outcome.AT_REST
    printed = [1.5582791085163679, 0.79974394986257957, 0.32430536796672502]
    np.testing.assert_allclose(stop(motion), printed, rtol=0, atol=5e-13)
    assert motion.final["d_x"] == 0.0
    assert motion.final["d_y"] == 0.0


def test_the_quadrature_is_the_closed_form() -> None:
    """Powers of tan(φ/2), a quadrature in φ, and the first integral r(k + f cos φ) agree."""
    f, k, speed, angle = 0.3, 1.0, hypot(1.0, 0.5), atan2(0.5, 1.0)
    whole = planar.pushed_puck(f, k, speed, angle)
    early = planar.pushed_puck_at(f, k, speed, angle, 0.05)
    rest = planar.pushed_puck(f, k, hypot(early[3], early[4]), 0.05)
    np.testing.assert_allclose(early[:3] + rest, whole, rtol=1e-13)
    assert whole[0] == pytest.approx(speed * (k + f * cos(angle)) / (k**2 - f**2), rel=1e-14)


CASES = [
    (share, angle) for share in (0.02, 0.3, 0.7, 0.95) for angle in (1e-3, 0.4, pi / 2, 2.5, 3.1)
]


@pytest.mark.parametrize(("share", "angle"), CASES)
def test_a_puck_under_a_constant_force(share: float, angle: float) -> None:
    """The force has any direction, and so has the speed: only the angle between them counts."""
    k, speed, turn = 0.7, 1.3, 1.0
    f = share * k
    end, x, y = planar.pushed_puck(f, k, speed, angle)
    motion = certified(
        puck(),
        2 * end,
        thrown(speed, turn + angle),
        {"s": k, "k": k, "f": f * cos(turn), "g": f * sin(turn)},
    )
    expected = [end, x * cos(turn) - y * sin(turn), x * sin(turn) + y * cos(turn)]
    np.testing.assert_allclose(stop(motion), expected, rtol=0, atol=1e-12 * (1 + end))


def test_a_slip_ends_in_few_steps() -> None:
    """Once the direction turns by nothing but what its series shows, one step leads to the end:
    before that was so, this motion took 84 steps."""
    motion = simulate(catalogue.puck())
    assert len(motion.knots.time) < 50
    k, f = 0.2 * 0.2 * 9.81, 0.3
    end = 0.2 * (k * sqrt(3.25) - f) / (k**2 - f**2)
    assert abs(changes(motion)[0] - end) < 1e-14
    assert motion.certificate.ok


@pytest.mark.parametrize("f", [0.3, 0.99, 1.0, 1.4])
def test_the_way_of_a_puck(f: float) -> None:
    """States on the way, by quadrature in the angle; from f = k on it goes on for ever."""
    speed, angle = 1.2, 2.6
    laters = np.array([2.0, 1.0, 0.3])
    expected = np.array([planar.pushed_puck_at(f, 1.0, speed, angle, a) for a in laters])
    motion = certified(puck(), expected[-1, 0], thrown(speed, angle), {"f": f})
    found = motion.at(expected[:, 0])
    for i, name in enumerate(("x", "y", "d_x", "d_y"), 1):
        np.testing.assert_allclose(found[name], expected[:, i], rtol=0, atol=1e-12, err_msg=name)
    assert len(changes(motion)) == 0


@pytest.mark.parametrize("angle", [0.0, 0.7, 4.0])
@pytest.mark.parametrize("k", [1.0, 0.6])
def test_a_push_from_rest_is_a_straight_line(angle: float, k: float) -> None:
    f = 1.3
    motion = certified(
        puck(), 2.0, {}, {"k": k, "f": f * cos(angle), "g": f * sin(angle)}
    )  # fmt: skip
    t = np.linspace(0.0, 2.0, 7)
    found = motion.at(t)
    way = (f - k) * t**2 / 2
    np.testing.assert_allclose(found["x"], way * cos(angle), rtol=0, atol=5e-13)
    np.testing.assert_allclose(found["y"], way * sin(angle), rtol=0, atol=5e-13)


@pytest.mark.parametrize("excess", [-1e-9, 1e-9])
def test_static_friction_holds_up_to_the_threshold(excess: float) -> None:
    f = 1.0 + excess
    motion = certified(puck(), 10.0, {}, {"f": f * 0.6, "g": -f * 0.8, "k": 0.5})
    if excess < 0:
        assert motion.outcome is Outcome.AT_REST
        assert motion.final["x"] == 0.0
    else:
        assert motion.final["x"] == pytest.approx(0.6 * (f - 0.5) * 50, rel=1e-12)
        assert motion.final["y"] == pytest.approx(-0.8 * (f - 0.5) * 50, rel=1e-12)


# -- thrown, without a force -----------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 0.5, pi / 2, 3.0, -1.2])
@pytest.mark.parametrize("speed", [1e-6, 1.0, 300.0])
def test_a_thrown_puck_goes_straight(angle: float, speed: float) -> None:
    """It stops after m v/k, m v²/2k away."""
    k = 0.4
    motion = certified(puck(), 2 * speed / k, thrown(speed, angle), {"s": k, "k": k})
    way = speed**2 / (2 * k)
    expected = [speed / k, way * cos(angle), way * sin(angle)]
    np.testing.assert_allclose(stop(motion), expected, rtol=1e-13, atol=1e-14 * way)
    t = np.linspace(0.0, speed / k, 5)
    found = motion.at(t)
    np.testing.assert_allclose(
        found["x"] * sin(angle), found["y"] * cos(angle), rtol=0, atol=1e-14 * way
    )


def test_with_viscous_drag() -> None:
    """m v′ = −k − c v."""
    speed, angle, k, c = 2.0, 0.8, 0.5, 0.7
    motion = certified(puck(), 8.0, thrown(speed, angle), {"s": k, "k": k, "c": c})
    time = log(1 + c * speed / k) / c
    way = speed / c - k * time / c
    np.testing.assert_allclose(
        stop(motion), [time, way * cos(angle), way * sin(angle)], rtol=0, atol=5e-13
    )


def test_with_friction_that_falls_with_the_speed() -> None:
    """dt = −dv/k(v), dx = v dt."""
    speed, angle, v = 1.5, 2.2, 0.3

    def k(u: float) -> float:
        return 0.6 + 0.4 * np.exp(-u / v)

    time = quad(lambda u: 1 / k(u), 0.0, speed, epsabs=1e-13, epsrel=1e-13)[0]
    way = quad(lambda u: u / k(u), 0.0, speed, epsabs=1e-13, epsrel=1e-13)[0]
    system = puck(kinetic="0.6*s + 0.4*s*exp(-speed/v)")
    motion = certified(system, 8.0, thrown(speed, angle), {"v": v})
    np.testing.assert_allclose(
        stop(motion), [time, way * cos(angle), way * sin(angle)], rtol=0, atol=5e-13
    )


@pytest.mark.parametrize("axes", [(1.0, 0.5), (0.3, 1.0), (2.0, 0.7)])
@pytest.mark.parametrize("angle", [0.1, 0.9, 2.0])
def test_thrown_where_friction_is_an_ellipse(axes: tuple[float, float], angle: float) -> None:
    """u′ᵢ = −k aᵢ² uᵢ by τ; the path ends along the direction of less friction."""
    speed, k = 1.1, 0.8
    start = thrown(speed, angle)
    expected = planar.thrown_on_ellipse(k, axes, tuple(start.values()))
    a, b = axes
    system = puck(axes=("a", "b"))
    motion = certified(system, 2 * expected[0], start, {"s": k, "k": k, "a": a, "b": b})
    np.testing.assert_allclose(stop(motion), expected, rtol=0, atol=2e-12)


@pytest.mark.parametrize("axes", [(0.6, 1.0), (1.0, 0.6)])
def test_an_ellipse_along_its_axes(axes: tuple[float, float]) -> None:
    """Along an axis it is friction along a line; what is held is s a and s b."""
    a, b = axes
    system = puck(axes=("a", "b"))
    for name, half in (("x", a), ("y", b)):
        values = {"a": a, "b": b, "k": 0.9}
        motion = certified(system, 4.0, {f"d_{name}": 1.0}, values)
        assert changes(motion)[0] == pytest.approx(1 / (0.9 * half), abs=5e-13)
        force = "f" if name == "x" else "g"
        held = certified(system, 4.0, {}, values | {force: half * (1 - 1e-9)})
        assert held.outcome is Outcome.AT_REST
        gone = certified(system, 4.0, {}, values | {force: half * (1 + 1e-9)})
        assert gone.final[name] == pytest.approx(8 * (half * (1 + 1e-9) - 0.9 * half), rel=1e-11)


# -- belts and turntables --------------------------------------------------------------------------


def test_a_parcel_handed_over_to_a_belt() -> None:
    """Straight with respect to the belt, a parabola with respect to the ground."""
    k, v, w = 0.5, (1.2, 0.1), (-0.2, 0.9)
    system = puck(surface_speed=("v", "w"))
    motion = certified(
        system, 6.0, {"d_x": v[0], "d_y": v[1]}, {"s": k, "k": k, "v": w[0], "w": w[1]}
    )
    u = (v[0] - w[0], v[1] - w[1])
    size = hypot(*u)
    end = size / k
    assert changes(motion)[0] == pytest.approx(end, abs=5e-13)
    t = np.array([0.3, 1.0, end, end + 1.0])
    slid = np.minimum(t, end)
    found = motion.at(t)
    for i, name in enumerate("xy"):
        way = w[i] * t + u[i] * slid - u[i] / size * k * slid**2 / 2
        np.testing.assert_allclose(found[name], way, rtol=0, atol=5e-13)
        rate = w[i] + u[i] - u[i] / size * k * slid
        np.testing.assert_allclose(found[f"d_{name}"], rate, rtol=0, atol=5e-13)


def turntable(turning: str) -> System:
    """A block of mass m on a disc that turns with the angular speed `turning`."""
    return System(
        "turntable",
        parameters=parameters(m=1.0, mu=0.3, g=9.81, W=1.0, A=0.1),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="m/2*(d_x**2 + d_y**2)",
        contacts={
            "disc": Contact(
                ("d_x", "d_y"), "mu*m*g", surface_speed=(f"-({turning})*y", f"({turning})*x")
            )
        },
    )


@pytest.mark.parametrize("angle", [0.0, 1.0, 4.0])
def test_a_block_on_a_turntable_stays_up_to_a_radius(angle: float) -> None:
    """m Ω² r = μ m g."""
    W, m = 1.7, 2.5
    edge = 0.3 * 9.81 / W**2
    for share, end in ((1 - 1e-9, 20.0), (1 + 1e-2, 2.0)):
        r = edge * share
        x, y = r * cos(angle), r * sin(angle)
        start = {"x": x, "y": y, "d_x": -W * y, "d_y": W * x}
        motion = certified(turntable("W"), end, start, {"W": W, "m": m})
        found = motion.at(np.linspace(0.0, end, 9))
        away = np.hypot(found["x"], found["y"]) - r
        if share < 1:
            assert not np.any(motion.knots.mode)
            np.testing.assert_allclose(away, 0.0, atol=1e-12)
        else:
            assert np.all(motion.knots.mode == 1)
            assert np.all(np.diff(away) > 0)


@pytest.mark.parametrize("start", [0.0, 3.0])
def test_a_turntable_that_spins_up(start: float) -> None:
    """|λ| = m r √(Ω⁴ + Ω′²): with Ω = A t it breaks away at A⁴t⁴ = (μg/r)² − A²."""
    A, r = 0.4, 0.8
    away = ((0.3 * 9.81 / r) ** 2 - A**2) ** 0.25 / A
    angle = A * start**2 / 2
    x, y = r * cos(angle), r * sin(angle)
    begin = {"x": x, "y": y, "d_x": -A * start * y, "d_y": A * start * x}
    motion = certified(turntable("A*t"), away + 1.0, begin, {"A": A}, start)
    assert changes(motion)[0] == pytest.approx(away, abs=1e-12)
    later = motion.at(away)
    assert hypot(later["x"], later["y"]) == pytest.approx(r, abs=1e-12)
    # where it begins to slip it lags and goes outward, against the force that held it
    u = motion.at(away + 0.01)
    t = away + 0.01
    slide = np.array([u["d_x"] + A * t * u["y"], u["d_y"] - A * t * u["x"]])
    place = np.array([u["x"], u["y"]])
    outward = slide @ place
    ahead = slide @ np.array([-place[1], place[0]])
    assert outward > 0 > ahead
    assert ahead / outward == pytest.approx(-1 / (A * away**2), rel=0.05)


# -- a force that turns ----------------------------------------------------------------------------


@pytest.mark.parametrize(("F", "k", "m", "W"), [(1.5, 1.0, 1.0, 1.0), (1.01, 1.0, 2.0, 0.6)])
def test_under_a_force_that_turns_the_slip_turns(F: float, k: float, m: float, W: float) -> None:
    """m V Ω = √(F² − k²): the only slip of constant speed."""
    system = System(
        "turning force",
        parameters=parameters(F=1.5, k=1.0, m=1.0, W=1.0),
        coordinates={"x": Inertial(force="F*cos(W*t)"), "y": Inertial(force="F*sin(W*t)")},
        kinetic="m/2*(d_x**2 + d_y**2)",
        contacts={"table": Contact(("d_x", "d_y"), "k")},
    )
    V = sqrt(F**2 - k**2) / (m * W)
    lag = -atan2(m * W * V, k)
    values = {"F": F, "k": k, "m": m, "W": W}
    motion = certified(system, 20.0, thrown(V, lag), values)
    t = np.linspace(0.0, 20.0, 41)
    found = motion.at(t)
    np.testing.assert_allclose(found["d_x"], V * np.cos(W * t + lag), rtol=0, atol=1e-11)
    np.testing.assert_allclose(found["d_y"], V * np.sin(W * t + lag), rtol=0, atol=1e-11)
    assert motion.n_switches == 0


# -- by integration in τ ---------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_ends_of_slips_against_an_integration_in_tau(seed: int) -> None:
    """A force that depends on time and place, and a threshold that does on time."""
    rng = np.random.default_rng(seed)
    F, W, phase, stiff = rng.uniform(0.1, 0.3), rng.uniform(0.5, 3), *rng.uniform(0.3, 1.0, 2)
    start = rng.normal(size=4) * [0.3, 0.3, 1.0, 1.0]
    system = System(
        "springs",
        parameters=parameters(F=0.2, W=1.0, p=0.0, K=1.0),
        coordinates={"x": Inertial(force="F*cos(W*t + p)"), "y": Inertial(force="F*sin(W*t)")},
        kinetic="(d_x**2 + d_y**2)/2",
        potential="K/2*x**2 + K/2*x*y + K*y**2",
        contacts={"table": Contact(("d_x", "d_y"), "1.2 + 0.3*sin(2*t)")},
    )

    def force(t: float, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        x, y = q
        return np.array(
            [
                F * np.cos(W * t + phase) - stiff * (x + y / 2),
                F * np.sin(W * t) - stiff * (x / 2 + 2 * y),
            ]
        )

    expected = planar.slip_in_tau(force, lambda t: 1.2 + 0.3 * np.sin(2 * t), start)
    values = {"F": F, "W": W, "p": phase, "K": stiff}
    names = ("x", "y", "d_x", "d_y")
    motion = certified(
        system, expected[0] + 0.05, dict(zip(names, map(float, start), strict=True)), values
    )
    end = changes(motion)[0]
    found = motion.at(end)
    np.testing.assert_allclose([end, found["x"], found["y"]], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("least", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_slip_that_almost_stops_goes_on(least: float) -> None:
    """Thrown against a force beyond friction, a puck turns back. With z = tan(φ/2) and p = k/f its
    speed is c (1 + z²) z^(p − 1)/2, least where cos φ = p; dt is c (1 + z²) z^(p − 2)/(2f) dz."""
    f, k = 2.0, 1.0
    p = k / f

    def speed(z: float) -> float:
        return (1 + z * z) * z ** (p - 1) / 2

    c = least / speed(sqrt((1 - p) / (1 + p)))
    first = (2 / c) ** (1 / (1 + p))  # of the speed 1, but for little
    last = 0.1

    def between(by: Callable[[float], float]) -> float:
        return by(first) - by(last)

    time = c / (2 * f) * between(lambda z: z ** (p - 1) / (p - 1) + z ** (p + 1) / (p + 1))
    x = (
        c**2
        / (4 * f)
        * between(lambda z: z ** (2 * p - 2) / (2 * p - 2) - z ** (2 * p + 2) / (2 * p + 2))
    )
    start = {"d_x": c * (1 - first**2) * first ** (p - 1) / 2, "d_y": c * first**p}
    motion = certified(puck(), time, start, {"f": f})
    assert changes(motion) == []
    velocity = c * (1 - last**2) * last ** (p - 1) / 2
    assert motion.final["x"] == pytest.approx(x, rel=1e-9)
    assert motion.final["d_x"] == pytest.approx(velocity, rel=1e-3, abs=1e-13)
    assert motion.final["d_y"] == pytest.approx(c * last**p, rel=1e-3)
