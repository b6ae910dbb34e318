"""Global minima of a formula over an interval, by branch and bound: proved, with a stated gap.

Every box has a lower bound: the natural one of interval arithmetic, or that of two lines from the
values at its ends with the extreme slopes, whichever is higher. A box whose bound is not below
the smallest value found so far is discarded; the others are divided. A monotone box has its least
value at an end. Near a smooth minimum the error of the second bound is of second order in the width
of a box, so that only a few boxes remain at every level; a narrow minimum costs one level for each
halving, wherever it is.

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

_FIRST = 64  # initial number of boxes
_AT_ONCE = 256  # smallest number of boxes that are examined together
_MOST_PARTS = 16  # largest number of parts into which a box is divided in one step
_MOST = 200_000  # largest number of boxes
_TOLERANCE = 1e-15  # accepted gap, relative to the largest value at the ends of the first boxes
_ROUNDINGS = 4.0  # accepted gap, in units of the rounding of the value at the minimum


@dataclass(frozen=True)
class Least:
    """The global minimum of a formula: between `floor` and `value`.

    Attributes
    ----------
    place : float
        Where the smallest value was found.
    value : float
        That value, rounded up.
    floor : float
        No value is less.
    boxes : int
        Number of boxes examined.
    resolved : bool
        Whether the gap is within the tolerance or rounding; otherwise the limit of boxes was
        reached.
    """

    place: float
    value: float
    floor: float
    boxes: int
    resolved: bool

    @property
    def gap(self) -> float:
        """Width of the interval that contains the minimum."""
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
        Ranges of other names: whatever their values, the minimum is between `floor` and `value`.
    below : float
        Only values less than this are of interest: 0 asks whether there is a negative one. If there
        is none, `floor` is at least that number, up to the tolerance.
    tolerance : float
        Accepted gap, relative to the largest value at the ends of the first boxes.
    most : int
        Boxes after which the search ends, with the remaining gap.
    """
    fixed = dict(others or {})

    def at(places: Array) -> Array:
        (found,) = enclosures([expression], {**fixed, name: (places, places)})
        return np.broadcast_to(found, (2, len(places)))

    ends = np.linspace(low, high, _FIRST + 1)
    values = at(ends)
    finite = values[1][np.isfinite(values[1])]
    accepted = tolerance * float(np.max(np.abs(finite), initial=0.0))
    k = int(np.argmin(values[1]))
    place = float(ends[k])
    best = float(values[1][k])
    noise = float(values[1][k] - values[0][k])
    floor = float(values[0].min())
    examined = 0
    start = ends[:-1]
    end = ends[1:]
    at_start = values[:, :-1]
    at_end = values[:, 1:]
    while True:
        examined += len(start)
        ((box, slope),) = slopes([expression], {**fixed, name: (start, end)}, name)
        bound = np.maximum(
            box[0], between(at_start, at_end, slope, np.nextafter(end - start, math.inf))[0]
        )
        bound = np.minimum(bound, np.minimum(at_start[0], at_end[0]))  # rounding may exceed them
        open_ = bound < min(best, below) - max(accepted, _ROUNDINGS * noise)
        open_ &= end - start > np.spacing(np.maximum(np.abs(start), np.abs(end)))
        floor = min(floor, float(np.min(bound[~open_], initial=math.inf)))
        start = start[open_]
        end = end[open_]
        at_start = at_start[:, open_]
        at_end = at_end[:, open_]
        bound = bound[open_]
        parts = 2 ** int(np.log2(np.clip(_AT_ONCE // max(len(start), 1), 2, _MOST_PARTS)))
        if not len(start) or examined + parts * len(start) > most:
            break
        fractions = np.arange(1, parts) / parts
        inner = start[:, None] + (end - start)[:, None] * fractions
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
    return Least(place, best, floor, examined, not len(start))
