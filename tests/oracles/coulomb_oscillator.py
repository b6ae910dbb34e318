"""Forced Coulomb oscillator m x'' + k x + μ Sign(x') ∋ F cos ωt, exact from switch to switch.

In slip of sign σ, from (x₀, v₀) at t₀, with ω₀² = k/m,

    x(t) = −σμ/k + F/(k − mω²) cos ωt + A cos ω₀(t − t₀) + B sin ω₀(t − t₀),

and the end is the first zero of x'. It is isolated with the bounds of the derivatives, |x⁽ʲ⁾| ≤
|F/(k − mω²)|ωʲ + √(A² + B²)ω₀ʲ, so that no pair of zeros can hide between two samples. Stick ends
where F cos ωt leaves the band kx ± μ, which the arc cosine tells.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from mpmath import mp, mpf
from numpy.typing import ArrayLike, NDArray

DIGITS = 40
Mpf = Any  # mpmath.mpf: no type checker can tell what it is


class Phase(NamedTuple):
    """Motion from `start` to `end` in one mode, the sign of the velocity; `x(t, j)` is the
    derivative x⁽ʲ⁾(t)."""

    start: Mpf
    end: Mpf
    mode: int
    x: Callable[..., Mpf]


def phases(
    T: float,
    m: float = 1,
    k: float = 1,
    mu: float = 0.5,
    F: float = 1,
    omega: float = 0.5,
    x_0: float = 0,
    v_0: float = 0,
) -> list[Phase]:
    """Phases of the motion from t = 0 to T, in arithmetic of 40 digits.

    Raises
    ------
    ValueError
        At resonance, k = mω², where the formula has a pole, or if F is not positive.
    ArithmeticError
        At a grazing of the velocity that 40 digits do not resolve.
    """
    if k == m * omega**2:
        raise ValueError("resonance, k = m omega**2: the closed form has a pole")
    if F <= 0:
        raise ValueError(f"F = {F} is not positive")
    with mp.workdps(DIGITS):
        m, k, mu, F, omega, x, v, T = map(mpf, (m, k, mu, F, omega, x_0, v_0, T))
        t = mpf(0)
        result = []
        leaves_stick = False
        while t < T:
            force = F * mp.cos(omega * t) - k * x
            if v != 0:
                mode = int(mp.sign(v))
            elif leaves_stick or abs(force) > mu:
                mode = int(mp.sign(force))
            else:
                mode = 0
            if mode == 0:
                motion = _stick(x)
                end = _end_of_stick(t, x, k, mu, F, omega)
            else:
                motion, bound = _slip(t, x, v, mode, m, k, mu, F, omega)
                # The first derivative that does not vanish at the start: of order 3 where force and
                # threshold meet.
                order = 1 if v != 0 else 3 if leaves_stick else 2
                end = _end_of_slip(
                    t, T, order, motion, bound, mp.pi / (4 * max(omega, mp.sqrt(k / m)))
                )
            result.append(Phase(t, min(end, T), mode, motion))
            t = end
            x = motion(end) if end < T else x
            v = mpf(0)
            leaves_stick = mode == 0
    return result


def switch_times(T: float, **parameters: float) -> list[float]:
    """Times at which slip stops, starts or reverses, for the parameters of `phases`."""
    return [float(phase.start) for phase in phases(T, **parameters)[1:]]


def state(t: ArrayLike, motion: list[Phase]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacement and velocity at the times `t` of a motion found by `phases`."""
    times = np.atleast_1d(np.asarray(t, dtype=float))
    index = np.searchsorted([float(phase.start) for phase in motion[1:]], times, side="right")
    with mp.workdps(DIGITS):
        x, v = (
            np.array([float(motion[i].x(mpf(s), j)) for i, s in zip(index, times, strict=True)])
            for j in (0, 1)
        )
    return x.reshape(np.shape(t)), v.reshape(np.shape(t))


def _stick(x: Mpf) -> Callable[..., Mpf]:
    """Derivatives x⁽ʲ⁾(t) in stick."""
    return lambda _, j=0: x if j == 0 else mpf(0)


def _slip(
    t_0: Mpf,
    x_0: Mpf,
    v_0: Mpf,
    sign: int,
    m: Mpf,
    k: Mpf,
    mu: Mpf,
    F: Mpf,
    omega: Mpf,
) -> tuple[Callable[..., Mpf], Callable[[int], Mpf]]:
    """Derivatives x⁽ʲ⁾(t) in slip, and a bound of |x⁽ʲ⁾| for all times."""
    omega_0 = mp.sqrt(k / m)
    V = F / (k - m * omega**2)
    A = x_0 + sign * mu / k - V * mp.cos(omega * t_0)
    B = (v_0 + V * omega * mp.sin(omega * t_0)) / omega_0

    def x(t: Mpf, j: int = 0) -> Mpf:
        quarter = j * mp.pi / 2
        angle = omega_0 * (t - t_0)
        forced = V * omega**j * mp.cos(omega * t + quarter)
        free = omega_0**j * (A * mp.cos(angle + quarter) + B * mp.sin(angle + quarter))
        return forced + free - (sign * mu / k if j == 0 else 0)

    def bound(j: int) -> Mpf:
        return abs(V) * omega**j + mp.hypot(A, B) * omega_0**j

    return x, bound


def _end_of_stick(t: Mpf, x: Mpf, k: Mpf, mu: Mpf, F: Mpf, omega: Mpf) -> Mpf:
    """First time after t at which F cos ωt leaves kx ± μ, upward at −acos or downward at +acos;
    infinity if never."""
    ends = [mp.inf]
    for side in (-1, 1):
        level = (k * x - side * mu) / F
        if abs(level) < 1:
            angle = side * mp.acos(level)
            ends.append((angle + 2 * mp.pi * mp.ceil((omega * t - angle) / (2 * mp.pi))) / omega)
    return min(ends)


def _end_of_slip(
    t_0: Mpf,
    T: Mpf,
    order: int,
    x: Callable[..., Mpf],
    bound: Callable[[int], Mpf],
    step: Mpf,
) -> Mpf:
    """First zero of x' after t₀ and before T, or infinity; x⁽ʲ⁾(t₀) = 0 for 1 ≤ j < order."""
    # x⁽ᵒʳᵈᵉʳ⁾ keeps its sign at least this long, and with it all lower derivatives.
    a = t_0 + abs(x(t_0, order)) / bound(order + 1)

    def first_zero(a: Mpf, b: Mpf) -> Mpf | None:
        middle = (a + b) / 2
        half = (b - a) / 2
        if abs(x(middle, 1)) > half * bound(2):
            return None
        if abs(x(middle, 2)) > half * bound(3):
            if x(a, 1) * x(b, 1) > 0:
                return None
            return mp.findroot(lambda t: x(t, 1), (a, b), solver="anderson")
        if half < mpf(10) ** -(DIGITS // 2):
            raise ArithmeticError(f"the velocity grazes zero at t = {mp.nstr(middle, 16)}")
        left = first_zero(a, middle)
        return first_zero(middle, b) if left is None else left

    while a < T:
        zero = first_zero(a, a + step)
        if zero is not None:
            return zero
        a += step
    return mp.inf
