"""Curves F(x) = 0 of one dimension, followed by pseudo-arclength: predictor, corrector, step control, special points.

Nothing here knows what x is: equilibria, cycles and the curves of their special points in two parameters are all
followed by :func:`trace`. Lengths are measured in units that the caller gives for every component of x, so that a
step means the same for a force, a temperature and a parameter.

References
----------
Y. A. Kuznetsov, *Elements of Applied Bifurcation Theory*, chapter 10; E. L. Allgower and K. Georg, *Numerical
Continuation Methods*, chapters 2 and 6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from stickslip.errors import StickslipError

Array = np.ndarray
Equations = Callable[[Array], tuple[Array, Array]]
Tests = Callable[[Array, Array], Mapping[str, float]]

BRIDGE = 1e-2  # part of the first step over which the orientation of the curve may change
UNDEFINED = (ArithmeticError, StickslipError, np.linalg.LinAlgError)
"""What the equations may raise where they are not defined; the step is then shortened."""


@dataclass(frozen=True)
class Steps:
    """Control of the step.

    Attributes
    ----------
    first, smallest, largest : float
        Lengths of steps, in the caller's units.
    tolerance : float
        Length of the last Newton correction.
    turn : float
        Largest angle between the tangents at the ends of a step, in radians.
    most : int
        Largest number of points.
    """

    first: float = 0.01
    smallest: float = 1e-9
    largest: float = 0.05
    tolerance: float = 1e-10
    turn: float = 0.2
    most: int = 5000


@dataclass(frozen=True)
class Point:
    """A point of the curve.

    Attributes
    ----------
    x : array, shape (n + 1,)
    tangent : array, shape (n + 1,)
        Direction of travel dx/ds.
    length : float
        Arclength from the start.
    tests : mapping of str to float
        Values of the test functions.
    orientation : float
        Sign of the determinant of [∂F/∂x; tangent]: the same all along a regular curve.
    """

    x: Array
    tangent: Array
    length: float
    tests: Mapping[str, float]
    orientation: float


@dataclass(frozen=True)
class Crossing:
    """A zero of a test function: its name, and the number of the point of the path at which it is."""

    name: str
    index: int


@dataclass(frozen=True)
class Path:
    """A curve as far as it was followed.

    Attributes
    ----------
    points : list of Point
        Zeros of test functions among them.
    crossings : list of Crossing
        In the order of travel.
    ended : str
        Why it was not followed further: the name of an ending, or a reason in words.
    """

    points: list[Point]
    crossings: list[Crossing] = field(default_factory=list)
    ended: str = ""


class Lost(Exception):
    """The corrector does not converge; the message says why."""


def correct(equations: Equations, guess: Array, scale: Array, tangent: Array, tolerance: float) -> Array:
    """Newton's method on F(x) = 0 and ⟨tangent, (x − guess)/scale⟩ = 0."""
    x, last = guess, np.inf
    for _ in range(12):
        try:
            F, J = equations(x)
            matrix, right = np.vstack([J * scale, tangent]), np.append(F, tangent @ ((x - guess) / scale))
            dz = np.linalg.solve(matrix, right)
        except UNDEFINED as problem:
            raise Lost(str(problem)) from None
        size = float(np.linalg.norm(dz))
        if not size <= 2.0 * last:
            break
        x, last = x - scale * dz, size
        if size <= tolerance:
            return x
    raise Lost("Newton's method does not converge")


def direction(equations: Equations, x: Array, scale: Array, towards: Array) -> tuple[Array, float]:
    """Unit tangent (in scaled components) that has a positive product with a direction, and the orientation."""
    _, J = equations(x)
    rows = J * scale
    rows = rows / np.maximum(np.max(np.abs(rows), axis=1, keepdims=True), 1e-300)
    tangent = np.linalg.svd(rows)[2][-1]
    tangent = tangent if tangent @ towards >= 0.0 else -tangent
    return tangent, float(np.linalg.slogdet(np.vstack([rows, tangent]))[0])


def trace(
    equations: Equations,
    start: Array,
    towards: Array,
    *,
    scale: Callable[[Array], Array],
    tests: Tests,
    endings: Mapping[str, str],
    steps: Steps | None = None,
    progress: Callable[[Point], None] | None = None,
) -> Path:
    """Follow the curve through a point in one direction until it ends.

    Parameters
    ----------
    equations : function
        x ↦ (F, ∂F/∂x), shapes (n,) and (n, n + 1). May raise any of :data:`UNDEFINED` where F is not defined.
    start : array, shape (n + 1,)
        A solution, up to a few Newton steps.
    towards : array, shape (n + 1,)
        The curve is followed in the direction that has a positive product with it.
    scale : function
        x ↦ the units of its components there.
    tests : function
        (x, tangent) ↦ values by name; their zeros are found. A value that is NaN is not defined there.
    endings : mapping of str to str
        Names of test functions that are positive on the curve and end it where they vanish, with the reason.
    steps : Steps, optional
    progress : function, optional
        Called with each new point.

    Returns
    -------
    Path
        Always; what was computed is kept, whatever ended it.

    Raises
    ------
    StickslipError
        If no solution is found near `start`.
    """
    steps = steps or Steps()
    tracer = _Tracer(equations, scale, tests, endings, steps)
    units = scale(start)
    try:
        towards = np.asarray(towards, dtype=float) / units
        tangent, _ = direction(equations, start, units, towards)
        x = correct(equations, start, units, tangent, steps.tolerance)
        tangent, orientation = direction(equations, x, scale(x), towards)
    except (Lost, *UNDEFINED) as problem:
        raise StickslipError(f"there is no solution near the start of the curve ({problem})") from None
    path = Path([tracer.point(x, tangent, orientation, 0.0)])
    ended, step = "", steps.first
    try:
        while not ended:
            ended, step = tracer.advance(path, step)
            if progress is not None:
                progress(path.points[-1])
    except KeyboardInterrupt:
        ended = "interrupted"
    return Path(path.points, path.crossings, ended)


class _Tracer:
    def __init__(
        self,
        equations: Equations,
        scale: Callable[[Array], Array],
        tests: Tests,
        endings: Mapping[str, str],
        steps: Steps,
    ) -> None:
        self.equations, self.scale, self.tests = equations, scale, tests
        self.endings, self.steps = endings, steps

    def point(self, x: Array, tangent: Array, orientation: float, length: float) -> Point:
        """A point with its test functions; `tangent` in scaled components."""
        tangent = tangent * self.scale(x)
        return Point(x, tangent, length, dict(self.tests(x, tangent)), orientation)

    def step(self, last: Point, along: float) -> Point:
        """The point at a distance along the tangent."""
        units = self.scale(last.x)
        tangent = last.tangent / units
        tangent /= np.linalg.norm(tangent)
        x = correct(self.equations, last.x + units * tangent * along, units, tangent, self.steps.tolerance)
        there = self.scale(x)
        return self.point(x, *direction(self.equations, x, there, last.tangent / there), last.length + along)

    def advance(self, path: Path, step: float) -> tuple[str, float]:
        """Take one step; returns the reason for the end, or an empty text, and the next step."""
        last, failure = path.points[-1], ""
        while True:
            if step < self.steps.smallest:
                return failure or "the step became too small", step
            try:
                new = self.step(last, step)
                angle = self._angle(last, new)
                # The orientation changes where another branch crosses; with a short step it is that, and no jump over
                # a gap between two curves.
                jumped = new.orientation != last.orientation and step > BRIDGE * self.steps.first
                if angle <= self.steps.turn and not jumped:
                    break
                failure = "the curve turns too sharply"
            except (Lost, *UNDEFINED) as problem:
                failure = f"no solution was found further on ({problem})"
            step *= 0.5
        for name, point in self._crossings(last, new):
            if point is not path.points[-1]:
                path.points.append(point)
            path.crossings.append(Crossing(name, len(path.points) - 1))
            if name in self.endings:
                return self.endings[name], step
        if path.points[-1] is new:
            return "", step
        path.points.append(new)
        if len(path.points) >= self.steps.most:
            return f"the limit of {self.steps.most} points was reached", step
        if self._closed(path, step):
            return "the curve is closed", step
        wider = min(2.0, 0.5 * self.steps.turn / max(angle, 1e-300))
        return "", min(step * max(wider, 0.5), self.steps.largest)

    def _angle(self, a: Point, b: Point) -> float:
        units = self.scale(b.x)
        first, second = a.tangent / units, b.tangent / units
        cosine = first @ second / (np.linalg.norm(first) * np.linalg.norm(second))
        return float(np.arccos(np.clip(cosine, -1.0, 1.0)))

    def _closed(self, path: Path, step: float) -> bool:
        """Whether the last step has passed the start."""
        if len(path.points) < 10:
            return False
        start, last, new = path.points[0], path.points[-2], path.points[-1]
        units = self.scale(new.x)
        offset = (start.x - last.x) / units
        chord = (new.x - last.x) / units
        part = offset @ chord / (chord @ chord)
        return bool(0.0 < part <= 1.0 and np.linalg.norm(offset - part * chord) < 0.1 * np.linalg.norm(chord))

    def _crossings(self, last: Point, new: Point) -> list[tuple[str, Point]]:
        """Zeros of the test functions within a step, in the order of travel."""
        found = []
        for name, b in new.tests.items():
            a = last.tests.get(name, np.nan)
            if name in self.endings:
                # What ends the curve is positive on it; it may start at zero, give or take rounding.
                if b < 0.0:
                    found.append((name, self._locate(name, last, new) if a > 0.0 else last))
            elif np.isfinite(a) and np.isfinite(b) and a != 0.0 and (b == 0.0 or (a < 0.0) != (b < 0.0)):
                found.append((name, self._locate(name, last, new)))
        return sorted(found, key=lambda crossing: crossing[1].length)

    def _locate(self, name: str, last: Point, new: Point) -> Point:
        """The point of a step at which a test function vanishes."""
        from scipy.optimize import brentq

        best = {last.length: last, new.length: new}

        def value(along: float) -> float:
            length = last.length + along
            if length not in best:
                point = self.step(last, along)
                if self._angle(last, point) > self.steps.turn:
                    raise Lost("the curve turns too sharply")
                best[length] = point
            return best[length].tests[name]

        distance = new.length - last.length
        if new.tests[name] == 0.0:
            return new
        try:
            brentq(value, 0.0, distance, xtol=1e-15, maxiter=60)
        except (Lost, RuntimeError, ValueError, *UNDEFINED):
            pass  # the nearest point found so far is the answer
        return min(best.values(), key=lambda point: abs(point.tests[name]))
