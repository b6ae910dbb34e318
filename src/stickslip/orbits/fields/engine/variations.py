"""First variation of a motion in compiled loops: collocation between events, jumps at them."""

from __future__ import annotations

import numpy as np

from stickslip.machine_code.functions import entry_point
from stickslip.motion.between.dense import states_at
from stickslip.motion.steps.arrays import Flow, Machine, Rows, is_stopped
from stickslip.orbits.fields.engine.collocation import (
    forced_step,
    gauss_step,
    put_exponential,
    put_matrix,
    repeat,
)
from stickslip.orbits.fields.engine.events import is_discontinuous, pass_event
from stickslip.orbits.fields.engine.interpreter import perform
from stickslip.orbits.fields.engine.modal import by_eigenvalues, modal_step
from stickslip.orbits.fields.engine.resolution import (
    nodes_of,
    place_nodes,
    resolve_steps,
    share_of_step,
)
from stickslip.orbits.fields.engine.tables import (
    BEGINS,
    CORNER,
    CROWDED,
    ENDS,
    HALTED,
    PASSED,
    SPECTRUM_ASKED,
    STAGES,
    STRUCK,
    TOGETHER,
    UNEXPLAINED,
    Listed,
    Pass,
    PassSpace,
    put_point,
    time_of,
)
from stickslip.translator import compiled


@compiled()
def flow_through(listed: Listed, run: Pass, work: PassSpace, i: int, node: int) -> None:
    """The variation after the step from knot i, from that at its start.

    Parameters
    ----------
    node : int
        The first of its nodes.
    """
    change = run.after[i + 1]
    put_matrix(run.after[i], change)
    length = time_of(run, i + 1) - time_of(run, i)
    if not length > 0.0:
        return
    w = run.piece[i]
    if by_eigenvalues(listed, run, i):
        modal_step(listed, run, work, i, i + 1, change)
        return
    first, moving, last = listed.slopes[w, 0], listed.slopes[w, 1], listed.slopes[w, 2]
    parts = abs(run.parts[i])
    h = length / parts
    even = nodes_of(listed, run, i) == 0
    for g in range(STAGES):
        put_point(work.values, g, time_of(run, i), run.knots.state[i])
    perform(listed.made, first, last if even else moving, work.values, STAGES)
    if even:
        repeat(listed.jacobian[w], work, h, parts, change)
        return
    for part in range(parts):
        for g in range(STAGES):
            put_point(work.values, g, work.clock[node] + run.origin, work.states[node])
            node += 1
        perform(listed.made, moving, last, work.values, STAGES)
        if listed.steady[w] == 0:
            _, share = share_of_step(run, i, part)
            gauss_step(listed.jacobian[w], work.values, share * length, change, work.system)
        else:
            if part == 0:
                put_exponential(listed.jacobian[w], work, h, work.squares[2])
            forced_step(listed.jacobian[w], work, h, change)


@compiled()
def last_alike(rows: Rows, listed: Listed, run: Pass, work: PassSpace, i: int) -> int:
    """The last knot of a step by eigenvalues from knot i: the end of the piece if the changes in
    between are not needed, else the next knot."""
    last = i + 1
    if run.modal < 2 or not time_of(run, last) > time_of(run, i):
        return last
    if not by_eigenvalues(listed, run, i):
        return last
    while (
        last + 1 < len(run.piece)
        and run.piece[last] == run.piece[i]
        and not is_discontinuous(rows, listed, run, work, last)
    ):
        last += 1
    return last


@entry_point()
def vary(
    machine: Machine, flow: Flow, listed: Listed, run: Pass, work: PassSpace, start: int
) -> int:
    """The variation along a motion, from a knot on, at which it is known.

    Parameters
    ----------
    flow : Flow
        Tolerances with which the motion is followed again between its knots.
    start : int
        Knot. From the first one on, states are computed at the nodes.

    Returns
    -------
    int
        `PASSED`; `CORNER` if guards vanish together that do not for neighbouring motions; `STRUCK`
        if the state jumps (for both, the caller supplies the variation after the event, and resumes
        from there); `UNEXPLAINED` if no guard has fired; `CROWDED`, with the required number of
        nodes as the event; `SPECTRUM_ASKED`, with the piece whose eigenvalues are needed; or
        `HALTED` if a stop is requested.
    """
    if start == 0:
        nodes = resolve_steps(flow.rows, listed, run, work)
        if nodes < 0:
            return SPECTRUM_ASKED
        if nodes > len(work.step):
            run.event[BEGINS] = nodes
            return CROWDED
        place_nodes(listed, run, work)
        step, clock = work.step[:nodes], work.clock[:nodes]
        states_at(machine, flow, run.seen, run.knots, step, clock, work.between, work.states)
    knots = len(run.piece)
    together = TOGETHER * (time_of(run, knots - 1) - time_of(run, 0))
    node = 0
    i = 0
    while i < knots - 1:
        if is_stopped(flow.space):
            return HALTED
        if i >= start:
            last = last_alike(flow.rows, listed, run, work, i)
            if last > i + 1:
                put_matrix(run.after[i], run.after[last])
                modal_step(listed, run, work, i, last, run.after[last])
                while i + 1 < last:
                    node += nodes_of(listed, run, i)
                    i += 1
                    for d in range(run.after.shape[2]):
                        run.after[i, 0, d] = np.nan  # unknown; results computed from it are NaN
            else:
                flow_through(listed, run, work, i, node)
        node += nodes_of(listed, run, i)
        i += 1
        if i <= start:
            continue
        last = i
        if is_discontinuous(flow.rows, listed, run, work, i):
            run.event[BEGINS], run.event[ENDS] = i, i
            return STRUCK
        if run.piece[i] != run.piece[i - 1]:
            while last + 2 < knots and time_of(run, last + 1) - time_of(run, i) <= 1e-3 * together:
                if is_discontinuous(flow.rows, listed, run, work, last + 1):
                    break
                last += 1
            run.event[BEGINS], run.event[ENDS] = i, last
            code = pass_event(listed, run, work, i, last)
            if code in (CORNER, UNEXPLAINED):
                return code
            run.outcome[i] = code
        for j in range(i, last):
            put_matrix(run.after[i], run.after[j + 1])
            node += nodes_of(listed, run, j)
        i = last
    return PASSED
