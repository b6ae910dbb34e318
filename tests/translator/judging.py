"""Compiled functions and Python's own run of the same source, side by side."""

from __future__ import annotations

import ast
import importlib.util
import itertools
import math
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from stickslip.machine_code.functions import Entry

HEAD = """
from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import *
from stickslip.machine_code.functions import entry_point
from stickslip.translator import compiled, fma

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


def product(x: float, n: int) -> float:
    """A power by repeated squares."""
    found = 1.0
    for k in range(abs(n).bit_length()):
        found = found * x if abs(n) >> k & 1 else found
        x = x * x
    return found if n >= 0 else 1.0 / found if found else math.copysign(math.inf, found)


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
