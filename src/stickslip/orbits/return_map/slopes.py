"""The derivative of a cycle with respect to a parameter.

The cycle solves F(x, p) = 0 (:mod:`.shooting`), so dx/dp = −F_x⁻¹ F_p with the exact derivatives
that Newton's method has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.damped_newton import Closed
from stickslip.orbits.return_map.following import flies
from stickslip.orbits.return_map.shooting import Orbit


@dataclass(frozen=True)
class CycleSlope:
    """Derivatives of a cycle with respect to a parameter.

    Attributes
    ----------
    orbit : Orbit
        The cycle, from equations in which the parameter is free.
    pieces : Pieces
        With that parameter.
    state, shift : arrays, shape (n,)
        Derivatives of the state at which the period starts, at a fixed time, and of the shift in a
        period.
    period : float
        Derivative of the period.
    """

    orbit: Orbit
    pieces: Pieces
    state: Array
    shift: Array
    period: float


def cycle_slope(closed: Closed, name: str) -> CycleSlope:
    """Derivatives of a cycle with respect to a parameter; meaningless if the motion is not
    differentiable."""
    if name not in closed.slopes:
        closed.slopes[name] = _solved(closed, name)
    return closed.slopes[name]


def _solved(closed: Closed, name: str) -> CycleSlope:
    shooting, orbit = closed.shooting, closed.orbit
    if shooting.free != name:
        problem = orbit.problem
        exact = flies(orbit.motion)
        if exact != problem.exact:  # a new problem has to make its closed forms
            problem = replace(problem, exact=exact)
        pieces = shooting.pieces.with_free(name)
        unknowns = orbit.x[:-1] if shooting.free else orbit.x
        motions = [leg.motion for leg in orbit.legs]
        shooting = shooting.with_pieces(pieces, problem, motions)
        orbit = shooting.orbit(np.append(unknowns, problem.parameters[name]))
    # The unknowns of the cycle over the parameter, by the implicit function theorem.
    change = np.linalg.lstsq(orbit.J[:, :-1], -orbit.J[:, -1], rcond=None)[0]
    place = orbit.legs[0].place
    state = place.directions @ change[slice(*shooting.first[:2])] + place.by_parameter
    known = shooting.known_shift(orbit.problem, orbit.period)
    period = float(change[shooting.time])
    shift = (
        known.by_time * period
        + known.by_parameter
        + shooting.symmetry.shifts @ change[shooting.drifts]
    )
    return CycleSlope(orbit, shooting.pieces, state, shift, period)
