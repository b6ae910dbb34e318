"""Expressions -> NumPy functions: many places at once, outside the compiled engine.

The source text is made from expression trees by the same lowering as the engine's scalar code
(:func:`stickslip.symbolic.tape.scalars_of`); it holds numbers, operators and the names defined
here, nothing that a user wrote.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS
from stickslip.symbolic.scalars import SourceText, element
from stickslip.symbolic.tape import scalars_of

NumericFunction = Callable[[ArrayLike], Array]

_NAMES = {"real_power": np.power, "reciprocal": np.reciprocal, "where": np.where}


def evaluator(
    expressions: Sequence[Expr], names: Sequence[str], *, strict: bool = False
) -> NumericFunction:
    """NumPy function of expressions.

    Parameters
    ----------
    expressions : sequence of Expr
        With kinks or without.
    names : sequence of str
        The names the expressions depend on, in the order of the values.
    strict : bool
        Whether whatever is made of something infinite is NaN, as for single numbers
        (:func:`stickslip.symbolic.expressions.evaluate`), instead of what it comes to.

    Returns
    -------
    function
        Takes values of shape (names, …) and gives results of shape (expressions, …); NaN or
        infinite where undefined.
    """
    return _evaluator(tuple(expressions), tuple(names), strict)


@lru_cache(maxsize=4096)
def _evaluator(
    expressions: tuple[Expr, ...], names: tuple[str, ...], strict: bool
) -> NumericFunction:
    values = scalars_of(expressions, {name: element("v", i) for i, name in enumerate(names)})
    written = SourceText(arrays=True)
    results = [written.text(values[e]) for e in expressions]
    lines = written.lines
    if strict:
        lines = ["{} = finite({})".format(*line.split(" = ", 1)) for line in lines]
    lines += [f"out[{i}] = {text}" for i, text in enumerate(results)]
    source = "\n    ".join(["def fill(v, out):", *lines, "return out"])
    called = {e.op for e in ex.walk(expressions)} & FUNCTIONS.keys()
    space = {**_NAMES, "finite": _finite, **{name: FUNCTIONS[name].array for name in called}}
    exec(compile(source, "<generated>", "exec"), space)
    fill = space["fill"]
    count = len(expressions)

    def function(values: ArrayLike) -> Array:
        v = np.asarray(values, dtype=float)
        v = _finite(v) if strict else v
        with np.errstate(all="ignore"):
            return fill(v, np.empty((count, *v.shape[1:])))

    return function


def _finite(values: Array) -> Array:
    return np.where(np.isfinite(values), values, np.nan)
