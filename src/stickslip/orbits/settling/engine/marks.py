"""The marks of a motion, in compiled code: the conditions for the next mark, and its record.

The marks of a driven motion are the times t₀ + mP, those of any other are events, and, once the
modes between these have been seen to repeat, only those after which they begin again.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.steps.arrays import EMPTY_WORD, HAPPENED, LONG_AGO, NOW, SINCE, WORD, Lane
from stickslip.orbits.settling.engine.lanes import copy_lane
from stickslip.orbits.settling.engine.returns import begin_again, grow, remember
from stickslip.orbits.settling.engine.tables import (
    COUNT,
    EVENTLESS,
    LAG,
    LEAPT,
    SAME,
    STRIDE,
    TRUE,
    WARY,
    Marks,
    Rules,
)
from stickslip.translator import compiled

_BEGUN = -8  # kind of the marks from which the entire sequence of modes of a motion is recorded
_KEPT = 3  # number of previous returns that are kept then
# number of first periods of a drive with a look between marks, for motions that vanish at marks
_GROWING = 8
_HALFWAY = 0.618  # position of the look before a mark, in periods
_WIDER = 1.25  # periods in which a smooth motion that is polished returns
_NEXT = 1e-9  # fraction of an interval: a time this close to its end belongs to the next one


@compiled()
def next_mark(m: Marks, rules: Rules, i: int) -> float:
    """Time of the next mark of a driven motion."""
    count = m.numbers[i, COUNT]
    return rules.real[0] + (count if rules.timed else min(count, 1)) * m.drive[i]


@compiled()
def elapsed(m: Marks, rules: Rules, lanes: Lane, i: int) -> float:
    """The time without resets of the clock."""
    set_back = (
        (m.numbers[i, COUNT] - 1) * m.drive[i] if m.drive[i] > 0.0 and not rules.timed else 0.0
    )
    return lanes.clock[i, NOW] + set_back


@compiled()
def next_event(m: Marks, rules: Rules, lanes: Lane, saved: Lane, i: int) -> int:
    """Number of the event at which the next mark may be.

    Parameters
    ----------
    lanes, saved : Lane
        Where the motion is; and was at its last mark.
    """
    if m.drive[i] > 0.0:
        return rules.most[1]
    stride = m.numbers[i, STRIDE]
    last = saved.counters[i, HAPPENED] + stride if stride > 0 else lanes.counters[i, HAPPENED] + 1
    return min(last, rules.most[1])


@compiled()
def next_stop(m: Marks, rules: Rules, i: int, t: float) -> float:
    """The next mark of a driven motion (or a test between its first ones); the next test of any
    other motion."""
    start = rules.real[0]
    look = rules.real[2]
    drive = m.drive[i]
    count = m.numbers[i, COUNT]
    if drive > 0.0:
        mark = next_mark(m, rules, i)
        halfway = mark - _HALFWAY * drive
        return halfway if 0 < count <= _GROWING and t < halfway - 1e-3 * drive else mark
    target = start + look * (math.floor((t - start) / look + _NEXT) + 1.0)
    lag = m.numbers[i, LAG]
    ring = m.time.shape[1]
    if m.numbers[i, EVENTLESS] == 1 and m.numbers[i, LEAPT] > 0:
        target = min(
            target,
            t + _WIDER * (m.time[i, (count - 1) % ring] - m.time[i, (count - 1 - lag) % ring]),
        )
    return target


@compiled()
def long_look(m: Marks, rules: Rules, i: int, t: float) -> float:
    """The largest number of drive periods of a cycle, or the duration since the oldest mark of the
    same kind."""
    count = m.numbers[i, COUNT]
    ring = m.time.shape[1]
    most = rules.most[3]
    if m.drive[i] > 0.0:
        return m.drive[i] * max(min(count - 1, most), 1)
    for back in range(min(count, most), 0, -1):
        j = (count - back) % ring
        if m.kind[i, j] == m.kind[i, (count - 1) % ring] and m.time[i, j] < t:
            return t - m.time[i, j]
    return rules.real[2]


@compiled()
def put_mark(
    m: Marks, rules: Rules, lanes: Lane, saved: Lane, i: int, happened: bool, work: Array
) -> bool:
    """Add a mark, if there is one: at the end of a period of the drive, or at an event.

    Parameters
    ----------
    lanes, saved : Lane
        Where the motion is; and was at its last mark.
    happened : bool
        Whether the lane is at an event.
    work : array, shape (n,)
    """
    numbers = m.numbers[i]
    t = lanes.clock[i, NOW]
    y = lanes.y[i]
    word = lanes.counters[i, WORD]
    grow(m, rules, i, t, y, work)
    if m.drive[i] > 0.0:
        if t < next_mark(m, rules, i) - 0.5 * _HALFWAY * m.drive[i]:
            return False  # between two marks
        if not rules.timed:
            lanes.clock[i, NOW] = rules.real[0]
            lanes.clock[i, LONG_AGO] = lanes.clock[i, LONG_AGO] - (t - rules.real[0])
            lanes.clock[i, SINCE] = lanes.clock[i, SINCE] - (t - rules.real[0])
        remember(m, i, 0, word, lanes.clock[i, NOW], y)
    elif happened and word != EMPTY_WORD:
        ring = m.time.shape[1]
        last = (numbers[COUNT] - 1) % ring
        numbers[EVENTLESS] = 0
        if numbers[STRIDE] > 0:
            for j in range(min(numbers[COUNT], _KEPT)):
                before = (last - j) % ring
                if m.kind[i, before] == _BEGUN:
                    m.kind[i, before] = m.word[i, before] = word
            if m.kind[i, last] != word and numbers[LEAPT] == 0:
                # The repeated sequence was part of the cycle: the next one has to be longer.
                numbers[WARY] = min(2 * numbers[WARY] + 2, rules.most[3])
                numbers[STRIDE] = 0
        remember(m, i, word, word, t, y)
        m.events[i, (numbers[COUNT] - 1) % ring] = lanes.counters[i, HAPPENED]
    else:
        return False
    lanes.counters[i, WORD] = EMPTY_WORD
    copy_lane(lanes, i, saved, i)
    return True


@compiled()
def begin_strides(m: Marks, i: int) -> None:
    """Restrict marks to the beginnings of the repeating sequence of modes."""
    numbers = m.numbers[i]
    ring = m.time.shape[1]
    here = numbers[COUNT] - 1
    lag = numbers[LAG]
    # The lag may be a multiple of the shortest after which they do.
    p = 1
    same = 0
    while p < lag and same < lag:
        same = 0
        while same < lag and m.kind[i, (here - same) % ring] == m.kind[i, (here - same - p) % ring]:
            same += 1
        if same < lag:
            p += 1
    numbers[STRIDE] = m.events[i, here % ring] - m.events[i, (here - p) % ring]
    kept = 1
    while kept < _KEPT and kept * p <= min(here, ring - 1, numbers[SAME]):
        source = (here - kept * p) % ring
        target = (here - kept) % ring
        m.time[i, target] = m.time[i, source]
        copy(m.state[i, source], m.state[i, target])
        kept += 1
    for j in range(kept):
        m.kind[i, (here - j) % ring] = _BEGUN
    numbers[TRUE] = kept - 1
    begin_again(m, i, 1)
