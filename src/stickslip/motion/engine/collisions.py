"""The impulses of an impact.

Two laws are known. *Together*: the law of :mod:`stickslip.motion.admissible.impacts_law` for all
contacts that are closed or closing at once. *In turn*: of the contacts that approach, the one whose
approach carries the most kinetic energy, γ²/(2G), has an impact by itself, as if there were no
others; and so on, until none approaches. Stopping that one would leave the least energy. Those that
carry the same have theirs together.

Where few contacts take part all their modes are tried, and those of many are found
(:mod:`stickslip.motion.admissible.many_impulses`).
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.admissible.impacts_law import (
    AFTER,
    BEFORE,
    BEST,
    CHANGE,
    CHOSEN,
    IMPULSE,
    MODE_BEFORE,
    MOST_MODES,
    NEAR,
    RESTITUTION,
    guess_mode,
    judge_impulses,
    largest_jump,
    let_recede,
    modes_of,
    put_change,
    put_restitution,
    put_velocities,
    set_in_motion,
    try_impulses,
)
from stickslip.motion.admissible.many_impulses import find_impulses
from stickslip.motion.engine.impacts import (
    approaching,
    put_responses,
    settles,
    stop_what_is_held,
)
from stickslip.motion.steps.arrays import (
    CAUSE,
    INERTIAL,
    NOW,
    ON_INERTIAL,
    Flow,
    Instant,
    Lane,
    Machine,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import directions_of, inertial_contacts
from stickslip.numerics.levels import CREATED_ENERGY, IMPACT_ZERO
from stickslip.translator import compiled

# Results of :func:`collide`: nothing collides; velocities have jumped; no impulse obeys the law; or
# only impulses that create energy do.
NO_IMPACT, JUMPED, NO_IMPULSE, CREATES = range(4)
# More rows of Space.impact: velocities before the first of several impacts; the changes of the
# rates in all of them, by coordinate; restitution, also of contacts that separate.
_FIRST, _TOTAL, _GIVEN = range(12, 15)
_CLOSED = 4  # row of Space.tried: all closed contacts, while only some take part
_FEW_MODES = 216  # number of modes up to which all are tried: three feet with friction along a line
_MOST_TURNS = 20000  # largest number of sequential impacts
_NONE_LEFT = 1e-29  # energy relative to that of the first approach below which impacts end
_EQUAL = 1e-9  # relative difference of equal energies of approach


@compiled()
def collide(machine: Machine, flow: Flow, lane: Lane, last: float) -> int:
    """Apply an impact if a gap is closed and would become negative.

    Parameters
    ----------
    lane : Lane
        Its rates jump, and its mode becomes a guess of the next one.
    last : float
        Length of the last step.

    Returns
    -------
    int
        From NO_IMPACT to CREATES.
    """
    rows = flow.rows
    space = flow.space
    work = space.impact
    tried = space.tried
    here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
    fired = lane.counters[CAUSE] - len(rows.kinks)
    if approaching(machine, flow, here, last, fired, 1.0) == 0:
        return NO_IMPACT
    mq = rows.sizes[ON_INERTIAL]
    nq = rows.sizes[INERTIAL]
    for c in range(mq):
        tried[MODE_BEFORE, c] = lane.mode[c]
    put_restitution(rows, space)
    if rows.in_turn == 0:
        let_recede(rows, space)
    for _ in range(mq + 1):
        if rows.in_turn == 1:
            found = impulses_in_turn(machine, flow, here)
        else:
            found = best_impulse(machine, flow, here)
        for c in range(mq):
            lane.mode[c] = tried[MODE_BEFORE, c]
        if found != JUMPED:
            return found
        for q in range(nq):
            lane.y[nq + q] += work[CHANGE, q]
        guess_mode(rows, tried, work, lane.mode)
        stop_what_is_held(machine, flow, lane)
        if not settles(machine, flow, lane):
            return JUMPED
        # The remaining bounces are negligible: repeat once without restitution.
        for q in range(nq):
            lane.y[nq + q] -= work[CHANGE, q]
    return JUMPED


# -- together --------------------------------------------------------------------------------------


@compiled()
def best_impulse(machine: Machine, flow: Flow, at: Instant) -> int:
    """Impulses that all obey the law at once; they are left in the work space, with the velocities
    after them and the change of the rates.

    Parameters
    ----------
    flow : Flow
        Its work space has what is closed, the velocities before, and restitution.
    at : Instant
        Its mode is used up.

    Returns
    -------
    int
        From JUMPED to CREATES.
    """
    if not put_responses(machine, flow, at):
        return NO_IMPULSE
    return answer_together(flow.rows, flow.space, at.mode)


@compiled()
def answer_together(rows: Rows, space: Space, mode: Array) -> int:
    """The same, with the responses to impulses in the work space."""
    total = modes_of(rows, space.tried)
    found = NO_IMPULSE
    if total <= _FEW_MODES:
        found = best_of_all(rows, space, mode, total)
    if found == NO_IMPULSE:
        found = best_of_many(rows, space, mode)
    if found != JUMPED and _FEW_MODES < total <= MOST_MODES:
        other = best_of_all(rows, space, mode, total)
        found = other if other != NO_IMPULSE else found
    if found != NO_IMPULSE:
        mq = rows.sizes[ON_INERTIAL]
        for c in range(mq):
            space.impact[IMPULSE, c] = space.impact[BEST, c]
        put_velocities(rows, space)
        put_change(rows, space)
    return found


@compiled()
def best_of_all(rows: Rows, space: Space, mode: Array, total: int) -> int:
    """Among the impulses of all modes that obey the law and set as few contacts in motion as
    possible, those with the largest energy loss."""
    work = space.impact
    tried = space.tried
    least = np.inf
    exchanged = 0.0
    fewest = 2 * len(mode) + 2
    for number in range(total):
        right, gained, size = try_impulses(rows, space, mode, number)
        broken = set_in_motion(rows, space, mode)
        if gained > CREATED_ENERGY * size:
            broken += len(mode) + 1
        if right and (broken < fewest or (broken == fewest and gained < least)):
            least, exchanged, fewest = gained, size, broken
            for c in range(rows.sizes[ON_INERTIAL]):
                work[BEST, c] = work[IMPULSE, c]
                tried[CHOSEN, c] = mode[c]
    if not least < np.inf:
        return NO_IMPULSE
    return JUMPED if least <= CREATED_ENERGY * exchanged else CREATES


@compiled()
def best_of_many(rows: Rows, space: Space, mode: Array) -> int:
    """Impulses that obey the law, found without trying all modes."""
    if not find_impulses(rows, space, mode):
        return NO_IMPULSE
    gained, size, _ = judge_impulses(rows, space.impact, space.tried, mode)
    for c in range(rows.sizes[ON_INERTIAL]):
        space.impact[BEST, c] = space.impact[IMPULSE, c]
        space.tried[CHOSEN, c] = mode[c]
    return JUMPED if gained <= CREATED_ENERGY * size else CREATES


# -- sequential impacts ---------------------------------------------------------------------------


@compiled()
def impulses_in_turn(machine: Machine, flow: Flow, at: Instant) -> int:
    """As :func:`best_impulse`, one impact after the other.

    Parameters
    ----------
    at : Instant
        Its rates are those between the impacts meanwhile.
    """
    rows = flow.rows
    space = flow.space
    work = space.impact
    tried = space.tried
    mq = rows.sizes[ON_INERTIAL]
    nq = rows.sizes[INERTIAL]
    for c in range(mq):
        tried[_CLOSED, c] = tried[NEAR, c]
        work[_FIRST, c] = work[BEFORE, c]
        work[_GIVEN, c] = work[RESTITUTION, c]
    for q in range(nq):
        work[_TOTAL, q] = 0.0
    found = NO_IMPULSE
    first = 0.0
    for turn in range(_MOST_TURNS):
        for c in range(mq):
            tried[NEAR, c] = tried[_CLOSED, c]
            work[RESTITUTION, c] = work[_GIVEN, c]
        let_recede(rows, space)
        if not put_responses(machine, flow, at):
            found = NO_IMPULSE
            break
        most = most_energy(rows, space)
        first = max(first, most)
        if turn > 0 and not most > _NONE_LEFT * first:
            found = JUMPED
            break
        for c in range(mq):
            if tried[NEAR, c] == 1 and energy_of(rows, space, c) < (1.0 - _EQUAL) * most:
                tried[NEAR, c] = 0
        found = answer_together(rows, space, at.mode)
        if found != JUMPED:
            break
        found = NO_IMPULSE  # unless a later iteration ends it
        for q in range(nq):
            work[_TOTAL, q] += work[CHANGE, q]
            at.y[nq + q] += work[CHANGE, q]
        for c in range(mq):
            work[BEFORE, c] = work[AFTER, c]
    for q in range(nq):
        at.y[nq + q] -= work[_TOTAL, q]
        work[CHANGE, q] = work[_TOTAL, q]
    for c in range(mq):
        tried[NEAR, c] = tried[_CLOSED, c]
        work[AFTER, c] = work[BEFORE, c]
        work[BEFORE, c] = work[_FIRST, c]
        work[RESTITUTION, c] = work[_GIVEN, c]
    choose_by_velocities(rows, space)
    return found


@compiled()
def energy_of(rows: Rows, space: Space, c: int) -> float:
    """Twice the kinetic energy of the approach of a contact: the energy lost, without friction, if
    it were stopped."""
    approach = min(space.impact[BEFORE, c], 0.0)
    own = space.delassus[c, c]
    near = space.tried[NEAR, c] == 1
    return float(approach * approach / own) if near and own > 0.0 else 0.0


@compiled()
def most_energy(rows: Rows, space: Space) -> float:
    """The largest of them."""
    most = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        most = max(most, energy_of(rows, space, c))
    return most


@compiled()
def choose_by_velocities(rows: Rows, space: Space) -> None:
    """The mode after sequential impacts, by the remaining velocities: contacts at rest stick."""
    work = space.impact
    slow = IMPACT_ZERO * largest_jump(rows, work)
    for c in inertial_contacts(rows):
        block = directions_of(rows, c)
        speed = work[AFTER, c]
        for i in range(1, len(block)):
            speed = math.hypot(speed, work[AFTER, block[i]])
        for i in block:
            space.tried[CHOSEN, i] = 1 if speed > slow else (-1 if speed < -slow else 0)
    for c in rows.openings:
        space.tried[CHOSEN, c] = 1


# -- the audit -------------------------------------------------------------------------------------


@compiled()
def change_in_turn(
    machine: Machine, flow: Flow, before: Instant, last: float, only: int, slack: float
) -> bool:
    """Find the change of the rates by sequential impacts, and leave it in the work space; returns
    whether there is one. If nothing approaches, as when a contact opens from rest, it is zero,
    provided that the contact in question counts as closed.

    Parameters
    ----------
    before : Instant
        Before the jump; its mode is used up.
    last : float
        Length of the step that ends there.
    only : int
        A contact beside which none takes part that is open; negative: all do that touch.
    slack : float
        As in :func:`~stickslip.motion.engine.impacts.approaching`.
    """
    rows, space = flow.rows, flow.space
    near = approaching(machine, flow, before, last, only, slack)
    for c in range(rows.sizes[ON_INERTIAL]):
        if only >= 0 and c != only and before.mode[c] != 0:
            space.tried[NEAR, c] = 0
    if near == 0:
        for q in range(rows.sizes[INERTIAL]):
            space.impact[CHANGE, q] = 0.0
        return only >= 0
    put_restitution(rows, space)
    return bool(impulses_in_turn(machine, flow, before) == JUMPED)
