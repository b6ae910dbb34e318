"""Expressions -> NumPy functions: many places at once, outside the compiled engine.

The source text is made from expression trees by the same lowering as the engine's scalar code
(:func:`stickslip.symbolic.scalars.scalars_of`). It contains only numbers, operators and the names
defined here, and nothing that a user wrote.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS, Function
from stickslip.symbolic.scalars import Scalar, element, scalars_of

NumericFunction = Callable[[ArrayLike], Array]


def _real_power(x: Array, p: Array | float) -> Array:
    pole = (x == 0.0) & (np.mod(p, 2.0) == 1.0) & (np.asarray(p) < 0.0)
    undefined = pole | ((x < 0.0) & (np.mod(p, 1.0) != 0.0))
    return np.power(np.where(undefined, np.nan, np.where(x == 0.0, 0.0, x)), p)


def _reciprocal(x: Array) -> Array:
    return np.divide(1.0, np.where(x == 0.0, np.nan, x))


def _by_sign(guard: Array, above: Array | float, below: Array | float) -> Array:
    return np.where(guard >= 0.0, above, np.where(guard < 0.0, below, np.nan))


def _by_strict_sign(guard: Array, above: Array | float, below: Array | float) -> Array:
    return np.where(guard > 0.0, above, np.where(guard <= 0.0, below, np.nan))


def _number_by_sign(guard: float, above: float, below: float) -> float:
    return above if guard >= 0.0 else below if guard < 0.0 else math.nan


def _number_by_strict_sign(guard: float, above: float, below: float) -> float:
    return above if guard > 0.0 else below if guard <= 0.0 else math.nan


_NUMBERS = {
    "real_power": ex.real_power,
    "reciprocal": lambda x: 1.0 / x if x else math.nan,
    "by_sign": _number_by_sign,
    "by_strict_sign": _number_by_strict_sign,
}
_NAMES = {
    "real_power": _real_power,
    "reciprocal": _reciprocal,
    "by_sign": _by_sign,
    "by_strict_sign": _by_strict_sign,
}


def evaluator(expressions: Sequence[Expr], names: Sequence[str]) -> NumericFunction:
    """NumPy function of expressions: the values of
    :func:`stickslip.symbolic.expressions.evaluate`.

    Parameters
    ----------
    expressions : sequence of Expr
        With kinks or without.
    names : sequence of str
        The names the expressions depend on, in the order of the values.

    Returns
    -------
    function
        Takes values of shape (names, …) and gives results of shape (expressions, …).
    """
    return _evaluator(tuple(expressions), tuple(names))


def evaluator_of_numbers(
    expressions: Sequence[Expr], names: Sequence[str]
) -> Callable[[Sequence[float]], list[float]]:
    """As :func:`evaluator`, for one point at a time: without NumPy that is ten times as fast.

    Returns
    -------
    function
        Takes a number for each name and gives one for each expression.
    """
    return _evaluator_of_numbers(tuple(expressions), tuple(names))


@lru_cache(maxsize=4096)
def _evaluator_of_numbers(
    expressions: tuple[Expr, ...], names: tuple[str, ...]
) -> Callable[[Sequence[float]], list[float]]:
    fill = _compiled(expressions, names, _NUMBERS, lambda row: row.ieee)
    count = len(expressions)
    return lambda values: fill(values, [0.0] * count)


def _compiled(
    expressions: tuple[Expr, ...],
    names: tuple[str, ...],
    operations: Mapping[str, Callable[..., Any]],
    function: Callable[[Function], Callable[..., Any]],
) -> Callable[..., Any]:
    """Generate and compile the source; its names mean the given operations and functions."""
    values = scalars_of(expressions, {name: element("v", i) for i, name in enumerate(names)})
    written = _SourceText()
    results = [written.of(values[e]) for e in expressions]
    lines = written.lines + [f"out[{i}] = {text}" for i, text in enumerate(results)]
    source = "\n    ".join(["def fill(v, out):", *lines, "return out"])
    called = {e.op for e in ex.walk(expressions) if e.op in FUNCTIONS}
    space: dict[str, Any] = {**operations, **{name: function(FUNCTIONS[name]) for name in called}}
    exec(compile(source, "<generated>", "exec"), space)
    return space["fill"]


@lru_cache(maxsize=4096)
def _evaluator(expressions: tuple[Expr, ...], names: tuple[str, ...]) -> NumericFunction:
    fill = _compiled(expressions, names, _NAMES, lambda row: row.array)
    count = len(expressions)

    def function(values: ArrayLike) -> Array:
        v = np.asarray(values, dtype=float)
        with np.errstate(all="ignore"):
            return fill(v, np.empty((count, *v.shape[1:])))

    return function


class _SourceText:
    """Source text of values: numbers, entries of arrays, and operations on them.

    Attributes
    ----------
    lines : list of str
        Statements so far.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._variables: dict[Scalar, str] = {}

    def of(self, s: Scalar) -> str:
        """Text of a value; a value that is kept is assigned to a variable first."""
        match s.op:
            case "number":
                return repr(s.value)
            case "entry":
                return f"{s.name}[{', '.join(map(str, s.index))}]"
            case "kept":
                return self._variable(s)
            case "sum":
                return " + ".join(map(self._part, s.args))
            case "product":
                return "*".join(map(self._part, s.args))
            case "sign":
                parts = ", ".join(map(self.of, s.args))
                return f"{'by_strict_sign' if s.value else 'by_sign'}({parts})"
        return f"{s.name or s.op}({', '.join(map(self.of, s.args))})"

    def _part(self, s: Scalar) -> str:
        """Text of an operand, in brackets where it is a sum."""
        return f"({self.of(s)})" if s.op == "sum" else self.of(s)

    def _variable(self, s: Scalar) -> str:
        if s not in self._variables:
            text = self.of(s.args[0])
            self._variables[s] = f"s{len(self._variables)}"
            self.lines.append(f"{self._variables[s]} = {text}")
        return self._variables[s]
