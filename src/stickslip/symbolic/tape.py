"""Lowering of expressions to a tape of rows of Taylor coefficients.

A row holds the Taylor coefficients of one quantity along the motion; every instruction gives its
k-th coefficient from coefficients of order at most k of earlier rows. A value that depends on
parameters only is a constant ``K[i]``.

The tape is data, made from the expression tree alone. It is written down as machine code
(:mod:`stickslip.equations.native`), and packed into arrays
(:mod:`stickslip.equations.codegen.program`), which the engine interprets where it asks other
questions of the same equations: how large can a row become, is it affine? What is needed at one
instant alone is lowered to scalars.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cache

from stickslip.symbolic import expressions as ex
from stickslip.symbolic.enclosures import slope_of_function
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS, Function
from stickslip.symbolic.intervals import FLOATS
from stickslip.symbolic.scalars import ParameterExpressions, Scalar


class Op(IntEnum):
    """Operation of an instruction; see :class:`Instruction` for its operands."""

    LINEAR = 0
    PRODUCT = 1
    QUOTIENT = 2
    RECIPROCAL = 3
    POWER = 4
    EXP = 5
    LOG = 6
    ROTATION = 7
    STEADY = 8
    HYPERBOLIC = 9
    CHAIN = 10
    TAN = 11
    TANH = 12
    SELECT = 13
    SIDE = 14
    SPEED = 15
    ENTRY = 16
    RIGHT = 17
    SOLVE = 18
    RATES = 19
    SIZE = 20
    IMPLICIT = 21
    WITHIN = 22
    DIRECTION = 23


DIRECTION_GIVEN = 3
"""Mode of a contact in a plane whose direction of slip is given."""
OUTPUTS = {Op.ROTATION: 2, Op.STEADY: 2, Op.HYPERBOLIC: 2, Op.TAN: 2, Op.TANH: 2, Op.DIRECTION: 3}
"""How many rows an operation fills, if not one."""


@dataclass(frozen=True)
class Scaled:
    """A quantity as constant × row; without row it is the constant itself."""

    factor: Expr
    row: int | None = None


@dataclass(frozen=True)
class Instruction:
    """One instruction of the tape.

    Attributes
    ----------
    op : Op
        LINEAR is the sum of the parts; PRODUCT, QUOTIENT, RECIPROCAL, EXP, LOG of the inputs. POWER
        has a constant exponent, its only part, and may have as second input the SIZE of its base:
        the sum of the moduli of the parts at order 0, of which the base is known up to rounding
        only. ROTATION, STEADY (of a phase affine in time) and HYPERBOLIC fill the row and the next
        one, (co)sines of the input. CHAIN is any other function: its second input is the row of its
        slope, and its part the most that this is for real arguments, if it is bounded. TAN, TANH
        fill the row of their slope as the next row. SELECT takes the first part where the region
        `place` is 1, the second elsewhere. SIDE is the right-hand side of contact `place` (inputs:
        surface; friction for u > 0, u < 0; thresholds for u > 0, u < 0), SPEED its |u|. ENTRY (of
        the matrix) and RIGHT belong to the linear problem of the rate-independent coordinates,
        whose contact is `place`. RATES solves `size` equations whose matrix changes on the way, and
        leaves the inverse of order 0 in the rows of `matrix` from `place` on: those of the
        rate-independent coordinates, or of inertial ones. SOLVE applies `size` rows of the inverse
        `matrix`, from `place` on, to as many rows that begin with the input. IMPLICIT is a rate
        that solves an equation: at order 0 the zero of `zero`, an increasing function of the row
        (and its slope); at the others the integral of its input, which comes later. The `place`
        instructions behind it make that function and its slope as rows; WITHIN, with these as
        inputs, makes no series, but bounds the deviation of the rate. DIRECTION makes of a vector,
        its inputs but the last, the direction in slip and, as last row, the modulus; in stick, and
        where a contact that presses it is open, the direction is that of its parts, zero if there
        are none, and the modulus zero. Where the modulus is zero up to rounding (the last input is
        the size of its terms), and where the mode of contact `place` is `DIRECTION_GIVEN`, its rows
        stay what they are, but that the modulus is 0 in the first case.
    row : int
        Where the result goes (the first row of several).
    function : str
        Of the table, for CHAIN, TAN and TANH.
    entries : tuple of Instruction
        Of RATES: the entries of its matrix, row by row. Those that change along the motion have
        inputs and a row of their own, the others four constants: in stick; in slip a sum of the
        second and, with its sign, the third (u > 0) or the fourth (u < 0).
    zero : tuple of Scalar
        Of IMPLICIT: the function and its slope.
    definite : int
        Of RATES: so many leading rows and columns have to be positive definite.
    shared : bool
        Of RATES: whether forces in it may be shared, as negative entries on the diagonal say
        (:func:`stickslip.equations.codegen.series.shared_inverse`).
    pressed : tuple of int
        Of DIRECTION: the contacts whose normal forces are in the friction.
    """

    op: Op
    row: int
    inputs: tuple[int, ...] = ()
    parts: tuple[Scaled, ...] = ()
    place: int = 0
    size: int = 0
    matrix: str = ""
    function: str = ""
    entries: tuple[Instruction, ...] = ()
    zero: tuple[Scalar, ...] = ()
    definite: int = 0
    shared: bool = False
    pressed: tuple[int, ...] = ()


def rows_read(i: Instruction) -> list[int]:
    """Rows that an instruction depends on."""
    if i.op is Op.IMPLICIT:
        # its slope is one order lower
        return list(i.inputs[1:])
    rows = [*i.inputs, *(part.row for part in i.parts if part.row is not None)]
    rows += [entry.row for entry in i.entries if entry.inputs]
    if i.op in (Op.SOLVE, Op.RATES):
        rows += range(i.inputs[0], i.inputs[0] + i.size)
    return rows


def rows_made(i: Instruction) -> range:
    """Rows that an instruction fills."""
    return range(i.row, i.row + (i.size or OUTPUTS.get(i.op, 1)))


class Tape:
    """Rows and instructions for a set of expressions.

    Attributes
    ----------
    instructions : dict of int to list of Instruction
        By stage: what needs no rates, what needs those of viscous coordinates, those of
        rate-independent ones, all.
    """

    def __init__(
        self,
        constants: ParameterExpressions,
        rows: Mapping[str, int],
        first_free: int,
        regions: Mapping[Expr, int],
    ) -> None:
        self.constants, self.regions = constants, regions
        self.names = dict(rows)
        self.rows = first_free
        self.stage = dict.fromkeys(rows.values(), 0)
        self.instructions: dict[int, list[Instruction]] = {0: [], 1: [], 2: [], 3: []}
        self._known: dict[Expr, Scaled] = {}
        self._own: dict[Expr, int] = {}
        self._products: dict[tuple[int, int], int] = {}
        self._reciprocals: dict[int, int] = {}
        self._powers: dict[tuple[int, Expr], int] = {}
        self._pairs: dict[tuple[Op, Expr], int] = {}
        self._made: dict[int, Instruction] = {}

    def new_row(self, stage: int = 0) -> int:
        """A fresh row that becomes known at a stage."""
        self.stage[self.rows] = stage
        self.rows += 1
        return self.rows - 1

    def name(self, symbol: str, row: int, stage: int) -> None:
        """Assign a symbol to a row."""
        self.names[symbol] = row
        self.stage[row] = stage

    def emit(self, stage: int, instruction: Instruction) -> None:
        """Add an instruction; its constants get their places."""
        for part in [
            *instruction.parts,
            *(part for i in instruction.entries for part in i.parts),
        ]:
            self.constants.scalar(part.factor)
        self._made.setdefault(instruction.row, instruction)
        self.instructions[stage].append(instruction)

    def lower(self, e: Expr) -> Scaled:
        """Make the expression available as a scaled row."""
        if e not in self._known:
            self._known[e] = Scaled(e) if self.constants.is_constant(e) else self._lower(e)
        return self._known[e]

    def row(self, e: Expr) -> int:
        """Make the expression available as a separate row."""
        scaled = self.lower(e)
        if scaled.row is not None and scaled.factor is ex.ONE:
            return scaled.row
        if e not in self._own:
            self._own[e] = self.assign([scaled], None)
        return self._own[e]

    def into(self, e: Expr, row: int) -> int:
        """Write the expression to a given row; returns its stage."""
        self.assign([self.lower(e)], row)
        return self.stage[row]

    def assign(self, parts: list[Scaled], row: int | None, constant: Expr = ex.ZERO) -> int:
        """Row of a linear combination."""
        dynamic = [p for p in parts if p.row is not None]
        constant = ex.add((constant, 1.0), *((p.factor, 1.0) for p in parts if p.row is None))
        stage = max([self.stage[p.row] for p in dynamic if p.row is not None], default=0)
        row = self.new_row(stage) if row is None else row
        self.stage[row] = stage
        fixed = [Scaled(constant)] if constant is not ex.ZERO else []
        self.emit(stage, Instruction(Op.LINEAR, row, parts=(*dynamic, *fixed)))
        return row

    def operation(
        self, op: Op, *inputs: int, parts: tuple[Scaled, ...] = (), function: str = ""
    ) -> int:
        """Row of an operation on rows (the first, if it fills several)."""
        stage = max(self.stage[i] for i in inputs)
        row = self.new_row(stage)
        for _ in range(OUTPUTS.get(op, 1) - 1):
            self.new_row(stage)
        self.emit(stage, Instruction(op, row, inputs, parts, function=function))
        return row

    def _lower(self, e: Expr) -> Scaled:
        line = self.constants.affine_in_time(e)
        if line is not None:
            return self._line(*line)
        match e.op:
            case "sym":
                return Scaled(ex.ONE, self.names[str(e.value)])
            case "sum":
                return self._sum(e)
            case "prod":
                return self._product(e)
            case "pow":
                base, exponent = e.args
                if self.constants.is_constant(exponent):
                    return Scaled(ex.ONE, self._real_power(base, exponent))
                return self.lower(ex.call("exp", exponent * ex.call("log", base)))
            case "select":
                return self._select(e)
        return Scaled(ex.ONE, self._function(e))

    def _line(self, rate: Expr, value: Expr) -> Scaled:
        """Time since the origin times a rate, plus a value."""
        clock = Scaled(rate, self.names["t"])
        return clock if value is ex.ZERO else Scaled(ex.ONE, self.assign([clock], None, value))

    def _sum(self, e: Expr) -> Scaled:
        constant, rate, others = self.constants.split(e)
        parts = [Scaled(rate, self.names["t"])] if rate is not ex.ZERO else []
        for term, c in others:
            part = self.lower(term)
            parts.append(Scaled(c * part.factor, part.row))
        if constant is ex.ZERO and len(parts) == 1:
            return parts[0]
        return Scaled(ex.ONE, self.assign(parts, None, constant))

    def _product(self, e: Expr) -> Scaled:
        factor = ex.ONE
        above = list[int]()
        below = list[int]()
        for base, p in e.terms:
            if self.constants.is_constant(base):
                factor = factor * ex.power(base, ex.num(p))
            elif p.is_integer():
                scaled = self.lower(base)
                assert scaled.row is not None
                factor = factor * ex.power(scaled.factor, ex.num(p))
                if p == -1.0:
                    below.append(scaled.row)
                else:  # the power of a reciprocal, which does not overflow where the power does
                    row = scaled.row if p > 0.0 else self._reciprocal(scaled.row)
                    above.append(self._whole_power(row, int(abs(p))))
            else:
                above.append(self._real_power(base, ex.num(p)))
        numerator, denominator = self._chain(above), self._chain(below)
        if denominator is None:
            return Scaled(factor, numerator)
        if numerator is None:
            return Scaled(factor, self._reciprocal(denominator))
        return Scaled(factor, self.operation(Op.QUOTIENT, numerator, denominator))

    def _reciprocal(self, row: int) -> int:
        """Row of the reciprocal of a row, made once."""
        if row not in self._reciprocals:
            self._reciprocals[row] = self.operation(Op.RECIPROCAL, row)
        return self._reciprocals[row]

    def _real_power(self, base: Expr, exponent: Expr) -> int:
        row = self.row(base)
        if (row, exponent) in self._powers:
            return self._powers[row, exponent]
        terms = self._terms(row)
        # A base that is a difference may be zero up to rounding, where a power has few derivatives.
        size = [] if terms == [Scaled(ex.ONE, row)] else [self.size(terms)]
        made = self.operation(Op.POWER, row, *size, parts=(Scaled(exponent),))
        self._powers[row, exponent] = made
        return made

    def _terms(self, row: int) -> list[Scaled]:
        """Terms whose sum is a row, in every region."""
        made = self._made.get(row)
        if made is not None and made.op is Op.SELECT:
            return [
                term
                for part in made.parts
                for term in ([part] if part.row is None else self._terms(part.row))
            ]
        return (
            list(made.parts) if made is not None and made.op is Op.LINEAR else [Scaled(ex.ONE, row)]
        )

    def size(self, terms: list[Scaled]) -> int:
        """Row of the sum of the moduli of terms."""
        stage = max([self.stage[term.row] for term in terms if term.row is not None], default=0)
        row = self.new_row(stage)
        self.emit(stage, Instruction(Op.SIZE, row, parts=tuple(terms)))
        return row

    def _whole_power(self, row: int, n: int) -> int:
        """Row of the n-th power of a row, by squaring: also where the row passes through zero."""
        if n == 1:
            return row
        half = self._whole_power(row, n // 2)
        square = self._times(half, half)
        return self._times(square, row) if n % 2 else square

    def _times(self, a: int, b: int) -> int:
        """Row of a product of two rows, made once."""
        key = (min(a, b), max(a, b))
        if key not in self._products:
            self._products[key] = self.operation(Op.PRODUCT, *key)
        return self._products[key]

    def _chain(self, rows: list[int]) -> int | None:
        """Row of a product of rows, sharing the partial products."""
        if not rows:
            return None
        result, *others = sorted(rows)
        for other in others:
            result = self._times(result, other)
        return result

    def _select(self, e: Expr) -> Scaled:
        place, above, below = ex.branches_of(e, self.regions)
        parts = self.lower(above), self.lower(below)
        stage = max((self.stage[x.row] for x in parts if x.row is not None), default=0)
        row = self.new_row(stage)
        self.emit(stage, Instruction(Op.SELECT, row, parts=parts, place=place))
        return Scaled(ex.ONE, row)

    def _function(self, e: Expr) -> int:
        (x,) = e.args
        row = FUNCTIONS[e.op]
        op = Op[row.recurrence.upper()]
        a = self._phase(e)
        match op:
            case Op.ROTATION | Op.HYPERBOLIC:
                return self._pair(op, x, a) + (0 if row.parity == "odd" else 1)
            case Op.CHAIN:
                slope = self.row(ex.at(row.slope, x))
                return self.operation(op, a, slope, parts=_steepest(row), function=row.name)
        return self.operation(op, a, function=row.name)

    def _phase(self, e: Expr) -> int:
        """Row of the argument of a function, which may be a phase."""
        split = self.constants.phase(e)
        if split is None:
            return self.row(e.args[0])
        constant, rate, others = split
        scaled = [(c, self.lower(term)) for term, c in others]
        parts = [
            Scaled(rate, self.names["t"]),
            *(Scaled(c * part.factor, part.row) for c, part in scaled),
        ]
        return self.assign(parts, None, constant)

    def _pair(self, op: Op, x: Expr, a: int) -> int:
        """First row of a (hyperbolic) sine and cosine, made together."""
        family = op
        if op is Op.ROTATION and self.constants.affine_in_time(x) is not None:
            family = Op.STEADY
        if (family, x) not in self._pairs:
            self._pairs[family, x] = self.operation(family, a)
        return self._pairs[family, x]


@cache
def _steepest(row: Function) -> tuple[Scaled, ...]:
    """The most that the slope of a function is for real arguments, if it is bounded, up to
    rounding."""
    low, high = slope_of_function(row, row.domain, FLOATS)
    most = max(-low, high)
    return (Scaled(ex.num(float(f"{most:.15g}"))),) if most < math.inf else ()
