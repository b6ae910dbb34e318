"""One row of the table is a function of the whole library: new ones are added here, for a while,
and asked for all that the old ones are asked for. Their oracles are functions of mpmath.

Whatever needs a second place makes these tests fail.
"""

from __future__ import annotations

import ast
import gc
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import stickslip as ss
from flows import taylor_series
from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.motion.discs.spreading import spread, spread_state
from stickslip.motion.discs.tables import DiscTape
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.problem import pose
from stickslip.motion.steps.arrays import Instant
from stickslip.motion.steps.step_size import fill_powers
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import enclosures, slopes
from stickslip.symbolic.enclosures import bounds
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.formulas import Scope, builtins
from stickslip.symbolic.functions import ARGUMENT, FUNCTIONS, Function
from stickslip.symbolic.majorants import growth

X = ex.sym("x")

NEW = (
    # odd, rising: the Gudermannian
    Function(
        name="gd",
        value=lambda x: 2.0 * math.atan(math.tanh(0.5 * x)),
        derivative="1/cosh(x)",
        formula="2*atan(tanh(x/2))",
        parity="odd",
        limits=(-1.5707963267948968, 1.5707963267948968),
    ),
    # even, falls on both sides; its formula overflows where it vanishes
    Function(
        name="sech",
        value=lambda x: 1.0 / math.cosh(x),
        derivative="-tanh(x)/cosh(x)",
        formula="1/cosh(x)",
        latex=r"\mathrm{sech}",
        parity="even",
        limits=(1.0, 0.0),
    ),
    # neither monotone nor a wave
    Function(
        name="hump",
        value=lambda x: x / (1.0 + x * x),
        derivative="(1 - x**2)/(1 + x**2)**2",
        formula="x/(1 + x**2)",
        parity="odd",
    ),
    # not defined everywhere, of a slope without bound
    Function(
        name="atanh",
        value=math.atanh,
        derivative="1/(1 - x**2)",
        arrays="numpy:arctanh",
        parity="odd",
        domain=(-1.0, 1.0),
        limits=(-math.inf, math.inf),
    ),
)
ORACLES: dict[str, Callable[..., Any]] = {
    **{name: getattr(mp, name) for name, row in FUNCTIONS.items() if not row.typed},
    "gd": lambda x: 2 * mp.atan(mp.tanh(x / 2)),
    "sech": mp.sech,
    "hump": lambda x: x / (1 + x * x),
    "atanh": mp.atanh,
}
ADDED = [row.name for row in NEW]
EVERY = sorted(ORACLES)


@pytest.fixture(autouse=True)
def rows(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for row in NEW:
        monkeypatch.setitem(FUNCTIONS, row.name, row)
    with mp.workdps(40):
        yield


def parse(text: str) -> ex.Expr:
    return Scope({name: ex.sym(name) for name in "xyt"}).parse(text, "here")


def half(row: Function) -> tuple[float, float]:
    """Where a monotone function is monotone, but for the last digits at the ends."""
    low, high = ((1.0 - 1e-12) * end for end in row.domain)
    return (0.0, high) if row.parity == "even" else (low, high)


# -- rows ------------------------------------------------------------------------------------------


def test_a_row_that_is_gone_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    assert parse("gd(x)") is ex.call("gd", X)
    with pytest.raises(DeclarationError, match="fixed meaning"):
        ss.System("s", parameters={"gd": ss.Parameter(1.0)}, internal={"a": ss.Internal("gd")})
    monkeypatch.delitem(FUNCTIONS, "gd")
    with pytest.raises(DeclarationError, match="unknown function 'gd'"):
        parse("gd(x)")


def test_a_derivative_that_needs_its_own_series_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    own = Function(name="own", value=math.tanh, derivative="1 - own(x)**2")
    monkeypatch.setitem(FUNCTIONS, "own", own)
    with pytest.raises(ValueError, match="its derivative must not contain own"):
        ex.derivative(parse("own(x)"), "x")


@pytest.mark.parametrize("name", EVERY)
def test_a_row_does_not_contradict_itself(name: str) -> None:
    row = FUNCTIONS[name]
    inside = (-0.9, 0.9) if row.domain == (-1.0, 1.0) else (0.1, 3.0)
    for x in np.linspace(*inside, 7).tolist():
        assert row(x) == pytest.approx(float(ORACLES[name](x)), rel=4e-16, abs=4e-16)
        assert row.array(np.array([x]))[0] == pytest.approx(row(x), rel=1e-15, abs=1e-15)
        exact = float(mp.diff(ORACLES[name], x))
        assert ex.evaluate(row.slope, {ARGUMENT: x}) == pytest.approx(exact, rel=1e-14, abs=1e-14)
        shown = ex.evaluate(row.shown_slope, {ARGUMENT: x})
        assert shown == pytest.approx(exact, rel=1e-14, abs=1e-14)
        if row.relative_slope is not None:
            relative = ex.evaluate(row.relative_slope, {ARGUMENT: x})
            assert relative == pytest.approx(exact / row(x), rel=1e-14)
        if row.parity:
            assert row(-x) == (row(x) if row.parity == "even" else -row(x))
    if row.exactly is not None:
        assert row(row.exactly[0]) == row.exactly[1]
    if row.limits is not None:
        low, high = bounds(row.shown_slope, {ARGUMENT: half(row)})
        assert low >= 0.0 if row.limits[0] < row.limits[1] else high <= 0.0
    if row.crest is not None:
        assert ORACLES[name](mp.mpf(row.crest)) == pytest.approx(1.0, abs=1e-15)
        for quarters in range(4):
            later = ex.evaluate(ex.turned(ex.call(name, X), quarters), {"x": 0.3})
            exact = ORACLES[name](mp.mpf("0.3") + quarters * mp.pi / 2)
            assert later == pytest.approx(float(exact))


# -- derivatives -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*ADDED, "erf"])
def test_derivatives(name: str) -> None:
    """First, second and third, of a formula in which other things happen."""
    f = ORACLES[name]
    e = parse(f"{name}(0.3*x + y**2)*x/(2 + {name}(y))")
    point = {"x": 0.7, "y": 0.4}
    for order in range(4):
        exact = mp.diff(
            lambda x: f(mp.mpf("0.3") * x + mp.mpf(0.4) ** 2) * x / (2 + f(mp.mpf(0.4))), 0.7, order
        )
        assert ex.evaluate(e, point) == pytest.approx(float(exact), rel=1e-12)
        assert evaluator([e], ["x", "y"])([0.7, 0.4])[0] == pytest.approx(float(exact), rel=1e-12)
        e = ex.derivative(e, "x")


def test_erf_in_sympy() -> None:
    import sympy as sp

    x = sp.Symbol("x")
    exact = sp.diff(sp.erf(sp.sin(x) / x), x, 2)
    e = ex.derivative(ex.derivative(parse("erf(sin(x)/x)"), "x"), "x")
    for at in (0.3, -1.2, 4.0):
        value = float(exact.subs(x, sp.Rational(str(at))).evalf(30))
        assert ex.evaluate(e, {"x": at}) == pytest.approx(value, rel=1e-12)


# -- enclosures ------------------------------------------------------------------------------------

ENDS = st.one_of(st.floats(-3, 3), st.floats(-1e3, 1e3), st.sampled_from([0.0, 1.0, -1.0, 1e-9]))
WIDTHS = st.sampled_from([0.0, 1e-12, 1e-6, 1e-2, 0.3, 1.0, 7.0, math.inf])


@pytest.mark.parametrize("name", EVERY)
@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(low=ENDS, width=WIDTHS, seed=st.integers(0, 2**32 - 1))
def test_no_value_and_no_slope_leaves_its_enclosure(
    name: str, low: float, width: float, seed: int
) -> None:
    e = ex.call(name, X)
    box = {"x": (low, low + width)}
    both = [bounds(e, box), enclosures([e], box)[0][:, 0]]
    assert all(a <= b for a, b in both)
    least, most = max(a for a, _ in both), min(b for _, b in both)
    ((_, slope),) = slopes([e], box, "x")
    domain = FUNCTIONS[name].domain
    shares = np.sort(np.random.default_rng(seed).uniform(size=8))
    places = np.unique(np.clip(low + min(width, 50.0) * np.array([0.0, *shares, 1.0]), *domain))
    places = places[(places >= low) & (places <= low + width)]
    values = [(mp.mpf(x), ORACLES[name](mp.mpf(x))) for x in places.tolist() if abs(x) != 1.0]
    values = [(x, y) for x, y in values if mp.isfinite(y) and abs(y) < 1e300]
    for x, y in values:
        assert least <= y <= most, x
    for (u, f), (v, g) in pairwise(values):
        noise = (abs(f) + abs(g)) * mp.mpf(10) ** -30
        assert slope[0, 0] * (v - u) - noise <= g - f <= slope[1, 0] * (v - u) + noise


@pytest.mark.parametrize("name", [*ADDED, "erf"])
def test_enclosures_are_tight(name: str) -> None:
    low, high = 0.2, 0.6
    ends = sorted(float(ORACLES[name](mp.mpf(x))) for x in (low, high))
    assert bounds(ex.call(name, X), {"x": (low, high)}) == pytest.approx(ends, rel=1e-14)
    # … and where a function turns, nearly, on a short stretch.
    least, most = bounds(ex.call(name, X), {"x": (0.0, 1e-3)})
    assert most - least <= 1.2e-3


def test_values_far_out() -> None:
    everywhere = {"x": (-math.inf, math.inf)}
    assert bounds(parse("erf(x)"), everywhere) == (-1.0, 1.0)
    assert bounds(parse("sech(x)"), everywhere) == (0.0, 1.0)
    assert bounds(parse("atanh(x)"), everywhere) == (-math.inf, math.inf)
    assert bounds(parse("erf(x)"), {"x": (0.0, 0.0)}) == (0.0, 0.0)
    assert bounds(parse("sech(x)"), {"x": (800.0, 900.0)})[0] == 0.0
    assert bounds(parse("erf(x)"), {"x": (1e-9, 1.0)})[0] > 0.0


# -- discs -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("radius", [1e-3, 0.05, 0.4])
def test_no_function_strays_further_than_its_growth(name: str, radius: float) -> None:
    """On discs in the complex plane, of formulas of one variable."""
    middle = np.array([0.15, 0.31, 0.55])
    found = growth(parse(f"{name}(x)"), "x", middle - radius, middle + radius, np.full(3, radius))
    circle = [radius * mp.expjpi(mp.mpf(k) / 16) for k in range(32)]
    for c, bound in zip(middle.tolist(), found.tolist(), strict=True):
        if name in ("log", "atanh", "asin", "acos") and radius >= min(c, 1.0 - c):
            continue
        strays = max(abs(ORACLES[name](c + d) - ORACLES[name](mp.mpf(c))) for d in circle)
        assert strays <= bound * (1 + 1e-12)
        if radius < 0.01:
            assert bound <= 1.2 * strays


INSIDE = "0.3 + 0.4*sin(1.3*t) + 0.05*x0"
FORCES = [f"{name}({INSIDE})" for name in [*ADDED, "erf"]]


def test_series_and_discs_of_machine_code() -> None:
    """Taylor coefficients against mpmath's, discs against complex values, in a system's code."""
    names = [f"x{i}" for i in range(len(FORCES))]
    system = ss.System(
        "forces",
        coordinates={x: ss.Viscous(force=f) for x, f in zip(names, FORCES, strict=True)},
        viscous=" + ".join(f"d_{x}**2/2" for x in names),
    )
    p = pose(system)
    flow = p.flow()
    space = flow.space
    none = np.zeros(0, np.int64)
    n = len(FORCES)
    K = p.constants.K
    y = np.full(n, 0.2)
    t = 0.4
    resolve(p.rows, p.constants, space, none)
    space.W[n, 1] = 1.0
    inverses = space.Rq, space.Rz
    taylor_series(p.machine, flow, Instant(t, y, none, none), p.order, space.W)
    # The position is the polynomial that stands in the table.
    position = [mp.mpf(c) for c in space.W[0, : p.order + 1][::-1].tolist()]

    def inside(tau: Any) -> Any:
        at = mp.mpf(t) + tau
        return (
            mp.mpf(0.3)
            + mp.mpf(0.4) * mp.sin(mp.mpf(1.3) * at)
            + mp.mpf(0.05) * mp.polyval(position, tau)
        )

    radius = 0.3
    fill_powers(space.reaches, radius)
    space.discs[n, :2] = radius, 0.0
    spread_state(space.W, p.order, space.reaches, p.rows.watched[:n], space.discs)
    program = p.rows.program
    places = (space.W, space.discs, *inverses, space.B, space.balls, space.reaches)
    tape = DiscTape(program, K, *places, p.order)
    spread(tape, none, none, 0, len(program.code))
    circle = [radius * mp.expjpi(mp.mpf(k) / 16) for k in range(32)]
    for i, name in enumerate([*ADDED, "erf"]):
        row = program.rates[i]
        exact = mp.taylor(lambda tau, f=ORACLES[name]: f(inside(tau)), 0, p.order - 1)
        scale = np.maximum.accumulate(np.abs(np.array(exact, dtype=float)[::-1]))[::-1]
        # the rate of the position, of which all orders are kept
        series = space.W[i, 1 : p.order + 1] * np.arange(1, p.order + 1)
        off = np.abs(series - np.array(exact, dtype=float))
        assert np.all(off <= 1e-12 * (scale + 1e-3)), name
        start = ORACLES[name](inside(mp.mpf(0)))
        strays = max(abs(ORACLES[name](inside(tau)) - start) for tau in circle)
        assert strays <= space.discs[row, 0] <= 3.0 * strays, name


# -- a whole motion --------------------------------------------------------------------------------


def soft() -> ss.System:
    """A point that is dragged over a ground that sticks; the new functions are everywhere."""
    return ss.System(
        "soft",
        parameters={"a": ss.Parameter(0.8), "s": ss.Parameter(0.3)},
        coordinates={"x": ss.Viscous(force="1.2*sin(t) - 0.3*erf(x)")},
        potential="a*gd(x)*x + 0.2*hump(x)**2",
        viscous="d_x**2/2",
        contacts={"ground": ss.Contact("d_x", "s*(1.2 + erf(sin(2*t) - x) + sech(x)/2)")},
    )


def test_a_certified_motion() -> None:
    """It sticks and slips; against an integrator that knows the law as an explicit equation."""
    system = soft()
    motion = ss.simulate(system, (0.0, 9.0), initial={"x": 0.3}, rtol=1e-11)
    assert motion.outcome.ok and motion.certificate.ok
    assert len(motion.events) >= 6

    def rate(t: float, y: Array) -> list[float]:
        x = float(y[0])
        gd = 2.0 * math.atan(math.tanh(0.5 * x))
        bend = 0.4 * x * (1.0 - x * x) / (1.0 + x * x) ** 3
        pull = 1.2 * math.sin(t) - 0.3 * math.erf(x) - 0.8 * (gd + x / math.cosh(x)) - bend
        hold = 0.3 * (1.2 + math.erf(math.sin(2.0 * t) - x) + 0.5 / math.cosh(x))
        return [pull - min(max(pull, -hold), hold)]

    times = np.linspace(0.0, 9.0, 19)
    other = solve_ivp(
        rate, (0.0, 9.0), [0.3], "DOP853", times, rtol=1e-11, atol=1e-12, max_step=0.01
    )
    assert motion.at(times)["x"] == pytest.approx(other.y[0], abs=2e-8)


def test_equations_for_people() -> None:
    latex = str(soft().equations(latex=True))
    for name in (r"\operatorname{erf}", r"\operatorname{gd}", r"\mathrm{sech}"):
        assert f"{name}(x)" in latex
    assert "erf(x)" in str(soft().equations())
    energy = ss.System("e", coordinates={"x": ss.Viscous()}, potential="erf(x)", viscous="d_x**2/2")
    assert "exp(-x²)" in str(energy.equations()).replace("−", "-")


# -- one place -------------------------------------------------------------------------------------

ROOMS = ("symbolic", "model", "equations", "display", "motion", "orbits", "orbits/settling/engine")


def dispatches(tree: ast.AST) -> list[int]:
    """Lines that compare with the name of a function, or look something up by it."""
    names = {name for name, row in FUNCTIONS.items() if not row.typed}
    found = []
    for node in ast.walk(tree):
        match node:
            case ast.Compare():
                parts = [node.left, *node.comparators]
                parts += [e for p in parts if isinstance(p, ast.Tuple | ast.Set) for e in p.elts]
            case ast.Dict():
                parts = [key for key in node.keys if key is not None]
            case ast.MatchValue():
                parts = [node.value]
            case _:
                continue
        if any(isinstance(p, ast.Constant) and p.value in names for p in parts):
            found.append(getattr(node, "lineno", 0))
    return found


def test_nothing_else_knows_a_function_by_name() -> None:
    source = Path(ss.__file__).parent
    files = [path for room in ROOMS for path in (source / room).rglob("*.py")]
    assert len(files) > 50
    found = {
        f"{path.relative_to(source)}:{line}"
        for path in files
        for line in dispatches(ast.parse(path.read_text(encoding="utf-8")))
    }
    assert not found
    assert dispatches(ast.parse("if op in ('sum', 'tanh'): pass"))
    assert dispatches(ast.parse("match op:\n    case 'erf': pass"))
    assert dispatches(ast.parse("{'log': 1}"))


def test_rows_of_samples_are_freed_while_names_are_listed() -> None:
    """The garbage collector frees them at any moment, such as that at which a tuple of names is
    made."""

    class Garbage:
        """What holds a row of the table, in a cycle."""

        def __init__(self, name: str) -> None:
            self.name, self.own = name, self
            FUNCTIONS[name] = replace(FUNCTIONS["sin"], name=name, typed="freed(x)")

        def __del__(self) -> None:
            del FUNCTIONS[self.name]

    gc.collect()
    gc.freeze()  # what is there is not looked at again and again
    thresholds = gc.get_threshold()
    gc.set_threshold(1)
    try:
        for i in range(300):
            Garbage(f"freed_{i}")
            assert builtins()["sin"] == 1
    finally:
        gc.set_threshold(*thresholds)
        gc.collect()
    assert not [name for name in list(FUNCTIONS) if name.startswith("freed_")]
