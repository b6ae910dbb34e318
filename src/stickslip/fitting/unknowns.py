"""Unknowns of a fit: parameters and initial values, with bounds and start values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, suggestion
from stickslip.model.quantities import quantity
from stickslip.model.system import System

if TYPE_CHECKING:
    from stickslip.fitting.recording import Recording

FreeRange = tuple[float, float] | None
_WIDE = 10.0  # ratio of positive bounds above which the search uses the logarithm
_AROUND = 10.0  # factor over which starts are spread if there are no bounds


@dataclass(frozen=True)
class Unknown:
    """A parameter, or an initial value of one record.

    Attributes
    ----------
    low, high : float
        Between which it is looked for.
    record : int
        Whose initial value it is; −1: a parameter, of all records.
    label : str
        Its name, with the number of the record if there are several.
    unit : str
    box : (float, float)
        In which starts are spread.
    logarithmic : bool
        Whether its logarithm is searched.
    """

    name: str
    low: float
    high: float
    start: float
    record: int
    label: str
    unit: str
    box: tuple[float, float]
    logarithmic: bool

    def to_search(self, value: Any) -> Any:
        """The value in the coordinate of the search."""
        return np.log(value) if self.logarithmic else value

    def from_search(self, coordinate: Any) -> Any:
        """The value for a coordinate of the search."""
        return np.exp(coordinate) if self.logarithmic else coordinate

    @property
    def searched(self) -> tuple[float, float]:
        """Range of the coordinate of the search."""
        if not self.logarithmic:
            return self.low, self.high
        return (math.log(self.low) if self.low > 0.0 else -math.inf, math.log(self.high))


def read_unknowns(
    system: System,
    free: Mapping[str, FreeRange] | Iterable[str],
    records: tuple[Recording, ...],
    given: Mapping[str, float],
) -> tuple[Unknown, ...]:
    """The unknowns of a fit.

    Parameters
    ----------
    free : mapping of str to (float, float) or None, or names
        Parameters, and components of the state, or degrees of freedom of structures, for their
        initial values, with bounds; by default the declared ranges.
    given : mapping of str to float
        Values of parameters that replace the defaults: the start of the fit.

    Raises
    ------
    DeclarationError
        If no parameter is free, a name is unknown or also fixed in a record, or bounds are invalid.
    """
    table = dict(free) if isinstance(free, Mapping) else dict.fromkeys(free)
    if not table:
        raise DeclarationError(
            "free", "there are no unknowns to fit", 'Give the unknowns, like {"k": (1, 10)}'
        )
    for record in records:
        system.check_starts([*record.initial, *table], "free")
    found: list[Unknown] = []
    for name, bounds in table.items():
        if name in system.parameters:
            fixed = [r.source for r in records if name in r.parameters]
            if fixed:
                raise DeclarationError(
                    f"free.{name}",
                    f"its value is given by {fixed[0]}",
                    "Remove the fixed value, or do not fit it",
                )
            found.append(_parameter(system, name, bounds, given))
        elif system.start_slope(name, "free"):
            found += [_initial(system, name, bounds, r, records) for r in range(len(records))]
        else:
            known = suggestion(name, [*system.parameters, *system.starts])
            raise DeclarationError(f"free.{name}", "unknown parameter or part of the state", known)
    return tuple(found)


def _parameter(system: System, name: str, bounds: FreeRange, given: Mapping[str, float]) -> Unknown:
    declared = system.plain.declaration.ranges[name]
    low, high = checked_bounds(name, bounds, (declared.low, declared.high))
    value = float(given.get(name, system.values[name]))
    if not low <= value <= high:
        if name in given:
            raise DeclarationError(
                f"parameters.{name}",
                f"the start {value:g} is outside the bounds {low:g} to {high:g}",
                "Choose a start within the bounds",
            )
        value = middle(low, high)
    positive = low >= 0.0 and value > 0.0 and not (low == 0.0 and declared.closed[0])
    logarithmic = positive and (low == 0.0 or high / low >= _WIDE)
    unit = quantity(system, name).get("units", "1")
    box = _box(low, high, value, abs(value) or 1.0)
    return Unknown(name, low, high, value, -1, name, unit, box, logarithmic)


def _initial(
    system: System, name: str, bounds: FreeRange, r: int, records: tuple[Recording, ...]
) -> Unknown:
    if name in records[r].initial:
        raise DeclarationError(
            f"free.{name}",
            f"its value is given by {records[r].source}, {records[r].initial[name]}",
            "Remove the given value, or do not fit it; the search starts from the declared initial "
            "value",
        )
    begun = system.plain.initial
    row = system.unknown(name) or {name: 1.0}
    value = float(sum(weight * begun.get(part, 0.0) for part, weight in row.items()))
    low, high = checked_bounds(name, bounds, (-math.inf, math.inf))
    if not low <= value <= high:
        value = middle(low, high)
    label = name if len(records) == 1 else f"{name}[{r + 1}]"
    unit = quantity(system, name).get("units", "1")
    return Unknown(name, low, high, value, r, label, unit, _box(low, high, value, 1.0), False)


def checked_bounds(name: str, bounds: Any, declared: tuple[float, float]) -> tuple[float, float]:
    """Check a range of an unknown: it must be within the declared one, which is the default."""
    if bounds is None:
        return declared
    try:
        low, high = (float(b) for b in cast(Any, bounds))
    except (TypeError, ValueError, OverflowError):
        low, high = math.nan, math.nan
    if not low < high:
        raise DeclarationError(
            f"free.{name}", f"{bounds!r} is not a pair of bounds", "Give (low, high), or None"
        )
    if low < declared[0] or high > declared[1]:
        raise DeclarationError(
            f"free.{name}",
            f"the bounds {low:g} to {high:g} exceed the declared range {declared[0]:g} to "
            f"{declared[1]:g}",
            "Give bounds within this range",
        )
    return low, high


def middle(low: float, high: float) -> float:
    """A value between bounds."""
    if math.isinf(low) or math.isinf(high):
        return 1.0 + low if math.isfinite(low) else high - 1.0 if math.isfinite(high) else 0.0
    return math.sqrt(low * high) if low > 0.0 and high / low >= _WIDE else 0.5 * (low + high)


def _box(low: float, high: float, value: float, size: float) -> tuple[float, float]:
    """The box of starts: the bounds, or a neighbourhood of the given start if there are none."""
    if low >= 0.0 and value > 0.0:
        below, above = value / _AROUND, value * _AROUND
    else:
        below, above = value - 2.0 * size, value + 2.0 * size
    # A lower bound of zero does not bound the size of a positive parameter.
    least = low if math.isfinite(low) and not (low == 0.0 and value > 0.0) else below
    return least, high if math.isfinite(high) else above


def spread_starts(unknowns: tuple[Unknown, ...], count: int, seed: int) -> Array:
    """Starts: the given one, then points of a Sobol sequence in the boxes; shape (count,
    unknowns)."""
    from scipy.stats import qmc

    first = np.array([u.start for u in unknowns])
    if count <= 1:
        return first[None]
    power = max(math.ceil(math.log2(count - 1)), 0)
    points = qmc.Sobol(len(unknowns), rng=seed).random_base2(power)[: count - 1]
    columns = []
    for u, share in zip(unknowns, points.T, strict=True):
        ends = np.asarray(u.to_search(np.array(u.box)), float)
        columns.append(u.from_search(ends[0] + (ends[1] - ends[0]) * share))
    return np.vstack([first, np.column_stack(columns)])
