"""Potentials given by a formula: any convex R."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.convex.directions import Directions
from stickslip.convex.formula import ConvexFormula, convex_formula
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.rate_independent.averaging.semi_infinite import Intersection
from stickslip.rate_independent.sets.newton import Normal, NormalSearch
from stickslip.rate_independent.sets.potential import Dissipation
from stickslip.rate_independent.sets.projections import nearest_by_support
from stickslip.rate_independent.sets.stretches import (
    AtPhases,
    OneByOne,
    RowWise,
    Stretches,
    lengths,
)
from stickslip.rate_independent.signals.signal import OF_PHASE, wrapped
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import slopes
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Scope, check_name, is_finite

_COMPONENT = re.compile(r"\bv([1-9]\d{0,3})\b")
_PHASE = OF_PHASE.name
_MOST_COMPONENTS = 64
_BOXES = 256  # of directions, in which deviations between phases are bounded
_TILTS = (1e-60, 1e-15, 1e-12, 1e-9)  # of a direction in which the formula has no derivative
_ROUNDING = 1e-13
_COARSE = 1e-6  # accuracy of a distance from which what is normal to K(s) is improved
_MOST_CUTS = 20


@dataclass(frozen=True, eq=False)
class SupportFormula(Dissipation, kind="formula"):
    """Ψ(s, v) as a formula in v1, ..., vn and the phase s; K(s) is filled by its gradients.

    Parameters
    ----------
    formula : str or number
        Ψ: nonnegative, convex and homogeneous of degree 1 in ``v1``, ..., ``vn``, of period 1 in
        ``s``. It may have kinks, so that K(s) has corners and flat sides, and need not be even.
    dimension : int, optional
        n; by default the largest number of a component in the formula.
    parameters : mapping of str to float, optional
        Values of other names in the formula.

    Attributes
    ----------
    convex : ConvexFormula
        The formula with its derivatives, and what is proved of it.

    Raises
    ------
    DeclarationError
        If the formula cannot be read, is negative or undefined somewhere, is not homogeneous of
        degree 1 or not of period 1, or is not convex; then two motions show it.

    Notes
    -----
    That the formula is convex is proved by its form (sums, the larger of two, norms), or by bounds
    of its second derivatives in all directions; ``convex.said`` says how. What can be proved in
    neither way is convex as sampled, and certificates say so.

    Nearest points are exact to rounding: Newton's method finds the motion that is normal to K(s),
    also where the formula has a kink in it.
    """

    formula: Any
    dimension: int = field(default=0, metadata={"plain": True})  # type: ignore[assignment]
    parameters: Mapping[str, float] | None = field(default=None, metadata={"plain": True})
    convex: ConvexFormula = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = self._read_dimension()
        names = tuple(f"v{i + 1}" for i in range(count))
        parameters = _read_parameters(self.parameters or {})
        scope = Scope({name: ex.sym(name) for name in (*names, _PHASE)} | parameters)
        value = scope.parse(self.formula, "formula")
        varies = _PHASE in value.symbols
        ranges = {_PHASE: (0.0, 1.0)} if varies else {}
        checked = convex_formula(value, names, ranges, "formula", symbol="Psi")
        object.__setattr__(self, "dimension", count)
        object.__setattr__(self, "convex", checked)
        if varies:
            self._check_period()

    def _read_dimension(self) -> int:
        text = self.formula
        used = text.symbols if isinstance(text, Expr) else {f"v{i}" for i in _components(text)}
        largest = max((int(i) for name in used for i in _components(name)), default=0)
        given: Any = self.dimension
        if isinstance(given, bool) or not isinstance(given, int | np.integer) or given < 0:
            raise DeclarationError("dimension", f"{given!r} is not a dimension", "Give 1, 2, 3, ...")
        if given and largest > given:
            raise DeclarationError(
                "formula", f"it has the component v{largest}, but n = {given}", "Correct one of them"
            )
        count = int(given) or largest
        if not count:
            raise DeclarationError(
                "formula", "it has no component v1, v2, ...", "Write it in these, or give n"
            )
        if count > _MOST_COMPONENTS:
            raise DeclarationError(
                "formula",
                f"it has {count} components (at most {_MOST_COMPONENTS})",
                "Use a Product of smaller ones",
            )
        return count

    def _check_period(self) -> None:
        directions = np.random.default_rng(0).normal(size=(16, self.dimension))
        start, end = (self.sampled(np.full(16, s)).support(directions) for s in (0.0, 1.0))
        off = np.abs(end - start) - 1e-9 * np.maximum(np.abs(start), np.abs(end))
        if (off > 0.0).any():
            raise DeclarationError(
                "formula",
                "it differs between the phases s = 0 and s = 1",
                "Write it with period 1 in s",
            )

    @classmethod
    def variables(cls, given: Mapping[str, Any]) -> tuple[str, ...]:
        count = given.get("dimension") or 0
        largest = max(_components(given.get("formula", "")), default=0)
        count = max(count if isinstance(count, int) else 0, largest)
        return tuple(f"v{i + 1}" for i in range(min(count, _MOST_COMPONENTS)))

    @property
    def depends_on_phase(self) -> bool:
        return bool(self.convex.ranges)

    @property
    def doubt(self) -> str:
        return "" if self.convex.proved else f"dissipation {self.convex.said}"

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
        # On a kink of a root: the gradient beside it belongs to v, too, up to the tilt.
        way = np.random.default_rng(0).uniform(0.5, 1.0, self.dimension) * np.abs(v).max()
        for tilt in _TILTS:
            xi = self._search.at(v + tilt * way, others).gradient
            if np.isfinite(xi).all():
                return xi
        raise DeclarationError(
            "formula", f"it has no derivative around v = {v}", "Write it in another way"
        )

    def hessian(self, v: ArrayLike, s: float = 0.0) -> Array:
        """Second derivatives of Ψ(s, ·) at v, shape (n, n): how the point that v exposes turns with
        v; NaN on a kink.

        Parameters
        ----------
        v : array of shape (n,)
            Not 0.
        s : float
            Phase.
        """
        v = self.vector(v, "v")
        if not v.any():
            return np.full((self.dimension, self.dimension), np.nan)
        return self._search.at(v, self._others(s)).hessian

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The nearest point, exact to rounding where the kinks of the formula are those of choices
        and roots."""
        return self._nearest(self.vector(xi, "xi"), s, self.metric(metric))[0]

    def projection(self, xi: Array, s: float = 0.0) -> tuple[Array, Array]:
        y, normal = self._nearest(xi, s, None)
        identity = np.eye(self.dimension)
        return y, identity if normal is None else identity - normal.change

    def member(self, xi: ArrayLike, s: float = 0.0) -> Array:
        """A point of K(s) that is as close to ξ, shape (n,), as any up to rounding.

        It is ξ, or a gradient of Ψ(s, ·), or a mean of such: in K(s) whatever a search may have
        missed, so that the distance of ξ is no larger than that from it.
        """
        xi = self.vector(xi, "xi")
        length = float(np.linalg.norm(xi))
        if length <= self.inradius:
            return xi.copy()
        others = self._others(s)
        ray = self._on_ray(xi, s)
        if ray is not None:
            edge = self._search.on_face(ray, others)
            # Of a point of K(s), any smaller multiple is in K(s), too.
            inside = min(float(xi @ edge) / float(edge @ edge), 1.0) * edge
            if float(np.linalg.norm(xi - inside)) <= _ROUNDING * length:
                return inside
        y, found = self._nearest(xi, s, None)
        return y if found is None else self._search.on_face(found, others)

    @validated
    def gauge(self, xi: ArrayLike, s: float = 0.0) -> float:
        xi = self.vector(xi, "xi")
        found = self._on_ray(xi, s) if xi.any() else None
        return super().gauge(xi, s) if found is None else self.support(found.v, s)

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        """How far ξ lies outside K(s): its distance; inside, how far at least it lies inside."""
        xi = self.vector(xi, "xi")
        length = float(np.linalg.norm(xi))
        if length <= 0.5 * self.inradius:
            return length - self.inradius
        outside = float(np.linalg.norm(xi - self.member(xi, s)))
        if outside > _ROUNDING * length:
            return outside
        # A ball fits around 0, so that one of 1 − gauge times that fits around ξ.
        return self.inradius * (min(self.gauge(xi, s), 1.0) - 1.0) if self.inradius else 0.0

    def holds(self, xi: Array, s: float, noise: float) -> bool:
        return float(np.linalg.norm(xi - self.member(xi, s))) <= noise

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
        least = min(
            float(self.sampled(np.full(len(ways), s)).support(ways).min()) for s in phases
        )
        directions = Directions(names, ranges)
        for share in (0.9, 0.5, 0.1):
            if least > 0.0 and directions.nonnegative(
                ex.add((self.convex.value, 1.0), (length, -share * least))
            ):
                return share * least
        return 0.0

    def sampled(self, phases: Array) -> AtPhases:
        return SampledFormula(self, phases)

    @property
    def bounded(self) -> bool:
        return True

    def over(self, low: Array, high: Array) -> Stretches[Any]:
        start, end = self.sampled(low), self.sampled(high)
        off = self._deviations(low, high) if self.depends_on_phase else np.zeros(len(low))
        return StretchesOfFormulas(start, end, off)

    def average(self, tolerance: float = 1e-8) -> Intersection:
        return Intersection(self, tolerance)

    @cached_property
    def _search(self) -> NormalSearch:
        return NormalSearch(self.convex)

    def _others(self, s: float) -> Array:
        return np.array([wrapped(s)]) if self.depends_on_phase else np.zeros(0)

    def _nearest(self, xi: Array, s: float, M: Array | None) -> tuple[Array, Normal | None]:
        """The nearest point, with what is normal to K(s) there; None if ξ is inside, or what is
        normal is not known to rounding."""
        if float(np.linalg.norm(xi)) <= self.inradius:
            return xi.copy(), None
        others = self._others(s)
        W = np.eye(self.dimension) if M is None else np.linalg.inv(M)
        found = self._search.smooth(xi, W, others)
        if found is not None:
            return found.y, found
        for accuracy in (_COARSE, 0.0):
            y = nearest_by_support(self, xi, s, M, accuracy=accuracy)
            away = xi - y
            if not away.any():
                return xi.copy(), None
            if float(np.abs(away).max()) <= _ROUNDING * float(np.abs(xi).max()):
                break
            v = away if M is None else M @ away
            found = self._search.smooth(xi, W, others, v) or self._search.on_kink(xi, W, v, others)
            if found is not None:
                return found.y, found
        return y, None

    def _on_ray(self, xi: Array, s: float) -> Normal | None:
        """Where the ray through ξ ≠ 0 leaves K(s); None if that is not found to rounding."""
        others = self._others(s)
        found = self._search.smooth(xi, None, others)
        if found is not None:
            return found
        # From outside, where what is normal to K(s) can be told.
        direction = xi / np.linalg.norm(xi)
        reach = self.support(direction, s)
        for _ in range(_MOST_CUTS):
            v = reach * direction - nearest_by_support(
                self, reach * direction, s, None, accuracy=_COARSE
            )
            slope = float(v @ direction)
            if slope <= _COARSE * reach:
                return None
            found = self._search.smooth(xi, None, others, v) or self._search.on_kink(
                xi, None, v, others
            )
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
                low, high = (
                    np.insert(edges[across + shift], k, side, axis=0) for shift in (0, 1)
                )
                lows.append(low)
                highs.append(high)
        low, high = np.hstack(lows), np.hstack(highs)
        return {name: (low[i], high[i]) for i, name in enumerate(self.convex.names)}

    def _deviations(self, low: Array, high: Array) -> Array:
        """How far Ψ(·, v) may be from a straight line on stretches of phases, for max |vᵢ| = 1."""
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


def _components(text: object) -> list[int]:
    """Numbers of the components in a formula."""
    return [int(i) for i in _COMPONENT.findall(text)] if isinstance(text, str) else []


def _read_parameters(given: Mapping[str, Any]) -> dict[str, Expr]:
    for name, value in given.items():
        where = f"parameters.{name}"
        check_name(name, where)
        if name == _PHASE or _COMPONENT.fullmatch(name):
            raise DeclarationError(where, f"'{name}' has a meaning here", "Choose another name")
        if not is_finite(value):
            raise DeclarationError(where, f"{value!r} is not a finite number", "Give a number")
    return {name: ex.num(float(value)) for name, value in given.items()}


@dataclass(frozen=True, eq=False)
class SampledFormula(OneByOne):
    """A formula at m phases."""

    potential: SupportFormula

    def support(self, v: Array) -> Array:
        rows = np.broadcast_to(v, (len(self.phases), v.shape[-1]))
        size = np.abs(rows).max(axis=1)
        unit = rows / np.where(size > 0.0, size, 1.0)[:, None]
        others = wrapped(self.phases)[None] if self.potential.depends_on_phase else np.zeros((0, 1))
        values = np.concatenate([unit.T, np.broadcast_to(others, (len(others), len(unit)))])
        found = size * self.potential.convex.values(values)[0]
        return np.where(size > 0.0, np.maximum(found, 0.0), 0.0)

    def nearest(self, xi: Array) -> Array:
        rows = [self.potential.member(row, s) for row, s in self._rows_of(xi)]
        return np.array(rows).reshape(len(rows), self.potential.dimension)


@dataclass(frozen=True, eq=False)
class StretchesOfFormulas(RowWise, Stretches[OneByOne]):
    """A formula on stretches of phases.

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
