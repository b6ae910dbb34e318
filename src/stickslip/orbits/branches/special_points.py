"""Special points of a branch of cycles: changes of the sequence of modes, and residuals of the
defining equations."""

from __future__ import annotations

import itertools
import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import Residual
from stickslip.numerics.levels import BRACKET_LOOKS
from stickslip.numerics.ratios import ratio
from stickslip.orbits.branches.chart import Chart
from stickslip.orbits.branches.onset import RESIDUALS, Onset, nearest_onset, onsets_between
from stickslip.orbits.continuation.arclength import direction
from stickslip.orbits.continuation.bracket import zero_between
from stickslip.orbits.continuation.branch import SOLVED_TO
from stickslip.orbits.continuation.corrector import NOT_DEFINED, Lost
from stickslip.orbits.continuation.path import Break, Crossing, Path, Point
from stickslip.orbits.return_map.mode_sequence import Sequence, change_of, nearest_change, sequence

if TYPE_CHECKING:
    pass


# largest distance of a located multiplier or slope from its critical value, unless it jumps
_NEAR = 1e-4
_FLAT = 1e-9  # values of a test function that are rounding errors
_MOST_CHANGES = 8  # largest number of changes located within one step
_TOUCHES = 1e-11  # a margin this small is zero
# largest distance from a change at which its sides end, with phases too short to count
HIDDEN = 3e-7
_TOGETHER = 1e-6  # changes that are nearer to each other are regarded as one
_APART = "the cycles on both sides of a sequence change do not meet"
NOT_SMOOTH = "not smooth: the sequence changes there"  # note of a fold
_NEARBY = 0.1  # a cycle this near, as a fraction of the step, is preferred to the ends of the step
# distances from a change at which derivatives are those of that side
_ASIDE = (3e-8, 1e-7, 3e-7, 1e-6)
# slope of the parameter at a fold; the error of the fold is of the order of its square
_TURNS = 1e-8
# distances from a change at which the onset of stick is searched for
_AROUND = (1e-9, 1e-8, 1e-7, 1e-6)
_CLOSE = 1e-13  # length of the enclosure of a change
_FINE = 1e-11  # tolerance of the corrector when a change is located


@dataclass(frozen=True)
class Happening:
    """A special point of a branch: its kind, description, and residuals."""

    kind: str
    note: str
    residuals: tuple[Residual, ...]


def locate_changes(chart: Chart, a: Point, b: Point) -> list[Break]:
    """The changes of the sequence between two points, in the order of travel.

    Raises
    ------
    Lost
        If the cycles on both sides of one do not meet.
    """
    here = sequence(chart.orbit(a.x).motion)
    there = sequence(chart.orbit(b.x).motion)
    passed: list[_Passed] = []
    low, high = 0.0, b.length - a.length
    while here != there and len(passed) < _MOST_CHANGES:
        finder = _Finder(chart, a, b, here)
        found = finder.first_change(low, high)
        if passed and np.linalg.norm((found.x - passed[-1].x) / chart.scale(found.x)) < _TOGETHER:
            # Events that belong together by a symmetry of the cycle.
            first = passed.pop()
            found = replace(first, high=found.high, there=found.there)
        if found.off > _TOGETHER:
            raise Lost(_APART)
        passed.append(found)
        low, here = found.high, found.there
    ends = [0.0, *(change.place for change in passed), high]
    return [
        _break(_Finder(chart, a, b, here), change, ends[i], ends[i + 2])
        for i, change in enumerate(passed)
    ]


@dataclass(frozen=True)
class _Passed:
    """A located change of the sequence.

    Attributes
    ----------
    x : array
        Unknowns at the change.
    place, low, high : float
        Its position and a bracket of it, as distances from the first point.
    off : float
        Residual of the margin that vanishes there; without such a margin, the width of the bracket.
    here, there : Sequence
        The sequences on both sides.
    """

    x: Array
    place: float
    low: float
    high: float
    off: float
    here: Sequence
    there: Sequence


def _break(finder: _Finder, change: _Passed, low: float, high: float) -> Break:
    """A change between two others, or between the ends of a step, with its residual."""
    chart = finder.chart
    kind, note = change_of(chart.shooting.pieces.equations, change.here, change.there)
    onset = onset_near(chart, change.x, change.here, change.there)
    if onset is not None:
        change = _at_onset(finder, change, onset)
    before = _beside(finder, change.place, low, change.here)
    beyond = _beside(finder, change.place, high, change.there)
    x = change.x
    gap, off = _gap(finder, change.place, before, beyond)
    if onset is None and gap > SOLVED_TO and abs(off) <= HIDDEN:
        # A phase that is too short to count ends on both sides before the point where they meet.
        x = finder.at(change.place + off)
        gap, _ = _gap(finder, change.place + off, before, beyond)
    if gap > _TOGETHER:
        raise Lost(_APART)
    residuals = (
        *measured_change(chart, x, onset, change.off),
        Residual("gap between the sides", gap, SOLVED_TO, note="in units of the cycle"),
    )
    return Break(x, before, beyond, Happening(kind, note, residuals))


def _beside(finder: _Finder, place: float, end: float, order: Sequence) -> Array:
    """Unknowns just before a change, with the sequence of this side.

    Raises
    ------
    Lost
        If there are none nearby.
    """
    for aside in _ASIDE:
        x = finder.at(place + math.copysign(min(aside, 0.5 * abs(end - place)), end - place))
        if sequence(finder.chart.orbit(x).motion) == order:
            return x
    raise Lost(_APART)


def _gap(finder: _Finder, place: float, *sides: Array) -> tuple[float, float]:
    """Distance between both sides of a change at a place, and the distance to their nearest
    approach, along the tangent of each side."""
    a = finder.a
    ends, ways = list[Array](), list[Array]()
    for x in sides:
        tangent, _ = direction(finder.chart, x, a.units, a.heading)
        # Scaled to a unit component along the heading: both sides are compared at the same place.
        ways.append(tangent / (a.heading @ tangent))
        offset = (x - a.x) / a.units
        ends.append(offset + ways[-1] * (place - a.heading @ offset))
    # |apart + s turn| is smallest at s = −apart·turn/|turn|².
    apart, turn = ends[1] - ends[0], ways[1] - ways[0]
    return float(np.linalg.norm(apart)), ratio(-float(apart @ turn), float(turn @ turn))


def onset_near(chart: Chart, x: Array, here: Sequence, there: Sequence) -> Onset | None:
    """The onset that explains a change of the sequence, if one does; of several the one nearest to
    a cycle.

    Parameters
    ----------
    x : array
        Unknowns of the cycle.
    """
    among = onsets_between(here, there)
    return nearest_onset(chart.orbit(x).motion, chart.shooting.pieces, among) if among else None


def _at_onset(finder: _Finder, change: _Passed, onset: Onset) -> _Passed:
    """The same change, located by the zero of the continued margin of the onset.

    The margin is also defined for a stick that is too short to be counted.
    """
    chart = finder.chart
    pieces = chart.shooting.pieces

    def margin(distance: float) -> float:
        return onset.margin(chart.orbit(finder.at(distance)).motion, pieces)

    with suppress(Lost, *NOT_DEFINED):
        if abs(margin(change.place)) <= _TOUCHES:
            return change
        for beside in _AROUND:
            ends = max(change.low - beside, 0.0), change.high + beside
            values = margin(ends[0]), margin(ends[1])
            if values[0] * values[1] < 0.0:
                place = zero_between(margin, *ends, *values)
                if math.isfinite(place) and abs(margin(place)) < abs(margin(change.place)):
                    return replace(change, x=finder.at(place), place=place)
    return change


class _Finder:
    """A function that is positive if a cycle has a given sequence, negative otherwise, and small
    near a change."""

    def __init__(self, chart: Chart, a: Point, b: Point, here: Sequence) -> None:
        self.chart = chart
        self.a = a
        self.b = b
        self.here = here
        self.seen: dict[float, tuple[Array, Sequence, float]] = {}

    def __call__(self, distance: float) -> float:
        if distance not in self.seen:
            x = self.at(distance)
            motion = self.chart.orbit(x).motion
            order = sequence(motion)
            margin = nearest_change(motion, self.chart.shooting.pieces)
            margin = margin if margin > _TOUCHES else 0.0
            self.seen[distance] = x, order, margin if order == self.here else -margin
        return self.seen[distance][2]

    def at(self, distance: float) -> Array:
        """Unknowns at a distance, computed from the nearest known ones."""
        if distance in self.seen:
            return self.seen[distance][0]
        whole = self.b.length - self.a.length
        ends = {0.0: self.a.x, whole: self.b.x}
        if distance in ends:
            return ends[distance]
        start = None
        if len(self.seen) > 1:
            p, q = sorted(self.seen, key=lambda other: abs(other - distance))[:2]
            if abs(p - distance) <= _NEARBY * whole:
                there = self.seen[q][0] - self.seen[p][0]
                start = self.seen[p][0] + there * ((distance - p) / (q - p))
        if start is None:
            start = self.chart.bent(self.a, self.b, distance)
        return self.chart.along(self.a, distance, _FINE, start)

    def first_change(self, low: float, high: float) -> _Passed:
        """The first change between two places with different sequences."""
        with suppress(Lost, RuntimeError, ValueError, *NOT_DEFINED):
            # The points found before a failure enclose the change.
            self._enclose(low, high)
            before, beyond = self._around()
            if self.seen[before][2] == 0.0 and beyond - before > _TOGETHER:
                # A value that vanishes there may belong to the previous change.
                low = before + _TOGETHER
                if self(low) > 0.0:
                    self._enclose(low, beyond)
        before, beyond = self._around()
        nearest = min((before, beyond), key=lambda place: abs(self.seen[place][2]))
        x, _, margin = self.seen[nearest]
        off = min(abs(margin), beyond - before)
        return _Passed(x, nearest, before, beyond, off, self.here, self.seen[beyond][1])

    def _around(self) -> tuple[float, float]:
        """The last place with the same sequence, and the first one with another."""
        beyond = min(s for s, (_, order, _) in self.seen.items() if order != self.here)
        return max((s for s in self.seen if s < beyond), default=beyond), beyond

    def _enclose(self, low: float, high: float) -> None:
        """Bracket the change.

        On one side of it the margin decreases to zero, linearly or as a square root; on the other
        side there may be a different margin. So the zero is approached from one side, with
        overshoots of the size of its error.
        """
        sides = _Approach(low, self(low)), _Approach(high, self(high))
        halved = high - low
        for look in range(BRACKET_LOOKS):
            ends = [side.end for side in sides]
            width = ends[1] - ends[0]
            if not min(side.margin for side in sides) > 0.0 or width <= _CLOSE:
                return
            inside = [side for side in sides if ends[0] < side.expected < ends[1]]
            trial = inside[0].trial(width) if inside else math.nan
            if look % 3 == 2:
                # An interval that is not halved within three evaluations is bisected.
                trial = trial if width <= 0.5 * halved else math.nan
                halved = width
            if not ends[0] < trial < ends[1]:
                trial = 0.5 * (ends[0] + ends[1])
            value = self(trial)
            beyond = bool(value < 0.0)
            if beyond and self.seen[trial][1] != self.seen[ends[1]][1]:
                sides = sides[0], _Approach(trial, value)
            else:
                sides[beyond].look(trial, value)


class _Approach:
    """Values of a margin on one side of its zero.

    Attributes
    ----------
    end : float
        The nearest place.
    margin : float
        Its modulus there.
    expected : float
        Extrapolated zero; infinite if it does not decrease.
    """

    def __init__(self, at: float, value: float) -> None:
        self._points: list[tuple[float, float]] = []
        self.expected = math.inf
        self.look(at, value)

    def look(self, at: float, value: float) -> None:
        """Evaluate at one more place, nearer than the previous ones."""
        self.end: float = at
        self.margin: float = abs(value)
        self._points = [*self._points[-2:], (self.margin, at)]
        before, self.expected = self.expected, self._vanishes()
        self._error = abs(self.expected - before)

    def _vanishes(self) -> float:
        """Extrapolated zero; infinite if the values do not decrease."""
        points = self._points
        if any(later[0] >= earlier[0] for earlier, later in itertools.pairwise(points)):
            points = points[-2:] if points[-1][0] < points[-2][0] else []
        return vanishes_at(points) if len(points) > 1 else math.inf

    def trial(self, width: float) -> float:
        """Next trial point: the extrapolated zero, or a point beyond it if it is near."""
        off = self.expected - self.end
        error = self._error if self._error < width else 0.0
        if abs(off) > error:
            return self.expected
        return self.expected + math.copysign(4.0 * max(error, _CLOSE), off)


def vanishes_at(points: list[tuple[float, float]]) -> float:
    """Zero of a function known at some points, by inverse interpolation with a polynomial.

    Parameters
    ----------
    points : list of (float, float)
        Values, all different, and places.
    """
    place = 0.0
    for i, (value, at) in enumerate(points):
        weight = 1.0
        for j, (other, _) in enumerate(points):
            weight *= other / (other - value) if j != i else 1.0
        place += weight * at
    return place


def measured_change(
    chart: Chart, x: Array, onset: Onset | None, off: float
) -> tuple[Residual, ...]:
    """Residual of a change of the sequence: the function that vanishes at an onset, else the
    distance from the change.

    Parameters
    ----------
    x : array
        Unknowns at the change.
    off : float
        Residual of the function that vanishes there, or the width of the bracket of the change.
    """
    if onset is not None:
        margin = onset.margin(chart.orbit(x).motion, chart.shooting.pieces)
        if math.isfinite(margin):
            return (Residual(RESIDUALS[onset.way], abs(margin), SOLVED_TO, note="of the largest"),)
    return (Residual("nearest change", off, SOLVED_TO, note="in units of the cycle"),)


def is_flat(path: Path, crossing: Crossing) -> bool:
    """Return whether a test function is zero on both sides up to rounding, as along a whole branch
    without damping."""
    beside = path.points[max(crossing.index - 1, 0) : crossing.index + 2]
    return max(abs(point.tests[crossing.name]) for point in beside) < _FLAT


def happening_at(crossing: Crossing, slope: float, multipliers: Array) -> Happening | None:
    """The special point at a zero of a test function, with its residuals; None if the zero is not a
    special point.

    Parameters
    ----------
    slope : float
        Change of the parameter along the branch, both in units of the unknowns.
    multipliers : array
        Those that no symmetry explains.
    """
    name = str(crossing.name)
    if name == "fold":
        if crossing.sides is not None:
            return Happening(name, NOT_SMOOTH, (turning(*crossing.sides),))
        return Happening(name, "", (Residual("slope of the parameter", abs(slope), _TURNS),))
    if crossing.sides is not None:
        return None
    if name == "torus":
        on_circle = [z for z in multipliers if z.imag > _NEAR and abs(abs(z) - 1.0) <= _NEAR]
        if not on_circle:
            return None
        z = min(on_circle, key=lambda z: abs(abs(z) - 1.0))
        note = f"rotation number {float(np.angle(z)) / (2.0 * np.pi):.9g}"
        left = Residual("modulus of a multiplier less 1", abs(abs(z) - 1.0), SOLVED_TO)
        return Happening(name, note, (left,))
    value = -1.0 if name == "period doubling" else 1.0
    off = float(np.min(np.abs(multipliers - value), initial=1.0))
    return Happening(name, "", (critical(value, off),)) if off <= _NEAR else None


def critical(value: float, off: float) -> Residual:
    """Distance of a multiplier from the value 1 or −1."""
    return Residual(f"multiplier {'plus' if value < 0.0 else 'less'} 1", abs(off), SOLVED_TO)


def turning(before: float, beyond: float) -> Residual:
    """Return whether the parameter turns back at a corner, from its slopes on both sides."""
    turns = -math.copysign(min(abs(before), abs(beyond)), before * beyond)
    return Residual("turn of the parameter", turns, SOLVED_TO, least=True)
