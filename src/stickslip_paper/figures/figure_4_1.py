"""Figure 4.1 of [M]: the rocking toy animal."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry
from stickslip_paper.drawing.sketch import (
    BODY_EDGE,
    angle_arc,
    body,
    box,
    canvas,
    disc,
    ground,
    rounded,
    turned,
)
from stickslip_paper.drawing.style import Array, Point, arrow, heads

FAR = "#B4C6D6"


def draw() -> Figure:
    """From the side, from behind, and one leg under the hinge, with the variables of (4.1)."""
    with ss.style.paper_style():
        figure = ss.style.new_figure(10.2, 3.5)
        side, behind, hinge = figure.subplots(1, 3, width_ratios=[7.4, 3.6, 4.4])
        pulled_over_the_table(side)
        tilted(behind)
        over_the_contact_point(hinge)
    return figure


def leg(foot: Point, hip: Point, width: float = 0.26) -> Array:
    """Outline of a leg with a small foot that points to the right."""
    (x, y), (u, v) = foot, hip
    half = 0.5 * width
    top = [(u - half, v - half), (u - half, v + half), (u + half, v + half), (u + half, v - half)]
    toe = [(x + half, y + 0.3), (x + 2.2 * half, y + 0.1), (x + 2.2 * half, y)]
    heel = [(x - 1.2 * half, y), (x - half, y + 0.3)]
    return rounded(np.array(top + toe + heel), 3)


def trunk() -> Array:
    """Outline of the body with the head, from tail to breast 2.6 long."""
    back = [
        (1.0, 1.0),
        (0.95, 1.8),
        (1.5, 1.95),
        (2.9, 1.9),
        (3.3, 2.2),
        (3.55, 2.6),
        (4.05, 2.55),
        (4.55, 2.1),
    ]
    throat = [(4.5, 1.8), (4.1, 1.85), (3.7, 1.6), (3.55, 1.0), (2.3, 0.9)]
    return rounded(np.array(back + throat))


def pulled_over_the_table(axes: Axes) -> None:
    """The animal, the table and the weight."""
    canvas(axes, (-0.4, 7.0), (-1.75, 2.9))
    ground(axes, (-0.3, 0.0), (5.6, 0.0))
    axes.plot([5.6, 5.6], [0.0, -1.7], color=ss.style.STICK_LINE, lw=1.4)
    for hip in (1.5, 3.1):
        body(axes, leg((hip - 0.3, 0.0), (hip, 1.15)), FAR)
        body(axes, leg((hip + 0.3, 0.0), (hip, 1.15)), "white", zorder=3)
    body(axes, trunk(), zorder=2.5)
    body(axes, rounded(np.array([(3.45, 2.45), (3.2, 2.75), (3.35, 2.35)])), zorder=2.6)
    disc(axes, (3.98, 2.28), 0.06, ss.style.STICK_LINE)
    axes.plot([0.97, 0.75, 0.7], [1.75, 1.55, 1.1], color=BODY_EDGE, lw=1.6)
    axes.plot([3.6, 5.75], [1.2, 1.2], color=ss.style.STICK_LINE, lw=1.2)
    axes.plot([5.6, 5.75], [0.0, 0.98], color=ss.style.STICK_LINE, lw=1.4)
    disc(axes, (5.75, 0.98), 0.22)
    axes.plot([5.97, 5.97], [0.98, -0.7], color=ss.style.STICK_LINE, lw=1.2)
    box(axes, (5.65, -1.3), (0.64, 0.6))
    axes.text(6.42, -1.0, "$m_W$", va="center", fontsize=13)
    arrow(axes, (4.4, 1.2), (5.15, 1.2), ss.style.GREEN)
    axes.text(4.8, 1.42, "$g m_W$", color=ss.style.GREEN, ha="center", fontsize=13)
    for x, name, colour in ((2.8, "$x_L$", ss.style.VERMILION), (3.4, "$x_R$", ss.style.BLUE)):
        axes.plot([x, x], [-0.03, -0.42], color=colour, lw=1.0)
        axes.text(x, -0.65, name, color=colour, ha="center", va="center", fontsize=13)


def tilted(axes: Axes) -> None:
    """From behind: tilted by ψ > 0 it stands on the right leg."""
    canvas(axes, (-1.8, 1.8), (-1.75, 2.9))
    ground(axes, (-1.7, 0.0), (1.7, 0.0))
    angle = -np.radians(11.0)

    def place(*points: Point) -> Array:
        return turned(np.array(points), angle, about=(0.62, 0.0), to=(0.5, 0.0))

    for x in (-0.5, 0.5):
        body(
            axes,
            rounded(place((x - 0.14, 0.0), (x - 0.14, 1.2), (x + 0.14, 1.2), (x + 0.14, 0.0)), 2),
            "white",
        )
    body(
        axes,
        rounded(
            place((-0.75, 0.95), (-0.75, 2.1), (0.0, 2.35), (0.75, 2.1), (0.75, 0.95), (0.0, 0.8))
        ),
        zorder=3,
    )
    axes.plot(*place((0.0, 0.0), (0.0, 2.75)).T, "--", color=ss.style.STICK_LINE, lw=1.0, zorder=4)
    low = place((0.0, 0.0))[0]
    axes.plot([low[0]] * 2, [low[1], 2.8], ":", color=ss.style.STICK_LINE, lw=1.0, zorder=4)
    angle_arc(axes, low, 2.5, 79, 90)
    axes.text(low[0] + 0.27, 2.78, r"$\psi$", ha="center", fontsize=13)
    arrow(axes, (0.5, -1.05), (0.5, -0.22), ss.style.BLUE)
    arrow(axes, (-0.62, -0.5), (-0.62, -0.22), ss.style.VERMILION)
    axes.text(
        0.5, -1.32, r"$H_R(\psi)$", color=ss.style.BLUE, ha="center", va="center", fontsize=13
    )
    axes.text(
        -0.75, -0.8, r"$H_L(\psi)$", color=ss.style.VERMILION, ha="center", va="center", fontsize=13
    )


def over_the_contact_point(axes: Axes) -> None:
    """The hinge of the standing leg rises while it is pulled over the contact point."""
    canvas(axes, (-1.7, 2.3), (-1.75, 2.9))
    ground(axes, (-1.6, 0.0), (2.2, 0.0))
    directions = np.radians([122.0, 90.0, 58.0])
    hips = 1.7 * np.array([np.cos(directions), np.sin(directions)]).T
    for hip, face in zip(hips, ("white", "white", FAR), strict=True):
        body(axes, leg((0.0, 0.0), hip), face)
        disc(axes, hip, 0.08)
    arc = np.radians(np.linspace(140.0, 40.0, 60))
    axes.plot(
        1.7 * np.cos(arc), 1.7 * np.sin(arc), color=ss.style.GREEN, lw=1.3, ls=(0, (3, 2)), zorder=5
    )
    heads(axes, 1.7 * np.cos(arc), 1.7 * np.sin(arc), (0.3, 0.99), ss.style.GREEN)
    axes.axhline(hips[0, 1], color=ss.style.STICK_LINE, lw=0.7, ls=":")
    axes.text(0.0, 2.12, r"energy $\Phi(d, \psi)$", color=ss.style.GREEN, ha="center", fontsize=12)
    arrow(axes, hips[2] + (0.12, 0.0), hips[2] + (0.85, 0.0), ss.style.GREEN)
    axes.text(
        hips[2, 0] + 0.55, hips[2, 1] - 0.3, "$P$", color=ss.style.GREEN, ha="center", fontsize=13
    )
    axes.plot([0.0, 0.0], [-0.03, -0.42], color=ss.style.VERMILION, lw=1.0)
    axes.text(0.0, -0.65, "$x_L$", color=ss.style.VERMILION, ha="center", va="center", fontsize=13)


ENTRY = FigureEntry(
    "4.1",
    "The rocking toy animal",
    "Left: a weight m_W beyond the edge of the table pulls the animal; its two right legs at x_R "
    "(white) and its two left legs at x_L (dark) move together. Middle, from behind: tilted by ψ "
    "it stands on one side; the friction ρ + H_R(ψ) of the right legs is large, ρ + H_L(ψ) of the "
    "left legs, which are lifted, is small: these can swing forward. Right: the pull P = g m_W/2 "
    "on each leg moves the hinge of a standing leg over its contact point, which raises the energy "
    "Φ(d, ψ), d = x_R − x_L, a little. The variables are those of (4.1) and (4.2).",
    draw,
)
