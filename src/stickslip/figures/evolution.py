"""Plots of evolutions: components over time with stick phases shaded, and convergence under
averaging."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from stickslip.arrays import Array
from stickslip.figures.drawing.style import (
    BLUE,
    GREEN,
    ORANGE,
    STICK_SHADE,
    VERMILION,
    legend_above,
    new_figure,
    paper_style,
    root_of,
)
from stickslip.figures.drawing.thinning import strip, thin

if TYPE_CHECKING:
    import xarray

    from stickslip.rate_independent.evolution.averaging_study import AveragingStudy
    from stickslip.rate_independent.evolution.history import History

_FEW = 4  # number of components up to which each has a panel
_ROW = 1.5  # inches
_EXTRA = 1.0  # inches
_WIDTH = 7.2  # inches


def plot_history(history: History) -> Figure:
    """Components over time, grey where they stick (a map of all of them if there are more than
    four), and energies."""
    t, z = history.times, history.z
    n = z.shape[1]
    with paper_style():
        rows = n if n <= _FEW else 2
        figure = new_figure(_WIDTH, _ROW * (rows + 1) + _EXTRA)
        panels: list[Axes] = list(
            figure.subplots(rows + 1, 1, sharex=True, gridspec_kw=_heights(n))
        )
        if n <= _FEW:
            for i in range(n):
                _component(panels[i], t, z[:, i], f"$z_{{{i + 1}}}$" if n > 1 else "$z$")
            legend_above(panels[0], [Patch(color=STICK_SHADE, label="stick")], right=True)
        else:
            _map(figure, panels[0], t, z)
            _slipping(panels[1], history)
        _energies(panels[-1], history)
        panels[-1].set_xlabel("time $t$")
        panels[-1].set_xlim(t[0], t[-1] if t[-1] > t[0] else t[0] + 1.0)
        figure.align_ylabels(panels)
        return figure


def _heights(n: int) -> dict[str, list[float]]:
    return {"height_ratios": [1.0] * (n + 1) if n <= _FEW else [2.0, 1.0, 1.0]}


def _component(axes: Axes, t: Array, z: Array, label: str) -> None:
    """Plot one component; it sticks where it does not change between outputs."""
    strip(axes, t, {STICK_SHADE: np.diff(z) == 0.0}, transform=axes.get_xaxis_transform())
    _line(axes, t, z, color=BLUE)
    axes.set_ylabel(label)


def _line(axes: Axes, t: Array, values: Array, **style: Any) -> None:
    """Plot a line over time with any number of points."""
    t, lines = thin(t, {"values": values})
    axes.plot(t, lines["values"], **style)


def _map(figure: Figure, axes: Axes, t: Array, z: Array) -> None:
    even = np.linspace(t[0], t[-1], min(1500, 4 * len(t)))
    index = np.clip(np.searchsorted(t, even, side="right") - 1, 0, len(t) - 1)
    rows = z[:, :: max(1, z.shape[1] // 1000)]
    largest = float(np.abs(rows).max()) or 1.0
    drawn = axes.imshow(
        rows[index].T,
        aspect="auto",
        extent=(float(t[0]), float(t[-1]), z.shape[1] + 0.5, 0.5),
        cmap="RdBu_r",
        vmin=-largest,
        vmax=largest,
        interpolation="nearest",
    )
    figure.colorbar(drawn, ax=axes, pad=0.01, label="$z$")
    axes.set_ylabel("component")


def _slipping(axes: Axes, history: History) -> None:
    data = history.dataset
    _line(axes, data["step_time"].values, data["slipping"].values.astype(float), color=BLUE, lw=0.8)
    axes.set_ylabel("slipping")
    axes.set_ylim(bottom=0)


def _energies(axes: Axes, history: History) -> None:
    data = history.dataset
    lines = (
        ("energy", "energy", BLUE),
        ("dissipated", "dissipated", VERMILION),
        ("work", "work of the load", GREEN),
    )
    for name, label, colour in lines:
        _line(axes, data["step_time"].values, data[name].values, color=colour, label=label)
    axes.set_ylabel("energy")
    legend_above(axes)


def plot_study(study: AveragingStudy, ax: Axes | None = None) -> Figure:
    """Plot the distance from the averaged motion against ε with its fitted order, and the
    convergence of the rates.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Draw the distances into these axes.
    """
    if ax is not None:
        _motions(ax, study.dataset)
        return root_of(ax)
    with paper_style():
        figure = new_figure(_WIDTH, 3.6)
        left, right = figure.subplots(1, 2)
        _motions(left, study.dataset)
        _rates(right, study.dataset)
        return figure


def _motions(axes: Axes, data: xarray.Dataset) -> None:
    """Plot the distances of the motions from their limit, and the excess of their moduli of
    continuity."""
    epsilon = data["epsilon"].values
    distance = data["distance"].values
    _fitted(axes, epsilon, distance, BLUE, r"$\sup\,|z_\varepsilon - z_0|$")
    _fitted(axes, epsilon, data["equicontinuity"].values, ORANGE, r"$\omega(\varepsilon)$")
    axes.set_ylabel("motions")
    axes.set_xlabel(r"$\varepsilon$")
    axes.legend()


def _rates(axes: Axes, data: xarray.Dataset) -> None:
    """Plot the weak convergence of the rates, and their norms, which do not converge."""
    epsilon = data["epsilon"].values
    weak = data["weak_distance"].max("test").values
    label = r"$|\langle\dot z_\varepsilon - \dot z_0, \varphi\rangle|$"
    _fitted(axes, epsilon, weak, GREEN, label)
    _fitted(axes, epsilon, data["rate_l2"].values, VERMILION, r"$|\dot z_\varepsilon|_{L^2}$")
    axes.set_ylabel("rates")
    axes.set_xlabel(r"$\varepsilon$")
    axes.legend()


def _fitted(axes: Axes, epsilon: Array, values: Array, colour: str, label: str) -> None:
    """Points in double logarithmic axes, with the line of the fitted power."""
    from stickslip.rate_independent.evolution.averaging_study import fitted_power

    power, factor = fitted_power(epsilon, values)
    shown = f"{label} $\\sim \\varepsilon^{{{power:.2f}}}$" if np.isfinite(power) else label
    axes.loglog(epsilon, values, "o", color=colour, ms=4.5, label=shown)
    if np.isfinite(power):
        axes.loglog(epsilon, factor * epsilon**power, color=colour, lw=1.0)
