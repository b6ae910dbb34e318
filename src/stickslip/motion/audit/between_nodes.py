"""Bounds of the residual and the guards between the nodes of a piece.

On a disc around the beginning of a piece [0, h] the residual r = p′ − f(p) and every guard differ
from their first values by at most B (:mod:`stickslip.motion.discs`). A function that is
analytic and bounded by B inside the ellipse with foci 0 and h and sum of half axes ρh/2 differs
from its interpolant at n nodes by at most

    2 (1 + Λ) B ρ^(1 − n)/(ρ − 1)

(L. N. Trefethen, *Approximation Theory and Approximation Practice*, theorem 8.2; Λ is the Lebesgue
constant of the nodes). A pulse, however narrow, makes B large.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.affine.nodes import LEBESGUE, NARROW, WIDE
from stickslip.motion.audit.accounts import (
    CANCELLED_PART,
    LARGEST,
    LARGEST_FORCE,
    LARGEST_SPEED,
    NEGLIGIBLE_PART,
    OPENING,
    REACHED,
    REST_PART,
    Tally,
)
from stickslip.motion.discs.spreading import spread, spread_state
from stickslip.motion.discs.tables import BALL, OFF, SLOPE
from stickslip.motion.steps.arrays import (
    ADMISSIBLE,
    AIM,
    DIMENSION,
    INERTIAL,
    ON_INERTIAL,
    Flow,
    Rows,
    Space,
    tape_of,
)
from stickslip.motion.steps.contacts import (
    IN_PLANES,
    directions_of,
    is_loose,
    own_inverse,
    rubbing,
)
from stickslip.motion.steps.directions import spread_given
from stickslip.motion.steps.sets import force_terms, gap_terms, kink_terms, plane_of, rate_terms
from stickslip.motion.steps.step_size import LEAST_SIZE, fill_powers, impulse
from stickslip.translator import RELAXED, compiled


class StepPiece(NamedTuple):
    """A part of a step, on which the motion is followed by polynomials.

    Attributes
    ----------
    order : int
        Of the polynomials.
    t, h : float
        Its beginning and its length.
    acting : float
        How long a series would last; see :func:`counts_for`.
    factor : float
        From the discs of rows to what these may do between the nodes; infinite if that could not be
        made small.
    rounding : float
        Rounding errors by which forces and velocities may be off, in parts of their terms: those
        of the state add up, at random, from piece to piece.
    """

    order: int
    t: float
    h: float
    acting: float
    factor: float
    rounding: float


@compiled()
def enclose(
    flow: Flow, mode: Array, reg: Array, N: int, h: float, acting: float, tally: Tally
) -> float:
    """Bound the residual and all guards on a piece.

    Parameters
    ----------
    acting : float
        How long a series would last; see :func:`counts_for`.

    Returns
    -------
    float
        Factor from discs to what may be between the nodes, or infinity.

    Notes
    -----
    The discs of all rows are left in the work space.
    """
    rows = flow.rows
    space = flow.space
    tape = tape_of(flow, N)
    n = rows.sizes[DIMENSION]
    powers = space.reaches
    unit = space.W[n, 1]
    fill_powers(space.powers, h / unit)
    for turn in range(2):
        radius, factor = (4.0 * h, WIDE) if turn == 0 else (2.0 * h, NARROW)
        fill_powers(powers, radius / unit)
        space.discs[n, BALL] = radius
        space.discs[n, OFF] = 0.0
        spread_state(space.W, N, powers, rows.watched[:n], space.discs)
        spread_given(flow, mode, N)
        spread(tape, mode, reg, 0, len(rows.program.code))
        for r in range(n):
            space.discs[r, SLOPE] = slope_range(space.W[r], N, powers) / unit
        if encloses(rows, space, mode, N, h, acting, factor, tally):
            return factor
    return np.inf


@compiled(relaxed=RELAXED)
def slope_range(c: Array, N: int, powers: Array) -> float:
    """Deviation of the derivative of a polynomial from its first value on a disc."""
    total = 0.0
    for k in range(2, N + 1):
        total += k * abs(c[k]) * powers[k - 1]
    return total


@compiled()
def deviation_bound(disc: Array, factor: float) -> float:
    """Bound of the deviation of a row between the nodes."""
    return factor * disc[BALL] + 2.0 * (1.0 + LEBESGUE) * disc[OFF]


@compiled()
def residual_deviation(rows: Rows, discs: Array, r: int, factor: float) -> float:
    """Bound of the residual of a part of the state between the nodes."""
    return deviation_bound(discs[rows.program.rates[r]], factor) + factor * discs[r, SLOPE]


@compiled()
def extent(c: Array, N: int, powers: Array) -> float:
    """Largest term of a polynomial: its size on a piece, even if it begins with zeros."""
    size = LEAST_SIZE
    for k in range(N + 1):
        size = max(size, abs(c[k]) * powers[k])
    return size


@compiled()
def extent_of_body(
    rows: Rows, W: Array, N: int, powers: Array, tally: Tally, r: int
) -> tuple[float, int]:
    """The largest size of the modes of a structure, or of their rates, if they begin with this row
    of the state; and where they end. Otherwise 0, and the next row.

    Parameters
    ----------
    W : array
        Polynomials of the rows.
    N : int
        Order of these.
    powers : array
        Of the length of the piece.
    tally : Tally
        Sizes so far.
    r : int
        The row.
    """
    for b in range(len(rows.bodies)):
        begin = rows.bodies[b, 0]
        if r == begin or r == rows.sizes[INERTIAL] + begin:
            largest = 0.0
            for i in range(r, r + rows.bodies[b, 1]):
                largest = max(max(largest, extent(W[i], N, powers)), tally.state[LARGEST, i])
            return largest, r + rows.bodies[b, 1]
    return 0.0, r + 1


@compiled()
def counts_for(rows: Rows, mag: Array, r: int, size: float, h: float, acting: float) -> float:
    """Time for which an error of a rate counts in a piece of length h.

    Where a polynomial lasts longer than a series, because something decays, that is as long as a
    series would last, or as the terms of the rate would take to change this part of the state by
    its size: what does not decay counts fully.

    Parameters
    ----------
    mag : array
        Sizes of the terms of what may cancel.
    r : int
        Part of the state.
    size : float
        Its size.
    h, acting : float
        Length of the piece, and how long a series would last.
    """
    place = rows.program.rate_sizes[r]
    if place < 0 or not acting < h or not mag[place] * h > size:
        return h
    return float(max(acting, size / mag[place]))


@compiled()
def encloses(
    rows: Rows,
    space: Space,
    mode: Array,
    N: int,
    h: float,
    acting: float,
    factor: float,
    tally: Tally,
) -> bool:
    """Whether possible deviations between the nodes of a piece are negligible.

    Parameters
    ----------
    space : Space
        With the coefficients, the discs and the powers of the piece.
    mode : array of int, shape (contacts,)
    N : int
        Order of the polynomials.
    h, acting : float
        Length of the piece, and how long a series would last.
    factor : float
        From the discs to what may be between the nodes.
    tally : Tally
        Sizes so far.
    """
    n = rows.sizes[DIMENSION]
    nc = len(rows.u)
    mag = space.mag
    discs = space.discs
    W = space.W
    powers = space.powers
    shared, until = 0.0, 0
    for r in range(n):
        if r >= until:
            shared, until = extent_of_body(rows, W, N, powers, tally, r)
        size = max(max(extent(W[r], N, powers), tally.state[LARGEST, r]), shared)
        time = counts_for(rows, mag, r, size, h, acting)
        size += REST_PART * impulse(rows, mag, r, acting)
        if not time * residual_deviation(rows, discs, r, factor) <= NEGLIGIBLE_PART * size:
            return False
    for c in range(nc):
        speed = max(
            extent(W[rows.u[c]], N, powers),
            CANCELLED_PART * mag[c],
            tally.law[c, LARGEST_SPEED],
        ) + REST_PART * acting * rate_terms(rows, mag, c)
        if c < rows.sizes[ON_INERTIAL] and mode[c] == 0 and own_inverse(rows, space, c) != 0.0:
            # Forces that start from zero cause a velocity, too.
            made = extent(W[rows.force[c]], N - 1, powers) / abs(own_inverse(rows, space, c))
            speed += REST_PART * acting * made
        if not deviation_bound(discs[rows.u[c]], factor) <= NEGLIGIBLE_PART * speed:
            return False
        forces = rows.force[c], rows.plus[c], rows.minus[c]
        held = max(CANCELLED_PART * force_terms(rows, mag, c), tally.law[c, LARGEST_FORCE])
        for row in forces:
            held = max(held, extent(W[row], N - 1, powers))
        # A contact without normal force has no friction, up to rounding errors.
        loose = is_loose(rows, mode, c)
        for row in forces:
            if not loose and not deviation_bound(discs[row], factor) <= NEGLIGIBLE_PART * held:
                return False
    for c in rows.openings:
        row = rows.gaps[c]
        # At an instant all terms of a gap may vanish; for a closed contact they always do.
        size = extent(W[row], N - 1, powers) + h * mag[c]
        size += REST_PART * acting * acting * rate_terms(rows, mag, c)
        size += gap_terms(rows, mag, c)
        if not deviation_bound(discs[row], factor) <= NEGLIGIBLE_PART * max(
            size, tally.law[c, OPENING]
        ):
            return False
    for c in rubbing(space, IN_PLANES):
        plane = plane_of(rows, c)
        held = max(tally.law[c, LARGEST_FORCE], extent(W[rows.plus[c]], N - 1, powers))
        loose = deviation_bound(discs[plane[ADMISSIBLE]], factor)
        turns = 0.0
        for i in range(len(directions_of(rows, c))):
            turns += deviation_bound(discs[plane[AIM] + i], factor)
        if not (loose <= NEGLIGIBLE_PART * held * held and turns <= NEGLIGIBLE_PART):
            return False
    for j in range(len(rows.kinks)):
        row = rows.kinks[j]
        size = max(
            extent(W[row], N - 1, powers),
            CANCELLED_PART * kink_terms(rows, mag, j),
            tally.kinks[j, REACHED],
        )
        if not deviation_bound(discs[row], factor) <= NEGLIGIBLE_PART * size:
            return False
    return True
