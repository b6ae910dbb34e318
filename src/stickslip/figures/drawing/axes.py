"""Limits and labels of axes that several quantities share."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

import numpy as np
from matplotlib.axes import Axes

from stickslip.arrays import Array
from stickslip.figures.drawing.style import (
    axis_label,
)

# lines in one panel, or contacts with a panel of their own, above which a map is drawn instead
MANY_LINES = 4
_ROOM = 16  # number of letters of the names that fit next to the axis of a panel


def label_of_several(names: Sequence[str], unit: str) -> str:
    """The label of an axis for several variables: all of them, or the first and the last, or their
    common prefix, depending on the space. The legend names each."""
    if len(names) <= MANY_LINES and sum(map(len, names)) <= _ROOM:
        return axis_label(names, unit)
    alike = takewhile(lambda letters: len({*letters}) == 1, zip(*names, strict=False))
    stem = "".join(letters[0] for letters in alike).partition("[")[0].rstrip("0123456789_")
    whole = stem not in ("", "d") and all(name[len(stem)] in "[_0123456789" for name in names)
    if whole and len(names[0]) + len(names[-1]) > _ROOM:
        return axis_label([stem], unit)
    return axis_label([names[0], names[-1]], unit).replace(", ", r" $\ldots$ ", 1)


def set_roomy_limits(axes: Axes, values: Array) -> None:
    """Set limits with a margin, also for a constant."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    air = 0.07 * (high - low)
    if air <= 1e-9 * max(abs(low), abs(high)):
        air = 0.1 * max(abs(low), abs(high)) or 1.0
    axes.set_ylim(low - air, high + air)


def label_rows(axes: Axes, labels: list[str]) -> None:
    """Label rows of a map; only some if there are many."""
    shown = spread_out(len(labels))
    axes.set_yticks([i + 1 for i in shown], [labels[i] for i in shown])
    axes.tick_params(axis="y", length=0, labelsize=9)


def spread_out(count: int) -> range:
    """Indices of at most eight of many items, evenly spaced from the first."""
    return range(0, count, -(-count // 8))
