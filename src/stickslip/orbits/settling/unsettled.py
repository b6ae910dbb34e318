"""Motions that have not settled before their limits: whether they are slow.

Marks are compared over the lag with the closest returns. A motion is slow if these returns continue
along a straight line, as those to a cycle with a multiplier near 1 do, or if they decrease or
increase by a constant factor, as along a spiral. Returns of a quasi-periodic motion rotate and
recur; those of an irregular one do neither.
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.steps.arrays import NOW, Lane
from stickslip.orbits.settling.engine.tables import COUNT, TRUE, Marks, Rules

CERTAIN_GROWTH = 3.0
"""Logarithm of the growth of a small change from which on neighbours part for certain: along a
quasi-periodic motion it grows in proportion to the time, which is a factor of 2 here."""

_RETURNS = 8  # smallest number of returns over a lag for a conclusion
_CLOSER = 0.1  # a longer lag is chosen if it misses by less than this fraction of a shorter one
_STRAIGHT = 0.999  # ratio of distance and path length along a line
_EVEN = 0.9  # correlation of the logarithms of returns with their numbers; that of a wave is less
_CHANGED = 0.1  # smallest change of these logarithms from the first to the last


def elapsed_of(marks: Marks, rules: Rules, saved: Lane) -> Array:
    """Duration of each motion, including resets of its clock."""
    again = np.maximum(marks.numbers[:, COUNT] - 1, 0) * marks.drive
    return saved.clock[:, NOW] + (0.0 if rules.timed else again)


def changes_slowly(marks: Marks, rules: Rules, i: int) -> bool:
    """Return whether a motion changes slowly from return to return.

    Parameters
    ----------
    i : int
        The lane.
    """
    count = int(marks.numbers[i, COUNT])
    ring = marks.time.shape[1]
    known = min(count, ring, int(marks.numbers[i, TRUE]) + 1)
    where = np.arange(count - known, count) % ring
    kind = marks.kind[i, where]
    best, closest, chosen = np.zeros((0, 0)), np.inf, 0
    for lag in range(1, known // _RETURNS + 1):
        if np.any(kind[lag:] != kind[:-lag]):
            continue
        change = _changes(marks, rules, i, where, lag)
        missed = float(np.mean(np.linalg.norm(change, axis=1)))
        if missed < _CLOSER * closest:
            best, closest, chosen = change, missed, lag
    return chosen > 0 and _is_regular(best, chosen)


def _changes(marks: Marks, rules: Rules, i: int, where: Array, lag: int) -> Array:
    """Changes from each mark to the one a lag later, relative to the sizes, without frame,
    translations and cells."""
    y, t = marks.state[i, where], marks.time[i, where]
    change = y[lag:] - y[:-lag] - marks.frame[i] * (t[lag:] - t[:-lag])[:, None]
    for shift in rules.shifts:
        if square := float(shift @ shift):
            change = change - np.outer(change @ shift / square, shift)
    for cell, form in marks.cells[i]:
        # The nearest of the periodic images.
        change = change - np.outer(np.floor(change @ form + 0.5), cell)
    change = np.where(np.abs(change) > rules.real[4], change, 0.0)
    size = marks.size[i]
    return np.divide(change, size, out=np.zeros_like(change), where=size > 0.0)


def _is_regular(change: Array, lag: int) -> bool:
    """Return whether changes over a lag add up, or rotate and change by a constant factor."""
    chain = change[(len(change) - 1) % lag :: lag]
    missed = np.linalg.norm(chain, axis=1)
    if len(missed) < _RETURNS or not np.all(missed > 0.0):
        return False
    if np.linalg.norm(np.sum(chain, axis=0)) >= _STRAIGHT * np.sum(missed):
        return True
    # A spiral: it turns at least once, and its steps form a geometric sequence.
    along = np.sum(chain[1:] * chain[:-1], axis=1) / (missed[1:] * missed[:-1])
    turned = np.sum(np.arccos(np.clip(along, -1.0, 1.0)))
    number, size = np.arange(len(missed)), np.log(missed)
    if turned < 2.0 * np.pi or np.ptp(size) == 0.0:
        return False
    slope = np.polyfit(number, size, 1)[0] * len(missed)
    return bool(abs(np.corrcoef(number, size)[0, 1]) >= _EVEN and abs(slope) >= _CHANGED)
