"""The sets of a formula: any convex R, by its gradients."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.convex.directions import Directions
from stickslip.convex.formula import ConvexFormula
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.numerics.levels import ROUNDED_SUM
from stickslip.rate_independent.averaging.semi_infinite import Intersection
from stickslip.rate_independent.sets.newton import Normal, NormalSearch
from stickslip.rate_independent.sets.phase_intervals import (
    OneByOne,
    PhaseIntervals,
    RowWise,
    lengths,
)
from stickslip.rate_independent.sets.potential import Dissipation
from stickslip.rate_independent.sets.projections import nearest_by_support
from stickslip.rate_independent.signals.signal import OF_PHASE, wrapped
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import slopes

_PHASE = OF_PHASE.name
_BOXES = 256  # number of boxes of directions in which deviations between phases are bounded
_TILTS = (1e-60, 1e-15, 1e-12, 1e-9)  # tilts of a direction in which the formula has no derivative
_COARSE = 1e-6  # accuracy of a distance from which the normal of K(s) is refined
_MOST_CUTS = 20
_MOST_BOXES = 4000  # largest number of boxes in the proof of the radius of a ball


class Nearby(NamedTuple):
    """The point of K(s) nearest to a force.

    Attributes
    ----------
    y : ndarray of shape (n,)
        The point: the force, or a gradient of Ψ(s, ·), or on kinks the result of
        :meth:`NormalSearch.on_face`.
    gauge : float
        Of the force; NaN if it was not needed.
    v : ndarray of shape (n,), optional
        Normal to K(s) at the boundary point on the ray through the force.
    """

    y: Array
    gauge: float
    v: Array | None


@dataclass(frozen=True, eq=False)
class FormulaSets(Dissipation):
    """The sets that the gradients of a formula fill.

    Parameters
    ----------
    convex : ConvexFormula
        In its components, and the phase if it depends on that.
    """

    convex: ConvexFormula

    @property
    def dimension(self) -> int:
        return self.convex.dimension

    @property
    def depends_on_phase(self) -> bool:
        return bool(self.convex.ranges)

    @property
    def doubt(self) -> str:
        return "" if self.convex.proved else f"dissipation {self.convex.evidence}"

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        v = self.vector(v, "v")
        size = float(np.abs(v).max())
        if size == 0.0:
            return 0.0
        value = size * float(self.convex.values(np.concatenate([v / size, self._others(s)]))[0])
        return max(value, 0.0)

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        v = self.vector(v, "v")
        if not v.any():
            return np.zeros(self.dimension)
        others = self._others(s)
        xi = self._search.at(v, others).gradient
        if np.isfinite(xi).all():
            return xi
        # At a kink of a root, a gradient nearby is in the subdifferential at v up to the tilt.
        way = np.random.default_rng(0).uniform(0.5, 1.0, self.dimension) * np.abs(v).max()
        for tilt in _TILTS:
            xi = self._search.at(v + tilt * way, others).gradient
            if np.isfinite(xi).all():
                return xi
        raise DeclarationError(
            "formula", f"it is not differentiable near v = {v}", "Rewrite the formula"
        )

    def hessian(self, v: ArrayLike, s: float = 0.0) -> Array:
        """Second derivatives of Ψ(s, ·) at v, shape (n, n); NaN on a kink, and for v = 0."""
        v = self.vector(v, "v")
        if not v.any():
            return np.full((self.dimension, self.dimension), np.nan)
        return self._search.at(v, self._others(s)).hessian

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The nearest point, exact to rounding where the kinks of the formula are those of choices
        and roots."""
        xi = self.vector(xi, "xi")
        M = self.metric(metric)
        return self._nearest(xi, s, M)[0]

    def member(self, xi: Array, s: float) -> Array:
        return self.near(xi, s).y

    def projection(self, xi: Array, s: float = 0.0) -> tuple[Array, Array]:
        y, normal = self._nearest(xi, s, None)
        identity = np.eye(self.dimension)
        return y, identity if normal is None else identity - normal.change

    @validated
    def gauge(self, xi: ArrayLike, s: float = 0.0) -> float:
        xi = self.vector(xi, "xi")
        found = self._on_ray(xi, s) if xi.any() else None
        return super().gauge(xi, s) if found is None else self.support(found.v, s)

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        """Signed distance of ξ from K(s): the distance outside, and minus a lower bound of the
        depth inside."""
        xi = self.vector(xi, "xi")
        return self.depth(xi, self.near(xi, s), s)

    def holds(self, xi: Array, s: float, noise: float) -> bool:
        return float(np.linalg.norm(xi - self.near(xi, s).y)) <= noise

    @cached_property
    def inradius(self) -> float:
        """Radius of a ball around 0 that every K(s) is proved to contain."""
        names, ranges = self.convex.names, self.convex.ranges
        length = ex.power(ex.add(*((ex.sym(n) * ex.sym(n), 1.0) for n in names)), ex.num(0.5))
        phases = np.linspace(0.0, 1.0, 65) if ranges else np.zeros(1)
        rng = np.random.default_rng(0)
        ways = rng.normal(size=(256, self.dimension))
        ways = np.vstack([ways / lengths(ways)[:, None], np.eye(self.dimension)])
        ways = np.vstack([ways, -ways])
        least = min(float(self.sampled(np.full(len(ways), s)).support(ways).min()) for s in phases)
        directions = Directions(names, ranges)
        for share in (0.5, 0.1):
            rest = ex.add((self.convex.value, 1.0), (length, -share * least))
            if least > 0.0 and directions.nonnegative(rest, most=_MOST_BOXES):
                return share * least
        return 0.0

    def sampled(self, phases: Array) -> SampledFormula:
        return SampledFormula(self, phases)

    @property
    def bounded(self) -> bool:
        return True

    def over(self, low: Array, high: Array) -> PhaseIntervals[Any]:
        start, end = self.sampled(low), self.sampled(high)
        off = self._deviations(low, high) if self.depends_on_phase else np.zeros(len(low))
        return FormulasOnIntervals(start, end, off)

    def average(self, tolerance: float = 1e-8) -> Intersection:
        return Intersection(self, tolerance)

    @cached_property
    def _search(self) -> NormalSearch:
        return NormalSearch(self.convex)

    def _others(self, s: float) -> Array:
        return np.array([wrapped(s)]) if self.depends_on_phase else np.zeros(0)

    def _nearest(
        self, xi: Array, s: float, M: Array | None, start: Array | None = None
    ) -> tuple[Array, Normal | None]:
        """The nearest point, and the normal to K(s) at this point; None if ξ is inside, or if the
        normal is not accurate to machine precision."""
        if float(np.linalg.norm(xi)) <= self.inradius:
            return xi.copy(), None
        others = self._others(s)
        W = np.eye(self.dimension) if M is None else np.linalg.inv(M)
        found = self._search.find(xi, W, others, start)
        if found is not None:
            return found.y, found
        inside = self._inside(xi, s, None)
        if inside is not None:
            return inside.y, None
        for accuracy in (_COARSE, 0.0):
            y = nearest_by_support(self, xi, s, M, accuracy=accuracy)
            away = xi - y
            if not away.any():
                return xi.copy(), None
            if float(np.abs(away).max()) <= ROUNDED_SUM * float(np.abs(xi).max()):
                break
            found = self._search.find(xi, W, others, away if M is None else M @ away)
            if found is not None:
                return found.y, found
        return y, None

    def near(self, xi: Array, s: float, start: Array | None = None) -> Nearby:
        """The point of K(s) nearest to ξ, shape (n,).

        Parameters
        ----------
        xi : ndarray of shape (n,)
        start : ndarray of shape (n,), optional
            The normal for a similar force and phase.
        """
        length = float(np.linalg.norm(xi))
        if length <= self.inradius:
            return Nearby(xi.copy(), np.nan, start)
        inside = self._inside(xi, s, start)
        if inside is not None:
            return inside
        y, found = self._nearest(xi, s, None, start)
        if found is None:
            return Nearby(y, np.nan, start)
        return Nearby(self._search.on_face(found, self._others(s)), np.nan, start)

    def _inside(self, xi: Array, s: float, start: Array | None) -> Nearby | None:
        """The point itself, if it is in K(s) up to rounding."""
        ray = self._on_ray(xi, s, start)
        if ray is None:
            return None
        edge = self._search.on_face(ray, self._others(s))
        # K(s) contains every smaller multiple of each of its points.
        gauge = float(xi @ edge) / float(edge @ edge)
        inside = min(gauge, 1.0) * edge
        away = float(np.linalg.norm(xi - inside))
        return Nearby(inside, gauge, ray.v) if away <= ROUNDED_SUM * np.linalg.norm(xi) else None

    def depth(self, xi: Array, near: Nearby, s: float) -> float:
        """Distance of ξ from K(s); inside, minus a lower bound of the distance to the boundary.

        Parameters
        ----------
        xi : ndarray of shape (n,)
        near : Nearby
            Of ξ.
        """
        length = float(np.linalg.norm(xi))
        if length <= 0.5 * self.inradius:
            return length - self.inradius
        outside = float(np.linalg.norm(xi - near.y))
        if outside > ROUNDED_SUM * length:
            return outside
        # A ball fits around 0, so that one of 1 − gauge times that fits around ξ.
        gauge = self.gauge(xi, s) if np.isnan(near.gauge) else near.gauge
        return self.inradius * (min(gauge, 1.0) - 1.0) if self.inradius else 0.0

    def _on_ray(self, xi: Array, s: float, start: Array | None = None) -> Normal | None:
        """Boundary point of K(s) on the ray through ξ ≠ 0; None if it is not found to rounding."""
        others = self._others(s)
        for begin in (start, None) if start is not None else (None,):
            found = self._search.find(xi, None, others, begin)
            if found is not None:
                return found
        # From outside, where the normal to K(s) is determined.
        direction = xi / np.linalg.norm(xi)
        reach = self.support(direction, s)
        for _ in range(_MOST_CUTS):
            v = reach * direction - nearest_by_support(
                self, reach * direction, s, None, accuracy=_COARSE
            )
            slope = float(v @ direction)
            if slope <= _COARSE * reach:
                return None
            found = self._search.find(xi, None, others, v)
            if found is not None:
                return found
            reach = min(reach, self.support(v, s) / slope)
        return None

    @cached_property
    def _faces(self) -> dict[str, tuple[Array, Array]]:
        """Boxes that cover all directions."""
        n = self.dimension
        parts = max(1, round((_BOXES / (2 * n)) ** (1.0 / (n - 1)))) if n > 1 else 1
        edges = np.linspace(-1.0, 1.0, parts + 1)
        lows, highs = [], []
        for k in range(n):
            across = np.indices((parts,) * (n - 1)).reshape(n - 1, -1)
            for side in (-1.0, 1.0):
                low, high = (np.insert(edges[across + shift], k, side, axis=0) for shift in (0, 1))
                lows.append(low)
                highs.append(high)
        low, high = np.hstack(lows), np.hstack(highs)
        return {name: (low[i], high[i]) for i, name in enumerate(self.convex.names)}

    def _deviations(self, low: Array, high: Array) -> Array:
        """Bounds of the deviation of Ψ(·, v) from a straight line on phase intervals, for max |vᵢ|
        = 1."""
        value = self.convex.value
        slope = ex.derivative(value, _PHASE)
        count = len(next(iter(self._faces.values()))[0])
        ranges: dict[str, tuple[Array, Array]] = {
            name: (np.tile(a, len(low)), np.tile(b, len(low)))
            for name, (a, b) in self._faces.items()
        }
        ranges[_PHASE] = np.repeat(low, count), np.repeat(high, count)
        width = np.repeat(high - low, count)
        ((_, once), (_, twice)) = slopes([value, slope], ranges, _PHASE)
        known = np.isfinite(once).all(axis=0) & np.isfinite(twice).all(axis=0)
        with np.errstate(invalid="ignore"):
            bent = np.where(known, np.abs(twice).max(axis=0) * np.square(width) / 8.0, np.inf)
            kinked = (once[1] - once[0]) * width / 4.0
            off = np.fmin(bent, np.where(np.isnan(kinked), np.inf, kinked))
        return np.where(width > 0.0, off, 0.0).reshape(len(low), count).max(axis=1)


@dataclass(frozen=True, eq=False)
class SampledFormula(OneByOne):
    """A formula at m phases."""

    potential: FormulaSets

    def support(self, v: Array) -> Array:
        rows = np.broadcast_to(v, (len(self.phases), v.shape[-1]))
        size = np.abs(rows).max(axis=1)
        unit = rows / np.where(size > 0.0, size, 1.0)[:, None]
        others = wrapped(self.phases)[None] if self.potential.depends_on_phase else np.zeros((0, 1))
        values = np.concatenate([unit.T, np.broadcast_to(others, (len(others), len(unit)))])
        found = size * self.potential.convex.values(values)[0]
        return np.where(size > 0.0, np.maximum(found, 0.0), 0.0)

    def excess(self, xi: Array) -> Array:
        rows = [self.potential.depth(row, near, s) for row, near, s in self._each(xi)]
        return np.array(rows)

    def nearest(self, xi: Array) -> Array:
        rows = [near.y for _, near, _ in self._each(xi)]
        return np.array(rows).reshape(len(rows), self.potential.dimension)

    def _each(self, xi: Array) -> Iterator[tuple[Array, Nearby, float]]:
        """Solve for successive forces; each search starts from the previous result."""
        start = None
        for row, s in self._rows_of(xi):
            near = self.potential.near(row, s, start)
            start = near.v
            yield row, near, s


@dataclass(frozen=True, eq=False)
class FormulasOnIntervals(RowWise, PhaseIntervals[OneByOne]):
    """A formula on phase intervals.

    Attributes
    ----------
    bent : ndarray of shape (m,)
        How far Ψ(·, v) may be from a straight line, for unit vectors v.
    """

    start: OneByOne
    end: OneByOne
    bent: Array

    def between(
        self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array
    ) -> Array:
        # ⟨ξ, v⟩ − Ψ(s, v) is as far from straight as Ψ, and the largest of it over all unit
        # vectors v is how far ξ lies outside.
        return ends + self.bent + lengths(off)
