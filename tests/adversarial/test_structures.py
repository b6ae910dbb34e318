"""Structures with dry contacts: a few dozen random motions against the reference, and the reference
against a closed form and smoothed friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from adversarial.families.structures import FAMILIES, Structural
from adversarial.kinds import structures
from adversarial.kinds.structures import draw
from adversarial.references.linear import Body, Touch, follow
from adversarial.verdict import AGREED, NOT_CERTIFIED, REFUSED, WRONG

CHOSEN = {
    "driven structure": (0, 1),
    "let go": (0, 1),
    "full damping": (0, 1),
    "overdamped structure": (0, 1),
    "stiff structure": (1, 6, 1015),
    "rigid modes": (0, 5, 31),
    "many contacts": (0, 1),
    "large structure": (0, 1),
    "jenkins elements": (0, 1),
    "on belts": (0, 1, 19),
    "holds more at rest": (0, 1, 4),
    "alike": (0, 5, 18),
    "sparse matrices": (0, 1),
    "units of structures": (0, 1),
}


@pytest.mark.parametrize(("family", "seed"), [(f, s) for f, seeds in CHOSEN.items() for s in seeds])
def test_motion(family: str, seed: int) -> None:
    case = draw(family, seed)
    verdict = structures.judge(case)
    assert verdict.kind == AGREED, f"{verdict}\n{case.source()}"


def test_every_family_is_chosen_and_told() -> None:
    assert set(CHOSEN) == set(FAMILIES)
    for make in FAMILIES.values():
        assert make.__doc__


def test_cases_are_fixed_and_drawn_in_turn() -> None:
    one, same, other = draw("let go", 3), draw("let go", 3), draw("let go", 4)
    np.testing.assert_array_equal(one.u, same.u)
    np.testing.assert_array_equal(one.body.mass, same.body.mass)
    assert one.system == same.system
    assert len(one.u) != len(other.u) or np.any(one.u != other.u)
    in_turn = list(structures.cases(5, len(FAMILIES) + 1))
    assert [c.family for c in in_turn] == [*FAMILIES, next(iter(FAMILIES))]
    assert "ss.simulate(" in structures.reproduction(one)


# -- the judge -------------------------------------------------------------------------------------


def test_a_wrong_motion_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case = draw("driven structure", 0)
    simulated = structures.simulated

    def stronger(by: float) -> None:
        def other(c: Structural) -> object:
            return simulated(replace(c, body=c.body.stronger(by)))

        monkeypatch.setattr(structures, "simulated", other)

    stronger(1 + 1e-6)
    assert structures.judge(case).kind == WRONG
    stronger(1 + 1e-12)
    assert structures.judge(case).kind == AGREED
    stronger(np.nan)
    assert structures.judge(case).kind == REFUSED


def test_a_wrong_matrix_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """What rounding does is allowed, and not ten thousand times that."""
    case = draw("stiff structure", 6)
    simulated = structures.simulated

    def stiffer(by: float) -> None:
        softer = replace(case.body, stiffness=case.body.stiffness * by)
        monkeypatch.setattr(structures, "simulated", lambda c: simulated(replace(c, body=softer)))

    stiffer(1 + 1e-6)
    assert structures.judge(case).kind in (WRONG, NOT_CERTIFIED)
    stiffer(1 + 1e-15)
    assert structures.judge(case).kind == AGREED


# -- the reference ---------------------------------------------------------------------------------


def one_mass(mass: float, stiffness: float, touch: Touch) -> Body:
    m, c, k = (np.array([[value]]) for value in (mass, 0.0, stiffness))
    return Body(m, c, k, (touch,), np.zeros(1), 1.0, 0.0, np.zeros(1))


def test_the_reference_knows_a_block_that_rings_down() -> None:
    """Each half-cycle takes 2 F/k from the amplitude, as long as the spring is stronger."""
    body = one_mass(1.0, 1e4, Touch(np.ones(1), 1.0, 1.0))
    half = np.pi / 100.0
    times = half * np.arange(7.0)
    found = follow(body, np.array([0.85e-3]), np.zeros(1), times[-1], times)
    expected = [0.85e-3, -0.65e-3, 0.45e-3, -0.25e-3, 0.05e-3, 0.05e-3, 0.05e-3]
    np.testing.assert_allclose(found.states[:, 0], expected, rtol=0, atol=1e-16)
    assert [phase.mode for phase in found.phases] == [(-1,), (1,), (-1,), (1,), (0,)]
    np.testing.assert_allclose([p.time for p in found.phases], times[:5], rtol=0, atol=1e-14)
    assert found.friction[5, 0] == pytest.approx(0.5, abs=1e-12)


def test_the_reference_knows_a_slider_behind_a_spring() -> None:
    """Thrown against it, a mass swings with both springs until the slider moves, and then with its
    own."""
    body = one_mass(1.0, 1.0, Touch(np.ones(1), 0.3, 0.3, spring=3.0))
    speed = 1.0
    first = np.arcsin(2.0 * 0.1 / speed) / 2.0  # u = sin(2 t)/2 is 0.3/3
    rate = speed * np.cos(2.0 * first)
    stop = np.arctan2(rate, 0.1 + 0.3)  # about -0.3
    found = follow(body, np.zeros(1), np.array([speed]), 2.0, np.array([first + stop]))
    assert [phase.mode for phase in found.phases][:3] == [(0,), (1,), (0,)]
    times = [phase.time for phase in found.phases[1:3]]
    np.testing.assert_allclose(times, [first, first + stop], rtol=0, atol=1e-13)
    assert found.states[0, 0] == pytest.approx(np.hypot(rate, 0.4) - 0.3, abs=1e-13)


@pytest.mark.parametrize(
    ("family", "seed"), [("full damping", 1), ("driven structure", 2), ("jenkins elements", 0)]
)
def test_smoothed_friction_converges_to_the_reference(family: str, seed: int) -> None:
    case = draw(family, seed)
    body, n = case.body, len(case.u)
    rows = np.array([touch.row for touch in body.touches])
    springs = np.array([touch.spring for touch in body.touches])
    holds = np.array([touch.holds for touch in body.touches])
    end = min(case.duration, 6.0)
    exact = follow(body, case.u, case.v, end, np.array([end])).states[0]
    inverse = np.linalg.inv(body.mass)

    def smoothed(width: float) -> np.ndarray:
        def rates(t: float, x: np.ndarray) -> np.ndarray:
            u, v, s = x[:n], x[n : 2 * n], x[2 * n :]
            slip = rows @ v
            force = np.where(springs > 0.0, s, holds * np.tanh(slip / width))
            # a spring yields over a small range of its force
            over = 0.5 * (1.0 + np.tanh((np.abs(s) / holds - 1.0) / width))
            yields = springs * slip * (1.0 - over * (s * slip > 0.0))
            load = body.constant + body.swing * np.cos(body.omega * t + body.phase)
            return np.concatenate(
                [
                    v,
                    inverse @ (load - body.damping @ v - body.stiffness @ u - rows.T @ force),
                    yields,
                ]
            )

        start = np.concatenate([case.u, case.v, np.zeros(len(rows))])
        found = solve_ivp(rates, (0.0, end), start, "LSODA", rtol=1e-9, atol=1e-11)
        return found.y[: 2 * n, -1]

    off = [float(np.max(np.abs(smoothed(width) - exact))) for width in (4e-3, 1e-3)]
    assert off[0] > 2.0 * off[1]
    assert off[1] < 3e-3 * np.max(np.abs(exact))
