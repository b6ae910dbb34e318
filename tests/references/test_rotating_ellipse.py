"""An ellipse with the half axes 2 and ½ that turns: K_av is the disc of radius ½, Ψ_av(v) = ½|v|.

One that swings over part of a turn has an average with corners, which is also known: along a ray at
the angle θ from the long axis, K_av ends where the ellipse turned farthest away does.
"""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

from stickslip.rate_independent.dissipation import Average, Ellipsoid, Polytope, SupportFunction

LONG = 2.0
SHORT = 0.5
DIRECTIONS = [(1.0, 0.0), (0.0, 1.0), (0.6, -0.8), (-1.0, 0.3)]


def shape_at(angle: float) -> np.ndarray:
    """S of the ellipse whose long axis has a given angle."""
    c, s = np.cos(angle), np.sin(angle)
    axes = np.array([[c, -s], [s, c]])
    return axes @ np.diag([LONG**2, SHORT**2]) @ axes.T


def turning(s: float) -> np.ndarray:
    return shape_at(np.pi * s)


def swinging(reach: float) -> Ellipsoid:
    """The long axis swings between the angles −reach and reach."""
    return Ellipsoid(lambda s: shape_at(reach * np.sin(2 * np.pi * s)))


def ray(theta: float, reach: float) -> float:
    """Where K_av of the swinging ellipse ends in the direction θ of the first quadrant."""
    angle = min(theta + reach, np.pi / 2)
    return 1 / np.hypot(np.cos(angle) / LONG, np.sin(angle) / SHORT)


def swinging_support(V: np.ndarray, reach: float) -> float:
    """The largest ⟨ξ, V⟩ over the boundary of K_av, which is symmetric to both axes."""
    V = np.abs(V)

    def negative(theta: float) -> float:
        return -ray(theta, reach) * float(V @ [np.cos(theta), np.sin(theta)])

    # The kink at θ = π/2 − reach, from where on K_av is an arc of the circle of radius ½, splits
    # the search.
    kink = np.pi / 2 - reach
    ends = [negative(theta) for theta in (0.0, kink, np.pi / 2)]
    inner: list[Any] = [
        minimize_scalar(negative, bounds=b, method="bounded", options={"xatol": 1e-11})
        for b in ((0, kink), (kink, np.pi / 2))
    ]
    return -min(*ends, *(found.fun for found in inner))


@pytest.fixture(scope="module")
def turned() -> Average:
    return Ellipsoid(turning).average()


@pytest.mark.parametrize("V", DIRECTIONS)
def test_full_turn(turned: Average, V: tuple[float, float]) -> None:
    size = 2 * np.hypot(*V)
    motion = turned.optimal_motion(V)
    assert motion.cost == pytest.approx(np.hypot(*V) / 2, abs=1e-8 * size)
    assert abs(motion.gap) <= 1e-8 * size
    # One phase moves: the one at which the short axis points along V.
    (phase,) = motion.phases
    assert abs(np.dot(V, [np.cos(np.pi * phase), np.sin(np.pi * phase)])) < 1e-6


def test_nearest_points_of_the_disc(turned: Average) -> None:
    disc = Ellipsoid(np.eye(2) / 4)
    xi = np.array([1.0, 0.3])
    np.testing.assert_allclose(turned.project(xi), disc.project(xi), atol=1e-8)
    metric = np.array([[2.0, 1.0], [1.0, 3.0]])
    np.testing.assert_allclose(
        turned.project(xi, metric=metric), disc.project(xi, metric=metric), atol=1e-7
    )
    assert turned.contains(0.4999 * xi / np.hypot(*xi))
    assert not turned.contains(0.5001 * xi / np.hypot(*xi))
    np.testing.assert_allclose(turned.project([0.2, -0.3]), [0.2, -0.3])


def test_full_turn_as_a_general_potential() -> None:
    average = SupportFunction(
        lambda s, v: np.sqrt(v @ turning(s) @ v),
        2,
        lambda s, v: turning(s) @ v / np.sqrt(v @ turning(s) @ v),
    ).average()
    assert average.support([0.6, -0.8]) == pytest.approx(0.5, abs=2e-8)


def test_full_turn_of_a_polygon() -> None:
    # A regular polygon inside: its average is the disc that touches its sides.
    angles = 2 * np.pi * np.arange(6) / 6
    average = Polytope(
        vertices=lambda s: np.column_stack(
            [np.cos(angles + np.pi * s / 3), np.sin(angles + np.pi * s / 3)]
        )
    ).average()
    for V in DIRECTIONS[:2]:
        assert average.support(V) == pytest.approx(np.cos(np.pi / 6) * np.hypot(*V), abs=1e-8)


@pytest.mark.parametrize("reach", [0.2, 0.6, 1.3])
def test_partial_turn(reach: float) -> None:
    potential = swinging(reach)
    average = potential.average()
    for V in np.array(DIRECTIONS):
        motion = average.optimal_motion(V)
        assert motion.cost == pytest.approx(swinging_support(V, reach), abs=2e-8 * np.hypot(*V))
        assert abs(motion.gap) <= 2e-8 * np.hypot(*V)
        np.testing.assert_allclose(motion.motions.sum(axis=0), V, atol=1e-12)


def test_two_phases_share_the_motion() -> None:
    # Along the long axis both extreme positions together beat every single phase.
    potential = swinging(0.6)
    average = potential.average()
    motion = average.optimal_motion([1.0, 0.0])
    np.testing.assert_allclose(motion.phases, [0.25, 0.75], atol=1e-6)
    assert motion.cost == pytest.approx(ray(0.0, 0.6), abs=1e-9)
    assert motion.cost < 0.7 * min(potential.value(s, [1.0, 0.0]) for s in np.linspace(0, 1, 200))


def test_partial_turn_against_a_fine_grid() -> None:
    # A nonlinear program with the constraints of 200 phases, solved by another method, is an outer
    # approximation.
    potential = swinging(0.6)
    V = np.array([0.3, 1.0])
    inverses = [np.linalg.inv(shape_at(0.6 * np.sin(2 * np.pi * s))) for s in np.arange(200) / 200]
    result = minimize(
        lambda xi: -V @ xi,
        np.zeros(2),
        jac=lambda xi: -V,
        method="SLSQP",
        constraints={
            "type": "ineq",
            "fun": lambda xi: np.array([1 - xi @ G @ xi for G in inverses]),
            "jac": lambda xi: np.array([-2 * G @ xi for G in inverses]),
        },
        options={"ftol": 1e-14},
    )
    assert result.success
    value = potential.average().support(V)
    assert value <= -result.fun + 1e-8
    assert value == pytest.approx(-result.fun, rel=1e-4)
