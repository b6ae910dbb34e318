"""Shifts of time and state that leave formulas unchanged, from the structure of the formulas.

Time and state occur in *phases*, the arguments of periodic functions, and in *lines*, linear terms
outside of periodic functions:

    lines  α t + β·y,  as in k(Vt − x);      phases  ν t + κ·y, in periods,  as in sin(2πx/a).

A shift (τ, ξ) of (t, y) leaves every formula unchanged if it leaves the lines unchanged and shifts
the phases by whole periods:

    α τ + β·ξ = 0,      ν τ + κ·ξ a whole number.

If this number is 0, the shifts may have any size, and define translations and a moving frame.
Otherwise they are discrete: a tip pulled over a lattice of spacing a at the speed V is invariant
under shifts by a in space and a/V in time. In both cases the frame is τ = 1 in the lines; in this
frame a pull is a drive whose waves are the phases. The conditions are sufficient, not necessary:
terms may cancel in other ways.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from stickslip.arrays import Array
from stickslip.numerics.levels import MAKES_UP, NEARLY_WHOLE, ROUNDED_SUM
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.enclosures import bounds
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS

_MOST_CELLS = 24  # largest integer in the ratio of phases

Slopes = dict[str, Expr]
"""Of a line or phase, by the names in it."""


@dataclass(frozen=True)
class Reading:
    """Occurrences of some names in formulas.

    Attributes
    ----------
    lines, phases : list of dict of str to Expr
        Slopes by name, of phases in periods.
    terms : list of Expr
        Term that contains each line, for messages.
    """

    lines: list[Slopes]
    phases: list[Slopes]
    terms: list[Expr]

    def velocity(self, states: list[str], values: Mapping[str, float]) -> Array | None:
        """Velocity of a frame in which time occurs only in phases; None if no such frame exists."""
        if not any("t" in line for line in self.lines):
            return np.zeros(len(states))
        table = self._table(["t", *states], values)
        if not np.any(table[:, 0]):
            return np.zeros(len(states))
        found = np.linalg.lstsq(table[:, 1:], -table[:, 0], rcond=None)[0]
        # A value at the level of rounding relative to the others is zero.
        found = np.where(np.abs(found) > ROUNDED_SUM * np.max(np.abs(found)), found, 0.0)
        left = np.abs(table[:, 0] + table[:, 1:] @ found)
        if np.any(left > MAKES_UP * (np.abs(table[:, 0]) + np.abs(table[:, 1:]) @ np.abs(found))):
            return None
        return found

    def acceleration(self, states: list[str], values: Mapping[str, float], parameter: str) -> Array:
        """Derivative of that velocity v with respect to a parameter p: of α + β·v = 0."""
        velocity = self.velocity(states, values)
        if velocity is None or not np.any(velocity):
            return np.zeros(len(states))
        names = ["t", *states]
        size = self._sizes(names, values)
        slopes = [{x: ex.derivative(e, parameter) for x, e in line.items()} for line in self.lines]
        table = self._table(names, values)
        # β ∂v/∂p = −(∂α/∂p + ∂β/∂p · v)
        change = _numbers(slopes, names, values) / size
        return np.linalg.lstsq(
            table[:, 1:], -(change[:, 0] + change[:, 1:] @ velocity), rcond=None
        )[0]

    def shifts(self, states: list[str], values: Mapping[str, float]) -> Array:
        """Shifts of some states, of any size, that leave lines and phases unchanged for all values
        of the constants; shape (states, shifts).

        Parameters
        ----------
        states : list of str
            Those that may be shifted.
        values : mapping of str to float
            Generic values of the constants, without relations between them.
        """
        own = frozenset(states)
        rows = [
            {x: slope for x, slope in row.items() if x in own}
            for row in (*self.lines, *self.phases)
        ]
        table = _numbers(rows, states, values)
        size = np.max(np.abs(table), axis=1, keepdims=True, initial=0.0)
        found = _echelon(_kernel(table / np.where(size > 0.0, size, 1.0)))
        kept = [k for k, shift in enumerate(found.T) if _leaves(rows, states, shift)]
        return found[:, kept]

    def changes_phase(self, states: list[str], values: Mapping[str, float]) -> bool:
        """Return whether some shift of the state alone leaves the lines unchanged, and changes a
        phase."""
        return bool(np.any(self._turned(states, values)[2]))

    def cells(self, states: list[str], values: Mapping[str, float]) -> Array:
        """Smallest shifts of the state alone that shift phases by whole periods, shape (states,
        cells).

        There are none for phases without small integer ratios.
        """
        phases, free, turned = self._turned(states, values)
        if not np.any(turned):
            return np.zeros((len(states), 0))
        # A maximal set of independent phases turns by whole numbers; the others follow.
        first = list[int]()
        for i in np.argsort(-np.max(np.abs(turned), axis=1, initial=0.0), kind="stable"):
            row = turned[i] - turned[first].T @ _solved(turned[first].T, turned[i])
            if np.max(np.abs(row), initial=0.0) > MAKES_UP * np.max(np.abs(turned), initial=0.0):
                first.append(int(i))
        found = list[Array]()
        least = free @ np.linalg.pinv(turned[first])
        for cell in least.T:
            turns = phases @ cell
            parts = [Fraction(float(x)).limit_denominator(_MOST_CELLS) for x in turns]
            if np.allclose([float(x) for x in parts], turns, rtol=MAKES_UP, atol=MAKES_UP):
                found.append(cell * math.lcm(*(part.denominator for part in parts)))
        cells = np.array(found).reshape(len(found), len(states)).T
        return np.where(
            np.abs(cells) > ROUNDED_SUM * np.max(np.abs(cells), initial=0.0), cells, 0.0
        )

    def _turned(self, states: list[str], values: Mapping[str, float]) -> tuple[Array, Array, Array]:
        """The phases as rows of numbers, shifts that leave the lines unchanged as columns, and the
        changes of the phases by these shifts."""
        phases = _numbers(self.phases, ["t", *states], values)[:, 1:]
        if not np.any(phases):
            return phases, np.zeros((len(states), 0)), np.zeros((len(phases), 0))
        free = _kernel(self._table(["t", *states], values)[:, 1:])
        turned = phases @ free
        terms = np.abs(phases) @ np.abs(free)
        return phases, free, np.where(np.abs(turned) > MAKES_UP * terms, turned, 0.0)

    def timed(self) -> Expr:
        """A term with a line in time that no frame compensates, for messages."""
        found = [e for line, e in zip(self.lines, self.terms, strict=True) if "t" in line]
        return min(found, key=lambda e: len(e.symbols))

    def _table(self, names: list[str], values: Mapping[str, float]) -> Array:
        """The lines as rows of numbers, the largest of each ±1."""
        return _numbers(self.lines, names, values) / self._sizes(names, values)

    def _sizes(self, names: list[str], values: Mapping[str, float]) -> Array:
        size = np.max(np.abs(_numbers(self.lines, names, values)), axis=1, initial=0.0)
        return np.where(size > 0.0, size, 1.0)[:, None]


def _kernel(matrix: Array) -> Array:
    """Basis of the null space of a matrix, shape (columns, vectors)."""
    _, s, v = np.linalg.svd(np.vstack([matrix, np.zeros((1, matrix.shape[1]))]))
    return v[int(np.sum(s > MAKES_UP * s[0])) if len(s) else 0 :].T


def _echelon(directions: Array) -> Array:
    """Reduced echelon basis of the span of some directions; shape (n, directions)."""
    rows = directions.T.copy()
    done = 0
    for j in range(rows.shape[1]):
        if done == len(rows):
            break
        i = done + int(np.argmax(np.abs(rows[done:, j])))
        if abs(rows[i, j]) <= MAKES_UP:
            continue
        rows[[done, i]] = rows[[i, done]]
        rows[done] /= rows[done, j]
        others = np.arange(len(rows)) != done
        rows[others] -= np.outer(rows[others, j], rows[done])
        done += 1
    whole = np.round(rows)
    return np.where(np.abs(rows - whole) < NEARLY_WHOLE, whole, rows).T


def _leaves(rows: list[Slopes], states: list[str], shift: Array) -> bool:
    """Return whether a shift leaves lines and phases structurally unchanged."""
    weights = {x: float(w) for x, w in zip(states, shift, strict=True) if w != 0.0}
    return all(
        ex.add(*((slope, weights[x]) for x, slope in row.items() if x in weights)) is ex.ZERO
        for row in rows
    )


def _solved(matrix: Array, right: Array) -> Array:
    return np.linalg.lstsq(matrix, right, rcond=None)[0]


def _numbers(rows: list[Slopes], names: list[str], values: Mapping[str, float]) -> Array:
    place = {name: i for i, name in enumerate(names)}
    table = np.zeros((len(rows), len(names)))
    for row, slopes in zip(table, rows, strict=True):
        for name, slope in slopes.items():
            row[place[name]] = ex.evaluate(slope, values)
    return table


def read_formulas(
    formulas: Iterable[Expr],
    names: Iterable[str],
    *,
    constant: Iterable[str] = (),
    since: float = -math.inf,
) -> Reading:
    """Occurrences of some names in formulas.

    Parameters
    ----------
    constant : iterable of str
        Names on which slopes may depend.
    since : float
        Branches of formulas that end before this time are ignored.
    """
    reader = _Reader(frozenset(names), frozenset(constant), since)
    for formula in formulas:
        reader.look(formula)
    return Reading(reader.lines, reader.phases, reader.terms)


class _Reader:
    def __init__(self, names: frozenset[str], constant: frozenset[str], since: float) -> None:
        self.names = names
        self.constant = constant
        self.ranges = {"t": (since, math.inf)}
        self.lines: list[Slopes] = []
        self.phases: list[Slopes] = []
        self.terms: list[Expr] = []
        self.within: Expr | None = None  # the outermost term that is looked into
        self.seen: set[Expr] = set()

    def look(self, e: Expr) -> None:
        """Record the lines and phases of an expression."""
        if not e.symbols & self.names or e in self.seen:
            return
        self.seen.add(e)
        period = FUNCTIONS[e.op].period if e.op in FUNCTIONS else 0.0
        if period:
            self._split(e.args[0], self.phases, 1.0 / period)
        elif e.op == "select":
            low, high = bounds(e.args[0], self.ranges)
            for part in e.args[1:2] if low >= 0.0 else e.args[2:] if high < 0.0 else e.args:
                self.look(part)
        else:
            self._split(e, self.lines, 1.0)

    def _split(self, e: Expr, kept: list[Slopes], unit: float) -> None:
        """Record the part of an expression that is linear in the names, and search the remaining
        parts."""
        even: Slopes = {}
        rest: list[Expr] = []
        for term, weight in e.terms if e.op == "sum" else ((e, 1.0),):
            felt = term.symbols & self.names
            slopes = {name: ex.derivative(term, name) for name in sorted(felt)}
            if ex.bends(term, felt) or any(not s.symbols <= self.constant for s in slopes.values()):
                rest.append(term)
                continue
            for name, slope in slopes.items():
                even[name] = even.get(name, ex.ZERO) + unit * weight * slope
        even = {name: slope for name, slope in even.items() if slope is not ex.ZERO}
        if even:
            kept.append(even)
            if kept is self.lines:
                shown = ((ex.sym(name) * slope, 1.0) for name, slope in even.items())
                self.terms.append(self.within or ex.add(*shown))
        for term in rest:
            if term is not e or kept is self.phases:
                self.look(term)
                continue
            outermost, self.within = self.within, self.within or e
            for part in (*e.args, *(base for base, _ in e.terms)):
                self.look(part)
            self.within = outermost
