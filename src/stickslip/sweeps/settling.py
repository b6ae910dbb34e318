"""Motions followed until they repeat themselves, and one period of what they have settled on: compiled.

A motion is looked at at its *marks*. If it is driven, these are the times t₀ + mP, P the period of the first drive;
if not, its events, where the guard that fires is a natural section; and if it has no events for a while, it is asked
whether its rates have died out, and whether it comes back through the plane across itself. Two marks of the same kind
whose states agree, up to the declared translation and a moving frame, are one period apart.

The misses d of consecutive returns shrink by a factor q, so that the cycle is about d/(1 − q) away: that, not d, has to
be below the tolerance. A slow return that has found its factor is carried on by what is missing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from stickslip.motion.affine import ClosedForms, Flight, mode_key
from stickslip.motion.engine import integrate
from stickslip.motion.kernel import (
    FINISHED,
    FULL,
    INLINED,
    JETS,
    LIMIT,
    NEED,
    OK,
    OPTIONS,
    RESIDUAL,
    Constants,
    Lane,
    Record,
    Rows,
    Space,
)
from stickslip.motion.modes import copy, resolve
from stickslip.motion.outcome import Outcome
from stickslip.motion.roots import horner

Array = np.ndarray

RING = 48  # marks that are remembered: the most events, or periods of the drive, that a cycle may have
SURE = 1e-4  # of the tolerance: a miss that needs no factor
LEAP = 1e-2  # largest size of what a slow return is carried on by
SLOW = 0.6  # factors above this are slow
STRAIGHT = 0.1  # how much of what remains of a return may be out of line
AT_REST, PERIODIC = int(Outcome.AT_REST.code), int(Outcome.PERIODIC.code)
STEADY, NOT_SETTLED = int(Outcome.STEADY.code), int(Outcome.NOT_SETTLED.code)
FADED = 100.0  # tolerances that an oscillation may still be away from an equilibrium
SETTLING, MEASURING, DONE = 0, 1, 2


class Engine(NamedTuple):
    """What the event loop takes, the same for all lanes."""

    rows: Rows
    space: Space
    flight: Flight
    constants: Constants
    forms: ClosedForms
    group: Array
    codes: Array
    lanes: Lane


class Marks(NamedTuple):
    """What is remembered of every lane.

    Attributes
    ----------
    time, state, kind : arrays, shapes (lanes, RING), (lanes, RING, n), (lanes, RING)
        The latest marks.
    miss, lag : arrays, shape (lanes, RING)
        How closely each comes back to the mark that lies `lag` marks before it.
    numbers : array of int, shape (lanes, 6)
        Phase; marks; marks since the motion was last carried on; lag of the period; events at the last look; whether
        the motion has had no events for a while, so that its marks are on a plane.
    plane : array, shape (lanes, 3, n)
        A state, the normal of the plane through it, and (first) its time.
    size : array, shape (lanes, n)
        Largest modulus of each component.
    period : array, shape (lanes, 3)
        Start and duration of what is measured; miss of the last mark, then change of the forces in a period.
    frame : array, shape (lanes, n)
        Velocity of the frame in which the system does not depend on time, but for its drives.
    outcome : array of int, shape (lanes,)
    """

    time: Array
    state: Array
    kind: Array
    miss: Array
    lag: Array
    numbers: Array
    plane: Array
    size: Array
    period: Array
    frame: Array
    outcome: Array


class Limits(NamedTuple):
    """How far a motion is followed: array (t₀, end, time between looks, tolerance, atol), and most marks and events."""

    real: Array
    most: Array


@njit(**OPTIONS)
def remove_shift(v: Array, translation: Array) -> None:
    """Take the part along the translation off a vector."""
    along, size = 0.0, 0.0
    for i in range(len(v)):
        along += translation[i] * v[i]
        size += translation[i] ** 2
    if size > 0.0:
        for i in range(len(v)):
            v[i] -= along / size * translation[i]


@njit(**OPTIONS)
def gap(m: Marks, i: int, j: int, t: float, y: Array, translation: Array, out: Array) -> None:
    """State of a lane minus the remembered one, without frame and translation."""
    for r in range(len(y)):
        out[r] = y[r] - m.state[i, j, r] - m.frame[i, r] * (t - m.time[i, j])
    remove_shift(out, translation)


@njit(**OPTIONS)
def miss(v: Array, size: Array, atol: float) -> float:
    """Largest component of a difference, relative to its size; what is below `atol` does not count."""
    worst = 0.0
    for r in range(len(v)):
        excess = abs(v[r]) - atol
        if excess > 0.0:
            worst = max(worst, excess / size[r])
    return worst


@njit(**OPTIONS)
def grow(m: Marks, i: int, t: float, start: float, y: Array, translation: Array, work: Array) -> None:
    """Keep the largest modulus of every component."""
    for r in range(len(y)):
        work[r] = y[r] - m.frame[i, r] * (t - start)
    remove_shift(work, translation)
    for r in range(len(y)):
        m.size[i, r] = max(m.size[i, r], abs(work[r]))


@njit(**INLINED)
def put_mark(m: Marks, i: int, kind: int, t: float, y: Array, limits: Limits, translation: Array, work: Array) -> bool:
    """Remember a mark; whether the motion has settled, its period being the lag that is left in the numbers."""
    tolerance, atol, count = limits.real[3], limits.real[4], m.numbers[i, 1]
    grow(m, i, t, limits.real[0], y, translation, work[0])
    best, lag = np.inf, 0
    for back in range(1, min(count, RING) + 1):
        j = (count - back) % RING
        if m.kind[i, j] != kind or t - m.time[i, j] <= 1e-12 * (t - limits.real[0]):
            continue
        gap(m, i, j, t, y, translation, work[0])
        d = miss(work[0], m.size[i], atol)
        # The shortest return that is nearly as close as any is the period.
        if d < 0.5 * best and best > SURE * tolerance:
            best, lag = d, back
    here = count % RING
    m.time[i, here], m.kind[i, here], m.miss[i, here], m.lag[i, here] = t, kind, best, lag
    copy(y, m.state[i, here])
    m.numbers[i, 1] += 1
    m.numbers[i, 2] += 1
    m.numbers[i, 3] = lag
    m.period[i, 2] = best
    return lag > 0 and (best <= SURE * tolerance or missing(m, i, here, lag) <= tolerance)


@njit(**OPTIONS)
def factor(m: Marks, i: int, here: int, lag: int) -> float:
    """Factor by which the miss shrinks from return to return; infinite if it is not known yet."""
    before = (here - lag) % RING
    if m.numbers[i, 2] <= 2 * lag or 2 * lag > RING or m.lag[i, before] != lag or not m.miss[i, before] > 0.0:
        return np.inf
    return m.miss[i, here] / m.miss[i, before]


@njit(**OPTIONS)
def missing(m: Marks, i: int, here: int, lag: int) -> float:
    """What is still missing to the cycle: d + dq + dq² + …."""
    q = factor(m, i, here, lag)
    return m.miss[i, here] / (1.0 - q) if q < 1.0 else np.inf


@njit(**INLINED)
def carry_on(m: Marks, i: int, t: float, y: Array, limits: Limits, translation: Array, work: Array) -> None:
    """Carry a slow return on to where its returns lead, if they have shrunk by one factor for a while."""
    lag, here = m.numbers[i, 3], (m.numbers[i, 1] - 1) % RING
    if lag == 0 or m.numbers[i, 2] <= 4 * lag or 4 * lag > RING:
        return
    q, before = factor(m, i, here, lag), (here - lag) % RING
    if not (SLOW < q < 1.0 and m.miss[i, here] * q / (1.0 - q) <= LEAP):
        return
    # The last step of the returns has to be q times the one before, as a vector.
    gap(m, i, (before - lag) % RING, m.time[i, before], m.state[i, before], translation, work[1])
    gap(m, i, before, t, y, translation, work[0])
    for r in range(len(y)):
        work[1, r] = work[0, r] - q * work[1, r]
    if miss(work[1], m.size[i], 0.0) < STRAIGHT * (1.0 - q) * m.miss[i, here]:
        for r in range(len(y)):
            y[r] += q / (1.0 - q) * work[0, r]
        m.numbers[i, 2] = 0


@njit(**INLINED)
def follow(
    e: Engine,
    jets: JETS,
    residual: RESIDUAL,
    slots: int,
    N: int,
    tol: float,
    atol: float,
    i: int,
    end: float,
    max_events: int,
    recording: bool,
    record: Record,
) -> int:
    """The event loop for one lane; its code stays behind. Returns the number of recorded steps."""
    a, b = i, i + 1
    s = e.lanes
    lane = Lane(s.clock[a:b], s.y[a:b], s.mode[a:b], s.settled[a:b], s.reg[a:b], s.counters[a:b])
    e.codes[i] = FULL
    return integrate(
        jets,
        residual,
        e.rows,
        e.space,
        e.flight,
        e.constants,
        e.forms,
        slots,
        N,
        tol,
        atol,
        end,
        max_events,
        e.group[a:b],
        e.codes[a:b],
        lane,
        recording,
        record,
    )


@njit(**OPTIONS)
def copy_lane(source: Lane, i: int, target: Lane, j: int) -> None:
    """Copy where a lane is."""
    copy(source.clock[i], target.clock[j])
    copy(source.y[i], target.y[j])
    copy(source.mode[i], target.mode[j])
    copy(source.settled[i], target.settled[j])
    copy(source.reg[i], target.reg[j])
    copy(source.counters[i], target.counters[j])


@njit(**INLINED)
def dies_out(
    e: Engine, jets: JETS, m: Marks, i: int, tolerance: float, atol: float, look: float, translation: Array, work: Array
) -> bool:
    """Whether the rates of a lane, without frame and translation, are so small that nothing more will change."""
    g, s, space = e.group[i], e.lanes, e.space
    k = Constants(e.constants.K[g], e.constants.M[g], e.constants.C[g], e.constants.J[g], e.constants.omega[g])
    space.known[-1] = 1
    if not resolve(e.rows.sizes, k, space, s.mode[i]):
        return False
    if (
        jets(
            s.clock[i, 0], s.y[i], s.mode[i], s.reg[i], k.K, space.Rq, space.Rz, 1, space.W, space.A, space.B, space.mag
        )
        != OK
    ):
        return False
    for r in range(len(work)):
        work[r] = (space.W[r, 1] - m.frame[i, r]) * look
    remove_shift(work, translation)
    return miss(work, m.size[i], atol) <= tolerance


@njit(**INLINED)
def settle(
    e: Engine,
    jets: JETS,
    residual: RESIDUAL,
    slots: int,
    N: int,
    tol: float,
    atol: float,
    m: Marks,
    limits: Limits,
    driven: Array,
    translation: Array,
    saved: Lane,
    record: Record,
    work: Array,
    i: int,
) -> bool:
    """Follow a lane until it has settled or reached its limits; False if a closed form has to be made first.

    What is to be measured then starts at the saved state, and lasts the period that is left in the marks.
    """
    start, end, look = limits.real[0], limits.real[1], limits.real[2]
    s, numbers = e.lanes, m.numbers[i]
    most_marks, most_events = limits.most[0], limits.most[1]
    while True:
        if driven[i] > 0.0:
            target, events = start + numbers[1] * driven[i], most_events
        else:
            # The next look, at a multiple of the time between looks.
            target = start + look * (np.floor((s.clock[i, 0] - start) / look + 1e-9) + 1.0)
            events = min(s.counters[i, 0] + 1, most_events)
        smooth = numbers[5] == 1
        count = follow(e, jets, residual, slots, N, tol, atol, i, target, events, smooth, record)
        code, t = e.codes[i], s.clock[i, 0]
        if code == NEED:
            return False
        settled, dead = False, False
        if smooth:
            settled = cross_plane(e, jets, m, limits, N, i, record, count, translation, work)
        if code == FINISHED and driven[i] > 0.0:
            settled = put_mark(m, i, 0, t, s.y[i], limits, translation, work)
        elif code == FINISHED:
            grow(m, i, t, start, s.y[i], translation, work[0])
            if s.counters[i, 0] == numbers[4]:
                dead = dies_out(e, jets, m, i, limits.real[3], limits.real[4], look, translation, work[0])
                if not smooth:
                    put_plane(m, i, t, s.y[i], work[0])
            numbers[4] = s.counters[i, 0]
        elif code == LIMIT and s.counters[i, 0] < most_events:
            numbers[5] = 0
            kind = mode_key(s.settled[i], s.reg[i]) * 4096 + s.counters[i, 2]
            settled = put_mark(m, i, kind, t, s.y[i], limits, translation, work)
        elif code != FULL:
            m.outcome[i] = code
            return True
        copy_lane(s, i, saved, i)
        m.period[i, 0], m.period[i, 1] = t, look
        if settled:
            last = numbers[1] - 1
            m.period[i, 1] = m.time[i, last % RING] - m.time[i, (last - numbers[3]) % RING]
            # An oscillation that has died out returns, too.
            dead = driven[i] == 0.0 and dies_out(
                e, jets, m, i, FADED * limits.real[3], limits.real[4], m.period[i, 1], translation, work[0]
            )
        if dead or settled:
            m.outcome[i] = (STEADY if moves(s.mode[i]) else AT_REST) if dead else PERIODIC
            return True
        if t >= end or numbers[1] >= most_marks * max(numbers[3], 1):
            m.outcome[i], m.period[i, 1] = NOT_SETTLED, long_look(m, i, t, look)
            return True
        if code == LIMIT or driven[i] > 0.0:
            carry_on(m, i, t, s.y[i], limits, translation, work)


@njit(**OPTIONS)
def put_plane(m: Marks, i: int, t: float, y: Array, work: Array) -> None:
    """Lay a plane through the present state across the motion, whose rates are in the work space."""
    copy(y, m.plane[i, 0])
    m.plane[i, 2, 0] = t
    for r in range(len(work)):
        m.plane[i, 1, r] = work[r] / m.size[i, r] ** 2 if m.size[i, r] > 0.0 else 0.0
    m.numbers[i, 5] = 1


@njit(**OPTIONS)
def height(m: Marks, i: int, t: float, y: Array, translation: Array, work: Array) -> float:
    """On which side of the plane a state is, and how far."""
    for r in range(len(y)):
        work[r] = y[r] - m.plane[i, 0, r] - m.frame[i, r] * (t - m.plane[i, 2, 0])
    remove_shift(work, translation)
    total = 0.0
    for r in range(len(y)):
        total += m.plane[i, 1, r] * work[r]
    return total


@njit(**INLINED)
def cross_plane(
    e: Engine,
    jets: JETS,
    m: Marks,
    limits: Limits,
    N: int,
    i: int,
    record: Record,
    count: int,
    translation: Array,
    work: Array,
) -> bool:
    """Put a mark wherever one of the recorded Taylor steps passes the plane upwards; whether the motion has settled."""
    g, s, f, settled = e.group[i], e.space, e.flight, False
    k = Constants(e.constants.K[g], e.constants.M[g], e.constants.C[g], e.constants.J[g], e.constants.omega[g])
    for j in range(count):
        last = j + 1 == count
        t, y = record.time[j], record.state[j]
        after = e.lanes.clock[i, 0] if last else record.time[j + 1]
        ahead = height(m, i, after, e.lanes.y[i] if last else record.state[j + 1], translation, work[0])
        if settled or not (height(m, i, t, y, translation, work[0]) <= 0.0 < ahead):
            continue
        copy(record.mode[j], f.mode0)
        copy(record.region[j], f.reg0)
        s.known[-1] = 1
        resolve(e.rows.sizes, k, s, f.mode0)
        jets(t, y, f.mode0, f.reg0, k.K, s.Rq, s.Rz, N, s.W, s.A, s.B, s.mag)
        low, high = 0.0, after - t
        point_on(s.W, N, high, work[1])
        if not abs(height(m, i, after, work[1], translation, work[0]) - ahead) <= 1e-6 * abs(ahead):
            continue  # a flight in closed form: its modes are linear, and have no cycle of their own
        for _ in range(60):
            middle = 0.5 * (low + high)
            point_on(s.W, N, middle, work[1])
            if height(m, i, t + middle, work[1], translation, work[0]) > 0.0:
                high = middle
            else:
                low = middle
        point_on(s.W, N, high, s.trial)
        settled = put_mark(m, i, -1, t + high, s.trial, limits, translation, work)
    return settled


@njit(**OPTIONS)
def point_on(W: Array, N: int, h: float, out: Array) -> None:
    """State on a Taylor step."""
    for r in range(len(out)):
        out[r] = horner(W[r], N, h)


@njit(**OPTIONS)
def moves(mode: Array) -> bool:
    """Whether a contact slips (a system without contacts moves, too)."""
    for c in range(len(mode)):
        if mode[c] != 0:
            return True
    return len(mode) == 0


@njit(**OPTIONS)
def long_look(m: Marks, i: int, t: float, look: float) -> float:
    """Duration from the oldest remembered mark of the same kind as the last one."""
    count = m.numbers[i, 1]
    for back in range(min(count, RING), 0, -1):
        j = (count - back) % RING
        if m.kind[i, j] == m.kind[i, (count - 1) % RING] and m.time[i, j] < t:
            return t - m.time[i, j]
    return look
