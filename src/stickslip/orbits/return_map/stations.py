"""The stations of multiple shooting, and coordinates that satisfy the constraints of their
modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.kept import cached_property
from stickslip.numerics.levels import RANK
from stickslip.orbits.fields.mode_field import Piece

if TYPE_CHECKING:
    pass

_PLACED = 1e-14  # a correction this small, in units of the cycle, changes no derivative
_MOST_PLACINGS = 3


@dataclass(frozen=True)
class Place:
    """A state with its derivatives: by the coordinates of its station, by time, and by the
    parameter."""

    state: Array
    directions: Array
    by_time: Array
    by_parameter: Array


@dataclass(frozen=True)
class Station:
    """Start of a part of the cycle, and coordinates around it.

    Attributes
    ----------
    part : float
        When, as a part of the period.
    piece : Piece
        Mode and region there.
    origin : array, shape (n,)
        The state with ξ = 0.
    basis : array, shape (n, q)
        Directions that keep the constraints, one for each coordinate, in units of the size of the
        cycle.
    normal : array, shape (n, n − q)
        Directions in which states are put back onto the constraints.
    """

    part: float
    piece: Piece
    origin: Array
    basis: Array
    normal: Array

    @cached_property
    def chart(self) -> Array:
        """Matrix of state − origin ↦ ξ."""
        return np.linalg.inv(np.hstack([self.basis, self.normal]))[: self.basis.shape[1]]

    def place(self, xi: Array, t: float, p: Array) -> Place:
        """The state with given coordinates."""
        n = len(self.origin)
        y = self.origin + self.basis @ xi
        if self.normal.shape[1] == 0:
            return Place(y, self.basis, np.zeros(n), np.zeros(n))
        # Newton's method across the constraints of the mode; along them lie the free directions.
        off, along, by_time, by_parameter = self._solve(y, t, p)
        for _ in range(_MOST_PLACINGS):
            if not np.any(xi) and np.max(np.abs(off)) <= _PLACED:
                break  # a known motion starts here
            y = y - self.normal @ off
            if self.piece.straight or np.max(np.abs(off)) <= _PLACED:
                break
            off, along, by_time, by_parameter = self._solve(y, t, p)
        return Place(
            y, self.basis - self.normal @ along, -self.normal @ by_time, -self.normal @ by_parameter
        )

    def _solve(self, y: Array, t: float, p: Array) -> tuple[Array, Array, Array, Array]:
        """Value and derivatives of the constraints, in coordinates of the normal directions."""
        bounds = self.piece.bounds(t, y, p)
        n, q = len(y), self.basis.shape[1]
        right = np.zeros((len(bounds.value), q + 3))
        right[:, 0] = bounds.value
        right[:, 1 : q + 1] = bounds.slopes[:, :n] @ self.basis
        right[:, q + 1] = bounds.time
        if bounds.slopes.shape[1] > n:
            right[:, q + 2] = bounds.slopes[:, n]
        solved = np.linalg.solve(bounds.slopes[:, :n] @ self.normal, right)
        return solved[:, 0], solved[:, 1 : q + 1], solved[:, q + 1], solved[:, q + 2]


def make_station(part: float, piece: Piece, t: float, y: Array, p: Array, sizes: Array) -> Station:
    """A station at a state of the cycle; `sizes` are the units of the components.

    Parameters
    ----------
    part : float
        See :class:`Station`.
    y : array, shape (n,)
    p : array, shape (parameters,)
    sizes : array, shape (n,)
    """
    n = len(y)
    slopes = piece.bounds(t, y, p).slopes[:, :n] * sizes
    # All constraints have equal weight, however small the constrained motion is on this cycle.
    lengths = np.linalg.norm(slopes, axis=1, keepdims=True)
    slopes = np.divide(slopes, lengths, out=slopes, where=lengths > 0.0)
    _, s, v = np.linalg.svd(slopes) if len(slopes) else (None, np.zeros(0), np.eye(n))
    rank = int(np.sum(s > RANK * s[0])) if len(s) else 0
    return Station(part, piece, y, sizes[:, None] * v[rank:].T, sizes[:, None] * v[:rank].T)
