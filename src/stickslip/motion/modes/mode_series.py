"""The Taylor series of the motion in a given mode, and its step size."""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.series import SINGULAR, invert
from stickslip.motion.admissible.sharing import is_dependent, orthonormalise
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.modes.surfaces import are_numbers, release_or_hold
from stickslip.motion.steps.arrays import (
    AIM_SPEED,
    COORDINATES,
    DIMENSION,
    INERTIAL,
    LEAD,
    MEMBERS,
    NAN,
    NOW,
    OFF_SURFACE,
    OK,
    ON_INERTIAL,
    ON_VISCOUS,
    OVERFLOW,
    PART,
    PREDICTED,
    RATE_INDEPENDENT,
    RECENT,
    SERIES,
    SPAN,
    VISCOUS,
    Flow,
    Instant,
    Lane,
    Machine,
    Rows,
)
from stickslip.motion.steps.contacts import (
    directions_of,
    is_loose,
    loosen_friction,
    set_mode,
)
from stickslip.motion.steps.sets import whole_rate, whole_speed
from stickslip.motion.steps.starting import coefficients
from stickslip.motion.steps.step_size import COARSER, FAINT, LEAST_SIZE, better, step_size, suits
from stickslip.numerics.levels import EPSILON, INSTANT, ON_SURFACE, ROUNDING
from stickslip.translator import compiled

_PAST = 1.0625  # end of the step that contains a kink, relative to the time to the kink
# relative to a step, and to the time: a kink this close is the one that has been passed
_PASSED, _ROUNDED = 1e-12, 1e3 * EPSILON
_LOOSER = 1e4  # difference of the rates at the end of a step from the predicted ones, in tolerances


@compiled()
def make_series(
    machine: Machine, flow: Flow, lane: Lane, room: float, near: float, hold: bool
) -> tuple[int, float]:
    """Taylor coefficients in the current mode of a lane, and the step for which they are accurate,
    between representable times.

    Parameters
    ----------
    lane : Lane
        Its state is put back onto the constraints of the mode.
    room, near : float
        Longest step that is wanted, and (times the slack) longest for which slip was denied here.
    hold : bool
        Whether sticking contacts are put onto the surface speed.

    Returns
    -------
    status, step
        As in :func:`evaluate_mode`; 0 unless that is OK.
    """
    t = lane.clock[NOW]
    here = Instant(t, lane.y, lane.mode, lane.reg)
    recent, span = lane.clock[RECENT], lane.clock[SPAN]
    status = evaluate_mode(machine, flow, here, recent, near, span, hold)
    h = 0.0
    if status == OK:
        h = step_size(flow, lane.mode, flow.order, lane.seen, lane.clock[SERIES])
        h = min(h, room)
        passed = max(_PASSED * h, _ROUNDED * abs(t))
        h = min(h, _PAST * soonest_kink(flow.rows, flow.space.W, flow.order, passed))
        h = (t + h) - t
        keep_rest(flow.rows, lane.y, flow.space.y0)
    return status, h


@compiled()
def keep_rest(rows: Rows, y: Array, start: Array) -> None:
    """Keep velocities that were projected onto their constraints for the modes that are tried next:
    a slip in a plane begins exactly from rest.

    Parameters
    ----------
    y, start : array
        State, and that from which modes are tried.
    """
    nq = rows.sizes[INERTIAL]
    for q in range(nq):
        if rows.made[q] >= 0:
            start[q], start[nq + q] = y[q], y[nq + q]


@compiled()
def evaluate_mode(
    machine: Machine, flow: Flow, at: Instant, last: float, near: float, span: float, hold: bool
) -> int:
    """Taylor coefficients of the motion in a mode; y is put back onto the constraints of the
    mode.

    Parameters
    ----------
    at : Instant
        Its state is put back, and its mode is changed where a contact that is not at rest slips.
    last, near, span : float
        As in :func:`.release_or_hold`.
    hold : bool
        Whether sticking contacts are put onto the surface speed.

    Returns
    -------
    int
        OK, SINGULAR, INDEFINITE, NAN, OFF_SURFACE or OVERFLOW.
    """
    W = flow.space.W
    rows = flow.rows
    while True:
        loosen_friction(rows, at.mode)
        if not resolve(rows, flow.k, flow.space, at.mode):
            return SINGULAR
        sticking = False
        for c in range(rows.sizes[ON_INERTIAL]):
            sticking = sticking or at.mode[c] == 0
        if not sticking or not hold:
            break
        status = coefficients(machine, flow, at, 1, W)
        if status != OK:
            return status
        if not are_numbers(flow, at.mode):
            return NAN
        held = release_or_hold(flow, at, last, near, span, False)
        if held and not rest_with_others(machine, flow, at):
            break
    if rows.sizes[RATE_INDEPENDENT] > 0:
        status = project_rates(machine, flow, at)
        if status != OK:
            return status
    status = coefficients(machine, flow, at, flow.order, W)
    if status != OK:
        return status
    return judge_coefficients(rows, W, flow.order)


@compiled()
def project_rates(machine: Machine, flow: Flow, at: Instant) -> int:
    """Put sliding rate-independent coordinates back on λ + σ s = 0 (one Newton step: they are there
    up to rounding)."""
    sizes = flow.rows.sizes
    space = flow.space
    mode = at.mode
    nr = sizes[RATE_INDEPENDENT]
    first = sizes[ON_INERTIAL] + sizes[ON_VISCOUS]
    offset = 2 * sizes[INERTIAL] + sizes[VISCOUS]
    G = space.G
    sliding = False
    for i in range(nr):
        sliding = sliding or mode[first + i] != 0
    if not sliding:
        return OK
    machine.residual(at.t, at.y, mode, at.reg, flow.k.K, G, space.A)
    for i in range(nr):
        if mode[first + i] != 0 and not abs(G[i]) <= ON_SURFACE * G[nr + i]:
            return OFF_SURFACE
    if not invert(space.A, nr, space.B):
        return SINGULAR
    for i in range(nr):
        for j in range(nr):
            at.y[offset + i] -= space.B[i, j] * G[j]
    return OK


@compiled(brief=True)
def rest_with_others(machine: Machine, flow: Flow, at: Instant) -> bool:
    """Set contacts to stick that the others of their body hold, if their speed is within rounding
    errors of zero; returns whether there are any.

    Parameters
    ----------
    flow : Flow
        With the inverses of the mode.
    at : Instant
        Its mode is changed.
    """
    rows = flow.rows
    mode = at.mode
    mag = flow.space.mag
    known = False
    found = False
    for c in rows.sharing:
        group = rows.group[c]
        if mode[c] == 0 or is_loose(rows, mode, c):
            continue
        rank = orthonormalise(flow, mode, flow.space.W, group)[1]
        if rank == 0 or not is_dependent(flow, flow.space.W, c, rank):
            continue
        if not known and coefficients(machine, flow, at, 1, flow.space.W) != OK:
            return False
        known = True
        size = whole_speed(rows, mag, c)
        rate = whole_rate(rows, mag, c)
        speed = 0.0
        for i in directions_of(rows, c):
            speed += abs(flow.space.W[rows.u[i], 0])
        if speed <= ROUNDING * size + INSTANT * abs(at.t) * rate:
            set_mode(rows, mode, c, 0)
            found = True
    return found


@compiled()
def judge_coefficients(rows: Rows, W: Array, N: int) -> int:
    """Whether Taylor coefficients are numbers, NAN, or OVERFLOW in their unit of time.

    What overflows at high orders only is a blow-up, for which no step is small enough: it becomes
    infinite.
    """
    for r in range(rows.sizes[DIMENSION]):
        if not (math.isfinite(W[r, 0]) and math.isfinite(W[rows.program.rates[r], 0])):
            return NAN
        if not (math.isfinite(W[r, 1]) and math.isfinite(W[r, min(N, 2)])):
            return OVERFLOW
        if not math.isfinite(W[r, N]):
            W[r, N] = np.inf
    for c in range(len(rows.u)):
        r = rows.u[c]
        if not math.isfinite(W[r, 0]):
            return NAN
        if not math.isfinite(W[r, N - 1]):
            W[r, N - 1] = np.inf
    return OK


@compiled()
def soonest_kink(rows: Rows, W: Array, N: int, passed: float) -> float:
    """Time of the next kink whose guard is a polynomial in time of degree one or two; infinite if
    there is none.

    A series that ends, as that of a drive between two samples, would last for ever; beyond the
    kink its terms are so large that what is small before it would count as zero.

    Parameters
    ----------
    W : array
        Taylor coefficients.
    N : int
        Their number.
    passed : float
        Time within which a kink is the one that has just been passed.
    """
    found = np.inf
    unit = W[rows.sizes[DIMENSION], 1]
    for j in range(len(rows.timed)):
        c = W[rows.kinks[j]]
        ends = rows.timed[j] == 1
        for k in range(3, N):
            ends = ends and c[k] == 0.0
        inside = c[1] * c[1] - 4.0 * c[2] * c[0]
        if ends and inside >= 0.0 and c[1] != 0.0:
            q = -0.5 * (c[1] + math.copysign(math.sqrt(inside), c[1]))
            near = c[0] / q
            far = q / c[2] if c[2] != 0.0 else near
            for x in (near, far):
                if x * unit > passed:
                    found = min(found, x * unit)
    return found


@compiled()
def unit_for(status: int, h: float, room: float, unit: float) -> tuple[bool, float]:
    """A unit of time for coefficients that overflow in the current one, or are badly scaled for the
    step; first, whether it changes.

    All others are powers of two times these, so that nothing is rounded.
    """
    if status == OVERFLOW:
        return True, COARSER * unit
    if status == OK and not suits(h, room, unit):
        return True, better(h, unit)
    return False, unit


@compiled()
def matches_prediction(flow: Flow, table: Array, y: Array, seen: Array, h: float) -> bool:
    """Whether the rates at the end of a step agree with those that its series predicts. The modes
    of a structure are components of one vector, and are compared with its norm.

    Parameters
    ----------
    table : array
        Values of the rows at the end of the step.
    """
    rows = flow.rows
    mag = flow.space.mag
    change = flow.space.last_step[PREDICTED]
    tol = _LOOSER * flow.tol
    late = INSTANT * abs(table[len(y), 0]) / h  # the end is a rounded time
    vague = direction_error(flow, table, y, h)
    shared, until = 0.0, 0
    nq = rows.sizes[INERTIAL]
    faint = 0.0
    for i in range(len(y)):
        if i >= until:
            shared, until = size_of_body(rows, y, change, i)
        if i in (0, nq):
            faint = FAINT * largest_of_kind(y, change, i, nq)
        if i >= 2 * nq:
            faint = 0.0
        own = max(abs(y[i]) + abs(change[i]), max(shared, faint))
        size = LEAST_SIZE + own + flow.atol * seen[i]
        rounding = (ROUNDING + vague) * mag[rows.noise[i]] * h if rows.noise[i] >= 0 else 0.0
        rounding += late * abs(change[i])
        rate = rows.program.rates[i]
        if rate < len(y) and rows.noise[rate] >= 0:
            # A velocity is only as accurate as the nearly cancelling forces that generate it.
            rounding += ROUNDING * mag[rows.noise[rate]] * h * h
        if abs(table[rate, 0] * h - change[i]) > tol * size + rounding:
            return False
    return True


@compiled()
def largest_of_kind(y: Array, change: Array, first: int, count: int) -> float:
    """The largest of places, or of velocities.

    Parameters
    ----------
    y, change : arrays
        Values, and by how much they change.
    first, count : int
        The first of them, and their number.
    """
    largest = 0.0
    for r in range(first, first + count):
        largest = max(largest, abs(y[r]) + abs(change[r]))
    return largest


@compiled()
def size_of_body(rows: Rows, y: Array, change: Array, i: int) -> tuple[float, int]:
    """The largest value of the modes of a structure, or of their rates, if they begin with this row
    of the state; and where they end. Otherwise 0, and the next row.

    Parameters
    ----------
    y, change : arrays
        Values, and by how much they change.
    i : int
        The row.
    """
    for b in range(len(rows.bodies)):
        begin = rows.bodies[b, 0]
        if i == begin or i == rows.sizes[INERTIAL] + begin:
            largest = 0.0
            for r in range(i, i + rows.bodies[b, 1]):
                largest = max(largest, abs(y[r]) + abs(change[r]))
            return largest, i + rows.bodies[b, 1]
    return 0.0, i + 1


@compiled()
def direction_error(flow: Flow, table: Array, y: Array, h: float) -> float:
    """Effect of rounding errors of velocities on the directions of slips that begin together.

    Parameters
    ----------
    flow : Flow
        With the predicted changes of the step.
    table : array
        Values of the rows at its end.
    y : array
        State there.
    h : float
        Its length.
    """
    rows = flow.rows
    mag = flow.space.mag
    nq = rows.sizes[INERTIAL]
    found = 0.0
    for p in range(len(rows.planes)):
        plane = rows.planes[p]
        first = plane[LEAD]
        speed = table[plane[AIM_SPEED], 0]
        if rows.group[first] < 0 or not speed > 0.0:
            continue
        faster = 0.0
        part = rows.parts[rows.homes[first, PART]]
        for i in range(part[COORDINATES]):
            r = nq + rows.members[part[MEMBERS] + i]
            faster += y[r] * flow.space.last_step[PREDICTED, r]
        if faster > 0.0:
            size = whole_speed(rows, mag, first) + h * whole_rate(rows, mag, first)
            found = max(found, ROUNDING * size / speed)
    return found
