"""Curves in two parameters along which a cycle just begins to stick.

Unknown are those of a cycle with one free parameter and the other parameter; one more equation says that the margin of
the onset vanishes. The cycle may be unstable or at a fold: the curve does not see it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.errors import ConvergenceError, DeclarationError, StickslipError
from stickslip.motion.problem import pose
from stickslip.orbits.branch import Branch, SpecialPoint
from stickslip.orbits.chart import WIDTH, Chart, OutOfChart, extent_of, first_chart, renewed
from stickslip.orbits.closing import Closed, converge, near
from stickslip.orbits.continuation import Path, Steps, trace
from stickslip.orbits.cycle_points import dataset
from stickslip.orbits.cycles import Cycle, make_cycle
from stickslip.orbits.equilibrium_branch import checked_range
from stickslip.orbits.onset import Onset, nearest_onset
from stickslip.orbits.pieces import Pieces
from stickslip.orbits.recurrence import Recurrence, window
from stickslip.orbits.shooting import Orbit, follow, with_value
from stickslip.system import System

if TYPE_CHECKING:
    import xarray

Array = np.ndarray

STEPS = Steps(first=0.05, largest=0.4, tolerance=1e-10, turn=0.3)
IN_CHART = 6  # points before the chart is made anew
DIFFERENCE = 1e-7  # of the unknowns, in their units, for derivatives
SLIPPING = 1e-9  # margin of the cycles on the curve: closer to the onset rounding decides on the next mode
AT_ONSET = 1e-3  # a cycle with a larger margin is not at the onset
ENDINGS = ("amplitude", "low 1", "high 1", "low 2", "high 2")


def stick_onset_curve(
    system: System,
    point: SpecialPoint,
    first: str,
    second: str,
    ranges: Mapping[str, tuple[float, float]],
    *,
    steps: Steps | None = None,
) -> Branch:
    """Follow the onset of stick while two parameters change.

    Parameters
    ----------
    system : System
    point : SpecialPoint
        Of kind ``"stick onset"``, from a branch of cycles.
    first, second : str
        The two parameters.
    ranges : mapping of str to (float, float)
        The range of each.
    steps : Steps, optional

    Returns
    -------
    Branch
        Of cycles, with both parameters at every point.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    ConvergenceError
        If no cycle that begins to stick is found at the point.
    """
    if not isinstance(point, SpecialPoint) or point.kind != "stick onset" or point.period is None:
        given = f"a special point of kind '{point.kind}'" if isinstance(point, SpecialPoint) else repr(point)
        raise DeclarationError("point", f"it is {given}", "Give a special point of kind 'stick onset'")
    if first == second:
        raise DeclarationError(second, "the two parameters are the same", "Name two")
    spans = {}
    for name in (first, second):
        if name not in ranges:
            raise DeclarationError(f"ranges.{name}", "it is missing", "Give (low, high)")
        low, high = spans[name] = checked_range(system, name, ranges[name])
        if not low <= point.parameters[name] <= high:
            raise DeclarationError(
                f"ranges.{name}", f"the point lies at {name} = {point.parameters[name]:g}", "Include it"
            )
    closed = _cycle_at(system, point)
    onset = nearest_onset(closed.orbit.motion, closed.shooting.pieces)
    margin = onset.margin(closed.orbit.motion, closed.shooting.pieces)
    if not abs(margin) < AT_ONSET:
        raise ConvergenceError(
            f"the onset of stick of {system.name}",
            f"the cycle at the point is {abs(margin):.2g} of its size away from it",
            "Give a stick onset of a branch of this system",
        )
    return _Follower(closed, onset, spans, steps or STEPS).branch()


def _cycle_at(system: System, point: SpecialPoint) -> Closed:
    """The cycle of a special point."""
    problem = pose(system, point.parameters)
    pieces = Pieces(problem.compiled.equations)
    y, t = problem.initial_state(point.state), point.data.get("time", system.span[0])
    assert point.period is not None
    motion = follow(problem, t, t + point.period, y)
    w = window(motion, pieces)
    turns = 1 if w.period is None else max(1, round(point.period / w.period))
    return converge(*near(problem, pieces, w, Recurrence(t, y, point.period, turns, motion.knots.state[-1] - y, 0.0)))


@dataclass
class _Equations:
    """A cycle that is at its onset: x with the second parameter ↦ residual and derivative.

    Attributes
    ----------
    chart : Chart
        Of cycles, with the first parameter free.
    onset : Onset
    second : str
    width : float
        Unit of the second parameter.
    known : dict
        What was computed, by the unknowns.
    """

    chart: Chart
    onset: Onset
    second: str
    width: float
    known: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)

    def at(self, value: float) -> Chart:
        """The chart for a value of the second parameter."""
        shooting = self.chart.shooting
        return Chart(shooting.with_problem(with_value(shooting.problem, self.second, value)), self.chart.extent)

    def orbit(self, z: Array) -> Orbit:
        """The cycle."""
        return self.at(float(z[-1])).orbit(z[:-1])

    def residual(self, z: Array) -> tuple[Array, Array]:
        """Residual, and the derivative of the equations of the cycle by its own unknowns."""
        orbit = self.orbit(z)
        margin = self.onset.margin(orbit.motion, self.chart.shooting.pieces)
        if not np.isfinite(margin):
            raise OutOfChart("no contact is about to stick")
        return np.append(orbit.F, margin - SLIPPING), orbit.J

    def __call__(self, z: Array) -> tuple[Array, Array]:
        """Residual and derivative."""
        key = z.tobytes()
        if key not in self.known:
            F, own = self.residual(z)
            steps, J = DIFFERENCE * self.scale(z), np.zeros((len(z) - 1, len(z)))
            for i, h in enumerate(steps):
                J[:, i] = (self.residual(z + h * np.eye(len(z))[i])[0] - F) / h
            J[:-1, :-1] = own
            self.known[key] = F, J
        return self.known[key]

    def scale(self, z: Array) -> Array:
        """Units of the unknowns."""
        return np.append(self.chart.scale(z[:-1]), self.width)


class _Follower:
    def __init__(self, closed: Closed, onset: Onset, spans: dict[str, tuple[float, float]], steps: Steps) -> None:
        (self.first, span), (self.second, other) = spans.items()
        self.closed, self.onset, self.spans, self.steps = closed, onset, spans, steps
        self.extent = extent_of(closed, span)
        self.width = WIDTH * (other[1] - other[0])
        self.pieces = Pieces(closed.orbit.problem.compiled.equations, self.first)

    def branch(self) -> Branch:
        """Both ways from the start."""
        back, behind = self.follow(-1.0)
        forth, ahead = self.follow(1.0)
        cycles = [*reversed(back), *forth[1:]]
        system, parameters = self.closed.orbit.problem.system, dict(self.closed.orbit.problem.parameters)
        points: xarray.Dataset = dataset(self.first, [c.parameters[self.first] for c in cycles], cycles)
        points[self.second] = "point", np.array([c.parameters[self.second] for c in cycles])
        points.attrs["kind"] = "stick onsets"
        return Branch(system, parameters, self.first, points, [], f"first point: {behind}; last point: {ahead}")

    def follow(self, sign: float) -> tuple[list[Cycle], str]:
        """The cycles in one direction, with the start, and the reason for the end."""
        chart, x = first_chart(self.closed, self.pieces, self.extent)
        z = np.append(x, self.closed.orbit.problem.parameters[self.second])
        towards, step, cycles = np.zeros(len(z)), self.steps.first, []
        towards[-1] = sign
        while True:
            equations = _Equations(chart, self.onset, self.second, self.width)
            try:
                path = self._trace(equations, z, towards, step)
            except StickslipError as failure:
                return cycles, f"no onset was found further on ({failure})"
            cycles += [self._cycle(equations, p.x) for p in path.points[1 if cycles else 0 :]]
            broken = next((i for i, c in enumerate(cycles) if not c.trajectory.certificate.ok), None)
            if broken is not None:
                return cycles[:broken], f"the next cycle is {cycles[broken].trajectory.certificate.verdict}"
            if path.ended in ENDINGS:
                return cycles, self._reason(path.ended)
            if len(path.points) == 1 or path.ended == "interrupted" or len(cycles) >= self.steps.most:
                return cycles, path.ended
            last = path.points[-1]
            step = min(1.5 * (last.length - path.points[-2].length), self.steps.largest)
            there = equations.at(float(last.x[-1]))
            chart, x, carried = renewed(there, last.x[:-1], last.tangent[:-1])
            z, towards = np.append(x, last.x[-1]), np.append(carried, last.tangent[-1])

    def _trace(self, equations: _Equations, z: Array, towards: Array, step: float) -> Path:
        steps = replace(self.steps, first=step, most=IN_CHART + 1)

        def tests(z: Array, tangent: Array) -> dict[str, float]:
            chart, orbit = equations.at(float(z[-1])), equations.orbit(z)
            chart.check(orbit)
            amplitude = self.extent.amplitude(Closed(chart.shooting, orbit))
            (low, high), (least, most) = self.spans.values()
            margins = (amplitude / self.extent.least - 1.0, z[-2] - low, high - z[-2], z[-1] - least, most - z[-1])
            return dict(zip(ENDINGS, map(float, margins), strict=True))

        return trace(
            equations,
            z,
            towards,
            scale=equations.scale,
            tests=tests,
            endings={name: name for name in ENDINGS},
            steps=steps,
        )

    def _cycle(self, equations: _Equations, z: Array) -> Cycle:
        return make_cycle(Closed(equations.at(float(z[-1])).shooting, equations.orbit(z)))

    def _reason(self, ended: str) -> str:
        if ended == "amplitude":
            return "the cycle shrinks to an equilibrium"
        side, which = ended.split()
        name, span = list(self.spans.items())[int(which) - 1]
        return f"{name} = {span[side == 'high']:g}, the end of the range"
