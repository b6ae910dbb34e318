"""Arrays: entries, rows, slices, shapes, loops, kinds of entries, constants, aliases."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest

from stickslip.arrays import (
    AnyArray,
    Array3,
    Array4,
    BoolVector,
    ByteMatrix,
    ComplexVector,
    IntVector,
    Many,
    Matrix,
    Vector,
)
from stickslip.machine_code.functions import Entry, entry_point
from stickslip.translator import compiled

from .judging import LENGTHS, bits, differences, disagreements, entries_of

TABLE = np.array([[0.5, -2.0, 3.0], [1e-3, 0.0, -0.0]])
COLUMNS = np.arange(6.0).reshape(2, 3).T
SIGNS = np.array([1, -1, 127], np.int8)
TURNS = np.array([1j, 0.5 - 2j])
FLAGS, NONE_AT_ALL, ALONE = np.array([True, False]), np.zeros((2, 0)), np.array(2.5)


class Lane(NamedTuple):
    """What each motion of many has."""

    x: Vector
    n: int


@entry_point()
def entries(i: int, v: Vector, m: Matrix, a: Array3, b: Array4) -> float:
    i %= 2
    b[i, 1, 0, 2] = v[i] + m[i, -1]
    b[-1][i][1 - i][-2] = a[i, 1 + i, 1] - a[-1, i, -2]
    return b[i][1, 0][2] + b[2, i, 1 - i, 3] + m[1][i]


@entry_point()
def rows(i: int, m: Matrix, a: Array3, b: Array4) -> float:
    i %= 3
    r, s, t = m[i], a[i, 1], b[i][2]
    r[1] += 1.0
    s[0], t[1, 2] = t[1, 2], s[0]
    t[0][3] = len(r) + 10 * len(b[0, 1]) + t.shape[1]
    row = a[-1][i % 2]
    row[i % 2] *= 2.0
    return r[-1] + m[i, 1] + a[i, 1, 0] + t[0, 3] + row[0]


@compiled()
def described(x: Any) -> Any:
    """Length, sum and a mixture of the entries."""
    total, mixed = 0.0, 1.0
    for k in range(len(x)):
        total += x[k]
        mixed = 0.5 * mixed + x[k]
    return len(x) + 100.0 * total + mixed


@entry_point()
def slices(i: int, j: int, v: Vector) -> float:
    i, j = abs(i), abs(j)
    found = described(v[i:j]) + described(v[i:]) + described(v[:j]) + described(v[:])
    found += described(v[-2:]) + described(v[:-1]) + described(v[-9:9]) + described(v[2:1])
    found += described(v[1:-1]) + described(v[i:-1]) + described(v[-3:j]) + described(v[0:0])
    found += described(v[5:9]) + described(v[1:][i:j]) + described(v[:2][-1:]) + described(v[3:])
    return found + len(v[: i - j if i > j else 0])


@entry_point()
def slices_of_rows(i: int, j: int, m: Matrix, a: Array3) -> float:
    i, j = abs(i), abs(j)
    total = described(m[1, i:j]) + described(m[-1, 1:]) + described(a[1, 2, :1]) + described(m[0][i:])
    inner = m[i:j]
    for row in inner:
        total = 0.5 * total + described(row)
    blocks = a[1, i:]
    for k in range(len(blocks)):
        total += blocks[k, 1] + described(blocks[k])
    part = a[1:,]
    part[0, 1, 0] = 3.5
    return total + inner.shape[0] + 10 * inner.shape[1] + a[1, 1, 0] + len(a[:]) + part.shape[1]


@entry_point()
def loops(v: Vector, m: Matrix, a: Array3, k: IntVector, w: BoolVector) -> float:
    total = 0.0
    for x in v:
        total = 0.5 * total + x
        v[-1] += 1.0
    for row in m:
        row[0] = total
        for x in row:
            total = 0.5 * total + x
        if row[1] > 0.0:
            continue
    for block in a[1:]:
        for row in block:
            if row[0] > 1.0:
                break
            total += row[1]
    for n in k:
        total += n
    for flag in w:
        total += 2.0 if flag else -1.0
    for x in v[3:]:
        total += 1e9 * x
    for x in v:
        v = v[1:]
        total += x
    return total + len(v)


@entry_point()
def augmented(i: int, v: Vector, m: Matrix, k: IntVector, c: ComplexVector) -> float:
    i %= 3
    v[i] += 2
    v[i] *= v[(i + 1) % 3]
    m[i, 1] -= 0.5
    m[i][2] /= 3.0
    k[i] += 5
    k[i] //= 3
    k[i] <<= 2
    k[-1] -= k[0]
    c[i] *= 2j
    c[i] += v[i]
    v[0] = v[1] = v[2] - 1.0
    v[i], m[1, i], i = m[1, i], v[i], 2
    return v[i]


@entry_point()
def kinds(
    x: float, n: int, f: Vector, k: IntVector, w: BoolVector, c: ComplexVector, b: ByteMatrix
) -> float:
    f[0] = n
    f[1] = n > 0
    k[0] = 2.75 if n > 0 else -2.75
    k[1] = n < 0
    k[1] += 1.5
    w[0] = not w[1]
    w[2] = x > 0.0 or w[0]
    c[0] = n
    c[1] = f[2]
    c[2] = c[1] * complex(1.0, n)
    b[0, 0] = n
    b[1, 2] = -128
    b[1, 0] += b[0, 0] // 3
    total = c[2].imag + b[1, 2] * 2 + (k[0] if w[0] else 7)
    return total + abs(c[1]) + (b[0, 0] << 3) + w[2] + f[1]


@entry_point()
def short_whole_numbers(
    i: int, a: Annotated[AnyArray, "i2:1"], b: Annotated[AnyArray, "i4:1"]
) -> int:
    a[0], b[0] = -5 * i, a[1] * 3000
    b[1] = b[0] - a[0]
    return a[0] + b[1] * 70_000 + a[2]


@entry_point()
def constants(i: int) -> float:
    i %= 2
    total = TABLE[i, 1] + COLUMNS[1, i] + SIGNS[i] + SIGNS[2] + TURNS[i].imag + len(TABLE)
    for row in TABLE:
        total += described(row) + described(row[i:])
    total += TABLE.shape[1] + NONE_AT_ALL.shape[0] + described(NONE_AT_ALL[1]) + ALONE[()]
    return total + (3.0 if FLAGS[i] else 5.0) + described(TABLE[-1][1:]) + described(SIGNS[:i])


@entry_point()
def chosen(n: int, v: Vector, m: Matrix) -> float:
    x = v if n > 0 else m[1]
    y = m[n % 3] if len(x) == 3 else x[1:]
    y[0] = 4.0
    if n > 2:
        x = y
    while len(x) > 2:
        x = x[1:]
        x[0] += 1.0
    return x[0] + v[0] + m[1, 1] + y[0]


@compiled()
def first_of_first(lanes: Any, i: Any) -> Any:
    lane = Lane(lanes.x[i], lanes.n)
    lane.x[0] += lane.n
    return lane


@entry_point()
def of_many(i: int, lanes: Many[Lane], both: tuple[Lane, Matrix]) -> float:
    lane = first_of_first(lanes, i % 3)
    both[0].x[1] = both[1][0, 1]
    return lane.x[0] + lanes.x[i % 3, 1] + both[0].n + len(both[0].x)


@pytest.mark.parametrize("entry", entries_of(globals()), ids=lambda entry: entry.__name__)
def test_arrays_are_those_of_numpy(entry: Entry) -> None:
    assert not disagreements(entry)[:3]


@entry_point()
def written_through_another(n: int, v: Vector, w: Vector, m: Matrix) -> float:
    total = 0.0
    for k in range(len(v)):
        v[k] = k + n
        w[(k + 1) % len(w)] += 0.5
        total = 2.0 * total + v[k] + m[0, k] + w[k % len(w)]
        m[0, k] = -1.0
    return total


def test_one_array_may_be_given_twice() -> None:
    """What is written through one is read through the other."""

    def arrays() -> tuple[Any, Any]:
        return np.arange(3.0), np.arange(12.0).reshape(3, 4)

    for given in (
        lambda x, m: (x, x),
        lambda x, m: (m[0], x),
        lambda x, m: (m[0], m[0]),
        lambda x, m: (m[0], m[0, 1:]),
        lambda x, m: (m[0, 1:], m[0]),
    ):
        here, there = arrays(), arrays()
        found = written_through_another(2, *given(*here), here[1])
        wanted = written_through_another.python(2, *given(*there), there[1])
        assert (found, *map(bits, here)) == (wanted, *map(bits, there))


@entry_point()
def of_any_length(v: Vector, m: Matrix) -> float:
    total = described(v) + described(v[1:]) + described(v[:-1]) + described(v[-2:3])
    for row in m:
        total += len(row)
        for x in row:
            total += x
    for x in v:
        total = 3.0 * total - x
    return total + m.shape[0] + 7 * m.shape[1] + len(m[1:]) + len(m)


@pytest.mark.parametrize("shape", [(0, 0, 0), (0, 2, 0), (1, 0, 3), (2, 1, 1), (3, 3, 2)])
def test_arrays_may_be_empty(shape: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(1)
    given = rng.normal(size=shape[0]), rng.normal(size=shape[1:])
    assert not differences(of_any_length, of_any_length.python, given)


def test_whole_numbers_are_cut_to_the_size_of_an_entry() -> None:
    a, b = np.array([0, 30_000, 7], np.int16), np.zeros(2, np.int32)
    short_whole_numbers(20_000, a, b)
    assert a[0] == -100_000 + 2 * 65_536
    assert b[0] == 90_000_000
    assert LENGTHS == (3, 4, 2, 5)  # on which the entries above rely
