"""Animations of bodies pulled over the ground: the plate compactor, the crawler, sliders, a tip on
a lattice."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.explorer.drawings.driven import drive_of
from stickslip.explorer.drawings.parts import (
    Scene,
    arrow,
    block,
    box,
    disc,
    on_ground,
    path,
    polygon,
    rod,
    spring,
)

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_LEAD = 2.1  # distance from a block to the drawn end of its spring at rest


def compactor(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """A plate under a rotating imbalance, pulled by a spring."""
    p = motion.parameters
    pull = _given(motion, "pull", times)
    scale = _scaled(pull - values["x"])
    x = scale * values["x"]
    angle = p["Omega"] * times
    scene = on_ground(7.4, 3.6, -0.8, x + 0.7, "A plate that a turning weight presses and lifts")
    scene.add(spring((x + 1.0, 0.45), (scale * pull + _LEAD + 1.0, 0.45)))
    scene.add(arrow((scale * pull + _LEAD + 1.0, 0.45), (scale * pull + _LEAD + 1.6, 0.45)))
    plate = ((-1.15, 0.3), (-1.0, 0.0), (1.0, 0.0), (1.15, 0.3), (1.0, 0.34), (-1.0, 0.34))
    scene.add(polygon(plate, (x, 0.1)))
    scene.add(box(2.0, 0.12, (x, 0.0), look="sole", contact="ground"))
    scene.add(box(1.3, 0.5, (x, 0.44), look="light"))
    scene.add(disc(0.52, (x, 1.45), look="body"))
    scene.add(rod((x, 1.45), (x + 0.36 * np.sin(angle), 1.45 - 0.36 * np.cos(angle))))
    scene.add(disc(0.15, (x + 0.36 * np.sin(angle), 1.45 - 0.36 * np.cos(angle)), look="dark"))
    # Contribution of the imbalance to the normal force.
    lift = 0.5 * np.cos(angle)
    scene.add(arrow((x - 1.6, 1.45), (x - 1.6, 1.45 - lift)))
    return scene


def crawler(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """Two legs that a body pushes apart and pulls together."""
    reach = max(float(np.ptp(values["x_2"] - values["x_1"])), 1e-12)
    scale = 1.0 / reach
    hind, front = scale * values["x_1"] - 1.3, scale * values["x_2"] + 1.3
    scene = on_ground(7.4, 3.2, -0.8, (hind + front) / 2.0, "A crawler with two legs")
    for x, key in ((hind, "hind_leg"), (front, "front_leg")):
        leg = ((-0.34, 0.12), (0.34, 0.12), (0.22, 1.0), (-0.22, 1.0))
        scene.add(polygon(leg, (x, 0.0)))
        # Inclined bristles: they resist one direction more than the other.
        foot = ((-0.4, 0.0), (0.26, 0.0), (0.36, 0.14), (-0.34, 0.14))
        scene.add(polygon(foot, (x, 0.0), look="sole", contact=key))
    scene.add(spring((hind + 0.25, 0.75), (front - 0.25, 0.75), coils=10, width=0.2))
    scene.add(
        disc(0.3, (front + 0.1, 1.15), look="body"), disc(0.05, (front + 0.2, 1.22), look="dark")
    )
    return scene


def pulled_slider(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """A block pulled by a spring whose end moves with the load."""
    load = _given(motion, "ell", times)
    stretch = values["U"]
    scale = 1.6 / max(float(np.max(np.abs(stretch))), 1e-12)
    x, end = scale * (load - stretch), scale * load + 1.5
    scene = on_ground(8.2, 3.2, -0.8, end - 1.2, "A block that a spring pulls over the ground")
    scene.add(spring((x + 0.7, 0.55), (end, 0.55)))
    scene.add(arrow((end, 0.55), (end + 0.7, 0.55)))
    scene.add(*block(1.4, 0.9, x, "block"))
    return scene


def tip_on_lattice(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """A tip pulled by a spring over a lattice."""
    period = motion.parameters["a"]
    scale = 1.5 / period
    tip, holder = scale * values["x"], scale * _given(motion, "X", times)
    scene = Scene(8.4, 3.6, -0.9, tip, "A tip on a lattice")
    first, last = float(tip.min()) - 9.0, float(tip.max()) + 9.0
    at = np.arange(first, min(last, first + 400.0), 0.1)
    hills = [(float(s), float(-0.3 * np.cos(2.0 * np.pi * s / 1.5))) for s in at]
    scene.add(path(hills, look="wall"))
    height = -0.3 * np.cos(2.0 * np.pi * tip / 1.5)
    scene.add(spring((tip, height + 0.9), (holder, 1.75), coils=6, width=0.11))
    scene.add(box(1.6, 0.3, (holder, 1.75)), arrow((holder + 0.8, 1.9), (holder + 1.5, 1.9)))
    needle = ((0.0, 0.0), (0.2, 0.7), (0.2, 0.95), (-0.2, 0.95), (-0.2, 0.7))
    scene.add(polygon(needle, (tip, height)))
    return scene


def _given(motion: Trajectory, name: str, times: Array) -> Array:
    found = drive_of(motion, name, times)
    if found is None:
        raise KeyError(name)
    return found


def _scaled(stretch: Array) -> float:
    """Factor of lengths that makes the extension of a spring visible."""
    most = float(np.max(np.abs(stretch)))
    return 0.8 / most if most > 0.0 else 1.0
