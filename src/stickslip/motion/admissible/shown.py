"""Reported forces of contacts that share forces: those of minimum norm, if they are admissible.

The least forces that rest needs, in units of the thresholds, may be too large for one contact where
others hold more. Then those are shown that are first inside their sets on the straight way to the
forces that :mod:`stickslip.motion.admissible.overload` finds there. They have the same sum, and
depend continuously on time.
"""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.motion.admissible.overload import (
    GIVEN_FORCES,
    RADIUS,
    fits,
    inner_forces,
    overload,
    place_held,
)
from stickslip.motion.admissible.sharing import is_first, orthonormalise, sticks_in
from stickslip.motion.steps.arrays import Flow
from stickslip.motion.steps.contacts import directions_of, inertial_contacts
from stickslip.motion.steps.sets import axis_of, given_force, part_to_set
from stickslip.translator import compiled


@compiled(brief=True)
def show_admissible(flow: Flow, mode: Array, table: Array) -> None:
    """Make forces of contacts that share them admissible.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    table : array
        Values of the rows; those of the forces are changed.
    """
    rows = flow.rows
    for first in rows.sharing:
        group = rows.group[first]
        if mode[first] != 0 or not is_first(rows, mode, first):
            continue
        count, rank = orthonormalise(flow, mode, table, group)
        place_held(flow, mode, table, group)
        if count == rank or fits(flow, mode, group, 0.0):
            continue
        overload(flow, mode, group, rank, 0.0, True)
        part = part_of_the_way(flow, mode, group, rank)
        given = flow.space.aside[GIVEN_FORCES]
        for c in inertial_contacts(rows):
            if sticks_in(rows, mode, c, group):
                block = directions_of(rows, c)
                force = inner_forces(flow, c, rank)
                for i in range(len(block)):
                    d = block[i]
                    table[rows.force[d], 0] += axis_of(flow, d) * part * (force[i] - given[d])


@compiled(brief=True)
def part_of_the_way(flow: Flow, mode: Array, group: int, rank: int) -> float:
    """Smallest fraction of the way towards admissible forces at which the forces in the work space
    become admissible, too.

    Parameters
    ----------
    flow : Flow
        With both.
    mode : array of int, shape (contacts,)
    """
    rows = flow.rows
    aside = flow.space.aside
    part = 0.0
    for c in inertial_contacts(rows):
        if not sticks_in(rows, mode, c, group):
            continue
        a, b = given_force(flow, c, aside[GIVEN_FORCES])
        force = inner_forces(flow, c, rank)
        x = force[0] - a
        y = force[1] - b
        part = max(part, part_to_set(flow, c, aside[RADIUS, c], a, b, x, y))
    return part
