"""Plots of data, fitted motions, and residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.arrays import Array
from stickslip.figures.drawing.style import (
    LINES,
    STICK_LINE,
    legend_above,
    new_figure,
    paper_style,
    root_of,
)
from stickslip.model.entries.units import unit_label

if TYPE_CHECKING:
    from stickslip.fitting.comparing import Comparison
    from stickslip.fitting.fit import Fit
    from stickslip.fitting.points.fit_law import LawFit

_DATA = "#6E6E6E"
_MOST = 3  # largest number of recordings, and of columns, that are drawn
_LINE = 2000  # points of a fitted curve
_MANY = 400  # number of data points above which they are drawn small


def plot_fit(fit: Fit, ax: Axes | None = None) -> Figure:
    """Data with the fitted motion, and the residuals below."""
    return _drawn([("fit", fit)], ax)


def plot_comparison(comparison: Comparison, ax: Axes | None = None) -> Figure:
    """Data with the fitted motions of all models, and their residuals below."""
    return _drawn(list(zip(comparison.names, comparison.fits, strict=True)), ax)


def _drawn(fits: list[tuple[str, Fit]], ax: Axes | None) -> Figure:
    problem = fits[0][1].problem
    measured = problem.measured[:_MOST]
    columns = [c.name for c in measured[0].columns][:_MOST]
    if ax is not None:
        with paper_style():
            _column(ax, None, fits, 0, columns[0])
            legend_above(ax)
        figure = ax.get_figure(root=True)
        assert figure is not None
        return figure
    with paper_style():
        wide = 6.4 if len(measured) == 1 else 3.6 * len(measured)
        figure = new_figure(wide, 1.0 + 2.7 * len(columns))
        ratios = [2.4, 1.0] * len(columns)
        axes = figure.subplots(
            2 * len(columns), len(measured), squeeze=False, height_ratios=ratios, sharex="col"
        )
        for r in range(len(measured)):
            for i, name in enumerate(columns):
                _column(axes[2 * i, r], axes[2 * i + 1, r], fits, r, name)
            axes[-1, r].set_xlabel(_clock_label(fits[0][1], r))
        legend_above(axes[0, 0])
        figure.align_ylabels()
    return figure


def _column(ax: Axes, below: Axes | None, fits: list[tuple[str, Fit]], r: int, name: str) -> None:
    """Plot one column of one recording."""
    suffix = "" if r == 0 else f"_{r + 1}"
    data = fits[0][1].dataset
    time = np.asarray(data[f"time{suffix}"].values, float)
    if fits[0][1].problem.measured[r].recording.events:
        time = time + 1.0
    values = data[f"{name}{suffix}"]
    there = np.isfinite(values.values)
    many = int(there.sum()) > _MANY
    size: dict[str, Any] = {"markersize": 2.4 if many else 3.8, "alpha": 0.6 if many else 0.9}
    ax.plot(
        time[there],
        values.values[there],
        "o",
        color=_DATA,
        markeredgewidth=0,
        label="data",
        rasterized=many,
        **size,
    )
    for i, (label, found) in enumerate(fits):
        t, y = _curve(found, r, name, time)
        style: dict[str, Any] = {"color": LINES[i % len(LINES)], "zorder": 3}
        if found.problem.measured[r].recording.events:
            ax.plot(t, y, "+", markersize=8, label=label, **style)
        else:
            ax.plot(t, y, linewidth=1.4, label=label, **style)
        if below is None:
            continue
        left = found.dataset[f"residual_{name}{suffix}"].values
        below.plot(
            time[there],
            left[there],
            "o",
            color=LINES[i % len(LINES)],
            markeredgewidth=0,
            rasterized=many,
            **size,
        )
    ax.set_ylabel(_label(values, name))
    if below is not None:
        below.axhline(0.0, color=STICK_LINE, linewidth=0.8)
        below.set_ylabel("residual")


def _curve(found: Fit, r: int, name: str, time: Array) -> tuple[Array, Array]:
    """The fitted motion, also between the data if they are few."""
    m = found.problem.measured[r]
    c = next(c for c in m.columns if c.name == name)
    suffix = "" if r == 0 else f"_{r + 1}"
    values = found.dataset[f"fitted_{name}{suffix}"].values
    there = np.isfinite(values)
    motion = found.trajectories[r]
    if (
        m.recording.events
        or there.sum() > _LINE
        or c.formula
        not in {
            *motion.row_of,
            *motion.system.outputs,
        }
    ):
        order = np.argsort(time[there], kind="stable")
        return time[there][order], values[there][order]
    t = np.union1d(np.linspace(time[there][0], time[there][-1], _LINE), motion.knots.time)
    t = t[(t >= time[there][0]) & (t <= time[there][-1])]
    return t, np.asarray(motion.at(t)[c.formula])


def _label(values: Any, name: str) -> str:
    unit = values.attrs.get("units", "")
    return _with_unit(name, unit)


def _clock_label(fit: Fit, r: int) -> str:
    if fit.problem.measured[r].recording.events:
        return "number of the event"
    return _with_unit("time", fit.declared.time_unit)


def _with_unit(name: str, unit: str) -> str:
    """A name of the data, with its unit."""
    label = unit_label(unit)
    return name.replace("_", " ") + (f"  [{label}]" if label else "")


def plot_law_fit(fit: LawFit, ax: Axes | None = None) -> Figure:
    """Plot points and law against the speed, with the residuals below (except in given axes)."""
    v, F = fit.speeds, fit.forces
    with paper_style():
        own, below = ax, None
        if own is None:
            pair = new_figure(6.4, 4.2).subplots(2, 1, height_ratios=[2.4, 1.0], sharex=True)
            own, below = pair[0], pair[1]
        own.axhline(0.0, color=STICK_LINE, linewidth=0.8)
        own.plot(v, F, "o", color=_DATA, markeredgewidth=0, markersize=3.8, label="data")
        for side in (v[v < 0.0], v[v > 0.0]):
            if len(side):
                fine = np.linspace(side[0], side[-1], _LINE)
                label = fit.law.title if side[-1] == v[-1] else None
                own.plot(fine, fit.at(fine), color=LINES[0], linewidth=1.4, zorder=3, label=label)
        own.set_ylabel("friction force  [N]")
        legend_above(own)
        if below is not None:
            below.axhline(0.0, color=STICK_LINE, linewidth=0.8)
            below.plot(v, F - fit.at(v), "o", color=LINES[0], markeredgewidth=0, markersize=3.8)
            below.set_ylabel("residual")
        (own if below is None else below).set_xlabel("speed  [m/s]")
        return root_of(own)
