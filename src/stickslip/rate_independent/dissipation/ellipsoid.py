"""Ellipsoids: anisotropic friction."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.numerics.levels import COMPUTED_ZERO, ROUNDED_TERM, SYMMETRIC
from stickslip.rate_independent.averaging.semi_infinite import Intersection
from stickslip.rate_independent.dissipation.parabolas import Parabolas
from stickslip.rate_independent.sets.cones import ConeForm, ellipsoid
from stickslip.rate_independent.sets.phase_intervals import (
    NOWHERE_NEAR,
    AtPhases,
    Near,
    PhaseIntervals,
    RowWise,
    lengths,
)
from stickslip.rate_independent.sets.potential import Dissipation
from stickslip.rate_independent.sets.projections import nearest_in_ellipsoid, secular
from stickslip.rate_independent.signals.reading import read_phase
from stickslip.rate_independent.signals.signal import SAMPLE_PHASES, Signal, wrapped


@dataclass(frozen=True, eq=False)
class Ellipsoid(Dissipation, kind="ellipsoid"):
    """Ψ(s, v) = √⟨v, S(s) v⟩; K(s) = {ξ : ⟨ξ, S(s)⁻¹ ξ⟩ ≤ 1}.

    Parameters
    ----------
    shape : array of shape (n, n), callable s -> array of shape (n, n), or nested lists of formulas
        in ``s``
        S, symmetric and positive semidefinite: the eigenvectors are the axes, the eigenvalues their
        semi-axes squared. Along an axis of length 0 friction vanishes.

    Raises
    ------
    DeclarationError
        If S is not symmetric or has a negative eigenvalue at a phase.
    """

    shape: Any
    matrix: Signal = field(init=False, repr=False)
    _fixed_root: Array | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        matrix = read_phase(self.shape, "shape")
        if len(matrix.shape) != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0:
            raise DeclarationError("shape", f"its shape {matrix.shape} is not square", "Give n x n")
        object.__setattr__(self, "matrix", matrix)
        self.sampled(np.array(SAMPLE_PHASES))
        if not matrix.varies:
            object.__setattr__(self, "_fixed_root", self.root_at(0.0))

    @property
    def dimension(self) -> int:
        return self.matrix.shape[0]

    @property
    def depends_on_phase(self) -> bool:
        return self.matrix.varies

    def root_at(self, s: float = 0.0) -> Array:
        """R of shape (n, r) and full rank with S = R Rᵀ: its columns are the semi-axes, without
        those of length 0.

        Axes shorter than about 1e-8 of the longest are below the rounding errors of S and have
        length 0.
        """
        if self._fixed_root is not None:
            return self._fixed_root
        ((axes,), (squares,), (floor,)) = self._axes(self.matrix.at(s)[None], np.array([s]))
        kept = squares > floor
        return axes[:, kept] * np.sqrt(squares[kept])

    def _formula(self) -> str:
        S = self.matrix.value(0.0)
        terms = (f"({x!r})*v{i + 1}*v{j + 1}" for (i, j), x in np.ndenumerate(S) if x != 0.0)
        return f"sqrt({' + '.join(terms) or '0'})"

    def _axes(self, S: Array, phases: Array) -> tuple[Array, Array, Array]:
        """Eigenvectors (m, n, n) and eigenvalues (m, n) of S at several phases, and their rounding
        errors (m,)."""
        size = np.abs(S).max(axis=(1, 2))
        transposed = S.transpose(0, 2, 1)
        lopsided = np.abs(S - transposed).max(axis=(1, 2))
        if (lopsided > SYMMETRIC * size).any():
            k = int((lopsided - SYMMETRIC * size).argmax())
            reason = (
                f"it is not symmetric{self._when(phases[k])} (S - S^T reaches {lopsided[k]:.3g})"
            )
            raise DeclarationError("shape", reason, "Give a symmetric matrix")
        axes, squares, floor = _axes(S)
        if (squares[:, 0] < -COMPUTED_ZERO * size).any():
            k = int((squares[:, 0] + COMPUTED_ZERO * size).argmin())
            reason = f"it has the negative eigenvalue {squares[k, 0]:.6g}{self._when(phases[k])}"
            raise DeclarationError("shape", reason, "Give a positive semidefinite matrix")
        return axes, squares, floor

    def _when(self, s: float) -> str:
        return f" at phase s = {wrapped(s):g}" if self.depends_on_phase else ""

    def support(self, v: ArrayLike, s: float = 0.0) -> float:
        return float(np.linalg.norm(self.vector(v, "v") @ self.root_at(s)))

    def exposed(self, v: ArrayLike, s: float = 0.0) -> Array:
        root = self.root_at(s)
        along = self.vector(v, "v") @ root
        length = np.linalg.norm(along)
        # The gradient of √⟨v, S v⟩ is S v/|Rᵀv| with S = R Rᵀ.
        return root @ (along / length) if length > 0 else np.zeros(self.dimension)

    def project(self, xi: ArrayLike, s: float = 0.0, metric: ArrayLike | None = None) -> Array:
        """The nearest point of the ellipsoid by its secular equation, exact up to rounding."""
        return nearest_in_ellipsoid(self.root_at(s), self.vector(xi, "xi"), self.metric(metric))

    def projection(self, xi: Array, s: float = 0.0) -> tuple[Array, Array]:
        at = self.sampled(np.array([s]))
        along = at.along(xi[None])[0]
        squares = at.kept[0]
        axes = at.axes[0]
        ((u,), (multiplier,)) = secular(np.sqrt(squares)[None] * along, squares[None])
        kept = squares > 0.0
        if multiplier == 0.0:
            return axes @ np.where(kept, along, 0.0), (axes * kept) @ axes.T
        # y = S(S + μ)⁻¹ξ on the boundary; its derivative lacks the direction in which μ changes.
        shifted = squares + multiplier
        bent = squares * along / np.square(shifted)
        slope = np.diag(squares / shifted) - np.outer(bent, bent) / float(bent @ (along / shifted))
        y = np.sqrt(squares) * u / np.linalg.norm(u)
        return axes @ y, axes @ slope @ axes.T

    def excess(self, xi: ArrayLike, s: float = 0.0) -> float:
        """Signed distance of ξ from K(s): the distance outside, and minus a lower bound of the
        depth inside."""
        return float(self.sampled(np.array([s])).excess(self.vector(xi, "xi"))[0])

    def sampled(self, phases: Array) -> SampledEllipsoid:
        return SampledEllipsoid(*self._axes(self.matrix.over(phases), phases))

    @property
    def bounded(self) -> bool:
        return self.matrix.bounded

    def over(self, low: Array, high: Array) -> PhaseIntervals[Any]:
        S = self.matrix.chord(low, high)
        start, end = (
            SampledEllipsoid(*self._axes(at, s)) for at, s in ((S.start, low), (S.end, high))
        )
        # ⟨v, E v⟩ ≤ Σ r_i v_i² with the sums r_i of the rows of |E|: an ellipsoid that every S in
        # between contains.
        shrink = S.off.sum(axis=2)[:, :, None] * np.eye(self.dimension)
        inner = (SampledEllipsoid(*_axes(at - shrink)) for at in (S.start, S.end))
        off = np.sqrt(np.square(S.off).sum(axis=(1, 2)))
        return EllipsoidsOnIntervals(start, end, np.maximum(off - start.floor, 0.0), *inner)

    @cached_property
    def _parabolas(self) -> Parabolas | None:
        return Parabolas.of(self.matrix) if self.matrix.differentiable else None

    def closest(self, phases: Array, xi: Array) -> Array:
        return phases if self._parabolas is None else self._parabolas.vertices(phases, xi)

    def around(self, phases: Array, xi: Array, enough: float) -> Near:
        if self._parabolas is None:
            return NOWHERE_NEAR
        # ξ lies in K(s) if S − ξξᵀ is positive semidefinite; if S + δ − ξξᵀ is, outside by √(λ + δ)
        # − √λ at most, λ at least the least eigenvalue of S.
        low, high, below, least = self._parabolas.around(phases, xi)
        with np.errstate(invalid="ignore"):
            bound = below / np.sqrt(np.maximum(least, below))
        widest = np.where(bound <= enough, high - low, 0.0).argmax(axis=0), np.arange(len(phases))
        kept = bound[widest] <= enough
        return Near(*(rows[widest][kept] for rows in (low, high, bound)))

    def cone_form(self, s: float) -> ConeForm:
        return ellipsoid(self.root_at(s))

    def average(self, tolerance: float = 1e-8) -> Intersection:
        return Intersection(self, tolerance)


def _axes(S: Array) -> tuple[Array, Array, Array]:
    """Eigenvectors and eigenvalues of matrices (m, n, n), and rounding errors of the
    eigenvalues."""
    squares, axes = np.linalg.eigh(S / 2 + S.transpose(0, 2, 1) / 2)  # a sum of two may overflow
    return axes, squares, ROUNDED_TERM * S.shape[1] * np.abs(S).max(axis=(1, 2))


@dataclass(frozen=True, eq=False)
class SampledEllipsoid(RowWise, AtPhases):
    """Ellipsoids at m phases by their axes (m, n, n), the squares of their lengths (m, n) and the
    rounding of these."""

    axes: Array
    squares: Array
    floor: Array

    @cached_property
    def kept(self) -> Array:
        """Squared lengths, without rounding errors."""
        return np.where(self.squares > self.floor[:, None], self.squares, 0.0)

    @cached_property
    def narrowest(self) -> Array:
        """Length of the shortest axis, shape (m,)."""
        return np.sqrt(self.kept.min(axis=1))

    def along(self, x: Array) -> Array:
        """Components along the axes, shape (m, n)."""
        return np.einsum("...i,...ij->...j", x, self.axes)

    def support(self, v: Array) -> Array:
        return np.sqrt((np.square(self.along(v)) * self.kept).sum(axis=1))

    def _beyond(self, along: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The gauge of points along the axes, and which are outside; a flat axis has no inside."""
        squares = np.divide(
            np.square(along), self.kept, out=np.zeros_like(along), where=self.kept > 0.0
        )
        gauge = np.sqrt(squares.sum(axis=1))
        return gauge, (gauge > 1.0) | ((along != 0.0) & (self.kept == 0.0)).any(axis=1)

    def excess(self, xi: Array) -> Array:
        along = self.along(xi)
        gauge, beyond = self._beyond(along)
        # A ball of the shortest axis fits around 0, so that one of 1 − gauge times that fits around
        # ξ.
        depth = self.narrowest * (gauge - 1.0)
        if beyond.any():
            far = self.taken(beyond)
            depth[beyond] = lengths(along[beyond] - far.clipped(along[beyond]))
        return depth

    def nearest(self, xi: Array) -> Array:
        along = self.along(xi)
        y = np.einsum("...j,...ij->...i", self.clipped(along), self.axes)
        return np.where(self._beyond(along)[1][:, None], y, xi)

    def clipped(self, along: Array) -> Array:
        """Nearest points of points outside, or in the flat that short axes leave, both along the
        axes."""
        half = np.sqrt(self.kept)
        u, multiplier = secular(half * along, self.kept)
        shrunk = np.minimum(1.0, 1.0 / np.maximum(lengths(u), np.finfo(float).tiny))
        return np.where(
            (multiplier > 0.0)[:, None],
            half * u * shrunk[:, None],
            np.where(self.kept > 0.0, along, 0.0),
        )


@dataclass(frozen=True, eq=False)
class EllipsoidsOnIntervals(RowWise, PhaseIntervals[SampledEllipsoid]):
    """Ellipsoids on phase intervals.

    Attributes
    ----------
    off_shape : ndarray of shape (m,)
        How far S may be from a straight line by more than its rounding, in the Frobenius norm.
    inner_start, inner_end : SampledEllipsoid
        Inside all ellipsoids near the ends, where their squares are positive.
    """

    start: SampledEllipsoid
    end: SampledEllipsoid
    off_shape: Array
    inner_start: SampledEllipsoid
    inner_end: SampledEllipsoid

    def between(
        self, ends: Array, before: Array, after: Array, off: Array, enough: float | Array
    ) -> Array:
        # √⟨v, S v⟩ is concave in S: where S goes straight, a force that goes straight lies no
        # farther outside than at the ends. What S is off by moves the support function by √λ − √(λ
        # − ε), λ at least the least eigenvalue.
        least = np.minimum(self.start.squares[:, 0], self.end.squares[:, 0])
        moved = self.off_shape / np.sqrt(
            np.maximum(least, np.maximum(self.off_shape, np.finfo(float).tiny))
        )
        # 0 is inside, so that no force lies farther outside than it is long.
        out = np.minimum(ends + moved, np.maximum(lengths(before), lengths(after)))
        # In some directions S may not be off at all.
        (close,) = np.nonzero(
            (out > enough)
            & (self.inner_start.squares[:, 0] > 0.0)
            & (self.inner_end.squares[:, 0] > 0.0)
        )
        if len(close):
            first, last = self.inner_start.taken(close), self.inner_end.taken(close)
            inner = np.maximum(first.excess(before[close]), last.excess(after[close]))
            out[close] = np.minimum(out[close], np.maximum(inner, ends[close]))
        return out + lengths(off)
