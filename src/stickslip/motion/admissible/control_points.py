"""Control points of forces and radii of contacts that share forces, on a step and on its pieces."""

from __future__ import annotations

from stickslip.arrays import Array
from stickslip.motion.admissible.overload import GIVEN_FORCES, RADIUS, SCRATCH, STEP
from stickslip.motion.admissible.sharing import held_at, sticks_in
from stickslip.motion.algebra.roots import lowest
from stickslip.motion.steps.arrays import ON_INERTIAL, Flow
from stickslip.motion.steps.contacts import directions_of, inertial_contacts
from stickslip.motion.steps.sets import given_force, holds_all, radius_at
from stickslip.translator import compiled

# Maximum number of pieces of a step that are checked, and their minimum length in steps.
MOST_CUTS_OF_A_STEP, LEAST_PIECE = 200, 1e-5


@compiled(brief=True)
def place_polynomials(flow: Flow, mode: Array, group: int) -> bool:
    """Control points of forces and radii on a step; whether the least forces stay inside their sets
    by the sizes of their terms alone.

    Parameters
    ----------
    flow : Flow
        With the coefficients and the powers of the step; receives the control points.
    mode : array of int, shape (contacts,)
    """
    rows = flow.rows
    space = flow.space
    aside, powers, points = space.aside, space.powers, space.points
    nc = rows.sizes[ON_INERTIAL]
    N = flow.order
    inside = True
    for c in inertial_contacts(rows):
        if not sticks_in(rows, mode, c, group):
            continue
        for i in directions_of(rows, c):
            for k in range(N):
                aside[SCRATCH, k] = held_at(flow, space.W, i, k) * powers[k]
            lowest(aside[SCRATCH], N - 1, points[i], aside[STEP])
            aside[GIVEN_FORCES, i] = 0.0
            for k in range(N):
                aside[GIVEN_FORCES, i] = max(aside[GIVEN_FORCES, i], abs(points[i, k]))
        for k in range(N):
            aside[SCRATCH, k] = radius_at(rows, space.W, c, k) * powers[k]
        aside[RADIUS, c] = lowest(aside[SCRATCH], N - 1, points[nc + c], aside[STEP])
        a, b = given_force(flow, c, aside[GIVEN_FORCES])
        inside = inside and holds_all(flow, c, aside[RADIUS, c], a, b)
    return inside


@compiled(brief=True)
def place_piece(flow: Flow, mode: Array, group: int, d: int, a: float, b: float) -> None:
    """Control points on [a, b] from those of the whole step.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    group, d : int
        The contacts, and the degree.
    """
    rows = flow.rows
    points, piece = flow.space.points, flow.space.piece
    nc = rows.sizes[ON_INERTIAL]
    for c in inertial_contacts(rows):
        if sticks_in(rows, mode, c, group):
            for i in directions_of(rows, c):
                cut_out(points, piece, i, d, a, b)
            cut_out(points, piece, nc + c, d, a, b)


@compiled(brief=True)
def place_point(flow: Flow, mode: Array, group: int, table: Array, i: int) -> None:
    """Put control point i of forces and radii into the work space.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    table : array
        Control points of forces, then of radii.
    """
    rows = flow.rows
    aside = flow.space.aside
    nc = rows.sizes[ON_INERTIAL]
    for c in range(nc):
        if sticks_in(rows, mode, c, group):
            aside[GIVEN_FORCES, c] = table[c, i]
            aside[RADIUS, c] = max(table[nc + c, i], 0.0)


@compiled(brief=True)
def cut_out(source: Array, target: Array, row: int, d: int, a: float, b: float) -> None:
    """Control points of a polynomial on [a, b], from those on [0, 1] (de Casteljau).

    Parameters
    ----------
    row, d : int
        The row of the polynomial in both, and its degree.
    """
    points = target[row]
    for i in range(d + 1):
        points[i] = source[row, i]
    for i in range(d):
        for j in range(d, i, -1):
            points[j] = (1.0 - b) * points[j - 1] + b * points[j]
    share = a / b if b > 0.0 else 0.0
    for i in range(d):
        for j in range(d - i):
            points[j] = (1.0 - share) * points[j] + share * points[j + 1]
