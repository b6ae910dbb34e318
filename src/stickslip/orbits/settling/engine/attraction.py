"""Whether a motion comes by itself to the cycle that its returns have led to by hand; in compiled
code.

At a station on the cycle, in the middle of its longest flight, let x* be the state, M the
monodromy matrix of the first variation (:mod:`stickslip.orbits.fields.engine.variations`), and e
the deviation of the true motion. It has to be seen that

* no multiplier is greater than 1 (Gelfand's formula ρ = lim ‖Mᵏ‖^{1/k}, by squaring), and what
  is left of e in the end, lim Mᵏe, is a delay along the cycle, and nothing else;
* the return of the true motion goes through the same modes, and its deviation is M e but for a
  curvature that is small all the way: were it as large everywhere as it is here, relative to the
  square of the deviation, it would add up to less than a part of e;
* so do returns from the deviations Mʲe that it has later, those in between included: every one of
  them is within a narrow cone around one that has been followed, and shorter.

What sticks makes families of cycles, and a jump over a beat in which it would have slipped ends on
another one of them: that is what the third condition is for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.machine_code.functions import entry_point, njit
from stickslip.motion.engine.modes import copy
from stickslip.motion.steps.arrays import (
    CAUSE,
    EMPTY_WORD,
    FINISHED,
    INLINED,
    NOW,
    OPTIONS,
    WORD,
    Flow,
    Lane,
)
from stickslip.orbits.fields.engine.variations import (
    GRAZED,
    PASSED,
    Listed,
    Pass,
    Work,
    guards_at,
    put_matrix,
    put_product,
    vary,
)
from stickslip.orbits.settling.engine.measuring import knots_of
from stickslip.orbits.settling.engine.returns import norm, remove_shift
from stickslip.orbits.settling.engine.settling import (
    RECORDED,
    UNRECORDED,
    copy_lane,
    follow_lane,
    own_flow,
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

OPEN_CLAIM, PROVED, REFUSED, UNKNOWN_MODE = range(4)
"""What is said of a lane; an unknown mode is one whose field the host has not listed yet."""

HERE, RETURNED, RATES, _NOW, _LATER = range(5)
_DOUBLINGS = 40  # ‖Mᵏ‖^{1/k} with k = 2⁴⁰ is ρ to 1e-10
_GROWTH = 1e-9  # by which a multiplier may seem to be greater than 1
_CURVED = 0.25  # part of e that curvature may add up to
_NARROW = 0.2  # sine of the half opening of the cones
_BEYOND = 1.1  # how much longer deviations are followed than they are
_AT_LAST = 20  # doublings after which what is left of a deviation stays
_NEAR = 0.05  # part of its first size at which a deviation is no longer followed
_FURTHEST = 20_000  # returns after which a deviation has to be so small


class Claims(NamedTuple):
    """What is to be proved of lanes, and room for it.

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
    listed : Listed
    modes, regions : arrays of int, shapes (pieces, contacts) and (pieces, kinks)
        Of the fields that are listed.
    piece, parts, outcome, event, after : arrays
        See :class:`stickslip.orbits.fields.engine.variations.Pass`.
    work : Work
    squares : array, shape (2, n, n)
    deviation : array, shape (5, n)
        In units of the sizes of the components: deviations of the true motion, now (HERE) and after
        a return (RETURNED), its rates, and two to work on.
    followed : array, shape (·, n)
        Deviations from which returns were followed.
    """

    verdict: Array
    wanted: Array
    parameters: Array
    drives: Array
    origin: float
    listed: Listed
    modes: Array
    regions: Array
    piece: Array
    parts: Array
    outcome: Array
    event: Array
    after: Array
    work: Work
    squares: Array
    deviation: Array
    followed: Array


@entry_point(**OPTIONS)
def prove_all(
    e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, c: Claims, stop: Array
) -> None:
    """See whether motions that were carried on by hand come to their cycles by themselves.

    Parameters
    ----------
    e, m, rules, saved, bench : tuples
        Lanes are at their cycles in `saved`, and were themselves at `m.home`; where they are now
        does not matter, and changes.
    c : Claims
        Receives the verdicts.
    stop : array, shape (1,)
        Not zero once there is a wish to stop.
    """
    for i in range(len(e.codes)):
        claimed = m.numbers[i, PHASE] == PROVING and m.numbers[i, LEAPT] > 0
        if claimed and c.verdict[i] == OPEN_CLAIM and stop[0] == 0:
            c.verdict[i] = prove_lane(e, m, rules, saved, bench, c, i)


@njit(**INLINED)
def prove_lane(
    e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, c: Claims, i: int
) -> int:
    """The same for one lane; see :func:`prove_all`."""
    s = e.lanes
    station = m.before  # free, since nothing has to be undone any more
    later = place_station(e, m, rules, saved, bench, i)
    if not later >= 0.0:
        return REFUSED
    copy_lane(m.home, i, s, i)
    follow_lane(e, i, s.clock[i, NOW] + later, rules.most[1], UNRECORDED, bench.record)
    if e.codes[i] != FINISHED:
        return REFUSED
    deviate(m, rules, station, s, i, 0.0, c.deviation[HERE])
    home_word = follow_return(e, m, rules, bench, i)
    if home_word < 0:
        return REFUSED
    deviate(m, rules, station, s, i, m.real[i, DURATION], c.deviation[RETURNED])
    copy_lane(station, i, s, i)
    s.counters[i, WORD] = EMPTY_WORD
    end = s.clock[i, NOW] + m.real[i, DURATION]
    count = follow_lane(e, i, end, rules.most[1], RECORDED, bench.record)
    word = s.counters[i, WORD]
    if e.codes[i] != FINISHED or word != home_word:
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
    if not (radius(c) <= 1.0 + _GROWTH and ends_here(m, rules, c, i) and comes_home(c)):
        return REFUSED
    return PROVED if keeps_its_word(e, m, rules, bench, c, i, word) else REFUSED


@njit(**INLINED)
def place_station(e: Engine, m: Marks, rules: Rules, saved: Lane, bench: Bench, i: int) -> float:
    """Put a station in the middle of the longest flight of a cycle, where no event is near: how
    long after its beginning that is, NaN if the cycle is too long."""
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


@njit(**INLINED)
def follow_return(e: Engine, m: Marks, rules: Rules, bench: Bench, i: int) -> int:
    """Follow a lane for a period of its cycle; the word of the modes that it goes through, −1 if it
    comes to an end."""
    s = e.lanes
    s.counters[i, WORD] = EMPTY_WORD
    end = s.clock[i, NOW] + m.real[i, DURATION]
    follow_lane(e, i, end, rules.most[1], UNRECORDED, bench.record)
    return s.counters[i, WORD] if e.codes[i] == FINISHED else -1


@njit(**OPTIONS)
def deviate(
    m: Marks, rules: Rules, station: Lane, lanes: Lane, i: int, since: float, out: Array
) -> None:
    """By how much a lane is away from its station, without frame and translation, in units of the
    sizes of the components.

    Parameters
    ----------
    m : Marks
    rules : Rules
    station, lanes : Lane
    i : int
    since : float
        For how long both have gone on.
    out : array, shape (n,)
    """
    t = lanes.clock[i, NOW] - since
    for r in range(len(out)):
        moved = m.frame[i, r] * (t - station.clock[i, NOW] + since)
        out[r] = lanes.y[i, r] - station.y[i, r] - moved
    remove_shift(out, rules.shifts)
    for r in range(len(out)):
        out[r] = out[r] / m.size[i, r] if m.size[i, r] > 0.0 else 0.0


@njit(**OPTIONS)
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


@njit(**INLINED)
def differentiate(
    e: Engine, m: Marks, rules: Rules, bench: Bench, c: Claims, i: int, count: int
) -> bool:
    """The monodromy matrix along the recorded cycle, in units of the sizes of the components, is
    left as the first of `after`; False if the motion has no derivative."""
    n = len(c.followed[0])
    flow = own_flow(e, i)
    fine = Flow(flow.rows, flow.k, flow.space, flow.order, rules.fine[0], rules.fine[1])
    knots = knots_of(bench.record, 0, count)
    run = Pass(
        knots,
        e.lanes.seen[i],
        c.origin,
        c.drives[i],
        c.piece[:count],
        c.parts[:count],
        c.after[:count],
        c.outcome[:count],
        c.event,
    )
    for r in range(n):
        for j in range(n):
            run.after[0, r, j] = 1.0 if r == j else 0.0
    for j in range(count):
        run.outcome[j] = PASSED
    for r in range(c.parameters.shape[1]):
        for j in range(c.work.values.shape[1]):
            c.work.values[1 + n + r, j] = c.parameters[i, r]
    flow.space.known[-1] = 1
    if vary(e.machine, fine, c.listed, run, c.work, 0) != PASSED:
        return False
    for j in range(count):
        if run.outcome[j] == GRAZED:
            return False
    size = m.size[i]
    guards_at(c.listed, run, c.work.values, run.piece[0], 0, c.work.here)
    rates = c.deviation[RATES]
    for r in range(n):
        rates[r] = c.work.here.rates[r] - m.frame[i, r]
    remove_shift(rates, rules.shifts)
    for r in range(n):
        rates[r] = rates[r] / size[r] if size[r] > 0.0 else 0.0
    for r in range(n):
        for j in range(n):
            known = size[r] > 0.0 and size[j] > 0.0
            M = run.after[count - 1, r, j]
            if not abs(M) < np.inf:
                return False
            c.after[0, r, j] = M * size[j] / size[r] if known else 0.0
    return True


@njit(**OPTIONS)
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


@njit(**OPTIONS)
def turn(M: Array, v: Array, out: Array) -> None:
    """The deviation after a return."""
    for r in range(len(v)):
        total = 0.0
        for j in range(len(v)):
            total += M[r, j] * v[j]
        out[r] = total


@njit(**OPTIONS)
def ends_here(m: Marks, rules: Rules, c: Claims, i: int) -> bool:
    """Whether nothing but a delay is left of the deviation of the true motion in the end; that is
    taken off."""
    power, square = c.squares[0], c.squares[1]
    put_matrix(c.after[0], power)
    for _ in range(_AT_LAST):
        put_product(power, power, square)
        put_matrix(square, power)
    left, rest = c.deviation[_NOW], c.deviation[_LATER]
    rates = c.deviation[RATES]
    turn(power, c.deviation[HERE], left)
    speed = 0.0
    along = 0.0
    for r in range(len(left)):
        speed += rates[r] * rates[r]
        along += rates[r] * left[r]
    delay = along / speed if speed > 0.0 and m.drive[i] <= 0.0 else 0.0
    for r in range(len(left)):
        rest[r] = left[r] - delay * rates[r]
        if not abs(rest[r]) <= rules.real[5]:
            return False
        c.deviation[HERE, r] -= left[r]
        c.deviation[RETURNED, r] -= left[r]
    return True


@njit(**OPTIONS)
def comes_home(c: Claims) -> bool:
    """Whether the curvature of the return map, as far as the true motion shows it, is too small to
    matter on the way."""
    M = c.after[0]
    now, later = c.deviation[_NOW], c.deviation[_LATER]
    first = norm(c.deviation[HERE])
    turn(M, c.deviation[HERE], now)
    for r in range(len(now)):
        later[r] = c.deviation[RETURNED, r] - now[r]
    curvature = norm(later) / first if first > 0.0 else 0.0
    grown = 1.0
    total = 0.0
    copy(c.deviation[HERE], now)
    for _ in range(_FURTHEST):
        size = norm(now) / first if first > 0.0 else 0.0
        grown = max(grown, size)
        total += size * size
        if size <= _NEAR:
            return curvature * grown * total <= _CURVED
        turn(M, now, later)
        copy(later, now)
    return False


@njit(**INLINED)
def keeps_its_word(
    e: Engine, m: Marks, rules: Rules, bench: Bench, c: Claims, i: int, word: int
) -> bool:
    """Whether returns from the deviations that the motion still has go through the modes of the
    cycle."""
    s = e.lanes
    M = c.after[0]
    now, later = c.deviation[_NOW], c.deviation[_LATER]
    first = norm(c.deviation[HERE])
    copy(c.deviation[HERE], now)
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
        turn(M, now, later)
        copy(later, now)
    return True


@njit(**OPTIONS)
def covered(c: Claims, known: int, v: Array) -> bool:
    """Whether a deviation is in a narrow cone around a longer one that has been followed."""
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
