"""Events: changes of mode, jumps of the state, and collisions.

The clock, the counters and the record of a motion are written here, too.
"""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.engine.collisions import CREATES, JUMPED, NO_IMPULSE, collide
from stickslip.motion.engine.impacts import first_approaching, open_all, size_gaps
from stickslip.motion.engine.jumps import due_jump, fires, make_jump, passed_jumps
from stickslip.motion.modes.guards import (
    extended_word,
    guard_of,
    leading_term,
    may_collide,
    resting,
)
from stickslip.motion.modes.pivots import flip, set_regions
from stickslip.motion.modes.surfaces import just_opened
from stickslip.motion.steps.arrays import (
    CAUSE,
    CREATES_ENERGY,
    CROSSED,
    DIMENSION,
    HAPPENED,
    JUMPS_MEET,
    JUMPS_ON,
    KINK,
    LAST,
    LIMIT,
    LONG_AGO,
    NO_COLLISION,
    NONE_YET,
    NOW,
    NOWHERE,
    OK,
    RECENT,
    SERIES,
    SINCE,
    SPAN,
    SWITCHES,
    TAKEN,
    UNDEFINED,
    WORD,
    ZENO,
    Flow,
    Instant,
    Lane,
    Machine,
    Rows,
    Task,
)
from stickslip.motion.steps.contacts import leads
from stickslip.motion.steps.sets import kink_terms, store_gap_sizes
from stickslip.motion.steps.starting import coefficients
from stickslip.numerics.levels import CLOSEST, FIRED
from stickslip.translator import compiled

_ZENO_EVENTS = 200
_TOGETHER = 1e-12  # fraction of the length of the motion within which events coincide
# a guard smaller than this, relative to its terms and its change in a step, is zero with another
_MEETING = 1e-12


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
            lane.counters[SWITCHES] += 1 if seen and leads(rows, i) else 0
            lane.settled[i] = lane.mode[i]
    return count


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
def fire(guard: int, lane: Lane, rows: Rows, leaving: Array, max_events: int) -> int:
    """Count an event and give its switch the other state; an outcome code if the motion ends here,
    else −1.

    Parameters
    ----------
    guard : int
        Number of the guard that has fired.
    leaving : array of int, shape (contacts,)
        As in :func:`stickslip.motion.modes.pivots.flip`.
    """
    clock = lane.clock
    counters = lane.counters
    nk = len(rows.kinks)
    # Events that coincide have no order, and the phases between them are not modes of the motion.
    if clock[NOW] - clock[SINCE] > _TOGETHER * clock[SPAN]:
        counters[WORD] = extended_word(counters[WORD], lane.settled, lane.reg)
    clock[SINCE] = clock[NOW]
    fired = flip(rows, guard, lane.mode, lane.reg, leaving)
    if fired < nk and rows.vanishing[fired] >= 0:
        lane.y[rows.vanishing[fired]] = 0.0
    counters[CAUSE] = fired
    counters[HAPPENED] += 1
    counters[CROSSED] += 1 if fired < nk else 0
    if counters[HAPPENED] % _ZENO_EVENTS == 0:
        if clock[NOW] - clock[LONG_AGO] <= 1e2 * CLOSEST * abs(clock[NOW]):
            return ZENO
        clock[LONG_AGO] = clock[NOW]
    return LIMIT if counters[HAPPENED] >= max_events else -1


@compiled()
def jump_and_collide(
    machine: Machine, flow: Flow, lane: Lane, task: Task, count: int, entering: bool
) -> tuple[int, int, int]:
    """Apply a jump of the state that is due, then impacts of closing contacts: at the start, when a
    stopped motion is resumed, and after an event.

    Parameters
    ----------
    flow : Flow
        Its work space keeps the regions then.
    lane : Lane
        Its state may jump.
    count : int
        Steps recorded so far; a state that has an impact at the start, or after a jump, is one
        more.
    entering : bool
        Whether the motion starts, or continues, here.

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
        code, count = collide_if_closing(machine, flow, lane, task, count, entering, due, zero)
    copy(lane.reg, flow.space.previous_regions)
    flow.space.previous_regions[len(lane.reg)] = rows.jumps[due, KINK] if due >= 0 else NOWHERE
    return code, count, due


@compiled()
def take_jump(machine: Machine, flow: Flow, lane: Lane, due: int) -> tuple[int, float]:
    """Apply a jump of the state. Returns an outcome code if it is impossible, else −1; and the size
    below which its guard counts as zero."""
    here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
    kink = flow.rows.jumps[due, KINK]
    code = NOWHERE
    zero = 0.0
    if meets_another(machine, flow, here, due, lane.clock[LAST]):
        code = JUMPS_MEET
    elif not make_jump(machine, flow, here, due, lane.y):
        code = UNDEFINED
    if code < 0:
        # A value as close to zero as the guard was when it fired is zero.
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
            size = kink_terms(rows, flow.space.mag, kink) + last * abs(rate)
            passes = fires(rows, j, 1 - here.reg[kink]) and (
                not known or (rate if here.reg[kink] == 0 else -rate) > 0.0
            )
            found = found or (passes and abs(W[row, 0]) <= _MEETING * size)
    return found


@compiled()
def find_regions(machine: Machine, flow: Flow, at: Instant, own: int, zero: float) -> None:
    """Set the regions of kinks by their guards after a jump: the motion does not cross the kinks
    over which it jumps.

    Parameters
    ----------
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
    """Take declared jumps of the state into account for the mode that was found.

    Parameters
    ----------
    flow : Flow
        Its work space has the series, and the regions before.
    lane : Lane
        If a jump is due because something else than its guard has fired, it is as after an event
        of that guard.
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
    previous_regions = flow.space.previous_regions
    counters = lane.counters
    code = NOWHERE
    passed, first = passed_jumps(rows, previous_regions, lane.reg)
    if due >= 0:
        if passed > 0 or falls_back(flow, lane, due):
            code = JUMPS_ON
    elif passed > 1 and counters[TAKEN] > 0:
        code = JUMPS_MEET
    late = due < 0 and passed == 1 and counters[TAKEN] > 0
    if late:
        kink = rows.jumps[first, KINK]
        lane.reg[kink] = previous_regions[kink]
        count = note(rows, lane, task, count)
        lane.reg[kink] = 1 - previous_regions[kink]
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
        _, order = leading_term(space.W, guard, flow.order, space.powers, 1.0, spare)
    return 1 < order < flow.order


@compiled()
def collide_if_closing(
    machine: Machine,
    flow: Flow,
    lane: Lane,
    task: Task,
    count: int,
    entering: bool,
    due: int,
    zero: float,
) -> tuple[int, int]:
    """Apply impacts of closing contacts, at the start and after an event.

    Parameters
    ----------
    lane : Lane
        Its rates may jump.
    count : int
        Steps recorded so far; a state that has an impact at the start, or after a jump, is one
        more.
    entering : bool
        Whether the motion starts, or continues, here: it may have been stopped at an impact.
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
    store_gap_sizes(rows, flow.space, lane.seen)
    last = lane.clock[LAST]
    cause = lane.counters[CAUSE]
    if cause < 0 and not entering:
        return NOWHERE, count
    closing = may_collide(rows, cause) and lane.mode[cause - len(rows.kinks)] == 0
    if due >= 0 or not closing:
        # If the event was another one, or none, contacts that touch meanwhile, up to rounding
        # errors, have their impact.
        here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
        if lane.counters[TAKEN] == 0:
            size_gaps(machine, flow, here, lane.clock[SPAN])
        going = due < 0 and (cause >= 0 or lane.counters[TAKEN] > 0)
        opened = just_opened(rows, lane)
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
def has_gaps(rows: Rows) -> bool:
    """Whether a contact can open."""
    found = False
    for gap in rows.gaps:
        found = found or gap >= 0
    return found
