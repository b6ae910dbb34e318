"""Proofs that a homogeneous formula is convex.

By rules, where they tell. Else piece by piece: a function that is continuous and made of pieces is
convex if each piece is, and if its slope across each border does not fall. A piece is where some
linear guards have given signs, and is convex if its second derivatives are positive semidefinite,
which is enclosed in all directions. Since ∇²R(v) v = 0, the rows and columns of all components but
one suffice, on the two faces of the cube on which that one is ±1.
"""

from __future__ import annotations

from stickslip.convex.directions import Directions
from stickslip.convex.rules import AFFINE_SHAPE, CONVEX, ConvexRules
from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

BY_RULES = "by its form"
BY_BOUNDS = "by bounds of its second derivatives"
_MOST_PIECES = 64


class Proof:
    """An attempt to prove that a formula is convex.

    Parameters
    ----------
    expression : Expr
        Homogeneous of degree 1.
    size : float
        Largest value for max |vᵢ| = 1, about.

    Attributes
    ----------
    how : str
        In words; empty if it was not found.
    """

    def __init__(self, expression: Expr, directions: Directions, size: float) -> None:
        self.slack: float = FEW_ROUNDINGS * size
        self.pieces: int = 0
        self.bounded: bool = False
        found = self._is_convex(expression, directions)
        self.how: str = (BY_BOUNDS if self.bounded else BY_RULES) if found else ""

    def _is_convex(self, e: Expr, directions: Directions) -> bool:
        rules = ConvexRules(directions)
        if rules.shape(e) in (AFFINE_SHAPE, CONVEX):
            return True
        if e.op == "sum":
            left = [(t, c) for t, c in e.terms if rules.shape(ex.add((t, c))) not in (0, CONVEX)]
            if len(left) < len(e.terms) and self._is_convex(ex.add(*left), directions):
                return True
        guard = next(iter(linear_guards(e, directions.names)), None)
        if guard is None:
            self.bounded = True
            return not _has_guards(e, directions) and _curves_up(e, directions)
        self.pieces += 1
        if self.pieces > _MOST_PIECES:
            return False
        above, below = (on_side(e, guard, side) for side in (1, -1))
        return (
            self._joins(above - below, guard, directions)
            and self._is_convex(above, directions.beside(guard))
            and self._is_convex(below, directions.beside(-guard))
        )

    def _joins(self, difference: Expr, guard: Expr, directions: Directions) -> bool:
        """Whether two pieces agree where a linear guard is zero, and the slope does not fall across
        it."""
        names = directions.names
        normal = {name: ex.derivative(guard, name) for name in names}
        name = max(names, key=lambda x: abs(ex.number(normal[x])))
        rest = ex.add((guard, 1.0), (ex.sym(name), -ex.number(normal[name])))
        place = ex.multiply(rest, ex.num(-1.0 / ex.number(normal[name])))
        jump = ex.add(*((ex.derivative(difference, x), ex.number(n)) for x, n in normal.items()))
        try:
            gap, jump = (ex.substitute(part, {name: place}) for part in (difference, jump))
        except ArithmeticError:
            return False
        border = directions.without(name, place)
        if not border.names:  # one component: the border is 0
            return True
        return (
            border.nonnegative(gap, self.slack)
            and border.nonnegative(-gap, self.slack)
            and border.nonnegative(jump, self.slack)
        )


def on_side(expression: Expr, guard: Expr, side: int) -> Expr:
    """The branch of an expression for a sign of a guard, 1 or −1."""
    return ex.rewrite(
        expression,
        lambda e: e.args[1 if side > 0 else 2] if e.op == "select" and e.args[0] is guard else None,
        again=True,
    )


def _has_guards(e: Expr, directions: Directions) -> bool:
    """Whether some choice depends on v."""
    names = {*directions.names}
    return any(x.op == "select" and x.args[0].symbols & names for x in ex.walk([e]))


def linear_guards(e: Expr, names: tuple[str, ...]) -> list[Expr]:
    """Guards that are linear in v, with numbers as coefficients, and hold no others.

    Parameters
    ----------
    names : tuple of str
        Components of v.
    """
    found: dict[Expr, None] = {}
    for x in ex.walk([e]):
        if x.op == "select" and x.args[0].symbols and x.args[0].symbols <= {*names}:
            guard = x.args[0]
            slopes = [ex.derivative(guard, name) for name in names]
            if not ex.bends(guard, names) and all(ex.is_number(s) for s in slopes):
                found[guard] = None
    return list(found)


def _curves_up(e: Expr, directions: Directions) -> bool:
    """Whether the second derivatives of a smooth piece are positive semidefinite in all directions
    of it."""
    names = directions.names
    for k, face in enumerate(names):
        across = [name for name in names if name != face]
        slopes = [ex.derivative(e, name) for name in across]
        matrix = [[ex.derivative(slope, name) for name in across] for slope in slopes]
        if not directions.positive_semidefinite(matrix, k):
            return False
    return True
