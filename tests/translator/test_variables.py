"""Variables: types that join, exchanges, tuples that are kept, passed on and returned."""

from __future__ import annotations

from typing import Any, NamedTuple

import pytest

from stickslip.arrays import Matrix, Vector
from stickslip.machine_code.functions import Entry, entry_point
from stickslip.translator import compiled

from .judging import disagreements, entries_of


class Pair(NamedTuple):
    """A small tuple, which is returned in registers."""

    a: float
    n: int


class Wide(NamedTuple):
    """One that is returned in memory."""

    first: Pair
    second: Pair
    row: Vector
    yes: bool


@entry_point()
def whole_or_real(n: int, x: float) -> float:
    a = 1
    if n > 0:
        a = x
    b = n if n < 2 else x
    return a + b / 2 + (3 if n == 1 else 0.5)


@entry_point()
def real_later(n: int, x: float) -> float:
    a, b, c = 0, 1, 2
    for _ in range(n + 5):
        a, b, c = b, c, a + 1
        if b == 3:
            b = x
    return a + 10 * b + 100 * c


@entry_point()
def chain_of_types(n: int, x: float) -> float:
    a = b = c = d = e = 0
    for _ in range(n + 6):
        a = b + 1
        b = c + 1
        c = d + 1
        d = e + 1
        e = x
    return a + b + c + d + e


@entry_point()
def truth_joins_numbers(n: int, x: float) -> float:
    a = n > 0
    if n > 2:
        a = n
    b = x > 0.0
    if n < 0:
        b = x
    return a + 2 * b


@entry_point()
def exchanges(x: float, y: float, v: Vector, w: Vector) -> float:
    for k in range(5):
        if v[k % 3] > w[0]:
            x, y = y, x
            v, w = w, v
            v[0], w[1] = w[1], v[0]
        x, y, z = y, x + k, x
        v[k % 3], v[(k + 1) % 3] = z, v[k % 3]
    return x - 3.0 * y


@entry_point()
def exchanged_tuples(n: int, p: Pair, q: Pair, x: float) -> float:
    r = (p, (x, q))
    for _ in range(n + 5):
        p, q = q, p
        p = Pair(p.a + 1.0, q.n)
        r = (r[1][1], (r[0].a, r[0]))
        r = r[0], (r[1][0], r[0])
        x, n = q
    return p.a + 10.0 * q.a + p.n + 3.0 * r[1][0] + x - n


@entry_point()
def parts_of_itself(n: int, x: float, y: float) -> float:
    t = (x, (y, n))
    for _ in range(3):
        t = (t[1][0], (t[0], t[1][1] + 1))
    u = (t, t)
    u = (u[1], (u[0][0], (u[0][0] - 1.0, n)))
    (a, (b, c)), d = u
    return a + 2.0 * b + c + d[1][0]


@compiled()
def following(p: Any, x: Any) -> Any:
    return Pair(p.a / 2 + x, p.n + 1)


@compiled()
def following_wide(p: Any, x: Any) -> Any:
    return Wide(p.second, following(p.first, x), p.row, not p.yes)


@entry_point()
def kept_from_the_round_before(n: int, p: Pair, w: Wide, x: float) -> float:
    before, wide_before = p, w
    total = 0.0
    for _ in range(n + 5):
        before = p
        p = following(p, x)
        wide_before = w
        w = following_wide(w, p.a)
        total += before.a - p.a + wide_before.first.a - 2.0 * w.first.a
        if w.yes:
            w = wide_before
    return total + before.n + wide_before.second.n


@entry_point()
def results_of_several_calls(w: Wide, x: float, y: float) -> float:
    a, b = following_wide(w, x), following_wide(w, y)
    c = following_wide(following_wide(a, y), x)
    d = (following_wide(b, 1.0), following(a.first, x), following(a.first, y))
    return a.second.a + 2.0 * b.second.a + 4.0 * c.first.a - d[0].second.a + d[1].a - d[2].n


@compiled()
def exchanged(p: Any, q: Any) -> Any:
    p, q = q, p
    p = Pair(p.a + q.a, q.n)
    return p, q


@compiled()
def reassigned(w: Any, n: Any) -> Any:
    if n > 0:
        w = Wide(w.second, w.first, w.row[1:], w.yes)
    while n > 0:
        n -= 1
        w = Wide(w.second, w.first, w.row, not w.yes)
    return w.first.a + len(w.row)


@entry_point()
def parameters_that_are_assigned_to(n: int, w: Wide, v: Vector) -> float:
    p, q = exchanged(w.first, w.second)
    return p.a + 3.0 * q.a + w.first.n + reassigned(w, n)


@entry_point()
def conditional_tuples(n: int, x: float, p: Pair, w: Wide) -> float:
    q = p if n > 0 else w.first
    r = (w if x > 0.0 else following_wide(w, x)).second
    s = (1, x) if n < 0 else (x, 2)
    return q.a + r.a + s[0] + s[1] + (w.row if n > 1 else w.row[1:])[0]


@entry_point()
def over_parts(n: int, x: float, w: Wide, v: Vector) -> float:
    total, last = 0.0, w.first
    for part in (w.first, w.second, following(w.first, x)):
        if part.n == n:
            continue
        last = part
        for y in (part.a, 2, True, x):
            if y > 3:
                break
            total += y
            x = total
        if part.n > n:
            break
    for row in (v, w.row, v[1:]):
        v = row
        total = total * 0.5 + row[0]
    return total + last.a + part.n + v[0]


@entry_point()
def parts_taken_before_the_first_round(x: float, p: Pair, q: Pair, v: Vector) -> float:
    t = (p, q, p)
    rows = (v, v[1:])
    total = 0.0
    for part in t:
        t = (q, Pair(x, 1), q)
        total = 2.0 * total + part.a
    for row in rows:
        rows = (v[2:], v[2:])
        total += row[0]
    return total + t[1].n + rows[0][0]


@entry_point()
def one_name_in_rounds(n: int, p: Pair, q: Pair, w: Wide) -> float:
    """A name that is assigned to in one place alone, in each round of a loop over a tuple."""
    for part in (p, q, w.first):
        found = part
        if part.n > n:
            break
    for both in ((p, q), (q, w.second)):
        if both[0].n > n:
            inner = both[1]
        else:
            inner = both[0]
    return found.a + 2.0 * part.a + 3.0 * inner.a


@entry_point()
def once(n: int, w: Wide) -> float:
    """Names that stand for parts of an argument."""
    first = w.first
    inner = first
    row = w.row
    if n > 0:
        other = w.second
    else:
        other = first
    w = Wide(other, inner, row, False)
    return first.a + 2.0 * other.a + inner.n + row[1] + 4.0 * w.first.a


@compiled()
def small(x: Any, n: Any) -> Any:
    return n > 0, (x, n), x * 1j


@compiled()
def large(x: Any, v: Any, m: Any) -> Any:
    return (v, (x, m), small(x, 1), v[1:], (True, 2, x))


@entry_point()
def returned(n: int, x: float, v: Vector, m: Matrix) -> float:
    yes, (a, k), z = small(x, n)
    rows, (b, c), inner, rest, (flag, two, _) = large(a, v, m[1])
    rest[0] = 7.0
    c[0] += 1.0
    return (a + k if yes else -b) + z.imag + inner[1][0] + rows[1] + two + flag + len(large(x, v, v)[3])


@entry_point()
def annotated(n: int, x: float) -> float:
    a: float = n
    b: int = 3
    a = a / 2
    b += n
    return a + b // 2 + x


@entry_point()
def constants(n: int) -> float:
    a, (b, c) = NESTED
    total = float(a)
    for part in NESTED[1]:
        total += part
    return total + b * c + PAIR.a + n * PAIR.n + BEFORE[-1][0]


NESTED = (1, (2.5, 3))
PAIR = Pair(0.25, 4)
BEFORE = ((1.0, 2), (3.5, 4))


@pytest.mark.parametrize("entry", entries_of(globals()), ids=lambda entry: entry.__name__)
def test_variables_are_those_of_python(entry: Entry) -> None:
    assert not disagreements(entry)[:3]
