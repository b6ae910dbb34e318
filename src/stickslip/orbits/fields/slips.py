"""First variation where a contact in a plane begins to slip, or comes to rest.

Both are events like others, S = I + (f⁺ − f⁻)∇hᵀ/(∂ₜh + ∇h·f⁻), but the field of a slip has no
value where u = 0: there n is a limit, which the motion's own coefficients know
(:mod:`stickslip.motion.steps.starting`). At the end of a slip h = n·Au: neighbours come to rest
earlier or later, and what was left of both components of u is forgotten.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.motion.knots import Knots
from stickslip.motion.steps.arrays import AIM, COMPONENT, MASSIVE
from stickslip.orbits.fields.instructions import PointFunction
from stickslip.orbits.fields.mode_field import Piece
from stickslip.orbits.fields.saltation import Saltation
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_TANGENT = 1e-9  # part of its terms below which a guard vanishes without speed
_velocities: WeakKeyDictionary[Piece, PointFunction] = WeakKeyDictionary()


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
    before = _rates(motion, knot, left)
    after = _rates(motion, knot, right)
    n, columns = len(y), len(left.columns)
    S = np.eye(columns)
    ends = left.field.mode[equations.planes[changed[0]].parts[0]] != 0
    if ends:
        slopes, time = _speed(equations, motion, changed[0], left, (t, y, p), before)
    else:
        here = left.leave(t, y, p)
        cause = int(k.cause[knot])
        own = len(equations.kinks) + equations.planes[changed[0]].parts[0]
        meant = np.flatnonzero(left.switches == (cause if cause >= 0 else own))
        g = int(meant[np.argmin(np.abs(here.value[meant]))])
        slopes = here.slopes[g]
        time = float(here.fall[g] - slopes[:n] @ here.rates)
    f, onward = before[0], after[0]
    fall = time + slopes[:n] @ f
    terms = abs(time) + np.abs(slopes[:n]) @ np.abs(f)
    earlier = slopes / fall if abs(fall) > 0.0 else np.zeros(columns)
    exists = len(changed) == 1 and abs(fall) > _TANGENT * terms
    if exists:
        S[:n] += np.outer(onward - f, earlier)
    return Saltation(S, -earlier, exists)


def _rates(motion: Trajectory, knot: int, piece: Piece) -> tuple[Array, Array]:
    """Rates of the state at a knot in the mode of a piece, and the direction of each contact in a
    plane."""
    from stickslip.motion.trajectory import Trajectory

    k = motion.knots
    mode, region = np.array(piece.field.mode), np.array(piece.field.region)
    alone = Knots.single(float(k.clock[knot]), k.state[knot], mode, region, k.origin)
    time = float(k.time[knot])
    part = Trajectory(motion._problem, (time, time), alone, motion.outcome)
    row = part._sample_clock(alone.clock, np.array([0]))[0]
    rows = motion._problem.rows
    aims = rows.planes[:, AIM]
    return row[rows.program.rates], row[np.array([aims, aims + 1])].T


def _speed(
    equations: MotionEquations,
    motion: Trajectory,
    plane: int,
    piece: Piece,
    at: tuple[float, Array, Array],
    before: tuple[Array, Array],
) -> tuple[Array, float]:
    """Derivatives of n·Au by the columns of a piece, and by time.

    Parameters
    ----------
    equations : MotionEquations
    motion : Trajectory
    plane : int
        Its number.
    piece : Piece
        That of the slip.
    at : float and two arrays
        When, the state, and the parameters.
    before : arrays, shapes (states,) and (planes, 2)
        Rates in slip, and the directions.
    """
    if piece not in _velocities:
        columns = ("t", *piece.columns)
        ahead = [
            axis * piece.field.contacts[i].u
            for each in equations.planes
            for i, axis in zip(each.parts, each.axes, strict=True)
        ]
        _velocities[piece] = PointFunction(
            piece.field, [ex.derivative(u, c) for u in ahead for c in columns]
        )
    table = _velocities[piece](*at).reshape(len(equations.planes), 2, -1)[plane]
    slopes = before[1][plane] @ table
    return slopes[1:], float(slopes[0])


def reversals(motion: Trajectory) -> list[float]:
    """Times at which a slip in a plane goes on through u = 0: neighbours pass by on one side or
    the other, so that there is no derivative."""
    rows = motion._problem.rows
    if len(rows.planes) == 0:
        return []
    k = motion.knots
    slips = k.mode[:, rows.planes[:, COMPONENT]] != 0
    speed = motion._sample_clock(k.clock, np.arange(len(k.clock)))[:, rows.planes[:, AIM] + 2]
    massive = rows.planes[:, MASSIVE] == 1
    through = slips[1:] & slips[:-1] & (speed[1:] == 0.0) & massive
    return [float(t) for t in k.time[1:][np.any(through, axis=1)]]
