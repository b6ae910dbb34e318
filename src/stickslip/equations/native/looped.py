"""Series with a loop over the orders, for systems whose unrolled code would be too long."""

from __future__ import annotations

from typing import Any

from stickslip.equations.codegen.layout import ORDERS, Generated
from stickslip.equations.native.arithmetic import Operand, Pair
from stickslip.equations.native.kernels import (
    applied,
    cauchy,
    chained,
    powered,
)
from stickslip.equations.native.orders import SMALL_MATRIX, WRITERS, Order, Series
from stickslip.equations.native.tables import (
    FEWEST_REPETITIONS,
    Pattern,
    Tabled,
    filled_instruction,
    grouped,
    pattern_of_instruction,
)
from stickslip.kept import cached_property
from stickslip.machine_code.functions import Kernel
from stickslip.symbolic.tape import (
    OUTPUTS,
    Instruction,
    Op,
    rows_made,
    rows_read,
)
from stickslip.translator.assembly import REAL, Register

_MOST_PRODUCTS = 4000  # products that are unrolled: compiling more of them takes too long


class LoopedSeries(Tabled, Series):
    """The same series with coefficients in memory, a loop over the orders, and loops over repeated
    instructions."""

    unit: Operand
    after: Register
    real: Register

    def all_orders(self) -> None:
        """Write the function: order 0, then the loop over the other orders."""
        self.unit = self.load(REAL, self.place("W", self.clock, 1))
        self.loop(0, self.clock, self._start)
        self.put(self.clock, 0, self.arguments["t"])
        self.order(0)
        self._integrate(0, 1, self.unit)
        self.statements(self.generated.sizes)
        start = {place: x for place, x in self.known.items() if place[1] == 0}

        def body(k: Register) -> None:
            self.known = dict(start)
            self.after = self.count("add", k, 1)
            self.real = self.as_real(k)
            following = self.as_real(self.after)
            self.order(k)
            self._integrate(k, self.after, self.over(self.unit, following))

        self.loop(1, self.arguments["N"], body)
        self.end("ret i64 0")

    def _start(self, i: Register) -> None:
        """Order 0 of the state."""
        value = self.read(self.data("y"), i)
        self.write(value, self.row("W", i))

    @cached_property
    def groups(self) -> list[tuple[Instruction, list[Pattern]]]:
        """Groups of independent instructions that differ only in their numbers: one instruction for
        all, with these numbers. Small groups are not merged."""
        tape = self.layout.instructions
        patterns = [pattern_of_instruction(i, self.constants, self.clock) for i in tape]
        known = dict[int, int]()
        levels = list[int]()
        for i in tape:
            levels.append(1 + max((known.get(row, 0) for row in rows_read(i)), default=0))
            known |= dict.fromkeys(rows_made(i), levels[-1])
        found = list[tuple[Instruction, list[Pattern]]]()
        for group in grouped(patterns, levels):
            if len(group) < FEWEST_REPETITIONS:
                found += [(tape[i], [patterns[i]]) for i in group]
            else:
                found.append((tape[group[0]], [patterns[i] for i in group]))
        return found

    def order(self, k: Order) -> None:
        """Order k of all rows, group by group."""
        for pattern, repetitions in self.groups:
            if len(repetitions) == 1:
                WRITERS[pattern.op](self, pattern, k)
                continue

            def body(wholes: list[Any], reals: list[Any], pattern: Instruction = pattern) -> None:
                WRITERS[pattern.op](self, filled_instruction(pattern, wholes, reals), k)

            self.repeat(repetitions, body)
        self.show(k)

    def _integrate(self, k: Order, after: Order, step: Operand) -> None:
        """The order after k of the state."""

        def body(wholes: list[Any], _: list[Any]) -> None:
            i, row = wholes
            self.put(i, after, self.times(self.get(row, k), step))

        rows = enumerate(self.layout.rates)
        self.repeat([Pattern(None, [i, row], []) for i, row in rows], body)

    def loop(
        self, low: Any, high: Any, body: Any, *first: Any, going: int | None = None
    ) -> list[Register]:
        """A loop; coefficients that are made inside are in memory after it."""
        known = dict(self.known)
        values = super().loop(low, high, body, *first, going=going)
        self.known = known
        return values

    def get(self, row: int, k: Order) -> Operand:
        """A coefficient: just computed, of order 0, or from memory. Of time, only order 1 differs
        from zero."""
        if (row, k) not in self.known:
            if row == self.clock:
                return self.select(self.compare("eq", k, 1), self.unit, 0.0)
            self.known[row, k] = self.read(self.row("W", row), k)
        return self.known[row, k]

    def put(self, row: int, k: Order, value: Operand) -> None:
        """Make a coefficient known, in memory too."""
        self.known[row, k] = value
        self.write(value, self.at(self.row("W", row), k, REAL))

    def stored(self, row: int, k: Order) -> Operand:
        """Value in the table before a coefficient is stored there."""
        return self.read(self.row("W", row), k)

    def before(self, k: Order) -> Order:
        """k − 1."""
        return self.count("sub", k, 1)

    def along(
        self, sum_of: Kernel, a: int, b: int, k: Register, limits: tuple[int, Register], *p: Operand
    ) -> Register:
        """A sum over orders from memory.

        Parameters
        ----------
        a, b : int
            Rows.
        k : Register
            Order of the sum.
        limits : (int, Register)
            First order of a, and the one after the last.
        p : Operand
            More arguments of the kernel.
        """
        return self.kernel(sum_of, self.row("W", a), self.row("W", b), k, *limits, *p)

    def convolution(self, a: int, b: int, k: Order, low: int) -> list[Pair]:
        """Σ aⱼ bₖ₋ⱼ for low ≤ j ≤ k."""
        if isinstance(k, int):
            return super().convolution(a, b, k, low)
        return [(self.along(cauchy, a, b, k, (low, self.after)), 1.0)]

    def square(self, a: int, k: Order) -> Operand:
        """Order k of a²."""
        return self.total(self.convolution(a, a, k, 0))

    def weighted(self, a: int, b: int, k: Order) -> list[Pair]:
        """Σ j aⱼ bₖ₋ⱼ for 1 ≤ j < k."""
        assert isinstance(k, Register)
        return [(self.along(chained, a, b, k, (1, k)), 1.0)]

    def powered(self, a: int, y: int, p: Operand, k: Order) -> list[Pair]:
        """Σ (j p − (k − j)) aⱼ yₖ₋ⱼ for 1 ≤ j ≤ k."""
        assert isinstance(k, Register)
        return [(self.along(powered, a, y, k, (1, self.after), p), 1.0)]

    def per(self, s: Operand, k: Order) -> Operand:
        """s/k."""
        return self.over(s, self.real)

    def by(self, x: Operand, k: Order) -> Operand:
        """k·x."""
        return self.times(self.real, x)

    def solved(self, matrix: str, place: int, first: int, solution: int, n: int, k: Order) -> None:
        if n <= SMALL_MATRIX:
            super().solved(matrix, place, first, solution, n, k)
        else:
            for i in range(n):
                row, column = self.row(matrix, place + i), self.at(self.row("W", first), k, REAL)
                self.put(solution + i, k, self.kernel(applied, row, column, self.stride("W"), n))


def is_long(generated: Generated) -> bool:
    """Whether the series of a system are too long to be written out."""
    return sum(map(_products, generated.layout.instructions)) > _MOST_PRODUCTS


def series_of(generated: Generated) -> Series:
    """The function ``jets``, written out unless it is too long for that."""
    series = LoopedSeries(generated) if is_long(generated) else Series(generated)
    series.all_orders()
    return series


def _products(i: Instruction) -> int:
    """Products of an operation at all orders, about."""
    last = ORDERS[-1]
    match i.op:
        case Op.SOLVE:
            return last * i.size**2
        case Op.RATES:
            changing = sum(1 for entry in i.entries if entry.inputs)
            return last * i.size**2 + changing * last**2 // 2
        case Op.LINEAR | Op.SELECT | Op.SIZE | Op.SIDE | Op.SPEED | Op.ENTRY | Op.RIGHT | Op.STEADY:
            return last * (1 + len(i.parts))
        case Op.POWER:
            return last**2
        case Op.IMPLICIT | Op.WITHIN:
            return last
    return OUTPUTS.get(i.op, 1) * last**2 // 2
