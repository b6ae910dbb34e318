"""The degree of homogeneity of a formula, from its structure."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

from stickslip.numerics.levels import FEW_ROUNDINGS
from stickslip.symbolic.expressions import Expr, is_number, walk


def degree(expression: Expr, names: Collection[str]) -> float | None:
    """The d for which f(λv) = λᵈ f(v) for all λ > 0, other names held; None if the form does not
    show one.

    Sums have terms of one degree, products add theirs, functions keep degree 0, and pieces that
    agree meet where something homogeneous changes its sign. The formula 0 has every degree: NaN.

    Parameters
    ----------
    names : collection of str
        Components of v.
    """
    scaled = frozenset(names)
    known: dict[Expr, float | None] = {}
    for e in walk([expression]):
        known[e] = _degree(e, scaled, known)
    return known[expression]


def _degree(e: Expr, names: frozenset[str], known: dict[Expr, float | None]) -> float | None:
    if is_number(e, 0.0):
        return math.nan
    if not e.symbols & names:
        return 0.0
    match e.op:
        case "sym":
            return 1.0
        case "sum":
            own = [known[term] for term, _ in e.terms]
            return _common([*own, 0.0] if float(e.value) else own)
        case "prod":
            parts = [(known[base], p) for base, p in e.terms]
            found = [d * p for d, p in parts if d is not None]
            return sum(found) if len(found) == len(parts) else None
        case "select":
            guard, above, below = (known[a] for a in e.args)
            return None if guard is None else _common([above, below])
        case "pow":
            return 0.0 if all(known[a] == 0.0 for a in e.args) else None
        case _:
            return 0.0 if known[e.args[0]] == 0.0 else None


def _common(degrees: Iterable[float | None]) -> float | None:
    """The degree of all of them; 0, whose degree is NaN, goes with any."""
    common = math.nan
    for d in degrees:
        if d is None:
            return None
        if math.isnan(common):
            common = d
        elif not math.isnan(d) and abs(d - common) > FEW_ROUNDINGS * max(abs(d), abs(common)):
            return None
    return common
