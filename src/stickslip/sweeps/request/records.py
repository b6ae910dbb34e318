"""Records that drive a system, as an axis of a map.

With an axis of scales, the fraction of records that exceed a limit as a function of the scale is an
incremental dynamic analysis (D. Vamvatsikos, C. A. Cornell, *Earthq. Eng. Struct. Dyn.* 31 (2002)
491-514).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stickslip.arguments import validated
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.kept import cached_property
from stickslip.model.entries.samples import SampleKind, Samples
from stickslip.model.entries.units import with_unit
from stickslip.model.formats.columns import ENDINGS
from stickslip.model.formats.expected import entry_key
from stickslip.model.names import check_covered, parts_left_out
from stickslip.model.system import Parameter, System
from stickslip.symbolic.formulas import parse_signature

if TYPE_CHECKING:
    import xarray

SCALE = "scale"
"""What an axis is called that multiplies records, where the system has no such parameter."""
_RECORDED = "_recorded"  # suffix of the name of the record of a drive that is scaled
_TABLES = (".csv", ".tsv", ".txt", ".dat")


class Records(Mapping[str, Mapping[str, Samples]]):
    """Named records, each of which drives a system once.

    Parameters
    ----------
    records : mapping of str to Samples, or to mapping of str to Samples
        For each name the record of the only drive of a system, or records of several drives by
        their names, such as two components of a ground motion.

    Raises
    ------
    DeclarationError
        If there are no records, two are identical, or they drive different inputs.

    Examples
    --------
    >>> import stickslip as ss
    >>> pulses = {f"{T} s": ss.Samples([0, T, 9], [1, 0, 0], kind="hold") for T in (0.2, 0.4)}
    >>> ss.Records(pulses)
    <Records: 2, '0.2 s' to '0.4 s', 9 long>
    """

    @validated
    def __init__(self, records: Mapping[str, Any]) -> None:
        self._records: dict[str, dict[str, Samples]] = {}
        for name, given in records.items():
            parts = given if isinstance(given, Mapping) else {"": given}
            for drive, samples in parts.items():
                if not isinstance(samples, Samples):
                    reason = f"expected Samples, got {type(samples).__name__}"
                    where = f"records.{short(str(name))}" + (f".{drive}" if drive else "")
                    raise DeclarationError(where, reason, "Write ss.Samples(times, values)")
            self._records[str(name)] = dict(parts)
        if not self._records or not all(self._records.values()):
            raise DeclarationError("records", "no records were given", "Give at least one record")
        self._check()

    @classmethod
    @validated
    def read(
        cls,
        folder: str | PathLike[str],
        drives: str | Sequence[str] = (),
        *,
        time: str = "",
        value: str = "",
        kind: SampleKind = "linear",
        factor: float = 1.0,
        peak: float | None = None,
        pattern: str = "",
        gaps: bool = False,
    ) -> Records:
        """Read the records from the files of a folder, named after the files, in alphabetical
        order.

        Parameters
        ----------
        folder : path
        drives : str or sequence of str, optional
            Names of the driven inputs; by default the only drive of the system. If there are
            several, each file has a column named after each of them.
        time, value, kind
            As in :meth:`Samples.read`, which reads the files.
        factor : float
            Factor by which all values are multiplied, such as 9.81 if they are in units of g and
            the system uses m/s².
        peak : float, optional
            If given, each record is scaled to this largest absolute value (over all its
            components); the scale of a map is then the peak.
        pattern : str
            Pattern of file names, such as ``"*_h1.csv"``; by default all tables (.csv, .tsv, .txt,
            .dat) and all records in the format of PEER (.AT2, .VT2, .DT2).
        gaps : bool
            Whether gaps are allowed: missing samples where all others are evenly spaced. They are
            bridged by the interpolation.

        Raises
        ------
        DeclarationError
            If there is no such folder, or no record in it, or one of them is wrong: empty, without
            the columns, with values that are not numbers, times that do not increase, or gaps. The
            message names the file, the row and the remedy.
        """
        if not math.isfinite(factor) or factor == 0.0:
            raise DeclarationError(
                "factor", f"{factor!r} is not a nonzero number", "Give a nonzero number"
            )
        if peak is not None and not (0.0 < peak < math.inf and factor == 1.0):
            reason = (
                f"{peak!r} is not a positive number"
                if factor == 1.0
                else "both a factor and a peak are given"
            )
            raise DeclarationError("peak", reason, "Give a positive peak, or a factor only")
        names = (drives,) if isinstance(drives, str) else tuple(drives)
        if len(names) > 1 and value:
            raise DeclarationError("value", "several drives have one column each", "Remove it")
        found: dict[str, dict[str, Samples]] = {}
        files = _files(Path(folder), pattern)
        stems = [file.stem for file in files]
        for file in files:
            name = file.stem if stems.count(file.stem) == 1 else file.name
            parts = {
                drive: _read(file, time, value if len(names) < 2 else drive, kind, drive, gaps)
                for drive in names or ("",)
            }
            found[name] = _scaled(parts, factor, peak, str(file))
        return cls(found)

    def __getitem__(self, name: str) -> Mapping[str, Samples]:
        return self._records[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._records)

    def __len__(self) -> int:
        return len(self._records)

    def __hash__(self) -> int:
        return hash(self.digests)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Records) and self._records == other._records

    def __repr__(self) -> str:
        names = list(self)
        ends = dict.fromkeys(f"{length:g}" for length in (min(self.durations), max(self.durations)))
        between = " to ".join(dict.fromkeys(f"'{name}'" for name in (names[0], names[-1])))
        return f"<Records: {len(self)}, {between}, {' to '.join(ends)} long>"

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the driven inputs; an empty name is the only drive of a system."""
        return tuple(next(iter(self._records.values())))

    @property
    def durations(self) -> list[float]:
        """Duration of each record."""
        return [stop - start for start, stop in map(_span, self._records.values())]

    @cached_property
    def digests(self) -> tuple[str, ...]:
        """Hash of each record."""
        found: list[str] = []
        for parts in self._records.values():
            content = "".join(samples.digest for samples in parts.values())
            found.append(hashlib.sha256(content.encode()).hexdigest())
        return tuple(found)

    @cached_property
    def numbers(self) -> Array:
        """Coordinate of each record on an axis: a number between 0 and 1 derived from its content,
        by which a map recognises it in any position; shape (1, records)."""
        return np.array([[int(digest[:13], 16) / 16.0**13 for digest in self.digests]])

    def _check(self) -> None:
        """Reject records of different kinds, and duplicates."""
        names = list(self)
        first = self.drives
        for name, parts in self._records.items():
            if tuple(parts) != first:
                there, here = (", ".join(p) or "the only drive" for p in (first, parts))
                reason = f"it drives {here}, but '{names[0]}' drives {there}"
                raise DeclarationError(
                    f"records.{short(name)}", reason, "Use the same drives for all records"
                )
            if len({samples.ends for samples in parts.values()}) > 1 or (
                _ends(parts) != _ends(self._records[names[0]])
            ):
                reason = "some records are periodic, and some end"
                raise DeclarationError(f"records.{short(name)}", reason, "Use one kind")
            _span(parts, name)
        for i, digest in enumerate(self.digests):
            if digest in self.digests[:i]:
                again = names[self.digests.index(digest)]
                reason = f"it is identical to '{again}'"
                raise DeclarationError(
                    f"records.{short(names[i])}", reason, "Give each record once"
                )


class Under(NamedTuple):
    """A system driven by a record.

    Attributes
    ----------
    drives : tuple of (str, Samples)
        By the keys of the system.
    """

    drives: tuple[tuple[str, Samples], ...]
    span: tuple[float, float]

    def of(self, base: System) -> System:
        """The system under the record."""
        return replace(base, drives={**base.drives, **dict(self.drives)}, span=self.span)


@dataclass(frozen=True, eq=False)
class Driven:
    """A system driven by each of several records.

    Attributes
    ----------
    base : System
        The system, with a factor of the records if the scale varies.
    keys : dict of str to str
        Drive of the base for each part of a record.
    span : (float, float), optional
        Of all motions; by default the time of each record.
    """

    base: System
    records: Records
    keys: Mapping[str, str]
    span: tuple[float, float] | None = None

    def under(self, number: float) -> Under:
        """The system under the record with a given number on the axis."""
        place = int(np.argmin(np.abs(self.records.numbers[0] - number)))
        return self._under(list(self.records)[place])

    def _under(self, name: str) -> Under:
        parts = self.records[name]
        span = self.span or (_span(parts) if _ends(parts) else self.base.span)
        drives = tuple((self.keys[part], samples) for part, samples in parts.items())
        return Under(drives, span)

    @property
    def first(self) -> System:
        """The system under the first record."""
        return self._under(next(iter(self.records))).of(self.base)

    def check(self) -> None:
        """Reject a span that a record does not cover.

        Raises
        ------
        DeclarationError
        """
        for name, parts in self.records.items() if self.span else ():
            try:
                check_covered({part or name: s for part, s in parts.items()}, *self.span or (0, 0))
            except DeclarationError as error:
                remedy = "Shorten the span, or give longer records"
                raise DeclarationError(f"records.{short(name)}", error.reason, remedy) from None

    def left_out(self) -> list[str]:
        """Description of the parts of the records outside the given span."""
        if self.span is None:
            return []
        cut = [
            name
            for name, parts in self.records.items()
            if parts_left_out({name: next(iter(parts.values()))}, *self.span, "")
        ]
        if not cut:
            return []
        longest = max((_span(self.records[name])[1], name) for name in cut)
        runs, begun, ends = (with_unit(t, self.base.time_unit) for t in (longest[0], *self.span))
        count = f"{len(cut)} of {len(self.records)} records are longer than the motions"
        return [f"{count}, from {begun} to {ends}: '{longest[1]}' runs to {runs}"]


def record_axis(data: xarray.Dataset) -> str:
    """The axis of records of a map; empty if there is none."""
    dimensions = map(str, data["outcome"].dims)
    return next((d for d in dimensions if d in data.coords and data[d].dtype.kind in "OUT"), "")


def read_records(
    system: System,
    over: Mapping[str, Any] | Sequence[str],
    span: tuple[float, float] | None,
) -> Driven | None:
    """Read the axes of records of a map; None if there are none.

    Parameters
    ----------
    over : mapping or sequence
        The axes.
    span : (float, float), optional
        Of all motions.

    Raises
    ------
    DeclarationError
        If there are two axes of records, or no such drive.
    """
    given = over if isinstance(over, Mapping) else {}
    axes = [(key, records) for key, records in given.items() if isinstance(records, Records)]
    if not axes:
        return None
    if len(axes) > 1:
        names = " and ".join(str(key) for key, _ in axes)
        raise DeclarationError("over", f"{names} are records", "Combine them into one axis")
    ((_, records),) = axes
    declared = {parse_signature(key, "drives")[0]: key for key in system.drives}
    keys = {part: _drive(part, declared, system.name) for part in records.drives}
    base = system
    varied = {name.strip() for key in given for name in str(key).split(",")}
    if SCALE in varied and SCALE not in {*system.parameters, *system.declaration.state}:
        base, keys = _with_scale(system, keys)
    driven = Driven(base, records, keys, span)
    driven.check()
    return driven


def _drive(part: str, declared: Mapping[str, str], system: str) -> str:
    """The key of the drive for a part of a record."""
    if part in declared:
        return declared[part]
    if not part and len(declared) == 1:
        return next(iter(declared.values()))
    known = ", ".join(declared) or "none"
    if not part:
        reason = f"{system} has {len(declared)} drives, and the recorded one is ambiguous"
        raise DeclarationError("records", reason, f"Choose one with drives= or --drive: {known}")
    raise DeclarationError(
        f"records.{short(part)}", f"unknown drive of {system}", suggestion(part, declared)
    )


def _with_scale(system: System, keys: Mapping[str, str]) -> tuple[System, dict[str, str]]:
    """The system with a parameter that multiplies its drives, and the keys of these."""
    drives: dict[str, Any] = {}
    moved: dict[str, str] = {}
    for key, drive in system.drives.items():
        parts = [part for part, own in keys.items() if own == key]
        if not parts:
            drives[key] = drive
            continue
        name = parse_signature(key, "drives")[0]
        recorded = f"{name}{_RECORDED}"
        if recorded in system.drives:
            where = entry_key("drives", recorded)
            raise DeclarationError(
                where, "the name is reserved for scaled records", "Choose another name"
            )
        drives[key] = f"{SCALE}*{recorded}"
        drives[recorded] = drive
        moved |= dict.fromkeys(parts, recorded)
    parameter = Parameter(1.0, "1", "scale of the records")
    return replace(system, parameters={**system.parameters, SCALE: parameter}, drives=drives), moved


# -- reading ---------------------------------------------------------------------------------------


def _files(folder: Path, pattern: str) -> list[Path]:
    """The records of a folder."""
    try:
        there = sorted(path for path in folder.iterdir() if path.is_file())
        chosen = [path for path in there if _is_record(path, pattern)]
    except NotADirectoryError:
        raise DeclarationError(str(folder), "not a folder", "Give a folder of records") from None
    except FileNotFoundError:
        raise DeclarationError(str(folder), "no such folder", "Check the path") from None
    except (OSError, ValueError) as error:
        reason = f"the folder cannot be read ({getattr(error, 'strerror', None) or error})"
        raise DeclarationError(str(folder), reason, "Check the path and the permissions") from None
    if not chosen:
        if pattern:
            reason = f"none of its {len(there)} files matches '{short(pattern)}'"
            raise DeclarationError(str(folder), reason, "Write it like *_h1.csv")
        known = ", ".join((*_TABLES, *(ending.upper() for ending in ENDINGS)))
        reason = "the folder has no records"
        raise DeclarationError(str(folder), reason, f"Files of records end with {known}")
    return chosen


def _is_record(path: Path, pattern: str) -> bool:
    if pattern:
        return path.match(pattern)
    return path.suffix.lower() in (*_TABLES, *ENDINGS) and not path.name.startswith(".")


def _read(file: Path, time: str, value: str, kind: SampleKind, drive: str, gaps: bool) -> Samples:
    """One record of a file."""
    return Samples.read(file, time, value, kind, name=drive, gaps=gaps)


def _scaled(
    parts: Mapping[str, Samples], factor: float, peak: float | None, where: str
) -> dict[str, Samples]:
    """The parts of a record with other values."""
    if peak is not None:
        largest = max(float(np.max(np.abs(samples.values))) for samples in parts.values())
        if largest == 0.0:
            raise DeclarationError(
                where, "all values are 0, so the record has no peak", "Remove it"
            )
        factor = peak / largest
    if factor == 1.0:
        return dict(parts)
    return {
        name: Samples(s.times, factor * s.values, s.kind, s.periodic, where=where, unit=s.unit)
        for name, s in parts.items()
    }


def _ends(parts: Mapping[str, Samples]) -> bool:
    return any(samples.ends for samples in parts.values())


def _span(parts: Mapping[str, Samples], name: str = "") -> tuple[float, float]:
    """Time span covered by all parts of a record."""
    start = max(samples.span[0] for samples in parts.values())
    stop = min(samples.span[1] for samples in parts.values())
    if not start < stop:
        reason = "its drives do not overlap in time"
        raise DeclarationError(
            f"records.{short(name)}", reason, "Give samples of the same time span"
        )
    return start, stop
