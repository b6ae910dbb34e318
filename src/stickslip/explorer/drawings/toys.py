"""Animations of toys: the animal pulled by a weight, the walker on a ramp, the woodpecker."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.explorer.drawings.parts import (
    Course,
    MovingPart,
    Scene,
    Spot,
    arrow,
    box,
    disc,
    on_ground,
    path,
    polygon,
    rod,
)

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_TRUNK = (
    (-1.45, 1.0), (-1.55, 1.5), (-1.38, 1.86), (-0.9, 2.0), (0.6, 2.0), (1.0, 2.32), (1.35, 2.56),
    (1.78, 2.5), (2.0, 2.26), (1.98, 2.04), (1.6, 1.98), (1.35, 1.7), (1.25, 1.2), (1.05, 1.0),
)  # fmt: skip
_SOLE = ((-0.2, 0.0), (0.34, 0.0), (0.34, 0.1), (0.12, 0.2), (-0.17, 0.2))
_BEHIND = ((-0.7, 0.95), (-0.72, 1.9), (-0.35, 2.2), (0.35, 2.2), (0.72, 1.9), (0.7, 0.95))
_HIPS = (-0.85, 0.8)


def walking_toy(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """The animal from the side, feet coloured by stick and slip, and from behind, where its rocking
    is seen."""
    psi = values["psi"]
    still = np.zeros_like(psi)
    feet = {side: values.get(f"x_{side}", still) for side in "LR"}
    contacts = {"R": "right_leg", "L": "left_leg"}
    middle = (feet["R"] + feet["L"]) / 2.0
    scene = on_ground(
        8.6, 3.7, -0.62, middle + 1.35, "A toy animal that rocks and walks to the right"
    )
    for side, look in (("L", "shade"), ("R", "light")):
        if side == "R":
            scene.add(polygon(_TRUNK, (middle, 0.0), look="body", smooth=True))
            scene.add(path(((-1.45, 1.75), (-1.75, 1.5), (-1.8, 1.1)), (middle, 0.0)))
            scene.add(disc(0.06, (middle + 1.66, 2.28), look="dark"))
        for hip in _HIPS:
            scene.add(*_leg(middle + hip, feet[side] + hip, _lift(psi, side), look, contacts[side]))
    if "P" in motion.parameters:
        _pull(scene, middle)
    _from_behind(scene, middle + 4.25, psi, contacts)
    return scene


def _lift(psi: Array, side: str) -> Array:
    """Height of a foot in the drawing; the model has none."""
    return 0.14 * np.clip(-psi if side == "R" else psi, 0.0, 1.5)


def _leg(hip: Course, foot: Course, lift: Course, look: str, contact: str) -> list[MovingPart]:
    return [
        rod((hip, 1.12), (foot, lift + 0.12), f"leg {look}"),
        polygon(_SOLE, (foot, lift), look="sole", contact=contact),
    ]


def _pull(scene: Scene, middle: Array) -> None:
    """The thread that pulls."""
    scene.add(rod((middle + 1.3, 1.5), (middle + 2.5, 1.5), "thread"))
    scene.add(arrow((middle + 2.0, 1.5), (middle + 2.95, 1.5)))


def _from_behind(scene: Scene, x: Array, psi: Array, contacts: Mapping[str, str]) -> None:
    """The toy from behind, tilted about the stance foot."""
    carries = np.where(psi > 0.0, 0.4, -0.4)
    tilt = -0.1 * psi

    def turned(dx: float, dy: float = 0.0) -> Spot:
        return (
            x + carries + np.cos(tilt) * (dx - carries) - np.sin(tilt) * dy,
            np.sin(tilt) * (dx - carries) + np.cos(tilt) * dy,
        )

    for side, at in (("L", -0.4), ("R", 0.4)):
        look = "shade" if side == "L" else "light"
        scene.add(rod(turned(at, 1.1), turned(at, 0.12), f"leg {look}"))
        sole = ((-0.17, 0.0), (0.17, 0.0), (0.17, 0.18), (-0.17, 0.18))
        scene.add(polygon(sole, turned(at), tilt, "sole", contacts[side]))
    scene.add(polygon(_BEHIND, turned(0.0), tilt, "body", smooth=True))
    scene.add(path(((0.0, 1.0), (0.0, 2.1)), turned(0.0), tilt, "axis"))


def ramp_toy(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """The walker on a ramp from the side, in the frame of the ramp, and from behind."""
    stride = max(float(np.ptp(values["x_R"] - values["x_L"])), 1e-12)
    scale = 0.9 / stride
    lift = 0.22 / max(float(np.ptp(values["z_R"])), 1e-12)
    feet = {side: scale * values[f"x_{side}"] for side in "LR"}
    middle = (feet["R"] + feet["L"]) / 2.0
    keys = {"R": "right_foot", "L": "left_foot"}
    scene = on_ground(8.6, 3.7, -0.62, middle + 1.35, "A toy that rocks and walks down a ramp")
    for side, look in (("L", "shade"), ("R", "light")):
        if side == "R":
            scene.add(polygon(_TRUNK, (middle, 0.0), look="body", smooth=True))
            scene.add(disc(0.06, (middle + 1.66, 2.28), look="dark"))
        up = lift * values[f"z_{side}"]
        for hip in _HIPS:
            scene.add(*_leg(middle + hip, feet[side] + hip, up, look, keys[side]))
    _from_behind(scene, middle + 4.25, 4.0 * values["psi"], keys)
    return scene


def woodpecker_toy(motion: Trajectory, times: Array, values: Mapping[str, Array]) -> Scene:
    """A pole, a sleeve on it, a spring, and the bird."""
    drop = 14.0 * (values["y"] - values["y"][0])
    sleeve, bird = -2.0 * values["phi_M"], values["phi_S"]
    scene = Scene(6.0, 4.4, -2.2, 0.6, "A woodpecker that pecks its way down a pole")
    # The drawing moves down with the bird; the marks on the pole move up.
    turn = drop % 0.8
    scene.add(box(0.22, 9.0, (0.0, -4.5), look="light"))
    for i in range(-6, 7):
        scene.add(rod((-0.11, 0.8 * i - turn), (0.11, 0.8 * i - turn - 0.1), "axis"))
    ring = ((-0.24, -0.34), (0.24, -0.34), (0.24, 0.34), (-0.24, 0.34))
    scene.add(polygon(ring, (0.0, 0.0), -sleeve / 2.0, "sole", "lower_edge"))
    root = (0.24, 0.0)
    at = (root[0] + 1.05 * np.cos(bird), root[1] + 1.05 * np.sin(bird))
    scene.add(rod(root, at, "spring"))
    body = ((-0.28, -0.75), (0.1, -1.05), (0.38, -0.3), (0.36, 0.35), (0.0, 0.72), (-0.3, 0.45))
    scene.add(polygon(body, at, bird, "body", smooth=True))
    head = ((-0.85, 0.78), (-0.2, 0.6), (0.14, 0.72), (0.1, 1.04), (-0.22, 1.1), (-0.36, 0.92))
    scene.add(polygon(head, at, bird, "body"))
    return scene
