"""The strength of several contacts together: a rigid body that rests on several points.

Where more directions stick than there are coordinates, forces are not unique. Rest asks for some
forces inside their sets, discs in a plane and intervals along a line, that have the sum q which
rest needs: q has to be in the convex set K = Σ Gᵀ(set of each), G the directions. That is decided
by a smooth, strictly convex function of what the body might do,

    F(w) = Σ s √(1 + |Gw|²) − q·w,   F′(w) = Σ Gᵀf − q,   f = s Gw/√(1 + |Gw|²).

For sets of any other form their support functions stand in place of |Gw|. F has a minimum if and
only if q is inside K, and there the f are forces with the sum q, each inside its set: a proof that
the body can rest. If q is outside, F falls for ever, and Newton's
method comes to some w with Σ s |Gw| < q·w: a mechanism against which friction is too weak, and the
proof of that. K is convex, and so is the set of all (q, s) for which q is in it: what holds at the
control points of polynomials, in Bernstein's form, holds along them.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.equations.codegen.series import invert
from stickslip.motion.admissible.sharing import held_at, speed_of, sticks_in
from stickslip.motion.algebra.vectors import is_new
from stickslip.motion.steps.arrays import ON_INERTIAL, Flow
from stickslip.motion.steps.contacts import directions_of, inertial_contacts
from stickslip.motion.steps.sets import (
    MOVED,
    force_outside,
    given_force,
    inner_bend,
    inner_force,
    parts_at,
    radius_at,
    support_at,
)
from stickslip.numerics.levels import INDEPENDENT
from stickslip.translator import compiled

_FAR = 1e4  # size of the mechanism above which the contacts that do not move are known
MOVES = 1e-3  # fraction of the largest speed above which a contact begins to slip, too
_MOST_TURNS = 200  # largest number of Newton iterations
_LONGEST = 4.0  # largest length of a Newton step, relative to the point reached
_CRUDE = 1e-4  # accuracy of the mechanism that begins, relative to the excess of the load
_SETTLED = 1e-15  # largest relative error of the sum of the forces
# Rows of Space.aside: what the body might do (w), q, F′, a Newton step, F′ where it leads, forces
# and radii, work space, the guard of the mechanism that begins, that mechanism, and the one against
# which friction was weakest so far.
_WAY, _PULL, _SLOPE, STEP, _AHEAD, GIVEN_FORCES, RADIUS, SCRATCH, LEAVES, MECHANISM = range(10)
_WEAKEST = 10


@compiled(brief=True)
def place_held(flow: Flow, mode: Array, table: Array, group: int) -> None:
    """Put the forces and radii that a table has into the work space."""
    rows = flow.rows
    aside = flow.space.aside
    for c in range(rows.sizes[ON_INERTIAL]):
        if sticks_in(rows, mode, c, group):
            aside[GIVEN_FORCES, c] = held_at(flow, table, c, 0)
            aside[RADIUS, c] = max(radius_at(rows, table, c, 0), 0.0)


@compiled(brief=True)
def can_hold(flow: Flow, mode: Array, group: int, rank: int, lack: float) -> bool:
    """Whether the forces in the work space can be held, but for a part of them.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    group, rank : int
        The contacts, and how many of their directions are independent.
    lack : float
        The part.
    """
    if fits(flow, mode, group, lack):
        return True
    return overload(flow, mode, group, rank, lack, False)[1]


@compiled(brief=True)
def fits(flow: Flow, mode: Array, group: int, lack: float) -> bool:
    """Whether forces in the work space are in their sets themselves, but for a part of these."""
    rows = flow.rows
    aside = flow.space.aside
    for c in inertial_contacts(rows):
        if sticks_in(rows, mode, c, group):
            a, b = given_force(flow, c, aside[GIVEN_FORCES])
            # for faces the test is reversed
            if not force_outside(flow, c, (1.0 + lack) * aside[RADIUS, c], a, b) <= 0.0:
                return False
    return True


@compiled(brief=True)
def overload(
    flow: Flow, mode: Array, group: int, rank: int, lack: float, full: bool
) -> tuple[float, bool]:
    """A lower bound of the factor by which q exceeds the strength, proved by a mechanism; and
    whether it is proved that q can be held, up to a part `lack` of it.

    Parameters
    ----------
    flow : Flow
        With directions, and forces and radii in the work space; receives what the body would do in
        the limit, w.
    mode : array of int, shape (contacts,)
    full : bool
        Whether the factor is wanted, and the limit, where q is too large; otherwise some mechanism
        and its factor.
    """
    space = flow.space
    aside = space.aside
    way, slope, step, ahead = aside[_WAY], aside[_SLOPE], aside[STEP], aside[_AHEAD]
    size = pull(flow, mode, group, rank)
    for r in range(rank):
        way[r] = 0.0
    found, load = 0.0, 0.0
    weakest = aside[_WEAKEST]
    for _ in range(_MOST_TURNS):
        load = load_of(flow, mode, group, rank)
        if load > found:
            found = load
            for r in range(rank):
                weakest[r] = aside[MECHANISM, r]
        bend_of(flow, mode, group, rank)
        if (found > 1.0 + lack and not full) or not found < math.inf:
            return found, False
        part = (1.0 - lack) / max(found, 1.0)
        slope_of(flow, mode, group, rank, way, part, slope)
        off = 0.0
        for r in range(rank):
            off = max(off, abs(slope[r]))
        # Far outside, the mechanism is not needed more accurately.
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
            slope_of(flow, mode, group, rank, ahead, part, aside[SCRATCH])
            there = 0.0
            for r in range(rank):
                there += step[r] * aside[SCRATCH, r]
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
    if found > 1.0 + lack and load < 1.0 + 0.5 * (found - 1.0):
        # Newton's method failed, but the mechanism found so far is a proof.
        for r in range(rank):
            aside[MECHANISM, r] = weakest[r]
    part = (1.0 - lack) / max(found, 1.0)
    slope_of(flow, mode, group, rank, way, part, slope)
    off = 0.0
    for r in range(rank):
        off = max(off, abs(slope[r]))
    return found, found <= 1.0 + lack and off <= (0.5 * lack + 16.0 * _SETTLED) * size


@compiled(brief=True)
def pull(flow: Flow, mode: Array, group: int, rank: int) -> float:
    """The sum q of the forces that rest needs, from forces and radii in the work space; returns the
    size of its terms."""
    rows = flow.rows
    space = flow.space
    size = 0.0
    for r in range(rank):
        space.aside[_PULL, r] = 0.0
    for c in inertial_contacts(rows):
        for i in directions_of(rows, c):
            if sticks_in(rows, mode, c, group):
                size += abs(space.aside[GIVEN_FORCES, i])
                size += space.aside[RADIUS, c] if i == c else 0.0
                for r in range(rank):
                    space.aside[_PULL, r] += space.in_basis[i, r] * space.aside[GIVEN_FORCES, i]
    return size


@compiled(brief=True)
def slope_of(
    flow: Flow, mode: Array, group: int, rank: int, w: Array, part: float, slope: Array
) -> None:
    """F′(w), for a part of q.

    Parameters
    ----------
    flow : Flow
        With directions, q and radii in its work space.
    mode : array of int, shape (contacts,)
    part : float
        Of q.
    slope : array
        Receives F′.
    """
    rows = flow.rows
    space = flow.space
    for r in range(rank):
        slope[r] = -part * space.aside[_PULL, r]
    for c in inertial_contacts(rows):
        if sticks_in(rows, mode, c, group):
            block = directions_of(rows, c)
            speed_of(flow, c, rank, w)
            force = inner_force(flow, c, space.aside[RADIUS, c], space.along[MOVED])
            for r in range(rank):
                for i in range(len(block)):
                    slope[r] += force[i] * space.in_basis[block[i], r]


@compiled(brief=True)
def inner_forces(flow: Flow, c: int, rank: int) -> Array:
    """The force f of a contact inside its set at the place that is reached, by its first direction;
    it is in the work space."""
    speed_of(flow, c, rank, flow.space.aside[_WAY])
    return inner_force(flow, c, flow.space.aside[RADIUS, c], flow.space.along[MOVED])


@compiled(brief=True)
def bend_of(flow: Flow, mode: Array, group: int, rank: int) -> None:
    """F″ at the place that is reached, over the basis that :func:`load_of` leaves.

    Parameters
    ----------
    flow : Flow
        Receives the matrix in its work space.
    mode : array of int, shape (contacts,)
    """
    rows = flow.rows
    space = flow.space
    bend, components, basis = space.bend, space.in_turned_basis, space.basis
    for c in range(rows.sizes[ON_INERTIAL]):
        for i in range(rank if sticks_in(rows, mode, c, group) else 0):
            components[c, i] = 0.0
            for r in range(rank):
                components[c, i] += basis[i, r] * space.in_basis[c, r]
    for i in range(rank):
        for j in range(rank):
            bend[i, j] = 0.0
    for c in inertial_contacts(rows):
        if not sticks_in(rows, mode, c, group):
            continue
        block = directions_of(rows, c)
        speed_of(flow, c, rank, space.aside[_WAY])
        xx, yy, xy, xz, yz, zz, size = inner_bend(flow, c, space.along[MOVED])
        along = space.aside[RADIUS, c] / size
        for i in range(rank):
            a, b, g = parts_at(block, components, i)
            for j in range(rank):
                d, e, h = parts_at(block, components, j)
                bend[i, j] += along * (xx * a * d + xy * (a * e + b * d) + yy * b * e)
                mixed = xz * (a * h + g * d) + yz * (b * h + g * e)
                bend[i, j] += along * (mixed + zz * g * h)


@compiled(brief=True)
def descent(flow: Flow, rank: int) -> float:
    """A step of Newton's method, in the work space; how steep F is along it.

    Parameters
    ----------
    flow : Flow
        With F′, and the inverse of F″ over a basis.
    """
    space = flow.space
    slope, step, basis = space.aside[_SLOPE], space.aside[STEP], space.basis
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


@compiled(brief=True)
def load_of(flow: Flow, mode: Array, group: int, rank: int) -> float:
    """q·w/Σ s |Gw| for a possible velocity w of the body; for large w, for the mechanism that w
    approaches, in which contacts that lag far behind do not move. It is stored.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    """
    rows = flow.rows
    space = flow.space
    aside, basis = space.aside, space.basis
    best = aside[MECHANISM]
    fastest = fastest_of(flow, mode, group, rank, aside[_WAY])
    for r in range(rank):
        best[r] = aside[_WAY, r]
    held = 0
    for c in range(rows.sizes[ON_INERTIAL] if fastest > _FAR else 0):
        if not sticks_in(rows, mode, c, group):
            continue
        if speed_of(flow, rows.lead[c], rank, aside[_WAY]) > MOVES * fastest or held == rank:
            continue
        for r in range(rank):
            basis[held, r] = space.in_basis[c, r]
        if is_new(rank, basis, held, INDEPENDENT):
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
    for c in inertial_contacts(rows):
        if sticks_in(rows, mode, c, group):
            speed_of(flow, c, rank, best)
            lost += aside[RADIUS, c] * support_at(flow, c, space.along[MOVED])
    # F″ is smallest along the mechanism, and largest if contacts stay at rest.
    for r in range(rank):
        basis[held, r] = best[r]
    if held < rank and is_new(rank, basis, held, 0.0):
        held += 1
    for k in range(rank):
        for r in range(rank if held < rank else 0):
            basis[held, r] = 1.0 if r == k else 0.0
        if held < rank and is_new(rank, basis, held, INDEPENDENT):
            held += 1
    if lost > 0.0:
        return float(work / lost)
    return math.inf if work > 0.0 else 0.0


@compiled(brief=True)
def fastest_of(flow: Flow, mode: Array, group: int, rank: int, w: Array) -> float:
    """The speed of the contact that a mechanism moves most.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    group, rank : int
        The contacts, and how many of their directions are independent.
    w : array
        The mechanism.
    """
    rows = flow.rows
    found = 0.0
    for c in inertial_contacts(rows):
        if sticks_in(rows, mode, c, group):
            found = max(found, speed_of(flow, c, rank, w))
    return found
