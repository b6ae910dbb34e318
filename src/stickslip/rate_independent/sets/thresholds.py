"""Thresholds of friction: vectors that may depend on the phase, and cannot be negative."""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.numerics.levels import ROUNDED_SUM
from stickslip.rate_independent.signals.reading import read_phase
from stickslip.rate_independent.signals.signal import Signal, wrapped
from stickslip.symbolic.expressions import Expr


def read_weights(given: object, where: str) -> Signal:
    """Thresholds as a vector that may depend on the phase, checked to be nonnegative at a few
    phases; a single formula is read as a list of one."""
    signal = read_phase([given] if isinstance(given, str | Expr) else given, where)
    if len(signal.shape) != 1 or signal.shape[0] == 0:
        raise DeclarationError(
            where,
            f"its shape is {signal.shape}, but one threshold for each component is needed",
            "Give a vector",
        )
    for s in signal.looks:
        nonnegative(signal, s)
    return signal


def nonnegative(thresholds: Signal, s: float) -> Array:
    """Thresholds at phase s; refuses negative ones, unless they vanish up to rounding."""
    value = thresholds.at(s)
    least = value.min(initial=0.0)
    if least >= 0.0:
        return value
    if least < -ROUNDED_SUM * thresholds.scale:
        i = int(value.argmin())
        when = f" at {thresholds.clock.place(wrapped(s))}" if thresholds.varies else ""
        raise DeclarationError(
            thresholds.where,
            f"component {i} is {value[i]:.6g}{when}, but a threshold cannot be negative",
            "Write max(..., 0) around its formula",
        )
    return np.maximum(value, 0.0)


def nonnegative_over(thresholds: Signal, phases: Array) -> Array:
    """Thresholds at several phases, shape (m, n)."""
    values = thresholds.over(phases)
    for s in phases[(values < 0.0).any(axis=1)]:
        nonnegative(thresholds, float(s))
    return np.maximum(values, 0.0)


def nonnegative_rows(thresholds: Signal, phases: Array) -> Array:
    """Thresholds at several phases, one row each; a single one is not copied, since it may be
    large."""
    if len(phases) == 1:
        return nonnegative(thresholds, float(phases[0]))[None]
    rows = thresholds.over(phases)
    if rows.min() >= 0.0:
        return rows
    return np.array([nonnegative(thresholds, s) for s in phases.tolist()])
