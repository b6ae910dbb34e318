"""The common period of the drives of a system, and the shift of the state in this period.

A drive is a phase that advances with time. Time may also translate the state, as a pull Vt does: in
the co-moving frame (:mod:`stickslip.orbits.fields.lines_and_phases`), the phases of spatially
periodic terms are drives as well, and the shift is the displacement of this frame in a period.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import MotionEquations
from stickslip.errors import DeclarationError, short
from stickslip.kept import cached_property, made_once
from stickslip.model.system import System
from stickslip.numerics.levels import NO_CHANGE, SAME_VALUE
from stickslip.orbits.fields.lines_and_phases import Reading, read_formulas
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.functions import FUNCTIONS
from stickslip.symbolic.pieces import periodic_form

_STANDS = 1e-12  # phases that advance by less, relative to their terms, do not advance
_MOST_FRAMES = 64  # largest number of frames and ratios of frequencies that are kept
_MOST_PERIODS = 24  # largest number of periods of a drive in the longest common period


class Drives(NamedTuple):
    """The drives of a system, for given parameters.

    Attributes
    ----------
    period : float
        Common to all drives.
    parts : int
        How many times the system repeats in it.
    velocity : array, shape (n,)
        Velocity with which the state is translated.
    """

    period: float
    parts: int
    velocity: Array


@dataclass(frozen=True)
class MovingFrame:
    """A system in the frame in which time occurs only in phases.

    Attributes
    ----------
    zero : frozenset of str
        Parameters that are zero.
    """

    equations: MotionEquations
    zero: frozenset[str]

    @cached_property
    def states(self) -> list[str]:
        """Components of the state that may be shifted: all except rates of inertial coordinates."""
        d = self.equations.declaration
        return [x for x in d.state if x not in {f"d_{q}" for q in d.inertial}]

    @cached_property
    def reading(self) -> Reading:
        """The occurrences of time and state in the formulas."""
        known = self.equations.declaration.parameters
        return read_formulas(self.formulas, ["t", *self.states], constant=known)

    @cached_property
    def formulas(self) -> list[Expr]:
        """All formulas on which the motion depends, in their periodic form."""
        numbers = dict.fromkeys(self.zero, ex.ZERO)
        try:
            found = [ex.substitute(e, numbers) for e in self.equations.formulas]
        except (ZeroDivisionError, OverflowError):
            found = self.equations.formulas
        return [periodic_form(e) for e in found]

    def velocity(self, values: Mapping[str, float]) -> Array | None:
        """Velocity of the frame; None if there is none."""
        try:
            return self.reading.velocity(self.states, values)
        except (ZeroDivisionError, OverflowError):
            return None

    def full(self, values: Mapping[str, float]) -> Array:
        """Velocity of the frame for all components of the state, shape (n,); 0 if there is none."""
        found = self.velocity(values)
        moved = {} if found is None else dict(zip(self.states, found, strict=True))
        names = self.equations.declaration.state
        return np.array([float(moved.get(name, 0.0)) for name in names])

    def in_moving_frame(self, formulas: list[Expr], velocity: Array) -> list[Expr]:
        """Formulas in the frame, with a name for each nonzero velocity."""
        moved = {
            x: ex.sym(x) + ex.sym(_name(x)) * ex.sym("t")
            for x, v in zip(self.states, velocity, strict=True)
            if v != 0.0
        }
        return [ex.substitute(e, moved) for e in formulas] if moved else formulas

    def named(self, velocity: Array) -> dict[str, float]:
        """The velocities by these names."""
        return {_name(x): float(v) for x, v in zip(self.states, velocity, strict=True)}


def _name(state: str) -> str:
    return f"velocity:{state}"


def moving_frame(equations: MotionEquations, zero: frozenset[str]) -> MovingFrame:
    """The frame of a system with some parameters that are zero; its properties are cached."""
    return made_once(equations, "moving frame", lambda: MovingFrame(equations, zero), zero)


def cells_of(equations: MotionEquations, values: Mapping[str, float]) -> Array:
    """Least shifts of the state alone that leave a system unchanged, shape (n, cells)."""
    frame = moving_frame(equations, frozenset(name for name in values if values[name] == 0.0))
    names = equations.declaration.state
    try:
        found = frame.reading.cells(frame.states, values)
    except (ZeroDivisionError, OverflowError):
        found = np.zeros((len(frame.states), 0))
    cells = np.zeros((len(names), found.shape[1]))
    cells[[names.index(x) for x in frame.states]] = found
    return cells


@dataclass(frozen=True)
class Clock:
    """The common period of the drives of a system, 2πm/ω, and the fraction of it that is the period
    of the system.

    Attributes
    ----------
    frame : MovingFrame
        In which they are drives.
    frequency : Expr
        ω, of the first drive.
    multiple : int
        m: the number of periods of the first drive after which all drives repeat.
    parts : int
        The system repeats after the common period divided by this number.
    alone : bool
        Whether there is no other drive, so that ω may take any value.
    """

    frame: MovingFrame
    frequency: Expr
    multiple: int
    parts: int
    alone: bool

    @property
    def zero(self) -> frozenset[str]:
        """Parameters that have to remain zero, such as the amplitude of another drive."""
        return self.frame.zero

    def velocity(self, values: Mapping[str, float]) -> Array:
        """Velocity with which the state is translated."""
        found = self.frame.velocity(values)
        return np.zeros(len(self.frame.states)) if found is None else found

    def rate(self, values: Mapping[str, float]) -> float:
        """ω for given parameters."""
        return ex.evaluate(self.frequency, {**values, **self.frame.named(self.velocity(values))})

    def period(self, values: Mapping[str, float]) -> float:
        """The period for given parameters.

        Raises
        ------
        DeclarationError
            If a drive acts that was absent when the clock was made, or the drives are constant.
        """
        for name in sorted(self.zero):
            if values[name] != 0.0:
                raise DeclarationError(
                    name,
                    "where it is not 0, the drives have a different period",
                    "Choose a cycle at such a value as the start",
                )
        rate = self.rate(values)
        if rate == 0.0:
            raise DeclarationError(
                "drives",
                "the drives are constant",
                "Choose parameters for which they vary",
            )
        return 2.0 * math.pi * self.multiple / self.parts / abs(rate)

    def drives(self, values: Mapping[str, float]) -> Drives:
        """The common period of the drives, the number of periods of the system in it, and the shift
        of the state."""
        return Drives(self.parts * self.period(values), self.parts, self.frame.full(values))

    def slope(self, values: Mapping[str, float], parameter: str) -> float:
        """Derivative of the period with respect to a parameter."""
        frame = self.frame
        every = {**values, **frame.named(self.velocity(values))}
        change = ex.evaluate(ex.derivative(self.frequency, parameter), every)
        # The velocity of the frame changes as well.
        names = [_name(x) for x in frame.states if _name(x) in self.frequency.symbols]
        if names:
            bent = frame.named(frame.reading.acceleration(frame.states, values, parameter))
            change += sum(
                ex.evaluate(ex.derivative(self.frequency, name), every) * bent[name]
                for name in names
            )
        return -self.period(values) * change / ex.evaluate(self.frequency, every)


def clock(system: System, equations: MotionEquations, values: Mapping[str, float]) -> Clock:
    """The common period of the drives of a system.

    Raises
    ------
    DeclarationError
        If there is no drive of a constant frequency, or their frequencies have no common period.
    """
    zero = frozenset(name for name in system.parameters if values[name] == 0.0)
    found = _clock(system, equations, values, zero)
    for name in sorted(zero):
        # Only parameters on which the clock depends have to stay zero.
        try:
            other = _clock(system, equations, values, found.zero - {name})
        except DeclarationError:
            continue
        if other.period(values) <= found.period(values) * (1.0 + NO_CHANGE):
            found = other
    return found


def _clock(
    system: System, equations: MotionEquations, values: Mapping[str, float], zero: frozenset[str]
) -> Clock:
    """Their common period while some parameters are zero."""
    frame = moving_frame(equations, zero)
    found = frame.velocity(values)
    velocity = np.zeros(len(frame.states)) if found is None else found
    every = {**values, **frame.named(velocity)}
    moving = _moving(frame, velocity, every)
    if not moving:
        raise DeclarationError(
            system.name,
            f"it depends on time, but {_without_wave(frame, found)}, so its period is undefined",
            "Cycles need a periodic drive, such as sin(omega*t), or a pull V*t over a spatially "
            "periodic potential",
        )
    first, base = next(iter(moving.items()))
    ratios = {}
    for e, rate in moving.items():
        ratios[e] = Fraction(rate / base).limit_denominator(_MOST_PERIODS)
        if abs(float(ratios[e]) - rate / base) > SAME_VALUE * abs(rate / base):
            raise DeclarationError(
                system.name,
                f"its drives have the angular frequencies {abs(base):.9g} and {abs(rate):.9g}, "
                "which have no common period",
                "Choose frequencies whose ratio is a fraction of small integers",
            )
    multiple = math.lcm(*(ratio.denominator for ratio in ratios.values()))
    quarters = {e: int(4 * r * multiple) for e, r in ratios.items()}
    parts = _parts(frame, velocity, quarters)
    return Clock(frame, first, multiple, parts, len(moving) == 1)


def _moving(frame: MovingFrame, velocity: Array, every: Mapping[str, float]) -> dict[Expr, float]:
    """Frequencies of the waves in the frame, with their values; only those that affect the motion,
    if some do."""
    known = every.keys()
    rates: dict[Expr, float] = {}
    listed, felt = _waves(frame, velocity)
    for e in listed:
        if e.symbols <= known and e not in rates and -e not in rates:
            rate = ex.evaluate(e, every)
            terms = [part * weight for part, weight in _terms(e, every)]
            rates[e] = rate if abs(rate) > _STANDS * math.fsum(map(abs, terms)) else 0.0
    acts = dict.fromkeys(rates, True)
    if felt is not None:
        numbers = dict.fromkeys(frame.zero, ex.ZERO)
        with suppress(ZeroDivisionError, OverflowError):
            acts = {
                e: rate in felt or -rate in felt
                for e in rates
                for rate in [ex.substitute(e, numbers)]
            }
    none = not any(acts.values())
    return {e: rate for e, rate in rates.items() if rate != 0.0 and (acts[e] or none)}


def _waves(frame: MovingFrame, velocity: Array) -> tuple[list[Expr], frozenset[Expr] | None]:
    """Frequencies of the waves in the frame, and of those that are left where some parameters are
    zero; None if a formula is not defined there."""

    def make() -> tuple[list[Expr], frozenset[Expr] | None]:
        numbers = dict.fromkeys(frame.zero, ex.ZERO)
        plain = frame.in_moving_frame(frame.equations.formulas, velocity)
        still = plain is frame.equations.formulas
        listed = frame.equations.frequencies if still else _frequencies(plain)
        try:
            felt = frozenset(_frequencies([ex.substitute(e, numbers) for e in plain]))
        except (ZeroDivisionError, OverflowError):
            felt = None
        return listed, felt

    key = frame.zero, (velocity != 0.0).tobytes()
    return made_once(frame.equations, "waves", make, key, _MOST_FRAMES)


def _frequencies(formulas: list[Expr]) -> list[Expr]:
    found = dict.fromkeys(ex.frequency(node) for node in ex.walk(formulas))
    return [e for e in found if e is not None]


def _terms(e: Expr, values: Mapping[str, float]) -> list[tuple[float, float]]:
    parts = e.terms if e.op == "sum" else ((e, 1.0),)
    return [(ex.evaluate(term, values), weight) for term, weight in parts]


def _without_wave(frame: MovingFrame, velocity: Array | None) -> str:
    """The reason why the period is undefined."""
    if velocity is None:
        return (
            "not through a wave of constant frequency, and no uniform translation of the state "
            f"compensates for time in {short(ex.to_text(frame.reading.timed()))}"
        )
    if np.any(velocity):
        return (
            "not through a wave of constant frequency, and nothing is periodic along the "
            "translation"
        )
    return "not through a wave of constant frequency"


def _parts(frame: MovingFrame, velocity: Array, quarters: Mapping[Expr, int]) -> int:
    """Number of periods of a system in one period of its drives, tested by advancing the drives by
    multiples of a quarter period; found once for each ratio of frequencies.

    The square of a sine repeats after half of its period, sin⁴ + cos⁴ after a quarter.
    """

    def make() -> int:
        formulas = frame.in_moving_frame(frame.formulas, velocity)
        formulas = [periodic_form(e) for e in formulas]
        for parts in (4, 2):
            turns = {e: quarter // parts for e, quarter in quarters.items()}
            if all(periodic_form(_turned(e, turns)) is e for e in formulas):
                return parts
        return 1

    key = frame.zero, (velocity != 0.0).tobytes(), frozenset(quarters.items())
    return made_once(frame.equations, "parts of periods", make, key, _MOST_FRAMES)


def _turned(formula: Expr, turns: Mapping[Expr, int]) -> Expr:
    """A formula whose waves have been advanced by quarters of their periods, given by frequency."""

    def turn(e: Expr) -> Expr | None:
        if "t" not in e.symbols:
            return e
        if len(e.args) != 1:
            return None
        (argument,) = e.args
        rate = ex.frequency(e) or ex.ZERO
        if rate in turns or -rate in turns:
            return ex.turned(e, turns[rate] if rate in turns else -turns[-rate])
        inside = _turned(argument, turns)
        parity = FUNCTIONS[e.op].parity
        if inside is -argument and parity:
            return e if parity == "even" else -e
        return ex.call(e.op, inside)

    return ex.rewrite(formula, turn)
