"""A pendulum on a cart with dry friction, in thirty digits, by Taylor series from switch to switch.

With the angle φ of the rod from hanging and R = m sin φ (g cos φ + l φ'²), the horizontal force of
the rod on a cart at rest, the cart slips in the direction σ with

    (M + m sin² φ) x'' = R − σF,    l φ'' = −x'' cos φ − g sin φ,

and it sticks, x'' = 0, while |R| ≤ F. A slip ends where x' = 0: the cart sticks if |R| ≤ F there,
and otherwise slips in the direction of R. These are the equations of Lagrange with a force of
magnitude F against x'; nothing of them is from the package.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from mpmath import mp, mpf

DIGITS = 30
ORDER = 26
_POINTS = 24  # of a step, between which a guard has at most one zero
Mpf = Any  # mpmath.mpf: no type checker can tell what it is
Series = list[Mpf]


NUMBERS = ("1", "0.5", "0.7", "9.81", "1")  # M, m, l, g, F


class Motion(NamedTuple):
    """What is followed: the times of switches, and the states (x, x', φ, φ') that are asked for."""

    switches: list[Mpf]
    states: list[tuple[Mpf, Mpf, Mpf, Mpf]]


def follow(angle: str, times: list[str]) -> Motion:
    """The motion from rest at an angle."""
    with mp.workdps(DIGITS):
        M, m, l, g, F = map(mpf, NUMBERS)  # noqa: E741
        x, v, phi, omega = mpf(0), mpf(0), mpf(angle), mpf(0)
        t, switches, states = mpf(0), list[Mpf](), list[tuple[Mpf, Mpf, Mpf, Mpf]]()

        def rod(phi: Mpf, omega: Mpf) -> Mpf:
            return m * mp.sin(phi) * (g * mp.cos(phi) + l * omega**2)

        def mode(phi: Mpf, omega: Mpf) -> int:
            R = rod(phi, omega)
            return 0 if abs(R) <= F else int(mp.sign(R))

        sigma = mode(phi, omega)
        waiting = [mpf(time) for time in times]
        while waiting:
            xs, phis, guard = _series((x, v, phi, omega), sigma, (M, m, l, g, F))
            h = min(mpf(1) / 10, *(_radius(one) for one in (xs, phis)))
            event = _zero(guard, h, starts=t > 0 or sigma == 0)
            end = h if event is None else event
            while waiting and waiting[0] <= t + end:
                tau = waiting.pop(0) - t
                states.append((*_both(xs, tau), *_both(phis, tau)))
            (x, v), (phi, omega), t = _both(xs, end), _both(phis, end), t + end
            if event is None:
                continue
            switches.append(t)
            if sigma:
                v, sigma = mpf(0), mode(phi, omega)
            else:
                sigma = int(mp.sign(rod(phi, omega)))
        return Motion(switches, states)


def _series(state: tuple[Mpf, ...], sigma: int, numbers: tuple[Mpf, ...]) -> tuple[Series, ...]:
    """Coefficients of x and φ, and of what vanishes at the end: x', or F² − R² in stick."""
    x, v, phi, omega = state
    M, m, l, g, F = numbers  # noqa: E741
    xs, phis = [x, v], [phi, omega]
    s, c = [mp.sin(phi)], [mp.cos(phi)]
    R, a = list[Mpf](), list[Mpf]()
    for n in range(ORDER):
        rate = [(k + 1) * phis[k + 1] for k in range(n + 1)]
        inner = [g * c[k] + l * _product(rate, rate, k) for k in range(n + 1)]
        R.append(m * _product(s, inner, n))
        if sigma:
            mass = [m * _product(s, s, k) + (M if k == 0 else 0) for k in range(n + 1)]
            right = R[n] - (sigma * F if n == 0 else 0)
            a.append((right - sum(mass[n - k] * a[k] for k in range(n))) / mass[0])
        else:
            a.append(mpf(0))
        turn = -(_product(a, c, n) + g * s[n]) / l
        xs.append(a[n] / ((n + 1) * (n + 2)))
        phis.append(turn / ((n + 1) * (n + 2)))
        s.append(_product(c, rate, n) / (n + 1))
        c.append(-_product(s, rate, n) / (n + 1))
    velocity = [(k + 1) * xs[k + 1] for k in range(ORDER)]
    room = [(F**2 if k == 0 else 0) - _product(R, R, k) for k in range(ORDER)]
    return xs, phis, velocity if sigma else room


def _product(u: Series, w: Series, n: int) -> Mpf:
    return mp.fsum(u[k] * w[n - k] for k in range(n + 1))


def _radius(series: Series) -> Mpf:
    """A step whose last terms are below the precision."""
    last = max(abs(series[-1]), abs(series[-2]), mpf(10) ** -DIGITS)
    return (mpf(10) ** (5 - DIGITS) / last) ** (mpf(1) / ORDER)


def _value(series: Series, tau: Mpf) -> Mpf:
    return mp.polyval(series[::-1], tau)


def _both(series: Series, tau: Mpf) -> tuple[Mpf, Mpf]:
    """Value and rate."""
    return _value(series, tau), _value([k * c for k, c in enumerate(series)][1:], tau)


def _zero(guard: Series, h: Mpf, starts: bool) -> Mpf | None:
    """The first change of sign on a step, by bisection and Newton's method; a zero at its beginning
    is that of the switch before."""
    at: Callable[[Mpf], Mpf] = lambda tau: _value(guard, tau)  # noqa: E731
    points = [h * k / _POINTS for k in range(_POINTS + 1)]
    points[0] = h * mpf(10) ** -6
    signs = [mp.sign(at(tau)) for tau in points]
    for a, b, before, after in zip(points, points[1:], signs, signs[1:], strict=False):
        if before != after:
            return mp.findroot(at, (a, b), solver="anderson", tol=mpf(10) ** (4 - 2 * DIGITS))
    return None
