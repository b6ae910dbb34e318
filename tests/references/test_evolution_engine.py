"""Evolutions against what this solver did not compute.

The running maximum of A. Mielke, *Three examples concerning the interaction of dry friction and
oscillations*, WIAS preprint 2405 (2017), section 2.2; the cone solver Clarabel on full steps; the
event-driven motion of the same system of rate-independent coordinates; a matrix assembled by
scikit-fem on an unstructured mesh.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, cast

import numpy as np
import pytest
from scipy import sparse

from stickslip import Contact, RateIndependent, System, simulate
from stickslip.arrays import Array
from stickslip.rate_independent.dissipation import GroupNorm, WeightedL1
from stickslip.rate_independent.evolution.evolution import Evolution
from stickslip.rate_independent.evolution.evolve import evolve

clarabel: Any = import_module("clarabel")  # compiled, without types

# --- Running maximum ------------------------------------------------------------------------------

THRESHOLDS = {
    "smooth": ("1 + cos(2*pi*s)/2", lambda s: 1 + np.cos(2 * np.pi * s) / 2),
    "kink": ("1/2 + abs(sin(pi*(s - 0.3)))", lambda s: 0.5 + np.abs(np.sin(np.pi * (s - 0.3)))),
    "two minima": (
        "1 + sin(2*pi*s)/3 + cos(6*pi*s)/4",
        lambda s: 1 + np.sin(2 * np.pi * s) / 3 + np.cos(6 * np.pi * s) / 4,
    ),
}


def running_maximum(rho, epsilon: float, times: Array) -> Array:
    """z for ℓ = 5t − t², z(0) = 0, on [0, 5]: a running maximum up to the last move, a running
    minimum after it."""
    fine = np.union1d(np.linspace(0.0, 5.0, 1_000_001), times)
    ell = 5 * fine - fine**2
    threshold = rho(fine / epsilon)
    rising = np.maximum.accumulate(np.maximum(ell - threshold, 0.0))
    last = int(np.argmax(rising))
    falling = np.minimum.accumulate(
        np.where(np.arange(len(fine)) > last, ell + threshold, rising[last])
    )
    return np.where(np.arange(len(fine)) <= last, rising, falling)[np.searchsorted(fine, times)]


@pytest.mark.parametrize("kind", THRESHOLDS)
def test_running_maximum(kind: str) -> None:
    formula, rho = THRESHOLDS[kind]
    problem = Evolution(
        [[1.0]], "5*t - t**2", WeightedL1([formula]), [0.0], epsilon=0.1, span=(0, 5)
    )
    errors = []
    for tolerance in (1e-2, 1e-3, 1e-4):
        history = evolve(problem, tolerance=tolerance)
        assert history.certificate.ok, history.certificate.verdict
        errors.append(np.abs(history.z[:, 0] - running_maximum(rho, 0.1, history.times)).max())
    np.testing.assert_array_less(errors, [1e-2, 1e-3, 1e-4])
    assert errors[2] < errors[0] / 30  # first order in the tolerance


def test_uniform_steps_converge_with_first_order() -> None:
    _, rho = THRESHOLDS["smooth"]
    problem = Evolution(
        [[1.0]],
        "5*t - t**2",
        WeightedL1([THRESHOLDS["smooth"][0]]),
        [0.0],
        epsilon=0.1,
        span=(0, 5),
    )
    counts = np.array([997, 3989, 15_991])  # primes: no step falls on a turning point by chance
    errors = []
    for steps in counts.tolist():
        history = evolve(problem, steps=steps)
        errors.append(np.abs(history.z[:, 0] - running_maximum(rho, 0.1, history.times)).max())
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order > 0.9 and errors[-1] < 2e-4


# --- Generic solvers ------------------------------------------------------------------------------


def clarabel_step(A: Any, r: Array, cones: list, rows: Any, offsets: Array, cost: Array) -> Array:
    """Minimise ½ dᵀAd − rᵀd + costᵀt over (d, t) with offsets − rows (d, t) in the cones; returns
    d."""
    n, extra = len(r), len(cost)
    P = sparse.block_diag([sparse.triu(A), sparse.csc_array((extra, extra))], format="csc")
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    solver = clarabel.DefaultSolver(
        P, np.concatenate([-r, cost]), sparse.csc_matrix(rows), offsets, cones, settings
    )
    solution = solver.solve()
    assert solution.status == clarabel.SolverStatus.Solved
    return np.array(solution.x)[:n]


def assert_same_minimum(A: Any, r: Array, dissipation: Any, mine: Array, other: Array) -> None:
    """Both minimise ½⟨Ad, d⟩ − ⟨r, d⟩ + Ψ(d): equal values, and d as near as that tells."""
    value, theirs = (0.5 * d @ (A @ d) - r @ d + dissipation.value(0.0, d) for d in (mine, other))
    assert -1e-8 * abs(value) <= theirs - value <= 1e-8 * abs(value)
    assert np.any(mine) and np.abs(mine - other).max() < 1e-4 * np.abs(other).max()


def membrane(side: int) -> sparse.csr_array:
    """5-point −Δ + 1 on the unit square."""
    second = sparse.diags_array(
        [-np.ones(side - 1), 2.0 * np.ones(side), -np.ones(side - 1)],
        offsets=[-1, 0, 1],  # pyright: ignore[reportArgumentType]
    ) * float((side + 1) ** 2)
    one = sparse.eye_array(side)
    return sparse.csr_array(
        sparse.kron(second, one) + sparse.kron(one, second) + sparse.eye_array(side**2)
    )


@pytest.mark.parametrize("solver", ["dense", "multigrid"])
def test_boxes_agree_with_clarabel(solver: str) -> None:
    """n = 900: three large steps, each against the quadratic program t ≥ upper d, t ≥ lower d."""
    A = membrane(30)
    n = 900
    x, y = np.meshgrid(*[np.linspace(0, 1, 30)] * 2)
    upper = 30.0 * (1.5 + np.cos(2 * np.pi * (x.ravel() - y.ravel())))
    lower = 20.0 * np.ones(n)
    loads = np.array([0.0, 1.0, -0.5, 0.4])[:, None] * 200.0 * np.sin(3 * x.ravel() + 1.0)
    problem = Evolution(A, (np.arange(4.0), loads), WeightedL1(upper, lower), np.zeros(n))
    history = evolve(problem, np.arange(4.0), solver=solver, kkt=1e-9)
    assert history.outcome.ok, history.message
    one = sparse.eye_array(n)
    rows = sparse.vstack([sparse.hstack([sparse.diags_array(w), -one]) for w in (upper, -lower)])
    for k in range(1, 4):
        r = loads[k] - A @ history.z[k - 1]
        d = clarabel_step(
            A, r, [clarabel.NonnegativeConeT(2 * n)], rows, np.zeros(2 * n), np.ones(n)
        )
        assert_same_minimum(A, r, problem.dissipation, history.z[k] - history.z[k - 1], d)


def test_groups_agree_with_clarabel() -> None:
    """Planar friction with a dense A, n = 60: |d_g| ≤ t_g as second-order cones."""
    rng = np.random.default_rng(2)
    root = rng.normal(size=(60, 60))
    A = root @ root.T / 60 + 0.2 * np.eye(60)
    radii = rng.uniform(0.5, 2.0, 30)
    loads = np.vstack([np.zeros(60), rng.normal(size=(2, 60)) * 3.0])
    problem = Evolution(A, (np.arange(3.0), loads), GroupNorm(radii), np.zeros(60))
    history = evolve(problem, np.arange(3.0), kkt=1e-9)
    rows = np.zeros((90, 90))
    for g in range(30):
        rows[3 * g, 60 + g] = rows[3 * g + 1, 2 * g] = rows[3 * g + 2, 2 * g + 1] = -1.0
    cones = [clarabel.SecondOrderConeT(3)] * 30
    for k in (1, 2):
        r = loads[k] - A @ history.z[k - 1]
        d = clarabel_step(sparse.csc_array(A), r, cones, rows, np.zeros(90), radii)
        assert_same_minimum(A, r, problem.dissipation, history.z[k] - history.z[k - 1], d)


# --- The event-driven motion of the same system ---------------------------------------------------


def coupled(n: int, epsilon: float) -> tuple[Evolution, System]:
    """n rate-independent coordinates with oscillating thresholds, once for each of the two."""
    rng = np.random.default_rng(n)
    root = rng.normal(size=(n, n))
    A = np.round(root @ root.T / n + np.eye(n), 3)
    A = (A + A.T) / 2
    loads = [f"{2 + i % 3}*sin({1 + 0.3 * i:.2f}*t)" for i in range(n)]
    weights = [f"1 + 0.5*cos(2*pi*(s + {i / n:.4f}))" for i in range(n)]
    quadratic = " + ".join(f"{float(A[i, j]) / 2!r}*z{i}*z{j}" for i in range(n) for j in range(n))
    work = " - ".join(f"({load})*z{i}" for i, load in enumerate(loads))
    system = System(
        name="coupled",
        functions={f"rho{i}(s)": weight for i, weight in enumerate(weights)},
        coordinates={f"z{i}": RateIndependent() for i in range(n)},
        potential=f"{quadratic} - {work}",
        contacts={
            f"contact {i}": Contact(f"d_z{i}", threshold=f"rho{i}(t/{epsilon})") for i in range(n)
        },
        span=(0, 3),
    )
    return Evolution(A, loads, WeightedL1(weights), np.zeros(n), epsilon, (0, 3)), system


@pytest.mark.parametrize("n", [2, 3, 8])
def test_the_event_driven_motion_of_the_same_system(n: int) -> None:
    problem, system = coupled(n, 0.5)
    trajectory = simulate(system)
    assert trajectory.certificate.ok, trajectory.certificate.verdict
    assert trajectory.n_switches > 10
    times = np.linspace(0.0, 3.0, 301)
    values = trajectory.at(times)
    exact = np.column_stack([values[f"z{i}"] for i in range(n)])

    tolerances = np.array([1e-2, 1e-3, 1e-4, 1e-5])
    histories = [
        evolve(problem, tolerance=float(tolerance), output=times) for tolerance in tolerances
    ]
    errors = np.array([np.abs(history.z - exact).max() for history in histories])
    assert np.all(errors < tolerances) and errors[-1] < 1e-5
    assert np.polyfit(np.log(tolerances), np.log(errors), 1)[0] > 0.6
    dissipated = [float(history.dataset["dissipated"][-1]) for history in histories]
    assert dissipated[-1] == pytest.approx(values["dissipated_energy"][-1], rel=1e-5)

    counts = np.array([300, 1200, 4800, 19_200])
    errors = np.array(
        [
            np.abs(evolve(problem, steps=int(count), output=times).z - exact).max()
            for count in counts
        ]
    )
    assert np.all(errors < 1.0 / counts)


# --- Finite elements ------------------------------------------------------------------------------


def assembled(count: int) -> tuple[sparse.csr_array, Array, Array]:
    """−Δ + 1 with linear elements on a triangulation of random points, the lumped areas, and the
    points."""
    skfem = pytest.importorskip("skfem")
    from scipy.spatial import Delaunay
    from skfem.helpers import dot, grad

    rng = np.random.default_rng(7)
    edge = np.linspace(0, 1, 16)
    frame = np.vstack(
        [
            np.column_stack(p)
            for p in (
                (edge, 0 * edge),
                (edge, 0 * edge + 1),
                (0 * edge, edge),
                (0 * edge + 1, edge),
            )
        ]
    )
    points = np.unique(np.vstack([frame, rng.uniform(0.02, 0.98, (count, 2))]), axis=0)
    mesh = skfem.MeshTri(
        np.ascontiguousarray(points.T), np.ascontiguousarray(Delaunay(points).simplices.T)
    )
    basis = skfem.Basis(mesh, skfem.ElementTriP1())
    form = skfem.BilinearForm(
        lambda u, v, w: 0.1 * dot(cast(Any, grad(u)), cast(Any, grad(v))) + u * v
    )
    areas = skfem.LinearForm(lambda v, w: 1.0 * v).assemble(basis)
    return form.assemble(basis), areas, points


def test_finite_elements_on_an_unstructured_mesh() -> None:
    """A travelling wave of thresholds: both solvers agree, the result is certified, and it follows
    its load."""
    A, areas, points = assembled(250)
    problem = Evolution(
        A,
        lambda t: areas * 4.0 * np.sin(2.0 * t) * (1.0 + points[:, 0]),
        WeightedL1(lambda s: areas * (1.0 + 0.9 * np.cos(2 * np.pi * (s - points[:, 0])))),
        np.zeros(len(areas)),
        epsilon=0.5,
        span=(0, 1),
    )
    dense, grid = (
        evolve(problem, steps=80, solver=solver, tolerance=5e-2)
        for solver in ("dense", "multigrid")
    )
    assert grid.outcome.ok and grid.certificate.ok, (grid.message, grid.certificate.verdict)
    assert dense.certificate.ok, dense.certificate.verdict
    assert np.abs(dense.z - grid.z).max() < 1e-5 * np.abs(dense.z).max()
    moving = dense.dataset["slipping"].values
    # the slip set travels
    assert moving.max() > 0.9 * problem.n > 0.2 * problem.n > moving[moving > 0].min()
