"""One motion per thread of a GPU: the function of each thread, with its work space."""

from __future__ import annotations

from typing import NamedTuple

from stickslip.arrays import Many
from stickslip.machine_code.functions import entry_point
from stickslip.motion.affine.forms import Flight
from stickslip.motion.steps.arrays import Flow, Lane, Space
from stickslip.orbits.settling.engine.exponents import grow_lane
from stickslip.orbits.settling.engine.measuring import advance_lane
from stickslip.orbits.settling.engine.tables import Bench, Engine, Found, Marks, Rules
from stickslip.translator import compiled, row_of


class ThreadSpace(NamedTuple):
    """Work space of a thread."""

    space: Space
    flight: Flight
    bench: Bench


class Shared(NamedTuple):
    """Data shared by all threads.

    Attributes
    ----------
    threads : ThreadSpace
        Of all threads (a leading axis).
    marks, rules, saved, found : tuples
        As in :func:`stickslip.orbits.settling.engine.measuring.advance_lane`.
    """

    threads: Many[ThreadSpace]
    marks: Marks
    rules: Rules
    saved: Many[Lane]
    found: Found


@compiled()
def in_thread_space(e: Engine, thread: ThreadSpace) -> Engine:
    """An engine that works in the space of a thread."""
    f = e.flow
    flow = Flow(f.rows, f.k, thread.space, f.order, f.tol, f.atol, f.supports)
    return Engine(e.machine, flow, thread.flight, e.forms, e.group, e.codes, e.lanes)


@entry_point()
def advance_thread(e: Engine, w: Shared, a: int) -> None:
    """Settle and measure lane a; thread a has separate work space instead of that of e."""
    thread = row_of(w.threads, a)
    mine = in_thread_space(e, thread)
    advance_lane(mine, w.marks, w.rules, w.saved, thread.bench, w.found, a)


@entry_point()
def grow_thread(e: Engine, twin: Engine, w: Shared, a: int) -> None:
    """The exponent of a lane and its twin, with the work space of the thread."""
    thread = row_of(w.threads, a)
    mine, other = in_thread_space(e, thread), in_thread_space(twin, thread)
    grow_lane(mine, other, w.marks, w.rules, w.saved, thread.bench, w.found, a)
