"""Motions under drives that are known at some times."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import stickslip as ss
from stickslip.arrays import Array


def shaken(samples: ss.Samples, mu: float = 0.3, **more: Any) -> ss.System:
    """A block on a base that is shaken."""
    return ss.System(
        name="shaken",
        drives={"a": samples},
        coordinates={"x": ss.Inertial(force="-a")},
        kinetic="d_x**2/2",
        contacts={"base": ss.Contact("d_x", mu)},
        span=samples.span,
        **more,
    )


def newmark(t: Array, a: Array, mu: float) -> tuple[Array, Array]:
    """Position and velocity of a block at the samples, for accelerations that are held: exact, stop
    by stop."""
    x, v = 0.0, 0.0
    found = [(x, v)]
    for start, end, pull in zip(t[:-1], t[1:], -a[:-1], strict=True):
        left = end - start
        while left > 0.0:
            if v == 0.0 and abs(pull) <= mu:
                break
            sense = np.sign(v) if v != 0.0 else np.sign(pull)
            rate = pull - mu * sense
            stop = -v / rate if v != 0.0 and rate * v < 0.0 else np.inf
            step = min(left, stop)
            x, v = x + v * step + 0.5 * rate * step**2, v + rate * step
            if step == stop:
                v = 0.0
            left -= step
        found.append((x, v))
    return tuple(np.array(found).T)


@pytest.mark.parametrize("seed", range(3))
def test_held_accelerations(seed: int) -> None:
    """Piecewise quadratic motion, in closed form."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.01, 0.3, 200))
    a = rng.normal(scale=0.6, size=200)
    motion = ss.simulate(shaken(ss.Samples(t, a, kind="hold")))
    assert motion.certificate.ok and motion.outcome.ok
    x, v = newmark(t, a, 0.3)
    found = motion.at(t)
    np.testing.assert_allclose(found["x"], x, atol=1e-12 * np.max(np.abs(x)))
    np.testing.assert_allclose(found["d_x"], v, atol=1e-12 * np.max(np.abs(v)))


@pytest.mark.parametrize("kind", ["linear", "cubic", "hold"])
@pytest.mark.parametrize("seed", [10, 11])
def test_rough_samples_are_certified(kind: Literal["linear", "cubic", "hold"], seed: int) -> None:
    """Noise from one sample to the next: steps are as short as the samples are near each other,
    also where a series ends and its own step is unbounded."""
    t = np.arange(1001) * 0.01
    a = np.sin(t) + 0.3 * np.random.default_rng(seed).normal(size=1001)
    motion = ss.simulate(shaken(ss.Samples(t, a, kind)))
    assert motion.certificate.ok
    # The same samples later on the clock.
    later = ss.simulate(shaken(ss.Samples(t + 1e6, a, kind)))
    np.testing.assert_allclose(later.final["x"], motion.final["x"], atol=1e-8)


def test_lines_without_friction() -> None:
    """Piecewise cubic motion, in closed form; the work of a potential drive is exact, too."""
    rng = np.random.default_rng(5)
    t, a = np.linspace(-1.0, 4.0, 101), rng.normal(size=101)
    system = ss.System(
        name="pulled",
        drives={"a": ss.Samples(t, a)},
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="-a*x",
        span=(-1.0, 4.0),
    )
    motion = ss.simulate(system)
    h = np.diff(t)
    v = np.append(0.0, np.cumsum(0.5 * h * (a[1:] + a[:-1])))
    x = np.append(0.0, np.cumsum(v[:-1] * h + h**2 * (2.0 * a[:-1] + a[1:]) / 6.0))
    found = motion.at(t)
    assert motion.certificate.ok
    np.testing.assert_allclose(found["x"], x, atol=1e-13 * np.max(np.abs(x)))
    np.testing.assert_allclose(found["d_x"], v, atol=1e-13 * np.max(np.abs(v)))


def test_more_samples_on_a_line_change_nothing() -> None:
    """A motion does not depend on how its drive is cut into pieces."""
    rng = np.random.default_rng(6)
    t, a = np.linspace(0.0, 10.0, 41), rng.normal(size=41)
    finer = np.sort(np.append(t, rng.uniform(0.0, 10.0, 57)))
    one = ss.simulate(shaken(ss.Samples(t, a)))
    other = ss.simulate(shaken(ss.Samples(finer, np.interp(finer, t, a))))
    assert one.certificate.ok and other.certificate.ok
    places = np.linspace(0.0, 10.0, 77)
    for name in ("x", "d_x", "friction_base"):
        np.testing.assert_allclose(one.at(places)[name], other.at(places)[name], atol=1e-12)


def test_samples_of_a_smooth_function() -> None:
    """Splines of slow functions come to them with order 4."""
    off = []
    formula = ss.simulate(
        ss.System(
            name="formula",
            drives={"a": "sin(t)"},
            coordinates={"x": ss.Inertial(force="-a")},
            kinetic="d_x**2/2",
            contacts={"base": ss.Contact("d_x", 0.3)},
            span=(0.0, 10.0),
        )
    )
    for count in (41, 81, 161):
        t = np.linspace(0.0, 10.0, count)
        motion = ss.simulate(shaken(ss.Samples(t, np.sin(t), kind="cubic")))
        assert motion.certificate.ok
        off.append(abs(motion.at(10.0)["x"] - formula.at(10.0)["x"]))
    orders = np.log2(np.array(off[:-1]) / off[1:])
    assert np.all(orders > 3.5), (off, orders)


@pytest.mark.parametrize("count", [5, 6])
def test_a_period_of_samples_is_a_wave(count: int) -> None:
    """A triangle of samples is the triangle of the formula: motion, cycle and map."""
    period = 4.0
    t = np.array([0.0, 1.0, 3.0, period]) if count == 5 else np.array([0.0, 1.0, 2.0, 3.0, period])
    values = np.interp(t, [0.0, 1.0, 3.0, 4.0], [0.0, 1.0, -1.0, 0.0])
    samples = ss.Samples(t, values, periodic=True)
    drives = {"f": samples, "g": "triangle(pi*t/2)"}
    cycles = []
    for name in drives:
        system = ss.System(
            name="forced",
            drives={name: drives[name]},
            coordinates={"x": ss.Inertial(force=f"2*{name}")},
            kinetic="d_x**2/2",
            potential="2*x**2",
            viscous="0.1*d_x**2",
            contacts={"ground": ss.Contact("d_x", 0.4)},
            span=(0.0, 40.0),
        )
        motion = ss.simulate(system, initial={"x": 0.3})
        assert motion.certificate.ok
        cycle = ss.find_cycle(system)
        assert cycle.certificate.ok and cycle.period == pytest.approx(period, rel=1e-12)
        cycles.append(
            (motion.at(37.7)["x"], *cycle.extrema["x"], *np.sort(np.abs(cycle.multipliers)))
        )
    np.testing.assert_allclose(cycles[0], cycles[1], atol=1e-10)


def test_thresholds_and_belts_take_them() -> None:
    """A shaken normal force, and a belt that is measured."""
    t = np.linspace(0.0, 20.0, 201)
    system = ss.System(
        name="belt",
        drives={
            "N": ss.Samples(t, 1.0 + 0.4 * np.sin(3.0 * t), kind="cubic"),
            "w": ss.Samples(t, 0.3 + 0.2 * np.cos(t)),
        },
        coordinates={"x": ss.Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2",
        contacts={"belt": ss.Contact("d_x", "0.5*N", surface_speed="w")},
        span=(0.0, 20.0),
    )
    motion = ss.simulate(system)
    assert motion.certificate.ok and motion.outcome.ok
    stuck = motion.at(5.0)
    assert stuck["mode_belt"] != 0 or stuck["d_x"] == pytest.approx(0.3 + 0.2 * np.cos(5.0))


def test_a_threshold_may_not_become_negative() -> None:
    """Samples are bounded exactly, not by their neighbours."""
    t = np.linspace(0.0, 10.0, 101)
    for low, fine in ((0.0, True), (-0.01, False)):
        samples = ss.Samples(t, np.where(t == 5.0, low, 1.0))

        def declare(samples: ss.Samples = samples) -> ss.System:
            return ss.System(
                name="pressed",
                drives={"N": samples},
                coordinates={"x": ss.Inertial(force="1")},
                kinetic="d_x**2/2",
                contacts={"ground": ss.Contact("d_x", "N")},
                span=(0.0, 10.0),
            )

        if fine:
            assert ss.simulate(declare()).certificate.ok
        else:
            with pytest.raises(ss.DeclarationError, match="negative"):
                declare()


def test_stored_with_the_result(tmp_path: Path) -> None:
    """A file is checked without anything beside it."""
    t = np.linspace(0.0, 5.0, 301)
    motion = ss.simulate(shaken(ss.Samples(t, np.sin(7.0 * t), kind="cubic")))
    motion.save(tmp_path / "motion.nc")
    again = ss.open(tmp_path / "motion.nc")
    assert again.certificate == motion.certificate and again.system == motion.system


def test_plays_and_evolutions_take_them() -> None:
    """As a table, and as what a formula says in between."""
    t = np.linspace(0.0, 10.0, 101)
    y = 2.0 * np.sin(t)
    places = np.array([3.21, 9.87])
    table = ss.play((t, y), 0.5, t_span=(0.0, 10.0), initial=0.0)
    smooth = ss.play("2*sin(t)", 0.5, t_span=(0, 10), initial=0.0)
    for samples, expected, off in (
        (ss.Samples(t, y), table, 1e-12),
        (ss.Samples(t, y, "cubic"), smooth, 1e-5),
    ):
        found = ss.play(samples, 0.5, t_span=(0.0, 10.0), initial=0.0)
        assert found.certificate.ok
        np.testing.assert_allclose(found.at(places)["z"], expected.at(places)["z"], atol=off)
    wave = ss.Samples([0.0, 1.0, 3.0, 4.0], [0.0, 1.0, -1.0, 0.0], periodic=True)
    held = ss.play(wave, 0.5, t_span=(0.0, 20.0), initial=0.0)
    assert held.certificate.ok and held.at(17.0)["z"] == pytest.approx(0.5)
    both = ss.Evolution(
        A=np.eye(2),
        load=[ss.Samples(t, y), "sin(t)"],
        dissipation=ss.WeightedL1([0.5, 0.2]),
        initial=[0.0, 0.0],
    )
    history = ss.evolve(both, (0.0, 10.0))
    assert history.certificate.ok
