"""The plane of two quantities: the motion, the previous motion, and the attractor."""

from __future__ import annotations

from stickslip.explorer.panels.plots import Panel


def phase_plane() -> Panel:
    """The curve with its sticking parts, a ghost, equilibria, a cycle, and points of a section."""
    panel = Panel()
    plot = panel.plot("phase")
    for name in ("phase_ghost", "phase_cycle", "phase_lines"):
        panel.curves(plot, name, "alpha")
    for name in ("phase_section", "phase_spots"):
        panel.marks(plot, name)
    return panel
