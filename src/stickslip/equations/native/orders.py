"""Operations of the tape as machine code: order k of every row from lower orders.

W[row, k] is the k-th Taylor coefficient of a row (Jorba & Zou 2005, section 2). Written out, each
coefficient is a register, and what is zero is not there; where that would be too long, coefficients
stand in memory and a loop runs over the orders, up to four times as slowly.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from stickslip.equations.codegen.layout import ORDERS, Generated
from stickslip.equations.codegen.series import INDEFINITE, SINGULAR
from stickslip.equations.native.arithmetic import Count, Operand, Pair
from stickslip.equations.native.kernels import (
    inverted,
    is_definite,
    shared,
)
from stickslip.equations.native.routines import Routine
from stickslip.machine_code.functions import Kernel
from stickslip.numerics.levels import ROUNDING
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.scalars import Scalar
from stickslip.symbolic.tape import (
    DIRECTION_GIVEN,
    Instruction,
    Op,
    Scaled,
)
from stickslip.translator.assembly import REAL, Register

_OVERFLOW = 350.0  # exponent above which an exponential counts as infinite
SMALL_MATRIX = 8  # number of rows up to which a matrix is unrolled
# Initial bounds of a search for a zero: the largest number, and the smallest normal number.
_FARTHEST = 1.7976931348623157e308
_NEAREST = 2.2250738585072014e-308
_MOST_TURNS = 240  # iterations of the search for a zero: enough for bisection to machine precision
_SPREAD = 16.0  # ratio of the ends of a bracket below which Newton's method is tried
_NEAR = 1e-9  # relative step of Newton's method after which rounding errors dominate
Order = Count
"""A number, or the register of the loop."""


class Series(Routine):
    """The function ``jets``, written out."""

    def __init__(self, generated: Generated) -> None:
        super().__init__("jets")
        layout = generated.layout
        self.generated = generated
        self.layout = layout
        self.constants = generated.constants
        self.clock = len(layout.state)
        self.kept = frozenset(layout.kept)
        self.known: dict[tuple[Count, Order], Operand] = {}
        self.ready: set[Register] = set()

    def all_orders(self) -> None:
        """Write the whole function."""
        *checkpoints, last = ORDERS
        unit = self.load(REAL, self.place("W", self.clock, 1))
        self.start(unit)
        for k in range(last):
            self.order(k)
            self.integrate(k, self.times(unit, 1.0 / (k + 1)))
            if k == 0:
                self.statements(self.generated.sizes)
            if k + 1 in (1, *checkpoints):
                self.leave(self.compare("eq", self.arguments["N"], k + 1), 0)
        self.end("ret i64 0")

    def start(self, unit: Operand) -> None:
        """Order 0 of the state, and time."""
        for i in range(self.clock):
            self.put(i, 0, self.entry("y", i))
        self.put(self.clock, 0, self.arguments["t"])
        self.known[self.clock, 1] = unit

    def order(self, k: Order) -> None:
        """Order k of all rows."""
        for instruction in self.layout.instructions:
            WRITERS[instruction.op](self, instruction, k)
        self.show(k)

    def show(self, k: Order) -> None:
        """Order 0 of rows that are only shown."""
        for instruction in self.layout.shown if k == 0 else ():
            WRITERS[instruction.op](self, instruction, 0)

    def integrate(self, k: int, step: Operand) -> None:
        """Order k + 1 of the state."""
        for i, row in enumerate(self.layout.rates):
            self.put(i, k + 1, self.scaled(self.get(row, k), step))

    # -- coefficients ------------------------------------------------------------------------------

    def get(self, row: int, k: Order) -> Operand:
        """A coefficient."""
        return self.known.get((row, k), 0.0)

    def put(self, row: int, k: Order, value: Operand) -> None:
        """Make a coefficient known; rows that are read are stored, too."""
        if isinstance(value, Register) and value not in self.ready:
            self.known_now(value)
            self.ready.add(value)
        self.known[row, k] = value
        if k == 0 or row in self.kept:
            self.write(value, self.place("W", row, k))

    def stored(self, row: int, k: Order) -> Operand:
        """Value in the table before a coefficient is stored there."""
        return self.load(REAL, self.place("W", row, k))

    def entry(self, name: str, *index: Count) -> Operand:
        """An entry of an array; coefficients of order 0 are known."""
        if name == "W" and (index[0], 0) in self.known:
            return self.known[index[0], 0]
        return super().entry(name, *index)

    def factor(self, part: Scaled) -> Operand:
        """The factor of a term."""
        factor = part.factor
        return self.scalar(self.constants.scalar(factor) if isinstance(factor, Expr) else factor)

    def linear(self, parts: tuple[Scaled, ...], k: Order) -> Operand:
        """Order k of a linear combination."""
        terms = [(self.factor(p), self.get(p.row, k)) for p in parts if p.row is not None]
        if k == 0:
            terms += [(self.factor(p), 1.0) for p in parts if p.row is None]
        return self.total(terms)

    def prepare(self, values: tuple[Scalar, ...], row: int) -> None:
        """Compute the parts that are common to all rows of an instruction."""
        depends = dict[Scalar, bool]()

        def visit(value: Scalar) -> bool:
            if value not in depends:
                parts = [visit(part) for part in value.args]
                own = value.op == "entry" and (value.name, value.index) == ("W", (row, 0))
                depends[value] = own or any(parts)
                if not depends[value]:
                    self.scalar(value)
            return depends[value]

        for value in values:
            visit(value)

    # -- sums over orders --------------------------------------------------------------------------

    def before(self, k: Order) -> Order:
        """k − 1."""
        assert isinstance(k, int)
        return k - 1

    def convolution(self, a: int, b: int, k: Order, low: int) -> list[Pair]:
        """Terms of Σ aⱼ bₖ₋ⱼ for low ≤ j ≤ k."""
        assert isinstance(k, int)
        return [(self.get(a, j), self.get(b, k - j)) for j in range(low, k + 1)]

    def square(self, a: int, k: Order) -> Operand:
        """Order k of a²: each pair of terms once."""
        assert isinstance(k, int)
        terms = [
            (self._multiple(2.0, self.get(a, j)), self.get(a, k - j)) for j in range((k + 1) // 2)
        ]
        if k % 2 == 0:
            terms.append((self.get(a, k // 2), self.get(a, k // 2)))
        return self.total(terms)

    def _multiple(self, factor: float, x: Operand) -> Operand:
        if isinstance(x, float):
            return factor * x
        return self.once((factor, x), lambda: self.times(factor, x))

    def chain(self, a: int, slope: int, k: Order) -> Operand:
        """Order k ≥ 1 of y with y′ = g·a′; the newest coefficient comes last, in one multiplication
        and one addition."""
        s = self.total(self.weighted(a, slope, k))
        return self.total([(self.per(s, k), 1.0), (self.get(a, k), self.get(slope, 0))])

    def weighted(self, a: int, b: int, k: Order) -> list[Pair]:
        """Terms of Σ j aⱼ bₖ₋ⱼ for 1 ≤ j < k."""
        assert isinstance(k, int)
        return [(self._multiple(float(j), self.get(a, j)), self.get(b, k - j)) for j in range(1, k)]

    def powered(self, a: int, y: int, p: Operand, k: Order) -> list[Pair]:
        """Terms of Σ (j p − (k − j)) aⱼ yₖ₋ⱼ for 1 ≤ j ≤ k."""
        assert isinstance(k, int)
        terms = list[Pair]()
        for j in range(1, k + 1):
            weight = self.fused(float(j), p, float(j - k))
            terms.append((self.times(weight, self.get(a, j)), self.get(y, k - j)))
        return terms

    def per(self, s: Operand, k: Order) -> Operand:
        """s/k."""
        assert isinstance(k, int)
        return self.scaled(s, 1.0 / k)

    def by(self, x: Operand, k: Order) -> Operand:
        """k·x."""
        assert isinstance(k, int)
        return self._multiple(float(k), x)

    def divided(self, terms: list[Pair], above: Operand, below: int, k: Order) -> Operand:
        """(above − Σ terms)/b₀; zero if b has overflowed."""
        b = self.get(below, 0)
        rest = self.total([(above, 1.0), *((self.negative(x), y) for x, y in terms)])
        return self.select(self.overflown(b), 0.0, self.over(rest, b))

    def overflown(self, b: Operand) -> Register:
        """Whether a value is infinite."""
        return self.once(("inf", b), lambda: self.test("oeq", self.modulus(b), math.inf))

    def solved(self, matrix: str, place: int, first: int, solution: int, n: int, k: Order) -> None:
        """Order k of solution = R·right-hand side, both n consecutive rows.

        Parameters
        ----------
        matrix : str
            Which inverse R is.
        place : int
            Its first row.
        first, solution : int
            First rows of the right-hand side and of the solution.
        """
        for i in range(n):
            self.put(solution + i, k, self.total(self.row_of(matrix, place + i, first, n, k)))

    def row_of(self, matrix: str, i: int, first: int, n: int, k: Order) -> list[Pair]:
        """Terms of one row of the solution: row i of the inverse times n rows."""
        return [(self.inverse(matrix, i, j), self.get(first + j, k)) for j in range(n)]

    def inverse(self, matrix: str, i: Count, j: int) -> Operand:
        """An entry of an inverse."""
        return self.once(("inverse", matrix, i, j), lambda: Routine.entry(self, matrix, i, j))

    def spread(self, matrix: str, i: Count, n: int, base: Any) -> Operand:
        """Σⱼ |Rᵢⱼ| mag[base + j]."""
        if n > SMALL_MATRIX:
            return super().spread(matrix, i, n, base)
        terms = [
            (self.modulus(self.inverse(matrix, i, j)), self.entry("mag", base + j))
            for j in range(n)
        ]
        return self.total(terms)

    def first_exp(self, x: Operand) -> Operand:
        """exp x, infinite before its derivatives overflow, so that quotients by it, and their
        derivatives, are zero."""
        return self.select(self.test("olt", x, _OVERFLOW), self.function("exp", x), math.inf)


# -- the operations --------------------------------------------------------------------------------


def _linear(s: Series, i: Instruction, k: Order) -> None:
    s.put(i.row, k, s.linear(i.parts, k))


def _product(s: Series, i: Instruction, k: Order) -> None:
    a, b = i.inputs
    s.put(i.row, k, s.square(a, k) if a == b else s.total(s.convolution(a, b, k, 0)))


def _quotient(s: Series, i: Instruction, k: Order) -> None:
    a, b = i.inputs
    s.put(i.row, k, s.divided(s.convolution(b, i.row, k, 1), s.get(a, k), b, k))


def _reciprocal(s: Series, i: Instruction, k: Order) -> None:
    (b,) = i.inputs
    above = 1.0 if k == 0 else 0.0
    s.put(i.row, k, s.divided(s.convolution(b, i.row, k, 1), above, b, k))


def _power(s: Series, i: Instruction, k: Order) -> None:
    """A power; all orders are 0 if y begins with 0."""
    a = i.inputs[0]
    p = s.factor(i.parts[0])
    first = s.get(a, 0)
    if k == 0:
        size = s.get(i.inputs[1], 0) if i.inputs[1:] else 0.0
        s.put(i.row, 0, s.first_power(first, p, size))
        return
    y = s.get(i.row, 0)
    there = s.once(("there", y), lambda: s.test("une", y, 0.0))
    next_one = s.over(s.total(s.powered(a, i.row, p, k)), s.by(first, k))
    s.put(i.row, k, s.select(there, next_one, 0.0))


def _exp(s: Series, i: Instruction, k: Order) -> None:
    (a,) = i.inputs
    s.put(i.row, k, s.first_exp(s.get(a, 0)) if k == 0 else s.chain(a, i.row, k))


def _log(s: Series, i: Instruction, k: Order) -> None:
    (a,) = i.inputs
    first = s.get(a, 0)
    if k == 0:
        s.put(i.row, 0, s.function("log", first))
        return
    rest = s.per(s.total(s.weighted(i.row, a, k)), k)
    s.put(i.row, k, s.over(s.total([(s.get(a, k), 1.0), (s.negative(rest), 1.0)]), first))


def _rotation(s: Series, i: Instruction, k: Order) -> None:
    (a,) = i.inputs
    sine, cosine = i.row, i.row + 1
    x = s.get(a, 0)
    if k == 0:
        s.put(sine, 0, s.function("sin", x))
        s.put(cosine, 0, s.function("cos", x))
        return
    if i.op is Op.STEADY:
        turn = s.per(s.get(a, 1), k)
        up = s.times(turn, s.get(cosine, s.before(k)))
        down = s.times(turn, s.get(sine, s.before(k)))
    else:
        up = s.chain(a, cosine, k)
        down = s.chain(a, sine, k)
    s.put(sine, k, up)
    s.put(cosine, k, s.negative(down))


def _hyperbolic(s: Series, i: Instruction, k: Order) -> None:
    (a,) = i.inputs
    sine, cosine = i.row, i.row + 1
    if k == 0:
        x = s.get(a, 0)
        up = s.times(0.5, s.first_exp(x))
        down = s.times(0.5, s.first_exp(s.negative(x)))
        large = s.test("ogt", s.modulus(x), 1.0)
        s.put(sine, 0, s.select(large, s.add(up, s.negative(down)), s.function("sinh", x)))
        s.put(cosine, 0, s.add(up, down))
        return
    up = s.chain(a, cosine, k)
    down = s.chain(a, sine, k)
    s.put(sine, k, up)
    s.put(cosine, k, down)


def _chain(s: Series, i: Instruction, k: Order) -> None:
    a, slope = i.inputs
    s.put(i.row, k, s.formula(i.function, s.get(a, 0)) if k == 0 else s.chain(a, slope, k))


def _tangent(s: Series, i: Instruction, k: Order) -> None:
    """The slope 1 ± y² is a separate row, one order behind y."""
    (a,) = i.inputs
    y, slope = i.row, i.row + 1
    s.put(y, k, s.formula(i.function, s.get(a, 0)) if k == 0 else s.chain(a, slope, k))
    square = s.square(y, k)
    signed = square if i.op is Op.TAN else s.negative(square)
    s.put(slope, k, s.add(1.0, signed) if k == 0 else signed)


def _select(s: Series, i: Instruction, k: Order) -> None:
    above, below = (s.linear((part,), k) for part in i.parts)
    s.put(i.row, k, s.select(s.is_above(i.place), above, below) if above != below else above)


def _size(s: Series, i: Instruction, k: Order) -> None:
    if k == 0:
        terms = [s.linear((part,), 0) for part in i.parts]
        s.put(i.row, 0, s.total([(s.modulus(x), 1.0) for x in terms]))


def _side(s: Series, i: Instruction, k: Order) -> None:
    """Surface speed in stick; in slip the friction force, against the threshold where it is to be
    broken."""
    surface, plus, minus, *static = (s.get(row, k) for row in i.inputs)
    if i.inputs[1:3] != i.inputs[3:5]:
        breaks = s.once(
            ("breaks", i.place),
            lambda: s.either(s.is_mode(i.place, "eq", 2), s.is_mode(i.place, "eq", -2)),
        )
        plus, minus = (s.select(breaks, x, y) for x, y in zip(static, (plus, minus), strict=True))
    s.put(i.row, k, s.by_mode_of(i.place, surface, s.negative(plus), minus))


def _speed(s: Series, i: Instruction, k: Order) -> None:
    mode = s.which("mode", i.place)
    sign = s.once(("sign", i.place), lambda: s.as_real(mode))
    s.put(i.row, k, s.times(sign, s.get(i.inputs[0], k)))


def _direction(s: Series, i: Instruction, k: Order) -> None:
    """u/|u| and |u| in slip, unless they are given; where there is no friction the parts,
    or zero."""
    *sides, size = i.inputs
    n, r = i.row, i.row + len(sides)
    is_given = s.is_mode(i.place, "eq", DIRECTION_GIVEN)
    free = s.is_free(i.place, i.pressed)
    if k == 0:
        parts = [s.get(row, 0) for row in sides]
        speed = s.function("llvm.sqrt.f64", s.total([(u, u) for u in parts]))
        still = s.test("ole", speed, s.times(ROUNDING, s.get(size, 0)))
        own = s.select(is_given, s.stored(r, 0), s.select(still, 0.0, speed))
        s.put(r, 0, s.select(free, 0.0, own))
    first = s.get(r, 0)

    rests = [s.factor(part) for part in i.parts] if k == 0 else []

    def put(row: int, made: Operand) -> None:
        kept = s.once(
            ("kept", i.row),
            lambda: s.either(is_given, s.test("oeq", first, 0.0)),
        )
        slips = s.select(kept, s.stored(row, k), made)
        s.put(row, k, s.select(free, rests[row - n] if rests and row < r else 0.0, slips))

    # Order k of |u|² = Σ uᵢ² is solved for the newest coefficient of |u|, that of n |u| = u for n.
    if k != 0:
        squares = s.square(sides[0], k)
        for row in sides[1:]:
            squares = s.add(squares, s.square(row, k))
        rest = s.negative(s.per(s.total(s.weighted(r, r, k)), k))
        put(r, s.over(s.add(s.times(0.5, squares), rest), first))
    for row, own in enumerate(sides, n):
        put(row, s.divided(s.convolution(r, row, k, 1), s.get(own, k), r, k))


def _entry(s: Series, i: Instruction, k: Order) -> None:
    own = s.factor(i.parts[0]) if k == 0 else 0.0
    stiffness, plus, minus = (s.get(row, k) for row in i.inputs)
    slips = s.add(stiffness, plus), s.add(stiffness, s.negative(minus))
    s.put(i.row, k, s.by_mode_of(i.place, own, *slips))


def _right(s: Series, i: Instruction, k: Order) -> None:
    surface, rest, plus, minus = (s.get(row, k) for row in i.inputs)
    slips = s.negative(s.add(rest, plus)), s.add(s.negative(rest), minus)
    s.put(i.row, k, s.by_mode_of(i.place, surface, *slips))


def _solve(s: Series, i: Instruction, k: Order) -> None:
    s.solved(i.matrix, i.place, i.inputs[0], i.row, i.size, k)


def _rates(s: Series, i: Instruction, k: Order) -> None:
    """Solve A ṙ = b as a series: with the inverse at order 0, and at higher orders with the
    contributions of changes of A moved to the right-hand side."""
    n = i.size
    (right,) = i.inputs
    changing = [(j, entry.row) for j, entry in enumerate(i.entries) if entry.inputs]
    if k == 0:
        for j, entry in enumerate(i.entries):
            if entry.inputs:
                x = s.get(entry.row, 0)
            else:
                own, stiffness, plus, minus = map(s.factor, entry.parts)
                slips = s.add(stiffness, plus), s.add(stiffness, s.negative(minus))
                x = s.by_mode_of(entry.place, own, *slips)
            s.write(x, s.place("A", j // n, j % n))
        if i.definite:
            s.leave(_fails(s, is_definite, i, i.definite), INDEFINITE)
        s.leave(_fails(s, shared if i.shared else inverted, i, n), SINGULAR)
    else:
        for line in range(n):
            terms = [
                (s.negative(x), y)
                for j, row in changing
                if j // n == line
                for x, y in s.convolution(row, i.row + j % n, k, 1)
            ]
            if terms:
                rest = s.total([(s.get(right + line, k), 1.0), *terms])
                s.put(right + line, k, rest)
    s.solved(i.matrix, i.place, right, i.row, n, k)


def _fails(s: Series, kernel: Kernel, i: Instruction, n: int) -> Register:
    """Whether a kernel returns 0 for a matrix of n rows, and for the inverse that an instruction
    fills."""
    across, along = (s.stride(name) for name in ("A", i.matrix))
    inverse = s.row(i.matrix, i.place)
    return s.compare("eq", s.kernel(kernel, s.data("A"), across, n, inverse, along), 0)


def _implicit(s: Series, i: Instruction, k: Order) -> None:
    """The zero of an increasing function at order 0, and the integral of its slope."""
    if k != 0:
        slope = s.get(i.inputs[0], s.before(k))
        s.put(i.row, k, s.per(s.times(slope, s.get(s.clock, 1)), k))
        return
    s.prepare(i.zero, i.row)

    def step(_: Register, *carried: Register) -> list[Operand | Count]:
        low, high, last, v, _ = carried
        s.known[i.row, 0] = v
        g, slope = map(s.scalar, i.zero)
        return list(_closer(s, (low, high, last, v), g, slope))

    first = (-_FARTHEST, _FARTHEST, math.inf, 0.0, True)
    *_, v, going = s.loop(0, _MOST_TURNS, step, *first, going=4)
    s.put(i.row, 0, s.select(going, math.nan, v))


def _closer(
    s: Series, carried: tuple[Operand, Operand, Operand, Operand], g: Operand, slope: Operand
) -> tuple[Operand, ...]:
    """A step towards the zero of an increasing function.

    Rates may have any order of magnitude: a bracket is halved in ln|v| until its ends are of one
    sign and near each other. Then Newton's steps follow, as long as each halves the function.

    Parameters
    ----------
    carried : tuple of Operand
        The bracket, the whole line at the start; the modulus of the function before, if that was a
        step of Newton's, or infinity; and where the function was asked, 0 at the start.
    g, slope : Operand
        The function and its slope there.

    Returns
    -------
    tuple of Operand
        The same for the next step, and whether there is one. Where the function is NaN, or where it
        falls, the next place is NaN.
    """
    low, high, last, v = carried

    def greater(a: Operand, b: Operand) -> Operand:
        return s.select(s.test("ogt", a, b), a, b)

    low = s.select(s.test("olt", g, 0.0), v, low)
    high = s.select(s.test("ogt", g, 0.0), v, high)
    a, b = s.modulus(low), s.modulus(high)
    most = greater(a, b)
    least = greater(s.select(s.test("ogt", a, b), b, a), _NEAREST)
    apart = s.both(s.test("olt", low, 0.0), s.test("ogt", high, 0.0))
    root = s.times(s.function("llvm.sqrt.f64", least), s.function("llvm.sqrt.f64", most))
    signed = s.select(s.test("olt", low, 0.0), s.negative(root), root)
    middle = s.select(apart, 0.0, signed)
    close = s.test("ole", most, s.times(_SPREAD, least))
    narrow = s.both(s.fails(apart), close)
    step = s.negative(s.over(g, slope))
    newton = s.add(v, step)
    there = s.test("oeq", g, 0.0)
    near = s.both(narrow, s.test("ole", s.modulus(step), s.times(_NEAR, s.modulus(v))))
    size = s.modulus(g)
    inside = s.both(s.test("olt", low, newton), s.test("olt", newton, high))
    good = s.both(s.both(narrow, inside), s.test("ole", size, s.times(0.5, last)))
    known = s.both(s.test("oeq", g, g), s.test("uge", slope, 0.0))
    last = s.select(good, size, math.inf)
    following = s.select(there, v, s.select(s.either(near, good), newton, middle))
    on = s.fails(s.either(there, near))
    return low, high, last, s.select(known, following, math.nan), s.both(known, on)


WRITERS: dict[Op, Callable[[Series, Instruction, Order], None]] = {
    Op.LINEAR: _linear,
    Op.PRODUCT: _product,
    Op.QUOTIENT: _quotient,
    Op.RECIPROCAL: _reciprocal,
    Op.POWER: _power,
    Op.EXP: _exp,
    Op.LOG: _log,
    Op.ROTATION: _rotation,
    Op.STEADY: _rotation,
    Op.HYPERBOLIC: _hyperbolic,
    Op.CHAIN: _chain,
    Op.TAN: _tangent,
    Op.TANH: _tangent,
    Op.SELECT: _select,
    Op.SIZE: _size,
    Op.SIDE: _side,
    Op.SPEED: _speed,
    Op.ENTRY: _entry,
    Op.RIGHT: _right,
    Op.SOLVE: _solve,
    Op.RATES: _rates,
    Op.IMPLICIT: _implicit,
    Op.WITHIN: lambda s, i, k: None,
    Op.DIRECTION: _direction,
}
