"""What the compiled functions of this room have in common: their options, and the arrays that they
take."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array

# They allocate nothing and own no array, so that no reference has to be counted.
COMPILED: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": False}
COMPILED_INLINE: dict[str, Any] = {**COMPILED, "inline": "always"}


def plain_array(given: ArrayLike, kind: Any = float) -> Array:
    """An array as compiled functions take it: in C order, aligned and writeable; it is the given
    one where that is all this.

    Parameters
    ----------
    given : array_like
    kind : dtype
        Of the entries.
    """
    array = np.ascontiguousarray(given, kind)
    return array if array.flags.carray else array.copy()
