"""Global minima over the phase: of formulas by branch and bound; of functions sampled, bracketed
and refined."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.numerics.golden import GOLDEN, golden_section
from stickslip.numerics.levels import LAST_DIGITS, ROUNDED_TERM
from stickslip.rate_independent.sets.thresholds import nonnegative
from stickslip.rate_independent.signals.signal import Minima, Signal, wrapped

PHASE_SAMPLES = 256
"""Phases at which functions are looked at. A minimum is missed if it is narrower and shows in none
of them."""
_MOST_SECTIONS = 40  # largest number of iterations for a maximum
_RESOLVED = 1e-2  # relative change that counts as an improvement
_MOST_SEPARATE = 2000  # functions that can be refined one by one


def least_over_phases(signal: Signal) -> Minima:
    """The smallest value of every entry of an array over the phase, and the phase of the minimum.

    Parameters
    ----------
    signal : Signal
        Of shape (n,).

    Raises
    ------
    DeclarationError
        If there are too many entries to refine them one by one.
    """
    n = signal.shape[0]
    proved = signal.least()
    if proved is not None:
        return proved
    if n > _MOST_SEPARATE and not signal.elementwise:
        raise DeclarationError(
            signal.where,
            f"{n} minima over the phase are too many to be refined separately",
            "Vectorise the function: for an array of n phases, return component i at phase i",
        )
    values, phases, index, centre = _scan(signal)
    if len(index):
        refined, found = golden_section(
            lambda s: signal.entries(index, s),
            centre - 1 / PHASE_SAMPLES,
            centre + 1 / PHASE_SAMPLES,
        )
        # if an entry occurs more than once, its minimum is written last
        order = np.argsort(-refined, kind="stable")
        index = index[order]
        refined = refined[order]
        found = found[order]
        best, at = values.copy(), phases.copy()
        best[index], at[index] = refined, found
        # A sample that is the minimum, such as s = 0 or 1/2, is kept as it is.
        better = best < values - ROUNDED_TERM * np.abs(values)
        values, phases = np.where(better, best, values), np.where(better, at, phases)
    return Minima(values, wrapped(phases), values, PHASE_SAMPLES)


def _scan(signal: Signal) -> tuple[Array, Array, NDArray[np.intp], Array]:
    """Least samples, their phases, and the entries and samples around which the minimum may lie."""
    grid = np.arange(PHASE_SAMPLES) / PHASE_SAMPLES
    before, here = signal.at(grid[-1]), signal.at(grid[0])
    values = here.copy()
    phases = np.zeros(signal.shape[0])
    found: list[tuple[NDArray[np.intp], Array, Array]] = []
    for s, following in zip(grid, np.roll(grid, -1), strict=True):
        after = signal.at(following)
        less = here < values
        values[less] = here[less]
        phases[less] = s
        (index,) = np.nonzero(is_bracket(before, here, after))
        low = expected_low(before[index], here[index], after[index])
        promising = low < values[index]
        found.append((index[promising], np.full(int(promising.sum()), s), low[promising]))
        before, here = here, after
    index, centre, low = (np.concatenate(parts) for parts in zip(*found, strict=True))
    keep = low < values[index]
    index, centre = index[keep], centre[keep]
    order = np.argsort(index, kind="stable")
    return values, phases, index[order], centre[order]


def is_bracket(before: Array, here: Array, after: Array) -> NDArray[np.bool_]:
    """Return whether the middle of three samples is least, and not all are equal."""
    return (here <= before) & (here <= after) & ((here < before) | (here < after))


def expected_low(before: Array, here: Array, after: Array) -> Array:
    """Expected minimum of a function between three samples: the intersection of lines with the
    outer slopes."""
    with np.errstate(invalid="ignore"):
        return here - (before - here) - (after - here)


def refined_maxima(
    phases: Array, values: Array, f: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Maxima of functions near the middle of three phases each, by parabolas, and by sections where
    there is a kink.

    Parameters
    ----------
    phases, values : ndarray of shape (3, k)
        The middle value is the largest.
    f : callable
        Takes phases of shape (k,), not wrapped; returns the k values.

    Returns
    -------
    phases, values : ndarray of shape (k,)
        Values to a hundredth of themselves, as a rule.
    """
    (a, b, c), (fa, fb, fc) = phases, values
    idle = np.zeros(b.shape)
    for step in range(_MOST_SECTIONS):
        with np.errstate(all="ignore"):
            p, q = (b - a) * (fb - fc), (b - c) * (fb - fa)
            new = b - 0.5 * ((b - a) * p - (b - c) * q) / (p - q)
        # In every other step, or if the parabola gives no new point: the wider half.
        wide = np.where(b - a > c - b, b - (1.0 - GOLDEN) * (b - a), b + (1.0 - GOLDEN) * (c - b))
        new = np.where(
            (new > a) & (new < c) & (np.abs(new - b) > LAST_DIGITS) & (step % 2 == 0), new, wide
        )
        value = f(new)
        better = value > fb
        left = new < b
        idle = np.where(value - fb > _RESOLVED * np.abs(fb), 0, idle + 1)
        to_left = (better & ~left) | (~better & left)
        to_right = (better & left) | (~better & ~left)
        a = np.where(to_left, np.where(better, b, new), a)
        fa = np.where(to_left, np.where(better, fb, value), fa)
        c = np.where(to_right, np.where(better, b, new), c)
        fc = np.where(to_right, np.where(better, fb, value), fc)
        b, fb = np.where(better, new, b), np.where(better, value, fb)
        if (idle >= 3).all():
            break
    return b, fb


def least_thresholds(thresholds: Signal) -> Minima:
    """Thresholds at their minima over the phase; refuses negative ones."""
    least = least_over_phases(thresholds)
    if least.values.min() < 0.0:
        nonnegative(thresholds, float(least.phases[least.values.argmin()]))
    return least._replace(
        values=np.maximum(least.values, 0.0), floors=np.maximum(least.floors, 0.0)
    )
