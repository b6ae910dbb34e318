"""The plan of a map: maps with equal plans contain the same numbers."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from stickslip.errors import some
from stickslip.model.entries.declared import Kind
from stickslip.model.quantities import (
    MEASURABLE,
    described,
    described_as,
    quantity,
    unit_of_measures,
)
from stickslip.model.system import System
from stickslip.motion.outcome import Outcome
from stickslip.sweeps.request.axes import Axis
from stickslip.sweeps.request.carry import CARRIED, DIRECTION, Carry, direction_attributes
from stickslip.sweeps.request.measures import MISSING, certified_below
from stickslip.sweeps.request.records import Driven
from stickslip.sweeps.request.user_measures import REASONS, FormulaMeasure, Measure, variable
from stickslip.symbolic.enclosures import bounds

NOT_COMPUTED = -1
INTERPOLATED = -2
"""Outcomes of points that have none of their own."""

KIND = "sweep"
FORMAT = 2
LABELS = "labels"  # attribute of an axis with the names of records


class Part(Enum):
    """Parts in which two maps may differ, by the key under which they are stored."""

    MODEL = "model"
    SETTINGS = "settings"
    CARRY = "carry"
    SPAN = "span"
    INITIAL = "initial"
    MEASURES = "measures"
    VERSION = "version"
    AXES = "axes"
    VALUES = "values"


class Difference(NamedTuple):
    """A difference between a stored map and another, with its description."""

    part: Part
    text: str


@dataclass(frozen=True, eq=False)
class Plan:
    """The request of a map: a system, its axes, measures and settings.

    Attributes
    ----------
    initial : dict of str to float
        Initial values that hold at all points.
    settings : Settings
        Criteria for settled motions, and the accuracy.
    seed : int
        Of the samples.
    section : bool
        Whether the points are states of a section: they share their parameters, and a state outside
        the stable set starts at the nearest stable state.
    carry : Carry, optional
        Axis along which points start from the final state of the previous one.
    driven : Driven, optional
        Records that are an axis; `system` is then driven by the first of them.
    """

    system: System
    axes: tuple[Axis, ...]
    measures: tuple[Measure, ...]
    initial: Mapping[str, float]
    settings: Any
    seed: int
    section: bool = False
    carry: Carry | None = None
    driven: Driven | None = None

    @property
    def model(self) -> str:
        """The model file of the system, or of the system that records drive."""
        return (self.driven.base if self.driven else self.system).to_toml()

    def parts(self) -> dict[str, str]:
        """All parts except the values of the axes, as texts for a file."""
        from stickslip import __version__

        return {
            "kind": KIND,
            "format": str(FORMAT),
            "version": __version__,
            "model": self.model,
            "parameters": json.dumps(self.system.values),
            "axes": json.dumps(
                [{"names": axis.names, "spacing": axis.spacing} for axis in self.axes]
            ),
            "measures": json.dumps([str(measure) for measure in self.measures]),
            "initial": json.dumps(dict(self.initial)),
            "settings": json.dumps(asdict(self.settings), sort_keys=True),
            "seed": str(self.seed),
            **({} if self.carry is None else {"carry": self.carry.text}),
            **({} if self.driven is None else {"span": json.dumps(self.driven.span)}),
            **({} if self.driven is None else {"left_out": json.dumps(self.driven.left_out())}),
        }

    def difference(self, parts: Mapping[str, str], axes: tuple[Axis, ...]) -> Difference | None:
        """Difference of a stored map from this one, if any.

        Parameters
        ----------
        parts : mapping of str to str
            Of the stored map.
        axes : tuple of Axis
            Of the stored map.
        """
        own = self.parts()
        model = _first_difference(tomllib.loads(parts["model"]), tomllib.loads(own["model"]))
        if model:
            return Difference(Part.MODEL, f"of another model ({model})")
        for part, what in (
            (Part.SETTINGS, "other settings"),
            (Part.INITIAL, "other initial values"),
        ):
            change = _first_difference(json.loads(parts[part.value]), json.loads(own[part.value]))
            if change:
                return Difference(part, f"with {what} ({change})")
        spans = [json.loads(part.get("span", "null")) for part in (parts, own)]
        if spans[0] != spans[1]:
            there, here = (span or "that of each record" for span in spans)
            return Difference(Part.SPAN, f"over another time span (stored {there}, now {here})")
        carries = [part.get("carry", "") for part in (parts, own)]
        if carries[0] != carries[1]:
            there, here = (f"along {text}" if text else "not at all" for text in carries)
            text = f"that is carried differently (stored {there}, now {here})"
            return Difference(Part.CARRY, text)
        if parts["measures"] != own["measures"]:
            there, here = (
                ", ".join(json.loads(texts)) for texts in (parts["measures"], own["measures"])
            )
            return Difference(Part.MEASURES, f"of other measures (stored {there}, now {here})")
        if parts["version"] != own["version"]:
            return Difference(
                Part.VERSION, f"made by version {parts['version']} (this is {own['version']})"
            )
        return self._other_axes(axes)

    def _other_axes(self, axes: tuple[Axis, ...]) -> Difference | None:
        there, here = ([",".join(axis.names) for axis in some] for some in (axes, self.axes))
        if there != here:
            text = f"over other axes (stored {' and '.join(there)}, now {' and '.join(here)})"
            return Difference(Part.AXES, text)
        for old, new in zip(axes, self.axes, strict=True):
            if not old.same_as(new):
                names = ",".join(new.names)
                text = f"over other values of {names} (stored {_range(old)}, now {_range(new)})"
                return Difference(Part.VALUES, text)
        return None

    def coordinates(self) -> dict[str, tuple[str, np.ndarray, dict[str, Any]]]:
        """Dimension, values and attributes of all varying names."""
        return {
            name: (
                axis.dimension,
                axis.values[row],
                {**_varied(self.system, name, axis), "spacing": axis.spacing},
            )
            for axis in self.axes
            for row, name in enumerate(axis.names)
        }

    def _ends(self, measure: FormulaMeasure) -> dict[str, float]:
        """Bounds of a formula that follow from those of its measures and parameters."""
        ranges: dict[str, tuple[float, float]] = {}
        for name in measure.expression.symbols:
            if (known := self.system.declaration.ranges.get(name)) is not None:
                ranges[name] = known.low, known.high
            elif (said := MEASURABLE.get(name.partition(":")[0])) is not None:
                low, high = said.least, said.most
                ranges[name] = -np.inf if low is None else low, np.inf if high is None else high
        ends = zip(("valid_min", "valid_max"), bounds(measure.expression, ranges), strict=True)
        return {key: float(end) for key, end in ends if np.isfinite(end)}

    def variables(self) -> dict[str, tuple[str, float, dict[str, Any]]]:
        """Type, fill value and attributes of all stored variables.

        The outcome comes last: a point with an outcome has all other values.
        """
        found: dict[str, tuple[str, float, dict[str, Any]]] = {}
        for measure in self.measures:
            name = variable(measure)
            if isinstance(measure, str):
                found[name] = ("f8", np.nan, described(self.system, measure))
                continue
            unit, ends = "1", dict[str, float]()
            if isinstance(measure, FormulaMeasure):
                unit, ends = unit_of_measures(self.system, measure.expression), self._ends(measure)
            said = described_as(name.replace("_", " "), unit)
            found[name] = ("f8", np.nan, {**said, **ends, "measure": str(measure)})
            why = _flags(dict(enumerate(REASONS))) | {"long_name": f"reason why {name} is missing"}
            found[f"{name}_missing"] = ("i1", 0, why)
        if self.carry is not None:
            for name, about in {
                "time": quantity(self.system, "t"),
                **{x: quantity(self.system, x) for x in self.system.declaration.state},
            }.items():
                meaning = f"{about['long_name']} at which the next point continues"
                found[f"{CARRIED}{name}"] = ("f8", np.nan, {**about, "long_name": meaning})
        tolerance = certified_below(self.settings)
        found["certificate"] = (
            "f8",
            np.nan,
            {"units": "1", "long_name": "residual of the certificate", "tolerance": tolerance},
        )
        missing = _flags(dict(enumerate(MISSING))) | {
            "long_name": "failed criterion of the certificate"
        }
        found["lacking"] = ("i1", MISSING.index("result"), missing)
        unit = (
            next(
                (
                    c.unit
                    for c in self.system.declaration.contacts
                    if c.kind == Kind.RATE_INDEPENDENT
                ),
                "",
            )
            or "1"
        )
        found["excess"] = (
            "f8",
            np.nan,
            {"units": unit, "long_name": "excess of the start over the stable set"},
        )
        labels = {
            NOT_COMPUTED: "not computed",
            INTERPOLATED: "interpolated",
            **{o.code: o.label for o in Outcome},
        }
        found["outcome"] = (
            "i1",
            NOT_COMPUTED,
            _flags(labels) | {"long_name": "how the motion ended"},
        )
        return found


def _flags(labels: Mapping[int, str]) -> dict[str, Any]:
    """Attributes of a variable that holds codes, by the CF conventions."""
    return {
        "flag_values": list(labels),
        "flag_meanings": " ".join(text.replace(" ", "_") for text in labels.values()),
    }


def _varied(system: System, name: str, axis: Axis) -> dict[str, Any]:
    """Unit and meaning of a parameter, of an initial value, of records, or of the direction of a
    sweep."""
    if axis.labels:
        return {"long_name": name.replace("_", " "), LABELS: list(axis.labels)}
    if name == DIRECTION and name not in {*system.parameters, *system.declaration.state}:
        return direction_attributes()
    found = quantity(system, name)
    return (
        found
        if name in system.parameters
        else {**found, "long_name": f"initial {found['long_name']}"}
    )


def _first_difference(there: Any, here: Any, where: str = "") -> str:
    """First difference of two trees of tables."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in [*there, *(key for key in here if key not in there)]:
            inner = f"{where}.{key}" if where else key
            if key not in here or key not in there:
                return f"{inner}: only {'in the stored one' if key in there else 'in the new one'}"
            found = _first_difference(there[key], here[key], inner)
            if found:
                return found
        return ""
    return "" if there == here else f"{where}: stored {there}, now {here}"


def _range(axis: Axis) -> str:
    values = axis.values[0]
    if axis.labels:
        return f"{len(axis)}: {some(list(axis.labels), 6)}"
    return f"{len(axis)} from {values[0]:g} to {values[-1]:g}"
