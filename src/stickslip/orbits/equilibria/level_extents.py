"""Smallest and largest values of expressions over the components of a level set, by branch and
bound: boxes are divided, shrunk by the mean value theorem, and discarded if an upper bound shows
that they contain no larger value than the largest one found so far.

Source: R. B. Kearfott, *Rigorous Global Search: Continuous Problems*, Kluwer (1996).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from stickslip.arrays import Array
from stickslip.numerics.levels import LAST_DIGITS
from stickslip.orbits.equilibria.box_bounds import (
    Enclosures,
    centres,
    enclosed,
    slope_times_distance,
)
from stickslip.orbits.equilibria.level_sets import FURTHEST, MOST_CORNERED, Components
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import enclosures
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.intervals import LOOSE

_EXACT = 1e-12  # accepted error of an extent, relative to its size
_MOST_BOXES = 40_000  # largest number of boxes that are examined
_ROUNDS = 120  # largest number of divisions of a box


@np.errstate(all="ignore")
def extents(cover: Components, expressions: Sequence[Expr]) -> tuple[Array, Array]:
    """Smallest and largest values of expressions over each component.

    Returns
    -------
    array, shape (components, expressions, 2)
    array of the same shape
        Widths of the intervals that are proved to contain them; the values are their midpoints.
    """
    return _Extents(cover, list(expressions)).run()


class _Extents:
    """Maxima of all tasks. A task is a component, an expression and a sign, and its goal is the
    sign times the expression.

    Attributes
    ----------
    which, sign : array, shape (tasks,)
        Index of the expression, and the sign.
    best : array, shape (tasks,)
        Largest value of the goal that is proved to occur.
    most : array, shape (tasks,)
        Upper bound of the goal on the boxes that were discarded before they were decided.
    width : array, shape (tasks,)
        Scale of the goal: the width of the component along an expression that is an unknown,
        otherwise its largest width.
    unit : array, shape (k, tasks)
        Widths of the component.
    task : array, shape (N,)
        Task of each box.
    low, high : array, shape (k, N)
        The boxes.
    inside : array of bool, shape (N,)
        Whether a box is proved to be in the set.
    shrunk : array of bool, shape (N,)
        Whether a side of a box was halved, at least, by the last shrinking.
    """

    def __init__(self, cover: Components, expressions: list[Expr]) -> None:
        self.of = cover.of
        self.cover = cover
        self.expressions = expressions
        tasks = list(product(range(cover.count), range(len(expressions)), (-1.0, 1.0)))
        self.which = np.array([e for _, e, _ in tasks], dtype=int)
        self.sign = np.array([s for _, _, s in tasks])
        self.best = np.full(len(tasks), -math.inf)
        self.most = np.full(len(tasks), -math.inf)
        boxes = [np.flatnonzero(cover.component == c) for c in range(cover.count)]
        chosen = np.concatenate([np.empty(0, int), *(boxes[c] for c, _, _ in tasks)])
        self.task = np.repeat(np.arange(len(tasks)), [len(boxes[c]) for c, _, _ in tasks])
        self.low, self.high = cover.low[:, chosen], cover.high[:, chosen]
        self.inside = cover.inside[chosen]
        hull = np.array(
            [[cover.low[:, b].min(axis=1), cover.high[:, b].max(axis=1)] for b in boxes]
        )
        width = (hull[:, 1] - hull[:, 0]).T if len(boxes) else np.empty((len(self.of.names), 0))
        width = np.where(np.isfinite(width) & (width > 0.0), width, self.of.unit[:, None])
        self.unit = width[:, [c for c, _, _ in tasks]]
        unknowns = {ex.sym(x): i for i, x in enumerate(self.of.names)}
        own = [unknowns.get(expressions[e]) for e in self.which]
        self.width = np.array(
            [max(self.unit[:, j]) if i is None else self.unit[i, j] for j, i in enumerate(own)]
        )

    def run(self) -> tuple[Array, Array]:
        """Values and errors, as :func:`extents` returns them."""
        examined = 0
        for _ in range(_ROUNDS):
            examined += len(self.task)
            self._shrink()
            if not len(self.task) or examined > _MOST_BOXES:
                break
            self._divide()
        np.maximum.at(self.most, self.task, self._upper())
        most = np.maximum(self.most, self.best)
        middle = np.where(self.best == most, most, 0.5 * self.best + 0.5 * most)
        gap = np.where(self.best == most, 0.0, most - self.best)
        shape = (self.cover.count, len(self.expressions), 2)
        return (self.sign * middle).reshape(shape) + 0.0, gap.reshape(shape)

    def _goal(self) -> Enclosures:
        """Enclosures of the goal on each box."""
        found = enclosed(self.expressions, self.of, self.low, self.high)
        which, every = self.which[self.task], np.arange(len(self.task))
        up = self.sign[self.task] > 0.0

        def signed(lower: Array, upper: Array) -> tuple[Array, Array]:
            # Bounds of −f are minus the opposite bounds of f.
            return np.where(up, lower, -upper)[None], np.where(up, upper, -lower)[None]

        low, high = signed(found.low[which, every], found.high[which, every])
        slope_low, slope_high = signed(
            found.slope_low[which, :, every].T, found.slope_high[which, :, every].T
        )
        at_low, at_high = signed(found.at_centre_low[which, every], found.at_centre[which, every])
        return Enclosures(low, high, slope_low, slope_high, at_high, at_low)

    def _upper(self) -> Array:
        """Upper bound of the goal on each box."""
        return self._goal().high[0] if len(self.task) else np.empty(0)

    def _shrink(self) -> None:
        """Shrink boxes, record values at points of the set in them, and discard boxes that cannot
        contain larger values."""
        before = self.high - self.low
        edge = np.flatnonzero(~self.inside)  # boxes that may contain points outside the set
        self._shrink_to_improve()
        empty = np.any(self.low > self.high, axis=0)
        edge = edge[~empty[edge]]
        if len(edge):
            low, high = self.low[:, edge], self.high[:, edge]
            found = self.of.bounds(low, high)
            low, high = contracted(found, low, high)
            gone = np.any(found.high < 0.0, axis=0) | np.any(low > high, axis=0)
            self.low[:, edge] = np.where(gone, self.low[:, edge], low)
            self.high[:, edge] = np.where(gone, self.high[:, edge], high)
            self.inside[edge] = ~gone & np.all(found.low >= 0.0, axis=0)
            empty[edge] = gone
        self.shrunk = np.any(self.high - self.low < 0.5 * before, axis=0)
        self._keep(~empty)
        if not len(self.task):
            return
        self._record_points()
        upper = self._upper()
        # Keep a box if it may contain a value larger than the best one by more than the accepted
        # error, unless it cannot be divided. The bounds of the other boxes are recorded.
        size = np.where(np.isfinite(self.best), np.abs(self.best), 0.0) + self.width
        enough = (self.best + _EXACT * size)[self.task]
        fine = np.all(self._fine(), axis=0)
        np.maximum.at(self.most, self.task[fine], upper[fine])
        near = (upper > self.best[self.task]) & ~(upper > enough)
        np.maximum.at(self.most, self.task[near], upper[near])
        self._keep((upper > enough) & ~fine)

    def _fine(self) -> Array:
        """Sides of boxes that cannot be divided: their ends are neighbouring numbers, or an
        unbounded side begins too far away."""
        unit = self.unit[:, self.task]
        ends = np.maximum(np.abs(self.low), np.abs(self.high))
        least = np.maximum(LAST_DIGITS * unit, 2.0 * np.spacing(ends))
        far = np.where(np.isinf(self.high), self.low, -self.high)
        far = far > FURTHEST * self.of.unit[:, None]
        return np.where(np.isinf(ends), far, self.high - self.low <= least)

    def _shrink_to_improve(self) -> None:
        """Shrink boxes to the parts in which values may exceed the best ones so far."""
        goal = self._goal()
        best = self.best[self.task]
        excess = np.where(np.isfinite(best), goal.at_centre - best, math.inf)
        self.low, self.high = contracted(goal._replace(at_centre=excess), self.low, self.high)

    def _keep(self, kept: Array) -> None:
        """Discard all other boxes."""
        self.task, self.inside = self.task[kept], self.inside[kept]
        self.low, self.high = self.low[:, kept], self.high[:, kept]
        self.shrunk = self.shrunk[kept]

    def _record_points(self) -> None:
        """Record values at corners, midpoints of sides, and centres that are in the set."""
        middle = centres(self.low, self.high)
        k = len(middle)
        # The ends of a box that was shrunk are outside the set by a rounding error.
        step = np.where(self.inside, 0.0, 0.2 * _EXACT * self.unit[:, self.task])
        low, high = np.minimum(self.low + step, middle), np.maximum(self.high - step, middle)
        stops = [low, middle, high] if k <= MOST_CORNERED else [middle]
        choices = list(product(range(len(stops)), repeat=k)) if k <= MOST_CORNERED else [(0,) * k]
        points = np.array(
            [np.concatenate([stops[choice[i]][i] for choice in choices]) for i in range(k)]
        )
        task = np.tile(self.task, len(choices))
        there = np.tile(self.inside, len(choices))
        # The conditions cannot be evaluated at infinity: these points count only if their box is
        # inside.
        finite = np.all(np.isfinite(points), axis=0) & ~there
        there[finite] = self.of.holds(points[:, finite])
        task = task[there]
        if not len(task):
            return
        values = enclosures(self.expressions, self.of.ranges(points[:, there], points[:, there]))
        value = np.array([np.broadcast_to(v, (2, len(task))) for v in values])
        which, every = self.which[task], np.arange(len(task))
        up = self.sign[task] > 0.0
        least = np.where(up, value[which, 0, every], -value[which, 1, every])
        np.maximum.at(self.best, task, np.where(np.isnan(least), -math.inf, least))

    def _divide(self) -> None:
        """Divide boxes that were not shrunk, along their longest side."""
        width = np.where(self._fine(), -1.0, (self.high - self.low) / self.unit[:, self.task])
        i = np.argmax(width, axis=0)
        cut = np.flatnonzero(~self.shrunk)
        middle = centres(self.low, self.high)
        # The bounded parts of an unbounded side grow geometrically.
        step = np.maximum(self.of.unit[:, None], 3.0 * np.abs(middle))
        middle = np.where(np.isinf(self.high), self.low + step, middle)
        middle = np.where(np.isinf(self.low), self.high - step, middle)
        place = middle[i[cut], cut]
        low, high = self.low[:, cut].copy(), self.high[:, cut].copy()
        low[i[cut], np.arange(len(cut))] = place
        self.high[i[cut], cut] = place
        self.low = np.concatenate([self.low, low], axis=1)
        self.high = np.concatenate([self.high, high], axis=1)
        self.inside = np.append(self.inside, self.inside[cut])
        self.task = np.append(self.task, self.task[cut])


@np.errstate(all="ignore")
def contracted(found: Enclosures, low: Array, high: Array) -> tuple[Array, Array]:
    """Shrink boxes to the parts in which conditions may be nonnegative, by the mean value theorem.

    With x = c + t and the slopes in [a, b], every condition g satisfies

        g(x) ≤ g(c) + Σ max(aᵢ tᵢ, bᵢ tᵢ).

    For one unknown i at a time, the other terms are replaced by their maximum over the box. What
    remains is an inequality for tᵢ.

    Parameters
    ----------
    found : Enclosures
        Of the conditions; `low` and `high` are not used.
    low, high : array, shape (k, N)

    Returns
    -------
    low, high : array, shape (k, N)
        Low ends are above high ends if a box contains no such points.
    """
    middle = centres(low, high)
    before, behind = low - middle, high - middle
    gains = np.maximum(
        slope_times_distance(found.slope_high, behind),
        slope_times_distance(found.slope_low, before),
    )
    gains = np.maximum(gains, 0.0)  # (m, k, N): largest contribution of each unknown
    total = gains.sum(axis=1)
    wide = 1.0 + 4.0 * LOOSE  # allows for rounding errors
    for i in range(len(low)):
        others = np.where(np.isfinite(total), total, math.inf)[:, None] - gains[:, i : i + 1]
        room = found.at_centre + others[:, 0]
        slack = 4.0 * LOOSE * (np.abs(found.at_centre) + total)
        room = np.where(np.isfinite(room) & np.isfinite(slack), room + slack, math.inf)
        a, b = found.slope_low[:, i], found.slope_high[:, i]
        # The inequality is b t + room ≥ 0 to the right of the centre, a t + room ≥ 0 to the left.
        # If room ≥ 0, it holds near the centre, up to the zeros of these functions.
        right = np.where((room >= 0.0) & (b < 0.0), room / -b * wide, math.inf)
        left = np.where((room >= 0.0) & (a > 0.0), -room / a * wide, -math.inf)
        # If room < 0, it holds only beyond the zeros: on one side, or on both; then the part
        # between them is not removed.
        away = np.where(room < 0.0, -room / wide, 0.0)
        from_right = np.where(away > 0.0, np.where(b > 0.0, away / b, math.inf), 0.0)
        from_left = np.where(away > 0.0, np.where(a < 0.0, away / a, -math.inf), 0.0)
        no_left = from_left < before[i]
        no_right = from_right > behind[i]
        least = np.where(away > 0.0, np.where(no_left, from_right, -math.inf), left)
        most = np.where(away > 0.0, np.where(no_right, from_left, math.inf), right)
        new_low = np.max(least, axis=0) + middle[i]
        new_high = np.min(most, axis=0) + middle[i]
        low = low.copy()
        high = high.copy()
        low[i] = np.maximum(low[i], np.nextafter(new_low, -math.inf))
        high[i] = np.minimum(high[i], np.nextafter(new_high, math.inf))
    return low, high
