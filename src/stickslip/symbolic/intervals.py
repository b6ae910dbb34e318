"""Interval arithmetic: pairs (low, high) that no value can leave, of numbers or of arrays alike.

Every operation is rounded outward, so that bounds are a proof and not an estimate. Sums, and
products by a number, are exact where floating point is (their error is itself a floating-point
number), other products lose one unit in the last place; elementary functions lose four, more than
those of NumPy and of the C library are wrong by. A sign that is sure is never lost. Nothing is ever
NaN: where a function is undefined on part of an interval, its other values count.

What is done to single numbers (`NUMBERS`, without NumPy) and to arrays (`stickslip.symbolic.boxes`)
is the same code.

Source: R. E. Moore, R. B. Kearfott, M. J. Cloud, *Introduction to Interval Analysis*, SIAM (2009).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any

from stickslip.symbolic.expressions import FUNCTIONS

Interval = tuple[Any, Any]

EVERYTHING = (-math.inf, math.inf)
LARGEST = math.nextafter(math.inf, 0.0)
LOOSE = 4.0 * 2.0**-52  # relative error of an elementary function, and of a power
TINY = 1e-321  # its absolute error where it underflows
SPLIT = 134217729.0  # 2²⁷ + 1: halves the digits of a number
SURE = 1e-280  # size of a product above which its error is a floating-point number
QUARTER = math.pi / 2.0


def _safe(function: Callable[..., float]) -> Callable[..., float]:
    """The function with the results of IEEE arithmetic in place of exceptions."""

    def evaluated(*x: float) -> float:
        try:
            return function(*x)
        except OverflowError:
            return math.copysign(math.inf, x[0]) if function in (math.sinh, math.pow) else math.inf
        except ValueError:
            return -math.inf if function is math.log and x[0] == 0.0 else math.nan

    return evaluated


NUMBERS = SimpleNamespace(
    minimum=min,
    maximum=max,
    where=lambda condition, then, otherwise: then if condition else otherwise,
    lower=lambda x: math.nextafter(x, -math.inf),
    inverse=lambda x: 1.0 / x if x else math.copysign(math.inf, x),
    floor=lambda x: float(math.floor(x)) if math.isfinite(x) else x,
    power=_safe(math.pow),
    functions={name: _safe(f) for name, f in FUNCTIONS.items()},
)
"""The elementary operations on numbers."""


class Intervals:
    """Operations on intervals whose ends are what `ops` works on."""

    def __init__(self, ops: Any) -> None:
        self.ops = ops
        self.functions: dict[str, Callable[[Interval], Interval]] = {
            "exp": self.exp,
            "log": self.log,
            "sin": lambda a: self._wave("sin", a, QUARTER),
            "cos": lambda a: self._wave("cos", a, 0.0),
            "tan": self._tan,
            "cosh": self._cosh,
            **{name: lambda a, name=name: self._odd(name, a) for name in ("sinh", "asinh")},
            "tanh": lambda a: self._odd("tanh", a, 1.0),
            "atan": lambda a: self._odd("atan", a, math.nextafter(QUARTER, 2.0)),
        }
        of = self.functions
        one = (1.0, 1.0)
        self.slopes: dict[str, Callable[[Interval], Interval]] = {
            "exp": self.exp,
            "log": lambda a: self.inverse(self._nonnegative(a)),
            "sin": of["cos"],
            "cos": lambda a: self.negative(of["sin"](a)),
            "tan": lambda a: self.unless(
                self._passes(a, QUARTER, math.pi), self.plus(one, self.power(of["tan"](a), 2.0))
            ),
            "sinh": self._cosh,
            "cosh": of["sinh"],
            "tanh": lambda a: self.power(self._cosh(a), -2.0),
            "asinh": lambda a: self.power(self.plus(one, self.power(a, 2.0)), -0.5),
            "atan": lambda a: self.inverse(self.plus(one, self.power(a, 2.0))),
        }
        """Derivatives of the functions: of all quotients of differences, so unbounded across a
        pole."""

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
        ch, xh = SPLIT * c, SPLIT * x
        ch, xh = ch - (ch - c), xh - (xh - x)
        cl, xl = c - ch, x - xh
        # c x − value, exactly, if it does not underflow
        error = ((ch * xh - value) + ch * xl + cl * xh) + cl * xl
        fine = ((abs(value) > SURE) & (error >= 0.0)) | (x == 0.0)
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

        def beside_one(x: Any, value: Any) -> Any:
            """No side of 1 is lost to rounding."""
            below = ops.where(abs(x) <= 1.0, ops.minimum(value, 1.0), value)
            return ops.where(x >= 1.0, ops.maximum(value, 1.0), below)

        low, high = self._loosened(ops.power(a[0], p), ops.power(a[1], p))
        return beside_one(a[0], low), beside_one(a[1], high)

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
        ops = self.ops

        def signed(x: Any, y: Any) -> Any:
            return ops.where(
                x > 0.0, ops.maximum(y, 0.0), ops.where(x < 0.0, ops.minimum(y, 0.0), 0.0)
            )

        return signed(a[0], value[0]), signed(a[1], value[1])

    def _loosened(self, low: Any, high: Any) -> Interval:
        """Values of an elementary function, as bounds."""
        ops = self.ops
        low = ops.minimum(low, LARGEST)
        high = ops.maximum(high, -LARGEST)
        return low - (LOOSE * abs(low) + TINY), high + (LOOSE * abs(high) + TINY)

    # -- functions ---------------------------------------------------------------------------------

    def _ends(self, name: str, a: Interval) -> Interval:
        function = self.ops.functions[name]
        return function(a[0]), function(a[1])

    def exp(self, a: Interval) -> Interval:
        """exp a."""
        ops = self.ops

        def beside_one(x: Any, value: Any) -> Any:
            below = ops.where(x < 0.0, ops.minimum(value, 1.0), 1.0)
            return ops.where(x > 0.0, ops.maximum(value, 1.0), below)

        low, high = self._nonnegative(self._loosened(*self._ends("exp", a)))
        return beside_one(a[0], low), beside_one(a[1], high)

    def log(self, a: Interval) -> Interval:
        """log a."""
        return self._loosened(*self._ends("log", self._nonnegative(a)))

    def _passes(self, a: Interval, place: float, period: float) -> Any:
        """Whether place + k·period can lie in a, for a whole k."""
        first, last = (a[0] - place) / period, (a[1] - place) / period
        slack = LOOSE * (1.0 + self.ops.maximum(abs(first), abs(last)))
        return (self.ops.floor(last + slack) >= -self.ops.floor(slack - first)) | (
            abs(first) + abs(last) >= 1e15
        )

    def _wave(self, name: str, a: Interval, crest: float) -> Interval:
        """A function from −1 to 1 of the period 2π, largest at the crest and least half a period
        later."""
        ops = self.ops
        ends = self._ends(name, a)
        low, high = self._loosened(ops.minimum(*ends), ops.maximum(*ends))
        low = ops.where(
            self._passes(a, crest + math.pi, 2.0 * math.pi), -1.0, ops.maximum(low, -1.0)
        )
        return low, ops.where(self._passes(a, crest, 2.0 * math.pi), 1.0, ops.minimum(high, 1.0))

    def _tan(self, a: Interval) -> Interval:
        return self.unless(self._passes(a, QUARTER, math.pi), self._loosened(*self._ends("tan", a)))

    def _cosh(self, a: Interval) -> Interval:
        low, high = self._loosened(*self._ends("cosh", self.size(a)))
        return self.ops.maximum(low, 1.0), self.ops.maximum(high, 1.0)

    def _odd(self, name: str, a: Interval, most: float = math.inf) -> Interval:
        """An odd function that rises, between −most and most."""
        low, high = self._signed(a, self._loosened(*self._ends(name, a)))
        return self.ops.maximum(low, -most), self.ops.minimum(high, most)


FLOATS = Intervals(NUMBERS)
