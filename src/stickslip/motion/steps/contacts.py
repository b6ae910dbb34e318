"""Contacts and their directions: indices, coefficients, and changes of their mode."""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.motion.steps.arrays import FIRST_ROW, MATRIX, PART, PRESSING, SEAT, Rows, Space
from stickslip.translator import compiled

# Rows of Space.rubbing: contacts whose normal forces all vanish; and, of those that have friction,
# contacts along a line, and in a plane or with a face. Last the number of each.
LOOSE, ALONG_LINES, IN_PLANES = range(3)


@compiled()
def own_inverse(rows: Rows, space: Space, c: int) -> float:
    """The rate that a unit of force gives to a sticking contact: its entry of the inverse."""
    part = rows.homes[c, PART]
    seat = rows.homes[c, SEAT]
    column = seat - rows.parts[part, FIRST_ROW]
    return float(
        space.Rq[seat, column] if rows.parts[part, MATRIX] == 0 else space.Rz[seat, column]
    )


@compiled()
def direction_entry(rows: Rows, J: Array, table: Array, c: int, j: int) -> float:
    """A coefficient of the direction of a contact, by the place of the coordinate in its component:
    constant, or from the table."""
    turning = rows.turning[c, j]
    return float(table[turning, 0] if turning >= 0 else J[c, j])


@compiled()
def inertial_contacts(rows: Rows) -> Array:
    """The first directions of all contacts that move inertial coordinates."""
    return rows.contacts[: rows.massive_contacts]


@compiled()
def inertial_friction(rows: Rows) -> Array:
    """The contacts among them that have friction."""
    return rows.frictional[: rows.massive_frictional]


@compiled()
def directions_of(rows: Rows, c: int) -> Array:
    """The directions of a contact, by its first one; none, if it is another one."""
    return rows.directions[rows.first_direction[c] : rows.first_direction[c + 1]]


@compiled()
def own_directions(rows: Rows, c: int) -> Array:
    """All directions of the contact that a direction belongs to."""
    return directions_of(rows, rows.lead[c])


@compiled()
def leads(rows: Rows, c: int) -> bool:
    """Whether a direction is the first one of its contact, whose entries hold for the contact."""
    return bool(rows.lead[c] == c)


@compiled()
def is_loose(rows: Rows, mode: Array, c: int) -> bool:
    """Whether a contact has friction under normal forces alone, and all that press it are open."""
    if rows.alone[c] == 1:
        return False
    for link in range(rows.first_link[c], rows.first_link[c + 1]):
        if mode[rows.links[link, PRESSING]] == 0:
            return False
    return True


@compiled()
def list_friction(rows: Rows, space: Space, mode: Array) -> None:
    """List the contacts that have friction in a mode."""
    for listed in space.rubbing:
        listed[len(listed) - 1] = 0
    for c in rows.frictional:
        loose = is_loose(rows, mode, c)
        listed = space.rubbing[LOOSE if loose else min(len(directions_of(rows, c)), IN_PLANES)]
        listed[listed[len(listed) - 1]] = c
        listed[len(listed) - 1] += 1


@compiled()
def rubbing(space: Space, which: int) -> Array:
    """The contacts in one of these lists."""
    listed = space.rubbing[which]
    return listed[: listed[len(listed) - 1]]


@compiled()
def opens(rows: Rows, c: int) -> bool:
    """Whether a contact is the normal direction of one that can open."""
    return bool(rows.gaps[c] >= 0)


@compiled()
def has_opened(rows: Rows, mode: Array, c: int) -> bool:
    """Whether a contact can open, and has."""
    return bool(opens(rows, c) and mode[c] != 0)


@compiled()
def loosen_friction(rows: Rows, mode: Array) -> None:
    """Open contacts have no friction: their mode is set to slip, in a unique direction."""
    for c in inertial_friction(rows):
        if is_loose(rows, mode, c):
            set_mode(rows, mode, c, 1)


@compiled()
def presses(rows: Rows, n: int, c: int) -> bool:
    """Whether the normal force of contact n is in the friction of contact c."""
    for link in range(rows.first_link[c], rows.first_link[c + 1]):
        if rows.links[link, PRESSING] == n:
            return True
    return False


@compiled(brief=True)
def set_mode(rows: Rows, mode: Array, c: int, value: int) -> None:
    """Set the mode of a contact for all its directions; the sign of a slip counts along a line
    only."""
    signed = rows.states[rows.lead[c]] == 3
    for i in own_directions(rows, c):
        mode[i] = value if signed else abs(value)
