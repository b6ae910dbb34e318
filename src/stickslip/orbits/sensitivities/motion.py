"""Derivatives of a motion with respect to parameters and initial values.

The first variation (:mod:`stickslip.orbits.fields.variational`) is exact between events and across
them, for any number of parameters in one pass along the motion. The requested times become knots of
the motion. Times at which no derivative exists are reported with the reason; derivatives beyond are
NaN.

References
----------
R. I. Leine, H. Nijmeijer, *Dynamics and Bifurcations of Non-Smooth Mechanical Systems*, Springer
2004, chapter 7; E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*,
I.14 (derivatives with respect to parameters and initial values).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, suggestion
from stickslip.kept import made_once
from stickslip.model.entries.declared import Kind
from stickslip.model.quantities import quantity
from stickslip.motion.record.knots import Knots
from stickslip.motion.simulate import simulate
from stickslip.motion.trajectory import Trajectory
from stickslip.numerics.levels import COMPUTED_ZERO
from stickslip.orbits.fields.mode_field import Piece, Pieces
from stickslip.orbits.fields.saltation import TOUCHED
from stickslip.orbits.fields.variational import Variation, variation
from stickslip.orbits.sensitivities.quantities import Observation, gradient, read_observations
from stickslip.orbits.sensitivities.touching import touched
from stickslip.symbolic import expressions as ex

if TYPE_CHECKING:
    import xarray

_GRID = 201  # number of times, unless they are given
_KEEPS = 1e-10  # largest violation of a constraint by a change, relative to its terms
_DIFFERENCE = 1e-4  # first step of differences, in units of a parameter
_FINE_RTOL = 1e-12  # relative tolerance of motions for numerical derivatives


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of quantities along a motion.

    Attributes
    ----------
    names : tuple of str
        Parameters, and components of the state for their initial values.
    times : array, shape (times,)
    values : array, shape (quantities, times)
        The quantities themselves (right limits where they jump).
    slopes : array, shape (quantities, times, names)
        Their derivatives; NaN after a time at which there is none.
    knots : array of int, shape (switches,)
        Knots of the motion at which a mode or region switches.
    switches : array, shape (switches, names)
        Derivatives of the times of these switches.
    missing : tuple of (float, str)
        Times at which no derivative exists, and why.
    """

    trajectory: Trajectory
    names: tuple[str, ...]
    observed: tuple[str, ...]
    times: Array
    values: Array
    slopes: Array
    knots: Array
    switches: Array
    missing: tuple[tuple[float, str], ...]

    @property
    def switch_times(self) -> Array:
        """Times of the switches."""
        return self.trajectory.knots.time[self.knots]


def dataset_of(found: Sensitivity, compared: bool = False) -> xarray.Dataset:
    """Derivatives by quantity, over parameter and time; ``d_switch_time`` over parameter and
    switch. The units of the parameters are a coordinate.

    Parameters
    ----------
    compared : bool
        Whether finite differences of motions are added.
    """
    import xarray as xr

    system = found.trajectory.system
    about = [quantity(system, name) for name in found.names]
    when = quantity(system, "t")
    variables: dict[str, Any] = {}
    for name, slope in zip(found.observed, found.slopes, strict=True):
        variables[name] = (("parameter", "time"), slope.T, _said(found.trajectory, name))
    if compared:
        for name, slope in zip(found.observed, second_opinion(found), strict=True):
            said = _said(found.trajectory, name)
            variables[f"{name}_by_differences"] = (("parameter", "time"), slope.T, said)
    variables["d_switch_time"] = (
        ("parameter", "switch"),
        found.switches.T,
        {"long_name": "derivative of the time of a switch", "units": when.get("units", "1")},
    )
    return xr.Dataset(
        variables,
        {
            "parameter": ("parameter", list(found.names)),
            "parameter_units": ("parameter", [a.get("units", "1") for a in about]),
            "parameter_meaning": ("parameter", [a.get("long_name", "") for a in about]),
            "time": ("time", found.times, when),
            "switch_time": ("switch", found.switch_times, when),
        },
        {
            "title": found.trajectory.title,
            "missing": [f"t = {t:.9g}: {why}" for t, why in found.missing],
        },
    )


def _said(trajectory: Trajectory, name: str) -> dict[str, Any]:
    """Attributes of the derivative of a quantity. Its unit is that of the quantity per unit of the
    parameter; the unit of a formula is unknown."""
    known = name in {*trajectory.row_of, *trajectory.system.outputs, "energy"}
    said = quantity(trajectory.system, name) if known else {"long_name": name}
    return {
        **said,
        "long_name": f"derivative of {said.get('long_name', name)}",
        "per": "parameter_units",
    }


def _pieces_of(trajectory: Trajectory, free: tuple[str, ...]) -> Pieces:
    """The smooth pieces of its system, computed once, with derivatives with respect to some
    parameters."""
    equations = trajectory.problem.compiled.equations
    return made_once(equations, "pieces", lambda: Pieces(equations, *free), free)


def sensitivities(
    trajectory: Trajectory,
    names: Sequence[str],
    times: Sequence[float] | Array | None = None,
    of: Sequence[str] | None = None,
    *,
    touching: bool = True,
    start: Array | None = None,
) -> Sensitivity:
    """Derivatives of a motion with respect to parameters and initial values.

    Parameters
    ----------
    names : sequence of str
        Parameters; and components of the state, or unknowns of structures, for their initial
        values. If empty, only the values of the quantities are computed.
    times : array, optional
        By default 201 evenly spaced times.
    of : sequence of str, optional
        Quantities, or formulas of them; by default the state.
    touching : bool
        Whether to search for guards that are touched without being crossed, which takes about as
        long as the motion.
    start : array, shape (states, names), optional
        Additional derivatives of the initial state, if it is a function of parameters.

    Raises
    ------
    DeclarationError
        If a name, a quantity or a time is not known, or the system has a drag without mass: its
        rates have no formula.
    """
    state = tuple(trajectory.problem.compiled.layout.state)
    observed = read_observations(trajectory, state if of is None else of)
    when = _times(trajectory, times)
    if not names:
        return _values_alone(trajectory, observed, when)
    fine, place = with_knots(trajectory, when)
    found = follow(trajectory, fine, names, start, touching)
    return _gathered(
        trajectory, fine, (tuple(names), observed), (when, place), found.variation, found.missing
    )


class Followed(NamedTuple):
    """The first variation along a motion, and the times at which it does not exist, with
    reasons."""

    variation: Variation
    missing: list[tuple[float, str]]


def follow(
    trajectory: Trajectory,
    fine: Trajectory,
    names: Sequence[str],
    start: Array | None = None,
    touching: bool = True,
) -> Followed:
    """The first variation of a motion with respect to parameters and initial values.

    Parameters
    ----------
    trajectory, fine : Trajectory
        The motion, and the same with additional knots, at which the variation is computed.
    names : sequence of str
        Parameters; and components of the state, or unknowns of structures, for their initial
        values.
    start, touching
        As in :func:`sensitivities`.

    Raises
    ------
    DeclarationError
        If a name is not known.
    """
    problem = trajectory.problem
    state = tuple(problem.compiled.layout.state)
    _check_names(trajectory, names)
    slopes = [_start_slope(trajectory, name) for name in names]
    free = tuple(dict.fromkeys(x for slope in slopes for x in slope if x not in state))
    pieces = _pieces_of(trajectory, free)
    columns = {name: i for i, name in enumerate((*state, *free))}
    directions = np.zeros((len(columns), len(names)))
    for j, slope in enumerate(slopes):
        for x, value in slope.items():
            directions[columns[x], j] = value
    if start is not None:
        directions[: len(state)] += start
    refused = _begin(trajectory, pieces, directions)
    found = variation(fine, pieces, directions)
    missing = [(float(trajectory.knots.time[0]), refused)] if refused else []
    missing += [
        (t, "events coincide that are separate in neighbouring motions") for t in found.corners
    ]
    missing += [(t, found.reasons.get(t, TOUCHED)) for t in found.grazings]
    if touching:
        missing += touched(trajectory, pieces)
    return Followed(found, sorted(missing))


def _check_names(trajectory: Trajectory, names: Sequence[str]) -> None:
    """Reject duplicate names, and initial values that are not independent, for which it would be
    ambiguous which others are fixed."""
    for name in names:
        if list(names).count(name) > 1:
            raise DeclarationError(f"sensitivity: {name}", "it is given twice", "Give it once only")
    trajectory.system.check_starts(names, "sensitivity")


def _start_slope(trajectory: Trajectory, name: str) -> dict[str, float]:
    """Derivative of the first state, or of the parameters, with respect to an initial value, or a
    parameter, by name.

    Raises
    ------
    DeclarationError
        If the name is unknown.
    """
    if name in trajectory.parameters:
        return {name: 1.0}
    slope = trajectory.system.start_slope(name, "sensitivity")
    if not slope:
        known = [*trajectory.parameters, *trajectory.system.starts]
        raise DeclarationError(
            f"sensitivity: {name}",
            "unknown parameter or part of the state",
            suggestion(name, known),
        )
    return slope


def at_events(
    trajectory: Trajectory,
    events: Array,
    names: Sequence[str],
    of: Sequence[str],
    start: Array | None = None,
    touching: bool = True,
) -> Sensitivity:
    """Quantities immediately before events, and their derivatives, including the change of the time
    of the event.

    Parameters
    ----------
    events : array of int, shape (events,)
        Their knots, at which the state does not jump.
    names : sequence of str
        Parameters, and components of the state for their initial values.
    of : sequence of str
        Quantities, or formulas of them; ``t`` is the time of the event.
    start, touching
        As in :func:`sensitivities`.

    Returns
    -------
    Sensitivity
        Over the times of the events.

    Raises
    ------
    DeclarationError
        If the state jumps at an event and quantities other than its time are requested.
    """
    observed = read_observations(trajectory, of)
    jumping = np.intersect1d(events, trajectory.state_jumps)
    if len(jumping) and any(o.formula is not ex.sym("t") for o in observed):
        when = trajectory.knots.time[jumping[0]]
        raise DeclarationError(
            "events",
            f"the state jumps in the impact at t = {when:.9g}",
            "Use the times of impacts only",
        )
    found, missing = follow(trajectory, trajectory, names, start, touching)
    equations = trajectory.problem.compiled.equations
    p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
    k = trajectory.knots
    n = k.state.shape[1]
    values = np.empty((len(observed), len(events)))
    slopes = np.empty((len(observed), len(events), len(names)))
    for i, e in enumerate(events):
        at = k.time[[e]], np.ascontiguousarray(k.state[[e]].T)
        made = gradient(equations, found.pieces[e - 1], observed, at, p)
        values[:, i] = made.values[:, 0]
        # The state at the event changes with the state at a time, and with the time of the event.
        change = found.after[e].copy()
        late = np.nan_to_num(found.late[e])
        change[:n] += np.outer(found.pieces[e].rates(k.time[e], k.state[e], p), late)
        slopes[:, i] = made.slopes[0] @ change + np.outer(made.time[:, 0], late)
    when = k.time[events]
    if missing:
        slopes[:, when >= missing[0][0]] = np.nan
    texts = tuple(o.name for o in observed)
    late = found.late[events]
    return Sensitivity(
        trajectory, tuple(names), texts, when, values, slopes, events, late, tuple(missing)
    )


def _times(trajectory: Trajectory, times: Sequence[float] | Array | None) -> Array:
    """Check the requested times."""
    first, last = trajectory.knots.time[[0, -1]]
    if times is None:
        return np.linspace(first, last, _GRID)
    when = np.atleast_1d(np.asarray(times, float))
    if when.ndim != 1 or not np.all((when >= first) & (when <= last)):
        raise DeclarationError(
            "times", "a time is outside the computed time span", f"Use {first:g} <= t <= {last:g}"
        )
    return when


def with_knots(trajectory: Trajectory, when: Array) -> tuple[Trajectory, Array]:
    """The motion with knots at some times, and the number of the knot of each."""
    k = trajectory.knots
    clock = when - k.origin
    new = np.setdiff1d(clock, k.clock)
    before = np.searchsorted(k.clock, new, side="right") - 1
    states = trajectory.states_at(new + k.origin, before)
    order = np.argsort(np.concatenate([k.clock, new]), kind="stable")

    def merged(kept: Array, added: Array) -> Array:
        return np.concatenate([kept, added])[order]

    knots = Knots(
        merged(k.clock, new),
        np.ascontiguousarray(merged(k.state, states)),
        merged(k.mode, k.mode[before]),
        merged(k.region, k.region[before]),
        merged(k.cause, np.full(len(new), -1, k.cause.dtype)),
        k.origin,
    )
    fine = Trajectory(
        trajectory.problem, trajectory.t_span, knots, trajectory.outcome, trajectory.rtol
    )
    return fine, np.searchsorted(knots.clock, clock, side="right") - 1


def _begin(trajectory: Trajectory, pieces: Pieces, directions: Array) -> str:
    """Project changes of the first state, and of parameters, onto the constraints of the first
    mode.

    A perturbed sticking contact slides until friction has removed the perturbation, for a time
    proportional to it: in the limit the change is projected along M⁻¹Jᵀ, the difference of the
    rates of slip in both directions. Returns the reason if there is no derivative.
    """
    k = trajectory.knots
    p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
    t, y = float(k.time[0]), k.state[0]
    piece = pieces(k.mode[0], k.region[0])
    slopes = piece.bounds(t, y, p).slopes
    for place, contact in enumerate(_constrained(piece)):
        slope = slopes[place]
        broken = slope @ directions
        if not np.any(np.abs(broken) > _KEEPS * (np.abs(slope) @ np.abs(directions))):
            continue
        c = piece.field.contacts[contact]
        if c.kind != Kind.INERTIAL or c.gap is not None:
            what = "closed contact opens" if c.gap is not None else "sliding contact comes to rest"
            return f"a {what} immediately on one side ({c.name})"
        switch = len(piece.field.region) + contact
        forward, backward = (pieces(*piece.switched(switch, side)) for side in (1, -1))
        # Slips in the two directions differ by the friction force alone, so push is along M⁻¹Jᵀ.
        push = forward.rates(t, y, p) - backward.rates(t, y, p)
        n = len(y)
        directions[:n] -= np.outer(push, broken / (slope[:n] @ push))
    return _begins_at_boundary(pieces, piece, (t, y, p), directions)


def _begins_at_boundary(
    pieces: Pieces, piece: Piece, at: tuple[float, Array, Array], directions: Array
) -> str:
    """The reason why there is no derivative if a guard is zero at the start: neighbouring motions
    on its other side begin with different rates.

    Parameters
    ----------
    piece : Piece
        The first one.
    at : float, array, array
        The first time and state, and the parameters.
    directions : array
        The requested changes.
    """
    t, y, p = at
    here = piece.leave(t, y, p)
    n = len(y)
    kinks = len(piece.field.region)
    for g, guard in enumerate(piece.field.guards):
        slopes = here.slopes[g]
        size = np.abs(slopes) @ np.abs(directions)
        if abs(here.value[g]) > _KEEPS * (np.abs(slopes[:n]) @ np.abs(y)) or not np.any(
            np.abs(slopes @ directions) > _KEEPS * size
        ):
            continue
        contact = guard.switch - kinks
        if contact >= 0 and piece.field.contacts[contact].gap is not None:
            continue  # it has an impact, or cannot be closer
        # A slip reverses if the motion arrives from that side.
        reverse = contact >= 0 and piece.field.mode[contact] != 0
        other = -piece.field.mode[contact] if reverse else guard.to
        beyond = pieces(*piece.switched(guard.switch, other)).rates(t, y, p)
        if np.max(np.abs(beyond - here.rates)) > _KEEPS * np.max(np.abs(here.rates)):
            return "it begins on a boundary at which the rates are discontinuous"
    return ""


def _constrained(piece: Piece) -> list[int]:
    """The contact of each constraint of a piece."""
    found: list[int] = []
    for i, (c, mode) in enumerate(zip(piece.field.contacts, piece.field.mode, strict=True)):
        if c.kind == Kind.INERTIAL and mode == 0:
            found += [i] if c.gap is None else [i, i]
        elif c.kind == Kind.RATE_INDEPENDENT and mode != 0 and not c.plane:
            found.append(i)
    for first, *_ in piece.field.planes:
        slides = piece.field.mode[first] != 0
        if piece.field.contacts[first].kind == Kind.RATE_INDEPENDENT and slides:
            found.append(first)
    return found


def _values_alone(
    trajectory: Trajectory, observed: tuple[Observation, ...], when: Array
) -> Sensitivity:
    """The values of the quantities, without derivatives, so that no variation has to be
    computed."""
    k = trajectory.knots
    clock = when - k.origin
    place = np.searchsorted(k.clock, clock, side="right") - 1
    states = k.state[place]
    between = np.flatnonzero(k.clock[place] < clock)
    states[between] = trajectory.states_at(when[between], place[between])
    pieces = _pieces_of(trajectory, ())
    numbers = pieces.numbers(k.mode, k.region)[place]
    values = np.empty((len(observed), len(when)))
    p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
    for number in np.unique(numbers):
        here = np.flatnonzero(numbers == number)
        at = when[here], np.ascontiguousarray(states[here].T)
        values[:, here] = gradient(pieces.equations, pieces.made[number], observed, at, p).values
    nothing = np.zeros(0, np.int64)
    slopes, switches = np.zeros((*values.shape, 0)), np.zeros((0, 0))
    texts = tuple(o.name for o in observed)
    return Sensitivity(trajectory, (), texts, when, values, slopes, nothing, switches, ())


def _gathered(
    trajectory: Trajectory,
    fine: Trajectory,
    asked: tuple[tuple[str, ...], tuple[Any, ...]],
    where: tuple[Array, Array],
    found: Variation,
    missing: list[tuple[float, str]],
) -> Sensitivity:
    """Derivatives of the requested quantities, from those of the state.

    Parameters
    ----------
    trajectory, fine : Trajectory
        The motion, and the same with more knots.
    asked : (tuple of str, tuple of Observation)
        Names, and quantities.
    where : arrays, shape (times,)
        Times, and their knots.
    """
    names, observed = asked
    when, place = where
    equations = trajectory.problem.compiled.equations
    p = np.array([trajectory.parameters[name] for name in trajectory.system.parameters])
    k = fine.knots
    values = np.empty((len(observed), len(when)))
    slopes = np.empty((len(observed), len(when), len(names)))
    numbers = found.piece[place]
    for number in np.unique(numbers):
        here = np.flatnonzero(numbers == number)
        knots = place[here]
        at = k.time[knots], np.ascontiguousarray(k.state[knots].T)
        made = gradient(equations, found.made[number], observed, at, p)
        values[:, here] = made.values
        slopes[:, here] = np.moveaxis(made.slopes @ found.after[knots], 0, 1)
    switched = np.flatnonzero((k.cause >= 0) & ~np.all(np.isnan(found.late), axis=1))
    late = found.late[switched]
    kept = np.searchsorted(trajectory.knots.clock, k.clock[switched])
    if missing:
        slopes[:, when > missing[0][0]] = np.nan
        late[k.time[switched] >= missing[0][0]] = np.nan
    texts = tuple(o.name for o in observed)
    return Sensitivity(trajectory, names, texts, when, values, slopes, kept, late, tuple(missing))


def second_opinion(found: Sensitivity) -> Array:
    """Derivatives by Richardson extrapolation of finite differences of motions, as a check; NaN if
    one of these motions does not reach the end.

    Returns
    -------
    array, shape (quantities, times, names)
    """
    motion = found.trajectory
    system = motion.system
    state = motion.problem.compiled.layout.state
    start = dict(zip(state, map(float, motion.knots.state[0]), strict=True))
    span = (float(motion.knots.time[0]), float(motion.knots.time[-1]))

    def values(name: str, change: float) -> Array:
        given, begin = dict(motion.parameters), dict(start)
        target = given if name in given else begin
        for x, slope in _start_slope(motion, name).items():
            target[x] += slope * change
        moved = simulate(system, span, initial=begin, parameters=given, rtol=_FINE_RTOL)
        if not moved.outcome.ok:
            return np.full(found.values.shape, np.nan)
        observed = sensitivities(moved, (), found.times, found.observed, touching=False)
        return observed.values

    slopes = np.empty_like(found.slopes)
    for j, name in enumerate(found.names):
        row = motion.system.unknown(name) or {name: 1.0}
        terms = [w * {**start, **motion.parameters}[x] for x, w in row.items()]
        size = abs(sum(terms))
        h = _DIFFERENCE * (size if size > COMPUTED_ZERO * sum(map(abs, terms)) else 1.0)
        rough, fine = (
            (values(name, s * h) - values(name, -s * h)) / (2 * s * h) for s in (1.0, 0.5)
        )
        slopes[:, :, j] = (4.0 * fine - rough) / 3.0
    return slopes
