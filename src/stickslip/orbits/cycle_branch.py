"""Branches of cycles over a parameter: folds, period doublings, tori, stick onset, grazing, changes of the sequence.

The curve is followed in charts: coordinates around one state of the cycle, in units of its size. After some points the
chart is made anew around the best state of the present cycle, and the direction of travel is carried over along the
motion. No equation knows the sequence of modes; it is read off the motion, and where it changes between two points
the change is located.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace

import numpy as np

from stickslip.errors import DeclarationError, StickslipError
from stickslip.orbits.birth import shrinks_to
from stickslip.orbits.branch import Branch, SpecialPoint
from stickslip.orbits.chart import Chart, chart_sizes, extent_of, renewed
from stickslip.orbits.closing import restarted
from stickslip.orbits.continuation import Path, Steps, trace
from stickslip.orbits.corner import corner_after
from stickslip.orbits.cycle_points import confirmed, dataset, locate_changes
from stickslip.orbits.cycles import Cycle, make_cycle
from stickslip.orbits.equilibrium_branch import checked_range
from stickslip.orbits.pieces import Pieces

Array = np.ndarray

STEPS = Steps(first=0.01, largest=0.25, tolerance=1e-8, turn=0.3)
IN_CHART = 8  # points before the chart is made anew
FULL = f"the limit of {IN_CHART + 1} points was reached"
PATIENCE = 64.0  # a step is shortened by this factor before the chart is made anew
ENDINGS = ("low", "high", "amplitude", "growth", "period")


@dataclass
class _Station:
    """A point of the branch and what happens there."""

    value: float
    cycle: Cycle
    events: list[tuple[str, str]] = field(default_factory=list)
    end: str = ""
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
        Both ways from the cycle, through folds and changes of the sequence. ``special`` has the kinds ``"fold"``,
        ``"period doubling"``, ``"torus"``, ``"branch point"``, ``"stick onset"`` (a contact begins to stick, or no
        longer does), ``"grazing"`` (a phase appears where a boundary is touched), ``"sequence change"``, ``"Hopf"`` and
        ``"boundary equilibrium"`` (the cycle shrinks to an equilibrium inside a mode or on its boundary).

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
    back, forth = follower.follow(-1.0), follower.follow(1.0)
    return follower.branch(back, forth)


class _Follower:
    def __init__(self, cycle: Cycle, parameter: str, span: tuple[float, float], steps: Steps) -> None:
        self.cycle, self.parameter, self.span, self.steps = cycle, parameter, span, steps
        closed = cycle.closed
        # A closed form is made for one set of parameters; here every motion has its own.
        self.problem = replace(closed.orbit.problem, exact=False)
        vars(self.problem)["compiled"] = closed.orbit.problem.compiled
        self.extent = extent_of(closed, span)
        self.pieces = Pieces(self.problem.compiled.equations, parameter)

    def first_chart(self) -> tuple[Chart, Array]:
        """The chart around the given cycle."""
        closed = self.cycle.closed
        shooting = closed.shooting.with_pieces(self.pieces, self.problem)
        new, x = restarted(
            shooting, shooting.orbit(np.append(closed.orbit.x, self.cycle.parameters[self.parameter])),
            len(shooting.stations), chart_sizes(closed, self.extent),
        )  # fmt: skip
        return Chart(new, self.extent), x

    def follow(self, sign: float) -> tuple[list[_Station], str]:
        """The points in one direction, without the start, and the reason for the end."""
        chart, x = self.first_chart()
        towards = np.zeros(len(x))
        towards[-1] = sign
        stations: list[_Station] = []
        step = self.steps.first
        while True:
            try:
                path = self._trace(chart, x, towards, step)
            except StickslipError as failure:
                return stations, f"no cycle was found further on ({failure})"
            stations += self._stations(chart, path)
            reason = self._end(path, stations)
            if reason:
                return stations, reason
            last, bent = path.points[-1], None
            if path.ended not in (FULL, *ENDINGS):
                bent = corner_after(chart, last, self._smallest(step))
            if bent is not None:
                stations.append(self._station(chart, bent.x))
                stations[-1].events.append((bent.kind, bent.note))
                if bent.onward is None:
                    return stations, f"the cycle is lost at a change of the sequence: {bent.kind}, {bent.note}"
                x, towards = bent.onward
                if towards[-1] * last.tangent[-1] < 0.0:
                    stations[-1].events.append(("fold", "not smooth: the sequence changes there"))
                stations.append(self._station(chart, x))
                chart, x, towards = renewed(chart, x, towards)
                step = self.steps.first
                continue
            if len(path.points) == 1 and step <= PATIENCE * self.steps.smallest:
                return stations, path.ended
            step = self._next_step(path, step)
            chart, x, towards = renewed(chart, last.x, last.tangent)

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
                if crossing.index == i and crossing.name not in ENDINGS:
                    event = confirmed(crossing.name, slope, found[-1].cycle.nontrivial, changes)
                    found[-1].events += [event] if event else []
                elif crossing.index == i:
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
        if path.ended == "interrupted":
            return path.ended
        if len(stations) >= self.steps.most:
            return f"the limit of {self.steps.most} points was reached"
        if self._came_back(stations, len(path.points)):
            return "the branch is closed"
        return ""

    def _named_end(self, stations: list[_Station]) -> str:
        last = stations[-1]
        if last.end in ("low", "high"):
            return f"{self.parameter} = {self.span[last.end == 'high']:g}, the end of the range"
        if last.end == "period":
            return f"the period grows without bound, it is {last.cycle.period:.6g}"
        if last.end == "growth":
            return f"the cycle grows without bound, its extent is {2.0 * self._amplitude(last.cycle):.3g} times that"
        smooth = len(last.cycle.phases) == 1
        last.value = self._vanishing(stations, 2 if smooth else 1)
        last.centre = np.mean(last.cycle.closed.samples(64), axis=0)
        born = shrinks_to(last.cycle.closed, self.parameter, last.value) if smooth else None
        if born is not None:
            last.value, last.centre = born
        kind = "Hopf" if smooth else "boundary equilibrium"
        last.events.append((kind, "the cycle shrinks to an equilibrium"))
        return f"{kind} at {self.parameter} = {last.value:.12g}: the cycle shrinks to an equilibrium"

    def _vanishing(self, stations: list[_Station], power: int) -> float:
        """Value of the parameter at which the amplitude is 0; a power of it is linear in the parameter."""
        if len(stations) < 2:
            return stations[-1].value
        (p, a), (q, b) = ((s.value, self._amplitude(s.cycle) ** power) for s in stations[-2:])
        return q - b * (q - p) / (b - a)

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
        cycle = station.cycle
        field = cycle.closed.shooting.stations[0].piece.field
        state = cycle.state
        if kind in ("Hopf", "boundary equilibrium") and station.centre is not None:
            state = dict(zip(state, map(float, station.centre), strict=True))
        parameters = {**cycle.parameters, self.parameter: station.value}
        return SpecialPoint(
            kind, station.value, state, parameters, field.mode, field.region, index, cycle.period, note=note
        )
