"""Motions without events in compiled code: their returns to a plane transverse to them."""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.motion.algebra.roots import horner
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import CAUSE, LAST, NOW, SERIES, Instant, Lane
from stickslip.motion.steps.step_size import better
from stickslip.motion.steps.stiff import follow_mode as along
from stickslip.orbits.settling.engine.lanes import copy_lane, own_flow
from stickslip.orbits.settling.engine.leaping import CARRIED_ON, GO_ON, consider
from stickslip.orbits.settling.engine.returns import begin_again, remember, remove_cells
from stickslip.orbits.settling.engine.tables import (
    COUNT,
    EVENTLESS,
    LEAPT,
    STRIDE,
    Bench,
    Engine,
    Marks,
    Rules,
)
from stickslip.translator import compiled

_AT_ONCE = 1e-3  # fraction of a period: an earlier return does not count
# largest relative error of a height at the end of a Taylor step; larger for a flight
_MISSES = 1e-6


@compiled()
def put_plane(m: Marks, i: int, t: float, y: Array, work: Array) -> None:
    """Define a plane through the present state, normal to the motion, whose rates are in the work
    space.

    Parameters
    ----------
    m : Marks
        Receive the plane.
    y : array, shape (n,)
        Time and state.
    work : array, shape (n,)
        The rates, up to a factor.
    """
    copy(y, m.plane[i, 0])
    m.plane[i, 2, 0] = t
    for r in range(len(work)):
        m.plane[i, 1, r] = work[r] / m.size[i, r] ** 2 if m.size[i, r] > 0.0 else 0.0
    m.numbers[i, EVENTLESS] = 1
    m.numbers[i, STRIDE] = 0
    begin_again(m, i, 0)


@compiled()
def height(m: Marks, rules: Rules, i: int, t: float, y: Array, work: Array) -> float:
    """Signed distance of a state from the plane.

    Parameters
    ----------
    y : array, shape (n,)
        Time and state.
    work : array, shape (n,)
    """
    for r in range(len(y)):
        work[r] = y[r] - m.plane[i, 0, r] - m.frame[i, r] * (t - m.plane[i, 2, 0])
    remove_cells(work, m, rules, i)
    total = 0.0
    for r in range(len(y)):
        total += m.plane[i, 1, r] * work[r]
    return total


@compiled()
def cross_plane(
    e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, i: int, count: int
) -> int:
    """Add a mark at each upward crossing of the plane in the recorded Taylor steps, and evaluate
    it.

    An extrapolated motion restarts from there.

    Parameters
    ----------
    i, count : int
        The lane, and the number of recorded steps.

    Returns
    -------
    int
        GO_ON, CARRIED_ON or SETTLED.
    """
    flow = own_flow(e, i)
    s = flow.space
    f = e.flight
    N = flow.order
    verdict = GO_ON
    record = bench.record
    work = bench.work
    lanes = e.lanes
    for j in range(count):
        if verdict != GO_ON:
            continue
        last = j + 1 == count
        t, y = record.time[j], record.state[j]
        after = lanes.clock[i, NOW] if last else record.time[j + 1]
        ahead = height(m, rules, i, after, lanes.y[i] if last else record.state[j + 1], work[0])
        if not (height(m, rules, i, t, y, work[0]) <= 0.0 < ahead):
            continue
        copy(record.mode[j], f.mode0)
        copy(record.region[j], f.reg0)
        s.known[-1] = 1
        resolve(flow.rows, flow.k, s, f.mode0)
        low = 0.0
        high = after - t
        s.W[len(y), 1] = better(high, 1.0)
        start = Instant(t, y, f.mode0, f.reg0)
        _, step, series = along(e.machine, flow, start, high, 0.0, lanes.seen[i])
        unit = s.W[len(y), 1]
        point_on(s.W, N, high / unit, work[1])
        if not abs(height(m, rules, i, after, work[1], work[0]) - ahead) <= _MISSES * abs(ahead):
            # a flight in closed form: its modes are linear, and have no cycle of their own
            continue
        for _ in range(60):
            middle = 0.5 * (low + high)
            point_on(s.W, N, middle / unit, work[1])
            if height(m, rules, i, t + middle, work[1], work[0]) > 0.0:
                high = middle
            else:
                low = middle
        if m.numbers[i, LEAPT] > 0 and starts_in_plane(m, i, t + high):
            continue
        point_on(s.W, N, high / unit, s.trial)
        remember(m, i, -1, 0, t + high, s.trial)
        copy_lane(lanes, i, saved, i)
        put_at(saved, i, t + high, after - t, s.trial, f.mode0, f.reg0)
        saved.clock[i, SERIES] = series if step > series else after - t
        verdict = consider(m, rules, lanes, saved, bench.work, bench.fit, i)
        if verdict == GO_ON and m.numbers[i, LEAPT] > 0:
            copy_lane(saved, i, lanes, i)
            verdict = CARRIED_ON
    return verdict


@compiled()
def starts_in_plane(m: Marks, i: int, t: float) -> bool:
    """Return whether an extrapolated motion, which starts in the plane up to rounding, is still in
    it at a time."""
    ring = m.time.shape[1]
    last = m.numbers[i, COUNT] - 1
    start = m.time[i, last % ring]
    return t - start < _AT_ONCE * (start - m.time[i, (last - 1) % ring])


@compiled()
def put_at(
    lanes: Lane, i: int, t: float, step: float, y: Array, mode: Array, region: Array
) -> None:
    """Set a lane to a point within a step.

    Parameters
    ----------
    lanes : Lane
        Receive the point.
    t, step : float
        Time, and length of the step.
    y : array, shape (n,)
    mode, region : arrays of int, shapes (contacts,), (kinks,)
    """
    lanes.clock[i, NOW] = t
    lanes.clock[i, LAST] = step
    lanes.counters[i, CAUSE] = -1
    copy(y, lanes.y[i])
    copy(mode, lanes.mode[i])
    copy(mode, lanes.settled[i])
    copy(region, lanes.reg[i])


@compiled()
def point_on(W: Array, N: int, x: float, out: Array) -> None:
    """State on a Taylor step, after a time in the unit of its coefficients."""
    for r in range(len(out)):
        out[r] = horner(W[r], N, x)
