"""The first fall of a signal of a closed form: sums of exponentials and waves of any rates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.arrays import Array
from stickslip.motion.affine import signals
from stickslip.motion.affine.signals import SignalSum, first_of_many


def value(s: SignalSum, x: float) -> float:
    decaying = np.real(np.sum(s.a * np.exp(s.lam * x)))
    waves = np.real(np.sum(s.b * np.exp(1j * s.omega * x)))
    return float(s.c[0] + x * (s.c[1] + x * s.c[2]) + decaying + waves)


def first_fall(s: SignalSum, limit: float, floor: float) -> float:
    """The first fall by values at points that are close wherever something changes."""
    near = [np.geomspace(1e-3, 40.0, 400) / max(-z.real, 1e-300) for z in s.lam]
    turns = [np.arange(0.0, limit, 0.02 / w) for w in s.omega]
    points = np.concatenate([[0.0, limit], np.linspace(0.0, limit, 400), *near, *turns])
    points = np.unique(points[points <= limit])
    values = np.array([value(s, x) for x in points])
    below = np.flatnonzero(values < -floor)
    if not len(below):
        return math.inf
    i = int(below[0])
    low, high = float(points[i - 1]), float(points[i])
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if value(s, middle) > 0.0 else (low, middle)
    return high


@pytest.mark.parametrize("seed", range(30))
def test_what_has_decayed_does_not_shorten_the_search(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Decay within 1e-7 to 1 of a search: right, and in windows that do not grow in number with the
    fastest rate."""
    rng = np.random.default_rng(seed)
    limit = 10.0 ** rng.uniform(-3.0, 3.0)
    count = int(rng.integers(2, 6))
    lam = -(10.0 ** rng.uniform(0.0, 7.0, count)) / limit + 0j
    a = rng.normal(size=count) + 0j
    omega = rng.uniform(0.1, 10.0, int(rng.integers(0, 2))) / limit
    b = 0.3 * rng.normal(size=len(omega)) + 0j
    c = np.array([0.0, rng.normal() / limit, 0.0])
    c[0] = rng.uniform(0.1, 1.0) - np.sum(a.real) - np.sum(b.real)
    room = np.zeros_like(a)
    s = SignalSum(c, a, room, np.zeros(len(a)), room.copy(), lam, b, omega)
    floor = 1e-14 * (abs(c[0]) + float(np.sum(np.abs(a))))
    left = iter(range(20 + 20 * count))
    expand = signals.expand_signal

    def counted(s: SignalSum, start: float, h: float, work: Array) -> None:
        assert next(left, None) is not None, "too many windows"
        expand(s, start, h, work)

    monkeypatch.setattr(signals, "expand_signal", counted)
    found, _ = first_of_many(s, limit, floor, 0, np.zeros(33), np.zeros((64, 36)))
    expected = first_fall(s, limit, floor)
    if math.isfinite(expected):
        slope = abs(value(s, expected * (1 + 1e-6)) - value(s, expected * (1 - 1e-6))) / 2e-6
        assert found == pytest.approx(expected, rel=1e-12 + 10.0 * floor / slope)
    else:
        assert found > limit


@pytest.mark.parametrize("seed", range(30))
def test_what_is_fast_and_small_is_bounded(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Waves of a structure: the faster, the smaller. The first fall is right, and the search takes
    far fewer windows than the fastest wave has periods."""
    rng = np.random.default_rng(seed)
    count = 12
    w = np.geomspace(1.0, 2e3, count) * rng.uniform(0.8, 1.2, count)
    lam = -0.01 * w + 1j * w
    a = rng.normal(size=count) * w**-1.5 * np.exp(2j * np.pi * rng.uniform(size=count))
    omega = rng.uniform(0.5, 1.5, int(rng.integers(0, 2)))
    b = 0.3 * rng.normal(size=len(omega)) + 0j
    c = np.array([0.0, -0.05, 0.0])
    limit = 20.0
    c[0] = rng.uniform(0.1, 1.0) - np.sum(a.real) - np.sum(b.real)
    room = np.zeros_like(a)
    s = SignalSum(c, a, room, np.zeros(len(a)), room.copy(), lam, b, omega)
    floor = 1e-14 * (abs(c[0]) + float(np.sum(np.abs(a))))
    windows = []
    expand = signals.expand_signal

    def counted(s: SignalSum, start: float, h: float, work: Array) -> None:
        windows.append(h)
        expand(s, start, h, work)

    monkeypatch.setattr(signals, "expand_signal", counted)
    found, _ = first_of_many(s, limit, floor, 0, np.zeros(33), np.zeros((64, 36)))
    points = np.linspace(0.0, min(found, limit), 400_001)[:-1]
    values = c[0] + c[1] * points + np.real(np.exp(1j * np.outer(points, omega)) @ b)
    for k in range(count):
        values += np.real(a[k] * np.exp(lam[k] * points))
    assert np.all(values > -1e-9)  # none was missed
    if found <= limit:
        assert abs(value(s, found)) < 1e-12 and value(s, found + 1e-9) < 0.0
    assert len(windows) < 0.2 * 2e3 * min(found, limit) / 1.5 + 40
