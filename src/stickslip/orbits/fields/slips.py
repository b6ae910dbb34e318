"""First variation where a contact in a plane begins to slip, or comes to rest.

Both are events like others, S = I + (f⁺ − f⁻)∇hᵀ/(∂ₜh + ∇h·f⁻), but the field of a slip has no
value where u = 0. Where a slip begins, f⁺ has the direction that the motion's own coefficients know
(:mod:`stickslip.motion.steps.starting`). Where it ends, h = |Au|, and n and f⁻ are those that the
series of the last step has there: ∇h = (An)ᵀ∇u. Neighbours come to rest earlier or later, and what
was left of u in both directions is forgotten.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations, Plane
from stickslip.motion.knots import Knots
from stickslip.motion.steps.arrays import AIM, COMPONENT, MASSIVE, is_loose
from stickslip.orbits.fields.mode_field import Piece
from stickslip.orbits.fields.saltation import Saltation
from stickslip.symbolic import expressions as ex

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
    changed = [
        plane
        for plane in equations.planes
        if left.field.mode[plane.parts[0]] != right.field.mode[plane.parts[0]]
    ]
    ends = left.field.mode[changed[0].parts[0]] != 0
    massive = not changed[0].pull
    passing = _ended if ends and massive else _begun
    before, onward, slopes, fall, size = passing(equations, motion, knot, pieces, p, changed[0])
    columns = len(left.columns)
    S = np.eye(columns)
    if len(changed) > 1 or not abs(fall) > _TANGENT * size:
        return Saltation(S, np.zeros(columns), False)
    earlier = slopes / fall
    S[: len(before)] += np.outer(onward - before, earlier)
    if ends:
        k = motion.knots
        S = _at_rest(right, (float(k.time[knot]), k.state[knot], p)) @ S
    return Saltation(S, -earlier, True)


class _Passing(NamedTuple):
    """What a saltation matrix is made of: the field before and after, the derivatives of the guard,
    its rate, and the size of the terms of that."""

    before: Array
    after: Array
    slopes: Array
    fall: float
    size: float


def _begun(
    equations: MotionEquations,
    motion: Trajectory,
    knot: int,
    pieces: tuple[Piece, Piece],
    p: Array,
    plane: Plane,
) -> _Passing:
    """Where a slip begins, or one without mass ends; parameters as of :func:`through`."""
    left, right = pieces
    k = motion.knots
    t, y = float(k.time[knot]), k.state[knot]
    switch = len(equations.kinks) + plane.parts[0]
    here = left.leave(t, y, p)
    onward = right.rates(t, y, p) if plane.pull else _rates(motion, knot, right)
    cause = int(k.cause[knot])
    meant = np.flatnonzero(left.switches == (cause if cause >= 0 else switch))
    g = int(meant[np.argmin(np.abs(here.value[meant]))])
    size = float(here.terms[g])
    return _Passing(here.rates, onward, here.slopes[g], float(here.fall[g]), size)


def _ended(
    equations: MotionEquations,
    motion: Trajectory,
    knot: int,
    pieces: tuple[Piece, Piece],
    p: Array,
    plane: Plane,
) -> _Passing:
    """Where a slip ends; parameters as of :func:`through`."""
    right = pieces[1]
    k = motion.knots
    t, y = float(k.time[knot]), k.state[knot]
    values = motion._sample_clock(k.clock[[knot]], np.array([knot - 1]))[0]
    layout = motion._problem.compiled.layout
    before = values[motion._problem.rows.program.rates]
    first = next(row for a, _, row, *_ in layout.planes if a == plane.parts[0])
    names = motion.system.parameters
    numbers = dict(zip(names, p, strict=True))
    fall, size, slopes = 0.0, 0.0, np.zeros(len(right.columns))
    for part, (i, axis) in enumerate(zip(plane.parts, plane.axes, strict=True)):
        time, own = right.drift(i, t, y, p)
        weight = values[first + part] * ex.evaluate(axis, numbers)
        slopes += weight * own
        terms = weight * own[: len(y)] * before
        fall += weight * time + float(np.sum(terms))
        size += abs(weight * time) + float(np.sum(np.abs(terms)))
    return _Passing(before, right.rates(t, y, p), slopes, fall, size)


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
