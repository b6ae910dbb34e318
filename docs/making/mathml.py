"""Mathematics of the pages as MathML, which browsers show without a script and without a font from
elsewhere."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert


def mathml(latex: str, display: str = "inline") -> str:
    """A formula as MathML.

    Raises
    ------
    ValueError
        If an environment is one that the converter does not know: it would show it as letters.
    """
    if r"\\" in latex and r"\begin" not in latex:
        latex = rf"\begin{{aligned}}{latex}\end{{aligned}}"
    made = convert(latex.replace("{aligned}", "{align*}"), display=display)
    if "<mi>&</mi>" in made or "<mi>\\" in made:
        raise ValueError(f"this formula was not understood: {latex}")
    return made


def _inline(self: Any, node: nodes.math) -> None:
    self.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def _displayed(self: Any, node: nodes.math_block) -> None:
    self.body.append(f'<div class="displayed">{mathml(node.astext(), "block")}</div>\n')
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, Any]:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
