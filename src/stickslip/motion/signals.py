"""First fall of a signal c₀ + c₁τ + c₂τ² + Re Σⱼ aⱼ exp(λⱼτ) + Re Σₘ bₘ exp(iωₘτ) below zero, found for certain."""

from __future__ import annotations

import cmath
import math

import numpy as np
from numba import njit

from stickslip.motion.kernel import INLINED, OPTIONS
from stickslip.motion.roots import NONE, first_crossing

Array = np.ndarray

WINDOW_ORDER = 22


@njit(**OPTIONS)
def length(z: complex) -> float:
    """|Re z| + |Im z|: a bound of the modulus that needs no square root."""
    return abs(z.real) + abs(z.imag)


@njit(**OPTIONS)
def signal(c: Array, a: Array, lam: Array, nb: int, b: Array, omega: Array, x: float) -> tuple[float, float]:
    """Value and slope of c₀ + c₁x + c₂x² + Re Σ aⱼ exp(λⱼx) + Re Σ bₘ exp(iωₘx)."""
    g, d = c[0] + x * (c[1] + x * c[2]), c[1] + 2.0 * x * c[2]
    for j in range(nb):
        if a[j] == 0.0:
            continue
        if lam[j].imag == 0.0:
            z = a[j].real * math.exp(lam[j].real * x)
            g += z
            d += lam[j].real * z
        else:
            r, angle = math.exp(lam[j].real * x), lam[j].imag * x
            cosine, sine = r * math.cos(angle), r * math.sin(angle)
            re = a[j].real * cosine - a[j].imag * sine
            im = a[j].real * sine + a[j].imag * cosine
            g += re
            d += lam[j].real * re - lam[j].imag * im
    for m in range(len(omega)):
        cosine, sine = math.cos(omega[m] * x), math.sin(omega[m] * x)
        g += b[m].real * cosine - b[m].imag * sine
        d -= omega[m] * (b[m].real * sine + b[m].imag * cosine)
    return g, d


@njit(**OPTIONS)
def falling_root(
    c: Array, a: Array, lam: Array, nb: int, b: Array, omega: Array, low: float, high: float, guess: float, floor: float
) -> float:
    """The crossing from + to − between low and high (Newton inside the bracket, down to the rounding of the values)."""
    x, noise = guess if low < guess < high else 0.5 * (low + high), floor / 32.0
    for _ in range(100):
        g, d = signal(c, a, lam, nb, b, omega, x)
        if abs(g) <= noise:
            return x
        if g > 0.0:
            low = x
        else:
            high = x
        new = x - g / d if d != 0.0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - x) <= 4e-16 * abs(new) or not low < new < high:
            return new
        x = new
    return x


@njit(**INLINED)
def first_fall(
    c: Array,
    a: Array,
    lam: Array,
    nb: int,
    b: Array,
    omega: Array,
    limit: float,
    floor: float,
    rising: int,
    work: Array,
    stack: Array,
) -> float:
    """First crossing from + to − of a signal in ]0, limit], or NONE-like infinity.

    Parameters
    ----------
    rising : int
        Order of the first Taylor coefficient that is not zero (0: the signal starts positive; > 0: it starts at zero).
    """
    # Only what this signal contains counts.
    real, waves, which = 0, 0, -1
    decay = True
    amplitude = 0.0
    for j in range(nb):
        size = length(a[j])
        if size > 0.1 * floor:
            which = j
            amplitude += size
            decay = decay and lam[j].real <= 0.0
            if lam[j].imag == 0.0:
                real += 1
            else:
                waves += 1
    drives = 0
    for m in range(len(omega)):
        size = length(b[m])
        if size > 0.1 * floor:
            drives += 1
            amplitude += size
    if decay and c[1] >= 0.0 and c[2] >= 0.0 and c[0] - amplitude > 0.0:
        return np.inf
    if drives == 0 and c[2] == 0.0:
        if waves == 0 and real == 0:
            return _line(c, limit, rising)
        if waves == 0 and real == 1:
            return _bend(c, a, lam, nb, b, omega, which, limit, floor, rising)
        if waves == 1 and real == 0 and c[1] == 0.0:
            return _wave(c, a, lam, nb, b, omega, which, limit, floor, rising)
    return _windows(c, a, lam, nb, b, omega, limit, floor, rising, work, stack)


@njit(**OPTIONS)
def _line(c: Array, limit: float, rising: int) -> float:
    """c₀ + c₁x."""
    if c[1] >= 0.0 or rising > 0:
        return np.inf
    x = -c[0] / c[1]
    return x if x <= limit else np.inf


@njit(**OPTIONS)
def _bend(
    c: Array, a: Array, lam: Array, nb: int, b: Array, omega: Array, j: int, limit: float, floor: float, rising: int
) -> float:
    """c₀ + c₁x + r exp(λx): convex or concave, so at most one extremum."""
    r, rate = a[j].real, lam[j].real
    ratio = -c[1] / (r * rate)
    turn = math.log(ratio) / rate if ratio > 0.0 else -1.0
    start = 0.0
    if turn > 0.0:
        if r > 0.0:  # a minimum: the crossing lies before it
            stop = min(turn, limit)
            if signal(c, a, lam, nb, b, omega, stop)[0] >= (-floor if stop == turn else 0.0):
                return np.inf
            return falling_root(c, a, lam, nb, b, omega, 0.0, stop, 0.0, floor)
        start = min(turn, limit)  # a maximum: the crossing lies after it
    elif rising > 0 and (r > 0.0 or c[1] + r * rate >= 0.0):
        return np.inf
    if signal(c, a, lam, nb, b, omega, limit)[0] >= 0.0:
        return np.inf
    guess = -c[0] / c[1] if c[1] != 0.0 and rate < 0.0 else 0.0
    if rate < 0.0 and r < 0.0 and c[1] < 0.0 and guess < limit:
        limit = guess  # below its asymptote: the asymptote's zero lies beyond the crossing
    return falling_root(c, a, lam, nb, b, omega, start, limit * (1.0 + 1e-15), guess, floor)


@njit(**OPTIONS)
def _wave(
    c: Array, a: Array, lam: Array, nb: int, b: Array, omega: Array, j: int, limit: float, floor: float, rising: int
) -> float:
    """c₀ + exp(μx) R cos(ωx + φ): its extrema are half a period apart."""
    mu, w = lam[j].real, lam[j].imag
    size = math.sqrt(a[j].real * a[j].real + a[j].imag * a[j].imag)
    phase = math.atan2(a[j].imag, a[j].real)
    half = math.pi / w
    # g′ = R|λ| exp(μx) cos(ωx + φ + arg λ) vanishes where its argument is π/2 modulo π.
    # There the cosine is ± sin(arg λ), so that the extrema need no trigonometry.
    turn = (0.5 * math.pi - phase - math.atan2(w, mu)) / w
    halves = math.floor(turn / half)
    turn -= half * halves
    swing = size * w / math.sqrt(mu * mu + w * w) * (1.0 if halves % 2 == 0 else -1.0)
    if rising > 1 and turn < 1e-7 * half:
        turn, swing = turn + half, -swing  # the signal starts at its minimum
    before, climbing = 0.0, rising > 0
    while True:
        if not climbing:
            if turn <= limit:
                stop, g = turn, c[0] + swing * math.exp(mu * turn)
            else:
                stop, g = limit, signal(c, a, lam, nb, b, omega, limit)[0]
                if abs(g) <= floor:
                    return limit  # it crosses together with the earliest event found so far
            if g < -floor:
                guess = 0.5 * (before + stop)
                cosine = -c[0] / (size * math.exp(mu * guess))
                if abs(cosine) < 1.0:
                    angle = math.acos(cosine) - phase  # there the cosine falls
                    guess = (angle - 2.0 * math.pi * math.floor((angle - w * before) / (2.0 * math.pi))) / w
                return falling_root(c, a, lam, nb, b, omega, before, stop, guess, floor)
        if turn >= limit or (mu <= 0.0 and c[0] > size * math.exp(mu * turn)):
            return np.inf
        climbing = False
        before, turn, swing = turn, turn + half, -swing


@njit(**OPTIONS)
def _windows(
    c: Array,
    a: Array,
    lam: Array,
    nb: int,
    b: Array,
    omega: Array,
    limit: float,
    floor: float,
    rising: int,
    work: Array,
    stack: Array,
) -> float:
    """Any signal: window after window, its Taylor polynomial and the roots of that."""
    fastest = 0.0
    for j in range(nb):
        fastest = max(fastest, abs(lam[j]))
    for m in range(len(omega)):
        fastest = max(fastest, omega[m])
    h = min(limit, 1.5 / fastest if fastest > 0.0 else limit)
    start, order = 0.0, rising
    N = WINDOW_ORDER
    while start < limit:
        h = min(h, limit - start)
        for k in range(N + 1):
            work[k] = 0.0
        work[0] = c[0] + start * (c[1] + start * c[2])
        work[1] = (c[1] + 2.0 * c[2] * start) * h
        work[2] = c[2] * h * h
        for j in range(nb):
            z = a[j] * cmath.exp(lam[j] * start)
            for k in range(N + 1):
                work[k] += z.real
                z = z * lam[j] * h / (k + 1)
        for m in range(len(omega)):
            z = b[m] * cmath.exp(1j * omega[m] * start)
            for k in range(N + 1):
                work[k] += z.real
                z = z * 1j * omega[m] * h / (k + 1)
        if order > 0:
            for k in range(N + 1 - order):
                work[k] = work[k + order]
        elif work[0] <= floor:
            # Touching zero at the seam of two windows: its sign decides there.
            if work[1] < 0.0:
                return start
            work[0] = abs(work[0])
        if work[0] > 0.0:
            x = first_crossing(work, N - order, 1.0, floor, stack)
            if x < NONE:
                return start + x * h
        start += h
        order = 0
    return np.inf
