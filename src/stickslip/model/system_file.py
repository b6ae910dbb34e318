"""Model files: a :class:`~stickslip.model.system.System` as TOML and back, key by key, without
loss.

The keys are the fields of the classes in :mod:`stickslip.model.system`, in their order; a
coordinate also has its ``kind``. One line declares one thing, with dotted keys (``parameters.P =
{default = 1.0, unit = "N"}``), since TOML would not let the energy stand after a table
``[coordinates]``. Tables are read all the same.
"""

from __future__ import annotations

from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from stickslip.arguments import validated
from stickslip.errors import DeclarationError
from stickslip.model.formats import toml
from stickslip.model.system import (
    Bilateral,
    Condition,
    Contact,
    Inertial,
    Internal,
    Jump,
    LawContact,
    Output,
    Parameter,
    RateIndependent,
    Sampled,
    System,
    Unilateral,
    Viscous,
)
from stickslip.results import Part

_COORDINATES = {str(kind.kind): kind for kind in (Inertial, Viscous, RateIndependent)}


def _coordinate(value: Any, where: str, folder: Path) -> Any:
    table = dict(toml.mapping(value, where))
    return toml.entry(toml.named_kind(table, _COORDINATES, where), table, where)


def _contact(value: Any, where: str, folder: Path) -> Any:
    """A contact with its forces; for a contact with a law, the parameters of the law."""
    table = toml.mapping(value, where)
    if "law" not in table:
        kinds = {"gap": Unilateral, "constraint": Bilateral}
        return toml.entry(next((kinds[k] for k in kinds if k in table), Contact), table, where)
    if isinstance(table["law"], list):
        raise DeclarationError(
            f"{where}.law",
            "a contact has one law",
            "Declare a contact for each law; contacts along the same direction add up",
        )
    if "direction" not in table:
        raise toml.missing(where, "direction")
    return LawContact.from_plain(table)


def drive_entry(value: Any, where: str, folder: Path) -> Any:
    """A drive from its entry: a formula, or samples from their table."""
    if not isinstance(value, dict):
        return value
    from stickslip.model.entries.samples import Samples

    return Samples.from_plain(
        toml.mapping(value, where), where, folder, name=where.rpartition(".")[2].strip("'")
    )


def _table(value: Any, where: str, folder: Path) -> Any:
    """A table of its points, or of a file."""
    from stickslip.model.entries.tables import Table

    name = where.rpartition(".")[2].strip("'")
    return Table.from_plain(toml.mapping(value, where), where, folder, name=name)


def plain_or(kind: type[Any], value: Any, where: str, folder: Path) -> Any:
    """A plain value, or an entry from its table."""
    return toml.entry(kind, value, where) if isinstance(value, dict) else value


def _internal(value: Any, where: str, folder: Path) -> Any:
    """An internal variable with a law for its rate; with a period, one that is sampled."""
    table = toml.mapping(value, where)
    return toml.entry(Sampled if "period" in table else Internal, table, where)


def _structure(value: Any, where: str, folder: Path) -> Any:
    """A structure of files, or of a packed text."""
    from stickslip.structures.files import from_plain

    return from_plain(toml.mapping(value, where), where, folder)


_SYSTEMS = toml.Language(
    System,
    groups=(
        "name",
        "parameters",
        "functions",
        "coordinates",
        "contacts",
        "jumps",
        "translation",
        "conditions",
        "outputs",
    ),
    sections={
        "parameters": partial(plain_or, Parameter),
        "tables": _table,
        "drives": drive_entry,
        "coordinates": _coordinate,
        "structures": _structure,
        "internal": _internal,
        "contacts": _contact,
        "jumps": partial(toml.entry, Jump),
        "conditions": partial(toml.entry, Condition),
        "outputs": partial(plain_or, Output),
    },
    others={
        "dissipation": (
            "this file declares an evolution, not a system",
            "Use stickslip.load_evolution, or on the command line: stickslip evolve FILE",
        )
    },
)


@validated
def load(path: str | PathLike[str]) -> System:
    """Load a system from a model file.

    Parameters
    ----------
    path : str or path
        A model file in TOML.

    Raises
    ------
    DeclarationError
        If the file cannot be read or anything in it is wrong; the message names the file, the key,
        the reason and the remedy.
    """
    return _SYSTEMS.load(path)


def loads(text: str, where: str = "model") -> System:
    """The system that the text of a model file declares; `where` names the text in messages.

    Raises
    ------
    DeclarationError
        If anything in it is wrong.
    """
    return _SYSTEMS.loads(text, where)


SYSTEM = Part(System.to_toml, lambda text, where: loads(text, f"{where}: system"))
"""The system of a result, in its file."""


def save(system: System, path: str | PathLike[str]) -> None:
    """Write a system as a model file.

    Raises
    ------
    DeclarationError
        If the file cannot be written.
    """
    _SYSTEMS.save(system, path)


def dumps(system: System) -> str:
    """The system as the text of a model file; :func:`loads` gives it back, equal.

    What has its default value is left out, except the default of a parameter.
    """
    return _SYSTEMS.dumps(system)
