"""Axes of a parameter map: names, values, spacing.

An axis is a table: one column of values for each name that it moves. A grid axis, a list,
parameters tied together and a random sample differ only in how the table was made. Texts declare
them, on the command line and in Python alike:

======================================  =====================================================
``0.8:1.6:400``                         400 values from 0.8 to 1.6, evenly spaced
``log:0.01:0.2:300``                    the same, evenly spaced in the logarithm
``1,2,5``                               these values
``0:1:5; 2:3:5`` (names ``P,Q``)        two parameters tied together, value by value
``sobol:1024; 0.8:1.6; log:0.01:0.2``   1024 points of a sequence in a box; also ``halton``,
                                        ``latin``, ``random``
======================================  =====================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.model.system import System
from stickslip.sweeps.request.records import Records
from stickslip.symbolic.expressions import is_number, number
from stickslip.symbolic.formulas import Scope

SAMPLES = ("sobol", "halton", "latin", "random")
_SPACINGS = ("linear", "log", "list", *SAMPLES)
_SAME = 1e-12  # values of two axes that differ by less, relative to the largest, are one value
_MOST_VALUES = 10**8  # largest number of values of an axis
_MOST_POINTS = 10**9  # largest number of points of a map
_FORM = "Write it like 0.8:1.6:400, log:0.01:0.2:300, or 1,2,5"
_SAMPLE_FORM = "Write it like sobol:1024; 0.8:1.6; log:0.01:0.2"


@dataclass(frozen=True, eq=False)
class Axis:
    """One dimension of a map.

    Attributes
    ----------
    names : tuple of str
        Parameters or initial values that vary along it, together.
    values : array, shape (names, points)
    spacing : str
        One of ``linear``, ``log``, ``list`` and the kinds of samples.
    labels : tuple of str
        Names of records; the values are then only their numbers.
    """

    names: tuple[str, ...]
    values: Array
    spacing: str
    labels: tuple[str, ...] = ()

    def __len__(self) -> int:
        return self.values.shape[1]

    @property
    def dimension(self) -> str:
        """Its name as a dimension of the result."""
        return "_".join(self.names)

    @property
    def ordered(self) -> bool:
        """Whether neighbours on the axis are neighbours in its values."""
        steps = np.diff(self.values[0])
        alone = len(self.names) == 1 and not self.labels
        return alone and bool(np.all(steps > 0.0) or np.all(steps < 0.0))

    def positions(self, other: Axis) -> Array:
        """Positions of the values of another axis of the same names on this one; −1 for missing
        values."""
        reach = _SAME * np.maximum(
            np.max(np.abs(self.values), axis=1), np.max(np.abs(other.values), axis=1)
        )
        order = np.argsort(self.values[0], kind="stable")
        sorted_values = self.values[0, order]
        found = np.full(len(other), -1)
        low = np.searchsorted(sorted_values, other.values[0] - reach[0], side="left")
        high = np.searchsorted(sorted_values, other.values[0] + reach[0], side="right")
        for i, (a, b) in enumerate(zip(low, high, strict=True)):
            candidates = order[a:b]
            near = np.all(
                np.abs(self.values[:, candidates] - other.values[:, i, None]) <= reach[:, None],
                axis=0,
            )
            if np.any(near):
                found[i] = candidates[np.argmax(near)]
        return found

    def same_as(self, other: Axis) -> bool:
        """Return whether it has the same names and, up to rounding, the same values in the same
        order."""
        if self.names != other.names or len(self) != len(other):
            return False
        scale = np.max(np.abs(self.values), axis=1, initial=0.0, keepdims=True)
        return bool(np.all(np.abs(self.values - other.values) <= _SAME * scale))


def read_axes(
    system: System,
    over: Mapping[str, Any] | Sequence[str],
    seed: int = 0,
    known: Sequence[str] | None = None,
) -> tuple[Axis, ...]:
    """Read the requested axes, and check their values.

    Parameters
    ----------
    over : mapping or sequence of str
        By name (or by several names, ``"P,Q"``): a text as above, or values (for several names one
        column each); by any name that is free, records. A sequence holds texts ``NAME=VALUES``.
    seed : int
        Seed of the samples.
    known : sequence of str, optional
        Names listed in messages, if not all names that maps accept may vary.

    Raises
    ------
    DeclarationError
        If a text is not an axis, a name is unknown or used twice, or a value is not admissible.
    """
    if not isinstance(over, Mapping):
        over = axes_of_texts(over)
    if not over:
        raise DeclarationError(
            "over", "no axis was given", "Give a parameter and its values, as in P=0.8:1.6:400"
        )
    axes = tuple(_axis(key, given, seed) for key, given in over.items())
    names = [name for axis in axes for name in axis.names]
    for name in names:
        if names.count(name) > 1:
            raise DeclarationError(f"over.{name}", "it varies along two axes", "Give it once only")
    for axis in axes:
        _check_values(system, axis, known)
    system.check_starts(names, "over")
    _check_corners(system, axes)
    if math.prod(len(axis) for axis in axes) > _MOST_POINTS:
        raise DeclarationError(
            "over", f"the map has more than {_MOST_POINTS:,} points", "Use fewer values"
        )
    return axes


def axes_of_texts(texts: Sequence[str]) -> dict[str, str]:
    """Axes by name, of texts ``NAME=VALUES``.

    Raises
    ------
    DeclarationError
        If a text is none, or a name is given twice.
    """
    return dict(_split(text) for text in _once(texts))


def _once(texts: Sequence[str]) -> Sequence[str]:
    keys = [text.partition("=")[0].strip() for text in texts]
    for key in keys:
        if keys.count(key) > 1:
            raise DeclarationError(f"over.{short(key)}", "given twice", "Give it once only")
    return texts


def _split(text: str) -> tuple[str, str]:
    names, equals, values = text.partition("=")
    if not (names.strip() and equals and values.strip()):
        raise DeclarationError(f"over {short(text)}", "not of the form NAME=VALUES", _FORM)
    return names, values


def _axis(key: str, given: Any, seed: int) -> Axis:
    names = tuple(name.strip() for name in str(key).split(","))
    where = f"over.{','.join(names)}"
    if isinstance(given, str):
        return _from_text(names, given, where, seed)
    if isinstance(given, Records):
        if len(names) > 1:
            raise DeclarationError(
                where, "an axis of records has a single name", "Write {'record': records}"
            )
        return Axis(names, given.numbers, "list", tuple(given))
    if isinstance(given, tuple) and len(given) == 3 and type(given[2]) is int:
        low, high, number = given
        raise DeclarationError(
            where,
            f"{given!r} is ambiguous: a range or three values",
            f'Write "{low}:{high}:{number}", or the list [{low}, {high}, {number}]',
        )
    try:
        values = np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(
            where, "its values are not numbers", f"Give numbers, or a string. {_FORM}"
        ) from None
    return _table(names, np.atleast_2d(values), "list", where)


def _from_text(names: tuple[str, ...], text: str, where: str, seed: int) -> Axis:
    parts = [part.strip() for part in text.split(";")]
    kind = parts[0].partition(":")[0].strip()
    if kind in SAMPLES:
        return _sample(names, kind, parts, where, seed)
    if len(parts) not in (1, len(names)):
        raise DeclarationError(
            where,
            f"{len(names)} names, but {len(parts)} lists of values",
            "Give one list for each name",
        )
    columns = [_column(part, where) for part in parts]
    if len({len(values) for values, _ in columns}) > 1:
        lengths = ", ".join(str(len(values)) for values, _ in columns)
        raise DeclarationError(
            where,
            f"the names vary together, but have {lengths} values",
            "Give the same number of values for each",
        )
    values = np.array([values for values, _ in columns] * (len(names) // len(parts)))
    return _table(names, values, columns[0][1], where)


def _column(text: str, where: str) -> tuple[Array, str]:
    """Values of a text, and their spacing."""
    if ":" not in text:
        return np.array([_number(part, where) for part in text.split(",")]), "list"
    low, high, rest, spacing = _interval(text, where, _FORM)
    if len(rest) != 1:
        raise DeclarationError(where, f"'{short(text)}' is not a range", _FORM)
    count = _count(rest[0], where)
    if count == 1 and low != high:
        raise DeclarationError(
            where, "a range needs more than one value", "Give at least 2 values, or the value alone"
        )
    return (np.geomspace if spacing == "log" else np.linspace)(low, high, count), spacing


def _interval(text: str, where: str, form: str) -> tuple[float, float, list[str], str]:
    """Ends, the remaining part, and the spacing of ``[log:]low:high[:…]``."""
    parts = [part.strip() for part in text.split(":")]
    spacing = "log" if parts[0] == "log" else "linear"
    parts = parts[1:] if spacing == "log" else parts
    if len(parts) < 2:
        raise DeclarationError(where, f"'{short(text)}' is not a range", form)
    low, high = (_number(part, where) for part in parts[:2])
    if spacing == "log" and not (low > 0.0 and high > 0.0):
        raise DeclarationError(
            where, f"a logarithmic range from {low:g} to {high:g}", "Give positive ends"
        )
    return low, high, parts[2:], spacing


def _sample(names: tuple[str, ...], kind: str, parts: list[str], where: str, seed: int) -> Axis:
    """Points of a low-discrepancy or random sequence in a box."""
    head = parts[0].split(":")
    if len(head) != 2 or len(parts) != 1 + len(names):
        raise DeclarationError(
            where,
            f"a sample of {len(names)} names needs the number of points and the bounds of "
            "each name",
            _SAMPLE_FORM,
        )
    count = _count(head[1], where)
    values = np.empty((len(names), count))
    for i, (unit, text) in enumerate(
        zip(_unit_sample(kind, len(names), count, seed), parts[1:], strict=True)
    ):
        low, high, rest, spacing = _interval(text, where, _SAMPLE_FORM)
        if rest:
            raise DeclarationError(where, f"'{short(text)}' has too many numbers", _SAMPLE_FORM)
        inside = low * (high / low) ** unit if spacing == "log" else low + (high - low) * unit
        values[i] = np.clip(inside, min(low, high), max(low, high))
    return _table(names, values, kind, where)


def _unit_sample(kind: str, dimensions: int, count: int, seed: int) -> Array:
    """Points of the unit cube, one row for each dimension."""
    from scipy.stats import qmc

    if kind == "random":
        return np.random.default_rng(seed).random((count, dimensions)).T
    make: Callable[..., Any] = {
        "sobol": qmc.Sobol,
        "halton": qmc.Halton,
        "latin": qmc.LatinHypercube,
    }[kind]
    sampler = make(dimensions, rng=seed)
    if kind != "sobol":
        return sampler.random(count).T
    # The first 2^m ≥ count points, cut: SciPy warns of any other number.
    return sampler.random_base2(max(count - 1, 0).bit_length())[:count].T


def _number(text: str, where: str) -> float:
    """A number, or arithmetic with numbers such as ``1/3``."""
    try:
        value = Scope({}).parse(text.strip(), where)
    except DeclarationError:
        value = None
    if value is None or not is_number(value) or not math.isfinite(number(value)):
        raise DeclarationError(where, f"'{short(text)}' is not a number", _FORM)
    return number(value)


def _count(text: str, where: str) -> int:
    text = text.strip()
    if not text.isdecimal() or not 1 <= int(text[:12]) <= _MOST_VALUES:
        reason = f"'{short(text)}' is not a number of points"
        raise DeclarationError(where, reason, f"Give an integer from 1 to {_MOST_VALUES:,}")
    return int(text)


def _table(names: tuple[str, ...], values: Array, spacing: str, where: str) -> Axis:
    if values.ndim != 2 or len(values) != len(names):
        raise DeclarationError(
            where, f"expected one list of values for each of {len(names)} names", _FORM
        )
    if values.shape[1] == 0:
        raise DeclarationError(where, "there are no points", "Give at least one value")
    if not np.all(np.isfinite(values)):
        raise DeclarationError(where, "a value is not a finite number", "Give finite numbers")
    order = np.lexsort(values[::-1])
    twice = np.flatnonzero(np.all(values[:, order[1:]] == values[:, order[:-1]], axis=0))
    if len(twice) and spacing not in SAMPLES:
        again = ", ".join(f"{v:g}" for v in values[:, order[twice[0]]])
        raise DeclarationError(where, f"the value {again} occurs twice", "Give each value once")
    return Axis(names, np.ascontiguousarray(values), spacing)


def _check_values(system: System, axis: Axis, known: Sequence[str] | None) -> None:
    """Reject names that cannot vary and values outside a parameter's range."""
    declaration = system.declaration
    taken = {*system.parameters, *declaration.state, *system.drives}
    if axis.labels and (name := axis.names[0]) in taken:
        remedy = "Use another name for the axis, such as record"
        raise DeclarationError(f"over.{name}", f"the name is already used in {system.name}", remedy)
    for name, column in zip(axis.names, axis.values, strict=True):
        if axis.labels:
            continue
        if name in system.parameters:
            # the admissible set is an interval
            for value in (float(np.min(column)), float(np.max(column))):
                declaration.check_range(name, value)
        elif not system.start_slope(name, "over"):
            listed = [*system.parameters, *system.starts] if known is None else known
            raise DeclarationError(
                f"over.{short(name)}",
                "unknown parameter or part of the state",
                suggestion(name, listed),
            )


def _check_corners(system: System, axes: Sequence[Axis]) -> None:
    """Reject corners of the box at which mass or damping would not be positive definite."""
    ends = [sorted({0, len(axis) - 1}) for axis in axes]
    for corner in product(*ends):
        values = {
            name: float(axis.values[row, i])
            for axis, i in zip(axes, corner, strict=True)
            for row, name in enumerate(axis.names)
            if name in system.parameters
        }
        system.declaration.check_parameters({**system.values, **values})


@dataclass(frozen=True)
class Grid:
    """The points of a map: all combinations of the values of its axes, in C order, and the chunks
    they are stored in.

    Attributes
    ----------
    chunk : tuple of int
        Points of a chunk along each axis.
    """

    axes: tuple[Axis, ...]
    chunk: tuple[int, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(axis) for axis in self.axes)

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    def chunks(self) -> Iterator[tuple[int, ...]]:
        """Indices of all chunks."""
        counts = [-(-n // c) for n, c in zip(self.shape, self.chunk, strict=True)]
        return product(*(range(count) for count in counts))

    def region(self, chunk: tuple[int, ...]) -> tuple[slice, ...]:
        """Region of the points of a chunk."""
        return tuple(
            slice(i * c, min((i + 1) * c, n))
            for i, c, n in zip(chunk, self.chunk, self.shape, strict=True)
        )

    def columns(self, region: tuple[slice, ...], inside: Array) -> dict[str, Array]:
        """Values of all varying names, at chosen points of a region.

        Parameters
        ----------
        inside : array of int
            Positions of the points in the region, in C order.
        """
        shape = tuple(part.stop - part.start for part in region)
        indices = np.unravel_index(inside, shape)
        return {
            name: axis.values[row, part.start + index]
            for axis, part, index in zip(self.axes, region, indices, strict=True)
            for row, name in enumerate(axis.names)
        }


_CHUNK_POINTS = 4096  # number of points of the largest chunks
FEWEST = 64  # number of points of the smallest chunks that justify a file
_PARTS = 64  # number of chunks of a map of medium size


def make_grid(axes: Sequence[Axis], lines: Sequence[int] = ()) -> Grid:
    """The grid of some axes; its chunks are nearly cubic, and each belongs to one record.

    Parameters
    ----------
    lines : sequence of int, optional
        Axes along which points need each other, and so are divided last; of two of them the second
        is that of the directions.
    """
    chunk = [len(axis) for axis in axes]
    target = min(_CHUNK_POINTS, max(FEWEST, math.prod(chunk) // _PARTS))
    for k in [*lines[1:], *(k for k, axis in enumerate(axes) if axis.labels)]:
        chunk[k] = 1
    while math.prod(chunk) > target:
        others = [k for k in range(len(chunk)) if k not in lines and chunk[k] > 1]
        longest = max(others or range(len(chunk)), key=chunk.__getitem__)
        chunk[longest] = -(-chunk[longest] // 2)
    return Grid(tuple(axes), tuple(chunk))
