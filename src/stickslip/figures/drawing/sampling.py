"""Sampling of a motion for a plot: fine everywhere, regardless of its length."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.figures.drawing.thinning import chosen
from stickslip.model.quantities import of_modes

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_SAMPLES = 6000  # number of samples of a motion
_POINTS = (16, 64)  # samples of each step: more if there are fewer steps
MOST_DRAWN = 1_000_000  # largest number of steps of a motion that are drawn
_MOST_SAMPLES = 16_000_000  # largest number of samples of a motion
_AT_ONCE = 64_000  # number of samples that are evaluated together


def checked_window(trajectory: Trajectory, t: tuple[float, float]) -> tuple[float, float]:
    """A window of the time within the computed span.

    Raises
    ------
    DeclarationError
        If it is none.
    """
    first, last = float(trajectory.knots.time[0]), float(trajectory.knots.time[-1])
    try:
        low, high = map(float, t)
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError("t", f"{t!r} is not a time window", "Give (low, high)") from None
    if not first <= low < high <= last:
        raise DeclarationError(
            "t",
            f"({low:g}, {high:g}) is not a part of the computed time span",
            f"Give {first:g} <= low < high <= {last:g}",
        )
    return low, high


class SampledMotion:
    """Sampled times of a motion: on each step, including both ends, and without large gaps."""

    def __init__(self, trajectory: Trajectory, window: tuple[float, float] | None = None) -> None:
        self.trajectory = trajectory
        k = trajectory.knots
        time, state = (k.time, k.state) if len(k.time) > 1 else (k.time[[0, 0]], k.state[[0, 0]])
        self.first = 0  # step
        if window is not None:
            ends = np.array(checked_window(trajectory, window))
            self.first = int(np.searchsorted(time, ends[0], side="right")) - 1
            last = int(np.searchsorted(time, ends[1], side="left"))
            part = slice(self.first, last + 1)
            time, state = time[part].copy(), state[part].copy()
            time[[0, -1]] = ends
            state[[0, -1]] = trajectory.states_at(ends, np.array([self.first, last - 1]))
        self.time = time
        self.at_knots = dict(zip(trajectory.system.declaration.state, state.T, strict=True))
        self.at_knots |= of_modes(trajectory.system.unknowns, self.at_knots)
        if outputs := [*trajectory.system.outputs]:
            index = np.minimum(self.first + np.arange(len(time)), len(k.time) - 1)
            self.at_knots |= trajectory.trace(outputs, time, index)
        self.steps = len(self.time) - 1
        self._chosen = chosen(self.time, MOST_DRAWN)
        lengths = np.diff(self.time)[self._chosen]
        span = float(self.time[-1] - self.time[0]) or 1.0
        points = int(np.clip(_MOST_SAMPLES // len(lengths), *_POINTS))
        self._number = points + np.floor(_SAMPLES * lengths / span).astype(int)
        self._at_once = _AT_ONCE // points
        self.count = int(np.sum(self._number))

    def sampled(self, names: list[str]) -> Iterator[tuple[Array, Array, dict[str, Array]]]:
        """Times, their steps, and values, in pieces."""
        for i in range(0, len(self._chosen), self._at_once):
            some, number = (part[i : i + self._at_once] for part in (self._chosen, self._number))
            steps = np.repeat(some, number)
            last = np.cumsum(number)
            place = np.arange(len(steps)) - np.repeat(last - number, number)
            begin = self.time[steps]
            end = self.time[steps + 1]
            t = np.minimum(begin + (end - begin) * place / (np.repeat(number, number) - 1), end)
            yield t, steps, self.trajectory.trace(names, t, steps + self.first)
