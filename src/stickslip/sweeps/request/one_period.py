"""Measures that require the motion of a period: harmonics, energy per distance, and all measures of
outputs and formulas."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from stickslip.equations.derive import derive
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.model.system import System
from stickslip.motion.between.formulas import Along, read_formula
from stickslip.orbits.cycles import over_period
from stickslip.orbits.cycles.drive_phase import phase_of_drive, read_drive, relative_phase
from stickslip.orbits.cycles.measure import weight
from stickslip.orbits.fields.clock import clock

if TYPE_CHECKING:
    from stickslip.motion.trajectory import Trajectory
    from stickslip.symbolic.expressions import Expr

_NONE = 1e-8  # a shift below this fraction of the range of the motion counts as zero
_WHOLE = 1e-6  # relative distance from an integer number of periods


PeriodRule = Callable[["Trajectory", str], float]


def harmonic(motion: Trajectory, of: str) -> float:
    """Amplitude of the first harmonic of a quantity."""
    return abs(_first(motion, of))


def phase(motion: Trajectory, of: str) -> float:
    """Phase of the first harmonic, as in cos(ωt + phase)."""
    found = _first(motion, of)
    return float(np.angle(found)) if found else np.nan


def phase_to_drive(motion: Trajectory, of: str) -> float:
    """Phase relative to the drive, in (−3π/2, π/2]."""
    system, values = motion.system, motion.parameters
    turn = _turn(motion)
    own, found = phase(motion, of), np.nan
    with suppress(DeclarationError):
        drive = read_drive(system, of or system.declaration.state[0])
        found = float(relative_phase(own, phase_of_drive(system, drive, values, turn)))
    return found


def mean_value(motion: Trajectory, of: str) -> float:
    """Its mean."""
    return over_period.mean(motion, of or motion.system.declaration.state[0])[0]


def root_mean_square(motion: Trajectory, of: str) -> float:
    """The square root of the mean of its square."""
    name = of or motion.system.declaration.state[0]
    return math.sqrt(over_period.mean(motion, f"({name})**2")[0])


def crest(motion: Trajectory, of: str) -> float:
    """Largest absolute value divided by the root mean square; NaN if zero throughout."""
    name = of or motion.system.declaration.state[0]
    size = root_mean_square(motion, name)
    return max(map(abs, _ends(motion, name))) / size if size else np.nan


def low(motion: Trajectory, of: str) -> float:
    """The smallest value of a formula."""
    return _ends(motion, of)[0]


def high(motion: Trajectory, of: str) -> float:
    """The largest value."""
    return _ends(motion, of)[1]


def amplitude(motion: Trajectory, of: str) -> float:
    """Half its range."""
    least, largest = _ends(motion, of)
    return 0.5 * (largest - least)


def state(motion: Trajectory, of: str) -> float:
    """Value at the start of the motion."""
    return _at_ends(motion, of)[0]


def shift(motion: Trajectory, of: str) -> float:
    """Change from the start to the end of the motion."""
    first, last = _at_ends(motion, of)
    return last - first


def speed(motion: Trajectory, of: str) -> float:
    """The same by time."""
    return shift(motion, of) / float(np.diff(motion.t_span)[0])


def _ends(motion: Trajectory, of: str) -> tuple[float, float]:
    formula = read_formula(motion.system, of, "measure")
    return over_period.extrema(motion, {of: formula})[of]


def _at_ends(motion: Trajectory, of: str) -> tuple[float, float]:
    k = motion.knots
    steps = np.flatnonzero(np.diff(k.time) > 0.0)
    along = Along(motion, [read_formula(motion.system, of, "measure")])
    first, last = along(k.time[[0, -1]], steps[[0, -1]])[:, 0].tolist()
    return first, last


def energy_per_distance(motion: Trajectory, of: str) -> float:
    """Dissipated energy over the distance, along a coordinate or along the translation."""
    names = list(motion.system.declaration.state)
    state = motion.knots.state
    along = {of: 1.0} if of else motion.system.plain.translation
    e = np.array([float(along.get(name, 0.0)) for name in names])
    places = (state - state[0]) @ e / (e @ e)
    if not abs(places[-1]) > _NONE * np.ptp(places):
        return np.nan
    return float(motion.audit.dissipated[-1] / abs(places[-1]))


def cost_of_transport(motion: Trajectory, of: str) -> float:
    """Energy per distance along the translation, divided by the weight; NaN without weight."""
    with suppress(DeclarationError):
        return energy_per_distance(motion, "") / weight(motion.system, of, motion.parameters)
    return np.nan


RULES: Mapping[str, PeriodRule] = {
    "amplitude": amplitude,
    "speed": speed,
    "low": low,
    "high": high,
    "shift": shift,
    "state": state,
    "mean": mean_value,
    "rms": root_mean_square,
    "crest": crest,
    "harmonic": harmonic,
    "phase": phase,
    "relative_phase": phase_to_drive,
    "energy_per_distance": energy_per_distance,
    "cost_of_transport": cost_of_transport,
}
"""How measures are computed from the motion of a period, by name."""


def check_variable(of: str, where: str, remedy: str) -> None:
    """Reject text that cannot be a part of the name of a variable."""
    if "/" in of:
        reason = f"'{short(of)}' contains a /, which is not allowed in the name of a variable"
        raise DeclarationError(where, reason, remedy)


def check_period_measure(system: System, name: str, of: str) -> None:
    """Reject a measure that no point of a map could have.

    Raises
    ------
    DeclarationError
    """
    where = f"measure.{name}"
    if name == "cost_of_transport":
        if not of:
            raise DeclarationError(
                where, "the weight is missing", "Add it, like cost_of_transport:m*g"
            )
        check_variable(of, where, "Write 'cost = energy_per_distance/(...)'")
        weight(system, of, system.values)
    if name in ("energy_per_distance", "cost_of_transport") and not (
        system.translation or (of and name == "energy_per_distance")
    ):
        raise DeclarationError(
            where,
            f"{system.name} declares no translation",
            "Name a component, like energy_per_distance:x",
        )
    if name == "relative_phase":
        _check_drive(system, of or system.declaration.state[0])


def _check_drive(system: System, of: str) -> None:
    where = "measure.relative_phase"
    if not driven(system):
        raise DeclarationError(where, f"{system.name} has no drive", "Use 'phase'")
    try:
        text, formula = read_drive(system, of)
    except DeclarationError as error:
        known = suggestion("", system.places, accepts=lambda x: _check_drive(system, x))
        raise DeclarationError(where, error.reason, known) from None
    if not _oscillates(formula):
        raise DeclarationError(
            where, f"{text} does not oscillate", f"Use 'phase:{of}', which is relative to t = 0"
        )


def _oscillates(formula: Expr) -> bool:
    """Return whether a formula has a wave in time, or a term that is not a sum of waves."""
    if "t" not in formula.symbols:
        return False
    inside = [*formula.args, *(base for base, _ in formula.terms)]
    return formula.op not in ("sym", "sum", "prod") or any(map(_oscillates, inside))


def driven(system: System) -> bool:
    """Return whether a system has drives of a constant frequency."""
    return bool(derive(system.declaration).frequencies)


def _turn(motion: Trajectory) -> float:
    """Period of the drives, or that of the motion if nothing drives it."""
    system = motion.system
    with suppress(DeclarationError):
        return clock(system, derive(system.declaration), motion.parameters).period(
            motion.parameters
        )
    return float(np.diff(motion.t_span)[0])


def _first(motion: Trajectory, of: str) -> complex:
    """First harmonic of a quantity, with the frequency of the drives."""
    name = of or motion.system.declaration.state[0]
    turns = float(np.diff(motion.t_span)[0]) / _turn(motion)
    order = round(turns)
    if abs(turns - order) > _WHOLE * turns:
        # A motion that repeats in a fraction of the period of the drives has no harmonic of that
        # period.
        return 0.0j if turns < 1.0 else complex(np.nan)
    names, states = motion.system.declaration.state, motion.knots.state
    formula = read_formula(motion.system, name, "measure")
    known: dict[str, complex] = {}
    if formula.symbols & set(names):
        own, _ = over_period.harmonics(motion, states[-1] - states[0], order)
        known = dict(zip(names, own.tolist(), strict=True))
    return over_period.harmonics_of(motion, {name: formula}, known, order)[0][name]
