"""The map of basins of attraction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from stickslip.errors import DeclarationError
from stickslip.figures.drawing.cells import (
    HATCHES,
    REGIMES,
    UNCERTAIN,
    cell_edges,
    hatch_cells,
    hatched_patch,
)
from stickslip.figures.drawing.style import (
    LINES,
    STICK_SHADE,
    axis_label,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
    root_of,
)
from stickslip.model.entries.units import with_unit
from stickslip.motion.outcome import Outcome
from stickslip.sweeps.basin import ON_ITS_WAY, ON_NONE, PARTING, SLOWLY

if TYPE_CHECKING:
    import xarray

_OPAQUE = 0.7  # large areas in full colour would dominate
_UNSETTLED = {
    ON_ITS_WAY: Outcome.NOT_SETTLED,
    PARTING: Outcome.IRREGULAR,
    SLOWLY: Outcome.SLOW,
}  # coloured and hatched as in maps
_OTHERS = {"undamped": "#D8D2C8", "stopped": "#777777", "not computed": "#FFFFFF"}


def plot_basin(basin: xarray.Dataset, ax: Axes | None = None) -> Figure:
    """Plot the attractor reached by each initial state; the legend contains its speed or period.
    Hatched: not certified, or, as in maps, not converged.

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
        raise DeclarationError("over", f"{basin['attractor'].ndim} states vary", "Select two")
    if ax is not None:
        legend_above(ax, _draw(ax, basin))
        return root_of(ax)
    with paper_style():
        figure = new_figure(6.0, 4.6)
        handles = _draw(figure.add_subplot(), basin)
        figure.legend(handles=handles, loc="outside upper left", ncols=3)
    return figure


def _draw(axes: Axes, basin: xarray.Dataset) -> list[Patch]:
    """Plot the section in colours; return the entries of the legend."""
    labels = basin["attractor"]
    across, up = map(str, labels.dims)
    first = min(ON_NONE)
    colours = [_colour_of(code) for code in range(first, 0)] + _colours(basin)
    edges = cell_edges(basin[across].values), cell_edges(basin[up].values)
    axes.pcolormesh(
        *edges,
        labels.values.T,
        cmap=ListedColormap(colours),
        norm=BoundaryNorm(np.arange(first - 0.5, len(colours) + first), len(colours)),
        alpha=_OPAQUE,
        rasterized=True,
    )
    axes.set_xlabel(axis_label([across], str(basin[across].attrs.get("units", ""))))
    axes.set_ylabel(axis_label([up], str(basin[up].attrs.get("units", ""))))
    handles = list[Patch]()
    for code in np.unique(labels.values).tolist():
        colour = colours[code - first], _OPAQUE
        if code in _UNSETTLED:
            hatch = HATCHES[_UNSETTLED[code]]
            hatch_cells(axes, edges, labels.values == code, hatch)
            handles.append(hatched_patch(hatch, _name(basin, code), colour))
            continue
        patch = Patch(fc=colour, ec="#444444", lw=0.6, label=_name(basin, code))
        handles.append(patch)
    bad = _uncertified(basin)
    if np.any(bad):
        hatch_cells(axes, edges, bad, UNCERTAIN)
        handles.append(hatched_patch(UNCERTAIN, "not certified"))
    return handles


def _colour_of(code: int) -> str:
    """Colour of motions that are on no attractor."""
    return REGIMES[_UNSETTLED[code]] if code in _UNSETTLED else _OTHERS[ON_NONE[code]]


def _colours(basin: xarray.Dataset) -> list[str]:
    """Colours: grey for rest; for other attractors, the most often reached first, the colours of
    lines that are not used for motions that have not settled."""
    kinds = [str(kind) for kind in basin["kind"].values]
    taken = {_colour_of(c) for c in _UNSETTLED if np.any(basin["attractor"].values == c)}
    count = max(sum(kind != "rest" for kind in kinds), 1)
    free = [colour for colour in LINES if colour not in taken]
    moving = iter(free if count <= len(free) else line_colours(count))
    return [STICK_SHADE if kind == "rest" else next(moving) for kind in kinds]


def _uncertified(basin: xarray.Dataset) -> np.ndarray:
    """States that reach an attractor without a certificate."""
    labels = basin["attractor"].values
    table = np.append(basin["certified"].values.astype(bool), True)
    return (labels >= 0) & ((basin["lacking"].values > 0) | ~table[np.maximum(labels, -1)])


def _name(basin: xarray.Dataset, code: int) -> str:
    """Legend entry of a colour."""
    if code < 0:
        said = ON_NONE[code]
        return f"not converged: {said}" if code in _UNSETTLED else said
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
