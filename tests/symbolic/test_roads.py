"""One formula has one value, whichever way it is computed: one by one, with NumPy, in machine code
(of constants, and of what moves), from its own text; and no enclosure misses it.

The reference is Python's own arithmetic (:mod:`adversarial.families.texts`), which shares no code
with the library: comparisons at equality, guards that are undefined or overflow.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

import stickslip as ss
from adversarial.families.texts import GRID, Text, drawn, same, settled
from stickslip.errors import DeclarationError
from stickslip.motion.problem import pose
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import enclosures
from stickslip.symbolic.enclosures import bounds
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Scope, formula_text

NAMES = ["x", "y", "z", "u"]
PLACES = [*GRID, 1000.0, -3.7]
SCOPE = Scope({name: ex.sym(name) for name in NAMES})
FORMULAS = 600


@cache
def formulas() -> list[tuple[Text, Expr]]:
    """Random formulas that are not refused for a constant that is undefined."""
    found = []
    for seed in range(FORMULAS):
        formula = drawn(np.random.default_rng(seed), NAMES, 4)
        try:
            found.append((formula, SCOPE.parse(formula.text, "formula")))
        except DeclarationError as error:
            assert "cannot be evaluated" in str(error) or "too large" in str(error), formula.text
    assert len(found) > 0.9 * FORMULAS
    return found


def points(rng: np.random.Generator) -> list[dict[str, float]]:
    """A few places on the grid."""
    return [{name: float(rng.choice(PLACES)) for name in NAMES} for _ in range(6)]


def test_one_by_one_and_with_numpy() -> None:
    compared = 0
    for seed, (formula, e) in enumerate(formulas()):
        rng = np.random.default_rng(10_000 + seed)
        at = points(rng)
        table = np.array([[p[name] for p in at] for name in NAMES])
        together = evaluator([e], NAMES)(table)[0]
        again = SCOPE.parse(formula_text(e, "formula"), "formula")
        for p, value in zip(at, together, strict=True):
            expected = settled(formula, p, rng)
            if expected is not None:
                compared += 1
                for found in (ex.evaluate(e, p), float(value), ex.evaluate(again, p)):
                    assert same(found, expected), (formula.text, p, found, expected)
    assert compared > 5 * len(formulas())


def test_enclosures() -> None:
    for seed, (formula, e) in enumerate(formulas()):
        rng = np.random.default_rng(20_000 + seed)
        for p in points(rng)[:2]:
            for width in (0.0, 0.5):
                box = {name: (x, x + width) for name, x in p.items()}
                end = {name: x + width * float(rng.choice([0.0, 1.0])) for name, x in p.items()}
                for inside in (p, end):
                    value = settled(formula, inside, rng)
                    if value is None or not math.isfinite(value):
                        continue
                    near = 1e-10 * max(1.0, abs(value))
                    for low, high in (bounds(e, box), enclosures([e], box)[0][:, 0]):
                        assert low - near <= value <= high + near, (formula.text, box, inside)


def system(formulas_of: list[str], kind: str) -> ss.System:
    """A system with a law for each formula, of parameters or of internal variables."""
    moving = {name: ss.Internal("0") for name in NAMES} if kind == "moving" else {}
    constant = {} if moving else {name: ss.Parameter(0.0) for name in NAMES}
    laws = {f"a{i}": ss.Internal(text) for i, text in enumerate(formulas_of)}
    return ss.System("roads", parameters=constant, internal={**moving, **laws})


@pytest.mark.parametrize("start", range(0, 200, 50))
def test_constants_in_machine_code(start: int) -> None:
    chosen = formulas()[start : start + 50]
    declared = system([formula.text for formula, _ in chosen], "constant")
    rng = np.random.default_rng(start)
    for p in points(rng):
        problem = pose(declared, p)
        slots = problem.compiled.layout.constants
        for formula, e in chosen:
            expected = settled(formula, p, rng)
            if e in slots and expected is not None:
                found = float(problem.constants.K[slots[e]])
                assert same(found, expected), (formula.text, p, found, expected)


def test_what_moves_in_machine_code() -> None:
    """Where no guard is 0: on which side of it a motion goes on is another question."""
    rng = np.random.default_rng(7)
    for start in range(0, 60, 20):
        p = {name: float(rng.uniform(-2.0, 2.0)) for name in NAMES}
        chosen = [
            (formula.text, value)
            for formula, _ in formulas()[start : start + 60]
            if (value := settled(formula, p, rng)) is not None and abs(value) < 1e3
        ][:20]
        declared = system([text for text, _ in chosen], "moving")
        motion = ss.simulate(declared, (0.0, 1e-6), initial=p)
        for i, (text, value) in enumerate(chosen):
            assert same(float(motion.at(0.0)[f"d_a{i}"]), value), (text, p)


@pytest.mark.parametrize(
    ("text", "x", "value"),
    [
        ("clip(exp(x), 0, 1)", 1000.0, 1.0),
        ("max(exp(x), 1)", 1000.0, math.inf),
        ("max(-exp(x), -1)", 1000.0, -1.0),
        ("1/(1 + exp(x))", 1000.0, 0.0),
        ("max(sqrt(x), 3)", -1.0, math.nan),
        ("clip(acos(x), -0.5, 2)", 2.0, math.nan),
        ("piecewise(1/x > 0, 1, 2)", 0.0, math.nan),
        ("square(exp(x))", 1000.0, math.nan),
        ("sqrt(x)**2", -4.0, math.nan),
        ("sqrt(x)*x*sqrt(x)", -4.0, math.nan),
        ("sqrt(x)**2", 4.0, 4.0),
        ("sqrt(x**2)**2", -3.0, 9.0),
        ("mod(x, 1)", 1e16, 0.0),
        ("mod(x, 3)", 1e16 + 2.0, 0.0),
        ("floor(x)", 1e17, 1e17),
        ("sign(x)", 0.0, 0.0),
        ("heaviside(x)", 0.0, 1.0),
        ("heaviside(-x)", 0.0, 1.0),
        ("piecewise(x > 0, 1, 2)", 0.0, 2.0),
        ("piecewise(x < 0, 1, 2)", 0.0, 2.0),
        ("piecewise(x <= 0, 1, 2)", 0.0, 1.0),
        ("piecewise(0.491*x > 0.491*0.3, 1, 2)", 0.3, 2.0),
        ("x - clip(x, -2, 2)", 1.1, 0.0),
    ],
)
def test_known_values(text: str, x: float, value: float) -> None:
    e = SCOPE.parse(text, "formula")
    problem = pose(
        ss.System("one", parameters={"x": ss.Parameter(x)}, internal={"a": ss.Internal(text)})
    )
    slot = problem.compiled.layout.constants[e]
    for found in (
        ex.evaluate(e, {"x": x}),
        float(evaluator([e], ["x"])([x])[0]),
        float(problem.constants.K[slot]),
    ):
        assert same(found, value)


def test_what_cancels_in_a_branch_is_gone() -> None:
    """Not even rounding errors are left of it, whatever stands around it."""
    rng = np.random.default_rng(5)
    at = rng.uniform(-1.0, 1.0, (3, 400))
    u = "(0.6*sin(2*x) + y/3)"
    for text, rest in {
        f"{u} - clip({u}, -2, 2)": "0",
        f"3*{u} - 3*clip({u}, -2, 2) + z": "z",
        f"2 - max(2 - {u}, {u}) - {u}": "0",
        f"min({u}, 2) - {u}": "0",
    }.items():
        found, expected = evaluator(
            [SCOPE.parse(t, "formula") for t in (text, rest)], ["x", "y", "z"]
        )(at)
        assert np.array_equal(found, expected), text


def test_a_guard_is_one_however_often_it_is_made() -> None:
    """Whatever its coefficients are: a guard that is scaled again is the same."""
    rng = np.random.default_rng(3)
    for _ in range(300):
        a, b = rng.uniform(-3.0, 3.0, 2)
        e = SCOPE.parse(f"max({a!r}*x + {b!r}*y, z)*u", "formula")
        assert ex.substitute(ex.substitute(e, {"x": ex.sym("w")}), {"w": ex.sym("x")}) is e
        guard = e.args[0] if e.op == "select" else e.terms[0][0]
        assert ex.rewrite(guard, lambda _: None) is guard


def test_derivatives_of_long_products_are_short() -> None:
    """The size of all second derivatives of a product grows with the number of its factors."""
    sizes = []
    for n in (40, 80, 160):
        product = ex.ONE
        for i in range(1, n + 1):
            product = product * ex.call("sin", ex.num(float(i)) * ex.sym("x"))
        bent = ex.derivative(ex.derivative(product, "x"), "x")
        sizes.append(sum(len(e.terms) + len(e.args) for e in ex.walk([bent])))
        x = 0.7
        terms = [(i, math.cos(i * x) / math.sin(i * x)) for i in range(1, n + 1)]
        value = math.prod(math.sin(i * x) for i in range(1, n + 1))
        slope = sum(i * c for i, c in terms)
        expected = value * (slope**2 - sum(i * i * (1.0 + c * c) for i, c in terms))
        assert ex.evaluate(bent, {"x": x}) == pytest.approx(expected, rel=1e-9)
    assert sizes[2] < 2.5 * sizes[1] < 6.25 * sizes[0]
