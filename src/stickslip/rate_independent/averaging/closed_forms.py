"""Averages that have a closed form: the same kind of potential, with the least of each number."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.errors import DeclarationError
from stickslip.rate_independent.averaging.minima import Minima, least_over_phases
from stickslip.rate_independent.dissipation.base import Array, Average, Dissipation, OptimalMotion
from stickslip.rate_independent.dissipation.group_norm import GroupNorm
from stickslip.rate_independent.dissipation.phase import Varying
from stickslip.rate_independent.dissipation.polytope import Polytope
from stickslip.rate_independent.dissipation.product import Product
from stickslip.rate_independent.dissipation.weighted_l1 import WeightedL1, nonnegative

if TYPE_CHECKING:
    from stickslip.rate_independent.averaging.semi_infinite import Intersection

MOST_NUMBERS = 20_000_000  # in the table of an optimal motion
VANISHING = 1e-12  # thresholds that count as 0, of the largest


@dataclass(frozen=True, eq=False)
class AveragedWeightedL1(Average, WeightedL1):
    """Σ min ρᵢ⁺ max(vᵢ, 0) + min ρᵢ⁻ max(−vᵢ, 0).

    Attributes
    ----------
    source : WeightedL1
    least_above, least_below : Minima
        Of ρ⁺ and ρ⁻ over the phase.
    """

    source: WeightedL1 = field(kw_only=True)
    least_above: Minima = field(kw_only=True)
    least_below: Minima = field(kw_only=True)

    @property
    def upper_phases(self) -> Array:
        """When component i moves up, shape (n,)."""
        return self.least_above.phases

    @property
    def lower_phases(self) -> Array:
        """When component i moves down, shape (n,)."""
        return self.least_below.phases

    @property
    def samples(self) -> int:
        return max(self.least_above.sampled, self.least_below.sampled)

    @property
    def frictionless(self) -> Array:
        lower, upper = self.bounds()
        return _axes(_vanishing(upper - lower))

    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        V = self.vector(V, "V")
        when = np.where(V >= 0, self.upper_phases, self.lower_phases)
        bound = np.maximum(V, 0.0) @ self.least_above.floors - np.minimum(V, 0.0) @ self.least_below.floors
        return _scheduled(self.source, V, when, float(bound))


def average_weighted_l1(source: WeightedL1) -> AveragedWeightedL1:
    """Each weight at its minimum over the phase."""
    above = least_thresholds(source.above)
    below = above if source.below is source.above else least_thresholds(source.below)
    lower = None if below is above else below.values
    return AveragedWeightedL1(above.values, lower, source=source, least_above=above, least_below=below)


@dataclass(frozen=True, eq=False)
class AveragedGroupNorm(Average, GroupNorm):
    """Σ min r_g |v_g|₂.

    Attributes
    ----------
    source : GroupNorm
    least : Minima
        Of the radii over the phase: when each group moves.
    """

    source: GroupNorm = field(kw_only=True)
    least: Minima = field(kw_only=True)

    @property
    def phases(self) -> Array:
        """When each group moves, shape (groups,)."""
        return self.least.phases

    @property
    def samples(self) -> int:
        return self.least.sampled

    @property
    def frictionless(self) -> Array:
        return _axes(np.repeat(_vanishing(self.radii_at()), self.size))

    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        V = self.vector(V, "V")
        return _scheduled(self.source, V, np.repeat(self.phases, self.size), float(self.least.floors @ self.norms(V)))


def average_group_norm(source: GroupNorm) -> AveragedGroupNorm:
    """Each radius at its minimum over the phase."""
    least = least_thresholds(source.radius)
    return AveragedGroupNorm(least.values, source.size, source=source, least=least)


@dataclass(frozen=True, eq=False)
class AveragedPolytope(Average, Polytope):
    """{ξ : N ξ ≤ min b(s)} for fixed normals N.

    Attributes
    ----------
    source : Polytope
    least : Minima
        Of the offsets over the phase: when each face comes closest to 0.
    """

    source: Polytope = field(kw_only=True)
    least: Minima = field(kw_only=True)

    @property
    def phases(self) -> Array:
        """When each face comes closest to 0, shape (m,)."""
        return self.least.phases

    @property
    def samples(self) -> int:
        return self.least.sampled

    @property
    def frictionless(self) -> Array:
        from stickslip.rate_independent.averaging.semi_infinite import lineality

        return lineality(self, VANISHING * float(self.halfspaces_at()[1].max()))

    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        """Each face pushes along its normal at the phase at which it is closest."""
        from stickslip.rate_independent.averaging.cones import polyhedron, solve

        V = self.vector(V, "V")
        normals, offsets = self.halfspaces_at()
        size, length = float(offsets.max()) or 1.0, float(np.abs(V).max())
        if length == 0.0:
            return OptimalMotion(np.zeros(0), np.zeros((0, len(V))), 0.0, 0.0)
        forms = [polyhedron(normals[[j]], offsets[[j]] / size) for j in range(len(normals))]
        xi, motions = solve(forms, V / length)
        violation = float(np.max((self.least.values - self.least.floors) / np.linalg.norm(self.source.normals, axis=1)))
        return measure(self.source, V, self.phases, motions * length, xi * size, violation)


def average_polytope(source: Polytope) -> AveragedPolytope:
    """Each offset at its minimum over the phase."""
    assert source.reach is not None
    least = least_thresholds(source.reach)
    return AveragedPolytope(normals=source.normals, offsets=least.values, source=source, least=least)


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
        """The nearest point, factor by factor; in a metric, which couples them, from the phases of all together."""
        if metric is not None and self.cone_form(s) is None:
            return self._together.project(xi, s, metric)
        return super().project(xi, s, metric)

    @cached_property
    def _together(self) -> Intersection:
        """All factors at once: what was found of it is where the next search starts."""
        from stickslip.rate_independent.averaging.semi_infinite import Intersection

        return Intersection(self.source, self.tolerance)

    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        """The motions of all factors."""
        V = self.vector(V, "V")
        own = [average.optimal_motion(V[part]) for average, part in zip(self.averages, self.parts, strict=True)]
        motions = np.zeros((sum(len(motion.phases) for motion in own), len(V)))
        row = 0
        for motion, part in zip(own, self.parts, strict=True):
            motions[row : row + len(motion.phases), part] = motion.motions
            row += len(motion.phases)
        phases, motions = gathered(np.concatenate([motion.phases for motion in own]), motions)
        return OptimalMotion(phases, motions, sum(motion.cost for motion in own), sum(motion.bound for motion in own))


def least_thresholds(thresholds: Varying) -> Minima:
    """Thresholds at their minima over the phase; refuses negative ones."""
    least = least_over_phases(thresholds)
    if least.values.min() < 0.0:
        nonnegative(thresholds, float(least.phases[least.values.argmin()]))
    return least._replace(values=np.maximum(least.values, 0.0), floors=np.maximum(least.floors, 0.0))


def measure(source: Dissipation, V: Array, phases: Array, motions: Array, xi: Array, violation: float) -> OptimalMotion:
    """A measure with the sum V, what it costs, and what a force ξ says about the least cost."""
    moving = np.abs(motions).max(axis=1) > 1e-14 * np.abs(V).max(initial=0.0)
    together, sums = gathered(phases[moving], motions[moving])
    if len(sums):
        # Rounding of the program that found them.
        sums[int(np.linalg.norm(sums, axis=1).argmax())] += V - sums.sum(axis=0)
    cost = sum(source.support(v, s) for s, v in zip(together, sums, strict=True))
    total = float(np.linalg.norm(sums, axis=1).sum())
    return OptimalMotion(together, sums, float(cost), float(xi @ V) - max(violation, 0.0) * total)


def gathered(phases: Array, motions: Array) -> tuple[Array, Array]:
    """The same measure with increasing phases, each once."""
    together, place = np.unique(phases, return_inverse=True)
    sums = np.zeros((len(together), motions.shape[1]))
    np.add.at(sums, place, motions)
    return together, sums


def _scheduled(source: Dissipation, V: Array, when: Array, bound: float) -> OptimalMotion:
    """Each component moves at a phase of its own."""
    moving = V != 0
    phases, place = np.unique(when[moving], return_inverse=True)
    if len(phases) * len(V) > MOST_NUMBERS:
        raise DeclarationError(
            "optimal_motion",
            f"{len(phases)} phases times {len(V)} components make too large a table",
            "The phase of each component is an attribute of the average",
        )
    motions = np.zeros((len(phases), len(V)))
    motions[place, np.flatnonzero(moving)] = V[moving]
    cost = sum(source.support(v, s) for s, v in zip(phases, motions, strict=True))
    return OptimalMotion(phases, motions, float(cost), bound)


def _vanishing(thresholds: Array) -> NDArray[np.bool_]:
    return thresholds <= VANISHING * float(thresholds.max())


def _axes(chosen: NDArray[np.bool_]) -> Array:
    """Unit vectors of the chosen components as columns."""
    (index,) = np.nonzero(chosen)
    basis = np.zeros((len(chosen), len(index)))
    basis[index, np.arange(len(index))] = 1.0
    return basis
