"""Numbers that decide whether something is zero, equal or solved have names, and reasons beside
them: in `numerics/levels.py` where several modules decide alike, else at the top of their module.

A literal in a function has neither. A default of a parameter has the name of the parameter.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import stickslip
from stickslip.numerics import levels

SOURCE = Path(stickslip.__file__).parent
LEVELS = "numerics/levels.py"
EXEMPT = {
    "catalogue": "data of systems, in their units",
    "explorer": "lengths of drawings",
    "figures": "lengths of drawings",
}
"""Rooms whose functions may contain small numbers, and what these are."""
SMALL = 1e-3
EXPLAINED = re.compile(r"^([A-Z_]+) = [^#]+# .+ For .+$")


def unnamed(node: ast.AST, inside: bool = False) -> Iterator[ast.Constant]:
    """Small numbers in functions below a node that are not the default of a parameter."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
        body = [node.body] if isinstance(node, ast.Lambda) else node.body
        given = [x for x in (*node.args.defaults, *node.args.kw_defaults) if x is not None]
        for part in (x for x in given if number(x) is None):
            yield from unnamed(part, inside)
        for part in body:
            yield from unnamed(part, True)
        return
    if isinstance(node, ast.Constant) and inside and 0.0 < abs(number(node) or 0.0) < SMALL:
        yield node
    for child in ast.iter_child_nodes(node):
        yield from unnamed(child, inside)


def number(node: ast.AST) -> float | None:
    """The number that a literal is; None for anything else."""
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, float) else None


def lines_of(text: str) -> list[int]:
    """Lines of a text with unnamed numbers."""
    return [node.lineno for node in unnamed(ast.parse(text))]


def texts() -> dict[str, str]:
    """The texts of all files of the library, by their paths."""
    return {
        path.relative_to(SOURCE).as_posix(): path.read_text(encoding="utf-8")
        for path in sorted(SOURCE.rglob("*.py"))
    }


def test_small_numbers_in_functions_have_names() -> None:
    found = {
        path: lines
        for path, text in texts().items()
        if path.split("/")[0] not in EXEMPT and (lines := lines_of(text))
    }
    # Give the number a name with a reason: a level, or a constant at the top of the module.
    assert found == {}


def test_exempt_rooms_need_it() -> None:
    needed = {path.split("/")[0] for path, text in texts().items() if lines_of(text)}
    assert needed == {*EXEMPT}


def test_an_unnamed_number_is_found() -> None:
    """The tests above can fail."""
    text = """
_SMALL = 1e-9  # named
def same(a: float, b: float, tolerance: float = 1e-9, *, other: float = 1e-12) -> bool:
    if a > 1e-3 or b == 0.0 or abs(a) < _SMALL:
        return False
    close = lambda c, d=1e-6: abs(c) < 1e-7
    return abs(a - b) <= -1e-300 * tolerance

class Same:
    tolerance: float = 1e-9

    def __call__(self, x: float, y: float = max(1e-5, 0.0)) -> bool:
        return bool(self.near(x, atol=1e-11))
"""
    assert lines_of(text) == [6, 7, 13]


def test_levels_have_reasons_and_are_shared() -> None:
    source = texts()
    lines = [line for line in source.pop(LEVELS).split("\n") if re.match(r"[A-Z_]+ =", line)]
    names = {match[1] for line in lines if (match := EXPLAINED.match(line))}
    assert len(names) == len(lines)
    assert names == {name for name in vars(levels) if name.isupper()}
    words = [{*re.findall(r"\b[A-Z][A-Z_]+\b", text)} for text in source.values()]
    # A number that one module needs is a constant of that module.
    assert [name for name in names if sum(name in own for own in words) < 2] == []
