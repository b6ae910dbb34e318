"""The order in which a motion is followed to requested times."""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array


def in_order(clock: Array, index: Array) -> Array | slice:
    """Order of times by their steps, so that each step is computed once for any number of times in
    any order."""
    later = (index[1:] > index[:-1]) | ((index[1:] == index[:-1]) & (clock[1:] >= clock[:-1]))
    return slice(None) if np.all(later) else np.lexsort((clock, index))


def as_asked(rows: Array, order: Array | slice) -> Array:
    """Rows that were made in an order, in the one that was asked for."""
    if isinstance(order, slice):
        return rows
    found = np.empty_like(rows)
    found[order] = rows
    return found
