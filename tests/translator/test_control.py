"""Control: branches, loops and how they are left, what is not looked at."""

from __future__ import annotations

from typing import Any

import pytest

from stickslip.arrays import IntVector, Vector
from stickslip.machine_code.functions import Entry, entry_point
from stickslip.translator import compiled

from .judging import disagreements, entries_of


@entry_point()
def branches(n: int, x: float) -> float:
    if n > 2:
        y = x
    elif n > 0 and x > 0.0:
        y = -x
    elif n:
        if not x:
            return 3.0
        y = x + n
    else:
        return -1.0
    if x:
        pass
    else:
        y += 1.0
    return y


@entry_point()
def early(n: int) -> int:
    for i in range(9):
        if i > n:
            return i
        while True:
            if n < 0:
                return -7
            break
    return 100


@entry_point()
def nested_loops(n: int, m: int) -> int:
    total = 0
    i = 0
    while i < n + 4:
        i += 1
        if i == m:
            continue
        for j in range(m, n + 3):
            if j == 2:
                continue
            k = j
            while True:
                k -= 1
                total = total * 3 + k
                total %= 1_000_003
                if k < 0:
                    break
                if k == i:
                    total += 5
                    continue
                if k == 3:
                    break
            if j > i:
                break
            total += j
        if total % 11 == 7:
            break
        total += 1
    return total


@entry_point()
def ranges(a: int, b: int, v: IntVector) -> int:
    total = 0
    for i in range(a):
        total = total * 3 + i
    for i in range(a, b):
        total = total * 3 + i
    for i in range(a, b + 9, 4):
        total = total * 3 + i
    for i in range(b, a, -1):
        total = total * 3 + i
    for i in range(b + 9, a, -3):
        total = total * 3 + i
    for i in range(5, 1):
        total += 1000 * i
    for i in range(True):
        total += 17 + i
    for _ in range(len(v)):
        total += v[_]
    for v[0] in range(3):
        total += v[0] * v[1]
    return total % 1_000_003


@entry_point()
def variables_of_loops(a: int, b: int) -> int:
    """A loop counts by itself: what is assigned to its variable, or to its ends, does not matter."""
    i, total = -5, 0
    for i in range(a):
        total += i
        i = i * 7
        a -= 1
        total += i
    for i in range(b, 3):
        if i == 1:
            break
    for j in range(2):
        for j in range(3):
            total += j
        total += 10 * j
    stop = 4
    for k in range(stop):
        stop = 2
        total += k * stop
    return total * 10 + i


@entry_point()
def assigned_on_every_way(n: int, x: float) -> float:
    while True:
        n += 1
        if n > 3:
            y = x
            break
        if n < -2:
            y = 2 * x
            break
    for z in (1.0, x):
        if n > 4:
            a = z
            continue
        elif z > 0.0:
            a = -z
        else:
            return y
        a += 1.0
    if n == 5:
        return a
    elif x > 0.0:
        b = 1
    else:
        while n != 0:
            n -= 1
        b = n
    return a + y + b


@compiled()
def noted(v: Any, k: Any, yes: Any) -> Any:
    """Notes that it was called."""
    v[k] = 2.0 * v[k] + 1.0
    return yes


@entry_point()
def what_is_not_looked_at(n: int, m: int, v: Vector) -> float:
    a, b = n > 0, m > 0
    total = 0.0
    if noted(v, 0, a) and noted(v, 1, b) or noted(v, 2, n > m):
        total += 1.0
    if not (noted(v, 0, b) or not noted(v, 1, a)):
        total += 2.0
    c = noted(v, 0, a) or noted(v, 1, b) and noted(v, 2, a)
    d = a and (noted(v, 0, b) or b)
    total += 4.0 if c and not noted(v, 0, d) else noted(v, 1, n)
    k = 0
    while k < 3 and noted(v, k, v[k] < 5.0):
        k += 1
    e = (noted(v, 0, a) and b) == (c or noted(v, 2, d))
    return total + 8.0 * c + 16.0 * d + 32.0 * e + k


@entry_point()
def truth_of_numbers(n: int, x: float) -> float:
    total = 0.0
    if n and x:
        total += 1.0
    if n or x:
        total += 2.0
    if not n and not x or n == 3:
        total += 4.0
    while n:
        n = n // 2 if n > 0 else n + 1
        total += 0.25
    return total + (1.0 if x else 0.5)


@entry_point()
def members(n: int, x: float) -> int:
    total = 0
    if n in (1, -2, 3):
        total += 1
    if n not in (x, 0, 2.0):
        total += 2
    if x in (n, 1.0) and n not in (5,):
        total += 4
    return total + 8 * ((n > 0) in (x > 0.0, False))


@entry_point()
def nothing_after_a_return(n: int) -> int:
    if n > 0:
        return n
        n = 5
    while True:
        n -= 1
        if n < -8:
            return n
            break
        continue
        n += 100
    return 3


@entry_point()
def nothing_at_all(v: Vector) -> None:
    if v[0] > 1.0:
        return
    elif v[0] > 0.0:
        v[1] = 3.0
        return None
    v[1] += 1.0


@pytest.mark.parametrize("entry", entries_of(globals()), ids=lambda entry: entry.__name__)
def test_control_is_that_of_python(entry: Entry) -> None:
    assert not disagreements(entry, times=150)[:3]
