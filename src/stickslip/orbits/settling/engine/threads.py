"""One motion a thread of a GPU: what each thread calls, with the work space that is its own."""

from __future__ import annotations

from typing import NamedTuple

from stickslip.arrays import IntVector, Many
from stickslip.machine_code.functions import entry_point
from stickslip.motion.engine.forms import Flight
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


@compiled()
def at_desk(e: Engine, desk: Desk) -> Engine:
    """An engine that works in the space of a thread."""
    f = e.flow
    flow = Flow(f.rows, f.k, desk.space, f.order, f.tol, f.atol)
    return Engine(e.machine, flow, desk.flight, e.forms, e.group, e.codes, e.lanes)


@entry_point()
def advance_thread(
    e: Engine,
    desks: Many[Desk],
    m: Marks,
    rules: Rules,
    saved: Many[Lane],
    found: Found,
    stop: IntVector,
    a: int,
) -> None:
    """Settle and measure the lane of a thread.

    Parameters
    ----------
    e : Engine
        Its own work space is not used.
    desks : Desk
        Of all threads (a leading axis).
    m, rules, saved, found, stop : tuples and array
        As of :func:`stickslip.orbits.settling.engine.measuring.advance_lane`.
    a : int
        Number of the thread, and of its lane.
    """
    desk = row_of(desks, a)
    advance_lane(at_desk(e, desk), m, rules, saved, desk.bench, found, stop, a)


@entry_point()
def grow_thread(
    e: Engine,
    twin: Engine,
    desks: Many[Desk],
    m: Marks,
    rules: Rules,
    saved: Many[Lane],
    found: Found,
    stop: IntVector,
    a: int,
) -> None:
    """The exponent of the lane of a thread.

    Parameters
    ----------
    e, twin : Engine
        As of :func:`stickslip.orbits.settling.engine.exponents.grow_lane`; their own work space is
        not used.
    desks : Desk
        Of all threads (a leading axis).
    m, rules, saved, found, stop : tuples and array
        As of :func:`stickslip.orbits.settling.engine.exponents.grow_lane`.
    a : int
        Number of the thread, and of its lane.
    """
    desk = row_of(desks, a)
    mine, other = at_desk(e, desk), at_desk(twin, desk)
    grow_lane(mine, other, m, rules, saved, desk.bench, found, stop, a)
