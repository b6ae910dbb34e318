"""Two components that move at different phases.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), Example 2.1: Ψ(s, v) = (2 − cos 2πs)|v₁| + (2 + cos 2πs)|v₂| has the average
Ψ_av(v) = |v₁| + |v₂|.
"""

import numpy as np
import pytest

from stickslip.rate_independent.dissipation import Average, Polytope, WeightedL1

FORMULAS = ["2 - cos(2*pi*s)", "2 + cos(2*pi*s)"]


def weights(s: float) -> np.ndarray:
    return np.array([2 - np.cos(2 * np.pi * s), 2 + np.cos(2 * np.pi * s)])


def corners(s: float) -> np.ndarray:
    """The same K(s) by its corners."""
    a, b = weights(s)
    return np.array([[a, b], [a, -b], [-a, b], [-a, -b]])


AVERAGES = {
    "formulas": lambda: WeightedL1(FORMULAS).average(),
    "callable": lambda: WeightedL1(weights).average(),
    "half-spaces": lambda: Polytope(
        normals=[[1, 0], [-1, 0], [0, 1], [0, -1]], offsets=lambda s: np.repeat(weights(s), 2)
    ).average(),
    "vertices": lambda: Polytope(vertices=corners).average(tolerance=1e-12),
}


@pytest.fixture(params=AVERAGES)
def average(request: pytest.FixtureRequest) -> Average:
    return AVERAGES[request.param]()


def test_average(average: Average) -> None:
    for v in [(1.0, 0.0), (0.0, -1.0), (3.0, 4.0), (-0.2, 7.0), (1e-3, -1e3)]:
        exact = abs(v[0]) + abs(v[1])
        assert average.support(v) == pytest.approx(exact, rel=1e-12)
    assert average.contains([1, -1])
    assert not average.contains([1 + 1e-6, 0])
    np.testing.assert_allclose(average.project([3.0, 0.4]), [1.0, 0.4], atol=1e-12)


def test_who_moves_when(average: Average) -> None:
    # "moving in z_1-direction is optimal for s ≈ 0 while motion in z_2-direction is optimal for s ≈
    # 1/2"
    motion = average.optimal_motion([0.7, -2.0])
    nearest = np.round(2 * motion.phases) / 2 % 1.0
    np.testing.assert_allclose(
        np.exp(2j * np.pi * motion.phases), np.exp(2j * np.pi * nearest), atol=1e-7
    )
    order = np.argsort(nearest)
    np.testing.assert_array_equal(nearest[order], [0.0, 0.5])
    np.testing.assert_allclose(motion.motions[order], [[0.7, 0], [0, -2]], atol=1e-12)
    assert motion.cost == pytest.approx(2.7, rel=1e-12)
    assert abs(motion.gap) < 1e-12


def test_sampled_phases_do_not_do() -> None:
    # 17 phases in the middle of their cells miss the minimisers; refined minima do not depend on
    # where samples lie.
    shifted = ["2 - cos(2*pi*(s - 0.1234567))", "2 + cos(2*pi*(s - 0.1234567))"]
    samples = (np.arange(17) + 0.5) / 17
    sampled = min(WeightedL1(shifted).value(s, [1.0, 0.0]) for s in samples)
    assert sampled > 1 + 1e-4
    average = WeightedL1(shifted).average()
    assert average.support([1.0, 1.0]) == pytest.approx(2.0, abs=1e-12)
    motion = average.optimal_motion([1.0, 1.0])
    np.testing.assert_allclose(motion.phases, [0.1234567, 0.6234567], atol=1e-7)
