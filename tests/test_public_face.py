"""The public face: whoever lives outside the library knows its public names alone, and each of them
is shown in something that is executed."""

from __future__ import annotations

import ast
import doctest
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import stickslip as ss
import stickslip_paper

ROOT = Path(__file__).parents[1]
COMPANION = Path(stickslip_paper.__file__).parent
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def code_of(page: Path) -> str:
    """The Python that a page shows: blocks of Python, or what a session types in."""
    code = []
    for language, block in BLOCK.findall(page.read_text(encoding="utf-8")):
        if language == "python":
            code.append(block)
        if language == "pycon":
            code += [example.source for example in doctest.DocTestParser().get_examples(block)]
    return "".join(code)


def shown() -> Iterator[tuple[str, str]]:
    """Every piece of code that a reader is shown and that tests execute, with its place."""
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        yield page.name, code_of(page)
    for path in sorted((ROOT / "examples").glob("*.py")):
        yield path.name, path.read_text(encoding="utf-8")


SHOWN = dict(shown())
OUTSIDE = SHOWN | {
    path.relative_to(COMPANION.parent).as_posix(): path.read_text(encoding="utf-8")
    for path in sorted(COMPANION.rglob("*.py"))
}


def private(code: str) -> list[str]:
    """What code uses of the library that is not public: imports of anything but ``stickslip`` and
    its public names, other names of it, and attributes that begin with an underscore."""
    found = []
    own = {"ss", "stickslip"}
    for node in ast.walk(ast.parse(code)):
        match node:
            case ast.Import(names=names):
                found += [a.name for a in names if a.name.startswith("stickslip.")]
            case ast.ImportFrom(module=str(module), names=names):
                if module.startswith("stickslip."):
                    found.append(module)
                if module == "stickslip":
                    found += [f"stickslip.{a.name}" for a in names if a.name not in ss.__all__]
            case ast.Attribute(value=ast.Name(id=name), attr=attribute) if name in own:
                found += [] if attribute in ss.__all__ else [f"stickslip.{attribute}"]
            case ast.Attribute(value=value, attr=attribute):
                ours = isinstance(value, ast.Name) and value.id in ("self", "cls")
                if attribute.startswith("_") and not attribute.endswith("__") and not ours:
                    found.append(attribute)
    return found


@pytest.mark.parametrize("place", OUTSIDE)
def test_who_lives_outside_knows_public_names_alone(place: str) -> None:
    assert private(OUTSIDE[place]) == []


def test_what_is_private_is_found() -> None:
    """The test above can fail."""
    code = """
import numpy as np, stickslip.errors
import stickslip as ss
from stickslip import simulate, storage
from stickslip.figures import motion

ss.motion.simulate.simulate(ss.play._state, self._own)
"""
    assert set(private(code)) == {
        "stickslip.errors",
        "stickslip.storage",
        "stickslip.figures",
        "stickslip.motion",
        "_state",
    }
    assert private("import stickslip as ss\nss.simulate(x.__class__)") == []


def public_names(code: str) -> set[str]:
    """Names ``ss.name`` that code uses."""
    return {
        node.attr
        for node in ast.walk(ast.parse(code))
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "ss"
    }


def test_every_public_name_is_shown() -> None:
    used = {name for code in SHOWN.values() for name in public_names(code)}
    assert set(ss.__all__) - used == set()


def test_names_in_texts_are_not_enough() -> None:
    """The test above can fail."""
    assert public_names('x = ss.play("ss.sweep")  # ss.basin') == {"play"}
