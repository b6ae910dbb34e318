"""Names of contacts in formulas."""

from __future__ import annotations

import re

NORMAL = "normal_"  # prefix of the names of normal forces; names of contacts do not begin with it
JOINED = " + "  # between the names of combined contacts; names do not contain it


def key_of(name: str) -> str:
    """The name of a contact as the end of a name in formulas."""
    return re.sub(r"\W", "_", name, flags=re.ASCII)


def normal_force(contact: str) -> str:
    """Name of the normal force of a contact in formulas."""
    return NORMAL + key_of(contact)
