"""Common parts of the figures of all panels. The page sets the colours of text and grid, for a
light or dark theme; both are lighter than the data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from bokeh.core.enums import RenderLevelType
from bokeh.models import (
    BasicTicker,
    BoxZoomTool,
    ColumnDataSource,
    CustomJSTickFormatter,
    GlyphRenderer,
    Grid,
    LinearAxis,
    Model,
    MultiLine,
    PanTool,
    Plot,
    Quad,
    Range1d,
    Scatter,
    WheelZoomTool,
)

if TYPE_CHECKING:
    from bokeh.models.glyph import Glyph

_TICK = "return explorer.tick(tick, ticks)"  # The page formats numbers.
_LEFT = 58  # pixels to the left of every figure, so that figures below each other are aligned


class Panel:
    """The models of a panel, by the names under which the page finds them."""

    def __init__(self) -> None:
        self.models: dict[str, Model] = {}

    def plot(
        self,
        name: str,
        x_range: Range1d | None = None,
        zooms: Literal["both", "width"] = "both",
        x_axis: bool = True,
        wheel: bool = True,
    ) -> Plot:
        """An empty figure that fills its container.

        Parameters
        ----------
        x_range : Range1d, optional
            One that it shares with others.
        zooms : str
            Which of its axes are zoomed: ``"both"`` or ``"width"``.
        x_axis : bool
            Whether its horizontal axis has numbers.
        wheel : bool
            Whether the wheel zooms.
        """
        plot = Plot(
            name=name,
            x_range=x_range or Range1d(start=0.0, end=1.0),
            y_range=Range1d(start=0.0, end=1.0),
            toolbar_location=None,
            sizing_mode="stretch_both",
            min_border_left=_LEFT,
            min_border_right=14,
            min_border_top=6,
            min_border_bottom=24 if x_axis else 6,
            background_fill_alpha=0.0,
            border_fill_alpha=0.0,
            outline_line_alpha=0.0,
            lod_threshold=None,
            match_aspect=False,
            tags=["explorer"],
        )
        across, up = BasicTicker(desired_num_ticks=7), BasicTicker(desired_num_ticks=4)
        plot.add_layout(Grid(dimension=0, ticker=across, grid_line_width=1))
        plot.add_layout(Grid(dimension=1, ticker=up, grid_line_width=1))
        plain: dict[str, Any] = {
            "major_tick_in": 0,
            "major_tick_out": 3,
            "minor_tick_out": 0,
            "axis_line_width": 1,
        }
        numbers: dict[str, Any] = {
            "major_label_text_font": "system-ui, sans-serif",
            "major_label_text_font_size": "11px",
            "formatter": CustomJSTickFormatter(code=_TICK),
        }
        if x_axis:
            plot.add_layout(LinearAxis(ticker=across, **plain, **numbers), "below")
        plot.add_layout(LinearAxis(ticker=up, **plain, **numbers), "left")
        pan = PanTool(dimensions=zooms)
        box = BoxZoomTool(dimensions=zooms)
        plot.add_tools(pan, box)
        plot.toolbar.active_drag = box if zooms == "width" else pan
        if wheel:
            turned = WheelZoomTool(dimensions=zooms, modifiers={"ctrl": True})
            plot.add_tools(turned)
            plot.toolbar.active_scroll = turned
        self.models[name] = plot
        return plot

    def glyph(
        self,
        plot: Plot,
        name: str,
        columns: Sequence[str],
        glyph: Glyph,
        level: RenderLevelType = "glyph",
    ) -> ColumnDataSource:
        """Add a glyph with initially empty columns to a figure.

        Parameters
        ----------
        name : str
            Name of the columns, for the page.
        """
        source = ColumnDataSource({column: [] for column in columns})
        plot.renderers.append(
            GlyphRenderer(
                data_source=source,
                glyph=glyph,
                level=level,
                selection_glyph=None,
                nonselection_glyph=None,
                muted_glyph=None,
            )
        )
        self.models[name] = source
        return source

    def curves(self, plot: Plot, name: str, *more: Literal["dash", "alpha"]) -> None:
        """Lines through many points, with colour, width and further properties."""
        given: dict[str, Any] = {f"line_{what}": what for what in more}
        lines = MultiLine(
            xs="xs", ys="ys", line_color="color", line_width="width", line_join="round", **given
        )
        self.glyph(plot, name, ["xs", "ys", "color", "width", *more], lines)

    def dots(self, plot: Plot, name: str, alpha: float = 1.0) -> None:
        """Small points, each with a colour."""
        small = Scatter(x="x", y="y", size=4, fill_color="color", fill_alpha=alpha, line_color=None)
        self.glyph(plot, name, ["x", "y", "color"], small)

    def marks(self, plot: Plot, name: str) -> None:
        """Points with shapes of their own."""
        shapes = Scatter(
            x="x", y="y", size="size", marker="marker", line_color="color", fill_color="fill",
            line_width=2,
        )  # fmt: skip
        self.glyph(plot, name, ["x", "y", "color", "marker", "size", "fill"], shapes)

    def fields(self, plot: Plot, name: str) -> None:
        """Rectangles, each with a colour."""
        sides = ["left", "right", "bottom", "top"]
        boxes = Quad(
            left="left", right="right", bottom="bottom", top="top", fill_color="color",
            line_color="color",
        )  # fmt: skip
        self.glyph(plot, name, [*sides, "color"], boxes)


def models_of(panels: Sequence[Panel]) -> Mapping[str, Model]:
    """The models of all panels."""
    return {name: model for panel in panels for name, model in panel.models.items()}
