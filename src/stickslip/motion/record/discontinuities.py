"""The impacts and declared jumps of a motion, by their knots."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.arrays import Array

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_SMALL = 3e-8  # fraction of the first speed of bounces below which they are combined


class Discontinuity(NamedTuple):
    """An impact, or a jump, of a motion.

    Attributes
    ----------
    last : int
        The same, or that of the last of the bounces which are taken together with it.
    before : array, shape (n,)
        State before.
    """

    knot: int
    last: int
    time: float
    before: Array


def discontinuities_of(motion: Trajectory) -> dict[int, Discontinuity]:
    """The impacts and jumps of a motion by their knots.

    Bounces that come to an end are taken together as soon as they are small: as one impact without
    rebound, after which the contact is closed. The normal force that presses it while the bounces
    last has the impulse that these have, so that what is neglected is their square. Rounding
    errors of their derivatives grow as they shrink: here both are small.
    """
    k = motion.knots
    index = motion._impacts
    before = motion.states_at(k.time[index], index - 1)
    first = k.region.shape[1]
    last = index.copy()
    for j in range(len(index) - 1, -1, -1):
        contact = k.cause[index[j]] - first
        ends = k.mode[index[j], contact] == 0
        bounces = (
            j + 1 < len(index)
            and k.cause[index[j + 1]] == k.cause[index[j]]
            and index[j + 1] == index[j] + 1
        )
        if bounces and not ends and k.mode[last[j + 1], contact] == 0:
            last[j] = last[j + 1]
    ending = bool(np.any(last > index))
    speed = motion.impacts["approach"].to_numpy() if ending else np.zeros(len(index))
    begun = 0.0
    found = jumps_of(motion)
    for j, i in enumerate(map(int, index)):
        # the start of the bounces, also if other events were recorded in between
        since = k.cause[int(index[j - 1]) : i] if j > 0 else k.cause[:0]
        goes_on = j > 0 and since[0] == k.cause[i] and bool(np.all(since[1:] < 0))
        begun = begun if goes_on else speed[j]
        small = last[j] > i and speed[j] <= _SMALL * begun
        found[i] = Discontinuity(i, int(last[j]) if small else i, float(k.time[i]), before[j])
    return found


def jumps_of(motion: Trajectory) -> dict[int, Discontinuity]:
    """The declared jumps of a motion by their knots."""
    k = motion.knots
    index = np.flatnonzero(np.any(motion.switches.jumped, axis=1)) + 1
    before = motion.states_at(k.time[index], index - 1)
    pairs = zip(map(int, index), before, strict=True)
    return {i: Discontinuity(i, i, float(k.time[i]), y) for i, y in pairs}
