"""The arguments of a compiled function as two tables: of addresses, lengths and whole numbers, and
of real numbers.

The engine takes tuples of hundreds of arrays. To look at them one by one in Python would take
longer than a short motion: a walk of our own does it in a microsecond, by what Python and NumPy
promise to extensions about the layout of their objects. In a Python that promises nothing, Python
does it.
"""

from __future__ import annotations

import ctypes
import math
import operator
import struct
import sys
import sysconfig
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from stickslip.machine_code import kinds
from stickslip.machine_code.kinds import ArgumentKind
from stickslip.machine_code.objects import addresses, cache_folder

# What a step of the walk is. Its code stands first; then for an array its class, the number of its
# type, the number of its axes; for a tuple its class and how many parts it has.
_REAL, _WHOLE, _TRUTH, _TUPLE, _ARRAY = range(5)
_FLAGS = 0x501  # of an array: in C order, aligned, may be written to
_RESULTS: dict[str, Any] = {
    "None": None,
    "int": ctypes.c_int64,
    "float": ctypes.c_double,
    "bool": ctypes.c_bool,
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

define internal i32 @take(ptr %value, ptr %plan, ptr %wholes, ptr %reals) {{
begin:
  %code = call i64 @next(ptr %plan)
  switch i64 %code, label %wrong
    [i64 0, label %real i64 1, label %whole i64 2, label %truth
     i64 3, label %tuple i64 4, label %array]
wrong:
  ret i32 1
real:
  %x = call double @PyFloat_AsDouble(ptr %value)
  %bits = bitcast double %x to i64
  call void @put(ptr %reals, i64 %bits)
  %doubtful = fcmp oeq double %x, -1.0
  br i1 %doubtful, label %asked, label %right
whole:
  %n = call i64 @PyLong_AsLongLong(ptr %value)
  call void @put(ptr %wholes, i64 %n)
  %uncertain = icmp eq i64 %n, -1
  br i1 %uncertain, label %asked, label %right
truth:
  %b = call i32 @PyObject_IsTrue(ptr %value)
  %yes = zext i32 %b to i64
  call void @put(ptr %wholes, i64 %yes)
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
  %done = call i32 @take(ptr %part, ptr %plan, ptr %wholes, ptr %reals)
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
  call void @put(ptr %wholes, i64 %address)
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
  call void @put(ptr %wholes, i64 %l)
  %j1 = add i64 %j, 1
  br label %lengths
}}

define i32 @walk(ptr %value, ptr %plan, ptr %wholes, ptr %reals) {{
  %p = alloca ptr
  %w = alloca ptr
  %r = alloca ptr
  store ptr %plan, ptr %p
  store ptr %wholes, ptr %w
  store ptr %reals, ptr %r
  %done = call i32 @take(ptr %value, ptr %p, ptr %w, ptr %r)
  ret i32 %done
}}
"""


class Prepared:
    """A compiled function in memory, for one kind of arguments.

    Parameters
    ----------
    kind : ArgumentKind
        Of the tuple of all arguments.
    address : int
        Of the function of two tables.
    result : str
        What it returns: ``None``, ``int``, ``float`` or ``bool``.
    """

    def __init__(self, kind: ArgumentKind, address: int, result: str) -> None:
        wholes, reals = kinds.sizes(kind)
        self.kind = kind
        self.run = ctypes.CFUNCTYPE(_RESULTS[result], ctypes.c_void_p, ctypes.c_void_p)(address)
        self._plan = np.array(_plan(kind), np.int64)
        self._address = self._plan.ctypes.data
        self._wholes, self._reals = ctypes.c_int64 * max(wholes, 1), ctypes.c_double * max(reals, 1)

    def tables(self, arguments: tuple[Any, ...]) -> tuple[Any, Any] | None:
        """The tables of these arguments; None if they are of another kind."""
        wholes, reals = self._wholes(), self._reals()
        walk = _walk()
        if walk is None:
            return by_python(self.kind, arguments)
        try:
            wrong = walk(arguments, self._address, wholes, reals)
        except (TypeError, OverflowError):
            return None
        return None if wrong else (wholes, reals)


def by_python(kind: ArgumentKind, arguments: tuple[Any, ...]) -> tuple[Any, Any] | None:
    """The same tables, made by Python."""
    wholes, reals = list[int](), list[float]()

    def take(value: Any, kind: ArgumentKind) -> None:
        if not isinstance(kind, str):
            parts = value if isinstance(value, tuple) else ()
            for part, inner in zip(parts, kind[1:], strict=True):
                take(part, inner)
        elif ":" in kind:
            if kinds.argument_kind(value) != kind:
                raise TypeError
            if not (value.flags.carray and value.dtype.isnative):
                raise ValueError
            wholes.extend([value.ctypes.data, *value.shape])
        elif kind == kinds.REAL_NUMBER:
            reals.append(math.fsum([value]))  # takes whatever is a number, no text
        else:
            whole = int(bool(value)) if kind == kinds.TRUTH else operator.index(value)
            struct.pack("q", whole)  # has to fit
            wholes.append(whole)

    try:
        take(arguments, kind)
    except (TypeError, ValueError, OverflowError, struct.error):
        return None
    return (
        (ctypes.c_int64 * max(len(wholes), 1))(*wholes),
        (ctypes.c_double * max(len(reals), 1))(*reals),
    )


def _plan(kind: ArgumentKind) -> list[int]:
    """The steps of the walk over a value of that kind."""
    if not isinstance(kind, str):
        return [
            _TUPLE,
            id(tuple),
            len(kind) - 1,
            *(step for part in kind[1:] for step in _plan(part)),
        ]
    if ":" in kind:
        return [_ARRAY, id(np.ndarray), kinds.dtype(kind).num, kinds.axis_count(kind)]
    return [{kinds.REAL_NUMBER: _REAL, kinds.TRUTH: _TRUTH}.get(kind, _WHOLE)]


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
    (address,) = addresses(text, ["walk"], cache_folder())
    pointer = ctypes.c_void_p
    return ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.py_object, pointer, pointer, pointer)(address)
