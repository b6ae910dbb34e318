"""Functions of other modules, functions by their address, sums that may be reordered, and what is
seen through two arrays that are one."""

from __future__ import annotations

import ctypes
import math
import random
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from stickslip.arrays import IntVector, Many, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.machine_code.interface import SystemFunction
from stickslip.translator import RELAXED, FunctionAddress, call_address, compiled, modules
from stickslip.translator.modules import Program

from .judging import bits, differences, module_of

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
        if total > 1e6: total = -total
        elif total < -1e6: total -= 1.0
        else: total += math.sin(total)
        while total > 100.0: total = total / 2.0
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
def both(x: Vector) -> float:
    total = one.scaled(1.0) + {two}.scaled(10.0) + scaled(100.0)
    return total + one.SCALE * row_sum(x) - one.row_sum(x)
"""


def test_functions_of_one_name_in_several_modules(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is large is in its own module alone, what is small in others, too."""
    monkeypatch.setattr(modules, "_FEW", 40)
    one, two = (module_of(INNER.format(scale=scale), tmp_path) for scale in (2.0, 3.0))
    entry = module_of(OUTER.format(one=one.__name__, two=two.__name__), tmp_path).both
    for seed in range(20):
        given = (np.random.default_rng(seed).normal(size=9),)
        assert not differences(entry, entry.python, given)
    texts = list(Program([entry]).modules().values())
    assert len(texts) == 3
    heads = [line for text in texts for line in text.splitlines() if line.startswith("define ")]
    assert sum("row_sum" in line for line in heads) == 2
    assert sum(".scaled" in line for line in heads) > 3


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
    asked, other = Question(address_of(ask)), Force(address_of(two))
    outside = Outside(Force(address_of(one)), 4.0)
    assert forces(outside, other, asked, 2) == 157.0
    assert calls == [(1.5, 2, False), (14.0, 0, True), (28.0, 1, False)]
    assert forces(outside, other, asked, 3) == 208.0
    assert forces(outside, other, asked, 9) == 42.0 * math.factorial(9) + 100.0
    assert asked(3.0, 2) is True
    assert asked(1.0, 2) is False
    with pytest.raises(TypeError, match=r"Question: arguments\.n is float; int expected"):
        asked(1.0, 2.5)
    with pytest.raises(TypeError, match="Force is called by compiled functions alone"):
        outside.force(1.0, 2, True)
    square = ctypes.CFUNCTYPE(real, real)(lambda x: x * x)
    for function in (at_address, at_address.python):
        assert function(address_of(square), 1.5) == 13.5


@compiled(relaxed=RELAXED)
def dot(x: Any, y: Any) -> Any:
    total = 0.0
    for i in range(len(x)):
        total += x[i] * y[i]
    return total


@entry_point(relaxed=RELAXED)
def relaxed(x: Vector, y: Vector) -> float:
    return dot(x, y) + dot(y, y)


def test_sums_that_may_be_reordered_differ_by_rounding() -> None:
    x, y = np.random.default_rng(1).normal(size=(2, 1001))
    assert math.isclose(relaxed(x, y), math.fsum(x * y) + math.fsum(y * y), rel_tol=1e-13)
    y[500] = math.inf
    assert not math.isfinite(relaxed(x, y))


class Lane(NamedTuple):
    """What each motion of many has."""

    x: Vector
    n: int


@entry_point()
def written(n: int, v: Vector, w: Vector, m: Matrix, lanes: Many[Lane]) -> float:
    total = 0.0
    row = lanes.x[n % len(lanes.x)]
    for k in range(len(v)):
        v[k] = k + n
        w[(k + 1) % len(w)] += 0.5
        total = 2.0 * total + v[k] + m[0, k] + w[k % len(w)] + row[k]
        m[0, k] = -1.0
        row[k] += lanes.n
    for row in lanes.x[1:]:
        total += len(row) + row[0]
    for k in range(len(v[1:-1])):
        total = 3.0 * total - v[1:-1][k]
    return total


def test_one_array_may_be_given_twice() -> None:
    """What is written through one is read through the other; also where they are empty."""
    rng = random.Random(1)

    def arrays(n: int) -> tuple[Any, Any]:
        return np.arange(float(n)), np.arange(4.0 * n).reshape(4, n)

    for given in (
        lambda x, m: (x, x, m),
        lambda x, m: (m[0], x, m),
        lambda x, m: (m[0], m[0], m[1:]),
        lambda x, m: (m[0], m[0, 1:], m),
        lambda x, m: (m[0, 1:], m[0], m),
        lambda x, m: (x[:0], m[0], m[:2, :]),
        lambda x, m: (m[1], m[2], m[1:]),
    ):
        for n in (1, 3, 4):
            k = rng.randrange(4)
            here, there = arrays(n), arrays(n)
            if len(given(*here)[1]) == 0:
                continue
            found = written(k, *given(*here), Lane(here[1], 2))
            wanted = written.python(k, *given(*there), Lane(there[1], 2))
            assert (found, *map(bits, here)) == (wanted, *map(bits, there))


@entry_point()
def stored(x: float, k: IntVector) -> int:
    k[0] = x
    return k[0]


def test_real_numbers_in_whole_entries() -> None:
    """They lose what is behind the point; what is too large becomes the nearest there is."""
    wanted = {2.9: 2, -2.9: -2, 1e300: 2**63 - 1, -math.inf: -(2**63), math.nan: 0}
    assert {x: stored(x, np.zeros(1, np.int64)) for x in wanted} == wanted
