"""Gaits as cycles up to a drift: the walking toy and the crawler with directional friction.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), sections 4.3 and 4.4: the set I_b = a = b = ψ* = P = 1, δ = 0.04, c = 0.3, ρ =
0.2, H* = 3 walks with the period 5.969 and the speed v = 2X/T = 0.1675; one period feeds 2cX(ψ₃ +
ψ*) into the rocking.

A. DeSimone, P. Gidoni, G. Noselli, *Liquid crystal elastomer strips as soft crawlers*, J. Mech.
Phys. Solids 84 (2015) 254-272: net displacement per cycle sgn(f₋ − f₊) max(0, D − 2 min(f₊, f₋)/k).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from oracles import crawler
from stickslip import System, catalogue
from stickslip.errors import ConvergenceError
from stickslip.orbits.cycles.cycle import Cycle
from stickslip.orbits.cycles.find_cycle import find_cycle
from stickslip.symbolic import expressions as ex

WALK = {"psi": -1.67, "x_R": 0.45, "x_L": 0.0}


def gait(
    system: System, start: dict[str, float] | None = None, values: dict[str, float] | None = None
) -> Cycle:
    found = find_cycle(system, start, parameters=values)
    assert found.trajectory.certificate.ok, found.trajectory.certificate.verdict
    assert found.residual < 1e-10
    return found


def test_walking_toy() -> None:
    toy = catalogue.rocking_toy()
    facts = {name: ex.evaluate(fact, toy.values) for name, fact in toy.declaration.facts.items()}
    walk = gait(toy, WALK)
    X, psi_3 = facts["X"], facts["psi_3"]
    assert walk.period == pytest.approx(5.969, abs=5e-4)
    assert walk.drift == pytest.approx(2 * X, rel=1e-12)
    assert walk.direction == {"x_R": 1.0, "x_L": 1.0}
    assert walk.speed == pytest.approx(0.1675, abs=5e-5)
    assert walk.extrema["psi"] == pytest.approx((-1.6236, 1.6236), abs=5e-5)
    # One multiplier 1 for a later start, one for the translation, and 0 for what the sliding leg
    # forgets.
    assert walk.trivial == 2
    assert np.count_nonzero(walk.multipliers == 0.0) == 1
    assert walk.stable
    # The weights lose 2PX for each leg; friction takes what the rocking is not fed.
    assert walk.dissipated == pytest.approx(4 * X, rel=1e-11)
    assert walk.energy_per_distance == pytest.approx(2.0, rel=1e-11)
    assert walk.cost_of_transport(2 * toy.values["P"]) == pytest.approx(1.0, rel=1e-11)
    fed = 2 * 0.3 * X * (psi_3 + 1.0)
    legs = sum(share.dissipated for share in walk.contacts.values())
    assert walk.dissipated - legs == pytest.approx(fed, rel=1e-10)


def test_reduced_oscillator_has_the_same_multipliers() -> None:
    """Section 4.4: with the legs eliminated the rocking has the same period, amplitude and
    multiplier."""
    walk = gait(catalogue.rocking_toy(), WALK)
    rocking = gait(catalogue.rocking_oscillator(), {"psi": -1.67})
    assert rocking.period == pytest.approx(walk.period, rel=1e-12)
    assert rocking.nontrivial == pytest.approx(walk.nontrivial, rel=1e-9)
    assert rocking.extrema["psi"] == pytest.approx(walk.extrema["psi"], rel=1e-11)
    # Liouville: the hysteresis keeps areas but for what damping takes.
    assert rocking.drift == 0.0
    assert rocking.energy_per_distance == math.inf


def test_drift_does_not_depend_on_where_the_toy_stands() -> None:
    walk = gait(catalogue.rocking_toy(), WALK)
    for shift in (-40.0, 3.3, 250.0):
        moved = gait(
            catalogue.rocking_toy(),
            {**WALK, "x_R": WALK["x_R"] + shift, "x_L": WALK["x_L"] + shift},
        )
        assert moved.period == pytest.approx(walk.period, rel=1e-11)
        assert moved.drift == pytest.approx(walk.drift, rel=1e-11)
        assert moved.nontrivial == pytest.approx(walk.nontrivial, rel=1e-8)


def test_vanishing_masses() -> None:
    """(4.1) walks, too: with two legs that have mass, and the speed of (4.2) up to terms of their
    size."""
    walk = gait(catalogue.rocking_toy(), WALK)
    heavy = gait(catalogue.rocking_toy_inertial())
    assert heavy.trivial == 2
    assert np.count_nonzero(heavy.multipliers == 0.0) == 2
    assert heavy.direction == {"x_R": 1.0, "x_L": 1.0}
    assert heavy.speed == pytest.approx(walk.speed, rel=0.1)
    # The weights lose g m_W/2 on each leg.
    assert heavy.dissipated == pytest.approx(2.0 * heavy.drift, rel=1e-10)


@pytest.mark.parametrize(("f_plus", "f_minus"), [(0.3, 0.8), (0.8, 0.3), (1.9, 5.0), (0.2, 0.21)])
@pytest.mark.parametrize("k", [1.0, 2.5])
def test_crawler(f_plus: float, f_minus: float, k: float) -> None:
    values = {"D": 4.0, "k": k, "f_plus": f_plus, "f_minus": f_minus}
    crawl = gait(catalogue.two_leg_crawler(), None, values)
    step = crawler.net_displacement(4.0, k, f_plus, f_minus)
    assert crawl.period == pytest.approx(2 * math.pi, rel=1e-14)
    assert crawl.drift == pytest.approx(step, rel=1e-11)
    assert crawl.speed == pytest.approx(step / (2 * math.pi), rel=1e-11)
    assert crawl.direction == {"x_1": 1.0, "x_2": 1.0}
    # Only the easy direction is ever taken, by each leg once.
    assert crawl.dissipated == pytest.approx(2 * min(f_plus, f_minus) * abs(step), rel=1e-11)
    assert crawl.energy_per_distance == pytest.approx(2 * min(f_plus, f_minus), rel=1e-11)
    assert sorted(np.real(crawl.multipliers)) == [0.0, pytest.approx(1.0)]


def test_crawler_with_a_short_stroke_stays() -> None:
    with pytest.raises(ConvergenceError, match="comes to rest"):
        find_cycle(catalogue.two_leg_crawler(), parameters={"D": 0.15})
