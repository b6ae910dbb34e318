"""Sums of exponentials on long intervals: bounds, extremes, and integrals, without steps that
resolve the fastest of them.

A signal is what changes slowly, known at Gauss nodes, and Re Σⱼ zⱼ exp(λⱼx). On a window, what
turns at most four radians is followed at nodes, where a polynomial is as exact as rounding; what is
faster is replaced by the bound of its modulus. Where that leaves a question open windows become
shorter, and more is followed.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, ComplexVector, Matrix, Vector
from stickslip.motion.affine.nodes import (
    COUNT,
    GAUSS_NODES,
    LEBESGUE,
    least_on_nodes,
    to_control_points,
)
from stickslip.numerics.levels import EXTREMUM_KNOWN
from stickslip.translator import compiled

RADIANS = 4.0
"""Largest |λ| × length of what is followed at the nodes of a window."""
_SHORTER = 0.25  # factor on a window after an inconclusive one
_MOST_WINDOWS = 400  # largest number of windows of a signal
_ROUNDED = 1e-12  # error of an extremum relative to its terms
_FINE = 48  # number of Gauss nodes for integrals of slow exponentials
_FAST = 40.0  # |z| above which they follow from a recurrence
_SAME = 1e-9  # size of the exponent z below which (exp(z) − 1)/z is computed as a series
_GOLDEN = 0.3819660112501051
_TURNS = 60  # largest number of iterations of a search for an extremum


def _barycentric() -> Array:
    """Weights of Lagrange's polynomials of the nodes."""
    return np.array(
        [1.0 / np.prod(x - np.delete(GAUSS_NODES, g)) for g, x in enumerate(GAUSS_NODES)]
    )


def _legendre() -> tuple[Array, Array, Array]:
    """Fine nodes on [0, 1]; Legendre's polynomials there times weights; and their coefficients in
    Lagrange's polynomials of the nodes, shape (COUNT, degrees)."""
    x, w = np.polynomial.legendre.leggauss(_FINE)
    fine = np.polynomial.legendre.legvander(x, COUNT - 1).T * (0.5 * w)
    own, weights = np.polynomial.legendre.leggauss(COUNT)
    degrees = 2 * np.arange(COUNT) + 1
    coefficients = (
        0.5 * weights[:, None] * degrees * np.polynomial.legendre.legvander(own, COUNT - 1)
    )
    return 0.5 * (x + 1.0), fine.copy(), coefficients.copy()


_WEIGHTS = _barycentric()
_PLACES, _WEIGHED, _COEFFICIENTS = _legendre()


class ModalSum(NamedTuple):
    """A signal on a stretch.

    Attributes
    ----------
    slow : array, shape (COUNT,)
        What changes slowly, at the nodes of the stretch.
    z, lam : arrays of complex
        Amplitudes at its beginning, and exponents.
    values, points, scratch, stack : arrays
        Work space: of a window, and to halve it.
    """

    slow: Vector
    z: ComplexVector
    lam: ComplexVector
    length: float
    values: Vector
    points: Vector
    scratch: Vector
    stack: Matrix


@compiled()
def modulus_of(z: complex) -> float:
    """|z|."""
    return math.sqrt(z.real * z.real + z.imag * z.imag)


@compiled()
def slow_at(slow: Array, x: float) -> float:
    """The polynomial through values at the nodes on [0, 1]."""
    top = 0.0
    below = 0.0
    for g in range(COUNT):
        away = x - GAUSS_NODES[g]
        if away == 0.0:
            return float(slow[g])
        part = _WEIGHTS[g] / away
        top += part * slow[g]
        below += part
    return top / below


@compiled()
def signal_at(s: ModalSum, x: float) -> float:
    """The signal at a time of its stretch."""
    value = slow_at(s.slow, x / s.length)
    for j in range(len(s.lam)):
        if s.z[j] != 0.0j:
            value += (s.z[j] * cmath.exp(s.lam[j] * x)).real
    return value


@compiled()
def put_window(s: ModalSum, start: float, h: float) -> float:
    """Evaluate a signal in a window, without exponentials that are too fast for it, into `values`;
    returns the bound of these."""
    whole = start == 0.0 and h == s.length
    for g in range(COUNT):
        s.values[g] = (
            s.slow[g] if whole else slow_at(s.slow, (start + h * GAUSS_NODES[g]) / s.length)
        )
    left = 0.0
    for j in range(len(s.lam)):
        if s.z[j] == 0.0j:
            continue
        z = s.z[j] * cmath.exp(s.lam[j] * start)
        if modulus_of(s.lam[j]) * h > RADIANS:
            left += modulus_of(z) * math.exp(max(s.lam[j].real * h, 0.0))
            continue
        for g in range(COUNT):
            s.values[g] += (z * cmath.exp(s.lam[j] * (h * GAUSS_NODES[g]))).real
    return left


@compiled()
def least_of_sum(s: ModalSum, negligible: float) -> float:
    """Lower bound of a signal, close to its minimum where that is negative; −∞ where too many
    windows would be needed.

    Parameters
    ----------
    negligible : float
        What may be below zero without a question.
    """
    start = 0.0
    h = s.length
    low = np.inf
    for _ in range(_MOST_WINDOWS):
        h = min(h, s.length - start)
        left = put_window(s, start, h)
        found = least_on_nodes(s.values, s.stack, negligible) - left
        if found < -negligible and left > 0.0:
            h = _SHORTER * h
            continue
        low = min(low, found)
        start += h
        if not start < s.length:
            return low
        h = h / _SHORTER
    return -np.inf


@compiled()
def largest_of_sum(s: ModalSum, growth: Array) -> float:
    """Bound of the modulus of a signal, from those of its parts."""
    found = 0.0
    for g in range(COUNT):
        found = max(found, LEBESGUE * abs(s.slow[g]))
    for j in range(len(s.lam)):
        found += modulus_of(s.z[j]) * growth[j]
    return found


@compiled()
def widen_by_sum(
    s: ModalSum, low: float, high: float, rounding: float
) -> tuple[float, float, bool]:
    """Bounds that also hold a signal, but for its rounding errors, and whether it was followed to
    its end."""
    start = 0.0
    h = s.length
    size = 0.0
    for g in range(COUNT):
        size = max(size, abs(s.slow[g]))
    for j in range(len(s.lam)):
        size += modulus_of(s.z[j])
    floor = max(_ROUNDED * size, rounding)
    for end in range(2):
        value = signal_at(s, end * s.length)
        low, high = min(low, value), max(high, value)
    for _ in range(_MOST_WINDOWS):
        h = min(h, s.length - start)
        left = put_window(s, start, h)
        # Control points are narrow, but have 1e5 times the rounding errors of values.
        middle, reach = s.values[COUNT // 2], 0.0
        for g in range(COUNT):
            s.points[g] = s.values[g] - middle
            reach = max(reach, LEBESGUE * abs(s.points[g]))
        to_control_points(s.points, s.scratch)
        least, most = 0.0, 0.0
        for g in range(COUNT):
            least = min(least, s.points[g])
            most = max(most, s.points[g])
        least, most = middle + max(least, -reach), middle + min(most, reach)
        inside = least - left >= low - floor and most + left <= high + floor
        if not inside and left > 0.0:
            h = _SHORTER * h
            continue
        if not inside:
            low, high = _turning_values(s, start, h, low, high)
        start += h
        if not start < s.length:
            return low, high, True
        h = h / _SHORTER
    return low, high, False


@compiled()
def _turning_values(
    s: ModalSum, start: float, h: float, low: float, high: float
) -> tuple[float, float]:
    """The same on a window in which all is followed.

    Parameters
    ----------
    s : ModalSum
        With the window in `values`.
    start, h : float
        The window.
    """
    first, last = signal_at(s, start), signal_at(s, start + h)
    low, high = min(low, min(first, last)), max(high, max(first, last))
    for g in range(COUNT):
        before = s.values[g - 1] if g > 0 else first
        after = s.values[g + 1] if g < COUNT - 1 else last
        left = GAUSS_NODES[g - 1] if g > 0 else 0.0
        right = GAUSS_NODES[g + 1] if g < COUNT - 1 else 1.0
        value = s.values[g]
        if value >= before and value >= after:
            top = _extremum(s, start + h * left, start + h * right, 1.0)
            high = max(high, max(value, top))
        if value <= before and value <= after:
            bottom = -_extremum(s, start + h * left, start + h * right, -1.0)
            low = min(low, min(value, bottom))
    return low, high


@compiled()
def _extremum(s: ModalSum, a: float, b: float, sign: float) -> float:
    """The largest value of a signal, times a sign, between two times where it turns once: by golden
    sections."""
    wide = b - a
    x = a + _GOLDEN * (b - a)
    y = b - _GOLDEN * (b - a)
    at_x, at_y = sign * signal_at(s, x), sign * signal_at(s, y)
    for _ in range(_TURNS):
        if b - a <= EXTREMUM_KNOWN * wide:
            break
        if at_x > at_y:
            b, y, at_y = y, x, at_x
            x = a + _GOLDEN * (b - a)
            at_x = sign * signal_at(s, x)
        else:
            a, x, at_x = x, y, at_y
            y = b - _GOLDEN * (b - a)
            at_y = sign * signal_at(s, y)
    return max(at_x, at_y)


@compiled()
def grown_by(mu: complex, h: float) -> complex:
    """∫₀ʰ exp(μx) dx."""
    z = mu * h
    if abs(z.real) + abs(z.imag) < _SAME:
        return h * (1.0 + 0.5 * z)
    if abs(z.real) + abs(z.imag) < 1.0:
        # exp(z) − 1 to full accuracy
        sine, cosine = math.sin(0.5 * z.imag), math.cos(0.5 * z.imag)
        grown, back = math.expm1(z.real), -2.0 * sine * sine
        turned = complex(grown + back + grown * back, (1.0 + grown) * 2.0 * sine * cosine)
        return turned / mu
    return (cmath.exp(z) - 1.0) / mu


@compiled()
def put_moments_at_nodes(z: complex, moments: Array, b: int, work: Array) -> None:
    """Put ∫₀¹ exp(z x) ℓ(x) dx into a column, with ℓ the Lagrange polynomial of each node.

    Parameters
    ----------
    moments : array of complex, shape (COUNT, ·)
    b : int
        The column.
    work : array of complex, shape (COUNT,)
    """
    for d in range(COUNT):
        work[d] = complex(0.0, 0.0)
    if abs(z.real) + abs(z.imag) <= _FAST:
        for k in range(_FINE):
            grown = cmath.exp(z * _PLACES[k])
            for d in range(COUNT):
                work[d] += _WEIGHED[d, k] * grown
    else:
        # With a = z/2: exp(a) i_d(a), i₀ = sinh(a)/a, i₁ = cosh(a)/a − sinh(a)/a²,
        # i_{d+1} = i_{d−1} − (2d + 1)/a i_d.
        whole = cmath.exp(z)
        a = 0.5 * z
        before = 0.5 * (whole - 1.0) / a
        now = 0.5 * (whole + 1.0) / a - before / a
        work[0] = before
        for d in range(1, COUNT):
            work[d] = now
            later = before - (2 * d + 1) * now / a
            before = now
            now = later
    for g in range(COUNT):
        total = complex(0.0, 0.0)
        for d in range(COUNT):
            total += _COEFFICIENTS[g, d] * work[d]
        moments[g, b] = total
