"""Signals that can be bounded everywhere: constants and formulas."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.kept import cached_property
from stickslip.numerics.levels import ROUNDING
from stickslip.rate_independent.signals import chebyshev as ch
from stickslip.rate_independent.signals.panels import Panels, Source, finite_source, fitted
from stickslip.rate_independent.signals.signal import Minima, Signal, Variable, finite, wrapped
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.boxes import Chord, chord_values, deviations, slopes, value_rows
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.extrema import least
from stickslip.symbolic.formulas import formula_text
from stickslip.symbolic.majorants import growth

# neighbourhood of a minimum, of the accuracy of a search by bounds
_NEARBY = np.append(0.0, np.linspace(-2e-8, 2e-8, 64))
_NEIGHBOURS = np.array([0, *(side * k for k in range(1, 9) for side in (1, -1))])


class Constant(Signal):
    """An array that is the same at all times."""

    varies = False
    bounded = True

    def __init__(self, value: Array, where: str, clock: Variable) -> None:
        self.where = where
        self.clock = clock
        self.shape: tuple[int, ...] = value.shape
        self.constant: Array = finite(value.copy(), where)
        self.constant.flags.writeable = False

    def raw(self, u: float) -> Array:
        return self.constant

    def value(self, u: float) -> Array:
        return self.constant

    def unwrapped(self, places: Array) -> Array:
        return np.broadcast_to(self.constant, (len(places), *self.shape)).copy()

    def entries(self, index: NDArray[np.intp], places: Array) -> Array:
        return self.constant.ravel()[index]

    def chord(self, low: Array, high: Array) -> Chord:
        value = np.broadcast_to(self.constant, (len(low), *self.shape))
        return Chord(value, value, np.broadcast_to(0.0, value.shape))

    def least(self) -> Minima:
        return Minima(self.constant, np.zeros(self.shape[0]), self.constant, 0)

    def panels(self, span: tuple[float, float], period: float | None = None) -> Panels:
        value = self.constant.reshape(1, 1)
        return Panels(
            np.array(span),
            value,
            4.0 * ch.EPS * abs(value.item()),
            lambda u: np.full(np.shape(u), value.item()),
        )

    def plain(self) -> float:
        return self.constant.item()

    def check_period(self) -> None:
        """Formulas are checked when they are read."""


class Formulas(Signal):
    """An array of formulas."""

    bounded = True
    differentiable = True

    def __init__(
        self, expressions: list[Expr], shape: tuple[int, ...], where: str, clock: Variable
    ) -> None:
        self.where = where
        self.clock = clock
        self.shape = shape
        self.expressions = expressions

    def raw(self, u: float) -> Array:
        return np.array([float(v) for v in chord_values(self.expressions, u)]).reshape(self.shape)

    def unwrapped(self, places: Array) -> Array:
        rows = value_rows(self.expressions, places)
        if not np.isfinite(rows).all():
            k = int(np.argmin(np.isfinite(rows).all(axis=1)))
            self.checked(rows[k].reshape(self.shape), float(places[k]))
        return rows.reshape(len(places), *self.shape)

    def chord(self, low: Array, high: Array) -> Chord:
        start, end = self.unwrapped(low), self.unwrapped(high)
        rows = (at.reshape(len(low), -1) for at in (start, end))
        off = deviations(self.expressions, self.clock.name, low, high, *rows)
        return Chord(start, end, off.reshape(start.shape))

    @cached_property
    def _slopes(self) -> list[Expr]:
        return [ex.derivative(e, self.clock.name) for e in self.expressions]

    def slope(self, places: Array) -> Array:
        return value_rows(self._slopes, places).reshape(len(places), *self.shape)

    def bent(self, low: Array, high: Array) -> Array:
        name = self.clock.name
        inside = {name: (low, high)}
        once, twice = (
            np.stack([slope for _, slope in slopes(expressions, inside, name)], axis=2)
            for expressions in (self.expressions, self._slopes)
        )
        # Across a jump or a kink, a derivative is not a slope: there, a slope of the formula or of
        # its own is unbounded.
        known = np.isfinite(once).all(axis=0) & np.isfinite(twice).all(axis=0)
        twice = np.where(known, twice, np.array([-np.inf, np.inf])[:, None, None])
        return twice.reshape(2, len(low), *self.shape)

    def entries(self, index: NDArray[np.intp], places: Array) -> Array:
        values = np.empty(len(index))
        for i in np.unique(index):
            chosen = index == i
            (values[chosen],) = chord_values(
                [self.expressions[i]], self.clock.wrapped(places[chosen])
            )
        return values

    def least(self) -> Minima:
        """Minima by branch and bound, once for equal formulas."""
        known: dict[Expr, tuple[float, float, float]] = {}
        for e in self.expressions:
            if e not in known:
                minimum = least(e, self.clock.name, 0.0, 1.0)
                # A search by bounds locates a smooth minimum to 1e-8: choose the best number
                # nearby.
                near = wrapped(minimum.place + _NEARBY)
                values = value_rows([e], near)[:, 0]
                k = int(np.argmin(values))
                known[e] = float(values[k]), float(near[k]), min(minimum.floor, float(values[k]))
        values, phases, floors = np.transpose([known[e] for e in self.expressions])
        return Minima(values, phases, floors, 0)

    def panels(self, span: tuple[float, float], period: float | None = None) -> Panels:
        (expression,) = self.expressions
        name = self.clock.name
        edges = _corners(expression, name, np.array(span if period is None else (0.0, 1.0)))
        source = finite_source(_of_array(expression), self.where, self.clock.place)
        return fitted(source, edges, self.where, name, period, growth=_growth(expression, name))

    def plain(self) -> str:
        return formula_text(self.expressions[0], self.where)


def _of_array(expression: Expr) -> Source:
    return lambda u: np.broadcast_to(chord_values([expression], u)[0], np.shape(u)).astype(float)


def _growth(expression: Expr, name: str) -> ch.Growth:
    return lambda start, end, radius: growth(expression, name, start, end, radius)


def _corners(expression: Expr, name: str, edges: Array) -> Array:
    """The ends, and the places at which branches of the formula change: the zeros of its guards,
    the inner ones first."""
    for e in ex.walk([expression]):
        if e.op == "select" and e.args[0].symbols:
            edges = _distinct(np.concatenate([edges, _zeros(e.args[0], name, edges)]))
    return edges


def _zeros(expression: Expr, name: str, edges: Array) -> Array:
    """Changes of sign between the first and the last edge, to machine precision."""
    guard = _of_array(expression)
    try:
        breaks, c, _ = ch.fit_pieces(
            lambda u: np.nan_to_num(guard(u)), edges, growth=_growth(expression, name)
        )
    except ch.Unresolved:
        return edges[:0]  # the fit of the entire formula reports it, or finds its corners
    panel, x = ch.sign_changes(c, 0.0)
    inside = breaks[panel] + 0.5 * (x + 1.0) * np.diff(breaks)[panel]
    # A zero at the edge of two panels may show in neither.
    between = breaks[1:-1][np.abs(guard(breaks[1:-1])) <= ROUNDING * np.max(np.abs(c))]
    found = np.concatenate([inside, between])
    # Of the floating-point numbers nearby, the nearest at which the guard is smallest: t < 1 ends
    # at 1.
    near = np.clip(found + np.spacing(found) * _NEIGHBOURS[:, None], edges[0], edges[-1])
    best = np.argmin(np.nan_to_num(np.abs(guard(near)), nan=np.inf), axis=0)
    return near[best, np.arange(len(found))]


def _distinct(places: Array) -> Array:
    """Sorted places, without those that differ by rounding from the previous one; the ends are
    kept."""
    places = np.unique(places)
    apart = np.diff(places) > 8.0 * ch.EPS * np.max(np.abs(places))
    kept = places[np.concatenate([[True], apart])]
    kept[-1] = places[-1]
    return kept
