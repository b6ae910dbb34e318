"""Formulas of one variable, on many places at once and on stretches: values at the ends, and what
is off in between."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.symbolic.boxes import deviation, slopes
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr


class Chord(NamedTuple):
    """An array that varies, on m stretches: its values at both ends, and how far it is from the
    line between them.

    All of shape (m, ...).
    """

    start: Array
    end: Array
    off: Array


def chord_values(expressions: list[Expr], u: Any) -> Array:
    """Values of expressions in one name, for a number or an array: shape (expressions, ...)."""
    names = sorted(frozenset[str]().union(*(e.symbols for e in expressions)))
    return evaluator(expressions, names)(np.broadcast_to(u, (len(names), *np.shape(u))))


def table(expressions: list[Expr], u: Array) -> Array:
    """Values of expressions in one name at places of shape (m,), one row each: shape (m,
    expressions)."""
    return np.ascontiguousarray(chord_values(expressions, u).T)


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
