"""Derivatives of a cycle with respect to parameters.

State, period and shift change as :mod:`stickslip.orbits.return_map.slopes` says, and extremes as
the state does where they are reached, since there the motion stands still. Multipliers are
themselves derivatives: theirs are differences of cycles closed again nearby, extrapolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError, suggestion
from stickslip.model.quantities import quantity
from stickslip.motion.record.knots import Knots
from stickslip.motion.trajectory import Trajectory
from stickslip.orbits.cycles.finding import from_cycle
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.variational import variation
from stickslip.orbits.return_map.damped_newton import Closed
from stickslip.orbits.return_map.slopes import cycle_slope
from stickslip.orbits.sensitivities.motion import with_knots

if TYPE_CHECKING:
    import xarray

    from stickslip.orbits.cycles.cycle import Cycle

_DIFFERENCE = 1e-3  # first step of differences of multipliers, in units of the parameter
_BISECTIONS = 60
_LOOKS = 20  # in a step, where an extreme is looked for


@dataclass(frozen=True)
class Moved:
    """How a cycle changes with one parameter.

    Attributes
    ----------
    period : float
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
    cycle: Cycle, names: Sequence[str], multipliers: bool = True
) -> xarray.Dataset:
    """Derivatives of period, drift, speed, extremes, amplitudes and multipliers of a cycle.

    Parameters
    ----------
    cycle : Cycle
    names : sequence of str
        Parameters.
    multipliers : bool
        Whether multipliers are differentiated, too, for which cycles nearby are closed.

    Raises
    ------
    DeclarationError
        If there is no such parameter, or the cycle has no derivative: events coincide, or a guard
        is touched.
    ConvergenceError
        If there is no cycle nearby (at a fold): then nothing is said.
    """
    import xarray as xr

    for name in names:
        if name not in cycle.parameters:
            remedy = suggestion(name, cycle.parameters)
            raise DeclarationError(f"sensitivity: {name}", "no parameter has this name", remedy)
    if not cycle.differentiable:
        raise DeclarationError(
            "sensitivity",
            "the cycle has no derivative: events coincide, or a guard is touched",
            "Change a parameter a little, or follow its branch: such points have a name there",
        )
    system = cycle.system
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
    return xr.Dataset(
        variables,
        {
            "parameter": ("parameter", list(names)),
            "parameter_units": (
                "parameter",
                [quantity(system, name).get("units", "1") for name in names],
            ),
            "component": ("component", list(state)),
            "component_units": (
                "component",
                [quantity(system, x).get("units", "1") for x in state],
            ),
        },
        {"title": cycle.title},
    )


def _moved(closed: Closed, name: str, multipliers: bool) -> Moved:
    """The change of a cycle with one parameter."""
    found = cycle_slope(closed, name)
    ends = _ends(found.orbit.motion, found.pieces, found.state, found.period)
    spectrum = _multipliers(closed, name) if multipliers else np.zeros(0)
    return Moved(found.period, found.shift, found.state, ends, spectrum)


class _Extreme(NamedTuple):
    """Where a component is least, or largest: the time since the origin, and the knot that it is
    at (−1: none), from the left or not."""

    clock: float
    knot: int
    left: bool


def _ends(motion: Trajectory, pieces: Pieces, state: Array, period: float) -> Array:
    """Derivatives of the least and the largest value of each component, shape (states, 2).

    Parameters
    ----------
    motion : Trajectory
        One period.
    pieces : Pieces
        With the parameter.
    state : array, shape (states,)
        Derivative of the first state.
    period : float
        That of the period.
    """
    k = motion.knots
    direction = np.append(state, 1.0)[:, None]
    found = [[_extreme(motion, j, sign) for sign in (1.0, -1.0)] for j in range(len(state))]
    times = np.unique([e.clock for pair in found for e in pair])
    fine, place = with_knots(motion, times + k.origin)
    change = variation(fine, pieces, direction)
    at_time = dict(zip(times, place, strict=True))

    def slope(j: int, e: _Extreme) -> float:
        knot = at_time[e.clock]
        if not e.left:
            late = change.late[knot, 0]
            rate = _rate(motion, j, e.clock, e.knot) if np.isfinite(late) else 0.0
            return float(change.after[knot, j, 0] + rate * np.nan_to_num(late))
        # Before an event, or at the end of the period, both of which come at another time.
        arrived = variation(_until(motion, e.knot), pieces, direction).after[-1, j, 0]
        late = period if e.knot == len(k.clock) - 1 else np.nan_to_num(change.late[knot, 0])
        return float(arrived + _rate(motion, j, e.clock, e.knot - 1) * late)

    return np.array([[slope(j, e) for e in pair] for j, pair in enumerate(found)])


def _until(motion: Trajectory, knot: int) -> Trajectory:
    """A motion up to a knot, without what happens there."""
    k = motion.knots
    parts = k.first(knot + 1)
    state = parts.state.copy()
    state[-1] = motion._states_at(k.time[[knot]], np.array([knot - 1]))[0]
    mode, region, cause = (part.copy() for part in (parts.mode, parts.region, parts.cause))
    mode[-1], region[-1], cause[-1] = mode[-2], region[-2], -1
    knots = Knots(parts.clock, state, mode, region, cause, k.origin)
    return Trajectory(motion._problem, motion.t_span, knots, motion.outcome, motion.rtol)


def _extreme(motion: Trajectory, j: int, sign: float) -> _Extreme:
    """Where sign × component is least."""
    k = motion.knots
    last = len(k.clock) - 1
    right = sign * k.state[:-1, j]
    left = sign * motion._states_at(k.time[1:], np.arange(last))[:, j]
    steps = np.flatnonzero(np.diff(k.clock) > 0.0)
    share = np.arange(1, _LOOKS) / _LOOKS
    clock = (k.clock[steps][:, None] + np.diff(k.clock)[steps][:, None] * share).ravel()
    index = np.repeat(steps, len(share))
    inside = sign * motion._states_at(clock + k.origin, index)[:, j]
    best = min(np.min(right), np.min(left), np.min(inside, initial=np.inf))
    i = int(np.argmin(inside)) if len(inside) else 0
    # A turn between two looks goes lower than both.
    knot = int(index[i])
    width = np.diff(k.clock)[knot] / _LOOKS
    turn = _turn(motion, j, (clock[i] - width, clock[i] + width), knot)
    if turn is not None:
        value = sign * motion._states_at(np.array([turn + k.origin]), np.array([knot]))[0, j]
        if value <= best:
            return _Extreme(turn, -1, False)
    if np.min(right) <= np.min(left):
        i = int(np.argmin(right))
        return _Extreme(float(k.clock[i]), i, False)
    i = int(np.argmin(left)) + 1
    return _Extreme(float(k.clock[i]), i, True)


def _rate(motion: Trajectory, j: int, clock: float, knot: int) -> float:
    """Rate of a component within the step of a knot."""
    row = motion._problem.rows.program.rates[j]
    return float(motion._sample_clock(np.array([clock]), np.array([knot]))[0, row])


def _turn(motion: Trajectory, j: int, ends: tuple[float, float], knot: int) -> float | None:
    """When a component turns between two times of a step; None if it does not."""
    k = motion.knots
    low, high = max(ends[0], k.clock[knot]), min(ends[1], k.clock[knot + 1])
    start = _rate(motion, j, low, knot)
    if not start * _rate(motion, j, high, knot) < 0.0:
        return None
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if start * _rate(motion, j, middle, knot) > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _multipliers(closed: Closed, name: str) -> Array:
    """Derivatives of the multipliers, in their order."""
    value = closed.orbit.problem.parameters[name]
    now = closed.spectrum.every
    h = _DIFFERENCE * (abs(value) or 1.0)

    def at(change: float) -> Array:
        moved = from_cycle(closed, closed.shooting.start, {name: value + change}).spectrum.every
        _, order = linear_sum_assignment(np.abs(now[:, None] - moved))
        return moved[order]

    try:
        rough, fine = ((at(s * h) - at(-s * h)) / (2.0 * s * h) for s in (1.0, 0.5))
    except (ConvergenceError, ValueError):
        return np.full(len(now), complex(np.nan, np.nan))
    return (4.0 * fine - rough) / 3.0
