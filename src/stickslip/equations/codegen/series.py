"""Recurrences of Taylor coefficients: order k of an operation from orders at most k of its rows.

W[row, k] is the k-th Taylor coefficient of a row (Jorba & Zou 2005, section 2). These are the only
operations that generated code calls.
"""

from __future__ import annotations

import math

import numpy as np

from stickslip.arrays import Array
from stickslip.translator import RELAXED, compiled, fma

# What ``jets`` returns: a linear problem has no solution, or a mass matrix is not definite.
SINGULAR = 1
INDEFINITE = 6
_NOTHING = 64 * 2.220446049250313e-16  # part of its terms below which a difference may be zero
# Where a search for a zero begins: the largest number, and the least that has all its digits.
FARTHEST = 1.7976931348623157e308
NEAREST = 2.2250738585072014e-308
_GIVEN = 3  # mode of a contact in a plane whose direction of slip is given
MOST_TURNS = 240  # of the search for a zero: enough for bisection down to rounding
SPREAD = 16.0  # ratio of the ends of a bracket from which Newton's method is tried
NEAR = 1e-9  # relative step of Newton's method behind which rounding comes
LEAST_PIVOT = 1e-13  # of a matrix of size 1: what is smaller is zero
_OVERFLOW = 350.0  # exponent from which an exponential counts as infinite


@compiled(relaxed=RELAXED)
def real_power(x: float, p: float) -> float:
    """Real power; NaN where undefined."""
    return np.power(x, p)


@compiled(relaxed=RELAXED)
def reciprocal(x: float) -> float:
    """1/x, infinite at 0."""
    return 1.0 / x


@compiled(relaxed=RELAXED)
def over(a: float, b: float) -> float:
    """a/b for sizes, 0 where there is nothing to divide by."""
    return a / b if b > 0.0 else 0.0


@compiled()
def split(a: float) -> tuple[float, float]:
    """A number as a sum of two with half as many digits (Veltkamp)."""
    c = 134217729.0 * a
    high = c - (c - a)
    return high, a - high


@compiled()
def dot(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Σ aᵢbᵢ as if computed with twice as many digits (algorithm Dot2 of Ogita, Rump and Oishi
    2005)."""
    total, lost = 0.0, 0.0
    for i in range(len(a)):
        product, (ah, al), (bh, bl) = a[i] * b[i], split(a[i]), split(b[i])
        higher = total + product
        part = higher - total
        lost += (total - (higher - part)) + (product - part)
        lost += ((ah * bh - product) + ah * bl + al * bh) + al * bl
        total = higher
    return total + lost if math.isfinite(lost) else total


@compiled(relaxed=RELAXED)
def product_order(W: Array, a: int, b: int, k: int) -> float:
    """Order k of a·b (Cauchy product)."""
    s = 0.0
    for j in range(k + 1):
        s += W[a, j] * W[b, k - j]
    return s


@compiled(relaxed=RELAXED)
def divide_order(W: Array, a: int, b: int, y: int, k: int) -> float:
    """Order k of y = a/b; nothing where b has overflowed."""
    s = 0.0
    for j in range(1, k + 1):
        s += W[b, j] * W[y, k - j]
    return 0.0 if abs(W[b, 0]) == np.inf else (W[a, k] - s) / W[b, 0]


@compiled(relaxed=RELAXED)
def inverse_order(W: Array, b: int, y: int, k: int) -> float:
    """Order k of y = 1/b; nothing where b has overflowed."""
    s = 0.0
    for j in range(1, k + 1):
        s += W[b, j] * W[y, k - j]
    return 0.0 if abs(W[b, 0]) == np.inf else ((1.0 if k == 0 else 0.0) - s) / W[b, 0]


@compiled()
def first_power(a: float, p: float, size: float) -> float:
    """aᵖ, where a is known up to the rounding error of terms of a size: what may be 0 is 0."""
    if p > 0.0 and abs(a) <= _NOTHING * size:
        return 0.0
    return math.sqrt(a) if p == 0.5 and a >= 0.0 else np.power(a, p)


@compiled(relaxed=RELAXED)
def power_order(W: Array, a: int, y: int, p: float, size: float, k: int) -> float:
    """Order k of y = aᵖ for a constant p.

    Where y begins with 0, all its orders are 0: a power of zero has no series of its own, and what
    it is later counts as what the series cannot show (:mod:`stickslip.motion.steps.discs`).
    """
    a0 = W[a, 0]
    if k == 0:
        return first_power(a0, p, size)
    s = 0.0
    for j in range(1, k + 1):
        s += (j * p - (k - j)) * W[a, j] * W[y, k - j]
    return s / (k * a0) if W[y, 0] != 0.0 else 0.0


@compiled(relaxed=RELAXED)
def chain_order(W: Array, a: int, g: int, k: int) -> float:
    """Order k ≥ 1 of y with y′ = g·a′; the newest coefficient comes last, in one multiplication and
    one addition."""
    s = 0.0
    for j in range(1, k):
        s += j * W[a, j] * W[g, k - j]
    return s / k + W[a, k] * W[g, 0]


@compiled()
def first_exp(x: float) -> float:
    """exp x, infinite before its derivatives overflow: what is divided by it then is zero, and so
    are they."""
    return math.exp(x) if x < _OVERFLOW else np.inf


@compiled(relaxed=RELAXED)
def exp_order(W: Array, a: int, y: int, k: int) -> float:
    """Order k of y = exp a."""
    return first_exp(W[a, 0]) if k == 0 else chain_order(W, a, y, k)


@compiled(relaxed=RELAXED)
def log_order(W: Array, a: int, y: int, k: int) -> float:
    """Order k of y = log a."""
    if k == 0:
        return math.log(W[a, 0])
    s = 0.0
    for j in range(1, k):
        s += j * W[y, j] * W[a, k - j]
    return (W[a, k] - s / k) / W[a, 0]


@compiled(relaxed=RELAXED)
def rotation_order(W: Array, a: int, sine: int, cosine: int, k: int) -> None:
    """Order k of sin a and cos a."""
    if k == 0:
        W[sine, 0] = math.sin(W[a, 0])
        W[cosine, 0] = math.cos(W[a, 0])
    else:
        W[sine, k] = chain_order(W, a, cosine, k)
        W[cosine, k] = -chain_order(W, a, sine, k)


@compiled(relaxed=RELAXED)
def steady_rotation_order(W: Array, a: int, sine: int, cosine: int, k: int) -> None:
    """Order k of sin a and cos a for a phase a that is affine in time."""
    if k == 0:
        W[sine, 0] = math.sin(W[a, 0])
        W[cosine, 0] = math.cos(W[a, 0])
    else:
        W[sine, k] = W[a, 1] * W[cosine, k - 1] / k
        W[cosine, k] = -W[a, 1] * W[sine, k - 1] / k


@compiled(relaxed=RELAXED)
def hyperbolic_order(W: Array, a: int, sine: int, cosine: int, k: int) -> None:
    """Order k of sinh a and cosh a."""
    if k == 0:
        W[sine, 0] = (
            0.5 * first_exp(W[a, 0]) - 0.5 * first_exp(-W[a, 0])
            if abs(W[a, 0]) > 1.0
            else math.sinh(W[a, 0])
        )
        W[cosine, 0] = 0.5 * first_exp(W[a, 0]) + 0.5 * first_exp(-W[a, 0])
    else:
        W[sine, k] = chain_order(W, a, cosine, k)
        W[cosine, k] = chain_order(W, a, sine, k)


@compiled(relaxed=RELAXED)
def direction_order(W: Array, inputs: tuple[int, int, int], row: int, mode: int, k: int) -> None:
    """Order k of the direction u/|u| (two rows) and of |u| (the next) in slip, from the rows of u
    and of the size of its terms; see :class:`stickslip.symbolic.tape.Instruction`."""
    a, b, size = inputs
    r = row + 2
    if mode == 0:
        W[row, k] = W[row + 1, k] = W[r, k] = 0.0
        return
    if k == 0 and mode != _GIVEN:
        speed = math.sqrt(W[a, 0] * W[a, 0] + W[b, 0] * W[b, 0])
        W[r, 0] = 0.0 if speed <= _NOTHING * W[size, 0] else speed
    if mode == _GIVEN or W[r, 0] == 0.0:
        return
    if k > 0:
        s = 0.5 * (product_order(W, a, a, k) + product_order(W, b, b, k))
        for j in range(1, k):
            s -= j * W[r, j] * W[r, k - j] / k
        W[r, k] = s / W[r, 0]
    W[row, k] = divide_order(W, a, r, row, k)
    W[row + 1, k] = divide_order(W, b, r, row + 1, k)


@compiled(relaxed=RELAXED)
def solve_order(R: Array, place: int, W: Array, first: int, solution: int, n: int, k: int) -> None:
    """Order k of solution = R·right-hand side, both n consecutive rows, with the rows of R from a
    place on."""
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += R[place + i, j] * W[first + j, k]
        W[solution + i, k] = s


@compiled()
def closer(
    low: float, high: float, last: float, v: float, g: float, slope: float
) -> tuple[float, float, float, float, bool]:
    """A step towards the zero of an increasing function.

    Rates may have any order of magnitude: a bracket is halved in ln|v| until its ends are of one
    sign and near each other. Then Newton's steps follow, as long as each halves the function.

    Parameters
    ----------
    low, high : float
        Bracket; the whole line at the start.
    last : float
        Modulus of the function before, if that was a step of Newton's; or infinity.
    v, g, slope : float
        Where the function was asked (0 at the start), its value and its slope there.

    Returns
    -------
    low, high, last, v, going
        The same for the next step, and whether there is one; v is NaN where the function is, or
        where it falls.
    """
    low = v if g < 0.0 else low
    high = v if g > 0.0 else high
    least = max(min(abs(low), abs(high)), NEAREST)
    most = max(abs(low), abs(high))
    apart = low < 0.0 < high
    middle = math.sqrt(least) * math.sqrt(most)
    middle = 0.0 if apart else (-middle if low < 0.0 else middle)
    narrow = not apart and most <= SPREAD * least
    step = -g / slope
    newton = v + step
    there = g == 0.0
    near = narrow and abs(step) <= NEAR * abs(v)
    good = narrow and low < newton < high and abs(g) <= 0.5 * last
    known = g == g and not slope < 0.0
    last = abs(g) if good else np.inf
    following = v if there else (newton if near or good else middle)
    return low, high, last, following if known else np.nan, known and not (there or near)


@compiled()
def balance(A: Array, n: int, row: int, by_rows: bool) -> float:
    """A power of two near the reciprocal of the largest entry of a row (or column); 0 if there is
    none."""
    largest = 0.0
    for j in range(n):
        largest = max(largest, abs(A[row, j] if by_rows else A[j, row]))
    return math.ldexp(1.0, -math.frexp(largest)[1]) if 0.0 < largest < np.inf else 0.0


@compiled(inline=True)
def less(a: float, factor: float, b: float, fused: bool) -> float:
    """a − factor·b, rounded once or twice."""
    return fma(-factor, b, a) if fused else a - factor * b


@compiled()
def invert(A: Array, n: int, R: Array) -> bool:
    """Inverse R of the leading n×n block of A (destroyed, with the row below); False if it is
    singular."""
    return eliminated(A, n, R, False)


@compiled(inline=True)
def eliminated(A: Array, n: int, R: Array, fused: bool) -> bool:
    """Inverse R of the leading n×n block of A (destroyed, with the row below) by Gauss-Jordan
    elimination.

    Parameters
    ----------
    A : array
    n : int
    R : array
    fused : bool
        Whether products are not rounded before they are subtracted. The machine code of systems
        always had it so, the engine never.

    Returns
    -------
    bool
        False if it is singular.

    Notes
    -----
    Rows and columns are brought to size 1 first, by powers of two, which round nothing: a pivot is
    small beside its own row, not beside a mass in other units.
    """
    for i in range(n):
        factor = balance(A, n, i, True)
        if factor == 0.0:
            return False
        for j in range(n):
            A[i, j] *= factor
            R[i, j] = factor if i == j else 0.0
    for j in range(n):
        factor = balance(A, n, j, False)
        if factor == 0.0:
            return False
        A[n, j] = factor
        for i in range(n):
            A[i, j] *= factor
    for c in range(n):
        pivot = c
        for i in range(c + 1, n):
            if abs(A[i, c]) > abs(A[pivot, c]):
                pivot = i
        if not abs(A[pivot, c]) > LEAST_PIVOT:
            return False
        for j in range(n):
            A[c, j], A[pivot, j] = A[pivot, j], A[c, j]
            R[c, j], R[pivot, j] = R[pivot, j], R[c, j]
        inverse = 1.0 / A[c, c]
        for j in range(n):
            A[c, j] *= inverse
            R[c, j] *= inverse
        for i in range(n):
            if i != c and A[i, c] != 0.0:
                factor = A[i, c]
                for j in range(n):
                    A[i, j] = less(A[i, j], factor, A[c, j], fused)
                    R[i, j] = less(R[i, j], factor, R[c, j], fused)
    for i in range(n):
        for j in range(n):
            R[i, j] *= A[n, i]
    return True


@compiled()
def definite(A: Array, n: int, R: Array) -> bool:
    """Whether the leading n×n block of a symmetric matrix A is positive definite: the pivots of
    elimination, in R, are positive and no rounding errors."""
    for i in range(n):
        for j in range(n):
            R[i, j] = A[i, j]
    for c in range(n):
        if not R[c, c] > LEAST_PIVOT * abs(A[c, c]):
            return False
        for i in range(c + 1, n):
            factor = R[i, c] / R[c, c]
            for j in range(c, n):
                R[i, j] -= factor * R[c, j]
    return True


@compiled(relaxed=RELAXED)
def lagged_order(W: Array, a: int, y: int, k: int) -> float:
    """Order k of a·y without the term with a's order 0."""
    s = 0.0
    for j in range(1, k + 1):
        s += W[a, j] * W[y, k - j]
    return s
