"""Proof that a motion converges to the cycle found by extrapolation of its returns, in compiled
code.

At a station on the cycle, in the middle of its longest flight, let x* be the state, M the monodromy
matrix of the first variation (:mod:`stickslip.orbits.fields.engine.variations`), and e the
deviation of the true motion. The conditions are:

* no multiplier exceeds 1 (Gelfand's formula ρ = lim ‖Mᵏ‖^{1/k}, by squaring), and e vanishes in the
  limit, lim Mᵏe = 0;
* the return of the true motion has the same sequence of modes, and its deviation is M e up to a
  small quadratic term: with the same size everywhere, relative to the square of the deviation,
  these terms would add up to less than a fraction of e;
* the same holds for returns from the later deviations Mʲe, and those in between: each of them is
  within a narrow cone around one that has been followed, and shorter.

Translations, and delays of autonomous systems, are irrelevant: both are projected out of deviations
and of M.

Sticking contacts lead to families of cycles, and an extrapolation that skips a slip would end on
another member of the family: the third condition excludes this.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Array3, IntMatrix, IntVector, Many, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.motion.algebra.vectors import copy
from stickslip.motion.steps.arrays import (
    CAUSE,
    EMPTY_WORD,
    FINISHED,
    NOW,
    WORD,
    Flow,
    Lane,
    Machine,
    is_stopped,
)
from stickslip.orbits.fields.engine.collocation import put_matrix, put_product
from stickslip.orbits.fields.engine.events import fired, guards_at, jump
from stickslip.orbits.fields.engine.tables import (
    ALIKE,
    BEGINS,
    CORNER,
    ENDS,
    GRAZED,
    PASSED,
    Listed,
    Pass,
    PassSpace,
)
from stickslip.orbits.fields.engine.variations import vary
from stickslip.orbits.settling.engine.lanes import (
    RECORDED,
    UNRECORDED,
    copy_lane,
    follow_lane,
    own_flow,
)
from stickslip.orbits.settling.engine.measuring import knots_of
from stickslip.orbits.settling.engine.returns import (
    largest_component,
    norm,
    remove_cells,
    remove_part,
    remove_shift,
)
from stickslip.orbits.settling.engine.tables import (
    DURATION,
    LEAPT,
    PHASE,
    PROVING,
    START,
    Bench,
    Engine,
    Marks,
    Rules,
)
from stickslip.translator import compiled

OPEN_CLAIM, PROVED, REFUSED, UNKNOWN_MODE = range(4)
"""What is said of a lane; an unknown mode is one whose field the host has not listed yet."""

_HERE, _RETURNED, _RATES, _NOW, _LATER = range(5)
_DOUBLINGS = 40  # ‖Mᵏ‖^{1/k} with k = 2⁴⁰ is ρ to 1e-10
_GROWTH = 1e-9  # largest excess of a multiplier over 1 that is regarded as rounding
_CURVED = 0.25  # largest sum of the curvature terms as a fraction of e
_NARROW = 0.2  # sine of the half opening of the cones
_BEYOND = 1.1  # factor by which a deviation is enlarged when its return is computed
_AT_LAST = 20  # number of doublings after which the rest of a deviation is regarded as constant
_NEAR = 0.05  # fraction of its first size below which a deviation is not followed further
_FURTHEST = 20_000  # number of returns after which a deviation has to be this small


class Claims(NamedTuple):
    """Claims about lanes, with work space for their proofs.

    Attributes
    ----------
    verdict : array of int, shape (lanes,)
    wanted : array of int, shape (lanes, contacts + kinks)
        The unknown mode, and region.
    parameters : array, shape (lanes, parameters)
    drives : array, shape (lanes,)
        Largest frequency of the loads.
    origin : float
        The time at which clocks are 0.
    modes, regions : arrays of int, shapes (pieces, contacts) and (pieces, kinks)
        Of the fields that are listed.
    piece, parts, outcome, event, after, late : arrays
        See :class:`stickslip.orbits.fields.engine.tables.Pass`.
    squares : array, shape (2, n, n)
    deviation : array, shape (5, n)
        In units of the sizes of the components: deviations of the true motion, now and after a
        return, the direction of its rates, and two to work on.
    followed : array, shape (·, n)
        Deviations from which returns were followed.
    """

    verdict: IntVector
    wanted: IntMatrix
    parameters: Matrix
    drives: Vector
    origin: float
    listed: Listed
    modes: IntMatrix
    regions: IntMatrix
    piece: IntVector
    parts: IntVector
    outcome: IntVector
    event: IntVector
    after: Array3
    late: Matrix
    work: PassSpace
    squares: Array3
    deviation: Matrix
    followed: Matrix


@entry_point()
def prove_all(
    e: Engine, m: Marks, rules: Rules, saved: Many[Lane], bench: Bench, c: Claims
) -> None:
    """Prove that extrapolated motions converge to their cycles.

    Parameters
    ----------
    e, m, rules, saved, bench : tuples
        Lanes are at their cycles in `saved`, and were themselves at `m.home`; where they are now
        does not matter, and changes.
    c : Claims
        Receives the verdicts.
    """
    for i in range(len(e.codes)):
        claimed = m.numbers[i, PHASE] == PROVING and m.numbers[i, LEAPT] > 0
        if claimed and c.verdict[i] == OPEN_CLAIM and not is_stopped(e.flow.space):
            verdict = prove_lane(e, m, rules, saved, bench, c, i)
            c.verdict[i] = OPEN_CLAIM if is_stopped(e.flow.space) else verdict


@compiled()
def prove_lane(
    e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, c: Claims, i: int
) -> int:
    """The same for one lane; see :func:`prove_all`."""
    s = e.lanes
    station = m.before  # free, since nothing has to be reverted
    later = place_station(e, m, rules, saved, bench, i)
    if not later >= 0.0:
        return REFUSED
    copy_lane(m.home, i, s, i)
    follow_lane(e, i, s.clock[i, NOW] + later, rules.most[1], UNRECORDED, bench.record)
    if e.codes[i] != FINISHED:
        return REFUSED
    deviate(m, rules, station, s, i, c.deviation[_HERE])
    word = follow_return(e, m, rules, bench, i)
    deviate(m, rules, station, s, i, c.deviation[_RETURNED])
    copy_lane(station, i, s, i)
    end = s.clock[i, NOW] + m.real[i, DURATION]
    s.counters[i, WORD] = EMPTY_WORD
    count = follow_lane(e, i, end, rules.most[1], RECORDED, bench.record)
    if e.codes[i] != FINISHED or s.counters[i, WORD] != word:
        return REFUSED
    for j in range(count):
        c.piece[j] = number_of(c, bench.record.mode[j], bench.record.region[j])
        if c.piece[j] < 0:
            nc = bench.record.mode.shape[1]
            copy(bench.record.mode[j], c.wanted[i, :nc])
            copy(bench.record.region[j], c.wanted[i, nc:])
            return UNKNOWN_MODE
    if not differentiate(e, m, rules, bench, c, i, count):
        return REFUSED
    if not (
        radius(c) <= 1.0 + _GROWTH and deviation_vanishes(rules, c) and curvature_negligible(c)
    ):
        return REFUSED
    return PROVED if same_mode_sequence(e, m, rules, bench, c, i, word) else REFUSED


@compiled()
def place_station(e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, i: int) -> float:
    """Place a station in the middle of the longest flight of a cycle, far from events; returns its
    time from the start of the cycle, NaN if the cycle is too long."""
    s = e.lanes
    record = bench.record
    start = m.real[i, START]
    end = start + m.real[i, DURATION]
    copy_lane(saved, i, s, i)
    count = follow_lane(e, i, end, rules.most[1], RECORDED, record)
    if e.codes[i] != FINISHED:
        return np.nan
    longest, middle = 0.0, 0.5 * (start + end)
    begin = start
    for j in range(1, count):
        if record.cause[j] >= 0 or j == count - 1:
            if record.time[j] - begin > longest:
                longest = record.time[j] - begin
                middle = 0.5 * (record.time[j] + begin)
            begin = record.time[j]
    copy_lane(saved, i, s, i)
    follow_lane(e, i, middle, rules.most[1], UNRECORDED, record)
    if e.codes[i] != FINISHED:
        return np.nan
    copy_lane(s, i, m.before, i)
    return middle - start


@compiled()
def follow_return(e: Engine, m: Marks, rules: Rules, bench: Bench, i: int) -> int:
    """Follow a lane for a period of its cycle; returns its mode sequence as a number, −1 if the
    motion ends."""
    s = e.lanes
    s.counters[i, WORD] = EMPTY_WORD
    end = s.clock[i, NOW] + m.real[i, DURATION]
    follow_lane(e, i, end, rules.most[1], UNRECORDED, bench.record)
    return s.counters[i, WORD] if e.codes[i] == FINISHED else -1


@compiled()
def deviate(m: Marks, rules: Rules, station: Lane, lanes: Lane, i: int, out: Array) -> None:
    """Distance of a lane from its station, without frame and translation, in units of the sizes of
    the components.

    Parameters
    ----------
    out : array, shape (n,)
    """
    since = lanes.clock[i, NOW] - station.clock[i, NOW]
    for r in range(len(out)):
        out[r] = lanes.y[i, r] - station.y[i, r] - m.frame[i, r] * since
    remove_cells(out, m, rules, i)
    put_into_units(out, m.size[i])


@compiled()
def number_of(c: Claims, mode: Array, region: Array) -> int:
    """Number of the field of a mode and region, −1 if it is not listed."""
    for w in range(len(c.modes)):
        same = True
        for j in range(len(mode)):
            same = same and c.modes[w, j] == mode[j]
        for j in range(len(region)):
            same = same and c.regions[w, j] == region[j]
        if same:
            return w
    return -1


@compiled()
def differentiate(
    e: Engine, m: Marks, rules: Rules, bench: Bench, c: Claims, i: int, count: int
) -> bool:
    """Compute the monodromy matrix along the recorded cycle, in units of the sizes of the
    components, into the first entry of `after`; False if the motion has no derivative.

    Parameters
    ----------
    bench : Bench
        With the record of the cycle.
    c : Claims
        Receives the matrix.
    i, count : int
        The lane, and how many knots are recorded.
    """
    n = len(c.followed[0])
    flow = own_flow(e, i)
    tol, atol = rules.fine[0], rules.fine[1]
    fine = Flow(flow.rows, flow.k, flow.space, flow.order, tol, atol, flow.supports)
    knots = knots_of(bench.record, 0, count)
    run = Pass(
        knots,
        e.lanes.seen[i],
        c.origin,
        c.drives[i],
        0,
        c.piece[:count],
        c.parts[:count],
        c.after[:count],
        c.late,
        c.outcome[:count],
        c.event,
    )
    for r in range(n):
        for j in range(n):
            run.after[0, r, j] = 1.0 if r == j else 0.0
    for r in range(c.parameters.shape[1]):
        for j in range(c.work.values.shape[1]):
            c.work.values[1 + n + r, j] = c.parameters[i, r]
    flow.space.known[-1] = 1
    # Around once, changes of the state may break the constraints of the mode; what comes of them
    # does not, and that is where the multipliers are. So events that are one there count as one.
    smooth = go_around(e.machine, fine, c, run, True)
    if smooth < 0:
        return False
    if smooth == 0:
        put_matrix(run.after[count - 1], c.squares[0])
        put_matrix(c.squares[0], run.after[0])
        if go_around(e.machine, fine, c, run, False) <= 0:
            return False
        put_product(c.squares[0], c.squares[0], c.squares[1])
        if not nearly_equal(run.after[count - 1], c.squares[1]):
            return False
        put_matrix(c.squares[0], run.after[count - 1])
    return put_into_claims(m, rules, c, run, i)


@compiled()
def put_into_claims(m: Marks, rules: Rules, c: Claims, run: Pass, i: int) -> bool:
    """The monodromy matrix in units of the sizes of the components, without translations and
    delays, which are also taken off the deviations; False if it is not finite.

    Parameters
    ----------
    c : Claims
        Receives the matrix.
    run : Pass
        Once around.
    """
    n = len(c.followed[0])
    last = len(run.piece) - 1
    size = m.size[i]
    rates = c.deviation[_RATES]
    for r in range(n):
        rates[r] = 0.0
    if m.drive[i] <= 0.0:
        guards_at(c.listed, run, c.work.values, run.piece[0], 0, c.work.here)
        for r in range(n):
            rates[r] = c.work.here.rates[r] - m.frame[i, r]
        remove_shift(rates, rules.shifts)
        put_into_units(rates, size)
        speed = norm(rates)
        for r in range(n):
            rates[r] = rates[r] / speed if speed > 0.0 else 0.0
        remove_part(c.deviation[_HERE], rates)
        remove_part(c.deviation[_RETURNED], rates)
    column = c.deviation[_NOW]
    for j in range(n):
        for r in range(n):
            column[r] = run.after[last, r, j] * size[j]
            if not abs(column[r]) < np.inf:
                return False
        remove_shift(column, rules.shifts)
        put_into_units(column, size)
        remove_part(column, rates)
        for r in range(n):
            c.squares[0, r, j] = column[r]
    put_matrix(c.squares[0], c.after[0])
    return True


@compiled()
def go_around(machine: Machine, fine: Flow, c: Claims, run: Pass, forced: bool) -> int:
    """The first variation over one period, from that at the first knot.

    Parameters
    ----------
    forced : bool
        Whether events that coincide, but not for all neighbours, are to count as one.

    Returns
    -------
    int
        1, or 0 where something is touched, or there were such events; −1 if there is no variation.
    """
    found = 1
    for j in range(len(run.outcome)):
        run.outcome[j] = PASSED
    start = 0
    while True:
        code = vary(machine, fine, c.listed, run, c.work, start)
        if code == PASSED:
            break
        if code != CORNER or not forced:
            return -1
        found = 0
        here = c.work.here
        start = run.event[ENDS]
        g = fired(c.listed, run, run.event[BEGINS], start, here)
        change = run.after[run.event[BEGINS]]
        jump(here, g, c.work.around.rates, here.terms[g], change)
        for j in range(run.event[BEGINS] + 1, start + 1):
            put_matrix(change, run.after[j])
    for j in range(len(run.outcome)):
        if run.outcome[j] == GRAZED:
            found = 0
    return found


@compiled()
def nearly_equal(A: Array, B: Array) -> bool:
    """Return whether two matrices are equal up to rounding."""
    size = 0.0
    apart = 0.0
    for r in range(len(A)):
        for j in range(len(A)):
            size = max(size, abs(A[r, j]))
            apart = max(apart, abs(A[r, j] - B[r, j]))
    return apart <= ALIKE * size


@compiled()
def put_into_units(v: Array, size: Array) -> None:
    """Components relative to their sizes; components of size zero are ignored."""
    for r in range(len(v)):
        v[r] = v[r] / size[r] if size[r] > 0.0 else 0.0


@compiled()
def radius(c: Claims) -> float:
    """Spectral radius of the monodromy matrix."""
    power, square = c.squares[0], c.squares[1]
    put_matrix(c.after[0], power)
    exponent = 1.0
    log = 0.0
    for _ in range(_DOUBLINGS):
        largest = 0.0
        for r in range(len(power)):
            for j in range(len(power)):
                largest = max(largest, abs(power[r, j]))
        if not largest > 0.0:
            return 0.0
        log += math.log(largest) / exponent
        exponent *= 2.0
        for r in range(len(power)):
            for j in range(len(power)):
                power[r, j] /= largest
        put_product(power, power, square)
        put_matrix(square, power)
    return math.exp(log)


@compiled()
def put_image(M: Array, v: Array, out: Array) -> None:
    """The deviation after a return."""
    for r in range(len(v)):
        total = 0.0
        for j in range(len(v)):
            total += M[r, j] * v[j]
        out[r] = total


@compiled()
def deviation_vanishes(rules: Rules, c: Claims) -> bool:
    """Return whether the deviation of the true motion vanishes in the limit."""
    power, square = c.squares[0], c.squares[1]
    put_matrix(c.after[0], power)
    for _ in range(_AT_LAST):
        put_product(power, power, square)
        put_matrix(square, power)
    left = c.deviation[_NOW]
    put_image(power, c.deviation[_HERE], left)
    return largest_component(left) <= rules.real[5]


@compiled()
def curvature_negligible(c: Claims) -> bool:
    """Return whether the curvature of the return map, as observed in the true motion, is negligible
    until convergence."""
    M = c.after[0]
    now, later = c.deviation[_NOW], c.deviation[_LATER]
    first = norm(c.deviation[_HERE])
    put_image(M, c.deviation[_HERE], now)
    for r in range(len(now)):
        later[r] = c.deviation[_RETURNED, r] - now[r]
    curvature = norm(later) / first if first > 0.0 else 0.0
    grown = 1.0
    total = 0.0
    copy(c.deviation[_HERE], now)
    for _ in range(_FURTHEST):
        size = norm(now) / first if first > 0.0 else 0.0
        grown = max(grown, size)
        total += size * size
        if size <= _NEAR:
            return curvature * grown * total <= _CURVED
        put_image(M, now, later)
        copy(later, now)
    return False


@compiled()
def same_mode_sequence(
    e: Engine, m: Marks, rules: Rules, bench: Bench, c: Claims, i: int, word: int
) -> bool:
    """Return whether returns from the remaining deviations of the motion have the mode sequence of
    the cycle.

    Parameters
    ----------
    i, word : int
        The lane, and the mode sequence of its cycle.
    """
    s = e.lanes
    M = c.after[0]
    now, later = c.deviation[_NOW], c.deviation[_LATER]
    first = norm(c.deviation[_HERE])
    copy(c.deviation[_HERE], now)
    copy(now, c.followed[0])
    known = 1
    while norm(now) > _NEAR * first:
        if not covered(c, known, now):
            if known == len(c.followed):
                return False
            copy_lane(m.before, i, s, i)
            for r in range(len(now)):
                s.y[i, r] += _BEYOND * now[r] * m.size[i, r]
            s.counters[i, CAUSE] = -1
            if follow_return(e, m, rules, bench, i) != word:
                return False
            for r in range(len(now)):
                c.followed[known, r] = _BEYOND * now[r]
            known += 1
        put_image(M, now, later)
        copy(later, now)
    return True


@compiled()
def covered(c: Claims, known: int, v: Array) -> bool:
    """Return whether a deviation is in a narrow cone around a longer one that has been followed."""
    length = norm(v)
    for k in range(known):
        p = c.followed[k]
        along = 0.0
        for r in range(len(v)):
            along += p[r] * v[r]
        reach = norm(p)
        along = along / reach if reach > 0.0 else 0.0
        aside = math.sqrt(max(length * length - along * along, 0.0))
        if 0.0 < along <= reach and aside <= _NARROW * along:
            return True
    return False
