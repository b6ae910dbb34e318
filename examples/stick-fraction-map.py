"""Fraction of the time in which a spring slider sticks, over the rate of its load and its
viscosity.

Steady sliding loses stability on the curve along which the trace of its Jacobian vanishes. Slightly
beyond this curve stick-slip and stable steady sliding coexist, and the initial state decides which
one occurs.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), (3.3).
"""

from pathlib import Path

import numpy as np

import stickslip as ss

slider = ss.catalogue.spring_slider()  # k = alpha_0 = 1, mu = 1/2 + exp(-(alpha - 1)/0.4)


def sticking(rates=140, viscosities=110, out=None):
    """The map, with so many values of each parameter."""
    over = {"V": f"log:0.02:1:{rates}", "nu": f"log:0.005:0.5:{viscosities}"}
    return ss.sweep(slider, over, ["stick_fraction"], out)


def trace(V, nu):
    """Trace of the Jacobian of steady sliding: positive where it is unstable.

    α* = 1 + V U* and U* = μ(α*) + νV; Newton's iteration, for the function is convex and decreases.
    """
    alpha = np.ones(np.broadcast(V, nu).shape)
    for _ in range(30):
        friction = np.exp(-(alpha - 1.0) / 0.4)
        alpha -= (1.0 + V * (0.5 + friction + nu * V) - alpha) / (-V * friction / 0.4 - 1.0)
    friction = np.exp(-(alpha - 1.0) / 0.4)
    return -1.0 - (1.0 + (0.5 + friction + nu * V) * (-friction / 0.4)) / nu


def plot_hopf(axes, data):
    """Where steady sliding loses its stability."""

    V = np.geomspace(0.02, 1.0, 400)[:, None]
    nu = np.geomspace(0.005, 0.5, 400)
    style = {
        "levels": [0.0],
        "colors": ss.style.VERMILION,
        "linewidths": 1.8,
        "linestyles": [(0, (4, 2))],
    }
    axes.contour(V[:, 0], nu, trace(V, nu).T, **style)
    axes.plot(
        [],
        [],
        color=ss.style.VERMILION,
        ls=(0, (4, 2)),
        lw=1.8,
        label="steady sliding loses stability",
    )


if __name__ == "__main__":
    data = sticking(out="out/stick-fraction-map/stick.zarr")
    path = Path("out/stick-fraction-map/stick.png")
    with ss.style.paper_style():
        figure = ss.style.new_figure(6.4, 4.6)
        axes = figure.subplots()
        data.plot("stick_fraction", ax=axes)
        plot_hopf(axes, data)
        ss.style.legend_above(axes)
        figure.savefig(path)
    V = data["V"].values[:, None]
    nu = data["nu"].values
    moving = data["stick_fraction"].values > 0.0
    beyond = np.mean((trace(V, nu) < 0.0) & moving) / np.mean(moving)
    print(
        f"stick-slip at {np.mean(moving):.0%} of the points, {beyond:.0%} of them beside stable "
        "steady sliding"
    )
    print(path)
