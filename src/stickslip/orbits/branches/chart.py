"""A chart of a branch of cycles: coordinates around one of them, units, and the test functions
along the branch."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, StickslipError
from stickslip.orbits.branches.halving import half_gap
from stickslip.orbits.continuation.arclength import Outgrown, curve_between
from stickslip.orbits.continuation.bracket import zero_near
from stickslip.orbits.continuation.corrector import Lost, correct, correct_at
from stickslip.orbits.continuation.path import Point, Test
from stickslip.orbits.cycles.cycle import Cycle, make_cycle
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.variational import variation
from stickslip.orbits.return_map.damped_newton import Closed, best_start, restarted, stations_for
from stickslip.orbits.return_map.following import flies, follow_state
from stickslip.orbits.return_map.half_map import HalfMap, half_map
from stickslip.orbits.return_map.held import Held, held_positions, same_held
from stickslip.orbits.return_map.recurrence import segments, sizes_of
from stickslip.orbits.return_map.shooting import Orbit, Shooting, parameter_values

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory


_FAR = 1.0  # reach of a chart, in units of the size of the cycle
NOT_CLOSED = 1e-6  # a motion that misses its start by more, in the same units, is not a cycle
_SLANTED = 0.3  # smallest cosine between the motion and the normal of its section
KNOWN_TO = 1e-13  # accuracy of a motion relative to the size of the cycle
CLOSES_TO = 1e-11  # largest closure error, in the same units, if Newton's method can improve it
WIDTH = 0.25  # unit of the parameter as a fraction of its range
_FLOOR = 2e-3  # smallest unit of a component relative to its modulus
# a cycle of this amplitude, relative to the state, is about to shrink to an equilibrium
_VANISHED = 5e-3
# a cycle whose halves differ by this part of its size is about to become one of half its period
_HALVED = 2e-2
_UNBOUNDED = 1e3  # a period or an amplitude that has grown by this factor grows without bound
# tolerance of a branch point, distance to a second place of its search, and its largest distance
# from the crossing of the branch, the latter two as fractions of the range
_FINE, _BESIDE, _CROSSES = 1e-11, 1e-6, 1e-4
# distance of a multiplier from 1 above which the equations of the return map are regular enough
_NEAR_ONE = 0.05
# so many of the latest orbits are kept completely, and of the earlier ones so many without their
# largest arrays
_LATEST, _EARLIER = 3, 40
_NO_SLOPE = 1e-7  # slope of the parameter along the curve at a fold


class OutOfChart(StickslipError):
    """The station of the chart is no longer on the cycle."""


@dataclass(frozen=True)
class Extent:
    """Range of a parameter, and scales from the start of a branch.

    Attributes
    ----------
    modulus : array, shape (n,)
        Size of each component of the state.
    period : float
        The longest that is expected: that at the start, or those of the drives at the ends.
    least, largest : float
        Amplitudes, relative to the modulus, below which a cycle is about to vanish and above which
        it has no bound.
    halved : float
        Difference of its halves below which a cycle is about to become one of half its period.
    """

    low: float
    high: float
    modulus: Array
    period: float
    least: float
    largest: float
    halved: float

    def amplitude(self, closed: Closed) -> float:
        """Largest half range of a component relative to its modulus."""
        return float(np.max(0.5 * np.ptp(closed.samples(64), axis=0) / self.modulus))


def extent_of(closed: Closed, parameter: str, span: tuple[float, float]) -> Extent:
    """Scales of a branch that starts at a cycle."""
    sizes = sizes_of(closed.orbit.motion, closed.orbit.shift, closed.shooting.pieces)
    modulus = np.maximum(np.max(np.abs(closed.samples(64)), axis=0), sizes)
    halved = min(_HALVED, max(0.3 * half_gap(closed), NOT_CLOSED))
    period = max([closed.orbit.period, *_periods(closed, parameter, span)])
    extent = Extent(*span, modulus, period, _VANISHED, _UNBOUNDED, halved)
    amplitude = extent.amplitude(closed)
    return replace(
        extent, least=min(_VANISHED, 0.3 * amplitude), largest=_UNBOUNDED * max(amplitude, 0.1)
    )


def _periods(closed: Closed, parameter: str, span: tuple[float, float]) -> list[float]:
    """Periods of the driven cycle at the ends of a range, without ends at which the drives are
    constant."""
    setting = closed.shooting.setting
    found = list[float]()
    if setting.clock is None:
        return found
    for end in span:
        values = {**closed.orbit.problem.parameters, parameter: end}
        with suppress(DeclarationError, ZeroDivisionError, OverflowError):
            found.append(setting.turns * setting.clock.period(values))
    return found


@dataclass
class Chart:
    """Cycles near one of them.

    Attributes
    ----------
    shooting : Shooting
        With a free parameter.
    half : HalfMap or None
        If the second halves of the cycles mirror the first, and a multiplier is near 1: then its
        equations are solved, which are regular where the cycles lose this symmetry.
    halves : bool
        Whether such a map is used.
    candidates, cycles : dict
        The latest orbits that were computed, and cycles that were looked at, by their unknowns.
    latest : array or None
        As in :class:`stickslip.orbits.continuation.corrector.CostlyJacobian`.
    """

    shooting: Shooting
    extent: Extent
    half: HalfMap | None = None
    halves: bool = False
    candidates: dict[bytes, Closed] = field(default_factory=dict)
    cycles: dict[bytes, Cycle] = field(default_factory=dict)
    latest: Array | None = field(default=None, repr=False)

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """The equations."""
        if self.half is not None:
            return self.half.equations(self.shooting, x)
        orbit = self.orbit(x)
        self.latest = orbit.J
        return orbit.F, orbit.J

    def residual(self, x: Array) -> Array:
        """Their residual."""
        return self(x)[0] if self.half is not None else self.orbit(x).F

    def orbit(self, x: Array) -> Orbit:
        """The orbit of given unknowns."""
        return self.closed(x).orbit

    def closed(self, x: Array) -> Closed:
        """The closed cycle of given unknowns."""
        key = x.tobytes()
        found = self.candidates.get(key)
        if found is None:
            found = self.candidates[key] = Closed(self.shooting, self.shooting.orbit(x))
            keys = list(self.candidates)
            for other in keys[-_LATEST - 1 : -_LATEST]:
                self.candidates[other].trim()
            for other in keys[: -_LATEST - _EARLIER]:
                del self.candidates[other]
        return found

    def scale(self, x: Array) -> Array:
        """Units of the unknowns."""
        return self.shooting.units(x, WIDTH * (self.extent.high - self.extent.low))

    def cycle(self, x: Array) -> Cycle:
        """The cycle of given unknowns, with its results."""
        key = x.tobytes()
        if key not in self.cycles:
            self.cycles[key] = make_cycle(self.closed(x))
        return self.cycles[key]

    def along(self, start: Point, distance: float, tolerance: float, near: Array) -> Array:
        """Unknowns at a distance from a point, measured along its tangent, corrected from a
        guess."""
        units, tangent = start.units, start.heading
        guess = start.x + units * tangent * distance
        return correct(self, guess, units, tangent, tolerance, near, KNOWN_TO, CLOSES_TO)

    def bent(self, start: Point, end: Point, distance: float) -> Array:
        """Guess of the curve at a distance from a point, on the way to another one."""
        return curve_between(start, end, start.units, start.heading, distance)

    def to_smaller_cycles(self, factor: float) -> Chart:
        """The same chart with a smaller amplitude limit."""
        return replace(self, extent=replace(self.extent, least=factor * self.extent.least))

    def resting_as(self, motion: Trajectory) -> Chart:
        """The same coordinates for cycles on which the contacts of a motion stick throughout."""
        held = held_positions(motion, self.shooting.setting.held)
        return self if same_held(self.shooting.setting.held, held) else self.with_held(held)

    def carrying(self, contact: int, edge: int) -> Chart:
        """The same coordinates for cycles on which a contact is carried along at an edge, or (0)
        keeps its position."""
        held = self.shooting.setting.held
        return self.with_held(
            tuple(replace(h, edge=edge) if h.contact == contact else h for h in held)
        )

    def with_held(self, held: tuple[Held, ...]) -> Chart:
        """The same coordinates, with other positions of rest."""
        old = self.shooting
        setting = replace(self.shooting.setting, held=held)
        new = Shooting(old.problem, old.pieces, old.stations, old.start, setting)
        return Chart(new, self.extent, _suited(self.half, new), self.halves)

    def without_half_map(self) -> Chart:
        """The same coordinates for cycles whose halves differ."""
        return Chart(self.shooting, self.extent)

    @property
    def on_edge(self) -> bool:
        """Whether a contact is carried along at the edge of its interval of rest."""
        return any(h.edge for h in self.shooting.setting.held)

    def carried(self, x: Array, tangent: Array) -> float:
        """Distance by which contacts on an edge are carried in their direction of slip; 1 if none
        is on an edge.

        At a zero the contacts are released, and keep their positions.
        """
        shooting = self.shooting
        place = self.orbit(x).legs[0].place
        change = place.directions @ tangent[: shooting.first[1]] + place.by_parameter * tangent[-1]
        sizes = shooting.setting.sizes
        moved = [
            h.edge * (h.form @ change) / (np.abs(h.form) @ sizes)
            for h in shooting.setting.held
            if h.edge
        ]
        return float(min(moved, default=1.0))

    def tests(self, x: Array, tangent: Array) -> Mapping[Test, float]:
        """Test functions of special points and of the ends of a branch."""
        closed = self.closed(x)
        orbit = closed.orbit
        self.check(orbit)
        slope = float(tangent[-1] / self.scale(x)[-1])
        extent = self.extent
        amplitude = extent.amplitude(closed)
        return {
            "fold": slope,
            **spectral_tests(closed.spectrum.others, slope),
            **({"branch point": self.leaves_symmetry(orbit)} if self.half else {}),
            "amplitude": amplitude / extent.least - 1.0,
            "halving": half_gap(closed) / extent.halved - 1.0,
            "growth": 1.0 - amplitude / extent.largest,
            "period": 1.0 - orbit.period / (_UNBOUNDED * extent.period),
            "carried": self.carried(x, tangent),
        }

    def leaves_symmetry(self, orbit: Orbit) -> float:
        """A function that vanishes where a multiplier of the half map is −1; 1 without such a
        map."""
        if self.half is None:
            return 1.0
        found = self.half.multipliers(self.shooting, orbit)
        return float(np.prod((1.0 + found) / (1.0 + np.abs(found))).real)

    def check(self, orbit: Orbit) -> None:
        """Check that an orbit is a cycle of this chart.

        Raises
        ------
        OutOfChart
            If it is not: it begins or ends in another mode.
        Outgrown
            If it needs another chart.
        """
        shooting = self.shooting
        for station, leg in zip(shooting.stations, orbit.legs, strict=True):
            k = leg.motion.knots
            a = segments(leg.motion)[0][0]
            if shooting.pieces(k.mode[a], k.region[a]) is not station.piece:
                raise OutOfChart("the cycle starts in a different mode from its chart")
        if shooting.miss(orbit) > NOT_CLOSED:
            raise OutOfChart("the cycle ends in a different mode from its start")
        if np.max(np.abs(orbit.x[: shooting.time]), initial=0.0) > _FAR:
            raise Outgrown("the cycle has left its chart")
        if shooting.symmetry.frame is not None:
            place = orbit.legs[0].place
            station = shooting.stations[0]
            rate = (
                station.piece.rates(shooting.start, place.state, parameter_values(orbit.problem))
                - shooting.symmetry.frame
            )
            motion = station.chart @ rate
            if not shooting.fixed[0] @ motion >= _SLANTED * np.linalg.norm(motion):
                raise Outgrown("the motion is tangent to its section")


def first_chart(
    closed: Closed, pieces: Pieces, extent: Extent, halves: bool = False
) -> tuple[Chart, Array]:
    """A chart around a cycle, with the free parameter of the pieces, and its unknowns.

    Parameters
    ----------
    halves : bool
        Whether the half map is used if there is one.
    """
    problem = closed.orbit.problem
    # A closed form is made for one set of parameters; here every motion has its own.
    exact = flies(closed.orbit.motion)
    boxes = {name: (value, value) for name, value in problem.parameters.items()}
    (free,) = pieces.free
    boxes[free] = (extent.low, extent.high)
    general = replace(problem, exact=exact, boxes=boxes)
    shooting = closed.shooting.with_pieces(pieces, general)
    orbit = shooting.orbit(np.append(closed.orbit.x, problem.parameters[free]))
    found = Closed(shooting, orbit)
    half = _half_map_near_one(found, extent) if halves else None
    count = len(shooting.stations)
    chart, x = _restarted(found, count, chart_sizes(closed, extent), extent, half)
    return replace(chart, halves=halves), x


def _restarted(
    closed: Closed, count: int, sizes: Array, extent: Extent, half: HalfMap | None
) -> tuple[Chart, Array]:
    """A chart around the best state of a cycle, and its unknowns; for a half map, the number of
    stations is even."""
    shooting, orbit = closed.shooting, closed.orbit
    count += count % 2 if half else 0
    new, x = restarted(shooting, orbit, count, sizes)
    return Chart(new, extent, _suited(half, new)), x


def symmetric_branch_point(chart: Chart, x: Array) -> Cycle | None:
    """The cycle at which a branch of cycles whose halves differ crosses one of cycles whose halves
    mirror each other, solved on the latter; None if there is none nearby.

    Parameters
    ----------
    x : array
        Unknowns near it.
    """
    if chart.half is not None:
        return None
    shooting, closed, extent = chart.shooting, chart.closed(x), chart.extent
    half = half_map(closed, shooting.pieces.free[0], (extent.low, extent.high))
    count = stations_for(shooting, closed.orbit)
    there, y = _restarted(closed, count, chart_sizes(closed, extent), extent, half)
    if there.half is None:
        return None
    near = there
    units = near.scale(y)

    def excess(value: float) -> float:
        nonlocal y
        guess = np.append(y[:-1], value)
        y = correct_at(near, guess, units, len(y) - 1, value, _FINE)
        return near.leaves_symmetry(near.orbit(y))

    known, width = float(y[-1]), extent.high - extent.low
    beside = known + math.copysign(_BESIDE * width, 0.5 * (extent.low + extent.high) - known)
    with suppress(Lost, StickslipError, ArithmeticError, np.linalg.LinAlgError):
        here = excess(known)
        slope = (excess(beside) - here) / (beside - known)
        if abs(here) > _CROSSES * width * abs(slope):
            return None
        value = zero_near(excess, known, known - (here / slope if slope else 0.0))
        if value is None:
            return None
        excess(value)
        return near.cycle(y) if extent.low <= value <= extent.high else None
    return None


def _half_map_near_one(closed: Closed, extent: Extent) -> HalfMap | None:
    """The half map of a cycle if it has one and a multiplier of the return map is near 1."""
    if np.min(np.abs(closed.spectrum.others - 1.0), initial=np.inf) > _NEAR_ONE:
        return None
    return half_map(closed, closed.shooting.pieces.free[0], (extent.low, extent.high))


def _suited(half: HalfMap | None, shooting: Shooting) -> HalfMap | None:
    """The half map, if it can be solved with these stations."""
    return half if half and half.suits(shooting) else None


def spectral_tests(multipliers: Array, slope: float) -> dict[str, float]:
    """Functions that vanish with a multiplier −1, a pair on the unit circle, and a multiplier 1
    that is not a fold."""
    one, other = np.triu_indices(len(multipliers), 1)
    pairs = multipliers[one] * multipliers[other]
    branching = np.prod((multipliers - 1.0) / (1.0 + np.abs(multipliers))).real
    # At a fold both the multiplier 1 and the slope are there, and their ratio is not known.
    known = abs(slope) > _NO_SLOPE and len(multipliers) > 0
    return {
        "period doubling": float(np.prod((multipliers + 1.0) / (1.0 + np.abs(multipliers))).real),
        "torus": float(np.prod((1.0 - pairs) / (1.0 + np.abs(pairs))).real),
        "branch point": float(branching / slope) if known else np.nan,
    }


def renewed(chart: Chart, x: Array, tangent: Array) -> tuple[Chart, Array, Array]:
    """A chart around the best state of a cycle; its unknowns, and the direction of travel carried
    over."""
    shooting = chart.shooting
    orbit = chart.orbit(x)
    begin = best_start(shooting, orbit)
    closed, extent = chart.closed(x), chart.extent
    half = _half_map_near_one(closed, extent) if chart.halves else None
    count = stations_for(shooting, orbit) if chart.half is None or half else 1
    there, y = _restarted(closed, count, chart_sizes(closed, extent), extent, half)
    there = replace(there, halves=chart.halves)
    new = there.shooting
    change = _carried(shooting, orbit, tangent, begin)
    station = new.stations[0]
    # The clock may be put back by whole periods, and these change along the branch, too.
    rounds = round((begin - new.start) / orbit.period)
    if rounds:
        p = parameter_values(orbit.problem)
        rate = station.piece.rates(new.start, station.origin, p)
        change = change + rounds * tangent[shooting.time] * rate
    xi = station.chart @ change
    xi = (
        xi - new.fixed.T @ np.linalg.lstsq(new.fixed.T, xi, rcond=None)[0] if len(new.fixed) else xi
    )
    towards = np.zeros(len(y))
    towards[: len(xi)] = xi
    towards[new.time :] = tangent[shooting.time :]
    return there, y, towards


def chart_sizes(closed: Closed, extent: Extent) -> Array:
    """Units of the state: half the range of each component, or a small part of its modulus."""
    sizes = sizes_of(closed.orbit.motion, closed.orbit.shift, closed.shooting.pieces)
    return np.maximum(sizes, _FLOOR * extent.modulus)


def _carried(shooting: Shooting, orbit: Orbit, tangent: Array, begin: float) -> Array:
    """Change of the state at a time within the period for a change of the unknowns."""
    n = len(orbit.shift)
    part = (begin - shooting.start) / orbit.period
    j = max(i for i, leg in enumerate(orbit.legs) if leg.begin <= part)
    leg, station = orbit.legs[j], shooting.stations[j]
    own = tangent[shooting.first[j] : shooting.first[j + 1]]
    start = float(leg.motion.knots.time[0])
    p = parameter_values(orbit.problem)
    later = (
        (leg.place.by_time - station.piece.rates(start, leg.place.state, p))
        * leg.begin
        * tangent[shooting.time]
    )
    first = leg.place.directions @ own + later + leg.place.by_parameter * tangent[-1]
    if begin <= start:
        return first
    motion = follow_state(orbit.problem, start, begin, leg.place.state)
    return variation(motion, shooting.pieces, np.append(first, tangent[-1])[:, None]).matrix[:n, 0]
