"""The event loop: closed-form flights where modes are affine, Taylor steps elsewhere.

All functions are scalar loops over preallocated arrays.
"""

from __future__ import annotations

import numpy as np

from stickslip.machine_code import njit
from stickslip.motion.engine import flights
from stickslip.motion.engine.forms import AFFINE, GERM_ORDERS, ClosedForms, Flight
from stickslip.motion.engine.guards import first_event, resting
from stickslip.motion.engine.modes import copy, flip, keeps, let_slide, resolve, settle
from stickslip.motion.engine.roots import arrive
from stickslip.motion.steps.arrays import (
    ASTRAY,
    CAUSE,
    CROSSED,
    DIMENSION,
    FINISHED,
    FULL,
    HAPPENED,
    INADMISSIBLE,
    INERTIAL,
    INLINED,
    JETS,
    LAST,
    LIMIT,
    LONG_AGO,
    NAN,
    NEED,
    NEGATIVE,
    NO_RATE,
    NONE_YET,
    NOW,
    NOWHERE,
    OK,
    ON_INERTIAL,
    ON_JUMP,
    ON_VISCOUS,
    OPTIONS,
    RATE_INDEPENDENT,
    RECENT,
    RESIDUAL,
    SERIES,
    STEPS,
    SWITCHES,
    TAKEN,
    TINY,
    UNDEFINED,
    VISCOUS,
    ZENO,
    ZERO,
    Constants,
    Lane,
    Record,
    Rows,
    Space,
)
from stickslip.motion.steps.step_size import fill_powers
from stickslip.motion.steps.structure import is_affine

Array = np.ndarray

ZENO_EVENTS = 200
CLOSEST = 1e-15  # relative difference of times that can be told apart


@njit(**OPTIONS)
def integrate(
    jets: JETS,
    residual: RESIDUAL,
    rows: Rows,
    space: Space,
    flight: Flight,
    constants: Constants,
    forms: ClosedForms,
    slots: int,
    N: int,
    tol: float,
    atol: float,
    end: float,
    max_events: int,
    group: Array,
    codes: Array,
    lanes: Lane,
    recording: bool,
    record: Record,
) -> int:
    """Follow motions, lane by lane, until `end`, until the record is full, or until a closed form
    has to be made.

    Parameters
    ----------
    constants : Constants
        By group of lanes with the same parameters (a leading axis).
    forms, slots
        Closed forms, and the number of slots of each group (0: Taylor steps only).
    N, tol, atol
        Order of the Taylor series, and local tolerance relative to the size of the state plus
        `atol`.
    group : array of int, shape (lanes,)
    codes : array of int, shape (lanes,)
        FULL, NEED or STEPS where a lane is to go on; receives the outcome code.
    lanes : Lane
        Of all lanes (a leading axis).
    recording : bool
        Whether to record the steps (of a single lane).

    Returns
    -------
    int
        Number of recorded steps.
    """
    count = ZERO
    for i in range(len(codes)):
        if codes[i] < FULL:
            continue
        g = group[i]
        k = Constants(
            constants.K[g], constants.M[g], constants.C[g], constants.J[g], constants.omega[g]
        )
        lane = lane_of(lanes, i)
        space.known[-1] = 1
        code = NOWHERE
        flying = slots > 0 and codes[i] != STEPS
        while code < 0:
            if flying:
                code, count = fly_on(
                    forms,
                    g,
                    slots,
                    flight,
                    rows,
                    k.omega,
                    lane,
                    end,
                    max_events,
                    recording,
                    record,
                    count,
                )
            if code < 0:
                code, count = step_on(
                    jets,
                    residual,
                    rows,
                    k,
                    space,
                    N,
                    tol,
                    atol,
                    lane,
                    end,
                    max_events,
                    recording,
                    record,
                    count,
                )
                flying = slots > 0
        codes[i] = code
    return count


@njit(**OPTIONS)
def integrate_affine(
    rows: Rows,
    constants: Constants,
    forms: ClosedForms,
    slots: int,
    flight: Flight,
    end: float,
    max_events: int,
    group: Array,
    codes: Array,
    lanes: Lane,
    recording: bool,
    record: Record,
) -> int:
    """The same as :func:`integrate` in closed form alone: a motion that needs Taylor steps is left
    with code STEPS.

    Most systems with closed forms need nothing else, and need not wait until the Taylor steps are
    compiled.
    """
    count = ZERO
    for i in range(len(codes)):
        if codes[i] < FULL:
            continue
        g = group[i]
        lane = lane_of(lanes, i)
        code, count = fly_on(
            forms,
            g,
            slots,
            flight,
            rows,
            constants.omega[g],
            lane,
            end,
            max_events,
            recording,
            record,
            count,
        )
        codes[i] = code if code >= 0 else STEPS
    return count


@njit(**INLINED)
def lane_of(lanes: Lane, i: int) -> Lane:
    """One of many lanes."""
    return Lane(
        lanes.clock[i],
        lanes.y[i],
        lanes.seen[i],
        lanes.mode[i],
        lanes.settled[i],
        lanes.reg[i],
        lanes.counters[i],
    )


@njit(**INLINED)
def step_on(
    jets: JETS,
    residual: RESIDUAL,
    rows: Rows,
    k: Constants,
    space: Space,
    N: int,
    tol: float,
    atol: float,
    lane: Lane,
    end: float,
    max_events: int,
    recording: bool,
    record: Record,
    count: int,
) -> tuple[int, int]:
    """Taylor steps up to and including the next event: (outcome code or −1, recorded steps)."""
    clock = lane.clock
    counters = lane.counters
    y = lane.y
    nk = len(rows.kinks)
    room = np.inf
    again = False
    promised = 0.0
    t0 = 0.0
    last = 0.0
    before = 0.0
    recent = 0.0
    cause = NOWHERE
    while True:
        if recording and count == len(record.time) and not again:
            return FULL, count
        t, fired = clock[NOW], counters[CAUSE]
        hold = fired >= 0 or counters[TAKEN] % 64 == 0
        status, h, series, may_fire = settle(
            jets,
            residual,
            rows,
            k,
            space,
            N,
            tol,
            atol,
            lane,
            min(room, max(end - t, 0.0)),
            hold,
            promised,
        )
        if status == ASTRAY:
            clock[NOW] = t0
            clock[LAST] = last
            clock[SERIES] = before
            clock[RECENT] = recent
            counters[CAUSE] = cause
            counters[TAKEN] -= 1
            copy(space.promise[1], y)
            room = 0.25 * promised
            again = True
            promised = 0.0
            continue
        if status != OK:
            # No mode goes on from here; what the contacts did last is kept, not the last attempt.
            for i in range(len(lane.mode)):
                lane.mode[i] = lane.settled[i] if lane.settled[i] != NONE_YET else 0
        if not again:
            count = note(lane, recording, record, count)
        if status == NAN:
            if recording and fired < 0 and count > 1:
                # The last step has left the domain of a formula: its end is no state of the motion.
                count -= 1
                clock[NOW] = record.time[count - 1]
                copy(record.state[count - 1], y)
            return UNDEFINED, count
        if status != OK:
            return (ON_JUMP if rows.sizes[RATE_INDEPENDENT] == 0 else NO_RATE), count
        if t >= end:
            return FINISHED, count
        if h <= CLOSEST * abs(t) and h < end - t:
            # The rate of a sliding rate-independent coordinate runs away where its branch of
            # equilibria ends.
            sliding = False
            for c in range(rows.sizes[ON_INERTIAL] + rows.sizes[ON_VISCOUS], len(rows.u)):
                sliding = sliding or lane.mode[c] != 0
            return (NO_RATE if sliding else TINY), count
        x, which = first_event(space, may_fire, N)
        forbidden = which - nk - 2 * len(rows.u)  # what has become negative, though it must not
        if forbidden >= 0 and x == 0.0:
            return (NEGATIVE if rows.doubtful[forbidden, 1] < 0 else INADMISSIBLE), count
        if x < 1.0:
            fill_powers(space.powers, x * h / space.W[len(y), 1])
        for i in range(len(y)):
            space.trial[i], space.promise[0, i] = arrive(space.W[i], N, space.powers)
        # The next step begins with the rates at the end of this one, unless something comes in
        # between.
        promised = x * h
        if (
            which >= 0
            or (counters[TAKEN] + 1) % 64 == 0
            or rows.sizes[RATE_INDEPENDENT] > 0
            or (recording and count == len(record.time))
        ):
            if not solves(jets, rows, k, space, 1e4 * tol, atol, t, x * h, lane):
                room = 0.25 * x * h
                again = True
                promised = 0.0
                continue
            promised = 0.0
        t0 = t
        last = clock[LAST]
        before = clock[SERIES]
        recent = clock[RECENT]
        cause = fired
        copy(y, space.promise[1])
        copy(space.trial, y)
        room = np.inf
        again = False
        counters[TAKEN] += 1
        clock[LAST], clock[SERIES], clock[RECENT] = h, series, max(series, 0.5 * clock[RECENT])
        clock[NOW] = end if which < 0 and h >= end - t else t + x * h
        counters[CAUSE] = -1
        if forbidden >= 0:
            return (NEGATIVE if rows.doubtful[forbidden, 1] < 0 else INADMISSIBLE), count
        if which >= 0:
            return fire(which, lane, rows, max_events), count


@njit(**INLINED)
def solves(
    jets: JETS,
    rows: Rows,
    k: Constants,
    space: Space,
    tol: float,
    atol: float,
    t: float,
    h: float,
    lane: Lane,
) -> bool:
    """Whether the rates at the end of a step are those that its series promises."""
    y, V = space.trial, space.V
    if (
        jets(
            t + h,
            y,
            lane.mode,
            lane.reg,
            k.K,
            space.Rq,
            space.Rz,
            1,
            V,
            space.A,
            space.B,
            space.mag,
        )
        != OK
    ):
        return True  # the rates are not determined here, which the next step finds out
    return keeps(rows, V, space.mag, space.promise[0], y, lane.seen, h, tol, atol)


@njit(**OPTIONS)
def fly_on(
    T: ClosedForms,
    g: int,
    slots: int,
    flight: Flight,
    rows: Rows,
    omega: Array,
    lane: Lane,
    end: float,
    max_events: int,
    recording: bool,
    record: Record,
    count: int,
) -> tuple[int, int]:
    """Closed-form flights from event to event, as long as the modes are flights.

    Returns
    -------
    code, count
        Outcome code, FULL, NEED if the closed form of the present mode is to be made, or −1 where
        Taylor steps go on.
    """
    clock = lane.clock
    y = lane.y
    mode = lane.mode
    reg = lane.reg
    counters = lane.counters
    nc = len(mode)
    nk = len(reg)
    drops = rows.drops
    several = total(rows.drops) > 1
    flown, fallen = -1, -1
    while True:
        if recording and count == len(record.time):
            return FULL, count
        t, fired = clock[NOW], counters[CAUSE]
        for c in range(nc):
            if abs(mode[c]) == 2 and fired != nk + c:
                return -1, count  # others carry it
        copy(mode, flight.mode0)
        copy(reg, flight.reg0)
        let_slide(mode)
        flights.place(flight, y, t, omega)
        slot = -1
        ready = False
        for _ in range(2 * (nk + nc) + 4):
            slot = flights.find(T.key, T.own, g * slots, T.used[g], flights.mode_key(mode, reg))
            if slot < 0:
                if T.used[g] < slots:
                    return NEED, count
                break
            if T.status[slot] != AFFINE or not flights.admissible(
                T, slot, flight, y, clock[RECENT]
            ):
                break
            guard = flights.germs(T, slot, flight, omega, fired, nk, clock[LAST])
            if guard < 0:
                ready = not carries(T, slot, flight, mode, nk, drops)
                break
            number = T.switch[slot, guard]
            c = (number - nk) // 2
            # Which of several contacts break their thresholds together is not decided here.
            if number >= nk + 2 * nc or (
                several and number >= nk and drops[c] == 1 and mode[c] == 0
            ):
                break
            flip(number, mode, reg, nk, drops)
            let_slide(mode)
        if not ready:
            copy(flight.mode0, mode)
            copy(flight.reg0, reg)
            if fired >= 0 and fired < nk and fallen >= 0:
                clock[NOW] = t + flights.land(T, flown, flight, fallen, y, clock[LAST])
            return -1, count
        count = note(lane, recording, record, count)
        if t >= end:
            return FINISHED, count
        tau, guard = flights.fly(T, slot, flight, end - t, omega)
        counters[TAKEN] += 1
        clock[LAST], clock[SERIES], clock[RECENT] = tau, tau, max(tau, 0.5 * clock[RECENT])
        clock[NOW] = t + tau if guard >= 0 else end
        flights.arrive(T, slot, flight, y, tau, omega)
        counters[CAUSE] = -1
        flown = slot
        fallen = guard
        if guard < 0:
            continue
        if T.switch[slot, guard] >= nk + 2 * nc:
            return -1, count
        code = fire(T.switch[slot, guard], lane, rows, max_events)
        if code >= 0:
            return code, count


@njit(**INLINED)
def carries(T: ClosedForms, slot: int, flight: Flight, mode: Array, nk: int, drops: Array) -> bool:
    """Whether a contact that does not stick and whose sliding force is not its threshold may be
    carried by others."""
    if len(mode) > 1:
        for g in range(T.counts[slot, 1]):
            c = (T.switch[slot, g] - nk) // 2
            if (
                0 <= c < len(mode)
                and flight.orders[g] >= GERM_ORDERS
                and mode[c] != 0
                and drops[c] == 1
            ):
                return True
    return False


@njit(**OPTIONS)
def total(numbers: Array) -> int:
    """Sum of whole numbers."""
    found = 0
    for number in numbers:
        found += number
    return found


@njit(**INLINED)
def note(lane: Lane, recording: bool, record: Record, count: int) -> int:
    """Record where a lane is, and count the switches that brought it there."""
    if recording:
        record.time[count], record.cause[count] = lane.clock[NOW], lane.counters[CAUSE]
        copy(lane.y, record.state[count])
        copy(lane.mode, record.mode[count])
        copy(lane.reg, record.region[count])
        count += 1
    for i in range(len(lane.mode)):
        if lane.settled[i] != lane.mode[i]:
            seen = lane.settled[i] != NONE_YET and not (
                resting(lane.settled[i]) and resting(lane.mode[i])
            )
            lane.counters[SWITCHES] += 1 if seen else 0
            lane.settled[i] = lane.mode[i]
    return count


@njit(**INLINED)
def fire(guard: int, lane: Lane, rows: Rows, max_events: int) -> int:
    """Count an event and give its switch the other state; an outcome code if the motion ends here,
    else −1."""
    clock = lane.clock
    counters = lane.counters
    nk = len(rows.kinks)
    fired = flip(guard, lane.mode, lane.reg, nk, rows.drops)
    if fired < nk and rows.vanishing[fired] >= 0:
        lane.y[rows.vanishing[fired]] = 0.0
    counters[CAUSE] = fired
    counters[HAPPENED] += 1
    counters[CROSSED] += 1 if fired < nk else 0
    if counters[HAPPENED] % ZENO_EVENTS == 0:
        if clock[NOW] - clock[LONG_AGO] <= 1e2 * CLOSEST * abs(clock[NOW]):
            return ZENO
        clock[LONG_AGO] = clock[NOW]
    return LIMIT if counters[HAPPENED] >= max_events else -1


@njit(**OPTIONS)
def probe(
    jets: JETS,
    rows: Rows,
    k: Constants,
    space: Space,
    mode: Array,
    reg: Array,
    times: Array,
    states: Array,
    out: Array,
    hold: Array,
) -> bool:
    """Rates of the state, then u, λ, s⁺, s⁻ and guards of a mode at some times and states.

    False if the mode is not affine, or if not all are finite.

    `hold` receives the columns that put the velocities of sticking inertial contacts back onto
    their surface, and the acceleration that a unit of force gives to each.
    """
    sizes = rows.sizes
    W = space.W
    mag = space.mag
    n = sizes[DIMENSION]
    nq = sizes[INERTIAL]
    nz = sizes[VISCOUS]
    nr = sizes[RATE_INDEPENDENT]
    mq = sizes[ON_INERTIAL]
    nc, nk = len(rows.u), len(rows.kinks)
    space.known[-1] = 1
    W[n, 1] = 1.0
    if not resolve(sizes, k, space, mode):
        return False
    for c in range(mq):
        for i in range(nq):
            hold[c, i] = space.Rq[i, nq + c] if mode[c] == 0 else 0.0
        hold[c, nq] = 1.0 / abs(space.Rq[nq + c, nq + c]) if mode[c] == 0 else 0.0
    for p in range(len(times)):
        if (
            jets(
                times[p], states[p], mode, reg, k.K, space.Rq, space.Rz, 1, W, space.A, space.B, mag
            )
            != OK
        ):
            return False
        if p == 0 and not is_affine(rows, k, space, mode, reg):
            return False
        for i in range(n):
            out[p, i] = W[i, 1]
        for c in range(nc):
            out[p, n + c] = settle_zero(W[rows.u[c], 0], mag[c])
            out[p, n + nc + c] = W[rows.force[c], 0]
            out[p, n + 2 * nc + c] = W[rows.plus[c], 0]
            out[p, n + 3 * nc + c] = W[rows.minus[c], 0]
        for j in range(nk):
            out[p, n + 4 * nc + j] = W[rows.kinks[j], 0]
        for d in range(len(rows.doubtful)):
            out[p, n + 4 * nc + nk + d] = W[rows.doubtful[d, 0], 0]
        for i in range(nq + nz + nr):
            out[p, nq + i] = settle_zero(out[p, nq + i], mag[3 * nc + nk + i])
        for i in range(n + 4 * nc + nk + len(rows.doubtful)):
            if not np.isfinite(out[p, i]):
                return False
    return True


@njit(**OPTIONS)
def settle_zero(value: float, size: float) -> float:
    """The value, or 0 if it is only the rounding error of terms of a size."""
    return 0.0 if abs(value) <= 1e-15 * size else value
