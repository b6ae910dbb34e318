"""Figure 4.4 of [M]: the toy animal starts to walk."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry


def draw() -> Figure:
    """(ψ, ψ̇) spirals towards the limit cycle from both sides; ψ, x_R and x_L of the motion from
    inside."""
    toy = ss.catalogue.rocking_toy()
    inside = ss.simulate(toy, (0.0, 1000.0), initial={"psi": 0.8, "x_R": -0.8})
    outside = ss.simulate(toy, (0.0, 60.0), initial={"psi": 3.0, "x_R": 0.0})
    cycle = ss.simulate(toy, (0.0, 6.0), initial=inside.final)
    with ss.style.paper_style():
        figure = ss.style.new_figure(8.6, 4.0)
        plane, angle, legs = figure.subplot_mosaic(
            [["plane", "angle"], ["plane", "legs"]], width_ratios=[1.0, 1.15]
        ).values()
        for motion, end, colour, width, label in (
            (outside, 60.0, ss.style.SKY, 0.9, "outside"),
            (inside, 60.0, ss.style.GREEN, 0.9, "inside"),
            (cycle, 6.0, ss.style.STICK_LINE, 2.4, "limit cycle"),
        ):
            path = motion.at(np.linspace(0.0, end, 6001))
            plane.plot(path["psi"], path["d_psi"], color=colour, lw=width, label=label)
        t = np.linspace(0.0, 40.0, 4001)
        start = inside.at(t)
        angle.plot(t, start["psi"], color=ss.style.GREEN)
        legs.plot(t, start["x_R"], color=ss.style.BLUE, label="right leg, $x_R$")
        legs.plot(t, start["x_L"], color=ss.style.VERMILION, label="left leg, $x_L$")
        _label(plane, angle, legs)
    return figure


def _label(plane: Axes, angle: Axes, legs: Axes) -> None:
    """Axes with units, and legends."""
    plane.set_xlabel(r"rocking angle $\psi$  [rad]")
    plane.set_ylabel(r"$\dot\psi$  [rad/s]")
    plane.set_box_aspect(1)
    ss.style.legend_above(plane)
    angle.set_ylabel(r"$\psi$  [rad]")
    angle.tick_params(labelbottom=False)
    legs.set_ylabel("$x_R$, $x_L$  [m]")
    legs.set_xlabel("time $t$  [s]")
    ss.style.legend_above(legs)
    for axes in (angle, legs):
        axes.set_xlim(0.0, 40.0)


ENTRY = FigureEntry(
    "4.4",
    "The toy animal starts to walk",
    "Simulation of the simplified system (4.2). Left: (ψ, ψ̇) spirals towards the stable limit "
    "cycle, from ψ = 0.8, x_R = −0.8 m (inside) and from ψ = 3, x_R = 0 (outside), t ≤ 60 s. "
    "Right: ψ, x_R and x_L of the motion from inside; the legs step alternately, and are "
    "periodic up to the translation vt. The limit cycle has the period 5.969 s, the amplitude "
    "1.624 and the speed v = 2X/T = 0.1675 m/s. [M] leaves the parameters open; here I_b = 1 kg "
    "m², a = 1 N/m, b = 1 N m, c = 0.3 N, δ = 0.04 N m s, P = 1 N, ρ = 0.2 N, ψ* = 1, H* = 3 N.",
    draw,
)
