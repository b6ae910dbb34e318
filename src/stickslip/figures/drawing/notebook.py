"""Pictures inside a page of HTML, such as a notebook."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable

from matplotlib.figure import Figure

_DOTS = 100  # per inch, on a screen


def embedded(draw: Callable[[], Figure]) -> str:
    """A picture as an element of HTML that needs no file.

    A picture never costs a result: where it cannot be drawn, the element says why.
    """
    from html import escape

    from stickslip.figures.drawing.style import paper_style

    buffer = io.BytesIO()
    try:
        with paper_style():
            draw().savefig(buffer, format="png", dpi=_DOTS)
    except Exception as error:  # whatever it is, it says nothing about the result
        return (
            f"<p>{escape(f'the picture could not be drawn ({type(error).__name__}: {error})')}</p>"
        )
    data = base64.b64encode(buffer.getvalue()).decode()
    return f'<img alt="picture of the result" src="data:image/png;base64,{data}">'
