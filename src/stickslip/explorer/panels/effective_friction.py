"""Thresholds over a period with their average, and, for two contacts, the forces in the moving
stable set."""

from __future__ import annotations

from bokeh.models import HStrip, VStrip

from stickslip.explorer.panels.plots import Panel


def friction_figures() -> Panel:
    """The figure over the time, and the one in the plane of two forces."""
    panel = Panel()
    over_time = panel.plot("friction", zooms="width")
    slip = VStrip(x0="x0", x1="x1", fill_color="color", fill_alpha=0.14, line_color=None)
    panel.glyph(over_time, "friction_slip", ["x0", "x1", "color"], slip, "underlay")
    average = HStrip(y0="y0", y1="y1", fill_color="color", fill_alpha=0.16, line_color="color")
    panel.glyph(over_time, "friction_average", ["y0", "y1", "color"], average, "underlay")
    panel.curves(over_time, "friction_lines", "dash")
    plane = panel.plot("forces")
    panel.fields(plane, "forces_sets")
    panel.curves(plane, "forces_lines", "dash")
    return panel
