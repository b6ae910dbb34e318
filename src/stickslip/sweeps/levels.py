"""One level of a frequency response: the request and its lines; and the result of all levels."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import NOTHING, Certificate, Residual, worst
from stickslip.equations.derive import derive
from stickslip.errors import DeclarationError
from stickslip.kept import cached_property
from stickslip.model.quantities import contact_key, described, described_as, quantity
from stickslip.model.system import System
from stickslip.motion.problem import pose
from stickslip.numerics.levels import COMPUTED_ZERO, HARMONICS_KNOWN
from stickslip.orbits.continuation.branch import Branch, SpecialPoint
from stickslip.orbits.continuation.path import Stop
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.drive_phase import phase_of_drive, relative_phase
from stickslip.orbits.fields.clock import Clock, clock
from stickslip.orbits.return_map.recurrence import SHORTEST
from stickslip.stopping.scopes import TimeUp
from stickslip.sweeps.response import FrequencyResponse
from stickslip.symbolic.expressions import Expr

if TYPE_CHECKING:
    import xarray

_COLUMNS = ("line", "amplitude", "harmonic", "phase", "stick", "period", "stable", "slips")
DIRECTIONS = ("up", "down")


def first_coordinate(system: System) -> str:
    """The first inertial coordinate, or the first one."""
    first = [x for x in system.declaration.inertial if x in system.coordinates]
    return [*first, *system.places, *system.internal][0]


@dataclass(frozen=True)
class Level:
    """Request at one level.

    Attributes
    ----------
    system, parameter, span
        As in :func:`frequency_response`; of a formula, the system has it as an output.
    coordinate : str
        Whose response it is.
    text, drive : str and Expr
        What phases are relative to.
    fixed : dict of str to float
        All parameters but the frequency.
    """

    system: System
    parameter: str
    span: tuple[float, float]
    coordinate: str
    text: str
    drive: Expr
    fixed: dict[str, float]

    @cached_property
    def distinguished_by(self) -> str:
        """Coordinate that distinguishes cycles, since an output may be equal for all."""
        first = first_coordinate(self.system)
        places = [x for x in (self.coordinate, first) if x in self.system.places]
        return [*places, self.coordinate][0]

    @cached_property
    def clock(self) -> Clock:
        """Clock of the drives."""
        values = {**self.fixed, self.parameter: self.span[1]}
        return clock(self.system, derive(self.system.declaration), values)

    def check_frequency(self) -> None:
        """Check that there is a drive whose period the parameter changes.

        Raises
        ------
        DeclarationError
            If there is no such drive.
        """
        if not derive(self.system.declaration).timed:
            raise DeclarationError(
                self.system.name, "the system has no drive", "Add a drive, such as F*cos(omega*t)"
            )
        for end in self.span:
            pose(self.system, {**self.fixed, self.parameter: end})
        ends = [{**self.fixed, self.parameter: end} for end in self.span]
        rates = [self.clock.rate(values) for values in ends]
        if not rates[0] * rates[1] > 0.0:
            raise DeclarationError(
                self.parameter, "the frequency is zero within its range", "Exclude this value"
            )
        low, high = map(self.clock.period, ends)
        if abs(high - low) <= COMPUTED_ZERO * high:
            raise DeclarationError(
                self.parameter,
                f"it does not change the period of the drives, {high:.9g}",
                "Choose the parameter that changes their frequency",
            )

    def check_phase(self) -> None:
        """Check that the drive has a phase.

        Raises
        ------
        DeclarationError
            If it has none.
        """
        self.phase_of_drive(self.span[1])

    def phase_of_drive(self, value: float) -> float:
        """Phase of the first harmonic of the drive, evaluated at the state 0.

        Raises
        ------
        DeclarationError
            If it has none.
        """
        values = {**self.fixed, self.parameter: value}
        period = self.clock.period(values)
        return phase_of_drive(self.system, (self.text, self.drive), values, period)

    def lags(self, phases: Array, values: Array) -> Array:
        """Phases relative to the drive: the first in (−3π/2, π/2], the others continuous."""
        of_drive = np.array([self.phase_of_drive(float(v)) for v in values])
        return np.unwrap(relative_phase(phases, of_drive))

    def columns(self, branch: Branch) -> dict[str, Array]:
        """Quantities of the points of a line."""
        data, x = branch.points, self.coordinate
        where = data[self.parameter].values
        # The curve is smooth except at corners.
        corner = np.zeros(len(where), np.int8)
        corner[[s.index for s in branch.special if s.kind not in ("fold", "period doubling")]] = 1
        period = data["period"].values
        shares = {
            f"stick_{contact_key(c)}": data[f"stick_time_{contact_key(c)}"].values / period
            for c in self.system.contacts
        }
        slips = [share < 1.0 - SHORTEST for share in shares.values()] or [period > 0.0]
        return {
            self.parameter: where,
            "amplitude": data[f"amplitude_{x}"].values,
            "harmonic": data[f"harmonic_{x}"].values,
            "phase": self.lags(data[f"phase_{x}"].values, where),
            "stick": data["stick_time"].values / period,
            "period": period,
            "dissipated": data["dissipated"].values,
            "stable": data["stable"].values,
            "slips": np.any(slips, axis=0).astype(np.int8),
            **shares,
            "corner": corner,
        }

    def measured(self, cycle: Cycle | str) -> dict[str, float]:
        """Values of a motion of a sweep; NaN if there is none."""
        names = ("amplitude", "harmonic", "phase", "stick", "period", "dissipated")
        if isinstance(cycle, str):
            return dict.fromkeys(names, np.nan)
        h = cycle.harmonic[self.coordinate]
        value = np.array([cycle.parameters[self.parameter]])
        numbers = (
            0.5 * float(np.ptp(cycle.visible_extrema[self.coordinate])),
            abs(h),
            float(self.lags(np.angle([h]), value)[0]),
            cycle.stick_time / cycle.period,
            cycle.period,
            cycle.dissipated,
        )
        return dict(zip(names, numbers, strict=True))


@dataclass
class Lines:
    """Result at one level: sweeps up and down in the order of the parameter, and the lines through
    their cycles."""

    wanted: Level
    grid: Array
    met: dict[str, list[Cycle | str]] = field(default_factory=dict)
    branches: list[Branch] = field(default_factory=list)
    missed: int = 0
    peak: Cycle | None = None

    @property
    def swept(self) -> list[list[Cycle | str]]:
        """Results of each sweep, at all values of the grid."""
        both: list[list[Cycle | str]] = []
        for direction in DIRECTIONS:
            met = self.met.get(direction, [])
            whole = met + ["the sweep was interrupted"] * (len(self.grid) - len(met))
            both.append(whole if direction == "up" else whole[::-1])
        return both


def response_of(
    system: System,
    fixed: dict[str, float],
    level: str,
    found: list[Lines],
    backbone: list[Cycle],
    ended: BaseException | None,
) -> FrequencyResponse:
    """The result of all levels.

    Parameters
    ----------
    found : list of Lines
        Of the levels, in their order.
    backbone : list of Cycle
        The largest responses at the levels and between them.
    ended : KeyboardInterrupt, TimeUp or None
        Cause of an early end.
    """
    wanted = found[0].wanted
    x = wanted.coordinate
    of = x if x in system.followed else quantity(wanted.system, x)["long_name"]
    special: list[SpecialPoint] = []
    notes: list[str] = []
    points = 0
    for one in found:
        at = f"{level} = {one.wanted.fixed[level]:g}: " if level else ""
        for branch in one.branches:
            special += [replace(s, index=s.index + points) for s in branch.special]
            points += branch.points.sizes["point"]
            lost = [end.text for end in branch.ends if end.stop is not Stop.RANGE]
            notes += [f"{at}a line ends: {text}" for text in lost]
        for direction, sweep in zip(DIRECTIONS, one.swept, strict=True):
            for value, cycle in zip(one.grid, sweep, strict=True):
                if isinstance(cycle, str):
                    notes.append(f"{at}{direction} at {wanted.parameter} = {value:g}: {cycle}")
    return FrequencyResponse(
        system,
        fixed,
        wanted.parameter,
        level,
        of,
        _dataset(wanted.system, level, found, backbone, of),
        special,
        notes,
        _certificate(found),
        ended is None,
        isinstance(ended, TimeUp),
    )


def _certificate(found: list[Lines]) -> Certificate:
    """Certificate of all cycles, with the accuracy of the harmonics, and whether the cycles of the
    sweeps are on the lines."""
    cycles = [c for one in found for sweep in one.swept for c in sweep if isinstance(c, Cycle)]
    branches = [branch for one in found for branch in one.branches]
    if not branches:
        return NOTHING
    own = worst([*(b.certificate for b in branches), *(c.certificate for c in cycles)])
    of = found[0].wanted.coordinate
    is_output = of in found[0].wanted.system.outputs
    errors = ["harmonics_error", *([f"harmonics_error_{of}"] if is_output else [])]
    known = max(float(b.points[name].max(skipna=False)) for b in branches for name in errors)
    missed = float(sum(one.missed for one in found))
    more = (
        Residual(
            "first harmonics",
            known,
            HARMONICS_KNOWN,
            note="change in the last refinement of the panels",
        ),
        Residual("swept motions that are not on a line", missed, 0.0),
    )
    return replace(own, residuals=(*own.residuals, *more))


def _dataset(
    system: System, level: str, found: list[Lines], backbone: list[Cycle], shown: str
) -> xarray.Dataset:
    """Points of the lines, sweeps, and the largest responses."""
    import xarray as xr

    wanted = found[0].wanted
    parameter = wanted.parameter
    attributes = _attributes(system, wanted)
    tables: list[dict[str, Array]] = []
    for one in found:
        for branch in one.branches:
            columns = one.wanted.columns(branch)
            number = np.full(len(columns["amplitude"]), len(tables))
            own = {level: np.full(len(number), one.wanted.fixed[level])} if level else {}
            tables.append({**own, "line": number, **columns})
    empty = {name: np.zeros(0) for name in (parameter, *_COLUMNS)}
    data: dict[str, Any] = {
        name: (
            "point",
            np.concatenate([t[name] for t in tables or [empty]]),
            attributes.get(name, {}),
        )
        for name in (tables[0] if tables else empty)
    }
    swept = [[[one.wanted.measured(c) for c in sweep] for sweep in one.swept] for one in found]
    for name in swept[0][0][0]:
        values = np.array([[[entry[name] for entry in sweep] for sweep in one] for one in swept])
        data[f"swept_{name}"] = ("level", "direction", "step"), values, attributes[name]
    largest = ("amplitude", "harmonic", "phase")
    peaks = [_largest(wanted, one.peak) for one in found]
    for name in (parameter, *largest):
        values = np.array([entry[name] for entry in peaks])
        data[f"peak_{name}"] = "level", values, attributes[name]
    for name in (parameter, *largest[:2], *([level] if level else [])):
        values = np.array([_largest(wanted, c)[name] for c in backbone])
        data[f"backbone_{name}"] = "backbone", values, attributes[name]
    coordinates: dict[str, Any] = {
        "direction": list(DIRECTIONS),
        f"swept_{parameter}": ("step", found[0].grid, attributes[parameter]),
    }
    if level:
        of = np.array([one.wanted.fixed[level] for one in found])
        coordinates["level"] = "level", of, attributes[level]
    about = {"title": system.title or system.name, "coordinate": shown, "drive": wanted.text}
    return xr.Dataset(data, coordinates, about)


def _largest(wanted: Level, cycle: Cycle | None) -> dict[str, float]:
    """Values of a largest response, with its parameters."""
    measured = wanted.measured("" if cycle is None else cycle)
    there = {wanted.parameter: np.nan} if cycle is None else cycle.parameters
    return {**measured, **there}


def _attributes(system: System, wanted: Level) -> dict[str, dict[str, Any]]:
    """Units and meanings."""
    x = quantity(system, wanted.coordinate)
    time = system.time_unit or "1"
    words = {-1: "neutral", 0: "unstable", 1: "stable"}
    named = {
        **{name: quantity(system, name) for name in system.parameters},
        "amplitude": {**x, "long_name": f"amplitude of {x['long_name']}"},
        "harmonic": {**x, "long_name": f"first harmonic of {x['long_name']}"},
        "phase": described_as(f"phase relative to {wanted.text}", "rad"),
        "stick": described(system, "stick_fraction"),
        **{
            f"stick_{contact_key(c)}": described(system, f"stick_fraction:{c}")
            for c in system.contacts
        },
        "period": described_as("period", time),
        "dissipated": described(system, "energy_per_cycle"),
        "slips": described_as("whether a contact slips", "1"),
        "corner": described_as("whether the curve may have a corner", "1"),
    }
    flags = {"flag_values": np.array([*words], np.int8), "flag_meanings": " ".join(words.values())}
    return {**named, "stable": flags}
