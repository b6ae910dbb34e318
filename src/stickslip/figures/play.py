"""Plots of plays: inside their stable region, compared with their limit, and as loops over the
load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.arrays import Array
from stickslip.figures.drawing.style import (
    BAND,
    BLUE,
    STICK_LINE,
    THRESHOLD,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
    root_of,
    titles_above,
)
from stickslip.figures.drawing.thinning import chosen, thin

if TYPE_CHECKING:
    from stickslip.rate_independent.play.operator import Play

_SAMPLES = 4000
_MOST_NODES = 40_000  # largest number of nodes at which the stable region is evaluated
_WIDTH = 7.2  # inches
_HEIGHT = 3.8  # inches


def plot_play(play: Play, ax: Axes | None = None) -> Figure:
    """z over time, the stable region shaded.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Draw into these axes.
    """
    if ax is not None:
        _draw(ax, play, "z", "stable region")
        return root_of(ax)
    with paper_style():
        figure = new_figure(_WIDTH, _HEIGHT)
        _draw(figure.add_subplot(), play, "z", "stable region")
        return figure


def plot_limit(resolved: Play, averaged: Play) -> Figure:
    """Plot two plays side by side: one with an oscillating threshold, and its limit for ε → 0 ([M]
    figure 2.1).

    Parameters
    ----------
    resolved : Play
        z_ε; ε is the period of its thresholds.
    averaged : Play
        z_0, with the smallest threshold of all phases.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with paper_style():
        figure = new_figure(_WIDTH, _HEIGHT)
        left, right = figure.subplots(1, 2, sharex=True, sharey=True)
        _draw(left, resolved, r"z_\varepsilon", "stable region")
        _draw(right, averaged, "z_0", "stable at every phase")
        period = resolved.bounds.plus.period or resolved.bounds.minus.period
        known = r"\varepsilon > 0" if period is None else rf"\varepsilon = {period:g}"
        titles_above({left: f"${known}$", right: r"$\varepsilon \to 0$"})
        return figure


def plot_loops(load: Array, plays: Mapping[str, Array], total: Array) -> Figure:
    """Plot hysteresis loops against the load: single plays, and a weighted sum of plays
    (Prandtl–Ishlinskii).

    Parameters
    ----------
    load : array, shape (n,)
    plays : mapping of str to array of shape (n,)
        Positions of some plays, by their labels.
    total : array, shape (n,)
        The weighted sum.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with paper_style():
        figure = new_figure(_WIDTH, _HEIGHT)
        left, right = figure.subplots(1, 2)
        for (label, z), colour in zip(plays.items(), line_colours(len(plays)), strict=True):
            left.plot(load, z, color=colour, label=label)
        left.set_ylabel("position $z_i$")
        legend_above(left)
        right.plot(load, total, color=BLUE)
        right.plot(
            load[:1], total[:1], "o", ms=6, mfc="white", mec=STICK_LINE, zorder=4, label="start"
        )
        right.set_ylabel(r"output $\sum w_i z_i$")
        legend_above(right)
        for axes in (left, right):
            axes.set_xlabel(r"load $\ell$")
        return figure


def _draw(axes: Axes, play: Play, name: str, region: str) -> None:
    """The position and the interval in which it is stable."""
    t = _times(play)
    state = play.motion.state(*play.intervals(t, "right"))
    band_time, band = thin(t, {"low": state.now.low, "high": state.now.high})
    axes.fill_between(
        band_time, band["low"], band["high"], fc=BAND, ec=THRESHOLD, lw=0.5, zorder=1, label=region
    )
    # Between nodes z is monotone.
    line_time, line = thin(
        *((t, {"z": state.z}) if len(play.time) <= _MOST_NODES else (play.time, {"z": play.z}))
    )
    axes.plot(line_time, line["z"], color=BLUE, zorder=3, label=f"${name}$")
    axes.set_xlim(t[0], t[-1])
    axes.set_xlabel("time $t$")
    axes.set_ylabel(f"position ${name}$")
    legend_above(axes, list(reversed(axes.get_legend_handles_labels()[0])))


def _times(play: Play) -> Array:
    """An equidistant grid, and the nodes (a selection if they are too many), those of jumps from
    both sides."""
    grid = np.linspace(play.time[0], play.time[-1], _SAMPLES)
    nodes = play.time[np.append(chosen(play.time, _MOST_NODES), -1)]
    jumps = np.nextafter(nodes[1:][np.diff(nodes) == 0.0], -np.inf)
    return np.union1d(np.concatenate([grid, jumps]), nodes)
