"""Motions followed until they repeat themselves, in compiled code.

A motion is looked at at its *marks*. If it is driven, these are the times t₀ + mP, P the period of
the first drive; if not, its events, where the guard that fires is a natural section (events that
coincide up to rounding are one), and, once the modes between them have been seen to repeat, only
those after which they begin again; and if it has no events for a while, it is asked whether its
rates have died out, and whether it comes back through the plane across itself.
:mod:`stickslip.orbits.settling.engine.returns` says how closely it comes back.

* A motion whose returns go on as they have, which the last one has to confirm, is carried on by
  hand to where they lead, down to rounding (a step that does not bring it nearer is undone). If
  that is no farther away than the tolerance, it has settled; otherwise it is proved on the host
  that the motion comes there by itself (:mod:`stickslip.orbits.settling.attraction`). If it does
  not, it is taken back, and waits.
* Rest, steady sliding, and oscillations without any further event are proved on the host
  (:mod:`stickslip.orbits.settling.proofs`), which the motion waits for.
* Where time stands in one sine or cosine only, the clock is set back to t₀ at every mark, so that
  the millionth period is as exact as the first one.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array, Many
from stickslip.machine_code.functions import entry_point
from stickslip.motion.engine.event_loop import integrate
from stickslip.motion.modes.guards import stands
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.outcome import Outcome
from stickslip.motion.steps.arrays import (
    CAUSE,
    EMPTY_WORD,
    FINISHED,
    FULL,
    HAPPENED,
    LAST,
    LIMIT,
    LONG_AGO,
    NOW,
    OK,
    SERIES,
    SINCE,
    WORD,
    Flow,
    Instant,
    Lane,
    Record,
    Task,
    flow_of,
    is_stopped,
)
from stickslip.motion.steps.roots import horner
from stickslip.motion.steps.starting import coefficients
from stickslip.motion.steps.step_size import better
from stickslip.motion.steps.stiff import follow_mode as along
from stickslip.motion.steps.vectors import copy
from stickslip.orbits.settling.engine.frames import find_frame
from stickslip.orbits.settling.engine.returns import (
    MOST_RETURNS,
    RETURN_PATIENCE,
    begin_again,
    bring_home,
    distance,
    extrapolate,
    foretold,
    grow,
    has_settled,
    look_back,
    look_wide,
    miss,
    remember,
    remove_shift,
    shortest_lag,
    words_alike,
)
from stickslip.orbits.settling.engine.tables import (
    ASK,
    COUNT,
    DONE,
    DURATION,
    EVENTLESS,
    EVENTS,
    FLOOR,
    HOME,
    LAG,
    LATEST,
    LEAPT,
    MEASURING,
    MISS,
    PATIENT,
    PHASE,
    PROVING,
    REACH,
    REST,
    SAME,
    SETTLING,
    STALLED,
    START,
    STRETCH,
    STRIDE,
    TRUE,
    WARY,
    Bench,
    Engine,
    Marks,
    Rules,
)
from stickslip.translator import compiled

AT_REST = int(Outcome.AT_REST.code)
PERIODIC = int(Outcome.PERIODIC.code)
STEADY = int(Outcome.STEADY.code)
NOT_SETTLED = int(Outcome.NOT_SETTLED.code)
_NOTHING_YET = -1  # outcome of a motion whose fate the host is asked for

RECORDED = True
UNRECORDED = False

_GO_ON = 0  # what is done after a mark
_CARRIED = 1
_SETTLED = 2
_BEGUN = -8  # kind of the marks at which the modes of a motion begin to be followed as a whole
_KEPT = 3  # returns before, that are kept then
# first periods of a drive in which a look between marks sees what vanishes at them
_GROWING = 8
_HALFWAY = 0.618  # of a period: how long before the mark that look is
_FADED = 100.0  # tolerances that an oscillation may still be away from an equilibrium
_FARTHEST = 0.5  # largest size of what a motion is carried on by
_AGAIN = 2.0  # first leaps that the next one may be as long as
_NEAREST = 1e-14  # a miss that is rounding
_FITS = 0.1  # part of a return that its combination may leave over
_MOST_LEAPS = 8  # that polishing may take
_MOST_POLISHED = 24  # returns that polishing may take
_AT_ONCE = 1e-3  # of a period: a return so soon is none
_WIDER = 1.25  # of a period: in which a smooth motion that is polished comes back


@compiled()
def own_flow(e: Engine, i: int) -> Flow:
    """The system with the numbers of a lane."""
    return flow_of(e.flow, e.group[i])


@compiled()
def follow_lane(
    e: Engine, i: int, end: float, max_events: int, recording: bool, record: Record
) -> int:
    """The event loop for one lane; its code stays behind. Returns the number of recorded steps.

    Parameters
    ----------
    e : Engine
    i : int
    end : float
        Time at which to stop.
    max_events : int
        Number of events, counted from the beginning of the motion, at which to stop.
    recording : bool
    record : Record
        Receives the steps.
    """
    a = i
    b = i + 1
    s = e.lanes
    lane = Lane(
        s.clock[a:b],
        s.y[a:b],
        s.seen[a:b],
        s.mode[a:b],
        s.settled[a:b],
        s.reg[a:b],
        s.counters[a:b],
    )
    e.codes[i] = FULL
    task = Task(end, max_events, recording, record)
    return integrate(e.machine, e.flow, e.flight, e.forms, e.group[a:b], e.codes[a:b], lane, task)


@compiled()
def copy_lane(source: Lane, i: int, target: Lane, j: int) -> None:
    """Copy where a lane is."""
    copy(source.clock[i], target.clock[j])
    copy(source.y[i], target.y[j])
    copy(source.seen[i], target.seen[j])
    copy(source.mode[i], target.mode[j])
    copy(source.settled[i], target.settled[j])
    copy(source.reg[i], target.reg[j])
    copy(source.counters[i], target.counters[j])


@compiled()
def dies_out(
    e: Engine, m: Marks, rules: Rules, i: int, tolerance: float, look: float, work: Array
) -> bool:
    """Whether the rates of a lane, without frame and translation, are so small that nothing more
    will change.

    Parameters
    ----------
    e : Engine
    m : Marks
    rules : Rules
    i : int
    tolerance : float
        Largest change of a component, relative to its size.
    look : float
        Time in which the rates make that change.
    work : array, shape (n,)
        Receives the changes.
    """
    flow = own_flow(e, i)
    s = e.lanes
    w = flow.space
    w.known[-1] = 1
    w.W[len(work), 1] = 1.0
    if not resolve(flow.rows, flow.k, w, s.mode[i]):
        return False
    here = Instant(s.clock[i, NOW], s.y[i], s.mode[i], s.reg[i])
    if coefficients(e.machine, flow, here, 1, w.W) != OK:
        return False
    for r in range(len(work)):
        work[r] = (w.W[r, 1] - m.frame[i, r]) * look
    remove_shift(work, rules.shifts)
    return miss(work, m.size[i], rules.real[4]) <= tolerance


# -- the loop over marks ---------------------------------------------------------------------------


@entry_point()
def settle_all(e: Engine, m: Marks, rules: Rules, saved: Many[Lane], bench: Bench) -> None:
    """Follow all lanes until they have settled, as far as they come without the host.

    Parameters
    ----------
    e : Engine
    m : Marks
    rules : Rules
    saved : Lane
    bench : Bench
    """
    for i in range(len(e.codes)):
        if m.numbers[i, PHASE] == SETTLING:
            settle_lane(e, m, rules, saved, bench, i)


@compiled()
def settle_lane(e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, i: int) -> None:
    """Follow a lane until its phase is another one, or there is a wish to stop.

    What is to be measured then starts at the saved state, and lasts as long as the marks say.

    Parameters
    ----------
    e : Engine
    m : Marks
    rules : Rules
    saved : Lane
    bench : Bench
    i : int
    """
    s = e.lanes
    numbers = m.numbers[i]
    drive = m.drive[i]
    if numbers[LEAPT] < 0:
        take_back(m, s, saved, i)
    known = 0
    for _ in range(rules.most[2]):
        if is_stopped(e.flow.space):
            return
        smooth = numbers[EVENTLESS] == 1
        count = follow_lane(
            e,
            i,
            next_stop(m, rules, i, s.clock[i, NOW]),
            next_event(m, rules, s, saved, i),
            smooth,
            bench.record,
        )
        code = e.codes[i]
        happened = e.codes[i] == LIMIT and s.counters[i, HAPPENED] < rules.most[1]
        if rules.framed and e.forms.used[e.group[i]] != known:
            known = e.forms.used[e.group[i]]
            find_frame(e.forms, e.group[i], e.flight, m.frame[i])
        if not (happened or code in (FINISHED, FULL)):
            if numbers[LEAPT] != 0:
                # What was carried on by hand may have been taken to where no motion starts.
                take_back(m, s, saved, i)
                continue
            m.outcome[i], numbers[PHASE] = code, DONE
            return
        verdict = cross_plane(e, m, rules, saved, bench, i, count) if smooth else _GO_ON
        if verdict == _GO_ON and code != FULL:
            if put_mark(m, rules, s, saved, i, happened, bench.work[0]):
                verdict = consider(m, rules, s, saved, bench.work, bench.fit, i)
            if verdict == _GO_ON and not happened:
                verdict = look_around(e, m, rules, saved, bench, i)
        if verdict == _SETTLED:
            if drive > 0.0 or m.outcome[i] != PERIODIC:
                return
            # An oscillation that has died out returns, too.
            copy_lane(saved, i, s, i)
            if not dies_out(
                e, m, rules, i, _FADED * rules.real[3], m.real[i, DURATION], bench.work[0]
            ):
                return
            take_back(m, s, saved, i)
            numbers[PHASE] = SETTLING
        late = elapsed(m, rules, s, i) >= m.real[i, LATEST] or numbers[COUNT] >= rules.most[
            0
        ] * max(numbers[LAG], 1)
        if numbers[LEAPT] == 0 and late:
            copy_lane(s, i, saved, i)
            m.real[i, START] = s.clock[i, NOW]
            m.real[i, DURATION] = long_look(m, rules, i, s.clock[i, NOW])
            m.outcome[i], numbers[PHASE] = NOT_SETTLED, MEASURING
            return


@compiled()
def next_mark(m: Marks, rules: Rules, i: int) -> float:
    """Time of the next mark of a driven motion."""
    count = m.numbers[i, COUNT]
    return rules.real[0] + (count if rules.timed else min(count, 1)) * m.drive[i]


@compiled()
def elapsed(m: Marks, rules: Rules, lanes: Lane, i: int) -> float:
    """The time, where the clock has not been set back."""
    set_back = (
        (m.numbers[i, COUNT] - 1) * m.drive[i] if m.drive[i] > 0.0 and not rules.timed else 0.0
    )
    return lanes.clock[i, NOW] + set_back


@compiled()
def next_event(m: Marks, rules: Rules, lanes: Lane, saved: Lane, i: int) -> int:
    """Number of the event at which the next mark may be.

    Parameters
    ----------
    m : Marks
    rules : Rules
    lanes, saved : Lane
        Where the motion is; and was at its last mark.
    i : int
    """
    if m.drive[i] > 0.0:
        return rules.most[1]
    stride = m.numbers[i, STRIDE]
    last = saved.counters[i, HAPPENED] + stride if stride > 0 else lanes.counters[i, HAPPENED] + 1
    return min(last, rules.most[1])


@compiled()
def next_stop(m: Marks, rules: Rules, i: int, t: float) -> float:
    """The next mark of a driven motion (or a look between its first ones); the next look at any
    other."""
    start = rules.real[0]
    look = rules.real[2]
    drive = m.drive[i]
    count = m.numbers[i, COUNT]
    if drive > 0.0:
        mark = next_mark(m, rules, i)
        halfway = mark - _HALFWAY * drive
        return halfway if 0 < count <= _GROWING and t < halfway - 1e-3 * drive else mark
    target = start + look * (math.floor((t - start) / look + 1e-9) + 1.0)
    lag = m.numbers[i, LAG]
    ring = m.time.shape[1]
    if m.numbers[i, EVENTLESS] == 1 and m.numbers[i, LEAPT] > 0:
        target = min(
            target,
            t + _WIDER * (m.time[i, (count - 1) % ring] - m.time[i, (count - 1 - lag) % ring]),
        )
    return target


@compiled()
def put_mark(
    m: Marks, rules: Rules, lanes: Lane, saved: Lane, i: int, happened: bool, work: Array
) -> bool:
    """Put a mark, where there is one: at the end of a period of the drive, or at an event.

    Parameters
    ----------
    m : Marks
    rules : Rules
    lanes, saved : Lane
        Where the motion is; and was at its last mark.
    i : int
    happened : bool
        Whether the lane is at an event.
    work : array, shape (n,)
    """
    numbers = m.numbers[i]
    t = lanes.clock[i, NOW]
    y = lanes.y[i]
    word = lanes.counters[i, WORD]
    grow(m, rules, i, t, y, work)
    if m.drive[i] > 0.0:
        if t < next_mark(m, rules, i) - 0.5 * _HALFWAY * m.drive[i]:
            return False  # between two marks
        if not rules.timed:
            lanes.clock[i, NOW] = rules.real[0]
            lanes.clock[i, LONG_AGO] = lanes.clock[i, LONG_AGO] - (t - rules.real[0])
            lanes.clock[i, SINCE] = lanes.clock[i, SINCE] - (t - rules.real[0])
        remember(m, i, 0, word, lanes.clock[i, NOW], y)
    elif happened and word != EMPTY_WORD:
        ring = m.time.shape[1]
        last = (numbers[COUNT] - 1) % ring
        numbers[EVENTLESS] = 0
        if numbers[STRIDE] > 0:
            for j in range(min(numbers[COUNT], _KEPT)):
                before = (last - j) % ring
                if m.kind[i, before] == _BEGUN:
                    m.kind[i, before] = m.word[i, before] = word
            if m.kind[i, last] != word and numbers[LEAPT] == 0:
                # What repeated was a part of the cycle: more of it has to be seen the next time.
                numbers[WARY] = min(2 * numbers[WARY] + 2, rules.most[3])
                numbers[STRIDE] = 0
        remember(m, i, word, word, t, y)
        m.events[i, (numbers[COUNT] - 1) % ring] = lanes.counters[i, HAPPENED]
    else:
        return False
    lanes.counters[i, WORD] = EMPTY_WORD
    copy_lane(lanes, i, saved, i)
    return True


@compiled()
def begin_strides(m: Marks, i: int) -> None:
    """From now on marks are put only where the modes of a motion, which have been seen to repeat
    after a lag, begin again.

    Parameters
    ----------
    m : Marks
    i : int
    """
    numbers = m.numbers[i]
    ring = m.time.shape[1]
    here = numbers[COUNT] - 1
    lag = numbers[LAG]
    # The lag may be a multiple of the shortest after which they do.
    p = 1
    same = 0
    while p < lag and same < lag:
        same = 0
        while same < lag and m.kind[i, (here - same) % ring] == m.kind[i, (here - same - p) % ring]:
            same += 1
        if same < lag:
            p += 1
    numbers[STRIDE] = m.events[i, here % ring] - m.events[i, (here - p) % ring]
    kept = 1
    while kept < _KEPT and kept * p <= min(here, ring - 1, numbers[SAME]):
        source = (here - kept * p) % ring
        target = (here - kept) % ring
        m.time[i, target] = m.time[i, source]
        copy(m.state[i, source], m.state[i, target])
        kept += 1
    for j in range(kept):
        m.kind[i, (here - j) % ring] = _BEGUN
    numbers[TRUE] = kept - 1
    begin_again(m, i, 1)


@compiled()
def look_around(e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, i: int) -> int:
    """See whether a motion that has had no events for a while has come to an end, which the host
    has to prove.

    Parameters
    ----------
    e : Engine
    m : Marks
    rules : Rules
    saved : Lane
    bench : Bench
    i : int

    Returns
    -------
    int
        SETTLED if it seems to have, else GO_ON.
    """
    s = e.lanes
    numbers = m.numbers[i]
    t = e.lanes.clock[i, NOW]
    drive = m.drive[i]
    if drive > 0.0 and t > m.time[i, (numbers[COUNT] - 1) % m.time.shape[1]]:
        return _GO_ON  # between two marks
    if numbers[LEAPT] != 0 and drive <= 0.0 and is_lost(m, rules, i, t):
        return take_back(m, s, saved, i)
    calm = s.counters[i, HAPPENED] == numbers[EVENTS] and numbers[LEAPT] == 0
    numbers[EVENTS] = s.counters[i, HAPPENED]
    # A contact without friction reverses again and again while everything dies out.
    faded = (
        drive <= 0.0
        and numbers[LEAPT] == 0
        and dies_out(e, m, rules, i, rules.real[3], rules.real[2], bench.work[0])
    )
    if calm and drive <= 0.0 and numbers[EVENTLESS] == 0:
        put_plane(m, i, t, s.y[i], bench.work[0])
    if not ((faded or (calm and rules.closed)) and elapsed(m, rules, s, i) >= m.real[i, ASK]):
        return _GO_ON
    copy_lane(s, i, saved, i)
    numbers[STRIDE] = 0
    m.real[i, START] = t
    m.real[i, DURATION] = drive if drive > 0.0 else rules.real[2]
    m.outcome[i] = _NOTHING_YET
    if faded:
        # A system without contacts moves, too.
        m.outcome[i] = AT_REST if stands(e.flow.rows, s.mode[i]) else STEADY
    numbers[PHASE] = PROVING
    return _SETTLED


@compiled()
def is_lost(m: Marks, rules: Rules, i: int, t: float) -> bool:
    """Whether a motion that is carried on by hand does not return: it may have been taken to where
    it comes to rest."""
    ring = m.time.shape[1]
    last = m.numbers[i, COUNT] - 1
    period = m.time[i, last % ring] - m.time[i, (last - m.numbers[i, LAG]) % ring]
    return t - m.time[i, last % ring] > 2.0 * max(period, rules.real[2])


# -- what a mark says ------------------------------------------------------------------------------


@compiled()
def consider(
    m: Marks, rules: Rules, lanes: Lane, saved: Lane, work: Array, fit: Array, i: int
) -> int:
    """Compare the last mark, at which the saved lane is, with those before it, and decide what is
    done.

    Parameters
    ----------
    m : Marks
    rules : Rules
    lanes, saved : Lane
    work, fit : arrays, shapes (9, n), (4, 4)
        Work space.
    i : int

    Returns
    -------
    int
        GO_ON, CARRIED or SETTLED.
    """
    numbers = m.numbers[i]
    before = m.numbers[i, LAG]
    d = look_back(m, rules, i, work[0])
    lag, leapt = numbers[LAG], numbers[LEAPT]
    if leapt != 0:
        if lag != before:
            return take_back(m, lanes, saved, i)
        return polish(m, rules, lanes, saved, work, fit, i, d)
    if lag == 0 or numbers[SAME] < 1:
        return _GO_ON
    if has_settled(m, rules, i, d) and not (
        rules.timed and elapsed(m, rules, saved, i) < m.real[i, ASK]
    ):
        leave(m, saved, i, d)
        m.real[i, PATIENT] = 0.1 * d
        return polish(m, rules, lanes, saved, work, fit, i, distance(m, rules, i, lag, work[0]))
    whole = m.drive[i] > 0.0 or numbers[STRIDE] > 0 or numbers[EVENTLESS] == 1
    if not whole and numbers[SAME] > max(lag, numbers[WARY]):
        begin_strides(m, i)
    elif numbers[STALLED] > RETURN_PATIENCE * lag and d > rules.real[3]:
        look_wide(m, rules, i, work[0])
    elif whole and rules.leaping and numbers[COUNT] >= numbers[REST]:
        k = foretold(m, rules, i, work, fit)
        if k > 0:
            return leap(m, rules, lanes, saved, work, fit, i, d, k)
    return _GO_ON


@compiled()
def leave(m: Marks, saved: Lane, i: int, d: float) -> None:
    """Keep where the motion itself is, before it is carried on by hand.

    Parameters
    ----------
    m : Marks
    saved : Lane
    i : int
    d : float
        What the last return misses by.
    """
    numbers, real = m.numbers[i], m.real[i]
    copy_lane(saved, i, m.home, i)
    numbers[LEAPT] = 1
    numbers[HOME] = numbers[COUNT]
    real[MISS] = d
    real[REACH] = 0.0


@compiled()
def leap(
    m: Marks,
    rules: Rules,
    lanes: Lane,
    saved: Lane,
    work: Array,
    fit: Array,
    i: int,
    d: float,
    k: int,
) -> int:
    """Carry a motion on to where its returns lead, a recurrence of order k, unless that is far
    away.

    Parameters
    ----------
    m : Marks
    rules : Rules
    lanes, saved : Lane
    work, fit : arrays, shapes (9, n), (4, 4)
        Work space.
    i : int
    d : float
        What the last return misses by.
    k : int

    Returns
    -------
    int
        CARRIED, or GO_ON if it is not.
    """
    _, length = extrapolate(m, rules, i, k, work, fit)
    # What the last return misses by is at most twice what is missing.
    if not 0.25 * d <= length <= _FARTHEST:
        return _GO_ON
    leave(m, saved, i, d)
    m.numbers[i, LEAPT] = 2
    m.real[i, REACH] = length
    m.real[i, STRETCH] = length / d
    return carry(m, lanes, saved, i, work[8])


@compiled()
def carry(m: Marks, lanes: Lane, saved: Lane, i: int, step: Array) -> int:
    """Carry a motion on by a step, at its last mark.

    Parameters
    ----------
    m : Marks
    lanes, saved : Lane
        Receive the new state.
    i : int
    step : array, shape (n,)

    Returns
    -------
    int
        CARRIED.
    """
    last = (m.numbers[i, COUNT] - 1) % m.time.shape[1]
    numbers = m.numbers[i]
    copy_lane(saved, i, m.before, i)
    for r in range(len(step)):
        saved.y[i, r] += step[r]
    copy(saved.y[i], m.state[i, last])
    copy_lane(saved, i, lanes, i)
    numbers[TRUE], numbers[SAME] = 0, 0
    return _CARRIED


@compiled()
def put_back(m: Marks, lanes: Lane, saved: Lane, i: int, kept: Lane, count: int) -> int:
    """Put a motion back to where it was at a mark, which is the last one again.

    Parameters
    ----------
    m : Marks
    lanes, saved : Lane
        Receive where it was.
    i : int
    kept : Lane
        Where it was.
    count : int
        Number of marks up to that one.

    Returns
    -------
    int
        CARRIED.
    """
    numbers = m.numbers[i]
    last = (count - 1) % m.time.shape[1]
    copy_lane(kept, i, saved, i)
    copy_lane(kept, i, lanes, i)
    m.time[i, last] = kept.clock[i, NOW]
    copy(kept.y[i], m.state[i, last])
    numbers[COUNT] = count
    numbers[TRUE] = 0
    numbers[LEAPT] = 0
    begin_again(m, i, numbers[LAG])
    return _CARRIED


@compiled()
def take_back(m: Marks, lanes: Lane, saved: Lane, i: int) -> int:
    """Take a motion back to where it was before it was carried on by hand, and let it go on by
    itself."""
    numbers = m.numbers[i]
    # Later and later, so that where no leap is right few are tried.
    patience = max(RETURN_PATIENCE * max(numbers[LAG], 1), numbers[HOME] // 2)
    numbers[REST] = numbers[HOME] + patience
    return put_back(m, lanes, saved, i, m.home, numbers[HOME])


@compiled()
def polish(
    m: Marks, rules: Rules, lanes: Lane, saved: Lane, work: Array, fit: Array, i: int, d: float
) -> int:
    """Carry a motion that seems to have settled on to its cycle, down to rounding.

    Parameters
    ----------
    m : Marks
    rules : Rules
    lanes, saved : Lane
    work, fit : arrays, shapes (9, n), (4, 4)
        Work space.
    i : int
    d : float
        What the last return misses by.

    Returns
    -------
    int
        GO_ON, CARRIED or SETTLED.
    """
    numbers = m.numbers[i]
    real = m.real[i]
    lag = m.numbers[i, LAG]
    ring = m.time.shape[1]
    if (numbers[COUNT] - numbers[HOME]) % lag != 0 or numbers[TRUE] < lag:
        return _GO_ON
    if real[REACH] > 0.0 and words_alike(m, i, lag, lag) < lag:
        return take_back(m, lanes, saved, i)
    if numbers[TRUE] == lag and numbers[LEAPT] > 1 and d > 0.5 * real[MISS]:
        put_back(m, lanes, saved, i, m.before, numbers[COUNT] - lag)
        numbers[LEAPT] = 1
        return accept(m, rules, lanes, saved, work[0], i, real[MISS])
    real[MISS] = d
    if (
        d <= _NEAREST
        or numbers[COUNT] - numbers[HOME] >= _MOST_POLISHED * lag
        or numbers[LEAPT] > _MOST_LEAPS
    ):
        return accept(m, rules, lanes, saved, work[0], i, d)
    returns = min(numbers[TRUE] // lag, (ring - 1) // lag)
    for k in range(1, min(returns - 1, MOST_RETURNS) + 1):
        misfit, length = extrapolate(m, rules, i, k, work, fit)
        if (misfit <= _FITS or k == MOST_RETURNS) and length <= max(
            rules.real[5], _AGAIN * real[REACH]
        ):
            numbers[LEAPT] += 1
            real[STRETCH] = max(real[STRETCH], length / d)
            return carry(m, lanes, saved, i, work[8])
    return _GO_ON


@compiled()
def accept(m: Marks, rules: Rules, lanes: Lane, saved: Lane, work: Array, i: int, d: float) -> int:
    """Take the polished cycle for what the motion has settled on, if that was within the tolerance
    of it; if not, it has to be proved that it comes there.

    Parameters
    ----------
    m : Marks
    rules : Rules
    lanes, saved : Lane
    work : array, shape (n,)
    i : int
    d : float
        What the polished cycle misses by.

    Returns
    -------
    int
        SETTLED, or CARRIED if it is taken back.
    """
    numbers = m.numbers[i]
    real = m.real[i]
    ring = m.time.shape[1]
    for r in range(len(work)):
        work[r] = (
            saved.y[i, r]
            - m.home.y[i, r]
            - m.frame[i, r] * (saved.clock[i, NOW] - m.home.clock[i, NOW])
        )
    bring_home(work, m, rules, i)
    here = miss(work, m.size[i], rules.real[4]) <= rules.real[5]
    afar = real[REACH] > 0.0
    if not d <= (rules.real[3] if afar else rules.real[5]) or not (afar or here):
        return take_back(m, lanes, saved, i)
    real[FLOOR] = d
    numbers[LAG], last = shortest_lag(m, rules, i, work), numbers[COUNT] - 1
    numbers[LEAPT] = 0 if here else 1
    real[START] = m.time[i, last % ring]
    real[DURATION] = m.drive[i] * numbers[LAG]
    if m.drive[i] <= 0.0:
        real[DURATION] = m.time[i, last % ring] - m.time[i, (last - numbers[LAG]) % ring]
    m.outcome[i] = PERIODIC
    numbers[PHASE] = PROVING if rules.timed or not here else MEASURING
    return _SETTLED


# -- motions without events ------------------------------------------------------------------------


@compiled()
def put_plane(m: Marks, i: int, t: float, y: Array, work: Array) -> None:
    """Lay a plane through the present state across the motion, whose rates are in the work
    space.

    Parameters
    ----------
    m : Marks
        Receive the plane.
    i : int
    t : float
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
    """On which side of the plane a state is, and how far.

    Parameters
    ----------
    m : Marks
    rules : Rules
    i : int
    t : float
    y : array, shape (n,)
        Time and state.
    work : array, shape (n,)
    """
    for r in range(len(y)):
        work[r] = y[r] - m.plane[i, 0, r] - m.frame[i, r] * (t - m.plane[i, 2, 0])
    bring_home(work, m, rules, i)
    total = 0.0
    for r in range(len(y)):
        total += m.plane[i, 1, r] * work[r]
    return total


@compiled()
def cross_plane(
    e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, i: int, count: int
) -> int:
    """Put a mark wherever one of the recorded Taylor steps passes the plane upwards, and see what
    it says.

    A motion that is carried on by hand starts again from there.

    Parameters
    ----------
    e : Engine
    m : Marks
    rules : Rules
    saved : Lane
    bench : Bench
    i, count : int
        The lane, and how many steps are recorded.

    Returns
    -------
    int
        GO_ON, CARRIED or SETTLED.
    """
    flow = own_flow(e, i)
    s = flow.space
    f = e.flight
    N = flow.order
    verdict = _GO_ON
    record = bench.record
    work = bench.work
    lanes = e.lanes
    for j in range(count):
        if verdict != _GO_ON:
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
        if not abs(height(m, rules, i, after, work[1], work[0]) - ahead) <= 1e-6 * abs(ahead):
            # a flight in closed form: its modes are linear, and have no cycle of their own
            continue
        for _ in range(60):
            middle = 0.5 * (low + high)
            point_on(s.W, N, middle / unit, work[1])
            if height(m, rules, i, t + middle, work[1], work[0]) > 0.0:
                high = middle
            else:
                low = middle
        if m.numbers[i, LEAPT] > 0 and starts_there(m, i, t + high):
            continue
        point_on(s.W, N, high / unit, s.trial)
        remember(m, i, -1, 0, t + high, s.trial)
        copy_lane(lanes, i, saved, i)
        put_at(saved, i, t + high, after - t, s.trial, f.mode0, f.reg0)
        saved.clock[i, SERIES] = series if step > series else after - t
        verdict = consider(m, rules, lanes, saved, bench.work, bench.fit, i)
        if verdict == _GO_ON and m.numbers[i, LEAPT] > 0:
            copy_lane(saved, i, lanes, i)
            verdict = _CARRIED
    return verdict


@compiled()
def starts_there(m: Marks, i: int, t: float) -> bool:
    """Whether a motion that is carried on by hand, which starts in the plane up to rounding, has
    not left it yet at a time."""
    ring = m.time.shape[1]
    last = m.numbers[i, COUNT] - 1
    start = m.time[i, last % ring]
    return t - start < _AT_ONCE * (start - m.time[i, (last - 1) % ring])


@compiled()
def put_at(
    lanes: Lane, i: int, t: float, step: float, y: Array, mode: Array, region: Array
) -> None:
    """Put a lane at a point within a step.

    Parameters
    ----------
    lanes : Lane
        Receive the point.
    i : int
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


@compiled()
def long_look(m: Marks, rules: Rules, i: int, t: float) -> float:
    """So many periods of the drive as a cycle may have, or the duration from the oldest mark of the
    same kind."""
    count = m.numbers[i, COUNT]
    ring = m.time.shape[1]
    most = rules.most[3]
    if m.drive[i] > 0.0:
        return m.drive[i] * max(min(count - 1, most), 1)
    for back in range(min(count, most), 0, -1):
        j = (count - back) % ring
        if m.kind[i, j] == m.kind[i, (count - 1) % ring] and m.time[i, j] < t:
            return t - m.time[i, j]
    return rules.real[2]
