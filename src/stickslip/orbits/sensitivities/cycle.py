"""Derivatives of a cycle with respect to parameters.

Derivatives of state, period and shift are those of :mod:`stickslip.orbits.return_map.slopes`.
Derivatives of extremes are those of the state at their times, since the rate vanishes there.
Multipliers are derivatives themselves, so theirs are extrapolated differences of cycles nearby.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError, suggestion
from stickslip.model.quantities import described, quantity
from stickslip.model.system import System
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.cycles.finding import from_cycle
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.damped_newton import Closed
from stickslip.orbits.return_map.slopes import cycle_slope
from stickslip.orbits.sensitivities.extremes import Traced, slopes_of_extremes
from stickslip.orbits.sensitivities.measured import measure_slopes

if TYPE_CHECKING:
    import xarray

    from stickslip.orbits.cycles.cycle import Cycle

_DIFFERENCE = 1e-3  # first step of differences of multipliers, in units of the parameter


@dataclass(frozen=True)
class Moved:
    """Derivative of a cycle with respect to one parameter.

    Attributes
    ----------
    shift, state : arrays, shape (states,)
        Of the shift in a period, and of the state at which the period starts.
    ends : array, shape (states, 2)
        Of the least and the largest value of each component.
    multipliers : array of complex, shape (states,)
    """

    period: float
    shift: Array
    state: Array
    ends: Array
    multipliers: Array


def cycle_sensitivity(
    cycle: Cycle,
    names: Sequence[str],
    multipliers: bool = True,
    of: Sequence[str] | None = None,
) -> xarray.Dataset:
    """Derivatives of period, drift, speed, extremes, amplitudes and multipliers of a cycle, or of
    chosen measures.

    Parameters
    ----------
    names : sequence of str
        Parameters.
    multipliers : bool
        Whether to differentiate multipliers, too, which requires cycles nearby.
    of : sequence of str, optional
        Measures, by their names in maps, see
        :func:`stickslip.orbits.sensitivities.measured.measure_slopes`; then the dataset has these.

    Raises
    ------
    DeclarationError
        If there is no such parameter or measure, or the cycle has no derivative: events coincide,
        or a guard is touched.
    ConvergenceError
        If there is no cycle nearby (at a fold).
    """
    import xarray as xr

    for name in names:
        if name not in cycle.parameters:
            reason, remedy = "unknown parameter", suggestion(name, cycle.parameters)
            if name in cycle.system.declaration.state:
                reason = "a cycle does not depend on the initial state"
                remedy = "Give parameters, or use trajectory.sensitivity"
            raise DeclarationError(f"sensitivity: {name}", reason, remedy)
    if not cycle.differentiable:
        raise DeclarationError(
            "sensitivity",
            "the cycle is not differentiable: events coincide, or a guard is touched tangentially",
            "Change a parameter slightly, or use continue_cycle, which reports such special points",
        )
    system = cycle.system
    coordinates = {
        "parameter": ("parameter", list(names)),
        "parameter_units": ("parameter", [_unit(system, name) for name in names]),
    }
    if of is not None:
        of_measures = measure_slopes(cycle, names, of)
        measured = {
            text: ("parameter", slopes, _said(system, text)) for text, slopes in of_measures.items()
        }
        return xr.Dataset(measured, coordinates, {"title": cycle.title})
    found = [_moved(cycle.closed, name, multipliers) for name in names]
    direction = np.array([cycle.direction.get(x, 0.0) for x in system.declaration.state])
    drift = np.array([direction @ m.shift for m in found]) / max(direction @ direction, 1.0)
    period = np.array([m.period for m in found])
    ends = np.array([m.ends for m in found]).reshape(len(names), -1, 2)
    units = cycle.units
    when = units["time"]
    variables: dict[str, Any] = {
        "period": ("parameter", period, {"units": when}),
        "drift": ("parameter", drift, {"units": units["drift"]}),
        "speed": (
            "parameter",
            (drift - cycle.speed * period) / cycle.period,
            {"units": units["speed"]},
        ),
        "state": (("parameter", "component"), np.array([m.state for m in found])),
        "low": (("parameter", "component"), ends[:, :, 0]),
        "high": (("parameter", "component"), ends[:, :, 1]),
        "amplitude": (("parameter", "component"), 0.5 * (ends[:, :, 1] - ends[:, :, 0])),
    }
    if multipliers:
        said = {"long_name": "derivative of a multiplier (differences, extrapolated)"}
        variables["multiplier"] = (
            ("parameter", "index"),
            np.array([m.multipliers for m in found]),
            said,
        )
    state = system.declaration.state
    coordinates |= {
        "component": ("component", list(state)),
        "component_units": ("component", [_unit(system, x) for x in state]),
    }
    return xr.Dataset(variables, coordinates, {"title": cycle.title})


def _unit(system: System, name: str) -> str:
    return quantity(system, name).get("units", "1")


def _said(system: System, measure: str) -> dict[str, str]:
    """Attributes of the derivative of a measure."""
    said = described(system, measure)
    return {**said, "long_name": f"derivative of {said['long_name']}", "per": "parameter_units"}


def _moved(closed: Closed, name: str, multipliers: bool) -> Moved:
    """The change of a cycle with one parameter."""
    found = cycle_slope(closed, name)
    ends = _ends(found.orbit.motion, found.pieces, found.state, found.period)
    spectrum = _multipliers(closed, name) if multipliers else np.zeros(0)
    return Moved(found.period, found.shift, found.state, ends, spectrum)


def _ends(motion: Trajectory, pieces: Pieces, state: Array, period: float) -> Array:
    """Derivatives of the least and the largest value of each component, shape (states, 2).

    Parameters
    ----------
    motion : Trajectory
        One period of the motion.
    pieces : Pieces
        With the parameter.
    state : array, shape (states,)
        Derivative of the first state.
    period : float
        That of the period.
    """
    k = motion.knots
    rows = motion.problem.rows.program.rates
    unit = np.eye(len(state) + 1)

    def component(j: int) -> Traced:
        def values(clock: Array, index: Array) -> Array:
            return motion.states_at(clock + k.origin, index)[:, j]

        def rate(clock: float, step: int) -> float:
            return float(motion.dense_output.rows(np.array([clock]), np.array([step]))[0, rows[j]])

        return Traced(values, rate, lambda clock, step: unit[j])

    followed = [component(j) for j in range(len(state))]
    return slopes_of_extremes(motion, pieces, (state, period), followed)


def _multipliers(closed: Closed, name: str) -> Array:
    """Derivatives of the multipliers, in their order."""
    value = closed.orbit.problem.parameters[name]
    now = closed.spectrum.every
    h = _DIFFERENCE * (abs(value) or 1.0)

    def at(change: float) -> Array:
        moved = from_cycle(closed, {name: value + change}).spectrum.every
        _, order = linear_sum_assignment(np.abs(now[:, None] - moved))
        return moved[order]

    try:
        rough, fine = ((at(s * h) - at(-s * h)) / (2.0 * s * h) for s in (1.0, 0.5))
    except (ConvergenceError, ValueError):
        return np.full(len(now), complex(np.nan, np.nan))
    return (4.0 * fine - rough) / 3.0
