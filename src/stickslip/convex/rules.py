"""Convexity of expressions by the rules of disciplined convex programming.

Sums and maxima of convex expressions are convex, and so are absolute values, powers with an
exponent of at least 1 of convex nonnegative expressions, and roots of sums of such powers, which
are norms (Minkowski).

Source: M. Grant, S. Boyd and Y. Ye, *Disciplined convex programming*, in: Global Optimization
(2006) 155-210.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from stickslip.convex.directions import Directions
from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.enclosures import splits
from stickslip.symbolic.expressions import Expr

AFFINE_SHAPE, CONVEX, CONCAVE = 0, 1, -1


class ConvexRules:
    """Curvature and sign of expressions of a velocity v that lies in some directions."""

    def __init__(self, directions: Directions) -> None:
        self.directions = directions
        self.names: frozenset[str] = frozenset(directions.names)
        self._shapes: dict[Expr, int | None] = {}
        self._signs: dict[Expr, bool] = {}

    def shape(self, e: Expr) -> int | None:
        """AFFINE_SHAPE, CONVEX or CONCAVE in v, or None if no rule applies."""
        if e not in self._shapes:
            self._shapes[e] = None
            self._shapes[e] = self._shape(e)
        return self._shapes[e]

    def nonnegative(self, e: Expr) -> bool:
        """Whether an expression is proved to have no negative value."""
        if e not in self._signs:
            seen = ex.never_negative(e)
            self._signs[e] = seen or self.directions.nonnegative(e)
        return self._signs[e]

    def _shape(self, e: Expr) -> int | None:
        if not e.symbols & self.names:
            return AFFINE_SHAPE
        match e.op:
            case "sym":
                return AFFINE_SHAPE
            case "sum":
                shapes = [self._times_sign(self.shape(term), c > 0.0) for term, c in e.terms]
                return (
                    None if None in shapes else _shape_of_sum([s for s in shapes if s is not None])
                )
            case "prod":
                return self._shape_of_product(e)
            case "select":
                return self._shape_of_select(e)
        return None

    def _shape_of_product(self, e: Expr) -> int | None:
        factor, moving = self._split_product(e)
        if len(moving) != 1:
            return None
        shape = self._shape_of_power(*moving[0])
        if shape == AFFINE_SHAPE or shape is None:
            return shape
        if self.nonnegative(factor):
            return shape
        return -shape if self.nonnegative(-factor) else None

    def _split_product(self, e: Expr) -> tuple[Expr, list[tuple[Expr, float]]]:
        """The factor of a product that does not depend on v, and the other factors with their
        exponents."""
        terms = e.terms if e.op == "prod" else ((e, 1.0),)
        fixed = [ex.power(base, ex.num(p)) for base, p in terms if not base.symbols & self.names]
        moving = [(base, p) for base, p in terms if base.symbols & self.names]
        return ex.multiply(*fixed) if fixed else ex.ONE, moving

    def _shape_of_power(self, base: Expr, p: float) -> int | None:
        if p == 1.0:
            return self.shape(base)
        # A root of a convex expression is not convex in general, but a norm is.
        if 0.0 < p < 1.0 and self._is_norm(base, _rounded_exponent(1.0 / p)):
            return CONVEX
        shape = self.shape(base)
        if shape is None:
            return None
        if p > 1.0:
            return CONVEX if self._power_is_convex(base, p) else None
        if shape == CONVEX or not self.nonnegative(base):
            return None
        # For a concave, nonnegative f: t ↦ tᵖ is increasing and concave for 0 < p < 1, decreasing
        # and convex for p < 0.
        return CONCAVE if p > 0.0 else CONVEX

    def _power_is_convex(self, f: Expr, q: float) -> bool:
        """Whether fᵠ = gᵠ for a convex, nonnegative g: g = f or, if q is even, g = |f|."""
        shape = self.shape(f)
        if shape is None or q < 1.0:
            return False
        # t ↦ t^q is increasing on t ≥ 0 only, so f has to be nonnegative, or |f| is taken.
        even = q % 2.0 == 0.0
        if shape != CONCAVE and ((even and shape == AFFINE_SHAPE) or self.nonnegative(f)):
            return True
        return even and shape == CONCAVE and self.nonnegative(-f)

    def _is_norm(self, base: Expr, q: float) -> bool:
        """Whether base^(1/q) is a norm: base is a sum of q-th powers of convex nonnegative
        expressions or, for q = 2, a positive semidefinite form."""
        terms = base.terms if base.op == "sum" else ((base, 1.0),)
        if base.op == "sum" and float(base.value):
            return False
        if all(c > 0.0 and self._is_power(term, q) for term, c in terms):
            return True
        return q == 2.0 and is_nonnegative_form(base, self.directions)

    def _is_power(self, term: Expr, q: float) -> bool:
        factor, moving = self._split_product(term)
        if not moving:
            return False
        f = ex.multiply(*(ex.power(base, ex.num(_rounded_exponent(p / q))) for base, p in moving))
        return f is not term and self._power_is_convex(f, q) and self.nonnegative(factor)

    def _shape_of_select(self, e: Expr) -> int | None:
        """The shape of a select: where above − below = c·guard it is a maximum (c > 0) or a minimum
        (c < 0)."""
        guard, above, below = e.args
        if not guard.symbols & self.names:
            shapes = [self.shape(above), self.shape(below)]
            return None if None in shapes else _shape_of_sum([s for s in shapes if s is not None])
        # above = below + c·guard, so the select is below + c·max(guard, 0): continuous at its kink.
        difference = above - below
        signs = {
            c > 0.0 for c, constant, rest in splits(difference, guard) if not rest and not constant
        }
        if len(signs) != 1:
            return None
        wanted = CONVEX if signs.pop() else CONCAVE
        return wanted if {self.shape(above), self.shape(below)} <= {AFFINE_SHAPE, wanted} else None

    def _times_sign(self, shape: int | None, positive: bool) -> int | None:
        return shape if positive or shape is None else -shape


def _shape_of_sum(shapes: Sequence[int]) -> int | None:
    """The shape of a sum."""
    return None if {CONVEX, CONCAVE} <= set(shapes) else sum(set(shapes))


def _rounded_exponent(q: float) -> float:
    """An exponent that is an integer up to rounding, such as 1/(1/3), as that integer."""
    return float(round(q)) if abs(q - round(q)) <= FEW_ROUNDINGS * abs(q) else q


def is_nonnegative_form(e: Expr, directions: Directions) -> bool:
    """Whether an expression is proved to be ⟨v, Q v⟩ with a positive semidefinite Q: exactly, if Q
    is made of numbers."""
    names = directions.names
    if ex.bends(e, names):
        return False
    matrix = [[ex.derivative(ex.derivative(e, a), b) for b in names] for a in names]
    if any(entry.symbols & {*names} for row in matrix for entry in row):
        return False
    rest = ex.substitute(e, dict.fromkeys(names, ex.ZERO))
    slopes = [ex.substitute(ex.derivative(e, a), dict.fromkeys(names, ex.ZERO)) for a in names]
    # A quadratic polynomial is a form only if it has no constant and no linear terms.
    if not all(ex.is_number(part, 0.0) for part in (rest, *slopes)):
        return False
    if all(ex.is_number(entry) for row in matrix for entry in row):
        return _is_semidefinite([[Fraction(ex.number(x)) for x in row] for row in matrix])
    return Directions((), directions.others).positive_semidefinite(matrix)


def _is_semidefinite(matrix: list[list[Fraction]]) -> bool:
    """Whether a symmetric matrix has no negative eigenvalue, by exact elimination."""
    size = len(matrix)
    if any(matrix[i][i] < 0 for i in range(size)):
        return False
    pivot = next((i for i in range(size) if matrix[i][i] > 0), None)
    # A zero on the diagonal of a semidefinite matrix requires a zero row.
    if pivot is None:
        return not any(any(row) for row in matrix)
    others = [i for i in range(size) if i != pivot]
    top = matrix[pivot][pivot]
    return _is_semidefinite(
        [[matrix[i][j] - matrix[i][pivot] * matrix[pivot][j] / top for j in others] for i in others]
    )
