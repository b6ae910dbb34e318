"""The distance of a cycle from the onset of stick: a function that changes its sign where a contact
begins to stick.

There are two cases. The speed of a contact that slips in one direction **touches** 0, and beyond
the onset it sticks briefly. Or the contact **reverses** through speed 0, and its force at that
moment decreases to the threshold. Beyond the onset the margin is continued by values at the
beginning of the stick, so that its derivative is continuous.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.return_map.mode_sequence import at_nodes, dips, holding
from stickslip.orbits.return_map.recurrence import segments

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


_AHEAD = 1e-6  # fraction of the period for the numerical derivative of a rate


@dataclass(frozen=True)
class Onset:
    """A contact, and whether it begins to stick where it reverses (else: where its speed touches
    0)."""

    contact: int
    reverses: bool

    def margin(self, motion: Trajectory, pieces: Pieces) -> float:
        """Positive on a cycle that slips, negative on one that sticks; NaN if neither is near."""
        found = _reversing if self.reverses else _touching
        return min(found(motion, pieces, self.contact), key=float, default=np.nan)


def nearest_onset(motion: Trajectory, pieces: Pieces) -> Onset:
    """The onset nearest to a cycle."""
    onsets = [
        Onset(c, reverses) for c in range(motion.knots.mode.shape[1]) for reverses in (False, True)
    ]
    far = [
        abs(margin) if np.isfinite(margin := o.margin(motion, pieces)) else np.inf for o in onsets
    ]
    return onsets[int(np.argmin(far))]


def _numbers(motion: Trajectory) -> Array:
    return np.array([motion.parameters[name] for name in motion.system.parameters])


def _sticks(motion: Trajectory, contact: int, sense: int) -> Iterator[tuple[tuple[int, int], int]]:
    """Slip before a stick, as first and last knot, and the knot at which the stick begins.

    `sense` is the product of the directions of slip before and after.
    """
    found = segments(motion)
    mode = motion.knots.mode[:, contact]
    for before, stuck, after in zip(found, found[1:], found[2:], strict=False):
        if mode[stuck[0]] == 0 and mode[before[0]] * mode[after[0]] == sense:
            yield before, stuck[0]


def _touching(motion: Trajectory, pieces: Pieces, contact: int) -> list[float]:
    """Smallest speeds in slip, and extrapolated minima beyond the onset of stick, relative to the
    largest."""
    k = motion.knots
    p = _numbers(motion)
    switch = k.region.shape[1] + contact
    margins = []
    looks = at_nodes(motion)
    for a, b in segments(motion):
        if k.mode[a, contact] != 0:
            low = dips(motion, pieces(k.mode[a], k.region[a]), a, b, p, looks)
            margins += [dip.refined()[1] for dip in low if dip.switch == switch]
    for (a, b), begin in _sticks(motion, contact, 1):
        margins.append(_depth(motion, pieces(k.mode[a], k.region[a]), (a, b), begin, switch))
    return margins


def _depth(
    motion: Trajectory, slip: Piece, ends: tuple[int, int], begin: int, switch: int
) -> float:
    """The minimum of a guard beyond its zero, from its rate and curvature there."""
    k = motion.knots
    p = _numbers(motion)
    n = motion.knots.state.shape[1]
    t = float(k.time[begin])
    y = k.state[begin]
    row = int(np.flatnonzero(slip.switches == switch)[0])
    here = slip.leave(t, y, p)
    ahead = _AHEAD * float(k.time[-1] - k.time[0])
    later = slip.leave(t + ahead, y + ahead * here.rates, p)
    curvature = (later.fall[row] - here.fall[row]) / ahead
    steps = np.arange(*ends)
    speeds = slip.felt(k.time[steps], k.state[steps].T, p)[n + row]
    if not curvature > 0.0:
        return np.nan
    return -0.5 * float(here.fall[row]) ** 2 / curvature / float(np.max(np.abs(speeds)))


def _reversing(motion: Trajectory, pieces: Pieces, contact: int) -> list[float]:
    """Excess of the force at a reversal over its threshold, relative to the thresholds; negative if
    the contact can stick."""
    k = motion.knots
    p = _numbers(motion)
    switch = k.region.shape[1] + contact
    margins = []
    # The end of the slip before, not the start of the one after: a stick between them may be too
    # short to count.
    turns = [
        end
        for (a, end), (b, _) in pairwise(segments(motion))
        if k.mode[a, contact] * k.mode[b, contact] == -1
    ]
    for knot in (*turns, *(begin for _, begin in _sticks(motion, contact, -1))):
        mode = k.mode[knot].copy()
        mode[contact] = 0
        stuck = pieces(mode, k.region[knot])
        margins.append(-holding(stuck, switch, float(k.time[knot]), k.state[knot], p))
    return margins
