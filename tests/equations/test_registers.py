"""A register of another type than an instruction takes is refused where it is given."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

import pytest
from llvmlite import binding as llvm

from stickslip.equations.native import kernels
from stickslip.equations.native.arithmetic import Arithmetic
from stickslip.equations.native.routines import Routine, in_register
from stickslip.equations.native.tables import Pattern, Tabled, Whole
from stickslip.symbolic.scalars import Store, added, element, numeral
from stickslip.translator.assembly import (
    BIT,
    POINTER,
    REAL,
    WHOLE,
    Assembly,
    Register,
    WrongType,
    of_type,
    operand,
)

ARRAY = "{ ptr, i64, i64 }"
TYPES = (BIT, WHOLE, REAL, POINTER, "i32", ARRAY)
ARGUMENTS = {type_: f"%{name}" for type_, name in zip(TYPES, "bwrpia", strict=True)}
OTHERS = {f"%{name}2": type_ for type_, name in zip(TYPES, "bwrpia", strict=True)}
TAKES: dict[str, tuple[Any, ...]] = {
    "negative": (REAL,),
    "add": (REAL, REAL),
    "times": (REAL, REAL),
    "fused": (REAL, REAL, REAL),
    "over": (REAL, REAL),
    "plainly": ("fadd", REAL, REAL),
    "scaled": (REAL, REAL),
    "function": ("pow", REAL, REAL),
    "known_now": (REAL,),
    "test": ("olt", REAL, REAL),
    "both": (BIT, BIT),
    "either": (BIT, BIT),
    "fails": (BIT,),
    "select": (BIT, REAL, REAL),
    "count": ("add", WHOLE, WHOLE),
    "compare": ("slt", WHOLE, WHOLE),
    "as_real": (WHOLE,),
    "at": (POINTER, WHOLE, "float"),
    "load": ("float", POINTER),
    "extract": (ARRAY, 0, "ptr "),
    "op": ("fadd", REAL, REAL),
    "pick": (BIT, REAL, REAL),
    "read": (POINTER, WHOLE),
    "write": (REAL, POINTER),
    "kernel": (kernels.powered, POINTER, POINTER, WHOLE, WHOLE, WHOLE, REAL),
    "leave": (BIT, 1),
    "loop": (WHOLE, WHOLE, lambda *_: None),
}
"""What each method takes: types, and arguments that are none."""
APART = {"total", "store", "choose", "converted"}
"""Methods that are looked at apart."""
FREE = {"once", "age", "definition", "body", "new", "slot", "structure", "call", "outside"}
FREE |= {"label", "begin", "end", "go", "leads"}
"""Methods that take no operand, or operands of any type."""


def function() -> Arithmetic:
    """A function with two arguments of each type."""
    named = [Register(name, type_) for type_, name in ARGUMENTS.items()]
    return Arithmetic("f", [*named, *(Register(*pair) for pair in OTHERS.items())], WHOLE)


def operands(given: tuple[Any, ...]) -> list[Any]:
    """Registers of types, no two the same in a row."""
    names = [ARGUMENTS, {type_: name for name, type_ in OTHERS.items()}]
    return [
        Register(names[i % 2][x], x) if isinstance(x, str) and x in ARGUMENTS else x
        for i, x in enumerate(given)
    ]


def wrong(given: tuple[Any, ...]) -> Iterator[list[Any]]:
    """The same with one operand of another type, or of none."""
    for i, type_ in enumerate(given):
        if not isinstance(type_, str) or type_ not in ARGUMENTS:
            continue
        for other in TYPES:
            if other != type_:
                changed = operands(given)
                changed[i] = Register(ARGUMENTS[other], other)
                yield changed


def test_every_method_is_looked_at() -> None:
    methods = {
        name
        for name, _ in inspect.getmembers(Arithmetic, inspect.isfunction)
        if not name.startswith("_")
    }
    assert methods == TAKES.keys() | APART | FREE


@pytest.mark.parametrize("name", TAKES)
def test_a_method_takes_registers_of_its_types_alone(name: str) -> None:
    f = function()
    getattr(f, name)(*operands(TAKES[name]))
    f.end("ret i64 0")
    llvm.parse_assembly("\n".join([*f.declared.values(), f.definition()])).verify()
    for given in wrong(TAKES[name]):
        f = function()
        with pytest.raises(WrongType):
            getattr(f, name)(*given)


def test_sums_stores_and_branches_take_their_types_alone() -> None:
    a, b = operands((REAL, REAL))
    for type_ in set(TYPES) - {REAL}:
        other = Register(ARGUMENTS[type_], type_)
        for products in ([(a, other)], [(other, b)], [(a, b), (other, 2.0), (b, 3.0)]):
            with pytest.raises(WrongType):
                function().total(products)
    for type_ in set(TYPES) - {POINTER}:
        with pytest.raises(WrongType):
            function().store(a, Register(ARGUMENTS[type_], type_))
    for type_ in set(TYPES) - {BIT}:
        with pytest.raises(WrongType):
            function().choose(Register(ARGUMENTS[type_], type_), "yes", "no")


def test_conversions_are_of_whole_numbers_and_keep_the_type_that_is_there() -> None:
    for type_, name in ARGUMENTS.items():
        for other in TYPES:
            f = function()
            if type_ == other or (type_ in ("i1", "i32", "i64") and other not in (POINTER, ARRAY)):
                assert f.converted(Register(name, type_), other).type == other
                f.end("ret i64 0")
                llvm.parse_assembly(f.definition()).verify()
            else:
                with pytest.raises(WrongType):
                    f.converted(Register(name, type_), other)


def test_what_a_loop_carries_keeps_its_type() -> None:
    for first in (0.0, 1, True, *(Register(name, x) for x, name in ARGUMENTS.items())):
        kept = function()
        kept.loop(0, 3, lambda _, x: [x], first)
        for other in TYPES:
            if other != operand(first).type:
                changed = [Register(ARGUMENTS[other], other)]
                with pytest.raises(WrongType):
                    function().loop(0, 3, lambda _, x, changed=changed: changed, first)


@pytest.mark.parametrize("type_", [BIT, WHOLE, REAL, POINTER])
def test_numbers_are_of_one_type(type_: str) -> None:
    own = {BIT: True, WHOLE: 3, REAL: 3.0}.get(type_)
    for x in (True, 3, 3.0):
        if x is own:
            assert of_type(type_, x).type == type_
        else:
            with pytest.raises(WrongType):
                of_type(type_, x)
    for nothing in (None, "%r", "3"):
        with pytest.raises(WrongType):
            of_type(type_, nothing)  # pyright: ignore[reportArgumentType]


def test_a_function_has_one_type() -> None:
    f = Assembly()
    f.outside(REAL, "pow", Register("%r", REAL), Register("%r", REAL))
    with pytest.raises(WrongType):
        f.outside(REAL, "pow", Register("%r", REAL))
    assert list(f.declared) == ["pow"]


def test_placeholders_are_registers_of_their_types() -> None:
    f = Routine("jets")
    t = f.arguments["t"]
    assert f.scalar(in_register(t)) == t
    loaded = Whole.loaded(f, f.arguments["N"])
    assert loaded + 0 is loaded
    assert (loaded + 2).type == WHOLE
    for register in f.arguments.values():
        if register.type != REAL:
            with pytest.raises(WrongType):
                in_register(register)
        if register.type != WHOLE:
            with pytest.raises(WrongType):
                Whole.loaded(f, register)


def test_a_table_holds_no_registers() -> None:
    f = Tabled("powers")
    whole, real = Whole("%n", WHOLE), Register("%x", REAL)
    for pattern in (Pattern(None, [whole], []), Pattern(None, [], [real])):
        with pytest.raises(WrongType):
            f.repeat([pattern] * 20, lambda *_: None)
    assert not f.lines


@pytest.mark.parametrize("terms", [2, 40])
def test_a_repeated_sum_is_one_loop(terms: int) -> None:
    """Its numbers are in registers, so its terms are written out inside."""
    f = Tabled("powers")
    values = [
        added(numeral(i + j / 7) * element("K", i * i + j) for j in range(terms)) for i in range(30)
    ]
    f.statements([Store("out", (i,), value) for i, value in enumerate(values)])
    f.end("ret void")
    llvm.parse_assembly(f.definition()).verify()
    assert sum("icmp slt" in line for line in f.lines) == 1
