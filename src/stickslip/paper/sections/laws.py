"""The library's own equations, at points and as SymPy expressions, to lay beside those of the
paper."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.equations.derive import MotionEquations, derive
from stickslip.equations.field import Field, mode_field
from stickslip.errors import StickslipError
from stickslip.model.system import System
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

if TYPE_CHECKING:
    import sympy

    from stickslip.motion.trajectory import Trajectory

Values = Mapping[str, float]


@cache
def built(declare: Callable[..., System], **given: float | str) -> System:
    """A system that is asked for again and again, declared once."""
    return declare(**given)


@cache
def equations_of(system: System) -> MotionEquations:
    """What the library derives from the declaration."""
    return derive(system.declaration)


def field_of(system: System, modes: Mapping[str, int], values: Values) -> Field:
    """The field in a mode (by contact: 0 stick, ±1 slip), in the region of the kinks in which
    `values` lie."""
    equations = equations_of(system)
    point = {**system.values, "t": 0.0, **values}
    region = tuple(int(ex.evaluate(g, point) >= 0.0) for g in equations.kinks)
    return _field(system, tuple(modes[c.name] for c in equations.contacts), region)


@cache
def _field(system: System, mode: tuple[int, ...], region: tuple[int, ...]) -> Field:
    return mode_field(equations_of(system), mode, region)


def rates_of(system: System, modes: Mapping[str, int], values: Values) -> dict[str, float]:
    """Rates of all state variables at a point."""
    found = field_of(system, modes, values)
    point = {**system.values, "t": 0.0, **values}
    return {
        name: ex.evaluate(rate, point) for name, rate in zip(found.state, found.rates, strict=True)
    }


def jacobian_of(system: System, modes: Mapping[str, int], values: Values) -> np.ndarray:
    """Jacobian of the rates at a point."""
    found = field_of(system, modes, values)
    point = {**system.values, "t": 0.0, **values}
    return np.array([[ex.evaluate(e, point) for e in row] for row in found.jacobian])


def fact(system: System, name: str, **parameters: float) -> float:
    """A fact that the catalogue states of a system."""
    return ex.evaluate(system.declaration.facts[name], {**system.values, **parameters})


def points(
    ranges: Mapping[str, tuple[float, float]], count: int = 50, seed: int = 0
) -> Iterator[dict[str, float]]:
    """Random points in a box, the same ones every time."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield {name: float(rng.uniform(low, high)) for name, (low, high) in ranges.items()}


def import_sympy() -> Any:
    """SymPy, which only the symbolic checks need.

    Raises
    ------
    StickslipError
        If it is not installed.
    """
    try:
        import sympy
    except ImportError:
        raise StickslipError(
            "SymPy is missing, which the symbolic checks need. Install it: pip install sympy"
        ) from None
    return sympy


def in_sympy(expression: Expr) -> sympy.Expr:
    """An expression of the library in SymPy; all names are real symbols, decimal numbers are exact
    fractions."""
    sp = import_sympy()
    match expression.op:
        case "num":
            return _exact(float(expression.value))
        case "sym":
            return sp.Symbol(str(expression.value), real=True)
        case "sum":
            return sp.Add(
                _exact(float(expression.value)),
                *(_exact(c) * in_sympy(e) for e, c in expression.terms),
            )
        case "prod":
            return sp.Mul(*(in_sympy(e) ** _exact(p) for e, p in expression.terms))
        case "pow":
            return in_sympy(expression.args[0]) ** in_sympy(expression.args[1])
        case "select":
            guard, above, below = map(in_sympy, expression.args)
            return sp.Piecewise((above, guard >= 0), (below, True))
        case name:
            return getattr(sp, name)(in_sympy(expression.args[0]))


def _exact(number: float) -> sympy.Rational:
    fraction = Fraction(number).limit_denominator(10**9)
    return import_sympy().Rational(fraction.numerator, fraction.denominator)


def zero(expression: Any) -> bool:
    """Whether an expression is identically zero."""
    sp = import_sympy()
    return bool(sp.simplify(sp.expand(expression)) == 0)


def at_events(
    motion: Trajectory, to: str, column: str = "time", contact: str | None = None
) -> np.ndarray:
    """What the table of events says in a column where something goes over to `to`."""
    table = motion.events
    wanted = np.asarray(table["to"] == to)
    if contact is not None:
        wanted = wanted & np.asarray(table["contact"] == contact)
    return np.asarray(table[column], dtype=float)[wanted]


def root(f: Callable[[float], float], low: float, high: float) -> float:
    """The zero of a function that changes its sign between two points."""
    from scipy.optimize import brentq

    found: Any = brentq(f, low, high, xtol=1e-16, rtol=np.float64(1e-14))
    return float(found)
