"""Zeros of a function of one parameter by bracketing, without division by numbers that may vanish.

Reference: T. R. Chandrupatla, *A new hybrid quadratic/bisection algorithm for finding the zero of a
nonlinear function without using derivatives*, Advances in Engineering Software 28 (1997) 145-149.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from stickslip.numerics.levels import BRACKET_LOOKS, LAST_DIGITS

_ASIDE = 1e-6  # relative distance to the second point of a secant if the guess is the first
# multiples of the distance to the guess at which a change of sign is searched for
_WIDER = (1.0, 1.1, 1.5, 2.0, 4.0, 8.0)


def zero_between(
    function: Callable[[float], float], a: float, b: float, at_a: float, at_b: float
) -> float:
    """The zero of a function between two places where it has different signs: by secants at first,
    then by parabolas through the last three places, where these are sure to lie in between, and by
    halves where not. NaN where the function is not finite.

    Parameters
    ----------
    function : callable
        May raise; that is passed on.
    at_a, at_b : float
        What it is there.
    """
    if not (math.isfinite(at_a) and math.isfinite(at_b)):
        return math.nan
    finest = max(LAST_DIGITS * abs(b - a), math.ulp(max(abs(a), abs(b))))
    part = at_a / (at_a - at_b)
    nearest = a
    for _ in range(BRACKET_LOOKS):
        x = a + part * (b - a)
        value = function(x)
        if not math.isfinite(value):
            return math.nan
        # The last place is a, that on the other side of the zero is b, c is the one before.
        if (value > 0.0) == (at_a > 0.0):
            c, at_c = a, at_a
        else:
            c, at_c, b, at_b = b, at_b, a, at_a
        a, at_a = x, value
        nearest = a if abs(at_a) < abs(at_b) else b
        width = abs(b - a)
        if value == 0.0 or width <= 2.0 * finest:
            break
        along = (a - b) / (c - b)
        up = (at_a - at_b) / (at_c - at_b)
        part = 0.5
        # Chandrupatla's criterion: the inverse parabola is monotone in the bracket.
        if up**2 < along and (1.0 - up) ** 2 < 1.0 - along:
            part = at_a / (at_b - at_a) * at_c / (at_b - at_c)
            part += (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b)
        # At least the resolution away from both ends, so that the bracket shrinks in every step.
        part = min(max(part, finest / width), 1.0 - finest / width)
    return nearest


def zero_near(function: Callable[[float], float], known: float, guess: float) -> float | None:
    """A zero of a continuous function between a known place and somewhat beyond a guess; None if it
    changes no sign.

    The function may raise where it is not defined; that is passed on.
    """
    first = function(known)
    if math.isnan(first):
        return None
    if first == 0.0:
        return known
    if guess == known:
        guess = known + _ASIDE * (abs(known) or 1.0)
    near, before = known, first
    for part in _WIDER:
        far = known + part * (guess - known)
        value = function(far)
        if math.isnan(value):
            return None
        if value == 0.0:
            return far
        if (value > 0.0) != (first > 0.0):
            found = zero_between(function, near, far, before, value)
            return None if math.isnan(found) else found
        near, before = far, value
    return None
