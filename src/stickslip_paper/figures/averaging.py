"""Convergence of oscillating friction to its average: [M] section 2.2 and Theorem 2.2, measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_paper.drawing.entry import FigureEntry
from stickslip_paper.sections.claim import fitted_power

if TYPE_CHECKING:
    import xarray


def draw() -> Figure:
    """Plot the distance of z_ε from z_0, and the convergence of the rates, over ε."""
    friction = ss.WeightedL1(["1 + cos(2*pi*s)/2"])
    problem = ss.Evolution([[1.0]], ["5*t - t**2"], friction, [0.0], span=(0, 5))
    study = ss.averaging_study(problem, [0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002]).dataset
    with ss.style.paper_style():
        figure = ss.style.new_figure(7.2, 3.6)
        left, right = figure.subplots(1, 2)
        draw_distances(left, study)
        draw_rates(right, study)
        for axes in (left, right):
            axes.set_xlabel(r"period of the friction $\varepsilon$")
            axes.legend(loc="upper left")
    return figure


def draw_distances(axes: Axes, study: xarray.Dataset) -> None:
    """Distance of the motions, below ε times the largest rate of the load."""
    epsilon = study["epsilon"].values
    bound = r"$\varepsilon\,\max|\dot\ell|$"
    axes.loglog(epsilon, 5.0 * epsilon, "--", color=ss.style.STICK_LINE, lw=1.1, label=bound)
    distance = r"$\sup\,|z_\varepsilon - z_0|$"
    axes.loglog(epsilon, study["distance"], "o", color=ss.style.BLUE, ms=5.5, label=distance)
    axes.set_ylabel("distance of the motions")


def draw_rates(axes: Axes, study: xarray.Dataset) -> None:
    """Norms of the rates, with the powers of ε that fit them."""
    epsilon = study["epsilon"].values
    norms = {
        r"$\|\dot z_\varepsilon\|_{L^2}$": (study["rate_l2"].values, ss.style.VERMILION, "s"),
        r"$\|\dot z_\varepsilon\|_{L^1}$": (study["rate_l1"].values, ss.style.BLUE, "o"),
        r"$\dot z_\varepsilon - \dot z_0$, tested": (
            study["weak_distance"].max("test").values,
            ss.style.GREEN,
            "^",
        ),
    }
    for label, (values, colour, marker) in norms.items():
        power, factor = fitted_power(epsilon, values)
        axes.loglog(epsilon, factor * epsilon**power, color=colour, lw=1.0)
        fitted = f"{label} $\\sim \\varepsilon^{{{power:.2f}}}$"
        axes.loglog(epsilon, values, marker, color=colour, ms=5.5, label=fitted)
    axes.set_ylabel("size of the rates")
    axes.set_ylim(top=2e4)


ENTRY = FigureEntry(
    "averaging",
    "Averaging error against ε",
    "The example of section 2.2 for many ε: ℓ(t) = 5t − t², ρ(s) = 1 + cos(2πs)/2, z(0) = 0, "
    "0 ≤ t ≤ 5. Left: the distance of z_ε from the limit z_0 is of the order ε (section 2.2: at "
    "most Cε). It stays below ε max|ℓ′| = 5ε and comes near to it as ε → 0: z_ε waits for one "
    "period of the friction while z_0 follows the load. Right: tested with continuous functions "
    "(cos(jπt/5), j < 5; the worst of them is shown) the rates converge; their L¹ norm, the length "
    "of the way, stays the same, and their L² norm grows (at a smooth minimum of ρ like ε^(−1/4)), "
    "so they do not converge weakly in L².",
    draw,
)
