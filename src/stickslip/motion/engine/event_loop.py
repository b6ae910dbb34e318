"""The event loop: closed-form flights where modes are affine, Taylor steps elsewhere.

All functions are scalar loops over preallocated arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, IntVector, Many
from stickslip.equations.codegen.series import INDEFINITE
from stickslip.machine_code.functions import entry_point
from stickslip.motion.engine import flights
from stickslip.motion.engine.closed_forms import make_form
from stickslip.motion.engine.collisions import CREATES, JUMPED, NO_IMPULSE, collide
from stickslip.motion.engine.forms import (
    AFFINE,
    GERM_ORDERS,
    GUARDS,
    ClosedForms,
    Flight,
    form_of,
    slots_of,
)
from stickslip.motion.engine.guards import (
    contact_of,
    doubt_of,
    first_event,
    germ,
    guard_of,
    resting,
    spell,
)
from stickslip.motion.engine.impacts import (
    first_approaching,
    is_paradox,
    open_all,
    size_gaps,
)
from stickslip.motion.engine.modes import (
    copy,
    flip,
    keeps,
    let_slide,
    may_be_carried,
    set_regions,
)
from stickslip.motion.engine.resting import settle
from stickslip.motion.steps.arrays import (
    AIM,
    ASTRAY,
    CAUSE,
    COMPONENT,
    CREATES_ENERGY,
    CROSSED,
    DIMENSION,
    FINISHED,
    FIRED,
    FULL,
    HAPPENED,
    INADMISSIBLE,
    INSTANT,
    JUMPS_MEET,
    JUMPS_ON,
    KINK,
    LAST,
    LIMIT,
    LONG_AGO,
    MASSIVE,
    NAN,
    NEGATIVE,
    NO_ACCELERATION,
    NO_COLLISION,
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
    OTHER,
    PROMISED,
    RATE_INDEPENDENT,
    RECENT,
    ROUNDING,
    SERIES,
    SINCE,
    SLIPPING,
    SPAN,
    STARTED,
    SWITCHES,
    TAKEN,
    TINY,
    UNDEFINED,
    WORD,
    ZENO,
    Flow,
    FlowOfMany,
    Instant,
    Lane,
    Machine,
    Rows,
    Space,
    Task,
    flow_of,
    is_component,
    is_loose,
    is_stopped,
    opens,
    remember_gaps,
    set_mode,
)
from stickslip.motion.steps.discs import give_direction, take_direction
from stickslip.motion.steps.jumps import due_jump, fires, make_jump, passed_jumps
from stickslip.motion.steps.roots import value_and_slope
from stickslip.motion.steps.starting import coefficients
from stickslip.motion.steps.step_size import fill_powers
from stickslip.symbolic.tape import DIRECTION_GIVEN
from stickslip.translator import compiled, row_of

_ZENO_EVENTS = 200
_TOGETHER = 1e-12  # of the time that a motion may last: events that coincide
_CLOSEST = 1e-15  # relative difference of times that can be told apart
_NO_TIME = 1e-60  # of the time that a motion may last: no step is as short, where the clock is at 0
# Steps after which a promise is kept, and sticking contacts are put onto the surface speed. Towards
# the end of a slip in a plane steps shrink, and recent ones, which are forgotten by halves, have to
# say then how far rounding errors have carried what sticks.
_LOOK, _LOOK_IN_PLANE = 64, 16
_CUT = 0.25  # of a step that did not solve the equations
_MEETING = 1e-12  # of its terms, and of what it does in a step: a guard that is zero with another
_UNDECIDED = -1  # what is said of the mode that a motion is in, beside the slot of its closed form


class Before(NamedTuple):
    """Where the clock was before a step, for a motion that has to go back."""

    t: float
    last: float
    series: float
    recent: float
    cause: int


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
    machine : Machine
    flow : Flow
        Constants by group of lanes with the same parameters (a leading axis).
    flight : Flight
    forms : ClosedForms
        Without slots: Taylor steps only.
    group : array of int, shape (lanes,)
    codes : array of int, shape (lanes,)
        FULL where a lane is to go on; receives the outcome code, or FULL where the record is, or
        where there is a wish to stop.
    lanes : Lane
        Of all lanes (a leading axis).
    task : Task

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


# -- Taylor steps ----------------------------------------------------------------------------------


@compiled()
def step_on(machine: Machine, flow: Flow, lane: Lane, task: Task, count: int) -> tuple[int, int]:
    """Taylor steps up to and including the next event: (outcome code or −1, recorded steps).

    Parameters
    ----------
    machine : Machine
    flow : Flow
    lane : Lane
        Is moved on.
    task : Task
    count : int
        Steps recorded so far.
    """
    rows, space = flow.rows, flow.space
    clock, counters = lane.clock, lane.counters
    end = task.end
    room = np.inf
    again, entering = False, True
    due = NOWHERE
    promised = 0.0
    before = Before(0.0, 0.0, 0.0, 0.0, NOWHERE)
    while True:
        if not again and (is_full(task, rows, count) or (promised == 0.0 and is_stopped(space))):
            return FULL, count
        t, fired = clock[NOW], counters[CAUSE]
        hold = fired >= 0 or is_time_to_look(rows, counters[TAKEN])
        most = min(room, max(end - t, 0.0))
        if not again:
            code, count, due = strike(machine, flow, lane, task, count, entering)
            entering = False
            if code >= 0:
                return code, note(rows, lane, task, count)
        status, h, series, may_fire = settle(machine, flow, lane, most, hold, promised)
        if status == ASTRAY:
            go_back(lane, space, before)
            room = _CUT * promised
            again = True
            promised = 0.0
            continue
        if status != OK:
            restore_mode(lane.mode, lane.settled)
        elif len(rows.jumps) > 0 and not again:
            code, count, late = look_at_jumps(flow, lane, task, count, due)
            if code >= 0:
                return code, note(rows, lane, task, count)
            if late:
                promised = 0.0
                continue
        if not again:
            count = note(rows, lane, task, count)
        if status != OK:
            return give_up(machine, flow, status, lane, task, count)
        if t >= end:
            return FINISHED, count
        if h <= max(_CLOSEST * abs(t), _NO_TIME * clock[SPAN]) and h < end - t:
            return (NO_RATE if runs_away(rows.sizes, lane.mode) else TINY), count
        x, which = first_event(space, may_fire, flow.order)
        doubt = doubt_of(which, len(rows.kinks), len(rows.u))
        if doubt >= 0 and x == 0.0:
            return inadmissible(rows.doubtful, doubt), count
        look_ahead(flow, x, h)
        # The next step begins with the rates at the end of this one, unless something comes in
        # between.
        asked = is_promise_due(rows, lane, which, due) or is_full(task, rows, count)
        if asked and not solves(machine, flow, lane, x * h, which):
            room = _CUT * x * h
            again = True
            promised = 0.0
            continue
        promised = 0.0 if asked else x * h
        before = Before(t, clock[LAST], clock[SERIES], clock[RECENT], fired)
        copy(lane.y, space.promise[STARTED])
        copy(space.trial, lane.y)
        room = np.inf
        again = False
        count_step(clock, counters, h, series, end if which < 0 and h >= end - t else t + x * h)
        if doubt >= 0:
            return inadmissible(rows.doubtful, doubt), count
        if which >= 0 or due >= 0:  # after a jump closed forms may go on
            rest_together(flow, lane, which, x * h)
            return (
                fire(which, lane, rows, space.leaving, task.max_events) if which >= 0 else NOWHERE
            ), count


@compiled()
def is_full(task: Task, rows: Rows, count: int) -> bool:
    """Whether there is no room to record what happens at a knot: one step more, or two where an
    impact may follow a jump, or another event."""
    spare = 1 if has_gaps(rows) else 0
    return bool(task.recording and count + spare >= len(task.record.time))


@compiled()
def is_time_to_look(rows: Rows, taken: int) -> bool:
    """Whether sticking contacts and promises are looked at after so many steps."""
    return bool(taken % (_LOOK if len(rows.planes) == 0 else _LOOK_IN_PLANE) == 0)


@compiled()
def is_promise_due(rows: Rows, lane: Lane, which: int, due: int) -> bool:
    """Whether the rates at the end of a step have to be checked there: an event comes (which is not
    −1) or a jump has been taken (due is not), nothing else would check them, or it is time."""
    free = rows.sizes[RATE_INDEPENDENT] == 0 and not is_time_to_look(rows, lane.counters[TAKEN] + 1)
    return bool(which >= 0 or due >= 0 or not free)


@compiled()
def go_back(lane: Lane, space: Space, before: Before) -> None:
    """Put a lane where it was before its last step."""
    clock = lane.clock
    clock[NOW] = before.t
    clock[LAST] = before.last
    clock[SERIES] = before.series
    clock[RECENT] = before.recent
    lane.counters[CAUSE] = before.cause
    lane.counters[TAKEN] -= 1
    copy(space.promise[STARTED], lane.y)


@compiled()
def restore_mode(mode: Array, settled: Array) -> None:
    """No mode goes on from here: what the contacts did last is kept, not the last attempt."""
    for i in range(len(mode)):
        mode[i] = settled[i] if settled[i] != NONE_YET else 0


@compiled()
def give_up(
    machine: Machine, flow: Flow, status: int, lane: Lane, task: Task, count: int
) -> tuple[int, int]:
    """Outcome code of a motion from which no mode goes on, and the recorded steps.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    status : int
        What was said of the last candidate.
    lane : Lane
        Is put back where its last step has left the domain of a formula.
    task : Task
    count : int
        Steps recorded so far.
    """
    rows = flow.rows
    if status in (NAN, INDEFINITE):
        if task.recording and lane.counters[CAUSE] < 0 and count > 1:
            # The last step has left the domain of a formula: its end is no state of the motion.
            count -= 1
            lane.clock[NOW] = task.record.time[count - 1]
            copy(task.record.state[count - 1], lane.y)
        return (UNDEFINED if status == NAN else NO_INERTIA), count
    if has_gaps(rows):
        return (NO_ACCELERATION if is_paradox(machine, flow, lane) else NO_MODE), count
    if rows.sizes[RATE_INDEPENDENT] > 0:
        return NO_RATE, count
    return (ON_JUMP if len(rows.kinks) > 0 else NO_MODE), count


@compiled()
def strike(
    machine: Machine, flow: Flow, lane: Lane, task: Task, count: int, entering: bool
) -> tuple[int, int, int]:
    """Let the state jump where a jump is due, then what closes collide: at the start, where a
    motion goes on that was stopped, and after an event.

    Parameters
    ----------
    machine : Machine
    flow : Flow
        Its work space keeps the regions then.
    lane : Lane
        Its state may jump.
    task : Task
    count : int
        Steps recorded so far; a state that has an impact at the start, or after a jump, is one
        more.
    entering : bool
        Whether the motion starts, or goes on, here.

    Returns
    -------
    code, count : int
        An outcome code if the motion ends here, else −1.
    due : int
        The jump that was due, or −1.
    """
    rows = flow.rows
    code = NOWHERE
    zero = 0.0
    due = due_jump(rows, lane.counters[CAUSE], lane.reg)
    if due >= 0:
        code, zero = take_jump(machine, flow, lane, due)
    if code < 0 and has_gaps(rows):
        code, count = knock(machine, flow, lane, task, count, entering, due, zero)
    copy(lane.reg, flow.space.stood)
    flow.space.stood[len(lane.reg)] = rows.jumps[due, KINK] if due >= 0 else NOWHERE
    return code, count, due


@compiled()
def take_jump(machine: Machine, flow: Flow, lane: Lane, due: int) -> tuple[int, float]:
    """Let the state jump: an outcome code if it cannot, else −1; and up to which its guard is
    zero."""
    here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
    kink = flow.rows.jumps[due, KINK]
    code = NOWHERE
    zero = 0.0
    if meets_another(machine, flow, here, due, lane.clock[LAST]):
        code = JUMPS_MEET
    elif not make_jump(machine, flow, here, due, lane.y):
        code = UNDEFINED
    if code < 0:
        # What is as close to zero as the guard was where it fired, is zero.
        zero = abs(flow.space.V[flow.rows.kinks[kink], 0])
        find_regions(machine, flow, here, kink, zero)
    else:
        lane.counters[CAUSE] = -1
    return code, float(zero)


@compiled()
def meets_another(machine: Machine, flow: Flow, here: Instant, due: int, last: float) -> bool:
    """Whether the guard of another jump passes through zero, too, where one is due.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    here : Instant
        Before the jump.
    due : int
        The jump.
    last : float
        Length of the last step.
    """
    rows = flow.rows
    W = flow.space.W
    found = False
    if len(rows.jumps) > 1:
        known = coefficients(machine, flow, here, flow.order, W) == OK
        for j in range(len(rows.jumps)):
            kink = rows.jumps[j, KINK]
            if kink == rows.jumps[due, KINK]:
                continue
            row = rows.kinks[kink]
            rate = W[row, 1] / W[rows.sizes[DIMENSION], 1]
            size = flow.space.mag[3 * len(rows.u) + kink] + last * abs(rate)
            passes = fires(rows, j, 1 - here.reg[kink]) and (
                not known or (rate if here.reg[kink] == 0 else -rate) > 0.0
            )
            found = found or (passes and abs(W[row, 0]) <= _MEETING * size)
    return found


@compiled()
def find_regions(machine: Machine, flow: Flow, at: Instant, own: int, zero: float) -> None:
    """Put kinks onto the sides where their guards are after a jump: what it leaps over is not
    crossed.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    at : Instant
        After the jump; its regions are changed.
    own : int
        The kink that has fired, which stays where it is while its guard is zero; −1: none.
    zero : float
        Up to which the guard is that.
    """
    V = flow.space.V
    rows = flow.rows
    for _ in range(len(at.reg) + 1):
        side = at.reg[own] if own >= 0 else 0
        coefficients(machine, flow, at, 1, V)
        changed = set_regions(rows, V, flow.space.mag, at.reg)
        if own >= 0 and abs(V[rows.kinks[own], 0]) <= zero:
            at.reg[own] = side
        if not changed:
            break


@compiled()
def look_at_jumps(
    flow: Flow, lane: Lane, task: Task, count: int, due: int
) -> tuple[int, int, bool]:
    """What jumps have to do with the mode that was found.

    Parameters
    ----------
    flow : Flow
        Its work space has the series, and the regions before.
    lane : Lane
        If a jump is due because something else than its guard has fired, it is as after an event
        of that guard.
    task : Task
    count : int
        Steps recorded so far; the state before a jump that is due now is one more.
    due : int
        The jump that has just been taken, or −1.

    Returns
    -------
    code, count : int
        An outcome code if the motion ends here, else −1.
    late : bool
        Whether a jump is due.
    """
    rows = flow.rows
    stood = flow.space.stood
    counters = lane.counters
    code = NOWHERE
    passed, first = passed_jumps(rows, stood, lane.reg)
    if due >= 0:
        if passed > 0 or falls_back(flow, lane, due):
            code = JUMPS_ON
    elif passed > 1 and counters[TAKEN] > 0:
        code = JUMPS_MEET
    late = due < 0 and passed == 1 and counters[TAKEN] > 0
    if late:
        kink = rows.jumps[first, KINK]
        lane.reg[kink] = stood[kink]
        count = note(rows, lane, task, count)
        lane.reg[kink] = 1 - stood[kink]
        counters[CAUSE] = kink
        counters[HAPPENED] += 1
        counters[CROSSED] += 1
    return code, count, late


@compiled()
def falls_back(flow: Flow, lane: Lane, due: int) -> bool:
    """Whether a jump leaves its own guard at zero and at rest, and the motion then passes into the
    region where it fires: then it has not left the guard."""
    rows = flow.rows
    space = flow.space
    kink = rows.jumps[due, KINK]
    order = 0
    if fires(rows, due, lane.reg[kink]):
        near = lane.clock[LAST] / space.W[rows.sizes[DIMENSION], 1] + space.powers[1]
        guard = guard_of(rows, space, lane.mode, lane.reg, kink, near, FIRED)
        spare = space.pending[len(space.pending) - 1]
        _, order = germ(space.W, guard, flow.order, space.powers, 1.0, spare)
    return 1 < order < flow.order


@compiled()
def knock(
    machine: Machine,
    flow: Flow,
    lane: Lane,
    task: Task,
    count: int,
    entering: bool,
    due: int,
    zero: float,
) -> tuple[int, int]:
    """Let what closes collide, at the start and after an event.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    lane : Lane
        Its rates may jump.
    task : Task
    count : int
        Steps recorded so far; a state that has an impact at the start, or after a jump, is one
        more.
    entering : bool
        Whether the motion starts, or goes on, here: it may have been stopped at an impact.
    due : int
        The jump that has just been taken, or −1.
    zero : float
        Up to which its guard is zero.

    Returns
    -------
    code, count : int
        An outcome code if no impact is admissible, else −1.
    """
    rows = flow.rows
    remember_gaps(rows, flow.space, lane.seen)
    last = lane.clock[LAST]
    cause = lane.counters[CAUSE]
    if cause < 0 and not entering:
        return NOWHERE, count
    closing = cause >= len(rows.kinks) and closes(rows, lane.mode, cause - len(rows.kinks))
    if due >= 0 or not closing:
        # Another event, or none: what touches meanwhile, up to rounding errors, has its impact.
        here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
        if lane.counters[TAKEN] == 0:
            size_gaps(machine, flow, here, lane.clock[SPAN])
        going = due < 0 and (cause >= 0 or lane.counters[TAKEN] > 0)
        # What leaves beside friction in a plane is put back onto rest with that.
        opened = cause - len(rows.kinks) if len(rows.planes) > 0 else NOWHERE
        struck_first = first_approaching(machine, flow, here, last, going, opened)
        if struck_first >= 0:
            if not going:
                open_all(rows, lane.mode)
            count = note(rows, lane, task, count)
            lane.counters[CAUSE] = len(rows.kinks) + struck_first
        elif going:
            return NOWHERE, count
    struck = collide(machine, flow, lane, last)
    if struck == NO_IMPULSE:
        return NO_COLLISION, count
    if struck == JUMPED and len(rows.jumps) > 0:
        here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
        own = rows.jumps[due, KINK] if due >= 0 else NOWHERE
        find_regions(machine, flow, here, own, zero)
    return (CREATES_ENERGY if struck == CREATES else NOWHERE), count


@compiled()
def closes(rows: Rows, mode: Array, c: int) -> bool:
    """Whether a contact that can open has just closed."""
    return bool(opens(rows, c) and mode[c] == 0)


@compiled()
def has_gaps(rows: Rows) -> bool:
    """Whether a contact can open."""
    found = False
    for gap in rows.gaps:
        found = found or gap >= 0
    return found


@compiled()
def runs_away(sizes: Array, mode: Array) -> bool:
    """Whether a rate-independent coordinate slides: its rate runs away where its branch of
    equilibria ends."""
    sliding = False
    for c in range(sizes[ON_INERTIAL] + sizes[ON_VISCOUS], len(mode)):
        sliding = sliding or mode[c] != 0
    return sliding


@compiled()
def inadmissible(doubtful: Array, doubt: int) -> int:
    """Outcome code where a row has become negative that must not."""
    return NEGATIVE if doubtful[doubt, SLIPPING] < 0 else INADMISSIBLE


@compiled()
def look_ahead(flow: Flow, x: float, h: float) -> None:
    """State after a part x of a step, and the rates there, times its length; the work space holds
    the powers of the whole step."""
    space = flow.space
    n = flow.rows.sizes[DIMENSION]
    if x < 1.0:
        fill_powers(space.powers, x * h / space.W[n, 1])
    for i in range(n):
        space.trial[i], space.promise[PROMISED, i] = value_and_slope(
            space.W[i], flow.order, space.powers
        )


@compiled()
def count_step(clock: Array, counters: Array, h: float, series: float, t: float) -> None:
    """Put the clock to the end of a step or of a flight.

    Parameters
    ----------
    clock, counters : arrays
        Of a lane; they receive what has been done.
    h, series : float
        Length of the step (the whole, where an event cuts it), and that of its series.
    t : float
        Time at the end.
    """
    counters[TAKEN] += 1
    clock[LAST], clock[SERIES], clock[RECENT] = h, series, max(series, 0.5 * clock[RECENT])
    clock[NOW] = t
    counters[CAUSE] = -1


@compiled()
def solves(machine: Machine, flow: Flow, lane: Lane, h: float, which: int) -> bool:
    """Whether the rates at the end of a step are those that its series promises.

    Where a slip in a plane ends, Au is a rounding error, and the direction is that of the series.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    lane : Lane
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
        first = rows.planes[p, COMPONENT]
        before[first] = lane.mode[first]
        if ends_slip(flow, lane.mode, which, p, t, h):
            take_direction(rows, p, space.W, flow.order, h / space.W[len(lane.y), 1], space.V)
            give_direction(rows, p, lane.mode, DIRECTION_GIVEN)
    status = coefficients(machine, flow, Instant(t, space.trial, lane.mode, lane.reg), 1, space.V)
    for p in range(len(rows.planes)):
        give_direction(rows, p, lane.mode, before[rows.planes[p, COMPONENT]])
    if status != OK:
        return True  # the rates are not determined here, which the next step finds out
    return keeps(flow, space.V, space.trial, lane.seen, h)


@compiled()
def ends_slip(flow: Flow, mode: Array, which: int, p: int, t: float, h: float) -> bool:
    """Whether the slip of a contact in a plane ends at the end of a step: where its own guard
    fires; where that of another one does, or of one along a line of the same body, if its speed
    cannot be told from nothing there.

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
    mag = flow.space.mag
    first, other = rows.planes[p, COMPONENT], rows.planes[p, OTHER]
    c = contact_of(which, len(rows.kinks)) if which >= len(rows.kinks) else NOWHERE
    if c < 0 or c >= rows.sizes[ON_INERTIAL] or mode[c] == 0 or opens(rows, c):
        return False
    if c == first:
        return True
    slips = rows.planes[p, MASSIVE] == 1 and (mode[first] == 1 or mode[first] == 2)
    if not slips or is_loose(rows, mode, first):
        return False
    if rows.plane[c] < 0 and (rows.group[c] < 0 or rows.group[c] != rows.group[first]):
        return False
    row = flow.space.W[rows.planes[p, AIM] + 2]
    speed, change = value_and_slope(row, flow.order - 1, flow.space.powers)
    late = INSTANT * abs(t) / h
    return bool(abs(speed) <= ROUNDING * (mag[first] + mag[other]) + late * abs(change))


@compiled()
def rest_together(flow: Flow, lane: Lane, which: int, h: float) -> None:
    """Let all slips in a plane come to rest that end at the end of a step. What is left of them has
    no direction.

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
        if rows.planes[p, COMPONENT] != ended and ends_slip(
            flow, lane.mode, which, p, lane.clock[NOW], h
        ):
            set_mode(rows, lane.mode, rows.planes[p, COMPONENT], 0)


# -- flights ---------------------------------------------------------------------------------------


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
    machine : Machine
    flow : Flow
        Constants by group (a leading axis).
    g : int
        Group of the lane.
    T : ClosedForms
        Receive those of modes that are new.
    flight : Flight
    lane : Lane
    task : Task
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
                len(y) > flights.FEW_COMPONENTS
                and flights.is_drowned(form, flight, y, lane.seen, tau, omega)
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
        if doubt_of(number, nk, nc) >= 0:
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
    """The mode that a motion takes now, by pivoting among closed forms: its slot, or UNDECIDED
    where Taylor steps have to tell.

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
    slots = slots_of(T)
    nc = len(mode)
    nk = len(reg)
    for _ in range(2 * (nk + nc) + 4):
        key = flights.mode_key(mode, reg)
        slot = flights.find(T.key, T.own, g * slots, T.used[g], key)
        if slot < 0:
            if T.used[g] == slots:
                return _UNDECIDED
            slot = g * slots + T.used[g]
            T.key[slot] = key
            T.used[g] += 1
            make_form(machine, flow, g, T, flight.making, slot, mode, reg)
        form = form_of(T, slot)
        if form.status != AFFINE or not flights.admissible(form, flight, lane.y, clock[RECENT]):
            return _UNDECIDED
        fired = lane.counters[CAUSE]
        guard = flights.germs(form, flight, omega, fired, nk, clock[LAST], lane.settled)
        if guard < 0:
            held = carries(form, flight, mode, nk, drops) or (
                total(drops) > 0 and may_be_carried(flow.rows, flow.k.J[g], flow.space, mode)
            )
            return _UNDECIDED if held else slot
        number = form.switch[guard]
        c = contact_of(number, nk)
        # Which of several contacts break their thresholds together is not decided here.
        if doubt_of(number, nk, nc) >= 0 or (
            several and number >= nk and drops[c] == 1 and mode[c] == 0
        ):
            return _UNDECIDED
        flip(flow.rows, number, mode, reg, flow.space.leaving)
        let_slide(mode)
    return _UNDECIDED


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
        As of :class:`stickslip.motion.steps.arrays.Rows`.
    """
    if len(mode) > 1:
        for g in range(form.counts[GUARDS]):
            c = contact_of(form.switch[g], nk)
            if (
                0 <= c < len(mode)
                and flight.orders[g] >= GERM_ORDERS
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


@compiled()
def note(rows: Rows, lane: Lane, task: Task, count: int) -> int:
    """Record where a lane is, and count the switches that brought it there."""
    record = task.record
    if task.recording:
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
            seen = seen and not is_component(rows, i)
            lane.counters[SWITCHES] += 1 if seen else 0
            lane.settled[i] = lane.mode[i]
    return count


@compiled()
def fire(guard: int, lane: Lane, rows: Rows, leaving: Array, max_events: int) -> int:
    """Count an event and give its switch the other state; an outcome code if the motion ends here,
    else −1.

    Parameters
    ----------
    guard : int
        Number of the guard that has fired.
    lane : Lane
    rows : Rows
    leaving : array of int, shape (contacts,)
        As of :func:`stickslip.motion.engine.modes.flip`.
    max_events : int
    """
    clock = lane.clock
    counters = lane.counters
    nk = len(rows.kinks)
    # Events that coincide have no order, and what lies between them is no mode of the motion.
    if clock[NOW] - clock[SINCE] > _TOGETHER * clock[SPAN]:
        counters[WORD] = spell(counters[WORD], lane.settled, lane.reg)
    clock[SINCE] = clock[NOW]
    fired = flip(rows, guard, lane.mode, lane.reg, leaving)
    if fired < nk and rows.vanishing[fired] >= 0:
        lane.y[rows.vanishing[fired]] = 0.0
    counters[CAUSE] = fired
    counters[HAPPENED] += 1
    counters[CROSSED] += 1 if fired < nk else 0
    if counters[HAPPENED] % _ZENO_EVENTS == 0:
        if clock[NOW] - clock[LONG_AGO] <= 1e2 * _CLOSEST * abs(clock[NOW]):
            return ZENO
        clock[LONG_AGO] = clock[NOW]
    return LIMIT if counters[HAPPENED] >= max_events else -1
