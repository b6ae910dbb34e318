"""The types of a declaration's entries, checked against the annotations of its classes before
anything is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from numbers import Real
from typing import Any

from stickslip.errors import DeclarationError
from stickslip.model.entries.declared import CROSSINGS, IMPACT_LAWS
from stickslip.model.formats.expected import EXPECTED, entry_key, wrong_kind
from stickslip.model.system import (
    AnyContact,
    AnyInternal,
    Condition,
    Coordinate,
    Jump,
    LawContact,
    Output,
    Parameter,
)
from stickslip.symbolic.formulas import TimeFunction

_CLASSES = {
    "Parameter": Parameter,
    "Coordinate": Coordinate,
    "AnyInternal": AnyInternal,
    "AnyContact": AnyContact,
    "Jump": Jump,
    "Condition": Condition,
    "Output": Output,
}
_MOST_ENTRIES = 50_000
"""In a section: what a computer holds, since all costs are in proportion; what would grow faster is
limited where it is (:mod:`stickslip.equations.coupling`)."""


def check_shape(item: Any, where: str = "") -> None:
    """Reject a declaration whose entries have the wrong types, before anything is read.

    Raises
    ------
    DeclarationError
    """
    for entry in fields(item):
        key = f"{where}.{entry.name}" if where else entry.name
        if isinstance(item, LawContact) and entry.name == "values":
            key = where  # in a model file they are entries of the contact
        _check_kind(getattr(item, entry.name), str(entry.type), key)


def _check_kind(value: Any, kind: str, where: str) -> None:
    if kind.endswith(" | None"):
        if value is None:
            return
        kind = kind.removesuffix(" | None")
    if kind.startswith("Entries["):
        kind = f"Mapping[str, {kind[len('Entries[') : -1]}]"
    if kind.startswith("Mapping["):
        if not isinstance(value, Mapping):
            raise wrong_kind(value, "table", where)
        if len(value) > _MOST_ENTRIES:
            raise DeclarationError(
                where,
                f"{len(value)} entries were given (at most {_MOST_ENTRIES})",
                "Declare a smaller system",
            )
        for name, entry in value.items():
            if not isinstance(name, str):
                raise DeclarationError(where, "a key is not a string", "Use names as keys")
            _check_kind(entry, kind[len("Mapping[str, ") : -1], entry_key(where, name))
    elif kind == "Any":
        return
    elif kind == "AnyStructure":
        from stickslip.structures.coordinates import InModes
        from stickslip.structures.structure import Structure

        if not isinstance(value, Structure | InModes):
            raise wrong_kind(value, "AnyStructure", where)
    elif kind == "AnyTable":
        from stickslip.model.entries.tables import Table

        if not isinstance(value, Table):
            raise wrong_kind(value, kind, where)
    elif kind in _CLASSES:
        if not isinstance(value, _CLASSES[kind]):
            raise wrong_kind(value, kind if kind in EXPECTED else "table", where)
        check_shape(value, where)
    elif not _has_kind(value, kind):
        raise wrong_kind(value, kind, where)


def _has_kind(value: Any, kind: str) -> bool:
    match kind:
        case "str" | "Direction" | "Dissipating":
            return isinstance(value, str)
        case "Direction | tuple[Direction, Direction]":
            return isinstance(value, str) or _is_pair(value, "str")
        case "Passing":
            return isinstance(value, str) and value in CROSSINGS
        case "ImpactLaw":
            return isinstance(value, str) and value in IMPACT_LAWS
        case "float":
            return isinstance(value, Real) and not isinstance(value, bool)
        case "int":
            return isinstance(value, int) and not isinstance(value, bool)
        case "Formula":
            return _has_kind(value, "str") or _has_kind(value, "float")
        case "Drive":
            return isinstance(value, TimeFunction) or _has_kind(value, "Formula")
        case "Formula | tuple[Formula, ...]" if isinstance(value, tuple):
            return all(_has_kind(v, "Formula") for v in value)
        case "FormulaTable" if isinstance(value, tuple):
            return all(_has_kind(v, "FormulaTable") for v in value)
        case "FormulaTable" | "Formula | tuple[Formula, ...]":
            return _has_kind(value, "Formula")
        case "tuple[float, float]":
            return _is_pair(value, "float")
        case "tuple[Formula, Formula]":
            return _is_pair(value, "Formula")
        case "Axes":
            return _is_pair(value, "Formula") or _is_triple(value, "Formula")
        case "Direction | tuple[Direction, ...]":
            return isinstance(value, str) or _is_pair(value, "str") or _is_triple(value, "str")
        case "SurfaceSpeed" if _is_triple(value, "Formula"):
            return True
        case _:
            return _is_pair(value, "Formula") or _has_kind(value, "Formula")


def _is_pair(value: Any, kind: str) -> bool:
    return isinstance(value, tuple) and len(value) == 2 and all(_has_kind(v, kind) for v in value)


def _is_triple(value: Any, kind: str) -> bool:
    return isinstance(value, tuple) and len(value) == 3 and all(_has_kind(v, kind) for v in value)
