"""Carried states: the axis of a map and the direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.errors import DeclarationError, short, suggestion
from stickslip.model.system import System
from stickslip.sweeps.request.axes import SAMPLES, Axis

CARRIED = "carried_"
"""What the names of variables begin with that hold what a point hands on."""

DIRECTION = "direction"
"""Axis of maps that are carried up, and then down."""

_WAYS = ("", "up", "down", "both")
_FORM = 'Write it like "omega", "omega up", "omega down" or "omega both"'


@dataclass(frozen=True)
class Carry:
    """The carried state of a map: along one of its axes, line by line.

    Attributes
    ----------
    axis : int
        Number of the axis.
    steps : tuple of int
        +1: from the first value of the axis to the last; −1: back. One after the other; two of them
        are the points of a last axis, :data:`DIRECTION`.
    text : str
        In words.
    """

    axis: int
    steps: tuple[int, ...]
    text: str

    def path(self, axes: Sequence[Axis]) -> list[dict[int, int]]:
        """Places of a line in the order in which the state is carried through them: index by axis.

        Parameters
        ----------
        axes : sequence of Axis
            Of the map.
        """
        along = range(len(axes[self.axis]))
        return [
            {self.axis: i} | ({len(axes) - 1: d} if len(self.steps) > 1 else {})
            for d, step in enumerate(self.steps)
            for i in (along if step > 0 else reversed(along))
        ]

    def others(self, axes: Sequence[Axis]) -> list[int]:
        """Axes that are not part of a line."""
        own = self.path(axes)[0]
        return [k for k in range(len(axes)) if k not in own]


def read_carry(
    system: System, axes: tuple[Axis, ...], carry: str | None
) -> tuple[tuple[Axis, ...], Carry | None]:
    """The axes, with an axis of directions if there are two, and the order in which the state is
    carried.

    Parameters
    ----------
    carry : str or None
        Names of an axis, and direction: ``"omega"`` uses its values in the given order, ``"omega
        up"`` and ``"omega down"`` by size, ``"omega both"`` up and then down again.

    Raises
    ------
    DeclarationError
        If there is no such axis or direction, or the state cannot be carried along it.
    """
    if carry is None:
        return axes, None
    words = str(carry).replace(",", " ").split()
    known = {axis.names: i for i, axis in enumerate(axes)}
    way = words.pop() if len(words) > 1 and words[-1] in _WAYS else ""
    found = [i for names, i in known.items() if tuple(words) in (names, ("_".join(names),))]
    if not found:
        remedy = suggestion(
            str(carry),
            [",".join(names) for names in known],
            accepts=lambda text: read_carry(system, axes, text),
        )
        last = words[-1] if words else ""
        reason = f"'{short(str(carry))}' is not an axis of the map"
        if len(words) > 1 and any(tuple(words[:-1]) == names for names in known):
            reason = f"unknown direction '{short(last)}'"
        raise DeclarationError("carry", reason, f"{_FORM}. {remedy}")
    axis = axes[found[0]]
    text = ",".join(axis.names)
    _check_axis(system, axis, text)
    grows = np.diff(axis.values[0])
    if way and not (np.all(grows > 0.0) or np.all(grows < 0.0)):
        raise DeclarationError(
            "carry",
            f"the values of {text} are not monotone, so the direction '{way}' is undefined",
            f'Carry along them in the given order: "{text}"',
        )
    up = 1 if not len(grows) or grows[0] > 0.0 else -1
    steps = {"": (1,), "up": (up,), "down": (-up,), "both": (up, -up)}[way]
    if way == "both":
        if DIRECTION in {*system.parameters, *system.declaration.state}:
            reason = f"the name '{DIRECTION}' is already used in {system.name}"
            raise DeclarationError("carry", reason, "Compute two maps, one up and one down")
        axes = (*axes, Axis((DIRECTION,), np.array([[1.0, -1.0]]), "list"))
    words = [text, "up and down" if way == "both" else way]
    return axes, Carry(found[0], steps, " ".join(word for word in words if word))


def _check_axis(system: System, axis: Axis, text: str) -> None:
    for name in axis.names:
        if name not in system.parameters:
            raise DeclarationError(
                "carry",
                f"{name} is an initial value, but a carried motion begins at the end of the "
                "previous one",
                "Carry along a parameter",
            )
    if axis.spacing in SAMPLES:
        raise DeclarationError(
            "carry",
            f"{text} is a random or low-discrepancy sample, which is not ordered",
            f"Give a range, as in {axis.names[0]}=0.8:1.6:400",
        )


def direction_attributes() -> dict[str, Any]:
    """Meaning of the numbers of :data:`DIRECTION`, by the CF conventions."""
    return {
        "units": "1",
        "long_name": "direction of the sweep",
        "flag_values": [1, -1],
        "flag_meanings": "up down",
    }
