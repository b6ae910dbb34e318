"""The motion over time: a few rows with a common time axis."""

from __future__ import annotations

from bokeh.models import Range1d, VStrip

from stickslip.explorer.panels.plots import Panel

ROWS = 4


def motion_rows() -> Panel:
    """Rows for coordinates, rates and friction forces: lines, with stick phases shaded."""
    panel = Panel()
    time = Range1d(start=0.0, end=1.0)
    for row in range(ROWS):
        name = f"motion{row}"
        last = row == ROWS - 1
        plot = panel.plot(name, time, "width", x_axis=last)
        panel.glyph(
            plot,
            f"{name}_stick",
            ["x0", "x1"],
            VStrip(x0="x0", x1="x1", fill_color="#888888", fill_alpha=0.16, line_color=None),
            "underlay",
        )
        panel.curves(plot, f"{name}_lines", "dash")
        panel.dots(plot, f"{name}_data", 0.6)
    panel.models["time"] = time
    return panel
