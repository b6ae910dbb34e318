"""Cycles, branches and equilibria of systems with contacts that open."""

from __future__ import annotations

from itertools import groupby

import numpy as np
import pytest
from numpy.testing import assert_allclose

import stickslip as ss
from stickslip.motion.outcome import Outcome
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.variational import variation

G = 9.81


def shaken_ball(e: float, omega: float, above: float) -> tuple[ss.Trajectory, float]:
    """A ball that bounces once a period on a plate, from the middle of a flight to that of another;
    and the sine of the phase of its impacts.

    It leaves with gT/2, so that the plate has the velocity c = gT/2 (1 − e)/(1 + e) at each impact.
    """
    period = 2 * np.pi / omega
    c = G * period / 2 * (1 - e) / (1 + e)
    A = above * c / omega
    phase = np.arccos(c / (A * omega))
    ball = ss.catalogue.bouncing_ball(e=e, A=A, omega=omega)
    initial = {"y": A * np.sin(phase), "d_y": G * period / 2}
    start = phase / omega
    return ss.simulate(ball, (start, start + 2.5 * period), initial=initial), float(np.sin(phase))


@pytest.mark.parametrize("above", [1.002, 1.01, 1.03])
@pytest.mark.parametrize("e", [0.3, 0.8])
def test_multipliers_of_a_ball_on_a_shaken_plate(e: float, above: float) -> None:
    """Impacts at t and with the speed v that follows: with s = Aω² sin φ the derivative of the map
    (t, v) has the determinant e² and the trace 1 + e² − (1 + e)² s/g."""
    omega = 20.0
    motion, sine = shaken_ball(e, omega, above)
    cycle = ss.find_cycle(motion.system, motion)
    assert cycle.certificate.ok, cycle.certificate
    assert cycle.period == pytest.approx(2 * np.pi / omega, rel=1e-12)
    s = float(motion.parameters["A"]) * omega**2 * sine
    trace = 1 + e**2 - (1 + e) ** 2 * s / G
    found = cycle.multipliers
    assert_allclose(np.prod(found).real, e**2, rtol=1e-9)
    assert_allclose(np.sum(found).real, trace, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("span", [(0.001, 0.08), (0.02, 0.05)])
def test_a_ball_on_a_shaken_plate_doubles_its_period(span: tuple[float, float]) -> None:
    """The cycle is born at Aω = c, and loses its stability at s = 2g(1 + e²)/(1 + e)². On the other
    side of the fold are cycles of the same period and height at another phase: the branch is not
    closed there."""
    e, omega = 0.5, 20.0
    motion, _ = shaken_ball(e, omega, 1.05)
    ball = motion.system
    branch = ss.continue_cycle(ss.find_cycle(ball, motion), "A", span)
    c = G * np.pi / omega * (1 - e) / (1 + e)
    doubling = np.hypot(c / omega, 2 * G * (1 + e**2) / (1 + e) ** 2 / omega**2)
    places = {p.kind: p.value for p in branch.special}
    assert branch.points["A"].values[-1] == pytest.approx(span[1])
    assert places["fold"] == pytest.approx(c / omega, rel=1e-9)
    assert places["period doubling"] == pytest.approx(doubling, rel=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_first_variation_through_impacts(seed: int) -> None:
    """Saltation matrices against differences of motions that are really followed."""
    from motion.test_impacts import random_system

    system, _, _, (q, v) = random_system(seed)
    names = system.declaration.state
    first = np.array([*q, *v])

    def end(change: np.ndarray) -> tuple[np.ndarray, list[str]]:
        initial = dict(zip(names, map(float, first + change), strict=True))
        motion = ss.simulate(system, (0.0, 0.9), initial=initial, rtol=1e-12, atol=1e-14)
        assert motion.outcome.ok
        # How many bounces there are before they end is a matter of resolution.
        return motion.knots.state[-1], [name for name, _ in groupby(motion.impacts["contact"])]

    motion = ss.simulate(system, (0.0, 0.9), rtol=1e-12, atol=1e-14)
    found = variation(motion, Pieces(motion.problem.compiled.equations))
    assert found.differentiable
    rng = np.random.default_rng(seed)
    size = float(np.max(np.abs(found.matrix)))
    compared = 0
    for _ in range(3):
        direction = rng.normal(size=6)
        h = 1e-5
        ends = [end(k * h * direction) for k in (1, -1, 2, -2)]
        if any(struck != ends[0][1] for _, struck in ends):
            continue  # another impact comes in: no difference tells
        a, b, c, d = (y for y, _ in ends)
        slope = (8 * (a - b) - (c - d)) / (12 * h)
        assert_allclose(found.matrix @ direction, slope, atol=1e-6 * max(size, 1.0))
        compared += 1
    assert compared > 0


def test_the_woodpecker() -> None:
    """The printed parameters of Leine, Glocker and van Campen: 0.1460 s where a time stepping of
    order one is converged, φ_S down to −0.53."""
    bird = ss.catalogue.woodpecker()
    cycle = ss.find_cycle(bird, ss.simulate(bird, (0.0, 2.0)))
    assert cycle.certificate.ok, cycle.certificate
    assert cycle.stable
    assert cycle.period == pytest.approx(0.145976, abs=1e-6)
    assert cycle.extrema["phi_S"][0] == pytest.approx(-0.5295, abs=1e-4)
    # It is pulled down only.
    assert cycle.drift < 0.0
    lost = sum(c.dissipated + c.impact_loss for c in cycle.contacts.values())
    assert lost == pytest.approx(-(0.0003 + 0.0045) * G * cycle.drift, rel=1e-9)


def test_maps_of_the_woodpecker() -> None:
    """Its modes repeat within a cycle (between bounces all contacts are open); a map tells when it
    begins again, and finds the cycle that the search for one finds."""
    bird = ss.catalogue.woodpecker()
    found = ss.sweep(bird, over={"e_1": [0.4, 0.5]}, measure=["period", "speed"])
    assert np.all(found["outcome"] == Outcome.PERIODIC.code)
    assert np.all(found["certificate"] < 1e-8)
    cycle = ss.find_cycle(bird, ss.simulate(bird, (0.0, 2.0)))
    assert float(found["period"][1]) == pytest.approx(cycle.period, rel=1e-9)
    assert float(found["speed"][1]) == pytest.approx(cycle.drift / cycle.period, rel=1e-8)


@pytest.mark.parametrize(("mu", "hangs"), [(0.28, False), (0.3, True), (0.6, True)])
def test_the_woodpecker_hangs(mu: float, hangs: bool) -> None:
    """At rest it jams at φ_S = −0.2216 (printed), for μ ≥ 0.285 only."""
    found = ss.equilibria(ss.catalogue.woodpecker(), parameters={"mu": mu})
    assert len(found) == int(hangs)
    if hangs:
        (jam,) = found
        assert jam.modes == {"beak": "open", "lower edge": "stick", "upper edge": "open"}
        assert jam.state["phi_S"] == pytest.approx(-0.2216, abs=1e-4)
        assert jam.certificate.ok
        weight = (0.0003 + 0.0045) * G
        pressed = jam.normal_forces["normal_lower_edge"]
        assert mu * pressed >= weight


def test_a_block_in_a_corner() -> None:
    """Pressed into it, a block rests in a set: its friction takes up to μN of its weight."""
    block = ss.System(
        name="corner",
        parameters={"F": ss.Parameter(3.0), "mu": ss.Parameter(0.4)},
        coordinates={"x": ss.Inertial(force="-F"), "y": ss.Inertial(force="-1 - y")},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts={"wall": ss.Unilateral("x", "d_y", "mu")},
        initial={"x": 1.0},
    )
    (rest,) = ss.equilibria(block).sets
    assert rest.dimension == 1
    assert rest.extent["y"] == pytest.approx((-1 - 1.2, -1 + 1.2), rel=1e-9)
    assert rest.extent["x"] == pytest.approx((0.0, 0.0), abs=1e-12)
    assert rest.normal_forces["normal_wall"] == pytest.approx(3.0)


def test_rest_on_a_plate() -> None:
    """Without friction what rests on a plate is isolated, and nothing is left that could move."""
    ball = ss.System(
        name="ball",
        coordinates={"y": ss.Inertial()},
        kinetic="d_y**2/2",
        potential="2*y",
        contacts={"plate": ss.Unilateral("y")},
        initial={"y": 1.0},
    )
    (rest,) = ss.equilibria(ball)
    assert rest.modes == {"plate": "closed"}
    assert rest.normal_forces == {"normal_plate": pytest.approx(2.0)}
    assert rest.eigenvalues == ()
    assert rest.stable


def test_the_rimless_wheel() -> None:
    """McGeer: after the exchange cot 2α √(4 sin α sin γ) at the fixed point (g = l = 1), with the
    multiplier cos² 2α."""
    alpha, gamma = 0.3, 0.08
    wheel = ss.catalogue.rimless_wheel(alpha=alpha, gamma=gamma, g=1.0, l=1.0)
    cycle = ss.find_cycle(wheel, {"theta": gamma - alpha + 0.1, "d_theta": 0.4})
    assert cycle.certificate.ok, cycle.certificate
    after = np.sqrt(4 * np.sin(alpha) * np.sin(gamma)) / np.tan(2 * alpha)
    motion = cycle.trajectory
    (knot,) = motion.state_jumps
    assert motion.knots.state[knot, 1] == pytest.approx(after, rel=1e-10)
    assert_allclose(
        np.sort(np.real(cycle.multipliers)), [np.cos(2 * alpha) ** 2, 1.0], rtol=1e-9, atol=1e-9
    )


LONG = {"theta": 0.200310900, "d_theta": -0.199832473}


def walker_start(theta: float, d_theta: float) -> dict[str, float]:
    """Right after a heel strike."""
    swing = {"phi": 2 * theta, "d_phi": (1 - np.cos(2 * theta)) * d_theta}
    return {"theta": theta, "d_theta": d_theta, **swing}


@pytest.mark.parametrize("end", [40.0, 100.0, 200.0])
def test_a_walker_that_has_settled(end: float) -> None:
    """Wherever in its step the motion ends."""
    walker = ss.catalogue.simplest_walker()
    cycle = ss.find_cycle(walker, ss.simulate(walker, (0.0, end)))
    assert cycle.period == pytest.approx(3.88246, abs=1e-5)


def test_a_motion_that_ends_at_an_impact() -> None:
    """Three periods after an impact comes the next one, up to rounding."""
    motion, _ = shaken_ball(0.5, 20.0, 1.2)
    start = float(motion.knots.time[0])
    first = {x: float(motion[x].values[0]) for x in ("y", "d_y")}
    period = np.pi / 10
    whole = ss.simulate(
        motion.system, (start, start + 3 * period), initial=first, parameters=motion.parameters
    )
    cycle = ss.find_cycle(motion.system, whole)
    assert cycle.certificate.ok
    assert cycle.period == pytest.approx(period, rel=1e-12)


def test_the_simplest_walker() -> None:
    """Garcia, Chatterjee, Ruina and Coleman, slope 0.009: the long gait takes 3.88246 and has the
    multipliers −0.190 ± 0.558i."""
    walker = ss.catalogue.simplest_walker(gamma=0.009)
    motion = ss.simulate(walker, (0.0, 40 * 3.88246 + 1.0), initial=walker_start(**LONG))
    cycle = ss.find_cycle(walker, motion)
    assert cycle.certificate.ok, cycle.certificate
    assert cycle.period == pytest.approx(3.88246, abs=1e-5)
    others = sorted(cycle.nontrivial, key=lambda z: (abs(z), z.imag))
    assert_allclose(others[-2:], [-0.190 - 0.558j, -0.190 + 0.558j], atol=6e-4)
    assert abs(others[0]) < 1e-9


def test_the_ramp_walker_is_the_toy_at_small_angles() -> None:
    """As long as both feet are on the ground it is (4.1) but for sin ψ − ψ: what is left falls with
    the cube of the angle."""
    errors = []
    for small in (0.04, 0.02):
        walker = ss.catalogue.ramp_walker(d=0.0, delta=6e-4)
        p = dict(walker.values)
        gravity = p["g"] * np.cos(p["gamma"])
        star = p["m_b"] * gravity / (2 * p["k"] * p["l"])
        # A pull that the evenly loaded feet just hold.
        pull = (p["m_b"] / 2 + p["m_l"]) * p["g"] * np.sin(p["gamma"])
        mu = pull / ((p["m_b"] / 2 + p["m_l"]) * gravity) * (1 + 0.3 * small / star)
        toy = ss.catalogue.rocking_toy_inertial(
            I_b=p["I_b"], m_W=2 * pull / p["g"], m_b=p["m_b"] / 4 - 2 * pull / p["g"],
            m_l=p["m_l"], g=p["g"], delta=p["delta"], nu=0.0,
            a=p["a"], b=2 * p["k"] * p["l"] ** 2 - p["m_b"] * gravity * p["h"], c=p["c"],
            rho=mu * p["m_l"] * gravity, psi_star=star, H_star=mu * p["m_b"] * gravity,
        )  # fmt: skip
        span = (0.0, 1.5)
        start = {"psi": small, "x_R": 0.0}
        ends = [
            ss.simulate(s, span, initial=start, parameters=values).final
            for s, values in ((walker, {"mu": mu}), (toy, {}))
        ]
        assert abs(ends[0]["x_R"]) + abs(ends[0]["x_L"]) > 0.0  # it has slipped
        errors.append(max(abs(ends[0][x] - ends[1][x]) for x in ("psi", "x_R", "x_L")) / small)
    assert errors[1] < 0.35 * errors[0]
    assert errors[0] < 2e-3


@pytest.mark.parametrize("end", [30.0, 50.0, 60.0])
def test_the_ramp_walker_walks(end: float) -> None:
    """Down the ramp, both feet alike, each lifted once a period."""
    walker = ss.catalogue.ramp_walker()
    cycle = ss.find_cycle(walker, ss.simulate(walker, (0.0, end)))
    assert cycle.certificate.ok, cycle.certificate
    assert cycle.stable
    assert cycle.speed > 0.03
    right, left = cycle.contacts["right foot"], cycle.contacts["left foot"]
    assert right.open_time == pytest.approx(left.open_time, rel=1e-6)
    assert right.open_time > 0.0
