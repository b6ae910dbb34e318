"""Minima of functions of one variable that are known to lie between two arguments."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stickslip.arrays import Array

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
_STEPS = 64  # number of iterations from the distance of two samples to machine precision


def golden_section(f: Callable[[Array], Array], low: Array, high: Array) -> tuple[Array, Array]:
    """Minima of functions between two arguments each, all of them together.

    Parameters
    ----------
    f : callable
        Takes arguments of shape (k,), returns the k values.
    low, high : ndarray of shape (k,)

    Returns
    -------
    values, arguments : ndarray of shape (k,)
    """
    left = high - GOLDEN * (high - low)
    right = low + GOLDEN * (high - low)
    at_left, at_right = f(left), f(right)
    for _ in range(_STEPS):
        down = at_left <= at_right
        low, high = np.where(down, low, left), np.where(down, right, high)
        kept, at_kept = np.where(down, left, right), np.where(down, at_left, at_right)
        new = np.where(down, high - GOLDEN * (high - low), low + GOLDEN * (high - low))
        at_new = f(new)
        left, right = np.where(down, new, kept), np.where(down, kept, new)
        at_left, at_right = np.where(down, at_new, at_kept), np.where(down, at_kept, at_new)
    first = at_left <= at_right
    return np.where(first, at_left, at_right), np.where(first, left, right)
