"""The audit of impacts: whether some impulses that obey the law explain a jump of the velocities.

Once the velocities on both sides of an impact are known, the law
(:mod:`stickslip.motion.admissible.impacts_law`) leaves a convex cone of impulses Λ: what has
separated has none, what slips afterwards rubs in one direction, what does not has any friction that
can be held. So no modes have to be tried: in the cone, the impulse is found whose jump M⁻¹JᵀΛ is
nearest to the one that was recorded (:mod:`stickslip.motion.admissible.cones`).
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.admissible.cones import (
    FORCE,
    LEAST_SHARE,
    MOST_SHARE,
    PRESSES,
    STRONG,
    WANTED,
    fit_cones,
    link_of,
    no_cones,
)
from stickslip.motion.admissible.impacts_law import (
    BEFORE,
    CHANGE,
    IMPULSE,
    RESTITUTION,
    let_recede,
    put_restitution,
    set_in_motion,
    takes_part,
)
from stickslip.motion.engine.collisions import JUMPED, best_impulse, change_in_turn
from stickslip.motion.engine.impacts import (
    approaching,
    put_responses,
)
from stickslip.motion.steps.arrays import (
    BACK,
    COORDINATES,
    FIRST_ROW,
    FORWARD,
    HOLDS_BACK,
    HOLDS_FORWARD,
    INERTIAL,
    MATRIX,
    MEMBERS,
    NOWHERE,
    ON_INERTIAL,
    PART,
    PRESSING,
    RUBBING,
    Flow,
    Instant,
    Machine,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import (
    directions_of,
    inertial_contacts,
    inertial_friction,
    own_directions,
    set_mode,
)
from stickslip.motion.steps.starting import coefficients
from stickslip.numerics.levels import CREATED_ENERGY
from stickslip.translator import compiled

# Rows of Space.explained. By contact: the largest speed so far, which is given; γ⁺ as recorded;
# γ⁺ + e γ⁻; the size of its terms; by how much γ⁺ + e γ⁻ breaks the law; the size of what impulses
# change. By coordinate: the part of the jump of a rate that is left; the size of its terms.
FASTEST, _REACHED, _MOVED, _SIZE, BROKEN, CONTACT_TERMS, RATES_LEFT, RATE_TERMS = range(8)
# Rows of Space.tried: which contacts are near, and the previous mode; then their states in the
# impact.
_NEAR, _KEPT, _DONE = range(3)
_APART, _TOUCHING = 0, 1  # for openings; a friction contact sticks (0) or slips (±1)
_NEARBY = 1e3  # gap in tolerances below which a contact may take part in an impact
# Part of its size below which a velocity may be zero, and another one, where this explains too
# little; the size is that of its terms, and then, with either part, that of all that have been: of
# the last of infinitely many impacts rounding errors are no smaller.
_SLOW, _SLOWER = 1e-10, 1e-13
_TRIALS, _TRIALS_IN_TURN = 4, 3
_SETTLED = 1e-9  # the same for velocities with which a contact would rebound, but rests
_EXPLAINED = 1e-12  # unexplained part of a jump above which another mode is tried


@compiled(brief=True)
def explain_jump(
    machine: Machine, flow: Flow, before: Instant, after: Array, last: float, cause: int
) -> None:
    """Find the impulses that explain a jump of the rates best; the unexplained part is left in the
    work space.

    Whether contacts that are closed but for rounding errors, or for the tolerance, take part is not
    decided by the law: either is admissible.

    Parameters
    ----------
    flow : Flow
        Its work space receives what is not explained (`Space.explained`).
    before : Instant
        Before the jump; its mode is used up.
    after : array
        State after it.
    last : float
        Length of the step that ends there.
    cause : int
        The contact that has closed.
    """
    rows, space = flow.rows, flow.space
    work, found = space.impact, space.explained
    nq = rows.sizes[INERTIAL]
    mq = rows.sizes[ON_INERTIAL]
    for c in range(mq):
        space.tried[_KEPT, c] = before.mode[c]
    coefficients(machine, flow, Instant(before.t, after, before.mode, before.reg), 1, space.V)
    for c in range(mq):
        found[_REACHED, c] = space.V[rows.u[c], 0]
        found[_SIZE, c] = space.mag[c]
    strikes = approaching(machine, flow, before, last, cause, _NEARBY)
    put_restitution(rows, space)
    let_recede(rows, space)
    for c in rows.openings:
        if rests_at_last(space, c):
            work[RESTITUTION, c] = 0.0
    for c in range(mq):
        work[IMPULSE, c], space.cones[STRONG, c] = 0.0, 0.0
        space.tried[_DONE, c] = _APART
        found[_MOVED, c] = found[_REACHED, c] + work[RESTITUTION, c] * work[BEFORE, c]
        found[_SIZE, c] += space.mag[c]
    definite = strikes == 0 or put_responses(machine, flow, before)
    if strikes == 0 or not definite:
        for c in range(mq):
            space.tried[_NEAR, c] = 0
        judge_jump(rows, space, before.y, after, cause)
        if not definite:
            found[RATES_LEFT, 0] = np.inf
        return
    for c in range(mq):
        found[_SIZE, c] += passed_on(rows, space, c)
    least = np.inf
    best = 0
    trial = 0
    while trial < _TRIALS and least > _EXPLAINED:
        off = fit_impulses(rows, space, before.y, after, cause, trial)
        if off < least:
            least, best = off, trial
        trial += 1
    if best < trial - 1:
        fit_impulses(rows, space, before.y, after, cause, best)
    if creates_energy(rows, space):
        # Such impulses explain nothing; a jump within rounding errors needs no explanation.
        for q in range(nq):
            jump = abs(after[nq + q] - before.y[nq + q])
            found[RATES_LEFT, q] = max(found[RATES_LEFT, q], jump)
    require_rest(machine, flow, before, after)


@compiled(brief=True)
def explain_in_turn(
    machine: Machine, flow: Flow, before: Instant, after: Array, last: float, cause: int
) -> None:
    """The same for sequential impacts, which are unique once the participating contacts are known.

    Parameters
    ----------
    machine, flow, before, after, last, cause
        As in :func:`explain_jump`.
    """
    rows, space = flow.rows, flow.space
    found = space.explained
    nq = rows.sizes[INERTIAL]
    mq = rows.sizes[ON_INERTIAL]
    for c in range(mq):
        space.tried[_KEPT, c] = before.mode[c]
        found[BROKEN, c], found[CONTACT_TERMS, c] = 0.0, 0.0
        found[_MOVED, c] = before.mode[c]
    largest = 0.0
    for q in range(nq):
        found[RATES_LEFT, q] = np.inf
        largest = max(largest, abs(after[nq + q] - before.y[nq + q]))
    least = np.inf
    for trial in range(_TRIALS_IN_TURN):
        for c in range(mq):
            before.mode[c] = int(found[_MOVED, c])
        only = cause if trial == 1 else NOWHERE
        slack = _NEARBY if trial == 2 else 1.0
        if not change_in_turn(machine, flow, before, last, only, slack):
            continue
        off = 0.0
        for q in range(nq):
            jump = after[nq + q] - before.y[nq + q]
            off = max(off, abs(jump - space.impact[CHANGE, q]))
        if off < least:
            least = off
            for q in range(nq):
                jump = after[nq + q] - before.y[nq + q]
                found[RATES_LEFT, q] = abs(jump - space.impact[CHANGE, q])
                found[RATE_TERMS, q] = largest


@compiled(brief=True)
def rests_at_last(space: Space, c: int) -> bool:
    """Whether a contact that can open does not rebound, although its velocity would be tiny: of
    infinitely many impacts in finite time, the last are left out. A rubbing contact may slip, at a
    tiny velocity, instead of reversing."""
    rebound = -space.impact[RESTITUTION, c] * space.impact[BEFORE, c]
    after = space.explained[_REACHED, c]
    slow = abs(rebound) <= _SETTLED * (space.mag[c] + space.explained[FASTEST, c])
    return bool(slow and abs(after) < abs(after - rebound))


@compiled(brief=True)
def passed_on(rows: Rows, space: Space, c: int) -> float:
    """The largest velocity that impulses give to a contact which change one contact alone."""
    largest = 0.0
    for b in range(rows.sizes[ON_INERTIAL]):
        alone = impulse_alone(rows, space, b)
        if alone > 0.0 and rows.homes[b, PART] == rows.homes[c, PART]:
            largest = max(largest, abs(space.delassus[c, b]) * alone)
    return largest


@compiled(brief=True)
def impulse_alone(rows: Rows, space: Space, c: int) -> float:
    """The impulse that would explain the jump of a contact, if it were alone."""
    if not has_impulse(rows, space, c) or not space.delassus[c, c] > 0.0:
        return 0.0
    jump = space.explained[_REACHED, c] - space.impact[BEFORE, c]
    return float(abs(jump) / space.delassus[c, c])


@compiled(brief=True)
def has_impulse(rows: Rows, space: Space, c: int) -> bool:
    """Whether a contact may have an impulse: it is near, or rubs under one that is."""
    return takes_part(rows, space.tried, c)


@compiled(brief=True)
def is_pushed(rows: Rows, work: Array, c: int) -> bool:
    """Whether a contact rubs under a normal force that has an impulse."""
    for link in range(rows.first_link[c], rows.first_link[c + 1]):
        if work[IMPULSE, rows.links[link, PRESSING]] > 0.0:
            return True
    return False


@compiled(brief=True)
def fit_impulses(
    rows: Rows, space: Space, before: Array, after: Array, cause: int, trial: int
) -> float:
    """Find the impulses of minimum distance with slow velocities set to zero; returns as
    :func:`judge_jump`.

    Parameters
    ----------
    before, after : arrays
        States on both sides of the jump.
    cause : int
        The contact that has closed.
    trial : int
        Says what is slow.
    """
    found, done = space.explained, space.tried[_DONE]
    for c in rows.openings:
        closed = is_slow(found, c, trial) and space.tried[_NEAR, c] == 1
        done[c] = _TOUCHING if closed else _APART
    for c in inertial_friction(rows):
        block = directions_of(rows, c)
        zero = True
        for i in block:
            zero = zero and is_slow(found, i, trial)
        set_mode(rows, done, c, 0 if zero else (1 if found[_MOVED, c] > 0.0 else -1))
    fit_cones(rows, space, put_cones(rows, space))
    for c in range(rows.sizes[ON_INERTIAL]):
        space.impact[IMPULSE, c] = space.cones[FORCE, c]
    return judge_jump(rows, space, before, after, cause)


@compiled(brief=True)
def put_cones(rows: Rows, space: Space) -> float:
    """The cones of the impulses that the law leaves, and the jumps of the velocities of contacts,
    which are wanted; the size of these."""
    work, cones, moved = space.impact, space.cones, space.explained[_MOVED]
    done = space.tried[_DONE]
    scale = 0.0
    no_cones(rows, space)
    for c in range(rows.sizes[ON_INERTIAL]):
        cones[WANTED, c] = space.explained[_REACHED, c] - work[BEFORE, c]
        if has_impulse(rows, space, c) and space.delassus[c, c] > 0.0:
            scale = max(scale, abs(cones[WANTED, c]) / math.sqrt(space.delassus[c, c]))
    for c in rows.openings:
        cones[PRESSES, c] = 1.0 if done[c] == _TOUCHING else 0.0
    for link in range(len(rows.links)):
        c = rows.links[link, RUBBING]
        least, most = -work[HOLDS_FORWARD, link], work[HOLDS_BACK, link]
        if done[c] != 0:
            # The point of an interval, or of an ellipse, against the slip.
            size = 0.0
            for i in own_directions(rows, c):
                size = math.hypot(size, slip_share(rows, space, link, i) * moved[i])
            f = slip_share(rows, space, link, c)
            most = -f * (f * moved[c] / size) if size > 0.0 else 0.0
            least = most
        cones[LEAST_SHARE, link], cones[MOST_SHARE, link] = least, most
    return scale


@compiled(brief=True)
def slip_share(rows: Rows, space: Space, link: int, i: int) -> float:
    """The coefficient of friction against the slip along a direction."""
    side = FORWARD if space.explained[_MOVED, i] > 0.0 else BACK
    return float(space.impact[side, link_of(rows, link, i)])


@compiled(brief=True)
def is_slow(found: Array, c: int, trial: int) -> bool:
    """Whether γ⁺ + e γ⁻ of a contact may be zero."""
    size = found[_SIZE, c] + (found[FASTEST, c] if trial >= _TRIALS // 2 else 0.0)
    return bool(abs(found[_MOVED, c]) <= (_SLOWER if trial % 2 == 1 else _SLOW) * size)


@compiled(brief=True)
def judge_jump(rows: Rows, space: Space, before: Array, after: Array, cause: int) -> float:
    """The part of a jump that impulses do not explain, by coordinate and by contact; its largest
    value, in the metric of M, relative to the jump.

    Parameters
    ----------
    space : Space
        With the impulses; receives it.
    before, after : arrays
        States on both sides of the jump.
    cause : int
        The contact that has closed.
    """
    work, found, strong = space.impact, space.explained, space.cones[STRONG]
    nq = rows.sizes[INERTIAL]
    mq = rows.sizes[ON_INERTIAL]
    for q in range(nq):
        found[RATES_LEFT, q] = after[nq + q] - before[nq + q]
        found[RATE_TERMS, q] = abs(found[RATES_LEFT, q])
    jump = largest_rate(rows, space)
    for c in range(mq):
        # Others that are as good may have another size, and cancel.
        alone = impulse_alone(rows, space, c)
        if strong[c] != 0.0 or alone > 0.0:
            part = rows.parts[rows.homes[c, PART]]
            for i in range(part[COORDINATES]):
                q = rows.members[part[MEMBERS] + i]
                found[RATES_LEFT, q] -= space.response[q, c] * work[IMPULSE, c]
                most = max(strong[c], alone)
                found[RATE_TERMS, q] += abs(space.response[q, c]) * most
    for q in range(nq):
        found[RATES_LEFT, q] = abs(found[RATES_LEFT, q])
    largest = largest_rate(rows, space)
    for c in range(mq):
        held = space.tried[_DONE, c] == 0 and is_pushed(rows, work, c)
        found[BROKEN, c] = abs(found[_MOVED, c]) if held else 0.0
    for c in rows.openings:
        moved = found[_MOVED, c]
        if work[IMPULSE, c] > 0.0:
            found[BROKEN, c] = abs(moved)
        elif c == cause or space.tried[_KEPT, c] == 0:
            found[BROKEN, c] = max(0.0, -moved)
    for c in range(mq):
        off = found[BROKEN, c]
        if off > 0.0 and has_impulse(rows, space, c) and space.delassus[c, c] > 0.0:
            largest = max(largest, off / math.sqrt(space.delassus[c, c]))
        found[CONTACT_TERMS, c] = passed_on(rows, space, c)
        for b in range(mq):
            if strong[b] != 0.0 and rows.homes[b, PART] == rows.homes[c, PART]:
                found[CONTACT_TERMS, c] += abs(space.delassus[c, b]) * strong[b]
    return float(largest / jump) if jump > 0.0 else 0.0


@compiled(brief=True)
def largest_rate(rows: Rows, space: Space) -> float:
    """The largest of the rates that are not explained, in the metric of M."""
    largest = 0.0
    for part in rows.parts:
        for i in range(part[COORDINATES] if part[MATRIX] == 0 else 0):
            own = space.Rq[part[FIRST_ROW] + i, i]
            off = abs(space.explained[RATES_LEFT, rows.members[part[MEMBERS] + i]])
            if own > 0.0 and off > largest * math.sqrt(own):
                largest = off / math.sqrt(own)
    return float(largest)


@compiled(brief=True)
def creates_energy(rows: Rows, space: Space) -> bool:
    """Whether the impulses do work on the whole, beyond rounding errors."""
    work = space.impact
    gained = 0.0
    size = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        before, after = work[BEFORE, c], space.explained[_REACHED, c]
        gained += 0.5 * work[IMPULSE, c] * (before + after)
        size += 0.5 * abs(work[IMPULSE, c]) * (abs(before) + abs(after))
    return gained > CREATED_ENERGY * size


@compiled(brief=True)
def require_rest(machine: Machine, flow: Flow, before: Instant, after: Array) -> None:
    """Require that contacts which can be held at rest are held: if other impulses set fewer
    contacts with higher static friction in motion, the difference to the resulting jump is counted
    as unexplained.

    Parameters
    ----------
    before : Instant
        Its mode is used up.
    after : array
        State after the jump.
    """
    rows, space = flow.rows, flow.space
    work, found = space.impact, space.explained
    mode = before.mode
    nq = rows.sizes[INERTIAL]
    for c in inertial_contacts(rows):
        set_mode(rows, mode, c, space.tried[_DONE, c])
    for c in rows.openings:
        mode[c] = 0 if work[IMPULSE, c] > 0.0 else 1
    broken = set_in_motion(rows, space, mode)
    if broken == 0 or best_impulse(machine, flow, before) != JUMPED:
        return
    for c in range(rows.sizes[ON_INERTIAL]):
        set_mode(rows, mode, c, space.tried[_DONE, c])
    if set_in_motion(rows, space, mode) < broken:
        for q in range(nq):
            jump = after[nq + q] - before.y[nq + q]
            off = abs(jump - work[CHANGE, q])
            found[RATES_LEFT, q] = max(found[RATES_LEFT, q], off)
