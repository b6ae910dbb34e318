"""Studies of gaits: the speed as a function of a parameter, and the thresholds of walking and of
sliding."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from stickslip.arguments import validated
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
    """Threshold of a parameter at which a system begins to move.

    Attributes
    ----------
    still, moving : float
        The values found nearest to each other, without and with motion.
    gait : Cycle or None
        The motion at `moving`, if it is a gait.
    reason : str
        What happens at `still`.
    """

    parameter: str
    still: float
    moving: float
    gait: Cycle | None
    reason: str

    @property
    def value(self) -> float:
        """The middle of the two."""
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
        Over the parameter.
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
        return "; ".join([self._where, *notes])

    @property
    def _where(self) -> str:
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
        return [("gait", self._where), ("speed", f"{low} to {high}")]

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
    initial : mapping of str to float, optional
        Initial state of the search for the first gait; by default the declared one. Each further
        search starts from the previous gait.
    parameters : mapping of str to float, optional
        Values of the others.
    progress : callable, optional
        Called with the completed fraction before each gait.

    Returns
    -------
    GaitStudy
        Its dataset has over the parameter: ``walks``, and ``speed``, ``period``, ``stride`` (drift
        in a period), ``largest_multiplier`` (modulus), ``energy_per_distance`` and ``amplitude_…``
        (half the range) of the states that do not drift. All are 0 if no gait was found; ``note``
        gives the reason.

    Raises
    ------
    DeclarationError
        If an argument is wrong.
    """
    import xarray as xr

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
        "speed": _along_unit(system, True),
        "stride": _along_unit(system, False),
        "period": system.time_unit,
    }
    data = {
        name: (parameter, np.array([row[name] for row in rows]), {"units": units.get(name) or "1"})
        for name in rows[0]
    }
    for name in names:
        data[f"amplitude_{name}"][2].update(quantity(system, name))
    coordinate = (
        parameter,
        np.asarray(values, float),
        {"units": system.parameters[parameter].unit or "1"},
    )
    data = xr.Dataset(data, {parameter: coordinate}, {"title": system.title or system.name})
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
        Values of the others.
    tolerance : float
        Tolerance of the parameter, relative to the range.

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
    """Bisect the span; `test` returns a reason (str) if nothing moves."""
    ends = checked_range(system, parameter, span)
    low, high = (test(end, None) for end in ends)
    if isinstance(low, str) == isinstance(high, str):
        what = (
            f"the system stays at rest at both ends of the range ({low})"
            if isinstance(low, str)
            else "the system moves at both ends of the range"
        )
        raise DeclarationError(
            parameter, f"{what}: ({ends[0]:g}, {ends[1]:g})", "Choose a range in which this changes"
        )
    (still, reason), (moving, motion) = sorted(
        zip(ends, (low, high), strict=True), key=lambda e: not isinstance(e[1], str)
    )
    while abs(moving - still) > tolerance * (ends[1] - ends[0]):
        middle = 0.5 * (still + moving)
        found = test(middle, motion if isinstance(motion, Cycle) else None)
        if isinstance(found, str):
            still, reason = middle, found
        else:
            moving, motion = middle, found
    return Threshold(
        parameter, still, moving, motion if isinstance(motion, Cycle) else None, str(reason)
    )


def _gait(
    system: System, last: Cycle | None, start: State | None, values: Mapping[str, float]
) -> Cycle | str:
    """The stable gait near the last one, otherwise that of the motion from there or from the
    start."""
    starts = [*([last] if last else []), _held(system, last.state if last else start, values)]
    reason = ""
    for origin in starts:
        try:
            found = find_cycle(system, origin, parameters=dict(values))
        except ConvergenceError as failure:
            reason = str(failure)
            continue
        if found.drift and found.stable and found.trajectory.certificate.ok:
            return found
        reason = f"a cycle of period {found.period:.6g} that is " + (
            "not certified"
            if found.drift and found.stable
            else "unstable"
            if found.drift
            else "no gait"
        )
    return reason


def _held(system: System, start: State | None, values: Mapping[str, float]) -> dict[str, float]:
    """A start in the stable set of the rate-independent coordinates."""
    problem = pose(system, values)
    y = problem.initial_state(start or {})[None]
    settle_friction(derive(system.declaration), problem.parameters, y)
    return dict(zip(system.declaration.state, map(float, y[0]), strict=True))


def _row(found: Cycle | str, names: list[str]) -> dict[str, object]:
    """Numbers of a gait."""
    if isinstance(found, str):
        zero = dict.fromkeys(
            ["speed", "period", "stride", "largest_multiplier", "energy_per_distance"], 0.0
        )
        return {
            "walks": False,
            **zero,
            **dict.fromkeys([f"amplitude_{x}" for x in names], 0.0),
            "note": found,
        }
    return {
        "walks": True,
        "speed": found.speed,
        "period": found.period,
        "stride": found.drift,
        "largest_multiplier": float(np.max(np.abs(found.nontrivial), initial=0.0)),
        "energy_per_distance": found.energy_per_distance,
        **{f"amplitude_{x}": 0.5 * (found.extrema[x][1] - found.extrema[x][0]) for x in names},
        "note": "",
    }


def _along_unit(system: System, rate: bool) -> str:
    """Unit of a shift along the translation, or of its rate."""
    name = next((x for x, weight in system.plain.translation.items() if weight), "")
    return quantity(system, f"d_{name}" if rate else name).get("units", "1") if name else "1"
