"""First sign change of a polynomial on [0, 1], which is never missed.

The polynomial is written in the Bernstein basis: if its coefficients have no sign change it has no
root, if they have exactly one it has exactly one; otherwise the interval is halved (de Casteljau).
Nothing is sampled, so a pair of roots, however close, is not missed as long as the polynomial dips
below zero by more than its rounding error.
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.numerics.levels import HALVINGS, ONE_ULP
from stickslip.translator import CONTRACTED, RELAXED, compiled

MAX_DEGREE = 32
# number of orders that usually suffice, if the step is so small that the others hardly matter
_QUICK = 6
NONE = 2.0  # "no root": anything beyond the interval
# After the coefficients of a subinterval: its start and its length.
_START, _WIDTH = MAX_DEGREE + 1, MAX_DEGREE + 2
# largest relative change of the slope for which a zero at the start is divided out exactly
_SPLIT = 1e-3
_NARROWEST = 1e-17  # width of a subinterval of [0, 1] below the spacing of numbers in it


def _binomials() -> Array:
    table = np.zeros((MAX_DEGREE + 1, MAX_DEGREE + 1))
    for n in range(MAX_DEGREE + 1):
        table[n, 0] = 1.0
        for k in range(1, n + 1):
            table[n, k] = table[n - 1, k - 1] + table[n - 1, k]
    return 1.0 / np.where(table == 0.0, 1.0, table)


_INVERSE_BINOMIAL = _binomials()


@compiled(relaxed=CONTRACTED)
def horner(c: Array, d: int, x: float) -> float:
    """Value of Σ c[k] xᵏ, k ≤ d."""
    s = c[d]
    for k in range(d - 1, -1, -1):
        s = s * x + c[k]
    return s


@compiled(relaxed=CONTRACTED)
def horner_at_nodes(C: Array, d: int, x: Array, values: Array) -> None:
    """Values of many polynomials Σ C[r, k] xᵏ, k ≤ d, at many places, each as :func:`horner` has
    it: side by side, so that none waits for another.

    Parameters
    ----------
    C : array, shape (at least rows, more than d)
    x : array, shape (places,)
    values : array, shape (rows, places)
        Receives them.
    """
    for r in range(len(values)):
        for g in range(len(x)):
            values[r, g] = C[r, d]
    for k in range(d - 1, -1, -1):
        for r in range(len(values)):
            term = C[r, k]
            for g in range(len(x)):
                values[r, g] = values[r, g] * x[g] + term


@compiled()
def slopes_at_nodes(C: Array, d: int, x: Array, values: Array) -> None:
    """Their derivatives in the same way, each as :func:`rate_on` has it."""
    for r in range(len(values)):
        for g in range(len(x)):
            values[r, g] = 0.0
    for k in range(d, 0, -1):
        for r in range(len(values)):
            term = k * C[r, k]
            for g in range(len(x)):
                values[r, g] = values[r, g] * x[g] + term


@compiled()
def rate_on(c: Array, d: int, x: float) -> float:
    """Derivative of Σ c[k] xᵏ, k ≤ d."""
    s = 0.0
    for k in range(d, 0, -1):
        s = s * x + k * c[k]
    return s


@compiled(relaxed=RELAXED)
def value_and_slope(c: Array, d: int, powers: Array) -> tuple[float, float]:
    """Value at h of Σ c[k] xᵏ, k ≤ d, d ≥ 4, and h times its derivative there, from the powers of
    h."""
    first = c[1] * powers[1]
    second = c[2] * powers[2]
    third = c[3] * powers[3]
    change, rate = 0.0, 0.0
    for k in range(4, d + 1):  # in fours, as the powers are stored
        term = c[k] * powers[k] if c[k] != 0.0 else 0.0  # powers of a very long step are infinite
        change += term
        rate += k * term
    return c[0] + (first + (second + (third + change))), first + (
        2.0 * second + (3.0 * third + rate)
    )


@compiled(relaxed=CONTRACTED)
def crossing(c: Array, d: int, a: float, b: float, start: float, noise: float) -> float:
    """The root between a and b, where the polynomial is positive at a, negative at b (Newton inside
    a bracket).

    Parameters
    ----------
    c : array
        Coefficients.
    d : int
        Degree.
    a, b, start : float
        The bracket, and the first point that is tried.
    noise : float
        Modulus of a value that counts as zero.
    """
    low, high = a, b
    x = start
    for _ in range(200):
        s = c[d]
        ds = 0.0
        for k in range(d - 1, -1, -1):
            ds = ds * x + s
            s = s * x + c[k]
        if abs(s) <= noise:
            return x
        if s > 0.0:
            low = x
        else:
            high = x
        new = x - s / ds if ds != 0.0 else low - 1.0
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - x) <= ONE_ULP * abs(new) or not low < new < high:
            return new
        x = new
    return x


@compiled(relaxed=CONTRACTED)
def lowest(c: Array, d: int, b: Array, work: Array) -> float:
    """Lower bound of Σ c[k] xᵏ, k ≤ d, on [0, 1]: the least of its Bernstein coefficients, which
    are left in b."""
    least = np.inf
    for i in range(d + 1):
        value = c[i] * _INVERSE_BINOMIAL[d, i]
        for j in range(i):
            value, work[j] = value + work[j], value
        b[i] = work[i] = value
        least = min(least, value)
    return least


@compiled(relaxed=CONTRACTED)
def halve(stack: Array, depth: int, d: int) -> None:
    """Put the left half of an interval on top of a stack of them, above its right half.

    De Casteljau at 1/2, on Bernstein coefficients; behind these stand where the interval begins and
    how wide it is.
    """
    right = stack[depth]
    half = stack[depth + 1]
    left, width = right[_START], right[_WIDTH]
    for i in range(d + 1):
        half[i] = right[i]
    half[_START] = left
    half[_WIDTH] = 0.5 * width
    right[_START] = left + 0.5 * width
    right[_WIDTH] = 0.5 * width
    for i in range(d + 1):
        right[d - i] = half[d]
        for j in range(d, i, -1):
            half[j] = 0.5 * (half[j] + half[j - 1])


@compiled(relaxed=CONTRACTED)
def first_crossing(c: Array, d: int, limit: float, floor: float, stack: Array) -> float:
    """First point of ]0, limit] at which a polynomial that starts positive becomes negative.

    Parameters
    ----------
    c : array, shape (d + 1,)
        Coefficients, c[0] > 0.
    d : int
        Degree, at most 32.
    limit : float
        End of the interval, at most 1.
    floor : float
        Rounding error of the values; dips that stay above −floor do not count.
    stack : array, shape (64, 36)
        Work space.

    Returns
    -------
    float
        The root, or :data:`NONE`.
    """
    x, fall = 1.0, 0.0  # fall: how far the orders above QUICK can take the polynomial down
    for k in range(d + 1):
        stack[1, k] = c[k] * x
        x *= limit
        if k > _QUICK and stack[1, k] < 0.0:
            fall -= stack[1, k]
    if (
        lowest(stack[1], min(d, _QUICK), stack[0], stack[2]) > fall
        or lowest(stack[1], d, stack[0], stack[2]) > 0.0
    ):
        return NONE
    stack[0, _START] = 0.0
    stack[0, _WIDTH] = 1.0
    depth = 0
    while depth >= 0:
        b = stack[depth]
        changes = 0
        positive = True
        negative = False
        for i in range(d + 1):
            if positive and b[i] < -floor:
                changes = changes + 1
                positive = False
                negative = True
            elif not positive and b[i] > floor:
                changes = changes + 1
                positive = True
        if not negative:
            depth -= 1
            continue
        left, width = b[_START], b[_WIDTH]
        if changes == 1 and b[d] < -floor:
            if b[0] <= 0.0:
                return limit * left
            start = left + width * b[0] / (b[0] - b[d])
            return crossing(c, d, limit * left, limit * (left + width), limit * start, floor / 64.0)
        if depth == HALVINGS or width < _NARROWEST:
            return limit * left
        # The left half is pushed last, so that the leftmost crossing is found first.
        halve(stack, depth, d)
        depth += 1
    return NONE


@compiled()
def divide_out(c: Array, order: int, N: int) -> None:
    """Divide a polynomial by the zero with which it starts, up to rounding.

    A simple zero is where value and slope say. Were it taken to be at 0, the next zero would be off
    by as much as this one is; and the one after that again, so that such errors would add up from
    event to event.

    Parameters
    ----------
    c : array
        N coefficients; receives the N − order ones of the quotient.
    order : int
        The first of the coefficients that is not zero, up to rounding.
    """
    if order == 1 and c[0] != 0.0:
        bends = 0.0
        for k in range(2, N):
            bends += abs(c[k])
        zero = -c[0] / c[1]
        if abs(zero) * (abs(c[1]) + bends) <= _SPLIT * abs(c[1]):
            for k in range(N - 2, 0, -1):
                c[k] += zero * c[k + 1]
    for k in range(N - order):
        c[k] = c[k + order]
