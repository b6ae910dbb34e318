"""The types of arrays in signatures."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray
AnyArray = Any
"""An array of which a checker is to believe whatever is done with it: one whose entries are floats,
integers or complex numbers, as the case may be."""
