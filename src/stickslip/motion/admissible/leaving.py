"""Contacts that share forces: the time until they leave stick, and the contacts that begin to slip
together.

Forces and radii are polynomials in Bernstein's form on a step. The set of all that can be held is
convex (:mod:`stickslip.motion.admissible.overload`): what holds at their control points holds along
them. Where it does not, a mechanism proves that; its guard, Σ s |Gw| − q·w, has a root, up to which
the rest is asked again.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.admissible.control_points import (
    LEAST_PIECE,
    MOST_CUTS_OF_A_STEP,
    place_piece,
    place_point,
    place_polynomials,
)
from stickslip.motion.admissible.overload import (
    LEAVES,
    MECHANISM,
    MOVES,
    RADIUS,
    SCRATCH,
    can_hold,
    fastest_of,
    fits,
    overload,
    place_held,
)
from stickslip.motion.admissible.sharing import (
    STAYS,
    held_at,
    orthonormalise,
    speed_of,
    sticks_in,
    turns,
)
from stickslip.motion.admissible.turning import first_failure, load_at, turn_to, turned_until
from stickslip.motion.algebra.roots import first_crossing
from stickslip.motion.steps.arrays import ON_INERTIAL, Flow
from stickslip.motion.steps.contacts import directions_of, inertial_contacts, set_mode
from stickslip.motion.steps.sets import MOVED, force_terms, radius_at, support_at
from stickslip.translator import compiled

_PROVED = 1e-11  # violation of a rest between control points relative to the thresholds
_SOON = 1e-3  # fraction of a step
_JUST_BEFORE = 1e-9  # relative step back to an earlier time at which rest is tested
_MOST_CUTS = 40  # largest number of mechanisms tried in the search for the one that begins


@compiled(brief=True)
def find_leaving(flow: Flow, mode: Array, first: int, lack: float) -> tuple[bool, float]:
    """Whether contacts that share their forces leave stick within a step, and which; their guard is
    left in the work space, with the size of its terms as a result.

    Parameters
    ----------
    flow : Flow
        With the coefficients and the powers of the step.
    mode : array of int, shape (contacts,)
    first : int
        The first contact of them.
    lack : float
        Part of the forces that counts as zero.
    """
    rows = flow.rows
    space = flow.space
    aside, powers = space.aside, space.powers
    group = rows.group[first]
    N = flow.order
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group):
            space.leaving[c] = STAYS
    if place_polynomials(flow, mode, group):
        return False, 0.0
    count, rank = orthonormalise(flow, mode, space.W, group)
    if count > rank and turns(flow, mode, group):
        return find_leaving_turned(flow, mode, group, lack), 1.0
    end = 1.0
    size = 0.0
    leaves = False
    for _ in range(_MOST_CUTS):
        place_piece(flow, mode, group, N - 1, 0.0, end)
        place_point(flow, mode, group, space.piece, N - 1)
        found = 0.0
        if not fits(flow, mode, group, 0.0):
            found = overload(flow, mode, group, rank, lack, True)[0]
        if not found > 1.0 + lack:
            place, fails = holds_until(flow, mode, group, rank, N - 1, end, _PROVED)
            if not fails:
                if place < end:
                    # No more is proved: bodies at rest are tested again there.
                    place_end(flow, place)
                    size = place
                    leaves = True
                break
            # When a mechanism just begins, rounding errors decide whether all contacts can be held.
            end = place if place < end else (1.0 - _JUST_BEFORE) * end
            continue
        size, fastest = place_guard(flow, mode, group, rank)
        mark_leaving(flow, mode, group, rank, fastest)
        leaves = True
        for k in range(N):
            aside[SCRATCH, k] = aside[LEAVES, k] * powers[k]
        if not aside[SCRATCH, 0] > lack * size:
            break
        root = first_crossing(aside[SCRATCH], N - 1, end, 0.0, space.stack)
        if not root < end:
            break
        end = root
    return leaves, size


@compiled(brief=True)
def find_leaving_turned(flow: Flow, mode: Array, group: int, lack: float) -> bool:
    """Whether contacts that share their forces leave stick within a step in which their directions
    turn, and which; their guard is stored in the work space.

    Parameters
    ----------
    flow : Flow
        With control points of the step.
    mode : array of int, shape (contacts,)
    lack : float
        Part of the forces that counts as zero.
    """
    d = flow.order - 1
    over = load_at(flow, mode, group, d, 0.0, lack) - 1.0
    if over > lack:
        mark_moving(flow, mode, group, 0.0)
        place_end(flow, -over)
        return True
    start, end = 0.0, 1.0
    proved, fails = turned_until(flow, mode, group, d, start, end, _PROVED)
    if fails == start:
        # Contacts that have just reached their limit stick if they do so shortly after.
        start = _SOON
        proved, fails = turned_until(flow, mode, group, d, start, end, _PROVED)
        if fails == start:
            load_at(flow, mode, group, d, start, lack)
            mark_moving(flow, mode, group, start)
            place_end(flow, 0.0)
            return True
    leaves = False
    before = _JUST_BEFORE
    for _ in range(_MOST_CUTS):
        if not fails <= end:
            break
        end, found = first_failure(flow, mode, group, d, proved, fails, lack)
        if found:
            mark_moving(flow, mode, group, end)
            place_end(flow, end)
            leaves = True
        end -= before * (end - start)
        before *= 2.0
        if not end > proved:
            break
        proved, fails = turned_until(flow, mode, group, d, proved, end, _PROVED)
    if not fails <= end and start < proved < end:
        # No more is proved: bodies at rest are tested again there.
        for c in range(flow.rows.sizes[ON_INERTIAL]):
            if sticks_in(flow.rows, mode, c, group):
                flow.space.leaving[c] = STAYS
        place_end(flow, proved)
        leaves = True
    return leaves


@compiled(brief=True)
def place_end(flow: Flow, place: float) -> None:
    """Set the guard to a linear function that vanishes at a fraction of the step."""
    guard = flow.space.aside[LEAVES]
    for k in range(flow.order):
        guard[k] = 0.0
    guard[0] = place
    guard[1] = -1.0 / flow.space.powers[1]


@compiled(brief=True)
def mark_moving(flow: Flow, mode: Array, group: int, x: float) -> None:
    """Mark the contacts of a group that the mechanism in the work space moves at a fraction x of
    the step."""
    rank = turn_to(flow, mode, group, x)
    fastest = fastest_of(flow, mode, group, rank, flow.space.aside[MECHANISM])
    mark_leaving(flow, mode, group, rank, fastest)


@compiled(brief=True)
def place_guard(flow: Flow, mode: Array, group: int, rank: int) -> tuple[float, float]:
    """Coefficients of Σ s |Gw| − q·w for the mechanism w in the work space, by the speed of the
    contact that it moves most; the size of the terms of the first, and that speed.

    Parameters
    ----------
    flow : Flow
        Receives them.
    mode : array of int, shape (contacts,)
    """
    rows = flow.rows
    space = flow.space
    W, guard = space.W, space.aside[LEAVES]
    fastest = fastest_of(flow, mode, group, rank, space.aside[MECHANISM])
    size = 0.0
    for k in range(flow.order):
        guard[k] = 0.0
    for c in inertial_contacts(rows):
        if not sticks_in(rows, mode, c, group):
            continue
        block = directions_of(rows, c)
        w = space.along[MOVED]
        speed_of(flow, c, rank, space.aside[MECHANISM])
        for i in range(3):
            w[i] /= fastest
        speed = support_at(flow, c, w)
        for k in range(flow.order):
            guard[k] += speed * radius_at(rows, W, c, k) - w[0] * held_at(flow, W, c, k)
            for i in range(1, len(block)):
                guard[k] -= w[i] * held_at(flow, W, block[i], k)
        size += speed * abs(radius_at(rows, W, c, 0))
        for i in range(len(block)):
            size += abs(w[i]) * force_terms(rows, space.mag, block[i])
    return size, fastest


@compiled(brief=True)
def mark_leaving(flow: Flow, mode: Array, group: int, rank: int, fastest: float) -> None:
    """Note which contacts of a group the mechanism in the work space moves. Where forces would have
    to be larger along it, the body goes the other way.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    fastest : float
        The speed of the contact that it moves most.
    """
    rows = flow.rows
    for c in inertial_contacts(rows):
        if sticks_in(rows, mode, c, group):
            moves = 0
            if speed_of(flow, c, rank, flow.space.aside[MECHANISM]) > MOVES * fastest:
                # Forces along w are those against a slip along −w.
                moves = 1 if flow.space.along[MOVED, 0] < 0.0 else -1
            set_mode(rows, flow.space.leaving, c, moves)


@compiled(brief=True)
def holds_until(
    flow: Flow, mode: Array, group: int, rank: int, d: int, end: float, lack: float
) -> tuple[float, bool]:
    """Part of [0, 1] on which forces and radii, given by control points of degree d, are proved to
    be admissible; and whether they are inadmissible at the end of the next part.

    Parameters
    ----------
    flow : Flow
        With control points of the whole in its work space.
    mode : array of int, shape (contacts,)
    end : float
        Where to stop.
    lack : float
        Part of the forces that may be missing.

    Returns
    -------
    place : float
        `end`, if all is proved; else a place where the forces cannot be held, or up to which they
        can.
    fails : bool
        Which of both.
    """
    a = 0.0
    length = end
    for _ in range(MOST_CUTS_OF_A_STEP):
        if not a < end:
            return end, False
        b = end if a + 1.01 * length >= end else a + length
        place_piece(flow, mode, group, d, a, b)
        # The admissible sets are convex: a polynomial stays in them if its control points are
        # there. The last control point is its value at the end, so that a failure there is a proof.
        held = True
        for i in range(d, -1, -1):
            place_point(flow, mode, group, flow.space.piece, i)
            held = can_hold(flow, mode, group, rank, lack)
            if not held:
                if i == d:
                    return b, True
                break
        if held:
            a = b
            length *= 2.0
        else:
            length = 0.5 * (b - a)
            if length < LEAST_PIECE * end:
                break
    return a, False


@compiled(brief=True)
def spare_part(flow: Flow, mode: Array, first: int) -> float:
    """The part of the thresholds that contacts which share their forces do not need at an instant,
    to a digit; 0 if they need all.

    Parameters
    ----------
    flow : Flow
        With the values of the rows.
    mode : array of int, shape (contacts,)
    first : int
        The first contact of them.
    """
    rows = flow.rows
    aside = flow.space.aside
    group = rows.group[first]
    rank = orthonormalise(flow, mode, flow.space.W, group)[1]
    part = 0.5
    while part > _PROVED:
        place_held(flow, mode, flow.space.W, group)
        for c in range(rows.sizes[ON_INERTIAL]):
            aside[RADIUS, c] *= 1.0 - part
        if can_hold(flow, mode, group, rank, 0.0):
            return part
        part *= 0.1
    return 0.0


@compiled(brief=True)
def missing_fraction(flow: Flow, mode: Array, first: int, d: int, least: float) -> float:
    """The part of the forces that contacts which share them may lack on a piece, in powers of 10;
    0 if it is proved that it is at most `least`.

    Parameters
    ----------
    flow : Flow
        With control points, of degree d, of forces and radii.
    mode : array of int, shape (contacts,)
    first, d : int
        The first contact of them, and the degree.
    """
    group = flow.rows.group[first]
    count, rank = orthonormalise(flow, mode, flow.space.W, group)
    turned = count > rank and turns(flow, mode, group)
    lack = least
    while lack < 1.0:
        fails = False
        if turned:
            place, _ = turned_until(flow, mode, group, d, 0.0, 1.0, lack)
        else:
            place, fails = holds_until(flow, mode, group, rank, d, 1.0, lack)
        if place >= 1.0 and not fails:
            return 0.0 if lack == least else lack
        lack *= 10.0
    return math.inf
