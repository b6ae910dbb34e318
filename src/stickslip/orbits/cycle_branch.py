"""Branches of cycles over a parameter: folds, period doublings, tori, stick onset, grazing, changes of the sequence.

The curve is followed in charts: coordinates around one state of the cycle, in units of its size. After some points the
chart is made anew around the best state of the present cycle, and the direction of travel is carried over along the
motion. No equation knows the sequence of modes; it is read off the motion, and where it changes between two points
the change is located.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from stickslip.errors import DeclarationError, StickslipError
from stickslip.orbits.birth import shrinks_to
from stickslip.orbits.branch import Branch, SpecialPoint
from stickslip.orbits.chart import Chart, extent_of, first_chart, renewed
from stickslip.orbits.closing import Closed
from stickslip.orbits.continuation import UNDEFINED, Lost, Path, Point, Steps, correct, trace
from stickslip.orbits.corner import corner_after
from stickslip.orbits.cycle_points import confirmed, dataset, is_flat, locate_changes
from stickslip.orbits.cycles import Cycle, find_cycle, make_cycle
from stickslip.orbits.equilibrium_branch import checked_range
from stickslip.orbits.halving import doubles_at, half_gap
from stickslip.orbits.period import part_of
from stickslip.orbits.pieces import Pieces
from stickslip.orbits.touching import LOSS
from stickslip.progress import Show, watched

Array = np.ndarray

STEPS = Steps(first=0.01, largest=0.25, tolerance=1e-8, turn=0.3)
IN_CHART = 8  # points before the chart is made anew
FULL = f"the limit of {IN_CHART + 1} points was reached"
CLOSED, INTERRUPTED = "the branch is closed", "interrupted"
AT_END = 1e-9  # part of the range within which its end is reached
PATIENCE = 64.0  # a step is shortened by this factor before the chart is made anew
ENDINGS = ("low", "high", "amplitude", "halving", "growth", "period")


@dataclass
class _Station:
    """A point of the branch and what happens there.

    The last one may stand a little before the point where its cycle vanishes: at `limit`, in the equilibrium `centre`.
    """

    value: float
    cycle: Cycle
    events: list[tuple[str, str]] = field(default_factory=list)
    end: str = ""
    limit: float | None = None
    centre: Array | None = None


def continue_cycle(cycle: Cycle, parameter: str, span: tuple[float, float], *, steps: Steps | None = None) -> Branch:
    """Follow a cycle while a parameter changes.

    Parameters
    ----------
    cycle : Cycle
    parameter : str
        The parameter that changes.
    span : (float, float)
        Its range, with the cycle's own value inside.
    steps : Steps, optional

    Returns
    -------
    Branch
        Both ways from the cycle, through folds and changes of the sequence. ``special`` has the kinds

        - ``"fold"`` (noted as not smooth at a corner of the branch), ``"period doubling"``, ``"torus"``,
          ``"branch point"``;
        - ``"stick onset"`` (a contact begins to stick, or no longer does), ``"grazing"`` (a phase appears where a
          boundary is touched), ``"sequence change"`` (any other), ``"loss of the cycle"`` (it ends at a change);
        - ``"Hopf"`` and ``"boundary equilibrium"`` (the cycle shrinks to an equilibrium inside a mode or on its
          boundary).

        Of driven systems ``time`` says when the state is passed.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    if not isinstance(cycle, Cycle):
        raise DeclarationError("cycle", f"expected a Cycle, got {type(cycle).__name__}", "Use find_cycle")
    low, high = checked_range(cycle.system, parameter, span)
    value = cycle.parameters[parameter]
    if not low <= value <= high:
        raise DeclarationError("cycle", f"it is at {parameter} = {value:g}, outside ({low:g}, {high:g})", "Enclose it")
    follower = _Follower(cycle, parameter, (low, high), steps or STEPS)
    with watched("following the cycle") as show:
        back = follower.follow(-1.0, show)
        forth = ([], back[1]) if back[1] in (CLOSED, INTERRUPTED) else follower.follow(1.0, show)
    return follower.branch(back, forth)


class _Follower:
    def __init__(self, cycle: Cycle, parameter: str, span: tuple[float, float], steps: Steps) -> None:
        self.cycle, self.parameter, self.span, self.steps = cycle, parameter, span, steps
        self.extent = extent_of(cycle.closed, span)
        self.pieces = Pieces(cycle.closed.orbit.problem.compiled.equations, parameter)

    def follow(self, sign: float, show: Show) -> tuple[list[_Station], str]:
        """The points in one direction, without the start, and the reason for the end."""
        stations: list[_Station] = []
        try:
            return stations, self._collect(sign, stations, show)
        except KeyboardInterrupt:
            return stations, INTERRUPTED

    def _collect(self, sign: float, stations: list[_Station], show: Show) -> str:
        """Append the points in one direction; the reason for the end."""
        chart, x = first_chart(self.cycle.closed, self.pieces, self.extent)
        towards = np.zeros(len(x))
        towards[-1] = sign
        step = self.steps.first
        while True:
            try:
                path = self._trace(chart, x, towards, step)
            except StickslipError as failure:
                return f"no cycle was found further on ({failure})"
            stations += self._stations(chart, path)
            last, bent = path.points[-1], None
            show(None, f"{len(stations)} points, {self.parameter} = {float(last.x[-1]):.6g}")
            if path.ended not in (FULL, INTERRUPTED, *ENDINGS):
                stations += self._edge(chart, last)
            reason = self._end(path, stations)
            if reason:
                return reason
            if path.ended not in (FULL, *ENDINGS):
                bent = corner_after(chart, last, self._smallest(step), self.steps.turn)
            if bent is not None:
                stations.append(self._station(chart, bent.x))
                if bent.onward is None:
                    stations[-1].events.append((LOSS, bent.note))
                    return f"{LOSS} at {self.parameter} = {stations[-1].value:.12g}: {bent.note}"
                stations[-1].events.append((bent.kind, bent.note))
                x, towards = bent.onward
                if towards[-1] * last.tangent[-1] < 0.0:
                    stations[-1].events.append(("fold", "not smooth: the sequence changes there"))
                stations.append(self._station(chart, x))
                chart, x, towards = renewed(chart, x, towards)
                step = self.steps.first
                continue
            if len(path.points) == 1 and step <= PATIENCE * self.steps.smallest:
                return self._reached(float(last.x[-1])) or path.ended
            step = self._next_step(path, step)
            chart, x, towards = renewed(chart, last.x, last.tangent)

    def _edge(self, chart: Chart, last: Point) -> list[_Station]:
        """The cycle at the end of the range, if it is a step away: a parameter may not be allowed to go beyond."""
        side = int(last.tangent[-1] > 0.0)
        value = self.span[side]
        if not 0.0 < abs(value - last.x[-1]) < self.steps.largest * abs(last.tangent[-1]):
            return []
        units, along = chart.scale(last.x), np.zeros(len(last.x))
        along[-1] = 1.0
        guess = last.x + last.tangent * (value - last.x[-1]) / last.tangent[-1]

        def exactly(x: Array) -> Array:
            return np.append(x[:-1], value)

        try:
            x = exactly(correct(lambda x: chart(exactly(x)), guess, units, along, self.steps.tolerance))
        except (Lost, *UNDEFINED):
            return []
        found = self._station(chart, x)
        found.end = ("low", "high")[side]
        return [found]

    def _trace(self, chart: Chart, x: Array, towards: Array, step: float) -> Path:
        """Some points in one chart."""
        steps = replace(self.steps, first=step, smallest=self._smallest(step), most=IN_CHART + 1)
        return trace(
            chart,
            x,
            towards,
            scale=chart.scale,
            tests=chart.tests,
            endings={name: name for name in ENDINGS},
            steps=steps,
        )

    def _smallest(self, step: float) -> float:
        """Step below which a chart is given up."""
        return max(self.steps.smallest, step / PATIENCE)

    def _next_step(self, path: Path, step: float) -> float:
        """Length of the first step in the next chart."""
        if len(path.points) == 1:
            return step / PATIENCE
        return min(1.5 * (path.points[-1].length - path.points[-2].length), self.steps.largest)

    def _stations(self, chart: Chart, path: Path) -> list[_Station]:
        """The points of a path after its first, with what happens at and between them."""
        found = []
        for i in range(1, len(path.points)):
            changes = locate_changes(chart, path.points[i - 1], path.points[i])
            for change in changes:
                found.append(self._station(chart, change.x))
                found[-1].events.append((change.kind, change.note))
            point = path.points[i]
            found.append(self._station(chart, point.x))
            slope = float(point.tangent[-1] / chart.scale(point.x)[-1])
            for crossing in path.crossings:
                if crossing.index == i and crossing.name not in ENDINGS and not is_flat(path, crossing):
                    event = confirmed(crossing.name, slope, found[-1].cycle.nontrivial, changes)
                    found[-1].events += [event] if event else []
                elif crossing.index == i and crossing.name in ENDINGS:
                    found[-1].end = crossing.name
        return found

    def _station(self, chart: Chart, x: Array) -> _Station:
        return _Station(float(x[-1]), make_cycle(chart.closed(x)))

    # -- ends ---------------------------------------------------------------------------------------------------------

    def _end(self, path: Path, stations: list[_Station]) -> str:
        """Why the branch ends here; empty if it does not."""
        broken = next((i for i, s in enumerate(stations) if not s.cycle.trajectory.certificate.ok), None)
        if broken is not None:
            verdict = stations[broken].cycle.trajectory.certificate.verdict
            del stations[broken:]
            return f"the next cycle is {verdict}"
        if stations and stations[-1].end:
            return self._named_end(stations)
        if path.ended == INTERRUPTED:
            return INTERRUPTED
        if len(stations) >= self.steps.most:
            return f"the limit of {self.steps.most} points was reached"
        if self._came_back(stations, len(path.points)):
            return CLOSED
        return ""

    def _reached(self, value: float) -> str:
        """That a value is an end of the range, if it is one; right there the cycle may be degenerate."""
        end = min(self.span, key=lambda end: abs(end - value))
        near = abs(end - value) <= AT_END * (self.span[1] - self.span[0])
        return f"{self.parameter} = {end:g}, the end of the range" if near else ""

    def _named_end(self, stations: list[_Station]) -> str:
        last = stations[-1]
        if last.end in ("low", "high"):
            return self._reached(self.span[last.end == "high"])
        if last.end == "period":
            return f"the period grows without bound, it is {last.cycle.period:.6g}"
        if last.end == "growth":
            size = self._amplitude(last.cycle)
            return f"the cycle grows without bound, to {size:.3g} times the state at the start of the branch"
        if last.end == "halving":
            return self._halved(stations)
        smooth = len(last.cycle.phases) == 1
        last.limit = _vanishing(stations, self._amplitude, 2 if smooth else 1)
        last.centre = np.mean(last.cycle.closed.samples(64), axis=0)
        born = shrinks_to(last.cycle.closed, self.parameter, last.limit) if smooth else None
        if born is not None:
            last.limit, last.centre = born
        kind = "Hopf" if smooth else "boundary equilibrium"
        last.events.append((kind, "the cycle shrinks to an equilibrium"))
        return f"{kind} at {self.parameter} = {last.limit:.12g}: the cycle shrinks to an equilibrium"

    def _halved(self, stations: list[_Station]) -> str:
        """The cycle becomes one of half its period, which doubles its period there."""
        last = stations[-1]
        near = _vanishing(stations, lambda cycle: half_gap(cycle.closed), 2)

        def at(closed: Closed, value: float) -> Closed:
            return find_cycle(self.cycle.system, make_cycle(closed), {self.parameter: value}).closed

        found = doubles_at(part_of(last.cycle.closed, 2), last.value, near, at)
        last.limit = near if found is None else found
        last.events.append(("period doubling", "the cycle becomes one of half its period"))
        return f"period doubling at {self.parameter} = {last.limit:.12g}: the cycle becomes one of half its period"

    def _amplitude(self, cycle: Cycle) -> float:
        ranges = np.array([high - low for low, high in cycle.extrema.values()])
        return float(np.max(ranges / self.extent.modulus))

    def _came_back(self, stations: list[_Station], new: int) -> bool:
        """Whether one of the last steps has passed the start of the branch."""
        if len(stations) < 2 * IN_CHART:
            return False
        start = self._features(_Station(self.cycle.parameters[self.parameter], self.cycle))
        places = [self._features(s) for s in stations[-new:]]
        for a, b in itertools.pairwise(places):
            chord, offset = b - a, start - a
            part = offset @ chord / (chord @ chord + 1e-300)
            if 0.0 < part <= 1.0 and np.linalg.norm(offset - part * chord) < 0.05 * np.linalg.norm(chord):
                return True
        return False

    def _features(self, s: _Station) -> Array:
        """Numbers that tell cycles of a branch apart."""
        ranges = [
            (high - low) / m for (low, high), m in zip(s.cycle.extrema.values(), self.extent.modulus, strict=True)
        ]
        return np.array([s.value / (self.span[1] - self.span[0]), np.log(s.cycle.period), *ranges])

    # -- results ------------------------------------------------------------------------------------------------------

    def branch(self, back: tuple[list[_Station], str], forth: tuple[list[_Station], str]) -> Branch:
        """The two directions as one branch, from the far end of the first to that of the second."""
        start = _Station(self.cycle.parameters[self.parameter], self.cycle)
        stations = [*reversed(back[0]), start, *forth[0]]
        special = [self._special(s, i, kind, note) for i, s in enumerate(stations) for kind, note in s.events]
        points = dataset(self.parameter, [s.value for s in stations], [s.cycle for s in stations])
        ended = f"first point: {back[1]}; last point: {forth[1]}"
        return Branch(self.cycle.system, dict(self.cycle.parameters), self.parameter, points, special, ended)

    def _special(self, station: _Station, index: int, kind: str, note: str) -> SpecialPoint:
        cycle, value = station.cycle, station.value if station.limit is None else station.limit
        field, state = cycle.closed.shooting.stations[0].piece.field, cycle.state
        if station.centre is not None:
            state = dict(zip(state, map(float, station.centre), strict=True))
        parameters = {**cycle.parameters, self.parameter: value}
        data = {"time": cycle.time} if cycle.closed.shooting.symmetry.driven else {}
        return SpecialPoint(kind, value, state, parameters, field.mode, field.region, index, cycle.period, data, note)


def _vanishing(stations: list[_Station], size: Callable[[Cycle], float], power: int) -> float:
    """Value of the parameter at which a size of cycles is 0; a power of it is linear in the parameter."""
    if len(stations) < 2:
        return stations[-1].value
    (p, a), (q, b) = ((s.value, size(s.cycle) ** power) for s in stations[-2:])
    return q - b * (q - p) / (b - a)
