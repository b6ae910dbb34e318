"""Forces of contacts that share them, as they are shown: the least, as far as these are admissible.

The least forces that rest needs, in units of the thresholds, may be too large for one contact where
others hold more. Then those are shown that are first inside their sets on the straight way to the
forces that :mod:`stickslip.motion.admissible.overload` finds there. They have the same sum, and
depend continuously on time.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.admissible.overload import (
    GIVEN_FORCES,
    RADIUS,
    fits,
    inner_forces,
    overload,
    place_held,
)
from stickslip.motion.admissible.sharing import given_force, grip, is_first, sticks_in
from stickslip.motion.steps.arrays import ON_INERTIAL, Flow, directions_of, inertial_contacts
from stickslip.motion.steps.sets import axis_of, force_outside, formula_of
from stickslip.translator import compiled

_HALVINGS = 50  # of the way into a set


@compiled(brief=True)
def show_admissible(flow: Flow, mode: Array, table: Array) -> None:
    """Make forces of contacts that share them admissible.

    Parameters
    ----------
    flow : Flow
    mode : array of int, shape (contacts,)
    table : array
        Values of the rows; those of the forces are changed.
    """
    rows = flow.rows
    for first in range(rows.sizes[ON_INERTIAL]):
        group = rows.group[first]
        if group < 0 or mode[first] != 0 or not is_first(rows, mode, first):
            continue
        count, rank = grip(flow, mode, table, group)
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
    """The least part of the way to forces inside their sets for which those in the work space come
    inside, too.

    Parameters
    ----------
    flow : Flow
        With both.
    mode : array of int, shape (contacts,)
    group, rank : int
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
        if formula_of(rows, c) >= 0:
            part = max(part, part_to_set(flow, c, a, b, x, y))
            continue
        # |(a, b) + part (x, y)| = s: it is outside at 0, and inside at 1
        outside = a * a + b * b - aside[RADIUS, c] ** 2
        if outside > 0.0:
            inwards = -(a * x + b * y)
            root = inwards * inwards - (x * x + y * y) * outside
            below = inwards + math.sqrt(max(root, 0.0))
            part = max(part, outside / below if below > outside else 1.0)
    return part


@compiled(brief=True)
def part_to_set(flow: Flow, c: int, a: float, b: float, x: float, y: float) -> float:
    """The least part of the way (x, y) from a force (a, b) into the set of a contact that has a
    formula.

    Parameters
    ----------
    flow : Flow
        With its radius.
    c : int
        The contact, by its first direction.
    a, b, x, y : float
    """
    radius = flow.space.aside[RADIUS, c]
    if not force_outside(flow, c, radius, a, b) > 0.0:
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if force_outside(flow, c, radius, a + middle * x, b + middle * y) > 0.0:
            low = middle
        else:
            high = middle
    return high
