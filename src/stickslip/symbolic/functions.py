"""The elementary functions of the formula language: one table, one row for each.

What the library asks of a function it asks this table, so that a new function is a new row. A row
says what nobody can derive: value, derivative, and how its values run. The rest follows from that:

* derivatives of all orders, and slopes on intervals, from the formula of the derivative;
* enclosures from the values at the ends, where the function is monotone; else from the slope;
* the Taylor series from the chain rule, y′ = f′(x) x′, with the series of that formula;
* bounds of the deviation on a complex disc, |f(z) − f(c)| ≤ r sup|f′|.

A few functions are closer to their derivatives than that, and have a `recurrence` and a `growth` of
their own. Whatever is not of this table is structure, not a function: sums and powers
(:mod:`stickslip.symbolic.expressions`), and what has kinks and jumps
(:mod:`stickslip.symbolic.pieces`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Literal

from stickslip.kept import cached_property

if TYPE_CHECKING:
    from stickslip.symbolic.expressions import Expr
    from stickslip.symbolic.intervals import Interval

ARGUMENT = "'x"
"""The argument in the formula of a derivative: no formula of a user can name it."""
_QUARTER = math.pi / 2.0
_ABOVE_QUARTER = math.nextafter(_QUARTER, 2.0)
_ABOVE_HALF = math.nextafter(math.pi, 4.0)
_TURN = 2.0 * math.pi
_WITHOUT_TURNS = "2*atan(tan(x/2))"


@dataclass(frozen=True, eq=False, kw_only=True)
class Function:
    """A row of the table: a function of one real argument, analytic where it is defined (kinks are
    expressed by selects).

    Attributes
    ----------
    name : str
        Its name in formulas.
    value : callable
        float -> float, to a few units in the last place; raises ``ValueError`` where the function
        is undefined.
    derivative : str
        Formula in ``x``, of other functions unless it has a recurrence of its own.
    shown : str
        The same as a person writes it, and such that it is enclosed tightly: ``x`` stands in it
        once, if that can be. By default the same text.
    relative : str
        The derivative divided by the function, if that is a simple formula: so the derivatives of
        1/f do not overflow with f.
    formula : str
        Value in machine code, a formula in ``x`` of others. By default the function of this name in
        the mathematical library of C.
    arrays : str
        Where its function of arrays is, as ``"module:name"``. By default that of `formula`, or
        `value` is called number by number.
    latex : str
        By default the upright name.
    domain : (float, float)
        Where it is defined.
    limits : (float, float) or None
        What it comes to at the ends of the domain (of its half from 0, if it is even), rounded
        outward, if it is monotone there: its values lie in between. With `poles` between two of
        them.
    exactly : (float, float) or None
        A place at which a monotone function has a value without rounding. Odd ones have (0, 0).
    crest : float or None
        Of a wave, between −1 and 1 with the period 2π: a place at which it is 1.
    poles : (float, float) or None
        A pole or a jump, and the distance to the next one.
    rises : bool
        Whether it rises across its jumps, too.
    period : float
        After which it repeats, if it does; 0 if it does not.
    within : str
        The argument without whole periods, a formula in ``x``: of what repeats.
    typed : str
        Of a row that only pieces are made of (:mod:`stickslip.symbolic.pieces`): a formula in ``x``
        for it, since formulas cannot name it. It is continued beyond its piece, so that its jumps
        are never met; its enclosures hold for what it is in its piece.
    recurrence : str
        How its Taylor series is made: an operation of :class:`stickslip.symbolic.tape.Op`.
    growth : str
        Where a bound of |f(a + δ) − f(a)| for complex |δ| ≤ b stands: a function (row, a, b) of
        arrays.
    """

    name: str
    value: Callable[[float], float]
    derivative: str
    shown: str = ""
    relative: str = ""
    formula: str = ""
    arrays: str = ""
    latex: str = ""
    parity: Literal["odd", "even", ""] = ""
    domain: tuple[float, float] = (-math.inf, math.inf)
    limits: tuple[float, float] | None = None
    exactly: tuple[float, float] | None = None
    crest: float | None = None
    poles: tuple[float, float] | None = None
    rises: bool = False
    period: float = 0.0
    within: str = ""
    typed: str = ""
    recurrence: Literal["chain", "exp", "log", "rotation", "hyperbolic", "tan", "tanh"] = "chain"
    growth: str = "stickslip.symbolic.majorants:by_mean_value"

    @property
    def jumps(self) -> bool:
        """Whether it changes in ways that its derivative does not show."""
        return self.poles is not None

    @property
    def unit(self) -> tuple[str, int]:
        """Unit of the values, if they are tabulated, and the power of the unit of the argument in
        it; empty for other functions."""
        return "", 0

    @property
    def tabulated(self) -> bool:
        """Whether its values are data, so that values and argument may have any units."""
        return False

    @property
    def sampled(self) -> bool:
        """Whether it reports in which piece of a table a place is."""
        return False

    @property
    def called(self) -> str:
        """Name in formulas, if it differs from its own."""
        return ""

    @property
    def kinked(self) -> bool:
        """Whether it reports the piece of a function with kinks in between."""
        return False

    def joins(self, above: Expr, below: Expr) -> bool:
        """Whether it is a guard at which two branches are known to agree."""
        return False

    def enclosed_select(self, e: Expr, values: Mapping[Expr, Interval]) -> Interval | None:
        """Enclosure of a select with this function as its guard, if it is tighter than that of its
        branches; `values` are the intervals of all names in it."""
        return None

    @property
    def fixed(self) -> tuple[float, float] | None:
        """A place, and the value that a monotone function has there without rounding."""
        return (0.0, 0.0) if self.parity == "odd" and self.poles is None else self.exactly

    def __call__(self, x: float) -> float:
        """The value; raises ``ValueError`` or ``OverflowError`` where there is none."""
        return self.value(x)

    def ieee(self, x: float) -> float:
        """The value, with its limit in place of an overflow or at the end of the domain, and NaN
        where it is undefined; functions with poles or periods have no limit."""
        try:
            return self.value(x)
        except OverflowError:
            end = 1 if x > 0.0 or self.parity == "even" else 0
        except ValueError:
            if x not in self.domain:
                return math.nan
            end = self.domain.index(x)
        repeats = self.poles is not None and not self.rises
        return math.nan if self.limits is None or repeats else self.limits[end]

    @cached_property
    def array(self) -> Callable[[Any], Any]:
        """The function of arrays."""
        if self.arrays:
            return resolve_name(self.arrays)
        import numpy as np

        if self.made_of is None:
            return np.vectorize(self.ieee, otypes=[float])
        from stickslip.symbolic.evaluator import evaluator

        made = evaluator([self.made_of], [ARGUMENT])
        return lambda x: made(np.asarray(x)[None])[0]

    @property
    def in_latex(self) -> str:
        """Its name in LaTeX."""
        return self.latex or rf"\operatorname{{{self.name}}}"

    def enclosed(self, a: Interval) -> Interval | None:
        """Enclosure of the values on an interval, if it is tighter than the one derived from
        `limits`; also for intervals of arrays."""
        return None

    @cached_property
    def made_of(self) -> Expr | None:
        """Its value, an expression of :data:`ARGUMENT`, where C does not have it."""
        return self._read(self.formula) if self.formula else None

    @cached_property
    def without_periods(self) -> Expr:
        """The argument without whole periods, an expression of :data:`ARGUMENT`."""
        return self._read(self.within)

    @cached_property
    def slope(self) -> Expr:
        """The derivative, an expression of :data:`ARGUMENT`.

        Raises
        ------
        ValueError
            If the series would have to be known before it is made.
        """
        from stickslip.symbolic.expressions import walk

        slope = self._read(self.derivative)
        if self.recurrence == "chain" and any(e.op == self.name for e in walk([slope])):
            raise ValueError(f"{self.name}: its derivative must not contain {self.name}")
        return slope

    @cached_property
    def shown_slope(self) -> Expr:
        """The derivative in the form that is printed and enclosed."""
        return self._read(self.shown) if self.shown else self.slope

    @cached_property
    def relative_slope(self) -> Expr | None:
        """The derivative divided by the function."""
        return self._read(self.relative) if self.relative else None

    @cached_property
    def deviation_rule(self) -> Callable[[Function, Any, Any], Any]:
        """The function named by `growth`, which bounds deviations."""
        return resolve_name(self.growth)

    def _read(self, text: str) -> Expr:
        # The parser of formulas looks up functions in this table.
        from stickslip.symbolic.expressions import sym
        from stickslip.symbolic.formulas import Scope

        return Scope({"x": sym(ARGUMENT)}, rows=frozenset(FUNCTIONS)).parse(text, self.name)


FUNCTIONS: dict[str, Function] = {
    row.name: row
    for row in (
        Function(
            name="exp",
            value=math.exp,
            derivative="exp(x)",
            relative="1",
            arrays="numpy:exp",
            latex=r"\exp",
            limits=(0.0, math.inf),
            exactly=(0.0, 1.0),
            recurrence="exp",
            growth="stickslip.symbolic.majorants:of_exp",
        ),
        Function(
            name="log",
            value=math.log,
            derivative="1/x",
            arrays="numpy:log",
            latex=r"\log",
            domain=(0.0, math.inf),
            limits=(-math.inf, math.inf),
            recurrence="log",
            growth="stickslip.symbolic.majorants:of_log",
        ),
        Function(
            name="log1p",
            value=math.log1p,
            derivative="1/(1 + x)",
            arrays="numpy:log1p",
            domain=(-1.0, math.inf),
            limits=(-math.inf, math.inf),
            exactly=(0.0, 0.0),
        ),
        Function(
            name="expm1",
            value=math.expm1,
            derivative="exp(x)",
            arrays="numpy:expm1",
            limits=(-1.0, math.inf),
            exactly=(0.0, 0.0),
        ),
        Function(
            name="sin",
            value=math.sin,
            derivative="cos(x)",
            arrays="numpy:sin",
            latex=r"\sin",
            parity="odd",
            crest=_QUARTER,
            period=_TURN,
            within=_WITHOUT_TURNS,
            recurrence="rotation",
            growth="stickslip.symbolic.majorants:by_addition",
        ),
        Function(
            name="cos",
            value=math.cos,
            derivative="-sin(x)",
            arrays="numpy:cos",
            latex=r"\cos",
            parity="even",
            crest=0.0,
            period=_TURN,
            within=_WITHOUT_TURNS,
            recurrence="rotation",
            growth="stickslip.symbolic.majorants:by_addition",
        ),
        Function(
            name="tan",
            value=math.tan,
            derivative="1 + tan(x)**2",
            shown="1/cos(x)**2",
            arrays="numpy:tan",
            latex=r"\tan",
            parity="odd",
            limits=(-math.inf, math.inf),
            poles=(_QUARTER, math.pi),
            recurrence="tan",
            growth="stickslip.symbolic.majorants:of_tan",
        ),
        Function(
            name="sinh",
            value=math.sinh,
            derivative="cosh(x)",
            arrays="numpy:sinh",
            latex=r"\sinh",
            parity="odd",
            limits=(-math.inf, math.inf),
            recurrence="hyperbolic",
            growth="stickslip.symbolic.majorants:by_addition",
        ),
        Function(
            name="cosh",
            value=math.cosh,
            derivative="sinh(x)",
            relative="tanh(x)",
            arrays="numpy:cosh",
            latex=r"\cosh",
            parity="even",
            limits=(1.0, math.inf),
            recurrence="hyperbolic",
            growth="stickslip.symbolic.majorants:by_addition",
        ),
        Function(
            name="tanh",
            value=math.tanh,
            derivative="1 - tanh(x)**2",
            shown="1/cosh(x)**2",
            arrays="numpy:tanh",
            latex=r"\tanh",
            parity="odd",
            limits=(-1.0, 1.0),
            recurrence="tanh",
            growth="stickslip.symbolic.majorants:of_tanh",
        ),
        Function(
            name="asinh",
            value=math.asinh,
            derivative="(1 + x**2)**(-1/2)",
            arrays="numpy:arcsinh",
            latex=r"\operatorname{arsinh}",
            parity="odd",
            limits=(-math.inf, math.inf),
            growth="stickslip.symbolic.majorants:of_singular_at_i",
        ),
        Function(
            name="atan",
            value=math.atan,
            derivative="1/(1 + x**2)",
            arrays="numpy:arctan",
            latex=r"\operatorname{arctan}",
            parity="odd",
            limits=(-_ABOVE_QUARTER, _ABOVE_QUARTER),
            growth="stickslip.symbolic.majorants:of_singular_at_i",
        ),
        Function(
            name="asin",
            value=math.asin,
            derivative="(1 - x**2)**(-1/2)",
            arrays="numpy:arcsin",
            latex=r"\operatorname{arcsin}",
            parity="odd",
            domain=(-1.0, 1.0),
            limits=(-_ABOVE_QUARTER, _ABOVE_QUARTER),
        ),
        Function(
            name="acos",
            value=math.acos,
            derivative="-(1 - x**2)**(-1/2)",
            arrays="numpy:arccos",
            latex=r"\operatorname{arccos}",
            domain=(-1.0, 1.0),
            limits=(_ABOVE_HALF, 0.0),
        ),
        Function(
            name="erf",
            value=math.erf,
            derivative="2/sqrt(pi)*exp(-x**2)",
            arrays="scipy.special:erf",
            parity="odd",
            limits=(-1.0, 1.0),
        ),
        # Functions from which others are composed.
        Function(
            name="floor",
            value=lambda x: float(math.floor(x)),
            derivative="0",
            arrays="numpy:floor",
            limits=(-math.inf, math.inf),
            poles=(0.0, 1.0),
            rises=True,
            typed="floor(x)",
        ),
        Function(
            name="wrap",
            value=lambda x: x - math.floor(x + 0.5),
            derivative="1",
            formula="x - floor(x + 1/2)",
            limits=(-0.25, 0.25),
            poles=(0.5, 1.0),
            period=1.0,
            within="wrap(x)",
            typed="mod(x + 1/2, 1) - 1/2",
        ),
        Function(
            name="ease",
            value=lambda x: x * x * (3.0 - 2.0 * x),
            derivative="6*x*(1 - x)",
            formula="x*x*(3 - 2*x)",
            domain=(0.0, 1.0),
            limits=(0.0, 1.0),
            typed="x**2*(3 - 2*x)",
        ),
    )
}
"""All functions by name. Those of samples and tables are added when they are used and removed when
they are freed, at any moment that the garbage collector runs: iterate over ``list(FUNCTIONS)``."""


def language() -> list[str]:
    """Names of the functions that a formula may call."""
    # Not a tuple: it is allocated after the iteration has begun, which may free samples.
    rows = ((name, FUNCTIONS.get(name)) for name in list(FUNCTIONS))
    return [name for name, row in rows if row is not None and not row.typed]
