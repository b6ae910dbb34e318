"""Polytopes at many phases and between them: half-spaces, and convex hulls of points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.kept import cached_property
from stickslip.numerics.levels import FEW_ROUNDINGS, LAST_DIGITS
from stickslip.rate_independent.sets.phase_intervals import (
    AtPhases,
    PhaseIntervals,
    RowWise,
    lengths,
)
from stickslip.rate_independent.sets.projections import (
    nearest_in_hull,
    nearest_in_polyhedron,
    weights_in_hull,
)

if TYPE_CHECKING:
    from stickslip.rate_independent.dissipation.polytope import Polytope

_PLANAR_UP_TO = 16  # number of points of planar hulls up to which all pairs are tested
_FLAT = 1e-12  # width of a hull without interior, relative to its size
QHULL_UP_TO = 6  # dimension above which the vertices of a polytope are too many


def facets(points: Array) -> tuple[Array, Array] | None:
    """Unit normals and offsets of the facets of a convex hull; None if they are too many, or the
    hull is flat."""
    if points.shape[1] == 1:
        return np.array([[1.0], [-1.0]]), np.array([points.max(), -points.min()])
    if points.shape[1] > QHULL_UP_TO:
        return None
    from scipy.spatial import ConvexHull, QhullError

    try:
        equations = ConvexHull(points).equations
    except QhullError:
        return None
    return equations[:, :-1], -equations[:, -1]


@dataclass(frozen=True, eq=False)
class SampledHalfspaces(RowWise, AtPhases):
    """{ξ : normals ξ ≤ offsets} at m phases, shapes (m, k, n) and (m, k)."""

    potential: Polytope
    phases: Array
    normals: Array
    offsets: Array

    @cached_property
    def sizes(self) -> Array:
        """Lengths of the normals, shape (m, k)."""
        return lengths(self.normals)

    def support(self, v: Array) -> Array:
        v = np.broadcast_to(v, (len(self.phases), v.shape[-1]))
        return np.array(
            [self.potential.support(row, s) for row, s in zip(v, self.phases.tolist(), strict=True)]
        )

    def beyond(self, xi: Array) -> Array:
        """normals ξ − offsets, shape (m, k)."""
        return (
            np.einsum("mkn,...n->mk" if xi.ndim == 1 else "mkn,mn->mk", self.normals, xi)
            - self.offsets
        )

    def excess(self, xi: Array) -> Array:
        """The largest distance from a half-space, a lower bound of the distance from their
        intersection."""
        return (self.beyond(xi) / self.sizes).max(axis=1)

    def nearest(self, xi: Array) -> Array:
        return np.array(
            [
                self._nearest(row, k)
                for k, row in enumerate(np.broadcast_to(xi, (len(self.phases), xi.shape[-1])))
            ]
        )

    def _nearest(self, xi: Array, k: int) -> Array:
        return nearest_in_polyhedron(
            self.normals[k] / self.sizes[k][:, None], self.offsets[k] / self.sizes[k], xi
        )


@dataclass(frozen=True, eq=False)
class HalfspacesOnIntervals(RowWise, PhaseIntervals[SampledHalfspaces]):
    """Half-spaces on phase intervals, with bounds of the deviations of normals and offsets from
    straight lines."""

    start: SampledHalfspaces
    end: SampledHalfspaces
    off_normals: Array
    off_offsets: Array

    def between(
        self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array
    ) -> Array:
        N, M = self.start.normals, self.end.normals
        # The product of two straight lines is off by a quarter of the product of their rises.
        bent = np.abs(np.einsum("mkn,mn->mk", M - N, after - before)) / 4.0
        bent += np.einsum("mkn,mn->mk", self.off_normals, np.maximum(np.abs(before), np.abs(after)))
        bent += np.einsum("mkn,mn->mk", np.maximum(np.abs(N), np.abs(M)) + self.off_normals, off)
        beyond = (
            np.maximum(self.start.beyond(before), self.end.beyond(after)) + bent + self.off_offsets
        )
        # The length of an intermediate normal: at least its component along the mean of both ends.
        mean = (N + M) / np.maximum(lengths(N + M), np.finfo(float).tiny)[:, :, None]
        moved = lengths(self.off_normals)
        short = (
            np.minimum(np.einsum("mkn,mkn->mk", N, mean), np.einsum("mkn,mkn->mk", M, mean)) - moved
        )
        long = np.maximum(self.start.sizes, self.end.sizes) + moved
        with np.errstate(divide="ignore"):
            out = np.where(beyond > 0.0, beyond / np.maximum(short, 0.0), beyond / long)
        return np.maximum(ends, out.max(axis=1))


@dataclass(frozen=True, eq=False)
class SampledHulls(RowWise, AtPhases):
    """Convex hulls of points (m, k, n) at m phases, and their facets where `known`."""

    potential: Polytope
    phases: Array
    points: Array
    known: NDArray[np.bool_]
    normals: Array
    offsets: Array

    def joined(self, more: Any) -> Self:
        most = max(self.offsets.shape[1], more.offsets.shape[1])
        return super(SampledHulls, self._padded(most)).joined(more._padded(most))

    def _padded(self, count: int) -> Self:
        index = np.arange(count) % self.offsets.shape[1]
        return replace(self, normals=self.normals[:, index], offsets=self.offsets[:, index])

    def support(self, v: Array) -> Array:
        return np.einsum("mkn,...n->mk" if v.ndim == 1 else "mkn,mn->mk", self.points, v).max(
            axis=1
        )

    def excess(self, xi: Array) -> Array:
        rows = np.broadcast_to(xi, (len(self.phases), xi.shape[-1]))
        excess = (np.einsum("mfn,mn->mf", self.normals, rows) - self.offsets).max(axis=1)
        for k in np.flatnonzero(~self.known):
            excess[k] = self.potential.depth(rows[k], float(self.phases[k]))
        # At a sharp corner, the distance of a point outside of facets exceeds the distances from
        # these.
        for k in np.flatnonzero(excess > FEW_ROUNDINGS * np.abs(rows).max(axis=1)):
            excess[k] = max(
                excess[k], float(np.linalg.norm(rows[k] - self._nearest(rows[k], int(k))))
            )
        return excess

    def nearest(self, xi: Array) -> Array:
        return np.array(
            [
                self._nearest(row, k)
                for k, row in enumerate(np.broadcast_to(xi, (len(self.phases), xi.shape[-1])))
            ]
        )

    def _nearest(self, xi: Array, k: int) -> Array:
        return nearest_in_hull(self.points[k], xi)


def sampled_hulls(potential: Polytope, phases: Array, points: Array) -> SampledHulls:
    """Hulls of points at m phases, shape (m, k, n)."""
    if points.shape[2] == 2 and points.shape[1] <= _PLANAR_UP_TO and len(points):
        return SampledHulls(potential, phases, points, *_planar_facets(points))
    found = [facets(corners) for corners in points]
    most = max((len(f[1]) for f in found if f is not None), default=1)
    normals = np.zeros((len(points), most, points.shape[2]))
    offsets = np.zeros((len(points), most))
    for k, known in enumerate(found):
        if known is not None:
            index = np.arange(most) % len(known[1])
            normals[k], offsets[k] = known[0][index], known[1][index]
    return SampledHulls(
        potential, phases, points, np.array([f is not None for f in found], bool), normals, offsets
    )


def _planar_facets(points: Array) -> tuple[NDArray[np.bool_], Array, Array]:
    """Convex hulls of points in the plane (m, k, 2): whether they have an interior, and the normals
    and offsets of their facets.

    A facet is a line through two points with all others on one side. Rows with fewer facets have
    one repeatedly.
    """
    m, k, _ = points.shape
    along = (points[:, None] - points[:, :, None]).reshape(m, k * k, 2)
    sizes = lengths(along)
    # A normal is the difference of two points, turned by a right angle.
    normals = (
        np.stack([along[:, :, 1], -along[:, :, 0]], axis=2)
        / np.where(sizes > 0.0, sizes, 1.0)[:, :, None]
    )
    reach = np.einsum("mfn,mkn->mfk", normals, points)
    offsets = np.repeat(points, k, axis=1)
    size = np.abs(points).max(axis=(1, 2))
    offsets = np.einsum("mfn,mfn->mf", normals, offsets)
    # A line through two points is a facet if no point is beyond it.
    facet = (sizes > 0.0) & (reach.max(axis=2) <= offsets + LAST_DIGITS * size[:, None])
    width = np.where(facet, reach.max(axis=2) - reach.min(axis=2), np.inf).min(axis=1)
    known = facet.any(axis=1) & (width > _FLAT * size)
    order = np.argsort(~facet, axis=1, kind="stable")[:, : max(int(facet.sum(axis=1).max()), 1)]
    chosen = np.where(np.take_along_axis(facet, order, axis=1), order, order[:, :1])
    normals = np.take_along_axis(normals, chosen[:, :, None], axis=1)
    return known, normals, np.take_along_axis(reach.max(axis=2), chosen, axis=1)


@dataclass(frozen=True, eq=False)
class HullsOnIntervals(RowWise, PhaseIntervals[SampledHulls]):
    """Convex hulls on phase intervals, with bounds of the deviations of their points from straight
    lines."""

    start: SampledHulls
    end: SampledHulls
    off_points: Array

    def between(
        self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array
    ) -> Array:
        first, last = self.start.excess(before), self.end.excess(after)
        moved = lengths(self.off_points).max(axis=1)
        bent = lengths(off)
        # Bound of the distance of any point of the hull, and of any force, from its position at an
        # end.
        step = lengths(self.end.points - self.start.points).max(axis=1) + lengths(after - before)
        out = np.minimum(first, last) + step + moved + bent
        for k in np.flatnonzero(out > enough):
            own = _held(self.start.points[k], self.end.points[k], before[k], after[k])
            out[k] = min(out[k], own + moved[k] + bent[k])
        return np.maximum(ends, out)


def _held(start: Array, end: Array, before: Array, after: Array) -> float:
    """Bound of the excess of an affine force over a hull of affine points.

    Weights u with Σ u_k p_k = ξ at both ends, from the few points that support the force in the
    middle, are interpolated linearly: then Σ u_k p_k differs from the force by at most a quarter of
    Σ Δu_k Δp_k, plus the residuals at the ends.
    """
    chosen = np.flatnonzero(weights_in_hull(0.5 * (start + end), 0.5 * (before + after)) > 0.0)
    p, q = start[chosen], end[chosen]
    u, v = (_weights(points, xi) for points, xi in ((p, before), (q, after)))
    missing = max(
        float(np.linalg.norm(w @ points - xi)) for w, points, xi in ((u, p, before), (v, q, after))
    )
    return missing + 0.25 * float(np.linalg.norm((v - u) @ (q - p)))


def _weights(points: Array, xi: Array) -> Array:
    """Nonnegative weights with the sum 1 whose mean of the points is ξ, or near it."""
    table = np.vstack([points.T, np.full(len(points), float(np.abs(points).max()) or 1.0)])
    # Least squares, with the sum as one more equation of the size of the others.
    weights = np.linalg.lstsq(table, np.append(xi, table[-1, 0]), rcond=None)[0].clip(min=0.0)
    return weights / weights.sum() if weights.any() else np.full(len(points), 1.0 / len(points))
