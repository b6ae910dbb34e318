"""Continuous families of cycles that are not due to a translation symmetry.

Without damping, cycles exist for every amplitude; the forced oscillator with dry friction has a
continuum of asymmetric cycles at driving frequencies that are even fractions of its natural
frequency (G. Csernák, G. Stépán, S. W. Shaw, *Sub-harmonic resonant solutions of a harmonically
excited dry friction oscillator*, Nonlinear Dynamics 50 (2007) 93-109). All members are marginally
stable, and none is distinguished. Positions of contacts that never slip do not count as a family:
they are prescribed (:attr:`stickslip.orbits.return_map.shooting.Setting.held`).
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, StickslipError
from stickslip.orbits.return_map.damped_newton import (
    NEARLY_SINGULAR,
    Closed,
    NotClosed,
    close,
    flattest,
    restarted,
)
from stickslip.orbits.return_map.shooting import Orbit, Shooting

_SLOW = 1e-2  # singular value relative to the largest below which a change hardly decays
_CREEPS = 1e-3  # relative closure error of a motion that creeps towards an edge, at most
_EXACT = 1e-11  # closure error of members of a family relative to their size
_SHOWN = 1e-6  # components of a direction that messages show, relative to the largest
# distances of members to search for, in units of the size of the cycle
_AWAY = (2e-2, -2e-2, 2e-3, -2e-3)


class Family(ConvergenceError):
    """The cycle belongs to a continuous family, none of whose members is distinguished."""


def check_isolated(closed: Closed) -> None:
    """Reject cycles that come in families.

    Raises
    ------
    Family
        If the state can be moved so that the motion still closes: an invariant direction that is no
        translation.
    """
    ratio, direction = flattest(closed.shooting, closed.orbit)
    if ratio <= NEARLY_SINGULAR:
        raise _family(closed.shooting, closed.orbit, direction)


def neighbouring_members(failure: NotClosed) -> list[Closed]:
    """Two members of a family, if a motion that does not close converges slowly to the boundary of
    one; otherwise none.

    Along the family there is no restoring force, so Newton's method and the motion converge
    sublinearly. Members of the family are found slightly further along the direction of smallest
    change.
    """
    if failure.miss > _CREEPS:
        return []
    try:
        # The stretch of the station may be about to vanish; the members have another there.
        shooting, x = restarted(failure.shooting, failure.orbit, 1)
        ratio, direction = flattest(shooting, shooting.orbit(x))
    except StickslipError:
        return []
    if ratio > _SLOW or not np.any(direction[: shooting.time]):
        return []
    direction = direction / np.max(np.abs(direction[: shooting.time]))
    for away in _AWAY:
        members = []
        for part in (away, 2.0 * away):
            try:
                orbit = close(shooting, x + part * shooting.units(x) * direction, direction)
            except StickslipError:
                break
            if np.linalg.norm(orbit.F) <= _EXACT:
                members.append(Closed(shooting, orbit))
        if len(members) == 2:
            return members
    return []


def family_of(members: list[Closed]) -> Family:
    """Description of a family of which two members are known."""
    (first, second), shooting = members, members[1].shooting
    return _family(
        shooting, second.orbit, (second.orbit.x - first.orbit.x) / shooting.units(first.orbit.x)
    )


def _family(shooting: Shooting, orbit: Orbit, direction: Array) -> Family:
    """Description of a family of which one member and a direction are known."""
    change = shooting.stations[0].basis @ direction[: shooting.first[1]]
    change = change / np.max(np.abs(change))
    names = shooting.problem.system.declaration.state
    along = ", ".join(
        f"{name}: {w:.4g}" for name, w in zip(names, change, strict=True) if abs(w) > _SHOWN
    )
    beside = (
        "apart from translations"
        if shooting.symmetry.shifts.shape[1]
        else "although the system has no translation"
    )
    return Family(
        f"a cycle of {shooting.problem.system.name}",
        f"the cycles form a continuous family, {beside}: the cycle of period {orbit.period:.9g} "
        f"from {orbit.start} remains closed if its state is shifted along ({along}), so all of "
        "them are marginally stable",
        "Add damping or a contact that selects one of them, change the parameters, or choose "
        "another start",
    )
