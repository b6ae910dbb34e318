"""Figures inside an HTML page, such as a notebook."""

from __future__ import annotations

import io
from collections.abc import Callable

from matplotlib.figure import Figure

from stickslip.figures.drawing.style import paper_style
from stickslip.page import Html, image, paragraph

_DOTS = 100  # dots per inch on a screen


def embedded(draw: Callable[[], Figure]) -> Html:
    """A figure as an HTML element without external files.

    A failure of the figure does not affect the result: the element then contains the reason.
    """
    buffer = io.BytesIO()
    try:
        with paper_style():
            draw().savefig(buffer, format="png", dpi=_DOTS)
    except Exception as error:  # an error of the figure does not affect the result
        return paragraph(f"the figure could not be plotted ({type(error).__name__}: {error})")
    return image(buffer.getvalue())
