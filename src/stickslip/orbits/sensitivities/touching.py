"""Guards that are touched without being crossed.

There a motion has no derivative: half of its neighbours meet an event that it does not have.
Between two knots a guard is least where its rate along the motion vanishes; guards and rates are
looked at as finely as linear motions are resolved, and a least value between two of these points is
found by bisection.
"""

from __future__ import annotations

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.fields.variational import resolution

_POINTS = 8  # of each part of a step
_WORTH = 1e-2  # part of its size below which a guard's least value is looked for
_TOUCHED = 1e-9  # part of its size by which a guard may miss zero where it touches it
_BISECTIONS = 60


def touched(trajectory: Trajectory, pieces: Pieces) -> list[float]:
    """Times at which a guard of the mode vanishes with its rate, and nothing changes."""
    k = trajectory.knots
    p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
    clock, index = _points(trajectory, pieces)
    if not len(clock):
        return []
    states = trajectory._states_at(clock + k.origin, index)
    numbers = pieces.numbers(k.mode, k.region)[index]
    values, falls, switches = _guards(pieces, numbers, (clock + k.origin, states), p)
    sizes = {
        int(s): np.max(np.abs(values[switches == s]), initial=0.0) for s in np.unique(switches)
    }
    found: list[float] = []
    same = (index[1:] == index[:-1])[:, None]
    turns = same & (falls[:-1] < 0.0) & (falls[1:] >= 0.0) & (switches[1:] >= 0)
    for i, g in zip(*np.nonzero(turns), strict=True):
        size = sizes[int(switches[i, g])]
        # What has just switched, or closed, begins at zero.
        begins = i == 0 or index[i - 1] != index[i]
        if begins and abs(values[i, g]) <= _TOUCHED * size:
            continue
        # Between the tangents at both ends the guard goes no lower than where they meet.
        low = _lowest((clock[i], clock[i + 1]), values[i : i + 2, g], falls[i : i + 2, g])
        if low > _WORTH * size:
            continue
        piece = pieces.made[numbers[i]]
        t, least = _least(trajectory, piece, (int(g), int(index[i])), (clock[i], clock[i + 1]), p)
        if abs(least) <= _TOUCHED * size:
            found.append(t + k.origin)
    return found


def _points(trajectory: Trajectory, pieces: Pieces) -> tuple[Array, Array]:
    """Times since the origin at which guards are looked at, and the knots before them."""
    clock = trajectory.knots.clock
    parts = resolution(trajectory, pieces)
    index = np.repeat(np.arange(len(parts)), np.where(np.diff(clock) > 0, parts * _POINTS + 1, 0))
    first = np.searchsorted(index, index)
    share = (np.arange(len(index)) - first) / (parts[index] * _POINTS)
    times = clock[index] + share * (clock[index + 1] - clock[index])
    return np.minimum(times, clock[index + 1]), index


def _guards(
    pieces: Pieces, numbers: Array, at: tuple[Array, Array], p: Array
) -> tuple[Array, Array, Array]:
    """Guards, their rates along the motion, and their switches, shape (points, guards); −1 where
    there is none."""
    t, y = at
    most = max(len(piece.switches) for piece in pieces.made)
    values, falls = np.full((2, len(t), most), np.inf)
    switches = np.full((len(t), most), -1)
    for number in np.unique(numbers):
        here = numbers == number
        piece = pieces.made[number]
        count = len(piece.switches)
        values[here, :count], falls[here, :count] = _guards_of(piece, t[here], y[here], p)
        switches[here, :count] = piece.switches
    return values, falls, switches


def _guards_of(piece: Piece, t: Array, y: Array, p: Array) -> tuple[Array, Array]:
    n = y.shape[1]
    table = piece.guards(t, np.ascontiguousarray(y.T), p)
    parts = table[n:].reshape(-1, 2 + len(piece.columns), len(t))
    falls = parts[:, 1] + np.einsum("gnt,nt->gt", parts[:, 2 : 2 + n], table[:n])
    return parts[:, 0].T, falls.T


def _lowest(times: tuple[float, float], values: Array, falls: Array) -> float:
    """Where the tangents at two points meet."""
    h = times[1] - times[0]
    bend = falls[1] - falls[0]
    if not bend > 0.0:
        return float(min(values))
    x = (values[0] - values[1] + falls[1] * h) / bend
    return float(values[0] + falls[0] * x)


def _least(
    trajectory: Trajectory,
    piece: Piece,
    place: tuple[int, int],
    times: tuple[float, float],
    p: Array,
) -> tuple[float, float]:
    """When a guard is least between two times, and its value there.

    Parameters
    ----------
    trajectory : Trajectory
    piece : Piece
    place : (int, int)
        The guard, and the knot before.
    times : (float, float)
        Since the origin; the guard falls at the first and rises at the second.
    p : array, shape (parameters,)
    """
    g, knot = place
    low, high = times
    value = np.inf
    middle = low
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        t = np.array([middle]) + trajectory.knots.origin
        values, falls = _guards_of(piece, t, trajectory._states_at(t, np.array([knot])), p)
        value = float(values[0, g])
        low, high = (middle, high) if falls[0, g] < 0.0 else (low, middle)
    return middle, value
