"""What shapes machine code: it is good for as long as all these sources stay the same."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).parent.parent
_ENGINE = (
    "motion/steps",
    "motion/engine",
    "motion/between",
    "equations/codegen",
    "symbolic/tape.py",
    "machine_code/by_numba.py",
    "machine_code/interface.py",
    "machine_code/kinds.py",
)
_SHAPED_BY = {
    "motion": _ENGINE,
    "equations": _ENGINE,
    "orbits": (*_ENGINE, "orbits/fields/engine", "orbits/settling/engine"),
    "orbits/fields": (*_ENGINE, "orbits/fields/engine"),
    "rate_independent": (
        "rate_independent/compiled.py",
        "rate_independent/signals",
        "rate_independent/solvers",
        "rate_independent/play",
    ),
}
"""By the room of a compiled function, the innermost that is named: files and folders that shape its
machine code."""


def sources(file: str | Path) -> list[Path]:
    """Files that shape the machine code of the functions in a file: of a file outside this package,
    also that file.

    Raises
    ------
    KeyError
        If nothing in that room of the package is compiled.
    """
    if not inside(file):
        return [*_files("orbits"), Path(file)]
    return _files(_room(file))


def _files(room: str) -> list[Path]:
    places = [_PACKAGE / place for place in _SHAPED_BY[room]]
    return sorted(
        path for place in places for path in (place.rglob("*.py") if place.is_dir() else [place])
    )


def inside(file: str | Path) -> bool:
    """Whether a file is one of this package."""
    return Path(file).resolve().is_relative_to(_PACKAGE.resolve())


def stamp(file: str | Path) -> str:
    """A name for the text of :func:`sources`."""
    if not inside(file):
        return _stamp("orbits") + hashlib.sha256(Path(file).read_bytes()).hexdigest()
    return _stamp(_room(file))


def _room(file: str | Path) -> str:
    path = Path(file).resolve().relative_to(_PACKAGE.resolve())
    rooms = [folder.as_posix() for folder in (path, *path.parents)]
    return next((room for room in rooms if room in _SHAPED_BY), rooms[0])


@cache
def _stamp(room: str) -> str:
    digest = hashlib.sha256()
    for path in _files(room):
        digest.update(f"{path.relative_to(_PACKAGE).as_posix()}\n".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()
