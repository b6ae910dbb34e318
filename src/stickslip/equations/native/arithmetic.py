"""Arithmetic of one function in LLVM assembly: sums of products, choices, loops.

A value is a number that is known now, or a register. What is zero is absent: it is neither
multiplied nor added. The order of sums is fixed here, and nothing is left for LLVM to reorder, so
that NaN and infinity stay visible and the same bits come out on every processor with fused
multiplication.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import cache
from typing import Any, TypeVar

from stickslip.machine_code.functions import Kernel
from stickslip.translator.assembly import (
    BIT,
    FASTCC,
    POINTER,
    REAL,
    WHOLE,
    Assembly,
    Register,
    of_type,
    operand,
)
from stickslip.translator.values import ArrayType, entry_types

Operand = float | Register
"""A real number."""
Count = int | Register
"""A whole number."""
Pair = tuple[Operand, Operand]
_STRANDS = 4  # number of partial sums of long sums, so that instructions do not wait for each other
_T = TypeVar("_T")


_types = cache(entry_types)


def _real(x: Operand) -> str:
    """A real number as an operand, without its type."""
    return of_type(REAL, x).name


def _whole(n: Count) -> str:
    """A whole number as an operand, without its type."""
    return of_type(WHOLE, n).name


class Arithmetic(Assembly):
    """A function in the making.

    Parameters
    ----------
    result : str
        Its type.

    Attributes
    ----------
    arguments : dict of str to Register
        By name.
    """

    # with attributes, LLVM would call other functions of C than those that are written here
    attributes, within = "", ""

    def __init__(self, name: str, arguments: Sequence[Register], result: str) -> None:
        super().__init__()
        self.name = name
        self.arguments = {x.name[1:]: x for x in arguments}
        self._head = f"define {result} @{name}({', '.join(x.typed for x in arguments)})"
        self._made: dict[Operand, tuple[Operand, ...]] = {}
        self._age: dict[Operand, int] = {}
        self._once: dict[Hashable, Any] = {}
        self._stores = 0

    def definition(self) -> str:
        """The whole function."""
        return f"{self._head} {{\n{self.body()}}}\n"

    def once(self, key: Hashable, make: Callable[[], _T]) -> _T:
        """A value that is computed where it is first needed, and then reused."""
        if key not in self._once:
            self._once[key] = make()
        return self._once[key]

    def age(self, x: Operand) -> int:
        """Stage at which a value is known: −1 from the start, then the order of the
        coefficients."""
        return self._age.get(x, -1)

    def known_now(self, x: Register) -> None:
        """Register that a coefficient is complete: values computed from it are newer than all
        before."""
        self._stores += 1
        self._age[of_type(REAL, x)] = self._stores

    def _aged(self, register: Register, *made_of: Operand) -> Register:
        """Assign a register the age of its newest operand."""
        age = max(map(self.age, made_of))
        if age >= 0:
            self._age[register] = age
        return register

    # -- real numbers ------------------------------------------------------------------------------

    def negative(self, a: Operand) -> Operand:
        """−a."""
        if isinstance(a, float):
            return -a
        return self.once(("-", a), lambda: self._aged(self.new(REAL, f"fneg double {_real(a)}"), a))

    def add(self, a: Operand, b: Operand) -> Operand:
        """A sum."""
        if isinstance(a, float) and isinstance(b, float):
            return a + b
        if b == 0.0 or a == 0.0:
            return a if b == 0.0 else b
        return self.plainly("fadd", a, b)

    def times(self, a: Operand, b: Operand) -> Operand:
        """A product."""
        if isinstance(a, float) and isinstance(b, float):
            return a * b
        if a == 0.0 or b == 0.0:
            return 0.0
        if a == 1.0 or b == 1.0:
            return b if a == 1.0 else a
        product = self.plainly("fmul", a, b)
        self._made[product] = (a, b)
        return product

    def fused(self, a: Operand, b: Operand, c: Operand) -> Operand:
        """a·b + c, rounded once."""
        if a in (0.0, 1.0) or b in (0.0, 1.0) or c == 0.0:
            return self.add(self.times(a, b), c)
        if isinstance(a, float) and isinstance(b, float):
            return self.add(a * b, c)
        made = self.function("llvm.fma.f64", a, b, c)
        self._made[made] = (a, b, c)
        return made

    def over(self, a: Operand, b: Operand) -> Operand:
        """A quotient."""
        if a == 0.0 or b == 1.0:
            return a
        return self.plainly("fdiv", a, b)

    def plainly(self, operation: str, a: Operand, b: Operand) -> Register:
        """A single operation."""
        return self._aged(self.new(REAL, f"{operation} double {_real(a)}, {_real(b)}"), a, b)

    def total(self, products: Sequence[Pair]) -> Operand:
        """A sum of products: old ones in independent strands, the newest one last, which shortens
        the critical path."""
        terms = [(a, b) for a, b in products if a != 0.0 and b != 0.0]
        terms.sort(key=lambda term: max(map(self.age, term)))
        old, new = terms[:-2], terms[-2:]
        strands = [old[i::_STRANDS] for i in range(_STRANDS)] if len(old) > _STRANDS else None
        sums = list[Operand]()
        for strand in [[term] for term in old] if strands is None else strands:
            s: Operand = 0.0
            for a, b in strand:
                s = self.fused(a, b, s)
            sums.append(s)
        while len(sums) > 1:
            pairs = [sums[i : i + 2] for i in range(0, len(sums), 2)]
            sums = [self.add(*pair) if len(pair) == 2 else pair[0] for pair in pairs]
        s = sums[0] if sums else 0.0
        for a, b in new:
            s = self.fused(*self._unwound(a, b), s)
        return s

    def _unwound(self, a: Operand, b: Operand) -> Pair:
        """A product that does not wait for another product: factors known early are multiplied
        first."""
        if self.age(a) < self.age(b):
            a, b = b, a
        made = self._made.get(a, ())
        if len(made) == 2 and self.age(a) > self.age(b):
            factor, base = sorted(made, key=self.age)
            if self.age(base) > self.age(factor):
                return base, self.times(factor, b)
        return a, b

    def scaled(self, a: Operand, factor: Operand) -> Operand:
        """A value times something known long ago, without waiting for a sum."""
        made = self._made.get(a, ())
        if len(made) == 3:
            x, y, rest = made
            x, y = sorted((x, y), key=self.age)
            return self.fused(y, self.times(x, factor), self.times(rest, factor))
        return self.times(*self._unwound(a, factor))

    def function(self, name: str, *given: Operand) -> Register:
        """The value of a function of reals, of LLVM or of C's mathematical library."""
        return self._aged(self.outside(REAL, name, *(of_type(REAL, x) for x in given)), *given)

    # -- tests and choices -------------------------------------------------------------------------

    def test(self, how: str, a: Operand, b: Operand) -> Register:
        """A comparison of reals."""
        return self.new(BIT, f"fcmp {how} double {_real(a)}, {_real(b)}")

    def both(self, a: Register, b: Register) -> Register:
        """Whether two tests hold."""
        return self._of_tests("and", a, b)

    def either(self, a: Register, b: Register) -> Register:
        """Whether one of two tests holds."""
        return self._of_tests("or", a, b)

    def fails(self, test: Register) -> Register:
        """Whether a test does not hold."""
        return self._of_tests("xor", test, operand(True))

    def _of_tests(self, operation: str, a: Register, b: Register) -> Register:
        operands = f"{of_type(BIT, a).name}, {of_type(BIT, b).name}"
        return self.new(BIT, f"{operation} i1 {operands}")

    def select(self, test: Register, a: Operand, b: Operand) -> Operand:
        """The first of two reals if a condition holds, else the second."""
        if a == b:
            return a
        operands = f"{of_type(BIT, test).typed}, double {_real(a)}, double {_real(b)}"
        return self._aged(self.new(REAL, f"select {operands}"), a, b)

    # -- whole numbers, memory, control ------------------------------------------------------------

    def count(self, operation: str, a: Count, b: Count) -> Register:
        """Arithmetic of whole numbers."""
        return self.new(WHOLE, f"{operation} i64 {_whole(a)}, {_whole(b)}")

    def compare(self, how: str, a: Count, b: Count) -> Register:
        """A comparison of whole numbers."""
        return self.new(BIT, f"icmp {how} i64 {_whole(a)}, {_whole(b)}")

    def as_real(self, n: Register) -> Register:
        """A whole number as a real one."""
        return self.new(REAL, f"sitofp {of_type(WHOLE, n).typed} to double")

    def read(self, base: Register, index: Count) -> Register:
        """A real number in memory, at an offset from an address."""
        return self.load(REAL, self.at(base, index, REAL))

    def write(self, value: Operand, address: Register) -> None:
        """Put a real at an address."""
        self.store(of_type(REAL, value), address)

    def kernel(self, kernel: Kernel, *given: Operand | Count) -> Register:
        """The result of a function of the engine.

        Parameters
        ----------
        given : numbers, registers
            For a vector its address; for a matrix also the length of its rows.
        """
        left, operands = iter(given), list[Register]()
        types, result = _types(kernel)
        for type_ in types:
            first = of_type(POINTER if isinstance(type_, ArrayType) else type_.llvm, next(left))
            if isinstance(type_, ArrayType):
                lengths = (of_type(WHOLE, next(left)) for _ in range(type_.axes - 1))
                first = self.structure(type_.llvm, [first, operand(0), *lengths])
            operands.append(first)
        return self.outside(result.llvm, kernel.symbol, *operands, convention=FASTCC)

    def leave(self, test: Register, result: int) -> None:
        """Return a whole number if a test holds."""
        there, on = self.label("leave"), self.label("stay")
        self.choose(test, there, on)
        self.begin(there)
        self.end(f"ret {operand(result).typed}")
        self.begin(on)

    def loop(
        self,
        low: Count,
        high: Count,
        body: Callable[..., Sequence[Operand | Count] | None],
        *first: Operand | Count,
        going: int | None = None,
    ) -> list[Register]:
        """Execute a body for all integers from `low` to before `high`; returns the final values of
        the carried variables.

        Parameters
        ----------
        body : callable
            Takes the number and the carried values; returns their new ones.
        first : numbers, registers
            The carried values at the beginning.
        going : int, optional
            Which of the carried values, a truth value, has to hold for the loop to go on.
        """
        header, inside, after = map(self.label, ("loop", "inside", "after"))
        start = [of_type(WHOLE, low), *map(operand, first)]
        before = self.block
        known = dict(self._once)
        self.begin(header)
        place = len(self.lines)
        index, *values = (self.new(x.type, "phi") for x in start)
        test = self.compare("slt", index, high)
        self.choose(test if going is None else self.both(test, values[going]), inside, after)
        self.begin(inside)
        changed = body(index, *values) or []
        ends = [self.count("add", index, 1), *changed]
        last = self.block
        self.go(header)
        for i, (x, y) in enumerate(zip(start, ends, strict=True)):
            sources = f"[ {x}, %{before} ], [ {of_type(x.type, y)}, %{last} ]"
            self.lines[place + i] += f" {x.type} {sources}"
        self.begin(after)
        # Values made inside the loop do not exist if it is never entered.
        self._once = known
        return values
