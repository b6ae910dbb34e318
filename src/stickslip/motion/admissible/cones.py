"""The admissible forces or impulses that are nearest to given ones, by least squares.

Where it is known what closes, slips and rests, the law leaves a convex set of forces. It is the sum
of cones: a unit of a normal force, with the friction that it can press; and a unit of a threshold,
which is wanted exactly once, with the forces within it. The point nearest to what is wanted is
found by non-negative least squares in the metric of M⁻¹, that of accelerations or of jumps of
velocities (C. L. Lawson & R. J. Hanson, *Solving Least Squares Problems*, 1974, chapter 23). Rays
are made when they are needed, each the steepest that there is, so that a set of forces counts by
its support function alone. No modes are tried, and where forces are not unique, any will do.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.algebra.vectors import solve_equations
from stickslip.motion.steps.arrays import ON_INERTIAL, PART, PRESSING, RUBBING, Rows, Space
from stickslip.motion.steps.contacts import directions_of
from stickslip.numerics.levels import EPSILON
from stickslip.translator import compiled

# Rows of Space.cones, by contact: the requested velocity; its remainder after the forces; their
# sum, and its size, in which rays may cancel; 1 for a possible normal force; by link, the smallest
# and the largest friction per unit of the normal force; by contact, those of the threshold (in a
# plane, the largest along each axis; the smallest equals the largest if the friction is given); the
# weight of the threshold, and its remainder.
(
    WANTED,
    LEFT,
    FORCE,
    STRONG,
    PRESSES,
    LEAST_SHARE,
    MOST_SHARE,
    LEAST_ALONE,
    MOST_ALONE,
    WEIGHT,
    LEFT_ALONE,
) = range(11)
_OF_A_FIT = 11
# Rows that only forces need (:mod:`stickslip.motion.audit.forces`): the state of a contact, and the
# size of its force; its force in the mode; a force added to by others; by link, coefficients of
# friction; and by contact, differences from the force in the mode, at both ends of a piece.
RESTS, FORCE_SIZE, IN_MODE, SHARES, PUSHES_ON, PUSHES_BACK, DIFFERENCE = range(11, 18)
_FLAT = 16.0 * EPSILON  # remainder relative to the requested force below which it is zero
_MOST_RAYS = 60  # largest number of rays for each contact


@compiled()
def fit_cones(rows: Rows, space: Space, scale: float) -> None:
    """Find the admissible forces nearest to the wanted ones.

    Parameters
    ----------
    space : Space
        With Delassus' matrix, and the cones; receives the forces, and what they leave.
    scale : float
        Size of what is wanted, in the metric.
    """
    number = 0
    put_left(rows, space, number)
    for _ in range(_MOST_RAYS * rows.sizes[ON_INERTIAL]):
        if not steepest_ray(rows, space, number) > _FLAT * scale:
            break
        number, entered = balance_rays(rows, space, number + 1)
        put_left(rows, space, number)
        if not entered:
            break


@compiled()
def steepest_ray(rows: Rows, space: Space, number: int) -> float:
    """Append the ray of steepest descent of the residual; returns its steepness (0: there is
    none)."""
    cones = space.cones
    mq = rows.sizes[ON_INERTIAL]
    most = 0.0
    chosen = -1
    for own in range(2 * mq):
        if (own < mq and cones[PRESSES, own] > 0.0) or (
            own >= mq and cones[WEIGHT, own - mq] > 0.0
        ):
            put_ray(rows, space, own, number)
            falls = falls_along(rows, space, number)
            square = product_of(rows, space, number, number)
            if falls > 0.0 and square > 0.0 and falls > most * math.sqrt(square):
                most, chosen = falls / math.sqrt(square), own
    if chosen >= 0:
        put_ray(rows, space, chosen, number)
    return most


@compiled()
def put_ray(rows: Rows, space: Space, own: int, number: int) -> None:
    """A unit of a normal force with the friction that reduces the residual most, or a unit of a
    threshold.

    Parameters
    ----------
    space : Space
        Receives it: the forces of all contacts, the parts of their thresholds, and the weight 0.
    own : int
        The contact; those with a threshold are counted behind all others.
    number : int
        Place of the ray.
    """
    cones, ray = space.cones, space.rays[number]
    mq = rows.sizes[ON_INERTIAL]
    for c in range(2 * mq + 1):
        ray[c] = 0.0
    ray[own] = 1.0
    if own >= mq:
        c = own - mq
        ray[c] = cones[MOST_ALONE, c] if cones[LEFT, c] > 0.0 else cones[LEAST_ALONE, c]
        return
    for link in range(len(rows.links)):
        if rows.links[link, PRESSING] != own:
            continue
        # The point of an interval, or of an ellipse by its semi-axes, farthest along the remainder.
        # Without one any point will do but 0: the sizes of forces determine their rounding errors.
        block = directions_of(rows, rows.links[link, RUBBING])
        size = 0.0
        for i in block:
            size = math.hypot(size, largest_share(rows, cones, link, i) * cones[LEFT, i])
        for i in block:
            share, at = largest_share(rows, cones, link, i), link_of(rows, link, i)
            given = cones[LEAST_SHARE, at] == cones[MOST_SHARE, at]
            x = abs(share * cones[LEFT, i])
            along = x / size if size > 0.0 else math.sqrt(1.0 / len(block))
            ray[i] = share if given else share * along


@compiled()
def largest_share(rows: Rows, cones: Array, link: int, i: int) -> float:
    """The friction along a direction that reduces the residual most, per unit of a normal force."""
    side = MOST_SHARE if cones[LEFT, i] > 0.0 else LEAST_SHARE
    return float(cones[side, link_of(rows, link, i)])


@compiled()
def link_of(rows: Rows, link: int, i: int) -> int:
    """The link of another direction of a contact under the same normal force."""
    return int(link - rows.first_link[rows.links[link, RUBBING]] + rows.first_link[i])


@compiled()
def falls_along(rows: Rows, space: Space, i: int) -> float:
    """Decrease of the squared residual along a ray."""
    cones, ray = space.cones, space.rays[i]
    mq = rows.sizes[ON_INERTIAL]
    total = 0.0
    for c in range(mq):
        if ray[c] != 0.0:
            total += ray[c] * cones[LEFT, c]
        if ray[mq + c] != 0.0:
            total += ray[mq + c] * cones[LEFT_ALONE, c]
    return total


@compiled()
def product_of(rows: Rows, space: Space, i: int, j: int) -> float:
    """Product of two rays in the metric."""
    mq = rows.sizes[ON_INERTIAL]
    total = 0.0
    for c in range(mq):
        if space.rays[i, c] != 0.0:
            for b in range(mq):
                if space.rays[j, b] != 0.0 and rows.homes[b, PART] == rows.homes[c, PART]:
                    total += space.rays[i, c] * space.delassus[c, b] * space.rays[j, b]
        total += space.cones[WEIGHT, c] * space.rays[i, mq + c] * space.rays[j, mq + c]
    return total


@compiled()
def balance_rays(rows: Rows, space: Space, number: int) -> tuple[int, bool]:
    """Compute the weights of rays for which the residual is orthogonal to all of them, removing
    rays whose weights would not be positive; returns how many are left, and whether the last one is
    among them.

    Parameters
    ----------
    space : Space
        With the rays, and what is left beside them.
    number : int
        How many rays there are.
    """
    rays, shares = space.rays, space.shares
    weight = 2 * rows.sizes[ON_INERTIAL]
    entered = True
    while number > 0:
        for i in range(number):
            for j in range(number):
                shares[i, j] = product_of(rows, space, i, j)
            shares[i, number] = falls_along(rows, space, i)
        if not solve_equations(shares, number):
            return number - 1, False  # the last one is a combination of the others
        part = 1.0
        first = -1
        for j in range(number):
            change = shares[j, number]
            if rays[j, weight] + change <= 0.0 and (first < 0 or rays[j, weight] < -part * change):
                part, first = min(part, -rays[j, weight] / change) if change < 0.0 else 0.0, j
        for j in range(number):
            rays[j, weight] += part * shares[j, number]
        if first < 0:
            return number, entered
        entered = entered and first < number - 1
        for j in range(first, number - 1):
            for c in range(weight + 1):
                rays[j, c] = rays[j + 1, c]
        number -= 1
        put_left(rows, space, number)
    return 0, False


@compiled()
def put_left(rows: Rows, space: Space, number: int) -> None:
    """Add up the forces of rays, and compute the residual."""
    cones, rays = space.cones, space.rays
    mq = rows.sizes[ON_INERTIAL]
    for c in range(mq):
        cones[FORCE, c], cones[STRONG, c] = 0.0, 0.0
        cones[LEFT_ALONE, c] = cones[WEIGHT, c]
        for j in range(number):
            cones[FORCE, c] += rays[j, 2 * mq] * rays[j, c]
            cones[STRONG, c] += rays[j, 2 * mq] * abs(rays[j, c])
            cones[LEFT_ALONE, c] -= rays[j, 2 * mq] * rays[j, mq + c] * cones[WEIGHT, c]
    for c in range(mq):
        cones[LEFT, c] = cones[WANTED, c]
        for b in range(mq):
            if cones[FORCE, b] != 0.0 and rows.homes[b, PART] == rows.homes[c, PART]:
                cones[LEFT, c] -= space.delassus[c, b] * cones[FORCE, b]


@compiled()
def no_cones(rows: Rows, space: Space) -> None:
    """Begin with no forces at all."""
    for i in range(_OF_A_FIT):
        for c in range(max(rows.sizes[ON_INERTIAL], len(rows.links))):
            space.cones[i, c] = 0.0
