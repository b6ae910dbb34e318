"""Figure 3.1 of [M]: the phase plane of the scaled slider."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry
from stickslip_paper.drawing.style import heads

# (β, γ) at the start, and the duration that is drawn.
_STARTS = (((3.3, 1.0), 9.0), ((-2.0, 2.3), 9.0), ((-18.0, 1.3), 3.0))


def draw() -> Figure:
    """Motions of (3.6) from several starts, and the limit cycle to which they tend."""
    slider = ss.catalogue.scaled_slider_limit(nu=0.05, b=0.5)
    with ss.style.paper_style():
        figure = ss.style.new_figure(7.2, 4.2)
        axes = figure.add_subplot(xlim=(-19.5, 7.5), ylim=(0.0, 2.55))
        for (beta, gamma), duration in _STARTS:
            motion = ss.simulate(slider, (0.0, duration), initial={"beta": beta, "gamma": gamma})
            path = motion.at(np.linspace(0.0, duration, 4001))
            axes.plot(path["beta"], path["gamma"], color=ss.style.SKY, lw=1.1)
            heads(axes, path["beta"], path["gamma"], (0.12, 0.3, 0.6), ss.style.SKY, 12)
        settled = ss.simulate(slider, (0.0, 60.0)).at(np.linspace(55.0, 60.0, 8001))
        axes.plot(settled["beta"], settled["gamma"], color=ss.style.BLUE, lw=2.4, gid="limit cycle")
        _name_the_parts(axes)
    return figure


def _name_the_parts(axes: Axes) -> None:
    """The sticking half, the steady state, the halves A_1 and A_2 of the axis, and the maps between
    them."""
    axes.axvspan(axes.get_xlim()[0], 0.0, color=ss.style.STICK_SHADE, lw=0, zorder=0)
    axes.plot([0, 0], [0, 1], color=ss.style.STICK_LINE, lw=2.4, zorder=3)
    axes.plot([0, 0], [1, 2.55], color=ss.style.STICK_LINE, lw=1.0, ls=(0, (3, 2)), zorder=3)
    axes.plot(1.0, 1.0, "o", color=ss.style.VERMILION, ms=6.5, zorder=5)
    axes.text(1.15, 0.80, r"$(\beta_*, \gamma_*)$", color=ss.style.VERMILION)
    axes.text(-0.35, 0.08, "$A_1$", ha="right", fontsize=13)
    axes.text(-0.35, 2.40, "$A_2$", ha="right", fontsize=13)
    axes.text(-19.0, 2.40, r"stick, $\beta < 0$")
    axes.text(7.3, 2.40, r"slip, $\beta > 0$", ha="right")
    centred = {"color": ss.style.BLUE, "fontsize": 15, "ha": "center", "va": "center", "zorder": 5}
    for x, y, name, ground in (
        (-8.45, 0.92, r"$\Phi^-$", ss.style.STICK_SHADE),
        (5.33, 1.5, r"$\Phi^+$", "white"),
    ):
        axes.text(
            x, y, name, bbox={"facecolor": ground, "edgecolor": "none", "pad": 1.5}, **centred
        )
    axes.set_xlabel(r"scaled excess over the threshold $\beta$")
    axes.set_ylabel(r"scaled state $\gamma$")


ENTRY = FigureEntry(
    "3.1",
    "Phase plane of the scaled slider",
    "The piecewise linear system (3.6), with the constant v̂/ν(1 − b√ν) corrected, for v̂ = 1 and "
    "μ₀ = 1; here ν = 0.05 and b = 0.5, so that slip and stick are both seen. For β > 0 an "
    "unstable focus at (β_*, γ_*) = (v̂, μ₀v̂); for β < 0 (grey, stick) γ decays and β returns. "
    "The motions (light) tend to the limit cycle (dark). Φ⁺ maps A₁ = [0, μ₀v̂[ along the slip to "
    "A₂ = ]μ₀v̂, ∞[, and Φ⁻ maps A₂ along the stick back to A₁.",
    draw,
)
