"""Dissipations of contacts in a plane and of faces: convex, with a gradient wherever v is not 0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.convex.formula import ConvexFormula, convex_formula
from stickslip.errors import DeclarationError
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr

_ANGLES = 1440  # samples of a circle, between which a jump of the gradient is searched for
_ARCS = 12  # number of arcs that are refined
_PLANES = 9  # additional circles besides those of pairs of axes, for three components
_HALVINGS = 44
_JUMP = 1e-6  # relative change of a gradient across an arc as narrow as rounding allows
_LARGEST = 1e150
_FLAT = 1e-9  # width of the set of forces, relative to the largest


def smooth_dissipation(
    value: Expr,
    names: tuple[str, ...],
    values: Mapping[str, float],
    where: str,
    like: Expr | None = None,
) -> ConvexFormula:
    """A formula that is checked to be the dissipation of a contact in a plane.

    A contact needs one force for each direction of slip, so kinks are refused; they are looked for
    by bisection where the gradient changes most between 1,440 directions of a circle, of faces of
    twelve circles.

    Parameters
    ----------
    names : tuple of str
        Components of the relative velocity.
    values : mapping of str to float
        Parameters.
    where : str
        What an error is about.
    like : Expr, optional
        As in :func:`convex_formula`.

    Raises
    ------
    DeclarationError
        If it is not a support function (:func:`convex_formula`), has a kink, or does not resist
        slip along some direction.
    """
    ranges = {x: (values[x], values[x]) for x in sorted(value.symbols - {*names})}
    found = convex_formula(value, names, ranges, where, like=like)
    others = [low for low, _ in ranges.values()]
    _check_width(found, others, where)
    _check_kinks(found, others, where)
    return found


def _circles(n: int) -> list[Array]:
    """Orthonormal pairs that span the planes in which directions are looked at, shape (2, n)."""
    axes = np.eye(n)
    found = [axes[[i, j]] for i, j in combinations(range(n), 2)]
    rng = np.random.default_rng(0)
    others = _PLANES if n > 2 else 0
    return found + [np.linalg.qr(rng.normal(size=(n, 2)))[0].T for _ in range(others)]


def _along(circle: Array, angles: Array) -> Array:
    return np.cos(angles) * circle[0][:, None] + np.sin(angles) * circle[1][:, None]


def _check_width(formula: ConvexFormula, others: list[float], where: str) -> None:
    angles = np.pi * np.arange(_ANGLES) / _ANGLES
    given = np.broadcast_to(np.array(others)[:, None], (len(others), _ANGLES))
    for circle in _circles(formula.dimension):
        v = _along(circle, angles)
        width = formula.values([*v, *given])[0] + formula.values([*-v, *given])[0]
        if not width.max() < _LARGEST:
            raise DeclarationError(
                where,
                f"it reaches {width.max():.2g}, and its square overflows",
                f"Keep it below {_LARGEST:g}",
            )
        k = int(width.argmin())
        if not width[k] > _FLAT * width.max():
            raise DeclarationError(
                where,
                f"it vanishes along v = {_numbers(v[:, k])} in both directions",
                "Remove this direction from the contact",
            )


def _check_kinks(formula: ConvexFormula, others: list[float], where: str) -> None:
    gradient = evaluator([*formula.gradient], [*formula.names, *formula.ranges])
    circles = np.array(_circles(formula.dimension))
    # A start away from the directions in which a formula may have a kink by its form.
    angles = 0.1234567 + 2.0 * np.pi * np.arange(_ANGLES + 1) / _ANGLES

    def slopes(own: Array, angle: Array) -> Array:
        """∇R in directions of circles, shape (n, count)."""
        v = np.cos(angle) * own[:, 0].T + np.sin(angle) * own[:, 1].T
        return gradient([*v, *(np.full(len(angle), x) for x in others)])

    every = np.repeat(circles, len(angles), axis=0)
    found = slopes(every, np.tile(angles, len(circles))).reshape(-1, len(circles), len(angles))
    changes = np.abs(np.diff(found, axis=2)).max(axis=0)
    # A jump is among the largest changes.
    most = np.argsort(np.nan_to_num(changes, nan=np.inf), axis=1)[:, -_ARCS:]
    which, arc = np.repeat(np.arange(len(circles)), _ARCS), most.ravel()
    own, low, high = circles[which], angles[arc], angles[arc + 1]
    here, there = found[:, which, arc], found[:, which, arc + 1]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        between = slopes(own, middle)
        first = np.abs(between - here).max(axis=0) >= np.abs(there - between).max(axis=0)
        low, high = np.where(first, low, middle), np.where(first, middle, high)
        here, there = np.where(first, here, between), np.where(first, between, there)
    jump = np.abs(there - here).max(axis=0)
    k = int(np.nan_to_num(jump, nan=np.inf).argmax())
    if not jump[k] <= _JUMP * np.abs(here).max():
        at = np.cos(low[k]) * own[k, 0] + np.sin(low[k]) * own[k, 1]
        raise DeclarationError(
            where,
            f"its gradient jumps at v = {_numbers(at)}, from {_numbers(here[:, k])} to "
            f"{_numbers(there[:, k])}",
            "The force of a slip must be unique: use contacts along lines, or smooth the kink, "
            f"as sqrt({formula.names[0]}**2 + ...) does",
        )


def _numbers(v: Array) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in v) + ")"


def evened(formula: ConvexFormula) -> tuple[ConvexFormula, tuple[Expr, ...]]:
    """R′ and a diagonal matrix A with R(u) = R′(Au), such that the rate at which a face turns
    dissipates like a velocity; of two components R itself."""
    n = formula.dimension
    if n < 3:
        return formula, (ex.ONE,) * n
    zero = dict.fromkeys(formula.names, ex.ZERO)

    def width(name: str) -> Expr:
        ways = (zero | {name: ex.num(side)} for side in (1.0, -1.0))
        return ex.add(*((ex.substitute(formula.value, w, undefined=True), 0.5) for w in ways))

    turning = formula.names[-1]
    axis = _chosen(width(turning) / width(formula.names[0]))
    value = ex.substitute(formula.value, {turning: ex.sym(turning) / axis}, undefined=True)
    return replace(formula, value=value), (ex.ONE,) * (n - 1) + (axis,)


def _chosen(axis: Expr) -> Expr:
    """An axis without choices: 1 where one is left that depends on parameters."""

    def above(e: Expr) -> Expr | None:
        return e.args[1] if e.op == "select" and ex.never_negative(e.args[0]) else None

    found = ex.rewrite(axis, above, again=True, undefined=True)
    return ex.ONE if any(e.op == "select" for e in ex.walk([found])) else found


class Slope(NamedTuple):
    """R and ∇R as expressions of a direction.

    Attributes
    ----------
    pieces : tuple of (Expr, Expr)
        Guards of its pieces: of a velocity, and the same of the direction.
    value : Expr
        R of the direction.
    """

    components: tuple[Expr, ...]
    pieces: tuple[tuple[Expr, Expr], ...]
    value: Expr


def gradient_along(
    formula: ConvexFormula, direction: Sequence[Expr], velocity: Sequence[Expr]
) -> Slope:
    """∇R as expressions of a direction; which of its pieces counts is asked of a velocity along it,
    which is part of the state.

    Parameters
    ----------
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

    value, *slopes = (
        ex.rewrite(e, placed, undefined=True) for e in (formula.value, *formula.gradient)
    )
    return Slope((*slopes,), (*pieces.items(),), value)
