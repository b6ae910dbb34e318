"""Functions of one variable as polynomials on panels: fitted, restricted, and every change of sign
found.

Coefficients are those of Chebyshev polynomials in x ∈ [−1, 1], one column per panel: shape (degree
+ 1, panels).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebval, chebvander

from stickslip.arrays import Array, Array3, IntVector, Matrix, Vector, plain_array
from stickslip.machine_code.functions import entry_point
from stickslip.numerics.levels import ROUNDING
from stickslip.translator import compiled

Growth = Callable[[Array, Array, Array], Array]

_DEGREE = 16
EPS = float(np.finfo(float).eps)
"""Largest error of a fit, relative to the largest value: what evaluation may leave."""
_COARSEST = 1e-9
"""Largest relative error that rounding of the places may excuse: beyond it a function of unknown
growth has a jump."""
_FIRST_PANELS = 4
MOST_PANELS = 2**18  # largest number of panels of a fit
# width of a panel relative to the interval below which a function is regarded as discontinuous
_NARROWEST = 2.0**-50
# width of a panel that only a corner requires, if few of its neighbours are as narrow
_DEEP = 2.0**-12
_SAME = 2.0**-40  # distance of two corners relative to the interval below which they are one
_CLUSTER = 250  # largest number of panels that gather around one corner
_PASSES = 6
_MOST_HALVINGS = 52  # largest number of halvings of a panel in the search for zeros
_SMALLEST_HALF = 2.0**-_MOST_HALVINGS  # half the width of the remaining interval then
# Columns of ZeroSearch.place.
_MIDDLE, _HALF, _BEGIN, _END = range(4)
# radii of discs around panels, in units of half their width, that may show what a fit can miss
_REACHES = (8.0, 4.0)
# Number of halvings towards an end at which a fit is checked, while corners are known roughly, and
# afterwards.
_SEARCH = 30
_FINAL = 42


@cache
def nodes(m: int) -> Array:
    """The m Chebyshev points, ascending; none is an end, so a panel never sees the other side of a
    jump."""
    return -np.cos(np.pi * (np.arange(m) + 0.5) / m)


@cache
def transform(m: int) -> Array:
    """Values at the m Chebyshev points -> coefficients, shape (m, m)."""
    k = np.arange(m)
    # T_k(−cos θ) = (−1)^k cos kθ: evaluated by its recurrence it would lose two digits.
    matrix = (
        2.0
        / m
        * (-1.0) ** k[:, None]
        * np.cos(np.pi / (2 * m) * (k[:, None] * (2 * k + 1) % (4 * m)))
    )
    matrix[0] /= 2.0
    return matrix


@cache
def _halves(m: int) -> Array:
    """Coefficients on [−1, 1] -> coefficients on [−1, 0] and on [0, 1], shape (2, m, m)."""
    return np.stack(
        [transform(m) @ chebvander((nodes(m) + shift) / 2.0, m - 1) for shift in (-1.0, 1.0)]
    )


@cache
def _checks(closest: int) -> tuple[Array, Array]:
    """Points at which a fit is compared with its function, and the values of the polynomials there.

    Next to the ends they come as close as 2^−closest, or a corner could hide between an end and the
    first point.
    """
    even = (0.5 + np.arange(2 * _DEGREE)) * 0.6180339887498949 % 1.0 * 2.0 - 1.0
    near_end = 1.0 - 2.0 ** -np.arange(6.0, closest + 1.0, 4.0)
    points = np.concatenate([even, near_end, -near_end])
    return points, chebvander(points, _DEGREE)


def values(c: Array, x: Array) -> Array:
    """Polynomial of each column at the same column of x, shape (..., panels)."""
    return chebval(x, c, tensor=False)


def derivatives(c: Array) -> Array:
    """Coefficients of the derivative with respect to x."""
    return chebder(c, axis=0) if len(c) > 1 else np.zeros_like(c)


def restrict(c: Array, start: Array, end: Array) -> Array:
    """The polynomials on subintervals [start, end] of [−1, 1], in their own coordinate from −1 to
    1."""
    m = len(c)
    out = np.empty(c.shape)
    _restrict(
        plain_array(c.T),
        plain_array(start),
        plain_array(end),
        nodes(m),
        transform(m),
        np.empty(m),
        out,
    )
    return out


@entry_point()
def _restrict(
    c: Matrix,
    start: Vector,
    end: Vector,
    nodes: Vector,
    transform: Matrix,
    sampled: Vector,
    out: Matrix,
) -> None:
    """Restrict polynomials.

    Parameters
    ----------
    c : array, shape (panels, m)
        Their coefficients, one row per panel.
    start, end : array, shape (panels,)
    nodes, transform : array, shapes (m,), (m, m)
        See the functions of these names.
    sampled : array, shape (m,)
        Work space.
    out : array, shape (m, panels)
        Written.
    """
    m = len(nodes)
    for p in range(len(c)):
        for j in range(m):
            x = 0.5 * (start[p] + end[p]) + 0.5 * (end[p] - start[p]) * nodes[j]
            sampled[j] = _value(c[p], x)
        for k in range(m):
            total = 0.0
            for j in range(m):
                total += transform[k, j] * sampled[j]
            out[k, p] = total


@compiled()
def _value(c: Vector, x: float) -> float:
    """Value (Clenshaw)."""
    value, _ = _value_and_slope(c, x)
    return value


@compiled()
def _value_and_slope(c: Vector, x: float) -> tuple[float, float]:
    """Value and derivative (Clenshaw)."""
    value = 0.0
    before = 0.0
    slope = 0.0
    slope_before = 0.0
    for k in range(len(c) - 1, 0, -1):
        next_slope = 2.0 * value + 2.0 * x * slope - slope_before
        slope_before = slope
        slope = next_slope
        next_value = c[k] + 2.0 * x * value - before
        before = value
        value = next_value
    return c[0] + x * value - before, value + x * slope - slope_before


class Unresolved(Exception):
    """A function needs too many panels; the argument is a place that does."""


def fit_pieces(
    function: Callable[[Array], Array],
    edges: Array,
    most: int = MOST_PANELS,
    growth: Growth | None = None,
) -> tuple[Array, Array, float]:
    """A function as polynomials of degree at most 16, to rounding.

    Panels are halved until the polynomial agrees with the function at 50 other points and, if its
    growth is known, can be off by no more anywhere. Where the function has a corner or a jump,
    panels gather; that place becomes an edge, and the fit is made again.

    Parameters
    ----------
    function : callable
        Array of places -> array of values, all finite.
    edges : array
        First and last place, and the corners and jumps that are known.
    most : int
        Most panels that are tried.
    growth : callable, optional
        Starts and ends of intervals and radii -> bounds of how far the function can be from its
        value in the middle of each interval, on the disc of that radius in the complex plane.

    Returns
    -------
    breaks : array, shape (panels + 1,)
    coefficients : array, shape (m, panels)
    noise : float
        Largest difference from the function that was seen, and rounding.

    Raises
    ------
    Unresolved
        If more panels are needed.

    Notes
    -----
    Without `growth`, features between two samples are missed: for example a spike narrower than
    1/200 of the span, away from any known corner.
    """
    known = edges
    whole = edges[-1] - edges[0]
    place = EPS * np.max(np.abs(edges))
    same = max(_SAME * whole, 1024.0 * place)
    for _ in range(_PASSES):
        breaks, c, _ = _halve_until_resolved(function, edges, most, _SEARCH, growth)
        corners = _corners(breaks)
        corners = corners[np.min(np.abs(corners[:, None] - edges), axis=1, initial=np.inf) > same]
        if not len(corners):
            if len(edges) > len(known):
                edges = np.union1d(
                    known, _refined_corners(function, np.setdiff1d(edges, known), same, breaks, c)
                )
            break
        edges = np.union1d(edges, corners)
    closest = min(_FINAL, int(np.log2(whole / (256.0 * place))))
    breaks, c, noise = _halve_until_resolved(function, edges, most, closest, growth)
    size = np.max(np.abs(c), axis=1)
    used = np.flatnonzero(size > EPS * np.max(size))
    return breaks, c[: used[-1] + 1 if len(used) else 1], noise


def _halve_until_resolved(
    function: Callable[[Array], Array], edges: Array, most: int, closest: int, growth: Growth | None
) -> tuple[Array, Array, float]:
    points, at_points = _checks(closest)
    start, end = _first_panels(edges)
    whole = edges[-1] - edges[0]
    scale = 0.0
    noise = 0.0
    total = 0
    done: list[tuple[Array, Array]] = []
    while len(start):
        total += len(start)
        if total > most:
            raise Unresolved(float(start[0]))
        middle = 0.5 * (start + end)
        half = 0.5 * (end - start)
        sampled = function(middle + half * nodes(_DEGREE + 1)[:, None])
        c = transform(_DEGREE + 1) @ sampled
        scale = max(scale, float(np.max(np.abs(sampled))))
        # Arguments are rounded, so the error of a steep function is slope times rounding; a
        # function that grows without bound on every disc has a jump.
        steepness = np.sum(np.abs(derivatives(c)), axis=0) / half
        blur = 4.0 * EPS * np.maximum(np.abs(start), np.abs(end)) * steepness
        tolerance = ROUNDING * scale + (
            np.minimum(blur, _COARSEST * scale) if growth is None else blur
        )
        off = np.max(np.abs(at_points @ c - function(middle + half * points[:, None])), axis=0)
        off = np.maximum(off, np.abs(c[-1]) + np.abs(c[-2]))
        resolved = off <= tolerance
        if growth is not None and resolved.any():
            resolved[resolved] = _missed(growth, start[resolved], end[resolved]) <= ROUNDING * scale
        noise = max(noise, float(np.max(off[resolved], initial=0.0)))
        resolved |= end - start <= np.maximum(_NARROWEST * whole, 8.0 * np.spacing(np.abs(middle)))
        done.append((start[resolved], c[:, resolved]))
        start = start[~resolved]
        middle = middle[~resolved]
        end = end[~resolved]
        start, end = np.concatenate([start, middle]), np.concatenate([middle, end])
    starts = np.concatenate([s for s, _ in done])
    c = np.concatenate([c for _, c in done], axis=1)
    order = np.argsort(starts)
    return np.append(starts[order], edges[-1]), c[:, order], noise + 4.0 * EPS * scale


def _missed(growth: Growth, start: Array, end: Array) -> Array:
    """Error bound of a polynomial that interpolates a function at Chebyshev points, on each panel.

    With |f| ≤ B in the ellipse with foci ±1 and the sum ρ of its half axes, that is 4 B ρ^−n/(ρ −
    1) for the degree n (L. N. Trefethen, *Approximation Theory and Approximation Practice*, SIAM
    (2013), theorem 8.2).
    """
    least = np.full(len(start), np.inf)
    for reach in _REACHES:
        rho = reach + np.sqrt(reach**2 - 1.0)
        bound = growth(start, end, 0.5 * reach * (end - start))
        least = np.minimum(least, 4.0 * rho**-_DEGREE / (rho - 1.0) * bound)
    return least


def _first_panels(edges: Array) -> tuple[Array, Array]:
    even = np.linspace(edges[0], edges[-1], _FIRST_PANELS + 1)
    # An even edge that nearly coincides with a given one would make a sliver.
    apart = np.min(np.abs(even[:, None] - edges), axis=1) > 1e-3 * (edges[-1] - edges[0])
    edges = np.union1d(edges, even[apart])
    return edges[:-1], edges[1:]


def _corners(breaks: Array) -> Array:
    """Places around which panels gather: the narrowest panel of each small cluster of narrow
    ones."""
    widths = np.diff(breaks)
    narrow = np.concatenate([[False], widths < _DEEP * (breaks[-1] - breaks[0]), [False]])
    runs = np.flatnonzero(narrow[1:] != narrow[:-1]).reshape(-1, 2)
    found = [
        first + np.argmin(widths[first:last]) for first, last in runs if last - first <= _CLUSTER
    ]
    return np.array([0.5 * (breaks[i] + breaks[i + 1]) for i in found])


def _refined_corners(
    function: Callable[[Array], Array], corners: Array, reach: float, breaks: Array, c: Array
) -> Array:
    """Corners refined: each is moved to the place where the function changes from the polynomial of
    one side to that of the other."""
    i = np.searchsorted(breaks, corners)
    start = breaks[:-1]
    width = np.diff(breaks)
    clear = np.minimum(width[i - 1], width[i]) > _DEEP * (breaks[-1] - breaks[0])
    i = i[clear]
    low = breaks[i] - reach
    high = breaks[i] + reach
    for _ in range(16):
        middle = 0.5 * (low + high)
        value = function(middle)
        off = (
            np.abs(values(c[:, j], 2.0 * (middle - start[j]) / width[j] - 1.0) - value)
            for j in (i - 1, i)
        )
        before = next(off) <= next(off)
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return np.concatenate([corners[~clear], 0.5 * (low + high)])


def sign_changes(c: Array, negligible: float) -> tuple[Array, Array]:
    """Every change of sign inside [−1, 1], of each polynomial.

    Intervals are halved until the polynomial has no zero there (its constant coefficient outweighs
    the others), is monotone (its linear one outweighs the others, |T_k′| ≤ k²), or its integral
    there is negligible: a pair of zeros, however close, is not missed, unless the values between
    them are rounding errors.

    Parameters
    ----------
    c : array, shape (m, panels)
    negligible : float
        Integral over x that does not count.

    Returns
    -------
    panel : array of int, shape (changes,)
    x : array, shape (changes,)
        In order.
    """
    m, count = c.shape
    panel = np.empty(m * count, np.int64)
    x = np.empty(m * count)
    found = (
        _sign_changes(plain_array(c.T), _halves(m), negligible, _zero_search(m), panel, x)
        if m > 1
        else 0
    )
    return panel[:found].copy(), x[:found].copy()


class ZeroSearch(NamedTuple):
    """Work space of a search for changes of sign: a stack of intervals.

    Attributes
    ----------
    stack : array, shape (depth, m)
        Polynomials.
    place : array, shape (depth, 4)
        MIDDLE and HALF the width of their intervals, and the values where these BEGIN and END:
        neighbours share them, so that no change of sign falls between two.
    whole : array, shape (m,)
        The polynomial that is being halved.
    """

    stack: Matrix
    place: Matrix
    whole: Vector


def _zero_search(m: int) -> ZeroSearch:
    """Work space for polynomials with m coefficients."""
    depth = _MOST_HALVINGS + 2
    return ZeroSearch(np.empty((depth, m)), np.empty((depth, 4)), np.empty(m))


@entry_point()
def _sign_changes(
    c: Matrix, halves: Array3, negligible: float, search: ZeroSearch, panel: IntVector, x: Vector
) -> int:
    """Find the changes of sign.

    Parameters
    ----------
    c : array, shape (panels, m)
        Coefficients, one row per panel.
    halves : array, shape (2, m, m)
        See the function of this name.
    panel, x : array, shape (m panels,)
        Written.

    Returns
    -------
    int
        How many there are.
    """
    m = c.shape[1]
    stack = search.stack
    place = search.place
    found = 0
    for p in range(len(c)):
        for k in range(m):
            stack[0, k] = c[p, k]
        _put(place, 0, 0.0, 1.0, _value(stack[0], -1.0), _value(stack[0], 1.0))
        depth = 0
        while depth >= 0:
            b = stack[depth]
            half = place[depth, _HALF]
            rest = 0.0
            bend = 0.0
            for k in range(1, m):
                rest += abs(b[k])
                bend += k * k * abs(b[k]) if k > 1 else 0.0
            if abs(b[0]) > rest:
                depth -= 1
            elif (
                abs(b[1]) >= bend
                or (abs(b[0]) + rest) * half <= negligible
                or half <= _SMALLEST_HALF
            ):
                changes = (place[depth, _BEGIN] < 0.0) != (place[depth, _END] < 0.0)
                if changes and found < len(x):
                    panel[found] = p
                    x[found] = place[depth, _MIDDLE] + half * _crossing(b, -1.0, 1.0)
                    found += 1
                depth -= 1
            else:
                _halve(search, depth, halves)
                depth += 1
    return found


@compiled()
def _halve(search: ZeroSearch, depth: int, halves: Array3) -> None:
    """Put the two halves of an interval where it is on the stack: the left one, which is looked at
    first, on top."""
    stack = search.stack
    place = search.place
    whole = search.whole
    m = len(whole)
    for k in range(m):
        whole[k] = stack[depth, k]
    for side in range(2):
        for k in range(m):
            total = 0.0
            for j in range(m):
                total += halves[1 - side, k, j] * whole[j]
            stack[depth + side, k] = total
    between = _value(whole, 0.0)
    middle = place[depth, _MIDDLE]
    half = 0.5 * place[depth, _HALF]
    begin = place[depth, _BEGIN]
    _put(place, depth, middle + half, half, between, place[depth, _END])
    _put(place, depth + 1, middle - half, half, begin, between)


@compiled()
def _put(place: Matrix, row: int, middle: float, half: float, begin: float, end: float) -> None:
    """Write a row of ZeroSearch.place."""
    place[row, _MIDDLE] = middle
    place[row, _HALF] = half
    place[row, _BEGIN] = begin
    place[row, _END] = end


@compiled()
def _crossing(c: Vector, low: float, high: float) -> float:
    """The place between low and high at which a polynomial, monotone there, changes sign (Newton in
    a bracket)."""
    rising = _value(c, high) > _value(c, low)
    x = 0.5 * (low + high)
    for _ in range(100):
        value, slope = _value_and_slope(c, x)
        if value == 0.0:
            break
        if (value < 0.0) == rising:
            low = x
        else:
            high = x
        new = x - value / slope if slope != 0.0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - x) <= 2.0 * EPS:
            break
        x = new
    return x


def first_crossings(c: Array, low: Array, high: Array) -> Array:
    """The place between low and high at which each polynomial, monotone there, changes sign."""
    x = np.empty(c.shape[1])
    _crossings(plain_array(c.T), plain_array(low), plain_array(high), x)
    return x


@entry_point()
def _crossings(c: Matrix, low: Vector, high: Vector, x: Vector) -> None:
    """Write the places of :func:`first_crossings` to x (panels,); c (panels, m) has one row per
    panel."""
    for p in range(len(c)):
        x[p] = _crossing(c[p], low[p], high[p])
