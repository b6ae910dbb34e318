"""Results as netCDF-4 files: written whole or not at all, read back as what they were written.

Beside its data a file holds attributes ``stickslip_*``: the kind of the result, the format of that
kind, the version that wrote it, and what else the result is made of, texts as they are and all
other values as JSON. Where it would have hundreds of variables, it has a few larger ones
(:mod:`stickslip.packing`).
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stickslip.errors import StickslipError
from stickslip.packing import in_all, in_few

if TYPE_CHECKING:
    import xarray

PREFIX = "stickslip_"


def write(path: str | Path, data: xarray.Dataset, kind: str, form: int, **parts: Any) -> None:
    """Write a result; an existing file is replaced only by a complete one.

    Parameters
    ----------
    path : str or Path
    data : xarray.Dataset
    kind : str
        What the result is, such as ``"trajectory"``.
    form : int
        Number of the format.
    **parts
        Texts, and data for JSON.

    Raises
    ------
    StickslipError
        If the file cannot be written.
    """
    from stickslip import __version__

    path = Path(path)
    own = {"kind": kind, "format": form, "version": __version__, **parts}
    texts = {PREFIX + key: text for key, text in as_texts(own).items()}
    partial = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        in_few(data).assign_attrs(texts).to_netcdf(partial, engine="netcdf4", format="NETCDF4")
        os.replace(partial, path)
    except OSError as error:
        raise StickslipError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        partial.unlink(missing_ok=True)


def as_texts(parts: Mapping[str, Any]) -> dict[str, str]:
    """Texts as they are, and all other data as JSON."""
    return {k: part if isinstance(part, str) else json.dumps(part) for k, part in parts.items()}


@contextmanager
def reading(
    path: str | Path, kind: str, form: int
) -> Iterator[tuple[xarray.Dataset, dict[str, str]]]:
    """The data of a stored result and its parts, as texts; what does not fit inside the block is
    said of the file.

    Raises
    ------
    StickslipError
        If the file does not exist, or is not a stored result of that kind and format.
    """
    import xarray as xr

    path = Path(path)
    if not path.is_file():
        raise StickslipError(f"{path}: there is no such file")
    try:
        with xr.open_dataset(path, engine="netcdf4") as stored:
            data = in_all(stored.load())
        own = {
            key.removeprefix(PREFIX): data.attrs.pop(key)
            for key in [*data.attrs]
            if key.startswith(PREFIX)
        }
        if own["kind"] != kind:
            raise StickslipError(f"{path}: holds {named(own['kind'])}, not {named(kind)}")
        readable(path, own, form)
        yield data, own
    except (OSError, KeyError, ValueError, TypeError) as error:
        if isinstance(error, StickslipError):
            raise
        raise StickslipError(f"{path}: not {named(kind)} stored by stickslip") from None


def kind_of(path: str | Path, known: Container[str]) -> str:
    """What kind of result a file holds; a folder is the store of a map.

    Raises
    ------
    StickslipError
        If there is nothing, or nothing that is known.
    """
    import netCDF4

    path = Path(path)
    if path.is_dir():
        return "sweep"
    if not path.exists():
        raise StickslipError(f"{path}: there is no such file")
    try:
        with netCDF4.Dataset(path) as file:
            kind = str(file.getncattr(f"{PREFIX}kind"))
    except (OSError, AttributeError):
        kind = ""
    if kind not in known:
        raise StickslipError(
            f"{path}: not a result stored by this version of stickslip; if an older one wrote it, "
            "open it with that, or compute it again (xarray reads it in any case)"
        )
    return kind


def readable(path: Path, own: Mapping[str, str], form: int) -> None:
    """Whether a result was stored in the format that is read.

    Raises
    ------
    StickslipError
        If it was not.
    """
    if int(own["format"]) != form:
        written = f"written in format {own['format']} by version {own['version']}"
        raise StickslipError(
            f"{path}: {written}, this version reads {form}; "
            "open it with the version that wrote it, or compute it again"
        )


def named(kind: str) -> str:
    """The kind with its article."""
    return f"an {kind}" if kind[:1] in "aeiou" else f"a {kind}"


def plain(value: Any) -> Any:
    """Data for JSON, which knows neither NaN nor infinity."""
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
