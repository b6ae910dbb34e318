"""One period of what motions have settled on, recorded and measured in compiled code."""

from __future__ import annotations

import numpy as np
from numba import njit

from stickslip.motion.dense import integrate_steps
from stickslip.motion.kernel import (
    ALLOCATING,
    FINISHED,
    FULL,
    INLINED,
    JETS,
    NEED,
    OPTIONS,
    POWERS,
    RESIDUAL,
    Constants,
    Lane,
    Record,
    Rows,
    Space,
)
from stickslip.motion.modes import copy, resolve
from stickslip.sweeps.observers import Sums, clear, observe
from stickslip.sweeps.settling import (
    AT_REST,
    DONE,
    MEASURING,
    NOT_SETTLED,
    PERIODIC,
    RING,
    SETTLING,
    STEADY,
    Engine,
    Limits,
    Marks,
    copy_lane,
    follow,
    miss,
    remove_shift,
    settle,
)

Array = np.ndarray

AWRY = 1e-6  # a cycle that fails to close by more is none
FELT = 1e-4  # … and neither is one, or a rest, in which the forces change by more
FORGOTTEN = -9  # kind of a mark


@njit(**INLINED)
def measure(
    e: Engine,
    jets: JETS,
    residual: RESIDUAL,
    powers: POWERS,
    slots: int,
    N: int,
    tol: float,
    atol: float,
    fine: Array,
    m: Marks,
    limits: Limits,
    saved: Lane,
    record: Record,
    rate_rows: Array,
    rate_sizes: Array,
    closely: bool,
    sums: Sums,
    audit: Array,
    translation: Array,
    i: int,
) -> bool:
    """Record a lane from its saved state on for the duration in its marks, and measure it; False as in :func:`settle`.

    Parameters
    ----------
    fine : array
        Tolerances with which steps are followed again.
    record : Record
        Work space; what does not fit is measured piece by piece.
    closely : bool
        As in :func:`stickslip.sweeps.observers.observe`.
    audit : array, shape (4,)
        Receives residual of the energy balance, violation of the friction law, defect of the equations of motion, and
        by how much a cycle fails to close.
    """
    g, s, n, room = e.group[i], e.lanes, e.rows.sizes[0], len(record.time) - 1
    k = Constants(e.constants.K[g], e.constants.M[g], e.constants.C[g], e.constants.J[g], e.constants.omega[g])
    copy_lane(saved, i, s, i)
    stop = m.period[i, 0] + m.period[i, 1]
    change, noise, largest = np.zeros((room, n)), np.zeros((room, n)), np.zeros(n)
    spent, worst, value = np.zeros((room, 2)), np.zeros(8 + 2 * len(e.rows.kinks)), np.zeros(3)
    balance = np.zeros(6)  # first energy, dissipated and supplied so far, least and largest energy, largest residual
    slack, carried, gaps = 0.0, 0, np.zeros(n)
    clear(sums)
    audit[:] = 0.0
    table, felt = np.zeros((len(e.space.W), 2)), np.zeros((2, 3 * len(e.rows.u)))
    mode, reg = np.zeros(len(e.rows.u), np.int64), np.zeros(len(e.rows.kinks), np.int64)
    while True:
        rest = Record(
            record.time[carried:], record.state[carried:], record.mode[carried:], record.region[carried:],
            record.cause[carried:],
        )  # fmt: skip
        count = carried + follow(e, jets, residual, slots, N, tol, atol, i, stop, limits.most[1], True, rest)
        code = e.codes[i]
        if code == NEED:
            return False
        if code != FULL and code != FINISHED:
            m.outcome[i] = code
            return True
        steps = count - 1
        e.space.known[-1] = 1
        observe(jets, e.rows, k, e.space, N, fine[0], fine[1], record, 0, steps, closely, sums)
        spent[:], change[:], noise[:] = 0.0, 0.0, 0.0
        integrate_steps(
            jets, powers, e.rows, k, e.space, N, fine[0], fine[1], rate_rows, rate_sizes, record.time[:steps],
            record.state[:steps], record.mode[:steps], record.region[:steps], record.time[1:count], True,
            spent, change, noise, largest, worst,
        )  # fmt: skip
        if carried == 0:
            copy(record.mode[0], mode)
            copy(record.region[0], reg)
            feel(e.rows, e.space, jets, k, record.time[0], record.state[0], mode, reg, table, felt[0])
        for j in range(count):
            if carried == 1 and j == 0:
                continue
            energy = energy_at(e, jets, powers, k, record, j, table, value)
            if j == 0:
                balance[0] = balance[3] = balance[4] = energy
                continue
            balance[1] += spent[j - 1, 0]
            balance[2] += spent[j - 1, 1]
            balance[3], balance[4] = min(balance[3], energy), max(balance[4], energy)
            balance[5] = max(balance[5], abs(energy - balance[0] + balance[1] - balance[2]))
            for r in range(n):
                slack += noise[j - 1, r]
                off = abs(record.state[j, r] - record.state[j - 1, r] - change[j - 1, r]) - noise[j - 1, r]
                gaps[r] = max(gaps[r], off)
                largest[r] = max(largest[r], abs(record.state[j, r]), abs(record.state[j - 1, r]))
        if code == FINISHED:
            break
        record.time[0] = record.time[steps]
        copy(record.state[steps], record.state[0])
        copy(record.mode[steps], record.mode[0])
        copy(record.region[steps], record.region[0])
        carried = 1
    judge(e.rows.sizes, balance, worst, slack, gaps, largest, limits.real[4], audit)
    feel(e.rows, e.space, jets, k, s.clock[i, 0], s.y[i], mode, reg, table, felt[1])
    m.period[i, 2] = difference(felt)
    if m.outcome[i] == PERIODIC:
        for r in range(n):
            gaps[r] = s.y[i, r] - saved.y[i, r] - m.frame[i, r] * m.period[i, 1]
            largest[r] = max(largest[r], m.size[i, r])
        remove_shift(gaps, translation)
        audit[3] = miss(gaps, largest, limits.real[4])
    return True


@njit(**INLINED)
def energy_at(
    e: Engine, jets: JETS, powers: POWERS, k: Constants, record: Record, j: int, table: Array, value: Array
) -> float:
    """Energy at a knot."""
    s, flight = e.space, e.flight
    copy(record.mode[j], flight.mode0)
    copy(record.region[j], flight.reg0)
    resolve(e.rows.sizes, k, s, flight.mode0)
    jets(record.time[j], record.state[j], flight.mode0, flight.reg0, k.K, s.Rq, s.Rz, 1, table, s.A, s.B, s.mag)
    powers(table, flight.reg0, k.K, value)
    return value[0]


@njit(**OPTIONS)
def feel(
    rows: Rows,
    s: Space,
    jets: JETS,
    k: Constants,
    t: float,
    y: Array,
    mode: Array,
    reg: Array,
    table: Array,
    felt: Array,
) -> None:
    """Forces and thresholds of the contacts at an instant."""
    nc = len(rows.u)
    s.known[-1] = 1
    resolve(rows.sizes, k, s, mode)
    jets(t, y, mode, reg, k.K, s.Rq, s.Rz, 1, table, s.A, s.B, s.mag)
    for c in range(nc):
        felt[c], felt[nc + c], felt[2 * nc + c] = (
            table[rows.force[c], 0], table[rows.plus[c], 0], table[rows.minus[c], 0],
        )  # fmt: skip


@njit(**OPTIONS)
def difference(felt: Array) -> float:
    """Largest change of what is felt, relative to the largest force."""
    change, size = 0.0, 0.0
    for c in range(felt.shape[1]):
        change = max(change, abs(felt[1, c] - felt[0, c]))
        size = max(size, abs(felt[0, c]), abs(felt[1, c]))
    return change / size if size > 0.0 else 0.0


@njit(**OPTIONS)
def judge(
    sizes: Array, balance: Array, worst: Array, slack: float, gaps: Array, largest: Array, atol: float, audit: Array
) -> None:
    """The three residuals of :mod:`stickslip.certify`, of what has been summed up."""
    excess, off, creep, back, force, speed, held = worst[0], worst[1], worst[2], worst[3], worst[4], worst[5], worst[6]
    top = max(abs(balance[3]), abs(balance[4]))
    scale = max(balance[4] - balance[3], balance[1], worst[7], 1e-6 * top, atol * max(atol, force))
    audit[0] = max(balance[5] - force * slack, 0.0) / scale
    at_rest = 1e-4 * held
    speed = max(speed, at_rest)
    violation = max(excess, off) / force if force > 0.0 else 0.0
    violation = max(violation, max(creep, back) / speed if speed > 0.0 else 0.0)
    for j in range(8, len(worst), 2):
        violation = max(violation, worst[j] / (worst[j + 1] if worst[j + 1] > 0.0 else 1.0))
    audit[1] = violation
    masses = sizes[1]
    for r in range(len(gaps)):
        size = max(largest[r], atol)
        if masses <= r < 2 * masses:
            size = max(size, at_rest)
        audit[2] = max(audit[2], gaps[r] / size)


@njit(**OPTIONS)
def deceives(outcome: int, change: float, closure: float) -> bool:
    """Whether the state came back, but what drives it did not: a load that does not repeat."""
    return outcome in (AT_REST, PERIODIC, STEADY) and (change > FELT or closure > AWRY)


@njit(**OPTIONS)
def forget(m: Marks, i: int, driven: bool) -> None:
    """Forget all marks of a lane; one that is driven has gone on by a supposed period."""
    for j in range(RING):
        m.kind[i, j] = FORGOTTEN
    m.numbers[i, 1] += m.numbers[i, 3] if driven else 0
    m.numbers[i, 2] = 0


@njit(**ALLOCATING)
def advance(
    e: Engine,
    jets: JETS,
    residual: RESIDUAL,
    powers: POWERS,
    slots: int,
    N: int,
    tol: float,
    atol: float,
    fine: Array,
    m: Marks,
    limits: Limits,
    driven: Array,
    translation: Array,
    saved: Lane,
    record: Record,
    rate_rows: Array,
    rate_sizes: Array,
    closely: bool,
    sums: Sums,
    audit: Array,
    shift: Array,
) -> int:
    """Settle and measure all lanes, as far as they come; returns how many wait for a closed form.

    Parameters
    ----------
    shift : array, shape (lanes, n)
        Receives the shift of the state while it is measured.
    """
    waiting, work = 0, np.zeros((2, e.rows.sizes[0]))
    for i in range(len(e.codes)):
        phase = m.numbers[i, 0]
        if phase == SETTLING and settle(
            e, jets, residual, slots, N, tol, atol, m, limits, driven, translation, saved, record, work, i
        ):
            phase = MEASURING if m.outcome[i] == AT_REST or m.outcome[i] >= PERIODIC else DONE
        if phase == MEASURING:
            own = Sums(
                sums.low[i], sums.high[i], sums.stick[i], sums.work[i], sums.peak[i], sums.impulse[i],
                sums.total[i], sums.switches[i],
            )  # fmt: skip
            if measure(
                e, jets, residual, powers, slots, N, tol, atol, fine, m, limits, saved, record, rate_rows, rate_sizes,
                closely, own, audit[i], translation, i,
            ):  # fmt: skip
                for r in range(e.rows.sizes[0]):
                    shift[i, r] = e.lanes.y[i, r] - saved.y[i, r]
                phase = DONE
                if deceives(m.outcome[i], m.period[i, 2], audit[i, 3]):
                    forget(m, i, driven[i] > 0.0)
                    m.outcome[i] = NOT_SETTLED
                    phase = SETTLING if e.lanes.clock[i, 0] < limits.real[1] else DONE
        m.numbers[i, 0] = phase
        waiting += 1 if phase != DONE else 0
    return waiting
