"""Modes in which there may be equilibria."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np

from stickslip.equations.derive import MotionEquations, derive
from stickslip.errors import DeclarationError, short
from stickslip.model.declaration import DryContact
from stickslip.model.system import System
from stickslip.numerics.levels import COMPUTED_ZERO
from stickslip.orbits.fields.steady import Array
from stickslip.symbolic import expressions as ex


def autonomous(system: System) -> MotionEquations:
    """The equations of a system that does not depend on time.

    Raises
    ------
    DeclarationError
        If it does.
    """
    equations = derive(system.declaration)
    if equations.timed:
        drives = [name for name, e in system.declaration.drives.items() if "t" in e.symbols]
        raise DeclarationError(
            system.name,
            "its equations depend on time" + (f" (drive '{short(drives[0])}')" if drives else ""),
            "Set the drive to a constant, or find cycles with find_cycle",
        )
    return equations


def surface_speed(contact: DryContact, values: Mapping[str, float]) -> float:
    """Speed of a contact's surface (of a system that does not depend on time)."""
    return ex.evaluate(contact.speed, {**values, "t": 0.0})


def possible_modes(
    equations: MotionEquations, values: Mapping[str, float], at: Mapping[str, float], moved: Array
) -> list[list[dict[int, int]]]:
    """Possible modes of contacts in steady motion, for groups of dependent contacts: every choice
    of one element of each list is a mode of the system.

    In steady motion u = j·(translation) − w: if no translation moves a contact, its surface speed
    alone determines the mode. A contact that can open is open, without friction, or closed.

    Parameters
    ----------
    values, at : mapping of str to float
        Parameters, and a state.
    moved : array, shape (states, translations)
    """
    state = equations.declaration.state
    alone: list[tuple[int, ...]] = []
    for c in equations.contacts:
        weights = np.zeros(len(state))
        for x, j in c.direction.items():
            weights[state.index(x)] = ex.evaluate(j, {**values, **at})
        w = surface_speed(c, {**at, **values})
        free = np.any(np.abs(weights @ moved) > COMPUTED_ZERO * np.max(np.abs(weights)))
        turns = bool(c.speed.symbols & frozenset(state))  # a surface whose places have speeds
        alone.append((0, 1, -1) if free or turns else (-int(np.sign(w)),))
    found = []
    for parts in (plane.parts for plane in equations.planes):
        all_modes = sorted({abs(m) for part in parts for m in alone[part]})
        if all(len(alone[part]) == 1 for part in parts):
            all_modes = all_modes[-1:]
        found.append([dict.fromkeys(parts, m) for m in all_modes])
    in_plane = {i for plane in equations.planes for i in plane.parts}
    opening = [i for i, c in enumerate(equations.contacts) if c.opens]
    pressing = {i: equations.pressing(i) for i in range(len(alone))}
    choices: list[dict[int, int]]
    others = dict[int, list[dict[int, int]]]()
    for normals, rubbing in _joined(opening, pressing):
        choices = []
        for states in product((0, 1), repeat=len(normals)):
            opened = dict(zip(normals, states, strict=True))
            mode = [opened.get(i, 0) for i in range(len(alone))]
            sides = [(1,) if equations.is_loose(j, mode) else alone[j] for j in rubbing]
            choices += [
                {**opened, **dict(zip(rubbing, slips, strict=True))} for slips in product(*sides)
            ]
        others[normals[0]] = choices
    free = [i for i in range(len(alone)) if not pressing[i] and i not in {*opening, *in_plane}]
    others |= {i: [{i: m} for m in alone[i]] for i in free}
    return [*found, *(others[i] for i in sorted(others))]


def _joined(
    opening: list[int], pressing: dict[int, list[int]]
) -> list[tuple[list[int], list[int]]]:
    """Groups of contacts that can open, with the friction under their normal forces; joined if
    friction depends on several of them."""
    groups = [({n}, {j for j, normals in pressing.items() if n in normals}) for n in opening]
    found = list[tuple[set[int], set[int]]]()
    for normals, rubbing in groups:
        for other in [o for o in found if o[1] & rubbing]:
            found.remove(other)
            normals, rubbing = normals | other[0], rubbing | other[1]
        found.append((normals, rubbing))
    return [(sorted(normals), sorted(rubbing)) for normals, rubbing in found]
