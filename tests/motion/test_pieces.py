"""Motions through kinks, jumps and pieces, against closed forms from piece to piece."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import stickslip as ss
from oracles import crawler
from stickslip import Outcome
from systems import distance

pytestmark = pytest.mark.usefixtures("flow")

W, T, END = 1.3, 1.7, 25.0


def oscillator(force: str, **more: object) -> ss.System:
    """x'' + x = f, in which the force may depend on time and place."""
    return ss.System(
        "oscillator",
        parameters={"w": ss.Parameter(W), "T": ss.Parameter(T)},
        coordinates={"x": ss.Inertial(force=force)},
        kinetic="d_x**2/2",
        potential="x**2/2",
        initial={"x": 0.4, "d_x": -0.1},
        **more,  # type: ignore[arg-type]
    )


def piece_by_piece(
    ends: list[float], line: Callable[[float], tuple[float, float]], times: np.ndarray
) -> np.ndarray:
    """x'' + x = a + b (t − start) on each piece; `line` gives a and b in the middle of one."""
    x, v = 0.4, -0.1
    found = np.empty(len(times))
    for start, end in pairwise(ends):
        a, b = line(0.5 * (start + end))
        a -= b * 0.5 * (end - start)

        def at(s: np.ndarray | float, a=a, b=b, x=x, v=v) -> tuple:
            return (
                a + b * s + (x - a) * np.cos(s) + (v - b) * np.sin(s),
                b - (x - a) * np.sin(s) + (v - b) * np.cos(s),
            )

        inside = (times >= start) & (times <= end)
        found[inside] = at(times[inside] - start)[0]
        x, v = at(end - start)
    return found


def ends_of(first: float, distance: float) -> list[float]:
    places = np.arange(first, END, distance)
    return [0.0, *places[places > 0.0].tolist(), END]


HALF = math.pi / W
LOADS: dict[str, tuple[list[float], Callable[[float], tuple[float, float]]]] = {
    "square(w*t)": (ends_of(0.0, HALF), lambda t: (math.copysign(1.0, math.sin(W * t)), 0.0)),
    "triangle(w*t)": (
        ends_of(HALF / 2, HALF),
        lambda t: (
            2 / math.pi * math.asin(math.sin(W * t)),
            math.copysign(2 * W / math.pi, math.cos(W * t)),
        ),
    ),
    "sawtooth(w*t)": (
        ends_of(0.0, 2 * HALF),
        lambda t: (2 * math.fmod(W * t / (2 * math.pi), 1.0) - 1, W / math.pi),
    ),
    "mod(t + 0.3, T)": (ends_of(T - 0.3, T), lambda t: (math.fmod(t + 0.3, T), 1.0)),
    "floor(t/T)": (ends_of(0.0, T), lambda t: (math.floor(t / T), 0.0)),
    "heaviside(t - T) - sign(t - 3*T)": (
        [0.0, T, 3 * T, END],
        lambda t: (float(t > T) - math.copysign(1.0, t - 3 * T), 0.0),
    ),
}


@pytest.mark.parametrize("load", LOADS)
def test_loads_from_piece_to_piece(load: str) -> None:
    ends, line = LOADS[load]
    motion = ss.simulate(oscillator(load), (0.0, END))
    assert motion.outcome.ok and motion.certificate.ok, motion.certificate.verdict
    times = np.linspace(0.0, END, 401)
    assert distance(motion.at(times)["x"], piece_by_piece(ends, line, times)) < 2e-10
    assert motion.events["time"].to_numpy() == pytest.approx(ends[1:-1], abs=1e-12)


def test_a_smooth_step() -> None:
    """x'' + x = s²(3 − 2s) has a polynomial solution, and free ones."""
    low, high = 3.0, 5.5
    motion = ss.simulate(oscillator(f"smoothstep(t, {low}, {high})"), (0.0, END))
    assert motion.certificate.ok and len(motion.events) == 2
    h = high - low
    s = np.polynomial.Polynomial([-low / h, 1 / h])
    step = s**2 * (3 - 2 * s)
    particular = step - step.deriv(2)
    state = np.array([0.4, -0.1])

    def turned(y: np.ndarray, t: float) -> np.ndarray:
        return np.array([[math.cos(t), math.sin(t)], [-math.sin(t), math.cos(t)]]) @ y

    def on(t: float) -> np.ndarray:
        return np.array([particular(t), particular.deriv()(t)])

    state = turned(state, low) - on(low)
    state = turned(state, h) + on(high) - np.array([1.0, 0.0])
    last = turned(state, END - high) + np.array([1.0, 0.0])
    assert [motion.final["x"], motion.final["d_x"]] == pytest.approx(last.tolist(), abs=2e-10)


def test_results_do_not_depend_on_how_it_is_written() -> None:
    ways = (
        "triangle(w*t)",
        "4*abs(mod(w*t/(2*pi) + 0.75, 1) - 0.5) - 1",
        "(pi/2 - abs(mod(w*t + pi/2, 2*pi) - pi))*2/pi",
        "piecewise(cos(w*t) >= 0, 1, -1)*(mod(w*t/pi + 0.5, 1)*2 - 1)",
        "2/pi*asin(0.999999999999*sin(w*t))",  # an arc sine without its kinks, nearly
    )
    x = []
    for force in ways:
        motion = ss.simulate(oscillator(force), (0.0, END), rtol=1e-9)
        assert motion.certificate.ok, (force, motion.certificate.verdict)
        x.append(motion.at(np.linspace(0.0, END, 50))["x"])
    for other in x[1:-1]:
        assert distance(other, x[0]) < 1e-9
    assert distance(x[-1], x[0]) < 1e-5


def test_late_is_as_good_as_early() -> None:
    early = ss.simulate(oscillator("mod(t, T) + triangle(2*pi*t/T)"), (0.0, 20.0))
    late = ss.simulate(
        oscillator("mod(t, T) + triangle(2*pi*t/T)"), (T * 2.0**30, T * 2.0**30 + 20.0)
    )
    assert late.certificate.ok
    assert late.final["x"] == pytest.approx(early.final["x"], abs=1e-6)


# -- pieces of the place ---------------------------------------------------------------------------


def test_a_step_of_the_force() -> None:
    """Against a constant force from x = 0 on, and back."""
    system = ss.System(
        "thrown",
        coordinates={"x": ss.Inertial(force="-heaviside(x)")},
        kinetic="d_x**2/2",
        initial={"x": -1.0, "d_x": 1.0},
    )
    motion = ss.simulate(system, (0.0, 6.0))
    assert motion.certificate.ok
    assert motion.events["time"].tolist() == pytest.approx([1.0, 3.0], abs=1e-12)
    assert motion.at(2.0)["x"] == pytest.approx(0.5, abs=1e-12)
    assert motion.final["x"] == pytest.approx(-3.0, abs=1e-12)


def staircase(x: float, v: float, end: float) -> tuple[float, float, int]:
    """x'' = −⌊x⌋ from parabola to parabola."""
    n, crossed, t = math.floor(x), 0, 0.0
    while True:
        hits = []
        for wall, side in ((n, -1), (n + 1, 1)):
            roots = np.roots([-n / 2, v, x - wall]) if n else [(wall - x) / v]
            # leaving through a wall: the rate there points outwards
            hits += [
                (s, side)
                for s in (float(r.real) for r in np.atleast_1d(roots) if abs(r.imag) < 1e-14)
                if s > 1e-12 and (v - n * s) * side > 0
            ]
        s, side = min(hits)
        if t + s > end:
            s = end - t
            return x + v * s - n * s * s / 2, v - n * s, crossed
        x, v, t = (n if side < 0 else n + 1), v - n * s, t + s
        n += side
        crossed += 1


def test_a_staircase_of_the_place() -> None:
    system = ss.System(
        "stairs",
        coordinates={"x": ss.Inertial(force="-floor(x)")},
        kinetic="d_x**2/2",
        initial={"x": 0.35, "d_x": 2.7},
    )
    motion = ss.simulate(system, (0.0, 30.0))
    x, v, crossed = staircase(0.35, 2.7, 30.0)
    assert motion.certificate.ok and motion.n_kinks == crossed > 20
    assert [motion.final["x"], motion.final["d_x"]] == pytest.approx([x, v], abs=1e-9)


def test_a_corrugated_energy() -> None:
    """A rolling particle in a triangle potential: energy is kept, and the force is ±a."""
    system = ss.System(
        "corrugated",
        parameters={"a": ss.Parameter(0.3)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="a*triangle(pi*x)/2",
        initial={"d_x": 1.0},
    )
    motion = ss.simulate(system, (0.0, 12.0))
    assert motion.certificate.ok
    rise = math.sqrt(1 - 0.3)
    # from x = 0 up to 1/2, then down over a whole period: each stretch at a constant force
    stretch = 2 * 0.5 / (1.0 + rise)
    assert motion.events["time"].iloc[0] == pytest.approx(stretch, abs=1e-12)
    down = 2 * 1.0 / (rise + math.sqrt(1 + 0.3))
    assert motion.events["time"].iloc[1] == pytest.approx(stretch + down, abs=1e-12)


# -- friction --------------------------------------------------------------------------------------


def test_a_shaken_normal_force() -> None:
    """A block under a constant pull, held half of the time: F > s only in every other half."""
    system = ss.System(
        "shaken",
        parameters={"w": ss.Parameter(2 * math.pi)},
        coordinates={"x": ss.Viscous(force="1")},
        viscous="d_x**2/2",
        contacts={"ground": ss.Contact("d_x", "1 + 0.5*square(w*t)")},
    )
    motion = ss.simulate(system, (0.0, 10.0))
    assert motion.certificate.ok
    assert motion.final["x"] == pytest.approx(10 * 0.5 * 0.5, abs=1e-12)
    assert motion.n_switches >= 19


@pytest.mark.parametrize(("f_plus", "f_minus"), [(0.3, 0.8), (1.9, 5.0)])
def test_a_piecewise_linear_gait(f_plus: float, f_minus: float) -> None:
    D, k, cycles = 4.0, 1.0, 6
    system = ss.catalogue.two_leg_crawler(L="D/2*triangle(omega*t)")
    values = {"D": D, "k": k, "f_plus": f_plus, "f_minus": f_minus}
    t = np.linspace(0.0, 2 * math.pi * cycles, 40 * cycles + 1)
    motion = ss.simulate(system, (0.0, float(t[-1])), parameters=values)
    assert motion.certificate.ok
    x_1, x_2 = crawler.simulate(D / math.pi * np.arcsin(np.sin(t)), k, f_plus, f_minus)
    assert distance(motion.at(t)["x_1"], x_1) < 1e-11
    assert distance(motion.at(t)["x_2"], x_2) < 1e-11
    step = crawler.net_displacement(D, k, f_plus, f_minus)
    each = motion.at(2 * math.pi * np.arange(1, cycles))
    assert np.diff(each["x_1"]) == pytest.approx(step, abs=1e-11)


# -- ends ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("force", "start", "wall"),
    [
        ("-0.1*log(1 - x)", 0.0, 1.0),
        ("0.1*log1p(-x/2)", 1.0, 2.0),
        ("asin(x)", 0.2, 1.0),
        ("acos(x/2)", 1.5, 2.0),
    ],
)
def test_what_leaves_its_domain_ends_by_name(force: str, start: float, wall: float) -> None:
    system = ss.System(
        "wall",
        coordinates={"x": ss.Inertial(force=force)},
        kinetic="d_x**2/2",
        initial={"x": start, "d_x": 1.5},
    )
    motion = ss.simulate(system, (0.0, 10.0))
    assert motion.outcome in (Outcome.UNDEFINED, Outcome.STEP_TOO_SMALL)
    assert not motion.certificate.ok and math.isfinite(motion.final["x"])
    assert motion.final["x"] == pytest.approx(wall, abs=1e-6)


def test_a_start_outside_the_domain() -> None:
    system = ss.System("s", internal={"a": ss.Internal("log(a)")}, initial={"a": -1.0})
    assert ss.simulate(system, (0.0, 1.0)).outcome is Outcome.UNDEFINED


@pytest.mark.parametrize("period", np.random.default_rng(1).uniform(0.3, 0.9, 12).tolist())
def test_conditions_on_what_is_left_over(period: float) -> None:
    """A belt that stops and goes, whatever its period: the same as written with the whole part."""
    share = 0.4
    texts = (
        f"piecewise(mod(t, {period}) < {share * period}, mod(t, {period}), 0)",
        f"piecewise(t/{period} - floor(t/{period}) < {share}, t - {period}*floor(t/{period}), 0)",
    )
    ends = []
    for text in texts:
        motion = ss.simulate(
            ss.System(
                "belt",
                drives={"w": text},
                coordinates={"z": ss.Inertial()},
                kinetic="d_z**2/2",
                potential="2*z**2",
                contacts={"pad": ss.Contact("d_z", 3.0, "w", kinetic=2.0)},
                span=(0.0, 2.0),
            )
        )
        assert motion.outcome.ok
        assert motion.certificate.ok
        ends.append(list(motion.final.values()))
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-9)


def test_a_law_that_is_piecewise_in_the_speed() -> None:
    """Steady sliding on a belt, x = μ(V)/k, in every piece, by all that looks at equilibria."""
    law = "piecewise(v < 0.1, 1 - 2*v, v < 0.5, 0.85 - v/2, 0.6)"
    system = ss.System(
        "brake",
        parameters={"V": ss.Parameter(0.3)},
        functions={"mu(v)": law},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="x**2",
        viscous="d_x**2",
        contacts={"pad": ss.Contact("d_x", "mu(0)", "V", kinetic="mu(speed)")},
        initial={"x": 0.3},
    )
    for speed, mu in ((0.05, 0.9), (0.3, 0.7), (0.8, 0.6)):
        found = ss.equilibria(system, parameters={"V": speed})
        places = [e.state["x"] for e in found.isolated]
        assert places == pytest.approx([mu / 2.0], abs=1e-12)
        here = {"x": 0.0, "d_x": 0.0, "V": speed}
        rates = ss.vector_field(system, {"pad": "slip-"}, at=here).rates_at(here)
        assert rates["d_x"] == pytest.approx(mu)
    assert ss.continue_equilibrium(system, "V", (0.02, 1.0)) is not None


@pytest.mark.parametrize("edges", [("t - 1", 1e-3), ("t - 1.1", 1e-5), ("t - 1.1", 1e-7)])
def test_dead_zones_and_narrow_ramps(edges: tuple[str, float]) -> None:
    """Certified, whichever way they are written."""
    begins, width = edges
    u = "3*sin(t)"
    for load in (f"clip(({begins})/{width}, 0, 1)", f"({u}) - clip({u}, -2, 2)"):
        for force, belt in ((f"2*({load})", "0"), ("0", load)):
            motion = ss.simulate(
                ss.System(
                    "load",
                    drives={"w": belt},
                    coordinates={"x": ss.Inertial(force=force)},
                    kinetic="d_x**2/2",
                    potential="x**2/2",
                    contacts={"c": ss.Contact("d_x", 1.0, "w", kinetic=0.7)},
                    span=(0.0, 5.0),
                )
            )
            assert motion.certificate.ok, (load, belt, motion.certificate.verdict)


@cache
def ramped(text: str, where: str) -> ss.System:
    """A block on rough ground under a load, or on a belt, that changes within a time w."""
    load, belt = (text, "0") if where == "load" else ("0", text)
    names = ("begin", "w", "A", "B", "mu")
    return ss.System(
        "ramp",
        parameters={name: ss.Parameter(1.0) for name in names},
        drives={"v": belt},
        coordinates={"x": ss.Inertial(force=load)},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"c": ss.Contact("d_x", "mu", "v")},
        span=(0.0, 5.0),
    )


@pytest.mark.parametrize("where", ["load", "belt"])
@pytest.mark.parametrize("ramp", ["smoothstep(t, begin, begin + w)", "clip((t - begin)/w, 0, 1)"])
def test_ramps_of_any_width(ramp: str, where: str) -> None:
    """Down to a few rounding errors of the time, where a force may pass its threshold within one:
    certified, and a jump but for the width."""
    rng = np.random.default_rng(5)
    jump = ramped("B + A*heaviside(t - begin)", where)
    for i in range(40):
        p = {"begin": 0.0 if i % 8 == 0 else rng.uniform(0.2, 2.0)}
        p |= {"w": 10.0 ** rng.uniform(-9.0, -3.0), "A": rng.uniform(0.3, 1.0)}
        p |= {"B": float(rng.choice([0.0, 0.2])), "mu": rng.uniform(0.1, 0.4)}
        motion = ss.simulate(ramped(f"B + A*{ramp}", where), parameters=p)
        assert motion.outcome.ok, (p, motion.message)
        assert motion.certificate.ok, (p, motion.certificate.verdict)
        limit = ss.simulate(jump, parameters=p).final
        assert motion.final["x"] == pytest.approx(limit["x"], abs=3.0 * p["w"] + 1e-11)


@pytest.mark.parametrize("k", [-0.5, 0.0, 0.5])
def test_a_branch_that_a_parameter_decides(k: float) -> None:
    """A potential that tends to a line, (1 − exp(−kx))/k: at k = 0 the other branch is divided by
    0, and the condition is strict."""
    system = ss.System(
        "limit",
        parameters={"k": ss.Parameter(k)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="piecewise(k > 0, (1 - exp(-k*x))/k, k < 0, x, x)",
        contacts={"c": ss.Contact("d_x", "piecewise(k >= 0, 0.2, 0.3)")},
        span=(0.0, 1.0),
    )
    motion = ss.simulate(system)
    assert motion.certificate.ok
    if k <= 0.0:
        net = 1.0 - (0.2 if k == 0.0 else 0.3)
        assert motion.final["x"] == pytest.approx(-0.5 * net, rel=1e-9)
