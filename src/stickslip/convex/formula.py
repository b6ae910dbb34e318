"""A dissipation given by a formula R(v): checked, with its derivatives and its kinks as
expressions. Evolutions evaluate it; the equations of contacts contain its expressions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.convex.degree import degree
from stickslip.convex.directions import Directions
from stickslip.convex.looking import looked_at
from stickslip.convex.proof import BY_RULES, Proof, linear_guards
from stickslip.convex.rules import AFFINE_SHAPE, CONVEX, ConvexRules
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator, evaluator_of_numbers
from stickslip.symbolic.expressions import Expr

_DEGREE_ROUNDING = 1e-12


@dataclass(frozen=True)
class Kink:
    """A set of zeros of some expressions, on which a formula may have no derivative.

    Attributes
    ----------
    zeros : tuple of Expr
        The expressions: homogeneous, each with a gradient.
    node : Expr
        The part of the formula that has the kink: a select, or a power with a fractional exponent.
    inside : Expr
        A smooth expression that is equal to this part on the set.
    """

    zeros: tuple[Expr, ...]
    node: Expr
    inside: Expr


@dataclass(frozen=True)
class ConvexFormula:
    """R(v), convex, homogeneous of degree 1 and nonnegative: the support function of a closed
    convex set K that contains 0. Made by :func:`convex_formula`, which checks it.

    Attributes
    ----------
    value : Expr
        R for v ≠ 0; R(0) = 0.
    names : tuple of str
        Components of v.
    ranges : mapping of str to (float, float)
        All other names, with the values for which it was checked.
    homogeneous, convex, nonnegative : str
        How each property was proved, in words; empty if it was only checked at samples.
    looked_at : int
        Number of directions that were sampled.
    """

    value: Expr
    names: tuple[str, ...]
    ranges: Mapping[str, tuple[float, float]]
    homogeneous: str
    convex: str
    nonnegative: str
    looked_at: int

    @property
    def dimension(self) -> int:
        """Number of components."""
        return len(self.names)

    @property
    def proved(self) -> bool:
        """Whether it is proved to be a support function, not only seen to be one at samples."""
        return bool(self.homogeneous and self.convex and self.nonnegative)

    @property
    def evidence(self) -> str:
        """Description of the proved properties."""
        known = {
            "homogeneous": self.homogeneous,
            "convex": self.convex,
            "nonnegative": self.nonnegative,
        }
        sampled = f"as sampled in {self.looked_at} directions"
        ways: dict[str, list[str]] = {}
        for word, how in known.items():
            ways.setdefault(how or sampled, []).append(word)
        return "; ".join(f"{', '.join(words)} {how}" for how, words in ways.items())

    @cached_property
    def gradient(self) -> tuple[Expr, ...]:
        """∇R, the point of K that v exposes; within each piece."""
        return tuple(ex.derivative(self.value, name) for name in self.names)

    @cached_property
    def hessian(self) -> tuple[tuple[Expr, ...], ...]:
        """∇²R, whose product with v is 0; within each piece."""
        return tuple(tuple(ex.derivative(e, name) for name in self.names) for e in self.gradient)

    @cached_property
    def kinks(self) -> tuple[Kink, ...]:
        """Sets, other than v = 0, where R may have no derivative."""
        names = frozenset(self.names)
        found: dict[Expr, Kink] = {}
        for e in ex.walk([self.value]):
            if e.op == "select" and e.args[0].symbols & names:
                found.setdefault(e, Kink((e.args[0],), e, e.args[1]))
            for base, p in e.terms if e.op == "prod" else ():
                if base.symbols & names and p > 0.0 and not p.is_integer():
                    zeros = tuple(_zeros(base, self.names))
                    if zeros:
                        found.setdefault(e, Kink(zeros, e, ex.ZERO))
        return tuple(found.values())

    @cached_property
    def numbers(self) -> Callable[[Sequence[float]], list[float]]:
        """v and the values of the other names, n + k numbers -> R, ∇R and ∇²R, 1 + n + n² numbers
        one after the other."""
        rows = [e for row in self.hessian for e in row]
        return evaluator_of_numbers(
            [self.value, *self.gradient, *rows], [*self.names, *self.ranges]
        )

    @cached_property
    def values(self) -> Callable[[ArrayLike], Array]:
        """v and the values of the other names, shape (n + k, …) -> R, shape (1, …)."""
        return evaluator([self.value], [*self.names, *self.ranges])


def convex_formula(
    value: Expr,
    names: tuple[str, ...],
    ranges: Mapping[str, tuple[float, float]],
    where: str,
    symbol: str = "R",
    like: Expr | None = None,
) -> ConvexFormula:
    """Check that a formula is a dissipation.

    Proofs are tried for all properties: homogeneous by its form, convex by rules or by bounds of
    its second derivatives in all directions, nonnegative by bounds. In addition all properties are
    checked in many directions.

    Parameters
    ----------
    names : tuple of str
        Components of v.
    ranges : mapping of str to (float, float)
        All other names, with the values that they may have.
    where : str
        What an error is about.
    symbol : str
        Name of the formula in messages.
    like : Expr, optional
        The formula with norms in place of functions that are known to be convex and nonnegative.
        Properties that follow from its form hold for both.

    Raises
    ------
    DeclarationError
        If it is not homogeneous of degree 1, negative, or undefined somewhere, or not convex: with
        two points that show it.
    """
    unknown = sorted(value.symbols - {*names} - ranges.keys())
    if unknown:
        raise DeclarationError(where, f"unknown name '{unknown[0]}'", f"Use {', '.join(names)}")
    by_value = evaluator([value], [*names, *ranges])
    looked = looked_at(
        lambda v, others: by_value(np.concatenate([v, others]))[0], names, ranges, symbol, where
    )
    order = degree(value, names)
    if order is not None and abs(order - 1.0) > _DEGREE_ROUNDING:
        raise DeclarationError(
            where,
            f"it is homogeneous of degree {order:.6g}, not 1: {symbol}(2 v) is "
            f"{2.0**order:.6g} {symbol}(v)",
            "Use a rate-independent dissipation, which has degree 1, such as sqrt(v1**2 + v2**2)",
        )
    looked.check_values()
    looked.check_degree()
    looked.check_convex()
    looked.check_borders(_normals(value, names))
    directions = Directions(names, ranges)
    homogeneous = "" if order is None else "by its form"
    convex = nonnegative = ""
    if like is not None:
        shape = ConvexRules(directions).shape(like)
        convex = BY_RULES if shape in (AFFINE_SHAPE, CONVEX) else ""
        nonnegative = BY_RULES if ex.never_negative(like) else ""
    elif homogeneous:
        slack = FEW_ROUNDINGS * looked.size
        if ex.never_negative(value) or directions.nonnegative(value, slack):
            nonnegative = "by its bounds"
        convex = Proof(value, directions, looked.size).how
    return ConvexFormula(value, names, dict(ranges), homogeneous, convex, nonnegative, looked.count)


def _normals(value: Expr, names: tuple[str, ...]) -> Array:
    """Unit normals of the hyperplanes on which a choice of the formula changes."""
    rows = [
        [ex.number(ex.derivative(guard, name)) for name in names]
        for guard in linear_guards(value, names)
    ]
    normals = np.array(rows).reshape(len(rows), len(names))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _zeros(base: Expr, names: tuple[str, ...]) -> list[Expr]:
    """Expressions that vanish where a sum of powers or squares does; empty if unknown."""
    terms = base.terms if base.op == "sum" else ((base, 1.0),)
    if base.op != "sum" or all(c > 0.0 and _powers(term, names) for term, c in terms):
        found: list[Expr] = []
        for term, _ in terms:
            found += _powers(term, names)
        return list(dict.fromkeys(found))
    slopes = [ex.derivative(base, name) for name in names]
    second = [ex.derivative(slope, name) for slope in slopes for name in names]
    if ex.bends(base, names) or any(e.symbols & {*names} for e in second):
        return []
    return [slope for slope in slopes if not ex.is_number(slope)]


def _powers(term: Expr, names: tuple[str, ...]) -> list[Expr]:
    """Expressions that vanish where a term does: the arguments of even powers, roots and absolute
    values."""
    if term.op == "select":
        return [term.args[0]]
    if term.op != "prod":
        return [term] if term.symbols & {*names} and not ex.bends(term, names) else []
    moving = [(base, p) for base, p in term.terms if base.symbols & {*names}]
    if len(moving) != 1:
        return []
    base, p = moving[0]
    if base.op == "select":
        return [base.args[0]]
    return [base] if p % 2.0 == 0.0 and not ex.bends(base, names) else []
