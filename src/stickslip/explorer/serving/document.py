"""The page as a document: figures, the wire, and the template of the layout."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

from bokeh.document import Document
from bokeh.models import CustomJS, Plot
from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from markupsafe import Markup

from stickslip import catalogue, palette
from stickslip.explorer.asking.request import FIRST_MODEL, GIVEN
from stickslip.explorer.panels.branch_diagram import branch_diagram
from stickslip.explorer.panels.data_residuals import data_residuals
from stickslip.explorer.panels.effective_friction import friction_figures
from stickslip.explorer.panels.motion_rows import ROWS, motion_rows
from stickslip.explorer.panels.parameter_map import parameter_map
from stickslip.explorer.panels.phase_plane import phase_plane
from stickslip.explorer.panels.plots import models_of
from stickslip.explorer.serving.pool import WorkerPool
from stickslip.explorer.serving.session import Session
from stickslip.explorer.serving.wire import WIRE, Wire

_FILES = Path(__file__).parents[1] / "page"
# In the order of their dependences.
SCRIPTS = (
    *("core", "figures", "address", "wire", "controls", "motion", "phase", "mechanism", "clock"),
    *("takeaway", "branches", "map", "friction", "evolution", "data", "start"),
)
PANELS = (
    motion_rows,
    phase_plane,
    branch_diagram,
    parameter_map,
    friction_figures,
    data_residuals,
)


def page_maker(pool: WorkerPool, given: str) -> Callable[[Document], None]:
    """Factory of the documents of pages.

    Parameters
    ----------
    given : str
        The text of a model file, if the explorer was opened with one.
    """
    template = _template()

    def make(document: Document) -> None:
        models = models_of([make_panel() for make_panel in PANELS])
        wire = Wire(name=WIRE)
        plots = [model for model in models.values() if isinstance(model, Plot)]
        plots[0].tags = [wire]  # makes it part of the document
        with document.models.freeze():  # one pass over all models
            for plot in plots:
                document.add_root(plot)
        document.title = "stickslip explorer"
        document.template = template
        document.template_variables.update(
            scripts=_scripts(),
            styles=Markup(_read("common.css") + _read("page.css")),
            rows=range(ROWS),
            facts={
                "catalogue": catalogue.names(),
                "first": GIVEN if given else FIRST_MODEL,
                "colours": {
                    "lines": palette.LINES,
                    "threshold": palette.THRESHOLD,
                    "slip+": palette.SLIP[1],
                    "slip-": palette.SLIP[-1],
                },
            },
        )
        Session(document, wire, pool, given)
        begin = CustomJS(args={"wire": wire, "models": models}, code="explorer.begin(wire, models)")
        document.js_on_event("document_ready", begin)

    return make


@cache
def _template() -> Template:
    files = Environment(loader=FileSystemLoader(_FILES), undefined=StrictUndefined, autoescape=True)
    return files.get_template("page.html")


@cache
def _scripts() -> Markup:
    # Each in a separate block, so that names that a file does not attach to `explorer` are local.
    return Markup("\n".join(f"{{\n{_read(f'{name}.js')}}}" for name in SCRIPTS))


@cache
def _read(name: str) -> str:
    return (_FILES / name).read_text(encoding="utf-8")
