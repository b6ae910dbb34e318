"""Columns of numbers in text files, and records of strong motion in the format of the PEER ground
motion database: AT2 files (accelerations), VT2 (velocities) and DT2 (displacements).

In these, after three lines of text a fourth gives the number of samples and the time between them,
as ``NPTS= 4000, DT= .0050 SEC`` or, in older files, ``4000 0.0050 NPTS, DT``. What follows are the
values, in the unit that the third line names (accelerations in parts of g).
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion

_MOST_BYTES = 2_000_000_000
_SEPARATORS = (",", ";", "\t", None)
ENDINGS = (".at2", ".vt2", ".dt2")
_HEADING = 4  # largest number of lines before the values
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?"
_FORMS = (
    re.compile(rf"NPTS\s*=\s*(?P<count>\d+)\s*,?\s*DT\s*=\s*(?P<step>{_NUMBER})", re.IGNORECASE),
    re.compile(rf"(?P<count>\d+)\s+(?P<step>{_NUMBER})\s+NPTS\s*,?\s*DT", re.IGNORECASE),
)


def columns_of(
    file: str | PathLike[str], time: str, value: str, name: str = ""
) -> tuple[Array, Array, Any, tuple[str, str]]:
    """Two columns of a text file, the line numbers of their rows, and their names.

    Names that are not given are found, see :meth:`Samples.read`.

    Raises
    ------
    DeclarationError
    """
    columns, rows, wanted = chosen_columns(
        file, lambda names, where: _chosen(names, time, value, name, where)
    )
    return columns[0], columns[1], rows, (wanted[0], wanted[1])


def chosen_columns(
    file: str | PathLike[str], choose: Callable[[list[str], str], Sequence[str]]
) -> tuple[Array, Any, tuple[str, ...]]:
    """Columns of a text file, the line number of each row, and the names of the columns.

    Parameters
    ----------
    choose : callable
        The names of all columns, and the line in which they stand -> those that are wanted.

    Raises
    ------
    DeclarationError
    """
    where = file_named(file)
    lines = lines_of(file)
    numbers = [i for i, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    if not numbers:
        raise DeclarationError(
            where,
            "the file is empty",
            "Write a header line with the names of the columns, and a line for each row",
        )
    heading = lines[numbers[0]]
    separator = separator_of(heading)
    names = [cell.strip() for cell in cells_in(heading, separator)]
    wanted = tuple(choose(names, f"{where}, line {numbers[0] + 1}"))
    places = [names.index(column) for column in wanted]
    rows = numbers[1:]
    columns = np.empty((len(wanted), len(rows)))
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
                    f"'{short(cell)}' is not a number" if cell else "the value is missing",
                    DECIMAL_POINTS if "," in cell else "Fill it, or delete the row",
                ) from None
    return columns, np.array(rows) + 1, wanted


def argument_columns(
    of: Sequence[str], value: str, own: str
) -> Callable[[list[str], str], list[str]]:
    """Columns of the arguments and values of a table, for :func:`chosen_columns`.

    Parameters
    ----------
    of : sequence of str
        Columns of the arguments; none: the first one.
    value : str
        If it is empty, that called like the table, or "value", or the only other one.
    own : str
        How the table is called.
    """

    def choose(names: list[str], where: str) -> list[str]:
        for name in (*of, value):
            if name and name not in names:
                known = suggestion(name, names, "'")
                raise DeclarationError(where, f"unknown column '{short(name)}'", known)
        if not (of and value) and all(map(_is_number, names)):
            raise DeclarationError(
                where,
                "the header line has numbers instead of column names",
                "Add a header line, like: speed,mu",
            )
        arguments = list(of) or names[:1]
        others = [name for name in names if name not in arguments]
        last = value or next((name for name in (own, "value") if name and name in others), "")
        if not last and len(others) == 1:
            last = others[0]
        if not last:
            raise DeclarationError(
                where,
                f"it is ambiguous which column has the values: {short(', '.join(names))}",
                'Name it, as in {file = "mu.csv", of = "speed", value = "mu"}',
            )
        return [*arguments, last]

    return choose


DECIMAL_POINTS = "Save the file with decimal points, like 0.5"


def check_cells(cells: Sequence[str], names: Sequence[str], where: str) -> None:
    """Reject a row with more cells than there are names: which belong to which is not known.

    Raises
    ------
    DeclarationError
    """
    if len(cells) > len(names) and any(cell.strip() for cell in cells[len(names) :]):
        reason = f"the line has {len(cells)} cells, the header has {len(names)} names"
        remedy = f"{DECIMAL_POINTS}, and give one name for each column"
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
            what = "a directory" if S_ISDIR(status.st_mode) else "not a regular file"
            raise DeclarationError(
                where, f"the path is {what}", "Give the path of a file with columns"
            )
        if status.st_size > _MOST_BYTES:
            raise DeclarationError(
                where, f"the file has more than {_MOST_BYTES:,} bytes", "Give fewer samples"
            )
        text = path.read_bytes()
    except FileNotFoundError:
        raise DeclarationError(where, "no such file", "Check the path") from None
    except (OSError, ValueError) as error:  # the second: no path at all
        raise DeclarationError(
            where,
            f"the file cannot be read ({getattr(error, 'strerror', None) or error})",
            "Check the path and the permissions",
        ) from None
    if b"\x00" in text[:4096]:
        raise DeclarationError(
            where, "not a text file", "Save it as text with a header line and columns"
        )
    try:
        return text.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        row = text.count(b"\n", 0, error.start) + 1
        raise DeclarationError(where, f"line {row} is not UTF-8 text", "Save it as UTF-8") from None


def separator_of(heading: str) -> str | None:
    """The separator of columns in a table with this header line; None for blanks."""
    return next((s for s in _SEPARATORS if s is None or s in heading), None)


def _chosen(names: list[str], time: str, value: str, own: str, where: str) -> tuple[str, str]:
    """The columns of times and of values: those that are named, or those that can be meant."""
    for name in (time, value):
        if name and name not in names:
            known = suggestion(name, names, "'")
            raise DeclarationError(where, f"unknown column '{short(name)}'", known)
    if not (time and value) and all(map(_is_number, names)):
        raise DeclarationError(
            where,
            "the header line has numbers instead of column names",
            "Add a header line, like: t,a",
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
            f"it is ambiguous which column has the {missing}: {short(', '.join(names))}",
            'Name it, as in {file = "base.csv", time = "t", value = "a"}',
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


def is_strong_motion(file: str | PathLike[str]) -> bool:
    """Whether the name of a file is that of such a record."""
    return Path(file).suffix.lower() in ENDINGS


def strong_motion_of(file: str | PathLike[str]) -> tuple[Array, Array]:
    """Times, from 0 on, and values of a record.

    Raises
    ------
    DeclarationError
        If it cannot be read, the heading says neither number nor step, there are fewer or more
        values, or one is no number.
    """
    where = file_named(file)
    lines = lines_of(file)
    if not any(line.strip() for line in lines):
        raise DeclarationError(where, "the file is empty", "Give a record")
    heading = lines[_HEADING - 1] if len(lines) >= _HEADING else ""
    found = next((match for form in _FORMS if (match := form.search(heading))), None)
    if found is None:
        raise DeclarationError(
            f"{where}, line {_HEADING}",
            "the number of samples and their time step are missing",
            "Write it like NPTS= 4000, DT= .0050 SEC, or give a table with the ending .csv",
        )
    count, step = int(found["count"]), float(re.sub("[dD]", "e", found["step"]))
    if count < 2 or not 0.0 < step < np.inf:
        reason = f"{count} samples with a time step of {step:g}"
        raise DeclarationError(
            f"{where}, line {_HEADING}",
            reason,
            "Give at least two samples and a positive time step",
        )
    values: list[float] = []
    for number, line in enumerate(lines[_HEADING:], _HEADING + 1):
        for cell in line.split():
            try:
                values.append(float(cell))
            except ValueError:
                reason = f"'{short(cell)}' is not a number"
                raise DeclarationError(
                    f"{where}, line {number}", reason, "Correct the file"
                ) from None
            if not np.isfinite(values[-1]):
                reason = f"{values[-1]} is not a number"
                raise DeclarationError(f"{where}, line {number}", reason, "Correct the file")
    if len(values) != count:
        raise DeclarationError(
            where, f"the file has {len(values)} values, but NPTS is {count}", "Correct the file"
        )
    return step * np.arange(count), np.array(values)
