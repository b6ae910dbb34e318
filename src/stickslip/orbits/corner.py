"""Corners of a branch of cycles: at a change of the sequence the branch may go on in quite another direction.

Up to the change the cycles solve one smooth problem, beyond it another, and the two curves meet at an angle that no
short step bridges; the branch may even turn back (a fold that is not smooth). The corner is located from this side.
Just beyond it, the derivatives are those of the other problem, and their null vector is the direction to go on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stickslip.orbits.chart import OPEN, Chart
from stickslip.orbits.continuation import UNDEFINED, Lost, Point, correct, direction
from stickslip.orbits.recurrence import segments
from stickslip.orbits.touching import Sequence, change_of, is_open, nearest_change, sequence

Array = np.ndarray

FAILURES = (Lost, *UNDEFINED)
TOLERANCE = 1e-10
LOCATED = 1e-10  # a corner is located to this length
EDGE = 0.1  # a station nearer to the end of its phase, as a part of it, says nothing about what comes back
AHEAD = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)  # how far beyond a corner the other side is looked for


@dataclass(frozen=True)
class Corner:
    """Where a branch changes its direction.

    Attributes
    ----------
    x : array
        Unknowns there.
    kind, note : str
        What changes.
    onward : (array, array) or None
        A point of the branch beyond, and the direction of travel; None if no cycle goes on.
    """

    x: Array
    kind: str
    note: str
    onward: tuple[Array, Array] | None


def corner_after(chart: Chart, point: Point, reach: float, turn: float) -> Corner | None:
    """The corner within some length after a point.

    None if the sequence does not change there, or if the branch turns by more than an angle, or back, before it does:
    that has to be resolved first.
    """
    here = sequence(chart.orbit(point.x).motion)
    if _beyond(chart, point.x, _unit(chart, point), here, (0.25 * reach, reach, 4.0 * reach)) is None:
        return None
    x = _located(chart, point, here, 4.0 * reach)
    tangent = _tangent(chart, x, point, turn)
    if tangent is None:
        return None
    units = chart.scale(x)
    found = _beyond(chart, x, tangent, here, AHEAD)
    if found is None:
        return None
    trial, there, distance = found
    if is_open(there) and not _well_inside(chart, x):
        return None
    contacts = [c.name for c in chart.shooting.pieces.equations.contacts]
    kind, note = change_of(contacts, here, there)
    direction = np.linalg.svd(chart.orbit(trial).J * units)[2][-1]
    return Corner(x, kind, note, _onward(chart, x, direction, here, distance))


def _tangent(chart: Chart, x: Array, point: Point, turn: float) -> Array | None:
    """Direction of travel at a corner, on this side of it; None if it is not nearly that at a point before."""
    before = _unit(chart, point)
    tangent, _ = direction(chart, x, chart.scale(x), before)
    back = tangent[-1] * before[-1] < 0.0
    return None if back or tangent @ before < np.cos(turn) else tangent


def _well_inside(chart: Chart, x: Array) -> bool:
    """Whether a cycle starts well inside its first phase, which is its last one, too."""
    k = chart.orbit(x).motion.knots
    found = segments(k)
    before, after = (float(k.time[b] - k.time[a]) for a, b in (found[-1], found[0]))
    return len(found) == 1 or min(before, after) > EDGE * (before + after)


def _unit(chart: Chart, point: Point) -> Array:
    tangent = point.tangent / chart.scale(point.x)
    return tangent / np.linalg.norm(tangent)


def _beyond(
    chart: Chart, x: Array, tangent: Array, here: Sequence, distances: tuple[float, ...]
) -> tuple[Array, Sequence, float] | None:
    """A trial point ahead whose motion has another sequence."""
    units = chart.scale(x)
    for distance in distances:
        trial = x + units * tangent * distance
        try:
            there = sequence(chart.orbit(trial).motion)
        except FAILURES:
            return None
        if there != here:
            return trial, there, distance
    return None


def _located(chart: Chart, point: Point, here: Sequence, reach: float) -> Array:
    """The last point before the corner: nested intervals, with steps to where the margin would vanish."""
    low, high, x = 0.0, reach, point.x
    seen = [(0.0, nearest_change(chart.orbit(x).motion, chart.shooting.pieces))]
    for _ in range(60):
        if high - low <= LOCATED:
            break
        distance = _next_trial(seen, low, high)
        try:
            trial = chart.along(point, distance, TOLERANCE)
            motion = chart.orbit(trial).motion
            same = sequence(motion) == here
        except FAILURES:
            same, trial, motion = False, x, None
        if same and motion is not None:
            low, x = distance, trial
            seen.append((distance, nearest_change(motion, chart.shooting.pieces)))
        else:
            high = distance
    return x


def _next_trial(seen: list[tuple[float, float]], low: float, high: float) -> float:
    """Where the margin, or its square (phases are as long as square roots), vanishes by extrapolation, or midway."""
    width = high - low
    if len(seen) >= 2 and len(seen) % 3:
        (a, fa), (b, fb) = seen[-2:]
        power = 1.0 if len(seen) % 2 else 2.0
        fa, fb = fa**power, fb**power
        if fb < fa:
            return float(np.clip(b + 1.001 * fb * (b - a) / (fa - fb), low + 1e-3 * width, high - 0.02 * width))
    return low + 0.5 * width


def _onward(chart: Chart, x: Array, direction: Array, here: Sequence, distance: float) -> tuple[Array, Array] | None:
    """A cycle beyond the corner, in one of the two senses of a direction."""
    units = chart.scale(x)
    for length in (10.0 * distance, 100.0 * distance, distance):
        for sense in (direction, -direction):
            try:
                there = correct(chart, x + units * sense * length, units, sense, TOLERANCE)
                after = sequence(chart.orbit(there).motion)
                if after != here and not is_open(after) and chart.shooting.miss(chart.orbit(there)) <= OPEN:
                    return there, units * sense
            except FAILURES:
                continue
    return None
