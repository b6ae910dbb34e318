"""Phases relative to the drive of a system.

With x(t) = Re(X exp(iωt)) + … and a drive Re(G exp(iωt)) + … the phase is that of X/G, negative if
x lags behind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from stickslip.arrays import AnyArray, Array
from stickslip.errors import DeclarationError, short
from stickslip.model.system import System
from stickslip.numerics.levels import COMPUTED_ZERO
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.evaluator import evaluator
from stickslip.symbolic.expressions import Expr

_SAMPLES = 64  # samples of a drive in a period, for its first harmonic


def read_drive(system: System, coordinate: str, drive: str | None = None) -> tuple[str, Expr]:
    """Reference of the phase of a coordinate, an unknown of a structure, an output or a formula, in
    words and as a formula: the requested one, the only drive of the system, or the force on the
    coordinate; for other quantities, the only force that depends on time.

    Raises
    ------
    DeclarationError
        If the requested reference is not a formula, or there is no such force.
    """
    d = system.declaration
    if drive is not None:
        return drive, d.scope.parse(drive, "drive")
    if len(d.drives) == 1:
        (name,) = d.drives
        return name, d.drives[name]
    if coordinate not in system.coordinates and not system.unknown(coordinate):
        return _only_force(system, coordinate)
    if coordinate not in system.coordinates:
        at = system.forces.get(coordinate, 0.0)
        if at == 0.0 and len(system.forces) == 1:
            (coordinate, at), *_ = system.forces.items()
        return f"the force on {coordinate}", d.scope.parse(at, f"forces.{coordinate}")
    return f"the force on {coordinate}", _force_on(system, coordinate)


def _force_on(system: System, coordinate: str) -> Expr:
    """All forces on a coordinate except friction."""
    d = system.declaration
    where = f"coordinates.{coordinate}.force"
    given = d.scope.parse(system.coordinates[coordinate].force, where)
    return given - ex.derivative(d.potential, coordinate)


def _only_force(system: System, of: str) -> tuple[str, Expr]:
    """The only force that depends on time."""
    scope = system.declaration.scope
    forces = {x: _force_on(system, x) for x in system.coordinates}
    forces |= {x: scope.parse(force, f"forces.{x}") for x, force in system.forces.items()}
    timed = [x for x, force in forces.items() if "t" in force.symbols]
    if len(timed) != 1:
        said = " and ".join(timed) or "nothing"
        raise DeclarationError(
            "drive",
            f"the forces on {said} depend on time, so the drive of '{short(of)}' is ambiguous",
            "Set drive= to the reference of the phases",
        )
    return f"the force on {timed[0]}", forces[timed[0]]


def phase_of_drive(
    system: System, drive: tuple[str, Expr], values: Mapping[str, float], period: float
) -> float:
    """Phase of the first harmonic of a drive, evaluated at the state 0.

    Parameters
    ----------
    drive : (str, Expr)
        See :func:`read_drive`.
    values : mapping of str to float
        Parameters.
    period : float
        Of the drives.

    Raises
    ------
    DeclarationError
        If it has none.
    """
    return float(np.angle(_first_harmonics(system, drive, [drive[1]], values, period)[0]))


def drive_slope(
    system: System,
    drive: tuple[str, Expr],
    values: Mapping[str, float],
    period: float,
    change: tuple[str, float],
) -> float:
    """Derivative of the same with respect to a parameter.

    Parameters
    ----------
    change : (str, float)
        The parameter, and the derivative of the period over the period.
    """
    name, stretched = change
    formula = drive[1]
    # At a fixed fraction of the period the time changes in proportion to the period.
    moved = ex.derivative(formula, name) + stretched * ex.sym("t") * ex.derivative(formula, "t")
    first, slope = _first_harmonics(system, drive, [formula, moved], values, period)
    return float((slope / first).imag)


def _first_harmonics(
    system: System,
    drive: tuple[str, Expr],
    formulas: Sequence[Expr],
    values: Mapping[str, float],
    period: float,
) -> AnyArray:
    """First harmonics of a drive, which comes first, and of formulas of the same names."""
    names = sorted(drive[1].symbols - {"t"})
    known = {**dict.fromkeys(system.declaration.state, 0.0), **values}
    for name in names:
        if name not in known:
            raise DeclarationError(
                "drive", f"it depends on '{name}'", "Use a formula of t and the parameters"
            )
    t = np.arange(_SAMPLES) / _SAMPLES * period
    table = np.array([t, *(np.full(_SAMPLES, known[name]) for name in names)])
    waves = evaluator(formulas, ["t", *names])(table)
    found = np.mean(waves * np.exp(-2j * np.pi * t / period), axis=1)
    if not abs(found[0]) > COMPUTED_ZERO * np.max(np.abs(waves[0])):
        raise DeclarationError(
            "drive",
            f"{drive[0]} has no harmonic of period {period:.9g}",
            "Set drive= to the reference of the phases",
        )
    return found


def relative_phase(phase: Array | float, of_drive: Array | float) -> Array:
    """Phases relative to those of a drive, in (−3π/2, π/2]."""
    return np.pi / 2.0 - np.mod(np.pi / 2.0 - (np.asarray(phase) - of_drive), 2.0 * np.pi)
