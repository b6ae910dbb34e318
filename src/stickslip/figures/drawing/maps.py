"""Common parts of plots of maps: the measures that they show, and the labels of their axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import DeclarationError, short, suggestion
from stickslip.figures.drawing.style import axis_label
from stickslip.model.entries.units import unit_label
from stickslip.sweeps.request.measures import MISSING, how_carried, measures_of
from stickslip.sweeps.request.plan import NOT_COMPUTED

if TYPE_CHECKING:
    import xarray


def chosen_measures(data: xarray.Dataset, measures: Sequence[str] | None) -> list[str]:
    """The measures in a figure: by default all of the map.

    Raises
    ------
    DeclarationError
        If the map has none of that name.
    """
    known = [*measures_of(data), "outcome"]
    for name in measures or []:
        if name not in known:
            raise DeclarationError(
                "measure",
                f"the map has no measure '{short(name)}'",
                suggestion(name, known),
            )
    return list(measures) if measures else known[:-1]


def uncertified(data: xarray.Dataset, name: str) -> Array:
    """Points that are shown without a certificate."""
    certified = data["certificate"].values <= data["certificate"].attrs["tolerance"]
    if "lacking" in data:  # maps of the first format have none
        certified = data["lacking"].values == MISSING.index("nothing")
    return (data["outcome"].values != NOT_COMPUTED) & ~np.isnan(data[name].values) & ~certified


def map_title(data: xarray.Dataset) -> str:
    """Title of a map, and the carried axis."""
    along = how_carried(data)
    title = str(data.attrs["title"])
    if not along:
        return title
    names, _, way = along.partition(" ")
    text = f"{title}\nstate carried along {axis_label(names.split(','), '')}"
    return f"{text}, {way}" if way else text


def axis_unit(data: xarray.Dataset, name: str) -> str:
    """The unit of a coordinate or a measure; empty if it has none."""
    unit = str(data[name].attrs.get("units", ""))
    return "" if unit == "1" else unit


def axis_text(data: xarray.Dataset, names: list[str]) -> str:
    """Meaning, symbols and unit of the quantity of an axis."""
    meaning = str(data[names[0]].attrs.get("long_name", ""))
    label = axis_label(names, axis_unit(data, names[0]))
    if len(names[0]) > 2 and names[0] in meaning.split():  # a word, not a symbol
        return meaning + label.removeprefix(axis_label(names, ""))
    return f"{meaning} {label}" if meaning and meaning != names[0] and len(meaning) <= 40 else label


def measure_label(data: xarray.Dataset, name: str, width: int = 60) -> str:
    """Meaning and unit of a measure, on two lines if it is long."""
    meaning = str(data[name].attrs.get("long_name", name))
    unit = unit_label(axis_unit(data, name))
    text = f"{meaning}  [{unit}]" if unit else meaning
    shown = f"{meaning}  [{axis_unit(data, name)}]" if unit else meaning
    if len(shown) <= width:
        return text
    words = text.split(" ")
    return " ".join(words[: len(words) // 2]) + "\n" + " ".join(words[len(words) // 2 :])
