"""How long contacts that share their forces hold where their directions turn.

On a turntable, or on a body that turns about one of its points, directions G turn while contacts
stick, and with them the forces ν that cancel, Gᵀν = 0. At an instant it is known which forces f
hold (:mod:`stickslip.motion.admissible.overload`). From those at both ends of a piece, less the
forces λ of the mode, follow forces that cancel throughout: with ν₀ and ν₁ at its beginning and its
end, P what takes all that does not cancel out of forces at the beginning, and x from 0 to 1,

    ν(x) = ν₀ + P (ν₁ − ν₀) x + …,

where each further order is the least that cancels what directions make of the lower ones. So the
forces λ + ν have the sum that rest needs, and the control points of these polynomials show whether
they are inside their sets all the time between. If not, the piece is halved.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.equations.codegen.series import invert
from stickslip.motion.admissible.control_points import (
    LEAST_PIECE,
    MOST_CUTS_OF_A_STEP,
    place_piece,
    place_point,
)
from stickslip.motion.admissible.overload import (
    GIVEN_FORCES,
    SCRATCH,
    STEP,
    fits,
    inner_forces,
    overload,
)
from stickslip.motion.admissible.sharing import grip, sticks_in
from stickslip.motion.steps.arrays import (
    COORDINATES,
    INERTIAL,
    MEMBERS,
    ON_INERTIAL,
    PART,
    Flow,
    direction_entry,
    directions_of,
    inertial_contacts,
)
from stickslip.motion.steps.roots import horner, lowest
from stickslip.motion.steps.sets import axis_of
from stickslip.translator import compiled

_MOST_HALVINGS = 80  # of the time in which rest ends
_LITTLE = 2.0**-52  # part of that time to which it is known
_ROUNDED = 4.0  # parts `lack` of their sets by which polynomials may be outside
# Rows of Space.aside, behind those of `overload`: forces that cancel, at both ends of a piece.
_BEFORE, _AFTER = 11, 12


@compiled(brief=True)
def turn_to(flow: Flow, mode: Array, group: int, x: float) -> int:
    """Place the directions of what sticks in a group as they are at a part x of the step; returns
    how many are independent.

    Parameters
    ----------
    flow : Flow
        With the coefficients and the powers of the step; receives the directions.
    mode : array of int, shape (contacts,)
    group : int
    x : float
    """
    rows, space = flow.rows, flow.space
    orders = space.aside[SCRATCH]
    for c in range(rows.sizes[ON_INERTIAL]):
        if not sticks_in(rows, mode, c, group):
            continue
        for j in range(rows.parts[rows.homes[c, PART], COORDINATES]):
            row = rows.turning[c, j]
            if row >= 0:
                for k in range(flow.order):
                    orders[k] = space.W[row, k] * space.powers[k]
                space.V[row, 0] = horner(orders, flow.order - 1, x)
    return grip(flow, mode, space.V, group)[1]


@compiled(brief=True)
def load_at(flow: Flow, mode: Array, group: int, d: int, x: float, lack: float) -> float:
    """By what factor, at least, the forces that rest needs at a part x of the step are larger than
    what can be held, with the mechanism that begins in the work space; 0 if the least can be held.

    Parameters
    ----------
    flow : Flow
        With control points of the step, of degree d.
    mode : array of int, shape (contacts,)
    group, d : int
    x : float
    lack : float
        Part of the forces that may be missing.
    """
    place_piece(flow, mode, group, d, 0.0, x)
    place_point(flow, mode, group, flow.space.piece, d)
    rank = turn_to(flow, mode, group, x)
    if fits(flow, mode, group, 0.0):
        return 0.0
    return overload(flow, mode, group, rank, lack, True)[0]


@compiled(brief=True)
def find_held(flow: Flow, mode: Array, group: int, d: int, x: float, lack: float, row: int) -> bool:
    """Whether the forces that rest needs at a part x of the step can be held; what has to be added
    to those of the mode is left in the work space.

    Parameters
    ----------
    flow, mode, group, d, x, lack
        As of :func:`load_at`.
    row : int
        Where it is left.
    """
    rows, aside = flow.rows, flow.space.aside
    place_piece(flow, mode, group, d, 0.0, x)
    place_point(flow, mode, group, flow.space.piece, d)
    rank = turn_to(flow, mode, group, x)
    for c in range(rows.sizes[ON_INERTIAL]):
        aside[row, c] = 0.0
    if fits(flow, mode, group, lack):
        return True
    load, held = overload(flow, mode, group, rank, lack, False)
    if not held:
        return False
    part = (1.0 - lack) / max(load, 1.0)
    for c in inertial_contacts(rows):
        if sticks_in(rows, mode, c, group):
            block = directions_of(rows, c)
            force = inner_forces(flow, c, rank)
            for i in range(len(block)):
                aside[row, block[i]] = force[i] / part - aside[GIVEN_FORCES, block[i]]
    return True


@compiled(brief=True)
def turned_until(
    flow: Flow, mode: Array, group: int, d: int, start: float, end: float, lack: float
) -> tuple[float, float]:
    """How far it is proved that forces can be held while directions turn, and a place behind where
    they cannot; infinite if none was met.

    Parameters
    ----------
    flow : Flow
        With control points of the step, of degree d.
    mode : array of int, shape (contacts,)
    group, d : int
    start, end : float
        Where to begin, and where to stop, in parts of the step.
    lack : float
        Part of the forces that may be missing.
    """
    aside = flow.space.aside
    a = start
    length = end - start
    if not find_held(flow, mode, group, d, a, lack, _BEFORE):
        return a, a
    for _ in range(MOST_CUTS_OF_A_STEP):
        if not a < end:
            break
        b = end if a + 1.01 * length >= end else a + length
        if not find_held(flow, mode, group, d, b, lack, _AFTER):
            return a, b
        if holds_between(flow, mode, group, d, a, b, lack):
            a = b
            length *= 2.0
            for c in range(flow.rows.sizes[ON_INERTIAL]):
                aside[_BEFORE, c] = aside[_AFTER, c]
        else:
            length = 0.5 * (b - a)
            if length < LEAST_PIECE * end:
                break
    return a, math.inf


@compiled(brief=True)
def first_failure(
    flow: Flow, mode: Array, group: int, d: int, low: float, high: float, lack: float
) -> tuple[float, bool]:
    """Where forces can no longer be held that could be at one place, and cannot at a later one;
    False if that is not so there. The mechanism that begins is left in the work space.

    Parameters
    ----------
    flow, mode, group, d, lack
        As of :func:`load_at`.
    low, high : float
        The places.
    """
    over = load_at(flow, mode, group, d, high, lack) - 1.0
    if not over > lack:
        return high, False
    later, more = math.inf, 0.0
    for turn in range(_MOST_HALVINGS):
        if high - low <= _LITTLE * high:
            break
        x = 0.5 * (low + high)
        if turn % 2 == 1 and later < math.inf and more > over:
            # Beyond its end, what cannot be held grows evenly.
            line = high - over * (later - high) / (more - over)
            x = line if low < line < high else x
        there = load_at(flow, mode, group, d, x, lack) - 1.0
        if there > lack:
            later, more = high, over
            high, over = x, there
        else:
            low = x
    load_at(flow, mode, group, d, high, lack)
    return high, True


@compiled(brief=True)
def holds_between(
    flow: Flow, mode: Array, group: int, d: int, a: float, b: float, lack: float
) -> bool:
    """Whether forces that hold at both ends of a piece go over into each other and hold between.

    Parameters
    ----------
    flow, mode, group, d, lack
        As of :func:`turned_until`; what is added to the forces of the mode at both ends is in the
        work space.
    a, b : float
        The ends.
    """
    place_piece(flow, mode, group, d, a, b)
    if not lead_over(flow, mode, group, d, a, b, lack):
        return False
    for i in range(d, -1, -1):
        place_point(flow, mode, group, flow.space.piece, i)
        if not fits(flow, mode, group, _ROUNDED * lack):
            return False
    return True


@compiled(brief=True)
def lead_over(flow: Flow, mode: Array, group: int, d: int, a: float, b: float, lack: float) -> bool:
    """Add forces that cancel to the control points of a piece, from those at both ends; False if
    the piece is too long for their series.

    Parameters
    ----------
    flow, mode, group, d, a, b, lack
        As of :func:`holds_between`.
    """
    rows, space = flow.rows, flow.space
    aside, series = space.aside, space.cancelling
    mq, nq = rows.sizes[ON_INERTIAL], rows.sizes[INERTIAL]
    needed = False
    size = 0.0
    for c in range(mq):
        if sticks_in(rows, mode, c, group):
            needed = needed or aside[_BEFORE, c] != 0.0 or aside[_AFTER, c] != 0.0
            size = max(size, space.piece[mq + c, 0], space.piece[mq + c, d])
    if not needed:
        return True
    rank = turn_to(flow, mode, group, a)
    place_turns(flow, mode, group, rank, a, b - a)
    for i in range(rank):
        for j in range(rank):
            space.bend[i, j] = 0.0
            for c in range(mq):
                if sticks_in(rows, mode, c, group):
                    space.bend[i, j] += space.grip[c, i] * space.grip[c, j]
    if not invert(space.bend, rank, space.unbent):
        return False
    own = mq * nq  # the first row of ν
    for c in range(mq):
        if sticks_in(rows, mode, c, group):
            for k in range(d + 1):
                series[own + c, k] = 0.0
            series[own + c, 0] = aside[_BEFORE, c]
            series[own + c, 1] = aside[_AFTER, c] - aside[_BEFORE, c]
    off = 0.0
    for k in range(d + flow.order):
        off += cancel_order(flow, mode, group, rank, k, d)
    if not off <= lack * size:
        return False
    for c in range(mq):
        if sticks_in(rows, mode, c, group):
            lowest(series[own + c], d, aside[SCRATCH], aside[STEP])
            for i in range(d + 1):
                space.piece[c, i] += aside[SCRATCH, i]
    return True


@compiled(brief=True)
def place_turns(flow: Flow, mode: Array, group: int, rank: int, a: float, length: float) -> None:
    """Series of the directions of what sticks in a group, on a piece of the step.

    Parameters
    ----------
    flow : Flow
        With the coefficients and the powers of the step, and a basis of the directions at the
        beginning of the piece; receives the series.
    mode : array of int, shape (contacts,)
    group, rank : int
    a, length : float
        Beginning and length of the piece, in parts of the step.
    """
    rows, space = flow.rows, flow.space
    N = flow.order
    series, orders = space.cancelling, space.aside[SCRATCH]
    nq = rows.sizes[INERTIAL]
    for c in range(rows.sizes[ON_INERTIAL]):
        if not sticks_in(rows, mode, c, group):
            continue
        for r in range(rank):
            for k in range(series.shape[1]):
                series[c * nq + r, k] = 0.0
        part = rows.parts[rows.homes[c, PART]]
        axis = axis_of(flow, c)
        for j in range(part[COORDINATES]):
            q = rows.members[part[MEMBERS] + j]
            row = rows.turning[c, j]
            last = N if row >= 0 else 1
            orders[0] = direction_entry(rows, flow.k.J, space.W, c, j)
            for k in range(1, last):
                orders[k] = space.W[row, k] * space.powers[k]
            for i in range(last):
                for k in range(last - 2, i - 1, -1):
                    orders[k] += a * orders[k + 1]
            factor = axis
            for k in range(last):
                for r in range(rank):
                    series[c * nq + r, k] += factor * orders[k] * space.basis[r, q]
                factor *= length


@compiled(brief=True)
def cancel_order(flow: Flow, mode: Array, group: int, rank: int, k: int, d: int) -> float:
    """Take the least forces that have the sum Gᵀν in an order from that order of ν; their size, if
    ν has no such order.

    Parameters
    ----------
    flow : Flow
        With the series of G and of ν, and the inverse of GᵀG at the beginning.
    mode : array of int, shape (contacts,)
    group, rank : int
        The contacts, and how many of their directions are independent.
    k, d : int
        The order, and the last one of ν.
    """
    rows, space = flow.rows, flow.space
    series = space.cancelling
    mq, nq = rows.sizes[ON_INERTIAL], rows.sizes[INERTIAL]
    total, least = space.aside[SCRATCH], space.aside[STEP]
    for r in range(rank):
        total[r] = 0.0
    for c in range(mq):
        if not sticks_in(rows, mode, c, group):
            continue
        for j in range(max(0, k - d), min(k, flow.order - 1) + 1):
            force = series[mq * nq + c, k - j]
            for r in range(rank if force != 0.0 else 0):
                total[r] += series[c * nq + r, j] * force
    for r in range(rank):
        least[r] = 0.0
        for i in range(rank):
            least[r] += space.unbent[r, i] * total[i]
    largest = 0.0
    for c in range(mq):
        if not sticks_in(rows, mode, c, group):
            continue
        force = 0.0
        for r in range(rank):
            force += space.grip[c, r] * least[r]
        if k <= d:
            series[mq * nq + c, k] -= force
        else:
            largest = max(largest, abs(force))
    return largest
