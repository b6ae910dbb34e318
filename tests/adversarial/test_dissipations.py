"""Dissipations by formulas: a few random motions against smoothed friction, and the dissipations of
the reference against integrals. The long run is ``python -m tests.adversarial --only
dissipations``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from adversarial.families.dissipations import FAMILIES
from adversarial.kinds import dissipations, points
from adversarial.kinds.dissipations import draw
from adversarial.references.directed import RULES, mean_speed_of_disc, mean_speed_of_ring
from adversarial.verdict import AGREED, WRONG

CHOSEN = [
    ("shifted ellipses", 0),
    ("shifted ellipses", 44),
    ("sums of norms", 0),
    ("forward and backward", 0),
    ("very flat", 8),
    ("small faces", 6),
    ("small faces", 8),
    ("turned by an angle", 0),
    ("beside a line", 69),
    ("beside a line", 77),
]


@pytest.mark.parametrize(("family", "seed"), CHOSEN)
def test_motion(family: str, seed: int) -> None:
    case = draw(family, seed)
    verdict = dissipations.judge(case)
    assert verdict.kind == AGREED, f"{verdict}\n{case.source()}"


def test_families() -> None:
    for name, make in FAMILIES.items():
        assert make.__doc__
        one, same, other = draw(name, 3), draw(name, 3), draw(name, 4)
        assert one == same
        assert one.numbers != other.numbers
    assert "ss.simulate(" in dissipations.reproduction(draw("quartics", 0))
    assert [c.family for c in dissipations.cases(0, len(FAMILIES))] == list(FAMILIES)


def test_a_wrong_motion_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = draw("shifted ellipses", 1)
    simulated = points.simulated
    numbers = {**case.numbers, "b_0": case.numbers["b_0"] + 1e-5}
    monkeypatch.setattr(points, "simulated", lambda c: simulated(replace(c, numbers=numbers)))
    assert dissipations.judge(case).kind == WRONG


# -- the reference ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list(RULES))
def test_gradients(name: str) -> None:
    rule = RULES[name]
    rng = np.random.default_rng(2)
    for _ in range(20):
        numbers = rule.draw(rng)
        v = rng.normal(size=rule.count)
        value, slope = rule.found(numbers, v)
        assert slope @ v == pytest.approx(value, rel=1e-12)
        h = 1e-6
        for way, e in enumerate(np.eye(rule.count)):
            quotient = (rule.value(numbers, v + h * e) - rule.value(numbers, v - h * e)) / (2 * h)
            assert slope[way] == pytest.approx(quotient, abs=2e-8)


@pytest.mark.parametrize(("slide", "spin"), [(0.01, 1.0), (0.6, 1.0), (1.0, 0.7), (1.0, 0.02)])
def test_mean_speeds(slide: float, spin: float) -> None:
    def around(r: float) -> float:
        def speed(angle: float) -> float:
            return np.sqrt(slide**2 + (spin * r) ** 2 + 2.0 * slide * spin * r * np.cos(angle))

        return quad(speed, 0.0, np.pi, epsabs=1e-13)[0] / np.pi

    assert mean_speed_of_ring(slide, spin)[0] == pytest.approx(around(1.0), rel=1e-11)
    kink = [min(slide / spin, 1.0)]
    whole = quad(lambda r: 2.0 * r * around(r), 0.0, 1.0, points=kink, epsabs=1e-12)[0]
    assert mean_speed_of_disc(slide, spin)[0] == pytest.approx(whole, rel=1e-9)
