"""Figure 3.2 of [M]: the Poincaré maps of the scaled slider."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry
from stickslip_paper.sections.scaling import ReturnMap, exact, lowest_order

B = 0.7


def draw() -> Figure:
    """Plot the maps at lowest order as lines, and those of (3.6) for two values of ν as dots."""
    maps = lowest_order(B)  # for μ₀v̂ = 1
    inner = np.linspace(0.0, 0.999, 201)
    outer = np.linspace(1.001, maps.slip(0.0).end, 201)
    with ss.style.paper_style():
        figure = ss.style.new_figure(7.2, 3.9)
        left, right = figure.subplots(1, 2)
        left.plot(inner, [maps.slip(gamma).end for gamma in inner], color=ss.style.BLUE)
        left.plot(outer, [maps.stick(gamma).end for gamma in outer], color=ss.style.VERMILION)
        right.plot(inner, [maps(gamma) for gamma in inner], color=ss.style.BLUE, gid="return map")
        _cobweb(right, maps, 0.93)
        for nu, full in ((1e-2, False), (1e-4, True)):
            of_3_6 = exact("(3.6)", nu, B)
            start = np.linspace(0.0, 0.8, 9)
            end = [of_3_6.slip(gamma).end for gamma in start]
            again = [of_3_6.stick(gamma).end for gamma in end]
            for axes, x, y, colour in (
                (left, start, end, ss.style.BLUE),
                (left, end, again, ss.style.VERMILION),
                (right, start, again, ss.style.BLUE),
            ):
                axes.plot(
                    x, y, "o", color=colour, mfc=colour if full else "white", ms=4.5, zorder=4
                )
        _name_the_parts(left, right, maps)
    return figure


def _cobweb(axes: Axes, maps: ReturnMap, gamma: float) -> None:
    """The iteration of the return map, and its fixed point."""
    points = [(gamma, 0.0)]
    for _ in range(12):
        after = maps(gamma)
        points += [(gamma, after), (after, after)]
        gamma = after
    fixed = maps.fixed_point().gamma
    axes.plot(*zip(*points, strict=True), color=ss.style.STICK_LINE, lw=0.8)
    axes.plot([0, 1], [0, 1], color=ss.style.STICK_LINE, lw=0.8, ls=(0, (4, 3)))
    axes.plot(fixed, fixed, "s", color=ss.style.VERMILION, ms=6, zorder=5, gid="fixed point")
    axes.text(fixed + 0.04, 0.02, rf"$\gamma_b = {fixed:.4f}$", color=ss.style.VERMILION)


def _name_the_parts(left: Axes, right: Axes, maps: ReturnMap) -> None:
    """Axes, the maps, and the halves A_1 and A_2."""
    top = maps.slip(0.0).end
    for across in (left.axvline, left.axhline):
        across(1.0, color=ss.style.STICK_LINE, lw=0.8, ls=":")
    left.set_xlim(0.0, top + 0.1)
    left.set_ylim(0.0, top + 0.1)
    left.text(1.05, 3.2, r"$\Phi^+: A_1 \to A_2$", color=ss.style.BLUE, fontsize=13)
    left.text(2.2, 0.55, r"$\Phi^-: A_2 \to A_1$", color=ss.style.VERMILION, fontsize=13)
    for middle, name in ((0.5, "$A_1$"), (0.5 + 0.5 * top, "$A_2$")):
        left.text(
            middle, 1.02, name, ha="center", transform=left.get_xaxis_transform(), fontsize=13
        )
    left.set_xlabel(r"state $\gamma$ at the start")
    left.set_ylabel(r"state $\gamma$ at the end")
    right.set_xlim(0.0, 1.0)
    right.set_ylim(0.0, 1.0)
    right.text(0.05, 0.62, r"$\Psi = \Phi^- \circ \Phi^+$", color=ss.style.BLUE, fontsize=13)
    right.set_xlabel(r"$\gamma$ as a slip starts")
    right.set_ylabel(r"$\gamma$ as the next one starts")


ENTRY = FigureEntry(
    "3.2",
    "Poincaré maps of the scaled slider",
    "The return maps of (3.6) on the axis β = 0, for μ₀v̂ = 1 and b = 0.7. Left: "
    "Φ⁺(γ) = μ₀v̂ + ρ_b(μ₀v̂ − γ) follows a slip, with the stretching ρ_b = exp(πb/(2ω_b)) = 3.23, "
    "and Φ⁻(γ) = γ exp(−𝒞(μ₀v̂/γ)) a stick, where 𝒞 is the inverse of T ↦ (1 − e^(−T))/T. Right: "
    "Ψ = Φ⁻∘Φ⁺ is convex and increasing; from any start below μ₀v̂ the iteration (thin) tends to "
    "its fixed point γ_b, the stable limit cycle. Lines: lowest order in ν. Dots: what the motion "
    "of (3.6) does, open for ν = 10⁻², full for ν = 10⁻⁴; the maps converge with the order √ν.",
    draw,
)
