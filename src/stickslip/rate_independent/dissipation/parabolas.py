"""Symmetric matrices of the phase that become singular: bounds of second order around a phase.

If S(s) − ξξᵀ is singular at a phase c and positive semidefinite around it, its smallest eigenvalue
is approximately a parabola, and bounds by chords cannot prove that it is nonnegative, however short
they are. From S(c), S′(c) and an enclosure of S″ on an interval around c the parabola is bounded
from below, with its vertex at c up to rounding. So intervals on which S″ is nearly constant suffice
for any tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.numerics.levels import ROUNDED_TERM
from stickslip.rate_independent.signals.signal import Signal

CELLS = 4096  # intervals of equal length on which S″ is enclosed
# shifts in cells by which the enclosures are extended on both sides: reach 1, 2, 4, ..., 32
_SHIFTS = (1, 1, 2, 4, 8, 16)
_NEWTON = 4  # number of Newton steps to a vertex
_FARTHEST = 2.0**-8  # largest Newton step


@dataclass(frozen=True, eq=False)
class Parabolas:
    """Enclosures of S″ around every cell, for every reach r: S″ is `middle` up to `radius`, in the
    Frobenius norm.

    Attributes
    ----------
    matrix : Signal
        S, of shape (n, n).
    low, high : ndarray of shape (r, cells)
        Phases that a reach takes in; within one period, over the end of which S may jump.
    middle : ndarray of shape (r, cells, n, n)
    radius : ndarray of shape (r, cells)
        Infinite where second derivatives are not known.
    """

    matrix: Signal
    low: Array
    high: Array
    middle: Array
    radius: Array

    @classmethod
    def of(cls, matrix: Signal) -> Parabolas:
        """Create the bounds for a matrix."""
        edges = np.arange(CELLS + 1) / CELLS
        cell = np.arange(CELLS)
        low, high = edges[:-1], edges[1:]
        least, most = matrix.bent(low, high)
        rows: list[tuple[Array, ...]] = []
        for shift in _SHIFTS:
            # The enclosures of three neighbours cover the interval between them: each reaches to
            # the next.
            sides = [np.maximum(cell - shift, 0), cell, np.minimum(cell + shift, CELLS - 1)]
            low, high = low[sides[0]], high[sides[2]]
            least, most = least[sides].min(axis=0), most[sides].max(axis=0)
            with np.errstate(invalid="ignore"):
                middle = 0.5 * (least + most)
                radius = np.sqrt(np.square(0.5 * (most - least)).sum(axis=(1, 2)))
            middle = 0.5 * (middle + middle.transpose(0, 2, 1))
            rows.append(
                (low, high, np.where(np.isfinite(radius)[:, None, None], middle, 0.0), radius)
            )
        return cls(matrix, *(np.array(part) for part in zip(*rows, strict=True)))

    def around(self, phases: Array, xi: Array) -> tuple[Array, Array, Array, Array]:
        """Bounds of the negative eigenvalues of S(s) − ξξᵀ around phases, shape (k,).

        Along w, the eigenvector of its least eigenvalue at c, it is at least a₀ + a₁t + ½(a₂ − r)t²
        for s = c + t, and on the other directions at least μ; the coupling is at most β|t|. So no
        eigenvalue is smaller than the minimum of the first bound less β²t²/μ (Schur complement).

        Returns
        -------
        low, high : ndarray of shape (r, k)
            Intervals around the phases, for every half-width.
        below : ndarray of shape (r, k)
            All eigenvalues of S(s) − ξξᵀ are at least minus this value; infinite if unknown.
        least : ndarray of shape (r, k)
            Lower bound of the eigenvalues of S(s).
        """
        S, values, first, second, cell = self._along(phases, xi)
        low = self.low[:, cell]
        high = self.high[:, cell]
        radius = self.radius[:, cell]
        width = np.maximum(high - phases, phases - low)
        size = width * np.sqrt(np.square(first).sum(axis=(1, 2)))
        size += 0.5 * width**2 * (np.sqrt(np.square(second).sum(axis=(2, 3))) + radius)
        # In one dimension there is no coupling.
        others = values[:, 1] if len(xi) > 1 else np.full(len(phases), np.inf)
        coupling = np.sqrt(np.square(first[:, 1:, 0]).sum(axis=1))
        coupling = coupling + 0.5 * width * (
            np.sqrt(np.square(second[:, :, 1:, 0]).sum(axis=2)) + radius
        )
        with np.errstate(all="ignore"):
            bend = 0.5 * (second[:, :, 0, 0] - radius) - np.square(coupling) / (others - size)
            # The minimum of a₁t + bend·t² is −a₁²/(4 bend).
            vertex = -0.25 * np.square(first[:, 0, 0]) / bend
            ends = np.minimum(
                *(first[:, 0, 0] * t + bend * t**2 for t in (high - phases, low - phases))
            )
        fall = np.where(bend > 0.0, vertex, np.minimum(ends, 0.0))
        rounding = ROUNDED_TERM * len(xi) * (np.abs(S).max(axis=(1, 2)) + float(xi @ xi))
        below = np.maximum(-(values[:, 0] + fall), 0.0) + rounding
        known = np.isfinite(radius) & (others > size) & np.isfinite(fall)
        return low, high, np.where(known, below, np.inf), np.linalg.eigvalsh(S)[:, 0] - size

    def vertices(self, phases: Array, xi: Array) -> Array:
        """Phases near given ones, shape (k,), at which the least eigenvalue of S(s) − ξξᵀ is
        smallest, by Newton."""
        if len(xi) == 1 or not len(phases):
            return phases
        for _ in range(_NEWTON):
            _, values, first, second, _ = self._along(phases, xi)
            with np.errstate(all="ignore"):
                # Second derivative of a simple eigenvalue by perturbation theory.
                bend = second[0, :, 0, 0] - 2.0 * np.square(first[:, 1:, 0]).sum(axis=1) / (
                    values[:, 1] - values[:, 0]
                )
                step = np.where(bend > 0.0, -first[:, 0, 0] / bend, 0.0)
            phases = np.clip(phases + np.clip(np.nan_to_num(step), -_FARTHEST, _FARTHEST), 0.0, 1.0)
        return phases

    def _along(
        self, phases: Array, xi: Array
    ) -> tuple[Array, Array, Array, Array, NDArray[np.intp]]:
        """S, the eigenvalues of S − ξξᵀ, S′ and for every reach S″ along its eigenvectors, and the
        cells of phases."""
        tables = self.matrix.unwrapped(phases), self.matrix.slope(phases)
        S, slope = (0.5 * (at + at.transpose(0, 2, 1)) for at in tables)
        cell = np.clip(np.floor(phases * CELLS).astype(np.intp), 0, CELLS - 1)
        # ξ lies in the ellipsoid of S if S − ξξᵀ has no negative eigenvalue (Schur complement).
        values, axes = np.linalg.eigh(S - xi[:, None] * xi)
        across = axes.transpose(0, 2, 1)
        return S, values, across @ slope @ axes, across @ self.middle[:, cell] @ axes, cell
