"""The parts of an animation: shapes, and their positions during a motion.

A position is a number, or one for each time. The page only positions each kind of part; the meaning
of a part is defined here. Lengths are those of the drawing, and y increases upwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stickslip.arrays import Array

Course = float | Array
"""A number, or one for each time of the motion."""
Spot = tuple[Course, Course]
_SOLE = 0.12  # height of the sole of a block


@dataclass(frozen=True)
class MovingPart:
    """Something that moves.

    Attributes
    ----------
    shape : dict
        What it looks like; its ``kind`` is known to the page.
    values : dict of str to Course
        Where it is.
    look : str
        A class of the style sheet: ``body``, ``light``, ``dark``, ``line``, ``spring``, ``ground``.
    contact : str
        The contact whose stick and slip it shows by its colour.
    """

    shape: dict[str, Any]
    values: dict[str, Course]
    look: str = "body"
    contact: str = ""


@dataclass
class Scene:
    """An animation.

    Attributes
    ----------
    width, height : float
        Size of the visible part of the plane.
    bottom : float
        Lower end of the visible part.
    follow : Course
        Horizontal position of the centre.
    about : str
        Text alternative of the animation.
    """

    width: float
    height: float
    bottom: float = 0.0
    follow: Course = 0.0
    about: str = ""
    parts: list[MovingPart] = field(default_factory=list)

    def add(self, *parts: MovingPart) -> None:
        """Add parts in front of the existing ones."""
        self.parts.extend(parts)

    def packed(self) -> tuple[dict[str, Any], dict[str, Array]]:
        """The same as plain data, and its arrays by name."""
        arrays: dict[str, Array] = {}
        names: dict[bytes, str] = {}

        def pack(value: Course) -> float | str:
            # Undefined positions are drawn at the centre; single precision is as exact as pixels.
            seen = np.ascontiguousarray(value, np.float32)
            if not np.all(np.isfinite(seen)):
                seen = np.nan_to_num(seen, posinf=0.0, neginf=0.0)
            if np.ndim(value) == 0:
                return float(seen.item())
            name = names.setdefault(seen.tobytes(), f"s:{len(names)}")
            arrays[name] = seen
            return name

        parts = [
            {
                **part.shape,
                "look": part.look,
                "contact": part.contact,
                "values": {name: pack(value) for name, value in part.values.items()},
            }
            for part in self.parts
        ]
        head = {
            "width": self.width,
            "height": self.height,
            "bottom": self.bottom,
            "follow": pack(self.follow),
            "about": self.about,
            "parts": parts,
        }
        return head, arrays


def on_ground(width: float, height: float, bottom: float, follow: Course, about: str) -> Scene:
    """An animation on level ground."""
    scene = Scene(width, height, bottom, follow, about)
    scene.add(ground())
    return scene


def polygon(
    points: Sequence[tuple[float, float]],
    at: Spot = (0.0, 0.0),
    turn: Course = 0.0,
    look: str = "body",
    contact: str = "",
    smooth: bool = False,
) -> MovingPart:
    """A closed shape that moves and turns about its origin (anticlockwise, in radians).

    Parameters
    ----------
    smooth : bool
        Whether a curve runs through the points.
    """
    corners = [[float(x), float(y)] for x, y in points]
    shape = {"kind": "polygon", "points": corners, "smooth": smooth}
    return MovingPart(shape, {"x": at[0], "y": at[1], "turn": turn}, look, contact)


def box(
    width: float,
    height: float,
    at: Spot,
    turn: Course = 0.0,
    look: str = "body",
    contact: str = "",
) -> MovingPart:
    """A block on its position.

    Parameters
    ----------
    at : Spot
        The middle of its lower side.
    """
    w = width / 2
    corners = ((-w, 0.0), (w, 0.0), (w, height), (-w, height))
    return polygon(corners, at, turn, look, contact)


def block(width: float, height: float, x: Course, contact: str) -> tuple[MovingPart, MovingPart]:
    """A block and the sole on which it stands."""
    sole = box(width, _SOLE, (x, 0.0), look="sole", contact=contact)
    return box(width, height, (x, _SOLE)), sole


def path(
    points: Sequence[tuple[float, float]],
    at: Spot = (0.0, 0.0),
    turn: Course = 0.0,
    look: str = "line",
) -> MovingPart:
    """An open line that moves and turns."""
    shape = {"kind": "path", "points": [[float(x), float(y)] for x, y in points]}
    return MovingPart(shape, {"x": at[0], "y": at[1], "turn": turn}, look)


def curve(points: Sequence[Spot]) -> MovingPart:
    """An open line whose points move independently."""
    values: dict[str, Course] = {}
    for i, (x, y) in enumerate(points):
        values |= {f"x{i}": x, f"y{i}": y}
    return MovingPart({"kind": "curve", "count": len(points)}, values, "bent")


def disc(
    radius: float,
    at: Spot,
    turn: Course = 0.0,
    look: str = "body",
    contact: str = "",
    spokes: int = 0,
) -> MovingPart:
    """A disc, with spokes to show its rotation."""
    shape = {"kind": "disc", "radius": float(radius), "spokes": spokes}
    return MovingPart(shape, {"x": at[0], "y": at[1], "turn": turn}, look, contact)


def rod(start: Spot, end: Spot, look: str = "line", contact: str = "") -> MovingPart:
    """A straight line between two places."""
    return MovingPart({"kind": "rod"}, _between(start, end), look, contact)


def spring(start: Spot, end: Spot, coils: int = 7, width: float = 0.16) -> MovingPart:
    """A spring between two places."""
    return MovingPart(
        {"kind": "spring", "coils": coils, "width": width}, _between(start, end), "spring"
    )


def arrow(start: Spot, end: Spot, look: str = "force") -> MovingPart:
    """An arrow from one place to another."""
    return MovingPart({"kind": "arrow"}, _between(start, end), look)


def ground(y: float = 0.0, shift: Course = 0.0, tilt: float = 0.0, contact: str = "") -> MovingPart:
    """The ground, with marks that show its motion.

    Parameters
    ----------
    shift : Course
        How far it has moved to the right: a belt.
    tilt : float
        Its slope, anticlockwise.
    """
    return MovingPart(
        {"kind": "ground", "tilt": float(tilt)}, {"x": shift, "y": y}, "ground", contact
    )


def label(text: str, at: Spot, look: str = "label") -> MovingPart:
    """A moving label."""
    return MovingPart({"kind": "label", "text": text}, {"x": at[0], "y": at[1]}, look)


def _between(start: Spot, end: Spot) -> dict[str, Course]:
    return {"x": start[0], "y": start[1], "x2": end[0], "y2": end[1]}
