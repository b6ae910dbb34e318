"""Functions of time that are given by samples.

Between two samples such a function is a polynomial: a constant (`hold`), a straight line or a
cubic. It is what other functions with kinks are (:mod:`stickslip.symbolic.pieces`): a select on the
sign of a *gate*, which changes at every sample, between the polynomial of the nearest even and that
of the nearest odd piece, each continued beyond its ends. So a motion stops exactly at every sample
at which a derivative jumps, and its steps are exact in between. In a piece from l to r the gate is
±(t − l)(r − t)/(r − l), which has slope ±1 at both ends, and is continuous, so that its zeros are
the samples.

Which piece is meant beside a sample, where a time is known to rounding only, is decided by the
parity; the gate takes the piece that begins there, since time goes forward.
"""

from __future__ import annotations

import csv
import hashlib
import math
import weakref
import zlib
from base64 import b64decode, b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import TYPE_CHECKING, Any, Literal
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.kept import cached_property
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import TimeFunction
from stickslip.symbolic.functions import ARGUMENT, FUNCTIONS, Function

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.machine_code.objects import Provider
    from stickslip.symbolic.intervals import Interval

SampleKind = Literal["linear", "cubic", "hold"]
SAMPLE_KINDS: tuple[SampleKind, ...] = ("linear", "cubic", "hold")
_LISTED = 50  # samples that a model file lists
_STORED = 200_000  # … and that it holds
_FINEST = 1e-12  # part of the largest time that two samples are apart at least
_NEAR = 16.0 * 2.3e-16  # part of it within which a time is that of a sample


class Samples(TimeFunction):
    """A function of time that is known at some times.

    Parameters
    ----------
    times : array, shape (m,)
        Increasing, at least two.
    values : array, shape (m,)
    kind : {"linear", "cubic", "hold"}
        What it is in between: straight lines, the cubic spline (not-a-knot at the ends, or
        periodic), or the value of the sample before.
    periodic : bool
        Whether it repeats after ``times[-1] - times[0]``; its last value is its first, then.
    where : str
        How errors call it.
    source : mapping, optional
        The ``file`` and the names of its columns ``time`` and ``value``.

    Raises
    ------
    DeclarationError
        If the times are no increasing numbers, a value is not finite, there are fewer than two, or
        a periodic function ends elsewhere than it begins.

    Examples
    --------
    >>> import stickslip as ss
    >>> base = ss.Samples([0.0, 1.0, 3.0], [0.0, 2.0, 0.0])
    >>> base(2.0)
    1.0
    """

    @validated
    def __init__(
        self,
        times: ArrayLike,
        values: ArrayLike,
        kind: SampleKind = "linear",
        periodic: bool = False,
        *,
        where: str = "samples",
        source: Mapping[str, str] | None = None,
    ) -> None:
        if kind not in SAMPLE_KINDS:
            raise DeclarationError(
                f"{where}, kind",
                f"there is no kind '{short(str(kind))}'",
                suggestion(str(kind), SAMPLE_KINDS, '"'),
            )
        t, y = checked(times, values, where)
        if periodic and kind != "hold" and y[0] != y[-1]:
            raise DeclarationError(
                where,
                f"they begin with {y[0]:.9g} and end with {y[-1]:.9g}, but are to be periodic",
                "Repeat the first value at the end of the period",
            )
        t.flags.writeable = y.flags.writeable = False
        self.times: Array = t
        self.values: Array = y
        self.kind: SampleKind = kind
        self.periodic: bool = bool(periodic)
        self.source: dict[str, str] = dict(source or {})

    @classmethod
    @validated
    def read(
        cls,
        file: str | PathLike[str],
        time: str = "",
        value: str = "",
        kind: SampleKind = "linear",
        periodic: bool = False,
        *,
        name: str = "",
    ) -> Samples:
        """Samples of two columns of a text file.

        Parameters
        ----------
        file : path
            Columns that commas, semicolons, tabs or blanks separate, with a line of names. Lines
            that begin with # are left out.
        time, value : str
            Names of the columns. By default the times are in the column called ``time`` or ``t``,
            the values in that called by the `name`, or ``value``, or else in the only other one.
        kind, periodic
            As of :class:`Samples`.
        name : str
            What the values are, such as the name of a drive.

        Raises
        ------
        DeclarationError
            If it cannot be read, has no such columns, or something in them is wrong; the message
            names the row, the column and the remedy.
        """
        t, y, rows, (time, value) = columns_of(file, time, value, name)
        try:
            checked(t, y, str(file))
        except _At as error:
            raise error.in_file(str(file), int(rows[error.index]), (time, value)) from None
        source = {"file": str(file), "time": time, "value": value}
        return cls(t, y, kind, periodic, where=str(file), source=source)

    # -- what they are -----------------------------------------------------------------------------

    def __repr__(self) -> str:
        return f"<Samples {self.digest}: {self}>"

    def __str__(self) -> str:
        first, last = self.span
        repeats = ", periodic" if self.periodic else ""
        return f"{len(self.times):,} samples from {first:.6g} to {last:.6g}, {self.kind}{repeats}"

    def plot(self, ax: Axes | None = None) -> Figure:
        """Their values over time, with what is between them.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Draw into these axes of a figure of yours.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from stickslip.figures.samples import plot_samples

        return plot_samples(self, ax)

    def _repr_html_(self) -> str:
        from stickslip import page
        from stickslip.display.system_page import samples_page

        return samples_page(self, page.drawn(self.plot))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Samples) and other.digest == self.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.times, self.values, self.kind, self.periodic, self.source)

    @cached_property
    def digest(self) -> str:
        """A name for their content."""
        content = hashlib.sha256(f"{self.kind} {self.periodic}".encode())
        for part in (self.times, self.values):
            content.update(np.ascontiguousarray(part).data)
        return content.hexdigest()[:16]

    @property
    def span(self) -> tuple[float, float]:
        """From the first to the last sample."""
        return float(self.times[0]), float(self.times[-1])

    @property
    def period(self) -> float:
        """After which they repeat; 0 if they do not."""
        return self.span[1] - self.span[0] if self.periodic else 0.0

    def covers(self, start: float, stop: float) -> bool:
        """Whether they say something of all times in a span."""
        first, last = self.span
        near = _NEAR * max(abs(first), abs(last))
        return self.periodic or (first - near <= start and stop <= last + near)

    @cached_property
    def pieces(self) -> PiecewisePolynomial:
        """Their polynomials, which equal samples share."""
        name = f"samples_{self.digest}"
        found = _alive.get(name)
        if found is None:
            found = _alive[name] = _pieces(self, name)
        return found

    def count(self, start: float, stop: float) -> int:
        """How many of them are in a span, at most."""
        periods = math.ceil((stop - start) / self.period) + 1 if self.periodic else 1
        return periods * (len(self.times) + 1)

    def plain(self) -> dict[str, Any]:
        """What a model file says of them: a few as lists, many as one text (Base64 of compressed
        floating-point numbers), very many by their file and digest."""
        found: dict[str, Any] = {"kind": self.kind} if self.kind != "linear" else {}
        found |= {"periodic": True} if self.periodic else {}
        if len(self.times) <= _LISTED:
            return {"times": self.times.tolist(), "values": self.values.tolist(), **found}
        if len(self.times) <= _STORED:
            content = np.stack([self.times, self.values]).astype("<f8").tobytes()
            return {"packed": b64encode(zlib.compress(content)).decode(), **found}
        return {**self.source, **found, "digest": self.digest}

    @classmethod
    def from_plain(
        cls, table: Mapping[str, Any], where: str, folder: Path = Path(), name: str = ""
    ) -> Samples:
        """Samples of what a model file says.

        Parameters
        ----------
        table : mapping
            With ``file`` (relative to the folder), ``time`` and ``value``; or ``times`` and
            ``values``; or ``packed``. With ``kind`` and ``periodic`` if they are not linear or
            repeat.
        where : str
            The key, for messages.
        folder : path
        name : str
            What the values are, as in :meth:`read`.

        Raises
        ------
        DeclarationError
        """
        ways = (("file", "time", "value"), ("times", "values"), ("packed",), ("digest",))
        way = next((w for w in ways if w[0] in table), None)
        if way is None:
            raise DeclarationError(
                where,
                "it says of no samples where they are",
                'Write it like {file = "base.csv", time = "t", value = "a"}',
            )
        known = {*way, "kind", "periodic", "digest"}
        for key in table:
            if key not in known:
                raise DeclarationError(f"{where}.{key}", "unknown key", suggestion(key, known))
        kind = table.get("kind", "linear")
        periodic = table.get("periodic", False)
        if not isinstance(periodic, bool):
            raise DeclarationError(f"{where}.periodic", "not true or false", "Write true or false")
        if way[0] == "file":
            file, time, value = (table.get(key, "") for key in way)
            if not all(isinstance(part, str) for part in (file, time, value)):
                raise DeclarationError(where, "a name is no text", 'Write it like time = "t"')
            found = cls.read(folder / file, time, value, kind, periodic, name=name)
        elif way[0] == "times":
            found = cls(table["times"], table.get("values", ()), kind, periodic, where=where)
        elif way[0] == "packed":
            found = cls(*_unpacked(table["packed"], where), kind, periodic, where=where)
        else:
            raise DeclarationError(
                where,
                "these samples are so many that they were not stored",
                "Read them from a file, so that it can be found again",
            )
        if table.get("digest", found.digest) != found.digest:
            raise DeclarationError(where, "the file has changed since", "Bring back what it was")
        return found

    def __call__(self, t: ArrayLike) -> Any:
        """Values at times; NaN outside of what they cover. At a jump, the later one."""
        pieces = self.pieces
        k, u = pieces.place(np.asarray(t, dtype=float), "gate")
        found = np.zeros(np.shape(u))
        for c in pieces.coefficients.T[::-1]:
            found = found * u + c[k]
        return found if np.ndim(t) else float(found)

    def at(self, t: Expr) -> Expr:
        """Their value as an expression of an expression that increases with time."""
        rows = self.pieces.rows()
        even, odd, gate = (rows[side] for side in ("even", "odd", "gate"))
        return ex.select(ex.call(gate, t), ex.call(even, t), ex.call(odd, t))


def _again(t: Array, y: Array, kind: SampleKind, periodic: bool, source: dict[str, str]) -> Samples:
    """Samples that another process reads."""
    return Samples(t, y, kind, periodic, source=source)


# -- polynomials -----------------------------------------------------------------------------------

_alive: WeakValueDictionary[str, PiecewisePolynomial] = WeakValueDictionary()


@dataclass(frozen=True, eq=False)
class PiecewisePolynomial:
    """A function piece by piece.

    Attributes
    ----------
    name : str
    breaks : array, shape (m + 1,)
    coefficients : array, shape (m, d + 1)
        Of the powers of what is left of a place from the beginning of its piece.
    period : float
    """

    name: str
    breaks: Array
    coefficients: Array
    period: float

    @cached_property
    def largest(self) -> float:
        """The largest break, by its absolute value."""
        return float(np.max(np.abs(self.breaks)))

    def near(self, x: Array) -> Array:
        """How well places are known: a place in a late period as its time is, so no better than
        to a rounding error of all the periods before it."""
        return _NEAR * np.maximum(np.abs(x) if self.period > 0.0 else 0.0, self.largest)

    @cached_property
    def gates(self) -> Array:
        """Coefficients of the gates; none closes at the ends of all samples, where nothing
        changes."""
        length = np.diff(self.breaks)
        sense = np.where(np.arange(len(length)) % 2 == 0, 1.0, -1.0)
        gates = np.stack([np.zeros(len(length)), sense, -sense / length], axis=1)
        if self.period == 0.0:
            gates[0] = 1.0, -1.0 / length[0], 0.0  # (r − t)/(r − l)
            gates[-1] = 0.0, sense[-1], 0.0
            if len(length) == 1:
                gates[0] = 1.0, 0.0, 0.0
        return gates

    def table(self, side: str) -> Array:
        """The coefficients on a side: of the gates, or the values."""
        return self.gates if side == "gate" else self.coefficients

    def place(self, x: Array, side: str) -> tuple[Array, Array]:
        """Which piece stands for x on a side, and what is left of x from its beginning."""
        b, m = self.breaks, len(self.breaks) - 1
        near = self.near(x)
        if self.period > 0.0:
            x = x - np.floor((x - b[0]) / self.period) * self.period
        else:
            x = np.where((x <= b[-1] + near) & (x >= b[0] - near), x, np.nan)
        i = np.clip(np.searchsorted(b, x, side="right") - 1, 0, m - 1)
        if side == "gate":
            k = np.where(b[i + 1] - x <= near, i + 1, i)
        else:
            other = np.where(x - b[i] < b[i + 1] - x, i - 1, i + 1)
            k = np.where(i % 2 == (0 if side == "even" else 1), i, other)
        if self.period > 0.0:
            x = np.where(k == m, x - self.period, np.where(k < 0, x + self.period, x))
            k = k % m
        else:
            inner = m - 1 if side == "gate" else max(m - 2, 0)
            k = np.where(k == m, inner, np.where(k < 0, min(1, m - 1), k))
        return k, x - b[k]

    def values(self, x: Array, side: str, order: int) -> Array:
        """Derivatives of an order."""
        with np.errstate(invalid="ignore"):
            k, u = self.place(np.asarray(x, float), side)
            factors = self.factors(side, order)
            skipped = self.table(side).shape[1] - len(factors)
            total = 0.0 * u
            for j in range(len(factors) - 1, -1, -1):
                total = total * u + self.table(side)[k, skipped + j] * factors[j]
        return total

    def factors(self, side: str, order: int) -> list[float]:
        """What the coefficients of a derivative are multiplied with."""
        width = self.table(side).shape[1]
        return [float(math.perm(j + order, order)) for j in range(width - order)]

    def rows(self) -> dict[str, str]:
        """By side the name of the row of the table of functions, which is put there."""
        _ = self._provider
        return {side: self.row_name(side, 0) for side in ("even", "odd", "gate")}

    def row_name(self, side: str, order: int) -> str:
        """Name of a derivative on a side."""
        return f"{self.name}_{side}{order}"

    @cached_property
    def _provider(self) -> Provider:
        """The machine code of the rows, which are in the table of functions as long as this
        exists."""
        from stickslip.machine_code.tabulated import provide_table

        called = {}
        for side in ("even", "odd", "gate"):
            for order in range(self.table(side).shape[1]):
                row = TableRow(pieces=self, side=side, order=order)
                FUNCTIONS[row.name] = row
                called[row.name] = side, self.factors(side, order)
        weakref.finalize(self, _remove, self.name, list(called)).atexit = False
        return provide_table(called, self.breaks, self.coefficients, self.gates, self.period, _NEAR)

    def bounds(self, a: Interval, side: str, order: int) -> Interval:
        """Least and largest value of a derivative between two places, over the pieces themselves
        and not what is beyond them; of arrays of such, too."""
        low, high = (np.asarray(end, float) for end in a)
        pairs = zip(low.flat, high.flat, strict=True)
        ends = [self._bounds_between(float(x), float(y), side, order) for x, y in pairs]
        found = np.array(ends).reshape(*low.shape, 2)
        return (found[..., 0], found[..., 1]) if low.ndim else (float(found[0]), float(found[1]))

    def _bounds_between(self, low: float, high: float, side: str, order: int) -> Interval:
        b, m = self.breaks, len(self.breaks) - 1
        first, last = float(b[0]), float(b[-1])
        least, largest = self._extremes(side, order)
        if self.period > 0.0 and not high - low < self.period:
            return float(least.min()), float(largest.max())
        if self.period > 0.0:
            turns = math.floor((low - first) / self.period) * self.period
            low, high = low - turns, high - turns
            if high > last:
                parts = [(low, last), (first, high - self.period)]
                ends = [self._bounds_between(x, y, side, order) for x, y in parts]
                return min(e[0] for e in ends), max(e[1] for e in ends)
        if math.isnan(low) or math.isnan(high):
            return -math.inf, math.inf
        i, j = (int(np.clip(np.searchsorted(b, x, "right") - 1, 0, m - 1)) for x in (low, high))
        inner = slice(i + 1, j)
        found = [self._on_piece(k, low, high, side, order) for k in {i, j}]
        if j > i + 1:
            found.append((float(least[inner].min()), float(largest[inner].max())))
        return min(e[0] for e in found), max(e[1] for e in found)

    def _on_piece(self, k: int, low: float, high: float, side: str, order: int) -> Interval:
        """Bounds on a part of one piece, by its ends and where its slope vanishes."""
        start, end = float(self.breaks[k]), float(self.breaks[k + 1])
        x, y = (min(max(place, start), end) - start for place in (low, high))
        c = _derived(self.table(side)[k], order)
        turning = [float(r.real) for r in np.roots(_derived(c, 1)[::-1]) if x < r.real < y]
        values = [float(np.polynomial.polynomial.polyval(u, c)) for u in (x, y, *turning)]
        size = sum(abs(float(a)) * max(abs(x), abs(y)) ** n for n, a in enumerate(c))
        slack = 1e-15 * size
        return min(values) - slack, max(values) + slack

    def _extremes(self, side: str, order: int) -> tuple[Array, Array]:
        """Bounds on every piece, by Bernstein coefficients."""
        key = side == "gate", order
        if key not in self._known:
            table = self.table(side)
            factors = self.factors(side, order)
            length = np.diff(self.breaks)
            d = len(factors) - 1
            scaled = [table[:, order + j] * (factors[j] * length**j) for j in range(d + 1)]
            ends = [
                sum(
                    (math.comb(i, j) / math.comb(d, j) * scaled[j] for j in range(1, i + 1)),
                    scaled[0],
                )
                for i in range(d + 1)
            ]
            slack = 1e-15 * sum(np.abs(part) for part in scaled)
            low = np.minimum.reduce(ends) - slack
            self._known[key] = low, np.maximum.reduce(ends) + slack
        return self._known[key]

    @cached_property
    def _known(self) -> dict[tuple[bool, int], tuple[Array, Array]]:
        return {}


def _remove(name: str, rows: list[str]) -> None:
    """Take rows whose samples are gone out of the table of functions."""
    from stickslip.machine_code.objects import withdraw

    if name not in _alive:
        for row in rows:
            FUNCTIONS.pop(row, None)
        withdraw(rows)


def _derived(c: Array, order: int) -> Array:
    """Coefficients of a derivative."""
    for _ in range(order):
        c = np.arange(1, len(c)) * c[1:] if len(c) > 1 else np.zeros(1)
    return c


def _pieces(samples: Samples, name: str) -> PiecewisePolynomial:
    t, y = samples.times, samples.values
    length = np.diff(t)
    if samples.kind == "hold":
        c = y[:-1, None].copy()
    elif samples.kind == "linear":
        c = np.stack([y[:-1], np.diff(y) / length], axis=1)
    else:
        from scipy.interpolate import CubicSpline

        ends = "periodic" if samples.periodic else "not-a-knot"
        c = np.ascontiguousarray(CubicSpline(t, y, bc_type=ends).c[::-1].T)
    if samples.periodic and len(c) % 2 == 1:
        # Parities alternate all around the period if the longest piece is made of two.
        k = int(np.argmax(length))
        half = 0.5 * length[k]
        at = [math.perm(j, j) for j in range(c.shape[1])]
        moved = [
            float(np.polynomial.polynomial.polyval(half, _derived(c[k], j))) / at[j]
            for j in range(c.shape[1])
        ]
        t = np.insert(t, k + 1, t[k] + half)
        c = np.insert(c, k + 1, moved, axis=0)
    return PiecewisePolynomial(
        name, np.ascontiguousarray(t), np.ascontiguousarray(c), samples.period
    )


class TableRow(Function):
    """A derivative of a table on one side, as a row of the table of functions."""

    def __init__(self, pieces: PiecewisePolynomial, side: str, order: int) -> None:
        least, largest = pieces._extremes(side, order)
        super().__init__(
            name=pieces.row_name(side, order),
            value=lambda x: float(self.pieces.values(np.array(x), side, order)),
            derivative="",
            limits=(float(least.min()), float(largest.max())),
            period=pieces.period,
            within=f"{pieces.period!r}*wrap(x/{pieces.period!r})" if pieces.period else "",
            typed=f"{pieces.name}(x)",
        )
        object.__setattr__(self, "table", pieces.name)
        object.__setattr__(self, "side", side)
        object.__setattr__(self, "order", order)

    table: str
    side: str
    order: int

    @property
    def pieces(self) -> PiecewisePolynomial:
        """Its table, which belongs to the samples: expressions that somebody remembers do not keep
        it.

        Raises
        ------
        ReferenceError
            If they are gone.
        """
        found = _alive.get(self.table)
        if found is None:
            raise ReferenceError(f"{self.table}: these samples are gone")
        return found

    @cached_property
    def array(self) -> Any:
        """The function of arrays."""
        return lambda x: self.pieces.values(np.asarray(x, float), self.side, self.order)

    @cached_property
    def slope(self) -> Expr:
        """The next derivative."""
        if self.order + 1 == self.pieces.table(self.side).shape[1]:
            return ex.ZERO
        return ex.call(self.pieces.row_name(self.side, self.order + 1), ex.sym(ARGUMENT))

    @cached_property
    def shown_slope(self) -> Expr:
        """The same."""
        return self.slope

    @property
    def sampled(self) -> bool:
        """Whether it is a gate."""
        return self.side == "gate"

    @property
    def jumps(self) -> bool:
        """From piece to piece."""
        return True

    def enclosed(self, a: Interval) -> Interval:
        """What its values lie in, exactly."""
        return self.pieces.bounds(a, self.side, self.order)


# -- reading ---------------------------------------------------------------------------------------


class _At(DeclarationError):
    """A mistake in one row of samples.

    Attributes
    ----------
    index : int
    column : int
        0 for times, 1 for values.
    """

    def __init__(self, where: str, index: int, column: int, reason: str, remedy: str) -> None:
        name = ("times", "values")[column]
        super().__init__(f"{where}, {name}[{index}]", reason, remedy)
        self.index = index
        self.column = column

    def in_file(self, file: str, row: int, names: tuple[str, str]) -> DeclarationError:
        """The same, said of a file."""
        place = f"{file}, line {row}, column '{short(names[self.column])}'"
        return DeclarationError(place, self.reason, self.remedy)


def checked(times: Any, values: Any, where: str) -> tuple[Array, Array]:
    """Times and values as arrays of their own.

    Raises
    ------
    DeclarationError
    """
    t, y = (_numbers(part, f"{where}, {n}") for part, n in ((times, "times"), (values, "values")))
    if t.ndim != 1 or y.ndim != 1 or len(t) != len(y) or len(t) < 2:
        raise DeclarationError(
            where,
            f"{t.size} times and {y.size} values",
            "Give as many times as values, at least 2 of each, in a row",
        )
    for column, part in enumerate((t, y)):
        finite = np.isfinite(part)
        if not finite.all():
            k = int(np.argmin(finite))
            raise _At(
                where, k, column, f"{part[k]} is not a number", "Leave the row out, or fill it"
            )
    later = np.diff(t) > 0.0
    if not later.all():
        k = int(np.argmin(later)) + 1
        same = t[k] == t[k - 1]
        what = "stands twice" if same else f"comes after {t[k - 1]:.9g}"
        remedy = "Keep one of the two rows" if same else "Sort the rows by time"
        raise _At(where, k, 0, f"the time {t[k]:.9g} {what}", remedy)
    close = np.diff(t) > _FINEST * np.max(np.abs(t))
    if not close.all():
        k = int(np.argmin(close)) + 1
        raise _At(
            where,
            k,
            0,
            f"the times {t[k - 1]!r} and {t[k]!r} are too close to be told apart",
            "Count time from the first sample",
        )
    return t, y


def _unpacked(text: object, where: str) -> tuple[Array, Array]:
    """Times and values of a packed text."""
    try:
        content = zlib.decompressobj().decompress(
            b64decode(str(text), validate=True), 16 * _STORED + 1
        )
        t, y = np.frombuffer(content, "<f8").astype(float).reshape(2, -1)
    except (ValueError, zlib.error):
        raise DeclarationError(
            where, "the packed samples are damaged", "Write the file once more"
        ) from None
    return t, y


def _numbers(part: Any, where: str) -> Array:
    try:
        return np.array(part, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(where, "not all of them are numbers", "Give numbers") from None


_MOST_BYTES = 2_000_000_000
_SEPARATORS = (",", ";", "\t", None)


def columns_of(
    file: str | PathLike[str], time: str, value: str, name: str = ""
) -> tuple[Array, Array, Any, tuple[str, str]]:
    """Two columns of a text file, in which line of it each row stands, and how they are called.

    Names that are not given are found, see :meth:`Samples.read`.

    Raises
    ------
    DeclarationError
    """
    where = file_named(file)
    lines = lines_of(file)
    numbers = [i for i, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    if not numbers:
        raise DeclarationError(where, "the file is empty", "Give columns with a line of names")
    heading = lines[numbers[0]]
    separator = separator_of(heading)
    names = [cell.strip() for cell in cells_in(heading, separator)]
    wanted = _chosen(names, time, value, name, f"{where}, line {numbers[0] + 1}")
    places = [names.index(column) for column in wanted]
    rows = numbers[1:]
    columns = np.empty((2, len(rows)))
    for k, i in enumerate(rows):
        cells = cells_in(lines[i], separator)
        check_cells(cells, names, f"{where}, line {i + 1}")
        for column, place in enumerate(places):
            cell = cells[place].strip() if place < len(cells) else ""
            try:
                columns[column, k] = float(cell)
            except ValueError:
                raise DeclarationError(
                    f"{where}, line {i + 1}, column '{short(wanted[column])}'",
                    f"'{short(cell)}' is not a number" if cell else "there is no value",
                    DECIMAL_POINTS if "," in cell else "Leave the row out, or fill it",
                ) from None
    return columns[0], columns[1], np.array(rows) + 1, wanted


DECIMAL_POINTS = "Save the file with decimal points, like 0.5"


def check_cells(cells: Sequence[str], names: Sequence[str], where: str) -> None:
    """Refuse a row with more cells than there are names: which belong to which is not known.

    Raises
    ------
    DeclarationError
    """
    if len(cells) > len(names) and any(cell.strip() for cell in cells[len(names) :]):
        reason = f"it has {len(cells)} cells, and there are {len(names)} names of columns"
        remedy = f"{DECIMAL_POINTS}, and one name for each column"
        raise DeclarationError(where, reason, remedy)


def file_named(file: str | PathLike[str]) -> str:
    """A file, for a message; of a path that is too long, the beginning."""
    return str(file) if len(str(file)) <= 200 else short(str(file))


def lines_of(file: str | PathLike[str]) -> list[str]:
    """Lines of a text file.

    Raises
    ------
    DeclarationError
        If it cannot be read, or is no text in UTF-8.
    """
    path = Path(file)
    where = file_named(file)
    try:
        status = path.stat()
        if not S_ISREG(status.st_mode):
            what = "a directory" if S_ISDIR(status.st_mode) else "no file that has an end"
            raise DeclarationError(where, f"this is {what}", "Name a file of columns")
        if status.st_size > _MOST_BYTES:
            raise DeclarationError(
                where, f"the file has more than {_MOST_BYTES:,} bytes", "Give fewer samples"
            )
        text = path.read_bytes()
    except FileNotFoundError:
        raise DeclarationError(where, "there is no such file", "Check the path") from None
    except (OSError, ValueError) as error:  # the second: no path at all
        raise DeclarationError(
            where,
            f"the file cannot be read ({getattr(error, 'strerror', None) or error})",
            "Check its name and its rights",
        ) from None
    if b"\x00" in text[:4096]:
        raise DeclarationError(
            where, "this is no text file", "Save it as text: columns with a line of names"
        )
    try:
        return text.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        row = text.count(b"\n", 0, error.start) + 1
        raise DeclarationError(where, f"line {row} is not UTF-8 text", "Save it as UTF-8") from None


def separator_of(heading: str) -> str | None:
    """What stands between the columns of a table with this line of names; None: blanks."""
    return next((s for s in _SEPARATORS if s is None or s in heading), None)


def _chosen(names: list[str], time: str, value: str, own: str, where: str) -> tuple[str, str]:
    """The columns of times and of values: those that are named, or those that can be meant."""
    for name in (time, value):
        if name and name not in names:
            known = suggestion(name, names, "'")
            raise DeclarationError(where, f"there is no column '{short(name)}'", known)
    if not (time and value) and all(map(_is_number, names)):
        raise DeclarationError(
            where, "there are numbers where names of columns should be", "Let it begin with: t,a"
        )
    time = time or next((name for name in ("time", "t") if name in names and name != value), "")
    others = [name for name in names if name != time]
    value = value or next((name for name in (own, "value") if name and name in others), "")
    if time and not value and len(others) == 1:
        value = others[0]
    if not (time and value):
        missing = "values" if time else "times"
        raise DeclarationError(
            where,
            f"which column has the {missing} is not clear: there are {short(', '.join(names))}",
            'Say it, as in {file = "base.csv", time = "t", value = "a"}',
        )
    return time, value


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def cells_in(line: str, separator: str | None) -> list[str]:
    """Cells of a line of a table."""
    if '"' in line and separator is not None:
        return next(csv.reader([line], delimiter=separator))
    return line.split(separator)
