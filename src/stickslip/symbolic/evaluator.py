"""Expressions -> NumPy functions: many states at once, outside the compiled engine.

The source text is made from expression trees by the same lowering as the engine's scalar code
(:func:`stickslip.symbolic.tape.scalar_code`); it holds numbers, operators and the names defined
here, nothing that a user wrote.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.tape import scalar_code

NumericFunction = Callable[[ArrayLike], Array]

_NAMES = {
    "math": SimpleNamespace(
        sin=np.sin,
        cos=np.cos,
        tan=np.tan,
        sinh=np.sinh,
        cosh=np.cosh,
        tanh=np.tanh,
        asinh=np.arcsinh,
        atan=np.arctan,
    ),
    "safe_exp": np.exp,
    "safe_log": np.log,
    "real_power": np.power,
    "reciprocal": np.reciprocal,
}


def evaluator(expressions: Sequence[Expr], names: Sequence[str]) -> NumericFunction:
    """NumPy function of expressions.

    Parameters
    ----------
    expressions : sequence of Expr
        Without functions with kinks: fix their regions first
        (:func:`stickslip.equations.field.mode_field`).
    names : sequence of str
        The names the expressions depend on, in the order of the values.

    Returns
    -------
    function
        Takes values of shape (names, …) and gives results of shape (expressions, …); NaN or
        infinite where undefined.
    """
    return _evaluator(tuple(expressions), tuple(names))


@lru_cache(maxsize=4096)
def _evaluator(expressions: tuple[Expr, ...], names: tuple[str, ...]) -> NumericFunction:
    if any(e.op == "select" for e in ex.walk(expressions)):
        raise ValueError("an expression with kinks has no smooth evaluator; fix its regions first")
    lines, values = scalar_code(expressions, {name: f"v[{i}]" for i, name in enumerate(names)})
    lines += [f"out[{i}] = {values[e]}" for i, e in enumerate(expressions)]
    source = "\n    ".join(["def fill(v, out):", *lines, "return out"])
    space: dict = dict(_NAMES)
    exec(compile(source, "<generated>", "exec"), space)
    fill = space["fill"]
    count = len(expressions)

    def function(values: ArrayLike) -> Array:
        v = np.asarray(values, dtype=float)
        with np.errstate(all="ignore"):
            return fill(v, np.empty((count, *v.shape[1:])))

    return function
