"""Random systems with several contacts, against implicit time stepping of order one that locates no
event.

Every system is followed with our certificate, and its error against the time stepping is bounded by
a constant times the step and falls with it: both could only agree on something wrong by chance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from oracles.moreau import first_order, moreau, rate_independent
from properties.families import Drawn, draw, linear_family
from stickslip import Trajectory, simulate
from stickslip.arrays import Array

T = 20.0
STEPS = (2000, 8000)
SAMPLES = 200


def follow(kind: str, drawn: Drawn) -> Trajectory:
    system = linear_family(kind, len(drawn.x), len(drawn.s))
    trajectory = simulate(
        system, (0, T), initial=drawn.initial(system), parameters=drawn.parameters(system)
    )
    assert trajectory.outcome.ok, trajectory.message
    assert trajectory.certificate.ok, trajectory.certificate.verdict
    return trajectory


def errors(trajectory: Trajectory, stepped: Callable[[Array, int], Array]) -> Array:
    """Largest difference from the time stepping, by its numbers of steps, relative to the size of
    the motion."""
    values = trajectory.at(np.linspace(0, T, SAMPLES + 1))
    ours = np.stack([values[name] for name in trajectory.system.declaration.state], axis=1)
    theirs = [stepped(np.linspace(0, T, n + 1), n)[:: n // SAMPLES] for n in STEPS]
    return np.array([np.abs(other - ours).max() for other in theirs]) / np.abs(ours).max()


def assert_order_one(found: Array, constant: float) -> None:
    assert np.all(found < constant * T / np.array(STEPS))
    # Events fall anywhere between two steps, so that the order shows only roughly.
    assert found[0] / found[1] == pytest.approx(STEPS[1] / STEPS[0], rel=0.2)


def by_moreau(d: Drawn) -> Callable[[Array, int], Array]:
    def stepped(t: Array, n: int) -> Array:
        return np.hstack(
            moreau(d.M, d.C, d.K, d.J, d.load(t), d.threshold(t), d.belt(t), d.x, d.v, T, n)[:2]
        )

    return stepped


def by_first_order(d: Drawn) -> Callable[[Array, int], Array]:
    return lambda t, n: first_order(d.C, d.K, d.J, d.load(t), d.threshold(t), d.belt(t), d.x, T, n)[
        0
    ]


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(("size", "contacts"), [(1, 1), (2, 2), (3, 2), (4, 4)])
def test_inertial(size: int, contacts: int, seed: int) -> None:
    drawn = draw(np.random.default_rng([size, contacts, seed]), size, contacts)
    assert_order_one(errors(follow("inertial", drawn), by_moreau(drawn)), 15)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(("size", "contacts"), [(3, 2), (4, 4)])
def test_viscous(size: int, contacts: int, seed: int) -> None:
    drawn = draw(np.random.default_rng([size, contacts, seed]), size, contacts)
    assert_order_one(errors(follow("viscous", drawn), by_first_order(drawn)), 5)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("size", [2, 4])
def test_rate_independent(size: int, seed: int) -> None:
    rng = np.random.default_rng([size, seed])
    drawn = draw(rng, size, size)
    # A start inside the stable set, some contacts on its boundary.
    fraction = np.clip(rng.uniform(-1.5, 1.5, size), -1, 1)
    pull = drawn.load(0)[0] - fraction * drawn.threshold(0)[0]
    drawn = replace(drawn, x=np.linalg.solve(drawn.K, pull))
    trajectory = follow("rate-independent", drawn)
    assert trajectory.n_switches > 5
    found = errors(
        trajectory,
        lambda t, n: rate_independent(drawn.K, drawn.load(t), drawn.threshold(t), drawn.x),
    )
    # Between two turning points the stepping is exact on its grid: how it converges depends on
    # where they fall.
    assert np.all(found < 0.5 * T / np.array(STEPS))


# --- Redundant contacts: when all of them stick their forces are not determined, the motion is ----


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(
    ("kind", "size", "contacts"),
    [("inertial", 1, 2), ("inertial", 2, 3), ("inertial", 3, 5), ("viscous", 2, 3)],
)
def test_more_contacts_than_coordinates(kind: str, size: int, contacts: int, seed: int) -> None:
    drawn = draw(
        np.random.default_rng([size, contacts, seed]), size, contacts, b=np.zeros(contacts)
    )
    stepped = (by_moreau if kind == "inertial" else by_first_order)(drawn)
    assert_order_one(errors(follow(kind, drawn), stepped), 15)


@pytest.mark.parametrize("seed", range(10))
def test_redundant_contacts_on_belts_of_different_speeds(seed: int) -> None:
    """At rest they may all stick for an instant only."""
    drawn = draw(np.random.default_rng([9, seed]), 2, 3, b=np.array([0.0, 0.3, -0.2]))
    assert_order_one(errors(follow("inertial", drawn), by_moreau(drawn)), 15)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("factor", [1.0, -1.0, 2.0])
def test_parallel_contacts(factor: float, seed: int) -> None:
    rng = np.random.default_rng([7, seed])
    J = rng.normal(size=(2, 2))
    J[1] = factor * J[0]
    drawn = draw(rng, 2, 2, J=J, b=np.zeros(2))
    assert_order_one(errors(follow("inertial", drawn), by_moreau(drawn)), 15)


@pytest.mark.parametrize("seed", range(5))
def test_two_equal_contacts_are_one(seed: int) -> None:
    """Two contacts at the same place with thresholds s₁ and s₂ move a body as one with s₁ + s₂
    does."""
    rng = np.random.default_rng([8, seed])
    J = rng.normal(size=(2, 2))
    J[1] = J[0]
    two = draw(rng, 2, 2, J=J, b=np.zeros(2), r=np.zeros(2))
    rest = {name: getattr(two, name)[:1] for name in ("r", "alpha", "b", "beta")}
    one = replace(two, J=J[:1], s=two.s.sum(keepdims=True), **rest)
    times = np.linspace(0, T, 101)
    values = [follow("inertial", d).at(times) for d in (one, two)]
    for name in ("x0", "x1", "d_x0", "d_x1"):
        np.testing.assert_allclose(values[1][name], values[0][name], rtol=0, atol=1e-8)
