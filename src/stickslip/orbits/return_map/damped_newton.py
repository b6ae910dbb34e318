"""The damped Newton method for cycles, and the placement of its stations."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, StickslipError
from stickslip.kept import cached_property
from stickslip.motion.problem import Problem
from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.return_map.following import follow_state
from stickslip.orbits.return_map.held import held_positions, same_held
from stickslip.orbits.return_map.multipliers import Spectrum, spectrum
from stickslip.orbits.return_map.recurrence import Recurrence, Window, segments, sizes_of
from stickslip.orbits.return_map.shooting import Orbit, Setting, Shooting, parameter_values
from stickslip.orbits.return_map.stations import make_station

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory
    from stickslip.orbits.return_map.slopes import CycleSlope


_MOST_STEPS = 25
_HALVINGS = 6
_CHORD = 0.1  # a derivative is kept while steps with it reduce the closure error to this fraction
_ROUNDED = 1e-12  # relative residual above which Newton's method needs one more step
CLOSED = 1e-9  # closure error of a cycle relative to its size
NEARLY_SINGULAR = 1e-11  # singular value relative to the largest below which it is zero
_STATIONS = (1, 4, 16)  # numbers of stations, tried sequentially
_LONG = 0.1  # a stretch shorter than this fraction of the longest may vanish
_EQUAL = 0.999  # … and those that are longer than this fraction of the longest are equally good
_AS_GOOD = 0.5  # … nearly as good, if a station is there already
_ACROSS = 0.1  # cosine of a nearly right angle
_SAMPLES = 64  # samples of a period that are stored
_GROWTH = 1e4  # largest growth of perturbations between two stations


class NotClosed(ConvergenceError):
    """Newton's method has not closed a motion; `orbit` is the closest, with the closure error
    `miss`, in units of its size."""

    def __init__(self, shooting: Shooting, orbit: Orbit, miss: float) -> None:
        self.shooting = shooting
        self.orbit = orbit
        self.miss = miss
        super().__init__(
            f"a cycle of {shooting.problem.system.name}",
            f"Newton's method did not converge; the closest motion fails to close by {miss:.2g} "
            f"of its size after the period {orbit.period:.6g}, from {orbit.start}",
            "Choose a start closer to the cycle, or a motion that has converged",
        )


def near(
    problem: Problem, pieces: Pieces, w: Window | Setting, found: Recurrence
) -> tuple[Shooting, Array]:
    """The equations of the cycle near a recurrence, and the initial guess.

    Parameters
    ----------
    w : Window or Setting
        Where the symmetries of the system are determined.
    """
    motion = follow_state(problem, found.time, found.time + found.period, found.state)
    sizes = sizes_of(motion, found.shift, pieces)
    symmetry = w.symmetry
    known = symmetry.moved(found.period, found.turns, np.zeros(symmetry.cells.shape[1]))
    cells = symmetry.counted(found.shift - known, sizes)
    if not np.any(cells):
        symmetry, cells = replace(symmetry, cells=np.zeros((len(sizes), 0))), np.zeros(0)
    setting = Setting(
        symmetry, w.surroundings, w.clock, found.turns, cells, sizes, held_positions(motion)
    )
    piece = pieces(motion.knots.mode[0], motion.knots.region[0])
    station = make_station(0.0, piece, found.time, found.state, parameter_values(problem), sizes)
    shooting = Shooting(problem, pieces, [station], found.time, setting, [motion])
    return shooting, shooting.guess(found.period, found.shift)


def close(shooting: Shooting, x: Array, across: Array | None = None) -> Orbit:
    """Damped Newton's method: steps are shortened until the closure error decreases.

    The derivative is kept from step to step as long as full steps with it reduce the closure error
    by an order of magnitude: it costs several times as much as the motion.

    Parameters
    ----------
    x : array
        Unknowns to start from.
    across : array, optional
        Direction in the unknowns, in their units, to which steps are orthogonal.

    Raises
    ------
    NotClosed
        If it does not converge; the message gives the smallest closure error.
    """
    orbit = shooting.orbit(x)
    linear: _Linear | None = None
    for _ in range(_MOST_STEPS):
        # After one more full step the residual is rounding error, which cannot be improved.
        last = bool(np.linalg.norm(orbit.F) <= _ROUNDED)
        if linear is not None:
            better = linear.full_step(shooting, orbit)
            if better is not None:
                orbit = better
                if last:
                    break
                continue
            if last:
                break
        linear = _Linear.at(shooting, orbit, across)
        better = _shortened(shooting, orbit, linear, 1 if last else _HALVINGS)
        orbit = better or orbit
        if last or better is None:
            break
    miss = max(float(np.linalg.norm(orbit.F)), shooting.miss(orbit))
    if not miss <= CLOSED:
        raise NotClosed(shooting, orbit, miss)
    return orbit


@dataclass(frozen=True)
class _Linear:
    """The equations linearised at an orbit, in units of the unknowns.

    Attributes
    ----------
    matrix : array
        Derivatives, rows with a large coefficient divided by it.
    size : array
        These coefficients; 1 for other rows.
    units : array
    more : int
        Number of additional equations.
    """

    matrix: Array
    size: Array
    units: Array
    more: int

    @classmethod
    def at(cls, shooting: Shooting, orbit: Orbit, across: Array | None) -> _Linear:
        """Linearise at an orbit; `across` as in :func:`close`."""
        units = shooting.units(orbit.x)
        rows = orbit.J * units
        if across is not None:
            rows = np.vstack([rows, across])
        return cls(*_balanced(rows), units, int(across is not None))

    def step(self, orbit: Orbit) -> Array:
        """Newton's step, in units of the unknowns."""
        right = np.append(orbit.F, np.zeros(self.more)) / self.size
        return _least_squares(self.matrix, right)

    def full_step(self, shooting: Shooting, orbit: Orbit) -> Orbit | None:
        """The orbit after a full step; None if the closure error does not decrease enough."""
        step = self.step(orbit)
        if not np.max(np.abs(step)) <= 1.0:
            return None
        try:
            trial = shooting.orbit(orbit.x - self.units * step)
        except StickslipError:
            return None
        enough = np.linalg.norm(trial.F) <= _CHORD * np.linalg.norm(orbit.F)
        return trial if enough else None


def _least_squares(matrix: Array, right: Array) -> Array:
    """The shortest solution by QR decomposition with pivoting: with hundreds of unknowns it takes a
    third of the time of singular values."""
    from scipy.linalg import lstsq

    if not np.all(np.isfinite(matrix)) or not np.all(np.isfinite(right)):
        raise np.linalg.LinAlgError("the equations of a cycle are not finite")
    given: Any = {"cond": NEARLY_SINGULAR, "lapack_driver": "gelsy", "check_finite": False}
    found: Any = lstsq(matrix, right, **given)
    return found[0]


def _balanced(matrix: Array) -> tuple[Array, Array]:
    """Equations divided by their largest coefficient if it is large, and these divisors: growth in
    one direction must not hide others."""
    size = np.maximum(np.max(np.abs(matrix), axis=1), 1.0)
    return matrix / size[:, None], size


def flattest(shooting: Shooting, orbit: Orbit) -> tuple[float, Array]:
    """The smallest singular value of the equations, relative to the largest, and its singular
    vector."""
    square = orbit.J[:, : len(orbit.F)] * shooting.units(orbit.x)[: len(orbit.F)]
    _, s, v = np.linalg.svd(_balanced(square)[0])
    return float(s[-1] / s[0]), v[-1]


def _shortened(shooting: Shooting, orbit: Orbit, linear: _Linear, tries: int) -> Orbit | None:
    """The first of the shortened steps with a smaller closure error; None if there is none."""
    units, step = linear.units, linear.step(orbit)
    miss = np.linalg.norm(orbit.F)
    # At first no unknown changes by more than its unit, and the period by at most 0.3 of its unit.
    part = min(1.0, ratio(1.0, np.max(np.abs(step))), ratio(0.3, abs(step[shooting.time])))
    for _ in range(tries):
        try:
            trial = shooting.orbit(orbit.x - part * units * step)
        except StickslipError:
            trial = None
        # Armijo's condition: at least a quarter of the decrease that the linear model predicts.
        if trial is not None and np.linalg.norm(trial.F) <= (1.0 - 0.25 * part) * miss:
            return trial
        part *= 0.5
    return None


# -- stations --------------------------------------------------------------------------------------


def largest_growth(orbit: Orbit) -> float:
    """Largest growth of a perturbation from one station to the next."""
    return max(leg.growth for leg in orbit.legs)


def stations_for(shooting: Shooting, orbit: Orbit) -> int:
    """Number of stations that keeps the growth between them moderate."""
    parts = int(np.ceil(np.log(max(largest_growth(orbit), 1.0)) / np.log(_GROWTH)))
    return len(shooting.stations) * max(1, parts)


def best_start(shooting: Shooting, orbit: Orbit) -> float:
    """Time of the best state for a station, within one period.

    It is the middle of the longest good stretch. On a cycle of one stretch it is where the motion
    is across the direction to the centre, so that the section passes through the centre and the
    cycle may shrink to it.
    """
    good = _good_stretches(shooting, orbit)
    if not good:
        k = orbit.motion.knots
        return _across_the_centre(shooting, orbit, shooting.pieces(k.mode[0], k.region[0]))
    longest = max(b - a for a, b in good)
    middle = next(0.5 * (a + b) for a, b in good if b - a > _EQUAL * longest)
    return middle if middle >= orbit.motion.knots.time[0] else middle + orbit.period


def _good_stretches(shooting: Shooting, orbit: Orbit) -> list[tuple[float, float]]:
    """Ends of the stretches with most constraints, none if there is only one stretch; those that
    are about to vanish do not count. One may begin before the orbit."""
    k = orbit.motion.knots
    pieces = shooting.pieces
    stretches = [(float(k.time[a]), float(k.time[b]), a) for a, b in segments(orbit.motion)]
    first, last = stretches[0], stretches[-1]
    made = [pieces(k.mode[i], k.region[i]) for _, _, i in stretches]
    if all(piece is made[0] for piece in made):
        return []
    if made[0] is made[-1]:
        stretches = [*stretches[1:-1], (last[0] - orbit.period, first[1], first[2])]
        made = [*made[1:-1], made[0]]
    lengths = [b - a for a, b, _ in stretches]
    long = [i for i, length in enumerate(lengths) if length >= _LONG * max(lengths)]
    most = max(made[i].bound for i in long)
    return [stretches[i][:2] for i in long if made[i].bound == most]


def _across_the_centre(shooting: Shooting, orbit: Orbit, piece: Piece) -> float:
    """When the motion is nearly at a right angle to the direction from the centre, and far from
    every boundary."""
    closed = Closed(shooting, orbit)
    count = 64
    sizes = shooting.setting.sizes
    times = orbit.motion.knots.time[0] + np.arange(count) / count * orbit.period
    states = closed.samples(count)
    radius = (states - np.mean(states, axis=0)) / sizes
    # A central difference is proportional to the velocity, whose direction alone matters.
    motion = np.roll(radius, -1, axis=0) - np.roll(radius, 1, axis=0)
    lengths = np.linalg.norm(radius, axis=1) * np.linalg.norm(motion, axis=1)
    cosine = ratio(np.abs(np.sum(radius * motion, axis=1)), lengths)
    states = states + np.outer(np.arange(count) / count, orbit.shift)
    n = states.shape[1]
    p = parameter_values(orbit.problem)
    guards = piece.felt(times, states.T, p)[n : n + len(piece.switches)]
    room = np.min(
        ratio(guards, np.max(np.abs(guards), axis=1, keepdims=True, initial=0.0)),
        axis=0,
        initial=1.0,
    )
    across = cosine <= max(_ACROSS, float(np.min(cosine)))
    return float(times[np.argmax(np.where(across, room, -np.inf))])


def restarted(
    shooting: Shooting, orbit: Orbit, count: int, sizes: Array | None = None
) -> tuple[Shooting, Array]:
    """The equations of the same cycle with a number of stations, the first well inside its stretch.

    Parameters
    ----------
    sizes : array, optional
        New units of the state.
    """
    begin = best_start(shooting, orbit)
    y = orbit.motion.states_at(np.array([begin]), np.array([_step(orbit.motion, begin)]))[
        0, : len(orbit.shift)
    ]
    shift, start = carried_along(shooting.setting, orbit.problem, begin)
    y = y - shift
    motion = follow_state(orbit.problem, start, start + orbit.period, y)
    sizes = shooting.setting.sizes if sizes is None else sizes
    held = held_positions(motion, shooting.setting.held)
    setting = replace(shooting.setting, sizes=sizes, held=held)
    # Stations that the events around them would put onto one time are one.
    # A station that is not moved is at exactly that part of the period.
    nominal = {start + part * orbit.period: part for part in (np.arange(1, count) / count).tolist()}
    wanted = [_well_inside(motion, t) for t in nominal]
    stations = []
    for t, i in sorted({(start, 0), *wanted}):
        state = motion.states_at(np.array([t]), np.array([i]))[0]
        piece = shooting.pieces(motion.knots.mode[i], motion.knots.region[i])
        stations.append(
            make_station(
                nominal.get(t, (t - start) / orbit.period),
                piece,
                t,
                state,
                parameter_values(orbit.problem),
                setting.sizes,
            )
        )
    new = Shooting(orbit.problem, shooting.pieces, stations, start, setting, [motion])
    return new, new.guess(orbit.period, orbit.shift)


def _step(motion: Trajectory, t: float) -> int:
    time = motion.knots.time
    return min(int(np.searchsorted(time, t, side="right")) - 1, len(time) - 2)


def _well_inside(motion: Trajectory, t: float) -> tuple[float, int]:
    """A time near t that is not near an event, and its step."""
    k = motion.knots
    a, b = next((a, b) for a, b in segments(motion) if k.time[b] >= t)
    margin = 0.2 * (k.time[b] - k.time[a])
    t = float(np.clip(t, k.time[a] + margin, k.time[b] - margin))
    return t, _step(motion, t)


def _starts_well(shooting: Shooting, orbit: Orbit) -> bool:
    """Whether a cycle has one station, with its own mode and directions, needs no others, and
    begins in the first period of the drives, in the middle half of a stretch that is about as good
    as the best one."""
    good = _good_stretches(shooting, orbit)
    shift, start = carried_along(shooting.setting, orbit.problem, shooting.start)
    if len(shooting.stations) > 1 or start != shooting.start or np.any(shift):
        return False
    k = orbit.motion.knots
    piece = shooting.stations[0].piece
    # The motion that the cycle was found from may have had another mode there, and where
    # constraints are curved, other directions.
    if shooting.pieces(k.mode[0], k.region[0]) is not piece or not piece.straight:
        return False
    longest = max((b - a for a, b in good), default=0.0)
    inside = [
        abs(start - 0.5 * (a + b)) <= 0.25 * (b - a) for a, b in good if b - a >= _AS_GOOD * longest
    ]
    return any(inside) and stations_for(shooting, orbit) == 1


@dataclass(frozen=True)
class Closed:
    """A cycle: the equations it solves and the solution.

    Attributes
    ----------
    slopes : dict
        Computed derivatives (:mod:`.slopes`), by parameter.
    """

    shooting: Shooting
    orbit: Orbit
    slopes: dict[str, CycleSlope] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def spectrum(self) -> Spectrum:
        """Multipliers of the cycle."""
        return spectrum(self.shooting, self.orbit)

    def trim(self) -> None:
        """Drop large arrays that can be computed again."""
        for leg in self.orbit.legs:
            leg.trim()

    def samples(self, count: int) -> Array:
        """States at equidistant times of the period, without the drift, shape (count, n)."""
        if _SAMPLES % count == 0:
            return self._sampled[:: _SAMPLES // count]
        return self.states_at(np.arange(count) / count)

    @cached_property
    def _sampled(self) -> Array:
        return self.states_at(np.arange(_SAMPLES) / _SAMPLES)

    def states_at(self, part: Array) -> Array:
        """States after parts of the period, without the drift, shape (parts, n)."""
        motion = self.orbit.motion
        time = motion.knots.time
        times = time[0] + part * self.orbit.period
        steps = np.clip(np.searchsorted(time, times, side="right") - 1, 0, len(time) - 2)
        return motion.states_at(times, steps) - np.outer(part, self.orbit.shift)

    @property
    def extent(self) -> float:
        """Largest range of a component, in units of the motion it was found from."""
        return float(np.max(np.ptp(self.samples(64), axis=0) / self.shooting.setting.sizes))

    def distance(self, state: Array, time: float) -> float:
        """From a state to the nearest point of the cycle, up to translations, in the same units.

        Of a driven system the points are those that the cycle passes at the same phase of the
        drive.
        """
        setting = self.shooting.setting
        shift, time = carried_along(setting, self.orbit.problem, time)
        points = self.samples(256) if setting.symmetry.frame is not None else self._strobed(time)
        gap = setting.symmetry.in_frame(points - (state - shift), setting.sizes) / setting.sizes
        N = setting.symmetry.shifts / setting.sizes[:, None]
        gap = gap - (gap @ N) @ np.linalg.pinv(N) if N.shape[1] else gap
        return float(np.min(np.linalg.norm(gap, axis=1)))

    def _strobed(self, time: float) -> Array:
        """States at one phase of the drive, each without the shift by the loads."""
        motion = self.orbit.motion
        setting = self.shooting.setting
        problem = self.orbit.problem
        assert setting.clock is not None
        whole = setting.clock.period(problem.parameters)
        begin = float(motion.knots.time[0])
        times = begin + (time - begin) % whole + whole * np.arange(setting.turns)
        steps = np.array([_step(motion, t) for t in times])
        states = motion.states_at(times, steps)
        return states - np.multiply.outer(np.floor(times / whole), setting.at(problem).turn)


def carried_along(setting: Setting, problem: Problem, time: float) -> tuple[Array, float]:
    """Shift of the state by the loads up to a time, and an equivalent time: 0, or within the first
    period."""
    symmetry = setting.at(problem)
    if symmetry.frame is not None:
        return time * symmetry.frame, 0.0
    assert setting.clock is not None
    whole = setting.clock.period(problem.parameters)
    turns = float(np.floor(time / whole))
    return turns * symmetry.turn, time - turns * whole


def converge(shooting: Shooting, x: Array) -> Closed:
    """Close a cycle, with as many stations as necessary.

    Raises
    ------
    ConvergenceError
        If it does not close with one station nor with several.
    """
    first: ConvergenceError | None = None
    for count in _STATIONS:
        try:
            if count > 1:
                shooting, x = restarted(shooting, shooting.orbit(x), count)
            return _with_rest_positions(shooting, close(shooting, x))
        except ConvergenceError as failure:
            first = first or failure
    assert first is not None
    raise first


def _with_rest_positions(shooting: Shooting, orbit: Orbit) -> Closed:
    """The same cycle from its best start, with equations for the rest positions of contacts that
    stick throughout."""
    for _ in range(3):
        if same_held(shooting.setting.held, held_positions(orbit.motion)):
            break
        shooting, x = restarted(shooting, orbit, len(shooting.stations))
        orbit = close(shooting, x)
    return with_best_start(shooting, orbit)


def with_best_start(shooting: Shooting, orbit: Orbit) -> Closed:
    """The same cycle from its best start, or a good one, with as many stations as the growth of
    perturbations requires."""
    if _starts_well(shooting, orbit):
        return Closed(shooting, orbit)
    new, x = restarted(shooting, orbit, stations_for(shooting, orbit))
    return Closed(new, close(new, x))
