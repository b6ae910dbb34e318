"""The law of a contact in a plane on a piece of a step: the force stays within the threshold in
stick, and is opposite to the velocity in slip.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.admissible.sharing import ON_ITS_OWN
from stickslip.motion.affine.nodes import COUNT, LEBESGUE, largest_of, least_on_nodes, most
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
    samples_of,
)
from stickslip.motion.audit.between_nodes import deviation_bound
from stickslip.motion.discs.tables import BALL, OFF
from stickslip.motion.modes.guards import resting
from stickslip.motion.steps.arrays import (
    ADMISSIBLE,
    ADMISSIBLE_SIZE,
    AHEAD,
    AIM,
    COORDINATES,
    INERTIAL,
    LEAD,
    MASSIVE,
    MEMBERS,
    PART,
    STATIC,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import directions_of
from stickslip.motion.steps.sets import (
    force_terms,
    is_rate_independent,
    plane_of,
    slips_with_mass,
    whole_rate,
    whole_speed,
)
from stickslip.motion.steps.step_size import FAINT
from stickslip.numerics.levels import ROUNDING
from stickslip.translator import compiled


@compiled()
def sample_plane(
    rows: Rows, space: Space, mode: Array, h: float, g: int, c: int, tally: Tally
) -> None:
    """Evaluate the law of a contact in a plane at a node: s² − |A⁻¹λ|² and both velocities in
    stick; n·Au, n × Au and n·n − 1 in slip, where the force is −k A n by construction. The first
    and the last are in the rows of the first direction; velocities, and cross products of two
    directions, in those of the direction, or of the second one.

    Parameters
    ----------
    space : Space
        With the values of the rows at the node; receives those of the guards.
    mode : array of int, shape (contacts,)
    h : float
        How long a series would last.
    g, c : int
        The node, and the first direction.
    tally : Tally
        Receives the sizes, at the first direction.
    """
    V = space.V
    mag = space.mag
    samples = space.samples
    law = tally.law
    plane = plane_of(rows, c)
    block = directions_of(rows, c)
    aim = plane[AIM]
    row = samples_of(rows, c)
    force = max(V[plane[STATIC], 0], 0.0)
    law[c, LARGEST_FORCE] = most(law[c, LARGEST_FORCE], force)
    speed = 0.0
    for i in range(len(block)):
        speed = math.hypot(speed, V[plane[AHEAD + i], 0])
    # A speed whose terms nearly cancel is known only relative to these.
    speed = max(speed, CANCELLED_PART * whole_speed(rows, mag, c))
    law[c, LARGEST_SPEED] = most(law[c, LARGEST_SPEED], speed)
    if mode[c] == 0:
        samples[row, g] = V[plane[ADMISSIBLE], 0]
        for i in range(len(block)):
            samples[samples_of(rows, block[i]) + 1, g] = V[plane[AHEAD + i], 0]
            law[c, SPEED_HELD] = most(law[c, SPEED_HELD], free_speed(rows, space, block[i], h))
        return
    along = 0.0
    square = 0.0
    for j in range(len(block)):
        along += V[aim + j, 0] * V[plane[AHEAD + j], 0]
        square += V[aim + j, 0] * V[aim + j, 0]
        square -= 1.0 if j == 1 else 0.0
        for i in range(j):
            turned = V[aim + i, 0] * V[plane[AHEAD + j], 0] - V[aim + j, 0] * V[plane[AHEAD + i], 0]
            samples[samples_of(rows, block[j]) + 1 + i, g] = turned
    samples[row, g] = along
    samples[row + 2, g] = square
    if plane[MASSIVE] == 1:
        law[c, SPEED_HELD] = most(law[c, SPEED_HELD], whole_rate(rows, mag, c) * h)
    elif is_rate_independent(rows, c):
        # A contact that slides without mass or viscosity has the force s, which depends on its
        # position only.
        held = V[plane[STATIC], 0] ** 2 - V[plane[ADMISSIBLE], 0]
        off = math.sqrt(max(held, 0.0)) - V[plane[STATIC], 0]
        samples[samples_of(rows, block[1]), g] = off


@compiled()
def product_deviation(W: Array, discs: Array, a: int, b: int, factor: float) -> float:
    """Bound of the deviation of a product of two rows between the nodes.

    Parameters
    ----------
    W, discs : arrays
        Values of the rows (order 0), and their discs.
    a, b : int
        The rows.
    factor : float
        As in :func:`.deviation_bound`.
    """
    x, y = abs(W[a, 0]), abs(W[b, 0])
    u, v = discs[a, BALL], discs[b, BALL]
    off = discs[a, OFF] * (y + v) + discs[b, OFF] * (x + u + discs[a, OFF])
    return factor * (x * v + u * y + u * v) + 2.0 * (1.0 + LEBESGUE) * off


@compiled()
def direction_uncertainty(rows: Rows, space: Space, mode: Array, c: int, tally: Tally) -> float:
    """Uncertainty of the directions of slips in a piece due to rounding errors of velocities, and
    of the other forces of the contact, relative to its size. Where a slip ends, its velocity falls
    below the rounding errors.

    Parameters
    ----------
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
        first = rows.planes[p, LEAD]
        beside = rows.homes[first, PART] == rows.homes[c, PART] and not resting(mode[first])
        if beside and slips_with_mass(rows, mode, p):
            rounding = ROUNDING * tally.law[first, LARGEST_SPEED]
            slowest = np.inf
            for g in range(COUNT):
                slowest = min(slowest, space.samples[samples_of(rows, first), g])
            if rounding > found * slowest:
                found = rounding / max(slowest, ROUNDING * rounding)
    return found


@compiled()
def judge_plane(rows: Rows, space: Space, mode: Array, c: int, factor: float, tally: Tally) -> None:
    """Violation of the law of a contact in a plane on a piece.

    Parameters
    ----------
    space : Space
        With what :func:`sample_plane` keeps, and the discs.
    mode : array of int, shape (contacts,)
    c : int
        The first direction.
    factor : float
        As in :class:`.StepPiece`.
    tally : Tally
        Receives the largest.
    """
    W = space.W
    mag = space.mag
    discs = space.discs
    samples = space.samples
    law = tally.law
    plane = plane_of(rows, c)
    block = directions_of(rows, c)
    row = samples_of(rows, c)
    known = factor < np.inf
    aim = plane[AIM]
    rounding = ROUNDING * whole_speed(rows, mag, c)
    if mode[c] == 0:
        force = law[c, LARGEST_FORCE]
        loose = deviation_bound(discs[plane[ADMISSIBLE]], factor) if known else 0.0
        low = least_on_nodes(samples[row], space.bernstein, 1e-2 * NEGLIGIBLE_PART * force * force)
        # s² − |A⁻¹λ|² ≈ 2 s (s − |A⁻¹λ|): divided by s below, it is a force.
        unsure = ROUNDING * mag[plane[ADMISSIBLE_SIZE]]
        unsure += direction_uncertainty(rows, space, mode, c, tally) * force * force
        if force > 0.0 and space.leaving[c] == ON_ITS_OWN:
            law[c, EXCESS] = most(law[c, EXCESS], (loose - low - unsure) / force)
        for i in range(len(block)):
            moves = deviation_bound(discs[plane[AHEAD + i]], factor) if known else 0.0
            creep = largest_of(samples[samples_of(rows, block[i]) + 1]) + moves - rounding
            law[c, CREEP] = most(law[c, CREEP], creep)
        return
    along = 0.0
    across = 0.0
    unit = 0.0
    for j in range(len(block) if known else 0):
        along += product_deviation(W, discs, aim + j, plane[AHEAD + j], factor)
        unit += product_deviation(W, discs, aim + j, aim + j, factor)
        for i in range(j):
            across += product_deviation(W, discs, aim + i, plane[AHEAD + j], factor)
            across += product_deviation(W, discs, aim + j, plane[AHEAD + i], factor)
    # The slip has the direction of the friction if n·Au ≥ 0 and n × Au = 0.
    low = least_on_nodes(samples[row], space.bernstein, rounding)
    law[c, BACKWARDS] = most(law[c, BACKWARDS], along - rounding - low)
    for j in range(len(block)):
        for i in range(j):
            turned = largest_of(samples[samples_of(rows, block[j]) + 1 + i]) + across - rounding
            law[c, BACKWARDS] = most(law[c, BACKWARDS], turned)
    unsure = ROUNDING + direction_uncertainty(rows, space, mode, c, tally)
    longer = law[c, LARGEST_FORCE] * (largest_of(samples[row + 2]) + unit - unsure)
    law[c, OFF_THRESHOLD] = most(law[c, OFF_THRESHOLD], longer)
    if is_rate_independent(rows, c):
        off = largest_of(samples[samples_of(rows, block[1])])
        off -= ROUNDING * (force_terms(rows, mag, c) + force_terms(rows, mag, block[1]))
        if known and law[c, LARGEST_FORCE] > 0.0:
            off += deviation_bound(discs[plane[ADMISSIBLE]], factor) / law[c, LARGEST_FORCE]
        law[c, OFF_THRESHOLD] = most(law[c, OFF_THRESHOLD], off)


@compiled()
def share_sizes(rows: Rows, state: Array) -> None:
    """Assign one common size to the coordinates that a contact in a plane moves, and one to their
    velocities, and the same for the modes of a structure: they are components of vectors, whose
    choice of axes is arbitrary. No size is smaller than a tiny fraction of the largest position, or
    velocity.

    Parameters
    ----------
    state : array, shape (4, n)
        As in :class:`Tally`; what forces make is as large as the largest then.
    """
    nq = rows.sizes[INERTIAL]
    for first in (0, nq):
        largest = 0.0
        for r in range(first, first + nq):
            largest = max(largest, state[LARGEST, r])
        for r in range(first, first + nq):
            state[SWAY, r] = max(state[SWAY, r], FAINT * largest / REST_PART)
    for b in range(len(rows.bodies)):
        for first in (0, rows.sizes[INERTIAL]):
            begin = first + rows.bodies[b, 0]
            largest = 0.0
            for r in range(begin, begin + rows.bodies[b, 1]):
                largest = max(largest, state[LARGEST, r], REST_PART * state[SWAY, r])
            for r in range(begin, begin + rows.bodies[b, 1]):
                state[SWAY, r] = max(state[SWAY, r], largest / REST_PART)
    for p in rows.massive_planes:
        for first in (0, rows.sizes[INERTIAL]):
            largest = 0.0
            for turn in range(2):
                # The third component is an angular velocity and is not compared with velocities.
                block = directions_of(rows, rows.planes[p, LEAD])
                for c in (block[0], block[1]):
                    part = rows.parts[rows.homes[c, PART]]
                    for j in range(part[COORDINATES]):
                        r = first + rows.members[part[MEMBERS] + j]
                        if turn == 0:
                            largest = max(largest, state[LARGEST, r], REST_PART * state[SWAY, r])
                        else:
                            state[SWAY, r] = max(state[SWAY, r], largest / REST_PART)
