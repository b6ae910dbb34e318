"""The law of a contact in a plane on a piece of a step: the force stays within the threshold in
stick, and is opposite to the velocity in slip.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.admissible.sharing import ON_ITS_OWN, length_of
from stickslip.motion.audit.accounts import (
    BACKWARDS,
    CANCELLED_PART,
    CREEP,
    EXCESS,
    LARGEST,
    LARGEST_FORCE,
    LARGEST_SPEED,
    NEGLIGIBLE_PART,
    OFF_THRESHOLD,
    REST_PART,
    SPEED_HELD,
    SWAY,
    Tally,
    free_speed,
)
from stickslip.motion.audit.between_nodes import strays
from stickslip.motion.audit.nodes import COUNT, LEBESGUE, largest_of, least_on_nodes, most
from stickslip.motion.discs.tables import BALL, OFF
from stickslip.motion.modes.guards import resting
from stickslip.motion.steps.arrays import (
    ADMISSIBLE,
    ADMISSIBLE_SIZE,
    AHEAD,
    AIM,
    ASIDE,
    ATOP,
    COMPONENT,
    COORDINATES,
    DIMENSION,
    INERTIAL,
    MASSIVE,
    MEMBERS,
    ON_INERTIAL,
    ON_VISCOUS,
    OTHER,
    PART,
    ROUNDING,
    STATIC,
    THIRD_PART,
    Rows,
    Space,
    is_loose,
    whole_size,
)
from stickslip.translator import compiled


@compiled()
def sample_plane(
    rows: Rows, space: Space, mode: Array, h: float, g: int, c: int, tally: Tally
) -> None:
    """Keep what the law of a contact in a plane says at a node: s² − |A⁻¹λ|² and both velocities
    in stick; n·Au, n × Au and n·n − 1 in slip, where the force is −k A n by construction.

    Parameters
    ----------
    rows : Rows
    space : Space
        With the values of the rows at the node; receives those of the guards.
    mode : array of int, shape (contacts,)
    h : float
        How long a series would last.
    g, c : int
        The node, and the first component.
    tally : Tally
        Receives the sizes, at the first component.
    """
    n = rows.sizes[DIMENSION]
    V = space.V
    mag = space.mag
    samples = space.samples
    law = tally.law
    plane = rows.planes[rows.plane[c]]
    other, third = plane[OTHER], plane[THIRD_PART]
    u, v = V[plane[AHEAD], 0], V[plane[ASIDE], 0]
    w = V[plane[ATOP], 0] if third >= 0 else 0.0
    force = max(V[plane[STATIC], 0], 0.0)
    law[c, LARGEST_FORCE] = most(law[c, LARGEST_FORCE], force)
    speed = max(length_of(u, v, w), CANCELLED_PART * whole_size(rows, mag, rows.plane[c], 0))
    law[c, LARGEST_SPEED] = most(law[c, LARGEST_SPEED], speed)
    row = n + 3 * c
    if mode[c] == 0:
        samples[row, g] = V[plane[ADMISSIBLE], 0]
        samples[row + 1, g] = u
        samples[row + 2, g] = v
        for i in (c, other):
            law[c, SPEED_HELD] = most(law[c, SPEED_HELD], free_speed(rows, space, i, h))
        if third >= 0:
            samples[n + 3 * third, g] = w
            law[c, SPEED_HELD] = most(law[c, SPEED_HELD], free_speed(rows, space, third, h))
        return
    x, y = V[plane[AIM], 0], V[plane[AIM] + 1, 0]
    samples[row, g] = x * u + y * v
    samples[row + 1, g] = x * v - y * u
    samples[row + 2, g] = x * x + y * y - 1.0
    if third >= 0:
        z = V[plane[AIM] + 2, 0]
        samples[row, g] += z * w
        samples[row + 2, g] += z * z
        samples[n + 3 * third, g] = x * w - z * u
        samples[n + 3 * third + 1, g] = y * w - z * v
    if plane[MASSIVE] == 1:
        made = whole_size(rows, mag, rows.plane[c], len(rows.u)) * h
        law[c, SPEED_HELD] = most(law[c, SPEED_HELD], made)
    elif c >= rows.sizes[ON_INERTIAL] + rows.sizes[ON_VISCOUS]:
        # What slides without mass or viscosity has the force s, by nothing but its place.
        row += 3 * (other - c)
        held = V[plane[STATIC], 0] ** 2 - V[plane[ADMISSIBLE], 0]
        samples[row, g] = math.sqrt(max(held, 0.0)) - V[plane[STATIC], 0]


@compiled()
def product_strays(W: Array, discs: Array, a: int, b: int, factor: float) -> float:
    """What a product of two rows may do between the nodes.

    Parameters
    ----------
    W, discs : arrays
        Values of the rows (order 0), and their discs.
    a, b : int
        The rows.
    factor : float
        As of :func:`.strays`.
    """
    x, y = abs(W[a, 0]), abs(W[b, 0])
    u, v = discs[a, BALL], discs[b, BALL]
    off = discs[a, OFF] * (y + v) + discs[b, OFF] * (x + u + discs[a, OFF])
    return factor * (x * v + u * y + u * v) + 2.0 * (1.0 + LEBESGUE) * off


@compiled()
def blurred_by_turns(rows: Rows, space: Space, mode: Array, c: int, tally: Tally) -> float:
    """By how much rounding errors of velocities turn the directions of slips in a piece, and with
    them the forces that a contact has beside these, in parts of its size: where a slip ends, the
    last that is left of it is rounding errors.

    Parameters
    ----------
    rows : Rows
    space : Space
        With what :func:`sample_plane` keeps.
    mode : array of int, shape (contacts,)
    c : int
        The contact.
    tally : Tally
        With the largest speeds.
    """
    found = 0.0
    for p in range(len(rows.planes)):
        first = rows.planes[p, COMPONENT]
        beside = rows.homes[first, PART] == rows.homes[c, PART] and rows.planes[p, MASSIVE] == 1
        if beside and not resting(mode[first]) and not is_loose(rows, mode, first):
            rounding = ROUNDING * tally.law[first, LARGEST_SPEED]
            slowest = np.inf
            for g in range(COUNT):
                slowest = min(slowest, space.samples[rows.sizes[DIMENSION] + 3 * first, g])
            if rounding > found * slowest:
                found = rounding / max(slowest, ROUNDING * rounding)
    return found


@compiled()
def judge_plane(rows: Rows, space: Space, mode: Array, c: int, factor: float, tally: Tally) -> None:
    """By how much the law of a contact in a plane fails on a piece.

    Parameters
    ----------
    rows : Rows
    space : Space
        With what :func:`sample_plane` keeps, and the discs.
    mode : array of int, shape (contacts,)
    c : int
        The first component.
    factor : float
        As of :class:`.StepPiece`.
    tally : Tally
        Receives the largest.
    """
    W = space.W
    mag = space.mag
    discs = space.discs
    samples = space.samples
    law = tally.law
    plane = rows.planes[rows.plane[c]]
    row = rows.sizes[DIMENSION] + 3 * c
    known = factor < np.inf
    ahead, aside, aim, third = plane[AHEAD], plane[ASIDE], plane[AIM], plane[THIRD_PART]
    last = rows.sizes[DIMENSION] + 3 * third  # samples of the third component
    rounding = ROUNDING * whole_size(rows, mag, rows.plane[c], 0)
    if mode[c] == 0:
        force = law[c, LARGEST_FORCE]
        loose = strays(discs[plane[ADMISSIBLE]], factor) if known else 0.0
        low = least_on_nodes(samples[row], space.bernstein, 1e-2 * NEGLIGIBLE_PART * force * force)
        unsure = ROUNDING * mag[plane[ADMISSIBLE_SIZE]]
        unsure += blurred_by_turns(rows, space, mode, c, tally) * force * force
        if force > 0.0 and space.leaving[c] == ON_ITS_OWN:
            law[c, EXCESS] = most(law[c, EXCESS], (loose - low - unsure) / force)
        for part in (1, 2):
            moves = strays(discs[ahead if part == 1 else aside], factor) if known else 0.0
            creep = largest_of(samples[row + part]) + moves - rounding
            law[c, CREEP] = most(law[c, CREEP], creep)
        if third >= 0:
            moves = strays(discs[plane[ATOP]], factor) if known else 0.0
            creep = largest_of(samples[last]) + moves - rounding
            law[c, CREEP] = most(law[c, CREEP], creep)
        return
    along = 0.0
    across = 0.0
    unit = 0.0
    if known:
        along = product_strays(W, discs, aim, ahead, factor)
        along += product_strays(W, discs, aim + 1, aside, factor)
        across = product_strays(W, discs, aim, aside, factor)
        across += product_strays(W, discs, aim + 1, ahead, factor)
        unit = product_strays(W, discs, aim, aim, factor)
        unit += product_strays(W, discs, aim + 1, aim + 1, factor)
    if known and third >= 0:
        along += product_strays(W, discs, aim + 2, plane[ATOP], factor)
        for i in range(2):
            across += product_strays(W, discs, aim + i, plane[ATOP], factor)
            across += product_strays(W, discs, aim + 2, plane[AHEAD + i], factor)
        unit += product_strays(W, discs, aim + 2, aim + 2, factor)
    low = least_on_nodes(samples[row], space.bernstein, rounding)
    law[c, BACKWARDS] = most(law[c, BACKWARDS], along - rounding - low)
    turned = largest_of(samples[row + 1]) + across - rounding
    law[c, BACKWARDS] = most(law[c, BACKWARDS], turned)
    for i in range(2 if third >= 0 else 0):
        turned = largest_of(samples[last + i]) + across - rounding
        law[c, BACKWARDS] = most(law[c, BACKWARDS], turned)
    unsure = ROUNDING + blurred_by_turns(rows, space, mode, c, tally)
    longer = law[c, LARGEST_FORCE] * (largest_of(samples[row + 2]) + unit - unsure)
    law[c, OFF_THRESHOLD] = most(law[c, OFF_THRESHOLD], longer)
    if c >= rows.sizes[ON_INERTIAL] + rows.sizes[ON_VISCOUS]:
        off = largest_of(samples[row + 3 * (plane[OTHER] - c)])
        off -= ROUNDING * (mag[2 * len(rows.u) + c] + mag[2 * len(rows.u) + plane[OTHER]])
        if known and law[c, LARGEST_FORCE] > 0.0:
            off += strays(discs[plane[ADMISSIBLE]], factor) / law[c, LARGEST_FORCE]
        law[c, OFF_THRESHOLD] = most(law[c, OFF_THRESHOLD], off)


@compiled()
def share_sizes(rows: Rows, state: Array) -> None:
    """Give the coordinates that a contact in a plane moves, and their velocities, one size, and so
    the modes of a structure: they are components of vectors, and a turn of the axes does not
    matter.

    Parameters
    ----------
    state : array, shape (4, n)
        As of :class:`Tally`; what forces make is as large as the largest then.
    """
    for b in range(len(rows.bodies)):
        for first in (0, rows.sizes[INERTIAL]):
            begin = first + rows.bodies[b, 0]
            largest = 0.0
            for r in range(begin, begin + rows.bodies[b, 1]):
                largest = max(largest, state[LARGEST, r], REST_PART * state[SWAY, r])
            for r in range(begin, begin + rows.bodies[b, 1]):
                state[SWAY, r] = max(state[SWAY, r], largest / REST_PART)
    for p in range(len(rows.planes)):
        if rows.planes[p, MASSIVE] == 0:
            continue
        for first in (0, rows.sizes[INERTIAL]):
            largest = 0.0
            for turn in range(2):
                # A rate of turning is none of a velocity.
                for i in (COMPONENT, OTHER):
                    part = rows.parts[rows.homes[rows.planes[p, i], PART]]
                    for j in range(part[COORDINATES]):
                        r = first + rows.members[part[MEMBERS] + j]
                        if turn == 0:
                            largest = max(largest, state[LARGEST, r], REST_PART * state[SWAY, r])
                        else:
                            state[SWAY, r] = max(state[SWAY, r], largest / REST_PART)
