"""Values of one instant as data: what a tape is for series, a routine is for numbers.

A routine is a list of statements that store values in arrays. It is made of expression trees
(:func:`stickslip.symbolic.tape.scalars_of`) or put together by hand, and written down as machine
code (:mod:`stickslip.equations.native`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple


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
    """A sum; 0 of nothing."""
    terms = tuple(terms)
    return terms[0] if len(terms) == 1 else Scalar("sum", terms) if terms else numeral(0.0)


def by_mode(contact: int, stick: Scalar, plus: Scalar, minus: Scalar) -> Scalar:
    """What depends on the mode of a contact."""
    return Scalar("mode", (stick, plus, minus), index=(contact,))
