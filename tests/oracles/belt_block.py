"""Block on a belt with static above kinetic friction, m x'' + k x = λ, u = x' − V.

The textbook stick-slip cycle (e.g. Popov, *Contact Mechanics and Friction*, 2010, chapter 12): |λ|
≤ F_s in stick, λ = F_k while the block slips back, u < 0. With Δ = F_s − F_k, ω² = k/m and the
spring force F = k x, the block slips from F = F_k + Δ to F = F_k − Δ on the circle

    F − F_k = Δ cos ωt + V√(km) sin ωt,

and both ends have x' = V, so that it sticks at once and is carried back at the rate F' = kV.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def slip_duration(m: float, k: float, V: float, F_s: float, F_k: float) -> float:
    """Duration (2/ω)(π − arctan(ωΔ/(kV))) of slip."""
    omega = math.sqrt(k / m)
    return 2 / omega * (math.pi - math.atan(omega * (F_s - F_k) / (k * V)))


def stick_duration(k: float, V: float, F_s: float, F_k: float) -> float:
    """Duration 2Δ/(kV) of stick."""
    return 2 * (F_s - F_k) / (k * V)


def period(m: float, k: float, V: float, F_s: float, F_k: float) -> float:
    """Period T = 2Δ/(kV) + (2/ω)(π − arctan(ωΔ/(kV)))."""
    return stick_duration(k, V, F_s, F_k) + slip_duration(m, k, V, F_s, F_k)


def force_range(m: float, k: float, V: float, F_s: float, F_k: float) -> tuple[float, float]:
    """Least and largest spring force, F_k ∓ √(Δ² + k m V²)."""
    radius = math.sqrt((F_s - F_k) ** 2 + k * m * V**2)
    return F_k - radius, F_k + radius


def state(
    t: ArrayLike, m: float, k: float, V: float, F_s: float, F_k: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacement x and velocity x' on the cycle, with t = 0 at the start of slip, x = F_s/k, x' =
    V."""
    omega = math.sqrt(k / m)
    delta = F_s - F_k
    t = np.mod(np.asarray(t, dtype=float), period(m, k, V, F_s, F_k))
    slips = t < slip_duration(m, k, V, F_s, F_k)
    stuck = t - slip_duration(m, k, V, F_s, F_k)
    x = np.where(
        slips,
        (F_k + delta * np.cos(omega * t)) / k + V / omega * np.sin(omega * t),
        (F_k - delta) / k + V * stuck,
    )
    v = np.where(slips, V * np.cos(omega * t) - delta * omega / k * np.sin(omega * t), V)
    return x, v
