"""Laws of friction in a plane: it does not know where the axes of the plane are, along a line it is
friction along a line, and units, the origin of time and the tolerance do not matter."""

from __future__ import annotations

from functools import cache
from math import cos, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip import Contact, Inertial, System, Trajectory, simulate
from stickslip.arrays import Array
from systems import parameters

State = dict[str, float]

law = settings(max_examples=12, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32 - 1)
KINETIC = {"same": None, "drop": "d*({s})", "stribeck": "({s})*(d + (1 - d)*exp(-speed/v))"}


def certified(
    system: System,
    span: tuple[float, float],
    start: State,
    values: State | None = None,
    rtol: float = 1e-10,
) -> Trajectory:
    trajectory = simulate(system, span, initial=start, parameters=values, rtol=rtol)
    assert trajectory.outcome.ok, trajectory.message
    assert trajectory.certificate.ok, trajectory.certificate.verdict
    return trajectory


def switches(motion: Trajectory) -> Array:
    """Times at which the first contact begins or ends to slip."""
    knots = motion.knots
    return knots.time[1:][np.diff(np.abs(knots.mode[:, 0])) != 0]


def near(one: Array, other: Array, tolerance: float = 1e-9) -> None:
    np.testing.assert_allclose(one, other, rtol=0, atol=tolerance * np.abs(one).max(initial=1.0))


# -- rotation --------------------------------------------------------------------------------------


@cache
def turned(kind: str) -> System:
    """A block on springs whose coordinates are turned by the angle of (c, n) from those in which
    stiffness, loads and belt are given: q = R(x, y), with everything as a function of q."""
    p, q = "(c*x - n*y)", "(n*x + c*y)"
    s = "s*(1 + r*cos(al*(t - t_0)))"
    kinetic = KINETIC[kind]
    return System(
        f"turned block, {kind}",
        parameters=parameters(
            c=1.0, n=0.0, m=1.0, A=1.0, B=0.5, D=0.8, e=0.1, F=1.0, G=1.0, om=1.3, ph=0.4,
            s=0.8, r=0.3, al=0.9, d=0.7, v=0.3, wx=0.2, wy=-0.1, t_0=0.0,
        ),
        coordinates={"x": Inertial(), "y": Inertial()},
        kinetic="m/2*(d_x**2 + d_y**2)",
        potential=f"A/2*{p}**2 + B*{p}*{q} + D*{q}**2 - F*cos(om*(t - t_0))*{p}"
        f" - G*sin(0.7*om*(t - t_0) + ph)*{q}",
        viscous="e/2*(d_x**2 + d_y**2)",
        contacts={
            "table": Contact(
                ("d_x", "d_y"),
                s,
                surface_speed=("c*wx + n*wy", "c*wy - n*wx"),
                kinetic=None if kinetic is None else kinetic.format(s=s),
            )
        },
    )  # fmt: skip


def case(seed: int) -> tuple[State, State]:
    """Where a block starts, and its numbers."""
    rng = np.random.default_rng(seed)
    values = {
        "A": rng.uniform(0.6, 1.5), "B": rng.uniform(-0.3, 0.3), "D": rng.uniform(0.4, 1.0),
        "F": rng.uniform(0.6, 2.0), "G": rng.uniform(0.6, 2.0), "om": rng.uniform(0.6, 1.6),
        "ph": rng.uniform(0.0, 6.0), "s": rng.uniform(0.4, 1.0), "r": rng.uniform(-0.4, 0.4),
        "al": rng.uniform(0.4, 1.5), "d": rng.uniform(0.6, 0.95), "v": rng.uniform(0.2, 0.6),
        "wx": rng.choice([0.0, 0.3]) * rng.normal(), "wy": rng.choice([0.0, 0.3]) * rng.normal(),
        "m": rng.uniform(0.7, 1.5), "e": rng.uniform(0.0, 0.3),
    }  # fmt: skip
    start = dict(zip(("x", "y", "d_x", "d_y"), rng.normal(size=4) * 0.6, strict=True))
    return {k: float(v) for k, v in start.items()}, {k: float(v) for k, v in values.items()}


@pytest.mark.parametrize("kind", KINETIC)
@law
@given(seed=seeds, angle=st.floats(-3.2, 3.2))
def test_a_rotation_of_the_plane_rotates_the_motion(kind: str, seed: int, angle: float) -> None:
    start, values = case(seed)
    c, n = cos(angle), sin(angle)
    times = np.linspace(0.0, 12.0, 121)
    here = certified(turned(kind), (0.0, 12.0), start, values)
    # q = R(x, y), so (x, y) = Rᵀq
    back = {
        f"{d}{a}": c * start[f"{d}{a}"] + sign * n * start[f"{d}{b}"]
        for d in ("", "d_")
        for a, b, sign in (("x", "y", 1), ("y", "x", -1))
    }
    there = certified(turned(kind), (0.0, 12.0), back, {**values, "c": c, "n": n})
    one, other = here.at(times), there.at(times)
    for d in ("", "d_"):
        near(one[f"{d}x"], c * other[f"{d}x"] - n * other[f"{d}y"], 1e-8)
        near(one[f"{d}y"], n * other[f"{d}x"] + c * other[f"{d}y"], 1e-8)
    assert len(switches(here)) == len(switches(there))
    near(switches(here), switches(there), 1e-8)


# -- along a line ----------------------------------------------------------------------------------


@cache
def along(kind: str, plane: bool) -> System:
    """A block on a belt, shaken along x; in a plane, nothing happens along y."""
    kinetic = KINETIC[kind]
    s = "s*(1 + r*cos(al*t))"
    k = None if kinetic is None else kinetic.format(s=s)
    w = "wx + 0.3*sin(0.5*t)"
    table = (
        Contact(("d_x", "d_y"), s, surface_speed=(w, "0"), kinetic=k)
        if plane
        else Contact("d_x", s, surface_speed=w, kinetic=k)
    )
    return System(
        f"along a line, {kind}",
        parameters=parameters(
            m=1.0, A=1.0, e=0.1, F=1.0, om=1.3, ph=0.4, s=0.8, r=0.3, al=0.9, d=0.7, v=0.3, wx=0.2
        ),
        coordinates={"x": Inertial(force="F*cos(om*t + ph)")}
        | ({"y": Inertial()} if plane else {}),
        kinetic="m/2*(d_x**2 + d_y**2)" if plane else "m/2*d_x**2",
        potential="A/2*x**2 + A/2*y**2" if plane else "A/2*x**2",
        viscous="e/2*d_x**2",
        contacts={"table": table},
    )


@pytest.mark.parametrize("kind", KINETIC)
@law
@given(seed=seeds)
def test_along_a_line_it_is_friction_along_a_line(kind: str, seed: int) -> None:
    start, values = case(seed)
    line = along(kind, plane=False)
    values = {n: v for n, v in values.items() if n in line.parameters}
    start = {n: start[n] for n in ("x", "d_x")}
    values["F"] *= 2
    scalar = certified(line, (0.0, 15.0), start, values)
    planar = certified(along(kind, plane=True), (0.0, 15.0), start, values)
    times = np.linspace(0.0, 15.0, 151)
    one, other = scalar.at(times), planar.at(times)
    for name in ("x", "d_x"):
        near(one[name], other[name], 1e-10)
    assert np.abs(other["y"]).max() < 1e-30
    assert np.abs(other["d_y"]).max() < 1e-30
    near(one["friction_table"], other["friction_table_1"], 1e-8)
    assert len(switches(scalar)) == len(switches(planar))
    near(switches(scalar), switches(planar), 1e-11)


# -- units, time, tolerance, energy ----------------------------------------------------------------


@law
@given(seed=seeds, exponents=st.tuples(*[st.integers(-5, 5)] * 3))
def test_units_do_not_matter(seed: int, exponents: tuple[int, int, int]) -> None:
    start, values = case(seed)
    length, time, force = (10.0**e for e in exponents)
    units = {
        "m": force * time**2 / length, "A": force / length, "B": force / length,
        "D": force / length, "e": force * time / length, "F": force, "G": force, "s": force,
        "om": 1 / time, "al": 1 / time, "v": length / time, "wx": length / time,
        "wy": length / time,
    }  # fmt: skip
    times = np.linspace(0.0, 10.0, 41)
    here = certified(turned("drop"), (0.0, 10.0), start, values)
    there = certified(
        turned("drop"),
        (0.0, 10.0 * time),
        {n: v * length / (time if n.startswith("d_") else 1.0) for n, v in start.items()},
        {n: v * units.get(n, 1.0) for n, v in values.items()},
    )
    one, other = here.at(times), there.at(np.minimum(times * time, 10.0 * time))
    for name in ("x", "y"):
        near(one[name], other[name] / length, 1e-8)
        near(one[f"d_{name}"], other[f"d_{name}"] * time / length, 1e-8)
    assert len(switches(here)) == len(switches(there))


@law
@given(seed=seeds)
def test_the_origin_of_time_does_not_matter(seed: int) -> None:
    start, values = case(seed)
    late = 1e6
    times = np.linspace(0.0, 8.0, 33)
    here = certified(turned("same"), (0.0, 8.0), start, values)
    there = certified(turned("same"), (late, late + 8.0), start, {**values, "t_0": late})
    one, other = here.at(times), there.at(times + late)
    for name in ("x", "y", "d_x", "d_y"):
        # 1e6 + t is rounded by 1e-10
        near(one[name], other[name], 1e-8)
    near(switches(here), switches(there) - late, 1e-8)


@law
@given(seed=seeds)
def test_results_do_not_depend_on_the_tolerance(seed: int) -> None:
    start, values = case(seed)
    times = np.linspace(0.0, 12.0, 61)
    coarse, fine = (
        certified(turned("same"), (0.0, 12.0), start, values, rtol) for rtol in (1e-8, 1e-11)
    )
    for name in ("x", "y", "d_x", "d_y"):
        near(fine.at(times)[name], coarse.at(times)[name], 1e-7)


@law
@given(seed=seeds)
def test_what_is_lost_is_k_times_the_way(seed: int) -> None:
    """E(t) + ∫ k|u| dt + drag − ∫ F·u dt is constant: by quadrature over what the motion says."""
    start, values = case(seed)
    values |= {"wx": 0.0, "wy": 0.0, "F": 0.0, "G": 0.0, "r": 0.0}
    motion = certified(turned("same"), (0.0, 12.0), start, values)
    p = {**{n: q.default for n, q in motion.system.parameters.items()}, **values}
    knots = motion.knots.time
    nodes, weights = np.polynomial.legendre.leggauss(8)
    lengths = np.diff(knots)
    places = (knots[:-1, None] + lengths[:, None] * (nodes + 1) / 2).ravel()
    found = motion.at(places)
    speed = np.hypot(found["d_x"], found["d_y"])
    power = p["s"] * speed + p["e"] * speed**2
    lost = np.sum(power.reshape(-1, 8) * weights * lengths[:, None] / 2)

    def energy(x: float, y: float, v: float, w: float) -> float:
        return float(
            p["m"] / 2 * (v**2 + w**2) + p["A"] / 2 * x**2 + p["B"] * x * y + p["D"] * y**2
        )

    names = ("x", "y", "d_x", "d_y")
    first, last = (energy(*(m[n] for n in names)) for m in (start, motion.final))
    assert first - last == pytest.approx(lost, abs=1e-9)
    # what sticks needs less force than s
    end = motion.final
    assert motion.knots.mode[-1, 0] == 0
    pull = (p["A"] * end["x"] + p["B"] * end["y"], p["B"] * end["x"] + 2 * p["D"] * end["y"])
    assert np.hypot(*pull) <= p["s"]
