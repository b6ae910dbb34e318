"""Modules of compiled functions: each function for the types of its calls, one module per source
file."""

from __future__ import annotations

import ast
import linecache
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stickslip.translator import Compiled
from stickslip.translator.assembly import FASTCC, POINTER, WHOLE, Register, operand
from stickslip.translator.definitions import Definition, annotated_type
from stickslip.translator.functions import Function
from stickslip.translator.values import (
    ENTRIES,
    INT,
    METADATA,
    NONE,
    ArrayType,
    FunctionType,
    Refusal,
    Type,
    Value,
    Values,
    as_constant,
    entry_types,
    joined,
)

_FEW = 150  # lines of a function that is copied to other modules; LLVM does not inline longer ones
_MANY = 1000  # lines of a function that is not inlined
_WORDS = Register("%words", POINTER)
# LLVM may assume no more than this of C functions: it evaluates fmod(0, NaN) as 0.
_ATTRIBUTES = """
attributes #0 = { nounwind nofree nosync }
attributes #1 = { nobuiltin nounwind willreturn memory(none) }
"""


class Program:
    """The functions that some entries need.

    Parameters
    ----------
    entries : sequence of Compiled
        What is called from outside: with the address of its arguments as words. A parameter has the
        type of its annotation.
    exported : sequence of Compiled, optional
        What other assembly calls, as functions of the language call each other. A parameter has the
        type of its annotation.
    threads : sequence of Compiled
        What each thread of a GPU runs: from the address of all arguments but the last, and the
        number of threads. The last argument is the number of the thread.
    direct : mapping of type to str, optional
        Functions that are called by their names, not by their addresses: by the class of these.
    """

    def __init__(
        self,
        entries: Sequence[Compiled],
        exported: Sequence[Compiled] = (),
        *,
        threads: Sequence[Compiled] = (),
        direct: Mapping[type, str] | None = None,
    ) -> None:
        self.direct: Mapping[type, str] = direct or {}
        self._definitions: dict[Any, Definition | None] = {}
        self._functions: dict[str, Definition] = {}
        self._outside: set[str] = set()  # names of functions called from outside
        self._declared: dict[str, str] = {}
        self._tables: dict[int, tuple[str, Any]] = {}
        self._counts: dict[str, int] = {}
        self._nodes: dict[str, dict[int, ast.FunctionDef]] = {}
        self._outside |= {self._definition_of(function).name for function in exported}
        for entry in entries:
            self._enter(entry)
        for function in threads:
            self._enter(function, is_thread=True)

    def definition(self, function: Compiled, given: Sequence[Type]) -> Definition:
        """A function for arguments of these types; translated at the first time.

        Raises
        ------
        Refusal
            If it is not in the language.
        """
        node = self._node(function)
        annotated = [annotated_type(x.annotation) for x in node.args.args]
        wanted = tuple(
            said if said and joined(type_, said) == said else type_
            for said, type_ in zip(annotated, given, strict=True)
        )
        key = function, wanted
        if key not in self._definitions:
            self._definitions[key] = None
            self._definitions[key] = self._translated(function, node, wanted)
        found = self._definitions[key]
        if found is None:
            raise Refusal(f"{function.place}: it calls itself. Write a loop")
        return found

    def _translated(
        self, function: Compiled, node: ast.FunctionDef, wanted: tuple[Type, ...]
    ) -> Definition:
        plain = tuple(as_constant(type_, False) for type_ in wanted)
        if plain != wanted:
            # The same code is used for constants, if it writes to none of them.
            found = self.definition(function, plain)
            checked = Function(self, function, node, wanted, found.name).translated()
            return found._replace(arguments=wanted, result=checked.result)
        self._counts[function.symbol] = number = self._counts.get(function.symbol, 0) + 1
        name = function.symbol if number == 1 else f"{function.symbol}.{number}"
        work = Function(self, function, node, wanted, name)
        self._functions[name] = found = work.translated()
        self._declared |= work.declared
        return found

    def _node(self, function: Compiled) -> ast.FunctionDef:
        """The syntax tree of a function."""
        code = function.python.__code__
        if code.co_filename not in self._nodes:
            linecache.checkcache(code.co_filename)  # the file may have been edited
            # also contains the cells of notebooks
            text = "".join(linecache.getlines(code.co_filename))
            found = [x for x in ast.walk(ast.parse(text)) if isinstance(x, ast.FunctionDef)]
            firsts = [min([x.lineno, *(d.lineno for d in x.decorator_list)]) for x in found]
            self._nodes[code.co_filename] = dict(zip(firsts, found, strict=True))
        node = self._nodes[code.co_filename].get(code.co_firstlineno)
        if node is None:
            what = "no source of a function with a name. Write it with def, in a file or a notebook"
            raise Refusal(f"{function.place}: {what}")
        given = node.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs or given.defaults:
            what = "parameters with stars, slashes or defaults. Name all of them plainly"
            raise Refusal(f"{function.place}: {what}")
        return node

    def table(self, array: Any) -> tuple[str, ArrayType]:
        """A constant array: its name and type."""
        if id(array) not in self._tables:
            kept = np.asarray(array, order="C")
            self._tables[id(array)] = f"@table.{len(self._tables)}", kept
        name, kept = self._tables[id(array)]
        return name, ArrayType(f"{kept.dtype.kind}{kept.dtype.itemsize}", kept.ndim, True)

    # -- what is called from outside ---------------------------------------------------------------

    def _definition_of(self, function: Compiled) -> Definition:
        """A function with the types of its annotations."""
        types, declared = entry_types(function)
        found = self.definition(function, types)
        if found.result != declared:
            what = f"it returns {found.result}, not {declared}. Annotate it so, or convert it"
            raise Refusal(f"{function.place}: {what}")
        return found

    def _enter(self, function: Compiled, is_thread: bool = False) -> None:
        """Write the entry point that Python calls, or that each thread of a GPU runs."""
        callee, work = self._definition_of(function), Values()
        name, kind, parameters = f"entry.{function.symbol}", "", [(POINTER, "%words")]
        types, last = callee.arguments, list[Register]()
        if is_thread:
            if callee.result != NONE or types[-1:] != (INT,):
                what = "what a thread runs takes its number last, and returns nothing"
                raise Refusal(f"{function.place}: {what}. Write to an array")
            name, kind = function.__name__, "ptx_kernel "
            parameters = [("ptr noalias readonly", "%words"), (WHOLE, "%count")]
            types, last = types[:-1], [_number_of_thread(work)]
        given = [work.operand(x) for x in _from_words(types)]
        kind += _finish(work, f'@"{callee.name}"', callee.result, [*given, *last], FASTCC)
        self._declared |= work.declared
        self._outside.add(name)
        made = function, name, kind, parameters, work.body(), {callee.name}
        self._functions[name] = Definition(*made)

    # -- modules -----------------------------------------------------------------------------------

    def modules(self) -> dict[str, str]:
        """LLVM assembly by source file: its functions, and copies of small ones of other files.

        A text is all that shapes its machine code.
        """
        files = {x.file for x in self._functions.values()}
        return {file: self._module(file) for file in sorted(files)}

    def whole(self) -> str:
        """LLVM assembly of all files together."""
        return self._joined([self._linked(name, "internal") for name in sorted(self._functions)])

    def _module(self, file: str) -> str:
        own = [name for name, function in self._functions.items() if function.file == file]
        copied, declared = set[str](), set[str]()
        left = list(own)
        while left:
            for name in self._functions[left.pop()].called - copied - declared - set(own):
                if self._functions[name].function.inline or self._length(name) <= _FEW:
                    copied.add(name)
                    left.append(name)
                else:
                    declared.add(name)
        lines = [self._linked(name, "hidden") for name in sorted(own, key=self._position)]
        for name in sorted(copied, key=self._position):
            lines.append(self._linked(name, "hidden", "available_externally "))
        return self._joined([*lines, *(self._functions[x].declaration for x in sorted(declared))])

    def _position(self, name: str) -> tuple[str, int, str]:
        """Position of a function in the sources, which is its position in the assembly.

        What is inlined, and where code is placed, depends on the order of functions. In the order
        of names, a renamed function changed the time of motions by 9 %.
        """
        found = self._functions[name]
        return found.file, found.function.python.__code__.co_firstlineno, name

    def _joined(self, lines: list[str]) -> str:
        """Functions with their dependencies."""
        text = "\n".join(lines)
        used = [line for name, line in sorted(self._declared.items()) if f"@{name}(" in text]
        tables = [_table_line(*x) for x in self._tables.values() if f"{x[0]}," in text]
        return "\n".join([*tables, *used, text, _ATTRIBUTES, METADATA])

    def _length(self, name: str) -> int:
        """Lines of a function, including inlined ones."""
        function = self._functions[name]
        inside = [x for x in function.called if self._functions[x].function.inline]
        return function.body.count("\n") + sum(map(self._length, inside))

    def _linked(self, name: str, inside: str, linkage: str = "") -> str:
        """A function that is known inside alone, unless it is called from outside."""
        note = " noinline" if self._length(name) > _MANY else ""
        linkage += "" if name in self._outside else inside
        return self._functions[name].text(linkage, note)


def _table_line(name: str, array: Any) -> str:
    """A constant array in the assembly."""
    kind = ENTRIES[f"{array.dtype.kind}{array.dtype.itemsize}"][1]
    numbers = [int(x) if isinstance(x, bool) else x for x in array.ravel().tolist()]
    entries = ", ".join(f"{kind} {operand(x)}" for x in numbers)
    head = f"{name} = internal unnamed_addr constant [{array.size} x {kind}]"
    return f"{head} [{entries}], align 16"


def _number_of_thread(work: Values) -> Register:
    """The number of a thread of a GPU among those of all blocks; those that are not wanted end."""
    names = (f"llvm.nvvm.read.ptx.sreg.{name}.x" for name in ("ctaid", "ntid", "tid"))
    block, width, place = (
        work.new(WHOLE, f"zext {x.typed} to i64")
        for x in [work.outside("i32", name) for name in names]
    )
    number = work.op("add nuw nsw", work.op("mul nuw nsw", block, width), place)
    work.choose(work.op("icmp slt", number, Register("%count", WHOLE)), "busy", "idle")
    work.begin("idle")
    work.end("ret void")
    work.begin("busy")
    return number


def _from_words(types: Sequence[Type], offset: int = 0) -> list[Value]:
    """Arguments stored at an address as words."""
    given = list[Value]()
    for type_ in types:
        given.append(Value(type_, _WORDS, offset))
        offset += type_.words
    return given


def _finish(
    work: Values, callee: str, result: Any, given: Sequence[Register], convention: str = ""
) -> str:
    """Call a function and return its result by C's calling convention; returns LLVM's type of it.

    Parameters
    ----------
    callee : str
        Its name with @, or the register of its address.
    convention : str
        How it is called if not as functions of C are.
    """
    made = work.call(result.llvm, callee, *given, convention=convention)
    made = work.outward(Value(result, made))
    work.end(f"ret {made.typed}" if made.name else "ret void")
    return made.type


def caller_of(function: FunctionType) -> str:
    """Assembly of a function that is given words: an address of a function of this type, and its
    arguments."""
    work = Values()
    address = work.load(POINTER, _WORDS)
    types = [type_ for _, type_ in function.arguments]
    given = [work.outward(x) for x in _from_words(types, 1)]
    kind = _finish(work, str(address), function.result, given)
    head = f"define {kind} @call_{function}(ptr %words)"
    return f"{head} {{\n{work.body()}}}\n{METADATA}"
