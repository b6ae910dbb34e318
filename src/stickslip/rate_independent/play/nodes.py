"""The nodes of a play: extrema, corners and jumps of its bounds, and times at which z starts to
move.

Between two nodes the bounds L and U are monotone, and z rests or follows one of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError
from stickslip.rate_independent.play.clamp import clamp_samples
from stickslip.rate_independent.signals import chebyshev as ch
from stickslip.rate_independent.signals.panels import Panels, Value

_CHUNK = 2**12  # number of panels that are evaluated together, to fit in the cache
_MOST_EDGES = 50_000_000
_SMALLEST_JUMP = 64.0  # smallest jump of a bound between two panels, in units of its rounding error


class Sample(NamedTuple):
    """Load, thresholds, bounds L and U and their rates at some times."""

    load: Value
    minus: Value
    plus: Value
    low: Array
    high: Array
    low_rate: Array
    high_rate: Array


@dataclass(frozen=True, eq=False)
class PlayBounds:
    """Bounds of z: L = (ℓ − ρ⁺)/a and U = (ℓ + ρ⁻)/a.

    Attributes
    ----------
    load, minus, plus : Panels
        ℓ, ρ⁻ (threshold of downward motion) and ρ⁺ (upward).
    stiffness : float
        a.
    """

    load: Panels
    minus: Panels
    plus: Panels
    stiffness: float

    @property
    def signals(self) -> tuple[Panels, Panels, Panels]:
        """All three."""
        return self.load, self.minus, self.plus

    @property
    def noise(self) -> float:
        """Differences of z that are rounding."""
        return 2.0 * sum(signal.noise for signal in self.signals) / self.stiffness

    def sample(self, t: Array, near: Array) -> Sample:
        """All signals at t, as on the panels that hold `near`."""
        load, minus = self.load.sample(t, near), self.minus.sample(t, near)
        plus = minus if self.plus is self.minus else self.plus.sample(t, near)
        # A threshold that vanishes may be negative by rounding.
        low = load.value - np.maximum(plus.value, 0.0)
        high = load.value + np.maximum(minus.value, 0.0)
        rates = load.rate - plus.rate, load.rate + minus.rate
        low, high, low_rate, high_rate = (bound / self.stiffness for bound in (low, high, *rates))
        return Sample(load, minus, plus, low, high, low_rate, high_rate)

    def pieces(self, start: Array, end: Array) -> tuple[Array, Array]:
        """Chebyshev coefficients of L and U on intervals, each inside one panel of every signal.

        Raises
        ------
        DeclarationError
            If a threshold is negative somewhere.
        """
        load, minus = self.load.pieces(start, end), self.minus.pieces(start, end)
        _refuse_negative(minus, self.minus, "ρ⁻", start, end)
        plus = minus
        if self.plus is not self.minus:
            plus = self.plus.pieces(start, end)
            _refuse_negative(plus, self.plus, "ρ⁺", start, end)
        return _sum(load, -plus) / self.stiffness, _sum(load, minus) / self.stiffness


def _sum(a: Array, b: Array) -> Array:
    """Sum of coefficients of different degrees."""
    total = np.zeros((max(len(a), len(b)), a.shape[1]))
    total[: len(a)] = a
    total[: len(b)] += b
    return total


def _refuse_negative(c: Array, signal: Panels, name: str, start: Array, end: Array) -> None:
    """Check that a threshold is nonnegative, up to rounding.

    Parameters
    ----------
    c : array, shape (degree + 1, intervals)
        Chebyshev coefficients of the threshold.
    signal : Panels
        The threshold.
    name : str
        Name in the message.
    start, end : array, shape (intervals,)
        Times.

    Raises
    ------
    DeclarationError
        If it is negative somewhere.
    """
    rounding = 4.0 * signal.noise
    doubtful = np.flatnonzero(c[0] - np.sum(np.abs(c[1:]), axis=0) < -rounding)
    if not len(doubtful):
        return
    c = c[:, doubtful]
    start = start[doubtful]
    end = end[doubtful]
    panel, x = ch.sign_changes(ch.derivatives(c), rounding)
    panel, x = _with_ends(panel, x, len(doubtful))
    value = ch.values(c[:, panel], x)
    k = int(np.argmin(value))
    if value[k] < -rounding:
        t = _time(x, panel, start, end)[k]
        phase = "" if signal.period is None else f" (phase s = {signal.clock(t):.6g})"
        raise DeclarationError(
            "threshold",
            f"{name} is negative, {value[k]:.6g} at t = {t:.9g}{phase}",
            "Write max(..., 0) around its formula",
        )


def _with_ends(panel: Array, x: Array, count: int) -> tuple[Array, Array]:
    """Places inside panels and both ends of each panel, sorted and distinct."""
    inner = np.flatnonzero(np.abs(x) < 1.0 - 8.0 * ch.EPS)
    inner = inner[np.lexsort((x[inner], panel[inner]))]
    repeated = (np.diff(panel[inner]) == 0) & (np.diff(x[inner]) <= 8.0 * ch.EPS)
    inner = np.delete(inner, np.flatnonzero(repeated))
    behind_start = 2 * panel[inner] + 1
    places = np.insert(np.tile([-1.0, 1.0], count), behind_start, x[inner])
    return np.insert(np.repeat(np.arange(count), 2), behind_start, panel[inner]), places


def _time(x: Array, panel: Array, start: Array, end: Array) -> Array:
    """Times of places in panels; ends are exact."""
    return np.where(x == 1.0, end[panel], start[panel] + 0.5 * (x + 1.0) * (end - start)[panel])


class Nodes(NamedTuple):
    """Times, positions, and the direction of the motion that follows each node (1 up, −1 down, 0 at
    rest).

    A repeated time is a jump.
    """

    time: Array
    z: Array
    mode: Array


class Last(NamedTuple):
    """State at the end of a sequence of panels."""

    low: float
    high: float
    z: float


def play_nodes(bounds: PlayBounds, edges: Array, initial: float) -> Nodes:
    """The play over panels with given edges, from a stable position.

    Raises
    ------
    DeclarationError
        If a threshold is negative somewhere.
    """
    parts = []
    last = Last(np.nan, np.nan, initial)
    for first in range(0, len(edges) - 1, _CHUNK):
        some = edges[first : first + _CHUNK + 1]
        part, last = _walk(bounds, some[:-1], some[1:], last)
        parts.append(part)
    parts.append(Nodes(edges[-1:], np.array([last.z]), np.zeros(1, np.int8)))
    return Nodes(
        np.concatenate([part.time for part in parts]),
        np.concatenate([part.z for part in parts]),
        np.concatenate([part.mode for part in parts]),
    )


def panel_edges(bounds: PlayBounds, start: float, end: float) -> Array:
    """Times between which all signals are polynomials.

    Raises
    ------
    DeclarationError
        If there are too many.
    """
    for signal in bounds.signals:
        expected = len(signal.breaks) * (
            1.0 if signal.period is None else (end - start) / signal.period
        )
        if expected > _MOST_EDGES:
            raise DeclarationError(
                "epsilon",
                f"the span needs {expected:.1e} panels (at most {_MOST_EDGES:.0e})",
                "Use a shorter t_span",
            )
    edges = np.concatenate([[start, end], *(signal.edges(start, end) for signal in bounds.signals)])
    edges = np.sort(edges, kind="stable")
    # Edges of two signals that coincide up to rounding would leave a sliver between them.
    apart = np.diff(edges) > 16.0 * ch.EPS * max(abs(start), abs(end))
    kept = edges[np.concatenate([[True], apart])]
    kept[-1] = end
    return kept


def _walk(bounds: PlayBounds, start: Array, end: Array, last: Last) -> tuple[Nodes, Last]:
    """The play over consecutive panels, continued from its last position; the node at the last end
    is omitted, as it belongs to the next part."""
    noise = bounds.noise
    L, U = bounds.pieces(start, end)
    (p, x), (q, y) = (ch.sign_changes(ch.derivatives(c), 0.125 * noise) for c in (L, U))
    panel, x = _with_ends(np.concatenate([p, q]), np.concatenate([x, y]), len(start))
    low, high = _joined(panel, x, L, U, last, noise)
    z = np.empty(len(x) + 1)
    z[0] = last.z
    clamp_samples(low, high, float(last.z), z[1:])
    # Interval k ends at place k. It lies in one panel, or it is an edge, of no duration, at which z
    # may jump.
    begin = np.concatenate([start[:1], _time(x, panel, start, end)[:-1]])
    inside = np.concatenate([[False], np.diff(panel) == 0])
    step = np.diff(z)
    mode = np.where(np.abs(step) > noise, np.sign(step), 0.0).astype(np.int8)
    kept = np.flatnonzero(inside | (mode != 0))
    split, place = _arrivals(panel, x, L, U, z, np.where(inside, mode, 0), noise)
    at_first = mode.copy()
    at_first[split] = 0
    order = np.argsort(np.concatenate([kept, split]), kind="stable")
    nodes = Nodes(
        np.concatenate([begin[kept], _time(place, panel[split], start, end)])[order],
        np.concatenate([z[kept], z[split]])[order],
        np.concatenate([at_first[kept], mode[split]])[order],
    )
    return nodes, Last(low[-1], high[-1], z[-1])


def _joined(
    panel: Array, x: Array, L: Array, U: Array, last: Last, noise: float
) -> tuple[Array, Array]:
    """L and U at the places; the panels at an edge share one value, unless a bound jumps there.

    Parameters
    ----------
    panel, x : array, shape (places,)
        The panel of each place, and where it is there, in [−1, 1].
    L, U : array, shape (degree + 1, panels)
        Chebyshev coefficients of the bounds.
    last : Last
        Where the panels before ended.
    noise : float
        Differences of z that are rounding.
    """
    gap = _SMALLEST_JUMP * noise
    low, high = ch.values(L[:, panel], x), ch.values(U[:, panel], x)
    high = np.maximum(low, high)
    enters = np.flatnonzero(np.concatenate([[True], np.diff(panel) > 0]))
    before = [
        np.concatenate([[end], bound])[enters]
        for end, bound in ((last.low, low), (last.high, high))
    ]
    smooth = (np.abs(low[enters] - before[0]) <= gap) & (np.abs(high[enters] - before[1]) <= gap)
    low[enters[smooth]], high[enters[smooth]] = before[0][smooth], before[1][smooth]
    return low, high


def _arrivals(
    panel: Array, x: Array, L: Array, U: Array, z: Array, mode: Array, noise: float
) -> tuple[Array, Array]:
    """Intervals in which z rests until a bound reaches it, and the place of this event in the
    panel.

    Parameters
    ----------
    panel, x : array, shape (places,)
        The panel of each place, and where it is there, in [−1, 1].
    L, U : array, shape (degree + 1, panels)
        Chebyshev coefficients of the bounds.
    z : array, shape (places + 1,)
        Positions, the first one before the first place.
    mode : array of int, shape (places,)
        Direction of the motion in the interval that ends at each place; 0 where that is an edge.
    noise : float
        Differences of z that are rounding.
    """
    found = []
    for c, direction in ((L, 1), (U, -1)):
        index = np.flatnonzero(mode == direction)
        distance = direction * (z[index] - ch.values(c[:, panel[index]], x[index - 1]))
        index = index[distance > _SMALLEST_JUMP * noise]
        beyond = c[:, panel[index]]
        beyond[0] -= z[index]
        found.append((index, ch.first_crossings(beyond, x[index - 1], x[index])))
    (i, x), (j, y) = found
    return np.concatenate([i, j]), np.concatenate([x, y])
