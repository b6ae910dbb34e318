"""Eigenvalues of equilibria in the complex plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.figures.drawing.style import (
    STICK_SHADE,
    legend_above,
    line_colours,
    new_figure,
    paper_style,
    root_of,
)

if TYPE_CHECKING:
    from stickslip.orbits.equilibria.equilibrium import Equilibria

_MARKERS = "osD^vPX*"


def plot_eigenvalues(found: Equilibria, ax: Axes | None = None) -> Figure:
    """Plot the eigenvalues of every equilibrium; those in the white half-plane are stable.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Draw into these axes.
    """
    if ax is not None:
        _draw(ax, found)
        if len(found):
            legend_above(ax)
        return root_of(ax)
    with paper_style():
        figure = new_figure(5.2, 4.2)
        _draw(figure.add_subplot(), found)
        if len(found):
            figure.legend(loc="outside upper left", ncols=1)
    return figure


def _draw(axes: Axes, found: Equilibria) -> None:
    """Plot eigenvalues with one marker per kind, and shade the unstable half-plane."""
    colours = line_colours(max(len(found), 1))
    verdicts = {True: "stable", False: "unstable", None: "undecided"}
    for i, e in enumerate(found):
        values = e.eigenvalues or ()
        modes = ", ".join(f"{c} {m}" for c, m in e.modes.items()) or "no contacts"
        axes.plot(
            [z.real for z in values],
            [z.imag for z in values],
            linestyle="none",
            marker=_MARKERS[i % len(_MARKERS)],
            markerfacecolor="none",
            markeredgewidth=1.6,
            color=colours[i],
            label=f"{i + 1}: {modes}, {verdicts[e.stable]}",
            zorder=3,
        )
    axes.margins(0.12)
    low, high = axes.get_xlim()
    reach = max(high, 0.1 * abs(low), 0.02 * axes.get_ylim()[1], 1e-3)
    axes.axvspan(0.0, reach, color=STICK_SHADE, lw=0, zorder=0)
    axes.axhline(0.0, color="#888888", lw=0.6, zorder=1)
    axes.set_xlim(min(low, -0.4 * reach), reach)
    axes.set_xlabel(r"Re $\lambda$")
    axes.set_ylabel(r"Im $\lambda$")
