"""Contact forces at rest that are not unique: whether admissible ones exist.

If more contacts are closed, or stick, than there are degrees of freedom, their forces are not
unique. A mode computes one choice, but the law requires only that some choice is admissible. If
those of the mode are not, others with the same effect are sought at both ends of a piece
(:mod:`stickslip.motion.admissible.cones`), well inside the bounds of the law if possible. The
directions must be constant on the piece: then differences Δ to the forces of the mode that are
linear in time have no effect, JᵀΔ = 0, and the law is checked between the nodes as it is for the
forces of the mode. Contacts of one body that share its forces
(:mod:`stickslip.motion.admissible.sharing`) are judged together, by the smallest violation over
all choices of forces.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.admissible.cones import (
    DIFFERENCE,
    FORCE,
    FORCE_SIZE,
    IN_MODE,
    LEAST_ALONE,
    LEAST_SHARE,
    LEFT,
    LEFT_ALONE,
    MOST_ALONE,
    MOST_SHARE,
    PRESSES,
    PUSHES_BACK,
    PUSHES_ON,
    RESTS,
    SHARES,
    WANTED,
    WEIGHT,
    fit_cones,
    no_cones,
)
from stickslip.motion.admissible.impacts_law import put_part
from stickslip.motion.admissible.leaving import missing_fraction
from stickslip.motion.admissible.sharing import ON_ITS_OWN, held_at, is_first, sticks_in
from stickslip.motion.affine.nodes import (
    COUNT,
    GAUSS_NODES,
    largest_of,
    least_on_nodes,
    most,
    to_control_points,
)
from stickslip.motion.algebra.roots import horner
from stickslip.motion.audit.accounts import (
    EXCESS,
    LARGEST_FORCE,
    LARGEST_SPEED,
    NEGLIGIBLE_PART,
    REST_PART,
    SPEED_HELD,
    Tally,
    samples_of,
)
from stickslip.motion.audit.between_nodes import StepPiece, deviation_bound
from stickslip.motion.audit.contact_planes import direction_uncertainty
from stickslip.motion.modes.guards import resting
from stickslip.motion.modes.inverses import resolve
from stickslip.motion.steps.arrays import (
    COORDINATES,
    DIMENSION,
    MATRIX,
    OK,
    ON_INERTIAL,
    PART,
    PRESSING,
    RUBBING,
    Flow,
    Instant,
    Machine,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import (
    ALONG_LINES,
    direction_entry,
    inertial_friction,
    is_loose,
    rubbing,
)
from stickslip.motion.steps.sets import (
    axis_of,
    force_terms,
    gap_size,
    radius_at,
    radius_row,
    rate_terms,
)
from stickslip.motion.steps.starting import coefficients
from stickslip.motion.steps.step_size import fill_powers
from stickslip.numerics.levels import ROUNDING
from stickslip.translator import compiled

# Entries of the row RESTS: a contact that is closed or sticks in the mode (HOLDS); one that rests
# although it is open or loose in the mode (TOUCHES); one that slides (RUBS). Others are 0.
HOLDS, TOUCHES, RUBS = 1, 2, -1
_SAME = 1e-11  # relative difference of equal quantities
_LITTLE = 1.5e-9  # fraction of the bounds below which there is no margin
_INSIDE = 4  # number of trials, with decreasing margins from the bounds of the law


@compiled(brief=True)
def kept_room(trial: int) -> float:
    """The part of the room that forces have to keep in a trial."""
    return 0.0 if trial == _INSIDE - 1 else 0.3 * 0.1**trial


@compiled(brief=True)
def try_other_forces(machine: Machine, flow: Flow, at: Instant, order: int, h: float) -> bool:
    """Look for other forces of resting contacts in a piece that obey the law; if there are any,
    their guards replace those of the mode.

    Parameters
    ----------
    flow : Flow
        Its work space has the polynomials and the guards at the nodes; in `Space.cones`, RESTS and
        FORCE_SIZE say what rests, and the sizes of forces. Receives the guards.
    at : Instant
        Begin of the piece; its state is used up.
    order : int
        Of the polynomials.
    h : float
        Length of the piece.
    """
    rows, space = flow.rows, flow.space
    unit = space.W[rows.sizes[DIMENSION], 1]
    if not goes_straight(rows, space, order, h / unit):
        return False
    for trial in range(_INSIDE):
        found = True
        for end in range(2):
            if found:
                tau = h * GAUSS_NODES[end * (COUNT - 1)]
                for r in range(len(at.y)):
                    at.y[r] = horner(space.W[r], order, tau / unit)
                here = Instant(at.t + tau, at.y, at.mode, at.reg)
                found = fit_forces(machine, flow, here, kept_room(trial), end)
        if found:
            shift_guards(rows, space, at.mode, 1.0)
            if is_admissible(rows, space, at.mode):
                return True
            shift_guards(rows, space, at.mode, -1.0)
    return False


@compiled(brief=True)
def widest_room(machine: Machine, flow: Flow, at: Instant) -> float:
    """Largest margin of admissible forces of resting contacts, relative to the bounds of the law; 0
    if there is none.

    Parameters
    ----------
    flow : Flow
        In the `Space.cones` of its work space RESTS and FORCE_SIZE say what rests, and the sizes of
        forces.
    """
    room = 0.0
    wider = _LITTLE
    while wider < 1.0 and fit_forces(machine, flow, at, wider, 0):
        room = wider
        wider *= 8.0
    return room


@compiled(brief=True)
def goes_straight(rows: Rows, space: Space, order: int, x: float) -> bool:
    """Whether the directions of contacts do not turn.

    Parameters
    ----------
    space : Space
        With the polynomials.
    order : int
        Of these.
    x : float
        Length of the piece, in the unit of their time.
    """
    for c in range(rows.sizes[ON_INERTIAL]):
        if space.cones[RESTS, c] == 0.0:
            continue
        size = 0.0
        turns = 0.0
        for j in range(rows.parts[rows.homes[c, PART], COORDINATES]):
            row = rows.turning[c, j]
            if row < 0:
                size = max(size, 1.0)
                continue
            size = max(size, abs(space.W[row, 0]))
            power = 1.0
            for i in range(1, order):
                power *= x
                turns += abs(space.W[row, i]) * power
        if not turns <= _SAME * size:
            return False
    return True


@compiled(brief=True)
def fit_forces(machine: Machine, flow: Flow, at: Instant, room: float, end: int) -> bool:
    """Find admissible forces of resting contacts that have the same effect as those of the mode.

    Parameters
    ----------
    flow : Flow
        Its work space receives the difference.
    room : float
        Part of what the law allows from whose bounds they keep away.
    end : int
        Which end of the piece it is.
    """
    rows, space = flow.rows, flow.space
    cones = space.cones
    mq = rows.sizes[ON_INERTIAL]
    if coefficients(machine, flow, at, 1, space.V) != OK:
        return False
    no_cones(rows, space)
    if not put_law(rows, space, at.mode, room, end):
        return False
    free = space.tried[0]
    for c in range(len(at.mode)):
        free[c] = 1
    known = resolve(rows, flow.k, space, free)
    freed = Instant(at.t, at.y, free, at.reg)
    known = known and coefficients(machine, flow, freed, 1, space.V) == OK
    if known:
        for p in range(len(rows.parts)):
            if rows.parts[p, MATRIX] == 0:
                put_part(rows, space, flow.k.J, p, True)
    if not resolve(rows, flow.k, space, at.mode) or not known:
        return False
    scale = 0.0
    for c in range(mq):
        own = space.delassus[c, c]
        if cones[RESTS, c] == 0.0 or not own > 0.0:
            continue
        for b in range(mq):
            if cones[RESTS, b] != 0.0 and rows.homes[b, PART] == rows.homes[c, PART]:
                cones[WANTED, c] += space.delassus[c, b] * (cones[IN_MODE, b] - cones[SHARES, b])
        alone = max(abs(cones[LEAST_ALONE, c]), abs(cones[MOST_ALONE, c]))
        cones[WEIGHT, c] = alone * alone * own
        scale = max(scale, abs(cones[WANTED, c]) / math.sqrt(own), alone * math.sqrt(own))
    fit_cones(rows, space, scale)
    for c in range(mq):
        if cones[RESTS, c] != 0.0:
            size = _SAME * scale * math.sqrt(space.delassus[c, c])
            if not abs(cones[LEFT, c]) <= size:
                return False
            if not abs(cones[LEFT_ALONE, c]) <= _SAME * cones[WEIGHT, c]:
                return False
            cones[DIFFERENCE + end, c] = cones[FORCE, c] + cones[SHARES, c] - cones[IN_MODE, c]
    return True


@compiled(brief=True)
def put_law(rows: Rows, space: Space, mode: Array, room: float, end: int) -> bool:
    """Set up the admissible cones of resting contacts, and their forces in the mode; False if
    coefficients of friction change in the piece.

    Parameters
    ----------
    space : Space
        With the values of all rows.
    mode : array of int, shape (contacts,)
    room, end
        As in :func:`fit_forces`.
    """
    cones, V = space.cones, space.V
    mq = rows.sizes[ON_INERTIAL]
    normals = 0.0
    closed = 0
    for c in range(mq):
        cones[IN_MODE, c] = V[rows.force[c], 0]
        cones[SHARES, c] = 0.0
    for c in rows.openings:
        if cones[RESTS, c] != 0.0:
            normals += abs(cones[IN_MODE, c])
            closed += 1
    for c in rows.openings:
        if cones[RESTS, c] != 0.0:
            cones[PRESSES, c] = 1.0
            cones[SHARES, c] = room * normals / closed
    for c in inertial_friction(rows):
        if cones[RESTS, c] == 0.0:
            continue
        held, up, down = cones[IN_MODE, c], V[rows.plus[c], 0], V[rows.minus[c], 0]
        rubs = cones[RESTS, c] == RUBS
        first = 0 if rubs else 2
        inner = 1.0 - room
        for link in range(rows.first_link[c], rows.first_link[c + 1]):
            n = rows.links[link, PRESSING]
            on, back = V[rows.friction[link, first], 0], V[rows.friction[link, first + 1], 0]
            if end == 0:
                cones[PUSHES_ON, link], cones[PUSHES_BACK, link] = on, back
            off = abs(on - cones[PUSHES_ON, link]) + abs(back - cones[PUSHES_BACK, link])
            if not off <= _SAME * (abs(on) + abs(back)):
                return False
            share = -on if mode[c] > 0 else back
            cones[LEAST_SHARE, link] = share if rubs else -inner * on
            cones[MOST_SHARE, link] = share if rubs else inner * back
            if rubs:
                cones[SHARES, c] += share * cones[SHARES, n]
                held -= share * cones[IN_MODE, n]
            else:
                up -= on * cones[IN_MODE, n]
                down -= back * cones[IN_MODE, n]
        if rubs:
            # the force that remains besides the normal forces has to vanish
            if not abs(held) <= _SAME * cones[FORCE_SIZE, c]:
                return False
        else:
            alone = inner * max(up, 0.0), inner * max(down, 0.0)
            if max(alone[0], alone[1]) > _SAME * cones[FORCE_SIZE, c]:
                cones[LEAST_ALONE, c], cones[MOST_ALONE, c] = -alone[0], alone[1]
    return True


@compiled(brief=True)
def shift_guards(rows: Rows, space: Space, mode: Array, sign: float) -> None:
    """Add the difference of the forces to the guards at the nodes, or take it away again.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
    sign : float
        1 or −1.
    """
    cones, samples = space.cones, space.samples
    last = GAUSS_NODES[COUNT - 1] - GAUSS_NODES[0]
    for g in range(COUNT):
        part = (GAUSS_NODES[g] - GAUSS_NODES[0]) / last
        for c in inertial_friction(rows):
            if cones[RESTS, c] != HOLDS:
                continue
            row = samples_of(rows, c)
            change = sign * difference_at(cones, c, part)
            up, down = change, -change
            width = 0.0
            for link in range(rows.first_link[c], rows.first_link[c + 1]):
                n = rows.links[link, PRESSING]
                pressed = sign * difference_at(cones, n, part)
                on, back = cones[PUSHES_ON, link], cones[PUSHES_BACK, link]
                up += on * pressed
                down += back * pressed
                # the normal force as it was
                width += (on + back) * samples[samples_of(rows, n), g]
            if abs(mode[c]) == 1:
                # For contacts whose threshold others hold, guards are computed here.
                samples[row + 1, g] = up + (0.0 if mode[c] > 0 else width)
                samples[row + 2, g] = down + (width if mode[c] > 0 else 0.0)
            else:
                samples[row, g] += up
                samples[row + 1, g] += down
        for c in rows.openings:
            if cones[RESTS, c] == HOLDS:
                samples[samples_of(rows, c), g] += sign * difference_at(cones, c, part)


@compiled(brief=True)
def difference_at(cones: Array, c: int, part: float) -> float:
    """Difference of a force at a fraction of the way from one end to the other."""
    return float((1.0 - part) * cones[DIFFERENCE, c] + part * cones[DIFFERENCE + 1, c])


@compiled(brief=True)
def is_admissible(rows: Rows, space: Space, mode: Array) -> bool:
    """Whether the guards of resting contacts are nonnegative, up to rounding errors; where the mode
    determines no force, differences that change linearly are admissible between the ends if they
    are at both."""
    for c in range(rows.sizes[ON_INERTIAL]):
        if space.cones[RESTS, c] != HOLDS:
            continue
        row = samples_of(rows, c)
        little = _SAME * space.cones[FORCE_SIZE, c]
        # For contacts whose threshold others hold, the guards are one row further.
        first = row + 1 if abs(mode[c]) == 1 else row
        for guard in range(first, first + rows.states[c] - 1):
            if least_on_nodes(space.samples[guard], space.bernstein, 1e-2 * little) < -little:
                return False
    return True


@compiled()
def violates_law(rows: Rows, space: Space, mode: Array, piece: StepPiece, tally: Tally) -> bool:
    """Whether forces of resting contacts violate the law at a node; the resting contacts are marked
    in the work space.

    Parameters
    ----------
    space : Space
        With the guards at the nodes.
    mode : array of int, shape (contacts,)
    tally : Tally
        Sizes.
    """
    if not may_have_others(rows, space):
        return False
    law = tally.law
    asked = False
    for c in range(rows.sizes[ON_INERTIAL]):
        space.cones[FORCE_SIZE, c] = law[c, LARGEST_FORCE]
        space.cones[RESTS, c] = 0.0
    for c in rows.openings:
        if mode[c] == 0:
            space.cones[RESTS, c] = HOLDS
            asked = asked or falls_below(space, samples_of(rows, c), law[c, LARGEST_FORCE])
            continue
        wide = largest_of(space.samples[samples_of(rows, c)])
        touches = wide <= ROUNDING * gap_size(rows, space, c)
        if touches and stays_still(rows, space, c, piece, tally):
            space.cones[RESTS, c] = TOUCHES
    for c in rubbing(space, ALONG_LINES):
        if c >= rows.sizes[ON_INERTIAL]:
            break
        if resting(mode[c]):
            space.cones[RESTS, c] = HOLDS
            for part in range(2):
                row = samples_of(rows, c) + part
                asked = asked or falls_below(space, row, law[c, LARGEST_FORCE])
        elif rows.alone[c] == 0:
            still = rows.drops[c] == 0 and stays_still(rows, space, c, piece, tally)
            space.cones[RESTS, c] = HOLDS if still else RUBS
    for link in range(len(rows.links) if asked else 0):
        c, n = rows.links[link, RUBBING], rows.links[link, PRESSING]
        if space.cones[RESTS, n] == TOUCHES and is_loose(rows, mode, c):
            still = stays_still(rows, space, c, piece, tally)
            space.cones[RESTS, c] = TOUCHES if still else 0.0
            # Friction that slips would add to the normal force; that is not tested here.
            space.cones[RESTS, n] = space.cones[RESTS, n] if still else 0.0
    return asked


@compiled()
def may_have_others(rows: Rows, space: Space) -> bool:
    """Whether to look for other forces of resting contacts: there are not too many, and none has
    friction in a plane."""
    return len(space.delassus) > 0 and len(rows.planes) == 0


@compiled()
def falls_below(space: Space, row: int, force: float) -> bool:
    """Whether a guard is negative at a node, as a force of a size cannot be by rounding."""
    below = False
    for g in range(COUNT):
        below = below or space.samples[row, g] < -NEGLIGIBLE_PART * force
    return bool(below)


@compiled()
def stays_still(rows: Rows, space: Space, c: int, piece: StepPiece, tally: Tally) -> bool:
    """Whether the velocity of a contact is within rounding errors of zero in a piece.

    Parameters
    ----------
    space : Space
        With the polynomials.
    tally : Tally
        Sizes.
    """
    W = space.W[rows.u[c]]
    x = piece.h / space.W[rows.sizes[DIMENSION], 1]
    moved = 0.0
    for k in range(piece.order - 1, -1, -1):
        moved = moved * x + abs(W[k])
    made = piece.acting * rate_terms(rows, space.mag, c)
    speed = max(tally.law[c, LARGEST_SPEED], REST_PART * max(tally.law[c, SPEED_HELD], made))
    return moved <= NEGLIGIBLE_PART * speed


@compiled()
def sample_together(flow: Flow, mode: Array, piece: StepPiece, g: int) -> float:
    """Store the forces of contacts that share them, and their radii, at a node; returns the
    relative deviation of their directions from the polynomials.

    Parameters
    ----------
    flow : Flow
        With the values of the rows at the node.
    mode : array of int, shape (contacts,)
    g : int
        The node.
    """
    rows, space = flow.rows, flow.space
    W, V = space.W, space.V
    nc = rows.sizes[ON_INERTIAL]
    x = piece.h * GAUSS_NODES[g] / W[rows.sizes[DIMENSION], 1]
    found = 0.0
    for c in range(nc):
        if mode[c] != 0 or space.leaving[c] == ON_ITS_OWN:
            continue
        space.points[c, g] = held_at(flow, V, c, 0)
        space.points[nc + c, g] = radius_at(rows, V, c, 0)
        size, off = 0.0, 0.0
        for j in range(rows.parts[rows.homes[c, PART], COORDINATES]):
            size += abs(direction_entry(rows, flow.k.J, V, c, j))
            row = rows.turning[c, j]
            if row >= 0:
                off += abs(horner(W[row], flow.order - 1, x) - V[row, 0])
        if off > 0.0:
            found = most(found, off / size if size > 0.0 else math.inf)
    return found


@compiled()
def judge_together(flow: Flow, mode: Array, piece: StepPiece, turned: float, tally: Tally) -> None:
    """Smallest violation of the law by forces that hold contacts at rest on a piece, if they are
    not unique.

    Parameters
    ----------
    flow : Flow
        With what :func:`sample_together` keeps, and the discs.
    mode : array of int, shape (contacts,)
    turned : float
        Relative deviation of the directions from their polynomials at the nodes.
    tally : Tally
        Receives the largest.
    """
    rows = flow.rows
    space = flow.space
    law = tally.law
    nc = rows.sizes[ON_INERTIAL]
    known = piece.factor < np.inf
    fill_powers(space.powers, piece.h / space.W[rows.sizes[DIMENSION], 1])
    for first in range(nc):
        if (
            mode[first] != 0
            or space.leaving[first] == ON_ITS_OWN
            or not is_first(rows, mode, first)
        ):
            continue
        least = max(piece.rounding, direction_uncertainty(rows, space, mode, first, tally))
        loose = 0.0
        for c in range(first, nc):
            if not sticks_in(rows, mode, c, rows.group[first]):
                continue
            to_control_points(space.points[c], space.bernstein[0])
            to_control_points(space.points[nc + c], space.bernstein[0])
            force = law[rows.lead[c], LARGEST_FORCE]
            if not force > 0.0:
                continue
            least = max(least, piece.rounding * force_terms(rows, space.mag, c) / force)
            if known:
                deviation = deviation_bound(space.discs[rows.force[c]], piece.factor) / axis_of(
                    flow, c
                )
                deviation += deviation_bound(space.discs[radius_row(rows, c)], piece.factor)
                loose = max(loose, deviation / force + direction_deviation(flow, c, piece.factor))
        lack = missing_fraction(flow, mode, first, COUNT - 1, least)
        loose += turned if turned > least else 0.0
        law[first, EXCESS] = most(law[first, EXCESS], (lack + loose) * law[first, LARGEST_FORCE])


@compiled()
def direction_deviation(flow: Flow, c: int, factor: float) -> float:
    """Bound of the relative deviation of a direction between the nodes of a piece.

    Parameters
    ----------
    flow : Flow
        With the polynomials and the discs.
    c : int
        The direction.
    factor : float
        As in :class:`StepPiece`.
    """
    rows, space = flow.rows, flow.space
    size, deviation = 0.0, 0.0
    for j in range(rows.parts[rows.homes[c, PART], COORDINATES]):
        size += abs(direction_entry(rows, flow.k.J, space.W, c, j))
        row = rows.turning[c, j]
        if row >= 0:
            deviation += deviation_bound(space.discs[row], factor)
    return deviation / size if deviation > 0.0 else 0.0
