"""Cycles against closed forms: stable and unstable ones, driven ones, moving frames, families,
honest failures."""

from __future__ import annotations

import math
import pickle
import re
from typing import Any

import numpy as np
import pytest

from orbits.examples import HALF_TURN, SLIDER, dragged, isola, planar
from properties.families import linear_family
from stickslip import (
    Contact,
    Inertial,
    Parameter,
    RateIndependent,
    System,
    catalogue,
    laws,
    simulate,
)
from stickslip.errors import ConvergenceError, DeclarationError
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.cycles import finding
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.fields.variational import variation
from stickslip.orbits.return_map import shooting
from stickslip.symbolic import expressions as ex
from systems import distance, oscillator


def check(cycle: Cycle) -> None:
    """What every cycle has to satisfy."""
    assert cycle.trajectory.certificate.ok, cycle.trajectory.certificate.verdict
    assert cycle.residual < 1e-9
    assert cycle.stick_time + cycle.slip_time == pytest.approx(cycle.period)
    assert sum(phase.duration for phase in cycle.phases) == pytest.approx(cycle.period)
    assert np.sum(np.abs(cycle.multipliers - 1.0) < 1e-9) >= cycle.trivial
    first, last = cycle.trajectory.knots.state[[0, -1]]
    names = list(cycle.state)
    shift = np.array([cycle.drift * cycle.direction.get(name, 0.0) for name in names])
    assert distance(last - first, shift) < 1e-9 * (1.0 + np.max(np.abs(first)))
    for i, name in enumerate(names):
        low, high = cycle.extrema[name]
        assert low - 1e-12 <= cycle.trajectory.knots.state[:, i].min()
        assert cycle.trajectory.knots.state[:, i].max() <= high + 1e-12


@pytest.mark.parametrize("a", [0.1, -0.1])
def test_stable_and_unstable(a: float) -> None:
    radius = math.sqrt(abs(a))
    cycle = find_cycle(
        planar(),
        {"x": 1.003 * radius, "y": 0.01},
        parameters={"a": a, "b": -a, "q": -math.copysign(1.0, a)},
    )
    check(cycle)
    assert cycle.period == pytest.approx(4 * math.pi, rel=1e-12)
    assert cycle.nontrivial == pytest.approx([math.exp(-8 * math.pi * a)], rel=1e-10)
    assert cycle.stable is (a > 0)
    assert cycle.trivial == 1
    assert cycle.extrema["x"] == pytest.approx((-radius, radius), rel=1e-12)
    assert cycle.extrema["y"] == pytest.approx((-radius, radius), rel=1e-12)
    assert math.hypot(*cycle.state.values()) == pytest.approx(radius, rel=1e-12)


def test_strongly_unstable() -> None:
    """r' = r(r² − 1): a neighbour is 10^10.9 times as far a period later, and gone before the
    second is over."""
    cycle = find_cycle(planar(), {"x": 1.0, "y": 0.0}, parameters={"a": -1.0, "b": 1.0, "q": 1.0})
    check(cycle)
    assert cycle.nontrivial == pytest.approx([math.exp(8 * math.pi)], rel=1e-9)
    assert len(cycle.closed.shooting.stations) > 1


def test_state_that_is_a_function_of_time() -> None:
    """The play with a load f + F cos(ωt): between two sticks x follows the load, whatever it was:
    nothing is left free.

    It slips 2(F − μ)/k forth and back in each period.
    """
    k = 1.3
    mu = 0.7
    f = -0.35
    F = 1.9
    omega = 1.6
    play = System(
        "play",
        coordinates={"x": RateIndependent()},
        potential=f"{k}/2*x**2 - ({f} + {F}*cos({omega}*t + 4.3))*x",
        contacts={"ground": Contact("d_x", f"{mu}")},
    )
    cycle = find_cycle(play, {"x": -1.276})
    check(cycle)
    assert cycle.period == pytest.approx(2 * math.pi / omega, rel=1e-12)
    assert cycle.multipliers == pytest.approx([0.0], abs=1e-12)
    assert cycle.stable
    assert cycle.extrema["x"] == pytest.approx(((f - F + mu) / k, (f + F - mu) / k), rel=1e-12)
    assert cycle.dissipated == pytest.approx(4 * mu * (F - mu) / k, rel=1e-12)


def test_near_unstable_cycles_of_friction() -> None:
    """The unstable cycle of the spring slider below its fold; a little inside the slider comes to
    rest, outside not."""
    point = continue_equilibrium(SLIDER, "V", (0.2, 0.25)).of_kind("Hopf")[0]
    cycle = find_cycle(SLIDER, point, parameters={"V": 0.2251})
    check(cycle)
    assert not cycle.stable
    assert cycle.nontrivial[0].real > 1.0
    middle = np.array([point.state["U"], point.state["alpha"]])
    state = np.array(list(cycle.state.values()))
    for factor, sticks in ((0.95, False), (1.05, True)):
        start = dict(zip(cycle.state, map(float, middle + factor * (state - middle)), strict=True))
        assert (
            simulate(SLIDER, (0, 600), initial=start, parameters={"V": 0.2251}).n_switches > 0
        ) is sticks


def test_hopf_point() -> None:
    """Small cycles have the period and the growth that the normal form says."""
    point = continue_equilibrium(SLIDER, "V", (0.2, 0.25)).of_kind("Hopf")[0]
    cycle = find_cycle(SLIDER, point)
    check(cycle)
    assert cycle.parameters["V"] > point.value
    assert abs(cycle.parameters["V"] - point.value) < 1e-3
    assert cycle.period == pytest.approx(point.period, rel=1e-2)
    with pytest.raises(ConvergenceError, match="exist above"):
        find_cycle(SLIDER, point, parameters={"V": 0.22})


def test_any_point_of_the_motion() -> None:
    """A settled motion, another cycle, and any of its states lead to the same cycle."""
    values = {"V": 0.1}
    motion = simulate(SLIDER, (0, 60), initial={"U": 1.5, "alpha": 1.2}, parameters=values)
    first = find_cycle(SLIDER, motion)
    check(first)
    rng = np.random.default_rng(1)
    for t in rng.uniform(0, first.period, 6):
        values_there = first.trajectory.at(float(t) + first.time)
        again = find_cycle(
            SLIDER, {name: values_there[name] for name in first.state}, parameters=values
        )
        assert again.period == pytest.approx(first.period, rel=1e-12)
        assert again.nontrivial == pytest.approx(first.nontrivial, rel=1e-9)
    nearby = find_cycle(
        SLIDER, find_cycle(SLIDER, first, parameters={"V": 0.12}), parameters=values
    )
    assert nearby.period == pytest.approx(first.period, rel=1e-12)
    assert nearby.stick_time == pytest.approx(first.stick_time, rel=1e-10)


def test_energy_of_a_cycle() -> None:
    cycle = find_cycle(catalogue.belt_block())
    check(cycle)
    share = cycle.contacts["belt contact"]
    # On the whole the belt does the work that friction loses: F_k against the sliding distance, V
    # times the slip time.
    assert cycle.dissipated == pytest.approx(cycle.supplied, rel=1e-11)
    assert share.dissipated == pytest.approx(cycle.dissipated, rel=1e-11)
    facts = catalogue.belt_block().declaration.facts
    slip = ex.evaluate(facts["slip_duration"], cycle.parameters)
    travelled = 0.3 * slip + 0.3 * (cycle.period - slip)
    assert share.dissipated == pytest.approx(0.6 * travelled, rel=1e-11)
    assert (share.stick_time, share.slip_time) == pytest.approx(
        (cycle.period - slip, slip), rel=1e-11
    )
    assert cycle.multipliers.tolist() == [pytest.approx(1.0), 0.0]


def test_driven() -> None:
    """A damped linear oscillator: multipliers exp((−c/2 ± iω)T)."""
    cycle = find_cycle(oscillator(), parameters={"mu": 0.0, "c": 0.2, "k": 1.7, "omega": 1.3})
    check(cycle)
    assert cycle.trivial == 0
    assert cycle.period == pytest.approx(2 * math.pi / 1.3, rel=1e-14)
    expected = np.exp((-0.1 + 1j * math.sqrt(1.7 - 0.01)) * cycle.period)
    assert sorted(cycle.multipliers, key=lambda z: z.imag) == pytest.approx(
        [expected.conj(), expected], rel=1e-10
    )
    amplitude = 1 / math.hypot(1.7 - 1.3**2, 0.2 * 1.3)
    assert cycle.extrema["x"] == pytest.approx((-amplitude, amplitude), rel=1e-11)


def test_subharmonic() -> None:
    """Past the period doubling the cycle closes after two periods of the drive only."""
    cycle = find_cycle(planar(), parameters=HALF_TURN)
    check(cycle)
    assert cycle.period == pytest.approx(4 * math.pi, rel=1e-14)
    rates = np.array([-2 * 0.15, -0.2 - 0.15])
    assert sorted(np.real(cycle.nontrivial)) == pytest.approx(
        sorted(np.exp(4 * math.pi * rates)), rel=1e-9
    )
    single = find_cycle(planar(), {"x": 1.0, "y": 0.0}, parameters=HALF_TURN)
    assert single.period == pytest.approx(2 * math.pi, rel=1e-14)
    expected = -np.exp(2 * math.pi * np.array([0.15, -0.2]))
    assert sorted(np.real(single.nontrivial)) == pytest.approx(sorted(expected), rel=1e-9)


def test_moving_frame() -> None:
    """Dragged over the ground the block repeats itself in the frame of its spring."""
    cycle = find_cycle(dragged())
    belt = find_cycle(catalogue.belt_block())
    check(cycle)
    assert cycle.period == pytest.approx(belt.period, rel=1e-12)
    assert cycle.speed == pytest.approx(0.3, rel=1e-12)
    assert cycle.dissipated == pytest.approx(belt.dissipated, rel=1e-11)
    assert cycle.energy_per_distance == pytest.approx(0.6, rel=1e-11)
    assert cycle.cost_of_transport(2.0) == pytest.approx(0.3, rel=1e-11)


def test_moving_frame_and_drive() -> None:
    """A load that moves and shakes: after a period of the shaking the system is the same, V T
    further on."""
    cycle = find_cycle(dragged(), parameters={"A": 0.5, "F_s": 0.4, "F_k": 0.4, "V": 0.1})
    check(cycle)
    turns = cycle.period / math.pi
    assert turns == pytest.approx(round(turns), rel=1e-12)
    assert cycle.speed == pytest.approx(0.1, rel=1e-12)


def test_many_periods_of_the_drive() -> None:
    """The plate compactor: seen after each period of the shaking it is nowhere near where it was
    for a long time."""
    cycle = find_cycle(catalogue.plate_compactor())
    check(cycle)
    turns = cycle.period * cycle.parameters["Omega"] / (2 * math.pi)
    assert turns == pytest.approx(round(turns), rel=1e-12)
    assert cycle.speed == pytest.approx(cycle.parameters["V"], rel=1e-12)


def test_contacts_that_stick_together() -> None:
    """The chain of blocks: where all stick at once three directions are lost, so that three
    multipliers are 0."""
    start = {"x_1": 0.578, "x_2": 0.628, "x_3": 0.578, "d_x_1": 0.1, "d_x_2": 0.1, "d_x_3": 0.1}
    cycle = find_cycle(catalogue.block_chain(), start)
    check(cycle)
    assert np.count_nonzero(cycle.multipliers == 0.0) == 3
    assert len(cycle.nontrivial) == 2
    sticking = [phase for phase in cycle.phases if phase.sticks]
    assert cycle.stick_time == pytest.approx(sum(phase.duration for phase in sticking))
    assert cycle.stick_time < min(share.stick_time for share in cycle.contacts.values()) + 1e-9


def test_falls_to_rest() -> None:
    with pytest.raises(ConvergenceError, match="comes to rest"):
        find_cycle(SLIDER, parameters={"V": 0.3})
    with pytest.raises(ConvergenceError, match="comes to rest"):
        find_cycle(catalogue.rocking_toy(), {"psi": 0.1, "x_R": 0.0})
    with pytest.raises(ConvergenceError, match="comes to rest"):
        find_cycle(SLIDER, simulate(SLIDER, (0, 300), initial={"U": 1.65}, parameters={"V": 0.3}))


def test_dies_out() -> None:
    """A pendulum with hardly any damping never returns to where it was; in the end only rounding
    moves."""
    with pytest.raises(ConvergenceError, match="comes to rest"):
        find_cycle(oscillator(), {"x": 1.0}, parameters={"mu": 0.0, "F": 0.0, "c": 0.02})


def test_newton_does_not_converge() -> None:
    """Just beyond the fold of cycles the motion nearly closes; the message says how nearly, and
    where it ends."""
    with pytest.raises(
        ConvergenceError,
        match=r"comes to rest.*did not converge; the closest motion fails to close by 0\.0",
    ):
        find_cycle(isola(), {"x": math.sqrt(2), "y": 0.0}, parameters={"a": 1.01})
    cycle = find_cycle(SLIDER, parameters={"V": 0.15})
    with pytest.raises(
        ConvergenceError, match=r"the closest motion fails to close by.*continue_cycle"
    ):
        find_cycle(SLIDER, cycle, parameters={"V": 0.3})


def test_family() -> None:
    """Without friction and damping every amplitude is a cycle: an invariant direction that is no
    translation."""
    with pytest.raises(ConvergenceError, match="form a continuous family"):
        find_cycle(oscillator(), {"x": 1.0}, parameters={"mu": 0.0, "F": 0.0})


def test_motion_that_has_not_settled_goes_on() -> None:
    """A motion too short to come back leads to the cycle that it would have settled on."""
    motion = simulate(SLIDER, (0, 4), parameters={"V": 0.1})
    cycle = find_cycle(SLIDER, motion)
    check(cycle)
    longer = find_cycle(SLIDER, simulate(SLIDER, (0, 60), parameters={"V": 0.1}))
    assert cycle.period == pytest.approx(longer.period, rel=1e-12)
    with pytest.raises(ConvergenceError, match="comes to rest"):
        find_cycle(SLIDER, simulate(SLIDER, (0, 4), parameters={"V": 0.3}))


def test_time_that_does_not_repeat() -> None:
    with pytest.raises(DeclarationError, match="not through a wave of constant frequency"):
        find_cycle(catalogue.wiggly_energy())
    with pytest.raises(DeclarationError, match="depends on time otherwise"):
        find_cycle(catalogue.oscillating_play())
    family = linear_family("inertial", 2, 1)
    with pytest.raises(DeclarationError, match="no common period"):
        find_cycle(
            family,
            {"x0": 0.1},
            parameters={"F0": 1.0, "F1": 1.0, "omega0": 1.0, "omega1": math.sqrt(2), "s0": 0.1},
        )


def test_bad_arguments() -> None:
    with pytest.raises(DeclarationError, match=re.escape("initial.speed")):
        find_cycle(SLIDER, {"speed": 1.0})
    with pytest.raises(DeclarationError, match="not a state"):
        find_cycle(SLIDER, [1.0, 2.0, 3.0])
    with pytest.raises(DeclarationError, match="W"):
        find_cycle(SLIDER, parameters={"W": 1.0})
    with pytest.raises(DeclarationError, match="a motion of belt_block"):
        find_cycle(SLIDER, simulate(catalogue.belt_block(), (0, 1)))


@pytest.mark.parametrize("omega", [0.6, 0.7, 0.8, 1.2, 1.4, 2.5])
@pytest.mark.parametrize("change", [0.95, 1.05])
def test_a_cycle_far_away_is_found_in_one_step(omega: float, change: float) -> None:
    """At another frequency the drive is at the same phase, and the cycle is extrapolated; a start
    at the same time and state is up to half a radian off, and is refused."""
    system = catalogue.jenkins_oscillator()
    parameters = {"omega": change * omega}
    moved = find_cycle(
        system, find_cycle(system, parameters={"omega": omega}), parameters=parameters
    )
    alone = find_cycle(system, parameters=parameters)
    assert abs(moved.harmonic["x"] - alone.harmonic["x"]) < 1e-10 * abs(alone.harmonic["x"])
    assert moved.multipliers == pytest.approx(alone.multipliers, abs=1e-8)


def test_a_cycle_under_a_load_and_a_drive_is_moved_along() -> None:
    """A load V*t beside a drive: the state has moved on where the drive is at the same phase."""
    system = System(
        name="pulled and shaken",
        parameters={"omega": Parameter(2.0), "V": Parameter(0.3)},
        coordinates={"x": Inertial()},
        kinetic="0.5*d_x**2",
        potential="0.5*(x - V*t - 0.2*cos(omega*t))**2",
        viscous="0.05*d_x**2",
        contacts={"ground": Contact("d_x", 0.3)},
    )
    cycle = find_cycle(system)
    for change in ({"omega": 2.15}, {"V": 0.33}, {"omega": 1.9, "V": 0.28}):
        moved = find_cycle(system, cycle, parameters=change)
        alone = find_cycle(system, parameters=change)
        check(moved)
        assert moved.dissipated == pytest.approx(alone.dissipated, rel=1e-9)
        assert moved.drift == pytest.approx(alone.drift, rel=1e-9)


@pytest.mark.parametrize("omega", [1.1, 110.0, 1e4])
def test_the_first_look_at_a_driven_system(omega: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes some periods of the drive, unless a time span is given."""
    looked: list[float] = []
    follow = finding.follow_freely

    def spy(problem: Any, begin: float, end: float, state: Any) -> Any:
        looked.append(end - begin)
        return follow(problem, begin, end, state)

    monkeypatch.setattr(finding, "follow_freely", spy)
    parts: dict[str, Any] = {
        "coordinates": {"x": Inertial(force=f"2*cos({omega!r}*t)")},
        "kinetic": f"(d_x/{omega!r})**2/2",
        "viscous": f"0.2/{omega!r}*d_x**2/2",
        "potential": "x**2",
        "contacts": {"c": Contact("d_x", 0.3)},
    }
    period = 2 * np.pi / omega
    cycle = find_cycle(System("s", **parts))
    assert cycle.certificate.ok and cycle.period == pytest.approx(period, rel=1e-12)
    assert looked[0] <= 101 * period
    looked.clear()
    find_cycle(System("s", **parts, span=(0.0, 7 * period)))
    assert looked[0] == pytest.approx(7 * period)


@pytest.mark.parametrize("part", [1e-4, 1e-7, 1e-9, 1e-10])
def test_a_damper_that_hardly_slips(part: float) -> None:
    """Just beyond the onset the slider moves by a part of 1e-9 of the mass, which is no symmetry:
    a cycle is found that slips for a time that goes with the root of what is beyond."""
    onset = 0.5 * abs(2.0 - 1.2**2 + 0.12j)
    system = System(
        "hardly",
        parameters={"P": onset * (1.0 + part)},
        coordinates={"x": Inertial(force="P*cos(1.2*t)"), "z": RateIndependent()},
        kinetic="d_x**2/2",
        potential="x**2/2 + (x - z)**2/2",
        viscous="0.05*d_x**2",
        contacts={"damper": Contact("d_z", 0.5)},
        span=(0.0, 100.0),
    )
    cycle = find_cycle(system)
    assert cycle.certificate.ok and cycle.stable
    assert cycle.period == pytest.approx(2.0 * np.pi / 1.2, rel=1e-12)
    # z follows x near its extremes, a cosine, from where it is 2·part of its amplitude below
    slipping = 2.0 * np.sqrt(4.0 * part) / 1.2
    assert cycle.contacts["damper"].slip_time == pytest.approx(slipping, rel=0.5)


def test_phases_without_a_contact_that_sticks() -> None:
    """The contact of a law with internal variables neither sticks nor slips: phases are those of
    its formulas, here two halves of a period."""
    block = System(
        "block",
        coordinates={"x": Inertial()},
        kinetic="d_x**2/2",
        potential="x**2/2 - x*cos(2*t)",
        viscous="0.1*d_x**2",
        contacts={"guide": laws.lugre("d_x", sigma_0=10.0, sigma_1=0.1, F_s=0.3, F_c=0.2, v_s=0.1)},
    )
    cycle = find_cycle(block)
    check(cycle)
    assert [phase.modes for phase in cycle.phases] == [{}, {}]
    assert [p.duration for p in cycle.phases] == pytest.approx([math.pi / 2] * 2, rel=1e-9)
    assert cycle.summary().good


def test_few_derivatives_are_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cycle from its neighbour: a derivative for the prediction, one for each set of stations,
    and one for its multipliers; trial steps have none."""
    system = catalogue.jenkins_oscillator()
    cycle = find_cycle(system)
    made = list[float]()

    def counted(motion: Any, *given: Any, **named: Any) -> Any:
        made.append(motion.t_span[0])
        return variation(motion, *given, **named)

    monkeypatch.setattr(shooting, "variation", counted)
    again = find_cycle(system, cycle, parameters={"omega": 1.001 * system.values["omega"]})
    assert again.stable
    assert len(made) <= 5


def test_a_cycle_that_is_followed_keeps_its_station() -> None:
    """Both halves of the cycle have equally good stations; the one that is there remains."""
    cycle = find_cycle(catalogue.jenkins_oscillator())
    place = cycle.closed.shooting.start / cycle.period
    for _ in range(4):
        cycle = find_cycle(
            cycle.system, cycle, parameters={"omega": 1.01 * cycle.parameters["omega"]}
        )
        assert cycle.closed.shooting.start / cycle.period == pytest.approx(place, abs=0.05)
        check(cycle)


def test_the_station_is_in_the_mode_of_the_cycle() -> None:
    """The motion from which the cycle is found sticks where the cycle slips."""
    legs = {name: Contact(f"d_{name}", threshold=(0.0923, 0.2861)) for name in ("x", "y")}
    system = System(
        "crawler",
        parameters={"omega": Parameter(1.17)},
        coordinates={"x": RateIndependent(), "y": RateIndependent()},
        potential="0.96*(y - x - 1.49*sin(omega*t))**2",
        contacts=legs,
    )
    cycle = find_cycle(system)
    assert cycle.certificate.ok, cycle.certificate.verdict
    knots = cycle.trajectory.knots
    piece = cycle.closed.shooting.stations[0].piece
    assert piece.field.mode == tuple(knots.mode[0].tolist())


def test_a_stored_cycle_is_followed() -> None:
    """Its motion is computed again, and may begin elsewhere."""
    system = catalogue.jenkins_oscillator()
    branch = continue_cycle(find_cycle(system, parameters={"omega": 1.2}), "omega", (1.2, 1.32))
    for cycle in branch.cycles[::3]:
        step = {"omega": 1.0001 * cycle.parameters["omega"]}
        there = find_cycle(system, cycle, parameters=step)
        again = find_cycle(system, pickle.loads(pickle.dumps(cycle)), parameters=step)
        assert again.extrema["x"] == pytest.approx(there.extrema["x"], rel=1e-9)
        assert again.certificate.ok
