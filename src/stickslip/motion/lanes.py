"""Motions side by side: the state of one or many trajectories of a system between calls of the compiled loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stickslip.motion import affine, engine
from stickslip.motion.closed_form import make_closed_form
from stickslip.motion.problem import Problem

Array = np.ndarray


@dataclass
class Lanes:
    """Trajectories of one system; lanes of a group share their parameters.

    Attributes
    ----------
    problems : list of Problem
        One per group.
    group : array of int, shape (lanes,)
    codes : array of int, shape (lanes,)
        Outcome code, or ``engine.FULL`` / ``engine.NEED`` while a lane goes on.
    clocks, states, modes, settled, regions, counters : arrays, shape (lanes, ·)
        See :func:`stickslip.motion.engine.integrate`.
    constants, forms : tuples of arrays
        Constants by group and the tables of closed forms.
    """

    problems: list[Problem]
    group: Array
    codes: Array
    clocks: Array
    states: Array
    modes: Array
    settled: Array
    regions: Array
    counters: Array
    constants: tuple[Array, ...]
    forms: tuple[Array, ...]

    @classmethod
    def start(cls, problems: list[Problem], group: Array, states: Array, t: float, end: float, slots: int) -> Lanes:
        """Lanes at their initial states (lanes × n)."""
        layout, lanes = problems[0].compiled.layout, len(states)
        contacts, kinks = len(layout.u), len(layout.kinks)
        counters = np.zeros((lanes, 5), np.int64)
        counters[:, 2] = -1
        if len(problems) == 1:
            forms = problems[0].closed_forms
        else:
            forms = empty_forms(problems[0], len(problems), slots)
        return cls(
            problems, group, np.full(lanes, engine.FULL), np.tile([t, 0.0, t, end - t, 0.0], (lanes, 1)), np.array(states, dtype=float),
            np.zeros((lanes, contacts), np.int64), np.full((lanes, contacts), 9, np.int64), np.ones((lanes, kinks), np.int64), counters,
            tuple(np.stack(parts) for parts in zip(*(p.constants for p in problems), strict=True)), forms)

    @property
    def going(self) -> Array:
        """Lanes that are not at their end."""
        return np.flatnonzero(self.codes >= engine.FULL)

    def advance(self, end: float, max_events: int, record: tuple[Array, ...] | None = None, part: slice = slice(None)) -> int:
        """Run the compiled loop once over some lanes; returns the number of recorded steps (of a single lane)."""
        p = self.problems[0]
        layout = p.compiled.layout
        if record is None:
            record = (np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0), np.int8), np.zeros((0, 0), np.int8), np.zeros(0, np.int64))
        space, work = engine.workspace(p.tables[0], len(p.tables[-1]), layout.frequencies, layout.rows, max(layout.magnitudes, 1), p.order)
        return engine.integrate(
            p.compiled.jets, p.compiled.residual, *p.tables, space, work, *self.constants, self.forms,
            len(self.forms[0]) // len(self.problems), p.order, p.tolerance, p.atol, end, max_events, self.group[part], self.codes[part],
            self.clocks[part], self.states[part], self.modes[part], self.settled[part], self.regions[part], self.counters[part],
            len(record[0]) > 0, *record)

    def make_closed_forms(self) -> None:
        """Make the closed forms that lanes are waiting for."""
        made = set()
        for lane in np.flatnonzero(self.codes == engine.NEED):
            g, mode, region = int(self.group[lane]), self.modes[lane], self.regions[lane]
            key = (g, mode.tobytes(), region.tobytes())
            if key not in made:
                made.add(key)
                make_closed_form(self.problems[g], self.forms, g, mode, region)


def empty_forms(problem: Problem, groups: int, slots: int) -> tuple[Array, ...]:
    """Tables for the closed forms of groups of lanes; without slots if the system is too large for them."""
    layout = problem.compiled.layout
    n, contacts, kinks = layout.sizes["n"], len(layout.u), len(layout.kinks)
    small = contacts + kinks <= 30 and n <= 24 and layout.frequencies <= 6
    return affine.tables(groups, slots if small and problem.exact else 0, n, contacts, kinks, len(problem.tables[-1]),
                         2 + 2 * layout.frequencies)
