"""Quasistatic spring slider with rate-and-state friction and the ageing law.

Ruina, *Slip instability and state variable friction laws*, J. Geophys. Res. 88 (1983) 10359-10370;
Rice & Ruina, *Stability of steady frictional slipping*, J. Appl. Mech. 50 (1983) 343-349; Ranjith &
Rice, *Stability of quasi-static slip in a single degree of freedom elastic system with rate and
state dependent friction*, J. Mech. Phys. Solids 47 (1999) 1207-1218:

    τ = σ(μ₀ + a ln(v/V) + b ln(Vθ/D_c)),    θ' = 1 − vθ/D_c,    τ' = k(V − v).

With φ = ln(v/V), ϑ = ln(Vθ/D_c) and time in D_c/V, κ = kD_c/σ:

    aφ' = κ(1 − e^φ) − bϑ',    ϑ' = e^{−ϑ} − e^φ.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp


def critical_stiffness(
    a: float, b: float, sigma: float, D_c: float, m: float = 0.0, V: float = 0.0
) -> float:
    """Stiffness k_c = (b − a)σ/D_c · (1 + mV²/(aσD_c)) below which steady sliding is unstable."""
    return (b - a) * sigma / D_c * (1 + m * V**2 / (a * sigma * D_c))


def critical_frequency(a: float, b: float, D_c: float, V: float) -> float:
    """Angular frequency ω_c = (V/D_c)√((b − a)/a) of small oscillations at k_c; it does not depend
    on the mass."""
    return V / D_c * math.sqrt((b - a) / a)


def first_integral(
    log_velocity: ArrayLike, log_state: ArrayLike, a: float, b: float
) -> NDArray[np.float64]:
    """Constant of the quasistatic motion at k = k_c: H = e^ϑ(e^φ + c) − φ − (c + 1)ϑ, c = (b −
    a)/a.

    At k_c, (e^{−ϑ}, e^φ) is a planar Lotka-Volterra system with the integrating factor e^{2ϑ−φ}.
    The function H is least, 1 + c, in steady sliding, and its level sets around it are closed:
    hence the periodic motions.
    """
    c = (b - a) / a
    phi, theta = np.asarray(log_velocity, float), np.asarray(log_state, float)
    return np.exp(theta) * (np.exp(phi) + c) - phi - (c + 1) * theta


def simulate(
    t: ArrayLike,
    k: float,
    a: float,
    b: float,
    sigma: float,
    D_c: float,
    V: float,
    log_velocity: float = 0.1,
    log_state: float = 0.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Quasistatic motion from φ = ln(v/V), ϑ = ln(Vθ/D_c).

    Parameters
    ----------
    t : array_like, shape (n,)
        Increasing times; the first is the start.
    k, a, b, sigma, D_c, V : float
        Stiffness per area, direct and state effect, normal stress, slip distance, load velocity.
    log_velocity, log_state : float
        Initial φ and ϑ.

    Returns
    -------
    log_velocity, log_state : ndarray, shape (n,)
        φ and ϑ at the times `t`.
    peaks : ndarray
        The successive maxima of φ between the first time and the last.
    """
    motion = _integrate(
        np.asarray(t, dtype=float) * V / D_c, k * D_c / sigma, a, b, (log_velocity, log_state)
    )
    return motion.y[0], motion.y[1], motion.y_events[0].reshape(-1, 2)[:, 0]


def growth(ratio: float, a: float, b: float, log_velocity: float = 0.1, cycles: int = 10) -> float:
    """Mean factor by which the maxima of ln(v/V) grow in one cycle at k = ratio · k_c.

    It is 1 at k_c for every amplitude (Ranjith & Rice 1999), above 1 below k_c, below 1 above it.

    Raises
    ------
    RuntimeError
        If the velocity becomes so large that double precision does not resolve the steps (ln(v/V)
        beyond about 30).
    """
    motion = _integrate(
        [0, np.inf], ratio * (b - a), a, b, (log_velocity, 0), stop_after=cycles + 1
    )
    if motion.status < 1:
        raise RuntimeError(motion.message)
    peaks = motion.y_events[0][:, 0]
    return float((peaks[-1] / peaks[0]) ** (1 / cycles))


def _integrate(
    s: Sequence[float] | NDArray[np.float64],
    kappa: float,
    a: float,
    b: float,
    initial: tuple[float, float],
    stop_after: int | None = None,
) -> Any:
    """Solution (φ, ϑ) at the scaled times s with the maxima of φ as its event, the last of which
    may stop it."""

    def rates(_: float, y: NDArray[np.float64]) -> tuple[float, float]:
        velocity = math.exp(y[0])
        ageing = math.exp(-y[1]) - velocity
        return (kappa * (1 - velocity) - b * ageing) / a, ageing

    def rise(s: float, y: NDArray[np.float64]) -> float:
        return rates(s, y)[0]

    peak: Any = rise  # a function with attributes, as SciPy wants it
    peak.direction = -1
    peak.terminal = stop_after or False
    times = s if stop_after is None else None
    return solve_ivp(
        rates, (s[0], s[-1]), initial, "DOP853", times, events=peak, rtol=1e-11, atol=1e-12
    )
