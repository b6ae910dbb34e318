"""The plot of a branch of cycles with the uncertainty of its fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.arrays import Array
from stickslip.figures.drawing.style import (
    BLUE,
    LINES,
    UNSTABLE,
    axis_label,
    legend_above,
    new_figure,
    paper_style,
)

if TYPE_CHECKING:
    from stickslip.fitting.band import Band

_QUANTILE = 1.959963984540054


def plot_band(band: Band, ax: Axes | None = None) -> Figure:
    """Plot the largest amplitude against the parameter, with its 95 % band, and special points with
    their intervals."""
    x = _largest(band)
    if ax is not None:
        with paper_style():
            _draw(ax, band, x)
        figure = ax.get_figure(root=True)
        assert figure is not None
        return figure
    with paper_style():
        figure = new_figure(6.4, 4.2)
        axes = figure.add_subplot()
        _draw(axes, band, x)
        legend_above(axes)
    return figure


def _largest(band: Band) -> str:
    names = [str(n).removeprefix("amplitude_") for n in band.dataset.data_vars]
    moving = [x for x in band.system.coordinates if x in names]
    return max(moving, key=lambda x: float(np.nanmax(band.dataset[f"amplitude_{x}"].values)))


def _draw(ax: Axes, band: Band, x: str) -> None:
    data = band.dataset
    p = np.asarray(data[band.parameter].values, float)
    y = np.asarray(data[f"amplitude_{x}"].values, float)
    stable = data["stable"].values == 1
    outline = _band(p, y, data[f"amplitude_{x}_sd"].values, data[f"amplitude_{x}_slope"].values)
    for i, quad in enumerate(outline):
        ax.fill(quad[:, 0], quad[:, 1], color=BLUE, alpha=0.22, linewidth=0, label=_once(i, "95 %"))
    ax.plot(p, np.where(stable, y, np.nan), color=BLUE, label="stable")
    if not stable.all():
        beside = (
            stable & np.concatenate([[True], stable[:-1]]) & np.concatenate([stable[1:], [True]])
        )
        ax.plot(p, np.where(beside, np.nan, y), color=BLUE, linestyle=UNSTABLE, label="unstable")
    _draw_special(ax, band, p, y)
    what = {k: str(v) for k, v in data[band.parameter].attrs.items()}
    ax.set_xlabel(axis_label([band.parameter], what.get("units", "")))
    unit = str(data[f"amplitude_{x}"].attrs.get("units", ""))
    ax.set_ylabel("amplitude of " + axis_label([x], unit))
    ax.set_ylim(bottom=0.0)


def _draw_special(ax: Axes, band: Band, p: Array, y: Array) -> None:
    """Plot special points with their intervals; special points at one value are merged."""
    data = band.dataset
    values = np.asarray(data["value"].values, float)
    kinds = {
        value: ", ".join(map(str, data["kind"].values[values == value]))
        for value in dict.fromkeys(values.tolist())
    }
    labels = list(dict.fromkeys(kinds.values()))
    shown: set[str] = set()
    for value, kind in kinds.items():
        sd = float(data["value_sd"].values[values == value][0])
        height = 0.0 if kind == "Hopf" else float(y[np.argmin(np.abs(p - value))])
        ax.errorbar(
            [value],
            [height],
            xerr=[_QUANTILE * sd] if np.isfinite(sd) else None,
            fmt="o",
            color=LINES[(labels.index(kind) + 1) % len(LINES)],
            markersize=5,
            capsize=4,
            zorder=4,
            clip_on=False,
            label=None if kind in shown else kind,
        )
        shown.add(kind)


def _once(i: int, label: str) -> str | None:
    return label if i == 0 else None


def _band(p: Array, y: Array, sd: Array, slope: Array) -> list[Array]:
    """Corners of the pieces of a band between points of a curve: displaced to both sides along its
    normals by the deviation."""
    known = np.isfinite(sd) & np.isfinite(slope)
    width, height = np.ptp(p) or 1.0, np.ptp(y) or 1.0
    # The curve y = a(p) moves by da at a fixed p, by da/√(1 + a′²) along its normal (−a′, 1).
    steep = np.where(known, slope, 0.0) * width / height
    root = np.sqrt(1.0 + steep**2)
    move = np.where(known, _QUANTILE * sd / height, np.nan) / root
    if known.sum() < 2:
        return []
    index = np.arange(len(p))
    move = np.interp(index, index[known], move[known])
    normal = np.column_stack([-steep / root * width, height / root])
    upper = np.column_stack([p, y]) + move[:, None] * normal
    lower = np.column_stack([p, y]) - move[:, None] * normal
    return [np.array([lower[i], upper[i], upper[i + 1], lower[i + 1]]) for i in range(len(p) - 1)]
