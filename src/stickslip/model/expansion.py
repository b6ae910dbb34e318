"""The parts of a system during its expansion: their names, and additional forces."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar, cast

from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.model.entries.keys import normal_force
from stickslip.model.entries.units import check_unit
from stickslip.model.formats.expected import entry_key, wrong_kind
from stickslip.model.names import DeclaredNames, parse_range
from stickslip.model.system import (
    AnyContact,
    AnyStructure,
    Bilateral,
    Coordinate,
    Drive,
    Formula,
    Internal,
    LawContact,
    System,
    Unilateral,
    Viscous,
)
from stickslip.structures.names import entry_of, is_entry
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.formulas import (
    NAME,
    Indexed,
    Scope,
    formula_text,
    parse_signature,
)

if TYPE_CHECKING:
    from stickslip.model.entries.tables import Table
_Part = TypeVar("_Part")
_WORD = re.compile(r"(?<![\w.])[A-Za-z]\w*")  # a name in a formula, not the e of 1e5


class Expansion:
    """The parts of a system during its expansion, and operations on them.

    Attributes
    ----------
    ranges : list of (str, str, str)
        Of each parameter of a law: where it stands, what it is called now, its range.
    origins : dict of str to str
        Where in the system as it was declared a part of the new one comes from.
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self.functions: dict[str, Formula] = dict(system.functions)
        self.tables: dict[str, Table] = dict(system.tables)
        self.coordinates: dict[str, Coordinate] = dict(system.coordinates)
        self.internal: dict[str, Internal] = {
            name: part if isinstance(part, Internal) else Internal(0.0, part.unit, part.meaning)
            for name, part in system.internal.items()
        }
        self.jumps = dict(system.jumps)
        self.quotients: list[tuple[str, str, str]] = []
        self.contacts: dict[str, AnyContact] = {}
        self.energies: dict[str, list[Formula]] = {
            name: [getattr(system, name)] for name in ("kinetic", "potential", "viscous")
        }
        self.structures: dict[str, AnyStructure] = dict(system.structures)
        for name, structure in self.structures.items():
            # Before laws, because their sliders inherit the unit.
            check_unit(structure.unit, f"{entry_key('structures', name)}.unit")
        self.forces = {self.unknown("forces", x): force for x, force in system.forces.items()}
        self.initial = {
            self.unknown("initial", x) if is_entry(x) else x: value
            for x, value in system.initial.items()
        }
        self.translation = dict(system.translation)
        self.ranges: list[tuple[str, str, str]] = []
        self.origins: dict[str, str] = {}

    def result(self) -> System:
        energies = {
            name: [part for part in parts if part != 0.0] or [0.0]
            for name, parts in self.energies.items()
        }
        # In brackets, a declared formula means the same as alone, or is an error.
        joined = {
            name: " + ".join(f"({part})" for part in parts) if len(parts) > 1 else parts[0]
            for name, parts in energies.items()
        }
        return replace(
            self.system,
            functions=self.functions,
            tables=self.tables,
            coordinates=self.coordinates,
            internal=self.internal,
            jumps=self.jumps,
            contacts=self.contacts,
            structures=self.structures,
            forces={},
            initial=self.initial,
            translation=self.translation,
            **joined,
        )

    def as_declared(self, error: DeclarationError) -> DeclarationError:
        """Restate an error of the expanded system for the declared one."""
        for part, origin in self.origins.items():
            if error.where == part or error.where.startswith(f"{part}."):
                return DeclarationError(origin, error.reason, error.remedy)
        return error

    def add_contact(self, label: str, contact: AnyContact, where: str) -> None:
        """Add a contact that a declared one is written out as.

        Raises
        ------
        DeclarationError
            If its name is taken.
        """
        own = entry_key("contacts", label) == where
        if label in self.contacts or (label in self.system.contacts and not own):
            raise DeclarationError(
                where, f"it needs the name '{label}', which is already used", "Rename one of them"
            )
        self.contacts[label] = contact
        self.origins[entry_key("contacts", label)] = where

    def number(self, formula: str, words: Mapping[str, str], where: str) -> float:
        """Value of a formula of the parameters of a law, with their declared values."""
        names = DeclaredNames()
        names.functions("functions", self.functions)
        known = {name: ex.sym(name) for name in self.system.parameters}
        meant = Scope(known, names.with_derivatives()).parse(renamed(formula, words), where)
        return ex.evaluate(meant, self.system.values)

    @cached_property
    def scope(self) -> Scope:
        """Meanings of names in the direction and the parameters of a law."""
        system = self.system
        names = DeclaredNames()
        names.functions("functions", system.functions)
        names.tables(system.tables)
        names.functions("drives", system.drives, clock="t")
        names.outputs(system.outputs)
        known = ["t", *system.parameters, *system.coordinates, *system.internal]
        known += [f"d_{x}" for x in system.coordinates]
        symbols = {name: ex.sym(name) for name in known}
        return Scope(symbols, names.with_derivatives(), vectors=self.unknowns())

    def unknown(self, section: str, text: str) -> str:
        """The name of an unknown, or of its rate, as symbols have it.

        Raises
        ------
        DeclarationError
            If there is no such name.
        """
        try:
            prefix, name, index = entry_of(text, self.structures)
        except KeyError as error:
            where = entry_key(section, text)
            if text in self.coordinates:
                remedy = f"Write it under coordinates.{text}.force"
                raise DeclarationError(
                    where, "not a degree of freedom of a structure", remedy
                ) from None
            raise DeclarationError(where, "no such degree of freedom", error.args[0]) from None
        if prefix and section == "forces":
            raise DeclarationError(
                entry_key(section, text),
                "a force acts on a coordinate, not on its rate",
                f"Write {text[2:]}",
            )
        return f"{prefix}{name}[{self.structures[name].key(index)}]"

    def unknowns(self) -> dict[str, Indexed]:
        """Unknowns of structures and their rates, by name."""
        if not self.system.structures:
            return {}
        from stickslip.structures.coordinates import BySymbols

        return {
            f"{prefix}{name}": BySymbols(f"{prefix}{name}", structure)
            for name, structure in self.system.structures.items()
            for prefix in ("", "d_")
        }

    def slopes(self, contact: LawContact, where: str) -> dict[str, str]:
        """Coefficients of the rates in a direction, by coordinate or unknown of a structure."""
        text = self.scope.parse(contact.direction, f"{where}.direction")
        unknowns = sorted(n[2:] for n in text.symbols if is_entry(n) and n.startswith("d_"))
        moving = [*self.system.coordinates, *unknowns]
        rates = {f"d_{x}": ex.sym(f"d_{x}") for x in moving}
        found: dict[str, str] = {}
        for x in moving:
            slope = ex.derivative(text, f"d_{x}")
            if slope.symbols & rates.keys() or ex.bends(text, rates):
                raise DeclarationError(
                    f"{where}.direction",
                    "not a linear combination of rates",
                    "Write it like 'd_x' or 'd_x2 - d_x1'",
                )
            if slope is not ex.ZERO:
                found[x] = formula_text(slope, f"{where}.direction")
        rest = ex.substitute(text, dict.fromkeys(rates, ex.ZERO))
        if not found and rest is ex.ZERO and contact.surface_speed == 0.0:
            raise DeclarationError(
                f"{where}.direction",
                "the direction is zero, and so is the surface speed",
                "Write it like 'd_x' or 'd_x2 - d_x1', or give a surface_speed",
            )
        if rest is not ex.ZERO:
            raise DeclarationError(
                f"{where}.direction",
                f"it contains '{formula_text(rest, where)}', which is not a rate",
                "Move it to 'surface_speed'",
            )
        return found

    def unit_of_way(self, slopes: Mapping[str, str]) -> str:
        """The unit of displacements along a direction, if all coordinates have the same one."""
        units = {
            self.structures[entry_of(x, self.structures)[1]].unit
            if is_entry(x)
            else self.system.coordinates[x].unit
            for x in slopes
        }
        return units.pop() if len(units) == 1 else ""

    def is_pressed(self, value: object) -> bool:
        """Whether a parameter of a law is a formula of normal forces."""
        normals = {
            normal_force(name)
            for name, contact in self.system.contacts.items()
            if isinstance(contact, Unilateral | Bilateral)
        }
        return isinstance(value, str) and bool(normals & {*_WORD.findall(value)})

    def define(self, where: str, name: str, value: object, interval: str) -> str:
        """Name of a parameter of a law: its value, if that is a name or 0, else that of a function
        without arguments."""
        if isinstance(value, tuple):
            raise wrong_kind(value, "Formula", where)
        meant = self.scope.parse(value, where)
        if meant.symbols <= self.system.parameters.keys():
            parse_range(interval, where).check(ex.evaluate(meant, self.system.values), where)
        if meant is ex.ZERO:
            return "0"  # the term that it multiplies is absent and not shown
        if isinstance(value, str) and NAME.match(value.strip()):
            name = value.strip()
        else:
            self.take(self.functions, name, cast(Formula, value), where)
        self.ranges.append((where, name, interval))
        return name

    def take(self, section: dict[str, _Part], name: str, part: _Part, where: str) -> None:
        """Add a part that the law needs, unless the system has something of that name."""
        bare = parse_signature(name, where)[0]
        system = self.system
        drives: Mapping[str, Drive] = system.drives
        declared = {parse_signature(f, f)[0] for f in (*self.functions, *drives)}
        parts = {*self.coordinates, *self.internal, *self.tables, *system.outputs}
        if bare in {*system.parameters, *parts, *declared}:
            raise DeclarationError(
                where,
                f"its law needs the name '{bare}', which is already used",
                "Rename one of them",
            )
        section[name] = part

    def push(self, x: str, slope: str, force: str) -> None:
        """Add a force against the velocity to one coordinate or unknown of a structure."""
        term = {"1": f"-{force}", "-1": force}.get(slope, f"-({slope})*{force}")
        before = self.forces.get(x, 0.0) if is_entry(x) else self.coordinates[x].force
        total = term if before == 0.0 else f"({before}) {term if term[0] == '-' else '+ ' + term}"
        if is_entry(x):
            self.forces[x] = total
        else:
            self.coordinates[x] = replace(self.coordinates[x], force=total)

    def resist(self, x: str, slope: str, force: str, where: str) -> None:
        """Add a resistance that increases with the velocity to a coordinate without mass."""
        coordinate = self.coordinates[x]
        assert isinstance(coordinate, Viscous)
        term = force if slope == "1" else f"({slope})*{force}"
        total = term if coordinate.drag == 0.0 else f"({coordinate.drag}) + {term}"
        self.coordinates[x] = replace(coordinate, drag=total)
        self.origins[f"coordinates.{x}.drag"] = where


def renamed(text: str, words: Mapping[str, str]) -> str:
    """A formula of a law with the names that its own have in the system."""
    return _WORD.sub(lambda match: words.get(match[0], match[0]), text)
