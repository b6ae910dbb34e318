"""Values of one instant as data: what a tape is for series, a routine is for numbers.

A routine is a list of statements that store values in arrays. It is made of expression trees
(:func:`stickslip.symbolic.tape.scalars_of`) or put together by hand, and written down twice: as
Python source, here, and as machine code (:mod:`stickslip.equations.native`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from stickslip.symbolic.functions import FUNCTIONS


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
        above, below), ``sign`` (of the first: above, below), ``spread`` (Σⱼ |Rᵢⱼ| mag[base + j] for
        the matrix `name` and `index` = (i, n, base)) and ``kept``: what has a variable of its own.
    args : tuple of Scalar
    name : str
    index : tuple of int
    value : float
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
    """A sum; 0 of nothing."""
    terms = tuple(terms)
    return terms[0] if len(terms) == 1 else Scalar("sum", terms) if terms else numeral(0.0)


def by_mode(contact: int, stick: Scalar, plus: Scalar, minus: Scalar) -> Scalar:
    """What depends on the mode of a contact."""
    return Scalar("mode", (stick, plus, minus), index=(contact,))


def literal(value: float) -> str:
    """A float as source text."""
    return repr(float(value))


_CALLS = {"modulus": "abs", "larger": "max"}
_CHOICES = frozenset({"mode", "region", "sign"})


class SourceText:
    """Scalars as Python source.

    Parameters
    ----------
    arrays : bool
        For arrays of numbers, where functions are called by their names; by default for numbers, in
        compiled code.

    Attributes
    ----------
    lines : list of str
        Statements so far.
    """

    def __init__(self, arrays: bool = False) -> None:
        self.arrays = arrays
        self.lines: list[str] = []
        self._variables: dict[Scalar, str] = {}

    def store(self, statement: Store) -> None:
        """Write a statement."""
        place = ", ".join(map(str, statement.place))
        sign = "+=" if statement.adding else "="
        self.lines.append(f"{statement.name}[{place}] {sign} {self.text(statement.value)}")

    def text(self, s: Scalar) -> str:
        """Text of a value; what is kept gets a variable before."""
        match s.op:
            case "number":
                return literal(s.value)
            case "entry":
                return f"{s.name}[{', '.join(map(str, s.index))}]"
            case "name":
                return s.name
            case "kept":
                return self._variable(s)
            case "sum":
                return " + ".join(self._part(x, _CHOICES | {"sum"}) for x in s.args)
            case "product":
                return "*".join(self._part(x, _CHOICES | {"sum"}) for x in s.args)
            case "quotient":
                return "/".join(f"({self.text(x)})" for x in s.args)
            case "negative":
                return f"-{self._part(s.args[0], _CHOICES | {'sum'})}"
            case "mode" | "region" | "sign":
                return self._choice(s)
            case "spread":
                i, n, base = s.index
                return " + ".join(f"abs({s.name}[{i}, {j}])*mag[{base + j}]" for j in range(n))
            case "dot":
                left, right = (", ".join(map(self.text, s.args[i::2])) for i in (0, 1))
                return f"dot(({left}), ({right}))"
            case "call" if not self.arrays:
                return FUNCTIONS[s.name].compiled(self.text(s.args[0]))
        return f"{s.name or _CALLS.get(s.op, s.op)}({', '.join(map(self.text, s.args))})"

    def _part(self, s: Scalar, bracketed: frozenset[str]) -> str:
        """Text of an operand, in brackets where it is of a kind that needs them."""
        return f"({self.text(s)})" if s.op in bracketed else self.text(s)

    def _variable(self, s: Scalar) -> str:
        if s not in self._variables:
            text = self.text(s.args[0])
            self._variables[s] = f"s{len(self._variables)}"
            self.lines.append(f"{self._variables[s]} = {text}")
        return self._variables[s]

    def _choice(self, s: Scalar) -> str:
        parts = [self._part(x, _CHOICES) for x in s.args]
        if s.op == "mode":
            stick, plus, minus = parts
            mode = f"mode[{s.index[0]}]"
            return f"{stick} if {mode} == 0 else ({plus} if {mode} > 0 else {minus})"
        *guard, above, below = parts
        test = f"{guard[0]} >= 0.0" if guard else f"reg[{s.index[0]}] == 1"
        if self.arrays:
            return f"where({test}, {above}, {below})"
        return f"{above} if {test} else {below}"
