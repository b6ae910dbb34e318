"""Motions from a Lagrange function and dry friction in one direction: SymPy derives the equations,
SciPy follows them from event to event. Nothing here is ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

from stickslip.arrays import Array

_TOLERANCES: dict[str, Any] = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13}
_AWAY = 1e-3  # a slip's first instants, in which its speed is still zero to the event


def motion(
    coordinates: Sequence[str],
    kinetic: str,
    potential: str,
    direction: str,
    threshold: float,
    start: Mapping[str, float],
    end: float,
) -> Array:
    """Coordinates and rates at a time.

    Parameters
    ----------
    coordinates : sequence of str
    kinetic, potential : str
        T(t, x, d_x) and V(t, x).
    direction : str
        Relative velocity u, linear in the rates.
    threshold : float
        Largest modulus of the friction force.
    start : mapping of str to float
        At t = 0; what is not there is 0.
    end : float
    """
    t = sp.Symbol("t")
    q = sp.symbols(list(coordinates))
    v = sp.symbols([f"d_{x}" for x in coordinates])
    names = {str(s): s for s in (t, *q, *v)}
    read: Any = sp.sympify
    T, V, u = (read(text, locals=names) for text in (kinetic, potential, direction))
    momenta = [sp.diff(T, rate) for rate in v]
    M = sp.Matrix([[sp.diff(p, rate) for rate in v] for p in momenta])

    def carried(e: sp.Expr) -> sp.Expr:
        return sp.diff(e, t) + sum(sp.diff(e, x) * rate for x, rate in zip(q, v, strict=True))

    force = sp.Matrix([sp.diff(T - V, x) - carried(p) for x, p in zip(q, momenta, strict=True)])
    slopes = [sp.diff(u, rate) for rate in v]
    J = sp.Matrix([slopes])
    turn = sum(carried(j) * rate for j, rate in zip(slopes, v, strict=True)) + carried(
        u - sum(j * rate for j, rate in zip(slopes, v, strict=True))
    )
    parts = sp.lambdify([t, q, v], [M, force, J, u, turn], "numpy")
    n = len(q)

    def forces(time: float, y: Array, mode: int) -> tuple[Array, float, float]:
        """Accelerations, friction force and relative velocity."""
        mass, pull, rows, slip, extra = parts(time, y[:n], y[n:])
        row = np.asarray(rows, float).reshape(-1)
        free = np.linalg.solve(mass, np.asarray(pull, float).reshape(-1))
        given = np.linalg.solve(mass, row)
        friction = -mode * threshold if mode else -(row @ free + extra) / (row @ given)
        return free + given * friction, float(friction), float(slip)

    y = np.array([float(start.get(str(s), 0.0)) for s in (*q, *v)])
    now = 0.0
    held = abs(forces(0.0, y, 0)[2]) < 1e-12
    mode = 0 if held else int(np.sign(forces(0.0, y, 0)[2]))
    while now < end:
        if mode == 0 and abs(forces(now, y, 0)[1]) > threshold * (1 - 1e-12):
            mode = -int(np.sign(forces(now, y, 0)[1]))
            now, y = _followed(forces, n, mode, now, min(now + _AWAY, end), y, None)
            continue

        def margin(time: float, y: Array, mode: int = mode) -> float:
            _, friction, slip = forces(time, y, mode)
            return mode * slip if mode else threshold - abs(friction)

        now, y = _followed(forces, n, mode, now, end, y, margin)
        if now < end:
            needed = forces(now, y, 0)[1]
            turns = mode != 0 and abs(needed) > threshold
            mode = -int(np.sign(needed)) if turns or mode == 0 else 0
            if mode:
                now, y = _followed(forces, n, mode, now, min(now + _AWAY, end), y, None)
    return y


def _followed(
    forces: Any, n: int, mode: int, now: float, end: float, y: Array, margin: Any
) -> tuple[float, Array]:
    """Time and state at the end, or where a margin falls through zero."""

    def rates(time: float, y: Array) -> Array:
        return np.concatenate([y[n:], forces(time, y, mode)[0]])

    events = []
    if margin is not None:

        def falls(time: float, y: Array) -> float:
            return margin(time, y)

        falls.terminal = True  # type: ignore[attr-defined]
        falls.direction = -1  # type: ignore[attr-defined]
        events = [falls]
    found = solve_ivp(rates, (now, end), y, events=events, **_TOLERANCES)
    return float(found.t[-1]), np.asarray(found.y[:, -1])
