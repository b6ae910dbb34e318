"""One mode and region: a smooth motion with guards.

With the mode σᵢ ∈ {−, stick, +} of every contact and the side of every kink fixed, the rates solve
W ρ = f + Jᵀλ with λᵢ = −σᵢkᵢ in slip and Jρ = ẇ (inertial) or w (viscous) in stick: a constant
matrix. A rate-independent coordinate in slip follows f + Jλ = 0, differentiated along the motion by
the complex step.

*Guards* are nonnegative while a mode is right: λ + s⁺ and s⁻ − λ in stick, σu in slip, the signed
kink functions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .mechanics import Array, Mechanics, pair

COMPLEX_STEP = 1e-30
SMALL = 1e-3  # of forces in natural units: guards are not measured against less


class NoAnswer(Exception):
    """The reference cannot say how the motion goes on."""


class Piece:
    """Rates and guards of one mode in one region."""

    def __init__(self, m: Mechanics, mode: Array, side: Array, static: Sequence[int] = ()) -> None:
        self.m = m
        self.mode = mode
        self.side = side
        self.static = list(static)
        nq, nz, nr, _ = m.kinds
        self.nq = nq
        self.p = nq + nz
        self.n = nq + nz + nr
        self.J = J = np.asarray(m.J, dtype=float).reshape(len(mode), self.n)
        self.Jp = J[:, : self.p]
        self.Jq = J[:, :nq]
        self.inertial = np.any(self.Jq != 0.0, axis=1)
        self.rate = np.any(J[:, self.p :] != 0.0, axis=1)
        self.only_inertial = bool(np.all(self.inertial))
        self.sticks = mode == 0
        self.up = (mode > 0).astype(float)
        self.down = (mode < 0).astype(float)
        self.stick = np.flatnonzero(self.sticks & ~self.rate)
        self.held = [
            (i, int(np.flatnonzero(J[i])[0])) for i in np.flatnonzero(self.rate & self.sticks)
        ]
        self.sliding = [
            (i, int(np.flatnonzero(J[i])[0])) for i in np.flatnonzero(self.rate & ~self.sticks)
        ]
        self.still, self.ones = np.zeros(len(mode)), np.ones(len(mode))
        self._solve_once()

    def _solve_once(self) -> None:
        """The matrices of W ρ = f + Jᵀλ, J_S ρ = b: ρ = A f + B b, λ_S = −Bᵀf + G b."""
        W = np.asarray(self.m.inertia, dtype=float).reshape(self.p, self.p)
        self.inverse = np.linalg.inv(W) if self.p else W
        JS = self.Jp[self.stick]
        scale = 1.0 / np.sqrt(np.diag(JS @ self.inverse @ JS.T)) if len(JS) else np.ones(0)
        values, vectors = np.linalg.eigh(scale[:, None] * (JS @ self.inverse @ JS.T) * scale)
        full = values > 1e-12
        self.G = scale[:, None] * ((vectors[:, full] / values[full]) @ vectors[:, full].T) * scale
        # Forces of redundant contacts are unique up to this direction.
        self.spare = vectors[:, ~full] * scale[:, None]
        self.B = self.inverse @ JS.T @ self.G
        # Rates that stick allows: through a basis of them, so that what sticks beside something
        # heavy does not creep.
        Z = np.linalg.svd(JS)[2][np.count_nonzero(full) :].T if len(JS) else np.eye(self.p)
        self.A = Z @ np.linalg.inv(Z.T @ W @ Z) @ Z.T

    def rhs(self, t: float, y: Array) -> Array:
        """Rates of the state."""
        return self.evaluate(t, y)[0]

    def rates(self, t: float, y: Array) -> tuple[Array, Array, Array]:
        """Rates of the state, guards (two for each contact, then the kinks), and contact forces."""
        out, f, lam, plus, minus, u, w, target = self.evaluate(t, y)
        lam[self.stick] = self.G @ target - self.B.T @ (f[: self.p] + self.Jp.T @ lam)
        for i, k in self.held:
            lam[i] = -f[k] / self.J[i, k]
        if not self.only_inertial:
            u = np.where(self.inertial, u, self.J @ out[: self.n] - w)
        return out, self._guards(t, y, plus, minus, lam, u), lam

    def evaluate(self, t: float, y: Array) -> tuple[Array, ...]:
        """Rates, smooth forces, friction in slip (0 in stick), thresholds, relative velocities and
        surface speeds."""
        m = self.m
        n = self.n
        nq = self.nq
        p = self.p
        x = y[:n]
        v = y[n : n + nq]
        a = y[n + nq :]
        f = np.asarray(m.force(t, x, v, a, self.side))
        w, w_rate = self.belt(t)
        u = self.Jq @ v - w
        k_plus, k_minus = plus, minus = pair(m.threshold(t, x, v, a, self.side))
        if m.kinetic is not None:
            k_plus, k_minus = pair(m.kinetic(t, x, v, a, self.side, np.abs(u)))
            if self.static:
                k_plus, k_minus = k_plus.copy(), k_minus.copy()
                k_plus[self.static], k_minus[self.static] = plus[self.static], minus[self.static]
        lam = self.down * k_minus - self.up * k_plus
        target = w_rate if self.only_inertial else np.where(self.inertial, w_rate, w)
        rho = self.A @ (f[:p] + self.Jp.T @ lam)
        if len(self.stick):
            target = target[self.stick]
            rho += self.B @ target
        else:
            target = target[:0]
        out = np.zeros(len(y))
        out[:nq] = v
        out[nq:p] = rho[nq:]
        out[n : n + nq] = rho[:nq]
        if m.law is not None:
            out[n + nq :] = m.law(t, x, out[:n], a, self.side)
        if self.sliding:
            self._slide(t, y, out)
        return out, f, lam, plus, minus, u, w, target

    def belt(self, t: float) -> tuple[Array, Array]:
        """Surface speeds and their rates."""
        if self.m.belt is None:
            return self.still, self.still
        w = np.asarray(self.m.belt(t + COMPLEX_STEP * 1j), dtype=complex)
        return np.real(w), np.imag(w) / COMPLEX_STEP

    def _slide(self, t: float, y: Array, out: Array) -> None:
        """Rates of the rate-independent coordinates that slide."""
        columns, slope = self.slopes(t, y)
        if not np.linalg.cond(slope) < 1e12:
            raise NoAnswer("no bounded rate")
        out[columns] = np.linalg.solve(slope, -self.along(t, y, 1.0, out))

    def slopes(self, t: float, y: Array) -> tuple[list[int], Array]:
        """Rate-independent coordinates that slide, and the derivatives of their balance by them."""
        columns = [k for _, k in self.sliding]
        directions = np.eye(len(y))[columns]
        return columns, np.array([self.along(t, y, 0.0, d) for d in directions]).T

    def along(self, t: float, y: Array, dt: float, dy: Array) -> Array:
        """Derivative of the balance of the sliding rate-independent coordinates along a
        direction."""
        beside = self.balance(t + COMPLEX_STEP * 1j * dt, y + COMPLEX_STEP * 1j * dy)
        return np.imag(beside) / COMPLEX_STEP

    def balance(self, t: complex, y: Array) -> Array:
        """f + Jλ of the rate-independent coordinates that slide."""
        n, nq = self.n, self.nq
        state = t, y[:n], y[n : n + nq], y[n + nq :], self.side
        f, (plus, minus) = self.m.force(*state), pair(self.m.threshold(*state))
        return np.array(
            [
                f[k] - self.J[i, k] * (plus[i] if self.mode[i] > 0 else -minus[i])
                for i, k in self.sliding
            ]
        )

    def _guards(self, t: float, y: Array, plus: Array, minus: Array, lam: Array, u: Array) -> Array:
        upper = np.where(self.sticks, minus - lam, self.mode * u)
        lower = np.where(self.sticks, lam + plus, 1.0)
        if self.spare.shape[1] == 1:
            # Some force in the segment λ + cν has to be admissible: the room that is left for c.
            S = self.stick
            nu = self.spare[:, 0]
            moved = np.abs(nu) > 1e-9 * np.max(np.abs(nu))
            a_end = (np.where(nu > 0, -plus[S], minus[S]) - lam[S])[moved] / nu[moved]
            b_end = (np.where(nu > 0, minus[S], -plus[S]) - lam[S])[moved] / nu[moved]
            free = S[moved]
            upper[free] = np.min(b_end) - np.max(a_end)
            lower[free] = 1.0
            lam[free] = np.nan
        elif self.spare.shape[1] > 1:
            raise NoAnswer("forces with two free directions")
        if self.m.kinks is None:
            return np.concatenate([upper, lower])
        n, nq = self.n, self.nq
        return np.concatenate(
            [upper, lower, self.side * self.m.kinks(t, y[:n], y[n : n + nq], y[n + nq :])]
        )

    def scales(self, t: float, y: Array, h: float) -> Array:
        """Sizes of the guards: forces, relative velocities after a short time h, and 1 for rates
        and kinks."""
        n = self.n
        nq = self.nq
        p = self.p
        state = t, y[:n], y[n : n + nq], y[n + nq :], self.side
        f = np.abs(np.asarray(self.m.force(*state)))
        bound = SMALL + np.max([np.max(s, initial=0.0) for s in pair(self.m.threshold(*state))])
        force = np.max(f, initial=0.0) + bound
        reach = np.abs(self.Jp @ self.inverse) @ (
            f[:p] + np.abs(self.Jp.T) @ np.full(len(self.mode), bound)
        )
        speed = np.where(self.inertial, h * reach, np.where(self.rate, 1.0, reach))
        contact = np.where(self.mode == 0, force, speed)
        return np.concatenate([contact, np.full(len(self.mode), force), np.ones(len(self.side))])
