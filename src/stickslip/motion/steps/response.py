"""The response of the relative velocities of contacts in a plane to their directions of slip.

Slips that begin are at rest: their directions n are no function of the state, and rates are. What
directions make of the rate of Au is found by probes, series with directions that are given. It is
b + Â n where friction does not change the normal forces that press it. Otherwise it is a function
f(n) of all directions, and b + Â n its tangent at some n, with Â = f′ and b = f(n) − Â n. Order 1
of n = n₀ + t e shows f′ exactly. All higher orders are linear, with f′ at the directions of the
beginning. What directions can make is what the body can do: an orthonormal basis Z of it.
"""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.motion.algebra.vectors import is_new
from stickslip.motion.steps.arrays import (
    AHEAD,
    AIM,
    AIM_SPEED,
    AIMS,
    BENDS,
    DIMENSION,
    FEWEST_ORDERS,
    HAS_AXES,
    LEAD,
    OK,
    Flow,
    Instant,
    Machine,
    Rows,
    plain_coefficients,
)
from stickslip.motion.steps.contacts import directions_of
from stickslip.motion.steps.sets import whole_rate, width_of
from stickslip.numerics.levels import NEW_DIRECTION, ROUNDING
from stickslip.translator import compiled

# Rows of Space.aims for each plane: the direction (two rows), ρ, the right-hand side (two rows),
# what is solved for (two rows), the order p, what else is kept for a while, and what of the
# velocity is not in Z V (two rows); then the direction and the right-hand side of the third part
# of a face (:mod:`stickslip.motion.steps.face_onset`), and both half axes, in columns 0 and 1, with
# 1 in column 2 if there are any.
N_, M_, RHO, BX, BY, X, Y, LEADING, SPARE, OX, OY, L_, BZ, AXES = range(14)
_ANSWERED = 1e-10  # response relative to the largest above which it is more than a rounding error


@compiled(brief=True)
def is_face(rows: Rows, p: int) -> bool:
    """Whether a contact in a plane is a face, which has three directions."""
    return width_of(rows, p) > 2


@compiled(brief=True)
def begins_in(flow: Flow, p: int) -> bool:
    """Whether a contact in a plane is one of those that begin to slip together."""
    return bool(flow.space.aims[AIMS * p + LEADING, 0] >= 0.0)


@compiled(brief=True)
def begins_flat(flow: Flow, p: int) -> bool:
    """Whether one of the contacts has two directions, so that its slip is given by an angle."""
    return begins_in(flow, p) and not is_face(flow.rows, p)


@compiled(brief=True)
def begins_as_face(flow: Flow, p: int) -> bool:
    """Whether one of them has three."""
    return begins_in(flow, p) and is_face(flow.rows, p)


@compiled(brief=True)
def aim_row(i: int) -> int:
    """The row of Space.aims of a component of the direction."""
    return N_ + i if i < 2 else L_


@compiled(brief=True)
def rate_row(i: int) -> int:
    """The row of Space.aims of a component of the rate due to lower orders."""
    return BX + i if i < 2 else BZ


@compiled()
def place_aims(flow: Flow, table: Array, order: int) -> None:
    """Write the known directions and speeds to a table."""
    rows = flow.rows
    aims = flow.space.aims
    for p in range(len(rows.planes)):
        if not begins_in(flow, p):
            continue
        for i in range(width_of(rows, p)):
            to = table[rows.planes[p, AIM] + i]
            row = aims[AIMS * p + aim_row(i)]
            for k in range(table.shape[1]):
                to[k] = row[k] if k < aims.shape[1] else 0.0
    place_speeds(flow, table, order)


@compiled()
def place_speeds(flow: Flow, table: Array, order: int) -> None:
    """Write the known orders of |Au| = tᵖ ρ to a table."""
    rows = flow.rows
    aims = flow.space.aims
    for p in range(len(rows.planes)):
        leading = int(aims[AIMS * p + LEADING, 0])
        if leading < 0:
            continue
        row = rows.planes[p, AIM_SPEED]
        for k in range(table.shape[1]):
            known = 0 < leading <= k
            table[row, k] = aims[AIMS * p + RHO, k - leading] if known else 0.0


@compiled()
def note_axis(flow: Flow, table: Array, p: int, i: int) -> None:
    """Note a half axis of a contact in a plane, by rates of Au and of u that are not zero."""
    rows = flow.rows
    rate = table[rows.planes[p, AHEAD + i], 1]
    plain = table[rows.u[directions_of(rows, rows.planes[p, LEAD])[i]], 1]
    if plain != 0.0 and rate != 0.0:
        flow.space.aims[AIMS * p + AXES, i] = rate / plain


@compiled()
def respond(machine: Machine, flow: Flow, at: Instant, table: Array) -> int:
    """The value of (Au)₁ without friction, and the contribution of each component of each
    direction.

    Parameters
    ----------
    flow : Flow
        Receives the response in its work space, (Au)₁ in place of the right-hand sides of order 0.
    table : array
        Work space.
    """
    rows = flow.rows
    aims = flow.space.aims
    answer = flow.space.answer
    planes = len(rows.planes)
    for r in range(len(aims)):
        if r % AIMS != LEADING:
            for k in range(aims.shape[1]):
                aims[r, k] = 0.0
        if r % AIMS == AXES:
            aims[r, 0] = aims[r, 1] = 1.0
            aims[r, 2] = float(rows.planes[r // AIMS, HAS_AXES])
    for p in rows.formula_planes:
        aims[AIMS * p + N_, 0] = 1.0  # a gradient has no value at 0
    for probe in range(-1, 2 * planes):
        if probe >= 0 and not begins_flat(flow, probe // 2):
            continue
        row = AIMS * (probe // 2) + N_ + probe % 2
        before = aims[row, 0] if probe >= 0 else 0.0
        if probe >= 0:
            aims[row, 0] = 1.0
        place_aims(flow, table, FEWEST_ORDERS)
        status = plain_coefficients(machine, flow, at, FEWEST_ORDERS, table)
        if status != OK:
            return status
        for p in range(planes):
            for i in range(2):
                rate = table[rows.planes[p, AHEAD + i], 1]
                if aims[AIMS * p + AXES, 2] > 0.0:
                    note_axis(flow, table, p, i)
                if probe < 0:
                    aims[AIMS * p + BX + i, 0] = rate
                else:
                    answer[2 * p + i, probe] = rate - aims[AIMS * p + BX + i, 0]
        if probe >= 0:
            aims[row, 0] = before
    return OK


@compiled()
def begins_bent(flow: Flow, p: int) -> bool:
    """Whether a slip begins that changes the normal force which presses it."""
    return bool(begins_flat(flow, p) and flow.rows.planes[p, BENDS] == 1)


@compiled()
def any_bends(flow: Flow) -> bool:
    """Whether there is such a slip."""
    found = False
    for p in range(len(flow.rows.planes)):
        found = found or begins_bent(flow, p)
    return found


@compiled()
def respond_at(machine: Machine, flow: Flow, at: Instant, table: Array, slopes: bool) -> int:
    """The rate of Au at the directions that are known, as b + Â n.

    Parameters
    ----------
    flow : Flow
        With directions, whose orders above 0 are 0; receives b and Â in its work space.
    table : array
        Work space.
    slopes : bool
        Whether Â becomes the derivative there; otherwise it stays, and b alone is new.
    """
    rows = flow.rows
    aims, answer = flow.space.aims, flow.space.answer
    planes = len(rows.planes)
    for probe in range(-1, 2 * planes if slopes else 0):
        row = AIMS * (probe // 2) + N_ + probe % 2
        if probe >= 0 and not begins_flat(flow, probe // 2):
            continue
        # Order 1 of a direction changes order 2 of Au, so one evaluation gives a column of Â.
        if probe >= 0:
            aims[row, 1] = 1.0
        place_aims(flow, table, FEWEST_ORDERS)
        status = plain_coefficients(machine, flow, at, FEWEST_ORDERS, table)
        if probe >= 0:
            aims[row, 1] = 0.0
        if status != OK:
            return status
        for i in range(2 * planes):
            ahead = rows.planes[i // 2, AHEAD + i % 2]
            base = AIMS * (i // 2) + BX + i % 2
            if probe < 0:
                aims[base, 0], aims[base, 1] = table[ahead, 1], 2.0 * table[ahead, 2]
            else:
                answer[i, probe] = 2.0 * table[ahead, 2] - aims[base, 1]
    for i in range(2 * planes):
        for j in range(2 * planes):
            if begins_flat(flow, j // 2):
                base = AIMS * (i // 2) + BX + i % 2
                aims[base, 0] -= answer[i, j] * aims[AIMS * (j // 2) + N_ + j % 2, 0]
    return OK


@compiled(brief=True)
def span_rates(flow: Flow) -> int:
    """An orthonormal basis, as rows, of the possible velocities of a body, from the responses to
    directions; returns its rank."""
    rows = flow.rows
    answer, span = flow.space.answer, flow.space.span
    n = 2 * len(rows.planes)
    largest = 0.0
    for j in range(n):
        for i in range(n if begins_in(flow, j // 2) else 0):
            largest = max(largest, abs(answer[i, j]))
    rank = 0
    for j in range(n):
        if not begins_in(flow, j // 2):
            continue
        size = 0.0
        for i in range(n):
            span[rank, i] = answer[i, j] if begins_in(flow, i // 2) else 0.0
            size = max(size, abs(span[rank, i]))
        # The response in a direction in which the body cannot move is a rounding error.
        if size > _ANSWERED * largest and is_new(n, span, rank, NEW_DIRECTION):
            rank += 1
    return rank


@compiled(brief=True)
def speed_along(flow: Flow, rank: int, way: Array, i: int) -> float:
    """Component i of Z V."""
    found = 0.0
    for r in range(rank):
        found += flow.space.span[r, i] * way[r]
    return found


@compiled(brief=True)
def part_in_span(flow: Flow, rank: int, row: int, m: int, out: Array) -> None:
    """Zᵀ of order m of a pair of rows of the directions, of all slips that begin.

    Parameters
    ----------
    rank : int
        Number of vectors of Z.
    row, m : int
        The first row, and the order.
    out : array
        Receives the result.
    """
    aims = flow.space.aims
    for r in range(rank):
        out[r] = 0.0
        for i in range(2 * len(flow.rows.planes)):
            if begins_in(flow, i // 2):
                out[r] += flow.space.span[r, i] * aims[AIMS * (i // 2) + row + i % 2, m]


@compiled(brief=True)
def answer_to(flow: Flow, rank: int, row: int, m: int, factor: float, out: Array) -> None:
    """Add a multiple of ZᵀÂ of order m of a pair of rows of the directions.

    Parameters
    ----------
    rank : int
        Number of vectors of Z.
    row, m : int
        The first row, and the order.
    out : array
        Is added to.
    """
    aims, answer, span = flow.space.aims, flow.space.answer, flow.space.span
    n = 2 * len(flow.rows.planes)
    for j in range(n):
        if not begins_in(flow, j // 2):
            continue
        x = factor * aims[AIMS * (j // 2) + row + j % 2, m]
        for i in range(n if x != 0.0 else 0):
            if begins_in(flow, i // 2):
                for r in range(rank):
                    out[r] += span[r, i] * answer[i, j] * x


@compiled(brief=True)
def lost_order(flow: Flow, table: Array) -> float:
    """Rounding errors of an order of Au due to those of forces, for contacts that begin to slip:
    smaller values count as zero.

    Parameters
    ----------
    table : array
        Coefficients, with their unit of time.
    """
    rows = flow.rows
    size = 0.0
    for p in range(len(rows.planes)):
        if begins_in(flow, p):
            size = max(size, whole_rate(rows, flow.space.mag, rows.planes[p, LEAD]))
    return float(ROUNDING * size * table[rows.sizes[DIMENSION], 1])
