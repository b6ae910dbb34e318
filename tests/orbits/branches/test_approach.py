"""How a change of the sequence is enclosed: margins that vanish on one side or on the other."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stickslip.orbits.branches.special_points import _Finder

CHANGE = 0.2718281828


def finder(margin: Callable[[float], float]) -> tuple[Any, list[float]]:
    """A finder of where margins change their sign, and where it looks."""
    looked: list[float] = []

    class Finder(_Finder):
        def __call__(self, distance: float) -> float:
            if distance not in self.seen:
                looked.append(distance)
                value = margin(distance)
                order: Any = ("before",) if value >= 0.0 else ("beyond",)
                self.seen[distance] = np.array([distance]), order, value
            return self.seen[distance][2]

    first: Any = SimpleNamespace(length=0.0)
    last: Any = SimpleNamespace(length=1.0)
    here: Any = ("before",)
    chart: Any = None
    return Finder(chart, first, last, here), looked


MARGINS = {
    "linear before": lambda d: 0.3 * (CHANGE - d) * (1 + d) if d <= CHANGE else -0.07,
    "a root before": lambda d: 0.3 * np.sqrt(CHANGE - d) if d <= CHANGE else -0.07,
    "linear beyond": lambda d: 0.02 if d < CHANGE else -0.3 * (d - CHANGE) * (2 - d) - 1e-300,
    "a root beyond": lambda d: 0.02 if d < CHANGE else -0.3 * np.sqrt(d - CHANGE) - 1e-300,
    "on both sides": lambda d: np.tan(CHANGE - d),
}


@pytest.mark.parametrize("kind", MARGINS)
def test_where_it_vanishes(kind: str) -> None:
    """To rounding, in a few looks."""
    found, looked = finder(MARGINS[kind])
    change = found.first_change(0.0, 1.0)
    assert change.there == ("beyond",)
    assert change.x[0] == pytest.approx(CHANGE, abs=1e-12)
    assert len(looked) <= 36
    assert change.high >= CHANGE - 1e-12


def test_a_jump_is_enclosed() -> None:
    """Nothing vanishes: by halves, on the last side that is known."""
    found, looked = finder(lambda d: 0.2 if d < CHANGE else -0.1)
    change = found.first_change(0.0, 1.0)
    assert change.high == pytest.approx(CHANGE, abs=2e-13)
    assert len(looked) < 60


def test_a_phase_that_is_not_counted_any_more() -> None:
    """Its margin is what it lasts beyond 1e-9 of the period: 0 where the phase is gone."""
    found, looked = finder(lambda d: m if (m := 0.05 * (CHANGE - d) - 1e-9) > 0.0 else -0.07)
    change = found.first_change(0.0, 1.0)
    assert change.x[0] == pytest.approx(CHANGE - 2e-8, abs=1e-12)
    assert change.high == pytest.approx(change.x[0], abs=1e-12)
    assert len(looked) < 25


def test_what_vanishes_at_the_change_before() -> None:
    """A margin that is zero where one starts and grows from there is not that of the next
    change."""
    found, _ = finder(lambda d: d * (CHANGE - d))
    change = found.first_change(0.0, 1.0)
    assert change.there == ("beyond",)
    assert change.x[0] == pytest.approx(CHANGE, abs=1e-12)
    assert change.high == pytest.approx(CHANGE, abs=1e-12)


def test_the_first_of_two_changes() -> None:
    """Another one with a smaller margin lies further on."""
    found, _ = finder(lambda d: (CHANGE - d) if d < 0.5 else -1e-9 * (d - 0.9) ** 2)
    change = found.first_change(0.0, 1.0)
    assert change.x[0] == pytest.approx(CHANGE, abs=1e-12)
    assert change.high == pytest.approx(CHANGE, abs=2e-6)
