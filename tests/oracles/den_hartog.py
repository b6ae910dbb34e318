"""Non-stop motion of the harmonically forced dry-friction oscillator, m x'' + k x + F_c Sign(x') ∋
P cos(θ).

Den Hartog, *Forced vibrations with combined Coulomb and viscous friction*, Trans. ASME 53 (1931)
107-115; the symbols are those of Marino & Cicirello, *Experimental investigation of a
single-degree-of-freedom system with Coulomb friction*, Nonlinear Dynamics 99 (2020): r = ω/ω_n, β =
F_c/P, displacements in P/k. With τ = ωt the equation is r² x'' + x + β Sign(x') ∋ cos(τ + φ), and τ
= 0 is put on the largest displacement.

On the way down, 0 ≤ τ ≤ π, the four conditions x(0) = −x(π) = X, x'(0) = x'(π) = 0 leave

    x(τ) = X cos τ + βU sin τ + β(1 − cos(τ/r)) − rβU sin(τ/r),    V cos φ = X,    V sin φ = −βU,

and x(τ + π) = −x(τ) on the way up.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar


def response(r: float) -> tuple[float, float]:
    """Den Hartog's response V and damping function U.

    Raises
    ------
    ValueError
        If 1/r is an integer: V or U is infinite at 1, 1/3, 1/5, …, and at the resonances r = 1/(2n)
        the periodic motion attracts nothing.
    """
    if r <= 0 or math.isclose(1 / r, round(1 / r), rel_tol=1e-12):
        raise ValueError(f"r = {r} is not positive or is a resonance, 1/r an integer")
    return 1 / (1 - r**2), math.sin(math.pi / r) / (r * (1 + math.cos(math.pi / r)))


def amplitude(r: float, beta: float) -> float:
    """Amplitude X = k x_max / P = √(V² − β²U²) of the non-stop motion.

    Raises
    ------
    ValueError
        If `beta` is not below `beta_lim`, where the motion would stop.
    """
    if not 0 <= beta < beta_lim(r):
        raise ValueError(
            f"beta = {beta} is outside the range [0, {beta_lim(r)}) of the non-stop motion"
        )
    V, U = response(r)
    return math.sqrt(V**2 - (beta * U) ** 2)


def beta_lim(r: float) -> float:
    """Largest β = F_c/P of the non-stop motion, |V| / √(U² + (S/r²)²)."""
    V, U = response(r)
    return abs(V) / math.hypot(U, _S(r) / r**2)


def phase(r: float, beta: float) -> float:
    """Phase φ of the force cos(τ + φ) at the largest displacement, V cos φ = X and V sin φ =
    −βU."""
    V, U = response(r)
    return math.atan2(-beta * U / V, amplitude(r, beta) / V)


def state(
    theta: ArrayLike, r: float, beta: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacement and velocity of the periodic motion where the force is P cos θ.

    Parameters
    ----------
    theta : array_like
        Angle of the force; `phase(r, beta)` is the largest displacement, a state of rest.
    r, beta : float
        Frequency ratio ω/ω_n and friction ratio F_c/P.

    Returns
    -------
    x : ndarray
        Displacement in P/k.
    v : ndarray
        Velocity in P ω_n/k, so that m = k = P = 1, ω = r takes (x, v) as initial values.
    """
    X, (_, U) = amplitude(r, beta), response(r)
    half_turns, tau = np.divmod(np.asarray(theta, dtype=float) - phase(r, beta), math.pi)
    sign = 1 - 2 * (half_turns % 2)
    x = X * np.cos(tau) + beta * (U * np.sin(tau) + 1 - np.cos(tau / r) - r * U * np.sin(tau / r))
    dx = -X * np.sin(tau) + beta * (U * (np.cos(tau) - np.cos(tau / r)) + np.sin(tau / r) / r)
    return sign * x, sign * r * dx


def _S(r: float) -> float:
    """Supremum over 0 < τ < π of [r sin(τ/r) + U r²(cos τ − cos(τ/r))] / sin τ: x' < 0 exactly if X
    > βS/r²."""
    _, U = response(r)

    def ratio(tau: NDArray[np.float64]) -> NDArray[np.float64]:
        return (r * np.sin(tau / r) + U * r**2 * (np.cos(tau) - np.cos(tau / r))) / np.sin(tau)

    # Both ends are 0/0. Their limits, by de l'Hospital, are the conditions that the acceleration
    # turns the motion.
    ends = 1.0, -math.cos(math.pi / r) - U * r * math.sin(math.pi / r)
    tau = np.linspace(0, math.pi, 2 + 1000 * math.ceil(1 + 1 / r))[1:-1]
    best = tau[np.argmax(ratio(tau))]
    step = tau[1] - tau[0]
    bounds = max(best - step, step), min(best + step, math.pi - step)
    found: Any = minimize_scalar(
        lambda s: -ratio(s), bounds=bounds, method="bounded", options={"xatol": 1e-10}
    )
    return max(*ends, -found.fun)
