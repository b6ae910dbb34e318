"""All phases of a potential as a tree of stretches, refined where a force asks for it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stickslip.rate_independent.averaging.minima import SAMPLES
from stickslip.rate_independent.dissipation.base import Array, Dissipation
from stickslip.rate_independent.dissipation.phase import NARROW
from stickslip.rate_independent.dissipation.stretches import Index

PARTS = 16  # of a stretch that is divided
AHEAD = 32  # neighbours to both sides that are divided along with it: the next force will ask for them
MOST = 2**18  # stretches


class Looked(NamedTuple):
    """What was found of a force.

    Attributes
    ----------
    phases, excess : ndarray of shape (k,)
        Ends of stretches, and how far the force lies outside K(s) there.
    bound : float
        It lies no farther outside any K(s); infinite if the search ended because it lies too far outside already.
    """

    phases: Array
    excess: Array
    bound: float


class Cover:
    """The phases of a potential, on stretches that are divided into more and more parts.

    A stretch is divided where a force that is outside of no K(s) at its ends might be in between. What was divided
    stays so for the next force: nearby forces cost a few passes over arrays.

    Parameters
    ----------
    source : Dissipation
    """

    def __init__(self, source: Dissipation) -> None:
        self.source = source
        edges = np.arange(SAMPLES + 1) / SAMPLES if source.depends_on_phase else np.zeros(2)
        self.low, self.high = edges[:-1], edges[1:]
        if not source.depends_on_phase:
            self.low = self.high = np.zeros(1)
        self.first: Any = source.over(self.low, self.high)
        self.roots, self.rows, self.child = len(self.low), self.first, np.full(len(self.low), -1, np.intp)

    def __len__(self) -> int:
        return len(self.low)

    @property
    def looked_at(self) -> int:
        """How many phases were looked at."""
        return len(self) + 1

    def look(self, xi: Array, enough: float) -> Looked:
        """Phases at which ξ lies outside K(s); once it does by more than `enough`, the search need not go on."""
        active, rows, bound = np.arange(self.roots), self.first, -np.inf
        phases, found = [], []
        while True:
            force = np.broadcast_to(xi, (len(active), len(xi)))
            start, end, out = rows.outside(force, force, np.broadcast_to(0.0, force.shape), enough)
            phases += [self.low[active], self.high[active]]
            found += [start, end]
            best = max(float(part.max()) for part in found)
            if best > enough:
                bound = np.inf
                break
            # What is narrower than the rounding of a phase has no inside.
            wide = self.high[active] - self.low[active] > NARROW
            out = np.where(wide, out, np.maximum(start, end))
            open_ = (out > enough) & wide
            bound = max(bound, float(np.max(out[~open_], initial=-np.inf)))
            if not open_.any() or len(self) + PARTS * int(open_.sum()) > MOST:
                bound = max(bound, float(np.max(out[open_], initial=-np.inf)))
                break
            active = self._children(active[open_])
            rows = self.rows.taken(active)
        return Looked(np.concatenate(phases), np.concatenate(found), bound)

    def _children(self, stretches: Index) -> Index:
        new = stretches[self.child[stretches] < 0]
        if len(new):
            new = self._with_neighbours(new)
            share = np.arange(PARTS + 1) / PARTS
            edges = self.low[new, None] + (self.high - self.low)[new, None] * share
            edges[:, -1] = self.high[new]
            low, high = edges[:, :-1].ravel(), edges[:, 1:].ravel()
            self.child[new] = len(self) + PARTS * np.arange(len(new))
            self.rows = self.rows.joined(self.source.over(low, high))
            self.low, self.high = np.append(self.low, low), np.append(self.high, high)
            self.child = np.append(self.child, np.full(len(low), -1, np.intp))
        return (self.child[stretches, None] + np.arange(PARTS)).ravel()

    def _with_neighbours(self, stretches: Index) -> Index:
        near = np.clip(stretches[:, None] + np.arange(-AHEAD, AHEAD + 1), 0, len(self) - 1)
        width = (self.high - self.low)[stretches, None]
        beside = np.abs(self.low[near] - self.low[stretches, None]) <= (AHEAD + 0.5) * width
        beside &= np.abs((self.high - self.low)[near] - width) <= 1e-3 * width
        return np.unique(near[beside & (self.child[near] < 0) & (width > NARROW)])

    def scale(self, s: float) -> float:
        """Width of the finest stretch around a phase."""
        inside = (self.low <= s) & (s <= self.high)
        return float((self.high - self.low)[inside].min(initial=1.0))
