"""The plan of the house and of its companion: how many files a room has, which way imports go, and
what is said of arguments."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import stickslip
import stickslip_paper

SOURCE = Path(stickslip.__file__).parent
COMPANION = Path(stickslip_paper.__file__).parent
DOZEN = 12
# what a result or a system shows of itself when it is asked
PICTURES = ("stickslip.figures", "stickslip.display", "stickslip.orbits.sensitivities")


class Import(NamedTuple):
    """What a module imports, and whether it does so at once."""

    name: str
    at_once: bool


def module_of(path: Path) -> str:
    """Dotted name of a file, or of the room whose ``__init__`` it is."""
    source = next(source for source in (SOURCE, COMPANION) if path.is_relative_to(source))
    parts = path.relative_to(source.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {
    module_of(path): path for source in (SOURCE, COMPANION) for path in sorted(source.rglob("*.py"))
}
ROOMS = {name for name, path in MODULES.items() if path.stem == "__init__"}


def room_of(name: str) -> str:
    """The room a module is in; a room is in itself."""
    return name if name in ROOMS else name.rpartition(".")[0]


def imports_of(node: ast.AST, at_once: bool = True) -> Iterator[Import]:
    """What is imported below a node; what is imported for types alone is not."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ImportFrom):
            assert child.level == 0, "imports are absolute"
            for alias in child.names:
                whole = f"{child.module}.{alias.name}"
                yield Import(whole if whole in MODULES else child.module or "", at_once)
        elif isinstance(child, ast.Import):
            yield from (Import(alias.name, at_once) for alias in child.names)
        elif not (isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)):
            yield from imports_of(child, at_once and not isinstance(child, ast.FunctionDef))


IMPORTS = {
    name: [
        found
        for found in imports_of(ast.parse(path.read_text(encoding="utf-8")))
        if found.name in MODULES
    ]
    for name, path in MODULES.items()
}


def arrows(lazy: bool) -> dict[str, set[str]]:
    """From each room to those it imports from; lazily, too, but for pictures."""
    found: dict[str, set[str]] = {room: set() for room in ROOMS}
    for name, imported in IMPORTS.items():
        used = {i.name for i in imported if i.at_once or (lazy and not i.name.startswith(PICTURES))}
        found[room_of(name)] |= {room_of(other) for other in used} - {room_of(name)}
    return found


def circle(arrows: dict[str, set[str]]) -> list[str]:
    """Rooms in a circle of arrows, if there is one."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_no_room_is_a_hall() -> None:
    """A dozen files at most, unless they know nothing of each other: then it is a shelf."""
    for room in ROOMS:
        files = {name for name in MODULES if name not in ROOMS and room_of(name) == room}
        used = {i.name for name in files for i in IMPORTS[name]}
        assert len(files) <= DOZEN or not files & used, f"{room} has {len(files)} files"


def test_no_import_runs_up() -> None:
    """There is an order of the rooms such that each imports from those before it alone, at once or
    when it is used."""
    assert not circle(arrows(lazy=False))
    assert not circle(arrows(lazy=True))


def test_a_circle_is_found() -> None:
    """The test above can fail."""
    assert set(circle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}})) == {"a", "b", "c"}
    assert any(
        i.name == "stickslip.figures.motion" and not i.at_once
        for i in IMPORTS["stickslip.motion.trajectory"]
    )
    assert "stickslip.errors" in {i.name for i in IMPORTS["stickslip.model.declaration"]}


def test_the_library_needs_nothing_that_only_the_paper_needs() -> None:
    for name, path in MODULES.items():
        if path.is_relative_to(SOURCE):
            roots = {
                i.name.partition(".")[0]
                for i in imports_of(ast.parse(path.read_text(encoding="utf-8")))
            }
            assert not roots & {"sympy", "PIL", "stickslip_paper"}, name


def defined_in(source: str) -> set[str]:
    """Public names that a module defines itself."""
    found: set[str] = set()
    for node in ast.parse(source).body:
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                found.add(name)
            case ast.Assign(targets=targets):
                names = (part for target in targets for part in ast.walk(target))
                found |= {part.id for part in names if isinstance(part, ast.Name)}
            case ast.AnnAssign(target=ast.Name(id=name)):
                found.add(name)
    return {name for name in found if not name.startswith("_")}


def test_a_public_name_has_one_home() -> None:
    """What is called by one name in two modules is either one thing, or deserves two names; the
    translator knows nothing of the library, and could be lifted out with names of its own."""
    homes: dict[str, list[str]] = {}
    for module, path in MODULES.items():
        if path.is_relative_to(SOURCE) and not module.startswith("stickslip.translator"):
            for name in defined_in(path.read_text(encoding="utf-8")):
                homes.setdefault(name, []).append(module)
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}


def test_a_second_home_is_found() -> None:
    assert defined_in("a: int = 1\nB, C = range(2)\n_d = 3\ndef e(): f = 4\n") == {
        "a",
        "B",
        "C",
        "e",
    }


# Helpers of the tape: what they take is said once, at the tables that they share.
SHARED_TABLES = (
    "stickslip.equations.codegen",
    "stickslip.equations.native",
    "stickslip.machine_code.interface",
    "stickslip.motion.steps.arrays",
)
MANY = 5


def unexplained(module: ast.Module, public: set[str]) -> list[str]:
    """Public functions, and functions and methods with a public name and many arguments, whose
    docstrings have no section on their parameters. A method without docstring does what the one
    does that it stands for."""
    found = []
    for owner in (module, *(node for node in module.body if isinstance(node, ast.ClassDef))):
        for node in owner.body:
            if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
                continue
            a = node.args
            names = [
                x.arg for x in (*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg) if x
            ]
            count = len([name for name in names if name not in ("self", "cls")])
            doc = ast.get_docstring(node)
            asked = count >= MANY or (owner is module and count and node.name in public)
            told = doc is not None and "Parameters\n----------\n" in doc
            inherited = doc is None and isinstance(owner, ast.ClassDef)
            if asked and not told and not inherited:
                found.append(node.name)
    return found


def test_many_arguments_are_explained() -> None:
    public = set(stickslip.__all__)
    for name, path in MODULES.items():
        # The options of the commands are explained where they are declared, for --help.
        if name.startswith((*SHARED_TABLES, "stickslip.cli", "stickslip_paper")):
            continue
        assert unexplained(ast.parse(path.read_text(encoding="utf-8")), public) == [], name


def test_arguments_without_explanation_are_found() -> None:
    """The test above can fail."""
    code = """
def play(load): "A play."
def follow(a, b, c, d, *, e): "Follow."
def told(a, b, c, d, e):
    '''Told.

    Parameters
    ----------
    a, b, c, d, e : float
    '''
def few(a, b): "Few."
class Steps:
    def between(self, a, b, c, d, e): ...
    def advance(self, a, b, c, d, e): "Advance."
"""
    assert unexplained(ast.parse(code), {"play"}) == ["play", "follow", "advance"]
