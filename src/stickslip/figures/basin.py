"""The map of basins of attraction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from stickslip.errors import DeclarationError
from stickslip.figures.drawing.cells import UNCERTAIN, cell_edges, hatch_cells, hatched_patch
from stickslip.figures.drawing.style import (
    STICK_SHADE,
    axis_label,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
    root_of,
)
from stickslip.model.entries.units import with_unit

if TYPE_CHECKING:
    import xarray

_OPAQUE = 0.7  # large areas in full colour would shout
_NOWHERE = {-3: ("undamped", "#D8D2C8"), -2: ("not settled", "#FFFFFF"), -1: ("stopped", "#777777")}


def plot_basin(basin: xarray.Dataset, ax: Axes | None = None) -> Figure:
    """Which attractor each initial state reaches; the legend names its speed or period. Hatched:
    not certified.

    Parameters
    ----------
    basin : xarray.Dataset
        Of a :class:`stickslip.Basin`, over two states.
    ax : matplotlib.axes.Axes, optional
        Draw into these axes.

    Raises
    ------
    DeclarationError
        If not two states vary.
    """
    if basin["attractor"].ndim != 2:
        raise DeclarationError(
            "over", f"{basin['attractor'].ndim} states vary", "A picture needs two"
        )
    if ax is not None:
        legend_above(ax, _draw(ax, basin))
        return root_of(ax)
    with paper_style():
        figure = new_figure(6.0, 4.6)
        handles = _draw(figure.add_subplot(), basin)
        figure.legend(handles=handles, loc="outside upper left", ncols=3)
    return figure


def _draw(axes: Axes, basin: xarray.Dataset) -> list[Patch]:
    """The section in colours; what they stand for."""
    labels = basin["attractor"]
    across, up = map(str, labels.dims)
    colours = [colour for _, colour in _NOWHERE.values()] + _colours(basin)
    edges = cell_edges(basin[across].values), cell_edges(basin[up].values)
    axes.pcolormesh(
        *edges,
        labels.values.T,
        cmap=ListedColormap(colours),
        norm=BoundaryNorm(np.arange(-3.5, len(colours) - 3), len(colours)),
        alpha=_OPAQUE,
        rasterized=True,
    )
    axes.set_xlabel(axis_label([across], str(basin[across].attrs.get("units", ""))))
    axes.set_ylabel(axis_label([up], str(basin[up].attrs.get("units", ""))))
    handles = [
        Patch(fc=(colours[code + 3], _OPAQUE), ec="#444444", lw=0.6, label=_name(basin, code))
        for code in np.unique(labels.values)
    ]
    bad = _uncertified(basin)
    if np.any(bad):
        hatch_cells(axes, edges, bad, UNCERTAIN)
        handles.append(hatched_patch(UNCERTAIN, "not certified"))
    return handles


def _colours(basin: xarray.Dataset) -> list[str]:
    """Rest is grey; what moves has the colours of lines, the most often reached first."""
    kinds = [str(kind) for kind in basin["kind"].values]
    moving = iter(line_colours(max(sum(kind != "rest" for kind in kinds), 1)))
    return [STICK_SHADE if kind == "rest" else next(moving) for kind in kinds]


def _uncertified(basin: xarray.Dataset) -> np.ndarray:
    """States that reach an attractor, but not for certain."""
    labels = basin["attractor"].values
    table = np.append(basin["certified"].values, True)
    return (labels >= 0) & ((basin["lacking"].values > 0) | ~table[np.maximum(labels, -1)])


def _name(basin: xarray.Dataset, code: int) -> str:
    """What a colour stands for."""
    if code < 0:
        return _NOWHERE[code][0]
    one = basin.isel(reached=code)
    kind = str(one["reached"].values).replace("_", " ")
    period = float(one["period"])
    speed = float(one["speed"])
    kind = (
        f"{one['stability'].item()} {kind}"
        if one["stability"].item() not in ("", "stable")
        else kind
    )
    if speed:
        return f"{kind}, speed {with_unit(speed, one['speed'].attrs['units'], 3)}"
    return (
        f"{kind}, period {with_unit(period, one['period'].attrs['units'], 3)}" if period else kind
    )
