"""The law on a piece of a step: thresholds, directions of slip, gaps and kinks.

Guards are evaluated at the Gauss nodes, and bounded between them (:mod:`.between_nodes`). Contacts
in a plane have a module of their own (:mod:`.contact_planes`).
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.admissible.sharing import ON_ITS_OWN
from stickslip.motion.affine.nodes import largest_of, least_on_nodes, most
from stickslip.motion.audit.accounts import (
    BACKWARDS,
    BEYOND,
    CANCELLED_PART,
    CREEP,
    EXCESS,
    LARGEST_FORCE,
    LARGEST_SPEED,
    NEGLIGIBLE_PART,
    OFF_THRESHOLD,
    OPENING,
    OVERLAP,
    REACHED,
    REST_PART,
    SPEED_HELD,
    Tally,
    free_speed,
    samples_of,
)
from stickslip.motion.audit.between_nodes import StepPiece, deviation_bound
from stickslip.motion.audit.contact_planes import direction_uncertainty, judge_plane, sample_plane
from stickslip.motion.modes.guards import resting
from stickslip.motion.steps.arrays import DIMENSION, ON_INERTIAL, WIDEST, Rows, Space
from stickslip.motion.steps.contacts import (
    ALONG_LINES,
    IN_PLANES,
    LOOSE,
    directions_of,
    rubbing,
)
from stickslip.motion.steps.sets import (
    force_terms,
    gap_size,
    gap_terms,
    is_rate_independent,
    kink_terms,
    rate_terms,
)
from stickslip.numerics.levels import EPSILON, ROUNDING
from stickslip.translator import compiled

_LATE = 4.0 * EPSILON  # relative error of the time of a kink or an event


@compiled()
def sample_law(
    rows: Rows, space: Space, mode: Array, reg: Array, h: float, g: int, tally: Tally
) -> None:
    """Store the values of all guards at a node, and the sizes of their terms.

    A contact has three rows: what must be nonnegative (two of them in stick), and what must vanish.

    Parameters
    ----------
    space : Space
        With the values of the rows at the node, and the contacts that have friction; receives the
        values of the guards.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    h : float
        How long a series would last, in which forces make a velocity.
    g : int
        The node.
    tally : Tally
        Receives the sizes.
    """
    mq = rows.sizes[ON_INERTIAL]
    V = space.V
    mag = space.mag
    samples = space.samples
    law = tally.law
    for c in rows.openings:
        sample_opening(rows, space, mode, h, g, c, tally)
    for c in rubbing(space, LOOSE):
        # It has no force, but its speed counts for the size of velocities.
        for i in directions_of(rows, c):
            law[i, LARGEST_SPEED] = most(law[i, LARGEST_SPEED], abs(V[rows.u[i], 0]))
    for c in rubbing(space, IN_PLANES):
        sample_plane(rows, space, mode, h, g, c, tally)
    for c in rubbing(space, ALONG_LINES):
        note_sizes(rows, space, c, tally)
        u = V[rows.u[c], 0]
        held = V[rows.force[c], 0]
        up = V[rows.plus[c], 0]
        down = V[rows.minus[c], 0]
        row = samples_of(rows, c)
        made = rate_terms(rows, mag, c) * h
        if resting(mode[c]):
            samples[row, g] = held + up
            samples[row + 1, g] = down - held
            samples[row + 2, g] = u
        if mode[c] == 0:
            law[c, SPEED_HELD] = most(law[c, SPEED_HELD], free_speed(rows, space, c, h))
        else:
            law[c, SPEED_HELD] = most(law[c, SPEED_HELD], made if c < mq else mag[c])
        if abs(mode[c]) == 1:
            samples[row, g] = mode[c] * u
            samples[row + 2, g] = held + (up if mode[c] > 0 else -down)
    for j in range(len(rows.kinks)):
        value = V[rows.kinks[j], 0] if reg[j] == 1 else -V[rows.kinks[j], 0]
        samples[samples_of(rows, len(rows.u)) + j, g] = value
        size = max(abs(value), CANCELLED_PART * kink_terms(rows, space.mag, j))
        tally.kinks[j, REACHED] = most(tally.kinks[j, REACHED], size)


@compiled()
def note_sizes(rows: Rows, space: Space, c: int, tally: Tally) -> None:
    """Store the sizes of the force and the velocity of a contact along a line."""
    law, mag, V = tally.law, space.mag, space.V
    held = abs(V[rows.force[c], 0])
    # If thresholds vanish, a force is known only up to the rounding errors of its terms.
    law[c, LARGEST_FORCE] = most(
        most(law[c, LARGEST_FORCE], max(held, max(V[rows.plus[c], 0], V[rows.minus[c], 0]))),
        CANCELLED_PART * force_terms(rows, mag, c),
    )
    speed = abs(V[rows.u[c], 0])
    law[c, LARGEST_SPEED] = most(most(law[c, LARGEST_SPEED], speed), CANCELLED_PART * mag[c])


@compiled()
def sample_opening(
    rows: Rows, space: Space, mode: Array, h: float, g: int, c: int, tally: Tally
) -> None:
    """Store the normal force or the gap of a contact that can open, the gap, and the velocity, at a
    node.

    Parameters
    ----------
    rows, space, mode, h, g, tally
        As in :func:`sample_law`.
    c : int
        The contact.
    """
    law, mag, V, samples = tally.law, space.mag, space.V, space.samples
    note_sizes(rows, space, c, tally)
    gap = V[rows.gaps[c], 0]
    row = samples_of(rows, c)
    made = rate_terms(rows, mag, c) * h
    # A closed gap has no size except the displacement that the forces would cause.
    size = max(abs(gap), gap_terms(rows, mag, c))
    size = max(size, REST_PART * h * h * rate_terms(rows, mag, c))
    law[c, OPENING] = most(law[c, OPENING], size)
    law[c, SPEED_HELD] = most(law[c, SPEED_HELD], made)
    space.impact[WIDEST, c] = law[c, OPENING]
    samples[row, g] = V[rows.force[c], 0] if mode[c] == 0 else gap
    samples[row + 1, g] = gap
    samples[row + 2, g] = V[rows.u[c], 0]


@compiled()
def steepness(c: Array, N: int, x: float) -> float:
    """Bound of the derivative of Σ c[k] τᵏ, k < N, for 0 ≤ τ ≤ x."""
    total = 0.0
    for k in range(N - 1, 0, -1):
        total = total * x + k * abs(c[k])
    return total


@compiled()
def judge_law(rows: Rows, space: Space, mode: Array, piece: StepPiece, tally: Tally) -> None:
    """Violations of guards on a piece, at the nodes and between them.

    What a force or a velocity does within a rounding error of the time is none of theirs.

    Parameters
    ----------
    space : Space
        With the guards at the nodes, and the discs.
    mode : array of int, shape (contacts,)
    tally : Tally
        Receives the largest.
    """
    mag = space.mag
    discs = space.discs
    samples = space.samples
    law = tally.law
    factor = piece.factor
    unit = space.W[rows.sizes[DIMENSION], 1]
    # Times of knots are rounded: changes of a quantity within that rounding are not violations.
    late = _LATE * abs(piece.t) / unit
    for c in rows.openings:
        judge_opening(rows, space, mode, c, factor, tally)
    for c in rubbing(space, IN_PLANES):
        judge_plane(rows, space, mode, c, factor, tally)
    for c in rubbing(space, ALONG_LINES):
        row = samples_of(rows, c)
        loose = 0.0
        tight = 0.0
        up, down = (
            steepness(space.W[rows.plus[c]], piece.order, piece.h / unit),
            steepness(space.W[rows.minus[c]], piece.order, piece.h / unit),
        )
        rounding = piece.rounding * mag[c] + late * steepness(
            space.W[rows.u[c]], piece.order, piece.h / unit
        )
        unsure = piece.rounding * force_terms(rows, mag, c)
        unsure += direction_uncertainty(rows, space, mode, c, tally) * law[c, LARGEST_FORCE]
        unsure += late * (
            steepness(space.W[rows.force[c]], piece.order, piece.h / unit) + max(up, down)
        )
        if factor < np.inf:
            loose = deviation_bound(discs[rows.force[c]], factor)
            loose += max(
                deviation_bound(discs[rows.plus[c]], factor),
                deviation_bound(discs[rows.minus[c]], factor),
            )
            tight = deviation_bound(discs[rows.u[c]], factor)
        if resting(mode[c]):
            for part in range(2 if space.leaving[c] == ON_ITS_OWN or mode[c] != 0 else 0):
                low = least_on_nodes(
                    samples[row + part],
                    space.bernstein,
                    1e-2 * NEGLIGIBLE_PART * law[c, LARGEST_FORCE],
                )
                law[c, EXCESS] = most(law[c, EXCESS], loose - low - unsure)
            law[c, CREEP] = most(law[c, CREEP], largest_of(samples[row + 2]) + tight - rounding)
        else:
            law[c, BACKWARDS] = most(
                law[c, BACKWARDS],
                tight - rounding - least_on_nodes(samples[row], space.bernstein, rounding),
            )
            if is_rate_independent(rows, c):
                law[c, OFF_THRESHOLD] = most(
                    law[c, OFF_THRESHOLD], largest_of(samples[row + 2]) + loose - unsure
                )
    for j in range(len(rows.kinks)):
        between = deviation_bound(discs[rows.kinks[j]], factor) if factor < np.inf else 0.0
        negligible = 1e-2 * NEGLIGIBLE_PART * tally.kinks[j, REACHED]
        low = least_on_nodes(
            samples[samples_of(rows, len(rows.u)) + j], space.bernstein, negligible
        )
        unsure = piece.rounding * kink_terms(rows, mag, j)
        tally.kinks[j, BEYOND] = most(tally.kinks[j, BEYOND], between - low - unsure)


@compiled()
def judge_opening(
    rows: Rows, space: Space, mode: Array, c: int, factor: float, tally: Tally
) -> None:
    """Violations of g ≥ 0, or of N ≥ 0 and g = 0, on a piece.

    Parameters
    ----------
    space : Space
        With normal forces and gaps at the nodes, and the discs.
    mode : array of int, shape (contacts,)
    c : int
        The contact.
    factor : float
        As in :class:`.StepPiece`.
    tally : Tally
        Receives the largest.
    """
    law = tally.law
    row = samples_of(rows, c)
    known = factor < np.inf
    apart = deviation_bound(space.discs[rows.gaps[c]], factor) if known else 0.0
    apart -= ROUNDING * gap_size(rows, space, c)
    if mode[c] != 0:
        low = least_on_nodes(
            space.samples[row], space.bernstein, 1e-2 * NEGLIGIBLE_PART * law[c, OPENING]
        )
        law[c, OVERLAP] = most(law[c, OVERLAP], apart - low)
        if abs(mode[c]) == 2:  # carried, it touches
            law[c, OVERLAP] = most(law[c, OVERLAP], largest_of(space.samples[row]) + apart)
        return
    loose = deviation_bound(space.discs[rows.force[c]], factor) if known else 0.0
    low = least_on_nodes(
        space.samples[row], space.bernstein, 1e-2 * NEGLIGIBLE_PART * law[c, LARGEST_FORCE]
    )
    unsure = ROUNDING * force_terms(rows, space.mag, c)
    unsure += direction_uncertainty(rows, space, mode, c, tally) * law[c, LARGEST_FORCE]
    law[c, EXCESS] = most(law[c, EXCESS], loose - low - unsure)
    law[c, OVERLAP] = most(law[c, OVERLAP], largest_of(space.samples[row + 1]) + apart)
