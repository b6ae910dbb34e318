"""The load ℓ(t) of an evolution: a callable, a table of values, or formulas in t."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from stickslip.errors import DeclarationError
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.chords import Chord, deviations, table
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Scope

Array = np.ndarray
# numbers of a callable load that are remembered: refined steps ask for the same times again
CACHED = 2_000_000


@dataclass(frozen=True)
class Load:
    """ℓ at many times.

    Attributes
    ----------
    at : callable
        Times of shape (m,) → values of shape (m, n).
    chord : callable
        Starts and ends of stretches, shape (m,) each, without knots inside → values at both and
        deviations in between.
    bounded : bool
        Whether it is known at every time, and the deviations are bounds; otherwise they are
        estimated by twice that in the middle.
    knots : array
        Times at which the slope jumps (of a table).
    span : (float, float)
        Times between which the load is known.
    """

    at: Callable[[Array], Array]
    chord: Callable[[Array, Array], Chord]
    bounded: bool = False
    knots: Array = field(default_factory=lambda: np.empty(0))
    span: tuple[float, float] = (-np.inf, np.inf)


def read_load(given: Any, n: int) -> Load:
    """The load as given, in one form.

    Parameters
    ----------
    given : callable, (times, values), or formulas
        t → (n,); or arrays of shapes (m,) and (m, n), linear in between; or a list of n formulas in
        ``t`` (one formula if n = 1).
    n : int
        Number of components.

    Raises
    ------
    DeclarationError
        If it is none of these, does not fit, or a table has an entry that is not finite.
    """
    if callable(given):
        return _function(given, n)
    if isinstance(given, str | Expr):
        return _formulas([given], n)
    if isinstance(given, tuple) and len(given) == 2 and np.ndim(given[0]) == 1:
        return _table(*given, n)
    if isinstance(given, Sequence) and all(np.ndim(item) == 0 for item in given):
        return _formulas(given, n)
    raise DeclarationError(
        "load",
        f"a {type(given).__name__} is no load",
        f"Give a callable t -> ({n},), a pair (times, values), or a list of {n} formulas in t",
    )


def _function(function: Callable[[float], Any], n: int) -> Load:
    @lru_cache(maxsize=max(4, CACHED // n))
    def row(t: float) -> Array:
        try:
            value = np.array(function(t), dtype=float)
        except (TypeError, ValueError) as error:
            raise DeclarationError(
                "load", f"no value at t = {t:.9g} ({error})", f"Return {n} numbers"
            ) from None
        if value.shape != (n,) and value.size != n:
            raise DeclarationError(
                "load", f"shape {value.shape} at t = {t:.9g}, but A has {n} rows", f"Return ({n},)"
            )
        return value.reshape(n)

    def rows(times: Array) -> Array:
        return np.array([row(t) for t in times.tolist()]).reshape(len(times), n)

    def chord(low: Array, high: Array) -> Chord:
        start = rows(low)
        middle = rows(0.5 * (low + high))
        end = rows(high)
        return Chord(start, end, np.abs(2.0 * middle - start - end))

    return Load(rows, chord)


def _table(times: Any, values: Any, n: int) -> Load:
    try:
        times, values = np.array(times, dtype=float), np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise DeclarationError(
            "load", "the table holds something that is no number", "Give arrays of numbers"
        ) from None
    if values.ndim == 1 and n == 1:
        values = values[:, None]
    if len(times) < 2 or values.shape != (len(times), n):
        raise DeclarationError(
            "load",
            f"{len(times)} times and values of shape {values.shape} do not fit",
            f"Give at least 2 times and values of shape (times, {n})",
        )
    if not (np.all(np.isfinite(times)) and np.all(np.diff(times) > 0.0)):
        raise DeclarationError(
            "load", "the times do not increase", "Sort them, each once, all finite"
        )
    check_finite(times, values)

    def rows(at: Array) -> Array:
        left = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
        share = ((at - times[left]) / (times[left + 1] - times[left]))[:, None]
        return (1.0 - share) * values[left] + share * values[left + 1]

    def chord(low: Array, high: Array) -> Chord:
        return Chord(rows(low), rows(high), np.zeros((len(low), n)))

    return Load(rows, chord, True, times[1:-1], (float(times[0]), float(times[-1])))


def _formulas(given: Sequence[Any], n: int) -> Load:
    if len(given) != n:
        raise DeclarationError(
            "load", f"{len(given)} formulas for {n} components", f"Give a list of {n} formulas in t"
        )
    scope = Scope({"t": ex.sym("t")})
    expressions = [scope.parse(text, f"load[{i}]") for i, text in enumerate(given)]

    def rows(times: Array) -> Array:
        return table(expressions, times)

    def chord(low: Array, high: Array) -> Chord:
        start, end = rows(low), rows(high)
        return Chord(start, end, deviations(expressions, "t", low, high, start, end))

    return Load(rows, chord, True)


def check_finite(times: Array, rows: Array) -> None:
    """Refuse a load that is not finite; names the first time and component."""
    bad = np.argwhere(~np.isfinite(rows))
    if len(bad):
        k, i = map(int, bad[0])
        raise DeclarationError(
            f"load[{i}]",
            f"{rows[k, i]} at t = {times[k]:.9g}",
            "Every value of the load must be finite",
        )
