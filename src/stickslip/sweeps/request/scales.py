"""Which numbers the colours of a map stand for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.sweeps.request.measures import MEASURES


class ColourScale(NamedTuple):
    """Ends of the colours, and what kind of colours they are: from one end to the other, from a
    middle at 0 to both ends, or round a whole turn."""

    low: float
    high: float
    kind: Literal["one way", "both ways", "round"]


def colour_scale(
    measure: str, values: Array, attributes: Mapping[str, Any] | None = None
) -> ColourScale:
    """From where to where the colours of a measure go.

    What has a least value, as an amplitude has 0, begins there, so that colours of two maps can be
    compared, and small differences do not look large. What has both signs has 0 in the middle.

    Parameters
    ----------
    measure : str
        Its name.
    values : array
        What sets the scale; what is not finite is left out.
    attributes : mapping, optional
        Of the variable of a map: ``valid_min`` and ``valid_max`` are the bounds of a formula. Of
        functions nothing is known but the values.
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
