"""Types and values of the language, and what is done with values.

A number, an array (its address and lengths) and the address of a function are in a register; an
array may also be in memory still. A tuple is a list of values or stands in memory, where everything
is a sequence of words of eight bytes.
"""

from __future__ import annotations

import inspect
import operator
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple, NoReturn, get_args, get_origin, get_type_hints

import numpy as np

from stickslip.translator import Compiled, FunctionAddress
from stickslip.translator.assembly import (
    BIT,
    POINTER,
    REAL,
    WHOLE,
    Assembly,
    Register,
    bit,
    imaginary,
    real,
    whole,
)


class Refusal(Exception):
    """Something that is not in the language: where it stands, what it is, and what to do."""


# -- types -----------------------------------------------------------------------------------------


class Scalar(NamedTuple):
    """A number, nothing, or an object that only Python knows."""

    name: str
    llvm: str


class ArrayType(NamedTuple):
    """An array in C order: the type of its entries, as NumPy writes it, and its number of axes."""

    entries: str
    axes: int

    @property
    def llvm(self) -> str:
        """Address and lengths."""
        return f"{{ {', '.join([POINTER, *[WHOLE] * self.axes])} }}"


class FunctionType(NamedTuple):
    """A function outside, given by its address: a class of addresses, the type of its result, names
    and types of its arguments."""

    kind: type[FunctionAddress]
    result: Any
    arguments: tuple[tuple[str, Any], ...]
    llvm: str = POINTER

    @property
    def name(self) -> str:
        """In messages."""
        return self.kind.__name__


class TupleType(NamedTuple):
    """A tuple: its class and the types of its parts."""

    kind: type
    parts: tuple[Any, ...]


Type = Scalar | ArrayType | FunctionType | TupleType
INT, FLOAT, BOOL = Scalar("int", WHOLE), Scalar("float", REAL), Scalar("bool", BIT)
COMPLEX = Scalar("complex", "{ double, double }")
NONE, PYTHON = Scalar("None", "void"), Scalar("an object of Python", "")
NAMED: dict[Any, Scalar] = {int: INT, float: FLOAT, bool: BOOL, complex: COMPLEX, type(None): NONE}
_RANKS = (BOOL, INT, FLOAT, COMPLEX)
ENTRIES = {
    "f8": (FLOAT, REAL),
    "i8": (INT, WHOLE),
    "c16": (COMPLEX, COMPLEX.llvm),
    "b1": (BOOL, "i8"),
    "i1": (INT, "i8"),
    "i2": (INT, "i16"),
    "i4": (INT, "i32"),
}
"""Of entries of arrays: their type when they are read, and LLVM's type of them in memory."""
_KINDS_OF_MEMORY = ("word", *ENTRIES)
METADATA = "\n".join(
    ['!0 = !{!"memory"}']
    + [f'!{2 * k + 1} = !{{!"{name}", !0, i64 0}}' for k, name in enumerate(_KINDS_OF_MEMORY)]
    + [f"!{k + 2} = !{{!{k + 1}, !{k + 1}, i64 0}}" for k in range(0, 2 * len(_KINDS_OF_MEMORY), 2)]
)
"""What LLVM may assume: memory of one kind is never another's."""
NOTES = {name: f", align 8, !tbaa !{2 * k + 2}" for k, name in enumerate(_KINDS_OF_MEMORY)}
NOTES |= {name: note.replace("8", name[1], 1) for name, note in NOTES.items() if name[0] in "ib"}


def declared_type(hint: Any) -> Type:
    """The type that an annotation stands for.

    Raises
    ------
    TypeError
        If it stands for none.
    """
    notes = getattr(hint, "__metadata__", ())
    found = None if notes else NAMED.get(hint)
    base = hint.__origin__ if notes else hint
    if isinstance(base, type) and hasattr(base, "_fields"):
        parts = get_type_hints(base, include_extras=True).values()
        found = TupleType(base, tuple(map(declared_type, parts)))
    elif get_origin(hint) is tuple:
        found = TupleType(tuple, tuple(map(declared_type, get_args(hint))))
    elif isinstance(base, type) and issubclass(base, FunctionAddress):
        found = function_type(base)
    for note in notes:
        if note == "many":
            found = with_axis(found)
        elif note.startswith("many "):
            found = with_axis(found, note[5:])
        else:
            entries, axes = note.split(":")
            found = ArrayType(entries, int(axes))
    if found is None:
        raise TypeError(f"compiled functions take no {inspect.formatannotation(hint)}")
    return found


def function_type(kind: type[FunctionAddress]) -> FunctionType:
    """The type of a function outside, by its signature."""
    hints = get_type_hints(kind.signature, include_extras=True)
    types = {name: declared_type(hint) for name, hint in hints.items()}
    return FunctionType(kind, types.pop("return"), tuple(types.items()))


def entry_types(function: Compiled) -> tuple[tuple[Type, ...], Type]:
    """The types of an entry's parameters and of its result, as annotated.

    Raises
    ------
    TypeError
        If an annotation is missing, or compiled functions take no such thing.
    """
    hints = get_type_hints(function.python, include_extras=True)
    missing = {*inspect.signature(function.python).parameters, "return"} - hints.keys()
    if missing:
        raise TypeError(f"{place_of(function)}: annotate {', '.join(sorted(missing))}")
    try:
        types = {name: declared_type(hint) for name, hint in hints.items()}
    except TypeError as error:
        raise TypeError(f"{place_of(function)}: {error}") from None
    result = types.pop("return")
    if result not in (NONE, INT, FLOAT, BOOL):
        what = f"it returns {named(result)}. Return a number, or write to an array"
        raise TypeError(f"{place_of(function)}: {what}")
    for name, type_ in types.items():
        if other := _not_from_python(type_):
            what = f"{name} with {named(other)} as an argument from Python. Give real numbers"
            raise TypeError(f"{place_of(function)}: {what}")
    return tuple(types.values()), result


def _not_from_python(type_: Type) -> Type | None:
    """What of a type no argument of an entry can be."""
    if isinstance(type_, TupleType):
        return next(filter(None, map(_not_from_python, type_.parts)), None)
    return type_ if type_ in (COMPLEX, NONE) else None


def place_of(function: Compiled) -> str:
    """Where a function stands, and its name."""
    code = function.python.__code__
    return f"{code.co_filename}:{code.co_firstlineno}: {function.__name__}"


def symbol_of(function: Compiled) -> str:
    """The name of an entry in the assembly."""
    return f"entry.{function.__module__}.{function.__name__}"


@cache
def plain_types(function: Compiled) -> tuple[tuple[str, ...], str]:
    """LLVM's types of the arguments of an entry, and of its result, for other assembly that calls
    it: an array is its address and the lengths of all its axes but the first.

    Raises
    ------
    TypeError
        If there is a tuple or a truth value among them.
    """
    types, result = entry_types(function)
    if result == BOOL or any(isinstance(x, TupleType) or x == BOOL for x in types):
        raise TypeError(f"{function.__name__}: use numbers and arrays where assembly calls it")
    plain = [
        [POINTER, *[WHOLE] * (type_.axes - 1)] if isinstance(type_, ArrayType) else [type_.llvm]  # pyright: ignore[reportAttributeAccessIssue]
        for type_ in types
    ]
    return tuple(kind for kinds in plain for kind in kinds), result.llvm  # pyright: ignore[reportAttributeAccessIssue]


def with_axis(type_: Any, part: str = "") -> Any:
    """A type whose arrays, or those of one part, have one more axis in front."""
    if isinstance(type_, ArrayType):
        return ArrayType(type_.entries, type_.axes + 1)
    if not isinstance(type_, TupleType):
        return type_
    names = getattr(type_.kind, "_fields", range(len(type_.parts)))
    parts = zip(names, type_.parts, strict=True)
    return TupleType(
        type_.kind, tuple(with_axis(x) if part in ("", name) else x for name, x in parts)
    )


def passed(type_: Type) -> str:
    """LLVM's type of an argument: a tuple is passed by its address."""
    return POINTER if isinstance(type_, TupleType) else type_.llvm


def words(type_: Type) -> int:
    """Words in memory."""
    if isinstance(type_, TupleType):
        return sum(map(words, type_.parts))
    if isinstance(type_, ArrayType):
        return 1 + type_.axes
    return {COMPLEX: 2, NONE: 0}.get(type_, 1)  # pyright: ignore[reportArgumentType]


def promoted(a: Type, b: Type) -> Any:
    """The type in which numbers of two types meet; None if there is none."""
    if a in _RANKS and b in _RANKS:
        return max(a, b, key=_RANKS.index)
    return None


def joined(a: Type, b: Type) -> Any:
    """The type of a variable that has values of two types; None if there is none."""
    if a == b:
        return a
    if isinstance(a, TupleType) and isinstance(b, TupleType):
        if a.kind is not b.kind or len(a.parts) != len(b.parts):
            return None
        parts = tuple(joined(x, y) for x, y in zip(a.parts, b.parts, strict=True))
        return None if None in parts else TupleType(a.kind, parts)
    return None if COMPLEX in (a, b) else promoted(a, b)


def named(type_: Type) -> str:
    """A type in messages."""
    if isinstance(type_, ArrayType):
        return f"an array of {type_.axes} axes"
    if isinstance(type_, TupleType):
        return f"a tuple ({', '.join(map(named, type_.parts))})"
    return type_.name


# -- values ----------------------------------------------------------------------------------------


class _Missing:
    """What is not known before the function runs."""


@dataclass(slots=True)
class Value:
    """A value.

    Attributes
    ----------
    type : Type
    register : Register, optional
        What it is; or, if there is an offset, where it stands in memory.
    offset : int, optional
        In words.
    parts : list of Value, optional
        Of a tuple that is not in memory.
    known : object
        A constant, or an object of Python.
    lasting : bool
        Whether nothing overwrites the memory as long as the function runs.
    """

    type: Type
    register: Any = None
    offset: int | None = None
    parts: list[Value] | None = None
    known: Any = field(default=_Missing)
    lasting: bool = False

    @property
    def is_known(self) -> bool:
        """Whether it is a constant."""
        return self.known is not _Missing


class Index(NamedTuple):
    """One place in brackets: an index, or the ends of a slice."""

    value: Value | None
    slice: tuple[Value | None, Value | None] | None = None


_ARITHMETIC = {
    "Add": ("add", "fadd", operator.add),
    "Sub": ("sub", "fsub", operator.sub),
    "Mult": ("mul", "fmul", operator.mul),
    "Div": ("", "fdiv", None),
    "BitOr": ("or", "", operator.or_),
    "BitAnd": ("and", "", operator.and_),
    "BitXor": ("xor", "", operator.xor),
    "LShift": ("shl", "", None),
    "RShift": ("ashr", "", None),
}
"""LLVM's instructions for whole and for real numbers, and what Python does with constants."""
_RUNTIME = {
    ("Mod", FLOAT): "real_mod",
    ("FloorDiv", FLOAT): "real_floordiv",
    ("Div", COMPLEX): "complex_div",
}
"""Operators that are functions of :mod:`stickslip.translator.runtime`."""
_COMPARISONS = {
    "Eq": ("eq", "oeq"),
    "NotEq": ("ne", "une"),
    "Lt": ("slt", "olt"),
    "LtE": ("sle", "ole"),
    "Gt": ("sgt", "ogt"),
    "GtE": ("sge", "oge"),
}


class Values(Assembly):
    """A function in the making, as values."""

    flags = ""
    """Fast-math flags of its arithmetic."""

    def refuse(self, what: str, remedy: str) -> NoReturn:
        """Refuse what is being translated."""
        raise Refusal(f"{what}. {remedy}")

    def runtime(self, name: str, *given: Value) -> Value:
        """Call a function of :mod:`stickslip.translator.runtime`."""
        raise NotImplementedError

    def table(self, array: Any) -> Value:
        """A constant array."""
        raise NotImplementedError

    # -- constants and conversions -----------------------------------------------------------------

    def constant(self, x: Any) -> Value:
        """A number, an array or another object of Python that is known now."""
        if isinstance(x, (bool, np.bool_)):
            return Value(BOOL, bit(bool(x)), known=bool(x))
        if isinstance(x, (int, np.integer)):
            if not -(2**63) <= x < 2**64:
                self.refuse(f"{x} has more than 64 bits", "Write a real number")
            wrapped = (int(x) + 2**63) % 2**64 - 2**63
            return Value(INT, whole(wrapped), known=wrapped)
        if isinstance(x, (float, np.floating)):
            return Value(FLOAT, real(float(x)), known=float(x))
        if isinstance(x, complex):
            return Value(COMPLEX, imaginary(x), known=x)
        if isinstance(x, np.ndarray):
            return self.table(x)
        return Value(PYTHON, known=x)

    def plain(self, value: Value) -> Value:
        """A value that may be stored: a constant tuple as its parts."""
        if value.type != PYTHON:
            return value
        if value.known is None:
            return Value(NONE)
        if isinstance(value.known, tuple):
            parts = [self.plain(self.constant(x)) for x in value.known]
            return self.tuple_of(type(value.known), parts)
        return self.refuse(f"{value.known!r} is not a value here", "Use a number, array or tuple")

    def tuple_of(self, kind: type, parts: Sequence[Value]) -> Value:
        """A tuple."""
        plain = [self.plain(part) for part in parts]
        if any(part.type == NONE for part in plain):
            self.refuse("None in a tuple", "Use a number")
        return Value(TupleType(kind, tuple(part.type for part in plain)), parts=plain)

    def cast(self, value: Value, type_: Type) -> Value:
        """A value as another type that holds it."""
        value = self.plain(value)
        if value.type == type_:
            return value
        if value.is_known and promoted(value.type, type_) == type_:
            return self.constant({INT: int, FLOAT: float, COMPLEX: complex}[type_](value.known))
        if isinstance(type_, TupleType) and joined(value.type, type_) == type_:
            parts = zip(self.parts(value), type_.parts, strict=True)
            return Value(type_, parts=[self.cast(part, wanted) for part, wanted in parts])
        if type_ == COMPLEX and value.type in _RANKS:
            return self.complex(self.cast(value, FLOAT).register, real(0.0))
        step = {(BOOL, INT): "zext", (BOOL, FLOAT): "uitofp", (INT, FLOAT): "sitofp"}
        how = step.get((value.type, type_))  # pyright: ignore[reportArgumentType, reportCallIssue]
        if how is None:
            return self.refuse(
                f"{named(value.type)} where there should be {named(type_)}",
                "Give every variable, argument and result one type",
            )
        operand: Register = value.register
        llvm = type_.llvm  # pyright: ignore[reportAttributeAccessIssue]
        return Value(type_, self.new(llvm, f"{how} {operand.typed} to {llvm}"))

    def complex(self, re: Register, im: Register) -> Value:
        """A complex number of its parts."""
        return Value(COMPLEX, self.structure(COMPLEX.llvm, [re, im]))

    def split(self, z: Value) -> tuple[Register, Register]:
        """Real and imaginary part."""
        return self.extract(z.register, 0, REAL), self.extract(z.register, 1, REAL)

    # -- tuples and memory -------------------------------------------------------------------------

    def place(self, value: Value, offset: int = 0) -> Register:
        """Address of a word of a value in memory."""
        assert value.offset is not None
        return self.word(value.register, value.offset + offset)

    def word(self, base: Register, offset: int) -> Register:
        """Address of a word, so many behind another."""
        return self.at(base, offset, WHOLE) if offset else base

    def part(self, value: Value, k: int) -> Value:
        """One part of a tuple."""
        if value.parts is not None:
            return value.parts[k]
        assert isinstance(value.type, TupleType) and value.offset is not None
        offset = value.offset + sum(map(words, value.type.parts[:k]))
        part = Value(value.type.parts[k], value.register, offset, lasting=value.lasting)
        compound = isinstance(part.type, (TupleType, ArrayType))
        return part if compound else self.in_register(part)

    def parts(self, value: Value) -> list[Value]:
        """All parts of a tuple."""
        value = self.plain(value)
        if not isinstance(value.type, TupleType):
            self.refuse(f"{named(value.type)} has no parts", "Use a tuple")
        return [self.part(value, k) for k in range(len(value.type.parts))]

    def in_register(self, value: Value) -> Value:
        """A number, an array or a function, taken out of memory."""
        if value.offset is None:
            return value
        memory = WHOLE if value.type == BOOL else value.type.llvm  # pyright: ignore[reportAttributeAccessIssue]
        found = self.load(memory, self.place(value), NOTES["word"])
        if value.type == BOOL:
            found = self.new(BIT, f"trunc {found.typed} to i1")
        return Value(value.type, found)

    def outward(self, value: Value) -> Register:
        """The same as C takes it: a truth value is a byte."""
        register: Register = self.in_register(value).register
        return self.new("i8", f"zext {register.typed} to i8") if value.type == BOOL else register

    def in_memory(self, value: Value) -> Register:
        """Address of a tuple."""
        if value.offset is not None:
            return self.place(value)
        address = self.room(value.type)
        self.put(value, address, 0)
        return address

    def room(self, type_: Type) -> Register:
        """A slot for a value: words for a tuple."""
        is_tuple = isinstance(type_, TupleType)
        return self.slot(f"[{max(words(type_), 1)} x i64]" if is_tuple else type_.llvm)

    def keep(self, value: Value, place: Register) -> None:
        """Put a value into its slot."""
        if isinstance(value.type, TupleType):
            self.put(value, place, 0)
        else:
            self.store(self.in_register(value).register, place)

    def kept(self, type_: Type, place: Register) -> Value:
        """The value in a slot."""
        if isinstance(type_, TupleType):
            return Value(type_, place, 0)
        return Value(type_, self.load(type_.llvm, place))

    def put(self, value: Value, base: Register, offset: int) -> None:
        """Write a value to memory as words."""
        if value.parts is not None:
            for part in value.parts:
                self.put(part, base, offset)
                offset += words(part.type)
            return
        address = self.word(base, offset)
        if isinstance(value.type, TupleType):
            size = words(value.type)
            if size:
                name = "llvm.memcpy.p0.p0.i64"
                self.declared[name] = f"declare void @{name}(ptr, ptr, i64, i1)"
                given = f"ptr align 8 {address}, ptr align 8 {self.place(value)}, i64 {8 * size}"
                note = NOTES["word"].removeprefix(", align 8")
                self.lines.append(f"call void @{name}({given}, i1 false){note}")
            return
        register = self.in_register(value).register
        if value.type == BOOL:
            register = self.new(WHOLE, f"zext {register.typed} to i64")
        self.store(register, address, NOTES["word"])

    def settled(self, value: Value) -> Value:
        """A value that no assignment changes."""
        if value.parts is not None:
            return replace(value, parts=[self.settled(part) for part in value.parts])
        if value.offset is None or (value.lasting and isinstance(value.type, TupleType)):
            return value
        if not isinstance(value.type, TupleType):
            return self.in_register(value)
        address = self.room(value.type)
        self.put(value, address, 0)
        return Value(value.type, address, 0)

    # -- arrays ------------------------------------------------------------------------------------

    def pointer(self, array: Value) -> Register:
        """Address of the first entry."""
        if array.offset is not None:
            return self.load(POINTER, self.place(array), NOTES["word"])
        return self.extract(array.register, 0, POINTER)

    def length(self, array: Value, axis: int) -> Value:
        """Length of an axis."""
        if array.offset is not None:
            return Value(INT, self.load(WHOLE, self.place(array, 1 + axis), NOTES["word"]))
        return Value(INT, self.extract(array.register, 1 + axis, WHOLE))

    def distance(self, array: Value, given: Sequence[Value]) -> Register:
        """How many entries lie before an entry, or before the first of a row."""
        total = whole(0)
        for axis in range(array.type.axes):  # pyright: ignore[reportAttributeAccessIssue]
            if total.name != "0":
                length = self.length(array, axis).register
                total = self.new(WHOLE, f"mul nsw i64 {total}, {length}")
            if axis < len(given):
                index = self.counted(array, axis, given[axis]).register
                both = total.name != "0" and index.name != "0"
                total = (
                    self.new(WHOLE, f"add nsw i64 {total}, {index}")
                    if both
                    else (index if total.name == "0" else total)
                )
        return total

    def counted(self, array: Value, axis: int, index: Value) -> Value:
        """An index counted from the beginning."""
        if index.is_known and index.known < 0:
            length = self.length(array, axis).register
            return Value(INT, self.new(WHOLE, f"add nsw i64 {length}, {index.known}"))
        return index

    def entry(self, array: Value, given: Sequence[Value]) -> Register:
        """Address of an entry, or of the first of a row."""
        memory = ENTRIES[array.type.entries][1]  # pyright: ignore[reportAttributeAccessIssue]
        base = self.pointer(array)
        return self.at(base, self.distance(array, given), memory)

    def element(self, array: Value, given: Sequence[Index]) -> Value:
        """An entry, a row, or a part of rows."""
        type_ = array.type
        assert isinstance(type_, ArrayType)
        if len(given) > type_.axes:
            self.refuse(f"{len(given)} indices of {named(type_)}", "Leave some out")
        places = [index.value for index in given if index.value is not None]
        if len(places) == type_.axes:
            return self.read_entry(type_, self.entry(array, places))
        lengths = [self.length(array, k).register for k in range(len(given), type_.axes)]
        if len(places) < len(given):
            low, high = self.bounds(array, len(places), given[-1])
            places.append(low)
            size = self.new(WHOLE, f"sub nsw i64 {high.register}, {low.register}")
            lengths.insert(0, self.outside(WHOLE, "llvm.smax.i64", size, whole(0)))
        kind = ArrayType(type_.entries, len(lengths))
        return Value(kind, self.structure(kind.llvm, [self.entry(array, places), *lengths]))

    def bounds(self, array: Value, axis: int, index: Index) -> tuple[Value, Value]:
        """The ends of a slice, within the array."""
        assert index.slice is not None
        length = self.length(array, axis)

        def bound(given: Value | None, otherwise: Value) -> Value:
            if given is None or (given.is_known and given.known == 0):
                return otherwise if given is None else self.constant(0)
            found = self.counted(array, axis, given).register
            found = self.outside(WHOLE, "llvm.smin.i64", found, length.register)
            return Value(INT, self.outside(WHOLE, "llvm.smax.i64", found, whole(0)))

        low, high = index.slice
        return bound(low, self.constant(0)), bound(high, length)

    def read_entry(self, type_: ArrayType, address: Register) -> Value:
        """What stands at the address of an entry."""
        kind, memory = ENTRIES[type_.entries]
        found = self.load(memory, address, NOTES[type_.entries])
        if kind == BOOL:
            found = self.new(BIT, f"trunc {found.typed} to i1")
        elif kind == INT and memory != WHOLE:
            found = self.new(WHOLE, f"sext {found.typed} to i64")
        return Value(kind, found)

    def write_entry(self, type_: ArrayType, address: Register, value: Value) -> None:
        """Put a value at the address of an entry."""
        kind, memory = ENTRIES[type_.entries]
        value = self.truncated(value) if (value.type, kind) == (FLOAT, INT) else value
        found: Register = self.cast(value, kind).register
        if kind == BOOL:
            found = self.new(memory, f"zext {found.typed} to i8")
        elif kind == INT and memory != WHOLE:
            found = self.new(memory, f"trunc {found.typed} to {memory}")
        self.store(found, address, NOTES[type_.entries])

    # -- arithmetic --------------------------------------------------------------------------------

    def real_op(self, operation: str, *given: Register) -> Register:
        """Arithmetic of real numbers."""
        operands = ", ".join(map(str, given))
        return self.new(REAL, f"{operation}{self.flags} double {operands}")

    def truncated(self, x: Value) -> Value:
        """A real number without what is behind the point, as a whole one."""
        return Value(INT, self.outside(WHOLE, "llvm.fptosi.sat.i64.f64", x.register))

    def binary(self, operation: str, a: Value, b: Value) -> Value:
        """A binary operator."""
        a, b = self.plain(a), self.plain(b)
        type_ = promoted(a.type, b.type)
        if type_ is None:
            self.refuse(
                f"{operation} of {named(a.type)} and {named(b.type)}", "Write a loop over entries"
            )
        instruction, real_instruction, by_python = _ARITHMETIC.get(operation, ("", "", None))
        if type_ == BOOL and not operation.startswith("Bit"):
            type_ = INT
        if by_python and a.is_known and b.is_known and type_ != COMPLEX:
            found = by_python(a.known, b.known)
            return self.constant(found % 2**64 if type_ == INT else found)
        if operation == "Pow":
            return self.power(a, b)
        if operation == "Div" and type_ == INT:
            type_ = FLOAT
        a, b = self.cast(a, type_), self.cast(b, type_)
        if type_ == INT and operation in ("FloorDiv", "Mod"):
            return self.divided(operation, a, b)
        if type_ == INT and operation in ("LShift", "RShift"):
            return self.shifted(instruction, a, b)
        if (operation, type_) in _RUNTIME:
            return self.runtime(_RUNTIME[operation, type_], a, b)
        if type_ in (INT, BOOL) and instruction:
            kind: str = type_.llvm
            return Value(type_, self.new(kind, f"{instruction} {kind} {a.register}, {b.register}"))
        if type_ == FLOAT and real_instruction:
            return Value(FLOAT, self.real_op(real_instruction, a.register, b.register))
        if type_ == COMPLEX and real_instruction:
            return self.complex_binary(real_instruction, self.split(a), self.split(b))
        return self.refuse(f"{operation} of {named(type_)}", "Use another operator")

    def complex_binary(
        self, operation: str, a: tuple[Register, Register], b: tuple[Register, Register]
    ) -> Value:
        """Sums and products of complex numbers."""
        if operation != "fmul":
            pairs = zip(a, b, strict=True)
            return self.complex(*(self.real_op(operation, x, y) for x, y in pairs))
        ac, bd, ad, bc = (
            self.real_op("fmul", a[i], b[j]) for i, j in ((0, 0), (1, 1), (0, 1), (1, 0))
        )
        return self.complex(self.real_op("fsub", ac, bd), self.real_op("fadd", ad, bc))

    def divided(self, operation: str, a: Value, b: Value) -> Value:
        """Quotient and remainder of whole numbers as Python rounds them; zero by zero."""
        by: Register = b.register
        if not (b.is_known and b.known > 0):
            # LLVM leaves undefined what division by 0, and of the least number by −1, would give.
            unsafe = self.new(BIT, f"icmp eq i64 {by}, 0")
            minus = self.new(BIT, f"icmp eq i64 {by}, -1")
            either = self.new(BIT, f"or i1 {unsafe}, {minus}")
            by = self.new(WHOLE, f"select i1 {either}, i64 1, i64 {by}")
        quotient = self.new(WHOLE, f"sdiv i64 {a.register}, {by}")
        rest = self.new(WHOLE, f"srem i64 {a.register}, {by}")
        opposite = self.new(BIT, f"icmp slt i64 {self.new(WHOLE, f'xor i64 {rest}, {by}')}, 0")
        some = self.new(BIT, f"icmp ne i64 {rest}, 0")
        below = self.new(BIT, f"and i1 {some}, {opposite}")
        if operation == "Mod":
            more = self.new(WHOLE, f"select i1 {below}, i64 {by}, i64 0")
            return Value(INT, self.new(WHOLE, f"add i64 {rest}, {more}"))
        less = self.new(WHOLE, f"zext i1 {below} to i64")
        found = self.new(WHOLE, f"sub i64 {quotient}, {less}")
        if by is not b.register:
            opposite_number = self.new(WHOLE, f"sub i64 0, {a.register}")
            found = self.new(WHOLE, f"select i1 {minus}, i64 {opposite_number}, i64 {found}")
            found = self.new(WHOLE, f"select i1 {unsafe}, i64 0, i64 {found}")
        return Value(INT, found)

    def shifted(self, instruction: str, a: Value, b: Value) -> Value:
        """A number with its bits moved; by 64 places or more, too, which LLVM leaves undefined."""
        if b.is_known and 0 <= b.known < 64:
            return Value(INT, self.new(WHOLE, f"{instruction} i64 {a.register}, {b.register}"))
        places = self.outside(WHOLE, "llvm.umin.i64", b.register, whole(63))
        moved = self.new(WHOLE, f"{instruction} i64 {a.register}, {places}")
        if instruction == "shl":
            few = self.new(BIT, f"icmp ult i64 {b.register}, 64")
            moved = self.new(WHOLE, f"select i1 {few}, i64 {moved}, i64 0")
        return Value(INT, moved)

    def power(self, a: Value, b: Value) -> Value:
        """A power: with a constant whole exponent a product, by repeated squares."""
        if COMPLEX in (a.type, b.type) or (b.type == INT and a.type != FLOAT):
            self.refuse(
                f"a power of {named(a.type)} with {named(b.type)}", "Write a product or use float()"
            )
        if b.type == INT and not b.is_known:
            return self.runtime("power_whole", a, b)
        if b.type != INT:
            given = self.cast(a, FLOAT).register, self.cast(b, FLOAT).register
            return Value(FLOAT, self.outside(REAL, "llvm.pow.f64", *given, flags=self.flags))
        left = abs(b.known)
        square: Register = a.register
        product = None
        while left:
            if left & 1:
                product = square if product is None else self.real_op("fmul", product, square)
            left >>= 1
            if left:
                square = self.real_op("fmul", square, square)
        product = real(1.0) if product is None else product
        return Value(FLOAT, self.real_op("fdiv", real(1.0), product) if b.known < 0 else product)

    def negative(self, a: Value) -> Value:
        """−a."""
        if a.is_known:
            return self.constant(-a.known)
        if a.type in (BOOL, INT):
            return Value(INT, self.new(WHOLE, f"sub i64 0, {self.cast(a, INT).register}"))
        if a.type == FLOAT:
            return Value(FLOAT, self.real_op("fneg", a.register))
        if a.type == COMPLEX:
            return self.complex(*(self.real_op("fneg", x) for x in self.split(a)))
        return self.refuse(f"the negative of {named(a.type)}", "Write a loop over entries")

    # -- tests -------------------------------------------------------------------------------------

    def compare(self, operation: str, a: Value, b: Value) -> Value:
        """A comparison."""
        a, b = self.plain(a), self.plain(b)
        type_ = promoted(a.type, b.type)
        if type_ is None or operation not in _COMPARISONS:
            self.refuse(
                f"{operation} of {named(a.type)} and {named(b.type)}", "Compare numbers one by one"
            )
        type_ = INT if type_ == BOOL else type_
        a, b = self.cast(a, type_), self.cast(b, type_)
        of_wholes, of_reals = _COMPARISONS[operation]
        if type_ == INT:
            return self.bit(f"icmp {of_wholes} i64 {a.register}, {b.register}")
        if type_ == FLOAT:
            return self.bit(f"fcmp{self.flags} {of_reals} double {a.register}, {b.register}")
        if of_wholes not in ("eq", "ne"):
            self.refuse("complex numbers have no order", "Compare parts or absolute values")
        pairs = zip(self.split(a), self.split(b), strict=True)
        same, other = (self.bit(f"fcmp{self.flags} oeq double {x}, {y}") for x, y in pairs)
        both = self.bit(f"and i1 {same.register}, {other.register}")
        return both if operation == "Eq" else self.inverted(both)

    def bit(self, instruction: str) -> Value:
        """The truth value that an instruction makes."""
        return Value(BOOL, self.new(BIT, instruction))

    def inverted(self, a: Value) -> Value:
        """Whether something is not true."""
        return self.bit(f"xor i1 {a.register}, true")

    def truth(self, value: Value) -> Value:
        """Whether a number is not zero."""
        if value.type == BOOL:
            return value
        if value.type in (INT, FLOAT):
            return self.compare("NotEq", value, self.constant(0))
        return self.refuse(f"{named(value.type)} is neither true nor false", "Write a comparison")

    def either(self, test: Value, a: Value, b: Value) -> Value:
        """One of two numbers of one type, without a branch."""
        register: Register = a.register
        flags = self.flags if a.type == FLOAT else ""
        operands = f"i1 {test.register}, {register.typed}, {b.register.typed}"
        return Value(a.type, self.new(register.type, f"select{flags} {operands}"))
