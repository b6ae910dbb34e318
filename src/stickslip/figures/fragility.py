"""Plots of fragilities: the fraction of records that exceed a limit, against their scale."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.errors import DeclarationError
from stickslip.figures.drawing.maps import axis_text
from stickslip.figures.drawing.style import (
    legend_above,
    level_colours,
    new_figure,
    paper_style,
    root_of,
    symbol,
)

if TYPE_CHECKING:
    import xarray

    from stickslip.sweeps.fragility import Fragility

_MOST = 8  # largest number of curves that can be distinguished
_FINE = 400
# shift of the dots of other curves, as a fraction of the width, so that all are visible
_BESIDE = 0.006


def plot_fragility(found: Fragility, ax: Axes | None = None) -> Figure:
    """Plot the fractions as dots with their 95 % intervals, and the fitted distributions.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Draw into these axes.

    Raises
    ------
    DeclarationError
        If there are too many curves.
    """
    levels = list(found.levels(symbol))
    if len(levels) > _MOST:
        reason = f"{len(levels)} curves are too many to distinguish"
        raise DeclarationError("plot", reason, f"Use at most {_MOST} values, or .dataset")
    if ax is not None:
        _draw(ax, found, levels)
        return root_of(ax)
    with paper_style():
        figure = new_figure(6.4, 4.2)
        figure.suptitle(f"{found.title}\n{found.limit}", x=0.01, ha="left", fontsize=13)
        _draw(figure.add_subplot(), found, levels)
    return figure


def _draw(axes: Axes, found: Fragility, levels: list[tuple[str, xarray.Dataset]]) -> None:
    data, along = found.dataset, found.along
    x = data[along].values
    log = data[along].attrs.get("spacing") == "log"
    low, high = float(np.min(x)), float(np.max(x))
    fine = np.geomspace(low, high, _FINE) if log else np.linspace(low, high, _FINE)
    if log:
        axes.set_xscale("log")
    for i, ((said, part), colour) in enumerate(
        zip(levels, level_colours(len(levels)), strict=True)
    ):
        share, bottom, top = (part[name].values for name in ("share", "low", "high"))
        moved = _BESIDE * (i - 0.5 * (len(levels) - 1))
        at = x * (high / low) ** moved if log else x + moved * (high - low)
        reach = np.maximum(np.stack([share - bottom, top - share]), 0.0)
        axes.errorbar(at, share, reach, fmt="o", ms=4, mew=0.0, lw=0.8, color=colour, label=said)
        curve = _probability(fine, float(part["median"]), float(part["dispersion"]))
        axes.plot(fine, curve, color=colour)
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel(axis_text(data, [along]))
    axes.set_ylabel("fraction of records above the limit")
    if len(levels) > 1:
        legend_above(axes)


def _probability(x: np.ndarray, median: float, dispersion: float) -> np.ndarray:
    """The fitted distribution."""
    from scipy.special import ndtr

    with np.errstate(divide="ignore"):
        return ndtr(np.log(x / median) / dispersion)
