"""Whether contacts that begin to slip or to open with a step could have continued to stick.

Where the sliding force is below the threshold, or friction may come from any side, as in a plane,
the law alone would let rest end at any time. The stated rule is that what can stick sticks. So what
begins to slip is held once more, and its forces are evaluated anew: if all that rests then has room
up to its threshold, the least room is the violation.
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.admissible.cones import FORCE_SIZE, RESTS
from stickslip.motion.admissible.leaving import spare_part
from stickslip.motion.admissible.sharing import (
    ON_ITS_OWN,
    any_share,
    find_shared,
    press_by_internal_forces,
)
from stickslip.motion.affine.nodes import most
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.audit.accounts import EXCESS, LARGEST_FORCE, LARGEST_SPEED, Tally
from stickslip.motion.audit.forces import HOLDS, RUBS, may_have_others, widest_room
from stickslip.motion.audit.step_ends import jump_after
from stickslip.motion.modes.guards import resting
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    ADMISSIBLE,
    ADMISSIBLE_SIZE,
    DIMENSION,
    FEWEST_ORDERS,
    NOWHERE,
    OK,
    ON_INERTIAL,
    Flow,
    Instant,
    Machine,
    Record,
    Rows,
    Space,
    plain_coefficients,
)
from stickslip.motion.steps.contacts import inertial_friction, is_loose, set_mode
from stickslip.motion.steps.sets import (
    force_terms,
    gap_size,
    is_at_rest,
    kink_terms,
    plane_of,
    rate_terms,
)
from stickslip.motion.steps.starting import coefficients, is_prescribed
from stickslip.numerics.levels import EPSILON, ROUNDING
from stickslip.translator import compiled


@compiled()
def judge_beginning(
    machine: Machine, flow: Flow, starts: Record, ends: Record, i: int, tally: Tally
) -> None:
    """Margin by which contacts that begin to slip or to open with a step could have stuck.

    Where the sliding force is below the threshold, the friction law alone would allow it, and so
    does adhesion: the stated rule is that what can stick sticks. Of several that begin together one
    has reached its threshold; what they carry at rest has to hold all it can. This is asked of what
    slips from a velocity that is zero, and of what has no mass and rested before.

    Parameters
    ----------
    starts, ends : Record
        As in :func:`.audit_steps`.
    i : int
        The step.
    tally : Tally
        Receives the largest.
    """
    rows = flow.rows
    nc = len(rows.u)
    slips = starts.mode[i]
    quiet = continues_previous(starts, i)
    asked = False
    for c in range(nc):
        asked = asked or (not resting(slips[c]) and may_stick_again(rows, c, quiet))
    if not asked:
        return
    mode = flow.space.touched[:nc]
    reg = flow.space.touched[nc:]
    copy(slips, mode)
    copy(starts.region[i], reg)
    at = Instant(starts.time[i], starts.state[i], mode, reg)
    if hold_beginnings(machine, flow, at, starts, ends, i, tally):
        c, room = least_room(flow, at, slips, tally)
        if c < 0 and room == 0.0:
            c, room = shared_room(machine, flow, at, slips, tally)
        if c >= 0:
            tally.law[c, EXCESS] = most(tally.law[c, EXCESS], room * tally.law[c, LARGEST_FORCE])


@compiled()
def continues_previous(starts: Record, i: int) -> bool:
    """Whether a step continues the previous one, without a recorded event in between."""
    return bool(i > 0 and starts.cause[i] < 0)


@compiled()
def may_stick_again(rows: Rows, c: int, quiet: bool) -> bool:
    """Whether a contact that slips, or is open, may be held by more than its force, or from another
    side. In a plane a slip may turn round at any time; others begin with an event."""
    return bool(rows.held_again[c] > (1 if quiet else 0))


@compiled()
def has_friction(rows: Rows, mode: Array, c: int) -> bool:
    """Whether the friction of a contact is given by its law: a normal force acts on it, and it is
    not between prescribed motions, where its force follows from its velocity alone."""
    return not (is_loose(rows, mode, c) or is_prescribed(rows, c))


@compiled()
def hold_beginnings(
    machine: Machine, flow: Flow, at: Instant, starts: Record, ends: Record, i: int, tally: Tally
) -> bool:
    """Set contacts that begin to slip with a step to stick, or to rest as before; returns whether
    any of them could have stuck. Their forces are left in the work space.

    Parameters
    ----------
    at : Instant
        The beginning; its mode is changed.
    starts, ends, i, tally
        As in :func:`judge_beginning`.
    """
    rows = flow.rows
    space = flow.space
    slips = starts.mode[i]
    if not resolve(rows, flow.k, space, at.mode):
        return False
    if plain_coefficients(machine, flow, at, 1, space.W) != OK:
        return False
    quiet = continues_previous(starts, i)
    asked = False
    for c in rows.adhesive:
        if slips[c] == 1 and not quiet and closed_at_rest(rows, space, c):
            asked = True
            carried = i > 0 and starts.mode[i - 1, c] == 2
            set_mode(rows, at.mode, c, 2 if carried else 0)
    for c in rows.frictional:
        again = may_stick_again(rows, c, quiet)
        if (quiet and not again) or resting(slips[c]) or not has_friction(rows, slips, c):
            continue
        # All rests before the start.
        before = starts.mode[i - 1, c] if i > 0 else 0
        if c < rows.sizes[ON_INERTIAL]:
            # A contact that keeps its threshold and its side may be carried by others and never
            # slip.
            begins = is_still(rows, space, c, tally.law[c, LARGEST_SPEED])
            begins = begins and (again or before != slips[c])
        else:
            # A jump may release contacts without mass.
            torn = i > 0 and jump_after(rows, starts.cause[i], starts.region[i - 1]) >= 0
            begins = not quiet and not torn and resting(before)
        if begins:
            asked = asked or again
            set_mode(rows, at.mode, c, before if resting(before) else 0)
    if asked and quiet:
        asked = release_what_stays(machine, flow, at, ends, slips, i)
    if not asked or not resolve(rows, flow.k, space, at.mode):
        return False
    return coefficients(machine, flow, at, FEWEST_ORDERS, space.W) == OK


@compiled()
def closed_at_rest(rows: Rows, space: Space, c: int) -> bool:
    """Whether a contact that can open has neither a gap nor a velocity, up to rounding."""
    apart = abs(space.W[rows.gaps[c], 0]) > ROUNDING * gap_size(rows, space, c)
    return is_still(rows, space, c, 0.0) and not apart


@compiled()
def release_what_stays(
    machine: Machine, flow: Flow, at: Instant, ends: Record, slips: Array, i: int
) -> bool:
    """Exempt contacts whose velocity is still within rounding errors at the end of a step: their
    slip ends, and none begins. Returns whether any beginning slip is left.

    Parameters
    ----------
    at : Instant
        The beginning; its mode is changed.
    slips : array of int, shape (contacts,)
        The mode of the step.
    """
    space = flow.space
    mode = at.mode
    for c in range(len(mode)):
        space.labels[c, 0] = mode[c]
    copy(slips, mode)
    final = Instant(ends.time[i], ends.state[i], mode, at.reg)
    if not resolve(flow.rows, flow.k, space, mode):
        return False
    if plain_coefficients(machine, flow, final, 1, space.W) != OK:
        return False
    left = False
    for c in flow.rows.contacts:
        held = space.labels[c, 0]
        if held != slips[c] and not is_still(flow.rows, space, c, 0.0):
            set_mode(flow.rows, mode, c, held)
            left = True
    return left


@compiled(brief=True)
def is_still(rows: Rows, space: Space, c: int, largest: float) -> bool:
    """Whether the relative velocity of a contact vanishes, up to rounding errors; on a line
    relative to the largest velocity before, whose rounding errors remain after a deceleration."""
    if rows.plane[c] >= 0:
        return is_at_rest(rows, space.W, c, 1.0)
    return bool(abs(space.W[rows.u[c], 0]) <= ROUNDING * max(space.mag[c], largest))


@compiled()
def is_steady(rows: Rows, space: Space, c: int) -> bool:
    """Whether the rate of a relative velocity vanishes, up to rounding."""
    rate = rate_terms(rows, space.mag, c) * space.W[rows.sizes[DIMENSION], 1]
    return bool(abs(space.W[rows.u[c], 1]) <= ROUNDING * rate)


@compiled()
def least_room(flow: Flow, at: Instant, slips: Array, tally: Tally) -> tuple[int, float]:
    """The held contact nearest to its threshold, and its relative margin; −1 and 0 if a contact has
    no margin; −1 and −1 if something else prevents rest: another contact, an event beyond a kink,
    or a gap that may close.

    Parameters
    ----------
    flow : Flow
        Its work space has the forces.
    at : Instant
        With the mode in which they are held.
    slips : array of int, shape (contacts,)
        The mode in which they slip.
    tally : Tally
        With the size of each force.
    """
    rows = flow.rows
    W = flow.space.W
    mag = flow.space.mag
    mode = at.mode
    unit = W[rows.sizes[DIMENSION], 1]
    late = 0.5 * EPSILON * abs(at.t) / unit
    for j in range(len(rows.kinks)):
        if rows.timed[j] == 0 and abs(W[rows.kinks[j], 0]) <= ROUNDING * kink_terms(rows, mag, j):
            return NOWHERE, -1.0
    first = NOWHERE
    least = np.inf
    full = False
    sharing = any_share(rows)
    if sharing:
        find_shared(flow, mode, W)
    for c in rows.openings:
        gap = abs(W[rows.gaps[c], 0]) - ROUNDING * gap_size(rows, flow.space, c)
        if W[rows.force[c], 0] < 0.0 if mode[c] == 0 else gap <= 0.0:
            return NOWHERE, -1.0
        others = mode[c] == 2 and not is_steady(rows, flow.space, c)
        if others and slips[c] == 1:
            return NOWHERE, -1.0
        if mode[c] == 0 and slips[c] != 0:
            room = room_to_tear(rows, flow.space, c, late, tally.law[c, LARGEST_FORCE])
            full = full or not room > 0.0
            if room < least:
                first, least = c, room
    for c in rows.frictional:
        if not resting(mode[c]) or not has_friction(rows, mode, c):
            continue
        room = room_left(rows, flow.space, c, late, tally.law[c, LARGEST_FORCE])
        if sharing and mode[c] == 0 and flow.space.leaving[c] != ON_ITS_OWN:
            if press_by_internal_forces(flow, mode, W, rows.group[c]):
                return c, 1.0  # the forces that they hold then are not needed
            room = spare_part(flow, mode, c)
            if tally.law[c, LARGEST_FORCE] > 0.0:
                room -= late * abs(W[rows.force[c], 1]) / tally.law[c, LARGEST_FORCE]
        carried = abs(mode[c]) != 2 or is_steady(rows, flow.space, c)
        if not carried:
            return NOWHERE, -1.0
        full = full or not room > 0.0
        if not resting(slips[c]) and room < least:
            first, least = c, room
    return (NOWHERE, 0.0) if full else (first, least)


@compiled()
def shared_room(
    machine: Machine, flow: Flow, at: Instant, slips: Array, tally: Tally
) -> tuple[int, float]:
    """The same if forces are not unique: the largest margin; −1 if there is none.

    Parameters
    ----------
    machine, flow, at, slips, tally
        As in :func:`least_room`.
    """
    rows, space = flow.rows, flow.space
    begins = NOWHERE
    held = 0
    if not may_have_others(rows, space):
        return NOWHERE, 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        space.cones[RESTS, c], space.cones[FORCE_SIZE, c] = 0.0, tally.law[c, LARGEST_FORCE]
    for c in rows.openings:
        if at.mode[c] == 0:
            space.cones[RESTS, c] = HOLDS
            held += 1
    for c in inertial_friction(rows):
        if is_loose(rows, at.mode, c):
            continue
        if resting(at.mode[c]):
            space.cones[RESTS, c] = HOLDS
            held += 1
            begins = begins if resting(slips[c]) else c
        elif rows.first_link[c + 1] > rows.first_link[c]:
            space.cones[RESTS, c] = RUBS
    if held < 2 or begins < 0:
        return NOWHERE, 0.0
    room = widest_room(machine, flow, at)
    return (begins, room) if room > 0.0 else (NOWHERE, 0.0)


@compiled()
def room_left(rows: Rows, space: Space, c: int, late: float, force: float) -> float:
    """Distance of a resting contact from its threshold, relative to its force.

    Parameters
    ----------
    space : Space
        With the forces.
    late : float
        By how much the time is a rounded number, in the unit of that of the coefficients.
    force : float
        Size of its force.
    """
    W = space.W
    if not force > 0.0:
        return 0.0
    if rows.plane[c] >= 0:
        plane = plane_of(rows, c)
        row = plane[ADMISSIBLE]
        unsure = ROUNDING * space.mag[plane[ADMISSIBLE_SIZE]] + late * abs(W[row, 1])
        return float((W[row, 0] - unsure) / (force * force))
    held, up, down = rows.force[c], rows.plus[c], rows.minus[c]
    unsure = ROUNDING * force_terms(rows, space.mag, c)
    unsure += late * (abs(W[held, 1]) + abs(W[up, 1]) + abs(W[down, 1]))
    room = min(W[held, 0] + W[up, 0], W[down, 0] - W[held, 0])
    return float((room - unsure) / force)


@compiled()
def room_to_tear(rows: Rows, space: Space, c: int, late: float, force: float) -> float:
    """Distance of an adhering contact from opening, relative to its force.

    Parameters
    ----------
    rows, space, c, late, force
        As in :func:`room_left`.
    """
    if not force > 0.0:
        return 0.0
    unsure = ROUNDING * force_terms(rows, space.mag, c) + late * abs(space.W[rows.force[c], 1])
    return float((space.W[rows.force[c], 0] - unsure) / force)
