"""What Python calls: arguments as words, and what is said of wrong ones."""

from __future__ import annotations

import decimal
import fractions
import random
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest

from stickslip.arrays import (
    Array3,
    BoolVector,
    ByteMatrix,
    ComplexVector,
    IntVector,
    Matrix,
    Vector,
)
from stickslip.machine_code import words
from stickslip.machine_code.functions import entry_point
from stickslip.machine_code.interface import Jets, Setup
from stickslip.translator import compiled

from .judging import bits, plain


class Inner(NamedTuple):
    matrix: Matrix
    scale: float
    number: int


class Outer(NamedTuple):
    inner: Inner
    flags: BoolVector
    both: tuple[float, Inner]
    yes: bool
    jets: Jets


@entry_point()
def taken(outer: Outer, codes: ByteMatrix, turns: ComplexVector, x: float, n: int) -> float:
    return outer.inner.scale + x + n


def outer(rng: random.Random) -> Outer:
    """One, with arrays of several lengths."""
    sizes = (rng.randrange(4), rng.randrange(4))
    matrix = np.array([rng.gauss(0, 1) for _ in range(sizes[0] * sizes[1])]).reshape(sizes)
    inner = Inner(
        matrix, rng.choice((-1.0, -0.0, 0.5, float("nan"))), rng.choice((-1, 0, 2**63 - 1))
    )
    other = Inner(np.ones((2, 0)), np.float64(2.5), np.int32(7))  # pyright: ignore[reportArgumentType]
    return Outer(inner, np.zeros(3, bool), (0.5, other), rng.random() < 0.5, Jets(2**40))


ARGUMENTS: Any = (outer(random.Random(1)), np.zeros((2, 3), np.int8), np.zeros(2, complex), 1.5, 3)


def both(arguments: Any) -> tuple[Any, Any]:
    """The words of arguments by the walk and by Python; None where they are refused."""
    prepared = taken.prepared
    found, wanted = prepared.words(arguments), words.by_python(prepared._type, arguments)
    return found and list(found), wanted and list(wanted)


def walked(arguments: Any) -> Any:
    """What the walk alone makes of arguments."""
    prepared = taken.prepared
    assert prepared._walk is not None or sys.implementation.name != "cpython"
    made = prepared._room()
    if prepared._walk is None or prepared._walk(arguments, prepared._plan_at, made):
        return None
    return list(made)


@pytest.mark.parametrize("seed", range(20))
def test_words_are_those_that_python_makes(seed: int) -> None:
    arguments = (outer(random.Random(seed)), *ARGUMENTS[1:])
    found, wanted = both(arguments)
    assert found == wanted == walked(arguments)
    assert found is not None and len(found) == 22


def with_number(x: Any = 1.5, n: Any = 3) -> Any:
    return (*ARGUMENTS[:3], x, n)


NUMBERS = {
    "a whole number for a real one": with_number(x=2),
    "truth for numbers": with_number(x=True, n=True),
    "numbers of NumPy": with_number(x=np.float32(0.1), n=np.int8(-1)),
    "an array without axes": with_number(x=np.array(2.0), n=np.array(3)),
    "a fraction": with_number(x=fractions.Fraction(1, 3)),
    "a decimal number": with_number(x=decimal.Decimal("0.1")),
    "the least": with_number(x=-sys.float_info.max, n=-(2**63)),
    "the largest": with_number(x=float("inf"), n=2**63 - 1),
    "minus one, by which errors are told": with_number(x=-1.0, n=-1),
}


@pytest.mark.parametrize("what", NUMBERS)
def test_numbers_of_many_kinds(what: str) -> None:
    found, wanted = both(NUMBERS[what])
    assert found == wanted is not None
    outer, *_, x, n = NUMBERS[what]
    assert bits(taken(*NUMBERS[what])) == bits(outer.inner.scale + float(x) + float(n))


def changed(**parts: Any) -> Any:
    return (ARGUMENTS[0]._replace(**parts), *ARGUMENTS[1:])


def inside(**parts: Any) -> Any:
    return changed(inner=ARGUMENTS[0].inner._replace(**parts))


MATRIX = np.ones((4, 4))
READ_ONLY = np.zeros(3, bool)
READ_ONLY.setflags(write=False)
UNALIGNED = np.zeros(17, np.int8)[1:].view(complex)
OTHER_ORDER = ">f8" if sys.byteorder == "little" else "<f8"
OTHER = {
    "a part less": (ARGUMENTS[:-1], "4 parts; 5 expected"),
    "a part more": ((*ARGUMENTS, 1), "6 parts; 5 expected"),
    "a number for a tuple": ((1.0, *ARGUMENTS[1:]), "arguments.outer is float; a tuple"),
    "a list for a tuple": (
        (list(ARGUMENTS[0]), *ARGUMENTS[1:]),
        "arguments.outer is list; a tuple",
    ),
    "a tuple of another length": (changed(both=(0.5,)), "outer.both: 1 parts; 2 expected"),
    "entries of another type": (
        changed(flags=np.zeros(3)),
        "flags is an array with 1 axes of float64",
    ),
    "entries of another size": (
        inside(matrix=MATRIX.astype("f4")),
        "matrix is an array with 2 axes of f",
    ),
    "unsigned entries": (
        (*ARGUMENTS[:1], np.zeros((2, 2), np.uint8), *ARGUMENTS[2:]),
        "codes is an array",
    ),
    "another number of axes": (
        changed(flags=np.zeros((3, 1), bool)),
        "with 2 axes of bool; 1 of b1",
    ),
    "not an array": (changed(flags=[True, False]), "flags is list; an array of 1 axes expected"),
    "nothing": (changed(flags=None), "flags is NoneType"),
    "columns": (inside(matrix=MATRIX[:, :2]), "inner.matrix is .* not in C order"),
    "Fortran's order": (inside(matrix=MATRIX[:, :3].T), "not in C order"),
    "backwards": (changed(flags=np.zeros(3, bool)[::-1]), "flags .* not in C order"),
    "not at a multiple of its size": (
        (*ARGUMENTS[:2], UNALIGNED, *ARGUMENTS[3:]),
        "turns is an array",
    ),
    "bytes the other way round": (
        inside(matrix=MATRIX.astype(OTHER_ORDER)),
        "matrix is .* of [<>]f8",
    ),
    "not to be written to": (changed(flags=READ_ONLY), "flags .* not writable"),
    "a real number for a whole one": (inside(number=1.5), "inner.number is float; int expected"),
    "too large": (inside(number=2**70), "number is too large; int expected"),
    "just too large": (with_number(n=2**63), "arguments.n is too large"),
    "too large to be real": (with_number(x=10**400), "arguments.x is too large; float expected"),
    "text": (inside(scale="1"), "scale is str; float expected"),
    "bytes": (with_number(x=b"1"), "arguments.x is bytes; float expected"),
    "a complex number": (with_number(x=1j), "arguments.x is complex; float expected"),
    "several numbers": (with_number(x=np.ones(2)), "arguments.x is ndarray; float expected"),
    "truth of several": (changed(yes=np.zeros(2)), "yes is ndarray; bool expected"),
    "a number for a function": (changed(jets=2**40), "jets is int; Jets expected"),
    "a function of another class": (changed(jets=Setup(2**40)), "jets is Setup; Jets expected"),
    "a part of a part": (changed(both=(0.5, (MATRIX, 0.5, None))), r"both\.1\.number is None"),
}


@pytest.mark.parametrize("what", OTHER)
def test_other_arguments_are_refused(what: str) -> None:
    """A wrong address would be a crash: whatever is of another kind is refused, by either way."""
    arguments, said = OTHER[what]
    assert both(arguments) == (None, None)
    with pytest.raises(
        TypeError, match=rf"^taken: arguments.*(?<=[ .]){said.removeprefix('arguments.')}"
    ):
        taken(*arguments)
    assert both(ARGUMENTS)[0] is not None


def test_the_walk_refuses_by_itself() -> None:
    """It is not Python that saves it."""
    for what, (arguments, _) in OTHER.items():
        try:
            assert walked(arguments) is None, what
        except (TypeError, ValueError, OverflowError):
            continue


def test_a_type_by_another_name_is_the_same() -> None:
    """On most systems NumPy has two names for whole numbers of 64 bits."""
    for name in ("l", "q"):
        if np.dtype(name).itemsize == 8:
            assert total(np.array([1, 2], name)) == 3


@entry_point()
def total(x: IntVector) -> int:
    found = 0
    for n in x:
        found += n
    return found


@compiled()
def trace(inner: Any) -> Any:
    found = 0.0
    for i in range(min(inner.matrix.shape)):
        found += inner.matrix[i, i]
    return inner.scale * found + inner.number


@entry_point()
def summed(outer: Outer, out: Vector, cube: Array3) -> float:
    out[0] = trace(outer.inner)
    out[1] = trace(outer.both[1]) * outer.both[0]
    out[2] = len(outer.flags) if outer.yes else -1.0
    for i in range(len(outer.flags)):
        outer.flags[i] = i % 2 == 0
    return out[0] + cube[-1, 0, 1]


@pytest.mark.parametrize("seed", range(5))
def test_an_entry_computes_what_python_computes(seed: int) -> None:
    rng = random.Random(seed)
    both = (0.5, Inner(np.arange(6.0).reshape(2, 3), 2.0, 3))
    given = (outer(rng)._replace(both=both), np.zeros(3), np.arange(8.0).reshape(2, 2, 2))
    known = plain(given)
    assert bits(summed(*given)) == bits(summed.python(*known))
    assert bits(given[1]) == bits(known[1])
    np.testing.assert_array_equal(given[0].flags, [True, False, True])


@entry_point()
def is_large(x: float) -> bool:
    return x > 1.0


@entry_point()
def nothing(x: Vector) -> None:
    x[0] = 1.0


@entry_point()
def constant() -> int:
    return -3


def test_results_are_those_of_python() -> None:
    assert is_large(2.0) is True
    assert is_large(np.float64(0.5)) is False
    assert nothing(np.zeros(1)) is None
    assert constant() == -3
    assert type(constant()) is int and type(taken(*ARGUMENTS)) is float
    with pytest.raises(TypeError, match="constant: arguments: 1 parts; 0 expected"):
        constant(1)
    with pytest.raises(TypeError, match=r"is_large: arguments\.x is str"):
        is_large("2")
