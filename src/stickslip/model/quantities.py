"""Units and meanings of quantities: parts of the state, drifts, forces, energies, and the named
measures of maps.

Declared are the units of coordinates, parameters, time and contacts; those of everything else
follow. What is declared without a unit is dimensionless.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np

from stickslip.arrays import Array
from stickslip.kept import made_once
from stickslip.model.entries.keys import normal_force
from stickslip.model.entries.units import (
    UnitPowers,
    agree,
    factors,
    lowest_terms,
    unit_product,
    unit_text,
)
from stickslip.model.formats.measurable import MEASURABLE, UnitKind
from stickslip.model.system import System
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS

FORCES = {
    "friction": "friction force of",
    "threshold_plus": "threshold for u > 0 of",
    "threshold_minus": "threshold for u < 0 of",
}
IN_PLANE = {
    "friction": "friction force of",
    "threshold": "semi-axis of the forces of",
}
"""The same of each component of a contact in a plane."""
ENERGIES = ("energy", "dissipated_energy", "supplied_energy")
_JOULE = lowest_terms(factors("J"))[1]


@lru_cache(4096)
def contact_key(name: str) -> str:
    """Contact name as part of a variable name."""
    return "".join(c if c.isalnum() else "_" for c in name)


def quantity(system: System, name: str) -> dict[str, str]:
    """Unit and meaning of a quantity; without ``units`` where the declared ones contradict each
    other.

    Parameters
    ----------
    name : str
        ``t``, a parameter, a coordinate ``x``, an internal variable, a rate ``d_x``, an
        acceleration ``dd_x``, a force or the slip speed of a contact (``friction_KEY``,
        ``slip_speed_KEY``, ...; in a plane ``friction_KEY_1``, ...), an energy, or an output.
    """
    system = system.plain
    found = _in_formulas(system, name)
    bare = name.removeprefix("d").removeprefix("d").removeprefix("_")
    own = next((x for x in (name, bare) if any(x in b for b in system.declaration.bodies)), None)
    if own is None:
        return found
    unit = _amplitude_unit(system)
    order = 0 if own == name else 2 if name.startswith("dd_") else 1
    said = None if unit is None else per_time(system, unit, order) if order else unit
    return described_as(found["long_name"], said)


def _in_formulas(system: System, name: str) -> dict[str, str]:
    """The same as formulas have it, where weights of modes are plain numbers: an amplitude has the
    unit of the unknowns."""
    named = {**system.parameters, **system.coordinates, **system.internal}
    if name in named:
        return described_as(named[name].meaning or name, named[name].unit or "1")
    if name == "t":
        return described_as("time", system.time_unit or "1")
    if output := system.outputs.get(name):
        unit = output.unit or formula_unit(system, system.declaration.outputs[name])
        return described_as(output.meaning or name, unit)
    if row := system.unknown(name):
        rate = name[:2] == "d_"
        unit = named[next(iter(row)).removeprefix("d_")].unit
        said = f"rate of {name[2:]}" if rate else name
        return described_as(said, per_time(system, unit) if rate else unit or "1")
    for prefix, order, what in (("dd_", 2, "acceleration"), ("d_", 1, "rate")):
        moving = named.get(name.removeprefix(prefix))
        if name.startswith(prefix) and moving is not None:
            return described_as(
                f"{what} of {moving.meaning or name[len(prefix) :]}",
                per_time(system, moving.unit, order),
            )
    if name in ENERGIES:
        return described_as(name.replace("_", " "), energy_unit(system))
    for contact, (side, _) in system.constraints.items():
        if name == f"normal_{contact_key(contact)}":
            unit = force_unit(system, normal_force(side))
            return described_as(f"modulus of the force of {contact}", unit)
    for contact in system.unilateral:
        key = contact_key(contact)
        normal = normal_force(contact)
        if name == f"normal_{key}":
            return described_as(f"normal force of {contact}", force_unit(system, normal))
        if name == f"gap_{key}":
            speed = slip_unit(system, normal)
            return described_as(
                f"gap of {contact}", None if speed is None else per_time(system, speed, -1)
            )
    for declared, parts in system.frictional.items():
        for i, contact in enumerate(parts, 1):
            key = contact_key(contact)
            said = declared if len(parts) == 1 else f"{declared}, component {i}"
            forces = forces_of(parts)
            if name == f"slip_speed_{key}":
                return described_as(f"relative velocity of {said}", slip_unit(system, contact))
            if (kind := name.removesuffix(f"_{key}")) in forces:
                return described_as(f"{forces[kind]} {said}", force_unit(system, contact))
    raise KeyError(name)


def quantity_or_formula(system: System, text: str) -> dict[str, str]:
    """The same of a formula of quantities, too, whose meaning is the formula itself.

    Raises
    ------
    DeclarationError
        If it is neither.
    """
    try:
        return quantity(system, text)
    except KeyError:
        return described_as(
            text, formula_unit(system, system.declaration.results.parse(text, text))
        )


def of_modes(
    rows: Mapping[str, Mapping[str, float]], values: Mapping[str, Array]
) -> dict[str, Array]:
    """Values of unknowns of structures from those of modes.

    Parameters
    ----------
    rows : mapping of str to mapping
        See :attr:`System.unknowns`.
    """
    found: dict[str, Array] = {}
    for name, row in rows.items():
        found[name] = np.zeros_like(next(iter(values.values())))
        for mode, weight in row.items():
            found[name] += weight * values[mode]
    return found


def forces_of(parts: Sequence[str]) -> dict[str, str]:
    """Kinds of published forces of each component of a dry contact, with their meanings."""
    return FORCES if len(parts) == 1 else IN_PLANE


def described_as(meaning: str, unit: str | None) -> dict[str, str]:
    """Attributes of a variable."""
    return ({} if unit is None else {"units": unit}) | {"long_name": meaning}


def per_time(system: System, unit: str, order: int = 1) -> str:
    """The unit of a rate, or of a higher derivative."""
    return unit_text(unit_product((factors(unit), 1), (factors(system.time_unit), -order)))


def _amplitude_unit(system: System) -> str | None:
    """The unit of amplitudes of modes of unit mass: half the square of their rate is an energy."""
    energy = energy_unit(system)
    if energy is None:
        return None
    scale, powers = lowest_terms(factors(energy))
    parts = powers if scale == 1.0 else factors(energy)
    return unit_text(unit_product((parts, 0.5), (factors(system.time_unit), 1)))


def slip_unit(system: System, contact: str) -> str | None:
    """The unit of a relative velocity; a number other than ±1 in it may have any unit."""
    system = system.plain
    declared = next(c for c in system.declaration.contacts if c.name == contact)
    terms = {
        x: unit_product(
            (_unit_of(system, weight), 1),
            (factors(per_time(system, system.coordinates[x].unit)), 1),
        )
        for x, weight in declared.direction.items()
    }
    plain = [
        x
        for x, weight in declared.direction.items()
        if weight.op != "num" or abs(ex.number(weight)) == 1.0
    ]
    return _common(terms[x] for x in plain or terms)


def force_unit(system: System, contact: str) -> str | None:
    """The unit of a friction force: the declared one, or the one for which its work is an
    energy."""
    declared = next(c for c in system.declaration.contacts if c.name == contact)
    if declared.unit and declared.plane == 3:
        # for the moment of a face: its power is that of a rotation
        first = contact.removesuffix("3") + "1"
        speed, turning = slip_unit(system, first), slip_unit(system, contact)
        if speed is None or turning is None:
            return None
        parts = (factors(declared.unit), 1), (factors(speed), 1), (factors(turning), -1)
        return unit_text(unit_product(*parts))
    if declared.unit:
        return declared.unit
    work = energy_unit(system)
    speed = slip_unit(system, contact)
    if work is None or speed is None:
        return None
    return unit_text(
        unit_product((factors(work), 1), (factors(speed), -1), (factors(system.time_unit), -1))
    )


def energy_unit(system: System) -> str | None:
    """The unit of all energies: of the work at a contact, or of a term of the energy; None if they
    contradict.

    A formula may hide units in its numbers (a mass of 1, say). So terms that are energies by their
    dimension decide; among equal units the one with the fewest factors is taken.
    """
    plain = system.plain
    # The unit is needed for every force and every amplitude of a mode, and a structure has many.
    return made_once(plain, "energy unit", lambda: _energy_unit_of(plain))


def _energy_unit_of(system: System) -> str | None:
    declared = [
        *system.parameters.values(),
        *system.coordinates.values(),
        *system.internal.values(),
    ]
    declared += system.dry_contacts.values()
    if not any(factors(unit) for unit in (system.time_unit, *(item.unit for item in declared))):
        return "1"
    d = system.declaration
    time = factors(system.time_unit)
    found: list[UnitPowers] = []
    for name, contact in system.dry_contacts.items():
        speed = slip_unit(system, name) if contact.unit else None
        if speed is not None:
            found.append(unit_product((factors(contact.unit), 1), (factors(speed), 1), (time, 1)))
    found += [
        _unit_of(system, term) for formula in (d.potential, d.kinetic) for term in _terms(formula)
    ]
    found += [
        unit_product((_unit_of(system, term), 1), (time, 1)) for term in _terms(d.dissipation)
    ]
    if not found:
        return "1"  # internal variables only: the energy is zero
    return _common([unit for unit in found if lowest_terms(unit)[1] == _JOULE] or found)


def _common(units: Iterable[UnitPowers]) -> str | None:
    """The common unit, with the fewest factors; None if units differ."""
    units = list(units)
    if not units or any(not agree(a, b) for a, b in pairwise(units)):
        return None
    return unit_text(min(units, key=len))


def _terms(formula: Expr) -> list[Expr]:
    """The terms of a sum that are not plain numbers."""
    if formula.op == "num":
        return []
    return [term for term, _ in formula.terms] if formula.op == "sum" else [formula]


def _unit_of(system: System, formula: Expr) -> UnitPowers:
    """The unit of a formula by those of the names in it."""

    def unit(name: str) -> str:
        return "" if name == "speed" else _in_formulas(system, name).get("units", "")

    return _unit_from(formula, unit)


def _unit_from(formula: Expr, unit: Callable[[str], str]) -> UnitPowers:
    """The unit of a formula: that of a term of a sum without unknown units; none for functions.

    Parameters
    ----------
    unit : callable
        The unit of a name.
    """
    match formula.op:
        case "sym":
            return factors(unit(str(formula.value)))
        case "sum":
            known = [(term, c) for term, c in formula.terms if _is_known(term)]
            if not known or formula.value:
                return {}
            # A number in front of a term may hide a unit, in front of a time a speed.
            shown, _ = min(
                known, key=lambda e: ("t" in e[0].symbols, abs(e[1]) != 1.0, ex.to_text(e[0]))
            )
            return _unit_from(shown, unit)
        case "prod":
            return unit_product(*((_unit_from(base, unit), power) for base, power in formula.terms))
        case "select":
            shown = next((part for part in formula.args[1:] if part.op != "num"), formula.args[1])
            return _unit_from(shown, unit)
        case op if op in FUNCTIONS and FUNCTIONS[op].tabulated:
            own, power = FUNCTIONS[op].unit
            over = _unit_from(formula.args[0], unit) if own and power else {}
            return unit_product((factors(own), 1), (over, power))
        case _:
            return {}


def _is_known(formula: Expr) -> bool:
    """Whether all samples and tables in an expression have declared units."""
    tables = (FUNCTIONS[e.op] for e in ex.walk([formula]) if e.op in FUNCTIONS)
    return all(row.unit[0] or row.sampled for row in tables if row.tabulated)


def drift_units(system: System, direction: Mapping[str, float]) -> tuple[str, str]:
    """Units of a shift along a direction and of its rate; ``"1"`` if the components have none in
    common."""
    found = {quantity(system, name).get("units") for name, weight in direction.items() if weight}
    drift = found.pop() if len(found) == 1 else None
    if drift is None:
        return "1", "1"
    return drift, per_time(system, drift)


def described(system: System, text: str) -> dict[str, str]:
    """Unit and meaning of a named measure, such as ``amplitude:psi``."""
    name, _, of = text.partition(":")
    known = MEASURABLE.get(name)
    meaning = known.meaning if known else name.replace("_", " ")
    unit = UNITS[known.unit if known else "1"]
    if name == "stick_fraction":
        return described_as(f"{meaning} of {_who_sticks(system, of)}", unit(system, of))
    return described_as(f"{meaning} ({of})" if of else meaning, unit(system, of))


def _who_sticks(system: System, of: str) -> str:
    """The contact whose stick fraction it is: the one that is named, or the only one."""
    known = list(system.frictional)
    return of or (known[0] if len(known) == 1 else "all contacts")


def _none(system: System, of: str) -> str:
    return "1"


def _radian(system: System, of: str) -> str:
    return "rad"


def _time(system: System, of: str) -> str:
    return system.time_unit or "1"


def _component(system: System, of: str) -> str:
    return quantity_or_formula(system, of or system.declaration.state[0]).get("units", "1")


def _speed(system: System, of: str) -> str:
    return per_time(system, _component(system, of or next(iter(system.translation), "")))


def _force(system: System, of: str) -> str | None:
    contact = of or next(iter(system.dry_contacts), "")
    return force_unit(system, contact) if contact in system.dry_contacts else "1"


def _work(system: System, of: str) -> str | None:
    return energy_unit(system)


def _quantity(system: System, of: str) -> str | None:
    return quantity_or_formula(system, of or system.declaration.state[0]).get("units")


def _per_distance(system: System, of: str) -> str | None:
    return per_distance_unit(system, _component(system, of or next(iter(system.translation), "")))


def per_distance_unit(system: System, distance: str) -> str:
    """The unit of an energy per distance: that of a force, if these agree."""
    energy = described(system, "energy_per_cycle").get("units", "1")
    force = described(system, "peak_force").get("units", "1")
    if distance == "1" or energy == f"{force}*{distance}":
        return force
    return f"{energy}/{distance}" if distance.isalpha() else f"{energy}/({distance})"


def formula_unit(system: System, formula: Expr) -> str:
    """The unit of a formula by those of the names in it."""
    return unit_text(_unit_of(system.plain, formula))


def unit_of_measures(system: System, formula: Expr) -> str:
    """The unit of a formula of named measures, parameters and parts of the state."""
    own = {*system.parameters, *system.declaration.state}

    def unit(name: str) -> str:
        found = quantity(system, name) if name in own else described(system, name)
        return found.get("units", "")

    return unit_text(_unit_from(formula, unit))


def _exponent(system: System, of: str) -> str:
    return per_time(system, "")


UNITS: dict[UnitKind, Callable[[System, str], str | None]] = {
    "1": _none,
    "angle": _radian,
    "component": _component,
    "energy": _work,
    "force": _force,
    "growth": _exponent,
    "quantity": _quantity,
    "rate": _speed,
    "resistance": _per_distance,
    "time": _time,
}
"""The unit of a measure, by its kind, from the system and what the measure is taken of."""
