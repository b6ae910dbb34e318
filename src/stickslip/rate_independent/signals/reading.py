"""Reading of loads, thresholds, radii and matrices in all accepted forms."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

import numpy as np

from stickslip.errors import DeclarationError
from stickslip.model.entries.samples import Samples
from stickslip.rate_independent.signals.formulas import Constant, Formulas
from stickslip.rate_independent.signals.function import CallableSignal
from stickslip.rate_independent.signals.samples import (
    LinearTable,
    MeasuredSignal,
    MonotoneTable,
    SignalColumns,
)
from stickslip.rate_independent.signals.signal import OF_PHASE, Signal, Variable, fitting
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Scope

INTERPOLATIONS: dict[str, type[LinearTable]] = {"linear": LinearTable, "monotone": MonotoneTable}
"""Interpolation of samples: piecewise linear, or monotone cubics (PCHIP)."""


def read(
    given: Any,
    where: str,
    clock: Variable,
    shape: tuple[int, ...] | None = None,
    interpolation: str = "linear",
) -> Signal:
    """The given signal as a function of its argument.

    Parameters
    ----------
    given : number, formula, array or nested lists of these, callable, Samples, or (times, values)
        Formulas are texts or expressions in the name of the clock; a callable takes a number and
        returns an array; samples are understood where the shape is known.
    where : str
        Name in error messages.
    clock : Clock
        ``OF_TIME`` or ``OF_PHASE``.
    shape : tuple of int, optional
        Of one value, up to axes of length 1. By default as it is.
    interpolation : {"linear", "monotone"}
        What samples mean between them.

    Returns
    -------
    Signal
        The same one, if it is one already.

    Raises
    ------
    DeclarationError
        If it is none of these, has another shape, or is not finite.
    """
    if isinstance(given, Signal):
        return given
    if isinstance(given, Samples) and math.prod(shape or ()) == 1:
        return MeasuredSignal(given, where, clock, shape or ())
    several = given if isinstance(given, list | tuple) else ()
    if any(isinstance(part, Samples | Signal) for part in several):
        entries = fitting(np.empty(len(several)), shape or (len(several),), where)
        names = [f"{where}[{i}]" for i in range(len(several))]
        parts = [read(part, name, clock, ()) for part, name in zip(several, names, strict=True)]
        return SignalColumns(parts, where, clock, entries.shape)
    if callable(given):
        return CallableSignal(given, where, clock, shape)
    if shape is not None and is_table(given):
        times, values = given
        return INTERPOLATIONS[interpolation](times, values, where, clock, shape)
    return _array(given, where, clock, shape)


def read_phase(given: Any, where: str, closes: bool = True) -> Signal:
    """The given signal as a function of the phase, checked at sampled phases.

    Parameters
    ----------
    where : str
        Name in error messages.
    closes : bool
        Whether to refuse functions that do not return to the same array after one period.

    Raises
    ------
    DeclarationError
        If it is none of these, not finite, or not 1-periodic.
    """
    signal = read(given, where, OF_PHASE)
    signal.scale = max(float(np.abs(signal.at(s)).max(initial=0.0)) for s in signal.looks)
    if closes:
        signal.check_period()
    return signal


def is_table(given: Any) -> bool:
    """Return whether it is a pair (times, values)."""
    return isinstance(given, tuple) and len(given) == 2 and np.ndim(given[0]) == 1


def _array(given: Any, where: str, clock: Variable, shape: tuple[int, ...] | None) -> Signal:
    """Numbers and formulas."""
    try:
        entries = np.asarray(given)
        if entries.dtype.kind not in "iuf":
            entries = np.asarray(given, dtype=object)
    except ValueError:  # nested lists of different lengths
        entries = np.empty(0)
    if not entries.size or not (
        entries.dtype != object or all(isinstance(e, str | Real | Expr) for e in entries.flat)
    ):
        raise DeclarationError(
            where,
            f"a {type(given).__name__} is not an array of numbers, a function of {clock.name} or "
            "a formula",
            f"Give an array, a function {clock.name} -> array, or formulas such as "
            f"'2 + cos(2*pi*{clock.name})'",
        )
    names = [where + "".join(f"[{i}]" for i in position) for position in np.ndindex(entries.shape)]
    if shape is not None:
        entries = fitting(entries, shape, where)
    if entries.dtype != object:
        return Constant(entries.astype(float), where, clock)
    scope = Scope({clock.name: ex.sym(clock.name)})
    expressions = [
        scope.parse(entry, name) for entry, name in zip(entries.flat, names, strict=True)
    ]
    if any(e.symbols for e in expressions):
        return Formulas(expressions, entries.shape, where, clock)
    values = np.array([ex.number(e) for e in expressions]).reshape(entries.shape)
    return Constant(values, where, clock)
