"""Curves F(x) = 0 of one dimension, followed by pseudo-arclength: predictor, corrector, step
control, special points.

The code is independent of the meaning of x: :func:`trace` follows equilibria, cycles and the curves
of their special points in two parameters. The caller supplies a unit for every component of x, so
that step lengths are comparable for forces, temperatures and parameters.

References
----------
Y. A. Kuznetsov, *Elements of Applied Bifurcation Theory*, chapter 10; E. L. Allgower and K. Georg,
*Numerical Continuation Methods*, chapters 2 and 6.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import StickslipError
from stickslip.numerics.ratios import ratio
from stickslip.orbits.continuation.bracket import zero_between
from stickslip.orbits.continuation.corrector import (
    NOT_DEFINED,
    FunctionAndJacobian,
    Lost,
    correct,
    correct_at,
    length_of,
)
from stickslip.orbits.continuation.path import (
    INTERRUPTED,
    TIME_UP,
    Break,
    Crossing,
    Ending,
    Limit,
    Path,
    Point,
    StepControl,
    Stop,
    Test,
    Tests,
)
from stickslip.stopping.scopes import TimeUp, check_stop

Accept = Callable[["Point", "Point"], None]
Breaks = Callable[["Point", "Point"], Sequence["Break"]]

_BRIDGE = 1e-4  # longest step over which the orientation of the curve may change
_RESOLVED = 100.0  # a step this much longer than the corrector's tolerance has a direction
# a test function this small, relative to its values at the ends of a step, is zero, …
_ZERO = 1e-13
# … and a larger one that does not decrease by the second factor in a few evaluations is a rounding
# error
_SMALL, _SHRINKS, _LOOKS = 1e-9, 0.1, 2
_SOLVES = 1e-11  # residual of the equations, relative to their derivatives, at which curves cross
# points that are nearer to each other, as a fraction of the step, are regarded as one
_SAME = 1e-12


_Happened = tuple[Test | Break, Point, tuple[float, float] | None]


class _Found(Exception):
    """A zero has been located to the attainable accuracy."""


class Outgrown(StickslipError):
    """The coordinates no longer suit the curve; it continues in others."""


def curve_between(a: Point, b: Point, scale: Array, tangent: Array, along: float) -> Array:
    """The curve through two points with their tangents (a cubic), where it is at a distance from
    the first one, measured along a direction; beyond them, too.

    Parameters
    ----------
    scale, tangent : array, shape (n,)
        Units of the unknowns, and the direction in these units.

    Returns
    -------
    array, shape (n,)
    """
    chord = b.x - a.x
    length = float(tangent @ (chord / scale))
    first, last = (point.tangent / (tangent @ (point.tangent / scale)) for point in (a, b))
    s = along / length
    bent = (1.0 - s) * (first * length - chord) - s * (last * length - chord)
    return a.x + s * chord + s * (1.0 - s) * bent


def direction(
    equations: FunctionAndJacobian, x: Array, scale: Array, towards: Array
) -> tuple[Array, float]:
    """Unit tangent (in scaled components) that has a positive product with a direction, and the
    orientation."""
    _, J = equations(x)
    matrix = np.empty((len(x), len(x)))
    rows = np.multiply(J, scale, out=matrix[:-1])
    rows[:] = ratio(rows, np.abs(rows).max(axis=1, keepdims=True))
    # Rows of equal size: the null vector is then accurate if equations have different units.
    tangent = np.linalg.svd(rows)[2][-1]
    tangent = tangent if tangent @ towards >= 0.0 else -tangent
    # The orientation is the sign of the determinant of the Jacobian bordered by the tangent.
    matrix[-1] = tangent
    return tangent, float(np.linalg.slogdet(matrix)[0])


def trace(
    equations: FunctionAndJacobian,
    start: Array,
    towards: Array,
    *,
    scale: Callable[[Array], Array],
    tests: Tests,
    endings: Mapping[Test, str],
    limits: Mapping[str, Limit] | None = None,
    accept: Accept | None = None,
    breaks: Breaks | None = None,
    steps: StepControl | None = None,
    progress: Callable[[Point], None] | None = None,
) -> Path:
    """Follow the curve through a point in one direction until it ends.

    Parameters
    ----------
    equations : function
        x ↦ (F, ∂F/∂x), shapes (n,) and (n, n + 1). May raise any of :data:`NOT_DEFINED` where F is
        not defined.
    start : array, shape (n + 1,)
        A solution, up to a few Newton steps.
    towards : array, shape (n + 1,)
        The curve is followed in the direction that has a positive product with it.
    scale : function
        x ↦ the units of its components there.
    tests : function
        (x, tangent) ↦ values by name; their zeros are found. A value that is NaN is not defined
        there.
    endings : mapping of str or int to str
        Test functions that are positive on the curve and end it where they vanish, with the reason
        in words.
    limits : mapping of str to Limit, optional
        Bounds of components, by the text of the ending. The curve stops exactly there; beyond, the
        equations are evaluated only by Newton's method and for differences.
    accept : function, optional
        (last, new) ↦ None; raises any of :data:`NOT_DEFINED` if the new point solves the equations
        and is still not on the curve.
    breaks : function, optional
        (last, new) ↦ the breaks between two points, in the order of travel. Zeros of test functions
        are searched on every smooth part separately.
    steps : StepControl, optional
    progress : function, optional
        Called with each point, the first one included, in the order of travel.

    Returns
    -------
    Path
        The points computed until the end, whatever its reason.

    Raises
    ------
    StickslipError
        If no solution is found near `start`.
    """
    steps = steps or StepControl()
    tracer = _Tracer(equations, scale, tests, endings, dict(limits or {}), accept, breaks, steps)
    units = scale(start)
    try:
        towards = np.asarray(towards, dtype=float) / units
        tangent, _ = direction(equations, start, units, towards)
        x = correct(equations, start, units, tangent, steps.tolerance)
        tangent, orientation = direction(equations, x, scale(x), towards)
    except (Lost, *NOT_DEFINED) as problem:
        raise StickslipError(
            f"no solution was found near the start of the curve ({problem})"
        ) from None
    path = Path([tracer.point(x, tangent, orientation, 0.0, scale(x))])
    ended = None
    step = steps.first
    told = 0
    try:
        while ended is None:
            check_stop()
            ended, step = tracer.advance(path, step)
            if progress is not None:
                for point in path.points[told:]:
                    progress(point)
                told = len(path.points)
    except KeyboardInterrupt:
        ended = INTERRUPTED
    except TimeUp:
        ended = TIME_UP
    return replace(path, ended=ended)


class _Tracer:
    def __init__(
        self,
        equations: FunctionAndJacobian,
        scale: Callable[[Array], Array],
        tests: Tests,
        endings: Mapping[Test, str],
        limits: dict[str, Limit],
        accept: Accept | None,
        breaks: Breaks | None,
        steps: StepControl,
    ) -> None:
        self.equations = equations
        self.scale = scale
        self.tests = tests
        self.endings = endings
        self.limits = limits
        self.accept = accept
        self.breaks = breaks
        self.steps = steps

    def point(
        self, x: Array, tangent: Array, orientation: float, length: float, units: Array
    ) -> Point:
        """A point with its test functions.

        Parameters
        ----------
        tangent : array
            In units of the unknowns.
        units : array
        """
        tangent = tangent * units
        return Point(x, tangent, length, dict(self.tests(x, tangent)), orientation, units)

    def step(
        self,
        last: Point,
        along: float,
        limit: Limit | None = None,
        near: tuple[Point, Point] | None = None,
    ) -> Point:
        """The point at a distance along the tangent, or at a limit. If two points near it are
        given, the guess is on the curve through them."""
        units, tangent = last.units, last.heading
        guess = last.x + units * tangent * along
        if limit is None:
            start = guess if near is None else self._bent(last, near, along)
            steps = self.steps
            x = correct(
                self.equations,
                guess,
                units,
                tangent,
                steps.tolerance,
                start,
                steps.rounding,
                steps.left,
            )
        else:
            x = correct_at(
                self.equations, guess, units, limit.component, limit.value, self.steps.tolerance
            )
            along = float(tangent @ ((x - last.x) / units))
        there = self.scale(x)
        found = direction(self.equations, x, there, last.tangent / there)
        return self.point(x, *found, last.length + along, there)

    def _bent(self, last: Point, near: tuple[Point, Point], along: float) -> Array:
        """A point of the curve through two points, if it is near the tangent and in the range."""
        units, tangent = last.units, last.heading
        straight = last.x + units * tangent * along
        offset = float(tangent @ ((near[0].x - last.x) / units))
        bent = curve_between(*near, units, tangent, along - offset)
        close = length_of((bent - straight) / units) <= self.steps.turn * along
        inside = all(limit.room(bent) >= 0.0 for limit in self.limits.values())
        return bent if close and inside else straight

    def advance(self, path: Path, step: float) -> tuple[Ending | None, float]:
        """Take one step; return the end, if it is reached, and the next step."""
        last = path.points[-1]
        failure = ""
        reached = self._left_at_once(last)
        if reached:
            return Ending(Stop.RANGE, reached), step
        while True:
            if step < self.steps.smallest:
                return Ending(Stop.LOST, failure or "the step became too small"), step
            try:
                new, reached = self._within(path, step)
                bend = self._bend(last, new)
                # The orientation changes where another branch crosses; with a short step it is
                # that, and no jump over a gap between two curves.
                jumped = new.orientation != last.orientation and step > _BRIDGE
                if bend <= self.steps.turn and not jumped:
                    if self.accept is not None:
                        self.accept(last, new)
                    happened = self._between(last, new)
                    break
                failure = "the curve turns too sharply"
            except Outgrown as problem:
                if len(path.points) > 1:
                    return Ending(Stop.LIMIT, str(problem)), step
                failure = f"no further solution was found ({problem})"
            except (Lost, *NOT_DEFINED) as problem:
                failure = f"no further solution was found ({problem})"
            step *= 0.5
        for name, point, sides in happened:
            if point is not path.points[-1]:
                path.points.append(point)
            here = len(path.points) - 1
            if isinstance(name, Break):
                path.breaks[here] = name
                continue
            path.crossings.append(Crossing(name, here, sides))
            if name in self.endings:
                return Ending(Stop.EVENT, self.endings[name], name), step
        if path.points[-1] is not new:
            path.points.append(new)
        if reached:
            return Ending(Stop.RANGE, reached), step
        if len(path.points) >= self.steps.most:
            return Ending(Stop.LIMIT, f"the limit of {self.steps.most} points was reached"), step
        if self._closed(path):
            return Ending(Stop.CLOSED, "the curve is closed"), step
        wider = min(2.0, ratio(0.5 * self.steps.turn, bend))
        return None, min(step * max(wider, 0.5), self.steps.largest)

    def _left_at_once(self, last: Point) -> str:
        """The limit at which a point is, and which the next step would cross."""
        for name, limit in self.limits.items():
            speed = limit.side * last.tangent[limit.component]
            if limit.room(last.x) <= 0.0 and speed > 0.0:
                return name
        return ""

    def _within(self, path: Path, step: float) -> tuple[Point, str]:
        """The next point, and the limit that the step reaches, if any; the step is then shortened
        to the limit."""
        last = path.points[-1]
        near = (last, path.points[-2]) if len(path.points) > 1 else None
        ahead = [
            (self._distance(limit, last.x, last.units * last.heading), name)
            for name, limit in self.limits.items()
        ]
        distance, name = min(ahead, default=(np.inf, ""))
        if distance <= step:
            return self._inside(self.step(last, distance, self.limits[name])), name
        new = self.step(last, step, near=near)
        beyond = [name for name, limit in self.limits.items() if limit.room(new.x) < 0.0]
        if beyond:
            limit = self.limits[beyond[0]]
            part = limit.room(last.x) / (limit.room(last.x) - limit.room(new.x))
            return self._inside(self.step(last, part * step, limit)), beyond[0]
        return new, ""

    @staticmethod
    def _distance(limit: Limit, x: Array, direction: Array) -> float:
        """Length along a direction up to a limit."""
        speed = limit.side * float(direction[limit.component])
        return limit.room(x) / speed if speed > 0.0 and limit.room(x) < np.inf * speed else np.inf

    def _inside(self, new: Point) -> Point:
        if any(limit.room(new.x) < 0.0 for limit in self.limits.values()):
            raise Lost("the curve leaves the range")
        return new

    def _bend(self, a: Point, b: Point) -> float:
        """Largest angle between the chord of a step and the tangents at its ends, and between
        these."""
        units = b.units
        chord = (b.x - a.x) / units
        first = a.tangent / units
        second = b.heading
        bend = _angle(first, second)
        # A chord that the corrector does not resolve has no direction.
        if length_of(chord) > _RESOLVED * self.steps.tolerance:
            bend = max(bend, _angle(first, chord), _angle(chord, second))
        return bend

    def _closed(self, path: Path) -> bool:
        """Return whether the last step has passed the start."""
        if len(path.points) < 10:
            return False
        start = path.points[0]
        last = path.points[-2]
        new = path.points[-1]
        offset = (start.x - last.x) / new.units
        chord = (new.x - last.x) / new.units
        part = offset @ chord / (chord @ chord)
        return bool(0.0 < part <= 1.0 and length_of(offset - part * chord) < 0.1 * length_of(chord))

    def _between(self, last: Point, new: Point) -> list[_Happened]:
        """Events within a step, in order along the curve: breaks, and on every smooth part between
        them zeros of the test functions; those that jump from one sign to the other at a break
        vanish there."""
        found: list[_Happened] = []
        start = last
        for gap in self.breaks(last, new) if self.breaks is not None else ():
            before, beyond = (self._aside(last, x) for x in (gap.before, gap.beyond))
            found += [(*crossing, None) for crossing in self._crossings(start, before)]
            there = replace(beyond, x=gap.x)
            found.append((gap, there, None))
            for name, b in beyond.tests.items():
                a = before.tests.get(name, np.nan)
                if name not in self.endings and a * b < 0.0:
                    found.append((name, there, (a, b)))
            start = beyond
        return [*found, *((*crossing, None) for crossing in self._crossings(start, new))]

    def _aside(self, last: Point, x: Array) -> Point:
        """A known point of the curve."""
        there = self.scale(x)
        along = float(last.heading @ ((x - last.x) / last.units))
        found = direction(self.equations, x, there, last.tangent / there)
        return self.point(x, *found, last.length + along, there)

    def _across(self, last: Point, new: Point, along: float) -> Point:
        """A point of the smooth curve through both ends of a step, where another curve crosses it:
        Newton's method does not converge there, and the derivatives have no single null vector.

        Raises
        ------
        Lost
            If it does not solve the equations.
        """
        x = self._bent(last, (last, new), along)
        units = self.scale(x)
        F, J = self.equations(x)
        if not length_of(F) <= _SOLVES * np.max(np.abs(J * units)):
            raise Lost("Newton's method does not converge")
        part = along / (new.length - last.length)
        tangent = (1.0 - part) * last.heading + part * new.heading
        return self.point(
            x, tangent / length_of(tangent), new.orientation, last.length + along, units
        )

    def _crossings(self, last: Point, new: Point) -> list[tuple[Test, Point]]:
        """Zeros of the test functions within a smooth part, in the order of travel."""
        found = []
        for name, b in new.tests.items():
            a = last.tests.get(name, np.nan)
            if name in self.endings:
                # The test function of an ending is positive on the curve; it may be zero at its
                # start, up to rounding errors.
                if b < 0.0:
                    found.append((name, self._locate(name, last, new) if a > 0.0 else last))
            elif (
                math.isfinite(a)
                and math.isfinite(b)
                and a != 0.0
                and (b == 0.0 or (a < 0.0) != (b < 0.0))
            ):
                found.append((name, self._locate(name, last, new)))
        return sorted(found, key=lambda crossing: crossing[1].length)

    def _locate(self, name: Test, last: Point, new: Point) -> Point:
        """The point of a step at which a test function vanishes, or jumps from one sign to the
        other."""
        distance = new.length - last.length
        known = {0.0: last, distance: new}
        ends = last.tests[name], new.tests[name]
        size = max(map(abs, ends))
        least = size
        stalled = 0

        def value(along: float) -> float:
            nonlocal least, stalled
            near, other = sorted(known, key=lambda place: abs(place - along))[:2]
            try:
                point = self.step(last, along, near=(known[near], known[other]))
                if self._bend(last, point) > self.steps.turn:
                    raise Lost("the curve turns too sharply")
            except Lost:
                point = self._across(last, new, along)
            known[along] = point
            found = point.tests[name]
            stalled = stalled + 1 if abs(found) > _SHRINKS * least else 0
            least = min(least, abs(found))
            if least <= _ZERO * size or (least <= _SMALL * size and stalled == _LOOKS):
                raise _Found
            return found

        # If it jumps, or is not a number in between, the nearest point is returned.
        with suppress(_Found):
            zero_between(value, 0.0, distance, *ends)
        finite = [point for point in known.values() if np.isfinite(point.tests[name])]
        found = min(finite, key=lambda point: abs(point.tests[name]))
        same = (p for p in (last, new) if abs(p.length - found.length) <= _SAME * distance)
        return next(same, found)


def _angle(u: Array, v: Array) -> float:
    cosine = ratio(float(u @ v), length_of(u) * length_of(v))
    return math.acos(min(max(cosine, -1.0), 1.0))
