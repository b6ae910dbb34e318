"""Stable sets K(s) at many phases: the interface for steps and their audit, row by row.

Row k of every array belongs to phase k. Boxes and discs are plain arrays, so that a million
components or a hundred thousand steps cost a few passes over memory; every other potential is
evaluated phase by phase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.kept import cached_property
from stickslip.rate_independent.sets.phase_intervals import AtPhases
from stickslip.rate_independent.sets.projections import nearest_in_metric, onto_balls

if TYPE_CHECKING:
    from stickslip.rate_independent.sets.potential import Dissipation

Forces = tuple[Array, Array, Array]
_ON_BOUND = 1e-12  # relative to a radius: a force this close to it inside is on its bound
SIZED_AT = 17  # number of phases at which the size of K(s) is evaluated


class Step(NamedTuple):
    """Data of increments d, one row each.

    Attributes
    ----------
    value : ndarray of shape (m,)
        Ψ(s, d).
    pull : ndarray of shape (m, n)
        A d, the elastic force of the increment.
    rounding : ndarray of shape (m,)
        Rounding error of d, from that of the states.
    """

    value: Array
    pull: Array
    rounding: Array


class StableSets(Protocol):
    """K(s) for a row of phases.

    Attributes
    ----------
    together : int or None
        Size of the groups of components with a common threshold: 1 for boxes. None if K(s) is not a
        product over groups.
    """

    @property
    def together(self) -> int | None: ...

    def weights(self, k: int) -> dict[str, Array]:
        """Arguments of the solver for large products for row k, by name; only for sets with
        `together`."""
        ...

    def value(self, v: Array) -> Array:
        """Ψ(s, v) of every row, shape (m,)."""
        ...

    def outside(self, xi: Array) -> Array:
        """ξ minus its nearest point of K(s) in every row, shape (m, n)."""
        ...

    def largest(self, xi: Array) -> Array:
        """Size of the largest component or group of every row, shape (m,); of the row if K(s) is no
        product."""
        ...

    def residual(self, xi: Array, outside: Array, d: Array, step: Step) -> Array:
        """Distance of ξ from ∂Ψ(s, ·)(d) in every row: the largest over the components, shape (m,).

        `outside` belongs to ξ; d is known to rounding.
        """
        ...

    def size(self) -> Array:
        """Largest weight of every row."""
        ...

    def moving(self, d: Array) -> Array:
        """Number of moving components (or groups) of every row."""
        ...

    def total(self, d: Array) -> Array:
        """Additional work on d of a force that is larger by 1 in every component (or group), in
        every row."""
        ...

    def overshoot(self, before: Self, middle: Self, forces: Forces) -> Array | None:
        """Excess of ξ over K(s) during the step that ends with each row, from values before, in the
        middle and after; None if the potential must be evaluated instead."""
        ...

    def before(self, first: Self) -> Self:
        """The sets of the phase before each row; `first` comes before row 0, and is `self` if one
        set serves all."""
        ...

    def row(self, k: int) -> Self:
        """The set of one row."""
        ...


def largest_weight(dissipation: Dissipation) -> float:
    """Largest weight over the phases, as sampled: the force that residuals are compared with."""
    phases = np.linspace(0.0, 1.0, SIZED_AT) if dissipation.depends_on_phase else np.zeros(1)
    return max(float(dissipation.sets(phases[k : k + 1]).size()[0]) for k in range(len(phases)))


def _crest(start: Array, middle: Array, end: Array) -> Array:
    """Largest value that a function may reach during a step, given its values; at least 0, the
    largest of every row.

    Twice its deviation from the chord: the crest of a parabola with that deviation, or of a kink
    anywhere in the step.
    """
    crest = np.maximum(start, end) + np.abs(2.0 * middle - start - end)
    return np.maximum(crest.max(axis=1), 0.0)


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->i", a, b)


def _shifted(rows: Array, first: Array) -> Array:
    return first if len(rows) == 1 else np.concatenate([first, rows[:-1]])


@dataclass(frozen=True)
class Boxes:
    """K(s) = {lower ≤ ξ ≤ upper}: weighted ℓ1. Arrays of shape (m, n), or (1, n) if all rows are
    alike."""

    lower: Array
    upper: Array
    together = 1

    def weights(self, k: int) -> dict[str, Array]:
        row = k if len(self.lower) > 1 else 0
        return {"lower": self.lower[row], "upper": self.upper[row]}

    def value(self, v: Array) -> Array:
        return np.maximum(self.lower * v, self.upper * v).sum(axis=1)

    def outside(self, xi: Array) -> Array:
        return xi - np.clip(xi, self.lower, self.upper)

    def largest(self, xi: Array) -> Array:
        return np.abs(xi).max(axis=1)

    def residual(self, xi: Array, outside: Array, d: Array, step: Step) -> Array:
        # A component that moves has one admissible force.
        low = np.where(d > 0.0, self.upper, self.lower)
        high = np.where(d < 0.0, self.lower, self.upper)
        return self.largest(xi - np.clip(xi, low, high))

    def size(self) -> Array:
        return np.maximum(-self.lower, self.upper).max(axis=1)

    def overshoot(self, before: Self, middle: Self, forces: Forces) -> Array:
        sets = (before, middle, self)
        above = _crest(*(xi - box.upper for xi, box in zip(forces, sets, strict=True)))
        return np.maximum(
            above, _crest(*(box.lower - xi for xi, box in zip(forces, sets, strict=True)))
        )

    def moving(self, d: Array) -> Array:
        return np.count_nonzero(d, axis=1)

    def total(self, d: Array) -> Array:
        return np.abs(d).sum(axis=1)

    def before(self, first: Self) -> Self:
        if first is self:
            return self
        return replace(
            self, lower=_shifted(self.lower, first.lower), upper=_shifted(self.upper, first.upper)
        )

    def row(self, k: int) -> Self:
        return (
            self
            if len(self.lower) == 1
            else replace(self, lower=self.lower[k : k + 1], upper=self.upper[k : k + 1])
        )


@dataclass(frozen=True)
class Discs:
    """K(s) = {|ξ_g| ≤ r_g}: isotropic friction of groups. Radii of shape (m, groups), or (1,
    groups)."""

    radii: Array
    group: int

    @property
    def together(self) -> int:
        return self.group

    def weights(self, k: int) -> dict[str, Array]:
        return {"radii": self.radii[k if len(self.radii) > 1 else 0]}

    def holds(self, xi: Array, noise: float) -> bool:
        """Return whether ξ, shape (n,), lies outside K(s) by no more than rounding; of a single
        row."""
        return bool((self._norms(xi[None]) <= self.radii + noise).all())

    def nearest(self, xi: Array, metric: Array) -> Array:
        """The point of K(s) nearest to ξ, shape (n,), in a metric; of a single row."""
        return nearest_in_metric(lambda x: onto_balls(x, self.radii[0], self.group), xi, metric)

    def sliding(self, held: Array) -> NDArray[np.bool_]:
        """Components of the groups whose force, shape (n,), is on its bound; of a single row."""
        radii = self.radii[0]
        return np.repeat(self._norms(held[None])[0] >= radii - _ON_BOUND * radii, self.group)

    def still(self, pull: Array, noise: float) -> NDArray[np.bool_]:
        """Components of the groups that a pull, shape (n,), moves by no more than rounding."""
        return np.repeat(self._norms(pull[None])[0] <= noise, self.group)

    def _norms(self, v: Array) -> Array:
        return np.sqrt(np.square(self._groups(v)).sum(axis=2))

    def _groups(self, v: Array) -> Array:
        return v.reshape(len(v), -1, self.group)

    def value(self, v: Array) -> Array:
        return (self.radii * self._norms(v)).sum(axis=1)

    def outside(self, xi: Array) -> Array:
        norms = self._norms(xi)
        with np.errstate(invalid="ignore", divide="ignore"):
            excess = np.where(norms > self.radii, 1.0 - self.radii / norms, 0.0)
        return (excess[:, :, None] * self._groups(xi)).reshape(xi.shape)

    def largest(self, xi: Array) -> Array:
        return self._norms(xi).max(axis=1)

    def residual(self, xi: Array, outside: Array, d: Array, step: Step) -> Array:
        speed = self._norms(d)
        with np.errstate(invalid="ignore", divide="ignore"):
            target = (self.radii / speed)[:, :, None] * self._groups(d)
            # The direction of a short increment is known to the rounding of states only.
            known = self.radii * np.minimum(step.rounding[:, None] / speed, 1.0)
        off = np.where((speed > 0.0)[:, :, None], self._groups(xi) - target, self._groups(outside))
        lengths = np.sqrt(np.square(off).sum(axis=2))
        return np.where(speed > 0.0, np.maximum(lengths - known, 0.0), lengths).max(axis=1)

    def size(self) -> Array:
        return self.radii.max(axis=1)

    def overshoot(self, before: Self, middle: Self, forces: Forces) -> Array:
        return _crest(
            *(s._norms(xi) - s.radii for xi, s in zip(forces, (before, middle, self), strict=True))
        )

    def moving(self, d: Array) -> Array:
        return np.any(self._groups(d) != 0.0, axis=2).sum(axis=1)

    def total(self, d: Array) -> Array:
        return self._norms(d).sum(axis=1)

    def before(self, first: Self) -> Self:
        return self if first is self else replace(self, radii=_shifted(self.radii, first.radii))

    def row(self, k: int) -> Self:
        return self if len(self.radii) == 1 else replace(self, radii=self.radii[k : k + 1])


@dataclass(frozen=True)
class ConvexSets:
    """K(s) of any other potential. A single phase applies to all rows."""

    dissipation: Dissipation
    phases: Array
    together = None

    def weights(self, k: int) -> dict[str, Array]:
        raise NotImplementedError

    def overshoot(self, before: Self, middle: Self, forces: Forces) -> None:
        return None

    @cached_property
    def _sampled(self) -> AtPhases:
        return self.dissipation.sampled(self.phases)

    def _for(self, rows: Array) -> AtPhases:
        """The potential at the phase of every row."""
        if len(self.phases) == len(rows):
            return self._sampled
        return self.dissipation.sampled(np.broadcast_to(self.phases, len(rows)))

    def value(self, v: Array) -> Array:
        return self._for(v).support(v)

    def outside(self, xi: Array) -> Array:
        return xi - self._for(xi).nearest(xi)

    def holds(self, xi: Array, noise: float) -> bool:
        """Return whether ξ, shape (n,), lies outside K(s) by no more than rounding; of a single
        row."""
        return self.dissipation.holds(xi, float(self.phases[0]), noise)

    def nearest(self, xi: Array, metric: Array) -> Array:
        """The point of K(s) nearest to ξ, shape (n,), in a metric; of a single row."""
        return self.dissipation.project(xi, float(self.phases[0]), metric)

    def sliding(self, held: Array) -> NDArray[np.bool_]:
        """Components that may move: all."""
        return np.ones(len(held), bool)

    def still(self, pull: Array, noise: float) -> NDArray[np.bool_]:
        """Components that a pull moves by no more than rounding, and that may rest on their own:
        none."""
        return np.zeros(len(pull), bool)

    def largest(self, xi: Array) -> Array:
        return np.sqrt(_dot(xi, xi))

    def residual(self, xi: Array, outside: Array, d: Array, step: Step) -> Array:
        # ξ ∈ ∂Ψ(d) exactly if ξ ∈ K and ⟨ξ, d⟩ = Ψ(d); the gap is put into the units of a force. An
        # increment so small that its direction is rounding may as well be none, which is wrong by
        # its pull.
        speed = self.largest(d)
        gap = np.maximum(step.value - _dot(xi, d), 0.0)
        along = np.divide(gap, speed, out=np.zeros_like(gap), where=speed > 0.0)
        along = np.minimum(along, self.largest(step.pull))
        return np.maximum(along, self.largest(outside))

    def size(self) -> Array:
        return np.full(len(self.phases), self._size)

    @cached_property
    def _size(self) -> float:
        s = float(self.phases[0])
        n = self.dissipation.dimension
        return max(
            self.dissipation.value(s, sign * unit) for unit in np.eye(n) for sign in (1.0, -1.0)
        )

    def moving(self, d: Array) -> Array:
        return np.count_nonzero(d, axis=1)

    def total(self, d: Array) -> Array:
        return self.largest(d)

    def before(self, first: Self) -> Self:
        return self if first is self else replace(self, phases=_shifted(self.phases, first.phases))

    def row(self, k: int) -> Self:
        return self if len(self.phases) == 1 else replace(self, phases=self.phases[k : k + 1])
