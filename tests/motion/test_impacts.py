"""Contacts that open: normal forces, impacts, accumulation, and what has no solution."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import stickslip as ss
from oracles import moreau_jean
from stickslip.errors import DeclarationError
from stickslip.motion.outcome import Outcome

G = 9.81


def block(mu: float = 0.3, e: float = 0.0, **initial: float) -> ss.System:
    """A point on a floor that is rough."""
    return ss.System(
        name="block",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential=f"{G}*y",
        contacts={"floor": ss.Unilateral("y", "d_x", mu, restitution=e)},
        initial=initial,
        span=(0.0, 3.0),
    )


@pytest.mark.parametrize("e", [0.0, 0.3, 0.5, 0.8, 0.9])
def test_a_ball_comes_to_rest(e: float) -> None:
    """Infinitely many impacts, at t₁(1 + 2e(1 − eⁿ)/(1 − e)), end at √(2h/g) (1 + e)/(1 − e)."""
    ball = ss.catalogue.bouncing_ball(e=e)
    first = np.sqrt(2 / G)
    rest = first * (1 + e) / (1 - e)
    found = ss.simulate(ball, (0.0, 1.5 * rest))
    assert found.certificate.ok, found.certificate
    t = found.impacts["time"].to_numpy()
    n = np.arange(len(t))
    assert_allclose(t, first * (1 + 2 * e * (1 - e**n) / (1 - e)), rtol=1e-11)
    events: Any = found.events
    assert list(events["to"])[-1] == "closed"
    assert list(events["time"])[-1] == pytest.approx(rest, rel=1e-11)
    assert float(np.sum(found.impacts["energy"])) == pytest.approx(G, rel=1e-9)
    at = found.at([1.2 * rest])
    assert_allclose([at["y"][0], at["gap_plate"][0]], 0.0, atol=1e-15)
    assert at["normal_plate"][0] == pytest.approx(G)
    assert found.dataset["dissipated_energy"].values[-1] == pytest.approx(G, rel=1e-9)


def test_bounces_that_last() -> None:
    """Without loss a ball bounces for ever, and the times are those of the first bounce."""
    found = ss.simulate(ss.catalogue.bouncing_ball(e=1.0), (0.0, 50.0))
    assert found.certificate.ok
    t = found.impacts["time"].to_numpy()
    assert_allclose(t, np.sqrt(2 / G) * (1 + 2 * np.arange(len(t))), rtol=1e-11)


def test_a_ball_on_a_shaken_plate() -> None:
    """One impact a period T: the ball leaves with gT/2, so that the plate has the velocity gT/2
    (1 − e)/(1 + e) at each impact. Of the two such phases the one before the top is stable."""
    e, omega = 0.8, 20.0
    period = 2 * np.pi / omega
    speed = G * period / 2 * (1 - e) / (1 + e)
    A = 1.05 * speed / omega
    phase = np.arccos(speed / (A * omega))
    start = phase / omega
    ball = ss.catalogue.bouncing_ball(e=e, A=A, omega=omega)
    initial = {"y": A * np.sin(phase), "d_y": G * period / 2}
    found = ss.simulate(ball, (start, start + 30.5 * period), initial=initial)
    assert found.certificate.ok
    t = found.impacts["time"].to_numpy()
    assert_allclose(t, start + period * np.arange(1, 31), atol=1e-9)
    # a little off, it comes back
    initial["d_y"] *= 1.001
    near = ss.simulate(ball, (start, start + 400.5 * period), initial=initial)
    late = near.impacts["time"].to_numpy()[-5:]
    assert_allclose(np.mod(late - start + period / 2, period), period / 2, atol=1e-9)


def test_a_block_slides_to_rest() -> None:
    """N = m g: x = v²/(2μg) after v/(μg)."""
    found = ss.simulate(block(d_x=3.0))
    assert found.certificate.ok
    (stop,) = found.events["time"]
    assert stop == pytest.approx(3.0 / (0.3 * G), rel=1e-12)
    assert found.final["x"] == pytest.approx(9.0 / (0.6 * G), rel=1e-12)
    assert found.at([0.5])["normal_floor"][0] == pytest.approx(G)


@pytest.mark.parametrize(("speed", "after"), [(3.0, None), (0.5, 0.0)])
def test_friction_in_an_impact(speed: float, after: float | None) -> None:
    """It slips with Λ_T = μΛ_N, or sticks if that suffices."""
    found = ss.simulate(block(e=0.4, y=0.5, d_x=speed), (0.0, 0.5))
    assert found.certificate.ok
    fall = np.sqrt(2 * G * 0.5)
    at = found.at([np.sqrt(1.0 / G) + 1e-9])
    expected = speed - 0.3 * 1.4 * fall if after is None else after
    assert at["d_x"][0] == pytest.approx(expected, abs=1e-9)
    assert at["d_y"][0] == pytest.approx(0.4 * fall, abs=1e-7)


def test_jumps_off() -> None:
    """A plate that falls faster than g lets go, where its acceleration is −g."""
    system = ss.System(
        name="plate",
        coordinates={"y": ss.Inertial()},
        kinetic="d_y**2/2",
        potential=f"{G}*y",
        contacts={"plate": ss.Unilateral("y - 0.05*sin(20*t)")},
        initial={"d_y": 1.0},
        span=(0.0, 0.2),
    )
    found = ss.simulate(system)
    assert found.certificate.ok
    changes: Any = found.events
    assert list(changes["to"])[:1] == ["open"]
    leaves = np.arcsin(G / (0.05 * 400)) / 20
    assert float(changes["time"].iloc[0]) == pytest.approx(leaves, rel=1e-10)


def test_a_bead_on_a_hoop() -> None:
    """In plane coordinates the normal force of a smooth bowl is 3 m g cos θ when it is released at
    the height of the centre."""
    bowl = ss.System(
        name="bowl",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential=f"{G}*y",
        contacts={"bowl": ss.Unilateral("1 - sqrt(x**2 + y**2)")},
        initial={"x": 1.0, "y": 0.0, "d_y": -1e-3},
        span=(0.0, 5.0),
    )
    found = ss.simulate(bowl)
    assert found.certificate.ok
    at = found.at(np.linspace(0.3, 0.9, 11))
    expected = 3 * G * -at["y"] + 1e-6
    assert_allclose(at["normal_bowl"], expected, rtol=1e-9)


def rod(mu: float, angle: float, **initial: float) -> ss.System:
    """Painlevé's rod: its lower end slides to the left on a rough floor."""
    return ss.System(
        name="rod",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial(), "phi": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2 + d_phi**2/6",
        potential=f"{G}*y",
        contacts={"tip": ss.Unilateral("y - sin(phi)", "d_x + sin(phi)*d_phi", mu)},
        initial={"phi": angle, "y": float(np.sin(angle)), "d_x": -2.0, **initial},
        span=(0.0, 0.05),
    )


@pytest.mark.parametrize("angle", [0.9, float(np.arctan(2.0)), 1.25])
def test_painleve(angle: float) -> None:
    """No acceleration is admissible above μ = (1 + 3 cos² φ)/(3 sin φ cos φ), whose least value is
    4/3 at tan φ = 2."""
    limit = (1 + 3 * np.cos(angle) ** 2) / (3 * np.sin(angle) * np.cos(angle))
    assert limit >= 4 / 3 - 1e-12
    below, above = (ss.simulate(rod(limit * f, angle)) for f in (1 - 1e-6, 1 + 1e-6))
    assert above.outcome is Outcome.NO_ACCELERATION and not above.certificate.ok
    assert below.outcome is not Outcome.NO_ACCELERATION or below.knots.time[-1] > 0.0


def test_the_woodpecker_pecks() -> None:
    """Leine, Glocker and van Campen print a period of 0.1452 s and a least angle of −0.53; these
    parameters give 0.14598 s (a time stepping of order one 0.1460)."""
    found = ss.simulate(ss.catalogue.woodpecker(), (0.0, 8.0))
    assert found.certificate.ok, found.certificate
    impacts: Any = found.impacts
    pecks = impacts[impacts["contact"] == "beak"]["time"].to_numpy()
    assert_allclose(np.diff(pecks)[-20:], 0.145976, atol=2e-6)
    angle = found.at(np.linspace(7.0, 8.0, 20001))["phi_S"]
    assert np.min(angle) == pytest.approx(-0.53, abs=2e-3)


@pytest.mark.parametrize(("mu", "holds"), [(0.2853, True), (0.2851, False)])
def test_the_woodpecker_hangs(mu: float, holds: bool) -> None:
    """It hangs at rest at φ_S = −0.2216 if μ ≥ 0.285 (published); here 0.28519."""
    w = ss.catalogue.woodpecker(mu=mu)
    p = w.values
    sleeve = -(p["r_M"] - p["r_0"]) / p["h_M"]
    bird = sleeve - p["m_S"] * p["g"] * p["l_G"] / p["c_phi"]
    assert bird == pytest.approx(-0.2216, abs=2e-4)
    rest = {"phi_M": sleeve, "phi_S": bird, "d_y": 0.0, "d_phi_S": 0.0}
    found = ss.simulate(w, (0.0, 0.1), initial=rest)
    assert found.certificate.ok
    assert (abs(found.final["y"]) < 1e-15) is holds


def test_the_spool_between_stops() -> None:
    """One period of the pressure repeats the last one: impacts at both stops, rest at the left
    one."""
    found = ss.simulate(ss.catalogue.limit_stops(), (0.0, 0.04))
    assert found.certificate.ok
    impacts: Any = found.impacts
    late = impacts[impacts["time"] > 0.02]
    assert set(late["contact"]) == {"left_stop", "right_stop"}
    t = late["time"].to_numpy()
    per = int(np.sum(t < t[0] + 0.004 - 1e-9))
    assert_allclose(t[per:] - t[:-per], 0.004, rtol=1e-9)
    at = found.at(np.linspace(0.0, 0.04, 4001))
    assert np.min(at["gap_left_stop"]) >= -1e-15 and np.min(at["gap_right_stop"]) >= -1e-15


def random_system(seed: int) -> tuple[ss.System, tuple[Any, ...], moreau_jean.Contacts, Any]:
    """Two masses on springs over one or two rough planes, shaken."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    M = root @ root.T / 3 + np.eye(3)
    root = rng.normal(size=(3, 3))
    K = root @ root.T
    C = 0.2 * np.eye(3)
    push = np.array([rng.normal(size=3) - 2.0, rng.normal(size=3), rng.uniform(1, 4, 3)])
    count = int(rng.integers(1, 3))
    normal = np.eye(3)[:count] + 0.3 * rng.normal(size=(count, 3))
    tangent = np.roll(np.eye(3), 1, axis=1)[:count] + 0.2 * rng.normal(size=(count, 3))
    start = rng.uniform(0.5, 1.0, 3)
    offset = rng.uniform(0.3, 0.6, count) - normal @ start
    mu, e = rng.uniform(0.0, 0.5, count), rng.uniform(0.0, 0.7, count)
    v = 0.3 * rng.normal(size=3)
    q, d = ("a", "b", "c"), ("d_a", "d_b", "d_c")

    def form(matrix: Any, names: tuple[str, ...]) -> str:
        return " + ".join(
            f"{float(matrix[i, j])!r}/2*{names[i]}*{names[j]}" for i in range(3) for j in range(3)
        )

    def sum_of(row: Any, names: tuple[str, ...]) -> str:
        return " + ".join(f"({float(x)!r})*{name}" for x, name in zip(row, names, strict=True))

    system = ss.System(
        name=f"random {seed}",
        coordinates={
            name: ss.Inertial(force="{!r} + ({!r})*sin({!r}*t)".format(*map(float, push[:, i])))
            for i, name in enumerate(q)
        },
        kinetic=form(M, d),
        potential=form(K, q),
        viscous=form(C, d),
        contacts={
            f"plane {i}": ss.Unilateral(
                f"{sum_of(normal[i], q)} + ({float(offset[i])!r})",
                sum_of(tangent[i], d),
                float(mu[i]),
                restitution=float(e[i]),
            )
            for i in range(count)
        },
        initial={
            **{name: float(x) for name, x in zip(q, start, strict=True)},
            **{name: float(x) for name, x in zip(d, v, strict=True)},
        },
        span=(0.0, 3.0),
    )
    contacts = moreau_jean.Contacts(normal, tangent, offset, mu, e)
    return system, (M, C, K, push), contacts, (start, v)


# In the motion of seed 145 two contacts throw a body to and fro until both are closed.
@pytest.mark.parametrize("seed", [*range(30), 145])
def test_time_stepping_comes_to_it(seed: int) -> None:
    """Steps of order one, no events: what they come to is this motion."""
    system, (M, C, K, push), contacts, start = random_system(seed)
    found = ss.simulate(system)
    assert found.outcome.ok and found.certificate.ok, (found.outcome, found.certificate)
    assert len(found.impacts) > 0 or seed > 0
    exact = np.array([found.final[x] for x in ("a", "b", "c")])
    errors = []
    for steps in (20_000, 80_000):
        q, _ = moreau_jean.final_state(M, C, K, push, contacts, start, 3.0, steps)
        errors.append(float(np.max(np.abs(q - exact))))
    # Its error has no sign and no smooth expansion: whether an impact is seen in one step or in the
    # next changes it by a part of a step.
    assert errors[0] < 2e-3 and errors[1] < 5e-4, errors


ROD = ss.System(
    name="rod",
    coordinates={"x": ss.Inertial(), "y": ss.Inertial(), "theta": ss.Inertial()},
    kinetic="(d_x**2 + d_y**2)/2 + d_theta**2/6",
    parameters={"mu": ss.Parameter(0.3), "e": ss.Parameter(0.5)},
    contacts={
        "tip": ss.Unilateral("y - sin(theta)", "d_x + sin(theta)*d_theta", "mu", restitution="e")
    },
    initial={"y": 1.0, "theta": np.pi / 2},
    span=(0.0, 0.01),
)


@settings(max_examples=100, deadline=None)
@given(
    theta=st.floats(0.1, 3.0),
    slide=st.floats(-2.0, 2.0),
    mu=st.floats(0.0, 1.3),
    e=st.floats(0.0, 1.0),
)
@example(theta=0.8, slide=0.2, mu=1.2, e=1.0)  # gains energy
def test_energy_that_would_be_created(theta: float, slide: float, mu: float, e: float) -> None:
    """A rod whose tip hits a rough floor with the speed 1: of all modes of the impact the one that
    loses most energy is taken, and one that would gain some is refused by name."""
    sin, cos = np.sin(theta), np.cos(theta)
    G = np.array([[1 + 3 * cos**2, -3 * sin * cos], [-3 * sin * cos, 1 + 3 * sin**2]])
    before = np.array([-1.0, slide])
    found = []
    for mode in (0, 1, -1):
        law = np.array([mode * mu, 1.0])  # Λ_T + σμΛ_N = 0 in slip
        system = np.array([G[0], G[1] if mode == 0 else law])
        impulse = np.linalg.solve(system, [1.0 + e, -slide if mode == 0 else 0.0])
        after = before + G @ impulse
        held = abs(impulse[1]) <= mu * impulse[0] if mode == 0 else mode * after[1] >= 0.0
        if impulse[0] >= 0.0 and held:
            found.append((0.5 * float(impulse @ (before + after)), after))
    assume(found)
    gain, after = min(found, key=lambda pair: pair[0])
    assume(abs(gain) > 1e-8)
    initial = {"y": float(sin), "theta": theta, "d_x": slide, "d_y": -1.0}
    motion = ss.simulate(ROD, initial=initial, parameters={"mu": mu, "e": e})
    assert (motion.outcome is Outcome.CREATES_ENERGY) == (gain > 0.0)
    if gain > 0.0:
        assert not motion.certificate.ok and len(motion.impacts) == 0
    else:
        start = motion.knots.state[1]
        turned = sin * start[5]
        assert_allclose([start[4] - cos * start[5], start[3] + turned], after, atol=1e-9)


def test_energy_that_several_contacts_would_create() -> None:
    """The woodpecker's beak hits the pole while the sleeve jams: of the modes that were tried, one
    whose equations are almost singular must not hide what is gained."""
    bird = ss.catalogue.woodpecker(mu=0.26857142857142857, e_1=0.7828571428571429)
    motion = ss.simulate(bird, (0.0, 2.0))
    assert motion.outcome is Outcome.CREATES_ENERGY
    assert np.all(motion.impacts["energy"] > 0.0)


def test_time_and_place_do_not_matter() -> None:
    """The same motion later, and elsewhere."""
    here = ss.simulate(block(e=0.5, y=0.5, d_x=2.0))
    later = ss.simulate(block(e=0.5, y=0.5, d_x=2.0), (1e3, 1003.0))
    raised = replace(
        block(e=0.5, y=10.5, d_x=2.0),
        contacts={"floor": ss.Unilateral("y - 10", "d_x", 0.3, restitution=0.5)},
    )
    above = ss.simulate(raised)
    for other in (later, above):
        assert other.certificate.ok
        assert other.final["x"] == pytest.approx(here.final["x"], rel=1e-9)


def test_an_impact_at_the_start() -> None:
    """What starts on the floor and downwards has an impact at once."""
    found = ss.simulate(block(e=0.5, d_y=-2.0), (0.0, 0.1))
    assert found.certificate.ok
    assert list(found.impacts["time"]) == [0.0]
    assert_allclose(found.knots.state[:2, 3], [-2.0, 1.0])
    assert found.at([0.0])["d_y"][0] == pytest.approx(1.0)


def test_no_impact_at_the_start() -> None:
    """What approaches from afar has none."""
    found = ss.simulate(block(e=0.5, y=0.5, d_y=-2.0), (0.0, 0.1))
    assert found.certificate.ok and len(found.impacts) == 0
    assert found.final["d_y"] == pytest.approx(-2.0 - 0.1 * G)


def test_a_false_rebound_is_seen() -> None:
    """The certificate follows the law of impacts."""
    found = ss.simulate(ss.catalogue.bouncing_ball(), (0.0, 1.0))
    assert found.certificate.ok
    state = found.knots.state.copy()
    state[1:, 1] *= 1.01
    knots = replace(found.knots, state=state)
    false = ss.Trajectory(found.problem, found.t_span, knots, found.outcome)
    assert not false.certificate.ok


def test_stored(tmp_path: Path) -> None:
    """Contacts that open stand in files."""
    found = ss.simulate(ss.catalogue.woodpecker(), (0.0, 0.2))
    found.save(tmp_path / "w.nc")
    again = ss.open(tmp_path / "w.nc")
    assert again.certificate.ok
    assert again.system == found.system
    assert 'gap = "' in found.system.to_toml()


@pytest.mark.parametrize(
    ("contact", "initial", "reason"),
    [
        (ss.Unilateral("y"), {"y": -0.1}, "overlap"),
        (ss.Unilateral("y", restitution=1.2), {}, "outside the admissible range"),
        (ss.Unilateral("y", "d_x", -0.1), {}, "coefficient of friction"),
        (ss.Unilateral("1 - t"), {}, "does not depend on an inertial coordinate"),
        (ss.Unilateral("y", mu=0.3), {}, "the direction of friction is missing"),
        (ss.Contact("d_x", "0.1 + 0.2*normal_floor"), {}, "unknown name 'normal_floor'"),
    ],
)
def test_refused(contact: Any, initial: dict[str, float], reason: str) -> None:
    """What is wrong is named."""
    with pytest.raises(DeclarationError, match=reason):
        replace(block(), contacts={"other": contact}, initial=initial)


def test_a_brake_is_linear() -> None:
    """A threshold may use the normal force of another contact, if it is linear in it; each way by
    its own coefficient."""
    pads = {
        "floor": ss.Unilateral("y"),
        "brake": ss.Contact("d_x", "0.3*normal_floor"),
    }
    braked = replace(block(), contacts=pads, initial={"d_x": 3.0})
    assert ss.simulate(braked).final["x"] == pytest.approx(9.0 / (0.6 * G), rel=1e-12)
    uneven = ss.Contact("d_x", ("0.3*normal_floor", "0.2*normal_floor"))
    for speed, mu in ((3.0, 0.3), (-3.0, 0.2)):
        braked = replace(block(), contacts={**pads, "brake": uneven}, initial={"d_x": speed})
        found = ss.simulate(braked)
        assert found.certificate.ok, found.certificate
        assert found.final["x"] == pytest.approx(3.0 * speed / (2 * mu * G), rel=1e-12)
    with pytest.raises(DeclarationError, match="not linear"):
        replace(block(), contacts={**pads, "brake": ss.Contact("d_x", "normal_floor**2")})
    for other in (
        ss.Contact("d_x", 1.0, kinetic="0.2*normal_floor"),
        ss.Contact("d_x", "0.1*normal_floor", kinetic="0.2*normal_floor"),
        ss.Contact("d_x", "1 - 0.1*normal_floor"),
    ):
        with pytest.raises(DeclarationError, match="coefficients of normal_floor"):
            replace(block(), contacts={**pads, "brake": other})


def test_several_forces_press() -> None:
    """A threshold of several normal forces, and others, is their sum: Σ μⱼNⱼ + s."""
    pressed = ss.System(
        name="pressed",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial(), "z": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2 + d_z**2)/2",
        potential="3*x + 2*y - pull*z",
        parameters={"pull": ss.Parameter(0.0)},
        contacts={
            "floor": ss.Unilateral("y"),
            "wall": ss.Unilateral("x"),
            "rub": ss.Contact("d_z", "0.1*normal_floor + 0.2*(normal_wall + 1) + 0.05"),
        },
        initial={"d_z": 2.0},
    )
    friction = 0.1 * 2 + 0.2 * 4 + 0.05
    stopped = ss.simulate(pressed, (0.0, 3.0))
    assert stopped.certificate.ok, stopped.certificate
    assert stopped.final["z"] == pytest.approx(2.0 / friction, rel=1e-12)
    # It holds as much as all of them do, and no more.
    for pull, holds in ((0.999 * friction, True), (1.001 * friction, False)):
        found = ss.simulate(pressed, (0.0, 3.0), initial={"d_z": 0.0}, parameters={"pull": pull})
        assert found.certificate.ok
        moved = 0.0 if holds else 0.5 * (pull - friction) * 9.0
        assert found.final["z"] == pytest.approx(moved, rel=1e-9, abs=1e-15)
    assert list(pressed.frictional) == ["rub"]


def test_a_constraint_that_does_not_hold() -> None:
    """It has to hold at the start, and be a function of coordinates."""
    for constraint, reason in (
        ("y - 1", r"constraint: it is -1 at the initial state, but must be zero"),
        ("y + nothing", "constraint: unknown name 'nothing'"),
        ("d_y", "constraint: 'd_y' is not allowed here"),
        (0.0, "constraint: it does not depend on an inertial coordinate"),
    ):
        with pytest.raises(DeclarationError, match=reason):
            replace(block(), contacts={"slot": ss.Bilateral(constraint)})


_WIRE = "sqrt(x**2 + y**2) - 1"
_ALONG = "x*d_y - y*d_x"
HELD = {
    "facing": lambda mu: {
        "outside": ss.Unilateral(f"-({_WIRE})", _ALONG, mu),
        "inside": ss.Unilateral(_WIRE, _ALONG, mu),
    },
    "constraint": lambda mu: {"wire": ss.Bilateral(_WIRE, _ALONG, mu)},
    "brake": lambda mu: {
        "wire": ss.Bilateral(_WIRE),
        "brake": ss.Contact(_ALONG, f"{mu}*normal_wire"),
    },
}


@pytest.mark.parametrize("held", HELD)
@pytest.mark.parametrize("mu", [0.0, 0.2])
@pytest.mark.parametrize("speed", [0.0, 1.0, 5.0])
def test_a_bead_on_a_wire(held: str, mu: float, speed: float) -> None:
    """Held from both sides, by two contacts that face each other or by a constraint, it is the
    pendulum φ″ = −g sin φ − μ sign(φ′) |g cos φ + φ′²|."""
    from scipy.integrate import solve_ivp

    x, y = 0.6, 0.8
    wire = ss.System(
        name="wire",
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential=f"{G}*y",
        contacts=HELD[held](mu),
        initial={"x": x, "y": y, "d_x": y * speed, "d_y": -x * speed},
    )
    end = 0.5
    found = ss.simulate(wire, (0.0, end))
    assert found.outcome.ok and found.certificate.ok
    # φ is counted from the lowest point, and falls: the bead goes down on the right.
    start = np.arctan2(x, -y)

    def pendulum(t: float, z: Any) -> Any:
        phi, rate = z
        pressed = abs(G * np.cos(phi) + rate**2)
        return [rate, -G * np.sin(phi) + mu * pressed]

    first = [start, -speed if speed else -1e-300]
    expected = solve_ivp(pendulum, (0.0, end), first, rtol=1e-12, atol=1e-13).y[0, -1]
    angle = np.arctan2(found.final["x"], -found.final["y"])
    assert angle == pytest.approx(expected, abs=1e-8)


def test_a_rod_tips_onto_its_other_end() -> None:
    """Both ends are rough, and one slides: the other one lands, and both slide to rest."""
    rod = ss.System(
        name="rod",
        coordinates={q: ss.Inertial() for q in ("x", "y", "theta")},
        kinetic="(d_x**2 + d_y**2)/2 + d_theta**2/6",
        potential=f"{G}*y",
        contacts={
            "left": ss.Unilateral("y - sin(theta)", "d_x + sin(theta)*d_theta", 0.3),
            "right": ss.Unilateral("y + sin(theta)", "d_x - sin(theta)*d_theta", 0.3),
        },
        initial={"theta": 0.4, "y": float(np.sin(0.4)), "d_x": -3.0},
        span=(0.0, 3.0),
    )
    found = ss.simulate(rod)
    assert found.outcome.ok and found.certificate.ok, (found.outcome, found.certificate)
    assert abs(found.final["theta"]) < 1e-12
    assert found.final["d_x"] == 0.0
    landed = found.impacts["time"].iloc[-1]
    after = found.at([landed + 1e-9])["d_x"][0]
    # Flat it slides as a block: v²/(2 μ g).
    way = found.final["x"] - found.at([landed])["x"][0]
    assert way == pytest.approx(-(after**2) / (0.6 * G), rel=1e-6)


def test_a_gap_that_starts_at_zero() -> None:
    """It has no size of its own, and rounding errors of the state are not its violation."""
    system = ss.System(
        name="pressed",
        coordinates={"y": ss.Inertial(), "z": ss.Inertial()},
        kinetic="(d_y**2 + d_z**2)/2 + 0.3*d_y*d_z + 0.1*z**2*d_z**2",
        potential=f"{G}*y",
        contacts={"floor": ss.Unilateral("y")},
        initial={"z": 0.5, "d_z": 1.0},
        span=(0.0, 1.0),
    )
    found = ss.simulate(system)
    assert found.certificate.ok, found.certificate
    again = ss.simulate(system, initial={**found.final, "y": -1e-20})
    assert again.certificate.ok, again.certificate


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-12])
def test_tolerances(rtol: float) -> None:
    """What a loose tolerance knows badly is no reason to end."""
    found = ss.simulate(ss.catalogue.limit_stops(), rtol=rtol)
    assert found.outcome.ok, found.message
