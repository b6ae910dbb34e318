"""Smooth curves through computed points."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stickslip.arrays import Array

PIECES = 12  # number of pieces of the curve between two points


def smooth_curve(x: Array, y: Array, corners: Array) -> tuple[Array, Array]:
    """A cubic Hermite curve through points of the plane, by the length of their chords.

    Slopes are Akima's (SciPy's ``makima``), from points on the same side of a corner, so that the
    curve does not overshoot near steep parts and corners.

    Parameters
    ----------
    x, y : arrays, shape (points,)
        Along the curve, which may turn back.
    corners : array of int or bool, shape (points,)
        Not zero where the curve may have a corner.

    Returns
    -------
    x, y : arrays, shape (PIECES·(points − 1) + 1,)
        Point i is at place PIECES·i.
    """
    from scipy.interpolate import Akima1DInterpolator

    if len(x) < 2:
        return x.copy(), y.copy()
    points = np.array([x, y])
    finite = np.all(np.isfinite(points), axis=0)
    scale = np.ptp(points[:, finite], axis=1, keepdims=True) if np.any(finite) else np.ones((2, 1))
    length = np.hypot(*(np.diff(points, axis=1) / np.where(scale > 0.0, scale, 1.0)))
    # A chord of length zero or NaN ends a smooth part.
    ends = np.flatnonzero(np.asarray(corners, bool) | ~finite)
    still = np.flatnonzero(~(length > 1e-12))
    stops = np.unique(np.concatenate([[0, len(x) - 1], ends, still, still + 1]))
    part = np.arange(PIECES) / PIECES
    found = [points[:, i, None] + np.diff(points)[:, i, None] * part for i in range(len(x) - 1)]
    for first, last in pairwise(stops.tolist()):
        if last - first < 2:
            continue
        s = np.concatenate([[0.0], np.cumsum(length[first:last])])
        curve = Akima1DInterpolator(s, points[:, first : last + 1].T, method="makima")
        for i in range(first, last):
            a, b = s[i - first : i - first + 2]
            found[i] = curve(a + (b - a) * part).T
    whole = np.concatenate([*found, points[:, -1:]], axis=1)
    return whole[0], whole[1]
