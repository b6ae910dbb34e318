"""Bounds of the rows of a tape along a polynomial of the state, by circular complex arithmetic.

A Taylor polynomial of a function that underflows at the beginning of a step does not describe the
rest of the step. The tape that makes the series can bound the functions themselves. For every row w
numbers are found in one pass, without series: B, with abs(w(τ) − w(0)) ≤ B for all *complex* times
abs(τ) ≤ H, and S, by how much w on the real step [0, h] may differ from what is analytic there. By
Cauchy's estimate the Taylor coefficients are at most B/Hᵏ, so that what a polynomial of degree N
cannot show on [0, h] is below B (h/H)^(N+1)/(1 − h/H) + S.

A third number, a lower bound of abs(w) on the disc, is larger than abs(w(0)) − B where exponentials
grow: a quotient such as 1/(1 + exp u) is known even where the exponential overflows.

The rules are those of circular complex arithmetic; S > 0 comes only from powers that are not whole,
at zero, where they have few derivatives.
"""

from __future__ import annotations

import math

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
)
from stickslip.motion.discs.functions import (
    add_terms,
    spread_angle,
    spread_function,
    spread_product,
)
from stickslip.motion.discs.tables import (
    AT_LEAST,
    BALL,
    DIRECTION_ROW,
    ENTRY,
    IMPLICIT_ROW,
    LINEAR,
    LOG,
    OFF,
    PRODUCT,
    RATES,
    RIGHT,
    SELECT,
    SIDE,
    SLOPE,
    SOLVE,
    SPEED,
    TANH,
    WITHIN,
    DiscTape,
    factor,
    store,
)
from stickslip.symbolic.tape import DIRECTION_GIVEN
from stickslip.translator import RELAXED, compiled

_WIDER = 1.05  # ratio of a trial bound to the computed bound of such a rate
_TURNS = 6  # largest number of iterations for an enclosure of a rate that solves an equation
# largest number of iterations for bounds of the rates of the rate-independent coordinates
_SWEEPS = 40
_WIDENED = 1e-4  # relative amount by which bounds are widened, so that few iterations suffice


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


@compiled(relaxed=RELAXED)
def reach(c: Array, N: int, powers: Array) -> float:
    """Σ abs(cₖ) Hᵏ, 1 ≤ k ≤ N, from the powers of H."""
    total = 0.0
    for k in range(1, N + 1):
        total += abs(c[k]) * powers[k]
    return total


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
    """Disc of a rate v that solves G(v) = 0; False if the instructions after its row have to be
    evaluated again.

    In the first pass v is fixed, and G deviates by at most g. While v is in a disc of radius B, G′
    is in a disc, too, all of whose points are at least d from zero, and so is their mean: v
    deviates by at most g/d. Since v begins at the centre, v remains in its disc if g/d ≤ B.
    """
    code = tape.program.code
    W = tape.W
    discs = tape.discs
    row = code[i, RESULT]
    function = code[i, FIRST]
    slope = code[i, SECOND]
    steep = abs(W[slope, 0])
    # B and S of G for fixed v are stored where only parts of the state need a place (SLOPE).
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
    row, speed : int
        Rows of the direction, the first, and of |Au|.
    mode : int
        Of the contact.
    """
    given = mode == DIRECTION_GIVEN or (mode != 0 and W[speed, 0] == 0.0)
    return bool(given or discs[row, SLOPE] == 1.0)


@compiled()
def spread_direction(tape: DiscTape, mode: Array, i: int) -> None:
    """Discs of u/|u| and |u|.

    The two factors of u² = (u₁ + iu₂)(u₁ − iu₂) begin with the modulus |u|, and deviate by at most
    the sum of the components' deviations, a fraction q of |u|. So their roots deviate by 1 − √(1 −
    q) relative to their modulus, and the reciprocals of these by 1/√(1 − q) − 1. With three
    components, u² deviates by at most 2q + q² relative to itself, and any root of it as above.

    A decelerating slip deviates mostly along its direction. With α along n₀ and β across, it has
    the direction (α n₀ + β)/√(α² + β·β), which deviates by at most ρ/√(1 − ρ²) + 1/√(1 − ρ²) − 1
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
            # |u² − u₀²|/u₀² = r: the roots deviate by 1 − √(1 − r), as with q = r of two components
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
def spread_choice(tape: DiscTape, mode: Array, reg: Array, i: int) -> None:
    """Discs of rows that depend on mode and region."""
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
    """Disc of a multiple of a row (zero for a constant), or of a sum of two.

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
    near = size * discs[source, AT_LEAST] if source >= 0 and other < 0 else 0.0
    if source >= 0 and other >= 0:
        ball, off = ball + discs[other, BALL], off + discs[other, OFF]
    store(W, discs, row, ball, off, near)


@compiled()
def side_operand(mode: int) -> int:
    """The operand of SIDE in a mode: surface, kinetic friction forces, thresholds."""
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
                # Wider than needed, so that the inequality holds after a few sweeps.
                old[j] = max(old[j], total * (1.0 + _WIDENED))
            if settled:
                break
        for j in range(n):
            discs[row + j, part] = old[j] if settled and old[j] < np.inf else np.inf
            discs[row + j, AT_LEAST] = 0.0
