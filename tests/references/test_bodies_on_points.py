"""Rigid bodies that rest, slide and turn on several points with friction in a plane: against closed
forms, a convex solver, and integrations of a regularised law."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import solve_ivp

from stickslip import Contact, Inertial, Outcome, Parameter, System, Trajectory, simulate

clarabel: Any = import_module("clarabel")  # compiled, without types

Array = np.ndarray
SPOTS = ("p0", "p1", "p2", "p3", "p4", "p5", "p6", "p7")


def body(
    points: Any,
    holds: Any,
    forces: tuple[str, ...] = ("0", "0", "0"),
    inertia: float = 1 / 3,
    static: float = 1.0,
    end: float = 3.0,
) -> System:
    """A rigid body of unit mass on points with friction; what is held at rest is `static` times
    what slides."""
    contacts = {}
    for name, (x, y), hold in zip(SPOTS, points, holds, strict=False):
        direction = (
            f"d_x - d_th*({x!r}*sin(th) + {y!r}*cos(th))",
            f"d_y + d_th*({x!r}*cos(th) - {y!r}*sin(th))",
        )
        sliding = {} if static == 1.0 else {"kinetic": hold}
        contacts[name] = Contact(direction, static * hold, **sliding)
    return System(
        "body",
        coordinates={
            name: Inertial(force=force)
            for name, force in zip(("x", "y", "th"), forces, strict=True)
        },
        kinetic=f"(d_x**2 + d_y**2)/2 + {inertia!r}/2*d_th**2",
        contacts=contacts,
        span=(0.0, end),
    )


def certified(system: System, start: dict[str, float] | None = None) -> Trajectory:
    motion = simulate(system, initial=start or {})
    assert motion.outcome.ok, motion.message
    assert motion.certificate.ok, motion.certificate.verdict
    return motion


def overload(pull: Array, points: Any, holds: Any) -> float:
    """The least factor τ such that forces of at most τ times what points hold have a sum and a
    moment."""
    n = len(points)
    cost = np.zeros(2 * n + 1)
    cost[-1] = 1.0
    sums = [[[1.0, 0.0], [0.0, 1.0], [-y, x]] for x, y in points]
    rows = [np.hstack([*map(np.array, sums), np.zeros((3, 1))])]
    cones = [clarabel.ZeroConeT(3)]
    for i, hold in enumerate(holds):
        own = np.zeros((3, 2 * n + 1))
        own[0, -1], own[1, 2 * i], own[2, 2 * i + 1] = -hold, -1.0, -1.0
        rows.append(own)
        cones.append(clarabel.SecondOrderConeT(3))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    right = np.concatenate([pull, np.zeros(3 * n)])
    A = sparse.csc_matrix(np.vstack(rows))
    P = sparse.csc_matrix((2 * n + 1, 2 * n + 1))
    found = clarabel.DefaultSolver(P, cost, A, right, cones, settings).solve()
    return float(found.x[-1])


def changes(motion: Trajectory) -> list[float]:
    """Times at which a contact begins or ends to slip."""
    knots = motion.knots
    changed = np.any(np.diff(knots.mode, axis=0) != 0, axis=1)
    return [float(t) for t in knots.time[1:][changed]]


# -- rest ------------------------------------------------------------------------------------------

ROD = [(1.0, 0.0), (-1.0, 0.0)]


@pytest.mark.parametrize("force", ["0.3", "0.3*sin(t)", "0.99"])
@pytest.mark.parametrize("moment", ["0", "0.005"])
def test_a_rod_rests_on_two_points(force: str, moment: str) -> None:
    motion = certified(body(ROD, [0.5, 0.5], ("0", force, moment)))
    assert motion.outcome in (Outcome.FINISHED, Outcome.AT_REST)
    assert len(changes(motion)) == 0
    assert all(abs(motion.final[name]) < 1e-12 for name in ("x", "y", "th"))


def test_points_rest_where_the_least_forces_are_too_large_for_one_of_them() -> None:
    """The sum of squares is least where the outer point holds 1.02 of what it can."""
    points, holds = [(1.0, 0.0), (0.1, 0.0), (-0.1, 0.0)], [0.3, 1.0, 1.0]
    pull = np.array([0.0, 0.8, 0.35])
    forces = tuple(f"{float(p)!r}*t" for p in pull)
    motion = certified(body(points, holds, forces))
    (first, *_) = changes(motion)
    assert first == pytest.approx(1.0 / overload(pull, points, holds), rel=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_forces_that_are_shown_hold_a_body(seed: int) -> None:
    """The least are too large for some points, if these hold less than others. What is shown has
    the sum that is asked for, is inside its discs, and is continuous in time."""
    rng = np.random.default_rng([50, seed])
    n = int(rng.integers(3, 7))
    places, holds = rng.uniform(-1.0, 1.0, (n, 2)), 10.0 ** rng.uniform(-1.5, 0.0, n)
    pull = rng.normal(size=3)
    pull *= 0.999 / overload(pull, places, holds)
    points = [(float(x), float(y)) for x, y in places]
    forces = tuple(f"{float(p)!r}*t" for p in pull)
    motion = certified(body(points, [float(hold) for hold in holds], forces, end=1.0))
    times = np.linspace(0.0, 1.0, 401)
    found = motion.at(times)
    held = np.array([[found[f"friction_{spot}_{i}"] for i in (1, 2)] for spot in SPOTS[:n]])
    assert np.all(np.linalg.norm(held, axis=1) <= (1.0 + 1e-12) * holds[:, None])
    moment = places[:, 0] @ held[:, 1] - places[:, 1] @ held[:, 0]
    sums = np.array([*np.sum(held, axis=0), moment])
    assert np.max(np.abs(sums + pull[:, None] * times)) < 1e-12
    assert np.max(np.abs(np.diff(held, axis=2))) < 0.1 * np.max(holds)


@pytest.mark.parametrize("seed", range(24))
def test_a_body_begins_to_slip_when_no_forces_hold_it(seed: int) -> None:
    """Under a growing load, on two to eight points, on a line or not."""
    rng = np.random.default_rng([41, seed])
    n = int(rng.integers(2, 9))
    points = rng.uniform(-1.0, 1.0, (n, 2))
    if seed % 3 == 0:
        points[:, 1] = 0.0
    points, holds = (
        [tuple(map(float, p)) for p in points],
        [float(h) for h in rng.uniform(0.3, 1.0, n)],
    )
    pull = rng.normal(size=3)
    pull *= 1.0 / np.linalg.norm(pull)
    begins = 1.0 / overload(pull, points, holds)
    forces = tuple(f"{float(p)!r}*t" for p in pull)
    motion = certified(body(points, holds, forces, end=begins * 1.02))
    first = changes(motion)[0]
    assert first == pytest.approx(begins, rel=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_a_steady_load_is_held_or_not(seed: int) -> None:
    rng = np.random.default_rng([42, seed])
    n = int(rng.integers(2, 7))
    points = [tuple(map(float, p)) for p in rng.uniform(-1.0, 1.0, (n, 2))]
    holds = [float(h) for h in rng.uniform(0.3, 1.0, n)]
    pull = rng.normal(size=3)
    pull *= (0.999 if seed % 2 == 0 else 1.001) / overload(pull, points, holds)
    motion = certified(body(points, holds, tuple(repr(float(p)) for p in pull), end=1.0))
    moved = max(abs(motion.final[name]) for name in ("d_x", "d_y", "d_th"))
    assert moved < 1e-12 if seed % 2 == 0 else moved > 1e-5


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("distance", [1e-1, 1e-2, 1e-3, 1e-4, 1e-6])
def test_points_that_are_close_hold_a_body_exactly(distance: float, seed: int) -> None:
    """Directions that depend on each other but for a little are not both taken for independent."""
    rng = np.random.default_rng([45, seed])
    places = rng.uniform(-1.0, 1.0, (4, 2))
    places[1] = places[0] + distance * rng.normal(size=2)
    points = [tuple(map(float, p)) for p in places]
    forces = tuple(repr(float(p)) for p in 0.2 * rng.normal(size=3))
    motion = certified(body(points, [0.7, 0.5, 0.6, 0.8], forces, end=1.0))
    assert all(abs(motion.final[f"d_{name}"]) < 1e-15 for name in ("x", "y", "th"))


# -- coming to rest --------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [2, 3, 8])
def test_a_body_that_does_not_turn_stops_as_one_point(n: int) -> None:
    angles = 2.0 * np.pi * np.arange(n) / n
    points = [(float(np.cos(a)), float(np.sin(a))) for a in angles]
    motion = certified(body(points, [1.0 / n] * n), {"d_x": 0.6, "d_y": 0.8})
    assert changes(motion) == pytest.approx([1.0], rel=1e-9)
    assert motion.final["x"] == pytest.approx(0.3, rel=1e-9)
    assert motion.final["y"] == pytest.approx(0.4, rel=1e-9)
    assert motion.outcome == Outcome.AT_REST


def test_a_rod_that_turns_about_its_middle_stops() -> None:
    motion = certified(body(ROD, [0.5, 0.5]), {"d_th": 1.0})
    assert changes(motion) == pytest.approx([1.0 / 3.0], rel=1e-9)
    assert motion.final["th"] == pytest.approx(1.0 / 6.0, rel=1e-9)


@pytest.mark.parametrize("seed", range(16))
def test_what_rubs_along_a_line_rests_with_its_body(seed: int) -> None:
    """Stick is no velocity: whether a force is as large as it can be does not matter."""
    rng = np.random.default_rng([49, seed])
    points = [(float(x), float(y)) for x, y in rng.uniform(-1.0, 1.0, (3, 2))]
    system = body(points, [0.3, 0.4, 0.5], ("0.05*sin(t)", "0", "0"), end=8.0)
    x, y, angle = (float(number) for number in rng.uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 6.0]))
    across = f"(d_x - d_th*({x!r}*sin(th) + {y!r}*cos(th)))"
    along = f"(d_y + d_th*({x!r}*cos(th) - {y!r}*sin(th)))"
    line = Contact(f"{float(np.cos(angle))!r}*{across} + {float(np.sin(angle))!r}*{along}", 0.2)
    system = replace(system, contacts={**system.contacts, "line": line})
    rates = map(float, rng.normal(size=3))
    start: dict[str, float] = dict(zip(("d_x", "d_y", "d_th"), rates, strict=True))
    motion = certified(system, start)
    assert {name: int(mode[-1]) for name, mode in motion.modes.items()} == dict.fromkeys(
        motion.modes, 0
    )


def test_two_contacts_of_a_point_are_one_of_their_sum() -> None:
    contacts = {name: Contact(("d_x", "d_y"), s) for name, s in (("front", 1.0), ("rear", 2.0))}
    sledge = System(
        "sledge",
        coordinates={"x": Inertial(force="1.4*sin(5*t)"), "y": Inertial(force="3.2*sin(3*t)")},
        kinetic="(d_x**2 + d_y**2)/2",
        contacts=contacts,
        span=(0.0, 6.0),
    )
    one = System(
        "sledge",
        coordinates=sledge.coordinates,
        kinetic=sledge.kinetic,
        contacts={"all": Contact(("d_x", "d_y"), 3.0)},
        span=(0.0, 6.0),
    )
    motion, other = certified(sledge), certified(one)
    assert changes(motion) == pytest.approx(changes(other), rel=1e-9)
    for name in ("x", "y"):
        assert motion.final[name] == pytest.approx(other.final[name], rel=1e-8, abs=1e-10)


def regularised(
    points: Any, holds: Any, inertia: float, load: Any, start: Any, end: float, width: float
) -> Array:
    """Place at the end where friction is −s u/√(|u|² + width²)."""
    places, s = np.array(points), np.array(holds)

    def rate(t: float, y: Array) -> Array:
        c, d = np.cos(y[2]), np.sin(y[2])
        arms = np.stack([c * places[:, 0] - d * places[:, 1], d * places[:, 0] + c * places[:, 1]])
        u = np.stack([y[3] - y[5] * arms[1], y[4] + y[5] * arms[0]])
        f = -s * u / np.sqrt(u[0] ** 2 + u[1] ** 2 + width**2)
        fx, fy, m = load(t)
        turn = np.sum(arms[0] * f[1] - arms[1] * f[0])
        return np.array([*y[3:], fx + f[0].sum(), fy + f[1].sum(), (m + turn) / inertia])

    y = np.concatenate([np.zeros(3), start])
    found = solve_ivp(rate, (0.0, end), y, method="LSODA", rtol=1e-9, atol=1e-12)
    return found.y[:3, -1]


@pytest.mark.parametrize("seed", range(6))
def test_motions_are_limits_of_regularised_ones(seed: int) -> None:
    """Thrown bodies, and bodies at rest under loads that come and go."""
    rng = np.random.default_rng([43, seed])
    n = 2 + seed % 3
    angles = 2.0 * np.pi * (np.arange(n) + rng.uniform(-0.2, 0.2, n)) / n
    points = [(float(np.cos(a)), float(np.sin(a))) for a in angles]
    holds = [float(h) for h in rng.uniform(0.3, 0.8, n)]
    inertia, end = 0.4, 2.5
    start = rng.normal(size=3) if seed % 2 == 0 else np.zeros(3)
    pull = rng.normal(size=3)
    pull *= (0.0 if seed % 2 == 0 else 1.6) / overload(pull, points, holds)
    forces = tuple(f"{float(p)!r}*sin(2*t)" for p in pull)
    system = body(points, holds, forces, inertia=inertia, end=end)
    motion = certified(system, dict(zip(("d_x", "d_y", "d_th"), map(float, start), strict=True)))

    def load(t: float) -> Array:
        return pull * np.sin(2.0 * t)

    # The error is of first order in the width, and a little more: extrapolated once.
    wide, narrow = (
        regularised(points, holds, inertia, load, start, end, width) for width in (2e-5, 1e-5)
    )
    limit = 2.0 * narrow - wide
    found = np.array([motion.final[name] for name in ("x", "y", "th")])
    assert np.max(np.abs(found - limit)) < 2e-4 * max(1.0, float(np.max(np.abs(limit))))


# -- static above kinetic --------------------------------------------------------------------------


def test_a_rod_leaves_rest_with_the_least_accelerations() -> None:
    """Under a load t, at rest up to 1.2, friction falls to 1: both points begin with 0.2."""
    motion = certified(body(ROD, [0.5, 0.5], ("0", "t", "0"), static=1.2, end=2.0))
    assert changes(motion) == pytest.approx([1.2], rel=1e-9)
    assert motion.final["d_y"] == pytest.approx((2.0**2 - 1.2**2) / 2 - 0.8, rel=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_what_sticks_could_stick(seed: int) -> None:
    """A larger threshold of rest only: the body rests as long as a convex solver says, and goes on
    from there."""
    rng = np.random.default_rng([44, seed])
    n = 2 + seed % 4
    angles = 2.0 * np.pi * (np.arange(n) + rng.uniform(-0.2, 0.2, n)) / n
    points = [(float(np.cos(a)), float(np.sin(a))) for a in angles]
    holds = [float(h) for h in rng.uniform(0.3, 0.8, n)]
    pull = rng.normal(size=3)
    pull /= overload(pull, points, holds)
    forces = tuple(f"{float(p)!r}*t" for p in pull)
    motion = certified(body(points, holds, forces, static=1.3, end=1.5))
    assert changes(motion)[0] == pytest.approx(1.3, rel=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_a_rod_that_is_pushed_across_at_its_middle_does_not_turn(seed: int) -> None:
    """At 1.2 all mechanisms that turn about points beyond its ends begin at once; then the least
    accelerations are those of all of it."""
    rng = np.random.default_rng([46, seed])
    angle, length, hold = (float(x) for x in rng.uniform([0.0, 0.5, 0.3], [6.2, 2.0, 1.0]))
    c, s = float(np.cos(angle)), float(np.sin(angle))
    rod = [(length * c, length * s), (-length * c, -length * s)]
    forces = (f"{-2.0 * hold * s!r}*t", f"{2.0 * hold * c!r}*t", "0")
    motion = certified(body(rod, [hold, hold], forces, static=1.2, end=1.5))
    assert changes(motion) == pytest.approx([1.2], rel=1e-9)
    speed = 2.0 * hold * (0.5 * (1.5**2 - 1.2**2) - 0.3)
    assert motion.final["d_x"] == pytest.approx(-s * speed, abs=1e-9)
    assert motion.final["d_y"] == pytest.approx(c * speed, abs=1e-9)
    assert abs(motion.final["d_th"]) < 1e-9


@pytest.mark.parametrize("seed", range(16))
def test_a_rod_that_many_mechanisms_could_move_begins_with_one(seed: int) -> None:
    """At 1, all points of a rod hold what they can, across it. How the load grows from there says
    how it turns, if every point moves on in the direction of its force; if not, some stay."""
    rng = np.random.default_rng([47, seed])
    n = int(rng.integers(2, 5))
    angle = float(rng.uniform(0.0, 6.2)) if seed % 2 else 0.0
    places, holds = rng.uniform(-1.0, 1.0, n), rng.uniform(0.3, 1.0, n)
    inertia = float(rng.uniform(0.05, 0.4))
    most = float(np.sum(holds))
    moment, more, side = np.array([places @ holds, *(0.2 * most * rng.normal(size=2))])
    spin = np.exp(1j * angle)
    points = [(float(x), float(y)) for x, y in (spin * places).view(float).reshape(-1, 2)]
    along, turn = complex(spin * 1j * most), f"{float(moment)!r}*t + {float(more)!r}*t*(t - 1)"
    slip = complex(spin * side)
    forces = (
        f"{along.real!r}*t + {slip.real!r}*t*(t - 1)",
        f"{along.imag!r}*t + {slip.imag!r}*t*(t - 1)",
        turn,
    )
    held = [float(hold) for hold in holds]
    motion = certified(body(points, held, forces, inertia=inertia, end=1.3))
    assert changes(motion)[0] == pytest.approx(1.0, rel=1e-9)

    def load(t: float) -> Array:
        push = along * t + slip * t * (t - 1.0)
        return np.array([push.real, push.imag, moment * t + more * t * (t - 1.0)])

    wide, narrow = (
        regularised(points, held, inertia, load, np.zeros(3), 1.3, width) for width in (2e-5, 1e-5)
    )
    limit = 2.0 * narrow - wide
    found = np.array([motion.final[name] for name in ("x", "y", "th")])
    assert np.max(np.abs(found - limit)) < 3e-3 * float(np.max(np.abs(limit)))


@pytest.mark.parametrize("seed", range(32))
def test_a_rod_begins_to_turn_about_one_of_its_points(seed: int) -> None:
    """The other point moves in one direction alone. The moment about the first is t; from 2.4 on it
    exceeds 1.2 · 2, and the rod turns with (t − 2)/(4/3)."""
    rng = np.random.default_rng([45, seed])
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    c, s = float(np.cos(angle)), float(np.sin(angle))
    rod = [(-c, -s), (c, s)]
    holds = [9.0, 1.0]
    # The force stays across the rod, which is longer than it turns.
    forces = (f"-t*sin({angle!r} + th)", f"t*cos({angle!r} + th)", "0")
    system = body(rod, holds, forces, static=1.2, end=3.0)
    motion = certified(system)
    assert changes(motion)[0] == pytest.approx(2.4, rel=1e-9)
    assert motion.final["d_th"] == pytest.approx(
        0.75 * (0.5 * (9.0 - 2.4**2) - 2.0 * 0.6), rel=1e-9
    )


# -- the audit -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "factor"), [("hold", 0.9), ("static", 1.05)])
@pytest.mark.parametrize("n", [2, 4])
def test_a_rest_that_no_forces_hold_and_a_slip_too_early_are_refused(
    n: int, name: str, factor: float, tmp_path: Path
) -> None:
    """The motion of a body is none of one that holds less, or more at rest."""
    angles = 2.0 * np.pi * np.arange(n) / n
    points = [(float(np.cos(a)), float(np.sin(a))) for a in angles]
    plain = body(points, [1.0 / n] * n, ("t", "0.4*t", "0.2*t"), end=2.0)
    contacts = {
        spot: replace(contact, threshold=f"static*hold/{n}", kinetic=f"hold/{n}")
        for spot, contact in plain.contacts.items()
    }
    values = {"hold": Parameter(1.0), "static": Parameter(1.2)}
    motion = certified(replace(plain, contacts=contacts, parameters=values))
    path = tmp_path / "motion.nc"
    motion.save(path)
    with netCDF4.Dataset(path, "r+") as file:
        value = values[name].default
        old, new = f'"{name}": {value}', f'"{name}": {value * factor}'
        assert old in file.stickslip_parameters
        file.stickslip_parameters = file.stickslip_parameters.replace(old, new)
        file.delncattr("stickslip_checksums")
        file.delncattr("stickslip_layout")
    with pytest.warns(match="without checksums"):
        claimed = Trajectory.open(path)
    assert not claimed.certificate.ok
