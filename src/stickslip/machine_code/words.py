"""The arguments of a compiled function as words of eight bytes: numbers, addresses and lengths.

The engine takes tuples of hundreds of arrays. To look at them one by one in Python would take
longer than a short motion: a walk of our own does it in a microsecond, by what Python and NumPy
promise to extensions about the layout of their objects. In a Python that promises nothing, Python
does it.
"""

from __future__ import annotations

import ctypes
import operator
import struct
import sys
import sysconfig
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from stickslip.machine_code.objects import addresses
from stickslip.translator.values import (
    BOOL,
    FLOAT,
    INT,
    NONE,
    ArrayType,
    FunctionType,
    TupleType,
    Type,
)

# Steps of the walk. The code comes first; then for a function its class; for an array its class,
# the number of its type, the number of its axes; for a tuple its class and its length.
_REAL, _WHOLE, _TRUTH, _TUPLE, _ARRAY, _FUNCTION = range(6)
_FLAGS = 0x501  # flags of an array: in C order, aligned, writable
_RESULTS: dict[Any, Any] = {
    NONE: None,
    INT: ctypes.c_int64,
    FLOAT: ctypes.c_double,
    BOOL: ctypes.c_bool,
}
_WALK = """
declare double @PyFloat_AsDouble(ptr)
declare i64 @PyLong_AsLongLong(ptr)
declare i32 @PyObject_IsTrue(ptr)
declare ptr @PyErr_Occurred()
declare i32 @PyType_IsSubtype(ptr, ptr)

define internal i64 @next(ptr %where) {{
  %from = load ptr, ptr %where
  %value = load i64, ptr %from
  %after = getelementptr i64, ptr %from, i64 1
  store ptr %after, ptr %where
  ret i64 %value
}}

define internal void @put(ptr %where, i64 %value) {{
  %to = load ptr, ptr %where
  store i64 %value, ptr %to
  %after = getelementptr i64, ptr %to, i64 1
  store ptr %after, ptr %where
  ret void
}}

define internal i32 @take(ptr %value, ptr %plan, ptr %words) {{
begin:
  %code = call i64 @next(ptr %plan)
  switch i64 %code, label %wrong
    [i64 0, label %real i64 1, label %whole i64 2, label %truth
     i64 3, label %tuple i64 4, label %array i64 5, label %function]
wrong:
  ret i32 1
real:
  %x = call double @PyFloat_AsDouble(ptr %value)
  %bits = bitcast double %x to i64
  call void @put(ptr %words, i64 %bits)
  %doubtful = fcmp oeq double %x, -1.0
  br i1 %doubtful, label %asked, label %right
function:
  %fclass = getelementptr i8, ptr %value, i64 {class_at}
  %fown = load ptr, ptr %fclass
  %functions_at = call i64 @next(ptr %plan)
  %functions = inttoptr i64 %functions_at to ptr
  %fis = call i32 @PyType_IsSubtype(ptr %fown, ptr %functions)
  %is_function = icmp ne i32 %fis, 0
  br i1 %is_function, label %whole, label %wrong
whole:
  %n = call i64 @PyLong_AsLongLong(ptr %value)
  call void @put(ptr %words, i64 %n)
  %uncertain = icmp eq i64 %n, -1
  br i1 %uncertain, label %asked, label %right
truth:
  %b = call i32 @PyObject_IsTrue(ptr %value)
  %yes = zext i32 %b to i64
  call void @put(ptr %words, i64 %yes)
  %neither = icmp slt i32 %b, 0
  br i1 %neither, label %wrong, label %right
asked:
  %error = call ptr @PyErr_Occurred()
  %failed = icmp ne ptr %error, null
  br i1 %failed, label %wrong, label %right
right:
  ret i32 0
tuple:
  %class = getelementptr i8, ptr %value, i64 {class_at}
  %own = load ptr, ptr %class
  %tuples_at = call i64 @next(ptr %plan)
  %tuples = inttoptr i64 %tuples_at to ptr
  %is = call i32 @PyType_IsSubtype(ptr %own, ptr %tuples)
  %expected = call i64 @next(ptr %plan)
  %size = getelementptr i8, ptr %value, i64 {head}
  %is_one = icmp ne i32 %is, 0
  br i1 %is_one, label %counted, label %wrong
counted:
  %parts = load i64, ptr %size
  %as_many = icmp eq i64 %parts, %expected
  br i1 %as_many, label %each, label %wrong
each:
  %i = phi i64 [0, %counted], [%i1, %again]
  %all = icmp sge i64 %i, %parts
  br i1 %all, label %right, label %one
one:
  %offset = mul i64 %i, 8
  %place = add i64 %offset, {parts_at}
  %slot = getelementptr i8, ptr %value, i64 %place
  %part = load ptr, ptr %slot
  %done = call i32 @take(ptr %part, ptr %plan, ptr %words)
  %fine = icmp eq i32 %done, 0
  br i1 %fine, label %again, label %wrong
again:
  %i1 = add i64 %i, 1
  br label %each
array:
  %aclass = getelementptr i8, ptr %value, i64 {class_at}
  %aown = load ptr, ptr %aclass
  %arrays_at = call i64 @next(ptr %plan)
  %arrays = inttoptr i64 %arrays_at to ptr
  %ais = call i32 @PyType_IsSubtype(ptr %aown, ptr %arrays)
  %type = call i64 @next(ptr %plan)
  %axes = call i64 @next(ptr %plan)
  %is_array = icmp ne i32 %ais, 0
  br i1 %is_array, label %typed, label %wrong
typed:
  %flags_at = getelementptr i8, ptr %value, i64 {flags_at}
  %flags = load i32, ptr %flags_at
  %good = and i32 %flags, {flags}
  %plain = icmp eq i32 %good, {flags}
  %descr_at = getelementptr i8, ptr %value, i64 {descr_at}
  %descr = load ptr, ptr %descr_at
  %num_at = getelementptr i8, ptr %descr, i64 {num_at}
  %num32 = load i32, ptr %num_at
  %num = sext i32 %num32 to i64
  %same = icmp eq i64 %num, %type
  %axes_at = getelementptr i8, ptr %value, i64 {axes_at}
  %naxes32 = load i32, ptr %axes_at
  %naxes = sext i32 %naxes32 to i64
  %shaped = icmp eq i64 %naxes, %axes
  %order_at = getelementptr i8, ptr %descr, i64 {order_at}
  %order = load i8, ptr %order_at
  %native = icmp ne i8 %order, {foreign}
  %ok1 = and i1 %plain, %same
  %ok2 = and i1 %shaped, %native
  %ok = and i1 %ok1, %ok2
  br i1 %ok, label %data, label %wrong
data:
  %data_at = getelementptr i8, ptr %value, i64 {head}
  %address = load i64, ptr %data_at
  call void @put(ptr %words, i64 %address)
  %shape_at = getelementptr i8, ptr %value, i64 {shape_at}
  %shape = load ptr, ptr %shape_at
  br label %lengths
lengths:
  %j = phi i64 [0, %data], [%j1, %length]
  %last = icmp sge i64 %j, %naxes
  br i1 %last, label %right, label %length
length:
  %l_at = getelementptr i64, ptr %shape, i64 %j
  %l = load i64, ptr %l_at
  call void @put(ptr %words, i64 %l)
  %j1 = add i64 %j, 1
  br label %lengths
}}

define i32 @walk(ptr %value, ptr %plan, ptr %words) {{
  %p = alloca ptr
  %w = alloca ptr
  store ptr %plan, ptr %p
  store ptr %words, ptr %w
  %done = call i32 @take(ptr %value, ptr %p, ptr %w)
  ret i32 %done
}}
"""


@dataclass(frozen=True)
class Elsewhere:
    """An array that is not in the memory of this process, but of a device."""

    address: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]


class Prepared:
    """A compiled function in memory.

    Attributes
    ----------
    run : callable
        Takes the address of the arguments as words.

    Parameters
    ----------
    name : str
        In messages.
    names : sequence of str
        Of its arguments.
    types : tuple of Type
        Theirs.
    address : int
        Of the function that takes the address of its arguments as words.
    code : Code, optional
        To which it belongs, and which stays in memory with this.
    """

    def __init__(
        self,
        name: str,
        names: Sequence[str],
        types: tuple[Type, ...],
        result: Any,
        address: int,
        code: Any = None,
    ) -> None:
        self._code = code
        self._name = name
        self._type = TupleType(type("Arguments", (tuple,), {"_fields": names}), types)
        self._plan = np.array(_plan(self._type), np.int64)
        self._plan_at: int = self._plan.ctypes.data
        self._room = ctypes.c_int64 * max(self._type.words, 1)
        self.run = ctypes.CFUNCTYPE(_RESULTS[result], ctypes.c_void_p)(address)
        self._walk = _walk()

    def __call__(self, *arguments: Any) -> Any:
        """Call it.

        Raises
        ------
        TypeError
            If an argument is of another type.
        """
        found = self.words(arguments)
        if found is None:
            raise TypeError(f"{self._name}: {mismatch(self._type, arguments, 'arguments')}")
        return self.run(found)

    def words(self, arguments: tuple[Any, ...]) -> Any:
        """The words of these arguments; None if they are of another type."""
        made = self._room()
        # The walk accepts the usual types; Python decides about all others.
        try:  # a block of `contextlib.suppress` would take longer than the walk
            if self._walk is not None and not self._walk(arguments, self._plan_at, made):
                return made
        except (TypeError, ValueError, OverflowError):
            pass
        return by_python(self._type, arguments)


def by_python(type_: Type, arguments: tuple[Any, ...]) -> Any:
    """The same words, made by Python."""
    made = list[int]()

    def take(value: Any, kind: Type) -> None:
        if isinstance(kind, TupleType):
            if not isinstance(value, tuple):
                raise TypeError
            for part, inner in zip(value, kind.parts, strict=True):
                take(part, inner)
        elif isinstance(kind, ArrayType):
            if not _fits(value, kind):
                raise TypeError
            away = isinstance(value, Elsewhere)
            made.extend([value.address if away else value.ctypes.data, *value.shape])
        elif kind == FLOAT:
            # `struct` accepts any number, and no text
            made.extend(struct.unpack("q", struct.pack("d", value)))
        else:
            if isinstance(kind, FunctionType) and not isinstance(value, kind.kind):
                raise TypeError
            number = int(bool(value)) if kind == BOOL else operator.index(value)
            struct.pack("q", number)  # has to fit
            made.append(number)

    try:
        take(arguments, type_)
    except (TypeError, ValueError, OverflowError, struct.error):
        return None
    return (ctypes.c_int64 * max(len(made), 1))(*made)


def _fits(array: Any, kind: ArrayType) -> bool:
    """Whether this is an array with these entries and axes, that lies in memory as it has to."""
    if not isinstance(array, (np.ndarray, Elsewhere)):
        return False
    entries = f"{array.dtype.kind}{array.dtype.itemsize}"
    same = entries == kind.entries and len(array.shape) == kind.axes and array.dtype.isnative
    return same and (isinstance(array, Elsewhere) or array.flags.carray)


def mismatch(type_: Any, value: Any, name: str) -> str:
    """Description of the mismatch of a value and a type."""
    if not isinstance(type_, TupleType) or not isinstance(value, tuple):
        if isinstance(type_, ArrayType) and isinstance(value, np.ndarray):
            kind = f"{value.ndim} axes of {value.dtype}"
            layout = "" if value.flags.carray else ", not writable or not in C order"
            return (
                f"{name} is an array with {kind}{layout}; {type_.axes} of {type_.entries} expected"
            )
        if isinstance(value, int) and type_ in (INT, FLOAT):
            return f"{name} is too large; {type_} expected"
        return f"{name} is {type(value).__name__}; {type_} expected"
    if len(value) != len(type_.parts):
        return f"{name}: {len(value)} parts; {len(type_.parts)} expected"
    for part, inner, key in zip(value, type_.parts, type_.names, strict=True):
        if by_python(TupleType(tuple, (inner,)), (part,)) is None:
            return mismatch(inner, part, f"{name}.{key}")
    return f"{name} cannot be taken"


def _plan(type_: Type) -> list[int]:
    """The steps of the walk over a value of that type."""
    if isinstance(type_, TupleType):
        inner = [step for part in type_.parts for step in _plan(part)]
        return [_TUPLE, id(tuple), len(type_.parts), *inner]
    if isinstance(type_, ArrayType):
        return [_ARRAY, id(np.ndarray), np.dtype(type_.entries).num, type_.axes]
    if isinstance(type_, FunctionType):
        return [_FUNCTION, id(type_.kind)]
    return [{FLOAT: _REAL, BOOL: _TRUTH, INT: _WHOLE}[type_]]


@cache
def _walk() -> Callable[..., int] | None:
    """The walk in memory; None where objects are not laid out as it expects them."""
    if sys.implementation.name != "cpython" or sysconfig.get_config_var("Py_GIL_DISABLED"):
        return None
    head = object.__basicsize__
    text = _WALK.format(
        class_at=head - 8,
        head=head,
        parts_at=head + 8,
        axes_at=head + 8,
        shape_at=head + 16,
        descr_at=head + 40,
        flags_at=head + 48,
        order_at=head + 10,
        num_at=head + 12,
        flags=_FLAGS,
        foreign=ord(">" if sys.byteorder == "little" else "<"),
    )
    (address,) = addresses(text, ["walk"])
    pointer = ctypes.c_void_p
    return ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.py_object, pointer, pointer)(address)
