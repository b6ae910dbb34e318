"""Laws of cycles: what does not depend on where they are entered, what symmetry says of multipliers
and drifts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbits.examples import SLIDER, damped_block, dragged, mass_on_belt
from stickslip import System, catalogue
from stickslip.motion.problem import pose
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.fields.variational import variation
from stickslip.orbits.return_map.shooting import parameter_values

# Examples are drawn anew from the test's name, the same in every run.
law = settings(max_examples=3, deadline=None, derandomize=True)
parts = st.floats(0.0, 1.0, exclude_max=True)

# A system, a start that leads to its cycle, a parameter and a range in which there is one.
Case = tuple[System, dict[str, float], str, tuple[float, float]]
AUTONOMOUS: list[Case] = [
    (SLIDER, {}, "V", (0.03, 0.22)),
    (catalogue.belt_block(), {}, "V", (0.05, 0.5)),
    (damped_block(), {}, "V", (0.05, 0.43)),
    (mass_on_belt(), {"d_x": 0.1}, "V", (0.1, 0.5)),
    (dragged(), {}, "V", (0.05, 0.5)),
    (catalogue.rocking_toy(), {"psi": -1.67, "x_R": 0.45}, "delta", (0.02, 0.06)),
    (catalogue.rocking_toy_inertial(), {}, "delta", (0.03, 0.045)),
    (catalogue.scaled_slider_limit(), {}, "b", (0.4, 1.4)),
]
DRIVEN: list[Case] = [
    (catalogue.two_leg_crawler(), {}, "D", (0.5, 3.0)),
    (catalogue.forced_oscillator(), {}, "F_c", (0.4, 0.9)),
]
GAITS = [AUTONOMOUS[4], AUTONOMOUS[5], AUTONOMOUS[6], DRIVEN[0]]


def named(case: Case) -> str:
    return case[0].name


def place(system: System, start: dict[str, float]) -> dict[str, float]:
    """The whole state of a start."""
    y = pose(system, {}).initial_state(start)
    return dict(zip(system.declaration.state, map(float, y), strict=True))


def drawn(case: Case, part: float) -> Cycle:
    """The cycle for some value of the parameter."""
    system, start, parameter, (low, high) = case
    cycle = find_cycle(system, start or None, parameters={parameter: low + part * (high - low)})
    assert cycle.trajectory.certificate.ok, cycle.trajectory.certificate.verdict
    assert cycle.residual < 1e-10
    return cycle


def same(a: Cycle, b: Cycle) -> None:
    """The same cycle, wherever it starts."""
    assert a.period == pytest.approx(b.period, rel=1e-11)
    assert a.drift == pytest.approx(b.drift, rel=1e-10, abs=1e-12)
    assert a.nontrivial == pytest.approx(b.nontrivial, rel=1e-8, abs=1e-12)
    assert a.trivial == b.trivial
    assert (a.stick_time, a.dissipated) == pytest.approx(
        (b.stick_time, b.dissipated), rel=1e-9, abs=1e-10
    )
    assert len(a.phases) == len(b.phases)


@pytest.mark.parametrize("case", AUTONOMOUS, ids=named)
@law
@given(where=parts, part=parts)
def test_any_point_leads_to_the_same_cycle(case: Case, where: float, part: float) -> None:
    cycle = drawn(case, part)
    there = cycle.trajectory.at(cycle.time + where * cycle.period)
    same(
        find_cycle(
            case[0], {name: there[name] for name in cycle.state}, parameters=cycle.parameters
        ),
        cycle,
    )


@pytest.mark.parametrize("case", AUTONOMOUS, ids=named)
@law
@given(part=parts)
def test_a_later_start_has_the_multiplier_one(case: Case, part: float) -> None:
    """One for each direction that comes back unchanged: a later start, and each translation."""
    cycle = drawn(case, part)
    symmetry = cycle.closed.shooting.symmetry
    motion = cycle.trajectory
    assert len(cycle.multipliers) == len(cycle.state)
    assert cycle.trivial == 1 + symmetry.shifts.shape[1]
    assert np.count_nonzero(np.abs(cycle.multipliers - 1.0) < 1e-8) == cycle.trivial
    # A neighbour that is a little ahead, in the frame in which time does not matter, is as far
    # ahead a period later.
    piece = cycle.closed.shooting.stations[0].piece
    ahead = (
        piece.rates(cycle.time, motion.knots.state[0], parameter_values(motion.problem))
        - symmetry.frame
    )
    later = variation(motion, Pieces(motion.problem.compiled.equations), ahead[:, None]).matrix[
        :, 0
    ]
    assert later == pytest.approx(ahead, rel=1e-8, abs=1e-8 * np.max(np.abs(ahead)))


@pytest.mark.parametrize("case", GAITS, ids=named)
@law
@given(part=parts, shift=st.floats(-1e3, 1e3))
def test_drift_does_not_depend_on_the_place(case: Case, part: float, shift: float) -> None:
    system, start, _, _ = case
    cycle = drawn(case, part)
    assert cycle.drift != 0.0
    first = {
        name: value + shift * cycle.direction.get(name, 0.0)
        for name, value in place(system, start).items()
    }
    moved = find_cycle(system, first, parameters=cycle.parameters)
    same(moved, cycle)
    assert moved.direction == cycle.direction


@pytest.mark.parametrize("case", DRIVEN, ids=named)
@law
@given(part=parts)
def test_a_driven_cycle_has_the_period_of_its_drive(case: Case, part: float) -> None:
    cycle = drawn(case, part)
    turns = cycle.period * cycle.parameters.get("omega", 1.0) / (2 * np.pi)
    assert turns == pytest.approx(round(turns), rel=1e-13)
    assert cycle.trivial == cycle.closed.shooting.symmetry.shifts.shape[1]
