"""Accelerations at an instant of contacts that share forces: 300 random ones. All of them are
``python -m tests.adversarial --only accelerations --count 20000``."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from adversarial.families.leaving import FAMILIES
from adversarial.kinds import accelerations
from adversarial.kinds.accelerations import draw
from adversarial.verdict import AGREED, REFUSED, WRONG

EACH = 300 // len(FAMILIES) + 1
# What is refused, or not certified, of the seeds below EACH.
KNOWN = {("planes at rest", 10), ("body about points", 22)}


@pytest.mark.parametrize("family", FAMILIES)
def test_accelerations(family: str) -> None:
    """The unique minimiser to 1e-10, and certified."""
    verdicts = {seed: accelerations.judge(draw(family, seed)) for seed in range(EACH)}
    found = Counter(v.kind for v in verdicts.values())
    assert found[WRONG] == 0, {s: v for s, v in verdicts.items() if v.kind == WRONG}
    others = {s: v for s, v in verdicts.items() if v.kind != AGREED and (family, s) not in KNOWN}
    assert not others, others


def test_what_is_wrong_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """One threshold is larger by 1e-8 than the judge is told."""
    case = draw("body in slip", 0)
    stronger = {**case.numbers, "s0": case.numbers["s0"] * (1 + 1e-8)}
    assert accelerations.judge(replace(case, numbers=stronger)).kind == WRONG
    undefined = {**case.numbers, "s0": np.nan}
    assert accelerations.judge(replace(case, numbers=undefined)).kind == REFUSED


def test_the_judge_knows_a_rod() -> None:
    """Pushed sideways, it moves in pure translation with what friction leaves of the load."""
    case = draw("rod at rest", 0)
    places = [0.0, -1.0, 1.0]
    rows = tuple(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, x]]) for x in places)
    rod = replace(
        case,
        mass=np.diag([2.0, 2.0, 0.3]),
        force=np.array([0.0, 1.5, 0.0]),
        rows=rows,
        turns=(np.zeros(2),) * 3,
        slides=(np.zeros(2),) * 3,
        holds=np.array([0.2, 0.4, 0.4]),
    )
    np.testing.assert_allclose(accelerations.minimiser(rod), [0.0, 0.25, 0.0], atol=1e-13)
    held = replace(rod, force=np.array([0.0, 0.9, 0.0]))
    np.testing.assert_allclose(accelerations.minimiser(held), np.zeros(3), atol=1e-13)


def test_families() -> None:
    for name, make in FAMILIES.items():
        assert make.__doc__
        one, same, other = draw(name, 3), draw(name, 3), draw(name, 4)
        assert one.numbers == same.numbers
        assert one.numbers != other.numbers
        assert "ss.simulate(" in accelerations.reproduction(one)
    assert len(list(accelerations.cases(0, 12))) == 12
