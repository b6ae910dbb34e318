"""The public face: whoever lives outside the library knows its public names alone, each of them is
shown in something that is executed, and all are called in the same way."""

from __future__ import annotations

import ast
import doctest
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

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
    rooms = [ROOT / "docs" / room for room in ("", "tutorials", "how-to", "theory")]
    written = [page for room in rooms for page in sorted(room.glob("*.md"))]
    for page in (ROOT / "README.md", *written):
        yield page.relative_to(ROOT).as_posix(), code_of(page)
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


# The engine's language is shown to those who add to the engine.
LANGUAGE = {
    "stickslip.arrays",
    "stickslip.machine_code.functions",
    "stickslip.translator",
    "stickslip.translator.values",
}
INSIDE = ("docs/design.md", "docs/extending.md")


@pytest.mark.parametrize("place", OUTSIDE)
def test_who_lives_outside_knows_public_names_alone(place: str) -> None:
    assert set(private(OUTSIDE[place])) <= (LANGUAGE if place in INSIDE else set())


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


# --- The shape of calls ---------------------------------------------------------------------------

KEYWORDS = {"initial", "parameters", "rtol", "atol", "progress", "settings", "workers"}
MOST_POSITIONAL = 4


def public_functions() -> Iterator[tuple[str, Any]]:
    """Every public function, with those of the public modules."""
    for name in ss.__all__:
        thing = getattr(ss, name)
        if inspect.ismodule(thing):
            for inner in getattr(thing, "__all__", dir(thing)):
                part = getattr(thing, inner)
                if inspect.isfunction(part) and part.__module__.startswith(thing.__name__):
                    yield f"{name}.{inner}", part
        elif inspect.isfunction(thing):
            yield name, thing


def public_methods() -> Iterator[tuple[str, Any]]:
    """Every public method and property of the public classes, and what calling them does."""
    for name in ss.__all__:
        thing = getattr(ss, name)
        if not inspect.isclass(thing):
            continue
        for owner in thing.__mro__:
            if owner.__module__.split(".")[0] != "stickslip":
                continue
            for inner, part in vars(owner).items():
                if not inner.startswith("_") or inner in ("__init__", "__call__", "__getitem__"):
                    yield f"{name}.{inner}", unwrapped(part)


def unwrapped(part: Any) -> Any:
    """The function in a property or a class method."""
    for inside in ("fget", "func", "__func__"):
        part = getattr(part, inside, part)
    return part


METHODS = {name: part for name, part in public_methods() if inspect.isfunction(part)}
FUNCTIONS = dict(public_functions())


def unannotated(function: Callable[..., Any]) -> list[str]:
    """Parameters without annotation, and ``return``."""
    signature = inspect.signature(function)
    missing = [
        name
        for name, parameter in signature.parameters.items()
        if parameter.annotation is inspect.Parameter.empty and name not in ("self", "cls")
    ]
    return missing + ["return"] * (signature.return_annotation is inspect.Signature.empty)


def positional(function: Callable[..., Any]) -> list[str]:
    """Parameters that may be given by their place."""
    return [
        name
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind in (parameter.POSITIONAL_ONLY, parameter.POSITIONAL_OR_KEYWORD)
        and name not in ("self", "cls")
    ]


def test_public_functions_and_methods_say_their_types() -> None:
    assert len(FUNCTIONS) > 20 and len(METHODS) > 200
    missing = {name: unannotated(part) for name, part in {**FUNCTIONS, **METHODS}.items()}
    assert {name: names for name, names in missing.items() if names} == {}


def test_options_are_given_by_name() -> None:
    for name, function in FUNCTIONS.items():
        assert len(positional(function)) <= MOST_POSITIONAL, name
        assert not KEYWORDS & set(positional(function)), name
    # A declaration and a result are made of their fields, in their order.
    for name, method in METHODS.items():
        if not name.endswith((".__init__", "Evolution.settled")):
            assert not KEYWORDS & set(positional(method)), name


def test_an_option_without_name_is_found() -> None:
    """The tests above can fail."""

    def simulate(system, span: tuple[float, float], initial: float = 0.0, *, rtol: float = 0.1):
        return system, span, initial, rtol

    assert unannotated(simulate) == ["system", "return"]
    assert positional(simulate) == ["system", "span", "initial"]
