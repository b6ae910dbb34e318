"""Pieces of Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

_PROSE = Path(__file__).parent / "prose"


def cell(text: str) -> str:
    """A text that may stand in a table."""
    return " ".join(text.split()).replace("|", r"\|") or " "


def filled(name: str, **parts: str) -> str:
    """A page whose prose stands in a file, with the parts that are made.

    Raises
    ------
    KeyError
        If the prose asks for a part that is not given.
    """
    text = (_PROSE / f"{name}.md").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], text)


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    shown = [*lines[:2], *([cell(part) for part in row] for row in lines[2:])]
    return "\n".join("| " + " | ".join(row) + " |" for row in shown) + "\n"


def code(text: str) -> str:
    """A text as code, which may hold bars."""
    return f"`{text}`" if text else ""


def block(language: str, text: str) -> str:
    """A block of code."""
    return f"```{language}\n{text.rstrip()}\n```\n"


def html(text: str) -> str:
    """HTML as it stands."""
    fence = "`" * 6
    return f'{fence}{{raw}} html\n<div class="of-the-library">{text}</div>\n{fence}\n'


def toctree(names: Iterable[str], *, hidden: bool = True, caption: str = "") -> str:
    """Pages below a page."""
    options = [":hidden:"] * hidden + [f":caption: {caption}"] * bool(caption)
    return "\n".join(["```{toctree}", ":maxdepth: 1", *options, "", *names, "```", ""])
