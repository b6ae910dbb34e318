"""Times at which a motion is sampled for the page: every switch, and as many in between as are
visible."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_FINE = 6000  # number of equidistant samples of every motion
# numbers of extrema of a line up to which every fourth, or every second sample suffices
_TURNS = (90, 220)
_COLUMNS = 700  # columns of a screen, in which extremes of longer motions are kept
_MOST_KNOTS = 3000


def seen_times(
    motion: Trajectory, names: Sequence[str], window: tuple[float, float] | None
) -> tuple[Array, Array, dict[str, Array]]:
    """Times, the step of each, and values at them.

    Parameters
    ----------
    names : sequence of str
        Plotted quantities.
    window : (float, float), optional
        The visible time interval.
    """
    knots = motion.knots.time
    low, high = (float(knots[0]), float(knots[-1])) if window is None else window
    inside = knots[(knots >= low) & (knots <= high)]
    even = np.linspace(low, high, _FINE + 1)
    times = np.union1d(even, inside)
    index = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 1)
    values = motion.trace(names, times, index)
    kept = _kept(times, values, np.isin(times, inside), even)
    return times[kept], index[kept], {name: v[kept] for name, v in values.items()}


def _kept(times: Array, values: dict[str, Array], knot: Array, even: Array) -> Array:
    """Indices of the selected times."""
    count = int(np.count_nonzero(knot))
    if count > _MOST_KNOTS:
        return _extremes(times, values)
    turns = max((_turns(v) for v in values.values()), default=0)
    stride = 4 if turns <= _TURNS[0] else 2 if turns <= _TURNS[1] else 1
    return np.flatnonzero(knot | np.isin(times, even[::stride]))


def _turns(values: Array) -> int:
    """Number of turning points of a line."""
    rises = np.sign(np.diff(values))
    rises = rises[rises != 0.0]
    return int(np.count_nonzero(rises[1:] != rises[:-1]))


def _extremes(times: Array, values: dict[str, Array]) -> Array:
    """The first, smallest, largest and last value of every line in each column of the screen."""
    edges = np.linspace(times[0], times[-1], _COLUMNS + 1)
    column = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, _COLUMNS - 1)
    starts = np.flatnonzero(np.diff(column, prepend=-1))
    found = [starts, np.append(starts[1:], len(times)) - 1]
    for line in values.values():
        # Sorted by column, then by value: the ends of each column are its extremes.
        order = np.lexsort((line, column))
        ends = np.append(starts[1:], len(times)) - 1
        found += [order[starts], order[ends]]
    return np.unique(np.concatenate(found))
