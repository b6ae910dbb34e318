"""The animation of contacts in a plane: bodies seen from above, on their paths."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.display.symbols import unicode_symbol
from stickslip.explorer.drawings.parts import Scene, disc, label, path
from stickslip.model.quantities import contact_key
from stickslip.model.system import System
from stickslip.numerics.ratios import ratio

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_WIDTH, _HEIGHT = 6.4, 3.4
_LARGE = 0.22  # a body
_AIR = 2.2 * _LARGE
_MOST = 400  # points of a path


def bodies_of(system: System) -> dict[tuple[str, str], str]:
    """Pairs of coordinates that are the velocities of a planar contact, with its name in
    variables."""
    declared = {c.name: c for c in system.declaration.contacts}
    found: dict[tuple[str, str], str] = {}
    for name, (first, second, *_) in system.planes.items():
        across, up = (list(declared[part].direction) for part in (first, second))
        if len(across) == len(up) == 1:
            found.setdefault((across[0], up[0]), contact_key(name))
    return found


def bodies_from_above(
    motion: Trajectory, times: Array, values: Mapping[str, Array]
) -> Scene | None:
    """Animation of the plane in which bodies slide; None if their positions are not coordinates.

    Parameters
    ----------
    times : array, shape (n,)
    values : mapping of str to array, shape (n,)
    """
    bodies = {
        pair: key
        for pair, key in bodies_of(motion.system).items()
        if all(x in values for x in pair)
    }
    if not bodies:
        return None
    across = np.concatenate([values[x] for x, _ in bodies])
    up = np.concatenate([values[y] for _, y in bodies])
    middle = [float(np.min(v) + np.max(v)) / 2.0 for v in (across, up)]
    room = [
        ratio(size - _AIR, float(np.ptp(v)))
        for size, v in zip((_WIDTH, _HEIGHT), (across, up), strict=True)
    ]
    scale = min(room) if max(np.ptp(across), np.ptp(up)) > 0.0 else 1.0
    scene = Scene(_WIDTH, _HEIGHT, -_HEIGHT / 2, about=f"{motion.system.name}, seen from above")
    placed = {
        (x, y): ((values[x] - middle[0]) * scale, (values[y] - middle[1]) * scale)
        for x, y in bodies
    }
    for places in placed.values():
        some = np.unique(np.linspace(0, len(times) - 1, _MOST).astype(int))
        scene.add(path(list(zip(*(v[some].tolist() for v in places), strict=True))))
    for (x, y), key in bodies.items():
        at = placed[x, y]
        scene.add(disc(_LARGE, at, 0.0, "sole", key))
        scene.add(disc(0.7 * _LARGE, at, 0.0, "body"))
        if len(bodies) > 1:
            said = f"{unicode_symbol(x)}, {unicode_symbol(y)}"
            scene.add(label(said, (at[0], at[1] + 1.3 * _LARGE)))
    return scene
