"""Closed forms of affine modes, computed when a motion first enters them.

Matrices of a mode (:mod:`.matrices`) become the table that :mod:`.flights` follow. A mode whose
eigenvectors are nearly dependent, whose eigenvalues are not known well enough, or that is near
resonance, is left to the Taylor steps, which need no such structure; one that they follow faster is
proved to be affine, and left to them, too.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.affine.blocks import find_blocks
from stickslip.motion.affine.forms import (
    AFFINE,
    EXPONENTS,
    FACETS,
    FEW_COMPONENTS,
    GUARDS,
    LEADING_ORDERS,
    SEARCHED,
    SLIDES,
    SMOOTH,
    STICKS,
    STIFF_RATIO,
    ClosedForms,
    Making,
)
from stickslip.motion.affine.matrices import facet_row, linearise
from stickslip.motion.affine.signals import length
from stickslip.motion.algebra.eigenvalues import modulus
from stickslip.motion.steps.arrays import (
    DIMENSION,
    INERTIAL,
    LEAD,
    ON_INERTIAL,
    ON_VISCOUS,
    SLIPPING,
    TOWARDS,
    Flow,
    Machine,
    Rows,
    flow_of,
)
from stickslip.motion.steps.contacts import directions_of
from stickslip.numerics.levels import FEW_ROUNDINGS, TINIEST
from stickslip.translator import compiled


@compiled()
def make_form(
    machine: Machine,
    flow: Flow,
    g: int,
    T: ClosedForms,
    w: Making,
    slot: int,
    mode: Array,
    reg: Array,
) -> None:
    """Compute the closed form of a mode in a slot; its status reports whether there is one.

    Parameters
    ----------
    flow : Flow
        Constants by group (a leading axis).
    g : int
        The group.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
        Modes are 0 or ±1.
    """
    own = flow_of(flow, g)
    T.status[slot] = SMOOTH
    T.flown[slot] = 0
    if not linearise(machine, own, mode, reg, w.probes, w.slopes):
        return
    blocks = find_blocks(T, w, slot, own.k.omega)
    if blocks < 0 and damp_held(w, own.rows, mode):
        blocks = find_blocks(T, w, slot, own.k.omega)
    if blocks < 0:
        return
    fill_dynamics(T, w, slot, own.k.omega)
    fill_guards(T, w, slot, own.rows, mode, reg)
    fill_constraints(T, w, slot, own.rows, mode)
    fill_responses(T, w, slot, own.k.omega, blocks)
    fill_signals(T, w, slot, blocks)
    T.counts[slot, EXPONENTS] = blocks
    T.status[slot] = AFFINE
    T.flown[slot] = 1 if pays(T, slot, own.k.omega, blocks) else 0


@compiled(brief=True)
def damp_held(w: Making, rows: Rows, mode: Array) -> bool:
    """Add a decay of the relative velocities of sticking contacts with mass; returns whether there
    are any.

    They are zero, so that this changes no motion. But where a direction of several coordinates is
    held, its place and its velocity have no two eigenvectors: one is the derivative of the other,
    and both are constant.
    """
    F = w.probes.F
    n, nq = len(w.moving), rows.sizes[INERTIAL]
    stiffness = 0.0
    for i in range(nq, 2 * nq):
        for j in range(nq):
            stiffness = max(stiffness, abs(F[i, j]))
    rate = math.sqrt(stiffness)
    found = False
    for c in range(rows.sizes[ON_INERTIAL]):
        if mode[c] != 0:
            continue
        found = True
        for i in range(nq):
            strength = rate * w.probes.hold[c, i]
            if strength != 0.0:
                for j in range(F.shape[1]):
                    F[nq + i, j] -= strength * F[n + c, j]
    return found


@compiled(brief=True)
def pays(T: ClosedForms, slot: int, omega: Array, blocks: int) -> bool:
    """Whether flights are much faster than Taylor steps, or not much slower: for few components,
    for guards whose roots are nearly known, or in stiff modes, where steps would be short."""
    slowest = np.inf
    fastest = 0.0
    for b in range(blocks):
        size = modulus(T.exponent[slot, b])
        if size > 0.0:
            slowest = min(slowest, size)
            fastest = max(fastest, size)
    for frequency in omega:
        slowest = min(slowest, frequency)
        fastest = max(fastest, frequency)
    if fastest > STIFF_RATIO * slowest:
        return True
    n = T.exponent.shape[1]
    if n <= FEW_COMPONENTS:
        return True
    for g in range(T.counts[slot, GUARDS]):
        parts = 0
        for b in range(blocks):
            if T.exponent[slot, b] != 0.0j and T.swing[slot, g, b] > 0.0:
                parts += 1
        for m in range(len(omega)):
            parts += 1 if T.swing[slot, g, n + m] > 0.0 else 0
        # The zero of a polynomial with one exponential or wave is known approximately; with several
        # it has to be searched for.
        if parts > 1:
            return False
    return True


@compiled()
def fill_dynamics(T: ClosedForms, w: Making, slot: int, omega: Array) -> None:
    """Store ṡ = S s in a unit of time near the shortest of the mode, and the data of its exponents
    that flights need."""
    F = w.probes.F
    S = T.S[slot]
    n = len(w.moving)
    fastest = 0.0
    for b in range(T.exponent.shape[1]):
        value = T.exponent[slot, b]
        fastest = max(fastest, modulus(value))
        T.tilt[slot, b] = math.atan2(value.imag, value.real)
        T.sine[slot, b] = math.sin(T.tilt[slot, b])
    still = fastest == 0.0 and len(omega) == 0
    for frequency in omega:
        fastest = max(fastest, frequency)
    # A power of two, so that the change of the unit of time causes no rounding errors.
    pace = math.ldexp(1.0, -math.frexp(fastest if fastest > 0.0 else 1.0)[1])
    T.pace[slot] = pace
    T.shortest[slot] = 0.0 if still else 1.0 / max(fastest, TINIEST)
    for i in range(n):
        for j in range(len(S)):
            S[i, j] = pace * F[i, j]
    S[n + 1, n] = pace
    for k in range(len(omega)):
        S[n + 2 + 2 * k, n + 3 + 2 * k] = -pace * omega[k]
        S[n + 3 + 2 * k, n + 2 + 2 * k] = pace * omega[k]


@compiled()
def fill_guards(T: ClosedForms, w: Making, slot: int, rows: Rows, mode: Array, reg: Array) -> None:
    """Store the guards G s, the switch each belongs to, and bounds of their derivatives.

    Parameters
    ----------
    T : ClosedForms
        Filled.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    """
    F = w.probes.F
    G = T.G[slot]
    S = T.S[slot]
    switch = T.switch[slot]
    n, nc, nk = len(w.moving), len(mode), len(reg)
    ns = len(S)
    u = n
    force = n + nc
    plus = n + 2 * nc
    minus = n + 3 * nc
    g = 0
    for j in range(nk):
        combine(G[g], F[n + 4 * nc + j], 1.0 if reg[j] == 1 else -1.0, F[0], 0.0)
        switch[g] = j
        g += 1
    for c in rows.lines:
        switch[g] = nk + 2 * c
        if mode[c] != 0:
            combine(G[g], F[u + c], float(mode[c]), F[0], 0.0)
            g += 1
        else:
            combine(G[g], F[force + c], 1.0, F[plus + c], 1.0)
            combine(G[g + 1], F[force + c], -1.0, F[minus + c], 1.0)
            switch[g + 1] = nk + 2 * c + 1
            g += 2
    for d in range(len(rows.required)):
        c = rows.required[d, SLIPPING]
        if c < 0 or mode[c] * rows.required[d, TOWARDS] > 0:
            combine(G[g], F[n + 4 * nc + nk + d], 1.0, F[0], 0.0)
            switch[g] = nk + 2 * nc + d
            g += 1
    T.counts[slot, SEARCHED] = g
    for p in range(len(rows.planes)):
        g = put_facets(T, w, slot, rows, p, g)
    T.counts[slot, GUARDS] = g
    for j in range(ns):
        felt = False
        for i in range(ns):
            felt = felt or S[i, j] != 0.0
        for i in range(g):
            felt = felt or G[i, j] != 0.0
        T.felt[slot, j] = 1.0 if felt else 0.0
        w.ones[0, j] = 1.0
    # |G| |S|ᵏ 1 bounds the k-th derivatives of the guards if no component of s exceeds 1.
    for k in range(LEADING_ORDERS + 1):
        size = w.ones[k % 2]
        after = w.ones[(k + 1) % 2]
        for i in range(g):
            total = 0.0
            for j in range(ns):
                total += abs(G[i, j]) * size[j]
            T.reach[slot, i, k] = total
        for i in range(ns):
            total = 0.0
            for j in range(ns):
                total += abs(S[i, j]) * size[j]
            after[i] = total


@compiled()
def put_facets(T: ClosedForms, w: Making, slot: int, rows: Rows, p: int, g: int) -> int:
    """Store sides of a polygon within the disc of forces that a contact holds at rest in a plane: ρ
    s − m·A⁻¹λ with unit vectors m and the cosine ρ of half the angle between two. Beyond them,
    Taylor steps follow the guard itself. Returns how many guards there are.

    Parameters
    ----------
    T : ClosedForms
        Filled.
    p : int
        The plane.
    g : int
        How many guards there are so far.
    """
    F = w.probes.F
    n, nc = rows.sizes[DIMENSION], len(rows.u)
    held = facet_row(rows, p)
    block = directions_of(rows, rows.planes[p, LEAD])
    for k in range(FACETS):
        angle = 2.0 * math.pi * k / FACETS
        row = T.G[slot, g]
        combine(row, F[held], math.cos(math.pi / FACETS), F[0], 0.0)
        for i in range(len(block)):
            c = block[i]
            along = math.cos(angle) if i == 0 else math.sin(angle)
            axis = ratio_of(F[held + 1 + i], F[n + c])
            combine(row, row, 1.0, F[n + nc + c], -along / axis)
        T.switch[slot, g] = len(rows.kinks) + 2 * nc + len(rows.required) + p
        g += 1
    return g


@compiled()
def ratio_of(x: Array, y: Array) -> float:
    """x in parts of y, one of which is a multiple of the other."""
    most = 0
    for j in range(len(y)):
        most = j if abs(y[j]) > abs(y[most]) else most
    return float(x[most] / y[most])


@compiled()
def combine(out: Array, x: Array, a: float, y: Array, b: float) -> None:
    """A sum a x + b y, without y where b = 0.

    Parameters
    ----------
    out : array
        Receives it.
    """
    for j in range(len(out)):
        out[j] = a * x[j] + b * y[j] if b != 0.0 else a * x[j]


@compiled()
def fill_constraints(T: ClosedForms, w: Making, slot: int, rows: Rows, mode: Array) -> None:
    """Store the constraints of a mode: u of sticking inertial, λ + σs of sliding rate-independent
    contacts.

    Parameters
    ----------
    T : ClosedForms
        Filled.
    mode : array of int, shape (contacts,)
    """
    F = w.probes.F
    n, nc, nq = len(w.moving), len(mode), rows.sizes[INERTIAL]
    first = rows.sizes[ON_INERTIAL] + rows.sizes[ON_VISCOUS]
    for c in range(nc):
        force = F[n + nc + c]
        if c < rows.sizes[ON_INERTIAL] and mode[c] == 0:
            T.held[slot, c] = STICKS
            combine(T.zero[slot, c], F[n + c], 1.0, force, 0.0)
            for i in range(nq):
                T.hold[slot, c, nq + i] = w.probes.hold[c, i]
            strength = w.probes.hold[c, nq]
            combine(T.brake[slot, c], F[n + 2 * nc + c], strength, F[n + 3 * nc + c], strength)
        elif c >= first and mode[c] != 0:
            T.held[slot, c] = SLIDES
            side = F[n + 2 * nc + c] if mode[c] > 0 else F[n + 3 * nc + c]
            combine(T.zero[slot, c], force, 1.0, side, float(mode[c]))


@compiled()
def fill_responses(T: ClosedForms, w: Making, slot: int, omega: Array, blocks: int) -> None:
    """Response of the components w = L x: coefficients of s = (x, e) at τ = 0.

    ẇ = λ w + B x_still + φ e is solved by

        w = p₀ + p₁τ + p₂τ² + r exp(λτ) + Σₘ (↑ₘ exp(iωₘt) + ↓ₘ exp(−iωₘt)),

    r and p₁ linear in s, the others numbers.

    Parameters
    ----------
    T : ClosedForms
        Filled.
    omega : array, shape (waves,)
        Frequencies of the drives.
    """
    F = w.probes.F
    n = len(w.moving)
    for b in range(blocks):
        r = T.R[slot, b]
        value = T.exponent[slot, b]
        # Forcing of w: coefficients of the components that are constant, and of e.
        for j in range(len(r)):
            if j < n and w.moving[j] == 1:
                w.ramp[b, j] = complex(0.0, 0.0)
                continue
            total = complex(0.0, 0.0)
            terms = 0.0
            for i in range(n):
                if w.moving[i] == 1 and F[i, j] != 0.0:
                    total += w.L[b, i] * F[i, j]
                    terms += length(w.L[b, i]) * abs(F[i, j])
            w.ramp[b, j] = total if modulus(total) > FEW_ROUNDINGS * terms else complex(0.0, 0.0)
        growth = w.ramp[b, n + 1]
        # At the frequencies of the drives.
        for k in range(len(omega)):
            cosine = w.ramp[b, n + 2 + 2 * k]
            sine = w.ramp[b, n + 3 + 2 * k]
            w.up[b, k] = 0.5 * (cosine - 1j * sine) / (1j * omega[k] - value)
            w.down[b, k] = 0.5 * (cosine + 1j * sine) / (-1j * omega[k] - value)
            r[n + 2 + 2 * k] = -(w.up[b, k] + w.down[b, k])
            r[n + 3 + 2 * k] = -1j * (w.up[b, k] - w.down[b, k])
            w.ramp[b, n + 2 + 2 * k] = w.ramp[b, n + 3 + 2 * k] = complex(0.0, 0.0)
        # Powers of τ: if λ = 0, w itself and its rates; otherwise the response to a force linear in
        # time.
        if value == 0.0j:
            for j in range(len(r)):
                r[j] = complex(0.0, 0.0)
            w.bend[b] = 0.5 * growth
            continue
        w.bend[b] = complex(0.0, 0.0)
        for j in range(n + 2):
            even = w.ramp[b, j]
            if j == n:
                even += growth / value
            r[j] = w.L[b, j] if j < n and w.moving[j] == 1 else even / value
            w.ramp[b, j] = -growth / value if j == n else complex(0.0, 0.0)


@compiled()
def put_amplitudes(G: Array, w: Making, blocks: int, a: Array) -> None:
    """Amplitudes of a guard over the components w = L x.

    Parameters
    ----------
    G : array
        Coefficients of the guard over the state.
    a : array of complex
        Receives them; sums that cancel are 0.
    """
    terms = w.ones[1]
    for b in range(blocks):
        a[b] = complex(0.0, 0.0)
        terms[b] = 0.0
    for i in range(len(w.moving)):
        g = G[i]
        if g != 0.0:
            for b in range(blocks):
                a[b] += g * w.V[i, b]
                terms[b] += abs(g) * length(w.V[i, b])
    for b in range(blocks):
        a[b] = a[b] if modulus(a[b]) > FEW_ROUNDINGS * terms[b] else complex(0.0, 0.0)


@compiled()
def fill_signals(T: ClosedForms, w: Making, slot: int, blocks: int) -> None:
    """Store guards and components of the state as signals: those that move are Re V w."""
    n = len(w.moving)
    ns = T.S.shape[1]
    waves = T.b.shape[2]
    guards = T.counts[slot, GUARDS]
    first = T.c2.shape[1] - n
    # Only few components cause a drift of the others: the constant ones.
    for j in range(ns):
        w.ones[0, j] = 0.0
        for b in range(blocks):
            w.ones[0, j] = 1.0 if w.ramp[b, j] != 0.0j else w.ones[0, j]
    for row in range(first + n):
        if guards <= row < first:
            continue
        a = T.a[slot, row]
        swing = T.swing[slot, row]
        decays = True
        if row < guards:
            put_amplitudes(T.G[slot, row], w, blocks, a)
        for b in range(blocks):
            if row >= first:
                a[b] = w.V[row - first, b]
            else:
                T.angle[slot, row, b] = math.atan2(a[b].imag, a[b].real)
            swing[b] = modulus(a[b])
            decays = decays and (a[b] == 0.0j or T.exponent[slot, b].real <= 0.0)
        bend = 0.0
        terms = 0.0
        for b in range(blocks):
            bend += (a[b] * w.bend[b]).real
            terms += swing[b] * modulus(w.bend[b])
        T.c2[slot, row] = bend if abs(bend) > FEW_ROUNDINGS * terms else 0.0
        drifts = T.c2[slot, row] != 0.0
        for j in range(ns):
            T.c1[slot, row, j] = 0.0
            if w.ones[0, j] == 0.0 and j != n:
                continue
            slope = T.G[slot, row, n + 1] if row < guards and j == n else 0.0
            terms = abs(slope)
            for b in range(blocks):
                slope += (a[b] * w.ramp[b, j]).real
                terms += swing[b] * modulus(w.ramp[b, j])
            T.c1[slot, row, j] = slope if abs(slope) > FEW_ROUNDINGS * terms else 0.0
            drifts = drifts or T.c1[slot, row, j] != 0.0
        for k in range(waves):
            total = complex(0.0, 0.0)
            if row < guards:
                total = complex(T.G[slot, row, n + 2 + 2 * k], -T.G[slot, row, n + 3 + 2 * k])
            for b in range(blocks):
                total += a[b] * w.up[b, k] + (a[b] * w.down[b, k]).conjugate()
            T.b[slot, row, k] = total
            swing[n + k] = modulus(total)
        T.drifts[slot, row] = 1 if drifts else 0
        if row < guards:
            T.decays[slot, row] = 1 if decays else 0
