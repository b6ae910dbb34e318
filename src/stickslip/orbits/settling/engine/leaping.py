"""Decisions at a mark of a motion, in compiled code: whether to extrapolate it, and whether it has
settled.

If the returns of a motion are predictable, their limit is extrapolated, down to rounding. The limit
is accepted as its cycle, or the motion is reset to its last computed state, and continues from
there.
"""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.steps.arrays import NOW, Lane
from stickslip.orbits.settling.engine.lanes import copy_lane
from stickslip.orbits.settling.engine.marks import begin_strides, elapsed
from stickslip.orbits.settling.engine.returns import (
    MOST_RETURNS,
    RETURN_PATIENCE,
    begin_again,
    compare_with_lag,
    distance,
    equal_sequences,
    extrapolate,
    has_settled,
    miss,
    recurrence_order,
    remove_cells,
    shorten_lag,
    shortest_lag,
)
from stickslip.orbits.settling.engine.tables import (
    ASK,
    COUNT,
    DURATION,
    EVENTLESS,
    FLOOR,
    HOME,
    LAG,
    LEAPT,
    MEASURING,
    MISS,
    PATIENT,
    PERIODIC,
    PHASE,
    PROVING,
    REACH,
    REST,
    SAME,
    STALLED,
    START,
    STRETCH,
    STRIDE,
    TRUE,
    WARY,
    Marks,
    Rules,
)
from stickslip.translator import compiled

GO_ON, CARRIED_ON, SETTLED = range(3)
"""What is done after a mark."""

_FARTHEST = 0.5  # largest size of an extrapolation
_AGAIN = 2.0  # largest length of the next leap, in lengths of the first
_NEAREST = 1e-14  # a miss that is a rounding error
_FITS = 0.1  # largest remainder of a return after its combination, as a fraction of it
_MOST_LEAPS = 8  # largest number of leaps of polishing
_MOST_POLISHED = 24  # largest number of returns of polishing

# -- decisions at a mark ---------------------------------------------------------------------------


@compiled()
def consider(
    m: Marks, rules: Rules, lanes: Lane, saved: Lane, work: Array, fit: Array, i: int
) -> int:
    """Compare the last mark, which is the state of the saved lane, with those before it, and decide
    how to proceed.

    Parameters
    ----------
    work, fit : arrays, shapes (9, n), (4, 4)
        Work space.

    Returns
    -------
    int
        GO_ON, CARRIED_ON or SETTLED.
    """
    numbers = m.numbers[i]
    before = m.numbers[i, LAG]
    d = compare_with_lag(m, rules, i, work[0])
    lag, leapt = numbers[LAG], numbers[LEAPT]
    if leapt != 0:
        if lag != before:
            return reset_motion(m, lanes, saved, i)
        return polish(m, rules, lanes, saved, work, fit, i, d)
    if lag == 0 or numbers[SAME] < 1:
        return GO_ON
    if has_settled(m, rules, i, d) and not (
        rules.timed and elapsed(m, rules, saved, i) < m.real[i, ASK]
    ):
        leave(m, saved, i, d)
        m.real[i, PATIENT] = 0.1 * d
        return polish(m, rules, lanes, saved, work, fit, i, distance(m, rules, i, lag, work[0]))
    whole = m.drive[i] > 0.0 or numbers[STRIDE] > 0 or numbers[EVENTLESS] == 1
    if not whole and numbers[SAME] > max(lag, numbers[WARY]):
        begin_strides(m, i)
    elif numbers[STALLED] > RETURN_PATIENCE * lag and d > rules.real[3]:
        shorten_lag(m, rules, i, work[0])
    elif whole and rules.leaping and numbers[COUNT] >= numbers[REST]:
        k = recurrence_order(m, rules, i, work, fit)
        if k > 0:
            return leap(m, rules, lanes, saved, work, fit, i, d, k)
    return GO_ON


@compiled()
def fails_to_return(m: Marks, rules: Rules, i: int, t: float) -> bool:
    """Return whether an extrapolated motion does not return: the extrapolated state may lead to
    rest."""
    ring = m.time.shape[1]
    last = m.numbers[i, COUNT] - 1
    period = m.time[i, last % ring] - m.time[i, (last - m.numbers[i, LAG]) % ring]
    return t - m.time[i, last % ring] > 2.0 * max(period, rules.real[2])


# -- carrying on, and taking back ------------------------------------------------------------------


@compiled()
def leave(m: Marks, saved: Lane, i: int, d: float) -> None:
    """Save the state of the motion before its extrapolation.

    Parameters
    ----------
    d : float
        Closure error of the last return.
    """
    numbers, real = m.numbers[i], m.real[i]
    copy_lane(saved, i, m.home, i)
    numbers[LEAPT] = 1
    numbers[HOME] = numbers[COUNT]
    real[MISS] = d
    real[REACH] = 0.0


@compiled()
def leap(
    m: Marks,
    rules: Rules,
    lanes: Lane,
    saved: Lane,
    work: Array,
    fit: Array,
    i: int,
    d: float,
    k: int,
) -> int:
    """Extrapolate a motion to the limit of its returns, by a recurrence of order k, unless the
    limit is far away.

    Parameters
    ----------
    work, fit : arrays, shapes (9, n), (4, 4)
        Work space.
    d : float
        Closure error of the last return.

    Returns
    -------
    int
        CARRIED_ON, or GO_ON if it is not.
    """
    _, length = extrapolate(m, rules, i, k, work, fit)
    # The miss of the last return is at most twice the remaining distance.
    if not 0.25 * d <= length <= _FARTHEST:
        return GO_ON
    leave(m, saved, i, d)
    m.numbers[i, LEAPT] = 2
    m.real[i, REACH] = length
    m.real[i, STRETCH] = length / d
    return carry(m, lanes, saved, i, work[8])


@compiled()
def carry(m: Marks, lanes: Lane, saved: Lane, i: int, step: Array) -> int:
    """Add an extrapolation step to the state at the last mark.

    Parameters
    ----------
    lanes, saved : Lane
        Receive the new state.
    step : array, shape (n,)

    Returns
    -------
    int
        CARRIED_ON.
    """
    last = (m.numbers[i, COUNT] - 1) % m.time.shape[1]
    numbers = m.numbers[i]
    copy_lane(saved, i, m.before, i)
    for r in range(len(step)):
        saved.y[i, r] += step[r]
    copy(saved.y[i], m.state[i, last])
    copy_lane(saved, i, lanes, i)
    numbers[TRUE], numbers[SAME] = 0, 0
    return CARRIED_ON


@compiled()
def restore_mark(m: Marks, lanes: Lane, saved: Lane, i: int, kept: Lane, count: int) -> int:
    """Reset a motion to its state at a mark, which becomes the last one.

    Parameters
    ----------
    lanes, saved : Lane
        Receive where it was.
    kept : Lane
        Where it was.
    count : int
        Number of marks up to that one.

    Returns
    -------
    int
        CARRIED_ON.
    """
    numbers = m.numbers[i]
    last = (count - 1) % m.time.shape[1]
    copy_lane(kept, i, saved, i)
    copy_lane(kept, i, lanes, i)
    m.time[i, last] = kept.clock[i, NOW]
    copy(kept.y[i], m.state[i, last])
    numbers[COUNT] = count
    numbers[TRUE] = 0
    numbers[LEAPT] = 0
    begin_again(m, i, numbers[LAG])
    return CARRIED_ON


@compiled()
def reset_motion(m: Marks, lanes: Lane, saved: Lane, i: int) -> int:
    """Reset a motion to its state before the extrapolation, and let it continue from there."""
    numbers = m.numbers[i]
    # At increasing intervals, so that few are tried if no leap succeeds.
    patience = max(RETURN_PATIENCE * max(numbers[LAG], 1), numbers[HOME] // 2)
    numbers[REST] = numbers[HOME] + patience
    return restore_mark(m, lanes, saved, i, m.home, numbers[HOME])


# -- down to rounding ------------------------------------------------------------------------------


@compiled()
def polish(
    m: Marks, rules: Rules, lanes: Lane, saved: Lane, work: Array, fit: Array, i: int, d: float
) -> int:
    """Extrapolate a motion that seems to have settled to its cycle, down to rounding.

    Parameters
    ----------
    work, fit : arrays, shapes (9, n), (4, 4)
        Work space.
    d : float
        Closure error of the last return.

    Returns
    -------
    int
        GO_ON, CARRIED_ON or SETTLED.
    """
    numbers = m.numbers[i]
    real = m.real[i]
    lag = m.numbers[i, LAG]
    ring = m.time.shape[1]
    if (numbers[COUNT] - numbers[HOME]) % lag != 0 or numbers[TRUE] < lag:
        return GO_ON
    if real[REACH] > 0.0 and equal_sequences(m, i, lag, lag) < lag:
        return reset_motion(m, lanes, saved, i)
    if numbers[TRUE] == lag and numbers[LEAPT] > 1 and d > 0.5 * real[MISS]:
        restore_mark(m, lanes, saved, i, m.before, numbers[COUNT] - lag)
        numbers[LEAPT] = 1
        return accept(m, rules, lanes, saved, work[0], i, real[MISS])
    real[MISS] = d
    if (
        d <= _NEAREST
        or numbers[COUNT] - numbers[HOME] >= _MOST_POLISHED * lag
        or numbers[LEAPT] > _MOST_LEAPS
    ):
        return accept(m, rules, lanes, saved, work[0], i, d)
    returns = min(numbers[TRUE] // lag, (ring - 1) // lag)
    for k in range(1, min(returns - 1, MOST_RETURNS) + 1):
        misfit, length = extrapolate(m, rules, i, k, work, fit)
        if (misfit <= _FITS or k == MOST_RETURNS) and length <= max(
            rules.real[5], _AGAIN * real[REACH]
        ):
            numbers[LEAPT] += 1
            real[STRETCH] = max(real[STRETCH], length / d)
            return carry(m, lanes, saved, i, work[8])
    return GO_ON


@compiled()
def accept(m: Marks, rules: Rules, lanes: Lane, saved: Lane, work: Array, i: int, d: float) -> int:
    """Accept the polished cycle as the limit cycle of the motion if its state was within the
    tolerance of it; otherwise convergence must be proved.

    Parameters
    ----------
    work : array, shape (n,)
    d : float
        Closure error of the polished cycle.

    Returns
    -------
    int
        SETTLED, or CARRIED_ON if the motion is reset.
    """
    numbers = m.numbers[i]
    real = m.real[i]
    ring = m.time.shape[1]
    for r in range(len(work)):
        work[r] = (
            saved.y[i, r]
            - m.home.y[i, r]
            - m.frame[i, r] * (saved.clock[i, NOW] - m.home.clock[i, NOW])
        )
    remove_cells(work, m, rules, i)
    here = miss(work, m.size[i], rules.real[4]) <= rules.real[5]
    afar = real[REACH] > 0.0
    if not d <= (rules.real[3] if afar else rules.real[5]) or not (afar or here):
        return reset_motion(m, lanes, saved, i)
    real[FLOOR] = d
    numbers[LAG], last = shortest_lag(m, rules, i, work), numbers[COUNT] - 1
    numbers[LEAPT] = 0 if here else 1
    real[START] = m.time[i, last % ring]
    real[DURATION] = m.drive[i] * numbers[LAG]
    if m.drive[i] <= 0.0:
        real[DURATION] = m.time[i, last % ring] - m.time[i, (last - numbers[LAG]) % ring]
    m.outcome[i] = PERIODIC
    numbers[PHASE] = PROVING if rules.timed or not here else MEASURING
    return SETTLED
