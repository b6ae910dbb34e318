"""Which modes are affine, and their closed forms: all that are asked for at a time, stacked.

The tape proves which modes are affine (:mod:`stickslip.motion.steps.structure`); probing them at a
few states and times then gives their matrices, and a few more points tell whether rounding spoils
them. Time may enter as 1, t, cos ωt and sin ωt with the frequencies of the declaration. A mode
whose eigenvectors are nearly dependent, or that is near resonance, is left to the Taylor steps,
which need no such structure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import AnyArray as Array
from stickslip.motion.engine.forms import (
    AFFINE,
    EXPONENTS,
    GERM_ORDERS,
    GUARDS,
    SLIDES,
    STICKS,
    ClosedForms,
)
from stickslip.motion.steps.arrays import DIMENSION, INERTIAL, Constants

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem


# so large that constants do not drown the slopes, in whatever unit; scaling with it is exact
_PROBE = 2.0**200
_AGES = 2.0**300  # likewise for slopes in time, where there are no waves
_CONDITION = 1e4
_SLOW = 1e-6  # smallest eigenvalue, relative to the largest, that may be divided by


@dataclass(frozen=True)
class Linear:
    """Modes in the form (rates, u, λ, s⁺, s⁻, guards) = D x + E e(t).

    Attributes
    ----------
    D, E : arrays, shapes (modes, rows, n) and (modes, rows, drives)
    hold : array
        Columns that put the velocities of sticking inertial contacts back onto their surface; last,
        the acceleration that a unit of force gives to each.
    mode, region : arrays of int
    omega : array, shape (modes, frequencies)
    """

    D: Array
    E: Array
    hold: Array
    mode: Array
    region: Array
    omega: Array

    def take(self, index: Array) -> Linear:
        """Some of the modes."""
        return Linear(
            *(getattr(self, name)[index] for name in ("D", "E", "hold", "mode", "region", "omega"))
        )


def fill_closed_forms(
    problem: Problem, constants: Constants, T: ClosedForms, group: Array, mode: Array, region: Array
) -> None:
    """Put the closed forms of modes into the next slots of their groups; their status says whether
    there is one.

    Parameters
    ----------
    problem : Problem
        With the machine code; its own parameters do not matter.
    constants : Constants
        By group.
    group, mode, region : arrays of int, shapes (modes,), (modes, contacts), (modes, kinks)
        What is asked for; a mode that is asked for twice is made once.
    """
    from stickslip.motion.engine import tables

    place = np.zeros(len(group), np.int64)
    tables.claim(T, group, mode, region, place)
    new = place >= 0
    slot, group, mode, region = (np.ascontiguousarray(a[new]) for a in (place, group, mode, region))
    linear, found = linearise(problem, constants, group, mode, region)
    slot = slot[found]
    linear = linear.take(found)
    n = int(problem.rows.sizes[DIMENSION])
    moving = np.any(linear.D[:, :n] != 0.0, axis=2) | np.any(linear.E[:, :n] != 0.0, axis=2)
    core = np.any((linear.D[:, :n] != 0.0) & moving[:, :, None], axis=1) & moving
    lawful = problem.rows.doubtful[:, 1]
    pattern = np.hstack([moving, core, linear.mode == 0, linear.mode[:, lawful[lawful >= 0]] > 0])
    # What moves, what moves others and what sticks is the same in most of them: those are worked on
    # as one stack.
    packed = np.packbits(pattern, axis=1)
    kinds, kind = np.unique(packed.view(f"V{packed.shape[1]}"), return_inverse=True)
    for number in range(len(kinds)):
        index = np.flatnonzero(kind.reshape(-1) == number)
        fill_alike(problem, T, slot[index], linear.take(index), moving[index[0]], core[index[0]])


def fill_alike(
    problem: Problem, T: ClosedForms, slot: Array, linear: Linear, moving: Array, core: Array
) -> None:
    """Closed forms of modes in which the same components move and the same contacts stick.

    Parameters
    ----------
    problem : Problem
    T : ClosedForms
        Filled.
    slot : array of int, shape (modes,)
        Their places in it.
    linear : Linear
    moving : array of bool, shape (n,)
        Which components move.
    core : array of bool, shape (n,)
        Which of them the rates of those that move depend on.
    """
    m = np.flatnonzero(moving)
    modes, good = eigenmodes(linear.D[:, m[:, None], m], core[moving])
    distance = np.abs(1j * linear.omega[:, :, None] - modes[0][:, None, :])
    good &= ~np.any(distance <= 1e-3 * linear.omega[:, :, None], axis=(1, 2))
    values: Array
    slot, linear, (values, V, L) = slot[good], linear.take(good), (part[good] for part in modes)
    if len(slot) == 0:
        return
    omega = linear.omega
    # Of a conjugate pair one is kept, and counts twice.
    order = np.argsort(values.imag < 0.0, axis=1, kind="stable")
    kept = np.sort(values.imag < 0.0, axis=1, kind="stable") == 0
    values = np.where(kept, np.take_along_axis(values, order, 1), 0.0)
    L = np.where(kept[:, :, None], np.take_along_axis(L, order[:, :, None], 1), 0.0)
    weight = np.where(kept, np.where(values.imag > 0.0, 2.0, 1.0), 0.0)
    V = weight[:, None, :] * np.take_along_axis(V, order[:, None, :], 2)
    b = np.arange(len(m))
    weights = (values, V, L)
    fastest = np.maximum(
        np.max(np.abs(values), axis=1, initial=0.0), np.max(omega, axis=1, initial=0.0)
    )
    T.pace[slot] = np.ldexp(1.0, -np.frexp(np.where(fastest > 0.0, fastest, 1.0))[1])
    fill_signals(problem, T, slot, linear, moving, weights)
    constraints(problem, T, linear, slot)
    T.exponent[slot[:, None], b] = values
    T.tilt[slot[:, None], b] = np.angle(values)
    T.sine[slot[:, None], b] = np.sin(np.angle(values))
    T.counts[slot, EXPONENTS] = np.sum(kept, axis=1)
    T.shortest[slot] = 1.0 / np.maximum(fastest, 1e-300)
    if omega.shape[1] == 0:
        T.shortest[slot[np.all(values == 0.0, axis=1)]] = 0.0
    T.status[slot] = AFFINE


def responses(
    linear: Linear, moving: Array, modes: tuple[Array, Array, Array]
) -> tuple[Array, ...]:
    """How the components w = L x answer: coefficients of s = (x, e) at τ = 0.

    ẇ = λ w + B x_still + φ e is solved by

        w = p₀ + p₁τ + p₂τ² + r exp(λτ) + Σₘ (↑ₘ exp(iωₘt) + ↓ₘ exp(−iωₘt)).

    Returns
    -------
    r, p₁, p₂, ↑, ↓
        The first two linear in s, the others numbers.
    """
    D = linear.D
    E = linear.E
    omega = linear.omega
    values, _, L = modes
    n = len(moving)
    m = np.flatnonzero(moving)
    ns = len(moving) + E.shape[2]
    state = np.zeros((len(D), len(m), ns), complex)
    force = np.zeros_like(state)
    swaying = np.zeros_like(state)
    ramp = np.zeros_like(state)
    state[:, :, m] = L
    force[:, :, np.append(~moving, np.ones(ns - n, bool))] = product_or_zero(
        L, np.concatenate([D[:, m[:, None], np.flatnonzero(~moving)], E[:, m]], axis=2)
    )
    # Parts at the frequencies of the drives.
    cosine, sine = force[:, :, n + 2 :: 2], force[:, :, n + 3 :: 2]
    up = 0.5 * (cosine - 1j * sine) / (1j * omega[:, None] - values[:, :, None])
    down = 0.5 * (cosine + 1j * sine) / (-1j * omega[:, None] - values[:, :, None])
    swaying[:, :, n + 2 :: 2] = up + down
    swaying[:, :, n + 3 :: 2] = 1j * (up - down)
    # Powers of τ: where λ = 0, w itself and its rates; elsewhere what balances a force that grows
    # evenly.
    still = (values == 0.0)[:, :, None]
    over = np.divide(1.0, values, out=np.zeros_like(values), where=values != 0.0)[:, :, None]
    ramp[:, :, n] = force[:, :, n + 1]
    even = force
    even[:, :, n + 2 :] = 0.0
    r = np.where(still, 0.0, state + over * (even + over * ramp) - swaying)
    return (
        r,
        np.where(still, even, -over * ramp),
        np.where(still, 0.5 * ramp, 0.0)[:, :, n],
        up,
        down,
    )


def fill_signals(
    problem: Problem,
    T: ClosedForms,
    slot: Array,
    linear: Linear,
    moving: Array,
    modes: tuple[Array, Array, Array],
) -> None:
    """Store guards and components of the state as signals: those that move are Re V w.

    Parameters
    ----------
    problem : Problem
    T : ClosedForms
        Filled.
    slot : array of int, shape (modes,)
        Their places in it.
    linear : Linear
    moving : array of bool, shape (n,)
        Which components move.
    modes : tuple of arrays
        Eigenvalues, and right and left eigenvectors on the components that move.
    """
    D = linear.D
    E = linear.E
    omega = linear.omega
    V = modes[1]
    r, p1, p2, up, down = responses(linear, moving, modes)
    (count, blocks, ns), n, m, waves = r.shape, len(moving), np.flatnonzero(moving), omega.shape[1]
    P, Q, switches = guards(problem, linear)
    g = P.shape[1]
    a = np.zeros((count, g + n, blocks), complex)
    a[:, :g] = product_or_zero(P[:, :, m], V)
    a[:, g + m] = V
    direct = np.zeros((count, g + n, ns - n))
    later = np.zeros((count, g + n, ns))
    direct[:, :g] = Q
    later[:, :g, n] = Q[:, :, 1]
    wave = direct[:, :, 2::2] - 1j * direct[:, :, 3::2] + a @ up + np.conj(a) @ np.conj(down)
    c1 = real_or_zero(a, p1, later)
    c2 = real_or_zero(a, p2[:, :, None], np.zeros((count, g + n, 1)))[:, :, 0]
    S = np.zeros((count, ns, ns))
    S[:, :n, :n] = D[:, :n]
    S[:, :n, n:] = E[:, :n]
    S[:, n + 1, n] = 1.0
    for k in range(waves):
        S[:, n + 2 + 2 * k, n + 3 + 2 * k] = -omega[:, k]
        S[:, n + 3 + 2 * k, n + 2 + 2 * k] = omega[:, k]
    S *= T.pace[slot, None, None]
    terms = np.abs(np.concatenate([P, Q], axis=2))
    rates = np.abs(S)
    ones = np.ones((count, ns, 1))
    T.felt[slot] = np.any(rates, axis=1) | np.any(terms, axis=1)
    for k in range(GERM_ORDERS + 1):
        T.reach[slot, :g, k] = (terms @ ones)[:, :, 0]
        ones = rates @ ones
    T.S[slot] = S
    T.G[slot, :g, :n] = P
    T.G[slot, :g, n:] = Q
    T.R[slot, :blocks] = r
    # Rows: the guards, then the components of the state.
    first = T.c2.shape[1] - n
    rows = np.append(np.arange(g), np.arange(first, first + n))
    b = np.arange(blocks)
    at = (slot[:, None], rows)
    parts = (slot[:, None, None], rows[:, None])
    T.c1[at] = c1
    T.c2[at] = c2
    T.drifts[at] = np.any(c1 != 0.0, axis=2) | (c2 != 0.0)
    T.b[at] = wave
    T.a[*parts, b] = a
    T.swing[*parts, b] = np.abs(a)
    T.angle[*parts, b] = np.angle(a)
    T.swing[*parts, n + np.arange(waves)] = np.abs(wave)
    T.decays[slot, :g] = ~np.any((a[:, :g] != 0.0) & (modes[0].real > 0.0)[:, None, :], axis=2)
    T.switch[slot, :g], T.counts[slot, GUARDS] = switches, g


def real_or_zero(a: Array, p: Array, direct: Array) -> Array:
    """Re a p + direct, where what is only rounding is exactly zero: absent parts of a signal then
    cost nothing."""
    terms = np.abs(a) @ np.abs(p) + np.abs(direct)
    total = (a @ p).real + direct
    return np.where(np.abs(total) > 1e-14 * terms, total, 0.0)


def linearise(
    problem: Problem, constants: Constants, group: Array, mode: Array, region: Array
) -> tuple[Linear, Array]:
    """Modes as matrices, and which of them are of this form.

    Parameters
    ----------
    problem : Problem
    constants : Constants
        By group.
    group : array of int, shape (modes,)
        Whose constants hold in each mode.
    mode, region : array of int, shapes (modes, contacts) and (modes, kinks)
    """
    from stickslip.motion.engine import tables

    sizes = problem.rows.sizes
    layout = problem.compiled.layout
    omega = constants.omega[group]
    count = len(group)
    n = int(sizes[DIMENSION])
    nc = len(layout.u)
    nk = len(layout.kinks)
    ne = 2 + 2 * omega.shape[1]
    # Many times spread over slow and fast periods keep the fit of the drives well conditioned.
    slowest = np.min(np.where(omega > 0.0, omega, np.inf), axis=1, initial=np.inf)
    window = np.where(slowest < np.inf, 6.0 * np.pi / slowest, _AGES)
    several = [(0.6180339887498949 * k) % 1.0 for k in range(1, 6 * ne)]
    spread = several if omega.shape[1] else [1.0] * layout.timed
    d = 1 + len(spread)
    later = np.array([0.0, *spread]) * window[:, None]
    checks = np.array(
        [
            [np.cos(2.3 * i + 1.7 * k + 0.4) * (1.0, 1.0, 37.0, 37.0)[k] for i in range(n)]
            for k in range(4)
        ]
    ).reshape(4, n)
    checked = np.array([(0.1 * k + 0.007) * layout.timed for k in range(4)])
    times = np.hstack([later, np.zeros((count, n)), checked * window[:, None]])
    states = np.vstack([np.zeros((d, n)), _PROBE * np.eye(n), checks])
    out = np.zeros((count, len(states), n + 4 * nc + nk + len(problem.rows.doubtful)))
    hold = np.zeros((count, max(nc, 1), int(sizes[INERTIAL]) + 1))
    found = np.zeros(count, np.bool_)
    flow = problem.flow(constants)
    tables.probe_modes(problem.machine, flow, group, mode, region, times, states, out, hold, found)
    out[~found] = 0.0
    rest = out[:, :d]
    slopes = out[:, d : d + n]
    seen = out[:, d + n :]
    difference = slopes - rest[:, :1]
    difference[np.abs(difference) <= 4e-16 * (np.abs(slopes) + np.abs(rest[:, :1]))] = 0.0
    D = np.ascontiguousarray((difference / _PROBE).transpose(0, 2, 1))
    E = np.zeros((count, out.shape[2], ne))
    E[:, :, 0] = rest[:, 0]
    if omega.shape[1]:
        E, steady = fit_drives(drives(later, omega), rest, window)
        found &= steady
    elif layout.timed:
        # Late enough, all that was there at the beginning is lost in what has come with time.
        change = rest[:, -1] - rest[:, 0]
        E[:, :, 1] = change / later[:, -1:]
        found &= np.all((change == 0.0) | (np.abs(change) >= 1e-2 * np.abs(rest[:, 0])), axis=1)
    e = drives(times[:, d + n :], omega)
    predicted = checks @ D.transpose(0, 2, 1) + e @ E.transpose(0, 2, 1)
    size = np.abs(checks) @ np.abs(D).transpose(0, 2, 1) + np.abs(e) @ np.abs(E).transpose(0, 2, 1)
    found &= np.all(np.abs(predicted - seen) <= 1e-12 * size, axis=(1, 2))
    return Linear(D, E, hold, mode, region, omega), found


def fit_drives(basis: Array, values: Array, window: Array) -> tuple[Array, Array]:
    """Coefficients of the drives that give values at many times, and whether they are well
    determined."""
    basis[:, :, 1] /= window[:, None]
    U, s, Vh = np.linalg.svd(basis, full_matrices=False)
    steady = s[:, -1] > 1e-2 * s[:, 0]
    s = np.where(steady[:, None], s, 1.0)
    fit = Vh.transpose(0, 2, 1) @ ((U.transpose(0, 2, 1) @ values) / s[:, :, None])
    E = np.ascontiguousarray(fit.transpose(0, 2, 1))
    E[np.abs(E) <= 1e-14 * np.max(np.abs(values), axis=1)[:, :, None]] = 0.0
    E[:, :, 1] /= window[:, None]
    return E, steady


def drives(times: Array, omega: Array) -> Array:
    """(1, t, cos ω₁t, sin ω₁t, …), shape (modes, times, drives)."""
    angle = times[:, :, None] * omega[:, None, :]
    waves = np.stack([np.cos(angle), np.sin(angle)], axis=3).reshape(
        *times.shape, 2 * omega.shape[1]
    )
    return np.concatenate([np.ones((*times.shape, 1)), times[:, :, None], waves], axis=2)


def eigenmodes(a: Array, core: Array) -> tuple[tuple[Array, Array, Array], Array]:
    """Eigenvalues λ, eigenvectors V and L = V⁻¹ of a stack, and which of them are well-conditioned.

    Components that nothing depends on (followers: a leg dragged along) are eliminated first: x_f −
    z·x_core does not feel the core's motion, for z = A_f A_core⁻¹. So their zeros are exact zeros.
    """
    count = len(a)
    n = len(core)
    c = np.flatnonzero(core)
    f = np.flatnonzero(~core)
    inner = a[:, c[:, None], c]
    values: Array
    U: Array
    values, U = np.linalg.eig(inner)
    values, U = values.astype(complex), U.astype(complex)
    scale = np.max(np.abs(values), axis=1, initial=0.0)[:, None]
    values.imag[np.abs(values.imag) < 1e-12 * scale] = 0.0
    values[np.abs(values) < 1e-13 * scale] = 0.0
    good = ~np.any((values != 0.0) & (np.abs(values) < _SLOW * scale), axis=1)
    if len(f):
        good &= ~np.any(values == 0.0, axis=1)
    X, regular = inverses(U)
    dragged, driven = (
        inverses(inner) if len(f) and len(c) else (np.zeros_like(inner), np.ones(count, bool))
    )
    drag = a[:, f[:, None], c] @ dragged
    good &= regular & driven
    with np.errstate(all="ignore"):
        condition = np.linalg.norm(U, axis=1) * np.linalg.norm(X, axis=2)
        good &= np.all(condition < _CONDITION, axis=1)
    # Rounding where a zero belongs would make every signal look as if it had all parts.
    U, X, drag = (
        np.where(np.abs(m) > 1e-15 * np.max(np.abs(m), axis=k, initial=0.0, keepdims=True), m, 0.0)
        for m, k in ((U, 1), (X, 2), (drag, 2))
    )
    nc = len(c)
    first = np.arange(len(c))
    V, L = np.zeros((count, n, n), complex), np.zeros((count, n, n), complex)
    V[:, c[:, None], first], L[:, first[:, None], c] = U, X
    if len(f):
        ends = np.arange(nc, n)
        V[:, f, ends] = L[:, ends, f] = 1.0
        L[:, ends[:, None], c] = -drag
        slow = np.where(values == 0.0, 1.0, values)[:, None, :]
        V[:, f[:, None], first] = a[:, f[:, None], c] @ U / slow
    return (np.concatenate([values, np.zeros((count, len(f)))], axis=1), V, L), good


def inverses(a: Array) -> tuple[Array, Array]:
    """Inverses of a stack, and which exist."""
    exists = np.ones(len(a), bool)
    try:
        return np.linalg.inv(a), exists
    except np.linalg.LinAlgError:
        result = np.zeros_like(a)
        for i in range(len(a)):
            try:
                result[i] = np.linalg.inv(a[i])
            except np.linalg.LinAlgError:
                exists[i] = False
        return result, exists


def product_or_zero(A: Array, B: Array) -> Array:
    """A B with entries that are only rounding set to exactly zero: absent parts of a signal then
    cost nothing."""
    product = A @ B
    return np.where(np.abs(product) > 1e-14 * (np.abs(A) @ np.abs(B)), product, 0.0)


def guards(problem: Problem, linear: Linear) -> tuple[Array, Array, list[int]]:
    """Rows P, Q of all guards P x + Q e of modes in which the same contacts stick, and the switch
    each belongs to."""
    layout = problem.compiled.layout
    n = int(problem.rows.sizes[DIMENSION])
    nc = len(layout.u)
    nk = len(layout.kinks)
    mode = linear.mode
    F = np.concatenate([linear.D, linear.E], axis=2)
    u, force, plus, minus = (F[:, n + k * nc : n + (k + 1) * nc] for k in range(4))
    side = np.where(linear.region == 1, 1.0, -1.0)
    rows = [(F[:, n + 4 * nc + j] * side[:, j, None], j) for j in range(nk)]
    for c in range(nc):
        if mode[0, c] == 0:
            rows += [
                (force[:, c] + plus[:, c], nk + 2 * c),
                (minus[:, c] - force[:, c], nk + 2 * c + 1),
            ]
        else:
            rows.append((mode[:, c, None] * u[:, c], nk + 2 * c))
    for d, (_, c, side) in enumerate(problem.rows.doubtful):
        if c < 0 or np.all(mode[:, c] * side > 0):
            rows.append((F[:, n + 4 * nc + nk + d], nk + 2 * nc + d))
    table = np.stack([r for r, _ in rows], axis=1) if rows else np.zeros((len(F), 0, F.shape[2]))
    return table[:, :, :n], table[:, :, n:], [s for _, s in rows]


def constraints(problem: Problem, T: ClosedForms, linear: Linear, slot: Array) -> None:
    """Store what must vanish in a mode: u of sticking inertial, λ + σs of sliding rate-independent
    contacts."""
    n, nq, _, _, _, mq, mz = map(int, problem.rows.sizes[:7])
    mode = linear.mode
    nc = linear.mode.shape[1]
    F = np.concatenate([linear.D, linear.E], axis=2)
    for c in range(nc):
        if c < mq and mode[0, c] == 0:
            row = F[:, n + c]
            T.held[slot, c] = STICKS
            T.hold[slot, c, nq : 2 * nq] = linear.hold[:, c, :nq]
            T.brake[slot, c] = (F[:, n + 2 * nc + c] + F[:, n + 3 * nc + c]) * linear.hold[
                :, c, nq, None
            ]
        elif c >= mq + mz and mode[0, c] != 0:
            side = np.where(mode[:, c, None] > 0, F[:, n + 2 * nc + c], F[:, n + 3 * nc + c])
            row = F[:, n + nc + c] + mode[:, c, None] * side
            T.held[slot, c] = SLIDES
        else:
            continue
        T.zero[slot, c] = row
