"""Colour scales of maps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.sweeps.request.measures import MEASURES


class ColourScale(NamedTuple):
    """Limits and kind of a colour scale: sequential, diverging from 0, or cyclic."""

    low: float
    high: float
    kind: Literal["one way", "both ways", "round"]


def colour_scale(
    measure: str, values: Array, attributes: Mapping[str, Any] | None = None
) -> ColourScale:
    """Colour scale of a measure.

    The scale begins at the lower bound of the measure, such as 0 for an amplitude, so that colours
    of two maps can be compared and small differences do not look large. It is symmetric about 0 for
    values of both signs.

    Parameters
    ----------
    measure : str
        Its name.
    values : array
        Values that determine the scale; those that are not finite are ignored.
    attributes : mapping, optional
        Of the variable of a map: ``valid_min`` and ``valid_max`` are the bounds of a formula.
        Functions have no known bounds.
    """
    known = MEASURES.get(measure.partition(":")[0])
    least, most = (None, None) if known is None else (known.said.least, known.said.most)
    if least is not None and most is not None:
        return ColourScale(least, most, "round" if least < 0.0 else "one way")
    if known is None and attributes:
        least, most = attributes.get("valid_min"), attributes.get("valid_max")
    if least is not None and most is not None and least >= 0.0:
        return ColourScale(least, most, "one way")
    finite = values[np.isfinite(values)]
    low, high = (float(np.min(finite)), float(np.max(finite))) if len(finite) else (0.0, 1.0)
    if least is not None and least >= 0.0:
        return ColourScale(least, high if high > least else least + 1.0, "one way")
    if low < 0.0 < high:
        end = max(-low, high)
        return ColourScale(-end, end, "both ways")
    return ColourScale(*((low, high) if high > low else (low - 0.5, low + 0.5)), "one way")
