"""Types of arrays in signatures, and their conversion for compiled functions."""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

Array = np.ndarray
AnyArray = Any
"""An array of which a checker is to believe whatever is done with it: one whose entries are floats,
integers or complex numbers, as the case may be."""

# Arrays that compiled functions take: the type of their entries, and their number of axes.
Vector = Annotated[np.ndarray, "f8:1"]
Matrix = Annotated[np.ndarray, "f8:2"]
Array3 = Annotated[np.ndarray, "f8:3"]
Array4 = Annotated[np.ndarray, "f8:4"]
IntVector = Annotated[np.ndarray, "i8:1"]
IntMatrix = Annotated[np.ndarray, "i8:2"]
IntArray3 = Annotated[np.ndarray, "i8:3"]
Int32Vector = Annotated[np.ndarray, "i4:1"]
ComplexVector = Annotated[np.ndarray, "c16:1"]
ComplexMatrix = Annotated[np.ndarray, "c16:2"]
ComplexArray3 = Annotated[np.ndarray, "c16:3"]
ComplexArray4 = Annotated[np.ndarray, "c16:4"]
BoolVector = Annotated[np.ndarray, "b1:1"]
ByteMatrix = Annotated[np.ndarray, "i1:2"]

_T = TypeVar("_T")
Many = Annotated[_T, "many"]
"""``Many[Lane]`` is a ``Lane`` whose arrays all have one more axis, in front."""


def plain_array(given: ArrayLike, kind: Any = float) -> Array:
    """An array as compiled functions take it: in C order, aligned and writeable; it is the given
    one where that is all this.

    Parameters
    ----------
    kind : dtype
        Of the entries.
    """
    array = np.ascontiguousarray(given, kind)
    return array if array.flags.carray else array.copy()
