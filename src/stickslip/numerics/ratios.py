"""Ratios whose denominators may vanish."""

from __future__ import annotations

from typing import Any, overload

import numpy as np

from stickslip.numerics.levels import TINIEST


@overload
def ratio(a: float, b: float) -> float: ...
@overload
def ratio(a: np.ndarray, b: float) -> np.ndarray: ...
@overload
def ratio(a: np.ndarray | float, b: np.ndarray) -> np.ndarray: ...
def ratio(a: Any, b: Any) -> Any:
    """a / max(b, `TINIEST`), for b ≥ 0, element by element: a/b where b is not 0, 0 for 0/0, and a
    number beyond every limit, with the sign of a, where b alone is 0. NaN remains NaN.

    A miss relative to a size is thus 0 where nothing is missed, and is admissible nowhere else if
    the size is 0.
    """
    return a / (max(b, TINIEST) if isinstance(b, float) else np.maximum(b, TINIEST))
