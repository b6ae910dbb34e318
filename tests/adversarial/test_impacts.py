"""A few random motions with contacts that open, against the reference."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adversarial.kinds import impacts
from adversarial.verdict import AGREED, WRONG


@pytest.mark.parametrize("family", impacts.FAMILIES)
@pytest.mark.parametrize("seed", [3, 5])
def test_motion(family: str, seed: int) -> None:
    case = impacts.draw(family, seed)
    verdict = impacts.judge(case)
    assert verdict.kind == AGREED, f"{verdict}\n{case.source()}"


def test_a_wrong_motion_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = impacts.draw("corner", 0)
    simulated = impacts.simulated

    def other(factor: float) -> Any:
        more = {**case.parameters, "g": case.parameters["g"] * factor}
        return lambda c: simulated(replace(c, parameters=more))

    monkeypatch.setattr(impacts, "simulated", other(1 + 1e-5))
    assert impacts.judge(case).kind == WRONG
    monkeypatch.setattr(impacts, "simulated", other(1 + 1e-12))
    assert impacts.judge(case).kind == AGREED


def test_the_reference_knows_a_closed_form() -> None:
    """A ball that is dropped rests after √(2h/g) (1 + e)/(1 − e), and slides by then no further."""
    case = impacts.draw("thrown on a belt", 1)
    n = case.parameters
    start = {"y": 1.0, "d_x": 0.0}
    floor = replace(case.bodies.touches[0], e=0.5, mu=0.0, e_t=0.0)
    dropped = replace(case, bodies=replace(case.bodies, touches=[floor]), initial=start)
    first = np.sqrt(2 / n["g"])
    times = np.array([1.5 * first, 3.2 * first])
    path = impacts._follow(replace(dropped, duration=3.3 * first), dropped.bodies, times, 1e-12)
    speed = 0.5 * n["g"] * first
    flown = 0.5 * first
    assert path.states[0, 1] == pytest.approx(speed * flown - n["g"] / 2 * flown**2, rel=1e-9)
    assert path.states[1, 1] == pytest.approx(0.0, abs=1e-9)


def test_a_gap_that_closes_just_before_a_slip_ends() -> None:
    """The reference met the end of the slip first, where the bead turns within the stop."""
    assert impacts.judge(impacts.draw("bead on a turning hoop", 357)).kind == AGREED


@pytest.mark.parametrize(
    ("family", "seed"),
    [("two masses collide", 80), ("cart against stops", 325), ("that adheres", 30072)],
)
def test_what_opens_where_nothing_but_rounding_errors_moves(family: str, seed: int) -> None:
    """They made an impact, which the audit did not explain; or no mode went on. What no longer
    adheres may be held by something else."""
    assert impacts.judge(impacts.draw(family, seed)).kind == AGREED
