"""The model through which page and server exchange requests and answers."""

from __future__ import annotations

from bokeh.core.properties import Any, String
from bokeh.model import DataModel

WIRE = "wire"
"""Its name in a document."""


class Wire(DataModel):
    """Requests are JSON. Answers are pairs: JSON, and the bytes of all arrays in one piece, since
    each piece needs separate messages."""

    asked = String(default="")
    said = Any(default=None)
