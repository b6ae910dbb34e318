"""Quantities of a motion at very many times for plots, directly from the series of the steps.

:mod:`stickslip.motion.between.dense` solves for all forces anew at every time; here their series
are evaluated, which takes a tenth of the time.
"""

from __future__ import annotations

from stickslip.arrays import Array, IntVector, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.motion.algebra.roots import horner
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.between.dense import Scratch
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    DIMENSION,
    Flow,
    Instant,
    Machine,
    Record,
    is_stopped,
)
from stickslip.motion.steps.stiff import ends_there, follow_mode
from stickslip.numerics.levels import SHORTEST_PIECE
from stickslip.translator import compiled

TOLERANCE = 1e-12  # error of a series relative to the size of its row


@entry_point()
def trace_rows(
    machine: Machine,
    flow: Flow,
    seen: Vector,
    knots: Record,
    index: IntVector,
    times: Vector,
    wanted: IntVector,
    work: Scratch,
    out: Matrix,
) -> None:
    """Values of some rows at given times.

    Parameters
    ----------
    seen : array
        Sizes of the rows that bound the steps; see :class:`stickslip.motion.steps.arrays.Lane`.
    index : array of int, shape (times,)
        Knot whose step each time belongs to; ascending, and times ascend within a step.
    wanted : array of int, shape (rows,)
    work : Scratch
        `V` has the shape (order + 2, rows).
    out : array, shape (rows, times)
    """
    rows = flow.rows
    W = flow.space.W
    n = rows.sizes[DIMENSION]
    y, mode, reg = work.y, work.mode, work.reg
    series, value = work.V[:-1], work.V[-1]
    count = len(wanted)
    knot = -1
    base = 0.0
    h = 0.0
    order = flow.order
    full = flow.order
    last = len(knots.time) - 1
    for i in range(len(times)):
        if is_stopped(flow.space):
            return
        fresh = index[i] != knot
        if fresh:
            knot = index[i]
            base = knots.time[knot]
            copy(knots.mode[knot], mode)
            copy(knots.region[knot], reg)
            copy(knots.state[knot], y)
            resolve(rows, flow.k, flow.space, mode)
        while fresh or (times[i] - base > h and not is_stopped(flow.space)):
            if not fresh:
                for r in range(n):
                    y[r] = horner(W[r], full, h / W[n, 1])
                base += h
            left = knots.time[min(knot + 1, last)] - base
            fresh = False
            full, h, _ = follow_mode(machine, flow, Instant(base, y, mode, reg), left, h, seen)
            h = max(h, SHORTEST_PIECE * (times[i] - base))
            h = left if ends_there(h, left, base) else h
            order = full - 1  # forces and thresholds have one order less than the state
            for c in range(order + 1):
                for r in range(count):
                    series[c, r] = W[wanted[r], c]
            order = lowered(series, order, min(h, left) / W[n, 1], flow.tol)
        x = (times[i] - base) / W[n, 1]
        for r in range(count):
            value[r] = series[order, r]
        for c in range(order - 1, -1, -1):
            for r in range(count):
                value[r] = value[r] * x + series[c, r]
        for r in range(count):
            out[r, i] = value[r]


@compiled()
def lowered(series: Array, order: int, h: float, tol: float) -> int:
    """Order beyond which no term counts up to the time h, in the unit of the coefficients."""
    while order > 2:
        power = h**order
        for r in range(series.shape[1]):
            if abs(series[order, r]) * power > tol * (abs(series[0, r]) + abs(series[1, r]) * h):
                return order
        order -= 1
    return order
