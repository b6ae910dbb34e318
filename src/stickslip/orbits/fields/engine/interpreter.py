"""An interpreter of expressions in compiled loops: fields, guards and their derivatives at given
points, without code compiled for the system.

The points of a block are evaluated together, so that each instruction is decoded once for all of
them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, IntMatrix, IntVector, Matrix, Vector
from stickslip.equations.codegen.program import FIRST, OPERATION, RESULT, SECOND
from stickslip.machine_code.functions import entry_point
from stickslip.translator import call_address, compiled

LANES = 8  # points of a block
# Operations: a number; a times a number, or added to the result so; a + b, a·b, 1/a, a to a number,
# aᵇ, and a function of a, whose address is the second operand.
CONSTANT, SCALED, SUMMED, SUM, TIMES, RECIPROCAL, POWER, REAL_POWER, CALL = range(9)


class Instructions(NamedTuple):
    """A sequence of operations on a table of values.

    Attributes
    ----------
    code : array of int, shape (instructions, 4)
        By the columns `OPERATION`, `RESULT` (a place), `FIRST` and `SECOND` (operands).
    numbers : array, shape (instructions,)
        The number of each.
    """

    code: IntMatrix
    numbers: Vector


@compiled()
def perform(made: Instructions, first: int, last: int, values: Array, lanes: int) -> None:
    """Execute some instructions.

    Parameters
    ----------
    first, last : int
        Range of the instructions.
    values : array, shape (places, LANES)
        Operands and results.
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
    """Values at many points.

    Parameters
    ----------
    once : int
        Number of instructions whose results are the same for all points.
    wanted : array of int
        Places of the requested values.
    given : array, shape (names, points)
    values : array, shape (places, LANES)
        Work space.
    out : array, shape (wanted, points)
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
