"""Motions followed until they repeat themselves, and one period of what they have settled on: compiled.

A motion is looked at at its *marks*. If it is driven, these are the times t₀ + mP, P the period of the first drive;
if not, its events, where the guard that fires is a natural section; and if it has no events for a while, it is asked
whether its rates have died out, and whether it comes back through the plane across itself. Two marks of the same kind
whose states agree, up to the declared translation and a moving frame, are one period apart.

The misses d of consecutive returns shrink by a factor q, so that the cycle is about d/(1 − q) away: that, not d, has to
be below the tolerance. A slow return that has found its factor is carried on by what is missing.
"""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from numba import njit

from stickslip.motion.affine import mode_key
from stickslip.motion.engine import integrate
from stickslip.motion.kernel import FINISHED, FULL, INLINED, LIMIT, NEED, OK, OPTIONS, Constants, Lane, Record
from stickslip.motion.modes import copy, resolve
from stickslip.motion.outcome import Outcome
from stickslip.motion.roots import horner
from stickslip.sweeps.tables import Bench, Engine, Marks, Rules

Array = np.ndarray

SURE = 1e-4  # of the tolerance: a miss that needs no factor
LEAP = 1e-2  # largest size of what a slow return is carried on by
SLOW = 0.6  # factors above this are slow
STRAIGHT = 0.1  # how much of what remains of a return may be out of line
AT_REST, PERIODIC = int(Outcome.AT_REST.code), int(Outcome.PERIODIC.code)
STEADY, NOT_SETTLED = int(Outcome.STEADY.code), int(Outcome.NOT_SETTLED.code)
UNDAMPED = int(Outcome.UNDAMPED.code)
# Of NumPy's type: numba would compile the event loop a second time for literals.
RECORDED, UNRECORDED = cast(bool, np.bool_(True)), cast(bool, np.bool_(False))
FADED = 100.0  # tolerances that an oscillation may still be away from an equilibrium


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
def put_mark(m: Marks, rules: Rules, i: int, kind: int, t: float, y: Array, work: Array) -> bool:
    """Remember a mark; whether the motion has settled, its period being the lag that is left in the numbers."""
    start, tolerance, atol, translation = rules.real[0], rules.real[3], rules.real[4], rules.translation
    count, ring = m.numbers[i, 1], m.time.shape[1]
    grow(m, i, t, start, y, translation, work[0])
    best, lag = np.inf, 0
    for back in range(1, min(count, ring) + 1):
        j = (count - back) % ring
        if m.kind[i, j] != kind or t - m.time[i, j] <= 1e-12 * (t - start):
            continue
        gap(m, i, j, t, y, translation, work[0])
        d = miss(work[0], m.size[i], atol)
        # The shortest return that is nearly as close as any is the period.
        if d < 0.5 * best and best > SURE * tolerance:
            best, lag = d, back
    here = count % ring
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
    ring = m.time.shape[1]
    before = (here - lag) % ring
    if m.numbers[i, 2] <= 2 * lag or 2 * lag > ring or m.lag[i, before] != lag or not m.miss[i, before] > 0.0:
        return np.inf
    return m.miss[i, here] / m.miss[i, before]


@njit(**OPTIONS)
def missing(m: Marks, i: int, here: int, lag: int) -> float:
    """What is still missing to the cycle: d + dq + dq² + …."""
    q = factor(m, i, here, lag)
    return m.miss[i, here] / (1.0 - q) if q < 1.0 else np.inf


@njit(**INLINED)
def carry_on(m: Marks, i: int, t: float, y: Array, translation: Array, work: Array) -> None:
    """Carry a slow return on to where its returns lead, if they have shrunk by one factor for a while."""
    ring = m.time.shape[1]
    lag, here = m.numbers[i, 3], (m.numbers[i, 1] - 1) % ring
    if lag == 0 or m.numbers[i, 2] <= 4 * lag or 4 * lag > ring:
        return
    q, before = factor(m, i, here, lag), (here - lag) % ring
    if not (SLOW < q < 1.0 and m.miss[i, here] * q / (1.0 - q) <= LEAP):
        return
    # The last step of the returns has to be q times the one before, as a vector.
    gap(m, i, (before - lag) % ring, m.time[i, before], m.state[i, before], translation, work[1])
    gap(m, i, before, t, y, translation, work[0])
    for r in range(len(y)):
        work[1, r] = work[0, r] - q * work[1, r]
    if miss(work[1], m.size[i], 0.0) < STRAIGHT * (1.0 - q) * m.miss[i, here]:
        for r in range(len(y)):
            y[r] += q / (1.0 - q) * work[0, r]
        m.numbers[i, 2] = 0


@njit(**OPTIONS)
def constants_of(e: Engine, i: int) -> Constants:
    """The constants of a lane."""
    k, g = e.constants, e.group[i]
    return Constants(k.K[g], k.M[g], k.C[g], k.J[g], k.omega[g])


@njit(**INLINED)
def follow(e: Engine, i: int, end: float, max_events: int, recording: bool, record: Record) -> int:
    """The event loop for one lane; its code stays behind. Returns the number of recorded steps."""
    a, b = i, i + 1
    s = e.lanes
    lane = Lane(s.clock[a:b], s.y[a:b], s.seen[a:b], s.mode[a:b], s.settled[a:b], s.reg[a:b], s.counters[a:b])
    e.codes[i] = FULL
    return integrate(
        e.jets, e.residual, e.rows, e.space, e.flight, e.constants, e.forms, e.slots, e.order, e.tolerance, e.atol,
        end, max_events, e.group[a:b], e.codes[a:b], lane, recording, record,
    )  # fmt: skip


@njit(**OPTIONS)
def copy_lane(source: Lane, i: int, target: Lane, j: int) -> None:
    """Copy where a lane is."""
    copy(source.clock[i], target.clock[j])
    copy(source.y[i], target.y[j])
    copy(source.seen[i], target.seen[j])
    copy(source.mode[i], target.mode[j])
    copy(source.settled[i], target.settled[j])
    copy(source.reg[i], target.reg[j])
    copy(source.counters[i], target.counters[j])


@njit(**INLINED)
def dies_out(e: Engine, m: Marks, rules: Rules, i: int, tolerance: float, look: float, work: Array) -> bool:
    """Whether the rates of a lane, without frame and translation, are so small that nothing more will change."""
    k, s, w = constants_of(e, i), e.lanes, e.space
    w.known[-1], w.W[len(work), 1] = 1, 1.0
    if not resolve(e.rows.sizes, k, w, s.mode[i]):
        return False
    if e.jets(s.clock[i, 0], s.y[i], s.mode[i], s.reg[i], k.K, w.Rq, w.Rz, 1, w.W, w.A, w.B, w.mag) != OK:
        return False
    for r in range(len(work)):
        work[r] = (w.W[r, 1] - m.frame[i, r]) * look
    remove_shift(work, rules.translation)
    return miss(work, m.size[i], rules.real[4]) <= tolerance


@njit(**INLINED)
def settle(e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, stop: Array, i: int) -> bool:
    """Follow a lane until it has settled or reached its limits; False if it has to go on in another call.

    That is if a closed form has to be made first, or if there is a wish to stop. What is to be measured then starts at
    the saved state, and lasts the period that is left in the marks.
    """
    start, end, look, tolerance = rules.real[0], rules.real[1], rules.real[2], rules.real[3]
    s, numbers, work, drive, ring = e.lanes, m.numbers[i], bench.work, m.drive[i], m.time.shape[1]
    most_marks, most_events = rules.most[0], rules.most[1]
    for _ in range(rules.most[2]):
        if stop[0] != 0:
            return False
        if drive > 0.0:
            target, events = start + numbers[1] * drive, most_events
        else:
            # The next look, at a multiple of the time between looks.
            target = start + look * (math.floor((s.clock[i, 0] - start) / look + 1e-9) + 1.0)
            events = min(s.counters[i, 0] + 1, most_events)
        smooth = numbers[5] == 1
        count = follow(e, i, target, events, smooth, bench.record)
        code, t = e.codes[i], s.clock[i, 0]
        if code == NEED:
            return False
        settled, dead = False, False
        if smooth:
            settled = cross_plane(e, m, rules, bench, i, count)
        if code == FINISHED and drive > 0.0:
            settled = put_mark(m, rules, i, 0, t, s.y[i], work)
        elif code == FINISHED:
            grow(m, i, t, start, s.y[i], rules.translation, work[0])
            if s.counters[i, 0] == numbers[4]:
                dead = dies_out(e, m, rules, i, tolerance, look, work[0])
                if not smooth:
                    put_plane(m, i, t, s.y[i], work[0])
            numbers[4] = s.counters[i, 0]
        elif code == LIMIT and s.counters[i, 0] < most_events:
            numbers[5] = 0
            kind = mode_key(s.settled[i], s.reg[i]) * 4096 + s.counters[i, 2]
            settled = put_mark(m, rules, i, kind, t, s.y[i], work)
        elif code != FULL:
            m.outcome[i] = code
            return True
        copy_lane(s, i, saved, i)
        m.period[i, 0], m.period[i, 1] = t, look
        if settled:
            last = numbers[1] - 1
            m.period[i, 1] = m.time[i, last % ring] - m.time[i, (last - numbers[3]) % ring]
            # An oscillation that has died out returns, too.
            dead = drive == 0.0 and dies_out(e, m, rules, i, FADED * tolerance, m.period[i, 1], work[0])
        if dead or settled:
            m.outcome[i] = (STEADY if moves(s.mode[i]) else AT_REST) if dead else PERIODIC
            return True
        if t >= end or numbers[1] >= most_marks * max(numbers[3], 1):
            m.outcome[i] = UNDAMPED if numbers[5] == 1 and moves(s.mode[i]) else NOT_SETTLED
            m.period[i, 1] = long_look(m, i, t, look)
            return True
        if code == LIMIT or drive > 0.0:
            carry_on(m, i, t, s.y[i], rules.translation, work)
    return False


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
def cross_plane(e: Engine, m: Marks, rules: Rules, bench: Bench, i: int, count: int) -> bool:
    """Put a mark wherever one of the recorded Taylor steps passes the plane upwards; whether the motion has settled."""
    k, s, f, N, settled = constants_of(e, i), e.space, e.flight, e.order, False
    record, translation, work = bench.record, rules.translation, bench.work
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
        s.W[len(y), 1] = 1.0
        e.jets(t, y, f.mode0, f.reg0, k.K, s.Rq, s.Rz, N, s.W, s.A, s.B, s.mag)
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
        settled = put_mark(m, rules, i, -1, t + high, s.trial, work)
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
    count, ring = m.numbers[i, 1], m.time.shape[1]
    for back in range(min(count, ring), 0, -1):
        j = (count - back) % ring
        if m.kind[i, j] == m.kind[i, (count - 1) % ring] and m.time[i, j] < t:
            return t - m.time[i, j]
    return look
