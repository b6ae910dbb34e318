"""Cycles with half the period of another cycle.

At the other end of a branch that emerges from a period doubling, a cycle becomes one of half its
period.

Near that point the two halves of a cycle differ by the square root of the distance from it. Up to
the point the branch is regular; beyond it, the solution of the same equations is the shorter cycle,
traversed twice.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.errors import StickslipError
from stickslip.orbits.continuation.bracket import zero_near
from stickslip.orbits.return_map.damped_newton import Closed

if TYPE_CHECKING:
    from collections.abc import Callable

_MISSED = 1e-6  # distance of a multiplier from −1 at the end of a search if it jumped across


def half_gap(closed: Closed) -> float:
    """Closure error of a cycle after half its period, in units of its largest range.

    Of a driven system only an even number of the drive's periods can be halved; otherwise it is
    infinite.
    """
    orbit = closed.orbit
    setting = closed.shooting.setting
    if setting.symmetry.driven and setting.turns % 2:
        return np.inf
    start, half = closed.samples(2)
    return (
        float(np.max(np.abs(half - start) / setting.sizes)) / closed.extent
        if orbit.period > 0.0
        else np.inf
    )


def doubling_near(
    half: Closed, value: float, other: float, at: Callable[[Closed, float], Closed]
) -> tuple[float, float] | None:
    """The value of the parameter near which a cycle has the multiplier −1.

    Parameters
    ----------
    half : Closed
        The cycle at `value`.
    value, other : float
        Value at which the cycle is known, and value at which the multiplier is expected.
    at : function
        (cycle, value) ↦ the cycle at another value.

    Returns
    -------
    (float, float) or None
        The value, and the multiplier plus 1 there. None if there is no such value nearby.
    """

    def excess(there: float) -> float:
        others = at(half, there).spectrum.others if there != value else half.spectrum.others
        return float(others[np.argmin(np.abs(others + 1.0))].real) + 1.0

    try:
        found = zero_near(excess, value, other)
        return None if found is None or abs(left := excess(found)) > _MISSED else (found, left)
    except StickslipError:
        return None
