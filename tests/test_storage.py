"""Files of results with many variables: few arrays, read back as they were."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import stickslip as ss
from stickslip import packing, storage
from stickslip.packing import in_all, in_few


def many(count: int) -> xr.Dataset:
    """Variables of several kinds."""
    rng = np.random.default_rng(0)
    time = ("time", np.linspace(0.0, 1.0, 7), {"units": "s"})
    flags = {"flag_values": np.array([-1, 0, 1], np.int8), "flag_meanings": "slip- stick slip+"}
    found: dict[str, object] = {
        "alone": (("time", "k"), rng.normal(size=(7, 2)), {"long_name": "only one of its kind"}),
        "text": ("time", np.array(list("abcdefg"), dtype=object), {}),
    }
    for i in range(count):
        found[f"x_{i}"] = ("time", rng.normal(size=7), {"units": "m", "long_name": f"place {i}"})
        found[f"v_{i}"] = ("time", rng.normal(size=7), {"units": "m/s"})
        found[f"mode_{i}"] = ("time", rng.integers(-1, 2, 7).astype(np.int8), flags)
        found[f"bare_{i}"] = ("time", rng.normal(size=7), {})
    found["x_0"][1][2] = np.nan  # type: ignore[index]
    return xr.Dataset(found, {"time": time}, {"title": "many"})


def test_few_variables_stay_as_they_are() -> None:
    data = many(3)
    assert in_few(data) is data and in_all(data) is data


def test_many_variables_are_few_arrays(tmp_path: Path) -> None:
    data = many(100)
    few = in_few(data)
    assert {*few.data_vars} == {"alone", *(f"packed_{k}" for k in range(1, 5)), "text"}
    lines = few["packed_1"]
    assert lines.dims == ("packed_1_names", "time") and lines.attrs["units"] == "m"
    np.testing.assert_array_equal(lines.sel(packed_1_names="x_7"), data["x_7"])
    storage.write(tmp_path / "many.nc", data, "map", 1, note="said")
    with storage.reading(tmp_path / "many.nc", "map", 1) as (again, parts):
        assert parts["note"] == "said"
        assert set(again.data_vars) == set(data.data_vars)
        for name, variable in data.variables.items():
            assert again[name].dims == variable.dims
            np.testing.assert_array_equal(again[name].values, variable.values)
            assert again[name].dtype == variable.dtype or variable.dtype == object
            for key, value in variable.attrs.items():
                np.testing.assert_array_equal(again[name].attrs[key], value)
        assert again["mode_3"].attrs["flag_values"].dtype == np.int8
    with xr.open_dataset(tmp_path / "many.nc") as plain:
        assert len(plain.data_vars) == 6


def test_files_of_both_layouts_are_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever wrote them: a chain of 30 blocks has 243 variables."""
    chain = ss.catalogue.block_chain(N=30)
    motion = ss.simulate(chain, (0.0, 0.5), initial={"x_1": 0.3})
    assert len(motion.dataset.data_vars) > 200
    motion.save(tmp_path / "new.nc")
    monkeypatch.setattr(packing, "_MANY", 10_000)
    motion.save(tmp_path / "old.nc")
    new, old = (ss.open(tmp_path / name) for name in ("new.nc", "old.nc"))
    with xr.open_dataset(tmp_path / "old.nc") as plain:
        np.testing.assert_array_equal(plain["x_7"], motion["x_7"])
    for again in (new, old):
        np.testing.assert_array_equal(again.knots.state, motion.knots.state)
        assert again.certificate == motion.certificate
        assert again.dataset.identical(motion.dataset)
    assert (tmp_path / "new.nc").stat().st_size < (tmp_path / "old.nc").stat().st_size
