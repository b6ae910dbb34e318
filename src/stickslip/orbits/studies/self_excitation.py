"""A system without drives, with self-excitation proportional to mass, and its linear modes.

References
----------
M. Krack, Nonlinear modal analysis of nonconservative systems: extension of the periodic motion
concept, Computers & Structures 154 (2015) 59-71.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.equations.derive import derive
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.model.system import Inertial, Parameter, System
from stickslip.numerics.levels import SAME_VALUE
from stickslip.symbolic import expressions as ex
from stickslip.symbolic.expressions import Expr
from stickslip.symbolic.formulas import TimeFunction, formula_text

EXCITATION = "self_excitation"
"""Name of the parameter ξ that the excited system has more."""
_STEPS = 50  # largest number of Newton iterations for the equilibrium
_RIGID = 1e-12  # squared frequency relative to the largest that is 0
_AT_REST = 1e-12  # step relative to the state that counts as zero


@dataclass(frozen=True)
class LinearMode:
    """A mode of small oscillations around an equilibrium.

    Attributes
    ----------
    frequency : float
        Angular.
    shape : array, shape (inertial coordinates,)
        Of unit modal mass.
    rest : array, shape (inertial coordinates,)
    mass : array, shape (inertial coordinates, inertial coordinates)
    damping : float
        Damping ratio by all resistance that is linear.
    """

    frequency: float
    shape: Array
    rest: Array
    mass: Array
    damping: float

    @property
    def overdamped(self) -> bool:
        """Whether the mode, if its oscillations are small, does not oscillate."""
        return self.damping >= 1.0 - SAME_VALUE

    @property
    def decay(self) -> float:
        """Excitation ξ that compensates the linear damping."""
        return 2.0 * self.damping * self.frequency


def self_excited(system: System, values: Mapping[str, float]) -> System:
    """The system with the additional force ξ·(momentum) on every inertial coordinate.

    Parameters
    ----------
    values : mapping of str to float
        Values of all parameters. Drives that a zero parameter switches off are omitted.

    Returns
    -------
    System
        Written out, with one more parameter, ξ, that is zero by default.

    Raises
    ------
    DeclarationError
        If the system depends on time, has no mass, its mass depends on the state, or states jump.
    """
    d = system.declaration
    if not d.inertial:
        raise DeclarationError(
            system.name, "no coordinate has a mass", "A backbone needs an inertial coordinate"
        )
    if d.jumps:
        raise DeclarationError(
            f"jumps.{d.jumps[0].name}", "a state that jumps has no backbone", "Remove the jump"
        )
    if EXCITATION in system.parameters:
        raise DeclarationError(
            f"parameters.{EXCITATION}", "this name is reserved for backbones", "Choose another name"
        )
    known = set(d.parameters)
    for pair, entry in d.mass.items():
        moving = sorted(entry.symbols - known)
        if moving:
            raise DeclarationError(
                "kinetic",
                f"the mass of {', '.join(dict.fromkeys(pair))} depends on {', '.join(moving)}",
                "A backbone needs a constant mass matrix",
            )
    quiet = _undriven(system.plain, values)
    coordinates = dict(quiet.coordinates)
    for q in d.inertial:
        terms = [
            f"({formula_text(entry, q)})*d_{pair[1] if pair[0] == q else pair[0]}"
            for pair, entry in d.mass.items()
            if q in pair and (pair[0] == q or (pair[1], pair[0]) not in d.mass)
        ]
        own = coordinates[q]
        if isinstance(own, Inertial):
            force = f"{own.force} + {EXCITATION}*({' + '.join(terms)})"
            coordinates[q] = replace(own, force=force)
    unit = f"1/{system.time_unit}" if system.time_unit else ""
    parameters = {
        **quiet.parameters,
        EXCITATION: Parameter(0.0, unit, "self-excitation by mass"),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # warnings were issued when the system was declared
        found = replace(quiet, coordinates=coordinates, parameters=parameters, conditions={})
    if derive(found.declaration).timed:
        what = _driving(found) or "time"
        raise DeclarationError(
            system.name,
            f"the system is driven by {what}, but a backbone is that of a free system",
            "Set the amplitude of the drive to 0 in 'parameters', or configure the drive as 0",
        )
    return found


def _driving(system: System) -> str:
    """Description of the active drives."""
    drives = system.declaration.drives
    acting = [name for name, e in drives.items() if "t" in e.symbols]
    acting += list(system.declaration.given)
    return ", ".join(f"'{name}'" for name in dict.fromkeys(acting))


def _undriven(system: System, values: Mapping[str, float]) -> System:
    """The system without the drives that zero parameters switch off."""
    d = system.declaration
    zero = {name: ex.ZERO for name, value in values.items() if value == 0.0}

    def without(formula: Any, where: str) -> Any:
        if isinstance(formula, TimeFunction) or not isinstance(formula, str):
            return formula
        read: Expr = d.scope.parse(formula, where)
        if "t" not in read.symbols:
            return formula
        left = ex.substitute(read, zero)
        return formula if "t" in left.symbols else formula_text(left, where)

    changed: dict[str, Any] = {
        "drives": {x: without(f, f"drives.{x}") for x, f in system.drives.items()},
        "potential": without(system.potential, "potential"),
        "coordinates": {
            x: replace(c, force=without(c.force, f"coordinates.{x}.force"))
            for x, c in system.coordinates.items()
        },
    }
    if all(getattr(system, key) == value for key, value in changed.items()):
        return system
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return replace(system, conditions={}, **changed)


def linear_modes(system: System, values: Mapping[str, float]) -> list[LinearMode]:
    """Modes of small oscillations without slip, with sliders behind springs sticking, the lowest
    first.

    Parameters
    ----------
    system : System
        A self-excited one.

    Raises
    ------
    ConvergenceError
        If there is no equilibrium near 0 or near the initial positions.
    DeclarationError
        If no mode is stable.
    """
    d = system.declaration
    names = d.inertial
    n = len(names)
    still = {**d.start, **values, "t": 0.0, **{f"d_{x}": 0.0 for x in d.coordinates}}
    push = [ex.derivative(d.potential, q) - d.forces.get(q, ex.ZERO) for q in names]
    slopes = {
        (i, j): slope
        for i, f in enumerate(push)
        for j, q in enumerate(names)
        if q in f.symbols and (slope := ex.derivative(f, q)) is not ex.ZERO
    }
    begin = np.array([d.start[q] for q in names])

    def rests(rest: Array) -> tuple[Array, Array] | None:
        """Newton's method for an equilibrium, with the stiffness there; None if it does not
        converge."""
        stiffness = np.zeros((n, n))
        for _ in range(_STEPS):
            at = {**still, **dict(zip(names, map(float, rest), strict=True))}
            force = np.array([ex.evaluate(f, at) for f in push])
            for (i, j), slope in slopes.items():
                stiffness[i, j] = ex.evaluate(slope, at)
            if not (np.all(np.isfinite(force)) and np.all(np.isfinite(stiffness))):
                return None
            # Least squares, since the stiffness is singular along a translation.
            step = np.linalg.lstsq(stiffness, force, rcond=None)[0]
            rest = rest - step
            if np.linalg.norm(step) <= _AT_REST * np.linalg.norm(rest):
                return rest, stiffness
        return None

    # Undamped modes: D = φᵀCφ/(2ω) is the damping ratio to first order in C.
    mass, damping = np.zeros((n, n)), _linear_damping(system, values)
    for (a, b), entry in d.mass.items():
        i, j = names.index(a), names.index(b)
        mass[i, j] = mass[j, i] = ex.evaluate(entry, values)
    from scipy.linalg import eigh

    known = [found for at in (np.zeros(n), begin) if (found := rests(at)) is not None]
    for rest, stiffness in known:
        # For forces without a potential only the symmetric part of their slopes counts.
        squares, shapes = eigh(0.5 * (stiffness + stiffness.T), mass)
        modes = [
            LinearMode(
                float(np.sqrt(w)),
                shape,
                rest,
                mass,
                float(shape @ damping @ shape / (2.0 * np.sqrt(w))),
            )
            for w, shape in zip(squares, shapes.T, strict=True)
            if w > _RIGID * np.max(np.abs(squares))
        ]
        if modes:
            return modes
    if known:
        raise DeclarationError(
            system.name, "it has no restoring force and no mode", "Add a stiffness"
        )
    raise ConvergenceError(
        f"a backbone of {system.name}",
        "no equilibrium was found about which it oscillates",
        "Give initial positions near an equilibrium",
    )


def _linear_damping(system: System, values: Mapping[str, float]) -> Array:
    """The constant part of the damping matrix of the inertial coordinates, shape (n, n)."""
    d = system.declaration
    names = d.inertial
    found = np.zeros((len(names), len(names)))
    for (a, b), entry in d.damping.items():
        if a in names and b in names:
            i, j = names.index(a), names.index(b)
            found[i, j] = found[j, i] = ex.evaluate(entry, values)
    for i, q in enumerate(names):
        resistance = d.drags.get(q, ex.ZERO) - d.forces.get(q, ex.ZERO)
        for j, p in enumerate(names):
            if f"d_{p}" in resistance.symbols:
                slope = ex.derivative(resistance, f"d_{p}")
                if slope.symbols <= values.keys():
                    found[i, j] += ex.evaluate(slope, values)
    return found
