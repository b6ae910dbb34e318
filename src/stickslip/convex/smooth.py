"""Dissipations of contacts in a plane: convex, with a gradient wherever the velocity is not 0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.convex.formula import ConvexFormula, convex_formula
from stickslip.errors import DeclarationError
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr

_ANGLES = 1440  # between which a jump of the gradient is looked for
_HALVINGS = 44
_JUMP = 1e-6  # change of a gradient, in parts of its size, across what rounding leaves of an arc
_FLAT = 1e-9  # width of the set of forces, in parts of the largest


def smooth_dissipation(
    value: Expr, names: tuple[str, ...], values: Mapping[str, float], where: str
) -> ConvexFormula:
    """A formula that is checked to be the dissipation of a contact in a plane.

    A contact needs one force for each direction of slip, so kinks are refused; they are looked for
    by bisection between 1,440 directions.

    Parameters
    ----------
    value : Expr
    names : pair of str
        Components of the relative velocity.
    values : mapping of str to float
        Parameters.
    where : str
        What an error is about.

    Raises
    ------
    DeclarationError
        If it is no support function (:func:`convex_formula`), has a kink, or holds no force along
        some direction.
    """
    ranges = {x: (values[x], values[x]) for x in sorted(value.symbols - {*names})}
    found = convex_formula(value, names, ranges, where)
    others = [low for low, _ in ranges.values()]
    _check_width(found, others, where)
    _check_kinks(found, others, where)
    return found


def _check_width(formula: ConvexFormula, others: list[float], where: str) -> None:
    angles = np.pi * np.arange(_ANGLES) / _ANGLES
    v = np.array([np.cos(angles), np.sin(angles)])
    given = np.broadcast_to(np.array(others)[:, None], (len(others), _ANGLES))
    width = formula.values([*v, *given])[0] + formula.values([*-v, *given])[0]
    k = int(width.argmin())
    if not width[k] > _FLAT * width.max():
        raise DeclarationError(
            where,
            f"it vanishes along v = ({v[0, k]:.6g}, {v[1, k]:.6g}), both ways",
            "Use a contact along a line, with one direction",
        )


def _check_kinks(formula: ConvexFormula, others: list[float], where: str) -> None:
    gradient = evaluator([*formula.gradient], [*formula.names, *formula.ranges])

    def slopes(angles: Array) -> Array:
        v = np.array([np.cos(angles), np.sin(angles)])
        given = np.broadcast_to(np.array(others)[:, None], (len(others), len(angles)))
        return gradient([*v, *given])

    # A start that hits no direction in which a formula may have a kink by its form.
    low = 0.1234567 + 2.0 * np.pi * np.arange(_ANGLES) / _ANGLES
    high = low + 2.0 * np.pi / _ANGLES
    here, there = slopes(low), slopes(high)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        between = slopes(middle)
        first = np.abs(between - here).max(axis=0) >= np.abs(there - between).max(axis=0)
        low, high = np.where(first, low, middle), np.where(first, middle, high)
        here, there = np.where(first, here, between), np.where(first, between, there)
    jump = np.abs(there - here).max(axis=0)
    k = int(np.nan_to_num(jump, nan=np.inf).argmax())
    if not jump[k] <= _JUMP * np.abs(here).max():
        x, y = np.cos(low[k]), np.sin(low[k])
        raise DeclarationError(
            where,
            f"its gradient jumps at v = ({x:.6g}, {y:.6g}), from ({here[0, k]:.6g}, "
            f"{here[1, k]:.6g}) to ({there[0, k]:.6g}, {there[1, k]:.6g})",
            "Slip in one direction has one force: use contacts along lines, whose friction adds "
            f"up, or round the kink off, as sqrt({formula.names[0]}**2 + ...) does",
        )


class Slope(NamedTuple):
    """∇R as expressions of a direction.

    Attributes
    ----------
    components : tuple of Expr
    pieces : tuple of (Expr, Expr)
        Guards of its pieces: of a velocity, and the same of the direction.
    """

    components: tuple[Expr, ...]
    pieces: tuple[tuple[Expr, Expr], ...] = ()


def slope_of(formula: ConvexFormula, direction: Sequence[Expr], velocity: Sequence[Expr]) -> Slope:
    """∇R as expressions of a direction; which of its pieces counts is asked of a velocity along it,
    which is part of the state.

    Parameters
    ----------
    formula : ConvexFormula
    direction, velocity : sequence of Expr
        By component.
    """
    n = dict(zip(formula.names, direction, strict=True))
    u = dict(zip(formula.names, velocity, strict=True))
    pieces: dict[Expr, Expr] = {}

    def placed(e: Expr) -> Expr | None:
        if e.op == "sym":
            return n.get(str(e.value))
        if e.op != "select" or not e.args[0].symbols & n.keys():
            return None
        guard = ex.substitute(e.args[0], u)
        asked = ex.select(guard, ex.ONE, ex.ZERO)  # as it is listed: perhaps with another sign
        if asked.op == "select":
            sign = 1.0 if asked.args[1] is ex.ONE else -1.0
            pieces[asked.args[0]] = sign * ex.substitute(e.args[0], n)
        above, below = (ex.rewrite(part, placed, undefined=True) for part in e.args[1:])
        return ex.select(guard, above, below, strict=e.strict)

    slopes = [ex.rewrite(slope, placed, undefined=True) for slope in formula.gradient]
    return Slope((*slopes,), (*pieces.items(),))
