"""A notebook, executed by a real kernel: pictures without a magic word, none of them twice, bars
that go again, names that are completed."""

from __future__ import annotations

from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

CELLS = {
    "start": "import stickslip as ss\nblock = ss.catalogue.belt_block()",
    "system": "block",
    "result": "motion = ss.simulate(block, (0.0, 8.0))\nmotion",
    "figure": "motion.plot()",
    "quantity": 'motion.plot("x")',
    "samples": 'ss.Samples([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], kind="cubic")',
    "law": "ss.laws.coulomb",
    "average": 'ss.WeightedL1(["2 + cos(2*pi*s)", "1"]).average()',
    "completed": """
from IPython.core.completer import provisionalcompleter
def completed(text):
    with provisionalcompleter():
        return [found.text for found in get_ipython().Completer.completions(text, len(text))]
print(completed('motion["fric'))
print(completed('block.parameters["'))
print(completed('motion.certificate["e'))
print(completed("ss.catalogue.belt"))
""",
    "quiet": """
from stickslip import progress
with progress.watched("quick") as show:
    show(0.5)
""",
    "bar": """
progress.PATIENCE = progress._EVERY = 0.0
with progress.watched("outer") as show:
    show(0.25, "<first>")
    with progress.reporting(None, "inner", patience=0.0) as inner:
        inner(None)
    shown = progress._page.handle is not None
""",
    "threads": """
import threading
def work():
    with progress.watched("elsewhere") as show:
        show(0.5)
thread = threading.Thread(target=work)
thread.start()
thread.join()
""",
    "own axes": """
from matplotlib.figure import Figure
mine = Figure()
motion.plot("x", ax=mine.subplots())
print(shown, type(motion.plot()).__name__)
""",
    "inline": "%matplotlib inline\nmotion.plot()",
    "inline result": "motion",
}


@pytest.fixture(scope="module")
def outputs() -> dict[str, list[Any]]:
    """What the cells of the notebook show."""
    cells = [nbformat.v4.new_code_cell(source) for source in CELLS.values()]
    notebook = nbformat.v4.new_notebook(cells=cells)
    NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    return {name: cell.outputs for name, cell in zip(CELLS, notebook.cells, strict=True)}


def pages(found: list[Any]) -> list[str]:
    return [output.data["text/html"] for output in found if "text/html" in output.get("data", {})]


def pictures(found: list[Any]) -> int:
    return sum("image/png" in output.get("data", {}) for output in found)


def printed(found: list[Any]) -> list[str]:
    said = (str(output.text) for output in found if output.output_type == "stream")
    return "".join(said).splitlines()


@pytest.mark.parametrize("cell", ["figure", "quantity", "inline"])
def test_a_figure_is_shown_once(outputs: dict[str, list[Any]], cell: str) -> None:
    assert pictures(outputs[cell]) == 1
    assert len(outputs[cell]) == 1


@pytest.mark.parametrize("cell", ["result", "inline result", "samples", "law", "average"])
def test_what_has_a_picture_is_a_page_with_one(outputs: dict[str, list[Any]], cell: str) -> None:
    (page,) = pages(outputs[cell])
    assert page.count("data:image/png;base64,") == 1
    assert "could not be plotted" not in page
    assert len(outputs[cell]) == 1


def test_a_result_says_its_verdict_and_its_parameters(outputs: dict[str, list[Any]]) -> None:
    (page,) = pages(outputs["result"])
    assert "certified: all residuals below" in page and "friction law" in page
    assert "speed of the belt" in page and ">m/s</td>" in page


def test_a_system_is_a_page_of_formulas(outputs: dict[str, list[Any]]) -> None:
    (page,) = pages(outputs["system"])
    assert page.count("<math") >= 8
    assert "mass of the block" in page and "Popov" in page


def test_names_are_completed(outputs: dict[str, list[Any]]) -> None:
    quantity, parameter, residual, system = printed(outputs["completed"])
    assert "friction_belt_contact" in quantity
    assert all(name in parameter for name in ("F_s", "F_k", "V"))
    assert "energy balance" in residual and "friction law" not in residual
    assert "belt_block" in system and "belt_stribeck" in system


def test_a_bar_is_shown_and_goes_again(outputs: dict[str, list[Any]]) -> None:
    assert outputs["quiet"] == []
    (bar,) = outputs["bar"]
    assert bar.data["text/html"] == ""
    assert outputs["threads"] == []
    assert printed(outputs["own axes"])[0] == "True Picture"
