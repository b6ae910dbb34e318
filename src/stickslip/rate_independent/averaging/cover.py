"""A cover of all phases of a potential by a tree of intervals, refined as a force requires."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.rate_independent.averaging.minima import PHASE_SAMPLES
from stickslip.rate_independent.sets.phase_intervals import NOWHERE_NEAR, Index, Near
from stickslip.rate_independent.sets.potential import Dissipation
from stickslip.rate_independent.signals.signal import NARROWEST_INTERVAL

_PARTS = 8  # number of parts of a divided interval
# neighbours on both sides that are also divided, in anticipation of the next force
_AHEAD = 4
# accepted excess of a force beyond K(s), relative to the largest excess that was found
_SHARE = 0.05
_MOST = 2**18  # largest number of intervals
# distance from the end of a period below which a phase is regarded as close to it
_BESIDE = 2.0**-7
NO_PHASES = np.zeros(0)  # phases at which a force touches


class SearchResult(NamedTuple):
    """Results for a force.

    Attributes
    ----------
    phases, excess : ndarray of shape (k,)
        Ends of phase intervals, and the excess of the force over K(s) there.
    bound : float
        Upper bound of the excess over all phases; infinite if the search was ended by a larger
        excess.
    """

    phases: Array
    excess: Array
    bound: float


class Cover:
    """The phases of a potential, on intervals that are successively divided.

    An interval is divided if a force that is inside K(s) at its ends may be outside in between. The
    subdivision is kept for the next force, so that nearby forces cost a few passes over arrays.
    """

    def __init__(self, source: Dissipation) -> None:
        self.source = source
        edges = (
            np.arange(PHASE_SAMPLES + 1) / PHASE_SAMPLES if source.depends_on_phase else np.zeros(2)
        )
        self.low: Array = edges[:-1]
        self.high: Array = edges[1:]
        if not source.depends_on_phase:
            self.low = self.high = np.zeros(1)
        self.first: Any = source.over(self.low, self.high)
        self.roots: int = len(self.low)
        self.child: Index = np.full(len(self.low), -1, np.intp)
        # Rows are stored as they came: block after block.
        self.blocks: list[Any] = [self.first]
        self.begins: Index = np.zeros(1, np.intp)

    def __len__(self) -> int:
        return len(self.low)

    @property
    def looked_at(self) -> int:
        """Number of examined phases."""
        return len(self) + 1

    def look(self, xi: Array, enough: float, touching: Array = NO_PHASES) -> SearchResult:
        """Phases at which ξ lies outside K(s); the search may end once its excess is larger than
        `enough`.

        Phases at which ξ is known to touch K(s), shape (k,), may be given: around them, and around
        other apparent contacts, second-order bounds avoid fine subdivision.
        """
        phases = []
        found = []
        bound = -np.inf
        for _, active, start, end, done in self._levels(xi[None], enough, touching):
            phases += [self.low[active], self.high[active]]
            found += [start, end]
            bound = max(bound, float(done.max(initial=-np.inf)))
        excess = np.concatenate(found)
        return SearchResult(
            np.concatenate(phases), excess, np.inf if excess.max() > enough else bound
        )

    def _near(self, touching: Array, peaks: Array, xi: Array, enough: float) -> Near:
        """Second-order bounds around phases at which ξ touches, or appears to touch, K(s)."""
        known = (np.abs(peaks[:, None] - touching) < _BESIDE).any(axis=1)
        phases = (
            np.append(touching, self.source.closest(peaks[~known], xi))
            if not known.all()
            else touching
        )
        # K(s) may jump where a period ends: a phase close to that end is close to both sides.
        seam = np.array([(phases < _BESIDE).any(), (phases > 1.0 - _BESIDE).any()])
        return self.source.around(np.append(phases, np.array([1.0, 0.0])[seam]), xi, enough)

    def _peaks(self, start: Array, end: Array, open_: Index) -> Array:
        """Phases of the largest excess of forces on the first intervals, one for each row of
        undecided intervals."""
        (k,) = np.nonzero(open_)
        ends = np.maximum(start, end)
        tops = [row[ends[row].argmax()] for row in np.split(k, np.flatnonzero(np.diff(k) > 1) + 1)]
        return np.where(start[tops] > end[tops], self.low[tops], self.high[tops])

    def excess(self, xi: Array, enough: float) -> Array:
        """Upper bounds of the excess of forces, shape (q, n), over all K(s), shape (q,), accurate
        to `enough` or a fraction of the excess."""
        worst = np.full(len(xi), -np.inf)
        for which, _, start, end, done in self._levels(xi, enough, share=_SHARE):
            np.maximum.at(worst, which, np.maximum(np.maximum(start, end), done))
        return worst

    def _levels(
        self, xi: Array, enough: float, touching: Array | None = None, share: float | None = None
    ) -> Iterator[tuple[Index, Index, Array, Array, Array]]:
        """Levels of the subdivision: force, interval, excess at its ends, and upper bound.

        The bound is −∞ for intervals that are divided: those in which it may exceed `enough`, and
        the observed excess by the given fraction; without a fraction, none once the observed excess
        is larger than `enough`.
        """
        which = np.repeat(np.arange(len(xi)), self.roots)
        active = np.tile(np.arange(self.roots), len(xi))
        seen = np.full(len(xi), -np.inf)
        zero = np.zeros((1, xi.shape[1]))
        near = NOWHERE_NEAR
        while len(active):
            active, which, rows = self._taken(active, which)
            force = xi[which]
            start, end = rows.start.excess(force), rows.end.excess(force)
            ends = np.maximum(start, end)
            np.maximum.at(seen, which, ends)
            # An interval narrower than the rounding error of a phase has no interior.
            wide = self.high[active] - self.low[active] > NARROWEST_INTERVAL
            if share is None:
                wide &= seen[which] <= enough
            limit = np.maximum(enough, (1.0 + (share or 0.0)) * seen[which])
            done = ends.copy()
            open_ = wide
            if wide.any():
                (k,) = np.nonzero(wide)
                rows = rows if len(k) == len(active) else rows.taken(k)
                done[k] = rows.between(
                    ends[k], force[k], force[k], np.broadcast_to(zero, force[k].shape), limit[k]
                )
                if touching is not None and (done > limit).any():
                    near = self._near(
                        touching, self._peaks(start, end, done > limit), xi[0], enough
                    )
                    touching = None
                if len(near.low):
                    done[k] = np.minimum(
                        done[k], near.at_most(self.low[active[k]], self.high[active[k]])
                    )
                open_ = wide & (done > limit)
                if len(self) + _PARTS * int(open_.sum()) > _MOST:
                    open_[:] = False
                done[open_] = -np.inf
            yield which, active, start, end, done
            which = np.repeat(which[open_], _PARTS)
            active = self._children(active[open_])

    def _taken(self, active: Index, which: Index) -> tuple[Index, Index, Any]:
        """Intervals, sorted by their storage, with their forces and rows."""
        if np.array_equal(active, np.arange(self.roots)):
            return active, which, self.first
        block = np.searchsorted(self.begins, active, side="right") - 1
        order = np.argsort(block, kind="stable")
        active = active[order]
        which = which[order]
        block = block[order]
        first = np.flatnonzero(np.diff(block, prepend=-1))
        pieces = [
            self.blocks[block[i]].taken(active[i:j] - self.begins[block[i]])
            for i, j in zip(first, [*first[1:], len(active)], strict=True)
        ]
        rows = pieces[0]
        for piece in pieces[1:]:
            rows = rows.joined(piece)
        return active, which, rows

    def _children(self, intervals: Index) -> Index:
        new = np.unique(intervals[self.child[intervals] < 0])
        if len(new):
            new = self._with_neighbours(new)
            share = np.arange(_PARTS + 1) / _PARTS
            edges = self.low[new, None] + (self.high - self.low)[new, None] * share
            edges[:, -1] = self.high[new]
            low, high = edges[:, :-1].ravel(), edges[:, 1:].ravel()
            self.child[new] = len(self) + _PARTS * np.arange(len(new))
            self.blocks.append(self.source.over(low, high))
            self.begins = np.append(self.begins, len(self))
            self.low = np.append(self.low, low)
            self.high = np.append(self.high, high)
            self.child = np.append(self.child, np.full(len(low), -1, np.intp))
        return (self.child[intervals, None] + np.arange(_PARTS)).ravel()

    def _with_neighbours(self, intervals: Index) -> Index:
        near = np.clip(intervals[:, None] + np.arange(-_AHEAD, _AHEAD + 1), 0, len(self) - 1)
        width = (self.high - self.low)[intervals, None]
        beside = np.abs(self.low[near] - self.low[intervals, None]) <= (_AHEAD + 0.5) * width
        beside &= np.abs((self.high - self.low)[near] - width) <= 1e-3 * width
        return np.unique(near[beside & (self.child[near] < 0) & (width > NARROWEST_INTERVAL)])

    def scale(self, s: float) -> float:
        """Width of the finest interval around a phase; 1 without dependence on the phase."""
        inside = (self.low <= s) & (s <= self.high)
        return float((self.high - self.low)[inside].min(initial=1.0)) or 1.0
