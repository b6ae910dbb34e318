"""Proof that a motion comes to rest, or to a steady motion, and stays there.

Three ways: nothing can ever happen again by the closed form of an affine mode
(:mod:`stickslip.motion.rest`); a driven system whose state is exactly the same all through a period
of its drives; and a motion so near to a stable equilibrium inside its mode that it cannot leave: in
the norm of the eigenvectors its distance shrinks, and no guard comes down to 0 within that
distance. What the eigenvectors say holds as far as the Jacobian is nearly the same there, which is
looked at around the equilibrium; this is a proof up to the derivatives between the points that were
looked at.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.motion.rest import rests_forever
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.return_map.held import forms, held_positions
from stickslip.orbits.return_map.recurrence import Window, stretch
from stickslip.orbits.return_map.shooting import numbers

Array = np.ndarray
Complex = Any  # array of complex numbers

ROUNDING = 1e-13
SAME = 1e-12  # rates that differ by less, relative to their terms, are the same
DECAY = 1e-9  # a real part must be below minus this part of the largest eigenvalue
ROOM = 2.0  # a guard is this many times further away than the motion can bring it
CURVED = 0.25  # the Jacobian changes by at most this part of the slowest decay
NEWTON = 20


def comes_to_rest(w: Window, pieces: Pieces) -> Array | None:
    """The state near which a motion is proved to rest, or to move steadily, for ever; None if that
    is not proved."""
    motion = w.trajectory
    last = motion.knots.state[-1]
    if rests_forever(motion._problem, motion.knots):
        return last
    if w.symmetry.driven:
        return last if _keeps_still(w) else None
    try:
        return _Neighbourhood(w, pieces).settled()
    except (np.linalg.LinAlgError, ArithmeticError):
        return None


def _keeps_still(w: Window) -> bool:
    """Whether everything sticks and nothing moves at all for a period of the drives, which is then
    so for ever."""
    k = w.trajectory.knots
    period = w.period
    first = int(np.searchsorted(k.time, k.time[-1] - period, side="right")) - 1 if period else -1
    if first < 0 or np.any(w.symmetry.turn) or k.mode.shape[1] == 0 or np.any(k.mode[first:]):
        return False
    inside = w.index >= first
    return bool(
        np.all(
            np.ptp(w.states[inside], axis=0) <= ROUNDING * np.max(np.abs(w.states[inside]), axis=0)
        )
    )


class _Neighbourhood:
    """The equilibrium near the end of a motion, and whether the motion stays near it."""

    def __init__(self, w: Window, pieces: Pieces) -> None:
        motion = w.trajectory
        k = motion.knots
        n = len(w.sizes)
        self.pieces = pieces
        self.piece = pieces(k.mode[-1], k.region[-1])
        self.t = float(k.time[-1])
        self.y = k.state[-1]
        self.p = numbers(motion._problem)
        self.frame = np.zeros(n) if w.symmetry.frame is None else w.symmetry.frame
        modulus = np.max(np.abs(w.states), axis=0)
        self.units = np.where(modulus > 0.0, modulus, 1.0)
        self.shifts = w.symmetry.shifts
        last = int(np.flatnonzero(np.diff(k.time) > 0.0)[-1])
        self.basis = self._directions(
            forms(held_positions(stretch(motion, last, len(k.time) - 1)), n)
        )

    def _directions(self, held: Array) -> Array:
        """Directions, in units, in which something can move that neither sticks nor is a
        translation."""
        n = len(self.y)
        kept = (
            np.vstack([self.piece.bounds(self.t, self.y, self.p).slopes[:, :n], held]) * self.units
        )
        along = self.shifts / self.units[:, None]
        if len(kept) and along.shape[1]:
            along = along @ _null(kept @ along)
        return _null(np.vstack([kept, along.T]))

    def settled(self) -> Array | None:
        """The equilibrium, if the motion stays for ever within a neighbourhood in which it decays
        towards it."""
        y = self._equilibrium()
        return y if y is not None and self._stays_near(y) else None

    def _stays_near(self, y: Array) -> bool:
        n = len(self.y)
        B = self.basis
        units = self.units
        J = self._jacobian(self.piece, y)
        eigenvalues: Complex
        eigenvalues, V = np.linalg.eig(J) if J.size else (np.zeros(0), np.zeros((0, 0)))
        if np.any(eigenvalues.real >= -DECAY * np.max(np.abs(eigenvalues), initial=0.0)):
            return False
        inverse = np.linalg.inv(V)
        parts = np.abs(inverse @ (B.T @ ((self.y - y) / units)))
        slowest = np.min(-eigenvalues.real, initial=np.inf)
        for direction in (V * parts).T:
            for change in (direction.real, direction.imag):
                for sign in (ROOM, -ROOM):
                    there = self._jacobian(self.piece, y + sign * len(V) * units * (B @ change))
                    if np.linalg.norm(inverse @ (there - J) @ V, 2) > CURVED * slowest:
                        return False
        here = self.piece.leave(self.t, y, self.p)
        slopes = here.slopes[:, :n] * units @ B
        reach = np.abs(slopes @ V) @ parts
        terms = np.abs(here.slopes[:, :n]) @ np.abs(y) + np.abs(here.value)
        still = reach <= ROUNDING * terms
        held = np.where(still, here.value >= -SAME * terms, here.value > ROOM * reach)
        return all(held[g] or self._inert(int(g), y) for g in range(len(held)))

    def _equilibrium(self) -> Array | None:
        """Newton's method within the directions that can move."""
        y = self.y.copy()
        n = len(self.y)
        for _ in range(NEWTON):
            rest = self.basis.T @ ((self.piece.rates(self.t, y, self.p) - self.frame) / self.units)
            J = self._jacobian(self.piece, y)
            step = np.linalg.solve(J, rest) if J.size else np.zeros(0)
            y = y - self.units * (self.basis @ step)
            if not np.all(np.isfinite(y)):
                return None
            if np.max(np.abs(step), initial=0.0) <= ROUNDING:
                break
        else:
            return None
        # A drift along a translation is a steady motion, any other is none: what sticks may be
        # carried along.
        rates = (self.piece.rates(self.t, y, self.p) - self.frame) / self.units
        along = self.shifts / self.units[:, None]
        rates = rates - along @ (np.linalg.pinv(along) @ rates)
        J = np.abs(
            self.piece.jacobian(np.array([self.t]), y[:, None], self.p)[0][:, :n] * self.units
        )
        terms = np.sum(J, axis=1) / self.units
        return (
            y if np.all(np.abs(rates) <= SAME * (terms + np.max(terms, initial=1e-300))) else None
        )

    def _jacobian(self, piece: Piece, y: Array) -> Array:
        J = piece.jacobian(np.array([self.t]), y[:, None], self.p)[0][:, : len(y)]
        return self.basis.T @ (J * self.units / self.units[:, None]) @ self.basis

    def _inert(self, g: int, y: Array) -> bool:
        """Whether nothing changes where a guard vanishes, as for a contact without friction."""
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
        same = np.abs(other.rates(self.t, y, self.p) - rates) <= SAME * self.units
        return bool(
            np.all(same)
            and np.all(np.abs(self._jacobian(other, y) - J) <= SAME * np.max(np.abs(J)))
        )


def _null(rows: Array) -> Array:
    """Orthonormal basis of what a matrix maps to 0."""
    if not rows.size:
        return np.eye(rows.shape[1])
    rows = rows / np.maximum(np.max(np.abs(rows), axis=1, keepdims=True), 1e-300)
    _, s, v = np.linalg.svd(rows)
    return v[int(np.sum(s > 1e-10 * s[0])) :].T if s[0] > 0.0 else np.eye(rows.shape[1])
