"""Expressions with kinks at many states: states in the same region of the kinks are evaluated
together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.equations.field import Region, in_region
from stickslip.kept import made_once
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr, substitute

_MOST_KEPT = 1024  # largest number of expressions in regions that are kept for each system


def _chosen(equations: MotionEquations, expression: Expr, region: Region) -> Expr:
    """An expression in a region of the kinks, cached, since maps need the same ones at every
    point."""
    key = expression, region
    return made_once(equations, "in regions", lambda: _found(equations, *key), key, _MOST_KEPT)


def _found(equations: MotionEquations, expression: Expr, region: Region) -> Expr:
    regions = dict(zip(equations.kinks, region, strict=True))
    chosen = in_region(expression, regions, undefined=True)
    speeds = chosen.symbols & equations.speeds.keys()
    return substitute(chosen, {x: in_region(equations.speeds[x], regions) for x in speeds})


def values_at(
    equations: MotionEquations,
    parameters: Mapping[str, float | Array],
    states: Array,
    expressions: Callable[[Region], Sequence[Expr]] | Sequence[Expr],
    time: float = 0.0,
) -> Array:
    """Values of expressions in time, state and parameters.

    Parameters
    ----------
    parameters : mapping of str to float or array, shape (points,)
    states : array, shape (points, states)
    expressions : sequence of Expr, or function of a region
        With kinks; or those of one region, without.

    Returns
    -------
    array, shape (expressions, points)
    """
    names = ("t", *equations.declaration.state, *parameters)
    constants = [np.broadcast_to(value, len(states)) for value in parameters.values()]
    table = np.vstack([np.full(len(states), time), states.T, *constants])
    region = np.ones((len(equations.kinks), len(states)), int)

    def grouped(wanted: Callable[[Region], Sequence[Expr]]) -> Array:
        groups = np.unique(region, axis=1).T if len(states) and len(region) else region.T[:1]
        parts = [
            (np.all(region == r[:, None], axis=0), evaluator(wanted(tuple(map(int, r))), names))
            for r in groups
        ]
        out = np.empty((len(wanted(tuple([1] * len(equations.kinks)))), len(states)))
        for here, function in parts:
            out[:, here] = function(table[:, here])
        return out

    def within(given: Sequence[Expr]) -> Callable[[Region], Sequence[Expr]]:
        return lambda r: [_chosen(equations, e, r) for e in given]

    for _ in equations.kinks:  # one kink may decide where another one is
        region = (grouped(within(equations.kinks)) >= 0.0).astype(int)
    return grouped(expressions if callable(expressions) else within(expressions))
