"""Sums of potentials on a product space."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.rate_independent.averaging.optimal_motion import gathered
from stickslip.rate_independent.averaging.semi_infinite import Intersection
from stickslip.rate_independent.sets.cones import ConeForm, product_of_cones
from stickslip.rate_independent.sets.phase_intervals import AtPhases, PhaseIntervals, RowWise
from stickslip.rate_independent.sets.potential import Average, Dissipation, OptimalMotion
from stickslip.rate_independent.sets.projections import nearest_by_support, nearest_in_metric


@dataclass(frozen=True, eq=False)
class Product(Dissipation):
    """Ψ(s, (v₁, ..., v_m)) = Σ Ψ_k(s, v_k); K(s) is the product of the K_k(s).

    Parameters
    ----------
    factors : sequence of Dissipation
    """

    factors: Sequence[Dissipation]

    def __post_init__(self) -> None:
        if not hasattr(self.factors, "__iter__"):
            raise DeclarationError("factors", "it is not a list", "Give a list of potentials")
        object.__setattr__(self, "factors", tuple(self.factors))
        if not self.factors:
            raise DeclarationError("factors", "the list is empty", "Give at least one potential")
        for k, factor in enumerate(self.factors):
            if not isinstance(factor, Dissipation):
                raise DeclarationError(
                    f"factors[{k}]",
                    f"expected a dissipation potential, got {type(factor).__name__}",
                    "Give potentials",
                )

    @property
    def dimension(self) -> int:
        return sum(factor.dimension for factor in self.factors)

    @property
    def depends_on_phase(self) -> bool:
        return any(factor.depends_on_phase for factor in self.factors)

    @property
    def doubt(self) -> str:
        return "; ".join(dict.fromkeys(factor.doubt for factor in self.factors if factor.doubt))

    @property
    def parts(self) -> list[slice]:
        """Components of each factor."""
        ends = np.cumsum([0, *(factor.dimension for factor in self.factors)])
        return [slice(start, end) for start, end in pairwise(map(int, ends))]

    def split(self, x: Array) -> Iterator[tuple[Dissipation, Array]]:
        """Each factor with its components of x."""
        return zip(self.factors, (x[part] for part in self.parts), strict=True)

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        return sum(factor.support(part, s) for factor, part in self.split(self.vector(v, "v")))

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        return np.concatenate(
            [factor.exposed(part, s) for factor, part in self.split(self.vector(v, "v"))]
        )

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        return max(factor.excess(part, s) for factor, part in self.split(self.vector(xi, "xi")))

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The nearest point, factor by factor; in a metric by Newton's method, to machine
        precision."""
        xi = self.vector(xi, "xi")
        M = self.metric(metric)
        if M is None:
            return np.concatenate([factor.project(part, s) for factor, part in self.split(xi)])
        if self.cone_form(s) is None:
            return nearest_by_support(self, xi, s, M)
        return nearest_in_metric(lambda x: self.projection(x, s), xi, M)

    def projection(self, xi: Array, s: float = 0.0) -> tuple[Array, Array]:
        from scipy.linalg import block_diag

        points, slopes = zip(
            *(factor.projection(part, s) for factor, part in self.split(xi)), strict=True
        )
        return np.concatenate(points), np.asarray(block_diag(*slopes))

    def member(self, xi: Array, s: float) -> Array:
        return np.concatenate([factor.member(part, s) for factor, part in self.split(xi)])

    def cone_form(self, s: float) -> ConeForm | None:
        forms = [form for factor in self.factors if (form := factor.cone_form(s)) is not None]
        complete = len(forms) == len(self.factors)
        return (
            product_of_cones(forms, [factor.dimension for factor in self.factors])
            if complete
            else None
        )

    def outer_form(self, s: float, xi: Array) -> ConeForm:
        forms = [factor.outer_form(s, part) for factor, part in self.split(xi)]
        return product_of_cones(forms, [factor.dimension for factor in self.factors])

    def sampled(self, phases: Array) -> AtPhases:
        return SampledProduct(self.parts, tuple(factor.sampled(phases) for factor in self.factors))

    @property
    def bounded(self) -> bool:
        return all(factor.bounded for factor in self.factors)

    def over(self, low: Array, high: Array) -> PhaseIntervals[Any]:
        factors = tuple(factor.over(low, high) for factor in self.factors)
        start = SampledProduct(self.parts, tuple(factor.start for factor in factors))
        end = SampledProduct(self.parts, tuple(factor.end for factor in factors))
        return ProductsOnIntervals(self.parts, start, end, factors)

    def average(self, tolerance: float = 1e-8) -> AveragedProduct:
        """The product of the averages."""
        return AveragedProduct(
            tuple(factor.average(tolerance) for factor in self.factors), self, tolerance
        )


@dataclass(frozen=True, eq=False)
class AveragedProduct(Average, Product):
    """The product of averages is the average of a product."""

    source: Product
    tolerance: float

    @property
    def frictionless(self) -> Array:
        from scipy.linalg import block_diag

        return np.asarray(block_diag(*(factor.frictionless for factor in self.averages)))

    @property
    def samples(self) -> int:
        return max(average.samples for average in self.averages)

    @property
    def averages(self) -> tuple[Average, ...]:
        """The factors."""
        return tuple(factor for factor in self.factors if isinstance(factor, Average))

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The nearest point, factor by factor; in a metric, which couples them, from the phases of
        all together."""
        if metric is not None and self.cone_form(s) is None:
            return self._together.project(xi, s, metric)
        return super().project(xi, s, metric)

    @cached_property
    def _together(self) -> Intersection:
        """All factors together; each search starts from the previous result."""
        return Intersection(self.source, self.tolerance)

    def average(self, tolerance: float = 1e-8) -> Self:
        """Itself."""
        return self

    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        """The motions of all factors."""
        v = self.vector(V, "V")
        own = [
            average.optimal_motion(v[part])
            for average, part in zip(self.averages, self.parts, strict=True)
        ]
        motions = np.zeros((sum(len(motion.phases) for motion in own), len(v)))
        row = 0
        for motion, part in zip(own, self.parts, strict=True):
            motions[row : row + len(motion.phases), part] = motion.motions
            row += len(motion.phases)
        phases, motions = gathered(np.concatenate([motion.phases for motion in own]), motions)
        return OptimalMotion(
            phases, motions, sum(motion.cost for motion in own), sum(motion.bound for motion in own)
        )


@dataclass(frozen=True, eq=False)
class SampledProduct(RowWise, AtPhases):
    """A product at m phases."""

    parts: list[slice]
    factors: tuple[AtPhases, ...]

    def _each(self, x: Array) -> Iterator[tuple[AtPhases, Array]]:
        return zip(self.factors, (x[..., part] for part in self.parts), strict=True)

    def support(self, v: Array) -> Array:
        return np.sum([factor.support(part) for factor, part in self._each(v)], axis=0)

    def excess(self, xi: Array) -> Array:
        return np.max([factor.excess(part) for factor, part in self._each(xi)], axis=0)

    def nearest(self, xi: Array) -> Array:
        return np.concatenate([factor.nearest(part) for factor, part in self._each(xi)], axis=1)


@dataclass(frozen=True, eq=False)
class ProductsOnIntervals(RowWise, PhaseIntervals[SampledProduct]):
    """A product on phase intervals."""

    parts: list[slice]
    start: SampledProduct
    end: SampledProduct
    factors: tuple[PhaseIntervals[Any], ...]

    def between(
        self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array
    ) -> Array:
        own = zip(self.factors, self.parts, strict=True)
        return np.max(
            [f.outside(before[:, p], after[:, p], off[:, p], enough)[2] for f, p in own], axis=0
        )
