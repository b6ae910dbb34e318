"""The audit of a motion: does it obey its law between the knots, too?

A step is followed again from its first state by Taylor polynomials p, which are nothing but
candidates here. The law is evaluated for them at Gauss nodes, where it uses no series, and between
the nodes it is enclosed: on a disc around the beginning of a piece [0, h] the residual r = p′ −
f(p) and every guard differ from their first values by at most B
(:mod:`stickslip.motion.steps.discs`). A function that is analytic and bounded by B inside the
ellipse with foci 0 and h and sum of half axes ρh/2 differs from its interpolant at n nodes by at
most

    2 (1 + Λ) B ρ^(1 − n)/(ρ − 1)

(L. N. Trefethen, *Approximation Theory and Approximation Practice*, theorem 8.2; Λ is the Lebesgue
constant of the nodes). Nothing is hidden between them: a pulse, however narrow, makes B large.
Pieces are halved until what may be between the nodes is negligible; where that does not succeed,
the time is noted as not verified. Stiff motion is followed by polynomials that last longer than
series (:mod:`stickslip.motion.steps.stiff`); what the law says of them is asked in the same way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.motion.admissible.cones import FORCE_SIZE, RESTS
from stickslip.motion.admissible.leaving import lacking_part, spare_part
from stickslip.motion.admissible.sharing import (
    ON_ITS_OWN,
    any_share,
    axis_of,
    find_shared,
    held_at,
    is_first,
    press_themselves,
    radius_at,
)
from stickslip.motion.between.forces import HOLDS, RUBS, TOUCHES, try_other_forces, widest_room
from stickslip.motion.between.impulses import (
    BROKEN,
    CONTACT_TERMS,
    FASTEST,
    RATE_TERMS,
    RATES_LEFT,
    explain_in_turn,
    explain_jump,
)
from stickslip.motion.between.nodes import (
    COUNT,
    GAUSS_NODES,
    GAUSS_WEIGHTS,
    LEBESGUE,
    NARROW,
    WIDE,
    largest_of,
    least_on_nodes,
    most,
    to_control_points,
)
from stickslip.motion.between.observers import Sums, add_step, count_times, make_sums
from stickslip.motion.engine.guards import (
    resting,
)
from stickslip.motion.engine.modes import copy, resolve
from stickslip.motion.steps.arrays import (
    ADMISSIBLE,
    ADMISSIBLE_SIZE,
    AHEAD,
    AIM,
    ASIDE,
    COMPONENT,
    CONTACTS,
    COORDINATES,
    DIMENSION,
    DISSIPATED,
    EPSILON,
    FEWEST_ORDERS,
    INERTIAL,
    KINK,
    MASSIVE,
    MATRIX,
    MEMBERS,
    NOWHERE,
    OK,
    ON_INERTIAL,
    ON_VISCOUS,
    OTHER,
    PART,
    PRESSING,
    RATE_INDEPENDENT,
    ROUNDING,
    RUBBING,
    STATIC,
    STORED,
    SUPPLIED,
    VISCOUS,
    WIDEST,
    Flow,
    Instant,
    Machine,
    Record,
    Rows,
    Space,
    direction_entry,
    gap_size,
    is_component,
    is_loose,
    is_stopped,
    opens,
    own_inverse,
    plain_coefficients,
    set_mode,
)
from stickslip.motion.steps.discs import (
    BALL,
    OFF,
    SLOPE,
    give_directions,
    spread,
    spread_given,
    spread_state,
    take_directions,
    tape_of,
)
from stickslip.motion.steps.jumps import fired_jump, make_jump
from stickslip.motion.steps.roots import horner
from stickslip.motion.steps.starting import coefficients, is_prescribed
from stickslip.motion.steps.step_size import LEAST_SIZE, fill_powers, impulse
from stickslip.motion.steps.stiff import ends_there, follow_mode
from stickslip.translator import RELAXED, compiled

_NEGLIGIBLE = 1e-10  # part of its size that a quantity may have between the nodes
_MOST_PIECES = 512  # of a step
# part of the velocity that forces would give to what sticks, against which it is measured
_REST = 1e-4
_LATE = 4.0 * EPSILON  # part of a time by which that of a kink or of an event may be wrong
_CANCELS = 1e-5  # part of its terms against which a sum is measured in which they cancel
_ROUNDINGS = 8.0  # rounding errors of a rate, in parts of the size of its terms
# square root of the number of pieces after which rounding errors of the state count beside others
_WALK = 16.0
# Rows of Tally.state, columns of Tally.law and of Tally.kinks, and slots of Tally.total.
LARGEST, _SWAY, _DEFECT, _ROUNDED = range(4)
_EXCESS, _OFF_THRESHOLD, _CREEP, _BACKWARDS, _FORCE, _SPEED, _HELD, _OVERLAP, _OPENING = range(9)
_LAW = 9  # columns of these
_BEYOND, _REACHED = range(2)
FED_IN_ALL, _ERRORS, UNVERIFIED = range(3)
# Columns of Steps.work: dissipated and supplied energy.
SPENT, FED = range(2)
# Slots of the residuals of a motion.
ENERGY_BALANCE, FRICTION_LAW, EQUATIONS, OWN_ROUNDING = range(4)


class Tally(NamedTuple):
    """What an audit adds up, motion by motion.

    Attributes
    ----------
    state : array, shape (4, n)
        LARGEST modulus of each component; by how much the terms of its rate would change it within
        a piece (SWAY); largest DEFECT of a Taylor step; largest rounding error of one (ROUNDED).
    law : array, shape (contacts, 9)
        Largest |λ| − s, or s − |λ| where rest ends too early (EXCESS); |λ + σs| of what slides
        without mass (OFF_THRESHOLD); |u| in stick (CREEP); −σu in slip (BACKWARDS); largest FORCE,
        relative SPEED, and speed that the forces in stick hold back (HELD); of what can open the
        largest −g while open, or |g| while closed (OVERLAP), and the largest gap, or term of it
        (OPENING).
    kinks : array, shape (kinks, 2)
        Largest −guard (BEYOND) and |guard| (REACHED).
    total : array, shape (3,)
        Supplied energy in modulus (FED_IN_ALL); rounding errors of the states, summed up (ERRORS);
        time that is not verified (UNVERIFIED).
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
    """What an audit says of every step.

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
    """Room for some steps."""
    return Steps(np.zeros((count, 2)), np.zeros((count, n)), np.zeros((count, n)), np.zeros(count))


class Wanted(NamedTuple):
    """What an audit is asked for beside the work.

    Attributes
    ----------
    law : bool
        Whether the law is obeyed.
    extremes : bool
        What :class:`stickslip.motion.between.observers.Sums` say beyond times and switches.
    """

    law: bool
    extremes: bool


class Accounts(NamedTuple):
    """What an audit receives: zeros for each step, and what it adds to."""

    steps: Steps
    tally: Tally
    sums: Sums


def make_accounts(count: int, rows: Rows) -> Accounts:
    """Room for some steps."""
    n = int(rows.sizes[DIMENSION])
    return Accounts(make_steps(count, n), make_tally(rows), make_sums((), n, len(rows.u)))


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


@entry_point()
def audit_steps(
    machine: Machine,
    flow: Flow,
    seen: Vector,
    starts: Record,
    ends: Record,
    wanted: Wanted,
    accounts: Accounts,
) -> None:
    """Follow steps again, and measure them.

    Parameters
    ----------
    seen : array
        Sizes of the rows that bound the steps; see :class:`stickslip.motion.steps.arrays.Lane`.
    starts, ends : Record
        Where each step begins and ends, with the modes and regions that begin there.
    wanted : Wanted
    accounts : Accounts
    """
    for i in range(len(ends.time)):
        if is_stopped(flow.space):
            return
        length = ends.time[i] - starts.time[i]
        count_times(flow.rows, starts.mode[i], ends.mode[i], length, accounts.sums)
        if length > 0.0:
            audit_step(machine, flow, seen, starts, ends, wanted, i, accounts)
        elif wanted.law and (
            may_collide(flow.rows, ends.cause[i])
            or jump_after(flow.rows, ends.cause[i], starts.region[i]) >= 0
        ):
            audit_start(machine, flow, starts, ends, i, accounts)


@compiled()
def audit_step(
    machine: Machine,
    flow: Flow,
    seen: Array,
    starts: Record,
    ends: Record,
    wanted: Wanted,
    i: int,
    accounts: Accounts,
) -> None:
    """Follow the i-th step again, piece by piece, and measure it.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    seen, starts, ends, wanted, accounts
        As of :func:`audit_steps`.
    i : int
        The step.
    """
    steps, tally, sums = accounts.steps, accounts.tally, accounts.sums
    check = wanted.law
    nc = len(flow.rows.u)
    W = flow.space.W
    y = flow.space.trial
    n = len(y)
    mode = flow.space.touched[:nc]
    reg = flow.space.touched[nc:]
    copy(starts.mode[i], mode)
    copy(starts.region[i], reg)
    copy(starts.state[i], y)
    resolve(flow.rows, flow.k, flow.space, mode)
    base = starts.time[i]
    left = ends.time[i] - base
    last = 0.0
    pieces = 0
    whole = 0.0
    order = flow.order
    h = left
    while left > 0.0:
        if is_stopped(flow.space):
            return
        start = Instant(base, y, mode, reg)
        order, h, series = follow_mode(machine, flow, start, left, last, seen)
        h = min(left, max(h, 1e-12 * left))
        if ends_there(h, left, base):
            h = left
        factor = 0.0
        if not h > 0.0:
            h = left  # nothing here is a number, which the nodes will show
        if check:
            # a closed form may last for many Taylor steps, each of which counts by itself
            if not whole > 0.0:
                whole = h
                count_gaps(i, steps, tally)
            longest = h
            give_directions(flow.rows, mode, True)
            factor = enclose(flow, mode, reg, order, h, min(h, series), tally)
            while not factor < np.inf and pieces < _MOST_PIECES:
                h = 0.5 * h
                pieces = pieces + 1
                factor = enclose(flow, mode, reg, order, h, min(h, series), tally)
            give_directions(flow.rows, mode, False)
            if not factor < np.inf:
                h, steps.open[i] = longest, left  # no more is tried in this step
        acting = min(h, series) if series > 0.0 else h
        rounding = ROUNDING * max(1.0, math.sqrt(pieces) / _WALK)
        piece = StepPiece(order, base, h, acting, factor, rounding)
        measure_piece(machine, flow, piece, mode, reg, check, i, steps, tally)
        if wanted.extremes:
            add_step(flow.rows, W, order, h, W[n, 1], flow.space.stack, sums)
        for r in range(n):
            y[r] = horner(W[r], order, h / W[n, 1])
        base = base + h
        left = left - h
        whole = whole - h
        last = h
        pieces = pieces + 1
    if check:
        final = Instant(ends.time[i], ends.state[i], mode, reg)
        jump_or_collide(machine, flow, final, h, ends, i, accounts)
        close_step(flow, final, order, h, starts.state[i], i, steps, tally)
        count_jumps(machine, flow, final, ends.region[i], i, steps, tally)
        judge_beginning(machine, flow, starts, ends, i, tally)


@compiled()
def audit_start(
    machine: Machine, flow: Flow, starts: Record, ends: Record, i: int, accounts: Accounts
) -> None:
    """Measure an impact, or a jump, without a step before it: at the start, or where another jump
    has been.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    starts, ends, accounts
        As of :func:`audit_steps`.
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
def may_collide(rows: Rows, cause: int) -> bool:
    """Whether what ends a step is that a gap closes."""
    nk = len(rows.kinks)
    return bool(cause >= nk and opens(rows, cause - nk))


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
    machine : Machine
    flow : Flow
    at : Instant
        After it, with the mode and the regions of the step.
    h : float
        Length of the last piece.
    ends : Record
        As of :func:`audit_steps`.
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
    """Let the state jump where a step arrives, and count the energy that this takes, or gives; then
    the step is taken to end there.

    Parameters
    ----------
    machine : Machine
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
    machine : Machine
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
        found[FASTEST, c] = tally.law[c, _SPEED]
    if rows.in_turn == 1:
        explain_in_turn(machine, flow, arrived, at.y, h, cause)
    else:
        explain_jump(machine, flow, arrived, at.y, h, cause)
    for c in range(len(at.mode)):
        at.mode[c] = space.labels[c, 0]
    for c in range(rows.sizes[ON_INERTIAL]):
        tally.law[c, _CREEP] = most(tally.law[c, _CREEP], found[BROKEN, c])
        tally.law[c, _HELD] = most(tally.law[c, _HELD], found[CONTACT_TERMS, c])
    for q in range(nq):
        # What the law does not explain stays as a gap of the step; the rest is none.
        space.trial[nq + q] = at.y[nq + q]
        steps.gap[i, nq + q] += found[RATES_LEFT, q]
        tally.state[_SWAY, nq + q] = most(tally.state[_SWAY, nq + q], found[RATE_TERMS, q])
        tally.state[_SWAY, q] = most(tally.state[_SWAY, q], h * found[RATE_TERMS, q])
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
    """Count the work that a load which jumps at a time does on what is at rest, too, as supplied
    energy.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    at : Instant
        End of the step; its regions become the next ones where a load jumps.
    next_reg : array of int, shape (kinks,)
        Regions that begin there.
    i : int
        The step.
    steps : Steps
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
    tape = tape_of(flow)
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
        spread_given(rows, mode, space.W, N, powers, space.discs)
        spread(tape, mode, reg, 0, len(rows.program.code))
        for r in range(n):
            space.discs[r, SLOPE] = slope_range(space.W[r], N, powers) / unit
        if encloses(rows, space, mode, N, h, acting, factor, tally):
            return factor
    return np.inf


@compiled(relaxed=RELAXED)
def slope_range(c: Array, N: int, powers: Array) -> float:
    """How far the derivative of a polynomial strays from its first value on a disc."""
    total = 0.0
    for k in range(2, N + 1):
        total += k * abs(c[k]) * powers[k - 1]
    return total


@compiled()
def strays(disc: Array, factor: float) -> float:
    """What a row may do between the nodes."""
    return factor * disc[BALL] + 2.0 * (1.0 + LEBESGUE) * disc[OFF]


@compiled()
def residual_strays(rows: Rows, discs: Array, r: int, factor: float) -> float:
    """What the residual of a part of the state may do between the nodes."""
    return strays(discs[rows.program.rates[r]], factor) + factor * discs[r, SLOPE]


@compiled()
def extent(c: Array, N: int, powers: Array) -> float:
    """Largest term of a polynomial: its size on a piece, even if it begins with zeros."""
    size = LEAST_SIZE
    for k in range(N + 1):
        size = max(size, abs(c[k]) * powers[k])
    return size


@compiled()
def counts_for(rows: Rows, mag: Array, r: int, size: float, h: float, acting: float) -> float:
    """For how long an error of a rate counts in a piece of length h.

    Where a polynomial lasts longer than a series, because something decays, that is as long as a
    series would last, or as the terms of the rate would take to change this part of the state by
    its size: what does not decay counts fully.

    Parameters
    ----------
    rows : Rows
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
    """Whether what may be between the nodes of a piece is negligible.

    Parameters
    ----------
    rows : Rows
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
    for r in range(n):
        size = max(extent(W[r], N, powers), tally.state[LARGEST, r])
        time = counts_for(rows, mag, r, size, h, acting)
        size += _REST * impulse(rows, mag, r, acting)
        if not time * residual_strays(rows, discs, r, factor) <= _NEGLIGIBLE * size:
            return False
    for c in range(nc):
        speed = (
            max(extent(W[rows.u[c]], N, powers), _CANCELS * mag[c], tally.law[c, _SPEED])
            + _REST * acting * mag[nc + c]
        )
        if c < rows.sizes[ON_INERTIAL] and mode[c] == 0 and own_inverse(rows, space, c) != 0.0:
            # Forces that begin with zero make a velocity, too.
            made = extent(W[rows.force[c]], N - 1, powers) / abs(own_inverse(rows, space, c))
            speed += _REST * acting * made
        if not strays(discs[rows.u[c]], factor) <= _NEGLIGIBLE * speed:
            return False
        forces = rows.force[c], rows.plus[c], rows.minus[c]
        held = max(_CANCELS * mag[2 * nc + c], tally.law[c, _FORCE])
        for row in forces:
            held = max(held, extent(W[row], N - 1, powers))
        # What nothing presses has no friction, but for rounding errors.
        for row in forces:
            loose = is_loose(rows, mode, c)
            if not loose and not strays(discs[row], factor) <= _NEGLIGIBLE * held:
                return False
        if opens(rows, c):
            row = rows.gaps[c]
            # At an instant all terms of a gap may vanish; of what stays closed they always do.
            size = extent(W[row], N - 1, powers) + h * mag[c]
            size += _REST * acting * acting * mag[nc + c]
            size += mag[3 * nc + len(rows.kinks) + c]
            if not strays(discs[row], factor) <= _NEGLIGIBLE * max(size, tally.law[c, _OPENING]):
                return False
    for p in range(len(rows.planes)):
        if is_loose(rows, mode, rows.planes[p, COMPONENT]):
            continue
        aim = rows.planes[p, AIM]
        held = tally.law[rows.planes[p, COMPONENT], _FORCE]
        held = max(held, extent(W[rows.plus[rows.planes[p, COMPONENT]]], N - 1, powers))
        loose = strays(discs[rows.planes[p, ADMISSIBLE]], factor)
        turns = strays(discs[aim], factor) + strays(discs[aim + 1], factor)
        if not (loose <= _NEGLIGIBLE * held * held and turns <= _NEGLIGIBLE):
            return False
    for j in range(len(rows.kinks)):
        row = rows.kinks[j]
        size = max(
            extent(W[row], N - 1, powers), _CANCELS * mag[3 * nc + j], tally.kinks[j, _REACHED]
        )
        if not strays(discs[row], factor) <= _NEGLIGIBLE * size:
            return False
    return True


@compiled()
def measure_piece(
    machine: Machine,
    flow: Flow,
    piece: StepPiece,
    mode: Array,
    reg: Array,
    check: bool,
    i: int,
    steps: Steps,
    tally: Tally,
) -> None:
    """Evaluate the law at the nodes of a piece, and add up what was found there and what may be
    between them.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    piece : StepPiece
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    check : bool
        Whether more than the work is wanted.
    i : int
        The step.
    steps : Steps
    tally : Tally
        Both are added to.
    """
    rows = flow.rows
    space = flow.space
    n = rows.sizes[DIMENSION]
    W = space.W
    V = space.V
    y = space.y0
    power = space.powers
    unit = W[n, 1]
    give_directions(rows, mode, True)
    sharing = check and any_share(rows)
    if sharing:
        find_shared(flow, mode, W, True)
    for g in range(COUNT):
        tau, weight = piece.h * GAUSS_NODES[g], piece.h * GAUSS_WEIGHTS[g]
        for r in range(n):
            y[r] = horner(W[r], piece.order, tau / unit)
        take_directions(rows, W, piece.order, tau / unit, V)
        coefficients(machine, flow, Instant(piece.t + tau, y, mode, reg), 1, V)
        machine.powers(V, reg, flow.k.K, power)
        steps.work[i, SPENT] += weight * power[DISSIPATED]
        if piece.acting < piece.h:
            steps.work[i, SPENT] -= weight * power_of_residuals(flow, piece, tau)
        steps.work[i, FED] += weight * power[SUPPLIED]
        tally.total[FED_IN_ALL] += weight * abs(power[SUPPLIED])
        if check:
            sample_residuals(rows, space, piece, y, g, i, steps, tally)
            sample_law(rows, space, mode, reg, piece.acting, g, tally)
            if sharing:
                sample_together(flow, mode, g)
    give_directions(rows, mode, False)
    if not check:
        return
    for r in range(n):
        largest = 0.0
        for g in range(COUNT):
            largest = most(largest, abs(space.samples[r, g]))
        known = piece.factor < np.inf
        between = residual_strays(rows, space.discs, r, piece.factor) if known else 0.0
        size = tally.state[LARGEST, r]
        time = counts_for(rows, space.mag, r, size, piece.h, piece.acting)
        steps.gap[i, r] += time * (LEBESGUE * largest + between)
    if asks_for_others(rows, space, mode, piece, tally):
        try_other_forces(machine, flow, Instant(piece.t, y, mode, reg), piece.order, piece.h)
    judge_law(rows, space, mode, piece, tally)
    if sharing:
        judge_together(flow, mode, piece, tally)


@compiled()
def sample_together(flow: Flow, mode: Array, g: int) -> None:
    """Keep the forces of contacts that share them, and what these can hold, at a node.

    Parameters
    ----------
    flow : Flow
        With the values of the rows at the node.
    mode : array of int, shape (contacts,)
    g : int
        The node.
    """
    space = flow.space
    nc = flow.rows.sizes[ON_INERTIAL]
    for c in range(nc):
        if mode[c] == 0 and space.leaving[c] != ON_ITS_OWN:
            space.points[c, g] = held_at(flow, space.V, c, 0)
            space.points[nc + c, g] = radius_at(flow.rows, space.V, c, 0)


@compiled()
def judge_together(flow: Flow, mode: Array, piece: StepPiece, tally: Tally) -> None:
    """By how much some forces at least that hold contacts at rest on a piece are too large, where
    they are not unique.

    Parameters
    ----------
    flow : Flow
        With what :func:`sample_together` keeps, and the discs.
    mode : array of int, shape (contacts,)
    piece : StepPiece
    tally : Tally
        Receives the largest.
    """
    rows = flow.rows
    space = flow.space
    law = tally.law
    nc = rows.sizes[ON_INERTIAL]
    known = piece.factor < np.inf
    for first in range(nc):
        if (
            mode[first] != 0
            or space.leaving[first] == ON_ITS_OWN
            or not is_first(rows, mode, first)
        ):
            continue
        least = max(piece.rounding, blurred_by_turns(rows, space, mode, first, tally))
        loose = 0.0
        for c in range(first, nc):
            if mode[c] != 0 or rows.group[c] != rows.group[first]:
                continue
            to_control_points(space.points[c], space.bernstein[0])
            to_control_points(space.points[nc + c], space.bernstein[0])
            force = law[c, _FORCE]
            if rows.plane[c] >= 0:
                force = law[rows.planes[rows.plane[c], COMPONENT], _FORCE]
            if not force > 0.0:
                continue
            least = max(least, piece.rounding * space.mag[2 * len(rows.u) + c] / force)
            if known:
                strayed = strays(space.discs[rows.force[c]], piece.factor) / axis_of(flow, c)
                radius = rows.planes[rows.plane[c], STATIC] if rows.plane[c] >= 0 else rows.plus[c]
                strayed += strays(space.discs[radius], piece.factor)
                loose = max(loose, strayed / force)
        lack = lacking_part(flow, mode, first, COUNT - 1, least)
        law[first, _EXCESS] = most(law[first, _EXCESS], (lack + loose) * law[first, _FORCE])


@compiled()
def asks_for_others(rows: Rows, space: Space, mode: Array, piece: StepPiece, tally: Tally) -> bool:
    """Whether forces of what rests do not obey the law at a node; what rests is put into the work
    space.

    Parameters
    ----------
    rows : Rows
    space : Space
        With the guards at the nodes.
    mode : array of int, shape (contacts,)
    piece : StepPiece
    tally : Tally
        Sizes.
    """
    if len(space.delassus) == 0:
        return False
    law, samples = tally.law, space.samples
    asked = False
    for c in range(rows.sizes[ON_INERTIAL]):
        row = rows.sizes[DIMENSION] + 3 * c
        space.cones[FORCE_SIZE, c] = law[c, _FORCE]
        space.cones[RESTS, c] = 0.0
        guards = 0
        if opens(rows, c):
            guards = 1 if mode[c] == 0 else 0
            wide = largest_of(samples[row]) > ROUNDING * gap_size(rows, space, c)
            if mode[c] != 0 and not wide and stays_still(rows, space, c, piece, tally):
                space.cones[RESTS, c] = TOUCHES
        elif rows.plane[c] < 0 and not is_loose(rows, mode, c):
            guards = 2 if resting(mode[c]) else 0
            rubs = rows.first_link[c + 1] > rows.first_link[c]
            if not resting(mode[c]) and rubs and rows.alone[c] == 0:
                still = rows.drops[c] == 0 and stays_still(rows, space, c, piece, tally)
                space.cones[RESTS, c] = HOLDS if still else RUBS
        if guards > 0:
            space.cones[RESTS, c] = HOLDS
        for part in range(guards):
            for g in range(COUNT):
                asked = asked or samples[row + part, g] < -_NEGLIGIBLE * law[c, _FORCE]
    for link in range(len(rows.links) if asked else 0):
        c, n = rows.links[link, RUBBING], rows.links[link, PRESSING]
        if space.cones[RESTS, n] == TOUCHES and is_loose(rows, mode, c):
            still = stays_still(rows, space, c, piece, tally)
            space.cones[RESTS, c] = TOUCHES if still else 0.0
            # Friction that slips would press, too: not asked for here.
            space.cones[RESTS, n] = space.cones[RESTS, n] if still else 0.0
    return asked


@compiled()
def stays_still(rows: Rows, space: Space, c: int, piece: StepPiece, tally: Tally) -> bool:
    """Whether the velocity of a contact is nothing but rounding errors in a piece.

    Parameters
    ----------
    rows : Rows
    space : Space
        With the polynomials.
    c : int
    piece : StepPiece
    tally : Tally
        Sizes.
    """
    W = space.W[rows.u[c]]
    x = piece.h / space.W[rows.sizes[DIMENSION], 1]
    moved = 0.0
    for k in range(piece.order - 1, -1, -1):
        moved = moved * x + abs(W[k])
    made = piece.acting * space.mag[len(rows.u) + c]
    speed = max(tally.law[c, _SPEED], _REST * max(tally.law[c, _HELD], made))
    return moved <= _NEGLIGIBLE * speed


@compiled()
def power_of_residuals(flow: Flow, piece: StepPiece, tau: float) -> float:
    """What forces without mass do at a node by the difference between the rates that the law gives
    there and those of the polynomials.

    The way is that of the polynomials. Where they last longer than series, because something
    decays, the rates of the law have errors that are forgotten at once; their power would be
    counted all the time.

    Parameters
    ----------
    flow : Flow
        Its work space has the polynomials, and the values of the rows at the node.
    piece : StepPiece
    tau : float
        The node.
    """
    rows = flow.rows
    W = flow.space.W
    V = flow.space.V
    unit = W[rows.sizes[DIMENSION], 1]
    first = 2 * rows.sizes[INERTIAL]
    rates = rows.program.rates
    power = 0.0
    for part in rows.parts:
        if part[MATRIX] == 0:
            continue
        n = part[COORDINATES]
        members = rows.members[part[MEMBERS] :]
        for i in range(n):
            z = members[i]
            force = 0.0
            for j in range(n):
                force += flow.k.C[z, j] * V[rates[first + members[j]], 0]
            for j in range(part[CONTACTS]):
                c = members[n + j]
                force -= direction_entry(rows, flow.k.J, V, c, i) * V[rows.force[c], 0]
            way = rate_on(W[first + z], piece.order, tau / unit) / unit
            power += force * (V[rates[first + z], 0] - way)
    return power


@compiled()
def sample_residuals(
    rows: Rows,
    space: Space,
    piece: StepPiece,
    y: Array,
    g: int,
    i: int,
    steps: Steps,
    tally: Tally,
) -> None:
    """Keep the residuals p′ − f(p) at a node, and count the rounding errors of the rates.

    Parameters
    ----------
    rows : Rows
    space : Space
        With the values of the rows at the node; receives the residuals.
    piece : StepPiece
    y : array, shape (n,)
        State at the node.
    g, i : int
        The node, and the step.
    steps : Steps
    tally : Tally
        Both are added to.
    """
    W = space.W
    mag = space.mag
    sizes = rows.program.rate_sizes
    n = len(y)
    unit = W[n, 1]
    tau, weight = piece.h * GAUSS_NODES[g], piece.h * GAUSS_WEIGHTS[g]
    for r in range(n):
        rate = space.V[rows.program.rates[r], 0]
        space.samples[r, g] = rate - rate_on(W[r], piece.order, tau / unit) / unit
        tally.state[LARGEST, r] = most(tally.state[LARGEST, r], abs(y[r]))
        if sizes[r] >= 0:
            size = tally.state[LARGEST, r]
            time = counts_for(rows, mag, r, size, piece.h, piece.acting)
            steps.noise[i, r] += time * GAUSS_WEIGHTS[g] * _ROUNDINGS * EPSILON * mag[sizes[r]]
            tally.total[_ERRORS] += weight * _ROUNDINGS * EPSILON * mag[sizes[r]]
        sway = impulse(rows, mag, r, piece.acting)
        tally.state[_SWAY, r] = most(tally.state[_SWAY, r], sway)


@compiled()
def rate_on(c: Array, d: int, x: float) -> float:
    """Derivative of Σ c[k] xᵏ, k ≤ d."""
    s = 0.0
    for k in range(d, 0, -1):
        s = s * x + k * c[k]
    return s


@compiled()
def sample_law(
    rows: Rows, space: Space, mode: Array, reg: Array, h: float, g: int, tally: Tally
) -> None:
    """Keep the values of all guards at a node, and the sizes of what they are made of.

    A contact has three rows: what must be nonnegative (two of them in stick), and what must vanish.

    Parameters
    ----------
    rows : Rows
    space : Space
        With the values of the rows at the node; receives those of the guards.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    h : float
        How long a series would last, in which forces make a velocity.
    g : int
        The node.
    tally : Tally
        Receives the sizes.
    """
    n = rows.sizes[DIMENSION]
    nc = len(rows.u)
    mq = rows.sizes[ON_INERTIAL]
    V = space.V
    mag = space.mag
    samples = space.samples
    law = tally.law
    for c in range(nc):
        u = V[rows.u[c], 0]
        if is_loose(rows, mode, c):
            # It has no force, but says how fast things are.
            law[c, _SPEED] = most(law[c, _SPEED], abs(u))
            continue
        if rows.plane[c] >= 0:
            if not is_component(rows, c):
                sample_plane(rows, space, mode, h, g, c, tally)
            continue
        held = V[rows.force[c], 0]
        up = V[rows.plus[c], 0]
        down = V[rows.minus[c], 0]
        # Where thresholds vanish, a force is known up to the rounding of its terms only.
        law[c, _FORCE] = most(
            most(law[c, _FORCE], max(abs(held), max(up, down))), _CANCELS * mag[2 * nc + c]
        )
        law[c, _SPEED] = most(most(law[c, _SPEED], abs(u)), _CANCELS * mag[c])
        row = n + 3 * c
        if opens(rows, c):
            gap = V[rows.gaps[c], 0]
            # What is closed has no size but that of what forces would do to it.
            size = max(abs(gap), mag[3 * nc + len(rows.kinks) + c], _REST * h * h * mag[nc + c])
            law[c, _OPENING] = most(law[c, _OPENING], size)
            law[c, _HELD] = most(law[c, _HELD], mag[nc + c] * h)
            space.impact[WIDEST, c] = law[c, _OPENING]
            samples[row, g] = held if mode[c] == 0 else gap
            samples[row + 1, g] = gap
            samples[row + 2, g] = u
            continue
        if resting(mode[c]):
            samples[row, g] = held + up
            samples[row + 1, g] = down - held
            samples[row + 2, g] = u
        if mode[c] == 0:
            law[c, _HELD] = most(law[c, _HELD], free_speed(rows, space, c, h))
        else:
            law[c, _HELD] = most(law[c, _HELD], mag[nc + c] * h if c < mq else mag[c])
        if abs(mode[c]) == 1:
            samples[row, g] = mode[c] * u
            samples[row + 2, g] = held + (up if mode[c] > 0 else -down)
    for j in range(len(rows.kinks)):
        value = V[rows.kinks[j], 0] if reg[j] == 1 else -V[rows.kinks[j], 0]
        samples[n + 3 * nc + j, g] = value
        tally.kinks[j, _REACHED] = most(tally.kinks[j, _REACHED], abs(value))


@compiled()
def steepness(c: Array, N: int, x: float) -> float:
    """Bound of the derivative of Σ c[k] τᵏ, k < N, for 0 ≤ τ ≤ x."""
    total = 0.0
    for k in range(N - 1, 0, -1):
        total = total * x + k * abs(c[k])
    return total


@compiled()
def judge_law(rows: Rows, space: Space, mode: Array, piece: StepPiece, tally: Tally) -> None:
    """By how much guards fail on a piece, at the nodes and between them.

    What a force or a velocity does within a rounding error of the time is none of theirs.

    Parameters
    ----------
    rows : Rows
    space : Space
        With the guards at the nodes, and the discs.
    mode : array of int, shape (contacts,)
    piece : StepPiece
    tally : Tally
        Receives the largest.
    """
    n = rows.sizes[DIMENSION]
    nc = len(rows.u)
    mag = space.mag
    discs = space.discs
    samples = space.samples
    law = tally.law
    factor = piece.factor
    unit = space.W[n, 1]
    late = _LATE * abs(piece.t) / unit
    for c in range(nc):
        if is_loose(rows, mode, c):
            continue
        if opens(rows, c):
            judge_opening(rows, space, mode, c, factor, tally)
            continue
        if rows.plane[c] >= 0:
            if not is_component(rows, c):
                judge_plane(rows, space, mode, c, factor, tally)
            continue
        row = n + 3 * c
        loose = 0.0
        tight = 0.0
        up, down = (
            steepness(space.W[rows.plus[c]], piece.order, piece.h / unit),
            steepness(space.W[rows.minus[c]], piece.order, piece.h / unit),
        )
        rounding = piece.rounding * mag[c] + late * steepness(
            space.W[rows.u[c]], piece.order, piece.h / unit
        )
        unsure = piece.rounding * mag[2 * nc + c]
        unsure += blurred_by_turns(rows, space, mode, c, tally) * law[c, _FORCE]
        unsure += late * (
            steepness(space.W[rows.force[c]], piece.order, piece.h / unit) + max(up, down)
        )
        if factor < np.inf:
            loose = strays(discs[rows.force[c]], factor)
            loose += max(strays(discs[rows.plus[c]], factor), strays(discs[rows.minus[c]], factor))
            tight = strays(discs[rows.u[c]], factor)
        if resting(mode[c]):
            for part in range(2 if space.leaving[c] == ON_ITS_OWN or mode[c] != 0 else 0):
                low = least_on_nodes(
                    samples[row + part], space.bernstein, 1e-2 * _NEGLIGIBLE * law[c, _FORCE]
                )
                law[c, _EXCESS] = most(law[c, _EXCESS], loose - low - unsure)
            law[c, _CREEP] = most(law[c, _CREEP], largest_of(samples[row + 2]) + tight - rounding)
        else:
            law[c, _BACKWARDS] = most(
                law[c, _BACKWARDS],
                tight - rounding - least_on_nodes(samples[row], space.bernstein, rounding),
            )
            if c >= rows.sizes[ON_INERTIAL] + rows.sizes[ON_VISCOUS]:
                law[c, _OFF_THRESHOLD] = most(
                    law[c, _OFF_THRESHOLD], largest_of(samples[row + 2]) + loose - unsure
                )
    for j in range(len(rows.kinks)):
        between = strays(discs[rows.kinks[j]], factor) if factor < np.inf else 0.0
        negligible = 1e-2 * _NEGLIGIBLE * tally.kinks[j, _REACHED]
        low = least_on_nodes(samples[n + 3 * nc + j], space.bernstein, negligible)
        tally.kinks[j, _BEYOND] = most(tally.kinks[j, _BEYOND], between - low)


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
    other = plane[OTHER]
    u, v = V[plane[AHEAD], 0], V[plane[ASIDE], 0]
    force = max(V[plane[STATIC], 0], 0.0)
    law[c, _FORCE] = most(law[c, _FORCE], force)
    speed = max(math.hypot(u, v), _CANCELS * (mag[c] + mag[other]))
    law[c, _SPEED] = most(law[c, _SPEED], speed)
    row = n + 3 * c
    if mode[c] == 0:
        samples[row, g] = V[plane[ADMISSIBLE], 0]
        samples[row + 1, g] = u
        samples[row + 2, g] = v
        for i in (c, other):
            law[c, _HELD] = most(law[c, _HELD], free_speed(rows, space, i, h))
        return
    x, y = V[plane[AIM], 0], V[plane[AIM] + 1, 0]
    samples[row, g] = x * u + y * v
    samples[row + 1, g] = x * v - y * u
    samples[row + 2, g] = x * x + y * y - 1.0
    if plane[MASSIVE] == 1:
        made = (mag[len(rows.u) + c] + mag[len(rows.u) + other]) * h
        law[c, _HELD] = most(law[c, _HELD], made)
    elif c >= rows.sizes[ON_INERTIAL] + rows.sizes[ON_VISCOUS]:
        # What slides without mass or viscosity has the force s, by nothing but its place.
        row += 3 * (other - c)
        held = V[plane[STATIC], 0] ** 2 - V[plane[ADMISSIBLE], 0]
        samples[row, g] = math.sqrt(max(held, 0.0)) - V[plane[STATIC], 0]


@compiled()
def free_speed(rows: Rows, space: Space, c: int, h: float) -> float:
    """The speed that forces would give to what sticks.

    Parameters
    ----------
    rows : Rows
    space : Space
    c : int
        The contact.
    h : float
        How long a series would last.
    """
    mag = space.mag
    mq, mz = rows.sizes[ON_INERTIAL], rows.sizes[ON_VISCOUS]
    if c >= mq + mz:
        return float(mag[c])
    if is_prescribed(rows, c):
        return float(mag[len(rows.u) + c] * h)
    free = mag[2 * len(rows.u) + c] / abs(own_inverse(rows, space, c))
    return float(free * h if c < mq else free)


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
        As of :func:`strays`.
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
            rounding = ROUNDING * tally.law[first, _SPEED]
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
        As of :class:`StepPiece`.
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
    ahead, aside, aim = plane[AHEAD], plane[ASIDE], plane[AIM]
    rounding = ROUNDING * (mag[c] + mag[plane[OTHER]])
    if mode[c] == 0:
        force = law[c, _FORCE]
        loose = strays(discs[plane[ADMISSIBLE]], factor) if known else 0.0
        low = least_on_nodes(samples[row], space.bernstein, 1e-2 * _NEGLIGIBLE * force * force)
        unsure = ROUNDING * mag[plane[ADMISSIBLE_SIZE]]
        unsure += blurred_by_turns(rows, space, mode, c, tally) * force * force
        if force > 0.0 and space.leaving[c] == ON_ITS_OWN:
            law[c, _EXCESS] = most(law[c, _EXCESS], (loose - low - unsure) / force)
        for part in (1, 2):
            moves = strays(discs[ahead if part == 1 else aside], factor) if known else 0.0
            creep = largest_of(samples[row + part]) + moves - rounding
            law[c, _CREEP] = most(law[c, _CREEP], creep)
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
    low = least_on_nodes(samples[row], space.bernstein, rounding)
    law[c, _BACKWARDS] = most(law[c, _BACKWARDS], along - rounding - low)
    turned = largest_of(samples[row + 1]) + across - rounding
    law[c, _BACKWARDS] = most(law[c, _BACKWARDS], turned)
    unsure = ROUNDING + blurred_by_turns(rows, space, mode, c, tally)
    longer = law[c, _FORCE] * (largest_of(samples[row + 2]) + unit - unsure)
    law[c, _OFF_THRESHOLD] = most(law[c, _OFF_THRESHOLD], longer)
    if c >= rows.sizes[ON_INERTIAL] + rows.sizes[ON_VISCOUS]:
        off = largest_of(samples[row + 3 * (plane[OTHER] - c)])
        off -= ROUNDING * (mag[2 * len(rows.u) + c] + mag[2 * len(rows.u) + plane[OTHER]])
        if known and law[c, _FORCE] > 0.0:
            off += strays(discs[plane[ADMISSIBLE]], factor) / law[c, _FORCE]
        law[c, _OFF_THRESHOLD] = most(law[c, _OFF_THRESHOLD], off)


@compiled()
def judge_opening(
    rows: Rows, space: Space, mode: Array, c: int, factor: float, tally: Tally
) -> None:
    """By how much g ≥ 0, or N ≥ 0 and g = 0, fail on a piece.

    Parameters
    ----------
    rows : Rows
    space : Space
        With normal forces and gaps at the nodes, and the discs.
    mode : array of int, shape (contacts,)
    c : int
        The contact.
    factor : float
        As of :class:`StepPiece`.
    tally : Tally
        Receives the largest.
    """
    law = tally.law
    row = rows.sizes[DIMENSION] + 3 * c
    known = factor < np.inf
    apart = strays(space.discs[rows.gaps[c]], factor) if known else 0.0
    apart -= ROUNDING * gap_size(rows, space, c)
    if mode[c] != 0:
        low = least_on_nodes(
            space.samples[row], space.bernstein, 1e-2 * _NEGLIGIBLE * law[c, _OPENING]
        )
        law[c, _OVERLAP] = most(law[c, _OVERLAP], apart - low)
        if abs(mode[c]) == 2:  # carried, it touches
            law[c, _OVERLAP] = most(law[c, _OVERLAP], largest_of(space.samples[row]) + apart)
        return
    loose = strays(space.discs[rows.force[c]], factor) if known else 0.0
    low = least_on_nodes(space.samples[row], space.bernstein, 1e-2 * _NEGLIGIBLE * law[c, _FORCE])
    unsure = ROUNDING * space.mag[2 * len(rows.u) + c]
    unsure += blurred_by_turns(rows, space, mode, c, tally) * law[c, _FORCE]
    law[c, _EXCESS] = most(law[c, _EXCESS], loose - low - unsure)
    law[c, _OVERLAP] = most(law[c, _OVERLAP], largest_of(space.samples[row + 1]) + apart)


@compiled()
def judge_beginning(
    machine: Machine, flow: Flow, starts: Record, ends: Record, i: int, tally: Tally
) -> None:
    """By how much what begins to slip, or to open, with a step could stick.

    Where the sliding force is below the threshold, the friction law alone would allow it, and so
    does adhesion: the stated rule is that what can stick sticks. Of several that begin together one
    has reached its threshold; what they carry at rest has to hold all it can. This is asked of what
    slips from a velocity that is zero, and of what has no mass and rested before.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    starts, ends : Record
        As of :func:`audit_steps`.
    i : int
        The step.
    tally : Tally
        Receives the largest.
    """
    rows = flow.rows
    nc = len(rows.u)
    slips = starts.mode[i]
    asked = False
    for c in range(nc):
        asked = asked or (not resting(slips[c]) and may_stick_again(rows, c))
    if not asked or (is_quiet(starts, i) and len(rows.planes) == 0):
        return
    mode = flow.space.touched[:nc]
    reg = flow.space.touched[nc:]
    copy(slips, mode)
    copy(starts.region[i], reg)
    at = Instant(starts.time[i], starts.state[i], mode, reg)
    if hold_beginnings(machine, flow, at, starts, ends, i):
        c, room = least_room(flow, at, slips, tally)
        if c < 0 and room == 0.0:
            c, room = shared_room(machine, flow, at, slips, tally)
        if c >= 0:
            tally.law[c, _EXCESS] = most(tally.law[c, _EXCESS], room * tally.law[c, _FORCE])


@compiled()
def is_quiet(starts: Record, i: int) -> bool:
    """Whether a step goes on with what the one before did: no event is recorded there. On a line no
    slip begins then; in a plane one may turn round."""
    return bool(i > 0 and starts.cause[i] < 0)


@compiled()
def may_stick_again(rows: Rows, c: int) -> bool:
    """Whether a contact that slips, or is open, may be held by more than its force, or from another
    side."""
    return bool(rows.drops[c] == 1 or rows.plane[c] >= 0 or adheres(rows, c))


@compiled()
def adheres(rows: Rows, c: int) -> bool:
    """Whether a contact that can open holds a pull: it has a threshold."""
    return bool(opens(rows, c) and rows.plus[c] != rows.minus[c])


@compiled()
def hold_beginnings(
    machine: Machine, flow: Flow, at: Instant, starts: Record, ends: Record, i: int
) -> bool:
    """Let what begins to slip with a step stick, or rest as it has rested before; whether anything
    does for which that is a question. Its forces are left in the work space.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    at : Instant
        The beginning; its mode is changed.
    starts, ends, i
        As of :func:`judge_beginning`.
    """
    rows = flow.rows
    space = flow.space
    slips = starts.mode[i]
    if not resolve(rows, flow.k, space, at.mode):
        return False
    if plain_coefficients(machine, flow, at, 1, space.W) != OK:
        return False
    quiet = is_quiet(starts, i)
    asked = False
    for c in range(len(slips)):
        if adheres(rows, c) and slips[c] != 0 and not quiet:
            if slips[c] == 1 and closed_at_rest(rows, space, c):
                asked = True
                carried = i > 0 and starts.mode[i - 1, c] == 2
                set_mode(rows, at.mode, c, 2 if carried else 0)
            continue
        skipped = is_component(rows, c) or opens(rows, c) or is_loose(rows, slips, c)
        skipped = skipped or is_prescribed(rows, c)
        if skipped or resting(slips[c]) or (quiet and rows.plane[c] < 0):
            continue
        # All rests before the start.
        before = starts.mode[i - 1, c] if i > 0 else 0
        if c < rows.sizes[ON_INERTIAL]:
            # What keeps its threshold, and its side, may be carried by others and never slip.
            begins = is_still(rows, space, c)
            begins = begins and (may_stick_again(rows, c) or before != slips[c])
        else:
            # A jump may tear away what has no mass.
            torn = i > 0 and jump_after(rows, starts.cause[i], starts.region[i - 1]) >= 0
            begins = not quiet and not torn and resting(before)
        if begins:
            asked = asked or may_stick_again(rows, c)
            set_mode(rows, at.mode, c, before if resting(before) else 0)
    if asked and quiet:
        asked = release_what_stays(machine, flow, at, ends, slips, i)
    if not asked or not resolve(rows, flow.k, space, at.mode):
        return False
    return coefficients(machine, flow, at, FEWEST_ORDERS, space.W) == OK


@compiled()
def closed_at_rest(rows: Rows, space: Space, c: int) -> bool:
    """Whether a contact that can open has neither a gap nor a velocity, up to rounding."""
    apart = abs(space.W[rows.gaps[c], 0]) > ROUNDING * gap_size(rows, space, c)
    return is_still(rows, space, c) and not apart


@compiled()
def release_what_stays(
    machine: Machine, flow: Flow, at: Instant, ends: Record, slips: Array, i: int
) -> bool:
    """Let those slip on whose velocity is still nothing but rounding errors at the end of a step:
    their slip ends, and none begins. Whether one is left that begins.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    at : Instant
        The beginning; its mode is changed.
    ends : Record
    slips : array of int, shape (contacts,)
        The mode of the step.
    i : int
    """
    space = flow.space
    mode = at.mode
    for c in range(len(mode)):
        space.labels[c, 0] = mode[c]
    copy(slips, mode)
    final = Instant(ends.time[i], ends.state[i], mode, at.reg)
    if not resolve(flow.rows, flow.k, space, mode):
        return False
    if plain_coefficients(machine, flow, final, 1, space.W) != OK:
        return False
    left = False
    for c in range(len(mode)):
        held = space.labels[c, 0]
        begins = held != slips[c] and not is_component(flow.rows, c)
        if begins and not is_still(flow.rows, space, c):
            set_mode(flow.rows, mode, c, held)
            left = True
    return left


@compiled()
def is_still(rows: Rows, space: Space, c: int) -> bool:
    """Whether the relative velocity of a contact vanishes, up to rounding."""
    still = abs(space.W[rows.u[c], 0]) <= ROUNDING * space.mag[c]
    if rows.plane[c] >= 0:
        other = rows.planes[rows.plane[c], OTHER]
        still = still and abs(space.W[rows.u[other], 0]) <= ROUNDING * space.mag[other]
    return bool(still)


@compiled()
def least_room(flow: Flow, at: Instant, slips: Array, tally: Tally) -> tuple[int, float]:
    """Which of the contacts that are held is nearest to its threshold, and the part of its force by
    which it is below; −1 and 0 where one has no room; −1 and −1 where something else keeps them
    from resting: another contact, what may happen beyond a kink, or a gap that may close.

    Parameters
    ----------
    flow : Flow
        Its work space has the forces.
    at : Instant
        With the mode in which they are held.
    slips : array of int, shape (contacts,)
        The mode in which they slip.
    tally : Tally
        With the size of each force.
    """
    rows = flow.rows
    W = flow.space.W
    mag = flow.space.mag
    nc = len(slips)
    mode = at.mode
    unit = W[rows.sizes[DIMENSION], 1]
    late = 0.5 * EPSILON * abs(at.t) / unit
    for j in range(len(rows.kinks)):
        if rows.timed[j] == 0 and abs(W[rows.kinks[j], 0]) <= ROUNDING * mag[3 * nc + j]:
            return NOWHERE, -1.0
    first = NOWHERE
    least = np.inf
    full = False
    sharing = any_share(rows)
    if sharing:
        find_shared(flow, mode, W, False)
    for c in range(nc):
        if is_component(rows, c) or is_loose(rows, mode, c) or is_prescribed(rows, c):
            continue
        if opens(rows, c):
            gap = abs(W[rows.gaps[c], 0]) - ROUNDING * gap_size(rows, flow.space, c)
            if W[rows.force[c], 0] < 0.0 if mode[c] == 0 else gap <= 0.0:
                return NOWHERE, -1.0
            others = mode[c] == 2 and abs(W[rows.u[c], 1]) > ROUNDING * mag[nc + c] * unit
            if others and slips[c] == 1:
                return NOWHERE, -1.0
            if mode[c] == 0 and slips[c] != 0:
                room = room_to_tear(rows, flow.space, c, late, tally.law[c, _FORCE])
                full = full or not room > 0.0
                if room < least:
                    first, least = c, room
        elif resting(mode[c]):
            room = room_left(rows, flow.space, c, late, tally.law[c, _FORCE])
            if sharing and mode[c] == 0 and flow.space.leaving[c] != ON_ITS_OWN:
                if press_themselves(flow, mode, W, rows.group[c]):
                    return c, 1.0  # nobody has asked what they hold then
                room = spare_part(flow, mode, c)
                if tally.law[c, _FORCE] > 0.0:
                    room -= late * abs(W[rows.force[c], 1]) / tally.law[c, _FORCE]
            carried = abs(mode[c]) != 2 or abs(W[rows.u[c], 1]) <= ROUNDING * mag[nc + c] * unit
            if not carried:
                return NOWHERE, -1.0
            full = full or not room > 0.0
            if not resting(slips[c]) and room < least:
                first, least = c, room
    return (NOWHERE, 0.0) if full else (first, least)


@compiled()
def shared_room(
    machine: Machine, flow: Flow, at: Instant, slips: Array, tally: Tally
) -> tuple[int, float]:
    """The same where forces are not unique: the room of those that have most; −1 if there is none.

    Parameters
    ----------
    machine, flow, at, slips, tally
        As of :func:`least_room`.
    """
    rows, space = flow.rows, flow.space
    begins = NOWHERE
    held = 0
    if len(space.delassus) == 0:
        return NOWHERE, 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        rests = 0.0
        if opens(rows, c):
            rests = 1.0 if at.mode[c] == 0 else 0.0
        elif not is_loose(rows, at.mode, c):
            slides = -1.0 if rows.first_link[c + 1] > rows.first_link[c] else 0.0
            rests = 1.0 if resting(at.mode[c]) else slides
            if resting(at.mode[c]) and not resting(slips[c]):
                begins = c
        held += 1 if rests > 0.0 else 0
        space.cones[RESTS, c], space.cones[FORCE_SIZE, c] = rests, tally.law[c, _FORCE]
    if held < 2 or begins < 0:
        return NOWHERE, 0.0
    room = widest_room(machine, flow, at)
    return (begins, room) if room > 0.0 else (NOWHERE, 0.0)


@compiled()
def room_left(rows: Rows, space: Space, c: int, late: float, force: float) -> float:
    """How far a contact that rests is from its threshold, in parts of its force.

    Parameters
    ----------
    rows : Rows
    space : Space
        With the forces.
    c : int
    late : float
        By how much the time is a rounded number, in the unit of that of the coefficients.
    force : float
        Size of its force.
    """
    W = space.W
    nc = len(rows.u)
    if not force > 0.0:
        return 0.0
    if rows.plane[c] >= 0:
        plane = rows.planes[rows.plane[c]]
        row = plane[ADMISSIBLE]
        unsure = ROUNDING * space.mag[plane[ADMISSIBLE_SIZE]] + late * abs(W[row, 1])
        return float((W[row, 0] - unsure) / (force * force))
    held, up, down = rows.force[c], rows.plus[c], rows.minus[c]
    unsure = ROUNDING * space.mag[2 * nc + c]
    unsure += late * (abs(W[held, 1]) + abs(W[up, 1]) + abs(W[down, 1]))
    room = min(W[held, 0] + W[up, 0], W[down, 0] - W[held, 0])
    return float((room - unsure) / force)


@compiled()
def room_to_tear(rows: Rows, space: Space, c: int, late: float, force: float) -> float:
    """How far what adheres is from being torn off, in parts of its force.

    Parameters
    ----------
    rows, space, c, late, force
        As of :func:`room_left`.
    """
    if not force > 0.0:
        return 0.0
    unsure = ROUNDING * space.mag[2 * len(rows.u) + c] + late * abs(space.W[rows.force[c], 1])
    return float((space.W[rows.force[c], 0] - unsure) / force)


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
    flow : Flow
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
    steps : Steps
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
            # What slides without viscosity is put back onto λ + σ s = 0, where forces are known to
            # rounding only; near a fold, where its stiffness vanishes, that moves it. The friction
            # law sees the forces themselves.
            for j in range(nr):
                c = sizes[ON_INERTIAL] + sizes[ON_VISCOUS] + j
                if mode[c] != 0:
                    terms = space.mag[2 * len(mode) + c]
                    off -= ROUNDING * abs(space.B[r - 2 * nq - nz, j]) * terms
        steps.gap[i, r] += max(off, 0.0) if off == off else np.inf
        ends = most(most(tally.state[LARGEST, r], abs(first[r])), abs(end[r]))
        tally.state[LARGEST, r] = ends
    count_gaps(i, steps, tally)
    tally.total[UNVERIFIED] += steps.open[i]


@compiled()
def count_gaps(i: int, steps: Steps, tally: Tally) -> None:
    """Keep the gap and the rounding errors of a Taylor step, and begin the next with none."""
    for r in range(steps.gap.shape[1]):
        tally.state[_DEFECT, r] = most(tally.state[_DEFECT, r], steps.gap[i, r])
        tally.state[_ROUNDED, r] = most(tally.state[_ROUNDED, r], steps.noise[i, r])
        steps.gap[i, r], steps.noise[i, r] = 0.0, 0.0


@entry_point()
def judge(
    rows: Rows, tally: Tally, imbalance: float, flow: float, energy: float, residuals: Vector
) -> None:
    """Residuals of a motion, relative to sizes that do not vanish where something sticks.

    Parameters
    ----------
    imbalance : float
        Largest violation of the energy balance.
    flow, energy : float
        Energy that flows, and the largest modulus of the energy.
    residuals : array, shape (4,)
        Receives the residual of the energy balance, the violation of the friction law, the defect
        of the equations of motion, and the audit's own rounding errors.
    """
    state = tally.state
    law = tally.law
    n = rows.sizes[DIMENSION]
    force = 0.0
    reach_ = 0.0
    violation = 0.0
    defect = 0.0
    own = 0.0
    for c in range(len(law)):
        force = most(force, law[c, _FORCE])
        # In a plane velocities are vectors, whose size stands at their first component.
        first = rows.planes[rows.plane[c], COMPONENT] if rows.plane[c] >= 0 else c
        speed = max(law[c, _SPEED], law[first, _SPEED])
        speed = max(speed, _REST * max(law[c, _HELD], law[first, _HELD]))
        violation = most(
            violation, relative(max(law[c, _EXCESS], law[c, _OFF_THRESHOLD]), law[c, _FORCE])
        )
        violation = most(violation, relative(max(law[c, _CREEP], law[c, _BACKWARDS]), speed))
        violation = most(violation, relative(law[c, _OVERLAP], law[c, _OPENING]))
    for j in range(len(tally.kinks)):
        violation = most(violation, relative(tally.kinks[j, _BEYOND], tally.kinks[j, _REACHED]))
    share_sizes(rows, state)
    for r in range(n):
        size = max(state[LARGEST, r], _REST * state[_SWAY, r])
        defect = most(defect, relative(state[_DEFECT, r], size))
        own = most(own, relative(state[_ROUNDED, r], size))
        reach_ = max(reach_, state[LARGEST, r])
    # The energy itself is known to rounding only: where next to nothing flows, that is the scale.
    scale = max(flow, 1e-6 * energy, 1e-6 * force * reach_)
    residuals[ENERGY_BALANCE] = relative(max(imbalance - force * tally.total[_ERRORS], 0.0), scale)
    residuals[FRICTION_LAW] = violation
    residuals[EQUATIONS] = defect
    residuals[OWN_ROUNDING] = own


@compiled()
def share_sizes(rows: Rows, state: Array) -> None:
    """Give the coordinates that a contact in a plane moves, and their velocities, one size: they
    are components of vectors, and a turn of the plane is no matter.

    Parameters
    ----------
    state : array, shape (4, n)
        As of :class:`Tally`; what forces make is as large as the largest then.
    """
    for p in range(len(rows.planes)):
        if rows.planes[p, MASSIVE] == 0:
            continue
        for first in (0, rows.sizes[INERTIAL]):
            largest = 0.0
            for turn in range(2):
                for i in (COMPONENT, OTHER):
                    part = rows.parts[rows.homes[rows.planes[p, i], PART]]
                    for j in range(part[COORDINATES]):
                        r = first + rows.members[part[MEMBERS] + j]
                        if turn == 0:
                            largest = max(largest, state[LARGEST, r], _REST * state[_SWAY, r])
                        else:
                            state[_SWAY, r] = max(state[_SWAY, r], largest / _REST)


@compiled()
def relative(value: float, size: float) -> float:
    """A violation relative to a size; nothing relative to nothing is nothing."""
    if value <= 0.0:
        return 0.0
    return value / size if size > 0.0 else np.inf
