"""Motions of systems with tables: those of the same formulas typed out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.tables import belt, spring, typed

import stickslip as ss
from stickslip.model.entries.tables import TABLE_KINDS
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import pose

FALLING = ([0.0, 0.1, 0.3, 1.0, 3.0], [0.45, 0.3, 0.25, 0.28, 0.35])


def switch_times(motion: ss.Trajectory) -> Any:
    """When contacts switch; kinks are events, too."""
    events: Any = motion.events
    return events["time"][events["contact"].isin(list(motion.system.contacts))].to_numpy()


def same(one: ss.Trajectory, other: ss.Trajectory, slack: float = 1e-12) -> None:
    """Two motions with the same modes, at the same times."""
    assert one.outcome is other.outcome and one.certificate.ok and other.certificate.ok
    assert one.n_switches == other.n_switches
    np.testing.assert_allclose(*map(switch_times, (one, other)), rtol=0, atol=slack)
    for name, value in one.final.items():
        assert value == pytest.approx(other.final[name], abs=slack)


def test_straight_lines_are_the_formula_typed_out() -> None:
    """The same switches and kinks, in a sliding force, a threshold that depends on the place, and a
    spring."""
    table = ss.Table(*FALLING)
    tables, functions = {"mu": table}, {"mu(s)": typed(table)}
    written: list[dict[str, Any]] = [{"tables": tables}, {"functions": functions}]
    one, other = (ss.simulate(belt(**parts)) for parts in written)
    same(one, other)
    assert len(one.events) == len(other.events) > one.n_switches
    np.testing.assert_allclose(one.events["time"], other.events["time"], rtol=0, atol=1e-12)
    assert "speed at a knot of mu" in set(one.events["contact"])
    rough = ss.Table([-2.0, -0.2, 0.1, 0.4, 2.0], [0.3, 0.6, 0.4, 0.5, 0.3])
    places = [
        belt("0.8*g(x)", "g(x)", tables={"g": rough}),
        belt("0.8*g(x)", "g(x)", functions={"g(s)": typed(rough)}),
    ]
    rough_one, rough_other = map(ss.simulate, places)
    same(rough_one, rough_other)


@pytest.mark.parametrize("kind", TABLE_KINDS)
@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_random_springs(kind: Any, seed: int) -> None:
    """Forces and energies of random curves are those of the formulas."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(0.2, 0.8, 8)) - 2.2
    table = ss.Table(points, 1.5 * points + 0.4 * rng.normal(size=8), kind, outside="linear")
    slopes = [(table(e + h) - table(e)) / h for e, h in ((points[0], -1.0), (points[-1], 1.0))]
    ends = [
        f"{table(e)!r} + ({slope!r})*(s - ({e!r}))"
        for e, slope in zip(points[[0, -1]].tolist(), slopes, strict=True)
    ]
    formula = (
        f"piecewise(s < ({float(points[0])!r}), {ends[0]}, "
        f"s > ({float(points[-1])!r}), {ends[1]}, {typed(table)})"
    )
    one = ss.simulate(spring("integral_F(x)", tables={"F": table}))
    other = ss.simulate(spring("0", force="-F(x)", functions={"F(s)": formula}))
    same(one, other, 1e-9)
    energy = one.dataset["energy"].values + one.dataset["dissipated_energy"].values
    size = 1.0 + float(np.max(np.square(one.dataset["d_x"].values)))
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-12 * size)


@pytest.mark.parametrize("kind", TABLE_KINDS)
@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_random_sliding_forces_and_drags(kind: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 0.6, 7))])
    values = 0.4 + 0.06 * rng.uniform(-1, 1, 8)
    mu = ss.Table(points, values, kind, outside="constant")
    formula = f"piecewise(s > ({points[-1]!r}), {values[-1]!r}, {typed(mu)})"
    for parts in (
        {"kinetic": "mu(speed)", "threshold": f"0.05 + {values[0]!r}"},
        {"kinetic": "0.2", "threshold": 0.3, "drag": "mu(abs(d_x))*d_x"},
    ):
        one = ss.simulate(belt(tables={"mu": mu}, **parts))
        other = ss.simulate(belt(functions={"mu(s)": formula}, **parts))
        same(one, other, 1e-9)


def test_a_curve_of_time_and_of_an_internal_variable() -> None:
    """Any variable is an argument."""
    table = ss.Table([0.0, 1.0, 2.5], [0.4, 0.2, 0.3], outside="constant")
    for text in ("mu(t/10)", "mu(T)"):
        parts: dict[str, Any] = {"internal": {"T": ss.Internal("abs(d_x - V) - 0.2*T")}}
        kinetic, threshold = f"0.8*{text}", text
        typed_out = {"mu(s)": f"piecewise(s > 2.5, 0.3, {typed(table)})"}
        same(
            ss.simulate(belt(kinetic, threshold, tables={"mu": table}, **parts)),
            ss.simulate(belt(kinetic, threshold, functions=typed_out, **parts)),
            1e-11,
        )


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_a_surface(kind: Any) -> None:
    """Friction over speed and temperature; one that is a plane is the formula of a plane."""
    v, T = np.array([0.0, 0.1, 0.4, 3.0]), np.array([0.0, 1.0, 3.0, 8.0])
    plane = 0.4 - 0.03 * v[:, None] - 0.01 * T
    internal = {"T": ss.Internal("abs(d_x - V) - 0.2*T")}
    one = belt(
        "mu(speed, T)",
        "mu(0, T) + 0.1",
        tables={"mu": ss.Table((v, T), plane, kind)},
        internal=internal,
    )
    other = belt(
        "mu(speed, T)",
        "mu(0, T) + 0.1",
        functions={"mu(v, T)": "0.4 - 0.03*v - 0.01*T"},
        internal=internal,
    )
    same(ss.simulate(one), ss.simulate(other), 1e-10)
    bent = plane + 0.05 * np.exp(-5 * v[:, None]) * np.cos(T)
    found = ss.simulate(
        belt(
            "mu(speed, T)",
            "mu(0, T) + 0.1",
            tables={"mu": ss.Table((v, T), bent, kind)},
            internal=internal,
        )
    )
    assert found.outcome.ok and found.certificate.ok


def test_a_motion_of_another_table_is_not_certified() -> None:
    """If a knot is moved by a millionth, or a value."""
    points, values = map(np.array, FALLING)
    motion = ss.simulate(belt(tables={"mu": ss.Table(points, values)}))
    assert motion.certificate.ok
    for shift, rise in ((1e-6, 0.0), (0.0, 1e-6)):
        x, y = points.copy(), values.copy()
        x[2] += shift
        y[2] += rise
        other = belt(tables={"mu": ss.Table(x, y)})
        forged = ss.Trajectory(pose(other), motion.t_span, motion.knots, motion.outcome)
        assert not forged.certificate.ok


@pytest.mark.parametrize("kind", TABLE_KINDS)
@pytest.mark.parametrize("speed", [1.0, 3.0, -3.0, 100.0])
def test_leaving_a_table_ends_a_motion(kind: Any, speed: float) -> None:
    """By name, at the time and the place of its end; what is before it is certified."""
    table = ss.Table([-1.0, -0.5, 0.3, 1.0], [-1.0, -0.5, 0.3, 1.0], kind)
    system = spring("integral_F(x)", initial={"x": 0.3, "d_x": speed}, tables={"F": table})
    motion = ss.simulate(system)
    assert motion.outcome is Outcome.OUTSIDE_TABLE
    end = 1.0 if speed > 0 else -1.0
    assert motion.final["x"] == pytest.approx(end, abs=1e-12)
    said = f"outside of a table (x = {end:g}, and 'F' {'ends' if end > 0 else 'begins'} at {end:g})"
    assert motion.message.startswith(said)
    until = motion.knots.time[-1]
    further = ss.Table([-1.0, -0.5, 0.3, 1.0], table.values, kind, outside="linear")
    before = ss.simulate(system.configure({"F": further}), (0.0, until))
    assert before.final["x"] == pytest.approx(end, abs=1e-9) and before.certificate.ok
    assert ss.simulate(system, (0.0, until * (1 - 1e-9))).certificate.ok


def test_a_motion_begins_at_an_end_of_a_table_but_not_beyond() -> None:
    for count in (3, 4):
        points = np.linspace(-1.0, 1.0, count)
        system = spring("integral_F(x)", tables={"F": ss.Table(points, points)})
        for x in (-1.0, 1.0):
            motion = ss.simulate(system, initial={"x": x, "d_x": 0.0})
            assert motion.outcome.ok and motion.certificate.ok
        motion = ss.simulate(system, initial={"x": 1.5, "d_x": 0.0})
        assert motion.outcome is Outcome.OUTSIDE_TABLE and len(motion.knots.time) == 1
        assert "x = 1.5, and 'F' ends at 1" in motion.message


def test_many_knots_cost_no_more_code() -> None:
    """A table of two thousand knots is moved as it is declared."""
    points = np.linspace(0.0, 3.0, 2001)
    table = ss.Table(points, 0.25 + 0.2 * np.exp(-points / 0.2), "cubic")
    motion = ss.simulate(belt(tables={"mu": table}))
    smooth = ss.simulate(belt(functions={"mu(s)": "0.25 + 0.2*exp(-s/0.2)"}))
    assert motion.certificate.ok and motion.n_switches == smooth.n_switches
    np.testing.assert_allclose(*map(switch_times, (motion, smooth)), atol=1e-7)
    assert len(motion.events) == motion.n_switches  # a spline has no kinks


def test_a_law_of_points() -> None:
    """It is the contact written by hand, for each way."""
    v: Any = [-1.5, -0.2, -0.05, 0.05, 0.3, 2.0]
    F: Any = [-0.6, -0.5, -0.7, 0.6, 0.4, 0.5]
    static: Any = [0.7, 0.8]
    law = ss.laws.table("d_x", F_s=static, v=v, F=F, surface_speed="V", N=1.5)
    parts: dict[str, Any] = {"threshold": (1.05, 1.2)}
    ahead = ss.Table(v[3:], F[3:], outside=("constant", "refused"))
    back = ss.Table([0.05, 0.2, 1.5], [0.7, 0.5, 0.6], outside=("constant", "refused"))
    by_hand = belt(("1.5*a(speed)", "1.5*b(speed)"), tables={"a": ahead, "b": back}, **parts)  # type: ignore[arg-type]
    one = ss.System(
        "belt",
        parameters={"V": ss.Parameter(0.2)},
        coordinates={"x": ss.Inertial("m")},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"belt": law},
        span=(0.0, 30.0),
    )
    same(ss.simulate(one), ss.simulate(by_hand))


@pytest.mark.parametrize("kind", TABLE_KINDS)
def test_cycles_equilibria_maps_and_derivatives(kind: Any) -> None:
    """As of any formula."""
    table = ss.Table(*FALLING, kind)
    system = belt(tables={"mu": table})
    cycle = ss.find_cycle(system)
    assert cycle.certificate.ok and cycle.stable
    found = ss.equilibria(system)
    assert found.certificate.ok
    assert float(found.dataset["x"][0]) == pytest.approx(float(table(0.2)), abs=1e-12)
    swept = ss.sweep(system, {"V": [0.1, 0.3, 2.9]}, ["amplitude:x"])
    assert swept["amplitude:x"].values[0] > 0.1
    ended = [Outcome.from_code(int(code)) for code in swept["outcome"].values]
    assert ended[0] is Outcome.PERIODIC and ended[2] is Outcome.OUTSIDE_TABLE
    told = ss.simulate(system, (0.0, 10.0)).sensitivity(["V"], [5.0, 9.9], second_opinion=True)
    np.testing.assert_allclose(told["x"], told["x_by_differences"], rtol=1e-5, atol=1e-7)


def test_several_wells_have_their_equilibria() -> None:
    """A force that vanishes in many pieces."""
    points = np.arange(-3.0, 4.0)
    values = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    system = ss.System(
        "wells",
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="integral_F(x)",
        viscous="0.1*d_x**2",
        tables={"F": ss.Table(points, values)},
    )
    found = ss.equilibria(system)
    np.testing.assert_allclose(sorted(found.dataset["x"].values), points[:-1] + 0.5, atol=1e-12)
    assert found.certificate.ok


def test_what_begins_outside_is_said_everywhere() -> None:
    """In motions, maps, searches for cycles and equilibria: not that a logarithm has no value."""
    system = belt(tables={"mu": ss.Table(*FALLING)}).with_parameters(V=30.0)
    assert ss.simulate(system).outcome is Outcome.OUTSIDE_TABLE
    found = ss.sweep(system, {"V": [0.2, 30.0]}, ["amplitude"])["outcome"].values
    assert found[1] == Outcome.OUTSIDE_TABLE.code != found[0]
    with pytest.raises(ss.ConvergenceError, match="outside of a table"):
        ss.find_cycle(system)
    assert not ss.equilibria(system).isolated
