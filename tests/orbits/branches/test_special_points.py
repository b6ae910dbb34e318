"""Special points are solved, measured, and part of the certificate of their branch."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adversarial.kinds import branches
from orbits.examples import SLIDER
from stickslip import catalogue
from stickslip.certificates import Certificate, Residual
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.branches.equilibrium_branch import continue_equilibrium
from stickslip.orbits.continuation.branch import Branch, with_special
from stickslip.orbits.cycles.find_cycle import find_cycle


@pytest.fixture(scope="module")
def branch() -> Branch:
    """An onset of stick 3.5e-6 beside a smooth fold."""
    system = catalogue.spring_slider(mu="0.4+1.2*exp(-(alpha-1))", nu=0.05)
    cycle = find_cycle(system, {"U": 1.6, "alpha": 1.02}, parameters={"V": 0.1})
    return continue_cycle(cycle, "V", (0.05, 0.3))


def test_a_fold_beside_an_onset(branch: Branch) -> None:
    """Simulations stick and slip at V = 0.287826, and come to rest at 0.28783."""
    assert [point.kind for point in branch.special] == ["fold", "stick onset", "Hopf"]
    fold, onset, _ = branch.special
    assert onset.value == pytest.approx(0.287824649765, abs=1e-11)
    assert fold.value == pytest.approx(0.287828168200, abs=1e-11)
    assert branch.points["V"].values.max() == fold.value
    assert branch.certificate.ok, branch.certificate.describe()


def test_every_special_point_is_measured(branch: Branch) -> None:
    steady = continue_equilibrium(SLIDER, "V", (0.2, 0.25))
    for found in (branch, steady):
        assert found.special
        for point in found.special:
            assert point.residuals
            assert point.certificate.ok
            for residual in point.residuals:
                assert found.certificate[f"{point.kind}: {residual.name}"].value == residual.value


def test_what_is_not_solved_is_not_certified(branch: Branch) -> None:
    """And says so; what was not measured is not certified either."""
    fold = branch.special[0]
    off = replace(fold, residuals=(Residual("slope of the parameter", 1e-5, 1e-8),))
    for point in (off, replace(fold, residuals=())):
        assert not with_special(branch.certificate, [point]).ok
        assert "not certified" in point.describe()
    assert with_special(Certificate(()), [fold]).ok


def test_residuals_are_stored(branch: Branch, tmp_path: Path) -> None:
    """Also those that are no number, or have no limit."""
    first, *others = branch.special
    odd = replace(first, residuals=(Residual("a", math.nan, 1.0), Residual("b", 1.0)))
    replace(branch, special=[odd, *others]).save(tmp_path / "branch.nc")
    again = Branch.open(tmp_path / "branch.nc")
    assert again.special[1:] == others
    assert math.isnan(again.special[0].residuals[0].value)
    assert again.special[0].residuals[1] == odd.residuals[1]
    assert again.certificate == branch.certificate


def test_the_clock_of_a_drive_is_put_back() -> None:
    """A branch over the frequency of its drive goes on as it went where its chart is made anew."""
    case = branches.draw("damper on a hardening spring", 3)
    found = branches.branch_of(case)
    assert isinstance(found, Branch)
    assert branches.unnamed(case, found) == ""
    assert found.points["omega"].values.max() > 2.3


def test_sides_that_do_not_meet_are_two_branches() -> None:
    """Static friction above kinetic: the motion jumps where it first touches the speed of rest."""
    for seed, where in ((1, 1.92150387204), (7, None)):
        found = branches.branch_of(branches.draw("driven on a hardening spring", seed))
        assert isinstance(found, Branch)
        assert found.certificate.ok, found.certificate.describe()
        (lost,) = found.of_kind("loss of the cycle")
        assert where is None or lost.value == pytest.approx(where, abs=1e-10)
        assert not found.of_kind("stick onset")


def test_phases_too_short_to_count_hide_no_corner() -> None:
    """Both legs of the toy touch at once; the branch does not go back where it came from."""
    found = branches.branch_of(branches.draw("toy that walks", 10))
    assert isinstance(found, Branch)
    assert found.certificate.ok
    (fold,) = found.of_kind("fold")
    assert fold.value == pytest.approx(0.55621723393, abs=1e-9)
    assert np.min(found.points["P"].values) == pytest.approx(fold.value, abs=1e-9)
