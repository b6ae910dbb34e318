"""Studies of gaits: the speed as a function of a parameter, and the thresholds of walking and of
sliding."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from stickslip.arguments import check_tolerances, validated
from stickslip.certificates import NOTHING, Certificate, worst
from stickslip.equations.derive import derive
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.model.entries.units import with_unit
from stickslip.model.quantities import quantity
from stickslip.model.system import System
from stickslip.model.system_file import SYSTEM
from stickslip.motion.outcome import Outcome
from stickslip.motion.problem import checked_values, pose
from stickslip.orbits.branches.equilibrium_branch import checked_range
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.fields.stable_set import settle_friction
from stickslip.orbits.return_map.following import follow_freely
from stickslip.progress import reporting
from stickslip.results import CERTIFICATE, PLAIN, TEXT, Completion, Result

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

State = Mapping[str, float]


@dataclass(frozen=True)
class Threshold:
    """Value of a parameter at which a system begins to move.

    Attributes
    ----------
    still, moving : float
        The two ends of the final bracket: the system rests, or has no stable gait, at `still`, and
        moves at `moving`.
    gait : Cycle or None
        The motion at `moving`, if it is a gait.
    reason : str
        Why the system does not move at `still`.
    """

    parameter: str
    still: float
    moving: float
    gait: Cycle | None
    reason: str

    @property
    def value(self) -> float:
        """Midpoint of `still` and `moving`."""
        return 0.5 * (self.still + self.moving)


@dataclass(frozen=True, eq=False, repr=False)
class GaitStudy(Result):
    """Stable gaits of a system as a parameter varies.

    Attributes
    ----------
    system : System
    parameter : str
    parameters : dict of str to float
        Values of the other parameters.
    dataset : xarray.Dataset
        Over the parameter; :func:`gait_study` lists its variables.
    certificate : Certificate
        The largest value of every residual over all gaits.
    """

    KIND: ClassVar[str] = "gait study"
    PARTS: ClassVar = {
        "system": SYSTEM,
        "parameter": TEXT,
        "parameters": PLAIN,
        "certificate": CERTIFICATE,
    }

    system: System
    parameter: str
    parameters: dict[str, float]
    dataset: xarray.Dataset
    certificate: Certificate

    def __repr__(self) -> str:
        values = self.dataset[self.parameter].values
        walks = int(np.count_nonzero(self.dataset["walks"]))
        over = f"{len(values)} values of {self.parameter}"
        return f"<GaitStudy of {self.system.name}: {over}, walks at {walks}>"

    @property
    def along(self) -> str:
        """The parameter."""
        return self.parameter

    @property
    def outcome(self) -> Completion:
        """Whether a gait was found."""
        walks = bool(np.any(self.dataset["walks"]))
        return Completion.FINISHED if walks else Completion.NOTHING_FOUND

    @property
    def message(self) -> str:
        """Range in which the system walks, and reasons for its end."""
        notes = [str(note) for note in np.unique(self.dataset["note"].values) if note]
        return "; ".join([self._walking_range, *notes])

    @property
    def _walking_range(self) -> str:
        values = self.dataset[self.parameter].values[self.dataset["walks"].values.astype(bool)]
        if not len(values):
            return "it does not walk at any value"
        return f"it walks between {self.parameter} = {values.min():.6g} and {values.max():.6g}"

    def facts(self) -> dict[str, Any]:
        """Summary as plain data."""
        columns = {str(name): self.dataset[name].values.tolist() for name in self.dataset.variables}
        return {**self.system.heading(), "parameter": self.parameter, **columns}

    def rows(self) -> list[tuple[str, str]]:
        """Summary as rows of text."""
        speed = self.dataset["speed"]
        low = f"{float(speed.min()):.6g}"
        high = with_unit(float(speed.max()), speed.attrs["units"], 6)
        return [("gait", self._walking_range), ("speed", f"{low} to {high}")]

    def overview(self, ax: Axes | None = None) -> Figure:
        """Plot speed and period against the parameter; only the speed if axes are given."""
        return self.plot("speed", ax=ax) if ax is not None else self.plot("speed", "period")


@validated
def gait_study(
    system: System,
    parameter: str,
    values: Sequence[float],
    *,
    initial: State | None = None,
    parameters: Mapping[str, float] | None = None,
    progress: Callable[[float], None] | None = None,
) -> GaitStudy:
    """Stable gaits of a system as a parameter varies.

    Parameters
    ----------
    system : System
    parameter : str
    values : sequence of float
        At least one, in the order in which the gaits are computed.
    initial : mapping of str to float, optional
        Initial state of the search for the first gait; by default the declared one. Each further
        search starts from the previous gait.
    parameters : mapping of str to float, optional
        Values of the other parameters.
    progress : callable, optional
        Called with the completed fraction before each gait.

    Returns
    -------
    GaitStudy
        Variables of its dataset over the parameter: ``walks``, ``speed``, ``period``, ``stride``
        (drift in a period), ``largest_multiplier`` (modulus), ``energy_per_distance``, and
        ``amplitude_…`` (half the range) of the states that do not drift. All are 0 if no gait was
        found; ``note`` gives the reason.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    import xarray as xr

    values = list(values)  # an iterator can be consumed only once
    if not values:
        raise DeclarationError("values", "the list is empty", "Give at least one value")
    checked_values(system, parameters)
    names = [x for x in system.declaration.state if x not in system.plain.translation]
    rows: list[dict[str, object]] = []
    certificates: list[Certificate] = []
    last: Cycle | None = None
    with reporting(progress, f"gaits of {system.name}") as show:
        for i, value in enumerate(values):
            show(i / len(values))
            system.declaration.check_range(parameter, float(value))
            found = _gait(system, last, initial, {**(parameters or {}), parameter: float(value)})
            if isinstance(found, Cycle):
                last = found
                certificates.append(found.certificate)
            rows.append(_row(found, names))
    units = {
        "speed": _drift_unit(system, rate=True),
        "stride": _drift_unit(system, rate=False),
        "period": system.time_unit,
    }
    columns = {
        name: (parameter, np.array([row[name] for row in rows]), {"units": units.get(name) or "1"})
        for name in rows[0]
    }
    for name in names:
        columns[f"amplitude_{name}"][2].update(quantity(system, name))
    unit = {"units": system.parameters[parameter].unit or "1"}
    coordinates = {parameter: (parameter, np.asarray(values, float), unit)}
    data = xr.Dataset(columns, coordinates, {"title": system.title or system.name})
    certificate = worst(certificates) if certificates else NOTHING
    fixed = {**system.values, **(parameters or {})}
    return GaitStudy(system, parameter, fixed, data, certificate)


@validated
def walking_threshold(
    system: System,
    parameter: str,
    span: tuple[float, float],
    *,
    initial: State | None = None,
    parameters: Mapping[str, float] | None = None,
    tolerance: float = 1e-6,
) -> Threshold:
    """Find the parameter value at which the stable gait appears.

    The gait is followed from the end of the range at which it exists, so that a gait that coexists
    with rest is not lost.

    Parameters
    ----------
    system : System
    parameter : str
    span : (float, float)
        A range with a gait at one end only.
    initial : mapping of str to float, optional
        Initial state of the search for the gait; by default the declared one.
    parameters : mapping of str to float, optional
        Values of the other parameters.
    tolerance : float
        Final distance of `still` and `moving`, relative to the range.

    Raises
    ------
    DeclarationError
        If an argument is wrong, or both ends have the same behaviour.
    """

    def test(value: float, last: Cycle | None) -> Cycle | str:
        return _gait(system, last, initial, {**(parameters or {}), parameter: value})

    return _bisect(system, parameter, span, test, tolerance)


@validated
def sliding_threshold(
    system: System,
    parameter: str,
    span: tuple[float, float],
    *,
    initial: State,
    parameters: Mapping[str, float] | None = None,
    tolerance: float = 1e-6,
) -> Threshold:
    """Find the parameter value at which a state of rest begins to slide.

    Parameters
    ----------
    system : System
    parameter : str
    span : (float, float)
        A range with rest at one end and sliding at the other.
    initial : mapping of str to float
        The state of rest.
    parameters, tolerance
        As in :func:`walking_threshold`.

    Raises
    ------
    DeclarationError
        If an argument is wrong, or both ends have the same behaviour.
    """

    def test(value: float, last: Cycle | None) -> Cycle | str | None:
        problem = pose(system, {**(parameters or {}), parameter: value})
        motion = follow_freely(problem, *system.span, problem.initial_state(initial))
        # Mode 0 is stick. Without a bounded rate the system slips immediately.
        slides = motion.outcome is Outcome.NO_BOUNDED_RATE or bool(np.any(motion.knots.mode))
        return None if slides else "all contacts stick"

    return _bisect(system, parameter, span, test, tolerance)


def _bisect(
    system: System,
    parameter: str,
    span: tuple[float, float],
    test: Callable[[float, Cycle | None], Cycle | str | None],
    tolerance: float,
) -> Threshold:
    """Bisect the span.

    Parameters
    ----------
    test : callable
        Function of a parameter value and the gait at the previous moving end. Returns a reason
        (str) if the system does not move; otherwise the gait, or None if the motion is not one.
    """
    check_tolerances(tolerance=tolerance)
    low, high = checked_range(system, parameter, span)
    at_low, at_high = test(low, None), test(high, None)
    if isinstance(at_low, str) and not isinstance(at_high, str):
        still, reason, moving, gait = low, at_low, high, at_high
    elif isinstance(at_high, str) and not isinstance(at_low, str):
        still, reason, moving, gait = high, at_high, low, at_low
    else:
        why = (
            f"the system stays at rest at both ends of the range ({at_low})"
            if isinstance(at_low, str)
            else "the system moves at both ends of the range"
        )
        raise DeclarationError(
            parameter, f"{why}: ({low:g}, {high:g})", "Choose a range in which this changes"
        )
    while abs(moving - still) > tolerance * (high - low):
        middle = 0.5 * (still + moving)
        if middle in (still, moving):
            break  # no number is in between
        found = test(middle, gait)
        if isinstance(found, str):
            still, reason = middle, found
        else:
            moving, gait = middle, found
    return Threshold(parameter, still, moving, gait, reason)


def _gait(
    system: System, last: Cycle | None, start: State | None, values: Mapping[str, float]
) -> Cycle | str:
    """The stable gait, or the reason why none was found.

    If the previous gait `last` is given, the search starts from this cycle and then, should it
    fail, from the motion that begins in its state; otherwise from the motion that begins at
    `start`.
    """
    state = _admissible(system, last.state if last else start, values)
    reason = ""
    for origin in [last, state] if last else [state]:
        try:
            found = find_cycle(system, origin, parameters=dict(values))
        except ConvergenceError as failure:
            reason = str(failure)
            continue
        if not found.drift:
            fault = "no gait"
        elif not found.stable:
            fault = "unstable"
        elif not found.trajectory.certificate.ok:
            fault = "not certified"
        else:
            return found
        reason = f"a cycle of period {found.period:.6g} that is {fault}"
    return reason


def _admissible(
    system: System, start: State | None, values: Mapping[str, float]
) -> dict[str, float]:
    """Move the rate-independent coordinates of a start into their stable set."""
    problem = pose(system, values)
    y = problem.initial_state(start or {})[None]
    settle_friction(derive(system.declaration), problem.parameters, y)
    return dict(zip(system.declaration.state, map(float, y[0]), strict=True))


def _row(found: Cycle | str, names: list[str]) -> dict[str, object]:
    """Row of the dataset for a gait, or for the reason why there is none."""
    amplitudes = {f"amplitude_{x}": 0.0 for x in names}
    if isinstance(found, str):
        numbers = ("speed", "period", "stride", "largest_multiplier", "energy_per_distance")
        return {"walks": False, **dict.fromkeys(numbers, 0.0), **amplitudes, "note": found}
    for x in names:
        low, high = found.extrema[x]
        amplitudes[f"amplitude_{x}"] = 0.5 * (high - low)
    return {
        "walks": True,
        "speed": found.speed,
        "period": found.period,
        "stride": found.drift,
        "largest_multiplier": float(np.max(np.abs(found.nontrivial), initial=0.0)),
        "energy_per_distance": found.energy_per_distance,
        **amplitudes,
        "note": "",
    }


def _drift_unit(system: System, *, rate: bool) -> str:
    """Unit of the drift of a gait, or of its speed."""
    name = next((x for x, weight in system.plain.translation.items() if weight), "")
    return quantity(system, f"d_{name}" if rate else name).get("units", "1") if name else "1"
