"""A row of a tuple of arrays; what threads of a GPU run, and functions called by their names."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from stickslip.arrays import IntVector, Many, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.translator import FunctionAddress, compiled, row_of
from stickslip.translator.modules import Program
from stickslip.translator.values import Refusal


class Point(NamedTuple):
    """Some numbers and arrays."""

    x: Vector
    flags: IntVector
    weight: float


class Body(NamedTuple):
    """A tuple inside a tuple."""

    point: Point
    pair: tuple[Matrix, Vector]


@compiled()
def added(body: Body) -> float:
    total = body.point.weight * body.point.x[1] + body.point.flags[0]
    return float(total + body.pair[0][1, 0] + body.pair[1][-1])


@entry_point()
def sum_of_row(bodies: Many[Body], i: int) -> float:
    return added(row_of(bodies, i))


@entry_point()
def sum_of_numbers(pair: tuple[Vector, IntVector], i: int) -> float:
    row = row_of(pair, i)
    return float(row[0] + 10.0 * row[1] + row_of(pair[0], 0))


@entry_point()
def mark_row(points: Many[Point], i: int) -> None:
    row = row_of(points, i)
    row.x[0] = row.weight
    row.flags[1] += 1


def bodies() -> Body:
    rng = np.random.default_rng(0)
    point = Point(rng.normal(size=(3, 2)), rng.integers(9, size=(3, 4)), 0.5)
    return Body(point, (rng.normal(size=(3, 2, 2)), rng.normal(size=(3, 5))))


def test_a_row_is_that_of_python() -> None:
    given = bodies()
    for i in range(3):
        assert sum_of_row(given, i) == sum_of_row.python(given, i)
    pair = np.array([1.0, 2.0]), np.array([3, 4])
    assert sum_of_numbers(pair, 1) == sum_of_numbers.python(pair, 1) == 43.0


def test_a_row_is_no_copy() -> None:
    compiled_, plain = bodies().point, bodies().point
    mark_row(compiled_, 2)
    mark_row.python(plain, 2)
    assert compiled_.x[2, 0] == 0.5
    for got, wanted in zip(compiled_, plain, strict=True):
        np.testing.assert_array_equal(got, wanted)


class Law(FunctionAddress):
    """A function outside."""

    @staticmethod
    def signature(x: float, row: Vector) -> float: ...


@entry_point()
def apply_law(law: Law, row: Vector, out: Vector, i: int) -> None:
    out[i] = law(row[i], row)


def test_a_function_is_called_by_its_name() -> None:
    assert "call double @law(double" in Program([apply_law], direct={Law: "law"}).whole()
    assert "@law(" not in Program([apply_law]).whole()


def test_a_thread_knows_its_number() -> None:
    text = Program((), threads=[apply_law]).whole()
    head = text[text.index('ptx_kernel void @"apply_law"(ptr') :]
    assert "icmp slt i64" in head and "%count" in head and "tid.x" in head


@entry_point()
def no_thread(row: Vector) -> None:
    row[0] = 1.0


def test_a_thread_needs_its_number() -> None:
    with pytest.raises(Refusal, match="no_thread: what a thread runs takes its number last"):
        Program((), threads=[no_thread])
