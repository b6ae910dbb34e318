"""A layout under construction: its rows so far, and the sizes of their terms, which determine
rounding errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stickslip.equations.codegen.layout import Layout
from stickslip.equations.derive import MotionEquations
from stickslip.equations.planes import Plane
from stickslip.kept import cached_property
from stickslip.model.entries.declared import Kind
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.scalars import (
    ORIGIN,
    ParameterExpressions,
    Scalar,
    Store,
    added,
    element,
    numeral,
)
from stickslip.symbolic.tape import Instruction, Scaled, Tape

if TYPE_CHECKING:
    from stickslip.convex.formula import ConvexFormula


class Draft:
    """A layout while it is made.

    Attributes
    ----------
    nq, nz, nr, na : int
        How many inertial, viscous, rate-independent coordinates and internal variables there are.
    mq, mz, mr, nc : int
        How many contacts of these coordinates, and of all.
    n : int
        Length of the state.
    solves : dict of int to list of Instruction
        Linear problems, by the stage that they follow.
    magnitudes : list of Store
        Statements that fill ``mag``. In it stand, by contact, the sizes of velocities, of their
        rates, of forces; then those of kinks; from `gap_sizes` on of gaps, from `plane_sizes` on of
        what is admissible in planes, from `rate_sizes` on of rates; last those of the right-hand
        sides of linear problems.
    scratch : int
        The first place in ``mag`` that is free.
    directions : dict of int to int
        By plane, the first row of the direction of its slip.
    speed_sizes : dict of int to int
        By plane, the row of the size of the terms of what that is the direction of.
    stretch_sizes : dict of Expr to Scalar
        By the symbol of a stretch, the size of its terms.
    """

    def __init__(self, equations: MotionEquations) -> None:
        self.eq = equations
        d = self.d = equations.declaration
        self.constants = ParameterExpressions([*d.parameters, ORIGIN])
        self.nq, self.nz, self.nr, self.na = map(
            len, (d.inertial, d.viscous, d.rate_independent, d.internal)
        )
        self.mq, self.mz, self.mr = (equations.count(kind) for kind in Kind)
        self.n = len(d.state)
        sizes = dict(
            n=self.n,
            nq=self.nq,
            nz=self.nz,
            nr=self.nr,
            na=self.na,
            mq=self.mq,
            mz=self.mz,
            mr=self.mr,
            kinks=len(equations.kinks),
        )
        pressed = [len(equations.pressing(i)) for i in range(self.mq)]
        self.layout = Layout(d.state, sizes, pressed=max([1, *pressed]))
        rows = {name: i for i, name in enumerate(d.state)} | {"t": self.n}
        regions = {guard: i for i, guard in enumerate(equations.kinks)}
        self.tape = Tape(self.constants, rows, self.n + 1, regions)
        self.solves: dict[int, list[Instruction]] = {0: [], 1: [], 2: []}
        self.magnitudes: list[Store] = []
        self.nc = self.mq + self.mz + self.mr
        self.gap_sizes = 3 * self.nc + len(equations.kinks)
        opens = any(c.opens for c in equations.contacts)
        self.plane_sizes = self.gap_sizes + (self.mq if opens else 0)
        self.rate_sizes = self.plane_sizes + len(equations.planes)
        self.directions: dict[int, int] = {}
        self.speed_sizes: dict[int, int] = {}
        self.stretch_sizes: dict[Expr, Scalar] = {}
        self.scratch = self.rate_sizes + self.nq + self.nz + self.nr + self.na

    def note(self, place: int, size: Scalar, adding: bool = False) -> None:
        """A statement that stores a size."""
        self.magnitudes.append(Store("mag", (place,), size, adding))

    def size_of(self, parts: list[Scaled]) -> Scalar:
        """Sum of the moduli of terms."""
        factors = [(self.constants.scalar(p.factor), p) for p in parts]
        return added(
            abs(c if p.row is None else product_of_sizes(c, order_0(p.row))) for c, p in factors
        )

    def size(self, e: Expr) -> Scalar:
        """The sum of the moduli of the terms of an expression: the scale of its rounding error."""
        if e.op == "sum":
            parts = [product_of_sizes(numeral(abs(c)), self.size(term)) for term, c in e.terms]
            return added([*parts, *([numeral(abs(float(e.value)))] if e.value else [])])
        if e in self.stretch_sizes:
            return self.stretch_sizes[e]
        if e.op == "prod" and any(self._is_sum(base) and p == 1.0 for base, p in e.terms):
            return Scalar("product", tuple(self.factor_size(base, p) for base, p in e.terms))
        return self.size_of([self.tape.lower(e)])

    def factor_size(self, base: Expr, p: float) -> Scalar:
        """The size of a factor; a difference in brackets is as large as its terms."""
        if self._is_sum(base) and p == 1.0 and not self.constants.is_constant(base):
            return self.size(base)
        size = self.size_of([self.tape.lower(base)])
        return size if p == 1.0 else Scalar("real_power", (size, numeral(p)))

    def _is_sum(self, e: Expr) -> bool:
        """Whether the terms of an expression may cancel."""
        return e.op == "sum" or e in self.stretch_sizes

    def number(self, e: Expr) -> Scalar:
        """A constant, or the value of a row."""
        constant = self.constants.is_constant(e)
        return self.constants.scalar(e) if constant else order_0(self.tape.row(e))

    def plane_with(self, i: int) -> Plane:
        """The contact in a plane that has a contact as a component."""
        return next(p for p in self.eq.planes if i in p.parts)

    @cached_property
    def formulas(self) -> list[ConvexFormula]:
        """Dissipations that are formulas, each once."""
        found = [plane.formula for plane in self.eq.planes if plane.formula is not None]
        return list({id(formula): formula for formula in found}.values())


def order_0(row: int) -> Scalar:
    """Order 0 of a row."""
    return element("W", row, 0)


def product_of_sizes(a: Scalar, b: Scalar) -> Scalar:
    """A product of sizes, without factors that are 1."""
    plain = [x for x in (a, b) if x.op != "number" or x.value != 1.0]
    return plain[0] * plain[1] if len(plain) == 2 else plain[0] if plain else a
