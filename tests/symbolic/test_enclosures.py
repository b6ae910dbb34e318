"""Interval arithmetic on expression trees: no value leaves its enclosure, to the last digit."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import between, enclosures, slopes
from stickslip.symbolic.enclosures import bounds, joins, sure_sign
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Scope
from stickslip.symbolic.pieces import STRUCTURES

NAMES = ("x", "y")
SCOPE = Scope({name: ex.sym(name) for name in (*NAMES, "a", "b")})
ROWS = sorted(name for name, row in ex.FUNCTIONS.items() if not row.typed)
PIECES = ("floor", "mod", "square", "triangle", "sawtooth", "sign", "heaviside", "smoothstep")
UNDEFINED = (ValueError, ZeroDivisionError, OverflowError, TypeError)


def parse(text: str) -> Expr:
    return SCOPE.parse(text, "here")


def made(name: str, x: Expr) -> Expr:
    """A function of x; of further arguments whatever they are by default."""
    others = {"mod": (1.7,), "smoothstep": (-0.4, 1.3)}.get(name, ())
    return STRUCTURES[name].made(x, *map(ex.num, others))


# -- random trees and boxes ------------------------------------------------------------------------

COEFFICIENTS = st.sampled_from([1.0, -1.0, 2.0, 0.5, -3.0, 0.1, 1e-7, 1e5, math.pi, -0.7632])
EXPONENTS = st.sampled_from([2.0, 3.0, 4.0, 5.0, -1.0, -2.0, -3.0, 0.5, 1.5, -0.5, 1 / 3])


def _compound(inner: st.SearchStrategy[Expr]) -> st.SearchStrategy[Expr]:
    return st.one_of(
        st.tuples(inner, COEFFICIENTS, inner, COEFFICIENTS, COEFFICIENTS).map(
            lambda p: ex.add((p[0], p[1]), (p[2], p[3]), (ex.ONE, p[4]))
        ),
        st.tuples(inner, inner).map(lambda p: p[0] * p[1]),
        st.tuples(inner, EXPONENTS).map(lambda p: ex.power(p[0], ex.num(p[1]))),
        st.tuples(st.sampled_from(ROWS), inner).map(lambda p: ex.call(*p)),
        st.tuples(st.sampled_from(PIECES), inner).map(lambda p: made(*p)),
        st.tuples(inner, inner).map(lambda p: ex.power(p[0] * p[0] + 0.25, p[1])),
        inner.map(ex.absolute),
        st.tuples(st.sampled_from([ex.maximum, ex.minimum]), inner, inner).map(
            lambda p: p[0](p[1], p[2])
        ),
        st.tuples(inner, COEFFICIENTS).map(
            lambda p: ex.clip(p[0], ex.num(-abs(p[1])), ex.num(abs(p[1])))
        ),
        st.tuples(inner, inner, inner, st.booleans()).map(lambda p: ex.select(*p[:3], strict=p[3])),
    )


LEAVES = st.sampled_from([ex.sym("x"), ex.sym("y"), ex.num(0.3)])


@st.composite
def trees(draw: st.DrawFn) -> Expr:
    try:
        return draw(st.recursive(LEAVES, _compound, max_leaves=7))
    except UNDEFINED:  # such as log(0.3 - 1)
        return draw(LEAVES)


ENDS = st.one_of(
    st.floats(-3, 3), st.floats(-1e3, 1e3), st.sampled_from([0.0, 1.0, -1.0, math.pi, 1e-9, -1e-9])
)
WIDTHS = st.sampled_from([0.0, 1e-12, 1e-6, 1e-2, 0.3, 1.0, 7.0])
SEEDS = st.integers(0, 2**32 - 1)
Mpf = Any  # mpmath.mpf: no type checker can tell what it is


def exact(e: Expr, point: dict[str, float]) -> Mpf | None:
    """The value in 60 digits, from the tree alone; None where it is undefined or beyond floating
    point."""
    known: dict[Expr, Mpf] = {}
    try:
        for node in ex.walk([e]):
            value = _exact(node, point, known)
            if (
                isinstance(value, mpmath.mpc)
                or not mpmath.isfinite(value)
                or abs(value) > mpmath.mpf(10) ** 300
            ):
                return None
            known[node] = value
    except UNDEFINED:
        return None
    return known[e]


def _exact(e: Expr, point: dict[str, float], known: dict[Expr, Mpf]) -> Mpf:
    match e.op:
        case "num":
            return mpmath.mpf(ex.number(e))
        case "sym":
            return mpmath.mpf(point[str(e.value)])
        case "sum":
            return mpmath.mpf(float(e.value)) + mpmath.fsum(
                mpmath.mpf(c) * known[term] for term, c in e.terms
            )
        case "prod":
            return mpmath.fprod(mpmath.power(known[base], mpmath.mpf(p)) for base, p in e.terms)
        case "pow":
            return mpmath.power(known[e.args[0]], known[e.args[1]])
        case "select":
            guard, above, below = (known[a] for a in e.args)
            return above if guard > 0 or (guard == 0 and not e.strict) else below
        case "wrap":
            return known[e.args[0]] - mpmath.floor(known[e.args[0]] + 0.5)
        case "ease":
            return known[e.args[0]] ** 2 * (3 - 2 * known[e.args[0]])
        case _:
            return getattr(mpmath, e.op)(known[e.args[0]])


@settings(max_examples=400, deadline=None, derandomize=True)
@given(trees(), ENDS, WIDTHS, ENDS, WIDTHS, SEEDS)
def test_no_value_leaves_its_enclosure(
    e: Expr, x: float, wx: float, y: float, wy: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    boxes = {"x": (x, x + wx), "y": (y, y + wy)}
    both = [bounds(e, boxes), enclosures([e], boxes)[0][:, 0]]
    low, high = max(a for a, _ in both), min(b for _, b in both)
    assert all(a <= b and a < math.inf and b > -math.inf for a, b in both)
    with mpmath.workdps(60):
        for u, v in [(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), *rng.uniform(size=(9, 2)).tolist()]:
            point = {"x": min(x + u * wx, x + wx), "y": min(y + v * wy, y + wy)}
            value = exact(e, point)
            if value is not None:
                assert low <= value <= high, (point, value)


@settings(max_examples=400, deadline=None, derandomize=True)
@given(trees(), ENDS, WIDTHS, ENDS, SEEDS)
def test_no_quotient_leaves_the_slope(e: Expr, x: float, width: float, y: float, seed: int) -> None:
    """(f(v) − f(u))/(v − u), kinks and jumps included; and f lies between the lines from the
    ends."""
    if width == 0.0:
        return
    places = np.sort(
        np.concatenate([[x, x + width], np.random.default_rng(seed).uniform(x, x + width, 8)])
    )
    ((_, slope),) = slopes([e], {"x": (x, x + width), "y": (y, y)}, "x")
    assert slope[0, 0] <= slope[1, 0] and not np.isnan(slope).any()
    ends = enclosures([e], {"x": (places[[0, -1]], places[[0, -1]]), "y": (y, y)})[0]
    ends = np.broadcast_to(ends, (2, 2))
    lines = between(
        ends[:, :1], ends[:, 1:], slope, np.nextafter(places[-1:] - places[:1], math.inf)
    )
    with mpmath.workdps(60):
        values = [exact(e, {"x": u, "y": y}) for u in places.tolist()]
        known = [value for value in values if value is not None]
        if len(known) < len(values):
            return
        for u, v, f, g in zip(places.tolist(), places[1:].tolist(), known, known[1:], strict=False):
            if v > u:
                step = mpmath.mpf(v) - u
                noise = (abs(f) + abs(g)) * mpmath.mpf(10) ** -50
                assert slope[0, 0] * step - noise <= g - f <= slope[1, 0] * step + noise
        assert all(lines[0, 0] <= f <= lines[1, 0] for f in known)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(trees(), ENDS, WIDTHS, ENDS, WIDTHS, SEEDS)
def test_smaller_boxes_have_smaller_enclosures(
    e: Expr, x: float, wx: float, y: float, wy: float, seed: int
) -> None:
    """Inclusion is isotonic, but for the rounding of functions."""
    cuts = np.sort(np.random.default_rng(seed).uniform(size=(2, 2, 6)), axis=1)
    ranges = {"x": tuple(x + wx * cuts[0]), "y": tuple(y + wy * cuts[1])}
    low, high = enclosures([e], {"x": (x, x + wx), "y": (y, y + wy)})[0][:, 0]
    inside = np.broadcast_to(enclosures([e], ranges)[0], (2, 6))
    slack = 1e-13 * np.abs(inside)
    assert np.all(inside[0] >= low - slack[0]) and np.all(inside[1] <= high + slack[1])


@pytest.mark.parametrize(
    "text",
    [
        "exp(-x)*sin(5*x)",
        "x/(1 + x**2)",
        "abs(x - 1.03)*cos(x)",
        "tanh(3*(x - 1))/cosh(x)",
        "x**x",
        "sqrt(x)*log(x)",
    ],
)
def test_order_of_convergence(text: str) -> None:
    """The natural enclosure is off by the width of a box, that from ends and slopes by its
    square."""
    e = parse(text)
    centres = np.linspace(0.9, 1.2, 40)
    fine = np.linspace(0.0, 1.0, 401)[:, None]
    off = []
    for width in (1e-2, 1e-3, 1e-4):
        x = centres, centres + width
        ((natural, slope),) = slopes([e], {"x": x}, "x")
        start, end = (enclosures([e], {"x": (at, at)})[0] for at in x)
        lines = between(start, end, slope, np.full(40, width))
        places = (centres + width * fine).ravel()
        least = (
            enclosures([e], {"x": (places, places)})[0]
            .mean(axis=0)
            .reshape(fine.size, 40)
            .min(axis=0)
        )
        off.append([float(np.max(least - found[0])) for found in (natural, lines)])
        assert off[-1][1] <= 20.0 * width**2 + 1e-14
    assert np.diff(np.log10(off), axis=0)[:, 0].mean() < -0.9


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("sin(x)", (math.sin(1.0), 1.0)),
        ("cos(x)", (math.cos(2.0), math.cos(1.0))),
        ("tan(x)", (-math.inf, math.inf)),
        ("log(x)", (0.0, math.log(2.0))),
        ("log(x - 1.5)", (-math.inf, math.log(0.5))),
        ("1/(x - 1)", (1.0, math.inf)),
        ("1/(x - 1.5)", (-math.inf, math.inf)),
        ("(x - 1.5)**-2", (4.0, math.inf)),
        ("(x - 1.5)**2", (0.0, 0.25)),
        ("(x - 1.5)**3", (-0.125, 0.125)),
        ("sqrt(x - 1.5)", (0.0, math.sqrt(0.5))),
        ("x**y", (1.0, 8.0)),
        ("cosh(x - 1.5)", (1.0, math.cosh(0.5))),
        ("asinh(x)", (math.asinh(1.0), math.asinh(2.0))),
        ("atan(1e300*x)", (math.atan(1e300), math.pi / 2)),
        ("exp(1000*x)", (np.finfo(float).max, math.inf)),
        ("exp(-1000*x)", (0.0, 0.0)),
        ("abs(x - 1.5)", (0.0, 0.5)),
        ("clip(x, 1.2, 1.6)", (1.2, 1.6)),
        ("piecewise(x < 1.5, x, 5)", (1.0, 5.0)),
        ("sin(1e16*x)", (-1.0, 1.0)),
    ],
)
def test_enclosures_are_tight(text: str, expected: tuple[float, float]) -> None:
    assert bounds(parse(text), {"x": (1.0, 2.0), "y": (2.0, 3.0)}) == pytest.approx(
        expected, rel=1e-14, abs=1e-300
    )


@pytest.mark.parametrize(
    "text", ["1 - cos(x)", "2 - 2*cos(x)", "0.3*(1 + sin(x))", "1 - exp(-x**2)", "max(x, 0)"]
)
def test_what_is_exact_stays_exact(text: str) -> None:
    """A threshold that just vanishes is not negative by rounding."""
    assert bounds(parse(text), {})[0] == 0.0


@pytest.mark.parametrize(
    ("text", "meets"),
    [
        ("abs(x)", True),
        ("max(x, 0.5, y)", True),
        ("clip(x, -1, 1)", True),
        ("min(1, max(0, x))", True),
        ("piecewise(x < 0.5, x, 1 - x)", True),
        ("piecewise(x < 0.5, 1, 0)", False),
        ("piecewise(x < 0.5, x, 1 + x)", False),
        ("piecewise(x < 0.5, abs(x), 0.5)", True),
        ("piecewise(x < 0.5, abs(x), 0.25)", False),
    ],
)
def test_jumps_are_told_from_kinks(text: str, meets: bool) -> None:
    e = parse(text)
    assert joins(*e.args) is meets
    (_, slope) = slopes([e], {"x": (0.4, 0.6), "y": (0.0, 0.0)}, "x")[0]
    assert bool(np.isfinite(slope).all()) is meets


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("max(2*cos(x), 0)", (0, 2)),
        ("max(-3*cos(x) - 1, 0)", (0, 2)),
        ("max(x, 0)", (0, math.inf)),
        ("min(x, a)", (-math.inf, 2)),
        ("abs(x)", (0, math.inf)),
        ("abs(x - 3)", (0, math.inf)),
        ("abs(2*sin(x) + 1)", (0, 3)),
        ("clip(x, -1, 1)", (-1, 1)),
        ("clip(5*sin(x), 0, 1)", (0, 1)),
        ("a/2*(1 + clip(x/b, -1, 1))", (0, 2)),
        ("piecewise(x < 0, 1, 2)", (1, 2)),
        ("x**2", (0, math.inf)),
        ("exp(-x**2)", (0, 1)),
        ("tanh(x)", (-1, 1)),
        ("sqrt(x)", (0, math.inf)),
        ("1 + 0.5*cos(2*pi*x)", (0.5, 1.5)),
        ("x", (-math.inf, math.inf)),
    ],
)
def test_bounds_of_unbounded_names(text, expected):
    ranges = {"a": (2.0, 2.0), "b": (3.0, 3.0)}
    assert bounds(parse(text), ranges) == pytest.approx(expected, abs=1e-15)


def test_bounds_of_undefined_powers():
    assert bounds(parse("sqrt(a)"), {"a": (-4.0, -1.0)}) == (0, 0)
    assert bounds(parse("a**-0.5"), {"a": (-4.0, -1.0)})[0] <= 0


def test_unknown_names_are_unbounded() -> None:
    assert bounds(parse("x + a"), {"x": (0.0, 1.0)}) == (-math.inf, math.inf)
    assert bounds(parse("exp(a - a + tanh(b))"), {}) == pytest.approx(
        (math.exp(-1.0), math.e), rel=1e-14
    )
    assert bounds(parse("3"), {}) == (3.0, 3.0)


@pytest.mark.parametrize(
    ("text", "sign"),
    [
        ("1 - tanh(x)", 1),
        ("0.5*(tanh(x) + 1)*exp(y)", 1),
        ("-exp(x)", -1),
        ("exp(x) + exp(-y)", 1),
        ("(erf(x) - 1)*(2 + sin(y))", -1),
        ("expm1(x) + 1", 1),
        ("a*(1 - tanh(x))/sqrt(a**2 + y**2)", 1),
        ("(tanh(x) - 1)**2 + y**2", 1),
        ("cosh(x) - 1", 0),
        ("1 - sin(x)", 0),
        ("x**2", 0),
        ("exp(x) - exp(y)", 0),
        ("smoothstep(x, 0, 1)", 0),
        ("1 - erf(abs(x))*cos(y)", 0),
        ("floor(x) + 1", 0),
    ],
)
def test_what_comes_near_to_zero_and_is_not(text: str, sign: int) -> None:
    assert sure_sign(parse(text), {"a": (2.0, 2.0)}) == sign


@settings(max_examples=200, deadline=None, derandomize=True)
@given(trees(), ENDS, ENDS)
def test_a_sure_sign_is_that_of_all_values(e: Expr, x: float, y: float) -> None:
    value, sign = exact(e, {"x": x, "y": y}), sure_sign(e, {})
    assert value is None or sign == 0 or value * sign > 0


@pytest.mark.parametrize("name", PIECES)
def test_enclosures_of_pieces_hold_their_values(name: str) -> None:
    """On boxes that are narrow enough to lie in one piece, whichever it is."""
    f = made(name, ex.sym("x"))
    for x in np.random.default_rng(0).uniform(-20.0, 20.0, 500):
        low, high = bounds(f, {"x": (x - 1e-3, x + 1e-3)})
        assert low <= ex.evaluate(f, {"x": x}) <= high
        assert high - low < 0.1 or name in (
            "floor",
            "mod",
            "square",
            "sawtooth",
            "sign",
            "heaviside",
        )
