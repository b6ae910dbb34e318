"""The motion between its knots: values at any time, and integrals over each step.

A trajectory stores the state at the start of every step, no polynomial: the Taylor series is made again from that
state, so values between knots are as accurate as at the knots, and a stored file gives the same numbers. A long flight
in closed form is retraced in Taylor steps, so that its end is checked by a method that did not produce it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from stickslip.motion.engine import JETS, POWERS, ROUNDING, resolve, step_size
from stickslip.motion.roots import horner

Array = np.ndarray
GAUSS_NODES, GAUSS_WEIGHTS = (0.5 * (x + shift) for x, shift in zip(np.polynomial.legendre.leggauss(14), (1.0, 0.0), strict=True))
GAUSS_NODES, GAUSS_WEIGHTS = np.ascontiguousarray(GAUSS_NODES), np.ascontiguousarray(GAUSS_WEIGHTS)

_options = {"cache": True, "error_model": "numpy", "nogil": True}


@njit(**_options)
def sample(jets: JETS, powers: POWERS, sizes: Array, rows: int, magnitudes: int, K: Array, M: Array, C: Array, J: Array, N: int, tol: float, atol: float,
           knot_time: Array, knot_state: Array, knot_mode: Array, knot_region: Array, index: Array, times: Array, out: Array) -> None:
    """Order-0 values of all rows, then energy, dissipated and supplied power, at given times.

    Parameters
    ----------
    index : array of int, shape (times,)
        Knot whose step each time belongs to.
    out : array, shape (times, rows + 3)
    """
    n, nq, nz, nr, mq, mz = sizes[0], sizes[1], sizes[2], sizes[3], sizes[5], sizes[6]
    W, V, mag, y = np.zeros((rows, N + 1)), np.zeros((rows, 2)), np.zeros(magnitudes), np.zeros(n)
    R = (np.zeros((nq + mq, nq + mq)), np.zeros((nz + mz, nz + mz)))
    A, B = np.zeros((nr, nr)), np.zeros((nr, nr))
    big = max(nq + mq, nz + mz)
    scratch, known, power = np.zeros((big, big)), np.ones(mq + mz + 1, np.int64), np.zeros(3)
    nothing = np.zeros(0, np.int64)
    mode, reg = np.zeros(knot_mode.shape[1], np.int64), np.zeros(knot_region.shape[1], np.int64)
    last, base, h = -1, 0.0, 0.0
    for i in range(len(times)):
        k = index[i]
        if k != last or times[i] < base:
            last, base = k, knot_time[k]
            mode[:] = knot_mode[k]
            reg[:] = knot_region[k]
            resolve(sizes, mode, known, M, C, J, scratch, R)
            jets(base, knot_state[k], mode, reg, K, R[0], R[1], N, W, A, B, mag)
            h = step_size(W, nothing, n, N, 0.0, tol, atol)
        while times[i] - base > h:
            for r in range(n):
                y[r] = horner(W[r], N, h)
            base += h
            jets(base, y, mode, reg, K, R[0], R[1], N, W, A, B, mag)
            h = max(step_size(W, nothing, n, N, h, tol, atol), 1e-12 * (times[i] - base))
        for r in range(n):
            y[r] = horner(W[r], N, times[i] - base)
        jets(times[i], y, mode, reg, K, R[0], R[1], 1, V, A, B, mag)
        powers(V, reg, K, power)
        out[i, :rows] = V[:, 0]
        out[i, rows:] = power


@njit(**_options)
def integrate_steps(jets: JETS, powers: POWERS, sizes: Array, u_rows: Array, force: Array, plus: Array, minus: Array, kinks: Array,
                    rate_rows: Array, rate_sizes: Array, first_rate_contact: int, rows: int, magnitudes: int, K: Array, M: Array, C: Array, J: Array,
                    N: int, tol: float, atol: float, knot_time: Array, knot_state: Array, knot_mode: Array, knot_region: Array, ends: Array, check: bool,
                    nodes: Array, weights: Array, work: Array, change: Array, noise: Array, largest: Array,
                    worst: Array) -> None:
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
        Receives the largest |λ| − s, |λ + σk| of rate-independent contacts, |u| in stick, −σu in slip, the scales of force
        and velocity, the velocity that the forces in stick hold back, the supplied energy in modulus; then for each kink the largest −guard and |guard|.
    """
    n, nq, nz, nr, mq, mz = sizes[0], sizes[1], sizes[2], sizes[3], sizes[5], sizes[6]
    nc, nk = len(u_rows), len(kinks)
    W, V, mag, y, start = np.zeros((rows, N + 1)), np.zeros((rows, 2)), np.zeros(magnitudes), np.zeros(n), np.zeros(n)
    R = (np.zeros((nq + mq, nq + mq)), np.zeros((nz + mz, nz + mz)))
    A, B = np.zeros((nr, nr)), np.zeros((nr, nr))
    big = max(nq + mq, nz + mz)
    scratch, known, power = np.zeros((big, big)), np.ones(mq + mz + 1, np.int64), np.zeros(3)
    mode, reg = np.zeros(nc, np.int64), np.zeros(nk, np.int64)
    for k in range(len(ends)):
        left = ends[k] - knot_time[k]
        if not left > 0.0:
            continue
        mode[:] = knot_mode[k]
        reg[:] = knot_region[k]
        resolve(sizes, mode, known, M, C, J, scratch, R)
        base, last = knot_time[k], 0.0
        start[:] = knot_state[k]
        while left > 0.0:
            jets(base, start, mode, reg, K, R[0], R[1], N, W, A, B, mag)
            # The forces, too: a body at rest may feel a load that changes.
            h = min(left, max(step_size(W, force, n, N, last, tol, atol), 1e-12 * left))
            for g in range(len(nodes)):
                tau = h * nodes[g]
                for r in range(n):
                    y[r] = horner(W[r], N, tau)
                jets(base + tau, y, mode, reg, K, R[0], R[1], 1, V, A, B, mag)
                powers(V, reg, K, power)
                work[k, 0] += weights[g] * h * power[1]
                work[k, 1] += weights[g] * h * power[2]
                worst[7] += weights[g] * h * abs(power[2])
                for r in range(n):
                    change[k, r] += weights[g] * h * V[rate_rows[r], 0]
                    largest[r] = max(largest[r], abs(y[r]))
                if check:
                    inspect(V, mag, mode, reg, u_rows, force, plus, minus, kinks, first_rate_contact, worst)
            for c in range(mq + mz):
                if check and mode[c] == 0:
                    free = mag[2 * nc + c] / abs(R[0][nq + c, nq + c] if c < mq else R[1][nz + c - mq, nz + c - mq])
                    worst[6] = max(worst[6], free * h if c < mq else free)
            for r in range(n):
                start[r] = horner(W[r], N, h)
            base, left, last = base + h, left - h, h


@njit(**_options)
def inspect(V: Array, mag: Array, mode: Array, reg: Array, u_rows: Array, force: Array, plus: Array, minus: Array, kinks: Array,
            first_rate_contact: int, worst: Array) -> None:
    """Compare one instant with the friction law; the largest violations so far are kept in `worst`."""
    nc = len(u_rows)
    for c in range(nc):
        u, held, up, down = V[u_rows[c], 0], V[force[c], 0], V[plus[c], 0], V[minus[c], 0]
        # Where thresholds vanish, a force is known up to the rounding of its terms only.
        worst[4] = max(worst[4], max(abs(held), max(up, down)), 1e-5 * mag[2 * nc + c])
        worst[5] = max(worst[5], abs(u), 1e-5 * mag[c])
        worst[0] = max(worst[0], max(-up - held, held - down))
        rounding = ROUNDING * mag[c]
        if mode[c] == 0:
            worst[2] = max(worst[2], abs(u) - rounding)
        else:
            worst[3] = max(worst[3], -mode[c] * u - rounding)
            if c >= first_rate_contact:
                worst[1] = max(worst[1], abs(held + (up if mode[c] > 0 else -down)))
    for j in range(len(kinks)):
        value = V[kinks[j], 0] if reg[j] == 1 else -V[kinks[j], 0]
        worst[8 + 2 * j] = max(worst[8 + 2 * j], -value)
        worst[9 + 2 * j] = max(worst[9 + 2 * j], abs(value))
