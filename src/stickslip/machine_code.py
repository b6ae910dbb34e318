"""Machine code on disk, good for as long as all sources that shape it stay the same.

numba keeps the machine code of a function beside the file in which the function stands, and looks
at that file alone when it asks whether the code is still good. But constants, layouts and whole
functions of other files are compiled into it: after an update, old code would go on with new data.
So :func:`njit` has it look at all files that shape the code.
"""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import caching

__all__ = ["njit", "sources", "stamp"]

_PACKAGE = Path(__file__).parent
_ENGINE = (
    "motion/steps",
    "motion/engine",
    "motion/between",
    "equations/codegen",
    "symbolic/tape.py",
)
_SHAPED_BY = {
    "motion": _ENGINE,
    "equations": _ENGINE,
    "orbits": (*_ENGINE, "orbits/settling/engine"),
    "orbits/fields": (
        "equations/codegen/program.py",
        "motion/steps/arrays.py",
        "orbits/fields/engine",
    ),
    "rate_independent": (
        "rate_independent/signals",
        "rate_independent/solvers",
        "rate_independent/play",
    ),
}
"""By the room of a compiled function, the innermost that is named: files and folders that shape its
machine code."""


def _room(file: str | Path) -> str:
    path = Path(file).resolve().relative_to(_PACKAGE.resolve())
    rooms = [folder.as_posix() for folder in (path, *path.parents)]
    return next((room for room in rooms if room in _SHAPED_BY), rooms[0])


def sources(file: str | Path) -> list[Path]:
    """Files that shape the machine code of the functions in a file of this package.

    Raises
    ------
    KeyError
        If nothing in that room is compiled.
    """
    places = [_PACKAGE / place for place in _SHAPED_BY[_room(file)]]
    return sorted(
        path for place in places for path in (place.rglob("*.py") if place.is_dir() else [place])
    )


@cache
def _stamp(room: str) -> str:
    digest = hashlib.sha256()
    for path in sources(_PACKAGE / room):
        digest.update(f"{path.relative_to(_PACKAGE).as_posix()}\n".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def stamp(file: str | Path) -> str:
    """A name for the text of :func:`sources`."""
    return _stamp(_room(file))


class _AllSources:
    """A place for machine code that is good for as long as :func:`stamp` stays the same."""

    _py_file: str

    def get_source_stamp(self) -> str:
        return stamp(self._py_file)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        inside = Path(py_file).resolve().is_relative_to(_PACKAGE.resolve())
        return super().from_function(py_func, py_file) if inside else None  # type: ignore[misc]


class _ReadableIndex(caching.IndexDataCacheFile):
    """An index of machine code that names a class which is no longer there is an old one: none."""

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except (AttributeError, ImportError):
            return {}


def _look_at_all_sources() -> None:
    """Put our places before numba's own, one for each of its folders: the given one, beside the
    file, the user's."""
    implementation: Any = getattr(caching, "CacheImpl", None) or getattr(caching, "_CacheImpl")  # noqa: B009
    places = implementation._locator_classes
    ours = [type(f"{place.__name__}OfAllSources", (_AllSources, place), {}) for place in places[:3]]
    implementation._locator_classes = [*ours, *places]
    caching.IndexDataCacheFile = _ReadableIndex


_look_at_all_sources()
