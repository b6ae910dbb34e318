"""The stick-slip cycle of a block on a belt, found as a cycle, against its formulas.

V. L. Popov, *Contact Mechanics and Friction*, Springer 2010, chapter 12.
"""

from __future__ import annotations

import pytest

from oracles import belt_block
from stickslip import catalogue
from stickslip.errors import ConvergenceError
from stickslip.orbits.cycles.find_cycle import find_cycle

SETS = [
    {"m": 1.0, "k": 1.0, "V": 0.3, "F_s": 1.0, "F_k": 0.6},
    {"m": 0.2, "k": 7.0, "V": 0.05, "F_s": 2.0, "F_k": 0.1},
    {"m": 5.0, "k": 0.3, "V": 2.0, "F_s": 1.2, "F_k": 1.1},
]


def test_published_numbers() -> None:
    cycle = find_cycle(catalogue.belt_block())
    assert cycle.period == pytest.approx(7.0952615, abs=5e-8)
    assert cycle.extrema["x"] == pytest.approx((0.1, 1.1), rel=1e-12)


@pytest.mark.parametrize("values", SETS)
def test_formulas(values: dict[str, float]) -> None:
    # With little friction smaller oscillations never stick: start where the block begins to.
    start = {"x": (2 * values["F_k"] - values["F_s"]) / values["k"], "d_x": values["V"]}
    cycle = find_cycle(catalogue.belt_block(), start, parameters=values)
    assert cycle.trajectory.certificate.ok
    assert cycle.period == pytest.approx(belt_block.period(**values), rel=1e-12)
    assert cycle.slip_time == pytest.approx(belt_block.slip_duration(**values), rel=1e-11)
    stick = belt_block.stick_duration(values["k"], values["V"], values["F_s"], values["F_k"])
    assert cycle.stick_time == pytest.approx(stick, rel=1e-11)
    forces = tuple(values["k"] * x for x in cycle.extrema["x"])
    assert forces == pytest.approx(belt_block.force_range(**values), rel=1e-11)
    # A motion that has stuck once is on the cycle: the other multiplier is 0, exactly.
    assert cycle.multipliers.tolist() == [pytest.approx(1.0, abs=1e-11), 0.0]


def test_family() -> None:
    """Steady sliding is a centre: small oscillations without stick are cycles, too, but no isolated
    ones."""
    known = r"form a continuous family.*remains closed if its state is shifted along \((d_)?x: "
    with pytest.raises(ConvergenceError, match=known):
        find_cycle(catalogue.belt_block(), parameters=SETS[2])
