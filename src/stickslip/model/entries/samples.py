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

import hashlib
import math
import zlib
from base64 import b64decode, b64encode
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.kept import cached_property
from stickslip.model.entries.polynomials import LIVING, NEAR_SAMPLE, PiecewisePolynomial, derived
from stickslip.model.entries.units import check_unit
from stickslip.model.formats.columns import columns_of, is_strong_motion, strong_motion_of
from stickslip.numerics.levels import WHOLE_COUNT
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import TimeFunction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


SampleKind = Literal["linear", "cubic", "hold"]
SAMPLE_KINDS: tuple[SampleKind, ...] = ("linear", "cubic", "hold")
_LISTED = 50  # number of samples up to which a model file lists them
_EVEN = 0.9  # fraction of equal steps above which a record is regarded as equidistant
_ALIKE = 0.01  # relative difference of equal steps
_GAP = 1.5  # number of steps above which samples are missing
_STORED = 200_000  # … and up to which it stores them
_MOST_NOISE = 50_000_000  # largest number of samples
_FINEST = 1e-12  # smallest distance of two samples relative to the largest time


class Samples(TimeFunction):
    """A function of time given by samples.

    Parameters
    ----------
    times : array, shape (m,)
        Increasing, at least two.
    values : array, shape (m,)
    kind : {"linear", "cubic", "hold"}
        Interpolation: piecewise linear, a cubic spline (not-a-knot at the ends, or periodic), or
        the value of the previous sample.
    periodic : bool
        Whether the function has the period ``times[-1] - times[0]``; the last value must equal the
        first.
    where : str
        Name of the input in error messages.
    source : mapping, optional
        The ``file`` and the names of its columns ``time`` and ``value``.
    unit : str
        Unit of the values, such as ``"m/s^2"``; empty if it is not declared, so that nothing is
        compared with it.

    Raises
    ------
    DeclarationError
        If the times are not increasing numbers, a value is not finite, there are fewer than two
        samples, the last value of a periodic function differs from the first, or the unit cannot
        be parsed.

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
        source: Mapping[str, Any] | None = None,
        unit: str = "",
    ) -> None:
        if kind not in SAMPLE_KINDS:
            raise DeclarationError(
                f"{where}, kind",
                f"unknown kind '{short(str(kind))}'",
                suggestion(str(kind), SAMPLE_KINDS, '"'),
            )
        t, y = checked(times, values, where)
        if periodic and kind != "hold" and y[0] != y[-1]:
            raise DeclarationError(
                where,
                f"periodic samples must end with the first value, but they begin with {y[0]:.9g} "
                f"and end with {y[-1]:.9g}",
                "Repeat the first value at the end of the period",
            )
        t.flags.writeable = y.flags.writeable = False
        self.times: Array = t
        self.values: Array = y
        self.kind: SampleKind = kind
        self.periodic: bool = bool(periodic)
        self.source: dict[str, Any] = dict(source or {})
        self.unit: str = check_unit(unit, f"{where}, unit")

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
        unit: str = "",
        gaps: bool = False,
    ) -> Samples:
        """Read samples from two columns of a text file.

        Parameters
        ----------
        file : path
            Columns separated by commas, semicolons, tabs or blanks, with a header line of names;
            lines that begin with # are skipped. Or a strong-motion record in PEER format, with the
            suffix .AT2, .VT2 or .DT2, whose times begin at 0.
        time, value : str
            Names of the columns. By default, the times are in the column ``time`` or ``t``, and the
            values in the column named `name` or ``value``, or else in the only other one.
        kind, periodic, unit
            As in :class:`Samples`.
        name : str
            Name of the values, such as that of a drive.
        gaps : bool
            Whether samples at otherwise constant steps may have gaps, which are then interpolated.
            Values that are held (``kind="hold"``) may have gaps in any case.

        Raises
        ------
        DeclarationError
            If the file cannot be read, a column is missing, or an entry is invalid; the message
            names the row, the column and the remedy.
        """
        if is_strong_motion(file):
            t, y = strong_motion_of(file)
            source = {"file": str(file)}
            return cls(t, y, kind, periodic, where=str(file), source=source, unit=unit)
        t, y, rows, (time, value) = columns_of(file, time, value, name)
        try:
            checked(t, y, str(file))
        except WrongRow as error:
            raise error.in_file(str(file), int(rows[error.index]), (time, value)) from None
        source: dict[str, Any] = {"file": str(file), "time": time, "value": value}
        if gaps:
            source["gaps"] = True
        elif kind != "hold":
            _check_gaps(t, str(file))
        return cls(t, y, kind, periodic, where=str(file), source=source, unit=unit)

    # -- what they are -----------------------------------------------------------------------------

    def __repr__(self) -> str:
        return f"<Samples {self.digest}: {self}>"

    def __str__(self) -> str:
        first, last = self.span
        repeats = ", periodic" if self.periodic else ""
        unit = f", in {self.unit}" if self.unit else ""
        count = f"{len(self.times):,} samples"
        return f"{count} from {first:.6g} to {last:.6g}, {self.kind}{repeats}{unit}"

    def plot(self, ax: Axes | None = None) -> Figure:
        """Plot the samples and their interpolation over time.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Existing axes to draw into.

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
        again = self.times, self.values, self.kind, self.periodic, self.source, self.unit
        return _again, again

    @cached_property
    def digest(self) -> str:
        """Hash of the content."""
        content = hashlib.sha256(f"{self.kind} {self.periodic} {self.unit}".rstrip().encode())
        for part in (self.times, self.values):
            content.update(np.ascontiguousarray(part).data)
        return content.hexdigest()[:16]

    @property
    def span(self) -> tuple[float, float]:
        """From the first to the last sample."""
        return float(self.times[0]), float(self.times[-1])

    @property
    def period(self) -> float:
        """Period; 0 if not periodic."""
        return self.span[1] - self.span[0] if self.periodic else 0.0

    def covers(self, start: float, stop: float) -> bool:
        """Whether the samples cover a time span."""
        first, last = self.span
        near = NEAR_SAMPLE * max(abs(first), abs(last))
        return self.periodic or (first - near <= start and stop <= last + near)

    @cached_property
    def pieces(self) -> PiecewisePolynomial:
        """The interpolating polynomials; equal samples share them."""
        name = f"samples_{self.digest}"
        found = LIVING.get(name)
        if found is None:
            found = LIVING[name] = _pieces(self, name)
        return found

    def count(self, start: float, stop: float) -> int:
        """Maximum number of samples in a span."""
        periods = math.ceil((stop - start) / self.period) + 1 if self.periodic else 1
        return periods * (len(self.times) + 1)

    def plain(self) -> dict[str, Any]:
        """Plain data for a model file: few numbers as lists, many as one string (Base64 of
        compressed floating-point numbers), very many by file and digest."""
        found: dict[str, Any] = {"kind": self.kind} if self.kind != "linear" else {}
        found |= {"periodic": True} if self.periodic else {}
        found |= {"unit": self.unit} if self.unit else {}
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
        """Samples from the plain data of a model file.

        Parameters
        ----------
        table : mapping
            With ``file`` (relative to the folder), ``time``, ``value`` and ``gaps``; or ``times``
            and ``values``; or ``packed``. Optionally with ``kind``, ``periodic`` and the ``unit``
            of the values.
        where : str
            The key, for messages.
        folder : path
        name : str
            Name of the values, as in :meth:`read`.

        Raises
        ------
        DeclarationError
        """
        ways = (("file", "time", "value", "gaps"), ("times", "values"), ("packed",), ("digest",))
        way = next((w for w in ways if w[0] in table), None)
        if way is None:
            raise DeclarationError(
                where,
                "the source of the samples is missing",
                'Write it like {file = "base.csv", time = "t", value = "a"}',
            )
        known = {*way, "kind", "periodic", "unit", "digest"}
        for key in table:
            if key not in known:
                raise DeclarationError(f"{where}.{key}", "unknown key", suggestion(key, known))
        kind = table.get("kind", "linear")
        periodic = table.get("periodic", False)
        if not isinstance(periodic, bool):
            raise DeclarationError(f"{where}.periodic", "not true or false", "Write true or false")
        unit = unit_entry(table, where)
        if way[0] == "file":
            file, time, value = (table.get(key, "") for key in way[:3])
            gaps = table.get("gaps", False)
            if not isinstance(gaps, bool):
                raise DeclarationError(f"{where}.gaps", "not true or false", "Write true or false")
            if not all(isinstance(part, str) for part in (file, time, value)):
                raise DeclarationError(where, "a name is not a string", 'Write it like time = "t"')
            found = cls.read(
                folder / file, time, value, kind, periodic, name=name, unit=unit, gaps=gaps
            )
        elif way[0] == "times":
            t, y = table["times"], table.get("values", ())
            found = cls(t, y, kind, periodic, where=where, unit=unit)
        elif way[0] == "packed":
            t, y = _unpacked(table["packed"], where)
            found = cls(t, y, kind, periodic, where=where, unit=unit)
        else:
            raise DeclarationError(
                where,
                "these samples were too many to be stored",
                "Read them from a file, so that they can be loaded again",
            )
        if table.get("digest", found.digest) != found.digest:
            raise DeclarationError(
                where,
                "the file has changed since the result was stored",
                "Restore the original file",
            )
        return found

    def __call__(self, t: ArrayLike) -> Any:
        """Values at times; NaN outside the range of the samples. At a jump, the later value."""
        pieces = self.pieces
        k, u = pieces.place(np.asarray(t, dtype=float), "gate")
        found = np.zeros(np.shape(u))
        for c in pieces.coefficients.T[::-1]:
            found = found * u + c[k]
        return found if np.ndim(t) else float(found)

    def at(self, t: Expr) -> Expr:
        """The interpolated value, as an expression, at an argument that increases with time."""
        rows = self.pieces.rows()
        even, odd, gate = (rows[side] for side in ("even", "odd", "gate"))
        return ex.select(ex.call(gate, t), ex.call(even, t), ex.call(odd, t))


@validated
def noise(
    span: tuple[float, float],
    period: float,
    deviation: float = 1.0,
    *,
    seed: int,
    kind: SampleKind = "linear",
    unit: str = "",
) -> Samples:
    """Create noise for a drive: independent normal samples at equidistant times, interpolated in
    between.

    The noise is not white: with dry friction, a motion under white noise depends on the
    discretisation. The spectrum is that of the interpolation `kind`, flat up to about a quarter of
    1/period, and the motion is as exact as for any record. To check the dependence on the period,
    halve it and divide the deviation by √2.

    Parameters
    ----------
    span : (float, float)
        Time span covered by the samples.
    period : float
        Time between the samples.
    deviation : float
        Standard deviation of the samples.
    seed : int
        Seed of NumPy's generator: equal seeds give equal noise on every machine.
    kind : {"linear", "cubic", "hold"}
        Interpolation between the samples.
    unit : str
        Unit of the values.

    Returns
    -------
    Samples

    Raises
    ------
    DeclarationError
        If an argument is out of range.

    Examples
    --------
    >>> import stickslip as ss
    >>> noise = ss.noise((0.0, 100.0), 0.01, 0.2, seed=1)
    >>> len(noise.times), noise.span
    (10001, (0.0, 100.0))
    """
    start, end = span
    if not (np.isfinite([start, end]).all() and start < end):
        raise DeclarationError("span", f"({start:g}, {end:g}) is empty", "Give (start, end)")
    if not 0.0 < period < np.inf:
        raise DeclarationError(
            "period", f"{period:g} is not a positive number", "Give a positive number"
        )
    if not 0.0 <= deviation < np.inf:
        raise DeclarationError("deviation", f"{deviation:g} is negative", "Give a number >= 0")
    if not seed >= 0:
        raise DeclarationError("seed", f"{seed} is negative", "Give an integer >= 0")
    steps = np.ceil((end - start) / period * (1.0 - WHOLE_COUNT))
    if steps > _MOST_NOISE:
        reason = f"it would need {steps:.3g} samples (at most {_MOST_NOISE:,})"
        raise DeclarationError("period", reason, "Increase it, or shorten the span")
    times = start + period * np.arange(int(max(steps, 1.0)) + 1)
    values = deviation * np.random.default_rng(seed).standard_normal(len(times))
    return Samples(times, values, kind, where="noise", unit=unit)


def _again(
    t: Array, y: Array, kind: SampleKind, periodic: bool, source: dict[str, str], unit: str = ""
) -> Samples:
    """Samples that another process reads."""
    return Samples(t, y, kind, periodic, source=source, unit=unit)


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
            float(np.polynomial.polynomial.polyval(half, derived(c[k], j))) / at[j]
            for j in range(c.shape[1])
        ]
        t = np.insert(t, k + 1, t[k] + half)
        c = np.insert(c, k + 1, moved, axis=0)
    return PiecewisePolynomial(
        name, np.ascontiguousarray(t), np.ascontiguousarray(c), samples.period, unit=samples.unit
    )


# -- reading ---------------------------------------------------------------------------------------


def _check_gaps(times: Array, where: str) -> None:
    """Refuse a record of even steps in which samples are missing."""
    steps = np.diff(times)
    step = float(np.median(steps))
    wide = np.flatnonzero(steps > _GAP * step)
    even = np.mean(np.abs(steps - step) <= _ALIKE * step)
    if not len(wide) or even < _EVEN:
        return
    k = int(wide[0])
    more = f", and {len(wide) - 1} more gaps" if len(wide) > 1 else ""
    raise DeclarationError(
        where,
        f"the time step is {step:.6g}, but there is no sample between {times[k]:.9g} and "
        f"{times[k + 1]:.9g}{more}",
        "Fill the gap, or interpolate it with gaps=True (in a model file gaps = true, --gaps for "
        "many records)",
    )


def unit_entry(table: Mapping[str, Any], where: str) -> str:
    """The unit of the values, as a model file has it."""
    unit = table.get("unit", "")
    if not isinstance(unit, str):
        raise DeclarationError(f"{where}.unit", "not a string", 'Write it like unit = "m/s^2"')
    return check_unit(unit, f"{where}.unit")


class WrongRow(DeclarationError):
    """A mistake in one row of samples, or of a table.

    Attributes
    ----------
    column : int
        0 for times or other arguments, 1 for values.
    """

    def __init__(
        self, where: str, name: str, index: int, column: int, reason: str, remedy: str
    ) -> None:
        super().__init__(f"{where}, {name}[{index}]", reason, remedy)
        self.index = index
        self.column = column

    def in_file(self, file: str, row: int, names: tuple[str, str]) -> DeclarationError:
        """The error with the file, the line and the column."""
        place = f"{file}, line {row}, column '{short(names[self.column])}'"
        return DeclarationError(place, self.reason, self.remedy)


def checked(times: Any, values: Any, where: str, argument: str = "time") -> tuple[Array, Array]:
    """Times and values as new arrays; `argument` is the name of the times, if they are not times.

    Raises
    ------
    DeclarationError
    """
    several = f"{argument}s"
    t, y = (_numbers(part, f"{where}, {n}") for part, n in ((times, several), (values, "values")))
    if t.ndim != 1 or y.ndim != 1 or len(t) != len(y) or len(t) < 2:
        raise DeclarationError(
            where,
            f"{t.size} {several} and {y.size} values",
            "Give two lists of the same length, with at least 2 entries",
        )
    for column, part in enumerate((t, y)):
        finite = np.isfinite(part)
        if not finite.all():
            k = int(np.argmin(finite))
            name = (several, "values")[column]
            raise WrongRow(
                where,
                name,
                k,
                column,
                f"{part[k]} is not a number",
                "Fill it, or delete the row",
            )
    check_increasing(t, where, argument)
    return t, y


def check_increasing(t: Array, where: str, argument: str) -> None:
    """Reject times, or other arguments, that do not increase.

    Raises
    ------
    DeclarationError
    """
    several = f"{argument}s"
    later = np.diff(t) > 0.0
    if not later.all():
        k = int(np.argmin(later)) + 1
        same = t[k] == t[k - 1]
        what = "occurs twice" if same else f"comes after {t[k - 1]:.9g}"
        remedy = "Keep one of the two rows" if same else f"Sort the rows by {argument}"
        raise WrongRow(where, several, k, 0, f"the {argument} {t[k]:.9g} {what}", remedy)
    close = np.diff(t) > _FINEST * np.max(np.abs(t))
    if not close.all():
        k = int(np.argmin(close)) + 1
        raise WrongRow(
            where,
            several,
            k,
            0,
            f"the {several} {t[k - 1]!r} and {t[k]!r} are too close to each other",
            f"Shift {argument} so that the first sample is at 0",
        )


def _unpacked(text: object, where: str) -> tuple[Array, Array]:
    """Times and values of a packed text."""
    try:
        content = zlib.decompressobj().decompress(
            b64decode(str(text), validate=True), 16 * _STORED + 1
        )
        t, y = np.frombuffer(content, "<f8").astype(float).reshape(2, -1)
    except (ValueError, zlib.error):
        raise DeclarationError(
            where, "the packed samples are damaged", "Write the file again"
        ) from None
    return t, y


def _numbers(part: Any, where: str) -> Array:
    try:
        return np.array(part, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(where, "they are not all numbers", "Give numbers") from None
