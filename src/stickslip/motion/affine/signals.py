"""First zero crossing, from above, of a signal c₀ + c₁τ + c₂τ² + Re Σⱼ aⱼ exp(λⱼτ) + Re Σₘ bₘ
exp(iωₘτ), which is never missed.

A signal with one part in motion is searched between its extrema, which are known; any other window
by window, as a polynomial. All functions return the first crossing from + to − in ]0, limit], or
infinity; `rising` is the order of the first Taylor coefficient that is not zero (0: the signal
starts positive; > 0: it starts at zero).
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.algebra.roots import NONE, divide_out, first_crossing
from stickslip.numerics.levels import LAST_DIGITS
from stickslip.translator import compiled

# largest number of windows of a signal that are searched in one call: a tenth of a second
_MOST_WINDOWS = 100_000
_WINDOW_ORDER = 22
# length of a window in which the polynomial is exact, relative to the time scale of a term
_WINDOW = 1.5
_LONGER = 4.0  # factor on a window for which one more exponential may be replaced by its bound
_LONGEST = 700.0  # largest argument of the exponential function that does not overflow
_EXACT = 1e-16  # relative error of a root that further steps do not reduce
# fraction of π: a signal this close to its minimum starts there, where it is flat to √ε
_SHORT_ARC = 1e-7


class Wave(NamedTuple):
    """The signal c₀ + exp(μx) R cos(ωx + φ).

    Attributes
    ----------
    c0, size, phase : float
        c₀, R and φ.
    mu, w : float
        Real and imaginary part of λ = μ + iω.
    tilt, sine : float
        arg λ, and its sine.
    """

    c0: float
    size: float
    phase: float
    mu: float
    w: float
    tilt: float
    sine: float


class SignalSum(NamedTuple):
    """The signal c₀ + c₁τ + c₂τ² + Re Σⱼ aⱼ exp(λⱼτ) + Re Σₘ bₘ exp(iωₘτ).

    Attributes
    ----------
    z, window : arrays
        Work space: the exponentials where it is searched, and the intervals in which their Taylor
        polynomials are accurate.
    kept : array of complex
        Work space: exponents in the present window.
    """

    c: Array
    a: Array
    z: Array
    window: Array
    kept: Array
    lam: Array
    b: Array
    omega: Array


@compiled()
def length(z: complex) -> float:
    """|Re z| + |Im z|: a bound of the modulus that needs no square root."""
    return abs(z.real) + abs(z.imag)


@compiled()
def rough_acos(x: float) -> float:
    """arccos x for |x| ≤ 1 up to 7e-5 (Abramowitz and Stegun 1964, 4.4.45)."""
    y = abs(x)
    angle = math.sqrt(1.0 - y) * (1.5707288 + y * (-0.2121144 + y * (0.0742610 - 0.0187293 * y)))
    return angle if x >= 0.0 else math.pi - angle


@compiled()
def first_of_line(c0: float, c1: float, limit: float, rising: int) -> float:
    """First fall of c₀ + c₁x."""
    if c1 >= 0.0 or rising > 0:
        return np.inf
    x = -c0 / c1
    return x if x <= limit else np.inf


@compiled()
def first_of_bend(
    c0: float, c1: float, r: float, rate: float, limit: float, floor: float, rising: int
) -> float:
    """First fall of c₀ + c₁x + r exp(λx): convex or concave, so at most one extremum.

    Parameters
    ----------
    c0, c1, r, rate : float
        Of the signal; `rate` is λ, real and not zero.
    limit, floor : float
        End of the search, and rounding error of the values.
    """
    start, guess = 0.0, 0.0
    if c1 == 0.0:
        if rising > 0 or r * rate >= 0.0 or not -c0 / r > 0.0:
            return np.inf  # it rises for ever, or falls to a limit that is not below zero
        x = math.log(-c0 / r) / rate
        return x if x <= limit else np.inf
    ratio = -c1 / (r * rate)
    turn = math.log(ratio) / rate if ratio > 0.0 else -1.0
    if turn > 0.0:
        if r > 0.0:  # a minimum: the crossing lies before it
            if rising > 0:
                return np.inf  # the minimum is at the start, up to rounding errors
            stop = min(turn, limit)
            g = c0 + c1 * stop + r * math.exp(rate * stop)
            if g >= (-floor if stop == turn else 0.0):
                return np.inf
            return _root_of_bend(c0, c1, r, rate, 0.0, stop, 0.0, floor)
        start = min(turn, limit)  # a maximum: the crossing lies after it
    elif rising > 0 and (r > 0.0 or c1 + r * rate >= 0.0):
        return np.inf
    guess = -c0 / c1 if rate < 0.0 else 0.0
    if not (r < 0.0 and c1 < 0.0 and rate < 0.0 and guess < limit):
        if c0 + c1 * limit + r * math.exp(rate * limit) >= 0.0:
            return np.inf
        guess = min(guess, limit)
    else:
        limit = guess  # below its asymptote: the asymptote's zero lies beyond the crossing
    return _root_of_bend(c0, c1, r, rate, start, limit * (1.0 + LAST_DIGITS), guess, floor)


@compiled()
def _root_of_bend(
    c0: float, c1: float, r: float, rate: float, low: float, high: float, guess: float, floor: float
) -> float:
    """The crossing from + to − of c₀ + c₁x + r exp(λx) between low and high.

    Parameters
    ----------
    c0, c1, r, rate : float
        Of the signal; `rate` is λ.
    low, high, guess : float
        The bracket, and the first point that is tried.
    floor : float
        Rounding error of the values.
    """
    x = guess if low < guess < high else 0.5 * (low + high)
    for _ in range(100):
        z = r * math.exp(rate * x)
        x, low, high, found = _halley(
            x, c0 + c1 * x + z, c1 + rate * z, rate * rate * z, abs(rate), low, high, floor
        )
        if found:
            break
    return x


@compiled()
def first_of_wave(
    s: Wave, limit: float, ending: float, guess: float, floor: float, rising: int
) -> float:
    """First fall of a wave: its extrema are half a period apart.

    Parameters
    ----------
    ending : float
        Value at `limit`, or NaN if it is not known; the answer is NaN if it is needed.
    guess : float
        Where it falls without decay.
    """
    # g′ = R|λ| exp(μx) cos(ωx + φ + arg λ) vanishes where its argument is π/2 modulo π.
    # There the cosine is ± sin(arg λ), so that the extrema need no trigonometry.
    arc = 0.5 * math.pi - s.phase - s.tilt
    halves = np.floor(arc * (1.0 / math.pi))
    arc -= math.pi * halves
    swing = s.size * s.sine
    if halves != 2.0 * np.floor(0.5 * halves):
        swing = -swing
    if rising > 1 and arc < _SHORT_ARC * math.pi:
        # the signal starts at its minimum
        arc = arc + math.pi
        swing = -swing
    before = 0.0
    turn = arc / s.w
    climbing = rising > 0
    while True:
        if swing < 0.0 and not climbing:
            if turn <= limit:
                stop = turn
                g = s.c0 + swing * math.exp(s.mu * turn)
            else:
                stop, g = limit, ending
                if g != g:
                    return np.nan
                if abs(g) <= floor:
                    return limit  # it crosses together with the earliest event found
            if g < -floor:
                if not (before < guess < stop and abs(s.mu * guess) < 0.1):
                    guess = 0.5 * (before + stop)
                    cosine = -s.c0 / (s.size * math.exp(s.mu * guess))
                    if abs(cosine) < 1.0:
                        angle = math.acos(cosine) - s.phase  # there the cosine falls
                        turns = np.floor((angle - s.w * before) * (0.5 / math.pi))
                        guess = (angle - 2.0 * math.pi * turns) / s.w
                return _root_of_wave(s, before, stop, guess, floor)
            if s.mu <= 0.0:
                return np.inf  # no later minimum is lower
        if turn >= limit:
            return np.inf
        arc += math.pi
        before = turn
        turn = arc / s.w
        swing = -swing
        climbing = False


@compiled()
def _root_of_wave(s: Wave, low: float, high: float, guess: float, floor: float) -> float:
    """The crossing from + to − of a wave between low and high.

    Parameters
    ----------
    low, high, guess : float
        The bracket, and the first point that is tried.
    floor : float
        Rounding error of the values.
    """
    x = guess if low < guess < high else 0.5 * (low + high)
    fast = abs(s.mu) + s.w
    for _ in range(100):
        r = s.size * math.exp(s.mu * x)
        angle = s.w * x + s.phase
        re, im = r * math.cos(angle), r * math.sin(angle)
        slope = s.mu * re - s.w * im
        second = s.mu * slope - s.w * (s.mu * im + s.w * re)
        x, low, high, found = _halley(x, s.c0 + re, slope, second, fast, low, high, floor)
        if found:
            break
    return x


@compiled()
def _halley(
    x: float, g: float, d: float, dd: float, fast: float, low: float, high: float, floor: float
) -> tuple[float, float, float, bool]:
    """Next point inside the bracket, the bracket, and whether no further evaluation could better
    the point.

    A step h of Halley's method leaves an error of about h³ ((g″/2g′)² − g‴/6g′).

    Parameters
    ----------
    x, g, d, dd : float
        The point; the signal there, its slope and its second derivative.
    fast : float
        About |λ|, from which g‴ is estimated.
    low, high : float
        The bracket.
    floor : float
        Rounding error of the values.
    """
    if abs(g) <= floor / 32.0:
        return x, low, high, True
    if g > 0.0:
        low = x
    else:
        high = x
    below = d * d - 0.5 * g * dd
    step = -g * d / below if below > 0.0 else np.inf
    new = x + step
    if (
        low <= new <= high
        and abs(step * step * step) * (dd * dd + d * d * fast * fast) <= _EXACT * new * d * d
    ):
        return new, low, high, True
    if not low < new < high:
        new = 0.5 * (low + high)
        if abs(new - x) <= 4.0 * _EXACT * new or not low < new < high:
            return new, low, high, True
    return new, low, high, False


@compiled()
def advance_signal(s: SignalSum, start: float, valued: bool) -> float:
    """Put the exponentials at a time into z; returns the value of the signal there, or 0 where none
    is to be replaced by its bound."""
    for j in range(len(s.lam)):
        s.z[j] = s.a[j] * cmath.exp(s.lam[j] * start) if start > 0.0 else s.a[j]
    if not valued:
        return 0.0
    c = s.c
    value = c[0] + start * (c[1] + start * c[2])
    for j in range(len(s.lam)):
        value += s.z[j].real
    for m in range(len(s.omega)):
        value += (s.b[m] * cmath.exp(1j * s.omega[m] * start)).real
    return float(value)


@compiled()
def window_of(s: SignalSum, j: int, start: float) -> float:
    """Interval in which the Taylor polynomial of an exponential is accurate."""
    lam = s.lam[j]
    size = math.sqrt(lam.real * lam.real + lam.imag * lam.imag)
    if size == 0.0 or s.a[j] == 0.0j:
        return np.inf
    spent = max(-s.lam[j].real * start, 0.0) / (_WINDOW_ORDER + 1)
    return _WINDOW / size * (math.exp(min(spent, _LONGEST)) if spent > 0.0 else 1.0)


@compiled()
def left_out(s: SignalSum, h: float) -> float:
    """Bound of the exponentials whose polynomials are not good for a window."""
    total = 0.0
    for j in range(len(s.lam)):
        if s.window[j] < h:
            z = s.z[j]
            size = math.sqrt(z.real * z.real + z.imag * z.imag)
            grown = s.lam[j].real * h
            total += size * math.exp(min(grown, _LONGEST)) if grown > 0.0 else size
    return total


@compiled()
def window_from(s: SignalSum, start: float, limit: float, value: float) -> tuple[float, float]:
    """Length of the next window: that of the fastest exponential, or a longer one if all faster
    ones are far smaller than the signal; and a bound of these.

    The fast modes of a structure are small, and decay soon; they need not be followed.

    Parameters
    ----------
    start, limit : float
        Of the window, and of the search.
    value : float
        Of the signal at the start; 0 if every exponential counts.
    """
    most = limit - start
    for m in range(len(s.omega)):
        if s.omega[m] > 0.0 and s.b[m] != 0.0j:
            most = min(most, _WINDOW / s.omega[m])
    h = most
    for j in range(len(s.lam)):
        s.window[j] = window_of(s, j, start)
        h = min(h, s.window[j])
    bound = 0.0
    while h < most and value > 0.0:
        longer = min(_LONGER * h, most)
        more = left_out(s, longer)
        if more > 0.5 * value:
            break
        h, bound = longer, more
    return h, bound


@compiled(inline=True)
def kept_term(s: SignalSum, j: int, count: int) -> tuple[complex, complex]:
    """An exponential at a time, and its exponent in a window; zeros if there is none."""
    if j >= count:
        return complex(0.0, 0.0), complex(0.0, 0.0)
    return s.z[j], s.kept[j]


@compiled()
def expand_signal(s: SignalSum, start: float, h: float, work: Array) -> None:
    """Taylor polynomial of a signal at a time, in powers of a window, without the omitted
    exponentials.

    Parameters
    ----------
    s : SignalSum
        Advanced to the time; the exponentials that are not omitted are moved to the front of z.
    work : array, shape (WINDOW_ORDER + 1,)
        Receives it.
    """
    N = _WINDOW_ORDER
    c = s.c
    for k in range(N + 1):
        work[k] = 0.0
    work[0] = c[0] + start * (c[1] + start * c[2])
    work[1] = (c[1] + 2.0 * c[2] * start) * h
    work[2] = c[2] * h * h
    count = 0
    for j in range(len(s.lam)):
        if s.window[j] >= h and s.z[j] != 0.0j:
            s.z[count] = s.z[j]
            s.kept[count] = s.lam[j] * h
            count += 1
    # Four at a time, since each product waits for the one before.
    for j in range(0, count, 4):
        z0, lam0 = kept_term(s, j, count)
        z1, lam1 = kept_term(s, j + 1, count)
        z2, lam2 = kept_term(s, j + 2, count)
        z3, lam3 = kept_term(s, j + 3, count)
        for k in range(N + 1):
            work[k] += (z0.real + z1.real) + (z2.real + z3.real)
            part = 1.0 / (k + 1)
            z0 = z0 * (part * lam0)
            z1 = z1 * (part * lam1)
            z2 = z2 * (part * lam2)
            z3 = z3 * (part * lam3)
    for m in range(len(s.omega)):
        z = s.b[m] * cmath.exp(1j * s.omega[m] * start)
        for k in range(N + 1):
            work[k] += z.real
            z = z * 1j * s.omega[m] * h / (k + 1)


@compiled()
def first_of_many(
    s: SignalSum, limit: float, floor: float, rising: int, work: Array, stack: Array
) -> tuple[float, float]:
    """First descent of any signal through zero, and the time up to which was searched: window after
    window, by the roots of Taylor polynomials.

    What decays leaves room for longer windows, in which it is known as exactly as at the beginning,
    in parts of what it was there: it takes some sixteen until nothing is left of it. What is fast
    and small is replaced by its bound, as long as this leaves no doubt.

    Parameters
    ----------
    limit : float
        End of the search; it ends before that after `_MOST_WINDOWS`.
    work, stack : arrays, shapes (WINDOW_ORDER + 1,) and that of :func:`.roots.first_crossing`
        Work space.
    """
    start = 0.0
    order = rising
    longest = np.inf
    moving = 0
    for j in range(len(s.lam)):
        moving += 1 if s.a[j] != 0.0j and s.lam[j] != 0.0j else 0
    # A single exponential with a load does not justify the search for a longer window.
    several = moving > 1 or len(s.omega) == 0
    N = _WINDOW_ORDER
    for _ in range(_MOST_WINDOWS):
        if not start < limit:
            break
        value = advance_signal(s, start, several and order == 0)
        h, bound = window_from(s, start, limit, value)
        if h > longest:
            h, bound = longest, left_out(s, longest)
        longest = np.inf
        expand_signal(s, start, h, work)
        if bound > 0.0:
            work[0] -= bound
            x = first_crossing(work, N, 1.0, floor, stack) if work[0] > floor else 0.0
            if x < NONE:
                # No decrease below zero before x; the search continues from there.
                start += x * h
                longest = h / _LONGER
            else:
                start += h
            continue
        if order > 0:
            divide_out(work, order, N + 1)
        elif work[0] <= floor:
            # Touching zero at the seam of two windows: its sign decides there.
            if work[1] < 0.0:
                return start, limit
            work[0] = abs(work[0])
        if work[0] > 0.0:
            x = first_crossing(work, N - order, 1.0, floor, stack)
            if x < NONE:
                return start + x * h, limit
        start += h
        order = 0
    return np.inf, min(start, limit)
