"""Weighted l1 norms: every component has a separate threshold, and K(s) is a box."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.rate_independent.averaging.minima import Minima, least_thresholds
from stickslip.rate_independent.averaging.optimal_motion import axes, scheduled, vanishing
from stickslip.rate_independent.sets.cones import ConeForm, polyhedron
from stickslip.rate_independent.sets.phase_intervals import AtPhases, PhaseIntervals, RowWise
from stickslip.rate_independent.sets.potential import (
    Average,
    ClosedForm,
    Dissipation,
    OptimalMotion,
)
from stickslip.rate_independent.sets.projections import nearest_in_box
from stickslip.rate_independent.sets.stable_sets import Boxes
from stickslip.rate_independent.sets.thresholds import (
    nonnegative,
    nonnegative_over,
    nonnegative_rows,
    read_weights,
)
from stickslip.rate_independent.signals.signal import Signal


@dataclass(frozen=True, eq=False)
class WeightedL1(Dissipation, kind="weighted l1"):
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
        If a weight is negative or not finite at a phase, or shapes do not match.

    Notes
    -----
    A callable is evaluated at many phases when the potential is averaged. If it also accepts an
    array of n phases and returns weight i at phase i (as ``lambda s: 2 + np.cos(2*np.pi*(s - x))``
    does), a million weights are averaged in seconds.
    """

    weights: Any
    lower: Any = None
    above: Signal = field(init=False, repr=False)
    below: Signal = field(init=False, repr=False)

    def __post_init__(self) -> None:
        above = read_weights(self.weights, "weights")
        below = above if self.lower is None else read_weights(self.lower, "lower")
        if above.shape != below.shape:
            raise DeclarationError(
                "lower",
                f"it has {below.shape[0]} components, but there are {above.shape[0]} weights",
                "Give the same number of both",
            )
        object.__setattr__(self, "above", above)
        object.__setattr__(self, "below", below)

    @property
    def dimension(self) -> int:
        return self.above.shape[0]

    @property
    def depends_on_phase(self) -> bool:
        return self.above.varies or self.below.varies

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
        """The point of the box nearest to ξ; in a metric by principal pivoting, exact up to
        rounding."""
        xi, (lower, upper), M = self.vector(xi, "xi"), self.bounds(s), self.metric(metric)
        return np.clip(xi, lower, upper) if M is None else nearest_in_box(M, xi, lower, upper)

    def projection(self, xi: Array, s: float = 0.0) -> tuple[Array, Array]:
        lower, upper = self.bounds(s)
        return np.clip(xi, lower, upper), np.diag(((lower < xi) & (xi < upper)).astype(float))

    def cone_form(self, s: float) -> ConeForm:
        (lower, upper), identity = self.bounds(s), np.eye(self.dimension)
        return polyhedron(np.vstack([identity, -identity]), np.concatenate([upper, -lower]))

    def sampled(self, phases: Array) -> AtPhases:
        upper = nonnegative_over(self.above, phases)
        return SampledBoxes(
            -(upper if self.below is self.above else nonnegative_over(self.below, phases)), upper
        )

    def sets(self, phases: Array) -> Boxes:
        phases = phases if self.depends_on_phase else phases[:1]
        upper = nonnegative_rows(self.above, phases)
        lower = upper if self.below is self.above else nonnegative_rows(self.below, phases)
        return Boxes(-lower, upper)

    @property
    def thresholds(self) -> tuple[Signal, Signal] | None:
        return (self.above, self.below) if self.dimension == 1 else None

    @property
    def bounded(self) -> bool:
        return self.above.bounded and self.below.bounded

    def over(self, low: Array, high: Array) -> PhaseIntervals[Any]:
        above = self.above.chord(low, high)
        below = above if self.below is self.above else self.below.chord(low, high)
        start, end = SampledBoxes(-below.start, above.start), SampledBoxes(-below.end, above.end)
        return BoxesOnIntervals(start, end, below.off, above.off)

    def average(self, tolerance: float = 1e-8) -> AveragedWeightedL1:
        """Each weight is replaced by its minimum over the phase, to machine precision; `tolerance`
        is not used."""
        above = least_thresholds(self.above)
        below = above if self.below is self.above else least_thresholds(self.below)
        lower = None if below is above else below.values
        return AveragedWeightedL1(
            above.values, lower, source=self, least_above=above, least_below=below
        )


@dataclass(frozen=True, eq=False)
class AveragedWeightedL1(Average, WeightedL1):
    """Σ min ρᵢ⁺ max(vᵢ, 0) + min ρᵢ⁻ max(−vᵢ, 0).

    Attributes
    ----------
    least_above, least_below : Minima
        Of ρ⁺ and ρ⁻ over the phase.
    """

    source: WeightedL1 = field(kw_only=True)
    least_above: Minima = field(kw_only=True)
    least_below: Minima = field(kw_only=True)

    @property
    def upper_phases(self) -> Array:
        """Phases at which the components move up, shape (n,)."""
        return self.least_above.phases

    @property
    def lower_phases(self) -> Array:
        """Phases at which the components move down, shape (n,)."""
        return self.least_below.phases

    @property
    def samples(self) -> int:
        return max(self.least_above.sampled, self.least_below.sampled)

    @property
    def frictionless(self) -> Array:
        lower, upper = self.bounds()
        return axes(vanishing(upper - lower))

    @property
    def closed_form(self) -> ClosedForm:
        lower, upper = self.bounds()
        numbers = {"upper": upper.tolist(), "lower": (-lower).tolist()}
        terms = [
            f"{up:.6g} |v_{i}|"
            if up == down
            else f"{up:.6g} max(v_{i}, 0) + {down:.6g} max(-v_{i}, 0)"
            for i, (up, down) in enumerate(zip(*numbers.values(), strict=True), start=1)
        ]
        return ClosedForm(terms, {"thresholds": numbers})

    def average(self, tolerance: float = 1e-8) -> Self:
        """Itself."""
        return self

    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        v = self.vector(V, "V")
        when = np.where(v >= 0, self.upper_phases, self.lower_phases)
        bound = (
            np.maximum(v, 0.0) @ self.least_above.floors
            - np.minimum(v, 0.0) @ self.least_below.floors
        )
        return scheduled(self.source, v, when, float(bound))


@dataclass(frozen=True, eq=False)
class SampledBoxes(RowWise, AtPhases):
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
class BoxesOnIntervals(RowWise, PhaseIntervals[SampledBoxes]):
    """Boxes on phase intervals, with bounds of the deviations of their faces from straight
    lines."""

    start: SampledBoxes
    end: SampledBoxes
    off_lower: Array
    off_upper: Array

    def between(
        self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array
    ) -> Array:
        above = np.maximum(before - self.start.upper, after - self.end.upper) + self.off_upper
        below = np.maximum(self.start.lower - before, self.end.lower - after) + self.off_lower
        return (np.maximum(above, below) + off).max(axis=1)
