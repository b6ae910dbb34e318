"""Derivatives of the measures of a cycle with respect to parameters.

An integral over a period, I = ∫ g dt, changes by ∫ (∇g·δy + g_p) dt, by g at the end times the
change of the period, and at an event that comes δt later by (g⁻ − g⁺) δt. Harmonics are such
integrals, whose frequency changes with the period, and the time in stick is the integral of a
constant. The dissipated energy is the supplied energy less the gain of energy, so impacts need no
separate term.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError, short, suggestion
from stickslip.kept import cached_property
from stickslip.model.quantities import contact_key
from stickslip.motion.between.formulas import Along
from stickslip.motion.modes.guards import resting, stands
from stickslip.numerics.levels import SAME_VALUE
from stickslip.orbits.cycles import measure, over_period
from stickslip.orbits.cycles.drive_phase import drive_slope, read_drive
from stickslip.orbits.fields.variational import Variation, variation
from stickslip.orbits.return_map.slopes import CycleSlope, cycle_slope
from stickslip.orbits.sensitivities.extremes import Traced, slopes_of_extremes, until
from stickslip.orbits.sensitivities.motion import with_knots
from stickslip.orbits.sensitivities.quantities import (
    SUPPLY_RATE,
    Observation,
    gradient,
    read_observations,
)
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    from stickslip.orbits.cycles.cycle import Cycle

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_HALVINGS = 14
_EXACT = 1e-12  # a change by less, relative to the integral of the modulus, is rounding
_ROUNDING = 1e-9  # the same if it may be a rounding error of the variation
_SHARE = 1e-3  # smallest error allowed in a panel, as a fraction of that in a period
_KNOWN = 1e-8  # required error of an integral relative to its terms


def measure_slopes(cycle: Cycle, names: Sequence[str], of: Sequence[str]) -> dict[str, Array]:
    """Derivatives of measures of a cycle, by measure, each of shape (names,).

    Parameters
    ----------
    names : sequence of str
        Parameters.
    of : sequence of str
        Measures, by the names that they have in maps: ``period``, ``speed``, ``shift:x``,
        ``state:x``, ``low:f``, ``high:f``, ``amplitude:f``, ``mean:f``, ``rms:f``, ``crest:f``,
        ``harmonic:f``, ``phase:f``, ``relative_phase:f``, ``stick_fraction``,
        ``energy_per_cycle``, ``energy_per_distance`` and ``cost_of_transport:w``.

    Raises
    ------
    DeclarationError
        If there is no such measure, or it has no derivative.
    """
    for text in of:
        if text.partition(":")[0] not in _RULES:
            reason = "unknown measure, or a measure without derivative"
            name = short(text.partition(":")[0])
            raise DeclarationError(f"of: {short(text)}", reason, suggestion(name, _RULES))
    found = {text: np.empty(len(names)) for text in of}
    for i, name in enumerate(names):
        changing = _Changing(cycle, name, cycle_slope(cycle.closed, name))
        for text in of:
            rule, _, quantity = text.partition(":")
            found[text][i] = _RULES[rule](changing, quantity.strip()).slope
    return found


class _Value(NamedTuple):
    """A number, and its derivative by a parameter."""

    value: float
    slope: float

    def __sub__(self, other: _Value) -> _Value:
        return _Value(self.value - other.value, self.slope - other.slope)

    def __truediv__(self, other: _Value) -> _Value:
        found = self.value / other.value
        return _Value(found, (self.slope - found * other.slope) / other.value)


class _Changing:
    """A cycle, and its derivative with respect to one parameter.

    Parameters
    ----------
    name : str
        The parameter.
    """

    def __init__(self, cycle: Cycle, name: str, slope: CycleSlope) -> None:
        self.cycle = cycle
        self.name = name
        self.slope = slope
        self.motion = slope.orbit.motion
        self.pieces = slope.pieces
        self.equations = self.motion.problem.compiled.equations
        self.direction = np.append(slope.state, 1.0)[:, None]
        self.p = np.array([self.motion.parameters[x] for x in cycle.system.parameters])

    @property
    def period(self) -> _Value:
        """The period."""
        return _Value(self.cycle.period, self.slope.period)

    @cached_property
    def varied(self) -> Variation:
        """The first variation along the cycle."""
        return variation(self.motion, self.pieces, self.direction)

    def observed(self, text: str) -> Observation:
        """A quantity, or a formula of quantities; without a name the first of the state."""
        return read_observations(self.motion, (text or self.cycle.system.declaration.state[0],))[0]

    def looked_at(
        self, observed: Observation, clock: float, step: int
    ) -> tuple[float, Array, float]:
        """A quantity at a time since the origin, in a step: its value, its derivatives by (state,
        parameter), and its rate."""
        k = self.motion.knots
        y = self.motion.dense_output.states(np.array([clock]), np.array([step]))[0]
        t = clock + k.origin
        piece = self.pieces(k.mode[step], k.region[step])
        where = np.array([t]), np.ascontiguousarray(y[:, None])
        made = gradient(self.equations, piece, (observed,), where, self.p)
        slopes = made.slopes[0, 0]
        rate = slopes[: len(y)] @ piece.rates(t, y, self.p) + made.time[0, 0]
        return float(made.values[0, 0]), slopes, float(rate)

    def ends(self, observed: Observation) -> tuple[_Value, _Value]:
        """A quantity at the start and at the end of the period."""
        k = self.motion.knots
        steps = np.flatnonzero(np.diff(k.clock) > 0.0)
        value, slopes, _ = self.looked_at(observed, float(k.clock[0]), int(steps[0]))
        first = _Value(value, float(slopes @ self.direction[:, 0]))
        value, slopes, rate = self.looked_at(observed, float(k.clock[-1]), int(steps[-1]))
        moved = slopes @ self.varied.matrix[:, 0] + rate * self.slope.period
        return first, _Value(value, float(moved))

    def integral(self, observed: Observation) -> _Value:
        """∫ g dt over the period, by Gauss quadrature whose panels are halved until the result
        converges.

        Raises
        ------
        ConvergenceError
            If it does not converge.
        """
        k = self.motion.knots
        steps = np.flatnonzero(np.diff(k.clock) > 0.0)
        begin, width = k.time[steps], np.diff(k.time)[steps]
        period = float(np.sum(width))
        rough, sizes = self._summed(observed, begin, width)
        total = np.sum(sizes, axis=1, keepdims=True)
        found, unknown = np.zeros(2), np.zeros(2)
        before = np.full(rough.shape, np.inf)
        for halving in range(_HALVINGS):
            middle, half = begin + 0.5 * width, 0.5 * width
            halves, _ = self._summed(observed, np.append(begin, middle), np.tile(half, 2))
            fine = halves[:, : len(begin)] + halves[:, len(begin) :]
            change = np.abs(fine - rough)
            # A change that is small, and not smaller than in the panel that was halved, is a
            # rounding error.
            share = total * np.maximum(width / period, _SHARE)
            rounding = (change <= _ROUNDING * share) & (change > 0.25 * before)
            left = np.any((change > _EXACT * share) & ~rounding, axis=0)
            left &= halving < _HALVINGS - 1
            found += np.sum(fine[:, ~left], axis=1)
            unknown += np.sum(change[:, ~left], axis=1)
            if not np.any(left):
                break
            rough, before = halves[:, np.tile(left, 2)], np.tile(change[:, left], 2)
            begin, width = np.append(begin[left], middle[left]), np.tile(half[left], 2)
        if np.any(unknown > _KNOWN * total[:, 0]):
            raise ConvergenceError(
                f"the derivative of the integral of {short(observed.name)}",
                f"its relative accuracy is only {np.max(unknown / total[:, 0]):.1g}",
            )
        moved = 0.0
        for left, right, delay in self._delays():
            clock = float(k.clock[right])
            before_it, _, _ = self.looked_at(observed, clock, left)
            after_it, _, _ = self.looked_at(observed, clock, right)
            moved += (before_it - after_it) * delay
        at_end, _, _ = self.looked_at(observed, float(k.clock[-1]), int(steps[-1]))
        return _Value(float(found[0]), float(found[1]) + moved + at_end * self.slope.period)

    def _delays(self) -> Iterator[tuple[int, int, float]]:
        """The steps before and after each event, and the derivative of its time."""
        late = self.varied.late[:, 0]
        for left, right in pairwise(np.flatnonzero(np.diff(self.motion.knots.clock) > 0.0)):
            delays = late[left + 1 : right + 1]
            delays = delays[np.isfinite(delays)]
            if len(delays):
                yield int(left), int(right), float(delays[-1])

    def time_in(self, counts: Callable[[Array], bool]) -> _Value:
        """Time in given modes."""
        k = self.motion.knots
        width = np.diff(k.clock)
        modes, place = np.unique(k.mode, axis=0, return_inverse=True)
        inside = np.array([counts(mode) for mode in modes])[place.ravel()].astype(float)
        slope = sum((inside[a] - inside[b]) * delay for a, b, delay in self._delays())
        last = np.flatnonzero(width > 0.0)[-1]
        return _Value(float(inside[:-1] @ width), float(slope + inside[last] * self.slope.period))

    def first_harmonic(self, text: str) -> tuple[complex, complex, float]:
        """The coefficient c of Re(c exp(iω(t − t₀))), where t₀ is the time at which the period
        begins, its derivative, and that of ω.

        As in :mod:`stickslip.orbits.cycles.over_period`, a drift is removed.
        """
        observed = self.observed(text)
        setting = self.cycle.closed.shooting.setting
        order = setting.turns if setting.symmetry.driven else 1
        period = self.period
        omega = 2.0 * np.pi * order / period.value
        turning = -omega * period.slope / period.value
        # ω as a formula of the parameter, so that the integrand is differentiated once.
        moved = ex.sym(self.name) - self.motion.parameters[self.name]
        angle = (omega + turning * moved) * (ex.sym("t") - float(self.motion.knots.time[0]))
        shares = [
            self.integral(Observation(text, observed.formula * ex.call(wave, angle))) / period
            for wave in ("cos", "sin")
        ]
        first, last = self.ends(observed)
        drift = last - first
        found, slope = (
            2.0 * complex(shares[0][i], -shares[1][i]) - 1j * drift[i] / (np.pi * order)
            for i in (0, 1)
        )
        if not abs(found) > SAME_VALUE * (self._size(observed) or 1.0):
            raise DeclarationError(
                f"of: {short(text)}",
                "it has no first harmonic, so amplitude and phase have no derivative",
                "Choose another quantity",
            )
        return found, slope, turning

    def _size(self, observed: Observation) -> float:
        """Largest absolute value of a quantity."""
        ends = over_period.extrema(self.motion, {observed.name: observed.formula})
        return max(map(abs, ends[observed.name]))

    def largest(self, text: str) -> _Value:
        """Largest absolute value of a quantity."""
        observed = self.observed(text)
        (ends,) = over_period.extrema(self.motion, {text: observed.formula}).values()
        low, high = self.extremes(text)
        sides = _Value(-ends[0], -low.slope), _Value(ends[1], high.slope)
        small, large = sorted(sides)
        alike = large.value - small.value <= SAME_VALUE * large.value
        if alike and abs(large.slope - small.slope) > _KNOWN * abs(large.slope):
            raise DeclarationError(
                f"of: {short(text)}",
                "its smallest and largest values have equal moduli, but different derivatives",
                "Use low or high",
            )
        return large

    def _summed(self, observed: Observation, begin: Array, width: Array) -> tuple[Array, Array]:
        """Integrals of a quantity and of its derivative at fixed times, and of their moduli, over
        panels; each of shape (2, panels)."""
        times = (begin[:, None] + 0.5 * width[:, None] * (1.0 + _NODES)).ravel()
        fine, place = with_knots(self.motion, times)
        change = variation(fine, self.pieces, self.direction)
        k = fine.knots
        looked = np.empty((2, len(times)))
        for number in np.unique(change.piece[place]):
            here = np.flatnonzero(change.piece[place] == number)
            knots = place[here]
            at = k.time[knots], np.ascontiguousarray(k.state[knots].T)
            made = gradient(self.equations, change.made[number], (observed,), at, self.p)
            looked[0, here] = made.values[0]
            looked[1, here] = np.sum(made.slopes[:, 0] * change.after[knots, :, 0], axis=1)
        looked = looked.reshape(2, len(begin), len(_NODES))
        return looked @ _WEIGHTS * (0.5 * width), np.abs(looked) @ _WEIGHTS * (0.5 * width)

    @cached_property
    def dissipated(self) -> _Value:
        """Energy dissipated in the period: the supplied energy minus the gain of energy."""
        supplied = self.integral(Observation(SUPPLY_RATE, ex.sym(SUPPLY_RATE)))
        first, last = self.ends(self.observed("energy"))
        found = supplied - (last - first)
        for gain in self._gains():
            found = _Value(found.value + gain.value, found.slope + gain.slope)
        return found

    def _gains(self) -> Iterator[_Value]:
        """Energy that the declared jumps of the state supply, each that gains."""
        k = self.motion.knots
        energy = self.observed("energy")
        leaps = np.flatnonzero(np.any(self.motion.switches.jumped, axis=1))
        for knot in (leaps + 1).tolist():
            clock = float(k.clock[knot])
            late = float(np.nan_to_num(self.varied.late[knot, 0]))
            arrived = variation(until(self.motion, knot), self.pieces, self.direction).matrix[:, 0]
            sides: list[_Value] = []
            for step, moved in ((knot - 1, arrived), (knot, self.varied.after[knot, :, 0])):
                value, slopes, rate = self.looked_at(energy, clock, step)
                sides.append(_Value(value, float(slopes @ moved + rate * late)))
            gain = sides[1] - sides[0]
            if gain.value > 0.0:
                yield gain

    def extremes(self, text: str) -> tuple[_Value, _Value]:
        """Least and largest value of a quantity."""
        observed = self.observed(text)
        along = Along(self.motion, [observed.formula])
        origin = self.motion.knots.origin
        followed = Traced(
            lambda clock, index: along(clock + origin, index)[:, 0],
            lambda clock, step: self.looked_at(observed, clock, step)[2],
            lambda clock, step: self.looked_at(observed, clock, step)[1],
        )
        change = self.slope.state, self.slope.period
        ((low, high),) = slopes_of_extremes(self.motion, self.pieces, change, [followed])
        return _Value(np.nan, float(low)), _Value(np.nan, float(high))

    def distance(self, text: str) -> _Value:
        """Distance along a component of the state, or along the translation."""
        state = self.cycle.system.declaration.state
        if text and text not in state:
            raise DeclarationError(
                f"of: {short(text)}", "not a component of the state", suggestion(text, state)
            )
        along = {text: 1.0} if text else self.cycle.direction
        if not along:
            raise DeclarationError(
                "of", f"{self.cycle.system.name} does not drift", "Name a component, like speed:x"
            )
        e = np.array([along.get(name, 0.0) for name in state])
        shift = self.cycle.closed.orbit.shift
        return _Value(float(e @ shift / (e @ e)), float(e @ self.slope.shift / (e @ e)))


def _speed(c: _Changing, of: str) -> _Value:
    return c.distance(of) / c.period


def _shift(c: _Changing, of: str) -> _Value:
    first, last = c.ends(c.observed(of))
    return last - first


def _amplitude(c: _Changing, of: str) -> _Value:
    low, high = c.extremes(of)
    return _Value(np.nan, 0.5 * (high.slope - low.slope))


def _mean(c: _Changing, of: str) -> _Value:
    return c.integral(c.observed(of)) / c.period


def _root_mean_square(c: _Changing, of: str) -> _Value:
    observed = c.observed(of)
    square = c.integral(Observation(observed.name, observed.formula**2)) / c.period
    if not square.value > 0.0:
        raise DeclarationError(
            f"of: {short(observed.name)}",
            "it is zero throughout, where its root mean square has no derivative",
            "Choose another quantity",
        )
    root = math.sqrt(square.value)
    return _Value(root, 0.5 * square.slope / root)


def _crest(c: _Changing, of: str) -> _Value:
    size = _root_mean_square(c, of)
    return c.largest(of) / size


def _harmonic(c: _Changing, of: str) -> _Value:
    found, slope, _ = c.first_harmonic(of)
    return _Value(abs(found), (slope * found.conjugate()).real / abs(found))


def _phase(c: _Changing, of: str) -> _Value:
    """Derivative of the phase in cos(ωt + phase)."""
    if not c.cycle.closed.shooting.setting.symmetry.driven:
        raise DeclarationError(
            f"of: phase:{short(of)}",
            f"{c.cycle.system.name} has no drive, so the phase of a cycle is arbitrary",
            "Use harmonic",
        )
    start = float(c.motion.knots.time[0])
    found, slope, turning = c.first_harmonic(of)
    return _Value(cmath.phase(found), (slope / found).imag - turning * start)


def _relative_phase(c: _Changing, of: str) -> _Value:
    own = _phase(c, of)
    system, values = c.cycle.system, c.motion.parameters
    name = of or system.declaration.state[0]
    turn = c.period.value / c.cycle.closed.shooting.setting.turns
    stretched = c.period.slope / c.period.value
    drive = drive_slope(system, read_drive(system, name), values, turn, (c.name, stretched))
    return _Value(np.nan, own.slope - drive)


def _stick_fraction(c: _Changing, of: str) -> _Value:
    """Derivative of the fraction of time in which all contacts stick, or one contact."""
    problem, system = c.motion.problem, c.cycle.system
    if of and of not in system.frictional:
        raise DeclarationError(
            f"of: stick_fraction:{short(of)}", "unknown contact", suggestion(of, system.frictional)
        )
    if not of:
        return c.time_in(lambda mode: stands(problem.rows, mode)) / c.period
    number = c.equations.numbers[system.frictional[of][0]]
    return c.time_in(lambda mode: resting(int(mode[number]))) / c.period


def _energy(c: _Changing, of: str) -> _Value:
    """Dissipated energy, in total or by the friction of a contact."""
    if not of:
        return c.dissipated
    system = c.cycle.system
    if of not in system.frictional:
        raise DeclarationError(
            f"of: energy_per_cycle:{short(of)}",
            "unknown contact",
            suggestion(of, system.frictional),
        )
    keys = map(contact_key, system.frictional[of])
    power = " + ".join(f"friction_{key}*slip_speed_{key}" for key in keys)
    return c.integral(c.observed(f"-({power})"))


def _energy_per_distance(c: _Changing, of: str) -> _Value:
    way = c.distance(of)
    return c.dissipated / (way if way.value > 0.0 else _Value(-way.value, -way.slope))


def _cost_of_transport(c: _Changing, of: str) -> _Value:
    values = c.motion.parameters
    system = c.cycle.system
    weight = measure.weight(system, of, values)
    slope = ex.evaluate(ex.derivative(measure.read_weight(system, of), c.name), values)
    return _energy_per_distance(c, "") / _Value(weight, slope)


_RULES: dict[str, Callable[[_Changing, str], _Value]] = {
    "period": lambda c, of: c.period,
    "speed": _speed,
    "shift": _shift,
    "state": lambda c, of: c.ends(c.observed(of))[0],
    "low": lambda c, of: c.extremes(of)[0],
    "high": lambda c, of: c.extremes(of)[1],
    "amplitude": _amplitude,
    "mean": _mean,
    "rms": _root_mean_square,
    "crest": _crest,
    "harmonic": _harmonic,
    "phase": _phase,
    "relative_phase": _relative_phase,
    "stick_fraction": _stick_fraction,
    "energy_per_cycle": _energy,
    "energy_per_distance": _energy_per_distance,
    "cost_of_transport": _cost_of_transport,
}
