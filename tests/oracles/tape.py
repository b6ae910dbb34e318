"""The functions of a system, interpreted in plain Python: the oracle of their machine code.

What they compute is data (:class:`stickslip.equations.codegen.layout.Generated`), and its meaning
is documented at :class:`stickslip.symbolic.tape.Instruction` and
:class:`stickslip.symbolic.scalars.Scalar`. It is written here a second time, from these words. Of
the package, only the values of elementary functions at a number run here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import reduce
from operator import add
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.layout import Generated
from stickslip.equations.codegen.series import INDEFINITE, SINGULAR
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS
from stickslip.symbolic.scalars import ParameterExpressions, Scalar, Store
from stickslip.symbolic.tape import DIRECTION_GIVEN, Instruction, Op, Scaled

_NOTHING = 64 * 2.0**-52  # part of its terms below which a difference may be zero
_LEAST_PIVOT = 1e-13  # of a matrix of size 1: what is smaller is zero
_OVERFLOW = 350.0  # exponent from which an exponential counts as infinite
_LAST = 0x7FEF_FFFF_FFFF_FFFF  # bits of the largest number, which count the positive ones

Value = Callable[["Call"], float]
"""A number, once the arguments of a call are known."""
Order = Callable[["Call", int], float]
"""A coefficient of a given order."""
Step = Callable[["Call", int], None]
"""Stores the coefficients of an instruction, of a given order."""
Factor = Callable[[Expr], Value]
"""Prepares a constant."""


class Undetermined(Exception):
    """A linear problem without a solution, with the status that ``jets`` returns."""

    def __init__(self, status: int) -> None:
        super().__init__(status)
        self.status = status


@dataclass
class Call:
    """One call of a function.

    Attributes
    ----------
    given : dict
        Its arguments by name.
    unit : float
        The rate of the clock.
    kept : dict of Scalar to float
        Values that have a variable of their own.
    """

    given: dict[str, Any]
    unit: float = 1.0
    kept: dict[Scalar, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.W: Array = self.given.get("W", np.empty((0, 0)))

    def mode(self, contact: int) -> int:
        """The mode of a contact."""
        return self.given["mode"].item(contact)

    def motion(self, contact: int) -> int:
        """0 in stick, 1 in slip forwards, 2 in slip backwards."""
        mode = self.mode(contact)
        return 0 if mode == 0 else 1 if mode > 0 else 2

    def is_above(self, kink: int) -> bool:
        """Whether a guard is in its upper region."""
        return self.given["reg"].item(kink) == 1


class Interpreted:
    """The functions of a system, with the arguments of its machine code."""

    def __init__(self, generated: Generated) -> None:
        layout = generated.layout
        self._clock = len(layout.state)
        self._rates = layout.rates
        self._steps = [step_of(i, generated.constants) for i in layout.instructions]
        self._shown = [step_of(i, generated.constants) for i in layout.shown]
        self._setup = _statements(generated.setup)
        self._sizes = _statements(generated.sizes)
        self._residual = _statements(generated.residual)
        self._powers = _statements(generated.powers)
        self._landings = _statements(generated.landings)

    @np.errstate(all="ignore")
    def setup(self, p: Array, K: Array, M: Array, C: Array, J: Array, omega: Array) -> None:
        """Constants, matrices, directions and frequencies from the parameters."""
        self._setup(Call({"p": p, "K": K, "M": M, "C": C, "J": J, "omega": omega}))

    @np.errstate(all="ignore")
    def jets(
        self,
        t: float,
        y: Array,
        mode: Array,
        reg: Array,
        K: Array,
        Rq: Array,
        Rz: Array,
        N: int,
        W: Array,
        A: Array,
        B: Array,
        mag: Array,
    ) -> int:
        """Taylor coefficients of all rows, order by order, and sizes of their terms; a status."""
        given = {"mode": mode, "reg": reg, "K": K, "Rq": Rq, "Rz": Rz, "W": W, "B": B, "mag": mag}
        clock = self._clock
        c = Call(given, W.item(clock, 1))
        W[:clock, 0] = y
        W[clock, 0] = t
        W[clock, 2 : N + 1] = 0.0
        try:
            for k in range(N):
                for step in self._steps:
                    step(c, k)
                for step in self._shown if k == 0 else ():
                    step(c, k)
                W[:clock, k + 1] = W[self._rates, k] * (c.unit / (k + 1))
        except Undetermined as problem:
            return problem.status
        self._sizes(c)
        return 0

    @np.errstate(all="ignore")
    def residual(
        self, t: float, y: Array, mode: Array, reg: Array, K: Array, G: Array, P: Array
    ) -> None:
        """How far forces in slip are from their thresholds, and the matrix to put them back."""
        self._residual(Call({"t": t, "y": y, "mode": mode, "reg": reg, "K": K, "G": G, "P": P}))

    @np.errstate(all="ignore")
    def powers(self, W: Array, reg: Array, K: Array, out: Array) -> None:
        """Energy, dissipated power, supplied power."""
        self._powers(Call({"W": W, "reg": reg, "K": K, "out": out}))

    @np.errstate(all="ignore")
    def landings(self, W: Array, reg: Array, K: Array, out: Array) -> None:
        """New values of the state in all jumps."""
        self._landings(Call({"W": W, "reg": reg, "K": K, "out": out}))


# -- scalars ---------------------------------------------------------------------------------------


def _statements(stores: Iterable[Store]) -> Callable[[Call], None]:
    """Statements, one after the other."""
    prepared = dict[Scalar, Value]()
    ready = [(s.name, s.place, value_of(s.value, prepared), s.adding) for s in stores]

    def run(c: Call) -> None:
        for name, place, value, adding in ready:
            array = c.given[name]
            before = array.item(place) if adding else 0.0
            array[place] = before + value(c) if adding else value(c)

    return run


def value_of(s: Scalar, prepared: dict[Scalar, Value] | None = None) -> Value:
    """A value as a function of the arguments of a call; `prepared` are those that are known."""
    prepared = {} if prepared is None else prepared
    if s not in prepared:
        args = [value_of(x, prepared) for x in s.args]
        prepared[s] = OTHERS[s.op](s, args) if s.op in OTHERS else _of_numbers(s.op, args)
    return prepared[s]


def _of_numbers(op: str, args: list[Value]) -> Value:
    """An operation that depends on its arguments alone."""
    if op not in ARITHMETIC:
        raise NotImplementedError(op)
    operation = ARITHMETIC[op]
    return lambda c: operation(*(x(c) for x in args))


def elementary(name: str, x: float) -> float:
    """A function of formulas."""
    return FUNCTIONS[name].ieee(x)


def ratio(a: float, b: float) -> float:
    """a/b; Python refuses where IEEE has infinity or NaN."""
    return a / b if b != 0.0 else float(np.divide(a, b))


def power(x: float, p: float) -> float:
    """A real power; NaN where undefined, poles included."""
    return math.nan if x == 0.0 and p < 0.0 and p % 2.0 == 1.0 else float(np.power(x, p))


def first_power(a: float, p: float, size: float) -> float:
    """aᵖ, where a is known up to the rounding error of terms of a size: what may be 0 is 0."""
    if p > 0.0 and abs(a) <= _NOTHING * size:
        return 0.0
    return math.sqrt(a) if p == 0.5 and a >= 0.0 else power(a, p)


def dot(*pairs: float) -> float:
    """Σ aᵢbᵢ of pairs that stand one after the other, by rational numbers."""
    a, b = pairs[::2], pairs[1::2]
    if not all(map(math.isfinite, pairs)):
        return float(np.dot(a, b))
    exact = sum(Fraction(x) * Fraction(y) for x, y in zip(a, b, strict=True))
    try:
        return float(exact)
    except OverflowError:
        return math.inf if exact > 0 else -math.inf


ARITHMETIC: dict[str, Callable[..., float]] = {
    "sum": lambda *x: reduce(add, x),
    "product": lambda *x: math.prod(x),
    "quotient": ratio,
    "negative": lambda x: -x,
    "modulus": lambda x: abs(x),
    "larger": lambda a, b: max(a, b),
    "over": lambda a, b: ratio(a, b) if b > 0.0 else 0.0,
    "reciprocal": lambda x: power(x, -1.0),
    "real_power": power,
    "first_power": first_power,
    "dot": dot,
}
"""Operations that depend on their arguments alone."""


def _number(s: Scalar, _: list[Value]) -> Value:
    return lambda c: s.value


def _entry(s: Scalar, _: list[Value]) -> Value:
    return lambda c: c.given[s.name].item(s.index)


def _name(s: Scalar, _: list[Value]) -> Value:
    return lambda c: float(c.given[s.name])


def _kept(s: Scalar, args: list[Value]) -> Value:
    (made,) = args

    def value(c: Call) -> float:
        if s not in c.kept:
            c.kept[s] = made(c)
        return c.kept[s]

    return value


def _call(s: Scalar, args: list[Value]) -> Value:
    (x,) = args
    return lambda c: elementary(s.name, x(c))


def _mode(s: Scalar, args: list[Value]) -> Value:
    return lambda c: args[c.motion(s.index[0])](c)


def _region(s: Scalar, args: list[Value]) -> Value:
    above, below = args
    return lambda c: above(c) if c.is_above(s.index[0]) else below(c)


def _sign(s: Scalar, args: list[Value]) -> Value:
    guard, above, below = args

    def value(c: Call) -> float:
        side = guard(c)
        if math.isnan(side):
            return math.nan
        return above(c) if side > 0.0 or (side == 0.0 and not s.value) else below(c)

    return value


def _spread(s: Scalar, _: list[Value]) -> Value:
    i, n, base = s.index

    def value(c: Call) -> float:
        sizes = c.given["mag"][base : base + n]
        return float(np.abs(c.given[s.name][i, :n]) @ sizes)

    return value


OTHERS: dict[str, Callable[[Scalar, list[Value]], Value]] = {
    "number": _number,
    "entry": _entry,
    "name": _name,
    "kept": _kept,
    "call": _call,
    "mode": _mode,
    "region": _region,
    "sign": _sign,
    "spread": _spread,
}
"""Operations that depend on the arguments of the call."""


# -- series ----------------------------------------------------------------------------------------


def step_of(i: Instruction, constants: ParameterExpressions) -> Step:
    """An instruction of the tape.

    Raises
    ------
    NotImplementedError
        For an operation that has no meaning here.
    """

    def factor(e: Expr) -> Value:
        return value_of(constants.scalar(e))

    if i.op in _SEVERAL:
        return _SEVERAL[i.op](i, factor)
    if i.op not in _ONE:
        raise NotImplementedError(i.op)
    order = _ONE[i.op](i, factor)

    def step(c: Call, k: int) -> None:
        c.W[i.row, k] = order(c, k)

    return step


def cauchy(W: Array, a: int, b: int, k: int, low: int = 0) -> float:
    """Σ aⱼ bₖ₋ⱼ for low ≤ j ≤ k."""
    return float(W[a, low : k + 1] @ W[b, : k + 1 - low][::-1])


def chained(W: Array, a: int, slope: int, k: int) -> float:
    """Order k ≥ 1 of y with y′ = g a′, which is Σ j aⱼ gₖ₋ⱼ / k."""
    return float((np.arange(1.0, k + 1.0) * W[a, 1 : k + 1]) @ W[slope, :k][::-1]) / k


def divided(W: Array, above: float, b: int, y: int, k: int) -> float:
    """Order k of y, of whose product with b `above` is order k; 0 where b has overflowed."""
    first = W.item(b, 0)
    return 0.0 if math.isinf(first) else ratio(above - cauchy(W, b, y, k, 1), first)


def exponential(x: float) -> float:
    """exp x, infinite before its derivatives overflow."""
    return math.inf if x >= _OVERFLOW else math.exp(x)


def by_mode(c: Call, contact: int, stick: float, plus: float, minus: float) -> float:
    """What depends on the mode of a contact."""
    return (stick, plus, minus)[c.motion(contact)]


def _part(part: Scaled, factor: Factor) -> Order:
    """Constant × row."""
    value, row = factor(part.factor), part.row
    if row is None:
        return lambda c, k: value(c) if k == 0 else 0.0
    return lambda c, k: value(c) * c.W.item(row, k)


def _linear(i: Instruction, factor: Factor) -> Order:
    parts = [_part(part, factor) for part in i.parts]
    return lambda c, k: sum(part(c, k) for part in parts)


def _size(i: Instruction, factor: Factor) -> Order:
    parts = [_part(part, factor) for part in i.parts]
    return lambda c, k: sum(abs(part(c, 0)) for part in parts) if k == 0 else 0.0


def _select(i: Instruction, factor: Factor) -> Order:
    above, below = (_part(part, factor) for part in i.parts)
    return lambda c, k: above(c, k) if c.is_above(i.place) else below(c, k)


def _product(i: Instruction, _: Factor) -> Order:
    a, b = i.inputs
    return lambda c, k: cauchy(c.W, a, b, k)


def _quotient(i: Instruction, _: Factor) -> Order:
    a, b = i.inputs
    return lambda c, k: divided(c.W, c.W.item(a, k), b, i.row, k)


def _reciprocal(i: Instruction, _: Factor) -> Order:
    (b,) = i.inputs
    return lambda c, k: divided(c.W, float(k == 0), b, i.row, k)


def _power(i: Instruction, factor: Factor) -> Order:
    """By a y′ = p a′ y: k a₀ yₖ = Σ (j p − (k − j)) aⱼ yₖ₋ⱼ. A power that is 0 has no series."""
    a, *size = i.inputs
    exponent = factor(i.parts[0].factor)

    def order(c: Call, k: int) -> float:
        W, p = c.W, exponent(c)
        if k == 0:
            return first_power(W.item(a, 0), p, W.item(size[0], 0) if size else 0.0)
        if W.item(i.row, 0) == 0.0:
            return 0.0
        j = np.arange(1.0, k + 1.0)
        total = float(((j * (p + 1.0) - k) * W[a, 1 : k + 1]) @ W[i.row, :k][::-1])
        return ratio(total, k * W.item(a, 0))

    return order


def _exp(i: Instruction, _: Factor) -> Order:
    (a,) = i.inputs
    return lambda c, k: chained(c.W, a, i.row, k) if k else exponential(c.W.item(a, 0))


def _log(i: Instruction, _: Factor) -> Order:
    """By a y′ = a′: k aₖ = Σ j yⱼ aₖ₋ⱼ."""
    (a,) = i.inputs

    def order(c: Call, k: int) -> float:
        W = c.W
        first = W.item(a, 0)
        if k == 0:
            return elementary("log", first)
        known = float((np.arange(1.0, k) * W[i.row, 1:k]) @ W[a, 1:k][::-1])
        return ratio(W.item(a, k) - known / k, first)

    return order


def _chain(i: Instruction, _: Factor) -> Order:
    a, slope = i.inputs

    def order(c: Call, k: int) -> float:
        return chained(c.W, a, slope, k) if k else elementary(i.function, c.W.item(a, 0))

    return order


def _speed(i: Instruction, _: Factor) -> Order:
    (u,) = i.inputs
    return lambda c, k: c.mode(i.place) * c.W.item(u, k)


def _side(i: Instruction, _: Factor) -> Order:
    """The surface in stick; friction in slip, as large as the threshold where it is to be
    broken."""
    surface, plus, minus, *static = i.inputs

    def order(c: Call, k: int) -> float:
        forwards, backwards = static if abs(c.mode(i.place)) == 2 else (plus, minus)
        W = c.W
        return by_mode(c, i.place, W.item(surface, k), -W.item(forwards, k), W.item(backwards, k))

    return order


def _matrix_entry(i: Instruction, factor: Factor) -> Order:
    """An entry of the matrix of rates in slip, k ± s; a constant in stick."""
    own = factor(i.parts[0].factor)

    def order(c: Call, k: int) -> float:
        stiffness, plus, minus = (c.W.item(row, k) for row in i.inputs)
        stick = own(c) if k == 0 else 0.0
        return by_mode(c, i.place, stick, stiffness + plus, stiffness - minus)

    return order


def _right(i: Instruction, _: Factor) -> Order:
    """The right-hand side beside it."""

    def order(c: Call, k: int) -> float:
        surface, rest, plus, minus = (c.W.item(row, k) for row in i.inputs)
        return by_mode(c, i.place, surface, -rest - plus, -rest + minus)

    return order


def _implicit(i: Instruction, _: Factor) -> Order:
    """The zero of a function at order 0, then the integral of its rate of change."""
    slope = i.inputs[0]
    prepared = dict[Scalar, Value]()
    function, derivative = (value_of(s, prepared) for s in i.zero)

    def order(c: Call, k: int) -> float:
        if k:
            return c.W.item(slope, k - 1) * c.unit / k

        def at(v: float) -> tuple[float, float]:
            c.W[i.row, 0] = v
            now = Call(c.given)  # what is kept depends on the rate
            return function(now), derivative(now)

        return zero_of(at)

    return order


def zero_of(function: Callable[[float], tuple[float, float]]) -> float:
    """The zero of an increasing function, by bisection of the numbers in their order.

    Parameters
    ----------
    function : callable
        Value and slope.

    Returns
    -------
    float
        NaN if the function is found undefined, or falling.
    """
    low, high = -_LAST, _LAST
    v = 0.0
    while high - low > 1:
        middle = (low + high) // 2
        v = math.copysign(float(np.int64(abs(middle)).view(np.float64)), middle)
        g, slope = function(v)
        if math.isnan(g) or slope < 0.0:
            return math.nan
        if g == 0.0:
            break
        low, high = (low, middle) if g > 0.0 else (middle, high)
    return v


_ONE: dict[Op, Callable[[Instruction, Factor], Order]] = {
    Op.LINEAR: _linear,
    Op.PRODUCT: _product,
    Op.QUOTIENT: _quotient,
    Op.RECIPROCAL: _reciprocal,
    Op.POWER: _power,
    Op.EXP: _exp,
    Op.LOG: _log,
    Op.CHAIN: _chain,
    Op.SELECT: _select,
    Op.SIZE: _size,
    Op.SIDE: _side,
    Op.SPEED: _speed,
    Op.ENTRY: _matrix_entry,
    Op.RIGHT: _right,
    Op.IMPLICIT: _implicit,
}
"""Operations that fill one row."""


def _rotation(i: Instruction, _: Factor) -> Step:
    """Sine and cosine; STEADY is the same for a phase of which all orders above 1 are 0."""
    (a,) = i.inputs
    sine, cosine = i.row, i.row + 1

    def step(c: Call, k: int) -> None:
        W = c.W
        x = W.item(a, 0)
        W[sine, k] = chained(W, a, cosine, k) if k else elementary("sin", x)
        W[cosine, k] = -chained(W, a, sine, k) if k else elementary("cos", x)

    return step


def _hyperbolic(i: Instruction, _: Factor) -> Step:
    """Hyperbolic sine and cosine, infinite with :func:`exponential`."""
    (a,) = i.inputs
    sine, cosine = i.row, i.row + 1

    def step(c: Call, k: int) -> None:
        W = c.W
        if k:
            W[sine, k] = chained(W, a, cosine, k)
            W[cosine, k] = chained(W, a, sine, k)
            return
        x = W.item(a, 0)
        far = abs(x) >= _OVERFLOW
        W[sine, 0] = math.copysign(math.inf, x) if far else math.sinh(x)
        W[cosine, 0] = math.inf if far else math.cosh(x)

    return step


def _tangent(i: Instruction, _: Factor) -> Step:
    """y and its slope 1 ± y²."""
    (a,) = i.inputs
    y, slope = i.row, i.row + 1
    sign = 1.0 if i.op is Op.TAN else -1.0

    def step(c: Call, k: int) -> None:
        W = c.W
        W[y, k] = chained(W, a, slope, k) if k else elementary(i.function, W.item(a, 0))
        W[slope, k] = float(k == 0) + sign * cauchy(W, y, y, k)

    return step


def _direction(i: Instruction, factor: Factor) -> Step:
    """u/|u| and r = |u|, by r² = u·u; see :class:`stickslip.symbolic.tape.Instruction`."""
    *sides, size = i.inputs
    r = i.row + len(sides)
    rests = [_part(part, factor) for part in i.parts]

    def step(c: Call, k: int) -> None:
        W, mode = c.W, c.mode(i.place)
        opened = [c.mode(normal) != 0 for normal in i.pressed]
        if mode == 0 or (opened and all(opened)):
            W[i.row : r + 1, k] = 0.0
            if k == 0:
                for row, rest in enumerate(rests, i.row):
                    W[row, 0] = rest(c, 0)
            return
        if mode == DIRECTION_GIVEN:
            return
        if k == 0:
            speed = math.hypot(*(W[row, 0] for row in sides))
            W[r, 0] = 0.0 if speed <= _NOTHING * W[size, 0] else speed
        first = W.item(r, 0)
        if first == 0.0:
            return
        if k:
            squares = sum(cauchy(W, row, row, k) for row in sides)
            W[r, k] = (squares - float(W[r, 1:k] @ W[r, 1:k][::-1])) / (2.0 * first)
        for row, side in enumerate(sides, i.row):
            W[row, k] = divided(W, W.item(side, k), r, row, k)

    return step


def _solve(i: Instruction, _: Factor) -> Step:
    """Rows of an inverse times a right-hand side."""
    n, (right,) = i.size, i.inputs

    def step(c: Call, k: int) -> None:
        R = c.given[i.matrix][i.place : i.place + n, :n]
        c.W[i.row : i.row + n, k] = R @ c.W[right : right + n, k]

    return step


def _rates(i: Instruction, factor: Factor) -> Step:
    """A y = b as series: A₀ yₖ = bₖ − Σ Aⱼ yₖ₋ⱼ, and the inverse of A₀."""
    n, (right,) = i.size, i.inputs
    entries = [_first_entry(entry, factor) for entry in i.entries]
    changing = [(*divmod(j, n), e.row) for j, e in enumerate(i.entries) if e.inputs]
    solve = _solve(i, factor)

    def step(c: Call, k: int) -> None:
        if k == 0:
            A = np.array([entry(c) for entry in entries]).reshape(n, n)
            if i.definite and not is_definite(A[: i.definite, : i.definite]):
                raise Undetermined(INDEFINITE)
            if i.shared:
                A = unshared(A)
            c.given[i.matrix][i.place : i.place + n, :n] = inverse(A)
        else:
            for line, column, row in changing:
                c.W[right + line, k] -= cauchy(c.W, row, i.row + column, k, 1)
        solve(c, k)

    return step


def _first_entry(entry: Instruction, factor: Factor) -> Value:
    """Order 0 of an entry of a matrix: that of its row, or of constants by the mode."""
    if entry.inputs:
        return lambda c: c.W.item(entry.row, 0)
    parts = [factor(part.factor) for part in entry.parts]

    def value(c: Call) -> float:
        stick, stiffness, plus, minus = (part(c) for part in parts)
        return by_mode(c, entry.place, stick, stiffness + plus, stiffness - minus)

    return value


def unshared(A: Array) -> Array:
    """The matrix without what says, on its diagonal, that forces may be shared: where they are
    unique, they are what they are without."""
    plain = A.copy()
    own = np.diag_indices(len(A))
    plain[own] = np.maximum(plain[own], 0.0)
    if np.linalg.matrix_rank(plain) < len(A):
        raise NotImplementedError("forces that are shared")
    return plain


def is_definite(A: Array) -> bool:
    """Whether a symmetric matrix is positive definite: the squared diagonal of its Cholesky factor
    is what elimination has as pivots."""
    try:
        pivots = np.diag(np.linalg.cholesky(A)) ** 2
    except np.linalg.LinAlgError:
        return False
    return bool(np.all(pivots > _LEAST_PIVOT * np.diag(A)))


def inverse(A: Array) -> Array:
    """The inverse, by elimination of a matrix whose rows and columns have been brought to size 1.

    Raises
    ------
    Undetermined
        If a pivot is smaller than a rounding error.
    """
    n = len(A)
    rows = _to_size_one(A)
    columns = _to_size_one((rows[:, None] * A).T)
    M = np.hstack([rows[:, None] * A * columns, np.diag(rows)])
    for j in range(n):
        pivot = j + int(np.argmax(np.abs(M[j:, j])))
        if not abs(M[pivot, j]) > _LEAST_PIVOT:
            raise Undetermined(SINGULAR)
        M[[j, pivot]] = M[[pivot, j]]
        M[j] /= M[j, j]
        others = np.arange(n) != j
        M[others] -= np.outer(M[others, j], M[j])
    return columns[:, None] * M[:, n:]


def _to_size_one(A: Array) -> Array:
    """By which power of two each row is multiplied."""
    largest = np.max(np.abs(A), axis=1)
    if not np.all((largest > 0.0) & np.isfinite(largest)):
        raise Undetermined(SINGULAR)
    return np.ldexp(1.0, -np.frexp(largest)[1])


def _within(i: Instruction, _: Factor) -> Step:
    """No series."""
    return lambda c, k: None


_SEVERAL: dict[Op, Callable[[Instruction, Factor], Step]] = {
    Op.ROTATION: _rotation,
    Op.STEADY: _rotation,
    Op.HYPERBOLIC: _hyperbolic,
    Op.TAN: _tangent,
    Op.TANH: _tangent,
    Op.DIRECTION: _direction,
    Op.SOLVE: _solve,
    Op.RATES: _rates,
    Op.WITHIN: _within,
}
"""Operations that fill several rows, or none."""
