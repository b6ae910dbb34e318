"""One period of the attractors of motions, recorded and measured in compiled code."""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array, Many
from stickslip.machine_code.functions import entry_point
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.audit.accounts import (
    ENERGY_BALANCE,
    EQUATIONS,
    FED,
    FED_IN_ALL,
    FRICTION_LAW,
    LARGEST,
    OWN_ROUNDING,
    SPENT,
    UNVERIFIED,
    Accounts,
    Tally,
)
from stickslip.motion.audit.observers import Sums, reset
from stickslip.motion.audit.step_balance import audit_steps, judge
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    FINISHED,
    FULL,
    NOW,
    STORED,
    Flow,
    Instant,
    Lane,
    Record,
    is_stopped,
)
from stickslip.motion.steps.starting import coefficients
from stickslip.orbits.settling.engine.lanes import (
    RECORDED,
    UNRECORDED,
    copy_lane,
    follow_lane,
    own_flow,
)
from stickslip.orbits.settling.engine.marks import elapsed
from stickslip.orbits.settling.engine.returns import (
    begin_again,
    distinct_above,
    gap,
    grow,
    miss,
    remove_cells,
)
from stickslip.orbits.settling.engine.settling import claim_rest, settle_lane
from stickslip.orbits.settling.engine.tables import (
    ASK,
    AT_FIRST,
    AT_REST,
    CLOSURE,
    COUNT,
    DONE,
    DURATION,
    ENERGY,
    GAINED,
    HIGHEST,
    IMBALANCE,
    LAG,
    LATEST,
    LAW,
    LOST,
    LOWEST,
    MEASURING,
    MOTION,
    NOT_SETTLED,
    OPEN,
    PATIENT,
    PERIOD,
    PERIODIC,
    PHASE,
    PROVING,
    SETTLING,
    SIZED,
    START,
    STEADY,
    STRIDE,
    TRUE,
    Bench,
    Engine,
    Found,
    Marks,
    Rules,
)
from stickslip.translator import compiled, row_of

_AWRY = 1e-6  # a motion with a larger closure error is not a cycle
_FELT = 1e-4  # … nor is one, or a rest, in which the forces change by more
_FORGOTTEN = -9  # kind of a mark that is discarded
_ROUNDED = 1e3  # accuracy of the states of a motion, in local tolerances
_PARTS = 31  # largest number of parts of a period that are tried
_SAMPLES = 8  # number of states that are compared
_SMALL = 1e-3  # smallest size of a component relative to its modulus
_STILL = 1e-12  # … and its change at rest


@compiled()
def measure(
    e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, found: Found, i: int
) -> None:
    """Record a lane from its saved state on for the duration in its marks, and measure it.

    Parameters
    ----------
    found : Found
        Receives the measured values.
    """
    flow = own_flow(e, i)
    s = e.lanes
    record = bench.record
    carried = 0
    real = m.real[i]
    sums = row_of(found.sums, i)
    audit = found.audit[i]
    for r in range(bench.ends.shape[1]):
        bench.ends[0, r] = np.inf
        bench.ends[1, r] = -np.inf
        bench.ends[2, r] = 0.0
    if m.outcome[i] == PERIODIC:
        shorten(e, m, rules, saved, bench, i)
    copy_lane(saved, i, s, i)
    if m.outcome[i] == PERIODIC:
        # The errors of a cycle are relative to its own size, even if the motion came from far away.
        fill(s.seen[i], 0.0)
    stop = real[START] + real[DURATION]
    for part in (bench.balance, bench.gaps, audit):
        fill(part, 0.0)
    reset(sums)
    begin(bench.tally)
    while True:
        rest = knots_of(record, carried, len(record.time))
        count = carried + follow_lane(e, i, stop, rules.most[1], RECORDED, rest)
        code = e.codes[i]
        if is_stopped(e.flow.space):
            return
        if code != FULL and code != FINISHED:
            m.outcome[i] = code
            return
        if carried == 0:
            copy(record.mode[0], bench.mode)
            copy(record.region[0], bench.region)
            observe_forces(e, flow, record.time[0], record.state[0], bench, bench.felt[0])
        add_steps(e, flow, rules, bench, count, carried, s.seen[i], sums)
        for j in range(carried, count):
            extend(m, rules, i, real[START], record.time[j], record.state[j], bench)
        if code == FINISHED:
            break
        steps = count - 1
        record.time[0] = record.time[steps]
        copy(record.state[steps], record.state[0])
        copy(record.mode[steps], record.mode[0])
        copy(record.region[steps], record.region[0])
        carried = 1
    found.moves[i] = moves(rules, bench, bench.tally.state[LARGEST], not framed(m, i))
    if m.outcome[i] in (AT_REST, STEADY):
        # A component that dies out is compared with the size of the entire motion, as when its
        # rates were found to vanish.
        for r in range(len(s.y[i])):
            size = bench.tally.state[LARGEST, r]
            bench.tally.state[LARGEST, r] = max(size, s.seen[i, r])
    conclude(e, bench, audit)
    observe_forces(e, flow, s.clock[i, NOW], s.y[i], bench, bench.felt[1])
    m.felt[i] = difference(bench.felt)
    for r in range(bench.ends.shape[1]):
        found.shift[i, r] = s.y[i, r] - saved.y[i, r]
        m.size[i, r] = max(m.size[i, r], bench.ends[2, r])
    if m.outcome[i] == PERIODIC:
        for r in range(len(bench.gaps)):
            bench.gaps[r] = found.shift[i, r] - m.frame[i, r] * real[DURATION]
        remove_cells(bench.gaps, m, rules, i)
        audit[CLOSURE] = miss(bench.gaps, bench.ends[2], rules.real[4])
        audit[PERIOD] = rules.real[5] ** 2 / real[OPEN]


@compiled()
def framed(m: Marks, i: int) -> bool:
    """Return whether a lane is compared in a moving frame, or modulo cells."""
    total = float(m.cells.shape[1])
    for r in range(m.frame.shape[1]):
        total += abs(m.frame[i, r])
    return total > 0.0


@compiled()
def shorten(e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, i: int) -> None:
    """Test fractions of the period: cos² has half the period of cos, and the period of an
    oscillation that touches a switch occasionally is that of the oscillation, not that between
    touches.

    After a fraction of the period the state usually differs; if not, it must agree over the whole
    period.

    Parameters
    ----------
    m : Marks
        Receive the duration; the first gives way to the states that are compared.
    """
    s = e.lanes
    real = m.real[i]
    # Components that do not move at the marks may do so in between: their sizes are those on the
    # whole way.
    copy_lane(saved, i, s, i)
    e.codes[i] = FULL
    while e.codes[i] == FULL:
        if is_stopped(e.flow.space):
            return  # also indicated by FULL
        count = follow_lane(
            e, i, real[START] + real[DURATION], rules.most[1], RECORDED, bench.record
        )
        for j in range(count):
            grow(m, rules, i, bench.record.time[j], bench.record.state[j], bench.work[0])
            extend(m, rules, i, real[START], bench.record.time[j], bench.record.state[j], bench)
    # A period later everything is rounded as it was, if the clock has been set back; a part of it
    # later it is not.
    limit = max(distinct_above(m, i), _ROUNDED * e.flow.tol)
    for r in range(bench.ends.shape[1]):
        bench.work[0, r] = bench.ends[1, r] - bench.ends[0, r]
    if miss(bench.work[0], m.size[i], rules.real[4]) <= limit:
        # The period of such a small motion is not known, and all of its parts are alike.
        if m.drive[i] <= 0.0:
            real[OPEN] = 0.0
        return
    p = likely_part(e, m, rules, saved, bench, i, 2)
    while p > 0:
        off = 0.0
        for j in range(p * _SAMPLES):
            # the b-th return to the a-th state
            a = j // p
            b = j % p
            if off <= rules.real[5]:
                if b == 0:
                    copy_lane(saved, i, s, i)
                later = real[DURATION] / p * (a / _SAMPLES + b)
                off = max(off, return_after(e, m, rules, bench, i, later, b == 0))
        if not moves(rules, bench, bench.tally.state[LARGEST], False) > 0.0:
            return
        if off <= limit:
            real[DURATION] /= p
        else:
            real[OPEN] = min(off, real[OPEN])
            p += 1 if p == 2 else 2
        p = likely_part(e, m, rules, saved, bench, i, p)


@compiled()
def likely_part(
    e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, i: int, p: int
) -> int:
    """The smallest q ≥ p, 2 or odd, for which a motion returns after the q-th part of its period; 0
    if there is none."""
    real = m.real[i]
    found = 0
    copy_lane(saved, i, e.lanes, i)
    return_after(e, m, rules, bench, i, 0.0, True)
    for q in range(_PARTS, p - 1, -1):
        if q == 2 or q % 2 == 1:
            off = return_after(e, m, rules, bench, i, real[DURATION] / q, False)
            if off <= rules.real[5]:
                found = q
            else:
                real[OPEN] = min(off, real[OPEN])
    return found


@compiled()
def return_after(
    e: Engine, m: Marks, rules: Rules, bench: Bench, i: int, later: float, first: bool
) -> float:
    """Follow a lane for some time after its start; returns its distance from the first mark, which
    is set here if it is missing."""
    s = e.lanes
    start = m.real[i, START]
    follow_lane(e, i, start + later, rules.most[1], UNRECORDED, bench.record)
    if e.codes[i] != FINISHED:
        return np.inf
    extend(m, rules, i, start, s.clock[i, NOW], s.y[i], bench)
    if first:
        m.time[i, 0] = s.clock[i, NOW]
        copy(s.y[i], m.state[i, 0])
        return 0.0
    gap(m, rules, i, 0, s.clock[i, NOW], s.y[i], bench.work[0])
    return miss(bench.work[0], m.size[i], rules.real[4])


@compiled()
def extend(m: Marks, rules: Rules, i: int, start: float, t: float, y: Array, bench: Bench) -> None:
    """Widen the range of every component, without frame and translation.

    Parameters
    ----------
    start, t : float
        Time from which the frame moves, and time of the state.
    y : array, shape (n,)
    bench : Bench
        Receives the range.
    """
    v = bench.work[0]
    ends = bench.ends
    for r in range(len(y)):
        v[r] = y[r] - m.frame[i, r] * (t - start)
    remove_cells(v, m, rules, i)
    for r in range(len(y)):
        ends[0, r], ends[1, r] = min(ends[0, r], v[r]), max(ends[1, r], v[r])


@compiled()
def moves(rules: Rules, bench: Bench, largest: Array, known: bool) -> float:
    """Largest range of a component, relative to its modulus; also stores the sizes of all
    components.

    Parameters
    ----------
    largest : array, shape (n,)
        Largest modulus of each component along the motion, if known. A component that is equal at
        all knots may be extreme there.
    """
    ends = bench.ends
    worst = 0.0
    for r in range(len(largest)):
        modulus = max(abs(ends[0, r]), abs(ends[1, r]))
        extent = ends[1, r] - ends[0, r]
        shifted = False
        for j in range(len(rules.shifts)):
            shifted = shifted or rules.shifts[j, r] != 0.0
        if known and not shifted:
            extent = max(extent, largest[r] - modulus)
            modulus = max(modulus, largest[r])
        ends[2, r] = max(0.5 * extent, _SMALL * modulus)
        beyond = extent - 2.0 * rules.real[4] - _STILL * modulus
        if beyond > 0.0:
            worst = max(worst, beyond / modulus)
    return worst


@compiled()
def knots_of(record: Record, first: int, last: int) -> Record:
    """A part of a record."""
    return Record(
        record.time[first:last],
        record.state[first:last],
        record.mode[first:last],
        record.region[first:last],
        record.cause[first:last],
    )


@compiled()
def add_steps(
    e: Engine,
    flow: Flow,
    rules: Rules,
    bench: Bench,
    count: int,
    carried: int,
    seen: Array,
    sums: Sums,
) -> None:
    """Measure the steps between the recorded knots, the first of which may have been counted.

    Parameters
    ----------
    flow : Flow
        With the numbers of the lane.
    bench : Bench
        With the record; is added to.
    count, carried : int
        Number of knots, and whether the first has been counted (1) or not (0).
    seen : array
        Largest modulus so far of each row that bounds the steps.
    sums : Sums
        Is added to.
    """
    record = bench.record
    balance = bench.balance
    work = bench.steps.work
    steps = count - 1
    tol, atol = rules.fine[0], rules.fine[1]
    fine = Flow(flow.rows, flow.k, flow.space, flow.order, tol, atol, flow.supports)
    flow.space.known[-1] = 1
    for j in range(steps):
        fill(work[j], 0.0)
        fill(bench.steps.gap[j], 0.0)
        fill(bench.steps.noise[j], 0.0)
        bench.steps.open[j] = 0.0
    starts = knots_of(record, 0, steps)
    ends = knots_of(record, 1, count)
    accounts = Accounts(bench.steps, bench.tally, sums)
    audit_steps(e.machine, fine, seen, starts, ends, rules.closely, accounts)
    for j in range(carried, count):
        energy = energy_at(e, flow, bench, j)
        if j == 0:
            balance[AT_FIRST] = balance[LOWEST] = balance[HIGHEST] = energy
            continue
        balance[LOST] += work[j - 1, SPENT]
        balance[GAINED] += work[j - 1, FED]
        balance[LOWEST] = min(balance[LOWEST], energy)
        balance[HIGHEST] = max(balance[HIGHEST], energy)
        off = abs(energy - balance[AT_FIRST] + balance[LOST] - balance[GAINED])
        balance[IMBALANCE] = max(balance[IMBALANCE], off)


@compiled()
def fill(part: Array, value: float) -> None:
    """Set all entries of a vector."""
    for i in range(len(part)):
        part[i] = value


@compiled()
def energy_at(e: Engine, flow: Flow, bench: Bench, j: int) -> float:
    """Energy at a knot."""
    flight = e.flight
    record = bench.record
    copy(record.mode[j], flight.mode0)
    copy(record.region[j], flight.reg0)
    resolve(flow.rows, flow.k, flow.space, flight.mode0)
    knot = Instant(record.time[j], record.state[j], flight.mode0, flight.reg0)
    coefficients(e.machine, flow, knot, 1, bench.table)
    e.machine.powers(bench.table, flight.reg0, flow.k.K, bench.value)
    return bench.value[STORED]


@compiled()
def observe_forces(e: Engine, flow: Flow, t: float, y: Array, bench: Bench, felt: Array) -> None:
    """Forces and thresholds of the contacts at an instant, in the mode of the first knot.

    Parameters
    ----------
    flow : Flow
        With the numbers of the lane.
    y : array, shape (n,)
    felt : array, shape (3 contacts,)
        Receives forces, thresholds s⁺ and thresholds s⁻.
    """
    rows = flow.rows
    table = bench.table
    nc = len(rows.u)
    flow.space.known[-1] = 1
    resolve(rows, flow.k, flow.space, bench.mode)
    coefficients(e.machine, flow, Instant(t, y, bench.mode, bench.region), 1, table)
    for c in range(nc):
        felt[c], felt[nc + c] = table[rows.force[c], 0], table[rows.plus[c], 0]
        felt[2 * nc + c] = table[rows.minus[c], 0]


@compiled()
def difference(felt: Array) -> float:
    """Largest change of the observed forces, relative to the largest force."""
    change, size = 0.0, 0.0
    for c in range(felt.shape[1]):
        change = max(change, abs(felt[1, c] - felt[0, c]))
        size = max(size, abs(felt[0, c]), abs(felt[1, c]))
    return change / size if size > 0.0 else 0.0


@compiled()
def begin(tally: Tally) -> None:
    """Reset all sums."""
    for part in range(len(tally.state)):
        fill(tally.state[part], 0.0)
    for c in range(len(tally.law)):
        fill(tally.law[c], 0.0)
    for j in range(len(tally.kinks)):
        fill(tally.kinks[j], 0.0)
    fill(tally.total, 0.0)


@compiled()
def conclude(e: Engine, bench: Bench, audit: Array) -> None:
    """The residuals of :mod:`.motion.certify` from the accumulated sums; infinite if an enclosure
    is missing."""
    balance = bench.balance
    tally = bench.tally
    residuals = bench.residuals
    extent = balance[HIGHEST] - balance[LOWEST]
    flow = max(extent, balance[LOST], tally.total[FED_IN_ALL])
    largest = max(abs(balance[LOWEST]), abs(balance[HIGHEST]))
    judge(e.flow.rows, tally, balance[IMBALANCE], flow, largest, residuals)
    audit[ENERGY] = residuals[ENERGY_BALANCE]
    audit[LAW] = residuals[FRICTION_LAW]
    audit[MOTION] = max(residuals[EQUATIONS], residuals[OWN_ROUNDING])
    if tally.total[UNVERIFIED] > 0.0:
        audit[MOTION] = np.inf


@compiled()
def load_is_aperiodic(outcome: int, change: float, closure: float) -> bool:
    """Return whether the state returned, but the forces on it did not: a load that is not
    periodic."""
    return outcome in (AT_REST, PERIODIC, STEADY) and (change > _FELT or closure > _AWRY)


@compiled()
def discard_marks(m: Marks, rules: Rules, lanes: Lane, saved: Lane, i: int) -> None:
    """Discard all marks of a lane, which continues from its present state; a driven one from its
    last mark."""
    for j in range(m.kind.shape[1]):
        m.kind[i, j] = _FORGOTTEN
    if m.drive[i] > 0.0:
        copy_lane(saved, i, lanes, i)
    m.numbers[i, TRUE] = -1
    m.numbers[i, STRIDE] = 0
    m.real[i, ASK] = 1.5 * elapsed(m, rules, lanes, i) - 0.5 * rules.real[0]
    begin_again(m, i, 0)


@compiled()
def resettle(m: Marks, rules: Rules, lanes: Lane, saved: Lane, bench: Bench, i: int) -> bool:
    """Let a motion that started far from its cycle settle again, with the size of the cycle as
    scale; False if this is already the scale.

    Parameters
    ----------
    bench : Bench
        With the sizes of the components on the cycle.
    """
    larger = False
    for r in range(m.size.shape[1]):
        larger = larger or m.size[i, r] > 2.0 * bench.ends[2, r]
    if m.numbers[i, SIZED] == 1 or not larger:
        return False
    for r in range(m.size.shape[1]):
        m.size[i, r] = bench.ends[2, r] if bench.ends[2, r] > 0.0 else m.size[i, r]
    last = (m.numbers[i, COUNT] - 1) % m.time.shape[1]
    m.time[i, last] = saved.clock[i, NOW]
    copy(saved.y[i], m.state[i, last])
    copy_lane(saved, i, lanes, i)
    m.numbers[i, SIZED] = 1
    m.numbers[i, TRUE] = 0
    m.real[i, PATIENT] = np.inf
    begin_again(m, i, m.numbers[i, LAG])
    return True


@entry_point()
def measure_all(
    e: Engine, m: Marks, rules: Rules, saved: Many[Lane], bench: Bench, found: Found
) -> None:
    """Measure all lanes that have settled, until they need the host.

    Parameters
    ----------
    e, m, rules, saved, bench, found : tuples
        As in :func:`advance_lane`.
    """
    for i in range(len(e.codes)):
        measure_lane(e, m, rules, saved, bench, found, i)


@compiled()
def advance_lane(
    e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, found: Found, i: int
) -> None:
    """Settle and measure one lane until done or stopped; its phase is stored in the marks.

    Parameters
    ----------
    found : Found
        Receives the measured values.
    """
    if m.numbers[i, PHASE] == SETTLING:
        settle_lane(e, m, rules, saved, bench, i)
    measure_lane(e, m, rules, saved, bench, found, i)


@compiled()
def measure_lane(
    e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, found: Found, i: int
) -> None:
    """Measure a lane if it has settled; it may have to settle again.

    Parameters
    ----------
    e, m, rules, saved, bench, found : tuples
        As in :func:`advance_lane`.
    """
    numbers = m.numbers[i]
    if numbers[PHASE] == MEASURING and not is_stopped(e.flow.space):
        measure(e, m, rules, saved, bench, found, i)
        if is_stopped(e.flow.space):
            return  # it is measured once more, from the beginning
        numbers[PHASE] = DONE
        closure = found.audit[i, CLOSURE]
        awry = m.outcome[i] == PERIODIC and closure > rules.real[3]
        if m.outcome[i] == PERIODIC and m.real[i, OPEN] == 0.0 and m.drive[i] <= 0.0:
            # A cycle so small that its period is not known has died out, or will.
            claim_rest(e, m, saved.mode[i], i)
            m.real[i, DURATION] = rules.real[2]
            numbers[PHASE] = PROVING
        elif awry and resettle(m, rules, e.lanes, saved, bench, i):
            numbers[PHASE] = SETTLING
        elif load_is_aperiodic(m.outcome[i], m.felt[i], closure):
            discard_marks(m, rules, e.lanes, saved, i)
            numbers[PHASE] = SETTLING if elapsed(m, rules, e.lanes, i) < m.real[i, LATEST] else DONE
            m.outcome[i] = NOT_SETTLED
