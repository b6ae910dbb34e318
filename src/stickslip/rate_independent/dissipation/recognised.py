"""Recognition of formulas that are potentials of other kinds, which have closed forms."""

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
_MOST_VERTICES = 64
_FLATTEST = 1e-10  # eigenvalue of an ellipsoid, relative to the largest, that is not rounding


def recognised(value: Expr, names: tuple[str, ...], ranges: _Ranges) -> Dissipation | None:
    """The potential of another kind that is equal to a formula; None if none is recognised.

    Parameters
    ----------
    value : Expr
        Convex, homogeneous and nonnegative.
    names : tuple of str
        Components of v.
    ranges : mapping of str to (float, float)
        Of the phase, if it depends on that.
    """
    try:
        blocks = _blocks(value, names)
        if all(len(block) == 1 for block, _ in blocks):
            ends = [[_at(part, {block[0]: end}) for block, part in blocks] for end in (1.0, -1.0)]
            return WeightedL1(*ends)
        if len(blocks) == 1:
            return _ellipsoid(value, names, ranges) or _polytope(value, names, ranges)
        return Product(tuple(_factor(part, block, ranges) for block, part in blocks))
    except (DeclarationError, ArithmeticError):
        return None


def _blocks(value: Expr, names: tuple[str, ...]) -> list[tuple[tuple[str, ...], Expr]]:
    """Groups of neighbouring components without common terms, with the sum of their terms."""
    terms = value.terms if value.op == "sum" else ((value, 1.0),)
    joined = [False] * len(names)  # whether a component goes with the next
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
    own = {name: ends for name, ends in ranges.items() if name in part.symbols}
    known = recognised(part, block, own)
    return known or FormulaSets(convex_formula(part, block, own, "formula", symbol="Psi"))


def _ellipsoid(value: Expr, names: tuple[str, ...], ranges: _Ranges) -> Ellipsoid | None:
    """The square root of a quadratic form, possibly with a factor."""
    (term, c) = value.terms[0] if value.op == "sum" and len(value.terms) == 1 else (value, 1.0)
    if term.op != "prod" or c < 0.0:
        return None
    moving = [(base, p) for base, p in term.terms if base.symbols & {*names}]
    fixed = [ex.power(base, ex.num(p)) for base, p in term.terms if not base.symbols & {*names}]
    if len(moving) != 1 or moving[0][1] != 0.5:
        return None
    base = moving[0][0]
    if not is_nonnegative_form(base, Directions(names, ranges)):
        return None
    # (c √Q(v))² = vᵀ S v with S = ½ c² ∂²Q, since Q is a quadratic form.
    square = ex.multiply(ex.num(0.5 * c * c), *(ex.power(factor, ex.num(2.0)) for factor in fixed))
    shape = [
        [ex.multiply(square, ex.derivative(ex.derivative(base, a), b)) for b in names]
        for a in names
    ]
    if not ranges:
        squares = np.linalg.eigvalsh([[ex.number(entry) for entry in row] for row in shape])
        small = np.abs(squares) < _FLATTEST * squares[-1]
        if (np.abs(squares[small]) > ROUNDED_TERM * len(names) * squares[-1]).any():
            return None
    return Ellipsoid(shape)


def _polytope(value: Expr, names: tuple[str, ...], ranges: _Ranges) -> Polytope | None:
    """The largest of linear functions."""
    vertices = _vertices(value, names, ConvexRules(Directions(names, ranges)))
    return None if vertices is None else Polytope(vertices=[list(row) for row in vertices])


def _vertices(e: Expr, names: tuple[str, ...], rules: ConvexRules) -> list[tuple[Expr, ...]] | None:
    """Gradients of linear functions whose maximum is the expression."""
    found: list[tuple[Expr, ...]]
    shape = rules.shape(e)
    if shape == AFFINE_SHAPE and not ex.bends(e, names):
        return [tuple(ex.derivative(e, name) for name in names)]
    if shape != CONVEX:
        return None
    if e.op == "select" and e.args[0].symbols & {*names}:
        parts = [_vertices(branch, names, rules) for branch in e.args[1:]]
        found = [row for part in parts if part is not None for row in part]
        if None in parts:
            return None
    elif e.op == "sum":
        found = [(ex.ZERO,) * len(names)]
        for term, c in e.terms:
            own = _vertices(term, names, rules)
            if own is None or (c < 0.0 and len(own) > 1) or len(own) * len(found) > 4096:
                return None
            found = [
                tuple(ex.add((a, 1.0), (b, c)) for a, b in zip(row, more, strict=True))
                for row in found
                for more in own
            ]
    elif e.op == "prod":
        moving = [(base, p) for base, p in e.terms if base.symbols & {*names}]
        fixed = [ex.power(b, ex.num(p)) for b, p in e.terms if not b.symbols & {*names}]
        if len(moving) != 1 or moving[0][1] != 1.0 or not rules.nonnegative(ex.multiply(*fixed)):
            return None
        own = _vertices(moving[0][0], names, rules)
        if own is None:
            return None
        found = [tuple(ex.multiply(*fixed, x) for x in row) for row in own]
    else:
        return None
    kept = list(dict.fromkeys(found))
    return kept if len(kept) <= _MOST_VERTICES else None


def _at(e: Expr, values: Mapping[str, float]) -> Expr:
    return ex.substitute(e, {name: ex.num(x) for name, x in values.items()})
