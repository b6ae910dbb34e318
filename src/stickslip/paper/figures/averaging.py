"""How fast friction that oscillates tends to its average: [M] section 2.2 and Theorem 2.2,
measured."""

from matplotlib.figure import Figure

import stickslip as ss
from stickslip.figures.drawing.style import (
    BLUE,
    GREEN,
    STICK_LINE,
    VERMILION,
    new_figure,
    paper_style,
)
from stickslip.paper.drawing.entry import FigureEntry
from stickslip.rate_independent.evolution.averaging_study import fitted_power


def draw() -> Figure:
    """Distance of z_ε from z_0, and what happens to the rates, over ε."""
    friction = ss.WeightedL1(["1 + cos(2*pi*s)/2"])
    problem = ss.Evolution([[1.0]], ["5*t - t**2"], friction, [0.0], span=(0, 5))
    study = ss.averaging_study(problem, [0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002]).dataset
    epsilon = study["epsilon"].values
    with paper_style():
        figure = new_figure(7.2, 3.6)
        left, right = figure.subplots(1, 2)
        left.loglog(
            epsilon,
            5.0 * epsilon,
            "--",
            color=STICK_LINE,
            lw=1.1,
            label=r"$\varepsilon\,\max|\dot\ell|$",
        )
        left.loglog(
            epsilon,
            study["distance"],
            "o",
            color=BLUE,
            ms=5.5,
            label=r"$\sup\,|z_\varepsilon - z_0|$",
        )
        left.set_ylabel("distance of the motions")
        norms = {
            r"$\|\dot z_\varepsilon\|_{L^2}$": (study["rate_l2"].values, VERMILION, "s"),
            r"$\|\dot z_\varepsilon\|_{L^1}$": (study["rate_l1"].values, BLUE, "o"),
            r"$\dot z_\varepsilon - \dot z_0$, tested": (
                study["weak_distance"].max("test").values,
                GREEN,
                "^",
            ),
        }
        for label, (values, colour, marker) in norms.items():
            power, factor = fitted_power(epsilon, values)
            right.loglog(epsilon, factor * epsilon**power, color=colour, lw=1.0)
            right.loglog(
                epsilon,
                values,
                marker,
                color=colour,
                ms=5.5,
                label=f"{label} $\\sim \\varepsilon^{{{power:.2f}}}$",
            )
        right.set_ylabel("size of the rates")
        right.set_ylim(top=2e4)
        for axes in (left, right):
            axes.set_xlabel(r"period of the friction $\varepsilon$")
            axes.legend(loc="upper left")
    return figure


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
