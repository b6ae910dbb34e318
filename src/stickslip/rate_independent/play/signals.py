"""Loads and thresholds of a play: a formula, a callable or samples, each as polynomials on
panels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.errors import DeclarationError
from stickslip.rate_independent.play import chebyshev as ch
from stickslip.rate_independent.play.clamp import samples
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.chords import evaluate
from stickslip.symbolic.formulas import Scope
from stickslip.symbolic.majorants import growth

Array = np.ndarray
Function = Callable[[Array], Array]
FEW_PANELS = 2**13  # for a function that has to be called for each number
NEIGHBOURS = np.array([0, *(side * k for k in range(1, 9) for side in (1, -1))])
INTERPOLATIONS = ("linear", "monotone")


class Value(NamedTuple):
    """A signal and its rate at some times."""

    value: Array
    rate: Array


@dataclass(frozen=True, eq=False)
class Signal:
    """A function of its clock: time, or the phase s = t/ε if it is periodic.

    Attributes
    ----------
    breaks : array, shape (panels + 1,)
        Edges of the panels, corners and jumps among them, on the clock.
    coefficients : array, shape (m, panels)
        Of Chebyshev polynomials on each panel.
    noise : float
        Absolute error of the values.
    source : callable
        What was given: clock -> value, for arrays.
    period : float or None
        ε, if the clock is the phase.
    samples : int
        Number of places at which a function of Python was looked at; 0 if it is known everywhere.
    """

    breaks: Array
    coefficients: Array
    noise: float
    source: Function
    period: float | None = None
    samples: int = 0

    def clock(self, t: Array) -> Array:
        """The time itself, or the phase in [0, 1]."""
        return t if self.period is None else _phase(t, self.period)

    def locate(self, t: Array, near: Array) -> tuple[Array, Array]:
        """The panel that holds the times `near`, and the times t in the coordinate of that panel.

        `near` lies inside a panel; t may be its end, where the clock alone could not tell it from
        the next panel.
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
        return Value(ch.values(c, x), ch.values(ch.slopes(c), x) * (2.0 / self._width(panel)))

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


def is_table(given: Any) -> bool:
    """Whether it is a pair (times, values) of arrays."""
    pair = isinstance(given, tuple) and len(given) == 2
    return pair and all(not isinstance(part, str | tuple) and np.ndim(part) == 1 for part in given)


def read_signal(
    given: Any,
    where: str,
    span: tuple[float, float],
    period: float | None = None,
    interpolation: str = "linear",
) -> Signal:
    """A load or a threshold as polynomials.

    Parameters
    ----------
    given : str, float, callable or (times, values)
        A formula in ``t`` (in ``s`` if periodic), a function of it, or samples.
    where : str
        How errors call it.
    span : (float, float)
        Times that are asked for.
    period : float, optional
        ε, if it is a function of the phase s = t/ε.
    interpolation : {"linear", "monotone"}
        What samples mean between them.

    Raises
    ------
    DeclarationError
        If it is none of these, is not finite somewhere (the place is named), cannot be resolved, or
        does not cover the span.
    """
    clock = span if period is None else (0.0, 1.0)
    if is_table(given):
        times, values = given
        return _sampled(times, values, where, clock, period, interpolation)
    name = "t" if period is None else "s"
    if callable(given):
        function, most = _vectorised(given, where, name, clock)
        counted = _Counted(_checked(function, where, name))
        signal = _fitted(counted, np.array(clock), where, name, period, most)
        return replace(signal, source=counted.function, samples=counted.places)
    if isinstance(given, str) or np.ndim(given) == 0:
        expression = Scope({name: ex.sym(name)}).parse(given, where)
        source = _checked(_of_array(expression), where, name)
        if not expression.symbols:
            value = source(np.zeros((1, 1)))
            return Signal(np.array(span), value, 4.0 * ch.EPS * abs(value.item()), source)
        edges = _corners(expression, name, np.array(clock))
        return _fitted(source, edges, where, name, period, growth=_growth(expression, name))
    raise DeclarationError(
        where,
        f"a {type(given).__name__} is no signal",
        f"Give a formula in {name}, a function of {name}, or a pair (times, values) of arrays",
    )


# --- Formulas and functions -----------------------------------------------------------------------


def _of_array(expression: ex.Expr) -> Function:
    return lambda u: np.broadcast_to(evaluate([expression], u)[0], np.shape(u)).astype(float)


def _growth(expression: ex.Expr, name: str) -> ch.Growth:
    return lambda start, end, radius: growth(expression, name, start, end, radius)


def _corners(expression: ex.Expr, name: str, edges: Array) -> Array:
    """The ends, and where the branches of the formula change: the zeros of its guards, the inner
    ones first."""
    for e in ex.walk([expression]):
        if e.op == "select" and e.args[0].symbols:
            edges = _distinct(np.concatenate([edges, _zeros(e.args[0], name, edges)]))
    return edges


def _zeros(expression: ex.Expr, name: str, edges: Array) -> Array:
    """Changes of sign between the first and the last edge, to the last digit."""
    guard = _of_array(expression)
    try:
        breaks, c, _ = ch.fit(
            lambda u: np.nan_to_num(guard(u)), edges, growth=_growth(expression, name)
        )
    except ch.Unresolved:
        return edges[:0]  # the fit of the whole formula says so, or finds its corners by itself
    panel, x = ch.sign_changes(c, 0.0)
    inside = breaks[panel] + 0.5 * (x + 1.0) * np.diff(breaks)[panel]
    # A zero at the edge of two panels may show in neither.
    between = breaks[1:-1][np.abs(guard(breaks[1:-1])) <= ch.ROUNDING * np.max(np.abs(c))]
    found = np.concatenate([inside, between])
    # Of the numbers around it, the nearest at which the guard is smallest: t < 1 ends at 1.
    near = np.clip(found + np.spacing(found) * NEIGHBOURS[:, None], edges[0], edges[-1])
    best = np.argmin(np.nan_to_num(np.abs(guard(near)), nan=np.inf), axis=0)
    return near[best, np.arange(len(found))]


class _Counted:
    """A function that counts the places at which it is asked."""

    def __init__(self, function: Function) -> None:
        self.function = function
        self.places = 0

    def __call__(self, u: Array) -> Array:
        self.places += np.size(u)
        return self.function(u)


def _distinct(places: Array) -> Array:
    """Sorted, without those that differ by rounding from the one before; the ends stay."""
    places = np.unique(places)
    apart = np.diff(places) > 8.0 * ch.EPS * np.max(np.abs(places))
    kept = places[np.concatenate([[True], apart])]
    kept[-1] = places[-1]
    return kept


def _vectorised(
    function: Callable[[Any], Any], where: str, name: str, clock: tuple[float, float]
) -> tuple[Function, int]:
    """The function for arrays, and how many panels it may need.

    It is the function itself if that takes arrays and says the same as for single numbers.
    """

    def one(u: float) -> float:
        try:
            return np.asarray(function(u), dtype=float).item()
        except (TypeError, ValueError) as error:
            raise DeclarationError(
                where, f"no value at {name} = {u:.9g} ({error})", "Return a number"
            ) from None

    def each(u: Array) -> Array:
        return np.array([one(x) for x in np.ravel(u).tolist()]).reshape(np.shape(u))

    probe = clock[0] + (clock[1] - clock[0]) * np.array([[0.0, 0.31], [0.62, 0.95]])
    expected = each(probe)
    try:
        at_once = np.asarray(function(probe), dtype=float)
    except Exception:  # whatever it does with an array, it works for numbers
        return each, FEW_PANELS
    if at_once.shape != probe.shape or not np.allclose(
        at_once, expected, rtol=1e-12, equal_nan=True
    ):
        return each, FEW_PANELS
    return lambda u: np.asarray(function(u), dtype=float), ch.MOST_PANELS


def _checked(source: Function, where: str, name: str) -> Function:
    """The same function; a value that is not finite is an error that names the place."""

    def checked(u: Array) -> Array:
        value = source(u)
        if not np.all(np.isfinite(value)):
            k = np.unravel_index(np.argmin(np.isfinite(value)), value.shape)
            raise DeclarationError(
                where,
                f"it is {value[k]} at {name} = {u[k]:.9g}",
                "It must be finite over the whole span",
            )
        return value

    return checked


def _fitted(
    source: Function,
    edges: Array,
    where: str,
    name: str,
    period: float | None,
    most: int = ch.MOST_PANELS,
    growth: ch.Growth | None = None,
) -> Signal:
    try:
        breaks, c, noise = ch.fit(source, edges, most, growth)
    except ch.Unresolved as unresolved:
        remedy = "Give samples (times, values)"
        if most < ch.MOST_PANELS:
            remedy += ", or a function that takes arrays, which may need more"
        if period is None:
            remedy += ", or, if it is periodic, a function of s = t/epsilon together with epsilon="
        raise DeclarationError(
            where,
            f"it is too rough or oscillates too fast: {most} polynomials do not resolve it"
            f" (near {name} = {unresolved.args[0]:.6g})",
            remedy,
        ) from None
    return Signal(breaks, c, noise, source, period)


# --- Samples --------------------------------------------------------------------------------------


def _sampled(
    times: Any,
    values: Any,
    where: str,
    clock: tuple[float, float],
    period: float | None,
    interpolation: str,
) -> Signal:
    t = samples(times, f"{where}, times", finite=True).copy()
    y = samples(values, f"{where}, values", finite=True).copy()
    if len(t) != len(y) or len(t) < 2:
        raise DeclarationError(
            where,
            f"{len(t)} times and {len(y)} values",
            "Give as many times as values, at least 2 of each",
        )
    if not np.all(t[1:] > t[:-1]):
        k = int(np.argmin(t[1:] > t[:-1])) + 1
        raise DeclarationError(
            where,
            f"the times do not increase: {t[k - 1]:.9g}, then {t[k]:.9g} at index {k}",
            "Sort them, each once",
        )
    covered = t[0] <= clock[0] and t[-1] >= clock[1] if period is None else (t[0], t[-1]) == clock
    if not covered:
        what, remedy = "the span is", "Give samples over all of it, or a shorter t_span"
        if period is not None:
            what = "one period of the phase s = t/epsilon is"
            remedy = "Let them start at s = 0 and end at s = 1"
        raise DeclarationError(
            where,
            f"the samples cover {t[0]:.9g} ... {t[-1]:.9g}, but {what} {clock[0]:.9g} ... "
            f"{clock[1]:.9g}",
            remedy,
        )
    source, c = _interpolated(t, y, interpolation)
    first = np.searchsorted(t, clock[0], side="right") - 1
    last = np.searchsorted(t, clock[1], side="left")
    return Signal(
        t[first : last + 1],
        c[:, first:last],
        4.0 * ch.EPS * float(np.max(np.abs(y))),
        source,
        period,
    )


def _interpolated(t: Array, y: Array, interpolation: str) -> tuple[Function, Array]:
    """What samples mean between them: a function, and its Chebyshev coefficients."""
    mean = 0.5 * (y[:-1] + y[1:])
    rise = 0.5 * np.diff(y)
    if interpolation == "linear":
        return lambda u: np.interp(u, t, y), np.stack([mean, rise])
    from scipy.interpolate import PchipInterpolator

    cubic = PchipInterpolator(t, y)
    slope = cubic(t, 1)
    half = 0.5 * np.diff(t)
    start, end = half * slope[:-1], half * slope[1:]
    c2 = (end - start) / 8.0
    c3 = (0.5 * (start + end) - rise) / 8.0
    return cubic, np.stack([mean - c2, rise - c3, c2, c3])
