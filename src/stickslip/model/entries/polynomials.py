"""Polynomials between samples or the knots of a table, and their rows in the table of functions.

What depends on time has one gate, since time goes forward. The argument of a table goes both ways.
Its gate has two rows more: in the region of even pieces it is that of the nearest even piece, which
is one polynomial up to the middle of both neighbours, and likewise in the other one. So a series
that begins at a knot holds on whichever side of it the motion goes on.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, cast
from weakref import WeakValueDictionary

import numpy as np

from stickslip.arrays import Array
from stickslip.kept import cached_property
from stickslip.numerics.levels import ONE_ULP, ROUNDED_TERM
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import ARGUMENT, FUNCTIONS, Function
from stickslip.symbolic.pieces import shown

if TYPE_CHECKING:
    from stickslip.machine_code.objects import Provider
    from stickslip.symbolic.intervals import Interval


SIDES = ("even", "odd", "gate")
# relative to the largest time: a time this close to a sample is that of the sample
NEAR_SAMPLE = 16.0 * ONE_ULP

INTEGRAL = "integral_"  # prefix of the name of an integral
_END = 1e-9  # relative to the largest break: a point this close to an end of a table is at the end

LIVING: WeakValueDictionary[str, PiecewisePolynomial] = WeakValueDictionary()


@dataclass(frozen=True, eq=False)
class Surface:
    """Bounds of the values of a surface, cell by cell.

    Attributes
    ----------
    breaks : pair of arrays, shapes (columns + 1,) and (rows + 1,)
        Of the cells; the outer ones have no end.
    low, high : array, shape (columns, rows)
        Infinite where it is not bounded.
    terms : int
        Of its polynomials.
    """

    breaks: tuple[Array, Array]
    low: Array
    high: Array
    terms: int

    def bounds(self, x: Interval, y: Interval) -> Interval:
        """Least and largest value in a box; also for arrays of boxes."""
        ends = [np.broadcast_arrays(*(np.asarray(end, float) for end in a)) for a in (x, y)]
        shape = np.broadcast_shapes(*(np.shape(a[0]) for a in ends))
        found = np.empty((2, *shape))
        for place in np.ndindex(*shape):
            cells = tuple(
                self._cells(axis, *(float(np.broadcast_to(end, shape)[place]) for end in a))
                for axis, a in enumerate(ends)
            )
            found[(0, *place)] = self.low[cells].min()
            found[(1, *place)] = self.high[cells].max()
        return (found[0], found[1]) if shape else (float(found[0]), float(found[1]))

    def _cells(self, axis: int, low: float, high: float) -> slice:
        inner = self.breaks[axis][1:-1]
        if math.isnan(low) or math.isnan(high):
            return slice(None)
        first = int(np.searchsorted(inner, low, side="left"))
        return slice(first, int(np.searchsorted(inner, high, side="right")) + 1)


@dataclass(frozen=True, eq=False)
class PiecewisePolynomial:
    """A function piece by piece.

    Attributes
    ----------
    breaks : array, shape (m + 1,)
    coefficients : array, shape (m, d + 1)
        Of the powers of what is left of a place from the beginning of its piece.
    sides : tuple of str
        Which rows there are: values of "even" and "odd" pieces, and the "gate"; or those of the
        piece around a place, its "own", of what never comes to the end of one.
    called : str
        How formulas call it, if they do: of a table.
    covered : (float, float) or None
        Outside of which a table has no values. Its first and its last piece go on for ever, its
        gates too. None: samples, of which nothing is known outside the breaks.
    surface : Surface or None
        Of the knots along the second axis of a surface, of its constant terms, and of the numbers
        of its pieces along the first axis.
    kinked : bool
        Of knots: whether they are those of a function with kinks.
    bounded : (float, float) or None
        Of knots: outside of which the function is undefined, if it is somewhere.
    unit : str
        Unit of the values; empty if it is not known.
    """

    name: str
    breaks: Array
    coefficients: Array
    period: float
    sides: tuple[str, ...] = SIDES
    called: str = ""
    covered: Interval | None = None
    surface: Surface | None = None
    kinked: bool = False
    bounded: Interval | None = None
    unit: str = ""

    @property
    def both_ways(self) -> bool:
        """Whether its argument may go back."""
        return self.covered is not None

    def ends(self, side: str) -> Interval:
        """Outside of which a side is undefined, but for rounding."""
        if self.covered is None:
            return float(self.breaks[0]), float(self.breaks[-1])
        return (-math.inf, math.inf) if _is_gate(side) else self.covered

    def undefined(self, side: str) -> Interval:
        """The limits below which the first piece of a side, and above which the last one, is
        undefined. A motion that has reached an end is in the piece there, independently of
        rounding."""
        first, last = self.ends(side)
        reach = _END * self.largest if self.both_ways else -NEAR_SAMPLE * self.largest
        return first + reach, last - reach

    @cached_property
    def smoothness(self) -> int:
        """Number of continuous derivatives, up to rounding; −1 if it jumps."""
        length = np.diff(self.breaks)[:-1]
        for order in range(self.coefficients.shape[1]):
            factors = self.factors("even", order)
            terms = [
                self.coefficients[:, order + j] * (factors[j] * np.append(length, 1.0) ** j)
                for j in range(len(factors))
            ]
            end, size = np.sum(terms, axis=0)[:-1], np.sum(np.abs(terms), axis=0)
            slack = ROUNDED_TERM * np.maximum(size[:-1], size[1:])
            if np.any(np.abs(end - terms[0][1:]) > slack):
                return order - 1
        return self.coefficients.shape[1]

    @cached_property
    def largest(self) -> float:
        """The largest break, by its absolute value."""
        return float(np.max(np.abs(self.breaks)))

    def near(self, x: Array) -> Array:
        """Accuracy of the argument: in a late period, that of the time, which includes the rounding
        error of all periods before it."""
        return NEAR_SAMPLE * np.maximum(np.abs(x) if self.period > 0.0 else 0.0, self.largest)

    @cached_property
    def gates(self) -> Array:
        """Coefficients of the gates; none closes at the ends of all samples, where the value does
        not change."""
        length = np.diff(self.breaks)
        sense = np.where(np.arange(len(length)) % 2 == 0, 1.0, -1.0)
        gates = np.stack([np.zeros(len(length)), sense, -sense / length], axis=1)
        if self.both_ways:
            gates[0] = length[0], -1.0, 0.0
            gates[-1] = 0.0, sense[-1], 0.0
        elif self.period == 0.0:
            gates[0] = 1.0, -1.0 / length[0], 0.0  # (r − t)/(r − l)
            gates[-1] = 0.0, sense[-1], 0.0
            if len(length) == 1:
                gates[0] = 1.0, 0.0, 0.0
        return gates

    def table(self, side: str) -> Array:
        """The coefficients on a side: of the gates, or the values."""
        return self.gates if _is_gate(side) else self.coefficients

    def place(self, x: Array, side: str) -> tuple[Array, Array]:
        """The piece for x on a side, and the distance of x from its beginning."""
        b, m = self.breaks, len(self.breaks) - 1
        near = self.near(x)
        if self.period > 0.0:
            x = x - np.floor((x - b[0]) / self.period) * self.period
        elif not self.both_ways:
            x = np.where((x <= b[-1] + near) & (x >= b[0] - near), x, np.nan)
        i = np.clip(np.searchsorted(b, x, side="right") - 1, 0, m - 1)
        if side == "gate":
            k = np.where(b[i + 1] - x <= near, i + 1, i)
        elif side == "own":
            k = i
        else:
            other = np.where(x - b[i] < b[i + 1] - x, i - 1, i + 1)
            k = np.where(i % 2 == (0 if side.startswith("even") else 1), i, other)
        if self.period > 0.0:
            x = np.where(k == m, x - self.period, np.where(k < 0, x + self.period, x))
            k = k % m
        else:
            inner = m - 1 if side == "gate" else max(m - 2, 0)
            k = np.where(k == m, inner, np.where(k < 0, min(1, m - 1), k))
        if self.both_ways:
            first, last = self.ends(side)
            beyond = ((k == 0) & (x < first - near)) | ((k == m - 1) & (x > last + near))
            x = np.where(beyond, np.nan, x)
        return k, x - b[k]

    def values(self, x: Array, side: str, order: int) -> Array:
        """Derivatives of an order."""
        with np.errstate(invalid="ignore"):
            k, u = self.place(np.asarray(x, float), side)
            factors = self.factors(side, order)
            skipped = self.table(side).shape[1] - len(factors)
            total = 0.0 * u
            for j in range(len(factors) - 1, -1, -1):
                total = total * u + self.table(side)[k, skipped + j] * factors[j]
        return total

    def factors(self, side: str, order: int) -> list[float]:
        """Factors of the coefficients of a derivative."""
        width = self.table(side).shape[1]
        return [float(math.perm(j + order, order)) for j in range(width - order)]

    def rows(self) -> dict[str, str]:
        """By side the name of the row of the table of functions, which is put there."""
        _ = self._provider
        return {side: self.row_name(side, 0) for side in self._sides}

    @property
    def _sides(self) -> list[str]:
        more = ["evengate", "oddgate"] if self.both_ways and "gate" in self.sides else []
        return [*self.sides, *more]

    def row_name(self, side: str, order: int) -> str:
        """Name of a derivative on a side."""
        return f"{self.name}_{side}{order}"

    @cached_property
    def _provider(self) -> Provider:
        """The machine code of the rows, which are in the table of functions as long as this
        exists."""
        from stickslip.machine_code.tabulated import provide_table

        called = {}
        for side in self._sides:
            for order in range(self.table(side).shape[1]):
                row = TableRow(pieces=self, side=side, order=order)
                FUNCTIONS[row.name] = row
                called[row.name] = side, self.factors(side, order)
        weakref.finalize(self, _remove, self.name, list(called)).atexit = False
        beyond = {side: self.undefined(side) for side in self._sides}
        return provide_table(
            called, self.breaks, self.coefficients, self.gates, self.period, NEAR_SAMPLE, beyond
        )

    def bounds(self, a: Interval, side: str, order: int) -> Interval:
        """Least and largest value of a derivative between two places, over the pieces themselves
        without their continuations; also for arrays of places."""
        low, high = (np.asarray(end, float) for end in a)
        pairs = zip(low.flat, high.flat, strict=True)
        ends = [self._bounds_between(float(x), float(y), side, order) for x, y in pairs]
        found = np.array(ends).reshape(*low.shape, 2)
        return (found[..., 0], found[..., 1]) if low.ndim else (float(found[0]), float(found[1]))

    def _bounds_between(self, low: float, high: float, side: str, order: int) -> Interval:
        b, m = self.breaks, len(self.breaks) - 1
        first, last = float(b[0]), float(b[-1])
        least, largest = self._extremes(side, order)
        if self.period > 0.0 and not high - low < self.period:
            return float(least.min()), float(largest.max())
        if self.period > 0.0:
            turns = math.floor((low - first) / self.period) * self.period
            low, high = low - turns, high - turns
            if high > last:
                parts = [(low, last), (first, high - self.period)]
                ends = [self._bounds_between(x, y, side, order) for x, y in parts]
                return min(e[0] for e in ends), max(e[1] for e in ends)
        if math.isnan(low) or math.isnan(high):
            return -math.inf, math.inf
        i, j = (int(np.clip(np.searchsorted(b, x, "right") - 1, 0, m - 1)) for x in (low, high))
        inner = slice(i + 1, j)
        found = [self._on_piece(k, low, high, side, order) for k in {i, j}]
        if j > i + 1:
            found.append((float(least[inner].min()), float(largest[inner].max())))
        return min(e[0] for e in found), max(e[1] for e in found)

    def _on_piece(self, k: int, low: float, high: float, side: str, order: int) -> Interval:
        """Bounds on a part of one piece, by its ends and where its slope vanishes."""
        origin = start = float(self.breaks[k])
        end = float(self.breaks[k + 1])
        if self.both_ways:
            first, last = self.ends(side)
            start = first if k == 0 else start
            end = last if k == len(self.breaks) - 2 else end
        x, y = (min(max(place, start), end) - origin for place in (low, high))
        c = np.trim_zeros(derived(self.table(side)[k], order), "b")
        if len(c) < 2:
            return (float(c[0]), float(c[0])) if len(c) else (0.0, 0.0)
        if math.isinf(x) or math.isinf(y):
            ends = sorted(float(c[0] + c[1] * u) for u in (x, y))
            return (ends[0], ends[1]) if len(c) == 2 else (-math.inf, math.inf)
        turning = [float(r.real) for r in np.roots(derived(c, 1)[::-1]) if x < r.real < y]
        values = [float(np.polynomial.polynomial.polyval(u, c)) for u in (x, y, *turning)]
        size = sum(abs(float(a)) * max(abs(x), abs(y)) ** n for n, a in enumerate(c))
        slack = ROUNDED_TERM * len(c) * size
        return min(values) - slack, max(values) + slack

    def _extremes(self, side: str, order: int) -> tuple[Array, Array]:
        """Bounds on every piece: up to degree three by its ends and where its slope vanishes, else
        by Bernstein coefficients."""
        key = _is_gate(side), order
        if key not in self._known:
            table = self.table(side)
            factors = self.factors(side, order)
            length = np.diff(self.breaks)
            d = len(factors) - 1
            scaled = [table[:, order + j] * (factors[j] * length**j) for j in range(d + 1)]
            ends = (
                _turning_values(scaled)
                if d in (2, 3)
                else [
                    sum(
                        (math.comb(i, j) / math.comb(d, j) * scaled[j] for j in range(1, i + 1)),
                        scaled[0],
                    )
                    for i in range(d + 1)
                ]
            )
            slack = ROUNDED_TERM * (d + 1) * sum(np.abs(part) for part in scaled)
            low = np.minimum.reduce(ends) - slack
            self._known[key] = low, np.maximum.reduce(ends) + slack
        return self._known[key]

    @cached_property
    def _known(self) -> dict[tuple[bool, int], tuple[Array, Array]]:
        return {}


def _is_gate(side: str) -> bool:
    return side.endswith("gate")


def is_bounded(guard: Expr) -> bool:
    """Whether it is the gate of a table that is undefined beyond one of its knots."""
    row = FUNCTIONS.get(guard.op)
    return isinstance(row, TableRow) and row.sampled and row.pieces.bounded is not None


def beyond_an_end(guard: Expr, values: Mapping[str, float]) -> str:
    """Message for an argument of the gate of a table that is at or beyond an end; empty otherwise,
    or if the argument depends on names without a value."""
    row = FUNCTIONS.get(guard.op)
    ends = row.pieces.bounded if isinstance(row, TableRow) and row.sampled else None
    if ends is None or not guard.symbols <= values.keys():
        return ""
    assert isinstance(row, TableRow)
    x = ex.evaluate(guard.args[0], values)
    near = _END * row.pieces.largest
    if ends[0] + near < x < ends[1] - near:
        return ""
    end = f"begins at {ends[0]:.9g}" if x <= ends[0] + near else f"ends at {ends[1]:.9g}"
    return f"{x:.9g}, and '{row.called}' {end}"


def ends_of_tables(
    guards: Iterable[Expr], speeds: Mapping[str, Expr], values: Mapping[str, float]
) -> list[str]:
    """Tables whose argument is at or beyond an end, with that argument.

    Parameters
    ----------
    speeds : mapping of str to Expr
        Of contacts, by the names that formulas have for them.
    """
    found = list[str]()
    for guard in filter(is_bounded, guards):
        if said := beyond_an_end(ex.substitute(guard, speeds), values):
            found.append(f"{shown(guard.args[0])} = {said}")
    return found


@lru_cache(maxsize=4096)
def _first_argument(e: Expr, surface: Surface) -> Expr | None:
    """The first argument of a surface, if an expression is its value and no derivative."""
    terms = e.args[1].terms if len(e.args[1].terms) == surface.terms else ()
    for term, _ in terms:
        row = FUNCTIONS.get(term.op)
        if isinstance(row, TableRow) and row.pieces.surface is surface:
            for n in ex.walk(term.args):
                part = FUNCTIONS.get(n.op)
                if isinstance(part, TableRow) and part.pieces.surface is surface:
                    return n.args[0]
    return None


def in_own_piece(guard: Expr) -> Expr:
    """The guard of a select; if it is the gate of a table, such that it is in each region that of
    the pieces of that region."""
    row = FUNCTIONS.get(guard.op)
    if not isinstance(row, TableRow) or not row.sampled or not row.pieces.both_ways:
        return guard
    rows = row.pieces.rows()
    (x,) = guard.args
    return ex.select(guard, ex.call(rows["evengate"], x), ex.call(rows["oddgate"], x))


def _remove(name: str, rows: list[str]) -> None:
    """Take rows whose samples are gone out of the table of functions."""
    from stickslip.machine_code.objects import withdraw

    if name not in LIVING:
        for row in rows:
            FUNCTIONS.pop(row, None)
        withdraw(rows)


def _turning_values(c: list[Array]) -> list[Array]:
    """Values of polynomials of degree two or three between 0 and 1 at both ends, and where their
    slopes vanish in between."""
    c0, c1, c2, c3 = (*c, 0.0 * c[0])[:4]
    a, b = 3.0 * c3, 2.0 * c2
    with np.errstate(all="ignore"):
        q = -0.5 * (b + np.copysign(np.sqrt(np.maximum(b * b - 4.0 * a * c1, 0.0)), b))
        places = [
            np.clip(np.nan_to_num(s, posinf=0.0, neginf=0.0), 0.0, 1.0) for s in (q / a, c1 / q)
        ]
    return [((c3 * s + c2) * s + c1) * s + c0 for s in (0.0, 1.0, *places)]


def derived(c: Array, order: int) -> Array:
    """Coefficients of a derivative."""
    for _ in range(order):
        c = np.arange(1, len(c)) * c[1:] if len(c) > 1 else np.zeros(1)
    return c


class TableRow(Function):
    """A derivative of a table on one side, as a row of the table of functions."""

    def __init__(self, pieces: PiecewisePolynomial, side: str, order: int) -> None:
        super().__init__(
            name=pieces.row_name(side, order),
            value=lambda x: float(self.pieces.values(np.array(x), side, order)),
            derivative="",
            period=pieces.period,
            within=f"{pieces.period!r}*wrap(x/{pieces.period!r})" if pieces.period else "",
            typed=f"{pieces.name}(x)",
        )
        object.__setattr__(self, "table", pieces.name)
        object.__setattr__(self, "side", side)
        object.__setattr__(self, "order", order)

    table: str
    side: str
    order: int

    @property
    def pieces(self) -> PiecewisePolynomial:
        """Its table, which belongs to the samples: expressions that somebody remembers do not keep
        it.

        Raises
        ------
        ReferenceError
            If they are gone.
        """
        found = LIVING.get(self.table)
        if found is None:
            raise ReferenceError(f"{self.table}: these samples are no longer available")
        return found

    @cached_property
    def array(self) -> Any:
        """The function of arrays."""
        return lambda x: self.pieces.values(np.asarray(x, float), self.side, self.order)

    @cached_property
    def slope(self) -> Expr:
        """The next derivative."""
        if self.order + 1 == self.pieces.table(self.side).shape[1]:
            return ex.ZERO
        return ex.call(self.pieces.row_name(self.side, self.order + 1), ex.sym(ARGUMENT))

    @cached_property
    def shown_slope(self) -> Expr:
        """The same."""
        return self.slope

    @property
    def tabulated(self) -> bool:
        """Always."""
        return True

    @property
    def sampled(self) -> bool:
        """Whether it is a gate."""
        return self.side == "gate"

    @property
    def unit(self) -> tuple[str, int]:
        """Unit of the values of the table, empty if it is not known, and the power of the unit of
        the argument that this row has besides."""
        pieces = self.pieces
        return pieces.unit, int(pieces.called.startswith(INTEGRAL)) - self.order

    @property
    def called(self) -> str:
        """Name of the table, its derivative or its integral in formulas."""
        name, order = self.pieces.called, self.order
        if name.startswith(INTEGRAL) and order > 0:
            name, order = name.removeprefix(INTEGRAL), order - 1
        return f"{'d_' * order}{name}" if name else ""

    def enclosed_select(self, e: Expr, values: Mapping[Expr, Interval]) -> Interval | None:
        """Enclosure of a surface, from the intervals of its arguments."""
        surface = self.pieces.surface if self.sampled else None
        if surface is None or (x := _first_argument(e, surface)) is None:
            return None
        return surface.bounds(values[x], values[e.args[0].args[0]])

    @property
    def kinked(self) -> bool:
        """Whether it is the gate of a function with kinks."""
        return self.sampled and self.pieces.kinked

    def joins(self, above: Expr, below: Expr) -> bool:
        """Whether it is a gate at which two branches agree."""
        if not self.sampled:
            return False
        rows = [FUNCTIONS.get(e.op) for e in (above, below)]
        if not all(isinstance(row, TableRow) for row in rows) or above.args != below.args:
            return False
        one, other = cast("list[TableRow]", rows)
        return (
            (one.table, one.order) == (other.table, other.order)
            and one.order <= one.pieces.smoothness
            and np.array_equal(one.pieces.breaks, self.pieces.breaks)
        )

    @property
    def jumps(self) -> bool:
        """From piece to piece."""
        return True

    def enclosed(self, a: Interval) -> Interval:
        """Exact range of its values."""
        return self.pieces.bounds(a, self.side, self.order)
