"""Contacts that share forces, and the directions in which they hold a body.

If there are more sticking directions than coordinates, forces are not unique. The contacts of a
group (`Rows.group`) then have one common guard: whether admissible forces exist
(:mod:`stickslip.motion.admissible.leaving`).
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.algebra.vectors import is_new
from stickslip.motion.steps.arrays import (
    COORDINATES,
    INERTIAL,
    LEAD,
    MEMBERS,
    ON_INERTIAL,
    PART,
    PRESSING,
    RUBBING,
    Flow,
    Rows,
)
from stickslip.motion.steps.contacts import direction_entry, directions_of
from stickslip.motion.steps.sets import MOVED, axis_of, middle_at
from stickslip.numerics.levels import INDEPENDENT
from stickslip.translator import compiled

# Entries of Space.leaving: the contact keeps sticking while others with which it shares forces
# begin to slip; it has a separate guard; or (±1) it begins to slip.
STAYS, ON_ITS_OWN = 0, 2
_STEADY = 1e-12  # rotation of a direction relative to its size that counts as zero


@compiled(brief=True)
def any_share(rows: Rows) -> bool:
    """Whether there are contacts that may share forces."""
    return len(rows.sharing) > 0


@compiled(brief=True)
def sticks_in(rows: Rows, mode: Array, c: int, group: int) -> bool:
    """Whether a contact sticks and may share its force with those of a group."""
    return bool(rows.group[c] == group and mode[c] == 0)


@compiled(brief=True)
def is_first(rows: Rows, mode: Array, c: int) -> bool:
    """Whether a contact is the first that sticks in its group."""
    first = True
    for other in range(c):
        first = first and not sticks_in(rows, mode, other, rows.group[c])
    return first


@compiled(brief=True)
def find_shared(flow: Flow, mode: Array, table: Array) -> None:
    """Mark contacts that share forces with others and have a common guard.

    Parameters
    ----------
    flow : Flow
        Its work space contains the coefficients, and receives the marks.
    mode : array of int, shape (contacts,)
    table : array
        Values of the rows.
    """
    rows = flow.rows
    leaving = flow.space.leaving
    for c in range(len(leaving)):
        leaving[c] = ON_ITS_OWN
    for first in rows.sharing:
        group = rows.group[first]
        if mode[first] != 0 or leaving[first] != ON_ITS_OWN or not is_first(rows, mode, first):
            continue
        count, rank = orthonormalise(flow, mode, table, group)
        if count > rank or any_formula(rows, mode, group):
            for c in range(first, rows.sizes[ON_INERTIAL]):
                if sticks_in(rows, mode, c, group):
                    leaving[c] = STAYS


@compiled(brief=True)
def any_formula(rows: Rows, mode: Array, group: int) -> bool:
    """Whether one of the contacts of a group that stick has a formula."""
    found = False
    for p in rows.formula_planes:
        found = found or sticks_in(rows, mode, rows.planes[p, LEAD], group)
    return found


@compiled(brief=True)
def turns(flow: Flow, mode: Array, group: int) -> bool:
    """Whether directions of sticking contacts of a group change within a step."""
    rows = flow.rows
    W = flow.space.W
    for c in range(rows.sizes[ON_INERTIAL]):
        if not sticks_in(rows, mode, c, group):
            continue
        size, change = 0.0, 0.0
        for j in range(rows.parts[rows.homes[c, PART], COORDINATES]):
            size += abs(direction_entry(rows, flow.k.J, W, c, j))
            for k in range(1, flow.order if rows.turning[c, j] >= 0 else 0):
                change += abs(W[rows.turning[c, j], k]) * flow.space.powers[k]
        if not change <= _STEADY * size:
            return True
    return False


@compiled(brief=True)
def place_direction(flow: Flow, table: Array, c: int, vector: Array) -> None:
    """The direction of a contact, in all inertial coordinates; in a plane with its axis."""
    rows = flow.rows
    part = rows.parts[rows.homes[c, PART]]
    axis = axis_of(flow, c)
    for q in range(rows.sizes[INERTIAL]):
        vector[q] = 0.0
    for j in range(part[COORDINATES]):
        entry = direction_entry(rows, flow.k.J, table, c, j)
        vector[rows.members[part[MEMBERS] + j]] = axis * entry


@compiled(brief=True)
def orthonormalise(flow: Flow, mode: Array, table: Array, group: int) -> tuple[int, int]:
    """Directions of the sticking contacts of a group, as rows G in an orthonormal basis. Returns
    the number of directions, and of independent ones.

    Parameters
    ----------
    flow : Flow
        Receives them in its work space.
    mode : array of int, shape (contacts,)
    table : array
        Values of the rows.
    """
    rows = flow.rows
    basis, components = flow.space.basis, flow.space.in_basis
    n = rows.sizes[INERTIAL]
    count = 0
    rank = 0
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group):
            count += 1
            place_direction(flow, table, c, basis[rank])
            if is_new(n, basis, rank, INDEPENDENT):
                rank += 1
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group):
            place_direction(flow, table, c, basis[n])
            for r in range(rank):
                components[c, r] = 0.0
                for q in range(n):
                    components[c, r] += basis[n, q] * basis[r, q]
    return count, rank


@compiled(brief=True)
def is_dependent(flow: Flow, table: Array, c: int, rank: int) -> bool:
    """Whether the directions of a contact depend linearly on those of the sticking contacts of its
    group.

    Parameters
    ----------
    flow : Flow
        With the basis of the sticking contacts.
    table : array
        Values of the rows.
    c : int
        The contact, by its first direction.
    rank : int
        Number of vectors of the basis.
    """
    basis = flow.space.basis
    for i in directions_of(flow.rows, c):
        place_direction(flow, table, i, basis[rank])
        if is_new(flow.rows.sizes[INERTIAL], basis, rank, INDEPENDENT):
            return False
    return True


@compiled(brief=True)
def press_by_internal_forces(flow: Flow, mode: Array, table: Array, group: int) -> bool:
    """Whether internal forces (with zero sum) of the sticking contacts of a group change their
    normal forces, as those of feet at different heights do: they can then hold more than with the
    normal forces of the mode.

    Parameters
    ----------
    flow : Flow
        Its work space receives a basis of their directions.
    mode : array of int, shape (contacts,)
    table : array
        Values of the rows.
    """
    rows = flow.rows
    basis = flow.space.basis
    n = rows.sizes[INERTIAL]
    rank = orthonormalise(flow, mode, table, group)[1]
    for c in rows.openings:
        pressing = False
        for link in range(len(rows.links) if mode[c] == 0 else 0):
            pressed = rows.links[link, PRESSING] == c
            pressing = pressing or (
                pressed and sticks_in(rows, mode, rows.links[link, RUBBING], group)
            )
        if pressing:
            place_direction(flow, table, c, basis[rank])
            if not is_new(n, basis, rank, INDEPENDENT):
                return True
            rank += 1
    return False


@compiled(brief=True)
def held_at(flow: Flow, table: Array, c: int, k: int) -> float:
    """Order k of the force of a sticking contact along a direction, relative to the centre of its
    set, in units of its axis."""
    force = table[flow.rows.force[c], k] / axis_of(flow, c)
    return float(force - middle_at(flow, table, c, k))


@compiled(brief=True)
def speed_of(flow: Flow, c: int, rank: int, w: Array) -> float:
    """Compute Gw of a contact, given by its first direction, in the work space; along a line, two
    components are 0. Returns its length."""
    block = directions_of(flow.rows, c)
    moved = flow.space.along[MOVED]
    moved[0] = moved[1] = moved[2] = 0.0
    for i in range(len(block)):
        for r in range(rank):
            moved[i] += flow.space.in_basis[block[i], r] * w[r]
    return length_of(moved[0], moved[1], moved[2])


@compiled(brief=True)
def length_of(x: float, y: float, z: float) -> float:
    """The length of a vector."""
    return math.hypot(x, y) if z == 0.0 else math.hypot(math.hypot(x, y), z)
