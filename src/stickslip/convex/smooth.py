"""Dissipations of contacts in a plane and of faces: convex, with a gradient at every v ≠ 0."""

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

_ANGLES = 1440  # directions on a circle; jumps of the gradient are searched for between them
_ARCS = 12  # number of arcs of a circle that are bisected
_PLANES = 9  # number of random circles for three components, besides those of pairs of axes
_HALVINGS = 44  # of an arc of 2π/1440: its width is then a rounding error
_JUMP = 1e-6  # relative change of the gradient across such an arc that counts as a jump
_LARGEST = 1e150  # its square is finite
_FLAT = 1e-9  # width of the set of forces that counts as zero, relative to the largest width


def smooth_dissipation(
    value: Expr,
    names: tuple[str, ...],
    values: Mapping[str, float],
    where: str,
    like: Expr | None = None,
) -> ConvexFormula:
    """Check that a formula is the dissipation of a contact in a plane or of a face.

    The friction force must be unique for every direction of slip, so kinks are refused. They are
    searched for by bisection between neighbouring directions with the largest changes of the
    gradient, on one circle in a plane, and on twelve circles for a face.

    Parameters
    ----------
    names : tuple of str
        Components of the relative velocity.
    values : mapping of str to float
        Values of the parameters.
    where : str
        Subject of error messages.
    like : Expr, optional
        As in :func:`convex_formula`.

    Raises
    ------
    DeclarationError
        If it is not a support function (:func:`convex_formula`), has a kink, or does not resist
        slip along some line.
    """
    ranges = {x: (values[x], values[x]) for x in sorted(value.symbols - {*names})}
    found = convex_formula(value, names, ranges, where, like=like)
    others = [low for low, _ in ranges.values()]
    _check_width(found, others, where)
    _check_kinks(found, others, where)
    return found


def _circles(n: int) -> list[Array]:
    """Orthonormal bases, shape (2, n), of the planes in which directions are checked."""
    axes = np.eye(n)
    found = [axes[[i, j]] for i, j in combinations(range(n), 2)]
    rng = np.random.default_rng(0)
    others = _PLANES if n > 2 else 0
    return found + [np.linalg.qr(rng.normal(size=(n, 2)))[0].T for _ in range(others)]


def _check_width(formula: ConvexFormula, others: list[float], where: str) -> None:
    """Reject values that are too large, and a set of forces without extent in some direction: its
    width R(v) + R(−v) is then 0."""
    angles = np.pi * np.arange(_ANGLES) / _ANGLES
    given = np.broadcast_to(np.array(others)[:, None], (len(others), _ANGLES))
    for first, second in _circles(formula.dimension):
        v = np.cos(angles) * first[:, None] + np.sin(angles) * second[:, None]
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
    """Reject a gradient that jumps: arcs across which it changes most are bisected; in the limit
    only the change of a jump remains."""
    gradient = evaluator([*formula.gradient], [*formula.names, *formula.ranges])
    circles = np.array(_circles(formula.dimension))
    # Many formulas have kinks on the axes, which the offset of the angles avoids.
    angles = 0.1234567 + 2.0 * np.pi * np.arange(_ANGLES + 1) / _ANGLES

    def slopes(bases: Array, angle: Array) -> Array:
        """∇R at angles on circles, shape (n, count)."""
        v = np.cos(angle) * bases[:, 0].T + np.sin(angle) * bases[:, 1].T
        return gradient([*v, *(np.full(len(angle), x) for x in others)])

    every = np.repeat(circles, len(angles), axis=0)
    found = slopes(every, np.tile(angles, len(circles))).reshape(-1, len(circles), len(angles))
    changes = np.abs(np.diff(found, axis=2)).max(axis=0)
    most = np.argsort(np.nan_to_num(changes, nan=np.inf), axis=1)[:, -_ARCS:]
    which, arc = np.repeat(np.arange(len(circles)), _ARCS), most.ravel()
    bases, low, high = circles[which], angles[arc], angles[arc + 1]
    at_low, at_high = found[:, which, arc], found[:, which, arc + 1]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        between = slopes(bases, middle)
        first = np.abs(between - at_low).max(axis=0) >= np.abs(at_high - between).max(axis=0)
        low, high = np.where(first, low, middle), np.where(first, middle, high)
        at_low, at_high = np.where(first, at_low, between), np.where(first, between, at_high)
    jump = np.abs(at_high - at_low).max(axis=0)
    k = int(np.nan_to_num(jump, nan=np.inf).argmax())
    if not jump[k] <= _JUMP * np.abs(at_low).max():
        at = np.cos(low[k]) * bases[k, 0] + np.sin(low[k]) * bases[k, 1]
        raise DeclarationError(
            where,
            f"its gradient jumps at v = {_numbers(at)}, from {_numbers(at_low[:, k])} to "
            f"{_numbers(at_high[:, k])}",
            "The force of a slip must be unique: use contacts along lines, or smooth the kink, "
            f"as sqrt({formula.names[0]}**2 + ...) does",
        )


def _numbers(v: Array) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in v) + ")"


def with_equal_widths(formula: ConvexFormula) -> tuple[ConvexFormula, tuple[Expr, ...]]:
    """Scale the rotation rate of a face to a velocity.

    Returns
    -------
    ConvexFormula, tuple of Expr
        R′ and the diagonal of a matrix A with R(u) = R′(Au), such that R′ has the same width along
        the first and the last axis. For two components, R and ones.
    """
    n = formula.dimension
    if n < 3:
        return formula, (ex.ONE,) * n
    zero = dict.fromkeys(formula.names, ex.ZERO)

    def width(name: str) -> Expr:
        """The mean of R(e) and R(−e) with the unit vector e of an axis."""
        units = (zero | {name: ex.num(side)} for side in (1.0, -1.0))
        return ex.add(*((ex.substitute(formula.value, e, undefined=True), 0.5) for e in units))

    rate = formula.names[-1]
    axis = _without_branches(width(rate) / width(formula.names[0]))
    value = ex.substitute(formula.value, {rate: ex.sym(rate) / axis}, undefined=True)
    return replace(formula, value=value), (ex.ONE,) * (n - 1) + (axis,)


def _without_branches(axis: Expr) -> Expr:
    """The expression with selects replaced by their branch if their guard is proved nonnegative; 1
    if others remain. Any positive scale is valid."""

    def above(e: Expr) -> Expr | None:
        return e.args[1] if e.op == "select" and ex.never_negative(e.args[0]) else None

    found = ex.rewrite(axis, above, again=True, undefined=True)
    return ex.ONE if any(e.op == "select" for e in ex.walk([found])) else found


class Slope(NamedTuple):
    """R and ∇R as expressions of a direction n.

    Attributes
    ----------
    components : tuple of Expr
        ∇R(n).
    pieces : tuple of (Expr, Expr)
        Guards of the pieces of ∇R, as functions of the velocity and of the direction.
    value : Expr
        R(n).
    """

    components: tuple[Expr, ...]
    pieces: tuple[tuple[Expr, Expr], ...]
    value: Expr


def gradient_along(
    formula: ConvexFormula, direction: Sequence[Expr], velocity: Sequence[Expr]
) -> Slope:
    """R and ∇R as expressions of a direction. Their pieces are selected by the velocity along the
    direction, which is part of the state, so that their guards are guards of the motion.

    Parameters
    ----------
    direction, velocity : sequence of Expr
        Components; the velocity is a positive multiple of the direction.
    """
    n = dict(zip(formula.names, direction, strict=True))
    u = dict(zip(formula.names, velocity, strict=True))
    pieces: dict[Expr, Expr] = {}

    def change(e: Expr) -> Expr | None:
        if e.op == "sym":
            return n.get(str(e.value))
        if e.op != "select" or not e.args[0].symbols & n.keys():
            return None
        guard = ex.substitute(e.args[0], u)
        canonical = ex.select(guard, ex.ONE, ex.ZERO)  # its guard may have the opposite sign
        if canonical.op == "select":
            sign = 1.0 if canonical.args[1] is ex.ONE else -1.0
            pieces[canonical.args[0]] = sign * ex.substitute(e.args[0], n)
        above, below = (ex.rewrite(part, change, undefined=True) for part in e.args[1:])
        return ex.select(guard, above, below, strict=e.strict)

    value, *slopes = (
        ex.rewrite(e, change, undefined=True) for e in (formula.value, *formula.gradient)
    )
    return Slope((*slopes,), (*pieces.items(),), value)
