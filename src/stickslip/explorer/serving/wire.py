"""The model through which page and server exchange requests and answers."""

from __future__ import annotations

from bokeh.core.properties import Any, String
from bokeh.model import DataModel

WIRE = "wire"
"""Its name in a document."""


class Wire(DataModel):
    """What is asked is JSON. What is said is a pair: JSON, and the bytes of all its arrays in one
    piece, since each piece takes messages of its own."""

    asked = String(default="")
    said = Any(default=None)
