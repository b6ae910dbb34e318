"""Contacts that share forces and whose directions rotate: the time until they leave stick.

On a turntable, or on a body that rotates about one of its points, the directions G turn during
stick, and with them the self-equilibrated forces ν, Gᵀν = 0. At an instant, admissible forces f
are computed by :mod:`stickslip.motion.admissible.overload`. Let ν₀ and ν₁ be f − λ at the two ends
of a piece, with the forces λ of the mode, let P be the projection onto self-equilibrated forces at
its beginning, and let x run from 0 to 1. Then

    ν(x) = ν₀ + P (ν₁ − ν₀) x + …

is self-equilibrated at all times, if each further order is that of minimum norm which balances the
contribution of the directions to the lower orders. So the forces λ + ν have the resultant that rest
needs, and the control points of these polynomials show whether they are admissible on the whole
piece. If not, the piece is halved.
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
from stickslip.motion.admissible.sharing import orthonormalise, sticks_in
from stickslip.motion.algebra.roots import horner, lowest
from stickslip.motion.steps.arrays import COORDINATES, INERTIAL, MEMBERS, ON_INERTIAL, PART, Flow
from stickslip.motion.steps.contacts import direction_entry, directions_of, inertial_contacts
from stickslip.motion.steps.sets import axis_of
from stickslip.translator import compiled

_MOST_HALVINGS = 80  # largest number of bisections of the interval that contains the end of rest
_LITTLE = 2.0**-52  # relative accuracy of that time
_ROUNDED = 4.0  # multiple of `lack` by which polynomials may be outside their sets
# Rows of Space.aside, after those of `overload`: self-equilibrated forces at both ends of a piece.
_BEFORE, _AFTER = 11, 12


@compiled(brief=True)
def turn_to(flow: Flow, mode: Array, group: int, x: float) -> int:
    """Compute the directions of the sticking contacts of a group at a fraction x of the step;
    returns their rank.

    Parameters
    ----------
    flow : Flow
        With the coefficients and the powers of the step; receives the directions.
    mode : array of int, shape (contacts,)
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
    return orthonormalise(flow, mode, space.V, group)[1]


@compiled(brief=True)
def load_at(flow: Flow, mode: Array, group: int, d: int, x: float, lack: float) -> float:
    """Factor by which, at least, the forces that rest needs at a fraction x of the step exceed the
    admissible ones, with the mechanism that begins in the work space; 0 if the forces of minimum
    norm are admissible.

    Parameters
    ----------
    flow : Flow
        With control points of the step, of degree d.
    mode : array of int, shape (contacts,)
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
    """Whether admissible forces exist at a fraction x of the step; their difference from those of
    the mode is stored in the work space.

    Parameters
    ----------
    flow, mode, group, d, x, lack
        As in :func:`load_at`.
    row : int
        Row of the work space that receives it.
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
    """Up to where admissible forces are proved to exist while directions turn, and a later place at
    which none exist; infinite if no such place was found.

    Parameters
    ----------
    flow : Flow
        With control points of the step, of degree d.
    mode : array of int, shape (contacts,)
    start, end : float
        Beginning and end of the search, in units of the step.
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
    """The first place without admissible forces, between one at which they exist and a later one at
    which they do not; False if they do exist there. The mechanism that begins is stored in the work
    space.

    Parameters
    ----------
    flow, mode, group, d, lack
        As in :func:`load_at`.
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
            # Beyond the end of rest, the excess grows linearly at first.
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
    """Whether the forces that connect admissible ones at both ends of a piece are admissible
    throughout.

    Parameters
    ----------
    flow, mode, group, d, lack
        As in :func:`turned_until`; the additions to the forces of the mode at both ends are in the
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
    """Add self-equilibrated forces to the control points of a piece, from those at both ends; False
    if the piece is too long for their power series.

    Parameters
    ----------
    flow, mode, group, d, a, b, lack
        As in :func:`holds_between`.
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
                    space.bend[i, j] += space.in_basis[c, i] * space.in_basis[c, j]
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
    """Power series of the directions of the sticking contacts of a group, on a piece of the step.

    Parameters
    ----------
    flow : Flow
        With the coefficients and the powers of the step, and a basis of the directions at the
        beginning of the piece; receives the series.
    mode : array of int, shape (contacts,)
    a, length : float
        Beginning and length of the piece, in units of the step.
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
            # Taylor shift to the beginning of the piece, by repeated synthetic division.
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
    """Subtract the forces of minimum norm with the resultant Gᵀν of an order from that order of ν;
    returns their size if ν has no such order.

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
    # Forces of minimum norm with a resultant are G (GᵀG)⁻¹ times it.
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
            force += space.in_basis[c, r] * least[r]
        if k <= d:
            series[mq * nq + c, k] -= force
        else:
            largest = max(largest, abs(force))
    return largest
