"""From a record to a map: the friction law of a block on a belt from 20 s of its motion, the region
of stick-slip, and its uncertainty.

The record is synthetic (`python examples/belt/map.py record` writes it again): a belt with a
Stribeck law and noise of 2 cm and 2 cm/s, so that the result can be compared with the true values.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

import stickslip as ss

HERE = Path(__file__).parent
TRUTH = {"F_s": 1.0, "F_c": 0.5, "v_s": 0.4}
FREE = {"F_s": (0.3, 3.0), "F_c": (0.05, 1.0), "v_s": (0.05, 2.0)}
OBSERVE = {"position": "x", "velocity": "d_x"}
belt = ss.catalogue.belt_stribeck()


def write_record(seed=7):
    """The record, made with the truth."""
    t = np.round(np.linspace(0.0, 20.0, 401), 3)
    motion = ss.simulate(belt, (0.0, 20.0), parameters=TRUTH).at(t)
    rng = np.random.default_rng(seed)
    noisy = {name: motion[x] + 0.02 * rng.standard_normal(len(t)) for name, x in OBSERVE.items()}
    table = pd.DataFrame({"time": t, **noisy})
    table.to_csv(HERE / "record.csv", index=False, float_format="%.5f")


def fitted(starts=8):
    """The friction law that explains the record best."""
    return ss.fit(belt, HERE / "record.csv", FREE, OBSERVE, starts=starts)


def critical_speeds(found, damping, draws=1000):
    """Speed of the belt above which steady sliding is stable, over the damping: ends of its
    interval of 95 %, and the estimate between them."""
    values = found.draws(draws)
    every = {name: values[name].values[:, None] for name in TRUTH}

    def critical(p):
        return p["v_s"] * np.log((p["F_s"] - p["F_c"]) / (damping * p["v_s"]))

    low, high = np.quantile(critical(every), [0.025, 0.975], axis=0)
    return low, critical(found.estimate), high


def stability_map(found, speeds=36, dampings=30, out=None):
    """How far the block swings, over the speed of the belt and the damping."""
    over = {"V": f"0.05:1.4:{speeds}", "c": f"0.05:0.4:{dampings}"}
    return ss.sweep(found.system, over, ["amplitude:x"], out)


def picture(found, data):
    """The map, and where steady sliding loses its stability, with its interval."""
    with ss.style.paper_style():
        figure = ss.style.new_figure(6.4, 4.6)
        axes = figure.add_subplot()
        data.plot("amplitude:x", ax=axes)
        c = np.linspace(0.05, 0.4, 200)
        low, middle, high = critical_speeds(found, c)
        axes.fill_betweenx(c, low, high, color=ss.style.VERMILION, alpha=0.35, linewidth=0)
        axes.plot(
            middle, c, color=ss.style.VERMILION, label="steady sliding is stable beyond, 95 %"
        )
        axes.set_xlim(0.05, 1.4)
        axes.set_ylim(0.05, 0.4)
        axes.legend(loc="upper right", frameon=True)
    return figure


if __name__ == "__main__":
    if sys.argv[1:] == ["record"]:
        write_record()
    folder = Path("out/belt")
    folder.mkdir(parents=True, exist_ok=True)
    found = fitted()
    print(found.summary())
    found.plot().savefig(folder / "fit.png")
    band = found.continue_cycle("V", (0.05, 1.4))
    print(band.message)
    band.plot().savefig(folder / "band.png")
    data = stability_map(found, out=folder / "map.zarr")
    picture(found, data).savefig(folder / "map.png")
    print(folder / "map.png")
