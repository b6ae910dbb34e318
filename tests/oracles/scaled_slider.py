"""The scaled spring slider (3.6) of Mielke, *Three examples concerning the interaction of dry
friction and oscillations*, WIAS preprint 2405 (2017), by its closed-form half-maps in arithmetic of
any precision.

    β' = (v̂/ν)(1 − b√ν) + (b/√ν)β⁺ − γ/(νμ₀)   (first term corrected from v̂ν(1 − b√ν)),
    γ' = μ₀β⁺ − γ

Slip, β > 0, turns about the unstable focus (v̂, μ₀v̂); stick, β < 0, is solved by Lambert's W. The
half-maps take γ on the axis β = 0 from one switch to the next. `Real` inputs such as "0.01" are
read with all their digits.
"""

from typing import Any, NamedTuple

from mpmath import mp, mpf

Mpf = Any  # mpmath.mpf: no type checker can tell what it is
Real = Any  # such a number, a float, or digits in a text


class Cycle(NamedTuple):
    """Stick-slip cycle: γ at the start and at the end of slip, the two durations, the
    multiplier."""

    gamma_slip: Mpf
    gamma_stick: Mpf
    slip_duration: Mpf
    stick_duration: Mpf
    multiplier: Mpf


def slip(gamma: Real, nu: Real, b: Real, mu_0: Real = 1, v_hat: Real = 1) -> tuple[Mpf, Mpf]:
    """Half-map Φ⁺: duration of the slip that starts in (0, γ), and γ at its end; in the precision
    of `mpmath.mp`.

    Raises
    ------
    ValueError
        If the focus does not spiral outward (b ≤ √ν, slip may never end; or a node), or if no slip
        starts in γ.
    """
    gamma, nu, b, mu_0, v_hat = map(mpf, (gamma, nu, b, mu_0, v_hat))
    rate = _rate(gamma, nu, b, mu_0, v_hat)
    growth = (b / mp.sqrt(nu) - 1) / 2
    square = (1 - b * mp.sqrt(nu)) / nu - growth**2
    if growth <= 0 or square <= 0 or rate <= 0:
        raise ValueError(
            "slip needs an unstable focus, sqrt(nu) < b, and a start below mu_0 v_hat (1 - b "
            "sqrt(nu))"
        )
    omega = mp.sqrt(square)
    # β = v̂ + e^{growth t}(−v̂ cos ωt + B sin ωt), β'(0) = rate. Its zero is sought without the
    # growth.
    B = (rate + growth * v_hat) / omega

    def scaled_beta(t: Mpf) -> Mpf:
        return v_hat * mp.exp(-growth * t) + B * mp.sin(omega * t) - v_hat * mp.cos(omega * t)

    def beta_rate(t: Mpf) -> Mpf:
        return mp.exp(growth * t) * (
            rate * mp.cos(omega * t) + (growth * B + omega * v_hat) * mp.sin(omega * t)
        )

    # The maximum of β is followed by a minimum half a turn later, which growth puts below the axis.
    top = mp.atan2(rate, -(growth * B + omega * v_hat)) / omega
    duration = mp.findroot(scaled_beta, (top, top + mp.pi / omega), solver="anderson")
    # γ from the β equation at β = 0.
    return duration, nu * mu_0 * (_rate(0, nu, b, mu_0, v_hat) - beta_rate(duration))


def stick(gamma: Real, nu: Real, b: Real, mu_0: Real = 1, v_hat: Real = 1) -> tuple[Mpf, Mpf]:
    """Half-map Φ⁻: duration T of the stick that starts in (0, γ), and γe^{−T}; in the precision of
    `mpmath.mp`.

    With q = μ₀v̂(1 − b√ν)/γ the end is qT = 1 − e^{−T}, hence T = 1/q + W(−e^{−1/q}/q).

    Raises
    ------
    ValueError
        If no stick starts in γ.
    """
    gamma, nu, b, mu_0, v_hat = map(mpf, (gamma, nu, b, mu_0, v_hat))
    q = mu_0 * v_hat * (1 - b * mp.sqrt(nu)) / gamma
    if not 0 < q < 1:
        raise ValueError("stick needs a start above mu_0 v_hat (1 - b sqrt(nu))")
    duration = 1 / q + mp.lambertw(-mp.exp(-1 / q) / q).real
    return duration, gamma * mp.exp(-duration)


def cycle(nu: Real, b: Real, mu_0: Real = 1, v_hat: Real = 1, digits: int = 40) -> Cycle:
    """Periodic orbit, to `digits` digits.

    By Liouville a half-map has the slope e^{∫div} β'(start)/β'(end), so that at the fixed point the
    rates cancel and the multiplier is exp((b/√ν − 1) T_slip − T_stick).
    """
    with mp.workdps(digits + 15):
        nu, b, mu_0, v_hat = map(mpf, (nu, b, mu_0, v_hat))
        parameters = nu, b, mu_0, v_hat
        # Φ⁻∘Φ⁺ is convex and increasing, so that Newton's method climbs from 0 to the lower fixed
        # point.
        gamma = mpf(0)
        while True:
            T_slip, gamma_stick = slip(gamma, *parameters)
            T_stick, image = stick(gamma_stick, *parameters)
            multiplier = mp.exp((b / mp.sqrt(nu) - 1) * T_slip - T_stick)
            slope = multiplier * _rate(gamma, *parameters) / _rate(image, *parameters)
            change = (image - gamma) / (1 - slope)
            gamma += change
            if abs(change) <= mpf(10) ** -(digits + 5) * mu_0 * v_hat:
                return Cycle(gamma, gamma_stick, T_slip, T_stick, multiplier)


def lowest_order_fixed_point(b: Real, mu_0: Real = 1, v_hat: Real = 1, digits: int = 15) -> Mpf:
    """Fixed point γ_b of the lowest-order maps Φ⁺(γ) = μ₀v̂ + ρ_b(μ₀v̂ − γ) and Φ⁻(γ) = γ
    exp(−𝒞(μ₀v̂/γ))."""
    with mp.workdps(digits + 15):
        b, mu_0, v_hat = map(mpf, (b, mu_0, v_hat))
        rho_b = mp.exp(mp.pi * b / (2 * mp.sqrt(1 - b**2 / 4)))

        def excess(gamma: Mpf) -> Mpf:
            # The stick map at ν = 0 is the lowest-order one.
            return stick(1 + rho_b * (1 - gamma), 0, 0)[1] - gamma

        # The other fixed point, γ = 1, is no switch of the system.
        return mu_0 * v_hat * mp.findroot(excess, (mpf(0), 1 - mpf(2) ** -20), solver="anderson")


def _rate(gamma: Mpf, nu: Mpf, b: Mpf, mu_0: Mpf, v_hat: Mpf) -> Mpf:
    """β' on the axis β = 0."""
    return v_hat * (1 - b * mp.sqrt(nu)) / nu - gamma / (nu * mu_0)
