"""An interpreter of expressions, itself compiled: it evaluates fields, guards and their derivatives
at given points without machine code for the system.

Points are evaluated in blocks, so that each instruction is decoded once per block.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, IntMatrix, IntVector, Matrix, Vector
from stickslip.equations.codegen.program import FIRST, OPERATION, RESULT, SECOND
from stickslip.machine_code.functions import entry_point
from stickslip.translator import call_address, compiled

LANES = 8  # number of points in a block
# Operations on operands a and b, with the number c of the instruction: c, c a, adding c a to the
# result, a + b, a b, 1/a, aᶜ, aᵇ, and a function of a, whose address is the second operand.
CONSTANT, SCALED, SUMMED, SUM, TIMES, RECIPROCAL, POWER, REAL_POWER, CALL = range(9)


class Instructions(NamedTuple):
    """A sequence of operations on a table of values.

    Attributes
    ----------
    code : array of int, shape (instructions, 4)
        With the columns `OPERATION`, `RESULT`, `FIRST` and `SECOND`: the operation, and the rows of
        its result and of its operands in the table of values.
    numbers : array, shape (instructions,)
        The number of each instruction.
    """

    code: IntMatrix
    numbers: Vector


@compiled()
def perform(made: Instructions, first: int, last: int, values: Array, lanes: int) -> None:
    """Execute the instructions from `first` to `last`, exclusive.

    Parameters
    ----------
    values : array, shape (places, LANES)
        Table of operands and results, one column for each point.
    lanes : int
        Number of columns in use.
    """
    for i in range(first, last):
        operation = made.code[i, OPERATION]
        out = values[made.code[i, RESULT]]
        a = values[made.code[i, FIRST]]
        number = made.numbers[i]
        if operation == SUMMED:
            for k in range(lanes):
                out[k] += number * a[k]
        elif operation == SCALED:
            for k in range(lanes):
                out[k] = number * a[k]
        elif operation == CONSTANT:
            for k in range(lanes):
                out[k] = number
        elif operation == RECIPROCAL:
            for k in range(lanes):
                out[k] = 1.0 / a[k] if a[k] != 0.0 else np.nan
        elif operation == POWER:
            for k in range(lanes):
                out[k] = a[k] ** number
        elif operation == CALL:
            for k in range(lanes):
                out[k] = call_address(made.code[i, SECOND], a[k])
        else:
            b = values[made.code[i, SECOND]]
            if operation == TIMES:
                for k in range(lanes):
                    out[k] = a[k] * b[k]
            elif operation == SUM:
                for k in range(lanes):
                    out[k] = a[k] + b[k]
            else:
                for k in range(lanes):
                    out[k] = a[k] ** b[k]


@entry_point()
def interpret(
    made: Instructions, once: int, wanted: IntVector, given: Matrix, values: Matrix, out: Matrix
) -> None:
    """Evaluate expressions at many points.

    Parameters
    ----------
    once : int
        Number of instructions, at the beginning, whose results are the same at all points.
    wanted : array of int
        Rows of the requested values in the table.
    given : array, shape (names, points)
        Values of the names, which are the first rows of the table.
    values : array, shape (places, LANES)
        Work space.
    out : array, shape (wanted, points)
        Written.
    """
    names, points = given.shape
    for start in range(0, points, LANES):
        lanes = min(LANES, points - start)
        for i in range(names):
            for k in range(lanes):
                values[i, k] = given[i, start + k]
        if start == 0:
            for i in range(names):
                for k in range(lanes, LANES):
                    values[i, k] = given[i, 0]
            perform(made, 0, once, values, min(points, LANES))
        perform(made, once, len(made.code), values, lanes)
        for i in range(len(wanted)):
            for k in range(lanes):
                out[i, start + k] = values[wanted[i], k]
