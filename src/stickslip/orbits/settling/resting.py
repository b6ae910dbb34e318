"""Proof that a motion near an equilibrium of its mode stays there forever.

In the norm of the eigenvectors the distance decreases, and no guard has a zero within that
distance. This holds if the Jacobian is nearly constant within that distance, which is checked at
points around the equilibrium; the proof is therefore up to variations of the Jacobian between these
points.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.numerics.levels import FINE_RANK, NO_GROWTH, ROUNDED_SUM, TINIEST
from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.engine.tables import Leave
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.symbolic import expressions as ex

_SAME = 1e-12  # rates that differ by less, relative to their terms, are the same
_ROOM = 2.0  # smallest ratio of the distance of a guard to the reach of the motion
_CURVED = 0.25  # largest change of the Jacobian relative to the slowest decay rate
_NEWTON = 20


class MotionPoint(NamedTuple):
    """State of a motion, and its units.

    Attributes
    ----------
    state : array, shape (n,)
    units : array, shape (n,)
        Largest modulus of each component on the way.
    frame : array, shape (n,)
        Velocity of the frame in which the system does not depend on time.
    shifts : array, shape (translations, n)
    """

    time: float
    state: Array
    parameters: Array
    mode: Array
    region: Array
    units: Array
    frame: Array
    shifts: Array


def rest_near(pieces: Pieces, point: MotionPoint) -> Array | None:
    """The state near which a motion is proved to rest, or to move steadily, forever; None without a
    proof."""
    try:
        return _Neighbourhood(pieces, point).settled()
    except (np.linalg.LinAlgError, ArithmeticError):
        return None


class _Neighbourhood:
    """The equilibrium near a state, and whether a motion from there stays near it."""

    def __init__(self, pieces: Pieces, point: MotionPoint) -> None:
        self.pieces = pieces
        self.piece = pieces(point.mode, point.region)
        self.t = point.time
        self.y = point.state
        self.p = point.parameters
        self.frame = point.frame
        self.units = np.where(point.units > 0.0, point.units, 1.0)
        self.shifts = point.shifts[np.any(point.shifts != 0.0, axis=1)].T
        self.basis = self._directions(self._held(point))

    def _held(self, point: MotionPoint) -> Array:
        """The positions of the contacts that stick, as linear forms of the state."""
        equations = self.pieces.equations
        state = equations.declaration.state
        named = ("t", *equations.declaration.parameters, *state)
        values = dict(zip(named, map(float, (self.t, *self.p, *self.y)), strict=True))
        forms = np.zeros((len(point.mode), len(state)))
        # A contact that sticks keeps the displacement whose rate is its velocity.
        for c in np.flatnonzero(point.mode == 0):
            for x, weight in equations.contacts[c].direction.items():
                forms[c, state.index(x)] = ex.evaluate(weight, values)
        return forms[point.mode == 0]

    def _directions(self, held: Array) -> Array:
        """Possible directions of motion, in units, without sticking contacts and translations."""
        n = len(self.y)
        kept = (
            np.vstack([self.piece.bounds(self.t, self.y, self.p).slopes[:, :n], held]) * self.units
        )
        along = self.shifts / self.units[:, None]
        if len(kept) and along.shape[1]:
            along = along @ _null(kept @ along)
        return _null(np.vstack([kept, along.T]))

    def settled(self) -> Array | None:
        """The equilibrium, if the motion stays within a neighbourhood in which it converges to
        it."""
        if self._is_constant():
            return self.y
        y = self._equilibrium()
        return y if y is not None and self._stays_near(y) else None

    def _is_constant(self) -> bool:
        """Return whether the state is constant, up to translation."""
        if np.any(self._rates(self.y)):
            return False
        here = self.piece.leave(self.t, self.y, self.p)
        return bool(np.all(here.value >= -_SAME * self._terms(here, self.y)))

    def _rates(self, y: Array) -> Array:
        """Rates without frame and translation, in units."""
        rates = (self.piece.rates(self.t, y, self.p) - self.frame) / self.units
        along = self.shifts / self.units[:, None]
        return rates - along @ (np.linalg.pinv(along) @ rates)

    @staticmethod
    def _terms(here: Leave, y: Array) -> Array:
        """Sizes of the terms of the guards."""
        return np.abs(here.slopes[:, : len(y)]) @ np.abs(y) + np.abs(here.value)

    def _stays_near(self, y: Array) -> bool:
        n = len(self.y)
        B = self.basis
        units = self.units
        J = self._jacobian(self.piece, y)
        # In the coordinates of the eigenvectors every component of a deviation decays separately.
        eigenvalues: AnyArray
        eigenvalues, V = np.linalg.eig(J) if J.size else (np.zeros(0), np.zeros((0, 0)))
        if np.any(eigenvalues.real >= -NO_GROWTH * np.max(np.abs(eigenvalues), initial=0.0)):
            return False
        inverse = np.linalg.inv(V)
        parts = np.abs(inverse @ (B.T @ ((self.y - y) / units)))
        slowest = np.min(-eigenvalues.real, initial=np.inf)
        # … as long as the Jacobian is nearly the same within the parallelepiped that they span.
        for direction in (V * parts).T:
            for change in (direction.real, direction.imag):
                for sign in (_ROOM, -_ROOM):
                    there = self._jacobian(self.piece, y + sign * len(V) * units * (B @ change))
                    if np.linalg.norm(inverse @ (there - J) @ V, 2) > _CURVED * slowest:
                        return False
        here = self.piece.leave(self.t, y, self.p)
        # A guard changes by at most the sum of the changes by each component.
        slopes = here.slopes[:, :n] * units @ B
        reach = np.abs(slopes @ V) @ parts
        terms = self._terms(here, y)
        still = reach <= ROUNDED_SUM * terms
        held = np.where(still, here.value >= -_SAME * terms, here.value > _ROOM * reach)
        return all(held[g] or self._inert(int(g), y) for g in range(len(held)))

    def _equilibrium(self) -> Array | None:
        """Newton's method within the possible directions of motion."""
        y = self.y.copy()
        n = len(self.y)
        for _ in range(_NEWTON):
            rest = self.basis.T @ ((self.piece.rates(self.t, y, self.p) - self.frame) / self.units)
            J = self._jacobian(self.piece, y)
            step = np.linalg.solve(J, rest) if J.size else np.zeros(0)
            y = y - self.units * (self.basis @ step)
            if not np.all(np.isfinite(y)):
                return None
            if np.max(np.abs(step), initial=0.0) <= ROUNDED_SUM:
                break
        else:
            return None
        # Only a drift along a translation is a steady motion: sticking contacts may be carried
        # along.
        rates = self._rates(y)
        J = np.abs(
            self.piece.jacobian(np.array([self.t]), y[:, None], self.p)[0][:, :n] * self.units
        )
        terms = np.sum(J, axis=1) / self.units
        return (
            y if np.all(np.abs(rates) <= _SAME * (terms + np.max(terms, initial=TINIEST))) else None
        )

    def _jacobian(self, piece: Piece, y: Array) -> Array:
        J = piece.jacobian(np.array([self.t]), y[:, None], self.p)[0][:, : len(y)]
        return self.basis.T @ (J * self.units / self.units[:, None]) @ self.basis

    def _inert(self, g: int, y: Array) -> bool:
        """Return whether the zero of a guard has no effect, as for a contact without friction."""
        switch = int(self.piece.switches[g])
        now = self.piece.setting(switch)
        kinks = len(self.piece.field.region)
        try:
            other = self.pieces(*self.piece.switched(switch, 1 - now if switch < kinks else -now))
        except ZeroDivisionError:
            return False
        if other is self.piece:
            return False
        rates = self.piece.rates(self.t, y, self.p)
        J = self._jacobian(self.piece, y)
        same = np.abs(other.rates(self.t, y, self.p) - rates) <= _SAME * self.units
        return bool(
            np.all(same)
            and np.all(np.abs(self._jacobian(other, y) - J) <= _SAME * np.max(np.abs(J)))
        )


def _null(rows: Array) -> Array:
    """Orthonormal basis of the null space of a matrix."""
    if not rows.size:
        return np.eye(rows.shape[1])
    rows = ratio(rows, np.max(np.abs(rows), axis=1, keepdims=True))
    _, s, v = np.linalg.svd(rows)
    return v[int(np.sum(s > FINE_RANK * s[0])) :].T if s[0] > 0.0 else np.eye(rows.shape[1])
