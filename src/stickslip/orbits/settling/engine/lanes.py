"""Single lanes in compiled code: the event loop for one lane, and copies of its state."""

from __future__ import annotations

from stickslip.motion.algebra.vectors import copy
from stickslip.motion.engine.event_loop import integrate
from stickslip.motion.steps.arrays import FULL, Flow, Lane, Record, Task, flow_of
from stickslip.orbits.settling.engine.tables import Engine
from stickslip.translator import compiled

RECORDED = True
UNRECORDED = False


@compiled()
def own_flow(e: Engine, i: int) -> Flow:
    """The system with the numbers of a lane."""
    return flow_of(e.flow, e.group[i])


@compiled()
def follow_lane(
    e: Engine, i: int, end: float, max_events: int, recording: bool, record: Record
) -> int:
    """Run the event loop for one lane, and store its code. Returns the number of recorded steps.

    Parameters
    ----------
    end : float
        Time at which to stop.
    max_events : int
        Number of events, counted from the beginning of the motion, at which to stop.
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
