"""First variation where a contact in a plane begins to slip, or comes to rest.

Both are events like others, S = I + (f⁺ − f⁻)∇hᵀ/(∂ₜh + ∇h·f⁻), but the field of a slip has no
value where u = 0. Where a slip begins, f⁺ has the direction that the motion's own coefficients know
(:mod:`stickslip.motion.steps.starting`). Where it ends, h = |Au|, and all is taken from the last
knot before, at which |Au| is all but a rounding error: n may still turn there, however small |Au|
is. Neighbours come to rest earlier or later, and what was left of u in both directions is
forgotten.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.motion.knots import Knots
from stickslip.motion.steps.arrays import AIM, COMPONENT, MASSIVE, is_loose
from stickslip.orbits.fields.mode_field import Piece
from stickslip.orbits.fields.saltation import Saltation

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_TANGENT = 1e-9  # part of its terms below which a guard vanishes without speed


def through(
    equations: MotionEquations,
    motion: Trajectory,
    knot: int,
    pieces: tuple[Piece, Piece],
    p: Array,
) -> Saltation:
    """The saltation matrix at a knot where a slip in a plane begins or ends.

    Parameters
    ----------
    equations : MotionEquations
    motion : Trajectory
    knot : int
    pieces : (Piece, Piece)
        Before and after it.
    p : array, shape (parameters,)
    """
    left, right = pieces
    k = motion.knots
    t, y = float(k.time[knot]), k.state[knot]
    changed = [
        j
        for j, plane in enumerate(equations.planes)
        if left.field.mode[plane.parts[0]] != right.field.mode[plane.parts[0]]
    ]
    n, columns = len(y), len(left.columns)
    S = np.eye(columns)
    ends = left.field.mode[equations.planes[changed[0]].parts[0]] != 0
    switch = len(equations.kinks) + equations.planes[changed[0]].parts[0]
    if ends:
        here = left.leave(float(k.time[knot - 1]), k.state[knot - 1], p)
        onward = right.rates(t, y, p)
        meant = np.flatnonzero(left.switches == switch)
    else:
        here = left.leave(t, y, p)
        onward = _rates(motion, knot, right)
        cause = int(k.cause[knot])
        meant = np.flatnonzero(left.switches == (cause if cause >= 0 else switch))
    g = int(meant[np.argmin(np.abs(here.value[meant]))])
    fall = float(here.fall[g])
    exists = len(changed) == 1 and abs(fall) > _TANGENT * float(here.terms[g])
    if not exists:
        return Saltation(S, np.zeros(columns), False)
    earlier = here.slopes[g] / fall
    S[:n] += np.outer(onward - here.rates, earlier)
    if ends:
        S = _at_rest(right, (t, y, p)) @ S
    return Saltation(S, -earlier, True)


def _at_rest(piece: Piece, at: tuple[float, Array, Array]) -> Array:
    """The projection onto what keeps the constraints of a piece, along velocities: rounding errors
    of the direction of a slip that has ended are forgotten, too."""
    bounds = piece.bounds(*at).slopes
    n, columns = len(at[1]), len(piece.columns)
    rates = [i for i, name in enumerate(piece.field.state) if name.startswith("d_")]
    P = np.eye(columns)
    P[rates] -= np.linalg.pinv(bounds[:, rates]) @ bounds if n else 0.0
    return P


def _rates(motion: Trajectory, knot: int, piece: Piece) -> Array:
    """Rates of the state at a knot in the mode of a piece."""
    from stickslip.motion.trajectory import Trajectory

    k = motion.knots
    mode, region = np.array(piece.field.mode), np.array(piece.field.region)
    alone = Knots.single(float(k.clock[knot]), k.state[knot], mode, region, k.origin)
    time = float(k.time[knot])
    part = Trajectory(motion._problem, (time, time), alone, motion.outcome)
    return part._sample_clock(alone.clock, np.array([0]))[0][motion._problem.rows.program.rates]


def passages(motion: Trajectory) -> list[float]:
    """Times at which a slip in a plane goes on through u = 0: neighbours pass by on one side or
    the other, so that there is no derivative."""
    rows = motion._problem.rows
    if len(rows.planes) == 0:
        return []
    k = motion.knots
    slips = k.mode[:, rows.planes[:, COMPONENT]] != 0
    for p, c in enumerate(rows.planes[:, COMPONENT]):
        slips[:, p] &= [not is_loose(rows, mode, c) for mode in k.mode]
    speed = motion._sample_clock(k.clock, np.arange(len(k.clock)))[:, rows.planes[:, AIM] + 2]
    massive = rows.planes[:, MASSIVE] == 1
    through = slips[1:] & slips[:-1] & (speed[1:] == 0.0) & massive
    return [float(t) for t in k.time[1:][np.any(through, axis=1)]]
