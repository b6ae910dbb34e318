"""The elementary functions of the formula language: one table, one row for each.

All properties of a function that the library uses are in this table, so a new function is a new
row. A row contains the value, the derivative, and where the function is monotone. The rest is
derived:

* derivatives of all orders, and slopes on intervals, from the formula of the derivative;
* enclosures from the values at the ends if the function is monotone, otherwise from the slope;
* the Taylor series from the chain rule, y′ = f′(x) x′, with the series of this formula;
* bounds of the deviation on a complex disc, |f(z) − f(c)| ≤ r sup|f′|.

Functions with simple recurrences, such as exp and sin, have their own `recurrence` and `growth`.
Sums and powers (:mod:`stickslip.symbolic.expressions`), and functions with kinks and jumps
(:mod:`stickslip.symbolic.pieces`), are not in this table.
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
"""Name of the argument in the formula of a derivative; formulas of users cannot contain it."""
_QUARTER = math.pi / 2.0
_ABOVE_QUARTER = math.nextafter(_QUARTER, 2.0)
_ABOVE_HALF = math.nextafter(math.pi, 4.0)
_TURN = 2.0 * math.pi
_WITHOUT_TURNS = "2*atan(tan(x/2))"


@dataclass(frozen=True, eq=False, kw_only=True)
class Function:
    """A row of the table: a function of one real argument, analytic in its domain (kinks are
    expressed by selects).

    Attributes
    ----------
    name : str
        Its name in formulas.
    value : callable
        float -> float, accurate to a few units in the last place; raises ``ValueError`` outside the
        domain.
    derivative : str
        Formula in ``x``. It contains only other functions unless the row has a `recurrence`.
    shown : str
        The derivative in a readable form with tight enclosures: ``x`` occurs once, if possible. By
        default `derivative`.
    relative : str
        The derivative divided by the function, if this is a simple formula. Derivatives of 1/f then
        do not overflow when f is large.
    formula : str
        The value in machine code, as a formula in ``x`` of other functions. By default the function
        of this name in the mathematical library of C.
    arrays : str
        The function of arrays, as ``"module:name"``. By default that of `formula`, or else `value`
        is called for each number.
    latex : str
        By default the upright name.
    domain : (float, float)
        Interval on which the function is defined.
    limits : (float, float) or None
        Limits at the ends of the domain (of its half [0, ∞), if the function is even), rounded
        outward, if the function is monotone: its values lie in between. With `poles`, the limits at
        two neighbouring ones.
    exactly : (float, float) or None
        A point, and the value of a monotone function there, without rounding errors. For odd
        functions it is (0, 0).
    crest : float or None
        For a wave between −1 and 1 with the period 2π, a point at which its value is 1.
    poles : (float, float) or None
        A pole or a jump, and the distance to the next one.
    rises : bool
        Whether the function also increases across its jumps.
    period : float
        0 if the function is not periodic.
    within : str
        The argument of a periodic function without whole periods, as a formula in ``x``.
    typed : str
        For rows that occur only in functions with pieces (:mod:`stickslip.symbolic.pieces`) and
        have no name in formulas: a formula in ``x``. Such a function is continued beyond its piece,
        so that motions do not reach its jumps; its enclosures are valid in its piece.
    recurrence : str
        Method for the Taylor series: an operation of :class:`stickslip.symbolic.tape.Op`.
    growth : str
        A function (row, a, b) of arrays, as ``"module:name"``, that bounds |f(a + δ) − f(a)| for
        complex |δ| ≤ b.
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
        """Whether it has jumps, which do not appear in its derivative."""
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
        """Whether its value is the piece of a table that contains the argument."""
        return False

    @property
    def called(self) -> str:
        """Name in formulas, if it differs from `name`."""
        return ""

    @property
    def kinked(self) -> bool:
        """Whether its value is a piece of a function that has kinks between its pieces."""
        return False

    def joins(self, above: Expr, below: Expr) -> bool:
        """Whether it is a guard at whose zeros two branches are known to be equal."""
        return False

    def enclosed_select(self, e: Expr, values: Mapping[Expr, Interval]) -> Interval | None:
        """Enclosure of a select with this function as its guard, if it is tighter than that of its
        branches; `values` are the intervals of all names in it."""
        return None

    @property
    def fixed(self) -> tuple[float, float] | None:
        """A point, and the value of a monotone function there, without rounding errors."""
        return (0.0, 0.0) if self.parity == "odd" and self.poles is None else self.exactly

    def __call__(self, x: float) -> float:
        """The value; raises ``ValueError`` outside the domain, and ``OverflowError``."""
        return self.value(x)

    def ieee(self, x: float) -> float:
        """The value: on overflow and at the ends of the domain the limit, and NaN if it is
        undefined. Functions with poles or periods have no limit."""
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
        """The value as an expression of :data:`ARGUMENT`; None if C has the function."""
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
            If the derivative contains the function itself, without a `recurrence` for its series.
        """
        from stickslip.symbolic.expressions import walk

        slope = self._read(self.derivative)
        if self.recurrence == "chain" and any(e.op == self.name for e in walk([slope])):
            raise ValueError(f"{self.name}: its derivative must not contain {self.name}")
        return slope

    @cached_property
    def shown_slope(self) -> Expr:
        """The derivative in the form for printing and for enclosures."""
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
