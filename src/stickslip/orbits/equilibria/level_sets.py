"""Connected components of a set {G ≥ 0} in a few unknowns, proved by branch and bound.

The whole space is divided into boxes. An enclosure of every G on a box, natural or by the mean
value theorem, proves the box inside or outside the set; the remaining boxes are on the *edge*. A
box on the edge belongs to one component if there is a direction in which no G that may be negative
there decreases: a straight line from any of its points in the set then stays in the set until it
leaves the box, and if the boxes on that side are inside, or belong to a component already, the
point is in that component. Boxes are divided until each belongs to one component, so that
components are neither joined nor missed; boxes that remain at the limit are reported as undecided.

Source: R. B. Kearfott, *Rigorous Global Search: Continuous Problems*, Kluwer (1996).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise, product
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.kept import cached_property
from stickslip.orbits.equilibria.box_bounds import (
    Enclosures,
    centres,
    domain,
    enclosed,
    far_out,
    slope_times_distance,
)
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import enclosures
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.intervals import LOOSE

_MOST = 20_000  # largest number of boxes
_FEW = 64  # number of boxes up to which each is divided into four, above it into two
_FINEST = 1e-22  # smallest width of a box at 0, in units of the range
_OUTER = 6  # number of divisions of boxes outside the range
FURTHEST = 1e9  # largest distance at which unbounded boxes begin, in the same units
MOST_CORNERED = 3  # number of unknowns up to which all corners of boxes count as directions
_LEAST = 5e-324  # magnitude of a negative number that is not known better
_MOST_ROWS = 60  # largest number of sums of conditions for unbounded boxes
_TIE = 1e-6  # weight of the width of a side, which decides only between equal changes


@dataclass(frozen=True)
class LevelSet:
    """A set of points where conditions are nonnegative (and defined).

    Attributes
    ----------
    names : tuple of str
        The unknowns.
    values : mapping of str to float
        Values of all other names.
    core : array, shape (2, k)
        Ranges of the unknowns: all components that intersect them are computed, including their
        parts outside.
    """

    conditions: tuple[Expr, ...]
    names: tuple[str, ...]
    values: Mapping[str, float]
    core: Array

    @cached_property
    def _all(self) -> list[Expr]:
        """The conditions, preceded by the expressions that are nonnegative in their domains."""
        return list(dict.fromkeys([*self._domains, *self.conditions]))

    @cached_property
    def _domains(self) -> list[Expr]:
        found = (d for e in self.conditions for d in domain(e))
        return [d for d in dict.fromkeys(found) if d.op != "num" or ex.number(d) < 0.0]

    def ranges(self, low: Array, high: Array) -> dict[str, tuple[Any, Any]]:
        """Ranges of all names on boxes of shape (k, N)."""
        held = {name: (value, value) for name, value in self.values.items()}
        return held | {x: (low[i], high[i]) for i, x in enumerate(self.names)}

    def bounds(self, low: Array, high: Array) -> Enclosures:
        """Enclosures of all conditions on boxes of shape (k, N)."""
        found = enclosed(self._all, self, low, high, len(self._domains))
        endless = np.flatnonzero(np.any(np.isinf(low) | np.isinf(high), axis=0))
        if len(endless):
            ranges = self.ranges(low[:, endless], high[:, endless])
            fine = np.all(found.low[: len(self._domains), endless] >= 0.0, axis=0)
            for i, forms in enumerate(self._far_out):
                sure = fine & ((low[i, endless] > 0.0) | (high[i, endless] < 0.0))
                for n, box in enumerate(enclosures(forms, ranges)):
                    least, most = np.broadcast_to(box, (2, len(endless)))
                    least, most = np.where(sure, least, -math.inf), np.where(sure, most, math.inf)
                    found.low[n, endless] = np.maximum(found.low[n, endless], least)
                    found.high[n, endless] = np.minimum(found.high[n, endless], most)
            for _, most in enclosures(self._combined, ranges):
                found.high[0, endless[np.broadcast_to(most < 0.0, len(endless))]] = -_LEAST
        return found

    @cached_property
    def _far_out(self) -> list[list[Expr]]:
        """The conditions in the form used for bounds at large unknowns."""
        return [[far_out(e, x) for e in self._all] for x in self.names]

    @cached_property
    def _combined(self) -> list[Expr]:
        """Sums of conditions in which the linear terms of all unknowns but one cancel: far out, a
        sum may be negative although no single condition is."""
        found: list[Expr] = []
        numbers = {name: ex.num(value) for name, value in self.values.items()}
        plain = [ex.substitute(e, numbers) for e in self.conditions]
        for kept in self.names if len(self.names) > 1 else ():
            rows = list(plain)
            for x in self.names:
                if x == kept or len(rows) > _MOST_ROWS:
                    continue
                slopes = [(e, self._linear(e, x)) for e in rows]
                rows = [e for e, c in slopes if c == 0.0]
                up = [(e, c) for e, c in slopes if c > 0.0]
                down = [(e, -c) for e, c in slopes if c < 0.0]
                rows += [ex.add((e, b), (f, a)) for (e, a), (f, b) in product(up, down)]
            found += [e for e in rows if e not in plain]
        return found if len(found) <= _MOST_ROWS else []

    def _linear(self, e: Expr, x: str) -> float:
        """Coefficient of an unknown in a sum."""
        return sum(c for term, c in e.terms if term is ex.sym(x)) if e.op == "sum" else 0.0

    def holds(self, points: Array) -> Array:
        """Return whether all conditions are proved to hold at points of shape (k, N)."""
        found = enclosures(self._all, self.ranges(points, points))
        return np.all([np.broadcast_to(box[0], points.shape[1]) >= 0.0 for box in found], axis=0)

    @cached_property
    def unit(self) -> Array:
        """Widths of the ranges, shape (k,)."""
        return self.core[1] - self.core[0]

    def cuts(self, i: int) -> list[float]:
        """Places at which an unknown is divided from the start: the ends of its range, and where
        formulas change from branch to branch."""
        x = self.names[i]
        low, high = self.core[:, i]
        found = {float(low), float(high)}
        for guard in {n.args[0] for n in ex.walk(self._all) if n.op == "select"}:
            if guard.symbols & set(self.names) != {x} or ex.bends(guard, [x]):
                continue
            slope = ex.derivative(guard, x)
            if x not in slope.symbols:
                a = ex.evaluate(slope, self.values)
                b = ex.evaluate(ex.substitute(guard, {x: ex.ZERO}), self.values)
                place = -b / a if a else math.nan
                if low < place < high:
                    # A jump is between two neighbouring numbers.
                    found |= {place, math.nextafter(place, -math.inf)}
                    found |= {math.nextafter(place, math.inf)}
        return sorted(found)

    def components(self) -> Components:
        """All components that have points in the core."""
        return _Covering(self).run()


# -- the cover -------------------------------------------------------------------------------------


@dataclass
class Components:
    """Boxes that contain a set, by component.

    Attributes
    ----------
    low, high : array, shape (k, N)
    inside : array of bool, shape (N,)
        Boxes that lie in the set; others are on the edge.
    component : array of int, shape (N,)
    count : int
        Number of components.
    undecided : array, shape (2, k, boxes)
        Boxes of which it is not known whether they hold points of the set, or of which component.
    unsure : frozenset of int
        Components that these touch.
    beyond : array, shape (2, k, boxes)
        Boxes outside the core that may have other components in them.
    """

    of: LevelSet
    low: Array
    high: Array
    inside: Array
    component: Array
    count: int
    undecided: Array
    unsure: frozenset[int]
    beyond: Array

    def centre(self, component: int) -> Array:
        """The middle of the largest box inside a component."""
        own = np.flatnonzero(self.inside & (self.component == component))
        low, high = self.low[:, own], self.high[:, own]
        unit = self.of.unit[:, None]
        low = np.maximum(low, np.where(np.isfinite(high), high, 0.0) - unit)
        high = np.minimum(high, np.where(np.isfinite(low), low, 0.0) + unit)
        best = int(np.argmax(np.min((high - low) / unit, axis=0)))
        return centres(low, high)[:, best]

    def size(self, component: int) -> tuple[float, float]:
        """Length, area or volume of a component: bounds."""
        own = self.component == component
        widths = np.prod(self.high - self.low, axis=0)
        return float(widths[own & self.inside].sum()), float(widths[own].sum())


@dataclass
class _Covering:
    """Boxes during subdivision; boxes are the last axis of arrays."""

    of: LevelSet
    low: Array = field(init=False)
    high: Array = field(init=False)
    inside: Array = field(init=False)
    rising: Array = field(init=False)  # (directions, N): whether no condition falls that way
    own: Array = field(init=False)  # (k, N): the last of these directions, one for each box
    smear: Array = field(init=False)  # (N,): unknown by which to divide
    pairs: Array = field(init=False)  # (2, pairs): boxes that touch

    def __post_init__(self) -> None:
        k = len(self.of.names)
        some = product((0, 1, -1), repeat=k) if k <= MOST_CORNERED else ()
        axes = [*np.eye(k), *-np.eye(k)]
        more = [d for d in some if np.count_nonzero(d) > 1]
        self.directions = np.array([*axes, *more], dtype=float)

    def run(self) -> Components:
        ends = [[-math.inf, *self.of.cuts(i), math.inf] for i in range(len(self.of.names))]
        parts = [list(pairwise(e)) for e in ends]
        boxes = np.array(list(product(*parts)))  # (N, k, 2)
        n = len(boxes)
        first, second = np.triu_indices(n, 1)
        self._start(boxes[:, :, 0].T, boxes[:, :, 1].T, np.array([first, second]))
        looked = n
        turn = 0
        while True:
            label, again = self._labels(turn < _OUTER)
            again &= self._divisible
            parts_each = 4 if np.count_nonzero(again) <= _FEW else 2
            looked += parts_each * int(np.count_nonzero(again))
            if not again.any() or looked > _MOST:
                return self._result(label)
            self._divide(again, parts_each, turn)
            turn += 1

    # -- boxes -------------------------------------------------------------------------------------

    def _start(self, low: Array, high: Array, pairs: Array) -> None:
        self.low, self.high = low, high
        self.inside = np.zeros(low.shape[1], bool)
        self.rising = np.zeros((len(self.directions) + 1, low.shape[1]), bool)
        self.own = np.zeros(low.shape)
        self.smear = np.zeros(low.shape[1], int)
        self.pairs = pairs
        self._assess(np.arange(low.shape[1]))

    @np.errstate(all="ignore")
    def _assess(self, new: Array, widest: bool = False) -> None:
        """Judge new boxes; drop those that are outside."""
        low, high = self.low[:, new], self.high[:, new]
        found = self.of.bounds(low, high)
        unsure = found.low < 0.0
        outside = np.any(found.high < 0.0, axis=0) | self._between_outsides(low, high)
        self.inside[new] = ~np.any(unsure, axis=0) & ~outside
        width = high - low
        self.own[:, new] = own = self._ascent(found, unsure, width)
        for j, d in enumerate([*self.directions[:, :, None], own]):
            ways = d * np.where(d == 0.0, 0.0, width)
            rates = np.minimum(
                slope_times_distance(found.slope_low, ways),
                slope_times_distance(found.slope_high, ways),
            )
            least = rates.sum(axis=1) - 4.0 * LOOSE * np.abs(rates).sum(axis=1)
            risen = np.all(~unsure | (least >= 0.0), axis=0) & np.any(ways != 0.0, axis=0)
            self.rising[j, new] = risen & np.all(np.isfinite(ways), axis=0)
        steep = np.maximum(np.abs(found.slope_low), np.abs(found.slope_high))
        change = np.where(unsure[:, None], slope_times_distance(steep, width), 0.0)
        change = np.where(np.isfinite(change), change, 0.0)
        most = np.max(change, axis=1, keepdims=True)  # each condition is scaled separately
        part = np.max(change / np.where(most > 0.0, most, 1.0), axis=0)
        relative = width / self.of.unit[:, None]
        part = relative if widest else part + _TIE * np.minimum(relative, 1e6)
        part = np.where(self._fine(low, high), -1.0, np.where(np.isinf(width), math.inf, part))
        self.smear[new] = np.argmax(part, axis=0)
        self._keep(np.isin(np.arange(self.low.shape[1]), new[outside], invert=True))

    def _ascent(self, found: Enclosures, unsure: Array, width: Array) -> Array:
        """A direction in each box, in units of its widths, in which undecided conditions increase:
        the sum of their normalised slopes; 0 if there is none."""
        slope = np.where(unsure[:, None], (0.5 * found.slope_low + 0.5 * found.slope_high), 0.0)
        slope = np.where(slope == 0.0, 0.0, slope * width)
        size = np.linalg.norm(slope, axis=1, keepdims=True)
        total = np.sum(slope / np.where(size > 0.0, size, 1.0), axis=0)
        total = total / np.max(np.abs(total), axis=0)
        return np.where(np.all(np.isfinite(total), axis=0), total, 0.0)

    def _between_outsides(self, low: Array, high: Array) -> Array:
        """Return whether boxes are between neighbouring floating-point numbers neither of which is
        in the set: at a jump a formula has one of two values, and none between them."""
        gone = np.zeros(low.shape[1], bool)
        for i in range(len(low)):
            thin = np.flatnonzero((high[i] <= np.nextafter(low[i], math.inf)) & ~gone)
            if len(thin):
                own = np.arange(len(low))[:, None] == i
                faces = [
                    self.of.bounds(
                        np.where(own, end[:, thin], low[:, thin]),
                        np.where(own, end[:, thin], high[:, thin]),
                    )
                    for end in (low, high)
                ]
                gone[thin] = np.all([np.any(f.high < 0.0, axis=0) for f in faces], axis=0)
        return gone

    def _fine(self, low: Array, high: Array) -> Array:
        """By unknown, whether boxes are not divided any more."""
        unit = self.of.unit[:, None]
        least = np.maximum(_FINEST * unit, 8.0 * np.spacing(np.maximum(abs(low), abs(high))))
        far = np.where(np.isinf(high), low, -high) > FURTHEST * unit
        with np.errstate(invalid="ignore"):
            return np.where(np.isinf(high - low), far, high - low <= least)

    @property
    def _divisible(self) -> Array:
        return ~np.all(self._fine(self.low, self.high), axis=0)

    def _keep(self, kept: Array) -> Array:
        """Drop boxes, with all pairs they are in."""
        number = np.cumsum(kept) - 1
        self.low, self.high = self.low[:, kept], self.high[:, kept]
        self.inside, self.smear = self.inside[kept], self.smear[kept]
        self.rising, self.own = self.rising[:, kept], self.own[:, kept]
        pairs = self.pairs[:, kept[self.pairs].all(axis=0)]
        pairs = number[pairs]
        a, b = pairs
        touching = np.all(
            (self.low[:, a] <= self.high[:, b]) & (self.low[:, b] <= self.high[:, a]), axis=0
        )
        self.pairs = pairs[:, touching]
        return number

    def _divide(self, chosen: Array, parts: int, turn: int) -> None:
        old = np.flatnonzero(chosen)
        n = self.low.shape[1]
        i = self.smear[old]
        low, high = self.low[i, old], self.high[i, old]
        places = np.empty((parts + 1, len(old)))
        unit = self.of.unit[i]
        step = np.maximum(unit, 3.0 * np.abs(np.where(np.isinf(high), low, high)))
        for j in range(parts + 1):
            share = j / parts
            with np.errstate(invalid="ignore"):
                between = np.clip(low + share * (high - low), low, high)
            further = low + step * (4.0**j - 1.0) / 3.0 if j < parts else np.inf
            nearer = high - step * (4.0 ** (parts - j) - 1.0) / 3.0 if j else -np.inf
            places[j] = np.where(np.isinf(high), further, np.where(np.isinf(low), nearer, between))
        places[0], places[-1] = low, high
        children = np.arange(n, n + parts * len(old)).reshape(parts, -1)
        new_low, new_high = (np.tile(end[:, old], parts) for end in (self.low, self.high))
        every = np.arange(parts * len(old))
        new_low[np.tile(i, parts), every] = places[:-1].ravel()
        new_high[np.tile(i, parts), every] = places[1:].ravel()
        # Every pair of an old box becomes pairs of its parts; parts touch each other.
        becomes = np.full((parts, n), -1)
        becomes[0] = np.arange(n)
        becomes[:, old] = children
        a, b = self.pairs
        both = np.array(
            [(becomes[p][a], becomes[q][b]) for p, q in product(range(parts), repeat=2)]
        )
        both = both.swapaxes(0, 1).reshape(2, -1)
        both = both[:, (both >= 0).all(axis=0)]
        own = np.array([(children[p], children[p + 1]) for p in range(parts - 1)])
        self.pairs = np.concatenate([both, own.swapaxes(0, 1).reshape(2, -1)], axis=1)
        more = parts * len(old)
        self.low = np.concatenate([self.low, new_low], axis=1)
        self.high = np.concatenate([self.high, new_high], axis=1)
        self.inside = np.append(self.inside, np.zeros(more, bool))
        self.smear = np.append(self.smear, np.zeros(more, int))
        self.rising = np.concatenate(
            [self.rising, np.zeros((len(self.rising), more), bool)], axis=1
        )
        self.own = np.concatenate([self.own, np.zeros((len(self.own), more))], axis=1)
        kept = np.append(~chosen, np.ones(more, bool))
        number = self._keep(kept)
        self._assess(number[children.ravel()], widest=turn % 4 == 3)

    # -- components --------------------------------------------------------------------------------

    @property
    def _in_core(self) -> Array:
        low, high = self.of.core[0][:, None], self.of.core[1][:, None]
        return np.all((self.low < high) & (self.high > low), axis=0)

    def _labels(self, everywhere: bool) -> tuple[Array, Array]:
        """The component of every box (−1: not known), and which boxes must be divided."""
        while True:
            label = self._grounded()
            empty = label == -2
            if not empty.any():
                break
            self._keep(~empty)
        a, b = self.pairs
        known = label >= 0
        apart = known[a] & known[b] & (label[a] != label[b])
        wanted = np.isin(label, np.unique(label[known & self._in_core])) & known
        again = np.zeros(len(label), bool)
        again[self.pairs[:, apart & (wanted[a] | wanted[b])]] = True
        again &= ~self.inside
        open_ = ~known & self._in_core
        near = wanted | open_
        again |= ~known if everywhere else open_
        again[a[~known[a] & near[b]]] = True
        again[b[~known[b] & near[a]]] = True
        # Boxes of minimum width are decided by their neighbours.
        stuck = again & ~known & ~self._divisible
        again[a[stuck[b]]] = True
        again[b[stuck[a]]] = True
        return label, again & ~self.inside

    def _grounded(self) -> Array:
        """Components of boxes; −1: unknown, −2: empty box."""
        n = self.low.shape[1]
        label = np.full(n, -1)
        label[self.inside] = np.arange(np.count_nonzero(self.inside))
        a, b = np.concatenate([self.pairs, self.pairs[::-1]], axis=1)
        face = self._faces(a, b)
        thin = self._fine(self.low, self.high)
        label = self._joined(label, a, b)
        while True:
            changed = False
            ways = [
                (risen, (face != 0) & (np.take(d, np.abs(face) - 1) == np.sign(face)))
                for d, risen in zip(self.directions, self.rising[:-1], strict=True)
            ]
            side = np.sign(self.own[np.abs(face) - 1, a])
            ways.append((self.rising[-1], (face != 0) & (side == np.sign(face))))
            # A box as thin as rounding cannot hide a gap.
            ways += [(thin[i], np.abs(face) == i + 1) for i in range(len(thin))]
            for j, (risen, across) in enumerate(ways):
                open_ = (label == -1) & risen
                if not open_.any():
                    continue
                used = across & open_[a]
                start, end = a[used], label[b[used]]
                count = np.bincount(start, minlength=n)
                least = np.full(n, n)
                most = np.full(n, -1)
                np.minimum.at(least, start, end)
                np.maximum.at(most, start, end)
                done = open_ & (count > 0) & (least >= 0) & (least == most)
                label[done] = least[done]
                empty = open_ & (count == 0) & (j < len(self.rising))
                label[empty] = -2
                if empty.any():
                    return label
                changed |= bool(done.any())
            if not changed:
                return label
            label = self._joined(label, a, b)

    def _joined(self, label: Array, a: Array, b: Array) -> Array:
        """Merge components with a common point: they touch in an inner box."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        known = label >= 0
        if not known.any():
            return label
        meet = known[a] & known[b] & (self.inside[a] | self.inside[b]) & (label[a] != label[b])
        if not meet.any():
            return label
        count = int(label.max()) + 1
        ones = np.ones(np.count_nonzero(meet))
        graph = coo_array((ones, (label[a[meet]], label[b[meet]])), shape=(count, count))
        _, new = connected_components(graph, directed=False)
        return np.where(known, new[np.where(known, label, 0)], label)

    def _faces(self, a: Array, b: Array) -> Array:
        """The unknown, numbered from 1, normal to the common face of a and b, negative if b is
        below; 0 if they have no common face."""
        above = self.high[:, a] == self.low[:, b]
        below = self.low[:, a] == self.high[:, b]
        between = above | below
        which = np.argmax(between, axis=0)
        one = np.count_nonzero(between, axis=0) == 1
        side = np.where(above[which, np.arange(len(a))], 1, -1)
        return np.where(one, side * (which + 1), 0)

    def _result(self, label: Array) -> Components:
        known = label >= 0
        core = self._in_core
        numbers = np.unique(label[known & core])
        wanted = known & np.isin(label, numbers)
        a, b = self.pairs
        apart = known[a] & known[b] & (label[a] != label[b])
        unclear = np.zeros(len(label), bool)
        unclear[self.pairs[:, apart & (wanted[a] | wanted[b])]] = True
        unclear &= ~self.inside
        left = ~known & core
        near = wanted | left
        left[a[~known[a] & near[b]]] = True
        left[b[~known[b] & near[a]]] = True
        touched = np.zeros(len(label), bool)
        touched[a[left[b]]] = True
        touched[b[left[a]]] = True
        unsure = set(label[(touched | unclear) & wanted])
        undecided = left | (unclear & wanted)
        other = ~wanted & ~left
        other = ~wanted & ~left
        component = np.searchsorted(numbers, label)
        component = np.where(wanted, component, -1)
        kept = component >= 0
        return Components(
            self.of,
            self.low[:, kept],
            self.high[:, kept],
            self.inside[kept],
            component[kept],
            len(numbers),
            np.array([self.low[:, undecided], self.high[:, undecided]]),
            frozenset(int(np.searchsorted(numbers, u)) for u in unsure),
            np.array([self.low[:, other], self.high[:, other]]),
        )


# -- extents ---------------------------------------------------------------------------------------
