"""Plots of frequency responses: amplitude against the frequency, a line for each level, with the
phase below."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any

import matplotlib.patheffects as effects
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from stickslip.errors import DeclarationError, short, suggestion
from stickslip.figures.drawing.smooth import PIECES, smooth_curve
from stickslip.figures.drawing.style import (
    STICK_LINE,
    UNSTABLE,
    axis_label,
    legend_above,
    level_colours,
    new_figure,
    paper_style,
    powers_in_labels,
    root_of,
    symbol,
)
from stickslip.model.entries.units import unit_label, with_unit
from stickslip.orbits.continuation.branch import without_knots

if TYPE_CHECKING:
    import xarray

    from stickslip.sweeps.response import FrequencyResponse

_WIDTH = 6.4  # inches
_TALL = 3.6
_LOW = 1.7
_EXTRA = 0.7
_SLIPS = 1.6  # width of a line if a contact slips …
_NEVER_SLIPS = 0.9  # … and if none does
_BACKBONE: dict[str, Any] = {"color": STICK_LINE, "lw": 0.9, "ls": (0, (6, 2, 1, 2)), "zorder": 2.5}
_FOLD: dict[str, Any] = {"marker": "o", "ms": 6, "mfc": "white", "mec": STICK_LINE, "mew": 1.2}
_CHANGE: dict[str, Any] = {"marker": ".", "ms": 5, "color": STICK_LINE}
_SWEEPS = {"up": "^", "down": "v"}
_ALIKE = 1e-6  # sweeps that differ by less, relative to the largest response, are the same
# positions of the label of a line around its peak: distances (points) and directions (degrees),
# preferred ones first
_DISTANCES = (3.0, 6.0, 10.0, 15.0, 21.0, 28.0, 36.0, 45.0, 60.0)
_DIRECTIONS = (45.0, 90.0, 135.0, 15.0, 165.0, 70.0, 110.0, -20.0, 200.0, -45.0, 225.0, -90.0)
_GRID = np.array(
    [(i, j) for i in np.linspace(-1, 1, 21) for j in np.linspace(-1, 1, 5)]
)  # sample points of a box
_APART = 2.0  # points between a label and other objects


def plot_response(
    response: FrequencyResponse, names: Sequence[str] | None = None, *, ax: Axes | None = None
) -> Figure:
    """Plot quantities of a response against the frequency, one labelled line per level.

    Unstable parts are dashed, parts without slip are thin. Circles are folds; dots are points at
    which contacts begin to stick or to slip, or a boundary is touched. Triangles are motions of
    sweeps up and down. The thin dark line connects the largest responses of the levels.

    Parameters
    ----------
    names : sequence of str, optional
        Variables of the points; by default ``amplitude``, and ``phase`` below.
    ax : matplotlib.axes.Axes, optional
        Existing axes to draw the first of them into.

    Raises
    ------
    DeclarationError
        If there is no such quantity.
    """
    data = response.dataset
    known = [str(n) for n in data.data_vars if data[n].dims == ("point",)]
    known = [n for n in known if n not in (response.parameter, response.level)]
    for name in names or ():
        if name not in known:
            raise DeclarationError(
                "quantities",
                f"unknown quantity '{short(str(name))}'",
                suggestion(str(name), known),
            )
    shown = list(names or ("amplitude", "phase"))
    if ax is not None:
        _draw(ax, response, shown[0])
        _label_frequency(ax, response)
        if handles := _handles(response, shown[:1]):
            legend_above(ax, handles)
        _name_lines(ax, response, shown[0])
        return root_of(ax)
    heights = [_LOW if name in ("phase", "stick") else _TALL for name in shown]
    with paper_style():
        figure = new_figure(_WIDTH, sum(heights) + _EXTRA)
        panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False, height_ratios=heights)
        for axes, name in zip(panels[:, 0], shown, strict=True):
            _draw(axes, response, name)
        _label_frequency(panels[-1, 0], response)
        if handles := _handles(response, shown):
            legend_above(panels[0, 0], handles)
        powers_in_labels(figure)
        figure.align_ylabels(panels[:, 0])
        # The distances of names are in points, so the layout has to be final.
        for axes, name in zip(panels[:, 0], shown, strict=True):
            _name_lines(axes, response, name)
    return figure


def _draw(axes: Axes, response: FrequencyResponse, name: str) -> None:
    """Plot one quantity against the frequency."""
    data, x = response.dataset, response.parameter
    colours = _colours(response)
    for number in np.unique(data["line"].values) if data.sizes["point"] else ():
        line = response.line(int(number))
        level = float(line[response.level][0]) if response.level else float(response.levels[0])
        _draw_line(axes, line[x].values, line[name].values, line, colours[level])
    if f"swept_{name}" in data:
        swept = data[f"swept_{name}"].values
        for sweep, colour in zip(swept, colours.values(), strict=True):
            differ = _differ(sweep)
            for values, marker in zip(sweep, _SWEEPS.values(), strict=True):
                at = data[f"swept_{x}"].values[differ]
                axes.plot(at, values[differ], marker, color=colour, ms=4, mew=0.0)
    if f"backbone_{name}" in data and data.sizes["backbone"] > 1:
        at, top = data[f"backbone_{x}"].values, data[f"backbone_{name}"].values
        axes.plot(*smooth_curve(at, top, np.zeros(len(at))), **_BACKBONE)
    for point in without_knots(response.special):
        here = float(data[name][point.index])
        style = _FOLD if point.kind == "fold" else _CHANGE
        axes.plot(point.value, here, linestyle="none", zorder=3, **style)
    _scale(axes, response, name)
    if response.level and f"backbone_{name}" in data:
        # space for the names of lines
        axes.set_ylim(top=axes.get_ylim()[1] + 0.07 * float(np.ptp(axes.get_ylim())))


def _colours(response: FrequencyResponse) -> dict[float, str]:
    """The colour of each level."""
    levels = response.levels.tolist()
    return dict(zip(levels, level_colours(len(levels)), strict=True))


def _draw_line(axes: Axes, x: Any, y: Any, line: xarray.Dataset, colour: str) -> None:
    """Plot a line, in parts of constant stability with or without slip."""
    stable, slips = line["stable"].values != 0, line["slips"].values != 0
    curve = smooth_curve(x, y, line["corner"].values)
    changed = np.flatnonzero((np.diff(stable) != 0) | (np.diff(slips) != 0)) + 1
    for first, last in pairwise([0, *changed.tolist(), len(x) - 1]):
        part = slice(PIECES * first, PIECES * last + 1)
        width = _SLIPS if slips[first] else _NEVER_SLIPS
        style = "-" if stable[first] else UNSTABLE
        axes.plot(curve[0][part], curve[1][part], color=colour, linestyle=style, lw=width)


def _name_lines(axes: Axes, response: FrequencyResponse, name: str) -> None:
    """Label each line with its level at its largest response, without overlapping lines and other
    labels."""
    data = response.dataset
    if not response.level or f"backbone_{name}" not in data:
        return
    root_of(axes).draw_without_rendering()
    drawn = np.concatenate([_pixels(axes, line) for line in axes.get_lines()])
    points = root_of(axes).dpi / 72.0
    frame = axes.get_window_extent()
    unit = response.system.parameters[response.level].unit
    peaks = zip(data[f"peak_{response.parameter}"], data[f"peak_{name}"], strict=True)
    for (level, colour), (x, y) in zip(_colours(response).items(), peaks, strict=True):
        if not np.isfinite(y):
            continue
        text = f"{symbol(response.level)} = {with_unit(float(level), unit, 4)}"
        style = {"ha": "center", "va": "center", "color": colour, "fontsize": 9.5}
        label = axes.annotate(
            text, (float(x), float(y)), (0, 0), textcoords="offset points", **style
        )
        box = label.get_window_extent()
        half = 0.5 * np.array([box.width, box.height])
        peak = np.array([0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1)])
        best, fewest = np.zeros(2), np.inf
        for distance, angle in product(_DISTANCES, np.radians(_DIRECTIONS)):
            offset = (half + distance * points) * [np.cos(angle), np.sin(angle)]
            away = np.abs(drawn - peak - offset)
            hits = np.count_nonzero(np.all(away <= half + _APART * points, axis=1))
            corners = (peak + offset - half, peak + offset + half)
            if not all(frame.contains(*corner) for corner in corners):
                hits += len(drawn)
            if hits < fewest:
                best, fewest = offset, hits
        label.set_position(tuple(best / points))
        label.set_path_effects([effects.withStroke(linewidth=2.0, foreground="white")])
        drawn = np.concatenate([drawn, peak + best + half * _GRID])


def _differ(sweep: Any) -> Any:
    """Points at which sweeps up and down converge to different cycles."""
    up, down = np.nan_to_num(sweep)
    return np.abs(up - down) > _ALIKE * max(np.max(np.abs(up)), np.max(np.abs(down)))


def _pixels(axes: Axes, line: Line2D) -> Any:
    """Points of a line in pixels, with additional ones in between."""
    points = axes.transData.transform(np.asarray(line.get_xydata()))
    part = np.linspace(0.0, 1.0, 5)[:, None, None]
    between = points[:-1] + part * np.diff(points, axis=0)
    return np.concatenate([between.reshape(-1, 2), points])


def _scale(axes: Axes, response: FrequencyResponse, name: str) -> None:
    """Labels of the vertical axis; phases in multiples of π/2."""
    data = response.dataset[name]
    if name == "phase":
        axes.yaxis.set_major_locator(MultipleLocator(np.pi / 2.0))
        axes.yaxis.set_major_formatter(_in_halves)
        axes.set_ylabel("phase  [rad]")
        return
    of = {"amplitude": "amplitude of ", "harmonic": "first harmonic of "}
    unit = unit_label(str(data.attrs.get("units", "")).removeprefix("1"))
    meaning = str(data.attrs.get("long_name", name.replace("_", " ")))
    x = response.coordinate
    shown = symbol(x) if x in response.system.followed else x
    label = of[name] + shown if name in of else meaning
    axes.set_ylabel(f"{label}  [{unit}]" if unit else label)
    if np.all(data >= 0.0):
        axes.set_ylim(bottom=0.0)


def _in_halves(value: float, _: float) -> str:
    """A multiple of π/2 as text."""
    halves = round(value / (np.pi / 2.0))
    if halves == 0:
        return "0"
    sign, size = "−" if halves < 0 else "", abs(halves)
    if size % 2:
        return f"{sign}{size if size > 1 else ''}π/2"
    return f"{sign}{size // 2 if size > 2 else ''}π"


def _label_frequency(axes: Axes, response: FrequencyResponse) -> None:
    declared = response.system.parameters[response.parameter]
    axes.set_xlabel(axis_label([response.parameter], declared.unit))
    over = response.dataset[response.parameter].values
    if len(over) and np.ptp(over) > 0.0:
        axes.set_xlim(float(np.min(over)), float(np.max(over)))


def _handles(response: FrequencyResponse, names: Sequence[str]) -> list[Line2D]:
    """Legend entries of the kinds of lines and markers that occur."""
    data = response.dataset
    stable, slips = data["stable"].values, data["slips"].values
    lines = [
        (np.any((stable != 0) & (slips != 0)), "stable cycle", {}),
        (np.any(stable == 0), "unstable cycle", {"linestyle": UNSTABLE}),
        (np.any(slips == 0), "no contact slips", {"lw": _NEVER_SLIPS}),
        (len(response.levels) > 1 and names[0] != "phase", "largest response", _BACKBONE),
    ]
    found = [
        Line2D([], [], **{"color": STICK_LINE, **style}, label=text)
        for there, text, style in lines
        if there
    ]
    kinds = {s.kind for s in without_knots(response.special)}
    marks = [
        ("fold" in kinds, "fold", _FOLD),
        (bool(kinds - {"fold"}), ", ".join(sorted(kinds - {"fold"})), _CHANGE),
    ]
    if any(np.any(_differ(sweep)) for sweep in data["swept_amplitude"].values):
        marks += [
            (True, f"sweep {direction}", {"marker": marker, "ms": 4, "color": STICK_LINE})
            for direction, marker in _SWEEPS.items()
        ]
    return found + [
        Line2D([], [], linestyle="none", label=text, **style)
        for there, text, style in marks
        if there
    ]
