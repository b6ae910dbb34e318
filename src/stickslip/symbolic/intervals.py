"""Interval arithmetic: rigorous bounds (low, high), of numbers or arrays.

Every operation is rounded outward, so that bounds are a proof and not an estimate. Sums, and
products by a number, are exact where floating point is (their error is itself a floating-point
number), other products lose one unit in the last place; elementary functions lose four, more than
those of NumPy and of the C library are wrong by. A sign that is sure is never lost. Nothing is ever
NaN: where a function is undefined on part of an interval, its other values count.

What is done to single numbers (`_NUMBERS`, without NumPy) and to arrays
(`stickslip.symbolic.boxes`) is the same code.

Source: R. E. Moore, R. B. Kearfott, M. J. Cloud, *Introduction to Interval Analysis*, SIAM (2009).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

from stickslip.symbolic.functions import FUNCTIONS, Function

Interval = tuple[Any, Any]

EVERYTHING = (-math.inf, math.inf)
LARGEST_FLOAT = math.nextafter(math.inf, 0.0)
LOOSE = 4.0 * 2.0**-52  # relative error of an elementary function, and of a power
_TINY = 1e-321  # absolute error of a result that underflows
_SPLIT = 134217729.0  # 2²⁷ + 1: halves the digits of a number
_SURE = 1e-280  # size of a product above which its error is a floating-point number


def _power(x: float, p: float) -> float:
    """A power with the results of IEEE arithmetic in place of exceptions."""
    try:
        return math.pow(x, p)
    except OverflowError:
        return math.copysign(math.inf, x)
    except ValueError:
        return math.nan


_NUMBERS = SimpleNamespace(
    minimum=min,
    maximum=max,
    where=lambda condition, then, otherwise: then if condition else otherwise,
    lower=lambda x: math.nextafter(x, -math.inf),
    inverse=lambda x: 1.0 / x if x else math.copysign(math.inf, x),
    floor=lambda x: float(math.floor(x)) if math.isfinite(x) else x,
    power=_power,
    function=lambda row: row.ieee,
)
"""The elementary operations on numbers."""


class Intervals:
    """Operations on intervals whose ends are of the type of `ops`."""

    def __init__(self, ops: Any) -> None:
        self.ops = ops

    # -- sums and products -------------------------------------------------------------------------

    def negative(self, a: Interval) -> Interval:
        """−a."""
        return -a[1], -a[0]

    def plus(self, a: Interval, b: Interval) -> Interval:
        """a + b."""
        return self._sum(a[0], b[0]), -self._sum(-a[1], -b[1])

    def _sum(self, x: Any, y: Any) -> Any:
        """x + y rounded down."""
        ops = self.ops
        total = x + y
        exact = (total - x == y) & (total - y == x)
        total = ops.where(exact, total, ops.lower(total))
        return ops.where(total == total, total, -math.inf)

    def scaled(self, c: float, a: Interval) -> Interval:
        """A number c times a."""
        if c < 0.0:
            return self.negative(self.scaled(-c, a))
        return a if c == 1.0 else (self._multiple(c, a[0]), -self._multiple(c, -a[1]))

    def _multiple(self, c: float, x: Any) -> Any:
        """c x rounded down, for c > 0."""
        ops = self.ops
        value = c * x
        ch, xh = _SPLIT * c, _SPLIT * x
        ch, xh = ch - (ch - c), xh - (xh - x)
        cl, xl = c - ch, x - xh
        # c x − value, exactly, if it does not underflow
        error = ((ch * xh - value) + ch * xl + cl * xh) + cl * xl
        fine = ((abs(value) > _SURE) & (error >= 0.0)) | (x == 0.0)
        return ops.where(fine, value, ops.lower(value))

    def times(self, a: Interval, b: Interval) -> Interval:
        """a b."""
        ops = self.ops
        ends = [x * y for x in a for y in b]
        ends = [ops.where(x == x, x, 0.0) for x in ends]  # 0·∞: the infinite end is not a value
        low, high = ends[0], ends[0]
        for end in ends[1:]:
            low, high = ops.minimum(low, end), ops.maximum(high, end)
        low = ops.lower(low)
        high = -ops.lower(-high)
        up = ((a[0] >= 0.0) & (b[0] >= 0.0)) | ((a[1] <= 0.0) & (b[1] <= 0.0))
        down = ((a[0] >= 0.0) & (b[1] <= 0.0)) | ((a[1] <= 0.0) & (b[0] >= 0.0))
        return ops.where(up, ops.maximum(low, 0.0), low), ops.where(
            down, ops.minimum(high, 0.0), high
        )

    def product(self, factors: Iterable[Interval]) -> Interval:
        """Product of several."""
        result: Interval | None = None
        for factor in factors:
            result = factor if result is None else self.times(result, factor)
        return result or (1.0, 1.0)

    def inverse(self, a: Interval) -> Interval:
        """1/a; unbounded to the side from which a can be 0."""
        ops = self.ops
        low = ops.lower(ops.inverse(a[1]))
        high = -ops.lower(-ops.inverse(a[0]))
        low = ops.where(a[0] >= 0.0, ops.maximum(low, 0.0), ops.where(a[1] < 0.0, low, -math.inf))
        high = ops.where(a[1] <= 0.0, ops.minimum(high, 0.0), ops.where(a[0] > 0.0, high, math.inf))
        nowhere = (a[0] == 0.0) & (a[1] == 0.0)
        return ops.where(nowhere, -math.inf, low), ops.where(nowhere, math.inf, high)

    def power(self, a: Interval, p: float) -> Interval:
        """a to a power that is a number; only values at nonnegative a count unless p is whole."""
        if p == 1.0:
            return a
        if p < 0.0:
            return self.inverse(self.power(a, -p))
        if p % 2.0 == 0.0:
            return self._nonnegative(self._power(self.size(a), p))
        if not p.is_integer():
            a = self._nonnegative(a)
        return self._signed(a, self._power(a, p))

    def _power(self, a: Interval, p: float) -> Interval:
        ops = self.ops

        def widened_at_one(x: Any, value: Any) -> Any:
            """No side of 1 is lost to rounding."""
            below = ops.where(abs(x) <= 1.0, ops.minimum(value, 1.0), value)
            return ops.where(x >= 1.0, ops.maximum(value, 1.0), below)

        low, high = self._loosened(ops.power(a[0], p), ops.power(a[1], p))
        return widened_at_one(a[0], low), widened_at_one(a[1], high)

    def varying_power(self, base: Interval, exponent: Interval) -> Interval:
        """base to a power that varies. Where the base is negative, only whole powers are defined:
        of either sign."""
        value = self.exp(self.times(exponent, self.log(self.size(base))))
        return self.ops.where(base[0] >= 0.0, value[0], -value[1]), value[1]

    # -- parts -------------------------------------------------------------------------------------

    def size(self, a: Interval) -> Interval:
        """abs(a)."""
        ops = self.ops
        ends = (abs(a[0]), abs(a[1]))
        through = (a[0] <= 0.0) & (a[1] >= 0.0)
        return ops.where(through, 0.0, ops.minimum(*ends)), ops.maximum(*ends)

    def either(self, first: Any, second: Any, a: Interval, b: Interval) -> Interval:
        """a where only the first can be, b where only the second can, else both."""
        ops = self.ops
        low, high = ops.minimum(a[0], b[0]), ops.maximum(a[1], b[1])
        low = ops.where(first & second, low, ops.where(first, a[0], b[0]))
        return low, ops.where(first & second, high, ops.where(first, a[1], b[1]))

    def unless(self, condition: Any, a: Interval) -> Interval:
        """a, but everything where the condition holds."""
        return self.ops.where(condition, -math.inf, a[0]), self.ops.where(condition, math.inf, a[1])

    def _nonnegative(self, a: Interval) -> Interval:
        return self.ops.maximum(a[0], 0.0), self.ops.maximum(a[1], 0.0)

    def _signed(self, a: Interval, value: Interval) -> Interval:
        """Values of a function that has the sign of its argument."""
        return self._beside(a[0], value[0], 0.0, 0.0), self._beside(a[1], value[1], 0.0, 0.0)

    def _beside(self, x: Any, y: Any, place: float, value: float) -> Any:
        """The bound y of a function that rises, at x: no side of the value that it has at a place
        is lost to rounding."""
        ops = self.ops
        below = ops.where(x < place, ops.minimum(y, value), value)
        return ops.where(x > place, ops.maximum(y, value), below)

    def _loosened(self, low: Any, high: Any) -> Interval:
        """Values of an elementary function, as bounds."""
        ops = self.ops
        low = ops.minimum(low, LARGEST_FLOAT)
        high = ops.maximum(high, -LARGEST_FLOAT)
        return low - (LOOSE * abs(low) + _TINY), high + (LOOSE * abs(high) + _TINY)

    # -- functions ---------------------------------------------------------------------------------

    def function(self, row: Function, a: Interval) -> Interval:
        """A wave, or a function that is monotone (on either side of 0, if it is even; between its
        poles).

        Raises
        ------
        ValueError
            If it is neither: it is enclosed with its slope
            (:func:`stickslip.symbolic.enclosures.of_function`).
        """
        a = self.inside(row, a)
        if row.crest is not None:
            return self._wave(row, a, row.crest)
        if row.limits is None:
            raise ValueError(f"{row.name} is not known to be monotone")
        low, high = self._monotone(row, self.size(a) if row.parity == "even" else a, row.limits)
        if row.poles is None or row.rises:
            return low, high
        passes = self.passes(a, *row.poles)
        return self.ops.where(passes, row.limits[0], low), self.ops.where(
            passes, row.limits[1], high
        )

    def exp(self, a: Interval) -> Interval:
        """exp a."""
        return self.function(FUNCTIONS["exp"], a)

    def log(self, a: Interval) -> Interval:
        """log a."""
        return self.function(FUNCTIONS["log"], a)

    def inside(self, row: Function, a: Interval) -> Interval:
        """The part of an interval in which a function is defined."""
        if row.domain == EVERYTHING:
            return a
        ops = self.ops
        low, high = (ops.minimum(ops.maximum(end, row.domain[0]), row.domain[1]) for end in a)
        return low, high

    def ends(self, row: Function, a: Interval) -> Interval:
        """Bounds of the values of a function at both ends, whichever is larger; unbounded where one
        is undefined."""
        ops = self.ops
        values = self._values(row, a)
        low, high = self._loosened(ops.minimum(*values), ops.maximum(*values))
        undefined = (values[0] != values[0]) | (values[1] != values[1])
        return self.unless(undefined, (low, high))

    def _values(self, row: Function, a: Interval) -> Interval:
        function = self.ops.function(row)
        return function(a[0]), function(a[1])

    def _monotone(self, row: Function, a: Interval, limits: tuple[float, float]) -> Interval:
        """A function that rises from one limit to the other, or falls: then its negative rises."""
        ops = self.ops
        sign = 1.0 if limits[0] < limits[1] else -1.0
        values = self._values(row, a)
        low, high = self._loosened(sign * values[0], sign * values[1])
        if row.fixed is not None:
            place, value = row.fixed
            low, high = (
                self._beside(x, y, place, sign * value) for x, y in zip(a, (low, high), strict=True)
            )
        first, last = sign * limits[0], sign * limits[1]
        # Outside a piece, only the part inside it counts.
        bounds = (
            ops.minimum(ops.maximum(low, first), last),
            ops.maximum(ops.minimum(high, last), first),
        )
        return bounds if sign > 0.0 else self.negative(bounds)

    def passes(self, a: Interval, place: float, period: float) -> Any:
        """Whether place + k·period can lie in a, for a whole k."""
        first, last = (a[0] - place) / period, (a[1] - place) / period
        slack = LOOSE * (1.0 + self.ops.maximum(abs(first), abs(last)))
        return (self.ops.floor(last + slack) >= -self.ops.floor(slack - first)) | (
            abs(first) + abs(last) >= 1e15
        )

    def _wave(self, row: Function, a: Interval, crest: float) -> Interval:
        """A function from −1 to 1 of the period 2π, largest at the crest and least half a period
        later."""
        ops = self.ops
        ends = self._values(row, a)
        low, high = self._loosened(ops.minimum(*ends), ops.maximum(*ends))
        low = ops.where(
            self.passes(a, crest + math.pi, 2.0 * math.pi), -1.0, ops.maximum(low, -1.0)
        )
        return low, ops.where(self.passes(a, crest, 2.0 * math.pi), 1.0, ops.minimum(high, 1.0))


FLOATS = Intervals(_NUMBERS)
