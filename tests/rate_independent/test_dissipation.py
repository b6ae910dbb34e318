"""Dissipation potentials: values, stable sets, nearest points, and what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.rate_independent.dissipation import (
    Dissipation,
    Ellipsoid,
    GroupNorm,
    Polytope,
    Product,
    SupportFunction,
    WeightedL1,
)
from stickslip.rate_independent.sets.projections import nearest_in_box

DIAMOND = np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])


def spd(rng: np.random.Generator, n: int, least: float = 0.1) -> Array:
    root = rng.normal(size=(n, n))
    return root @ root.T / n + least * np.eye(n)


# --- Values ---------------------------------------------------------------------------------------


def test_weighted_l1() -> None:
    potential = WeightedL1(["2 - cos(2*pi*s)", 1.5], lower=["1", "sin(pi*s)**2"])
    assert potential.dimension == 2
    assert potential.depends_on_phase
    assert potential.value(0.25, [1.0, 2.0]) == pytest.approx(2 + 3)
    assert potential.value(0.25, [-1.0, -2.0]) == pytest.approx(1 + 2 * 0.5)
    assert potential.support([-1.0, -2.0], 0.25) == potential.value(0.25, [-1.0, -2.0])
    lower, upper = potential.bounds(0.5)
    np.testing.assert_allclose(lower, [-1, -1])
    np.testing.assert_allclose(upper, [3, 1.5])
    assert potential.contains([3, -1], 0.5)
    assert not potential.contains([3, -1], 0.4)
    assert potential.distance([6, -5], 0.5) == pytest.approx(5)
    np.testing.assert_allclose(potential.prox([4, 0.5], 0.5), [1, 0])
    np.testing.assert_allclose(potential.prox([4, 1.0], 0.5, step=0.5), [2.5, 0.25])


def test_group_norm() -> None:
    potential = GroupNorm(lambda s: [1 + s * (1 - s), 2.0])
    assert potential.dimension == 4
    assert potential.value(0.5, [3, 4, 0, -1]) == pytest.approx(1.25 * 5 + 2)
    np.testing.assert_allclose(potential.radii_at(0.5), [1.25, 2])
    np.testing.assert_allclose(potential.project([3, 4, 0, -1], 0.5), [0.75, 1, 0, -1])
    assert potential.distance([3, 4, 0, -5], 0.5) == pytest.approx(np.hypot(3.75, 3))
    assert GroupNorm([1.0, 2.0], size=3).value(0, [1, 2, 2, 0, 0, -1]) == pytest.approx(5)


def test_ellipsoid() -> None:
    potential = Ellipsoid([["4", "0"], ["0", "1 + sin(2*pi*s)**2"]])
    assert potential.value(0.25, [3, 4]) == pytest.approx(np.sqrt(36 + 32))
    assert potential.contains([2, 0])
    assert not potential.contains([2, 0.1])
    np.testing.assert_allclose(potential.project([5, 0], 0.3), [2, 0])
    np.testing.assert_allclose(potential.project([0.3, 0.2], 0.3), [0.3, 0.2])
    # A segment: friction vanishes across it.
    segment = Ellipsoid(np.outer([3, 4], [3, 4]))
    assert segment.value(0, [4, -3]) == pytest.approx(0, abs=1e-14)
    np.testing.assert_allclose(segment.project([1, 2]), np.array([3, 4]) * 11 / 25)
    np.testing.assert_allclose(segment.project([10, 10]), [3, 4])
    np.testing.assert_array_equal(Ellipsoid(np.zeros((2, 2))).project([1, 2]), [0, 0])


def test_polytope_by_vertices_and_by_half_spaces() -> None:
    by_vertices = Polytope(vertices=DIAMOND)
    by_faces = Polytope(normals=[[1, 1], [1, -1], [-2, 2], [-1, -1]], offsets=[1, 1, 2, 1])
    rng = np.random.default_rng(0)
    for v in rng.normal(size=(20, 2)):
        assert by_vertices.support(v) == pytest.approx(np.abs(v).max())
        assert by_faces.support(v) == pytest.approx(np.abs(v).max())
        np.testing.assert_allclose(by_vertices.project(2 * v), by_faces.project(2 * v), atol=1e-14)
        assert by_vertices.excess(v) == pytest.approx(by_vertices.excess(v, 0.7))
        assert np.sign(by_vertices.excess(v)) == np.sign(by_faces.excess(v))
    np.testing.assert_allclose(by_faces.project([1, 1]), [0.5, 0.5])
    assert by_faces.contains([0.5, 0.5])


def test_polytope_without_interior() -> None:
    wedge = Polytope(normals=[[1, 0], [-1, 0], [0, 1], [0, -1]], offsets=[1, 1, 0, 0])
    assert wedge.support([2, 5]) == pytest.approx(2)
    np.testing.assert_allclose(wedge.project([3, 4]), [1, 0], atol=1e-15)
    interval = Polytope(normals=[[2.0], [-1.0]], offsets=[1.0, 3.0])
    assert interval.support([1.0]) == pytest.approx(0.5)
    assert interval.support([-1.0]) == pytest.approx(3)


def test_product() -> None:
    potential = Product((WeightedL1(["2 + cos(2*pi*s)"]), GroupNorm([1.0])))
    assert potential.dimension == 3
    assert potential.depends_on_phase
    assert potential.value(0.5, [2, 3, 4]) == pytest.approx(2 + 5)
    np.testing.assert_allclose(potential.project([2, 3, 4], 0.5), [1, 0.6, 0.8])
    assert potential.excess([0, 0.6, 0.7], 0.5) < 0 < potential.excess([0, 0.6, 0.9], 0.5)


@pytest.mark.parametrize("given_gradient", [True, False])
def test_support_function(given_gradient: bool) -> None:
    S = np.array([[3.0, 1.0, 0], [1.0, 2.0, 0.3], [0, 0.3, 0.5]])
    exact = Ellipsoid(S)
    potential = SupportFunction(
        lambda s, v: np.sqrt(v @ S @ v),
        3,
        (lambda s, v: S @ v / np.sqrt(v @ S @ v)) if given_gradient else None,
        depends_on_phase=False,
    )
    metric = np.diag([1.0, 4.0, 0.5])
    rng = np.random.default_rng(3)
    for xi in 3 * rng.normal(size=(4, 3)):
        assert potential.distance(xi) == pytest.approx(exact.distance(xi), abs=1e-8)
        np.testing.assert_allclose(potential.project(xi), exact.project(xi), atol=1e-6)
        np.testing.assert_allclose(
            potential.project(xi, metric=metric), exact.project(xi, metric=metric), atol=1e-6
        )
        np.testing.assert_allclose(potential.exposed(xi), exact.exposed(xi), atol=1e-9)


def test_support_function_with_corners() -> None:
    # Without its subgradient, |v|_1 has to be asked beside its kinks.
    potential = SupportFunction(lambda s, v: np.abs(v).sum(), 3, depends_on_phase=False)
    np.testing.assert_allclose(potential.project([3.0, 0.2, -5.0]), [1, 0.2, -1], atol=1e-8)
    np.testing.assert_allclose(potential.project([0.3, 0.2, -0.5]), [0.3, 0.2, -0.5], atol=1e-8)


@pytest.mark.parametrize("n", [2, 3])
def test_support_functions_with_edges_and_curves(n: int) -> None:
    # A sum of segments and a ball: with and without its subgradient.
    rng = np.random.default_rng(n)
    for _ in range(10):
        D = rng.normal(size=(3, n))
        r = rng.uniform(0, 0.7)

        def psi(s: float, v: Array, D: Array = D, r: float = r) -> float:
            return float(np.abs(D @ v).sum() + r * np.linalg.norm(v))

        def slope(s: float, v: Array, D: Array = D, r: float = r) -> Array:
            return D.T @ np.sign(D @ v) + r * v / np.linalg.norm(v)

        exact = SupportFunction(psi, n, slope, depends_on_phase=False)
        xi = 4 * rng.normal(size=n)
        y = exact.project(xi)
        assert exact.support(xi - y) - (xi - y) @ y <= 1e-8 * np.linalg.norm(xi)
        found = SupportFunction(psi, n, depends_on_phase=False).project(xi)
        np.testing.assert_allclose(found, y, atol=1e-4)


def test_formulas_jump_and_vanish() -> None:
    square = WeightedL1(["piecewise(sin(2*pi*s) > 0, 1, 2)", "max(cos(2*pi*s), 0)"])
    np.testing.assert_array_equal(square.bounds(0.2)[1][0], 1)
    np.testing.assert_array_equal(square.bounds(0.7)[1], [2, 0])
    np.testing.assert_allclose(square.bounds(-0.3)[1], square.bounds(0.7)[1])
    np.testing.assert_allclose(square.bounds(1e5 + 0.7)[1], square.bounds(0.7)[1])


# --- Nearest points -------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 5, 20, 60])
def test_box_in_a_metric(n: int) -> None:
    rng = np.random.default_rng(n)
    for _ in range(5):
        M = spd(rng, n, 1e-3)
        xi = 3 * rng.normal(size=n)
        potential = WeightedL1(
            rng.uniform(0, 1, n), rng.uniform(0, 1, n) * (rng.uniform(size=n) > 0.2)
        )
        lower, upper = potential.bounds()
        y = potential.project(xi, metric=M)
        root = np.linalg.cholesky(M).T
        # lsq_linear asks for lower < upper.
        other = lsq_linear(root, root @ xi, (lower - 1e-14, upper), method="bvls", tol=1e-15)
        np.testing.assert_allclose(y, other.x, atol=1e-8)
        # It is the fixed point of projected gradient steps.
        np.testing.assert_allclose(np.clip(y + M @ (xi - y), lower, upper), y, atol=1e-12)


def test_box_pivoting_ends_where_blocks_cycle() -> None:
    # Murty's matrix makes pivoting by least index as slow as it can be; Hilbert's is close to
    # singular.
    for n in (4, 8, 10):
        L = np.tril(2.0 * np.ones((n, n)), -1) + np.eye(n)
        M = L @ L.T
        xi = np.linalg.solve(M, np.cumsum(np.ones(n)))
        y = nearest_in_box(M, xi, np.zeros(n), np.full(n, 1e3))
        force = M @ (xi - y)
        assert np.all((np.abs(force) < 1e-9) | (y == 0))
        assert force.max() < 1e-9
    i = np.arange(8)
    hilbert = 1.0 / (i[:, None] + i + 1)
    xi = np.random.default_rng(0).normal(size=8)
    y = nearest_in_box(hilbert, xi, -0.1 * np.ones(8), 0.1 * np.ones(8))
    np.testing.assert_allclose(np.clip(y + hilbert @ (xi - y), -0.1, 0.1), y, atol=1e-13)


KINDS: dict[str, Callable[[np.random.Generator, int], Dissipation]] = {
    "groups": lambda rng, n: GroupNorm(rng.uniform(0.2, 1, n // 2)),
    "ellipsoid": lambda rng, n: Ellipsoid(spd(rng, n)),
    "vertices": lambda rng, n: Polytope(
        vertices=np.vstack([rng.normal(size=(3 * n, n)), -np.ones((1, n)), np.eye(n)])
    ),
    "half-spaces": lambda rng, n: Polytope(
        normals=np.vstack([rng.normal(size=(n, n)), np.eye(n), -np.eye(n)]),
        offsets=rng.uniform(0.2, 1, 3 * n),
    ),
    "product": lambda rng, n: Product(
        (WeightedL1(rng.uniform(0.2, 1, n - 2)), Ellipsoid(spd(rng, 2)))
    ),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [2, 4, 8])
def test_nearest_point_in_a_metric(kind: str, n: int) -> None:
    if kind == "product" and n == 2:
        n = 3
    rng = np.random.default_rng(n)
    potential = KINDS[kind](rng, n)
    for size in (0.05, 1.0, 10.0):
        xi = size * rng.normal(size=n)
        M = spd(rng, n)
        y = potential.project(xi, metric=M)
        pull = M @ (xi - y)
        assert potential.distance(y) < 1e-12
        # ⟨M(ξ − y), η − y⟩ ≤ 0 for all η in K: the support function in the direction of the pull is
        # attained at y.
        scale = np.linalg.norm(M) * (np.linalg.norm(xi) + np.linalg.norm(y)) * np.linalg.norm(y)
        assert potential.support(pull) - pull @ y <= 1e-12 * scale
        if potential.contains(xi):
            np.testing.assert_allclose(y, xi, atol=1e-14)


def test_nearest_point_by_a_nonlinear_program() -> None:
    rng = np.random.default_rng(7)
    potential = GroupNorm([0.5, 1.0, 0.2])
    M = spd(rng, 6)
    xi = 2 * rng.normal(size=6)
    result = minimize(
        lambda y: (xi - y) @ M @ (xi - y) / 2,
        np.zeros(6),
        jac=lambda y: M @ (y - xi),
        method="SLSQP",
        constraints={
            "type": "ineq",
            "fun": lambda y: potential.radii_at() ** 2 - potential.norms(y) ** 2,
        },
        options={"ftol": 1e-14, "maxiter": 300},
    )
    np.testing.assert_allclose(potential.project(xi, metric=M), result.x, atol=1e-6)


@pytest.mark.parametrize("beyond", [1e-3, 1e-6, 1e-9, 1e-12])
def test_nearest_points_just_outside(beyond: float) -> None:
    # A point a hair outside a face comes back onto that face, and no further.
    for potential in (
        Polytope(vertices=DIAMOND),
        Polytope(normals=[[1, 1], [1, -1], [-1, 1], [-1, -1]], offsets=np.ones(4)),
    ):
        y = np.array([0.3, 0.7])
        np.testing.assert_allclose(potential.project(y + beyond * np.array([1, 1])), y, atol=1e-15)
    disc = Ellipsoid(np.eye(2))
    y = np.array([0.6, 0.8])
    np.testing.assert_allclose(disc.project(y * (1 + beyond)), y, atol=1e-15)


def test_units_do_not_matter() -> None:
    rng = np.random.default_rng(5)
    M = spd(rng, 4)
    xi = rng.normal(size=4)
    for unit in (1e-9, 1e9):
        for small, large in (
            (GroupNorm([0.3, 0.5]), GroupNorm([0.3 * unit, 0.5 * unit])),
            (WeightedL1(np.full(4, 0.3)), WeightedL1(np.full(4, 0.3 * unit))),
            (Ellipsoid(0.1 * np.eye(4)), Ellipsoid(0.1 * unit**2 * np.eye(4))),
        ):
            np.testing.assert_allclose(
                large.project(unit * xi, metric=M),
                unit * small.project(xi, metric=M),
                rtol=1e-9,
                atol=1e-11 * unit,
            )


# --- Many components ------------------------------------------------------------------------------


def test_a_million_components() -> None:
    x = np.linspace(0, 1, 1_000_000)
    wave = WeightedL1(lambda s: 1 + 0.5 * np.cos(2 * np.pi * (s - x)))
    lower, upper = wave.bounds(0.25)
    np.testing.assert_allclose(upper, 1 + 0.5 * np.sin(2 * np.pi * x), atol=1e-12)
    np.testing.assert_array_equal(lower, -upper)
    discs = GroupNorm(np.ones(500_000))
    assert discs.value(0, np.ones(1_000_000)) == pytest.approx(500_000 * np.sqrt(2))


# --- What is refused ------------------------------------------------------------------------------

two = WeightedL1([1.0, 2.0])
BAD: dict[str, tuple[Callable[[], object], str]] = {
    "negative": (
        lambda: WeightedL1([1.0, -0.5]),
        r"weights: component 1 is -0.5, but a threshold cannot be negative",
    ),
    "negative at a phase": (
        lambda: WeightedL1(["1", "cos(2*pi*s)"]),
        r"component 1 is -0\.\d+ at phase s = 0\.\d+, .*Write max\(\.\.\., 0\)",
    ),
    "negative later": (
        lambda: WeightedL1(lambda s: [1 - 2 * (abs(s - 0.5) < 0.01)]).value(0.5, [1.0]),
        r"component 0 is -1 at phase s = 0.5",
    ),
    "NaN": (lambda: WeightedL1([1.0, np.nan]), r"weights\[1\]: it is nan"),
    "NaN at a phase": (
        lambda: GroupNorm(lambda s: [np.nan if 0.94 < s < 0.96 else 1.0]).radii_at(0.95),
        r"phase s = 0.95",
    ),
    "undefined formula": (
        lambda: WeightedL1(["log(s)"]),
        r"weights\[0\]: it is -inf at phase s = 0",
    ),
    "not periodic": (
        lambda: WeightedL1(["2 + cos(s)"]),
        r"not 1-periodic in the phase.*cos\(2\*pi\*s\)",
    ),
    "sizes change": (
        lambda: WeightedL1(lambda s: np.ones(2 + (s > 0.5))),
        r"shape is \(3,\) at phase s = 0\.\d+, but \(2,\)",
    ),
    "two lengths": (
        lambda: WeightedL1([1.0, 2.0], lower=[1.0]),
        r"lower: it has 1 components, but there are 2 weights",
    ),
    "a number": (lambda: WeightedL1(1.0), r"weights: its shape is \(\)"),
    "nothing": (
        lambda: WeightedL1(None),
        r"not an array of numbers, a function of s or a formula",
    ),
    "unknown name": (lambda: WeightedL1(["1 + t"]), r"weights\[0\]: unknown name 't'"),
    "fails": (
        lambda: WeightedL1(lambda s: [1 / (s - s)]),
        r"the function raises an error at phase s = 0 \(ZeroDivisionError",
    ),
    "group size": (lambda: GroupNorm([1.0], size=0), r"size: 0 is not a number of components"),
    "not square": (
        lambda: Ellipsoid(np.ones((2, 3))),
        r"shape: its shape \(2, 3\) is not square",
    ),
    "not symmetric": (lambda: Ellipsoid([[1, 2], [0, 5]]), r"shape: it is not symmetric"),
    "indefinite": (
        lambda: Ellipsoid([["cos(2*pi*s)", "0"], ["0", "1"]]),
        r"negative eigenvalue -0\.\d+ at phase s = 0\.\d+",
    ),
    "0 outside": (
        lambda: Polytope(vertices=[[1, 0], [2, 0], [1, 1]]),
        r"vertices: their convex hull does not contain 0 \(distance 1\)",
    ),
    "0 outside at a phase": (
        lambda: Polytope(vertices=lambda s: DIAMOND + np.array([2 * np.sin(np.pi * s) ** 2, 0])),
        r"does not contain 0 at phase s = 0\.\d+",
    ),
    "0 outside a half-space": (
        lambda: Polytope(normals=[[1.0], [-1.0]], offsets=[1.0, -0.5]),
        r"offsets: component 1 is -0.5",
    ),
    "unbounded": (
        lambda: Polytope(normals=[[1, 0], [0, 1], [0, -1]], offsets=[1, 1, 1]),
        r"do not bound every direction",
    ),
    "no normal": (
        lambda: Polytope(normals=[[0, 0], [0, 1]], offsets=[1, 1]),
        r"normals: row 0 is 0",
    ),
    "moving polytope": (
        lambda: Polytope(vertices=lambda s: DIAMOND * (1 + s)),
        r"vertices: it is not 1-periodic",
    ),
    "both descriptions": (
        lambda: Polytope(vertices=DIAMOND, normals=DIAMOND),
        r"vertices, or normals and offsets",
    ),
    "too few offsets": (lambda: Polytope(normals=DIAMOND, offsets=[1, 1]), r"there are 4 normals"),
    "no potential": (
        lambda: Product((two, 3)),  # pyright: ignore[reportArgumentType]
        r"factors\[1\]: expected a dissipation potential, got int",
    ),
    "no factor": (lambda: Product(()), r"factors: the list is empty"),
    "dimension": (lambda: SupportFunction(lambda s, v: 1.0, 0), r"dimension: 0 is not a dimension"),
    "not homogeneous": (
        lambda: SupportFunction(lambda s, v: v @ v, 2),
        r"not 1-homogeneous at phase s = 0",
    ),
    "not convex": (
        lambda: SupportFunction(lambda s, v: np.sqrt(np.abs(v[0] * v[1])), 2),
        r"not convex at phase s = 0",
    ),
    "below 0": (lambda: SupportFunction(lambda s, v: v.sum(), 2), r"K\(s\) must contain 0"),
    "period of a function": (
        lambda: SupportFunction(lambda s, v: (1 + s) * np.abs(v).sum(), 2),
        r"differs between the phases s = 0 and s = 1",
    ),
    "vector too long": (
        lambda: two.value(0, [1, 2, 3]),
        r"v: its shape is \(3,\), but the potential is defined on R\^2",
    ),
    "vector of words": (lambda: two.project(["a", "b"]), r"xi: expected numbers"),
    "vector with NaN": (lambda: two.distance([np.nan, 1]), r"xi\[0\]: it is nan"),
    "step": (lambda: two.prox([1, 2], step=0), r"step: 0 is not positive"),
    "metric too small": (
        lambda: two.project([1, 2], metric=[[1.0]]),
        r"metric: its shape is \(1, 1\)",
    ),
    "metric not symmetric": (
        lambda: two.project([1, 2], metric=[[1, 2], [0, 5]]),
        r"metric: it is not symmetric",
    ),
    "metric indefinite": (
        lambda: two.project([1, 2], metric=np.diag([1, -1])),
        r"metric: it is not positive definite",
    ),
    "tolerance": (lambda: Ellipsoid(np.eye(2)).average(0.0), r"tolerance: 0.0 is not a tolerance"),
}


@pytest.mark.parametrize("case", BAD)
def test_refusals(case: str) -> None:
    make, message = BAD[case]
    with pytest.raises(DeclarationError, match=message):
        make()


def test_an_inaccurate_subgradient_is_noticed() -> None:
    # The subgradient belongs to a smaller ellipse: distances cannot be certified.
    potential = SupportFunction(
        lambda s, v: np.hypot(v[0], 2 * v[1]),
        2,
        lambda s, v: np.array([v[0], v[1]]) / np.hypot(*v),
        False,
    )
    with pytest.raises(ConvergenceError, match="accuracy of the distance"):
        potential.project([0.0, 5.0])
