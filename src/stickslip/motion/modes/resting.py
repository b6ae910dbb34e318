"""Rest with normal forces that are not unique: it lasts as long as admissible forces exist.

Of a body on more feet than it has freedoms, rest does not tell how its weight is shared, and
friction depends on that. A mode is one way to share it, and pivoting that leaves one may come to a
slip although the body rests with another. So before what is pressed by several normal forces
begins to slip, it is asked whether any forces hold it (:mod:`stickslip.motion.admissible.cones`),
and then which independent ones of the normal forces suffice. These say the mode: they are closed,
what they press sticks, or is carried at its threshold, and the others are open and do not leave.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.admissible.cones import (
    FORCE,
    LEAST_ALONE,
    LEAST_SHARE,
    LEFT,
    LEFT_ALONE,
    MOST_ALONE,
    MOST_SHARE,
    PRESSES,
    RESTS,
    WANTED,
    WEIGHT,
    fit_cones,
    no_cones,
)
from stickslip.motion.admissible.impacts_law import (
    put_part,
)
from stickslip.motion.algebra.vectors import copy, is_new
from stickslip.motion.modes.choosing import settle_mode
from stickslip.motion.modes.guards import (
    stays,
)
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.modes.surfaces import is_apart
from stickslip.motion.steps.arrays import (
    CAUSE,
    COORDINATES,
    DIMENSION,
    LAST,
    NOW,
    NOWHERE,
    OK,
    ON_INERTIAL,
    PART,
    PRESSING,
    RECENT,
    REJECTED,
    RUBBING,
    SPAN,
    Flow,
    Instant,
    Lane,
    Machine,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import (
    direction_entry,
    directions_of,
    inertial_friction,
    is_loose,
    own_directions,
    set_mode,
)
from stickslip.motion.steps.sets import rate_terms
from stickslip.motion.steps.starting import coefficients
from stickslip.numerics.levels import NEW_DIRECTION
from stickslip.translator import compiled

# Rows of Space.tried: the mode that pivoting has found; all contacts without their forces; which
# normal forces are tried, and all of them.
_FOUND, _FREE, _CHOSEN, _NORMALS = range(4)
_SLOW = 1e-9  # velocity relative to its terms and to the effect of forces below which it is zero
_HELD = 1e-11  # relative residual of the forces that hold a rest
_AT_BOUND = 1e-9  # relative distance from a bound within which a force is at it
_MOST_CHOICES = 5000  # largest number of choices of normal forces
_AHEAD = 1e-3  # fraction of recent steps for which forces of a rest have to hold


@compiled()
def settle(
    machine: Machine, flow: Flow, lane: Lane, room: float, hold: bool, unchecked: float
) -> tuple[int, float, float, int]:
    """Find the mode that the motion takes now, as :func:`.settle_mode` does; rest, where pivoting
    would let something slip that some admissible forces hold.

    Parameters
    ----------
    machine, flow, lane, room, hold, unchecked
        As in :func:`.settle_mode`.

    Returns
    -------
    status, step, series, count
        Likewise.
    """
    rows, space = flow.rows, flow.space
    status, h, series, count = settle_mode(machine, flow, lane, room, hold, unchecked)
    if not hold or len(rows.links) < 2 or status == REJECTED:
        return status, h, series, count
    part = part_that_begins(flow, lane, status)
    if part < 0:
        return status, h, series, count
    found = space.tried[_FOUND]
    copy(lane.mode, found)
    copy(space.y0, lane.y)
    rests = place_rest(machine, flow, lane, part, room)
    if rests:
        copy(space.y0, lane.y)
        status, h, series, count = settle_mode(machine, flow, lane, room, hold, 0.0)
        if status == OK and part_that_begins(flow, lane, status) < 0:
            return status, h, series, count
    copy(space.y0, lane.y)
    copy(found, lane.mode)
    return settle_mode(machine, flow, lane, room, hold, 0.0)


@compiled(brief=True)
def part_that_begins(flow: Flow, lane: Lane, status: int) -> int:
    """The component in which a contact begins to slip from rest under a normal force, with other
    normal forces present; or one for which no mode was found; negative if there is none.

    Parameters
    ----------
    flow : Flow
        With the coefficients of the mode.
    status : int
        Of that mode.
    """
    rows = flow.rows
    for link in range(len(rows.links)):
        c = rows.links[link, RUBBING]
        if status == OK and (lane.mode[c] == 0 or is_loose(rows, lane.mode, c)):
            continue
        if not begins_from_rest(flow, lane, c, status):
            continue
        number = 0
        for n in rows.openings:
            if rows.homes[n, PART] == rows.homes[c, PART] and is_closed(flow, lane, n):
                number += 1
        if number > 1:
            return int(rows.homes[c, PART])
    return NOWHERE


@compiled(brief=True)
def begins_from_rest(flow: Flow, lane: Lane, c: int, status: int) -> bool:
    """Whether a contact rests and is to slip."""
    rows, space = flow.rows, flow.space
    if not has_no_velocity(flow, lane, c):
        return False
    last, fired = lane.clock[LAST], lane.counters[CAUSE]
    still = status == OK
    for i in own_directions(rows, c):
        still = still and stays(rows, space, lane.mode, i, flow.order, last, fired, 1.0)
    return not still


@compiled(brief=True)
def has_no_velocity(flow: Flow, lane: Lane, c: int) -> bool:
    """Whether the velocity of a contact is negligible relative to its terms, and to the effect of
    forces in a step; in a plane, in both directions."""
    rows, space = flow.rows, flow.space
    for i in own_directions(rows, c):
        made = lane.clock[RECENT] * rate_terms(rows, space.mag, i)
        if not abs(space.W[rows.u[i], 0]) <= _SLOW * (space.mag[i] + made):
            return False
    return True


@compiled(brief=True)
def is_closed(flow: Flow, lane: Lane, n: int) -> bool:
    """Whether a contact that can open touches, and stays where it is."""
    apart = is_apart(flow, n, lane.clock[RECENT], lane.clock[SPAN])
    return has_no_velocity(flow, lane, n) and not apart


@compiled(brief=True)
def place_rest(machine: Machine, flow: Flow, lane: Lane, part: int, room: float) -> bool:
    """Set the resting contacts of a component to a mode of rest whose forces are admissible; False
    if there is none.

    Parameters
    ----------
    flow : Flow
        With the values of the rows, which are used up.
    lane : Lane
        Its mode is changed.
    part : int
        The component.
    room : float
        Longest step that is wanted.
    """
    rows, space = flow.rows, flow.space
    cones = space.cones
    mq = rows.sizes[ON_INERTIAL]
    free = space.tried[_FREE]
    copy(lane.mode, free)
    for c in range(mq):
        cones[RESTS, c] = 0.0
        if rows.homes[c, PART] != part:
            continue
        free[c] = 1
    for c in rows.openings:
        if rows.homes[c, PART] == part:
            cones[RESTS, c] = 1.0 if is_closed(flow, lane, c) else 0.0
    for c in inertial_friction(rows):
        if rows.homes[c, PART] != part:
            continue
        pressed = rows.alone[c] == 1
        for link in range(rows.first_link[c], rows.first_link[c + 1]):
            pressed = pressed or cones[RESTS, rows.links[link, PRESSING]] != 0.0
        if pressed:
            if not has_no_velocity(flow, lane, c):
                return False
            cones[RESTS, c] = 1.0
    ahead = min(_AHEAD * lane.clock[RECENT], room)
    here = Instant(lane.clock[NOW] + ahead, lane.y, free, lane.reg)
    known = resolve(rows, flow.k, space, free)
    if not known or coefficients(machine, flow, here, 2, space.W) != OK:
        return False
    put_part(rows, space, flow.k.J, part, True)
    return hold_still(flow, lane.mode, part)


@compiled(brief=True)
def hold_still(flow: Flow, mode: Array, part: int) -> bool:
    """Find forces that hold the resting contacts, and their mode.

    Parameters
    ----------
    flow : Flow
        With the coefficients where nothing is held, Delassus' matrix, and, in `Space.cones`, what
        rests.
    mode : array of int, shape (contacts,)
        Is changed where there are such forces.
    part : int
        The component.
    """
    rows, space = flow.rows, flow.space
    cones, W = space.cones, space.W
    mq = rows.sizes[ON_INERTIAL]
    no_cones(rows, space)
    for c in rows.openings:
        cones[PRESSES, c] = 1.0 if cones[RESTS, c] != 0.0 else 0.0
    for c in inertial_friction(rows):
        if cones[RESTS, c] == 0.0:
            continue
        block = directions_of(rows, c)
        for link in range(rows.first_link[c], rows.first_link[block[len(block) - 1] + 1]):
            cones[LEAST_SHARE, link] = -W[rows.friction[link, 2], 0]
            cones[MOST_SHARE, link] = W[rows.friction[link, 3], 0]
        # Without normal forces these are its own thresholds.
        cones[LEAST_ALONE, c] = -max(W[rows.plus[c], 0], 0.0)
        cones[MOST_ALONE, c] = max(W[rows.minus[c], 0], 0.0)
        if cones[MOST_ALONE, c] > 0.0 and len(block) > 1:
            return False
    scale = put_wanted(rows, space, part)
    if not are_held(rows, space, scale):
        return False
    rank = 0
    chosen = space.tried[_CHOSEN]
    number = 0
    for c in range(mq):
        if cones[PRESSES, c] > 0.0:
            space.tried[_NORMALS, number] = c
            number += 1
            if is_independent(flow, part, c, rank):
                rank += 1
    for i in range(rank):
        chosen[i] = i
    for _ in range(_MOST_CHOICES):
        if choose_normals(flow, part, rank, number) and are_held(rows, space, scale):
            for c in rows.openings:
                if cones[RESTS, c] != 0.0:
                    mode[c] = 0 if cones[FORCE, c] > 0.0 else 1
            for c in inertial_friction(rows):
                if cones[RESTS, c] != 0.0:
                    set_mode(rows, mode, c, mode_of_friction(rows, cones, c))
            return True
        # the next choice in lexicographic order
        last = rank - 1
        while last >= 0 and chosen[last] == number - rank + last:
            last -= 1
        if last < 0:
            break
        chosen[last] += 1
        for i in range(last + 1, rank):
            chosen[i] = chosen[i - 1] + 1
    return False


@compiled(brief=True)
def are_held(rows: Rows, space: Space, scale: float) -> bool:
    """Whether admissible forces hold the resting contacts; they are left in the work space."""
    cones = space.cones
    fit_cones(rows, space, scale)
    for c in range(rows.sizes[ON_INERTIAL]):
        if cones[RESTS, c] != 0.0:
            if not abs(cones[LEFT, c]) <= _HELD * scale * math.sqrt(space.delassus[c, c]):
                return False
            if not abs(cones[LEFT_ALONE, c]) <= _HELD * cones[WEIGHT, c]:
                return False
    return True


@compiled(brief=True)
def choose_normals(flow: Flow, part: int, rank: int, number: int) -> bool:
    """Select the normal forces that press; False if their directions are linearly dependent.

    Parameters
    ----------
    flow : Flow
        With the choice in its work space.
    part : int
        The component.
    rank, number : int
        How many are chosen, of how many.
    """
    space = flow.space
    chosen, normals = space.tried[_CHOSEN], space.tried[_NORMALS]
    for i in range(number):
        space.cones[PRESSES, normals[i]] = 0.0
    for i in range(rank):
        n = normals[chosen[i]]
        space.cones[PRESSES, n] = 1.0
        if not is_independent(flow, part, n, i):
            return False
    return True


@compiled(brief=True)
def is_independent(flow: Flow, part: int, c: int, rank: int) -> bool:
    """Whether the direction of a contact is none of those that there are; it joins them."""
    rows, space = flow.rows, flow.space
    n = rows.parts[part, COORDINATES]
    for j in range(n):
        space.scratch[rank, j] = direction_entry(rows, flow.k.J, space.W, c, j)
    return is_new(n, space.scratch, rank, NEW_DIRECTION)


@compiled(brief=True)
def put_wanted(rows: Rows, space: Space, part: int) -> float:
    """The accelerations that forces of rest have to make, and the weights of thresholds; the size
    of all that."""
    cones, W = space.cones, space.W
    mq = rows.sizes[ON_INERTIAL]
    unit = W[rows.sizes[DIMENSION], 1]
    scale = 0.0
    for c in range(mq):
        own = space.delassus[c, c]
        if cones[RESTS, c] == 0.0 or not own > 0.0:
            continue
        cones[WANTED, c] = -W[rows.u[c], 1] / unit
        for b in range(mq):
            if rows.homes[b, PART] == part and cones[RESTS, b] != 0.0:
                cones[WANTED, c] += space.delassus[c, b] * W[rows.force[b], 0]
        alone = max(-cones[LEAST_ALONE, c], cones[MOST_ALONE, c])
        cones[WEIGHT, c] = alone * alone * own
        scale = max(scale, abs(cones[WANTED, c]) / math.sqrt(own), alone * math.sqrt(own))
    return scale


@compiled(brief=True)
def mode_of_friction(rows: Rows, cones: Array, c: int) -> int:
    """Mode of a resting contact with a given force: stick, or carried at a threshold."""
    force = cones[FORCE, c]
    most, least = cones[MOST_ALONE, c], cones[LEAST_ALONE, c]
    for link in range(rows.first_link[c], rows.first_link[c + 1]):
        pressed = cones[FORCE, rows.links[link, PRESSING]]
        most += cones[MOST_SHARE, link] * pressed
        least += cones[LEAST_SHARE, link] * pressed
    if rows.plane[c] >= 0:
        return 0 if most > 0.0 else 1
    near = _AT_BOUND * (most - least)
    carried = 1 + rows.drops[c]
    if force >= most - near:
        return -int(carried)
    return int(carried) if force <= least + near else 0
