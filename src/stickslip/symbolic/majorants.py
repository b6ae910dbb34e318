"""Bounds of the deviation of a formula of one variable from its value in the middle of an interval,
on discs in the complex plane.

One pass over a tree, without series: for every node w with the Taylor coefficients w_k in the
middle of a stretch, a bound of Σ_{k≥1} |w_k| r^k. By Cauchy's estimate, it bounds the error of a
polynomial of known degree: a feature that no sample shows, because it underflows at all of them,
has an exponentially larger bound.

Source: R. E. Moore, *Methods and Applications of Interval Analysis*, SIAM (1979), chapter 8, for
majorants of series.
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import between, enclosures, slopes
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import ARGUMENT, FUNCTIONS, Function

_SPACINGS = 4.0  # spacings between a zero of a guard and its floating-point number
Known = dict[Expr, Array]


def growth(expression: Expr, name: str, start: Array, end: Array, radius: Array) -> Array:
    """Bounds of |f(u) − f(middle)| for complex u within `radius` of the middle, f continued from
    inside the stretch.

    Parameters
    ----------
    name : str
        Of its variable.
    start, end, radius : ndarray of shape (m,)

    Returns
    -------
    ndarray of shape (m,)
        Infinite where f is not proved to be analytic in the disc, or a kink is not proved to be on
        one branch inside the interval.
    """
    nodes = list(ex.walk([expression]))
    with np.errstate(all="ignore"):
        one_branch = _one_branch([e.args[0] for e in nodes if e.op == "select"], name, start, end)
        return _deviations(nodes, name, 0.5 * (start + end), radius, one_branch)[1][expression]


def _deviations(
    nodes: list[Expr], name: str, middle: Array, radius: Array, one_branch: Known
) -> tuple[Known, Known]:
    """Values of nodes in the middle, and bounds of their deviation."""
    values = dict(zip(nodes, evaluator(nodes, [name])(middle[None]), strict=True))
    bounds: Known = {}
    for e in nodes:
        if not e.symbols:
            bounds[e] = np.zeros(len(middle))
        elif e.op == "sym":
            bounds[e] = radius
        elif e.op == "select":
            taken = np.where(values[e.args[0]] >= 0.0, bounds[e.args[1]], bounds[e.args[2]])
            bounds[e] = np.where(one_branch[e.args[0]], taken, np.inf)
        else:
            bounds[e] = _bound(e, values, bounds)
        bounds[e] = np.where(np.isnan(bounds[e]), np.inf, bounds[e])
    return values, bounds


def _one_branch(guards: list[Expr], name: str, start: Array, end: Array) -> dict[Expr, Array]:
    """Whether guards keep their sign inside the intervals; at the ends they may be 0, up to
    rounding."""
    if not guards:
        return {}
    inside = slopes(guards, {name: (start, end)}, name)
    ends = [enclosures(guards, {name: (at, at)}) for at in (start, end)]
    spacing = _SPACINGS * np.spacing(np.maximum(np.abs(start), np.abs(end)))
    found = {}
    for guard, (value, slope), first, last in zip(guards, inside, *ends, strict=True):
        steep = np.nan_to_num(np.abs(slope).max(axis=0), posinf=0.0)
        slack = 2.0 * np.maximum(first[1] - first[0], last[1] - last[0]) + spacing * steep
        low, high = between(first, last, slope, np.nextafter(end - start, np.inf))
        low, high = np.maximum(low, value[0]), np.minimum(high, value[1])
        found[guard] = (low >= -slack) | (high <= slack)
    return found


def _bound(e: Expr, values: Known, bounds: Known) -> Array:
    match e.op:
        case "sum":
            return sum((abs(c) * bounds[term] for term, c in e.terms), np.zeros(1))
        case "prod":
            size, bound = np.ones(1), np.zeros(1)
            for base, p in e.terms:
                own = np.abs(np.power(values[base], p))
                more = _of_power(values[base], bounds[base], p)
                size, bound = size * own, bound * (own + more) + size * more
            return bound
        case "pow":
            base, exponent = e.args
            log = np.log(values[base])
            more = _of_log(values[base], bounds[base])
            total = (np.abs(values[exponent]) + bounds[exponent]) * more + bounds[
                exponent
            ] * np.abs(log)
            return np.exp(values[exponent] * log + total) * -np.expm1(-total)
        case _:
            row = FUNCTIONS[e.op]
            return row.deviation_rule(row, values[e.args[0]], bounds[e.args[0]])


def _of_power(a: Array, b: Array, p: float) -> Array:
    """(a + δ)^p − a^p for |δ| ≤ b."""
    if p > 0.0 and float(p).is_integer():
        # (|a| + b)ᵖ − |a|ᵖ, without cancellation for small b.
        size = np.abs(a) ** p
        share = b / np.abs(a)
        return np.where(
            share < 1.0, size * np.expm1(p * np.log1p(share)), (np.abs(a) + b) ** p - size
        )
    whole = float(p).is_integer()
    # Analytic only in a disc that does not contain 0, where the power has a pole or a branch point.
    # The series of (1 − x)^(−|p|) majorises that of (1 + x)ᵖ.
    inside = (b < np.abs(a)) & ((a > 0.0) | whole)
    return np.where(inside, np.abs(a) ** p * np.expm1(-abs(p) * np.log1p(-b / np.abs(a))), np.inf)


def _of_log(a: Array, b: Array) -> Array:
    return np.where(b < a, -np.log1p(-b / a), np.inf)


# -- functions of the table: f(a + δ) − f(a) for |δ| ≤ b -------------------------------------------


def by_mean_value(row: Function, a: Array, b: Array) -> Array:
    """For any function: b times a bound of its derivative."""
    slope = row.shown_slope
    nodes = list(ex.walk([slope]))
    kinks = {e.args[0]: np.zeros(len(a), bool) for e in nodes if e.op == "select"}
    values, bounds = _deviations(nodes, ARGUMENT, a, b, kinks)
    return b * (np.abs(values[slope]) + bounds[slope])


def of_exp(row: Function, a: Array, b: Array) -> Array:
    """For the exponential function, which may underflow at a and be large at a + b."""
    return np.exp(a + b) * -np.expm1(-b)


def of_log(row: Function, a: Array, b: Array) -> Array:
    """For the logarithm."""
    return _of_log(a, b)


def by_addition(row: Function, a: Array, b: Array) -> Array:
    """For (hyperbolic) sines and cosines, by addition theorems with the bounds sinh b and cosh
    b."""
    value, slope = evaluator([ex.call(row.name, ex.sym(ARGUMENT)), row.slope], [ARGUMENT])(a[None])
    odd = np.sinh(b)
    even = 2.0 * np.sinh(0.5 * b) ** 2  # cosh b − 1 without cancellation
    return np.abs(slope) * odd + np.abs(value) * even


def of_tan(row: Function, a: Array, b: Array) -> Array:
    """For the tangent: sin δ / (cos a cos(a + δ))."""
    odd = np.sinh(b)
    even = 2.0 * np.sinh(0.5 * b) ** 2
    c = np.abs(np.cos(a))
    # |cos(a + δ)| is at least this; the tangent has a pole where it vanishes.
    room = c - (np.abs(np.sin(a)) * odd + c * even)
    return np.where(room > 0.0, odd / (c * room), np.inf)


def of_tanh(row: Function, a: Array, b: Array) -> Array:
    """For the hyperbolic tangent, in terms of q = exp(−2|a|), which is accurate for large |a|."""
    q = np.exp(-2.0 * np.abs(a))
    moved = np.exp(2.0 * (b - np.abs(a))) * -np.expm1(-2.0 * b)
    return np.where(moved < 1.0 + q, 2.0 * moved / ((1.0 + q) * (1.0 + q - moved)), np.inf)


def of_singular_at_i(row: Function, a: Array, b: Array) -> Array:
    """For asinh and atan, which are singular at ±i: |f′| is at most the reciprocal of the
    distance."""
    # ∫ ds/(far − s) along δ bounds the change.
    far = np.hypot(1.0, a)
    return np.where(b < far, -np.log1p(-b / far), np.inf)
