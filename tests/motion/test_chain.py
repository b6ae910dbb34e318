"""Eight blocks on springs, each with its own contact with the belt."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from oracles.moreau import moreau
from stickslip import System, Trajectory, catalogue, simulate
from stickslip.arrays import Array

N = 8
BLOCKS = [f"x_{i}" for i in range(1, N + 1)]


@cache
def chain() -> System:
    return catalogue.block_chain(N=N)


def positions(trajectory: Trajectory, times: Array) -> Array:
    values = trajectory.at(times)
    return np.stack([values[x] for x in BLOCKS], axis=1)


def run(
    start: Array, until: float = 100.0, velocity: Array | None = None, **parameters: float
) -> Trajectory:
    initial = dict(zip(BLOCKS, map(float, start), strict=True))
    if velocity is not None:
        initial |= {f"d_{x}": float(v) for x, v in zip(BLOCKS, velocity, strict=True)}
    trajectory = simulate(chain(), (0.0, until), initial=initial, parameters=parameters)
    assert trajectory.outcome.ok, trajectory.message
    assert trajectory.certificate.ok, trajectory.certificate.verdict
    return trajectory


def test_a_nonsymmetric_start() -> None:
    assert len(chain().contacts) == N
    trajectory = run(0.2 * (np.arange(N) ** 2 % 5))
    assert trajectory.n_switches > 150
    assert {str(c) for c in trajectory.events["contact"]} == set(chain().contacts)
    # Blocks slip alone and together.
    slipping = np.count_nonzero(trajectory.knots.mode, axis=1)
    assert {0, 1, 2} <= set(slipping.tolist())


@pytest.mark.parametrize("amplitude", [0.1, 0.3, 0.55])
def test_a_symmetric_start_stays_symmetric(amplitude: float) -> None:
    trajectory = run(amplitude * np.cos(np.arange(N) - 3.5))
    assert trajectory.n_switches > 100
    motion = positions(trajectory, np.linspace(0, 100, 501))
    np.testing.assert_allclose(motion, motion[:, ::-1], rtol=0, atol=1e-9)
    # Each event of a block is an event of its mirror image at the same time.
    events = trajectory.events
    for i in range(N // 2):
        left, right = (
            events.loc[events["contact"] == f"block {k}", "time"] for k in (i + 1, N - i)
        )
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-9)


@pytest.mark.parametrize("start", [0.0, 0.3, -0.8])
def test_equal_blocks_move_as_one(start: float) -> None:
    together = run(np.full(N, start))
    alone = simulate(catalogue.belt_block(V=0.1), (0.0, 100.0), initial={"x": start})
    times = np.linspace(0, 100, 501)
    one = np.tile(alone.at(times)["x"], (N, 1)).T
    np.testing.assert_allclose(positions(together, times), one, rtol=0, atol=1e-9)
    assert together.n_switches == N * alone.n_switches
    # Eight contacts change at once: one knot, not eight.
    assert len(np.unique(together.events["time"])) == len(np.unique(alone.events["time"]))


def test_against_time_stepping() -> None:
    rng = np.random.default_rng(4)
    start = rng.normal(size=N)
    velocity = rng.normal(size=N)
    T = 10.0
    parameters = {"m": 0.7, "k": 0.4, "k_c": 1.3, "V": 0.2, "F_s": 0.15, "F_k": 0.15}
    ours = positions(run(start, T, velocity, **parameters), np.linspace(0, T, 201))
    one = np.eye(N)
    joints = np.diff(one, axis=0)
    K = 0.4 * one + 1.3 * joints.T @ joints
    errors = []
    for n in (4000, 16_000):
        threshold, belt = np.full((n + 1, N), 0.15), np.full((n + 1, N), 0.2)
        q, _, _ = moreau(
            0.7 * one, 0 * one, K, one, 0 * belt, threshold, belt, start, velocity, T, n
        )
        errors.append(np.abs(q[:: n // 200] - ours).max())
    assert errors[0] < 50 * T / 4000
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.2)


LONG = 60


@pytest.mark.parametrize("coupling", [0.0, 0.5])
def test_a_long_chain_is_what_its_blocks_are(coupling: float) -> None:
    """Without springs between them, each of many blocks moves as it would alone; blocks that start
    alike move alike with them."""
    rng = np.random.default_rng(5)
    starts = rng.uniform(-0.9, 0.9, LONG) if coupling == 0.0 else np.full(LONG, 0.3)
    long = catalogue.block_chain(N=LONG)
    initial = {f"x_{i}": float(x) for i, x in enumerate(starts, 1)}
    together = simulate(long, (0.0, 30.0), initial=initial, parameters={"k_c": coupling})
    assert together.outcome.ok, together.message
    assert together.certificate.ok, together.certificate.verdict
    times = np.linspace(0, 30, 151)
    values = together.at(times)
    events = together.events
    for i in range(1, LONG + 1, 7):
        alone = simulate(catalogue.belt_block(V=0.1), (0.0, 30.0), initial={"x": initial[f"x_{i}"]})
        np.testing.assert_allclose(values[f"x_{i}"], alone.at(times)["x"], rtol=0, atol=1e-9)
        own = events.loc[events["contact"] == f"block {i}", "time"]
        np.testing.assert_allclose(own, alone.events["time"], rtol=0, atol=1e-9)


def test_mirror_images_slip_at_the_same_times() -> None:
    """Pairs of contacts change together, again and again, and nothing else breaks the symmetry."""
    places = np.random.default_rng(6).uniform(-0.5, 0.5, LONG // 2)
    initial = {f"x_{i}": float(x) for i, x in enumerate([*places, *places[::-1]], 1)}
    trajectory = simulate(catalogue.block_chain(N=LONG), (0.0, 10.0), initial=initial)
    assert trajectory.outcome.ok, trajectory.message
    mode = trajectory.knots.mode
    np.testing.assert_array_equal(mode, mode[:, ::-1])
    state = trajectory.knots.state[:, :LONG]
    np.testing.assert_allclose(state, state[:, ::-1], rtol=0, atol=1e-9)
    assert trajectory.n_switches > 100
