"""Parts of HTML for the pages that notebooks show."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

from stickslip.errors import MissingPackageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip.model.system import Parameter

# Notebooks align cells of tables at the right.
_CELL = '<td style="text-align:left">'
_HEAD = '<th style="text-align:left">'


class Html(str):
    """A text that is HTML already; all others are escaped."""


def text(content: str) -> Html:
    """HTML of a text."""
    return content if isinstance(content, Html) else Html(escape(content))


def headline(title: str, source: str = "") -> Html:
    """Title and source."""
    return Html(f"<p><b>{text(title)}</b>{text(f' ({source})' if source else '')}</p>")


def paragraph(content: str) -> Html:
    """A paragraph."""
    return Html(f"<p>{text(content)}</p>") if content else Html("")


def tabled(rows: Iterable[Sequence[str]], headings: Sequence[str] = ()) -> Html:
    """Rows as a table; columns that are empty throughout are left out."""
    rows = [*map(list, rows)]
    if not rows:
        return Html("")
    kept = [k for k in range(len(rows[0])) if any(row[k] for row in rows)]
    lines = ["".join(f"{_CELL}{text(row[k])}</td>" for k in kept) for row in rows]
    if headings:
        lines.insert(0, "".join(f"{_HEAD}{text(headings[k])}</th>" for k in kept))
    return Html(f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>")


def parameters(values: Mapping[str, float], declared: Mapping[str, Parameter]) -> Html:
    """Values of parameters, with their declarations."""
    from stickslip.display.symbols import unicode_unit

    rows = []
    for name, value in values.items():
        known = declared.get(name)
        unit, meaning = (unicode_unit(known.unit), known.meaning) if known else ("", "")
        rows.append((name, f"{value:.9g}", unit, meaning))
    return tabled(rows, ("parameter", "value", "unit", "meaning"))


def folded(title: str, content: str) -> Html:
    """A section that is shown when its title is clicked; empty if it has no content."""
    if not content:
        return Html("")
    return Html(f"<details><summary>{text(title)}</summary>{text(content)}</details>")


def image(png: bytes) -> Html:
    """A picture that needs no file."""
    data = base64.b64encode(png).decode()
    return Html(f'<img alt="picture of the result" src="data:image/png;base64,{data}">')


def drawn(draw: Callable[[], Figure]) -> Html:
    """A picture that needs no file, or why there is none."""
    try:
        from stickslip.figures.drawing.notebook import embedded
    except MissingPackageError as missing:
        return paragraph(str(missing))
    return embedded(draw)


def whole(*parts: str) -> str:
    """A page."""
    return f"<div>{''.join(map(text, parts))}</div>"
