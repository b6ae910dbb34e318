"""The common style of all plots: sizes, fonts, colours that colour-blind readers can distinguish,
and labels with units. As ``stickslip.style`` it is available for user-defined plots that look like
those of the library:

>>> import stickslip as ss
>>> with ss.style.paper_style():
...     figure = ss.style.new_figure(6.4, 4.0)
...     axes = figure.add_subplot()
...     _ = axes.plot([0, 1], [0, 1], color=ss.style.BLUE, label=ss.style.symbol("psi"))
...     ss.style.legend_above(axes)
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.legend import Legend
from matplotlib.ticker import (
    AutoLocator,
    FuncFormatter,
    LogFormatterSciNotation,
    LogLocator,
    MaxNLocator,
    NullFormatter,
    NullLocator,
    ScalarFormatter,
)

from stickslip.arrays import Array
from stickslip.display.symbols import latex_name
from stickslip.model.entries.units import unit_label
from stickslip.palette import (
    BAND,
    BLUE,
    EQUILIBRIUM,
    GREEN,
    LINES,
    ORANGE,
    PURPLE,
    SKY,
    SLIP,
    STICK_LINE,
    STICK_SHADE,
    THRESHOLD,
    UNSTABLE,
    VERMILION,
)
from stickslip.structures.names import is_entry
from stickslip.symbolic.formulas import NAME

__all__ = [
    "BAND",
    "BLUE",
    "EQUILIBRIUM",
    "GREEN",
    "LINES",
    "ORANGE",
    "PURPLE",
    "SKY",
    "SLIP",
    "STICK_LINE",
    "STICK_SHADE",
    "STYLE",
    "THRESHOLD",
    "UNSTABLE",
    "VERMILION",
    "axis_label",
    "legend_above",
    "level_colours",
    "line_colours",
    "new_figure",
    "paper_style",
    "symbol",
]

_TOLD = 1e-5  # relative range of the numbers on an axis above which they are written in full
# numbers on an axis beyond which powers of ten are written with the unit
_SMALL, _LARGE = 1e-2, 1e5
_BETWEEN = (1.0, 2.0, 5.0)  # multiples of a power of ten that are labelled
_LETTER = 0.6  # width of a letter, relative to its size
_TITLE = 2.0  # points between a legend and the title above it
_LAID_OUT = 0.95  # smallest fraction of the width of axes after layout

# Sizes are for a figure of full text width; at half that size the smallest letters are still 5
# points.
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 11.0,
    "mathtext.fontset": "stix",
    "axes.labelsize": 13.0,
    "axes.titlesize": 11.0,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "legend.fontsize": 11.0,
    "legend.handlelength": 1.4,
    "legend.columnspacing": 1.2,
    "lines.linewidth": 1.6,
    "lines.solid_joinstyle": "round",
    "savefig.dpi": 200,
    "figure.dpi": 100,
    "path.simplify_threshold": 0.2,
}


@contextmanager
def paper_style() -> Iterator[None]:
    """Context manager that applies the common style."""
    with mpl.rc_context(STYLE):
        yield


class _RoomyLocator(MaxNLocator):
    """Ticks at round numbers, as many as there is space for the labels.

    Matplotlib's locator assumes labels of three characters.
    """

    def __init__(self) -> None:
        super().__init__(nbins="auto", steps=[1, 2, 2.5, 5, 10])
        self._known: tuple[Any, Any] = (None, None)

    def tick_values(self, vmin: float, vmax: float) -> Any:
        """The ticks between two ends, cached, since matplotlib computes them repeatedly."""
        axis: Any = self.axis
        about = vmin, vmax, axis.axes.bbox.bounds, axis.get_major_formatter()
        if self._known[0] != about:
            self._known = about, self._chosen(axis, vmin, vmax)
        return self._known[1]

    def _chosen(self, axis: Any, vmin: float, vmax: float) -> Any:
        ticks = np.empty(0)
        for most in ("auto", 5, 4, 3, 2):
            self.set_params(nbins=most)
            ticks = np.asarray(super().tick_values(vmin, vmax))
            if axis.axis_name != "x" or _have_room(axis, ticks, vmin, vmax):
                return ticks
        seen = ticks[(ticks >= vmin) & (ticks <= vmax)]
        return next(
            (seen[::k] for k in range(1, len(seen)) if _have_room(axis, seen[::k], vmin, vmax)),
            seen[:1],
        )


def _have_room(axis: Any, ticks: Array, low: float, high: float) -> bool:
    """Return whether the labels of horizontal ticks do not overlap."""
    shown = ticks[(ticks >= low) & (ticks <= high)]
    if len(shown) < 2:
        return True
    points = axis.axes.get_window_extent().width * 72.0 / axis.get_figure(root=True).dpi
    first, last = axis.get_transform().transform([low, high])
    apart = np.min(np.diff(axis.get_transform().transform(shown))) / (last - first) * points
    letters = max(map(len, axis.get_major_formatter().format_ticks(ticks)), default=0)
    size = axis.get_tick_params().get("labelsize", mpl.rcParams["xtick.labelsize"])
    return (letters + 1) * _LETTER * FontProperties(size=size).get_size_in_points() <= apart


def _between_decades(axis: Any) -> None:
    """On a logarithmic axis, label only powers of ten; if there are fewer than two, also 2 and 5
    times these as plain numbers, or else all ticks."""
    axis.set_minor_formatter(NullFormatter())
    low, high = sorted(axis.get_view_interval())
    first, last = np.log10([low, high])
    if math.floor(last) - math.ceil(first) >= 1:
        return
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    tens = 10.0 ** np.arange(math.floor(first), math.ceil(last) + 1.0)
    ticks = np.outer(tens, _BETWEEN).ravel()
    few = np.count_nonzero((ticks >= low) & (ticks <= high)) < 2
    if few or (axis.axis_name == "x" and not _have_room(axis, ticks, low, high)):
        axis.set_major_locator(_RoomyLocator())
        axis.set_minor_locator(NullLocator())
    else:
        axis.set_major_locator(LogLocator(subs=_BETWEEN))


class Picture(Figure):
    """A figure that a notebook shows, also without an active notebook backend.

    It is also shown only once if such a backend is active, since it is not in the list of open
    figures.
    """

    def draw(self, renderer: Any) -> None:
        """Draw the figure, with as many numbers at its axes as fit, and powers of ten with the
        units."""
        for axes in self.axes:
            if type(axes.xaxis.get_major_locator()) is AutoLocator:
                axes.xaxis.set_major_locator(_RoomyLocator())
            for axis in (axes.xaxis, axes.yaxis):
                if type(axis.get_minor_formatter()) is LogFormatterSciNotation:
                    _between_decades(axis)
        powers_in_labels(self)
        super().draw(renderer)

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        with paper_style():
            self.savefig(buffer, format="png", dpi=self.dpi)
        return buffer.getvalue()


def new_figure(width: float, height: float) -> Figure:
    """Create an empty figure, sizes in inches, without a window."""
    figure = Picture(figsize=(width, height), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def root_of(axes: Axes) -> Figure:
    """The figure of axes, also if they are in a subfigure."""
    figure = axes.get_figure(root=True)
    assert figure is not None, "the axes were removed from their figure"
    return figure


def line_colours(count: int) -> list[str]:
    """Colours for a number of lines: the palette, or a perceptually uniform range if there are
    many."""
    return list(LINES[:count]) if count <= len(LINES) else level_colours(count)


def level_colours(count: int) -> list[str]:
    """Colours for ordered lines: a perceptually uniform range, not too light."""
    if count == 1:
        return [BLUE]
    colours = mpl.colormaps["viridis"]
    return [to_hex(colours(0.8 * i / (count - 1))) for i in range(count)]


def symbol(name: str) -> str:
    """The name of a variable as mathtext; ``d_x`` is a rate."""
    rate = name.startswith("d_") and len(name) > 2
    return f"${latex_name(name[2:], 1) if rate else latex_name(name)}$"


def symbol_or_formula(text: str) -> str:
    """The name of a variable, or of an unknown, as mathtext; any other formula unchanged."""
    return symbol(text) if NAME.fullmatch(text) or is_entry(text) else text


def axis_label(names: Iterable[str], unit: str) -> str:
    """Symbols, with their unit in brackets."""
    label = unit_label(unit)
    return ", ".join(map(symbol, names)) + (f"  [{label}]" if label else "")


def powers_in_labels(figure: Figure) -> None:
    """Write powers of ten of very large and very small numbers with the unit, as in x [10⁻⁶ m], not
    at the end of the axis, where they may overlap."""
    for axes in figure.axes:
        axes.apply_aspect()  # may change the limits
        for axis in (axes.xaxis, axes.yaxis):
            low, high = axis.get_view_interval()
            largest = max(abs(low), abs(high))
            formatter = axis.get_major_formatter()
            if isinstance(formatter, ScalarFormatter) and abs(high - low) >= _TOLD * largest:
                formatter.set_useOffset(False)
            if (
                type(axis.get_major_formatter()) is not ScalarFormatter
                or not axis.offsetText.get_visible()  # it has been done
                or axis.get_scale() != "linear"
                or not (0.0 < largest <= _SMALL or _LARGE <= largest < np.inf)
            ):
                continue
            power = 3 * math.floor((math.log10(largest) + 1.0) / 3.0)
            formatter = ScalarFormatter(useOffset=False)
            formatter.set_powerlimits((power, power))
            axis.set_major_formatter(formatter)
            _with_power(axis, power)


def _with_power(axis: Axis, power: int) -> None:
    """Write a power of ten in the label of an axis."""
    axis.offsetText.set_visible(False)
    label = axis.get_label_text()
    if not label:
        return
    name, bracket, unit = label.rpartition("  [")
    number = f"$10^{{{power}}}$"
    axis.set_label_text(f"{name}{bracket}{number} {unit}" if bracket else f"{label}  [{number}]")


def legend_above(axes: Axes, handles: Sequence[Artist] | None = None, right: bool = False) -> None:
    """Add a legend above the axes, where it covers no data, in as many rows as the width requires.

    A second legend is placed at the right if there is room for both; otherwise the two are merged.
    """
    if handles is None:
        handles, _ = axes.get_legend_handles_labels()
    shown = [(handle, str(handle.get_label())) for handle in handles]
    first = axes.get_legend()
    corner, x = ("lower right", 1.0) if right else ("lower left", 0.0)

    def place(columns: int) -> float:
        """Draw the legend with a given number of columns; return its fraction of the width."""
        # Legends are filled column by column, and are read row by row.
        columns = -(-len(shown) // -(-len(shown) // columns))
        artists, labels = zip(
            *(pair for c in range(columns) for pair in shown[c::columns]), strict=True
        )
        where = {"loc": corner, "bbox_to_anchor": (x, 0.98), "borderaxespad": 0.0}
        return _width(axes, axes.legend(artists, labels, ncols=columns, **where))

    width = place(len(shown))
    if first is not None:
        if width + _width(axes, first) <= 1.0:
            axes.add_artist(first)
            return
        shown = [
            (h, text.get_text())
            for h, text in zip(first.legend_handles, first.texts, strict=True)
            if h
        ] + shown
        corner = "lower left"
        x = 0.0
        width = place(len(shown))
    if width > 1.0:
        place(max(1, int(len(shown) / width)))


def titles_above(titles: Mapping[Axes, str]) -> None:
    """Align the titles of adjacent axes, above their legends."""
    heights = [
        legend.get_window_extent().height * 72.0 / axes.figure.dpi
        for axes in titles
        if (legend := axes.get_legend()) is not None
    ]
    for axes, text in titles.items():
        axes.set_title(text, pad=_TITLE + max(heights, default=0.0))


def _width(axes: Axes, legend: Legend) -> float:
    """Width of a legend relative to that of the axes, which the layout may still make narrower."""
    return legend.get_window_extent().width / (_LAID_OUT * axes.get_window_extent().width)
