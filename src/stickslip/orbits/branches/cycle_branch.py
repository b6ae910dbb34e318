"""Branches of cycles in a parameter: folds, period doublings, tori, stick onset, grazing, changes
of the sequence.

The curve is followed in charts: coordinates around one state of the cycle, in units of its size.
After some points the chart is renewed around the best state of the present cycle, and the direction
of travel is carried over along the motion. The equations do not contain the sequence of modes; it
is read from the motion, and if it changes between two points, the change is located.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual, within
from stickslip.errors import DeclarationError
from stickslip.numerics.ratios import ratio
from stickslip.orbits.branches.chart import (
    CLOSES_TO,
    KNOWN_TO,
    Chart,
    Extent,
    extent_of,
    first_chart,
    renewed,
    symmetric_branch_point,
)
from stickslip.orbits.branches.corner import BeyondCorner, Corner, corner_after
from stickslip.orbits.branches.cycles_along import TWICE, Spacing, dataset, of_branch
from stickslip.orbits.branches.equilibrium_branch import checked_range
from stickslip.orbits.branches.halving import doubling_near, half_gap
from stickslip.orbits.branches.rest import LEAST_EXPONENT, shrinks_to_rest
from stickslip.orbits.branches.special_points import (
    NOT_SMOOTH,
    Happening,
    critical,
    happening_at,
    is_flat,
    locate_changes,
    vanishes_at,
)
from stickslip.orbits.continuation.branch import SOLVED_TO, Branch, SpecialPoint, with_special
from stickslip.orbits.continuation.driver import (
    CurveProblem,
    PointOnTheWay,
    Start,
    Tell,
    both_ways,
    follow_branch,
    in_pieces,
    joined,
    step_after,
    told_of_points,
)
from stickslip.orbits.continuation.path import (
    BROKEN_OFF,
    Ending,
    Path,
    Point,
    StepControl,
    Stop,
    Test,
    ranges,
)
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.finding import from_cycle
from stickslip.orbits.cycles.hopf_switching import shrinks_to
from stickslip.orbits.cycles.period import part_of
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.damped_newton import CLOSED, Closed
from stickslip.orbits.return_map.mode_sequence import LOSS
from stickslip.stopping.scopes import limited

_STEPS = StepControl(
    first=0.01, largest=0.25, tolerance=1e-8, turn=0.3, rounding=KNOWN_TO, left=CLOSES_TO
)
_IN_CHART = 8  # number of points before the chart is renewed
_BETWEEN = 2.0  # distances of neighbours on a branch
_CLOSED = Ending(Stop.CLOSED, "the branch is closed")
CHART_PATIENCE = 64.0  # a step is shortened by this factor before the chart is renewed
_ENDINGS = ("amplitude", "halving", "growth", "period", "carried")
# special points at which phases neither appear nor vanish
_SMOOTH = frozenset({"fold", "period doubling", "torus", "branch point"})
# corners this near, relative to the range and the size of a cycle, are regarded as one
_SAME = 1e-6
_SMALLER = 0.1  # factor on the smallest size while a cycle is not found to vanish, …
_TINY = 1e-5  # … down to this fraction of the state
_GROWN = 1.1  # ratio of two sizes that show how they vanish
_DISTINCT = 1e-9  # sizes that differ by less, relative to each other, are the same


@dataclass
class _Event:
    """An event on the branch: at a cycle, or at the equilibrium to which the cycles shrink."""

    what: Happening
    cycle: Cycle
    value: float
    centre: Array | None = None


@dataclass
class _Station:
    """A point of the branch, its events, and its distance from the previous point."""

    value: float
    cycle: Cycle
    events: list[_Event] = field(default_factory=list)
    step: float = 0.0


@validated
def continue_cycle(
    cycle: Cycle,
    parameter: str,
    span: tuple[float, float],
    *,
    steps: StepControl | None = None,
    time_limit: float | None = None,
    progress: Tell | None = None,
) -> Branch:
    """Continue a cycle in a parameter.

    Parameters
    ----------
    cycle : Cycle
    parameter : str
        The parameter that changes.
    span : (float, float)
        Its range, which contains the value of the cycle.
    steps : StepControl, optional
    time_limit : float, optional
        Wall-clock limit in seconds; the branch found so far is returned.
    progress : callable, optional
        Called with every new point (``.side``, ``.values``). By default a progress bar is shown.

    Returns
    -------
    Branch
        In both directions from the cycle, through folds and changes of the sequence. ``special``
        has the kinds

        - ``"fold"`` (with a note at a corner of the branch), ``"period doubling"``,
          ``"torus"``, ``"branch point"``;
        - ``"stick onset"`` (a contact begins or ceases to stick), ``"slip back"`` (a contact begins
          or ceases to slip back before it sticks), ``"grazing"`` (a phase appears where a boundary
          is touched), ``"slip onset"`` (a contact begins to slip, or from then on sticks throughout
          at a constant position), ``"knot"`` (a phase appears at a knot of a smooth table),
          ``"sequence change"`` (any other), ``"loss of the cycle"`` (it ends at a change);
        - ``"Hopf"`` and ``"boundary equilibrium"`` (the cycle shrinks to an equilibrium inside a
          mode or on its boundary).

        For driven systems ``time`` is the time of the state.

    Every point is a certified cycle within the range; cycles that are not certified are not part of
    the branch.

    Raises
    ------
    DeclarationError
        If an argument is wrong, or the cycle is not certified.
    """
    if not isinstance(cycle, Cycle):
        raise DeclarationError(
            "cycle", f"expected a Cycle, got {type(cycle).__name__}", "Use a cycle from find_cycle"
        )
    if not cycle.certificate.ok:
        raise DeclarationError(
            "cycle", f"the cycle is {cycle.certificate.verdict}", "Start from a certified cycle"
        )
    low, high = checked_range(cycle.system, parameter, span)
    value = cycle.parameters[parameter]
    if not low <= value <= high:
        raise DeclarationError(
            "cycle",
            f"the cycle is at {parameter} = {value:g}, outside ({low:g}, {high:g})",
            "Choose a range that includes this value",
        )
    with (
        limited(time_limit, f"a branch of {cycle.system.name}"),
        told_of_points(progress, "following the cycle") as tell,
    ):
        follower = _Follower(cycle, parameter, (low, high), steps or _STEPS)
        back, forth, ends = both_ways(lambda sign: follower.follow(sign, tell), -1.0)
    return follower.branch(back, forth, ends)


class _Follower:
    def __init__(
        self, cycle: Cycle, parameter: str, span: tuple[float, float], steps: StepControl
    ) -> None:
        self.cycle = cycle
        self.parameter = parameter
        self.span = span
        self.steps = steps
        self.extent = extent_of(cycle.closed, parameter, span)
        self.pieces = Pieces(cycle.closed.orbit.problem.compiled.equations, parameter)
        self.start = _Station(cycle.parameters[parameter], cycle)
        self.spacing = Spacing({parameter: span}, self.extent.modulus)

    def follow(self, sign: float, tell: Tell) -> tuple[list[_Station], Ending]:
        """The points in one direction, from the start, and the end."""
        stations = [replace(self.start, events=[])]

        def found(chart: Chart, point: Point) -> None:
            tell(PointOnTheWay(sign, self._values(chart.cycle(point.x))))

        def onward(start: Start[Chart], path: Path) -> Start[Chart] | Ending:
            return self._onward(stations, start, path)

        chart, x = first_chart(self.cycle.closed, self.pieces, self.extent, halves=True)
        towards = np.zeros(len(x))
        towards[-1] = sign
        start = self._start(chart, x, towards, self.steps.first)
        return stations, follow_branch(start, onward, "no further cycle was found", found)

    def _values(self, cycle: Cycle) -> dict[str, float]:
        """Quantities of a cycle that are known without further computation."""
        values = {"period": cycle.period}
        for (name, value), (low, high) in zip(cycle.state.items(), cycle.ranges, strict=True):
            values |= {name: value, f"min_{name}": float(low), f"max_{name}": float(high)}
        return {**values, self.parameter: cycle.parameters[self.parameter]}

    def _onward(
        self, stations: list[_Station], start: Start[Chart], path: Path
    ) -> Start[Chart] | Ending:
        """Append the points found in a chart; return the next chart, or the end."""
        chart, step = start.of, start.steps.first
        before = len(stations)
        self._append(stations, chart, path)
        last = path.points[-1]
        if path.ended.test == "amplitude" and not self._vanishes(stations, chart.extent):
            there = renewed(chart.to_smaller_cycles(_SMALLER), last.x, last.tangent)
            return self._start(*there, step_after(path, self.steps))
        ending = self._end(path, stations, before)
        if ending is not None:
            return ending
        if path.ended.test == "carried":
            kept = self._left_behind(stations, chart, last.tests["carried"])
            return self._start(*renewed(kept, last.x, last.tangent), self.steps.first)
        if path.ended.stop is not Stop.LIMIT:
            bent = corner_after(chart, last, start.steps.smallest, self.steps.turn)
            if bent is not None:
                where = f"{self.parameter} = {bent.cycle.parameters[self.parameter]:.12g}"
                if self._passed_before(stations, bent):
                    return Ending(
                        Stop.LOST,
                        f"the branch returns to {where} and would repeat indefinitely; one of its "
                        "corners has another continuation",
                    )
                beyond = self._around(stations, chart, bent)
                if beyond is None:
                    return Ending(Stop.EVENT, f"{LOSS} at {where}: {bent.what.note}")
                there = renewed(beyond.chart, beyond.x, beyond.towards)
                return self._start(*there, self.steps.first)
            if chart.half is not None and path.ended.stop is Stop.LOST and len(path.points) == 1:
                # Cycles may lose the symmetry of the equations themselves, at a new phase.
                plain = renewed(chart.without_half_map(), last.x, last.tangent)
                return self._start(*plain, self.steps.first)
            shortest = CHART_PATIENCE * self.steps.smallest
            if max(step, last.length - path.points[0].length) <= shortest:
                return path.ended
        step = step / CHART_PATIENCE if len(path.points) == 1 else step_after(path, self.steps)
        return self._start(*renewed(chart, last.x, last.tangent), step)

    def _start(self, chart: Chart, x: Array, towards: Array, step: float) -> Start[Chart]:
        """Some points in one chart."""
        problem = CurveProblem(
            chart,
            chart.scale,
            chart.tests,
            {name: name for name in _ENDINGS},
            ranges({self.parameter: self.span}),
            lambda last, new: self.spacing.check(chart.cycle(last.x), chart.cycle(new.x)),
            lambda last, new: locate_changes(chart, last, new),
        )
        steps = in_pieces(self.steps, step, _IN_CHART, self._smallest(step))
        return Start(chart, problem, x, towards, steps)

    def _smallest(self, step: float) -> float:
        """Step below which a chart is given up."""
        return max(self.steps.smallest, step / CHART_PATIENCE)

    # -- points ------------------------------------------------------------------------------------

    def _append(self, stations: list[_Station], chart: Chart, path: Path) -> None:
        """Append the points of a path after its first, with the events at and between them."""
        for i in range(1, len(path.points)):
            point = path.points[i]
            slope = float(point.tangent[-1] / point.units[-1])
            cycle = chart.cycle(point.x)
            happened = [path.breaks[i].what] if i in path.breaks else []
            here = [c for c in path.crossings if c.index == i and c.name not in _ENDINGS]
            if any(c.name == "branch point" for c in here):
                cycle = symmetric_branch_point(chart, point.x) or cycle
            happened += [
                happening_at(c, slope, cycle.nontrivial) for c in here if not is_flat(path, c)
            ]
            self._add(stations, cycle, [found for found in happened if found])

    def _add(self, stations: list[_Station], cycle: Cycle, happened: list[Happening]) -> None:
        """Append a cycle, unless it is the last one or not certified; its events are always
        kept."""
        value = cycle.parameters[self.parameter]
        events = [_Event(found, cycle, value) for found in happened]
        step = self.spacing(stations[-1].cycle, cycle)
        if step > TWICE and cycle.certificate.ok:
            stations.append(_Station(value, cycle, events, step))
        else:
            stations[-1].events += events

    def _left_behind(self, stations: list[_Station], chart: Chart, carried: float) -> Chart:
        """Let contacts that are no longer carried along keep their rest positions.

        Parameters
        ----------
        carried : float
            Residual of the rate at which they are carried.
        """
        names = self.pieces.equations.labels
        for held in chart.shooting.setting.held:
            if held.edge:
                name = names[held.contact]
                note = f"contact '{name}' is no longer carried along and stays at its rest position"
                left = Residual("rate at which it is carried", abs(carried), SOLVED_TO)
                what = Happening("slip onset", note, (left,))
                self._add(stations, stations[-1].cycle, [what])
                chart = chart.carrying(held.contact, 0)
        return chart

    def _passed_before(self, stations: list[_Station], bent: Corner) -> bool:
        """Return whether the branch has passed a corner before; if so, note it as a special point
        that has not been solved for."""
        value = bent.cycle.parameters[self.parameter]
        near = _SAME * (self.span[1] - self.span[0])
        for event in [event for station in stations for event in station.events]:
            if (
                (event.what.kind, event.what.note) == (bent.what.kind, bent.what.note)
                and abs(event.value - value) <= near
                and self.spacing(event.cycle, bent.cycle) <= _SAME
            ):
                left = Residual("earlier passages of this corner", 1.0, 0.0)
                what = replace(bent.what, residuals=(*bent.what.residuals, left))
                self._add(stations, bent.cycle, [what])
                return True
        return False

    def _around(self, stations: list[_Station], chart: Chart, bent: Corner) -> BeyondCorner | None:
        """Append a corner and a point beyond it; None if the branch does not continue from the
        corner."""
        onward = bent.onward
        if onward is not None and not self._continues(onward):
            onward = None
        what = bent.what if onward else replace(bent.what, kind=LOSS)
        happened = [what]
        if onward and bent.turn.ok:
            happened.append(Happening("fold", NOT_SMOOTH, (*what.residuals, bent.turn)))
        if not bent.cycle.certificate.ok:
            self._add(stations, chart.cycle(bent.beside), [])
        self._add(stations, bent.cycle, happened)
        if onward:
            self._add(stations, onward.chart.cycle(onward.x), [])
        return onward

    def _continues(self, onward: BeyondCorner) -> bool:
        """Return whether a point beyond a corner is a cycle within the range.

        This close to the corner the point need not be certified; the following points must be.
        """
        orbit = onward.chart.orbit(onward.x)
        inside = self.span[0] <= float(onward.x[-1]) <= self.span[1]
        return inside and onward.chart.shooting.miss(orbit) <= CLOSED

    def _features(self, cycle: Cycle) -> Array:
        """Features that distinguish cycles of a branch: parameter, period, and ranges relative to
        the state."""
        part = cycle.parameters[self.parameter] / (self.span[1] - self.span[0])
        widths = [
            (high - low) / m
            for (low, high), m in zip(cycle.ranges, self.extent.modulus, strict=True)
        ]
        return np.array([part, np.log(cycle.period), *widths])

    # -- ends --------------------------------------------------------------------------------------

    def _end(self, path: Path, stations: list[_Station], before: int) -> Ending | None:
        """Reason for the end of the branch, if it ends here."""
        if path.ended.stop in (*BROKEN_OFF, Stop.RANGE):
            return path.ended
        if path.ended.stop is Stop.EVENT and path.ended.test != "carried":
            return Ending(
                Stop.EVENT, self._event_in_words(path.ended.test, stations), path.ended.test
            )
        if len(stations) > self.steps.most:
            return Ending(Stop.LIMIT, f"the limit of {self.steps.most} points was reached")
        return _CLOSED if self._returned_to_start(stations, before) else None

    def _event_in_words(self, name: Test | None, stations: list[_Station]) -> str:
        """Describe the event at the zero of a test function that ends the branch."""
        cycle = stations[-1].cycle
        if name == "period":
            return f"the period grows without bound; it has reached {cycle.period:.6g}"
        if name == "growth":
            grown = self._amplitude(cycle)
            return f"the cycle grows without bound, to {grown:.3g} times the initial state"
        smooth = len(cycle.phases) == 1
        if name == "amplitude" and smooth and cycle.closed.shooting.symmetry.driven:
            # Its excitation vanishes, and the cycle in proportion.
            value, _ = self._vanishing(stations, lambda c: self.extent.amplitude(c.closed), 1)
            width = self.span[1] - self.span[0]
            about = round(value / width, 4) * width
            return f"the cycle shrinks to a steady motion, at about {self.parameter} = {about:.4g}"
        event = self._halved(stations) if name == "halving" else self._vanished(stations)
        if self.span[0] <= event.value <= self.span[1]:
            stations[-1].events.append(event)
        return f"{event.what.kind} at {self.parameter} = {event.value:.12g}: {event.what.note}"

    def _vanishes(self, stations: list[_Station], extent: Extent) -> bool:
        """Return whether a small cycle shrinks to an equilibrium: without other evidence, the
        parameter must approach its limit at the rate of the size."""
        if len(stations[-1].cycle.phases) == 1 or extent.least <= _TINY:
            return True
        return all(left.ok for left in self._vanished(stations).what.residuals)

    def _vanished(self, stations: list[_Station]) -> _Event:
        """The cycle shrinks to an equilibrium, inside a mode or on its boundary."""
        cycle = stations[-1].cycle
        smooth = len(cycle.phases) == 1
        value, known = self._vanishing(stations, self._amplitude, 2 if smooth else 1)
        centre = np.mean(cycle.closed.samples(64), axis=0)
        born = shrinks_to(cycle.closed, self.parameter, value) if smooth else None
        kind = "Hopf" if smooth else "boundary equilibrium"
        left = [("change by the next term of the extrapolation", known)]
        what = Happening(
            kind, "the cycle shrinks to an equilibrium", tuple(within(SOLVED_TO, left))
        )
        rest = None
        if not smooth:
            width = self.span[1] - self.span[0]
            rest = shrinks_to_rest(cycle.closed, self.pieces, self.parameter, width)
        if rest is not None:
            value, centre = rest.value, rest.state
            left = [("force at its threshold", rest.margin), ("motion at rest", rest.moves)]
            name, least = "exponent of the size", LEAST_EXPONENT
            shrinks = Residual(name, self._exponent(stations, value), least, least=True)
            what = replace(what, residuals=(*within(SOLVED_TO, left), shrinks))
        if born is not None:
            value, centre = born.value, born.equilibrium
            left = [("real part of the eigenvalue", born.growth), ("rates", born.moves)]
            what = replace(what, residuals=tuple(within(SOLVED_TO, left)))
        return _Event(what, cycle, value, centre)

    def _halved(self, stations: list[_Station]) -> _Event:
        """The cycle becomes one of half its period, which doubles its period there."""
        last = stations[-1]
        near, known = self._vanishing(stations, lambda cycle: half_gap(cycle.closed), 2)

        def at(closed: Closed, value: float) -> Closed:
            return from_cycle(closed, {self.parameter: value})

        found = doubling_near(part_of(last.cycle.closed, 2), last.value, near, at)
        note = "the cycle becomes a cycle of half its period"
        left = [("change by the next term of the extrapolation", known)]
        what = Happening("period doubling", note, tuple(within(SOLVED_TO, left)))
        if found is not None:
            near, missed = found
            what = replace(what, residuals=(critical(-1.0, missed),))
        return _Event(what, last.cycle, near)

    def _vanishing(
        self, stations: list[_Station], size: Callable[[Cycle], float], power: int
    ) -> tuple[float, float]:
        """Value of the parameter at which a size of cycles is 0, by a fit linear in a power of the
        size; and its change by the next term, as a fraction of the range."""
        known: list[tuple[float, float]] = []
        for station in reversed(stations):
            there = size(station.cycle) ** power
            if not known or there > (1.0 + _DISTINCT) * known[-1][0]:
                known.append((there, station.value))
            if len(known) == 3:
                value, bent = vanishes_at(known[:2]), vanishes_at(known)
                return value, abs(bent - value) / (self.span[1] - self.span[0])
        return vanishes_at(known[:2]), math.inf

    def _exponent(self, stations: list[_Station], value: float) -> float:
        """Exponent with which the sizes of the last cycles vanish with their distance from a value
        of the parameter."""
        last = stations[-1]
        size, left = self._amplitude(last.cycle), abs(last.value - value)
        for station in reversed(stations[:-1]):
            grown = self._amplitude(station.cycle) / size
            if grown > _GROWN:
                farther = abs(station.value - value) / left if left else math.inf
                return math.log(grown) / math.log(farther) if farther > 1.0 else 0.0
        return 0.0

    def _amplitude(self, cycle: Cycle) -> float:
        ranges = cycle.ranges[:, 1] - cycle.ranges[:, 0]
        return float(np.max(ranges / self.extent.modulus))

    def _returned_to_start(self, stations: list[_Station], before: int) -> bool:
        """Return whether a step after the given point has passed the start of the branch."""
        if len(stations) <= 2 * _IN_CHART:
            return False
        start = self._features(self.cycle)
        for one, other in itertools.pairwise(stations[before - 1 :]):
            a, b = self._features(one.cycle), self._features(other.cycle)
            chord, offset = b - a, start - a
            part = ratio(offset @ chord, chord @ chord)
            length = float(np.linalg.norm(chord))
            beside = np.linalg.norm(offset - part * chord) < 0.1 * length
            if 0.0 < part <= 1.0 and beside and self._is_between(one.cycle, other.cycle, length):
                return True
        return False

    def _is_between(self, one: Cycle, other: Cycle, length: float) -> bool:
        """Return whether the start of the branch is as near to a cycle as the previous cycle is:
        cycles of equal widths may occur at other phases of a drive.

        Parameters
        ----------
        length : float
            Distance of the features of both cycles, which may have the same states.
        """
        near, apart = (
            other.closed.distance(np.array([*cycle.state.values()]), cycle.time)
            for cycle in (self.cycle, one)
        )
        return near <= _BETWEEN * max(apart, length)

    # -- results -----------------------------------------------------------------------------------

    def branch(
        self, back: list[_Station], forth: list[_Station], ends: tuple[Ending, Ending]
    ) -> Branch:
        """The two directions as one branch, from the far end of the first to that of the second."""
        if back and forth:
            back[0].events += forth[0].events
        stations = self._apart(joined(back, forth))
        special = [self._special(event, i) for i, s in enumerate(stations) for event in s.events]
        cycles, steps = [s.cycle for s in stations], np.array([s.step for s in stations])
        return Branch(
            self.cycle.system,
            dict(self.cycle.parameters),
            self.parameter,
            lambda: dataset([self.parameter], cycles, steps),
            special,
            ends,
            with_special(self._certificate(stations, steps), special),
            cycles=cycles,
        )

    def _certificate(self, stations: list[_Station], steps: Array) -> Certificate:
        """The certificate of the points; phases of stick may appear and vanish only at special
        points."""
        found = of_branch([s.cycle for s in stations], {self.parameter: self.span}, steps)
        explained = [any(e.what.kind not in _SMOOTH for e in s.events) for s in stations]
        changes = sum(
            a.cycle.sticks != b.cycle.sticks and not (explained[i] or explained[i + 1])
            for i, (a, b) in enumerate(itertools.pairwise(stations))
        )
        unexplained = Residual("changes of stick without a special point", float(changes), 0.0)
        return replace(found, residuals=(*found.residuals, unexplained))

    def _apart(self, found: list[_Station]) -> list[_Station]:
        """The points of a branch with their distances, in units of the whole branch; points that
        coincide in these units are merged."""
        stations = [replace(found[0], step=0.0)]
        for station in found[1:]:
            step = self.spacing(stations[-1].cycle, station.cycle)
            if step > TWICE:
                stations.append(replace(station, step=step))
            else:
                stations[-1].events += station.events
        return stations

    def _special(self, event: _Event, index: int) -> SpecialPoint:
        cycle = event.cycle
        state = event.cycle.state
        field = cycle.closed.shooting.stations[0].piece.field
        if event.centre is not None:
            state = dict(zip(state, map(float, event.centre), strict=True))
        parameters = {**cycle.parameters, self.parameter: event.value}
        data = {"time": cycle.time} if cycle.closed.shooting.symmetry.driven else {}
        mode, region = field.mode, field.region
        numbers = (state, parameters, mode, region, index, cycle.period, data)
        what, own = event.what, event.what.residuals
        if event.centre is None:
            missed = cycle.closed.shooting.miss(cycle.closed.orbit)
            own += (Residual("closure", missed, CLOSED, note="of the size of the cycle"),)
        return SpecialPoint(what.kind, self.parameter, event.value, *numbers, what.note, own)
