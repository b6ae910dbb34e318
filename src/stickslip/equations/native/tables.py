"""Repeated statements as a loop over a table of their differences.

A chain of blocks has the same few formulas many times. Instructions and statements that differ in
numbers alone (rows, places, constants) share a pattern; the numbers stand in a table of constants
beside the code. So code does not grow with a system, and what is written for one is written for
all.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.native.arithmetic import Arithmetic, Count, Operand
from stickslip.equations.native.kernels import summed_moduli
from stickslip.equations.native.routines import InRegister, Routine, in_register
from stickslip.kept import cached_property
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.scalars import ParameterExpressions, Scalar, Store, element
from stickslip.symbolic.tape import Instruction, Op, Scaled
from stickslip.translator.assembly import POINTER, WHOLE, Register, WrongType, of_type

FEWEST_REPETITIONS = 16  # smallest number of repetitions for a loop: fewer are as fast unrolled
_LONG_SUM = 32  # number of terms above which a sum is added in groups


class Whole(Register):
    """A whole number in a register, to which numbers can be added."""

    inside: Arithmetic

    @classmethod
    def loaded(cls, f: Arithmetic, register: Register) -> Whole:
        """Load the value of a register of a function."""
        made = cls(*of_type(WHOLE, register))
        made.inside = f
        return made

    def __add__(self, other: int) -> Whole:  # pyright: ignore[reportIncompatibleMethodOverride]
        if other == 0:
            return self
        return Whole.loaded(self.inside, self.inside.count("add", self, other))


class Pattern(NamedTuple):
    """The common part of all repetitions, and the numbers in which they differ."""

    key: Hashable
    wholes: list[Count]
    reals: list[Operand]

    @property
    def is_known(self) -> bool:
        """Whether the numbers are known now. Inside another repetition they are in registers, and
        no table can hold them."""
        return not any(isinstance(x, Register) for x in (*self.wholes, *self.reals))


class Progression(NamedTuple):
    """Whole numbers that grow by the same step."""

    first: int
    step: int


class Tabled(Routine):
    """A function in which repeated instructions are a loop over tables."""

    @cached_property
    def _bytes(self) -> bytearray:
        """The table, column by column."""
        return bytearray()

    @property
    def _table(self) -> Register:
        return Register(f"@{self.name}.table", POINTER)

    def definition(self) -> str:
        """The table and the whole function."""
        if not self._bytes:
            return super().definition()
        numbers = "\\" + self._bytes.hex("\\")
        size = len(self._bytes)
        table = f'{self._table} = internal constant [{size} x i8] c"{numbers}", align 8'
        return f"{table}\n{super().definition()}"

    # -- loops over a table ------------------------------------------------------------------------

    def repeat(
        self,
        repetitions: Sequence[Pattern],
        body: Callable[..., Sequence[Operand | Count] | None],
        *first: Operand | Count,
    ) -> list[Register]:
        """Follow a body for all repetitions of a pattern.

        Parameters
        ----------
        body : callable
            Takes the whole numbers and the reals of a repetition, each a number where it is always
            the same, and the carried values; returns their new ones.
        first : numbers, registers
            The carried values at the beginning.

        Raises
        ------
        WrongType
            If numbers of a repetition are in registers.
        """
        if not all(p.is_known for p in repetitions):
            raise WrongType("a table holds numbers, not registers")
        wholes = list(zip(*(p.wholes for p in repetitions), strict=True))
        reals = list(zip(*(p.reals for p in repetitions), strict=True))
        own_wholes = [self._whole_column(column) for column in wholes]
        own_reals = [self._real_column(column) for column in reals]

        def step(i: Register, *values: Register) -> Sequence[Operand | Count] | None:
            numbers = [self._whole(column, i) for column in own_wholes]
            constants = [self.read(x, i) if isinstance(x, Register) else x for x in own_reals]
            return body(numbers, constants, *values)

        return self.loop(0, len(repetitions), step, *first)

    def _real_column(self, numbers: Sequence[Any]) -> Operand:
        """The number that is always the same, or the address of a column of the table."""
        if all(number == numbers[0] for number in numbers):
            return numbers[0]
        return self._column(np.array(numbers, dtype=np.float64))

    def _whole_column(self, numbers: Sequence[Any]) -> int | Progression | Register:
        """The number that is always the same, a progression, or the address of a column of the
        table."""
        if all(number == numbers[0] for number in numbers):
            return numbers[0]
        values = np.array(numbers)
        steps = np.diff(values)
        if np.all(steps == steps[0]):
            return Progression(int(values[0]), int(steps[0]))
        return self._column(values.astype(np.int32))

    def _column(self, numbers: Array) -> Register:
        """The address of a new column of the table."""
        self._bytes.extend(bytes(-len(self._bytes) % 8))
        place = len(self._bytes)
        self._bytes.extend(numbers.tobytes())
        return self.at(self._table, place, "i8")

    def _whole(self, column: int | Progression | Register, i: Register) -> int | Whole:
        """A whole number of a repetition."""
        if isinstance(column, int):
            return column
        if isinstance(column, Progression):
            found = self.count("add", self.count("mul", i, column.step), column.first)
        else:
            number = self.load("i32", self.at(column, i, "i32"))
            found = self.new(WHOLE, f"sext {number.typed} to {WHOLE}")
        return Whole.loaded(self, found)

    def _terms(self, terms: Sequence[Pattern]) -> tuple[Register, Register]:
        """The addresses of the factors and of the rows of terms."""
        factors = np.array([term.reals[0] for term in terms], dtype=np.float64)
        rows = np.array([term.wholes[0] for term in terms], dtype=np.int64)
        return self._column(factors), self._column(rows)

    # -- statements --------------------------------------------------------------------------------

    def statements(self, stores: Iterable[Store]) -> None:
        """Write statements: those of a pattern that do not need each other in one loop."""
        stores = list(stores)
        patterns = [_pattern_of(store) for store in stores]
        for group in grouped(patterns, _levels(stores)):
            if len(group) < FEWEST_REPETITIONS or _is_kernel(stores[group[0]].value):
                super().statements(stores[i] for i in group)
                continue
            pattern = stores[group[0]]

            def body(wholes: list[Any], reals: list[Any], pattern: Store = pattern) -> None:
                filled = _Filling(wholes, reals)
                place = tuple(filled.whole() for _ in pattern.place)
                value = filled.scalar(pattern.value)
                Routine.statements(self, [pattern._replace(place=place, value=value)])

            self.repeat([patterns[i] for i in group], body)

    def _scalar(self, s: Scalar) -> Operand:
        """A value; long sums are loops."""
        if not _is_long_sum(s):
            return super()._scalar(s)
        patterns = [_pattern_of(term) for term in s.args]
        total: Operand = 0.0
        for group in grouped(patterns, [0] * len(patterns)):
            if len(group) < FEWEST_REPETITIONS or not all(patterns[i].is_known for i in group):
                for i in group:
                    total = self.add(total, self.scalar(s.args[i]))
                continue
            pattern = s.args[group[0]]
            if _is_weighted_modulus(pattern):
                factors, rows = self._terms([patterns[i] for i in group])
                W, along = self.data("W"), self.stride("W")
                part = self.kernel(summed_moduli, factors, rows, W, along, len(group))
                total = self.add(total, part)
                continue

            def body(
                wholes: list[Any], reals: list[Any], sum_so_far: Register, pattern: Scalar = pattern
            ) -> list[Operand | Count]:
                term = self.scalar(_Filling(wholes, reals).scalar(pattern))
                return [self.add(sum_so_far, term)]

            (total,) = self.repeat([patterns[i] for i in group], body, total)
        return total


def _is_long_sum(s: Scalar) -> bool:
    """Whether a value is a sum of many terms."""
    return s.op == "sum" and len(s.args) >= _LONG_SUM


def _is_kernel(s: Scalar) -> bool:
    """Whether a value is a long sum of which a kernel computes a part: its numbers are in a table
    of its own, so that it cannot be one of many repetitions."""
    return _is_long_sum(s) and any(map(_is_weighted_modulus, s.args))


def _is_weighted_modulus(s: Scalar) -> bool:
    """Whether a value is a number times the modulus of a coefficient of order 0."""
    if s.op != "product" or [part.op for part in s.args] != ["number", "modulus"]:
        return False
    (entry,) = s.args[1].args
    return entry.op == "entry" and entry.name == "W" and entry.index[1] == 0


def grouped(patterns: Sequence[Pattern], levels: Sequence[int]) -> list[list[int]]:
    """Numbers of repetitions of one pattern and level, level by level."""
    groups: dict[Hashable, list[int]] = {}
    for i in sorted(range(len(patterns)), key=levels.__getitem__):
        groups.setdefault((levels[i], patterns[i].key), []).append(i)
    return list(groups.values())


# -- patterns of scalars ---------------------------------------------------------------------------


def _pattern_of(thing: Store | Scalar) -> Pattern:
    """The pattern of a statement or a value."""
    found = Pattern(None, [], [])
    seen: dict[int, int] = {}

    def visit(s: Scalar) -> Hashable:
        if id(s) in seen:
            return seen[id(s)]
        seen[id(s)] = len(seen)
        length = 0
        if s.op == "number":
            found.reals.append(s.value)
        elif isinstance(s, InRegister):
            found.reals.append(s.register)
        elif s.op == "spread":
            place, length, base = s.index
            found.wholes.extend((place, base))
        else:
            found.wholes.extend(s.index)
        return s.op, s.name, length, len(s.index), tuple(map(visit, s.args))

    if isinstance(thing, Scalar):
        return found._replace(key=visit(thing))
    found.wholes.extend(thing.place)
    return found._replace(key=(thing.name, len(thing.place), thing.adding, visit(thing.value)))


class _Filling:
    """A pattern with registers for its numbers, in the order in which they were found."""

    def __init__(self, wholes: Iterable[Any], reals: Iterable[Any]) -> None:
        self._wholes = iter(wholes)
        self._reals = iter(reals)
        self._made: dict[int, Scalar] = {}

    def whole(self) -> Any:
        """The next whole number."""
        return next(self._wholes)

    def real(self) -> Any:
        """The next real."""
        return next(self._reals)

    def scalar(self, s: Scalar) -> Scalar:
        """The value with these numbers."""
        if id(s) in self._made:
            return self._made[id(s)]
        if s.op == "number":
            made = _known(self.real())
        else:
            if s.op == "spread":
                index = (self.whole(), s.index[1], self.whole())
            else:
                index = tuple(self.whole() for _ in s.index)
            made = Scalar(s.op, tuple(map(self.scalar, s.args)), s.name, index)
        self._made[id(s)] = made
        return made


def _known(x: Operand) -> Scalar:
    """A number, or one in a register, as a value."""
    return in_register(x) if isinstance(x, Register) else Scalar("number", value=x)


def _levels(stores: list[Store]) -> list[int]:
    """Level of execution of each statement: after all statements that store what it reads or
    changes."""
    written: dict[tuple[str, tuple[int, ...]], int] = {}
    names = {store.name for store in stores}
    levels = list[int]()
    for store in stores:
        needed = _read(store.value, names) | {(store.name, store.place)}
        levels.append(1 + max((written.get(place, 0) for place in needed), default=0))
        written[store.name, store.place] = levels[-1]
    return levels


def _read(s: Scalar, names: set[str]) -> set[tuple[str, tuple[int, ...]]]:
    """Array entries that enter a value."""
    found = set[tuple[str, tuple[int, ...]]]()
    seen = set[int]()

    def visit(s: Scalar) -> None:
        if id(s) in seen:
            return
        seen.add(id(s))
        if s.op == "entry" and s.name in names:
            found.add((s.name, s.index))
        elif s.op == "spread":
            _, n, base = s.index
            found.update(("mag", (base + j,)) for j in range(n))
        for x in s.args:
            visit(x)

    visit(s)
    return found


# -- patterns of instructions ----------------------------------------------------------------------


def pattern_of_instruction(i: Instruction, slots: ParameterExpressions, clock: int) -> Pattern:
    """The pattern of an instruction of the tape.

    Parameters
    ----------
    slots : ParameterExpressions
        Where constants stand.
    clock : int
        The row of time, which is a pattern of its own.
    """
    rows = [i.row, *i.inputs, *(part.row for part in i.parts if part.row is not None)]
    wholes: list[Count] = [*rows, i.place]
    reals = list[Operand]()
    factors = list[Hashable]()
    for part in i.parts:
        known = part.factor.op == "num"
        if known and i.op is not Op.POWER:
            reals.append(ex.number(part.factor))
        elif not known:
            wholes.append(slots.slot(part.factor))
        factors.append(
            (
                known,
                part.row is None,
                ex.number(part.factor) if known and i.op is Op.POWER else None,
            )
        )
    same = tuple(i.inputs.index(row) for row in i.inputs)
    of_clock = tuple(row == clock for row in rows)
    alone = id(i) if i.entries or i.zero else 0
    key = (i.op, same, of_clock, tuple(factors), i.size, i.matrix, i.function, alone)
    return Pattern(key, wholes, reals)


def filled_instruction(i: Instruction, wholes: list[Any], reals: list[Any]) -> Instruction:
    """The instruction with registers for its numbers.

    Parameters
    ----------
    i : Instruction
        One of the pattern.
    wholes, reals : lists
        As :func:`pattern_of_instruction` lists them.
    """
    numbers, constants = iter(wholes), iter(reals)
    row = next(numbers)
    inputs = tuple(next(numbers) for _ in i.inputs)
    rows = [None if part.row is None else next(numbers) for part in i.parts]
    place = next(numbers)
    parts = list[Scaled]()
    for part, own in zip(i.parts, rows, strict=True):
        factor: Any = part.factor
        if part.factor.op != "num":
            factor = element("K", next(numbers))
        elif i.op is not Op.POWER:
            factor = _known(next(constants))
        parts.append(Scaled(cast(Any, factor), own))
    return Instruction(
        i.op, row, inputs, tuple(parts), place, i.size, i.matrix, i.function, i.entries
    )
