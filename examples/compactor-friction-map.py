"""Effective friction of a vibrating plate, over the force and the frequency of the imbalance.

The map shows the mean pulling force; without vibration it is μmg. A plate that slides without
stopping also has the mean friction μmg: vibration helps only if the plate stops, that is, if the
amplitude of its forced velocity oscillation, μFΩ/(m|Ω² − k/m|), exceeds the speed of the pull. The
friction then decreases towards μ(mg − F), its minimum in a period.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), figure 1.1(A) and theorem 2.2.
"""

from pathlib import Path

import numpy as np

import stickslip as ss

compactor = ss.catalogue.plate_compactor(V=0.01)
p = compactor.values


def friction(forces=50, speeds=40, out=None):
    """The map, with so many values of each parameter."""
    over = {"F": f"0:980:{forces}", "Omega": f"log:10:300:{speeds}"}
    return ss.sweep(compactor, over, ["friction = -mean_force/(m*g)"], out)


def stopping_force(Omega):
    """Force of the imbalance above which the plate cannot slide without stopping."""
    return p["V"] * p["m"] * np.abs(Omega**2 - p["k"] / p["m"]) / (p["mu"] * Omega)


def plot_stopping(axes):
    """The boundary between sliding without stops and with stops."""

    Omega = np.geomspace(10.0, 300.0, 400)
    force = stopping_force(Omega)
    inside = force <= 980.0
    axes.plot(
        force[inside],
        Omega[inside],
        color=ss.style.VERMILION,
        ls=(0, (4, 2)),
        lw=1.8,
        label="above this line the plate stops repeatedly",
    )


if __name__ == "__main__":
    data = friction(out="out/compactor-friction-map/friction.zarr")
    data["friction"].attrs["long_name"] = "effective coefficient of friction"
    path = Path("out/compactor-friction-map/friction.png")
    with ss.style.paper_style():
        figure = ss.style.new_figure(6.4, 4.6)
        axes = figure.subplots()
        data.plot("friction", ax=axes)
        plot_stopping(axes)
        ss.style.legend_above(axes)
        figure.savefig(path)
    least = data["friction"].where(data["F"] == data["F"].max(), drop=True)
    print(f"friction of the plate at rest {p['mu']:g}, least on the map {float(least.min()):.3f}")
    print(path)
