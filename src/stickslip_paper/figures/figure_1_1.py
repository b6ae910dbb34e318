"""Figure 1.1 of [M]: two machines that wait until friction is small."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry
from stickslip_paper.drawing.parts import by_mode, modes
from stickslip_paper.drawing.sketch import (
    BODY_EDGE,
    angle_arc,
    body,
    box,
    canvas,
    dimension,
    disc,
    ground,
    rounded,
    spring,
    turned,
)
from stickslip_paper.drawing.style import arrow, heads


def draw() -> Figure:
    """(A) the plate compactor, (B) the toy ramp walker, with the variables of their models, and a
    computed motion of such a toy."""
    with ss.style.paper_style():
        figure = ss.style.new_figure(12.0, 3.9)
        left, middle, *traces = figure.subplot_mosaic(
            [["A", "B", "angle"], ["A", "B", "ways"], ["A", "B", "forces"]],
            width_ratios=[1.0, 1.0, 0.95],
            height_ratios=[1.0, 1.7, 1.3],
        ).values()
        plate_compactor(left)
        ramp_walker(middle)
        walking(*traces)
        left.set_title("(A)")
        middle.set_title("(B)")
        traces[0].set_title("a toy like (B), computed")
    return figure


def walking(angle: Axes, ways: Axes, forces: Axes) -> None:
    """Two periods of settled walking: rocking angle, feet and normal forces."""
    toy = ss.catalogue.ramp_walker()
    settled = ss.simulate(toy, (0.0, 100.0))
    t = np.linspace(0.0, 2 * ss.find_cycle(toy, settled).period, 3001)
    motion = ss.simulate(toy, (0.0, t[-1]), initial=settled.final).at(t)
    angle.plot(t, motion["psi"], color=ss.style.GREEN)
    for name, foot, line in (("R", "right_foot", "-"), ("L", "left_foot", "--")):
        way = 100.0 * (motion[f"x_{name}"] - settled.final["x_R"])
        by_mode(ways, t, way, motion[f"mode_{foot}"])
        ways.text(
            1.01 * t[-1], way[-1], f"$x_{name}$", va="bottom" if name == "R" else "top", fontsize=12
        )
        force = motion[f"normal_{foot}"]
        forces.plot(t, force, line, color=ss.style.BLUE, lw=1.4, label=f"$N_{name}$")
    angle.set_ylabel(r"$\psi$  [rad]", fontsize=11)
    ways.set_ylabel("$x_R$, $x_L$  [cm]", fontsize=11)
    forces.set_ylabel("$N_R$, $N_L$  [N]", fontsize=11)
    forces.set_xlabel("time $t$  [s]", fontsize=11)
    for axes in (angle, ways, forces):
        axes.set_xlim(0.0, t[-1])
        axes.tick_params(labelbottom=axes is forces, labelsize=10)
    ss.style.legend_above(ways, modes("stick", "slip", "lifted"))
    ss.style.legend_above(forces)


def plate_compactor(axes: Axes) -> None:
    """Plate, imbalance, pulling spring, and the forces between plate and ground."""
    canvas(axes, (-0.6, 6.4), (-1.0, 3.3))
    ground(axes, (-0.5, 0.0), (6.3, 0.0))
    body(
        axes,
        np.array([(0.9, 0.45), (1.15, 0.05), (3.65, 0.05), (3.9, 0.45), (3.65, 0.3), (1.15, 0.3)]),
    )
    box(axes, (1.5, 0.3), (1.8, 1.5))
    centre = np.array((2.4, 1.05))
    mass = np.array((2.4, 1.05)) + 0.42 * np.array([np.cos(0.6), np.sin(0.6)])
    disc(axes, (2.4, 1.05), 0.6)
    axes.plot(*np.array([centre, mass]).T, color=ss.style.STICK_LINE, lw=1.4, zorder=5)
    axes.plot([2.4, 2.4], [1.05, 0.45], ":", color=ss.style.STICK_LINE, lw=0.9, zorder=5)
    disc(axes, mass, 0.13, ss.style.STICK_LINE, zorder=6)
    disc(axes, (2.4, 1.05), 0.05, ss.style.STICK_LINE, zorder=6)
    angle_arc(axes, (2.4, 1.05), 0.3, -90, 34)
    axes.text(3.4, 0.9, r"$\Omega t$", fontsize=13, va="center")
    axes.plot([2.68, 3.38], [0.88, 0.9], color=ss.style.STICK_LINE, lw=0.6, zorder=6)
    spring(axes, (3.8, 0.38), (5.6, 0.38))
    disc(axes, (5.6, 0.38), 0.07, ss.style.STICK_LINE)
    arrow(axes, (5.6, 0.38), (6.25, 0.38), ss.style.STICK_LINE)
    axes.text(5.6, 0.62, r"$\ell(t)$", ha="center", fontsize=13)
    axes.text(4.7, 0.62, "$k$", ha="center", fontsize=13)
    arrow(axes, (2.4, 3.1), (2.4, 1.95), ss.style.VERMILION)
    axes.text(2.55, 2.75, r"$N(t) = mg + F\cos\Omega t$", color=ss.style.VERMILION, fontsize=13)
    arrow(axes, (0.95, 0.22), (0.05, 0.22), ss.style.BLUE)
    axes.text(
        2.65,
        -0.45,
        r"friction $\leq \rho(t/\varepsilon) = \mu N(t)$",
        color=ss.style.BLUE,
        va="center",
        fontsize=12,
    )
    dimension(axes, (-0.5, -0.5), (2.35, -0.5), "$z(t)$", (0.0, -0.26))
    axes.plot([2.35, 2.35], [-0.65, -0.05], color=ss.style.STICK_LINE, lw=0.9)


def ramp_walker(axes: Axes) -> None:
    """A frog on a ramp: its downhill leg is part of the body, its uphill leg hangs in a hinge."""
    canvas(axes, (-0.2, 6.8), (-1.0, 3.3))
    slope = -14.0

    def place(*points: tuple[float, float]) -> np.ndarray:
        """From coordinates along and across the ramp."""
        return turned(np.array(points), np.radians(slope), to=(0.2, 1.45))

    def text(s: float, n: float, words: str, colour: str = ss.style.STICK_LINE) -> None:
        x, y = place((s, n))[0]
        axes.text(x, y, words, color=colour, ha="center", va="center", fontsize=12)

    ground(axes, place((0.0, 0.0))[0], place((6.4, 0.0))[0])
    uphill = (1.9, 0.0)
    hinge = (2.45, 1.1)
    downhill = (4.1, 0.0)
    back = [
        (2.3, 0.95),
        (1.75, 1.15),
        (1.85, 1.5),
        (2.4, 1.85),
        (3.2, 2.05),
        (3.8, 2.2),
        (4.4, 2.0),
        (4.75, 1.55),
    ]
    front = [
        (4.5, 1.2),
        (4.25, 0.9),
        (4.25, 0.25),
        (4.75, 0.12),
        (4.75, 0.0),
        (3.75, 0.0),
        (3.75, 0.6),
        (3.3, 0.85),
    ]
    body(axes, rounded(place(*back, *front)))
    disc(axes, place((3.95, 2.12))[0], 0.19)
    disc(axes, place((4.02, 2.12))[0], 0.07, ss.style.STICK_LINE, zorder=5)
    leg = [
        (2.25, 1.2),
        (2.65, 1.2),
        (2.65, 0.95),
        (2.1, 0.15),
        (2.5, 0.1),
        (2.5, 0.0),
        (1.6, 0.0),
        (1.7, 0.3),
    ]
    body(axes, rounded(place(*leg)), "white", zorder=3)
    disc(axes, place(hinge)[0], 0.09)
    centre = place((3.25, 1.35))[0]
    disc(axes, centre, 0.05, ss.style.STICK_LINE)
    arrow(axes, centre, (centre[0], centre[1] - 0.85), ss.style.VERMILION)
    axes.text(centre[0] + 0.12, centre[1] - 0.8, "$mg$", color=ss.style.VERMILION, fontsize=12)
    turn = np.radians(np.linspace(52.0, 80.0, 30))
    arc = place(downhill)[0][:, None] + 2.75 * np.array([np.cos(turn), np.sin(turn)])
    axes.plot(arc[0], arc[1], color=ss.style.GREEN, lw=1.4)
    for x, y in (arc, arc[:, ::-1]):
        heads(axes, x, y, (0.97,), ss.style.GREEN)
    axes.text(arc[0, 10] + 0.12, arc[1, 10] + 0.12, r"$\psi$", color=ss.style.GREEN, fontsize=13)
    text(0.85, 0.75, "hinged leg", BODY_EDGE)
    text(5.45, 0.45, "rigid leg", BODY_EDGE)
    for foot, name in ((uphill, "$x_1$"), (downhill, "$x_2$")):
        axes.plot(*place(foot, (foot[0], -0.55)).T, color=ss.style.STICK_LINE, lw=0.9)
        text(foot[0], -0.78, name)
    dimension(axes, place((1.9, -0.4))[0], place((4.1, -0.4))[0], "$d$", (0.03, -0.2))


ENTRY = FigureEntry(
    "1.1",
    "Two machines that wait until friction is small",
    "(A) The plate compactor: an imbalance that turns with the angle Ωt shakes the normal force "
    "N(t), and with it the threshold ρ(t/ε) of the friction between plate and ground. Pulled by a "
    "spring k whose end is at ℓ(t), the plate at z(t) moves only when N is small; (1.1) and "
    "section 2. (B) The toy ramp walker walks down only while it rocks (angle ψ), which loads in "
    "turn the rigid downhill leg at x₂ and the hinged uphill leg at x₁. Right: computed motion of "
    "such a toy, two periods of settled walking of the catalogue's ramp_walker, whose springy legs "
    "stand side by side: rocking angle, ways of the feet along the ramp and normal forces. A foot "
    "slips when it has lost its load, is lifted, and holds again when the body leans on it. "
    "I_b = 5·10⁻⁴ kg m², m_b = 0.1 kg, m_l = 2 g, γ = 0.15, k = 100 N/m, d = 0.22 N s/m, "
    "l = 2.5 cm, h = 1 cm, a = 2 N/m, c = 0.25 N, μ = 0.3, restitution 0, δ = 3.3·10⁻⁴ N m s. "
    "In a period of 0.48535 s it advances 1.951 cm.",
    draw,
)
