"""Returns of a motion: the first guess of a cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.motion.steps.arrays import INERTIAL
from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.clock import Clock, cells_of, clock
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.fields.symmetry import Surroundings, Symmetry
from stickslip.orbits.fields.variational import resolution

if TYPE_CHECKING:
    from stickslip.motion.problem import Problem
    from stickslip.motion.record.knots import Knots
    from stickslip.motion.trajectory import Trajectory


SHORTEST = 1e-9  # a segment that is shorter than this fraction of the motion takes no time
_POINTS = 16  # smallest number of points in every step
# largest factor on them in a step; at the end of a slip linear motions decay immediately
_MOST_PARTS = 1000
_MOST_STEPS = 4000  # largest number of steps that are searched
# largest number of entries of the states that are searched, if steps are divided
_MOST_NUMBERS = 50_000
_LEAST = 1e-3  # … smallest size of a component, as a fraction of the effect of the others on it
_MODE = 1e-3  # smallest size of a mode relative to the largest mode of a structure
_CLOSER = 1e3  # … but not before one whose miss is smaller by this factor
_EXACT = 1e-9  # … or closes
_BETTER = 0.5  # a later return is examined if it misses by at most this fraction of all before
_STILL = 1e-9  # spread of a component that does not move, relative to its modulus


@dataclass(frozen=True)
class Recurrence:
    """A state of a motion, and the time at which the motion nearly returns to it.

    Attributes
    ----------
    time, state
        The state and when it is passed.
    turns : int
        Periods of the drives in it.
    shift : array, shape (n,)
        Later state minus earlier one, up to the miss.
    distance : float
        Miss relative to the size of the motion.
    """

    time: float
    state: Array
    period: float
    turns: int
    shift: Array
    distance: float


@dataclass(frozen=True)
class Window:
    """A part of a motion, sampled.

    Attributes
    ----------
    times, states : arrays, shapes (points,) and (points, n)
    index : array of int
        Step of each point.
    clock : Clock or None
        Of driven systems.
    sizes : array, shape (n,)
        Half the range of each component, up to drift.
    """

    trajectory: Trajectory
    times: Array
    states: Array
    index: Array
    symmetry: Symmetry
    clock: Clock | None
    sizes: Array
    surroundings: Surroundings

    @property
    def period(self) -> float | None:
        """Of the drives."""
        return self.clock.period(self.trajectory.parameters) if self.clock else None

    def in_frame(self, states: Array, times: Array | float) -> Array:
        """States in the frame of the system, without translations, in units of their sizes; shape
        (…, n)."""
        e = self.symmetry.frame
        N = self.symmetry.shifts / self.sizes[:, None]
        scaled = (states if e is None else states - np.multiply.outer(times, e)) / self.sizes
        return scaled - (scaled @ N) @ np.linalg.pinv(N) if N.shape[1] else scaled

    def apart(self, differences: Array, times: Array | float) -> Array:
        """Differences of states, with those of their times, also without whole cells."""
        e = self.symmetry.frame
        along = differences if e is None else differences - np.multiply.outer(times, e)
        home = self.symmetry.in_frame(along, self.sizes)
        return self.in_frame(home if e is None else home + np.multiply.outer(times, e), times)

    def carried(self, states: Array, times: Array) -> Array:
        """States without the displacement by a moving load; shape (…, n)."""
        driven = self.symmetry.frame is None
        period = self.period
        velocity = self.symmetry.turn / period if driven and period else np.zeros(len(self.sizes))
        return states - np.multiply.outer(times, velocity)

    def extent(self, modulus: Array) -> float:
        """Largest range of a component relative to a modulus: 0 if there is no motion except along
        translations."""
        home = self.in_frame(self.carried(self.states, self.times), self.times)
        return float(np.max(ratio(np.ptp(home, axis=0) * self.sizes, modulus)))


def window(trajectory: Trajectory, pieces: Pieces, first: int = 0) -> Window:
    """Sample a motion from a knot on, and compute the symmetry of its system.

    Raises
    ------
    DeclarationError
        If the system is driven without a period.
    """
    k = trajectory.knots
    steps = np.arange(max(first, len(k.time) - 1 - _MOST_STEPS), len(k.time) - 1)
    steps = steps[np.diff(k.time)[steps] > 0.0]
    p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
    every = [pieces(m, r) for m, r in zip(k.mode, k.region, strict=True)]
    # A flight in closed form may be one step and hold many oscillations.
    parts = np.minimum(resolution(trajectory, pieces)[steps] // 4, _MOST_PARTS)
    fewer = _MOST_NUMBERS / (_POINTS * k.state.shape[1] * (np.sum(parts) + 1))
    points = _POINTS * (1 + (parts * min(fewer, 1.0)).astype(np.int64))
    index = np.repeat(steps, points)
    before = np.repeat(np.cumsum(points) - points, points)
    share = (np.arange(len(index)) - before) / (np.repeat(points, points) - 1)
    times = (1.0 - share) * k.time[index] + share * k.time[index + 1]
    states = trajectory.states_at(times, index)
    made = [every[i] for i in index]
    felt = _largest_slopes(trajectory, every, steps, p)
    around = Surroundings(made, times, states, _sizes(trajectory, states, states, felt))
    equations = trajectory.problem.compiled.equations
    ticking = None
    cells = cells_of(equations, trajectory.parameters)
    found = around.symmetry(p, None, cells)
    if found.driven:
        ticking = clock(trajectory.system, equations, trajectory.parameters)
        found = around.symmetry(p, ticking.drives(trajectory.parameters), cells)
    rough = Window(trajectory, times, states, index, found, ticking, around.sizes, around)
    moving = rough.apart(rough.carried(states - states[0], times - times[0]), times - times[0])
    sizes = _sizes(trajectory, moving * around.sizes, states, felt)
    around = Surroundings(made, times, states, sizes)
    return Window(trajectory, times, states, index, found, ticking, sizes, around)


def sizes_of(motion: Trajectory, shift: Array, pieces: Pieces) -> Array:
    """Half the range of each component over a period, up to drift.

    A component that hardly moves (a symmetry may keep it at 0) has a small fraction of the size
    that the others could cause in a period, or within its relaxation time, since its range would be
    rounding error.
    """
    k = motion.knots
    n = len(shift)
    steps = np.flatnonzero(np.diff(k.time) > 0.0)
    times = np.linspace(k.time[steps], k.time[steps + 1], _POINTS, axis=1).ravel()
    states = motion.states_at(times, np.repeat(steps, _POINTS))
    period = k.time[-1] - k.time[0]
    p = np.array([motion.parameters[name] for name in motion.system.parameters])
    made = [pieces(m, r) for m, r in zip(k.mode, k.region, strict=True)]
    felt = _largest_slopes(motion, made, steps, p)
    # The drift is removed: it is not part of the size of the cycle.
    moving = states - np.outer((times - k.time[0]) / period, shift)
    sizes = _sizes(motion, moving, states, felt)
    J = np.max([part[:n] for part in felt], axis=0)
    return np.maximum(sizes, _LEAST * (J @ sizes) / np.maximum(np.diag(J), 1.0 / period))


def _largest_slopes(motion: Trajectory, made: list[Piece], steps: Array, p: Array) -> list[Array]:
    """Largest slopes of the rates, guards and constraints of each piece of a motion with respect to
    the state; shape (functions, n)."""
    k = motion.knots
    found = []
    for piece in dict.fromkeys(made[i] for i in steps):
        own = np.array([i for i in steps if made[i] is piece])
        slopes = np.abs(piece.dependence(k.time[own], k.state[own].T, p)[:, :, 1:])
        found.append(np.max(np.where(np.isfinite(slopes), slopes, 0.0), axis=0))
    return found


def _sizes(motion: Trajectory, moving: Array, states: Array, felt: list[Array]) -> Array:
    """Half the range of each component; for one that does not move, the change with the same effect
    as the motion of the others."""
    spread = 0.5 * np.ptp(moving, axis=0)
    modulus = np.max(np.abs(states), axis=0)
    still = _STILL * np.where(modulus > 0.0, modulus, 1.0)
    sizes = np.where(spread > still, spread, 0.5 * np.ptp(states, axis=0))
    sizes = np.where(sizes > still, sizes, 0.0)
    modes = modes_of_structures(motion.problem)
    for own in modes:
        # A mode that symmetry keeps at rest moves by the rounding errors of the others.
        sizes[own] = np.maximum(sizes[own], _MODE * np.max(sizes[own]))
    like = equivalent_sizes(sizes, felt, modes)
    otherwise = np.where(modulus > 0.0, 1e-3 * modulus, 1e-3)
    return np.where(sizes > 0.0, sizes, np.where(np.isfinite(like), like, otherwise))


def modes_of_structures(problem: Problem) -> list[slice]:
    """Indices, in the state, of the modes of each structure and of their rates."""
    rows = problem.rows
    firsts = (0, int(rows.sizes[INERTIAL]))
    return [
        slice(first + begin, first + begin + count)
        for begin, count in rows.bodies.tolist()
        for first in firsts
    ]


def equivalent_sizes(sizes: Array, felt: list[Array], modes: Sequence[slice]) -> Array:
    """Change of each component with the same effect on some rate or guard as the others; infinite
    if there is no effect.

    Parameters
    ----------
    sizes : array, shape (n,)
    felt : list of array, shapes (functions, n)
        Slopes of the rates, and of others.
    modes : sequence of slice
        Rates that are components of one vector: of these the largest counts.
    """
    every = []
    for slopes in felt:
        terms = slopes * sizes
        others = np.sum(terms, axis=1, keepdims=True) - terms
        for own in modes:
            others[own] = np.max(others[own], axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            every.append(others / slopes)
    like = np.concatenate(every)
    return np.min(np.where((like > 0.0) & np.isfinite(like), like, np.inf), axis=0, initial=np.inf)


def stretch(motion: Trajectory, first: int, last: int) -> Trajectory:
    """The part of a motion between two knots, both included."""
    from stickslip.motion.record.knots import Knots
    from stickslip.motion.trajectory import Trajectory

    k = motion.knots
    part = slice(first, last + 1)
    knots = Knots(k.time[part], k.state[part], k.mode[part], k.region[part], k.cause[part])
    return Trajectory(
        motion.problem, (float(k.time[first]), float(k.time[last])), knots, motion.outcome
    )


def segments(motion: Trajectory) -> list[tuple[int, int]]:
    """First and last knot of every part in one mode and region, without a jump of the state, of
    nonzero duration."""
    knots = motion.knots
    mode, region, time = knots.mode, knots.region, knots.time
    changed = (mode[1:] != mode[:-1]).any(axis=1) | (region[1:] != region[:-1]).any(axis=1)
    changed[motion.state_jumps - 1] = True
    ends = [0, *(np.flatnonzero(changed[: len(time) - 2]) + 1), len(time) - 1]
    span = time[-1] - time[0]
    return [(int(a), int(b)) for a, b in pairwise(ends) if time[b] - time[a] > SHORTEST * span]


def station_time(knots: Knots, pieces: Pieces, found: list[tuple[int, int]]) -> float:
    """The middle of the part with most constraints, and of these the longest (the latest, if there
    are several)."""

    def rank(ends: tuple[int, int]) -> tuple[int, float, int]:
        length = knots.time[ends[1]] - knots.time[ends[0]]
        return (
            pieces(knots.mode[ends[0]], knots.region[ends[0]]).bound,
            round(float(np.log(length)), 3),
            ends[0],
        )

    a, b = max(found, key=rank)
    return float(0.5 * (knots.time[a] + knots.time[b]))


def latest(w: Window, pieces: Pieces) -> list[Recurrence]:
    """The last state of a motion, and its previous occurrence."""
    k = w.trajectory.knots
    found = segments(w.trajectory)
    if len(found) == 1:
        return _closest(w, float(k.time[-1]), -1.0)
    recent = [
        s for s in found[1:-1] if k.time[s[1]] >= k.time[-1] - 0.25 * (k.time[-1] - w.times[0])
    ]
    return _closest(w, station_time(k, pieces, recent or found[-2:-1]), -1.0)


def after(w: Window, pieces: Pieces, period: float) -> Recurrence:
    """An early state of a motion, well inside a mode, that recurs after a known period."""
    k = w.trajectory.knots
    begin = float(k.time[0])
    found = segments(w.trajectory)
    inside = [(a, b) for a, b in found[1:] if 0.5 * (k.time[a] + k.time[b]) <= begin + period]
    t = station_time(k, pieces, inside or found[:1]) if len(found) > 1 else begin
    steps = np.searchsorted(k.time, [t, t + period], side="right") - 1
    here, there = (
        _state(w, float(time), min(int(step), len(k.time) - 2))
        for time, step in zip((t, t + period), steps, strict=True)
    )
    turns = max(round(period / w.period), 1) if w.period else 1
    return Recurrence(t, here, period, turns, there - here, 0.0)


def earliest(w: Window) -> list[Recurrence]:
    """The first return of a motion to its start."""
    k = w.trajectory.knots
    whole = segments(w.trajectory)
    a, b = whole[0]
    return _closest(w, float(k.time[a] if len(whole) == 1 else 0.5 * (k.time[a] + k.time[b])), 1.0)


def _closest(w: Window, t: float, sign: float) -> list[Recurrence]:
    """The returns, looking back (−1) or ahead (+1), that are closer than all before, the shortest
    period first.

    The shortest is not always the closest: while a motion settles along complex multipliers, a
    later return may look closer than one period.
    """
    k = w.trajectory.knots
    here = min(int(np.searchsorted(k.time, t, side="right")) - 1, len(k.time) - 2)
    y = _state(w, t, here)
    times, steps = _strobe(w, t, sign) if w.symmetry.driven else _passages(w, t, y, here, sign)
    if len(times) == 0:
        return []
    states = w.trajectory.states_at(np.asarray(times), np.asarray(steps))
    turns = np.round((times - t) / w.period).astype(int) if w.period else np.zeros(len(times), int)
    gap = states - y - np.multiply.outer(turns, w.symmetry.turn)
    misses = np.linalg.norm(w.apart(gap, times - t), axis=1)
    found = []
    least = np.inf
    for i, miss in enumerate(misses):
        if miss <= _BETTER * least:
            least = miss
            later = sign * (states[i] - y)
            between = (w.times - t) * (w.times - times[i]) <= 0.0
            if not np.any(between):  # shorter than from one sample to the next
                between[:] = True
            passed = w.times[between]
            size = (
                np.max(np.ptp(w.in_frame(w.carried(w.states[between], passed), passed), axis=0))
                / 2.0
            )
            distance = float(ratio(miss, size))
            found.append(
                Recurrence(t, y, abs(float(times[i] - t)), abs(int(turns[i])) or 1, later, distance)
            )
    # If a later return nearly closes, earlier ones are near approaches within the cycle.
    return [r for r in found if r.distance <= _CLOSER * max(found[-1].distance, _EXACT)]


def _state(w: Window, t: float, step: int) -> Array:
    return w.trajectory.states_at(np.array([t]), np.array([step]))[0]


def _strobe(w: Window, t: float, sign: float) -> tuple[Array, Array]:
    """Times a whole number of the drives' periods away."""
    k = w.trajectory.knots
    period = w.period
    assert period is not None
    reach = k.time[-1] - t if sign > 0.0 else t - w.times[0]
    times = t + sign * period * np.arange(1, int(reach / period) + 1)
    return times, np.clip(np.searchsorted(k.time, times, side="right") - 1, 0, len(k.time) - 2)


def _passages(w: Window, t: float, y: Array, here: int, sign: float) -> tuple[Array, Array]:
    """Times at which the motion passes the plane across itself through a state, in the same mode
    and direction."""
    k = w.trajectory.knots
    same = np.all(k.mode[w.index] == k.mode[here], axis=1) & np.all(
        k.region[w.index] == k.region[here], axis=1
    )
    if not np.any(same):
        return np.zeros(0), np.zeros(0, np.int64)
    # A step may be shorter than the distance of two samples; any in its mode has its field.
    piece = w.surroundings.pieces[int(np.flatnonzero(same)[0])]
    p = np.array([w.trajectory.parameters[name] for name in w.trajectory.system.parameters])
    normal = w.in_frame(piece.rates(t, y, p), 1.0)

    def height(states: Array, times: Array) -> Array:
        return w.apart(states - y, times - t) @ normal

    h = height(w.states, w.times)
    up = same[:-1] & (w.index[:-1] == w.index[1:]) & (h[:-1] <= 0.0) & (h[1:] > 0.0)
    up &= (w.times[:-1] - t) * (w.times[1:] - t) > 0.0
    up &= sign * (w.times[:-1] - t) > 0.0
    found = np.flatnonzero(up)[:: int(sign)]
    a = w.times[found]
    b = w.times[found + 1]
    ha = h[found]
    hb = h[found + 1]
    for _ in range(6):
        middle = a - ha * (b - a) / (hb - ha)
        at = w.trajectory.states_at(middle, w.index[found])
        hm = height(at, middle)
        below = hm <= 0.0
        a, ha = np.where(below, middle, a), np.where(below, hm, ha)
        b, hb = np.where(below, b, middle), np.where(below, hb, hm)
    return np.where(np.abs(ha) < np.abs(hb), a, b), w.index[found]
