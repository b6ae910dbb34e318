"""Measures of a period of a motion: phases, time in stick and slip, energy by contact, drift."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short
from stickslip.model.entries.keys import normal_force
from stickslip.model.entries.units import agree, factors
from stickslip.model.quantities import contact_key, described, formula_unit
from stickslip.model.system import System
from stickslip.motion.audit.observers import LASTED, Sums
from stickslip.motion.record.knots import IS_CLOSED, IS_OPEN
from stickslip.numerics.levels import SAME_VALUE
from stickslip.orbits.cycles.over_period import mean
from stickslip.orbits.return_map.recurrence import segments
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import Scope

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


@dataclass(frozen=True)
class Phase:
    """A stretch of a cycle in one mode and region.

    Attributes
    ----------
    modes : dict of str to int
        By contact: 0 stick, +1 or −1 slip, 2 open, 3 closed without friction.
    region : tuple of int
        By kink of the formulas: 1 where its guard is ≥ 0.
    """

    duration: float
    modes: dict[str, int]
    region: tuple[int, ...]

    @property
    def sticks(self) -> bool:
        """Whether all closed contacts stick."""
        rests = {0, IS_CLOSED}
        found = set(self.modes.values())
        return bool(found & rests) and found <= {*rests, IS_OPEN}


@dataclass(frozen=True)
class ContactShare:
    """Stick time, slip time and dissipated energy of a contact in a period.

    Attributes
    ----------
    dissipated : float
        Energy dissipated by friction, without impacts.
    open_time : float
        Time during which the contact is open; closed without friction counts as slip.
    impact_loss : float
        Energy lost at all contacts in the impacts of this contact.
    """

    stick_time: float
    slip_time: float
    dissipated: float
    open_time: float = 0.0
    impact_loss: float = 0.0


def phases(motion: Trajectory) -> tuple[Phase, ...]:
    """The phases of a period; the phase in which it starts and ends comes first, in one piece."""
    k = motion.knots
    # Contacts of laws with internal variables neither stick nor slip.
    names = [name for name in motion.system.contacts if contact_key(name) in motion.modes]
    mode = {name: motion.modes[contact_key(name)] for name in names}
    found = list[Phase]()
    for a, b in segments(motion):
        modes = {name: int(mode[name][a]) for name in names}
        phase = Phase(float(k.time[b] - k.time[a]), modes, tuple(map(int, k.region[a])))
        if found and (found[-1].modes, found[-1].region) == (phase.modes, phase.region):
            phase = Phase(found.pop().duration + phase.duration, modes, phase.region)
        found.append(phase)
    if len(found) > 1 and (found[0].modes, found[0].region) == (found[-1].modes, found[-1].region):
        whole = Phase(found[0].duration + found[-1].duration, found[0].modes, found[0].region)
        found = [whole, *found[1:-1]]
    return tuple(found)


def contact_shares(motion: Trajectory, sums: Sums) -> dict[str, ContactShare]:
    """Time and energy of every contact."""
    members = motion.problem.compiled.equations.members
    lasted = float(sums.total[LASTED])
    found = {
        contact.name: ContactShare(
            float(stick),
            lasted - float(stick),
            float(work) if len(own) == 1 or contact.opens else dissipated_by(motion, contact.name),
        )
        for own, stick, work in zip(members, sums.stick, sums.work, strict=True)
        for contact in own
    }
    for name, parts in motion.system.planes.items():
        own, *others = (found.pop(part) for part in parts)
        lost = own.dissipated + sum(other.dissipated for other in others)
        found[name] = replace(own, dissipated=lost)
    for name, sides in motion.system.constraints.items():
        for side in sides:
            found.pop(normal_force(side))
        found.setdefault(name, ContactShare(0.0, lasted, 0.0))
    impacts = motion.impacts
    for name in motion.system.unilateral:
        closed = found.pop(normal_force(name)).stick_time
        own = found.get(name, ContactShare(0.0, lasted, 0.0))
        lost = np.sum(
            np.asarray(impacts["energy"])[np.asarray(impacts["contact"]) == contact_key(name)]
        )
        found[name] = ContactShare(
            own.stick_time, closed - own.stick_time, own.dissipated, lasted - closed, float(lost)
        )
    return found


def dissipated_by(motion: Trajectory, name: str) -> float:
    """Energy dissipated in a period by one of several contacts that slip as one."""
    key = contact_key(name)
    period = float(motion.knots.time[-1] - motion.knots.time[0])
    power, _ = mean(motion, f"friction_{key}*slip_speed_{key}")
    return -period * power


def weight(system: System, text: str, values: Mapping[str, float]) -> float:
    """A weight, given as a formula of the parameters.

    Raises
    ------
    DeclarationError
        If it is not a formula of the parameters, is not positive, or lacks the unit of a force.
    """
    where = f"weight {short(text)}"
    formula = read_weight(system, text)
    unit, force = factors(formula_unit(system, formula)), factors(_force_unit(system))
    if unit and force and not agree(unit, force):
        said = formula_unit(system, formula)
        raise DeclarationError(
            where,
            f"its unit is {said}, but a weight has the unit {_force_unit(system)}",
            "Write it as m*g",
        )
    found = ex.evaluate(formula, values)
    if not found > 0.0:
        raise DeclarationError(where, f"the weight is {found:g}", "Give a positive weight")
    return found


def read_weight(system: System, text: str) -> Expr:
    """The formula of a weight.

    Raises
    ------
    DeclarationError
        If it is not a formula of the parameters.
    """
    names = {name: ex.sym(name) for name in system.parameters}
    return Scope(names).parse(text, f"weight {short(text)}")


def _force_unit(system: System) -> str:
    return described(system, "peak_force").get("units", "1")


def drift_of(system: System, shift: Array) -> tuple[dict[str, float], float]:
    """Direction and size of the shift of the state in a period."""
    names = system.declaration.state
    size = float(np.max(np.abs(shift)))
    declared = np.array([float(system.plain.translation.get(name, 0.0)) for name in names])
    if np.any(declared):
        along = float(declared @ shift / (declared @ declared))
        if np.max(np.abs(shift - along * declared)) <= SAME_VALUE * size:
            return {name: float(w) for name, w in zip(names, declared, strict=True) if w}, along
    if size == 0.0:
        return {}, 0.0
    top = float(shift[np.argmax(np.abs(shift))])
    return {name: float(w / top) for name, w in zip(names, shift, strict=True) if w}, top
