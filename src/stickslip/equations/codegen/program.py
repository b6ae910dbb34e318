"""The tape of a system as arrays, for compiled code that interprets it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import IntMatrix, IntVector, Vector
from stickslip.equations.codegen.layout import MATRICES, Layout
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.tape import Instruction, Op, Scaled, rows_made, rows_read

# Columns of a row of code: operation, row of the result, operands, place, size.
OPERATION, RESULT, FIRST, SECOND, THIRD, FOURTH, FIFTH, PLACE, SIZE = range(9)
_WIDTH = 9
_HIDING = frozenset(
    {Op.QUOTIENT, Op.RECIPROCAL, Op.POWER, Op.EXP, Op.LOG, Op.ROTATION, Op.HYPERBOLIC}
    | {Op.CHAIN, Op.TAN, Op.TANH, Op.WITHIN, Op.DIRECTION}
)
"""Operations whose series may be too small to be seen where a step begins, and yet matter where it
ends."""
_MOST_DEGREE = 8  # largest degree of a polynomial that a series of every order shows


class Program(NamedTuple):
    """A tape, packed.

    Attributes
    ----------
    code : array of int, shape (instructions, 9)
        By the columns from `OPERATION` to `SIZE`; see :class:`stickslip.symbolic.tape.Op`. The
        operands of LINEAR and of RATES (its second and third) are where a list of terms begins and
        its length, and the fourth of RATES and second of SOLVE say which inverse; SELECT, POWER
        (its second), ENTRY (its fourth) and CHAIN (its third, −1: none) name the place of their
        first term.
    term_row : array of int
        Row of a term, −1 for a constant.
    term_factor : array of int
        Where its factor stands: K[i], or numbers[−1 − i]; of an entry of a matrix, its place there.
    hiding : array of int
        1 for each instruction that may hide something.
    leading : array of int, shape (1,)
        So many instructions are enough for those.
    seen : array of int
        Parts of the state that those depend on.
    rates, rate_sizes : arrays of int
        Rows of the rates of the state, and places of the sizes of their terms in ``mag``, −1: none.
    """

    code: IntMatrix
    term_row: IntVector
    term_factor: IntVector
    numbers: Vector
    hiding: IntVector
    leading: IntVector
    seen: IntVector
    rates: IntVector
    rate_sizes: IntVector


def pack(layout: Layout) -> Program:
    """Pack a tape into arrays: first the instructions that the discs of the step control need."""
    hiding = _hiding(layout)
    needed = _needed(layout.instructions, hiding)
    ordered = [i for i in layout.instructions if i in needed] + [
        i for i in [*layout.instructions, *layout.shown] if i not in needed
    ]
    read = {row for i in needed for row in rows_read(i)}
    packer = _Packer(layout.constants)
    code = [packer.packed(i) for i in ordered]
    return Program(
        code=np.array(code, dtype=np.int64).reshape(-1, _WIDTH),
        term_row=np.array(packer.rows, dtype=np.int64),
        term_factor=np.array(packer.factors, dtype=np.int64),
        numbers=np.array(packer.numbers, dtype=float),
        hiding=np.array([i in hiding for i in ordered], dtype=np.int64),
        leading=np.array([len(needed)]),
        seen=np.array([r for r in range(len(layout.state)) if r in read], dtype=np.int64),
        rates=np.array(layout.rates, dtype=np.int64),
        rate_sizes=layout.rate_sizes,
    )


def _hiding(layout: Layout) -> set[Instruction]:
    """Instructions that may hide something: those of :data:`_HIDING`, and products of a high
    degree."""
    degree = dict.fromkeys(range(len(layout.state) + 1), 1)
    found = set()
    for i in layout.instructions:
        degrees = [degree[row] for row in rows_read(i)]
        # A product of a series that is seen with itself: the lowest order may be the highest that
        # is there.
        own = (
            sum(degrees)
            if i.op is Op.PRODUCT
            else 1
            if i.op in _HIDING
            else max(degrees, default=0)
        )
        if i.op in _HIDING or (i.op is Op.PRODUCT and own > _MOST_DEGREE):
            found.add(i)
        degree |= dict.fromkeys(rows_made(i), own)
    return found


def _needed(instructions: list[Instruction], hiding: set[Instruction]) -> set[Instruction]:
    """The given instructions and all instructions that they depend on."""
    needed, wanted = set(), set()
    for i in reversed(instructions):
        if i in hiding or any(row in wanted for row in rows_made(i)):
            needed.add(i)
            wanted |= set(rows_read(i))
    return needed


class _Packer:
    """Places of terms and numbers while a tape is packed."""

    def __init__(self, slots: dict[Expr, int]) -> None:
        self.slots = slots
        self.rows: list[int] = []
        self.factors: list[int] = []
        self.numbers: list[float] = []

    def term(self, part: Scaled) -> int:
        """Note a term; returns its place."""
        if part.factor.op == "num":
            self.numbers.append(ex.number(part.factor))
            factor = -len(self.numbers)
        else:
            factor = self.slots[part.factor]
        self.rows.append(-1 if part.row is None else part.row)
        self.factors.append(factor)
        return len(self.rows) - 1

    def packed(self, i: Instruction) -> list[int]:
        """An instruction as whole numbers."""
        operands = list(i.inputs)
        start = len(self.rows)
        if i.op is Op.RATES:
            changing = [(entry.row, j) for j, entry in enumerate(i.entries) if entry.inputs]
            self.rows += [row for row, _ in changing]
            self.factors += [j for _, j in changing]
            operands += [start, len(changing), MATRICES.index(i.matrix)]
        elif i.op is Op.SOLVE:
            operands.append(MATRICES.index(i.matrix))
        elif i.op in (Op.LINEAR, Op.SELECT):
            operands += [start, len([self.term(part) for part in i.parts])]
        elif i.op is Op.POWER:
            operands = [i.inputs[0], self.term(i.parts[0])]
        elif i.op is Op.ENTRY:
            operands.append(self.term(i.parts[0]))
        elif i.op is Op.CHAIN:
            operands.append(self.term(i.parts[0]) if i.parts else -1)
        elif i.op in (Op.SIZE, Op.IMPLICIT):
            operands = []
        return [int(i.op), i.row, *operands, *[0] * (5 - len(operands)), i.place, i.size]
