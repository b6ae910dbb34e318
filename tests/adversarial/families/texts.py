"""Random formulas, each as a text and as a Python function's own arithmetic.

Numbers are of a small grid, so that comparisons are often at equality, guards undefined or too
large; nothing is shared with the library but the language. What is added, multiplied or compared
has no name in common: what cancels identically is not part of a formula.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

Rng = np.random.Generator
Values = Mapping[str, float]

GRID = (0.0, 1.0, -1.0, 0.5, -0.5, 2.0, -2.0, 0.25, 3.0)
"""Numbers in formulas, and values of their names: sums, products and comparisons are exact."""

ODD = (0.491, 0.446, 0.7, 0.3184)
"""Numbers whose products are rounded."""


@dataclass(frozen=True)
class Text:
    """A formula.

    Attributes
    ----------
    text : str
    value : callable
        Values of the names -> value: infinite where it overflows, NaN where it is undefined.
    exact : bool
        Whether values on the grid have no rounding errors.
    """

    text: str
    value: Callable[[Values], float]
    exact: bool = True


def drawn(rng: Rng, names: Sequence[str], depth: int = 3, jumps: bool = True) -> Text:
    """A formula of some of the names, without jumps and poles if so wished."""
    if not names:
        return number(float(rng.choice(GRID)))
    if depth <= 0 or rng.uniform() < 0.1:
        return named(str(rng.choice(list(names))))

    def inner(some: Sequence[str] = names) -> Text:
        return drawn(rng, some, depth - 1, jumps)

    mixed = [str(name) for name in rng.permutation(list(names))]
    cut = int(rng.integers(1, len(mixed))) if len(mixed) > 1 and rng.uniform() < 0.7 else 1
    one, other = mixed[:cut], mixed[cut:]
    kind = rng.uniform()
    if kind < 0.35:
        sign = str(rng.choice(["+", "-", "*", "/"] if other else ["+", "-"]))
        second = inner(other)
        if sign == "/":
            second = shifted(rng, second, jumps)
        return binary(sign, inner(one), second)
    if kind < 0.45:
        base = shifted(rng, inner(), jumps)
        return power(base, float(rng.choice([2.0, 3.0, 0.5, -1.0, 1.5, 2.0, -2.0])))
    if kind < 0.60:
        return call(str(rng.choice(list(SMOOTH))), inner())
    if kind < 0.76:
        first = inner(one)
        if rng.uniform() < 0.2:
            first = binary("*", number(float(rng.choice(ODD))), first)
        return least(str(rng.choice(["min", "max"])), first, inner(other))
    if kind < 0.84:
        return call("abs", inner())
    if kind < 0.90 or not jumps:
        return clipped(inner(), number(-1.0), number(0.5))
    if (which := rng.uniform()) < 0.25:
        return call("sign", inner())
    if which < 0.5:
        return left_over(inner(), float(rng.choice([*ODD, 1.0, 2.0])))
    sign = str(rng.choice(["<", "<=", ">", ">="]))
    return chosen(sign, inner(one), inner(other), inner(), binary("-", inner(), number(0.125)))


def shifted(rng: Rng, x: Text, zeros: bool) -> Text:
    """A formula plus a number, such that it has no zeros if so wished."""
    if zeros:
        return binary("+", x, number(float(rng.choice(GRID[1:]))))
    return binary("+", call("abs", x), number(0.5))


def number(x: float) -> Text:
    """A constant."""
    return Text(f"({x:g})" if x < 0.0 else f"{x:g}", lambda v: x, x not in ODD)


def named(name: str) -> Text:
    """A name."""
    return Text(name, lambda v: float(v[name]))


def _divided(a: float, b: float) -> float:
    return math.nan if b == 0.0 else a / b


OPERATIONS: dict[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": _divided,
}


def binary(sign: str, a: Text, b: Text) -> Text:
    """An operation."""
    of = OPERATIONS[sign]
    exact = a.exact and b.exact and sign != "/"
    return Text(f"({a.text} {sign} {b.text})", lambda v: of(a.value(v), b.value(v)), exact)


def _power(x: float, p: float) -> float:
    if x == 0.0 and p < 0.0:
        return math.nan if p % 2.0 == 1.0 else math.inf
    try:
        return math.nan if x < 0.0 and not p.is_integer() else x**p
    except OverflowError:
        return math.copysign(math.inf, x) if p % 2.0 == 1.0 else math.inf


def power(x: Text, p: float) -> Text:
    """A power that is a number."""
    exponent = f"{p:g}" if p > 0.0 else f"({p:g})"
    exact = x.exact and p in (2.0, 3.0)
    return Text(f"({x.text})**{exponent}", lambda v: _power(x.value(v), p), exact)


def _exp(x: float) -> float:
    try:
        return math.exp(x)
    except OverflowError:
        return math.inf


def _log(x: float) -> float:
    if not x > 0.0:
        return -math.inf if x == 0.0 else math.nan
    return math.log(x)


def _sine(x: float) -> float:
    return math.sin(x) if math.isfinite(x) else math.nan


SMOOTH: dict[str, Callable[[float], float]] = {
    "exp": _exp,
    "log": _log,
    "sqrt": lambda x: math.sqrt(x) if x >= 0.0 else math.nan,
    "sin": _sine,
    "tanh": math.tanh,
    "atan": math.atan,
}


def _sign(x: float) -> float:
    return math.nan if math.isnan(x) else float((x > 0.0) - (x < 0.0))


def call(name: str, x: Text) -> Text:
    """A function of one argument."""
    of = {**SMOOTH, "abs": abs, "sign": _sign}[name]
    return Text(f"{name}({x.text})", lambda v: of(x.value(v)), x.exact and name not in SMOOTH)


def _least(a: float, b: float, smaller: bool) -> float:
    if math.isnan(a - b):
        return math.nan
    return min(a, b) if smaller else max(a, b)


def least(name: str, a: Text, b: Text) -> Text:
    """The smaller or the larger of two; undefined where their difference is."""
    return Text(
        f"{name}({a.text}, {b.text})",
        lambda v: _least(a.value(v), b.value(v), name == "min"),
        a.exact and b.exact,
    )


def left_over(x: Text, m: float) -> Text:
    """A formula less whole multiples of a number."""

    def value(v: Values) -> float:
        inner = x.value(v)
        return inner - m * math.floor(inner / m) if math.isfinite(inner) else math.nan

    return Text(f"mod({x.text}, {m:g})", value, x.exact and m not in ODD)


def clipped(x: Text, low: Text, high: Text) -> Text:
    """A function held between two numbers."""

    def value(v: Values) -> float:
        return _least(_least(x.value(v), low.value(v), False), high.value(v), True)

    return Text(f"clip({x.text}, {low.text}, {high.text})", value, x.exact)


COMPARED: dict[str, Callable[[float, float], bool]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}


def chosen(sign: str, a: Text, b: Text, then: Text, otherwise: Text) -> Text:
    """One of two; undefined where what is compared is."""

    def value(v: Values) -> float:
        left, right = a.value(v), b.value(v)
        if math.isnan(left - right):
            return math.nan
        return then.value(v) if COMPARED[sign](left, right) else otherwise.value(v)

    text = f"piecewise({a.text} {sign} {b.text}, {then.text}, {otherwise.text})"
    return Text(text, value, all(x.exact for x in (a, b, then, otherwise)))


def settled(formula: Text, values: Values, rng: Rng) -> float | None:
    """The value, if rounding errors of what it is made of do not decide about it; None if they
    do."""
    here = formula.value(values)
    if formula.exact:
        return here
    for share in (1e-13, -1e-13, *rng.uniform(-1e-13, 1e-13, 4)):
        moved = {n: x * (1.0 + share * rng.uniform(0.5, 1.0)) + share for n, x in values.items()}
        other = formula.value(moved)
        same = (math.isnan(here) and math.isnan(other)) or here == other
        if not same and not abs(other - here) <= 1e-9 * max(1.0, abs(here)):
            return None
    return here


def same(found: float, expected: float) -> bool:
    """Whether two values are the same, up to rounding errors."""
    if math.isnan(expected) or math.isnan(found):
        return math.isnan(expected) and math.isnan(found)
    if math.isinf(expected) or math.isinf(found):
        return expected == found
    return abs(found - expected) <= 1e-10 * max(1.0, abs(expected))
