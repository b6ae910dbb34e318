"""Expressions as interpreted instructions against numbers one at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from oracles.fields import function
from stickslip import catalogue, simulate
from stickslip.equations.codegen.program import OPERATION
from stickslip.equations.derive import derive
from stickslip.equations.mode_fields import mode_field
from stickslip.orbits.fields.engine.interpreter import CALL, TIMES
from stickslip.orbits.fields.instructions import Evaluator, Listing, PointFunction
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.formulas import Scope
from stickslip.symbolic.functions import FUNCTIONS, Function
from systems import published

DECLARED = {name: published(name).declaration for name in catalogue.names()}
WITH_FIELDS = [
    name for name, d in DECLARED.items() if not d.resisted and not any(c.opens for c in d.contacts)
]

NAMES: tuple[str, ...] = ("x", "y", "p", "q")
FORMULAS = (
    "3",
    "x",
    "2*x - 3*y + p - 0.25",
    "p*q",
    "x*y*p*x",
    "x**2/(1 + y**2)",
    "(x + 2)**p",
    "(y + 3)**-1.5 + q**3",
    "exp(-p)*sin(q*x) + cos(y)/q",
    "log(2 + x*x)*sqrt(p)",
)


def parse(text: str) -> ex.Expr:
    return Scope({name: ex.sym(name) for name in NAMES}).parse(text, "here")


def points(count: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(0.2, 1.7, (len(NAMES), count))


@pytest.mark.parametrize("count", [1, 7, 8, 9, 40])
@pytest.mark.parametrize("alike", [True, False])
def test_values(count: int, alike: bool) -> None:
    """At any number of points, whether or not the parameters are the same at all of them."""
    expressions = [parse(text) for text in FORMULAS]
    given = points(count)
    if alike:
        given[2:] = given[2:, :1]
    found = Evaluator(expressions, NAMES, 2)(given, alike)
    for column, values in zip(found.T, given.T, strict=True):
        at = dict(zip(NAMES, map(float, values), strict=True))
        assert column == pytest.approx([ex.evaluate(e, at) for e in expressions], rel=1e-14)


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_functions(name: str) -> None:
    """Rows that formulas cannot name among them; where they are defined."""
    row = FUNCTIONS[name]
    given = points(5)
    low, high = row.domain
    given[0] = np.clip(given[0], 0.9 * low, 0.9 * high)
    found = Evaluator([ex.call(name, ex.sym("x"))], NAMES, 4)(given)[0]
    assert found == pytest.approx([row(x) for x in given[0]], rel=1e-15, abs=1e-16)


def test_a_function_of_others_and_one_of_c(monkeypatch: pytest.MonkeyPatch) -> None:
    """A row of the table is enough, with a formula or without."""
    sech = Function(
        name="sech", value=lambda x: 1.0 / math.cosh(x), derivative="-x", formula="1/cosh(x)"
    )
    atanh = Function(name="atanh", value=math.atanh, derivative="1/(1 - x**2)")
    for row in (sech, atanh):
        monkeypatch.setitem(FUNCTIONS, row.name, row)
    found = Evaluator([parse("sech(x)*atanh(x/2)")], NAMES, 4)(points(5))[0]
    expected = [math.atanh(x / 2) / math.cosh(x) for x in points(5)[0]]
    assert found == pytest.approx(expected, rel=1e-15)


def test_where_undefined() -> None:
    given = np.array([[-1.0, 0.0, np.nan]] * 4)
    found = Evaluator([parse("1/x"), parse("log(x)"), parse("x**0.5")], NAMES, 4)(given)
    assert found[0, 0] == -1.0
    assert np.isnan(found[0, 1])
    assert np.isnan(found[1, 0])
    assert found[1, 1] == -np.inf
    assert np.isnan(found[:, 2]).all()


def test_what_does_not_move_comes_first() -> None:
    listing = Listing([parse("exp(p)*x + q**2"), parse("exp(p) - 1")], NAMES, 2)
    moving = set(range(2))
    for place, (_, out, first, _) in enumerate(listing.code.tolist()):
        if place >= listing.once:
            moving.add(out)
        else:
            assert first not in moving or listing.code[place, 0] == 0
    assert 0 < listing.once < len(listing.code)


def test_kinks_are_refused() -> None:
    with pytest.raises(ValueError, match="kinks"):
        Evaluator([parse("abs(x)")], NAMES, 4)


@pytest.mark.parametrize("name", WITH_FIELDS)
def test_fields_of_the_catalogue(name: str) -> None:
    """Rates and guards of the mode a motion starts in, as NumPy has them."""
    system = published(name)
    equations = derive(system.declaration)
    first = simulate(system, (system.span[0], system.span[0] + 0.1)).knots
    mode, region = (tuple(map(int, part[0])) for part in (first.mode, first.region))
    field = mode_field(equations, mode, region)
    expressions = [*field.rates, *(g.value for g in field.guards)]
    y = np.random.default_rng(1).uniform(0.1, 0.9, (len(field.state), 11))
    p = np.array(list(system.values.values()))
    expected = function(field, expressions)(0.3, y, p)
    # In another region, a formula may have no value.
    assert np.isfinite(expected).any(axis=0).all()
    found = PointFunction(field, expressions)(0.3, y, p)
    assert found == pytest.approx(expected, rel=1e-13, nan_ok=True)
    one = PointFunction(field, expressions)(0.3, y[:, 4], p)
    assert one == pytest.approx(expected[:, 4], rel=1e-13, nan_ok=True)


def test_sums_share_their_terms() -> None:
    """A load at many modes is evaluated once."""
    names = ("t", *(f"x{i}" for i in range(12)))
    wave = ex.call("cos", 3.0 * ex.sym("t")) * ex.sym("x0")
    rates = [float(i) * wave + ex.sym(f"x{i}") - 2.0 * ex.sym(f"x{i - 1}") for i in range(2, 12)]
    operations = Listing(rates, names, len(names)).code[:, OPERATION].tolist()
    assert operations.count(CALL) == 1
    assert operations.count(TIMES) == 1
