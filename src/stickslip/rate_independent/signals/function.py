"""Signals that are Python functions, which can only be evaluated at given points."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.rate_independent.signals import chebyshev as ch
from stickslip.rate_independent.signals.panels import Panels, Source, finite_source, fitted
from stickslip.rate_independent.signals.signal import Signal, Variable

# largest number of cached values: refined steps evaluate the same times again
_REMEMBERED = 2_000_000
_FEW_PANELS = 2**13  # for a function that has to be called for each number
# relative difference between an array function and its single values: rounding errors
_AT_ONCE = 1e-12


class CallableSignal(Signal):
    """A callable of the clock that returns an array.

    Parameters
    ----------
    shape : tuple of int, optional
        By default that of its value at 0.
    """

    def __init__(
        self,
        function: Callable[[Any], Any],
        where: str,
        clock: Variable,
        shape: tuple[int, ...] | None = None,
    ) -> None:
        self.where = where
        self.clock = clock
        self.function = function
        self.shape: tuple[int, ...] = np.shape(self.raw(0.0)) if shape is None else shape

    def raw(self, u: float) -> Any:
        try:
            return self.function(u)
        except Exception as error:
            raise DeclarationError(
                self.where,
                f"the function raises an error at {self.clock.place(u)} ({type(error).__name__}: "
                f"{error})",
                "Correct it",
            ) from error

    @cached_property
    def _remembered(self) -> Callable[[float], Array]:
        size = max(1, math.prod(self.shape))
        return lru_cache(maxsize=max(4, _REMEMBERED // size))(super().value)

    def value(self, u: float) -> Array:
        return self._remembered(u)

    @property
    def elementwise(self) -> bool:
        return self._elementwise

    @cached_property
    def _elementwise(self) -> bool:
        """Whether the function accepts an array of phases, one for each entry, and returns each
        entry at its phase."""
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

    def entries(self, index: NDArray[np.intp], places: Array) -> Array:
        places = self.clock.wrapped(places)
        if not self.elementwise:
            return np.array([self.at(s).flat[i] for i, s in zip(index, places, strict=True)])
        values = np.empty(len(index))
        for chosen in without_repeats(index):
            everywhere = np.zeros(math.prod(self.shape))
            everywhere[index[chosen]] = places[chosen]
            result = np.asarray(self.function(everywhere.reshape(self.shape)), dtype=float)
            values[chosen] = result.ravel()[index[chosen]]
        return values

    def panels(self, span: tuple[float, float], period: float | None = None) -> Panels:
        edges = np.array(span if period is None else (0.0, 1.0))
        function, most = self._of_arrays(edges)
        counted = _Counted(finite_source(function, self.where, self.clock.place))
        panels = fitted(counted, edges, self.where, self.clock.name, period, most)
        return replace(panels, source=counted.function, samples=counted.places)

    def _of_arrays(self, edges: Array) -> tuple[Source, int]:
        """The function for arrays, and how many panels it may need.

        It is the function itself if it accepts arrays and returns the same values as for single
        numbers.
        """
        if self.shape:
            return lambda u: self.over(np.ravel(u)).reshape(np.shape(u)), ch.MOST_PANELS

        def each(u: Array) -> Array:
            values = [self.shaped(self.raw(x), x) for x in np.ravel(u).tolist()]
            return np.array(values).reshape(np.shape(u))

        probe = edges[0] + (edges[1] - edges[0]) * np.array([[0.0, 0.31], [0.62, 0.95]])
        expected = each(probe)
        try:
            at_once = np.asarray(self.function(probe), dtype=float)
        except Exception:  # any error of a user's function for arrays; it works for numbers
            return each, _FEW_PANELS
        if at_once.shape != probe.shape or not np.allclose(
            at_once, expected, rtol=_AT_ONCE, equal_nan=True
        ):
            return each, _FEW_PANELS
        return lambda u: np.asarray(self.function(u), dtype=float), ch.MOST_PANELS


class _Counted:
    """A function that counts its evaluations."""

    def __init__(self, function: Source) -> None:
        self.function = function
        self.places = 0

    def __call__(self, u: Array) -> Array:
        self.places += np.size(u)
        return self.function(u)


def without_repeats(index: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Split positions so that no entry of `index` occurs twice in one part."""
    order = np.argsort(index, kind="stable")
    first = (
        np.concatenate([[True], np.diff(index[order]) != 0]) if len(index) else np.zeros(0, bool)
    )
    starts = np.maximum.accumulate(np.where(first, np.arange(len(index)), 0))
    occurrence = np.arange(len(index)) - starts
    for k in range(int(occurrence.max(initial=-1)) + 1):
        yield order[occurrence == k]
