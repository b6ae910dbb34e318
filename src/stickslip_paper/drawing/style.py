"""Common elements of the figures of the paper: arrows, marks and shaded phases."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch
from numpy import ndarray as Array

import stickslip as ss

Point = Sequence[float] | Array


def pair(point: Point) -> tuple[float, float]:
    """The two coordinates."""
    x, y = point
    return float(x), float(y)


def arrow(
    axes: Axes,
    start: Point,
    end: Point,
    colour: str,
    *,
    width: float = 1.4,
    head: float = 11.0,
    tips: str = "-|>",
) -> FancyArrowPatch:
    """A straight arrow in data coordinates."""
    patch = FancyArrowPatch(
        pair(start),
        pair(end),
        arrowstyle=tips,
        mutation_scale=head,
        color=colour,
        lw=width,
        shrinkA=0.0,
        shrinkB=0.0,
        zorder=4,
    )
    axes.add_patch(patch)
    return patch


def heads(
    axes: Axes, x: Array, y: Array, at: Iterable[float], colour: str, size: float = 12.0
) -> None:
    """Arrow heads on a curve, at fractions of its length as it is seen; set the limits of the axes
    before."""
    spans = (np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()))
    length = np.append(0.0, np.cumsum(np.hypot(np.diff(x) / spans[0], np.diff(y) / spans[1])))
    step = 0.006
    for fraction in at:
        ends = np.array([-step, step]) + fraction * length[-1]
        (x_0, x_1), (y_0, y_1) = np.interp(ends, length, x), np.interp(ends, length, y)
        arrow(
            axes, (float(x_0), float(y_0)), (float(x_1), float(y_1)), colour, width=0.0, head=size
        )


def shade(axes: Axes, t: Array, holds: Array, colour: str = ss.style.STICK_SHADE) -> None:
    """Grey where something holds, such as stick, over the whole height."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8)))
    for first, end in edges.reshape(-1, 2).tolist():
        axes.axvspan(float(t[first]), float(t[min(end, len(t) - 1)]), color=colour, lw=0, zorder=0)


def ticks(
    axes: Axes, x: Sequence[tuple[float, str]] = (), y: Sequence[tuple[float, str]] = ()
) -> None:
    """Ticks with names instead of numbers."""
    if x:
        axes.set_xticks([value for value, _ in x], [name for _, name in x])
    if y:
        axes.set_yticks([value for value, _ in y], [name for _, name in y])
