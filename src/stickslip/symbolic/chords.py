"""Formulas of one variable, on many places at once and on stretches: values at the ends, and what
is off in between."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import NUMPY, deviation, slopes
from stickslip.symbolic.expressions import Expr


class Chord(NamedTuple):
    """An array that varies, on m stretches: its values at both ends, and how far it is from the
    line between them.

    All of shape (m, ...).
    """

    start: Array
    end: Array
    off: Array


def evaluate(expressions: list[Expr], u: Any) -> list[Any]:
    """Values of expressions in one name, for a number or an array; NaN where undefined."""
    known: dict[Expr, Any] = {}
    with np.errstate(all="ignore"):
        for e in ex.walk(expressions):
            known[e] = value_of(e, np.float64(u) if np.ndim(u) == 0 else u, known)
    return [known[e] for e in expressions]


def value_of(e: Expr, u: Any, known: dict[Expr, Any]) -> Any:
    """Value of one node from those of its arguments, which are `known`."""
    match e.op:
        case "num":
            return ex.number(e)
        case "sym":
            return u
        case "sum":
            return float(e.value) + sum(c * known[term] for term, c in e.terms)
        case "prod":
            return math.prod(np.power(known[base], p) for base, p in e.terms)
        case "pow":
            return np.power(known[e.args[0]], known[e.args[1]])
        case "select":
            guard, above, below = (known[a] for a in e.args)
            return np.where(guard >= 0.0, above, below)
        case _:
            return NUMPY[e.op](known[e.args[0]])


def table(expressions: list[Expr], u: Array) -> Array:
    """Values of expressions in one name at places of shape (m,), one row each: shape (m,
    expressions)."""
    columns = evaluate(expressions, u)
    return np.column_stack([np.broadcast_to(column, len(u)) for column in columns]).astype(
        float, copy=False
    )


def deviations(
    expressions: list[Expr], name: str, low: Array, high: Array, start: Array, end: Array
) -> Array:
    """How far expressions can be from the straight lines between their values at both ends of
    stretches.

    Parameters
    ----------
    expressions : list of Expr
    name : str
    low, high : ndarray of shape (m,)
    start, end : ndarray of shape (m, expressions)
        Values at the ends.

    Returns
    -------
    ndarray of shape (m, expressions)
        Bounds. What is narrower than a few roundings of the name has no inside: times and phases
        are known to rounding.
    """
    off = np.zeros(start.shape)
    wide = high - low > 4.0 * np.spacing(np.maximum(np.abs(low), np.abs(high)))
    if wide.any():
        inside = slopes(expressions, {name: (low[wide], high[wide])}, name)
        value, slope = (np.stack(part, axis=1) for part in zip(*inside, strict=True))
        off[wide] = deviation(start[wide].T, end[wide].T, value, slope, (high - low)[wide]).T
    return off
