"""Polynomials between the points of a table, and outside of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stickslip.arrays import Array


def ends_of_pieces(knots: Array, open_ends: tuple[bool, bool]) -> Array:
    """Ends of pieces, with one more on each side unless it is open."""
    pad = (knots[-1] - knots[0]) / (len(knots) - 1)
    low = [] if open_ends[0] else [knots[0] - pad]
    high = [] if open_ends[1] else [knots[-1] + pad]
    return np.concatenate([low, knots, high])


def _between(knots: Array, values: Array, kind: str) -> Array:
    """Coefficients of the pieces between knots, shape (pieces, powers, ...)."""
    length = np.diff(knots).reshape(-1, *(1,) * (values.ndim - 1))
    if kind == "linear" or len(knots) == 2:
        return np.stack([values[:-1], np.diff(values, axis=0) / length], axis=1)
    from scipy.interpolate import CubicSpline, PchipInterpolator

    found = PchipInterpolator if kind == "pchip" else CubicSpline
    return np.moveaxis(found(knots, values).c[::-1], 0, 1)


def pieces_of_curve(
    knots: Array,
    values: Array,
    kind: str,
    outside: tuple[str, str],
    open_ends: tuple[bool, bool],
) -> tuple[Array, Array]:
    """Breaks, and coefficients of all pieces, shape (pieces, powers, ...).

    Parameters
    ----------
    knots : array, shape (m,)
    values : array, shape (m, ...)
    outside : pair of {"refused", "constant", "linear"}
        What is below and above; what is refused is written as a constant.
    open_ends : (bool, bool)
        Whether there is no piece below, and above: the first and the last one go on.
    """
    c = _between(knots, values, kind)
    breaks = ends_of_pieces(knots, open_ends)
    parts = [c]
    if not open_ends[0]:
        slope = c[0, 1] if outside[0] == "linear" else 0.0 * c[0, 1]
        first = np.zeros_like(c[:1])
        first[0, 0], first[0, 1] = c[0, 0] - slope * (breaks[1] - breaks[0]), slope
        parts.insert(0, first)
    if not open_ends[1]:
        u = knots[-1] - knots[-2]
        slope = sum((k * c[-1, k] * u ** (k - 1) for k in range(1, c.shape[1])), 0.0 * c[-1, 0])
        last = np.zeros_like(c[:1])
        last[0, 0] = values[-1]
        last[0, 1] = slope if outside[1] == "linear" else 0.0 * slope
        parts.append(last)
    return breaks, np.ascontiguousarray(np.concatenate(parts))


def integrated(breaks: Array, c: Array, open_ends: tuple[bool, bool]) -> Array:
    """Coefficients of the integral, which is 0 at 0 or at the end of the points nearest to it."""
    found = np.concatenate([np.zeros((len(c), 1)), c / np.arange(1.0, c.shape[1] + 1.0)], axis=1)
    length = np.diff(breaks)
    found[1:, 0] = np.cumsum([_value(piece, u) for piece, u in zip(found, length, strict=True)])[
        :-1
    ]
    first = breaks[0] if open_ends[0] else breaks[1]
    last = breaks[-1] if open_ends[1] else breaks[-2]
    origin = min(max(0.0, float(first)), float(last))
    k = min(max(int(np.searchsorted(breaks, origin, side="right")) - 1, 0), len(c) - 1)
    found[:, 0] -= _value(found[k], origin - breaks[k])
    return np.ascontiguousarray(found)


def _value(c: Array, u: float) -> float:
    return float(np.polynomial.polynomial.polyval(u, c))


def power_series(coefficients: Sequence[Array], u: Array) -> Array:
    total = 0.0 * u
    for c in reversed(coefficients):
        total = total * u + c
    return total
