"""Global minima over the phase: sampled, bracketed and refined, many functions at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import DeclarationError
from stickslip.rate_independent.dissipation.phase import Function, Varying, wrapped

Array = NDArray[np.float64]

SAMPLES = 256
"""Phases looked at. A minimum is missed if it is narrower than their distance and shows in none of them."""
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
STEPS = 64  # of the golden section: from the distance of two samples to rounding
MOST_PEAKS = 16  # that are refined
MOST_SEPARATE = 2000  # functions that can be refined one by one


def least_over_phases(varying: Varying) -> tuple[Array, Array]:
    """The least value of every entry of an array of the phase, and the phase at which it is taken.

    Parameters
    ----------
    varying : Varying
        Of shape (n,).

    Returns
    -------
    values, phases : ndarray of shape (n,)
        Values up to rounding; a phase is as accurate as that determines it, 1e-8 for a smooth minimum.

    Raises
    ------
    DeclarationError
        If there are too many entries to refine them one by one.
    """
    n = varying.shape[0]
    if not varying.depends_on_phase:
        return varying.at(0.0), np.zeros(n)
    if isinstance(varying, Function) and n > MOST_SEPARATE and not varying.elementwise:
        raise DeclarationError(
            varying.where,
            f"{n} minima over the phase cannot be refined one by one",
            "Let the function take an array of n phases, one for each component, and return each component at its own",
        )
    values, phases, index, centre = _scan(varying)
    if len(index):
        refined, found = golden_section(lambda s: varying.entries(index, s), centre - 1 / SAMPLES, centre + 1 / SAMPLES)
        order = np.argsort(-refined, kind="stable")  # the least of an entry is written last
        index, refined, found = index[order], refined[order], found[order]
        best, at = values.copy(), phases.copy()
        best[index], at[index] = refined, found
        # A sample that is the minimum, such as s = 0 or 1/2, is kept as it is.
        better = best < values - 4e-16 * np.abs(values)
        values, phases = np.where(better, best, values), np.where(better, at, phases)
    return values, wrapped(phases)


def _scan(varying: Varying) -> tuple[Array, Array, NDArray[np.intp], Array]:
    """Least samples, their phases, and the entries and samples around which the minimum may lie."""
    grid = np.arange(SAMPLES) / SAMPLES
    before, here = varying.at(grid[-1]), varying.at(grid[0])
    values, phases = here.copy(), np.zeros(varying.shape[0])
    found: list[tuple[NDArray[np.intp], Array, Array]] = []
    for s, following in zip(grid, np.roll(grid, -1), strict=True):
        after = varying.at(following)
        less = here < values
        values[less], phases[less] = here[less], s
        (index,) = np.nonzero(is_bracket(before, here, after))
        low = lowest(before[index], here[index], after[index])
        promising = low < values[index]
        found.append((index[promising], np.full(int(promising.sum()), s), low[promising]))
        before, here = here, after
    index, centre, low = (np.concatenate(parts) for parts in zip(*found, strict=True))
    keep = low < values[index]
    index, centre = index[keep], centre[keep]
    order = np.argsort(index, kind="stable")
    return values, phases, index[order], centre[order]


def peaks(on_grid: Array, f: Callable[[Array], Array]) -> tuple[Array, Array]:
    """The global maximum of a function of the phase, and all local maxima that may be positive.

    Parameters
    ----------
    on_grid : ndarray of shape (m,)
        Its values at the phases k/m.
    f : callable
        Its values at any phases, shape (k,).

    Returns
    -------
    phases, values : ndarray of shape (k,)
        Values decreasing.
    """
    m, before, after = len(on_grid), np.roll(on_grid, 1), np.roll(on_grid, -1)
    best = int(on_grid.argmax())
    promising = -lowest(-before, -on_grid, -after) >= min(0.0, on_grid[best])
    (index,) = np.nonzero(is_bracket(-before, -on_grid, -after) & promising)
    if not len(index):
        return np.array([best / m]), on_grid[[best]]
    index = index[np.argsort(-on_grid[index])][:MOST_PEAKS]
    values, phases = golden_section(lambda s: -f(wrapped(s)), (index - 1) / m, (index + 1) / m)
    values, sample = -values, on_grid[index]
    # A sample that is the maximum, such as s = 0 or 1/2, is kept as it is.
    better = values > sample + 4e-16 * np.abs(sample)
    values, phases = np.where(better, values, sample), np.where(better, phases, index / m)
    order = np.argsort(-values)
    return wrapped(phases[order]), values[order]


def is_bracket(before: Array, here: Array, after: Array) -> NDArray[np.bool_]:
    """Whether the middle of three samples is least, and not all are equal."""
    return (here <= before) & (here <= after) & ((here < before) | (here < after))


def lowest(before: Array, here: Array, after: Array) -> Array:
    """How low a function can be expected between three samples: as low as lines of the outer slopes would take it."""
    with np.errstate(invalid="ignore"):
        return here - (before - here) - (after - here)


def golden_section(f: Callable[[Array], Array], low: Array, high: Array) -> tuple[Array, Array]:
    """Minima of functions between two phases each, in step.

    Parameters
    ----------
    f : callable
        Takes phases of shape (k,), returns the k values.
    low, high : ndarray of shape (k,)

    Returns
    -------
    values, phases : ndarray of shape (k,)
    """
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_left, at_right = f(left), f(right)
    for _ in range(STEPS):
        down = at_left <= at_right
        low, high = np.where(down, low, left), np.where(down, right, high)
        kept, at_kept = np.where(down, left, right), np.where(down, at_left, at_right)
        new = np.where(down, high - GOLDEN * (high - low), low + GOLDEN * (high - low))
        at_new = f(new)
        left, right = np.where(down, new, kept), np.where(down, kept, new)
        at_left, at_right = np.where(down, at_new, at_kept), np.where(down, at_kept, at_new)
    first = at_left <= at_right
    return np.where(first, at_left, at_right), np.where(first, left, right)
