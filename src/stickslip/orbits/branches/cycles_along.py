"""The cycles along a curve: distances of neighbours, their certificate, and their table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.certificates import Certificate, Residual, worst
from stickslip.model.quantities import contact_key, described, quantity
from stickslip.orbits.continuation.corrector import Lost
from stickslip.orbits.continuation.path import in_range, ranges
from stickslip.orbits.return_map.recurrence import modes_of_structures

if TYPE_CHECKING:
    import xarray

    from stickslip.model.system import System
    from stickslip.orbits.cycles.cycle import Cycle

APART = 0.3  # largest distance of neighbours on a branch …
TWICE = 1e-10  # … and smallest one: nearer cycles are regarded as one
_STEP = {
    "long_name": "distance from the previous point: largest change of parameter, period and "
    "ranges, relative to those of the branch"
}
_MEANINGS = {
    "period": "period",
    "stick_time": "time in which all contacts stick",
    "slip_time": "time in which a contact slips",
    "dissipated": "energy dissipated per period",
    "supplied": "energy supplied per period",
    "drift": "shift per period",
    "energy_per_distance": "mean friction (energy per distance)",
}
_STABLE = {"flag_values": np.array([-1, 0, 1], np.int8), "flag_meanings": "neutral unstable stable"}


class Spacing:
    """Distance of cycles of a branch: the largest change of parameters, period and ranges of the
    state.

    Parameters are measured in their ranges, ranges of the state in the largest modulus of their
    component up to now; those of the modes of a structure, which are components of one vector, in
    the largest of all of them.

    Parameters
    ----------
    modulus : array, shape (n,)
        Size of each component of the state.
    """

    def __init__(self, spans: Mapping[str, tuple[float, float]], modulus: Array) -> None:
        self.spans = spans
        self.largest: Array = modulus.copy()

    def __call__(self, a: Cycle, b: Cycle) -> float:
        widths = []
        for cycle in (a, b):
            low, high = cycle.ranges.T
            self.largest = np.maximum(self.largest, np.maximum(np.abs(low), np.abs(high)))
            widths.append(high - low)
        parts = [
            (b.parameters[x] - a.parameters[x]) / (high - low)
            for x, (low, high) in self.spans.items()
        ]
        units = self.largest.copy()
        for own in modes_of_structures(b.trajectory.problem):
            units[own] = np.max(units[own])
        grown = np.abs((widths[1] - widths[0]) / units)
        return max(float(grown.max()), abs(math.log(b.period / a.period)), *map(abs, parts))

    def check(self, last: Cycle, new: Cycle) -> None:
        """Check that a cycle is certified and close to the previous one.

        Raises
        ------
        Lost
            If it is not.
        """
        if not new.certificate.ok:
            raise Lost(f"the next cycle is {new.certificate.verdict}")
        if not self(last, new) <= APART:
            raise Lost("the next cycle is a different one")


def of_branch(
    cycles: list[Cycle], spans: Mapping[str, tuple[float, float]], steps: Array
) -> Certificate:
    """The certificate of a branch: that of its cycles, all in range, neighbours next to each other
    and none twice.

    Parameters
    ----------
    spans : mapping of str to (float, float)
        The range of each parameter.
    steps : array
        Distance of each cycle from the previous one; that of the first is meaningless.
    """
    own = [
        in_range(
            ranges(spans),
            [np.array([cycle.parameters[name] for name in spans]) for cycle in cycles],
        ),
        Residual("largest step", float(np.max(steps[1:], initial=0.0)), APART),
        *(
            [Residual("smallest step", float(np.min(steps[1:])), TWICE, least=True)]
            if len(steps) > 1
            else []
        ),
    ]
    found = worst([cycle.certificate for cycle in cycles])
    return replace(found, residuals=(*found.residuals, *own))


def dataset(parameters: Iterable[str], cycles: list[Cycle], steps: Array) -> xarray.Dataset:
    """Parameters, period, extremes, multipliers, stability, stick and slip, forces, drift,
    certificate and distance from the previous point; for driven cycles the first harmonic of every
    coordinate."""
    import xarray as xr

    system = cycles[0].system
    units = _units(cycles[0])

    def measured(name: str) -> Any:
        said = {"long_name": _MEANINGS[name]} if name in _MEANINGS else {}
        return _column((getattr(c, name) for c in cycles), units=units[name], **said)

    data: dict[str, Any] = {
        name: _column((c.parameters[name] for c in cycles), **quantity(system, name))
        for name in parameters
    }
    data |= {name: measured(name) for name in ("period", "time")}
    data |= _extremes(system, cycles)
    if cycles[0].closed.shooting.symmetry.driven:
        data |= _harmonics(system, cycles)
    data |= _stability(cycles)
    sums = ["stick_time", "slip_time", "dissipated", "supplied", "drift", "speed"]
    if any(c.drift for c in cycles):
        sums.append("energy_per_distance")
    data |= {name: measured(name) for name in sums}
    data["residual"] = _column(c.residual for c in cycles)
    data["certified"] = "point", np.array([c.certificate.ok for c in cycles], np.int8)
    data["step"] = "point", steps, _STEP
    data |= _peaks(system, cycles)
    data |= _times(system, cycles)
    return xr.Dataset(data, attrs={"title": system.title or system.name, "kind": "cycles"})


def _column(values: Iterable[float], **attributes: str) -> tuple[str, Array, dict[str, str]]:
    """A number of every point."""
    return "point", np.array([*values], dtype=float), attributes


def _units(cycle: Cycle) -> dict[str, str]:
    """The units of the measures of a cycle."""
    time, energy = cycle.units["time"], cycle.units["energy"]
    own = {name: cycle.units[name] for name in ("drift", "speed", "energy_per_distance")}
    times = dict.fromkeys(("period", "time", "stick_time", "slip_time"), time)
    return {**own, **times, **dict.fromkeys(("dissipated", "supplied"), energy)}


def _extremes(system: System, cycles: list[Cycle]) -> dict[str, Any]:
    """The state at the beginning of every cycle, and its ranges."""
    data: dict[str, Any] = {}
    for name in system.declaration.state:
        what = quantity(system, name)
        data[name] = _column((c.state[name] for c in cycles), **what)
        if name in cycles[0].visible_extrema:
            ends = np.array([c.visible_extrema[name] for c in cycles])
            data[f"min_{name}"] = _column(ends[:, 0], **what)
            data[f"max_{name}"] = _column(ends[:, 1], **what)
    for name in system.followed:
        half = (0.5 * float(np.ptp(c.visible_extrema[name])) for c in cycles)
        data[f"amplitude_{name}"] = _column(half, **described(system, f"amplitude:{name}"))
    return data


def _stability(cycles: list[Cycle]) -> dict[str, Any]:
    """Multipliers, and the kind of every cycle."""
    multipliers: Any = np.array([c.multipliers for c in cycles])
    stable = np.array([-1 if c.neutral else int(c.stable) for c in cycles], np.int8)
    return {
        "stable": ("point", stable, _STABLE),
        "multiplier_real": (("point", "multiplier"), multipliers.real),
        "multiplier_imag": (("point", "multiplier"), multipliers.imag),
        "differentiable": ("point", np.array([c.differentiable for c in cycles], np.int8)),
        "sticks": ("point", np.array([c.sticks for c in cycles], np.int8)),
        "phases": ("point", np.array([len(c.phases) for c in cycles])),
    }


def _peaks(system: System, cycles: list[Cycle]) -> dict[str, Any]:
    """The largest force of every contact."""
    data: dict[str, Any] = {}
    equations = cycles[0].trajectory.problem.compiled.equations
    for i, contact in enumerate(equations.contacts):
        if contact.plane > 1 or contact.side_of:
            continue  # the first component represents both
        peaks = [c.sums.peak[i] for c in cycles]
        if contact.opens:
            what = quantity(system, contact.name)
            what = {**what, "long_name": f"largest {what.get('long_name', contact.name)}"}
            data[f"peak_{contact.name}"] = _column(peaks, **what)
        else:
            name = equations.labels[i]
            force = described(system, f"peak_force:{name}")
            data[f"peak_force_{contact_key(name)}"] = _column(peaks, **force)
    return data


def _times(system: System, cycles: list[Cycle]) -> dict[str, Any]:
    """Time in which each contact sticks, and is open."""
    data: dict[str, Any] = {}
    unit = cycles[0].units["time"]
    for name in cycles[0].contacts:
        times = {"stick_time": f"time in which {name} sticks"}
        if name in system.unilateral:
            times["open_time"] = f"time in which {name} is open"
        for part, said in times.items():
            lasted = (getattr(c.contacts[name], part) for c in cycles)
            data[f"{part}_{contact_key(name)}"] = _column(lasted, units=unit, long_name=said)
    return data


def _harmonics(system: System, cycles: list[Cycle]) -> dict[str, Any]:
    """Modulus and phase of the first harmonic of every coordinate of driven cycles, and their
    error."""
    data: dict[str, Any] = {}
    for name in system.followed:
        c = np.array([cycle.harmonic[name] for cycle in cycles])
        what = quantity(system, name)
        text = f"first harmonic of {what['long_name']}"
        data[f"harmonic_{name}"] = "point", np.abs(c), {**what, "long_name": text}
        phase = {"units": "rad", "long_name": f"phase of the {text}"}
        data[f"phase_{name}"] = "point", np.angle(c), phase
        if all(name in cycle.relative_phase for cycle in cycles):
            own = np.unwrap([cycle.relative_phase[name] for cycle in cycles])
            meaning = {**phase, "long_name": f"{phase['long_name']}, relative to the drive"}
            data[f"relative_phase_{name}"] = "point", own, meaning
    for name, ending in {"": "", **{name: f"_{name}" for name in system.outputs}}.items():
        errors = np.array([c._harmonics[1][name] for c in cycles])
        data[f"harmonics_error{ending}"] = "point", errors
    return data
