"""Largest Lyapunov exponents of what motions have settled on, in compiled code."""

from __future__ import annotations

import numpy as np
from numba import njit

from stickslip.motion.kernel import FINISHED, INLINED, JETS, NEED, OPTIONS, RESIDUAL, Lane, Record
from stickslip.sweeps.settling import DONE, MEASURING, Engine, Limits, Marks, copy_lane, follow

Array = np.ndarray

TURNS, SKIPPED = 64, 32  # stretches in which the growth of a small change is followed, and not counted at first
CHANGE = 1e-7  # of the size of the motion


@njit(**OPTIONS)
def grow_all(
    e: Engine,
    twin: Engine,
    jets: JETS,
    residual: RESIDUAL,
    slots: int,
    N: int,
    tol: float,
    atol: float,
    m: Marks,
    limits: Limits,
    saved: Lane,
    record: Record,
    exponent: Array,
) -> int:
    """Exponents of all lanes that are in the phase of being measured; how many wait for a closed form.

    Parameters
    ----------
    twin : Engine
        The same with lanes of its own.
    exponent : array, shape (lanes,)
        Receives the largest Lyapunov exponents.
    """
    waiting = 0
    for i in range(len(e.codes)):
        if m.numbers[i, 0] != MEASURING:
            continue
        if grow_apart(e, twin, jets, residual, slots, N, tol, atol, m, limits, saved, record, exponent, i):
            m.numbers[i, 0] = DONE
        else:
            waiting += 1
    return waiting


@njit(**INLINED)
def grow_apart(
    e: Engine,
    twin: Engine,
    jets: JETS,
    residual: RESIDUAL,
    slots: int,
    N: int,
    tol: float,
    atol: float,
    m: Marks,
    limits: Limits,
    saved: Lane,
    record: Record,
    exponent: Array,
    i: int,
) -> bool:
    """Largest Lyapunov exponent: a motion and its twin, which is put back close to it after every stretch.

    What slides without mass is on its threshold, from which a change would take it away; so both go a bit further
    before the twin leaves, until it can. NaN where it never can.
    """
    s, w, n = e.lanes, twin.lanes, e.rows.sizes[0]
    first, size = 2 * e.rows.sizes[1] + e.rows.sizes[2], m.size[i]
    last, stretch = first + e.rows.sizes[3], m.period[i, 1]
    for attempt in range(8):
        copy_lane(saved, i, s, i)
        t = m.period[i, 0] + attempt * stretch / 7.3
        if attempt > 0:
            follow(e, jets, residual, slots, N, tol, atol, i, t, limits.most[1], False, record)
        copy_lane(s, i, w, i)
        for r in range(n):
            w.y[i, r] += CHANGE * size[r] * np.cos(1.0 + r) if r < first or r >= last else 0.0
        total = 0.0
        for turn in range(TURNS):
            t += stretch
            follow(e, jets, residual, slots, N, tol, atol, i, t, limits.most[1], False, record)
            follow(twin, jets, residual, slots, N, tol, atol, i, t, limits.most[1], False, record)
            if e.codes[i] != FINISHED or twin.codes[i] != FINISHED:
                break
            apart = 0.0
            for r in range(n):
                if size[r] > 0.0:
                    apart = max(apart, abs(w.y[i, r] - s.y[i, r]) / size[r])
            total += np.log(apart / CHANGE) if turn >= SKIPPED else 0.0
            if apart == 0.0:
                total = -np.inf
                break
            for r in range(n):
                w.y[i, r] = s.y[i, r] + (w.y[i, r] - s.y[i, r]) * CHANGE / apart
        if e.codes[i] == NEED or twin.codes[i] == NEED:
            return False
        if e.codes[i] == FINISHED and twin.codes[i] == FINISHED:
            exponent[i] = total / ((TURNS - SKIPPED) * stretch)
            return True
    exponent[i] = np.nan
    return True
