"""The plane of two quantities: the motion, the one before it, and what it settles on."""

from __future__ import annotations

from bokeh.models import MultiLine, Scatter

from stickslip.explorer.panels.plots import Panel


def phase_plane() -> Panel:
    """The curve with its sticking parts, a ghost, equilibria, a cycle, and points of a section."""
    panel = Panel()
    plot = panel.plot("phase")
    lines = ["xs", "ys", "color", "width", "alpha"]
    for name in ("phase_ghost", "phase_cycle", "phase_lines"):
        glyph = MultiLine(
            xs="xs", ys="ys", line_color="color", line_width="width", line_alpha="alpha",
            line_join="round",
        )  # fmt: skip
        panel.glyph(plot, name, lines, glyph)
    spots = ["x", "y", "color", "marker", "size", "fill"]
    for name in ("phase_section", "phase_spots"):
        glyph = Scatter(
            x="x", y="y", size="size", marker="marker", line_color="color", fill_color="fill",
            line_width=2,
        )  # fmt: skip
        panel.glyph(plot, name, spots, glyph)
    return panel
