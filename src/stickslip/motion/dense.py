"""The motion between its knots: values at any time, and integrals over each step.

A trajectory stores the state at the start of every step, no polynomial: the Taylor series is made again from that
state, so values between knots are as accurate as at the knots, and a stored file gives the same numbers. A long flight
in closed form is retraced in Taylor steps, so that its end is checked by a method that did not produce it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from stickslip.motion.guards import finite_order, step_size
from stickslip.motion.kernel import ALLOCATING, JETS, OPTIONS, POWERS, ROUNDING, Constants, Rows, Space
from stickslip.motion.modes import copy, resolve
from stickslip.motion.roots import horner

Array = np.ndarray
_nodes, _weights = np.polynomial.legendre.leggauss(14)
GAUSS_NODES, GAUSS_WEIGHTS = 0.5 * (_nodes + 1.0), 0.5 * _weights  # on [0, 1]


@njit(**ALLOCATING)
def sample(
    jets: JETS,
    powers: POWERS,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    tol: float,
    atol: float,
    knot_time: Array,
    knot_state: Array,
    knot_mode: Array,
    knot_region: Array,
    index: Array,
    times: Array,
    out: Array,
) -> None:
    """Order-0 values of all rows, then energy, dissipated and supplied power, at given times.

    Parameters
    ----------
    index : array of int, shape (times,)
        Knot whose step each time belongs to.
    out : array, shape (times, rows + 3)
    """
    sizes, W, A, B, mag, n = rows.sizes, space.W, space.A, space.B, space.mag, rows.sizes[0]
    V, y, power, nothing = np.zeros((len(W), 2)), np.zeros(n), np.zeros(3), np.zeros(0, np.int64)
    mode, reg = np.zeros(knot_mode.shape[1], np.int64), np.zeros(knot_region.shape[1], np.int64)
    last, base, h, order, known = -1, 0.0, 0.0, N, False
    for i in range(len(times)):
        knot = index[i]
        if knot != last or times[i] < base:
            last, base = knot, knot_time[knot]
            copy(knot_mode[knot], mode)
            copy(knot_region[knot], reg)
            copy(knot_state[knot], y)
            resolve(sizes, k, space, mode)
            known = False
        if times[i] > base and not known:  # at the knot itself no series is needed
            jets(base, y, mode, reg, k.K, space.Rq, space.Rz, N, W, A, B, mag)
            order = finite_order(W, n, N)
            h, known = step_size(W, nothing, n, order, 0.0, tol, atol), True
        while known and times[i] - base > h:
            for r in range(n):
                y[r] = horner(W[r], order, h)
            base += h
            jets(base, y, mode, reg, k.K, space.Rq, space.Rz, N, W, A, B, mag)
            order = finite_order(W, n, N)
            h = max(step_size(W, nothing, n, order, h, tol, atol), 1e-12 * (times[i] - base))
        if known:
            for r in range(n):
                y[r] = horner(W[r], order, times[i] - base)
        jets(times[i], y, mode, reg, k.K, space.Rq, space.Rz, 1, V, A, B, mag)
        powers(V, reg, k.K, power)
        for r in range(len(W)):
            out[i, r] = V[r, 0]
        for r in range(3):
            out[i, len(W) + r] = power[r]


@njit(**OPTIONS)
def integrate_steps(
    jets: JETS,
    powers: POWERS,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    tol: float,
    atol: float,
    rate_rows: Array,
    rate_sizes: Array,
    knot_time: Array,
    knot_state: Array,
    knot_mode: Array,
    knot_region: Array,
    ends: Array,
    check: bool,
    work: Array,
    change: Array,
    noise: Array,
    largest: Array,
    worst: Array,
) -> None:
    """Integrals of the dissipated and supplied power over [knot k, ends[k]], and violations of the friction law.

    Parameters
    ----------
    work : array, shape (knots, 2)
        Receives dissipated and supplied energy of each step.
    change : array, shape (knots, n)
        Receives the integral of the right-hand side over each step.
    noise : array, shape (knots, n)
        Receives the rounding error of that integral, from the size of the terms that cancel in it.
    largest : array, shape (n,)
        Receives the largest modulus of each component on the way: knots may all lie where it vanishes.
    worst : array, shape (8 + 2·kinks,)
        Receives the largest |λ| − s, |λ + σk| of rate-independent contacts, |u| in stick, −σu in slip, the scales of
        force and velocity, the velocity that the forces in stick hold back, the supplied energy in modulus; then for
        each kink the largest −guard and |guard|.
    """
    sizes, W, A, B, mag, Rq, Rz = rows.sizes, space.W, space.A, space.B, space.mag, space.Rq, space.Rz
    n, nq, nz, nr, mq, mz, nc = sizes[0], sizes[1], sizes[2], sizes[3], sizes[5], sizes[6], len(rows.u)
    # Parts of the work space that are free between steps.
    V, y, start, power = space.V, space.y0, space.trial, space.powers
    mode, reg = space.touched[:nc], space.touched[nc:]
    for i in range(len(ends)):
        left = ends[i] - knot_time[i]
        if not left > 0.0:
            continue
        copy(knot_mode[i], mode)
        copy(knot_region[i], reg)
        resolve(sizes, k, space, mode)
        base, last = knot_time[i], 0.0
        copy(knot_state[i], start)
        while left > 0.0:
            jets(base, start, mode, reg, k.K, Rq, Rz, N, W, A, B, mag)
            # The forces, too: a body at rest may feel a load that changes.
            order = finite_order(W, n, N)
            h = min(left, max(step_size(W, rows.force, n, order, last, tol, atol), 1e-12 * left))
            for g in range(len(GAUSS_NODES)):
                tau, weight = h * GAUSS_NODES[g], h * GAUSS_WEIGHTS[g]
                for r in range(n):
                    y[r] = horner(W[r], order, tau)
                jets(base + tau, y, mode, reg, k.K, Rq, Rz, 1, V, A, B, mag)
                powers(V, reg, k.K, power)
                work[i, 0] += weight * power[1]
                work[i, 1] += weight * power[2]
                worst[7] += weight * abs(power[2])
                for r in range(n):
                    change[i, r] += weight * V[rate_rows[r], 0]
                    largest[r] = max(largest[r], abs(y[r]))
                    if rate_sizes[r] >= 0:
                        noise[i, r] += weight * ROUNDING * mag[rate_sizes[r]]
                if check:
                    inspect(rows, V, mag, mode, reg, worst)
            for c in range(mq + mz):
                if check and mode[c] == 0:
                    free = mag[2 * nc + c] / abs(Rq[nq + c, nq + c] if c < mq else Rz[nz + c - mq, nz + c - mq])
                    worst[6] = max(worst[6], free * h if c < mq else free)
            for r in range(n):
                start[r] = horner(W[r], order, h)
            base, left, last = base + h, left - h, h
        # What slides without viscosity is put back onto λ + σ s = 0, which is known to the rounding of its terms.
        for j in range(nr):
            c = mq + mz + j
            if mode[c] != 0:
                terms = mag[2 * nc + c] + max(abs(V[rows.plus[c], 0]), abs(V[rows.minus[c], 0]))
                for r in range(nr):
                    noise[i, 2 * nq + nz + r] += ROUNDING * abs(B[r, j]) * terms


@njit(**OPTIONS)
def inspect(rows: Rows, V: Array, mag: Array, mode: Array, reg: Array, worst: Array) -> None:
    """Compare one instant with the friction law; the largest violations so far are kept in `worst`."""
    nc = len(rows.u)
    for c in range(nc):
        u, held, up, down = V[rows.u[c], 0], V[rows.force[c], 0], V[rows.plus[c], 0], V[rows.minus[c], 0]
        # Where thresholds vanish, a force is known up to the rounding of its terms only.
        worst[4] = max(worst[4], max(abs(held), max(up, down)), 1e-5 * mag[2 * nc + c])
        worst[5] = max(worst[5], abs(u), 1e-5 * mag[c])
        worst[0] = max(worst[0], max(-up - held, held - down))
        rounding = ROUNDING * mag[c]
        if mode[c] == 0:
            worst[2] = max(worst[2], abs(u) - rounding)
        else:
            worst[3] = max(worst[3], -mode[c] * u - rounding)
            if c >= rows.sizes[5] + rows.sizes[6]:
                worst[1] = max(worst[1], abs(held + (up if mode[c] > 0 else -down)))
    for j in range(len(rows.kinks)):
        value = V[rows.kinks[j], 0] if reg[j] == 1 else -V[rows.kinks[j], 0]
        worst[8 + 2 * j] = max(worst[8 + 2 * j], -value)
        worst[9 + 2 * j] = max(worst[9 + 2 * j], abs(value))
