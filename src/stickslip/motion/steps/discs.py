"""How far the rows of a tape stray while the state follows a polynomial: arithmetic of discs.

A Taylor polynomial of a function that underflows where a step begins says nothing about the rest of
the step. The tape that makes the series can bound the functions themselves. For every row w numbers
are found in one pass, without series: B, with abs(w(τ) − w(0)) ≤ B for all *complex* times abs(τ) ≤
H, and S, by how much w on the real step [0, h] may differ from what is analytic there. By Cauchy's
estimate the Taylor coefficients are at most B/Hᵏ, so that what a polynomial of degree N cannot show
on [0, h] is below B (h/H)^(N+1)/(1 − h/H) + S.

A third number, a lower bound of abs(w) on the disc, is larger than abs(w(0)) − B where exponentials
grow: a quotient such as 1/(1 + exp u) is known even where the exponential overflows.

The rules are those of circular complex arithmetic; S > 0 comes only from powers that are not whole,
at zero, where they have few derivatives.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.program import (
    FIFTH,
    FIRST,
    FOURTH,
    OPERATION,
    PLACE,
    RESULT,
    SECOND,
    SIZE,
    THIRD,
    Program,
)
from stickslip.motion.steps.arrays import (
    AHEAD,
    AIM,
    AIM_SPEED,
    AU_IS_LINEAR,
    COMPONENT,
    COORDINATES,
    INERTIAL,
    MASSIVE,
    MEMBERS,
    OTHER,
    PART,
    THIRD_PART,
    Flow,
    Rows,
    parts_of,
)
from stickslip.motion.steps.roots import horner
from stickslip.symbolic.tape import DIRECTION_GIVEN, Op
from stickslip.translator import RELAXED, compiled

LINEAR, PRODUCT, QUOTIENT, _RECIPROCAL, _POWER = (
    int(op) for op in (Op.LINEAR, Op.PRODUCT, Op.QUOTIENT, Op.RECIPROCAL, Op.POWER)
)
_EXP, LOG, ROTATION, STEADY_ROW, HYPERBOLIC = (
    int(op) for op in (Op.EXP, Op.LOG, Op.ROTATION, Op.STEADY, Op.HYPERBOLIC)
)
CHAIN, TAN, TANH = (int(op) for op in (Op.CHAIN, Op.TAN, Op.TANH))
SELECT, SIDE, SPEED, ENTRY, RIGHT, SOLVE, RATES = (
    int(op) for op in (Op.SELECT, Op.SIDE, Op.SPEED, Op.ENTRY, Op.RIGHT, Op.SOLVE, Op.RATES)
)
IMPLICIT_ROW, WITHIN, DIRECTION_ROW = int(Op.IMPLICIT), int(Op.WITHIN), int(Op.DIRECTION)
# Columns of a table of discs: the numbers B and S of a row and the lower bound of its modulus; and,
# for a part of the state, how far its derivative strays.
BALL, OFF, _NEAR, SLOPE = range(4)
_LARGE = 700.0  # what the exponential function can take
_WIDER = 1.05  # factor between what bounds such a rate and what is tried
_TURNS = 6  # of an enclosure of a rate that solves an equation
_SWEEPS = 40  # of an iteration that bounds the rates of the rate-independent coordinates


class DiscTape(NamedTuple):
    """The tape of a system, with the values of its rows and their discs.

    Attributes
    ----------
    program : Program
    K : array
        Constants.
    W, discs : arrays
        Values of the rows (order 0), and their discs.
    Rq, Rz, B : arrays
        Inverses of the linear problems.
    balls : array
        Work space of :func:`solve_rate_discs`.
    """

    program: Program
    K: Array
    W: Array
    discs: Array
    Rq: Array
    Rz: Array
    B: Array
    balls: Array


@compiled()
def tape_of(flow: Flow) -> DiscTape:
    """The tape of a system, at the instant of which the series are in the work space."""
    s = flow.space
    return DiscTape(flow.rows.program, flow.k.K, s.W, s.discs, s.Rq, s.Rz, s.B, s.balls)


@compiled()
def factor(p: Program, K: Array, i: int) -> float:
    """The constant in front of a term."""
    place = p.term_factor[i]
    return float(K[place] if place >= 0 else p.numbers[-1 - place])


@compiled(relaxed=RELAXED)
def reach(c: Array, N: int, powers: Array) -> float:
    """Σ abs(cₖ) Hᵏ, 1 ≤ k ≤ N, from the powers of H."""
    total = 0.0
    for k in range(1, N + 1):
        total += abs(c[k]) * powers[k]
    return total


@compiled()
def grown(x: float) -> float:
    """exp(x) − 1."""
    return math.expm1(x) if x < _LARGE else np.inf


@compiled()
def lifted(x: float) -> float:
    """exp(x)."""
    return math.exp(x) if x < _LARGE else np.inf


@compiled()
def power_disc(a: float, b: float, y: float, p: float) -> float:
    """Disc of aᵖ, from the centre and the radius of a, and the value at the centre."""
    r = b / abs(a)
    if p >= 1.0:
        return abs(y) * r * p * (1.0 + r) ** (p - 1.0)  # mean value
    if p >= 0.0:
        return abs(y) * (1.0 - (1.0 - r) ** p)
    return abs(y) * ((1.0 - r) ** p - 1.0)


@compiled()
def tanh_disc(a: float, b: float, y: float) -> float:
    """Disc of tanh a: from exp(−2|a|), so that saturated ends cost nothing, or from tan of the
    radius near zero."""
    small = math.exp(-2.0 * abs(a))
    moved = small * grown(2.0 * b) if 2.0 * (b - abs(a)) < _LARGE else np.inf
    left = 1.0 + small - moved
    found = 2.0 * moved / ((1.0 + small) * left) if left > 0.0 else np.inf
    if b < 1.5:
        turned = math.tan(b)
        left = 1.0 - abs(y) * turned
        if left > 0.0:
            found = min(found, (1.0 - y * y) * turned / left)
    return found


@compiled()
def tan_disc(b: float, y: float) -> float:
    """Disc of tan a, from the radius of a and the value at the centre."""
    if b >= 1.5:
        return np.inf
    turned = math.tan(b)
    left = 1.0 - abs(y) * turned
    return (1.0 + y * y) * turned / left if left > 0.0 else np.inf


@compiled()
def store(W: Array, discs: Array, row: int, ball: float, off: float, near: float) -> None:
    """Keep the numbers of a row; what is no bound is infinite, or zero.

    Parameters
    ----------
    W : array
        Values of the rows (order 0).
    discs : array, shape (rows, 4)
        Receives the numbers.
    row : int
    ball, off, near : float
        B, S and the lower bound of the modulus.
    """
    discs[row, BALL] = ball if ball < np.inf else np.inf
    discs[row, OFF] = off if off < np.inf else np.inf
    left = abs(W[row, 0]) - discs[row, BALL] - discs[row, OFF]
    discs[row, _NEAR] = max(near if near > 0.0 else 0.0, left)


@compiled()
def spread_state(W: Array, N: int, powers: Array, rows: Array, discs: Array) -> None:
    """Discs of parts of the state, which are the polynomials of the table.

    Parameters
    ----------
    W : array, shape (rows, N + 1)
        Taylor coefficients.
    N : int
        Their order.
    powers : array, shape (N + 1,)
        Of the radius H, in the unit of time of the coefficients.
    rows : array of int
        Parts of the state.
    discs : array, shape (rows, 4)
        Receives their discs.
    """
    for i in range(len(rows)):
        store(W, discs, rows[i], reach(W[rows[i]], N, powers), 0.0, 0.0)


@compiled()
def spread(tape: DiscTape, mode: Array, reg: Array, first: int, last: int) -> None:
    """Discs of the rows that some instructions make, from those of the state and of time.

    Parameters
    ----------
    first, last : int
        Instructions.
    """
    code = tape.program.code
    turn = 0
    i = first - 1
    while i < last - 1:
        i += 1
        op = code[i, OPERATION]
        if op == LINEAR:
            add_terms(tape, i)
        elif op == PRODUCT:
            spread_product(tape, code[i, RESULT], code[i, FIRST], code[i, SECOND])
        elif op <= LOG:
            spread_function(tape, i)
        elif op <= TANH:
            spread_angle(tape, i)
        elif op == SOLVE:
            solve_discs(tape, i)
        elif op == RATES:
            solve_rate_discs(tape, i)
        elif op == IMPLICIT_ROW:
            store(tape.W, tape.discs, code[i, RESULT], 0.0, 0.0, 0.0)
            turn = 0
        elif op == WITHIN:
            turn += 1
            if not spread_within(tape, i, turn):
                i -= code[i, PLACE] + 1
        elif op == DIRECTION_ROW:
            spread_direction(tape, mode, i)
        else:
            spread_choice(tape, mode, reg, i)


@compiled()
def spread_within(tape: DiscTape, i: int, turn: int) -> bool:
    """Disc of a rate v that solves G(v) = 0; False if what is behind its row has to be followed
    once more.

    In the first turn v is held, and G strays by some g. While v is in a disc of radius B, G′ stays
    in a disc, too, whose points are all at least d from zero, and so is their mean: v strays by at
    most g/d. Since v begins in the middle, that is true throughout if g/d ≤ B.
    """
    code = tape.program.code
    W = tape.W
    discs = tape.discs
    row = code[i, RESULT]
    function = code[i, FIRST]
    slope = code[i, SECOND]
    steep = abs(W[slope, 0])
    # B and S of G, with v held, stand where only parts of the state need a place (SLOPE).
    left = steep
    if turn == 1:
        discs[row, SLOPE] = discs[function, BALL]
        discs[slope, SLOPE] = discs[function, OFF]
    else:
        left -= discs[slope, BALL] + discs[slope, OFF]
    ball = discs[row, SLOPE] / left if left > 0.0 else np.inf
    off = discs[slope, SLOPE] / left if left > 0.0 else np.inf
    if turn > 1 and ball <= discs[row, BALL] and off <= discs[row, OFF]:
        store(W, discs, row, ball, off, 0.0)
        return True
    if turn > _TURNS or not (ball < np.inf and off < np.inf):
        store(W, discs, row, np.inf, np.inf, 0.0)
        return True
    store(W, discs, row, _WIDER * ball, _WIDER * off, 0.0)
    return False


@compiled()
def is_given(W: Array, discs: Array, row: int, speed: int, mode: int) -> bool:
    """Whether the rows of the direction of a slip are polynomials, as the state is: given, or
    noted to be right (:func:`follow_directions`).

    Parameters
    ----------
    W, discs : arrays
    row, speed : int
        Rows of the direction, the first, and of |Au|.
    mode : int
        Of the contact.
    """
    given = mode == DIRECTION_GIVEN or (mode != 0 and W[speed, 0] == 0.0)
    return bool(given or discs[row, SLOPE] == 1.0)


@compiled()
def give_directions(rows: Rows, mode: Array, given: bool) -> None:
    """Let the directions of slips in a plane be given, or follow from the state again.

    So nothing is divided by a speed: an audit has the direction of a step as one more candidate,
    and asks whether it is that of the velocity.

    Parameters
    ----------
    rows : Rows
    mode : array of int, shape (contacts,)
        Is changed.
    given : bool
    """
    for p in range(len(rows.planes)):
        if mode[rows.planes[p, COMPONENT]] != 0:
            give_direction(rows, p, mode, DIRECTION_GIVEN if given else 1)


@compiled()
def give_direction(rows: Rows, p: int, mode: Array, value: int) -> None:
    """Set the mode of plane p."""
    mode[rows.planes[p, COMPONENT]] = value
    mode[rows.planes[p, OTHER]] = value
    if rows.planes[p, THIRD_PART] >= 0:
        mode[rows.planes[p, THIRD_PART]] = value


@compiled()
def take_directions(rows: Rows, W: Array, N: int, x: float, V: Array) -> None:
    """Put the directions that polynomials have at a place into a table.

    Parameters
    ----------
    rows : Rows
    W : array
        The polynomials.
    N : int
        Order of those of the state.
    x : float
        The place, in the unit of their time.
    V : array
        Receives them.
    """
    for p in range(len(rows.planes)):
        take_direction(rows, p, W, N, x, V)


@compiled()
def take_direction(rows: Rows, p: int, W: Array, N: int, x: float, V: Array) -> None:
    """Put the direction of one slip into a table.

    Parameters
    ----------
    rows : Rows
    p : int
        The plane.
    W, N, x, V
        As of :func:`take_directions`.
    """
    for row in range(rows.planes[p, AIM], rows.planes[p, AIM_SPEED] + 1):
        V[row, 0] = horner(W[row], N - 1, x)


@compiled()
def follow_directions(
    rows: Rows, mode: Array, W: Array, N: int, x: float, tol: float, discs: Array
) -> bool:
    """Note the slips in a plane whose directions are those that their polynomials show; whether
    there are any.

    On [0, x] a polynomial P is the direction of Au if P × Au = 0 and P·P = 1. Orders below N vanish
    since P is made that way; if the others are negligible, it does not matter what u/|u| does for
    complex times. So one step leads to the end of a slip, however close its zero is, once the
    direction no longer turns by a power of the time that is left.

    Parameters
    ----------
    rows : Rows
    mode : array of int, shape (contacts,)
    W : array, shape (rows, N + 1)
        Taylor coefficients.
    N : int
        Their order.
    x : float
        The step, in the unit of time of the coefficients.
    tol : float
        Part of the speed that is negligible.
    discs : array, shape (rows, 4)
        Receives 1 for a direction that is right, else 0, in place of a slope.
    """
    found = False
    for p in range(len(rows.planes)):
        plane = rows.planes[p]
        aim = plane[AIM]
        parts = parts_of(rows, p)
        speed = W[plane[AIM_SPEED], 0]
        across, longer = 0.0, 0.0
        power = x**N
        # Without mass Au follows from the direction, and says nothing of it.
        asked = plane[MASSIVE] == 1 and mode[plane[COMPONENT]] != 0 and speed > 0.0
        for k in range(N, 2 * N - 1 if asked else 0):
            length = 0.0
            for i in range(parts):
                for other in range(i):
                    turned = 0.0
                    a, b = W[plane[AHEAD + other]], W[plane[AHEAD + i]]
                    for j in range(k - N + 1, N):
                        turned += W[aim + other, j] * b[k - j] - W[aim + i, j] * a[k - j]
                    across += abs(turned) * power
                for j in range(k - N + 1, N):
                    length += W[aim + i, j] * W[aim + i, k - j]
            longer += abs(length) * power
            power *= x
        right = asked and across <= tol * speed and longer <= tol
        discs[plane[AIM], SLOPE] = 1.0 if right else 0.0
        found = found or right
    return found


@compiled()
def forget_directions(rows: Rows, discs: Array) -> None:
    """Take back what :func:`follow_directions` has noted."""
    for p in range(len(rows.planes)):
        discs[rows.planes[p, AIM], SLOPE] = 0.0


@compiled()
def spread_given(flow: Flow, mode: Array, N: int) -> None:
    """Discs of the directions of slips that are polynomials, as :func:`spread_state` makes them;
    and, where Au is a polynomial, how far it strays along its direction, and across.

    Parameters
    ----------
    flow : Flow
        With Taylor coefficients, and the powers of the radius; receives the discs.
    mode : array of int, shape (contacts,)
    N : int
        Order of the coefficients.
    """
    rows, W, discs, powers = flow.rows, flow.space.W, flow.space.discs, flow.space.reaches
    for p in range(len(rows.planes)):
        first = rows.planes[p, AIM]
        speed = rows.planes[p, AIM_SPEED]
        if is_given(W, discs, first, speed, int(mode[rows.planes[p, COMPONENT]])):
            for row in range(first, speed + 1):
                store(W, discs, row, reach(W[row], N - 1, powers), 0.0, 0.0)
        discs[speed, SLOPE] = -1.0
        if rows.planes[p, AU_IS_LINEAR] == 1 and W[speed, 0] > 0.0:
            spread_straight(flow, p, N)


@compiled()
def spread_straight(flow: Flow, p: int, N: int) -> None:
    """How far Au of a slip strays along its direction, and across, in place of two slopes.

    Parameters
    ----------
    flow : Flow
        As of :func:`spread_given`.
    p, N : int
        The plane, and the order of the coefficients.
    """
    rows, W, discs, powers = flow.rows, flow.space.W, flow.space.discs, flow.space.reaches
    plane = rows.planes[p]
    along, across = 0.0, 0.0
    for k in range(1, N + 1):
        inwards, square = 0.0, 0.0
        for i in range(parts_of(rows, p)):
            c = plane[COMPONENT + i]
            part = rows.parts[rows.homes[c, PART]]
            axis = flow.k.J[c, flow.k.J.shape[1] - 3] if rows.group[c] >= 0 else 1.0
            moved = 0.0
            for j in range(part[COORDINATES]):
                q = rows.sizes[INERTIAL] + rows.members[part[MEMBERS] + j]
                moved += axis * flow.k.J[c, j] * (W[q, k] * powers[k])
            inwards += moved * W[plane[AIM] + i, 0]
            square += moved * moved
        along += abs(inwards)
        # rounding errors of what is across count as across
        across += math.sqrt(max(square - inwards * inwards, 4e-16 * square))
    discs[plane[AIM_SPEED], SLOPE] = across
    discs[plane[AIM] + 1, SLOPE] = along


@compiled()
def spread_direction(tape: DiscTape, mode: Array, i: int) -> None:
    """Discs of u/|u| and |u|.

    The two factors of u² = (u₁ + iu₂)(u₁ − iu₂) begin with the modulus |u|, and stray by no more
    than both components together, a part q of that. So their roots stray by 1 − √(1 − q), in parts
    of their own modulus, and the reciprocals of these by 1/√(1 − q) − 1. With three components, u²
    strays by at most 2q + q² in parts of itself, and any root of it as these do together.

    A slip that is braked strays mostly along itself. With α along n₀ and β across, it has the
    direction (α n₀ + β)/√(α² + β·β), which strays by no more than ρ/√(1 − ρ²) + 1/√(1 − ρ²) − 1
    with any bound ρ of |β|/|α|.
    """
    code = tape.program.code
    W = tape.W
    discs = tape.discs
    row = code[i, RESULT]
    last = row + code[i, SIZE] - 1
    if is_given(W, discs, row, last, int(mode[code[i, PLACE]])):
        return
    speed = W[last, 0]
    aim = np.inf
    long = np.inf
    off = np.inf
    near = 0.0
    if mode[code[i, PLACE]] == 0:
        aim, long, off = 0.0, 0.0, 0.0
    else:
        q, s = 0.0, 0.0
        for k in range(last - row):
            q += discs[code[i, FIRST + k], BALL]
            s += discs[code[i, FIRST + k], OFF]
        q, s = q / speed, s / speed
        if last - row > 2:
            # |u² − u₀²|/u₀² = r: the roots stray by 1 − √(1 − r), as with q = r of two components
            q = 2.0 * q + q * q
        if q + s < 1.0:
            root = math.sqrt(1.0 - q)
            over = 1.0 / root - 1.0
            aim = (1.0 - root) + over + (1.0 - root) * over
            long = speed * (2.0 - root) ** 2 - speed
            off = 2.0 * s / (1.0 - q - s)
            near = speed * (1.0 - q - s)
        across, along = discs[last, SLOPE], discs[row + 1, SLOPE]
        if across >= 0.0 and along + across < speed:
            rho = across / (speed - along)
            root = math.sqrt(1.0 - rho * rho)
            if (rho + 1.0 - root) / root < aim:
                aim, off = (rho + 1.0 - root) / root, 0.0
                # |α √(1 + (β/α)²) − |u₀||
                long = min(long, along + (speed + along) * (1.0 / root - 1.0))
                near = max(near, (speed - along) * root)
    for k in range(last - row):
        store(W, discs, row + k, aim, off, 0.0)
    store(W, discs, last, long, off * speed if off > 0.0 else 0.0, near)


@compiled()
def add_terms(tape: DiscTape, i: int) -> None:
    """Disc of a linear combination."""
    p = tape.program
    K = tape.K
    W = tape.W
    discs = tape.discs
    ball = 0.0
    off = 0.0
    row = p.code[i, RESULT]
    first = p.code[i, FIRST]
    last = p.code[i, FIRST] + p.code[i, SECOND]
    for j in range(first, last):
        source = p.term_row[j]
        if source >= 0:
            size = abs(factor(p, K, j))
            ball += size * discs[source, BALL] if size > 0.0 else 0.0
            off += size * discs[source, OFF] if size > 0.0 else 0.0
    near = 0.0
    if not abs(W[row, 0]) > ball + off:
        # One term may be larger than all others together.
        for j in range(first, last):
            if p.term_row[j] >= 0:
                others = abs(factor(p, K, j)) * discs[p.term_row[j], _NEAR]
                for k in range(first, last):
                    others -= largest_term(tape, k) if k != j else 0.0
                near = max(near, others if others > 0.0 else 0.0)
    store(W, discs, row, ball, off, near)


@compiled()
def largest_term(tape: DiscTape, j: int) -> float:
    """The largest modulus of a term of a linear combination."""
    size = abs(factor(tape.program, tape.K, j))
    row = tape.program.term_row[j]
    return size * largest(tape.W, tape.discs, row) if row >= 0 else size


@compiled()
def largest(W: Array, discs: Array, row: int) -> float:
    """The largest modulus that a row may have."""
    return abs(W[row, 0]) + discs[row, BALL] + discs[row, OFF]


@compiled()
def spread_product(tape: DiscTape, row: int, a: int, b: int) -> None:
    """Disc of a product of two rows."""
    W = tape.W
    discs = tape.discs
    x = abs(W[a, 0])
    y = abs(W[b, 0])
    u = discs[a, BALL]
    v = discs[b, BALL]
    s, t = discs[a, OFF], discs[b, OFF]
    off = (x + u) * t + s * (y + v) + s * t if s > 0.0 or t > 0.0 else 0.0
    store(W, discs, row, x * v + u * y + u * v, off, discs[a, _NEAR] * discs[b, _NEAR])


@compiled()
def spread_function(tape: DiscTape, i: int) -> None:
    """Discs of quotients, powers, exponentials and logarithms."""
    p = tape.program
    W = tape.W
    discs = tape.discs
    op = p.code[i, OPERATION]
    row = p.code[i, RESULT]
    a = p.code[i, FIRST]
    x = abs(W[a, 0])
    y = W[row, 0]
    u = discs[a, BALL]
    s = discs[a, OFF]
    ball = np.inf
    off = np.inf
    near = 0.0
    if op == QUOTIENT:
        ball, off = quotient_disc(x, u, s, y, W, discs, p.code[i, SECOND])
        near = discs[a, _NEAR] / largest(W, discs, p.code[i, SECOND])
    elif op == _RECIPROCAL:
        ball, off = quotient_disc(1.0, 0.0, 0.0, y, W, discs, a)
        near = 1.0 / (x + u + s)
    elif op == _EXP:
        x = W[a, 0]
        ball = y * grown(u) if u < 1.0 else lifted(x + u)  # y may have underflowed
        off = lifted(x + u) * grown(s) if s > 0.0 else 0.0
        near = lifted(x - u - s)
    elif op == LOG:
        if x > u:
            ball = -math.log1p(-u / x)
            off = s / (x - u - s) if x - u > s else np.inf
    else:
        q = factor(p, tape.K, p.code[i, SECOND])
        farthest = x + u + s
        if y != 0.0 and u + s < x:
            ball = power_disc(x, u, y, q)
            nearest = farthest if q >= 1.0 else x - u - s
            off = abs(q) * nearest ** (q - 1.0) * s if s > 0.0 else 0.0
        elif q > 0.0:
            ball = 0.0
            off = farthest**q if farthest > 0.0 else 0.0
        elif discs[a, _NEAR] > 0.0:
            ball = abs(y) + discs[a, _NEAR] ** q
            off = 0.0
    store(W, discs, row, ball, off, near)


@compiled()
def quotient_disc(
    x: float, u: float, s: float, y: float, W: Array, discs: Array, b: int
) -> tuple[float, float]:
    """Disc of a quotient, from the modulus and the disc of its numerator, and its own value y.

    Parameters
    ----------
    x, u, s : float
        Modulus, B and S of the numerator.
    y : float
        Value of the quotient at the centre.
    W, discs : arrays
        Values of the rows (order 0), and their discs.
    b : int
        Row of the denominator.

    Returns
    -------
    ball, off : float
        B and S; infinite where the denominator may vanish.
    """
    v = discs[b, BALL]
    t = discs[b, OFF]
    left = discs[b, _NEAR]
    ball, off = np.inf, np.inf
    if left > 0.0:
        ball = (u + abs(y) * v) / left
        other = abs(y) + (x + u + s) / left  # where numbers overflow
        if not ball <= other:
            ball = other
        off = (s + (abs(y) + ball) * t) / left if s > 0.0 or t > 0.0 else 0.0
    return ball, off


@compiled()
def spread_angle(tape: DiscTape, i: int) -> None:
    """Discs of sines and cosines, of tan and tanh with their slopes, and of any function that has
    the row of its slope."""
    code = tape.program.code
    W = tape.W
    discs = tape.discs
    op = code[i, OPERATION]
    row = code[i, RESULT]
    a = code[i, FIRST]
    x = W[a, 0]
    y = W[row, 0]
    u = discs[a, BALL]
    s = discs[a, OFF]
    if op <= HYPERBOLIC:
        sine = abs(y)
        cosine = abs(W[row + 1, 0])
        odd = np.inf
        even = np.inf
        if u < _LARGE:
            odd = math.sinh(u)
            even = 2.0 * math.sinh(0.5 * u) ** 2
        off = s
        near = 0.0
        if op == HYPERBOLIC:
            off = s * lifted(abs(x) + u + s) if s > 0.0 else 0.0
            near = 0.5 * lifted(abs(x) - u - s) - 0.5  # |cosh z| ≥ |sinh Re z|
        store(W, discs, row, cosine * odd + sine * even if u > 0.0 else 0.0, off, near)
        store(W, discs, row + 1, sine * odd + cosine * even if u > 0.0 else 0.0, off, near)
    elif op == CHAIN:
        slope = code[i, SECOND]
        steep = abs(W[slope, 0]) + discs[slope, BALL]
        # mean value: on the disc, and for real arguments
        ball = u * steep if u > 0.0 else 0.0
        off = 0.0
        if s > 0.0:
            limit = code[i, THIRD]
            largest = (
                factor(tape.program, tape.K, limit) if limit >= 0 else steep + discs[slope, OFF]
            )
            off = s * largest
        store(W, discs, row, ball, off, 0.0)
    else:
        ball = tanh_disc(x, u, y) if op == TANH else tan_disc(u, y)
        off = s
        if op == TAN and s > 0.0:
            off = s * (1.0 + (abs(y) + tan_disc(u + s, y)) ** 2)
        store(W, discs, row, ball, off, 0.0)
        ball = discs[row, BALL]
        off = discs[row, OFF]
        y = abs(y)
        # The slope 1 ± y² strays as y² does.
        both = 2.0 * (y + ball) * off + off * off if off > 0.0 else 0.0
        store(W, discs, row + 1, (2.0 * y + ball) * ball if ball > 0.0 else 0.0, both, 0.0)


@compiled()
def spread_choice(tape: DiscTape, mode: Array, reg: Array, i: int) -> None:
    """Discs of what depends on mode and region."""
    p = tape.program
    W = tape.W
    discs = tape.discs
    op = p.code[i, OPERATION]
    row = p.code[i, RESULT]
    a = p.code[i, FIRST]
    c = p.code[i, PLACE]
    if op == SELECT:
        j = a if reg[c] == 1 else a + 1
        copy_disc(W, discs, int(p.term_row[j]), -1, abs(factor(p, tape.K, j)), row)
    elif op == SPEED:
        copy_disc(W, discs, a if mode[c] != 0 else -1, -1, 1.0, row)
    elif op == SIDE:
        copy_disc(W, discs, p.code[i, side_operand(int(mode[c]))], -1, 1.0, row)
    elif op == ENTRY:
        threshold = p.code[i, SECOND if mode[c] > 0 else THIRD]
        copy_disc(W, discs, a if mode[c] != 0 else -1, threshold, 1.0, row)
    elif op == RIGHT:
        if mode[c] == 0:
            copy_disc(W, discs, a, -1, 1.0, row)
        else:
            threshold = p.code[i, THIRD if mode[c] > 0 else FOURTH]
            copy_disc(W, discs, p.code[i, SECOND], threshold, 1.0, row)


@compiled()
def copy_disc(W: Array, discs: Array, source: int, other: int, size: float, row: int) -> None:
    """Disc of a multiple of a row (of a constant: nothing), or of a sum of two.

    Parameters
    ----------
    W : array
        Values of the rows (order 0).
    discs : array, shape (rows, 4)
        Receives the disc.
    source, other : int
        The row (negative: a constant), and one that is added to it (negative: none).
    size : float
        Modulus of the factor of `source`.
    row : int
        Whose disc it is.
    """
    ball = size * discs[source, BALL] if source >= 0 and size > 0.0 else 0.0
    off = size * discs[source, OFF] if source >= 0 and size > 0.0 else 0.0
    near = size * discs[source, _NEAR] if source >= 0 and other < 0 else 0.0
    if source >= 0 and other >= 0:
        ball, off = ball + discs[other, BALL], off + discs[other, OFF]
    store(W, discs, row, ball, off, near)


@compiled()
def side_operand(mode: int) -> int:
    """Which operand of SIDE counts: surface, sliding forces, thresholds that are to be broken."""
    if mode == 0:
        return FIRST
    if abs(mode) == 2:
        return FOURTH if mode > 0 else FIFTH
    return SECOND if mode > 0 else THIRD


@compiled()
def solve_discs(tape: DiscTape, i: int) -> None:
    """Discs of R b, of one component."""
    code = tape.program.code
    W = tape.W
    discs = tape.discs
    R = tape.Rq if code[i, SECOND] == 0 else tape.Rz
    row = code[i, RESULT]
    right = code[i, FIRST]
    n = code[i, SIZE]
    first = code[i, PLACE]
    for j in range(n):
        ball, off = 0.0, 0.0
        for k in range(n):
            weight = abs(R[first + j, k])
            if weight != 0.0:
                ball += weight * discs[right + k, BALL]
                off += weight * discs[right + k, OFF]
        store(W, discs, row + j, ball, off, 0.0)


@compiled()
def solve_rate_discs(tape: DiscTape, i: int) -> None:
    """Discs of the solution of A r = b.

    With A = A₀ + A′ and r = r₀ + r′: A₀ r′ = b′ − A′(r₀ + r′), so that any ρ with |A₀⁻¹|(|b′| +
    |A′|(|r₀| + ρ)) ≤ ρ is a bound of r′. What is not analytic obeys the same equation, with r′
    known.
    """
    p = tape.program
    W = tape.W
    matrix = p.code[i, FOURTH]
    R = tape.Rq if matrix == 0 else (tape.Rz if matrix == 1 else tape.B)
    discs = tape.discs
    row = p.code[i, RESULT]
    right = p.code[i, FIRST]
    start = p.code[i, SECOND]
    count = p.code[i, THIRD]
    n = p.code[i, SIZE]
    first = p.code[i, PLACE]
    old, new = tape.balls[0], tape.balls[1]
    for part in (BALL, OFF):
        for j in range(n):
            old[j] = 0.0
        settled = False
        for _ in range(_SWEEPS):
            for j in range(n):
                new[j] = discs[right + j, part]
            for e in range(start, start + count):
                j = p.term_factor[e] // n
                k = p.term_factor[e] % n
                entry = p.term_row[e]
                known = abs(W[row + k, 0]) + (discs[row + k, BALL] if part == OFF else 0.0)
                new[j] += discs[entry, BALL] * old[k] + discs[entry, part] * (
                    known + (old[k] if part == OFF else 0.0)
                )
            settled = True
            for j in range(n):
                total = 0.0
                for k in range(n):
                    weight = abs(R[first + j, k])
                    total += weight * new[k] if weight != 0.0 else 0.0
                settled = settled and total <= old[j]
                old[j] = max(old[j], total * (1.0 + 1e-4))
            if settled:
                break
        for j in range(n):
            discs[row + j, part] = old[j] if settled and old[j] < np.inf else np.inf
            discs[row + j, _NEAR] = 0.0
