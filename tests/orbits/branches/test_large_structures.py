"""Branches of structures with many modes: what they keep, and how far neighbours are apart."""

from __future__ import annotations

import gc
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from bodies import chain
from stickslip.motion.problem import Problem
from stickslip.orbits.branches.cycles_along import APART, Spacing

LARGE = 60


@cache
def branch() -> ss.Branch:
    """A chain of many masses with two dampers, beside its first resonance."""
    mass, stiffness = chain(LARGE)
    body = ss.Structure(mass, stiffness, 0.02 * stiffness, names={"tip": LARGE - 1})
    system = ss.System(
        "chain",
        parameters={
            "omega": ss.Parameter(0.01),
            "F": ss.Parameter(0.05),
            "F_c": ss.Parameter(0.02),
        },
        structures={"u": body},
        forces={"u[tip]": "F*cos(omega*t)"},
        contacts={
            f"damper {at}": ss.laws.jenkins(f"d_u[{at}]", F_c="F_c", k=0.5)
            for at in (LARGE // 3, 2 * LARGE // 3)
        },
        span=(0.0, 1000.0),
    )
    first = float(body.frequencies[0])
    cycle = ss.find_cycle(system, parameters={"omega": 0.9 * first})
    return ss.continue_cycle(cycle, "omega", (0.9 * first, 0.904 * first))


def test_a_branch_keeps_no_large_arrays() -> None:
    """A variation takes megabytes, and so do closed forms; hundreds of cycles cannot keep them."""
    cycles = branch().cycles
    assert len(cycles) > 5
    assert branch().certificate.ok
    for cycle in cycles[1:]:
        assert not any("change" in vars(leg) for leg in cycle.closed.orbit.legs)
    gc.collect()
    machine = cycles[0].closed.orbit.problem.compiled
    problems = [x for x in gc.get_objects() if isinstance(x, Problem) and x.compiled is machine]
    with_forms = [problem for problem in problems if "closed_forms" in vars(problem)]
    assert len(problems) > 20
    reserved = sum(sum(part.nbytes for part in problem.closed_forms) for problem in with_forms)
    assert reserved < 2**31  # of which a tenth is used
    assert len(with_forms) <= 16


def test_what_was_dropped_is_computed_again() -> None:
    closed = branch().cycles[-1].closed
    (leg,) = closed.orbit.legs
    again = leg.change.matrix
    assert "change" in vars(leg)
    leg.trim()
    assert "change" not in vars(leg)
    assert np.array_equal(leg.change.matrix, again)
    states = leg.motion.states_at(np.array([0.5]) * leg.motion.knots.time[-1], np.array([0]))
    assert np.all(np.isfinite(states))


def test_neighbours_of_structures_are_measured_by_their_largest_mode() -> None:
    """Extremes of fast modes are those of samples: they differ by several per cent from sample to
    sample, also if the modes hardly move."""
    cycle = branch().cycles[-1]
    count = LARGE - 1
    last = np.zeros((len(cycle.ranges), 2))
    last[:, 1] = np.abs(cycle.ranges).max(axis=1)
    spacing = Spacing({}, last[:, 1])
    assert last[count, 1] < 1e-3 * last[:LARGE, 1].max()
    other = last.copy()
    other[count, 1] *= 1.0 + 2.0 * APART
    assert spacing(_with_ranges(cycle, last), _with_ranges(cycle, other)) < 1e-2 * APART
    other = last.copy()
    other[0, 1] *= 1.0 + 2.0 * APART
    assert spacing(_with_ranges(cycle, last), _with_ranges(cycle, other)) > APART


def _with_ranges(cycle: ss.Cycle, ranges: Any) -> ss.Cycle:
    """A cycle with other ranges."""
    other = replace(cycle)
    vars(other)["ranges"] = ranges
    return other


@pytest.mark.parametrize("name", ["u_mode_1", "r_damper_20", "r_damper_40"])
def test_extremes_of_one_component(name: str) -> None:
    """Sliders of dampers move in one direction between knots, so that no step is searched."""
    cycle = branch().cycles[-1]
    exact = cycle.trajectory.audit.sums
    place = cycle.system.declaration.state.index(name)
    expected = exact.low[place], exact.high[place]
    assert cycle.extrema_of(name) == pytest.approx(expected, rel=1e-9)


def test_extremes_of_an_unknown() -> None:
    cycle = branch().cycles[-1]
    times = float(cycle.trajectory.knots.time[0]) + np.linspace(0.0, cycle.period, 20_001)
    seen = np.asarray(cycle.trajectory.at(times)["u[tip]"])
    low, high = cycle.extrema_of("u[tip]")
    assert (low, high) == pytest.approx((seen.min(), seen.max()), rel=1e-6)
    assert low <= seen.min()
    assert high >= seen.max()
