"""What the audit says of rest and of impacts, where forces are not unique or something else is at
rest: motions that are right are certified, and the same records under another law are not.

Whether admissible forces exist is asked of linear programs, or known in closed form.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

import stickslip as ss
from stickslip.arrays import Array
from stickslip.motion.trajectory import Trajectory

G = 9.81
PLANAR = {name: ss.Inertial() for name in ("x", "y", "th")}


def parameters(*names: str) -> dict[str, ss.Parameter]:
    return {name: ss.Parameter(1.0) for name in names}


LADDER = ss.System(
    "ladder",
    parameters=parameters("m", "L", "floor_mu", "wall_mu"),
    coordinates=PLANAR,
    kinetic="m/2*(d_x**2 + d_y**2) + m*L**2/6*d_th**2",
    potential=f"{G}*m*y",
    contacts={
        "floor": ss.Unilateral("y - L*sin(th)", "d_x - L*sin(th)*d_th", "floor_mu"),
        "wall": ss.Unilateral("x - L*cos(th)", "d_y + L*cos(th)*d_th", "wall_mu"),
    },
    initial={"x": 1.0},
    span=(0.0, 1.0),
)
PADS = ss.System(
    "block between a wall and a pad",
    parameters=parameters("m", "P", "wall_mu", "pad_mu"),
    coordinates={name: ss.Inertial() for name in ("x", "y", "p")},
    kinetic="m/2*(d_x**2 + d_y**2) + d_p**2/4",
    potential=f"{G}*m*y + P*p",
    contacts={
        "wall": ss.Unilateral("x", "d_y", "wall_mu"),
        "pad": ss.Unilateral("p - x", "d_y", "pad_mu"),
    },
    span=(0.0, 1.0),
)


def table(feet: int, restitution: float = 0.0) -> ss.System:
    """A table on feet at a0, a1, ... that is pushed at its centre, at the height h."""
    names = [f"{kind}{i}" for i in range(feet) for kind in ("a", "mu")]
    return ss.System(
        "table",
        parameters=parameters("m", "I", "h", "F", "w", *names),
        coordinates=PLANAR,
        kinetic="m/2*(d_x**2 + d_y**2) + I/2*d_th**2",
        potential=f"{G}*m*y - F*cos(w*t)*x",
        contacts={
            f"f{i}": ss.Unilateral(
                f"y + a{i}*sin(th) - h*cos(th)",
                f"d_x + (h*cos(th) - a{i}*sin(th))*d_th",
                f"mu{i}",
                restitution=restitution,
            )
            for i in range(feet)
        },
        initial={"y": 1.0},
        span=(0.0, 1.5),
    )


TABLES = {feet: table(feet) for feet in (2, 3, 4, 5)}


def stands(normal: Array, along: Array, mu: Array, load: Array) -> bool:
    """Whether normal forces N ≥ 0 and friction |T| ≤ μ N exist that balance a load.

    Parameters
    ----------
    normal, along : arrays, shape (coordinates, contacts)
        What units of them do.
    mu : array, shape (contacts,)
    load : array, shape (coordinates,)
    """
    n = len(mu)
    bound = np.block([[-np.diag(mu), np.eye(n)], [-np.diag(mu), -np.eye(n)]])
    signs = [(0, None)] * n + [(None, None)] * n
    found = linprog(
        np.zeros(2 * n), bound, np.zeros(2 * n), np.hstack([normal, along]), -load, bounds=signs
    )
    return found.status == 0


def at_rest(kind: str, rng: np.random.Generator) -> tuple[ss.System, dict[str, float], dict]:
    """A system that stands, with its parameters and its start."""
    while True:
        if kind == "ladder":
            system = LADDER
            values = {"m": rng.uniform(0.3, 5.0), "L": rng.uniform(0.5, 2.0)}
            values |= {"floor_mu": rng.uniform(0.2, 0.8), "wall_mu": rng.uniform(0.0, 0.6)}
            th = rng.uniform(0.6, 1.45)
            length = values["L"]
            start = {"th": th, "x": length * float(np.cos(th)), "y": length * float(np.sin(th))}
        elif kind == "table":
            feet = int(rng.integers(2, 6))
            system = TABLES[feet]
            values = {"m": rng.uniform(0.3, 5.0), "I": rng.uniform(0.05, 0.5)}
            values |= {f"a{i}": float(a) for i, a in enumerate(rng.uniform(-1.0, 1.0, feet))}
            values |= {f"mu{i}": float(mu) for i, mu in enumerate(rng.uniform(0.1, 0.6, feet))}
            values |= {"h": rng.uniform(0.1, 0.6), "w": float(rng.choice([0.0, 3.0]))}
            # however its weight is distributed
            least = min(values[f"mu{i}"] for i in range(feet))
            values["F"] = values["m"] * G * least * rng.uniform(0.0, 0.95)
            start = {"y": values["h"]}
        else:
            system = PADS
            values = {"m": rng.uniform(0.3, 3.0), "P": rng.uniform(5.0, 60.0)}
            values |= {"wall_mu": rng.uniform(0.2, 0.8), "pad_mu": rng.uniform(0.2, 0.8)}
            start = {}
        if holds(system, values, start, 0.999):
            return system, values, start


def holds(system: ss.System, v: dict[str, float], start: dict[str, float], part: float) -> bool:
    """Whether it stands with a part of its friction."""
    load = np.array([0.0, -v["m"] * G, 0.0])
    if system is LADDER:
        s, c = v["L"] * np.sin(start["th"]), v["L"] * np.cos(start["th"])
        normal, along = np.array([[0, 1], [1, 0], [-c, s]]), np.array([[1, 0], [0, 1], [-s, c]])
        return stands(normal, along, part * np.array([v["floor_mu"], v["wall_mu"]]), load)
    if system is PADS:
        load[2] = -v["P"]
        normal, along = np.array([[1, -1], [0, 0], [0, 1]]), np.array([[0, 0], [1, 1], [0, 0]])
        return stands(normal, along, part * np.array([v["wall_mu"], v["pad_mu"]]), load)
    feet = len(system.contacts)
    one = np.ones(feet)
    a, mu = (np.array([v[f"{kind}{i}"] for i in range(feet)]) for kind in ("a", "mu"))
    normal, along = np.array([0 * one, one, a]), np.array([one, 0 * one, v["h"] * one])
    ways = (v["F"],) if v["w"] == 0.0 else (v["F"], -v["F"])
    return all(stands(normal, along, part * mu, load + np.array([F, 0.0, 0.0])) for F in ways)


def under(motion: Trajectory, system: ss.System, values: dict[str, float]) -> Trajectory:
    """The record of a motion as that of another system."""
    span = (0.0, 1e-9)
    start = {name: motion.at(0.0)[name] for name in motion.problem.compiled.layout.state}
    start = {name: float(value) for name, value in start.items()}
    other = ss.simulate(system, span, parameters=values, initial=start)
    return Trajectory(other.problem, motion.t_span, motion.knots, motion.outcome, motion.rtol)


@pytest.mark.parametrize(("kind", "count"), [("ladder", 30), ("table", 25), ("pads", 15)])
def test_rest_of_forces_that_are_not_unique(kind: str, count: int) -> None:
    """What stands is certified at rest; and, with more or less friction, if and only if some forces
    still hold it: also where those of its modes do not."""
    rng = np.random.default_rng(len(kind))
    refused = 0
    for _ in range(count):
        system, values, start = at_rest(kind, rng)
        motion = ss.simulate(system, parameters=values, initial=start)
        assert motion.certificate.ok, (motion.certificate.verdict, values)
        moved = [abs(motion.final[name]) for name in motion.final if name.startswith("d_")]
        assert max(moved) < 1e-12
        for part in (0.1, *rng.uniform(0.3, 1.6, 2)):
            weaker = {n: v * part if "mu" in n else v for n, v in values.items()}
            sure = (
                holds(system, values, start, part * 0.99),
                holds(system, values, start, part * 1.01),
            )
            # Under a load that turns round, forces that do not change evenly may be missed.
            turns = values.get("w", 0.0) > 0.0
            if sure[0] == sure[1] and not (sure[0] and turns):
                told = under(motion, system, weaker).certificate
                assert told.ok == sure[0], (told.verdict, part, values)
                refused += not sure[0]
    assert refused > count / 2


@pytest.mark.parametrize("brakes", [1, 2, 3])
def test_rest_of_brakes_that_ends_too_early(brakes: int) -> None:
    """A slip that begins when all brakes together are full is too early if one of them holds more:
    others would be full first, and it would hold the rest."""
    rng = np.random.default_rng(brakes)
    names = [f"b{i}" for i in range(brakes)]
    system = ss.System(
        "brakes",
        parameters=parameters("A", *names, *(f"k{name}" for name in names)),
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="-A*x*sin(t)",
        contacts={n: ss.Contact("d_x", n, kinetic=f"k{n}") for n in names},
        span=(0.0, 3.0),
    )
    for _ in range(10):
        values = {n: rng.uniform(0.2, 0.8) for n in names}
        values["A"] = sum(values.values()) * rng.uniform(1.2, 2.0)
        values |= {f"k{n}": values[n] * rng.uniform(0.5, 0.9) for n in names}
        motion = ss.simulate(system, parameters=values)
        first = float(np.arcsin(sum(values[n] for n in names) / values["A"]))
        assert motion.certificate.ok
        assert motion.events["time"].to_numpy() == pytest.approx(first, abs=1e-9)
        stronger = str(rng.choice(names))
        told = under(motion, system, values | {stronger: 1.05 * values[stronger]}).certificate
        assert not told.ok


def fallen(rng: np.random.Generator) -> tuple[ss.System, dict[str, tuple[float, float]]]:
    """Bodies that are dropped, slide or rest beside each other, and one more that rests, or moves
    without force; and their friction and first speeds."""
    count = int(rng.integers(1, 4))
    coordinates, contacts, start = {}, {}, {}
    kinetic, potential = [], []
    bodies: dict[str, tuple[float, float]] = {}
    for i in range(count):
        m, mu = rng.uniform(0.5, 3.0), float(rng.choice([0.0, 0.2, 0.5]))
        e = float(rng.choice([0.0, 0.3, 0.5]))
        height, speed = rng.uniform(0.05, 0.3), rng.uniform(-2.0, 2.0)
        height, speed = height * (rng.random() < 0.6), speed * (rng.random() < 0.6)
        coordinates |= {f"x{i}": ss.Inertial(), f"y{i}": ss.Inertial()}
        kinetic.append(f"{m:.3f}*(d_x{i}**2 + d_y{i}**2)/2")
        potential.append(f"{m:.3f}*{G}*y{i}")
        contacts[f"f{i}"] = ss.Unilateral(f"y{i}", f"d_x{i}", mu, restitution=e)
        start |= {f"y{i}": height, f"d_x{i}": speed}
        bodies[f"x{i}"] = (mu, speed)
    coordinates["z"] = ss.Inertial()
    kinetic.append("0.4*d_z**2/2")
    kind = int(rng.integers(4))
    potential.append(("0", "3*z**2", "2*(1 - cos(z))", "-0.3*z")[kind])
    if kind == 3:
        contacts["b"] = ss.Contact("d_z", 0.5)
    system = ss.System(
        "bodies",
        coordinates=coordinates,
        kinetic=" + ".join(kinetic),
        potential=" + ".join(potential),
        contacts=contacts,
        initial=start,
        span=(0.0, 1.5),
    )
    return system, bodies


def test_impacts_beside_what_rests() -> None:
    """Impacts are certified whatever else is at rest; all normal impulses together are m g t in
    time, which friction takes from the velocity until it is zero."""
    rng = np.random.default_rng(7)
    struck = 0
    for _ in range(14):
        system, bodies = fallen(rng)
        motion = ss.simulate(system)
        assert motion.certificate.ok, motion.certificate.verdict
        for x, (mu, speed) in bodies.items():
            left = np.sign(speed) * max(abs(speed) - mu * G * 1.5, 0.0)
            assert motion.final[f"d_{x}"] == pytest.approx(left, abs=1e-9)
        # the same record with other restitution
        bounces = [c for c, part in system.contacts.items() if part_bounces(part)]
        hit = set(motion.impacts["contact"][motion.impacts["approach"] > 1e-2])
        for name in hit.intersection(bounces):
            part = system.contacts[name]
            assert isinstance(part, ss.Unilateral)
            other = replace(part, restitution=float(part.restitution) * (1 + 1e-6))
            told = under(motion, replace(system, contacts={**system.contacts, name: other}), {})
            assert not told.certificate.ok
            struck += 1
    assert struck > 3


def part_bounces(part: object) -> bool:
    return isinstance(part, ss.Unilateral) and float(part.restitution) > 0.0


def test_the_last_of_infinitely_many_impacts_that_rub() -> None:
    """Towards their end they change no more than rounding errors of the belt's speed, and still
    slip, or are turned back by tangential restitution, one as exactly as the other."""
    rng = np.random.default_rng(3)
    thrown = ss.System(
        "thrown on a belt",
        parameters=parameters("mu", "e", "b", "V"),
        coordinates={"x": ss.Inertial(), "y": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2",
        potential=f"{G}*y",
        contacts={
            "floor": ss.Unilateral(
                "y", "d_x", "mu", surface_speed="V", restitution="e", tangential_restitution="b"
            )
        },
        span=(0.0, 3.0),
    )
    for _ in range(120):
        values = {"mu": rng.uniform(0.0, 1.0), "e": rng.uniform(0.05, 0.8)}
        values |= {"b": rng.uniform(0.0, 0.9), "V": rng.uniform(-2.0, 2.0)}
        start = {"y": rng.uniform(0.05, 1.0), "d_x": rng.uniform(-4.0, 4.0)}
        motion = ss.simulate(thrown, parameters=values, initial=start)
        assert motion.certificate.ok, (motion.certificate.verdict, values, start)
        # All impacts may slip, or all be turned back, but not both.
        others = {"b": values["b"] + 1e-6}, {"mu": values["mu"] * (1 + 1e-6)}
        assert not all(under(motion, thrown, values | other).certificate.ok for other in others)


def test_impacts_of_many_feet() -> None:
    """Rigid tables that are dropped, flat or tilted: impulses of three feet and more are not
    unique, and the audit asks whether there are some."""
    rng = np.random.default_rng(11)
    systems = {(feet, e): table(feet, e) for feet in (2, 3, 4) for e in (0.0, 0.4)}
    for _ in range(24):
        feet, e = int(rng.integers(2, 5)), float(rng.choice([0.0, 0.4]))
        values = {"m": 1.0, "I": rng.uniform(0.05, 1.0), "h": rng.uniform(0.05, 0.5)}
        values |= {f"a{i}": float(a) for i, a in enumerate(rng.uniform(-1.0, 1.0, feet))}
        mu = float(rng.choice([0.0, 0.2, 0.5]))
        values |= {f"mu{i}": mu for i in range(feet)} | {"F": 0.0, "w": 0.0}
        start = {"y": values["h"] + 0.3, "d_x": rng.uniform(-2.0, 2.0)}
        start["th"] = rng.uniform(-0.2, 0.2) * (rng.random() < 0.3)
        motion = ss.simulate(systems[feet, e], parameters=values, initial=start)
        assert motion.outcome.ok and motion.certificate.ok, motion.certificate.verdict
        first = int(motion._impacts[0])
        state = motion.knots.state.copy()
        rates = slice(state.shape[1] // 2, None)
        state[first, rates] += 1e-7 * rng.choice([-1.0, 1.0], 3)
        knots = replace(motion.knots, state=state)
        wrong = Trajectory(motion.problem, motion.t_span, knots, motion.outcome, motion.rtol)
        assert not wrong.certificate.ok


# -- rest while some forces hold it ----------------------------------------------------------------


@pytest.mark.parametrize("feet", [4, 5])
@pytest.mark.parametrize("seed", range(12))
def test_a_table_rests_as_long_as_some_forces_hold_it(feet: int, seed: int) -> None:
    """Its feet rub with different friction: how its weight is shared is not known, and it may be
    shared so that the table does not slide."""
    rng = np.random.default_rng([feet, seed])
    values = {"m": rng.uniform(0.3, 5.0), "I": rng.uniform(0.05, 0.5), "h": rng.uniform(0.1, 0.6)}
    values |= {f"a{i}": float(a) for i, a in enumerate(np.linspace(-1.0, 1.0, feet))}
    values |= {f"mu{i}": float(mu) for i, mu in enumerate(rng.uniform(0.1, 0.6, feet))}
    values |= {"w": 3.0 if seed % 2 else 0.0}
    low, high = 0.0, values["m"] * G
    for _ in range(40):
        values["F"] = 0.5 * (low + high)
        stands_ = holds(TABLES[feet], values, {}, 1.0)
        low, high = (values["F"], high) if stands_ else (low, values["F"])
    start = {"y": values["h"]}
    motion = ss.simulate(TABLES[feet], initial=start, parameters=values | {"F": 0.99 * low})
    assert motion.outcome.ok and motion.certificate.ok, motion.certificate
    assert max(abs(motion.final[name]) for name in ("d_x", "d_y", "d_th")) < 1e-12
    if seed % 2 == 0:
        motion = ss.simulate(TABLES[feet], initial=start, parameters=values | {"F": 1.01 * low})
        assert motion.outcome.ok and motion.certificate.ok, motion.certificate
        assert motion.final["d_x"] > 1e-3


@pytest.mark.parametrize("part", [0.3, 0.99, 1.01])
def test_a_plate_rests_on_the_feet_that_rub_most(part: float) -> None:
    """Two opposite feet of four hold μ times its weight, however little the others do."""
    contacts = {
        f"foot{i}": ss.Unilateral(
            f"z + ({c})*a + ({s})*b", (f"d_x - ({s})*d_w", f"d_y + ({c})*d_w"), mu
        )
        for i, (c, s, mu) in enumerate([(1, 0, 0.1), (0, 1, 0.5), (-1, 0, 0.1), (0, -1, 0.5)])
    }
    forces = {"x": f"{0.5 * part}"}
    plate = ss.System(
        "plate",
        coordinates={
            q: ss.Inertial(force=forces.get(q, "0")) for q in ("x", "y", "z", "a", "b", "w")
        },
        kinetic="(d_x**2 + d_y**2 + d_z**2 + 0.3*d_a**2 + 0.3*d_b**2 + 0.5*d_w**2)/2",
        potential="z",
        contacts=contacts,
        span=(0.0, 1.0),
    )
    motion = ss.simulate(plate)
    assert motion.outcome.ok and motion.certificate.ok, motion.certificate
    speed = max(abs(motion.final[name]) for name in ("d_x", "d_y", "d_w"))
    assert speed > 1e-3 if part > 1.0 else speed < 1e-12


@pytest.mark.parametrize("start", [-2.187, -1.3, 0.8, 2.6])
def test_friction_of_nothing_beside_a_stop_that_holds(start: float) -> None:
    """Its force is rounding of that of the stop, and nothing to measure an error against."""
    cart = ss.System(
        "cart between stops",
        coordinates={"x": ss.Inertial(), "phi": ss.Inertial()},
        kinetic="0.4*d_x**2 + 0.42*(d_x**2 + 1.8*d_x*d_phi*cos(phi) + 0.81*d_phi**2)",
        potential="-7.4*cos(phi)",
        contacts={
            "track": ss.Contact("d_x", 0.0),
            "left": ss.Unilateral("x + 0.04"),
            "right": ss.Unilateral("0.04 - x"),
        },
        initial={"phi": start, "d_phi": -0.63},
        span=(0.0, 2.5),
    )
    motion = ss.simulate(cart)
    assert motion.outcome.ok and motion.certificate.ok, motion.certificate
    assert {"left", "right"} <= set(motion.events["contact"])
