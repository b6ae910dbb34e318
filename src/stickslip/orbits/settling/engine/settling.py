"""Simulation of motions until they repeat, in compiled code.

A motion is compared at its *marks*. If it is driven, these are the times t₀ + mP, P the period of
the first drive; if not, its events, since the guard that fires is a natural section (events that
coincide up to rounding are one). Once the modes between events are observed to repeat, only events
at the start of the repeated sequence are marks. If there are no events for some time, the tests are
whether the rates have vanished, and whether the motion returns through the plane normal to it.
:mod:`stickslip.orbits.settling.engine.marks` adds the marks, and
:mod:`stickslip.orbits.settling.engine.crossing` those in the plane;
:mod:`stickslip.orbits.settling.engine.returns` measures the distance of returns, and
:mod:`stickslip.orbits.settling.engine.leaping` decides how to proceed.

* If the returns of a motion are predictable, as confirmed by the last one, their limit is
  extrapolated, down to rounding (a step that does not reduce the distance is undone). If the limit
  is within the tolerance, the motion has settled; otherwise the host must prove that the motion
  converges to it (:mod:`stickslip.orbits.settling.attraction`). If the proof fails, the motion is
  reset, and continues.
* Rest, steady sliding, and oscillations without further events are proved on the host
  (:mod:`stickslip.orbits.settling.proofs`); the motion waits for the result.
* If time occurs in one sine or cosine only, the clock is reset to t₀ at every mark, so that the
  millionth period is as accurate as the first one.
"""

from __future__ import annotations

from stickslip.arrays import Array, Many
from stickslip.machine_code.functions import entry_point
from stickslip.motion.modes.guards import stands
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    FINISHED,
    FULL,
    HAPPENED,
    LIMIT,
    NOW,
    OK,
    Instant,
    Lane,
    is_stopped,
)
from stickslip.motion.steps.starting import coefficients
from stickslip.orbits.settling.engine.crossing import cross_plane, put_plane
from stickslip.orbits.settling.engine.frames import find_frame
from stickslip.orbits.settling.engine.lanes import copy_lane, follow_lane, own_flow
from stickslip.orbits.settling.engine.leaping import (
    GO_ON,
    SETTLED,
    consider,
    fails_to_return,
    reset_motion,
)
from stickslip.orbits.settling.engine.marks import (
    elapsed,
    long_look,
    next_event,
    next_stop,
    put_mark,
)
from stickslip.orbits.settling.engine.returns import miss, remove_shift
from stickslip.orbits.settling.engine.tables import (
    ASK,
    AT_REST,
    COUNT,
    DONE,
    DURATION,
    EVENTLESS,
    EVENTS,
    LAG,
    LATEST,
    LEAPT,
    MEASURING,
    NOT_SETTLED,
    PERIODIC,
    PHASE,
    PROVING,
    SETTLING,
    START,
    STEADY,
    STRIDE,
    Bench,
    Engine,
    Marks,
    Rules,
)
from stickslip.translator import compiled

_NOTHING_YET = -1  # outcome of a motion that the host has to decide
_FADED = 100.0  # distance of an oscillation from an equilibrium, in tolerances


@entry_point()
def settle_all(e: Engine, m: Marks, rules: Rules, saved: Many[Lane], bench: Bench) -> None:
    """Follow all lanes until they have settled, or need the host."""
    for i in range(len(e.codes)):
        if m.numbers[i, PHASE] == SETTLING:
            settle_lane(e, m, rules, saved, bench, i)


@compiled()
def settle_lane(e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, i: int) -> None:
    """Simulate a lane until its phase changes, or a stop is requested.

    The measured interval then starts at the saved state, and its duration is in the marks.
    """
    s = e.lanes
    numbers = m.numbers[i]
    drive = m.drive[i]
    if numbers[LEAPT] < 0:
        reset_motion(m, s, saved, i)
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
                # An extrapolated state may not be the start of a motion.
                reset_motion(m, s, saved, i)
                continue
            m.outcome[i], numbers[PHASE] = code, DONE
            return
        verdict = cross_plane(e, m, rules, saved, bench, i, count) if smooth else GO_ON
        if verdict == GO_ON and code != FULL:
            if put_mark(m, rules, s, saved, i, happened, bench.work[0]):
                verdict = consider(m, rules, s, saved, bench.work, bench.fit, i)
            if verdict == GO_ON and not happened:
                verdict = test_for_rest(e, m, rules, saved, bench, i)
        if verdict == SETTLED:
            if drive > 0.0 or m.outcome[i] != PERIODIC:
                return
            # An oscillation that has died out returns, too.
            copy_lane(saved, i, s, i)
            if not rates_vanish(
                e, m, rules, i, _FADED * rules.real[3], m.real[i, DURATION], bench.work[0]
            ):
                return
            reset_motion(m, s, saved, i)
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
def test_for_rest(e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, i: int) -> int:
    """Test whether a motion without recent events has reached its final state, which the host then
    has to prove.

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
        return GO_ON  # between two marks
    if numbers[LEAPT] != 0 and drive <= 0.0 and fails_to_return(m, rules, i, t):
        return reset_motion(m, s, saved, i)
    calm = s.counters[i, HAPPENED] == numbers[EVENTS] and numbers[LEAPT] == 0
    numbers[EVENTS] = s.counters[i, HAPPENED]
    # A contact without friction reverses again and again while everything dies out.
    faded = (
        drive <= 0.0
        and numbers[LEAPT] == 0
        and rates_vanish(e, m, rules, i, rules.real[3], rules.real[2], bench.work[0])
    )
    if calm and drive <= 0.0 and numbers[EVENTLESS] == 0:
        put_plane(m, i, t, s.y[i], bench.work[0])
    if not ((faded or (calm and rules.closed)) and elapsed(m, rules, s, i) >= m.real[i, ASK]):
        return GO_ON
    copy_lane(s, i, saved, i)
    numbers[STRIDE] = 0
    m.real[i, START] = t
    m.real[i, DURATION] = drive if drive > 0.0 else rules.real[2]
    m.outcome[i] = _NOTHING_YET
    if faded:
        # A system without contacts moves, too.
        claim_rest(e, m, s.mode[i], i)
    numbers[PHASE] = PROVING
    return SETTLED


@compiled()
def claim_rest(e: Engine, m: Marks, mode: Array, i: int) -> None:
    """Claim that a lane has come to rest or slides steadily, for proof by the host."""
    m.outcome[i] = AT_REST if stands(e.flow.rows, mode) else STEADY


@compiled()
def rates_vanish(
    e: Engine, m: Marks, rules: Rules, i: int, tolerance: float, look: float, work: Array
) -> bool:
    """Return whether the rates of a lane, without frame and translation, are too small for a
    further change.

    Parameters
    ----------
    tolerance : float
        Largest change of a component, relative to its size.
    look : float
        Time over which the rates would cause that change.
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
