"""What is not in the language is refused: where it stands, what it is, what to do instead."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from stickslip.translator.modules import Program
from stickslip.translator.values import Refusal

from .judging import module_of

# What is said, and the lines of an entry ``f(n: int, x: float, v: Vector, m: Matrix) -> float``.
# One of them ends in ``#``: that is where it stands.
BODIES = {
    "List is not in the language. Use a tuple, or an array": "y = [x, 1.0]  #",
    "ListComp is not in the language. Write a loop": "y = [a for a in v]  #",
    "GeneratorExp is not in the language. Write a loop": "return sum(a for a in v)  #",
    "Dict is not": "y = {1: x}  #",
    "Try is not in the language. Return a status": "try:  #\n    x = 1.0\nfinally:\n    x = 2.0",
    "Raise is not in the language. Return a status": "if n > 0:\n    raise ValueError  #",
    "Assert is not": "assert n > 0  #",
    "With is not": "with np.errstate():  #\n    x = 1.0",
    "Lambda is not in the language. Write a separate function": "y = lambda a: a  #",
    "FunctionDef is not in the language": "def g(a):  #\n    return a",
    "JoinedStr is not in the language. Return a number": "y = f'{x}'  #",
    "Starred is not": "return max(*v.shape)  #",
    "NamedExpr is not": "return x + (y := 2.0)  #",
    "Import is not": "import math  #",
    "Global is not": "global TABLE  #",
    "Delete is not": "del x  #",
    "Match is not": "match n:  #\n    case 1:\n        x = 2.0",
    "Invert is not": "return ~n + x  #",
    "UAdd is not": "w = +v  #",
    "'words' is not a value here": "y = 'words'  #",
    "Add of an array of 1 axes and an array of 1 axes. Write a loop": "w = v + v  #",
    "Mult of float and an array of 2 axes": "w = x * m  #",
    "MatMult of an array of 2 axes": "w = m @ v  #",
    "the negative of an array": "w = -v  #",
    "Lt of an array": "return 1.0 if v < x else 2.0  #",
    "Is of int and float": "return 1.0 if n is x else 2.0  #",
    "an array of 1 axes is neither true nor false. Write a comparison": "if v:  #\n    x = 1.0",
    "and, or of float as a value. Write comparisons": "y = x or 2.0  #",
    "a slice with a step. Write a loop": "w = v[::2]  #",
    "a slice that is not in the last place. Write a loop": "w = m[:, n]  #",
    "an index that is negative. Subtract it from the length": "return v[-n]  #",
    "float as an index. Use a whole number": "return v[x]  #",
    "2 indices of an array of 1 axes": "return v[n, n]  #",
    "an assignment to several entries. Write a loop": "m[0] = x  #",
    "an assignment to a part of a tuple": "y = (x, x)\ny[0] = 1.0  #",
    "an assignment to p.a. Make a new tuple": "p = Pair(x, x)\np.a += 1.0  #",
    "an assignment to p.b": "p = Pair(x, x)\np.b = 1.0  #",
    "an assignment to an entry of a constant. Pass the array in": "TABLE[0] = x  #",
    "a part of a tuple that is not a constant": "return (x, 1.0)[n]  #",
    "part 2 of 2. Count from 0": "return (x, 1.0)[2]  #",
    "2 values for 3 names": "a, b, c = x, x  #",
    "an array of 1 axes has no parts": "a, b = v  #",
    "else of a loop. Use a variable": "while n > 0:  #\n    n -= 1\nelse:\n    x = 1.0",
    "else of a loop": "for i in range(n):  #\n    x += i\nelse:\n    x = 1.0",
    "a range whose step is not constant. Use while": "for i in range(0, 9, n):  #\n    x += i",
    "a range with such arguments": "for i in range():  #\n    x += i",
    "float where there should be int": "for i in range(x):  #\n    x += i",
    "float has no parts": "for y in x:  #\n    x += 1",
    "y is float and complex. Use two names": "y = x\ny = y * 1j  #",
    "z is complex and float. Use two names": "z = 1j\nfor a in v:\n    z = a  #",
    "w is an array of 1 axes and an array of 2 axes": "w = v\nif n > 0:\n    w = m  #",
    "t is a tuple (float, float) and a tuple (float": "t = (x, x)\nt = (x, v)  #",
    "either float or complex": "y = x if n > 0 else 1j  #",
    "either float or an array": "y = x if n > 0 else v  #",
    "results of several types": "if n > 0:\n    return x\nreturn v  #",
    "it may end without a result": "if n > 0:  #\n    return x",
    "y may have no value yet. Assign one before": "if n > 0:\n    y = x\nreturn y  #",
    "i may have no value yet": "for i in range(n):\n    x += i\nreturn i  #",
    "k may have no value yet": (
        "for a in (x, 1.0):\n    if n > 0:\n        continue\n    k = a\nreturn k  #"
    ),
    "unheard_of is not known. Define or import it": "return unheard_of + x  #",
    "math.unheard_of is not known": "return math.unheard_of(x)  #",
    "a tuple (float, float) has no c": "return Pair(x, x).c  #",
    "float has no conjugate": "return x.conjugate()  #",
    "a call of sum. Mark it as compiled": "return sum(v)  #",
    "a call of unmarked. Mark it as compiled": "return unmarked(x)  #",
    "a call of math.log with such arguments": "return math.log(x, 2.0)  #",
    "a call of max with such arguments": "return max(x, n, key=abs)  #",
    "a call of min with such arguments": "return min()  #",
    "the largest of float and complex": "return max(x, 1j)  #",
    "other arguments than a, b": "return added(x)  #",
    "other arguments than a, b. ": "return added(x, 1, c=2)  #",
    "a call that Python may leave out": "return 1.0 if 0 < n < added(n, 1) else x  #",
    "None as an argument": "return added(x, None)  #",
    "None in a tuple": "y = (x, None)  #",
    "complex where there should be float": "return math.sqrt(1j)  #",
    "complex numbers have no order": "return 1.0 if 1j * x < 2j else 2.0  #",
    "a power of int with int": "return n ** 2 + x  #",
    "a power of complex": "return ((1j * x) ** 2).real  #",
    "BitAnd of float": "return x & n  #",
    "10000000000000000000000 has more than 64 bits": "return x * 10000000000000000000000  #",
    "a constant array of uint8": "return BYTES[0] + x  #",
    "a variable without a value": "y: float  #",
    "float where there should be int.": "k: int = 2.5  #",
}
SHARED = """
TABLE, BYTES = np.arange(3.0), np.zeros(3, np.uint8)

class Pair(NamedTuple):
    a: float
    b: float

@compiled()
def added(a, b):
    return a + b

def unmarked(a):
    return a

"""
HEAD = "@entry_point()\ndef f(n: int, x: float, v: Vector, m: Matrix) -> float:\n"
# Whole functions, as their heads are refused.
WHOLES = {
    "it calls itself. Write a loop": "@compiled()\ndef g(a):  #\n    return g(a) + 1\n",
    "parameters with stars, slashes or defaults": "@compiled()\ndef g(a=1):  #\n    return a\n",
    "parameters with stars, slashes": "@compiled()\ndef g(*a):  #\n    return a[0]\n",
    "stars, slashes or defaults. Name all": "@compiled()\ndef g(a, /):  #\n    return a\n",
    "no source of a function with a name. Write it": "g = compiled()(lambda a: a)  #\n",
}
HEADS = {
    "annotate x": "def f(x) -> float:\n    return x",
    "annotate return": "def f(x: float):\n    return x",
    "take no str": "def f(x: str) -> float:\n    return 1.0",
    r"take no list\[int\]": "def f(x: list[int]) -> float:\n    return 1.0",
    r"take no int \| None": "def f(x: int | None) -> float:\n    return 1.0",
    "x with complex as an argument": "def f(x: complex) -> float:\n    return 1.0",
    "it returns complex. Return a number": "def f(x: float) -> complex:\n    return x * 1j",
}


def refused(source: str, folder: Path) -> str:
    """What is said of an entry, and that it is said of the marked line."""
    module = module_of(SHARED + source, folder)
    path = Path(str(module.__file__))
    lines = path.read_text(encoding="utf-8").splitlines()
    with pytest.raises(Refusal) as caught:
        Program([module.f])
    said = str(caught.value)
    match = re.fullmatch(rf"{re.escape(str(path))}:(\d+): (f|g|<lambda>): (.+\. .+)", said)
    assert match, said
    marked = next(k for k, line in enumerate(lines, 1) if line.endswith("#"))
    assert abs(int(match[1]) - marked) <= (match[2] != "f"), said
    return match[3]


@pytest.mark.parametrize("what", [what for what, body in BODIES.items() if body])
def test_what_is_refused(what: str, tmp_path: Path) -> None:
    lines = [*BODIES[what].split("\n"), *["return x"] * (what != "it may end without a result")]
    assert what in refused(HEAD + "".join(f"    {line}\n" for line in lines), tmp_path)


@pytest.mark.parametrize("what", WHOLES)
def test_functions_that_are_refused(what: str, tmp_path: Path) -> None:
    assert what in refused(f"{WHOLES[what]}\n{HEAD}    return g(x)\n", tmp_path)


@pytest.mark.parametrize("what", HEADS)
def test_entries_that_are_refused(what: str, tmp_path: Path) -> None:
    """When they are called, too."""
    module = module_of(f"@entry_point()\n{HEADS[what]}\n", tmp_path)
    with pytest.raises(TypeError, match=what):
        Program([module.f])
    with pytest.raises(TypeError, match=rf"{module.__name__}\.py:\d+: f: .*{what}"):
        module.f(1.0)


# How an entry comes by an array that is a constant, or may be one, and how it writes to that.
CONSTANTS = """
GRID, TABLE = np.arange(6.0).reshape(2, 3), np.arange(3.0)

class Held(NamedTuple):
    v: Vector
    n: int

HELD = Held(np.arange(3.0), 1)

@compiled()
def fill(v, x):
    v[0] = x
@compiled()
def fill_held(held, x):
    fill(held.v, x)
@compiled()
def carried(v):
    return (v, 1)
@compiled()
def total(v):
    s = 0.0
    for y in v:
        s += y
    return s

"""
WAYS = (
    "w = TABLE",
    "w = GRID[1]",
    "w = TABLE[1:]",
    "w = HELD.v",
    "w = TABLE if n > 0 else v",
    "w = v\n    if n > 0:\n        w = TABLE",
    "w, k = carried(TABLE)",
    "w, k = v, n\n    for i in range(n):\n        w, k = HELD",
    "w = Held(TABLE, n).v",
    "held = Held(GRID[0], n)\n    w = held.v",
    "w = v\n    for row in GRID:\n        w = row",
)
WRITES = ("w[0] = x", "w[-1] += x", "fill(w, x)", "fill_held(Held(w, n), x)", "fill(v=w[1:], x=x)")


@pytest.mark.parametrize("way", WAYS)
def test_constants_are_not_written_to(way: str, tmp_path: Path) -> None:
    """Neither where they are seen, nor in functions that they are handed to."""
    for write in WRITES:
        source = f"{CONSTANTS}{HEAD}    {way}\n    {write}  #\n    return x\n"
        assert re.match(
            "an assignment to an entry|a constant array for fill", refused(source, tmp_path)
        )


def test_constants_are_read_by_the_same_functions(tmp_path: Path) -> None:
    for way in WAYS:
        body = f"    {way}\n    return total(w) + total(v) + total(TABLE)\n"
        module = module_of(f"{CONSTANTS}{HEAD}{body}", tmp_path)
        assert Program([module.f]).whole().count('total"(') == 4, way  # a definition, three calls
        given = 2, 0.5, np.arange(4.0), np.ones((2, 2))
        assert module.f(*given) == module.f.python(*given)


def test_a_result_of_another_type_than_annotated(tmp_path: Path) -> None:
    for note, body in {"int": "x", "bool": "1", "None": "x", "float": "(x, x)"}.items():
        module = module_of(
            f"@entry_point()\ndef f(x: float) -> {note}:\n    return {body}\n", tmp_path
        )
        with pytest.raises(Refusal, match=rf"{module.__name__}\.py:\d+: f: .*\. .*"):
            Program([module.f])


def test_types_that_take_many_rounds_to_settle(tmp_path: Path) -> None:
    """Each round of the translation finds one more variable to be real; at last it gives up."""
    names = [f"a{k}" for k in range(14)]
    steps = "".join(f"        {a} = {b} + 1\n" for a, b in pairwise(names))
    body = f"    {' = '.join(names)} = 0\n    for i in range(9):\n{steps}        {names[-1]} = x\n"
    head = HEAD.replace("float:", "float:  #")
    assert "cannot be inferred" in refused(f"{head}{body}    return a0\n", tmp_path)
