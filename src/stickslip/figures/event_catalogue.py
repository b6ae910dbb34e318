"""Pictures of event catalogues: sizes over time, how many events are as large, times between
them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from stickslip.arrays import Array
from stickslip.figures.drawing.style import (
    BLUE,
    STICK_LINE,
    legend_above,
    new_figure,
    paper_style,
    root_of,
)
from stickslip.model.entries.units import unit_label

if TYPE_CHECKING:
    from stickslip.motion.event_catalogue import EventCatalogue

_MANY = 400  # events that are drawn with stems
_PAD = 0.05  # of a logarithmic axis beyond the values
_ENOUGH = 30  # times between events that are compared with a Poisson process


def plot_catalogue(catalogue: EventCatalogue, ax: Axes | None = None) -> Figure:
    """Sizes over time; below, how many events are at least as large, and how many times between
    events are at least as long, beside what a Poisson process of the same rate would have.

    Parameters
    ----------
    catalogue : EventCatalogue
    ax : matplotlib.axes.Axes, optional
        Draw how many events are at least as large into these axes.
    """
    if ax is not None:
        _at_least(ax, catalogue, "size")
        return root_of(ax)
    with paper_style():
        figure = new_figure(6.8, 6.0)
        figure.suptitle(catalogue.title, x=0.01, ha="left", fontsize=13)
        grid = figure.add_gridspec(2, 2)
        _over_time(figure.add_subplot(grid[0, :]), catalogue)
        _at_least(figure.add_subplot(grid[1, 0]), catalogue, "size")
        _at_least(figure.add_subplot(grid[1, 1]), catalogue, "interevent")
    return figure


def _over_time(axes: Axes, catalogue: EventCatalogue) -> None:
    start, size = catalogue["start"].values, catalogue["size"].values
    if len(size):
        low, _ = _decades(size)
        axes.set_yscale("log")
        if len(size) <= _MANY:
            axes.vlines(start, low, size, color=BLUE, lw=0.8)
        axes.plot(start, size, "o", color=BLUE, ms=4 if len(size) <= _MANY else 2, mew=0.0)
        axes.set_ylim(*_decades(size))
        _few_numbers(axes.yaxis, size)
    else:
        axes.text(
            0.5,
            0.5,
            "no slip event in this time",
            transform=axes.transAxes,
            ha="center",
            va="center",
            fontsize=10,
        )
        axes.set_yticks([])
    axes.set_xlim(*catalogue.span)
    axes.set_xlabel(_label(catalogue, "start"))
    axes.set_ylabel(_label(catalogue, "size"))


def _at_least(axes: Axes, catalogue: EventCatalogue, name: str) -> None:
    """How many events have at least that value, on logarithmic axes."""
    values = catalogue[name].values
    values = np.sort(values[np.isfinite(values)])
    axes.set_xlabel(_label(catalogue, name))
    what = "events at least as large" if name == "size" else "times at least as long"
    axes.set_ylabel(what, fontsize=11.0)
    if not len(values):
        axes.set_xticks([])
        axes.set_yticks([])
        return
    count = np.arange(len(values), 0, -1)
    axes.loglog(values, count, ".", color=BLUE, ms=5, mew=0.0)
    axes.set_xlim(*_decades(values))
    axes.set_ylim(0.7, 1.5 * len(values))
    if name == "interevent" and len(values) >= _ENOUGH:
        times = np.geomspace(*_decades(values), 200)
        poisson = len(values) * np.exp(-times / np.mean(values))
        axes.loglog(times, poisson, color=STICK_LINE, lw=0.8, label="Poisson process")
        legend_above(axes, right=True)
    _few_numbers(axes.xaxis, values)


def _decades(values: Array) -> tuple[float, float]:
    """Ends of a logarithmic axis around positive values."""
    some = values[values > 0.0]
    if not len(some):
        return 0.1, 10.0
    low, high = np.log10(some.min()), np.log10(some.max())
    if high - low < 1.0:  # whole decades, or no tick would have a plain number
        return float(10 ** np.floor(low)), float(10 ** (np.floor(high) + 1.0))
    pad = _PAD * (high - low)
    return float(10 ** (low - pad)), float(10 ** (high + pad))


def _few_numbers(axis: Axis, values: Array) -> None:
    """Numbers at whole decades, and at 2 and 5 where fewer than two of these are shown: more of
    them overlap."""
    low, high = np.log10(_decades(values))
    plenty = np.floor(high + 1e-9) > np.ceil(low - 1e-9)

    def number(value: float, _: int | None) -> str:
        digit = round(value / 10 ** np.floor(np.log10(value) + 1e-9))
        return f"{value:g}" if digit in (2, 5) else ""

    axis.set_minor_formatter(NullFormatter() if plenty else FuncFormatter(number))


def _label(catalogue: EventCatalogue, name: str) -> str:
    about = catalogue[name].attrs
    unit = unit_label(about["units"]) if about.get("units", "1") != "1" else ""
    return f"{about['long_name']}  [{unit}]" if unit else about["long_name"]
