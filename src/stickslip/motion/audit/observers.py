"""Measures of a part of a motion: extremes, time in stick, forces and work of its contacts,
accumulated step by step in compiled code.

Extremes are those of the Taylor polynomials by which an audit follows the steps again
(:mod:`.step_balance`), so that they lie where they lie, not at the nearest knot.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, IntVector, Vector
from stickslip.motion.affine.nodes import GAUSS_NODES, GAUSS_WEIGHTS
from stickslip.motion.algebra.roots import halve, horner, lowest
from stickslip.motion.modes.guards import resting, stands
from stickslip.motion.steps.arrays import LEAD, Rows
from stickslip.motion.steps.contacts import directions_of
from stickslip.numerics.levels import EXTREMUM_KNOWN, LAST_DIGITS
from stickslip.translator import compiled

LASTED, STUCK = range(2)
"""Slots of :attr:`Sums.total`."""

_LEFT, _WIDTH = 33, 34  # left end and width of an interval, stored after its Bernstein coefficients
_DEEPEST = 40  # largest number of halvings


class Sums(NamedTuple):
    """Observations of a motion (or, with a leading axis, of every lane).

    Attributes
    ----------
    low, high : arrays, shape (n,)
        Least and largest value of each component.
    stick, work, peak, impulse : arrays, shape (contacts,)
        Time in stick, dissipated energy −∫λu dt, largest |λ| and ∫λ dt.
    total : array
        Duration (LASTED), and the time in which all contacts stick that are not open (STUCK).
    switches : array of int
        Changes between stick and slip.
    """

    low: Vector
    high: Vector
    stick: Vector
    work: Vector
    peak: Vector
    impulse: Vector
    total: Vector
    switches: IntVector


def make_sums(lanes: tuple[int, ...], n: int, contacts: int) -> Sums:
    """Nothing observed yet, of one motion or (with a leading axis) of several."""
    z = np.zeros
    return Sums(
        low=np.full((*lanes, n), np.inf),
        high=np.full((*lanes, n), -np.inf),
        stick=z((*lanes, contacts)),
        work=z((*lanes, contacts)),
        peak=z((*lanes, contacts)),
        impulse=z((*lanes, contacts)),
        total=z((*lanes, 2)),
        switches=z((*lanes, 1), np.int64),
    )


@compiled()
def reset(sums: Sums) -> None:
    """Nothing has been observed yet."""
    for r in range(len(sums.low)):
        sums.low[r] = np.inf
        sums.high[r] = -np.inf
    for c in range(len(sums.stick)):
        sums.stick[c] = sums.work[c] = sums.peak[c] = sums.impulse[c] = 0.0
    sums.total[LASTED] = sums.total[STUCK] = 0.0
    sums.switches[0] = 0


@compiled()
def widen(c: Array, d: int, h: float, low: float, high: float, stack: Array) -> tuple[float, float]:
    """Bounds that also hold a polynomial on [0, h], d ≥ 0: exactly, wherever it turns.

    Bernstein coefficients bound the polynomial, and their differences its slope: where these have
    one sign the ends decide, where they change it once there is one turning point; otherwise the
    interval is halved, unless the polynomial stays within the bounds there, up to rounding.

    Parameters
    ----------
    stack : array, shape (64, 36)
        Work space.
    """
    value = horner(c, d, h)
    low, high = min(low, c[0], value), max(high, c[0], value)
    reach = 0.0
    x = 1.0
    for k in range(1, d + 1):
        x *= h
        stack[1, k] = c[k] * x
        reach += abs(stack[1, k])
    floor = LAST_DIGITS * (abs(c[0]) + reach)  # rounding errors have extrema everywhere
    if c[0] - reach >= low - floor and c[0] + reach <= high + floor:
        return low, high
    stack[1, 0] = c[0]
    lowest(stack[1], d, stack[0], stack[2])
    stack[0, _LEFT], stack[0, _WIDTH] = 0.0, 1.0
    depth = 0
    while depth >= 0:
        b = stack[depth]
        low, high = min(low, b[0], b[d]), max(high, b[0], b[d])
        least, most = b[0], b[0]
        changes = 0
        sense = 0.0
        for i in range(d):
            least, most = min(least, b[i + 1]), max(most, b[i + 1])
            step = b[i + 1] - b[i]
            if step * sense < 0.0:
                changes += 1
            sense = step if step != 0.0 else sense
        left, width = b[_LEFT], b[_WIDTH]
        if changes == 0 or (low - floor <= least and most <= high + floor):
            depth -= 1
        elif changes == 1 or depth == _DEEPEST:
            value = horner(c, d, turning_point(c, d, h * left, h * (left + width), sense > 0.0))
            low, high = min(low, value), max(high, value)
            depth -= 1
        else:
            halve(stack, depth, d)
            depth += 1
    return low, high


@compiled()
def turning_point(c: Array, d: int, a: float, b: float, rising: bool) -> float:
    """Zero of the slope of a polynomial of degree d between a and b, by Newton's method inside a
    bracket.

    Parameters
    ----------
    c : array
        Coefficients.
    d : int
        Degree.
    a, b : float
        The bracket.
    rising : bool
        Whether the polynomial rises at b.
    """
    x = 0.5 * (a + b)
    for _ in range(60):
        slope, curvature = 0.0, 0.0
        for k in range(d, 0, -1):
            curvature = curvature * x + slope
            slope = slope * x + k * c[k]
        if (slope > 0.0) == rising:
            b = x
        else:
            a = x
        new = x - slope / curvature if curvature != 0.0 else a
        if not a < new < b:
            new = 0.5 * (a + b)
        # A value at its extremum depends only on the first half of the digits.
        if abs(new - x) <= EXTREMUM_KNOWN * (b - a) or not a < new < b:
            return new
        x = new
    return x


@compiled()
def count_times(rows: Rows, mode: Array, after: Array, length: float, sums: Sums) -> None:
    """Add the time of a step in a mode, and the switches at its end.

    Parameters
    ----------
    mode, after : arrays of int, shape (contacts,)
        On the step, and from its end on.
    """
    for c in range(len(mode)):
        sums.stick[c] += length if resting(mode[c]) else 0.0
    for c in rows.contacts:
        if after[c] != mode[c] and not (resting(mode[c]) and resting(after[c])):
            sums.switches[0] += 1
    sums.total[LASTED] += length
    sums.total[STUCK] += length if stands(rows, mode) else 0.0


@compiled()
def widen_square(
    rows: Rows, W: Array, c: int, order: int, x: float, stack: Array, largest: float
) -> float:
    """The largest force of a contact in a plane, which is a vector, from that so far.

    Parameters
    ----------
    W : array
        Taylor coefficients.
    c, order : int
        The contact, by its first direction, and the order of the coefficients.
    x : float
        End of the step, in the unit of their time.
    stack : array, shape (64, 36)
        Work space.
    """
    square = stack[len(stack) - 1]
    for k in range(order):
        square[k] = 0.0
        for i in directions_of(rows, c):
            force = W[rows.force[i]]
            for j in range(k + 1):
                square[k] += force[j] * force[k - j]
    _, high = widen(square, order - 1, x, 0.0, largest * largest, stack)
    return math.sqrt(high)


@compiled()
def add_step(
    rows: Rows, W: Array, order: int, h: float, unit: float, stack: Array, sums: Sums
) -> None:
    """Add one Taylor step: extrema of the state, and force, impulse and work of the contacts.

    Parameters
    ----------
    h, unit : float
        Length of the step, and the time in powers of which the coefficients are.
    stack : array, shape (64, 36)
        Work space.
    """
    for r in range(len(sums.low)):
        sums.low[r], sums.high[r] = widen(W[r], order, h / unit, sums.low[r], sums.high[r], stack)
    for c in range(len(rows.u)):
        force, speed = W[rows.force[c]], W[rows.u[c]]
        low, high = widen(force, order - 1, h / unit, -sums.peak[c], sums.peak[c], stack)
        sums.peak[c] = max(sums.peak[c], high, -low)
        for g in range(len(GAUSS_NODES)):
            tau = h / unit * GAUSS_NODES[g]
            held = horner(force, order - 1, tau)
            sums.impulse[c] += h * GAUSS_WEIGHTS[g] * held
            sums.work[c] -= h * GAUSS_WEIGHTS[g] * held * horner(speed, order - 1, tau)
    for plane in rows.planes:
        c = plane[LEAD]
        sums.peak[c] = widen_square(rows, W, c, order, h / unit, stack, sums.peak[c])
