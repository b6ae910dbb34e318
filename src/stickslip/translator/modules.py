"""Compiled functions together: each for the types it is called with, as one module for each source
file."""

from __future__ import annotations

import ast
import linecache
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stickslip.translator import Compiled
from stickslip.translator.assembly import (
    BIT,
    WHOLE,
    Assembly,
    Register,
    imaginary,
    real,
    whole,
)
from stickslip.translator.functions import Definition, Function, Signature
from stickslip.translator.values import (
    BOOL,
    ENTRIES,
    INT,
    METADATA,
    NAMED,
    NONE,
    ArrayType,
    FunctionType,
    Refusal,
    TupleType,
    Type,
    Value,
    Values,
    entry_types,
    joined,
    named,
    place_of,
    plain_types,
    symbol_of,
    words,
)

_FEW = 400  # lines of a function that other modules have copies of, to inline it
_MANY = 1000  # lines of a function that is not inlined
_WORDS = Register("%words", "ptr")
# Of functions of C, LLVM is to assume no more than this: it takes fmod(0, NaN) for 0.
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
    plain : mapping of str to Compiled, optional
        What other assembly calls, by symbol; its arguments are as `values.plain_types` has them.
    threads : sequence of Compiled
        What each thread of a GPU runs: from the address of all arguments but the last, and the
        number of threads. The last argument is the number of the thread.
    direct : mapping of type to str, optional
        Functions that are called by their names, not by their addresses: by the class of these.
    """

    def __init__(
        self,
        entries: Sequence[Compiled],
        plain: Mapping[str, Compiled] | None = None,
        *,
        threads: Sequence[Compiled] = (),
        direct: Mapping[type, str] | None = None,
    ) -> None:
        self.direct: Mapping[type, str] = direct or {}
        self._signatures: dict[Any, Signature | None] = {}
        self._functions: dict[str, Definition] = {}
        self._outside: set[str] = set()  # names of what is called from outside
        self._declared: dict[str, str] = {}
        self._tables: dict[int, tuple[str, Any]] = {}
        self._counts: dict[str, int] = {}
        self._nodes: dict[str, dict[int, ast.FunctionDef]] = {}
        for entry in entries:
            self._enter(entry)
        for symbol, function in (plain or {}).items():
            self._enter_plainly(symbol, function)
        for function in threads:
            self._launch(function)

    def signature(self, function: Compiled, given: tuple[Type, ...]) -> Signature:
        """How a function is called with arguments of these types; translated at the first time.

        Raises
        ------
        Refusal
            If it is not in the language.
        """
        node = self._node(function)
        hints = [x.annotation and ast.unparse(x.annotation) for x in node.args.args]
        types = {kind.__name__: scalar for kind, scalar in NAMED.items()}
        said = [types.get(hint or "") for hint in hints]
        wanted = tuple(
            promise if promise and joined(type_, promise) == promise else type_
            for promise, type_ in zip(said, given, strict=True)
        )
        key = function, wanted
        if key not in self._signatures:
            self._signatures[key] = None
            self._signatures[key] = self._translate(function, node, wanted)
        found = self._signatures[key]
        if found is None:
            raise Refusal(f"{place_of(function)}: it calls itself. Write a loop")
        return found

    def _translate(
        self, function: Compiled, node: ast.FunctionDef, wanted: tuple[Type, ...]
    ) -> Signature:
        base = f"{function.__module__}.{function.__name__}"
        self._counts[base] = self._counts.get(base, 0) + 1
        name = base if self._counts[base] == 1 else f"{base}.{self._counts[base]}"
        work = Function(self, function, node, wanted, name)
        signature, self._functions[name] = work.translated()
        self._declared |= work.declared
        return signature

    def _node(self, function: Compiled) -> ast.FunctionDef:
        """The syntax tree of a function."""
        code = function.python.__code__
        if code.co_filename not in self._nodes:
            linecache.checkcache(code.co_filename)  # the file may have been edited
            # which also knows the cells of notebooks
            text = "".join(linecache.getlines(code.co_filename))
            self._nodes[code.co_filename] = _functions_of(text)
        node = self._nodes[code.co_filename].get(code.co_firstlineno)
        if node is None:
            what = "no source of a function with a name. Write it with def, in a file or a notebook"
            raise Refusal(f"{place_of(function)}: {what}")
        given = node.args
        plain = (given.vararg, given.kwarg, given.kwonlyargs, given.posonlyargs, given.defaults)
        if any(plain):
            what = "parameters with stars, slashes or defaults"
            raise Refusal(f"{place_of(function)}: {what}. Name all of them plainly")
        return node

    def table(self, array: Any) -> tuple[str, ArrayType]:
        """A constant array: its name and type."""
        if id(array) not in self._tables:
            kept = np.asarray(array, order="C")
            self._tables[id(array)] = f"@table.{len(self._tables)}", kept
        name, kept = self._tables[id(array)]
        return name, ArrayType(f"{kept.dtype.kind}{kept.dtype.itemsize}", kept.ndim)

    def _table_line(self, name: str, array: Any) -> str:
        kind = ENTRIES[f"{array.dtype.kind}{array.dtype.itemsize}"][1]
        literal = {"f": real, "c": imaginary}.get(array.dtype.kind, lambda x: whole(int(x)))
        entries = ", ".join(f"{kind} {literal(x)}" for x in array.ravel().tolist())
        return (
            f"{name} = internal unnamed_addr constant [{array.size} x {kind}] [{entries}], align 16"
        )

    # -- entries -----------------------------------------------------------------------------------

    def _enter(self, function: Compiled) -> None:
        """Write the function that is called from outside."""
        types, signature = self._promised(function)
        work = Values()
        given = _from_words(work, types, signature.arguments)
        self._close(symbol_of(function), function, signature, work, given, [_WORDS])

    def _launch(self, function: Compiled) -> None:
        """Write what a GPU runs in each of its threads."""
        types, signature = self._promised(function)
        if signature.result != NONE or types[-1:] != (INT,):
            what = "what a thread runs takes its number last, and returns nothing"
            raise Refusal(f"{place_of(function)}: {what}. Write to an array")
        work = Values()
        thread = _number_of_thread(work)
        work.choose(work.new(BIT, f"icmp slt i64 {thread}, %count"), "busy", "idle")
        work.begin("idle")
        work.end("ret void")
        work.begin("busy")
        given = _from_words(work, types[:-1], signature.arguments[:-1])
        parameters = [_WORDS._replace(type="ptr noalias readonly"), Register("%count", WHOLE)]
        self._declared |= work.declared
        given.append(thread)
        name = function.__name__
        self._close(name, function, signature, work, given, parameters, "ptx_kernel")

    def _enter_plainly(self, symbol: str, function: Compiled) -> None:
        """Write the function that other assembly calls.

        It knows no length of a first axis, by which nothing is found: there it is 0.
        """
        types, signature = self._promised(function)
        work = Values()
        plain, _ = plain_types(function)
        parameters = [Register(f"%x{i}", kind) for i, kind in enumerate(plain)]
        left = iter(parameters)
        given = list[Register]()
        for type_ in types:
            x = next(left)
            if isinstance(type_, ArrayType):
                lengths = [next(left) for _ in range(type_.axes - 1)]
                x = work.structure(type_.llvm, [x, whole(0), *lengths])
            given.append(x)
        self._close(symbol, function, signature, work, given, parameters)

    def _promised(self, function: Compiled) -> tuple[tuple[Type, ...], Signature]:
        """The types in the annotations of an entry, and how it is called with them."""
        types, promised = entry_types(function)
        signature = self.signature(function, types)
        if signature.result != promised:
            what = f"it returns {named(signature.result)}, not {named(promised)}"
            raise Refusal(f"{place_of(function)}: {what}. Annotate it so, or convert it")
        return types, signature

    def _close(
        self,
        symbol: str,
        function: Compiled,
        signature: Signature,
        work: Assembly,
        given: Sequence[Register],
        parameters: Sequence[Register],
        convention: str = "",
    ) -> None:
        """Let a function that is called from outside call the one that it stands for."""
        kind = _finish(work, f'@"{signature.name}"', " fastcc", signature.result, given)
        pairs = [(x.type, x.name) for x in parameters]
        file = function.python.__code__.co_filename
        result = f"{convention} {kind}".strip()
        self._outside.add(symbol)
        self._functions[symbol] = Definition(
            symbol, result, pairs, work.body(), file, False, {signature.name}
        )

    # -- modules -----------------------------------------------------------------------------------

    def modules(self) -> dict[str, str]:
        """LLVM assembly by source file: its functions, and copies of small ones of other files.

        A text is all that shapes its machine code.
        """
        return {
            file: self._module(file) for file in sorted({x.file for x in self._functions.values()})
        }

    def whole(self) -> str:
        """LLVM assembly of all files together."""
        return self._joined([self._linked(name, "internal") for name in sorted(self._functions)])

    def _module(self, file: str) -> str:
        own = sorted(name for name, function in self._functions.items() if function.file == file)
        copied, declared = set[str](), set[str]()
        left = list(own)
        while left:
            for name in self._functions[left.pop()].called - copied - declared - set(own):
                if self._functions[name].inline or self._length(name) <= _FEW:
                    copied.add(name)
                    left.append(name)
                else:
                    declared.add(name)
        lines = [
            *(self._linked(name, "hidden") for name in own),
            *(self._linked(name, "available_externally hidden") for name in sorted(copied)),
            *(self._functions[name].declaration for name in sorted(declared)),
        ]
        return self._joined(lines)

    def _joined(self, lines: list[str]) -> str:
        """Functions with what they need."""
        text = "\n".join(lines)
        used = [line for name, line in sorted(self._declared.items()) if f"@{name}(" in text]
        tables = [
            self._table_line(*table) for table in self._tables.values() if f"{table[0]}," in text
        ]
        return "\n".join([*tables, *used, text, _ATTRIBUTES, METADATA])

    def _length(self, name: str) -> int:
        """Lines of a function and of what is inlined into it."""
        function = self._functions[name]
        inside = (self._length(x) for x in function.called if self._functions[x].inline)
        return function.length + sum(inside)

    def _linked(self, name: str, linkage: str) -> str:
        """A function that only what is linked knows, unless it is called from outside."""
        note = " noinline" if self._length(name) > _MANY else ""
        return self._functions[name].text("" if name in self._outside else linkage, note)


def _functions_of(text: str) -> dict[int, ast.FunctionDef]:
    """All functions of a source, by their first lines."""
    found = [x for x in ast.walk(ast.parse(text)) if isinstance(x, ast.FunctionDef)]
    return {min([x.lineno, *(d.lineno for d in x.decorator_list)]): x for x in found}


def _number_of_thread(work: Assembly) -> Register:
    """The number of a thread of a GPU among those of all blocks."""
    own = [
        work.outside("i32", f"llvm.nvvm.read.ptx.sreg.{name}.x")
        for name in ("ctaid", "ntid", "tid")
    ]
    block, width, place = (work.new(WHOLE, f"zext {number.typed} to i64") for number in own)
    before = work.new(WHOLE, f"mul nuw nsw i64 {block}, {width}")
    return work.new(WHOLE, f"add nuw nsw i64 {before}, {place}")


def _from_words(work: Values, types: Sequence[Type], wanted: Sequence[Type]) -> list[Register]:
    """Arguments that stand at an address as words."""
    given = list[Register]()
    offset = 0
    for type_, other in zip(types, wanted, strict=True):
        value = Value(type_, _WORDS, offset)
        if isinstance(type_, TupleType):
            given.append(work.place(value))
        else:
            given.append(work.cast(work.in_register(value), other).register)
        offset += words(type_)
    return given


def _finish(
    work: Assembly, callee: str, convention: str, result: Any, given: Sequence[Register]
) -> str:
    """Call a function and return what it returns, a truth value as a byte: LLVM's type of that."""
    made = work.call(result.llvm, callee, *given, convention=convention)
    if result == BOOL:
        made = work.new("i8", f"zext {made.typed} to i8")
    work.end(f"ret {made.typed}" if made.name else "ret void")
    return made.type


def caller_of(function: FunctionType) -> str:
    """Assembly of a function that is given words: an address of a function of this type, and its
    arguments."""
    work = Values()
    base = Register("%words", "ptr")
    address = work.load(WHOLE, base)
    pointer = work.new("ptr", f"inttoptr {address.typed} to ptr")
    offset = 1
    given = list[Register]()
    for _, type_ in function.arguments:
        given.append(work.outward(Value(type_, base, offset)))
        offset += words(type_)
    kind = _finish(work, str(pointer), "", function.result, given)
    head = f"define {kind} @call_{function.name}(ptr %words)"
    return f"{head} {{\n{work.body()}}}\n{METADATA}"
