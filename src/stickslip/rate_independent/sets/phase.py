"""Arrays that depend on the phase s of the oscillation, 1-periodically, or not at all."""

from __future__ import annotations

import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from functools import cached_property
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import DeclarationError
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import slopes
from stickslip.symbolic.chords import Chord, deviations, evaluate, table
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Scope

Array = NDArray[np.float64]

NARROW = 2.0**-50  # width of a stretch of phases that is rounding
SAMPLE_PHASES = tuple((k * 0.6180339887498949) % 1.0 for k in range(8))


class Varying(ABC):
    """An array that is a function of the phase s, taken modulo 1.

    Attributes
    ----------
    where : str
        How errors call it.
    shape : tuple of int
    depends_on_phase : bool
    bounded : bool
        Whether it is known at every phase, and not only where it is asked for.
    scale : float
        Largest entry at a few phases.
    """

    where: str
    shape: tuple[int, ...]
    depends_on_phase: bool = True
    bounded: bool = False
    scale: float = 0.0

    @property
    def looks(self) -> tuple[float, ...]:
        """Phases at which a declaration is looked at when it is made; afterwards each is checked
        when it is used."""
        return SAMPLE_PHASES if self.depends_on_phase else (0.0,)

    @abstractmethod
    def raw(self, s: float) -> Any:
        """What the user's function says at phase s, unchecked."""

    @abstractmethod
    def entries(self, index: NDArray[np.intp], phases: Array) -> Array:
        """Entry ``index[k]`` (of the flat array) at ``phases[k]``, for all k."""

    def at(self, s: float) -> Array:
        """The array at phase s.

        Raises
        ------
        DeclarationError
            If it has another shape than before or is not finite.
        """
        phase = wrapped(s)
        return self.checked(self.raw(phase), phase)

    def over(self, phases: Array) -> Array:
        """The arrays at several phases, stacked: shape (m, ...)."""
        return np.array([self.at(s) for s in phases.tolist()]).reshape(len(phases), *self.shape)

    def chord(self, low: Array, high: Array) -> Chord:
        """The array on stretches from `low` to `high`, shape (m,) each, within one period: 0 <= low
        <= high <= 1.

        The phase 1 is the end of a period, where the array may jump. Deviations are bounds if the
        array is `bounded`; otherwise they are estimated by twice that in the middle: what a
        parabola or a kink anywhere would have.
        """
        start, middle, end = (
            np.array([self.checked(self.raw(s), s) for s in phases.tolist()])
            for phases in (low, 0.5 * (low + high), high)
        )
        return Chord(start, end, np.abs(2.0 * middle - start - end))

    def checked(self, given: Any, s: float) -> Array:
        """The value as an array of this shape; refuses other shapes, NaN and infinities."""
        try:
            value = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            raise DeclarationError(
                self.where,
                f"at phase s = {s:g} it is {type(given).__name__}, not an array of numbers",
                "Return an array",
            ) from None
        if value.shape != self.shape:
            raise DeclarationError(
                self.where,
                f"at phase s = {s:g} it has the shape {value.shape}, but {self.shape} is needed",
                "Return an array of the same shape at every phase",
            )
        check_finite(value, self.where, f" at phase s = {s:g}")
        return value

    def check(self) -> None:
        """Look whether the function closes up after one period.

        Raises
        ------
        DeclarationError
        """
        if same(self.at(0.0), self.later(0.0)):
            return
        # A function that jumps at s = 0 is periodic all the same if it says so beyond s = 1.
        for s in SAMPLE_PHASES[1:]:
            if not same(self.at(s), self.later(s)):
                raise not_periodic(self.where, s)

    def later(self, s: float) -> Array:
        """What the function says one period after phase s, where it is not taken modulo 1."""
        return self.checked(self.raw(1.0 + s), 1.0 + s)


class Constant(Varying):
    """An array that is the same at every phase."""

    depends_on_phase = False
    bounded = True

    def __init__(self, value: Array, where: str) -> None:
        self.where = where
        self.shape = value.shape
        self.value = value.copy()
        self.value.flags.writeable = False
        check_finite(value, where)

    def raw(self, s: float) -> Array:
        return self.value

    def at(self, s: float) -> Array:
        return self.value

    def entries(self, index: NDArray[np.intp], phases: Array) -> Array:
        return self.value.ravel()[index]

    def chord(self, low: Array, high: Array) -> Chord:
        value = np.broadcast_to(self.value, (len(low), *self.shape))
        return Chord(value, value, np.broadcast_to(0.0, value.shape))

    def check(self) -> None:
        """Nothing is left to check."""


class Formulas(Varying):
    """An array of formulas in ``s``."""

    bounded = True

    def __init__(self, expressions: list[Expr], shape: tuple[int, ...], where: str) -> None:
        self.where = where
        self.shape = shape
        self.expressions = expressions

    def raw(self, s: float) -> Array:
        return np.array([float(v) for v in evaluate(self.expressions, s)]).reshape(self.shape)

    def over(self, phases: Array) -> Array:
        return self.unwrapped(wrapped(phases))

    def unwrapped(self, phases: Array) -> Array:
        """The arrays at several phases as the formulas say, also at the end of a period."""
        rows = table(self.expressions, phases)
        if not np.isfinite(rows).all():
            k = int(np.argmin(np.isfinite(rows).all(axis=1)))
            self.checked(rows[k].reshape(self.shape), float(phases[k]))
        return rows.reshape(len(phases), *self.shape)

    def chord(self, low: Array, high: Array) -> Chord:
        start, end = self.unwrapped(low), self.unwrapped(high)
        rows = (at.reshape(len(low), -1) for at in (start, end))
        return Chord(
            start, end, deviations(self.expressions, "s", low, high, *rows).reshape(start.shape)
        )

    @cached_property
    def _slopes(self) -> list[Expr]:
        return [ex.derivative(e, "s") for e in self.expressions]

    def slope(self, phases: Array) -> Array:
        """Derivatives in s, shape (m, ...); where there is one."""
        return table(self._slopes, phases).reshape(len(phases), *self.shape)

    def bent(self, low: Array, high: Array) -> Array:
        """What second derivatives in s lie in on stretches, shape (2, m, ...): infinite where they
        are not known."""
        inside = {"s": (low, high)}
        once, twice = (
            np.stack([slope for _, slope in slopes(expressions, inside, "s")], axis=2)
            for expressions in (self.expressions, self._slopes)
        )
        # Across a jump or a kink, a derivative says nothing: there, a slope of the formula or of
        # its own is unbounded.
        known = np.isfinite(once).all(axis=0) & np.isfinite(twice).all(axis=0)
        twice = np.where(known, twice, np.array([-np.inf, np.inf])[:, None, None])
        return twice.reshape(2, len(low), *self.shape)

    def entries(self, index: NDArray[np.intp], phases: Array) -> Array:
        values = np.empty(len(index))
        for i in np.unique(index):
            chosen = index == i
            (values[chosen],) = evaluate([self.expressions[i]], wrapped(phases[chosen]))
        return values


class Function(Varying):
    """A callable of s that returns an array."""

    def __init__(self, function: Callable[[Any], Any], where: str) -> None:
        self.where, self.function = where, function
        self.shape = np.shape(self.raw(0.0))

    def raw(self, s: float) -> Any:
        try:
            return self.function(s)
        except Exception as error:
            raise DeclarationError(
                self.where,
                f"the function fails at phase s = {s:g} ({type(error).__name__}: {error})",
                "Correct it",
            ) from error

    @cached_property
    def elementwise(self) -> bool:
        """Whether the function takes an array of phases, one for each entry, and returns each entry
        at its own."""
        size = math.prod(self.shape)
        phases = (np.arange(size) * 0.7548776662466927) % 1.0
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                values = np.asarray(self.function(phases.reshape(self.shape)), dtype=float)
        except Exception:
            return False
        looks = {0, size // 3, size // 2, size - 1}
        return values.shape == self.shape and all(
            values.flat[i] == np.asarray(self.raw(phases[i]), dtype=float).flat[i] for i in looks
        )

    def entries(self, index: NDArray[np.intp], phases: Array) -> Array:
        phases = wrapped(phases)
        if not self.elementwise:
            return np.array([self.at(s).flat[i] for i, s in zip(index, phases, strict=True)])
        values = np.empty(len(index))
        for chosen in rounds(index):
            everywhere = np.zeros(math.prod(self.shape))
            everywhere[index[chosen]] = phases[chosen]
            result = np.asarray(self.function(everywhere.reshape(self.shape)), dtype=float)
            values[chosen] = result.ravel()[index[chosen]]
        return values


def rounds(index: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Split positions so that no entry of `index` occurs twice in one part."""
    order = np.argsort(index, kind="stable")
    first = (
        np.concatenate([[True], np.diff(index[order]) != 0]) if len(index) else np.zeros(0, bool)
    )
    starts = np.maximum.accumulate(np.where(first, np.arange(len(index)), 0))
    occurrence = np.arange(len(index)) - starts
    for k in range(int(occurrence.max(initial=-1)) + 1):
        yield order[occurrence == k]


def read(given: Any, where: str, closes: bool = True) -> Varying:
    """An array, a callable of s, or formulas in ``s`` (one, or nested lists of them), read and
    checked.

    Parameters
    ----------
    closes : bool
        Whether to refuse functions that do not return to the same array after one period.

    Raises
    ------
    DeclarationError
        If it is none of these, not finite, or not 1-periodic.
    """
    varying = _read(given, where)
    varying.scale = max(float(np.abs(varying.at(s)).max(initial=0.0)) for s in varying.looks)
    if closes:
        varying.check()
    return varying


def not_periodic(where: str, s: float) -> DeclarationError:
    """The refusal of a function that is another one after one period."""
    return DeclarationError(
        where,
        f"it is not 1-periodic in the phase: it differs between s = {s:g} and s = {1 + s:g}",
        "Write it as a function of the phase with period 1, such as cos(2*pi*s)",
    )


def _read(given: Any, where: str) -> Varying:
    if callable(given):
        return Function(given, where)
    try:
        table = np.asarray(given)
        if table.dtype.kind not in "iuf":
            table = np.asarray(given, dtype=object)
    except ValueError:  # nested lists of different lengths
        table = np.empty(0)
    if table.size and table.dtype != object:
        return Constant(table.astype(float), where)
    if not table.size or not all(isinstance(entry, str | Expr | Real) for entry in table.flat):
        raise DeclarationError(
            where,
            "it is no array of numbers, no function of the phase and no formula",
            "Give an array, a function s -> array, or formulas in s such as '2 + cos(2*pi*s)'",
        )
    scope = Scope({"s": ex.sym("s")})
    names = [where + "".join(f"[{i}]" for i in position) for position in np.ndindex(table.shape)]
    expressions = [scope.parse(entry, name) for entry, name in zip(table.flat, names, strict=True)]
    if any(e.symbols for e in expressions):
        return Formulas(expressions, table.shape, where)
    return Constant(np.array([ex.number(e) for e in expressions]).reshape(table.shape), where)


def wrapped(s: Any) -> Any:
    """The phase modulo 1, in [0, 1)."""
    phase = s % 1.0
    return phase * (phase < 1.0)  # a phase just below 0 is rounded to 1


def same(one: Array, other: Array) -> bool:
    """Whether two arrays agree up to the rounding of a smooth function."""
    return one.shape == other.shape and bool(
        np.allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(one).max(initial=0))
    )


def check_finite(value: Array, where: str, when: str = "") -> None:
    """Refuse NaN and infinities."""
    if not np.isfinite(value.sum()) and not np.isfinite(value).all():
        position = np.argwhere(~np.isfinite(value))[0]
        name = (
            f"component {position[0]}"
            if value.ndim == 1
            else f"entry {tuple(int(i) for i in position)}"
        )
        raise DeclarationError(
            where,
            f"{name if value.ndim else 'it'} is {value[tuple(position)]}{when}",
            "Give finite numbers",
        )
