"""Dissipation potentials at many phases, and on intervals of phases, as rows of arrays."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array

if TYPE_CHECKING:
    from stickslip.rate_independent.sets.potential import Dissipation

Index = NDArray[Any]


@dataclass(frozen=True, eq=False)
class RowWise:
    """A dataclass of arrays, or of other rows, that have one row for each phase or interval."""

    def taken(self, index: Index) -> Self:
        """Some of the rows."""
        return replace(self, **{name: _taken(value, index) for name, value in self._rows().items()})

    def joined(self, more: Any) -> Self:
        """These rows and more of the same kind."""
        theirs = more._rows()
        return replace(
            self, **{name: _joined(value, theirs[name]) for name, value in self._rows().items()}
        )

    def _rows(self) -> dict[str, Any]:
        values = ((name, getattr(self, name)) for name in _names(type(self)))
        return {
            name: value for name, value in values if isinstance(value, (RowWise, np.ndarray, tuple))
        }


@cache
def _names(kind: type[RowWise]) -> tuple[str, ...]:
    return tuple(item.name for item in fields(kind))


def _taken(value: Any, index: Index) -> Any:
    if isinstance(value, tuple):
        return tuple(part.taken(index) for part in value)
    return value.taken(index) if isinstance(value, RowWise) else value[index]


def _joined(one: Any, other: Any) -> Any:
    if isinstance(one, tuple):
        return tuple(a.joined(b) for a, b in zip(one, other, strict=True))
    return one.joined(other) if isinstance(one, RowWise) else np.concatenate([one, other])


class AtPhases(ABC):
    """A dissipation potential at m phases. Arguments are single vectors, shape (n,), or one for
    each phase, (m, n)."""

    @abstractmethod
    def support(self, v: Array) -> Array:
        """Ψ(s, v) at each phase, shape (m,)."""

    @abstractmethod
    def excess(self, xi: Array) -> Array:
        """Excess of ξ over K(s) at each phase, shape (m,): at least its signed distance."""

    @abstractmethod
    def nearest(self, xi: Array) -> Array:
        """The point of K(s) nearest to ξ at each phase, shape (m, n)."""


S = TypeVar("S", bound=AtPhases)


class PhaseIntervals(ABC, Generic[S]):
    """A dissipation potential on m phase intervals: bounds that hold at every phase of an interval.

    Attributes
    ----------
    start, end : Sampled
        The potential at the ends of the intervals.
    """

    start: S
    end: S

    @abstractmethod
    def between(
        self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array
    ) -> Array:
        """Bound of the excess of a force over K(s) on a phase interval, shape (m,).

        Parameters
        ----------
        ends : ndarray of shape (m,)
            The larger of the excesses at both ends.
        before, after : ndarray of shape (m, n)
            The force at the ends.
        off : ndarray of shape (m, n)
            Bounds of the deviation of its components from straight lines in between.
        enough : float or ndarray of shape (m,)
            Below this, no sharper bound is needed.
        """

    def outside(
        self, before: Array, after: Array, off: Array, enough: float | Array
    ) -> tuple[Array, Array, Array]:
        """Excess of a force over K(s) at the start and the end of each interval, and its upper
        bound in between."""
        first, last = self.start.excess(before), self.end.excess(after)
        return first, last, self.between(np.maximum(first, last), before, after, off, enough)


class Near(NamedTuple):
    """Phase intervals on which a force is proved to lie outside K(s) by no more than a bound;
    all of shape (k,)."""

    low: Array
    high: Array
    bound: Array

    def at_most(self, low: Array, high: Array) -> Array:
        """Upper bound of the excess of the force on given intervals, shape (m,); infinite without a
        proof."""
        inside = (self.low <= low[:, None]) & (high[:, None] <= self.high)
        return np.where(inside, self.bound, np.inf).min(axis=1, initial=np.inf)


NOWHERE_NEAR = Near(*np.zeros((3, 0)))


@dataclass(frozen=True, eq=False)
class OneByOne(RowWise, AtPhases):
    """A potential evaluated phase by phase."""

    potential: Dissipation
    phases: Array

    def support(self, v: Array) -> Array:
        return np.array([self.potential.support(row, s) for row, s in self._rows_of(v)])

    def excess(self, xi: Array) -> Array:
        return np.array([self.potential.excess(row, s) for row, s in self._rows_of(xi)])

    def nearest(self, xi: Array) -> Array:
        rows = [self.potential.project(row, s) for row, s in self._rows_of(xi)]
        return np.array(rows).reshape(len(rows), self.potential.dimension)

    def _rows_of(self, x: Array) -> zip[tuple[Array, float]]:
        return zip(
            np.broadcast_to(x, (len(self.phases), x.shape[-1])), self.phases.tolist(), strict=True
        )


@dataclass(frozen=True, eq=False)
class Estimated(RowWise, PhaseIntervals[OneByOne]):
    """Phase intervals of a potential that can only be evaluated pointwise: estimates from their
    midpoints."""

    start: OneByOne
    end: OneByOne
    middle: OneByOne

    def between(
        self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array
    ) -> Array:
        # Twice the deviation in the middle from the line between the ends: a parabola, or a kink
        # anywhere.
        first, last = self.start.excess(before), self.end.excess(after)
        bent = np.abs(2.0 * self.middle.excess(0.5 * (before + after)) - first - last)
        return ends + bent + lengths(off)


@dataclass(frozen=True, eq=False)
class Fixed(RowWise, PhaseIntervals[OneByOne]):
    """Phase intervals of a potential that does not depend on the phase: the distance of an affine
    force from K is convex."""

    start: OneByOne
    end: OneByOne

    def between(
        self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array
    ) -> Array:
        return ends + lengths(off)


def lengths(rows: Array) -> Array:
    """Euclidean length of every row."""
    return np.sqrt(np.einsum("...i,...i->...", rows, rows))
