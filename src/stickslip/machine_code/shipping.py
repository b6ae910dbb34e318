"""The machine code of the package, compiled in advance.

``python -m stickslip.machine_code.shipping`` makes what is not up to date, for this machine; with
``all``, for every level of processors.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from stickslip.machine_code import shelf


def ship(levels: Sequence[str]) -> None:
    """Make the package's machine code for processors of these levels, with bitcode for others.

    Parameters
    ----------
    levels : sequence of str
        Of :mod:`stickslip.machine_code.shelf`.
    """
    for level in levels:
        place = shelf.SHIPPED / level
        here = shelf.target_of(level)
        if is_complete(level):
            continue
        place.mkdir(parents=True, exist_ok=True)
        for library in shelf.LIBRARIES:
            shelf.make(library, place, here, ship=True)
        shelf.clean(place, here)
        for path in place.iterdir():
            path.chmod(0o644)  # readable for all users of the package


def is_complete(level: str) -> bool:
    """Whether the machine code of a level is complete for the current sources."""
    return all(
        shelf.shipped(library, level, shelf.source_digest(library)) is not None
        for library in shelf.LIBRARIES
    )


def from_command_line(arguments: Sequence[str]) -> None:
    """Compile missing machine code for this machine, or for all machines with ``all``."""
    ship([shelf.FAST, shelf.PORTABLE] if list(arguments) == ["all"] else [shelf.level()])


if __name__ == "__main__":
    from_command_line(sys.argv[1:])
