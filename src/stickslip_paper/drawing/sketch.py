"""Parts of schematic drawings and of animations: ground, springs, wheels, bodies and dimensions."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Arc, Circle, FancyBboxPatch, Polygon

import stickslip as ss
from stickslip_paper.drawing.style import Array, Point, arrow, pair

BODY = "#D9E6F2"
BODY_EDGE = "#33526B"


def turned(points: Array, angle: float, about: Point = (0.0, 0.0), to: Point = (0.0, 0.0)) -> Array:
    """Points turned by an angle [rad] about one of them, which is then moved to `to`."""
    c, s = np.cos(angle), np.sin(angle)
    return (np.asarray(points, dtype=float) - about) @ np.array([[c, s], [-s, c]]) + to


def rounded(points: Array, times: int = 4) -> Array:
    """The closed outline with its corners cut, again and again (Chaikin)."""
    for _ in range(times):
        after = np.roll(points, -1, axis=0)
        points = np.stack(
            [0.75 * points + 0.25 * after, 0.25 * points + 0.75 * after], axis=1
        ).reshape(-1, 2)
    return points


def canvas(axes: Axes, xlim: Point, ylim: Point) -> None:
    """Axes to draw on, without frame, the same scale in both directions."""
    axes.set_xlim(pair(xlim))
    axes.set_ylim(pair(ylim))
    axes.set_aspect("equal")
    axes.set_axis_off()


def ground(axes: Axes, start: Point, end: Point, depth: float = 0.16, spacing: float = 0.2) -> None:
    """A line with hatching on its right-hand side."""
    a, b = np.array(start), np.array(end)
    along = (b - a) / np.linalg.norm(b - a)
    across = np.array([along[1], -along[0]])
    axes.plot(*np.array([a, b]).T, color=ss.style.STICK_LINE, lw=1.4, solid_capstyle="butt")
    for s in np.arange(spacing, np.linalg.norm(b - a) + 1e-9, spacing):
        axes.plot(
            *np.array([a + s * along, a + (s - depth) * along + depth * across]).T,
            color=ss.style.STICK_LINE,
            lw=0.7,
        )


def spring_line(start: Point, end: Point, width: float, coils: int = 7) -> Array:
    """A zigzag from one point to the other, shape (2, n)."""
    a, b = np.array(start), np.array(end)
    across = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
    s = np.concatenate([[0.0, 0.15], np.linspace(0.15, 0.85, 2 * coils + 1)[1:-1], [0.85, 1.0]])
    side = np.concatenate([[0.0, 0.0], np.resize([1.0, -1.0], 2 * coils - 1), [0.0, 0.0]])
    return (a + s[:, None] * (b - a) + 0.5 * width * side[:, None] * across).T


def spring(axes: Axes, start: Point, end: Point, width: float = 0.22, coils: int = 7) -> Line2D:
    """A spring between two points."""
    return axes.plot(*spring_line(start, end, width, coils), color=ss.style.STICK_LINE, lw=1.2)[0]


def box(axes: Axes, corner: Point, size: Point, face: str = BODY, rounding: float = 0.08) -> None:
    """A box with rounded corners."""
    style = f"round,pad=0,rounding_size={rounding}"
    axes.add_patch(
        FancyBboxPatch(
            pair(corner), *pair(size), boxstyle=style, fc=face, ec=BODY_EDGE, lw=1.2, zorder=2
        )
    )


def body(axes: Axes, points: Array, face: str = BODY, zorder: float = 2) -> None:
    """A filled outline."""
    axes.add_patch(
        Polygon(
            np.asarray(points),
            closed=True,
            fc=face,
            ec=BODY_EDGE,
            lw=1.2,
            joinstyle="round",
            zorder=zorder,
        )
    )


def disc(
    axes: Axes,
    centre: Point,
    radius: float,
    face: str = "white",
    edge: str = ss.style.STICK_LINE,
    zorder: float = 4,
) -> None:
    """A circle: a hinge, a wheel, an eye."""
    axes.add_patch(Circle(pair(centre), radius, fc=face, ec=edge, lw=1.1, zorder=zorder))


def angle_arc(
    axes: Axes,
    centre: Point,
    radius: float,
    start: float,
    end: float,
    colour: str = ss.style.STICK_LINE,
) -> None:
    """An arc between two directions [degrees]."""
    axes.add_patch(
        Arc(pair(centre), 2 * radius, 2 * radius, theta1=start, theta2=end, color=colour, lw=1.0)
    )


def dimension(
    axes: Axes, start: Point, end: Point, label: str, offset: Point = (0.0, -0.22)
) -> None:
    """A length with its name, as in a technical drawing."""
    arrow(axes, start, end, ss.style.STICK_LINE, width=0.9, head=8.0, tips="<|-|>")
    x, y = pair(0.5 * (np.array(start) + end) + offset)
    axes.text(x, y, label, ha="center", va="center", fontsize=13)
