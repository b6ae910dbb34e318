"""Bifurcation diagrams."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stickslip.figures.style import BLUE, LINES, axis_label, legend_above, new_figure, paper_style

if TYPE_CHECKING:
    from stickslip.orbits.branch import Branch

Array = np.ndarray
MARKERS = "osD^vPX*"


def plot_branch(branch: Branch, names: list[str] | None = None) -> Figure:
    """Bifurcation diagram: stable points solid, unstable ones dashed, special points marked and named.

    Parameters
    ----------
    branch : Branch
    names : list of str, optional
        What is drawn over the parameter; by default the coordinates and internal variables that change, at most three.
    """
    names = names or _changing(branch)
    with paper_style():
        figure = new_figure(6.4, 0.8 + 2.4 * len(names))
        panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(panels, names, strict=True):
            _draw(axes, branch, name)
            axes.set_ylabel(axis_label([name], _unit(branch, name)))
        parameter = branch.system.parameters[branch.parameter]
        panels[-1].set_xlabel(axis_label([branch.parameter], parameter.unit))
        legend_above(panels[0], _legend(branch))
    return figure


def _changing(branch: Branch) -> list[str]:
    """Coordinates and internal variables that change along the branch (all of them if none does)."""
    candidates = [x for x in branch.system.declaration.state if x in branch.points and not x.startswith("d_")]
    moving = [x for x in candidates if np.ptp(branch.points[x].values) > 1e-9 * (1 + np.ptp(_values(branch)))]
    return (moving or candidates)[:3]


def _unit(branch: Branch, name: str) -> str:
    declared = {**branch.system.coordinates, **branch.system.internal}
    return declared[name].unit if name in declared else ""


def _values(branch: Branch) -> Array:
    return branch.points[branch.parameter].values


def _draw(axes: Axes, branch: Branch, name: str) -> None:
    """One variable over the parameter: a line for each stretch of one stability."""
    x, y, stable = _values(branch), branch.points[name].values, branch.points["stable"].values
    for first, last in _stretches(stable):
        part = slice(first, min(last + 1, len(x)))  # up to the first point of the next stretch
        axes.plot(x[part], y[part], color=BLUE, linestyle="-" if stable[first] == 1 else (0, (4, 2)))
    for kind, marker, colour in _kinds(branch):
        points = branch.of_kind(kind)
        axes.plot(
            [s.value for s in points],
            [s.state[name] for s in points],
            linestyle="none",
            marker=marker,
            color=colour,
            markersize=7,
            zorder=3,
        )


def _stretches(stable: Array) -> list[tuple[int, int]]:
    """Bounds of the stretches of points of one stability; an undecided point belongs to the stretch before it."""
    decided = stable.copy()
    for i in range(1, len(decided)):
        if decided[i] < 0:
            decided[i] = decided[i - 1]
    edges = [0, *(np.flatnonzero(np.diff(decided)) + 1), len(decided)]
    return list(pairwise(edges))


def _kinds(branch: Branch) -> list[tuple[str, str, str]]:
    """Kinds of special points with a marker and a colour for each."""
    kinds = list(dict.fromkeys(s.kind for s in branch.special))
    return [(kind, MARKERS[i % len(MARKERS)], LINES[1:][i % (len(LINES) - 1)]) for i, kind in enumerate(kinds)]


def _legend(branch: Branch) -> list[Line2D]:
    stable = branch.points["stable"].values
    handles = [Line2D([], [], color=BLUE, label="stable")] if np.any(stable == 1) else []
    if np.any(stable == 0):
        handles.append(Line2D([], [], color=BLUE, linestyle=(0, (4, 2)), label="unstable"))
    for kind, marker, colour in _kinds(branch):
        handles.append(Line2D([], [], color=colour, marker=marker, linestyle="none", markersize=7, label=kind))
    return handles
