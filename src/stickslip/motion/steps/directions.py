"""Directions of slips in a plane in compiled code.

In a step a direction is a polynomial, as the state is. It is given to the tape, or taken from its
rows; where it is right on the whole step, its disc is that of the polynomial, and nothing is
divided by a speed that may have zeros close by for complex times.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.algebra.roots import horner
from stickslip.motion.discs.spreading import is_given, reach
from stickslip.motion.discs.tables import SLOPE, store
from stickslip.motion.steps.arrays import (
    AHEAD,
    AIM,
    AIM_SPEED,
    AU_IS_LINEAR,
    COORDINATES,
    INERTIAL,
    LEAD,
    MEMBERS,
    PART,
    Flow,
    Rows,
)
from stickslip.motion.steps.contacts import directions_of, set_mode
from stickslip.motion.steps.sets import axis_of, slip_speed, width_of
from stickslip.numerics.levels import ROUNDED_TERM
from stickslip.symbolic.tape import DIRECTION_GIVEN
from stickslip.translator import compiled


@compiled()
def give_directions(rows: Rows, mode: Array, given: bool) -> None:
    """Fix the directions of slips in a plane, or let the state determine them again.

    So nothing is divided by a speed: an audit has the direction of a step as one more candidate,
    and asks whether it is that of the velocity.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
        Is changed.
    """
    for p in range(len(rows.planes)):
        c = rows.planes[p, LEAD]
        if mode[c] != 0:
            set_mode(rows, mode, c, DIRECTION_GIVEN if given else 1)


@compiled()
def take_directions(rows: Rows, W: Array, N: int, x: float, V: Array) -> None:
    """Put the directions that polynomials have at a place into a table.

    Parameters
    ----------
    W : array
        The polynomials.
    N : int
        Order of those of the state.
    x : float
        The place, in the unit of their time.
    V : array
        Receives them.
    """
    for p in range(len(rows.planes)):
        take_direction(rows, p, W, N, x, V)


@compiled()
def take_direction(rows: Rows, p: int, W: Array, N: int, x: float, V: Array) -> None:
    """Put the direction of one slip into a table.

    Parameters
    ----------
    p : int
        The plane.
    W, N, x, V
        As in :func:`take_directions`.
    """
    for row in range(rows.planes[p, AIM], rows.planes[p, AIM_SPEED] + 1):
        V[row, 0] = horner(W[row], N - 1, x)


@compiled()
def follow_directions(
    rows: Rows, mode: Array, W: Array, N: int, x: float, tol: float, discs: Array
) -> bool:
    """Note the slips in a plane whose directions are those that their polynomials show; whether
    there are any.

    On [0, x] a polynomial P is the direction of Au if P × Au = 0 and P·P = 1. Orders below N vanish
    since P is made that way; if the others are negligible, it does not matter what u/|u| does for
    complex times. So one step leads to the end of a slip, however close its zero is, once the
    direction no longer turns by a power of the time that is left.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    W : array, shape (rows, N + 1)
        Taylor coefficients.
    N : int
        Their order.
    x : float
        The step, in the unit of time of the coefficients.
    tol : float
        Part of the speed that is negligible.
    discs : array, shape (rows, 4)
        Receives 1 for a direction that is right, else 0, in place of a slope.
    """
    found = False
    for p in range(len(rows.planes)):
        plane = rows.planes[p]
        aim = plane[AIM]
        parts = width_of(rows, p)
        speed = slip_speed(rows, mode, W, p)
        across, longer = 0.0, 0.0
        power = x**N
        # Without mass Au follows from the direction and does not determine it.
        asked = speed > 0.0
        for k in range(N, 2 * N - 1 if asked else 0):
            length = 0.0
            for i in range(parts):
                for other in range(i):
                    turned = 0.0
                    a, b = W[plane[AHEAD + other]], W[plane[AHEAD + i]]
                    for j in range(k - N + 1, N):
                        turned += W[aim + other, j] * b[k - j] - W[aim + i, j] * a[k - j]
                    across += abs(turned) * power
                for j in range(k - N + 1, N):
                    length += W[aim + i, j] * W[aim + i, k - j]
            longer += abs(length) * power
            power *= x
        right = asked and across <= tol * speed and longer <= tol
        discs[plane[AIM], SLOPE] = 1.0 if right else 0.0
        found = found or right
    return found


@compiled()
def discard_directions(rows: Rows, discs: Array) -> None:
    """Undo :func:`follow_directions`."""
    for p in range(len(rows.planes)):
        discs[rows.planes[p, AIM], SLOPE] = 0.0


@compiled()
def spread_given(flow: Flow, mode: Array, N: int) -> None:
    """Discs of the directions of slips that are polynomials, as :func:`spread_state` makes them;
    and, if Au is a polynomial, bounds of its deviation along and across its direction.

    Parameters
    ----------
    flow : Flow
        With Taylor coefficients, and the powers of the radius; receives the discs.
    mode : array of int, shape (contacts,)
    N : int
        Order of the coefficients.
    """
    rows, W, discs, powers = flow.rows, flow.space.W, flow.space.discs, flow.space.reaches
    for p in range(len(rows.planes)):
        first = rows.planes[p, AIM]
        speed = rows.planes[p, AIM_SPEED]
        if is_given(W, discs, first, speed, int(mode[rows.planes[p, LEAD]])):
            for row in range(first, speed + 1):
                store(W, discs, row, reach(W[row], N - 1, powers), 0.0, 0.0)
        discs[speed, SLOPE] = -1.0
        if rows.planes[p, AU_IS_LINEAR] == 1 and W[speed, 0] > 0.0:
            spread_straight(flow, p, N)


@compiled()
def spread_straight(flow: Flow, p: int, N: int) -> None:
    """Deviation of Au of a slip along its direction, and perpendicular to it, in place of two
    slopes.

    Parameters
    ----------
    flow : Flow
        As in :func:`spread_given`.
    p, N : int
        The plane, and the order of the coefficients.
    """
    rows, W, discs, powers = flow.rows, flow.space.W, flow.space.discs, flow.space.reaches
    plane = rows.planes[p]
    block = directions_of(rows, plane[LEAD])
    along, across = 0.0, 0.0
    for k in range(1, N + 1):
        inwards, square = 0.0, 0.0
        for i in range(width_of(rows, p)):
            c = block[i]
            part = rows.parts[rows.homes[c, PART]]
            axis = axis_of(flow, c)
            moved = 0.0
            for j in range(part[COORDINATES]):
                q = rows.sizes[INERTIAL] + rows.members[part[MEMBERS] + j]
                moved += axis * flow.k.J[c, j] * (W[q, k] * powers[k])
            inwards += moved * W[plane[AIM] + i, 0]
            square += moved * moved
        along += abs(inwards)
        # including the rounding errors of the perpendicular part
        across += math.sqrt(max(square - inwards * inwards, ROUNDED_TERM * square))
    discs[plane[AIM_SPEED], SLOPE] = across
    discs[plane[AIM] + 1, SLOPE] = along
