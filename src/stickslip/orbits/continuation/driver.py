"""The driver of all branches: piece by piece, in both directions, for any kind of solution.

A branch of equilibria is followed mode by mode, one of cycles in coordinates about one of them that
are renewed every few points. Each such piece is a :class:`CurveProblem`, which
:func:`~stickslip.orbits.continuation.arclength.trace` follows: equations with their derivatives
(used by corrector and tangent), units, test functions, terminal conditions, and acceptance tests of
new points. The caller supplies the first piece (:class:`Start`), and a function that maps the path
on a piece to the start of the next piece, or to the reason why the branch ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Generic, TypeVar

from stickslip.arrays import Array
from stickslip.orbits.continuation.arclength import Accept, Breaks, trace
from stickslip.orbits.continuation.corrector import NOT_DEFINED, FunctionAndJacobian
from stickslip.orbits.continuation.path import (
    BROKEN_OFF,
    INTERRUPTED,
    TIME_UP,
    Ending,
    Limit,
    Path,
    Point,
    StepControl,
    Stop,
    Test,
    Tests,
)
from stickslip.progress import PATIENCE, watched
from stickslip.stopping.scopes import TimeUp

_T = TypeVar("_T")
_P = TypeVar("_P")

_WIDER = 1.5  # ratio of the first step of a segment to the last one before it


@dataclass(frozen=True)
class CurveProblem:
    """The problem of one piece of a curve; see
    :func:`stickslip.orbits.continuation.arclength.trace`.

    Attributes
    ----------
    accept, breaks : function, optional
    """

    equations: FunctionAndJacobian
    scale: Callable[[Array], Array]
    tests: Tests
    endings: Mapping[Test, str]
    limits: Mapping[str, Limit] = field(default_factory=dict)
    accept: Accept | None = None
    breaks: Breaks | None = None


@dataclass(frozen=True)
class Start(Generic[_T]):
    """Start of a piece of a branch.

    Attributes
    ----------
    of : object
        Label of the piece: a mode, or coordinates.
    x, towards : arrays, shape (n + 1,)
    """

    of: _T
    problem: CurveProblem
    x: Array
    towards: Array
    steps: StepControl


Onward = Callable[[Start[_T], Path], Start[_T] | Ending]
"""Keeps what was found on a stretch; says where the next one begins, or why there is none."""


@dataclass(frozen=True)
class PointOnTheWay:
    """A new point of a branch, not yet certified.

    Attributes
    ----------
    side : float
        In which direction from the start it was found, +1 or −1; the start itself is on both.
    values : dict of str to float
        Under the names that they have in the dataset of the branch, the parameter last.
    """

    side: float
    values: dict[str, float]


Tell = Callable[[PointOnTheWay], None]


@contextmanager
def told_of_points(listener: Tell | None, what: str) -> Iterator[Tell]:
    """The receiver of new points: the caller's function, or a progress bar."""
    if listener is not None:
        yield listener
        return
    count = 0
    with watched(what, patience=PATIENCE) as show:

        def tell(point: PointOnTheWay) -> None:
            nonlocal count
            count += 1
            *_, (name, value) = point.values.items()
            show(None, f"{count} points, {name} = {value:.6g}")

        yield tell


def named_points(tell: Tell, side: float, names: Sequence[str]) -> Callable[[object, Point], None]:
    """Progress callback for points whose unknowns have these names."""

    def found(_: object, point: Point) -> None:
        tell(PointOnTheWay(side, dict(zip(names, point.x.tolist(), strict=True))))

    return found


def follow_branch(
    start: Start[_T],
    onward: Onward[_T],
    lost: str,
    found: Callable[[_T, Point], None] | None = None,
) -> Ending:
    """Follow a curve in one direction until it ends; return the reason. Points stored by `onward`
    are kept whatever ends the curve.

    Parameters
    ----------
    onward : function
        May raise any of :data:`~stickslip.orbits.continuation.arclength.NOT_DEFINED`.
    lost : str
        Text of the ending in that case.
    found : function, optional
        Called with the label of the piece and each new point; the last point of a piece is the
        first of the next one.
    """
    try:
        while True:
            p = start.problem
            path = trace(
                p.equations,
                start.x,
                start.towards,
                scale=p.scale,
                tests=p.tests,
                endings=p.endings,
                limits=p.limits,
                accept=p.accept,
                breaks=p.breaks,
                steps=start.steps,
                progress=None if found is None else partial(found, start.of),
            )
            beyond = onward(start, path)
            if isinstance(beyond, Ending):
                return beyond
            start = beyond
    except KeyboardInterrupt:
        return INTERRUPTED
    except TimeUp:
        return TIME_UP
    except NOT_DEFINED as failure:
        return Ending(Stop.LOST, f"{lost} ({failure})")


def both_ways(
    side: Callable[[float], tuple[list[_P], Ending]], first: float
) -> tuple[list[_P], list[_P], tuple[Ending, Ending]]:
    """Follow a branch in both directions from its start.

    Parameters
    ----------
    side : function
        sign ↦ points in that direction, the start first, and the reason for the end.
    first : float
        Sign of the direction that is followed first; if the curve returns to the start, or is
        interrupted, the other direction is not followed.
    """
    one, end = side(first)
    if end.stop in (Stop.CLOSED, *BROKEN_OFF):
        other, other_end = [], end
    else:
        other, other_end = side(-first)
    if first < 0.0:
        return one, other, (end, other_end)
    return other, one, (other_end, end)


def joined(back: Sequence[_P], forth: Sequence[_P]) -> list[_P]:
    """All points of a branch, from the end in the backward direction to the end in the forward
    one."""
    return [*reversed(back), *(forth[1:] if back else forth)]


def step_after(path: Path, steps: StepControl) -> float:
    """Length of the first step of the next piece. Located zeros of test functions are ignored,
    since their steps are arbitrarily short."""
    located = path.located
    *others, last = path.points
    before = next(p for i, p in reversed([*enumerate(others)]) if i == 0 or i not in located)
    return min(_WIDER * (last.length - before.length), steps.largest)


def in_pieces(
    steps: StepControl, step: float, points: int, smallest: float | None = None
) -> StepControl:
    """Step control of a piece with a given number of points and first step."""
    least = steps.smallest if smallest is None else smallest
    return replace(steps, first=step, smallest=least, most=points + 1)
