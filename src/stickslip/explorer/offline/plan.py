"""The motions that a page stores: the values of its sliders, and their combinations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from stickslip.errors import DeclarationError, short, suggestion
from stickslip.explorer.work.model import parameter_rows
from stickslip.model.system import System
from stickslip.sweeps.request.axes import read_axes

_MOST_SLIDERS = 3  # largest number of sliders whose values are combined
MOST_POINTS = 1000
# limits of the number of values of a slider without given values, besides the declared one
_STEPS = (4, 10)
_ALL_STEPS = 60  # number of values of all sliders, if only one parameter varies at a time
_FORM = "Write it like V=0.05:0.4:15"


@dataclass(frozen=True)
class Slider:
    """A parameter, or an initial value, with the values at which motions are stored."""

    name: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class Plan:
    """The points at which motions are stored.

    Attributes
    ----------
    sliders : tuple of Slider
        In the order in which the page shows them.
    together : bool
        Whether all combinations of the values are stored. Otherwise one parameter varies at a time,
        and the others have their declared values.
    """

    sliders: tuple[Slider, ...]
    together: bool

    @property
    def points(self) -> list[dict[str, float]]:
        """The values at each point: all combinations in C order, or slider by slider."""
        if self.together:
            names = [slider.name for slider in self.sliders]
            columns = [slider.values for slider in self.sliders]
            return [dict(zip(names, values, strict=True)) for values in product(*columns)]
        return [{slider.name: value} for slider in self.sliders for value in slider.values]


def read_plan(system: System, over: Mapping[str, Any] | Sequence[str] | None) -> Plan:
    """Read the requested points.

    Parameters
    ----------
    over : mapping or sequence of str, optional
        Up to three parameters or initial values, with their values, as for a map; without values,
        those of its slider in the explorer. By default each parameter separately.

    Raises
    ------
    DeclarationError
        If a name is unknown, a value is not admissible, or there are too many points.
    """
    if over is None or len(over) == 0:
        plan = Plan(_declared(system), together=False)
    else:
        plan = Plan(_given(system, over), together=True)
    count = (math.prod if plan.together else sum)(len(s.values) for s in plan.sliders)
    if count > MOST_POINTS:
        raise DeclarationError(
            "over",
            f"{count:,} points are too many for one page",
            f"Use fewer values: at most {MOST_POINTS:,} points",
        )
    return plan


def _given(system: System, over: Mapping[str, Any] | Sequence[str]) -> tuple[Slider, ...]:
    """Sliders with given values."""
    if not isinstance(over, Mapping):
        texts = [over] if isinstance(over, str) else over
        named = [text for text in texts if text.strip() and "=" not in text]
        over = _with_values(system, texts, named)
    axes = read_axes(system, over)
    if len(axes) > _MOST_SLIDERS:
        raise DeclarationError(
            "over",
            f"{len(axes)} parameters were given",
            f"Give at most {_MOST_SLIDERS}, or none: then one parameter at a time varies",
        )
    for axis in axes:
        if len(axis.names) > 1 or axis.labels:
            raise DeclarationError(
                f"over.{short(','.join(axis.names))}",
                "a slider is one parameter or one initial value",
                _FORM,
            )
    return tuple(Slider(a.names[0], tuple(sorted(set(map(_rounded, a.values[0]))))) for a in axes)


def _with_values(system: System, texts: Sequence[str], named: Sequence[str]) -> Mapping[str, Any]:
    """Axes by name; names alone have the values of their sliders."""
    from stickslip.sweeps.request.axes import axes_of_texts

    # Entries with values are checked there, and so is a name without values that is given twice.
    doubled = [f"{text.strip()}=0" if text in named else text for text in texts]
    over: dict[str, Any] = dict(axes_of_texts(doubled))
    for text in named:
        name = text.strip()
        if name not in system.parameters:
            known = suggestion(name, system.parameters)
            raise DeclarationError(
                f"over {short(name)}",
                "not a parameter, and without values",
                f"{_FORM}. {known}",
            )
        over[name] = list(_values(system, name, _STEPS[1]))
    return over


def _declared(system: System) -> tuple[Slider, ...]:
    """A slider for each parameter."""
    if not system.parameters:
        raise DeclarationError(
            "over",
            f"{system.name} has no parameters",
            "Give initial values to vary, like x=0:1:10",
        )
    least, most = _STEPS
    steps = min(max(_ALL_STEPS // len(system.parameters), least), most)
    return tuple(Slider(name, _values(system, name, steps)) for name in system.parameters)


def _values(system: System, name: str, steps: int) -> tuple[float, ...]:
    """Values on the slider of a parameter in the explorer, including the declared one."""
    declared = system.parameters[name]
    (row,) = parameter_rows({name: declared})
    even = np.linspace(row["low"], row["high"], steps)
    rounded = {_rounded(round(v / row["step"]) * row["step"]) for v in even}
    return tuple(sorted(v for v in rounded | {declared.default} if _admissible(system, name, v)))


def _rounded(value: float) -> float:
    """A value rounded so that a page shows all its digits: 0.6, not 0.6000000000000001."""
    return float(f"{value:.12g}")


def _admissible(system: System, name: str, value: float) -> bool:
    try:
        system.declaration.check_range(name, value)
    except DeclarationError:
        return False
    return True
