"""Cycles of a self-excited system over their amplitude.

A cycle with its excitation ξ is a point of a curve, F(x) = 0 with one unknown more than equations.
The last equation is that the amplitude is a given one. Its derivative is that of
the motion at the turning points. Small amplitudes or small ξ are no harder than others, and a free
oscillation is the cycle with ξ = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError, StickslipError, short
from stickslip.model.system import System
from stickslip.motion.problem import Problem, pose
from stickslip.numerics.levels import COMPUTED_ZERO, SAME_VALUE
from stickslip.numerics.ratios import ratio
from stickslip.orbits.branches.chart import NOT_CLOSED
from stickslip.orbits.cycles.cycle import Cycle, make_cycle
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.stable_set import settle_friction
from stickslip.orbits.fields.variational import variation
from stickslip.orbits.return_map.damped_newton import CLOSED, Closed, near, restarted, stations_for
from stickslip.orbits.return_map.following import flies, follow_freely, follow_state
from stickslip.orbits.return_map.recurrence import (
    Recurrence,
    segments,
    station_time,
    window,
)
from stickslip.orbits.return_map.shooting import Orbit, Shooting, parameter_values
from stickslip.orbits.studies.self_excitation import EXCITATION, LinearMode
from stickslip.orbits.studies.swinging import Swinging, ValuesAndRates
from stickslip.stopping.scopes import check_stop

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory

_SOLVED = 1e-11  # relative error of the amplitude and the size of the cycle
_KNOWN = 3e-3  # relative error of the amplitude below which its derivative is not recomputed
_MOST_STEPS = 20
_HALVINGS = 5  # largest number of halvings of a step
_BALANCES = 3  # iterations in which the excitation is guessed
_SAMPLED, _IN_STEP = 64, 4  # smallest number of samples of the period, and of a step, for the guess
_STRONGEST = 20.0  # growth rate of the guess, in a period, beyond the linear damping
_OTHER = 0.4  # largest |log ratio| of the periods of neighbours
_SHRINK = 0.5  # factor on a step of the amplitude that failed
_LEAST = 1e-3  # … but not below this fraction of the amplitude
_SINGULAR = 1e-13  # singular value, relative to the largest, of scaled equations: a rounding error
# samples of a step, between which the coordinate has at most one extremum, and refinements
_SAMPLES, _REFINED = 16, 6


@dataclass(frozen=True)
class AtAmplitude:
    """A cycle of a requested amplitude.

    Attributes
    ----------
    amplitude, measured : float
        Requested and measured amplitude.
    """

    cycle: Cycle
    amplitude: float
    measured: float

    @property
    def damping(self) -> float:
        """Damping ratio D = ξ/(2ω)."""
        return self.cycle.parameters[EXCITATION] * self.cycle.period / (4.0 * np.pi)

    @property
    def overdamped(self) -> bool:
        """Whether the mode does not oscillate without the excitation."""
        return self.damping >= 1.0 - SAME_VALUE


def share_of(problem: Problem, mode: LinearMode, swinging: Swinging) -> float:
    """Amplitude of a quantity relative to that of a mode, for small amplitudes.

    Raises
    ------
    DeclarationError
        If small oscillations of the mode do not change the quantity.
    """
    n = len(mode.shape)
    names = problem.system.declaration.inertial
    rest = dict(zip(names, map(float, mode.rest), strict=True))
    still = problem.initial_state({**rest, **{f"d_{x}": 0.0 for x in names}})
    slopes = swinging.gradient(still, problem.parameters)
    by_place = float(slopes[:n] @ mode.shape)
    by_rate = mode.frequency * float(slopes[n : 2 * n] @ mode.shape)
    size = float(np.abs(slopes[:n]) @ np.abs(mode.shape))
    size += mode.frequency * float(np.abs(slopes[n : 2 * n]) @ np.abs(mode.shape))
    # Positions and velocities of a mode are a quarter of a period apart.
    share = np.hypot(by_place, by_rate)
    if not share > COMPUTED_ZERO * size:
        raise DeclarationError(
            "of",
            f"small oscillations of the mode with the frequency {mode.frequency:.6g} do not "
            f"change '{short(swinging.name)}'",
            "Choose another quantity, or another mode",
        )
    return float(np.copysign(share, by_place))


class Amplitudes:
    """Search for cycles of given amplitudes.

    Parameters
    ----------
    system : System
        A self-excited one.
    swinging : Swinging
        Whose amplitude it is.

    Raises
    ------
    DeclarationError
        If small oscillations of the mode do not change the quantity.
    """

    def __init__(
        self, system: System, values: Mapping[str, float], mode: LinearMode, swinging: Swinging
    ) -> None:
        self.system = system
        self.mode = mode
        self.swinging = swinging
        self.problem: Problem = pose(system, {**values, EXCITATION: 0.0})
        self.pieces = Pieces(self.problem.compiled.equations, EXCITATION)
        self._given = Pieces(self.pieces.equations)
        self._latest: tuple[Orbit, Cycle] | None = None
        self.share = share_of(self.problem, mode, swinging)

    def amplitude(self, orbit: Orbit) -> float:
        """Half the range of the coordinate."""
        low, high, _ = _ends(orbit.motion, self.swinging.along(orbit.motion))
        return 0.5 * (high - low)

    # -- the first one -----------------------------------------------------------------------------

    def first(self, amplitude: float) -> tuple[Shooting, Orbit]:
        """The first cycle.

        Raises
        ------
        ConvergenceError
            If none is found.
        """
        return self._certified(*self.renewed(*self.solve(*self.begun(amplitude), amplitude)))

    def begun(self, amplitude: float) -> tuple[Shooting, Array]:
        """The equations near the motion from the equilibrium, displaced along the mode, with no
        slider extended."""
        names = self.system.declaration.inertial
        part = amplitude / self.share
        start = dict(zip(names, map(float, self.mode.rest), strict=True))
        rates = part * self.mode.frequency * self.mode.shape
        start |= {f"d_{x}": float(v) for x, v in zip(names, rates, strict=True)}
        y = self.problem.initial_state(start)
        # With its linear damping made up for, the motion lasts for the periods that are looked at.
        return self._near(self.mode.decay, y, 2.0 * np.pi / self.mode.frequency)

    def _near(self, excitation: float, y: Array, period: float) -> tuple[Shooting, Array]:
        """Equations near the motion from a state that nearly returns after a period, with the
        excitation that balances the dissipation.

        Sliders behind springs have settled after half a period.
        """
        rests = ConvergenceError(
            f"a backbone of {self.system.name}",
            "the motion comes to rest within a period",
            "Choose larger amplitudes",
        )
        for _ in range(_BALANCES):
            problem = self.problem.at(EXCITATION, excitation)
            before = follow_freely(problem, 0.0, 0.5 * period, y)
            begin = before.knots
            motion = follow_freely(problem, float(begin.time[-1]), 1.5 * period, begin.state[-1])
            if self.problem.exact and not flies(motion):
                # A closed form is made for one set of parameters; here every motion has its own.
                self.problem = replace(self.problem, exact=False)
            knots = motion.knots
            if len(knots.time) < 2:
                raise rests
            count = max(_SAMPLED, _IN_STEP * len(knots.time))
            times = np.linspace(knots.time[0], knots.time[-1], count + 1)
            steps = np.searchsorted(knots.time, times, side="right") - 1
            states = motion.states_at(times, np.clip(steps, 0, len(knots.time) - 2))
            n = len(self.mode.shape)
            rates = states[:-1, n : 2 * n]
            twice = np.einsum("ti,ij,tj->t", rates, self.mode.mass, rates)
            lost = float(motion.audit.dissipated[-1])
            excitation = ratio(lost, period * float(np.mean(twice)))
            if not (excitation - self.mode.decay) * period <= _STRONGEST:
                raise rests
        problem = self.problem.at(EXCITATION, excitation)
        motion = follow_state(problem, 0.0, 2.5 * period, y)
        k = motion.knots
        middles = [(0.5 * (k.time[a] + k.time[b]), (a, b)) for a, b in segments(motion)]
        inside = [s for t, s in middles if 0.5 * period <= t <= 1.6 * period]
        t = station_time(k, self.pieces, inside) if inside else 0.75 * period
        step = min(int(np.searchsorted(k.time, t, side="right")) - 1, len(k.time) - 2)
        state = motion.states_at(np.array([t]), np.array([step]))[0]
        w = window(motion, self.pieces)
        found = Recurrence(0.0, state, period, 1, np.zeros(len(state)), 0.0)
        return near(problem, self.pieces, w, found)

    # -- the next one ------------------------------------------------------------------------------

    def solve(self, shooting: Shooting, x: Array, amplitude: float) -> tuple[Shooting, Orbit]:
        """Newton's method with a given amplitude.

        Raises
        ------
        ConvergenceError
            If it does not converge.
        """
        orbit = self._tried(shooting, x)
        miss = self._miss(orbit, amplitude)
        gradient: Array | None = None
        for _ in range(_MOST_STEPS):
            check_stop()
            if miss <= _SOLVED:
                break
            units = _units(shooting, orbit)
            # Near the cycle the last derivative of the amplitude is good enough.
            if gradient is None or miss > _KNOWN:
                gradient = self.slopes(shooting, orbit)
            now = self.amplitude(orbit)
            matrix = np.vstack([orbit.J * units, gradient * units / amplitude])
            right = np.append(-orbit.F, 1.0 - now / amplitude)
            if not np.all(np.isfinite(matrix)):
                break
            step = np.linalg.lstsq(matrix, right, rcond=_SINGULAR)[0]
            better = self._shortened(shooting, orbit, units * step, amplitude, miss)
            if better is None:
                break
            orbit, miss = better
        miss = max(miss, shooting.miss(orbit))
        if not miss <= CLOSED:
            raise ConvergenceError(
                f"a backbone of {self.system.name}",
                f"Newton's method did not converge at the amplitude {amplitude:.6g}; the closest "
                f"motion fails to close by {miss:.2g}",
                "Choose another range of amplitudes",
            )
        _check(shooting, orbit)
        return shooting, orbit

    def renewed(self, shooting: Shooting, orbit: Orbit) -> tuple[Shooting, Orbit]:
        """The equations of the same cycle around its best state."""
        new, x = restarted(shooting, orbit, stations_for(shooting, orbit))
        return new, new.orbit(x)

    def predicted(self, shooting: Shooting, orbit: Orbit, amplitude: float) -> Array:
        """Predicted unknowns at another amplitude."""
        tangent, slope = self._along(shooting, orbit)
        part = (amplitude - self.amplitude(orbit)) / slope
        return orbit.x + part * _units(shooting, orbit) * tangent

    def scaled(self, orbit: Orbit, amplitude: float) -> tuple[Shooting, Array]:
        """The equations near a cycle scaled to a larger amplitude."""
        d = self.system.declaration
        y = orbit.legs[0].place.state.copy()
        factor = amplitude / self.amplitude(orbit)
        n = len(d.inertial)
        y[:n] = self.mode.rest + factor * (y[:n] - self.mode.rest)
        y[n : 2 * n] *= factor
        # A slider may now be stretched too far.
        settle_friction(self.pieces.equations, orbit.problem.parameters, y[None], 0.0)
        return self._near(orbit.problem.parameters[EXCITATION], y, orbit.period)

    def _tried(self, shooting: Shooting, x: Array) -> Orbit:
        """The motion of given unknowns, unless it diverges."""
        if not abs(x[-1] - self.mode.decay) * x[shooting.time] <= _STRONGEST:
            raise ConvergenceError(
                f"a backbone of {self.system.name}",
                f"no cycle was found: the excitation became {x[-1]:.4g}",
                "Choose other amplitudes",
            )
        return shooting.orbit(x)

    def _miss(self, orbit: Orbit, amplitude: float) -> float:
        lacking = 1.0 - self.amplitude(orbit) / amplitude
        return float(np.hypot(np.linalg.norm(orbit.F), lacking))

    def _shortened(
        self, shooting: Shooting, orbit: Orbit, step: Array, amplitude: float, miss: float
    ) -> tuple[Orbit, float] | None:
        """The first of the shortened steps with a smaller residual; None if there is none."""
        # Components that move little may be far off in units of their size; period and excitation
        # may not.
        sizes = np.abs(step / _units(shooting, orbit))[[shooting.time, -1]]
        part = min(1.0, ratio(0.3, sizes[0]), ratio(1.0, sizes[1]))
        for _ in range(_HALVINGS):
            with suppress(StickslipError):
                trial = self._tried(shooting, orbit.x + part * step)
                new = self._miss(trial, amplitude)
                if new <= (1.0 - 0.25 * part) * miss:
                    return trial, new
            part *= 0.5
        return None

    def slopes(self, shooting: Shooting, orbit: Orbit) -> Array:
        """Derivative of the amplitude with respect to the unknowns: at a turning point, the
        derivative with respect to time is zero."""
        _, _, at = _ends(orbit.motion, self.swinging.along(orbit.motion))
        gradient = np.zeros(len(orbit.x))
        n = len(self.swinging.state)
        p = parameter_values(orbit.problem)
        for sign, t in zip((-0.5, 0.5), at, strict=True):
            j = max(
                i for i, leg in enumerate(orbit.legs) if i == 0 or leg.motion.knots.time[0] <= t
            )
            leg, station = orbit.legs[j], shooting.stations[j]
            start = float(leg.motion.knots.time[0])
            place = leg.place
            later = place.by_time - station.piece.rates(start, place.state, p)
            columns = np.column_stack([place.directions, later, place.by_parameter])
            columns = np.vstack([columns, np.zeros(columns.shape[1])])
            columns[n, -1] = 1.0
            state = place.state
            if t > start:
                motion = follow_state(orbit.problem, start, t, state)
                state = motion.knots.state[-1]
                columns = variation(motion, shooting.pieces, columns).matrix
            slopes = self.swinging.gradient(state, orbit.problem.parameters)
            change = sign * (slopes @ columns[:n])
            own = slice(*shooting.first[j : j + 2])
            gradient[own] += change[:-2]
            gradient[shooting.time] += leg.begin * change[-2]
            gradient[-1] += change[-1]
        return gradient

    def _along(self, shooting: Shooting, orbit: Orbit) -> tuple[Array, float]:
        """Direction of the curve in units, and the derivative of the amplitude along it."""
        units = _units(shooting, orbit)
        if not np.all(np.isfinite(orbit.J)):
            raise ConvergenceError(
                f"a backbone of {self.system.name}",
                "the cycle is not differentiable",
                "Use more points, or other amplitudes",
            )
        # J has one row less than columns: its null vector is the tangent of the curve.
        tangent = np.linalg.svd(orbit.J * units)[2][-1]
        slope = float((self.slopes(shooting, orbit) * units) @ tangent)
        if slope == 0.0:
            raise ConvergenceError(
                f"a backbone of {self.system.name}",
                f"the amplitude of {self.swinging.name} does not change along it",
                "Choose another quantity",
            )
        return tangent, slope

    def follow(
        self,
        first: tuple[Shooting, Orbit],
        amplitudes: Array,
        found: Callable[[AtAmplitude], None],
    ) -> str:
        """Continue a cycle to successive amplitudes.

        Parameters
        ----------
        amplitudes : array
            In the order in which they are taken.
        found : callable
            Takes each of them.

        Returns
        -------
        str
            Why it has ended before the last; empty if it has not.
        """
        shooting, orbit = first
        for wanted in amplitudes.tolist():
            now = self.amplitude(orbit)
            aim = wanted
            while True:
                check_stop()
                try:
                    shooting, orbit = self._next(shooting, orbit, aim)
                except (StickslipError, ArithmeticError, np.linalg.LinAlgError) as failure:
                    aim = now * (aim / now) ** _SHRINK
                    if abs(np.log(aim / now)) < _LEAST:
                        return str(failure)
                    continue
                now = self.amplitude(orbit)
                if aim == wanted:
                    break
                aim = wanted
            found(AtAmplitude(self.cycle(shooting, orbit), wanted, now))
        return ""

    def _next(self, shooting: Shooting, orbit: Orbit, aim: float) -> tuple[Shooting, Orbit]:
        """The cycle of another amplitude: along the curve, or near the scaled motion."""
        try:
            x = self.predicted(shooting, orbit, aim)
            new = self.renewed(*self.solve(shooting, x, aim))
        except (StickslipError, ArithmeticError, np.linalg.LinAlgError):
            new = self.renewed(*self.solve(*self.scaled(orbit, aim), aim))
        # A large jump of the period means another branch, such as an internal resonance.
        change = abs(np.log(new[1].period / orbit.period))
        if change > _OTHER:
            raise ConvergenceError(
                f"a backbone of {self.system.name}",
                f"at the amplitude {aim:.6g} only a cycle of period {new[1].period:.6g} was found",
                "Use more points",
            )
        return self._certified(*new)

    def _certified(self, shooting: Shooting, orbit: Orbit) -> tuple[Shooting, Orbit]:
        """A cycle, if it is one."""
        certificate = self.cycle(shooting, orbit).certificate
        if not certificate.ok:
            raise ConvergenceError(
                f"a backbone of {self.system.name}",
                f"the cycle found is {certificate.verdict}",
                "Use more points, or other amplitudes",
            )
        return shooting, orbit

    def cycle(self, shooting: Shooting, orbit: Orbit) -> Cycle:
        """The solution as a cycle of equations with given parameters."""
        if self._latest is None or self._latest[0] is not orbit:
            fixed = shooting.with_pieces(self._given, orbit.problem)
            fixed.fixed = shooting.fixed
            self._latest = orbit, make_cycle(Closed(fixed, fixed.orbit(orbit.x[:-1])))
        return self._latest[1]


def _units(shooting: Shooting, orbit: Orbit) -> Array:
    """Units of the unknowns; of the excitation, the frequency."""
    return shooting.units(orbit.x, 2.0 * np.pi / orbit.period)


def _check(shooting: Shooting, orbit: Orbit) -> None:
    """Check that an orbit starts in the modes of its stations, and closes."""
    for station, leg in zip(shooting.stations, orbit.legs, strict=True):
        k = leg.motion.knots
        a = segments(leg.motion)[0][0]
        if shooting.pieces(k.mode[a], k.region[a]) is not station.piece:
            raise ConvergenceError(
                "a backbone", "the cycle starts in another mode", "Use smaller steps"
            )
    if shooting.miss(orbit) > NOT_CLOSED:
        raise ConvergenceError("a backbone", "the cycle ends in another mode", "Use smaller steps")


def _ends(motion: Trajectory, along: ValuesAndRates) -> tuple[float, float, tuple[float, float]]:
    """Smallest and largest value of an oscillating quantity, and their times."""
    k = motion.knots
    steps = np.flatnonzero(np.diff(k.time) > 0.0)
    share = np.linspace(0.0, 1.0, _SAMPLES)
    index = np.repeat(steps, _SAMPLES)
    times = (k.time[steps, None] + np.diff(k.time)[steps, None] * share).ravel()
    values, slopes = along(times - k.origin, index)
    (at,) = np.nonzero((np.sign(slopes[:-1]) * np.sign(slopes[1:]) < 0.0) & (np.diff(index) == 0))
    a, b, f, g = times[at], times[at + 1], slopes[at], slopes[at + 1]
    seen = [(times, values)]
    for _ in range(_REFINED if len(at) else 0):
        middle = (a * g - b * f) / (g - f)
        value, h = along(middle - k.origin, index[at])
        seen.append((middle, value))
        left = np.sign(h) == np.sign(
            f
        )  # the extremum is on the other side; the value at a retained end is halved (Illinois)
        a, f, g = np.where(left, middle, a), np.where(left, h, f / 2.0), np.where(left, g / 2.0, h)
        b = np.where(left, b, middle)
    times, values = (np.concatenate(part) for part in zip(*seen, strict=True))
    i, j = int(np.argmin(values)), int(np.argmax(values))
    return float(values[i]), float(values[j]), (float(times[i]), float(times[j]))
