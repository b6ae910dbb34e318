"""First variations at the events of a motion, in compiled loops: which guard has fired, and the
jump of the variation."""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array, Matrix, Vector
from stickslip.machine_code.functions import entry_point
from stickslip.motion.engine.jumps import fired_jump
from stickslip.motion.steps.arrays import LEAD, Rows
from stickslip.motion.steps.contacts import has_opened
from stickslip.numerics.levels import TINIEST
from stickslip.orbits.fields.engine.interpreter import perform
from stickslip.orbits.fields.engine.tables import (
    ALIKE,
    CORNER,
    GRAZED,
    MEETING,
    MET,
    PASSED,
    TOGETHER,
    UNEXPLAINED,
    Leave,
    Listed,
    Pass,
    PassSpace,
    put_point,
    time_of,
)
from stickslip.translator import compiled

# a guard whose rate is this small, relative to its terms and its usual rate, is touched, not
# crossed
_TANGENT = 1e-6
_NO_JUMP = 1e-12  # a change of the field this small, relative to its terms, is zero


@compiled()
def guards_at(listed: Listed, run: Pass, values: Array, w: int, knot: int, out: Leave) -> None:
    """The guards of a piece at a knot.

    Parameters
    ----------
    values : array, shape (places, LANES)
        Work space.
    w : int
        The piece.
    """
    put_point(values, 0, time_of(run, knot), run.knots.state[knot])
    perform(listed.made, listed.guards[w, 0], listed.guards[w, 2], values, 1)
    n = run.knots.state.shape[1]
    for r in range(n):
        out.rates[r] = values[listed.rates[w, r], 0]
    for g in range(listed.falls.shape[1]):
        if listed.switches[w, g] >= 0:
            places = listed.falls[w, g]
            out.value[g] = values[places[0], 0]
            time = values[places[1], 0]
            along, terms = 0.0, 0.0
            for c in range(len(places) - 2):
                slope = values[places[2 + c], 0]
                out.slopes[g, c] = slope
                if c < n:
                    along += slope * out.rates[c]
                    terms += abs(slope * out.rates[c])
            out.fall[g] = time + along
            out.terms[g] = abs(time) + terms


@compiled()
def fired(listed: Listed, run: Pass, i: int, last: int, here: Leave) -> int:
    """The guard that fired: among the guards of the causes, otherwise of the switches that changed,
    the one at zero; −1 if there is none.

    Parameters
    ----------
    i, last : int
        The first and the last knot of the events.
    here : Leave
        The guards of the piece before.
    """
    left, right = run.piece[i - 1], run.piece[last]
    named = False
    for j in range(i, last + 1):
        named = named or run.knots.cause[j] >= 0
    best, least = -1, np.inf
    for g in range(listed.switches.shape[1]):
        switch = listed.switches[left, g]
        if switch < 0:
            continue
        meant = False
        if named:
            for j in range(i, last + 1):
                meant = meant or run.knots.cause[j] == switch
        else:
            meant = listed.settings[left, switch] != listed.settings[right, switch]
        off = abs(here.value[g]) / (abs(here.fall[g]) + TINIEST)
        if meant and (best < 0 or off < least):
            best, least = g, off
    return best


@compiled()
def coincide(here: Leave, first: int, among: Array, count: int, arrived: Array) -> bool:
    """Return whether events that coincide do so for all neighbouring motions, so that they are a
    single event.

    Parameters
    ----------
    first : int
        The guard that fired.
    among : array of int
        The others, in its first entries.
    count : int
        Their number.
    arrived : array, shape (columns, directions)
        Variation before the events.
    """
    largest, apart = 0.0, 0.0
    for d in range(arrived.shape[1]):
        reference = delay(here, first, arrived, d)
        largest = max(largest, abs(reference))
        for i in range(count):
            other = delay(here, among[i], arrived, d)
            if not abs(other) < np.inf:
                return False
            largest = max(largest, abs(other))
            apart = max(apart, abs(other - reference))
    return apart <= ALIKE * largest


@compiled()
def delay(here: Leave, g: int, arrived: Array, d: int) -> float:
    """Time by which neighbours in a direction pass a guard earlier."""
    total = 0.0
    for c in range(len(arrived)):
        total += here.slopes[g, c] / here.fall[g] * arrived[c, d]
    return total


@entry_point()
def jump(here: Leave, g: int, onward: Vector, usual: float, change: Matrix) -> int:
    """The variation after one guard, from which the motion continues with other rates.

    Parameters
    ----------
    g : int
        The guard.
    onward : array, shape (states,)
        The rates beyond it.
    usual : float
        Typical rate of decrease of the guard.
    change : array, shape (columns, directions)
        The variation before, and after.

    Returns
    -------
    int
        `PASSED`, or `GRAZED` if the guard is touched without being crossed: then the variation does
        not jump.
    """
    n = len(onward)
    largest, size = 0.0, 0.0
    for r in range(n):
        largest = max(largest, abs(onward[r] - here.rates[r]))
        size = max(size, abs(onward[r]) + abs(here.rates[r]))
    if largest <= _NO_JUMP * size:
        return PASSED
    if abs(here.fall[g]) <= _TANGENT * usual:
        return GRAZED
    for d in range(change.shape[1]):
        earlier = delay(here, g, change, d)
        for r in range(n):
            change[r, d] += (onward[r] - here.rates[r]) * earlier
    return PASSED


@compiled()
def pass_event(listed: Listed, run: Pass, work: PassSpace, i: int, last: int) -> int:
    """The variation after some events, from the variation before the first of them; returns the
    outcome.

    Parameters
    ----------
    i, last : int
        The first and the last knot of the events.
    """
    left, right = run.piece[i - 1], run.piece[last]
    guards = listed.switches.shape[1]
    final = len(run.piece) - 1
    here, around, usual, others = work.here, work.around, work.usual, work.others
    for g in range(guards):
        usual[g] = 0.0
    for knot in (i - 1, min(last + 1, final)):
        guards_at(listed, run, work.values, left, knot, around)
        for g in range(guards):
            if listed.switches[left, g] >= 0 and abs(around.fall[g]) < np.inf:
                usual[g] = max(usual[g], abs(around.fall[g]))
    guards_at(listed, run, work.values, right, i, around)
    guards_at(listed, run, work.values, left, i, here)
    g = fired(listed, run, i, last, here)
    run.event[MEETING] = 1
    if g < 0:
        return UNEXPLAINED
    together = TOGETHER * (time_of(run, final) - time_of(run, 0))
    count = 0
    run.event[MET] = listed.switches[left, g]
    for j in range(guards):
        switch = listed.switches[left, j]
        if switch >= 0 and switch != listed.switches[left, g]:
            falls = here.fall[j] < -_TANGENT * max(usual[j], here.terms[j])
            if abs(here.value[j]) <= together * abs(here.fall[j]) and falls:
                others[count] = j
                count += 1
                run.event[MET + count] = switch
    run.event[MEETING] = 1 + count
    change = run.after[i]
    for d in range(run.late.shape[1]):
        run.late[i, d] = -delay(here, g, change, d)
    if count and not coincide(here, g, others, count, change):
        return CORNER
    return jump(here, g, around.rates, max(usual[g], here.terms[g]), change)


@compiled()
def reverses(rows: Rows, listed: Listed, run: Pass, work: PassSpace, i: int) -> bool:
    """Return whether a planar slip, or a slip of a contact that may share forces with a planar one,
    begins or ends at a knot, or passes through rest.

    Parameters
    ----------
    i : int
        The knot; not the first.
    """
    before, after = run.knots.mode[i - 1], run.knots.mode[i]
    slips = False
    for c in rows.sharing:
        if before[c] != after[c]:
            return True
    for plane in rows.planes:
        if before[plane[LEAD]] != after[plane[LEAD]]:
            return True
        slips = slips or after[plane[LEAD]] != 0
    if not slips:
        return False
    guards_at(listed, run, work.values, run.piece[i - 1], i, work.around)
    for g in range(listed.switches.shape[1]):
        for p in rows.massive_planes:
            own = listed.switches[run.piece[i - 1], g] == len(rows.kinks) + rows.planes[p, LEAD]
            if own and after[rows.planes[p, LEAD]] != 0 and work.around.value[g] == 0.0:
                return True
    return False


@compiled()
def is_discontinuous(rows: Rows, listed: Listed, run: Pass, work: PassSpace, i: int) -> bool:
    """Return whether the state jumps at a knot (a gap has closed, or a declared jump occurred), or
    a planar slip, or a slip of contacts that share forces, begins, ends or reverses, where its
    field is undefined.

    Parameters
    ----------
    i : int
        The knot; not the first.
    """
    if reverses(rows, listed, run, work, i):
        return True
    cause = run.knots.cause[i]
    c = cause - len(rows.kinks)
    if cause >= 0 and c < 0:
        return bool(fired_jump(rows, cause, 1 - run.knots.region[i - 1, cause]) >= 0)
    return bool(c >= 0 and has_opened(rows, run.knots.mode[i - 1], c))
