"""Common parts of all scenes: moving parts, and colours of stick, slip and open contacts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from numpy import ndarray as Array

import stickslip as ss
from stickslip_paper.drawing.sketch import BODY, BODY_EDGE

STICK = ss.style.STICK_LINE
SLIP = ss.style.VERMILION
OPEN = ss.style.SKY
_OPEN = 2  # the mode of a contact that is open


@dataclass(frozen=True)
class Scene:
    """A figure with moving parts, which are drawn in their order on top of the rest."""

    figure: Figure
    moving: Sequence[Artist]
    place: Callable[[int], None]
    frames: int


def modes(stick: str = "stick", slip: str = "slip", opened: str = "") -> list[Line2D]:
    """Handles of a legend for the colours of the modes; the last one only if it has a name."""
    named = ((STICK, stick), (SLIP, slip), (OPEN, opened))
    return [Line2D([], [], color=colour, lw=2.5, label=name) for colour, name in named if name]


def part(axes: Axes, points: Array, face: str = BODY, width: float = 1.2) -> Polygon:
    """A part that moves."""
    patch = Polygon(points, fc=face, ec=BODY_EDGE, lw=width)
    axes.add_patch(patch)
    return patch


def moving_disc(axes: Axes, centre: tuple[float, float], radius: float, face: str) -> Circle:
    """A disc that moves."""
    disc = Circle(centre, radius, fc=face, ec=STICK, lw=1.2)
    axes.add_patch(disc)
    return disc


def moving_line(axes: Axes, width: float = 1.2, colour: str = STICK) -> Line2D:
    """A line that moves."""
    return axes.plot([], [], color=colour, lw=width)[0]


def by_mode(axes: Axes, t: Array, values: Array, mode: Array) -> None:
    """A trace, black in stick, red in slip and light blue where the contact is open."""
    axes.plot(t, values, color=STICK, lw=1.6)
    free = mode == _OPEN
    for holds, colour in ((free, OPEN), ((mode != 0) & ~free, SLIP)):
        shown = holds | np.append(holds[1:], False)  # and the previous span
        axes.plot(t, np.where(shown, values, np.nan), color=colour, lw=2.6)


def shoe(patch: Polygon, outline: Array, mode: int) -> None:
    """A foot: black in stick, red in slip, hollow where it is lifted."""
    patch.set_xy(outline)
    mark(patch, mode)


def mark(patch: Polygon | Circle, mode: int) -> None:
    """The colour of a contact's mode; one that is open is hollow."""
    free = mode == _OPEN
    patch.set_facecolor("white" if free else SLIP if mode else STICK)
    patch.set_edgecolor(STICK)
    patch.set_linewidth(1.2 if free else 0.0)
