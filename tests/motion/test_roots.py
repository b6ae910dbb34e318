"""The first sign change of a polynomial: none is missed, none is invented."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.polynomial import polynomial

from stickslip.motion.algebra.roots import MAX_DEGREE, NONE, first_crossing, value_and_slope
from stickslip.motion.steps.step_size import fill_powers

# The first call compiles.
many = settings(deadline=None, max_examples=200)

EPS = np.finfo(float).eps
STACK = np.zeros((64, 36))

roots = st.integers(1, 200).map(lambda i: i / 128)  # also beyond the interval
pairs = st.tuples(st.floats(-2, 2), st.floats(0.05, 2))


def crossing(c: np.ndarray, limit: float = 1.0, floor: float | None = None) -> float:
    """First crossing, by default with the rounding error of the values as floor."""
    c = np.ascontiguousarray(c, dtype=float)
    return first_crossing(c, len(c) - 1, limit, rounding(c) if floor is None else floor, STACK)


def rounding(c: np.ndarray) -> float:
    """Bound of the rounding error of the values on [0, 1]."""
    return 4 * EPS * float(np.abs(c).sum())


def starting_positive(c: np.ndarray) -> np.ndarray:
    return c if c[0] > 0 else -c


@many
@given(
    st.lists(roots, min_size=1, max_size=8, unique=True),
    st.lists(pairs, max_size=4),
    st.floats(0.01, 1),
)
def test_known_roots(
    real: list[float], complex_pairs: list[tuple[float, float]], limit: float
) -> None:
    # Roots of multiples of 1/128, next to complex ones that are not too close to the axis.
    everything = [*real, *(a + sign * 1j * b for a, b in complex_pairs for sign in (1, -1))]
    c = starting_positive(polynomial.polyfromroots(everything).real)
    first = min(real)
    assume(abs(first - limit) > 1e-3)
    found = crossing(c, limit)
    if first > limit:
        assert found == NONE
        return
    slope = abs(polynomial.polyval(first, polynomial.polyder(c)))
    uncertain = 50 * rounding(c) / float(slope)
    assume(uncertain < 1e-4)  # else the roots run into each other by rounding
    assert found == pytest.approx(first, abs=uncertain)


@many
@given(st.integers(1, 20), st.integers(0, 2**32 - 1))
def test_random_coefficients(degree: int, seed: int) -> None:
    c = np.random.default_rng(seed).normal(size=degree + 1)
    c[0] = abs(c[0]) + 0.01
    real = np.array(
        [r.real for r in np.roots(c[::-1]) if abs(r.imag) < 1e-6 and 0 < r.real <= 1.001]
    )
    slopes = np.abs(polynomial.polyval(real, polynomial.polyder(c)))
    assume(np.all(slopes > 1e-3) and np.all(np.abs(real - 1) > 1e-9))
    found = crossing(c)
    real = real[real <= 1]
    if len(real) == 0:
        assert found == NONE
    else:
        assert found == pytest.approx(real.min(), abs=1e-10)


@many
@given(st.floats(0.01, 0.99), st.floats(0.1, 10), st.integers(0, 12))
def test_two_roots_close_together(place: float, scale: float, extra: int) -> None:
    # Between the roots the polynomial dips to −2.5e−15 of its size only, and a sample would have to
    # fall between them.
    gap = 1e-7
    c = scale * polynomial.polyfromroots([place, place + gap])
    c = polynomial.polymul(c, [2.0**-k for k in range(extra + 1)])  # positive, so it adds no root
    found = crossing(c, floor=1e-17 * scale)
    assert place - gap < found < place + 2 * gap


@many
@given(
    st.floats(0.05, 0.95), st.floats(0.1, 10), st.integers(4, 24), st.sampled_from([1e-12, 1e-13])
)
def test_tangency(place: float, curvature: float, degree: int, depth: float) -> None:
    # (x − place)² ± depth with the Taylor tail of an analytic function.
    c = curvature * np.array([place**2, -2 * place, 1.0])
    tail = np.zeros(degree + 1)
    tail[3:] = [1e-18 / k for k in range(3, degree + 1)]
    below, above = (
        polynomial.polyadd(c, tail) - np.eye(1, degree + 1)[0] * sign * depth for sign in (1, -1)
    )
    assert crossing(above) == NONE
    assert crossing(below) == pytest.approx(place - np.sqrt(depth / curvature), rel=0.02)


def test_dip_above_the_floor_does_not_count() -> None:
    c = polynomial.polyfromroots([0.5, 0.5 + 1e-6])  # dips to −2.5e−13
    assert crossing(c, floor=1e-12) == NONE
    assert crossing(c, floor=1e-14) == pytest.approx(0.5, abs=1e-7)


@pytest.mark.parametrize("degree", [1, 2, 5, 24, MAX_DEGREE])
def test_without_a_root(degree: int) -> None:
    assert crossing(np.ones(degree + 1)) == NONE
    assert crossing(np.eye(1, degree + 1)[0]) == NONE
    # (1 + (−0.9x)^…)/(1 + 0.9x) > 0
    alternating = 0.9 ** np.arange(degree + 1) * (-1.0) ** np.arange(degree + 1)
    assert crossing(alternating) == NONE


@pytest.mark.parametrize("degree", [1, 2, 5, 24, MAX_DEGREE])
@pytest.mark.parametrize("root", [0.01, 0.5, 1 - 1e-9])
def test_one_root(degree: int, root: float) -> None:
    c = np.zeros(degree + 1)
    c[0] = root**degree
    c[degree] = -1.0
    assert crossing(c, floor=1e-14 * c[0]) == pytest.approx(root, rel=1e-14)


def test_end_of_the_interval() -> None:
    line = np.array([0.5, -1.0])
    assert crossing(line, limit=0.5 - 1e-9) == NONE
    assert crossing(line, limit=0.5 + 1e-9) == pytest.approx(0.5, abs=1e-15)


def test_first_of_many() -> None:
    real = np.linspace(0.1, 0.9, 9)
    c = starting_positive(polynomial.polyfromroots(real))
    assert crossing(c) == pytest.approx(0.1, abs=1e-9)


UNDERFLOW = 1e-300  # below this, numbers have fewer digits


@many
@given(st.lists(st.floats(-1, 1), min_size=5, max_size=25), st.floats(0.01, 2))
def test_value_and_rate_at_the_end_of_a_step(coefficients: list[float], h: float) -> None:
    c = np.array(coefficients)
    powers = np.zeros(len(coefficients))
    fill_powers(powers, h)
    np.testing.assert_allclose(powers, h ** np.arange(len(c)), rtol=1e-14)
    value, rate = value_and_slope(c, len(c) - 1, powers)
    size = float(np.abs(c) @ (powers * np.arange(1, len(c) + 1)))
    # The last power is a product of as many rounded factors.
    error = (8 + len(c)) * EPS * size + UNDERFLOW
    assert abs(value - polynomial.polyval(h, c)) <= error
    assert abs(rate - h * polynomial.polyval(h, polynomial.polyder(c))) <= error
