"""Checksums of stored results: damaged parts are detected and named before they are used.

A result has a table of checksums, one for each attribute and each array, as the attribute
``stickslip_checksums``. A file ends in one more, of all bytes before it, since HDF5 may not come
back from a file that is damaged: so it never sees one. Other programs read past that end. If one of
them rewrites the file, or adds to it, the end is gone, and the table decides.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray

TABLE = "stickslip_checksums"
LAYOUT = "stickslip_layout"
"""An attribute that all results have that have checksums; what was written before has neither."""

_END = b"\nstickslip checksum "
_SIZE = 16  # bytes of a checksum
_LENGTH = len(_END) + 2 * _SIZE + 1
_BLOCK = 2**20


def with_checksums(data: xarray.Dataset) -> xarray.Dataset:
    """The dataset with the table of its checksums.

    Parameters
    ----------
    data : xarray.Dataset
        As a file will hold it.
    """
    data = data.assign_attrs({LAYOUT: "2"})
    return data.assign_attrs({TABLE: json.dumps(checksums_of(data.attrs, _arrays(data)))})


def checksums_of(
    attributes: Mapping[Any, Any], arrays: Mapping[str, str]
) -> dict[str, dict[str, str]]:
    """Checksums by name.

    Parameters
    ----------
    attributes : mapping
        Of the whole result; the table itself is left out.
    arrays : mapping of str to str
        Checksums of arrays.
    """
    own = {str(key): value for key, value in attributes.items() if key != TABLE}
    return {"attributes": {k: of(_listed(v)) for k, v in own.items()}, "arrays": dict(arrays)}


def damaged(data: xarray.Dataset) -> list[str] | None:
    """Names of the damaged parts of a stored result; None if it was stored without checksums.

    What another program has added is no damage.
    """
    return wrong_checksums(data.attrs, _arrays(data))


def wrong_checksums(attributes: Mapping[Any, Any], arrays: Mapping[str, str]) -> list[str] | None:
    """Names of the parts that do not match the table; None if there is no table and never was one.

    Parameters
    ----------
    attributes, arrays
        As for :func:`checksums_of`.
    """
    if TABLE not in attributes:
        return [TABLE] if LAYOUT in attributes else None
    now = checksums_of(attributes, arrays)
    try:
        then = json.loads(attributes[TABLE])
        return [
            name
            for part in ("attributes", "arrays")
            for name, checksum in then[part].items()
            if now[part].get(name) != checksum
        ]
    except (ValueError, TypeError, KeyError, AttributeError):
        return [TABLE]


def of(data: Any) -> str:
    """The checksum of plain data."""
    return _digest([json.dumps(data, sort_keys=True).encode()])


def seal_file(path: Path) -> None:
    """Write the checksum of a file at its end."""
    with path.open("rb") as file:
        checksum = _digest(iter(lambda: file.read(_BLOCK), b""))
    with path.open("ab") as file:
        file.write(_END + checksum.encode() + b"\n")


def intact(path: Path) -> bool:
    """Whether all bytes are those before which the checksum at the end was written; also if there
    is none."""
    size = path.stat().st_size - _LENGTH
    with path.open("rb") as file:
        file.seek(max(size, 0))
        end = file.read()
        if not end.startswith(_END):
            return True
        file.seek(0)
        blocks = (file.read(min(_BLOCK, size - at)) for at in range(0, size, _BLOCK))
        return end == _END + _digest(blocks).encode() + b"\n"


def _arrays(data: xarray.Dataset) -> dict[str, str]:
    """Checksums of all arrays, each with its dimensions and attributes."""
    import numpy as np

    found = {}
    for name, variable in data.variables.items():
        values = np.asarray(variable.values)
        about = [variable.dims, values.shape, {k: _listed(v) for k, v in variable.attrs.items()}]
        content: Any = b""  # a file does not store the type of an empty array
        if values.size and values.dtype.kind in "biufc":
            numbers = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
            content = numbers.reshape(-1).view(np.uint8).data
            about.append(numbers.dtype.str)
        elif values.size:
            content = json.dumps([str(item) for item in values.reshape(-1)]).encode()
        head = json.dumps(about, sort_keys=True).encode()
        found[str(name)] = _digest([head, b"\0", content])
    return found


def _listed(value: Any) -> list[Any]:
    """An attribute as a list, since files do not distinguish a list of one entry from the entry, or
    a list from an array."""
    import numpy as np

    return np.ravel(np.asarray(value)).tolist()


def _digest(parts: Iterable[Any]) -> str:
    checksum = hashlib.blake2b(digest_size=_SIZE)
    for part in parts:
        checksum.update(part)
    return checksum.hexdigest()
