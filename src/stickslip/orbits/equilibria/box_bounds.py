"""Bounds of conditions on boxes that may be unbounded: enclosures, periods, and dominant terms at
infinity."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.numerics.levels import WHOLE_COUNT
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import enclosures, slopes
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS
from stickslip.symbolic.intervals import EVERYTHING, LOOSE

# relative to 1 + the modulus: distances of boxes and of states from them that are rounding errors
_MEETS = 1e-7
_TURNS = 12  # largest multiple of the longest period that is tried as a common one

if TYPE_CHECKING:
    from stickslip.orbits.equilibria.level_sets import LevelSet


class Enclosures(NamedTuple):
    """Enclosures of m conditions on N boxes.

    Attributes
    ----------
    low, high : array, shape (m, N)
    slope_low, slope_high : array, shape (m, k, N)
    at_centre, at_centre_low : array, shape (m, N)
        Upper and lower bounds at the centres; infinite if slopes give no bound on a box.
    """

    low: Array
    high: Array
    slope_low: Array
    slope_high: Array
    at_centre: Array
    at_centre_low: Array


def domain(e: Expr) -> list[Expr]:
    """Functions that are nonnegative where an expression is defined."""
    known: dict[Expr, list[Expr]] = {}
    for node in ex.walk([e]):
        children = [*node.args, *(child for child, _ in node.terms)]
        if node.op == "select":
            guard, above, below = node.args
            known[node] = [
                *known[guard],
                *(ex.select(guard, d, ex.ONE) for d in known[above]),
                *(ex.select(guard, ex.ONE, d) for d in known[below]),
            ]
            continue
        found = [d for child in children for d in known[child]]
        if node.op == "prod":
            found += [base for base, p in node.terms if not p.is_integer()]
        elif node.op == "pow":
            found.append(node.args[0])
        elif node.op in FUNCTIONS and FUNCTIONS[node.op].domain != EVERYTHING:
            low, high = FUNCTIONS[node.op].domain
            found += [node.args[0] - low] if math.isfinite(low) else []
            found += [high - node.args[0]] if math.isfinite(high) else []
        known[node] = list(dict.fromkeys(found))
    return known[e]


def far_out(e: Expr, name: str) -> Expr:
    """An expression with the largest power of a name taken out of every sum."""

    def out_of(e: Expr) -> Expr | None:
        if name not in e.symbols:
            return e
        if e.op != "sum":
            return None
        x = ex.sym(name)
        terms = [(far_out(term, name), c) for term, c in e.terms]
        powers = [dict(t.terms).get(x, 0.0) if t.op == "prod" else float(t is x) for t, _ in terms]
        largest = max(powers)
        if largest <= 0.0:
            return ex.add(*terms, (ex.ONE, float(e.value)))
        top = x ** ex.num(largest)
        return top * ex.add(*((t / top, c) for t, c in terms), (ex.ONE / top, float(e.value)))

    return ex.rewrite(e, out_of)


def period(expressions: Sequence[Expr], name: str, values: Mapping[str, float]) -> float:
    """The period with which expressions repeat in a name; 0 if they do not."""
    found: list[float] = []
    seen: set[Expr] = set()
    stack = [e for e in expressions if name in e.symbols]
    while stack:
        e = stack.pop()
        if e in seen:
            continue
        seen.add(e)
        if e.op in FUNCTIONS and FUNCTIONS[e.op].period and not ex.bends(e.args[0], [name]):
            slope = ex.derivative(e.args[0], name)
            if slope.symbols <= values.keys():
                found.append(FUNCTIONS[e.op].period / abs(ex.evaluate(slope, values)))
                continue
        if e.op == "sym":
            return 0.0
        stack += [c for c in (*e.args, *(t for t, _ in e.terms)) if name in c.symbols]
    longest = max(found, default=0.0)
    for n in range(1, _TURNS + 1):
        turns = [n * longest / p for p in found]
        if all(abs(t - round(t)) <= WHOLE_COUNT * t for t in turns):
            return n * longest
    return 0.0


def centres(low: Array, high: Array) -> Array:
    """Middles of boxes; of those without end, the end that they have."""
    with np.errstate(invalid="ignore"):
        middle = np.clip(0.5 * low + 0.5 * high, low, high)
    middle = np.where(np.isinf(high), low, np.where(np.isinf(low), high, middle))
    return np.where(np.isinf(middle), 0.0, middle)


@np.errstate(all="ignore")
def enclosed(
    expressions: list[Expr], of: LevelSet, low: Array, high: Array, needed: int = 0
) -> Enclosures:
    """Enclosures of expressions on boxes.

    Parameters
    ----------
    of : LevelSet
        Whose unknowns they are in.
    low, high : array, shape (k, N)
    needed : int
        The mean value theorem is used on boxes on which the first `needed` expressions are
        nonnegative: elsewhere the others may be undefined.
    """
    count = low.shape[1]
    middle = centres(low, high)
    ranges = of.ranges(low, high)
    inside = enclosures(expressions, of.ranges(middle, middle))
    at = np.array([np.broadcast_to(box, (2, count)) for box in inside])
    found = [slopes(expressions, ranges, x) for x in of.names]
    value = np.array([np.broadcast_to(box, (2, count)) for box, _ in found[0]])
    slope = np.array(
        [[np.broadcast_to(s, (2, count)) for _, s in each] for each in found]
    )  # (k, m, 2, N)
    slope_low, slope_high = slope[:, :, 0].swapaxes(0, 1), slope[:, :, 1].swapaxes(0, 1)
    before, behind = low - middle, high - middle
    up = np.maximum(
        slope_times_distance(slope_high, behind), slope_times_distance(slope_low, before)
    )
    down = np.minimum(
        slope_times_distance(slope_low, behind), slope_times_distance(slope_high, before)
    )
    up, down = np.maximum(up, 0.0).sum(axis=1), np.minimum(down, 0.0).sum(axis=1)
    slack = LOOSE * (2 + len(of.names)) * (np.abs(at).max(axis=1) + np.maximum(up, -down))
    fine = np.all(value[:needed, 0] >= 0.0, axis=0)
    least = np.where(fine & np.isfinite(slack), at[:, 0] + down - slack, -math.inf)
    most = np.where(fine & np.isfinite(slack), at[:, 1] + up + slack, math.inf)
    # if only one side is bounded
    one_low = fine & np.isfinite(down) & ~np.isfinite(slack)
    one_high = fine & np.isfinite(up) & ~np.isfinite(slack)
    loose = LOOSE * (2 + len(of.names))
    least = np.where(one_low, at[:, 0] + down - loose * (abs(at[:, 0]) - down), least)
    most = np.where(one_high, at[:, 1] + up + loose * (abs(at[:, 1]) + up), most)
    least = np.where(np.isnan(least), -math.inf, least)
    most = np.where(np.isnan(most), math.inf, most)
    return Enclosures(
        np.maximum(value[:, 0], least),
        np.minimum(value[:, 1], most),
        slope_low,
        slope_high,
        np.where(fine, at[:, 1], math.inf),
        np.where(fine, at[:, 0], -math.inf),
    )


def slope_times_distance(slope: Array, way: Array) -> Array:
    """Products of slopes and distances, with 0 · ∞ = 0."""
    return np.where((slope == 0.0) | (way == 0.0), 0.0, slope * way)


def touch(a: Mapping[str, tuple[float, float]], b: Mapping[str, tuple[float, float]]) -> bool:
    """Return whether two boxes intersect."""
    pairs = [(max(a[x][0], b[x][0]), min(a[x][1], b[x][1])) for x in a]
    return all(low <= high + _MEETS * (1.0 + abs(high)) for low, high in pairs)


def is_within(extent: Mapping[str, tuple[float, float]], state: Mapping[str, float]) -> bool:
    """Return whether a state is in a box, or on its boundary up to rounding."""
    return all(
        low - _MEETS * (1 + abs(low)) <= state[x] <= high + _MEETS * (1 + abs(high))
        for x, (low, high) in extent.items()
    )
