"""Sums and maxima of an audit: work, gaps and violations, and the sizes to which they are relative.

No size vanishes where something sticks: a velocity is measured against the one that the forces
alone would make.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import Matrix, Vector
from stickslip.motion.affine.nodes import most
from stickslip.motion.audit.observers import Sums, make_sums
from stickslip.motion.steps.arrays import DIMENSION, ON_INERTIAL, Rows, Space
from stickslip.motion.steps.contacts import own_inverse
from stickslip.motion.steps.sets import force_terms, is_rate_independent, rate_terms
from stickslip.motion.steps.starting import is_prescribed
from stickslip.translator import compiled

NEGLIGIBLE_PART = 1e-10  # relative size of a quantity between the nodes that is negligible
# size of the velocity of a sticking contact, as a fraction of the one that the forces would cause
REST_PART = 1e-4
CANCELLED_PART = 1e-5  # size of a sum relative to its terms, if they cancel
# Rows of Tally.state, columns of Tally.law and of Tally.kinks, and slots of Tally.total.
LARGEST, SWAY, DEFECT, ROUNDED = range(4)
(
    EXCESS,
    OFF_THRESHOLD,
    CREEP,
    BACKWARDS,
    LARGEST_FORCE,
    LARGEST_SPEED,
    SPEED_HELD,
    OVERLAP,
    OPENING,
) = range(9)
_LAW = 9  # number of these columns
BEYOND, REACHED = range(2)
FED_IN_ALL, ROUNDING_ERRORS, UNVERIFIED = range(3)
# Columns of Steps.work: dissipated and supplied energy.
SPENT, FED = range(2)
# Slots of the residuals of a motion.
ENERGY_BALANCE, FRICTION_LAW, EQUATIONS, OWN_ROUNDING = range(4)


class Tally(NamedTuple):
    """Sums and maxima of an audit, for each motion.

    Attributes
    ----------
    state : array, shape (4, n)
        LARGEST modulus of each component; by how much the terms of its rate would change it within
        a piece (SWAY); largest DEFECT of a Taylor step; largest rounding error of one (ROUNDED).
    law : array, shape (contacts, 9)
        Largest |λ| − s, or s − |λ| where rest ends too early (EXCESS); |λ + σs| of what slides
        without mass (OFF_THRESHOLD); |u| in stick (CREEP); −σu in slip (BACKWARDS); largest
        force (LARGEST_FORCE), relative velocity (LARGEST_SPEED), and velocity that the forces in
        stick would make (SPEED_HELD); of what can open the largest −g while open, or |g| while
        closed (OVERLAP), and the largest gap, or term of it (OPENING).
    kinks : array, shape (kinks, 2)
        Largest −guard (BEYOND) and |guard| (REACHED).
    total : array, shape (3,)
        Supplied energy in modulus (FED_IN_ALL); rounding errors of the states, summed up
        (ROUNDING_ERRORS); time that is not verified (UNVERIFIED).
    """

    state: Matrix
    law: Matrix
    kinks: Matrix
    total: Vector


def make_tally(rows: Rows) -> Tally:
    """Nothing added up yet."""
    n = int(rows.sizes[DIMENSION])
    contacts = len(rows.u)
    kinks = len(rows.kinks)
    return Tally(np.zeros((4, n)), np.zeros((contacts, _LAW)), np.zeros((kinks, 2)), np.zeros(3))


class Steps(NamedTuple):
    """Results of an audit for each step.

    Attributes
    ----------
    work : array, shape (steps, 2)
        Dissipated and supplied energy (SPENT, FED).
    gap : array, shape (steps, n)
        Bound of how far the end of a Taylor step in it is from what the equations make of its
        beginning; used up.
    noise : array, shape (steps, n)
        Rounding errors of that; used up.
    open : array, shape (steps,)
        Time that could not be enclosed.
    """

    work: Matrix
    gap: Matrix
    noise: Matrix
    open: Vector


def make_steps(count: int, n: int) -> Steps:
    """Allocate arrays for a number of steps."""
    return Steps(np.zeros((count, 2)), np.zeros((count, n)), np.zeros((count, n)), np.zeros(count))


class Accounts(NamedTuple):
    """Arrays that receive the results of an audit, for each step and in total."""

    steps: Steps
    tally: Tally
    sums: Sums


def make_accounts(count: int, rows: Rows) -> Accounts:
    """Allocate accounts for a number of steps."""
    n = int(rows.sizes[DIMENSION])
    return Accounts(make_steps(count, n), make_tally(rows), make_sums((), n, len(rows.u)))


@compiled()
def count_gaps(i: int, steps: Steps, tally: Tally) -> None:
    """Keep the gap and the rounding errors of a Taylor step, and begin the next with none."""
    for r in range(steps.gap.shape[1]):
        tally.state[DEFECT, r] = most(tally.state[DEFECT, r], steps.gap[i, r])
        tally.state[ROUNDED, r] = most(tally.state[ROUNDED, r], steps.noise[i, r])
        steps.gap[i, r], steps.noise[i, r] = 0.0, 0.0


@compiled()
def samples_of(rows: Rows, c: int) -> int:
    """The first of the three rows of samples that a direction of a contact has."""
    return int(rows.sizes[DIMENSION] + 3 * c)


@compiled()
def free_speed(rows: Rows, space: Space, c: int, h: float) -> float:
    """The speed that forces would give to a sticking contact if it were free.

    Parameters
    ----------
    c : int
        The contact.
    h : float
        How long a series would last.
    """
    mag = space.mag
    if is_rate_independent(rows, c):
        return float(mag[c])
    if is_prescribed(rows, c):
        return rate_terms(rows, mag, c) * h
    free = force_terms(rows, mag, c) / abs(own_inverse(rows, space, c))
    return float(free * h if c < rows.sizes[ON_INERTIAL] else free)
