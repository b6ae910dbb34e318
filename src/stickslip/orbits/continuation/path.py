"""The interface of a curve: its points, its ends and their reasons, and its step control."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

from stickslip.arguments import check_fields
from stickslip.arrays import Array
from stickslip.certificates import Residual
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property

Test = str | int
"""A test function: of special points by a name, of guards by their number."""
Tests = Callable[[Array, Array], Mapping[Test, float]]


class Stop(Enum):
    """Reasons for the end of a curve."""

    RANGE = "end of the range"
    EVENT = "something happens"
    CLOSED = "closed"
    LIMIT = "limit on points"
    LOST = "lost"
    INTERRUPTED = "interrupted"
    TIME_UP = "time limit"


class Ending(NamedTuple):
    """The end of a curve: its reason, and the test function that vanishes there, if any."""

    stop: Stop
    text: str
    test: Test | None = None


INTERRUPTED = Ending(Stop.INTERRUPTED, "interrupted")
TIME_UP = Ending(Stop.TIME_UP, "the time limit was reached")
BROKEN_OFF = (Stop.INTERRUPTED, Stop.TIME_UP)
"""The ending of a curve that continues."""


class Limit(NamedTuple):
    """A bound of a component of x: its value, and its side (+1: upper bound, −1: lower bound)."""

    component: int
    value: float
    side: float

    def room(self, x: Array) -> float:
        """Distance of a point from the limit; negative beyond."""
        return self.side * (self.value - float(x[self.component]))


def ranges(spans: Mapping[str, tuple[float, float]]) -> dict[str, Limit]:
    """The limits of the last components of x, which are parameters with these ranges, by the text
    of the ending."""
    first = -len(spans)
    return {
        f"{name} = {end:g}, the end of the range": Limit(first + i, end, side)
        for i, (name, span) in enumerate(spans.items())
        for side, end in zip((-1.0, 1.0), span, strict=True)
    }


def in_range(limits: Mapping[str, Limit], points: Sequence[Array]) -> Residual:
    """Violation of limits by some points; negative inside."""
    beyond = max((-limit.room(x) for limit in limits.values() for x in points), default=0.0)
    return Residual("beyond the range", max(beyond, 0.0), 0.0)


@dataclass(frozen=True)
class StepControl:
    """Control of the step.

    Attributes
    ----------
    first, smallest, largest : float
        Lengths of steps along the curve, in scaled units: the states relative to their size, the
        parameter relative to its range (a quarter of it for cycles).
    tolerance : float
        Largest last Newton correction of a point, in the same units; since Newton's method
        converges quadratically, the error is usually much smaller.
    rounding : float
        Corrections shorter than this are not applied.
    left : float
        Admissible residual of the equations, if further corrections reduce it.
    turn : float
        Largest angle between the tangents at the ends of a step, in radians.
    most : int
        Maximum number of points.
    """

    first: float = 0.01
    smallest: float = 1e-9
    largest: float = 0.05
    tolerance: float = 1e-10
    turn: float = 0.2
    most: int = 5000
    rounding: float = 0.0
    left: float = math.inf

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("first", "smallest", "largest", "tolerance", "turn", "most"):
            if not 0.0 < getattr(self, name) < math.inf:
                reason = f"{getattr(self, name)} is not a positive, finite number"
                raise DeclarationError(f"steps.{name}", reason, "Give a positive number")
        if self.smallest > self.largest:
            reason = f"the smallest step, {self.smallest}, exceeds the largest, {self.largest}"
            raise DeclarationError("steps.smallest", reason, "Reduce it")


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
    tests : mapping of str or int to float
        Values of the test functions.
    orientation : float
        Sign of the determinant of [∂F/∂x; tangent]: the same all along a regular curve.
    units : array, shape (n + 1,)
        Of the unknowns there.
    """

    x: Array
    tangent: Array
    length: float
    tests: Mapping[Test, float]
    orientation: float
    units: Array

    @cached_property
    def heading(self) -> Array:
        """The direction of travel in units of the unknowns, of length 1."""
        scaled = self.tangent / self.units
        return scaled / math.sqrt(scaled @ scaled)


@dataclass(frozen=True)
class Break:
    """A point at which a curve passes from the solutions of one smooth problem to those of another.

    Attributes
    ----------
    x, before, beyond : array, shape (n + 1,)
        Unknowns at the break and on both sides, where test functions are evaluated.
    what : object
        Description by the caller.
    """

    x: Array
    before: Array
    beyond: Array
    what: Any


@dataclass(frozen=True)
class Crossing:
    """A zero of a test function.

    Attributes
    ----------
    name : str or int
        Which.
    index : int
        Number of the point of the path at which it is.
    sides : (float, float), optional
        Its values on both sides of a break at which it jumps from one sign to the other.
    """

    name: Test
    index: int
    sides: tuple[float, float] | None = None


@dataclass(frozen=True)
class Path:
    """The computed part of a curve.

    Attributes
    ----------
    points : list of Point
        Zeros of test functions among them.
    crossings : list of Crossing
        In the order of travel.
    ended : Ending
        Why it was not followed further.
    breaks : dict of int to Break
        By the number of the point.
    """

    points: list[Point]
    crossings: list[Crossing] = field(default_factory=list)
    ended: Ending = INTERRUPTED
    breaks: dict[int, Break] = field(default_factory=dict)

    @property
    def located(self) -> set[int]:
        """Numbers of the points that were located as zeros of test functions or limits."""
        return {crossing.index for crossing in self.crossings} | self.breaks.keys()
