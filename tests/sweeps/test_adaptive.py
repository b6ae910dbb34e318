"""Adaptive maps against full ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import DeclarationError
from stickslip.sweeps.adaptive import Adaptive
from stickslip.sweeps.sweep import sweep
from sweeps import stand_in

TOY = ss.catalogue.rocking_toy()
OVER = {"P": "0.6:1.6:65", "delta": "0.01:0.2:65"}


@pytest.fixture(autouse=True)
def _closed_forms(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in.put_in_place(monkeypatch)


def test_the_boundary_is_that_of_the_full_map_at_a_fraction_of_its_cost(tmp_path: Path) -> None:
    part = sweep(
        TOY, OVER, ["speed", "period"], tmp_path / "toy.zarr", adaptive=Adaptive(("outcome",))
    ).dataset
    computed = part["outcome"].values >= 0
    assert sum(stand_in.calls) == np.count_nonzero(computed)
    assert np.mean(computed) < 0.25
    full = sweep(TOY, OVER, ["speed", "period"]).dataset
    for name in full.data_vars:
        np.testing.assert_array_equal(part[name].values[computed], full[name].values[computed])
    # Walking and resting differ in `period`: it is there or not.
    np.testing.assert_array_equal(np.isnan(part["period"].values), np.isnan(full["period"].values))
    # Linear interpolation over an eighth of the map: h² max |f″|/8 for sin 3P.
    assert (
        np.max(np.abs(part["speed"].values - full["speed"].values)) < (1.0 / 8.0) ** 2 * 9.0 / 8.0
    )
    assert set(np.unique(part["outcome"])) == {-2, 0, 1}


def test_refinement_by_a_measure_bounds_its_error() -> None:
    smooth = {"P": "1.35:1.6:65", "delta": "0.01:0.2:33"}  # walks everywhere
    full = sweep(TOY, smooth, ["speed"])["speed"].values
    errors = []
    for contrast in (0.2, 0.05):
        stand_in.calls.clear()
        part = sweep(TOY, smooth, ["speed"], adaptive=Adaptive(("speed",), contrast)).dataset
        assert sum(stand_in.calls) < full.size
        errors.append(np.max(np.abs(part["speed"].values - full)))
        assert errors[-1] < contrast * np.ptp(full)
    assert errors[1] <= errors[0]


def test_taken_up_again_and_filled(tmp_path: Path) -> None:
    over = {"P": "0.6:1.6:33", "delta": "0.01:0.2:33"}
    store = tmp_path / "toy.zarr"
    first = sweep(TOY, over, ["speed"], store, adaptive=Adaptive()).dataset.load()
    new = int((first["outcome"] >= 0).sum())
    stand_in.calls.clear()
    again = sweep(TOY, over, ["speed"], store, adaptive=Adaptive()).dataset
    assert not stand_in.calls
    assert again["speed"].values.tobytes() == first["speed"].values.tobytes()
    filled = sweep(TOY, over, ["speed"], store).dataset
    assert sum(stand_in.calls) == filled["speed"].size - new
    assert filled["speed"].values.tobytes() == sweep(TOY, over, ["speed"])["speed"].values.tobytes()


def test_three_axes() -> None:
    over = {"P": "0.6:1.6:33", "delta": "0.01:0.2:33", "psi": "0,1"}
    part = sweep(TOY, over, ["period"], adaptive=Adaptive()).dataset
    assert np.mean(part["outcome"].values >= 0) < 0.6
    full = sweep(TOY, over, ["period"]).dataset
    np.testing.assert_array_equal(np.isnan(part["period"].values), np.isnan(full["period"].values))


@pytest.mark.parametrize(
    ("over", "by", "said"),
    [
        (OVER, ("speeed",), "not one of the measures"),
        (OVER, (), "contrast"),
        ({"P": "3,1,2"}, ("outcome",), "not ordered"),
        ({"P,delta": "sobol:16; 1:2; 0.1:0.2"}, ("outcome",), "not ordered"),
    ],
)
def test_refused(over: dict[str, str], by: tuple[str, ...], said: str) -> None:
    with pytest.raises(DeclarationError, match=said):
        sweep(TOY, over, ["speed"], adaptive=Adaptive(by))
    assert not stand_in.calls
