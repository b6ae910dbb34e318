"""Cycles of the spring slider with μ̃ = 2/√α, ν = 0.05 against 30 digits, stable and unstable, with
and without stick.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), (3.3). The digits are those of `oracles/spring_slider.py` with 90 of them
carried.
"""

from __future__ import annotations

import pytest

from oracles import spring_slider
from orbits.examples import SLIDER
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle

STICKING = {
    0.02: (
        "21.8170197631315246929990914424",
        "21.244290223312862767454397008",
        "2.1908101879406323723384970771e-8",
    ),
    0.15: (
        "3.3196883202385111208732909032",
        "2.76731208008061387759517085524",
        "0.154680464189181579204556023096",
    ),
    0.2263: (
        "1.34225237525804383538284073909",
        "0.152457372542094890725720705252",
        "0.87181488384477406389102997043",
    ),
}
SLIPPING = {
    0.2255: ("1.32539768107137282098992940464", "1.04065920542383006394122212028"),
    0.2263: ("1.33606185087429838469592310356", "1.09646925206004152194356352539"),
}


def slip_starts(cycle: Cycle) -> float:
    """α at the start of slip."""
    events = cycle.trajectory.events
    return float(events.loc[events["from"] == "stick", "alpha"].iloc[0])


@pytest.mark.parametrize("V", STICKING)
def test_sticking(V: float) -> None:
    cycle = find_cycle(SLIDER, parameters={"V": V})
    period, stick, multiplier = map(float, STICKING[V])
    assert cycle.trajectory.certificate.ok
    assert cycle.period == pytest.approx(period, rel=1e-13)
    assert cycle.stick_time == pytest.approx(stick, rel=1e-11)
    # The slider forgets so much in one period of slow loading that rounding of the rest is all that
    # can be seen.
    assert cycle.nontrivial == pytest.approx([multiplier], rel=1e-11, abs=1e-15)
    assert cycle.multipliers[0 if cycle.stable else 1] == pytest.approx(1.0, abs=1e-10)


@pytest.mark.parametrize("V", SLIPPING)
def test_unstable(V: float) -> None:
    point = continue_equilibrium(SLIDER, "V", (0.2, 0.25)).of_kind("Hopf")[0]
    cycle = find_cycle(SLIDER, point, parameters={"V": V})
    period, multiplier = map(float, SLIPPING[V])
    assert cycle.trajectory.certificate.ok
    assert not cycle.sticks
    assert cycle.period == pytest.approx(period, rel=1e-12)
    assert cycle.nontrivial == pytest.approx([multiplier], rel=1e-11)


def test_digits() -> None:
    """They are computed again, with fewer of them."""
    start = slip_starts(find_cycle(SLIDER, parameters={"V": 0.15}))
    found = spring_slider.cycle("0.15", "0.05", start, sticks=True, digits=7)
    assert list(map(float, found)) == pytest.approx(list(map(float, STICKING[0.15])), rel=1e-11)
    found = spring_slider.cycle("0.2255", "0.05", 1.4467, sticks=False, digits=7)
    assert [float(found.period), float(found.multiplier)] == pytest.approx(
        list(map(float, SLIPPING[0.2255])), rel=1e-11
    )
