"""Which mode the motion takes, and its Taylor coefficients.

One rule decides every mode, at the start, at an event and at a corner where several contacts stand
on their boundary: **a mode is right if all its guards are nonnegative for a short while**, that is,
if the first Taylor coefficient of each guard that is not zero is positive. The guards of a stick
are λ + s⁺ and s⁻ − λ, of a slip σu, of a region its signed kink function. This is the
complementarity problem of the force law in the ordered field of germs (of Taylor series), so a
principal pivoting method (Murty: flip the violated switch of least index) finds its solution. Its
leading order is the convex minimisation of the accelerations, velocities or rates.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.series import INDEFINITE, SINGULAR, invert, shared_inverse
from stickslip.motion.admissible.sharing import ON_ITS_OWN, STAYS, grip, is_gripped, partner
from stickslip.motion.engine.guards import (
    NUMBER,
    contact_of,
    is_second,
    scan,
    stays,
)
from stickslip.motion.steps.arrays import (
    AIM,
    ASTRAY,
    BENDS,
    CAUSE,
    COMPONENT,
    CONTACTS,
    COORDINATES,
    DIMENSION,
    EPSILON,
    FIRED,
    FIRST_ROW,
    IMPLICIT,
    INERTIAL,
    INSTANT,
    KINKS,
    LAST,
    MASSIVE,
    MATRIX,
    MEMBERS,
    MOVING,
    NAN,
    NOW,
    NOWHERE,
    OFF_SURFACE,
    OK,
    ON_INERTIAL,
    ON_RATE_INDEPENDENT,
    ON_VISCOUS,
    OTHER,
    OVERFLOW,
    PART,
    PRESSING,
    PROMISED,
    RATE_INDEPENDENT,
    RECENT,
    ROUNDING,
    SEAT,
    SERIES,
    SPAN,
    UNIT,
    VISCOUS,
    Constants,
    Flow,
    Instant,
    Lane,
    Machine,
    Rows,
    Space,
    direction_entry,
    gap_size,
    is_component,
    is_loose,
    loosen_friction,
    opens,
    own_inverse,
    presses,
    set_mode,
)
from stickslip.motion.steps.starting import coefficients
from stickslip.motion.steps.step_size import (
    COARSER,
    LEAST_SIZE,
    MOST_UNITS,
    better,
    fill_powers,
    shortened_step,
    step_size,
    suits,
)
from stickslip.motion.steps.stiff import RESTING, collocate, lingers
from stickslip.motion.steps.vectors import is_new
from stickslip.translator import compiled

_MOST_CANDIDATES = 60000
_SLACKEST = 1e6  # rounding errors that count as zero where less lets no mode go on
# what may be said of a mode instead of the number of a violated guard
_NO_GUARD = -1
_OTHER_FORCES = -2
_AGAIN = -3
_ON_SURFACE = 1e-9  # part of its terms by which what has to vanish may be away from zero
_NOTHING = 1e-250  # a velocity, or a place, that is none in any units
_MOST_STOPS = 24  # until what rounding errors leave is below the least number that there is
_WIDE = 4.0  # of a step: a velocity that is zero to slip is zero to stick, whose terms are others
_TOGETHER = 16  # times that the switches of different components are flipped together
_PAST = 1.0625  # of the time to a kink: the end of the step in which it comes
# parts of a step, and of the time, within which a kink is the one that has been passed
_PASSED, _ROUNDED = 1e-12, 1e3 * EPSILON
_DEPENDENT = 1e-20  # square of the part of a direction that is none of others
_LOOSELY = 1e-3  # of the tolerance, where that is loose
_TOUCHING = 1e-12  # part of its size, and of what it does in a step, below which a gap is zero
_LOOSER = 1e4  # tolerances by which the rates at the end of a step may break its promise


@compiled()
def resolvent(
    A: Array,
    J: Array,
    links: Array,
    first_link: Array,
    group: Array,
    members: Array,
    n: int,
    m: int,
    mode: Array,
    scratch: Array,
    R: Array,
) -> bool:
    """Inverse of [[A, −Jᵀ], [stick: J, 0; slip: 0, 1]] for the coordinates and contacts of one
    component; what slips under a normal force has σμ in its column.

    Parameters
    ----------
    A, J : arrays
        Mass matrix, or viscous matrix, and contact directions: rows of all coordinates and
        contacts, with a column for each coordinate of their component; the last ones of J have
        coefficients of friction.
    links, first_link : arrays of int
        What rubs under which normal forces.
    group : array of int
        The contacts that each may share its force with, or negative.
    members : array of int, shape (n + m,)
        The coordinates, then the contacts.
    n, m : int
        Numbers of them.
    mode : array of int, shape (contacts,)
    scratch : array
        Work space, at least of shape (n + m + 3, n + m).
    R : array
        Receives the inverse in its first rows and columns.

    Returns
    -------
    bool
        False if there is none.
    """
    shared = False
    for i in range(n + m):
        for j in range(n + m):
            scratch[i, j] = 0.0
    for i in range(n):
        for j in range(n):
            scratch[i, j] = A[members[i], j]
        for c in range(m):
            scratch[i, n + c] = -J[members[n + c], i]
    for c in range(m):
        if mode[members[n + c]] == 0:
            for i in range(n):
                scratch[n + c, i] = J[members[n + c], i]
            if group[members[n + c]] >= 0:
                shared = True
                scratch[n + c, n + c] = -J[members[n + c], J.shape[1] - 2]
        else:
            scratch[n + c, n + c] = 1.0
            own = members[n + c]
            sense = 1.0 if mode[own] > 0 else -1.0
            for link in range(first_link[own], first_link[own + 1]):
                coefficient = J[own, friction_column(J, link - first_link[own])]
                for other in range(m):
                    if members[n + other] == links[link, PRESSING]:
                        scratch[n + c, n + other] = sense * coefficient
    return shared_inverse(scratch, n + m, R, False) if shared else invert(scratch, n + m, R)


@compiled()
def friction_column(J: Array, k: int) -> int:
    """The column of J with the coefficient of friction under the k-th of the normal forces that
    press a contact: the last one, then those before its strength and its axis."""
    last = J.shape[1] - 1
    return last if k == 0 else last - 2 - k


@compiled()
def resolve(rows: Rows, k: Constants, space: Space, mode: Array) -> bool:
    """Bring the inverses of the linear problems up to date with the mode, component by component;
    False if one is singular."""
    known = space.known
    last = len(known) - 1
    fresh = known[last] != 0
    for p in range(len(rows.parts)):
        if rows.parts[p, MOVING] == 1:
            continue  # inverted with each series
        n = rows.parts[p, COORDINATES]
        m = rows.parts[p, CONTACTS]
        first = rows.parts[p, MEMBERS]
        changed = fresh
        for i in range(first + n, first + n + m):
            c = rows.members[i]
            changed = changed or known[c] != mode[c]
        if not changed:
            continue
        known[last] = 1
        for i in range(first + n, first + n + m):
            known[rows.members[i]] = mode[rows.members[i]]
        inertial = rows.parts[p, MATRIX] == 0
        if not resolvent(
            k.M if inertial else k.C,
            k.J,
            rows.links,
            rows.first_link,
            rows.group,
            rows.members[first:],
            n,
            m,
            mode,
            space.scratch,
            (space.Rq if inertial else space.Rz)[rows.parts[p, FIRST_ROW] :],
        ):
            return False
    known[last] = 0
    return True


@compiled()
def project_rates(machine: Machine, flow: Flow, at: Instant) -> int:
    """Put sliding rate-independent coordinates back on λ + σ s = 0 (one Newton step: they are there
    up to rounding)."""
    sizes = flow.rows.sizes
    space = flow.space
    mode = at.mode
    nr = sizes[RATE_INDEPENDENT]
    first = sizes[ON_INERTIAL] + sizes[ON_VISCOUS]
    offset = 2 * sizes[INERTIAL] + sizes[VISCOUS]
    G = space.G
    sliding = False
    for i in range(nr):
        sliding = sliding or mode[first + i] != 0
    if not sliding:
        return OK
    machine.residual(at.t, at.y, mode, at.reg, flow.k.K, G, space.A)
    for i in range(nr):
        if mode[first + i] != 0 and not abs(G[i]) <= _ON_SURFACE * G[nr + i]:
            return OFF_SURFACE
    if not invert(space.A, nr, space.B):
        return SINGULAR
    for i in range(nr):
        for j in range(nr):
            at.y[offset + i] -= space.B[i, j] * G[j]
    return OK


@compiled()
def release_or_hold(flow: Flow, at: Instant, last: float, near: float, span: float) -> bool:
    """Put sticking inertial contacts exactly on the surface speed; one that is not there (it cannot
    jump) slips.

    Parameters
    ----------
    last, near : float
        Length of recent steps, and of the longest step for which slip was denied here: what was
        zero to that is zero to stick, or else neither would go on.
    span : float
        Time that the motion may last.

    Returns
    -------
    bool
        False if contacts were released, one of each component, so that the mode has changed.
    """
    rows = flow.rows
    space = flow.space
    W = space.W
    mag = space.mag
    mode = at.mode
    asked = space.asked
    mq = rows.sizes[ON_INERTIAL]
    released = False
    clear(asked)
    for c in range(mq):
        if mode[c] != 0:
            continue
        gap = W[rows.u[c], 0]
        rate = held_back(rows, space, c)
        slow = (_ON_SURFACE * last + _WIDE * ROUNDING * near) * rate + ROUNDING * mag[c]
        if opens(rows, c):
            slow += _WIDE * ROUNDING * mag[c]
            if len(rows.planes) > 0:
                # Towards the end of a slip steps are as short as a rounding error of the time.
                slow += _WIDE * INSTANT * abs(at.t) * rate
        if rows.plane[c] >= 0:
            # Both components together have come to rest.
            first, second = rows.planes[rows.plane[c], COMPONENT], rows.planes[rows.plane[c], OTHER]
            rate = held_back(rows, space, first) + held_back(rows, space, second)
            slow = (_ON_SURFACE * last + _WIDE * ROUNDING * near) * rate
            slow += _WIDE * (ROUNDING * (mag[first] + mag[second]) + INSTANT * abs(at.t) * rate)
        if abs(gap) > slow or is_apart(flow, c, last, span):
            # Contacts of other components hold the same whether this one does or not.
            if asked[rows.homes[c, PART]] == 0:
                set_mode(rows, mode, c, 1 if gap > 0.0 or opens(rows, c) else -1)
            asked[rows.homes[c, PART]] = 1
            released = True
    if released:
        return False
    for c in range(mq):
        if mode[c] == 0:
            stop(flow, W, at.y, mode, c)
        if mode[c] == 0 and opens(rows, c):
            # What is closed stays on the surface itself, too.
            part = rows.homes[c, PART]
            first = rows.parts[part, FIRST_ROW]
            distance = W[rows.gaps[c], 0]
            for i in range(rows.parts[part, COORDINATES]):
                q = rows.members[rows.parts[part, MEMBERS] + i]
                at.y[q] -= space.Rq[first + i, rows.homes[c, SEAT] - first] * distance
                if len(rows.planes) > 0 and abs(at.y[q]) <= _NOTHING:
                    at.y[q] = 0.0
    return True


@compiled()
def stop(flow: Flow, table: Array, y: Array, mode: Array, c: int) -> None:
    """Take what is left of the velocity of a sticking contact, relative to its surface, out of the
    rates.

    Parameters
    ----------
    flow : Flow
        With the inverses of the mode.
    table : array
        Values of the rows.
    y : array
        State; its rates are changed.
    mode : array of int, shape (contacts,)
    c : int
        The contact.
    """
    rows = flow.rows
    R = flow.space.Rq
    u = table[rows.u[c], 0]
    if is_on_surface(flow, table, c):
        return
    part = rows.homes[c, PART]
    one = two = c
    if rows.plane[c] >= 0:
        one, two = rows.planes[rows.plane[c], COMPONENT], rows.planes[rows.plane[c], OTHER]
    first = rows.parts[part, FIRST_ROW]
    for i in range(rows.parts[part, COORDINATES]):
        if is_rubbed(flow, table, mode, c, i):
            continue
        q = rows.sizes[INERTIAL] + rows.members[rows.parts[part, MEMBERS] + i]
        y[q] -= R[first + i, rows.homes[c, SEAT] - first] * u
        if len(rows.planes) > 0:
            # What is left of rounding errors, of either component, is nothing. The other one may
            # move coordinates of another part only.
            size = 0.0
            for d in (one, two):
                if rows.homes[d, PART] == part:
                    size += abs(R[first + i, rows.homes[d, SEAT] - first])
            size *= abs(table[rows.u[one], 0]) + abs(table[rows.u[two], 0])
            if abs(y[q]) <= max(ROUNDING * size, _NOTHING):
                y[q] = 0.0


@compiled()
def is_on_surface(flow: Flow, table: Array, c: int) -> bool:
    """Whether a sticking contact has the velocity of its surface: exactly; or, where there is
    friction in a plane, up to rounding. Nothing would be gained there, and an impulse that puts it
    onto its surface moves what begins to slip beside it, from rest.

    Parameters
    ----------
    flow : Flow
    table : array
        Values of the rows, with their sizes in the work space.
    c : int
    """
    rows = flow.rows
    near = ROUNDING * flow.space.mag[c] if len(rows.planes) > 0 else 0.0
    return bool(abs(table[rows.u[c], 0]) <= near)


@compiled()
def is_rubbed(flow: Flow, table: Array, mode: Array, c: int, i: int) -> bool:
    """Whether a slip in a plane, under the normal force of a contact, moves a coordinate of their
    component.

    What puts the contact back onto its surface is no impulse, and moves nothing else: a slip that
    begins is at rest, exactly. Where friction changes the normal force, they move the same, and
    only a slip that begins has nothing taken from it.

    Parameters
    ----------
    flow : Flow
    table : array
        Values of the rows.
    mode : array of int, shape (contacts,)
    c, i : int
        The contact, and the place of the coordinate in the component.
    """
    rows, J = flow.rows, flow.k.J
    for plane in rows.planes:
        first = plane[COMPONENT]
        if mode[first] == 0 or not presses(rows, c, first):
            continue
        if plane[BENDS] == 0 or table[plane[AIM] + 2, 0] == 0.0:
            x = direction_entry(rows, J, table, first, i)
            y = direction_entry(rows, J, table, plane[OTHER], i)
            if x != 0.0 or y != 0.0:
                return True
    return False


@compiled()
def held_back(rows: Rows, space: Space, c: int) -> float:
    """The acceleration that a sticking contact holds back, or could."""
    mag = space.mag
    nc = len(rows.u)
    return float(mag[nc + c] + mag[2 * nc + c] / abs(own_inverse(rows, space, c)))


@compiled()
def is_apart(flow: Flow, c: int, last: float, span: float) -> bool:
    """Whether a contact that can open is not closed, up to what its gap does in a step and to
    rounding, or as it is where it has just closed; what rounding errors of forces have made of a
    gap is no faster than they are."""
    rows = flow.rows
    space = flow.space
    if not opens(rows, c):
        return False
    if not is_wide(flow, c, last):
        return False
    drift = abs(space.W[rows.u[c], 0])
    drifts = drift <= ROUNDING * held_back(rows, space, c) * span
    return not (drifts and abs(space.W[rows.gaps[c], 0]) <= drift * span)


@compiled()
def is_wide(flow: Flow, c: int, last: float) -> bool:
    """Whether the gap of a contact is more than what a step, or rounding, makes of it."""
    closed = max(touching(flow, c, last), FIRED * gap_size(flow.rows, flow.space, c))
    return bool(abs(flow.space.W[flow.rows.gaps[c], 0]) > closed)


@compiled()
def touching(flow: Flow, c: int, last: float) -> float:
    """The distance below which a contact is closed: a part of its gap's size, and of what
    velocities and forces do to it in a step."""
    mag = flow.space.mag
    moved = last * (mag[c] + last * mag[len(flow.rows.u) + c])
    return float(max(_TOUCHING, _LOOSELY * flow.tol) * (gap_size(flow.rows, flow.space, c) + moved))


@compiled()
def evaluate_mode(
    machine: Machine, flow: Flow, at: Instant, last: float, near: float, span: float, hold: bool
) -> int:
    """Taylor coefficients of the motion in a mode; y is put back onto the constraints of the
    mode.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    at : Instant
        Its state is put back, and its mode is changed where a contact that is not at rest slips.
    last, near, span : float
        As in :func:`release_or_hold`.
    hold : bool
        Whether sticking contacts are put onto the surface speed.

    Returns
    -------
    int
        OK, SINGULAR, INDEFINITE, NAN, OFF_SURFACE or OVERFLOW.
    """
    W = flow.space.W
    rows = flow.rows
    while True:
        loosen_friction(rows, at.mode)
        if not resolve(rows, flow.k, flow.space, at.mode):
            return SINGULAR
        sticking = False
        for c in range(rows.sizes[ON_INERTIAL]):
            sticking = sticking or at.mode[c] == 0
        if not sticking or not hold:
            break
        status = coefficients(machine, flow, at, 1, W)
        if status != OK:
            return status
        if release_or_hold(flow, at, last, near, span) and not rest_with_others(machine, flow, at):
            break
    if rows.sizes[RATE_INDEPENDENT] > 0:
        status = project_rates(machine, flow, at)
        if status != OK:
            return status
    status = coefficients(machine, flow, at, flow.order, W)
    if status != OK:
        return status
    return judge_coefficients(rows, W, flow.order)


@compiled()
def rest_with_others(machine: Machine, flow: Flow, at: Instant) -> bool:
    """Let contacts stick that the others of their body do not let move, where their speed cannot be
    told from nothing; whether there are any.

    Parameters
    ----------
    machine : Machine
    flow : Flow
        With the inverses of the mode.
    at : Instant
        Its mode is changed.
    """
    rows = flow.rows
    mode = at.mode
    mag = flow.space.mag
    nc = len(rows.u)
    known = False
    found = False
    for c in range(rows.sizes[ON_INERTIAL]):
        group = rows.group[c]
        if group < 0 or mode[c] == 0 or is_component(rows, c) or is_loose(rows, mode, c):
            continue
        rank = grip(flow, mode, flow.space.W, group)[1]
        if rank == 0 or not is_gripped(flow, flow.space.W, c, rank):
            continue
        if not known and coefficients(machine, flow, at, 1, flow.space.W) != OK:
            return False
        known = True
        speed, size, rate = abs(flow.space.W[rows.u[c], 0]), mag[c], mag[nc + c]
        other = partner(rows, c)
        if other >= 0:
            speed += abs(flow.space.W[rows.u[other], 0])
            size += mag[other]
            rate += mag[nc + other]
        if speed <= ROUNDING * size + INSTANT * abs(at.t) * rate:
            set_mode(rows, mode, c, 0)
            found = True
    return found


@compiled()
def judge_coefficients(rows: Rows, W: Array, N: int) -> int:
    """Whether Taylor coefficients are numbers, NAN, or OVERFLOW in their unit of time.

    What overflows at high orders only is a blow-up, for which no step is small enough: it becomes
    infinite.
    """
    for r in range(rows.sizes[DIMENSION]):
        if not (math.isfinite(W[r, 0]) and math.isfinite(W[rows.program.rates[r], 0])):
            return NAN
        if not (math.isfinite(W[r, 1]) and math.isfinite(W[r, min(N, 2)])):
            return OVERFLOW
        if not math.isfinite(W[r, N]):
            W[r, N] = np.inf
    for c in range(len(rows.u)):
        r = rows.u[c]
        if not math.isfinite(W[r, 0]):
            return NAN
        if not math.isfinite(W[r, N - 1]):
            W[r, N - 1] = np.inf
    return OK


@compiled()
def keeps(flow: Flow, table: Array, y: Array, seen: Array, h: float) -> bool:
    """Whether rates, times the length of the step that ends here, are those that the step's series
    promises.

    Parameters
    ----------
    table : array
        Values of the rows at the end of the step.
    """
    rows = flow.rows
    mag = flow.space.mag
    promise = flow.space.promise[PROMISED]
    tol = _LOOSER * flow.tol
    late = INSTANT * abs(table[len(y), 0]) / h  # the end is a rounded time
    vague = vagueness(flow, table, y, h)
    for i in range(len(y)):
        size = LEAST_SIZE + abs(y[i]) + abs(promise[i]) + flow.atol * seen[i]
        rounding = (ROUNDING + vague) * mag[rows.noise[i]] * h if rows.noise[i] >= 0 else 0.0
        rounding += late * abs(promise[i])
        rate = rows.program.rates[i]
        if rate < len(y) and rows.noise[rate] >= 0:
            # A velocity that is made by forces which nearly cancel is known no better.
            rounding += ROUNDING * mag[rows.noise[rate]] * h * h
        if abs(table[rate, 0] * h - promise[i]) > tol * size + rounding:
            return False
    return True


@compiled()
def vagueness(flow: Flow, table: Array, y: Array, h: float) -> float:
    """What rounding errors of velocities make of the directions of slips that begin together.

    Parameters
    ----------
    flow : Flow
        With the promise of the step.
    table : array
        Values of the rows at its end.
    y : array
        State there.
    h : float
        Its length.
    """
    rows = flow.rows
    mag = flow.space.mag
    nc = len(rows.u)
    nq = rows.sizes[INERTIAL]
    found = 0.0
    for plane in rows.planes:
        first, other = plane[COMPONENT], plane[OTHER]
        speed = table[plane[AIM] + 2, 0]
        if plane[MASSIVE] == 0 or rows.group[first] < 0 or not speed > 0.0:
            continue
        faster = 0.0
        part = rows.parts[rows.homes[first, PART]]
        for i in range(part[COORDINATES]):
            r = nq + rows.members[part[MEMBERS] + i]
            faster += y[r] * flow.space.promise[PROMISED, r]
        if faster > 0.0:
            size = mag[first] + mag[other] + h * (mag[nc + first] + mag[nc + other])
            found = max(found, ROUNDING * size / speed)
    return found


@compiled()
def flip(rows: Rows, guard: int, mode: Array, reg: Array, leaving: Array) -> int:
    """Give the switch of a violated guard its other state; returns the switch.

    What leaves stick has its threshold to break, as long as it is not known which of several
    contacts do: ±2 where the sliding force is another one.

    Parameters
    ----------
    rows : Rows
    guard : int
        Its number.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
        One of them is changed.
    leaving : array of int, shape (contacts,)
        Which contacts leave with others that they share forces with.
    """
    nk = len(reg)
    if guard < nk:
        reg[guard] = 1 - reg[guard]
        return guard
    c = contact_of(guard, nk)
    if mode[c] == 0 and leaving[c] != ON_ITS_OWN:
        return release_together(rows, c, mode, nk, leaving)
    if mode[c] == 0:
        side = -1 if is_second(guard, nk) else 1
        set_mode(rows, mode, c, 2 * side if rows.drops[c] == 1 else side)
    else:
        set_mode(rows, mode, c, 0)
    return nk + c


@compiled()
def release_together(rows: Rows, first: int, mode: Array, nk: int, leaving: Array) -> int:
    """Let those contacts slip that leave stick together; returns the switch of the first of them.

    Parameters
    ----------
    rows : Rows
    first : int
        The first of those that share forces.
    mode : array of int, shape (contacts,)
        Is changed.
    nk : int
        Number of kinks.
    leaving : array of int, shape (contacts,)
    """
    found = first
    left = False
    for c in range(rows.sizes[ON_INERTIAL]):
        of_them = rows.group[c] == rows.group[first] and not is_component(rows, c)
        if of_them and mode[c] == 0 and leaving[c] != STAYS:
            if not left:
                found = c
            left = True
            set_mode(rows, mode, c, leaving[c] * (1 + rows.drops[c]))
    return nk + found


@compiled()
def let_slide(mode: Array) -> bool:
    """Let the contacts that break their thresholds slide; whether there are any."""
    found = False
    for c in range(len(mode)):
        if abs(mode[c]) == 2:
            mode[c] //= 2
            found = True
    return found


@compiled()
def hold_or_slide(flow: Flow, mode: Array, last: float, fired: int, slack: float) -> bool:
    """Give each contact that does not stick the threshold while others carry it (±2), else its
    sliding force (±1); what can open is carried only where it touches.

    Parameters
    ----------
    flow : Flow
        With the coefficients, and the powers of the step.
    mode : array of int, shape (contacts,)
        Is changed.
    last : float
        Length of the last step.
    fired : int
        The switch that has just fired, or −1.
    slack : float
        Rounding errors that count as zero.

    Returns
    -------
    bool
        Whether that changes the forces.
    """
    rows, space, N = flow.rows, flow.space, flow.order
    changed = False
    for c in range(len(mode)):
        if rows.drops[c] == 1 and mode[c] != 0 and not is_loose(rows, mode, c):
            held = stays(rows, space, mode, c, N, last, fired, slack)
            held = held and not (opens(rows, c) and is_wide(flow, c, last))
            if rows.plane[c] >= 0:
                other = rows.planes[rows.plane[c], OTHER]
                held = held and stays(rows, space, mode, other, N, last, fired, slack)
            force = 2 if held else 1
            if abs(mode[c]) != force:
                set_mode(rows, mode, c, force if mode[c] > 0 else -force)
                changed = True
    return changed


@compiled()
def flip_apart(rows: Rows, space: Space, mode: Array, reg: Array, count: int) -> int:
    """Give the switches of violated guards their other states: of each component the contact of
    least index, or the first kink alone; returns the first switch.

    What other components do decides nothing at the order that violates a guard. If in the end it
    does, this is repeated, and pivoting goes on with one switch at a time.

    Parameters
    ----------
    rows : Rows
    space : Space
        Lists the violated guards, and receives which switches are concerned.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
        Are changed.
    count : int
        How many of the violated guards are looked at.
    """
    nk = len(reg)
    asked = space.asked
    clear(asked)
    first = NOWHERE
    for i in range(count):
        guard = space.labels[i, NUMBER]
        if guard >= nk:
            c = contact_of(guard, nk)
            home = rows.homes[c, PART]
            # Contacts of one body come to rest together.
            if asked[home] == 1 and (rows.group[c] < 0 or mode[c] == 0):
                continue
            asked[home] = 1
        flipped = flip(rows, guard, mode, reg, space.leaving)
        space.touched[flipped] = 1
        if first < 0:
            first = flipped
        if guard < nk:
            break
    return first


@compiled()
def loosen(rows: Rows, p: int, J: Array, mode: Array, keep: int, space: Space) -> bool:
    """Let sticking contacts of a component whose directions depend on those of the others be
    carried at their threshold (u stays 0).

    With more sticking contacts than directions their forces are not unique. Any admissible choice
    gives the same motion; a contact carried at its threshold is a vertex of that choice, and
    pivoting walks from vertex to vertex.

    Parameters
    ----------
    rows : Rows
    p : int
        The component.
    J : array
        Contact directions, with a column for each coordinate of the component; those that change on
        the way are in the table.
    mode : array of int, shape (contacts,)
        Is changed.
    keep : int
        The contact that has just begun to stick; negative: none.
    space : Space
        Receives which switches are concerned.

    Returns
    -------
    bool
        Whether there are any.
    """
    n = rows.parts[p, COORDINATES]
    m = rows.parts[p, CONTACTS]
    members = rows.members[rows.parts[p, MEMBERS] :]
    rank = 0
    changed = False
    kept = NOWHERE
    for i in range(m):
        if members[n + i] == keep:
            kept = i
    for turn in range(m + 1):
        # The contact that has just begun to stick comes first: it is the one that must not be let
        # go again.
        i = kept if turn == 0 else turn - 1
        if i < 0 or (turn == 0) != (i == kept):
            continue
        c = members[n + i]
        if mode[c] != 0:
            continue
        for j in range(n):
            space.scratch[rank, j] = direction_entry(rows, J, space.W, c, j)
        if is_new(n, space.scratch, rank, _DEPENDENT):
            rank += 1
        elif rows.group[c] < 0:
            set_mode(rows, mode, c, 1 + rows.drops[c])
            space.touched[len(rows.kinks) + c] = 1
            changed = True
    return changed


@compiled()
def may_be_carried(rows: Rows, J: Array, space: Space, mode: Array) -> bool:
    """Whether the direction of a contact that does not stick, and that others may hold at its
    threshold, depends on the directions of what sticks.

    Parameters
    ----------
    rows : Rows
    J : array
        As of :func:`loosen`.
    space : Space
    mode : array of int, shape (contacts,)
    """
    for p in range(len(rows.parts)):
        n = rows.parts[p, COORDINATES]
        m = rows.parts[p, CONTACTS]
        members = rows.members[rows.parts[p, MEMBERS] :]
        rank = 0
        for i in range(m if m > 1 else 0):
            c = members[n + i]
            if mode[c] == 0:
                for j in range(n):
                    space.scratch[rank, j] = direction_entry(rows, J, space.W, c, j)
                if is_new(n, space.scratch, rank, _DEPENDENT):
                    rank += 1
        for i in range(m if rank > 0 else 0):
            c = members[n + i]
            if mode[c] != 0 and rows.drops[c] == 1:
                for j in range(n):
                    space.scratch[rank, j] = direction_entry(rows, J, space.W, c, j)
                if not is_new(n, space.scratch, rank, _DEPENDENT):
                    return True
    return False


@compiled()
def settle_mode(
    machine: Machine, flow: Flow, lane: Lane, room: float, hold: bool, promised: float
) -> tuple[int, float, float, int]:
    """Find the mode the motion takes now; its series, or a polynomial, is left in the work space.

    Parameters
    ----------
    room, hold
        Longest step that is wanted; whether sticking contacts are put onto the surface speed.
    promised : float
        Length of the step that ended here, if its promise has not been checked; otherwise 0.

    Returns
    -------
    status, step, series, count
        OK, the step size, that of the series, and the number of guards that may fire; NAN or
        INDEFINITE; SINGULAR if no mode is possible; ASTRAY if the last step is wrong.
    """
    rows = flow.rows
    space = flow.space
    touched = space.touched
    nk = len(rows.kinks)
    n = len(lane.y)
    keep_start(machine, flow, lane)
    clear(touched)
    space.W[n, 1] = lane.clock[UNIT]
    # First pivoting; if that leaves the admissible modes (a singular or impossible one), all states
    # of the switches concerned, `total` in number.
    pivots = 0
    units = 0
    candidate = 0
    total = 0
    kept = 0  # times that the forces of such a state were put right
    flipped = lane.counters[CAUSE]
    slack = 1.0
    denied = 0.0  # longest step of a mode that was denied
    while True:
        if pivots > 0:
            copy(space.y0, lane.y)
        pivots += 1
        if total > 0 and kept == 0:
            candidate, total, slack = choose_next(
                rows, touched, lane.mode, lane.reg, candidate, total, slack
            )
            if total == 0:
                return SINGULAR, 0.0, 0.0, 0
        status, h = make_series(machine, flow, lane, room, slack * denied, hold or pivots > 1)
        known = pivots == 1 and status != SINGULAR
        if known and promised > 0.0 and not keeps(flow, space.W, lane.y, lane.seen, promised):
            return ASTRAY, 0.0, 0.0, 0
        # A formula may end where its region ends.
        lost = status in (NAN, OVERFLOW, INDEFINITE) and total == 0 and pivots <= nk + 1
        if lost and set_regions(rows, space.W, space.mag, lane.reg):
            continue
        rescaled, unit = unit_for(status, h, room, space.W[n, 1])
        if status in (NAN, INDEFINITE) or (rescaled and units == MOST_UNITS):
            return (INDEFINITE if status == INDEFINITE else NAN), 0.0, 0.0, 0
        if rescaled:
            space.W[n, 1] = unit
            units += 1
            pivots -= 1
            candidate -= 1 if total > 0 else 0
            continue
        if status == OK:
            denied = max(denied, h)
            guard, count, h, series = try_mode(machine, flow, lane, h, room, slack, pivots == 1)
            if guard == _NO_GUARD:
                return OK, h, series, count
            others = guard == _OTHER_FORCES and total > 0 and kept <= 2 * len(rows.u)
            kept = kept + 1 if others else 0
            if guard == _AGAIN:
                pivots = 0
                continue
            if guard >= 0 and total == 0:
                looked_at = count if pivots <= _TOGETHER else 1
                flipped = flip_apart(rows, space, lane.mode, lane.reg, looked_at)
        many = pivots > 3 * len(touched) + 8
        carried = status == SINGULAR and total == 0 and let_carry(flow, lane.mode, flipped - nk)
        if total == 0 and (many or (status != OK and not carried)):
            total = concerned(rows, touched, lane.mode, lane.counters[CAUSE])


@compiled()
def keep_start(machine: Machine, flow: Flow, lane: Lane) -> None:
    """Keep the state from which modes are tried."""
    begin_at_rest(machine, flow, lane)
    copy(lane.y, flow.space.y0)


@compiled()
def begin_at_rest(machine: Machine, flow: Flow, lane: Lane) -> None:
    """After an event, put the velocities of contacts in a plane that have just left stick, or may
    leave it now, onto those of their surfaces: a slip begins from nothing, and not from rounding
    errors. So does what opens beside them.

    What stops one contact moves the others by rounding errors of what it takes away: these become
    small beside themselves, turn by turn, until nothing is left.
    """
    rows = flow.rows
    if len(rows.planes) == 0 or lane.counters[CAUSE] < 0:
        return
    c = lane.counters[CAUSE] - len(rows.kinks)
    before = flow.space.touched
    asked = opened = c >= 0 and opens(rows, c) and lane.mode[c] != 0 and lane.settled[c] == 0
    if opened:
        set_mode(rows, lane.mode, c, 0)
    for p in range(len(rows.planes)):
        first = rows.planes[p, COMPONENT]
        before[first] = lane.mode[first]
        if rows.planes[p, MASSIVE] == 1:
            left = leaves_with(rows, lane, first, c)
            asked = asked or left or lane.mode[first] == 0
            if left:
                set_mode(rows, lane.mode, first, 0)
    if not asked:
        return
    here = Instant(lane.clock[NOW], lane.y, lane.mode, lane.reg)
    known = resolve(rows, flow.k, flow.space, lane.mode)
    for _ in range(_MOST_STOPS):
        known = known and coefficients(machine, flow, here, 1, flow.space.W) == OK
        if not known or all_on_surface(flow, lane.mode):
            break
        known = release_or_hold(flow, here, lane.clock[RECENT], 0.0, lane.clock[SPAN])
    for p in range(len(rows.planes)):
        first = rows.planes[p, COMPONENT]
        if before[first] != 0:
            set_mode(rows, lane.mode, first, before[first])
    if opened:
        set_mode(rows, lane.mode, c, 1)


@compiled()
def leaves_with(rows: Rows, lane: Lane, first: int, c: int) -> bool:
    """Whether a contact in a plane has just left stick, where the switch of contact c has fired:
    with those that it shared its force with, or with the normal force that has pressed it.

    Parameters
    ----------
    rows : Rows
    lane : Lane
    first, c : int
        The first component of the one, and the other.
    """
    if first == c:
        return True
    together = c >= 0 and rows.group[first] >= 0 and rows.group[first] == rows.group[c]
    together = together or (c >= 0 and presses(rows, c, first))
    return bool(together and lane.settled[first] == 0 and lane.mode[first] != 0)


@compiled()
def all_on_surface(flow: Flow, mode: Array) -> bool:
    """Whether all that sticks has the velocity of its surface."""
    for c in range(flow.rows.sizes[ON_INERTIAL]):
        if mode[c] == 0 and not is_on_surface(flow, flow.space.W, c):
            return False
    return True


@compiled()
def make_series(
    machine: Machine, flow: Flow, lane: Lane, room: float, near: float, hold: bool
) -> tuple[int, float]:
    """Taylor coefficients of the mode in which a lane is, and the step that they are good for,
    between two times that can be told apart, as they are recorded.

    Parameters
    ----------
    machine : Machine
    flow : Flow
    lane : Lane
        Its state is put back onto the constraints of the mode.
    room, near : float
        Longest step that is wanted, and (times the slack) longest for which slip was denied here.
    hold : bool
        Whether sticking contacts are put onto the surface speed.

    Returns
    -------
    status, step
        As of :func:`evaluate_mode`; 0 unless that is OK.
    """
    t = lane.clock[NOW]
    here = Instant(t, lane.y, lane.mode, lane.reg)
    recent, span = lane.clock[RECENT], lane.clock[SPAN]
    status = evaluate_mode(machine, flow, here, recent, near, span, hold)
    h = 0.0
    if status == OK:
        h = step_size(flow, flow.order, lane.seen, lane.clock[SERIES])
        h = min(h, room)
        passed = max(_PASSED * h, _ROUNDED * abs(t))
        h = min(h, _PAST * soonest_kink(flow.rows, flow.space.W, flow.order, passed))
        h = (t + h) - t
        if len(flow.rows.planes) > 0:
            # A slip in a plane begins from rest, exactly.
            copy(lane.y, flow.space.y0)
    return status, h


@compiled()
def soonest_kink(rows: Rows, W: Array, N: int, passed: float) -> float:
    """When the next kink of time comes whose guard is a polynomial of degree two, or one; infinite
    if there is none.

    A series that ends, as that of a drive between two samples, would last for ever; beyond the
    kink its terms are so large that what is small before it would count as zero.

    Parameters
    ----------
    rows : Rows
    W : array
        Taylor coefficients.
    N : int
        Their number.
    passed : float
        Time within which a kink is the one that has just been passed.
    """
    found = np.inf
    unit = W[rows.sizes[DIMENSION], 1]
    for j in range(len(rows.timed)):
        c = W[rows.kinks[j]]
        ends = rows.timed[j] == 1
        for k in range(3, N):
            ends = ends and c[k] == 0.0
        inside = c[1] * c[1] - 4.0 * c[2] * c[0]
        if ends and inside >= 0.0 and c[1] != 0.0:
            q = -0.5 * (c[1] + math.copysign(math.sqrt(inside), c[1]))
            near = c[0] / q
            far = q / c[2] if c[2] != 0.0 else near
            for x in (near, far):
                if x * unit > passed:
                    found = min(found, x * unit)
    return found


@compiled()
def unit_for(status: int, h: float, room: float, unit: float) -> tuple[bool, float]:
    """Another unit of time for coefficients that overflow in this one, or where it does not suit
    the step; first, whether there is one.

    All others are powers of two times these, so that nothing is rounded.
    """
    if status == OVERFLOW:
        return True, COARSER * unit
    if status == OK and not suits(h, room, unit):
        return True, better(h, unit)
    return False, unit


@compiled()
def try_mode(
    machine: Machine,
    flow: Flow,
    lane: Lane,
    h: float,
    room: float,
    slack: float,
    quiet: bool,
) -> tuple[int, int, float, float]:
    """See whether the mode of which the series are in the work space is right, and take as much of
    a step as hides nothing, or a longer one by a polynomial where the motion is stiff.

    Parameters
    ----------
    h, room : float
        Step of the series, and longest step that is wanted.
    quiet : bool
        Whether this is the mode that the motion was in.

    Returns
    -------
    guard, count, step, series
        NO_GUARD if the mode is right; the least guard that is violated at once; OTHER_FORCES if
        contacts that do not stick have to have others; AGAIN if a guard vanishes in a polynomial,
        which has to be a series. Then the number of guards that may fire, or are violated; the
        step, and that of the series.
    """
    space = flow.space
    clock = lane.clock
    mode = lane.mode
    n = len(lane.y)
    last = clock[LAST]
    fired = lane.counters[CAUSE]
    unit = space.W[n, 1]
    fill_powers(space.powers, h / unit)
    guard, count = scan(flow, mode, lane.reg, lane.settled, last, fired, slack)
    if guard >= 0:
        return guard, count, h, h
    if hold_or_slide(flow, mode, last, fired, slack):
        return _OTHER_FORCES, count, h, h
    series = shortened_step(flow, mode, lane.reg, h, lane.seen)
    step = series
    length = h
    # Where a slip in a plane is slow, discs cut what is stiff as well.
    whole = not step < h or len(flow.rows.planes) > 0
    stiff = quiet and whole and lingers(flow, lane, step, room)
    if stiff:
        here = Instant(clock[NOW], lane.y, mode, lane.reg)
        step, clock[IMPLICIT] = collocate(machine, flow, here, step, clock[IMPLICIT], lane.seen)
    if step != h:
        length = (clock[NOW] + step) - clock[NOW]
        fill_powers(space.powers, length / space.W[n, 1])
        guard, count = scan(flow, mode, lane.reg, lane.settled, last, fired, slack)
    if stiff and (guard >= 0 or not step > 0.0):
        # A guard that vanishes is known better from its series.
        clock[IMPLICIT] = -RESTING
        space.W[n, 1] = unit
        return _AGAIN, count, h, series
    if guard >= 0:
        return guard, count, length, series
    clock[UNIT] = unit
    for i in range(len(flow.rows.watched)):
        lane.seen[i] = max(lane.seen[i], abs(space.W[flow.rows.watched[i], 0]))
    return _NO_GUARD, count, length, series


@compiled()
def let_carry(flow: Flow, mode: Array, keep: int) -> bool:
    """Let sticking contacts be carried whose directions depend on those of the others; whether
    there are any."""
    rows = flow.rows
    changed = False
    for p in range(len(rows.parts)):
        if loosen(rows, p, flow.k.J, mode, keep, flow.space):
            changed = True
    return changed


# -- every state of the switches concerned ---------------------------------------------------------


@compiled()
def concerned(rows: Rows, touched: Array, mode: Array, fired: int) -> int:
    """Count the states of the switches that pivoting has questioned, of the one that has just
    fired, and of what slides without mass."""
    sizes = rows.sizes
    nk = sizes[KINKS]
    first = sizes[ON_INERTIAL] + sizes[ON_VISCOUS]
    if fired >= 0:
        touched[fired] = 1
    for c in range(first, first + sizes[ON_RATE_INDEPENDENT]):
        if mode[c] != 0:
            touched[nk + c] = 1
    return candidates(rows, touched, nk)


@compiled()
def choose_next(
    rows: Rows,
    touched: Array,
    mode: Array,
    reg: Array,
    candidate: int,
    total: int,
    slack: float,
) -> tuple[int, int, float]:
    """Put the switches concerned into the next of all their states.

    Parameters
    ----------
    rows : Rows
    touched : array of int, shape (kinks + contacts,)
        1 for each switch concerned; all contacts are once no state is left.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
        Are changed.
    candidate, total : int
        The number of the next state, and of all states.
    slack : float
        Rounding errors that count as zero.

    Returns
    -------
    candidate, total, slack
        The number of the state after that, of all states (0: none is left), and rounding errors
        that count as zero.
    """
    nk = len(reg)
    if candidate == total:
        # Where forces are not unique, contacts that pivoting never questioned may have to change,
        # too.
        asked = 0
        for c in range(len(mode)):
            asked += 1 - touched[nk + c]
            touched[nk + c] = 1
        total = candidates(rows, touched, nk)
        if asked == 0:
            # A contact may be so close to two modes that rounding denies it both.
            slack *= 1e2
        candidate = 0
    if total > _MOST_CANDIDATES or slack > _SLACKEST:
        return candidate, 0, slack
    choose(rows, candidate, touched, mode, reg)
    return candidate + 1, total, slack


@compiled()
def set_regions(rows: Rows, W: Array, mag: Array, reg: Array) -> bool:
    """Put kinks onto the sides where their guards clearly are; whether one was not."""
    changed = False
    for j in range(len(reg)):
        value = W[rows.kinks[j], 0]
        unsure = FIRED * mag[3 * len(rows.u) + j]
        if (value < -unsure and reg[j] == 1) or (value > unsure and reg[j] == 0):
            reg[j] = 1 - reg[j]
            changed = True
    return changed


@compiled()
def candidates(rows: Rows, touched: Array, nk: int) -> int:
    """Number of states of the switches concerned (more than are tried, if there are too many)."""
    total = 1
    for i in range(len(touched)):
        if touched[i] == 1 and total <= _MOST_CANDIDATES:
            total *= 2 if i < nk else states_of(rows, i - nk)
    return total


@compiled()
def states_of(rows: Rows, c: int) -> int:
    """Number of states of a contact: in a plane, and of what can open, a slip has no sign."""
    if is_component(rows, c):
        return 1
    return 2 if rows.plane[c] >= 0 or opens(rows, c) else 3


@compiled()
def choose(rows: Rows, candidate: int, touched: Array, mode: Array, reg: Array) -> None:
    """Put the switches concerned into the states that a number stands for; what does not stick is
    at its threshold, or open.

    Parameters
    ----------
    rows : Rows
    candidate : int
        The number.
    touched : array of int, shape (kinks + contacts,)
        1 for each switch concerned.
    mode, reg : arrays of int, shapes (contacts,), (kinks,)
        Are changed.
    """
    nk = len(reg)
    for i in range(len(touched)):
        if touched[i] == 1:
            if i < nk:
                reg[i] = candidate % 2
                candidate //= 2
            elif not is_component(rows, i - nk):
                states = states_of(rows, i - nk)
                state = candidate % states - 1
                candidate //= states
                state = abs(state) if states == 2 else state
                set_mode(rows, mode, i - nk, state * (1 + rows.drops[i - nk]))


@compiled()
def clear(numbers: Array) -> None:
    """Set whole numbers to 0."""
    for i in range(len(numbers)):
        numbers[i] = 0


@compiled()
def copy(source: Array, target: Array) -> None:
    """Copy a vector (a slice assignment would compile shape checks that can never fail)."""
    for i in range(len(source)):
        target[i] = source[i]
