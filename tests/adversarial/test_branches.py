"""A few random branches against the reference. The long run is ``python -m tests.adversarial --only
branches``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import stickslip as ss
from adversarial.families.branching import FAMILIES
from adversarial.kinds import branches
from adversarial.verdict import AGREED, WRONG
from stickslip.orbits.branches import corner

CHOSEN = [
    ("belt that rises", 0),
    ("slider that heats", 1),
    ("driven over dry ground", 0),
    # A stick at the onset may be too short to count: 7 within a step, 13 at a corner, 52 on a belt.
    ("driven over dry ground", 7),
    ("driven over dry ground", 13),
    ("belt that falls", 52),
    # Small cycles that turn back before they are lost, and curves that cross.
    ("driven over dry ground", 16),
    ("damper on a hardening spring", 5002),
    # Branch points of cycles that stick throughout.
    ("damper on a hardening spring", 29),
]

# Where a boundary is about to be touched derivatives have no bound.
TOUCHES = [7, 10, 16, 18, 5000, 5001, 5002, 5004]


@pytest.mark.parametrize(("family", "seed"), CHOSEN)
def test_branch(family: str, seed: int) -> None:
    """Folds and onsets are where cycles of the reference turn back and begin to stick."""
    case = branches.draw(family, seed)
    verdict = branches.judge(case)
    assert verdict.kind == AGREED, f"{verdict}\n{branches.reproduction(case)}"
    assert verdict.numbers["special points"] > 0


@pytest.mark.parametrize("seed", TOUCHES)
def test_branches_that_are_lost_are_certified(seed: int) -> None:
    """Up to the last cycle that closes, and through the folds before it."""
    found = branches.branch_of(branches.draw("driven over dry ground", seed))
    assert isinstance(found, ss.Branch)
    assert found.certificate.ok, found.certificate.describe()
    assert not found.of_kind("boundary equilibrium")


def test_a_branch_does_not_turn_back_at_a_corner() -> None:
    """Beyond the corner the cycle slips throughout and is unstable, down to the Hopf point, where
    damping and the slope of the friction force cancel."""
    case = branches.draw("belt that falls", 33)
    found = branches.branch_of(case)
    assert isinstance(found, ss.Branch)
    assert [point.kind for point in found.special] == ["stick onset", "fold", "Hopf"]
    assert found.certificate.ok, found.certificate.describe()
    p = case.parameters

    def damping(V: float) -> float:
        v = V / p["v_s"]
        return p["c"] - 2.0 * (p["mu"] - p["F_k"]) * v / p["v_s"] / (1.0 + v**2) ** 2

    hopf = brentq(damping, p["v_s"], 6.0)
    assert found.of_kind("Hopf")[0].value == pytest.approx(hopf, rel=1e-9)
    beyond = slice(found.special[0].index + 1, None)
    assert not np.any(found.points["sticks"].values[beyond])
    assert not np.any(found.points["stable"].values[beyond])


def test_a_branch_that_turns_back_is_not_certified(monkeypatch: pytest.MonkeyPatch) -> None:
    """Phases of stick appear and vanish only at special points."""
    monkeypatch.setattr(corner, "_is_kept", lambda _: True)
    found = branches.branch_of(branches.draw("belt that falls", 33))
    assert isinstance(found, ss.Branch)
    (wrong,) = [r for r in found.certificate.residuals if not r.ok]
    assert wrong.name == "changes of stick without a special point"


@pytest.mark.parametrize("seed", [5002, 5004])
def test_a_symmetric_branch_goes_through_its_branch_points(seed: int) -> None:
    """Newton's method does not converge there: two curves cross."""
    found = branches.branch_of(branches.draw("damper on a hardening spring", seed))
    assert isinstance(found, ss.Branch)
    assert found.certificate.ok, found.certificate.describe()
    assert len(found.of_kind("branch point")) == 2
    points = found.points
    assert points["min_x"].values == pytest.approx(-points["max_x"].values, abs=1e-6)
    assert "the end of the range; last point" in found.ended


@pytest.mark.parametrize("kind", ["stick onset", "fold"])
def test_a_point_that_is_moved_is_wrong(monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    """By 1e-6 of the range: the cycle beside it, or none, is no special one."""
    case = branches.draw("slider that heats", 1)
    found = branches.branch_of(case)
    assert isinstance(found, ss.Branch)
    off = 1e-6 * (case.reach[1] - case.reach[0])
    (point,) = found.of_kind(kind)
    moved = replace(found, special=[replace(point, value=point.value - off)])
    monkeypatch.setattr(branches, "branch_of", lambda case: moved)
    assert branches.judge(case).kind == WRONG


def test_a_fold_that_is_left_out_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    case = branches.draw("belt with more damping", 1)
    found = branches.branch_of(case)
    assert isinstance(found, ss.Branch)
    (onset,) = found.of_kind("stick onset")
    monkeypatch.setattr(branches, "branch_of", lambda case: replace(found, special=[onset]))
    assert branches.judge(case).note == "a fold is missing"


def test_families() -> None:
    for family in FAMILIES:
        one, same, other = (branches.draw(family, seed) for seed in (3, 3, 4))
        assert (one.parameters, one.initial, one.reach) == (
            same.parameters,
            same.initial,
            same.reach,
        )
        assert (one.parameters, one.initial) != (other.parameters, other.initial)
        assert one.reach[0] < one.parameters[one.parameter] < one.reach[1]
        assert np.isfinite(one.duration)
        assert "ss.continue_cycle(cycle" in branches.reproduction(one)
