"""Gauss nodes on a piece: bounds of a function from its values there, and between them."""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.steps.arrays import AUDIT_NODES as COUNT
from stickslip.translator import compiled

_nodes, _weights = np.polynomial.legendre.leggauss(COUNT)
GAUSS_NODES = 0.5 * (_nodes + 1.0)  # on [0, 1]
GAUSS_WEIGHTS = 0.5 * _weights


def _lagrange(x: Array) -> Array:
    """Values of the Lagrange polynomials of the nodes, shape (points, nodes)."""
    others = np.array([np.delete(GAUSS_NODES, j) for j in range(COUNT)])
    return np.prod((x[:, None, None] - others) / (GAUSS_NODES[:, None] - others), axis=2)


def _to_bernstein() -> Array:
    """Matrix from values at the nodes to Bernstein coefficients on [0, 1]."""
    from math import comb

    d = COUNT - 1
    bernstein = np.array(
        [[comb(d, i) * t**i * (1.0 - t) ** (d - i) for i in range(COUNT)] for t in GAUSS_NODES]
    )
    return np.linalg.inv(bernstein)


_SIZES = np.abs(_lagrange(np.linspace(0.0, 1.0, 801)))
LEBESGUE = float(np.max(np.sum(_SIZES, axis=1)))
# |interpolant| integrated over [0, 1] is at most the sum of these times |values at the nodes|
INTEGRALS = np.mean(0.5 * (_SIZES[1:] + _SIZES[:-1]), axis=0)
_TO_BERNSTEIN = _to_bernstein()


def _between(part: float) -> float:
    """Bound, between the nodes in [0, h], of a function that deviates by at most 1 on the disc of
    radius h/part."""
    axis = 2.0 / part - 1.0  # half axis of the ellipse inside the disc, in units of h/2
    rho = axis + np.sqrt(axis * axis - 1.0)
    return float(2.0 * (1.0 + LEBESGUE) * rho ** (1 - COUNT) / (rho - 1.0))


WIDE = _between(0.25)
NARROW = _between(0.5)


@compiled()
def most(a: float, b: float) -> float:
    """The larger of two numbers; NaN counts as infinite, so that it is never lost."""
    return a if b <= a else (b if b == b else np.inf)


@compiled()
def largest_of(values: Array) -> float:
    """Bound of the modulus of the interpolant of values at the nodes."""
    found = 0.0
    for g in range(COUNT):
        found = most(found, abs(values[g]))
    return LEBESGUE * found


@compiled()
def least_on_nodes(values: Array, stack: Array, negligible: float) -> float:
    """Lower bound of the interpolant of values at the nodes, close to its minimum where that is
    negative.

    The Bernstein coefficients of a polynomial enclose it; where their least is much below the ends,
    the interval is halved (de Casteljau).
    """
    bound = np.inf
    depth = 0
    d = COUNT - 1
    for i in range(COUNT):
        total = 0.0
        for g in range(COUNT):
            total += _TO_BERNSTEIN[i, g] * values[g]
        if total != total:
            return -np.inf
        stack[0, i] = total
    while depth >= 0:
        b = stack[depth]
        low = np.inf
        for i in range(COUNT):
            low = min(low, b[i])
        edge = min(b[0], b[d])
        if not low < -negligible or low >= 2.0 * edge or depth + 2 > len(stack):
            bound = min(bound, low)
            depth -= 1
            continue
        half = stack[depth + 1]
        for i in range(COUNT):
            half[i] = b[i]
        for i in range(COUNT):
            b[d - i] = half[d]
            for j in range(d, i, -1):
                half[j] = 0.5 * (half[j] + half[j - 1])
        depth += 1
    return bound


@compiled()
def to_control_points(values: Array, scratch: Array) -> None:
    """Control points of the interpolant of values at the nodes, in Bernstein's form, in their
    place."""
    for i in range(COUNT):
        scratch[i] = 0.0
        for g in range(COUNT):
            scratch[i] += _TO_BERNSTEIN[i, g] * values[g]
    for i in range(COUNT):
        values[i] = scratch[i]
