"""Recognition of formulas that are equal to built-in potentials, which have closed forms."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stickslip.convex.directions import Directions
from stickslip.convex.formula import convex_formula
from stickslip.convex.rules import AFFINE_SHAPE, CONVEX, ConvexRules, is_nonnegative_form
from stickslip.errors import DeclarationError
from stickslip.numerics.levels import ROUNDED_TERM
from stickslip.rate_independent.dissipation.ellipsoid import Ellipsoid
from stickslip.rate_independent.dissipation.formula_sets import FormulaSets
from stickslip.rate_independent.dissipation.polytope import Polytope
from stickslip.rate_independent.dissipation.product import Product
from stickslip.rate_independent.dissipation.weighted_l1 import WeightedL1
from stickslip.rate_independent.sets.potential import Dissipation
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr

_Ranges = Mapping[str, tuple[float, float]]
_MOST_VERTICES = 64  # largest number of vertices of a recognised polytope
_MOST_SUMS = 4096  # largest number of sums of vertices, before equal ones are merged
_FLATTEST = 1e-10  # eigenvalue of an ellipsoid, relative to the largest, that is not rounding


def recognised(value: Expr, names: tuple[str, ...], ranges: _Ranges) -> Dissipation | None:
    """The built-in potential that is equal to a formula; None if none is recognised.

    Parameters
    ----------
    value : Expr
        Convex, homogeneous and nonnegative.
    names : tuple of str
        Components of v.
    ranges : mapping of str to (float, float)
        Range of the phase, if the formula depends on it.
    """
    try:
        blocks = _blocks(value, names)
        if all(len(block) == 1 for block, _ in blocks):
            # A function of one component, homogeneous of degree 1, is given by its values at ±1.
            plus, minus = (
                [_at(part, {block[0]: end}) for block, part in blocks] for end in (1.0, -1.0)
            )
            return WeightedL1(plus, minus)
        if len(blocks) == 1:
            return _ellipsoid(value, names, ranges) or _polytope(value, names, ranges)
        return Product(tuple(_factor(part, block, ranges) for block, part in blocks))
    except (DeclarationError, ArithmeticError):
        return None


def _blocks(value: Expr, names: tuple[str, ...]) -> list[tuple[tuple[str, ...], Expr]]:
    """Split the components into as many groups of consecutive ones as possible such that every term
    contains components of one group only. Each group is returned with the sum of its terms."""
    terms = value.terms if value.op == "sum" else ((value, 1.0),)
    joined = [False] * len(names)  # whether a component is in the same group as the next one
    for term, _ in terms:
        used = [i for i, name in enumerate(names) if name in term.symbols]
        for i in range(min(used, default=0), max(used, default=0)):
            joined[i] = True
    groups: list[list[str]] = [[]]
    for name, on in zip(names, joined, strict=True):
        groups[-1].append(name)
        if not on:
            groups.append([])
    return [
        (tuple(group), ex.add(*((t, c) for t, c in terms if t.symbols & {*group})))
        for group in groups[:-1]
    ]


def _factor(part: Expr, block: tuple[str, ...], ranges: _Ranges) -> Dissipation:
    """The potential of one group of components, if possible a built-in one."""
    own = {name: ends for name, ends in ranges.items() if name in part.symbols}
    known = recognised(part, block, own)
    return known or FormulaSets(convex_formula(part, block, own, "formula", symbol="Psi"))


def _ellipsoid(value: Expr, names: tuple[str, ...], ranges: _Ranges) -> Ellipsoid | None:
    """The ellipsoid of the square root of a quadratic form, possibly with a factor."""
    (term, c) = value.terms[0] if value.op == "sum" and len(value.terms) == 1 else (value, 1.0)
    if term.op != "prod" or c < 0.0:
        return None
    variable, constant = _separated(term, names)
    if len(variable) != 1 or variable[0][1] != 0.5:
        return None
    base = variable[0][0]
    if not is_nonnegative_form(base, Directions(names, ranges)):
        return None
    # (c a √Q(v))² = vᵀ S v with S = ½ c² a² ∂²Q, since Q is a quadratic form.
    square = ex.multiply(ex.num(0.5 * c * c), ex.power(constant, ex.num(2.0)))
    shape = [
        [ex.multiply(square, ex.derivative(ex.derivative(base, a), b)) for b in names]
        for a in names
    ]
    if not ranges:
        # A small eigenvalue is either a rounding error of 0 or a very flat ellipsoid, for which the
        # closed form is not accurate.
        squares = np.linalg.eigvalsh([[ex.number(entry) for entry in row] for row in shape])
        small = np.abs(squares) < _FLATTEST * squares[-1]
        if (np.abs(squares[small]) > ROUNDED_TERM * len(names) * squares[-1]).any():
            return None
    return Ellipsoid(shape)


def _separated(product: Expr, names: tuple[str, ...]) -> tuple[list[tuple[Expr, float]], Expr]:
    """Factors of a product that contain the components, and the product of the other ones."""
    variable = [(base, p) for base, p in product.terms if base.symbols & {*names}]
    others = (ex.power(b, ex.num(p)) for b, p in product.terms if not b.symbols & {*names})
    return variable, ex.multiply(*others)


def _polytope(value: Expr, names: tuple[str, ...], ranges: _Ranges) -> Polytope | None:
    """The polytope of a maximum of linear functions."""
    vertices = _vertices(value, names, ConvexRules(Directions(names, ranges)))
    return None if vertices is None else Polytope(vertices=[list(row) for row in vertices])


def _vertices(e: Expr, names: tuple[str, ...], rules: ConvexRules) -> list[tuple[Expr, ...]] | None:
    """Gradients of linear functions whose maximum is the expression; None if it is not recognised
    as such a maximum."""
    found: list[tuple[Expr, ...]]
    shape = rules.shape(e)
    if shape == AFFINE_SHAPE and not ex.bends(e, names):
        return [tuple(ex.derivative(e, name) for name in names)]
    if shape != CONVEX:
        return None
    if e.op == "select" and e.args[0].symbols & {*names}:
        # A convex function that is linear in pieces is the maximum of its pieces.
        above, below = (_vertices(branch, names, rules) for branch in e.args[1:])
        if above is None or below is None:
            return None
        found = above + below
    elif e.op == "sum":
        # A sum of maxima is the maximum of all sums with one function from each.
        found = [(ex.ZERO,) * len(names)]
        for term, c in e.terms:
            own = _vertices(term, names, rules)
            if own is None or (c < 0.0 and len(own) > 1) or len(own) * len(found) > _MOST_SUMS:
                return None
            found = [
                tuple(ex.add((a, 1.0), (b, c)) for a, b in zip(row, more, strict=True))
                for row in found
                for more in own
            ]
    elif e.op == "prod":
        variable, factor = _separated(e, names)
        if len(variable) != 1 or variable[0][1] != 1.0 or not rules.nonnegative(factor):
            return None
        own = _vertices(variable[0][0], names, rules)
        if own is None:
            return None
        found = [tuple(factor * x for x in row) for row in own]
    else:
        return None
    kept = list(dict.fromkeys(found))
    return kept if len(kept) <= _MOST_VERTICES else None


def _at(e: Expr, values: Mapping[str, float]) -> Expr:
    return ex.substitute(e, {name: ex.num(x) for name, x in values.items()})
