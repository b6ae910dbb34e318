"""Damaged or missing files in the store of a map.

Every chunk contains its place and ends in a checksum, and ``zarr.json`` contains the checksums of
all descriptions (:mod:`stickslip.checksums`). Checksums are verified before a file is decoded. The
place of a chunk, such as ``speed/c/0/1``, follows its values as a skippable Zstandard frame (RFC
8878, section 3.1.2), so that any Zarr reader can read it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from stickslip import checksums
from stickslip.errors import StickslipError, some
from stickslip.storage import PREFIX, unchecked

Chunk = tuple[int, ...]

_DESCRIPTION = "zarr.json"
_SUM = 4  # bytes of the checksum at the end of a chunk
_SKIPPED = b"\x50\x2a\x4d\x18"  # magic number of a frame that decoders skip
_LAYOUT = "3"


class Faults(NamedTuple):
    """Chunks that cannot be used, most of them with the name of their variable.

    Attributes
    ----------
    damaged : list of (str, tuple of int)
        Those with a wrong checksum.
    missing : list of (str, tuple of int)
        Those that are not there although their points are computed.
    unfinished : list of tuple of int
        Chunks of which some variable is there, but not the outcomes, which are written last.
    """

    damaged: list[tuple[str, Chunk]]
    missing: list[tuple[str, Chunk]]
    unfinished: list[Chunk]


def files(chunks: Iterable[tuple[str, Chunk]]) -> str:
    """Files of chunks, for a message."""
    return some([_key(name, chunk) for name, chunk in chunks], 6)


def is_there(path: Path) -> bool:
    """Return whether there is a store."""
    return (path / _DESCRIPTION).is_file()


def seal_store(path: Path) -> None:
    """Write checksums of all descriptions into a new store."""
    place = path / _DESCRIPTION
    described = json.loads(place.read_bytes())
    own = described["attributes"]
    own[checksums.LAYOUT] = _LAYOUT
    own[checksums.TABLE] = json.dumps(checksums.checksums_of(own, _sums(_arrays(described))))
    place.write_text(json.dumps(described, indent=2), encoding="utf-8")


def check_description(path: Path, kind: str) -> dict[str, Any]:
    """Descriptions of the arrays of a store, by name, if nothing but chunks of points can be
    damaged.

    Parameters
    ----------
    kind : str
        Required kind of the result.

    Raises
    ------
    StickslipError
        If it is not such a store, or a description or an axis is damaged.

    Warns
    -----
    UserWarning
        If the store has no checksums of its descriptions.
    """
    if not path.exists():
        raise StickslipError(f"{path}: no such store")
    try:
        described = json.loads((path / _DESCRIPTION).read_bytes())
        own, arrays = described["attributes"], _arrays(described)
        if own[f"{PREFIX}kind"] != kind:
            raise KeyError(kind)
        found = checksums.wrong_checksums(own, _sums(arrays))
        damaged = [f"{_DESCRIPTION} ({', '.join(found)})"] if found else []
        for name, array in arrays.items():
            if _read(path / name / _DESCRIPTION) != array:
                damaged.append(f"{name}/{_DESCRIPTION}")
        for name in own["coordinates"].split():
            chunks = [(name, chunk) for chunk in _chunks(arrays[name])]
            told = own.get(checksums.LAYOUT) == _LAYOUT
            damaged += [files([each]) for each in chunks if not _sound(path, *each, told)]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise StickslipError(
            f"{path}: not a map stored by stickslip, or its description is damaged "
            f"({_DESCRIPTION}); nothing was changed"
        ) from None
    if damaged:
        raise StickslipError(
            f"{path}: damaged: {some(damaged, 6)}. Nothing was changed. Restore a copy, or "
            "recompute the map in another place"
        )
    if found is None:
        unchecked(path)
    return arrays


def faults(
    path: Path, names: Sequence[str], array: Mapping[str, Any], empty: Callable[[Chunk], bool]
) -> Faults:
    """Chunks of points that are damaged or missing.

    Parameters
    ----------
    names : sequence of str
        Variables; the last one, the outcomes, marks the computed points.
    array : mapping
        The description of one of them.
    empty : callable
        Whether an intact chunk of outcomes has no computed points.
    """
    *others, last = names
    found = Faults([], [], [])
    told = _contains_places(path)
    for chunk in _chunks(array):
        states = {name: _sound(path, name, chunk, told) for name in names}
        if states[last] is None and any(states.values()):
            found.unfinished.append(chunk)
        if states[last] is None or all(states.values()):
            continue
        if states[last] and empty(chunk):
            continue
        found.damaged.extend((name, chunk) for name in names if states[name] is False)
        found.missing.extend((name, chunk) for name in others if states[name] is None)
    return found


def _arrays(described: Mapping[str, Any]) -> dict[str, Any]:
    return dict(described["consolidated_metadata"]["metadata"])


def _sums(arrays: Mapping[str, Any]) -> dict[str, str]:
    return {name: checksums.of(array) for name, array in arrays.items()}


def _read(place: Path) -> Any:
    """A parsed description; None if it is invalid."""
    try:
        return json.loads(place.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None


def _chunks(array: Mapping[str, Any]) -> Iterator[Chunk]:
    sizes = array["chunk_grid"]["configuration"]["chunk_shape"]
    counts = [-(-n // size) for n, size in zip(array["shape"], sizes, strict=True)]
    return product(*(range(count) for count in counts))


def _contains_places(path: Path) -> bool:
    """Return whether the chunks of a store contain their places."""
    return _read(path / _DESCRIPTION)["attributes"].get(checksums.LAYOUT) == _LAYOUT


def _key(name: str, chunk: Chunk) -> str:
    return "/".join([name, "c", *map(str, chunk)])


def is_chunk(key: str) -> bool:
    """Return whether a file of a store is a chunk."""
    return "/c/" in key


def placed(key: str, content: bytes) -> bytes:
    """A chunk with its place, and a checksum of both.

    Parameters
    ----------
    key : str
        Where it belongs.
    content : bytes
        The chunk, which ends in its checksum.
    """
    import google_crc32c

    told = content[:-_SUM] + _frame(key)
    return told + google_crc32c.value(told).to_bytes(_SUM, "little")


def _frame(key: str) -> bytes:
    return _SKIPPED + len(key.encode()).to_bytes(4, "little") + key.encode()


def _sound(path: Path, name: str, chunk: Chunk, told: bool) -> bool | None:
    """Return whether a chunk has the right checksum and, if chunks contain their places, is in its
    place; None if it is missing."""
    import google_crc32c

    key = _key(name, chunk)
    try:
        content = (path / key).read_bytes()
    except FileNotFoundError:
        return None
    except OSError:
        return False
    written = int.from_bytes(content[-_SUM:], "little")
    sound = len(content) > _SUM and google_crc32c.value(content[:-_SUM]) == written
    return sound and (not told or content[:-_SUM].endswith(_frame(key)))
