"""The event loop: closed-form flights where modes are affine (:mod:`.flying`), Taylor steps
elsewhere, and :mod:`.events` between them.

A step ends at an event, or where its series is no longer accurate. The rates at its end are
compared with those predicted by the series: at the beginning of the next step, or immediately if an
event intervenes. If they differ, the step is repeated with a smaller size.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, IntMatrix, IntVector, Many
from stickslip.equations.codegen.series import INDEFINITE
from stickslip.machine_code.functions import entry_point
from stickslip.motion.affine.forms import ClosedForms, Flight, slots_of
from stickslip.motion.algebra.roots import value_and_slope
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.engine.events import (
    count_step,
    fire,
    has_gaps,
    jump_and_collide,
    look_at_jumps,
    note,
)
from stickslip.motion.engine.flying import fly_on, slot_of
from stickslip.motion.engine.impacts import is_paradox
from stickslip.motion.modes.guards import contact_of, first_event, guard_at, requirement_of
from stickslip.motion.modes.mode_series import matches_prediction
from stickslip.motion.modes.resting import settle
from stickslip.motion.steps.arrays import (
    AIM_SPEED,
    AU_SIZE,
    CAUSE,
    DIMENSION,
    FINISHED,
    FULL,
    INADMISSIBLE,
    LAST,
    LEAD,
    NAN,
    NEGATIVE,
    NO_ACCELERATION,
    NO_INERTIA,
    NO_MODE,
    NO_RATE,
    NONE_YET,
    NOW,
    NOWHERE,
    OK,
    ON_INERTIAL,
    ON_JUMP,
    ON_VISCOUS,
    OUTSIDE_TABLE,
    PREDICTED,
    RATE_INDEPENDENT,
    RECENT,
    REJECTED,
    SERIES,
    SLIPPING,
    SPAN,
    STARTED,
    TAKEN,
    TINY,
    UNDEFINED,
    Flow,
    FlowOfMany,
    Instant,
    Lane,
    Machine,
    Rows,
    Space,
    Task,
    flow_of,
    is_stopped,
)
from stickslip.motion.steps.contacts import set_mode
from stickslip.motion.steps.directions import take_direction
from stickslip.motion.steps.sets import may_share, slides_in_plane, slips_with_mass
from stickslip.motion.steps.starting import coefficients
from stickslip.motion.steps.step_size import fill_powers, slip_end
from stickslip.numerics.levels import CLOSEST, INSTANT, ROUNDING
from stickslip.symbolic.tape import DIRECTION_GIVEN
from stickslip.translator import compiled, row_of

_NO_TIME = 1e-60  # part of the time span: shorter than any step, where the clock is at 0
# Number of steps between checks of the predicted rates, and corrections of sticking contacts to the
# surface speed. Steps shrink toward the end of a slip in a plane; the mean of recent steps, with
# weights that halve, then has to show the drift of sticking contacts by rounding errors.
_LOOK, _LOOK_IN_PLANE = 64, 16
# Rounding errors below which a slip has come to rest: more than those of its speed at the end of a
# step, so that no slip is at rest where the next step begins.
_AT_REST = 2.0
_CUT = 0.25  # factor by which a step that did not solve the equations is shortened


class Before(NamedTuple):
    """The clock before a step, for the repetition of a step."""

    t: float
    last: float
    series: float
    recent: float
    cause: int


@entry_point()
def prepare_flights(
    machine: Machine,
    flow: FlowOfMany,
    flight: Flight,
    forms: ClosedForms,
    modes: IntMatrix,
    regions: IntMatrix,
) -> None:
    """Compute the closed forms of some modes in advance.

    Parameters
    ----------
    flow : Flow
        Constants of one group (a leading axis).
    modes, regions : arrays of int, shapes (modes, contacts), (modes, kinks)
        Modes are 0 or ±1.
    """
    for i in range(len(modes)):
        if is_stopped(flow.space):
            return
        slot_of(machine, flow, 0, forms, flight, modes[i], regions[i])


@entry_point()
def integrate(
    machine: Machine,
    flow: FlowOfMany,
    flight: Flight,
    forms: ClosedForms,
    group: IntVector,
    codes: IntVector,
    lanes: Many[Lane],
    task: Task,
) -> int:
    """Follow motions, lane by lane, until the end or until the record is full.

    Parameters
    ----------
    flow : Flow
        Constants by group of lanes with the same parameters (a leading axis).
    forms : ClosedForms
        Without slots: Taylor steps only.
    group : array of int, shape (lanes,)
    codes : array of int, shape (lanes,)
        FULL for lanes that are to continue; receives the outcome code, or FULL if the record is
        full or a stop was requested.
    lanes : Lane
        All lanes (a leading axis).

    Returns
    -------
    int
        Number of recorded steps.
    """
    count = 0
    closed = slots_of(forms) > 0
    for i in range(len(codes)):
        if codes[i] < FULL:
            continue
        own = flow_of(flow, group[i])
        lane = row_of(lanes, i)
        own.space.known[-1] = 1
        code = NOWHERE
        while code < 0:
            if closed:
                code, count = fly_on(machine, flow, group[i], forms, flight, lane, task, count)
            if code < 0:
                code, count = step_on(machine, own, lane, task, count)
        codes[i] = code
    return count


@compiled()
def step_on(machine: Machine, flow: Flow, lane: Lane, task: Task, count: int) -> tuple[int, int]:
    """Taylor steps up to and including the next event: (outcome code or −1, recorded steps).

    Parameters
    ----------
    lane : Lane
        Is advanced.
    count : int
        Steps recorded so far.
    """
    rows, space = flow.rows, flow.space
    clock, counters = lane.clock, lane.counters
    end = task.end
    room = np.inf
    again, entering = False, True
    due = NOWHERE
    unchecked = 0.0
    before = Before(0.0, 0.0, 0.0, 0.0, NOWHERE)
    while True:
        if not again and (is_full(task, rows, count) or (unchecked == 0.0 and is_stopped(space))):
            return FULL, count
        t, fired = clock[NOW], counters[CAUSE]
        hold = fired >= 0 or is_time_to_look(rows, lane.mode, counters[TAKEN])
        most = min(room, max(end - t, 0.0))
        if not again:
            code, count, due = jump_and_collide(machine, flow, lane, task, count, entering)
            entering = False
            if code >= 0:
                return code, note(rows, lane, task, count)
        status, h, series, may_fire = settle(machine, flow, lane, most, hold, unchecked)
        if status == REJECTED:
            go_back(lane, space, before)
            room = _CUT * unchecked
            again = True
            unchecked = 0.0
            continue
        if status != OK:
            restore_mode(lane.mode, lane.settled)
        elif len(rows.jumps) > 0 and not again:
            code, count, late = look_at_jumps(flow, lane, task, count, due)
            if code >= 0:
                return code, note(rows, lane, task, count)
            if late:
                unchecked = 0.0
                continue
        if not again:
            count = note(rows, lane, task, count)
        if status != OK:
            return give_up(machine, flow, status, lane, task, count)
        if t >= end:
            return FINISHED, count
        over, ends = ending(flow, lane)
        if h <= max(CLOSEST * abs(t), _NO_TIME * clock[SPAN]) and h < end - t and over < 0:
            return (NO_RATE if runs_away(rows.sizes, lane.mode) else TINY), count
        x, which = first_event(space, may_fire, flow.order)
        if which < 0 and over >= 0:
            x, which = min(1.0, ends / h), over
        requirement = requirement_of(which, len(rows.kinks), len(rows.u))
        if requirement >= 0 and x == 0.0:
            return inadmissible(rows.required, requirement), count
        look_ahead(flow, x, h)
        if which < len(rows.kinks):
            which = end_instead(flow, lane, which, x * h)
        # The next step begins with the rates at the end of this one, unless something comes in
        # between.
        asked = is_check_due(rows, lane, which, due) or is_full(task, rows, count)
        if asked and not solves(machine, flow, lane, x * h, which):
            room = _CUT * x * h
            again = True
            unchecked = 0.0
            continue
        unchecked = 0.0 if asked else x * h
        before = Before(t, clock[LAST], clock[SERIES], clock[RECENT], fired)
        copy(lane.y, space.last_step[STARTED])
        copy(space.trial, lane.y)
        room = np.inf
        again = False
        count_step(clock, counters, h, series, end if which < 0 and h >= end - t else t + x * h)
        if requirement >= 0:
            return inadmissible(rows.required, requirement), count
        if which >= 0 or due >= 0:  # after a jump closed forms may continue
            rest_together(flow, lane, which, x * h)
            return (
                fire(which, lane, rows, space.leaving, task.max_events) if which >= 0 else NOWHERE
            ), count


@compiled()
def is_full(task: Task, rows: Rows, count: int) -> bool:
    """Whether the record has no room for a knot: for one more step, or two if an impact may follow
    a jump or another event."""
    spare = 1 if has_gaps(rows) else 0
    return bool(task.recording and count + spare >= len(task.record.time))


@compiled()
def is_time_to_look(rows: Rows, mode: Array, taken: int) -> bool:
    """Whether sticking contacts and predicted rates are checked after this number of steps."""
    return bool(taken % (_LOOK_IN_PLANE if slides_in_plane(rows, mode) else _LOOK) == 0)


@compiled()
def is_check_due(rows: Rows, lane: Lane, which: int, due: int) -> bool:
    """Whether the rates at the end of a step have to be checked there: at an event (`which` is not
    −1), after a jump (`due` is not −1), if nothing else would check them, or at regular
    intervals."""
    taken = lane.counters[TAKEN] + 1
    free = rows.sizes[RATE_INDEPENDENT] == 0 and not is_time_to_look(rows, lane.mode, taken)
    return bool(which >= 0 or due >= 0 or not free)


@compiled()
def go_back(lane: Lane, space: Space, before: Before) -> None:
    """Restore a lane to the state before its last step."""
    clock = lane.clock
    clock[NOW] = before.t
    clock[LAST] = before.last
    clock[SERIES] = before.series
    clock[RECENT] = before.recent
    lane.counters[CAUSE] = before.cause
    lane.counters[TAKEN] -= 1
    copy(space.last_step[STARTED], lane.y)


@compiled()
def restore_mode(mode: Array, settled: Array) -> None:
    """Restore the last mode of the contacts, since no mode can continue the motion."""
    for i in range(len(mode)):
        mode[i] = settled[i] if settled[i] != NONE_YET else 0


@compiled()
def give_up(
    machine: Machine, flow: Flow, status: int, lane: Lane, task: Task, count: int
) -> tuple[int, int]:
    """Outcome code of a motion that no mode can continue, and the number of recorded steps.

    Parameters
    ----------
    status : int
        Status of the last candidate.
    lane : Lane
        Is restored if its last step has left the domain of a formula.
    count : int
        Steps recorded so far.
    """
    rows = flow.rows
    cause = lane.counters[CAUSE]
    if status in (NAN, INDEFINITE):
        if task.recording and lane.counters[CAUSE] < 0 and count > 1:
            # The last step has left the domain of a formula: its end is not a state of the motion.
            count -= 1
            lane.clock[NOW] = task.record.time[count - 1]
            copy(task.record.state[count - 1], lane.y)
        if status == NAN and 0 <= cause < len(rows.bounded) and rows.bounded[cause] == 1:
            return OUTSIDE_TABLE, count
        return (UNDEFINED if status == NAN else NO_INERTIA), count
    if has_gaps(rows):
        return (NO_ACCELERATION if is_paradox(machine, flow, lane) else NO_MODE), count
    if rows.sizes[RATE_INDEPENDENT] > 0:
        return NO_RATE, count
    return (ON_JUMP if len(rows.kinks) > 0 else NO_MODE), count


@compiled()
def runs_away(sizes: Array, mode: Array) -> bool:
    """Whether a rate-independent coordinate slides: its rate diverges at the end of its branch of
    equilibria."""
    sliding = False
    for c in range(sizes[ON_INERTIAL] + sizes[ON_VISCOUS], len(mode)):
        sliding = sliding or mode[c] != 0
    return sliding


@compiled()
def inadmissible(required: Array, requirement: int) -> int:
    """Outcome code for a row that must not be negative, but is."""
    return NEGATIVE if required[requirement, SLIPPING] < 0 else INADMISSIBLE


@compiled()
def look_ahead(flow: Flow, x: float, h: float) -> None:
    """State after the fraction x of a step, and the rates there, times the length of the step; the
    work space contains the powers of the whole step."""
    space = flow.space
    n = flow.rows.sizes[DIMENSION]
    if x < 1.0:
        fill_powers(space.powers, x * h / space.W[n, 1])
    for i in range(n):
        space.trial[i], space.last_step[PREDICTED, i] = value_and_slope(
            space.W[i], flow.order, space.powers
        )


@compiled()
def solves(machine: Machine, flow: Flow, lane: Lane, h: float, which: int) -> bool:
    """Whether the rates at the end of a step agree with those predicted by its series.

    At the end of a slip in a plane, Au is a rounding error; the direction is then taken from the
    series.

    Parameters
    ----------
    h : float
        Length of the step.
    which : int
        The guard that fires at its end, or negative.
    """
    rows = flow.rows
    space = flow.space
    t = lane.clock[NOW] + h
    before = space.touched
    for p in range(len(rows.planes)):
        first = rows.planes[p, LEAD]
        before[first] = lane.mode[first]
        if ends_slip(flow, lane.mode, which, p, t, h):
            take_direction(rows, p, space.W, flow.order, h / space.W[len(lane.y), 1], space.V)
            set_mode(rows, lane.mode, first, DIRECTION_GIVEN)
    status = coefficients(machine, flow, Instant(t, space.trial, lane.mode, lane.reg), 1, space.V)
    for plane in rows.planes:
        set_mode(rows, lane.mode, plane[LEAD], before[plane[LEAD]])
    if status != OK:
        return True  # the rates are undetermined here, which the next step reports
    return matches_prediction(flow, space.V, space.trial, lane.seen, h)


@compiled()
def ends_slip(flow: Flow, mode: Array, which: int, p: int, t: float, h: float) -> bool:
    """Whether the slip of a contact in a plane ends at the end of a step: where its own guard
    fires; where it has slowed down to rest, up to rounding; where that of another one does, or of
    one along a line of the same body, or a kink, if its speed or the remaining time is within
    rounding errors of zero.

    Parameters
    ----------
    flow : Flow
        With the series of the step.
    mode : array of int, shape (contacts,)
        In the step.
    which : int
        The guard that fires, or negative.
    p : int
        The plane.
    t, h : float
        End and length of the step.
    """
    rows = flow.rows
    first = rows.planes[p, LEAD]
    kink = 0 <= which < len(rows.kinks)
    c = contact_of(which, len(rows.kinks)) if which >= len(rows.kinks) else NOWHERE
    slips = 0 <= c < rows.sizes[ON_INERTIAL] and mode[c] != 0
    if slips and c == first:
        return True
    if not slips_with_mass(rows, mode, p):
        return False
    row = flow.space.W[rows.planes[p, AIM_SPEED]]
    speed, change = value_and_slope(row, flow.order - 1, flow.space.powers)
    rounding = ROUNDING * flow.space.W[rows.planes[p, AU_SIZE], 0]
    if change < 0.0 and speed <= _AT_REST * rounding:
        return True
    if not kink and not slips:
        return False
    if c >= 0 and rows.plane[c] < 0 and not may_share(rows, first, c):
        return False
    late = INSTANT * abs(t) / h
    return bool(abs(speed) <= rounding + late * abs(change))


@compiled()
def ending(flow: Flow, lane: Lane) -> tuple[int, float]:
    """The guard of a slip in a plane that ends within the resolution of the clock, and the time
    until then; −1 if there is none. Its direction may turn ever faster until then, which would take
    infinitely many steps.

    Parameters
    ----------
    flow : Flow
        With the series of the next step.
    """
    rows = flow.rows
    unit = flow.space.W[rows.sizes[DIMENSION], 1]
    soon = INSTANT * abs(lane.clock[NOW]) / unit
    for p in range(len(rows.planes)):
        first = rows.planes[p, LEAD]
        speed = flow.space.W[rows.planes[p, AIM_SPEED]]
        if not speed[0] > 0.0 or not slips_with_mass(rows, lane.mode, p):
            continue
        # Usually it takes longer at the current rate.
        if speed[0] + 2.0 * soon * speed[1] < 0.0:
            end, _ = slip_end(speed, flow.order, soon)
            if end < np.inf:
                return guard_at(rows, first), end * unit
    return NOWHERE, 0.0


@compiled()
def end_instead(flow: Flow, lane: Lane, which: int, h: float) -> int:
    """The guard of a slip in a plane that ends at the end of a step, for steps that end without an
    event or at a kink: kinks of components of its velocity are zero there as well, and the
    direction is undefined. The kink itself, or −1, if there is no such slip.

    Parameters
    ----------
    flow : Flow
        With the series of the step, up to its end.
    lane : Lane
        At its beginning.
    h : float
        Length of the step.
    """
    rows = flow.rows
    for p in range(len(rows.planes)):
        if ends_slip(flow, lane.mode, which, p, lane.clock[NOW] + h, h):
            return guard_at(rows, rows.planes[p, LEAD])
    return which


@compiled()
def rest_together(flow: Flow, lane: Lane, which: int, h: float) -> None:
    """Set all slips in a plane that end at the end of a step to rest: the direction of the
    remaining velocity is undefined.

    Parameters
    ----------
    flow : Flow
        With the series of the step.
    lane : Lane
        At the end of the step. Its mode is changed.
    which : int
        The guard that fires.
    h : float
        Length of the step.
    """
    rows = flow.rows
    ended = contact_of(which, len(rows.kinks))
    for p in range(len(rows.planes)):
        if rows.planes[p, LEAD] != ended and ends_slip(
            flow, lane.mode, which, p, lane.clock[NOW], h
        ):
            set_mode(rows, lane.mode, rows.planes[p, LEAD], 0)
