"""The generic animation: displacements are blocks on the ground, rotations are discs; contacts are
drawn below the bodies that they act on, and springs between coordinates that the energy couples."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.display.symbols import unicode_symbol
from stickslip.explorer.drawings.driven import way_of
from stickslip.explorer.drawings.parts import (
    Course,
    MovingPart,
    Scene,
    Spot,
    block,
    disc,
    ground,
    label,
    rod,
    spring,
)
from stickslip.model.quantities import contact_key, quantity
from stickslip.model.system import System
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_MOST = 9  # largest number of coordinates that are drawn
_APART = 2.4  # distance between blocks
_REACH = 0.75  # largest displacement of a block in the drawing
_TALL = 0.9


def generic_scene(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """An animation that is available for every system."""
    system = motion.system
    names = [x for x in system.places if x in values] or [x for x in system.internal if x in values]
    names = names[:_MOST]
    turning = [x for x in names if quantity(system, x).get("units") == "rad"]
    blocks = [x for x in names if x not in turning]
    soles = soles_of(system)
    scene = Scene(
        max(len(names), 2) * _APART + 1.6, 3.4, -0.9, about=f"The motion of {system.name}"
    )
    places = {x: (i - (len(names) - 1) / 2) * _APART for i, x in enumerate([*blocks, *turning])}
    way, scale = _ways(blocks, values)
    carried = next((soles[x] for x in blocks if x in soles), "")
    if blocks:
        scene.add(ground(0.0, belt_shift(motion, carried, times) * scale, contact=""))
    middle = {x: places[x] + way[x] for x in blocks}
    scene.add(*_springs(system, blocks, middle))
    for x in blocks:
        contact = soles.get(x, "")
        scene.add(*block(1.2, _TALL, middle[x], contact))
        scene.add(label(unicode_symbol(x), (middle[x], 0.46)))
    for x in turning:
        at: Spot = (places[x], 0.75)
        contact = soles.get(x, "")
        scene.add(disc(0.82, at, 0.0, "sole" if contact else "light", contact))
        scene.add(disc(0.7, at, values[x], "body", spokes=1))
        scene.add(label(unicode_symbol(x), (places[x], 1.85)))
    return scene


def soles_of(system: System) -> dict[str, str]:
    """The contact under each coordinate whose rate is its velocity, by its name in variables."""
    found: dict[str, str] = {}
    named = {part: name for name, parts in system.frictional.items() for part in parts}
    for contact in system.declaration.contacts:
        (first, *others) = contact.direction or {"": 0.0}
        if first and not others and contact.name in named:
            found.setdefault(first, contact_key(named[contact.name]))
    return found


def belt_shift(motion: Trajectory, key: str, times: Array) -> Course:
    """Displacement of the surface under a contact."""
    for name, parts in motion.system.frictional.items():
        contact = motion.system.dry_contacts[parts[0]]
        if contact_key(name) == key and contact.surface_speed != 0.0:
            way = way_of(motion, contact.surface_speed, times)
            return 0.0 if way is None else way
    return 0.0


def _ways(blocks: list[str], values: Mapping[str, Array]) -> tuple[dict[str, Array], float]:
    """Displacements of the blocks in the drawing, and the scale of lengths."""
    if not blocks:
        return {}, 1.0
    ways = {x: values[x] - np.mean(values[x][:1]) for x in blocks}
    most = max(float(np.max(np.abs(way))) for way in ways.values())
    scale = _REACH / most if most > 0.0 else 1.0
    return {x: scale * way for x, way in ways.items()}, scale


def _springs(system: System, blocks: list[str], middle: Mapping[str, Array]) -> list[MovingPart]:
    """Springs between neighbouring coordinates that the energy couples, and to the wall."""
    energy = system.declaration.potential
    found = []
    for one, other in pairwise(blocks):
        if not ex.is_number(ex.derivative(ex.derivative(energy, one), other), 0.0):
            found.append(spring((middle[one] + 0.6, 0.55), (middle[other] - 0.6, 0.55)))
    if blocks and not found:
        first = blocks[0]
        if not ex.is_number(ex.derivative(ex.derivative(energy, first), first), 0.0):
            wall = float(np.mean(middle[first])) - 2.1
            found.append(spring((wall, 0.55), (middle[first] - 0.6, 0.55)))
            found.append(rod((wall, 0.0), (wall, 1.2), "wall"))
    return found
