"""Expressions as instructions, for compiled code that interprets them
(:mod:`stickslip.orbits.fields.engine.interpreter`).

They are lowered as for the engine's scalar code (:func:`stickslip.symbolic.scalars.scalars_of`).
Instructions without variables come first, so that they are executed once for many points.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.equations.field import Field
from stickslip.machine_code.objects import Provider, address_of, provider_of
from stickslip.orbits.fields.engine.interpreter import (
    CALL,
    CONSTANT,
    LANES,
    POWER,
    REAL_POWER,
    RECIPROCAL,
    SCALED,
    SUMMED,
    TIMES,
    Instructions,
    interpret,
)
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import ARGUMENT, FUNCTIONS
from stickslip.symbolic.scalars import ORIGIN, Scalar, element, scalars_of


class Listing:
    """Instructions for some expressions.

    Parameters
    ----------
    expressions : sequence of Expr
        Without kinks.
    names : sequence of str
        What they depend on; these have the first places in the table of values.
    moving : int
        So many of the names differ from point to point, the others do not.

    Attributes
    ----------
    wanted : array of int
        Places of the values of the expressions.
    places : int
        In the table of values.
    once : int
        So many of the instructions are the same for all points.
    code : array of int, shape (instructions, 4)
    numbers : array, shape (instructions,)

    Raises
    ------
    ValueError
        If an expression has kinks.
    """

    def __init__(self, expressions: Sequence[Expr], names: Sequence[str], moving: int) -> None:
        if any(e.op == "select" for e in ex.walk(dict.fromkeys(expressions))):
            raise ValueError("an expression with kinks is not smooth; fix its regions first")
        self.places: int = len(names)
        self._moving = moving
        self._found: dict[Scalar, tuple[int, bool]] = {}
        self._numbers: dict[float, int] = {}
        self._needed: list[Provider] = []
        self._fixed: list[tuple[int, int, int, int, float]] = []
        self._others: list[tuple[int, int, int, int, float]] = []
        self._names: dict[str, Scalar] = {name: element("v", i) for i, name in enumerate(names)}
        # Most entries of a Jacobian are the same number.
        every = dict.fromkeys(expressions)
        sums = [e for e in every if _is_sum(e)]
        parts = [term for e in sums for term, _ in e.terms if term.op != "sym"]
        others = [e for e in every if not _is_sum(e)]
        self._lowered: dict[Expr, Scalar] = scalars_of([*others, *parts], self._names)
        place = {e: self._place(e) for e in every}
        self.wanted: Array = np.array([place[e] for e in expressions], np.int64)
        listed = [*self._fixed, *self._others]
        self.once: int = len(self._fixed)
        self.code: Array = np.array([entry[:4] for entry in listed], np.int64).reshape(-1, 4)
        self.numbers: Array = np.array([entry[4] for entry in listed])

    def _value(self, s: Scalar) -> tuple[int, bool]:
        """Place of a value, and whether it varies between points."""
        if s.op == "entry":
            return s.index[0], s.index[0] < self._moving
        if s.op == "number":
            return self._number(s.value), False
        if s not in self._found:
            self._found[s] = self._value(s.args[0]) if s.op == "kept" else self._made(s)
        return self._found[s]

    def _place(self, e: Expr) -> int:
        """Place of an expression. The terms of sums are mostly names, of which modes of structures
        have hundreds."""
        if not _is_sum(e):
            return self._value(self._lowered[e])[0]
        lowered = [
            (self._names[str(x.value)] if x.op == "sym" else self._lowered[x], c)
            for x, c in e.terms
        ]
        return self._added(float(e.value), [(*self._value(x), c) for x, c in lowered])[0]

    def _number(self, value: float) -> int:
        if value not in self._numbers:
            self._numbers[value] = self._add(False, CONSTANT, 0, 0, value)
        return self._numbers[value]

    def _add(
        self, moves: bool, operation: int, a: int, b: int = 0, number: float = 0.0, out: int = -1
    ) -> int:
        """Append an instruction with the result in a new place, or in `out`; returns the place."""
        if out < 0:
            out = self.places
            self.places += 1
        (self._others if moves else self._fixed).append((operation, out, a, b, number))
        return out

    def _made(self, s: Scalar) -> tuple[int, bool]:
        if s.op == "sum":
            return self._sum(s.args)
        if s.op == "call":
            formula = FUNCTIONS[s.name].made_of
            if formula is not None:
                return self._value(scalars_of([formula], {ARGUMENT: s.args[0]})[formula])
            place, moves = self._value(s.args[0])
            provider = provider_of(s.name)
            if provider is not None:  # keeps the code at the address alive
                self._needed.append(provider)
            return self._add(moves, CALL, place, address_of(s.name)), moves
        parts = [self._value(x) for x in s.args]
        moves = any(part[1] for part in parts)
        places = [part[0] for part in parts]
        match s.op:
            case "product":
                out, *factors = places
                for n, factor in enumerate(factors):
                    out = self._add(moves, TIMES, out, factor, out=out if n else -1)
                return out, moves
            case "reciprocal":
                return self._add(moves, RECIPROCAL, places[0]), moves
            case "real_power" if s.args[1].op == "number":
                return self._add(moves, POWER, places[0], number=s.args[1].value), moves
            case "real_power":
                return self._add(moves, REAL_POWER, *places), moves
        raise NotImplementedError(s.op)

    def _sum(self, terms: Iterable[Scalar]) -> tuple[int, bool]:
        """A sum, term after term: a number first, then multiples."""
        constant, *others = terms
        factors, values = zip(*(term.args for term in others), strict=True)
        parts = [(*self._value(x), c.value) for x, c in zip(values, factors, strict=True)]
        return self._added(constant.value, parts)

    def _added(self, constant: float, parts: list[tuple[int, bool, float]]) -> tuple[int, bool]:
        """A sum of a number and multiples of values: their places, whether they vary, and the
        factors."""
        moves = any(moving for _, moving, _ in parts)
        if constant != 0.0:
            out = self._add(moves, CONSTANT, 0, number=constant)
        else:
            (place, _, factor), *parts = parts
            out = self._add(moves, SCALED, place, number=factor)
        listed = self._others if moves else self._fixed
        listed += [(SUMMED, out, place, 0, factor) for place, _, factor in parts]
        return out, moves


def _is_sum(e: Expr) -> bool:
    """Whether an expression is a sum of terms that may be rounded one after the other."""
    return e.op == "sum" and ORIGIN not in e.symbols


class Evaluator:
    """Values of expressions at many points.

    Parameters
    ----------
    expressions : sequence of Expr
        Without kinks.
    names : sequence of str
        What they depend on.
    moving : int
        So many of the names differ from point to point.

    Raises
    ------
    ValueError
        If an expression has kinks.
    """

    def __init__(self, expressions: Sequence[Expr], names: Sequence[str], moving: int) -> None:
        provided = any(provider_of(e.op) for e in ex.walk(dict.fromkeys(expressions)))
        # tables may be large and are not stored
        make = Listing if provided else _listing
        self.listing: Listing = make(tuple(expressions), tuple(names), moving)
        self.made: Instructions = packed([self.listing])

    def __call__(self, given: Array, alike: bool = True) -> Array:
        """The values, shape (expressions, points).

        Parameters
        ----------
        given : array, shape (names, points)
        alike : bool
            Whether those names that do not move are the same for all points.
        """
        listing = self.listing
        out = np.empty((len(listing.wanted), given.shape[1]))
        once = listing.once if alike else 0
        values = np.empty((listing.places, LANES))
        interpret(self.made, once, listing.wanted, np.ascontiguousarray(given), values, out)
        return out


class PointFunction:
    """Function (t, y, p) -> values of expressions in a field.

    Shapes: t () or (points,), y (states,) or (states, points), p (parameters,) or (parameters,
    points); result (expressions,) or (expressions, points).
    """

    def __init__(self, field: Field, expressions: Sequence[Expr]) -> None:
        self.states: int = len(field.state)
        self.names: int = len(field.names)
        self.evaluate: Evaluator = Evaluator(expressions, field.names, 1 + self.states)

    @property
    def listing(self) -> Listing:
        """The instructions."""
        return self.evaluate.listing

    def __call__(self, t: ArrayLike, y: Array, p: Array) -> Array:
        points = y.shape[1] if y.ndim == 2 else 1
        given = np.empty((self.names, points))
        given[0] = t
        given[1 : 1 + self.states] = y if y.ndim == 2 else y[:, None]
        given[1 + self.states :] = p if p.ndim == 2 else p[:, None]
        values = self.evaluate(given, p.ndim == 1)
        return values if y.ndim == 2 else values[:, 0]


def packed(listings: Sequence[Listing]) -> Instructions:
    """The instructions of successive listings."""
    return Instructions(
        np.concatenate([np.zeros((0, 4), np.int64), *(x.code for x in listings)]),
        np.concatenate([np.zeros(0), *(x.numbers for x in listings)]),
    )


@lru_cache(maxsize=4096)
def _listing(expressions: tuple[Expr, ...], names: tuple[str, ...], moving: int) -> Listing:
    return Listing(expressions, names, moving)
