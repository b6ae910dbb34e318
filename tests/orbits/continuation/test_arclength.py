"""Pseudo-arclength continuation of curves that are known."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from stickslip.errors import StickslipError
from stickslip.orbits.continuation.arclength import Outgrown, curve_between, trace
from stickslip.orbits.continuation.path import Path, Point, StepControl, Stop, Test

Array = NDArray[np.float64]


def unit(x: Array) -> Array:
    return np.ones(len(x))


def circle(x: Array) -> tuple[Array, Array]:
    return np.array([x @ x - 1.0]), 2.0 * x[None]


def follow(equations, start, towards, tests, endings=None, **steps) -> Path:
    return trace(
        equations,
        np.array(start, dtype=float),
        np.array(towards, dtype=float),
        scale=unit,
        tests=tests,
        endings=endings or {},
        steps=StepControl(**steps),
    )


def test_a_closed_curve_with_its_folds() -> None:
    path = follow(circle, [0.6, 0.8], [0, 1], lambda x, t: {"fold": t[0], "level": x[0] + 0.28})
    assert path.ended.text == "the curve is closed"
    assert [c.name for c in path.crossings] == ["level", "fold", "level", "fold"]
    for crossing in path.crossings:
        x = path.points[crossing.index].x
        assert x @ x == pytest.approx(1.0, abs=1e-14)
        assert (x[1] if crossing.name == "fold" else x[0] + 0.28) == pytest.approx(0.0, abs=1e-13)
    angles = np.unwrap([math.atan2(p.x[1], p.x[0]) for p in path.points])
    assert np.all(np.diff(angles) > 0)
    assert angles[-1] - angles[0] == pytest.approx(2 * math.pi, abs=0.05)
    lengths = np.array([p.length for p in path.points])
    assert lengths == pytest.approx(angles - angles[0], rel=1e-3)


def test_the_start_is_corrected() -> None:
    path = follow(
        circle, [0.61, 0.79], [1, 0], lambda x, t: {"right": 0.99 - x[0]}, {"right": "x = 0.99"}
    )
    assert np.linalg.norm(path.points[0].x) == pytest.approx(1.0, abs=1e-14)
    assert path.ended.text == "x = 0.99"
    assert path.points[-1].x[0] == pytest.approx(0.99, abs=1e-14)


def test_an_ending_that_is_passed_at_once() -> None:
    path = follow(
        circle, [0.6, 0.8], [-1, 0], lambda x, t: {"left": x[0] - 0.6}, {"left": "x = 0.6"}
    )
    assert path.ended.text == "x = 0.6"
    assert len(path.points) == 1


def test_several_zeros_in_one_step_come_in_order() -> None:
    levels = {f"x = {v}": v for v in (0.30, 0.31, 0.32, 0.33)}
    path = follow(
        lambda x: (np.array([x[1]]), np.array([[0.0, 1.0]])),
        [0, 0],
        [1, 0],
        lambda x, t: {**{name: x[0] - v for name, v in levels.items()}, "end": 1.0 - x[0]},
        {"end": "end"},
        first=0.25,
        largest=0.25,
    )
    assert [c.name for c in path.crossings] == [*levels, "end"]
    found = [path.points[c.index].x[0] for c in path.crossings[:-1]]
    assert found == pytest.approx(list(levels.values()), abs=1e-14)


def test_a_sharp_turn_shortens_the_steps() -> None:
    # y = ε/x: a corner of radius ~√ε.
    epsilon = 1e-6
    path = follow(
        lambda x: (np.array([x[0] * x[1] - epsilon]), np.array([[x[1], x[0]]])),
        [1, epsilon],
        [-1, 0],
        lambda x, t: {"end": 1.0 - x[1]},
        {"end": "far out"},
    )
    assert path.ended.text == "far out"
    for p in path.points:
        assert p.x[0] * p.x[1] == pytest.approx(epsilon, rel=1e-9)
    assert min(np.hypot(*p.x) for p in path.points) == pytest.approx(
        math.sqrt(2 * epsilon), rel=0.05
    )


def test_where_the_equations_end() -> None:
    def root(x: Array) -> tuple[Array, Array]:
        if x[0] <= 0.0:
            raise ZeroDivisionError("log of a negative number")
        return np.array([math.log(x[0]) - x[1]]), np.array([[1 / x[0], -1.0]])

    path = follow(root, [1, 0], [-1, 0], lambda x, t: {}, most=400)
    assert path.ended.text == "the limit of 400 points was reached"

    def stop(x: Array) -> tuple[Array, Array]:
        if x[0] > 0.5:
            raise StickslipError("nothing is defined there")
        return np.array([x[1]]), np.array([[0.0, 1.0]])

    path = follow(stop, [0, 0], [1, 0], lambda x, t: {})
    assert path.points[-1].x[0] == pytest.approx(0.5, abs=1e-6)
    assert path.ended.text == "no further solution was found (nothing is defined there)"


def test_no_start() -> None:
    def never(x: Array) -> tuple[Array, Array]:
        return np.array([x[0] ** 2 + 1.0]), np.array([[2.0 * x[0], 0.0]])

    with pytest.raises(StickslipError, match="no solution was found near the start"):
        follow(never, [1, 0], [0, 1], lambda x, t: {})


def test_interrupting_keeps_what_is_done() -> None:
    calls = []

    def slow(x: Array) -> tuple[Array, Array]:
        calls.append(x)
        if len(calls) > 100:
            raise KeyboardInterrupt
        return circle(x)

    path = follow(slow, [0.6, 0.8], [0, 1], lambda x, t: {})
    assert path.ended.text == "interrupted"
    assert len(path.points) > 5


def test_undefined_test_functions_are_passed_over() -> None:
    path = follow(circle, [0.6, 0.8], [0, 1], lambda x, t: {"half": x[1] if x[0] < 0 else math.nan})
    assert [c.name for c in path.crossings] == ["half"]
    assert path.points[path.crossings[0].index].x == pytest.approx([-1.0, 0.0], abs=1e-12)


def test_components_of_different_size() -> None:
    # y = 1000 cosh(p): with units the steps are even in both.
    def chain(x: Array) -> tuple[Array, Array]:
        return np.array([x[0] - 1e3 * math.cosh(x[1])]), np.array([[1.0, -1e3 * math.sinh(x[1])]])

    path = trace(
        chain,
        np.array([1e3 * math.cosh(-1.0), -1.0]),
        np.array([0.0, 1.0]),
        scale=lambda x: np.array([1e3, 2.0]),
        tests=lambda x, t: {"fold of y": t[0], "end": 1.0 - x[1]},
        endings={"end": "p = 1"},
    )
    assert path.ended.text == "p = 1"
    assert path.points[path.crossings[0].index].x == pytest.approx([1e3, 0.0], abs=1e-9)
    assert len(path.points) < 100


def test_a_cubic_is_met_by_its_points_and_tangents() -> None:
    """On both sides of the points, too; measured along a slanted direction in other units."""

    def at(s: float) -> Point:
        x = np.array([s, 0.3 * s**3 - s**2 + 2.0])
        return Point(x, 7.0 * np.array([1.0, 0.9 * s**2 - 2.0 * s]), s, {}, 1.0, np.ones(2))

    scale, tangent = np.array([0.5, 3.0]), np.array([1.0, 0.0])
    for s in (-0.4, 0.1, 0.25, 0.7, 1.3):
        found = curve_between(at(0.1), at(0.7), scale, tangent, (s - 0.1) / 0.5)
        assert found == pytest.approx(at(s).x, rel=1e-13)


def test_a_curve_that_outgrows_its_unknowns_is_handed_on() -> None:
    """The stretch ends at its last point; nothing shorter is tried."""

    def tests(x: Array, tangent: Array) -> dict[Test, float]:
        if x[0] > 0.5:
            raise Outgrown("it needs others")
        return {}

    path = trace(
        lambda x: (np.array([x[1] - x[0] ** 2]), np.array([[-2.0 * x[0], 1.0]])),
        np.array([0.0, 0.0]),
        np.array([1.0, 0.0]),
        scale=np.ones_like,
        tests=tests,
        endings={},
        steps=StepControl(first=0.1, largest=0.1),
    )
    assert path.ended.stop is Stop.LIMIT
    assert path.ended.text == "it needs others"
    assert 0.35 < path.points[-1].x[0] <= 0.5


def test_a_zero_is_looked_at_until_it_is_rounding() -> None:
    """A test function with noise: the place is found to the noise, without looking on and on."""
    looked = []

    def noisy(x: Array, tangent: Array) -> dict[Test, float]:
        looked.append(float(x[0]))
        noise = 1e-13 * np.cos(1e9 * x[0])
        return {"zero": float(np.tan(x[0]) - 0.3 + noise)}

    path = trace(
        lambda x: (np.array([x[1]]), np.array([[0.0, 1.0]])),
        np.array([0.0, 0.0]),
        np.array([1.0, 0.0]),
        scale=np.ones_like,
        tests=noisy,
        endings={},
        steps=StepControl(first=0.5, largest=0.5, most=2),
    )
    (crossing,) = path.crossings
    assert path.points[crossing.index].x[0] == pytest.approx(np.arctan(0.3), abs=3e-13)
    assert len(looked) <= 14
