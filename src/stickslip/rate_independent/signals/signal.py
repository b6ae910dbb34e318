"""The interface of signals: arrays that are functions of the time t, or of the phase s with period
1."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, StickslipError
from stickslip.numerics.levels import SAME_VALUE, SPAN_ENDS
from stickslip.rate_independent.signals.panels import Panels
from stickslip.symbolic.boxes import Chord

NARROWEST_INTERVAL = 2.0**-50  # width of a phase interval at the level of rounding
SAMPLE_PHASES = tuple((k * 0.6180339887498949) % 1.0 for k in range(8))


class Variable(NamedTuple):
    """The argument of a signal.

    Attributes
    ----------
    name : str
        In formulas.
    periodic : bool
        Whether only its fractional part matters.
    """

    name: str
    periodic: bool

    def wrapped(self, u: Any) -> Any:
        """The argument, reduced to [0, 1) if periodic."""
        return wrapped(u) if self.periodic else u

    def place(self, u: float) -> str:
        """The argument in error messages."""
        return f"phase {self.name} = {u:g}" if self.periodic else f"{self.name} = {u:.9g}"


OF_TIME = Variable("t", False)
OF_PHASE = Variable("s", True)


class Minima(NamedTuple):
    """The minimum of every entry of an array over one period.

    Attributes
    ----------
    values, phases : ndarray of shape (n,)
        Minima, to machine precision, and their phases, which are accurate to 1e-8 for a smooth
        minimum.
    floors : ndarray of shape (n,)
        Lower bounds of the values at all phases; if sampled, at the sampled phases.
    sampled : int
        Number of sampled phases; 0 if all phases are covered by bounds.
    """

    values: Array
    phases: Array
    floors: Array
    sampled: int


class Signal(ABC):
    """An array that is a function of the argument `clock`.

    Attributes
    ----------
    where : str
        Name in error messages.
    shape : tuple of int
    varies : bool
        Whether it is not constant.
    bounded : bool
        Whether it can be bounded everywhere, and not only evaluated at given points.
    differentiable : bool
        Whether :meth:`slope` and :meth:`bent` are known.
    knots : ndarray
        Arguments at which it is known to have corners.
    span : (float, float)
        Domain in which it is defined.
    scale : float
        Largest entry at a few arguments.
    """

    where: str
    clock: Variable
    shape: tuple[int, ...]
    varies: bool = True
    bounded: bool = False
    differentiable: bool = False
    knots: Array = np.empty(0)
    span: tuple[float, float] = (-np.inf, np.inf)
    scale: float = 0.0

    @property
    def looks(self) -> tuple[float, ...]:
        """Phases at which a declaration is checked when it is made; others are checked when they
        are used."""
        return SAMPLE_PHASES if self.varies else (0.0,)

    # -- values ------------------------------------------------------------------------------------

    @abstractmethod
    def raw(self, u: float) -> Any:
        """The given value at u, unchecked; a phase is not reduced modulo 1."""

    def value(self, u: float) -> Array:
        """The array at u; a phase is not reduced modulo 1.

        Raises
        ------
        DeclarationError
            If it has the wrong shape or is not finite.
        """
        return self.checked(self.raw(u), u)

    def at(self, u: float) -> Array:
        """The array at u."""
        return self.value(self.clock.wrapped(u))

    def over(self, places: Array) -> Array:
        """The arrays at several arguments, shape (m,), stacked: shape (m, ...)."""
        return self.unwrapped(self.clock.wrapped(places))

    def unwrapped(self, places: Array) -> Array:
        """Values without reduction of phases modulo 1, such as 1 at the end of a period."""
        rows = [self.value(u) for u in places.tolist()]
        return np.array(rows).reshape(len(places), *self.shape)

    @abstractmethod
    def entries(self, index: NDArray[np.intp], places: Array) -> Array:
        """Entry ``index[k]`` (of the flat array) at ``places[k]``, for all k."""

    @property
    def elementwise(self) -> bool:
        """Whether evaluating each entry at a different argument costs no more than evaluating all
        entries at one argument."""
        return True

    def shaped(self, given: Any, u: float) -> Array:
        """A value as an array of this shape, up to axes of length 1."""
        try:
            value = np.asarray(given, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise DeclarationError(
                self.where,
                f"no value at {self.clock.place(u)} (a {type(given).__name__} is not an array of "
                "numbers)",
                "Return an array" if self.shape else "Return a number",
            ) from None
        when = "" if value.shape == self.shape else f" at {self.clock.place(u)}"
        return fitting(value, self.shape, self.where, when)

    def checked(self, given: Any, u: float) -> Array:
        """A value as an array of this shape; rejects other shapes, NaN and infinities."""
        value = self.shaped(given, u)
        return value if np.isfinite(value.sum()) else finite(value, self.where, self.clock.place(u))

    # -- between values ----------------------------------------------------------------------------

    def chord(self, low: Array, high: Array) -> Chord:
        """The array on intervals from `low` to `high`, shape (m,) each, without knots inside;
        phases within one period, 0 <= low <= high <= 1.

        The phase 1 is the end of a period, where the array may jump. Deviations are bounds if the
        array is `bounded`; otherwise they are estimated by twice the deviation in the middle, which
        covers a parabola or a single kink.
        """
        start, middle, end = (self.unwrapped(u) for u in (low, 0.5 * (low + high), high))
        return Chord(start, end, np.abs(2.0 * middle - start - end))

    def slope(self, places: Array) -> Array:
        """Derivatives, shape (m, ...), where they exist; only if `differentiable`."""
        raise NotImplementedError

    def bent(self, low: Array, high: Array) -> Array:
        """Lower and upper bounds of second derivatives on intervals, shape (2, m, ...), infinite
        where unknown; only if `differentiable`."""
        raise NotImplementedError

    def least(self) -> Minima | None:
        """The minimum of every entry over one period, shape (n,), if it can be proved."""
        return None

    @abstractmethod
    def panels(self, span: tuple[float, float], period: float | None = None) -> Panels:
        """A single value as polynomials.

        Parameters
        ----------
        span : (float, float)
            The requested time span.
        period : float, optional
            ε, if the clock is the phase s = t/ε.

        Raises
        ------
        DeclarationError
            If it is not finite at an argument, which the message gives, cannot be resolved, or is
            not defined over the whole span.
        """

    def plain(self) -> Any:
        """A single value as data for JSON: a number, a string, or a table.

        Raises
        ------
        StickslipError
            If it is a Python function.
        """
        raise StickslipError(
            f"{self.where}: a Python function cannot be stored; give a formula or samples, or "
            "store the numbers with .dataset.to_netcdf(path)"
        )

    # -- checks ------------------------------------------------------------------------------------

    def check_span(self, start: float, end: float) -> None:
        """Reject a span in which it is not defined.

        Raises
        ------
        DeclarationError
        """
        if start < self.span[0] or end > self.span[1]:
            raise DeclarationError(
                self.where,
                f"it is known for {self.span[0]:.9g} <= {self.clock.name} <= {self.span[1]:.9g}"
                f" only, but the span is {start:.9g} ... {end:.9g}",
                "Give samples that cover the span, or shorten the span",
            )

    def left_out(self, start: float, end: float) -> list[str]:
        """Descriptions of its parts before and after a time span."""
        first, last = self.span
        if self.clock.periodic or not np.isfinite(last - first):
            return []
        near = SPAN_ENDS * (last - first)
        found: list[str] = []
        if first < start - near:
            found.append(f"{self.where} begins at {first:.9g}, the motion at {start:.9g}")
        if last > end + near:
            found.append(f"{self.where} runs to {last:.9g}, the motion ends at {end:.9g}")
        return found

    def check_period(self) -> None:
        """Reject a function of the phase that is not 1-periodic.

        Raises
        ------
        DeclarationError
        """
        if same_array(self.at(0.0), self.later(0.0)):
            return
        # A function that jumps at s = 0 is periodic if its values beyond s = 1 agree.
        for s in SAMPLE_PHASES[1:]:
            if not same_array(self.at(s), self.later(s)):
                raise not_periodic(self.where, s)

    def later(self, s: float) -> Array:
        """The value one period after the phase s, not reduced modulo 1."""
        return self.checked(self.raw(1.0 + s), 1.0 + s)


def wrapped(s: Any) -> Any:
    """The phase modulo 1, in [0, 1)."""
    phase = s % 1.0
    return phase * (phase < 1.0)  # a phase just below 0 is rounded to 1


def same_array(one: Array, other: Array) -> bool:
    """Return whether two arrays agree up to the rounding of a smooth function."""
    return one.shape == other.shape and bool(
        np.allclose(one, other, rtol=SAME_VALUE, atol=SAME_VALUE * np.abs(one).max(initial=0))
    )


def not_periodic(where: str, s: float) -> DeclarationError:
    """The error for a function that is not periodic."""
    return DeclarationError(
        where,
        f"it is not 1-periodic in the phase: it differs between s = {s:g} and s = {1 + s:g}",
        "Write it as a function of the phase with period 1, such as cos(2*pi*s)",
    )


def fitting(value: Array, shape: tuple[int, ...], where: str, when: str = "") -> Array:
    """The array in the required shape, from which it may differ by axes of length 1.

    Raises
    ------
    DeclarationError
        If it has another shape.
    """
    if value.shape == shape:
        return value
    if [n for n in value.shape if n != 1] == [n for n in shape if n != 1]:
        return value.reshape(shape)
    raise DeclarationError(
        where,
        f"its shape is {value.shape}{when}, but {shape or 'a single value'} is needed",
        f"Give an array of shape {shape}" if shape else "Give a number",
    )


def finite(value: Array, where: str, place: str = "") -> Array:
    """The array, if it has neither NaN nor infinities.

    Raises
    ------
    DeclarationError
        Naming the first entry that is not finite, and the place.
    """
    if not np.isfinite(value.sum()) and not np.isfinite(value).all():
        position = tuple(np.argwhere(~np.isfinite(value))[0].tolist())
        entry = f"[{', '.join(map(str, position))}]" if position else ""
        when = f" at {place}" if place else ""
        raise DeclarationError(
            f"{where}{entry}", f"it is {value[position]}{when}", "Give finite values"
        )
    return value
