"""Zeros of a function of one parameter near a guess, by bracketing: nothing is divided by what
might vanish."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

# how much further than the guess a change of sign is looked for
_WIDER = (1.0, 1.1, 1.5, 2.0, 4.0, 8.0)


def zero_near(function: Callable[[float], float], known: float, guess: float) -> float | None:
    """A zero of a continuous function between a known place and somewhat beyond a guess; None if it
    changes no sign.

    The function may raise where it is not defined; that is passed on.
    """
    from scipy.optimize import brentq

    first = function(known)
    if math.isnan(first):
        return None
    if first == 0.0:
        return known
    if guess == known:
        guess = known + 1e-6 * (abs(known) or 1.0)
    near = known
    for part in _WIDER:
        far = known + part * (guess - known)
        value = function(far)
        if math.isnan(value):
            return None
        if value == 0.0:
            return far
        if (value > 0.0) != (first > 0.0):
            found: Any = brentq(
                function, near, far, xtol=1e-15 * abs(far - near) + 1e-300, maxiter=100, disp=False
            )
            return float(found)
        near = far
    return None
