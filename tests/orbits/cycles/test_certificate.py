"""What a cycle has to prove: every residual is small on cycles that are known, and large where
something is wrong."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from orbits.examples import HALF_TURN, SLIDER, jenkins, planar
from stickslip import Trajectory, catalogue, simulate
from stickslip.certificates import Certificate, Residual, worst
from stickslip.motion import certify as certify_motion
from stickslip.orbits.cycles.certificate import certify_cycle
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.orbits.cycles.finding import from_cycle
from stickslip.orbits.cycles.period import shorter, shortest
from stickslip.orbits.fields.mode_field import Pieces
from stickslip.orbits.return_map.damped_newton import Closed, converge, near
from stickslip.orbits.return_map.recurrence import Recurrence, window
from systems import oscillator

CYCLES = {
    "slider": (SLIDER, None, {"V": 0.1}),
    "belt": (catalogue.belt_block(), None, {}),
    "toy": (catalogue.rocking_toy(), None, {}),
    "crawler": (catalogue.two_leg_crawler(), None, {}),
    "doubled": (planar(), None, HALF_TURN),
    "strongly unstable": (planar(), {"x": 1.0, "y": 0.0}, {"a": -1.0, "b": 1.0, "q": 1.0}),
    "damper that slips": (jenkins(), None, {"omega": 1.2}),
    "damper that sticks": (jenkins(), None, {"omega": 0.7}),
    "three together": (
        catalogue.block_chain(),
        {"x_1": 0.578, "x_2": 0.628, "x_3": 0.578, "d_x_1": 0.1, "d_x_2": 0.1, "d_x_3": 0.1},
        {},
    ),
}


@pytest.mark.parametrize("name", CYCLES)
def test_cycles_are_certified(name: str) -> None:
    system, start, values = CYCLES[name]
    found = find_cycle(system, start, parameters=values).certificate
    assert found.ok, found.describe()
    assert found.verdict == f"certified: all {len(found.residuals)} residuals within their limits"
    names = [residual.name for residual in found.residuals]
    assert names[:4] == list(certify_motion.NAMES)
    assert names[4:6] == ["closure", "movement"]
    assert names[-3:] == ["multipliers 1", "multipliers 0", "neighbours"]
    assert found["neighbours"].value < 1e-5
    assert found["closure"].value < 1e-11


def bad(certificate: Certificate) -> list[str]:
    return [residual.name for residual in certificate.residuals if not residual.ok]


def slider() -> Cycle:
    return find_cycle(SLIDER, parameters={"V": 0.1})


def test_a_motion_that_does_not_close() -> None:
    closed = slider().closed
    x = closed.orbit.x.copy()
    x[closed.shooting.time] *= 1.0 + 1e-6
    assert "closure" in bad(certify_cycle(Closed(closed.shooting, closed.shooting.orbit(x))))


def test_rest_is_no_cycle() -> None:
    """The oscillator at rest closes after any time; nothing moves."""
    problem = find_cycle(
        oscillator(), None, parameters={"mu": 0.0, "c": 0.2, "k": 1.7, "omega": 1.3}
    ).closed.orbit.problem
    still = replace(problem, parameters={**problem.parameters, "F": 0.0})
    rest = simulate(oscillator(), (0.0, 4.0), initial={}, parameters=still.parameters)
    motion = Trajectory(still, (0.0, 4.0), rest.knots, rest.outcome)
    pieces = Pieces(still.compiled.equations)
    found = Recurrence(0.0, np.zeros(2), 4.0, 1, np.zeros(2), 0.0)
    shooting, x = near(still, pieces, window(motion, pieces), found)
    assert "movement" in bad(certify_cycle(Closed(shooting, shooting.orbit(x))))


def several_rounds(cycle: Cycle, rounds: int) -> Closed:
    """The cycle run through again and again, as Newton's method may find it."""
    orbit = cycle.closed.orbit
    pieces = Pieces(cycle.closed.orbit.problem.compiled.equations)
    setting = cycle.closed.shooting.setting
    found = Recurrence(
        cycle.time,
        orbit.legs[0].place.state,
        rounds * orbit.period,
        rounds * setting.turns,
        rounds * orbit.shift,
        0.0,
    )
    return converge(*near(orbit.problem, pieces, window(orbit.motion, pieces), found))


@pytest.mark.parametrize(
    "name", ["slider", "belt", "toy", "crawler", "doubled", "damper that slips"]
)
@pytest.mark.parametrize("rounds", [2, 3, 6])
def test_several_rounds_are_not_a_period(name: str, rounds: int) -> None:
    system, start, values = CYCLES[name]
    cycle = find_cycle(system, start, parameters=values)
    longer = several_rounds(cycle, rounds)
    assert longer.orbit.period == pytest.approx(rounds * cycle.period, rel=1e-12)
    assert bad(certify_cycle(longer)) == ["shorter period"]
    assert shortest(longer).orbit.period == pytest.approx(cycle.period, rel=1e-12)


@pytest.mark.parametrize("a", [1e-2, 1e-4, 1e-6])
def test_a_period_that_has_just_doubled(a: float) -> None:
    """Two rounds about a circle that differ by 2√a from each other are one period, between them is
    an unstable one."""
    values = {"A": 1.0, "a": a, "b": 0.2}
    double = find_cycle(planar(), {"x": 1.0 + math.sqrt(a), "y": 0.0}, parameters=values)
    assert double.period == pytest.approx(4 * math.pi, rel=1e-14)
    assert double.certificate.ok, double.certificate.describe()
    assert double.stable
    (miss,) = shorter(double.closed).values()
    assert miss == pytest.approx(2 * math.sqrt(a), rel=0.5)
    single = find_cycle(planar(), {"x": 1.0, "y": 0.0}, parameters=values)
    assert single.period == pytest.approx(2 * math.pi, rel=1e-14)
    assert not single.stable
    assert single.certificate.ok, single.certificate.describe()


@pytest.mark.parametrize("wrong", ["multipliers 1", "multipliers 0", "neighbours"])
def test_wrong_derivatives(wrong: str) -> None:
    """Derivatives that do not belong to the motion are seen: along the motion, in stick, and beside
    it."""
    closed = find_cycle(catalogue.belt_block()).closed
    (leg,) = closed.orbit.legs
    after = leg.change.after.copy()
    stuck = (
        next(i for i, piece in enumerate(leg.change.pieces) if piece.bound)
        if wrong == "multipliers 0"
        else -1
    )
    if wrong == "multipliers 0":
        after[stuck, 1] += 1e-6
    else:
        after[-1] *= 1.001
    changed = replace(leg)
    vars(changed)["change"] = replace(leg.change, after=after)
    orbit = replace(closed.orbit, legs=[changed])
    assert wrong in bad(certify_cycle(Closed(closed.shooting, orbit)))


def test_minimal_period_from_any_start() -> None:
    """Another cycle, and a motion with a lightly damped transient, lead to one period of the
    drive."""
    cycle = find_cycle(jenkins(), parameters={"omega": 0.72})
    three = several_rounds(cycle, 3)
    again = from_cycle(three, {"omega": 0.721})
    assert again.orbit.period == pytest.approx(2 * math.pi / 0.721, rel=1e-14)


def test_residuals() -> None:
    good = Residual("a", 1e-12, 1e-9)
    low = Residual("b", 0.1, 0.2, least=True)
    none = Residual("c", math.nan, 1.0)
    assert (good.ok, low.ok, none.ok) == (True, False, False)
    certificate = Certificate((good, low, none))
    assert certificate.verdict == "not certified: b 1.00e-01 below 2e-01; c nan above 1e+00"
    assert [row["ok"] for row in certificate.to_dict()["residuals"]] == [True, False, False]
    other = Certificate((Residual("a", 1e-3, 1e-9), Residual("b", 0.3, 0.2, least=True)))
    found = worst([certificate, other])
    assert [residual.value for residual in found.residuals[:2]] == [1e-3, 0.1]
    assert math.isnan(found["c"].value)
