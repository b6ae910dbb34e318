"""The type of arrays in signatures."""

from __future__ import annotations

import numpy as np

Array = np.ndarray
