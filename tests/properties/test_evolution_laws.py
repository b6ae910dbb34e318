"""Laws of rate-independent evolution: no time scale, contraction, energy, symmetry."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.arrays import Array
from stickslip.rate_independent.dissipation import Ellipsoid, GroupNorm, WeightedL1
from stickslip.rate_independent.evolution.evolution import Evolution
from stickslip.rate_independent.evolution.evolve import evolve
from stickslip.rate_independent.evolution.history import History

# Examples are drawn anew from the test's name, the same in every run.
law = settings(max_examples=25, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32 - 1)


def matrix(rng: np.random.Generator, n: int) -> Array:
    """Symmetric positive definite, its condition up to some 1e4."""
    axes = np.linalg.qr(rng.normal(size=(n, n)))[0]
    A = axes @ np.diag(10.0 ** rng.uniform(-2, 2, n)) @ axes.T
    return (A + A.T) / 2


def walk(rng: np.random.Generator, n: int, knots: int = 9) -> tuple[Array, Array]:
    """A load that starts at 0 and changes its direction a few times."""
    values = np.cumsum(rng.normal(size=(knots, n)), axis=0)
    return np.linspace(0.0, 1.0, knots), 3.0 * (values - values[0])


def boxes(rng: np.random.Generator, n: int) -> WeightedL1:
    """Thresholds that oscillate, each in its own way, some of them down to 0, different for the two
    directions."""

    def weights() -> list[str]:
        mean = rng.uniform(0.2, 2.0, n)
        share = np.minimum(rng.uniform(0.0, 1.3, n), 1.0)
        shift = rng.uniform(0, 1, n)
        return [
            f"{m:.6f}*(1 + {a:.6f}*cos(2*pi*(s - {b:.6f})))"
            for m, a, b in zip(mean, share, shift, strict=True)
        ]

    return WeightedL1(weights(), lower=weights() if rng.random() < 0.5 else None)


def random_problem(seed: int) -> Evolution:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    problem = matrix(rng, n), walk(rng, n), boxes(rng, n), rng.normal(size=n)
    return Evolution.settled(*problem, epsilon=float(rng.uniform(0.1, 2.0)))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(seeds)
def test_stability_and_energy_balance(seed: int) -> None:
    """(S) and (E) of [M] (2.2), looked at with nothing but the states."""
    problem = random_problem(seed)
    history = evolve(problem, tolerance=2e-2)
    assert history.outcome.ok, history.message
    certificate = history.certificate
    assert certificate.ok, certificate.verdict
    t, z = history.times, history.z
    loads = problem.ell.over(t)
    force = loads - z @ problem.A
    assert isinstance(problem.dissipation, WeightedL1)
    upper = problem.dissipation.above.over(t / problem.epsilon)
    lower = -problem.dissipation.below.over(t / problem.epsilon)
    size = max(upper.max(), -lower.min())
    assert np.all((force <= upper + 1e-8 * size) & (force >= lower - 1e-8 * size))
    # z affine, thresholds and loads by the trapezoidal rule: the energy balance up to the tolerance
    # and the curvature of the thresholds, which adaptive steps keep below the tolerance as well.
    energy = 0.5 * np.sum(z @ problem.A * z, axis=1) - np.sum(loads * z, axis=1)
    d = np.diff(z, axis=0)
    dissipated = 0.5 * np.sum(
        np.maximum(upper[1:] * d, lower[1:] * d) + np.maximum(upper[:-1] * d, lower[:-1] * d)
    )
    work = -np.sum(np.diff(loads, axis=0) * (z[1:] + z[:-1]) / 2)
    violation = energy[-1] + dissipated - energy[0] - work
    slack = 2e-2 * (history.energy_scale + size * np.abs(d).sum())
    assert -1e-9 * history.energy_scale <= violation <= slack


@law
@given(seeds)
def test_no_time_scale(seed: int) -> None:
    """A load run through at another pace (without a clock in Ψ) gives the same path."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    A, (knots, values), start = matrix(rng, n), walk(rng, n), rng.normal(size=n)
    psi = WeightedL1(rng.uniform(0.1, 2.0, n), rng.uniform(0.1, 2.0, n))
    bend = float(rng.uniform(0.3, 3.0))
    fine = np.linspace(0.0, 1.0, 401)
    rows = np.column_stack([np.interp(fine, knots, column) for column in values.T])

    def path(times: Array) -> History:
        problem = Evolution.settled(A, (times, rows), psi, start)
        return evolve(problem, times)

    even = path(fine)
    bent = path(7.0 * fine**bend)
    scale = np.abs(even.z).max()
    np.testing.assert_allclose(bent.z, even.z, rtol=0, atol=1e-10 * scale)
    for name in ("energy", "dissipated", "work"):
        np.testing.assert_allclose(
            bent.dataset[name], even.dataset[name], rtol=1e-9, atol=1e-9 * scale
        )


@law
@given(seeds, st.sampled_from(["boxes", "groups", "ellipsoid"]))
def test_two_evolutions_come_closer(seed: int, kind: str) -> None:
    """|z − w| in the energy norm never grows, for the same load and any two stable starts."""
    rng = np.random.default_rng(seed)
    n = 4
    A, load = matrix(rng, n), walk(rng, n)
    psi = {
        "boxes": lambda: boxes(rng, n),
        "groups": lambda: GroupNorm(["1 + cos(2*pi*s)/2", "1 - cos(2*pi*s)/2"]),
        "ellipsoid": lambda: Ellipsoid(np.diag(rng.uniform(0.1, 3.0, n))),
    }[kind]()
    steps = 300 if kind == "boxes" else 40
    one, other = (
        evolve(Evolution.settled(A, load, psi, rng.normal(size=n)), steps=steps) for _ in range(2)
    )
    assert one.outcome.ok and other.outcome.ok, (one.message, other.message)
    apart = one.z - other.z
    distance = np.sqrt(np.einsum("ki,ij,kj->k", apart, A, apart))
    assert distance[0] > 0.0
    assert np.diff(distance).max() <= 1e-6 * distance[0]


@law
@given(seeds)
def test_scaling_and_reflection(seed: int) -> None:
    """c z solves the problem with c ℓ and c Ψ; −z that with −ℓ and the thresholds of the two
    directions exchanged."""
    problem = random_problem(seed)
    psi = problem.dissipation
    assert isinstance(psi, WeightedL1)
    plain = evolve(problem, steps=200)
    scale = np.abs(plain.z).max() or 1.0
    knots, values = problem.load
    above = psi.weights
    below = psi.weights if psi.lower is None else psi.lower
    scaled = WeightedL1([f"8*({w})" for w in above], [f"8*({w})" for w in below])
    larger = Evolution(problem.A, (knots, 8 * values), scaled, 8 * problem.initial, problem.epsilon)
    np.testing.assert_allclose(evolve(larger, steps=200).z, 8 * plain.z, rtol=0, atol=1e-9 * scale)
    mirrored = Evolution(
        problem.A, (knots, -values), WeightedL1(below, above), -problem.initial, problem.epsilon
    )
    np.testing.assert_allclose(evolve(mirrored, steps=200).z, -plain.z, rtol=0, atol=1e-9 * scale)


@law
@given(seeds)
def test_components_have_no_order(seed: int) -> None:
    """Renaming the components renames the path; a component of its own does not notice the
    others."""
    problem = random_problem(seed)
    rng = np.random.default_rng(seed)
    order = rng.permutation(problem.n)
    psi, (knots, values) = problem.dissipation, problem.load
    assert isinstance(psi, WeightedL1)
    lower = None if psi.lower is None else [psi.lower[i] for i in order]
    renamed = Evolution(
        problem.A[np.ix_(order, order)],
        (knots, values[:, order]),
        WeightedL1([psi.weights[i] for i in order], lower),
        problem.initial[order],
        problem.epsilon,
    )
    plain = evolve(problem, steps=200).z
    scale = np.abs(plain).max() or 1.0
    np.testing.assert_allclose(
        evolve(renamed, steps=200).z, plain[:, order], rtol=0, atol=1e-9 * scale
    )
    alone = np.block(
        [[problem.A, np.zeros((problem.n, 1))], [np.zeros((1, problem.n)), np.ones((1, 1))]]
    )
    wider = Evolution(
        alone,
        (knots, np.column_stack([values, knots])),
        WeightedL1([*psi.weights, "1"], None if psi.lower is None else [*psi.lower, "1"]),
        np.append(problem.initial, 0.0),
        problem.epsilon,
    )
    np.testing.assert_allclose(evolve(wider, steps=200).z[:, :-1], plain, rtol=0, atol=1e-9 * scale)
