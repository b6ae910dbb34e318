"""Expressions of a smooth field as NumPy computes them: the oracle of what is interpreted."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.equations.field import Field
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr


def function(
    field: Field, expressions: Sequence[Expr]
) -> Callable[[ArrayLike, ArrayLike, ArrayLike], Array]:
    """Function (t, y, p) -> values of expressions.

    Shapes: t () or (…), y (states, …), p (parameters,) or (parameters, …); result (expressions, …).
    """
    evaluate = evaluator(expressions, field.names)
    n = 1 + len(field.state)

    def values(t: ArrayLike, y: ArrayLike, p: ArrayLike) -> Array:
        y, p = np.asarray(y, dtype=float), np.asarray(p, dtype=float)
        given = np.empty((len(field.names), *y.shape[1:]))
        given[0], given[1:n] = t, y
        given[n:] = p.reshape(p.shape + (1,) * (y.ndim - p.ndim))
        return evaluate(given)

    return values
