"""Contacts as blocks of directions, with the sizes of their quantities, and sets of forces.

A contact is a block of directions: one along a line, two in a plane, three of a face. It is named
by the first of them, and what is asked of a contact is asked of that; `Rows.contacts` lists these,
:func:`.directions_of` has all directions of one. What differs from kind to kind is asked here:
what slips along a direction of its own, which rows have the radius, where the middle is.

A contact holds the forces m + s K: m is a middle of the set, s its radius, and K an interval, a
disc, or what a formula R makes of the forces −∂R(0), of which a function of the system tells the
support function S(w) = max {f·w : f ∈ K} with its derivatives. The functions here say what is asked
of K: how far forces are outside, and how S is rounded off at 0, √(1 + S²), so that its gradients
fill K.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.algebra.vectors import direction_and_turn
from stickslip.motion.steps.arrays import (
    AHEAD,
    AIM_SPEED,
    AU_SIZE,
    LEAD,
    MASSIVE,
    ON_INERTIAL,
    ON_VISCOUS,
    WIDEST,
    Flow,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import directions_of, is_loose, own_directions
from stickslip.numerics.levels import LAST_DIGITS, ROUNDING
from stickslip.translator import compiled

# Rows of Space.along: the unit vector at which support functions are evaluated, how a mechanism
# moves a contact, and a force inside its set.
_UNIT, MOVED, _INNER = range(3)
# For each formula, columns of Space.supported: S, its first and second derivatives (xx, xy, xz, yy,
# yz, zz), and the middle.
_VALUE, _X, _Y, _Z, _XX, _XY, _XZ, _YY, _YZ, _ZZ, _MIDDLE = range(11)
PER_FORMULA = 13
_ANGLES = 32  # number of directions in which the forces of a formula are compared with S
_MOST_TURNS = 32  # largest number of Newton iterations between these directions
_HALVINGS = 50  # number of bisections of the segment into a set
_ANGLE_KNOWN = 1e-9  # fraction of an arc within which its nearest point is known


@compiled()
def plane_of(rows: Rows, c: int) -> Array:
    """The rows of a contact in a plane, by one of its directions."""
    return rows.planes[rows.plane[c]]


@compiled(brief=True)
def slips_with_mass(rows: Rows, mode: Array, p: int) -> bool:
    """Whether a contact in a plane slips, moves masses and is pressed: then its friction has the
    direction of its velocity."""
    c = rows.planes[p, LEAD]
    slips = rows.planes[p, MASSIVE] == 1 and 1 <= mode[c] <= 2
    return bool(slips and not is_loose(rows, mode, c))


@compiled(brief=True)
def length_at(rows: Rows, plane: Array, table: Array, k: int) -> float:
    """The length of order k of Au, over all directions of a contact."""
    size = 0.0
    for i in range(len(directions_of(rows, plane[LEAD]))):
        size = math.hypot(size, table[plane[AHEAD + i], k])
    return size


@compiled(brief=True)
def is_at_rest(rows: Rows, table: Array, c: int, loosely: float) -> bool:
    """Whether a contact in a plane does not move, up to rounding; not asked of one along a line.

    The tape of a mode asks the same where it makes a direction: what does not move begins to slip
    there, so it has to be able to stick first.

    Parameters
    ----------
    table : array
        Values of the rows.
    loosely : float
        Factor of the rounding errors.
    """
    if rows.plane[c] < 0:
        return False
    plane = plane_of(rows, c)
    return length_at(rows, plane, table, 0) <= loosely * ROUNDING * table[plane[AU_SIZE], 0]


@compiled()
def slides_in_plane(rows: Rows, mode: Array) -> bool:
    """Whether a contact in a plane slips that moves masses and is pressed."""
    found = False
    for p in range(len(rows.planes)):
        found = found or slips_with_mass(rows, mode, p)
    return found


@compiled()
def slip_speed(rows: Rows, mode: Array, W: Array, p: int) -> float:
    """The speed of a slip in a plane that moves masses, |Au|; 0 where there is none."""
    slips = rows.planes[p, MASSIVE] == 1 and mode[rows.planes[p, LEAD]] != 0
    return float(W[rows.planes[p, AIM_SPEED], 0] if slips else 0.0)


@compiled()
def crosses_pieces(rows: Rows, mode: Array) -> bool:
    """Whether a contact slips whose dissipation has pieces. An edge between them may be a
    singularity that a motion passes in no time, such as that of a face with a point at rest."""
    found = False
    for piece in rows.pieces:
        found = found or mode[rows.planes[piece[1], LEAD]] != 0
    return found


@compiled()
def width_of(rows: Rows, p: int) -> int:
    """The number of directions of a contact in a plane: one of two numbers, so that loops over them
    can be unrolled."""
    return 2 if len(directions_of(rows, rows.planes[p, LEAD])) == 2 else 3


@compiled()
def second_of(rows: Rows, c: int) -> int:
    """The second direction of a contact in a plane, by its first one."""
    return int(rows.directions[rows.first_direction[c] + 1])


@compiled()
def is_rate_independent(rows: Rows, c: int) -> bool:
    """Whether a contact moves coordinates that have neither mass nor viscosity."""
    return bool(c >= rows.sizes[ON_INERTIAL] + rows.sizes[ON_VISCOUS])


@compiled()
def rate_terms(rows: Rows, mag: Array, c: int) -> float:
    """The size of the terms of the rate of a relative velocity; that of the velocity is mag[c]."""
    return float(mag[len(rows.u) + c])


@compiled()
def force_terms(rows: Rows, mag: Array, c: int) -> float:
    """The size of the terms of a force."""
    return float(mag[2 * len(rows.u) + c])


@compiled()
def kink_terms(rows: Rows, mag: Array, j: int) -> float:
    """The size of the terms of the guard of a kink."""
    return float(mag[3 * len(rows.u) + j])


@compiled()
def gap_terms(rows: Rows, mag: Array, c: int) -> float:
    """The size of the terms of a gap."""
    return float(mag[3 * len(rows.u) + len(rows.kinks) + c])


@compiled(brief=True)
def parts_at(block: Array, table: Array, column: int) -> tuple[float, float, float]:
    """Entries of a column of a table for the directions of a contact; 0 for missing directions."""
    x = float(table[block[0], column])
    y = float(table[block[1], column]) if len(block) > 1 else 0.0
    z = float(table[block[2], column]) if len(block) > 2 else 0.0
    return x, y, z


@compiled(brief=True)
def given_force(flow: Flow, c: int, forces: Array) -> tuple[float, float]:
    """Entries of a row of the work space for the first two directions of a contact; along a line,
    the second is 0. Not used for faces, which have three."""
    block = directions_of(flow.rows, c)
    return float(forces[c]), float(forces[block[1]]) if len(block) > 1 else 0.0


@compiled(brief=True)
def whole_speed(rows: Rows, mag: Array, c: int) -> float:
    """The sum of the sizes of the relative velocities in all directions of a contact."""
    size = 0.0
    for i in directions_of(rows, c):
        size += mag[i]
    return float(size)


@compiled(brief=True)
def whole_rate(rows: Rows, mag: Array, c: int) -> float:
    """The same of their rates."""
    size = 0.0
    for i in directions_of(rows, c):
        size += rate_terms(rows, mag, i)
    return size


@compiled()
def gap_size(rows: Rows, space: Space, c: int) -> float:
    """Scale of the rounding errors of a gap: its terms, and its largest value so far, which limits
    the accuracy of the position."""
    return max(gap_terms(rows, space.mag, c), float(space.impact[WIDEST, c]))


@compiled(brief=True)
def store_gap_sizes(rows: Rows, space: Space, seen: Array) -> None:
    """Store the largest gaps of a motion, from the sizes of the rows that bound its steps."""
    for c in rows.openings:
        for i in range(len(rows.watched)):
            if rows.watched[i] == rows.gaps[c]:
                space.impact[WIDEST, c] = seen[i]


@compiled()
def may_share(rows: Rows, a: int, b: int) -> bool:
    """Whether two contacts may share forces."""
    return bool(rows.group[a] >= 0 and rows.group[a] == rows.group[b])


@compiled(brief=True)
def formula_of(rows: Rows, c: int) -> int:
    """The number of the formula of a contact; negative for others."""
    return int(rows.formula[c])


@compiled(brief=True)
def axis_of(flow: Flow, c: int) -> float:
    """The axis of a direction, by which its force is measured; 1 for contacts along a line."""
    return float(flow.k.J[c, flow.k.J.shape[1] - 3] if flow.rows.group[c] >= 0 else 1.0)


@compiled(brief=True)
def radius_row(rows: Rows, c: int) -> int:
    """The row of the radius of the set of forces of a contact; on a line, where slip forward and
    back have thresholds of their own, that of the first."""
    return int(rows.radii[c, 0])


@compiled(brief=True)
def radius_at(rows: Rows, table: Array, c: int, k: int) -> float:
    """Order k of the radius of the set of forces of a contact."""
    return float(0.5 * (table[rows.radii[c, 0], k] + table[rows.radii[c, 1], k]))


@compiled(brief=True)
def middle_at(flow: Flow, table: Array, c: int, k: int) -> float:
    """Order k of the middle of the set of forces of a contact, along one of its directions."""
    rows = flow.rows
    if formula_of(rows, c) >= 0:
        return radius_at(rows, table, c, k) * middle_of(flow, c)
    return float(0.5 * (table[rows.radii[c, 1], k] - table[rows.radii[c, 0], k]))


@compiled(brief=True)
def find_support(flow: Flow, f: int, x: float, y: float, z: float) -> int:
    """Put S of a formula at a vector into the work space; where, it is there.

    Parameters
    ----------
    f : int
        Number of the formula.
    x, y, z : float
        The vector.
    """
    along = flow.space.along[_UNIT]
    out = flow.space.supported
    # At a unit vector nothing overflows.
    length = math.sqrt(x * x + y * y + z * z)
    along[0], along[1], along[2] = x / length, y / length, z / length
    flow.supports(along, flow.k.K, out)
    at = PER_FORMULA * f
    out[at] *= length
    for i in range(_XX, _MIDDLE):
        out[at + i] /= length
    return at


@compiled(brief=True)
def middle_of(flow: Flow, c: int) -> float:
    """The middle of the set of a contact that has a formula, for radius 1, along a direction."""
    at = find_support(flow, formula_of(flow.rows, c), 1.0, 0.0, 0.0)
    block = own_directions(flow.rows, c)
    side = 0
    for i in range(len(block)):
        side = i if block[i] == c else side
    return float(flow.space.supported[at + _MIDDLE + side])


@compiled(brief=True)
def dissipation_at(flow: Flow, f: int, x: float, y: float, z: float) -> float:
    """R of a formula at a velocity. Its second derivatives are those of S at the opposite one,
    which are left in the work space, and so are its first ones (:func:`slope_at`).

    Parameters
    ----------
    f : int
        Number of the formula.
    x, y, z : float
        The velocity.
    """
    at = find_support(flow, f, -x, -y, -z)
    out = flow.space.supported
    middle = out[at + _MIDDLE] * x + out[at + _MIDDLE + 1] * y + out[at + _MIDDLE + 2] * z
    return float(out[at] - middle)


@compiled(brief=True)
def slope_at(flow: Flow, f: int, i: int) -> float:
    """A first derivative of R where :func:`dissipation_at` has looked at it."""
    at = PER_FORMULA * f
    return float(-flow.space.supported[at + _X + i] - flow.space.supported[at + _MIDDLE + i])


@compiled(brief=True)
def bend_at(flow: Flow, f: int, i: int, j: int) -> float:
    """A second derivative of R where :func:`dissipation_at` has looked at it."""
    low, high = min(i, j), max(i, j)
    place = high if low == 0 else (low + high + 1 if low == 1 else 5)
    return float(flow.space.supported[PER_FORMULA * f + _XX + place])


@compiled(brief=True)
def support_at(flow: Flow, c: int, w: Array) -> float:
    """S of a contact.

    Parameters
    ----------
    c : int
        The contact, by its first direction.
    w : array, shape (3,)
        Where S is wanted.
    """
    f = formula_of(flow.rows, c)
    if f < 0 or (w[0] == 0.0 and w[1] == 0.0 and w[2] == 0.0):
        return math.hypot(w[0], w[1])
    at = find_support(flow, f, w[0], w[1], w[2])
    return float(flow.space.supported[at])


@compiled(brief=True)
def inner_force(flow: Flow, c: int, radius: float, w: Array) -> Array:
    """A force inside the set of a contact, the gradient of s √(1 + S²), in the work space.

    Parameters
    ----------
    c : int
        The contact, by its first direction.
    radius : float
        Of the set.
    w : array, shape (3,)
        Where the gradient is wanted.
    """
    force = flow.space.along[_INNER]
    out = flow.space.supported
    f = formula_of(flow.rows, c)
    rests = w[0] == 0.0 and w[1] == 0.0 and w[2] == 0.0
    if f < 0:
        share = radius / math.sqrt(1.0 + w[0] * w[0] + w[1] * w[1])
        force[0], force[1], force[2] = share * w[0], share * w[1], 0.0
    elif rests:
        force[0] = force[1] = force[2] = 0.0
    else:
        at = find_support(flow, f, w[0], w[1], w[2])
        S = out[at]
        share = radius * S / math.sqrt(1.0 + S * S)
        for i in range(3):
            force[i] = share * out[at + _X + i]
    return force


@compiled(brief=True)
def inner_bend(
    flow: Flow, c: int, w: Array
) -> tuple[float, float, float, float, float, float, float]:
    """The second derivatives of √(1 + S²), by xx, yy, xy, xz, yz and zz, times that root, and the
    root.

    Parameters
    ----------
    c : int
        The contact, by its first direction.
    w : array, shape (3,)
        Where they are wanted.
    """
    f = formula_of(flow.rows, c)
    if f < 0:
        _, _, xx, yy, xy, root = direction_and_turn(w[0], w[1], 1.0)
        return xx, yy, xy, 0.0, 0.0, 0.0, root
    if w[0] != 0.0 or w[1] != 0.0 or w[2] != 0.0:
        return inner_bend_along(flow, f, w[0], w[1], w[2], 0.0)
    # S² has second derivatives at 0 along each way only: something between them.
    a, b, d, e, g, h, _ = inner_bend_along(flow, f, 1.0, 0.0, 0.0, 1.0)
    i, j, k, m, n, o, _ = inner_bend_along(flow, f, 0.0, 1.0, 0.0, 1.0)
    a, b, d, e, g, h = a + i, b + j, d + k, e + m, g + n, h + o
    if len(directions_of(flow.rows, c)) > 2:
        i, j, k, m, n, o, _ = inner_bend_along(flow, f, 0.0, 0.0, 1.0, 1.0)
        a, b, d, e, g, h = a + i, b + j, d + k, e + m, g + n, h + o
    return 0.5 * a, 0.5 * b, 0.5 * d, 0.5 * e, 0.5 * g, 0.5 * h, 1.0


@compiled(brief=True)
def inner_bend_along(
    flow: Flow, f: int, x: float, y: float, z: float, small: float
) -> tuple[float, float, float, float, float, float, float]:
    """The same of a formula away from 0.

    Parameters
    ----------
    f : int
        Number of the formula.
    small : float
        1 if a small vector of this direction is meant.
    """
    at = find_support(flow, f, x, y, z)
    out = flow.space.supported
    S = float(out[at])
    square = 1.0 + S * S if small == 0.0 else 1.0
    a, b, d = float(out[at + _X]), float(out[at + _Y]), float(out[at + _Z])
    xx = a * a / square + S * float(out[at + _XX])
    yy = b * b / square + S * float(out[at + _YY])
    zz = d * d / square + S * float(out[at + _ZZ])
    xy = a * b / square + S * float(out[at + _XY])
    xz = a * d / square + S * float(out[at + _XZ])
    yz = b * d / square + S * float(out[at + _YZ])
    return xx, yy, xy, xz, yz, zz, math.sqrt(square)


@compiled(brief=True)
def force_outside(flow: Flow, c: int, radius: float, a: float, b: float) -> float:
    """Distance of a force from the set of a contact: the maximum of f·m − s S(m), |m| = 1; not
    positive inside. For faces outside, infinity is returned instead.

    Parameters
    ----------
    c : int
        The contact, by its first direction.
    radius : float
        Of the set.
    a, b : float
        The force beside the middle.
    """
    f = formula_of(flow.rows, c)
    if f < 0:
        return math.hypot(a, b) - radius
    if len(directions_of(flow.rows, c)) > 2:
        return math.inf
    most = -math.inf
    width = 2.0 * math.pi / _ANGLES
    before = over_at(flow, f, radius, a, b, -width)
    here = over_at(flow, f, radius, a, b, 0.0)
    for k in range(_ANGLES):
        after = over_at(flow, f, radius, a, b, (k + 1) * width)
        if here >= before and here >= after:
            most = max(most, largest_over(flow, f, radius, a, b, k * width, width))
        before, here = here, after
    return most


@compiled(brief=True)
def over_at(flow: Flow, f: int, radius: float, a: float, b: float, angle: float) -> float:
    """f·m − s S(m) of a formula in a direction.

    Parameters
    ----------
    f : int
        Number of the formula.
    radius, a, b : float
        Of the set, and the force.
    """
    x, y = math.cos(angle), math.sin(angle)
    return float(a * x + b * y - radius * flow.space.supported[find_support(flow, f, x, y, 0.0)])


@compiled(brief=True)
def largest_over(
    flow: Flow, f: int, radius: float, a: float, b: float, angle: float, width: float
) -> float:
    """The largest of these values within a width of an angle, by Newton's method, bracketed.

    Parameters
    ----------
    flow, f, radius, a, b
        As in :func:`over_at`.
    """
    low, high = angle - width, angle + width
    most = over_at(flow, f, radius, a, b, angle)
    out = flow.space.supported
    for _ in range(_MOST_TURNS):
        x, y = math.cos(angle), math.sin(angle)
        at = find_support(flow, f, x, y, 0.0)
        over = a * x + b * y - radius * float(out[at])
        most = max(most, over)
        slope = -a * y + b * x - radius * float(out[at + _Y] * x - out[at + _X] * y)
        bend = y * y * out[at + _XX] - 2.0 * x * y * out[at + _XY] + x * x * out[at + _YY]
        second = -over - radius * float(bend)
        if slope > 0.0:
            low = angle
        else:
            high = angle
        after = angle - slope / second if second < 0.0 else 0.5 * (low + high)
        if not low < after < high:
            after = 0.5 * (low + high)
        if abs(after - angle) <= LAST_DIGITS + _ANGLE_KNOWN * width:
            break
        angle = after
    return most


@compiled(brief=True)
def holds_all(flow: Flow, c: int, radius: float, a: float, b: float) -> bool:
    """Whether the set of a contact has all forces up to a size inside.

    Parameters
    ----------
    c : int
        The contact, by its first direction.
    radius : float
        Of the set.
    a, b : float
        The sizes in both directions, beside the middle.
    """
    if formula_of(flow.rows, c) < 0:
        return math.hypot(a, b) < radius
    corners = 0
    for i in range(4):
        x, y = a if i % 2 == 0 else -a, b if i < 2 else -b
        corners += 1 if force_outside(flow, c, radius, x, y) < 0.0 else 0
    return corners == 4


@compiled(brief=True)
def part_to_set(flow: Flow, c: int, radius: float, a: float, b: float, x: float, y: float) -> float:
    """Smallest fraction of the vector (x, y) that moves a force (a, b) into the set of a contact;
    the whole vector does.

    Parameters
    ----------
    c : int
        The contact, by its first direction.
    radius : float
        Of the set.
    a, b, x, y : float
        Beside the middle.
    """
    if formula_of(flow.rows, c) < 0:
        # |(a, b) + part (x, y)| = s: it is outside at 0, and inside at 1
        outside = a * a + b * b - radius**2
        if not outside > 0.0:
            return 0.0
        inwards = -(a * x + b * y)
        root = inwards * inwards - (x * x + y * y) * outside
        below = inwards + math.sqrt(max(root, 0.0))
        # The smaller root, as a quotient that does not cancel.
        return outside / below if below > outside else 1.0
    if not force_outside(flow, c, radius, a, b) > 0.0:
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if force_outside(flow, c, radius, a + middle * x, b + middle * y) > 0.0:
            low = middle
        else:
            high = middle
    return high
