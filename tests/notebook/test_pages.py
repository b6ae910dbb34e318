"""Pages of HTML: well formed, in MathML that says what the terminal says, and nothing unescaped."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import stickslip as ss
from stickslip import page
from stickslip.display.equations import Equations
from stickslip.display.mathml import MathmlWriter, math

TWO = ss.WeightedL1(["2 + cos(2*pi*s)", "1"])
PULL = ss.Evolution(np.eye(2), ["t", "0"], TWO, [0.0, 0.0])
MODEL = """
name = "pull"
title = "A body & a <pull>"
parameters.F = {default = 2.0, unit = "N", meaning = "force"}
A = 1
load = "F*t"
dissipation = {kind = "weighted l1", weights = ["2 + cos(2*pi*s)"]}
"""
SHARED: dict[str, Any] = {
    "potential": TWO,
    "average": TWO.average(),
    "average of a ball": ss.GroupNorm(["1 + cos(2*pi*s)/2"], size=2).average(),
    "average of three": ss.WeightedL1(["2 + cos(2*pi*s)", "1", "1"]).average(),
    "evolution": PULL,
    "field": ss.vector_field(ss.catalogue.belt_block(), {"belt contact": "stick"}),
    "certificate": ss.play("t", 0.5, (0, 1), initial=0.0).certificate,
    "law": ss.laws.lugre,
    "samples": ss.Samples([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], kind="hold", periodic=True),
}
CHILDREN = {"msup": 2, "msub": 2, "msubsup": 3, "mfrac": 2, "mover": 2}


def parsed(text: str) -> ElementTree.Element:
    """The page as a tree; pictures are elements without an end."""
    closed = re.sub(r'(<img [^>]*")>', r"\1/>", text).replace("<br>", "<br/>")
    return ElementTree.fromstring(re.sub("&(?:#160|emsp);", " ", closed))


@pytest.mark.parametrize("name", ss.catalogue.names())
def test_systems_are_pages_of_formulas(name: str) -> None:
    system: ss.System = ss.catalogue.get(name)
    tree = parsed(system._repr_html_())
    for element in tree.iter():
        assert len(element) == CHILDREN.get(element.tag, len(element)), element.tag
        assert element.tag not in ("mi", "mn", "mo") or element.text
    text = "".join(tree.itertext())
    assert (system.title or system.name) in text and system.source in text
    for parameter in system.parameters:
        assert parameter in text
    assert len(list(tree.iter("math"))) >= len(system.coordinates) + len(system.parameters)


def test_formulas_say_what_the_terminal_says() -> None:
    system = ss.System(
        "one of all",
        parameters={"psi_star": ss.Parameter(2.0), "F": ss.Parameter(1e-7)},
        functions={"f(x)": "sqrt(x) + exp(-x**2)/3", "g(x)": "piecewise(x < 0, 1, x < 2, 2, 0.25)"},
        coordinates={"x_R": ss.Inertial(force="f(x_R) - 2.5*g(x_R)*F**3 + 1e-7*floor(x_R)")},
        kinetic="d_x_R**2/2",
        potential="x_R**2/(2*psi_star)",
        contacts={"a<b": ss.Contact("d_x_R", "1", kinetic="1/(1 + speed)")},
    )
    write = Equations(system).writer(MathmlWriter)
    reader = Equations(system)._reader
    wanted = {
        "sqrt(psi_star)": "<msqrt><msup><mi>ψ</mi><mrow><mo>*</mo></mrow></msup></msqrt>",
        "F**3": "<msup><mrow><mi>F</mi></mrow><mrow><mn>3</mn></mrow></msup>",
        "2.5*F": '<mn>2.5</mn><mspace width="0.2em"></mspace><mi>F</mi>',
        "d_x_R": '<msub><mover accent="true"><mi>x</mi><mo>˙</mo></mover>'
        "<mrow><mi>R</mi></mrow></msub>",
        "abs(F)": "<mrow><mo>|</mo><mi>F</mi><mo>|</mo></mrow>",
    }
    for formula, said in wanted.items():
        assert write(reader.read(formula)) == said
    content = "".join(parsed(math(write(reader.read("2*(F - 1e-7)/3")))).itertext())
    assert content.replace(" ", "") == "23(F−10−7)"  # ⅔ (F − 10⁻⁷)
    assert "a&lt;b" in system._repr_html_()
    parsed(system._repr_html_())


@pytest.mark.parametrize("name", SHARED)
def test_others_are_pages(name: str) -> None:
    shown = SHARED[name]._repr_html_()
    parsed(shown)
    drawn = name in ("potential", "average", "average of a ball", "law", "samples")
    assert ("data:image/png" in shown) == drawn
    assert "could not be plotted" not in shown


def test_a_model_file_of_an_evolution(tmp_path: Any) -> None:
    (tmp_path / "pull.toml").write_text(MODEL, encoding="utf-8")
    shown = ss.load_evolution(tmp_path / "pull.toml")._repr_html_()
    parsed(shown)
    assert "A body &amp; a &lt;pull&gt;" in shown and ">F*t" in shown.replace("&quot;", "")


def test_texts_are_escaped_once() -> None:
    cell = page.Html("<b>1</b>")
    assert "<b>1</b></td>" in page.tabled([(cell, "<2>")])
    assert "&lt;2&gt;" in page.tabled([(cell, "<2>")])
    assert page.tabled([]) == "" and page.folded("nothing", "") == ""


def test_quantities_of_results_by_name() -> None:
    motion = ss.simulate(ss.catalogue.belt_block(), (0.0, 2.0))
    assert motion["x"].attrs["units"] == "m"
    with pytest.raises(
        ss.DeclarationError, match=r"trajectory: unknown quantity 'xs'\. Did you mean 'x'"
    ):
        motion["xs"]
    found = ss.equilibria(ss.catalogue.spring_slider())
    assert found["U"].dims == ("equilibrium",) and found[0].state
