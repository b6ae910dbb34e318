"""What is left of data when the motion is taken away."""

from __future__ import annotations

from bokeh.models import HSpan, Scatter

from stickslip.explorer.panels.plots import Panel


def data_residuals() -> Panel:
    """Residuals over the time."""
    panel = Panel()
    plot = panel.plot("data", zooms="width")
    panel.glyph(plot, "data_zero", ["y"], HSpan(y="y", line_color="#888888"), "underlay")
    dots = Scatter(x="x", y="y", size=4, line_color=None, fill_color="color", fill_alpha=0.8)
    panel.glyph(plot, "data_points", ["x", "y", "color"], dots)
    return panel
