"""What docstrings say of attributes."""

from __future__ import annotations

import inspect
import re
from typing import Any

_SECTION = re.compile(r"^(\w[\w ]*)\n-+\n", re.MULTILINE)


def sections(thing: Any) -> dict[str, str]:
    """The parts of a docstring by their titles; what stands before the first has none."""
    parts = _SECTION.split(inspect.getdoc(thing) or "")
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def described(thing: Any, section: str = "Attributes") -> dict[str, tuple[str, str]]:
    """Type and description of each attribute that a docstring lists."""
    found: dict[str, tuple[str, str]] = {}
    names, kind, lines = [], "", []

    def close() -> None:
        found.update(dict.fromkeys(names, (kind, " ".join(lines))))

    for line in sections(thing).get(section, "").splitlines():
        if line and not line.startswith(" "):
            close()
            left, _, kind = line.partition(" : ")
            names, lines = [name.strip() for name in left.split(",")], []
        elif line.strip():
            lines.append(line.strip())
    close()
    return found


def first_sentence(thing: Any) -> str:
    """What a docstring says first."""
    text = " ".join(sections(thing)[""].split("\n\n")[0].split())
    return markup(text)


def markup(text: str) -> str:
    """What is marked up for Sphinx, as Markdown."""
    text = re.sub(r":\w+:`~?([^`]*)`", lambda m: f"`{m[1].rpartition('.')[2]}`", text)
    return text.replace("``", "`")
