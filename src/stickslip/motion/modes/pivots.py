"""Pivoting: the correction of an inadmissible mode.

Switches of violated guards are flipped, those of different components together; contacts whose
forces are not unique are carried by others at their thresholds; kinks are put onto the sides where
their guards clearly are.
"""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.motion.admissible.sharing import ON_ITS_OWN, STAYS, sticks_in
from stickslip.motion.algebra.vectors import clear, is_new
from stickslip.motion.modes.guards import NUMBER, contact_of, is_second, stays
from stickslip.motion.modes.surfaces import is_wide
from stickslip.motion.steps.arrays import (
    CONTACTS,
    COORDINATES,
    MEMBERS,
    NOWHERE,
    PART,
    Flow,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import (
    direction_entry,
    inertial_contacts,
    is_loose,
    own_directions,
    set_mode,
)
from stickslip.motion.steps.sets import kink_terms
from stickslip.numerics.levels import FIRED, NEW_DIRECTION
from stickslip.translator import compiled


@compiled()
def flip(rows: Rows, guard: int, mode: Array, reg: Array, leaving: Array) -> int:
    """Give the switch of a violated guard its other state; returns the switch.

    What leaves stick has its threshold to break, as long as it is not known which of several
    contacts do: ±2 where the sliding force is another one.

    Parameters
    ----------
    guard : int
        Its number.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
        One of them is changed.
    leaving : array of int, shape (contacts,)
        Which contacts leave with others that they share forces with.
    """
    nk = len(reg)
    if guard < nk:
        reg[guard] = 1 - reg[guard]
        return guard
    c = contact_of(guard, nk)
    if mode[c] == 0 and leaving[c] != ON_ITS_OWN:
        return release_together(rows, c, mode, nk, leaving)
    if mode[c] == 0:
        side = -1 if is_second(guard, nk) else 1
        set_mode(rows, mode, c, 2 * side if rows.drops[c] == 1 else side)
    else:
        set_mode(rows, mode, c, 0)
    return nk + c


@compiled()
def release_together(rows: Rows, first: int, mode: Array, nk: int, leaving: Array) -> int:
    """Release those contacts that leave stick together; returns the switch of the first of them.

    Parameters
    ----------
    first : int
        The first of those that share forces.
    mode : array of int, shape (contacts,)
        Is changed.
    nk : int
        Number of kinks.
    leaving : array of int, shape (contacts,)
    """
    found = first
    left = False
    for c in inertial_contacts(rows):
        if sticks_in(rows, mode, c, rows.group[first]) and leaving[c] != STAYS:
            if not left:
                found = c
            left = True
            set_mode(rows, mode, c, leaving[c] * (1 + rows.drops[c]))
    return nk + found


@compiled()
def flip_apart(rows: Rows, space: Space, mode: Array, reg: Array, count: int) -> int:
    """Give the switches of violated guards their other states: of each component the contact of
    least index, or the first kink alone; returns the first switch.

    What other components do decides nothing at the order that violates a guard. If in the end it
    does, this is repeated, and pivoting continues with one switch at a time.

    Parameters
    ----------
    space : Space
        Lists the violated guards, and receives which switches are concerned.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
        Are changed.
    count : int
        How many of the violated guards are looked at.
    """
    nk = len(reg)
    asked = space.asked
    clear(asked)
    first = NOWHERE
    for i in range(count):
        guard = space.labels[i, NUMBER]
        if guard >= nk:
            c = contact_of(guard, nk)
            home = rows.homes[c, PART]
            # Contacts of one body come to rest together.
            if asked[home] == 1 and (rows.group[c] < 0 or mode[c] == 0):
                continue
            asked[home] = 1
        flipped = flip(rows, guard, mode, reg, space.leaving)
        space.touched[flipped] = 1
        if first < 0:
            first = flipped
        if guard < nk:
            break
    return first


@compiled()
def let_slide(mode: Array) -> bool:
    """Set contacts that exceed their thresholds to slip; returns whether there are any."""
    found = False
    for c in range(len(mode)):
        if abs(mode[c]) == 2:
            mode[c] //= 2
            found = True
    return found


@compiled(brief=True)
def hold_or_slide(flow: Flow, mode: Array, last: float, fired: int, slack: float) -> bool:
    """Set each contact that does not stick to its threshold while others carry it (±2), else to its
    sliding force (±1); a contact that can open is carried only where it touches.

    Parameters
    ----------
    flow : Flow
        With the coefficients, and the powers of the step.
    mode : array of int, shape (contacts,)
        Is changed.
    last : float
        Length of the last step.
    fired : int
        The switch that has just fired, or −1.
    slack : float
        Rounding errors that count as zero.

    Returns
    -------
    bool
        Whether that changes the forces.
    """
    rows, space, N = flow.rows, flow.space, flow.order
    changed = False
    for c in range(len(mode)):
        if rows.drops[c] == 1 and mode[c] != 0 and not is_loose(rows, mode, c):
            held = not is_wide(flow, c, last)
            for i in own_directions(rows, c):
                held = held and stays(rows, space, mode, i, N, last, fired, slack)
            force = 2 if held else 1
            if abs(mode[c]) != force:
                set_mode(rows, mode, c, force if mode[c] > 0 else -force)
                changed = True
    return changed


@compiled()
def let_carry(flow: Flow, mode: Array, keep: int) -> bool:
    """Set sticking contacts whose directions depend on those of the others to be carried; returns
    whether there are any."""
    rows = flow.rows
    changed = False
    for p in range(len(rows.parts)):
        if loosen(rows, p, flow.k.J, mode, keep, flow.space):
            changed = True
    return changed


@compiled()
def loosen(rows: Rows, p: int, J: Array, mode: Array, keep: int, space: Space) -> bool:
    """Set sticking contacts of a component whose directions depend on those of the others to be
    carried at their threshold (u remains 0).

    With more sticking contacts than directions their forces are not unique. Any admissible choice
    gives the same motion; a contact carried at its threshold is a vertex of that choice, and
    pivoting walks from vertex to vertex.

    Parameters
    ----------
    p : int
        The component.
    J : array
        Contact directions, with a column for each coordinate of the component; those that change on
        the way are in the table.
    mode : array of int, shape (contacts,)
        Is changed.
    keep : int
        The contact that has just begun to stick; negative: none.
    space : Space
        Receives which switches are concerned.

    Returns
    -------
    bool
        Whether there are any.
    """
    n = rows.parts[p, COORDINATES]
    m = rows.parts[p, CONTACTS]
    members = rows.members[rows.parts[p, MEMBERS] :]
    rank = 0
    changed = False
    kept = NOWHERE
    for i in range(m):
        if members[n + i] == keep:
            kept = i
    for turn in range(m + 1):
        # The contact that has just begun to stick comes first: it must not be released again.
        i = kept if turn == 0 else turn - 1
        if i < 0 or (turn == 0) != (i == kept):
            continue
        c = members[n + i]
        if mode[c] != 0:
            continue
        for j in range(n):
            space.scratch[rank, j] = direction_entry(rows, J, space.W, c, j)
        if is_new(n, space.scratch, rank, NEW_DIRECTION):
            rank += 1
        elif rows.group[c] < 0:
            set_mode(rows, mode, c, 1 + rows.drops[c])
            space.touched[len(rows.kinks) + c] = 1
            changed = True
    return changed


@compiled()
def may_be_carried(rows: Rows, J: Array, space: Space, mode: Array) -> bool:
    """Whether the direction of a contact that does not stick, and that others may hold at its
    threshold, depends linearly on the directions of sticking contacts.

    Parameters
    ----------
    J : array
        As in :func:`loosen`.
    mode : array of int, shape (contacts,)
    """
    for p in range(len(rows.parts)):
        n = rows.parts[p, COORDINATES]
        m = rows.parts[p, CONTACTS]
        members = rows.members[rows.parts[p, MEMBERS] :]
        rank = 0
        for i in range(m if m > 1 else 0):
            c = members[n + i]
            if mode[c] == 0:
                for j in range(n):
                    space.scratch[rank, j] = direction_entry(rows, J, space.W, c, j)
                if is_new(n, space.scratch, rank, NEW_DIRECTION):
                    rank += 1
        for i in range(m if rank > 0 else 0):
            c = members[n + i]
            if mode[c] != 0 and rows.drops[c] == 1:
                for j in range(n):
                    space.scratch[rank, j] = direction_entry(rows, J, space.W, c, j)
                if not is_new(n, space.scratch, rank, NEW_DIRECTION):
                    return True
    return False


@compiled()
def watches_nothing(rows: Rows, W: Array) -> bool:
    """Whether a row that bounds the step is undefined, such as a threshold beyond a table."""
    found = False
    for row in rows.watched:
        found = found or W[row, 0] != W[row, 0]
    return found


@compiled()
def flip_at_ends(rows: Rows, W: Array, mag: Array, reg: Array) -> bool:
    """Put knots of tables that end at one of them onto the other side, where a motion is at one;
    whether one is."""
    changed = False
    for j in range(len(rows.bounded)):
        at_knot = abs(W[rows.kinks[j], 0]) <= FIRED * kink_terms(rows, mag, j)
        if rows.bounded[j] == 1 and at_knot:
            reg[j] = 1 - reg[j]
            changed = True
    return changed


@compiled()
def set_regions(rows: Rows, W: Array, mag: Array, reg: Array) -> bool:
    """Put kinks onto the sides where their guards clearly are; whether one was not."""
    changed = False
    for j in range(len(reg)):
        value = W[rows.kinks[j], 0]
        unsure = FIRED * kink_terms(rows, mag, j)
        if (value < -unsure and reg[j] == 1) or (value > unsure and reg[j] == 0):
            reg[j] = 1 - reg[j]
            changed = True
    return changed
