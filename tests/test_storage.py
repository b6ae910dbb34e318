"""Files of results with many variables: few arrays, read back as they were."""

from __future__ import annotations

import json
import os
import resource
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr

import stickslip as ss
from stickslip import checksums, packing, storage
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


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    motion = ss.simulate(ss.catalogue.belt_block(), (0.0, 3.0))
    motion.save(tmp_path / "motion.nc")
    return tmp_path / "motion.nc"


def test_whatever_is_changed_is_named(stored: Path) -> None:
    """By a program that writes the file anew; the checksum at its end is gone then."""
    with netCDF4.Dataset(stored) as file:
        variables = [n for n, v in file.variables.items() if v.size]
        attributes = file.ncattrs()
    content = stored.read_bytes()
    assert len(variables) > 10 and len(attributes) > 8
    for name in [*variables, *attributes]:
        stored.write_bytes(content)
        with netCDF4.Dataset(stored, "r+") as file:
            if name in variables:
                variable = file.variables[name]
                variable.set_auto_mask(False)
                values = variable[...]
                values.flat[-1] = 0.123 if values.dtype.kind == "f" else values.flat[-1] + 1
                variable[...] = values
            else:
                file.setncattr(name, f"_{file.getncattr(name)}")
        with pytest.raises(ss.StickslipError, match=f"damaged: .*{name}|not a result"):
            ss.open(stored)


def test_what_others_add_is_no_damage(stored: Path) -> None:
    expected = ss.open(stored).dataset
    with netCDF4.Dataset(stored, "r+") as file:
        file.note = "of Tuesday"
        file.createVariable("mine", float)[...] = 1.0
    assert ss.open(stored).dataset.identical(expected)
    with xr.open_dataset(stored) as data:
        data.load().to_netcdf(stored.with_name("copy.nc"))
    assert ss.open(stored.with_name("copy.nc")).dataset.identical(expected)


def test_files_without_checksums_are_called_unchecked(stored: Path) -> None:
    expected = ss.open(stored).dataset
    with netCDF4.Dataset(stored, "r+") as file:
        file.delncattr(checksums.TABLE)
    with pytest.raises(ss.StickslipError, match=f"damaged: {checksums.TABLE}"):
        ss.open(stored)
    with netCDF4.Dataset(stored, "r+") as file:
        file.delncattr(checksums.LAYOUT)
    with pytest.warns(match=r"motion\.nc: stored without checksums"):
        assert ss.open(stored).dataset.identical(expected)


def test_maps_without_checksums_are_called_unchecked(tmp_path: Path) -> None:
    path = tmp_path / "map.zarr"
    given: Any = (ss.catalogue.rocking_toy(), {"P": [1.1, 1.2]}, ["speed"], path)
    expected = ss.sweep(*given).dataset.load()
    described = json.loads((path / "zarr.json").read_text())
    for key in (checksums.TABLE, checksums.LAYOUT):
        del described["attributes"][key]
    (path / "zarr.json").write_text(json.dumps(described))
    for again in (lambda: ss.open(path), lambda: ss.sweep(*given)):
        with pytest.warns(match=r"map\.zarr: stored without checksums"):
            assert again().dataset.identical(expected)


def test_a_full_disk_is_said(stored: Path) -> None:
    motion = ss.open(stored)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    content = stored.read_bytes()
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
        with pytest.raises(ss.StickslipError, match=r"motion\.nc: cannot be written"):
            motion.save(stored)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert stored.read_bytes() == content and [*stored.parent.iterdir()] == [stored]


@pytest.mark.parametrize("make", ["fifo", "folder", "empty", "long", "nul"])
def test_what_is_no_file_is_said(tmp_path: Path, make: str) -> None:
    place: Path | str = tmp_path / make
    match make:
        case "fifo":
            os.mkfifo(place)
        case "folder":
            Path(place).mkdir()
        case "empty":
            Path(place).touch()
        case "long":
            place = tmp_path / ("x" * 5000)
        case "nul":
            place = f"{tmp_path}/a\0b"
    for read in (ss.open, ss.Trajectory.open, ss.Map.open):
        with pytest.raises(ss.StickslipError):
            read(place)
