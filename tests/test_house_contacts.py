"""Where compiled code asks which kind a contact is: along a line, in a plane, of a face, one that
opens, one between given motions, one that has a formula, one that shares forces.

A contact is a block of directions with a set of forces, and whoever handles blocks should not ask.
What has to be asked belongs into `motion/steps/sets.py`; elsewhere it is counted here. A number may
fall. Where it rises, an operation of the sets is missing.
"""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

import stickslip

SOURCE = Path(stickslip.__file__).parent
HOMES = ("motion/steps/sets.py", "motion/steps/arrays.py", "motion/steps/contacts.py")
"""Where the questions live."""
COLUMNS = frozenset({"plane", "gaps", "formula", "group", "alone", "states"})
"""Of `Rows`: what they have for a contact depends on its kind."""
PROPERTIES = frozenset({"MASSIVE", "BENDS", "FORMULA", "SEAT"})
"""Columns of `Rows.planes` and `Rows.homes` of which the same is true."""
DIRECTIONS = frozenset({"directions_of", "own_directions"})
LISTS = frozenset(
    {"planes", "massive_planes", "formula_planes", "openings", "adhesive", "frictional", "lines"}
)
ASKED = {
    "motion/admissible": 4,
    "motion/audit": 17,
    "motion/engine": 8,
    "motion/modes": 28,
    "motion/steps": 9,
    "orbits/fields": 1,
    "orbits/settling": 1,
}
"""How many questions there are, by room, beside those at home."""


def is_compiled(node: ast.AST) -> bool:
    """Whether a definition is one for the translator."""
    return isinstance(node, ast.FunctionDef) and any(
        "compiled" in ast.unparse(decorator) for decorator in node.decorator_list
    )


def functions_of(text: str) -> list[ast.FunctionDef]:
    """The compiled functions of a file."""
    return [
        node
        for node in ast.parse(text).body
        if isinstance(node, ast.FunctionDef) and is_compiled(node)
    ]


def called(node: ast.AST) -> str:
    """The name of what a call calls."""
    return ast.unparse(node.func) if isinstance(node, ast.Call) else ""


class Reader:
    """What the functions of a text ask.

    Attributes
    ----------
    kinds, questions : sets of str
        Functions that return what depends on the kind of a contact; and those that answer, from
        the rows and the mode alone, whether something is so, by asking for the kind.
    """

    def __init__(self, functions: list[ast.FunctionDef]) -> None:
        self.kinds = set[str]()
        self.questions = set[str]()
        known = -1
        while known < len(self.kinds) + len(self.questions):
            known = len(self.kinds) + len(self.questions)
            for function in functions:
                self._learn(function)

    def _learn(self, function: ast.FunctionDef) -> None:
        returned = [n.value for n in ast.walk(function) if isinstance(n, ast.Return) and n.value]
        names = self._names(function)
        answer = ast.unparse(function.returns) if function.returns else ""
        given = {ast.unparse(a.annotation) for a in function.args.args if a.annotation}
        if answer == "int" and any(self._is_kind(value, names) for value in returned):
            self.kinds.add(function.name)
        if answer == "bool" and given <= {"Rows", "Array", "int"} and self.asks(function):
            self.questions.add(function.name)

    def _names(self, function: ast.FunctionDef) -> dict[str, str]:
        """Local names of what depends on the kind, and of the directions of a contact."""
        found = dict[str, str]()
        for node in ast.walk(function):
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                name = node.targets[0].id
                if called(node.value) in DIRECTIONS:
                    found[name] = "directions"
                elif self._is_kind(node.value, found):
                    found[name] = "kind"
        return found

    def _is_kind(self, node: ast.AST, names: dict[str, str]) -> bool:
        """Whether a value depends on the kind of a contact."""
        if isinstance(node, ast.Name):
            return names.get(node.id) == "kind"
        if isinstance(node, ast.Subscript):
            properties = {n.id for n in ast.walk(node.slice) if isinstance(n, ast.Name)}
            column = node.value.attr if isinstance(node.value, ast.Attribute) else ""
            return column in COLUMNS or bool(properties & PROPERTIES)
        if called(node) == "len" and isinstance(node, ast.Call):
            (what,) = node.args
            several = isinstance(what, ast.Attribute) and what.attr in LISTS
            own = isinstance(what, ast.Name) and names.get(what.id) == "directions"
            return several or own or called(what) in DIRECTIONS
        if called(node) in ("int", "bool") and isinstance(node, ast.Call):
            return self._is_kind(node.args[0], names)
        return called(node) in self.kinds

    def asks(self, function: ast.FunctionDef) -> list[ast.AST]:
        """The questions that a function asks."""
        names = self._names(function)
        found = list[ast.AST]()
        for node in ast.walk(function):
            if isinstance(node, ast.Compare):
                sides = [node.left, *node.comparators]
                links = [s for s in sides if "first_link" in ast.unparse(s)]
                # Two of one kind may be told apart by a number of theirs.
                numbers = any(isinstance(side, ast.Constant) for side in sides)
                if (numbers and any(self._is_kind(s, names) for s in sides)) or len(links) > 1:
                    found.append(node)
            elif called(node) in self.questions:
                found.append(node)
        return found


def questions_in(texts: dict[str, str]) -> Counter[str]:
    """How many questions each file asks."""
    functions = {path: functions_of(text) for path, text in texts.items()}
    reader = Reader([f for own in functions.values() for f in own])
    return Counter({path: sum(len(reader.asks(f)) for f in own) for path, own in functions.items()})


def texts() -> dict[str, str]:
    """The texts of all files of the library, by their paths."""
    return {
        path.relative_to(SOURCE).as_posix(): path.read_text(encoding="utf-8")
        for path in sorted(SOURCE.rglob("*.py"))
    }


def test_kinds_of_contacts_are_seldom_asked_for() -> None:
    asked = questions_in(texts())
    rooms = Counter[str]()
    for path, count in asked.items():
        rooms["/".join(path.split("/")[:2])] += 0 if path in HOMES else count
    # Who asks less lowers the number.
    assert +rooms == Counter(ASKED)


def test_questions_are_found_wherever_they_hide() -> None:
    text = """
@compiled()
def width(rows: Rows, c: int) -> int:
    return int(len(directions_of(rows, c)))

@compiled()
def is_wide(rows: Rows, c: int) -> bool:
    return width(rows, c) > 1

@compiled()
def held(rows: Rows, mode: Array, c: int) -> float:
    block = directions_of(rows, c)
    if is_wide(rows, c) or rows.gaps[c] >= 0 or len(block) == 1:
        return 0.0
    for plane in rows.planes:
        if plane[BENDS] == 1:
            return 1.0
    return 2.0 if mode[c] == 0 else 3.0
"""
    assert questions_in({"a.py": text})["a.py"] == 1 + 4
