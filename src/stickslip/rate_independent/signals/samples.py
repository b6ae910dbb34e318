"""Signals given by samples, with interpolation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.model.entries.samples import Samples
from stickslip.rate_independent.signals import chebyshev as ch
from stickslip.rate_independent.signals.panels import Panels
from stickslip.rate_independent.signals.signal import Signal, Variable, finite, fitting
from stickslip.symbolic.boxes import Chord


class LinearTable(Signal):
    """A table with linear interpolation.

    Parameters
    ----------
    times : array, shape (m,)
    values : array, shape (m, ...)
    shape : tuple of int
        Of one value.

    Raises
    ------
    DeclarationError
        If they are no numbers, do not fit each other or the shape, a number is not finite, or the
        times do not increase.
    """

    bounded = True

    def __init__(
        self, times: Any, values: Any, where: str, clock: Variable, shape: tuple[int, ...]
    ) -> None:
        self.where = where
        self.clock = clock
        self.shape = shape
        t = finite(as_numbers(times, f"{where}, times").copy(), f"{where}, times")
        y = as_numbers(values, f"{where}, values").copy()
        if t.ndim != 1 or y.ndim == 0 or len(t) != len(y) or len(t) < 2:
            raise DeclarationError(
                where,
                f"{t.size} times and {len(y) if y.ndim else 1} values",
                "Give the same number of times and values, at least 2",
            )
        if not np.all(t[1:] > t[:-1]):
            k = int(np.argmin(t[1:] > t[:-1])) + 1
            raise DeclarationError(
                where,
                f"the times do not increase: {t[k - 1]:.9g}, then {t[k]:.9g} at index {k}",
                "Sort the times, without repetition",
            )
        self.times = t
        self.rows: Array = fitting(y, (len(t), *shape), f"{where}, values")
        if not np.isfinite(self.rows).all():
            k = int(np.argmin(np.isfinite(self.rows.reshape(len(t), -1)).all(axis=1)))
            finite(self.rows[k], where, clock.place(float(t[k])))

    @property
    def span(self) -> tuple[float, float]:  # type: ignore[override]
        """Span from the first to the last sample."""
        return float(self.times[0]), float(self.times[-1])

    @property
    def knots(self) -> Array:  # type: ignore[override]
        """The samples in between."""
        return self.times[1:-1]

    def raw(self, u: float) -> Array:
        return self.unwrapped(np.array([u]))[0]

    def unwrapped(self, places: Array) -> Array:
        times = self.times
        left = np.clip(np.searchsorted(times, places, side="right") - 1, 0, len(times) - 2)
        share = (places - times[left]) / (times[left + 1] - times[left])
        share = share.reshape(len(places), *(1 for _ in self.shape))
        return (1.0 - share) * self.rows[left] + share * self.rows[left + 1]

    def entries(self, index: NDArray[np.intp], places: Array) -> Array:
        return self.unwrapped(places).reshape(len(places), -1)[np.arange(len(places)), index]

    def chord(self, low: Array, high: Array) -> Chord:
        start, end = self.unwrapped(low), self.unwrapped(high)
        return Chord(start, end, np.zeros(start.shape))

    def panels(self, span: tuple[float, float], period: float | None = None) -> Panels:
        t = self.times
        start, end = span if period is None else (0.0, 1.0)
        if period is not None and self.span != (0.0, 1.0):
            raise DeclarationError(
                self.where,
                f"the samples cover {t[0]:.9g} ... {t[-1]:.9g}, but one period of the phase s = "
                "t/epsilon is 0 ... 1",
                "Give samples from s = 0 to s = 1",
            )
        self.check_span(start, end)
        first = np.searchsorted(t, start, side="right") - 1
        last = np.searchsorted(t, end, side="left")
        noise = 4.0 * ch.EPS * float(np.max(np.abs(self.rows)))
        c = self._coefficients()[:, first:last]
        return Panels(t[first : last + 1], c, noise, self._of_arrays, period)

    def plain(self) -> dict[str, list[float]]:
        return {"times": self.times.tolist(), "values": self.rows.ravel().tolist()}

    def _of_arrays(self, u: Array) -> Array:
        return self.unwrapped(np.ravel(u)).reshape(np.shape(u))

    def _coefficients(self) -> Array:
        """Chebyshev coefficients on each interval, shape (2, m − 1), of a single value."""
        y = self.rows.ravel()
        return np.stack([0.5 * (y[:-1] + y[1:]), 0.5 * np.diff(y)])


class MonotoneTable(LinearTable):
    """A table with monotone cubic interpolation (PCHIP)."""

    @cached_property
    def _cubic(self) -> Any:
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self.times, self.rows)

    def unwrapped(self, places: Array) -> Array:
        return self._cubic(places)

    def chord(self, low: Array, high: Array) -> Chord:
        # The second derivative of a cubic is largest at an end.
        start, end = self.unwrapped(low), self.unwrapped(high)
        bend = np.maximum(np.abs(self._cubic(low, 2)), np.abs(self._cubic(high, 2)))
        width = (high - low).reshape(len(low), *(1 for _ in self.shape))
        return Chord(start, end, 0.125 * width**2 * bend)

    def _coefficients(self) -> Array:
        y, t = self.rows.ravel(), self.times
        mean = 0.5 * (y[:-1] + y[1:])
        rise = 0.5 * np.diff(y)
        slope = self._cubic(t, 1).ravel()
        half = 0.5 * np.diff(t)
        start, end = half * slope[:-1], half * slope[1:]
        c2 = (end - start) / 8.0
        c3 = (0.5 * (start + end) - rise) / 8.0
        return np.stack([mean - c2, rise - c3, c2, c3])


class MeasuredSignal(Signal):
    """Samples with a declared interpolation (:class:`stickslip.Samples`).

    Parameters
    ----------
    shape : tuple of int
        Of one value: axes of length 1, or none.
    """

    bounded = True

    def __init__(
        self, samples: Samples, where: str, clock: Variable, shape: tuple[int, ...] = ()
    ) -> None:
        if clock.periodic:
            raise DeclarationError(
                where,
                f"it is a function of the phase {clock.name}, but samples are functions of time",
                f"Give a table of {clock.name}: (points, values)",
            )
        self.samples = samples
        self.where = where
        self.clock = clock
        self.shape = shape

    @property
    def span(self) -> tuple[float, float]:  # type: ignore[override]
        """Span of the samples, or all times if they are periodic."""
        return (-np.inf, np.inf) if self.samples.periodic else self.samples.span

    def raw(self, u: float) -> Array:
        return self.unwrapped(np.array([u]))[0]

    @property
    def knots(self) -> Array:  # type: ignore[override]
        """The samples in between."""
        return self.samples.times[1:-1] if not self.samples.periodic else np.empty(0)

    def unwrapped(self, places: Array) -> Array:
        return np.asarray(self.samples(places)).reshape(len(places), *self.shape)

    def entries(self, index: NDArray[np.intp], places: Array) -> Array:
        return np.asarray(self.samples(places))

    def chord(self, low: Array, high: Array) -> Chord:
        start, end = self.unwrapped(low), self.unwrapped(high)
        if self.samples.kind == "linear" and not self.samples.periodic:
            return Chord(start, end, np.zeros(start.shape))
        # Distance from the chord: for a spline an eighth of the squared length times the second
        # derivative, for lines a quarter of the length times the change of slope, and for steps
        # their change.
        order = {"cubic": 2, "linear": 1, "hold": 0}[self.samples.kind]
        least, most = self.samples.pieces.bounds((low, high), "even", order)
        length = high - low
        off = [
            most - least,
            0.25 * length * (most - least),
            0.125 * length**2 * np.maximum(np.abs(least), np.abs(most)),
        ][order]
        return Chord(start, end, off.reshape(start.shape))

    def panels(self, span: tuple[float, float], period: float | None = None) -> Panels:
        self.check_span(*span)
        pieces = self.samples.pieces
        b, c = pieces.breaks, pieces.coefficients
        first = np.zeros(1)
        if self.samples.periodic:
            turns = (np.asarray(span) - b[0]) / pieces.period
            first = np.arange(math.floor(turns[0]), math.ceil(turns[1])) * pieces.period
        breaks = np.append(np.ravel(first[:, None] + b[:-1]), first[-1] + b[-1])
        chebyshev = self._chebyshev(np.diff(b), c)
        noise = 4.0 * ch.EPS * float(np.max(np.abs(self.samples.values)))
        return Panels(breaks, np.tile(chebyshev, len(first)), noise, self._of_arrays, None)

    def _of_arrays(self, u: Array) -> Array:
        return np.asarray(self.samples(u))

    @staticmethod
    def _chebyshev(length: Array, c: Array) -> Array:
        """Chebyshev coefficients of the pieces, shape (d + 1, pieces)."""
        from numpy.polynomial import chebyshev as cheb

        degree = c.shape[1] - 1
        half = [1.0, 1.0]  # (1 + x), whose multiples by half the length the places are
        found = np.zeros((degree + 1, len(c)))
        for k in range(degree + 1):
            basis = cheb.poly2cheb(np.polynomial.polynomial.polypow(half, k))
            found[: k + 1] += np.outer(basis, c[:, k] * (0.5 * length) ** k)
        return found

    def plain(self) -> dict[str, Any]:
        return {"samples": self.samples.plain()}


class SignalColumns(Signal):
    """An array whose entries are separate signals.

    Parameters
    ----------
    parts : list of Signal
        Of single values.
    shape : tuple of int
    """

    def __init__(
        self, parts: list[Signal], where: str, clock: Variable, shape: tuple[int, ...]
    ) -> None:
        self.parts = parts
        self.where = where
        self.clock = clock
        self.shape = shape
        self.bounded = all(part.bounded for part in parts)

    @property
    def span(self) -> tuple[float, float]:  # type: ignore[override]
        """Domain in which all of them are defined."""
        starts, ends = zip(*(part.span for part in self.parts), strict=True)
        return max(starts), min(ends)

    @property
    def knots(self) -> Array:  # type: ignore[override]
        """The knots of all of them."""
        return np.unique(np.concatenate([part.knots for part in self.parts]))

    def raw(self, u: float) -> Array:
        return self.unwrapped(np.array([u]))[0]

    def unwrapped(self, places: Array) -> Array:
        columns = [part.unwrapped(places).ravel() for part in self.parts]
        return np.stack(columns, axis=1).reshape(len(places), *self.shape)

    def entries(self, index: NDArray[np.intp], places: Array) -> Array:
        return self.unwrapped(places).reshape(len(places), -1)[np.arange(len(places)), index]

    def chord(self, low: Array, high: Array) -> Chord:
        chords = [part.chord(low, high) for part in self.parts]
        ends = (
            np.stack([np.ravel(end) for end in group], axis=1)
            for group in zip(*chords, strict=True)
        )
        return Chord(*(end.reshape(len(low), *self.shape) for end in ends))

    def panels(self, span: tuple[float, float], period: float | None = None) -> Panels:
        (part,) = self.parts  # a single value
        return part.panels(span, period)

    def plain(self) -> Any:
        (part,) = self.parts
        return part.plain()


def as_numbers(given: Any, where: str) -> Array:
    """The array of numbers that was given.

    Raises
    ------
    DeclarationError
        If it holds anything else.
    """
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(
            where,
            f"a {type(given).__name__} is not an array of numbers",
            "Give numbers",
        ) from None
