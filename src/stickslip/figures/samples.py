"""The picture of samples: a measured function of time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stickslip.figures.drawing.style import BLUE, VERMILION, new_figure, paper_style, root_of

if TYPE_CHECKING:
    from stickslip.model.entries.samples import Samples

_DOTTED = 200  # samples that are shown as dots, too
_FINE = 4000  # places between samples at which a curve is drawn


def plot_samples(samples: Samples, ax: Axes | None = None) -> Figure:
    """Values over time: the samples as dots if they are few, and what is between them.

    Parameters
    ----------
    samples : Samples
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.figure.Figure
    """
    with paper_style():
        ax = new_figure(6.4, 2.8).add_subplot() if ax is None else ax
        times, values = samples.times, samples.values
        many = len(times) > _DOTTED
        if samples.kind == "hold":
            ax.step(times, values, where="post", color=BLUE)
        elif samples.kind == "cubic" and len(times) < _FINE:
            fine = np.union1d(times, np.linspace(*samples.span, _FINE))
            ax.plot(fine, samples(fine), color=BLUE)
        else:
            ax.plot(times, values, color=BLUE, linewidth=1.0 if many else 1.6)
        if not many:
            ax.plot(times, values, "o", color=VERMILION, markersize=3.5)
        source = samples.source
        ax.set_xlabel(source.get("time", "time"))
        ax.set_ylabel(source.get("value", "value"))
        ax.margins(x=0.01)
        return root_of(ax)
