"""The one model that page and server share beside the figures: what is asked, what is said."""

from __future__ import annotations

from bokeh.core.properties import Any, String
from bokeh.model import DataModel


class Wire(DataModel):
    """Texts are JSON; arrays go in binary, and stand where they are when the text arrives."""

    asked = String(default="")
    arrays = Any(default=None)
    said = String(default="")
