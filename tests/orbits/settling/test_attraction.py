"""Motions that are carried on to their cycles end where waiting ends.

With more points of each system: ``PYTHONPATH=tests python tests/orbits/settling/test_attraction.py
300``.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from stickslip import Contact, Inertial, System, catalogue
from stickslip.arrays import Array
from stickslip.motion.outcome import Outcome
from stickslip.motion.simulate_many import initial_states, parameter_table, pose_all
from stickslip.orbits.settling.engine.returns import converges_to_zero, fit_recurrence
from stickslip.orbits.settling.engine.tables import COUNT, DURATION
from stickslip.orbits.settling.motions import Block, Here, Settings
from sweeps.test_basin import jenkins
from systems import parameters


def duffing() -> System:
    """An oscillator with a hardening spring and dry friction: two attractors near resonance."""
    return System(
        name="duffing",
        parameters=parameters(F=0.6, omega=1.5, c=0.02, mu=0.05),
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2 + x**4/4 - F*cos(omega*t)*x",
        viscous="c/2*d_x**2",
        contacts={"ground": Contact("d_x", "mu")},
        span=(0, 40),
    )


def cases(points: int) -> dict[str, tuple[System, dict[str, Array], dict[str, Array]]]:
    """Systems with random starts and parameters."""
    rng = np.random.default_rng(20261123)

    def u(low: float, high: float) -> Array:
        return rng.uniform(low, high, points)

    push = {"psi": np.zeros(points), "d_psi": np.full(points, 1.8), "x_R": np.zeros(points)}
    toy = catalogue.rocking_toy()
    return {
        "toy": (toy, push, {"P": u(0.8, 1.6), "delta": u(0.01, 0.2)}),
        "toy, lightly damped": (toy, push, {"P": u(0.8, 1.6), "delta": u(3e-4, 0.012)}),
        "scaled slider": (
            catalogue.scaled_slider_limit(),
            {},
            {"b": u(0.3, 1.2), "nu": 10.0 ** u(-3.0, -2.0)},
        ),
        "slider": (catalogue.spring_slider(), {}, {"V": u(0.1, 0.3)}),
        "forced": (catalogue.forced_oscillator(), {}, {"omega": u(0.3, 2.0)}),
        "jenkins": (
            jenkins(),
            {},
            {"omega": u(0.6, 1.4), "c": 10.0 ** u(-3.0, -1.0), "F": u(0.3, 4.0)},
        ),
        "duffing": (duffing(), {"x": u(-2, 2), "d_x": u(-2, 2)}, {"omega": u(1.3, 1.9)}),
    }


def measured(
    system: System, start: dict[str, Array], given: dict[str, Array], leaps: bool
) -> tuple[Block, Array]:
    """Motions that have settled, by waiting or also by leaps, and the least and largest values of
    their components."""
    points = len(next(iter(given.values())))
    settings = Settings()
    problem = pose_all(system, given, settings.rtol, settings.atol)
    table = parameter_table(system, given, points)
    states = initial_states(system, start, points)
    block = Block(replace(problem, origin=system.span[0]), table, states, settings, True)
    block.rules = block.rules._replace(leaping=leaps)
    found = block.run(Here, False)
    shifted = np.any(block.rules.shifts != 0.0, axis=0)
    # of what is translated, how far it comes
    low = np.where(shifted, 0.0, found.sums.low)
    high = np.where(shifted, found.found.shift, found.sums.high)
    return block, np.hstack([low, high])


def check(points: int) -> None:
    """Leaps end on the cycles on which waiting ends, and save returns where these are many."""
    for name, (system, start, given) in cases(points).items():
        leapt, there = measured(system, start, given, True)
        waited, here = measured(system, start, given, False)
        same = leapt.marks.outcome == waited.marks.outcome
        # what waiting has no time for is no contradiction
        late = waited.marks.outcome == Outcome.NOT_SETTLED.code
        assert np.all(same | late), (name, np.flatnonzero(~(same | late)))
        cycles = same & (leapt.marks.outcome == Outcome.PERIODIC.code)
        assert np.sum(cycles) > points // 4, name
        size = np.max(np.abs(here), axis=1, keepdims=True)
        apart = np.max(np.abs(there - here) / size, axis=1)[cycles]
        assert np.max(apart) < 1e-6, (name, np.flatnonzero(cycles)[np.argmax(apart)])
        period = leapt.marks.real[cycles, DURATION] / waited.marks.real[cycles, DURATION]
        np.testing.assert_allclose(period, 1.0, rtol=1e-7, err_msg=name)
        if name in ("toy, lightly damped", "jenkins", "duffing"):  # hundreds of returns
            marks = np.mean(leapt.marks.numbers[cycles, COUNT])
            assert marks < 0.5 * np.mean(waited.marks.numbers[cycles, COUNT]), name


def test_leaps_end_where_waiting_ends() -> None:
    """210 random points of seven systems."""
    check(30)


def test_a_lightly_damped_oscillator_takes_few_returns() -> None:
    """Multipliers of 0.999: thousands of returns by waiting."""
    given = {"c": np.full(3, 1e-3), "omega": np.array([0.93, 0.99, 1.07])}
    leapt, _ = measured(jenkins(), {}, given, True)
    assert np.all(leapt.marks.outcome == Outcome.PERIODIC.code)
    assert np.max(leapt.marks.numbers[:, COUNT]) < 300


def test_recurrences_that_die_away() -> None:
    """The criterion of Schur and Cohn against the roots, and the fit against the recurrence."""
    rng = np.random.default_rng(5)
    for k in (1, 2, 3):
        for _ in range(200):
            fit = np.zeros((4, 4))
            fit[:k, 3] = rng.normal(size=k)
            roots = np.roots([1.0, *(-fit[:k, 3])])
            assert converges_to_zero.python(fit, k) == bool(np.all(np.abs(roots) < 1.0))
    returns = [rng.normal(size=4) for _ in range(3)]
    wanted = np.array([0.9, -0.5, 0.2])
    while len(returns) < 8:
        returns.append(wanted @ np.array(returns[:-4:-1]))
    work = np.zeros((9, 4))
    work[:8] = returns[::-1]
    fit = np.zeros((4, 4))
    fit_recurrence.python(work, 8, 3, fit)
    np.testing.assert_allclose(fit[:3, 3], wanted, rtol=1e-9)


if __name__ == "__main__":
    check(int(sys.argv[1]))
