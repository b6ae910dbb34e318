"""Rate-independent evolutions by small steps: block descent on ½dᵀAd − rᵀd + Σ Ψ_g(d_g), and the
scalar play by clamps.

Times are dense where load and thresholds are narrow. Shares nothing with the library but how
functions are compiled.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from stickslip.arrays import Array, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.translator import compiled

SWEEPS = 400
ENOUGH = 1e-13
# of inserting the turning points of bounds: in the tail of a pulse they are far from parabolas
ROUNDS = 40


@compiled()
def _interval(a: float, r: float, low: float, high: float) -> float:
    """Least of ½ a d² − r d + max(low d, high d)."""
    if r > high:
        return (r - high) / a
    if r < low:
        return (r - low) / a
    return 0.0


@compiled()
def _disc(p: float, q: float, s: float, r0: float, r1: float, radius: float) -> tuple[float, float]:
    """Least of ½ dᵀ a d − rᵀ d + radius |d| in the plane, a = ((p, q), (q, s)): (a + λ) d = r with
    λ |d| = radius, by bisection in λ."""
    if math.hypot(r0, r1) <= radius:
        return 0.0, 0.0
    low = 0.0
    high = 1.0
    for _ in range(200):
        x, y = _solved(p + high, q, s + high, r0, r1)
        if high * math.hypot(x, y) >= radius:
            break
        high *= 4.0
    if radius > 0.0:
        for _ in range(200):
            middle = 0.5 * (low + high)
            x, y = _solved(p + middle, q, s + middle, r0, r1)
            if middle * math.hypot(x, y) >= radius:
                high = middle
            else:
                low = middle
            if high - low <= 1e-16 * high:
                break
    else:
        high = 0.0
    return _solved(p + high, q, s + high, r0, r1)


@compiled()
def _solved(p: float, q: float, s: float, r0: float, r1: float) -> tuple[float, float]:
    """The solution of ((p, q), (q, s)) d = r."""
    det = p * s - q * q
    return (s * r0 - q * r1) / det, (p * r1 - q * r0) / det


@entry_point()
def _follow(
    A: Matrix,
    loads: Matrix,
    low: Matrix,
    high: Matrix,
    discs: bool,
    z: Vector,
    r: Vector,
    d: Vector,
    states: Matrix,
) -> None:
    """What :func:`follow` gives, in `states`.

    Parameters
    ----------
    z : array
        The state; changed.
    r, d : arrays, shape (n,)
        Work space.
    """
    n = len(A)
    size = 2 if discs else 1
    for k in range(len(loads)):
        largest = 0.0
        for i in range(n):
            pulled = 0.0
            for j in range(n):
                pulled += A[i, j] * z[j]
            r[i] = loads[k, i] - pulled
            largest = max(largest, abs(r[i]))
            d[i] = 0.0
        bound = 0.0
        for g in range(n // size):
            bound = max(bound, abs(high[k, g]))
        scale = largest + bound
        for _ in range(SWEEPS):
            change = 0.0
            for g in range(n // size):
                i = size * g
                before0 = d[i]
                before1 = d[i + size - 1]
                rest0 = r[i] + A[i, i] * d[i]
                for j in range(n):
                    rest0 -= A[i, j] * d[j]
                if discs:
                    rest0 += A[i, i + 1] * d[i + 1]
                    rest1 = r[i + 1] + A[i + 1, i + 1] * d[i + 1] + A[i + 1, i] * d[i]
                    for j in range(n):
                        rest1 -= A[i + 1, j] * d[j]
                    own0, own1 = _disc(
                        A[i, i], A[i, i + 1], A[i + 1, i + 1], rest0, rest1, high[k, g]
                    )
                    d[i] = own0
                    d[i + 1] = own1
                    change = max(change, abs(own1 - before1) * A[i + 1, i + 1])
                else:
                    d[i] = _interval(A[i, i], rest0, low[k, i], high[k, i])
                change = max(change, abs(d[i] - before0) * A[i, i])
            if change <= ENOUGH * scale:
                break
        for i in range(n):
            z[i] += d[i]
            states[k, i] = z[i]


def follow(A: Array, loads: Array, low: Array, high: Array, discs: bool, z: Array) -> Array:
    """States after each load: boxes [low, high], or discs in the plane with the radii `high`."""
    A, loads, low, high = (np.require(x, float, ("C", "A", "W")) for x in (A, loads, low, high))
    states = np.empty(loads.shape)
    n = len(A)
    _follow(A, loads, low, high, discs, np.array(z, dtype=float), np.empty(n), np.empty(n), states)
    return states


def play(
    times: Array, low: Callable[[Array], Array], high: Callable[[Array], Array], z: float, at: Array
) -> Array:
    """The scalar play between L and U at given times: a clamp, exact where the bounds are monotone
    between times."""
    t = np.union1d(times, at)
    lower, upper = low(t), high(t)
    for _ in range(ROUNDS):
        new = np.setdiff1d(np.concatenate([_vertices(t, lower), _vertices(t, upper)]), t)
        if len(new) == 0:
            break
        order = np.argsort(np.concatenate([t, new]))
        t = np.concatenate([t, new])[order]
        lower = np.concatenate([lower, low(new)])[order]
        upper = np.concatenate([upper, high(new)])[order]
    states = _clamped(lower, upper, z)
    return states[np.searchsorted(t, at)]


def _vertices(t: Array, y: Array) -> Array:
    """Tips of parabolas through the neighbours of local extrema, where these are lower by more than
    rounding."""
    k = np.flatnonzero((y[1:-1] - y[:-2]) * (y[2:] - y[1:-1]) < 0.0) + 1
    a = t[k - 1]
    b = t[k]
    c = t[k + 1]
    p = (b - a) * (y[k] - y[k + 1])
    q = (b - c) * (y[k] - y[k - 1])
    with np.errstate(all="ignore"):
        tip = b - 0.5 * ((b - a) * p - (b - c) * q) / (p - q)
        bend = ((y[k + 1] - y[k]) / (c - b) - (y[k] - y[k - 1]) / (b - a)) / (c - a)
        counts = np.abs(bend) * (tip - b) ** 2 > 1e-15 * np.max(np.abs(y))
    return tip[(tip > a) & (tip < c) & counts]


def _clamped(low: Array, high: Array, z: float) -> Array:
    """A number that stays between bounds by as little as it has to, after each pair of them."""
    states = []
    for least, most in zip(low.tolist(), high.tolist(), strict=True):
        z = min(max(z, least), most)
        states.append(z)
    return np.array(states)
