"""Laws of the play operator with moving thresholds, for random loads and thresholds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.arrays import Array
from stickslip.rate_independent.play.clamp import clamp, plays, prandtl_ishlinskii
from stickslip.rate_independent.play.operator import Play, play

T = 4.0
TIMES = np.linspace(0.0, T, 801)

# Examples are drawn anew from the test's name, the same in every run.
law = settings(max_examples=25, deadline=None, derandomize=True)


@dataclass(frozen=True)
class Motion:
    """A smooth load, thresholds with corners, and where z starts."""

    size: Array
    frequency: Array
    angle: Array
    minus: Array
    plus: Array
    place: float

    def load(self, t: Array) -> Array:
        return (self.size * np.sin(np.multiply.outer(t, self.frequency) + self.angle)).sum(axis=-1)

    def below(self, t: Array) -> Array:
        return self.minus[0] + self.minus[1] * np.abs(np.sin(self.minus[2] * t))

    def above(self, t: Array) -> Array:
        return self.plus[0] + self.plus[1] * np.abs(np.cos(self.plus[2] * t))

    def start(self, place: float | None = None) -> float:
        """A stable position: at the lower bound, at the upper, or between."""
        share = self.place if place is None else place
        return float(self.load(np.zeros(1))[0] - self.plus[0] - self.plus[1] + share * (self.width))

    @property
    def width(self) -> float:
        return float(self.plus[0] + self.plus[1] + self.minus[0])

    def follow(self, **changes: object) -> Play:
        given = {
            "load": self.load,
            "threshold": (self.above, self.below),
            "t_span": (0.0, T),
            "initial": self.start(),
        }
        motion = play(**(given | changes))  # type: ignore[arg-type]
        assert motion.certificate.ok, motion.certificate.verdict
        return motion


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda x: round(x, 6))


def arrays(size: int, low: float, high: float) -> st.SearchStrategy[Array]:
    return st.lists(numbers(low, high), min_size=size, max_size=size).map(np.array)


thresholds = st.tuples(numbers(0, 1), numbers(0, 1), numbers(0.5, 6)).map(np.array)
motions = st.builds(
    Motion,
    arrays(3, -2, 2),
    arrays(3, 0.2, 9),
    arrays(3, 0, 6),
    thresholds,
    thresholds,
    st.sampled_from([0.0, 0.3, 1.0]),
)
paths = st.lists(numbers(-3, 3), min_size=2, max_size=60).map(np.array)
radii = st.lists(numbers(0, 2), min_size=1, max_size=6).map(np.array)


def largest(values: Array) -> float:
    return float(np.max(np.abs(values)))


@law
@given(motions)
def test_certified_and_exact_between_samples(m: Motion) -> None:
    motion = m.follow()
    assert np.all(np.diff(motion.time) >= 0.0)
    assert np.all(np.sign(np.round(np.diff(motion.z), 11)) * motion.mode >= 0)
    # Any grid that holds the nodes gives the same motion.
    t = np.union1d(TIMES, motion.time)
    stepped = clamp(m.load(t) - m.above(t), m.load(t) + m.below(t), m.start())
    assert largest(motion.position(t) - stepped) < 1e-11


@law
@given(
    motions,
    st.sampled_from(
        [lambda t: t**2 / T, lambda t: T * np.sin(np.pi * t / (2 * T)), lambda t: T * (t / T) ** 3]
    ),
)
def test_rate_independence(m: Motion, clock: Callable[[Array], Array]) -> None:
    """Load and thresholds at another pace: the same path."""
    slow = m.follow(
        load=lambda t: m.load(clock(t)),
        threshold=(lambda t: m.above(clock(t)), lambda t: m.below(clock(t))),
    )
    motion = m.follow()
    assert largest(slow.position(TIMES) - motion.position(np.minimum(clock(TIMES), T))) < 1e-11
    assert np.isclose(slow.dissipated, motion.dissipated, rtol=1e-10, atol=1e-10)


@law
@given(motions, numbers(0, 1), numbers(0, 1))
def test_contraction(m: Motion, first: float, second: float) -> None:
    """Two motions under one load never move apart, and have met for good once they are equal."""
    gap = np.abs(
        np.diff([m.follow(initial=m.start(p)).position(TIMES) for p in (first, second)], axis=0)[0]
    )
    assert np.all(np.diff(gap) <= 1e-12)


@law
@given(motions, motions)
def test_lipschitz_and_monotone_in_the_load(m: Motion, other: Motion) -> None:
    """|z − z̃| <= max(|z(0) − z̃(0)|, sup |ℓ − ℓ̃|), and a larger load never leads to a smaller
    z."""
    fine = np.linspace(0.0, T, 20_001)

    def shift(t: Array) -> Array:
        return other.load(t) - other.load(np.zeros(1)).item()

    z = m.follow().position(fine)
    moved = m.follow(load=lambda t: m.load(t) + shift(t)).position(fine)
    # the largest shift may fall between samples
    assert largest(moved - z) <= largest(shift(fine)) + 1e-4
    raised = m.follow(load=lambda t: m.load(t) + shift(t) ** 2).position(fine)
    assert np.all(raised >= z - 1e-11)


@law
@given(motions, numbers(0.2, 3.8))
def test_semigroup(m: Motion, stop: float) -> None:
    whole = m.follow()
    first = m.follow(t_span=(0.0, stop))
    second = m.follow(t_span=(stop, T), initial=first.final)
    early = TIMES[stop >= TIMES]
    late = TIMES[stop <= TIMES]
    assert largest(first.position(early) - whole.position(early)) < 1e-11
    assert largest(second.position(late) - whole.position(late)) < 1e-11
    assert np.isclose(
        first.dissipated + second.dissipated, whole.dissipated, rtol=1e-10, atol=1e-10
    )


@law
@given(motions, numbers(0.1, 10), numbers(0.1, 10))
def test_scaling(m: Motion, force: float, stiffness: float) -> None:
    """All forces times one number, and the stiffness times another."""
    scaled = m.follow(
        load=lambda t: force * m.load(t),
        threshold=(lambda t: force * m.above(t), lambda t: force * m.below(t)),
        stiffness=stiffness,
        initial=m.start() * force / stiffness,
    )
    motion = m.follow()
    assert largest(scaled.position(TIMES) * stiffness / force - motion.position(TIMES)) < 1e-11
    assert np.isclose(
        scaled.dissipated * stiffness / force**2, motion.dissipated, rtol=1e-10, atol=1e-10
    )


@law
@given(motions)
def test_reflection(m: Motion) -> None:
    mirrored = m.follow(load=lambda t: -m.load(t), threshold=(m.below, m.above), initial=-m.start())
    assert largest(mirrored.position(TIMES) + m.follow().position(TIMES)) < 1e-11


@law
@given(paths, radii)
def test_only_turning_points_matter(load: Array, r: Array) -> None:
    """Samples in between, as many as one likes, change nothing, bit by bit; nor does it matter when
    they are taken."""
    low, high = np.minimum(load[:-1], load[1:]), np.maximum(load[:-1], load[1:])
    between = np.clip(np.linspace(load[:-1], load[1:], 4, endpoint=False), low, high)
    finer = np.append(between.T.ravel(), load[-1])
    assert np.array_equal(plays(finer, r)[::4], plays(load, r))
    times = np.cumsum(1.0 + np.sin(np.arange(len(load))) ** 2)
    start = float(np.clip(0.0, load[0] - r[0], load[0] + r[0]))
    motion = play((times, load), float(r[0]), (times[0], times[-1]), initial=start)
    assert largest(motion.position(times) - plays(load, r[:1])[:, 0]) < 1e-13
    assert motion.certificate.ok, motion.certificate.verdict


@law
@given(paths, radii, paths)
def test_what_is_surpassed_is_forgotten(load: Array, r: Array, past: Array) -> None:
    """After a swing to ±M, beyond everything before and its thresholds, the past no longer
    shows."""
    beyond = 3.0 + 2.0 * r.max() + 3.0
    for turn in (beyond, -beyond):
        one = plays(np.concatenate([past, [turn], load]), r)[-len(load) :]
        other = plays(np.concatenate([[turn], load]), r)[-len(load) :]
        assert np.array_equal(one, other)


@law
@given(paths, radii)
def test_sum_of_plays(load: Array, r: Array) -> None:
    weights = np.cos(np.arange(len(r)))
    np.testing.assert_allclose(
        prandtl_ishlinskii(load, r, weights), plays(load, r) @ weights, rtol=0, atol=1e-13
    )


@law
@given(paths, radii)
def test_periodic_after_one_round(load: Array, r: Array) -> None:
    """Under a periodic load every play is periodic from the second time around on, and pushed
    wherever it moves."""
    closed = np.concatenate([load, load[-2::-1]])
    z = plays(np.concatenate([closed, closed[1:]]), r)[len(closed) - 1 :]
    assert np.array_equal(z[0], z[-1])
    force = closed[1:, None] - z[1:]
    moved = np.diff(z, axis=0) != 0.0
    assert np.all(np.abs(force) <= r + 1e-14)
    assert largest(np.append((np.abs(force) - r)[moved], 0.0)) < 1e-14
    assert np.all((force * np.diff(z, axis=0))[moved] >= 0.0)
