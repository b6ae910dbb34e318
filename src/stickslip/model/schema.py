"""The types of a declaration's entries, checked against the annotations of its classes before
anything is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from numbers import Real
from typing import Any

from stickslip.errors import DeclarationError, short
from stickslip.model.entries.declared import CROSSINGS, IMPACT_LAWS
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
from stickslip.symbolic.formulas import NAME, TimeFunction

PLANAR = (
    "Write it like 'd_x' or 'd_x2 - d_x1'; friction in a plane is a contact with a threshold and "
    "two directions, like direction = ['d_x', 'd_y']"
)
"""What to do instead of one direction that is no linear combination of rates."""
_EXPECTED = {
    "str": ("a string", 'Write it in quotes, like "N/m"'),
    "float": ("a number", "Write it without quotes, like 0.5"),
    "Formula": ("a formula", 'Write it in quotes, like "k*x", or give a number'),
    "Drive": (
        "a formula or samples",
        'Write "V*t", or {file = "base.csv", time = "t", value = "a"}',
    ),
    "Formula | tuple[Formula, Formula]": (
        "a formula or a pair of formulas",
        'Write "mu*m*g" or ["f_plus", "f_minus"]',
    ),
    "SurfaceSpeed": (
        "a formula or a pair of formulas",
        'Write "V", or both components for a contact in a plane, like ["V", 0]',
    ),
    "Axes": ("two or three half axes", "Write it like [1.0, 0.6]"),
    "Direction | tuple[Direction, ...]": (
        "one to three linear combinations of rates",
        "Write it like 'd_x' or 'd_x2 - d_x1'; friction in a plane has two components, like "
        "['d_x', 'd_y'], a face that rotates has three, like ['d_x', 'd_y', 'd_phi']",
    ),
    "Dissipating": (
        "a formula of the velocity",
        "Write it like 'sqrt(v1**2 + 4*v2**2)', or give an Ellipsoid or a SupportFormula",
    ),
    "Passing": ("a direction of zero crossing", 'Write "falling", "rising" or "both"'),
    "ImpactLaw": ("an impact law", 'Write "together" or "in turn"'),
    "Direction": ("one linear combination of rates", PLANAR),
    "Direction | tuple[Direction, Direction]": (
        "a linear combination of rates, or a pair",
        "Write it like 'd_x' or 'd_x2 - d_x1'; friction in a plane has two components, "
        "like ['d_x', 'd_y']",
    ),
    "Formula | tuple[Formula, ...]": (
        "a formula or a list of formulas",
        'Write "mu*m*g", or [1.0, "2*F"] for several elements',
    ),
    "FormulaTable": ("a formula or lists of formulas", 'Write "k*t", or ["sin(t)", "2*t"]'),
    "int": ("an integer", "Write it without quotes, like 40"),
    "tuple[Formula, Formula]": ("a pair of formulas", 'Write it like [0, "2*pi/omega"]'),
    "tuple[float, float]": ("a pair of numbers", "Write it like [0, 100]"),
    "AnyStructure": (
        "a structure",
        'Give ss.Structure(mass, stiffness); in a model file {mass = "M.mtx", stiffness = "K.mtx"}',
    ),
    "AnyTable": (
        "a table",
        "Give ss.Table(points, values); in a model file "
        '{file = "mu.csv", of = "speed", value = "mu"}',
    ),
    "Output": (
        "a formula",
        'Write it in quotes, like "x1 - x2", or {formula = "x1 - x2", unit = "m"}',
    ),
    "Parameter": (
        "a number or a parameter",
        'Write it like 1.5, or ss.Parameter(1.5, "N/m"); in a file {default = 1.5, unit = "N/m"}',
    ),
    "table": (
        "a table",
        "Write it like {name = value} or Parameter(1.0), as for the other entries of this section",
    ),
}
"""What a field of a declaration holds, by its annotation, and how that is written."""

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
    """Refuse a declaration whose entries have the wrong types, before anything is read.

    Raises
    ------
    DeclarationError
    """
    for entry in fields(item):
        key = f"{where}.{entry.name}" if where else entry.name
        if isinstance(item, LawContact) and entry.name == "values":
            key = where  # in a model file they stand beside the others
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
            raise wrong_kind(value, kind if kind in _EXPECTED else "table", where)
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


def wrong_kind(value: Any, expected: str, where: str) -> DeclarationError:
    """The error for a value that is not of the expected kind, a key of :data:`_EXPECTED`."""
    names = {
        "dict": "a table",
        "list": f"a list of {len(value)}" if isinstance(value, list) else "",
        "tuple": f"a list of {len(value)}" if isinstance(value, tuple) else "",
        "str": "a string",
        "bool": "true or false",
    }
    kind = type(value).__name__
    if expected in ("Passing", "ImpactLaw"):
        names |= {"str": f"'{short(str(value))}'"}
    found = (
        names.get(kind, f"a value of type {kind}") if not _has_kind(value, "float") else "a number"
    )
    what, remedy = _EXPECTED[expected]
    return DeclarationError(where, f"expected {what}, got {found}", remedy)


def entry_key(section: str, name: str) -> str:
    """The full key of an entry, such as ``contacts.'right leg'``."""
    return (
        f"{section}.{name}"
        if NAME.match(name) and section != "contacts"
        else f"{section}.'{short(name)}'"
    )
