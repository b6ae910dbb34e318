"""Friction in a plane: a few dozen random motions against the reference, and the reference against
closed forms, an integration in τ, and smoothed friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adversarial.families.planes import FAMILIES, Slide
from adversarial.kinds import planes
from adversarial.kinds.planes import draw
from adversarial.references.sliding import PLANE, STICK, Bodies, Pad, motion
from adversarial.verdict import AGREED, REFUSED, WRONG
from oracles import planar

CHOSEN = {
    "puck": (0,),
    "shaken block": (0, 1),
    "block with static above kinetic": (0, 1),
    "block that slips more easily when fast": (0,),
    "ellipse": (0, 1),
    "moving surface": (0, 1),
    "turntable": (0, 1),
    "threshold in time": (0,),
    "threshold in the state": (0,),
    "coupled by mass": (0, 1),
    "two bodies by springs": (0,),
    "one on the other": (0, 304),
    "plane and line": (0, 1, 204),
    "plane and rail": (0, 150, 236),
    "turned directions": (0,),
    "three bodies": (0, 2, 31, 87, 340),
    "almost along a line": (0,),
    "close pass": (0, 5, 7, 9),
    "pressed": (0, 1, 2, 32),
    "scales": (0, 1),
}


@pytest.mark.parametrize(("family", "seed"), [(f, s) for f, seeds in CHOSEN.items() for s in seeds])
def test_motion(family: str, seed: int) -> None:
    case = draw(family, seed)
    verdict = planes.judge(case)
    assert verdict.kind == AGREED, f"{verdict}\n{case.source()}"


def test_every_family_is_chosen_and_told() -> None:
    assert set(CHOSEN) == set(FAMILIES)
    for make in FAMILIES.values():
        assert make.__doc__


def test_cases_are_fixed_and_drawn_in_turn() -> None:
    one, same, other = draw("turntable", 3), draw("turntable", 3), draw("turntable", 4)
    assert one == same
    assert one.numbers != other.numbers
    in_turn = list(planes.cases(5, len(FAMILIES) + 1))
    assert [c.family for c in in_turn] == [*FAMILIES, next(iter(FAMILIES))]
    assert "ss.simulate(" in planes.reproduction(one)


# -- the judge -------------------------------------------------------------------------------------


def test_a_wrong_motion_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = draw("shaken block", 0)
    simulated = planes.simulated

    def stronger(by: float) -> None:
        numbers = {**case.numbers, "s0": case.numbers["s0"] * by}
        monkeypatch.setattr(planes, "simulated", lambda c: simulated(replace(c, numbers=numbers)))

    stronger(1 + 1e-6)
    assert planes.judge(case).kind == WRONG
    stronger(1 + 1e-12)
    assert planes.judge(case).kind == AGREED
    stronger(np.nan)
    assert planes.judge(case).kind == REFUSED


# -- the reference ---------------------------------------------------------------------------------


def block(force: tuple[complex, complex] = (0.3, 0.0), stiff: complex = 0.0) -> Bodies:
    """A unit mass on a table, under a constant force and on springs."""

    def push(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.array(force) + 0 * q - stiff * q

    return Bodies(np.eye(2), push, [Pad(np.eye(2), lambda t, q: 1.0 + 0 * t)])


@pytest.mark.parametrize("f", [0.05, 0.3, 0.9])
def test_the_reference_knows_the_puck(f: float) -> None:
    speed, angle = 1.2, 2.0
    expected = planar.pushed_puck(f, 1.0, speed, angle)
    start = [0.0, 0.0, speed * np.cos(angle), speed * np.sin(angle)]
    found = motion(block((f, 0.0)), start, [2 * expected[0]], 2 * expected[0])
    assert [p.mode for p in found.phases] == [(PLANE,), (STICK,)]
    assert found.phases[1].time == pytest.approx(expected[0], abs=1e-12)
    np.testing.assert_allclose(found.states[0], [*expected[1:], 0.0, 0.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.forces[0][0], [-f, 0.0], rtol=0, atol=1e-12)


def test_the_reference_agrees_in_tau_with_derivatives() -> None:
    """Both are analytic: the imaginary part of a result is the derivative by a parameter, through
    the end of the slip."""
    tiny = 1e-30
    start = np.array([0.2, -0.1, 1.0, 0.5])
    stiff = 0.4 + 1j * tiny

    def force(t: complex, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.array([0.3, 0.0]) - stiff * q

    t, x, y = planar.slip_in_tau(force, lambda t: 1.0, start.astype(complex))
    found = motion(block(stiff=stiff), start, [3.0], 3.0)
    assert len(found.phases) == 2
    end = found.phases[1].time
    assert end.real == pytest.approx(t.real, abs=1e-12)
    assert end.imag / tiny == pytest.approx(t.imag / tiny, abs=1e-9)
    for mine, other in zip(found.states[0][:2], (x, y), strict=True):
        assert mine.real == pytest.approx(other.real, abs=1e-12)
        assert mine.imag / tiny == pytest.approx(other.imag / tiny, abs=1e-9)
    # and both agree with differences
    by = 1e-5
    ends = [motion(block(stiff=0.4 + s), start, [], 3.0).phases[1].time for s in (-by, by)]
    assert (ends[1] - ends[0]) / (2 * by) == pytest.approx(t.imag / tiny, abs=1e-8)


def test_the_reference_begins_a_slip_as_its_leading_term_does() -> None:
    """From rest under a force beyond friction: (|f| − k) n t, then an integration in τ."""

    def force(t: float, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.array([1.2, 0.5]) - 0.4 * q

    place = [0.1, 0.3]
    first = planar.slip_from_rest(force, lambda t: 1.0, place)
    expected = planar.slip_in_tau(force, lambda t: 1.0, first, 1e-7)
    found = motion(block((1.2, 0.5), 0.4), [*place, 0.0, 0.0], [], 6.0)
    assert [p.mode for p in found.phases][:2] == [(PLANE,), (STICK,)]
    assert found.phases[1].time == pytest.approx(expected[0], abs=1e-11)


def shortened(family: str, seed: int) -> tuple[Slide, np.ndarray, list[float]]:
    case = draw(family, seed)
    return case, np.array([1.0, 2.0]), [case.start.get(n, 0.0) for n in case.names]


@pytest.mark.parametrize(
    ("family", "seed"),
    [("shaken block", 0), ("ellipse", 1), ("moving surface", 0), ("two bodies by springs", 1)],
)
def test_smoothed_friction_converges_to_the_reference(family: str, seed: int) -> None:
    case, times, start = shortened(family, seed)
    exact = planes.follow(case, times).states
    found = [planar.smoothed(case.bodies(), start, times, e) for e in (4e-3, 2e-3, 1e-3)]
    off = [float(np.max(np.abs(f - exact))) for f in found]
    assert off[0] > 1.8 * off[1] > 3.2 * off[2]
    assert np.max(np.abs(planar.extrapolated(found) - exact)) < 0.02 * off[2] + 1e-7
