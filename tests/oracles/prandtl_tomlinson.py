"""Prandtl-Tomlinson model, energy (k/2)(x − X)² − V₀ cos(2πx/a) of a tip x pulled by a support X.

Prandtl, *Ein Gedankenmodell zur kinetischen Theorie der festen Körper*, ZAMM 8 (1928) 85-106; Popov
& Gray, *Prandtl-Tomlinson model: history and applications*, ZAMM 92 (2012) 683-708. The minimum
that carries the tip vanishes where the second derivative does, cos(2πx/a) = −1/η.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq


def eta(k: float, V_0: float, a: float) -> float:
    """Ratio η = 4π²V₀/(ka²) of the curvatures; several equilibria exist exactly if η > 1."""
    return 4 * math.pi**2 * V_0 / (k * a**2)


def force_at_jump(k: float, V_0: float, a: float) -> float:
    """Spring force (2πV₀/a)√(1 − η⁻²) at which the tip jumps; zero for η ≤ 1, where it never does.

    It is not the largest force: that one, 2πV₀/a, is passed shortly before, at x = a/4.
    """
    return 2 * math.pi * V_0 / a * math.sqrt(max(0.0, 1 - eta(k, V_0, a) ** -2))


def support_at_jump(k: float, V_0: float, a: float) -> float:
    """Support X at which a tip that started at X = x = 0 jumps first.

    Raises
    ------
    ValueError
        If η ≤ 1.
    """
    if eta(k, V_0, a) <= 1:
        raise ValueError("the tip follows its support without a jump for eta <= 1")
    return a / (2 * math.pi) * math.acos(-1 / eta(k, V_0, a)) + force_at_jump(k, V_0, a) / k


def quasistatic(
    X: ArrayLike, k: float, V_0: float, a: float, x: float = 0.0
) -> NDArray[np.float64]:
    """Tip positions for slowly moving supports X: from each one the tip slides downhill to the next
    minimum."""
    force = 2 * math.pi * V_0 / a
    turn = a / (2 * math.pi) * math.acos(-1 / max(1.0, eta(k, V_0, a)))

    def slope(x: float, support: float) -> float:
        return k * (x - support) + force * math.sin(2 * math.pi * x / a)

    positions = np.empty(np.size(X))
    for i, support in enumerate(np.asarray(X, dtype=float).tolist()):
        # Between its turning points ±turn + na the slope is monotone, and beyond X ± force/k it has
        # one sign.
        end = support - math.copysign(1.001 * force / k, slope(x, support))
        cells = np.arange(math.floor(min(x, end) / a) - 1, math.ceil(max(x, end) / a) + 2)
        nodes = np.union1d(cells * a - turn, cells * a + turn)
        nodes = np.append(nodes[(nodes - x) * (nodes - end) < 0], end)
        for node in sorted(nodes.tolist(), key=lambda node: abs(node - x)):
            if slope(x, support) * slope(node, support) <= 0:
                root: Any = brentq(slope, x, node, args=(support,), xtol=1e-14 * a)
                x = root
                break
            x = node
        positions[i] = x
    return positions


def friction(k: float, V_0: float, a: float) -> float:
    """Mean spring force in slow pull: the energy that is lost in the jump from one valley to the
    next, by the distance of the valleys; zero for η ≤ 1."""
    if eta(k, V_0, a) <= 1:
        return 0.0
    support = support_at_jump(k, V_0, a) * (1.0 + 1e-15)
    edge = a / (2 * math.pi) * math.acos(-1 / eta(k, V_0, a))
    landed = float(quasistatic([support * (1.0 + 1e-12)], k, V_0, a, edge * (1.0 + 1e-6))[0])

    def energy(x: float) -> float:
        return k / 2 * (x - support) ** 2 - V_0 * math.cos(2 * math.pi * x / a)

    return (energy(edge) - energy(landed)) / round((landed - edge) / a + 0.5) / a


def friction_when_fast(k: float, V_0: float, a: float, nu: float, V: float) -> float:
    """Mean spring force at high speed, to second order in V₀: νV + ½F²κ·ων/(k² + ω²ν²), with F =
    2πV₀/a, κ = 2π/a and ω = κV, since the tip answers to the lattice as a driven linear one."""
    kappa = 2 * math.pi / a
    omega = kappa * V
    force = kappa * V_0
    return nu * V + force**2 * kappa / 2 * omega * nu / (k**2 + (omega * nu) ** 2)
