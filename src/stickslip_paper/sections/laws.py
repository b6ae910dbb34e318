"""The equations of the library, at points and as SymPy expressions, for comparison with those of
the paper."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import sympy

import stickslip as ss

Values = Mapping[str, float]
_OPERATIONS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


@cache
def built(declare: Callable[..., ss.System], **given: float | str) -> ss.System:
    """A system, cached by its arguments."""
    return declare(**given)


def rates_of(system: ss.System, modes: Mapping[str, str], values: Values) -> dict[str, float]:
    """Rates of all state variables at a point."""
    return ss.vector_field(system, modes, at={"t": 0.0, **values}).rates_at()


def jacobian_of(system: ss.System, modes: Mapping[str, str], values: Values) -> np.ndarray:
    """Jacobian of the rates at a point."""
    return ss.vector_field(system, modes, at={"t": 0.0, **values}).jacobian_at()


def fact(system: ss.System, name: str, **parameters: float) -> float:
    """A fact that the catalogue states of a system."""
    return system.evaluate(name, parameters)


def points(
    ranges: Mapping[str, tuple[float, float]], count: int = 50, seed: int = 0
) -> Iterator[dict[str, float]]:
    """Random points in a box, the same ones every time."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield {name: float(rng.uniform(low, high)) for name, (low, high) in ranges.items()}


def in_sympy(formula: str | float) -> sympy.Expr:
    """A formula of the library in SymPy; all names are real symbols, decimal numbers are exact
    fractions. Python's parser reads it, and nothing is evaluated."""
    return _translated(ast.parse(str(formula), mode="eval").body)


def _translated(node: ast.expr) -> sympy.Expr:
    match node:
        case ast.Constant(value=float() | int() as number):
            fraction = Fraction(number).limit_denominator(10**9)
            return sympy.Rational(fraction.numerator, fraction.denominator)
        case ast.Name(id=name):
            return sympy.Symbol(name, real=True)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_translated(operand)
        case ast.BinOp(left=left, op=operation, right=right):
            return _OPERATIONS[type(operation)](_translated(left), _translated(right))
        case ast.Call(
            func=ast.Name(id="piecewise"), args=[ast.Compare() as condition, above, below]
        ):
            guard = _translated(condition.left)  # the library writes all conditions as g >= 0
            return sympy.Piecewise((_translated(above), guard >= 0), (_translated(below), True))
        case ast.Call(func=ast.Name(id=name), args=[argument]):
            return getattr(sympy, name)(_translated(argument))
    raise ValueError(f"{ast.unparse(node)} has no translation")


def zero(expression: Any) -> bool:
    """Return whether an expression is identically zero."""
    return bool(sympy.simplify(sympy.expand(expression)) == 0)


def at_events(
    motion: ss.Trajectory, to: str, column: str = "time", contact: str | None = None
) -> np.ndarray:
    """Values of a column of the table of events at changes to `to`."""
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
