"""Global minima of a formula over an interval, by branch and bound: proved, with a stated gap.

Every box has a lower bound: the natural one of interval arithmetic, or that of two lines from the
values at its ends with the extreme slopes, whichever is higher. A box that cannot hold anything
smaller than what was met is done with; the others are divided. A monotone box has its least value
at an end. Near a smooth minimum the second bound is off by the square of the width of a box, so
that a few boxes are left at every level; narrow minima cost a level for each halving, wherever they
are.

Source: R. B. Kearfott, *Rigorous Global Search: Continuous Problems*, Kluwer (1996).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.symbolic.boxes import between, enclosures, slopes
from stickslip.symbolic.expressions import Expr

_FIRST = 64  # boxes to begin with
_AT_ONCE = 256  # boxes that are looked at together, at least
_FINEST = 16  # parts of a box at once
_MOST = 200_000  # boxes in all
_TOLERANCE = 1e-15  # gap that will do, relative to the largest value at the first ends of boxes
_ROUNDINGS = 4.0  # gaps that will do, in units of the rounding of the value at the minimum


@dataclass(frozen=True)
class Least:
    """The global minimum of a formula: between `floor` and `value`.

    Attributes
    ----------
    place : float
        Where the smallest value was met.
    value : float
        That value, rounded up.
    floor : float
        No value is less.
    boxes : int
        How many were looked at.
    resolved : bool
        Whether the gap is that of the tolerance or of rounding; otherwise the boxes were at their
        limit.
    """

    place: float
    value: float
    floor: float
    boxes: int
    resolved: bool

    @property
    def gap(self) -> float:
        """What is not known of the minimum."""
        return self.value - self.floor


def least(
    expression: Expr,
    name: str,
    low: float,
    high: float,
    *,
    others: Mapping[str, tuple[float, float]] | None = None,
    below: float = math.inf,
    tolerance: float = _TOLERANCE,
    most: int = _MOST,
) -> Least:
    """The least value of an expression for a name between two numbers.

    Parameters
    ----------
    others : mapping of str to (float, float), optional
        Ranges of other names; with them, `value` holds for the whole of these ranges as little as
        `floor` does.
    below : float
        Only values less than this are of interest: 0 asks whether there is a negative one. If there
        is none, `floor` is at least that number, up to the tolerance.
    tolerance : float
        Gap that will do, relative to the largest value at the first ends of boxes.
    most : int
        Boxes after which the search ends, with the gap that is left.
    """
    fixed = dict(others or {})

    def at(places: Array) -> Array:
        (found,) = enclosures([expression], {**fixed, name: (places, places)})
        return np.broadcast_to(found, (2, len(places)))

    ends = np.linspace(low, high, _FIRST + 1)
    values = at(ends)
    finite = values[1][np.isfinite(values[1])]
    enough = tolerance * float(np.max(np.abs(finite), initial=0.0))
    k = int(np.argmin(values[1]))
    place = float(ends[k])
    best = float(values[1][k])
    noise = float(values[1][k] - values[0][k])
    floor = float(values[0].min())
    looked = 0
    start = ends[:-1]
    end = ends[1:]
    at_start = values[:, :-1]
    at_end = values[:, 1:]
    while True:
        looked += len(start)
        ((box, slope),) = slopes([expression], {**fixed, name: (start, end)}, name)
        bound = np.maximum(
            box[0], between(at_start, at_end, slope, np.nextafter(end - start, math.inf))[0]
        )
        bound = np.minimum(bound, np.minimum(at_start[0], at_end[0]))  # by rounding
        open_ = bound < min(best, below) - max(enough, _ROUNDINGS * noise)
        open_ &= end - start > np.spacing(np.maximum(np.abs(start), np.abs(end)))
        floor = min(floor, float(np.min(bound[~open_], initial=math.inf)))
        start = start[open_]
        end = end[open_]
        at_start = at_start[:, open_]
        at_end = at_end[:, open_]
        bound = bound[open_]
        parts = 2 ** int(np.log2(np.clip(_AT_ONCE // max(len(start), 1), 2, _FINEST)))
        if not len(start) or looked + parts * len(start) > most:
            break
        share = np.arange(1, parts) / parts
        inner = start[:, None] + (end - start)[:, None] * share
        values = at(inner.ravel())
        k = int(np.argmin(values[1]))
        if values[1][k] < best:
            place = float(inner.flat[k])
            best = float(values[1][k])
            noise = float(values[1][k] - values[0][k])
        start, end = np.column_stack([start, inner]).ravel(), np.column_stack([inner, end]).ravel()
        values = values.reshape(2, *inner.shape)
        at_start, at_end = (
            np.concatenate(pair, axis=2).reshape(2, -1)
            for pair in ((at_start[:, :, None], values), (values, at_end[:, :, None]))
        )
    floor = min(floor, float(np.min(bound, initial=math.inf)))
    return Least(place, best, floor, looked, not len(start))
