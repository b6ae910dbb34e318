"""Curves in two parameters along which a cycle begins to stick.

The unknowns are those of a cycle with one free parameter, and the other parameter; the additional
equation is that the margin of the onset vanishes. The curve is regular also at unstable cycles and
folds.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.model.system import System
from stickslip.motion.problem import pose
from stickslip.orbits.branches.chart import (
    WIDTH,
    Chart,
    OutOfChart,
    extent_of,
    first_chart,
    renewed,
)
from stickslip.orbits.branches.cycles_along import Spacing, dataset, of_branch
from stickslip.orbits.branches.equilibrium_branch import checked_range
from stickslip.orbits.branches.onset import Onset, nearest_onset
from stickslip.orbits.continuation.branch import Branch, SpecialPoint
from stickslip.orbits.continuation.corrector import NOT_DEFINED
from stickslip.orbits.continuation.driver import (
    CurveProblem,
    Start,
    both_ways,
    follow_branch,
    in_pieces,
    joined,
    step_after,
)
from stickslip.orbits.continuation.path import Ending, Path, Point, StepControl, Stop, Test, ranges
from stickslip.orbits.cycles.cycle import Cycle, make_cycle
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.damped_newton import Closed, converge, near
from stickslip.orbits.return_map.following import follow_state
from stickslip.orbits.return_map.recurrence import Recurrence, window
from stickslip.orbits.return_map.shooting import Orbit, with_value

if TYPE_CHECKING:
    pass


_STEPS = StepControl(first=0.05, largest=0.4, tolerance=1e-10, turn=0.3)
_IN_CHART = 6  # number of points before the chart is renewed
_DIFFERENCE = 1e-7  # step of numerical derivatives, relative to the units of the unknowns
# margin of the cycles on the curve: closer to the onset, rounding errors determine the next mode
_SLIPPING = 1e-9
_AT_ONSET = 1e-3  # a cycle with a larger margin is not at the onset
_VANISHES = "the cycle shrinks to an equilibrium"
_LOST = "no further onset was found"


@validated
def stick_onset_curve(
    system: System,
    point: SpecialPoint,
    first: str,
    second: str,
    *,
    ranges: Mapping[str, tuple[float, float]],
    steps: StepControl | None = None,
) -> Branch:
    """Continue the onset of stick in two parameters.

    Parameters
    ----------
    system : System
    point : SpecialPoint
        Of kind ``"stick onset"``, from a branch of cycles.
    first, second : str
        The two parameters.
    ranges : mapping of str to (float, float)
        The range of each.
    steps : StepControl, optional

    Returns
    -------
    Branch
        Of cycles, with both parameters at every point.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    ConvergenceError
        If no cycle with an onset of stick is found at the point.
    """
    if not isinstance(point, SpecialPoint) or point.kind != "stick onset" or point.period is None:
        given = (
            f"a special point of kind '{point.kind}'"
            if isinstance(point, SpecialPoint)
            else repr(point)
        )
        raise DeclarationError(
            "point",
            f"expected a special point of kind 'stick onset', got {given}",
            "Use one of branch.special",
        )
    if first == second:
        raise DeclarationError(
            second, "the two parameters are the same", "Give two different parameters"
        )
    spans = {}
    for name in (first, second):
        if name not in ranges:
            raise DeclarationError(f"ranges.{name}", "the range is missing", "Give (low, high)")
        low, high = spans[name] = checked_range(system, name, ranges[name])
        if not low <= point.parameters[name] <= high:
            raise DeclarationError(
                f"ranges.{name}",
                f"the point lies at {name} = {point.parameters[name]:g}",
                "Choose a range that includes it",
            )
    closed = _cycle_at(system, point)
    onset = nearest_onset(closed.orbit.motion, closed.shooting.pieces)
    margin = np.inf
    if onset is not None:
        margin = onset.margin(closed.orbit.motion, closed.shooting.pieces)
    if onset is None or not abs(margin) < _AT_ONSET:
        raise ConvergenceError(
            f"the onset of stick of {system.name}",
            f"the distance of the cycle from the stick onset is {abs(margin):.2g} of its size",
            "Give a stick onset of a branch of this system",
        )
    return _Follower(closed, onset, spans, steps or _STEPS).branch()


def _cycle_at(system: System, point: SpecialPoint) -> Closed:
    """The cycle of a special point."""
    problem = pose(system, point.parameters)
    pieces = Pieces(problem.compiled.equations)
    y = problem.initial_state(point.state)
    t = point.data.get("time", system.span[0])
    assert point.period is not None
    motion = follow_state(problem, t, t + point.period, y)
    w = window(motion, pieces)
    turns = 1 if w.period is None else max(1, round(point.period / w.period))
    return converge(
        *near(
            problem,
            pieces,
            w,
            Recurrence(t, y, point.period, turns, motion.knots.state[-1] - y, 0.0),
        )
    )


@dataclass
class _Equations:
    """A cycle that is at its onset: x with the second parameter ↦ residual and derivative.

    Attributes
    ----------
    chart : Chart
        Of cycles, with the first parameter free.
    width : float
        Unit of the second parameter.
    upper : array, shape (2,)
        Upper ends of the ranges of the parameters.
    known, cycles : dict
        What was computed, by the unknowns.
    """

    chart: Chart
    onset: Onset
    second: str
    width: float
    upper: Array
    known: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)
    cycles: dict[bytes, Cycle] = field(default_factory=dict)

    def at(self, value: float) -> Chart:
        """The chart for a value of the second parameter."""
        shooting = self.chart.shooting
        return Chart(
            shooting.with_problem(with_value(shooting.problem, self.second, value)),
            self.chart.extent,
        )

    def orbit(self, z: Array) -> Orbit:
        """The cycle."""
        return self.at(float(z[-1])).orbit(z[:-1])

    def residual(self, z: Array) -> tuple[Array, Array]:
        """Residual, and the derivative of the equations of the cycle with respect to its
        unknowns."""
        orbit = self.orbit(z)
        margin = self.onset.margin(orbit.motion, self.chart.shooting.pieces)
        if not np.isfinite(margin):
            raise OutOfChart("no contact is about to stick")
        return np.append(orbit.F, margin - _SLIPPING), orbit.J

    def __call__(self, z: Array) -> tuple[Array, Array]:
        """Residual and derivative."""
        key = z.tobytes()
        if key not in self.known:
            F, own = self.residual(z)
            found = [self._difference(z, i, F, own) for i in range(len(z))]
            J = np.column_stack([change for change, _ in found])
            # Newton's method leads to the side that slips, where the derivatives of the cycle's
            # equations differ from those where it sticks.
            if F[-1] <= -_SLIPPING:
                own = next((there for _, there in found if there is not own), own)
            J[:-1, :-1] = own
            self.known[key] = F, J
        return self.known[key]

    def _difference(self, z: Array, i: int, F: Array, own: Array) -> tuple[Array, Array]:
        """Difference quotient with respect to an unknown, within the ranges of the parameters and,
        if possible, on the side that slips, with the derivative of the equations of the cycle
        there."""
        h = _DIFFERENCE * self.scale(z)[i]
        found = []
        for side in (h, -h):
            moved = z.copy()
            moved[i] += side
            if np.all(moved[-2:] <= self.upper):
                value, there = self.residual(moved)
                change = (value - F) / side
                if value[-1] > -_SLIPPING:
                    return change, there
                found.append(change)
        return found[0], own

    def scale(self, z: Array) -> Array:
        """Units of the unknowns."""
        return np.append(self.chart.scale(z[:-1]), self.width)


class _Follower:
    def __init__(
        self,
        closed: Closed,
        onset: Onset,
        spans: dict[str, tuple[float, float]],
        steps: StepControl,
    ) -> None:
        (self.first, span), (self.second, other) = spans.items()
        self.closed = closed
        self.onset = onset
        self.spans = spans
        self.steps = steps
        self.extent = extent_of(closed, self.first, span)
        self.width = WIDTH * (other[1] - other[0])
        self.upper = np.array([span[1], other[1]])
        self.pieces = Pieces(closed.orbit.problem.compiled.equations, self.first)
        self.spacing = Spacing(spans, self.extent.modulus)

    def branch(self) -> Branch:
        """Both ways from the start."""
        back, forth, (behind, ahead) = both_ways(self.follow, -1.0)
        if not back and not forth:
            raise ConvergenceError(
                f"onsets of stick of {self.closed.orbit.problem.system.name}", behind.text
            )
        cycles = joined(back, forth)
        problem = self.closed.orbit.problem
        steps = np.array([0.0, *(self.spacing(a, b) for a, b in itertools.pairwise(cycles))])
        return Branch(
            problem.system,
            dict(problem.parameters),
            self.first,
            lambda: dataset(self.spans, cycles, steps).assign_attrs(kind="stick onsets"),
            [],
            (behind, ahead),
            of_branch(cycles, self.spans, steps),
            self.second,
        )

    def follow(self, sign: float) -> tuple[list[Cycle], Ending]:
        """The cycles in one direction, including the start, and the end."""
        cycles: list[Cycle] = []

        def onward(start: Start[_Equations], path: Path) -> Start[_Equations] | Ending:
            return self._onward(cycles, start.of, path)

        try:
            chart, x = first_chart(self.closed, self.pieces, self.extent)
        except NOT_DEFINED as failure:
            return cycles, Ending(Stop.LOST, f"{_LOST} ({failure})")
        z = np.append(x, self.closed.orbit.problem.parameters[self.second])
        towards = np.zeros(len(z))
        towards[-1] = sign
        start = self._start(self._equations(chart), z, towards, self.steps.first)
        return cycles, follow_branch(start, onward, _LOST)

    def _onward(
        self, cycles: list[Cycle], equations: _Equations, path: Path
    ) -> Start[_Equations] | Ending:
        """Append the cycles found in a chart; return the next chart, or the end."""
        cycles += [self._cycle(equations, p.x) for p in path.points[1 if cycles else 0 :]]
        if path.ended.stop is not Stop.LIMIT or len(cycles) >= self.steps.most:
            return path.ended
        last = path.points[-1]
        there = equations.at(float(last.x[-1]))
        chart, x, carried = renewed(there, last.x[:-1], last.tangent[:-1])
        z, towards = np.append(x, last.x[-1]), np.append(carried, last.tangent[-1])
        return self._start(self._equations(chart), z, towards, step_after(path, self.steps))

    def _equations(self, chart: Chart) -> _Equations:
        return _Equations(chart, self.onset, self.second, self.width, self.upper)

    def _start(
        self, equations: _Equations, z: Array, towards: Array, step: float
    ) -> Start[_Equations]:
        """Some points in one chart."""

        def tests(z: Array, tangent: Array) -> dict[Test, float]:
            chart = equations.at(float(z[-1]))
            orbit = equations.orbit(z)
            chart.check(orbit)
            amplitude = self.extent.amplitude(Closed(chart.shooting, orbit))
            return {_VANISHES: amplitude / self.extent.least - 1.0}

        def accept(last: Point, new: Point) -> None:
            self.spacing.check(self._cycle(equations, last.x), self._cycle(equations, new.x))

        problem = CurveProblem(
            equations, equations.scale, tests, {_VANISHES: _VANISHES}, ranges(self.spans), accept
        )
        return Start(equations, problem, z, towards, in_pieces(self.steps, step, _IN_CHART))

    def _cycle(self, equations: _Equations, z: Array) -> Cycle:
        key = z.tobytes()
        if key not in equations.cycles:
            equations.cycles[key] = make_cycle(
                Closed(equations.at(float(z[-1])).shooting, equations.orbit(z))
            )
        return equations.cycles[key]
