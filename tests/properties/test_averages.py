"""Laws of dissipation potentials and of their averages, for potentials drawn at random."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.arrays import Array
from stickslip.rate_independent.dissipation import (
    Average,
    Dissipation,
    Ellipsoid,
    GroupNorm,
    Polytope,
    Product,
    WeightedL1,
)

# Examples are drawn anew from the test's name, the same in every run.
law = settings(max_examples=6, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32 - 1)
PHASES = np.linspace(0, 1, 23, endpoint=False)


def wave(rng: np.random.Generator, size: int) -> list[str]:
    """Positive formulas in s with up to three wells, whose amplitudes may come close to 0."""
    return [
        f"{a!r} + {b!r}*cos(2*pi*(s - {p!r})) + {c!r}*cos(6*pi*(s - {q!r}))"
        for a, b, c, p, q in zip(
            rng.uniform(1.0, 2.0, size).tolist(),
            rng.uniform(-0.7, 0.7, size).tolist(),
            rng.uniform(-0.3, 0.3, size).tolist(),
            rng.uniform(size=size).tolist(),
            rng.uniform(size=size).tolist(),
            strict=True,
        )
    ]


def rotations(rng: np.random.Generator, n: int, reach: float):
    """Rotations of Rⁿ that swing about a random plane, as a function of s."""
    frame = np.linalg.qr(rng.normal(size=(n, n)))[0]
    shift = rng.uniform()

    def at(s: float) -> Array:
        angle = reach * np.sin(2 * np.pi * (s - shift))
        turn = np.eye(n)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        return frame @ turn @ frame.T

    return at


def weighted_l1(rng: np.random.Generator) -> Dissipation:
    n = int(rng.integers(1, 5))
    return WeightedL1(wave(rng, n), wave(rng, n) if rng.uniform() < 0.5 else None)


def groups(rng: np.random.Generator) -> Dissipation:
    return GroupNorm(wave(rng, 2), size=int(rng.integers(1, 4)))


def ellipsoid(rng: np.random.Generator) -> Dissipation:
    n = int(rng.integers(2, 4))
    turn = rotations(rng, n, rng.uniform(0.1, 1.5))
    lengths = rng.uniform(0.3, 2, n)
    swell = rng.uniform(0, 0.5, n)

    def shape(s: float) -> Array:
        axes = turn(s)
        return axes @ np.diag((lengths * (1 + swell * np.cos(2 * np.pi * s))) ** 2) @ axes.T

    return Ellipsoid(shape)


def polytope(rng: np.random.Generator) -> Dissipation:
    angles = np.sort((np.arange(5) + rng.uniform(0, 0.6, 5)) * 2 * np.pi / 5)
    points = np.column_stack([np.cos(angles), np.sin(angles)]) * rng.uniform(0.6, 2, 5)[:, None]
    turn = rotations(rng, 2, rng.uniform(0.1, 0.6))
    return Polytope(vertices=lambda s: points @ turn(s).T)


def halfspaces(rng: np.random.Generator) -> Dissipation:
    normals = np.vstack([rng.normal(size=(3, 2)), np.eye(2), -np.eye(2)])
    return Polytope(normals=normals, offsets=wave(rng, 7))


def product(rng: np.random.Generator) -> Dissipation:
    return Product((WeightedL1(wave(rng, 2)), ellipsoid(rng)))


KINDS = {f.__name__: f for f in (weighted_l1, groups, ellipsoid, polytope, halfspaces, product)}


@cache
def drawn(kind: str, seed: int) -> tuple[Dissipation, Average]:
    source = KINDS[kind](np.random.default_rng(seed))
    return source, source.average()


@pytest.mark.parametrize("kind", KINDS)
@law
@given(seed=seeds)
def test_averages(kind: str, seed: int) -> None:
    source, average = drawn(kind, seed)
    rng = np.random.default_rng(seed)
    V, W = rng.normal(size=(2, source.dimension))
    size = max(source.value(s, e) for s in PHASES for e in np.eye(source.dimension))
    slack = 3e-8 * size * float(np.linalg.norm(V) + np.linalg.norm(W))
    value = average.support(V)
    # Ψ_av ≤ Ψ(s, ·), convex, 1-homogeneous.
    assert value <= min(source.value(s, V) for s in PHASES) + slack
    assert average.support(V + W) <= value + average.support(W) + slack
    assert average.support(2.5 * V) == pytest.approx(2.5 * value, abs=3 * slack)
    # The measure adds up to V, costs Ψ_av(V), and no force in K_av says it costs more.
    motion = average.optimal_motion(V)
    np.testing.assert_allclose(motion.motions.sum(axis=0), V, atol=1e-10 * float(np.linalg.norm(V)))
    spent = sum(source.value(s, v) for s, v in zip(motion.phases, motion.motions, strict=True))
    assert motion.cost == pytest.approx(spent, rel=1e-12)
    assert abs(motion.gap) <= slack
    assert abs(motion.cost - value) <= slack
    # The force that resists lies in every K(s) and does this work on V.
    xi = average.exposed(V)
    assert xi @ V == pytest.approx(value, abs=slack)
    assert max(source.distance(xi, s) for s in PHASES) <= slack


@pytest.mark.parametrize("kind", KINDS)
@law
@given(seed=seeds)
def test_nearest_points_of_averages(kind: str, seed: int) -> None:
    source, average = drawn(kind, seed)
    n = source.dimension
    rng = np.random.default_rng(seed + 1)
    xi = rng.choice([0.3, 3.0]) * rng.normal(size=n)
    root = rng.normal(size=(n, n))
    for metric in (None, root @ root.T + 0.3 * np.eye(n)):
        y = average.project(xi, metric=metric)
        size = max(source.value(s, e) for s in PHASES for e in np.eye(n))
        # K_av lies inside every K(s).
        assert max(source.distance(y, s) for s in PHASES) <= 2e-8 * size
        assert average.contains(y)
        # ⟨M(ξ − y), η − y⟩ ≤ 0 for all η in K_av.
        pull = xi - y if metric is None else metric @ (xi - y)
        assert average.support(pull) - pull @ y <= 3e-8 * size * (
            np.linalg.norm(pull) + 1e-6 * size
        )
        if average.contains(xi):
            np.testing.assert_allclose(y, xi, atol=1e-7 * size)


@pytest.mark.parametrize("kind", KINDS)
@law
@given(seed=seeds, step=st.floats(0.01, 10))
def test_projection_and_proximal_step(kind: str, seed: int, step: float) -> None:
    rng = np.random.default_rng(seed)
    source = KINDS[kind](rng)
    v = 2 * rng.normal(size=source.dimension)
    other = rng.normal(size=source.dimension)
    s = float(rng.uniform())
    y = source.project(v, s)
    assert source.distance(y, s) <= 1e-12
    assert (v - y) @ y == pytest.approx(source.support(v - y, s), abs=1e-11)
    # Moreau: w = v − step ξ with ξ in ∂Ψ(w), that is ξ in K(s) and ⟨ξ, w⟩ = Ψ(s, w); no other point
    # does better.
    w = source.prox(v, s, step)
    xi = (v - w) / step
    assert source.distance(xi, s) <= 1e-11
    assert xi @ w == pytest.approx(source.value(s, w), abs=1e-10)
    better = w + 0.1 * other
    objective = [
        np.square(z - v).sum() / 2 + step * source.value(s, z)
        for z in (w, better, np.zeros_like(w), v)
    ]
    assert objective[0] <= min(objective[1:]) + 1e-10
    # Projections and proximal steps bring no two points farther apart.
    assert np.linalg.norm(y - source.project(other, s)) <= np.linalg.norm(v - other) + 1e-12
    assert np.linalg.norm(w - source.prox(other, s, step)) <= np.linalg.norm(v - other) + 1e-12
    # Support function, exposed point and excess say the same about K(s).
    assert source.exposed(v, s) @ v == pytest.approx(source.support(v, s), rel=1e-11)
    assert (source.excess(v, s) > 1e-9) == (source.distance(v, s) > 1e-9)
    together = source.sampled(PHASES)
    np.testing.assert_allclose(
        together.support(v), [source.support(v, t) for t in PHASES], rtol=1e-12
    )
    np.testing.assert_allclose(
        together.excess(v), [source.excess(v, t) for t in PHASES], rtol=1e-9, atol=1e-12
    )
    assert source.value(s, v + other) <= source.value(s, v) + source.value(s, other) + 1e-12
    assert source.value(s, 3 * v) == pytest.approx(3 * source.value(s, v))


@law
@given(seed=seeds)
def test_the_average_of_a_product_is_the_product_of_averages(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parts = [KINDS[kind](rng) for kind in rng.choice(["weighted_l1", "groups", "halfspaces"], 2)]
    together = Product(tuple(parts)).average()
    V = rng.normal(size=together.dimension)
    split = [V[: parts[0].dimension], V[parts[0].dimension :]]
    apart = sum(part.average().support(v) for part, v in zip(parts, split, strict=True))
    assert together.support(V) == pytest.approx(apart, rel=1e-12)


@law
@given(seed=seeds)
def test_closed_forms_agree_with_the_exchange(seed: int) -> None:
    from stickslip.rate_independent.averaging.semi_infinite import Intersection

    rng = np.random.default_rng(seed)
    source = KINDS[rng.choice(["weighted_l1", "groups", "halfspaces"])](rng)
    V = rng.normal(size=source.dimension)
    general = Intersection(source)
    assert general.support(V) == pytest.approx(
        source.average().support(V), abs=3e-8 * general.size * float(np.linalg.norm(V))
    )
    np.testing.assert_allclose(
        general.project(3 * V), source.average().project(3 * V), atol=1e-6 * general.size
    )
