"""Walking speed of a toy animal, over the pull on its legs and the damping of its rocking.

The pull feeds energy into the rocking; if this is less than the damping dissipates, the toy comes
to rest. Rest and walking coexist, so the map depends on the initial state, here ψ = 0.8 with the
legs in a position in which friction holds them. This position depends on the pull, so P and x_R
vary together. Below P = ρ + cψ* the pull does not move an unloaded leg; above P = H*/2 a fully
loaded leg slips.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), (4.2).
"""

from pathlib import Path

import numpy as np

import stickslip as ss

toy = ss.catalogue.rocking_toy()
p = toy.values
bounds = p["rho"] + p["c"] * p["psi_star"], p["H_star"] / 2


def walking(pulls=120, dampings=90, out=None):
    """The map, with so many values of each parameter."""
    over = {"P,x_R": f"0.4:1.65:{pulls}; 0.3:-0.95:{pulls}", "delta": f"log:0.005:0.2:{dampings}"}
    return ss.sweep(toy, over, ["speed"], out)


def plot_boundary(axes, data):
    """Where walking begins, and what the pull says of it."""

    walks = (data["outcome"] == ss.Outcome.PERIODIC.code) & (data["speed"] > 1e-6)
    style = {"levels": [0.5], "colors": "white", "linewidths": 1.8}
    axes.contour(data["P"], data["delta"], walks.T.astype(float), **style)
    for bound, label in zip(bounds, (r"$\rho + c\psi_*$", r"$H_*/2$"), strict=True):
        axes.axvline(bound, color=ss.style.VERMILION, ls=(0, (4, 2)), lw=1.2)
        axes.text(
            bound,
            1.02,
            label,
            transform=axes.get_xaxis_transform(),
            color=ss.style.STICK_LINE,
            ha="center",
        )


if __name__ == "__main__":
    data = walking(out="out/walking-speed-map/speed.zarr")
    path = Path("out/walking-speed-map/speed.png")
    with ss.style.paper_style():
        figure = ss.style.new_figure(6.4, 4.6)
        axes = figure.subplots()
        data.plot("speed", ax=axes)
        plot_boundary(axes, data)
        figure.savefig(path)
    fastest = data.dataset.isel(data["speed"].argmax(...))
    print(
        f"walks at {np.mean(data['speed'].values > 1e-6):.0%} of the points, fastest with", end=" "
    )
    print(
        f"{float(fastest['speed']):.3g} m/s at P = {float(fastest['P']):.3g} N, delta = "
        f"{float(fastest['delta']):.2g}"
    )
    print(path)
