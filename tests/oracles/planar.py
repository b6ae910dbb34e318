"""Friction in a plane where it has closed forms, and two integrations that know nothing of modes.

Under a constant force f along x, a puck of unit mass has the hodograph

    r = c tan(φ/2)^(k/f)/sin φ,   dt = −r dφ/(f sin φ),   dx = r cos φ dt,   dy = r sin φ dt

of its speed r over the angle φ from the force, since r′ = f cos φ − k and r φ′ = −f sin φ. With
z = tan(φ/2) all of it is powers of z. Thrown on an ellipse, u′ᵢ = −k aᵢ² uᵢ by τ, dt = |Au| dτ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp

Array = NDArray[Any]


def pushed_puck(f: float, k: float, speed: float, angle: float) -> Array:
    """Time, x and y of the stop of a puck of unit mass that is thrown at an angle 0 < φ < π from a
    constant force f < k."""
    z = np.tan(angle / 2)
    p = k / f
    across = speed * np.sin(angle)
    # for c = f = 1: dt = (1 + z²) z^(p−2)/2 dz, r = (1 + z²) z^(p−1)/2
    time = (1 / (z * (p - 1)) + z / (p + 1)) / 2
    x = (z**-2 / (2 * p - 2) - z**2 / (2 * p + 2)) / 4
    y = (1 / (z * (2 * p - 1)) + z / (2 * p + 1)) / 2
    return np.array([across * time, across**2 * x, across**2 * y]) / f


def pushed_puck_at(f: float, k: float, speed: float, angle: float, later: float) -> Array:
    """Time, x, y, ẋ, ẏ at a later angle, by quadrature in the angle; f may be above k."""
    c = speed * np.sin(angle) / np.tan(angle / 2) ** (k / f)

    def r(phi: float) -> float:
        return c * np.tan(phi / 2) ** (k / f) / np.sin(phi)

    weights: list[Callable[[float], float]] = [
        lambda phi: 1.0,
        lambda phi: r(phi) * np.cos(phi),
        lambda phi: r(phi) * np.sin(phi),
    ]
    found = [
        quad(
            lambda phi, w=w: w(phi) * r(phi) / (f * np.sin(phi)),
            later,
            angle,
            epsabs=0.0,
            epsrel=1e-12,
            limit=200,
        )[0]
        for w in weights
    ]
    return np.array([*found, r(later) * np.cos(later), r(later) * np.sin(later)])


def thrown_on_ellipse(k: float, axes: Sequence[float], u: Sequence[float]) -> Array:
    """Time, x and y of the stop of a puck of unit mass without a force."""
    a, b = axes
    slow = min(axes) ** 2

    def speed(tau: float) -> float:
        return float(
            np.hypot(a * u[0] * np.exp(-k * a * a * tau), b * u[1] * np.exp(-k * b * b * tau))
        )

    # s = exp(−k slow τ) maps τ ≥ 0 to (0, 1].
    def whole(weight: Callable[[float], float]) -> float:
        def integrand(s: float) -> float:
            tau = -np.log(s) / (k * slow)
            return weight(tau) * speed(tau) / (k * slow * s)

        return float(quad(integrand, 0.0, 1.0, epsabs=1e-14, epsrel=1e-13, limit=200)[0])

    x = whole(lambda tau: u[0] * np.exp(-k * a * a * tau))
    y = whole(lambda tau: u[1] * np.exp(-k * b * b * tau))
    return np.array([whole(lambda tau: 1.0), x, y])


# -- a slip in τ -----------------------------------------------------------------------------------


def slip_in_tau(
    force: Callable[[Any, Array, Array], Array],
    kinetic: Callable[[Any], Any],
    start: Sequence[Any] | Array,
    t: Any = 0.0,
    least: float = 1e-15,
) -> Array:
    """Where a slip of a unit mass ends: (t, x, y), by DOP853 in τ with log|u| and the direction of
    u among its unknowns. All may be complex.

    Parameters
    ----------
    force : function of (t, q, u)
        Force without friction, shape (2,).
    kinetic : function of t
        k.
    start : four numbers
        Place and velocity.
    t : number
        First time.
    least : float
        |u| at which it is at rest.
    """
    x, y, v, w = start
    r = np.sqrt(v * v + w * w)

    def rates(tau: float, s: Array) -> Array:
        r = np.exp(s[3])
        n = s[4:6]
        f = force(s[0], s[1:3], r * n)
        along = n @ f
        return np.concatenate([[r], r * r * n, [along - kinetic(s[0])], f - along * n])

    def ended(tau: float, s: Array) -> float:
        return float(s[3].real - np.log(least))

    ended.terminal = True  # type: ignore[attr-defined]
    first = np.array([t, x, y, np.log(r), v / r, w / r])
    found = solve_ivp(
        rates, (0.0, 1e6), first, "DOP853", rtol=1e-13, atol=1e-15, events=ended, max_step=1.0
    )
    assert found.status == 1, found.message
    return found.y[:3, -1]


def slip_from_rest(
    force: Callable[[Any, Array, Array], Array],
    kinetic: Callable[[Any], Any],
    place: Sequence[Any],
    t: Any = 0.0,
    after: float = 1e-7,
) -> Array:
    """(x, y, ẋ, ẏ) a tiny time after a unit mass has begun to slip under a force beyond friction:
    the leading terms u = (|f| − k) n t, n along f. What is left out dies out: n turns to the right
    direction at the rate k/|u|."""
    q = np.array(place)
    f = force(t, q, np.zeros(2))
    size = np.sqrt(f @ f)
    a = f * (1 - kinetic(t) / size)
    return np.concatenate([q + a * after**2 / 2, a * after])


# -- smoothed friction -----------------------------------------------------------------------------


def smoothed(bodies: Any, start: Sequence[float], times: Array, length: float) -> Array:
    """States (q, q′) of a system whose friction is −k Au/√(|Au|² + ε²), by Radau: nothing in it
    knows of modes. Where k < s it is no approximation.

    Parameters
    ----------
    bodies : adversarial.sliding.Bodies
    start : array of 2n numbers
    times : sorted array
    length : float
        ε.
    """
    n = bodies.size

    def rates(t: float, y: Array) -> Array:
        at = np.array([t])
        q, v = y[None, :n], y[None, n:]
        push = bodies.force(at, q, v)
        for pad in bodies.pads:
            slide = pad.slide(at, q, v)
            size = np.sqrt(np.sum(slide**2, axis=1, keepdims=True) + length**2)
            k = pad.sliding(at, q, size[:, 0])
            push = push - (k[:, None] * slide / size * pad.A) @ pad.directions
        return np.concatenate([v[0], (push @ bodies.inverse)[0]])

    span = (0.0, float(times[-1]))
    found = solve_ivp(rates, span, np.asarray(start), "Radau", times, rtol=1e-7, atol=1e-10)
    assert found.status == 0, found.message
    return found.y.T


def extrapolated(values: Sequence[Array]) -> Array:
    """The limit of values at ε, ε/2, ε/4, by Richardson's table for errors that are series of ε."""
    one = 2 * values[1] - values[0]
    two = 2 * values[2] - values[1]
    return two + (two - one) / 3
