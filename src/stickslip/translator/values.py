"""Types and values of the language, and operations on values.

A number, an array (its address and lengths) and the address of a function are in a register, or
still in memory; a tuple is a list of values, or stands in memory. There everything is a sequence of
words of eight bytes, of which a truth value uses the first byte.
"""

from __future__ import annotations

import inspect
import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, NoReturn, get_args, get_origin, get_type_hints

import numpy as np

from stickslip.translator import Compiled, FunctionAddress
from stickslip.translator.assembly import (
    BIT,
    NOTHING,
    POINTER,
    REAL,
    TWO_REALS,
    WHOLE,
    Assembly,
    Register,
    operand,
)


class Refusal(Exception):
    """A construct that is not in the language: its place, a description, and the remedy."""


# -- types -----------------------------------------------------------------------------------------
# Of each: `llvm`, LLVM's type of an argument; `words`, how many it takes in memory; and as text,
# what messages call it.


class Scalar(NamedTuple):
    """A number, None, or an opaque Python object."""

    name: str
    llvm: str
    words: int = 1

    def __str__(self) -> str:
        return self.name


class ArrayType(NamedTuple):
    """An array in C order: the NumPy type of its entries, its number of axes, and whether it is a
    constant and therefore read-only."""

    entries: str
    axes: int
    is_constant: bool = False

    @property
    def llvm(self) -> str:
        """Address and lengths."""
        return f"{{ {', '.join([POINTER, *[WHOLE] * self.axes])} }}"

    @property
    def words(self) -> int:
        """Address and lengths."""
        return 1 + self.axes

    def __str__(self) -> str:
        return f"{'a constant' if self.is_constant else 'an'} array of {self.axes} axes"


class FunctionType(NamedTuple):
    """A function outside, given by its address: a class of addresses, the type of its result, names
    and types of its arguments."""

    kind: type[FunctionAddress]
    result: Any
    arguments: tuple[tuple[str, Any], ...]
    llvm: str = POINTER
    words: int = 1

    def __str__(self) -> str:
        return self.kind.__name__


class TupleType(NamedTuple):
    """A tuple: its class and the types of its parts. It is passed by its address."""

    kind: type
    parts: tuple[Any, ...]
    llvm: str = POINTER

    @property
    def words(self) -> int:
        """Number of machine words of all elements."""
        return sum(part.words for part in self.parts)

    @property
    def names(self) -> Sequence[Any]:
        """Names of the elements."""
        return getattr(self.kind, "_fields", range(len(self.parts)))

    def __str__(self) -> str:
        return f"a tuple ({', '.join(map(str, self.parts))})"


Type = Scalar | ArrayType | FunctionType | TupleType
INT, FLOAT, BOOL = Scalar("int", WHOLE), Scalar("float", REAL), Scalar("bool", BIT)
COMPLEX = Scalar("complex", TWO_REALS, 2)
NONE, PYTHON = Scalar("None", NOTHING, 0), Scalar("an object of Python", "")
NAMED: dict[Any, Scalar] = {bool: BOOL, int: INT, float: FLOAT, complex: COMPLEX, type(None): NONE}
_BY_PYTHON: dict[Any, Any] = {type_: kind for kind, type_ in NAMED.items()}
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
    """The type denoted by an annotation.

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
        kind, _, detail = note.replace(":", " ").partition(" ")
        found = _with_axis(found, detail) if kind == "many" else ArrayType(kind, int(detail))
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
    try:
        if missing:
            raise TypeError(f"annotate {', '.join(sorted(missing))}")
        types = {name: declared_type(hint) for name, hint in hints.items()}
        result = types.pop("return")
        if result not in (NONE, INT, FLOAT, BOOL):
            raise TypeError(f"it returns {result}. Return a number, or write to an array")
        for name, type_ in types.items():
            if other := _not_from_python(type_):
                what = f"{name} with {other} as an argument from Python"
                raise TypeError(f"{what}. Give real numbers")
    except TypeError as error:
        raise TypeError(f"{function.place}: {error}") from None
    return tuple(types.values()), result


def _not_from_python(type_: Type) -> Type | None:
    """Element of a type that cannot be passed from Python, or None."""
    if isinstance(type_, TupleType):
        return next(filter(None, map(_not_from_python, type_.parts)), None)
    return type_ if type_ in (COMPLEX, NONE) else None


def _with_axis(type_: Any, part: str = "") -> Any:
    """A type whose arrays, or those of one part, have one more axis in front."""
    if isinstance(type_, ArrayType):
        return type_._replace(axes=type_.axes + 1)
    if not isinstance(type_, TupleType):
        return type_
    parts = zip(type_.names, type_.parts, strict=True)
    changed = (_with_axis(x) if part in ("", name) else x for name, x in parts)
    return type_._replace(parts=tuple(changed))


def promoted(a: Type, b: Type) -> Any:
    """The type in which numbers of two types meet; None if there is none."""
    return max(a, b, key=_RANKS.index) if a in _RANKS and b in _RANKS else None


def joined(a: Type, b: Type) -> Any:
    """The type of a variable that has values of two types; None if there is none."""
    if a == b:
        return a
    if isinstance(a, TupleType) and isinstance(b, TupleType):
        if a.kind is not b.kind or len(a.parts) != len(b.parts):
            return None
        parts = tuple(map(joined, a.parts, b.parts))
        return None if None in parts else a._replace(parts=parts)
    if isinstance(a, ArrayType) and isinstance(b, ArrayType):
        return as_constant(a) if as_constant(a) == as_constant(b) else None
    return None if COMPLEX in (a, b) else promoted(a, b)


def as_constant(type_: Any, is_constant: bool = True) -> Any:
    """A type whose arrays are constants, or none of them is."""
    if isinstance(type_, ArrayType):
        return type_._replace(is_constant=is_constant)
    if isinstance(type_, TupleType):
        return type_._replace(parts=tuple(as_constant(x, is_constant) for x in type_.parts))
    return type_


# -- values ----------------------------------------------------------------------------------------


@dataclass(slots=True)
class Value:
    """A value.

    Attributes
    ----------
    register : Register, optional
        What it is; or, if there is an offset, where it stands in memory.
    offset : int, optional
        In words.
    parts : list of Value, optional
        Of a tuple that is not in memory.
    known : object
        A constant, or an object of Python; ``...`` if only the running function knows.
    lasting : bool
        Whether nothing overwrites the memory as long as the function runs.
    """

    type: Any
    register: Any = None
    offset: int | None = None
    parts: list[Value] | None = None
    known: Any = ...
    lasting: bool = False

    @property
    def is_known(self) -> bool:
        """Whether it is a constant."""
        return self.known is not ...


Index = Value | tuple[Value | None, Value | None]
"""One place in brackets: an index, or the ends of a slice."""
_ARITHMETIC: dict[str, tuple[str, str, Any]] = {
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
"""Operators that are functions of the language."""
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
        """Reject the current construct."""
        raise Refusal(f"{what}. {remedy}")

    def refuse_later(self, what: str, remedy: str) -> None:
        """Refuse, unless some variables turn out to be of another type."""
        self.refuse(what, remedy)

    def runtime(self, name: str, *given: Value) -> Value:
        """Call the function of an operator for which LLVM has no instruction."""
        raise NotImplementedError

    def table(self, array: Any) -> Value:
        """A constant array."""
        raise NotImplementedError

    # -- constants and conversions -----------------------------------------------------------------

    def constant(self, x: Any) -> Value:
        """A number, an array or another object of Python that is known now."""
        x = x.item() if isinstance(x, np.generic) else x
        kind = next((kind for kind in NAMED if isinstance(x, kind)), type(None))
        if kind is type(None):
            return self.table(x) if isinstance(x, np.ndarray) else Value(PYTHON, known=x)
        if kind is int and not -(2**63) <= x < 2**64:
            self.refuse(f"{x} has more than 64 bits", "Write a real number")
        number = kind((x + 2**63) % 2**64 - 2**63 if kind is int else x)
        return Value(NAMED[kind], operand(number), known=number)

    def plain(self, value: Value) -> Value:
        """A value that may be stored: a constant tuple as its parts."""
        if value.type != PYTHON:
            return value
        if value.known is None:
            return Value(NONE)
        if isinstance(value.known, tuple):
            return self.tuple_of(type(value.known), [self.constant(x) for x in value.known])
        return self.refuse(f"{value.known!r} is not a value here", "Use a number, array or tuple")

    def tuple_of(self, kind: type, parts: Sequence[Value]) -> Value:
        """A tuple."""
        plain = [self.plain(part) for part in parts]
        if any(part.type == NONE for part in plain):
            self.refuse("None in a tuple", "Use a number")
        return Value(TupleType(kind, tuple(part.type for part in plain)), parts=plain)

    def cast(self, value: Value, type_: Any) -> Value:
        """A value as another type that holds it."""
        value = self.plain(value)
        if value.type == type_:
            return value
        if promoted(value.type, type_) == type_:
            if value.is_known:
                return self.constant(_BY_PYTHON[type_](value.known))
            if type_ == COMPLEX:
                return self.complex(self.cast(value, FLOAT).register, operand(0.0))
            return Value(type_, self.converted(value.register, type_.llvm))
        if joined(value.type, type_) == type_:
            if isinstance(type_, ArrayType):
                return replace(value, type=type_)
            parts = map(self.cast, self.parts(value), type_.parts)
            return Value(type_, parts=list(parts))
        remedy = "Give every variable, argument and result one type"
        return self.refuse(f"{value.type} where there should be {type_}", remedy)

    def complex(self, re: Register, im: Register) -> Value:
        """A complex number of its parts."""
        return Value(COMPLEX, self.structure(COMPLEX.llvm, [re, im]))

    def split(self, z: Value) -> tuple[Register, Register]:
        """Real and imaginary part."""
        return self.extract(z.register, 0, REAL), self.extract(z.register, 1, REAL)

    # -- tuples and memory -------------------------------------------------------------------------

    def place(self, value: Value, k: int = 0) -> Register:
        """Address of a word of a value in memory."""
        assert value.offset is not None
        return self.at(value.register, value.offset + k, WHOLE)

    def part(self, value: Value, k: int) -> Value:
        """One element of a tuple."""
        if value.parts is not None:
            return value.parts[k]
        type_: TupleType = value.type
        before = sum(part.words for part in type_.parts[:k])
        assert value.offset is not None
        part = replace(value, type=type_.parts[k], offset=value.offset + before)
        return part if isinstance(part.type, (TupleType, ArrayType)) else self.in_register(part)

    def parts(self, value: Value) -> list[Value]:
        """All parts of a tuple."""
        value = self.plain(value)
        if not isinstance(value.type, TupleType):
            self.refuse(f"{value.type} has no parts", "Use a tuple")
        return [self.part(value, k) for k in range(len(value.type.parts))]

    def in_register(self, value: Value) -> Value:
        """A number, an array or a function, taken out of memory."""
        if value.offset is None or isinstance(value.type, TupleType):
            return value
        return Value(value.type, self.load(value.type.llvm, self.place(value), NOTES["word"]))

    def operand(self, value: Value) -> Register:
        """Argument as functions take it: a register, and the address of a tuple."""
        if not isinstance(value.type, TupleType):
            return self.in_register(value).register
        return self.place(value if value.offset is not None else self.stored(value))

    def outward(self, value: Value) -> Register:
        """Argument as C functions take it: a truth value is a byte."""
        x = self.operand(value)
        return self.converted(x, "i8") if value.type == BOOL else x

    def room(self, type_: Type) -> Register:
        """Address of room for a value."""
        is_tuple = isinstance(type_, TupleType)
        return self.slot(f"[{max(type_.words, 1)} x i64]" if is_tuple else type_.llvm)

    def stored(self, value: Value) -> Value:
        """A copy in memory."""
        address = self.room(value.type)
        self.put(value, address)
        return Value(value.type, address, 0)

    def put(self, value: Value, base: Register, offset: int = 0) -> None:
        """Write a value to memory, at an offset in words from an address."""
        if value.parts is not None:
            for part in value.parts:
                self.put(part, base, offset)
                offset += part.type.words
            return
        address = self.at(base, offset, WHOLE)
        if not isinstance(value.type, TupleType):
            self.store(self.in_register(value).register, address, NOTES["word"])
        elif size := value.type.words:
            name, note = "llvm.memcpy.p0.p0.i64", NOTES["word"].removeprefix(", align 8")
            self.declared[name] = f"declare void @{name}(ptr, ptr, i64, i1)"
            given = f"ptr align 8 {address}, ptr align 8 {self.place(value)}, i64 {8 * size}"
            self.lines.append(f"call void @{name}({given}, i1 false){note}")

    def settled(self, value: Value) -> Value:
        """A value that no assignment changes."""
        if value.parts is not None:
            return replace(value, parts=[self.settled(part) for part in value.parts])
        if value.offset is None or not isinstance(value.type, TupleType):
            return self.in_register(value)
        return value if value.lasting else self.stored(value)

    # -- arrays ------------------------------------------------------------------------------------

    def _word_of(self, array: Value, k: int, type_: str) -> Register:
        if array.offset is not None:
            return self.load(type_, self.place(array, k), NOTES["word"])
        return self.extract(array.register, k, type_)

    def length(self, array: Value, axis: int) -> Value:
        """Length of an axis."""
        return Value(INT, self._word_of(array, 1 + axis, WHOLE))

    def counted(self, array: Value, axis: int, index: Value) -> Value:
        """An index counted from the beginning."""
        if not index.is_known or index.known >= 0:
            return index
        return Value(INT, self.op("add nsw", self.length(array, axis).register, index.register))

    def entry(self, array: Value, given: Sequence[Value]) -> Register:
        """Address of an entry, or of the first of a row."""
        base = self._word_of(array, 0, POINTER)
        before: Register | None = None  # offset in entries; None is zero
        for axis in range(array.type.axes):
            if before is not None:
                before = self.op("mul nsw", before, self.length(array, axis).register)
            if axis < len(given):
                index = self.counted(array, axis, given[axis]).register
                if index != operand(0):
                    before = index if before is None else self.op("add nsw", before, index)
        return self.at(base, before or operand(0), ENTRIES[array.type.entries][1])

    def element(self, array: Value, given: Sequence[Index]) -> Value:
        """An entry, a row, or a part of rows."""
        type_: ArrayType = array.type
        if len(given) > type_.axes:
            self.refuse(f"{len(given)} indices of {type_}", "Leave some out")
        places = [index for index in given if isinstance(index, Value)]
        if len(places) == type_.axes:
            return self.read_entry(type_, self.entry(array, places))
        lengths = [self.length(array, k).register for k in range(len(given), type_.axes)]
        if len(places) < len(given):
            low, high = self.bounds(array, len(places), given[-1])
            places.append(low)
            size = self.op("sub nsw", high.register, low.register)
            lengths.insert(0, self.outside(WHOLE, "llvm.smax.i64", size, 0))
        kind = type_._replace(axes=len(lengths))
        return Value(kind, self.structure(kind.llvm, [self.entry(array, places), *lengths]))

    def bounds(self, array: Value, axis: int, ends: Any) -> tuple[Value, Value]:
        """The ends of a slice, within the array."""
        length = self.length(array, axis)

        def bound(given: Value | None, otherwise: Value) -> Value:
            if given is None or (given.is_known and given.known == 0):
                return given or otherwise
            found = self.counted(array, axis, given).register
            found = self.outside(WHOLE, "llvm.smin.i64", found, length.register)
            return Value(INT, self.outside(WHOLE, "llvm.smax.i64", found, 0))

        low, high = ends
        return bound(low, self.constant(0)), bound(high, length)

    def read_entry(self, type_: ArrayType, address: Register) -> Value:
        """The value at the address of an entry."""
        kind, memory = ENTRIES[type_.entries]
        found = self.load(memory, address, NOTES[type_.entries])
        return Value(kind, self.converted(found, kind.llvm))

    def write_entry(self, type_: ArrayType, address: Register, value: Value) -> None:
        """Put a value at the address of an entry."""
        kind, memory = ENTRIES[type_.entries]
        value = self.truncated(value) if (value.type, kind) == (FLOAT, INT) else value
        found = self.converted(self.cast(value, kind).register, memory)
        self.store(found, address, NOTES[type_.entries])

    # -- arithmetic --------------------------------------------------------------------------------

    def real_op(self, operation: str, a: Register | float, b: Register) -> Register:
        """Arithmetic of real numbers."""
        return self.op(f"{operation}{self.flags}", a, b)

    def opposite(self, x: Register) -> Register:
        """−x, of a real number."""
        return self.new(REAL, f"fneg{self.flags} {x.typed}")

    def truncated(self, x: Value) -> Value:
        """A real number as an integer, without its fractional part."""
        return Value(INT, self.outside(WHOLE, "llvm.fptosi.sat.i64.f64", x.register))

    def binary(self, operation: str, a: Value, b: Value) -> Value:
        """A binary operator."""
        type_ = promoted(a.type, b.type)
        if type_ is None:
            self.refuse(f"{operation} of {a.type} and {b.type}", "Write a loop over entries")
        of_wholes, of_reals, by_python = _ARITHMETIC.get(operation, ("", "", None))
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
            return Value(INT, self.divided(operation, a.register, b.register))
        if type_ == INT and operation in ("LShift", "RShift"):
            return Value(INT, self.shifted(of_wholes, a.register, b))
        if (operation, type_) in _RUNTIME:
            return self.runtime(_RUNTIME[operation, type_], a, b)
        if type_ in (INT, BOOL) and of_wholes:
            return Value(type_, self.op(of_wholes, a.register, b.register))
        if type_ == FLOAT and of_reals:
            return Value(FLOAT, self.real_op(of_reals, a.register, b.register))
        if type_ == COMPLEX and of_reals:
            return self.complex_binary(of_reals, self.split(a), self.split(b))
        return self.refuse(f"{operation} of {type_}", "Use another operator")

    def complex_binary(
        self, operation: str, a: tuple[Register, Register], b: tuple[Register, Register]
    ) -> Value:
        """Sums and products of complex numbers."""
        if operation != "fmul":
            return self.complex(*(self.real_op(operation, x, y) for x, y in zip(a, b, strict=True)))
        ac, bd = (self.real_op("fmul", x, y) for x, y in zip(a, b, strict=True))
        ad, bc = self.real_op("fmul", a[0], b[1]), self.real_op("fmul", a[1], b[0])
        return self.complex(self.real_op("fsub", ac, bd), self.real_op("fadd", ad, bc))

    def divided(self, operation: str, a: Register, b: Register) -> Register:
        """Quotient or remainder of whole numbers as Python rounds them; zero by zero."""
        # In LLVM, division by 0, and of the smallest integer by −1, is undefined.
        none, minus = self.op("icmp eq", b, 0), self.op("icmp eq", b, -1)
        by = self.pick(self.op("or", none, minus), 1, b)
        quotient, rest = self.op("sdiv", a, by), self.op("srem", a, by)
        opposite = self.op("icmp slt", self.op("xor", rest, by), 0)
        below = self.op("and", self.op("icmp ne", rest, 0), opposite)
        if operation == "Mod":
            return self.op("add", rest, self.pick(below, by, 0))
        found = self.op("sub", quotient, self.converted(below, WHOLE))
        found = self.pick(minus, self.op("sub", 0, a), found)
        return self.pick(none, 0, found)

    def shifted(self, instruction: str, a: Register, places: Value) -> Register:
        """A number with its bits moved; by 64 places or more, too, which LLVM leaves undefined."""
        n = places.register
        if places.is_known and 0 <= places.known < 64:
            return self.op(instruction, a, n)
        moved = self.op(instruction, a, self.outside(WHOLE, "llvm.umin.i64", n, 63))
        if instruction == "ashr":
            return moved
        return self.pick(self.op("icmp ult", n, 64), moved, 0)

    def power(self, a: Value, b: Value) -> Value:
        """A power: with a constant whole exponent a product, by repeated squares."""
        what = f"a power of {a.type} with {b.type}", "Write a product or use float()"
        if COMPLEX in (a.type, b.type):
            self.refuse(*what)
        if b.type == INT and a.type != FLOAT:
            self.refuse_later(*what)  # the only operation for real numbers alone
        a = self.cast(a, FLOAT)
        if b.type == INT and not b.is_known:
            return self.runtime("power_whole", a, b)
        if b.type != INT:
            given = a.register, self.cast(b, FLOAT).register
            return Value(FLOAT, self.outside(REAL, "llvm.pow.f64", *given, flags=self.flags))
        left, square, product = abs(b.known), a.register, None
        while left:
            if left & 1:
                product = square if product is None else self.real_op("fmul", product, square)
            left >>= 1
            if left:
                square = self.real_op("fmul", square, square)
        product = product or operand(1.0)
        return Value(FLOAT, self.real_op("fdiv", 1.0, product) if b.known < 0 else product)

    def negative(self, a: Value) -> Value:
        """−a."""
        if a.type not in _RANKS:
            self.refuse(f"the negative of {a.type}", "Write a loop over entries")
        if a.is_known:
            return self.constant(-a.known)
        if a.type == FLOAT:
            return Value(FLOAT, self.opposite(a.register))
        if a.type == COMPLEX:
            return self.complex(*map(self.opposite, self.split(a)))
        return Value(INT, self.op("sub", 0, self.cast(a, INT).register))

    # -- tests -------------------------------------------------------------------------------------

    def compare(self, operation: str, a: Value, b: Value) -> Value:
        """A comparison."""
        type_ = promoted(a.type, b.type)
        if type_ is None or operation not in _COMPARISONS:
            self.refuse(f"{operation} of {a.type} and {b.type}", "Compare numbers one by one")
        type_ = INT if type_ == BOOL else type_
        a, b = self.cast(a, type_), self.cast(b, type_)
        of_wholes, of_reals = _COMPARISONS[operation]
        if type_ == INT:
            return Value(BOOL, self.op(f"icmp {of_wholes}", a.register, b.register))
        if type_ == FLOAT:
            return Value(BOOL, self.op(f"fcmp{self.flags} {of_reals}", a.register, b.register))
        if of_wholes not in ("eq", "ne"):
            self.refuse("complex numbers have no order", "Compare parts or absolute values")
        pairs = zip(self.split(a), self.split(b), strict=True)
        both = Value(BOOL, self.op("and", *(self.op(f"fcmp{self.flags} oeq", *x) for x in pairs)))
        return both if operation == "Eq" else self.inverted(both)

    def inverted(self, a: Value) -> Value:
        """Whether something is not true."""
        return Value(BOOL, self.op("xor", a.register, True))

    def truth(self, value: Value) -> Value:
        """Whether a number is not zero."""
        if value.type == BOOL:
            return value
        if value.type not in (INT, FLOAT):
            self.refuse(f"{value.type} is neither true nor false", "Write a comparison")
        return self.compare("NotEq", value, self.constant(0))

    def either(self, test: Value, a: Value, b: Value) -> Value:
        """Select one of two numbers of the same type, without a branch."""
        flags = self.flags if a.type == FLOAT else ""
        return Value(a.type, self.pick(test.register, a.register, b.register, flags))
