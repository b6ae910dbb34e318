"""Isotropic groups: planar friction, K(s) is a product of discs or balls."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.rate_independent.averaging.minima import Minima, least_thresholds
from stickslip.rate_independent.averaging.optimal_motion import axes, scheduled, vanishing
from stickslip.rate_independent.sets.cones import ConeForm, balls
from stickslip.rate_independent.sets.phase_intervals import (
    AtPhases,
    PhaseIntervals,
    RowWise,
    lengths,
)
from stickslip.rate_independent.sets.potential import (
    Average,
    ClosedForm,
    Dissipation,
    OptimalMotion,
)
from stickslip.rate_independent.sets.projections import nearest_in_metric, onto_balls
from stickslip.rate_independent.sets.stable_sets import Boxes, Discs
from stickslip.rate_independent.sets.thresholds import (
    nonnegative,
    nonnegative_over,
    nonnegative_rows,
    read_weights,
)
from stickslip.rate_independent.signals.signal import Signal


@dataclass(frozen=True, eq=False)
class GroupNorm(Dissipation, kind="group norm"):
    """Ψ(s, v) = Σ_g r_g(s) |v_g|₂; K(s) is a product of balls of radius r_g(s).

    Component c of group g is entry ``g*size + c``.

    Parameters
    ----------
    radii : array of shape (groups,), callable s -> array of shape (groups,), or list of formulas in
        ``s``
        r ≥ 0.
    size : int
        Number of components of a group: 2 for planar friction.

    Raises
    ------
    DeclarationError
        If a radius is negative or not finite at a phase, or shapes do not match.
    """

    radii: Any
    size: int = 2
    radius: Signal = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if (
            isinstance(self.size, bool)
            or not isinstance(self.size, int | np.integer)
            or self.size < 1
        ):
            raise DeclarationError(
                "size", f"{self.size!r} is not a number of components", "Give 1, 2, 3, ..."
            )
        object.__setattr__(self, "radius", read_weights(self.radii, "radii"))

    @property
    def groups(self) -> int:
        """Number of groups."""
        return self.radius.shape[0]

    @property
    def dimension(self) -> int:
        return self.groups * self.size

    @property
    def depends_on_phase(self) -> bool:
        return self.radius.varies

    def radii_at(self, s: float = 0.0) -> Array:
        """Radii of the balls, shape (groups,)."""
        return nonnegative(self.radius, s)

    def norms(self, v: Array) -> Array:
        """Length of each group, shape (groups,)."""
        return np.linalg.norm(v.reshape(self.groups, self.size), axis=1)

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        return float(self.radii_at(s) @ self.norms(self.vector(v, "v")))

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        return self._scaled(self.vector(v, "v"), self.radii_at(s))

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        return float((self.norms(self.vector(xi, "xi")) - self.radii_at(s)).max())

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The nearest point of the product of balls: each group is shortened or, in a metric, found
        by Newton's method to machine precision."""
        xi = self.vector(xi, "xi")
        radii = self.radii_at(s)
        M = self.metric(metric)
        if M is None:
            return self._scaled(xi, np.minimum(radii, self.norms(xi)))
        return nearest_in_metric(lambda x: onto_balls(x, radii, self.size), xi, M)

    def projection(self, xi: Array, s: float = 0.0) -> tuple[Array, Array]:
        return onto_balls(xi, self.radii_at(s), self.size)

    def _scaled(self, v: Array, lengths: Array) -> Array:
        """Each group with its direction and the given length; a group that is 0 stays 0."""
        norms = self.norms(v)
        factor = np.divide(lengths, norms, out=np.zeros_like(norms), where=norms > 0)
        return (v.reshape(self.groups, self.size) * factor[:, None]).ravel()

    def cone_form(self, s: float) -> ConeForm:
        return balls(self.radii_at(s), self.size)

    def sampled(self, phases: Array) -> AtPhases:
        return SampledBalls(self.size, nonnegative_over(self.radius, phases))

    def sets(self, phases: Array) -> Boxes | Discs:
        phases = phases if self.depends_on_phase else phases[:1]
        radii = nonnegative_rows(self.radius, phases)
        return Boxes(-radii, radii) if self.size == 1 else Discs(radii, self.size)

    @property
    def bounded(self) -> bool:
        return self.radius.bounded

    def over(self, low: Array, high: Array) -> PhaseIntervals[Any]:
        radii = self.radius.chord(low, high)
        start, end = SampledBalls(self.size, radii.start), SampledBalls(self.size, radii.end)
        return BallsOnIntervals(start, end, radii.off)

    def average(self, tolerance: float = 1e-8) -> AveragedGroupNorm:
        """Each radius is replaced by its minimum over the phase, to machine precision; `tolerance`
        is not used."""
        least = least_thresholds(self.radius)
        return AveragedGroupNorm(least.values, self.size, source=self, least=least)


@dataclass(frozen=True, eq=False)
class AveragedGroupNorm(Average, GroupNorm):
    """Σ min r_g |v_g|₂.

    Attributes
    ----------
    least : Minima
        Of the radii over the phase: when each group moves.
    """

    source: GroupNorm = field(kw_only=True)
    least: Minima = field(kw_only=True)

    @property
    def phases(self) -> Array:
        """Phases at which the groups move, shape (groups,)."""
        return self.least.phases

    @property
    def samples(self) -> int:
        return self.least.sampled

    @property
    def frictionless(self) -> Array:
        return axes(np.repeat(vanishing(self.radii_at()), self.size))

    @property
    def closed_form(self) -> ClosedForm:
        radii = self.radii_at().tolist()
        terms = [f"{r:.6g} |v_{{group {g}}}|" for g, r in enumerate(radii, start=1)]
        return ClosedForm(terms, {"radii": radii})

    def average(self, tolerance: float = 1e-8) -> Self:
        """Itself."""
        return self

    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        v = self.vector(V, "V")
        return scheduled(
            self.source,
            v,
            np.repeat(self.phases, self.size),
            float(self.least.floors @ self.norms(v)),
        )


@dataclass(frozen=True, eq=False)
class SampledBalls(RowWise, AtPhases):
    """Balls in R^size at m phases by their radii, shape (m, groups)."""

    size: int
    radii: Array

    def norms(self, v: Array) -> Array:
        """Length of each group of each row, shape (..., groups)."""
        return lengths(v.reshape(*v.shape[:-1], -1, self.size))

    def support(self, v: Array) -> Array:
        return (self.radii * self.norms(v)).sum(axis=1)

    def excess(self, xi: Array) -> Array:
        return (self.norms(xi) - self.radii).max(axis=1)

    def nearest(self, xi: Array) -> Array:
        norms = np.broadcast_to(self.norms(xi), self.radii.shape)
        factor = np.divide(self.radii, norms, out=np.ones(norms.shape), where=norms > self.radii)
        return np.repeat(factor, self.size, axis=1) * xi


@dataclass(frozen=True, eq=False)
class BallsOnIntervals(RowWise, PhaseIntervals[SampledBalls]):
    """Balls on phase intervals, with bounds of the deviations of their radii from straight
    lines."""

    start: SampledBalls
    end: SampledBalls
    off_radii: Array

    def between(
        self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array
    ) -> Array:
        # The length of a force that goes straight is convex.
        norms = self.start.norms
        beyond = np.maximum(norms(before) - self.start.radii, norms(after) - self.end.radii)
        return (beyond + self.off_radii + norms(off)).max(axis=1)
