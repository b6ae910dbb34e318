"""What contacts can hold together: a rigid body that rests on several points.

Where more directions stick than there are coordinates, forces are not unique. Rest asks for some
forces inside their sets, discs in a plane and intervals along a line, that have the sum q which
rest needs: q has to be in the convex set K = Σ Gᵀ(set of each), G the directions. That is decided
by a smooth, strictly convex function of what the body might do,

    F(w) = Σ s √(1 + |Gw|²) − q·w,   F′(w) = Σ Gᵀf − q,   f = s Gw/√(1 + |Gw|²).

It has a minimum if and only if q is inside K, and there the f are forces with the sum q, each
inside its set: a proof that the body can rest. If q is outside, F falls for ever, and Newton's
method comes to some w with Σ s |Gw| < q·w: a mechanism against which friction is too weak, and the
proof of that. K is convex, and so is the set of all (q, s) for which q is in it: what holds at the
control points of polynomials, in Bernstein's form, holds along them.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.equations.codegen.series import invert
from stickslip.motion.steps.arrays import (
    COMPONENT,
    COORDINATES,
    INERTIAL,
    MEMBERS,
    NOWHERE,
    ON_INERTIAL,
    OTHER,
    PART,
    STATIC,
    Flow,
    Rows,
    direction_entry,
    is_component,
)
from stickslip.motion.steps.roots import first_crossing, lowest
from stickslip.translator import compiled

# What Space.leaving says of a contact: it stays where those with which it shares forces leave, it
# has a guard of its own, or (±1) it leaves.
STAYS, ON_ITS_OWN = 0, 2
_INDEPENDENT = 1e-13  # square of the part of a direction that is none of the others
_STEADY = 1e-12  # part of its size by which a direction may turn
_FAR = 1e4  # what the body might do, beyond which it is known which contacts do not move
_MOVES = 1e-3  # part of the fastest with which a contact begins to slip, too
_MOST_TURNS = 200  # of Newton's method
_LONGEST = 4.0  # of its steps, in parts of what is reached
_CRUDE = 1e-4  # of what is too much, to which the mechanism is known that begins
_SETTLED = 1e-15  # part of its terms by which forces may fail to have the sum that is asked for
_PROVED = 1e-11  # part of the thresholds that a rest may lack between control points
_MOST_PIECES, _SHORTEST = 200, 1e-5
_MOST_CUTS = 40  # mechanisms that are tried until it is known which one begins
# Rows of Space.aside: what the body might do (w), q, F′, a Newton step, F′ where it leads, forces
# and radii, work space, the guard of the mechanism that begins, and that mechanism.
_WAY, _PULL, _SLOPE, _STEP, _AHEAD, _HELD, _RADIUS, _SPARE, LEAVES, _BEST = range(10)


@compiled()
def is_new(n: int, basis: Array, rank: int, least: float) -> bool:
    """Whether the vector behind an orthonormal basis is no combination of it; if so, it joins.

    Parameters
    ----------
    n : int
        Number of components.
    basis : array
    rank : int
        Number of vectors.
    least : float
        Square of the part of it that has to be new.
    """
    size = 0.0
    for j in range(n):
        size += basis[rank, j] ** 2
    for _ in range(2):
        for r in range(rank):
            dot = 0.0
            for j in range(n):
                dot += basis[rank, j] * basis[r, j]
            for j in range(n):
                basis[rank, j] -= dot * basis[r, j]
    left = 0.0
    for j in range(n):
        left += basis[rank, j] ** 2
    if left <= least * size:
        return False
    for j in range(n):
        basis[rank, j] /= math.sqrt(left)
    return True


@compiled()
def axis_of(flow: Flow, c: int) -> float:
    """The axis of a component of a contact in a plane; of others 1."""
    return float(flow.k.J[c, flow.k.J.shape[1] - 3])


@compiled()
def sticks_in(rows: Rows, mode: Array, c: int, group: int) -> bool:
    """Whether a contact sticks and may share its force with those of a group."""
    return bool(rows.group[c] == group and mode[c] == 0)


@compiled()
def place_direction(flow: Flow, table: Array, c: int, vector: Array) -> None:
    """The direction of a contact, in all inertial coordinates."""
    rows = flow.rows
    part = rows.parts[rows.homes[c, PART]]
    for q in range(rows.sizes[INERTIAL]):
        vector[q] = 0.0
    for j in range(part[COORDINATES]):
        entry = direction_entry(rows, flow.k.J, table, c, j)
        vector[rows.members[part[MEMBERS] + j]] = axis_of(flow, c) * entry


@compiled()
def grip(flow: Flow, mode: Array, table: Array, group: int) -> tuple[int, int]:
    """Directions of what sticks in a group, as rows G over an orthonormal basis: how many they are,
    and how many are independent.

    Parameters
    ----------
    flow : Flow
        Receives them in its work space.
    mode : array of int, shape (contacts,)
    table : array
        Values of the rows.
    group : int
    """
    rows = flow.rows
    basis, grips = flow.space.basis, flow.space.grip
    n = rows.sizes[INERTIAL]
    count = 0
    rank = 0
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group):
            count += 1
            place_direction(flow, table, c, basis[rank])
            if is_new(n, basis, rank, _INDEPENDENT):
                rank += 1
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group):
            place_direction(flow, table, c, basis[n])
            for r in range(rank):
                grips[c, r] = 0.0
                for q in range(n):
                    grips[c, r] += basis[n, q] * basis[r, q]
    return count, rank


@compiled()
def is_gripped(flow: Flow, table: Array, c: int, rank: int) -> bool:
    """Whether the directions of a contact depend on what sticks in its group.

    Parameters
    ----------
    flow : Flow
        With the basis of what sticks.
    table : array
        Values of the rows.
    c : int
        The contact, by its first component.
    rank : int
        Number of vectors of the basis.
    """
    basis = flow.space.basis
    n = flow.rows.sizes[INERTIAL]
    place_direction(flow, table, c, basis[rank])
    if is_new(n, basis, rank, _INDEPENDENT):
        return False
    other = partner(flow.rows, c)
    if other >= 0:
        place_direction(flow, table, other, basis[rank])
    return other < 0 or not is_new(n, basis, rank, _INDEPENDENT)


@compiled()
def turns(flow: Flow, mode: Array, group: int) -> bool:
    """Whether directions of what sticks in a group change within a step."""
    rows = flow.rows
    W = flow.space.W
    for c in range(rows.sizes[ON_INERTIAL]):
        if not sticks_in(rows, mode, c, group):
            continue
        size, change = 0.0, 0.0
        for j in range(rows.parts[rows.homes[c, PART], COORDINATES]):
            size += abs(direction_entry(rows, flow.k.J, W, c, j))
            for k in range(1, flow.order if rows.turning[c, j] >= 0 else 0):
                change += abs(W[rows.turning[c, j], k]) * flow.space.powers[k]
        if not change <= _STEADY * size:
            return True
    return False


@compiled()
def find_shared(flow: Flow, mode: Array, table: Array, lasting: bool) -> None:
    """Note which contacts share their forces with others: they have one guard together.

    Where directions change on the way while they stick, each contact is asked about the least
    forces, which is enough for rest, but not necessary.

    Parameters
    ----------
    flow : Flow
        Its work space has the coefficients, and receives what is noted.
    mode : array of int, shape (contacts,)
    table : array
        Values of the rows.
    lasting : bool
        Whether a step is meant, and not an instant.
    """
    rows = flow.rows
    leaving = flow.space.leaving
    for c in range(len(leaving)):
        leaving[c] = ON_ITS_OWN
    for first in range(rows.sizes[ON_INERTIAL]):
        group = rows.group[first]
        if group < 0 or mode[first] != 0 or leaving[first] != ON_ITS_OWN:
            continue
        if not is_first(rows, mode, first):
            continue
        count, rank = grip(flow, mode, table, group)
        if count > rank and not (lasting and turns(flow, mode, group)):
            for c in range(first, rows.sizes[ON_INERTIAL]):
                if sticks_in(rows, mode, c, group):
                    leaving[c] = STAYS


@compiled()
def is_first(rows: Rows, mode: Array, c: int) -> bool:
    """Whether a contact is the first that sticks in its group."""
    first = True
    for other in range(c):
        first = first and not sticks_in(rows, mode, other, rows.group[c])
    return first


@compiled()
def partner(rows: Rows, c: int) -> int:
    """The other component of a contact in a plane; −1 for others."""
    return int(rows.planes[rows.plane[c], OTHER] if rows.plane[c] >= 0 else NOWHERE)


@compiled()
def held_at(flow: Flow, table: Array, c: int, k: int) -> float:
    """Order k of the force of a sticking contact, beside the middle of its set, in parts of its
    axis."""
    rows = flow.rows
    middle = 0.0
    if rows.plane[c] < 0:
        middle = 0.5 * (table[rows.minus[c], k] - table[rows.plus[c], k])
    return float((table[rows.force[c], k] - middle) / axis_of(flow, c))


@compiled()
def radius_at(rows: Rows, table: Array, c: int, k: int) -> float:
    """Order k of the radius of the set of forces of a contact, by its first component."""
    if rows.plane[c] >= 0:
        return float(table[rows.planes[rows.plane[c], STATIC], k])
    return float(0.5 * (table[rows.plus[c], k] + table[rows.minus[c], k]))


@compiled()
def speed_of(flow: Flow, c: int, rank: int, w: Array) -> tuple[float, float]:
    """Gw of a contact, by its first component: both components of it; the second is 0 on a line."""
    grips = flow.space.grip
    other = partner(flow.rows, c)
    x, y = 0.0, 0.0
    for r in range(rank):
        x += grips[c, r] * w[r]
        if other >= 0:
            y += grips[other, r] * w[r]
    return x, y


@compiled()
def slope_of(
    flow: Flow, mode: Array, group: int, rank: int, w: Array, part: float, slope: Array
) -> None:
    """F′(w), for a part of q.

    Parameters
    ----------
    flow : Flow
        With directions, q and radii in its work space.
    mode : array of int, shape (contacts,)
    group, rank : int
    w : array
    part : float
        Of q.
    slope : array
        Receives F′.
    """
    rows = flow.rows
    space = flow.space
    for r in range(rank):
        slope[r] = -part * space.aside[_PULL, r]
    for c in range(rows.sizes[ON_INERTIAL]):
        if not sticks_in(rows, mode, c, group) or is_component(rows, c):
            continue
        other = partner(rows, c)
        x, y = speed_of(flow, c, rank, w)
        share = space.aside[_RADIUS, c] / math.sqrt(1.0 + x * x + y * y)
        for r in range(rank):
            slope[r] += share * x * space.grip[c, r]
            if other >= 0:
                slope[r] += share * y * space.grip[other, r]


@compiled()
def bend_of(flow: Flow, mode: Array, group: int, rank: int) -> None:
    """F″ at the place that is reached, over the basis that :func:`load_of` leaves.

    Parameters
    ----------
    flow : Flow
        Receives the matrix in its work space.
    mode : array of int, shape (contacts,)
    group, rank : int
    """
    rows = flow.rows
    space = flow.space
    bend, grips, basis = space.bend, space.turned_grip, space.basis
    for c in range(rows.sizes[ON_INERTIAL]):
        for i in range(rank if sticks_in(rows, mode, c, group) else 0):
            grips[c, i] = 0.0
            for r in range(rank):
                grips[c, i] += basis[i, r] * space.grip[c, r]
    for i in range(rank):
        for j in range(rank):
            bend[i, j] = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        if not sticks_in(rows, mode, c, group) or is_component(rows, c):
            continue
        other = partner(rows, c)
        x, y = speed_of(flow, c, rank, space.aside[_WAY])
        size = math.sqrt(1.0 + x * x + y * y)
        radius = space.aside[_RADIUS, c]
        along = radius / size
        # with v = Gw/size, 1 − vvᵀ, whose entries must not cancel where w is large
        x, y = x / size, y / size
        least = 1.0 / (size * size)
        xx, yy, xy = least + y * y, least + x * x, -x * y
        for i in range(rank):
            a = grips[c, i]
            b = grips[other, i] if other >= 0 else 0.0
            for j in range(rank):
                d = grips[c, j]
                e = grips[other, j] if other >= 0 else 0.0
                bend[i, j] += along * (xx * a * d + xy * (a * e + b * d) + yy * b * e)


@compiled()
def fastest_of(flow: Flow, mode: Array, group: int, rank: int, w: Array) -> float:
    """The speed of the contact that a mechanism moves most.

    Parameters
    ----------
    flow : Flow
    mode : array of int, shape (contacts,)
    group, rank : int
        The contacts, and how many of their directions are independent.
    w : array
        The mechanism.
    """
    rows = flow.rows
    found = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group) and not is_component(rows, c):
            x, y = speed_of(flow, c, rank, w)
            found = max(found, math.hypot(x, y))
    return found


@compiled()
def load_of(flow: Flow, mode: Array, group: int, rank: int) -> float:
    """q·w/Σ s |Gw| for what the body might do; far away, for the mechanism that it tends to, which
    does not move at all the contacts that stay far behind. It is kept.

    Parameters
    ----------
    flow : Flow
    mode : array of int, shape (contacts,)
    group, rank : int
    """
    rows = flow.rows
    space = flow.space
    aside, basis = space.aside, space.basis
    best = aside[_BEST]
    fastest = fastest_of(flow, mode, group, rank, aside[_WAY])
    for r in range(rank):
        best[r] = aside[_WAY, r]
    held = 0
    for c in range(rows.sizes[ON_INERTIAL] if fastest > _FAR else 0):
        if not sticks_in(rows, mode, c, group):
            continue
        first = rows.planes[rows.plane[c], COMPONENT] if rows.plane[c] >= 0 else c
        x, y = speed_of(flow, first, rank, aside[_WAY])
        if math.hypot(x, y) > _MOVES * fastest or held == rank:
            continue
        for r in range(rank):
            basis[held, r] = space.grip[c, r]
        if is_new(rank, basis, held, _INDEPENDENT):
            held += 1
    for _ in range(2):
        for k in range(held):
            dot = 0.0
            for r in range(rank):
                dot += basis[k, r] * best[r]
            for r in range(rank):
                best[r] -= dot * basis[k, r]
    if not fastest_of(flow, mode, group, rank, best) > 0.5 * fastest:
        for r in range(rank):
            best[r] = aside[_WAY, r]
    work, lost = 0.0, 0.0
    for r in range(rank):
        work += aside[_PULL, r] * best[r]
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group) and not is_component(rows, c):
            x, y = speed_of(flow, c, rank, best)
            lost += aside[_RADIUS, c] * math.hypot(x, y)
    # F″ is smallest along the mechanism, and largest where contacts stay behind.
    for r in range(rank):
        basis[held, r] = best[r]
    if held < rank and is_new(rank, basis, held, 0.0):
        held += 1
    for k in range(rank):
        for r in range(rank if held < rank else 0):
            basis[held, r] = 1.0 if r == k else 0.0
        if held < rank and is_new(rank, basis, held, _INDEPENDENT):
            held += 1
    if lost > 0.0:
        return float(work / lost)
    return math.inf if work > 0.0 else 0.0


@compiled()
def pull(flow: Flow, mode: Array, group: int, rank: int) -> float:
    """The sum q of the forces that rest needs, from forces and radii in the work space; returns the
    size of its terms."""
    rows = flow.rows
    space = flow.space
    size = 0.0
    for r in range(rank):
        space.aside[_PULL, r] = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group):
            size += abs(space.aside[_HELD, c])
            size += 0.0 if is_component(rows, c) else space.aside[_RADIUS, c]
            for r in range(rank):
                space.aside[_PULL, r] += space.grip[c, r] * space.aside[_HELD, c]
    return size


@compiled()
def fits(flow: Flow, mode: Array, group: int, lack: float) -> bool:
    """Whether forces in the work space are in their sets themselves, but for a part of these."""
    rows = flow.rows
    aside = flow.space.aside
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group) and not is_component(rows, c):
            other = partner(rows, c)
            force = math.hypot(aside[_HELD, c], aside[_HELD, other] if other >= 0 else 0.0)
            if not force <= (1.0 + lack) * aside[_RADIUS, c]:
                return False
    return True


@compiled()
def overload(
    flow: Flow, mode: Array, group: int, rank: int, lack: float, full: bool
) -> tuple[float, bool]:
    """By what factor, at least, q is larger than what can be held, which a mechanism proves; and
    whether it is proved that q can be held, but for a part `lack` of it.

    Parameters
    ----------
    flow : Flow
        With directions, and forces and radii in the work space; receives what the body would do in
        the limit, w.
    mode : array of int, shape (contacts,)
    group, rank : int
    lack : float
    full : bool
        Whether the factor is wanted, and the limit, where q is too large; otherwise some mechanism
        and its factor.
    """
    space = flow.space
    aside = space.aside
    way, slope, step, ahead = aside[_WAY], aside[_SLOPE], aside[_STEP], aside[_AHEAD]
    size = pull(flow, mode, group, rank)
    for r in range(rank):
        way[r] = 0.0
    found = 0.0
    for _ in range(_MOST_TURNS):
        found = max(found, load_of(flow, mode, group, rank))
        bend_of(flow, mode, group, rank)
        if (found > 1.0 + lack and not full) or not found < math.inf:
            return found, False
        part = (1.0 - lack) / max(found, 1.0)
        slope_of(flow, mode, group, rank, way, part, slope)
        off = 0.0
        for r in range(rank):
            off = max(off, abs(slope[r]))
        # Far outside, no more is asked of the mechanism.
        enough = max(_SETTLED, _CRUDE * (found - 1.0))
        if off <= enough * size or not invert(space.bend, rank, space.unbent):
            break
        first = descent(flow, rank)
        if not first < 0.0:
            break
        # The slope along the step is to be much less than at its beginning, on either side.
        longest = _LONGEST * (1.0 + fastest_of(flow, mode, group, rank, way))
        longest /= fastest_of(flow, mode, group, rank, step)
        length = min(1.0, longest)
        for _ in range(60):
            for r in range(rank):
                ahead[r] = way[r] + length * step[r]
            slope_of(flow, mode, group, rank, ahead, part, aside[_SPARE])
            there = 0.0
            for r in range(rank):
                there += step[r] * aside[_SPARE, r]
            if there > -0.5 * first:
                length *= 0.5
            elif there < 0.25 * first and 2.0 * length <= longest:
                length *= 2.0
            else:
                break
        moved = False
        for r in range(rank):
            after = way[r] + length * step[r]
            moved = moved or after != way[r]
            way[r] = after
        if not moved:
            break
    part = (1.0 - lack) / max(found, 1.0)
    slope_of(flow, mode, group, rank, way, part, slope)
    off = 0.0
    for r in range(rank):
        off = max(off, abs(slope[r]))
    return found, found <= 1.0 + lack and off <= (0.5 * lack + 16.0 * _SETTLED) * size


@compiled()
def descent(flow: Flow, rank: int) -> float:
    """A step of Newton's method, in the work space; how steep F is along it.

    Parameters
    ----------
    flow : Flow
        With F′, and the inverse of F″ over a basis.
    rank : int
    """
    space = flow.space
    slope, step, basis = space.aside[_SLOPE], space.aside[_STEP], space.basis
    for r in range(rank):
        step[r] = 0.0
    for j in range(rank):
        along = 0.0
        for r in range(rank):
            along += basis[j, r] * slope[r]
        for i in range(rank):
            for r in range(rank):
                step[r] -= basis[i, r] * space.unbent[i, j] * along
    first = 0.0
    for r in range(rank):
        first += step[r] * slope[r]
    return first


@compiled()
def place_held(flow: Flow, mode: Array, table: Array, group: int) -> None:
    """Put the forces and radii that a table has into the work space."""
    rows = flow.rows
    aside = flow.space.aside
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group):
            aside[_HELD, c] = held_at(flow, table, c, 0)
            aside[_RADIUS, c] = max(radius_at(rows, table, c, 0), 0.0)


@compiled()
def place_point(flow: Flow, mode: Array, group: int, table: Array, i: int) -> None:
    """Put control point i of forces and radii into the work space.

    Parameters
    ----------
    flow : Flow
    mode : array of int, shape (contacts,)
    group : int
    table : array
        Control points of forces, then of radii.
    i : int
    """
    rows = flow.rows
    aside = flow.space.aside
    nc = rows.sizes[ON_INERTIAL]
    for c in range(nc):
        if sticks_in(rows, mode, c, group):
            aside[_HELD, c] = table[c, i]
            aside[_RADIUS, c] = max(table[nc + c, i], 0.0)


@compiled()
def can_hold(flow: Flow, mode: Array, group: int, rank: int, lack: float) -> bool:
    """Whether the forces in the work space can be held, but for a part of them.

    Parameters
    ----------
    flow : Flow
    mode : array of int, shape (contacts,)
    group, rank : int
        The contacts, and how many of their directions are independent.
    lack : float
        The part.
    """
    if fits(flow, mode, group, lack):
        return True
    return overload(flow, mode, group, rank, lack, False)[1]


@compiled()
def cut_out(source: Array, target: Array, row: int, d: int, a: float, b: float) -> None:
    """Control points of a polynomial on [a, b], from those on [0, 1] (de Casteljau).

    Parameters
    ----------
    source, target : arrays
    row, d : int
        The row of the polynomial in both, and its degree.
    a, b : float
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


@compiled()
def place_polynomials(flow: Flow, mode: Array, group: int) -> bool:
    """Control points of forces and radii on a step; whether the least forces stay inside their sets
    by the sizes of their terms alone.

    Parameters
    ----------
    flow : Flow
        With the coefficients and the powers of the step; receives the control points.
    mode : array of int, shape (contacts,)
    group : int
    """
    rows = flow.rows
    space = flow.space
    aside, powers, points = space.aside, space.powers, space.points
    nc = rows.sizes[ON_INERTIAL]
    N = flow.order
    inside = True
    for c in range(nc):
        if not sticks_in(rows, mode, c, group):
            continue
        for k in range(N):
            aside[_SPARE, k] = held_at(flow, space.W, c, k) * powers[k]
        lowest(aside[_SPARE], N - 1, points[c], aside[_STEP])
        aside[_HELD, c] = 0.0
        for i in range(N):
            aside[_HELD, c] = max(aside[_HELD, c], abs(points[c, i]))
        if is_component(rows, c):
            continue
        for k in range(N):
            aside[_SPARE, k] = radius_at(rows, space.W, c, k) * powers[k]
        aside[_RADIUS, c] = lowest(aside[_SPARE], N - 1, points[nc + c], aside[_STEP])
    for c in range(nc):
        if sticks_in(rows, mode, c, group) and not is_component(rows, c):
            other = partner(rows, c)
            force = math.hypot(aside[_HELD, c], aside[_HELD, other] if other >= 0 else 0.0)
            inside = inside and force < aside[_RADIUS, c]
    return inside


@compiled()
def place_piece(flow: Flow, mode: Array, group: int, d: int, a: float, b: float) -> None:
    """Control points on [a, b] from those of the whole step.

    Parameters
    ----------
    flow : Flow
    mode : array of int, shape (contacts,)
    group, d : int
        The contacts, and the degree.
    a, b : float
    """
    rows = flow.rows
    points, piece = flow.space.points, flow.space.piece
    nc = rows.sizes[ON_INERTIAL]
    for c in range(nc):
        if sticks_in(rows, mode, c, group):
            cut_out(points, piece, c, d, a, b)
            if not is_component(rows, c):
                cut_out(points, piece, nc + c, d, a, b)


@compiled()
def holds_until(
    flow: Flow, mode: Array, group: int, rank: int, d: int, end: float, lack: float
) -> tuple[float, bool]:
    """How far it is proved that control points of degree d, of forces and radii on [0, 1], can be
    held; and whether they cannot at the end of what comes next.

    Parameters
    ----------
    flow : Flow
        With control points of the whole in its work space.
    mode : array of int, shape (contacts,)
    group, rank, d : int
    end : float
        Where to stop.
    lack : float
        Part of the forces that may be missing.

    Returns
    -------
    place : float
        `end`, if all is proved; else a place where the forces cannot be held, or up to which they
        can.
    fails : bool
        Which of both.
    """
    a = 0.0
    length = end
    for _ in range(_MOST_PIECES):
        if not a < end:
            return end, False
        b = end if a + 1.01 * length >= end else a + length
        place_piece(flow, mode, group, d, a, b)
        held = True
        for i in range(d, -1, -1):
            place_point(flow, mode, group, flow.space.piece, i)
            held = can_hold(flow, mode, group, rank, lack)
            if not held:
                if i == d:
                    return b, True
                break
        if held:
            a = b
            length *= 2.0
        else:
            length = 0.5 * (b - a)
            if length < _SHORTEST * end:
                break
    return a, False


@compiled()
def place_guard(flow: Flow, mode: Array, group: int, rank: int) -> tuple[float, float]:
    """Coefficients of Σ s |Gw| − q·w for the mechanism w in the work space, by the speed of the
    contact that it moves most; the size of the terms of the first, and that speed.

    Parameters
    ----------
    flow : Flow
        Receives them.
    mode : array of int, shape (contacts,)
    group, rank : int
    """
    rows = flow.rows
    space = flow.space
    W, guard = space.W, space.aside[LEAVES]
    fastest = fastest_of(flow, mode, group, rank, space.aside[_BEST])
    size = 0.0
    for k in range(flow.order):
        guard[k] = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        if not sticks_in(rows, mode, c, group) or is_component(rows, c):
            continue
        other = partner(rows, c)
        x, y = speed_of(flow, c, rank, space.aside[_BEST])
        x, y = x / fastest, y / fastest
        speed = math.hypot(x, y)
        for k in range(flow.order):
            guard[k] += speed * radius_at(rows, W, c, k) - x * held_at(flow, W, c, k)
            if other >= 0:
                guard[k] -= y * held_at(flow, W, other, k)
        size += speed * abs(radius_at(rows, W, c, 0))
        size += abs(x) * space.mag[2 * len(rows.u) + c]
        if other >= 0:
            size += abs(y) * space.mag[2 * len(rows.u) + other]
    return size, fastest


@compiled()
def mark_leaving(flow: Flow, mode: Array, group: int, rank: int, fastest: float) -> None:
    """Note which contacts of a group the mechanism in the work space moves.

    Parameters
    ----------
    flow : Flow
    mode : array of int, shape (contacts,)
    group, rank : int
    fastest : float
        The speed of the contact that it moves most.
    """
    rows = flow.rows
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group) and not is_component(rows, c):
            x, y = speed_of(flow, c, rank, flow.space.aside[_BEST])
            other = partner(rows, c)
            moves = 0
            if math.hypot(x, y) > _MOVES * fastest:
                # Forces along w are those against a slip along −w.
                moves = 1 if other >= 0 or x < 0.0 else -1
            flow.space.leaving[c] = moves
            if other >= 0:
                flow.space.leaving[other] = moves


@compiled()
def find_leaving(flow: Flow, mode: Array, first: int, lack: float) -> tuple[bool, float]:
    """Whether contacts that share their forces leave stick within a step, and which; their guard is
    left in the work space, with the size of its terms as a result.

    Parameters
    ----------
    flow : Flow
        With the coefficients and the powers of the step.
    mode : array of int, shape (contacts,)
    first : int
        The first contact of them.
    lack : float
        Part of the forces that counts as zero.
    """
    rows = flow.rows
    space = flow.space
    aside, powers = space.aside, space.powers
    group = rows.group[first]
    N = flow.order
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group):
            space.leaving[c] = STAYS
    if place_polynomials(flow, mode, group):
        return False, 0.0
    rank = grip(flow, mode, space.W, group)[1]
    end = 1.0
    size = 0.0
    leaves = False
    for _ in range(_MOST_CUTS):
        place_piece(flow, mode, group, N - 1, 0.0, end)
        place_point(flow, mode, group, space.piece, N - 1)
        found = 0.0
        if not fits(flow, mode, group, 0.0):
            found = overload(flow, mode, group, rank, lack, True)[0]
        if not found > 1.0 + lack:
            place, fails = holds_until(flow, mode, group, rank, N - 1, end, _PROVED)
            if not fails:
                if place < end:
                    # No more is proved: what rests is asked again there.
                    for k in range(N):
                        aside[LEAVES, k] = 0.0
                    aside[LEAVES, 0] = size = place
                    aside[LEAVES, 1] = -1.0 / powers[1]
                    leaves = True
                break
            end = place
            continue
        size, fastest = place_guard(flow, mode, group, rank)
        mark_leaving(flow, mode, group, rank, fastest)
        leaves = True
        for k in range(N):
            aside[_SPARE, k] = aside[LEAVES, k] * powers[k]
        if not aside[_SPARE, 0] > lack * size:
            break
        root = first_crossing(aside[_SPARE], N - 1, end, 0.0, space.stack)
        if not root < end:
            break
        end = root
    return leaves, size


@compiled()
def any_share(rows: Rows) -> bool:
    """Whether there are contacts that may share forces."""
    found = False
    for group in rows.group:
        found = found or group >= 0
    return found


@compiled()
def spare_part(flow: Flow, mode: Array, first: int) -> float:
    """The part of the thresholds that contacts which share their forces do not need at an instant,
    to a digit; 0 if they need all.

    Parameters
    ----------
    flow : Flow
        With the values of the rows.
    mode : array of int, shape (contacts,)
    first : int
        The first contact of them.
    """
    rows = flow.rows
    aside = flow.space.aside
    group = rows.group[first]
    rank = grip(flow, mode, flow.space.W, group)[1]
    part = 0.5
    while part > _PROVED:
        place_held(flow, mode, flow.space.W, group)
        for c in range(rows.sizes[ON_INERTIAL]):
            aside[_RADIUS, c] *= 1.0 - part
        if can_hold(flow, mode, group, rank, 0.0):
            return part
        part *= 0.1
    return 0.0


@compiled()
def lacking_part(flow: Flow, mode: Array, first: int, d: int, least: float) -> float:
    """The part of the forces that contacts which share them may lack on a piece, in powers of 10;
    0 if it is proved that it is at most `least`.

    Parameters
    ----------
    flow : Flow
        With control points, of degree d, of forces and radii.
    mode : array of int, shape (contacts,)
    first, d : int
        The first contact of them, and the degree.
    least : float
    """
    group = flow.rows.group[first]
    rank = grip(flow, mode, flow.space.W, group)[1]
    lack = least
    while lack < 1.0:
        place, fails = holds_until(flow, mode, group, rank, d, 1.0, lack)
        if place >= 1.0 and not fails:
            return 0.0 if lack == least else lack
        lack *= 10.0
    return math.inf
