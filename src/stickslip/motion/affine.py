"""Exact flow of modes that are affine in the state: closed form instead of steps.

In an affine mode, driven by 1, t, cos ωt and sin ωt with the frequencies of the declaration, every guard g is

    g(τ) = c₀ + c₁τ + c₂τ² + Re Σⱼ aⱼ exp(λⱼτ) + Re Σₘ bₘ exp(iωₘτ)

and its first crossing is found over the whole flight. The closed forms themselves are made by
:mod:`stickslip.motion.closed_form`; here they are only followed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from stickslip.motion.kernel import INLINED, OPTIONS, ROUNDING
from stickslip.motion.signals import first_fall, length

Array = np.ndarray

UNKNOWN, AFFINE, SMOOTH = 0, 1, 2
FIRED = 1e5  # a switch that has just fired is on its boundary by definition
GERM_ORDERS = 6


@njit(**OPTIONS)
def drive_vector(t: float, omega: Array, e: Array) -> None:
    """e = (1, t, cos ω₁t, sin ω₁t, …)."""
    e[0], e[1] = 1.0, t
    for m in range(len(omega)):
        e[2 + 2 * m] = math.cos(omega[m] * t)
        e[3 + 2 * m] = math.sin(omega[m] * t)


@njit(**OPTIONS)
def drive_rate(e: Array, omega: Array, out: Array) -> None:
    """Derivative of a drive vector."""
    out[0], out[1] = 0.0, e[0]
    for m in range(len(omega)):
        out[2 + 2 * m] = -omega[m] * e[3 + 2 * m]
        out[3 + 2 * m] = omega[m] * e[2 + 2 * m]


class ClosedForms(NamedTuple):
    """Closed forms of affine modes: one slot per mode, for each group of motions with the same parameters.

    Attributes
    ----------
    status, key : arrays of int
        UNKNOWN, AFFINE or SMOOTH (not affine), and the number of the mode.
    counts : array of int
        Numbers of exponents and of guards.
    A, F : arrays
        ẋ = A x + F e(t).
    exponent, inverse : arrays of complex
        λ, without the conjugates, and 1/λ (0 for λ = 0).
    L, B, phi : arrays of complex
        w = L x with ẇ = λ w + B x_still + φ e.
    V : array of complex
        x = Re V w for the components that move.
    P, Q, PV, switch : arrays
        Guards P x + Q e, with P V, and the switch of each.
    moves : array of int
        1 where a component moves.
    zero_x, zero_e : arrays
        What must vanish, zero_x x + zero_e e: u of sticking inertial, λ + σs of sliding rate-independent contacts.
    hold : array
        Correction of the velocities of a sticking contact.
    used : array of int
        Slots in use, by group.
    shortest : array
        Shortest time scale, 1/max |λ|.
    """

    status: Array
    key: Array
    counts: Array
    A: Array
    F: Array
    exponent: Array
    inverse: Array
    L: Array
    B: Array
    phi: Array
    V: Array
    P: Array
    Q: Array
    PV: Array
    switch: Array
    moves: Array
    zero_x: Array
    zero_e: Array
    hold: Array
    used: Array
    shortest: Array


def make_closed_forms(
    groups: int, slots: int, n: int, contacts: int, kinks: int, doubtful: int, ne: int
) -> ClosedForms:
    """Empty storage of closed forms."""
    guards, m = kinks + 2 * contacts + doubtful, groups * slots
    z, i, c = np.zeros, np.int64, np.complex128
    return ClosedForms(
        status=z(m, i),
        key=z(m, i),
        counts=z((m, 2), i),
        A=z((m, n, n)),
        F=z((m, n, ne)),
        exponent=z((m, n), c),
        inverse=z((m, n), c),
        L=z((m, n, n), c),
        B=z((m, n, n), c),
        phi=z((m, n, ne), c),
        V=z((m, n, n), c),
        P=z((m, guards, n)),
        Q=z((m, guards, ne)),
        PV=z((m, guards, n), c),
        switch=z((m, guards), i),
        moves=z((m, n), i),
        zero_x=z((m, contacts, n)),
        zero_e=z((m, contacts, ne)),
        hold=z((m, contacts, n)),
        used=z(groups, i),
        shortest=z(m),
    )


class Flight(NamedTuple):
    """Work space of one flight: derivatives, and the coefficients of the closed form."""

    v: Array
    s: Array
    de: Array
    orders: Array
    e: Array
    r: Array
    p: Array
    up: Array
    down: Array
    c: Array
    a: Array
    b: Array
    taylor: Array
    stack: Array
    mode0: Array
    reg0: Array


def make_flight(n: int, contacts: int, kinks: int, doubtful: int, waves: int) -> Flight:
    """Work space of the flights of a system."""
    z, c, orders, ne = np.zeros, np.complex128, GERM_ORDERS + 1, 2 + 2 * waves
    return Flight(
        v=z((orders, n)),
        s=z((orders, n)),
        de=z((orders, ne)),
        orders=z(kinks + 2 * contacts + doubtful + 1, np.int64),
        e=z(ne),
        r=z(n, c),
        p=z((n, 3), c),
        up=z((n, waves), c),
        down=z((n, waves), c),
        c=z(3),
        a=z(n, c),
        b=z(waves, c),
        taylor=z(33),
        stack=z((64, 36)),
        mode0=z(contacts, np.int64),
        reg0=z(kinks, np.int64),
    )


@njit(**OPTIONS)
def mode_key(mode: Array, reg: Array) -> int:
    """Number of a mode and region."""
    key = 1
    for i in range(len(mode)):
        key = key * 3 + mode[i] + 1
    for j in range(len(reg)):
        key = key * 2 + reg[j]
    return key


@njit(**OPTIONS)
def find(T: ClosedForms, first: int, used: int, key: int) -> int:
    """Slot of a mode, or −1."""
    for i in range(first, first + used):
        if T.key[i] == key:
            return i
    return -1


@njit(**OPTIONS)
def _derive(A: Array, F: Array, omega: Array, v: Array, s: Array, de: Array, k: int) -> None:
    """The k-th derivative of the state and the size of its terms, from the one before."""
    for i in range(A.shape[0]):
        total, size = 0.0, 0.0
        for j in range(A.shape[0]):
            total += A[i, j] * v[k - 1, j]
            size += abs(A[i, j]) * s[k - 1, j]
        for m in range(F.shape[1]):
            total += F[i, m] * de[k - 1, m]
            size += abs(F[i, m] * de[k - 1, m])
        v[k, i], s[k, i] = total, size
    drive_rate(de[k - 1], omega, de[k])


@njit(**INLINED)
def germs(T: ClosedForms, slot: int, f: Flight, x: Array, omega: Array, fired: int, last: float) -> int:
    """Least guard that becomes negative at once, or −1; the deciding order of each guard is left in the work space."""
    v, s, de, e, orders = f.v, f.s, f.de, f.e, f.orders
    A, F, P, Q = T.A[slot], T.F[slot], T.P[slot], T.Q[slot]
    n, ne, ng = len(x), len(e), T.counts[slot, 1]
    for i in range(n):
        v[0, i], s[0, i] = x[i], abs(x[i])
    for m in range(ne):
        de[0, m] = e[m]
    # A zero is known no better than the time at which it was found, and a drive no better than its phase; and what
    # changes less than rounding within the shortest time scale has not begun to change.
    near = last + T.shortest[slot] + (abs(e[1]) if len(omega) > 0 else 0.0)
    ready = 1
    for g in range(ng):
        decided = False
        for k in range(GERM_ORDERS):
            while ready <= k + 1:  # derivatives are made as far as they are needed
                _derive(A, F, omega, v, s, de, ready)
                ready += 1
            value, size = 0.0, 0.0
            for i in range(n):
                value += P[g, i] * v[k, i]
                size += abs(P[g, i]) * (s[k, i] + near * s[k + 1, i])
            for m in range(ne):
                value += Q[g, m] * de[k, m]
                size += abs(Q[g, m]) * (abs(de[k, m]) + near * abs(de[k + 1, m]))
            floor = ROUNDING * size
            if k == 0 and T.switch[slot, g] % 1000 == fired:
                floor *= FIRED
            if value > floor:
                orders[g], decided = k, True
                break
            if value < -floor:
                return g
        if not decided:
            orders[g] = GERM_ORDERS
    return -1


@njit(**INLINED)
def fly(T: ClosedForms, slot: int, f: Flight, x: Array, t: float, room: float, omega: Array) -> tuple[float, int]:
    """Closed form from state x at time t; the earliest event within `room`: (duration, guard or −1)."""
    e, orders, r, p, up, down, c, a, b = f.e, f.orders, f.r, f.p, f.up, f.down, f.c, f.a, f.b
    nb, ng, n = T.counts[slot, 0], T.counts[slot, 1], len(x)
    lam, inverse, L, Bf, phi, P, Q, PV, moves = (
        T.exponent[slot],
        T.inverse[slot],
        T.L[slot],
        T.B[slot],
        T.phi[slot],
        T.P[slot],
        T.Q[slot],
        T.PV[slot],
        T.moves[slot],
    )
    nw = len(omega)
    for j in range(nb):
        w, c0 = 0.0j, phi[j, 0] + phi[j, 1] * t
        for i in range(n):
            w += L[j, i] * x[i]
            c0 += Bf[j, i] * x[i]
        c1 = phi[j, 1]
        for m in range(nw):
            spin = complex(e[2 + 2 * m], e[3 + 2 * m])
            up[j, m] = 0.5 * (phi[j, 2 + 2 * m] - 1j * phi[j, 3 + 2 * m]) * spin / (1j * omega[m] - lam[j])
            down[j, m] = (
                0.5 * (phi[j, 2 + 2 * m] + 1j * phi[j, 3 + 2 * m]) * spin.conjugate() / (-1j * omega[m] - lam[j])
            )
            w -= up[j, m] + down[j, m]
        if lam[j] == 0.0:
            r[j], p[j, 0], p[j, 1], p[j, 2] = 0.0, w, c0, 0.5 * c1
        else:
            p[j, 1] = -c1 * inverse[j]
            p[j, 0] = (p[j, 1] - c0) * inverse[j]
            p[j, 2] = 0.0
            r[j] = w - p[j, 0]
    limit, which = room, -1
    for g in range(ng):
        if orders[g] >= GERM_ORDERS:
            continue
        c[0], c[1], c[2] = Q[g, 0] + Q[g, 1] * t, Q[g, 1], 0.0
        size = abs(c[0])
        for i in range(n):
            if moves[i] == 0:
                c[0] += P[g, i] * x[i]
            size += abs(P[g, i] * x[i])
        for m in range(nw):
            b[m] = (Q[g, 2 + 2 * m] - 1j * Q[g, 3 + 2 * m]) * complex(e[2 + 2 * m], e[3 + 2 * m])
            size += length(b[m])
        for j in range(nb):
            z = PV[g, j]
            if z == 0.0:
                a[j] = 0.0
                continue
            a[j] = z * r[j]
            c[0] += (z * p[j, 0]).real
            c[1] += (z * p[j, 1]).real
            c[2] += (z * p[j, 2]).real
            size += length(a[j]) + length(z * p[j, 0])
            for m in range(nw):
                b[m] += z * up[j, m] + (z * down[j, m]).conjugate()
        found = first_fall(c, a, lam, nb, b, omega, limit, ROUNDING * size, orders[g], f.taylor, f.stack)
        if found <= limit:
            limit, which = found, g
    return limit, which


@njit(**INLINED)
def arrive(T: ClosedForms, slot: int, f: Flight, x: Array, tau: float, omega: Array) -> None:
    """Put x where the closed form is after a duration."""
    r, p, up, down = f.r, f.p, f.up, f.down
    nb, lam, V, moves = T.counts[slot, 0], T.exponent[slot], T.V[slot], T.moves[slot]
    for i in range(len(x)):
        if moves[i] == 1:
            x[i] = 0.0
    for j in range(nb):
        w = p[j, 0] + tau * (p[j, 1] + tau * p[j, 2])
        if r[j] != 0.0:
            if lam[j].imag == 0.0:
                w += r[j] * math.exp(lam[j].real * tau)
            else:
                size, angle = math.exp(lam[j].real * tau), lam[j].imag * tau
                w += r[j] * complex(size * math.cos(angle), size * math.sin(angle))
        for m in range(len(omega)):
            spin = complex(math.cos(omega[m] * tau), math.sin(omega[m] * tau))
            w += up[j, m] * spin + down[j, m] * spin.conjugate()
        for i in range(len(x)):
            if moves[i] == 1:
                x[i] += V[i, j].real * w.real - V[i, j].imag * w.imag


@njit(**INLINED)
def admissible(T: ClosedForms, slot: int, x: Array, e: Array, contacts: int, last: float) -> bool:
    """Whether sticking contacts are at rest and sliding rate-independent ones on their threshold; removes rounding."""
    n, ne = len(x), len(e)
    for c in range(contacts):
        value, size, rate = 0.0, 0.0, 0.0
        for i in range(n):
            value += T.zero_x[slot, c, i] * x[i]
            size += abs(T.zero_x[slot, c, i] * x[i])
        for m in range(ne):
            value += T.zero_e[slot, c, m] * e[m]
            size += abs(T.zero_e[slot, c, m] * e[m])
        if value == 0.0:
            continue
        stick = False
        for i in range(n):
            if T.hold[slot, c, i] != 0.0:
                stick = True
        if not stick:
            if abs(value) > 1e-9 * size:
                return False
            continue
        for i in range(n):
            if T.zero_x[slot, c, i] != 0.0:
                for j in range(n):
                    rate += abs(T.zero_x[slot, c, i] * T.A[slot, i, j] * x[j])
                for m in range(ne):
                    rate += abs(T.zero_x[slot, c, i] * T.F[slot, i, m] * e[m])
        if abs(value) > 1e-9 * last * rate + ROUNDING * size:
            return False
        for i in range(n):
            x[i] -= T.hold[slot, c, i] * value
    return True
