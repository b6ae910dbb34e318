"""Polytopes: crystalline friction, given by vertices or by half-spaces."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.numerics.levels import COMPUTED_ZERO
from stickslip.rate_independent.averaging.minima import Minima, least_thresholds
from stickslip.rate_independent.averaging.optimal_motion import (
    VANISHING_THRESHOLD,
    measure_with_sum,
)
from stickslip.rate_independent.averaging.semi_infinite import Intersection, lineality
from stickslip.rate_independent.dissipation.polytopes import (
    QHULL_UP_TO,
    HalfspacesOnIntervals,
    HullsOnIntervals,
    SampledHalfspaces,
    facets,
    sampled_hulls,
)
from stickslip.rate_independent.sets.cones import ConeForm, hull, polyhedron, solve_cones
from stickslip.rate_independent.sets.phase_intervals import AtPhases, PhaseIntervals
from stickslip.rate_independent.sets.potential import (
    Average,
    ClosedForm,
    Dissipation,
    OptimalMotion,
)
from stickslip.rate_independent.sets.projections import (
    nearest_and_faces,
    nearest_in_hull,
    nearest_in_polyhedron,
    onto_span,
    weights_in_hull,
)
from stickslip.rate_independent.sets.thresholds import nonnegative, nonnegative_over
from stickslip.rate_independent.signals.reading import read_phase
from stickslip.rate_independent.signals.signal import (
    SAMPLE_PHASES,
    Signal,
    not_periodic,
    wrapped,
)
from stickslip.results import listed

_NARROW = 1e-6  # ratio of distances of half-spaces below which 0 is too near to one for Qhull
_UNBOUNDED = 1e-10  # residual of the sum of unit normals of a bounded polytope
_PERIODIC = 1e-8  # largest relative change of a support over a period, as given by the vertices


@dataclass(frozen=True, eq=False)
class Polytope(Dissipation, kind="polytope"):
    """K(s) is the convex hull of vertices, or the set {ξ : N(s) ξ ≤ b(s)}.

    Parameters
    ----------
    vertices : array of shape (k, n), callable s -> array, or nested lists of formulas in ``s``
        Their convex hull has to contain 0.
    normals, offsets : arrays of shape (m, n) and (m,), or the same of the phase
        Instead of vertices: N and b ≥ 0. The polytope has to be bounded.

    Raises
    ------
    DeclarationError
        If 0 lies outside at a phase, the half-spaces do not bound every direction, or shapes do not
        match.
    """

    vertices: Any = None
    normals: Any = None
    offsets: Any = None
    corners: Signal | None = field(init=False, repr=False, default=None)
    faces: Signal | None = field(init=False, repr=False, default=None)
    reach: Signal | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        by_vertices = self.vertices is not None
        if by_vertices == (self.normals is not None) or (self.normals is None) != (
            self.offsets is None
        ):
            raise DeclarationError(
                "Polytope",
                "it needs vertices, or normals and offsets",
                "Give one of the two",
            )
        if by_vertices:
            object.__setattr__(self, "corners", read_table(self.vertices, "vertices"))
        else:
            self._read_halfspaces()
        for s in SAMPLE_PHASES if self.depends_on_phase else (0.0,):
            self._check(s)
        if self.depends_on_phase and (self.faces is None or self.faces.varies):
            self._check_period()

    def _read_halfspaces(self) -> None:
        faces = read_table(self.normals, "normals")
        reach = read_phase(self.offsets, "offsets", closes=not faces.varies)
        if reach.shape != faces.shape[:1]:
            raise DeclarationError(
                "offsets",
                f"its shape is {reach.shape}, but there are {faces.shape[0]} normals",
                "Give the same number of both",
            )
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "reach", reach)

    @property
    def dimension(self) -> int:
        return (self.corners or self._given(self.faces)).shape[1]

    @property
    def depends_on_phase(self) -> bool:
        return any(
            part is not None and part.varies for part in (self.corners, self.faces, self.reach)
        )

    def vertices_at(self, s: float = 0.0) -> Array | None:
        """Points whose convex hull is K(s), shape (k, n); None if they cannot be determined from
        half-spaces."""
        if self.corners is not None:
            return self.corners.at(s)
        return self._intersected(s) if self.depends_on_phase else self._fixed_vertices

    def halfspaces_at(self, s: float = 0.0) -> tuple[Array, Array]:
        """Unit normals, shape (m, n), and offsets b ≥ 0, shape (m,), of a polytope given by
        half-spaces."""
        normals = self._given(self.faces).at(s)
        offsets = nonnegative(self._given(self.reach), s)
        lengths = np.linalg.norm(normals, axis=1)
        if not lengths.all():
            when = f" at phase s = {wrapped(s):g}" if self.depends_on_phase else ""
            raise DeclarationError(
                "normals", f"row {int(lengths.argmin())} is 0{when}", "Give a nonzero vector"
            )
        return normals / lengths[:, None], offsets / lengths

    def facets_at(self, s: float = 0.0) -> tuple[Array, Array] | None:
        """Unit normals and offsets; None if they cannot be determined from the vertices."""
        return self.halfspaces_at(s) if self.corners is None else facets(self.corners.at(s))

    def halfspaces(self, phases: Array) -> tuple[Array, Array] | None:
        if self.faces is None:
            return None
        normals, offsets = zip(*map(self.halfspaces_at, phases.tolist()), strict=True)
        return np.concatenate(normals), np.concatenate(offsets)

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        v = self.vector(v, "v")
        value = float(self.exposed(v, s) @ v)
        if value < 0.0:
            self._check(s)
        return max(value, 0.0)

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        v = self.vector(v, "v")
        vertices = self.vertices_at(s)
        if vertices is not None:
            return vertices[int((vertices @ v).argmax())].copy()
        length = float(np.abs(v).max())
        if length == 0.0:
            return np.zeros(self.dimension)
        self._check(s)
        normals, offsets = self.halfspaces_at(s)
        size = float(offsets.max()) or 1.0
        return solve_cones([polyhedron(normals, offsets / size)], v / length)[0] * size

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        return float(self.sampled(np.array([s])).excess(self.vector(xi, "xi"))[0])

    def depth(self, xi: Array, s: float) -> float:
        """The excess if the facets are not known."""
        return super().excess(xi, s)

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The nearest point of the polytope by an active set, exact up to rounding."""
        xi = self.vector(xi, "xi")
        M = self.metric(metric)
        if self.corners is not None:
            return nearest_in_hull(self.corners.at(s), xi, M)
        return nearest_in_polyhedron(*self.halfspaces_at(s), xi, M)

    def projection(self, xi: Array, s: float = 0.0) -> tuple[Array, Array]:
        if self.corners is not None:
            points = self.corners.at(s)
            held = np.flatnonzero(weights_in_hull(points, xi) > 0.0)
            face = points[held[1:]] - points[held[0]]
            return nearest_in_hull(points, xi), onto_span(face)
        normals, offsets = self.halfspaces_at(s)
        y, active = nearest_and_faces(normals, offsets, xi)
        return y, np.eye(self.dimension) - onto_span(normals[active])

    def cone_form(self, s: float) -> ConeForm:
        return (
            polyhedron(*self.halfspaces_at(s)) if self.corners is None else hull(self.corners.at(s))
        )

    def average(self, tolerance: float = 1e-8) -> Average:
        """If the normals do not depend on the phase, each offset is replaced by its minimum over
        the phase; otherwise the average is computed to the tolerance."""
        if self.faces is None or self.faces.varies:
            return Intersection(self, tolerance)
        least = least_thresholds(self._given(self.reach))
        return AveragedPolytope(
            normals=self.faces.at(0.0), offsets=least.values, source=self, least=least
        )

    def sampled(self, phases: Array) -> AtPhases:
        if self.corners is None:
            faces = self._given(self.faces).over(phases)
            reach = nonnegative_over(self._given(self.reach), phases)
            return SampledHalfspaces(self, phases, faces, reach)
        return sampled_hulls(self, phases, self.corners.over(phases))

    @property
    def bounded(self) -> bool:
        return all(part is None or part.bounded for part in (self.corners, self.faces, self.reach))

    def over(self, low: Array, high: Array) -> PhaseIntervals[Any]:
        if self.corners is not None:
            points = self.corners.chord(low, high)
            hulls = sampled_hulls(self, low, points.start), sampled_hulls(self, high, points.end)
            return HullsOnIntervals(*hulls, points.off)
        N, b = self._given(self.faces).chord(low, high), self._given(self.reach).chord(low, high)
        ends = (
            SampledHalfspaces(self, low, N.start, b.start),
            SampledHalfspaces(self, high, N.end, b.end),
        )
        return HalfspacesOnIntervals(*ends, N.off, b.off)

    @cached_property
    def _fixed_vertices(self) -> Array | None:
        return self._intersected(0.0)

    def _intersected(self, s: float) -> Array | None:
        """Vertices of half-spaces around 0; None if they are too many or too close to 0."""
        if not 2 <= self.dimension <= QHULL_UP_TO:
            return None
        from scipy.spatial import HalfspaceIntersection

        normals, offsets = self.halfspaces_at(s)
        if offsets.min() <= _NARROW * offsets.max():
            return None
        vertices = HalfspaceIntersection(
            np.column_stack([normals, -offsets]), np.zeros(self.dimension)
        ).intersections
        if not np.isfinite(vertices).all():
            self._check(s)
        return vertices

    def _check(self, s: float) -> None:
        """Reject a phase at which K(s) does not contain 0 or is not bounded."""
        when = f" at phase s = {wrapped(s):g}" if self.depends_on_phase else ""
        if self.corners is not None:
            far = float(np.linalg.norm(self.project(np.zeros(self.dimension), s)))
            if far > COMPUTED_ZERO * np.abs(self.corners.at(s)).max():
                raise DeclarationError(
                    "vertices",
                    f"their convex hull does not contain 0{when} (distance {far:.6g})",
                    "Choose vertices that surround 0",
                )
            return
        from scipy.optimize import nnls

        normals, _ = self.halfspaces_at(s)
        # Bounded if the normals, each with a positive factor, add up to 0.
        left = nnls(normals.T, -normals.sum(axis=0), maxiter=30 * len(normals) + 100)[1]
        if left > _UNBOUNDED or np.linalg.matrix_rank(normals) < self.dimension:
            raise DeclarationError(
                "normals", f"the half-spaces do not bound every direction{when}", "Add a half-space"
            )

    def _check_period(self) -> None:
        """Reject vertices or half-spaces that describe another set after one period; their order
        may change."""
        later = [
            None if part is None else part.later(0.0)
            for part in (self.corners, self.faces, self.reach)
        ]
        after = Polytope(*later)
        for d in np.random.default_rng(0).normal(size=(3, self.dimension)):
            if abs(after.support(d) - self.support(d)) > _PERIODIC * self.support(d):
                raise not_periodic("vertices" if self.faces is None else "normals", 0.0)

    def _given(self, part: Signal | None) -> Signal:
        assert part is not None
        return part


@dataclass(frozen=True, eq=False)
class AveragedPolytope(Average, Polytope):
    """{ξ : N ξ ≤ min b(s)} for fixed normals N.

    Attributes
    ----------
    least : Minima
        Of the offsets over the phase: when each face comes closest to 0.
    """

    source: Polytope = field(kw_only=True)
    least: Minima = field(kw_only=True)

    @property
    def phases(self) -> Array:
        """Phases at which the faces are closest to 0, shape (m,)."""
        return self.least.phases

    @property
    def samples(self) -> int:
        return self.least.sampled

    @property
    def frictionless(self) -> Array:
        return lineality(self, VANISHING_THRESHOLD * float(self.halfspaces_at()[1].max()))

    @property
    def closed_form(self) -> ClosedForm:
        normals, offsets = (part.tolist() for part in self.halfspaces_at())
        distances = listed([f"{x:.6g}" for x in offsets], 8)
        words = f"support function of {len(offsets)} half-spaces, at the distances {distances}"
        return ClosedForm([words], {"normals": normals, "offsets": offsets})

    def optimal_motion(self, V: ArrayLike) -> OptimalMotion:
        """Motion along the normal of each face, at the phase at which it is closest to 0."""
        v = self.vector(V, "V")
        normals, offsets = self.halfspaces_at()
        size = float(offsets.max()) or 1.0
        length = float(np.abs(v).max())
        if length == 0.0:
            return OptimalMotion(np.zeros(0), np.zeros((0, len(v))), 0.0, 0.0)
        forms = [polyhedron(normals[[j]], offsets[[j]] / size) for j in range(len(normals))]
        xi, motions = solve_cones(forms, v / length)
        violation = float(
            np.max(
                (self.least.values - self.least.floors)
                / np.linalg.norm(self._given(self.faces).at(0.0), axis=1)
            )
        )
        return measure_with_sum(self.source, v, self.phases, motions * length, xi * size, violation)


def read_table(given: object, where: str) -> Signal:
    """Rows of vectors that may depend on the phase."""
    table = read_phase(given, where, closes=False)
    if len(table.shape) != 2 or 0 in table.shape:
        raise DeclarationError(
            where, f"its shape is {table.shape}", "Give one row of n numbers for each"
        )
    return table
