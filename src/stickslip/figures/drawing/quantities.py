"""Selected quantities of a result over its first dimension, such as time."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator

from stickslip.display.symbols import is_word
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.figures.drawing.style import (
    axis_label,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
    powers_in_labels,
    root_of,
    symbol,
)
from stickslip.figures.drawing.thinning import thin
from stickslip.model.entries.units import unit_label

if TYPE_CHECKING:
    import xarray

# inches
_WIDTH = 7.2
_ROW = 1.9
_EXTRA = 0.8
_LETTERS = 24  # letters per line of the label of a panel


def plot_quantities(
    data: xarray.Dataset, names: Sequence[str], along: str, ax: Axes | None = None
) -> Figure:
    """Plot quantities over a dimension of a dataset, one panel each, or together in given axes.

    Parameters
    ----------
    names : sequence of str
        Variables over the dimension; a variable with a second dimension is plotted as several
        lines.
    along : str
        The dimension.
    ax : matplotlib.axes.Axes, optional

    Raises
    ------
    DeclarationError
        If there is no such quantity.
    """
    known = [str(n) for n in data.data_vars if along in data[n].dims and _drawable(data[n])]
    for name in names:
        if name not in known:
            raise DeclarationError(
                "quantities",
                f"unknown quantity '{short(str(name))}'",
                suggestion(str(name), known),
            )
    if ax is not None:
        colours = line_colours(len(names))
        for name, colour in zip(names, colours, strict=True):
            _draw(ax, data, name, along, colour)
        _label(ax, data, names)
        ax.set_xlabel(_horizontal(data, along))
        if len(names) > 1:
            legend_above(ax)
        return root_of(ax)
    with paper_style():
        figure = new_figure(_WIDTH, _ROW * len(names) + _EXTRA)
        panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for panel, name in zip(panels, names, strict=True):
            _draw(panel, data, name, along, None)
            _label(panel, data, [name])
        panels[-1].set_xlabel(_horizontal(data, along))
        panels[-1].margins(x=0.0)
        figure.align_ylabels(panels)
        powers_in_labels(figure)
    return figure


def _drawable(values: xarray.DataArray) -> bool:
    """Return whether a variable is numeric, over one or two dimensions."""
    return values.dtype.kind in "fiub" and values.ndim <= 2


def _draw(axes: Axes, data: xarray.Dataset, name: str, along: str, colour: str | None) -> None:
    """Plot the lines of a quantity; codes are plotted in steps, with their words at the axis."""
    values = data[name].transpose(along, ...).values.astype(float)
    across = _coordinate(data, along)
    lines = values.reshape(len(values), -1)
    coded = "flag_meanings" in data[name].attrs
    colours = line_colours(lines.shape[1]) if colour is None else [colour] * lines.shape[1]
    for k, (line, shade) in enumerate(zip(lines.T, colours, strict=True)):
        label = symbol(name) if k == 0 else None
        if _named(data, along):
            axes.plot(across, line, "o", color=shade, label=label)
        elif coded:
            axes.step(across, line, where="post", color=shade, label=label)
        elif np.all(np.diff(across) >= 0.0):
            x, drawn = thin(across, {name: line})
            axes.plot(x, drawn[name], color=shade, label=label)
        else:
            axes.plot(across, line, color=shade, label=label)
    if _named(data, along):
        axes.set_xticks(across, [str(word).replace("_", " ") for word in data[along].values])
    if coded:
        axes.yaxis.set_major_locator(FixedLocator(list(data[name].attrs["flag_values"])))
        words = data[name].attrs["flag_meanings"].split()
        axes.set_yticklabels([word.replace("_", " ") for word in words])


def _named(data: xarray.Dataset, along: str) -> bool:
    """Return whether the dimension has names instead of numbers."""
    return along in data.coords and data[along].dtype.kind not in "fiub"


def _coordinate(data: xarray.Dataset, along: str) -> np.ndarray:
    """Values along the dimension; indices, if it has no coordinate."""
    if along in data.coords and not _named(data, along):
        return data[along].values.astype(float)
    return np.arange(data.sizes[along], dtype=float)


def _horizontal(data: xarray.Dataset, along: str) -> str:
    """The label of the horizontal axis."""
    unit = str(data[along].attrs.get("units", "1")) if along in data.coords else "1"
    if along == "time":
        label = unit_label(unit)
        return "time $t$" + (f"  [{label}]" if label else "")
    has_values = along in data.coords and not _named(data, along)
    return axis_label([along], unit) if has_values else along


def _label(axes: Axes, data: xarray.Dataset, names: Sequence[str]) -> None:
    """Symbols and the unit of quantities that share one."""
    units = {str(data[name].attrs.get("units", "1")) for name in names}
    unit = units.pop() if len(units) == 1 else "1"
    if len(names) > 1 or not is_word(names[0].removeprefix("d_")):
        axes.set_ylabel(axis_label(names, unit))
        return
    # A word is not a symbol: its meaning is the better label.
    meaning = fill(str(data[names[0]].attrs.get("long_name", names[0].replace("_", " "))), _LETTERS)
    label = unit_label(unit)
    axes.set_ylabel(meaning + (f"  [{label}]" if label else ""))
