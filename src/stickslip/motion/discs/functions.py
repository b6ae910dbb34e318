"""Discs of single functions in compiled code: of sums, products, quotients, powers, exponentials
and angles, by the rules of circular complex arithmetic."""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.codegen.program import FIRST, OPERATION, RESULT, SECOND, THIRD
from stickslip.motion.discs.tables import (
    AT_LEAST,
    BALL,
    CHAIN,
    HYPERBOLIC,
    LOG,
    OFF,
    QUOTIENT,
    TAN,
    TANH,
    DiscTape,
    factor,
    largest,
    store,
)
from stickslip.symbolic.tape import Op
from stickslip.translator import compiled

_RECIPROCAL, _EXP = int(Op.RECIPROCAL), int(Op.EXP)
_LARGE = 700.0  # largest argument for which the exponential function does not overflow


@compiled()
def add_terms(tape: DiscTape, i: int) -> None:
    """Disc of a linear combination."""
    p = tape.program
    K = tape.K
    W = tape.W
    discs = tape.discs
    n = len(p.rates)
    ball = 0.0
    off = 0.0
    known, own = 0, 0.0
    row = p.code[i, RESULT]
    first = p.code[i, FIRST]
    last = p.code[i, FIRST] + p.code[i, SECOND]
    for j in range(first, last):
        source = p.term_row[j]
        if source >= 0:
            size = abs(factor(p, K, j))
            part = size * discs[source, BALL] if size > 0.0 else 0.0
            off += size * discs[source, OFF] if size > 0.0 else 0.0
            if source <= n:
                known += 1
                own += part
            else:
                ball += part
    if known > 1 and not abs(W[row, 0]) > ball + own + off:
        own = min(own, reach_of_form(tape, i))
    ball += own
    near = 0.0
    if not abs(W[row, 0]) > ball + off:
        # If one term exceeds the sum of all others, the sum stays away from zero. Only the term
        # with the largest bound can.
        most = first
        largest = -1.0
        for j in range(first, last):
            bound = largest_term(tape, j)
            if bound > largest:
                most, largest = j, bound
        if largest >= 0.0 and p.term_row[most] >= 0:
            near = abs(factor(p, K, most)) * discs[p.term_row[most], AT_LEAST]
            for k in range(first, last):
                near -= largest_term(tape, k) if k != most else 0.0
            near = near if near > 0.0 else 0.0
    store(W, discs, row, ball, off, near)


@compiled()
def reach_of_form(tape: DiscTape, i: int) -> float:
    """Bound of the joint deviation of those terms of a linear combination that are components of
    the state, and of time; they are polynomials. Terms that cancel in the combination, such as the
    modes of a structure at an unknown at rest, also cancel in the bound.

    Parameters
    ----------
    i : int
        The instruction.
    """
    p = tape.program
    first = p.code[i, FIRST]
    last = p.code[i, FIRST] + p.code[i, SECOND]
    total = 0.0
    for k in range(1, tape.order + 1):
        value = 0.0
        for j in range(first, last):
            source = p.term_row[j]
            if 0 <= source <= len(p.rates):
                value += factor(p, tape.K, j) * tape.W[source, k]
        total += abs(value) * tape.powers[k]
    return total


@compiled()
def largest_term(tape: DiscTape, j: int) -> float:
    """The largest modulus of a term of a linear combination."""
    size = abs(factor(tape.program, tape.K, j))
    row = tape.program.term_row[j]
    return size * largest(tape.W, tape.discs, row) if row >= 0 else size


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
    store(W, discs, row, x * v + u * y + u * v, off, discs[a, AT_LEAST] * discs[b, AT_LEAST])


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
        near = discs[a, AT_LEAST] / largest(W, discs, p.code[i, SECOND])
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
        elif discs[a, AT_LEAST] > 0.0:
            ball = abs(y) + discs[a, AT_LEAST] ** q
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
    left = discs[b, AT_LEAST]
    ball, off = np.inf, np.inf
    if left > 0.0:
        ball = (u + abs(y) * v) / left
        other = abs(y) + (x + u + s) / left  # if numbers overflow
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
        # The slope 1 ± y² deviates as much as y² does.
        both = 2.0 * (y + ball) * off + off * off if off > 0.0 else 0.0
        store(W, discs, row + 1, (2.0 * y + ball) * ball if ball > 0.0 else 0.0, both, 0.0)


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
