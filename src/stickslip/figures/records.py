"""Plots of maps over records: a thin line for each record, their median, and the range from 16 % to
84 %, which corresponds to a standard deviation."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip.errors import DeclarationError
from stickslip.figures.drawing.maps import (
    axis_text,
    axis_unit,
    chosen_measures,
    map_title,
    measure_label,
    uncertified,
)
from stickslip.figures.drawing.style import (
    BLUE,
    STICK_LINE,
    VERMILION,
    axis_label,
    legend_above,
    level_colours,
    new_figure,
    paper_style,
    root_of,
)
from stickslip.model.entries.units import with_unit
from stickslip.sweeps.request.records import SCALE, record_axis

if TYPE_CHECKING:
    import xarray

_MOST = 6  # largest number of levels with separate lines
_NAMED = 30  # number of records up to which they are named next to their values
_FEW, _MANY = 0.45, 0.15  # opacity of a line among few, and among many
# quantiles of the records; those without a value are omitted
_PARTS = (0.05, 0.16, 0.5, 0.84, 0.95)
_BAND = 0.2  # opacity
_FAR = 1.6  # ratio to the range of most lines above which a few lines leave the figure
_PAD = 0.1  # margin as a fraction of the range of most lines


def plot_records(
    data: xarray.Dataset, measures: Sequence[str] | None = None, ax: Axes | None = None
) -> Figure:
    """Plot measures of many records against their scale, or another axis: thin lines for all
    records, a thick one for their median, and a band from 16 % to 84 % of them; lines of a few
    outliers are clipped. Without such an axis, plot a dot for each record.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset of a :class:`stickslip.Map` with an axis of records.
    measures : sequence of str, optional
        Plotted measures; by default all.
    ax : matplotlib.axes.Axes, optional
        Existing axes to draw the first of them into.

    Raises
    ------
    DeclarationError
        If there is no such measure, or another axis has too many values for lines.
    """
    names = chosen_measures(data, measures)
    along = _along(data)
    levels = _levels(data, along)
    draw = _dots if along is None else _lines
    if ax is not None:
        draw(ax, data, names[0], along, levels)
        return root_of(ax)
    with paper_style():
        figure = new_figure(6.4, 0.9 + 3.0 * len(names))
        figure.suptitle(map_title(data), x=0.01, ha="left", fontsize=13)
        panels = figure.subplots(len(names), 1, sharex=along is not None, squeeze=False)[:, 0]
        for axes, name in zip(panels, names, strict=True):
            draw(axes, data, name, along, levels)
            axes.label_outer()
    return figure


def _along(data: xarray.Dataset) -> str | None:
    """Horizontal axis of the lines: the scale, otherwise the longest axis."""
    known = [str(d) for d in data["outcome"].dims if d != record_axis(data) and d in data.coords]
    if SCALE in known:
        return SCALE
    return max(known, key=lambda d: data.sizes[d], default=None)


def _levels(data: xarray.Dataset, along: str | None) -> list[tuple[str, dict[str, int]]]:
    """Values of the other axis, and their positions."""
    others = [str(d) for d in data["outcome"].dims if d not in (along, record_axis(data))]
    places = list(product(*(range(data.sizes[d]) for d in others)))
    if len(places) > _MOST:
        count = f"{len(places)} values of {', '.join(others)}"
        raise DeclarationError(
            "plot", f"{count} are too many for lines", "Select some: data.sel(mu=1)"
        )
    found: list[tuple[str, dict[str, int]]] = []
    for place in places:
        where = dict(zip(others, place, strict=True))
        said = [
            f"{axis_label([d], '')} = {with_unit(float(data[d][i]), axis_unit(data, d), 4)}"
            for d, i in where.items()
            if d in data.coords
        ]
        found.append((", ".join(said), where))
    return found


def _lines(
    axes: Axes,
    data: xarray.Dataset,
    name: str,
    along: str | None,
    levels: list[tuple[str, dict[str, int]]],
) -> None:
    """A line for each record, and their median, in the colour of the level."""
    records = record_axis(data)
    order = np.argsort(data[along].values)
    x = data[along].values[order]
    colours = level_colours(len(levels))
    opacity = max(_MANY, _FEW / np.sqrt(data.sizes[records]) * 2.0)
    marks: list[Artist] = []
    doubtful = False
    ends: list[float] = []
    for (said, where), colour in zip(levels, colours, strict=True):
        values = data[name].isel(where).transpose(along, records).values[order]
        axes.plot(x, values, color=colour, lw=0.8, alpha=min(opacity, _FEW))
        known = np.isfinite(values).any(axis=1)
        parts = np.nanquantile(values[known], _PARTS, axis=1)
        axes.fill_between(x[known], parts[1], parts[3], color=colour, alpha=_BAND, lw=0.0)
        axes.plot(x[known], parts[2], color=colour, lw=2.2)
        ends += [np.min(parts[0], initial=np.inf), np.max(parts[4], initial=-np.inf)]
        bad = uncertified(data.isel(where), name)
        bad = data[name].isel(where).copy(data=bad).transpose(along, records).values[order]
        doubtful = doubtful or bool(np.any(bad))
        for column, wrong in zip(values.T, bad.T, strict=True) if np.any(bad) else ():
            axes.plot(x[wrong], column[wrong], "o", mfc="white", mec=VERMILION, ms=4, zorder=3)
        marks.append(Line2D([], [], color=colour, lw=2.2, label=said or "median"))
    thin: dict[str, Any] = {"color": STICK_LINE if len(levels) > 1 else BLUE, "lw": 0.8}
    band = Patch(color=str(thin["color"]), alpha=_BAND, lw=0.0, label="16 % to 84 %")
    marks += [band, Line2D([], [], alpha=_FEW, label="each record", **thin)]
    if doubtful:
        hollow: dict[str, Any] = {"linestyle": "none", "marker": "o", "mfc": "white"}
        marks.append(Line2D([], [], mec=VERMILION, label="not certified", **hollow))
    if data[along].attrs.get("spacing") == "log":
        axes.set_xscale("log")
    _clip_outliers(axes, min(ends), max(ends))
    axes.set_xlabel(axis_text(data, [str(along)]))
    axes.set_ylabel(measure_label(data, name, 26))
    legend_above(axes, marks)


def _clip_outliers(axes: Axes, low: float, high: float) -> None:
    """Clip lines of outliers that would take most of the figure."""
    bottom, top = axes.get_ylim()
    if high > low and top - bottom > _FAR * (high - low):
        room = _PAD * (high - low)
        axes.set_ylim(max(bottom, low - room), min(top, high + room))


def _dots(
    axes: Axes,
    data: xarray.Dataset,
    name: str,
    along: str | None,
    levels: list[tuple[str, dict[str, int]]],
) -> None:
    """A dot for each record, from the smallest value to the largest."""
    records = record_axis(data)
    values = data[name].values
    order = np.argsort(values)
    axes.plot(values[order], np.arange(len(order)), "o", color=BLUE, ms=4, mew=0.0)
    axes.set_xlabel(measure_label(data, name, 60))
    if len(order) <= _NAMED:
        axes.set_yticks(np.arange(len(order)), data[records].values[order].tolist())
    else:
        axes.set_ylabel("records, by their values")
