"""Impacts: when a gap closes with nonzero velocity, velocities jump, but positions do not.

Newton's law with Coulomb's friction, in impulses, for all contacts that are closed or closing
(γ: normal and tangential velocities before and after):

    0 ≤ Λ_N ⟂ γ_N⁺ + e_N γ_N⁻ ≥ 0,   Λ_T ∈ −μ Λ_N Sign(γ_T⁺ + e_T γ_T⁻),   M (q̇⁺ − q̇⁻) = JᵀΛ

(Ch. Glocker, *Set-Valued Force Laws*, 2001, chapter 10). In a mode of the contacts this is a
linear problem with Delassus' matrix G = J M⁻¹ Jᵀ: a contact that takes part asks for G Λ =
−(1 + e) γ⁻, one that slips has Λ_T = ∓μ Λ_N. All modes of the contacts concerned are tried; of
those that satisfy the law the one that loses most energy is taken. Contacts with a given threshold
have bounded forces and take no impulse.

*Which coefficient.* Slip has the kinetic one, at the speed before the impact. What is at rest
before slips only where static friction cannot hold it. What slides before stops only where kinetic
friction stops it, and from there on, back again, static friction counts: such a contact has the
kinetic coefficient against the sense in which it slid, and the static one along. In a plane, where
a slip turns and does not stop, it has the kinetic one. So it is with an elastic floor, however
stiff.

In a plane slip has Λ_T = −μ Λ_N A n with n along w = μA(γ_T⁺ + e_T γ_T⁻), which that impulse
changes itself: (ρ + D) n = w + D n with D = μA G_TT μA Λ_N is a secular equation, as where a slip
begins, and gives n from any other; several take turns.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.motion.algebra.vectors import solve_equations
from stickslip.motion.steps.arrays import (
    BACK,
    CONTACTS,
    COORDINATES,
    FIRST_ROW,
    FORWARD,
    HOLDS_BACK,
    HOLDS_FORWARD,
    INERTIAL,
    LEAD,
    MEMBERS,
    ON_INERTIAL,
    PART,
    PRESSING,
    RUBBING,
    SENSE,
    Rows,
    Space,
)
from stickslip.motion.steps.contacts import (
    direction_entry,
    directions_of,
    inertial_contacts,
    loosen_friction,
    set_mode,
)
from stickslip.motion.steps.sets import second_of
from stickslip.motion.steps.starting import secular_root
from stickslip.numerics.levels import EPSILON, IMPACT_ZERO, NO_SPEED
from stickslip.translator import compiled

# Rows of Space.impact: velocities of contacts before and after, impulses, and the restitution that
# counts; by coordinate, the change of the rates; the best impulses so far; and in SENSE, behind
# them, the sign of what slips, or its direction n in a plane.
BEFORE, AFTER, IMPULSE, RESTITUTION, CHANGE, BEST = range(6)
# … and in FORWARD and BACK coefficients of friction against slip in either sense, and in
# HOLDS_FORWARD and HOLDS_BACK how much friction holds.
# Rows of Space.tried: which contacts take part, the mode before, and the best mode so far.
NEAR, MODE_BEFORE, CHOSEN = range(3)
MOST_MODES = 65536  # largest number of modes that are tried
_MOST_TURNS = 60  # largest number of iterations for the directions in planes
_HOLDS = 1e-8  # velocity of a held contact relative to the largest velocity


@compiled()
def is_pressed(rows: Rows, tried: Array, c: int) -> bool:
    """Whether a contact rubs under the normal force of one that takes part."""
    for link in range(rows.first_link[c], rows.first_link[c + 1]):
        if tried[NEAR, rows.links[link, PRESSING]] == 1:
            return True
    return False


@compiled()
def takes_part(rows: Rows, tried: Array, c: int) -> bool:
    """Whether a contact may have an impulse: it is near, or the friction of one that is."""
    return bool(tried[NEAR, c] == 1 or is_pressed(rows, tried, c))


@compiled()
def friction_of(rows: Rows, work: Array, sense: int, c: int) -> float:
    """The impulse of friction that normal impulses allow: Σ μ Λ_N, with the coefficients in a row
    of the work space."""
    total = 0.0
    for link in range(rows.first_link[c], rows.first_link[c + 1]):
        total += work[sense, link] * work[IMPULSE, rows.links[link, PRESSING]]
    return total


@compiled()
def put_restitution(rows: Rows, space: Space) -> None:
    """The declared restitution of all contacts."""
    for c in range(rows.sizes[ON_INERTIAL]):
        row = rows.restitution[c]
        space.impact[RESTITUTION, c] = 0.0 if row < 0 else space.V[row, 0]


@compiled()
def let_recede(rows: Rows, space: Space) -> None:
    """A gap that grows before an impact has no restitution: γ⁺ ≥ −e γ⁻ would allow an approach."""
    for c in rows.openings:
        if space.impact[BEFORE, c] > 0.0:
            space.impact[RESTITUTION, c] = 0.0


@compiled()
def put_friction(rows: Rows, space: Space) -> None:
    """Coefficients of friction in an impact, of slip and where it holds."""
    work = space.impact
    for c in inertial_contacts(rows):
        block = directions_of(rows, c)
        forward = False
        back = False
        for i in block:
            slow = NO_SPEED * space.mag[i]
            forward = forward or work[BEFORE, i] > slow
            back = back or work[BEFORE, i] < -slow
        alone = len(block) == 1
        if not alone:
            # In a plane a slip has no sign and cannot reverse.
            forward = back = forward or back
        for side in range(2):
            slid, turned = (forward, back) if side == 0 else (back, forward)
            returns = turned and alone
            for link in range(rows.first_link[c], rows.first_link[block[len(block) - 1] + 1]):
                kinetic = space.V[rows.friction[link, side], 0]
                static = space.V[rows.friction[link, 2 + side], 0]
                work[FORWARD + side, link] = static if returns else kinetic
                work[HOLDS_FORWARD + side, link] = kinetic if slid else static


@compiled()
def put_part(rows: Rows, space: Space, J: Array, p: int, every: bool) -> None:
    """The same for one component, whose inverse is in the work space.

    Parameters
    ----------
    J : array
        Directions that do not change.
    p : int
        The component.
    every : bool
        Whether all contacts are asked for, and not only those that take part.
    """
    n = rows.parts[p, COORDINATES]
    m = rows.parts[p, CONTACTS]
    first = rows.parts[p, FIRST_ROW]
    members = rows.members[rows.parts[p, MEMBERS] :]
    for j in range(m):
        c = members[n + j]
        if not (every or takes_part(rows, space.tried, c)):
            continue
        for i in range(n):
            space.response[members[i], c] = 0.0
        for other in range(m):
            space.delassus[members[n + other], c] = 0.0
        # Directions have few entries that are not zero.
        for k in range(n):
            weight = direction_entry(rows, J, space.V, c, k)
            if weight != 0.0:
                for i in range(n):
                    space.response[members[i], c] += space.Rq[first + i, k] * weight
    for other in range(m):
        b = members[n + other]
        for i in range(n):
            weight = direction_entry(rows, J, space.V, b, i)
            if weight == 0.0:
                continue
            for j in range(m):
                c = members[n + j]
                if every or takes_part(rows, space.tried, c):
                    space.delassus[b, c] += weight * space.response[members[i], c]


@compiled()
def try_impulses(rows: Rows, space: Space, mode: Array, number: int) -> tuple[bool, float, float]:
    """Impulses in the mode with a number: whether they obey the law, the energy gained, and the
    size of its terms.

    Parameters
    ----------
    space : Space
        With the responses to unit impulses.
    mode : array of int
        Receives the mode.
    """
    choose_impulse_mode(number, rows, space.tried, mode)
    aim_impulses(rows, space, mode)
    for _ in range(_MOST_TURNS):
        if not solve_impulses(rows, space, mode):
            return False, 0.0, 0.0
        put_velocities(rows, space)
        if not turn_impulses(rows, space, mode):
            break
    gained, size, right = judge_impulses(rows, space.impact, space.tried, mode)
    return right and residual_of(rows, space, mode) <= _HOLDS, gained, size


@compiled()
def residual_of(rows: Rows, space: Space, mode: Array) -> float:
    """Largest velocity after an impact of contacts that should be at rest, relative to the largest
    of all. Equations of deficient rank may have solutions that are rounding errors."""
    work = space.impact
    most = 0.0
    fastest = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        fastest = max(fastest, abs(work[BEFORE, c]), abs(work[AFTER, c]))
        if is_held(rows, space.tried, mode, c):
            most = max(most, abs(moved_on(work, c)))
    return most / fastest if fastest > 0.0 else 0.0


@compiled()
def aim_impulses(rows: Rows, space: Space, mode: Array) -> None:
    """The sense in which friction slips in a mode; in a plane that of velocities before."""
    work = space.impact
    for c in range(rows.sizes[ON_INERTIAL]):
        work[SENSE, c] = mode[c]
    for plane in rows.planes:
        c = plane[LEAD]
        if slides_along(rows, space.tried, mode, c):
            f, g = axes_in(rows, work, FORWARD, c)
            point_along(rows, work, c, f * work[BEFORE, c], g * work[BEFORE, second_of(rows, c)])


@compiled()
def axes_in(rows: Rows, work: Array, row: int, c: int) -> tuple[float, float]:
    """Half axes of the ellipse of impulses of a contact in a plane, in parts of the normal impulse,
    with the coefficients in a row of the work space."""
    o = second_of(rows, c)
    return float(work[row, rows.first_link[c]]), float(work[row, rows.first_link[o]])


@compiled()
def point_along(rows: Rows, work: Array, c: int, x: float, y: float) -> None:
    """Set the slip direction of a contact in a plane to that of a vector, or to its first direction
    if the vector vanishes.

    Parameters
    ----------
    work : array
        As in :class:`stickslip.motion.steps.arrays.Space`.
    c : int
        The contact, by its first direction.
    x, y : float
        The vector.
    """
    size = math.hypot(x, y)
    work[SENSE, c] = x / size if size > 0.0 else 1.0
    work[SENSE, second_of(rows, c)] = y / size if size > 0.0 else 0.0


@compiled()
def turn_impulses(rows: Rows, space: Space, mode: Array) -> bool:
    """Turn slips in planes into their directions after the impact; whether that changes them."""
    work = space.impact
    G = space.delassus
    change = 0.0
    for plane in rows.planes:
        c = plane[LEAD]
        if not slides_along(rows, space.tried, mode, c):
            continue
        o = second_of(rows, c)
        f, g = axes_in(rows, work, FORWARD, c)
        if not friction_of(rows, work, FORWARD, c) > 0.0:
            continue
        # All normal forces of a contact in a plane have the same coefficient.
        pressed = friction_of(rows, work, FORWARD, c) / f
        # w + D n, the same for every n
        n, m = work[SENSE, c], work[SENSE, o]
        a, b, d = f * G[c, c] * f * pressed, f * G[c, o] * g * pressed, g * G[o, o] * g * pressed
        x = f * moved_on(work, c) + a * n + b * m
        y = g * moved_on(work, o) + b * n + d * m
        work[SENSE, c], work[SENSE, o], _ = secular_root(a, b, d, x, y, g / f)
        change = max(change, abs(work[SENSE, c] - n) + abs(work[SENSE, o] - m))
    return change > 4.0 * EPSILON


@compiled()
def moved_on(work: Array, c: int) -> float:
    """γ⁺ + e γ⁻ of a contact."""
    return float(work[AFTER, c] + work[RESTITUTION, c] * work[BEFORE, c])


@compiled()
def is_held(rows: Rows, tried: Array, mode: Array, c: int) -> bool:
    """Whether the velocity of a contact after an impact is asked for, so that its impulse is
    unknown."""
    return bool(mode[c] == 0 and takes_part(rows, tried, c) and not is_free(rows, tried, mode, c))


@compiled()
def is_free(rows: Rows, tried: Array, mode: Array, c: int) -> bool:
    """Whether a contact rubs, but only under normal forces that have no impulse."""
    first, end = rows.first_link[c], rows.first_link[c + 1]
    for link in range(first, end):
        normal = rows.links[link, PRESSING]
        if tried[NEAR, normal] == 1 and mode[normal] == 0:
            return False
    return bool(end > first)


@compiled()
def slips_towards(mode: Array, c: int) -> int:
    """The row of coefficients of friction of a sliding contact in an impact."""
    return FORWARD if mode[c] > 0 else BACK


@compiled()
def slides_along(rows: Rows, tried: Array, mode: Array, c: int) -> bool:
    """Whether a contact rubs in an impact."""
    if mode[c] == 0:
        return False
    for link in range(rows.first_link[c], rows.first_link[c + 1]):
        normal = rows.links[link, PRESSING]
        if tried[NEAR, normal] == 1 and mode[normal] == 0:
            return True
    return False


@compiled()
def solve_impulses(rows: Rows, space: Space, mode: Array) -> bool:
    """Impulses in a mode; False if they are not determined.

    Parameters
    ----------
    space : Space
        With the responses; receives the impulses.
    """
    work = space.impact
    tried = space.tried
    G = space.delassus
    system = space.impulses
    mq = rows.sizes[ON_INERTIAL]
    size = 0
    for a in range(mq):
        work[IMPULSE, a] = 0.0
        if not is_held(rows, tried, mode, a):
            continue
        column = 0
        for b in range(mq):
            if is_held(rows, tried, mode, b):
                # A contact that slides under b has the impulse μΛ_b against its slip, which changes
                # the velocity of a, too.
                entry = G[a, b]
                for link in range(len(rows.links)):
                    c = rows.links[link, RUBBING]
                    if rows.links[link, PRESSING] == b and slides_along(rows, tried, mode, c):
                        entry -= work[SENSE, c] * work[slips_towards(mode, c), link] * G[a, c]
                system[size, column] = entry
                column += 1
        # Newton's law, γ⁺ = −e γ⁻.
        system[size, column] = -(1.0 + work[RESTITUTION, a]) * work[BEFORE, a]
        size += 1
    if not solve_equations(system, size):
        return False
    place = 0
    for c in range(mq):
        if is_held(rows, tried, mode, c):
            work[IMPULSE, c] = system[place, size]
            place += 1
    for c in range(mq):
        if slides_along(rows, tried, mode, c):
            allowed = friction_of(rows, work, slips_towards(mode, c), c)
            work[IMPULSE, c] = -work[SENSE, c] * allowed
    return True


@compiled()
def put_velocities(rows: Rows, space: Space) -> None:
    """Velocities of contacts after impulses."""
    work = space.impact
    mq = rows.sizes[ON_INERTIAL]
    for c in range(mq):
        work[AFTER, c] = work[BEFORE, c]
    for b in range(mq):
        if work[IMPULSE, b] != 0.0:
            for c in range(mq):
                if rows.homes[c, PART] == rows.homes[b, PART]:
                    work[AFTER, c] += space.delassus[c, b] * work[IMPULSE, b]


@compiled()
def set_in_motion(rows: Rows, space: Space, mode: Array) -> int:
    """Number of contacts that slip in a mode, were at rest, and have static above kinetic
    friction."""
    work = space.impact
    found = 0
    for c in inertial_contacts(rows):
        side = 0 if mode[c] > 0 else 1
        if slides_along(rows, space.tried, mode, c):
            drops = False
            for link in range(rows.first_link[c], rows.first_link[c + 1]):
                drops = drops or work[FORWARD + side, link] < work[HOLDS_FORWARD + side, link]
            found += 1 if drops else 0
    return found


@compiled()
def put_change(rows: Rows, space: Space) -> None:
    """The change of the rates by impulses."""
    work = space.impact
    for q in range(rows.sizes[INERTIAL]):
        work[CHANGE, q] = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        if work[IMPULSE, c] == 0.0:
            continue
        p = rows.homes[c, PART]
        for i in range(rows.parts[p, COORDINATES]):
            q = rows.members[rows.parts[p, MEMBERS] + i]
            work[CHANGE, q] += space.response[q, c] * work[IMPULSE, c]


@compiled()
def modes_of(rows: Rows, tried: Array) -> int:
    """Number of modes of an impact: closed contacts take part or not, their friction sticks or
    slips."""
    total = 1
    for c in range(rows.sizes[ON_INERTIAL]):
        if total <= MOST_MODES and takes_part(rows, tried, c):
            total *= rows.states[c]
    return total


@compiled()
def choose_impulse_mode(number: int, rows: Rows, tried: Array, mode: Array) -> None:
    """Set the contacts to the mode with a number; contacts that do not take part slip."""
    for c in range(rows.sizes[ON_INERTIAL]):
        mode[c] = 1
    for c in inertial_contacts(rows):
        if takes_part(rows, tried, c):
            states = int(rows.states[c])
            set_mode(rows, mode, c, number % states - states // 3)
            number //= states
    loosen_friction(rows, mode)


@compiled()
def judge_impulses(rows: Rows, work: Array, tried: Array, mode: Array) -> tuple[float, float, bool]:
    """Energy gained, the size of its terms, and whether impulses obey the law.

    Parameters
    ----------
    work, tried : arrays
        As in :class:`stickslip.motion.steps.arrays.Space`.
    mode : array of int
        Of the impact.
    """
    gained = 0.0
    size = 0.0
    largest = 0.0
    fastest = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        largest = max(largest, abs(work[IMPULSE, c]))
        fastest = max(fastest, abs(work[BEFORE, c]), abs(work[AFTER, c]))
        # The work of an impulse is its product with the mean of the velocities before and after.
        gained += 0.5 * work[IMPULSE, c] * (work[BEFORE, c] + work[AFTER, c])
        size += 0.5 * abs(work[IMPULSE, c]) * (abs(work[BEFORE, c]) + abs(work[AFTER, c]))
    strong = IMPACT_ZERO * largest
    fast = IMPACT_ZERO * fastest
    right = True
    for c in inertial_contacts(rows):
        moved = moved_on(work, c)
        if tried[NEAR, c] == 1:
            right = right and (work[IMPULSE, c] >= -strong if mode[c] == 0 else moved >= -fast)
        elif not is_pressed(rows, tried, c) or is_free(rows, tried, mode, c):
            continue
        elif len(directions_of(rows, c)) > 1:
            right = right and obeys_in_plane(rows, work, mode, c, strong, fast)
        elif mode[c] == 0:
            least = -friction_of(rows, work, HOLDS_FORWARD, c)
            most = friction_of(rows, work, HOLDS_BACK, c)
            right = right and least - strong <= work[IMPULSE, c] <= most + strong
        else:
            right = right and mode[c] * moved >= -fast
    return gained, size, right


@compiled()
def obeys_in_plane(
    rows: Rows, work: Array, mode: Array, c: int, strong: float, fast: float
) -> bool:
    """Whether the impulse of a contact in a plane obeys Coulomb's law.

    Parameters
    ----------
    work : array
        As in :class:`stickslip.motion.steps.arrays.Space`.
    c : int
        The contact, by its first direction.
    strong, fast : float
        Impulses and velocities that are zero.
    """
    o = second_of(rows, c)
    f, g = axes_in(rows, work, HOLDS_FORWARD if mode[c] == 0 else FORWARD, c)
    if mode[c] == 0:
        x, y = work[IMPULSE, c], work[IMPULSE, o]
        if not f > 0.0:
            return bool(math.hypot(x, y) <= strong)
        larger = max(f, g)
        held = math.hypot(x / f, y / g) * larger
        return bool(held <= larger * friction_of(rows, work, HOLDS_FORWARD, c) / f + strong)
    n, m = work[SENSE, c], work[SENSE, o]
    x, y = f * moved_on(work, c), g * moved_on(work, o)
    little = max(f, g) * fast
    return bool(n * x + m * y >= -little and abs(n * y - m * x) <= little)


@compiled()
def largest_jump(rows: Rows, work: Array) -> float:
    """The largest jump of the velocity of a contact in an impact."""
    largest = 0.0
    for c in range(rows.sizes[ON_INERTIAL]):
        largest = max(largest, abs(work[AFTER, c] - work[BEFORE, c]))
    return largest


@compiled()
def guess_mode(rows: Rows, tried: Array, work: Array, mode: Array) -> None:
    """A first guess of the mode after an impact: contacts that have rebounded are open; the others
    are closed, and stick if they are at rest."""
    # Rounding errors are relative to the jump, not to the speed at which a contact continues to
    # slide.
    largest = largest_jump(rows, work)
    for c in rows.openings:
        if tried[NEAR, c] == 1:
            after = work[AFTER, c]
            if tried[CHOSEN, c] == 0:
                after = -work[RESTITUTION, c] * work[BEFORE, c]
            mode[c] = 1 if after > IMPACT_ZERO * largest else 0
    for c in range(rows.sizes[ON_INERTIAL]):
        if is_pressed(rows, tried, c):
            mode[c] = tried[CHOSEN, c]
    loosen_friction(rows, mode)
