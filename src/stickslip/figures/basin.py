"""The map of basins of attraction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from stickslip.figures.style import (
    STICK_SHADE,
    axis_label,
    line_colours,
    new_figure,
    paper_style,
)
from stickslip.units import with_unit

if TYPE_CHECKING:
    import xarray

OPAQUE = 0.7  # large areas in full colour would shout
STOPPED, ON_ITS_WAY = "#777777", "#FFFFFF"


def plot_basin(basin: xarray.Dataset) -> Figure:
    """Which attractor each initial state reaches; the legend names its speed or period.

    Parameters
    ----------
    basin : xarray.Dataset
        From :func:`stickslip.orbits.basin.basin`, over two states.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from stickslip.errors import DeclarationError

    labels = basin["attractor"]
    if labels.ndim != 2:
        raise DeclarationError("over", f"{labels.ndim} states vary", "A map needs two")
    across, up = map(str, labels.dims)
    colours = [ON_ITS_WAY, STOPPED, *_colours(basin)]
    with paper_style():
        figure = new_figure(6.0, 4.6)
        axes = figure.add_subplot()
        norm = BoundaryNorm(np.arange(-2.5, len(colours) - 2), len(colours))
        axes.pcolormesh(
            basin[across].values,
            basin[up].values,
            labels.values.T,
            cmap=ListedColormap(colours),
            norm=norm,
            shading="nearest",
            alpha=OPAQUE,
            rasterized=True,
        )
        axes.set_xlabel(axis_label([across], str(basin[across].attrs.get("units", ""))))
        axes.set_ylabel(axis_label([up], str(basin[up].attrs.get("units", ""))))
        shown = [(code, _name(basin, code)) for code in np.unique(labels.values)]
        handles = [Patch(fc=(colours[code + 2], OPAQUE), ec="#444444", lw=0.6, label=name) for code, name in shown]
        figure.legend(handles=handles, loc="outside upper left", ncols=3)
    return figure


def _colours(basin: xarray.Dataset) -> list[str]:
    """Rest is grey; what moves has the colours of lines, the most often reached first."""
    kinds = [str(kind) for kind in basin["kind"].values]
    moving = iter(line_colours(max(sum(kind != "rest" for kind in kinds), 1)))
    return [STICK_SHADE if kind == "rest" else next(moving) for kind in kinds]


def _name(basin: xarray.Dataset, code: int) -> str:
    """What a colour stands for."""
    if code < 0:
        return "stopped" if code == -1 else "not arrived"
    one = basin.isel(reached=code)
    kind, period, speed = str(one["reached"].values).replace("_", " "), float(one["period"]), float(one["speed"])
    if speed:
        return f"{kind}, speed {with_unit(speed, one['speed'].attrs['units'], 3)}"
    return f"{kind}, period {with_unit(period, one['period'].attrs['units'], 3)}" if period else kind
