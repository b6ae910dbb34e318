"""The choice of an animation: a specific one for the system, one of its structures, one from above
for planar contacts, or the generic one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING

from stickslip.arrays import Array
from stickslip.explorer.drawings.from_above import bodies_from_above
from stickslip.explorer.drawings.generic import generic_scene
from stickslip.explorer.drawings.parts import Scene
from stickslip.explorer.drawings.shapes import structures_by_index

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

Draw = Callable[["Trajectory", Array, Mapping[str, Array]], Scene]
"""Makes the scene of a motion from times, shape (n,), and states, forces and modes (``mode_KEY``)
at these, shape (n,) each. It raises KeyError if it knows other coordinates."""
_ROOM = "stickslip.explorer.drawings"
# Systems with a dedicated drawing, and its module.
DRAWN = {
    "rocking_toy": "toys:walking_toy",
    "rocking_toy_inertial": "toys:walking_toy",
    "rocking_oscillator": "toys:walking_toy",
    "ramp_walker": "toys:ramp_toy",
    "woodpecker": "toys:woodpecker_toy",
    "rimless_wheel": "walkers:wheel",
    "simplest_walker": "walkers:two_legs",
    "bouncing_ball": "walkers:ball",
    "painleve_rod": "walkers:falling_rod",
    "cart_pendulum": "walkers:pendulum_on_cart",
    "plate_compactor": "tracks:compactor",
    "two_leg_crawler": "tracks:crawler",
    "spring_slider": "tracks:pulled_slider",
    "prandtl_tomlinson": "tracks:tip_on_lattice",
}


def scene_of(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """The animation of a motion.

    Parameters
    ----------
    times : array, shape (n,)
    values : mapping of str to array, shape (n,)
        States, forces, and modes (``mode_KEY``) at these times.
    """
    system = motion.system
    where = DRAWN.get(system.name)
    if where is not None:
        module, _, name = where.partition(":")
        draw: Draw = getattr(import_module(f"{_ROOM}.{module}"), name)
        try:
            return draw(motion, times, values)
        except KeyError:
            pass  # a user's system with that name and other coordinates
    if system.structures and not system.coordinates:
        return structures_by_index(motion, times)
    above = bodies_from_above(motion, times, values) if system.planes else None
    return above or generic_scene(motion, times, values)
