"""Taylor coefficients of a motion, including the onset of slip in a plane.

In slip the friction force is −k A n, n the direction of Au. Where |u| = 0 that is no function of
the state: n follows from what u does next, Au = tᵖ w(t) with w = ρ n. Order by order, the rate of u
depends linearly on the coefficients of n, through Delassus' matrix, which probes find: so

    (Au)ₘ₊₁ = bₘ + Â nₘ/(m + 1) = (ρ n)ₘ₊₁₋ₚ,    n·n = 1,

where bₘ is what the orders of n below m make of it, are two equations for the part of nₘ across n₀
and for one order of ρ. The first of all, (Au)₁ = b₀ + Â n₀ = ρ n₀, has one solution: ρ is the root
of a secular equation. Where it vanishes, since the force has just reached the threshold, p > 1.

For p = 1 the series converges. For p = 2 it is asymptotic only: across n₀, u′ = F − k u/(ρ₀ t²) + …
is singular as Euler's equation is, and coefficients grow like m! (ρ₀/k)ᵐ. Its least term is
exp(−k/(ρ₀ t)), below rounding where the force outgrows the threshold by less than a thirtieth:
the step ends there, as any step does, by its last terms.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.equations.codegen.series import SINGULAR
from stickslip.motion.steps.arrays import (
    AHEAD,
    AIM,
    AIM_SPEED,
    AIMS,
    DIMENSION,
    FEWEST_ORDERS,
    LEAD,
    OK,
    SEAT,
    Flow,
    Instant,
    Machine,
    Rows,
    plain_coefficients,
)
from stickslip.motion.steps.contacts import directions_of, set_mode
from stickslip.motion.steps.face_onset import aim_face_order, aim_faces, put_pieces
from stickslip.motion.steps.onset import (
    MOST_LEADING,
    NEGLIGIBLE,
    aim_order_together,
    aim_together,
    begin_together,
    discard_orders,
)
from stickslip.motion.steps.response import (
    AXES,
    BX,
    BY,
    LEADING,
    M_,
    N_,
    OX,
    RHO,
    SPARE,
    X,
    Y,
    any_bends,
    begins_as_face,
    begins_bent,
    begins_flat,
    lost_order,
    place_aims,
    place_speeds,
    rate_row,
    respond,
    respond_at,
)
from stickslip.motion.steps.sets import (
    is_rate_independent,
    length_at,
    slips_with_mass,
    whole_speed,
    width_of,
)
from stickslip.numerics.levels import EPSILON, FIRED, INSTANT, ROUNDING
from stickslip.symbolic.tape import DIRECTION_GIVEN
from stickslip.translator import compiled

_ANGLES = 24  # number of angles that are tried first
_LATE = 64.0  # zero threshold in errors of a time, or of a velocity
_RANK_ONE = 64.0 * EPSILON  # eigenvalue relative to the largest below which it is zero
# largest number of iterations for slips that begin together, and for a secular equation
_MOST_TURNS = 60


@compiled()
def coefficients(machine: Machine, flow: Flow, at: Instant, order: int, table: Array) -> int:
    """Taylor coefficients of all rows of the tape at an instant.

    Parameters
    ----------
    order : int
        Up to which they are made.
    table : array
        Receives them.

    Returns
    -------
    int
        OK, or SINGULAR or INDEFINITE, what keeps the equations from being solved.
    """
    for p in flow.rows.formula_planes:
        place_anywhere(flow.rows, flow.rows.planes[p], table)
    status = plain_coefficients(machine, flow, at, order, table)
    if status != OK:
        return status
    aimed = aim_prescribed(flow, at.mode, table)
    if begins(flow, at.mode, table):
        status = begin_slips(machine, flow, at, order, table)
    elif aimed:
        status = plain_coefficients(machine, flow, at, order, table)
    for plane in flow.rows.planes:
        if aimed and at.mode[plane[LEAD]] == DIRECTION_GIVEN:
            set_mode(flow.rows, at.mode, plane[LEAD], 1)
    return status


@compiled(inline=True)
def place_anywhere(rows: Rows, plane: Array, table: Array) -> None:
    """Put some direction of a contact that has a formula, until it is known: a gradient has no
    value at 0. Both pieces of a disc have one where its rim is at rest."""
    aim = plane[AIM]
    width = len(directions_of(rows, plane[LEAD]))
    for i in range(width):
        if table[aim + i, 0] != 0.0:
            return
    table[aim, 0] = 1.0
    if width > 2:
        table[aim, 0] = table[aim + 2, 0] = math.sqrt(0.5)


@compiled()
def is_prescribed(rows: Rows, c: int) -> bool:
    """Whether a contact is one between motions that are given: it is not part of a linear
    problem."""
    return bool(not is_rate_independent(rows, c) and rows.homes[c, SEAT] < 0)


@compiled()
def aim_prescribed(flow: Flow, mode: Array, table: Array) -> bool:
    """Fill in the directions n of slips between motions that are given, and their speeds, where
    these begin from rest: Au = tᵖ w with the w = ρ n that is known. Whether there are any.

    Parameters
    ----------
    mode : array of int, shape (contacts,)
        Says which are filled in.
    table : array
        Coefficients; those of n end p orders before those of Au.
    """
    rows, mag = flow.rows, flow.space.mag
    found = False
    last = table.shape[1] - 1
    clock = rows.sizes[DIMENSION]
    late = _LATE * INSTANT * abs(table[clock, 0]) / table[clock, 1]
    for plane in rows.planes:
        c = plane[LEAD]
        if not 1 <= mode[c] <= 2 or not is_prescribed(rows, c):
            continue
        still = _LATE * ROUNDING * whole_speed(rows, mag, c)
        still += late * length_at(rows, plane, table, 1)
        if not length_at(rows, plane, table, 0) <= still:
            continue
        largest = 0.0
        for k in range(1, last + 1):
            largest = max(largest, length_at(rows, plane, table, k))
        first = 1
        while first < last and length_at(rows, plane, table, first) <= NEGLIGIBLE * largest:
            first += 1
        aim_along(rows, plane, table, first)
        set_mode(rows, mode, c, DIRECTION_GIVEN)
        found = True
    return found


@compiled()
def aim_along(rows: Rows, plane: Array, table: Array, first: int) -> None:
    """Fill in the direction and the speed of one of these slips, from n·w = ρ and n·n = 1.

    Parameters
    ----------
    plane : array of int
        Its row of `Rows.planes`.
    table : array
        Coefficients.
    first : int
        The first order of Au that is not zero.
    """
    aim = plane[AIM]
    width = len(directions_of(rows, plane[LEAD]))
    speed = table[plane[AIM_SPEED]]
    size = length_at(rows, plane, table, first)
    for k in range(table.shape[1]):
        speed[k] = 0.0
        for i in range(width):
            table[aim + i, k] = 0.0
    for k in range(table.shape[1] - first if size > 0.0 else 0):
        if k == 0:
            speed[first] = size
            for i in range(width):
                table[aim + i, 0] = table[plane[AHEAD + i], first] / size
            continue
        square = 0.0
        for j in range(1, k):
            product = 0.0
            for i in range(width):
                product += table[aim + i, j] * table[aim + i, k - j]
            square += product
        forward = 0.0
        for i in range(width):
            left = table[plane[AHEAD + i], first + k]
            for j in range(1, k):
                left -= speed[first + j] * table[aim + i, k - j]
            table[aim + i, k] = left
            forward += table[aim + i, 0] * left
        # left = ρ₀ nₖ + ρₖ n₀, and n₀·nₖ follows from n·n = 1
        speed[first + k] = forward + 0.5 * size * square
        for i in range(width):
            left = table[aim + i, k] - speed[first + k] * table[aim + i, 0]
            table[aim + i, k] = left / size


@compiled()
def begins(flow: Flow, mode: Array, table: Array) -> bool:
    """Whether a contact in a plane is at the very beginning of a slip; sets aside which."""
    rows = flow.rows
    found = False
    for p in range(len(rows.planes)):
        starts = slips_with_mass(rows, mode, p) and table[rows.planes[p, AIM_SPEED], 0] == 0.0
        flow.space.aims[AIMS * p + LEADING, 0] = 0.0 if starts else -1.0
        found = found or starts
    return found


@compiled()
def begin_slips(machine: Machine, flow: Flow, at: Instant, order: int, table: Array) -> int:
    """Find the directions of slips that begin, and the coefficients with them.

    Parameters
    ----------
    flow : Flow
        Its work space says which slips begin.
    table : array
        Receives the coefficients.
    """
    rows = flow.rows
    begun, aims = flow.space.begun, flow.space.aims
    begun[rows.sizes[DIMENSION], 1] = table[rows.sizes[DIMENSION], 1]
    status = respond(machine, flow, at, begun)
    if status != OK:
        return status
    rank = 0
    if begin_together(flow):
        rank = aim_together(machine, flow, at, begun)
    else:
        aim_first(flow)
        status = aim_faces(machine, flow, at, begun)
        if status != OK:
            return status
        if any_bends(flow):
            status = aim_where_it_bends(machine, flow, at, begun)
            if status != OK:
                return status
    # The leading orders of |Au|, and with them p; beyond, only what is requested. A slip that would
    # begin against its direction does not begin, as its guard reports, and needs no further orders.
    orders = order - 1 if order > 1 else 1
    m = 1
    while m < orders:
        needed = m + 2 if rank == 0 else m + 1 + leading_order(flow)
        deeper = order if needed > FEWEST_ORDERS else FEWEST_ORDERS
        if needed > deeper or not all_begin(flow):
            break
        work = table if deeper == order else begun
        work[rows.sizes[DIMENSION], 1] = table[rows.sizes[DIMENSION], 1]
        place_aims(flow, work, deeper)
        status = plain_coefficients(machine, flow, at, stage_order(needed, deeper), work)
        if status != OK:
            return status
        lost = lost_order(flow, work)
        for p in range(len(rows.planes)):
            for i in range(2):
                aims[AIMS * p + OX + i, m] = work[rows.planes[p, AHEAD + i], needed - 1]
            for i in range(width_of(rows, p)):
                aims[AIMS * p + rate_row(i), m] = work[rows.planes[p, AHEAD + i], m + 1]
        if rank > 0:
            before = leading_order(flow)
            aim_order_together(flow, rank, m, lost)
            # The rotation of slips that begin on a moving body follows from orders of Au above the
            # leading one.
            if before == 1 and leading_order(flow) > 1:
                discard_orders(flow)
                m = 0
            elif before > 1:
                place_aims(flow, work, deeper)
                status = plain_coefficients(machine, flow, at, stage_order(needed, deeper), work)
                if status != OK:
                    return status
                for p in range(len(rows.planes)):
                    for i in range(2):
                        aims[AIMS * p + OX + i, m] = work[rows.planes[p, AHEAD + i], needed - 1]
                aim_order_together(flow, rank, m, lost)
        else:
            aim_order(flow, m)
            for p in range(len(rows.planes)):
                if begins_as_face(flow, p):
                    aim_face_order(flow, p, m, lost)
        m += 1
    if m >= MOST_LEADING and all_begin(flow) and not all_lead(flow):
        return SINGULAR  # the force leaves its set too slowly for its direction to be known
    place_aims(flow, table, order)
    status = plain_coefficients(machine, flow, at, order, table)
    place_speeds(flow, table, order)
    return status


@compiled()
def all_begin(flow: Flow) -> bool:
    """Whether no slip that begins would go against its own friction."""
    for p in range(len(flow.rows.planes)):
        starts = flow.space.aims[AIMS * p + LEADING, 0] >= 0.0
        if starts and flow.space.aims[AIMS * p + RHO, 0] < 0.0:
            return False
    return True


@compiled()
def all_lead(flow: Flow) -> bool:
    """Whether the order of |Au| of all slips that begin is known."""
    found = True
    for p in range(len(flow.rows.planes)):
        found = found and flow.space.aims[AIMS * p + LEADING, 0] != 0.0
    return found


@compiled()
def leading_order(flow: Flow) -> int:
    """The order p of |Au| of slips that begin together; 1 where it is not known yet."""
    leading = 1
    for p in range(len(flow.rows.planes)):
        leading = max(leading, int(flow.space.aims[AIMS * p + LEADING, 0]))
    return leading


@compiled()
def stage_order(needed: int, most: int) -> int:
    """The least order for which series are made that suffices."""
    found = most
    for n in range(most, FEWEST_ORDERS - 1, -4):
        if n >= needed:
            found = n
    return found


@compiled()
def coupled(flow: Flow, p: int, part: int, m: int) -> tuple[float, float]:
    """Contribution of the directions of other beginning slips to bₘ of one.

    Parameters
    ----------
    p : int
        The plane.
    part : int
        What is meant by their directions: known (N_), or what is solved for (X).
    m : int
        The order.
    """
    aims = flow.space.aims
    answer = flow.space.answer
    x = 0.0
    y = 0.0
    for q in range(len(flow.rows.planes)):
        if q != p and aims[AIMS * q + LEADING, 0] >= 0.0:
            u, v = aims[AIMS * q + part, m], aims[AIMS * q + part + 1, m]
            x += answer[2 * p, 2 * q] * u + answer[2 * p, 2 * q + 1] * v
            y += answer[2 * p + 1, 2 * q] * u + answer[2 * p + 1, 2 * q + 1] * v
    return x / (m + 1), y / (m + 1)


@compiled()
def aim_first(flow: Flow) -> None:
    """Directions at the beginning: (Au)₁ = b₀ + Â n₀ = ρ n₀, each by its secular equation, iterated
    until they are constant."""
    aims = flow.space.aims
    answer = flow.space.answer
    planes = len(flow.rows.planes)
    for _ in range(_MOST_TURNS):
        change = 0.0
        for p in range(planes):
            base = AIMS * p
            if not begins_flat(flow, p):
                continue
            x, y = coupled(flow, p, N_, 0)
            x += aims[base + BX, 0]
            y += aims[base + BY, 0]
            n, m, rho = secular_root(
                -answer[2 * p, 2 * p],
                -0.5 * (answer[2 * p, 2 * p + 1] + answer[2 * p + 1, 2 * p]),
                -answer[2 * p + 1, 2 * p + 1],
                x,
                y,
                aims[base + AXES, 1] / aims[base + AXES, 0],
            )
            change = max(change, abs(n - aims[base + N_, 0]) + abs(m - aims[base + M_, 0]))
            aims[base + N_, 0], aims[base + M_, 0] = n, m
            size = math.hypot(x, y)
            # When a threshold is just reached, the force beyond it is zero by definition.
            first = abs(rho) > FIRED * size
            aims[base + RHO, 0] = rho if first else 0.0
            aims[base + LEADING, 0] = 1.0 if first else 0.0
        if change <= 2.0 * EPSILON:
            break


@compiled()
def aim_where_it_bends(machine: Machine, flow: Flow, at: Instant, table: Array) -> int:
    """Directions at the beginning if friction changes its own normal force: (Au)₁ is a nonlinear
    function of n₀, and has its direction, as before. All angles are searched; of several solutions
    that with the largest acceleration is selected. Each such plane is a separate component, so they
    do not depend on each other.

    Higher orders are linear: what nₘ does to (Au)ₘ₊₁ is the derivative at n₀, which order 1 of
    n = n₀ + t shows exactly.

    Parameters
    ----------
    flow : Flow
        With the response without it, and first directions; receives the directions, and the
        response to changes of them.
    table : array
        Work space.
    """
    rows = flow.rows
    aims = flow.space.aims
    planes = len(rows.planes)
    status = OK
    for p in range(planes):
        base = AIMS * p
        if not begins_bent(flow, p):
            continue
        best, angle = -math.inf, math.atan2(aims[base + M_, 0], aims[base + N_, 0])
        before, low = 0.0, 0.0
        for k in range(_ANGLES + 1):
            high = 2.0 * math.pi * k / _ANGLES
            status, across, _ = rate_towards(machine, flow, at, table, p, high)
            if status != OK:
                return status
            # (Au)₁ turns from one side of n₀ to the other, as friction resists.
            if k > 0 and before >= 0.0 >= across and before > across:
                found = angle_between(machine, flow, at, table, p, low, high)
                _, _, along = rate_towards(machine, flow, at, table, p, found)
                if along > best:
                    best, angle = along, found
            before, low = across, high
        status, _, along = rate_towards(machine, flow, at, table, p, angle)
        if status != OK:
            return status
        size = math.hypot(aims[base + BX, 0], aims[base + BY, 0])
        first = abs(along) > FIRED * size
        aims[base + RHO, 0] = along if first else 0.0
        aims[base + LEADING, 0] = 1.0 if first else 0.0
    return respond_at(machine, flow, at, table, True)


@compiled()
def rate_towards(
    machine: Machine, flow: Flow, at: Instant, table: Array, p: int, angle: float
) -> tuple[int, float, float]:
    """Components of (Au)₁ perpendicular to a direction of plane p, and along it.

    Parameters
    ----------
    flow : Flow
        Receives the direction in its work space.
    table : array
        Work space.
    angle : float
        Of the direction.
    """
    aims = flow.space.aims
    n, m = math.cos(angle), math.sin(angle)
    # Exactly along an axis, where a dissipation may be flat: no angle is π.
    n = n if abs(n) > 2.0 * EPSILON else 0.0
    m = m if abs(m) > 2.0 * EPSILON else 0.0
    aims[AIMS * p + N_, 0], aims[AIMS * p + M_, 0] = n, m
    place_aims(flow, table, FEWEST_ORDERS)
    status = plain_coefficients(machine, flow, at, FEWEST_ORDERS, table)
    if status == OK and put_pieces(flow.rows, p, at.reg, table):
        place_aims(flow, table, FEWEST_ORDERS)
        status = plain_coefficients(machine, flow, at, FEWEST_ORDERS, table)
    x, y = table[flow.rows.planes[p, AHEAD], 1], table[flow.rows.planes[p, AHEAD + 1], 1]
    return status, n * y - m * x, n * x + m * y


@compiled()
def angle_between(
    machine: Machine, flow: Flow, at: Instant, table: Array, p: int, low: float, high: float
) -> float:
    """The angle between two others at which (Au)₁ has its direction.

    Parameters
    ----------
    machine, flow, at, table, p
        As in :func:`rate_towards`.
    low, high : float
        The angles; what is across is not negative at the lower one.
    """
    _, f, _ = rate_towards(machine, flow, at, table, p, low)
    _, g, _ = rate_towards(machine, flow, at, table, p, high)
    kept = 0
    for _ in range(_MOST_TURNS):
        # The Illinois method: an end that stays where it is counts half.
        x = high - (high - low) * g / (g - f) if f != g else low
        _, h, _ = rate_towards(machine, flow, at, table, p, x)
        if h == 0.0 or high - low <= 2.0 * EPSILON or x in (low, high):
            return x
        if h > 0.0:
            low, f = x, h
            g = 0.5 * g if kept > 0 else g
            kept = 1
        else:
            high, g = x, h
            f = 0.5 * f if kept < 0 else f
            kept = -1
    return 0.5 * (low + high)


@compiled()
def secular_root(
    a: float, b: float, c: float, x: float, y: float, wide: float
) -> tuple[float, float, float]:
    """The unit vector n and the number ρ with (ρ + D) n = (x, y), D = [[a, b], [b, c]] positive
    definite, or of rank 1 with (x, y) in its image: ρ is the largest root of |(ρ + D)⁻¹(x, y)| = 1.

    Parameters
    ----------
    a, b, c : float
        Entries of D.
    wide : float
        The second half axis divided by the first one: the rank is that of D without the axes.

    Returns
    -------
    n : pair of float
        Both components, and ρ behind them.
    """
    middle = 0.5 * (a + c)
    high = middle + math.hypot(0.5 * (a - c), b)
    minor = a * c - b * b
    low = minor / high if high > 0.0 else 0.0
    size = math.hypot(x, y)
    if not size > 0.0:
        return 1.0, 0.0, -low
    # A component that is zero in (x, y) and D stays zero in n: no axes of D are computed.
    if moves_along_one(a, b, c, x, y, wide):
        n, m = (a, b) if a >= c else (b, c)
        side = math.copysign(math.hypot(n, m), n * x + m * y)
        n, m = n / side, m / side
        return n, m, n * x + m * y - 2.0 * middle
    # 1/|(ρ + D)⁻¹(x, y)| is increasing and concave: Newton's method from the right stays there.
    rho = size - low
    for _ in range(_MOST_TURNS):
        if not rho + low > 4.0 * EPSILON * middle:
            return x / size, y / size, rho  # no slip begins: the force is below the threshold
        n, m = solved(a, b, c, rho, x, y)
        length = math.hypot(n, m)
        p, q = solved(a, b, c, rho, n, m)
        slope = (n * p + m * q) / length**3
        step = (1.0 / length - 1.0) / slope
        after = max(rho - step, -low + 1e-3 * (rho + low))
        if abs(after - rho) <= 2.0 * EPSILON * (abs(rho) + middle):
            rho = after
            break
        rho = after
    n, m = solved(a, b, c, rho, x, y)
    length = math.hypot(n, m)
    return n / length, m / length, rho


@compiled(inline=True)
def solved(a: float, b: float, c: float, rho: float, x: float, y: float) -> tuple[float, float]:
    """(ρ + D)⁻¹(x, y) by Cramer's rule."""
    minor = (rho + a) * (rho + c) - b * b
    return ((rho + c) * x - b * y) / minor, ((rho + a) * y - b * x) / minor


@compiled()
def moves_along_one(a: float, b: float, c: float, x: float, y: float, wide: float) -> bool:
    """Whether D, without the axes, has rank 1 and (x, y) is in its image."""
    b, c, y = b / wide, c / (wide * wide), y / wide
    if not a + c > 0.0 or not a * c - b * b <= _RANK_ONE * (a + c) * (a + c):
        return False
    n, m = (a, b) if a >= c else (b, c)
    return abs(n * y - m * x) <= _RANK_ONE * math.hypot(n, m) * math.hypot(x, y)


@compiled()
def aim_order(flow: Flow, m: int) -> None:
    """Order m of the directions, and the order of |Au| that follows from it.

    Parameters
    ----------
    flow : Flow
        With bₘ, the rates of Au with order m of the directions 0.
    """
    aims = flow.space.aims
    answer = flow.space.answer
    planes = len(flow.rows.planes)
    for p in range(planes):
        base = AIMS * p
        for i in range(2):
            aims[base + X + i, m] = 0.0
    for _ in range(_MOST_TURNS):
        change = 0.0
        for p in range(planes):
            base = AIMS * p
            leading = int(aims[base + LEADING, 0])
            if not begins_flat(flow, p):
                continue
            n, o = aims[base + N_, 0], aims[base + M_, 0]
            x, y = coupled(flow, p, X, m)
            x += aims[base + BX, m]
            y += aims[base + BY, m]
            along = unit_part(aims, base, m)
            # Â n₀ and Â across n₀, in this order
            share = 1.0 / (m + 1)
            ax = (answer[2 * p, 2 * p] * n + answer[2 * p, 2 * p + 1] * o) * share
            ay = (answer[2 * p + 1, 2 * p] * n + answer[2 * p + 1, 2 * p + 1] * o) * share
            cx = (answer[2 * p, 2 * p + 1] * n - answer[2 * p, 2 * p] * o) * share
            cy = (answer[2 * p + 1, 2 * p + 1] * n - answer[2 * p + 1, 2 * p] * o) * share
            x += along * ax
            y += along * ay
            size = abs(x) + abs(y) + abs(ax) + abs(ay)
            k = m + 1 - leading
            if leading == 1:
                # nₘ occurs on both sides
                rho = aims[base + RHO, 0]
                cx += rho * o
                cy -= rho * n
                x -= rho * along * n
                y -= rho * along * o
            elif leading > 1 and k > 0:
                x -= aims[base + RHO, 0] * aims[base + N_, k]
                y -= aims[base + RHO, 0] * aims[base + M_, k]
            for j in range(1, k if leading > 0 else 0):
                x -= aims[base + RHO, j] * aims[base + N_, k - j]
                y -= aims[base + RHO, j] * aims[base + M_, k - j]
            # (x, y) + ν (cx, cy) = ρₖ n₀
            across = -o * x + n * y
            slope = -o * cx + n * cy
            # Motion in one direction alone is not rotated by transverse forces: the next orders of
            # its velocity determine the rotation of n.
            turns = abs(slope) > _RANK_ONE * (abs(ax) + abs(ay))
            nu = -across / slope if turns else 0.0
            if not turns and leading > 1 and k > 0:
                aims[base + N_, k] -= o * across / aims[base + RHO, 0]
                aims[base + M_, k] += n * across / aims[base + RHO, 0]
            rho = n * (x + nu * cx) + o * (y + nu * cy)
            u, v = along * n - nu * o, along * o + nu * n
            change = max(change, abs(u - aims[base + X, m]) + abs(v - aims[base + Y, m]))
            change = change if planes > 1 else 0.0
            aims[base + X, m], aims[base + Y, m] = u, v
            aims[base + SPARE, m] = rho
            aims[base + SPARE, 0] = size
        if change <= 4.0 * EPSILON:
            break
    for p in range(planes):
        base = AIMS * p
        leading = int(aims[base + LEADING, 0])
        if not begins_flat(flow, p):
            continue
        aims[base + N_, m], aims[base + M_, m] = aims[base + X, m], aims[base + Y, m]
        rho = aims[base + SPARE, m]
        if leading == 0:
            if abs(rho) > NEGLIGIBLE * aims[base + SPARE, 0] and m < MOST_LEADING:
                aims[base + LEADING, 0] = m + 1.0
                aims[base + RHO, 0] = rho
        else:
            aims[base + RHO, m + 1 - leading] = rho


@compiled()
def unit_part(aims: Array, base: int, m: int) -> float:
    """The part of nₘ along n₀, from n·n = 1."""
    s = 0.0
    for j in range(1, m):
        s -= 0.5 * aims[base + N_, j] * aims[base + N_, m - j]
        s -= 0.5 * aims[base + M_, j] * aims[base + M_, m - j]
    return s
