"""The end of a step: the state reached by its pieces, and the jump or impact that ends it."""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.affine.nodes import most
from stickslip.motion.algebra.roots import rate_on
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.audit.accounts import (
    CREEP,
    FED,
    FED_IN_ALL,
    LARGEST,
    LARGEST_SPEED,
    SPEED_HELD,
    SPENT,
    SWAY,
    UNVERIFIED,
    Accounts,
    Steps,
    Tally,
    count_gaps,
)
from stickslip.motion.audit.impulses import (
    BROKEN,
    CONTACT_TERMS,
    FASTEST,
    RATE_TERMS,
    RATES_LEFT,
    explain_in_turn,
    explain_jump,
)
from stickslip.motion.engine.jumps import fired_jump, make_jump
from stickslip.motion.modes.guards import may_collide
from stickslip.motion.steps.arrays import (
    DIMENSION,
    INERTIAL,
    KINK,
    NOWHERE,
    ON_INERTIAL,
    ON_VISCOUS,
    RATE_INDEPENDENT,
    STORED,
    VISCOUS,
    Flow,
    Instant,
    Machine,
    Record,
    Rows,
)
from stickslip.motion.steps.sets import force_terms
from stickslip.motion.steps.starting import coefficients
from stickslip.numerics.levels import EPSILON, ROUNDING
from stickslip.translator import compiled


@compiled()
def audit_start(
    machine: Machine, flow: Flow, starts: Record, ends: Record, i: int, accounts: Accounts
) -> None:
    """Measure an impact, or a jump, without a step before it: at the start, or where another jump
    has been.

    Parameters
    ----------
    starts, ends, accounts
        As in :func:`.audit_steps`.
    i : int
        The step, which has no length.
    """
    space = flow.space
    nc = len(flow.rows.u)
    mode = space.touched[:nc]
    reg = space.touched[nc:]
    copy(starts.mode[i], mode)
    copy(starts.region[i], reg)
    copy(starts.state[i], space.trial)
    steps, tally = accounts.steps, accounts.tally
    after = Instant(ends.time[i], ends.state[i], mode, reg)
    jump_or_collide(machine, flow, after, 0.0, ends, i, accounts)
    for r in range(len(space.trial)):
        steps.gap[i, r] += abs(ends.state[i, r] - space.trial[r])
        tally.state[LARGEST, r] = most(tally.state[LARGEST, r], abs(starts.state[i, r]))
    count_gaps(i, steps, tally)


@compiled()
def jump_after(rows: Rows, cause: int, reg: Array) -> int:
    """The jump that ends a step in some regions; −1: none."""
    if len(rows.jumps) == 0 or cause < 0 or cause >= len(reg):
        return NOWHERE
    return fired_jump(rows, cause, 1 - reg[cause])


@compiled()
def jump_or_collide(
    machine: Machine,
    flow: Flow,
    at: Instant,
    h: float,
    ends: Record,
    i: int,
    accounts: Accounts,
) -> None:
    """Measure the jump, or the impact, that ends a step, if one does.

    Parameters
    ----------
    at : Instant
        After it, with the mode and the regions of the step.
    h : float
        Length of the last piece.
    ends : Record
        As in :func:`.audit_steps`.
    i : int
        The step.
    accounts : Accounts
        Is added to.
    """
    cause = ends.cause[i]
    jump = jump_after(flow.rows, cause, at.reg)
    if jump >= 0:
        close_jump(machine, flow, at, ends.region[i], jump, i, accounts)
    elif may_collide(flow.rows, cause):
        close_impact(machine, flow, at, h, cause - len(flow.rows.kinks), i, accounts)


@compiled()
def close_jump(
    machine: Machine,
    flow: Flow,
    at: Instant,
    next_reg: Array,
    jump: int,
    i: int,
    accounts: Accounts,
) -> None:
    """Apply the jump of the state at the end of a step, and account for its energy; the step then
    ends there.

    Parameters
    ----------
    flow : Flow
        Its work space has the state at which the step arrives, and receives the one after it.
    at : Instant
        After the jump, with the mode and the regions of the step; these become the next ones, but
        for kinks of time.
    next_reg : array of int, shape (kinks,)
        Regions that begin there.
    jump, i : int
        The jump, and the step.
    accounts : Accounts
        Is added to.
    """
    rows = flow.rows
    steps = accounts.steps
    arrived = Instant(at.t, flow.space.trial, at.mode, at.reg)
    before = energy_in(machine, flow, arrived)
    kink = rows.jumps[jump, KINK]
    at.reg[kink] = 1 - at.reg[kink]
    if not make_jump(machine, flow, arrived, jump, flow.space.trial):
        steps.gap[i, 0] = np.inf
    at.reg[kink] = 1 - at.reg[kink]
    for j in range(len(rows.kinks)):
        if rows.timed[j] == 0:
            at.reg[j] = next_reg[j]
    gained = energy_in(machine, flow, arrived) - before
    steps.work[i, SPENT] += max(-gained, 0.0)
    steps.work[i, FED] += max(gained, 0.0)
    accounts.tally.total[FED_IN_ALL] += max(gained, 0.0)


@compiled()
def close_impact(
    machine: Machine, flow: Flow, at: Instant, h: float, cause: int, i: int, accounts: Accounts
) -> None:
    """Measure the jump of the velocities at the end of a step against the law of impacts, and count
    the energy that it loses; then the step is taken to end with that jump.

    Parameters
    ----------
    flow : Flow
        Its work space has the state at which the step arrives.
    at : Instant
        After the impact, with the mode of the step.
    h : float
        Length of the last piece.
    cause : int
        The contact that has closed.
    i : int
        The step.
    accounts : Accounts
        Is added to.
    """
    rows, space = flow.rows, flow.space
    nq = rows.sizes[INERTIAL]
    steps, tally = accounts.steps, accounts.tally
    arrived = Instant(at.t, space.trial, at.mode, at.reg)
    lost = energy_in(machine, flow, arrived)
    for c in range(len(at.mode)):
        space.labels[c, 0] = at.mode[c]
    found = space.explained
    for c in range(rows.sizes[ON_INERTIAL]):
        found[FASTEST, c] = tally.law[c, LARGEST_SPEED]
    if rows.in_turn == 1:
        explain_in_turn(machine, flow, arrived, at.y, h, cause)
    else:
        explain_jump(machine, flow, arrived, at.y, h, cause)
    for c in range(len(at.mode)):
        at.mode[c] = space.labels[c, 0]
    for c in range(rows.sizes[ON_INERTIAL]):
        tally.law[c, CREEP] = most(tally.law[c, CREEP], found[BROKEN, c])
        tally.law[c, SPEED_HELD] = most(tally.law[c, SPEED_HELD], found[CONTACT_TERMS, c])
    for q in range(nq):
        # The part of a jump that the law does not explain remains as a gap of the step.
        space.trial[nq + q] = at.y[nq + q]
        steps.gap[i, nq + q] += found[RATES_LEFT, q]
        tally.state[SWAY, nq + q] = most(tally.state[SWAY, nq + q], found[RATE_TERMS, q])
        tally.state[SWAY, q] = most(tally.state[SWAY, q], h * found[RATE_TERMS, q])
    lost -= energy_in(machine, flow, arrived)
    steps.work[i, SPENT] += lost


@compiled()
def count_jumps(
    machine: Machine,
    flow: Flow,
    at: Instant,
    next_reg: Array,
    i: int,
    steps: Steps,
    tally: Tally,
) -> None:
    """Count the change of energy at a jump of a time-dependent load as supplied energy.

    Parameters
    ----------
    at : Instant
        End of the step; its regions become the next ones where a load jumps.
    next_reg : array of int, shape (kinks,)
        Regions that begin there.
    i : int
        The step.
    tally : Tally
        Both are added to.
    """
    rows = flow.rows
    for j in range(len(rows.timed)):
        if rows.timed[j] == 1 and next_reg[j] != at.reg[j]:
            before = energy_in(machine, flow, at)
            at.reg[j] = next_reg[j]
            jump = energy_in(machine, flow, at) - before
            steps.work[i, FED] += jump
            tally.total[FED_IN_ALL] += abs(jump)


@compiled()
def energy_in(machine: Machine, flow: Flow, at: Instant) -> float:
    """Energy of a state in given regions."""
    space = flow.space
    coefficients(machine, flow, at, 1, space.V)
    machine.powers(space.V, at.reg, flow.k.K, space.powers)
    return float(space.powers[STORED])


@compiled()
def close_step(
    flow: Flow,
    at: Instant,
    N: int,
    h: float,
    first: Array,
    i: int,
    steps: Steps,
    tally: Tally,
) -> None:
    """Compare the end of a step with where its pieces have arrived (the last is still in the work
    space).

    A time is a rounded number: an end that the motion passes within half a digit of it is right.

    Parameters
    ----------
    at : Instant
        End of the step, with the mode of the step.
    N : int
        Order of the polynomials.
    h : float
        Length of the last piece.
    first : array, shape (n,)
        State at the beginning of the step.
    i : int
        The step.
    tally : Tally
        Both are added to.
    """
    sizes = flow.rows.sizes
    space = flow.space
    mode = at.mode
    end = at.y
    nq = sizes[INERTIAL]
    nz = sizes[VISCOUS]
    nr = sizes[RATE_INDEPENDENT]
    W = space.W
    unit = W[sizes[DIMENSION], 1]
    late = 0.5 * EPSILON * abs(at.t)
    for r in range(len(first)):
        off = abs(end[r] - space.trial[r]) - late * abs(rate_on(W[r], N, h / unit)) / unit
        if 2 * nq + nz <= r < 2 * nq + nz + nr:
            # A contact that slides without viscosity is projected onto λ + σ s = 0, where forces
            # are known only up to rounding errors; near a fold, where its stiffness vanishes, the
            # projection moves it. The friction law is checked with the forces themselves.
            for j in range(nr):
                c = sizes[ON_INERTIAL] + sizes[ON_VISCOUS] + j
                if mode[c] != 0:
                    terms = force_terms(flow.rows, space.mag, c)
                    off -= ROUNDING * abs(space.B[r - 2 * nq - nz, j]) * terms
        steps.gap[i, r] += max(off, 0.0) if off == off else np.inf
        ends = most(most(tally.state[LARGEST, r], abs(first[r])), abs(end[r]))
        tally.state[LARGEST, r] = ends
    count_gaps(i, steps, tally)
    tally.total[UNVERIFIED] += steps.open[i]
