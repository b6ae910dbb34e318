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


class Desk(NamedTuple):
    """Work space of a thread."""

    space: Space
    flight: Flight
    bench: Bench


class Shared(NamedTuple):
    """Data shared by all threads.

    Attributes
    ----------
    desks : Desk
        Of all threads (a leading axis).
    marks, rules, saved, found : tuples
        As in :func:`stickslip.orbits.settling.engine.measuring.advance_lane`.
    """

    desks: Many[Desk]
    marks: Marks
    rules: Rules
    saved: Many[Lane]
    found: Found


@compiled()
def at_desk(e: Engine, desk: Desk) -> Engine:
    """An engine that works in the space of a thread."""
    f = e.flow
    flow = Flow(f.rows, f.k, desk.space, f.order, f.tol, f.atol, f.supports)
    return Engine(e.machine, flow, desk.flight, e.forms, e.group, e.codes, e.lanes)


@entry_point()
def advance_thread(e: Engine, w: Shared, a: int) -> None:
    """Settle and measure lane a; thread a has separate work space instead of that of e."""
    desk = row_of(w.desks, a)
    mine = at_desk(e, desk)
    advance_lane(mine, w.marks, w.rules, w.saved, desk.bench, w.found, a)


@entry_point()
def grow_thread(e: Engine, twin: Engine, w: Shared, a: int) -> None:
    """The exponent of a lane and its twin: likewise."""
    desk = row_of(w.desks, a)
    mine, other = at_desk(e, desk), at_desk(twin, desk)
    grow_lane(mine, other, w.marks, w.rules, w.saved, desk.bench, w.found, a)
