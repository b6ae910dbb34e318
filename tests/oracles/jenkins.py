"""Periodic response of the Jenkins oscillator, event by event: m x'' + c x' + k x + q = F cos ωt.

The damper is a spring in series with a dry contact: q = k_d (x − z), |q| ≤ F_c, so that q is a play
of x. In stick the stiffness is k + k_d, in slip it is k beside the constant ±F_c: x is known in
closed form from event to event. At its largest value x stands still and q = F_c; from there half
a period leads to the opposite, which is solved for that value and its time by Newton's method.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

_LOOKS = 200  # in half a period of the drive, for events


@dataclass(frozen=True)
class Jenkins:
    """The oscillator, and the closed forms of its two modes."""

    m: float = 1.0
    c: float = 0.02
    k: float = 1.0
    k_d: float = 0.5
    F_c: float = 1.0
    F: float = 0.3
    omega: float = 0.9

    def linear(self, stiffness: float) -> complex:
        """x = Re(… e^{iωt}) where the damper does not slip (k + k_d), or is not there (k)."""
        return self.F / (stiffness - self.m * self.omega**2 + 1j * self.c * self.omega)

    def flow(
        self, t_0: float, x_0: float, v_0: float, stiffness: float, load: float
    ) -> Callable[[ArrayLike], NDArray[np.float64]]:
        """x and v of m x'' + c x' + stiffness · x = load + F cos ωt, by the time."""
        forced = self.linear(stiffness)
        rate = complex(-self.c / (2.0 * self.m), 0.0)
        rate += 1j * math.sqrt(stiffness / self.m - (self.c / (2.0 * self.m)) ** 2)
        rest = load / stiffness
        wave = forced * np.exp(1j * self.omega * t_0)
        a = x_0 - rest - wave.real
        b = v_0 - (1j * self.omega * wave).real
        # Re(A) = a, Re(A rate) = b
        A = complex(a, (rate.real * a - b) / rate.imag)

        def at(t: ArrayLike) -> NDArray[np.float64]:
            t = np.asarray(t, dtype=float)
            free = A * np.exp(rate * (t - t_0))
            driven = forced * np.exp(1j * self.omega * t)
            x = rest + free.real + driven.real
            return np.array([x, (rate * free).real + (1j * self.omega * driven).real])

        return at


@dataclass(frozen=True)
class Stretch:
    """A stretch in one mode: 0 stick, ±1 slip."""

    start: float
    end: float
    mode: int
    at: Callable[[ArrayLike], NDArray[np.float64]]


def march(
    system: Jenkins, t: float, end: float, x: float, v: float, q: float
) -> tuple[list[Stretch], tuple[float, float, float]]:
    """The stretches from a state on, and the last state (x, v, q)."""
    found: list[Stretch] = []
    mode = int(np.sign(v)) if q * np.sign(v) >= system.F_c else 0
    step = math.pi / (system.omega * _LOOKS)
    while t < end:
        load = system.k_d * x - q if mode == 0 else -mode * system.F_c
        at = system.flow(t, x, v, system.k + (0.0 if mode else system.k_d), load)
        room = _margin(system, at, mode, x, q)
        # A little later the margin is positive; at the start it may be zero. If it is not, this
        # mode does not even begin.
        low = t + 0.01 * step
        over = end if room(low) >= 0.0 else t if mode == 0 else low
        while low < over:
            high = min(low + step, end)
            if room(high) < 0.0:
                root: Any = brentq(room, low, high, xtol=1e-16, maxiter=200)
                over = float(root)
                break
            low = high
        found.append(Stretch(t, over, mode, at))
        x_1, v = map(float, at(over))
        q = mode * system.F_c if mode else q + system.k_d * (x_1 - x)
        x, t = x_1, over
        mode = 0 if mode else int(math.copysign(1.0, q))
    return found, (x, v, q)


def _margin(
    system: Jenkins, at: Callable[[ArrayLike], NDArray[np.float64]], mode: int, x: float, q: float
) -> Callable[[float], float]:
    """What is positive as long as a mode goes on that began at x with the force q."""
    if mode == 0:
        return lambda t: system.F_c - abs(q + system.k_d * (float(at(t)[0]) - x))
    return lambda t: mode * float(at(t)[1])


@dataclass(frozen=True)
class Response:
    """Largest value, complex first harmonic relative to the load, and share of stick."""

    amplitude: float
    harmonic: complex
    stick: float
    start: tuple[float, float]


def response(system: Jenkins, start: tuple[float, float] | None = None) -> Response:
    """The symmetric periodic response.

    Parameters
    ----------
    system : Jenkins
    start : (float, float), optional
        Largest value and its time at a frequency nearby.
    """
    linear = system.linear(system.k + system.k_d)
    if system.k_d * abs(linear) <= system.F_c:
        return Response(abs(linear), linear, 1.0, (abs(linear), -np.angle(linear) / system.omega))
    half = math.pi / system.omega

    def miss(y: NDArray[np.float64]) -> NDArray[np.float64]:
        x, t = y
        _, (x_1, v_1, _) = march(system, t, t + half, x, 0.0, system.F_c)
        return np.array([x_1 + x, v_1])

    for guess in (start, None):
        x, t = guess or _settled(system)
        y: NDArray[np.float64] = np.array([float(x), math.remainder(float(t), 2.0 * half)])
        for _ in range(40):
            here = miss(y)
            J = np.column_stack(
                [(miss(y + h) - miss(y - h)) / (2.0 * np.max(h)) for h in 1e-6 * np.eye(2)]
            )
            step = np.linalg.solve(J, here)
            if np.max(np.abs(step)) < 1e-11 or np.max(np.abs(here)) < 1e-14:
                break
            y = y - step * min(1.0, 0.2 / float(np.max(np.abs(step))))
        else:
            continue
        break
    else:
        raise ArithmeticError(f"no periodic response at {system}")
    x, t = float(y[0]), math.remainder(float(y[1]), 2.0 * half)
    stretches, _ = march(system, t, t + half, x, 0.0, system.F_c)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    total = 0.0j
    for s in stretches:
        times = 0.5 * (s.start + s.end) + 0.5 * (s.end - s.start) * nodes
        wave = s.at(times)[0] * np.exp(-1j * system.omega * times)
        total += 0.5 * (s.end - s.start) * np.sum(weights * wave)
        assert np.max(np.abs(s.at(times)[0])) <= x * (1.0 + 1e-12)
    stick = sum(s.end - s.start for s in stretches if s.mode == 0) / half
    return Response(x, 2.0 * complex(total) / half, stick, (x, t))


def _settled(system: Jenkins) -> tuple[float, float]:
    """Largest value and its time after a long march from rest."""
    half = math.pi / system.omega
    t = 0.0
    state = (0.0, 0.0, 0.0)
    for _ in range(400):
        _, (x, v, q) = march(system, t, t + half, *state)
        t += half
        q = min(max(q, -system.F_c), system.F_c)
        state = (x, v, q)
    stretches, _ = march(system, t, t + 2.0 * half, *state)
    times = np.concatenate([np.linspace(s.start, s.end, 400) for s in stretches])
    values = np.concatenate([s.at(np.linspace(s.start, s.end, 400))[0] for s in stretches])
    best = int(np.argmax(values))
    return float(values[best]), float(times[best])
