"""A few damages of every kind of stored result. The long run is ``python -m tests.adversarial``."""

from __future__ import annotations

import pytest

from adversarial.kinds import stored
from adversarial.verdict import AGREED, WRONG


@pytest.mark.parametrize("family", stored.FAMILIES)
def test_damage_is_answered_by_name(family: str) -> None:
    for seed in range(40 if family in (stored.STORE, stored.RESUMED) else 15):
        case = stored.draw(family, seed)
        verdict = stored.judge(case)
        assert verdict.kind == AGREED, f"{verdict}\n{stored.reproduction(case)}"


def test_other_values_are_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = stored.draw("trajectory", 0)
    _, right = stored.original("trajectory")
    values = {**right["values"], "x": right["values"]["x"] + 1e-9}
    monkeypatch.setattr(stored, "read", lambda result: {**right, "values": values})
    monkeypatch.setattr(stored.ss, "open", lambda path: None)
    verdict = stored.judge(case)
    assert (verdict.kind, verdict.note) == (WRONG, "other x")
