"""A map over two parameters with increasing resolution."""

from __future__ import annotations

from stickslip.explorer.panels.plots import Panel


def parameter_map() -> Panel:
    """A field for each point."""
    panel = Panel()
    panel.fields(panel.plot("map"), "map_fields")
    return panel
