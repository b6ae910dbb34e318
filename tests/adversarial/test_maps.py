"""A few dozen random points of maps against brute force. The long run is ``python -m
tests.adversarial``."""

from __future__ import annotations

import pytest

from adversarial.kinds import maps
from adversarial.verdict import AGREED, NOT_CERTIFIED, WRONG

# Seeds that take little time; some start outside the stable set.
CHOSEN = {
    "stribeck belt": (1, 2),
    "belt with static above kinetic": (1, 2),
    "damper that may slip": (0, 1, 2),
    "damper that sticks": (0, 1, 2),
    "damper on a hard spring": (0,),
    "driven on dry ground": (0, 1, 2),
    "driven with static above kinetic": (0, 1),
    "coming to rest": (0, 1),
    "toy that may walk": (0, 1, 2),
    "pulses in the load": (0, 1),
    "rough patch": (1,),
    "gust after rest": (0, 1),
    "nothing damps it": (0, 1, 2),
    "dragged block": (0, 1),
}


@pytest.mark.parametrize(("family", "seed"), [(f, s) for f, seeds in CHOSEN.items() for s in seeds])
def test_point(family: str, seed: int) -> None:
    case = maps.draw(family, seed)
    verdict = maps.judge(case)
    assert verdict.kind == AGREED, f"{verdict}\n{maps.reproduction(case)}"


@pytest.mark.parametrize(
    ("measure", "factor", "said"),
    [
        ("period", 2.0, "another number of periods"),
        ("period", 1.0001, "another period"),
        ("amplitude", 1.0001, "another amplitude"),
        ("stick_fraction", 0.5, "another stick_fraction"),
        ("energy_per_cycle", 1.0001, "another energy_per_cycle"),
    ],
)
def test_a_wrong_point_is_called_wrong(
    monkeypatch: pytest.MonkeyPatch, measure: str, factor: float, said: str
) -> None:
    case = maps.draw("toy that may walk", 0)
    found = maps.measured(maps.draw("toy that may walk", 0))
    monkeypatch.setattr(maps, "measured", lambda c: found | {measure: factor * found[measure]})
    verdict = maps.judge(case)
    assert (verdict.kind, verdict.note) == (WRONG, said)
    monkeypatch.setattr(
        maps, "measured", lambda c: found | {measure: factor * found[measure], "lacking": 1}
    )
    assert maps.judge(case).kind == NOT_CERTIFIED


def test_rest_that_is_none_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = maps.draw("damper that sticks", 0)
    found = maps.measured(case) | {"outcome": 1}
    monkeypatch.setattr(maps, "measured", lambda c: found)
    assert maps.judge(case).note == "said rest, brute force: cycle"
