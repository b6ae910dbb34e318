"""Plots of dissipation potentials: stable sets and their intersection, costs over a phase, a
path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from stickslip.arrays import Array
from stickslip.figures.drawing.style import (
    BAND,
    BLUE,
    GREEN,
    STICK_LINE,
    THRESHOLD,
    VERMILION,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
)
from stickslip.rate_independent.sets.plane import stable_boundary

if TYPE_CHECKING:
    from stickslip.rate_independent.dissipation import Average, Dissipation

_PHASES = 128
_FEW = 4  # number of components up to which each has a line; for more a map is drawn
_PLANE = 4.4  # inches
_COSTS = 4.8  # inches
_HEIGHT = 4.8  # inches


def plot_average(potential: Dissipation, average: Average, sets: int = 8, unit: str = "") -> Figure:
    """Plot the costs of unit motions over one phase with their averages; in the plane also K(s) at
    some phases, and K_av.

    Parameters
    ----------
    potential : Dissipation
    average : Average
        Its average.
    sets : int
        Number of phases at which K(s) is drawn.
    unit : str
        Unit of forces (``"dimensionless"`` if they have none); omitted if empty.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with paper_style():
        if potential.dimension != 2:
            figure = new_figure(7.2, 4.2)
            costs_over_phase(figure.add_subplot(), potential, average, unit)
            return figure
        figure = new_figure(_PLANE + _COSTS, _HEIGHT)
        left, right = figure.subplots(1, 2, width_ratios=[_PLANE, _COSTS])
        stable_sets(left, potential, sets, unit)
        costs_over_phase(right, potential, average, unit)
        return figure


def stable_sets(axes: Axes, potential: Dissipation, sets: int = 8, unit: str = "") -> None:
    """Draw K(s) at evenly spaced phases, coloured by the phase, and K_av shaded; n = 2."""
    phases = np.arange(sets if potential.depends_on_phase else 1) / sets
    colours = ListedColormap(mpl.colormaps["twilight"](np.linspace(0.12, 0.88, sets)))
    for k, s in enumerate(phases.tolist()):
        axes.fill(*stable_boundary(potential, np.array([s])).T, fc="none", ec=colours(k), lw=1.2)
    every = np.arange(_PHASES if potential.depends_on_phase else 1) / _PHASES
    common = stable_boundary(potential, every)
    axes.fill(
        *common.T, fc=BAND, ec=THRESHOLD, lw=2.2, zorder=3, label=r"$K_\mathrm{av}$, common to all"
    )
    axes.plot(0, 0, "+", color=STICK_LINE, ms=7, zorder=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(_with_unit(r"force $\xi_1$", unit))
    axes.set_ylabel(_with_unit(r"force $\xi_2$", unit))
    legend_above(axes)
    if len(phases) > 1:
        _phase_bar(axes, colours, sets)


def _phase_bar(axes: Axes, colours: ListedColormap, sets: int) -> None:
    """Colour bar of phases."""
    norm = BoundaryNorm((np.arange(sets + 1) - 0.5) / sets, sets)
    figure = axes.figure
    assert isinstance(figure, Figure)
    bar: Colorbar = figure.colorbar(
        ScalarMappable(norm, colours), ax=axes, location="bottom", shrink=0.75, aspect=24
    )
    ticks = np.arange(0, sets, max(1, sets // 4)) / sets
    bar.set_ticks(ticks.tolist(), labels=[f"{s:g}" for s in ticks])
    bar.ax.minorticks_off()
    bar.set_label("$K(s)$ at the phase $s$  [periods]")
    bar.outline.set_visible(False)


def _with_unit(label: str, unit: str) -> str:
    return f"{label}  [{unit}]" if unit else label


def costs_over_phase(axes: Axes, potential: Dissipation, average: Average, unit: str = "") -> None:
    """Draw Ψ(s, e_i) over one phase, its average Ψ_av(e_i) dashed, and dots at the phases of the
    motion of minimum cost along e_i."""
    n = potential.dimension
    phases = np.linspace(0.0, 1.0, _PHASES + 1)
    costs = unit_costs(potential, phases)
    axes.set_xlabel("phase $s$  [periods]")
    axes.set_xlim(0.0, 1.0)
    if n > _FEW:
        image = axes.imshow(
            costs,
            aspect="auto",
            extent=(0.0, 1.0, n + 0.5, 0.5),
            cmap="cividis",
            interpolation="nearest",
        )
        figure = axes.figure
        assert isinstance(figure, Figure)
        figure.colorbar(
            image,
            ax=axes,
            pad=0.01,
            label=_with_unit(r"cost of a unit motion $\Psi(s, e_i)$", unit),
        )
        axes.set_ylabel("component $i$")
        return
    for i, colour in enumerate(line_colours(n)):
        axes.plot(
            phases,
            costs[i],
            color=colour,
            label=rf"$\Psi(s, e_{i + 1})$" if n > 1 else r"$\Psi(s, 1)$",
        )
        motion = average.optimal_motion(np.eye(n)[i])
        axes.axhline(
            motion.cost, color=colour, lw=1.2, ls=(i * 4.0, (4.0, 4.0 * max(1, n - 1))), zorder=1
        )
        at = unit_costs(potential, motion.phases)[i]
        axes.plot(
            motion.phases,
            at,
            "o",
            color=colour,
            mfc="white",
            mew=1.6,
            ms=7,
            zorder=4,
            clip_on=False,
        )
    axes.plot([], [], color=STICK_LINE, lw=1.2, ls="--", label=r"$\Psi_\mathrm{av}$")
    axes.plot([], [], "o", color=STICK_LINE, mfc="white", mew=1.6, ms=7, label="moves")
    axes.set_ylim(0.0, 1.08 * float(costs.max()) or 1.0)
    axes.set_ylabel(_with_unit("cost of a unit motion", unit))
    legend_above(axes)


def unit_costs(potential: Dissipation, phases: Array) -> Array:
    """Ψ(s, e_i), shape (n, m)."""
    sampled = potential.sampled(phases % 1.0)
    return np.array([sampled.support(e) for e in np.eye(potential.dimension)])


def plot_path(resolved: Array, averaged: Array, period: float) -> Figure:
    """Plot a path in the plane, coloured by the moving component, on top of the averaged one.

    Parameters
    ----------
    resolved, averaged : array, shape (m, 2)
        States in the order of time, dimensionless.
    period : float
        ε.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with paper_style():
        figure = new_figure(7.2, 5.4)
        axes = figure.add_subplot()
        axes.plot(
            *averaged.T, color=STICK_LINE, lw=1.1, label=r"averaged, $\varepsilon \to 0$", zorder=2
        )
        moved = np.abs(np.diff(resolved, axis=0))
        kinds = (
            ((moved[:, 0] > 0.0) & (moved[:, 1] == 0.0), BLUE, "$z_1$ moves"),
            ((moved[:, 1] > 0.0) & (moved[:, 0] == 0.0), VERMILION, "$z_2$ moves"),
            ((moved > 0.0).all(axis=1), GREEN, "both"),
        )
        for mask, colour, label in kinds:
            if not mask.any():
                continue
            pieces = np.full((int(mask.sum()), 3, 2), np.nan)
            pieces[:, 0], pieces[:, 1] = resolved[:-1][mask], resolved[1:][mask]
            axes.plot(*pieces.reshape(-1, 2).T, color=colour, lw=2.2, label=label, zorder=3)
        axes.plot(*resolved[0], "o", ms=6, mfc="white", mec=STICK_LINE, zorder=4, label="start")
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel("position $z_1$  [dimensionless]")
        axes.set_ylabel("position $z_2$  [dimensionless]")
        axes.set_title(rf"$\varepsilon = {period:g}$", loc="right")
        legend_above(axes)
        return figure
