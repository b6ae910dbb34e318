"""Residuals of data with respect to a motion."""

from __future__ import annotations

from bokeh.models import HSpan

from stickslip.explorer.panels.plots import Panel


def data_residuals() -> Panel:
    """Residuals over the time."""
    panel = Panel()
    plot = panel.plot("data", zooms="width")
    panel.glyph(plot, "data_zero", ["y"], HSpan(y="y", line_color="#888888"), "underlay")
    panel.dots(plot, "data_points", 0.8)
    return panel
