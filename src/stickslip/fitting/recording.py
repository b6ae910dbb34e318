"""Recordings of measurements: columns over time, or rows of events, with their known parameters."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from io import StringIO
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from stickslip.arguments import check_fields
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.model.formats.columns import (
    DECIMAL_POINTS,
    cells_in,
    check_cells,
    file_named,
    lines_of,
    separator_of,
)

if TYPE_CHECKING:
    import pandas

    from stickslip.model.system import Formula

CLOCKS = ("time", "t")
HAPPENINGS = ("slips", "sticks", "closes", "opens")
"""What may happen to a contact, as a record of events names it."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Measurements of one motion, with its known parameters and inputs.

    Attributes
    ----------
    data : table
        A file with columns (separated by comma, semicolon, tab or blanks) and a header line, a
        pandas DataFrame, an xarray Dataset, or a mapping of names to arrays. Empty cells are gaps
        and are ignored.
    parameters : mapping of str to float
        Values that differ from those of other recordings, such as a prescribed speed.
    initial : mapping of str to float or str
        Initial values; formulas of the parameters are allowed, such as ``"D_c/V"``.
    drives : mapping of str to str
        Drives of the system, and their columns.
    time : str
        Column of the time; by default ``time`` or ``t``.
    begin : float, optional
        Beginning of the motion; by default the first row.
    end : float, optional
        Latest end of the motion, if events were recorded.
    events : str
        Kind of event, if every row is an event: such as ``"ground slips"`` (or sticks, opens,
        closes), in chronological order.

    Raises
    ------
    DeclarationError
        If the data are not a table.
    """

    data: Any
    parameters: Mapping[str, float] = field(default_factory=dict[str, float])
    initial: Mapping[str, Formula] = field(default_factory=dict[str, "Formula"])
    drives: Mapping[str, str] = field(default_factory=dict[str, str])
    time: str = ""
    begin: float | None = None
    end: float | None = None
    events: str = ""

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "data", table_of(self.data))

    @property
    def table(self) -> pandas.DataFrame:
        """The columns."""
        return self.data

    @property
    def source(self) -> str:
        """Name in messages."""
        return str(self.table.attrs.get("source", "data"))

    @property
    def clock(self) -> str:
        """The column of the time."""
        if self.time:
            self.column(self.time)
            return self.time
        names = [name for name in CLOCKS if name in self.table.columns]
        if not names:
            raise DeclarationError(
                self.source,
                "no column is named 'time' or 't'",
                "Give the name of the time column: time='...'",
            )
        return names[0]

    def column(self, name: str) -> Array:
        """Numbers of a column; NaN in its gaps.

        Raises
        ------
        DeclarationError
            If there is no such column, or something in it is neither a number nor a gap.
        """
        import pandas as pd

        if name not in self.table.columns:
            known = suggestion(name, [str(c) for c in self.table.columns])
            raise DeclarationError(self.source, f"unknown column '{short(name)}'", known)
        given = self.table[name]
        values = cast(Any, pd.to_numeric(given, errors="coerce")).to_numpy(float)
        strange = np.isnan(values) & given.notna().to_numpy()
        for row in map(int, np.flatnonzero(strange)):
            if str(given.iloc[row]).strip().lower() in ("", "nan"):
                continue
            raise DeclarationError(
                f"{self.source}, row {row + 1}, column '{short(name)}'",
                f"'{short(str(given.iloc[row]))}' is not a number",
                DECIMAL_POINTS
                if "," in str(given.iloc[row])
                else "Correct the cell, or leave it empty",
            )
        if np.isinf(values).any():
            row = int(np.argmax(np.isinf(values)))
            raise DeclarationError(
                f"{self.source}, row {row + 1}, column '{short(name)}'",
                "the value is infinite",
                "Correct the cell, or leave it empty",
            )
        return values

    @property
    def happening(self) -> tuple[str, str]:
        """Contact and kind of event, for a recording of events."""
        contact, _, verb = self.events.rpartition(" ")
        if not contact or verb not in HAPPENINGS:
            raise DeclarationError(
                f"{self.source}, events",
                f"'{short(self.events)}' is not an event",
                "Give a contact and one of slips, sticks, closes, opens, like 'ground slips'",
            )
        return contact, verb


def as_recordings(data: Any, shared: Mapping[str, Any]) -> tuple[Recording, ...]:
    """One record or several; attributes that a record does not define are those of all records.

    Parameters
    ----------
    shared : mapping
        Attributes of records.
    """
    several = isinstance(data, Sequence) and not isinstance(data, str | PathLike)
    items = list(cast(Sequence[Any], data)) if several else [data]
    if not items:
        raise DeclarationError("data", "no record was given", "Give at least one row")
    return tuple(_with(item, shared) for item in items)


def _with(item: Any, shared: Mapping[str, Any]) -> Recording:
    if not isinstance(item, Recording):
        return Recording(item, **shared)
    merged: dict[str, Any] = {}
    for name, value in shared.items():
        own = getattr(item, name)
        merged[name] = {**value, **own} if isinstance(value, Mapping) else own or value
    return Recording(
        item.data,
        begin=item.begin,
        end=item.end,
        events=item.events,
        **merged,
    )


def table_of(data: Any) -> pandas.DataFrame:
    """Data as a table.

    Raises
    ------
    DeclarationError
        If they are none.
    """
    import pandas as pd

    if isinstance(data, pd.DataFrame):
        return data
    if isinstance(data, str | PathLike):
        return _read(Path(data))
    if isinstance(data, Mapping):
        columns = {str(name): _numbers(str(name), v) for name, v in data.items()}
        if len({len(v) for v in columns.values()}) > 1:
            sizes = ", ".join(f"{name}: {len(v)}" for name, v in columns.items())
            raise DeclarationError(
                "data",
                f"its columns have different lengths ({sizes})",
                "Give columns of the same length",
            )
        return pd.DataFrame(columns)
    if hasattr(data, "to_dataframe"):
        return data.to_dataframe().reset_index()
    raise DeclarationError(
        "data",
        f"{type(data).__name__} is not a table",
        "Give a file, a DataFrame, a Dataset, or a mapping of names to arrays",
    )


def _numbers(name: str, given: Any) -> Array:
    try:
        return np.ravel(np.asarray(given, float))
    except (TypeError, ValueError, OverflowError):
        raise DeclarationError(
            f"data, column '{short(name)}'", "not an array of numbers", "Give numbers"
        ) from None


def _read(path: Path) -> pandas.DataFrame:
    import pandas as pd

    lines = [line.partition("#")[0] for line in lines_of(path)]
    rows = [i for i, line in enumerate(lines) if line.strip()]
    where = file_named(path)
    if not rows:
        raise DeclarationError(
            where,
            "the file is empty",
            "Write a header line with the names of the columns, and a line for each row",
        )
    separator = separator_of(lines[rows[0]])
    names = cells_in(lines[rows[0]].strip(), separator)
    for i in rows[1:]:
        check_cells(cells_in(lines[i].strip(), separator), names, f"{where}, line {i + 1}")
    try:
        table = pd.read_csv(
            StringIO("\n".join(lines[i].strip(" ") for i in rows)),
            sep=separator or r"\s+",
            skipinitialspace=True,
            index_col=False,
        )
    except (ValueError, pd.errors.ParserError, csv.Error) as error:
        raise DeclarationError(
            where,
            f"not a table of columns ({short(str(error))})",
            "Save it as text with a header line and columns",
        ) from None
    table.columns = [str(name).strip() for name in table.columns]
    table.attrs["source"] = str(path)
    return table
