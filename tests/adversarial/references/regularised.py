"""A second opinion: friction smoothed and integrated as a stiff equation. Coarse, but it decides
nothing by itself.

Every coordinate gets a small mass if it has none, and a contact pulls with −k tanh(u/ε), with s up
to |u| ≈ 30ε. The error is of that order; it shows gross mistakes of an event-driven method, which
knows of modes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.integrate import Radau

from .mechanics import TIME, Array, Law, Mechanics, pair


def regularised(
    m: Mechanics,
    span: tuple[float, float],
    start: Sequence[float] | Array,
    times: Array,
    epsilon: float = 1e-5,
) -> Array:
    """States (x, v, a) at given times.

    Raises
    ------
    RuntimeError
        If the stiff integrator gives up.
    """
    nq, nz, nr, na = m.kinds
    n = nq + nz + nr
    p = nq + nz
    J = np.asarray(m.J, dtype=float).reshape(len(m.J), n)
    inertia = np.asarray(m.inertia, dtype=float).reshape(p, p)
    mass = 1e-4 * epsilon * np.eye(n)
    mass[:nq, :nq] = inertia[:nq, :nq]
    damping = np.zeros((n, n))
    damping[nq:p, nq:p] = inertia[nq:, nq:]
    damping[p:, p:] = 1e-4 * np.eye(nr)  # enough to keep the small masses from swinging
    inverse = np.linalg.inv(mass)

    def rhs(t: float, y: Array) -> Array:
        x = y[:n]
        rates = y[n : 2 * n]
        a = y[2 * n :]
        v = rates[:nq]
        side = (
            np.where(np.asarray(m.kinks(t, x, v, a)) >= 0, 1, -1)
            if m.kinks is not None
            else np.zeros(0)
        )
        w = np.asarray(m.belt(t), dtype=float) if m.belt is not None else np.zeros(len(J))
        u = J @ rates - w
        plus, minus = pair(m.threshold(t, x, v, a, side))
        bound = np.where(u > 0, plus, minus)
        if m.kinetic is not None:
            k_plus, k_minus = pair(m.kinetic(t, x, v, a, side, np.abs(u)))
            kinetic = np.where(u > 0, k_plus, k_minus)
            bound = kinetic + (bound - kinetic) * np.exp(-((u / (30 * epsilon)) ** 8))
        force = (
            np.asarray(m.force(t, x, v, a, side))
            - damping @ rates
            - J.T @ (bound * np.tanh(u / epsilon))
        )
        law = np.asarray(m.law(t, x, rates, a, side)) if m.law is not None else np.zeros(na)
        return np.concatenate([rates, inverse @ force, law])

    first = np.asarray(start, dtype=float)
    y = np.concatenate([first[:n], np.zeros(n), first[n + nq :]])
    y[n : n + nq] = first[n : n + nq]
    return _steps(m, rhs, span, y, times, n, nq)


def _steps(
    m: Mechanics, rhs: Law, span: tuple[float, float], y: Array, times: Array, n: int, nq: int
) -> Array:
    solver = Radau(rhs, span[0], y, span[1], max_step=m.step, rtol=1e-7, atol=1e-10)
    found: list[Array] = [np.array(y) for t in times if t <= span[0]]
    while solver.status == "running":
        limit = m.step
        for zone in m.zones:
            if zone.row == TIME:
                limit = min(limit, (abs(solver.t - zone.place) + zone.width) / 3)
            else:
                row = zone.row if zone.row < n + nq else zone.row + n - nq
                speed = abs(rhs(solver.t, solver.y)[row] - zone.speed) + 1e-9
                reach = abs(solver.y[row] - zone.place - zone.speed * solver.t) + zone.width
                limit = min(limit, reach / (3 * speed))
        solver.max_step = limit
        solver.h_abs = min(solver.h_abs, limit)
        solver.step()
        if solver.status == "failed":
            raise RuntimeError(f"Radau stopped at t = {solver.t:.6g}")
        dense = solver.dense_output()
        while len(found) < len(times) and times[len(found)] <= solver.t:
            found.append(dense(times[len(found)]))
    states = np.array(found).reshape(len(found), -1)
    return np.hstack([states[:, : n + nq], states[:, 2 * n :]])
