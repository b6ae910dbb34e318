"""Turning points of an oscillating quantity: its velocity changes sign, or it comes to rest.

Between two knots a motion is smooth. It is sampled there until the cubic through neighbouring
positions and velocities meets the motion between them, so that no swing is stepped over; the roots
of the velocity are then found to rounding errors. Where the velocity jumps, as in an impact, or is
zero for a while, as in stick, the knot is the turning point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.motion.trajectory import Trajectory
from stickslip.numerics.levels import ROUNDED_SUM, TINIEST
from stickslip.orbits.studies.swinging import ValuesAndRates

_PIECES = 8  # initial number of pieces of a step
_PIECES_OF_ALL = 256  # initial number of pieces of the entire motion
# position at which a cubic is compared: irrational, to avoid aliasing
_BETWEEN = 0.3819660112501051
_MISSES = 0.02  # largest error of a cubic relative to the velocity
_NEAR = 0.1  # a minimum of the velocity below this fraction of its size is evaluated
_ZERO = 1e-11  # velocities below this fraction of the largest one are zero
_ROOT = 4.0 * np.finfo(float).eps  # relative


@dataclass(frozen=True)
class SwingTrace:
    """An oscillating quantity along a motion.

    Attributes
    ----------
    along : callable
        Values and rates of the quantity at times since the origin, within the steps of knots.
    """

    motion: Trajectory
    along: ValuesAndRates

    def __call__(self, clock: Array, step: AnyArray) -> tuple[Array, Array]:
        """Positions and velocities at times since the origin, within the steps of knots."""
        return self.along(clock, step)

    def roots(self, step: AnyArray, low: Array, high: Array) -> Array:
        """Zeros of the velocity between two times of each of several steps at which its signs
        differ."""
        from scipy.optimize.elementwise import find_root

        def rate(clock: Array, of: Array) -> Array:
            return self(np.ascontiguousarray(clock), of.astype(np.int64))[1]

        if not len(step):
            return np.zeros(0)
        given: Any = {"xatol": 0.0, "xrtol": _ROOT, "fatol": 0.0, "frtol": 0.0}
        found: Any = find_root(rate, (low, high), args=(step.astype(float),), tolerances=given)
        return np.asarray(found.x)


@dataclass(frozen=True)
class TurningPoints:
    """Turning points of a quantity.

    Attributes
    ----------
    clock : array, shape (n,)
        Times since the origin; for a rest, the time of its beginning, or of its end if it is at the
        start of the motion.
    position : array, shape (n,)
    rest : array, shape (n,)
        Duration of the rest there.
    fault : float
        Largest velocity at the roots, relative to the largest one of the motion.
    stops : bool
        Whether it rests at the last one, until the end.
    fades : bool
        Whether its velocity becomes indistinguishable from zero without a rest.
    """

    clock: Array
    position: Array
    rest: Array
    fault: float
    stops: bool
    fades: bool


def turning_points(followed: SwingTrace) -> TurningPoints:
    """All turning points of an oscillating quantity, in their order."""
    k = followed.motion.knots
    step, clock, x, v = _samples(followed)
    largest = float(np.max(np.abs(v), initial=0.0))
    sign = np.where(np.abs(v) > _ZERO * largest, np.sign(v), 0.0)
    moving = np.flatnonzero(sign)
    found: list[tuple[float, float, float]] = []  # time, position, rest
    if not len(moving):
        none = np.zeros(0)
        return TurningPoints(none, none, none, 0.0, False, False)
    first = int(moving[0])
    if first > 0:
        found.append((float(clock[first - 1]), float(x[first - 1]), 0.0))
    changes = np.flatnonzero(sign[moving[1:]] != sign[moving[:-1]])
    before, after = moving[changes], moving[changes + 1]
    smooth = (step[before] == step[after]) & (clock[before] < clock[after])
    i, j = before[smooth], after[smooth]
    roots = followed.roots(step[i], clock[i], clock[j])
    places, rates = followed(roots, step[i])
    fault = float(np.max(np.abs(rates), initial=0.0)) / largest
    found += [(float(t), float(at), 0.0) for t, at in zip(roots, places, strict=True)]
    for i, j in zip(before[~smooth], after[~smooth], strict=True):
        if j == i + 1:  # the velocity jumps
            found.append((float(clock[i]), float(x[i]), 0.0))
        else:
            found.append((float(clock[i + 1]), float(x[i + 1]), float(clock[j - 1] - clock[i + 1])))
    found.sort()
    last = int(moving[-1])
    stops = last + 1 < len(v) and _switched(followed, int(step[last + 1]), float(clock[last + 1]))
    rests = float(k.clock[-1] - clock[last + 1]) if stops else 0.0
    if stops:
        found.append((float(clock[last + 1]), float(x[last + 1]), rests))
    fades = not stops and last + 2 < len(v)  # the last sample alone is zero where the span ends so
    clocks, places, rested = np.ascontiguousarray(np.reshape(found, (-1, 3)).T, dtype=float)
    return TurningPoints(clocks, places, rested, fault, stops and rests > 0.0, fades)


def _switched(followed: SwingTrace, step: int, clock: float) -> bool:
    """Return whether a time is that of a switch: a decaying oscillation never comes to rest."""
    k = followed.motion.knots
    knot = step + 1 if clock == k.clock[step + 1] else step
    return bool(clock == k.clock[knot] and k.cause[knot] >= 0)


def _samples(followed: SwingTrace) -> tuple[AnyArray, Array, Array, Array]:
    """Step, time, position and velocity at times between which the motion is approximately cubic.

    Both limits at every knot are among them.
    """
    k = followed.motion.knots
    steps = np.flatnonzero(np.diff(k.clock) > 0.0)
    spans = np.diff(k.clock)[steps]
    whole = k.clock[-1] - k.clock[0]
    pieces = np.maximum(_PIECES, np.ceil(_PIECES_OF_ALL * spans / whole)).astype(int)
    step = np.repeat(steps, pieces + 1)
    parts = np.concatenate([np.arange(n + 1) / n for n in pieces])
    clock = k.clock[step] + parts * (k.clock[step + 1] - k.clock[step])
    ends = parts == 1.0
    clock[ends] = k.clock[step[ends] + 1]
    x, v = followed(clock, step)
    kept: list[tuple[AnyArray, Array, Array, Array]] = [(step, clock, x, v)]
    inner = np.flatnonzero(step[1:] == step[:-1])
    low: Any = step[inner], clock[inner], x[inner], v[inner]
    high: Any = step[inner], clock[inner + 1], x[inner + 1], v[inner + 1]
    while len(low[0]):
        at = low[1] + _BETWEEN * (high[1] - low[1])
        middle = low[0], at, *followed(at, low[0])
        kept.append(middle)
        rough, near, vertex = _judged(low, middle, high, _size(kept[0]))
        if np.any(near):
            where = low[0][near], vertex[near]
            kept.append((*where, *followed(where[1], where[0])))
        low, high = (
            tuple(np.concatenate([a[rough], b[rough]]) for a, b in zip(one, other, strict=True))
            for one, other in ((low, middle), (middle, high))
        )
    step, clock, x, v = (np.concatenate(part) for part in zip(*kept, strict=True))
    order = np.lexsort((clock, step))
    return step[order], clock[order], x[order], v[order]


def _size(samples: tuple[AnyArray, Array, Array, Array]) -> tuple[float, float, float]:
    """Largest time, position and velocity."""
    _, clock, x, v = samples
    time, place, rate = (float(np.max(np.abs(part), initial=0.0)) for part in (clock, x, v))
    return time, place, rate


def _judged(
    low: tuple[AnyArray, ...],
    middle: tuple[AnyArray, ...],
    high: tuple[AnyArray, ...],
    size: tuple[float, float, float],
) -> tuple[AnyArray, AnyArray, Array]:
    """Pieces that are not yet cubics; of the others, those that may turn twice, and the places.

    Parameters
    ----------
    low, middle, high : tuple of arrays
        Step, time, position and velocity at the ends of the pieces and between them.
    size : (float, float, float)
        Largest time, position and velocity.
    """
    (_, a, x0, v0), (_, _, x, v), (_, b, x1, v1) = low, middle, high
    h = b - a
    mean = (x1 - x0) / h
    # The cubic Hermite polynomial through both ends has the velocity v₀ + slope·s + bend·s².
    slope, bend = 6.0 * mean - 4.0 * v0 - 2.0 * v1, 3.0 * (v0 + v1) - 6.0 * mean
    s = _BETWEEN
    rate = v0 + s * (slope + s * bend)
    place = x0 + h * s * (v0 + s * (slope / 2.0 + s * bend / 3.0))
    scale = np.max(np.abs([v0, v, v1, mean]), axis=0)
    missed = (np.abs(rate - v) > _MISSES * scale) | (np.abs(place - x) > _MISSES * h * scale)
    largest_time, largest_x, largest_v = size
    counts = (scale > _ZERO * largest_v) & (h * scale > ROUNDED_SUM * largest_x)
    rough = missed & counts & (h > ROUNDED_SUM * max(largest_time, TINIEST))
    with np.errstate(divide="ignore", invalid="ignore"):
        where = np.where(bend != 0.0, -slope / (2.0 * bend), -1.0)
    inside = (where > 0.0) & (where < 1.0) & (v0 * v1 > 0.0)
    turn = np.where(inside, where, 0.5)
    lowest = (v0 + turn * (slope + turn * bend)) * np.sign(v0)
    near = inside & counts & ~rough & (lowest < _NEAR * scale)
    return rough, near, a + turn * h
