"""Rate-and-state friction of basalt gouge from one velocity step: ageing law and slip law.

The data and their source: examples/basalt/README.md.
"""

from pathlib import Path

import numpy as np
import pandas as pd

import stickslip as ss

HERE = Path(__file__).parent
FREE = {
    "a": (1e-3, 0.05),
    "b": (1e-3, 0.05),
    "D_c": (0.5, 200.0),
    "mu_0": (0.4, 0.8),
    "k": (1e-4, 0.1),
    "t_step": (15.0, 22.0),
    "trend": (-1e-3, 1e-3),
}
LAWS = {"ageing law": "1 - Omega", "slip law": "-Omega*log(Omega)"}
# It slides steadily before the step.
STEADY = {"mu": "mu_0 + (a - b)*log(V_1/v_0)", "phi": "log(v_0/V_1)"}


def record(first=50.0, last=100.0):
    """Time, way and friction around the step, from `first` to `last` seconds of the file.

    Rows that share a rounded time are spread over it: ten of them follow each other in 0.1 s.
    """
    table = pd.read_csv(HERE / "basalt_velocity_step.csv")
    clock = (table["time_s"] - table["time_s"][0]).round(1)
    same = clock.groupby(clock)
    clock = clock + 0.1 * same.cumcount() / same.transform("size")
    kept = (clock > first) & (clock < last)
    return {
        "t": np.asarray(clock)[kept] - first,
        "way": np.asarray(table["displacement_um"])[kept],
        "friction": np.asarray(table["friction"])[kept],
    }


def speeds(data):
    """Speeds of the load point before and after the step, and when their lines meet."""
    before, after = data["t"] < 17.0, data["t"] > 22.0
    lines = [np.polyfit(data["t"][side], data["way"][side], 1) for side in (before, after)]
    (V_1, way_1), (V_2, way_2) = lines
    return V_1, V_2, (way_1 - way_2) / (V_2 - V_1)


def compared(starts=8):
    """Both laws beside the record."""
    data = record()
    V_1, V_2, t_step = speeds(data)
    systems = {
        law: ss.catalogue.velocity_step(evolution=formula, V_1=V_1, V_2=V_2, v_0=V_1, t_step=t_step)
        for law, formula in LAWS.items()
    }
    table = {"t": data["t"], "friction": data["friction"]}
    observe = {"friction": "measured"}
    return ss.compare(systems, table, FREE, observe, initial=STEADY, starts=starts)


def picture(found):
    """The step with both fitted laws, what is left (means of 25 data), and the numbers."""
    with ss.style.paper_style():
        figure = ss.style.new_figure(7.2, 5.6)
        grid = figure.add_gridspec(3, 2, height_ratios=[2.4, 0.9, 1.1], width_ratios=[1.5, 1.0])
        whole, zoom = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
        left = figure.add_subplot(grid[1, :])
        numbers = [figure.add_subplot(grid[2, i]) for i in range(2)]
        colours = ss.style.LINES
        data = found.fits[0].dataset
        t, y = data["time"].values, data["friction"].values
        for axes, (low, high) in ((whole, (0.0, 50.0)), (zoom, (18.2, 21.0))):
            shown = (t >= low) & (t <= high)
            style = {"color": "0.55", "markersize": 1.6, "markeredgewidth": 0, "rasterized": True}
            axes.plot(t[shown], y[shown], "o", label="measured", **style)
            for name, fit, colour in zip(found.names, found.fits, colours, strict=False):
                grid_t = np.linspace(max(low, t[0]), min(high, t[-1]), 1500)
                motion = fit.trajectory
                values = motion.at(grid_t)["mu"] + _trend(fit, grid_t)
                axes.plot(grid_t, values, color=colour, linewidth=1.3, label=name)
            axes.set_xlabel("time  [s]")
        whole.set_ylabel("friction coefficient")
        ss.style.legend_above(whole)
        for fit, colour in zip(found.fits, colours, strict=False):
            r = fit.dataset["residual_friction"].values
            mean = np.convolve(r, np.full(25, 1 / 25), "same")
            left.plot(t, 1e3 * mean, color=colour, linewidth=0.9)
        left.axhline(0.0, color="0.2", linewidth=0.8)
        left.set_ylabel("residual [10⁻³]")
        left.set_xlabel("time  [s]")
        _intervals(numbers[0], found, ("a", "b"), "direct and evolution effect")
        _intervals(numbers[1], found, ("D_c",), "$D_c$  [µm]")
    return figure


def _trend(fit, t):
    p = fit.parameters
    return p["trend"] * (p["V_1"] * t + (p["V_2"] - p["V_1"]) * np.maximum(t - p["t_step"], 0.0))


def _intervals(axes, found, names, label):
    """Estimates with their intervals of 95 %."""
    ticks = []
    for j, name in enumerate(names):
        for i, fit in enumerate(found.fits):
            low, high = fit.interval[name]
            value = fit.estimate[name]
            place = -j - 0.28 * i
            axes.errorbar(
                [value],
                [place],
                xerr=[[value - low], [high - value]],
                fmt="o",
                color=ss.style.LINES[i],
                markersize=4,
                capsize=3,
            )
        ticks.append(-j - 0.14)
    axes.set_yticks(ticks, [ss.style.symbol(name) for name in names])
    axes.set_ylim(-len(names) + 0.4, 0.3)
    axes.set_xlabel(label)


if __name__ == "__main__":
    found = compared()
    print(found.summary())
    folder = Path("out/basalt")
    folder.mkdir(parents=True, exist_ok=True)
    found.save(folder / "comparison.nc")
    picture(found).savefig(folder / "fit.png")
    best = found.best
    p = best.estimate
    print(f"critical stiffness (b - a)/D_c = {(p['b'] - p['a']) / p['D_c']:.3g} per µm")
    print(folder / "fit.png")
