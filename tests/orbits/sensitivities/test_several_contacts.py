"""Derivatives of motions of bodies on several contacts, against central differences of motions:
rests that share forces, slips that begin, end and turn round together, and impacts in turn."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss

STEP = 1e-5


def differences(system: ss.System, name: str, times: list[float]) -> np.ndarray:
    """Derivatives of the state by a parameter, shape (times, states), by central differences."""
    middle = float(system.parameters[name].default)
    states = list(system.declaration.state)

    def at(value: float) -> np.ndarray:
        motion = ss.simulate(system, (0.0, times[-1]), parameters={name: value})
        assert motion.outcome.ok, motion.message
        return np.array([[motion.at(t)[x] for x in states] for t in times])

    def central(h: float) -> np.ndarray:
        return (at(middle + h) - at(middle - h)) / (2.0 * h)

    return (4.0 * central(STEP / 2.0) - central(STEP)) / 3.0


def check(
    system: ss.System, names: list[str], times: list[float], certified: bool = True
) -> ss.Trajectory:
    motion = ss.simulate(system, (0.0, times[-1]))
    assert motion.outcome.ok
    assert motion.certificate.ok or not certified
    found = motion.sensitivity(names, times)
    assert found.attrs["missing"] == []
    for name in names:
        own = np.array([found[x].sel(parameter=name) for x in system.declaration.state]).T
        np.testing.assert_allclose(own, differences(system, name, times), rtol=2e-7, atol=2e-7)
    return motion


# -- rests that share forces -----------------------------------------------------------------------

ROD = [(1.0, 0.0, 0.5), (-1.0, 0.0, 0.5)]
PLATE = [(x, y, 0.25) for x in (-1.0, 1.0) for y in (-0.5, 0.5)]
SIDE = ("0", "A*sin(om*t)", "0.3*A*sin(om*t)")
ROUND = ("A*sin(om*t)", "0.3*A*cos(om*t)", "0.1*A*sin(om*t)")


def body(
    points: list[tuple[float, float, float]],
    forces: tuple[str, str, str],
    static: float = 1.0,
    **values: float,
) -> ss.System:
    """A driven body on springs and on points."""
    contacts = {
        f"p{i}": ss.Contact(
            (
                f"d_x - d_th*({x!r}*sin(th) + {y!r}*cos(th))",
                f"d_y + d_th*({x!r}*cos(th) - {y!r}*sin(th))",
            ),
            f"{static}*s*{hold}",
            kinetic=f"s*{hold}" if static > 1.0 else None,
        )
        for i, (x, y, hold) in enumerate(points)
    }
    given = {"s": 1.0, "A": 1.5, "k": 0.5, "c": 0.1, "om": 1.0} | values
    return ss.System(
        "body",
        parameters={name: ss.Parameter(value) for name, value in given.items()},
        coordinates={
            x: ss.Inertial(force=f) for x, f in zip(("x", "y", "th"), forces, strict=True)
        },
        kinetic="(d_x**2 + d_y**2)/2 + d_th**2/6",
        potential="k/2*(x**2 + y**2 + th**2)",
        viscous="c/2*(d_x**2 + d_y**2 + d_th**2)",
        contacts=contacts,
        span=(0.0, 20.0),
    )


def stopped(motion: ss.Trajectory) -> np.ndarray:
    """Whether each knot is one after which all rests."""
    return np.all(motion.knots.mode == 0, axis=1)


@pytest.mark.parametrize("static", [1.0, 1.25])
@pytest.mark.parametrize(
    ("points", "forces", "names"),
    [(ROD, SIDE, ["A"]), (PLATE, ROUND, ["A", "s", "om"])],
    ids=["rod", "plate"],
)
def test_a_body_that_slips_and_rests(
    points: list[tuple[float, float, float]],
    forces: tuple[str, str, str],
    names: list[str],
    static: float,
) -> None:
    system = body(points, forces, static)
    motion = check(system, names, [1.5, 3.4, 4.2])
    assert np.any(stopped(motion)[1:] & ~stopped(motion)[:-1])


def test_what_is_left_of_a_slip_is_taken_by_the_forces_that_end_it() -> None:
    """One end of a rod comes to rest while the other one slides: where the metric of the mass and
    that of the coordinates are not the same."""
    system = body(ROD, SIDE, s=0.6537, A=1.1725, om=1.7649, c=0.0)
    motion = check(system, ["A"], [2.7, 2.9])
    mode = motion.knots.mode
    ends = (mode[:-1, 0] != 0) & (mode[:-1, 2] != 0) & ((mode[1:, 0] == 0) ^ (mode[1:, 2] == 0))
    assert np.any(ends)


def test_a_rod_that_turns_about_one_end_turns_round() -> None:
    """It passes through rest as a whole, without resting: so do its neighbours."""
    system = body(ROD, SIDE, 1.25, s=0.835, A=2.6511, om=2.3752, c=0.0)
    motion = check(system, ["A"], [4.35, 4.45])
    state = motion.knots.state
    rests = np.all(state[1:-1, 3:] == 0.0, axis=1)
    assert np.any(rests & ~stopped(motion)[1:-1] & ~stopped(motion)[:-2])


def test_multipliers_are_differences_of_motions() -> None:
    system = body(PLATE, ROUND)
    cycle = ss.find_cycle(system)
    assert cycle.certificate.ok
    state = dict(cycle.trajectory.final)
    names = list(state)

    def once(change: np.ndarray) -> np.ndarray:
        start = {x: v + float(d) for (x, v), d in zip(state.items(), change, strict=True)}
        begin = float(cycle.trajectory.knots.time[-1])
        motion = ss.simulate(system, (begin, begin + cycle.period), initial=start)
        return np.array([motion.final[x] for x in names])

    h = 1e-5
    slopes = np.column_stack([(once(h * e) - once(-h * e)) / (2.0 * h) for e in np.eye(len(names))])
    expected = np.sort_complex(np.linalg.eigvals(slopes))
    found = np.sort_complex(np.asarray(cycle.multipliers, complex))
    np.testing.assert_allclose(found, expected, atol=1e-6)


# -- impacts in turn -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("masses", "rebound"),
    [((1.0, 1.0, 1.0), 0.6), ((1.0, 0.7, 1.5), 0.9), ((1.0, 2.0, 0.5, 1.3), 0.8)],
)
def test_a_cradle(masses: tuple[float, ...], rebound: float) -> None:
    """Balls on springs, of which all but the first touch."""
    n = len(masses)
    places = [0.0, *(1.3 + i for i in range(n - 1))]
    system = ss.System(
        "cradle",
        parameters={
            name: ss.Parameter(value)
            for name, value in {"e": rebound, "d": 1.0, "k": 0.7, "m": masses[1]}.items()
        },
        coordinates={f"x{i}": ss.Inertial() for i in range(n)},
        kinetic=" + ".join(
            f"{'m' if i == 1 else mass}*d_x{i}**2/2" for i, mass in enumerate(masses)
        ),
        potential=" + ".join(f"k/2*(x{i} - {place})**2" for i, place in enumerate(places)),
        contacts={
            f"c{i}": ss.Unilateral(f"x{i + 1} - x{i} - d", restitution="e") for i in range(n - 1)
        },
        impacts="in turn",
        initial={"d_x0": 1.0} | {f"x{i}": place for i, place in enumerate(places)},
    )
    motion = check(system, ["e", "k", "m"], [0.2, 0.6, 1.2])
    assert len(motion.impacts) > 0


def block(law: str, mu: float, half: float, tilt: float = 0.15, drop: float = 0.0) -> ss.System:
    """A block that is dropped on its edges."""
    gaps = {side: f"y + {w}*sin(th) - cos(th)" for side, w in (("left", -half), ("right", half))}
    rates = {
        side: f"d_x - d_th*({w}*sin(th) - cos(th))"
        for side, w in (("left", -half), ("right", half))
    }
    return ss.System(
        "block",
        parameters={n: ss.Parameter(v) for n, v in {"e": 0.4, "mu": mu, "g": 9.81}.items()},
        coordinates={"x": ss.Inertial(), "y": ss.Inertial(force="-g"), "th": ss.Inertial()},
        kinetic="(d_x**2 + d_y**2)/2 + 0.2*d_th**2",
        contacts={
            side: ss.Unilateral(gaps[side], rates[side], "mu", restitution="e") for side in gaps
        },
        impacts=law,
        initial={"y": half * np.sin(tilt) + np.cos(tilt) + drop, "th": tilt},
    )


@pytest.mark.parametrize("law", ["in turn", "together"])
@pytest.mark.parametrize("drop", [0.0, 0.05])
@pytest.mark.parametrize("mu", [0.35, 0.8])
def test_a_block_that_rocks(law: str, drop: float, mu: float) -> None:
    """The one edge strikes while the other one rests or slides; bounces come to an end."""
    system = block(law, mu, 0.6, 0.12, drop)
    motion = check(system, ["e", "mu", "g"], [0.32, 0.4], certified=law == "together")
    assert len(motion.impacts) > 0


@pytest.mark.parametrize("law", ["in turn", "together"])
def test_edges_that_land_at_once_are_named(law: str) -> None:
    """Neighbours land on the one or the other edge first."""
    motion = ss.simulate(block(law, 0.5, 0.5, tilt=0.0, drop=0.1), (0.0, 0.3))
    assert motion.certificate.ok
    found = motion.sensitivity(["g"], [0.1, 0.2])
    assert "several contacts close at once" in found.attrs["missing"][0]
    assert np.all(np.isfinite(found["y"][:, 0]))
    assert np.all(np.isnan(found["y"][:, 1]))


@pytest.mark.parametrize("law", ["in turn", "together"])
def test_an_edge_at_the_centre_of_percussion_of_the_other_is_named(law: str) -> None:
    """The impulse of the edge that rests is just zero where w (w − μh) m = I: it is there for a
    larger μ, and not for a smaller one."""
    motion = ss.simulate(block(law, 0.3, 0.8), (0.0, 0.3))
    found = motion.sensitivity(["mu"], [0.2, 0.3])
    assert any("an impulse is exactly zero" in reason for reason in found.attrs["missing"])
    assert np.all(np.isfinite(found["x"][:, 0]))
    assert np.all(np.isnan(found["x"][:, 1]))
