"""Functions with kinks, jumps and pieces: values, slopes, texts, and what repeats in them."""

from __future__ import annotations

import math
from collections.abc import Callable

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

import stickslip as ss
from flows import flow, taylor_series
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.problem import pose
from stickslip.motion.steps.arrays import Instant
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.enclosures import bounds
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.formulas import Scope, builtins
from stickslip.symbolic.functions import FUNCTIONS
from stickslip.symbolic.pieces import STRUCTURES, as_call, periodic_form, unwrapped

X = ex.sym("x")
SCOPE = Scope({name: ex.sym(name) for name in ("x", "y", "t", "w", "T")})


def parse(text: str) -> ex.Expr:
    return SCOPE.parse(text, "here")


def smooth(x: Array, low: float, high: float) -> Array:
    s = np.clip((x - low) / (high - low), 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


ORACLES: dict[str, Callable[[Array], Array]] = {
    "floor(x)": np.floor,
    "floor(-3*x + 0.3)": lambda x: np.floor(-3 * x + 0.3),
    "mod(x, 1)": lambda x: np.mod(x, 1.0),
    "mod(x, 2.5)": lambda x: np.mod(x, 2.5),
    "mod(x, -2)": lambda x: np.mod(x, -2.0),
    "sign(x - 0.1)": lambda x: np.sign(x - 0.1),
    "heaviside(0.3 - 2*x)": lambda x: np.heaviside(0.3 - 2 * x, 1.0),
    "square(x)": signal.square,
    "sawtooth(x)": signal.sawtooth,
    "triangle(x)": lambda x: 2 / math.pi * np.arcsin(np.sin(x)),
    "smoothstep(x, -1, 3)": lambda x: smooth(x, -1.0, 3.0),
    "smoothstep(x, 2, 0.5)": lambda x: smooth(x, 2.0, 0.5),
}


@pytest.mark.parametrize("text", ORACLES)
def test_values(text: str) -> None:
    """Against NumPy and SciPy, one by one and together; whole numbers have no rounding errors."""
    places = np.concatenate([np.linspace(-9.37, 11.21, 501), 1e3 + np.linspace(0.1, 9.2, 40)])
    beside = [ORACLES[text](places * (1.0 + share)) for share in (-1e-15, 1e-15)]
    places = places[np.abs(beside[1] - beside[0]) < 0.1]  # not at a jump, up to rounding
    e = parse(text)
    together = evaluator([e], ["x"])(places[None])[0]
    np.testing.assert_allclose(together, ORACLES[text](places), rtol=0, atol=3e-13)
    one_by_one = [ex.evaluate(e, {"x": x}) for x in places.tolist()]
    np.testing.assert_allclose(together, one_by_one, rtol=0, atol=1e-15)
    if text.startswith("floor"):
        assert np.array_equal(together, np.round(together))


@pytest.mark.parametrize("x", [-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 1e6, 1e6 + 1])
def test_at_a_jump_the_value_is_that_from_above(x: float) -> None:
    for text, value in {
        "floor(x)": x,
        "mod(x, 1)": 0.0,
        "floor(x + 0.5)": x,
        "heaviside(x - y)": 1.0,
        "sign(x - y)": 0.0,
    }.items():
        e = parse(text)
        assert ex.evaluate(e, {"x": x, "y": x}) == value
        assert evaluator([e], ["x", "y"])([x, x])[0] == value


def test_numbers_are_worked_out() -> None:
    for text, value in {
        "floor(-2.5)": -3,
        "mod(-7, 3)": 2,
        "mod(5.5, -2)": -0.5,
        "square(4)": -1,
        "sign(-2)": -1,
        "sign(0)": 0,
        "heaviside(0)": 1,
        "smoothstep(1, 0, 2)": 0.5,
    }.items():
        assert parse(text) is ex.num(value)
    assert ex.number(parse("triangle(pi/6)")) == pytest.approx(1 / 3, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("triangle(x)", "4*abs(mod(x/(2*pi) + 0.75, 1) - 0.5) - 1"),
        ("sawtooth(x)", "2*mod(x/(2*pi), 1) - 1"),
        ("square(x)", "1 - 2*floor(mod(x/pi, 2))"),
        ("mod(x, 2)", "x - 2*floor(x/2)"),
        ("smoothstep(x, 0, 1)", "clip(x, 0, 1)**2*(3 - 2*clip(x, 0, 1))"),
        ("sign(x)", "2*heaviside(x) - 1"),
    ],
)
def test_written_by_hand(text: str, same: str) -> None:
    places = np.linspace(-7.1, 8.3, 400)
    one, other = evaluator([parse(text), parse(same)], ["x"])(places[None])
    np.testing.assert_allclose(one, other, atol=1e-13)


# -- slopes and bounds -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text", ["mod(x, 2.5)*x", "triangle(2*x)**2", "x*sawtooth(x)", "smoothstep(x, -1, 3)/(2 + x)"]
)
def test_derivatives_within_a_piece(text: str) -> None:
    e = parse(text)
    for x in (-0.83, 0.42, 1.7):
        h = 1e-5
        slope = (ex.evaluate(e, {"x": x + h}) - ex.evaluate(e, {"x": x - h})) / (2 * h)
        assert ex.evaluate(ex.derivative(e, "x"), {"x": x}) == pytest.approx(slope, abs=1e-7)


def test_bounds_are_tight() -> None:
    """So thresholds that stay positive are seen to."""
    everywhere = {"x": (-math.inf, math.inf)}
    for text, least, most in [
        ("triangle(x)", -1, 1),
        ("square(x)", -1, 1),
        ("sawtooth(x)", -1, 1),
        ("mod(x, 3)", 0, 3),
        ("smoothstep(x, 0, 1)", 0, 1),
    ]:
        assert bounds(parse(text), everywhere) == pytest.approx((least, most), abs=1e-14)
    assert bounds(parse("floor(x)"), {"x": (1.2, 1.9)}) == pytest.approx((1, 1))
    # … to the piece of the same parity below.
    assert bounds(parse("floor(x)"), {"x": (1.2, 4.1)}) == pytest.approx((0, 4))
    assert bounds(parse("triangle(x)"), {"x": (0.1, 0.2)}) == pytest.approx(
        (0.2 / math.pi, 0.4 / math.pi)
    )


# -- texts -----------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.sampled_from(sorted(ORACLES)),
    st.sampled_from(["x", "t - y", "w*t + 0.7", "x**2/3 - 1/7", "T*x/9", "-x"]),
    st.sampled_from(["{} + x", "{}**2/(1 + y**2)", "sin({})*x"]),
)
def test_texts_are_read_as_the_same_function(text: str, inside: str, around: str) -> None:
    e = parse(around.format(text.replace("x", f"({inside})")))
    again = parse(ex.to_text(e))
    values = dict.fromkeys("xytwT", 0.0) | {"x": 0.71, "y": -0.4, "t": 2.3, "w": 1.9, "T": 1.7}
    assert ex.evaluate(again, values) == pytest.approx(ex.evaluate(e, values), abs=1e-12)
    assert "wrap" not in ex.to_text(e) and "ease" not in ex.to_text(e)


def test_they_keep_their_names() -> None:
    for text in ("floor(x/T)", "square(w*t)", "triangle(w*t - y)", "smoothstep(x, 0, 1)"):
        assert ex.to_text(parse(text)).startswith(text[:5])
        assert as_call(parse(text)) is not None
    assert ex.to_text(parse("mod(x, 1)")) == "mod(x, 1)"
    assert as_call(parse("abs(x)")) is None
    (guard,) = (e.args[0] for e in ex.walk([parse("floor(x)")]) if e.op == "select")
    assert unwrapped(guard) is ex.call("sin", math.pi * X)


def test_equations_for_people() -> None:
    system = ss.System(
        "s",
        parameters={"T": ss.Parameter(2.0), "w": ss.Parameter(1.0)},
        coordinates={"x": ss.Viscous(force="floor(x)*sign(x) + mod(t, T)")},
        potential="T*triangle(w*x) + smoothstep(x, 0, T)",
        viscous="d_x**2/2",
    )
    shown, latex = str(system.equations()), str(system.equations(latex=True))
    assert "⌊x⌋ sgn(x)" in shown and "mod(t, T)" in shown and "square(w x + ½ π)" in shown
    assert r"\left\lfloor x \right\rfloor" in latex and r"\operatorname{sgn}(x)" in latex


# -- what a user gets wrong ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("floor(x, 2)", r"'floor' takes 1 argument\(s\), got 2. Write floor\(x\)"),
        ("mod(x)", r"Write mod\(x, m\)"),
        ("smoothstep(x)", r"Write smoothstep\(x, low, high\)"),
        ("heavyside(x)", "Did you mean 'heaviside'"),
        ("arcsin(x)", "Did you mean 'asin'"),
        ("ln(x)", r"Write log\(x\)"),
        ("ceil(x)", r"Write -floor\(-x\)"),
        ("x % 2", r"'%' is not an operator of formulas. Write mod\(x, m\)"),
        ("x // 2", r"Write floor\(x/y\)"),
        ("mod(x, 0)", "modulo 0 is undefined"),
        ("log(-1)", r"log\(-1\) is undefined"),
        ("log1p(-2)", r"log1p\(-2\) is undefined"),
        ("asin(1.5)", r"asin\(1.5\) is undefined"),
        ("wrap(x)", "unknown function 'wrap'"),
        ("ease(x)", "unknown function 'ease'"),
        ("square", r"'square' is a function. Write square\(...\)"),
    ],
)
def test_refused(text: str, says: str) -> None:
    with pytest.raises(DeclarationError, match=says):
        parse(text)


def of_data(row: str) -> bool:
    """Whether a row is that of samples or of a table that were made before."""
    return row.startswith(("samples_", "table_"))


def test_names_are_taken() -> None:
    with pytest.raises(DeclarationError, match="'square' has a fixed meaning"):
        ss.System("s", parameters={"square": ss.Parameter(1.0)}, internal={"a": ss.Internal("a")})
    made_of = {row for row in FUNCTIONS if FUNCTIONS[row].typed and not of_data(row)}
    assert made_of - STRUCTURES.keys() == {"wrap", "ease"}
    assert builtins().keys() >= STRUCTURES.keys()


def mechanical(force: str = "0", potential: str = "0", drag: str = "0") -> ss.System:
    return ss.System(
        "m",
        parameters={"mu": ss.Parameter(0.3), "V": ss.Parameter(0.5)},
        functions={"law(v)": "mu*sign(v)"},
        coordinates={"x": ss.Inertial(force=force, drag=drag)},
        kinetic="d_x**2/2",
        potential=potential,
    )


@pytest.mark.parametrize(
    "given",
    [
        {"force": "-mu*sign(d_x)"},
        {"force": "mu*sign(V - d_x)*(1 + x**2)"},
        {"force": "-law(d_x)"},
        {"force": "-heaviside(d_x - V)"},
        {"drag": "mu*sign(d_x)"},
        {"drag": "d_x + mu*square(d_x)"},
    ],
)
def test_a_force_that_jumps_against_a_rate_is_friction(given: dict[str, str]) -> None:
    with pytest.raises(DeclarationError, match=r"this is dry friction.*contact with a direction"):
        mechanical(**given)


def test_forces_that_only_turn_with_a_rate_are_none() -> None:
    mechanical(force="-d_x**2*sign(d_x)", drag="d_x*abs(d_x)*mu")
    mechanical(force="heaviside(x) + mu*sign(d_x)")  # pushes on, holds nothing


@pytest.mark.parametrize("energy", ["mu*heaviside(x)", "mod(x, V)**2", "sawtooth(x)*V", "floor(x)"])
def test_an_energy_may_not_jump(energy: str) -> None:
    with pytest.raises(DeclarationError, match="potential: the energy jumps with x where"):
        mechanical(potential=energy)
    with pytest.raises(DeclarationError, match="x - 1 = 0"):
        mechanical(potential="piecewise(x < 1, 0, x)")


def test_energies_that_only_bend() -> None:
    mechanical(potential="x**2*heaviside(x) + (x - V)**2*heaviside(x - V) + abs(x) + x*square(x)")
    mechanical(potential="V*triangle(x/V) + mod(x, V)*(V - mod(x, V)) + heaviside(t - 1)*x")


# -- what repeats ----------------------------------------------------------------------------------


def test_periods_are_seen_in_formulas() -> None:
    fraction = parse("mod(t/T, 1)")
    assert periodic_form(parse("floor(t/T)")) is periodic_form(parse("t/T") - fraction)
    (rate,) = {ex.frequency(e) for e in ex.walk([periodic_form(fraction)])} - {None}
    assert rate is parse("pi/T")
    # A phase that jumps has a constant rate all the same, and does not go on.
    assert ex.frequency(parse("sin(w*mod(t, T))")) is None
    assert ex.frequency(parse("sin(w*t)")) is parse("w")


# -- series ----------------------------------------------------------------------------------------

INSIDE = "(0.3 + 0.4*sin(1.3*t))"
SERIES: dict[str, Callable[..., object]] = {
    f"floor(5*{INSIDE})": lambda u: mp.floor(5 * u),
    f"mod({INSIDE}, 0.23)": lambda u: u - mp.mpf(0.23) * mp.floor(u / mp.mpf(0.23)),
    f"triangle(7*{INSIDE})": lambda u: 2 * mp.asin(mp.sin(7 * u)) / mp.pi,
    f"sawtooth(-9*{INSIDE})": lambda u: -9 * u / mp.pi - 2 * mp.floor(-9 * u / (2 * mp.pi)) - 1,
    f"smoothstep({INSIDE}, 0.1, 2)": lambda u: (
        (u - mp.mpf(0.1)) ** 2 * (3 - 2 * (u - mp.mpf(0.1)) / mp.mpf(1.9)) / mp.mpf(1.9) ** 2
    ),
    f"sign({INSIDE} - 0.2)": lambda u: mp.sign(u - mp.mpf(0.2)),
    f"log1p({INSIDE})": mp.log1p,
    f"expm1({INSIDE})": mp.expm1,
    f"asin({INSIDE})": mp.asin,
    f"acos({INSIDE})": mp.acos,
}


def test_series_of_machine_code() -> None:
    """Taylor coefficients in the piece where the argument is, against mpmath's."""
    names = [f"x{i}" for i in range(len(SERIES))]
    p = pose(flow(dict(zip(names, SERIES, strict=True))))
    work = p.flow()
    n = len(SERIES)
    t = 0.4
    equations = p.compiled.equations
    reg = np.array([ex.evaluate(g, {"t": t}) >= 0.0 for g in equations.kinks], np.int64)
    none = np.zeros(0, np.int64)
    resolve(p.rows, p.constants, work.space, none)
    work.space.W[n, 1] = 1.0
    taylor_series(p.machine, work, Instant(t, np.zeros(n), none, reg), p.order, work.space.W)
    with mp.workdps(40):
        for i, (text, function) in enumerate(SERIES.items()):
            exact = mp.taylor(
                lambda s, f=function: f(mp.mpf(0.3) + mp.mpf(0.4) * mp.sin(mp.mpf(1.3) * s)),
                mp.mpf(t),
                p.order - 1,
            )
            series = work.space.W[i, 1 : p.order + 1] * np.arange(1, p.order + 1)
            scale = np.maximum.accumulate(np.abs(np.array(exact, dtype=float)[::-1]))[::-1]
            assert np.all(np.abs(series - np.array(exact, dtype=float)) <= 1e-12 * (scale + 1)), (
                text
            )


@pytest.mark.parametrize("text", ["triangle(x)", "sawtooth(x)", "mod(x, 1)", "square(x)"])
def test_waves_of_large_arguments_stay_in_their_range(text: str) -> None:
    """Which piece an argument is in is asked of the same rounded number of turns as where it is in
    the piece."""
    f = parse(text)
    peaks = math.pi * (np.random.default_rng(0).integers(0, 2**40, 500) + 0.5)
    late = [*peaks, *(m * 2.0**n for n in range(40, 1024, 7) for m in (1.0, 1.3, math.pi / 2))]
    values = [ex.evaluate(f, {"x": sign * x}) for x in late for sign in (1.0, -1.0)]
    assert all(-1.0 <= value <= 1.0 for value in values)
