"""Results as netCDF-4 files: written completely or not at all, and read back without loss.

Beside its data a file holds attributes ``stickslip_*``: the kind of the result, the format of that
kind, the version that wrote it, and what else the result is made of, texts as they are and all
other values as JSON. Where it would have hundreds of variables, it has a few larger ones
(:mod:`stickslip.packing`). All of it has checksums (:mod:`stickslip.checksums`).
"""

from __future__ import annotations

import errno
import json
import math
import os
import warnings
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import disk_usage
from typing import TYPE_CHECKING, Any

from stickslip import checksums
from stickslip.arguments import validated
from stickslip.errors import StickslipError, short, some
from stickslip.packing import in_all, in_few

if TYPE_CHECKING:
    import xarray

PREFIX = "stickslip_"
_REMEDY = "Restore a copy, or recompute it"


def write(path: str | Path, data: xarray.Dataset, kind: str, form: int, **parts: Any) -> None:
    """Write a result; an existing file is replaced only by a complete one.

    Parameters
    ----------
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

    own = {"kind": kind, "format": form, "version": __version__, **parts}
    texts = {PREFIX + key: text for key, text in as_texts(own).items()}
    with replacing(path) as partial:
        whole = checksums.with_checksums(in_few(data).assign_attrs(texts))
        whole.to_netcdf(partial, engine="netcdf4", format="NETCDF4")
        checksums.seal_file(partial)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A new file to write, which replaces the one at the path when it is complete.

    Raises
    ------
    StickslipError
        If it cannot be written.
    """
    path = Path(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield partial
        os.replace(partial, path)
    except (OSError, RuntimeError, ValueError) as error:  # netCDF on a full disk; no path at all
        raise StickslipError(f"{path}: cannot be written ({_reason(path, error)})") from None
    finally:
        with suppress(OSError, ValueError):
            partial.unlink(missing_ok=True)


def _reason(path: Path, error: Exception) -> str:
    """Reason why a file cannot be written; for a full disk HDF5 reports *permission denied*."""
    with suppress(OSError):
        if disk_usage(path.parent).free < 2**16:
            return os.strerror(errno.ENOSPC)
    return getattr(error, "strerror", None) or str(error)


def as_texts(parts: Mapping[str, Any]) -> dict[str, str]:
    """Texts unchanged, and all other data as JSON."""
    return {k: part if isinstance(part, str) else json.dumps(part) for k, part in parts.items()}


@contextmanager
def reading(
    path: str | Path, kind: str, form: int
) -> Iterator[tuple[xarray.Dataset, dict[str, str]]]:
    """The data of a stored result and its parts, as texts; errors in the block are reported for the
    file.

    Raises
    ------
    StickslipError
        If the file does not exist, is damaged, or is not a stored result of that kind and format.

    Warns
    -----
    UserWarning
        If it was stored without checksums.
    """
    import xarray as xr

    path = _whole(path)
    try:
        with xr.open_dataset(path, engine="netcdf4") as stored:
            data = stored.load()
        damage = checksums.damaged(data)
        data = data if damage else in_all(data)
        own = {
            key.removeprefix(PREFIX): data.attrs.pop(key)
            for key in [*data.attrs]
            if key.startswith(PREFIX)
        }
        for key in (checksums.TABLE, checksums.LAYOUT):
            own.pop(key.removeprefix(PREFIX), None)
        if damage:
            raise StickslipError(f"{path}: damaged: {some(damage, 6)}. {_REMEDY}")
        if own["kind"] != kind:
            raise StickslipError(f"{path}: holds {named(own['kind'])}, not {named(kind)}")
        readable(path, own, form)
        if damage is None:
            unchecked(path)
        yield data, own
    except StickslipError:
        raise
    except Exception as error:  # libraries raise anything for damaged files
        raise StickslipError(f"{path}: not {named(kind)} stored by stickslip") from error


def unchecked(path: Path) -> None:
    """Warn that the integrity of a result cannot be checked."""
    text = f"{path}: stored without checksums, by an older version: damage cannot be detected"
    warnings.warn(text, stacklevel=2)


def _whole(path: str | Path) -> Path:
    """The path of a file, unless its bytes are not those that were written.

    Raises
    ------
    StickslipError
        If they are not, or if there is no file.
    """
    path = Path(path)
    try:
        if not path.is_file():
            there = "not a file" if path.exists() else "no such file"
            raise StickslipError(f"{path}: {there}")
        if checksums.intact(path):
            return path
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise StickslipError(f"{short(str(path))}: cannot be read ({reason})") from None
    raise StickslipError(f"{path}: damaged: the checksum does not match. {_REMEDY}")


@validated
def kind_of(path: str | Path, known: Container[str]) -> str:
    """Kind of the result in a file; a folder is the store of a map.

    Raises
    ------
    StickslipError
        If there is nothing, or nothing that is known, or the file is damaged.
    """
    import netCDF4

    if os.path.isdir(path):  # Path.is_dir raises for invalid paths
        return "sweep"
    path = _whole(path)
    try:
        with netCDF4.Dataset(path) as file:
            kind = str(file.getncattr(f"{PREFIX}kind"))
    except Exception:  # netCDF4 may raise any exception for other files
        kind = ""
    if kind not in known:
        raise StickslipError(
            f"{path}: not a result stored by this version of stickslip; if an older version "
            "wrote it, open it with that version or recompute it (xarray can read it in any "
            "case)"
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
            f"{path}: {written}, this version reads {form}; open it with the version that wrote "
            "it, or recompute it"
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
