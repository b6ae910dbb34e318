"""What a period of a motion amounts to: extremes, phases, time in stick and slip, energy by
contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from stickslip.motion.between.observers import LASTED, Sums
from stickslip.orbits.return_map.recurrence import segments

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


@dataclass(frozen=True)
class Phase:
    """A stretch of a cycle in one mode and region.

    Attributes
    ----------
    duration : float
    modes : dict of str to int
        By contact: 0 stick, +1 or −1 slip.
    region : tuple of int
        By kink of the formulas: 1 where its guard is ≥ 0.
    """

    duration: float
    modes: dict[str, int]
    region: tuple[int, ...]

    @property
    def sticks(self) -> bool:
        """Whether all contacts stick."""
        return bool(self.modes) and not any(self.modes.values())


@dataclass(frozen=True)
class ContactShare:
    """What a contact does in a period: time in stick and in slip, and the energy it dissipates."""

    stick_time: float
    slip_time: float
    dissipated: float


def phases(motion: Trajectory) -> tuple[Phase, ...]:
    """The phases of a period; the one it starts in, which it also ends in, comes first as a
    whole."""
    k = motion.knots
    names = [c.name for c in motion._problem.compiled.equations.contacts]
    found = list[Phase]()
    mode = k.slip
    for a, b in segments(k):
        modes = dict(zip(names, map(int, mode[a]), strict=True))
        phase = Phase(float(k.time[b] - k.time[a]), modes, tuple(map(int, k.region[a])))
        if found and (found[-1].modes, found[-1].region) == (phase.modes, phase.region):
            phase = Phase(found.pop().duration + phase.duration, modes, phase.region)
        found.append(phase)
    if len(found) > 1 and (found[0].modes, found[0].region) == (found[-1].modes, found[-1].region):
        whole = Phase(found[0].duration + found[-1].duration, found[0].modes, found[0].region)
        found = [whole, *found[1:-1]]
    return tuple(found)


def contact_shares(motion: Trajectory, sums: Sums) -> dict[str, ContactShare]:
    """Time and energy of every contact."""
    contacts = motion._problem.compiled.equations.contacts
    return {
        contact.name: ContactShare(float(stick), float(sums.total[LASTED] - stick), float(work))
        for contact, stick, work in zip(contacts, sums.stick, sums.work, strict=True)
    }
