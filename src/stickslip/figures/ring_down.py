"""Plots of ring-downs: the motion with its envelope, and frequency and damping over the
amplitude."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from stickslip.arrays import Array
from stickslip.figures.drawing.style import (
    BLUE,
    ORANGE,
    STICK_LINE,
    VERMILION,
    legend_above,
    new_figure,
    paper_style,
    powers_in_labels,
    root_of,
    symbol_or_formula,
)
from stickslip.model.entries.units import unit_label

if TYPE_CHECKING:
    from stickslip.orbits.studies.ring_down import RingDown

_MANY = 60  # number of turning points up to which they are drawn as points
_PAD = 0.06  # margin of an axis, as a fraction of its range
_EVEN = 1e-6  # frequencies that differ by less, relative to them, are regarded as equal
_DECADES = 10.0  # a range of positive values this wide has a logarithmic axis


def plot_ring_down(ring_down: RingDown, *, ax: Axes | None = None) -> Figure:
    """The motion of the coordinate with its envelope; below, frequency and damping ratio of each
    half-cycle against the amplitude, if there are any.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Draw the motion into these axes.
    """
    if ax is not None:
        _motion(ax, ring_down)
        return root_of(ax)
    with paper_style():
        figure = new_figure(7.2, 5.8)
        figure.suptitle(ring_down.title, x=0.01, ha="left", fontsize=13)
        if not len(ring_down):
            _motion(figure.add_subplot(), ring_down)
            return figure
        grid = figure.add_gridspec(2, 2, height_ratios=(1.15, 1.0))
        _motion(figure.add_subplot(grid[0, :]), ring_down)
        _over_amplitude(figure.add_subplot(grid[1, 0]), ring_down, "amplitude", "frequency")
        _over_amplitude(figure.add_subplot(grid[1, 1]), ring_down, "damping_amplitude", "damping")
        powers_in_labels(figure)
    return figure


def _motion(axes: Axes, ring_down: RingDown) -> None:
    """Plot the coordinate over time, its turning points, and the lines that connect those of each
    side."""
    data = ring_down.dataset
    time, x = data["sample_time"].values, data["sample_position"].values
    at, turn = data["turn_time"].values, data["turn_position"].values
    axes.plot(time, x, color=BLUE, lw=0.9, label="motion")
    for side in (0, 1) if len(turn) > 2 else ():
        label = "envelope" if side == 0 else None
        axes.plot(at[side::2], turn[side::2], color=VERMILION, lw=1.3, label=label)
    if len(turn):
        size = 4 if len(turn) <= _MANY else 2
        axes.plot(at, turn, "o", ms=size, color=STICK_LINE, mew=0.0, label="turning point")
    if ring_down.stops:
        axes.axvline(at[-1], color=ORANGE, lw=1.1, ls=(0, (4, 2)), label="comes to rest")
    axes.set_xlim(float(time[0]), float(time[-1]))
    axes.set_xlabel(_label(ring_down, "sample_time", "$t$"))
    axes.set_ylabel(_label(ring_down, "sample_position", symbol_or_formula(ring_down.coordinate)))
    legend_above(axes, right=True)


def _over_amplitude(axes: Axes, ring_down: RingDown, over: str, name: str) -> None:
    """A quantity of the half-cycles against the amplitude, on a logarithmic axis."""
    data = ring_down.dataset
    amplitude, value = data[over].values, data[name].values
    known = np.isfinite(amplitude) & np.isfinite(value)
    amplitude, value = amplitude[known], value[known]
    what = symbol_or_formula(ring_down.coordinate)
    axes.set_xlabel(_label(ring_down, "amplitude", f"amplitude of {what}"))
    axes.set_ylabel(_label(ring_down, name, str(data[name].attrs["long_name"])))
    if not len(value):
        return
    axes.plot(amplitude, value, "-o", color=BLUE, lw=0.9, ms=4 if len(value) <= _MANY else 2.5)
    if _wide(amplitude):
        axes.set_xscale("log")
        _powers(axes.xaxis, amplitude)
    if name == "damping" and np.all(value > 0.0) and _wide(value):
        axes.set_yscale("log")
        _powers(axes.yaxis, value)
    elif np.ptp(value) <= _EVEN * np.max(np.abs(value)):  # rounding errors are not a curve
        middle = float(np.mean(value))
        axes.set_ylim(*sorted((0.9 * middle, 1.1 * middle)) if middle else (-1.0, 1.0))
    elif name == "damping" and np.all(value >= 0.0):
        axes.set_ylim(0.0, (1.0 + _PAD) * float(np.max(value)))


def _powers(axis: Axis, values: Array) -> None:
    """At least two powers of ten on a logarithmic axis, and no other numbers."""
    axis.set_minor_formatter(NullFormatter())
    low, high = np.log10(np.min(values)) - _PAD, np.log10(np.max(values)) + _PAD
    if np.floor(high) - np.ceil(low) < 1.0:
        below, above = np.floor(low), np.ceil(high)
        low, high = (below, high) if low - below < above - high else (low, above)
    axis.set_view_interval(10.0 ** (low - 1e-3), 10.0 ** (high + 1e-3), ignore=True)


def _wide(values: Array) -> bool:
    """Return whether positive values span more than a decade."""
    return bool(np.min(values) > 0.0 and np.max(values) > _DECADES * np.min(values))


def _label(ring_down: RingDown, name: str, text: str) -> str:
    unit = str(ring_down[name].attrs.get("units", "1"))
    return text if unit == "1" else f"{text}  [{unit_label(unit)}]"
