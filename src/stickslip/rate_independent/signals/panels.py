"""A signal as polynomials on panels of its clock, for arrays of times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.rate_independent.signals import chebyshev as ch

Source = Callable[[Array], Array]


class Value(NamedTuple):
    """A signal and its rate at some times."""

    value: Array
    rate: Array


@dataclass(frozen=True, eq=False)
class Panels:
    """Polynomials of time, or of the phase s = t/ε.

    Attributes
    ----------
    breaks : array, shape (panels + 1,)
        Edges of the panels, corners and jumps among them, on the clock.
    coefficients : array, shape (m, panels)
        Of Chebyshev polynomials on each panel.
    noise : float
        Absolute error of the values.
    source : callable
        The given function: clock -> value, for arrays.
    period : float or None
        ε, if the clock is the phase.
    samples : int
        Number of places at which a Python function was sampled; 0 for formulas and samples.
    """

    breaks: Array
    coefficients: Array
    noise: float
    source: Source
    period: float | None = None
    samples: int = 0

    def clock(self, t: Array) -> Array:
        """The time itself, or the phase in [0, 1]."""
        return t if self.period is None else _phase(t, self.period)

    def locate(self, t: Array, near: Array) -> tuple[Array, Array]:
        """The panel that holds the times `near`, and the times t in the coordinate of that panel.

        `near` is inside a panel; t may be its end, which without `near` could also belong to the
        next panel.
        """
        if self.period is None:
            here, u = near, t
        else:
            here, u = _phase(near, self.period), _phase(t, self.period)
            u = u + np.rint(here + (t - near) / self.period - u)
        panel = np.clip(
            np.searchsorted(self.breaks, here, side="right") - 1, 0, len(self.breaks) - 2
        )
        start = self.breaks[panel]
        end = self.breaks[panel + 1]
        return panel, np.clip((2.0 * u - start - end) / (end - start), -1.0, 1.0)

    def sample(self, t: Array, near: Array) -> Value:
        """Values at t, and derivatives with respect to time, as on the panels that hold `near`."""
        panel, x = self.locate(t, near)
        c = self.coefficients[:, panel]
        return Value(ch.values(c, x), ch.values(ch.derivatives(c), x) * (2.0 / self._width(panel)))

    def _width(self, panel: Array) -> Array:
        """Durations of panels."""
        return (self.breaks[panel + 1] - self.breaks[panel]) * (self.period or 1.0)

    def edges(self, start: float, end: float) -> Array:
        """Times of the edges of panels between start and end."""
        times = self.breaks
        if self.period is not None:
            first, last = np.floor(start / self.period), np.ceil(end / self.period)
            whole = np.arange(first, last + 1.0)[:, None]
            times = np.ravel((whole + self.breaks[:-1]) * self.period)
        return times[(times > start) & (times < end)]

    def pieces(self, start: Array, end: Array) -> Array:
        """Coefficients on consecutive intervals of time, each inside one panel; shape (m,
        intervals)."""
        first = int(np.searchsorted(self.breaks, start[0]))
        if self.period is None and np.array_equal(
            self.breaks[first : first + len(start) + 1], np.append(start, end[-1])
        ):
            return self.coefficients[:, first : first + len(start)]
        middle = 0.5 * (start + end)
        if len(self.coefficients) == 1:  # a constant on each panel, so on each part of one
            return self.coefficients[:, self.locate(middle, middle)[0]]
        (panel, a), (_, b) = self.locate(start, middle), self.locate(end, middle)
        # Edges of panels are rounded times.
        rounding = 8.0 * ch.EPS * np.maximum(np.abs(start), np.abs(end)) / self._width(panel)
        a = np.where(a < rounding - 1.0, -1.0, a)
        b = np.where(b > 1.0 - rounding, 1.0, b)
        c = self.coefficients[:, panel]
        partial = (a > -1.0) | (b < 1.0)
        if np.any(partial):
            c[:, partial] = ch.restrict(c[:, partial], a[partial], b[partial])
        return c


def _phase(t: Array, period: float) -> Array:
    # The remainder is exact, the quotient is not.
    return np.mod(t, period) / period


def finite_source(source: Source, where: str, place: Callable[[float], str]) -> Source:
    """The same function; a value that is not finite is an error that names the place."""

    def checked(u: Array) -> Array:
        value = source(u)
        if not np.all(np.isfinite(value)):
            k = np.unravel_index(np.argmin(np.isfinite(value)), value.shape)
            raise DeclarationError(
                where, f"it is {value[k]} at {place(u[k])}", "Give finite values"
            )
        return value

    return checked


def fitted(
    source: Source,
    edges: Array,
    where: str,
    name: str,
    period: float | None,
    most: int = ch.MOST_PANELS,
    growth: ch.Growth | None = None,
) -> Panels:
    """A function of the clock as polynomials.

    Parameters
    ----------
    source : callable
        Numbers, shape (m,), to values, shape (m, ·).
    edges : array, shape (k,)
        Ascending; between them it is expected to be smooth.
    where : str
        Name in error messages.
    name : str
        That of the clock.
    period : float or None
        Of the function, if it has one.
    most : int
        Number of polynomials that are allowed.
    growth : callable, optional
        Bounds on its growth off the real axis, see :mod:`.chebyshev`.

    Raises
    ------
    DeclarationError
        If more than `most` panels would be needed.
    """
    try:
        breaks, c, noise = ch.fit_pieces(source, edges, most, growth)
    except ch.Unresolved as unresolved:
        remedy = "Give samples (times, values)"
        if most < ch.MOST_PANELS:
            remedy += ", or a vectorised function, which may use more"
        if period is None:
            remedy += ", or, if it is periodic, a function of s = t/epsilon together with epsilon="
        raise DeclarationError(
            where,
            f"it is not smooth enough or oscillates too fast to be resolved by {most} "
            f"polynomials (near {name} = {unresolved.args[0]:.6g})",
            remedy,
        ) from None
    return Panels(breaks, c, noise, source, period)
