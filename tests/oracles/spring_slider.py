"""Cycles of the spring slider (3.3) with k = α₀ = 1 and μ̃(α) = 2/√α, in arithmetic of any
precision.

    slip:   U' = V − w,  α' = 1 − α + U w,   w = (U − μ̃(α))/ν > 0
    stick:  U' = V,      α' = 1 − α,         until U = μ̃(α)

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017). Slip by Taylor series, stick in closed form; the cycle by the secant rule and
its multiplier by a difference quotient, both with the digits to spare for that.
"""

from typing import Any, NamedTuple

from mpmath import mp, mpf

Mpf = Any  # mpmath.mpf: no type checker can tell what it is
Real = Any  # such a number, a float, or digits in a text


class Cycle(NamedTuple):
    """Period, time in stick, and multiplier."""

    period: Mpf
    stick_duration: Mpf
    multiplier: Mpf


def cycle(V: Real, nu: Real, alpha: Real, sticks: bool, digits: int = 30) -> Cycle:
    """The cycle near a start.

    Parameters
    ----------
    alpha : real
        Of a cycle that sticks: α at the start of slip. Else: α where U' = 0 while w falls.
    """
    with mp.workdps(3 * digits):
        V, nu = mpf(V), mpf(nu)
        level = mpf(0) if sticks else V

        def image(alpha: Mpf) -> tuple[Mpf, Mpf, Mpf]:
            duration, end = _slip(alpha, V, nu, level)
            rest, end = _stick(end, V) if sticks else (mpf(0), end)
            return end, duration, rest

        a = mpf(alpha)
        b = mpf(alpha) * (1 + mpf(10) ** -6)
        fa = image(a)[0] - a
        for _ in range(60):
            fb = image(b)[0] - b
            if abs(fb) <= mpf(10) ** -(2 * digits):
                break
            a, b, fa = b, b - fb * (b - a) / (fb - fa), fb
        h = mpf(10) ** -(digits // 2 + 3)
        slope = (image(b + h)[0] - image(b - h)[0]) / (2 * h)
        _, duration, rest = image(b)
        return Cycle(duration + rest, rest, slope)


def _slip(alpha: Mpf, V: Mpf, nu: Mpf, level: Mpf) -> tuple[Mpf, Mpf]:
    """From w = level until that again in the same sense (or, from 0, until w falls to it): duration
    and α."""
    order = int(1.3 * mp.dps)
    U = 2 / mp.sqrt(alpha) + nu * level
    t = mpf(0)
    risen = False
    while True:
        us, alphas, ws = _series(U, alpha, V, nu, order)
        size = max(abs(us[-1]), abs(alphas[-1]), abs(ws[-1]))
        h = mp.power(mpf(10) ** -mp.dps / (size + mpf(10) ** -mp.dps), mpf(1) / order) * mpf("0.8")
        end = mp.polyval(ws[::-1], h)
        if risen and end < level:
            t_end = _root(ws, level, h)
            return t + t_end, mp.polyval(alphas[::-1], t_end)
        risen = risen or end > level
        U = mp.polyval(us[::-1], h)
        alpha = mp.polyval(alphas[::-1], h)
        t = t + h


def _series(
    U: Mpf, alpha: Mpf, V: Mpf, nu: Mpf, order: int
) -> tuple[list[Mpf], list[Mpf], list[Mpf]]:
    """Taylor coefficients of U, α and w; m = α^{−1/2} obeys α m' = −m α'/2."""
    us = [U]
    alphas = [alpha]
    roots = [1 / mp.sqrt(alpha)]
    ws = [(U - 2 * roots[0]) / nu]
    for n in range(order):
        heat = mp.fdot(us, ws[::-1])
        us.append(((V if n == 0 else 0) - ws[n]) / (n + 1))
        alphas.append(((1 if n == 0 else 0) - alphas[n] + heat) / (n + 1))
        j = range(1, n + 2)
        rate = sum((i * alphas[i] * roots[n + 1 - i] / 2 for i in j), mpf(0))
        rate += sum((i * roots[i] * alphas[n + 1 - i] for i in range(1, n + 1)), mpf(0))
        roots.append(-rate / ((n + 1) * alpha))
        ws.append((us[n + 1] - 2 * roots[n + 1]) / nu)
    return us, alphas, ws


def _root(ws: list[Mpf], level: Mpf, h: Mpf) -> Mpf:
    """Where a polynomial that is above a level somewhere on [0, h] falls to it for good."""
    return mp.findroot(
        lambda s: mp.polyval(ws[::-1], s) - level,
        (h / 2, h),
        solver="anderson",
        tol=mpf(10) ** -mp.dps,
    )


def _stick(alpha: Mpf, V: Mpf) -> tuple[Mpf, Mpf]:
    """From the end of slip to the start of the next one: duration and α."""
    U = 2 / mp.sqrt(alpha)

    def short_of(t: Mpf) -> Mpf:
        return 2 / mp.sqrt(1 + (alpha - 1) * mp.exp(-t)) - U - V * t

    longest = 2 / V
    t = mp.findroot(short_of, (longest / 1000, longest), solver="anderson", tol=mpf(10) ** -mp.dps)
    return t, 1 + (alpha - 1) * mp.exp(-t)
