"""Thresholds of friction: vectors that may depend on the phase, and cannot be negative."""

from __future__ import annotations

import numpy as np

from stickslip.errors import DeclarationError
from stickslip.rate_independent.sets.phase import Varying, read, wrapped
from stickslip.rate_independent.sets.potential import Array
from stickslip.symbolic.expressions import Expr


def read_weights(given: object, where: str) -> Varying:
    """Thresholds as a vector that may depend on the phase, nonnegative at a few phases."""
    varying = read([given] if isinstance(given, str | Expr) else given, where)
    if len(varying.shape) != 1 or varying.shape[0] == 0:
        raise DeclarationError(
            where,
            f"it has the shape {varying.shape}, but one threshold for each component is needed",
            "Give a vector",
        )
    for s in varying.looks:
        nonnegative(varying, s)
    return varying


def nonnegative(thresholds: Varying, s: float) -> Array:
    """Thresholds at phase s; refuses negative ones, unless they vanish up to rounding."""
    value = thresholds.at(s)
    least = value.min(initial=0.0)
    if least >= 0.0:
        return value
    if least < -1e-13 * thresholds.scale:
        i = int(value.argmin())
        when = f" at phase s = {wrapped(s):g}" if thresholds.depends_on_phase else ""
        raise DeclarationError(
            thresholds.where,
            f"component {i} is {value[i]:.6g}{when}, but a threshold cannot be negative",
            "Write max(..., 0) where it may vanish",
        )
    return np.maximum(value, 0.0)


def nonnegative_over(thresholds: Varying, phases: Array) -> Array:
    """Thresholds at several phases, shape (m, n)."""
    values = thresholds.over(phases)
    for s in phases[(values < 0.0).any(axis=1)]:
        nonnegative(thresholds, float(s))
    return np.maximum(values, 0.0)
