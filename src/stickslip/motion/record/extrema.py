"""Extrema of quantities of a motion between equally spaced samples of its steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.numerics.golden import golden_section

_BESIDE = 0.25  # margin of the place of an extremum, in distances of samples


def extrema_between(
    quantities: Callable[[Array, Array], Array],
    levels: Array,
    times: Array,
    steps: Array,
    values: Array,
) -> tuple[Array, Array]:
    """Extrema of quantities between samples: the largest values above their levels, and those by
    which a quantity may pass its level twice between two samples.

    Parameters
    ----------
    quantities : callable
        Times since the origin, and steps -> quantities, shape (times, names).
    levels : array, shape (names,)
    times : array, shape (rows, samples)
        Times since the origin.
    steps : array of int, shape (rows,)
    values : array, shape (rows * samples, names)

    Returns
    -------
    row : array of int
    clock : array
    """
    excess = values.reshape(*times.shape, -1) - levels
    excess = np.where(np.isnan(excess), -np.inf, excess)
    # An event lasts while any quantity is above its level. The last column is what decides.
    excess = np.concatenate([excess, np.max(excess, axis=-1, keepdims=True)], axis=-1)
    with np.errstate(invalid="ignore"):
        parts = [_inside(excess), _at_the_end(excess), _at_the_end(excess[:, ::-1])]
    last = times.shape[1] - 1
    row = np.concatenate([found.row for found in parts])
    name = np.concatenate([found.name for found in parts])
    sign = np.concatenate([found.sign for found in parts])
    low = np.concatenate([parts[0].place, parts[1].place, last - 1 - parts[2].place])
    high = np.concatenate([parts[0].place + 2, parts[1].place + 1, last - parts[2].place])

    def signed(clock: Array) -> Array:
        found = quantities(clock, steps[row]) - levels
        found = np.where(np.isnan(found), -np.inf, found)
        found = np.concatenate([found, np.max(found, axis=-1, keepdims=True)], axis=-1)
        return sign * found[np.arange(len(row)), name]

    ends = times[row, low], times[row, high]
    return row, golden_section(signed, *ends)[1] if len(row) else ends[0]


class _Between(NamedTuple):
    """Extrema between samples: their rows, the first sample, the column, and −1 for maxima."""

    row: AnyArray
    place: AnyArray
    name: AnyArray
    sign: Array


def _between(highest: AnyArray, lowest: AnyArray) -> _Between:
    row, place, name = np.nonzero(np.logical_or(highest, lowest))
    return _Between(row, place, name, np.where(highest[row, place, name], -1.0, 1.0))


def _inside(excess: Array) -> _Between:
    """Extrema around a sample that exceeds both neighbours, or is exceeded by them."""
    left, middle, right = excess[:, :-2], excess[:, 1:-1], excess[:, 2:]
    # A parabola through three equally spaced samples passes the middle one by at most an eighth of
    # the larger difference, and two crossing lines by at most all of it.
    room = np.maximum(np.abs(middle - left), np.abs(middle - right))
    highest = (middle >= left) & (middle >= right) & (middle + room > 0.0)
    lowest = (middle <= left) & (middle <= right) & (middle > 0.0) & (middle - room <= 0.0)
    return _between(highest & (room > 0.0), lowest & (room > 0.0))


def _at_the_end(excess: Array) -> _Between:
    """Extrema between the first two samples of a step."""
    first, second, third = (excess[:, i : i + 1] for i in range(3))
    room = np.maximum(np.abs(second - first), np.abs(third - second))
    bend = first - 2.0 * second + third
    # Where the parabola through the first three samples turns, in units of their distance.
    turn = (1.5 * first - 2.0 * second + 0.5 * third) / np.where(bend == 0.0, np.nan, bend)
    turns = (turn > -_BESIDE) & (turn < 1.0 + _BESIDE)
    top, bottom = np.maximum(first, second), np.minimum(first, second)
    highest = (bend < 0.0) & turns & (top + room > 0.0)
    lowest = (bottom > 0.0) & (bottom - room <= 0.0) & (room > 0.0)
    return _between(highest, lowest & ~highest)
