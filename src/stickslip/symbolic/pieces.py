"""Functions of the formula language that are composed of others: functions with kinks and jumps,
and periodic ones.

Every kink and every jump is a :func:`~stickslip.symbolic.expressions.select` on the sign of a
guard, so that it is an event of a motion. Where its guard is 0 it has the value that was written
for that, in conditions by < or <=, and sign(0) is 0; what goes on piece after piece has the value
from above at its jumps.
What goes on piece after piece has one guard, too: which piece the argument u is in is decided
modulo two by the sign of sin πu, which is smooth everywhere; which of the even (odd) pieces it is,
follows from the argument itself. With wrap(x) = x minus the nearest whole number, u is 2k + 1/2 +
2 wrap(u/2 − 1/4) in the even piece from 2k to 2k + 1, and that is smooth up to half a piece beyond
both of its ends. So regions of a motion stay above and below, however many pieces it goes through,
and repeat where the motion does.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS

_TURN = 2.0 * math.pi
_GRID = 2.0**-50
_SPEED = re.compile(r"speed:\d+")  # speed of a contact, by its number


@dataclass(frozen=True, kw_only=True)
class Pieced:
    """A function with pieces.

    Attributes
    ----------
    made : callable
        Expressions of the arguments -> expression.
    arguments : tuple of str
        As messages call them.
    several : bool
        Whether there may be one or more than these.
    slopes : tuple of str
        Its derivatives as they are shown, formulas in the names of the arguments; of those with
        conditions :mod:`stickslip.display.tree` makes them.
    shown : str
        Its name in equations, by default its own.
    fences : (str, str)
        Brackets around its argument instead of a name, in Unicode.
    latex_fences : (str, str)
        The same in LaTeX.
    repeats : bool
        Whether it has one argument and infinitely many pieces.
    """

    made: Callable[..., Expr]
    arguments: tuple[str, ...] = ("x",)
    several: bool = False
    slopes: tuple[str, ...] = ()
    shown: str = ""
    fences: tuple[str, str] = ("", "")
    latex_fences: tuple[str, str] = ("", "")
    repeats: bool = False
    jumps: bool = False


def _sqrt(x: Expr) -> Expr:
    return ex.power(x, ex.num(0.5))


def _least(first: Expr, *others: Expr) -> Expr:
    for other in others:
        first = ex.minimum(first, other)
    return first


def _most(first: Expr, *others: Expr) -> Expr:
    for other in others:
        first = ex.maximum(first, other)
    return first


def _two(x: Expr, above: float, below: float) -> Expr:
    """One number for x ≥ 0, another for x < 0."""
    return ex.select(x, ex.num(above), ex.num(below))


def _sign(x: Expr) -> Expr:
    return ex.select(x, ex.ONE, _two(x, 0.0, -1.0), strict=True)


def _by_parity(u: Expr, even: Expr, odd: Expr) -> Expr:
    """One expression for an even integer part of u, another for an odd one.

    Without the wrap, sin πu would be the same function, but not exactly 0 at whole numbers.
    """
    return ex.select(ex.call("sin", _TURN * ex.call("wrap", u / 2.0)), even, odd)


def _on_grid(u: Expr) -> Expr:
    """The same up to rounding, with a constant to which quarters are added exactly, so that a shift
    by one period is recognised."""
    if u.op != "sum":
        return u
    constant = float(u.value)
    return u + (round(constant / _GRID) * _GRID - constant)


def _floor(u: Expr) -> Expr:
    if u.op == "num":
        return ex.num(math.floor(ex.number(u)))
    u = _on_grid(u)
    even, odd = (ex.call("floor", u / 2.0 + shift) for shift in (0.25, 0.75))
    return _by_parity(u, 2.0 * even, 2.0 * odd - 1.0)


def _fraction(u: Expr) -> Expr:
    """u minus its whole part."""
    u = _on_grid(u)
    even, odd = (0.5 + 2.0 * ex.call("wrap", u / 2.0 + shift) for shift in (-0.25, 0.25))
    return _by_parity(u, even, odd)


def _mod(x: Expr, m: Expr) -> Expr:
    if ex.is_number(m, 0.0):
        raise ZeroDivisionError("modulo 0 is undefined")
    if x.op == "num" and m.op == "num":
        return ex.num(ex.number(x) % ex.number(m))
    return m * _fraction(x / m)


def _square(x: Expr) -> Expr:
    return _two(ex.call("sin", x), 1.0, -1.0)


def _triangle(x: Expr) -> Expr:
    turns = _on_grid(x / _TURN)
    rising, falling = 4.0 * ex.call("wrap", turns), -4.0 * ex.call("wrap", turns - 0.5)
    return _by_parity(2.0 * turns + 0.5, rising, falling)


def _sawtooth(x: Expr) -> Expr:
    return 2.0 * _fraction(x / _TURN) - 1.0


def _smoothstep(x: Expr, low: Expr, high: Expr) -> Expr:
    return ex.call("ease", ex.clip((x - low) / (high - low), ex.ZERO, ex.ONE))


_BETWEEN = "6*(x - low)*(high - x)"

STRUCTURES: dict[str, Pieced] = {
    "sqrt": Pieced(made=_sqrt, slopes=("1/(2*sqrt(x))",)),
    "abs": Pieced(
        made=ex.absolute,
        slopes=("sign(x)",),
        fences=("|", "|"),
        latex_fences=(r"\left|", r"\right|"),
    ),
    "clip": Pieced(
        made=ex.clip,
        arguments=("x", "low", "high"),
    ),
    "min": Pieced(made=_least, arguments=("x", "y"), several=True),
    "max": Pieced(made=_most, arguments=("x", "y"), several=True),
    "sign": Pieced(made=_sign, slopes=("0",), shown="sgn", jumps=True),
    "heaviside": Pieced(made=lambda x: _two(x, 1.0, 0.0), slopes=("0",), jumps=True),
    "floor": Pieced(
        made=_floor,
        slopes=("0",),
        fences=("⌊", "⌋"),
        latex_fences=(r"\left\lfloor ", r" \right\rfloor"),
        repeats=True,
        jumps=True,
    ),
    "mod": Pieced(made=_mod, arguments=("x", "m"), slopes=("1", "-floor(x/m)"), jumps=True),
    "square": Pieced(made=_square, slopes=("0",), repeats=True, jumps=True),
    "triangle": Pieced(made=_triangle, slopes=("2/pi*square(x + pi/2)",), repeats=True),
    "sawtooth": Pieced(made=_sawtooth, slopes=("1/pi",), jumps=True),
    "smoothstep": Pieced(
        made=_smoothstep,
        arguments=("x", "low", "high"),
        slopes=tuple(
            f"piecewise(x < low, 0, x > high, 0, {slope})"
            for slope in (
                f"{_BETWEEN}/(high - low)**3",
                f"-{_BETWEEN}*(high - x)/(high - low)**4",
                f"-{_BETWEEN}*(x - low)/(high - low)**4",
            )
        ),
    ),
}
"""The functions by name, but for piecewise, whose arguments are no expressions."""

_WRAP, _EASE = "wrap", "ease"  # rows of the table


@lru_cache(maxsize=4096)
def as_call(e: Expr) -> tuple[str, tuple[Expr, ...]] | None:
    """Name and arguments of a function with pieces in the formula language; None if it is not
    recognised."""
    if e.op == _EASE:
        (u, *_) = (n for n in _branches(e.args[0]) if n.op != "num")
        return (
            ("smoothstep", (u, ex.ZERO, ex.ONE)) if e is _smoothstep(u, ex.ZERO, ex.ONE) else None
        )
    if e.op == "select" and e is _sign(e.args[0]):
        return "sign", e.args[:1]
    inner = e.args[0].args if e.op == "select" else ()
    if not inner:
        return None
    wrapped = [n.args[0] for n in ex.walk(inner) if n.op == _WRAP]
    turned = [_TURN * (v - 0.25) for v in wrapped]
    for u in (inner[0], *(2.0 * v for v in wrapped), *map(_plain, turned), *turned):
        for name, structure in STRUCTURES.items():
            if structure.repeats and structure.made(u) is e:
                return name, (u,)
        if _fraction(u) is e:
            return "mod", (u, ex.ONE)
    return None


def _plain(u: Expr) -> Expr:
    """The same expression with numbers of few digits if these differ only by rounding."""

    def plain(number: float) -> float:
        short = float(f"{number:.12g}")
        return short if abs(short - number) <= 16.0 * math.ulp(max(1.0, abs(number))) else number

    if u.op != "sum":
        return u
    return ex.add(*((part, plain(x)) for part, x in (*u.terms, (ex.ONE, float(u.value)))))


def _branches(e: Expr) -> list[Expr]:
    return [part for b in e.args[1:] for part in _branches(b)] if e.op == "select" else [e]


def unwrapped(guard: Expr) -> Expr:
    """A guard as it is printed: sin πu."""

    def plain(e: Expr) -> Expr | None:
        return e.args[0] if e.op == _WRAP else None

    return ex.rewrite(guard, plain)


def boundary(guard: Expr) -> str:
    """Description of the zero of a guard."""
    row = FUNCTIONS.get(guard.op)
    if row is not None and row.sampled and row.called:
        return f"{shown(guard.args[0])} at a knot of {row.called}"
    return f"{shown(unwrapped(guard))} = 0"


def is_smooth_knot(guard: Expr) -> bool:
    """Whether it is passed at a knot of samples or of a table, with a continuous slope there."""
    row = FUNCTIONS.get(guard.op)
    return row is not None and row.sampled and not row.kinked


def shown(e: Expr) -> str:
    """A formula with the names that users have written: the speed of each contact is ``speed``."""
    return _SPEED.sub("speed", ex.to_text(e))


@lru_cache(maxsize=4096)
def periodic_form(e: Expr) -> Expr:
    """The same function except for its values at jumps, in a form that shows its periodic part:
    integer parts as the argument minus a periodic function, guards without their wraps, and signs
    of branches in front."""

    def change(node: Expr) -> Expr | None:
        name, (u, *_) = as_call(node) or ("", (node,))
        if name and STRUCTURES[name].made is _floor:
            return periodic_form(u - _fraction(u))
        if node.op == "select":
            made = ex.select(*map(periodic_form, node.args))
            if made.op == "select":
                guard, above, below = made.args
                if _coefficient(below if above is ex.ZERO else above) < 0.0:
                    return -ex.select(guard, -above, -below)
                return ex.select(guard, above, below)  # the inequality is not strict
            return made
        if node.op in FUNCTIONS and FUNCTIONS[node.op].crest is not None:
            (phase,) = node.args
            (inner, weight), *others = phase.terms or ((phase, 1.0),)
            whole = phase.value == 0.0 and (weight / _TURN).is_integer()
            if inner.op == _WRAP and whole and not others:
                return ex.call(node.op, weight * periodic_form(inner.args[0]))
        return None

    return ex.rewrite(e, change)


def _coefficient(e: Expr) -> float:
    """The first coefficient of a sum, or the number."""
    if e.op == "num":
        return ex.number(e)
    return e.terms[0][1] if e.op == "sum" else 1.0
