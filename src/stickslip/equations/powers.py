"""Whether the powers of a system are quadratic if its rates and forces are affine."""

from __future__ import annotations

from stickslip.equations.derive import MotionEquations
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS

_MORE = 3  # degree of terms that are neither constant, nor affine, nor quadratic


def are_powers_quadratic(equations: MotionEquations) -> bool:
    """Whether dissipated and supplied power are of degree 2 in the state, its rates, forces and
    relative velocities of contacts, time, and waves with the frequencies of the drives.

    A piecewise function has the largest degree of its branches, since a mode has fixed regions.
    """
    d = equations.declaration
    names = {*d.state, *(f"d_{x}" for x in d.state), "t"}
    for i in range(len(equations.contacts)):
        names |= {f"u:{i}", f"lambda:{i}"}
    waves = {*equations.frequencies, *(-e for e in equations.frequencies)}
    known: dict[Expr, int] = {}
    for e in ex.walk([equations.dissipation, equations.supply]):
        known[e] = _degree(e, known, frozenset(names), frozenset(d.parameters), waves)
    return max(known[equations.dissipation], known[equations.supply]) < _MORE


def _degree(
    e: Expr,
    known: dict[Expr, int],
    names: frozenset[str],
    parameters: frozenset[str],
    waves: set[Expr],
) -> int:
    """Degree of an expression, from those of its parts.

    Parameters
    ----------
    names, parameters : frozenset of str
        What is affine, and what is constant.
    waves : set of Expr
        Frequencies of waves that count as affine.
    """
    if e.symbols <= parameters:
        return 0
    if e.op == "sym":
        return 1 if e.value in names else _MORE
    if e.op == "sum":
        return max(known[term] for term, _ in e.terms)
    if e.op == "prod":
        degree = 0.0
        for factor, exponent in e.terms:
            whole = exponent > 0.0 and float(exponent).is_integer()
            degree += known[factor] * exponent if whole or not known[factor] else _MORE
        return min(int(degree), _MORE)
    if e.op == "select":
        return max(known[branch] for branch in e.args[1:])
    row = FUNCTIONS.get(e.op)
    if row is not None and row.crest is not None and e.symbols <= parameters | {"t"}:
        return 1 if ex.frequency(e) in waves else _MORE
    return _MORE
