"""Storage of discs for the rows of a tape, in compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.program import Program
from stickslip.symbolic.tape import Op
from stickslip.translator import compiled

LINEAR, PRODUCT, QUOTIENT = (int(op) for op in (Op.LINEAR, Op.PRODUCT, Op.QUOTIENT))
LOG, ROTATION, STEADY_ROW, HYPERBOLIC = (
    int(op) for op in (Op.LOG, Op.ROTATION, Op.STEADY, Op.HYPERBOLIC)
)
CHAIN, TAN, TANH = (int(op) for op in (Op.CHAIN, Op.TAN, Op.TANH))
SELECT, SIDE, SPEED, ENTRY, RIGHT, SOLVE, RATES = (
    int(op) for op in (Op.SELECT, Op.SIDE, Op.SPEED, Op.ENTRY, Op.RIGHT, Op.SOLVE, Op.RATES)
)
IMPLICIT_ROW, WITHIN, DIRECTION_ROW = int(Op.IMPLICIT), int(Op.WITHIN), int(Op.DIRECTION)
# Columns of a table of discs: the numbers B and S of a row and the lower bound of its modulus; and,
# for a component of the state, a bound of the deviation of its derivative.
BALL, OFF, AT_LEAST, SLOPE = range(4)


class DiscTape(NamedTuple):
    """The tape of a system, with the values of its rows and their discs.

    Attributes
    ----------
    K : array
        Constants.
    W, discs : arrays
        Values of the rows (order 0), and their discs.
    Rq, Rz, B : arrays
        Inverses of the linear problems.
    balls : array
        Work space of :func:`solve_rate_discs`.
    powers : array
        Of the radius of the discs, in the unit of time of the coefficients.
    order : int
        Of the polynomials that parts of the state are.
    """

    program: Program
    K: Array
    W: Array
    discs: Array
    Rq: Array
    Rz: Array
    B: Array
    balls: Array
    powers: Array
    order: int


@compiled()
def factor(p: Program, K: Array, i: int) -> float:
    """The constant in front of a term."""
    place = p.term_factor[i]
    return float(K[place] if place >= 0 else p.numbers[-1 - place])


@compiled()
def store(W: Array, discs: Array, row: int, ball: float, off: float, near: float) -> None:
    """Store the numbers of a row; NaN bounds become infinite, or zero.

    Parameters
    ----------
    W : array
        Values of the rows (order 0).
    discs : array, shape (rows, 4)
        Receives the numbers.
    ball, off, near : float
        B, S and the lower bound of the modulus.
    """
    discs[row, BALL] = ball if ball < np.inf else np.inf
    discs[row, OFF] = off if off < np.inf else np.inf
    left = abs(W[row, 0]) - discs[row, BALL] - discs[row, OFF]
    discs[row, AT_LEAST] = max(near if near > 0.0 else 0.0, left)


@compiled()
def largest(W: Array, discs: Array, row: int) -> float:
    """The largest modulus that a row may have."""
    return abs(W[row, 0]) + discs[row, BALL] + discs[row, OFF]
