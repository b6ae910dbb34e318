"""A few dozen random cycles against the reference. The long run is ``python -m tests.adversarial
--only cycles``."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from math import pi, sqrt
from typing import Any

import numpy as np
import pytest

from adversarial.families.repeating import FAMILIES, Repeating
from adversarial.families.single import by_hand
from adversarial.kinds import cycles
from adversarial.references.settling import Settled, settle
from adversarial.verdict import AGREED, NO_REFERENCE, REFUSED, WRONG
from oracles import belt_block
from stickslip import Cycle, find_cycle, simulate

CHOSEN = {
    "falling with speed": (0, 1),
    "static above kinetic": (0, 2),
    "complex multipliers": (0,),
    "slider with a state": (0,),
    "toy that may walk": (0,),
    "damper that may slip": (0,),
    "damper that sticks": (0,),
    "damper on a hard spring": (0,),
    "driven on dry ground": (0, 9),
    "driven with static above kinetic": (0,),
    "driven on a hard spring": (0,),
    "driven dashpot": (0,),
    "driven by short pulses": (0,),
    "crawling legs": (0,),
}


@pytest.mark.parametrize(("family", "seed"), [(f, s) for f, seeds in CHOSEN.items() for s in seeds])
def test_cycle(monkeypatch: pytest.MonkeyPatch, family: str, seed: int) -> None:
    """The long run waits longer until motions have settled; here most are compared over one period
    only."""
    monkeypatch.setattr(cycles, "SETTLING", 0.3)
    case = cycles.draw(family, seed)
    verdict = cycles.judge(case)
    assert verdict.kind == AGREED, f"{verdict}\n{cycles.reproduction(case)}"


@pytest.mark.parametrize(
    ("family", "seed"), [("slider with a state", 3), ("slider with a state", 7)]
)
def test_rest(family: str, seed: int) -> None:
    verdict = cycles.judge(cycles.draw(family, seed))
    assert (verdict.kind, verdict.note) == (AGREED, "said to rest")


def test_a_cycle_that_is_settled_on() -> None:
    """From the start, without knowing where it leads, brute force comes to the library's cycle."""
    verdict = cycles.judge(cycles.draw("static above kinetic", 2))
    assert verdict.kind == AGREED
    assert verdict.numbers["settled"] > 100.0


def test_a_motion_does_not_settle_on_a_cycle_that_repels() -> None:
    """The belt carries the blocks to an unstable cycle of twice the period; brute force settles on
    another."""
    case = cycles.draw("two blocks on a belt", 2010)
    cycle = find_cycle(case.system, case.initial, parameters=case.parameters)
    assert cycle.stable
    assert cycle.period == pytest.approx(13.4338434867, rel=1e-9)


# -- brute force -----------------------------------------------------------------------------------


def test_settles_on_the_cycle_of_a_belt() -> None:
    """Stick-slip between two constants has a period in closed form."""
    m = by_hand(
        "inertial",
        {"m": 1.0, "k": 1.0, "mu": 1.0},
        lambda t: 0.0,
        kinetic=lambda u: 0.6,
        belt=lambda t: 0.3 + 0 * t,
    )
    case = replace(
        cycles.draw("static above kinetic", 0),
        mechanics=m,
        initial={"x": 0.2, "d_x": 0.1},
        duration=8.0,
    )
    found = settle(case, 30.0)
    assert found is not None
    assert found.period == pytest.approx(belt_block.period(1.0, 1.0, 0.3, 1.0, 0.6), rel=1e-9)
    assert (found.low[0], found.high[0]) == pytest.approx((0.1, 1.1), abs=1e-6)


@pytest.mark.parametrize("omega", [0.7, 1.3])
def test_settles_on_one_period_of_a_load(omega: float) -> None:
    """Light damping leaves complex multipliers: later returns come closer than the first, for a
    while."""
    m = by_hand("inertial", {"m": 1.0, "k": 1.0, "c": 0.1, "mu": 0.0}, lambda t: np.cos(omega * t))
    case = replace(
        cycles.draw("driven on dry ground", 0),
        mechanics=m,
        initial={"x": 2.0},
        duration=2 * pi / omega,
    )
    found = settle(case, 60.0)
    assert found is not None
    assert found.period == pytest.approx(2 * pi / omega, rel=1e-12)
    assert found.high[0] == pytest.approx(
        1.0 / sqrt((1 - omega**2) ** 2 + (0.1 * omega) ** 2), rel=1e-4
    )


def test_settles_at_rest() -> None:
    m = by_hand("inertial", {"m": 1.0, "k": 1.0, "c": 0.1, "mu": 0.4}, lambda t: 0.1 * np.cos(t))
    case = replace(
        cycles.draw("driven on dry ground", 0), mechanics=m, initial={"x": 2.0}, duration=2 * pi
    )
    found = settle(case, 60.0)
    assert found is not None
    assert found.period == 0.0


def test_time_runs_out() -> None:
    assert settle(cycles.draw("toy that may walk", 0), 0.05) is None


# -- the judge -------------------------------------------------------------------------------------

BELT = ("static above kinetic", 0)


def changed(case: Repeating, **changes: float) -> Repeating:
    """The same case with some of the library's parameters multiplied."""
    return replace(
        case, parameters={n: v * changes.get(n, 1.0) for n, v in case.parameters.items()}
    )


def test_a_cycle_of_another_system_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = cycles.draw(*BELT)
    found = cycles.cycle_of
    monkeypatch.setattr(cycles, "cycle_of", lambda c: found(changed(c, F_k=1 + 1e-6)))
    verdict = cycles.judge(case)
    assert verdict.kind == WRONG
    assert verdict.note.startswith("no motion: ")


def shown(cycle: Cycle, **changes: Any) -> Cycle:
    """A cycle that says something else of itself."""
    other = copy(cycle)
    vars(other).update(changes)
    return other


def test_what_is_said_wrongly_of_a_cycle() -> None:
    case = cycles.draw(*BELT)
    cycle = cycles.cycle_of(case)
    assert isinstance(cycle, Cycle)
    own = cycles.of_cycle(case, cycle)
    for check in (cycles.around, cycles.attracts, cycles.settles):
        assert check(case, own, cycle)[0] == ""
    assert (
        cycles.around(case, own, shown(cycle, period=0.9 * cycle.period))[0] == "it does not close"
    )
    span = (cycle.time, cycle.time + 2 * cycle.period)
    twice = shown(
        cycle,
        period=2 * cycle.period,
        trajectory=simulate(case.system, span, initial=cycle.state, parameters=case.parameters),
    )
    assert cycles.around(case, own, twice)[0] == "it runs around several times"
    faster = replace(case, mechanics=cycles.draw(BELT[0], 2).mechanics)
    assert cycles.settles(faster, own, cycle)[0] == "the motion settles on another cycle"
    repelling = shown(cycle, nontrivial=np.array([30.0]))
    assert cycles.attracts(case, own, repelling)[0] == "called unstable, neighbours are attracted"


@pytest.mark.parametrize(
    ("said", "verdict"),
    [
        ("the motion comes to rest: from t = 100 it stays near x = 0", WRONG),
        (
            "no cycle was found within t = 12700: …; the motion appears chaotic: its largest …",
            WRONG,
        ),
        ("Newton's method did not converge", REFUSED),
    ],
)
def test_what_is_said_instead_of_a_cycle(
    monkeypatch: pytest.MonkeyPatch, said: str, verdict: str
) -> None:
    monkeypatch.setattr(cycles, "cycle_of", lambda case: f"a cycle of something: {said}")
    monkeypatch.setattr(
        cycles, "settle", lambda case, *given: Settled(5.0, np.zeros(2), np.ones(2), 100.0)
    )
    assert cycles.judge(cycles.draw(*BELT)).kind == verdict


def test_rest_is_agreed_on_or_left_open(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        cycles, "cycle_of", lambda case: "a cycle of something: the motion comes to rest: at 0"
    )
    for found, verdict in (
        (None, NO_REFERENCE),
        (Settled(0.0, np.zeros(2), np.zeros(2), 1.0), AGREED),
    ):
        monkeypatch.setattr(cycles, "settle", lambda case, *given, found=found: found)
        assert cycles.judge(cycles.draw(*BELT)).kind == verdict


def test_families() -> None:
    assert len(FAMILIES) >= 15
    for family in FAMILIES:
        one, same, other = (cycles.draw(family, seed) for seed in (3, 3, 4))
        assert (one.parameters, one.initial, one.duration) == (
            same.parameters,
            same.initial,
            same.duration,
        )
        assert (one.parameters, one.initial) != (other.parameters, other.initial)
        assert "ss.find_cycle(system, {" in cycles.reproduction(one)
        assert FAMILIES[family].__doc__
