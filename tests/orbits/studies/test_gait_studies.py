"""Walking of the toy against its parameters, and the least pulls that walk and that slide.

A. Mielke, *Three examples concerning the interaction of dry friction and oscillations*, WIAS
preprint 2405 (2017), section 4: in simple walking the stride is 2X, and sliding without rocking
needs P ≥ ρ + H*/2.
"""

from __future__ import annotations

import numpy as np
import pytest

from stickslip import catalogue, simulate
from stickslip.errors import DeclarationError
from stickslip.motion.outcome import Outcome
from stickslip.orbits.branches.cycle_branch import continue_cycle
from stickslip.orbits.studies.gaits import gait_study, sliding_threshold, walking_threshold

WALK = {"psi": -1.67}
UPRIGHT = {"psi": 0.0, "x_R": 0.0}


def test_speed_over_the_pull() -> None:
    found = gait_study(catalogue.rocking_toy(), "P", [0.55, 0.8, 1.0, 1.2], initial=WALK)
    assert found["walks"].values.tolist() == [False, True, True, True]
    P, T = found["P"].values[1:], found["period"].values[1:]
    X = P - 0.2 - 0.3
    assert found["stride"].values[1:] == pytest.approx(2 * X, rel=1e-11)
    assert found["speed"].values[1:] == pytest.approx(2 * X / T, rel=1e-11)
    # Both legs are pulled by P, and nothing is stored in a period.
    assert found["energy_per_distance"].values[1:] == pytest.approx(2 * P, rel=1e-10)
    assert found["amplitude_psi"].values[2] == pytest.approx(1.6235734, abs=1e-6)
    assert "rest" in str(found["note"].values[0])
    assert all(
        np.all(np.isfinite(values))
        for name, values in found.dataset.data_vars.items()
        if name != "note"
    )


@pytest.mark.parametrize(
    ("parameter", "values"), [("delta", [0.02, 0.05, 0.09]), ("c", [0.2, 0.35, 0.5])]
)
def test_rocking_takes_up_what_the_legs_feed_in(parameter: str, values: list[float]) -> None:
    """δ∮ψ'² = 2cX(ψ₃ + ψ*): for a nearly harmonic rocking πδA²ω."""
    found = gait_study(catalogue.rocking_toy(), parameter, values, initial=WALK)
    toy = catalogue.rocking_toy()
    for i, value in enumerate(values):
        v = {**toy.values, parameter: value}
        X = v["P"] - v["rho"] - v["c"]
        psi_3 = (v["H_star"] / 2 - 2 * v["P"] + 2 * v["rho"] + v["c"]) / (v["H_star"] / 2 - v["c"])
        fed = 2 * v["c"] * X * (psi_3 + 1)
        taken = (
            np.pi
            * v["delta"]
            * found["amplitude_psi"].values[i]
            * found["amplitude_d_psi"].values[i]
        )
        assert taken == pytest.approx(fed, rel=0.05)


def test_smallest_pull_that_walks() -> None:
    """Without masses walking ends where the amplitude falls to ψ*: the held leg is then not let go
    any more."""
    toy = catalogue.rocking_toy()
    found = walking_threshold(toy, "P", (0.616, 0.618), initial=WALK, tolerance=1e-4)
    assert found.value == pytest.approx(0.616606, abs=5e-7)
    assert found.gait is not None
    assert found.gait.extrema["psi"] == pytest.approx((-1.0, 1.0), abs=2e-6)
    # There the stable and the unstable gait meet, not smoothly: the sequence changes.
    branch = continue_cycle(found.gait, "P", (0.616, 0.617))
    (fold,) = branch.of_kind("fold")
    assert fold.value == pytest.approx(found.value, abs=5e-7)
    assert "not smooth" in fold.note
    assert set(branch.points["stable"].values.tolist()) == {0, 1}
    for P, outcome in (
        (found.moving + 1e-3, Outcome.FINISHED),
        (found.still - 1e-2, Outcome.AT_REST),
    ):
        motion = simulate(
            toy, (0.0, 2000.0), initial={"psi": -1.05, "x_R": P - 0.5}, parameters={"P": P}
        )
        assert motion.outcome is outcome


@pytest.mark.parametrize(
    ("system", "parameter", "span", "pull"),
    [("rocking_toy", "P", (1.0, 2.0), 1.0), ("rocking_toy_inertial", "g", (100.0, 200.0), 0.01)],
)
def test_smallest_pull_that_slides(
    system: str, parameter: str, span: tuple[float, float], pull: float
) -> None:
    found = sliding_threshold(catalogue.get(system), parameter, span, initial=UPRIGHT)
    assert pull * found.value == pytest.approx(1.7, abs=1e-6)
    assert found.gait is None


def test_inertia_helps() -> None:
    """With masses the toy walks at a pull (g m_W/2 = g/100) that is too small without."""
    found = walking_threshold(
        catalogue.rocking_toy_inertial(), "g", (50.0, 60.0), initial=WALK, tolerance=0.02
    )
    assert 0.01 * found.value == pytest.approx(0.5275, abs=2e-3)


def test_bad_arguments() -> None:
    toy = catalogue.rocking_toy()
    with pytest.raises(DeclarationError, match="at both ends"):
        sliding_threshold(toy, "P", (0.5, 1.0), initial=UPRIGHT)
    with pytest.raises(DeclarationError, match="Q"):
        gait_study(toy, "Q", [1.0])
    with pytest.raises(DeclarationError, match="not a range"):
        walking_threshold(toy, "P", (1.0, 0.5))
    with pytest.raises(DeclarationError, match="values: the list is empty"):
        gait_study(toy, "P", [])
    for tolerance in (0.0, -1.0, np.inf):
        with pytest.raises(DeclarationError, match=r"tolerance: .* is not a tolerance"):
            sliding_threshold(toy, "P", (1.0, 2.0), initial=UPRIGHT, tolerance=tolerance)


def test_bisection_ends_at_neighbouring_numbers() -> None:
    """A tolerance below the spacing of numbers does not make the bisection endless."""
    toy = catalogue.rocking_toy()
    found = sliding_threshold(toy, "P", (1.0, 2.0), initial=UPRIGHT, tolerance=1e-300)
    assert 0.0 < abs(found.moving - found.still) <= 2.0 * np.spacing(found.moving)
