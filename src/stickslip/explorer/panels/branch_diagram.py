"""Branches in a parameter: stable parts in full lines, unstable ones dashed, special points."""

from __future__ import annotations

from stickslip.explorer.panels.plots import Panel


def branch_diagram() -> Panel:
    """Lines of branches, with their points and special points."""
    panel = Panel()
    plot = panel.plot("branch")
    panel.curves(plot, "branch_lines", "dash")
    panel.dots(plot, "branch_points")
    panel.marks(plot, "branch_special")
    return panel
