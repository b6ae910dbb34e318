"""Impulses of many contacts, without trying all modes.

Contacts are relaxed one after the other, which tells roughly which of them carry and which slip;
then contacts whose mode is wrong change it (all of them, or the first one where that does not
help), until the mode explains itself. Directions of
slips in planes follow by Newton's method. With more contacts than freedoms many impulses lead to
the same velocities. To tell one of them each contact yields a little, in proportion to its own
response. What the limit of this is has the least Σ G_cc Λ_c², whatever the order of the contacts;
the little is taken away again in the mode that was found, and the impulses are put to the same test
as those of few contacts.

References
----------
J. J. Júdice, F. M. Pires, *A block principal pivoting algorithm for large-scale strictly monotone
linear complementarity problems*, Comput. Oper. Res. 21 (1994) 587–596; M. Jean, *The non-smooth
contact dynamics method*, Comput. Methods Appl. Mech. Eng. 177 (1999) 235–257.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.admissible.impacts_law import (
    AFTER,
    BEFORE,
    IMPULSE,
    NEAR,
    axes_in,
    friction_of,
    is_free,
    is_held,
    judge_impulses,
    moved_on,
    point_along,
    put_velocities,
    residual_of,
    slides_along,
    takes_part,
)
from stickslip.motion.algebra.vectors import solve_equations
from stickslip.motion.steps.arrays import (
    BACK,
    FORWARD,
    HOLDS_BACK,
    HOLDS_FORWARD,
    LEAD,
    ON_INERTIAL,
    PART,
    PRESSING,
    RUBBING,
    SENSE,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import (
    directions_of,
    inertial_contacts,
    set_mode,
)
from stickslip.motion.steps.sets import second_of
from stickslip.motion.steps.starting import secular_root
from stickslip.translator import compiled

# More rows of Space.impact: impulses of relaxation; stiffness of the rotation of slips in planes.
_RELAXED, _TURNS = range(15, 17)
# More rows of Space.tried: contacts that slip although they were at rest; and the positions of
# unknowns among the equations.
_RELEASED, _PLACE = 3, 5
_YIELDS = 1e-6  # compliance of each of many contacts, relative to its own response
_WRONG = 1e-12  # relative to the largest: smaller values do not have the wrong sign
_PATIENCE = 6  # times that all wrong modes are changed together although their number does not fall
_FIRST_ROUNDS, _LAST_ROUNDS = 8, 2048  # number of relaxation sweeps
_EXACTLY = 12  # times that what has yielded is taken away, until what is held has rates of
_EXACT, _NEARLY, _HOLDS = 1e-15, 1e-12, 1e-10
_STRAIGHT = 1e-3  # largest rotation of slips in planes that counts as small
# smallest determinant of two distinct contacts, relative to the product of its diagonal
_REGULAR = 1e-12


@compiled()
def find_impulses(rows: Rows, space: Space, mode: Array) -> bool:
    """Impulses of many contacts and their mode; False if none are found.

    What is at rest has its static friction, and has its kinetic friction once that does not hold.
    """
    tried = space.tried
    mq = rows.sizes[ON_INERTIAL]
    for c in range(mq):
        tried[_RELEASED, c] = 0
    for _ in range(mq + 1):
        if not relax_and_pivot(rows, space, mode):
            return False
        if not release_slips(rows, space, mode):
            return True
    return False


@compiled()
def release_slips(rows: Rows, space: Space, mode: Array) -> bool:
    """Set sliding contacts to their kinetic friction; returns whether that changes anything."""
    work = space.impact
    changed = False
    for c in range(rows.sizes[ON_INERTIAL]):
        if slides_along(rows, space.tried, mode, c) and space.tried[_RELEASED, c] == 0:
            space.tried[_RELEASED, c] = 1
            side = 0 if mode[c] > 0 else 1
            for link in range(rows.first_link[c], rows.first_link[c + 1]):
                kinetic, static = work[FORWARD + side, link], work[HOLDS_FORWARD + side, link]
                changed = changed or kinetic < static
    return changed


@compiled()
def limit_of(tried: Array, c: int, forward: bool) -> int:
    """The row of coefficients of friction against slip of a contact in a sense."""
    if tried[_RELEASED, c] == 1:
        return FORWARD if forward else BACK
    return HOLDS_FORWARD if forward else HOLDS_BACK


@compiled()
def relax_and_pivot(rows: Rows, space: Space, mode: Array) -> bool:
    """Impulses with given coefficients of friction, and their mode; False if none are found."""
    work = space.impact
    mq = rows.sizes[ON_INERTIAL]
    for c in range(mq):
        work[IMPULSE, c] = 0.0
        mode[c] = 1
        work[SENSE, c] = 1.0
    put_velocities(rows, space)
    # Relaxation converges slowly, but finds modes from which pivoting needs few steps; if pivoting
    # fails, it continues for twice as long.
    rounds = _FIRST_ROUNDS
    while rounds <= _LAST_ROUNDS:
        for _ in range(rounds):
            relax_contacts(rows, space, mode)
        for c in range(mq):
            work[_RELAXED, c] = work[IMPULSE, c]
        if pivot(rows, space, mode):
            return True
        for c in range(mq):
            work[IMPULSE, c] = work[_RELAXED, c]
        put_velocities(rows, space)
        relax_contacts(rows, space, mode)
        if is_relaxed(rows, space, mode):
            return True
        rounds *= 2
    return False


@compiled()
def is_relaxed(rows: Rows, space: Space, mode: Array) -> bool:
    """Whether relaxation has converged: if friction holds more contacts than there are degrees of
    freedom, no mode may be consistent, but impulses obey the law."""
    work = space.impact
    largest = 0.0
    off = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        largest = max(largest, abs(work[IMPULSE, c]))
        if slides_along(rows, space.tried, mode, c):
            row = limit_of(space.tried, c, mode[c] > 0)
            allowed = friction_of(rows, work, row, c)
            off = max(off, abs(work[IMPULSE, c] + work[SENSE, c] * allowed))
    _, _, right = judge_impulses(rows, work, space.tried, mode)
    return right and off <= _WRONG * largest and residual_of(rows, space, mode) <= _WRONG


@compiled()
def push(rows: Rows, space: Space, c: int, impulse: float) -> None:
    """Add to the impulse of a contact."""
    work = space.impact
    if impulse != 0.0:
        work[IMPULSE, c] += impulse
        for b in range(rows.sizes[ON_INERTIAL]):
            if rows.homes[b, PART] == rows.homes[c, PART]:
                work[AFTER, b] += space.delassus[b, c] * impulse


@compiled()
def relax_contacts(rows: Rows, space: Space, mode: Array) -> None:
    """Solve the impact law of each contact for given impulses of the others, one contact after the
    other (projected Gauss–Seidel), and store its mode."""
    work = space.impact
    for c in inertial_contacts(rows):
        own = space.delassus[c, c]
        if not takes_part(rows, space.tried, c) or not own > 0.0:
            continue
        if len(directions_of(rows, c)) > 1:
            relax_in_plane(rows, space, mode, c)
            continue
        free = work[IMPULSE, c] - moved_on(work, c) / own
        least, most = interval_of(rows, space, c)
        mode[c] = 1 if free <= least else (-1 if free >= most else 0)
        work[SENSE, c] = mode[c]
        push(rows, space, c, min(max(free, least), most) - work[IMPULSE, c])


@compiled()
def interval_of(rows: Rows, space: Space, c: int) -> tuple[float, float]:
    """Least and largest impulse of a contact along a line for given impulses of the others;
    unbounded above for a contact that closes."""
    if space.tried[NEAR, c] == 1:
        return 0.0, np.inf
    least = -friction_of(rows, space.impact, limit_of(space.tried, c, True), c)
    return least, friction_of(rows, space.impact, limit_of(space.tried, c, False), c)


@compiled()
def relax_in_plane(rows: Rows, space: Space, mode: Array, c: int) -> None:
    """The same for a contact in a plane, by its first direction."""
    work = space.impact
    G = space.delassus
    o = second_of(rows, c)
    f, g = half_axes(rows, space, c)
    slips = 1
    x = y = 0.0
    if f > 0.0 and g > 0.0:
        # with forces and velocities in half axes: |y| ≤ 1
        u, v = work[IMPULSE, c], work[IMPULSE, o]
        p = f * (moved_on(work, c) - G[c, c] * u - G[c, o] * v)
        q = g * (moved_on(work, o) - G[o, c] * u - G[o, o] * v)
        a, b, d = f * f * G[c, c], f * g * G[c, o], g * g * G[o, o]
        minor = a * d - b * b
        if minor > _REGULAR * a * d:
            x, y = (b * q - d * p) / minor, (b * p - a * q) / minor
            slips = 0 if math.hypot(x, y) <= 1.0 else 1
        if slips == 1:
            n, m, _ = secular_root(a, b, d, p, q, g / f)
            work[SENSE, c], work[SENSE, o] = n, m
            x, y = -n, -m
    elif slips == 1:
        aim(rows, space, c, moved_on(work, c), moved_on(work, o))
    push(rows, space, c, f * x - work[IMPULSE, c])
    push(rows, space, o, g * y - work[IMPULSE, o])
    set_mode(rows, mode, c, slips)


@compiled()
def half_axes(rows: Rows, space: Space, c: int) -> tuple[float, float]:
    """Half axes of the ellipse of impulses of a contact in a plane, by its first direction."""
    work = space.impact
    row = limit_of(space.tried, c, True)
    f = friction_of(rows, work, row, c)
    g = friction_of(rows, work, row, second_of(rows, c))
    return max(f, 0.0), max(g, 0.0)


@compiled()
def axes_of(rows: Rows, space: Space, c: int) -> tuple[float, float]:
    """Its half axes in parts of the normal impulse."""
    return axes_in(rows, space.impact, limit_of(space.tried, c, True), c)


@compiled()
def pressed_by(rows: Rows, space: Space, c: int) -> float:
    """The normal impulse under which a contact in a plane rubs, by its first direction; all that
    press it do it with one coefficient."""
    row = limit_of(space.tried, c, True)
    f = space.impact[row, rows.first_link[c]]
    return friction_of(rows, space.impact, row, c) / f if f > 0.0 else 0.0


@compiled()
def aim(rows: Rows, space: Space, c: int, x: float, y: float) -> None:
    """Set the slip direction of a contact in a plane to that of a velocity.

    Parameters
    ----------
    c : int
        The contact, by its first direction.
    x, y : float
        The velocity.
    """
    f, g = axes_of(rows, space, c)
    point_along(rows, space.impact, c, f * x, g * y)


@compiled()
def pivot(rows: Rows, space: Space, mode: Array) -> bool:
    """Change modes that are wrong until none is, and put the impulses to the test; whether they
    obey the law."""
    mq = rows.sizes[ON_INERTIAL]
    fewest = mq + 1
    patience = _PATIENCE
    for _ in range(4 * mq + 20):
        turned = solve_mode(rows, space, mode, True)
        if not turned < np.inf:
            return False
        wrong = change_modes(rows, space, mode, patience > 0)
        if wrong == 0 and turned <= _STRAIGHT:
            if is_right(rows, space, mode):
                return True
            wrong = change_modes(rows, space, mode, False)
            if wrong == 0:
                return False
        if wrong < fewest:
            fewest, patience = wrong, _PATIENCE
        elif wrong > 0:
            patience -= 1
    return False


@compiled()
def is_right(rows: Rows, space: Space, mode: Array) -> bool:
    """Whether the impulses of a mode obey the law, after all corrections."""
    work = space.impact
    residual = np.inf
    off = np.inf
    for _ in range(_EXACTLY):
        turned = solve_mode(rows, space, mode, False)
        if not turned < np.inf:
            return False
        residual = residual_of(rows, space, mode)
        before, off = off, max(residual, turned)
        if off <= _EXACT or (off <= _NEARLY and off > 0.5 * before):
            break
    _, _, right = judge_impulses(rows, work, space.tried, mode)
    return right and residual <= _HOLDS


@compiled()
def solve_mode(rows: Rows, space: Space, mode: Array, afresh: bool) -> float:
    """Impulses in a mode where contacts yield a little, and the velocities after them.

    Parameters
    ----------
    afresh : bool
        Whether they yield from nothing. Else they yield from the impulses so far, so that what has
        yielded is taken away.

    Returns
    -------
    float
        By how much slips in planes have turned; infinite if impulses are not determined.
    """
    work = space.impact
    tried = space.tried
    system = space.impulses
    mq = rows.sizes[ON_INERTIAL]
    size = 0
    for c in range(mq):
        tried[_PLACE, c] = -1
        if is_held(rows, tried, mode, c):
            tried[_PLACE, c] = size
            size += 1
    for plane in rows.planes:
        c = plane[LEAD]
        if c < mq and slides_along(rows, tried, mode, c):
            tried[_PLACE, c] = size
            size += 1
            work[_TURNS, c] = resistance_to_turning(rows, space, c)
    for c in range(mq if afresh else 0):
        work[IMPULSE, c] = 0.0
        work[AFTER, c] = work[BEFORE, c]
    for c in range(mq):
        row = tried[_PLACE, c]
        if row < 0:
            continue
        for k in range(size):
            system[row, k] = 0.0
        moved = moved_on(work, c)
        if mode[c] != 0:
            # change of velocity that remains across a slip in a plane
            o = second_of(rows, c)
            f, g = axes_of(rows, space, c)
            moved = g * work[SENSE, c] * moved_on(work, o) - f * work[SENSE, o] * moved
        system[row, size] = -moved
    for c in range(mq):
        column = tried[_PLACE, c]
        if column < 0:
            continue
        if mode[c] != 0:
            put_turn(rows, space, mode, c)
            continue
        add_response(rows, space, mode, c, 1.0, column)
        for link in range(len(rows.links)):
            b = rows.links[link, RUBBING]
            if rows.links[link, PRESSING] == c and slides_along(rows, tried, mode, b):
                weight = -work[SENSE, b] * work[limit_of(tried, b, mode[b] > 0), link]
                add_response(rows, space, mode, b, weight, column)
        system[column, column] += _YIELDS * space.delassus[c, c]
    if not solve_equations(system, size):
        return np.inf
    return take_solution(rows, space, mode, size)


@compiled()
def add_response(rows: Rows, space: Space, mode: Array, b: int, weight: float, column: int) -> None:
    """Add the response to an impulse of contact b to all equations.

    Parameters
    ----------
    weight : float
        Part of the unknown that the impulse is.
    column : int
        Of the unknown.
    """
    work = space.impact
    G = space.delassus
    for c in range(rows.sizes[ON_INERTIAL]):
        row = space.tried[_PLACE, c]
        if row < 0:
            continue
        if mode[c] == 0:
            if rows.homes[c, PART] == rows.homes[b, PART]:
                space.impulses[row, column] += weight * G[c, b]
        else:
            o = second_of(rows, c)
            f, g = axes_of(rows, space, c)
            if rows.homes[c, PART] == rows.homes[b, PART]:
                space.impulses[row, column] -= weight * f * work[SENSE, o] * G[c, b]
            if rows.homes[o, PART] == rows.homes[b, PART]:
                space.impulses[row, column] += weight * g * work[SENSE, c] * G[o, b]


@compiled()
def put_turn(rows: Rows, space: Space, mode: Array, c: int) -> None:
    """The column of the turn of a slip in a plane: with n + τ/Λ_N t for its direction n, t across
    it, the impulse is −A(Λ_N n + τ t), and t·Aξ = ρ τ/Λ_N with ρ = n·Aξ.

    Parameters
    ----------
    space : Space
        Its equations receive it.
    c : int
        The contact, by its first direction.
    """
    work = space.impact
    o = second_of(rows, c)
    f, g = axes_of(rows, space, c)
    column = space.tried[_PLACE, c]
    add_response(rows, space, mode, c, f * work[SENSE, o], column)
    add_response(rows, space, mode, o, -g * work[SENSE, c], column)
    space.impulses[column, column] -= work[_TURNS, c]


@compiled()
def resistance_to_turning(rows: Rows, space: Space, c: int) -> float:
    """ρ/Λ_N of a slip in a plane, by its first direction; contacts that are hardly pressed do not
    turn."""
    work = space.impact
    o = second_of(rows, c)
    f, g = axes_of(rows, space, c)
    ahead = work[SENSE, c] * f * moved_on(work, c) + work[SENSE, o] * g * moved_on(work, o)
    pressed = pressed_by(rows, space, c)
    own = f * f * space.delassus[c, c] + g * g * space.delassus[o, o]
    turns = max(ahead, 0.0) / pressed if pressed > 0.0 else np.inf
    return float(min(turns, 1e8 * own) + _YIELDS * own)


@compiled()
def take_solution(rows: Rows, space: Space, mode: Array, size: int) -> float:
    """Store the impulses from the solution of the equations of a mode, and the velocities after
    them; returns the rotation of slips in planes."""
    work = space.impact
    tried = space.tried
    mq = rows.sizes[ON_INERTIAL]
    turned = 0.0
    for c in range(mq):
        place = tried[_PLACE, c]
        if place >= 0 and mode[c] == 0:
            work[IMPULSE, c] += space.impulses[place, size]
    for c in rows.lines:
        if c < mq and slides_along(rows, tried, mode, c):
            allowed = friction_of(rows, work, limit_of(tried, c, mode[c] > 0), c)
            work[IMPULSE, c] = -work[SENSE, c] * allowed
    for plane in rows.planes:
        c = plane[LEAD]
        if c >= mq or not slides_along(rows, tried, mode, c):
            continue
        o = second_of(rows, c)
        pressed = pressed_by(rows, space, c)
        if pressed > 0.0:
            turn = space.impulses[tried[_PLACE, c], size] / pressed
            # The equations are linear in the turn, which is therefore limited to 45°.
            turn = max(-1.0, min(1.0, turn))
            n, m = work[SENSE, c], work[SENSE, o]
            x, y = n - turn * m, m + turn * n
            length = math.hypot(x, y)
            work[SENSE, c], work[SENSE, o] = x / length, y / length
            turned = max(turned, abs(turn))
        f, g = axes_of(rows, space, c)
        work[IMPULSE, c] = -f * work[SENSE, c] * pressed
        work[IMPULSE, o] = -g * work[SENSE, o] * pressed
    put_velocities(rows, space)
    return turned


@compiled()
def change_modes(rows: Rows, space: Space, mode: Array, together: bool) -> int:
    """Number of contacts in a wrong mode; all of them, or only the first, are switched."""
    work = space.impact
    strong = 0.0
    fast = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        strong = max(strong, _WRONG * abs(work[IMPULSE, c]))
        fast = max(fast, _WRONG * abs(work[BEFORE, c]), _WRONG * abs(work[AFTER, c]))
    wrong = 0
    for c in inertial_contacts(rows):
        if not takes_part(rows, space.tried, c):
            continue
        better = right_mode(rows, space, mode, c, strong, fast)
        if better != mode[c]:
            wrong += 1
            if together or wrong == 1:
                set_mode(rows, mode, c, better)
    return wrong


@compiled()
def right_mode(rows: Rows, space: Space, mode: Array, c: int, strong: float, fast: float) -> int:
    """The mode that is consistent with the impulse and the velocity of a contact in its current
    mode.

    Parameters
    ----------
    strong, fast : float
        Impulses and velocities that are zero.
    """
    work = space.impact
    moved = moved_on(work, c)
    found = mode[c]
    # Friction under normal forces without an impulse may have any mode.
    if not is_free(rows, space.tried, mode, c):
        if len(directions_of(rows, c)) > 1:
            found = right_mode_in_plane(rows, space, mode, c, strong, fast)
        elif mode[c] == 0:
            least, most = interval_of(rows, space, c)
            if work[IMPULSE, c] < least - strong:
                found = 1
            elif work[IMPULSE, c] > most + strong:
                found = -1
            work[SENSE, c] = found
        else:
            found = 0 if mode[c] * moved < -fast else mode[c]
    return found


@compiled()
def right_mode_in_plane(
    rows: Rows, space: Space, mode: Array, c: int, strong: float, fast: float
) -> int:
    """The same for a contact in a plane.

    Parameters
    ----------
    space : Space
        Its direction becomes that of its impulse where it begins to slip.
    c : int
        The contact, by its first direction.
    strong, fast : float
        Impulses and velocities that are zero.
    """
    work = space.impact
    o = second_of(rows, c)
    f, g = axes_of(rows, space, c)
    larger = max(f, g)
    if mode[c] == 0:
        if not (f > 0.0 and g > 0.0):
            aim(rows, space, c, work[BEFORE, c], work[BEFORE, o])
            return 1
        x, y = work[IMPULSE, c] / f, work[IMPULSE, o] / g
        pressed = pressed_by(rows, space, c)
        size = math.hypot(x, y)
        if larger * (size - pressed) <= strong:
            return 0
        work[SENSE, c], work[SENSE, o] = -x / size, -y / size
        return 1
    ahead = work[SENSE, c] * f * moved_on(work, c) + work[SENSE, o] * g * moved_on(work, o)
    return 0 if ahead < -larger * fast else 1
