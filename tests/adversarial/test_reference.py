"""The references against closed forms, published numbers, time stepping, and each other."""

from __future__ import annotations

import gc
import math
import time
import weakref
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from adversarial.case import draw
from adversarial.families.shapes import BUMPS, STEPS, Shape
from adversarial.families.single import by_hand
from adversarial.kinds.motions import instants, sizes
from adversarial.references.event_driven import Motion, integrate
from adversarial.references.mechanics import TIME, Mechanics, Zone
from adversarial.references.pieces import NoAnswer
from adversarial.references.regularised import regularised
from adversarial.verdict import OutOfTime, at_most
from oracles import belt_block, den_hartog, moreau, rate_and_state

NONE = np.zeros(0)


def switches(motion: Motion) -> list[float]:
    """Instants at which a mode begins, without the start."""
    return [phase.time for phase in motion.phases[1:]]


def test_forced_coulomb_oscillator() -> None:
    m = by_hand("inertial", {"m": 1.0, "k": 1.0, "mu": 0.5}, lambda t: math.cos(0.5 * t))
    expected = [2.318558961454817, 2.941257811266674, 7.229012432035236]
    expected += [7.642859644307301, 12.770734250106242, 13.804354019542556]
    assert switches(integrate(m, (0.0, 14.0), [0.0, 0.0], NONE)) == pytest.approx(
        expected, abs=1e-12
    )


def test_block_on_a_belt() -> None:
    numbers = {"m": 1.0, "k": 1.0, "mu": 1.0}
    m = by_hand(
        "inertial", numbers, lambda t: 0.0, kinetic=lambda u: 0.6, belt=lambda t: 0.3 + 0 * t
    )
    times = np.linspace(20.0, 60.0, 400)
    motion = integrate(m, (0.0, 60.0), [0.0, 0.3], times)
    starts = switches(motion)[::2]
    assert np.diff(starts) == pytest.approx(belt_block.period(1.0, 1.0, 0.3, 1.0, 0.6), abs=1e-11)
    assert motion.states[:, 0].max() <= 1.1 + 1e-10
    assert motion.states[:, 0].min() >= 0.1 - 1e-10


@pytest.mark.parametrize(("r", "beta"), [(0.8, 0.3), (1.2, 0.3), (2.0, 0.4)])
def test_den_hartog(r: float, beta: float) -> None:
    # r² x'' + x + β Sign x' ∋ cos(τ + φ), started at the largest displacement.
    phase = den_hartog.phase(r, beta)
    m = by_hand("inertial", {"m": r**2, "k": 1.0, "mu": beta}, lambda t: math.cos(t + phase))
    X = den_hartog.amplitude(r, beta)
    times = np.linspace(0.0, 4 * math.pi, 17)
    motion = integrate(m, (0.0, 4 * math.pi), [X, 0.0], times)
    assert motion.states[:, 0] == pytest.approx(
        den_hartog.state(times + phase, r, beta)[0], abs=1e-10
    )
    assert all(phase.mode[0] != 0 for phase in motion.phases)


@pytest.mark.parametrize("v", [0.11, 0.7, 1.9])
def test_thrown_block(v: float) -> None:
    m = by_hand("inertial", {"m": 1.0, "mu": 0.1}, lambda t: 0.0)
    motion = integrate(m, (0.0, 40.0), [0.0, v], np.array([40.0]))
    assert switches(motion) == pytest.approx([v / 0.1], rel=1e-12)
    assert motion.states[0] == pytest.approx([v**2 / 0.2, 0.0], abs=1e-12)


@pytest.mark.parametrize("shape", [*BUMPS, *STEPS], ids=lambda s: s.name)
@pytest.mark.parametrize("width", [1e-4, 1e-2, 1.0])
def test_play_operator(shape: Shape, width: float) -> None:
    # k z ∈ ℓ ± μ: the clamp of z between its bounds, exact on a grid that resolves the feature.
    k = 1.3
    mu = 0.4
    place = 3.7

    def load(t: np.ndarray) -> np.ndarray:
        return 0.3 * np.sin(t) + 2.0 * np.array(
            [shape.at((s - place) / width) for s in np.atleast_1d(t)]
        )

    m = by_hand(
        "rate-independent",
        {"k": k, "mu": mu},
        lambda t: 0.3 * np.sin(t) + 2.0 * shape.at((t - place) / width),
        zones=(Zone(TIME, place, width),),
    )
    grid = np.unique(
        np.concatenate(
            [np.linspace(0, 9, 30_001), place + width * np.sinh(np.linspace(-9, 9, 30_001))]
        )
    )
    grid = grid[(grid >= 0) & (grid <= 9)]
    loads = load(grid)
    z = 0.0
    found = []
    for value in loads:
        z = min(max(z, (value - mu) / k), (value + mu) / k)
        found.append(z)
    times = np.sort(
        np.append(np.linspace(0.3, 9.0, 30), place + width * np.array([-1.0, 0.1, 0.7, 3.0]))
    )
    motion = integrate(m, (0.0, 9.0), [0.0], times[times <= 9.0])
    # Between its nodes the clamp misses extrema by a quarter of a squared distance.
    assert motion.states[:, 0] == pytest.approx(np.interp(motion.times, grid, found), abs=2e-6)


@pytest.mark.parametrize("width", [1e-6, 1e-4])
def test_pulse_is_a_blow(width: float) -> None:
    impulse = 1.7
    m = by_hand(
        "inertial",
        {"m": 2.0, "k": 1.0, "mu": 0.3},
        lambda t: impulse / (width * math.sqrt(math.pi)) * BUMPS[0].at((t - 5.0) / width),
        zones=(Zone(TIME, 5.0, width),),
    )
    motion = integrate(m, (0.0, 10.0), [0.0, 0.0], np.array([5.0 + 10 * width]))
    assert motion.states[0, 1] == pytest.approx(impulse / 2.0, abs=10 * width)
    # Without the planted place the reference would be as blind as any integrator.
    assert np.all(
        integrate(replace(m, zones=()), (0.0, 10.0), [0.0, 0.0], np.array([10.0])).states == 0.0
    )


@pytest.mark.parametrize("excess", [1e-4, 1e-8, 3e-12, -3e-12, -1e-6])
@pytest.mark.parametrize("phase", [0.3, 1.234, 2.0])
def test_grazing(excess: float, phase: float) -> None:
    m = by_hand(
        "inertial",
        {"m": 1.0, "k": 1.0, "mu": 1.0},
        lambda t: (1 + excess) * math.cos(t - phase),
        kinetic=lambda u: 0.5,
    )
    motion = integrate(m, (0.0, 3.0), [0.0, 0.0], np.array([3.0]))
    if excess < 0:
        assert switches(motion) == []
    else:
        assert switches(motion)[0] == pytest.approx(phase - math.acos(1 / (1 + excess)), abs=1e-9)


def test_rate_and_state_has_a_first_integral() -> None:
    case = draw("rate and state", 0)
    a, b = 0.01, 0.015

    def law(t: float, x: object, rates: object, y: np.ndarray, side: object) -> list[float]:
        ageing = np.exp(-y[1]) - np.exp(y[0])
        return [((b - a) * (1 - np.exp(y[0])) - b * ageing) / a, ageing]

    assert case.mechanics is not None
    times = np.linspace(0.0, 30.0, 20)
    motion = integrate(replace(case.mechanics, law=law), (0.0, 30.0), [0.3, -0.3], times)
    kept = rate_and_state.first_integral(motion.states[:, 0], motion.states[:, 1], a, b)
    assert kept == pytest.approx(kept[0], rel=1e-10)


@pytest.mark.parametrize(
    "family", ["mutual friction", "hyperstatic", "symmetric pair", "pair with two contacts"]
)
@pytest.mark.parametrize("seed", [0, 1])
def test_several_contacts_against_time_stepping(family: str, seed: int) -> None:
    case = draw(family, seed)
    m = case.mechanics
    steps = 4_000
    T = 5.0
    assert m is not None
    if m.kinds[0] != 2 or m.kinetic is not None:
        pytest.skip("time stepping is for masses with one friction force")
    nothing = np.zeros(2)
    M = np.array(m.inertia)
    J = np.array(m.J)
    rest = (nothing, nothing, nothing)

    def slopes(which: int) -> np.ndarray:
        state = [np.array(part) for part in ((0.0, 0.0), (0.0, 0.0))]
        columns = []
        for i in range(2):
            state[which] = np.eye(2)[i]
            columns.append(
                np.array(m.force(0.0, *state, NONE, NONE))
                - np.array(m.force(0.0, *rest[:2], NONE, NONE))
            )
        return -np.array(columns).T

    grid = np.linspace(0.0, T, steps + 1)
    forces = np.array([m.force(t, nothing, nothing, NONE, NONE) for t in grid])
    threshold = np.array([m.threshold(t, nothing, nothing, NONE, NONE) for t in grid])
    q, v, _ = moreau.moreau(
        M,
        slopes(1),
        slopes(0),
        J,
        forces,
        threshold,
        0 * threshold,
        case.start[:2],
        case.start[2:],
        T,
        steps,
    )
    motion = integrate(m, (0.0, T), case.start, grid[:: steps // 10])
    assert np.hstack([q, v])[:: steps // 10] == pytest.approx(motion.states, abs=3e-2)


def test_rate_independent_pair_against_time_stepping() -> None:
    case = next(
        c
        for c in (draw("pair with two contacts", s) for s in range(20))
        if c.mechanics is not None and c.mechanics.kinds[2]
    )
    n, m = case.parameters, case.mechanics
    assert m is not None
    A = np.array([[n["k"] + n["j"], -n["j"]], [-n["j"], n["h"] + n["j"]]])
    grid = np.linspace(0.0, case.duration, 20_001)
    loads = np.array([m.force(t, np.zeros(2), NONE, NONE, NONE) for t in grid])
    z = moreau.rate_independent(A, loads, np.tile([n["mu"], n["nu"]], (len(grid), 1)), case.start)
    motion = integrate(m, (0.0, case.duration), case.start, grid[::1000])
    assert z[::1000] == pytest.approx(motion.states, abs=1e-6)


SMOOTH = [
    "forced dashpot",
    "stribeck belt",
    "kinked spring",
    "pulse in the load, inertial",
    "dip of a threshold, viscous",
    "rough patch, inertial",
    "narrow wall, viscous",
    "spring slider",
    "blocks on a belt",
    "step in the load, inertial",
]


@pytest.mark.parametrize("family", SMOOTH)
def test_smoothed_friction_agrees_coarsely(family: str) -> None:
    case = draw(family, 1)
    m = case.mechanics
    times = instants(case)
    assert m is not None
    motion = integrate(m, (0.0, case.duration), case.start, times)
    smooth = regularised(m, (0.0, case.duration), case.start, times)
    # Sticking contacts creep; where static exceeds kinetic friction, the end of stick comes later
    # by the root of ε.
    size = sizes(case, motion.states)
    off = (np.abs(smooth - motion.states) - 1e-5 * case.duration) / size
    assert np.max(off) < (1e-3 if m.kinetic is None else 1e-2)


def test_no_bounded_rate_is_an_outcome() -> None:
    k, s = 0.5, 0.2
    m = Mechanics(
        kinds=(0, 0, 1, 0),
        J=[[1.0]],
        force=lambda t, x, v, a, side: [k * (t - x[0]) - np.sin(x[0])],
        threshold=lambda t, x, v, a, side: [s],
        step=0.1,
    )
    motion = integrate(m, (0.0, 20.0), [0.0], np.array([20.0]))
    turn = math.acos(-k)
    assert motion.outcome == "no bounded rate"
    assert motion.end == pytest.approx(turn + (math.sin(turn) + s) / k, abs=1e-6)


def test_start_outside_the_stable_set() -> None:
    m = by_hand("rate-independent", {"k": 1.0, "mu": 0.5}, lambda t: 0.0 * t)
    with pytest.raises(NoAnswer, match="unstable start"):
        integrate(m, (0.0, 1.0), [0.7], NONE)


@pytest.mark.parametrize(
    ("family", "seed"), [("corners of the toy", 1), ("toy on a knife edge", 1)]
)
def test_two_legs_against_small_steps(family: str, seed: int) -> None:
    # The body by Verlet steps that shorten near the edge; the legs by incremental minimisation
    # after every step.
    case = draw(family, seed)
    m = case.mechanics
    w = case.parameters["psi_star"] if "knife" in family else 1.0
    assert m is not None
    (psi, right, left, v), t, found = case.start, 0.0, []

    def state() -> tuple:
        side = np.sign([psi - 1.0, psi + 1.0])
        return 0.0, np.array([psi, right, left]), np.array([v]), NONE, side

    while t < case.duration:
        h = min(2e-3, (0.1 * abs(psi) + 0.02 * w) / (abs(v) + 1e-3))
        half = v + h / 2 * m.force(*state())[0]
        psi += h * half
        for _ in range(50):
            force, hold = m.force(*state()), m.threshold(*state())
            moved = force[1] - np.clip(force[1], -hold[0], hold[0])
            right += moved
            force = m.force(*state())
            stepped = force[2] - np.clip(force[2], -hold[1], hold[1])
            left += stepped
            if max(abs(moved), abs(stepped)) < 1e-14:
                break
        v = half
        v += h / 2 * m.force(*state())[0]
        t += h
        found.append((t, psi, right, left))
    table = np.array(found)
    times = np.linspace(0.2, 0.99, 9) * case.duration
    motion = integrate(m, (0.0, case.duration), case.start, times)
    stepped_states = np.array([np.interp(times, table[:, 0], table[:, i]) for i in (1, 2, 3)]).T
    assert stepped_states == pytest.approx(motion.states[:, :3], abs=1e-3)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_time_runs_out_after_what_the_garbage_collector_does() -> None:
    """What is raised there is ignored, and nothing would end the body."""

    def busy(phase: str, info: dict[str, int]) -> None:
        start = time.process_time()
        while time.process_time() - start < 0.1:
            pass

    gc.callbacks.append(busy)
    try:
        with pytest.raises(OutOfTime), at_most(0.02):
            gc.collect()
            while True:
                pass
    finally:
        gc.callbacks.remove(busy)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_time_runs_out_after_a_finalizer() -> None:
    """What is raised there is ignored, too: the limit is said again."""

    class Slow:
        def __del__(self) -> None:
            start = time.process_time()
            while time.process_time() - start < 0.1:
                pass

    with pytest.raises(OutOfTime), at_most(0.02):
        slow = Slow()
        del slow
        while True:
            pass


def test_time_runs_out_beside_weak_references(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is raised while a weak dictionary removes what is gone."""
    ignored: list[object] = []
    monkeypatch.setattr("sys.unraisablehook", ignored.append)

    class Key:
        pass

    for _ in range(20):
        known = weakref.WeakKeyDictionary[Key, int]()
        with pytest.raises(OutOfTime), at_most(0.02):
            while True:
                for _ in range(50):
                    known[Key()] = 1
    assert not ignored


def test_time_runs_out_after_the_hook_of_what_is_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes its time to write the traceback, and must end."""
    told = []

    def hook(ignored: object) -> None:
        start = time.process_time()
        while time.process_time() - start < 0.1:
            pass
        told.append(ignored)

    class Raising:
        def __del__(self) -> None:
            raise ValueError("ignored")

    monkeypatch.setattr("sys.unraisablehook", partial(hook))
    with pytest.raises(OutOfTime), at_most(0.02):
        raising = Raising()
        del raising
        while True:
            pass
    assert len(told) == 1


@pytest.mark.parametrize("inner", [0.02, 10.0])
def test_time_runs_out_around_what_has_a_limit_of_its_own(inner: float) -> None:
    with pytest.raises(OutOfTime), at_most(0.1):
        with suppress(OutOfTime), at_most(inner):
            start = time.process_time()
            while time.process_time() - start < 0.05:
                pass
        while True:
            pass
