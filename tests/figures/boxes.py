"""Whether what is written in a picture can be read: no text on another one, none off the page."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

_SLACK = 0.5  # pixels by which boxes may touch


def misread(figure: Figure) -> list[str]:
    """What is wrong with the texts of a picture.

    Parameters
    ----------
    figure : Figure
        It is laid out here.
    """
    figure.draw_without_rendering()
    page = figure.bbox
    boxes = [(said(text), box(text)) for text in written(figure)]
    found = [
        f"'{name}' is off the page"
        for name, b in boxes
        if b.x0 < page.x0 - _SLACK
        or b.x1 > page.x1 + _SLACK
        or b.y0 < page.y0 - _SLACK
        or b.y1 > page.y1 + _SLACK
    ]
    found += [
        f"'{one}' and '{other}' overlap"
        for (one, a), (other, b) in combinations(boxes, 2)
        if a.x0 < b.x1 - _SLACK
        and b.x0 < a.x1 - _SLACK
        and a.y0 < b.y1 - _SLACK
        and b.y0 < a.y1 - _SLACK
    ]
    return found


def written(figure: Figure) -> list[Text]:
    """All that can be seen of the texts of a picture: labels of ticks and axes, titles, legends,
    names of panels and lines."""
    found = [*figure.texts]
    for legend in figure.legends:
        found += legend.get_texts()
    for axes in figure.axes:
        if not axes.get_visible():
            continue
        found += [*axes.texts, axes.title, axes._left_title, axes._right_title]  # type: ignore[attr-defined]
        for legend in {*axes.findobj(Legend)}:
            found += legend.get_texts()
        if axes.axison:
            found += [text for axis in (axes.xaxis, axes.yaxis) for text in along(axis)]
    return [text for text in found if text.get_visible() and text.get_text().strip()]


def along(axis: Axis) -> list[Text]:
    """What stands at an axis."""
    low, high = sorted(axis.get_view_interval())
    slack = 1e-9 * (high - low)
    ticks = [
        tick
        for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks())
        if low - slack <= tick.get_loc() <= high + slack
    ]
    labels = [text for tick in ticks for text in (tick.label1, tick.label2)]
    return [*labels, axis.label, axis.offsetText]


def box(text: Text) -> Bbox:
    """Where a text is, in pixels."""
    return text.get_window_extent()


def said(text: Text) -> str:
    """A text on one line."""
    return " ".join(text.get_text().split())


def hatched(axes: Axes) -> list[tuple[str, np.ndarray]]:
    """What is hatched in axes: the letter, and the corners of each rectangle, shape (rectangles, 5,
    2)."""
    from matplotlib.patches import PathPatch

    patches = [p for p in axes.patches if isinstance(p, PathPatch) and p.get_hatch()]
    return [
        (str(p.get_hatch())[0], np.asarray(p.get_path().vertices).reshape(-1, 5, 2))
        for p in patches
    ]
