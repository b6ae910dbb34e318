"""Plots of maps: lines over one axis, maps over two axes (or a line for each value of a short one),
small multiples over three, dots for samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle
from textwrap import fill
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.figures.drawing.cells import (
    COLOURS,
    HATCHES,
    REGIMES,
    UNCERTAIN,
    cell_edges,
    doubtful,
    fill_cells,
    hatch_cells,
    hatched_patch,
)
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
    SKY,
    STICK_LINE,
    STICK_SHADE,
    VERMILION,
    axis_label,
    legend_above,
    level_colours,
    new_figure,
    paper_style,
    root_of,
)
from stickslip.model.entries.units import unit_label, with_unit
from stickslip.motion.outcome import Outcome
from stickslip.sweeps.request.axes import SAMPLES
from stickslip.sweeps.request.carry import DIRECTION
from stickslip.sweeps.request.measures import MISSING
from stickslip.sweeps.request.plan import INTERPOLATED, NOT_COMPUTED
from stickslip.sweeps.request.scales import ColourScale, colour_scale

if TYPE_CHECKING:
    import xarray

_WIDTH = 5.2  # width of a map in inches
_HEIGHT = 4.2  # height of a map in inches
_FEW_POINTS = 80  # number of points of a line up to which each one is marked
_LETTERS = 9  # number of characters of a legend per inch
_MULTIPLES = 6  # largest number of small multiples
_LEVELS = 6  # number of values of an axis up to which lines are plotted instead of a map
_DASHES: dict[float, Any] = {1.0: "-", -1.0: (0, (4, 2))}  # of sweeps up and down
# Ends of a colour bar, if there are values below its range, and above it.
_EXTEND: dict[tuple[bool, bool], Literal["neither", "min", "max", "both"]] = {
    (False, False): "neither",
    (True, False): "min",
    (False, True): "max",
    (True, True): "both",
}
# Colours of points without a value, one for each reason.
_GREYS = (STICK_SHADE, "#B9B9B9", "#8F8F8F", "#D8D2C8", "#6E6E6E")
_MARKS = {Outcome.IRREGULAR: "X", Outcome.SLOW: "v", Outcome.NOT_SETTLED: "s"}  # on lines
# Colours of outcomes that have no colour of their own.
_OTHERS = ("#8F8F8F", "#F0E442", "#5B3A8E", "#B9B9B9", "#A0522D", "#3A3A3A", SKY)


def plot_sweep(
    data: xarray.Dataset, measures: Sequence[str] | None = None, ax: Axes | None = None
) -> Figure:
    """Plot a map.

    Points without a certificate are hatched (on a line, hollow); the legend names the criterion
    that failed, or the outcome: irregular, slow, or not settled. Points without a value of the
    measure are grey; the legend gives the reason for each grey. White points were not computed. The
    colour scale starts at 0 for nonnegative measures, and is centred at 0 for measures of both
    signs.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset of a :class:`stickslip.Map`, with one, two or three axes.
    measures : sequence of str, optional
        Measures to plot, or ``"outcome"``; by default all measures.
    ax : matplotlib.axes.Axes, optional
        Axes for a map over one or two axes, of which only the first measure is plotted.

    Raises
    ------
    DeclarationError
        If a measure is unknown, or there are more than three axes.
    """
    names = chosen_measures(data, measures)
    dimensions = list(data["outcome"].dims)
    lined = _over_levels(data, names)
    if ax is not None and (lined or len(dimensions) <= 2):
        _draw_into(ax, data, names)
        return root_of(ax)
    with paper_style():
        if len(dimensions) == 1 or lined:
            return _lines(data, names)
        if len(dimensions) == 2:
            return _maps(data, names)
        if len(dimensions) == 3:
            return _multiples(data, names)
    count = len(dimensions)
    raise DeclarationError(
        "plot",
        f"a map over {count} axes cannot be plotted",
        "Select values of some axes: data.sel(P=1)",
    )


# -- one axis --------------------------------------------------------------------------------------


def _lines(data: xarray.Dataset, names: list[str]) -> Figure:
    """Panels of lines over the longest axis; dots for samples of two or more names."""
    along = _coordinates(data, _longest(data))
    if len(along) > 1 and data[along[0]].attrs.get("spacing") in SAMPLES:
        return _dots(data, names, along[:2])
    parts, keys = _lines_of(data)
    figure = new_figure(6.4, 0.9 + (3.0 if keys else 2.2) * len(names))
    figure.suptitle(map_title(data), x=0.01, ha="left", fontsize=13)
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, names, strict=True):
        for part, style in parts:
            _line(axes, part, _codes(data, names), name, along[0], **style)
    _scale(panels[-1], data, along[0], "x")
    panels[-1].set_xlabel(axis_text(data, along[:1]))
    if marks := [*keys, *_gap_marks(data, names)]:
        legend_above(panels[0], marks, right=not keys)
    return figure


def _longest(data: xarray.Dataset) -> str:
    """The horizontal axis of line plots: the dimension with the most values."""
    sizes = {str(d): data.sizes[d] for d in data["outcome"].dims if d != DIRECTION}
    return max(sizes, key=sizes.__getitem__) if sizes else DIRECTION


def _over_levels(data: xarray.Dataset, names: Sequence[str]) -> bool:
    """Return whether the second axis is short enough to plot a line for each of its values.

    Samples and outcomes are not plotted as lines.
    """
    along = _longest(data)
    others = [d for d in data["outcome"].dims if d not in (along, DIRECTION)]
    sampled = data[_coordinates(data, along)[0]].attrs.get("spacing") in SAMPLES
    if data["outcome"].ndim < 2 or sampled or "outcome" in names or len(others) > 1:
        return False
    return all(data.sizes[d] <= _LEVELS < data.sizes[along] for d in others)


def _lines_of(data: xarray.Dataset) -> tuple[list[tuple[Any, dict[str, Any]]], list[Line2D]]:
    """Parts of the data over the longest axis, with line styles, and legend entries. Values of the
    second axis have different colours; a sweep down is dashed."""
    along = _longest(data)
    others = [str(d) for d in data["outcome"].dims if d not in (along, DIRECTION)]
    both_ways = DIRECTION in data["outcome"].dims and along != DIRECTION
    level = others[0] if others else None
    colours = [BLUE] if level is None else level_colours(data.sizes[level])
    directions = data[DIRECTION].values.tolist() if both_ways else [1.0]
    parts = list[tuple[Any, dict[str, Any]]]()
    for i, colour in enumerate(colours):
        for k, direction in enumerate(directions):
            part = data.isel({d: i for d in others} | ({DIRECTION: k} if both_ways else {}))
            shade = VERMILION if level is None and direction < 0.0 else colour
            parts.append((part, {"color": shade, "linestyle": _DASHES[direction]}))
    marks = list[Line2D]()
    if level is not None:
        name = _coordinates(data, level)[0]
        symbol = axis_label([name], "")
        for value, colour in zip(data[name].values.tolist(), colours, strict=True):
            text = f"{symbol} = {with_unit(value, axis_unit(data, name), 4)}"
            marks.append(Line2D([], [], color=colour, label=text))
    if both_ways:
        shades = [STICK_LINE] * 2 if level is not None else [BLUE, VERMILION]
        for (direction, dashes), colour in zip(_DASHES.items(), shades, strict=True):
            text = "up" if direction > 0.0 else "down"
            marks.append(Line2D([], [], color=colour, linestyle=dashes, label=text))
    return parts, marks


def _line(
    axes: Axes,
    data: xarray.Dataset,
    codes: Sequence[int],
    name: str,
    along: str,
    color: str = BLUE,
    linestyle: Any = "-",
) -> None:
    """Plot one measure over one axis. Points without a certificate are hollow, and points without a
    value are marked by ticks at the bottom.

    Parameters
    ----------
    data : xarray.Dataset
        A map over one axis.
    codes : sequence of int
        Outcomes of points without a value, in the complete figure.
    name, along : str
        The measure, and the horizontal axis.
    color, linestyle
        Style of the line.
    """
    x = data[along].values
    order = np.argsort(x)
    computed = data["outcome"].values[order] >= 0
    scattered = data[along].attrs.get("spacing") in SAMPLES
    marker = "." if len(x) <= _FEW_POINTS or scattered else ""
    line = "none" if scattered else linestyle
    values = np.where(computed, data[name].values[order], np.nan)
    axes.plot(x[order], values, color=color, marker=marker, linestyle=line)
    for kind, bad in doubtful(data, name).items():
        here = bad[order]
        marker = _marker(kind)
        axes.plot(x[order][here], values[here], marker, mfc="white", mec=VERMILION, ms=5, zorder=3)
    below = axes.get_xaxis_transform()
    for colour, here in _gaps(data, codes, name).items():
        level = np.full(np.count_nonzero(here), 0.03)
        axes.plot(x[here], level, "|", color=colour, ms=8, mew=2, transform=below)
    axes.set_ylabel(measure_label(data, name, 26))


def _gap_marks(data: xarray.Dataset, names: list[str]) -> list[Line2D]:
    """Legend entries of hollow points and ticks."""
    style: dict[str, Any] = {"linestyle": "none", "marker": "|", "ms": 8, "mew": 2}
    reasons = _reasons(data, names).items()
    marks = [Line2D([], [], color=colour, label=text, **style) for colour, text in reasons]
    return marks + _hollow(data, names, "white")


def _draw_into(axes: Axes, data: xarray.Dataset, names: list[str]) -> None:
    """Plot the first measure into given axes."""
    if data["outcome"].ndim == 2 and not _over_levels(data, names):
        draw_map(axes, data, names[0])
        return
    along = _coordinates(data, _longest(data))[:1]
    parts, keys = _lines_of(data)
    for part, style in parts:
        _line(axes, part, _codes(data, names[:1]), names[0], along[0], **style)
    _scale(axes, data, along[0], "x")
    axes.set_xlabel(axis_text(data, along))
    if keys:
        legend_above(axes, keys)
    if marks := _gap_marks(data, names[:1]):
        room = int(_LETTERS * root_of(axes).get_figwidth() * axes.get_position().width)
        for mark in marks:
            mark.set_label(fill(str(mark.get_label()), room))
        legend_above(axes, marks, right=True)


def _marker(hatch: str) -> str:
    """The marker in line plots that corresponds to a hatching of cells."""
    return next((_MARKS[kind] for kind, own in HATCHES.items() if own == hatch), "o")


def _hollow(data: xarray.Dataset, names: list[str], fill_colour: str) -> list[Line2D]:
    """Legend entries of points without a certificate."""
    style: dict[str, Any] = {"linestyle": "none", "mfc": fill_colour, "mec": VERMILION, "ms": 5}
    doubts = _doubts(data, names).items()
    return [Line2D([], [], marker=_marker(kind), label=text, **style) for kind, text in doubts]


def _dots(data: xarray.Dataset, names: list[str], along: list[str]) -> Figure:
    """Panels of samples as dots in the plane of two names, coloured by the measure."""
    figure, panels = _panels(data, names)
    x, y = (data[name].values for name in along)
    computed = data["outcome"].values >= 0
    for axes, name in zip(panels, names, strict=True):
        shown = computed & np.isfinite(data[name].values)
        for colour, here in _gaps(data, _codes(data, names), name).items():
            axes.plot(x[here], y[here], ".", color=colour, ms=6)
        size = max(6.0, min(40.0, 2e4 / max(len(x), 1)))  # area in points²: fewer dots are larger
        scale = colour_scale(name, data[name].values[shown], data[name].attrs)
        style: dict[str, Any] = {"cmap": COLOURS[scale.kind], "vmin": scale.low, "vmax": scale.high}
        dots = axes.scatter(x[shown], y[shown], c=data[name].values[shown], s=size, lw=0, **style)
        for kind, bad in doubtful(data, name).items():
            style = {"mfc": "none", "mec": VERMILION, "ms": math.sqrt(size) + 2}
            axes.plot(x[bad], y[bad], _marker(kind), **style)
        figure.colorbar(dots, ax=axes, label=measure_label(data, name))
        _frame(axes, data, along[0], along[1])
    marks = [
        Line2D([], [], linestyle="none", marker=".", ms=6, color=colour, label=text)
        for colour, text in _reasons(data, names).items()
    ]
    marks += _hollow(data, names, "none")
    if marks:
        figure.legend(handles=marks, loc="outside lower left")
    return figure


# -- two and three axes ----------------------------------------------------------------------------


def _maps(data: xarray.Dataset, names: list[str]) -> Figure:
    """One panel for each measure."""
    figure, panels = _panels(data, names)
    for axes, name in zip(panels, names, strict=True):
        draw_map(axes, data, name)
    _legend(figure, data, names)
    return figure


def _multiples(data: xarray.Dataset, names: list[str]) -> Figure:
    """Plot small multiples of the first measure: maps over two axes, for values of the shortest
    axis."""
    third = str(min(data["outcome"].dims, key=lambda d: data.sizes[d]))
    count = data.sizes[third]
    picked = np.unique(np.linspace(0, count - 1, min(count, _MULTIPLES)).round().astype(int))
    name = names[0]
    along = _coordinates(data, third)[0]
    figure, panels = _panels(data, [name] * len(picked))
    scale = _scale_of(data, name) if name != "outcome" else None
    for axes, index in zip(panels, picked, strict=True):
        part = data.isel({third: int(index)})
        draw_map(axes, part, name, scale, bar=bool(index == picked[-1]))
        value = float(part[along])
        if third == DIRECTION:
            axes.set_title("up" if value > 0.0 else "down")
        else:
            unit = unit_label(axis_unit(data, along))
            axes.set_title(f"{axis_label([along], '')} = {value:.4g} {unit}")
    _legend(figure, data, [name])
    return figure


def draw_map(
    axes: Axes,
    data: xarray.Dataset,
    name: str,
    scale: ColourScale | None = None,
    bar: bool = True,
) -> None:
    """Plot one measure of a map over two axes; cells without a certificate are hatched.

    Parameters
    ----------
    data : xarray.Dataset
        A map over two axes.
    name : str
        A measure or ``"outcome"``.
    scale : ColourScale, optional
        Colour scale; by default derived from the values.
    bar : bool
        Whether to add a colour bar.
    """
    first, second = (_coordinates(data, str(d))[0] for d in data["outcome"].dims)
    orders = [np.argsort(data[n].values) for n in (first, second)]
    sort = np.ix_(*orders)
    along, up = (
        cell_edges(data[n].values[order], data[n].attrs.get("spacing") == "log")
        for n, order in zip((first, second), orders, strict=True)
    )
    edges = along, up
    values = data[name].values[sort]
    outcome = data["outcome"].values[sort]
    if name == "outcome":
        _draw_outcomes(axes, edges, data, outcome, bar)
    else:
        for colour, here in _gaps(data, _codes(data, [name]), name).items():
            shade = np.where(here[sort], 1.0, np.nan)
            axes.pcolormesh(*edges, shade.T, cmap=ListedColormap([colour]), rasterized=True)
        scale = scale or _scale_of(data, name)
        mesh = fill_cells(axes, edges, np.where(outcome != NOT_COMPUTED, values, np.nan), scale)
        if bar:
            least = np.nanmin(values, initial=scale.low)
            most = np.nanmax(values, initial=scale.high)
            beyond = _EXTEND[bool(least < scale.low), bool(most > scale.high)]
            axes.figure.colorbar(mesh, ax=axes, label=measure_label(data, name), extend=beyond)
    for hatch, here in doubtful(data, name).items():
        if name != "outcome" or hatch == UNCERTAIN:  # otherwise the colours show it
            hatch_cells(axes, edges, here[sort], hatch)
    _frame(axes, data, first, second)


def _scale_of(data: xarray.Dataset, name: str) -> ColourScale:
    """Colour scale for the values of certified points; other values may exceed it."""
    values = data[name].values
    computed = data["outcome"].values != NOT_COMPUTED
    sure = computed & ~uncertified(data, name) & np.isfinite(values)
    return colour_scale(name, values[sure if np.any(sure) else computed], data[name].attrs)


def _draw_outcomes(
    axes: Axes, edges: tuple[Array, Array], data: xarray.Dataset, outcome: Array, bar: bool
) -> None:
    """Plot outcomes in distinct colours, with their meanings at the colour bar."""
    words = _words(data["outcome"])
    found = [int(code) for code in np.unique(data["outcome"].values) if code >= 0]
    found.sort(key=[o.code for o in (*REGIMES, *Outcome)].index)
    colours = _outcome_colours(found)
    shown = np.full(outcome.shape, np.nan)
    for i, code in enumerate(found):
        shown[outcome == code] = i
    norm = BoundaryNorm(np.arange(len(found) + 1) - 0.5, len(found))
    mesh = axes.pcolormesh(
        *edges, shown.T, cmap=ListedColormap(colours), norm=norm, rasterized=True
    )
    if bar:
        scale = axes.figure.colorbar(mesh, ax=axes, ticks=range(len(found)))
        scale.ax.set_yticklabels([words[code] for code in found])
        scale.ax.invert_yaxis()


def _outcome_colours(codes: Sequence[int]) -> list[str]:
    """Colours of outcomes; the most frequent outcomes have the same colour in all maps."""
    own = {kind.code: colour for kind, colour in REGIMES.items()}
    taken = {own[code] for code in codes if code in own}
    spare = cycle([colour for colour in _OTHERS if colour not in taken])
    return [own.get(code) or next(spare) for code in codes]


def _panels(data: xarray.Dataset, names: list[str]) -> tuple[Figure, list[Axes]]:
    """Panels of equal size in rows of at most three, under the title of the map."""
    columns = min(len(names), 3 if len(names) != 4 else 2)
    rows = -(-len(names) // columns)
    figure = new_figure(_WIDTH * columns, _HEIGHT * rows + 0.4)
    figure.suptitle(map_title(data), x=0.01, ha="left", fontsize=13)
    grid = figure.subplots(rows, columns, squeeze=False).reshape(-1)
    for spare in grid[len(names) :]:
        spare.remove()
    return figure, list(grid[: len(names)])


def _legend(figure: Figure, data: xarray.Dataset, names: list[str]) -> None:
    """Add a legend of hatching, greys and white, and of the fraction of computed points of an
    interpolated map."""
    outcome = data["outcome"].values
    handles = [hatched_patch(kind, text) for kind, text in _doubts(data, names).items()]
    room = int(_LETTERS * figure.get_figwidth())
    hatched = {kind.code: hatch for kind, hatch in HATCHES.items()}
    for code, (colour, text) in zip(
        _codes(data, names), _reasons(data, names).items(), strict=False
    ):
        handles.append(hatched_patch(hatched.get(code, ""), fill(text, room), colour))
    if np.any(outcome == NOT_COMPUTED):
        handles.append(Patch(fc="white", ec=STICK_LINE, lw=0.6, label="not computed"))
    if np.any(outcome == INTERPOLATED):
        computed = np.count_nonzero(outcome >= 0) / outcome.size
        label = f"interpolated from {computed:.1%} of the points"
        handles.append(Patch(fc="none", ec="none", label=label))
    if handles:
        figure.legend(
            handles=handles, loc="outside lower left", ncols=2 if len(handles) > 2 else len(handles)
        )


def _gaps(data: xarray.Dataset, codes: Sequence[int], name: str) -> dict[str, Array]:
    """Computed points without a value of a measure, as masks by the grey of their outcome. The
    greys belong to the given codes in order."""
    if name == "outcome":
        return {}
    outcome = data["outcome"].values
    without = np.isnan(data[name].values)
    return {
        colour: without & (outcome == code) for colour, code in zip(_GREYS, codes, strict=False)
    }


def _codes(data: xarray.Dataset, names: list[str]) -> list[int]:
    """Outcomes of the computed points without a value of at least one of the measures."""
    without = np.any(
        [np.isnan(data[name].values) for name in names if name != "outcome"] or [False], axis=0
    )
    outcome = data["outcome"].values
    return [int(code) for code in np.unique(outcome[without & (outcome != NOT_COMPUTED)])]


def _reasons(data: xarray.Dataset, names: list[str]) -> dict[str, str]:
    """Legend entries of the greys of points without a value."""
    words = _words(data["outcome"])
    found = {}
    for colour, code in zip(_GREYS, _codes(data, names), strict=False):
        found[colour] = f"no value: {words[code]}"
        if code == Outcome.OUTSIDE.code:
            excess = data["excess"]
            largest = with_unit(float(np.nanmax(excess.values)), excess.attrs["units"], 3)
            found[colour] = (
                f"no value: the start is outside the stable set |∂Φ| ≤ s, by up to {largest}"
            )
    return found


def _words(codes: xarray.DataArray) -> dict[int, str]:
    """Meanings of the codes of outcomes. A store of an older version does not list all of them."""
    texts = [text.replace("_", " ") for text in codes.attrs["flag_meanings"].split()]
    stored = dict(zip(map(int, codes.attrs["flag_values"]), texts, strict=True))
    return {kind.code: kind.label for kind in Outcome} | stored


def _doubts(data: xarray.Dataset, names: list[str]) -> dict[str, str]:
    """Legend entries of the hatching of points without a certificate."""
    found = dict[str, Array]()
    for name in names:
        for hatch, here in doubtful(data, name).items():
            shown = here & ~np.isnan(data[name].values)
            if np.any(shown) and (name != "outcome" or hatch == UNCERTAIN):
                found[hatch] = found.get(hatch, False) | shown
    words = _words(data["outcome"])
    texts = {hatch: f"not converged: {words[kind.code]}" for kind, hatch in HATCHES.items()}
    return {h: texts.get(h) or _lacking(data, here) for h, here in found.items()}


def _lacking(data: xarray.Dataset, bad: Array) -> str:
    """Failed criteria of points without a certificate."""
    if "lacking" not in data:  # maps of the first format do not store them
        return "not certified"
    names = [MISSING[code] for code in np.unique(data["lacking"].values[bad])]
    failed = ", ".join(name for name in names if name != "result")
    return f"not certified ({failed})" if failed else "not certified"


# -- axes and values -------------------------------------------------------------------------------


def _coordinates(data: xarray.Dataset, dimension: str) -> list[str]:
    """Names that vary along a dimension, in the order in which they were given."""
    # The name of a dimension with several names is that of these names, joined by underscores.
    names = [str(n) for n, c in data.coords.items() if c.dims == (dimension,)]
    return sorted(names, key=lambda name: f"_{dimension}_".find(f"_{name}_"))


def _frame(axes: Axes, data: xarray.Dataset, first: str, second: str) -> None:
    """Set labels and scales of both axes."""
    axes.set_xlabel(axis_text(data, [first]))
    axes.set_ylabel(axis_text(data, [second]))
    _scale(axes, data, first, "x")
    _scale(axes, data, second, "y")


def _scale(axes: Axes, data: xarray.Dataset, name: str, direction: str) -> None:
    """Use a logarithmic scale if the values of the axis are spaced logarithmically."""
    if data[name].attrs.get("spacing") == "log":
        getattr(axes, f"set_{direction}scale")("log")
