"""Periodic motions as zeros of a function: single and multiple shooting, up to a drift.

The motion is followed from each of one or several stations on the cycle to the next. The unknowns
are the states at the stations, the period T, the drift along each translation, and, for a branch, a
parameter. The equations are: each piece ends at the beginning of the next one (the last one at that
of the first, shifted by the drift); the phase of the first station is fixed (autonomous systems),
or T is the period of the drives; and its position along translations is fixed.

A station is well inside one mode, never at an event, and its coordinates ξ satisfy the constraints
of that mode: each sticking contact removes one coordinate. The sequence of modes is not prescribed;
it follows from the motion.

A contact that sticks throughout returns to any position, so its equation is trivial, and there is a
cycle for every position of rest. The equation is replaced by one for the position
(:mod:`stickslip.orbits.return_map.held`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.kept import cached_property
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import Problem
from stickslip.numerics.ratios import ratio
from stickslip.orbits.fields.clock import Clock, cells_of
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.symmetry import Surroundings, Symmetry
from stickslip.orbits.fields.variational import Variation, variation
from stickslip.orbits.return_map.following import NoReturn, follow_state
from stickslip.orbits.return_map.held import HELD, Held, Touch, nearest_slip, released, slips
from stickslip.orbits.return_map.stations import Place, Station

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


_LARGE_CHANGE = 2**20  # bytes of a variation that is computed again rather than kept
_DIFFERENCE = 1e-5  # relative step of a central difference: about the cube root of ε


def with_value(problem: Problem, parameter: str, value: float) -> Problem:
    """The same problem with another value of a parameter."""
    if value == problem.parameters[parameter]:
        return problem
    problem.system.declaration.check_range(parameter, value)
    return problem.at(parameter, value)


@dataclass(frozen=True)
class Leg:
    """The motion from one station to the next.

    Attributes
    ----------
    begin, end : float
        Parts of the period.
    place : Place
        Where it starts.
    directions : array, shape (m, directions)
        Perturbations of its start: those of the station's coordinates, then a later start, then the
        parameter.
    """

    begin: float
    end: float
    place: Place
    motion: Trajectory
    pieces: Pieces
    directions: Array

    @cached_property
    def change(self) -> Variation:
        """The variation in these directions. Between switches it may be NaN."""
        return variation(self.motion, self.pieces, self.directions, between=False)

    @cached_property
    def differentiable(self) -> bool:
        """Whether the change exists."""
        return self.change.differentiable

    @cached_property
    def growth(self) -> float:
        """Largest growth of a perturbation of the coordinates of its start; 0 if the state is a
        function of time alone, as for a slipping rate-independent contact."""
        directions = self.place.directions
        change = self.change.matrix[: len(self.place.state), : directions.shape[1]]
        grown = change / np.max(np.abs(directions), axis=0)
        return float(np.max(np.abs(grown), initial=0.0))

    def trim(self) -> None:
        """Drop the change if it is large, until it is needed again."""
        known = vars(self)
        if "change" in known and self.change.after.nbytes > _LARGE_CHANGE:
            _ = self.differentiable, self.growth, self.rate
            known.pop("varied", None)
            known.pop("change", None)  # another thread may have dropped it

    @cached_property
    def rate(self) -> Array:
        """Rates at its end."""
        k = self.motion.knots
        p = parameter_values(self.motion.problem)
        return self.change.pieces[-1].rates(float(k.time[-1]), k.state[-1], p)

    @cached_property
    def varied(self) -> Variation:
        """The change with its values between switches."""
        if not np.any(np.isnan(self.change.after[:, 0])):
            return self.change
        return variation(self.motion, self.pieces, self.change.after[0])


@dataclass(frozen=True)
class KnownShift:
    """A shift of the state with its derivatives by the period and by the parameter."""

    value: Array
    by_time: Array
    by_parameter: Array


@dataclass(frozen=True)
class Setting:
    """The setting of a cycle: its symmetries, drives, and scales.

    Attributes
    ----------
    surroundings : Surroundings
        With which the symmetry is found for other parameters.
    clock : Clock or None
        Of driven systems.
    turns : int
        Periods of the drives in a period of the cycle.
    cells : array, shape (cells,)
        Cells by which the state is shifted in it.
    sizes : array, shape (n,)
        Size of each component of the cycle.
    held : tuple of Held
        Positions that contacts keep because they stick throughout.
    """

    symmetry: Symmetry
    surroundings: Surroundings
    clock: Clock | None
    turns: int
    cells: Array
    sizes: Array
    held: tuple[Held, ...]
    _found: dict[bytes, Symmetry] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def at(self, problem: Problem) -> Symmetry:
        """The symmetry for other parameters."""
        key = parameter_values(problem).tobytes()
        if key not in self._found:
            self._found[key] = self._symmetry(problem)
        return self._found[key]

    def _symmetry(self, problem: Problem) -> Symmetry:
        drives = self.clock.drives(problem.parameters) if self.clock else None
        cells = np.zeros((len(self.sizes), 0))
        if len(self.cells):
            cells = cells_of(problem.compiled.equations, problem.parameters)
        return self.surroundings.symmetry(parameter_values(problem), drives, cells)

    def moved(self, symmetry: Symmetry, period: float) -> Array:
        """Known part of the shift in a period of the cycle."""
        return symmetry.moved(period, self.turns, self.cells)


@dataclass(frozen=True)
class Orbit:
    """A candidate for a cycle.

    Attributes
    ----------
    x : array
        Unknowns: coordinates of all stations, period, drifts, and the parameter if it is free.
    shift : array, shape (n,)
        State one period later minus state.
    F : array
        Residual.
    shooting : Shooting
        The equations.
    touches : dict
        By contacts that are held at an edge, where they are nearest to slipping.
    """

    x: Array
    problem: Problem
    period: float
    shift: Array
    legs: list[Leg]
    F: Array
    shooting: Shooting
    touches: dict[int, Touch] = field(default_factory=dict[int, Touch])

    @cached_property
    def J(self) -> Array:
        """Derivative of the residual."""
        # Most trial steps need the residual only, and the variation costs more than the motion.
        return self.shooting.derivative(self)

    @property
    def start(self) -> str:
        """The first state, as text."""
        named = zip(self.problem.system.declaration.state, self.legs[0].place.state, strict=True)
        return ", ".join(f"{name} = {value:.6g}" for name, value in named)

    @cached_property
    def motion(self) -> Trajectory:
        """One period, from the first station."""
        from stickslip.motion.record.knots import Knots
        from stickslip.motion.trajectory import Trajectory

        if len(self.legs) == 1:
            return self.legs[0].motion
        parts = [leg.motion.knots for leg in self.legs]
        knots = Knots.joined([*(k.first(len(k.time) - 1) for k in parts[:-1]), parts[-1]])
        return Trajectory(
            self.problem, (float(knots.time[0]), float(knots.time[-1])), knots, Outcome.FINISHED
        )


def parameter_values(problem: Problem) -> Array:
    """Values of all parameters."""
    return np.array([problem.parameters[name] for name in problem.system.parameters])


class Shooting:
    """The equations of a cycle, x ↦ (F, ∂F/∂x).

    Parameters
    ----------
    pieces : Pieces
        With the free parameter, if there is one; it is then the last component of x.
    start : float
        Time of the first station.
    motions : sequence of Trajectory
        Known motions, which are not computed again.
    """

    def __init__(
        self,
        problem: Problem,
        pieces: Pieces,
        stations: Sequence[Station],
        start: float,
        setting: Setting,
        motions: Sequence[Trajectory] = (),
    ) -> None:
        self.problem = problem
        self.motions = motions
        self.pieces = pieces
        self.stations: list[Station] = list(stations)
        self.start = start
        self.setting = setting
        self.symmetry: Symmetry = setting.symmetry
        self.free: str | None = next(iter(pieces.free), None)
        self.release: Array = released(setting.held, setting.sizes)
        self.first: Array = np.concatenate(
            [[0], np.cumsum([s.basis.shape[1] for s in self.stations])]
        ).astype(int)
        self.time: int = int(self.first[-1])
        self.drifts: slice = slice(self.time + 1, self.time + 1 + self.symmetry.shifts.shape[1])
        self.fixed: Array = self._fixed()
        self._shifted = bool(np.any(setting.moved(self.symmetry, 1.0)))
        self._last: Orbit | None = None
        self._legs: tuple[bytes, dict[int, Leg]] = b"", {}

    def with_pieces(
        self, pieces: Pieces, problem: Problem, motions: Sequence[Trajectory] = ()
    ) -> Shooting:
        """The same equations with another free parameter."""
        stations = []
        for station in self.stations:
            mode, region = station.piece.field.mode, station.piece.field.region
            stations.append(
                replace(station, piece=pieces(np.array(mode, np.int8), np.array(region, np.int8)))
            )
        return Shooting(problem, pieces, stations, self.start, self.setting, motions)

    def with_problem(self, problem: Problem) -> Shooting:
        """The same unknowns for other values of the parameters."""
        other = Shooting(problem, self.pieces, self.stations, self.start, self.setting)
        other.fixed = self.fixed
        return other

    def guess(self, period: float, shift: Array) -> Array:
        """Unknowns at the origins of the stations, from a period and the shift of the state in
        it."""
        unknown = shift - self.setting.moved(self.symmetry, period)
        N = self.symmetry.shifts / self.setting.sizes[:, None]
        drift = (
            np.linalg.lstsq(N, unknown / self.setting.sizes, rcond=None)[0]
            if N.shape[1]
            else np.zeros(0)
        )
        value = [self.problem.parameters[self.free]] if self.free else []
        return np.concatenate([np.zeros(self.time), [period], drift, value])

    def units(self, x: Array, width: float = 1.0) -> Array:
        """Units of the unknowns: size of the cycle, period, size again, width of the parameter's
        range."""
        lengths = [
            ratio(1.0, np.max(np.abs(self.stations[0].chart @ e))) for e in self.symmetry.shifts.T
        ]
        return np.concatenate(
            [np.ones(self.time), [x[self.time]], lengths, [width] if self.free else []]
        )

    def _fixed(self) -> Array:
        """Rows in the coordinates of the first station: fixed phase, and fixed position along
        translations."""
        station = self.stations[0]
        rows = [station.chart @ e for e in self.symmetry.shifts.T]
        if self.symmetry.frame is not None:
            # The section is orthogonal to the velocity relative to the frame, where the motion is
            # transverse.
            rate = (
                station.piece.rates(self.start, station.origin, parameter_values(self.problem))
                - self.symmetry.frame
            )
            rows.insert(0, station.chart @ rate)
        rows = [ratio(row, np.linalg.norm(row)) for row in rows]
        return np.array(rows).reshape(len(rows), station.basis.shape[1])

    def unchanged(self, orbit: Orbit) -> Array:
        """Changes of the coordinates of the first station that are invariant under the return: a
        later start, and translations."""
        station = self.stations[0]
        columns = [self.stations[0].chart @ e for e in self.symmetry.shifts.T]
        if not self.symmetry.driven:
            frame = self.setting.at(orbit.problem).frame if np.any(self.symmetry.frame) else 0.0
            rate = station.piece.rates(
                self.start, orbit.legs[0].place.state, parameter_values(orbit.problem)
            )
            columns.insert(0, station.chart @ (rate - frame))
        return np.array(columns).reshape(len(columns), station.basis.shape[1]).T

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Residual and derivative."""
        orbit = self.orbit(x)
        return orbit.F, orbit.J

    def orbit(self, x: Array) -> Orbit:
        """The motion that belongs to the unknowns.

        Raises
        ------
        NoReturn
            If it ends early.
        """
        if self._last is None or not np.array_equal(self._last.x, x):
            self._last = self._evaluate(x)
        return self._last

    def miss(self, orbit: Orbit) -> float:
        """Closure error of the complete state, in units of the size of the cycle.

        The equations contain only the coordinates of the stations: a leg might violate the
        constraints at its end.
        """
        gaps = []
        for j, leg in enumerate(orbit.legs):
            last = j + 1 == len(orbit.legs)
            target = (
                orbit.legs[0].place.state + orbit.shift if last else orbit.legs[j + 1].place.state
            )
            gaps.append(np.linalg.norm((leg.motion.knots.state[-1] - target) / self.setting.sizes))
        return float(max(gaps))

    def _evaluate(self, x: Array) -> Orbit:
        problem, period = self._posed(x)
        known = self.known_shift(problem, period)
        shift = known.value + self.symmetry.shifts @ x[self.drifts]
        legs = [self._leg(problem, j, x, period) for j in range(len(self.stations))]
        F = np.zeros(len(x) - bool(self.free))
        orbit = Orbit(x.copy(), problem, period, shift, legs, F, self)
        self._fill(orbit, F, None)
        return orbit

    def derivative(self, orbit: Orbit) -> Array:
        """Derivative of the residual of an orbit with respect to its unknowns."""
        J = np.zeros((len(orbit.F), len(orbit.x)))
        self._fill(orbit, np.zeros(len(orbit.F)), J)
        return J

    def _fill(self, orbit: Orbit, F: Array, J: Array | None) -> None:
        """Write the residual and, if there is an array for it, the derivative."""
        for j, leg in enumerate(orbit.legs):
            self._close(F, J, orbit.x, leg, j, orbit.shift)
        home = slice(*self.first[:2])
        if J is not None:
            # After a period the state is shifted: known shifts by drives, free ones by
            # translations.
            known = self.known_shift(orbit.problem, orbit.period)
            chart = self.stations[0].chart
            J[home, self.time] -= chart @ known.by_time
            J[home, self.drifts] = -chart @ self.symmetry.shifts
            if self.free:
                J[home, -1] -= chart @ known.by_parameter
        self._hold(F, J, orbit)
        self._fix(F, J, orbit.problem, orbit.x)

    def open_equations(self, x: Array) -> tuple[Array, Array, list[Place]]:
        """Residual and derivative without the equations of the first coordinates, which close the
        last leg; and the states at the stations. The last leg is not computed.

        Raises
        ------
        NoReturn
            If a motion ends early.
        """
        problem, period = self._posed(x)
        p = parameter_values(problem)
        rows = len(x) - bool(self.free)
        F, J = np.zeros(rows), np.zeros((rows, len(x)))
        for j in range(len(self.stations) - 1):
            self._close(F, J, x, self._leg(problem, j, x, period), j, np.zeros(0))
        self._fix(F, J, problem, x)
        places = [
            station.place(x[slice(*self.first[j : j + 2])], self.start + period * station.part, p)
            for j, station in enumerate(self.stations)
        ]
        return F, J, places

    def _posed(self, x: Array) -> tuple[Problem, float]:
        """The problem with the value of the free parameter, and the period."""
        period = float(x[self.time])
        if not period > 0.0:
            raise NoReturn("the period", f"it became {period:g}")
        if not self.free:
            return self.problem, period
        return with_value(self.problem, self.free, float(x[-1])), period

    def _fix(self, F: Array, J: Array | None, problem: Problem, x: Array) -> None:
        """Equations for the period of driven systems, and for phase and position along
        translations."""
        row = self.time
        if self.symmetry.driven:
            F[row], slopes = self._clock(problem, x)
            if J is not None:
                J[row] = slopes
            row += 1
        home = slice(*self.first[:2])
        F[row:] = self.fixed @ x[home]
        if J is not None:
            J[row:, home] = self.fixed

    def _leg(self, problem: Problem, j: int, x: Array, period: float) -> Leg:
        """The motion from a station to the next; those of the last unknowns are stored."""
        key = x.tobytes()
        if self._legs[0] != key:
            self._legs = key, {}
        if j not in self._legs[1]:
            self._legs[1][j] = self._new_leg(problem, j, x, period)
        return self._legs[1][j]

    def _new_leg(self, problem: Problem, j: int, x: Array, period: float) -> Leg:
        station = self.stations[j]
        p = parameter_values(problem)
        end = self.stations[j + 1].part if j + 1 < len(self.stations) else 1.0
        times = self.start + period * station.part, self.start + period * end
        place = station.place(x[slice(*self.first[j : j + 2])], times[0], p)
        columns = [
            place.directions,
            (place.by_time - station.piece.rates(times[0], place.state, p))[:, None],
        ]
        directions = np.hstack(columns)
        if self.free:
            directions = np.vstack([directions, np.zeros(directions.shape[1])])
            directions = np.column_stack([directions, np.append(place.by_parameter, 1.0)])
        motion = self._known(problem, times, place.state)
        if motion is None:
            motion = follow_state(problem, *times, place.state)
        return Leg(station.part, end, place, motion, self.pieces, directions)

    def _known(
        self, problem: Problem, times: tuple[float, float], state: Array
    ) -> Trajectory | None:
        """The known motion from a state, if there is one."""
        for motion in self.motions:
            same = motion.problem is problem and motion.t_span == times
            if same and np.array_equal(motion.knots.state[0], state):
                return motion
        return None

    def _close(self, F: Array, J: Array | None, x: Array, leg: Leg, j: int, shift: Array) -> None:
        """Equations for the end of a leg at the beginning of the next one, in the rows of the
        coordinates of that station."""
        target = (j + 1) % len(self.stations)
        n = len(leg.place.state)
        there = self.stations[target]
        rows = slice(*self.first[target : target + 2])
        own = slice(*self.first[j : j + 2])
        end = leg.motion.knots.state[-1] - (0.0 if target else shift)
        F[rows] = there.chart @ (end - there.origin) - x[rows]
        if J is None:
            return
        M = there.chart @ leg.change.matrix[:n]
        q = own.stop - own.start
        J[rows, own] += M[:, :q]
        J[rows, rows] -= np.eye(rows.stop - rows.start)
        # A longer period moves the end along the rates there, and starts the leg later.
        J[rows, self.time] += leg.end * (there.chart @ leg.rate) + leg.begin * M[:, q]
        if self.free:
            J[rows, -1] += M[:, -1]

    def _hold(self, F: Array, J: Array | None, orbit: Orbit) -> None:
        """Equations for the positions of contacts that stick throughout, in the rows of the trivial
        equations."""
        station = self.stations[0]
        home = slice(*self.first[:2])
        legs = orbit.legs
        for held, direction in zip(self.setting.held, self.release.T, strict=True):
            along = station.chart @ direction
            if not held.edge:
                place = legs[0].place
                F[home] += along * (held.form @ (place.state - station.origin))
                if J is not None:
                    J[home, home] += np.outer(along, held.form @ place.directions)
                    if self.free:
                        J[home, -1] += along * (held.form @ place.by_parameter)
                continue
            reach = held.edge * float(np.abs(held.form) @ self.setting.sizes)
            if slips(held, [leg.motion for leg in legs]):
                # It is moved to where it is just held: the missing force follows from the
                # displacement.
                row = held.form @ station.basis
                F[home] -= along * (2.0 * (row @ F[home]) + reach * HELD)
                if J is not None:
                    J[home] -= np.outer(along, 2.0 * (row @ J[home]))
                continue
            touch = orbit.touches.get(held.contact)
            if touch is None:
                touch = nearest_slip(held, [(leg.motion, leg.varied) for leg in legs], self.pieces)
                orbit.touches[held.contact] = touch
            F[home] += along * reach * touch.margin
            if J is not None:
                own = slice(*self.first[touch.leg : touch.leg + 2])
                q = len(touch.slopes) - 1 - bool(self.free)
                J[home, own] += np.outer(along, reach * touch.slopes[:q])
                J[home, self.time] += along * reach * legs[touch.leg].begin * touch.slopes[q]
                if self.free:
                    J[home, -1] += along * reach * touch.slopes[-1]

    def _clock(self, problem: Problem, x: Array) -> tuple[float, Array]:
        """The period is that of the drives."""
        clock = self.setting.clock
        turns = self.setting.turns
        row = np.zeros(len(x))
        assert clock is not None
        whole = turns * clock.period(problem.parameters)
        row[self.time] = 1.0 / whole
        if self.free:
            row[-1] = -x[self.time] / whole**2 * turns * clock.slope(problem.parameters, self.free)
        return x[self.time] / whole - 1.0, row

    def known_shift(self, problem: Problem, period: float) -> KnownShift:
        """Shift of the state in a period that the loads determine, with its derivatives."""
        zero = np.zeros(len(self.setting.sizes))
        if not self._shifted:
            return KnownShift(zero, zero, zero)
        setting = self.setting
        now = self.setting.at(problem)
        by_time = zero if now.frame is None else now.frame
        by_parameter = zero
        if self.free:
            value = problem.parameters[self.free]
            h = _DIFFERENCE * max(abs(value), 1e-3)
            ends = [
                setting.moved(setting.at(with_value(problem, self.free, value + d)), period)
                for d in (-h, h)
            ]
            by_parameter = (ends[1] - ends[0]) / (2.0 * h)
        return KnownShift(setting.moved(now, period), by_time, by_parameter)
