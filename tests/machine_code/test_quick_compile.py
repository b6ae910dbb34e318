"""Quickly compiled code, which the other tests use, computes the same bits as thorough code."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip import catalogue, simulate
from stickslip.machine_code import objects


@pytest.mark.parametrize("name", catalogue.names())
def test_the_bits_are_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """All knots of a motion, and its certificate."""
    motions = []
    for quick in (True, False):
        monkeypatch.setattr(objects, "QUICK", quick)
        motions.append(simulate(getattr(catalogue, name)(), max_events=200))
    hasty, thorough = motions
    assert len(hasty.knots.time) == len(thorough.knots.time)
    np.testing.assert_array_equal(hasty.knots.time, thorough.knots.time)
    np.testing.assert_array_equal(hasty.knots.state, thorough.knots.state)
    assert str(hasty.certificate) == str(thorough.certificate)


def test_the_effort_differs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise the other test compares nothing."""
    tried = []
    made = objects.object_of

    def noted(assembly: str, place: object, here: object, effort: int) -> bytes:
        tried.append(effort)
        return made(assembly, place, here, effort)  # type: ignore[arg-type]

    monkeypatch.setattr(objects, "object_of", noted)
    for quick in (True, False):
        monkeypatch.setattr(objects, "QUICK", quick)
        simulate(catalogue.forced_oscillator(force="P*cos(omega*t) + 0.12345"), max_events=2)
    assert tried == [objects.LONG, objects.STRAIGHT]
