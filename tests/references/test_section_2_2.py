"""The scalar hysteresis operator of [M] section 2.2: its two closed forms, and convergence of the
order ε.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017). With ℓ(t) = 5t − t² and z(0) = 0 the position first is the running maximum of
ℓ − ρ and then, as soon as the upper bound arrives, the running minimum of ℓ + ρ. The maximum that
is reached is that of ℓ(τ) − ρ(τ/ε) over all τ (printed: 25/4 − min ρ, its limit), and the way down
begins about √(2 min ρ) after the top (printed: √(min ρ)).

The running maxima are found here by golden sections on each period, without derivatives and without
the package.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from stickslip.arrays import Array
from stickslip.rate_independent.play.operator import play

LOAD = "5*t - t**2"
TOP = 2.5
HEIGHT = 6.25
SPAN = (0.0, 5.0)


def ell(t: Array) -> Array:
    return 5 * t - t**2


# --- z_0 ------------------------------------------------------------------------------------------


def limit(t: Array, minus: float, plus: float) -> Array:
    """z_0 for constant thresholds below 25/4."""
    up = np.maximum(0.0, ell(np.minimum(t, TOP)) - plus)
    down = np.minimum(HEIGHT - plus, ell(t) + minus)
    return np.where(t <= TOP, up, down)


@pytest.mark.parametrize("plus", [1e-6, 0.03, 0.5, 1.0, 2.5, 4.0, 6.2])
@pytest.mark.parametrize("ratio", [0.2, 1.0, 1.7])
def test_constant_thresholds(plus: float, ratio: float) -> None:
    minus = ratio * plus
    motion = play(LOAD, (plus, minus), SPAN, initial=0.0)
    t = np.linspace(*SPAN, 5001)
    assert np.abs(motion.position(t) - limit(t, minus, plus)).max() < 1e-14 * HEIGHT
    stop = TOP + np.sqrt(minus + plus)  # √(2ρ) if both are ρ
    assert motion.certificate.ok, motion.certificate.verdict
    events = motion.events["time"].to_numpy()
    assert events[:2] == pytest.approx([TOP - np.sqrt(HEIGHT - plus), TOP], abs=1e-7)
    assert (len(events) == 3) == (stop < SPAN[1])
    assert events[2:] == pytest.approx([stop] * (len(events) - 2), abs=1e-12)
    # Dissipated: the way times the threshold.
    way_down = max(HEIGHT - plus - minus, 0.0)
    assert motion.dissipated == pytest.approx(plus * (HEIGHT - plus) + minus * way_down, rel=1e-13)


# --- z_ε ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """A periodic threshold as it is given to the package, and as a function; smooth between the
    corners."""

    given: object
    minus: Callable[[Array], Array]
    plus: Callable[[Array], Array]
    corners: tuple[float, ...] = (0.0, 1.0)


def same(
    given: object, rho: Callable[[Array], Array], corners: tuple[float, ...] = (0.0, 1.0)
) -> Case:
    return Case(given, rho, rho, corners)


def teeth(s: Array) -> Array:
    """Straight up to s = 0.3 and down again."""
    return np.interp(s % 1.0, [0.0, 0.3, 1.0], [0.4, 1.6, 0.4])


def steep(s: Array) -> Array:
    return 0.3 + np.exp(-8 * np.cos(np.pi * s) ** 2)


def valley(s: Array) -> Array:
    return 0.6 + np.abs(np.sin(np.pi * (s - 0.2)))


CASES = {
    "cosine": same("1 + cos(2*pi*s)/2", lambda s: 1 + np.cos(2 * np.pi * s) / 2),
    "two valleys": same(
        "1 + 0.4*cos(4*pi*s) + 0.1*sin(2*pi*s)",
        lambda s: 1 + 0.4 * np.cos(4 * np.pi * s) + 0.1 * np.sin(2 * np.pi * s),
    ),
    "narrow peak, callable": same(steep, steep),
    "corner at the minimum": same("0.6 + abs(sin(pi*(s - 0.2)))", valley, (0.0, 0.2, 1.0)),
    "corner at the minimum, callable": same(valley, valley, (0.0, 0.2, 1.0)),
    "corners, from samples": same(
        (np.array([0.0, 0.3, 1.0]), np.array([0.4, 1.6, 0.4])), teeth, (0.0, 0.3, 1.0)
    ),
    "asymmetric": Case(
        ("1 + cos(2*pi*s)/2 + 0.1*sin(6*pi*s)", "0.5 + 0.2*sin(2*pi*s)"),
        lambda s: 0.5 + 0.2 * np.sin(2 * np.pi * s),
        lambda s: 1 + np.cos(2 * np.pi * s) / 2 + 0.1 * np.sin(6 * np.pi * s),
    ),
    "only one side oscillates": Case(
        ("max(0.5, 1 + cos(2*pi*s))", 0.8),
        lambda s: np.full_like(s, 0.8),
        lambda s: np.maximum(0.5, 1 + np.cos(2 * np.pi * s)),
        (0.0, 1 / 3, 2 / 3, 1.0),
    ),
}


def maxima(f: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Largest values of a function that is smooth on each interval: the best of 40 samples, then
    golden sections."""
    grid = low + (high - low) * np.linspace(0, 1, 40)[:, None]
    sampled = f(grid)
    best = np.argmax(sampled, axis=0)
    columns = np.arange(len(low))
    a = grid[np.maximum(best - 1, 0), columns]
    b = grid[np.minimum(best + 1, 39), columns]
    golden = (np.sqrt(5) - 1) / 2
    c = b - golden * (b - a)
    d = a + golden * (b - a)
    for _ in range(45):
        left = f(c) > f(d)
        a, b = np.where(left, a, c), np.where(left, d, b)
        c = b - golden * (b - a)
        d = a + golden * (b - a)
    return np.maximum(np.max(sampled, axis=0), np.maximum(f(0.5 * (a + b)), np.maximum(f(a), f(b))))


def running_maximum(
    f: Callable[[Array], Array], case: Case, epsilon: float, first: float, times: Array
) -> Array:
    """Largest value of f on [first, t], for each of the sorted times."""
    corners = (
        epsilon
        * (
            np.arange(np.floor(first / epsilon), times[-1] / epsilon)[:, None] + case.corners
        ).ravel()
    )
    edges = np.union1d(np.concatenate([corners[corners < times[-1]], times]), [first])
    edges = edges[(edges >= first) & (np.append(np.diff(edges), 1.0) > 1e-14)]
    pieces = np.maximum.accumulate(maxima(f, edges[:-1], edges[1:]))
    index = np.searchsorted(edges, times - 1e-14)
    return np.where(index > 0, pieces[np.maximum(index, 1) - 1], f(times))


@pytest.mark.parametrize("epsilon", [0.1, 0.037, 0.01])
@pytest.mark.parametrize("name", CASES)
def test_running_maximum(name: str, epsilon: float) -> None:
    case = CASES[name]
    motion = play(LOAD, case.given, SPAN, initial=0.0, epsilon=epsilon)  # type: ignore[arg-type]
    phases = np.linspace(0, 1, 10_001)
    turn = TOP + np.sqrt(case.minus(phases).min() + case.plus(phases).min())
    t = np.sort(np.random.default_rng(0).uniform(*SPAN, 300))
    before = t[t <= turn]
    after = t[t > turn]

    def phase(t: Array) -> Array:
        return np.mod(t, epsilon) / epsilon

    def lower(t: Array) -> Array:
        return ell(t) - case.plus(phase(t))

    def minus_upper(t: Array) -> Array:
        return -ell(t) - case.minus(phase(t))

    up = np.maximum(0.0, running_maximum(lower, case, epsilon, 0.0, np.append(before, turn)))
    down = np.minimum(up[-1], -running_maximum(minus_upper, case, epsilon, turn, after))
    exact = np.concatenate([up[:-1], down])
    assert len(before) > 50 and len(after) > 20
    assert np.abs(motion.position(t) - exact).max() < 1e-12
    assert motion.certificate.ok, motion.certificate.verdict
    # The printed maximum is only the limit.
    assert up[-1] < HEIGHT - case.plus(phases).min() + 1e-12


# --- ε → 0 ----------------------------------------------------------------------------------------

DECADES = np.array([0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 3e-5])


@pytest.mark.parametrize("name", ["cosine", "corner at the minimum"])
def test_error_is_of_order_epsilon(name: str) -> None:
    case = CASES[name]
    smallest = float(case.plus(np.linspace(0, 1, 10_001)).min())
    errors = np.empty(len(DECADES))
    for i, epsilon in enumerate(DECADES.tolist()):
        motion = play(LOAD, case.given, SPAN, initial=0.0, epsilon=epsilon)  # type: ignore[arg-type]
        errors[i] = np.abs(motion.z - limit(motion.time, smallest, smallest)).max()
    # z_0 follows a bound at the speed |ℓ′| <= 5, and z_ε catches up once per period, where ρ has
    # its minimum. It moves for a while around that, which takes a share of the order √ε of the
    # period from the wait.
    assert np.all(errors <= 5.0 * DECADES)
    assert np.all(errors >= 5.0 * DECADES * (1.0 - np.sqrt(DECADES)))
    assert np.polyfit(np.log(DECADES[2:]), np.log(errors[2:]), 1)[0] == pytest.approx(1.0, abs=0.03)


def test_rates_converge_only_as_measures() -> None:
    """∫ φ dz_ε → ∫ φ dz_0 for continuous φ, while the largest rate grows like 1/ε: there is no
    limit in L^p."""
    averaged = play(LOAD, 0.5, SPAN, initial=0.0)
    gaps, speeds = [], []
    for epsilon in (1e-1, 1e-2, 1e-3):
        motion = play(LOAD, "1 + cos(2*pi*s)/2", SPAN, initial=0.0, epsilon=epsilon)
        gaps.append(abs(against(motion) - against(averaged)))
        speeds.append(np.abs(motion.at(motion.time)["d_z"]).max())
        # The way converges, too.
        assert np.abs(np.diff(motion.z)).sum() == pytest.approx(
            np.abs(np.diff(averaged.z)).sum(), abs=12 * epsilon
        )
    assert gaps[0] < 0.5 and gaps[1] < gaps[0] / 5 and gaps[2] < gaps[1] / 5
    assert speeds[1] > 2.5 * speeds[0] and speeds[2] > 2.5 * speeds[1]


def against(motion: object) -> float:
    """∫ cos(3t) dz, by parts."""
    t = np.union1d(motion.time, np.linspace(*SPAN, 200_001))  # type: ignore[attr-defined]
    z = motion.position(t)  # type: ignore[attr-defined]
    by_parts = 3 * np.sin(3 * t) * z
    return float(z[-1] * np.cos(15.0) - z[0] + np.trapezoid(by_parts, t))
