"""Is a mode affine? If so, its closed form.

Within one mode and region the vector field and the guards are analytic, so probing them at a few states and times
decides: if random points agree with the affine prediction to rounding, they are affine. Time may enter as 1, t,
cos ωt and sin ωt with the frequencies of the declaration. A mode whose eigenvectors are nearly dependent, or that is
near resonance, is left to the Taylor steps, which need no such structure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.motion import affine, engine
from stickslip.motion.affine import ClosedForms

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem

Array = Any  # of floats, integers or complex numbers

PROBE = 65536.0  # large, so that constants do not drown the slopes; a power of 2, so that scaling is exact
CONDITION = 1e4
SLOW = 1e-6  # smallest eigenvalue, relative to the largest, that may be divided by


def make_closed_form(problem: Problem, T: ClosedForms, group: int, mode: Array, region: Array) -> None:
    """Put the closed form of a mode into the next slot of a group; its status says whether there is one."""
    slot = group * (len(T.status) // len(T.used)) + int(T.used[group])
    T.used[group] += 1
    T.key[slot] = affine.mode_key(mode, region)
    T.status[slot] = affine.SMOOTH
    linear = linearise(problem, mode, region)
    if linear is None:
        return
    D, E, hold = linear
    n = problem.rows.sizes[0]
    moving = np.flatnonzero(np.any(D[:n] != 0.0, axis=1) | np.any(E[:n] != 0.0, axis=1))
    modes = eigenmodes(D[np.ix_(moving, moving)])
    omega = problem.constants.omega
    if modes is None or np.any(np.abs(1j * omega[:, None] - modes[0][None, :]) < 1e-3 * omega[:, None]):
        return
    values, V, L = modes
    kept = np.flatnonzero(values.imag >= 0.0)
    nb, still = len(kept), np.setdiff1d(np.arange(n), moving)
    T.A[slot], T.F[slot], T.moves[slot] = D[:n], E[:n], np.isin(np.arange(n), moving)
    T.exponent[slot, :nb] = values[kept]
    T.inverse[slot, :nb] = np.divide(1.0, values[kept], out=np.zeros(nb, complex), where=values[kept] != 0.0)
    T.L[slot, :nb, moving] = L[kept].T
    T.B[slot][np.ix_(np.arange(nb), still)] = product_or_zero(L[kept], D[np.ix_(moving, still)])
    T.phi[slot, :nb] = product_or_zero(L[kept], E[moving])
    weight = np.where(values[kept].imag > 0.0, 2.0, 1.0)
    T.V[slot, moving, :nb] = weight * V[:, kept]
    P, Q, switches = guards(problem, mode, region, D, E)
    T.P[slot, : len(P)], T.Q[slot, : len(P)], T.switch[slot, : len(P)] = P, Q, switches
    T.PV[slot, : len(P), :nb] = product_or_zero(P[:, moving], weight * V[:, kept])
    constraints(problem, T, mode, D, E, hold, slot)
    T.counts[slot, 0], T.counts[slot, 1] = nb, len(P)
    T.shortest[slot] = 1.0 / max(np.max(np.abs(values), initial=0.0), np.max(omega, initial=0.0), 1e-300)
    if np.all(values == 0.0) and len(omega) == 0:
        T.shortest[slot] = 0.0
    T.status[slot] = affine.AFFINE


def linearise(problem: Problem, mode: Array, region: Array) -> tuple[Array, Array, Array] | None:
    """Matrices D, E with (rates, u, λ, s⁺, s⁻, guards) = D x + E e(t), or None if they are not of this form."""
    sizes, layout, omega = problem.rows.sizes, problem.compiled.layout, problem.constants.omega
    n, nc, nk, ne = int(sizes[0]), len(layout.u), len(layout.kinks), 2 + 2 * len(omega)
    # Many times spread over slow and fast periods keep the fit of the drives well conditioned.
    window = 6.0 * np.pi / np.min(omega, initial=1.0)
    drives = [0.0, *(window * ((0.6180339887498949 * k) % 1.0) for k in range(1, 6 * ne))] if layout.timed else [0.0]
    checks = np.array(
        [[np.cos(2.3 * i + 1.7 * k + 0.4) * (1.0, 1.0, 37.0, 37.0)[k] for i in range(n)] for k in range(4)]
    )
    times = np.array([*drives, *([0.0] * n), *((1.9 * k + 0.13) * layout.timed for k in range(4))])
    states = np.vstack([np.zeros((len(drives), n)), PROBE * np.eye(n), checks.reshape(4, n)])
    out, hold = np.zeros((len(times), n + 4 * nc + nk)), np.zeros((max(nc, 1), max(int(sizes[1]), 1)))
    if not engine.probe(
        problem.compiled.jets, problem.rows, problem.constants, problem.space(), mode, region, times, states, out, hold
    ):
        return None
    rest, slopes, seen = out[: len(drives)], out[len(drives) : len(drives) + n], out[len(drives) + n :]
    difference = slopes - rest[0]
    difference[np.abs(difference) <= 4e-16 * (np.abs(slopes) + np.abs(rest[0]))] = 0.0
    D, E = (difference / PROBE).T, np.zeros((out.shape[1], ne))
    if layout.timed:
        basis = np.array([drive(t, omega) for t in drives])
        basis[:, 1] /= window
        fit, _, _, spread = np.linalg.lstsq(basis, rest, rcond=None)
        if not spread[-1] > 1e-2 * spread[0]:
            return None
        fit[1] /= window
        E[:] = fit.T
        E[np.abs(E) <= 1e-14 * np.max(np.abs(rest), axis=0)[:, None]] = 0.0
    else:
        E[:, 0] = rest[0]
    e = np.array([drive(t, omega) for t in times[len(drives) + n :]])
    predicted, size = checks @ D.T + e @ E.T, np.abs(checks) @ np.abs(D.T) + np.abs(e) @ np.abs(E.T)
    return (np.ascontiguousarray(D), E, hold) if np.all(np.abs(predicted - seen) <= 1e-12 * size) else None


def drive(t: float, omega: Array) -> list[float]:
    """(1, t, cos ω₁t, sin ω₁t, …)."""
    return [1.0, t, *(f(w * t) for w in omega for f in (np.cos, np.sin))]


def eigenmodes(a: Array) -> tuple[Array, Array, Array] | None:
    """Eigenvalues λ, eigenvectors V and L = V⁻¹, or None if they are ill-conditioned.

    Components that nothing depends on (followers: a leg dragged along) are eliminated first: x_f − z·x_core does not
    feel the core's motion, for z = A_f A_core⁻¹. So their zeros are exact zeros.
    """
    core = np.flatnonzero(np.any(a != 0.0, axis=0))
    followers = np.flatnonzero(np.all(a == 0.0, axis=0))
    inner = a[np.ix_(core, core)]
    values: Array
    U: Array
    values, U = np.linalg.eig(inner) if len(core) else (np.zeros(0), np.zeros((0, 0)))
    values, U = values.astype(complex), U.astype(complex)
    scale = np.max(np.abs(values), initial=0.0)
    values.imag[np.abs(values.imag) < 1e-12 * scale] = 0.0
    values[np.abs(values) < 1e-13 * scale] = 0.0
    if np.any((values != 0.0) & (np.abs(values) < SLOW * scale)) or (len(followers) and np.any(values == 0.0)):
        return None
    try:
        X = np.linalg.inv(U)
        drag = np.zeros((len(followers), len(core)))
        if drag.size:
            drag = np.linalg.solve(inner.T, a[np.ix_(followers, core)].T).T
    except np.linalg.LinAlgError:
        return None
    with np.errstate(all="ignore"):
        condition = np.linalg.norm(U, axis=0) * np.linalg.norm(X, axis=1)
    if not np.all(condition < CONDITION):
        return None
    # Rounding where a zero belongs would make every signal look as if it had all parts.
    U, X, drag = (
        np.where(np.abs(m) > 1e-15 * np.max(np.abs(m), axis=k, initial=0.0, keepdims=True), m, 0.0)
        for m, k in ((U, 0), (X, 1), (drag, 1))
    )
    nc, n, first = len(core), len(a), np.arange(len(core))
    V, L = np.zeros((n, n), complex), np.zeros((n, n), complex)
    V[np.ix_(core, first)], L[np.ix_(first, core)] = U, X
    if len(followers):
        ends = np.arange(nc, n)
        V[followers, ends] = L[ends, followers] = 1.0
        L[np.ix_(ends, core)] = -drag
        V[np.ix_(followers, first)] = a[np.ix_(followers, core)] @ U / values
    return np.concatenate([values, np.zeros(len(followers))]), V, L


def product_or_zero(A: Array, B: Array) -> Array:
    """A B with entries that are only rounding set to exactly zero: absent parts of a signal then cost nothing."""
    product = A @ B
    return np.where(np.abs(product) > 1e-14 * (np.abs(A) @ np.abs(B)), product, 0.0)


def guards(problem: Problem, mode: Array, region: Array, D: Array, E: Array) -> tuple[Array, Array, list[int]]:
    """Rows P, Q of all guards P x + Q e of a mode, with the switch each belongs to."""
    layout, n = problem.compiled.layout, int(problem.rows.sizes[0])
    nc, nk = len(layout.u), len(layout.kinks)
    F = np.hstack([D, E])
    u, force, plus, minus = (F[n + k * nc : n + (k + 1) * nc] for k in range(4))
    rows = [(F[n + 4 * nc + j] * (1.0 if region[j] == 1 else -1.0), j) for j in range(nk)]
    for c in range(nc):
        if mode[c] == 0:
            rows += [(force[c] + plus[c], nk + c), (minus[c] - force[c], nk + c + 1000)]
        else:
            rows.append((mode[c] * u[c], nk + c))
    for d, row in enumerate(problem.rows.doubtful):
        side, c = (plus, layout.plus.index(row)) if row in layout.plus else (minus, layout.minus.index(row))
        rows.append((side[c], 2000 + d))
    table = np.array([r for r, _ in rows]).reshape(len(rows), F.shape[1])
    return table[:, :n], table[:, n:], [s for _, s in rows]


def constraints(problem: Problem, T: ClosedForms, mode: Array, D: Array, E: Array, hold: Array, slot: int) -> None:
    """Store what must vanish in a mode: u of sticking inertial, λ + σs of sliding rate-independent contacts."""
    n, nq, _, _, _, mq, mz = map(int, problem.rows.sizes[:7])
    nc = len(mode)
    F = np.hstack([D, E])
    T.zero_x[slot], T.zero_e[slot], T.hold[slot] = 0.0, 0.0, 0.0
    for c in range(nc):
        if c < mq and mode[c] == 0:
            row = F[n + c]
            T.hold[slot, c, nq : 2 * nq] = hold[c, :nq]
        elif c >= mq + mz and mode[c] != 0:
            row = F[n + nc + c] + mode[c] * F[n + (2 if mode[c] > 0 else 3) * nc + c]
        else:
            continue
        T.zero_x[slot, c], T.zero_e[slot, c] = row[:n], row[n:]
