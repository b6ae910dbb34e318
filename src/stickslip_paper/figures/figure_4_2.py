"""Figure 4.2 of [M]: where the distance of the toy's legs can be."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry
from stickslip_paper.drawing.style import arrow


def draw() -> Figure:
    """The stable intervals of both legs over ψ; d stays in their intersection."""
    toy = ss.catalogue.rocking_toy()
    operator = ss.HysteresisOperator.of(toy)
    psi = np.linspace(-2.2, 2.2, 441)
    with ss.style.paper_style():
        figure = ss.style.new_figure(7.2, 4.2)
        axes = figure.add_subplot(xlim=(-2.2, 2.2), ylim=(-3.1, 3.1))
        for contact, area, colour in (
            ("right leg", ss.style.SKY, ss.style.BLUE),
            ("left leg", ss.style.ORANGE, ss.style.VERMILION),
        ):
            low, high = operator.legs[contact]  # G_R⁻, G_R⁺ and G_L⁻, G_L⁺
            axes.fill_between(psi, low(psi), high(psi), color=area, alpha=0.28, lw=0)
            axes.plot(psi, low(psi), color=colour, lw=1.0)
            axes.plot(psi, high(psi), color=colour, lw=1.0)
        axes.plot(psi, operator.lower(psi), color=ss.style.STICK_LINE, lw=2.6, gid="G-")
        axes.plot(psi, operator.upper(psi), color=ss.style.STICK_LINE, lw=2.6, gid="G+")
        _name_the_parts(axes, operator, toy.values["psi_star"])
    return figure


def _name_the_parts(axes: Axes, operator: ss.HysteresisOperator, psi_star: float) -> None:
    """The corners (ψ*, −X) and (−ψ*, X), the names of the curves, and which way d moves on G^±."""
    X = operator.X
    axes.plot(
        [psi_star, -psi_star],
        [-X, X],
        "o",
        color="white",
        mec=ss.style.STICK_LINE,
        mew=1.6,
        ms=6.5,
        zorder=5,
    )
    axes.text(1.04, -0.22, r"$(\psi_*, -X)$", fontsize=12)
    axes.text(-1.04, 0.22, r"$(-\psi_*, X)$", ha="right", va="top", fontsize=12)
    for x, y, name, colour in (
        (-0.42, 2.35, "$G_R^+$", ss.style.BLUE),
        (1.62, -2.15, "$G_R^-$", ss.style.BLUE),
        (-1.62, 2.0, "$G_L^+$", ss.style.VERMILION),
        (0.42, -2.6, "$G_L^-$", ss.style.VERMILION),
    ):
        axes.text(x, y, name, color=colour, ha="center", fontsize=13)
    axes.text(0.0, 0.0, r"$\dot d = 0$", ha="center", va="center", fontsize=12)
    for side, sense in ((1, r"$\dot d \leq 0$ on $G^+$"), (-1, r"$\dot d \geq 0$ on $G^-$")):
        axes.text(side * 0.62, side * 0.72, sense, ha="center", va="center", fontsize=12)
        for psi in (0.25, 0.55, 1.8):
            high = float(operator.upper(psi))
            arrow(
                axes,
                (side * psi, side * high),
                (side * psi, side * (high - 0.24)),
                ss.style.STICK_LINE,
                width=1.1,
                head=9,
            )
    axes.set_xlabel(r"rocking angle $\psi$  [rad]")
    axes.set_ylabel("distance of the legs $d = x_R - x_L$  [m]")


ENTRY = FigureEntry(
    "4.2",
    "Where the distance of the legs can be",
    "The sets [G_R⁻, G_R⁺] (blue) and [G_L⁻, G_L⁺] (orange) of section 4.3 over the rocking angle "
    "ψ, from (4.2b) and (4.2c): aG_R^± = P + cψ ± (ρ + H_R(ψ)), aG_L^± = −P + cψ ± (ρ + H_L(ψ)). "
    "The distance d = x_R − x_L stays in their intersection, between G⁻ and G⁺ (bold); d can only "
    "fall on G⁺, only rise on G⁻, and rests in between. G⁺ has its local minimum at (ψ*, −X), G⁻ "
    "its local maximum at (−ψ*, X), X = (P − ρ − cψ*)/a = 0.5 m. Parameters: P = 1 N, ρ = 0.2 N, "
    "a = 1 N/m, c = 0.3 N, ψ* = 1, H* = 3 N (so that H* > 2P and H* > 2cψ*).",
    draw,
)
