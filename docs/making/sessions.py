"""Sessions of pages, and what each block of them needs of those before it."""

from __future__ import annotations

import ast
import builtins
import doctest
import re
from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import cache
from pathlib import Path

BLOCK = re.compile(r"^```pycon\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"[\w-]+\.(?:toml|nc|zarr|csv)")


@dataclass(frozen=True)
class Statement:
    """One thing that is typed in, with the names and files that it makes and that it needs."""

    text: str
    source: str
    makes: frozenset[str]
    needs: frozenset[str]


@dataclass(frozen=True)
class Block:
    """Statements that stand together on a page."""

    statements: tuple[Statement, ...]

    @property
    def source(self) -> str:
        """What is typed in."""
        return "".join(s.source for s in self.statements)


@dataclass(frozen=True)
class Session:
    """The blocks of a page."""

    blocks: tuple[Block, ...]

    def alone(self, block: Block) -> str:
        """A block behind all that it needs of the page, so that it can be typed in as it stands."""
        before = [s for b in self.blocks[: self.blocks.index(block)] for s in b.statements]
        wanted: set[str] = set()
        for statement in reversed(block.statements):
            wanted = (wanted - statement.makes) | statement.needs
        kept: list[Statement] = []
        for statement in reversed(before):
            if statement.makes & wanted:
                wanted = (wanted - statement.makes) | statement.needs
                kept.append(statement)
        parts = "".join(s.text for s in reversed(kept))
        return parts + "".join(s.text for s in block.statements)


@cache
def of_page(path: Path) -> Session:
    """The session of a page."""
    files: set[str] = set()
    blocks = [
        Block(tuple(_statements(text, files)))
        for text in BLOCK.findall(path.read_text(encoding="utf-8"))
    ]
    return Session(tuple(blocks))


def _statements(text: str, files: set[str]) -> Iterator[Statement]:
    """What a block types in; ``files`` are those that earlier statements of the page have made."""
    for example in doctest.DocTestParser().get_examples(text):
        found = statement(example.source, example.want, frozenset(files))
        files |= found.makes
        yield found


def statement(source: str, answer: str = "", files: AbstractSet[str] = frozenset()) -> Statement:
    """What is typed in at once, where ``files`` are there already."""
    names = _Names()
    names.visit(ast.parse(source))
    made = names.files - files
    shown = ">>> " + source.rstrip("\n").replace("\n", "\n... ") + "\n" + answer
    return Statement(
        re.sub(r"^\.\.\. $", "...", shown, flags=re.MULTILINE),
        source,
        frozenset(names.stored | made),
        frozenset((names.loaded | names.files) - made - vars(builtins).keys()),
    )


class _Names(ast.NodeVisitor):
    """Names that a statement needs from before, names that it leaves, and files that it names."""

    def __init__(self) -> None:
        self.stored: set[str] = set()
        self.loaded: set[str] = set()
        self.files: set[str] = set()

    def visit_Name(self, node: ast.Name) -> None:
        """A variable."""
        if isinstance(node.ctx, ast.Store):
            self.stored.add(node.id)
        elif node.id not in self.stored:
            self.loaded.add(node.id)

    def visit_Assign(self, node: ast.Assign) -> None:
        """What stands on the right is needed before what stands on the left is made."""
        for part in (node.value, *node.targets):
            self.visit(part)

    def visit_For(self, node: ast.For) -> None:
        """A loop."""
        for part in (node.iter, node.target, *node.body):
            self.visit(part)

    def _comprehension(self, node: ast.AST) -> None:
        """Its variables are its own."""
        inner = _Names()
        for generator in getattr(node, "generators"):  # noqa: B009
            inner.visit(generator.iter)
            inner.visit(generator.target)
            for condition in generator.ifs:
                inner.visit(condition)
        for field in ("elt", "key", "value"):
            if (part := getattr(node, field, None)) is not None:
                inner.visit(part)
        self.loaded |= inner.loaded - self.stored
        self.files |= inner.files

    visit_ListComp = visit_SetComp = visit_DictComp = visit_GeneratorExp = _comprehension

    def visit_Lambda(self, node: ast.Lambda) -> None:
        """Its arguments are its own."""
        self._inside(node.args, [node.body])

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """A function."""
        for decorator in node.decorator_list:
            self.visit(decorator)
        self._inside(node.args, node.body)
        self.stored.add(node.name)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        """A class."""
        for part in (*node.bases, *node.decorator_list, *node.body):
            inner = _Names()
            inner.visit(part)
            self.loaded |= inner.loaded - self.stored
        self.stored.add(node.name)

    def _inside(self, arguments: ast.arguments, body: list[ast.stmt] | list[ast.expr]) -> None:
        inner = _Names()
        inner.stored |= {part.arg for part in ast.walk(arguments) if isinstance(part, ast.arg)}
        for part in body:
            inner.visit(part)
        self.loaded |= inner.loaded - self.stored
        self.files |= inner.files

    def visit_Import(self, node: ast.Import) -> None:
        """A module."""
        self.stored |= {(a.asname or a.name).partition(".")[0] for a in node.names}

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        """Something of a module."""
        self.stored |= {a.asname or a.name for a in node.names}

    def visit_ExceptHandler(self, node: ast.ExceptHandler) -> None:
        """An error that is caught."""
        if node.name:
            self.stored.add(node.name)
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        """The name of a file."""
        if isinstance(node.value, str) and _FILE.fullmatch(node.value):
            self.files.add(node.value)
