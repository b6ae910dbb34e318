"""Tables of results as files for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from stickslip import storage
from stickslip.arrays import Array
from stickslip.errors import DeclarationError, need, short, suggestion
from stickslip.motion.trajectory import Trajectory
from stickslip.numerics.levels import WHOLE_COUNT
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.results import Described, Result

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import pandas
    import xarray


_MOST_ROWS = 50_000_000


def exported_table(
    result: Result, quantities: Sequence[str], step: float | None
) -> pandas.DataFrame:
    """The table of a result for export.

    Parameters
    ----------
    quantities : sequence of str
        Columns in addition to those of the coordinates; by default all.
    step : float, optional
        Time between rows of a motion or a cycle; by default the times of its dataset.

    Returns
    -------
    pandas.DataFrame
        Table with codes, such as those of modes and outcomes, as words. Its ``attrs`` hold the
        title, the version of the library and the units of the columns.

    Raises
    ------
    DeclarationError
        If a quantity is unknown, or the result is neither motion nor cycle and a step is given.
    """
    import pandas as pd

    from stickslip import __version__

    said = cast("Described", result)
    data = said.dataset
    table = result.table if step is None else _sampled(motion_in(result, "step"), step)
    if quantities:
        table = table.loc[:, _chosen(result, table, data, quantities)]
    units: dict[str, str] = {}
    for column in table.columns:
        about = _attributes_of(data, str(column))
        if "flag_meanings" in about:
            words = dict(zip(about["flag_values"], about["flag_meanings"].split(), strict=True))
            words_of = pd.Series([words.get(code) for code in table[column]], dtype="str")
            table = table.assign(**{str(column): words_of})
        elif "units" in about:
            units[str(column)] = str(about["units"])
    table.attrs = {"title": said.title, "stickslip_version": __version__, "units": units}
    return table


def motion_in(result: Result, key: str) -> Trajectory:
    """The motion of a motion or a cycle.

    Raises
    ------
    DeclarationError
        If the result is another.
    """
    if isinstance(result, Trajectory):
        return result
    if isinstance(result, Cycle):
        return result.trajectory
    raise DeclarationError(key, f"the result is {storage.named(result.KIND)}, not a motion")


def even_times(motion: Trajectory, step: float, key: str = "step") -> Array:
    """Evenly spaced times from the start of a motion to its end.

    Raises
    ------
    DeclarationError
        If the step is not positive, or there are too many.
    """
    first, last = float(motion.knots.time[0]), float(motion.knots.time[-1])
    if not 0.0 < step < np.inf:
        raise DeclarationError(key, f"{step:g} is not a positive number", "Give a positive number")
    count = np.floor((last - first) / step * (1.0 + WHOLE_COUNT)) + 1.0
    if count > _MOST_ROWS:
        raise DeclarationError(
            key,
            f"the table would have {count:.3g} rows (at most {_MOST_ROWS:,})",
            "Use a larger step",
        )
    return np.minimum(first + step * np.arange(int(count)), last)


def _sampled(motion: Trajectory, step: float) -> pandas.DataFrame:
    import pandas as pd

    times = even_times(motion, step)
    return pd.DataFrame({"time": times, **motion.at(times)})


def _chosen(
    result: Result, table: pandas.DataFrame, data: xarray.Dataset, quantities: Sequence[str]
) -> list[str]:
    """Columns of the coordinates and of the quantities; a variable of several dimensions has
    several columns."""
    columns = [str(name) for name in table.columns]
    first = [name for name in columns if name in data.coords or name == "time"]
    found: list[str] = []
    for name in quantities:
        own = [c for c in columns if c == name or (c.startswith(f"{name}_") and name in data)]
        own = [name] if name in own else own
        if not own:
            raise DeclarationError(
                result.KIND, f"unknown quantity '{short(name)}'", suggestion(name, columns)
            )
        found += [c for c in own if c not in (*first, *found)]
    return [*first, *found]


def _attributes_of(data: xarray.Dataset, column: str) -> dict[str, Any]:
    """Attributes of the variable of a column: x, or x_2 for a variable x with several columns."""
    for name in (column, column.rpartition("_")[0]):
        if name in data.variables:
            return data[name].attrs
    return {}


def write_csv(table: pandas.DataFrame, path: str | Path, units: bool) -> None:
    """Write a table as text, with numbers that are read back exactly.

    Parameters
    ----------
    units : bool
        Whether the names of the columns have their units, as in ``x [m]``.

    Raises
    ------
    StickslipError
        If the file cannot be written.
    """
    if units:
        known = table.attrs["units"]
        names = {c: f"{c} [{known[c]}]" for c in table.columns if known.get(c, "1") != "1"}
        table = table.rename(columns=names)
    write_file(path, lambda place: table.to_csv(place, index=False))


def write_parquet(table: pandas.DataFrame, path: str | Path) -> None:
    """Write a table as Parquet, with its attributes as metadata.

    Raises
    ------
    StickslipError
        If the file cannot be written, or pyarrow is not installed.
    """
    need("pyarrow", "parquet")
    write_file(path, lambda place: table.to_parquet(place, engine="pyarrow", index=False))


def write_file(path: str | Path, write: Callable[[Path], object]) -> None:
    """Write a file such that an existing one is replaced by a complete one only."""
    with storage.replacing(path) as place:
        write(place)
