"""Names of unknowns, as formulas write them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stickslip.structures.coordinates import InModes
    from stickslip.structures.structure import Structure

    AnyPart = Structure | InModes

_ENTRY = re.compile(r"\s*(d_)?([A-Za-z]\w*)\s*\[\s*(\w+)\s*\]\s*\Z")


def entry_of(text: str, structures: Mapping[str, AnyPart]) -> tuple[str, str, int]:
    """Parse a name such as ``d_u[tip]``: ``"d_"`` or an empty string, the structure, the index.

    Raises
    ------
    KeyError
        If it is no such name; its argument is a remedy.
    """
    match = _ENTRY.match(text)
    if match is None or match[2] not in structures:
        known = ", ".join(f"{name}[0]" for name in structures)
        raise KeyError(f"Write it like {known}" if known else "The system has no structures")
    return match[1] or "", match[2], structures[match[2]].index(match[3])


def is_entry(text: object) -> bool:
    """Whether a text looks like the name of an unknown, or of its rate."""
    return isinstance(text, str) and _ENTRY.match(text) is not None
