"""Enclosures on expression trees: bounds of the values and slopes of a formula.

The formula is that of the tree, whose numbers have been combined already. One pass over it. The
slope with respect to one name is enclosed along with the value. Where the branches of a function
with a kink meet, it has the slopes of both; where they are not seen to meet, the function may jump,
and the slope is unbounded. For many boxes at once see :mod:`stickslip.symbolic.boxes`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

from stickslip.symbolic.expressions import Expr, number, walk
from stickslip.symbolic.functions import ARGUMENT, FUNCTIONS, Function
from stickslip.symbolic.intervals import (
    EVERYTHING,
    FLOATS,
    LARGEST_FLOAT,
    LOOSE,
    Interval,
    Intervals,
)

_MOST_SIDES = 4  # largest number of nested kinks with separate sides
_NOTHING = (0.0, 0.0)


def bounds(expression: Expr, ranges: Mapping[str, tuple[float, float]]) -> tuple[float, float]:
    """Guaranteed bounds of an expression for names within given ranges (others are unbounded)."""
    return Enclosure([expression], ranges, FLOATS).values[expression]


def sure_sign(expression: Expr, ranges: Mapping[str, tuple[float, float]]) -> int:
    """1 or −1 if an expression provably has that sign for all numbers in the given ranges, even if
    it is arbitrarily close to zero, as 1 − tanh x is; else 0.

    Strictly monotone functions do not reach their limits.
    """
    known = Enclosure([expression], ranges, FLOATS).values
    signs: dict[Expr, int] = {}
    for e in walk([expression]):
        low, high = known[e]
        found = 1 if low > 0.0 else -1 if high < 0.0 else 0
        match e.op:
            case "prod" if not found:
                found = 1
                for base, p in e.terms:
                    even, whole = p % 2.0 == 0.0, p.is_integer()
                    own = signs[base]
                    found *= abs(own) if even else own if whole else max(own, 0)
            case "pow" if not found:
                found = max(signs[e.args[0]], 0)
            case "sum" if low >= 0.0 or high <= 0.0:
                side = 1 if low >= 0.0 else -1
                if any(
                    _stays_off(t, known[t], signs[t], side if c > 0 else -side) for t, c in e.terms
                ):
                    found = side
            case _ if e.op in FUNCTIONS and not found and (low >= 0.0 or high <= 0.0):
                side = 1 if low >= 0.0 else -1
                found = side if _stays_off(e, (low, high), 0, side) else 0
        signs[e] = found
    return signs[expression]


def _stays_off(e: Expr, bounds: Interval, sign: int, side: int) -> bool:
    """Whether an expression does not reach its lower bound (side 1) or its upper one (side −1)."""
    end = bounds[0 if side > 0 else 1]
    if end == 0.0 and sign == side:
        return True
    row = FUNCTIONS.get(e.op)
    if row is None or row.limits is None or row.poles is not None or row.parity == "even":
        return False
    return row.domain == EVERYTHING and end in row.limits


class Enclosure:
    """Values, and if a name is given slopes, of all nodes of expression trees.

    Parameters
    ----------
    ranges : mapping of str to interval
        Others are unbounded.
    intervals : Intervals
        The arithmetic.
    name : str, optional
        With respect to which slopes are taken: g(y) − g(x) lies in the slope times y − x, for all x
        and y in a box.
    """

    def __init__(
        self,
        expressions: Sequence[Expr],
        ranges: Mapping[str, Interval],
        intervals: Intervals,
        name: str | None = None,
    ) -> None:
        self.ranges = ranges
        self.intervals = intervals
        self.name = name
        self.values: dict[Expr, Interval] = {}
        self.slopes: dict[Expr, Interval] = {}
        for e in walk(expressions):
            self.values[e] = self._value(e)
            if name in e.symbols:
                self.slopes[e] = self._slope(e)

    def slope(self, e: Expr) -> Interval:
        """Slope of a node."""
        return self.slopes.get(e, _NOTHING)

    def _value(self, e: Expr) -> Interval:
        of, known = self.intervals, self.values
        match e.op:
            case "num":
                return number(e), number(e)
            case "sym":
                return self.ranges.get(str(e.value), EVERYTHING)
            case "sum":
                return self._sum(float(e.value), e.terms)
            case "prod":
                return of.product(of.power(known[base], p) for base, p in e.terms)
            case "pow":
                return of.varying_power(*(known[a] for a in e.args))
            case "select":
                found = self._select(e, ())
                row = FUNCTIONS.get(e.args[0].op)
                closer = None if row is None else row.enclosed_select(e, known)
                if closer is None:
                    return found
                ops = of.ops
                return ops.maximum(found[0], closer[0]), ops.minimum(found[1], closer[1])
            case _:
                return of_function(FUNCTIONS[e.op], known[e.args[0]], of)

    def _sum(self, constant: float, terms: Iterable[tuple[Expr, float]]) -> Interval:
        total: Interval = (constant, constant)
        for term, c in terms:
            total = self.intervals.plus(total, self.intervals.scaled(c, self.values[term]))
        return total

    def _select(self, e: Expr, sides: tuple[tuple[Expr, float], ...]) -> Interval:
        """Values of `e` where every one of the given guards, times its side, is nonnegative.

        Where a branch is c·guard + rest and c·guard is nonnegative, the branch is at least rest:
        this is what bounds max, min, abs and clip.
        """
        ops = self.intervals.ops
        known = self.values.get(e, EVERYTHING)
        low, high = known
        if e.op == "select" and len(sides) < _MOST_SIDES:
            guard, above, below = e.args
            parts = (
                self._select(branch, (*sides, (guard, s)))
                for branch, s in ((above, 1.0), (below, -1.0))
            )
            branched = self._either(e, *parts)
            low, high = ops.maximum(low, branched[0]), ops.minimum(high, branched[1])
        for guard, side in sides:
            for c, constant, rest in _enclosed_splits(e, guard):
                bound: Interval = constant
                for term, weight in rest:
                    of, value = self.intervals, self.values[term]
                    exact = weight[0] == weight[1]
                    part = of.scaled(weight[0], value) if exact else of.times(weight, value)
                    bound = of.plus(bound, part)
                if c * side > 0.0:
                    low = ops.maximum(low, bound[0])
                else:
                    high = ops.minimum(high, bound[1])
        # A region that is empty, exactly or by rounding, gives no bound.
        return ops.where(low <= high, low, known[0]), ops.where(low <= high, high, known[1])

    def _either(self, e: Expr, above: Interval, below: Interval) -> Interval:
        return self.intervals.either(*self._sides(e), above, below)

    def _sides(self, e: Expr) -> tuple[Any, Any]:
        """Whether the first branch of a select can be, and the second."""
        low, high = self.values[e.args[0]]
        return (high > 0.0, low <= 0.0) if e.strict else (high >= 0.0, low < 0.0)

    def _slope(self, e: Expr) -> Interval:
        """Slope of a node that depends on the name."""
        of, known = self.intervals, self.values
        match e.op:
            case "sym":
                return 1.0, 1.0
            case "sum":
                total: Interval = _NOTHING
                for term, c in e.terms:
                    if term in self.slopes:
                        total = of.plus(total, of.scaled(c, self.slopes[term]))
                return total
            case "prod":
                return self._slope_of_product(e)
            case "pow":
                base, exponent = e.args
                first = of.times(self.slope(exponent), of.log(known[base]))
                other = of.product([known[exponent], of.power(known[base], -1.0), self.slope(base)])
                return of.unless(known[base][0] < 0.0, of.times(known[e], of.plus(first, other)))
            case "select":
                guard, above, below = e.args
                both = self._either(e, self.slope(above), self.slope(below))
                if joins(guard, above, below):
                    return both
                first, second = self._sides(e)
                return of.unless(first & second, both)
            case _:
                (x,) = e.args
                return of.times(slope_of_function(FUNCTIONS[e.op], known[x], of), self.slopes[x])

    def _slope_of_product(self, e: Expr) -> Interval:
        of = self.intervals
        total = _NOTHING
        for base, p in e.terms:
            if base in self.slopes:
                box = self.values[base]
                outer = self._slope_of_power(box, p)
                others = (
                    of.power(self.values[other], q) for other, q in e.terms if other is not base
                )
                part = of.product([outer, self.slopes[base], *others])
                if p < 0.0:  # across a pole, differences have any quotient
                    part = of.unless((box[0] <= 0.0) & (box[1] >= 0.0), part)
                total = of.plus(total, part)
        return total

    def _slope_of_power(self, box: Interval, p: float) -> Interval:
        of = self.intervals
        if p == 1.0:
            return 1.0, 1.0
        exactly = (p - 1.0) + 1.0 == p
        power = of.power(box, p - 1.0) if exactly else of.times(of.power(box, p), of.inverse(box))
        return of.scaled(p, power)


# -- functions -------------------------------------------------------------------------------------


def of_function(row: Function, a: Interval, of: Intervals) -> Interval:
    """Enclosure of a function of the table.

    One that is neither monotone nor a wave lies between its values at the ends where its slope has
    one sign, and else near its value in the middle (mean value).
    """
    if (known := row.enclosed(a)) is not None:
        return known
    if row.limits is not None or row.crest is not None:
        return of.function(row, a)
    ops = of.ops
    a = of.inside(row, a)
    slope = slope_of_function(row, a, of)
    middle = ops.minimum(ops.maximum(0.5 * a[0] + 0.5 * a[1], a[0]), a[1])
    value = of.ends(row, (middle, middle))
    around = of.plus(value, of.times(slope, of.plus(a, (-middle, -middle))))
    around = of.unless((a[0] < -LARGEST_FLOAT) | (a[1] > LARGEST_FLOAT), around)
    ends = of.ends(row, a)
    monotone = (slope[0] >= 0.0) | (slope[1] <= 0.0)
    return (
        ops.where(monotone, ends[0], around[0]),
        ops.where(monotone, ends[1], around[1]),
    )


def slope_of_function(row: Function, a: Interval, of: Intervals) -> Interval:
    """Enclosure of the derivative of a function of the table and of all its difference quotients,
    which are unbounded across a pole."""
    body = row.shown_slope
    slope = Enclosure([body], {ARGUMENT: of.inside(row, a)}, of).values[body]
    return slope if row.poles is None else of.unless(of.passes(a, *row.poles), slope)


# -- kinks -----------------------------------------------------------------------------------------


@lru_cache(maxsize=4096)
def splits(e: Expr, guard: Expr) -> tuple[tuple[float, float, tuple[tuple[Expr, float], ...]], ...]:
    """All c, constant and terms with e = c·guard + constant + terms in which one term of the guard
    is gone.

    What is left of coefficients that cancel up to their own rounding is nothing.
    """
    (constant, terms), (shift, parts) = _linear(e), _linear(guard)
    found = []
    for term, weight in parts.items():
        if term in terms:
            c = terms[term] / weight
            rest = (
                (x, _difference(terms.get(x, 0.0), c * parts.get(x, 0.0)))
                for x in terms | parts
                if x is not term
            )
            found.append(
                (c, _difference(constant, c * shift), tuple((x, v) for x, v in rest if v != 0.0))
            )
    return tuple(found)


@lru_cache(maxsize=4096)
def _enclosed_splits(
    e: Expr, guard: Expr
) -> tuple[tuple[float, Interval, tuple[tuple[Expr, Interval], ...]], ...]:
    """All c, constant and terms with e = c·guard + constant + terms, where c is such that one term
    of the guard is gone, up to rounding; constant and coefficients are enclosed."""
    (constant, terms), (shift, parts) = _linear(e), _linear(guard)

    def left(a: float, c: float, b: float) -> Interval:
        return FLOATS.plus((a, a), FLOATS.scaled(-c, (b, b)))

    found = []
    for term, weight in parts.items():
        if term in terms:
            c = terms[term] / weight
            rest = ((x, left(terms.get(x, 0.0), c, parts.get(x, 0.0))) for x in terms | parts)
            kept = tuple((x, coefficient) for x, coefficient in rest if coefficient != _NOTHING)
            found.append((c, left(constant, c, shift), kept))
    return tuple(found)


def _difference(a: float, b: float) -> float:
    return 0.0 if abs(a - b) <= LOOSE * (abs(a) + abs(b)) else a - b


def _linear(e: Expr) -> tuple[float, dict[Expr, float]]:
    if e.op == "num":
        return number(e), {}
    return (float(e.value), dict(e.terms)) if e.op == "sum" else (0.0, {e: 1.0})


@lru_cache(maxsize=4096)
def joins(guard: Expr, above: Expr, below: Expr) -> bool:
    """Whether two branches are seen to agree wherever their guard is 0, so that there is no
    jump."""
    if guard.op in FUNCTIONS and FUNCTIONS[guard.op].joins(above, below):
        return True
    difference = above - below
    if difference.op == "num":
        return number(difference) == 0.0
    if any(not rest and constant == 0.0 for _, constant, rest in splits(difference, guard)):
        return True
    for one, other in ((above, below), (below, above)):
        if one.op == "select":
            inner, *branches = one.args
            for _, constant, rest in splits(inner, guard):
                if not rest and constant != 0.0:
                    return joins(guard, branches[0 if constant > 0.0 else 1], other)
            return all(joins(guard, branch, other) for branch in branches)
    return False
