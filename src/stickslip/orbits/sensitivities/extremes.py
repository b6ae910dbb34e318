"""Derivatives of the smallest and the largest value of a quantity over a period: the derivative of
the quantity at the time of the extremum, where its rate vanishes or a switch occurs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.record.knots import Knots
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.variational import variation
from stickslip.orbits.sensitivities.motion import with_knots

_BISECTIONS = 60
_LOOKS = 20  # number of samples of a step in the search for an extremum


class Traced(NamedTuple):
    """A quantity along a motion.

    Attributes
    ----------
    values : callable
        Times since the origin, and steps in which they are -> values.
    rate : callable
        A time since the origin, and its step -> rate of change.
    slopes : callable
        The same -> derivatives by (state, parameter), at a fixed time.
    """

    values: Callable[[Array, Array], Array]
    rate: Callable[[float, int], float]
    slopes: Callable[[float, int], Array]


class _Extreme(NamedTuple):
    """The place of an extreme: the time since the origin, the knot (−1: none), whether it is a
    limit from the left, and the step on that side."""

    clock: float
    knot: int
    left: bool
    step: int


def slopes_of_extremes(
    motion: Trajectory,
    pieces: Pieces,
    change: tuple[Array, float],
    followed: Sequence[Traced],
) -> Array:
    """Derivatives of the least and the largest value of quantities, shape (quantities, 2).

    Parameters
    ----------
    motion : Trajectory
        One period of the motion.
    pieces : Pieces
        With the parameter.
    change : (array, float)
        Derivatives of the first state, and of the period.
    """
    k = motion.knots
    direction = np.append(change[0], 1.0)[:, None]
    found = [[_extreme(motion, f, sign) for sign in (1.0, -1.0)] for f in followed]
    times = np.unique([e.clock for pair in found for e in pair])
    fine, place = with_knots(motion, times + k.origin)
    varied = variation(fine, pieces, direction)
    at_time = dict(zip(times, place, strict=True))

    def slope(f: Traced, e: _Extreme) -> float:
        knot = at_time[e.clock]
        late = varied.late[knot, 0]
        if not e.left:
            rate = f.rate(e.clock, e.step) if np.isfinite(late) else 0.0
            moved = f.slopes(e.clock, e.step) @ varied.after[knot, :, 0]
            return float(moved + rate * np.nan_to_num(late))
        # Before an event, or at the end of the period, both of which come at another time.
        arrived = variation(until(motion, e.knot), pieces, direction).after[-1, :, 0]
        late = change[1] if e.knot == len(k.clock) - 1 else np.nan_to_num(late)
        moved = f.slopes(e.clock, e.step) @ arrived
        return float(moved + f.rate(e.clock, e.step) * late)

    return np.array([[slope(f, e) for e in pair] for f, pair in zip(followed, found, strict=True)])


def until(motion: Trajectory, knot: int) -> Trajectory:
    """A motion up to a knot, before the event there."""
    k = motion.knots
    parts = k.first(knot + 1)
    state = parts.state.copy()
    state[-1] = motion.states_at(k.time[[knot]], np.array([knot - 1]))[0]
    mode, region, cause = (part.copy() for part in (parts.mode, parts.region, parts.cause))
    mode[-1], region[-1], cause[-1] = mode[-2], region[-2], -1
    knots = Knots(parts.clock, state, mode, region, cause, k.origin)
    return Trajectory(motion.problem, motion.t_span, knots, motion.outcome, motion.rtol)


def _extreme(motion: Trajectory, f: Traced, sign: float) -> _Extreme:
    """Minimum of sign × quantity."""
    k = motion.knots
    steps = np.flatnonzero(np.diff(k.clock) > 0.0)
    right = sign * f.values(k.clock[steps], steps)
    left = sign * f.values(k.clock[steps + 1], steps)
    share = np.arange(1, _LOOKS) / _LOOKS
    clock = (k.clock[steps][:, None] + np.diff(k.clock)[steps][:, None] * share).ravel()
    index = np.repeat(steps, len(share))
    inside = sign * f.values(clock, index)
    best = min(np.min(right), np.min(left), np.min(inside))
    # A turn between two looks goes lower than both.
    i = int(np.argmin(inside))
    step = int(index[i])
    width = np.diff(k.clock)[step] / _LOOKS
    low, high = max(clock[i] - width, k.clock[step]), min(clock[i] + width, k.clock[step + 1])
    turn = _turn(f, (low, high), step)
    if turn is not None:
        value = sign * f.values(np.array([turn]), np.array([step]))[0]
        if value <= best:
            return _Extreme(turn, -1, False, step)
    if np.min(right) <= np.min(left):
        step = int(steps[np.argmin(right)])
        return _Extreme(float(k.clock[step]), step, False, step)
    step = int(steps[np.argmin(left)])
    return _Extreme(float(k.clock[step + 1]), step + 1, True, step)


def _turn(f: Traced, ends: tuple[float, float], step: int) -> float | None:
    """Time of an extremum of a quantity between two times of a step; None if there is none."""
    low, high = ends
    start = f.rate(low, step)
    if not start * f.rate(high, step) < 0.0:
        return None
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if start * f.rate(middle, step) > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
