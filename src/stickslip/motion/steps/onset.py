"""Slips in a plane that begin simultaneously: contacts of one body, whose velocities are not
independent.

Their velocities are Au = tᵖ β(t) Z V(t), with an orthonormal basis Z of what the body can do, V =
v₀ + v₁ t + …, |v₀| = 1, vₖ across v₀, and a number β for its speed. All directions n are functions
of V, and the rates of Au depend on their coefficients as in :mod:`stickslip.motion.steps.starting`:

    bₘ + Â nₘ/(m + 1) = (β Z V)ₘ₊₁₋ₚ

is one linear problem an order, for vₘ and an order of β. The first of all, b₀ + Â n(Z v₀) = β₀ Z
v₀, says what minimises a strictly convex function, the accelerations; it is found by Newton's
method where |u| is rounded off, less and less. Where friction changes the normal forces that press
it, the rates are another function of the directions, and b₀ and Â are those of its tangent at each
turn (:mod:`stickslip.motion.steps.response`). Where β₀ vanishes, since the forces have just
reached what can be held, p > 1, and v₀ is the mechanism that begins.

A rod that is pushed across may turn about any point beyond its ends then: there is a face of
mechanisms, in which no n depends on V. It spans L, where what forces Â n with other n can do is
nothing, so that the part in L of each order says β v₀, and from then on the part in L of vₘ₊₁₋ₚ.
"""

from __future__ import annotations

import math

from stickslip.arrays import Array
from stickslip.equations.codegen.series import invert
from stickslip.motion.algebra.vectors import direction_and_turn, is_new
from stickslip.motion.steps.arrays import LEAD, OK, Flow, Instant, Machine
from stickslip.motion.steps.response import (
    AIMS,
    BX,
    LEADING,
    M_,
    N_,
    OX,
    OY,
    RHO,
    X,
    Y,
    answer_to,
    any_bends,
    begins_in,
    part_in_span,
    respond_at,
    span_rates,
    speed_along,
)
from stickslip.numerics.levels import EPSILON, NEW_DIRECTION, NEWTON_TURNS
from stickslip.translator import compiled

# Relative to its terms: a smaller order of |Au| is zero. Rest of a body is proved up to 1e-11 of
# the thresholds (`leaving.py`), so a slip may begin later by that.
NEGLIGIBLE = 1e-10
MOST_LEADING = 5  # largest number of vanishing orders of |Au|
_ROUNDED = 0.1  # factor by which the rounding-off of |u| decreases per iteration
_FINEST = 1e-9  # … and its final value relative to the accelerations without friction
_ACROSS = 1e-13  # squared fraction of a velocity that is perpendicular to others
_FULL = 1e-4  # fraction of the friction that may be missing at the beginning of a slip
_SURE = 1e-9  # step of Newton's method at which it has converged
# Rows of Space.onset: what is solved for and its right-hand side, V at a place, series of one
# contact (both components, |V|), β, and V behind them.
_SOLVED, _RIGHT, _PLACE, _TRIED, _U, _V, _SIZE, _BETA, _FIRST = range(9)


@compiled(brief=True)
def begin_together(flow: Flow) -> bool:
    """Whether several slips begin, all of them of contacts that may share forces, or one that
    changes normal forces; or one whose motion the others restrict to a line, so that friction does
    not determine its direction."""
    rows = flow.rows
    group = -1
    count = 0
    bends = any_bends(flow)
    for p in rows.formula_planes:
        if begins_in(flow, p):
            return False
    for p in range(len(rows.planes)):
        if begins_in(flow, p):
            own = rows.group[rows.planes[p, LEAD]]
            if not bends and (own < 0 or (count > 0 and own != group)):
                return False
            group = own
            count += 1
    return bool(count > 1 or (count == 1 and group >= 0 and span_rates(flow) == 1))


@compiled(brief=True)
def place_slopes(flow: Flow, rank: int, way: Array, rounded: float, share: float) -> None:
    """The matrix share·ZᵀÂ H Z, H the derivative of all directions u/√(|u|² + rounded²) by u, in
    the work space; the directions themselves are left among the unknowns.

    Parameters
    ----------
    rank : int
        Number of vectors of Z.
    way : array
        V.
    """
    aims, answer, span, matrix = (
        flow.space.aims,
        flow.space.answer,
        flow.space.span,
        flow.space.turn,
    )
    n = 2 * len(flow.rows.planes)
    for i in range(rank):
        for j in range(rank):
            matrix[i, j] = 0.0
    for p in range(len(flow.rows.planes)):
        if not begins_in(flow, p):
            continue
        x, y = speed_along(flow, rank, way, 2 * p), speed_along(flow, rank, way, 2 * p + 1)
        x, y, xx, yy, xy, size = direction_and_turn(x, y, rounded)
        aims[AIMS * p + X, 0], aims[AIMS * p + Y, 0] = x, y
        xx, yy, xy = xx / size, yy / size, xy / size
        for k in range(n):
            if not begins_in(flow, k // 2):
                continue
            a = share * (answer[k, 2 * p] * xx + answer[k, 2 * p + 1] * xy)
            b = share * (answer[k, 2 * p] * xy + answer[k, 2 * p + 1] * yy)
            for i in range(rank):
                for j in range(rank):
                    matrix[i, j] += span[i, k] * (a * span[j, 2 * p] + b * span[j, 2 * p + 1])


@compiled(brief=True)
def respond_along(
    machine: Machine,
    flow: Flow,
    at: Instant,
    table: Array,
    rank: int,
    way: Array,
    rounded: float,
    slopes: bool,
) -> bool:
    """Linearise the rates of Au as b₀ + Â n at the directions u/√(|u|² + rounded²), unless they are
    linear in the directions; False if there are no rates.

    Parameters
    ----------
    flow : Flow
        Receives b₀ and Â in its work space.
    table : array
        Work space.
    rank : int
        Number of vectors of Z.
    way : array
        u.
    slopes : bool
        As in :func:`respond_at`.
    """
    if not any_bends(flow):
        return True
    aims = flow.space.aims
    for p in range(len(flow.rows.planes)):
        if begins_in(flow, p):
            x, y = speed_along(flow, rank, way, 2 * p), speed_along(flow, rank, way, 2 * p + 1)
            x, y, _, _, _, _ = direction_and_turn(x, y, rounded)
            aims[AIMS * p + N_, 0], aims[AIMS * p + M_, 0] = x, y
    return bool(respond_at(machine, flow, at, table, slopes) == OK)


@compiled(brief=True)
def rounded_off(
    machine: Machine,
    flow: Flow,
    at: Instant,
    table: Array,
    rank: int,
    way: Array,
    rounded: float,
    slopes: bool,
    out: Array,
) -> float:
    """b₀ + Â n − u with directions that are rounded off; its size.

    Parameters
    ----------
    machine, flow, at, table, rank, way, rounded, slopes
        As in :func:`respond_along`.
    out : array
        Receives it.
    """
    if not respond_along(machine, flow, at, table, rank, way, rounded, slopes):
        return math.inf
    place_slopes(flow, rank, way, rounded, 1.0)
    part_in_span(flow, rank, BX, 0, out)
    answer_to(flow, rank, X, 0, 1.0, out)
    size = 0.0
    for r in range(rank):
        out[r] -= way[r]
        size += out[r] * out[r]
    return math.sqrt(size)


@compiled(brief=True)
def aim_together(machine: Machine, flow: Flow, at: Instant, table: Array) -> int:
    """v₀, and β₀ unless it vanishes, of slips that begin together; returns the number of vectors of
    Z. Contacts that do not begin to slip have a negative β.

    Parameters
    ----------
    flow : Flow
        With the response to probes.
    table : array
        Work space.
    """
    rows = flow.rows
    bends = any_bends(flow)
    aims, onset = flow.space.aims, flow.space.onset
    way, right, tried = onset[_PLACE], onset[_RIGHT], onset[_TRIED]
    rank = span_rates(flow)
    # Remove all orders of an earlier slip.
    for row in range(len(onset)):
        for k in range(onset.shape[1]):
            onset[row, k] = 0.0
    part_in_span(flow, rank, BX, 0, way)
    size = 0.0
    for r in range(rank):
        size += way[r] * way[r]
    size = math.sqrt(size)
    rounded = size
    while rounded > 0.0:
        off = rounded_off(machine, flow, at, table, rank, way, rounded, True, right)
        for _ in range(NEWTON_TURNS):
            if not off < math.inf:
                break
            for i in range(rank):
                flow.space.turn[i, i] -= 1.0
            if off <= 4.0 * EPSILON * size or not invert(flow.space.turn, rank, flow.space.turned):
                break
            step_back(flow, rank)
            length = 1.0
            after = math.inf
            for _ in range(30):
                for r in range(rank):
                    tried[r] = way[r] + length * onset[_SOLVED, r]
                after = rounded_off(machine, flow, at, table, rank, tried, rounded, False, right)
                if after < (1.0 - 0.1 * length) * off:
                    break
                length *= 0.5
            if not after < off:
                break
            off = after
            for r in range(rank):
                way[r] = tried[r]
            if bends:
                off = rounded_off(machine, flow, at, table, rank, way, rounded, True, right)
        if rounded <= _FINEST * size:
            break
        rounded *= _ROUNDED
    if size > 0.0:
        rounded_off(machine, flow, at, table, rank, way, rounded, True, right)
    least = 1.0
    for p in range(len(rows.planes)):
        if begins_in(flow, p):
            least = min(least, math.hypot(aims[AIMS * p + X, 0], aims[AIMS * p + Y, 0]))
    refined = size > 0.0 and least >= 1.0 - _FULL
    refined = refined and refine_face(machine, flow, at, table, rank, size)
    if not refined and size > 0.0:
        refined = refine_aim(machine, flow, at, table, rank, size)
    if refined and (not bends or respond_at(machine, flow, at, table, True) == OK):
        return rank
    # A contact whose force is far below its threshold does not begin, nor does one that the others
    # do not let move.
    if size > 0.0:
        rounded_off(machine, flow, at, table, rank, tried, rounded, True, right)
    for p in range(len(rows.planes)):
        if begins_in(flow, p):
            full = math.hypot(aims[AIMS * p + X, 0], aims[AIMS * p + Y, 0])
            aims[AIMS * p + LEADING, 0] = 1.0
            aims[AIMS * p + RHO, 0] = 0.0
            if full < 1.0 - _FULL or full <= least or not size > 0.0:
                aims[AIMS * p + RHO, 0] = -size if size > 0.0 else -1.0
    return rank


@compiled(brief=True)
def place_face(flow: Flow, rank: int, way: Array) -> int:
    """An orthonormal basis of the mechanisms with the directions of V, preceded by one of all
    others; V is its first vector. Returns the number of the others.

    Parameters
    ----------
    flow : Flow
        Receives the basis in its work space, as rows.
    rank : int
        Number of vectors of Z.
    way : array
        V.
    """
    span, face = flow.space.span, flow.space.face
    others = 0
    for p in range(len(flow.rows.planes)):
        if not begins_in(flow, p) or others == rank:
            continue
        x, y = speed_along(flow, rank, way, 2 * p), speed_along(flow, rank, way, 2 * p + 1)
        speed = math.hypot(x, y)
        size = 0.0
        for r in range(rank):
            # The cross product vanishes for mechanisms that keep the direction of this slip.
            face[others, r] = (x * span[r, 2 * p + 1] - y * span[r, 2 * p]) / speed
            size += face[others, r] ** 2
        if size > NEW_DIRECTION and is_new(rank, face, others, _ACROSS):
            others += 1
    number = others
    for k in range(-1, rank):
        for r in range(rank if number < rank else 0):
            face[number, r] = way[r] if k < 0 else 0.0
        if number < rank and k >= 0:
            face[number, k] = 1.0
        if number < rank and is_new(rank, face, number, _ACROSS):
            number += 1
    return others


@compiled(brief=True)
def refine_face(
    machine: Machine, flow: Flow, at: Instant, table: Array, rank: int, size: float
) -> bool:
    """Refine the directions of a face of mechanisms to rounding errors, if forces have just reached
    the limit; False if not, or if there is one mechanism only.

    Parameters
    ----------
    flow : Flow
        With one of them times some number in its work space, which stays.
    table : array
        Work space.
    rank : int
        Number of vectors of Z.
    size : float
        Of the accelerations without friction.
    """
    onset, matrix = flow.space.onset, flow.space.turn
    way, right = onset[_TRIED], onset[_RIGHT]
    length = 0.0
    for r in range(rank):
        length += onset[_PLACE, r] ** 2
    for r in range(rank):
        way[r] = onset[_PLACE, r] / math.sqrt(length)
    before = math.inf
    for _ in range(NEWTON_TURNS):
        others = place_face(flow, rank, way)
        number = rank - others
        if number < 2 or not respond_along(machine, flow, at, table, rank, way, 0.0, True):
            return False
        place_slopes(flow, rank, way, 0.0, 1.0)
        part_in_span(flow, rank, BX, 0, right)
        answer_to(flow, rank, X, 0, 1.0, right)
        border(matrix, rank, flow.space.face, others, number, 0.0)
        for i in range(number):
            right[rank + i] = 0.0
        if not invert(matrix, rank + number, flow.space.turned):
            return False
        step_back(flow, rank + number)
        change, beta = 0.0, 0.0
        for r in range(rank):
            way[r] += onset[_SOLVED, r]
            change = max(change, abs(onset[_SOLVED, r]))
        for i in range(number):
            beta = max(beta, abs(onset[_SOLVED, rank + i]))
        if not beta <= NEGLIGIBLE * size:
            return False
        if change <= 2.0 * EPSILON or (change < _SURE and not change < before):
            begin_along(flow, rank, way, 0.0, 0.0)
            return True
        before = change
    return False


@compiled(brief=True)
def begin_along(flow: Flow, rank: int, way: Array, beta: float, leading: float) -> None:
    """Put v₀ and β₀, and the directions of all slips that begin.

    Parameters
    ----------
    rank : int
        Number of vectors of Z.
    way : array
        v₀.
    beta, leading : float
        β₀, and the order p; both are 0 where β₀ is not known.
    """
    for r in range(rank):
        flow.space.onset[_FIRST + r, 0] = way[r]
    flow.space.onset[_BETA, 0] = beta
    for p in range(len(flow.rows.planes)):
        if begins_in(flow, p):
            flow.space.aims[AIMS * p + LEADING, 0] = leading
            aim_of(flow, rank, p, 0)


@compiled(brief=True)
def step_back(flow: Flow, rank: int) -> None:
    """Solve the problem in the work space for a step of Newton's method."""
    onset = flow.space.onset
    for i in range(rank):
        onset[_SOLVED, i] = 0.0
        for j in range(rank):
            onset[_SOLVED, i] -= flow.space.turned[i, j] * onset[_RIGHT, j]


@compiled(brief=True)
def refine_aim(
    machine: Machine, flow: Flow, at: Instant, table: Array, rank: int, size: float
) -> bool:
    """v₀ and β₀ from a neighbourhood, exactly; False if not all slips begin.

    Parameters
    ----------
    flow : Flow
        With v₀ times some number in its work space.
    table : array
        Work space.
    rank : int
        Number of vectors of Z.
    size : float
        Of the accelerations without friction.
    """
    onset, matrix = flow.space.onset, flow.space.turn
    way, right = onset[_PLACE], onset[_RIGHT]
    beta = 0.0
    for r in range(rank):
        beta += way[r] * way[r]
    beta = math.sqrt(beta)
    for r in range(rank):
        way[r] /= beta
    for r in range(rank):
        onset[_TRIED, r] = beta * way[r]
    before = math.inf
    settled = False
    for _ in range(NEWTON_TURNS):
        if not respond_along(machine, flow, at, table, rank, way, 0.0, True):
            return False
        # Newton's method for v and β in Zᵀ(b₀ + Â n) = β v, bordered by |v|² = 1.
        place_slopes(flow, rank, way, 0.0, 1.0)
        part_in_span(flow, rank, BX, 0, right)
        answer_to(flow, rank, X, 0, 1.0, right)
        border(matrix, rank, onset, _PLACE, 1, beta)
        length = 0.0
        for r in range(rank):
            right[r] -= beta * way[r]
            length += way[r] * way[r]
        right[rank] = 0.5 * (1.0 - length)
        if not invert(matrix, rank + 1, flow.space.turned):
            return False
        step_back(flow, rank + 1)
        change = 0.0
        for r in range(rank):
            way[r] += onset[_SOLVED, r]
            change = max(change, abs(onset[_SOLVED, r]))
        beta += onset[_SOLVED, rank]
        # Corrections that no longer decrease have reached the rounding errors.
        settled = change <= 2.0 * EPSILON or (change < _SURE and not change < before)
        if settled:
            break
        before = change
    if not settled:
        return False
    found = abs(beta) > NEGLIGIBLE * size
    begin_along(flow, rank, way, beta if found else 0.0, 1.0 if found else 0.0)
    return True


@compiled(brief=True)
def border(matrix: Array, rank: int, sides: Array, first: int, number: int, beta: float) -> None:
    """Put −β on the diagonal of a matrix, and rows times −1 around it.

    Parameters
    ----------
    sides : array
        The rows, such as V.
    first, number : int
        The first of them, and how many they are.
    """
    for r in range(rank):
        matrix[r, r] -= beta
        for i in range(number):
            matrix[r, rank + i] = matrix[rank + i, r] = -sides[first + i, r]
    for i in range(number):
        for j in range(number):
            matrix[rank + i, rank + j] = 0.0


@compiled(brief=True)
def aim_of(flow: Flow, rank: int, p: int, m: int) -> None:
    """Directions of a contact up to order m, and ρ as far as β is known, from V.

    Parameters
    ----------
    rank : int
        Number of vectors of Z.
    p, m : int
        The plane, and the order.
    """
    aims, onset = flow.space.aims, flow.space.onset
    x, y, size = onset[_U], onset[_V], onset[_SIZE]
    base = AIMS * p
    for k in range(m + 1):
        x[k], y[k] = aims[base + OX, k], aims[base + OY, k]
        for r in range(rank):
            x[k] += flow.space.span[r, 2 * p] * onset[_FIRST + r, k]
            y[k] += flow.space.span[r, 2 * p + 1] * onset[_FIRST + r, k]
        if k == 0:
            size[0] = math.hypot(x[0], y[0])
        else:
            square = 0.0
            for j in range(k + 1):
                square += x[j] * x[k - j] + y[j] * y[k - j]
            for j in range(1, k):
                square -= size[j] * size[k - j]
            size[k] = 0.5 * square / size[0]
        a, b = x[k], y[k]
        for j in range(1, k + 1):
            a -= size[j] * aims[base + N_, k - j]
            b -= size[j] * aims[base + M_, k - j]
        aims[base + N_, k], aims[base + M_, k] = a / size[0], b / size[0]
    leading = int(aims[base + LEADING, 0])
    for k in range(m + 2 - leading if leading > 0 else 0):
        aims[base + RHO, k] = 0.0
        for j in range(k + 1):
            aims[base + RHO, k] += onset[_BETA, j] * size[k - j]


@compiled(brief=True)
def set_apart(flow: Flow, rank: int, m: int) -> None:
    """Remove from order m of Au/tᵖ the component that is impossible for the body at first, and
    possible as it rotates, in terms of β.

    Parameters
    ----------
    flow : Flow
        With order m + p of Au, which is changed; lower orders are done.
    rank : int
        Number of vectors of Z.
    """
    aims, onset, span = flow.space.aims, flow.space.onset, flow.space.span
    n = 2 * len(flow.rows.planes)
    part_in_span(flow, rank, OX, m, onset[_SOLVED])
    for i in range(n):
        if not begins_in(flow, i // 2):
            continue
        row = AIMS * (i // 2) + OX + i % 2
        own = aims[row, m]
        for r in range(rank):
            own -= span[r, i] * onset[_SOLVED, r]
        for j in range(1, m):
            own -= onset[_BETA, j] * aims[row, m - j]
        known = onset[_BETA, 0] != 0.0
        aims[row, m] = own / onset[_BETA, 0] if known else 0.0


@compiled(brief=True)
def discard_orders(flow: Flow) -> None:
    """Discard all but the first order of V, β and all directions, once the leading order of Au is
    known."""
    aims, onset = flow.space.aims, flow.space.onset
    for row in range(_BETA, len(onset)):
        for k in range(1, onset.shape[1]):
            onset[row, k] = 0.0
    for p in range(len(flow.rows.planes)):
        for k in range(1, aims.shape[1] if begins_in(flow, p) else 0):
            for row in (N_, M_, RHO, OX, OY):
                aims[AIMS * p + row, k] = 0.0


@compiled(brief=True)
def aim_order_together(flow: Flow, rank: int, m: int, lost: float) -> None:
    """Order m of V, and the order of β that follows from it.

    Parameters
    ----------
    flow : Flow
        With bₘ, the rates of Au with order m of the directions 0, and order m + p of Au.
    rank : int
        Number of vectors of Z.
    lost : float
        Rounding errors of an order of Au.
    """
    rows = flow.rows
    aims, onset, matrix = flow.space.aims, flow.space.onset, flow.space.turn
    way, right, face = onset[_PLACE], onset[_RIGHT], flow.space.face
    leading = 0
    set_apart(flow, rank, m)
    for p in range(len(rows.planes)):
        if begins_in(flow, p):
            leading = int(aims[AIMS * p + LEADING, 0])
    share = 1.0 / (m + 1)
    for r in range(rank):
        way[r] = onset[_FIRST + r, 0]
    others = place_face(flow, rank, way) if leading != 1 else rank - 1
    number = rank - others
    # The result of the first iteration in a face changes the directions of the second.
    for _ in range(1 if number == 1 else 2):
        for r in range(rank):
            way[r] = onset[_FIRST + r, 0]
            onset[_FIRST + r, m] = 0.0
        for p in range(len(rows.planes)):
            if begins_in(flow, p):
                aim_of(flow, rank, p, m)
        place_slopes(flow, rank, way, 0.0, share)
        if number == 1:
            border(matrix, rank, onset, _PLACE, 1, onset[_BETA, 0] if leading == 1 else 0.0)
        else:
            border(matrix, rank, face, others, number, 0.0)
        part_in_span(flow, rank, BX, m, right)
        answer_to(flow, rank, N_, m, share, right)
        size = 0.0
        for r in range(rank):
            size += abs(right[r])
        least = max(NEGLIGIBLE * size, lost)
        last = m + 1 - leading
        for j in range(last + 1 if leading > 0 else 0):
            for r in range(rank):
                right[r] -= onset[_BETA, j] * onset[_FIRST + r, last - j]
        for i in range(number):
            right[rank + i] = 0.0
        if not invert(matrix, rank + number, flow.space.turned):
            return
        step_back(flow, rank + number)
        for r in range(rank):
            onset[_FIRST + r, m] = onset[_SOLVED, r]
        if number > 1:
            leading = find_in_face(flow, rank, others, m, leading, least)
            if leading < 0:
                return
        elif leading > 0 and last >= 0:
            onset[_BETA, last] += onset[_SOLVED, rank]
        elif leading == 0 and abs(onset[_SOLVED, rank]) > least and m < MOST_LEADING:
            leading = m + 1
            onset[_BETA, 0] = onset[_SOLVED, rank]
    for p in range(len(rows.planes)):
        if begins_in(flow, p):
            aims[AIMS * p + LEADING, 0] = leading
            aim_of(flow, rank, p, m)


@compiled(brief=True)
def find_in_face(flow: Flow, rank: int, others: int, m: int, leading: int, least: float) -> int:
    """Solve order m in a face of mechanisms: returns v₀ and β₀; or an order of β, and the component
    of the order of V in the face.

    Parameters
    ----------
    flow : Flow
        With β V in the face in place of what is solved for.
    rank, others : int
        Number of vectors of Z, and of those across the face.
    m, leading : int
        The order m, and p (0: not known yet).
    least : float
        Below which an order of β is none.

    Returns
    -------
    int
        p; negative if something would begin against its direction.
    """
    rows = flow.rows
    aims, onset, face = flow.space.aims, flow.space.onset, flow.space.face
    way = onset[_TRIED]
    length = 0.0
    for r in range(rank):
        way[r] = 0.0
        for i in range(rank - others):
            way[r] += onset[_SOLVED, rank + i] * face[others + i, r]
        length += way[r] * way[r]
    length = math.sqrt(length)
    if leading > m + 1:
        return leading
    if leading > 0:
        last = m + 1 - leading
        change = 0.0
        for r in range(rank):
            change += way[r] * onset[_FIRST + r, 0]
        onset[_BETA, last] += change
        for r in range(rank if last > 0 else 0):
            across = way[r] - change * onset[_FIRST + r, 0]
            onset[_FIRST + r, last] += across / onset[_BETA, 0]
        return leading
    if not length > least or m >= MOST_LEADING:
        return 0
    for p in range(len(rows.planes)):
        if begins_in(flow, p):
            along = aims[AIMS * p + N_, 0] * speed_along(flow, rank, way, 2 * p)
            along += aims[AIMS * p + M_, 0] * speed_along(flow, rank, way, 2 * p + 1)
            aims[AIMS * p + LEADING, 0] = m + 1
            aims[AIMS * p + RHO, 0] = along if along > NEGLIGIBLE * length else -length
            if not along > NEGLIGIBLE * length:
                leading = -1
    if leading < 0:
        return leading
    for r in range(rank):
        way[r] /= length
    begin_along(flow, rank, way, length, m + 1.0)
    return m + 1
