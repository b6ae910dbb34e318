"""Enclosures on many boxes at once, as arrays of shape (2, boxes): lower ends, upper ends; and the
deviation of formulas of one variable from straight lines on intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.symbolic.enclosures import Enclosure
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.intervals import LOOSE, Intervals

Box = Array  # shape (2, boxes)

_ARRAYS = Intervals(
    SimpleNamespace(
        minimum=np.minimum,
        maximum=np.maximum,
        where=np.where,
        lower=lambda x: np.nextafter(x, -math.inf),
        inverse=lambda x: np.divide(1.0, x),
        floor=np.floor,
        power=np.power,
        function=lambda row: row.array,
    )
)


def enclosures(expressions: Sequence[Expr], ranges: Mapping[str, Any]) -> list[Box]:
    """Enclosures of the values of expressions.

    Parameters
    ----------
    ranges : mapping of str to (low, high)
        Numbers or arrays of shape (boxes,); a name that is missing is unbounded.

    Returns
    -------
    list of arrays, shape (2, boxes)
    """
    with np.errstate(all="ignore"):
        found = Enclosure(expressions, ranges, _ARRAYS)
        return [_box(found.values[e], ranges) for e in expressions]


def slopes(
    expressions: Sequence[Expr], ranges: Mapping[str, Any], name: str
) -> list[tuple[Box, Box]]:
    """Values, and slopes with respect to one name; arguments as for :func:`enclosures`.

    Where a function has a kink, its slopes to both sides count; where it may jump, its slope is
    unbounded. So f(y) − f(x) lies in the slope times y − x, for all x and y in a box.
    """
    with np.errstate(all="ignore"):
        found = Enclosure(expressions, ranges, _ARRAYS, name)
        return [(_box(found.values[e], ranges), _box(found.slope(e), ranges)) for e in expressions]


def _box(interval: Any, ranges: Mapping[str, Any]) -> Box:
    count = max((np.size(low) for low, _ in ranges.values()), default=1)
    return np.stack([np.broadcast_to(end, count) for end in interval]).astype(float, copy=False)


def between(start: Box, end: Box, slope: Box, width: Array) -> Box:
    """Enclosure of a function on boxes, from its values at both ends and its slopes.

    Below it are two lines, one from each end. Any place divides a box: before it, the function is
    at least what the line from the start has there, after it what the line to the end has. At the
    place where the lines meet the smaller of the two is largest.
    """
    down = _above_lines(start[0], end[0], slope, width)
    up = _above_lines(-start[1], -end[1], -slope[::-1], width)
    return np.stack([down, -up])


def _above_lines(start: Array, end: Array, slope: Box, width: Array) -> Array:
    # With 0 among the slopes the lines fall away from both ends, so that they meet in the box.
    least, most = np.minimum(slope[0], 0.0), np.maximum(slope[1], 0.0)
    with np.errstate(all="ignore"):
        place = np.nan_to_num(np.clip((most * width - (end - start)) / (most - least), 0.0, width))
        before = least * place
        after = most * (width - place)
        low = np.minimum(start + before, end - after)
        # Rounding errors of this bound itself: the result stays a rigorous enclosure.
        low -= LOOSE * (np.maximum(np.abs(start), np.abs(end)) + np.abs(before) + np.abs(after))
    low = np.where(least == 0.0, start, np.where(most == 0.0, end, low))
    return np.where(np.isfinite(low), low, -math.inf)


def deviation(start: Array, end: Array, value: Box, slope: Box, width: Array) -> Array:
    """Bound of the deviation of a function from the straight line between its values at both ends
    of boxes, shape (..., boxes).

    With slopes between d₁ and d₂ and the slope m of the line, that is (d₂ − m)(m − d₁)/(d₂ − d₁)
    times the width; and it is no more than what its values spread beyond those at the ends. (Up to
    the rounding of these values.)

    Parameters
    ----------
    start, end : array, shape (..., boxes)
        Values at the ends.
    value, slope : array, shape (2, ..., boxes)
        Bounds on values and slopes.
    width : array, shape (boxes,)
    """
    with np.errstate(all="ignore"):
        mean = np.clip((end - start) / width, slope[0], slope[1])
        bent = np.nan_to_num(
            (slope[1] - mean) * (mean - slope[0]) / (slope[1] - slope[0]), nan=0.0, posinf=math.inf
        )
        spread = np.maximum(value[1] - np.minimum(start, end), np.maximum(start, end) - value[0])
        least = np.minimum(np.where(np.isfinite(slope).all(axis=0), bent * width, math.inf), spread)
    return np.maximum(least, 0.0)


# -- stretches -------------------------------------------------------------------------------------


class Chord(NamedTuple):
    """An array that varies on m intervals: its values at both ends, and bounds of its deviation
    from linear interpolation.

    All of shape (m, ...).
    """

    start: Array
    end: Array
    off: Array


def chord_values(expressions: list[Expr], u: Any) -> Array:
    """Values of expressions in one name, for a number or an array: shape (expressions, ...)."""
    names = sorted(frozenset[str]().union(*(e.symbols for e in expressions)))
    return evaluator(expressions, names)(np.broadcast_to(u, (len(names), *np.shape(u))))


def value_rows(expressions: list[Expr], u: Array) -> Array:
    """Values of expressions in one name at places of shape (m,), one row each: shape (m,
    expressions)."""
    return np.ascontiguousarray(chord_values(expressions, u).T)


def deviations(
    expressions: list[Expr], name: str, low: Array, high: Array, start: Array, end: Array
) -> Array:
    """Bounds of the deviations of expressions from linear interpolation between their values at
    both ends of intervals.

    Parameters
    ----------
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
