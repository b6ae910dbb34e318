"""Motions side by side: the state of one or many trajectories of a system between calls of the compiled loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stickslip.equations.compiled import announced
from stickslip.motion import engine
from stickslip.motion.affine import ClosedForms
from stickslip.motion.closed_form import make_closed_form
from stickslip.motion.kernel import FULL, NEED, Constants, Lane, Record
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
        Outcome code, or FULL / NEED while a lane goes on.
    now : Lane
        Where each lane is, arrays of shape (lanes, ·).
    constants : Constants
        By group.
    forms : ClosedForms
    """

    problems: list[Problem]
    group: Array
    codes: Array
    now: Lane
    constants: Constants
    forms: ClosedForms

    @classmethod
    def start(cls, problems: list[Problem], group: Array, states: Array, t: float, end: float, slots: int) -> Lanes:
        """Lanes at their initial states (lanes × n)."""
        first, lanes = problems[0], len(states)
        contacts, kinks = len(first.rows.u), len(first.rows.kinks)
        counters = np.zeros((lanes, 5), np.int64)
        counters[:, 2] = -1
        now = Lane(
            clock=np.tile([t, 0.0, t, end - t, 0.0], (lanes, 1)),
            y=np.array(states, dtype=float),
            mode=np.zeros((lanes, contacts), np.int64),
            settled=np.full((lanes, contacts), 9, np.int64),
            reg=np.ones((lanes, kinks), np.int64),
            counters=counters,
        )
        constants = Constants(*(np.stack(parts) for parts in zip(*(p.constants for p in problems), strict=True)))
        forms = first.closed_forms if len(problems) == 1 else first.empty_forms(len(problems), slots)
        return cls(problems, group, np.full(lanes, FULL), now, constants, forms)

    @property
    def going(self) -> Array:
        """Lanes that are not at their end."""
        return np.flatnonzero(self.codes >= FULL)

    def advance(self, end: float, max_events: int, record: Record | None = None, part: slice = slice(None)) -> int:
        """Run the compiled loop once over some lanes; returns the number of recorded steps (of a single lane)."""
        p = self.problems[0]
        with announced():
            return self._integrate(p, end, max_events, record, part)

    def _integrate(self, p: Problem, end: float, max_events: int, record: Record | None, part: slice) -> int:
        nothing = Record(
            np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0), np.int8), np.zeros((0, 0), np.int8), np.zeros(0, np.int64)
        )
        return engine.integrate(
            p.compiled.jets,
            p.compiled.residual,
            p.rows,
            p.space(),
            p.flight(),
            self.constants,
            self.forms,
            len(self.forms.status) // len(self.problems),
            p.order,
            p.tolerance,
            p.atol,
            end,
            max_events,
            self.group[part],
            self.codes[part],
            Lane(*(a[part] for a in self.now)),
            record is not None,
            record or nothing,
        )

    def make_closed_forms(self) -> None:
        """Make the closed forms that lanes are waiting for."""
        made = set()
        for lane in np.flatnonzero(self.codes == NEED):
            g, mode, region = int(self.group[lane]), self.now.mode[lane], self.now.reg[lane]
            key = (g, mode.tobytes(), region.tobytes())
            if key not in made:
                made.add(key)
                make_closed_form(self.problems[g], self.forms, g, mode, region)
