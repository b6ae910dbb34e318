"""Animations of walkers on stiff legs (the rimless wheel and the simplest walker), and of falling
and swinging bodies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.explorer.drawings.driven import drive_of
from stickslip.explorer.drawings.parts import (
    Course,
    Scene,
    block,
    box,
    disc,
    ground,
    on_ground,
    rod,
)

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


def wheel(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """A wheel of spokes, in the frame of the slope."""
    gamma, alpha = motion.parameters["gamma"], motion.parameters["alpha"]
    lean = values["theta"] - gamma  # angle of the spoke on the ground, from the slope's normal
    steps = _counted(motion, times)
    foot = 2.0 * np.sin(alpha) * steps
    hub = (foot + np.sin(lean), np.cos(lean))
    scene = on_ground(6.4, 3.0, -0.6, hub[0], "A wheel of spokes that rolls down a slope")
    spokes = max(round(np.pi / alpha), 3)
    for i in range(spokes):
        angle = lean + np.pi + 2.0 * alpha * i
        end = (hub[0] + np.sin(angle), hub[1] + np.cos(angle))
        scene.add(rod(hub, end, "leg light" if i == 0 else "leg shade"))
    scene.add(disc(0.12, hub, look="body"))
    return scene


def two_legs(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """Two legs and a hip, in the frame of the slope."""
    theta, phi = values["theta"], values["phi"]
    before, after = _impacts(motion, times, theta)
    foot = before - after  # distance travelled by the stance foot
    hip = (foot - np.sin(theta), np.cos(theta))
    swing = (hip[0] - np.sin(phi - theta), hip[1] - np.cos(phi - theta))
    scene = on_ground(5.6, 2.6, -0.6, hip[0], "Two legs that walk down a slope")
    scene.add(rod(hip, swing, "leg shade"), rod(hip, (foot, 0.0), "leg light"))
    scene.add(disc(0.14, hip, look="body"))
    scene.add(disc(0.05, swing, look="dark"), disc(0.05, (foot, 0.0), look="dark"))
    return scene


def ball(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """A ball over a plate that may move."""
    plate = drive_of(motion, "plate", times)
    moves: Course = 0.0 if plate is None else plate
    scale = 2.2 / max(float(np.max(np.abs(values["y"]))), 1e-12)
    scene = Scene(6.4, 3.6, -0.7, 0.0, "A ball that bounces")
    scene.add(ground(-0.45))
    scene.add(box(2.4, 0.16, (0.0, scale * moves - 0.16), look="sole", contact="plate"))
    scene.add(disc(0.3, (0.0, scale * values["y"] + 0.3)))
    return scene


def falling_rod(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """Painlevé's rod."""
    half = motion.parameters["l"]
    x, y, theta = values["x"], values["y"], values["theta"]
    along = (half * np.cos(theta), half * np.sin(theta))
    scene = on_ground(7.0 * half, 3.4 * half, -0.6 * half, x, "A rod that slides on a rough floor")
    scene.add(rod((x - along[0], y - along[1]), (x + along[0], y + along[1]), "leg light"))
    scene.add(disc(0.08 * half, (x, y), look="dark"))
    scene.add(disc(0.07 * half, (x - along[0], y - along[1]), look="sole", contact="tip"))
    return scene


def pendulum_on_cart(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """A pendulum on a cart."""
    length = 1.3
    scale = length / motion.parameters["l"]
    x, phi = scale * values["x"], values["phi"]
    end = (x + length * np.sin(phi), 1.7 - length * np.cos(phi))
    scene = on_ground(9.0, 4.2, -0.8, x, "A pendulum on a cart")
    scene.add(rod((x, 0.5), (x, 1.7), "wall"))
    scene.add(*block(1.7, 0.5, x, "track"))
    scene.add(rod((x, 1.7), end), disc(0.17, end), disc(0.07, (x, 1.7), look="dark"))
    return scene


def _counted(motion: Trajectory, times: Array) -> Array:
    """Number of jumps so far."""
    if not motion.system.jumps:
        raise KeyError("jumps")
    return np.searchsorted(motion.jumps["time"].to_numpy(float), times, side="right").astype(float)


def _impacts(motion: Trajectory, times: Array, theta: Array) -> tuple[Array, Array]:
    """Displacement of the feet by leg exchanges: the sum of 2 sin θ before each impact."""
    at = motion.jumps["time"].to_numpy(float)
    if len(at) == 0:
        return np.zeros_like(times), np.zeros_like(times)
    # on the right side of each impact, where it is minus the previous θ
    after = motion.at(at)["theta"]
    ways = np.concatenate([[0.0], np.cumsum(2.0 * np.sin(after))])
    return np.zeros_like(times), -ways[np.searchsorted(at, times, side="right")]
