"""Largest Lyapunov exponents of motions, in compiled code."""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array, Many
from stickslip.machine_code.functions import entry_point
from stickslip.motion.steps.arrays import (
    DIMENSION,
    FINISHED,
    INERTIAL,
    RATE_INDEPENDENT,
    VISCOUS,
    Lane,
    is_stopped,
)
from stickslip.orbits.settling.engine.lanes import UNRECORDED, copy_lane, follow_lane
from stickslip.orbits.settling.engine.tables import (
    DONE,
    DURATION,
    MEASURING,
    PHASE,
    START,
    Bench,
    Engine,
    Found,
    Marks,
    Rules,
)
from stickslip.translator import compiled

TURNS = 64  # stretches in which the growth of a small change is followed
SKIPPED = 32  # number of initial stretches that are not counted
_CHANGE = 1e-7  # initial distance relative to the size of the motion


@entry_point()
def grow_all(
    e: Engine, twin: Engine, m: Marks, rules: Rules, saved: Many[Lane], bench: Bench, found: Found
) -> None:
    """Exponents of all lanes in the measuring phase, as far as they are computed before a stop.

    Parameters
    ----------
    twin : Engine
        The same with lanes of its own.
    """
    for i in range(len(e.codes)):
        grow_lane(e, twin, m, rules, saved, bench, found, i)


@compiled()
def grow_lane(
    e: Engine,
    twin: Engine,
    m: Marks,
    rules: Rules,
    saved: Lane,
    bench: Bench,
    found: Found,
    i: int,
) -> None:
    """The exponent of one lane, if it is in the measuring phase.

    Parameters
    ----------
    twin : Engine
        The same with lanes of its own.
    found : Found
        Receives the exponent.
    """
    if m.numbers[i, PHASE] == MEASURING and grow_apart(
        e, twin, m, rules, saved, bench, found.exponent, i
    ):
        m.numbers[i, PHASE] = DONE


@compiled()
def grow_apart(
    e: Engine,
    twin: Engine,
    m: Marks,
    rules: Rules,
    saved: Lane,
    bench: Bench,
    exponent: Array,
    i: int,
) -> bool:
    """Largest Lyapunov exponent, from a motion and its twin, which is rescaled to a small distance
    after every interval.

    A contact that slides without mass is on its threshold, from which a perturbation would remove
    it; the start is then postponed until the twin can be separated. NaN if it never can. Returns
    whether the exponent is computed, as in :func:`settle`.

    Parameters
    ----------
    twin : Engine
        The same with lanes of its own.
    exponent : array, shape (lanes,)
        Receives the exponent.
    """
    s = e.lanes
    w = twin.lanes
    sizes = e.flow.rows.sizes
    n = sizes[DIMENSION]
    first = 2 * sizes[INERTIAL] + sizes[VISCOUS]
    size = m.size[i]
    last = first + sizes[RATE_INDEPENDENT]
    stretch = m.real[i, DURATION]
    for attempt in range(8):
        copy_lane(saved, i, s, i)
        t = m.real[i, START] + attempt * stretch / 7.3
        if attempt > 0:
            follow_lane(e, i, t, rules.most[1], UNRECORDED, bench.record)
        copy_lane(s, i, w, i)
        for r in range(n):
            w.y[i, r] += _CHANGE * size[r] * math.cos(1.0 + r) if r < first or r >= last else 0.0
        total = 0.0
        for turn in range(TURNS):
            if is_stopped(e.flow.space):
                return False
            t += stretch
            follow_lane(e, i, t, rules.most[1], UNRECORDED, bench.record)
            follow_lane(twin, i, t, rules.most[1], UNRECORDED, bench.record)
            if e.codes[i] != FINISHED or twin.codes[i] != FINISHED:
                break
            apart = 0.0
            for r in range(n):
                if size[r] > 0.0:
                    apart += ((w.y[i, r] - s.y[i, r]) / size[r]) ** 2
            apart = math.sqrt(apart)
            if apart == 0.0:
                total = -np.inf
                break
            total += math.log(apart / _CHANGE) if turn >= SKIPPED else 0.0
            for r in range(n):
                w.y[i, r] = s.y[i, r] + (w.y[i, r] - s.y[i, r]) * _CHANGE / apart
        if e.codes[i] == FINISHED and twin.codes[i] == FINISHED:
            exponent[i] = total / ((TURNS - SKIPPED) * stretch)
            return True
    exponent[i] = np.nan
    return not is_stopped(e.flow.space)
