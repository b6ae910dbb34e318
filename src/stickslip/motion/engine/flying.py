"""Closed-form flights from event to event, as long as modes are affine.

:mod:`stickslip.motion.affine.flights` follows one flight. Here modes are chosen by means of their
closed forms, which are made where a motion first enters them
(:mod:`stickslip.motion.affine.closed_forms`). What these cannot decide is left to Taylor steps.
"""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.motion.affine import flights
from stickslip.motion.affine.closed_forms import make_form
from stickslip.motion.affine.forms import (
    AFFINE,
    FEW_COMPONENTS,
    GUARDS,
    LEADING_ORDERS,
    ClosedForms,
    Flight,
    form_of,
    slots_of,
)
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.engine.events import count_step, fire, note
from stickslip.motion.engine.jumps import due_jump, passed_jumps
from stickslip.motion.modes.guards import contact_of, requirement_of
from stickslip.motion.modes.pivots import flip, let_slide, may_be_carried
from stickslip.motion.steps.arrays import (
    CAUSE,
    FINISHED,
    FULL,
    LAST,
    NOW,
    RECENT,
    TAKEN,
    Flow,
    Lane,
    Machine,
    Task,
    is_stopped,
)
from stickslip.translator import compiled

# the mode of the motion has not been examined; otherwise the slot of its closed form
_UNDECIDED = -1


@compiled()
def fly_on(
    machine: Machine,
    flow: Flow,
    g: int,
    T: ClosedForms,
    flight: Flight,
    lane: Lane,
    task: Task,
    count: int,
) -> tuple[int, int]:
    """Closed-form flights from event to event, as long as the modes are flights.

    Parameters
    ----------
    flow : Flow
        Constants by group (a leading axis).
    g : int
        Group of the lane.
    T : ClosedForms
        Receive those of modes that are new.
    count : int
        Steps recorded so far.

    Returns
    -------
    code, count
        Outcome code, FULL, or −1 where Taylor steps go on.
    """
    rows = flow.rows
    omega = flow.k.omega[g]
    clock = lane.clock
    y = lane.y
    mode = lane.mode
    end = task.end
    nc = len(mode)
    nk = len(lane.reg)
    several = total(rows.drops) > 1
    flown, fallen = -1, -1
    while True:
        if (task.recording and count == len(task.record.time)) or is_stopped(flow.space):
            return FULL, count
        t, fired = clock[NOW], lane.counters[CAUSE]
        for c in range(nc):
            if abs(mode[c]) == 2 and fired != nk + c:
                return -1, count  # others carry it
        copy(mode, flight.mode0)
        copy(lane.reg, flight.reg0)
        let_slide(mode)
        flights.place(flight, y, t, omega)
        slot = _UNDECIDED
        if due_jump(rows, fired, lane.reg) < 0:
            slot = decide(machine, flow, g, T, flight, lane, several)
        if lane.counters[TAKEN] > 0 and passed_jumps(rows, flight.reg0, lane.reg)[0] > 0:
            slot = _UNDECIDED
        tau, guard = 0.0, -1
        form = form_of(T, max(slot, 0))
        if slot >= 0 and t < end:
            tau, guard = flights.fly(form, flight, end - t, omega)
            if guard == flights.UNKNOWN or (
                len(y) > FEW_COMPONENTS
                and flights.is_below_rounding(form, flight, y, lane.seen, tau, omega)
            ):
                slot = _UNDECIDED
        if slot == _UNDECIDED:
            copy(flight.mode0, mode)
            copy(flight.reg0, lane.reg)
            if fired >= 0 and fired < nk and fallen >= 0:
                clock[NOW] = t + flights.land(form_of(T, flown), flight, fallen, y, clock[LAST])
            return -1, count
        count = note(rows, lane, task, count)
        if t >= end:
            return FINISHED, count
        count_step(clock, lane.counters, tau, tau, end if guard < 0 and tau >= end - t else t + tau)
        flights.arrive(form, flight, y, tau, omega)
        flown = slot
        fallen = guard
        if guard < 0:
            continue
        number = form.switch[guard]
        if requirement_of(number, nk, nc) >= 0:
            return -1, count
        code = fire(number, lane, rows, flow.space.leaving, task.max_events)
        if code >= 0:
            return code, count


@compiled()
def decide(
    machine: Machine,
    flow: Flow,
    g: int,
    T: ClosedForms,
    flight: Flight,
    lane: Lane,
    several: bool,
) -> int:
    """Find the mode of the motion by pivoting among closed forms: its slot, or UNDECIDED if Taylor
    steps have to decide.

    Parameters
    ----------
    several : bool
        Whether there are several contacts that may be carried at their thresholds.
    """
    clock = lane.clock
    mode = lane.mode
    reg = lane.reg
    drops = flow.rows.drops
    omega = flow.k.omega[g]
    nc = len(mode)
    nk = len(reg)
    for _ in range(2 * (nk + nc) + 4):
        slot = slot_of(machine, flow, g, T, flight, mode, reg)
        if slot < 0:
            return _UNDECIDED
        form = form_of(T, slot)
        if (
            form.status != AFFINE
            or form.flown == 0
            or not flights.admissible(form, flight, lane.y, clock[RECENT])
        ):
            return _UNDECIDED
        fired = lane.counters[CAUSE]
        guard = flights.leading_terms(form, flight, omega, fired, nk, clock[LAST], lane.settled)
        if guard < 0:
            held = carries(form, flight, mode, nk, drops) or (
                total(drops) > 0 and may_be_carried(flow.rows, flow.k.J[g], flow.space, mode)
            )
            return _UNDECIDED if held else slot
        number = form.switch[guard]
        c = contact_of(number, nk)
        # If several contacts break their thresholds together, the choice is not made here.
        if requirement_of(number, nk, nc) >= 0 or (
            several and number >= nk and drops[c] == 1 and mode[c] == 0
        ):
            return _UNDECIDED
        flip(flow.rows, number, mode, reg, flow.space.leaving)
        let_slide(mode)
    return _UNDECIDED


@compiled()
def slot_of(
    machine: Machine,
    flow: Flow,
    g: int,
    T: ClosedForms,
    flight: Flight,
    mode: Array,
    reg: Array,
) -> int:
    """The slot of the closed form of a mode, which is made if it is new; UNDECIDED if there is no
    room.

    Parameters
    ----------
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
        Modes are 0 or ±1.
    """
    slots = slots_of(T)
    key = flights.mode_key(mode, reg)
    slot = flights.find(T.key, T.own, g * slots, T.used[g], key)
    if slot < 0 and T.used[g] < slots:
        slot = g * slots + T.used[g]
        T.key[slot] = key
        T.used[g] += 1
        make_form(machine, flow, g, T, flight.making, slot, mode, reg)
    return int(slot)


@compiled()
def carries(form: ClosedForms, flight: Flight, mode: Array, nk: int, drops: Array) -> bool:
    """Whether a contact that does not stick may be carried by others.

    Parameters
    ----------
    form : ClosedForms
        Of the mode.
    flight : Flight
        With the deciding orders of the guards.
    mode : array of int, shape (contacts,)
    nk : int
        Number of kinks.
    drops : array of int, shape (contacts,)
        As in :class:`stickslip.motion.steps.arrays.Rows`.
    """
    if len(mode) > 1:
        for g in range(form.counts[GUARDS]):
            c = contact_of(form.switch[g], nk)
            if (
                0 <= c < len(mode)
                and flight.orders[g] >= LEADING_ORDERS
                and mode[c] != 0
                and drops[c] == 1
            ):
                return True
    return False


@compiled()
def total(numbers: Array) -> int:
    """Sum of whole numbers."""
    found = 0
    for number in numbers:
        found += number
    return found
