"""Plots of samples, a measured function of time, and of tables, measured curves and surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.figures.drawing.style import BLUE, VERMILION, new_figure, paper_style, root_of
from stickslip.model.entries.units import unit_label

if TYPE_CHECKING:
    from stickslip.model.entries.samples import Samples
    from stickslip.model.entries.tables import Table

_DOTTED = 200  # number of samples up to which they are also shown as dots
_BEYOND = 0.1  # length of the extrapolation on each side, as a fraction of the range of a table
_LEVELS, _FINE_GRID = 16, 200  # levels and samples per axis of a surface
_FINE = 4000  # number of points at which a curve is drawn


def plot_samples(samples: Samples, ax: Axes | None = None) -> Figure:
    """Plot values over time: the interpolation, with the samples as dots if they are few.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
    """
    with paper_style():
        ax = new_figure(6.4, 2.8).add_subplot() if ax is None else ax
        times, values = samples.times, samples.values
        many = len(times) > _DOTTED
        if samples.kind == "hold":
            ax.step(times, values, where="post", color=BLUE)
        elif samples.kind == "cubic" and len(times) < _FINE:
            fine = np.union1d(times, np.linspace(*samples.span, _FINE))
            ax.plot(fine, samples(fine), color=BLUE)
        else:
            ax.plot(times, values, color=BLUE, linewidth=1.0 if many else 1.6)
        if not many:
            ax.plot(times, values, "o", color=VERMILION, markersize=3.5)
        source = samples.source
        ax.set_xlabel(source.get("time", "time"))
        ax.set_ylabel(_value_label(samples))
        ax.margins(x=0.01)
        return root_of(ax)


def plot_table(table: Table, ax: Axes | None = None) -> Figure:
    """Plot a table: its points, with the interpolation and, if defined, the extrapolation.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
    """
    source = table.source
    names = source.get("of", ["x", "y"] if len(table.axes) > 1 else "x")
    with paper_style():
        ax = new_figure(6.4, 2.8).add_subplot() if ax is None else ax
        if len(table.axes) > 1:
            _draw_surface(table, ax)
            ax.set_xlabel(names[0])
            ax.set_ylabel(names[1])
            return root_of(ax)
        points = table.points
        fine = np.union1d(points, np.linspace(points[0], points[-1], _FINE))
        ax.plot(fine, table(fine), color=BLUE)
        reach = _BEYOND * (points[-1] - points[0])
        for side, end, way in zip(table.outside, points[[0, -1]], (-1.0, 1.0), strict=True):
            if side != "refused":
                beyond = end + way * np.linspace(0.0, reach, _FINE)
                ax.plot(beyond, table(beyond), color=BLUE, linestyle="--", linewidth=1.0)
        if len(points) <= _DOTTED:
            ax.plot(points, table.values, "o", color=VERMILION, markersize=3.5)
        ax.set_xlabel(names)
        ax.set_ylabel(_value_label(table))
        return root_of(ax)


def _value_label(measured: Samples | Table) -> str:
    """Label of the values, with their unit."""
    unit = unit_label(measured.unit)
    name = measured.source.get("value", "value")
    return f"{name}  [{unit}]" if unit else name


def _draw_surface(table: Table, ax: Axes) -> None:
    """Plot contours of a surface, and its data points."""
    x, y = (np.union1d(a, np.linspace(a[0], a[-1], _FINE_GRID)) for a in table.axes)
    levels = ax.contourf(x, y, table(x[:, None], y[None, :]).T, levels=_LEVELS)
    bar = root_of(ax).colorbar(levels, ax=ax)
    bar.set_label(_value_label(table))
    known = np.meshgrid(*table.axes)
    if known[0].size <= _DOTTED:
        ax.plot(*known, "o", color=VERMILION, markersize=2.5, linestyle="none")
