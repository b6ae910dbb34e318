"""The files of a stored map, as zarr reads and writes them: every chunk contains its position, and
lost chunks are distinguished from those not computed."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

from zarr.core.buffer import Buffer
from zarr.storage import LocalStore

from stickslip.errors import StickslipError
from stickslip.sweeps import damage


class MapFiles(LocalStore):
    """The folder of a map.

    Attributes
    ----------
    expected : frozenset of str
        Files of chunks that were there when the map was opened.
    """

    expected: frozenset[str] = frozenset()

    @classmethod
    def opened(cls, path: Path) -> Self:
        """The files of an existing map, for reading."""
        files = cls(path, read_only=True)
        chunks = (found for found in path.glob("*/c/**/*") if found.is_file())
        files.expected = frozenset(found.relative_to(path).as_posix() for found in chunks)
        return files

    def with_read_only(self, read_only: bool = False) -> Self:
        """The same files for reading only, or also for writing."""
        other = super().with_read_only(read_only)
        other.expected = self.expected
        return other

    async def get(self, key: str, *args: Any, **options: Any) -> Any:
        """The content of a file; None if it does not exist.

        Raises
        ------
        StickslipError
            If the file, or the complete map, was deleted.
        """
        found = await super().get(key, *args, **options)
        if found is None and damage.is_chunk(key):
            if not damage.is_there(self.root):
                raise StickslipError(f"{self.root}: was removed after the map was opened")
            if key in self.expected:
                raise StickslipError(f"{self.root}: {key} was removed after the map was opened")
        return found

    async def set(self, key: str, value: Buffer) -> None:
        """Write a file."""
        await super().set(key, _told(key, value))

    def set_sync(self, key: str, value: Buffer) -> None:
        """Write a file synchronously."""
        super().set_sync(key, _told(key, value))


def _told(key: str, value: Buffer) -> Buffer:
    """Content of a file: a chunk with its position."""
    if not damage.is_chunk(key):
        return value
    return type(value).from_bytes(damage.placed(key, value.to_bytes()))
