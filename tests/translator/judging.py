"""Compiled functions and Python's own run of the same source, side by side."""

from __future__ import annotations

import ast
import importlib.util
import itertools
import math
import random
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from stickslip.machine_code.functions import Entry
from stickslip.translator.values import (
    BOOL,
    COMPLEX,
    ENTRIES,
    FLOAT,
    ArrayType,
    TupleType,
    entry_types,
)

HEAD = """
from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import *
from stickslip.arrays import Annotated
from stickslip.machine_code.functions import entry_point
from stickslip.translator import FunctionAddress, call_address, compiled, fma

"""
_COUNT = itertools.count()


def module_of(source: str, folder: Path) -> ModuleType:
    """A module with this source after the usual imports."""
    name = f"made_for_tests_{next(_COUNT)}"
    path = folder / f"{name}.py"
    path.write_text(HEAD + source, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


class Plain(np.ndarray):
    """An array whose entries are Python's numbers: NumPy's have rules of their own."""

    def __getitem__(self, key: Any) -> Any:
        found = super().__getitem__(key)
        return found.item() if isinstance(found, np.generic) else found

    def __iter__(self) -> Iterator[Any]:
        return (self[i] for i in range(len(self)))


def plain(value: Any) -> Any:
    """A copy of arguments whose arrays have plain entries; one array stays one."""
    copies = dict[int, Any]()

    def copied(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return copies.setdefault(id(value), value.copy().view(Plain))
        if isinstance(value, tuple):
            parts = [copied(part) for part in value]
            return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
        return value

    return copied(value)


class _Products(ast.NodeTransformer):
    """Powers with a constant whole exponent become products, as they are in the language."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.op, ast.Pow):
            product = ast.Call(ast.Name("_product", ast.Load()), [node.left, node.right], [])
            return ast.copy_location(product, node)
        return node


def product(x: float, n: Any) -> float:
    """A power by repeated squares."""
    if not isinstance(n, int):
        return x**n
    square, found, left = x, None, abs(n)
    while left:
        if left & 1:
            found = square if found is None else found * square
        left >>= 1
        square = square * square
    found = 1.0 if found is None else found
    if n < 0:
        return 1.0 / found if found else math.copysign(math.inf, found)
    return found


def by_python(module: ModuleType) -> dict[str, Any]:
    """What a module's functions are where powers are products and all of them are Python's."""
    tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
    space: dict[str, Any] = {"_product": product, "__name__": module.__name__}
    exec(compile(ast.fix_missing_locations(_Products().visit(tree)), "by Python", "exec"), space)
    for name, value in list(space.items()):
        if isinstance(value, Entry):
            space[name] = value.python
        elif isinstance(value, np.ndarray):
            space[name] = value.view(Plain)
    space["np"] = SimpleNamespace(floor=_as_plain(np.floor), ceil=_as_plain(np.ceil))
    return space


def _as_plain(function: Any) -> Any:
    return lambda x: float(function(x))


def bits(value: Any) -> Any:
    """A value such that equal bits are equal; all NaN are one."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, [bits(x) for x in value.ravel().tolist()]
    if isinstance(value, tuple):
        return [bits(part) for part in value]
    if isinstance(value, complex):
        return bits(value.real), bits(value.imag)
    if isinstance(value, float):
        return "nan" if value != value else struct.pack("d", value).hex()
    return value


def differences(entry: Entry, reference: Any, arguments: tuple[Any, ...]) -> str:
    """Where a compiled function and Python differ, in words; nothing where Python cannot do it.

    Raises
    ------
    ArithmeticError, ValueError
        If Python raises it.
    """
    known = plain(arguments)
    wanted = reference(*known)
    found = entry(*arguments)
    wanted = float(wanted) if isinstance(found, float) and wanted is not None else wanted
    if bits(found) != bits(wanted):
        return f"{found!r} for {wanted!r}"
    for k, (got, expected) in enumerate(zip(arguments, known, strict=True)):
        if bits(got) != bits(expected):
            return f"argument {k}: {got!r} for {expected!r}"
    return ""


def entries_of(space: dict[str, Any]) -> list[Entry]:
    """The entries of a test's module."""
    return [value for value in space.values() if isinstance(value, Entry)]


LENGTHS = (3, 4, 2, 5)
_SPECIAL = (0.0, -0.0, 1.0, -1.0, 2.0, 1e300, math.inf, math.nan)


def drawn(type_: Any, rng: random.Random) -> Any:
    """A random argument of a type; arrays have `LENGTHS`."""
    if isinstance(type_, TupleType):
        parts = [drawn(part, rng) for part in type_.parts]
        return type_.kind(*parts) if hasattr(type_.kind, "_fields") else tuple(parts)
    if isinstance(type_, ArrayType):
        kind, _ = ENTRIES[type_.entries]
        shape = LENGTHS[: type_.axes]
        entries = [drawn(kind, rng) for _ in range(math.prod(shape))]
        return np.array(entries, type_.entries).reshape(shape)
    if type_ == COMPLEX:
        return complex(rng.gauss(0, 2), rng.gauss(0, 2))
    if type_ == FLOAT:
        return rng.choice(_SPECIAL) if rng.random() < 0.2 else rng.gauss(0, 3)
    return rng.random() < 0.5 if type_ == BOOL else rng.randint(-5, 5)


def disagreements(entry: Entry, times: int = 60) -> list[str]:
    """Where an entry and Python differ, for random arguments.

    Parameters
    ----------
    entry : Entry
    times : int
        How many of them.
    """
    rng = random.Random(entry.__name__)
    types, _ = entry_types(entry)
    given = [tuple(drawn(type_, rng) for type_ in types) for _ in range(times)]
    return [found for arguments in given if (found := differences(entry, entry.python, arguments))]
