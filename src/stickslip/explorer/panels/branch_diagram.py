"""Branches over a parameter: stable parts in full lines, unstable ones dashed, special points."""

from __future__ import annotations

from bokeh.models import MultiLine, Scatter

from stickslip.explorer.panels.plots import Panel


def branch_diagram() -> Panel:
    """Lines of branches, their points, and what is special on them."""
    panel = Panel()
    plot = panel.plot("branch")
    lines = MultiLine(
        xs="xs",
        ys="ys",
        line_color="color",
        line_dash="dash",
        line_width="width",
        line_join="round",
    )
    panel.glyph(plot, "branch_lines", ["xs", "ys", "color", "dash", "width"], lines)
    dots = Scatter(x="x", y="y", size=4, line_color=None, fill_color="color")
    panel.glyph(plot, "branch_points", ["x", "y", "color"], dots)
    marks = Scatter(
        x="x", y="y", size=11, marker="marker", line_color="color", fill_color="fill", line_width=2
    )
    panel.glyph(plot, "branch_special", ["x", "y", "color", "marker", "fill"], marks)
    return panel
