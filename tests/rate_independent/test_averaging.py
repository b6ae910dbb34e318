"""Averages: minima over the phase, K_av = ∩ K(s), who moves when, and where friction vanishes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog, minimize_scalar
from scipy.spatial import HalfspaceIntersection

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.rate_independent.averaging.minima import PHASE_SAMPLES, least_over_phases
from stickslip.rate_independent.dissipation import (
    Dissipation,
    Ellipsoid,
    GroupNorm,
    Polytope,
    Product,
    SupportFunction,
    WeightedL1,
)
from stickslip.rate_independent.sets.cones import hull, polyhedron, solve_cones
from stickslip.rate_independent.signals.reading import read_phase

SQUARE = np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])


def turned(points: Array, angle: float) -> Array:
    """Rows turned in the plane."""
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


def shift(reach: float, s: float) -> Array:
    """To and fro along the first axis."""
    return np.array([reach * np.cos(2 * np.pi * s), 0.0])


# --- Minima over the phase ------------------------------------------------------------------------


def test_minima_of_formulas() -> None:
    values, phases, floors, sampled = least_over_phases(
        read_phase(
            [
                "2 - cos(2*pi*(s - 0.3))",
                "1 + abs(sin(pi*(s - 1/3)))",  # a kink at 1/3
                # two wells, the deeper one beside s = 1/4 and its mirror image
                "cos(4*pi*s) + 0.1*cos(2*pi*s) + 3",
                "piecewise(cos(2*pi*s) > 0.5, 1, 2)",  # jumps
                "7",
                "max(1, 2 + 3*sin(2*pi*s))",  # a plateau
                "exp(sin(2*pi*s) + cos(6*pi*s)/5)",
            ],
            "weights",
        )
    )
    inner: Any = minimize_scalar(
        lambda s: np.cos(4 * np.pi * s) + 0.1 * np.cos(2 * np.pi * s) + 3, (0.2, 0.25, 0.4)
    )
    last: Any = minimize_scalar(
        lambda s: np.exp(np.sin(2 * np.pi * s) + np.cos(6 * np.pi * s) / 5),
        (0.7, 0.8, 0.9),
        tol=1e-9,
    )
    s = np.linspace(0, 1, 100_001)
    assert last.fun <= np.exp(np.sin(2 * np.pi * s) + np.cos(6 * np.pi * s) / 5).min() + 1e-12
    np.testing.assert_allclose(values, [1, 1, inner.fun, 1, 7, 1, last.fun], rtol=1e-13)
    assert sampled == 0 and np.all(floors <= values) and np.all(values - floors <= 1e-13)
    assert phases[0] == pytest.approx(0.3, abs=2e-8)
    assert phases[1] == pytest.approx(1 / 3, abs=1e-13)
    assert phases[2] == pytest.approx(0.25, abs=0.02) or phases[2] == pytest.approx(0.75, abs=0.02)


def test_a_minimum_between_two_samples() -> None:
    # A narrow well that shows in the slopes of its neighbours only is refined all the same.
    well = (10.4) / PHASE_SAMPLES
    (value,), (phase,), _, sampled = least_over_phases(
        read_phase(
            lambda s: [
                1 - np.exp(-((2 * PHASE_SAMPLES * np.sin(np.pi * (s - well)) / np.pi) ** 2))
            ],
            "weights",
        )
    )
    assert sampled == PHASE_SAMPLES
    assert value == pytest.approx(0, abs=1e-14)
    assert phase == pytest.approx(well, abs=1e-9)


@pytest.mark.parametrize("elementwise", [True, False])
def test_each_component_has_its_own_phase(elementwise: bool) -> None:
    x = np.random.default_rng(0).uniform(size=50)

    def weights(s):
        assert elementwise or np.ndim(s) == 0
        return 1.5 + np.cos(2 * np.pi * (s - x)) + 0.3 * np.cos(4 * np.pi * (s - x))

    average = WeightedL1(weights).average()
    # cos φ = −5/6 where the derivative vanishes: two minima of equal depth for each component.
    least = 1.5 - 5 / 6 + 0.3 * (2 * 25 / 36 - 1)
    np.testing.assert_allclose(average.bounds()[1], least, rtol=1e-13)
    np.testing.assert_allclose(np.cos(2 * np.pi * (average.upper_phases - x)), -5 / 6, atol=1e-7)


def test_many_components_need_an_elementwise_function() -> None:
    x = np.linspace(0, 1, 5000)
    average = WeightedL1(lambda s: 2 - np.cos(2 * np.pi * (s - x))).average()
    np.testing.assert_allclose(average.bounds()[1], 1, rtol=1e-13)
    with pytest.raises(DeclarationError, match="for an array of n phases"):
        WeightedL1(lambda s: 2 - np.cos(2 * np.pi * (float(s) - x))).average()
    with pytest.raises(DeclarationError, match="is too large"):
        average.optimal_motion(np.ones(5000))


# --- Closed forms ---------------------------------------------------------------------------------


def test_asymmetric_weights() -> None:
    source = WeightedL1(["2 - cos(2*pi*s)", "3"], lower=["2 + sin(2*pi*s)", "0.5 + sin(pi*s)**2"])
    average = source.average()
    assert average.value(0, [1, 1]) == pytest.approx(4, rel=1e-14)
    assert average.value(0, [-1, -1]) == pytest.approx(1.5, rel=1e-14)
    assert isinstance(average, WeightedL1)
    assert average.average() is average
    np.testing.assert_allclose(np.array(average.bounds()), [[-1, -0.5], [1, 3]])
    motion = average.optimal_motion([-2.0, -1.0])
    np.testing.assert_allclose(motion.phases, [0, 0.75])
    np.testing.assert_allclose(motion.motions, [[0, -1], [-2, 0]])
    assert motion.cost == pytest.approx(2.5, rel=1e-14)
    assert abs(motion.gap) < 1e-14


def test_weights_that_vanish_up_to_rounding() -> None:
    # At the minimum 1 + cos is a rounding error, of either sign.
    for shift_by in np.linspace(0.01, 0.99, 23):
        source = WeightedL1([f"1 + cos(2*pi*(s - {shift_by}))"])
        assert source.value(shift_by + 0.5, [1.0]) == pytest.approx(0, abs=1e-15)
        assert 0 <= source.average().support([1.0]) < 1e-15


def test_weights_negative_where_nobody_looked() -> None:
    with pytest.raises(
        DeclarationError, match=r"component 1 is -0\.\d+ at phase s = 0\.7, but a threshold cannot"
    ):
        WeightedL1(lambda s: [1.0, np.abs(np.sin(np.pi * (s - 0.7))) - 1e-3]).average()


def test_one_sided_friction_does_not_count_as_frictionless() -> None:
    ratchet = WeightedL1(["cos(pi*s)**2", "cos(pi*s)**2"], lower=["1", "sin(pi*s)**2"]).average()
    assert ratchet.value(0, [3, 0]) == pytest.approx(0, abs=1e-15)
    assert ratchet.value(0, [-3, 0]) == 3
    np.testing.assert_array_equal(ratchet.frictionless, [[0], [1]])
    assert "in 1 of 2 directions, among the components 1" in ratchet.verdict
    assert WeightedL1([1.0]).average().verdict == "Friction vanishes in no direction"


def test_groups() -> None:
    source = GroupNorm(["1 + sin(pi*s)**2", "0.5 + abs(sin(pi*(s - 0.3)))", "sin(pi*(s - 0.1))**2"])
    average = source.average()
    np.testing.assert_allclose(average.radii_at(), [1, 0.5, 0], atol=1e-15)
    V = np.array([3.0, 4, 0, 1, 7, 7])
    motion = average.optimal_motion(V)
    assert motion.cost == pytest.approx(5.5, rel=1e-12)
    np.testing.assert_allclose(motion.motions.sum(axis=0), V)
    np.testing.assert_array_equal(average.frictionless, np.eye(6)[:, 4:])


def test_fixed_normals_against_qhull() -> None:
    rng = np.random.default_rng(2)
    normals = np.vstack([rng.normal(size=(6, 3)), np.eye(3), -np.eye(3)])
    base = rng.uniform(0.6, 1, 12)
    swing = rng.uniform(0, 0.5, 12)
    shift = rng.uniform(size=12)
    source = Polytope(
        normals=normals, offsets=lambda s: base - swing * np.cos(2 * np.pi * (s - shift))
    )
    average = source.average()
    vertices = HalfspaceIntersection(
        np.column_stack([normals, swing - base]), np.zeros(3)
    ).intersections
    for V in rng.normal(size=(10, 3)):
        exact = (vertices @ V).max()
        assert average.support(V) == pytest.approx(exact, rel=1e-12)
        motion = average.optimal_motion(V)
        assert motion.cost == pytest.approx(exact, rel=1e-12)
        assert abs(motion.gap) < 1e-12
        np.testing.assert_allclose(motion.motions.sum(axis=0), V, atol=1e-12)
        # At most n faces hold a vertex, each at its own phase.
        assert len(motion.phases) <= 3
    assert average.frictionless.shape == (3, 0)


def test_fixed_normals_that_close_up() -> None:
    average = Polytope(
        normals=SQUARE, offsets=["1", "sin(pi*s)**2", "1 + cos(2*pi*s)", "cos(pi*s)**2"]
    ).average()
    assert average.support([2, 5]) == pytest.approx(2)
    assert average.support([-2, 5]) == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(np.abs(average.frictionless), [[0], [1]], atol=1e-12)


# --- Exchange -------------------------------------------------------------------------------------


def test_a_moving_polytope_against_a_fine_grid() -> None:
    # Constraints of 600 phases together, in one linear program: an outer approximation, which the
    # average refines.
    corners = np.array([[2.0, 0.3], [-1.0, 1.0], [-0.5, -1.0], [1.0, -0.8]])
    source = Polytope(
        vertices=lambda s: turned(corners, 0.4 * np.sin(2 * np.pi * s)) + shift(0.1, s)
    )
    average = source.average()
    rows, offsets = [], []
    for s in np.arange(600) / 600:
        points = source.vertices_at(s)
        assert points is not None
        edges = np.roll(points, -1, axis=0) - points
        normals = np.column_stack([edges[:, 1], -edges[:, 0]])
        rows.append(normals)
        offsets.append((normals * points).sum(axis=1))
    for V in np.array([[1.0, 0.2], [-0.3, 1.0], [0, -1]]):
        grid = linprog(-V, A_ub=np.vstack(rows), b_ub=np.concatenate(offsets), bounds=(None, None))
        motion = average.optimal_motion(V)
        assert motion.cost <= -grid.fun + 1e-7
        assert motion.cost == pytest.approx(-grid.fun, rel=1e-4)
        assert abs(motion.gap) <= 1e-8 * 3 * np.linalg.norm(V)
        np.testing.assert_allclose(motion.motions.sum(axis=0), V, atol=1e-12)


def test_half_spaces_with_moving_normals() -> None:
    # A square that turns fully leaves its inscribed circle.
    source = Polytope(normals=lambda s: turned(SQUARE, np.pi * s / 2), offsets=np.ones(4))
    average = source.average()
    for V in np.array([[1.0, 0.0], [0.3, -2.0]]):
        assert average.support(V) == pytest.approx(
            np.linalg.norm(V), abs=3e-8 * float(np.linalg.norm(V))
        )
    np.testing.assert_allclose(average.project([3.0, 4.0]), [0.6, 0.8], atol=1e-7)


def test_an_ellipsoid_in_space() -> None:
    # It turns about e_3 while its height changes: the closed form in the plane, the least height
    # along e_3.
    def shape(s: float) -> Array:
        axes = np.eye(3)
        axes[:2, :2] = turned(np.eye(2), np.pi * s)
        return axes @ np.diag([4, 0.25, (1.5 + np.cos(2 * np.pi * s)) ** 2]) @ axes.T

    average = Ellipsoid(shape).average()
    assert average.support([0, 0, -3]) == pytest.approx(1.5, abs=1e-7)
    assert average.support([3, 4, 0]) == pytest.approx(2.5, abs=1e-7)
    oblique = average.optimal_motion([1.0, 0.5, 0.7])
    assert len(oblique.phases) >= 2
    assert (
        oblique.cost
        < min(Ellipsoid(shape).value(s, [1.0, 0.5, 0.7]) for s in np.linspace(0, 1, 100)) - 1e-3
    )
    assert abs(oblique.gap) < 1e-7


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_the_tolerance_is_kept(tolerance: float) -> None:
    shape = [["1 + 0.5*cos(2*pi*s)", "0.4*sin(2*pi*s)"], ["0.4*sin(2*pi*s)", "1 - 0.5*cos(2*pi*s)"]]
    source = Ellipsoid(shape)
    V = np.array([0.4, 0.9])
    average = source.average(tolerance)
    motion = average.optimal_motion(V)
    assert abs(motion.gap) <= 2 * tolerance
    assert motion.cost == pytest.approx(source.average(1e-10).support(V), abs=2 * tolerance)
    y = average.project([2.0, 1.0])
    assert max(source.distance(y, s) for s in np.linspace(0, 1, 301)) <= 2 * tolerance


def test_a_potential_that_does_not_change() -> None:
    S = np.array([[2.0, 0.5], [0.5, 1.0]])
    fixed = Ellipsoid(S)
    average = Ellipsoid(S).average()
    assert average.support([1, 2]) == pytest.approx(fixed.support([1, 2]), rel=1e-14)
    np.testing.assert_allclose(average.project([3, 1]), fixed.project([3, 1]), atol=1e-14)
    assert not average.depends_on_phase
    vertices = Polytope(vertices=SQUARE).average()
    assert vertices.support([3, 1]) == pytest.approx(3, rel=1e-14)


def test_a_product_is_averaged_by_its_factors() -> None:
    turning = Ellipsoid(lambda s: turned(turned(np.diag([4.0, 0.25]), np.pi * s).T, np.pi * s))
    source = Product((WeightedL1(["2 + cos(2*pi*s)"]), turning))
    average = source.average()
    V = np.array([2.0, 3.0, 4.0])
    assert average.support(V) == pytest.approx(2 + 2.5, abs=1e-7)
    motion = average.optimal_motion(V)
    np.testing.assert_allclose(motion.motions.sum(axis=0), V, atol=1e-12)
    assert motion.cost == pytest.approx(4.5, abs=1e-7)
    assert motion.cost == pytest.approx(
        sum(source.value(s, v) for s, v in zip(motion.phases, motion.motions, strict=True))
    )
    np.testing.assert_allclose(average.project([3.0, 0.3, 0.4]), [1, 0.3, 0.4], atol=1e-9)
    # In a metric that couples the factors, the nearest point of interval times disc.
    metric = np.array([[2.0, 0.7, 0.3], [0.7, 1.0, 0.2], [0.3, 0.2, 3.0]])
    exact = Product((WeightedL1([1.0]), GroupNorm([0.5]))).project([3.0, -1.0, 0.4], metric=metric)
    np.testing.assert_allclose(average.project([3.0, -1.0, 0.4], metric=metric), exact, atol=1e-6)


# --- Where friction vanishes ----------------------------------------------------------------------


def test_two_crossing_segments_leave_nothing() -> None:
    # At s = 0 the ellipse is a segment along e_1, at s = 1/2 one along e_2.
    average = Ellipsoid([["cos(pi*s)**2", "0"], ["0", "sin(pi*s)**2"]]).average()
    motion = average.optimal_motion([1.0, 1.0])
    assert motion.cost == pytest.approx(0, abs=1e-8)
    assert len(motion.phases) == 2  # each component moves while the friction of the other one holds
    np.testing.assert_allclose(motion.motions.sum(axis=0), [1, 1], atol=1e-12)
    np.testing.assert_allclose(average.project([3.0, -1.0]), 0, atol=1e-8)
    np.testing.assert_allclose(average.frictionless @ average.frictionless.T, np.eye(2), atol=1e-12)
    assert average.verdict == "Friction vanishes in every direction: K_av = {0}"


def test_a_segment_that_turns_leaves_nothing() -> None:
    average = Ellipsoid(
        lambda s: np.outer(
            [np.cos(np.pi * s), np.sin(np.pi * s)], [np.cos(np.pi * s), np.sin(np.pi * s)]
        )
    ).average()
    assert average.support([1.0, 0.3]) == pytest.approx(0, abs=1e-8)
    assert average.frictionless.shape == (2, 2)


def test_one_direction_without_friction() -> None:
    # A phase that no sample meets, at which the ellipse is a segment.
    average = Ellipsoid([["1", "0"], ["0", "sin(pi*(s - 0.3))**2"]]).average()
    motion = average.optimal_motion([0.0, 1.0])
    assert motion.cost == pytest.approx(0, abs=1e-8)
    np.testing.assert_allclose(motion.phases, 0.3, atol=1e-8)
    assert average.support([1.0, 5.0]) == pytest.approx(1, abs=1e-8)
    np.testing.assert_allclose(np.abs(average.frictionless), [[0], [1]], atol=1e-7)
    np.testing.assert_allclose(average.project([0.4, 2.0]), [0.4, 0], atol=1e-7)
    assert "in 1 of 2 directions" in average.verdict


def test_a_shrinking_axis_is_found_among_others() -> None:
    # Two axes shrink to 0 at different phases, in directions that are no coordinates, in R³.
    axes = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]

    def shape(s: float) -> Array:
        lengths = np.array(
            [1.0, np.abs(np.sin(np.pi * (s - 0.41))), np.abs(np.sin(np.pi * (s - 0.87)))]
        )
        return axes @ np.diag(lengths**2) @ axes.T

    average = Ellipsoid(shape).average()
    assert average.frictionless.shape == (3, 2)
    np.testing.assert_allclose(average.frictionless.T @ axes[:, 0], 0, atol=1e-6)
    V = np.array([0.3, -1.0, 0.4])
    assert average.support(V) == pytest.approx(abs(V @ axes[:, 0]), abs=1e-7)


def test_flat_polytopes() -> None:
    average = Polytope(
        vertices=lambda s: SQUARE * [1 + 0.5 * np.cos(2 * np.pi * s), np.sin(np.pi * s)]
    ).average()
    assert (
        average.support([1.0, 3.0]) == pytest.approx(1.5, abs=1e-7)
        or average.support([1.0, 3.0]) < 1.5
    )
    assert average.support([0.0, 3.0]) == pytest.approx(0, abs=1e-8)
    np.testing.assert_allclose(np.abs(average.frictionless), [[0], [1]], atol=1e-7)


# --- What cannot be reached -----------------------------------------------------------------------


def test_an_infimum_that_is_hardly_attained() -> None:
    # Two discs touch at 0, in which K_av = {0} has a tangent: Ψ_av(e_2) = 0 needs ever larger
    # motions to and fro. Polygons in place of the discs have corners there, and the infimum is
    # attained: by the larger a motion the more corners there are.
    largest = []
    for corners in (10, 40, 160):
        angles = 2 * np.pi * np.arange(corners) / corners
        disc = np.column_stack([np.cos(angles), np.sin(angles)])
        average = Polytope(vertices=lambda s, disc=disc: disc + shift(1.0, s)).average()
        motion = average.optimal_motion([0.0, 1.0])
        assert motion.cost == pytest.approx(0, abs=1e-7)
        largest.append(np.abs(motion.motions).max())
    assert largest[0] > 1
    np.testing.assert_allclose(np.divide(largest[1:], largest[:-1]), 4, rtol=0.1)


def test_a_failure_says_what_was_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stickslip.rate_independent.averaging.semi_infinite.MOST_ROUNDS", 1)
    average = Polytope(
        vertices=lambda s: SQUARE * [1 + 0.5 * np.cos(2 * np.pi * s), np.sin(np.pi * s)]
    ).average()
    with pytest.raises(
        ConvergenceError,
        match=r"after 1 iterations the relative duality gap is .*Increase the tolerance 1e-08",
    ):
        average.optimal_motion([1.0, 1.0])


def test_cone_programs_say_when_they_have_no_solution() -> None:
    with pytest.raises(ConvergenceError, match="HiGHS found no solution"):
        solve_cones([polyhedron(np.array([[1.0, 0]]), np.ones(1))], np.array([0.0, 1.0]))


def test_hulls_as_cones() -> None:
    xi, motions = solve_cones([hull(SQUARE)], np.array([0.3, -2.0]))
    np.testing.assert_allclose(xi, [0, -1], atol=1e-12)
    np.testing.assert_allclose(motions.sum(axis=0), [0.3, -2])


def test_support_functions_are_averaged() -> None:
    # |v_1| and |v_2| with the weights of [M] Example 2.1, given as a function only.
    def weights(s: float) -> Array:
        return np.array([2 - np.cos(2 * np.pi * s), 2 + np.cos(2 * np.pi * s)])

    source: Dissipation = SupportFunction(
        lambda s, v: float(weights(s) @ np.abs(v)), 2, lambda s, v: weights(s) * np.sign(v)
    )
    average = source.average(1e-7)
    motion = average.optimal_motion([1.0, -2.0])
    assert motion.cost == pytest.approx(3, abs=1e-6)
    assert abs(motion.gap) < 1e-6


def test_a_force_far_outside_at_a_narrow_waist_is_said_to_be() -> None:
    # At the samples, the force is outside by a millionth only; at the waist by a tenth.
    average = Ellipsoid(
        [["1 - 0.9*exp(-(sin(pi*(s - 0.3003))/1e-4)**2)", "0"], ["0", "1"]]
    ).average()
    waist = Ellipsoid([[0.1, 0], [0, 1]])
    for beyond in (-1e-6, 1e-6, 1e-3):
        xi = np.array([0.2, np.sqrt((1.0 + beyond) ** 2 - 0.04)])
        true = waist.distance(xi)
        assert true <= average.excess(xi) <= 1.05 * true
        assert average.sampled(np.zeros(1)).excess(xi) == pytest.approx(average.excess(xi))


def test_a_force_that_slides_asks_for_few_stretches() -> None:
    # The contact moves all the time; a chord would have to be shorter than the root of the
    # tolerance everywhere.
    half = "15/8*{}(2*pi*s)"
    turning = [
        [f"17/8 + {half.format('cos')}", half.format("sin")],
        [half.format("sin"), f"17/8 - {half.format('cos')}"],
    ]
    average = Ellipsoid(turning).average()
    for angle in np.linspace(0.0, 7.0, 150):
        point = average.project(
            [2.0 * np.cos(angle), 2.0 * np.sin(angle)], metric=np.diag([1.0, 1.5])
        )
        assert np.linalg.norm(point) == pytest.approx(0.5, abs=1e-8)
        assert average.contains(point, tolerance=0.0)
    assert len(average.cover) < 5000


def test_a_product_of_averages_remembers(monkeypatch: pytest.MonkeyPatch) -> None:
    from stickslip.rate_independent.averaging import semi_infinite
    from stickslip.rate_independent.averaging.cover import Cover

    average = Product(
        (Ellipsoid([["1 + cos(2*pi*s)/2", "0"], ["0", "1"]]), WeightedL1(["1 + sin(2*pi*s)/2"]))
    ).average()
    metric = np.array([[2.0, 0.3, 0.5], [0.3, 1.0, 0.2], [0.5, 0.2, 1.0]])
    made = []
    monkeypatch.setattr(semi_infinite, "Cover", lambda source: made.append(source) or Cover(source))
    first = average.project([2.0, 1.0, 3.0], metric=metric)
    np.testing.assert_allclose(average.project([2.0, 1.0, 3.0], metric=metric), first, atol=1e-6)
    average.project([2.01, 1.0, 3.0], metric=metric)
    assert len([source for source in made if isinstance(source, Product)]) == 1
