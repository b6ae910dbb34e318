"""Return maps of the line, with their diagonal, their fixed points and a cobweb."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.arrays import Array
from stickslip.figures.drawing.style import LINES, STICK_LINE, new_figure, paper_style

ScalarMap = Callable[[float], float]
_SAMPLES = 201
_FAINT = "#9A9A9A"


def plot_return_map(
    maps: Mapping[str, ScalarMap],
    interval: tuple[float, float],
    start: float | None = None,
    *,
    steps: int = 12,
    symbol: str = r"\gamma",
    name: str = r"\Psi",
) -> Figure:
    """Plot return maps over an interval, with the cobweb of the first one.

    Parameters
    ----------
    maps : mapping of str to function
        Maps by the text of the legend; at most six.
    start : float, optional
        Start of the cobweb.
    steps : int
        Steps of the cobweb; it ends earlier if it converges or leaves the interval.
    symbol, name : str
        Names of the variable and of the map, in mathtext.
    """
    x = np.linspace(*interval, _SAMPLES)
    with paper_style():
        figure = new_figure(4.8, 4.8)
        axes = figure.add_subplot()
        axes.plot(interval, interval, color=_FAINT, lw=0.9)
        curves = {label: np.array([f(float(v)) for v in x]) for label, f in maps.items()}
        for (label, y), colour in zip(curves.items(), LINES, strict=False):
            axes.plot(x, y, color=colour, label=label)
        first = next(iter(maps))
        for fixed in crossings(x, curves[first]):
            axes.plot(fixed, fixed, "o", color=STICK_LINE, ms=5, zorder=4)
        if start is not None:
            _cobweb(axes, maps[first], start, interval, steps)
        axes.set_xlabel(f"${symbol}$")
        axes.set_ylabel(f"${name}({symbol})$")
        axes.set_xlim(interval)
        axes.set_ylim(bottom=min(interval[0], *(float(np.min(y)) for y in curves.values())))
        axes.set_aspect("equal", "box")
        if len(maps) > 1:
            axes.legend(loc="upper left")
    return figure


def crossings(x: Array, y: Array) -> Array:
    """Intersections of a sampled map with the diagonal, by linear interpolation."""
    gap = y - x
    i = np.flatnonzero((gap[:-1] > 0.0) != (gap[1:] > 0.0))
    return x[i] - gap[i] * (x[i + 1] - x[i]) / (gap[i + 1] - gap[i])


def _cobweb(
    axes: Axes, f: ScalarMap, start: float, interval: tuple[float, float], steps: int
) -> None:
    """x, f(x), f(f(x)), … between the map and the diagonal."""
    low, high = interval
    corners = [(start, low), (start, f(start))]
    for _ in range(steps):
        x, y = corners[-1]
        if not low <= y <= high or abs(y - x) < 1e-3 * (high - low):
            break
        corners += [(y, y), (y, f(y))]
    points = np.array(corners)
    axes.plot(points[:, 0], points[:, 1], color=STICK_LINE, lw=0.8, zorder=3)
    axes.plot(start, low, "o", mfc="white", mec=STICK_LINE, ms=5, clip_on=False, zorder=5)
