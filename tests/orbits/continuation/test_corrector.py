"""Newton's method for points of curves with many unknowns, whose Jacobians cost more than
residuals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stickslip.orbits.continuation.corrector import CostlyJacobian, Lost, correct

MANY = 80
TOLERANCE = 1e-10


class Equations:
    """x_i = cos(x_0 + λ + i) and a parameter λ, with counts of what was evaluated."""

    def __init__(self, latest: np.ndarray | None = None) -> None:
        self.latest = latest
        self.jacobians = 0
        self.residuals = 0

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self.jacobians += 1
        J = np.zeros((MANY, MANY + 1))
        J[:, :MANY] = np.eye(MANY)
        slope = np.sin(x[0] + x[-1] + np.arange(MANY))
        J[:, 0] += slope
        J[:, -1] = slope
        self.latest = J
        return self.residual(x), J

    def residual(self, x: np.ndarray) -> np.ndarray:
        self.residuals += 1
        return x[:MANY] - np.cos(x[0] + x[-1] + np.arange(MANY))


def corrected(equations: Equations, guess: np.ndarray, left: float = math.inf) -> np.ndarray:
    """In the plane of the parameter."""
    tangent = np.zeros(MANY + 1)
    tangent[-1] = 1.0
    return correct(equations, guess, np.ones(MANY + 1), tangent, TOLERANCE, left=left)


def start(parameter: float) -> np.ndarray:
    """A solution, except for the parameter."""
    first = 0.6
    for _ in range(200):
        first = 0.5 * (first + math.cos(first + 0.1))
    x = np.cos(first + 0.1 + np.arange(MANY + 1))
    x[0], x[-1] = first, parameter
    return x


@pytest.mark.parametrize("left", [math.inf, 1e-9])
@pytest.mark.parametrize("step", [1e-6, 1e-3, 3e-2])
def test_one_jacobian_is_enough(step: float, left: float) -> None:
    """The latest one, that of the solution next to it."""
    equations = Equations()
    assert isinstance(equations, CostlyJacobian)
    known = corrected(equations, start(0.1))
    equations.jacobians = 0
    guess = known.copy()
    guess[-1] += step
    found = corrected(equations, guess, left)
    assert equations.jacobians == 0
    assert found[-1] == guess[-1]
    assert np.max(np.abs(equations.residual(found))) < 1e-11


def test_a_misleading_jacobian_is_replaced() -> None:
    wrong = np.hstack([7.0 * np.eye(MANY), np.ones((MANY, 1))])
    equations = Equations(wrong)
    found = corrected(equations, start(0.13))
    assert 1 <= equations.jacobians <= 4
    assert np.max(np.abs(equations.residual(found))) < 1e-11


def test_without_a_solution() -> None:
    class Never(Equations):
        def residual(self, x: np.ndarray) -> np.ndarray:
            return super().residual(x) ** 2 + 1.0

    with pytest.raises(Lost):
        corrected(Never(), start(0.1))
