"""Dry friction smoothed by dither, λ = −s Sign(v_r + A cos τ).

Thomsen, *Using fast vibrations to quench friction-induced oscillations*, J. Sound Vib. 228 (1999)
1079-1102: over one period the relative velocity is positive for the fraction 1/2 + arcsin(v_r/A)/π
of the time.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def mean_sign(v_r: ArrayLike, A: float) -> NDArray[np.float64]:
    """Mean of sgn(v_r + A cos τ) over a period: (2/π) arcsin(v_r/A) for |v_r| ≤ A, the sign of v_r
    beyond."""
    return 2 / np.pi * np.arcsin(np.clip(np.asarray(v_r) / A, -1, 1))
