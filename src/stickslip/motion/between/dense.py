"""The motion between its knots: values at any time.

A trajectory stores the state at the start of every step, no polynomial: the Taylor series is made
again from that state, so values between knots are as accurate as at the knots, and a stored file
gives the same numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stickslip.arrays import IntVector, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.motion.admissible.shown import show_admissible
from stickslip.motion.algebra.roots import horner
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    AIM,
    AIM_SPEED,
    DIMENSION,
    LEAD,
    POWERS_MADE,
    Flow,
    Instant,
    Machine,
    Record,
    Rows,
    is_stopped,
)
from stickslip.motion.steps.contacts import set_mode
from stickslip.motion.steps.starting import coefficients
from stickslip.motion.steps.stiff import ends_there, follow_mode
from stickslip.numerics.levels import SHORTEST_PIECE
from stickslip.symbolic.tape import DIRECTION_GIVEN


class Scratch(NamedTuple):
    """Work space between knots: coefficients of all rows, two states, powers, mode and region."""

    V: Matrix
    y: Vector
    z: Vector
    power: Vector
    mode: IntVector
    reg: IntVector


def make_scratch(rows: Rows, shape: tuple[int, int]) -> Scratch:
    """New work space, with coefficients of that shape."""
    n = rows.sizes[DIMENSION]
    mode, reg = np.zeros(len(rows.u), np.int64), np.zeros(len(rows.kinks), np.int64)
    table = np.zeros(shape)
    if shape[0] > n and shape[1] > 1:
        table[n, 1] = 1.0  # the unit of time
    return Scratch(table, np.zeros(n), np.zeros(n), np.zeros(POWERS_MADE), mode, reg)


def shared_forces(rows: Rows) -> frozenset[int]:
    """Rows of forces that several contacts share: their series are those of minimum norm, which may
    be inadmissible for one contact; the reported ones are admissible (:func:`.show_admissible`)."""
    groups = rows.group[rows.contacts]
    several = [g for g in np.unique(groups[groups >= 0]) if np.sum(groups == g) > 1]
    return frozenset(int(row) for row in rows.force[np.isin(rows.group, several)])


@entry_point()
def states_at(
    machine: Machine,
    flow: Flow,
    seen: Vector,
    knots: Record,
    index: IntVector,
    times: Vector,
    work: Scratch,
    out: Matrix,
) -> None:
    """States at given times.

    Parameters
    ----------
    seen : array
        Sizes of the rows that bound the steps; see :class:`stickslip.motion.steps.arrays.Lane`.
    index : array of int, shape (times,)
        Knot whose step each time belongs to.
    out : array, shape (times, ·)
        Receives the states in its first columns; where it has room for all rows, the directions of
        slips in a plane, too, as the series has them (a speed of −1 where there is none).
    """
    rows = flow.rows
    W = flow.space.W
    n = rows.sizes[DIMENSION]
    all_rows = out.shape[1] >= len(W)
    y, mode, reg = work.y, work.mode, work.reg
    last = -1
    base = 0.0
    h = 0.0
    order = flow.order
    known = False
    final = len(knots.time) - 1
    for i in range(len(times)):
        if is_stopped(flow.space):
            return
        knot = index[i]
        if knot != last or times[i] < base:
            last = knot
            base = float(knots.time[knot])
            copy(knots.mode[knot], mode)
            copy(knots.region[knot], reg)
            copy(knots.state[knot], y)
            resolve(rows, flow.k, flow.space, mode)
            known = False
        # the coefficients have to be accurate for the rest of the step
        left = float(knots.time[min(knot + 1, final)]) - base
        if times[i] > base and not known:  # at the knot itself no series is needed
            start = Instant(base, y, mode, reg)
            order, h, _ = follow_mode(machine, flow, start, left, 0.0, seen)
            h = left if ends_there(h, left, base) else h
            known = True
        while known and times[i] - base > h and not is_stopped(flow.space):
            for r in range(n):
                y[r] = horner(W[r], order, h / W[n, 1])
            base = base + h
            left = left - h
            start = Instant(base, y, mode, reg)
            order, h, _ = follow_mode(machine, flow, start, left, h, seen)
            h = max(h, SHORTEST_PIECE * left)
            h = left if ends_there(h, left, base) else h
        for r in range(n):
            out[i, r] = horner(W[r], order, (times[i] - base) / W[n, 1]) if known else y[r]
        for p in range(len(rows.planes) if all_rows else 0):
            first = rows.planes[p, AIM]
            slips = known and mode[rows.planes[p, LEAD]] != 0
            for row in range(first, rows.planes[p, AIM_SPEED] + 1):
                x = (times[i] - base) / W[n, 1]
                out[i, row] = horner(W[row], order - 1, x) if slips else -1.0


@entry_point()
def sample(
    machine: Machine,
    flow: Flow,
    seen: Vector,
    knots: Record,
    index: IntVector,
    times: Vector,
    work: Scratch,
    out: Matrix,
) -> None:
    """Order-0 values of all rows, then energy, dissipated and supplied power, at given times.

    Parameters
    ----------
    seen, knots, index, times, work : arrays, Record and Scratch
        See :func:`states_at`.
    out : array, shape (times, rows + 3)
    """
    rows = flow.rows
    n = rows.sizes[DIMENSION]
    table = len(flow.space.W)
    z, mode, reg = work.z, work.mode, work.reg
    planes = rows.planes
    states_at(machine, flow, seen, knots, index, times, work, out)
    last = -1
    for i in range(len(times)):
        if index[i] != last:
            last = index[i]
            copy(knots.mode[last], mode)
            copy(knots.region[last], reg)
            resolve(rows, flow.k, flow.space, mode)
        copy(out[i, :n], z)
        if len(planes) > 0:
            copy(knots.mode[last], mode)
        for p in range(len(planes)):
            first = planes[p, AIM]
            speed = planes[p, AIM_SPEED]
            if out[i, speed] >= 0.0:
                # Close to the end of a slip Au is a rounding error.
                set_mode(rows, mode, planes[p, LEAD], DIRECTION_GIVEN)
                for row in range(first, speed + 1):
                    work.V[row, 0], work.V[row, 1] = out[i, row], 0.0
        coefficients(machine, flow, Instant(times[i], z, mode, reg), 1, work.V)
        machine.powers(work.V, reg, flow.k.K, work.power)
        show_admissible(flow, mode, work.V)
        for r in range(table):
            out[i, r] = work.V[r, 0]
        for r in range(POWERS_MADE):
            out[i, table + r] = work.power[r]
