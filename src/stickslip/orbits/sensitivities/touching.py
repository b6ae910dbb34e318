"""Guards that a motion touches without crossing them, and contacts that reverse their slip where
they could also stick.

There it has no derivative: half of its neighbours meet an event that it does not have. Guards are
evaluated with the resolution of linear motions, at the Gauss nodes of each part.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stickslip.motion.trajectory import Trajectory
from stickslip.numerics.levels import GUARD_TOUCHED
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.variational import resolution
from stickslip.orbits.return_map.mode_sequence import at_nodes, dips, reversals
from stickslip.orbits.return_map.recurrence import segments

_WORTH = 1e-1  # … below which its minimum is searched for


def touched(trajectory: Trajectory, pieces: Pieces) -> list[tuple[float, str]]:
    """Times at which a motion touches a boundary of its mode, with descriptions."""
    k = trajectory.knots
    p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
    if len(k.clock) < 2:
        return []
    looks = at_nodes(trajectory, resolution(trajectory, pieces))
    stretches = segments(trajectory)
    found: list[tuple[float, str]] = []
    for a, b in stretches:
        for dip in dips(trajectory, pieces(k.mode[a], k.region[a]), a, b, p, looks):
            when, least = dip.refined() if dip.value < _WORTH else (0.0, 1.0)
            if least <= GUARD_TOUCHED:
                found.append((when, "a guard is touched tangentially"))
    for (_, a), (b, _) in pairwise(stretches):
        if min(reversals(trajectory, pieces, a, b, p), default=1.0) <= GUARD_TOUCHED:
            found.append(
                (float(k.time[b]), "a contact reverses its slip where it could also stick")
            )
    return found
