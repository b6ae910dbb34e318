"""Corners of a branch of cycles: the direction of the branch may change at a change of the mode
sequence.

Up to the change the cycles solve one smooth problem, beyond it another, and the two curves meet at
an angle that short steps cannot pass; the branch may even turn back (a non-smooth fold). The corner
is approached from this side with decreasing steps, since beyond it the sequence of neighbouring
cycles has already changed. Just beyond the corner, the derivatives are those of the other problem,
and their null vector is the new direction. If a contact sticks throughout on one side only, the
other problem fixes its rest position to that at the corner.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from itertools import product

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import Residual
from stickslip.numerics.ratios import ratio
from stickslip.orbits.branches.chart import CLOSES_TO, NOT_CLOSED, Chart, renewed
from stickslip.orbits.branches.onset import Onset
from stickslip.orbits.branches.special_points import (
    HIDDEN,
    Happening,
    measured_change,
    onset_near,
    turning,
)
from stickslip.orbits.continuation.arclength import direction
from stickslip.orbits.continuation.branch import SOLVED_TO
from stickslip.orbits.continuation.corrector import NOT_DEFINED, Lost, correct
from stickslip.orbits.continuation.path import Point
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.return_map.damped_newton import CLOSED
from stickslip.orbits.return_map.held import HELD
from stickslip.orbits.return_map.mode_sequence import (
    Sequence,
    change_of,
    is_open,
    nearest_change,
    sequence,
)
from stickslip.orbits.return_map.recurrence import segments

_FAILURES = (Lost, *NOT_DEFINED)
_TOLERANCE = 1e-11
_LOCATED = 1e-12  # accuracy of the location of a corner …
# … and distance before it at which the tangent is used: nearer, touching and crossing are not
# distinguished
_TANGENT = 1e-8
# distance before a corner at which a cycle can be certified: the corner has no derivatives
_BESIDE = 1e-9
_MOST = 400  # largest number of steps towards a corner
# a station nearer to the end of its phase, as a fraction of it, is not evidence of a return
_EDGE = 0.1
# smallest cosine between the direction beyond a corner and the chord to the point found there
_ALONG = 0.9
_BACK = -1.0 + 1e-6  # cosine below which a direction leads backwards
_DIRECTIONS = 3  # number of directions that are tried sequentially
_HELD_TO = 10.0 * HELD  # largest gap of cycles on which a contact is carried along
# positions along a ray at which the onset of a stick is searched for
_AROUND = (1e-9, -1e-9, 1e-8, -1e-8, 1e-7, -1e-7)
_FARTHEST = 1e-6  # largest distance of the onset from the change of the sequence
# parts of a secant step that are tried one after the other
_PARTS = (1.0, 0.9, 0.75)
_SECANTS = 3  # initial secant steps towards it
# factor on the distance beyond a corner at which slip in both directions is tested
_FURTHER = 100.0
# distances beyond a corner at which the other side is searched for …
_AHEAD = (1e-11, 3e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6)
_THERE = 1e-6  # … at which its derivatives are evaluated …
_ONWARD = (1e-7, 1e-6, 1e-5)  # … and at which cycles are searched for, …
_NEARER = (3e-8, 1e-8)  # … closer if the branch bends too much on the way
_LENGTHS = (1e-5, 1e-4, 1e-6)  # lengths of steps along an edge; one of them leads to a cycle


@dataclass(frozen=True)
class BeyondCorner:
    """A point of the branch beyond a corner, in a chart of that side, and the direction of travel
    there."""

    chart: Chart
    x: Array
    towards: Array

    def gap(self, corner: Array, on_edge: bool = False) -> Residual:
        """Distance of the branch from its corner, followed back along its direction.

        Parameters
        ----------
        on_edge : bool
            Whether a contact is carried along on the other side.
        """
        units = self.chart.scale(self.x)
        chord = (self.x - corner) / units
        along = self.towards / units
        along = along / np.linalg.norm(along)
        off = float(np.linalg.norm(chord - (along @ chord) * along))
        limit, note = SOLVED_TO, "in units of the cycle"
        if on_edge or self.chart.on_edge:
            limit, note = _HELD_TO, f"{note}; the carried contact is held just inside its edge"
        return Residual("gap between the sides", off, limit, note=note)


@dataclass(frozen=True)
class Corner:
    """A corner, at which a branch changes its direction.

    Attributes
    ----------
    cycle : Cycle
        The cycle there.
    beside : array
        Unknowns slightly before the corner, in the chart of this side.
    what : Happening
        Description of the change.
    turn : Residual
        Whether the parameter turns back.
    onward : Onward or None
        Continuation of the branch; None if no cycle continues from the corner.
    """

    cycle: Cycle
    beside: Array
    what: Happening
    turn: Residual
    onward: BeyondCorner | None


def corner_after(chart: Chart, point: Point, reach: float, turn: float) -> Corner | None:
    """The corner within some length after a point.

    None if the sequence does not change there, or if another event, a large rotation or a reversal
    of the branch comes first, which must be resolved before.
    """
    here = sequence(chart.orbit(point.x).motion)
    before = _unit(chart, point.x, point.tangent)
    if _beyond(chart, point.x, before, here, (0.25 * reach, reach, 4.0 * reach)) is None:
        return None
    approached = _approach(chart, point.x, before, here, 8.0 * reach)
    if approached is None:
        return None
    x, beside, tangent = approached
    if tangent @ before < np.cos(turn) or tangent[-1] * before[-1] < 0.0:
        return None
    try:
        if _happens(chart, point, beside, tangent):
            return None
        # Around the corner, so that contacts that begin to rest there keep their positions.
        there, y, towards = renewed(chart, x, tangent * chart.scale(x))
    except _FAILURES:
        return None
    towards = _unit(there, y, towards)
    found = _beyond(there, y, towards, here, _AHEAD)
    if found is None:
        return None
    trial, after, distance = found
    if is_open(after) and not _well_inside(chart, x):
        return None
    equations = chart.shooting.pieces.equations
    further = max(distance, _THERE)
    trial = y + there.scale(y) * towards * further
    edge = _carried(there, y, towards, trial, after, further)
    if edge is not None:
        onward = _along_the_edge(there, y, towards, edge)
        kind = "slip onset"
        name = equations.labels[edge[0]]
        note = f"contact '{name}' begins to slip in one direction, which shifts its rest position"
    else:
        kind, note = change_of(equations, here, after)
        onward = None if is_open(after) else _onward(there, y, towards, trial, here)
    left = nearest_change(there.orbit(y).motion, there.shooting.pieces)
    rays = (chart, x, tangent), (there, y, towards)
    cycle = None
    onset = None if edge is not None else onset_near(there, y, here, after)
    if onset is not None:
        with suppress(*_FAILURES):
            y = _at_onset(rays[1], onset)
            cycle = there.cycle(y)
    if onward is not None and not onward.gap(y, chart.on_edge).ok:
        # A phase that is too short to count ends before the point where both sides meet.
        if onset is None:
            with suppress(*_FAILURES):
                x, y = _moved(rays, _to_the_meeting(rays[1], onward))
        if edge is None and not onward.gap(y, chart.on_edge).ok:
            onward = _onward(there, y, towards, trial, here, _NEARER)
    if edge is None and onward is not None:
        # Just beyond, a phase may have vanished whose symmetric counterpart becomes too short
        # slightly later.
        kind, note = change_of(equations, here, sequence(onward.chart.orbit(onward.x).motion))
    residuals = measured_change(there, y, onset, min(distance, left))
    if onward is not None:
        gap = onward.gap(y, chart.on_edge)
        if gap.ok:
            residuals += (gap,)
        else:
            onward = None  # sides that do not meet are two branches
    ahead = 0.0 if onward is None else _unit(onward.chart, onward.x, onward.towards)[-1]
    what = Happening(kind, note, residuals)
    cycle = cycle or chart.cycle(x)
    return Corner(cycle, beside, what, turning(tangent[-1], ahead), onward)


_Ray = tuple[Chart, Array, Array]
"""A chart, unknowns in it and a direction in their units."""


def _at_onset(ray: _Ray, onset: Onset) -> Array:
    """The cycle near the start of a ray at which the margin of the contact that begins to stick
    vanishes.

    A stick that is too short to be counted begins before the sequence changes. At the onset itself
    derivatives jump, and the branch may turn back, so that no cycle is found on one of its sides.
    """
    chart, y, _ = ray
    seen: dict[float, tuple[float, Array]] = {}

    def margin(x: Array) -> float:
        return onset.margin(chart.orbit(x).motion, chart.shooting.pieces)

    def look(length: float) -> None:
        """Solve for a cycle, if there is one, and evaluate its margin."""
        with suppress(*_FAILURES):
            x = _along(ray, length)
            value = margin(x)
            if math.isfinite(value):
                seen[length] = value, x

    def nearest() -> list[float]:
        return sorted(seen, key=lambda length: abs(seen[length][0]))

    def solved() -> bool:
        return bool(seen) and abs(seen[nearest()[0]][0]) <= SOLVED_TO

    for place in (0.0, *_AROUND):
        look(place)
        for _ in range(_SECANTS):
            if len(seen) < 2 or solved():
                break
            a, b = nearest()[:2]
            change = seen[a][0] - seen[b][0]
            step = seen[a][0] * (a - b)
            # Farther away, the zero is that of another cycle.
            if change == 0.0 or not abs(step) <= _FARTHEST * abs(change):
                break
            for part in _PARTS:
                look(a - part * step / change)
                if a != nearest()[0]:
                    break
            if a == nearest()[0]:
                break
        if solved():
            break
    own = margin(y)
    if not seen or abs(own) < abs(seen[nearest()[0]][0]):
        return y
    return seen[nearest()[0]][1]


def _to_the_meeting(ray: _Ray, onward: BeyondCorner) -> float:
    """Position along a ray at which it is nearest to the line of the continued branch."""
    _, y, towards = ray
    units = onward.chart.scale(onward.x)
    ahead = _unit(onward.chart, onward.x, onward.towards)
    lines = np.column_stack([towards, -ahead])
    return float(np.linalg.lstsq(lines, (onward.x - y) / units, rcond=None)[0][0])


def _moved(rays: tuple[_Ray, _Ray], length: float) -> tuple[Array, Array]:
    """The cycle at a distance along two rays that start from one cycle, given in two charts; the
    distance is that along the second.

    Raises
    ------
    Lost
        If the distance exceeds the length below which phases are ignored.
    """
    if abs(length) > HIDDEN:
        raise Lost("the branches on both sides do not meet")
    # Period and parameter have the same units in both charts.
    parts = [float(np.linalg.norm(tangent[chart.shooting.time :])) for chart, _, tangent in rays]
    lengths = ratio(length * parts[1], parts[0]), length
    x, y = (_along(ray, way) for ray, way in zip(rays, lengths, strict=True))
    return x, y


def _along(ray: _Ray, length: float) -> Array:
    """The cycle at a distance along a ray."""
    chart, start, tangent = ray
    units = chart.scale(start)
    return _solved(chart, start + units * tangent * length, units, tangent)


def _solved(chart: Chart, guess: Array, units: Array, tangent: Array) -> Array:
    """The cycle across a direction from a guess."""
    return correct(chart, guess, units, tangent, _TOLERANCE, left=CLOSES_TO)


def _happens(chart: Chart, point: Point, x: Array, tangent: Array) -> bool:
    """Return whether a test function changes its sign between two points."""
    there = chart.tests(x, tangent * chart.scale(x))
    return any(value * point.tests[name] < 0.0 for name, value in there.items())


def _carried(
    chart: Chart, x: Array, tangent: Array, trial: Array, after: Sequence, distance: float
) -> tuple[int, int] | None:
    """The contact that sticks throughout up to a corner and slips in one direction just beyond it,
    with the direction.

    Slightly further it may slip in both directions, as it does if it rests midway between its
    edges.
    """
    further = _sequence_at(chart, x + chart.scale(x) * tangent * _FURTHER * distance)
    for held in chart.shooting.setting.held:
        ways = {mode[held.contact] for s in (after, further or ()) for mode, _ in s} - {0}
        if len(ways) == 1 and not held.edge:
            return held.contact, ways.pop()
    return None


def _sequence_at(chart: Chart, x: Array) -> Sequence | None:
    try:
        return sequence(chart.orbit(x).motion)
    except _FAILURES:
        return None


def _along_the_edge(
    chart: Chart, x: Array, towards: Array, edge: tuple[int, int]
) -> BeyondCorner | None:
    """A cycle on which a contact is carried along, while the parameter changes as before."""
    other = chart.carrying(*edge)
    units = chart.scale(x)
    for length in _LENGTHS:
        try:
            tangent, _ = direction(other, x, units, towards)
            tangent = tangent if tangent[-1] * towards[-1] > 0.0 else -tangent
            there = _solved(other, x + units * tangent * length, units, tangent)
            if (
                other.shooting.miss(other.orbit(there)) <= NOT_CLOSED
                and other.carried(there, tangent * units) > 0.0
            ):
                ahead, _ = direction(other, there, units, tangent)
                return BeyondCorner(other, there, ahead * units)
        except _FAILURES:
            continue
    return None


def _approach(
    chart: Chart, x: Array, tangent: Array, here: Sequence, reach: float
) -> tuple[Array, Array, Array] | None:
    """The last point of this side, one slightly before, and the tangent; None if there is no end
    within reach."""
    passed = 0.0
    step = 0.25 * reach
    beside = x
    for _ in range(_MOST):
        if step <= _LOCATED or passed > reach:
            break
        units = chart.scale(x)
        try:
            trial = _solved(chart, x + units * tangent * step, units, tangent)
            orbit = chart.orbit(trial)
            chart.check(orbit)
            # Near a grazing contact the derivatives are unbounded, and no cycle closes to machine
            # precision: this side ends with the last cycle that closes.
            same = sequence(orbit.motion) == here and chart.shooting.miss(orbit) <= CLOSED
            ahead = tangent
            if same and step > _TANGENT:
                ahead, _ = direction(chart, trial, chart.scale(trial), tangent)
        except _FAILURES:
            same = False
            trial = x
            ahead = tangent
        if same:
            passed = passed + step
            x = trial
            tangent = ahead
            beside = trial if step > _BESIDE else beside
        else:
            step *= 0.5
    return None if passed > reach else (x, beside, tangent)


def _well_inside(chart: Chart, x: Array) -> bool:
    """Return whether a cycle starts well inside its first phase, which is also its last one."""
    motion = chart.orbit(x).motion
    k = motion.knots
    found = segments(motion)
    before, after = (float(k.time[b] - k.time[a]) for a, b in (found[-1], found[0]))
    return len(found) == 1 or min(before, after) > _EDGE * (before + after)


def _unit(chart: Chart, x: Array, tangent: Array) -> Array:
    scaled = tangent / chart.scale(x)
    return scaled / np.linalg.norm(scaled)


def _beyond(
    chart: Chart, x: Array, tangent: Array, here: Sequence, distances: tuple[float, ...]
) -> tuple[Array, Sequence, float] | None:
    """A trial point ahead whose motion has another sequence."""
    units = chart.scale(x)
    for distance in distances:
        trial = x + units * tangent * distance
        try:
            there = sequence(chart.orbit(trial).motion)
        except _FAILURES:
            return None
        if there != here:
            return trial, there, distance
    return None


def _onward(
    chart: Chart,
    x: Array,
    towards: Array,
    trial: Array,
    here: Sequence,
    lengths: tuple[float, ...] = _ONWARD,
) -> BeyondCorner | None:
    """A cycle beyond the corner, in one of the two directions of the null vector of the derivatives
    there, excluding the way back."""
    chart = chart.resting_as(chart.orbit(trial).motion)
    units = chart.scale(x)
    rows = chart(trial)[1] * units
    # The tangent beyond the corner is the null vector of the equations of the other sequence,
    # evaluated at a trial point, since they are not defined at the corner itself.
    null = np.linalg.svd(ratio(rows, np.max(np.abs(rows), axis=1, keepdims=True)))[2][-1]
    nearest = None
    for length, sense in product(lengths, (null, -null)):
        with suppress(*_FAILURES):
            found = _beyond_along(chart, x, sense, length, here)
            if found is None or _unit(chart, found.x, found.towards) @ towards < _BACK:
                continue
            if not _is_kept(found):
                continue
            if found.gap(x, chart.on_edge).ok:
                return found
            nearest = nearest or found
    return nearest


def _is_kept(found: BeyondCorner) -> bool:
    """Return whether the next chart starts from a cycle with the same sequence.

    Rounding errors grow along an unstable cycle: too near to a corner, another first state of it
    has the sequence of the side that the branch comes from, and the branch would turn back.
    """
    chart, y, towards = renewed(found.chart, found.x, found.towards)
    units = chart.scale(y)
    tangent, _ = direction(chart, y, units, towards / units)
    orbit = chart.orbit(_solved(chart, y, units, tangent))
    return sequence(orbit.motion) == sequence(found.chart.orbit(found.x).motion)


def _beyond_along(
    chart: Chart, x: Array, sense: Array, length: float, here: Sequence
) -> BeyondCorner | None:
    """A cycle of another sequence at a distance from the corner, along a direction consistent with
    the chord to it.

    The first solution may have more switches than the trial that gave the direction; then its
    tangent replaces the direction.
    """
    units = chart.scale(x)
    for _ in range(_DIRECTIONS):
        there = _solved(chart, x + units * sense * length, units, sense)
        orbit = chart.orbit(there)
        chord = (there - x) / units
        after = sequence(orbit.motion)
        if after == here or is_open(after) or chart.shooting.miss(orbit) > NOT_CLOSED:
            return None
        if sense @ chord > _ALONG * np.linalg.norm(chord):
            ahead, _ = direction(chart, there, units, sense)
            return BeyondCorner(chart, there, units * ahead)
        sense, _ = direction(chart, there, units, chord)
    return None
