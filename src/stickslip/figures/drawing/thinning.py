"""Long motions on few pixels: the extremes and the fractions of the modes in every pixel column,
and each piece of a curve once.

A page is about a thousand pixels wide; a motion may have millions of steps. The number of plotted
points is bounded, without a visible difference from plotting all: M4 aggregation (Jugel, Jerzak,
Hackenbroich and Markl, *M4: a visualization-oriented time series data aggregation*, Proc. VLDB
Endow. 7 (2014) 797-808) for lines, colours averaged over time for phases, and for curves in the
plane one piece for all pieces between the same pixels.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.transforms import Transform

from stickslip.arrays import Array

COLUMNS = 2000  # number of columns of a time axis
FEW = 20 * COLUMNS  # number of samples up to which all are drawn
_FEW_PHASES = COLUMNS // 4
PIXELS = 1024  # pixels per side of a plane
MOST_PIECES = 100_000  # largest number of pieces of a curve


class Columns:
    """First, smallest, largest and last value of quantities in each column of a time axis,
    collected incrementally.

    Parameters
    ----------
    start, end : float
        Ends of the axis.
    """

    def __init__(self, start: float, end: float) -> None:
        self.start = start
        self.end = end
        self.width: float = end - start or 1.0
        self._kept: dict[str, Array] = {}

    def absorb(self, t: Array, values: Mapping[str, Array]) -> None:
        """Add values at times in ascending order."""
        column = np.minimum((COLUMNS * ((t - self.start) / self.width)).astype(int), COLUMNS - 1)
        firsts = np.flatnonzero(np.diff(column, prepend=-1))
        lasts = np.append(firsts[1:], len(t)) - 1
        where = column[firsts]
        for name, v in values.items():
            first, low, high, last = self._kept.setdefault(name, np.full((4, COLUMNS), np.nan))
            first[where] = np.where(np.isnan(first[where]), v[firsts], first[where])
            low[where] = np.fmin(low[where], np.minimum.reduceat(v, firsts))
            high[where] = np.fmax(high[where], np.maximum.reduceat(v, firsts))
            last[where] = v[lasts]

    def lines(self) -> tuple[Array, dict[str, Array]]:
        """Times and values of a line for each quantity: four points per column, in increasing
        columns the minimum before the maximum."""
        times = self.start + (self.end - self.start) * (np.arange(4 * COLUMNS) + 0.5) / (
            4 * COLUMNS
        )
        times[0], times[-1] = self.start, self.end
        known = np.ones(len(times), bool)
        values = {}
        for name, (first, low, high, last) in self._kept.items():
            rising = first <= last
            line = np.column_stack(
                [first, np.where(rising, low, high), np.where(rising, high, low), last]
            ).ravel()
            known &= ~np.isnan(line)
            values[name] = line
        return times[known], {name: line[known] for name, line in values.items()}


def chosen(time: Array, most: int) -> Array:
    """Numbers of the sampled steps between given times: all, or a number of consecutive ones in
    each column."""
    steps = len(time) - 1
    if steps <= most:
        return np.arange(steps)
    edges = np.linspace(time[0], time[-1], COLUMNS, endpoint=False)
    begin = np.maximum(np.searchsorted(time, edges, side="right") - 1, 0)
    end = np.minimum(begin + most // COLUMNS, np.append(begin[1:] + 1, steps))
    return np.unique(np.concatenate([np.arange(i, j) for i, j in zip(begin, end, strict=True)]))


def thin(t: Array, values: Mapping[str, Array]) -> tuple[Array, dict[str, Array]]:
    """Times and values for lines: all, or four points for each column of the axis."""
    if len(t) <= FEW:
        return t, dict(values)
    columns = Columns(float(t[0]), float(t[-1]))
    columns.absorb(t, values)
    return columns.lines()


def strip(
    axes: Axes,
    time: Array,
    phases: Mapping[str, Array],
    low: float = 0.0,
    high: float = 1.0,
    transform: Transform | None = None,
    zorder: float = 0.0,
) -> None:
    """Colour a strip by mutually exclusive conditions.

    Parameters
    ----------
    time : array, shape (steps + 1,)
    phases : mapping of colour to array of bool, shape (steps,)
        On which steps the condition of that colour holds.
    low, high : float
        The strip, in data coordinates or in those of `transform`.
    """
    runs = {colour: _runs(holds) for colour, holds in phases.items()}
    transform = axes.transData if transform is None else transform
    if sum(map(len, runs.values())) <= _FEW_PHASES:
        for colour, edges in ((colour, edges) for colour, edges in runs.items() if len(edges)):
            begins = time[edges[:, 0]]
            spans = np.column_stack([begins, time[edges[:, 1]] - begins])
            axes.broken_barh(
                spans,  # type: ignore[arg-type]
                (low, high - low),
                color=colour,
                lw=0,
                transform=transform,
                zorder=zorder,
            )
        return
    edges = np.linspace(time[0], time[-1], COLUMNS + 1)
    shares = np.array([_shares(time, holds, edges) for holds in phases.values()])
    total = np.sum(shares, axis=0)
    mixed = np.array([to_rgb(colour) for colour in phases]).T @ (
        shares / np.where(total > 0.0, total, 1.0)
    )
    image = np.vstack([mixed, np.minimum(total, 1.0)]).T[None]
    extent = (float(time[0]), float(time[-1]), low, high)
    axes.imshow(image, aspect="auto", extent=extent, transform=transform, zorder=zorder)


def _runs(holds: Array) -> Array:
    """First step, and last step plus one, of each run in which a condition holds; shape (runs,
    2)."""
    return np.flatnonzero(
        np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8))
    ).reshape(-1, 2)


def _shares(time: Array, holds: Array, edges: Array) -> Array:
    """Exact fraction of each column in which a condition on steps holds."""
    sums = np.concatenate([[0.0], np.cumsum(np.where(holds, np.diff(time), 0.0))])
    return np.clip(np.diff(np.interp(edges, time, sums)) / np.diff(edges), 0.0, 1.0)


class Curve:
    """A curve in the plane with moving and resting parts, collected incrementally.

    Parameters
    ----------
    whole : bool
        Keep all of it; else every piece once, up to the size of a pixel.
    x, y : array
        Some of its points, for the size of a pixel.
    """

    def __init__(self, whole: bool, x: Array, y: Array) -> None:
        self.whole = whole
        self.origin: Array = np.array([np.min(x), np.min(y)])
        self.size: Array = np.array([np.ptp(x), np.ptp(y)])
        self._parts: list[Array] = []
        self._spots: list[Array] = []
        self._count = 0

    def absorb(self, x: Array, y: Array, rests: Array, joined: Array) -> None:
        """Add points in their order.

        Parameters
        ----------
        rests : array of bool
            Which points belong to a resting part.
        joined : array of bool
            Which points are joined to the next one (one fewer).
        """
        self._spots.append(self._standing(x, y, rests))
        if self.whole:
            self._parts.append(np.column_stack([x, y, rests]))
            return
        pixel = self._pixel(x, y)
        kind = rests[:-1] & rests[1:]
        i = np.flatnonzero(joined & ((x[1:] != x[:-1]) | (y[1:] != y[:-1])))
        i = i[_first(pixel[i], pixel[i + 1], kind[i])]
        self._parts.append(np.column_stack([x[i], y[i], x[i + 1], y[i + 1], kind[i]]))
        self._count += len(self._parts[-1])
        if self._count > 4 * MOST_PIECES:
            self._merge()

    def points(self) -> tuple[Array, Array, Array]:
        """x, y and whether they rest, with NaN where the line breaks."""
        if self.whole:
            x, y, rests = np.vstack(self._parts).T
            return x, y, rests > 0.0
        pieces = self._merge()
        gap = np.full(len(pieces), np.nan)
        x = np.column_stack([pieces[:, 0], pieces[:, 2], gap]).ravel()
        y = np.column_stack([pieces[:, 1], pieces[:, 3], gap]).ravel()
        return x, y, np.repeat(pieces[:, 4] > 0.0, 3)

    def spots(self) -> tuple[Array, Array]:
        """Points at which the curve rests, one for each pixel, where the line reduces to a
        point."""
        x, y = np.vstack(self._spots).T
        _, first = np.unique(self._pixel(x, y), return_index=True)
        return x[first], y[first]

    def _pixel(self, x: Array, y: Array, pixels: int = PIXELS) -> Array:
        """Pixel numbers, below 2²⁸; points far outside are moved to the edge."""
        places = (
            ((np.nan_to_num(v) - low) * (pixels / (size or 1.0)) + 7 * pixels)
            .clip(0, 16 * pixels - 1)
            .astype(np.int64)
            for v, low, size in zip((x, y), self.origin, self.size, strict=True)
        )
        column, row = places
        return column * (16 * pixels) + row

    def _merge(self) -> Array:
        """Distinct pieces; with larger pixels if they are still too many, except the outermost
        ones."""
        pieces = np.vstack(self._parts)
        pixels = PIXELS
        while True:
            begin, end = (self._pixel(pieces[:, i], pieces[:, i + 1], pixels) for i in (0, 2))
            outermost = [
                extreme(pieces[:, i]) for i in (0, 1) for extreme in (np.argmin, np.argmax)
            ]
            pieces = pieces[np.union1d(_first(begin, end, pieces[:, 4] > 0.0), outermost)]
            if len(pieces) <= MOST_PIECES or pixels == 1:
                break
            pixels //= 2
        self._parts = [pieces]
        self._count = len(pieces)
        return pieces

    def _standing(self, x: Array, y: Array, rests: Array) -> Array:
        """Points in whose neighbourhood the curve rests."""
        runs = _runs(rests)
        if not len(runs):
            return np.zeros((0, 2))
        places = runs.ravel()[: -1 if runs[-1, 1] == len(x) else None]
        ranges = [np.maximum.reduceat(v, places) - np.minimum.reduceat(v, places) for v in (x, y)]
        still = np.all(np.column_stack(ranges)[::2] <= 0.01 * self.size, axis=1)
        return np.column_stack([x, y])[runs[still, 0]]


def _first(begin: Array, end: Array, kind: Array) -> Array:
    """The first of all pieces of a kind with the same first and last pixel."""
    _, first = np.unique(2 * ((begin << 28) + end) + kind, return_index=True)
    return first
