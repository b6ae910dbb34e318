"""Figure 4.3 of [M]: the hysteresis of the legs in simple motions."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry
from stickslip_paper.drawing.style import heads, ticks


def draw() -> Figure:
    """Γ(ψ) for ψ̇ > 0 and −Γ(−ψ) for ψ̇ < 0, with one period of (4.2) on them."""
    toy = ss.catalogue.rocking_toy()
    operator = ss.HysteresisOperator.of(toy)
    X, end = operator.X, operator.psi_2
    settled = ss.simulate(toy, (0.0, 1000.0), initial={"psi": -1.67, "x_R": 0.5}).final
    walk = ss.simulate(toy, (0.0, 6.0), initial=settled).at(np.linspace(0.0, 5.97, 80))
    with ss.style.paper_style():
        figure = ss.style.new_figure(7.2, 3.8)
        axes = figure.add_subplot(xlim=(-end, end), ylim=(-1.7, 1.7))
        psi = np.linspace(-end, end, 701)
        axes.plot(psi, operator.upper(psi), color=ss.style.THRESHOLD, lw=1.0, label=r"$G^{\pm}$")
        axes.plot(psi, operator.lower(psi), color=ss.style.THRESHOLD, lw=1.0)
        for start, d, colour, dashes, label in (
            (-end, X, ss.style.BLUE, "-", r"$\Gamma(\psi)$, for $\dot\psi > 0$"),
            (end, -X, ss.style.VERMILION, (0, (3, 1.5)), r"$-\Gamma(-\psi)$, for $\dot\psi < 0$"),
        ):
            branch = operator.path([start, -start], initial=d)
            axes.plot(*branch, color=colour, lw=2.8, ls=dashes, label=label)
            heads(axes, *branch, (0.4, 0.56), colour, 17)
        axes.plot(
            walk["psi"],
            walk["x_R"] - walk["x_L"],
            ".",
            color=ss.style.STICK_LINE,
            ms=5,
            label="motion of (4.2)",
        )
        _name_the_ticks(axes, operator, toy.values["psi_star"])
    return figure


def _name_the_ticks(axes: Axes, operator: ss.HysteresisOperator, psi_star: float) -> None:
    """Label the corners of the branches: ±ψ_2, ±ψ* and ±ψ_3 on one axis, ±X on the other."""
    X, psi_3 = operator.X, operator.psi_3
    angles = ((operator.psi_2, r"\psi_2"), (psi_star, r"\psi_*"), (psi_3, r"\psi_3"))
    ticks(
        axes,
        [
            (sign * value, f"${'-' if sign < 0 else ''}{name}$")
            for value, name in angles
            for sign in (-1, 1)
        ],
        [(-X, "$-X$"), (0.0, "0"), (X, "$X$")],
    )
    for value, _ in angles[1:]:
        for sign in (-1, 1):
            axes.plot(
                [sign * value] * 2,
                [-1.7, sign * X * (1 if value == psi_3 else -1)],
                ":",
                color=ss.style.STICK_LINE,
                lw=0.8,
            )
    axes.set_xlabel(r"rocking angle $\psi$")
    axes.set_ylabel("distance of the legs $d$")
    ss.style.legend_above(axes)


ENTRY = FigureEntry(
    "4.3",
    "The hysteresis of the legs in simple motions",
    "The two branches of d = 𝐆(ψ, ψ̇) of section 4.4 for |ψ| ≤ ψ₂: Γ(ψ) while ψ rises, −Γ(−ψ) "
    "while it falls. As ψ rises, d rests at X until it meets G⁺ at ψ₃, follows G_L⁺ down to −X at "
    "ψ*, and rests again. Dots: one period of walking, simulated with (4.2). The area 2X(ψ₃ + ψ*) "
    "of the loop, times c, is the energy that one period feeds into the rocking. Parameters as in "
    "figure 4.2: ψ* = 1, ψ₂ = ψ* + 2ρ/c = 2.333, ψ₃ = 0.1667 from G_L⁺(ψ₃) = X, X = 0.5 m.",
    draw,
)
