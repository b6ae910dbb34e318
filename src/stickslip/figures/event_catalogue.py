"""Plots of event catalogues: sizes over time and their sum, number of events by size, times between
them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stickslip.arrays import Array
from stickslip.figures.drawing.style import (
    BLUE,
    STICK_LINE,
    legend_above,
    new_figure,
    paper_style,
    powers_in_labels,
    root_of,
)
from stickslip.model.entries.units import unit_label

if TYPE_CHECKING:
    from stickslip.motion.event_catalogue import EventCatalogue

_MANY = 400  # number of events up to which they are drawn with stems
_PAD = 0.06  # margin of a logarithmic axis, as a fraction of the range
_ENOUGH = 30  # smallest number of events, or times between them, that are compared with a law
_BIN = 0.1  # width of a bin of magnitudes
_MAGNITUDE = 2.0 / 3.0  # magnitude per decade of the size


def plot_catalogue(catalogue: EventCatalogue, ax: Axes | None = None) -> Figure:
    """Plot sizes over time; the number of events of at least a given size, with the b-value law;
    the number of interevent times of at least a given length, compared with a Poisson process of
    the same rate; the cumulative size over time; and the time after an event against its size.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Plot only the number of events of at least a given size, into these axes.
    """
    if ax is not None:
        _at_least(ax, catalogue, "size")
        return root_of(ax)
    with paper_style():
        several = len(catalogue) > 1
        figure = new_figure(7.2, 7.6 if several else 3.0)
        figure.suptitle(catalogue.title, x=0.01, ha="left", fontsize=13)
        grid = figure.add_gridspec(3 if several else 1, 2)
        _over_time(figure.add_subplot(grid[0, :]), catalogue)
        if several:
            _at_least(figure.add_subplot(grid[1, 0]), catalogue, "size")
            _at_least(figure.add_subplot(grid[1, 1]), catalogue, "interevent")
            _sum(figure.add_subplot(grid[2, 0]), catalogue)
            _recurrence(figure.add_subplot(grid[2, 1]), catalogue)
        powers_in_labels(figure)
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
    else:
        axes.text(0.5, 0.5, "no events", transform=axes.transAxes, ha="center", va="center")
        axes.set_yticks([])
    axes.set_xlim(*catalogue.span)
    axes.set_xlabel(_label(catalogue, "start"))
    axes.set_ylabel(_label(catalogue, "size"))


def _sum(axes: Axes, catalogue: EventCatalogue) -> None:
    """Plot the cumulative size over time, in steps: if events release the deformation by a steady
    load, it follows a straight line."""
    start, total = catalogue["start"].values, np.cumsum(catalogue["size"].values)
    first, last = catalogue.span
    times, sums = np.concatenate([[first], start, [last]]), np.concatenate([[0.0], total])
    axes.stairs(sums, times, baseline=None, color=BLUE, lw=1.2)
    axes.set_xlim(first, last)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(_label(catalogue, "start"))
    axes.set_ylabel(_label(catalogue, "size").replace("total slip", "cumulative slip"))


def _recurrence(axes: Axes, catalogue: EventCatalogue) -> None:
    """Plot the time after each event against its size: it increases if a large event is followed by
    a long pause."""
    size, after = catalogue["size"].values[:-1], catalogue["interevent"].values[1:]
    some = (size > 0.0) & (after > 0.0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.plot(size[some], after[some], ".", color=BLUE, ms=5, mew=0.0)
    axes.set_xlim(*_decades(size))
    axes.set_ylim(*_decades(after))
    axes.set_xlabel(_label(catalogue, "size"))
    said = _label(catalogue, "interevent").replace("between events", "to next\nevent")
    axes.set_ylabel(said, fontsize=11.0)
    if len(catalogue) > 2:
        said = f"coefficient of variation {catalogue.recurrence()[1]:.2g}"
        legend_above(axes, [Line2D([], [], linestyle="none", label=said)], right=True)


def _at_least(axes: Axes, catalogue: EventCatalogue, name: str) -> None:
    """Plot the number of events with at least a given value, on logarithmic axes."""
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
    axes.set_ylim(0.7, max(1.5 * len(values), 12.0))
    if name == "size" and len(values) >= _ENOUGH and np.ptp(values) > 0.0:
        least = _complete_from(values)
        if np.count_nonzero(values > least) > 1:
            b, error = catalogue.b_value(least)
            ends = np.array([least, float(values[-1])])
            law = np.count_nonzero(values >= least) * (ends / least) ** (-_MAGNITUDE * b)
            said = f"$b = {b:.2f} \\pm {error:.2f}$"
            axes.loglog(ends, law, color=STICK_LINE, lw=0.8, label=said)
            legend_above(axes, right=True)
    if name == "interevent" and len(values) >= _ENOUGH:
        times = np.geomspace(*_decades(values), 200)
        poisson = len(values) * np.exp(-times / np.mean(values))
        axes.loglog(times, poisson, color=STICK_LINE, lw=0.8, label="Poisson process")
        legend_above(axes, right=True)


def _complete_from(values: Array) -> float:
    """Magnitude of completeness: the most frequent magnitude, in bins of 0.1 (S. Wiemer, M. Wyss,
    Bull. Seismol. Soc. Am. 90 (2000) 859-869). There are fewer events below it than by the law."""
    sizes = values[values > 0.0]
    bins = np.floor(_MAGNITUDE * np.log10(sizes) / _BIN)
    found, counts = np.unique(bins, return_counts=True)
    return float(np.min(sizes[bins >= found[np.argmax(counts)]]))


def _decades(values: Array) -> tuple[float, float]:
    """Ends of a logarithmic axis around positive values."""
    some = values[values > 0.0]
    if not len(some):
        return 0.1, 10.0
    low, high = np.log10(some.min()), np.log10(some.max())
    if high - low < 1.0:  # whole decades, since otherwise no tick would have a plain number
        low, high = np.floor(low), np.floor(high) + 1.0
    pad = _PAD * (high - low)
    return float(10 ** (low - pad)), float(10 ** (high + pad))


def _label(catalogue: EventCatalogue, name: str) -> str:
    about = catalogue[name].attrs
    unit = unit_label(about["units"]) if about.get("units", "1") != "1" else ""
    return f"{about['long_name']}  [{unit}]" if unit else about["long_name"]
