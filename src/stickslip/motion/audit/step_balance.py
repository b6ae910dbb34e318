"""The audit of a motion between its knots: energy balance, equations of motion, friction law.

Each step is followed again from its first state by Taylor polynomials p, which are only candidates
here. The equations and the law are evaluated for them at Gauss nodes, without series
(:mod:`.friction_law`, :mod:`.contact_planes`), and bounded between the nodes
(:mod:`.between_nodes`). A piece of a step is halved until what may happen between its nodes is
negligible; where 512 pieces of a Taylor step do not suffice, the time is reported as not verified.
Stiff motion is followed by polynomials that last longer than Taylor series
(:mod:`stickslip.motion.steps.stiff`), and checked in the same way. :mod:`.step_ends` checks where a
step arrives and what happens there, :mod:`.beginnings` whether what begins to slip could have
stuck.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.motion.admissible.sharing import any_share, find_shared
from stickslip.motion.affine.nodes import (
    COUNT,
    GAUSS_NODES,
    GAUSS_WEIGHTS,
    INTEGRALS,
    LEBESGUE,
    most,
)
from stickslip.motion.algebra.roots import horner, slopes_at_nodes
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.audit.accounts import (
    BACKWARDS,
    BEYOND,
    CANCELLED_PART,
    CREEP,
    DEFECT,
    ENERGY_BALANCE,
    EQUATIONS,
    EXCESS,
    FED,
    FED_IN_ALL,
    FRICTION_LAW,
    LARGEST,
    LARGEST_FORCE,
    LARGEST_SPEED,
    OFF_THRESHOLD,
    OPENING,
    OVERLAP,
    OWN_ROUNDING,
    REACHED,
    REST_PART,
    ROUNDED,
    ROUNDING_ERRORS,
    SPEED_HELD,
    SPENT,
    SWAY,
    Accounts,
    Steps,
    Tally,
    count_gaps,
)
from stickslip.motion.audit.beginnings import judge_beginning
from stickslip.motion.audit.between_nodes import StepPiece, counts_for, enclose, residual_deviation
from stickslip.motion.audit.contact_planes import share_sizes
from stickslip.motion.audit.forces import (
    judge_together,
    sample_together,
    try_other_forces,
    violates_law,
)
from stickslip.motion.audit.friction_law import judge_law, sample_law
from stickslip.motion.audit.observers import add_step, count_times
from stickslip.motion.audit.step_ends import (
    audit_start,
    close_step,
    count_jumps,
    jump_after,
    jump_or_collide,
)
from stickslip.motion.audit.work import powers_at, put_nodes
from stickslip.motion.modes.guards import may_collide
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    DIMENSION,
    LEAD,
    PART,
    Flow,
    Instant,
    Machine,
    Record,
    Rows,
    Space,
    is_stopped,
)
from stickslip.motion.steps.contacts import list_friction
from stickslip.motion.steps.directions import give_directions
from stickslip.motion.steps.step_size import impulse
from stickslip.motion.steps.stiff import ends_there, follow_mode
from stickslip.numerics.levels import ENERGY_SCALE, EPSILON, INSTANT, ROUNDING, SHORTEST_PIECE
from stickslip.translator import compiled

_MOST_PIECES = 512  # largest number of pieces of a Taylor step
_ROUNDINGS = 8.0  # rounding errors of a rate relative to the size of its terms
# square root of the number of pieces after which rounding errors of the state are not negligible
_WALK = 16.0


@entry_point()
def audit_steps(
    machine: Machine,
    flow: Flow,
    seen: Vector,
    starts: Record,
    ends: Record,
    extremes: bool,
    accounts: Accounts,
) -> None:
    """Follow steps again, and measure them.

    Parameters
    ----------
    seen : array
        Sizes of the rows that bound the steps; see :class:`stickslip.motion.steps.arrays.Lane`.
    starts, ends : Record
        Where each step begins and ends, with the modes and regions that begin there.
    extremes : bool
        Whether what :class:`stickslip.motion.audit.observers.Sums` say beyond times and switches is
        asked for, too.

    Notes
    -----
    How large parts of the state become is known before: what is far from all that moves, as the end
    of a chain is, begins with next to nothing.
    """
    for i in range(len(ends.time)):
        note_largest(ends.state[i], accounts.tally)
    for i in range(len(ends.time)):
        if is_stopped(flow.space):
            return
        length = ends.time[i] - starts.time[i]
        count_times(flow.rows, starts.mode[i], ends.mode[i], length, accounts.sums)
        if length > 0.0:
            audit_step(machine, flow, seen, starts, ends, extremes, i, accounts)
        elif (
            may_collide(flow.rows, ends.cause[i])
            or jump_after(flow.rows, ends.cause[i], starts.region[i]) >= 0
        ):
            audit_start(machine, flow, starts, ends, i, accounts)


@compiled(brief=True)
def has_finite_parts(y: Array) -> bool:
    """Whether all numbers are finite."""
    total = 0.0
    for r in range(len(y)):
        total = total + abs(y[r])
    return bool(total < np.inf)


@compiled()
def note_largest(y: Array, tally: Tally) -> None:
    """Count the sizes of parts of the state that a knot has, if they are finite.

    Parameters
    ----------
    y : array
        The state.
    tally : Tally
        Receives the largest.
    """
    for r in range(len(y)):
        size = abs(y[r])
        if size < np.inf:
            tally.state[LARGEST, r] = max(tally.state[LARGEST, r], size)


@compiled()
def audit_step(
    machine: Machine,
    flow: Flow,
    seen: Array,
    starts: Record,
    ends: Record,
    extremes: bool,
    i: int,
    accounts: Accounts,
) -> None:
    """Follow the i-th step again, piece by piece, and measure it.

    Parameters
    ----------
    seen, starts, ends, extremes, accounts
        As in :func:`audit_steps`.
    i : int
        The step.
    """
    steps, tally, sums = accounts.steps, accounts.tally, accounts.sums
    nc = len(flow.rows.u)
    W = flow.space.W
    y = flow.space.trial
    n = len(y)
    mode = flow.space.touched[:nc]
    reg = flow.space.touched[nc:]
    copy(starts.mode[i], mode)
    copy(starts.region[i], reg)
    copy(starts.state[i], y)
    list_friction(flow.rows, flow.space, mode)
    resolve(flow.rows, flow.k, flow.space, mode)
    base = starts.time[i]
    left = ends.time[i] - base
    lost = 0.0
    last = 0.0
    pieces = 0
    tried = 0
    whole = 0.0
    order = flow.order
    h = left
    while left > 0.0:
        if is_stopped(flow.space):
            return
        start = Instant(base, y, mode, reg)
        order, h, series = follow_mode(machine, flow, start, left, last, seen)
        h = min(left, max(h, SHORTEST_PIECE * left))
        if ends_there(h, left, base) or not (h > 0.0 and has_finite_parts(y)):
            h = left  # values that are not numbers are detected at the nodes
        # a closed form may last for many Taylor steps, each of which is checked separately
        if not whole > 0.0:
            whole = h
            tried = 0
            count_gaps(i, steps, tally)
        longest = h
        give_directions(flow.rows, mode, True)
        factor = enclose(flow, mode, reg, order, h, min(h, series), tally)
        while not factor < np.inf and tried < _MOST_PIECES:
            h = 0.5 * h
            pieces = pieces + 1
            tried = tried + 1
            factor = enclose(flow, mode, reg, order, h, min(h, series), tally)
        give_directions(flow.rows, mode, False)
        if not factor < np.inf:
            h, steps.open[i] = longest, max(steps.open[i], left)  # no further attempts here
        acting = min(h, series) if series > 0.0 else h
        rounding = ROUNDING * max(1.0, math.sqrt(pieces) / _WALK)
        piece = StepPiece(order, base, h, acting, factor, rounding)
        measure_piece(machine, flow, piece, mode, reg, i, steps, tally)
        if extremes:
            add_step(flow.rows, W, order, h, W[n, 1], flow.space.stack, sums)
        for r in range(n):
            y[r] = horner(W[r], order, h / W[n, 1])
        base = base + h
        # The rounding error summed over the many pieces of a long step would shift the phase of
        # fast oscillations.
        part = h + lost
        lost = part - (left - (left - part))
        left = left - part
        whole = whole - h
        last = h
        pieces = pieces + 1
        tried = tried + 1
        if left <= INSTANT * abs(base):
            break  # Its time cannot be distinguished from that of the end.
    final = Instant(ends.time[i], ends.state[i], mode, reg)
    jump_or_collide(machine, flow, final, h, ends, i, accounts)
    close_step(flow, final, order, h, starts.state[i], i, steps, tally)
    count_jumps(machine, flow, final, ends.region[i], i, steps, tally)
    judge_beginning(machine, flow, starts, ends, i, tally)


@compiled()
def measure_piece(
    machine: Machine,
    flow: Flow,
    piece: StepPiece,
    mode: Array,
    reg: Array,
    i: int,
    steps: Steps,
    tally: Tally,
) -> None:
    """Evaluate the law at the nodes of a piece, and add up the results and the bounds between the
    nodes.

    Parameters
    ----------
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
    i : int
        The step.
    tally : Tally
        Both are added to.
    """
    rows = flow.rows
    space = flow.space
    n = rows.sizes[DIMENSION]
    W = space.W
    y = space.y0
    give_directions(rows, mode, True)
    sharing = any_share(rows)
    if sharing:
        find_shared(flow, mode, W)
    put_nodes(flow, piece, 0.0, piece.h)
    slopes_at_nodes(W, piece.order, space.nodes[n], space.samples[:n])
    turned = 0.0
    for g in range(COUNT):
        weight = piece.h * GAUSS_WEIGHTS[g]
        lost, given = powers_at(machine, flow, piece, mode, reg, piece.h * GAUSS_NODES[g], g)
        steps.work[i, SPENT] += weight * lost
        steps.work[i, FED] += weight * given
        tally.total[FED_IN_ALL] += weight * abs(given)
        sample_residuals(rows, space, piece, y, g, i, steps, tally)
        sample_law(rows, space, mode, reg, piece.acting, g, tally)
        if sharing:
            turned = most(turned, sample_together(flow, mode, piece, g))
    give_directions(rows, mode, False)
    for r in range(n):
        largest = 0.0
        total = 0.0
        for g in range(COUNT):
            largest = most(largest, abs(space.samples[r, g]))
            total += INTEGRALS[g] * abs(space.samples[r, g])
        known = piece.factor < np.inf
        between = residual_deviation(rows, space.discs, r, piece.factor) if known else 0.0
        size = tally.state[LARGEST, r]
        time = counts_for(rows, space.mag, r, size, piece.h, piece.acting)
        sampled = time * LEBESGUE * largest
        # A residual that increases steeply is large in a small part of the piece.
        if piece.h * total < sampled:
            sampled = piece.h * total
        steps.gap[i, r] += sampled + time * between
    if violates_law(rows, space, mode, piece, tally):
        try_other_forces(machine, flow, Instant(piece.t, y, mode, reg), piece.order, piece.h)
    judge_law(rows, space, mode, piece, tally)
    if sharing:
        judge_together(flow, mode, piece, turned, tally)


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
    """Keep the residuals p′ − f(p) at a node, in place of p′, and count the rounding errors of the
    rates.

    Parameters
    ----------
    space : Space
        With the values of the rows at the node; receives the residuals.
    y : array, shape (n,)
        State at the node.
    g, i : int
        The node, and the step.
    tally : Tally
        Both are added to.
    """
    W = space.W
    mag = space.mag
    sizes = rows.program.rate_sizes
    n = len(y)
    unit = W[n, 1]
    weight = piece.h * GAUSS_WEIGHTS[g]
    for r in range(n):
        rate = space.V[rows.program.rates[r], 0]
        space.samples[r, g] = rate - space.samples[r, g] / unit
        tally.state[LARGEST, r] = most(tally.state[LARGEST, r], abs(y[r]))
        if sizes[r] >= 0:
            size = tally.state[LARGEST, r]
            time = counts_for(rows, mag, r, size, piece.h, piece.acting)
            steps.noise[i, r] += time * GAUSS_WEIGHTS[g] * _ROUNDINGS * EPSILON * mag[sizes[r]]
            tally.total[ROUNDING_ERRORS] += weight * _ROUNDINGS * EPSILON * mag[sizes[r]]
        sway = impulse(rows, mag, r, piece.acting)
        tally.state[SWAY, r] = most(tally.state[SWAY, r], sway)


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
        force = most(force, law[c, LARGEST_FORCE])
        # In a plane velocities are vectors; their sizes are stored at the first component.
        first = rows.lead[c]
        speed = max(law[c, LARGEST_SPEED], law[first, LARGEST_SPEED])
        speed = max(speed, REST_PART * max(law[c, SPEED_HELD], law[first, SPEED_HELD]))
        size = force_size(rows, law, c)
        violation = most(violation, relative(max(law[c, EXCESS], law[c, OFF_THRESHOLD]), size))
        violation = most(violation, relative(max(law[c, CREEP], law[c, BACKWARDS]), speed))
        violation = most(violation, relative(law[c, OVERLAP], law[c, OPENING]))
    for i in range(len(rows.pieces)):
        # Between pieces of a dissipation, a direction is that of a velocity.
        j, first = rows.pieces[i, 0], rows.planes[rows.pieces[i, 1], LEAD]
        speed = max(law[first, LARGEST_SPEED], REST_PART * law[first, SPEED_HELD])
        tally.kinks[j, REACHED] = most(tally.kinks[j, REACHED], speed)
    for j in range(len(tally.kinks)):
        violation = most(violation, relative(tally.kinks[j, BEYOND], tally.kinks[j, REACHED]))
    share_sizes(rows, state)
    for r in range(n):
        size = max(state[LARGEST, r], REST_PART * state[SWAY, r])
        defect = most(defect, relative(state[DEFECT, r], size))
        own = most(own, relative(state[ROUNDED, r], size))
        reach_ = max(reach_, state[LARGEST, r])
    # The energy is known only up to rounding errors: if hardly any energy flows, that is the scale.
    scale = max(flow, ENERGY_SCALE * energy, ENERGY_SCALE * force * reach_)
    residuals[ENERGY_BALANCE] = relative(
        max(imbalance - force * tally.total[ROUNDING_ERRORS], 0.0), scale
    )
    residuals[FRICTION_LAW] = violation
    residuals[EQUATIONS] = defect
    residuals[OWN_ROUNDING] = own


@compiled()
def force_size(rows: Rows, law: Array, c: int) -> float:
    """Scale of the errors of the force of a contact. The forces on a body solve one linear problem,
    so that a force with vanishing threshold has the rounding errors of the others."""
    size = law[c, LARGEST_FORCE]
    part = rows.homes[c, PART]
    if part < 0:
        return size
    for other in range(len(law)):
        if rows.homes[other, PART] == part:
            size = most(size, CANCELLED_PART * law[other, LARGEST_FORCE])
    return size


@compiled()
def relative(value: float, size: float) -> float:
    """A violation relative to a size; 0 if both are 0."""
    if value <= 0.0:
        return 0.0
    return value / size if size > 0.0 else np.inf
