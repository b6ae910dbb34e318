"""The plan of the house and of its companion: how many files a room has, which way imports go, and
what is said of arguments."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator, Set
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import stickslip
import stickslip_paper

SOURCE = Path(stickslip.__file__).parent
COMPANION = Path(stickslip_paper.__file__).parent
DOZEN = 12
SECTION = re.compile(
    r"^(Parameters|Attributes|Returns)\n-{3,}\n(.*?)(?=^\w[\w ]*\n-{3,}\n|\Z)",
    re.MULTILINE | re.DOTALL,
)
SAYS_MORE = re.compile(r"shape|optional|\bunits?\b")
COMPOUND = re.compile(r"([A-Z][a-z]+){2,}(?<!Error)")  # exceptions are named in sentences
SEEN_BY_USERS = ("stickslip.certificates", "stickslip.results")  # although they are not exported
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


@cache
def imported() -> dict[str, list[Import]]:
    """What each module imports of the house."""
    return {
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
    for name, own in imported().items():
        used = {i.name for i in own if i.at_once or (lazy and not i.name.startswith(PICTURES))}
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
        used = {i.name for name in files for i in imported()[name]}
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
        for i in imported()["stickslip.motion.trajectory"]
    )
    assert "stickslip.errors" in {i.name for i in imported()["stickslip.model.declaration"]}


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


def test_an_exported_name_has_one_home() -> None:
    homes: dict[str, list[str]] = {}
    for module, path in MODULES.items():
        if path.is_relative_to(SOURCE):
            for name in defined_in(path.read_text(encoding="utf-8")) & {*stickslip.__all__}:
                homes.setdefault(name, []).append(module)
    assert len(homes) > 80
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}


def test_a_second_home_is_found() -> None:
    assert defined_in("a: int = 1\nB, C = range(2)\n_d = 3\ndef e(): f = 4\n") == {
        "a",
        "B",
        "C",
        "e",
    }


def exported() -> set[tuple[str, str]]:
    """Modules and names of the functions and classes that the library exports, and of what exported
    classes inherit."""
    offered = [getattr(stickslip, name) for name in (*stickslip.__all__, "open")]
    for space in filter(inspect.ismodule, [*offered]):
        offered += [getattr(space, name) for name in dir(space) if not name.startswith("_")]
    found: set[tuple[str, str]] = set()
    for thing in offered:
        plain = inspect.unwrap(thing) if callable(thing) else thing
        parts = plain.__mro__ if inspect.isclass(plain) else [plain]
        named = [part for part in parts if inspect.isroutine(part) or inspect.isclass(part)]
        found |= {(part.__module__, part.__qualname__) for part in named}
    return {(module, name) for module, name in found if module.startswith("stickslip")}


Documented = ast.FunctionDef | ast.ClassDef


def documented(
    node: ast.Module | Documented,
    module: str,
    public: Set[tuple[str, str]],
    before: str = "",
    inside: bool = False,
) -> Iterator[tuple[Documented, str, bool]]:
    """Functions and classes with their dotted names, and whether they are exported."""
    for child in node.body:
        if isinstance(child, ast.FunctionDef | ast.ClassDef):
            name = f"{before}{child.name}"
            private = child.name.startswith("_") and child.name != "__init__"
            out = not private and (inside or (module, name) in public)
            yield child, name, out
            yield from documented(child, module, public, f"{name}.", out)


def sections(doc: str) -> Iterator[tuple[str, list[tuple[str, bool]]]]:
    """Sections of a docstring that list things: its title, the head of each entry, and whether
    something is said of it."""
    for title, text in SECTION.findall(doc):
        lines = text.rstrip().split("\n")
        heads = [i for i, line in enumerate(lines) if line and not line.startswith(" ")]
        yield title, [(lines[i], i + 1 < len(lines) and lines[i + 1][:1] == " ") for i in heads]


def unexplained(module: ast.Module, name: str, public: Set[tuple[str, str]]) -> list[str]:
    """Exported functions whose docstrings do not list their parameters."""
    found = []
    for node, path, out in documented(module, name, public):
        if isinstance(node, ast.FunctionDef) and out and "." not in path and node.args.args:
            listed = dict(sections(ast.get_docstring(node) or ""))
            found += [] if listed.get("Parameters") else [path]
    return found


def repeated(module: ast.Module, name: str, public: Set[tuple[str, str]]) -> list[str]:
    """Entries of parameters and attributes, of what is not exported, that repeat the annotation and
    say nothing else."""
    return [
        f"{path}: {head}"
        for node, path, out in documented(module, name, public)
        if not out
        for title, entries in sections(ast.get_docstring(node) or "")
        for head, told in entries
        if title in ("Parameters", "Attributes") and not told and not SAYS_MORE.search(head)
    ]


def test_docstrings_list_parameters_where_a_user_reads_them() -> None:
    public = {(module, name) for module, name in exported() if name in stickslip.__all__}
    for name, path in MODULES.items():
        # The options of the commands are explained where they are declared, for --help.
        if not name.startswith(("stickslip.cli", "stickslip_paper")):
            module = ast.parse(path.read_text(encoding="utf-8"))
            assert unexplained(module, name, public) == [], name


def test_docstrings_do_not_repeat_annotations() -> None:
    public = exported()
    assert len(public) > 150
    for name, path in MODULES.items():
        if name not in SEEN_BY_USERS and not name.startswith("stickslip.catalogue"):
            assert repeated(ast.parse(path.read_text(encoding="utf-8")), name, public) == [], name


def compound_names(module: ast.Module) -> set[str]:
    """Classes and aliases of a module whose names consist of several words."""
    nodes = list(ast.walk(module))
    found = {node.name for node in nodes if isinstance(node, ast.ClassDef)}
    targets = [node.targets[0] for node in nodes if isinstance(node, ast.Assign)]
    found |= {target.id for target in targets if isinstance(target, ast.Name)}
    return {name for name in found if COMPOUND.fullmatch(name)}


def class_names_in_sentences(module: ast.Module, names: Set[str]) -> list[str]:
    """Lines of docstrings in which one of the names precedes a word without being marked as code;
    names in the heads of entries are types."""
    word = re.compile(rf"(?<![\w.`:\"~])({'|'.join(sorted(names))})(?= [a-z])")
    return [
        line.strip()
        for node in ast.walk(module)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        for line in (ast.get_docstring(node) or "").splitlines()
        if " : " not in line and word.search(line)
    ]


def test_class_names_are_not_words_of_sentences() -> None:
    """Such a word has usually been changed by the renaming of a class: "FreeRange of the phase"."""
    modules = {n: ast.parse(path.read_text(encoding="utf-8")) for n, path in MODULES.items()}
    names = set[str]().union(*map(compound_names, modules.values()))
    assert len(names) > 100
    for name, module in modules.items():
        assert class_names_in_sentences(module, names) == [], name
    sentence = ast.parse('"FreeRange of the phase; a ``FreeRange`` is\\nnot a word."')
    assert class_names_in_sentences(sentence, {"FreeRange"}) == [
        "FreeRange of the phase; a ``FreeRange`` is"
    ]


def test_what_docstrings_lack_and_repeat_is_found() -> None:
    """The tests above can fail."""
    code = """
def play(load): "A play."
def follow(a, b):
    '''Follow.

    Parameters
    ----------
    a : float
    b : float
        Where to.
    c : array, shape (n,)
    '''
class Steps:
    def between(self, a):
        '''Between.

        Parameters
        ----------
        a : float
        '''
"""
    tree = ast.parse(code)
    assert unexplained(tree, "here", {("here", "play"), ("here", "follow")}) == ["play"]
    assert repeated(tree, "here", {("here", "play")}) == [
        "follow: a : float",
        "Steps.between: a : float",
    ]
    assert repeated(tree, "here", {("here", "follow"), ("here", "Steps")}) == []
