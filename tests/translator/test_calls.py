"""Calls: names of arguments, conversions, specialisations, modules, functions by their address."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from stickslip.arrays import BoolVector, IntVector, Matrix, Vector
from stickslip.machine_code.functions import Entry, entry_point
from stickslip.machine_code.interface import SystemFunction
from stickslip.machine_code.shelf import Library, entries_of as entries_of_library
from stickslip.translator import RELAXED, FunctionAddress, call_address, compiled
from stickslip.translator.modules import Program

from .judging import disagreements, entries_of, module_of


class Pair(NamedTuple):
    a: float
    b: int


@compiled()
def weighted(x: Any, y: Any, z: Any) -> Any:
    return x + 10 * y + 100 * z


@entry_point()
def names_of_arguments(n: int, x: float) -> float:
    p = Pair(b=n, a=x)
    q = Pair(x, b=n + 1)
    return weighted(x, z=n, y=2) + weighted(z=x, y=n, x=1) + p.a - q.b + weighted(p.b, y=1, z=2)


@compiled()
def halved(x: float) -> Any:
    return x // 2 + 0.25


@compiled()
def whole_half(n: Any) -> Any:
    return n // 2


@compiled()
def promised(n: Any) -> float:
    if n > 1:
        return n
    return n > 0


@compiled()
def promised_complex(x: Any) -> complex:
    if x > 2.0:
        return x
    if x > 0.0:
        return x * 1j
    return 3


@compiled()
def whole_truth(x: bool, n: int) -> int:
    return x if n > 0 else n


@entry_point()
def conversions(n: int, x: float) -> float:
    z = promised_complex(x)
    return (
        halved(n) + whole_half(n) * 3 + whole_half(x) * 7 + promised(n) / 2 + whole_truth(n > 1, True)
        + promised(n > 2) + z.real + z.imag + promised_complex(n).imag
    )


@compiled()
def length(x: Any) -> Any:
    return len(x)


@compiled()
def first(x: Any) -> Any:
    return x[0]


@entry_point()
def kinds_of_arrays(v: Vector, m: Matrix, k: IntVector, w: BoolVector, n: int) -> float:
    """One function for arrays of several kinds, numbers and tuples."""
    row = first(m)
    pair = first((v, n))
    total = first(v) + first(row) + first(k) // 2 + first(pair) + first((n, v)) + first(((x_of(n), n),))[0]
    return total + length(m) + length(k) + length((n, n)) + (1.0 if first(w) else 2.0) + length(m[0])


@compiled(inline=True)
def x_of(n: Any) -> Any:
    return n / 4


@compiled(relaxed=RELAXED)
def dot(x: Any, y: Any) -> Any:
    total = 0.0
    for i in range(len(x)):
        total += x[i] * y[i]
    return total


@entry_point(relaxed=RELAXED)
def relaxed(x: Vector, y: Vector) -> float:
    return dot(x, y) + dot(y, y)


def test_relaxed_sums_differ_by_rounding() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(2, 1001))
    assert math.isclose(relaxed(x, y), math.fsum(x * y) + math.fsum(y * y), rel_tol=1e-13)
    y[500] = math.inf
    assert relaxed(x, y) == math.inf or math.isnan(relaxed(x, y))


@compiled()
def 平方(ω: Any) -> Any:
    return ω * ω


@compiled()
def odd_names(out: Any, entry: Any, v1: Any, words: Any, then3: Any) -> Any:
    """Names that the assembly has, too; the result is large."""
    return (out + 平方(entry), v1, words, then3, out, out + 1)


@entry_point()
def any_names(n: int, out: float, i32: float) -> float:
    a, b, c, d, e, f = odd_names(out, i32, n, n + 1, n + 2)
    return a + b + 2 * c + 4 * d + 8 * e + 16 * f


TESTED = [x for x in entries_of(globals()) if x is not relaxed]


@pytest.mark.parametrize("entry", TESTED, ids=lambda entry: entry.__name__)
def test_calls_are_those_of_python(entry: Entry) -> None:
    assert not disagreements(entry)[:3]


INNER = """
SCALE = {scale}

@compiled()
def scaled(x):
    return SCALE * x

@compiled()
def row_sum(x):
    total = 0.0
    for k in range(len(x)):
        total = {scale} * total + scaled(x[k])
        if total > 1e6:
            total = -total
        elif total < -1e6:
            total -= 1.0
        else:
            total += math.sin(total)
        while total > 100.0:
            total = total / 2.0
    return total
"""
OUTER = """
import {one} as one
import {two}
from {two} import row_sum

@compiled()
def scaled(x):
    return 7.0 * x

@entry_point()
def together(x: Vector) -> float:
    return one.scaled(1.0) + {two}.scaled(10.0) + scaled(100.0) + one.SCALE * row_sum(x) - one.row_sum(x)
"""


def test_functions_of_one_name_in_several_modules(tmp_path: Path) -> None:
    one, two = (module_of(INNER.format(scale=scale), tmp_path) for scale in (2.0, 3.0))
    outer = module_of(OUTER.format(one=one.__name__, two=two.__name__), tmp_path)
    assert not disagreements(outer.together)
    library = Library(outer.__name__, (outer.__name__,))
    texts = Program(entries_of_library(library)).modules()
    assert len(texts) == 3
    # what is large is in its own module alone
    assert sum("define hidden" in line and "row_sum" in line for line in "\n".join(texts.values()).split("\n")) == 2


class Force(FunctionAddress):
    """A function outside."""

    @staticmethod
    def signature(x: float, n: int, yes: bool) -> float: ...


class Question(SystemFunction):
    """One that says yes or no, and is called from Python, too."""

    @staticmethod
    def signature(x: float, n: int) -> bool: ...


class Outside(NamedTuple):
    force: Force
    scale: float


@entry_point()
def forces(outside: Outside, other: Force, ask: Question, n: int) -> float:
    total = outside.force(1.5, n, n > 2) * outside.scale
    chosen = other if n > 2 else outside.force
    for k in range(n):
        total += chosen(total, k, not k > 0)
    return total + (100.0 if ask(total, n) else 0.0)


@entry_point()
def at_address(address: int, x: float) -> float:
    return 2.0 * call_address(address, x) + call_address(address, 3)


def address_of(function: Any) -> int:
    """Where a function of ctypes stands."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def test_functions_are_called_by_their_address() -> None:
    real, whole, bit = ctypes.c_double, ctypes.c_int64, ctypes.c_bool
    calls = list[tuple[float, int, bool]]()

    def note(x: float, n: int, yes: bool) -> float:
        calls.append((x, n, yes))
        return x + n

    one = ctypes.CFUNCTYPE(real, real, whole, bit)(note)
    two = ctypes.CFUNCTYPE(real, real, whole, bit)(lambda x, n, yes: x * n)
    ask = ctypes.CFUNCTYPE(bit, real, whole)(lambda x, n: x > n)
    asked = Question(address_of(ask))
    outside = Outside(Force(address_of(one)), 4.0)
    assert forces(outside, Force(address_of(two)), asked, 2) == 157.0
    assert calls == [(1.5, 2, False), (14.0, 0, True), (28.0, 1, False)]
    assert forces(outside, Force(address_of(two)), asked, 3) == 208.0
    assert forces(outside, Force(address_of(two)), asked, -1) == 2.0 + 100.0
    assert asked(3.0, 2) is True
    assert asked(1.0, 2) is False
    with pytest.raises(TypeError, match=r"Question: arguments\.n is float; int expected"):
        asked(1.0, 2.5)
    with pytest.raises(TypeError, match="Force is called by compiled functions alone"):
        outside.force(1.0, 2, True)


def test_a_function_of_one_number_is_called_by_its_address() -> None:
    square = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(lambda x: x * x)
    assert at_address(address_of(square), 1.5) == 13.5
    assert at_address.python(address_of(square), 1.5) == 13.5
