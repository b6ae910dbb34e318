"""What is said of all phases of a stretch holds at each of them, for every kind of potential made
of formulas."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.arrays import Array
from stickslip.rate_independent.dissipation import (
    Dissipation,
    Ellipsoid,
    GroupNorm,
    Polytope,
    Product,
    WeightedL1,
)
from stickslip.rate_independent.dissipation.parabolas import CELLS, Parabolas
from stickslip.rate_independent.sets.phase_intervals import RowWise
from stickslip.rate_independent.signals.formulas import Formulas
from stickslip.rate_independent.signals.reading import read_phase

seeds = st.integers(0, 2**32 - 1)


def number(rng: np.random.Generator, mean: float, swing: float, sharp: bool) -> str:
    """A formula in s: a wave, perhaps with a narrow well and a kink in it."""
    a = rng.uniform(-1, 1)
    b = rng.uniform(-1, 1)
    p = rng.uniform()
    q = rng.uniform()
    text = f"{mean!r} + {swing!r}*({a!r}*cos(2*pi*(s - {p!r})) + {b!r}*sin(4*pi*(s - {q!r}))/2"
    if sharp:
        width = 10.0 ** rng.uniform(-6, -1)
        text += f" - exp(-(sin(pi*(s - {q!r}))/{width!r})**2) + abs(sin(pi*(s - {p!r})))/2"
    return text + ")"


def weighted_l1(rng: np.random.Generator, sharp: bool) -> Dissipation:
    return WeightedL1(
        [number(rng, 2.0, 0.5, sharp) for _ in range(3)],
        [number(rng, 2.0, 0.4, sharp) for _ in range(3)],
    )


def groups(rng: np.random.Generator, sharp: bool) -> Dissipation:
    return GroupNorm([number(rng, 2.0, 0.5, sharp) for _ in range(2)], size=int(rng.integers(1, 4)))


def ellipsoid(rng: np.random.Generator, sharp: bool) -> Dissipation:
    p = rng.uniform()
    reach = rng.uniform(0.2, 3.0)
    long, short = number(rng, 2.0, 0.5, sharp), number(rng, 0.6, 0.2, sharp)
    c, d = (f"{f}({reach!r}*sin(2*pi*(s - {p!r})))" for f in ("cos", "sin"))
    off = f"({long} - ({short}))*{c}*{d}"
    return Ellipsoid(
        [[f"({long})*{c}**2 + ({short})*{d}**2", off], [off, f"({long})*{d}**2 + ({short})*{c}**2"]]
    )


def vertices(rng: np.random.Generator, sharp: bool) -> Dissipation:
    n = int(rng.integers(2, 4))
    points = rng.normal(size=(n + 3, n))
    points = np.vstack([points, -points.mean(axis=0) * 3])
    return Polytope(
        vertices=[[number(rng, float(x), 0.15, sharp) for x in row] for row in points + 0.0]
    )


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
    return float(
        np.abs(beyond).max() if isinstance(potential, WeightedL1) else np.linalg.norm(beyond)
    )


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=12, deadline=None, derandomize=True)
@given(seeds, st.booleans(), st.floats(-7, -0.3))
def test_no_phase_in_between_is_worse(kind: str, seed: int, sharp: bool, exponent: float) -> None:
    rng = np.random.default_rng(seed)
    potential = drawn(kind, rng, sharp)
    if potential is None:
        return
    assert potential.bounded
    n = potential.dimension
    m = 6
    low = rng.uniform(0.0, 1.0, m)
    high = np.minimum(low + 10.0**exponent, 1.0)
    # Forces near the boundary, that move a little, or not at all.
    before = np.array(
        [potential.exposed(rng.normal(size=n), s) * rng.uniform(0.7, 1.1) for s in low]
    )
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
    assert isinstance(stretches, RowWise)
    parts = stretches.taken(np.arange(m) % 2 == 0).joined(stretches.taken(np.arange(m) % 2 == 1))
    order = np.argsort(np.arange(m) % 2, kind="stable")
    for ours, theirs in zip(
        parts.outside(before[order], after[order], off[order], 0.0),
        (first, last, bound),
        strict=True,
    ):
        np.testing.assert_allclose(ours, theirs[order], rtol=1e-12, atol=1e-13)


def boundary(potential: Dissipation, v: Array, s: float) -> Array:
    """A point of the boundary; of a hull, inside a facet: with its corners, the facets move in and
    out."""
    if not isinstance(potential, Polytope) or potential.corners is None:
        return potential.exposed(v, s)
    points = potential.corners.at(s)
    known = potential.facets_at(s)
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
    forces = np.array(
        [boundary(potential, v, s) for v, s in zip(directions, low.tolist(), strict=True)]
    )
    added = []
    for width in (1e-2, 1e-3, 1e-4):
        *ends, bound = potential.over(low, low + width).outside(
            forces, forces, np.zeros_like(forces), 0.0
        )
        added.append(float(np.max(bound - np.maximum(*ends))))
    assert added[1] < 0.1 * added[0] and added[2] < 0.1 * added[1] < 1e-4


def test_a_stretch_ends_where_a_period_ends() -> None:
    saw = read_phase(lambda s: [1.0 + s % 1.0 if s < 1 else 2.0], "weights", closes=False)
    chord = saw.chord(np.array([0.9]), np.array([1.0]))
    np.testing.assert_allclose([chord.start[0, 0], chord.end[0, 0]], [1.9, 2.0])


def test_functions_are_estimated_from_the_middle() -> None:
    potential = WeightedL1(lambda s: [2.0 - np.cos(2 * np.pi * s)])
    assert not potential.bounded
    forces = np.array([[1.5]])
    *_, bound = potential.over(np.array([0.1]), np.array([0.3])).outside(
        forces, forces, np.zeros((1, 1)), 0.0
    )
    s = np.linspace(0.1, 0.3, 101)
    assert bound[0] >= np.max(1.5 - (2.0 - np.cos(2 * np.pi * s)))


# -- bounds of second order ------------------------------------------------------------------------


def touching(shape: Ellipsoid, direction: Array) -> tuple[Array, Array]:
    """The longest force in a direction that lies in K(s) at all phases of a fine grid, and where it
    touches."""
    phases = np.linspace(0.0, 1.0, 20_001)[:-1]
    S = shape.matrix.over(phases)
    gauge = np.einsum("i,mij,j->m", direction, np.linalg.inv(S), direction)
    return direction / np.sqrt(gauge.max()), phases[[gauge.argmax()]]


@settings(max_examples=30, deadline=None)
@given(seeds, st.booleans())
def test_no_eigenvalue_falls_below_its_parabola(seed: int, sharp: bool) -> None:
    rng = np.random.default_rng(seed)
    shape = ellipsoid(rng, sharp)
    assert isinstance(shape, Ellipsoid)
    parabolas = Parabolas.of(shape.matrix)
    for _ in range(10):
        # A force close to the boundary at some phase, which may lie far outside at others.
        phases, direction = rng.uniform(size=1), rng.normal(size=2)
        (S,) = shape.matrix.over(phases)
        xi = (
            direction / np.sqrt(direction @ np.linalg.solve(S, direction)) * rng.uniform(0.95, 1.05)
        )
        for low, high, below, least in zip(
            *(rows[:, 0] for rows in parabolas.around(phases, xi)), strict=True
        ):
            S = shape.matrix.over(np.linspace(low, high, 301))
            assert np.linalg.eigvalsh(S - np.outer(xi, xi))[:, 0].min() >= -below - 1e-14
            assert np.linalg.eigvalsh(S)[:, 0].min() >= least - 1e-14


@settings(max_examples=40, deadline=None)
@given(seeds, st.booleans())
def test_what_is_proved_around_a_phase_holds_there(seed: int, sharp: bool) -> None:
    rng = np.random.default_rng(seed)
    shape = ellipsoid(rng, sharp)
    assert isinstance(shape, Ellipsoid)
    xi, phases = touching(shape, rng.normal(size=2))
    for factor in (1.0, 1.0 + 1e-9, 1.0 - 1e-6):
        near = shape.around(shape.closest(phases, factor * xi), factor * xi, 1e-4)
        for low, high, bound in zip(near.low, near.high, near.bound, strict=True):
            inside = np.linspace(low, high, 400)
            assert shape.sampled(inside).excess(factor * xi).max() <= bound + 1e-13


@pytest.mark.parametrize("seed", range(3))
def test_second_derivatives_stay_near_their_middle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = ellipsoid(rng, False)
    assert isinstance(shape, Ellipsoid)
    matrix = shape.matrix
    assert isinstance(matrix, Formulas)
    parabolas, cell = Parabolas.of(matrix), np.arange(CELLS)
    for r, (low, high, middle, radius) in enumerate(
        zip(parabolas.low, parabolas.high, parabolas.middle, parabolas.radius, strict=True)
    ):
        np.testing.assert_array_equal(low, np.maximum(cell - 2**r, 0) / CELLS)
        np.testing.assert_array_equal(high, np.minimum(cell + 2**r + 1, CELLS) / CELLS)
        for end in (low, high):
            second = (matrix.slope(end + 1e-6) - matrix.slope(end - 1e-6)) / 2e-6
            off = np.sqrt(np.square(second - middle).sum(axis=(1, 2)))
            assert (off <= radius + 1e-6 * np.abs(second).max()).all()


def test_a_smooth_contact_is_proved_on_a_wide_stretch() -> None:
    turning = Ellipsoid(
        [
            ["17/8 + 15/8*cos(2*pi*s)", "15/8*sin(2*pi*s)"],
            ["15/8*sin(2*pi*s)", "17/8 - 15/8*cos(2*pi*s)"],
        ]
    )
    # along the short axis at that phase
    s = 0.3
    xi = 0.5 * np.array([-np.sin(0.3 * np.pi), np.cos(0.3 * np.pi)])
    near = turning.around(np.array([s]), xi, 1e-12)
    assert near.low[0] < s - 1e-3
    assert near.high[0] > s + 1e-3
    assert near.bound[0] <= 1e-13
    # A force that is a little too long is outside by that.
    (outside,) = turning.around(np.array([s]), xi * (1.0 + 1e-8), 1e-6).bound
    assert 0.5e-8 <= outside <= 2e-8


@pytest.mark.parametrize(
    "bend",
    [
        pytest.param("1.5*abs(s - 0.3)", id="kink"),
        pytest.param("(1 + tanh(1e9*(s - 0.3)))/2", id="step"),
        pytest.param("max(0.1 - abs(s - 0.3)/0.001, 0)", id="wedge"),
        pytest.param("piecewise(s < 0.3, 0, 0.1)", id="jump"),
        pytest.param("0.1*exp(-((s - 0.3003)/1e-5)**2)", id="pulse nearby"),
        pytest.param("0.3*sqrt(abs(s - 0.3))", id="cusp"),
    ],
)
def test_nothing_is_proved_across_what_is_not_smooth(bend: str) -> None:
    shape = Ellipsoid([[f"1 - ({bend})*s*(1 - s)", "0"], ["0", "4"]])
    (S,) = shape.matrix.over(np.array([0.29999]))
    xi = np.array([np.sqrt(S[0, 0]), 0.0])
    near = shape.around(np.array([0.29999]), xi, 1.0)
    for low, high, bound in zip(near.low, near.high, near.bound, strict=True):
        assert shape.sampled(np.linspace(low, high, 20_001)).excess(xi).max() <= bound + 1e-13
    assert not (near.low < 0.2999) @ ((near.high > 0.3004) & (near.bound < 1e-9))


def test_second_derivatives_are_not_known_at_kinks_and_jumps() -> None:
    low, high = np.array([0.1, 0.25, 0.6]), np.array([0.2, 0.35, 0.7])
    for text in (
        "abs(s - 0.3)",
        "sqrt(abs(s - 0.3))",
        "max(s - 0.3, 0)**1.5",
        "piecewise(s < 0.3, 1, 2)",
    ):
        varying = read_phase([text], "shape", closes=False)
        assert isinstance(varying, Formulas)
        least, most = varying.bent(low, high)
        assert np.isfinite(least[[0, 2]]).all()
        assert np.isfinite(most[[0, 2]]).all()
        assert least[1, 0] == -np.inf
        assert most[1, 0] == np.inf
    smooth = read_phase(["sin(2*pi*s)"], "shape")
    assert isinstance(smooth, Formulas)
    least, most = smooth.bent(low, high)
    for k in range(3):
        inside = -((2 * np.pi) ** 2) * np.sin(2 * np.pi * np.linspace(low[k], high[k], 100))
        assert least[k, 0] <= inside.min() <= inside.max() <= most[k, 0]
        assert most[k, 0] - least[k, 0] <= 1.5 * (inside.max() - inside.min()) + 1.0
