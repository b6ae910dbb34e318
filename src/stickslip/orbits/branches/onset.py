"""The distances of a cycle from changes of its sticks: functions that change their signs where a
contact begins to stick, or to slip back before it sticks.

There are three cases. The speed of a contact that slips in one direction **touches** 0, and beyond
the onset it sticks briefly. The contact **reverses** through speed 0, its force at that moment
decreases to the threshold, and beyond the onset it sticks briefly. Or it **sticks** where it stops,
its force at that moment increases to the threshold of the other direction, and beyond this point it
slips back before it sticks. Beyond an onset the margin is continued by values at the beginning of
the stick, so that its derivative is continuous.

Reference: M. di Bernardo, C. J. Budd, A. R. Champneys, P. Kowalczyk, *Piecewise-smooth Dynamical
Systems*, Springer 2008, chapter 8: grazing-sliding, crossing-sliding, switching-sliding.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.return_map.mode_sequence import (
    Sequence,
    at_nodes,
    dips,
    guard_between,
    holding,
    slips_back,
    sticks_once_more,
)
from stickslip.orbits.return_map.recurrence import segments

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


_AHEAD = 1e-6  # fraction of the period for the numerical derivative of a rate
_BRIEF = 2.0  # ratio of the excesses at the ends of a slip above which it is not brief


class Way(Enum):
    """How a stick begins or changes."""

    TOUCHES = "the speed touches 0"
    REVERSES = "the force at a reversal decreases to the threshold"
    SLIPS_BACK = "the force at the beginning of a stick increases to the threshold"


RESIDUALS = {
    Way.TOUCHES: "smallest slip speed",
    Way.REVERSES: "force at the reversal",
    Way.SLIPS_BACK: "force at the beginning of the stick",
}
"""The residual of the defining equation of each, relative to the largest speed or force."""


@dataclass(frozen=True)
class Onset:
    """A contact, how its stick begins or changes, and whether it sticks elsewhere as well."""

    contact: int
    way: Way
    another: bool = False

    def margin(self, motion: Trajectory, pieces: Pieces) -> float:
        """Positive on a cycle that slips, negative on one that sticks; NaN if neither is near."""
        margins = [m for m in _MARGINS[self.way](motion, pieces, self.contact) if np.isfinite(m)]
        # Of several sticks that all vanish, the last one; if others remain, the one that changes.
        size = abs if self.another else float
        return min(margins, key=size, default=np.nan)


def onsets_between(before: Sequence, after: Sequence) -> list[Onset]:
    """The onsets that explain a change of the sequence."""
    found = list[Onset]()
    for contact in range(len(before[0][0])):
        stuck, sticks = (any(mode[contact] == 0 for mode, _ in s) for s in (before, after))
        if stuck != sticks:
            own = [mode[contact] for mode, _ in (before if stuck else after)]
            found += [Onset(contact, way) for way in _ways(own)]
    if found:
        return found
    more = {Way.SLIPS_BACK: slips_back, Way.REVERSES: sticks_once_more}
    return [Onset(c, way, True) for way, brief in more.items() for c in brief(before, after)]


def _ways(modes: list[int]) -> list[Way]:
    """How the sticks of a contact begin, from its modes in the phases of a cycle."""
    own = [m for m, last in zip(modes, modes[-1:] + modes[:-1], strict=True) if m != last]
    senses = {
        own[i - 1] * own[(i + 1) % len(own)]
        for i, mode in enumerate(own)
        if mode == 0 and len(own) > 1
    }
    ways = {1: Way.TOUCHES, -1: Way.REVERSES}
    return [ways[sense] for sense in sorted(senses) if sense in ways]


def nearest_onset(
    motion: Trajectory, pieces: Pieces, among: Iterable[Onset] | None = None
) -> Onset | None:
    """The onset of stick, or of some given ones, nearest to a cycle; None if there is none."""
    if among is None:
        contacts = range(motion.knots.mode.shape[1])
        among = [Onset(c, way) for c in contacts for way in (Way.TOUCHES, Way.REVERSES)]
    far = [(abs(onset.margin(motion, pieces)), onset) for onset in among]
    known = [(margin, i, onset) for i, (margin, onset) in enumerate(far) if np.isfinite(margin)]
    return min(known)[2] if known else None


def _numbers(motion: Trajectory) -> Array:
    return np.array([motion.parameters[name] for name in motion.system.parameters])


def _sticks(
    motion: Trajectory, contact: int, sense: int
) -> Iterator[tuple[tuple[int, int], tuple[int, int], tuple[int, int]]]:
    """Slip, stick and slip, each as first and last knot.

    `sense` is the product of the directions of slip before and after.
    """
    found = segments(motion)
    mode = motion.knots.mode[:, contact]
    for before, stuck, after in zip(found, found[1:], found[2:], strict=False):
        if mode[stuck[0]] == 0 and mode[before[0]] * mode[after[0]] == sense:
            yield before, stuck, after


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
    for before, (begin, _), after in _sticks(motion, contact, 1):
        sides = [
            guard_between(motion, pieces(k.mode[a], k.region[a]), a, b, switch, p, looks)
            for a, b in (before, after)
        ]
        largest = max(float(np.max(np.abs(side), initial=0.0)) for side in sides)
        depth = _depth(motion, pieces(k.mode[before[0]], k.region[before[0]]), begin, switch)
        margins.append(depth / largest if largest > 0.0 else np.nan)
    return margins


def _depth(motion: Trajectory, slip: Piece, begin: int, switch: int) -> float:
    """The minimum of a guard beyond its zero, from its rate and curvature there."""
    k = motion.knots
    p = _numbers(motion)
    t = float(k.time[begin])
    y = k.state[begin]
    row = int(np.flatnonzero(slip.switches == switch)[0])
    here = slip.leave(t, y, p)
    ahead = _AHEAD * float(k.time[-1] - k.time[0])
    later = slip.leave(t + ahead, y + ahead * here.rates, p)
    curvature = float(later.fall[row] - here.fall[row]) / ahead
    return -0.5 * float(here.fall[row]) ** 2 / curvature if curvature > 0.0 else np.nan


def _reversing(motion: Trajectory, pieces: Pieces, contact: int) -> list[float]:
    """Excess of the force at a reversal over its threshold, relative to the thresholds; negative if
    the contact can stick."""
    k = motion.knots
    # The end of the slip before, not the start of the one after: a stick between them may be too
    # short to count.
    turns = [
        end
        for (a, end), (b, _) in pairwise(segments(motion))
        if k.mode[a, contact] * k.mode[b, contact] == -1
    ]
    begins = [begin for _, (begin, _), _ in _sticks(motion, contact, -1)]
    return _excess(motion, pieces, contact, [*turns, *begins])


def _slipping_back(motion: Trajectory, pieces: Pieces, contact: int) -> list[float]:
    """The same where the contact slips back before it sticks, and where it sticks at once."""
    mode = motion.knots.mode[:, contact]
    # Modes, and where they begin: at the ends of the phases before, since what follows may be too
    # short to count. The first phase is also the last one.
    found = segments(motion)
    runs = [
        (int(mode[b]), end) for (a, end), (b, _) in pairwise(found) if int(mode[a]) != int(mode[b])
    ]
    margins = list[float]()
    for i, (own, begin) in enumerate(runs):
        last, later = runs[i - 1], runs[(i + 1) % len(runs)]
        if last[0] * own == -1 and later[0] == 0:
            margins += _excess(motion, pieces, contact, [begin])
        if abs(last[0]) != 1 or own != 0:
            continue
        stops = _excess(motion, pieces, contact, [begin])
        if runs[i - 2][0] == -last[0]:
            # After a brief slip back, the excesses at both of its ends are opposite.
            turns = _excess(motion, pieces, contact, [last[1]])
            stops = [e for e in stops if not turns or abs(turns[0]) > _BRIEF * abs(e)]
        margins += stops
    return margins


def _excess(motion: Trajectory, pieces: Pieces, contact: int, knots: Iterable[int]) -> list[float]:
    """Excess of the force of a contact that stops over its threshold."""
    k = motion.knots
    p = _numbers(motion)
    margins = list[float]()
    for knot in knots:
        mode = k.mode[knot].copy()
        mode[contact] = 0
        stuck = pieces(mode, k.region[knot])
        switch = k.region.shape[1] + contact
        with suppress(ZeroDivisionError):
            margins.append(-holding(stuck, switch, float(k.time[knot]), k.state[knot], p))
    return margins


_MARGINS = {
    Way.TOUCHES: _touching,
    Way.REVERSES: _reversing,
    Way.SLIPS_BACK: _slipping_back,
}
