"""The multigrid step against enumeration, cone programs and plain linear algebra; its laws; what it
refuses."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.sparse.linalg import spsolve

from stickslip.arrays import Array
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.rate_independent.solvers.hierarchy import Hierarchy
from stickslip.rate_independent.solvers.multigrid import (
    Multigrid,
    StepOutcome,
    block_rows,
    lowest_along,
)
from stickslip.rate_independent.solvers.smoothing import BlockRows, make_block_space, relax

clarabel: Any = import_module("clarabel")  # compiled, without types

law = settings(max_examples=60, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32 - 1)


def membrane(N: int) -> tuple[sp.csr_array, Array, Array]:
    """−Δ + 1 on a square grid of N² points, and their coordinates."""
    h = 1.0 / (N + 1)
    second = (
        sp.diags_array(
            [-np.ones(N - 1), 2.0 * np.ones(N), -np.ones(N - 1)],
            offsets=[-1, 0, 1],  # pyright: ignore[reportArgumentType]
        )
        / h**2
    )
    line = np.arange(1, N + 1) * h
    x, y = (part.ravel() for part in np.meshgrid(line, line, indexing="ij"))
    return sp.csr_array(sp.kronsum(second, second) + sp.eye_array(N * N)), x, y


@cache
def membrane_solver(N: int) -> tuple[Multigrid, sp.csr_array, Array, Array]:
    A, x, y = membrane(N)
    return Multigrid(A), A, x, y


def random_matrix(rng: np.random.Generator, n: int) -> Array:
    axes = np.linalg.qr(rng.normal(size=(n, n)))[0]
    A = axes @ np.diag(10.0 ** rng.uniform(-2, 2, n)) @ axes.T
    return (A + A.T) / 2


def random_box(rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """Different thresholds for the two directions, some of them 0."""
    lower, upper = (rng.uniform(0.0, 1.0, n) * (rng.random(n) > 0.2) for _ in range(2))
    return -lower, upper


def violation(A: Array | sp.csr_array, r: Array, d: Array, lower: Array, upper: Array) -> float:
    """Largest distance of r − A d to the subdifferential, box."""
    force = r - A @ d
    at_rest = np.maximum(force - upper, lower - force)
    return float(
        np.select(
            [d > 0, d < 0], [abs(force - upper), abs(force - lower)], np.maximum(at_rest, 0.0)
        ).max()
    )


def violation_of_groups(A: Array | sp.csr_array, r: Array, d: Array, radii: Array) -> float:
    """Largest distance of r − A d to the subdifferential, balls."""
    m = len(r) // len(radii)
    force = (r - A @ d).reshape(-1, m)
    v = d.reshape(-1, m)
    length = np.linalg.norm(v, axis=1)
    moving = length > 0
    unit = v / np.where(moving, length, 1.0)[:, None]
    sliding = np.linalg.norm(force - radii[:, None] * unit, axis=1)
    return float(
        np.where(moving, sliding, np.maximum(np.linalg.norm(force, axis=1) - radii, 0.0)).max()
    )


def energy(A: sp.csr_array, r: Array, d: Array, lower: Array, upper: Array) -> float:
    return float(0.5 * d @ (A @ d) - r @ d + np.maximum(lower * d, upper * d).sum())


def by_enumeration(A: Array, r: Array, lower: Array, upper: Array) -> Array:
    """The one of all 3ⁿ patterns of slip and stick that fits best."""
    best = (np.inf, np.zeros(len(r)))
    for pattern in product((-1, 0, 1), repeat=len(r)):
        signs = np.array(pattern)
        free = signs != 0
        d = np.zeros(len(r))
        if free.any():
            d[free] = np.linalg.solve(
                A[np.ix_(free, free)], (r - np.where(signs > 0, upper, lower))[free]
            )
        d[d * signs < 0] = 0.0
        best = min(best, (violation(A, r, d, lower, upper), d), key=lambda found: found[0])
    return best[1]


def by_clarabel(
    A: sp.csr_array, r: Array, radii: Array, m: int, lower: Array | None = None
) -> Array:
    """Epigraph form: minimise ½ d·A d − r·d + Σ t, t ≥ radius |d| (m > 1) or t ≥ upper d, t ≥ lower
    d."""
    n, k = len(r), len(radii)
    H = sp.block_diag((A, sp.csc_array((k, k))), format="csc")
    if lower is not None:
        rows = sp.vstack([sp.hstack([sp.diags_array(w), -sp.eye_array(k)]) for w in (radii, lower)])
        cones = [clarabel.NonnegativeConeT(2 * k)]
    else:
        blocks = np.full((k, m + 1), -1.0)
        blocks[:, 1:] = -radii[:, None]
        order = np.concatenate([np.arange(n, n + k)[:, None], np.arange(n).reshape(k, m)], axis=1)
        rows = sp.csr_array(
            (blocks.ravel(), (np.arange(n + k), order.ravel())), shape=(n + k, n + k)
        )
        cones = [clarabel.SecondOrderConeT(m + 1) for _ in range(k)]
    options = clarabel.DefaultSettings()
    options.verbose = False
    options.tol_gap_abs = options.tol_gap_rel = options.tol_feas = 1e-12
    right = np.zeros(2 * k if lower is not None else n + k)
    linear = np.concatenate([-r, np.ones(k)])
    return np.array(
        clarabel.DefaultSolver(
            sp.triu(H, format="csc"), linear, rows.tocsc(), right, cones, options
        )
        .solve()
        .x
    )[:n]


def objective(
    A: sp.csr_array, r: Array, d: Array, m: int, radii: Array, lower: Array | None = None
) -> tuple[float, float]:
    """½ d·A d − r·d + Ψ(d), and the sum of the moduli of its terms."""
    length = np.linalg.norm(d.reshape(-1, m), axis=1)
    friction = (radii * length).sum() if lower is None else np.maximum(radii * d, lower * d).sum()
    terms = d @ (A @ d) / 2, -(r @ d), friction
    return float(sum(terms)), float(sum(map(abs, terms)))


# ------------------------------------------------------------------------------------------------
# exactness


@law
@given(seeds)
def test_box_agrees_with_enumeration(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    A, (lower, upper) = random_matrix(rng, n), random_box(rng, n)
    r = rng.normal(size=n) * 10.0 ** rng.uniform(-1, 2)
    result = Multigrid(sp.csr_array(A)).step(r, lower, upper, tolerance=1e-10)
    expected = by_enumeration(A, r, lower, upper)
    error = result.delta - expected
    assert error @ A @ error <= 1e-16 * (1.0 + expected @ A @ expected)


@law
@given(seeds, st.sampled_from([2, 3]))
def test_the_minimum_of_a_block_is_exact(seed: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    B = random_matrix(rng, m) * 10.0 ** rng.uniform(-6, 6)
    g = rng.normal(size=m)
    radius = np.linalg.norm(g) * rng.choice([0.0, 1e-9, 0.3, 1 - 1e-6, 1 - 1e-14, 1 + 1e-12])
    d = np.full((1, m), np.nan)
    A = BlockRows(np.array([0, 1], np.int32), np.array([0], np.int32), B[None])
    relax(A, g[None], np.array([-radius]), np.array([radius]), d, make_block_space(m))
    (x,) = d
    if radius >= (1 - 1e-13) * np.linalg.norm(g):
        assert not x.any()
    else:
        rest = g - B @ x - radius * x / np.linalg.norm(x)
        assert np.linalg.norm(rest) <= 1e-12 * np.linalg.norm(g)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("m", [1, 2, 3])
def test_random_problems_agree_with_clarabel(seed: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    n = 120
    A = sp.csr_array(random_matrix(rng, n))
    r = rng.normal(size=n) * 3.0
    solver = Multigrid(A, groups=m)
    if m == 1:
        lower, upper = random_box(rng, n)
        result = solver.step(r, lower, upper)
        expected = by_clarabel(A, r, upper, 1, lower)
        rows = upper, lower
    else:
        radii = rng.uniform(0.0, 1.0, n // m) * (rng.random(n // m) > 0.2)
        result = solver.step(r, radii=radii)
        expected = by_clarabel(A, r, radii, m)
        rows = (radii,)
        assert violation_of_groups(A, r, result.delta, radii) <= 1e-8 * radii.max()
    assert result.outcome is StepOutcome.CONVERGED
    # What is above the minimum by h is away from it by e with ½ e·A e ≤ h, whatever the condition
    # of A. Clarabel is above it by what it is asked for.
    (own, size), (its, _) = (objective(A, r, d, m, *rows) for d in (result.delta, expected))
    above = its - own
    assert -1e-12 * size <= above <= 1e-9 * size
    error = result.delta - expected
    assert error @ (A @ error) / 2 <= above + 1e-12 * size


def test_vector_friction_on_an_elastic_sheet() -> None:
    """Plane elasticity with scikit-fem on an unstructured mesh, groups of 2, against a cone
    program."""
    skfem = pytest.importorskip("skfem")
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    basis = skfem.Basis(unstructured_mesh(4), skfem.ElementVector(skfem.ElementTriP1()))
    A = sp.csr_array(
        linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis) + vector_mass(basis)
    )
    area = lumped_area(basis)
    x, y = basis.mesh.p
    r = (area * np.stack([np.sin(4 * x + y), np.cos(3 * y)])).T.ravel()
    radii = area * (0.9 + 0.4 * x)
    result = Multigrid(A, groups=2).step(r, radii=radii)
    moving = result.delta.reshape(-1, 2).any(axis=1).mean()
    assert 0.1 < moving < 0.9
    assert violation_of_groups(A, r, result.delta, radii) <= 1e-8 * radii.max()
    assert_allclose(result.delta, by_clarabel(A, r, radii, 2), atol=1e-6 * abs(result.delta).max())


@pytest.mark.parametrize("degree", [1, 2])
def test_scalar_friction_on_an_unstructured_mesh(degree: int) -> None:
    skfem = pytest.importorskip("skfem")
    from skfem.models.poisson import laplace, mass

    basis = skfem.Basis(
        unstructured_mesh(5), skfem.ElementTriP1() if degree == 1 else skfem.ElementTriP2()
    )
    M = sp.csr_array(mass.assemble(basis))
    A = sp.csr_array(laplace.assemble(basis)) + M
    weight = abs(M).sum(axis=1)
    x, y = basis.doflocs
    r = weight * 2 * np.sin(3 * x + 1) * np.cos(2 * y)
    upper = weight * (1 + 0.5 * y)
    lower = -weight
    result = Multigrid(A).step(r, lower, upper)
    assert result.outcome is StepOutcome.CONVERGED
    assert violation(A, r, result.delta, lower, upper) <= 1.01e-8 * upper.max()
    assert_allclose(
        result.delta, by_clarabel(A, r, upper, 1, lower), atol=2e-6 * abs(result.delta).max()
    )


def test_entries_that_cancel_on_a_coarse_level() -> None:
    """On a regular mesh entries of the coarse operator cancel; slips make them come back, and they
    need their place."""
    skfem = pytest.importorskip("skfem")
    from skfem.models.poisson import laplace

    mesh = skfem.MeshTri.init_circle(5)
    inner = mesh.interior_nodes()
    A = sp.csr_array(
        sp.csr_array(laplace.assemble(skfem.Basis(mesh, skfem.ElementTriP1())))[inner][:, inner]
    )
    x, y = mesh.p[:, inner]
    for phase in np.linspace(0, 2 * np.pi, 7):
        r = 0.02 * np.cos(3 * x - phase)
        weight = 0.01 * (1.2 + np.sin(4 * y + phase))
        result = Multigrid(A).step(r, -weight, weight)
        assert result.outcome is StepOutcome.CONVERGED
        assert violation(A, r, result.delta, -weight, weight) <= 1.01e-8 * weight.max()


def unstructured_mesh(refinements: int):
    """A disc whose inner nodes are moved at random."""
    import skfem

    mesh = skfem.MeshTri.init_circle(refinements)
    inner = mesh.interior_nodes()
    p = mesh.p.copy()
    p[:, inner] += np.random.default_rng(1).uniform(-0.05, 0.05, (2, len(inner))) * mesh.param()
    return skfem.MeshTri(p, mesh.t)


def vector_mass(basis):
    import skfem

    return skfem.BilinearForm(lambda u, v, _: u[0] * v[0] + u[1] * v[1]).assemble(basis)


def lumped_area(basis) -> Array:
    return np.asarray(sp.csr_array(vector_mass(basis)).sum(axis=1)).ravel()[::2]


# ------------------------------------------------------------------------------------------------
# extremes


def test_all_stick() -> None:
    solver, _, x, _ = membrane_solver(30)
    result = solver.step(np.sin(5 * x), -1.0 - x, 1.0 + x)
    assert (result.cycles, result.residual) == (0, 0.0)
    assert not result.delta.any()


def test_all_slip() -> None:
    solver, A, x, y = membrane_solver(30)
    r = 3.0 + x + 0.0 * y
    upper = 1.0 + y
    result = solver.step(r, -upper, upper)
    assert_allclose(result.delta, np.asarray(spsolve(A.tocsc(), r - upper)), rtol=1e-8)


def test_no_friction_is_a_linear_solve() -> None:
    solver, A, x, y = membrane_solver(30)
    r = np.sin(7 * x) - y
    result = solver.step(r, 0.0 * x, 0.0 * x)
    assert abs(r - A @ result.delta).max() <= 1e-8 * abs(r).max()


def test_a_great_change_of_the_slip_set() -> None:
    """Here the primal-dual active set method returns to a set it has left; multigrid is done in a
    few cycles."""
    solver, A, x, y = membrane_solver(30)
    weight = 1.0 + 0.5 * np.cos(9 * y)
    r = 3.0 * np.sin(2 * np.pi * x) * np.sin(2 * np.pi * y) + 0.3 * x
    assert not active_set_converges(A, r, weight)
    result = solver.step(r, -weight, weight)
    assert result.outcome is StepOutcome.CONVERGED
    assert result.cycles <= 10
    assert violation(A, r, result.delta, -weight, weight) <= 1.01e-8 * weight.max()


def active_set_converges(A: sp.csr_array, r: Array, weight: Array) -> bool:
    """Plain semismooth Newton for two-sided friction, from d = 0."""
    d = np.zeros_like(r)
    force = r
    seen = set()
    signs = np.zeros_like(r)
    for _ in range(100):
        before = signs
        measure = A.diagonal() * d + force
        signs = np.where(measure > weight, 1.0, np.where(measure < -weight, -1.0, 0.0))
        if np.array_equal(signs, before):
            return True
        if signs.tobytes() in seen:
            return False
        seen.add(signs.tobytes())
        free = signs != 0
        d = np.zeros_like(r)
        d[free] = spsolve(A[free][:, free].tocsc(), (r - signs * weight)[free])
        force = r - A @ d
    return False


def test_loads_far_above_friction() -> None:
    """A matrix without the signs of an elliptic operator, whose kinks are passed rather than
    stopped at."""
    rng = np.random.default_rng(5)
    B = rng.normal(size=(123, 123))
    A = sp.csr_array(B @ B.T + 1e-4 * np.eye(123))
    (lower, upper), r = random_box(rng, 123), 1000.0 * rng.normal(size=123)
    result = Multigrid(A).step(r, lower, upper)
    assert result.outcome is StepOutcome.CONVERGED
    assert result.cycles <= 10


# ------------------------------------------------------------------------------------------------
# laws


def wave(x: Array, y: Array, s: float) -> tuple[Array, Array]:
    """A load and a threshold that has travelled by s."""
    return 1.4 * np.sin(3 * x + s) * np.cos(2 * y), 1.0 + 0.8 * np.cos(2 * np.pi * (x - s))


def test_the_energy_never_rises() -> None:
    solver, A, x, y = membrane_solver(60)
    r, weight = wave(x, y, 0.4)
    done = solver.step(r, -weight, weight, tolerance=1e-12)
    energies = [
        energy(A, r, solver.step(r, -weight, weight, max_cycles=k).delta, -weight, weight)
        for k in range(done.cycles)
    ]
    assert len(energies) >= 5
    slack = 1e-14 * abs(energies[-1])
    assert np.all(np.diff(energies) <= slack)
    assert energies[0] > energies[-1] + 1e3 * slack


@law
@given(seeds)
def test_contraction_and_homogeneity(seed: int) -> None:
    """|d − d'|_A ≤ |r − r'|_{A⁻¹}, and d(λr, λK) = λ d(r, K)."""
    rng = np.random.default_rng(seed)
    A, lower, upper = random_matrix(rng, 20), *random_box(rng, 20)
    r, other = rng.normal(size=20) * 3.0, rng.normal(size=20) * 3.0
    solver = Multigrid(sp.csr_array(A))
    d, moved, scaled = (
        solver.step(force, factor * lower, factor * upper, tolerance=1e-10).delta
        for force, factor in ((r, 1.0), (other, 1.0), (1e3 * r, 1e3))
    )
    distance, change = d - moved, r - other
    assert distance @ A @ distance <= (change @ np.linalg.solve(A, change)) * (1 + 1e-8)
    assert_allclose(scaled, 1e3 * d, atol=1e-5 * (1.0 + abs(d).max()) * 1e3)


def test_steps_leave_no_trace() -> None:
    """A step gives the same result after others, whose operators are updated, as with new
    levels."""
    solver, A, x, y = membrane_solver(60)
    for s in (0.0, 0.3, 0.31):
        r, weight = wave(x, y, s)
        last = solver.step(r, -weight, weight)
    assert_allclose(last.delta, Multigrid(A).step(r, -weight, weight).delta, atol=1e-12)


@pytest.mark.parametrize("groups", [1, 2])
def test_operators_follow_the_moving_nodes(groups: int) -> None:
    """After several updates, every level has PᵀHP of the level above."""
    A, x, _ = membrane(30)
    A = sp.csr_array(sp.kron(A, [[1.0, 0.2], [0.2, 1.0]]) if groups == 2 else A)
    hierarchy = Hierarchy(*block_rows(A, groups))
    assert len(hierarchy.levels) > 2
    rng = np.random.default_rng(0)
    increments = [
        rng.normal(size=(len(x), groups)) * keep[:, None]
        for keep in (x > 0, x > 0.4, x > 0.5, x < 0.8)
    ]
    for top, d in [
        (0, increments[0]),
        (0, increments[1]),
        (1, None),
        (0, increments[2]),
        (0, increments[3]),
    ]:
        if d is None:
            d = np.ones_like(hierarchy.levels[1].x)
        hierarchy.truncate(top, np.ones(len(d)), d)
    fine = as_matrix(hierarchy.levels[0].H)
    keep = sp.diags_array(np.repeat(increments[3].any(axis=1).astype(float), groups))
    assert_allclose((fine - keep @ fine @ keep).data, 0.0)
    if groups == 1:
        assert_allclose((fine - keep @ A @ keep).toarray(), 0.0)
    for (P, _), coarse in zip(hierarchy.transfers, hierarchy.levels[1:], strict=True):
        interpolation = sp.csr_array(
            (P.value, P.column, P.start), shape=(len(P.start) - 1, len(coarse.x))
        )
        interpolation = sp.kron(interpolation, np.eye(groups))
        product = interpolation.T @ fine @ interpolation
        fine = as_matrix(coarse.H)
        assert_allclose(fine.toarray(), product.toarray(), atol=1e-12 * abs(A.data).max())


def as_matrix(rows) -> sp.csr_array:
    n = (len(rows.start) - 1) * rows.value.shape[1]
    return sp.csr_array(sp.bsr_array((rows.value, rows.column, rows.start), shape=(n, n)))


def test_arrays_that_are_not_to_be_written_to() -> None:
    """Read-only, strided or integer numbers are as good as any others, and stay as they are."""
    solver, A, x, y = membrane_solver(20)
    r, weight = wave(x, y, 0.0)
    r, weight = np.round(9.0 * r), np.round(weight) + 1.0
    expected = solver.step(r, -weight, weight)
    assert expected.delta.any()
    kept = A.copy()
    for part in (kept.data, kept.indices, kept.indptr, given := r.copy()):
        part.setflags(write=False)
    result = Multigrid(kept).step(given, -weight.astype(int), np.repeat(weight, 2)[::2])
    assert np.array_equal(result.delta, expected.delta)
    assert np.array_equal(given, r)


def test_a_good_start_is_kept_and_a_bad_one_does_no_harm() -> None:
    solver, _, x, y = membrane_solver(60)
    r, weight = wave(x, y, 0.4)
    plain = solver.step(r, -weight, weight)
    assert solver.step(r, -weight, weight, start=plain.delta).cycles == 0
    bad = solver.step(r, -weight, weight, start=1e3 * np.cos(50 * x))
    assert_allclose(bad.delta, plain.delta, atol=1e-9)


def test_cycles_do_not_grow_with_the_mesh() -> None:
    cycles = []
    for N in (32, 100, 316):
        A, x, y = membrane(N)
        solver = Multigrid(A)
        worst = 0
        for s in (0.0, 0.7):
            r, weight = wave(x, y, s)
            result = solver.step(r, -weight, weight)
            assert result.outcome is StepOutcome.CONVERGED
            assert violation(A, r, result.delta, -weight, weight) <= 1.01e-8 * weight.max()
            worst = max(worst, result.cycles)
        cycles.append(worst)
    assert max(cycles) <= 12
    assert cycles[-1] - cycles[0] <= 4


# ------------------------------------------------------------------------------------------------
# ends and refusals


def test_cycles_run_out() -> None:
    solver, A, x, y = membrane_solver(60)
    r, weight = wave(x, y, 0.4)
    result = solver.step(r, -weight, weight, max_cycles=1)
    assert result.outcome is StepOutcome.CYCLE_LIMIT
    assert result.cycles == 1
    assert_allclose(
        result.residual, violation(A, r, result.delta, -weight, weight) / weight.max(), rtol=1e-6
    )
    assert result.residual > 1e-8
    assert energy(A, r, result.delta, -weight, weight) < 0.0


def test_a_tolerance_below_rounding() -> None:
    solver, _, x, y = membrane_solver(60)
    r, weight = wave(x, y, 0.4)
    result = solver.step(r, -weight, weight, tolerance=1e-18)
    assert result.outcome is StepOutcome.ROUNDING
    assert result.residual <= 1e-11
    assert result.cycles < 30


def test_overflow_is_an_error() -> None:
    solver = Multigrid(sp.csr_array([[1e-200, 0.0], [0.0, 1e-200]]))
    with pytest.raises(ConvergenceError, match="overflow"):
        solver.step(np.full(2, 1e200), -np.ones(2), np.ones(2))


def test_a_line_search_stops_before_the_minimum() -> None:
    """Of a convex function with a kink at 0.3 and one of slope 1 behind it."""
    t, rate = lowest_along(lambda t: -1.0 + t if t <= 0.3 else 5.0 + t, -1.0)
    assert 0.29 <= t <= 0.3
    assert rate < 0.0
    assert lowest_along(lambda t: -1.0 + 2.0 * t, -1.0)[0] == pytest.approx(0.5, abs=1e-12)
    assert lowest_along(lambda t: -1.0 + 0.5 * t, -1.0)[0] == 1.0
    assert lowest_along(lambda t: 1.0 + t, 1.0)[0] == 0.0


@pytest.mark.parametrize(
    ("A", "groups", "message"),
    [
        (sp.csr_array([[2.0, 1.0], [0.0, 2.0]]), 1, "symmetric"),
        (sp.csr_array([[2.0, 3.0], [3.0, 2.0]]), 1, "not positive definite"),
        (sp.csr_array([[1.0, -1.0], [-1.0, 1.0]]), 1, "not positive definite"),
        (sp.csr_array([[np.nan, 0.0], [0.0, 2.0]]), 1, "not finite"),
        (sp.csr_array(np.ones((2, 3))), 1, "square"),
        (sp.eye_array(3), 2, "groups: 2 is not a divisor of the number of rows"),
    ],
)
def test_matrices_that_are_refused(A: sp.csr_array, groups: int, message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        Multigrid(A, groups=groups)


def test_a_step_without_a_minimum_ends() -> None:
    """A body that nothing holds, pushed harder than friction resists: the cycles run out, the
    result is finite."""
    ends = np.r_[1.0, 2.0 * np.ones(28), 1.0]
    line = sp.diags_array(
        [-np.ones(29), ends, -np.ones(29)],
        offsets=[-1, 0, 1],  # pyright: ignore[reportArgumentType]
    )
    free = Multigrid(sp.csr_array(sp.kronsum(line, line) + 1e-14 * sp.eye_array(900)))
    result = free.step(np.full(900, 2.0), -np.ones(900), np.ones(900), max_cycles=20)
    assert result.outcome is not StepOutcome.CONVERGED
    assert np.all(np.isfinite(result.delta))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"r": np.zeros(3)}, "r: its shape is"),
        ({"r": np.full(900, np.nan)}, r"r\[0\]: nan is not finite"),
        ({"upper": -np.ones(900)}, "does not contain 0"),
        ({"lower": None}, "lower: the value is missing"),
        ({"upper": np.full(900, np.inf)}, "not finite"),
        ({"start": np.zeros(2)}, "start: its shape"),
    ],
)
def test_steps_that_are_refused(arguments: dict[str, Any], message: str) -> None:
    solver, *_ = membrane_solver(30)
    given: dict[str, Any] = {"r": np.ones(900), "lower": -np.ones(900), "upper": np.ones(900)}
    with pytest.raises(DeclarationError, match=message):
        solver.step(**given | arguments)


def test_a_group_at_the_edge_of_rest() -> None:
    """Forces that exceed the radius by rounding only, in a matrix that couples everything."""
    rng = np.random.default_rng(3)
    A = sp.csr_array(random_matrix(rng, 60))
    r = rng.normal(size=60)
    d = rng.normal(size=60)
    d[:30] = 0.0
    force = (r - A @ d).reshape(-1, 2)
    radii = np.linalg.norm(force, axis=1) * (1 - 2e-16)
    length = np.linalg.norm(d.reshape(-1, 2), axis=1)
    moving = length > 0
    force[moving] = radii[moving, None] * d.reshape(-1, 2)[moving] / length[moving, None]
    result = Multigrid(A, groups=2).step(A @ d + force.ravel(), radii=radii)
    assert result.outcome is StepOutcome.CONVERGED
    assert_allclose(result.delta, d, atol=1e-5)


def test_groups_take_radii() -> None:
    solver = Multigrid(sp.csr_array(2.0 * np.eye(4)), groups=2)
    radii = np.array([1.0, 5.0])
    result = solver.step(np.array([3.0, 4.0, 3.0, 3.0]), radii=radii)
    assert_allclose(result.delta, [1.2, 1.6, 0.0, 0.0])
    assert_allclose(solver.step(np.array([3.0, 4.0, 3.0, 3.0]), -radii, radii).delta, result.delta)
    with pytest.raises(DeclarationError, match="groups have radii"):
        solver.step(np.ones(4), np.zeros(2), radii)
