"""The audit of impacts: whether some impulses that obey the law explain a jump of the velocities.

Once the velocities on both sides of an impact are known, the law
(:mod:`stickslip.motion.engine.impacts`) leaves a convex cone of impulses Λ: what has separated has
none, what slips afterwards rubs in one direction, what does not has any friction that can be held.
So no modes have to be tried. In the cone, the impulse is found whose jump M⁻¹JᵀΛ is nearest to the
one that was recorded, by non-negative least squares in the metric of M (C. L. Lawson & R. J.
Hanson, *Solving Least Squares Problems*, 1974, chapter 23). A ray of the cone is the impulse of one
contact with its friction; rays are made when they are needed, each the steepest that there is, so
that a set of forces counts by its support function alone. Where impulses are not unique, any will
do.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.engine.guards import opens
from stickslip.motion.engine.impacts import (
    BEFORE,
    CHANGE,
    IMPULSE,
    JUMPED,
    RESTITUTION,
    approaching,
    best_impulse,
    put_responses,
    restitution_of,
    set_in_motion,
    solve_equations,
)
from stickslip.motion.steps.arrays import (
    BACK,
    COORDINATES,
    EPSILON,
    FIRST_ROW,
    FORWARD,
    HOLDS_BACK,
    HOLDS_FORWARD,
    INERTIAL,
    MATRIX,
    MEMBERS,
    ON_INERTIAL,
    OTHER,
    PART,
    Flow,
    Instant,
    Machine,
    Rows,
    Space,
    is_component,
    set_mode,
)
from stickslip.motion.steps.starting import coefficients
from stickslip.translator import compiled

# Rows of Space.explained. By contact: the largest speed so far, which is given; γ⁺ as recorded;
# γ⁺ + e γ⁻; the size of its terms; the part of the jump of γ that is left; the size of an impulse,
# in which rays may cancel; by how much γ⁺ + e γ⁻ breaks the law; the size of what impulses change.
# By coordinate: the part of the jump of a rate that is left; the size of its terms.
FASTEST, _REACHED, _MOVED, _SIZE, _LEFT, _STRONG, BROKEN, CONTACT_TERMS, RATES_LEFT, RATE_TERMS = (
    range(10)
)
# Rows of Space.tried: which contacts are near, and the mode before; then what they do in the
# impact.
_NEAR, _KEPT, _DONE = range(3)
_APART, _TOUCHING = 0, 1  # of what opens; what rubs sticks (0) or slips (±1)
_NEARBY = 1e3  # tolerances of a gap below which a contact may take part in an impact
_CREATED = 1e-9  # part of the energy of an impact that may be a rounding error
# Part of its size below which a velocity may be zero, and another one, where this explains too
# little; the size is that of its terms, and at last that of all that have been.
_SLOW, _SLOWER = 1e-10, 1e-13
_TRIALS = 3
_SETTLED = 1e-9  # the same for velocities with which a contact would rebound, but rests
_EXPLAINED = 1e-12  # part of a jump that may be left unexplained before another is tried
_FLAT = 16.0 * EPSILON  # part of the jump below which nothing is left of it
_MOST_RAYS = 60  # tried for each contact


@compiled()
def explain_jump(
    machine: Machine, flow: Flow, before: Instant, after: Array, last: float, cause: int
) -> None:
    """Find the impulses that explain a jump of the rates best; what they leave is put into the work
    space.

    Whether contacts that are closed but for rounding errors, or for the tolerance, take part is not
    decided by the law: either is admissible.

    Parameters
    ----------
    machine : Machine
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
    mq = rows.sizes[ON_INERTIAL]
    for c in range(mq):
        space.tried[_KEPT, c] = before.mode[c]
    coefficients(machine, flow, Instant(before.t, after, before.mode, before.reg), 1, space.V)
    for c in range(mq):
        found[_REACHED, c] = space.V[rows.u[c], 0]
        found[_SIZE, c] = space.mag[c]
    strikes = approaching(machine, flow, before, last, cause, _NEARBY)
    for c in range(mq):
        work[RESTITUTION, c] = restitution_of(rows, space, c)
        if rests_at_last(space, c, space.mag[c]):
            work[RESTITUTION, c] = 0.0
        work[IMPULSE, c], found[_STRONG, c] = 0.0, 0.0
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
        found[RATES_LEFT, 0] = np.inf
    ask_for_rest(machine, flow, before, after)


@compiled()
def rests_at_last(space: Space, c: int, size: float) -> bool:
    """Whether a contact does not rebound, and would do so with next to no velocity: of infinitely
    many impacts that follow faster and faster, the last are left out.

    Parameters
    ----------
    space : Space
    c : int
    size : float
        Of the terms of its velocity.
    """
    rebound = -space.impact[RESTITUTION, c] * space.impact[BEFORE, c]
    after = space.explained[_REACHED, c]
    slow = abs(rebound) <= _SETTLED * (size + space.explained[FASTEST, c])
    return bool(slow and abs(after) < abs(after - rebound))


@compiled()
def passed_on(rows: Rows, space: Space, c: int) -> float:
    """The largest velocity that impulses give to a contact which change one contact alone."""
    largest = 0.0
    for b in range(rows.sizes[ON_INERTIAL]):
        alone = impulse_alone(rows, space, b)
        if alone > 0.0 and rows.homes[b, PART] == rows.homes[c, PART]:
            largest = max(largest, abs(space.delassus[c, b]) * alone)
    return largest


@compiled()
def impulse_alone(rows: Rows, space: Space, c: int) -> float:
    """The impulse that would explain the jump of a contact, if it were alone."""
    if not has_impulse(rows, space, c) or not space.delassus[c, c] > 0.0:
        return 0.0
    jump = space.explained[_REACHED, c] - space.impact[BEFORE, c]
    return float(abs(jump) / space.delassus[c, c])


@compiled()
def has_impulse(rows: Rows, space: Space, c: int) -> bool:
    """Whether a contact may have an impulse: it is near, or rubs under one that is."""
    if opens(rows, c):
        return bool(space.tried[_NEAR, c] == 1)
    return bool(rows.parents[c] >= 0 and space.tried[_NEAR, rows.parents[c]] == 1)


@compiled()
def fit_impulses(
    rows: Rows, space: Space, before: Array, after: Array, cause: int, trial: int
) -> float:
    """Find the impulses of least distance where velocities that are slow are zero; what
    :func:`judge_jump` says of them.

    Parameters
    ----------
    rows : Rows
    space : Space
    before, after : arrays
        States on both sides of the jump.
    cause : int
        The contact that has closed.
    trial : int
        Says what is slow.
    """
    found = space.explained
    done = space.tried[_DONE]
    scale = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        zero = is_slow(found, c, trial)
        if opens(rows, c):
            done[c] = _TOUCHING if zero and space.tried[_NEAR, c] == 1 else _APART
        elif rows.plane[c] >= 0:
            o = rows.planes[rows.plane[c], OTHER]
            if not is_component(rows, c):
                zero = zero and is_slow(found, o, trial)
                done[c] = 0 if zero else 1
                done[o] = done[c]
        else:
            done[c] = 0 if zero else (1 if found[_MOVED, c] > 0.0 else -1)
        if has_impulse(rows, space, c) and space.delassus[c, c] > 0.0:
            jump = abs(found[_REACHED, c] - space.impact[BEFORE, c])
            scale = max(scale, jump / math.sqrt(space.delassus[c, c]))
    number = 0
    put_left(rows, space, number)
    for _ in range(_MOST_RAYS * rows.sizes[ON_INERTIAL]):
        steep = steepest_ray(rows, space, number)
        if not steep > _FLAT * scale:
            break
        number, gone_on = balance_rays(rows, space, number + 1)
        put_left(rows, space, number)
        if not gone_on:
            break
    return judge_jump(rows, space, before, after, cause)


@compiled()
def is_slow(found: Array, c: int, trial: int) -> bool:
    """Whether γ⁺ + e γ⁻ of a contact may be zero."""
    size = found[_SIZE, c] + (found[FASTEST, c] if trial == _TRIALS - 1 else 0.0)
    return bool(abs(found[_MOVED, c]) <= (_SLOWER if trial == 1 else _SLOW) * size)


@compiled()
def steepest_ray(rows: Rows, space: Space, number: int) -> float:
    """Make the ray along which what is left of the jump falls most, behind those that there are;
    its steepness, in the metric of M (0: there is none)."""
    done = space.tried[_DONE]
    mq = rows.sizes[ON_INERTIAL]
    most = 0.0
    chosen = -1
    for n in range(mq):
        if opens(rows, n) and done[n] == _TOUCHING:
            put_ray(rows, space, n, number)
            falls = 0.0
            square = 0.0
            for c in range(mq):
                if space.rays[number, c] != 0.0:
                    falls += space.rays[number, c] * space.explained[_LEFT, c]
                    square += space.rays[number, c] * pushed(rows, space, number, c)
            if falls > 0.0 and square > 0.0 and falls > most * math.sqrt(square):
                most, chosen = falls / math.sqrt(square), n
    if chosen >= 0:
        put_ray(rows, space, chosen, number)
    return most


@compiled()
def put_ray(rows: Rows, space: Space, n: int, number: int) -> None:
    """A unit impulse of a contact, with the friction that what is left of the jump asks for most.

    Parameters
    ----------
    rows : Rows
    space : Space
        Receives it, with the weight 0 behind it.
    n : int
        The contact.
    number : int
        Place of the ray.
    """
    work, left = space.impact, space.explained[_LEFT]
    moved, done = space.explained[_MOVED], space.tried[_DONE]
    ray = space.rays[number]
    mq = rows.sizes[ON_INERTIAL]
    for c in range(mq + 1):
        ray[c] = 0.0
    ray[n] = 1.0
    for c in range(mq):
        if rows.parents[c] != n or is_component(rows, c):
            continue
        if rows.plane[c] >= 0:
            o = rows.planes[rows.plane[c], OTHER]
            slips = done[c] != 0
            f, g = work[FORWARD, c], work[FORWARD, o]
            x, y = -f * moved[c], -g * moved[o]
            if not slips:
                f, g = work[HOLDS_FORWARD, c], work[HOLDS_FORWARD, o]
                x, y = f * left[c], g * left[o]
            size = math.hypot(x, y)
            if size > 0.0:
                ray[c], ray[o] = f * x / size, g * y / size
        elif done[c] != 0:
            ray[c] = -work[FORWARD, c] if done[c] > 0 else work[BACK, c]
        else:
            ray[c] = work[HOLDS_BACK, c] if left[c] > 0.0 else -work[HOLDS_FORWARD, c]


@compiled()
def pushed(rows: Rows, space: Space, number: int, c: int) -> float:
    """The velocity that a ray gives to a contact."""
    total = 0.0
    for b in range(rows.sizes[ON_INERTIAL]):
        if space.rays[number, b] != 0.0 and rows.homes[b, PART] == rows.homes[c, PART]:
            total += space.delassus[c, b] * space.rays[number, b]
    return total


@compiled()
def balance_rays(rows: Rows, space: Space, number: int) -> tuple[int, bool]:
    """Give rays the weights for which nothing is left along any of them, without those whose
    weights would not be positive; how many are left, and whether the last has become one of them.

    Parameters
    ----------
    rows : Rows
    space : Space
        With the rays, and what is left of the jump beside them.
    number : int
        How many rays there are.
    """
    mq = rows.sizes[ON_INERTIAL]
    rays = space.rays
    shares = space.shares
    entered = True
    while number > 0:
        for i in range(number):
            for j in range(number):
                shares[i, j] = 0.0
            shares[i, number] = 0.0
            for c in range(mq):
                if rays[i, c] != 0.0:
                    shares[i, number] += rays[i, c] * space.explained[_LEFT, c]
                    for j in range(number):
                        shares[i, j] += rays[i, c] * pushed(rows, space, j, c)
        if not solve_equations(shares, number):
            return number - 1, False  # the last is made of the others
        part = 1.0
        first = -1
        for j in range(number):
            change = shares[j, number]
            if rays[j, mq] + change <= 0.0 and (first < 0 or rays[j, mq] < -part * change):
                part, first = min(part, -rays[j, mq] / change) if change < 0.0 else 0.0, j
        for j in range(number):
            rays[j, mq] += part * shares[j, number]
        if first < 0:
            return number, entered
        entered = entered and first < number - 1
        for j in range(first, number - 1):
            for c in range(mq + 1):
                rays[j, c] = rays[j + 1, c]
        number -= 1
        put_left(rows, space, number)
    return 0, False


@compiled()
def put_left(rows: Rows, space: Space, number: int) -> None:
    """Add up the impulses of rays, and what they leave of the jump of each contact."""
    work, found = space.impact, space.explained
    mq = rows.sizes[ON_INERTIAL]
    for c in range(mq):
        work[IMPULSE, c], found[_STRONG, c] = 0.0, 0.0
        for j in range(number):
            work[IMPULSE, c] += space.rays[j, mq] * space.rays[j, c]
            found[_STRONG, c] += space.rays[j, mq] * abs(space.rays[j, c])
    for c in range(mq):
        found[_LEFT, c] = found[_REACHED, c] - work[BEFORE, c]
        for b in range(mq):
            if work[IMPULSE, b] != 0.0 and rows.homes[b, PART] == rows.homes[c, PART]:
                found[_LEFT, c] -= space.delassus[c, b] * work[IMPULSE, b]


@compiled()
def judge_jump(rows: Rows, space: Space, before: Array, after: Array, cause: int) -> float:
    """What impulses do not explain, by coordinate and by contact; the largest of it, in the metric
    of M, as a part of the jump.

    Parameters
    ----------
    rows : Rows
    space : Space
        With the impulses; receives it.
    before, after : arrays
        States on both sides of the jump.
    cause : int
        The contact that has closed.
    """
    work, found = space.impact, space.explained
    nq = rows.sizes[INERTIAL]
    mq = rows.sizes[ON_INERTIAL]
    for q in range(nq):
        found[RATES_LEFT, q] = after[nq + q] - before[nq + q]
        found[RATE_TERMS, q] = abs(found[RATES_LEFT, q])
    jump = largest_rate(rows, space)
    for c in range(mq):
        # Others that are as good may have another size, and cancel.
        alone = impulse_alone(rows, space, c)
        if found[_STRONG, c] != 0.0 or alone > 0.0:
            part = rows.parts[rows.homes[c, PART]]
            for i in range(part[COORDINATES]):
                q = rows.members[part[MEMBERS] + i]
                found[RATES_LEFT, q] -= space.response[q, c] * work[IMPULSE, c]
                most = max(found[_STRONG, c], alone)
                found[RATE_TERMS, q] += abs(space.response[q, c]) * most
    for q in range(nq):
        found[RATES_LEFT, q] = abs(found[RATES_LEFT, q])
    largest = largest_rate(rows, space)
    for c in range(mq):
        off = 0.0
        moved = found[_MOVED, c]
        if opens(rows, c):
            if work[IMPULSE, c] > 0.0:
                off = abs(moved)
            elif c == cause or space.tried[_KEPT, c] == 0:
                off = max(0.0, -moved)
        elif has_impulse(rows, space, c) and work[IMPULSE, rows.parents[c]] > 0.0:
            off = abs(moved) if space.tried[_DONE, c] == 0 else 0.0
        found[BROKEN, c] = off
        if off > 0.0 and has_impulse(rows, space, c) and space.delassus[c, c] > 0.0:
            largest = max(largest, off / math.sqrt(space.delassus[c, c]))
        found[CONTACT_TERMS, c] = passed_on(rows, space, c)
        for b in range(mq):
            if found[_STRONG, b] != 0.0 and rows.homes[b, PART] == rows.homes[c, PART]:
                found[CONTACT_TERMS, c] += abs(space.delassus[c, b]) * found[_STRONG, b]
    return largest / jump if jump > 0.0 else 0.0


@compiled()
def largest_rate(rows: Rows, space: Space) -> float:
    """The largest of the rates that are not explained, in the metric of M."""
    largest = 0.0
    for part in rows.parts:
        for i in range(part[COORDINATES] if part[MATRIX] == 0 else 0):
            own = space.Rq[part[FIRST_ROW] + i, i]
            off = abs(space.explained[RATES_LEFT, rows.members[part[MEMBERS] + i]])
            if own > 0.0 and off > largest * math.sqrt(own):
                largest = off / math.sqrt(own)
    return largest


@compiled()
def creates_energy(rows: Rows, space: Space) -> bool:
    """Whether the impulses do work on the whole, beyond rounding errors."""
    work = space.impact
    gained = 0.0
    size = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        before, after = work[BEFORE, c], space.explained[_REACHED, c]
        gained += 0.5 * work[IMPULSE, c] * (before + after)
        size += 0.5 * abs(work[IMPULSE, c]) * (abs(before) + abs(after))
    return gained > _CREATED * size


@compiled()
def ask_for_rest(machine: Machine, flow: Flow, before: Instant, after: Array) -> None:
    """What can be held at rest is held: if other impulses set fewer contacts in motion whose static
    friction is the larger one, the difference to the jump that these make is not explained.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    before : Instant
        Its mode is used up.
    after : array
        State after the jump.
    """
    rows, space = flow.rows, flow.space
    work, found = space.impact, space.explained
    mode = before.mode
    nq = rows.sizes[INERTIAL]
    for c in range(rows.sizes[ON_INERTIAL]):
        if opens(rows, c):
            mode[c] = 0 if work[IMPULSE, c] > 0.0 else 1
        elif not is_component(rows, c):
            set_mode(rows, mode, c, space.tried[_DONE, c])
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
