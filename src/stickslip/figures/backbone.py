"""Plots of backbones: frequency and damping against the amplitude."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from stickslip.errors import DeclarationError, short, suggestion
from stickslip.figures.drawing.style import (
    STICK_LINE,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
    powers_in_labels,
    root_of,
    symbol_or_formula,
)
from stickslip.model.entries.units import unit_label

if TYPE_CHECKING:
    from stickslip.orbits.studies.backbone import Backbone

_WIDTH = 6.4  # inches
_HEIGHT = 2.7  # inches of a panel
_EXTRA = 0.7
_WIDE = 30.0  # ratio of damping ratios above which their axis is logarithmic
_DECADES = 2.5  # decades of amplitudes up to which numbers between powers of ten are labelled
_NOTHING = 1e-9  # relative to the largest damping, or 1: smaller values are rounding errors
_SYMBOLS = {"frequency": "$\\omega$", "damping": "$D$"}


def plot_backbone(
    found: Backbone, names: Sequence[str] | None = None, *, ax: Axes | None = None
) -> Figure:
    """Quantities of a backbone against the amplitude, whose axis has powers of ten.

    The axis of the damping, too, is logarithmic if it spans more than a decade and a half. The line
    is thin where no contact slips.

    Parameters
    ----------
    names : sequence of str, optional
        Variables of the points; by default ``frequency``, and ``damping`` below.
    ax : matplotlib.axes.Axes, optional
        Existing axes to draw the first of them into.

    Raises
    ------
    DeclarationError
        If there is no such quantity.
    """
    known = [str(name) for name in found.dataset.data_vars]
    for name in names or ():
        if name not in known:
            raise DeclarationError(
                "quantities",
                f"unknown quantity '{short(str(name))}'",
                suggestion(str(name), known),
            )
    shown = list(names or ("frequency", "damping"))
    if ax is not None:
        _draw(ax, found, shown[0])
        _label_amplitude(ax, found)
        return root_of(ax)
    with paper_style():
        figure = new_figure(_WIDTH, _HEIGHT * len(shown) + _EXTRA)
        panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(panels, shown, strict=True):
            _draw(axes, found, name)
        _label_amplitude(panels[-1], found)
        if handles := _handles(found, shown):
            legend_above(panels[0], handles)
        powers_in_labels(figure)
        figure.align_ylabels(panels)
    return figure


def _draw(axes: Axes, found: Backbone, name: str) -> None:
    """Plot one quantity against the amplitude."""
    data = found.dataset
    x, y = found.amplitude, data[name].values.astype(float)
    slips = data["slips"].values != 0
    colour = line_colours(1)[0]
    if name == "damping":
        axes.axhline(0.0, color=STICK_LINE, lw=0.5)
        some = np.abs(y) > _NOTHING * max(1.0, float(np.max(np.abs(y))))
        if np.all(some) and np.all(y > 0.0) and np.max(y) > _WIDE * np.min(y):
            axes.set_yscale("log")
    elif name == "frequency":
        axes.axhline(found.linear_frequency, color=STICK_LINE, lw=0.8, ls=(0, (1, 2)))
    part = slips[:-1] | slips[1:]
    for here, width in ((part, 1.6), (~part, 0.9)):
        for i in np.flatnonzero(here):
            axes.plot(x[i : i + 2], y[i : i + 2], color=colour, lw=width)
    axes.plot(x, y, linestyle="none", marker="o", ms=2.5, color=colour)
    unit = unit_label(str(data[name].attrs.get("units", "")).removeprefix("1"))
    said = str(data[name].attrs.get("long_name", name))
    said = f"{said} {_SYMBOLS[name]}" if name in _SYMBOLS else said
    axes.set_ylabel(f"{said}  [{unit}]" if unit else said)


def _label_amplitude(axes: Axes, found: Backbone) -> None:
    unit = unit_label(str(found.dataset["amplitude"].attrs.get("units", "")).removeprefix("1"))
    said = f"amplitude of {symbol_or_formula(found.coordinate)}"
    axes.set_xscale("log")
    if found.amplitude[-1] < 10.0**_DECADES * found.amplitude[0]:
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel(f"{said}  [{unit}]" if unit else said)
    if len(found.amplitude) > 1:
        axes.set_xlim(float(found.amplitude[0]), float(found.amplitude[-1]))


def _handles(found: Backbone, names: Sequence[str]) -> list[Line2D]:
    """Legend entries of the kinds of lines that occur."""
    slips = found.dataset["slips"].values != 0
    lines = [
        ("frequency" in names, f"linear mode {found.mode}", STICK_LINE, (0, (1, 2)), 0.8),
        (bool(np.any(slips) and np.any(~slips)), "a contact slips", None, "-", 1.6),
        (bool(np.any(~slips) and found.system.contacts), "no contact slips", None, "-", 0.9),
    ]
    return [
        Line2D([], [], color=colour or line_colours(1)[0], linestyle=style, lw=width, label=text)
        for there, text, colour, style, width in lines
        if there
    ]
