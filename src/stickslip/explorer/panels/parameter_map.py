"""A map over two parameters: fields that become finer."""

from __future__ import annotations

from bokeh.models import Quad

from stickslip.explorer.panels.plots import Panel


def parameter_map() -> Panel:
    """A field for each point."""
    panel = Panel()
    plot = panel.plot("map")
    fields = Quad(
        left="left",
        right="right",
        bottom="bottom",
        top="top",
        fill_color="color",
        line_color="color",
    )
    panel.glyph(plot, "map_fields", ["left", "right", "bottom", "top", "color"], fields)
    return panel
