"""What is said of all phases of a stretch holds at each of them, for every kind of potential made of formulas."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.rate_independent.dissipation import Dissipation, Ellipsoid, GroupNorm, Polytope, Product, WeightedL1
from stickslip.rate_independent.dissipation.phase import read

Array = np.ndarray
seeds = st.integers(0, 2**32 - 1)


def number(rng: np.random.Generator, mean: float, swing: float, sharp: bool) -> str:
    """A formula in s: a wave, perhaps with a narrow well and a kink in it."""
    a, b, p, q = rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(), rng.uniform()
    text = f"{mean!r} + {swing!r}*({a!r}*cos(2*pi*(s - {p!r})) + {b!r}*sin(4*pi*(s - {q!r}))/2"
    if sharp:
        width = 10.0 ** rng.uniform(-6, -1)
        text += f" - exp(-(sin(pi*(s - {q!r}))/{width!r})**2) + abs(sin(pi*(s - {p!r})))/2"
    return text + ")"


def weighted_l1(rng: np.random.Generator, sharp: bool) -> Dissipation:
    return WeightedL1(
        [number(rng, 2.0, 0.5, sharp) for _ in range(3)], [number(rng, 2.0, 0.4, sharp) for _ in range(3)]
    )


def groups(rng: np.random.Generator, sharp: bool) -> Dissipation:
    return GroupNorm([number(rng, 2.0, 0.5, sharp) for _ in range(2)], size=int(rng.integers(1, 4)))


def ellipsoid(rng: np.random.Generator, sharp: bool) -> Dissipation:
    p, reach = rng.uniform(), rng.uniform(0.2, 3.0)
    long, short = number(rng, 2.0, 0.5, sharp), number(rng, 0.6, 0.2, sharp)
    c, d = (f"{f}({reach!r}*sin(2*pi*(s - {p!r})))" for f in ("cos", "sin"))
    off = f"({long} - ({short}))*{c}*{d}"
    return Ellipsoid([[f"({long})*{c}**2 + ({short})*{d}**2", off], [off, f"({long})*{d}**2 + ({short})*{c}**2"]])


def vertices(rng: np.random.Generator, sharp: bool) -> Dissipation:
    n = int(rng.integers(2, 4))
    points = rng.normal(size=(n + 3, n))
    points = np.vstack([points, -points.mean(axis=0) * 3])
    return Polytope(vertices=[[number(rng, float(x), 0.15, sharp) for x in row] for row in points + 0.0])


def halfspaces(rng: np.random.Generator, sharp: bool) -> Dissipation:
    n = 2
    normals = np.vstack([rng.normal(size=(3, n)), np.eye(n), -np.eye(n)])
    return Polytope(
        normals=[[number(rng, float(x), 0.1, False) for x in row] for row in normals],
        offsets=[number(rng, 1.0, 0.3, sharp) for _ in normals],
    )


def product(rng: np.random.Generator, sharp: bool) -> Dissipation:
    return Product((weighted_l1(rng, sharp), ellipsoid(rng, sharp)))


KINDS = {f.__name__: f for f in (weighted_l1, groups, ellipsoid, vertices, halfspaces, product)}


def drawn(kind: str, rng: np.random.Generator, sharp: bool) -> Dissipation | None:
    from stickslip.errors import DeclarationError

    try:
        return KINDS[kind](rng, sharp)
    except DeclarationError:  # a hull that does not contain 0
        return None


def distance(potential: Dissipation, xi: Array, s: float) -> float:
    """Euclidean, or the largest over components, groups or factors."""
    if isinstance(potential, Product):
        return max(distance(factor, part, s) for factor, part in potential.split(xi))
    if isinstance(potential, Polytope) and potential.corners is None:
        normals, offsets = potential.halfspaces_at(s)
        return max(float((normals @ xi - offsets).max()), 0.0)
    beyond = xi - potential.project(xi, s)
    if isinstance(potential, GroupNorm):
        return float(potential.norms(beyond).max())
    return float(np.abs(beyond).max() if isinstance(potential, WeightedL1) else np.linalg.norm(beyond))


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=12, deadline=None, derandomize=True)
@given(seeds, st.booleans(), st.floats(-7, -0.3))
def test_no_phase_in_between_is_worse(kind: str, seed: int, sharp: bool, exponent: float) -> None:
    rng = np.random.default_rng(seed)
    potential = drawn(kind, rng, sharp)
    if potential is None:
        return
    assert potential.bounded
    n, m = potential.dimension, 6
    low = rng.uniform(0.0, 1.0, m)
    high = np.minimum(low + 10.0**exponent, 1.0)
    # Forces near the boundary, that move a little, or not at all.
    before = np.array([potential.exposed(rng.normal(size=n), s) * rng.uniform(0.7, 1.1) for s in low])
    after = before + rng.choice([0.0, 0.1]) * 10.0**exponent * rng.normal(size=(m, n))
    off = rng.choice([0.0, 1e-3]) * rng.uniform(size=(m, n))
    stretches = potential.over(low, high)
    first, last, bound = stretches.outside(before, after, off, 0.0)
    for k in range(m):
        for share in np.append(rng.uniform(size=5), [0.0, 1.0]):
            s = low[k] + share * (high[k] - low[k])
            xi = (1.0 - share) * before[k] + share * after[k] + off[k] * rng.uniform(-1, 1, n)
            assert distance(potential, xi, s) <= max(bound[k], 0.0) + 1e-11
            own = distance(potential, xi, s)
            if own > 1e-12:
                assert own <= potential.excess(xi, s) + 1e-11
    # Some of the rows, and joined again, are the same.
    parts = stretches.taken(np.arange(m) % 2 == 0).joined(stretches.taken(np.arange(m) % 2 == 1))
    order = np.argsort(np.arange(m) % 2, kind="stable")
    for ours, theirs in zip(
        parts.outside(before[order], after[order], off[order], 0.0), (first, last, bound), strict=True
    ):
        np.testing.assert_allclose(ours, theirs[order], rtol=1e-12, atol=1e-13)


def boundary(potential: Dissipation, v: Array, s: float) -> Array:
    """A point of the boundary; of a hull, inside a facet: with its corners, the facets move in and out."""
    if not isinstance(potential, Polytope) or potential.corners is None:
        return potential.exposed(v, s)
    points, known = potential.corners.at(s), potential.facets_at(s)
    assert known is not None
    k = int((known[0] @ v).argmax())
    return points[np.abs(points @ known[0][k] - known[1][k]) < 1e-12].mean(axis=0)


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_are_of_second_order(kind: str) -> None:
    """At a force on the boundary, a stretch of width h adds some h²."""
    rng = np.random.default_rng(5)
    potential = drawn(kind, rng, False)
    assert potential is not None
    low = np.linspace(0.0, 0.8, 40)
    directions = rng.normal(size=(40, potential.dimension))
    forces = np.array([boundary(potential, v, s) for v, s in zip(directions, low.tolist(), strict=True)])
    added = []
    for width in (1e-2, 1e-3, 1e-4):
        *ends, bound = potential.over(low, low + width).outside(forces, forces, np.zeros_like(forces), 0.0)
        added.append(float(np.max(bound - np.maximum(*ends))))
    assert added[1] < 0.1 * added[0] and added[2] < 0.1 * added[1] < 1e-4


def test_a_stretch_ends_where_a_period_ends() -> None:
    saw = read(lambda s: [1.0 + s % 1.0 if s < 1 else 2.0], "weights", closes=False)
    chord = saw.chord(np.array([0.9]), np.array([1.0]))
    np.testing.assert_allclose([chord.start[0, 0], chord.end[0, 0]], [1.9, 2.0])


def test_functions_are_estimated_from_the_middle() -> None:
    potential = WeightedL1(lambda s: [2.0 - np.cos(2 * np.pi * s)])
    assert not potential.bounded
    forces = np.array([[1.5]])
    *_, bound = potential.over(np.array([0.1]), np.array([0.3])).outside(forces, forces, np.zeros((1, 1)), 0.0)
    s = np.linspace(0.1, 0.3, 101)
    assert bound[0] >= np.max(1.5 - (2.0 - np.cos(2 * np.pi * s)))
