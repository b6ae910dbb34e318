"""Two-leg crawler with directional friction, energy (k/2)(x₂ − x₁ − L(t))², dissipation f₊ v⁺ + f₋
v⁻ of each leg.

The quasistatic crawler of DeSimone, Gidoni & Noselli, *Liquid crystal elastomer strips as soft
crawlers*, J. Mech. Phys. Solids 84 (2015) 254-272. Only the distance d = x₂ − x₁ feels the energy.
A leg moves when k|L − d| reaches the smaller of its two thresholds, hence d is the play operator of
L with the radius min(f₊, f₋)/k.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def net_displacement(D: float, k: float, f_plus: float, f_minus: float) -> float:
    """Net displacement in a cycle of L with stroke D, sgn(f₋ − f₊) max(0, D − 2 min(f₊, f₋)/k)."""
    return float(np.sign(f_minus - f_plus)) * max(0.0, D - 2 * min(f_plus, f_minus) / k)


def simulate(
    L: ArrayLike, k: float, f_plus: float, f_minus: float, x1: float = 0.0, x2: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions (x₁, x₂) of the legs at the samples of L, exact if L is monotone between them.

    Parameters
    ----------
    L : array_like, shape (n,)
        Rest length.
    k : float
        Stiffness.
    f_plus, f_minus : float
        Threshold of a leg against forward and against backward motion.
    x1, x2 : float
        Positions before the first sample.

    Raises
    ------
    ValueError
        If f₊ = f₋, where both legs may move and the energy does not say how they share the motion.
    """
    if f_plus == f_minus:
        raise ValueError("equal thresholds: the motion of the legs is not unique")
    radius = min(f_plus, f_minus) / k
    x = np.empty((2, np.size(L)))
    for i, length in enumerate(np.asarray(L, dtype=float)):
        d = x2 - x1
        stretch = min(max(d, length - radius), length + radius) - d
        # The cheap direction moves: forward, the front leg extends and the hind leg contracts;
        # backward, vice versa.
        if (stretch > 0) == (f_plus < f_minus):
            x2 += stretch
        else:
            x1 -= stretch
        x[:, i] = x1, x2
    return x[0], x[1]
