"""One period of what motions have settled on, recorded and measured in compiled code."""

from __future__ import annotations

import numpy as np
from numba import njit

from stickslip.motion.audit import Tally, audit_steps, judge
from stickslip.motion.kernel import FINISHED, FULL, INLINED, NEED, OPTIONS, Constants, Lane, Record
from stickslip.motion.modes import copy, resolve
from stickslip.sweeps.observers import clear, observe
from stickslip.sweeps.settling import (
    AT_REST,
    NOT_SETTLED,
    PERIODIC,
    RECORDED,
    STEADY,
    constants_of,
    copy_lane,
    follow,
    miss,
    remove_shift,
    settle,
)
from stickslip.sweeps.tables import DONE, MEASURING, SETTLING, Bench, Engine, Found, Marks, Rules, Sums

Array = np.ndarray

AWRY = 1e-6  # a cycle that fails to close by more is none
FELT = 1e-4  # … and neither is one, or a rest, in which the forces change by more
FORGOTTEN = -9  # kind of a mark


@njit(**INLINED)
def measure(e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, sums: Sums, audit: Array, i: int) -> bool:
    """Record a lane from its saved state on for the duration in its marks, and measure it; False as in :func:`settle`.

    Parameters
    ----------
    sums : Sums
        Receives what is observed of this lane.
    audit : array, shape (4,)
        Receives what :class:`stickslip.sweeps.tables.Found` says.
    """
    k, s, record, carried = constants_of(e, i), e.lanes, bench.record, 0
    copy_lane(saved, i, s, i)
    stop = m.period[i, 0] + m.period[i, 1]
    for part in (bench.balance, bench.gaps, audit):
        fill(part, 0.0)
    clear(sums)
    begin(bench.tally)
    while True:
        rest = Record(
            record.time[carried:], record.state[carried:], record.mode[carried:], record.region[carried:],
            record.cause[carried:],
        )  # fmt: skip
        count = carried + follow(e, i, stop, rules.most[1], RECORDED, rest)
        code = e.codes[i]
        if code == NEED:
            return False
        if code != FULL and code != FINISHED:
            m.outcome[i] = code
            return True
        if carried == 0:
            copy(record.mode[0], bench.mode)
            copy(record.region[0], bench.region)
            feel(e, k, record.time[0], record.state[0], bench, bench.felt[0])
        add_steps(e, k, rules, bench, count, carried, s.seen[i], sums)
        if code == FINISHED:
            break
        steps = count - 1
        record.time[0] = record.time[steps]
        copy(record.state[steps], record.state[0])
        copy(record.mode[steps], record.mode[0])
        copy(record.region[steps], record.region[0])
        carried = 1
    conclude(e, bench, audit)
    feel(e, k, s.clock[i, 0], s.y[i], bench, bench.felt[1])
    m.period[i, 2] = difference(bench.felt)
    if m.outcome[i] == PERIODIC:
        gaps, largest = bench.gaps, bench.tally.state[0]
        for r in range(len(gaps)):
            gaps[r] = s.y[i, r] - saved.y[i, r] - m.frame[i, r] * m.period[i, 1]
            largest[r] = max(largest[r], m.size[i, r])
        remove_shift(gaps, rules.translation)
        audit[3] = miss(gaps, largest, rules.real[4])
    return True


@njit(**INLINED)
def add_steps(
    e: Engine, k: Constants, rules: Rules, bench: Bench, count: int, carried: int, seen: Array, sums: Sums
) -> None:
    """Measure the steps between the recorded knots, the first of which may have been counted."""
    record, balance, spent, steps, fine = bench.record, bench.balance, bench.steps.work, count - 1, rules.fine
    e.space.known[-1] = 1
    observe(e.jets, e.rows, k, e.space, e.order, fine[0], fine[1], seen, record, 0, steps, rules.closely, sums)
    for j in range(steps):
        fill(spent[j], 0.0)
        fill(bench.steps.gap[j], 0.0)
        fill(bench.steps.noise[j], 0.0)
        bench.steps.open[j] = 0.0
    audit_steps(
        e.jets, e.powers, e.rows, k, e.space, e.order, fine[0], fine[1], seen, record.time[:steps],
        record.state[:steps], record.mode[:steps], record.region[:steps], record.time[1:count], record.state[1:count],
        True, bench.steps, bench.tally,
    )  # fmt: skip
    for j in range(carried, count):
        energy = energy_at(e, k, bench, j)
        if j == 0:
            balance[0] = balance[3] = balance[4] = energy
            continue
        balance[1] += spent[j - 1, 0]
        balance[2] += spent[j - 1, 1]
        balance[3], balance[4] = min(balance[3], energy), max(balance[4], energy)
        balance[5] = max(balance[5], abs(energy - balance[0] + balance[1] - balance[2]))


@njit(**OPTIONS)
def fill(part: Array, value: float) -> None:
    """Give all entries of a vector a value."""
    for i in range(len(part)):
        part[i] = value


@njit(**INLINED)
def energy_at(e: Engine, k: Constants, bench: Bench, j: int) -> float:
    """Energy at a knot."""
    s, flight, record, table = e.space, e.flight, bench.record, bench.table
    copy(record.mode[j], flight.mode0)
    copy(record.region[j], flight.reg0)
    resolve(e.rows.sizes, k, s, flight.mode0)
    e.jets(record.time[j], record.state[j], flight.mode0, flight.reg0, k.K, s.Rq, s.Rz, 1, table, s.A, s.B, s.mag)
    e.powers(table, flight.reg0, k.K, bench.value)
    return bench.value[0]


@njit(**INLINED)
def feel(e: Engine, k: Constants, t: float, y: Array, bench: Bench, felt: Array) -> None:
    """Forces and thresholds of the contacts at an instant, in the mode of the first knot."""
    s, rows, table, nc = e.space, e.rows, bench.table, len(e.rows.u)
    s.known[-1] = 1
    resolve(rows.sizes, k, s, bench.mode)
    e.jets(t, y, bench.mode, bench.region, k.K, s.Rq, s.Rz, 1, table, s.A, s.B, s.mag)
    for c in range(nc):
        felt[c], felt[nc + c] = table[rows.force[c], 0], table[rows.plus[c], 0]
        felt[2 * nc + c] = table[rows.minus[c], 0]


@njit(**OPTIONS)
def difference(felt: Array) -> float:
    """Largest change of what is felt, relative to the largest force."""
    change, size = 0.0, 0.0
    for c in range(felt.shape[1]):
        change = max(change, abs(felt[1, c] - felt[0, c]))
        size = max(size, abs(felt[0, c]), abs(felt[1, c]))
    return change / size if size > 0.0 else 0.0


@njit(**OPTIONS)
def begin(tally: Tally) -> None:
    """Nothing is added up yet."""
    for part in range(len(tally.state)):
        fill(tally.state[part], 0.0)
    for c in range(len(tally.law)):
        fill(tally.law[c], 0.0)
    for j in range(len(tally.kinks)):
        fill(tally.kinks[j], 0.0)
    fill(tally.total, 0.0)


@njit(**OPTIONS)
def conclude(e: Engine, bench: Bench, audit: Array) -> None:
    """The residuals of :mod:`stickslip.certify`, of what has been summed up; infinite if not all could be enclosed."""
    balance, tally, residuals = bench.balance, bench.tally, bench.residuals
    flow = max(balance[4] - balance[3], balance[1], tally.total[0])
    judge(e.rows, tally, balance[5], flow, max(abs(balance[3]), abs(balance[4])), residuals)
    audit[0], audit[1], audit[2] = residuals[0], residuals[1], max(residuals[2], residuals[3])
    if tally.total[2] > 0.0:
        audit[2] = np.inf


@njit(**OPTIONS)
def deceives(outcome: int, change: float, closure: float) -> bool:
    """Whether the state came back, but what drives it did not: a load that does not repeat."""
    return outcome in (AT_REST, PERIODIC, STEADY) and (change > FELT or closure > AWRY)


@njit(**OPTIONS)
def forget(m: Marks, i: int, driven: bool) -> None:
    """Forget all marks of a lane; one that is driven has gone on by a supposed period."""
    for j in range(m.kind.shape[1]):
        m.kind[i, j] = FORGOTTEN
    m.numbers[i, 1] += m.numbers[i, 3] if driven else 0
    m.numbers[i, 2] = 0


@njit(**OPTIONS)
def advance(e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, found: Found, stop: Array) -> None:
    """Settle and measure all lanes, as far as they come without a new closed form.

    Parameters
    ----------
    stop : array, shape (1,)
        Not zero once there is a wish to stop.
    """
    for i in range(len(e.codes)):
        advance_lane(e, m, rules, saved, bench, found, stop, i)


@njit(**INLINED)
def advance_lane(
    e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, found: Found, stop: Array, i: int
) -> None:
    """Settle and measure one lane, as far as it comes; its phase is left in the marks."""
    phase = m.numbers[i, 0]
    if phase == SETTLING and settle(e, m, rules, saved, bench, stop, i):
        phase = MEASURING if m.outcome[i] == AT_REST or m.outcome[i] >= PERIODIC else DONE
    if phase == MEASURING and stop[0] == 0:
        own, audit = sums_of(found.sums, i), found.audit[i]
        if measure(e, m, rules, saved, bench, own, audit, i):
            for r in range(e.rows.sizes[0]):
                found.shift[i, r] = e.lanes.y[i, r] - saved.y[i, r]
            phase = DONE
            if deceives(m.outcome[i], m.period[i, 2], audit[3]):
                forget(m, i, m.drive[i] > 0.0)
                m.outcome[i] = NOT_SETTLED
                phase = SETTLING if e.lanes.clock[i, 0] < rules.real[1] else DONE
    m.numbers[i, 0] = phase


@njit(**OPTIONS)
def sums_of(s: Sums, i: int) -> Sums:
    """The sums of a lane."""
    return Sums(s.low[i], s.high[i], s.stick[i], s.work[i], s.peak[i], s.impulse[i], s.total[i], s.switches[i])
