"""Weighted l1 norms: every component has its own threshold, K(s) is a box."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import DeclarationError
from stickslip.rate_independent.dissipation.base import Array, Average, Dissipation
from stickslip.rate_independent.dissipation.phase import Varying, read, wrapped
from stickslip.rate_independent.dissipation.stretches import Rows, Sampled, Stretches

if TYPE_CHECKING:
    from stickslip.rate_independent.averaging.cones import ConeForm


@dataclass(frozen=True, eq=False)
class WeightedL1(Dissipation):
    """Ψ(s, v) = Σ ρᵢ⁺(s) max(vᵢ, 0) + ρᵢ⁻(s) max(−vᵢ, 0); K(s) is the box [−ρ⁻(s), ρ⁺(s)].

    Parameters
    ----------
    weights : array of shape (n,), callable s -> array of shape (n,), or list of formulas in ``s``
        ρ⁺ ≥ 0.
    lower : the same, optional
        ρ⁻ ≥ 0; by default ρ⁺.

    Raises
    ------
    DeclarationError
        If a weight is negative or not finite at a phase, or sizes do not fit.

    Notes
    -----
    A callable is asked for many phases when the potential is averaged. If it also takes an array of n phases and
    returns each weight at its own (as ``lambda s: 2 + np.cos(2*np.pi*(s - x))`` does), a million weights are averaged
    in seconds.
    """

    weights: Any
    lower: Any = None
    above: Varying = field(init=False, repr=False)
    below: Varying = field(init=False, repr=False)

    def __post_init__(self) -> None:
        above = read_weights(self.weights, "weights")
        below = above if self.lower is None else read_weights(self.lower, "lower")
        if above.shape != below.shape:
            raise DeclarationError(
                "lower", f"it has {below.shape[0]} components, but there are {above.shape[0]} weights", "Give as many"
            )
        object.__setattr__(self, "above", above)
        object.__setattr__(self, "below", below)

    @property
    def dimension(self) -> int:
        return self.above.shape[0]

    @property
    def depends_on_phase(self) -> bool:
        return self.above.depends_on_phase or self.below.depends_on_phase

    def bounds(self, s: float = 0.0) -> tuple[Array, Array]:
        """Lower and upper end of the box, shape (n,) each, lower ≤ 0 ≤ upper."""
        upper = nonnegative(self.above, s)
        return -(upper if self.below is self.above else nonnegative(self.below, s)), upper

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        v = self.vector(v, "v")
        lower, upper = self.bounds(s)
        return float(np.maximum(lower * v, upper * v).sum())

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        v = self.vector(v, "v")
        lower, upper = self.bounds(s)
        return np.where(v > 0, upper, np.where(v < 0, lower, 0.0))

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        xi = self.vector(xi, "xi")
        lower, upper = self.bounds(s)
        return float(np.maximum(lower - xi, xi - upper).max(initial=-np.inf))

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The point of the box nearest to ξ; in a metric by principal pivoting, exact up to rounding."""
        from stickslip.rate_independent.dissipation.projections import nearest_in_box

        xi, (lower, upper), M = self.vector(xi, "xi"), self.bounds(s), self.metric(metric)
        return np.clip(xi, lower, upper) if M is None else nearest_in_box(M, xi, lower, upper)

    def projection(self, xi: Array, s: float = 0.0) -> tuple[Array, Array]:
        lower, upper = self.bounds(s)
        return np.clip(xi, lower, upper), np.diag(((lower < xi) & (xi < upper)).astype(float))

    def cone_form(self, s: float) -> ConeForm:
        from stickslip.rate_independent.averaging.cones import polyhedron

        (lower, upper), identity = self.bounds(s), np.eye(self.dimension)
        return polyhedron(np.vstack([identity, -identity]), np.concatenate([upper, -lower]))

    def sampled(self, phases: Array) -> Sampled:
        upper = nonnegative_over(self.above, phases)
        return SampledBoxes(-(upper if self.below is self.above else nonnegative_over(self.below, phases)), upper)

    @property
    def bounded(self) -> bool:
        return self.above.bounded and self.below.bounded

    def over(self, low: Array, high: Array) -> Stretches:
        above = self.above.chord(low, high)
        below = above if self.below is self.above else self.below.chord(low, high)
        start, end = SampledBoxes(-below.start, above.start), SampledBoxes(-below.end, above.end)
        return StretchesOfBoxes(start, end, below.off, above.off)

    def average(self, tolerance: float = 1e-8) -> Average:
        """Each weight becomes its minimum over the phase, refined to rounding; `tolerance` is not needed."""
        from stickslip.rate_independent.averaging.closed_forms import average_weighted_l1

        return average_weighted_l1(self)


@dataclass(frozen=True, eq=False)
class SampledBoxes(Rows, Sampled):
    """Boxes at m phases by their ends, shape (m, n)."""

    lower: Array
    upper: Array

    def support(self, v: Array) -> Array:
        return np.maximum(self.lower * v, self.upper * v).sum(axis=1)

    def excess(self, xi: Array) -> Array:
        return np.maximum(self.lower - xi, xi - self.upper).max(axis=1)

    def nearest(self, xi: Array) -> Array:
        return np.clip(xi, self.lower, self.upper)


@dataclass(frozen=True, eq=False)
class StretchesOfBoxes(Rows, Stretches[SampledBoxes]):
    """Boxes on stretches of phases, and how far their faces may be from straight lines."""

    start: SampledBoxes
    end: SampledBoxes
    off_lower: Array
    off_upper: Array

    def between(self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array) -> Array:
        above = np.maximum(before - self.start.upper, after - self.end.upper) + self.off_upper
        below = np.maximum(self.start.lower - before, self.end.lower - after) + self.off_lower
        return (np.maximum(above, below) + off).max(axis=1)


def read_weights(given: object, where: str) -> Varying:
    """Thresholds as a vector that may depend on the phase, nonnegative at a few phases."""
    varying = read([given] if isinstance(given, str) else given, where)
    if len(varying.shape) != 1 or varying.shape[0] == 0:
        raise DeclarationError(
            where, f"it has the shape {varying.shape}, but one threshold for each component is needed", "Give a vector"
        )
    for s in varying.looks:
        nonnegative(varying, s)
    return varying


def nonnegative(thresholds: Varying, s: float) -> Array:
    """Thresholds at phase s; refuses negative ones, unless they vanish up to rounding."""
    value = thresholds.at(s)
    least = value.min(initial=0.0)
    if least >= 0.0:
        return value
    if least < -1e-13 * thresholds.scale:
        i = int(value.argmin())
        when = f" at phase s = {wrapped(s):g}" if thresholds.depends_on_phase else ""
        raise DeclarationError(
            thresholds.where,
            f"component {i} is {value[i]:.6g}{when}, but a threshold cannot be negative",
            "Write max(..., 0) where it may vanish",
        )
    return np.maximum(value, 0.0)


def nonnegative_over(thresholds: Varying, phases: Array) -> Array:
    """Thresholds at several phases, shape (m, n)."""
    values = thresholds.over(phases)
    for s in phases[(values < 0.0).any(axis=1)]:
        nonnegative(thresholds, float(s))
    return np.maximum(values, 0.0)
