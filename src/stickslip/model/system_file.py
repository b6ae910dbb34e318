"""Model files: a :class:`~stickslip.model.system.System` as TOML and back, key by key, without
loss.

The keys are the fields of the classes in :mod:`stickslip.model.system`, in their order; a
coordinate also has its ``kind``. One line declares one thing, with dotted keys (``parameters.P =
{default = 1.0, unit = "N"}``), since TOML would not let the energy stand after a table
``[coordinates]``. Tables are read all the same.
"""

from __future__ import annotations

from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any

from stickslip.errors import DeclarationError, short
from stickslip.model import toml
from stickslip.model.schema import entry_key, wrong_kind
from stickslip.model.system import (
    Condition,
    Contact,
    Inertial,
    Internal,
    Parameter,
    RateIndependent,
    System,
    Viscous,
)

KINDS = {str(kind.kind): kind for kind in (Inertial, Viscous, RateIndependent)}
ENTRIES = {
    "parameters": Parameter,
    "internal": Internal,
    "contacts": Contact,
    "conditions": Condition,
}
GROUPS = ("name", "parameters", "functions", "coordinates", "contacts", "translation", "conditions")
"""Fields of a system before which a file has an empty line."""


def load(path: str | PathLike[str]) -> System:
    """The system that a model file declares.

    Raises
    ------
    DeclarationError
        If the file cannot be read or anything in it is wrong; the message names the file, the key,
        the reason and the remedy.
    """
    return loads(toml.read_text(path), str(path))


def loads(text: str, where: str = "model") -> System:
    """The system that the text of a model file declares.

    Parameters
    ----------
    text : str
        TOML.
    where : str
        Name of the text in messages.

    Raises
    ------
    DeclarationError
        If anything in it is wrong.
    """
    with toml.said_of(where):
        return _system(toml.parse(text))


def _system(table: dict[str, Any]) -> System:
    if "dissipation" in table:
        raise DeclarationError(
            "dissipation",
            "this file declares an evolution, not a system",
            "Use: stickslip evolve FILE",
        )
    given = toml.known_keys(System, table, "")
    for section, cls in ENTRIES.items():
        if section in given:
            given[section] = {
                name: toml.entry(cls, value, entry_key(section, name))
                for name, value in toml.mapping(given[section], section).items()
            }
    if "coordinates" in given:
        given["coordinates"] = {
            name: _coordinate(value, entry_key("coordinates", name))
            for name, value in toml.mapping(given["coordinates"], "coordinates").items()
        }
    return System(**given)


def _coordinate(value: Any, where: str) -> Any:
    table = dict(toml.mapping(value, where))
    kinds = ", ".join(f'"{kind}"' for kind in KINDS)
    if "kind" not in table:
        raise DeclarationError(
            f"{where}.kind", "the kind of the coordinate is missing", f"Give one of {kinds}"
        )
    kind = table.pop("kind")
    if not isinstance(kind, str):
        raise wrong_kind(kind, "str", f"{where}.kind")
    if kind not in KINDS:
        close = get_close_matches(kind, KINDS, 1)
        raise DeclarationError(
            f"{where}.kind",
            f"there is no kind '{short(kind)}'",
            f'Did you mean "{close[0]}"?' if close else f"Give one of {kinds}",
        )
    return toml.entry(KINDS[kind], table, where)


def save(system: System, path: str | PathLike[str]) -> None:
    """Write a system as a model file.

    Raises
    ------
    DeclarationError
        If the file cannot be written.
    """
    try:
        Path(path).write_bytes(dumps(system).encode())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "its texts are not valid Unicode"
        raise DeclarationError(
            str(path), f"the file cannot be written ({reason})", "Choose another place"
        ) from None


def dumps(system: System) -> str:
    """The system as the text of a model file; :func:`loads` gives it back, equal.

    What has its default value is left out, except the default of a parameter.
    """
    return toml.written(system, GROUPS)
