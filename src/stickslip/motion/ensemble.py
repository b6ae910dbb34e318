"""The state of one or many trajectories of a system between calls of the compiled loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.affine.forms import ClosedForms
from stickslip.motion.engine import event_loop
from stickslip.motion.problem import Problem
from stickslip.motion.steps.arrays import (
    CAUSE,
    EMPTY_WORD,
    FULL,
    NONE_YET,
    WORD,
    Constants,
    Lane,
    Record,
    Task,
)
from stickslip.motion.steps.stiff import WATCHED
from stickslip.stopping.scopes import check_stop


@dataclass
class Lanes:
    """Trajectories of one system; lanes of a group share their parameters.

    Attributes
    ----------
    problem : Problem
        Machine code, tolerances and order of all lanes; its own parameters do not matter.
    constants : Constants
        Constants of each group.
    group : array of int, shape (lanes,)
    codes : array of int, shape (lanes,)
        Outcome code, or FULL while a lane continues.
    now : Lane
        Present state of each lane, arrays of shape (lanes, ·).
    """

    problem: Problem
    constants: Constants
    group: Array
    codes: Array
    now: Lane
    forms: ClosedForms

    @classmethod
    def start(
        cls,
        problem: Problem,
        constants: Constants,
        group: Array,
        states: Array,
        span: tuple[float, float],
        forms: ClosedForms,
    ) -> Lanes:
        """Lanes at their initial states (lanes × n).

        Parameters
        ----------
        constants : Constants
            Constants of each group.
        group : array of int, shape (lanes,)
        states : array, shape (lanes, n)
        span : (float, float)
            Start and end, counted from the origin of the problem.
        forms : ClosedForms
            Storage for the closed forms that lanes share.
        """
        (t, end), lanes = span, len(states)
        contacts, kinks = len(problem.rows.u), len(problem.rows.kinks)
        counters = np.zeros((lanes, 6), np.int64)
        counters[:, CAUSE] = -1
        counters[:, WORD] = EMPTY_WORD
        clock = np.empty((lanes, 9))
        clock[:] = t, 0.0, t, end - t, 0.0, 1.0, -WATCHED, 0.0, t
        now = Lane(
            clock=clock,
            y=np.array(states, dtype=float),
            seen=np.zeros((lanes, len(problem.rows.watched))),
            mode=np.zeros((lanes, contacts), np.int64),
            settled=np.full((lanes, contacts), NONE_YET, np.int64),
            reg=np.ones((lanes, kinks), np.int64),
            counters=counters,
        )
        return cls(problem, constants, group, np.full(lanes, FULL), now, forms)

    @property
    def slots(self) -> int:
        """Closed forms that each group may have."""
        return len(self.forms.status) // len(self.forms.used)

    def advance(self, end: float, max_events: int, record: Record | None = None) -> int:
        """Follow all lanes to their end, or a single one until the record is full; returns the
        number of recorded steps."""
        p = self.problem
        task = Task(float(end), max_events, record is not None, record or no_record())
        flow = p.flow(self.constants)
        lanes = self.group, self.codes, self.now
        while True:
            count = event_loop.integrate(p.machine, flow, p.shared_flight, self.forms, *lanes, task)
            # A loop that was stopped without a reason continues, but with a record the caller does
            # that.
            if not check_stop() or record is not None:
                return count


def no_record() -> Record:
    """A record without room: no step is recorded."""
    nothing = np.zeros((0, 0), np.int8)
    return Record(np.zeros(0), np.zeros((0, 0)), nothing, nothing, np.zeros(0, np.int64))
