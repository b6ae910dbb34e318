"""Motions from given states over a period."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

MOST_EVENTS = 100_000  # largest number of events of one period
# length of a flight, in its shortest times, above which a closed form pays for one motion
_FLIGHT = 60.0


class NoReturn(ConvergenceError):
    """A motion that ends before its period is over."""


def follow_state(problem: Problem, start: float, end: float, y: Array) -> Trajectory:
    """The motion from a state, as a trajectory.

    Raises
    ------
    NoReturn
        If it ends early.
    """
    trajectory = follow_freely(problem, start, end, y)
    if trajectory.outcome is not Outcome.FINISHED:
        raise NoReturn(f"a period of {problem.system.name}", trajectory.message)
    return trajectory


def follow_freely(problem: Problem, start: float, end: float, y: Array) -> Trajectory:
    """The motion from a state, possibly ending early."""
    from stickslip.motion import simulate
    from stickslip.motion.trajectory import Trajectory

    code, knots, ended = simulate.run_loop(problem, start, end, y, MOST_EVENTS)
    if ended is not None:
        raise ended
    return Trajectory(problem, (start, end), knots, Outcome.from_code(code))


def flies(motion: Trajectory) -> bool:
    """Return whether closed forms are worthwhile even if each motion needs separate ones for its
    parameters: if flights are very long compared with their fastest time scale."""
    from stickslip.motion.between.flights import known_forms

    forms = known_forms(motion.problem, motion.knots)
    shortest = forms.shortest[forms.flown == 1]
    k = motion.knots
    if not np.any(shortest > 0.0) or len(k.time) < 2:
        return False
    steps = float(k.time[-1] - k.time[0]) / float(np.min(shortest[shortest > 0.0]))
    return steps > _FLIGHT * (len(k.time) - 1)


def arrivals(problem: Problem, start: float, end: float, states: Array) -> list[Array | None]:
    """Final states of the motions from some states; None if one ends early.

    Parameters
    ----------
    states : array, shape (motions, n)
    """
    from stickslip.motion.ensemble import Lanes
    from stickslip.motion.steps.arrays import FINISHED, Constants

    constants = Constants(*(part[None] for part in problem.constants))
    span = start - problem.origin, end - problem.origin
    group = np.zeros(len(states), np.int64)
    lanes = Lanes.start(problem, constants, group, states, span, problem.closed_forms)
    lanes.advance(span[1], MOST_EVENTS)
    pairs = zip(lanes.codes, lanes.now.y, strict=True)
    return [y if code == FINISHED else None for code, y in pairs]
