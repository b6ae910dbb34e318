"""Values at one instant as data: a routine computes numbers as a tape computes series.

A routine is a list of statements that store values in arrays. It is made from expression trees
(:func:`scalars_of`) or put together by hand, and written down as machine code
(:mod:`stickslip.equations.native`). Expressions of parameters alone are constants ``K[i]``, which
are computed once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS

ORIGIN = "t'0"
"""The time at which the clock starts, as a parameter: no formula can name it."""


@dataclass(frozen=True, eq=False, slots=True)
class Scalar:
    """A value, and how it is made; arithmetic makes new ones.

    Attributes
    ----------
    op : str
        ``number`` (`value`), ``entry`` of an array (`name`, `index`), ``name`` (of an argument),
        ``sum``, ``product``, ``quotient``, ``negative``, ``modulus``, ``larger`` (of two), ``over``
        (a quotient, 0 where the divisor is not positive), ``reciprocal``, ``real_power``,
        ``first_power`` (base, exponent, size of the terms of the base), ``call`` (of the function
        `name`), ``dot`` (pairs, one after the other, added up with twice as many digits), ``mode``
        (of contact `index`: stick, slip forwards, slip backwards), ``region`` (of kink `index`:
        above, below), ``sign`` (of the first: above, below; where that is 0, above if `value` is 0,
        else below), ``spread`` (Σⱼ |Rᵢⱼ| mag[base + j] for
        the matrix `name` and `index` = (i, n, base)) and ``kept``: what has a variable of its own.
    """

    op: str
    args: tuple[Scalar, ...] = ()
    name: str = ""
    index: tuple[int, ...] = ()
    value: float = 0.0

    def __add__(self, other: Scalar) -> Scalar:
        return added([self, other])

    def __mul__(self, other: Scalar) -> Scalar:
        return Scalar("product", (self, other))

    def __truediv__(self, other: Scalar) -> Scalar:
        return Scalar("quotient", (self, other))

    def __neg__(self) -> Scalar:
        return Scalar("negative", (self,))

    def __abs__(self) -> Scalar:
        if self.op == "number":
            return numeral(abs(self.value))
        return Scalar("modulus", (self,))


class Store(NamedTuple):
    """A statement: an entry of an array becomes a value, or grows by it."""

    name: str
    place: tuple[int, ...]
    value: Scalar
    adding: bool = False


def numeral(value: float) -> Scalar:
    """A constant."""
    return Scalar("number", value=float(value))


def element(name: str, *index: int) -> Scalar:
    """An entry of an array."""
    return Scalar("entry", name=name, index=index)


def added(terms: Iterable[Scalar]) -> Scalar:
    """A sum; 0 if empty."""
    terms = tuple(terms)
    return terms[0] if len(terms) == 1 else Scalar("sum", terms) if terms else numeral(0.0)


def by_mode(contact: int, stick: Scalar, plus: Scalar, minus: Scalar) -> Scalar:
    """A value that depends on the mode of a contact."""
    return Scalar("mode", (stick, plus, minus), index=(contact,))


@dataclass
class ParameterExpressions:
    """Parameter-only expressions, computed once per set of parameters."""

    parameters: list[str]
    slots: dict[Expr, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._names = frozenset(self.parameters)
        self._names_and_time = self._names | {"t"}

    def slot(self, e: Expr) -> int:
        """Place of a constant in K."""
        return self.slots.setdefault(e, len(self.slots))

    def scalar(self, e: Expr) -> Scalar:
        """A constant as a number or as ``K[i]``."""
        return numeral(ex.number(e)) if e.op == "num" else element("K", self.slot(e))

    def is_constant(self, e: Expr) -> bool:
        """Whether the expression depends on parameters only."""
        return e.symbols <= self._names

    def affine_in_time(self, e: Expr) -> tuple[Expr, Expr] | None:
        """Rate and value at the origin of an expression that is affine in time, with constant
        coefficients.

        Written so, a phase or a load is as exact late as early: the clock of a motion starts from 0
        at its origin.
        """
        if "t" not in e.symbols or not e.symbols <= self._names_and_time:
            return None
        rate = ex.derivative(e, "t")
        if not self.is_constant(rate) or any(map(ex.has_pieces, ex.walk([e]))):
            return None
        return rate, ex.substitute(e, {"t": ex.sym(ORIGIN)})

    def split(self, e: Expr) -> tuple[Expr, Expr, list[tuple[Expr, float]]]:
        """A sum as constant, rate of its part that is affine in time, and the other terms."""
        constant = ex.num(float(e.value))
        rate = ex.ZERO
        others = list[tuple[Expr, float]]()
        for term, c in e.terms:
            if self.is_constant(term):
                constant = constant + c * term
            elif (line := self.affine_in_time(term)) is not None:
                rate, constant = rate + c * line[0], constant + c * line[1]
            else:
                others.append((term, c))
        return constant, rate, others

    def phase(self, e: Expr) -> tuple[Expr, Expr, list[tuple[Expr, float]]] | None:
        """The phase of a function that repeats as a sum, without the whole periods at the origin:
        so it is as exact late as early.

        None where time does not enter so, or the function does not repeat.
        """
        if e.op not in FUNCTIONS or not FUNCTIONS[e.op].within:
            return None
        (x,) = e.args
        line = self.affine_in_time(x)
        constant, rate, others = (
            self.split(x) if x.op == "sum" else (*(line or (ex.ZERO, ex.ZERO))[::-1], [])
        )
        if rate is ex.ZERO:
            return None
        return ex.at(FUNCTIONS[e.op].without_periods, constant), rate, others

    def stores(self) -> list[Store]:
        """Statements that fill K from the parameter vector p."""
        names = {name: element("p", i) for i, name in enumerate(self.parameters)}
        values = scalars_of(self.slots, names)
        return [Store("K", (i,), values[e]) for e, i in self.slots.items()]


def scalars_of(
    targets: Iterable[Expr],
    names: Mapping[str, Scalar],
    regions: Mapping[Expr, int] | None = None,
    constants: ParameterExpressions | None = None,
) -> dict[Expr, Scalar]:
    """Values of expressions at one instant.

    Parameters
    ----------
    names : mapping of str to Scalar
        What each symbol stands for.
    regions : mapping of Expr to int, optional
        Number of each guard whose region is known; without it the sign of the guard decides.
    constants : ParameterExpressions, optional
        Where parameter-only expressions stand; ``t`` is then the time since the origin.

    Returns
    -------
    dict of Expr to Scalar
        Of the expressions, and all that they are made of.
    """
    lowering = _Lowering(names, regions, constants)
    for e in targets:
        lowering.value(e)
    return lowering.values


@dataclass
class _Lowering:
    """Expressions -> scalars, each once."""

    names: Mapping[str, Scalar]
    regions: Mapping[Expr, int] | None
    constants: ParameterExpressions | None
    values: dict[Expr, Scalar] = field(default_factory=dict)

    def value(self, e: Expr) -> Scalar:
        if e not in self.values:
            self.values[e] = self._plain(e) or Scalar("kept", (self._made(e),))
        return self.values[e]

    def constant(self, e: Expr) -> Scalar:
        assert self.constants is not None
        return self.constants.scalar(e)

    def _plain(self, e: Expr) -> Scalar | None:
        """The scalar of an expression that needs no variable: a number, a constant, a linear
        function of time, or a name; else None."""
        if self.constants is not None and self.constants.is_constant(e):
            return self.constant(e)
        if e.op == "num":
            return numeral(ex.number(e))
        if self.constants is not None and (line := self.constants.affine_in_time(e)) is not None:
            return self.constant(line[0]) * self.names["t"] + self.constant(line[1])
        return self.names[str(e.value)] if e.op == "sym" else None

    def _made(self, e: Expr) -> Scalar:
        v = self.value
        match e.op:
            case "sum" if ORIGIN in e.symbols and len(e.terms) > 1:
                return self._exact_sum(e)
            case "sum":
                return added(self._terms(e))
            case "prod":
                factors = [x for base, p in e.terms for x in self._power(base, p)]
                return Scalar("product", tuple(factors))
            case "pow":
                return self._real_power(e.args[0], v(e.args[1]))
            case "select" if self.regions is not None:
                place, above, below = ex.branches_of(e, self.regions)
                return Scalar("region", (v(above), v(below)), index=(place,))
            case "select":
                guard, above, below = map(v, e.args)
                return Scalar("sign", (guard, above, below), value=float(e.value))
        constants = self.constants
        phase = None if constants is None else constants.phase(e)
        inside = self._inside(e) if phase is None else added(self._line(*phase))
        return Scalar("call", (inside,), name=e.op)

    def _inside(self, e: Expr) -> Scalar:
        """The argument of a function."""
        parts = ex.wrapped_parts(e)
        if parts is None:
            return self.value(e.args[0])
        calls = (Scalar("call", (numeral(c) * self.value(x),), name=e.op) for x, c in parts)
        return added([numeral(float(e.args[0].value)), *(numeral(1.0) * call for call in calls)])

    def _exact_sum(self, e: Expr) -> Scalar:
        """A sum in which large terms may cancel: that of the phase of a load that begins late."""
        v = self.value
        pairs = [numeral(float(e.value)), numeral(1.0)]
        for term, c in e.terms:
            first, p = term.terms[0] if term.op == "prod" else (term, 1.0)
            if p != 1.0:
                pairs += [numeral(c), v(term)]
            else:
                pairs += [v(first) if c == 1.0 else numeral(c) * v(first), v(term / first)]
        return Scalar("dot", tuple(pairs))

    def _terms(self, e: Expr) -> list[Scalar]:
        if self.constants is not None:
            return self._line(*self.constants.split(e))
        return [numeral(float(e.value)), *(numeral(c) * self.value(term) for term, c in e.terms)]

    def _line(self, constant: Expr, rate: Expr, others: list[tuple[Expr, float]]) -> list[Scalar]:
        moving = [self.constant(rate) * self.names["t"]] if rate is not ex.ZERO else []
        rest = [numeral(c) * self.value(term) for term, c in others]
        return [self.constant(constant), *moving, *rest]

    def _power(self, base: Expr, p: float) -> list[Scalar]:
        """Factors of a power."""
        if p == 1.0:
            return [self.value(base)]
        if p == 2.0:
            return [self.value(base)] * 2
        if p == -1.0:
            return [Scalar("reciprocal", (self.value(base),))]
        return [self._real_power(base, numeral(p))]

    def _real_power(self, base: Expr, p: Scalar) -> Scalar:
        """A power, of a base that may be zero up to rounding where the engine's clock runs."""
        if self.constants is None:
            return Scalar("real_power", (self.value(base), p))
        return Scalar("first_power", (self.value(base), p, added(self._sizes(base))))

    def _sizes(self, e: Expr) -> list[Scalar]:
        """Moduli of the terms of an expression, in every region; none if it is one term."""
        if e.op == "sum":
            return [abs(term) for term in self._terms(e)]
        if e.op == "select":
            return [size for part in e.args[1:] for size in self._sizes(part)]
        return []
