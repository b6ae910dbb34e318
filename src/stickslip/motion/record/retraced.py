"""A motion between its knots: steps are recomputed up to the requested times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.kept import cached_property
from stickslip.motion.between import dense
from stickslip.motion.between.flights import states_in_flights
from stickslip.motion.record.audited import work_in_steps
from stickslip.motion.record.knots import Knots
from stickslip.motion.record.order import as_asked, in_order
from stickslip.stopping.scopes import unbroken

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem


@dataclass(frozen=True, eq=False)
class Retraced:
    """A motion between its knots.

    In all methods `clock` are times since the origin, shape (times,), and `index` the knots in
    whose steps they are.
    """

    problem: Problem
    knots: Knots

    @cached_property
    def seen(self) -> Array:
        """Sizes of the state, against which steps are measured that follow the motion again."""
        seen = np.zeros(len(self.problem.rows.watched))
        n = self.knots.state.shape[1]
        seen[:n] = np.max(np.abs(self.knots.state), axis=0, initial=0.0)
        return seen

    def rows(self, clock: Array, index: Array) -> Array:
        """Values of all rows, then energy and powers, shape (times, rows + 3)."""
        p, k = self.problem, self.knots
        states = np.empty((len(clock), k.state.shape[1]))
        flown = states_in_flights(p, k, index, clock, states)
        if not np.any(flown):
            return self.rows_by_steps(k, clock, index)
        out = np.empty((len(clock), p.compiled.layout.rows + 3))
        # The end of a flight needs no step from the previous knot: it is a knot itself.
        own = index[flown]
        parts = clock[flown], states[flown], k.mode[own], k.region[own], k.cause[own]
        reached = Knots(*parts, origin=k.origin)
        out[flown] = self.rows_by_steps(reached, clock[flown], np.arange(len(own)))
        if not np.all(flown):
            out[~flown] = self.rows_by_steps(k, clock[~flown], index[~flown])
        return out

    def rows_by_steps(self, knots: Knots, clock: Array, index: Array) -> Array:
        """The same from given knots, by the series that the motion was computed by."""
        p = self.problem
        out = np.empty((len(clock), p.compiled.layout.rows + 3))
        work = dense.make_scratch(p.rows, (p.compiled.layout.rows, 2))
        order = in_order(clock, index)
        given = self.seen, knots.record, index[order], clock[order], work, out
        unbroken(lambda: dense.sample(p.machine, p.flow(retracing=True), *given))
        return as_asked(out, order)

    def states(self, clock: Array, index: Array) -> Array:
        """States, shape (times, n)."""
        p, k = self.problem, self.knots
        out = np.empty((len(clock), k.state.shape[1]))
        left = ~states_in_flights(p, k, index, clock, out)
        if np.all(left):
            return self.states_by_steps(clock, index)
        if np.any(left):
            out[left] = self.states_by_steps(clock[left], index[left])
        return out

    def states_by_steps(self, clock: Array, index: Array) -> Array:
        """The same, by the series that the motion was computed by."""
        p, k = self.problem, self.knots
        out = np.empty((len(clock), k.state.shape[1]))
        work = dense.make_scratch(p.rows, (0, 2))
        order = in_order(clock, index)
        given = self.seen, k.record, index[order], clock[order], work, out
        unbroken(lambda: dense.states_at(p.machine, p.flow(retracing=True), *given))
        return as_asked(out, order)

    def work(self, clock: Array, index: Array) -> Array:
        """Dissipated and supplied energy since the knots, shape (times, 2)."""
        order = in_order(clock, index)
        given = index[order], clock[order]
        return as_asked(work_in_steps(self.problem, self.knots, self.seen, *given), order)
