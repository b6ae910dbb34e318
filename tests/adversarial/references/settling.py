"""Brute force: a motion is followed by the reference until it repeats itself, or nothing moves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from ..families.repeating import Repeating
from ..verdict import OutOfTime, at_most
from .event_driven import Run
from .mechanics import Array
from .pieces import NoAnswer

RTOL = 1e-9
# steps in the mechanics' own: what settles need not be exact, but long steps may miss a guard
COARSE = 2.5
OWN = 1.0  # the mechanics' own
FIRST = 24  # periods that a motion is followed for at first
LONGER = 1.5  # the next time as many times more
LAGS = 8  # periods of the load, or returns, among which the smallest lag is looked for
SETTLED = 1e-6  # a motion that repeats itself to this part of its size has settled …
CLEARLY = 1e-3  # … if it misses by more than this after every shorter lag
STILL = 1e-8  # what moves by less, relative to how much it has moved, is at rest
SAMPLES = 48  # of a period


@dataclass(frozen=True)
class Settled:
    """What a motion settles on: its period, and its least and largest states up to shifts. A period
    of 0 is rest."""

    period: float
    low: Array
    high: Array
    time: float


def settle(case: Repeating, patience: float, step: float = COARSE) -> Settled | None:
    """Follow the motion from the start until it repeats itself; None if it does not within seconds
    of the processor."""
    try:
        with at_most(patience):
            return _settle(case, step)
    except (NoAnswer, OutOfTime):
        return None


def _settle(case: Repeating, step: float) -> Settled:
    assert case.mechanics is not None
    length = FIRST * case.duration
    T = case.duration
    mechanics = replace(case.mechanics, step=step * case.mechanics.step)
    run = Run(mechanics, 0.0, case.start, length, np.zeros(0), RTOL)
    moved = np.zeros(len(case.names))
    while True:
        run.path = []
        begin = run.t
        run.follow(run.t + length)
        tail = Tail(case, run, max(begin, run.t - 2 * LAGS * T))
        states = tail.at(np.linspace(tail.begin, run.t, 2 * LAGS * SAMPLES))
        moved = np.maximum(moved, np.ptp(tail.at(np.linspace(begin, run.t, 1000)), axis=0))
        # What sticks rests for ever if nothing pushes; under a load, if it rests through many
        # periods of it.
        if np.all(np.ptp(states, axis=0) <= STILL * np.max(moved)):
            return Settled(0.0, states.min(axis=0), states.max(axis=0), run.t)
        found = tail.repetition()
        if found is not None:
            return found
        length *= LONGER


class Tail:
    """The end of a motion under way."""

    def __init__(self, case: Repeating, run: Run, begin: float) -> None:
        assert run.path is not None
        self.case = case
        self.begin = begin
        self.end = run.t
        self.times = np.array([t for t, _ in run.path])
        self.pieces = [dense for _, dense in run.path]

    def at(self, times: Array) -> Array:
        """States up to shifts, shape (times, n)."""
        index = np.clip(
            np.searchsorted(self.times, times, side="right") - 1, 0, len(self.pieces) - 1
        )
        states = np.empty((len(times), len(self.case.names)))
        for i in np.unique(index):
            states[index == i] = self.pieces[i](times[index == i]).T
        return self.case.at_home(states)

    def marks(self) -> Array:
        """Latest times at equal phases of the load; or at which the first coordinate rises through
        its middle."""
        if self.case.driven:
            marks = self.end - self.case.duration * np.arange(2 * LAGS + 1)
            return marks[marks >= self.begin]
        t = np.linspace(self.begin, self.end, 2 * LAGS * SAMPLES)
        x = self.at(t)[:, 0]
        level = 0.5 * (x.min() + x.max())
        found = []

        def above(s: float) -> float:
            return float(self.at(np.array([s]))[0, 0]) - level

        for i in np.flatnonzero((x[:-1] <= level) & (x[1:] > level))[::-1][: 2 * LAGS + 1]:
            # What moves by rounding alone may not do it again.
            a = float(t[i])
            b = float(t[i + 1])
            passes = above(a) <= 0.0 < above(b)
            found.append(float(brentq(above, a, b, xtol=1e-13)) if passes else a)  # type: ignore[arg-type]
        return np.array(found)

    def repetition(self) -> Settled | None:
        """The smallest lag at which the end of the motion repeats itself."""
        marks = self.marks()
        if len(marks) < 4:
            return None
        states = self.at(marks)
        fine = self.at(np.linspace(marks[-1], marks[0], 2 * LAGS * SAMPLES))
        size = np.ptp(fine, axis=0)
        size = np.maximum(size, 1e-3 * np.max(size))
        for lag in range(1, (len(marks) - 1) // 2 + 1):
            miss = float(np.max(np.abs(states[:-lag] - states[lag:])[: 2 * lag] / size))
            if miss <= SETTLED:
                once = self.at(np.linspace(marks[lag], marks[0], 4000))
                if np.all(np.ptp(once, axis=0) <= STILL * size):
                    # it has come to rest on the way: whether for good, more periods tell
                    return None
                return Settled(
                    float(marks[0] - marks[lag]), once.min(axis=0), once.max(axis=0), self.end
                )
            if miss <= CLEARLY:
                return None
        return None
